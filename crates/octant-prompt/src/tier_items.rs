//! What the three tiers of a prompt hold: things, rows of alike things, rooms, groups, areas, places.

use dsg::{ObjectId, PlaceId, RoomId};

use crate::octant::{Bearing, Octant};

/// The sorted scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Tiers {
    /// The agent's room: its name in the prompt and its own name, if it has one.
    pub here: Option<(RoomId, String, Option<String>)>,
    /// Focal radius, for the text.
    pub focal_radius_m: f64,
    /// Own room within the radius, nearest first.
    pub focal: Vec<Item>,
    /// Own room beyond, nearest first.
    pub peripheral: Vec<Item>,
    /// Own room, what is too much to be listed one by one: class words sorted, each with its objects.
    pub crowd: Vec<Run>,
    /// The nearest of the other rooms and those the instruction names, nearest first.
    pub rooms: Vec<RoomItem>,
    /// All rooms beyond, by direction and tripling distance, the nearest first.
    pub areas: Vec<AreaItem>,
    /// Frontiers and places to look from, nearest first, spread out.
    pub places: Vec<PlaceItem>,
    /// Words of a caption.
    pub max_caption_words: usize,
}

/// One object of the agent's room.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// Which.
    pub id: ObjectId,
    /// Its name.
    pub name: String,
    /// Functional group.
    pub group: &'static str,
    /// Its octant.
    pub octant: Octant,
    /// Distance of its centre from the body origin.
    pub distance_m: f64,
    /// Whether the instruction mentions its class.
    pub is_asked: bool,
    /// Its caption.
    pub caption: String,
}

/// Objects of one class in one room, in the order of their ordinals.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Class word.
    pub token: String,
    /// Ordinal and object.
    pub ids: Vec<(usize, ObjectId)>,
}

/// One other room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomItem {
    /// Which; None for objects that no room holds.
    pub id: Option<RoomId>,
    /// `room3`, or `outside`.
    pub name: String,
    /// Its own name, if it says more than a number.
    pub label: Option<String>,
    /// Direction of its centre.
    pub bearing: Bearing,
    /// Distance of its centre.
    pub distance_m: f64,
    /// Whether it holds a class the instruction mentions, or is named by it.
    pub is_asked: bool,
    /// The class words in it that the instruction mentions, sorted.
    pub asked: Vec<String>,
    /// Its objects by group (sorted by name) and class.
    pub groups: Vec<GroupItem>,
    /// Number of its objects.
    pub objects: usize,
}

/// A functional group in another room.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupItem {
    /// Its word.
    pub group: &'static str,
    /// Its classes, sorted by word.
    pub classes: Vec<Run>,
    /// Distance of its nearest object.
    pub nearest_m: f64,
    /// Distance of its farthest object.
    pub farthest_m: f64,
}

/// Rooms in one direction (a quarter of the plane) whose distances are alike (within a factor of three).
#[derive(Debug, Clone, PartialEq)]
pub struct AreaItem {
    /// `front`, `left`, `back` or `right`.
    pub side: &'static str,
    /// Distance of its nearest room's centre.
    pub nearest_m: f64,
    /// Distance of its farthest room's centre.
    pub farthest_m: f64,
    /// Number of its rooms.
    pub rooms: usize,
    /// Number of their objects.
    pub objects: usize,
    /// Class words with counts, sorted.
    pub counts: Vec<(String, usize)>,
    /// For each class the instruction mentions: its word, and the nearest room of the area that holds one, with its distance.
    pub asked: Vec<(String, RoomId, f64)>,
}

/// A place to explore.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceItem {
    /// Which.
    pub id: PlaceId,
    /// `frontier1` or `view1`.
    pub name: String,
    /// Direction.
    pub bearing: Bearing,
    /// Length of the way, or the straight distance where that is unknown.
    pub distance_m: f64,
}
