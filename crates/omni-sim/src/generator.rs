//! From a seed to a building: programme, plan, doors, walls, furniture, small things, captions, one step after the other.

use nalgebra::Vector2;
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use crate::building::{Building, BuildingConfig, RoomKind, RoomTruth, SceneError};
use crate::caption::write_captions;
use crate::cooccurrence::{Cooccurrence, Habits};
use crate::door_leaves::hang_leaves;
use crate::doors::{PlanDoor, draw_doors, leads_through_private_rooms};
use crate::floorplan::{StoreyPlan, draw_plans};
use crate::furniture::{essentials, furnish};
use crate::item::{Item, add_items};
use crate::mesh::TriangleMesh;
use crate::placement::{Furnisher, RoomSpace};
use crate::small_things::strew;
use crate::stairs::{add_shaft, add_stairs, stair_shaft};
use crate::viewing::is_viewable;
use crate::walls::{CEILING_M, Finish, STOREY_M, StoreyWalls};

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
    for attempt in 0..PLAN_ATTEMPTS {
        let Some(plans) = draw_plans(&mut rng, config.style, config.rooms as usize, config.storeys as usize) else {
            continue;
        };
        let doors: Option<Vec<Vec<PlanDoor>>> =
            plans.iter().map(|p| draw_doors(&mut rng, p, config.min_door_m)).collect();
        let Some(doors) = doors else { continue };
        // Nobody likes to reach the bedroom through the bathroom, but it is better than no building.
        let is_awkward = plans.iter().zip(&doors).any(|(p, d)| leads_through_private_rooms(p, d));
        if !is_awkward || attempt >= PLAN_ATTEMPTS / 2 {
            return Ok(raise(&plans, &doors, config.seed, config.passage_m, Furnishing::Full(config.cooccurrence)));
        }
    }
    Err(SceneError::NoPlan { seed: config.seed, rooms: config.rooms })
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
        if !(0.7..=2.0).contains(&self.min_door_m) {
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
    /// Furniture and small things, as they occur together.
    Full(Cooccurrence),
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
    let shaft = if plans.len() > 1 { stair_shaft(&plans[0], &doors[0], thickness_m) } else { None };
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
        let finishes: Vec<Finish> = plan.rooms.iter().map(|r| finish(&mut rng, r.kind)).collect();
        let (below, above) = (hole.filter(|_| storey > 0), hole.filter(|_| storey + 1 < plans.len()));
        walls.push_inside(&mut building.mesh, &finishes, below, above);
        if storey == 0 {
            walls.push_shell(&mut building.mesh, -0.1, top_z + 0.1);
        }
        building.doors.extend(walls.door_truths(plan_doors, first_room));
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
            let items = if let Furnishing::Full(cooccurrence) = furnishing {
                let habits = Habits::of(cooccurrence, seed);
                furnish_room(&mut room_rng, &space, room.kind, &habits, entrance == Some(index))
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
pub(crate) fn furnish_room(
    rng: &mut ChaCha8Rng,
    space: &RoomSpace,
    kind: RoomKind,
    habits: &Habits,
    is_entrance: bool,
) -> Vec<Item> {
    let mut best: Option<(usize, Vec<Item>)> = None;
    let wanted = essentials(kind);
    for attempt in 0..ROOM_ATTEMPTS_MAX {
        let items = try_furnishing(rng, space, kind, habits, is_entrance);
        let has = |name: &&&str| items.iter().any(|i| i.class.name == **name);
        let present = wanted.iter().filter(has).count();
        // A desk or a table wants its chairs more than a room wants another picture.
        let seats = items.iter().filter(|i| i.class.name.ends_with("chair")).count();
        let score = 1000 * present + items.len() + 2 * seats;
        if best.as_ref().is_none_or(|(b, _)| score > *b) {
            best = Some((score, items));
        }
        let is_complete = best.as_ref().is_some_and(|(b, _)| *b >= 1000 * wanted.len());
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
    habits: &Habits,
    is_entrance: bool,
) -> Vec<Item> {
    let mut furnisher = Furnisher::new(rng, space);
    if is_entrance {
        furnisher.put_entrance();
    }
    hang_leaves(&mut furnisher, kind);
    furnish(&mut furnisher, kind, habits);
    strew(&mut furnisher, kind, habits);
    let Some(reach) = furnisher.reach() else {
        return Vec::new();
    };
    let items = furnisher.items;
    let mut keep = vec![true; items.len()];
    for (i, item) in items.iter().enumerate() {
        let others: Vec<_> = (0..items.len()).filter(|&k| k != i).map(|k| items[k].parts.as_slice()).collect();
        // Supports come before what they carry, so one pass is enough.
        keep[i] =
            item.support.is_none_or(|s| keep[s]) && is_viewable(&item.bounds, &item.parts, &others, space, &reach);
    }
    let mut new_index = vec![0; items.len()];
    let mut count = 0;
    for (i, k) in keep.iter().enumerate() {
        new_index[i] = count;
        count += usize::from(*k);
    }
    let kept = items.into_iter().zip(&keep).filter(|(_, k)| **k).map(|(i, _)| i);
    kept.map(|mut i| {
        i.support = i.support.map(|s| new_index[s]);
        i.with = i.with.filter(|w| keep[*w]).map(|w| new_index[w]);
        i
    })
    .collect()
}

/// The room one enters first: hallway or corridor, else reception, living room or the first room.
fn entrance_room(plan: &StoreyPlan) -> usize {
    let first = |kind: RoomKind| plan.rooms.iter().position(|r| r.kind == kind);
    [RoomKind::Hallway, RoomKind::Corridor, RoomKind::Reception, RoomKind::LivingRoom]
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
            let axis = if d.opening.vertical { Vector2::new(1.0, 0.0) } else { Vector2::new(0.0, 1.0) };
            let half = if d.opening.vertical { r.width_m() } else { r.height_m() } / 2.0;
            let ahead = r.center() + axis * (half + 0.05);
            let inward = if walls.floors[room].iter().any(|f| f.contains(&ahead)) { axis } else { -axis };
            (r.center() + inward * half, inward, d.width_m())
        })
        .collect()
}

/// `"bedroom"`, `"bedroom 2"`, ...
pub(crate) fn name_rooms(rooms: &mut [RoomTruth]) {
    for i in 0..rooms.len() {
        let before = rooms[..i].iter().filter(|r| r.kind == rooms[i].kind).count();
        let name = rooms[i].kind.name();
        rooms[i].name = if before == 0 { name.to_string() } else { format!("{name} {}", before + 1) };
    }
}

/// Paint and flooring of a room.
pub(crate) fn finish(rng: &mut ChaCha8Rng, kind: RoomKind) -> Finish {
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
