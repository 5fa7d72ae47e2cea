//! Layers 4 and 5: rooms, the doorways between them, and the building with its storeys.

use nalgebra::Point3;
use serde_json::{Map, Value};

use crate::ids::{BuildingId, PlaceId, RoomId};

/// A room node. Its id survives as long as enough of its places do.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    /// Its id; never reused.
    pub id: RoomId,
    /// "kitchen" once the contents are clear, before that "room 3"; a user's name is never replaced. Unique in the graph
    /// ("bedroom", "bedroom 2").
    pub name: String,
    /// Whether a user gave the name.
    pub is_user_named: bool,
    /// What kind of room its contents suggest ("kitchen", "meeting room", ...), if they suggest one at all.
    pub kind: Option<String>,
    /// Probability of `kind` among all kinds, in `[0, 1]`; 0 without a kind.
    pub kind_confidence: f64,
    /// Middle of its floor, at the height of its places.
    pub center: Point3<f64>,
    /// Its places, ascending.
    pub places: Vec<PlaceId>,
    /// Floor area seen so far, square metres.
    pub area_m2: f64,
    /// Storey; 0 is where the first robot started.
    pub floor: i32,
    /// Anything else, kept in files.
    pub metadata: Map<String, Value>,
}

impl Room {
    /// A room without places, named "room N" after its id.
    pub fn new(id: RoomId, center: Point3<f64>) -> Room {
        Room {
            id,
            name: format!("room {}", id.0),
            is_user_named: false,
            kind: None,
            kind_confidence: 0.0,
            center,
            places: Vec::new(),
            area_m2: 0.0,
            floor: 0,
            metadata: Map::new(),
        }
    }
}

/// A way between two rooms; `a < b`, one per pair (the widest).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoomEdge {
    /// The smaller id.
    pub a: RoomId,
    /// The larger id.
    pub b: RoomId,
    /// Middle of the narrowest part.
    pub doorway: Point3<f64>,
    /// Free width there (twice the clearance); 0 = unknown.
    pub width_m: f64,
}

impl RoomEdge {
    /// The room on the other side; `None` if `room` is neither.
    pub fn other(&self, room: RoomId) -> Option<RoomId> {
        if room == self.a {
            Some(self.b)
        } else if room == self.b {
            Some(self.a)
        } else {
            None
        }
    }
}

/// The root node.
#[derive(Debug, Clone, PartialEq)]
pub struct Building {
    /// Its id.
    pub id: BuildingId,
    /// What people call it.
    pub name: String,
    /// Mean of its rooms.
    pub center: Point3<f64>,
    /// Its rooms, ascending.
    pub rooms: Vec<RoomId>,
    /// Its storeys, lowest first.
    pub storeys: Vec<Storey>,
}

/// One floor of a building.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Storey {
    /// Number as in [`Room::floor`].
    pub floor: i32,
    /// Mean height of the places of its rooms.
    pub height_m: f64,
    /// How many rooms it has.
    pub rooms: u32,
}
