//! From a seed to a building: programme, plan, doors, walls, furniture, small things, captions, one step after the other.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::building::{
    Building, BuildingConfig, DoorAxis, DoorTruth, ObjectTruth, RoomKind, RoomTruth, SceneError,
};
use crate::caption::write_captions;
use crate::catalog::class;
use crate::colors::draw_color;
use crate::doors::{PlanDoor, draw_doors};
use crate::floorplan::{StoreyPlan, draw_plans};
use crate::furniture::{essentials, furnish};
use crate::mesh::{Mover, TriangleMesh};
use crate::models::build;
use crate::placement::{Furnisher, Item, Place, RoomSpace, is_viewable};
use crate::shape::{Model, Part, Placement, Solid};
use crate::small_things::strew;
use crate::walls::{CEILING_M, Finish, SLAB_M, STOREY_M, StairShaft, StoreyWalls, stair_hole};

/// Plans drawn before giving up on a seed.
const PLAN_ATTEMPTS: usize = 40;
/// Times a room is furnished; the best is kept.
const ROOM_ATTEMPTS: usize = 3;
/// Times at most, if essentials are missing.
const ROOM_ATTEMPTS_MAX: usize = 12;

/// Makes a building. The same configuration gives the same building, byte for byte.
///
/// # Errors
/// A configuration out of range, see [`SceneError`].
pub fn generate(config: &BuildingConfig) -> Result<Building, SceneError> {
    config.validate()?;
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    for _ in 0..PLAN_ATTEMPTS {
        let Some(plans) = draw_plans(
            &mut rng,
            config.style,
            config.rooms as usize,
            config.storeys as usize,
        ) else {
            continue;
        };
        let doors: Option<Vec<Vec<PlanDoor>>> = plans
            .iter()
            .map(|p| draw_doors(&mut rng, p, config.min_door_m))
            .collect();
        if let Some(doors) = doors {
            return Ok(raise(
                &plans,
                &doors,
                config.seed,
                config.passage_m,
                Furnishing::Full,
            ));
        }
    }
    Err(SceneError::NoPlan {
        seed: config.seed,
        rooms: config.rooms,
    })
}

impl BuildingConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// The first field out of range.
    pub fn validate(&self) -> Result<(), SceneError> {
        if !(2..=30).contains(&self.rooms) {
            return Err(SceneError::Rooms(self.rooms));
        }
        if !(1..=2).contains(&self.storeys) {
            return Err(SceneError::Storeys(self.storeys));
        }
        if self.storeys == 2 && self.rooms < 8 {
            return Err(SceneError::RoomsForStoreys(self.rooms));
        }
        if !(0.7..=1.4).contains(&self.min_door_m) {
            return Err(SceneError::Door(self.min_door_m));
        }
        if !(0.5..=self.min_door_m).contains(&self.passage_m) {
            return Err(SceneError::Passage(self.passage_m));
        }
        Ok(())
    }
}

/// What stands in the rooms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Furnishing {
    /// Furniture and small things.
    Full,
    /// Nothing.
    Bare,
}

/// Builds walls and furniture on finished plans.
pub(crate) fn raise(
    plans: &[StoreyPlan],
    doors: &[Vec<PlanDoor>],
    seed: u64,
    passage_m: f64,
    furnishing: Furnishing,
) -> Building {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1);
    let thickness_m = *[0.10, 0.11, 0.12].choose(&mut rng).unwrap_or(&0.12);
    let shaft = if plans.len() > 1 {
        stair_hole(&plans[0], &doors[0], thickness_m)
    } else {
        None
    };
    let hole = shaft.map(|s| s.hole);
    let mut building = Building {
        rooms: Vec::new(),
        doors: Vec::new(),
        objects: Vec::new(),
        mesh: TriangleMesh::default(),
        movers: Vec::new(),
    };
    let top_z = STOREY_M * (plans.len() - 1) as f64 + CEILING_M;
    for (storey, (plan, plan_doors)) in plans.iter().zip(doors).enumerate() {
        let floor_z_m = STOREY_M * storey as f64;
        let walls = StoreyWalls::new(plan, plan_doors, thickness_m, floor_z_m, hole);
        let first_room = building.rooms.len() as u32;
        let finishes: Vec<Finish> = plan
            .rooms
            .iter()
            .map(|r| finish(&mut rng, r.kind))
            .collect();
        let (below, above) = (
            hole.filter(|_| storey > 0),
            hole.filter(|_| storey + 1 < plans.len()),
        );
        walls.push_inside(&mut building.mesh, &finishes, below, above);
        if storey == 0 {
            walls.push_shell(&mut building.mesh, -0.1, top_z + 0.1);
        }
        building
            .doors
            .extend(walls.door_truths(plan_doors, first_room));
        for (index, room) in plan.rooms.iter().enumerate() {
            building.rooms.push(RoomTruth {
                id: first_room + index as u32,
                kind: room.kind,
                name: String::new(),
                rects: walls.floors[index].clone(),
                floor_z_m,
                height_m: CEILING_M,
                storey: storey as u32,
            });
        }
        let entrance = (storey == 0).then(|| entrance_room(plan));
        for (index, room) in plan.rooms.iter().enumerate() {
            let is_stairwell = room.kind == RoomKind::Stairwell;
            let space = RoomSpace {
                floor: walls.floors[index].clone(),
                faces: walls.faces[index].clone(),
                doors: door_fronts(&walls, plan_doors, index),
                closed: hole.filter(|_| is_stairwell).into_iter().collect(),
                floor_z_m,
                passage_m,
            };
            let id = first_room + index as u32;
            let mut room_rng = ChaCha8Rng::seed_from_u64(seed);
            room_rng.set_stream(16 + u64::from(id));
            let items = if furnishing == Furnishing::Full {
                furnish_room(&mut room_rng, &space, room.kind, entrance == Some(index))
            } else {
                Vec::new()
            };
            add_items(&mut building, items, id);
            if is_stairwell
                && storey == 0
                && let Some(shaft) = shaft
            {
                add_stairs(&mut building, &mut room_rng, &shaft, id);
            }
        }
    }
    if let Some(shaft) = shaft {
        add_shaft(&mut building, plans, &shaft);
    }
    name_rooms(&mut building.rooms);
    rng.set_stream(2);
    write_captions(&mut rng, &mut building.objects);
    building
}

/// The best of a few attempts: one that has all essentials of the room's kind, then the richest.
fn furnish_room(
    rng: &mut ChaCha8Rng,
    space: &RoomSpace,
    kind: RoomKind,
    is_entrance: bool,
) -> Vec<Item> {
    let mut best: Option<(usize, Vec<Item>)> = None;
    let wanted = essentials(kind);
    for attempt in 0..ROOM_ATTEMPTS_MAX {
        let items = try_furnishing(rng, space, kind, is_entrance);
        let has = |name: &&&str| items.iter().any(|i| i.class.name == **name);
        let present = wanted.iter().filter(has).count();
        // A desk or a table wants its chairs more than a room wants another picture.
        let seats = items
            .iter()
            .filter(|i| i.class.name.ends_with("chair"))
            .count();
        let score = 1000 * present + items.len() + 2 * seats;
        if best.as_ref().is_none_or(|(b, _)| score > *b) {
            best = Some((score, items));
        }
        let is_complete = best
            .as_ref()
            .is_some_and(|(b, _)| *b >= 1000 * wanted.len());
        if is_complete && attempt + 1 >= ROOM_ATTEMPTS {
            break;
        }
    }
    best.map(|(_, items)| items).unwrap_or_default()
}

/// Entrance and door leaves first, then furniture, small things; what no robot could look at is taken out again.
fn try_furnishing(
    rng: &mut ChaCha8Rng,
    space: &RoomSpace,
    kind: RoomKind,
    is_entrance: bool,
) -> Vec<Item> {
    let mut furnisher = Furnisher::new(rng, space);
    if is_entrance {
        furnisher.put_entrance();
    }
    hang_leaves(&mut furnisher, kind);
    furnish(&mut furnisher, kind);
    strew(&mut furnisher, kind);
    let Some(reach) = furnisher.reach() else {
        return Vec::new();
    };
    let items = furnisher.items;
    let mut keep = vec![true; items.len()];
    for (i, item) in items.iter().enumerate() {
        let others: Vec<_> = (0..items.len())
            .filter(|&k| k != i)
            .map(|k| items[k].parts.as_slice())
            .collect();
        // Supports come before what they carry, so one pass is enough.
        keep[i] = item.support.is_none_or(|s| keep[s])
            && is_viewable(&item.bounds, &item.parts, &others, space, &reach);
    }
    let mut new_index = vec![0; items.len()];
    let mut count = 0;
    for (i, k) in keep.iter().enumerate() {
        new_index[i] = count;
        count += usize::from(*k);
    }
    let kept = items
        .into_iter()
        .zip(&keep)
        .filter(|(_, k)| **k)
        .map(|(i, _)| i);
    kept.map(|mut i| {
        i.support = i.support.map(|s| new_index[s]);
        i
    })
    .collect()
}

/// Some doorways have a leaf, opened flat against the wall beside them.
fn hang_leaves(furnisher: &mut Furnisher, kind: RoomKind) {
    if matches!(
        kind,
        RoomKind::Hallway | RoomKind::Corridor | RoomKind::Stairwell
    ) {
        return; // leaves open into the rooms
    }
    let Some(leaf_class) = class("door") else {
        return;
    };
    for (middle, inward, width) in furnisher.space.doors.clone() {
        if !furnisher.rng.random_bool(0.45) {
            continue;
        }
        let along = Vector2::new(-inward.y, inward.x);
        let color = leaf_class
            .colors
            .choose(furnisher.rng)
            .copied()
            .unwrap_or("white");
        let rgb = draw_color(furnisher.rng, color);
        let model = build(leaf_class.form, width, 0.04, 2.0, rgb);
        let side = if furnisher.rng.random_bool(0.5) {
            1.0
        } else {
            -1.0
        };
        for s in [side, -side] {
            // 3 cm clear of the wall and 6 cm clear of the jamb.
            let p = middle + along * s * (width + 0.06) + inward * 0.05;
            let origin = Point3::new(p.x, p.y, furnisher.space.floor_z_m + 0.01);
            let placement = Placement {
                origin,
                yaw_rad: inward.y.atan2(inward.x),
            };
            let bounds = model.bounds(&placement);
            // The wall behind the leaf must be whole.
            let foot = bounds.footprint();
            let backed = furnisher.space.faces.iter().any(|f| {
                let r = f.rect().grown(0.08);
                f.inward == inward && r.contains(&foot.min) && r.contains(&foot.max)
            });
            if !backed || !furnisher.is_clear(leaf_class, &bounds) {
                continue;
            }
            let item = Item {
                class: leaf_class,
                color,
                rgb,
                material: "wood",
                parts: model.part_bounds(&placement),
                model: model.clone(),
                placement,
                bounds,
                support: None,
                is_mover: true,
            };
            if furnisher.accept(item) {
                break;
            }
        }
    }
}

impl Furnisher<'_> {
    /// The closed door to the outside, on an outer wall; its front stays free.
    fn put_entrance(&mut self) {
        if let Some(index) = self.put("door", Place::OuterWall, None) {
            self.keep_front_free(index);
        }
    }
}

/// The room one enters first: hallway or corridor, else reception, living room or the first room.
fn entrance_room(plan: &StoreyPlan) -> usize {
    let first = |kind: RoomKind| plan.rooms.iter().position(|r| r.kind == kind);
    [
        RoomKind::Hallway,
        RoomKind::Corridor,
        RoomKind::Reception,
        RoomKind::LivingRoom,
    ]
    .into_iter()
    .find_map(first)
    .unwrap_or(0)
}

/// Doorways of a room: middle at the wall's surface, direction into the room, width.
fn door_fronts(
    walls: &StoreyWalls,
    doors: &[PlanDoor],
    room: usize,
) -> Vec<(nalgebra::Point2<f64>, Vector2<f64>, f64)> {
    doors
        .iter()
        .zip(&walls.openings)
        .filter(|(d, _)| d.rooms.0 == room || d.rooms.1 == room)
        .map(|(d, r)| {
            let axis = if d.opening.vertical {
                Vector2::new(1.0, 0.0)
            } else {
                Vector2::new(0.0, 1.0)
            };
            let half = if d.opening.vertical {
                r.width_m()
            } else {
                r.height_m()
            } / 2.0;
            let ahead = r.center() + axis * (half + 0.05);
            let inward = if walls.floors[room].iter().any(|f| f.contains(&ahead)) {
                axis
            } else {
                -axis
            };
            (r.center() + inward * half, inward, d.width_m())
        })
        .collect()
}

fn add_items(building: &mut Building, items: Vec<Item>, room: u32) {
    let first = building.objects.len() as u32 + 1;
    for (k, item) in items.into_iter().enumerate() {
        let id = first + k as u32;
        if item.is_mover {
            let mut mesh = TriangleMesh::default();
            item.model.push(
                &mut mesh,
                &Placement {
                    origin: Point3::origin(),
                    yaw_rad: 0.0,
                },
                id,
            );
            let rotation =
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), item.placement.yaw_rad);
            let pose =
                Isometry3::from_parts(Translation3::from(item.placement.origin.coords), rotation);
            building.movers.push(Mover {
                instance: id,
                mesh,
                path: vec![(0, pose)],
            });
        } else {
            item.model.push(&mut building.mesh, &item.placement, id);
        }
        building.objects.push(ObjectTruth {
            id,
            class: item.class.name.to_string(),
            color: item.color.to_string(),
            rgb: item.rgb,
            material: item.material.to_string(),
            function: item.class.function.to_string(),
            caption: String::new(),
            bounds: item.bounds,
            yaw_rad: item.placement.yaw_rad,
            room,
            supported_by: item.support.map(|s| first + s as u32),
        });
    }
}

/// Two flights of solid steps with a landing half-way, turning left or right of the middle.
fn add_stairs(building: &mut Building, rng: &mut ChaCha8Rng, shaft: &StairShaft, room: u32) {
    let Some(class) = class("staircase") else {
        return;
    };
    let color = class.colors.choose(rng).copied().unwrap_or("grey");
    let rgb = draw_color(rng, color);
    // Model frame: x from the landing inwards, y to the left, origin in the middle of the hole.
    let along_x = shaft.inward.x.abs() > 0.5;
    let (deep, wide) = if along_x {
        (shaft.hole.width_m(), shaft.hole.height_m())
    } else {
        (shaft.hole.height_m(), shaft.hole.width_m())
    };
    let steps = 8;
    let rise = STOREY_M / (2 * steps) as f64;
    let half_landing = 1.1f64.min(deep * 0.35);
    let run = (deep - half_landing) / steps as f64;
    let mut model = Model::default();
    let mut block = |x0: f64, x1: f64, y0: f64, y1: f64, z1: f64| {
        model.parts.push(Part {
            solid: Solid::Block {
                min: Point3::new(x0, y0, 0.0),
                max: Point3::new(x1, y1, z1),
            },
            rgb,
        });
    };
    let x0 = -deep / 2.0;
    for k in 0..steps {
        let x = x0 + run * k as f64;
        block(x, x + run, 0.0, wide / 2.0, rise * (k + 1) as f64);
        // The second flight comes back towards the landing; its last step is the upper floor itself.
        let high = rise * (2 * steps - k) as f64;
        block(
            x,
            x + run,
            -wide / 2.0,
            0.0,
            if k == 0 { high - 0.001 } else { high },
        );
    }
    block(
        deep / 2.0 - half_landing,
        deep / 2.0,
        -wide / 2.0,
        wide / 2.0,
        rise * steps as f64,
    );
    let middle = shaft.hole.center();
    let placement = Placement {
        origin: Point3::new(middle.x, middle.y, 0.0),
        yaw_rad: shaft.inward.y.atan2(shaft.inward.x),
    };
    let item = Item {
        class,
        color,
        rgb,
        material: "concrete",
        bounds: model.bounds(&placement),
        parts: model.part_bounds(&placement),
        model,
        placement,
        support: None,
        is_mover: false,
    };
    // A railing of 0.9 m on the upper floor before the lower flight.
    let rail = Model {
        parts: vec![Part {
            solid: Solid::block(x0 - 0.03, wide / 4.0, STOREY_M, 0.04, wide / 2.0, 0.9),
            rgb: [120, 120, 125],
        }],
        ..Default::default()
    };
    rail.push(&mut building.mesh, &placement, 0);
    add_items(building, vec![item], room);
}

/// The shaft as an opening between the two stairwells.
fn add_shaft(building: &mut Building, plans: &[StoreyPlan], shaft: &StairShaft) {
    let upper = plans[1]
        .rooms
        .iter()
        .position(|r| r.kind == RoomKind::Stairwell);
    let Some(upper) = upper else { return };
    let (w, h) = (shaft.hole.width_m(), shaft.hole.height_m());
    let middle = shaft.hole.center();
    building.doors.push(DoorTruth {
        rooms: (shaft.room as u32, (plans[0].rooms.len() + upper) as u32),
        center: Point3::new(middle.x, middle.y, CEILING_M + SLAB_M),
        width_m: w.min(h),
        height_m: w.max(h),
        axis: DoorAxis::Z,
    });
}

/// `"bedroom"`, `"bedroom 2"`, ...
fn name_rooms(rooms: &mut [RoomTruth]) {
    for i in 0..rooms.len() {
        let before = rooms[..i]
            .iter()
            .filter(|r| r.kind == rooms[i].kind)
            .count();
        let name = rooms[i].kind.name();
        rooms[i].name = if before == 0 {
            name.to_string()
        } else {
            format!("{name} {}", before + 1)
        };
    }
}

/// Paint and flooring of a room.
fn finish(rng: &mut ChaCha8Rng, kind: RoomKind) -> Finish {
    use RoomKind::*;
    const PAINTS: [[u8; 3]; 7] = [
        [236, 233, 226],
        [228, 226, 220],
        [232, 226, 206],
        [216, 224, 230],
        [222, 230, 218],
        [234, 220, 212],
        [226, 222, 232],
    ];
    const WOODS: [[u8; 3]; 3] = [[168, 128, 88], [186, 150, 108], [140, 104, 70]];
    const TILES: [[u8; 3]; 3] = [[188, 190, 192], [204, 200, 190], [160, 168, 172]];
    const CARPETS: [[u8; 3]; 3] = [[112, 122, 136], [128, 118, 112], [104, 116, 108]];
    let floors: &[[u8; 3]] = match kind {
        Kitchen | Bathroom | LaundryRoom | Lab | Stairwell | Reception | StorageRoom => &TILES,
        Office | MeetingRoom | Corridor | PrintRoom => &CARPETS,
        _ => &WOODS,
    };
    Finish {
        wall: PAINTS.choose(rng).copied().unwrap_or(PAINTS[0]),
        floor: floors.choose(rng).copied().unwrap_or(floors[0]),
    }
}
