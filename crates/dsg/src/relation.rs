//! Relations between objects ("mug on table"), each with the evidence for it, or for why it was dropped.
//!
//! Two relations need no record of their own, since the layers say them: "connected" is the way between two rooms
//! ([`SceneGraph::room_edge`](crate::SceneGraph::room_edge), with doorway and width), "same group" is membership
//! ([`SceneGraph::are_in_same_group`](crate::SceneGraph::are_in_same_group)).

use std::fmt;

use nalgebra::Point3;

use crate::ids::ObjectId;

/// What holds between a subject and an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RelationKind {
    /// Boxes at most `RelationConfig::near_m` apart. Symmetric: stored once, smaller id as the subject.
    Near,
    /// The subject rests on the object.
    On,
    /// The subject is below the object, over the same floor.
    Under,
    /// The subject is over the object without touching it.
    Above,
    /// The subject's box is within the box of an object that can hold things.
    Inside,
    /// The subject stands between `object` and `other`, all three on the same thing or all on the floor.
    Between,
}

impl RelationKind {
    /// All kinds, in order.
    pub const ALL: [RelationKind; 6] = [
        RelationKind::Near,
        RelationKind::On,
        RelationKind::Under,
        RelationKind::Above,
        RelationKind::Inside,
        RelationKind::Between,
    ];

    /// The word used in texts and files: "near", "on", ...
    pub fn word(self) -> &'static str {
        match self {
            RelationKind::Near => "near",
            RelationKind::On => "on",
            RelationKind::Under => "under",
            RelationKind::Above => "above",
            RelationKind::Inside => "inside",
            RelationKind::Between => "between",
        }
    }

    /// The kind of a word of [`RelationKind::word`].
    pub fn from_word(word: &str) -> Option<RelationKind> {
        RelationKind::ALL.into_iter().find(|kind| kind.word() == word)
    }
}

impl fmt::Display for RelationKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// A typed, directed relation: `subject` is `kind` `object` (and `other`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relation {
    /// What the relation is about.
    pub subject: ObjectId,
    /// What holds.
    pub kind: RelationKind,
    /// With respect to what.
    pub object: ObjectId,
    /// The second reference of `Between`; `None` for every other kind.
    pub other: Option<ObjectId>,
    /// Why we believe it, or why not.
    pub evidence: Evidence,
}

/// What names a relation: at most one is stored per key.
pub type RelationKey = (ObjectId, RelationKind, ObjectId, Option<ObjectId>);

impl Relation {
    /// The key under which it is stored.
    pub fn key(&self) -> RelationKey {
        (self.subject, self.kind, self.object, self.other)
    }
}

/// The reason for a relation's standing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Whether it holds, and if not why.
    pub verdict: Verdict,
    /// Where it comes from.
    pub source: EvidenceSource,
    /// Gap between the boxes, metres.
    pub distance_m: f64,
    /// Score of the verifier (Eq. 7) in `[0, 1]`; 1 where none was asked.
    pub score: f64,
}

/// Whether a relation holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// It holds; only these are listed by `SceneGraph::relations`.
    Holds,
    /// The map blocks the line between the two at this point (OmniVLN Eq. 6).
    Blocked(Point3<f64>),
    /// The verifier's score was not above the threshold (OmniVLN Eq. 7).
    Rejected,
}

/// Where a relation comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum EvidenceSource {
    /// Computed from boxes and the map.
    Geometry,
    /// Computed, and confirmed or rejected by the verifier.
    Verifier,
    /// Stated by a user or a file; never replaced by a computation.
    Stated,
}
