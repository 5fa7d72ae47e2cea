//! Layer 2: things. An object is what many frames agree on: a voted label, a box that follows the newest evidence,
//! and where it belongs (place, room, functional group).

use std::collections::BTreeMap;

use nalgebra::Point3;
use serde_json::{Map, Value};

use crate::bounds::Aabb;
use crate::ids::{GroupId, ObjectId, PlaceId, RoomId};
use crate::presence::{Presence, TrackPoint};

/// An object node.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Its id; never reused.
    pub id: ObjectId,
    /// The label that won the vote (OmniVLN Eq. 4); of equal votes the alphabetically first.
    pub label: String,
    /// How clearly it won: (first - second) / sum of votes, in `[0, 1]`.
    pub label_margin: f64,
    /// Votes per label. Multiples of 1/1024, so that sums do not depend on their order.
    pub votes: BTreeMap<String, f64>,
    /// A sentence about it, from the frame that said `label` with the highest score. May be empty.
    pub caption: String,
    /// Mean colour (sRGB) if a camera saw it.
    pub color: Option<[u8; 3]>,
    /// Words for what a caption or the colour says: keys `color`, `material`, `function`.
    pub attributes: BTreeMap<String, String>,
    /// Middle of `bounds`.
    pub centroid: Point3<f64>,
    /// Robust axis-aligned box.
    pub bounds: Aabb,
    /// The room it stands in.
    pub room: Option<RoomId>,
    /// The nearest place: where a robot is that looks at it.
    pub place: Option<PlaceId>,
    /// Its functional group. Owned by the group: `Op::PutObject` does not change it.
    pub group: Option<GroupId>,
    /// Stamp of the first frame that showed it.
    pub first_seen_ns: i64,
    /// Stamp of the last frame that showed it.
    pub last_seen_ns: i64,
    /// When it was there, in order and apart; empty: from `first_seen_ns` to `last_seen_ns`.
    pub presence: Vec<Presence>,
    /// Where it was, by time, if it moves by itself; empty for everything that stays.
    pub trajectory: Vec<TrackPoint>,
    /// Number of frames that showed it.
    pub observations: u32,
    /// Seen often and clearly enough to be believed (`AssociationConfig::confirm_observations`, `confirm_margin`).
    /// Objects from files and from users are confirmed.
    pub confirmed: bool,
    /// Anything else, kept in files. `dynamic: true` marks a mover (person, pet) without a trajectory.
    pub metadata: Map<String, Value>,
}

impl Object {
    /// A confirmed object with one full vote for `label`, no room, no caption: what a test or a user's note needs.
    pub fn new(id: ObjectId, label: &str, bounds: Aabb) -> Object {
        Object {
            id,
            label: label.to_owned(),
            label_margin: 1.0,
            votes: BTreeMap::from([(label.to_owned(), 1.0)]),
            caption: String::new(),
            color: None,
            attributes: BTreeMap::new(),
            centroid: bounds.center(),
            bounds,
            room: None,
            place: None,
            group: None,
            first_seen_ns: 0,
            last_seen_ns: 0,
            presence: Vec::new(),
            trajectory: Vec::new(),
            observations: 1,
            confirmed: true,
            metadata: Map::new(),
        }
    }

    /// Whether the object moves by itself (it has a trajectory, or metadata `dynamic`).
    pub fn is_dynamic(&self) -> bool {
        !self.trajectory.is_empty() || self.metadata.get("dynamic").and_then(Value::as_bool).unwrap_or(false)
    }

    /// When it was there, in order.
    pub fn presence(&self) -> Vec<Presence> {
        if self.presence.is_empty() {
            return vec![Presence { first_ns: self.first_seen_ns, last_ns: self.last_seen_ns }];
        }
        self.presence.clone()
    }

    /// Share of the votes that `label` got, in `[0, 1]`.
    pub fn vote_share(&self, label: &str) -> f64 {
        let total: f64 = self.votes.values().sum();
        if total > 0.0 { self.votes.get(label).copied().unwrap_or(0.0) / total } else { 0.0 }
    }
}
