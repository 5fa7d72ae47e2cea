//! From a floor plan as pixels to a building: the solid pixels become walls from floor to ceiling, whatever shape and thickness
//! they have; rooms, doors and truth come from the labels; what stands in the rooms is drawn.
//!
//! What the picture does not say is drawn from the seed: which rooms of a large plan are used (what lies outside them is solid),
//! what each is for, colours and furniture. Openings stay as they are; those that look like doors get a lintel.

use nalgebra::{Point2, Point3, Vector2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use crate::building::{Building, DoorTruth, Rect, RoomKind, RoomTruth, Style};
use crate::caption::write_captions;
use crate::cooccurrence::{Cooccurrence, Habits};
use crate::doors::is_private;
use crate::generator::{finish, furnish_room, name_rooms};
use crate::item::add_items;
use crate::mesh::TriangleMesh;
use crate::placement::RoomSpace;
use crate::plan_rooms::{Opening, PixelRun, PlanRooms, SOLID};
use crate::program::program;
use crate::walls::{CEILING, CEILING_M, DOOR_HEIGHT_M, TRIM, WallFace, push_level, push_wall};

/// Openings up to this width have a lintel, metres; wider ones are open to the ceiling.
const WIDEST_DOOR_M: f64 = 1.6;
/// A lintel reaches so far to both sides of the border between the rooms, metres: half a wall.
const LINTEL_M: f64 = 0.1;
/// Walls in front of which furniture stands may be uneven by so much, metres; scanned walls are.
const UNEVEN_M: f64 = 0.1;
/// The outside of the building lies so far outside its rooms, metres.
const SHELL_M: f64 = 0.15;
/// Behind an outer wall there is no free pixel for so far, metres.
const OUTER_M: f64 = 1.5;
/// Rooms narrower than this all along, metres, and longer than wide are passages.
const PASSAGE_WIDTH_M: f64 = 2.8;

/// A floor plan: grey pixels row by row from the north-west corner.
#[derive(Debug, Clone, Copy)]
pub struct PlanImage<'a> {
    /// [`FREE_FROM`] and lighter is free, the rest is solid.
    pub grey: &'a [u8],
    /// 0 for none, any other number for the room a pixel belongs to. At least the middle of each room has to be labelled.
    pub labels: &'a [u32],
    /// Pixels from west to east.
    pub width: usize,
    /// Pixels from north to south.
    pub height: usize,
    /// Edge of a pixel, metres.
    pub resolution_m: f64,
}

/// Lighter pixels are free.
pub const FREE_FROM: u8 = 250;

/// What is made of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanConfig {
    /// Same plan, seed and settings, same building. Default 0.
    pub seed: u64,
    /// Number of rooms, 2 to 30, fewer if not so many are joined. Default 6.
    pub rooms: u32,
    /// Kinds of rooms. Default [`Style::Office`].
    pub style: Style,
    /// Narrowest opening that the robot uses, metres, 0.5 to 2.0: rooms behind narrower ones are left out. Default 0.9.
    pub min_door_m: f64,
    /// Free width kept among the furniture, metres, 0.5 to 2.0. Default 0.95.
    pub passage_m: f64,
    /// What stands where. Default [`Cooccurrence::Usual`].
    pub cooccurrence: Cooccurrence,
}

impl Default for PlanConfig {
    fn default() -> Self {
        Self {
            seed: 0,
            rooms: 6,
            style: Style::Office,
            min_door_m: 0.9,
            passage_m: 0.95,
            cooccurrence: Cooccurrence::Usual,
        }
    }
}

/// Why a plan made no building.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    /// `grey` or `labels` has not one entry for each pixel, or there are none or too many.
    #[error("a plan has {width} x {height} pixels of 1 to {MOST_PIXELS} in all, but {entries} values")]
    Pixels {
        /// Width given.
        width: usize,
        /// Height given.
        height: usize,
        /// Length of the list that does not fit.
        entries: usize,
    },
    /// The resolution is not a number from 0.01 to 0.2.
    #[error("a pixel of a plan is 0.01 to 0.2 m wide, not {0}")]
    Resolution(f64),
    /// `rooms` is outside 2..=30.
    #[error("2 to 30 rooms are cut out of a plan, not {0}")]
    Rooms(u32),
    /// A width is not a number from 0.5 to 2.0.
    #[error("min_door_m and passage_m of a plan lie in 0.5..=2.0, not {0}")]
    Width(f64),
    /// No two rooms are joined by an opening wide enough.
    #[error("the plan has {rooms} rooms, and no two of them are joined by an opening of {min_door_m:.2} m and more")]
    NothingJoined {
        /// Rooms labelled.
        rooms: usize,
        /// Width asked for.
        min_door_m: f64,
    },
}

/// Most pixels of a plan.
pub const MOST_PIXELS: usize = 1 << 26;

/// Makes a building of a plan. The same plan and configuration give the same building, byte for byte.
///
/// # Errors
/// A plan or a configuration out of range, or a plan without two rooms that are joined for this robot.
pub fn raise_plan(plan: &PlanImage, config: &PlanConfig) -> Result<Building, PlanError> {
    check(plan, config)?;
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let free: Vec<bool> = plan.grey.iter().map(|grey| *grey >= FREE_FROM).collect();
    let whole = PlanRooms::grown(&free, plan.labels, plan.width, plan.height, plan.resolution_m);
    let rooms = whole
        .cut(&mut rng, config.rooms as usize, config.min_door_m / 2.0)
        .ok_or(PlanError::NothingJoined { rooms: whole.count(), min_door_m: config.min_door_m })?;
    let openings = rooms.openings();
    let kinds = draw_kinds(&mut rng, &rooms, &openings, config.style);
    Ok(raise_rooms(&rooms, &openings, &kinds, config))
}

fn check(plan: &PlanImage, config: &PlanConfig) -> Result<(), PlanError> {
    let (width, height) = (plan.width, plan.height);
    let pixels = width.checked_mul(height).filter(|pixels| (1..=MOST_PIXELS).contains(pixels));
    for entries in [plan.grey.len(), plan.labels.len()] {
        if pixels != Some(entries) {
            return Err(PlanError::Pixels { width, height, entries });
        }
    }
    if !(0.01..=0.2).contains(&plan.resolution_m) {
        return Err(PlanError::Resolution(plan.resolution_m));
    }
    if !(2..=30).contains(&config.rooms) {
        return Err(PlanError::Rooms(config.rooms));
    }
    for width_m in [config.min_door_m, config.passage_m] {
        if !(0.5..=2.0).contains(&width_m) {
            return Err(PlanError::Width(width_m));
        }
    }
    Ok(())
}

/// What each room is for: long and narrow ones, and those with many doors, are passages; the others get the kinds of a drawn
/// programme, the larger rooms those that like to be large. Nobody has to walk through a bathroom if another room can take its
/// place.
fn draw_kinds(rng: &mut ChaCha8Rng, rooms: &PlanRooms, openings: &[Opening], style: Style) -> Vec<RoomKind> {
    let count = rooms.count();
    let areas = rooms.areas_m2();
    let mut half_width_m = vec![0.0_f64; count + 1];
    for (at, room) in rooms.room.iter().enumerate() {
        half_width_m[*room as usize] = half_width_m[*room as usize].max(rooms.clearance_m(at));
    }
    let doors =
        |room: usize| openings.iter().filter(|o| o.rooms.0 as usize == room || o.rooms.1 as usize == room).count();
    let is_passage = |room: usize| {
        let width_m = 2.0 * half_width_m[room];
        doors(room) >= 2 && width_m < PASSAGE_WIDTH_M && areas[room] > 2.0 * width_m * width_m
    };
    let passage = if style == Style::Flat { RoomKind::Hallway } else { RoomKind::Corridor };
    let mut kinds = vec![passage; count];
    let mut others: Vec<usize> = (1..=count).filter(|room| !is_passage(*room)).collect();
    others.sort_by(|a, b| areas[*a].total_cmp(&areas[*b]).then(a.cmp(b)));
    let mut wishes = program(rng, style, 0, others.len());
    wishes.sort_by(|a, b| a.area_m2.total_cmp(&b.area_m2));
    for (room, wish) in others.iter().zip(&wishes) {
        kinds[room - 1] = wish.kind;
    }
    for at in 0..others.len() {
        let room = others[at];
        if is_private(kinds[room - 1]) && doors(room) > 1 {
            let nearest = (0..others.len())
                .filter(|other| doors(others[*other]) <= 1 && !is_private(kinds[others[*other] - 1]))
                .min_by_key(|other| (other.abs_diff(at), *other));
            if let Some(other) = nearest {
                kinds.swap(room - 1, others[other] - 1);
            }
        }
    }
    kinds
}

/// Walls, floors, truth and furniture.
fn raise_rooms(rooms: &PlanRooms, openings: &[Opening], kinds: &[RoomKind], config: &PlanConfig) -> Building {
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    rng.set_stream(1);
    let mut building = Building {
        rooms: Vec::new(),
        doors: openings.iter().map(door_truth).collect(),
        objects: Vec::new(),
        mesh: TriangleMesh::default(),
        movers: Vec::new(),
    };
    let floors: Vec<Vec<Rect>> =
        (1..=kinds.len() as u32).map(|room| rooms.rects(|at| rooms.room[at] == room)).collect();
    push_structure(&mut building.mesh, rooms, openings, &floors, kinds, &mut rng);
    for (index, kind) in kinds.iter().enumerate() {
        building.rooms.push(RoomTruth {
            id: index as u32,
            kind: *kind,
            name: String::new(),
            rects: floors[index].clone(),
            floor_z_m: 0.0,
            height_m: CEILING_M,
            storey: 0,
        });
    }
    let habits = Habits::of(config.cooccurrence, config.seed);
    let entrance = entrance_room(kinds);
    for (index, kind) in kinds.iter().enumerate() {
        let number = index as u32 + 1;
        let runs = rooms.runs(|at| rooms.room[at] == number, |at| rooms.room[at] == SOLID);
        let space = RoomSpace {
            floor: floors[index].clone(),
            faces: wall_faces(rooms, &runs),
            doors: door_fronts(openings, number),
            closed: runs.iter().map(|run| span(rooms, run)).collect(),
            floor_z_m: 0.0,
            passage_m: config.passage_m,
        };
        let mut room_rng = ChaCha8Rng::seed_from_u64(config.seed);
        room_rng.set_stream(16 + u64::from(number));
        let items = furnish_room(&mut room_rng, &space, *kind, &habits, entrance == index);
        add_items(&mut building, items, index as u32);
    }
    name_rooms(&mut building.rooms);
    rng.set_stream(2);
    write_captions(&mut rng, &mut building.objects);
    building
}

fn entrance_room(kinds: &[RoomKind]) -> usize {
    let first = |kind: RoomKind| kinds.iter().position(|k| *k == kind);
    [RoomKind::Hallway, RoomKind::Corridor, RoomKind::Reception, RoomKind::LivingRoom]
        .into_iter()
        .find_map(first)
        .unwrap_or(0)
}

fn has_lintel(opening: &Opening) -> bool {
    opening.width_m <= WIDEST_DOOR_M
}

pub(crate) fn door_truth(opening: &Opening) -> DoorTruth {
    DoorTruth {
        rooms: (opening.rooms.0 - 1, opening.rooms.1 - 1),
        center: Point3::new(opening.center.x, opening.center.y, 0.0),
        width_m: opening.width_m,
        height_m: if has_lintel(opening) { DOOR_HEIGHT_M } else { CEILING_M },
        axis: opening.axis,
    }
}

/// Inner surfaces of the rooms, lintels, and a shell round everything.
fn push_structure(
    mesh: &mut TriangleMesh,
    rooms: &PlanRooms,
    openings: &[Opening],
    floors: &[Vec<Rect>],
    kinds: &[RoomKind],
    rng: &mut ChaCha8Rng,
) {
    let mut is_lintel = vec![false; rooms.room.len()];
    let reach = (LINTEL_M / rooms.resolution_m).round() as usize;
    for opening in openings.iter().filter(|opening| has_lintel(opening)) {
        for at in &opening.pixels {
            let (x, y) = (at % rooms.width, at / rooms.width);
            for y in y.saturating_sub(reach)..(y + reach + 1).min(rooms.height) {
                for x in x.saturating_sub(reach)..(x + reach + 1).min(rooms.width) {
                    let other = y * rooms.width + x;
                    // Only between the jambs: where the way is as narrow as the door.
                    let is_between = 2.0 * rooms.clearance_m(other) <= opening.width_m;
                    let is_side = [opening.rooms.0, opening.rooms.1].contains(&rooms.room[other]);
                    is_lintel[other] |= is_between && is_side;
                }
            }
        }
    }
    let push_runs = |mesh: &mut TriangleMesh, runs: &[PixelRun], z0: f64, z1: f64, color: [u8; 3]| {
        for run in runs {
            let (a, b) = rooms.ends(run);
            push_wall(mesh, (a.x, a.y), (b.x, b.y), z0, z1, color);
        }
    };
    for (index, kind) in kinds.iter().enumerate() {
        let number = index as u32 + 1;
        let finish = finish(rng, *kind);
        for rect in &floors[index] {
            push_level(mesh, rect, 0.0, true, finish.floor);
            push_level(mesh, rect, CEILING_M, false, CEILING);
        }
        let is_own = |at: usize| rooms.room[at] == number;
        push_runs(mesh, &rooms.runs(is_own, |at| rooms.room[at] == SOLID), 0.0, CEILING_M, finish.wall);
        let over = rooms.runs(|at| is_own(at) && !is_lintel[at], |at| is_lintel[at]);
        push_runs(mesh, &over, DOOR_HEIGHT_M, CEILING_M, finish.wall);
    }
    for rect in rooms.rects(|at| is_lintel[at]) {
        push_level(mesh, &rect, DOOR_HEIGHT_M, false, TRIM);
    }
    // The shell: nobody sees the outside, but rays that leave the rooms by a crack end somewhere.
    let outline = Rect { min: Point2::origin(), max: rooms.corner(rooms.width, rooms.height) }.grown(SHELL_M);
    let corners = [
        outline.min,
        Point2::new(outline.min.x, outline.max.y),
        outline.max,
        Point2::new(outline.max.x, outline.min.y),
    ];
    for (k, a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        push_wall(mesh, (a.x, a.y), (b.x, b.y), -SHELL_M, CEILING_M + SHELL_M, TRIM);
    }
    push_level(mesh, &outline, -SHELL_M, false, TRIM);
    push_level(mesh, &outline, CEILING_M + SHELL_M, true, TRIM);
}

fn span(rooms: &PlanRooms, run: &PixelRun) -> Rect {
    let (a, b) = rooms.ends(run);
    Rect { min: a.inf(&b), max: a.sup(&b) }
}

/// Walls to put furniture against: straight runs, and chains of runs that are straight but for [`UNEVEN_M`], along their foremost
/// part.
fn wall_faces(rooms: &PlanRooms, runs: &[PixelRun]) -> Vec<WallFace> {
    let uneven = (UNEVEN_M / rooms.resolution_m).round() as usize;
    let mut left: Vec<PixelRun> = runs.to_vec();
    left.sort_by_key(|run| (run.vertical, run.is_beyond, run.low, run.line));
    let mut faces = Vec::new();
    while !left.is_empty() {
        let first = left.remove(0);
        let (mut chain, mut low, mut high) = (first, first.line, first.line);
        while let Some(at) = left.iter().position(|run| {
            (run.vertical, run.is_beyond, run.low) == (first.vertical, first.is_beyond, chain.high)
                && run.line.max(high) - run.line.min(low) <= uneven
        }) {
            let next = left.remove(at);
            (low, high, chain.high) = (low.min(next.line), high.max(next.line), next.high);
        }
        chain.line = if first.is_beyond { high } else { low };
        const SHORTEST_M: f64 = 0.2;
        if (chain.high - chain.low) as f64 * rooms.resolution_m >= SHORTEST_M {
            faces.push(face(rooms, &chain));
        }
    }
    faces
}

fn face(rooms: &PlanRooms, run: &PixelRun) -> WallFace {
    let (a, b) = rooms.ends(run);
    let along = (b - a).normalize();
    let inward = Vector2::new(-along.y, along.x);
    let is_free = |p: Point2<f64>| {
        let (x, y) = ((p.x / rooms.resolution_m).floor(), (p.y / rooms.resolution_m).floor());
        let is_inside = x >= 0.0 && y >= 0.0 && x < rooms.width as f64 && y < rooms.height as f64;
        is_inside && rooms.room[y as usize * rooms.width + x as usize] != SOLID
    };
    let steps = (OUTER_M / rooms.resolution_m).round() as usize;
    let uneven = (UNEVEN_M / rooms.resolution_m).round() as usize + 1;
    let is_closed =
        |s: f64| (uneven..steps).all(|k| !is_free(a + (b - a) * s - inward * ((k as f64 + 0.5) * rooms.resolution_m)));
    WallFace { a, b, inward, is_outer: [0.1, 0.3, 0.5, 0.7, 0.9].into_iter().all(is_closed) }
}

/// Middle of each doorway of a room where its wall begins, direction into the room, width.
fn door_fronts(openings: &[Opening], room: u32) -> Vec<(Point2<f64>, Vector2<f64>, f64)> {
    openings
        .iter()
        .filter(|o| o.rooms.0 == room || o.rooms.1 == room)
        .map(|o| {
            let inward = if o.rooms.1 == room { o.into_second } else { -o.into_second };
            (o.center + inward * LINTEL_M, inward, o.width_m.min(WIDEST_DOOR_M))
        })
        .collect()
}
