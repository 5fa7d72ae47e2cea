//! Functional groups: things that are used together around a support ("dining table group").

use nalgebra::Point3;

use crate::ids::{GroupId, ObjectId, RoomId};

/// A functional group of at least two objects of one room.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Its id; survives while most of its members stay together.
    pub id: GroupId,
    /// Named after its support: "dining table group".
    pub name: String,
    /// The member that carries or organises the others: the table, the desk, the bed. Always a member.
    pub support: Option<ObjectId>,
    /// Members, ascending. An object is in at most one group.
    pub members: Vec<ObjectId>,
    /// The room of its members.
    pub room: Option<RoomId>,
    /// Mean of the members' centroids.
    pub center: Point3<f64>,
}
