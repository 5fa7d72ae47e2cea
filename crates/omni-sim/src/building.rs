//! A building and the truth about it: rooms, doors, objects, one triangle mesh and the things that may move.
//!
//! `generate` makes one from a seed. World x east, y north, z up, metres; the lowest floor lies at `z = 0`.
//! Everything here is truth: a robot gets rays and pixels only.

use nalgebra::{Point2, Point3};
use thiserror::Error;

use crate::cooccurrence::Cooccurrence;
pub use crate::generator::generate;
use crate::mesh::{Mover, TriangleMesh};

/// What to build.
#[derive(Debug, Clone, PartialEq)]
pub struct BuildingConfig {
    /// Same seed and settings, same building, byte for byte. Default 0.
    pub seed: u64,
    /// Number of rooms, corridors and stairwells included, 2 to 30. Default 5.
    pub rooms: u32,
    /// Storeys, 1 or 2; a stairwell with an open shaft joins them and counts as a room on each. Default 1.
    pub storeys: u32,
    /// Kinds of rooms and their furniture. Default [`Style::Flat`].
    pub style: Style,
    /// Narrowest doorway, metres, 0.7 to 2.0; doorways are drawn from here to 1.4, or all as wide as this. Default 1.0.
    pub min_door_m: f64,
    /// Free width kept from every door of a room to every other and to the usable side of every piece of furniture, metres,
    /// 0.5 to `min_door_m`: the disc a turning robot sweeps, with a margin. Default 0.95.
    pub passage_m: f64,
    /// Which things stand in which kind of room. Default [`Cooccurrence::Usual`].
    pub cooccurrence: Cooccurrence,
}

impl Default for BuildingConfig {
    fn default() -> Self {
        Self {
            seed: 0,
            rooms: 5,
            storeys: 1,
            style: Style::Flat,
            min_door_m: 1.0,
            passage_m: 0.95,
            cooccurrence: Cooccurrence::Usual,
        }
    }
}

/// What kind of building it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Style {
    /// A dwelling: living room, kitchen, bedrooms, bathrooms.
    Flat,
    /// A place of work: offices, meeting rooms, labs.
    Office,
}

/// Why no building was made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SceneError {
    /// `rooms` is outside 2..=30.
    #[error("a building has 2 to 30 rooms, not {0}")]
    Rooms(u32),
    /// `storeys` is not 1 or 2.
    #[error("a building has 1 or 2 storeys, not {0}")]
    Storeys(u32),
    /// Each storey of two needs a stairwell, a corridor and two rooms.
    #[error("two storeys need at least 8 rooms, not {0}")]
    RoomsForStoreys(u32),
    /// `min_door_m` is not a number from 0.7 to 2.0.
    #[error("min_door_m must lie in 0.7..=2.0, not {0}")]
    Door(f64),
    /// `passage_m` is not a number from 0.5 to `min_door_m`.
    #[error("passage_m must lie in 0.5..=min_door_m, not {0}")]
    Passage(f64),
    /// No floor plan was found that gives every room a door (a bug if it ever occurs: please report the seed).
    #[error("no floor plan found for seed {seed} with {rooms} rooms")]
    NoPlan {
        /// The seed asked for.
        seed: u64,
        /// The number of rooms asked for.
        rooms: u32,
    },
}

/// A finished building.
#[derive(Debug, Clone)]
pub struct Building {
    /// Ids `0..rooms.len()` in order.
    pub rooms: Vec<RoomTruth>,
    /// Openings between rooms, in order of their rooms.
    pub doors: Vec<DoorTruth>,
    /// Everything a robot may be sent to, ascending ids from 1.
    pub objects: Vec<ObjectTruth>,
    /// Structure (instance 0) and all objects that stand still.
    pub mesh: TriangleMesh,
    /// Objects with a mesh of their own: door leaves.
    pub movers: Vec<Mover>,
}

/// Purpose of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RoomKind {
    /// Joins other rooms of a flat.
    Hallway,
    /// Joins other rooms of an office.
    Corridor,
    /// Holds the stairs.
    Stairwell,
    /// Sofa and television.
    LivingRoom,
    /// Stove, sink and fridge.
    Kitchen,
    /// Large table to eat at.
    DiningRoom,
    /// Bed and wardrobe.
    Bedroom,
    /// Toilet, bathtub and washbasin.
    Bathroom,
    /// Desk and books at home.
    Study,
    /// Toilets and washbasins at work.
    Restroom,
    /// Washing machine.
    LaundryRoom,
    /// Shelves and boxes.
    StorageRoom,
    /// Desks for one to four people.
    Office,
    /// Large table with chairs and a whiteboard.
    MeetingRoom,
    /// Workbenches and instruments.
    Lab,
    /// Copier and paper.
    PrintRoom,
    /// Sofas and a vending machine at work.
    Lounge,
    /// Counter where visitors arrive.
    Reception,
}

impl RoomKind {
    /// Every kind.
    pub const ALL: [RoomKind; 18] = [
        RoomKind::Hallway,
        RoomKind::Corridor,
        RoomKind::Stairwell,
        RoomKind::LivingRoom,
        RoomKind::Kitchen,
        RoomKind::DiningRoom,
        RoomKind::Bedroom,
        RoomKind::Bathroom,
        RoomKind::Study,
        RoomKind::Restroom,
        RoomKind::LaundryRoom,
        RoomKind::StorageRoom,
        RoomKind::Office,
        RoomKind::MeetingRoom,
        RoomKind::Lab,
        RoomKind::PrintRoom,
        RoomKind::Lounge,
        RoomKind::Reception,
    ];

    /// The kind with this [`RoomKind::name`].
    pub fn from_name(name: &str) -> Option<RoomKind> {
        RoomKind::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The plain name, for example `"meeting room"`.
    pub fn name(self) -> &'static str {
        match self {
            RoomKind::Hallway => "hallway",
            RoomKind::Corridor => "corridor",
            RoomKind::Stairwell => "stairwell",
            RoomKind::LivingRoom => "living room",
            RoomKind::Kitchen => "kitchen",
            RoomKind::DiningRoom => "dining room",
            RoomKind::Bedroom => "bedroom",
            RoomKind::Bathroom => "bathroom",
            RoomKind::Study => "study",
            RoomKind::Restroom => "restroom",
            RoomKind::LaundryRoom => "laundry room",
            RoomKind::StorageRoom => "storage room",
            RoomKind::Office => "office",
            RoomKind::MeetingRoom => "meeting room",
            RoomKind::Lab => "lab",
            RoomKind::PrintRoom => "print room",
            RoomKind::Lounge => "lounge",
            RoomKind::Reception => "reception",
        }
    }
}

/// An axis-aligned rectangle of the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Corner with the smaller coordinates.
    pub min: Point2<f64>,
    /// Corner with the larger coordinates.
    pub max: Point2<f64>,
}

impl Rect {
    /// From the four bounds.
    pub fn new(x0: f64, y0: f64, x1: f64, y1: f64) -> Self {
        Self { min: Point2::new(x0, y0), max: Point2::new(x1, y1) }
    }

    /// Extent along x.
    pub fn width_m(&self) -> f64 {
        self.max.x - self.min.x
    }

    /// Extent along y.
    pub fn height_m(&self) -> f64 {
        self.max.y - self.min.y
    }

    /// Area, square metres.
    pub fn area_m2(&self) -> f64 {
        self.width_m() * self.height_m()
    }

    /// Middle.
    pub fn center(&self) -> Point2<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// True on the border too.
    pub fn contains(&self, point: &Point2<f64>) -> bool {
        point.x >= self.min.x && point.x <= self.max.x && point.y >= self.min.y && point.y <= self.max.y
    }

    /// Distance from a point to the nearest point of the rectangle, zero inside.
    pub fn distance_m(&self, point: &Point2<f64>) -> f64 {
        let dx = (self.min.x - point.x).max(point.x - self.max.x).max(0.0);
        let dy = (self.min.y - point.y).max(point.y - self.max.y).max(0.0);
        dx.hypot(dy)
    }

    /// True if the interiors overlap by more than `slack_m` in both directions.
    pub fn overlaps(&self, other: &Rect, slack_m: f64) -> bool {
        self.min.x + slack_m < other.max.x
            && other.min.x + slack_m < self.max.x
            && self.min.y + slack_m < other.max.y
            && other.min.y + slack_m < self.max.y
    }

    /// Grown by `margin_m` on every side (shrunk if negative).
    pub fn grown(&self, margin_m: f64) -> Rect {
        Rect::new(self.min.x - margin_m, self.min.y - margin_m, self.max.x + margin_m, self.max.y + margin_m)
    }
}

/// A room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomTruth {
    /// Index in [`Building::rooms`].
    pub id: u32,
    /// Purpose.
    pub kind: RoomKind,
    /// Unique in the building: `"bedroom"`, or `"bedroom 2"` from the second on.
    pub name: String,
    /// Free floor between the wall faces as rectangles that touch but do not overlap: one for a plain room, more for an
    /// L-shape. The largest comes first.
    pub rects: Vec<Rect>,
    /// Height of the floor.
    pub floor_z_m: f64,
    /// Height of the ceiling above the floor.
    pub height_m: f64,
    /// 0 for the lowest.
    pub storey: u32,
}

impl RoomTruth {
    /// Floor area between the walls.
    pub fn area_m2(&self) -> f64 {
        self.rects.iter().map(Rect::area_m2).sum()
    }

    /// Middle of the largest rectangle, so always inside; not always free of furniture.
    pub fn center(&self) -> Point2<f64> {
        self.rects[0].center()
    }

    /// True if the point stands over this room's floor (plan view).
    pub fn contains(&self, point: &Point2<f64>) -> bool {
        self.rects.iter().any(|r| r.contains(point))
    }
}

/// Direction in which one walks through an opening.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DoorAxis {
    /// Along x: the wall runs along y.
    X,
    /// Along y: the wall runs along x.
    Y,
    /// Up and down: the shaft of a stairwell.
    Z,
}

/// An opening between two rooms.
#[derive(Debug, Clone, PartialEq)]
pub struct DoorTruth {
    /// The rooms, smaller id first.
    pub rooms: (u32, u32),
    /// Middle of the opening at floor level (of the upper floor for a shaft).
    pub center: Point3<f64>,
    /// Clear width between the jambs (shorter side of a shaft).
    pub width_m: f64,
    /// Clear height (longer side of a shaft).
    pub height_m: f64,
    /// Direction of passage.
    pub axis: DoorAxis,
}

/// A thing in the building.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectTruth {
    /// Instance in the mesh; from 1.
    pub id: u32,
    /// Class name of the catalogue, for example `"office chair"`.
    pub class: String,
    /// One of the colour names of the catalogue.
    pub color: String,
    /// The colour itself, of which `color` is the name.
    pub rgb: [u8; 3],
    /// For example `"wood"`.
    pub material: String,
    /// What it is for, as a verb phrase: `"sitting at a desk"`.
    pub function: String,
    /// 20 to 40 words of English about looks and surroundings; never names the room.
    pub caption: String,
    /// Axis-aligned box in the world.
    pub bounds: Bounds,
    /// Direction of its front, about z, from world x.
    pub yaw_rad: f64,
    /// Room it stands in.
    pub room: u32,
    /// The object it stands on or hangs in, if not the floor or a wall.
    pub supported_by: Option<u32>,
    /// The object it was placed with: the table it stands round, the desk before it, the bed beside it, the window above it,
    /// its neighbour in a row of kitchen units.
    pub placed_with: Option<u32>,
}

/// An axis-aligned box in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Corner with the smaller coordinates.
    pub min: Point3<f64>,
    /// Corner with the larger coordinates.
    pub max: Point3<f64>,
}

impl Bounds {
    /// Middle of the box.
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// The box seen from above.
    pub fn footprint(&self) -> Rect {
        Rect::new(self.min.x, self.min.y, self.max.x, self.max.y)
    }

    /// Distance from a point to the nearest point of the box, zero inside.
    pub fn distance_m(&self, point: &Point3<f64>) -> f64 {
        let dz = (self.min.z - point.z).max(point.z - self.max.z).max(0.0);
        self.footprint().distance_m(&Point2::new(point.x, point.y)).hypot(dz)
    }

    /// Shortest distance between two boxes, zero if they touch.
    pub fn gap_m(&self, other: &Bounds) -> f64 {
        let gap = |a: usize| (other.min[a] - self.max[a]).max(self.min[a] - other.max[a]).max(0.0);
        gap(0).hypot(gap(1)).hypot(gap(2))
    }

    /// True if the interiors overlap by more than `slack_m` in all three directions.
    pub fn overlaps(&self, other: &Bounds, slack_m: f64) -> bool {
        (0..3).all(|a| self.min[a] + slack_m < other.max[a] && other.min[a] + slack_m < self.max[a])
    }
}

impl Building {
    /// The object with this id.
    pub fn object(&self, id: u32) -> Option<&ObjectTruth> {
        self.objects.binary_search_by_key(&id, |o| o.id).ok().map(|i| &self.objects[i])
    }

    /// The room whose floor is under the point (between floor and ceiling), `None` inside walls, doorways and outside.
    pub fn room_at(&self, point: &Point3<f64>) -> Option<&RoomTruth> {
        self.rooms.iter().find(|r| {
            r.contains(&Point2::new(point.x, point.y)) && point.z >= r.floor_z_m && point.z <= r.floor_z_m + r.height_m
        })
    }
}
