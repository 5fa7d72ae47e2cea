//! The ways to change a graph, and the record of what a change did.
//!
//! Every change is an [`Op`] given to [`crate::SceneGraph::apply`]. It either happens whole, raises the revision by one and
//! returns an [`Event`] with the state of every touched node before and after, or it fails with an [`OpError`] and changes
//! nothing. [`Event::inverse`] is the undo.

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::agent::{Agent, AgentPose};
use crate::correct::PoseCorrection;
use crate::group::Group;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::object::Object;
use crate::place::{Place, PlaceEdge};
use crate::relation::{Relation, RelationKey};
use crate::room::{Building, Room, RoomEdge};

/// One change. `Put` inserts or replaces.
#[derive(Debug, Clone, PartialEq)]
pub enum Op {
    /// Insert or replace an object. Its `group` is left as it is.
    PutObject(Box<Object>),
    /// Remove an object, its relations and its membership.
    RemoveObject(ObjectId),
    /// Two objects are one: `into` gets the votes, observations and box of `from`, and `from` goes.
    MergeObjects {
        /// The object that goes.
        from: ObjectId,
        /// The object that stays.
        into: ObjectId,
    },
    /// Insert or replace a place. Its `room` is left as it is.
    PutPlace(Place),
    /// Remove a place and its edges; its objects lose their place.
    RemovePlace(PlaceId),
    /// Insert or replace an edge between two places.
    PutPlaceEdge(PlaceEdge),
    /// Remove the edge between two places.
    RemovePlaceEdge(PlaceId, PlaceId),
    /// Insert or replace a room. It takes its places from other rooms.
    PutRoom(Box<Room>),
    /// Remove a room and its edges; its places, objects and groups lose their room.
    RemoveRoom(RoomId),
    /// A user names a room; the name stays.
    NameRoom(RoomId, String),
    /// Insert or replace the way between two rooms.
    PutRoomEdge(RoomEdge),
    /// Remove the way between two rooms.
    RemoveRoomEdge(RoomId, RoomId),
    /// Insert or replace a building.
    PutBuilding(Box<Building>),
    /// Remove a building; its rooms stay.
    RemoveBuilding(BuildingId),
    /// Insert or replace a group. It takes its members from other groups.
    PutGroup(Box<Group>),
    /// Remove a group; its members stay.
    RemoveGroup(GroupId),
    /// Insert or replace a relation.
    PutRelation(Relation),
    /// Remove a relation.
    RemoveRelation(RelationKey),
    /// Insert or replace a robot.
    PutAgent(Box<Agent>),
    /// Append a pose to a robot's trajectory.
    AddAgentPose(AgentId, AgentPose),
    /// Remove a robot.
    RemoveAgent(AgentId),
    /// Move everything by a rigid motion (a corrected map frame).
    Transform(Isometry3<f64>),
    /// Move everything by a corrected trajectory.
    CorrectPoses(Box<PoseCorrection>),
    /// Several changes as one: all or nothing, one revision.
    Batch(Vec<Op>),
    /// Set nodes to recorded states; fails where the present is not the recorded `before`. Undo and replay use it.
    SetTo(Vec<Change>),
}

/// The state of one node or edge before and after an op; `None` = absent.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// An object.
    Object(ObjectId, Option<Arc<Object>>, Option<Arc<Object>>),
    /// A place.
    Place(PlaceId, Option<Place>, Option<Place>),
    /// A place edge.
    PlaceEdge((PlaceId, PlaceId), Option<PlaceEdge>, Option<PlaceEdge>),
    /// A room.
    Room(RoomId, Option<Arc<Room>>, Option<Arc<Room>>),
    /// A room edge.
    RoomEdge((RoomId, RoomId), Option<RoomEdge>, Option<RoomEdge>),
    /// A building.
    Building(BuildingId, Option<Arc<Building>>, Option<Arc<Building>>),
    /// A group.
    Group(GroupId, Option<Arc<Group>>, Option<Arc<Group>>),
    /// A relation.
    Relation(RelationKey, Option<Relation>, Option<Relation>),
    /// A robot as a whole.
    Agent(AgentId, Option<Arc<Agent>>, Option<Arc<Agent>>),
    /// The newest pose of a robot: absent -> present is an append, present -> absent takes it back.
    AgentPose(AgentId, Option<AgentPose>, Option<AgentPose>),
}

impl Change {
    /// The change that takes this one back.
    pub fn inverse(&self) -> Change {
        use Change::*;
        match self.clone() {
            Object(id, before, after) => Object(id, after, before),
            Place(id, before, after) => Place(id, after, before),
            PlaceEdge(id, before, after) => PlaceEdge(id, after, before),
            Room(id, before, after) => Room(id, after, before),
            RoomEdge(id, before, after) => RoomEdge(id, after, before),
            Building(id, before, after) => Building(id, after, before),
            Group(id, before, after) => Group(id, after, before),
            Relation(id, before, after) => Relation(id, after, before),
            Agent(id, before, after) => Agent(id, after, before),
            AgentPose(id, before, after) => AgentPose(id, after, before),
        }
    }
}

/// What an op did. No changes: the graph was already so, and the revision stayed.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// The revision after the op.
    pub revision: u64,
    /// Every touched node, in the order of the changes.
    pub changes: Arc<[Change]>,
}

/// An event in the log of a graph.
pub type LoggedEvent = Event;

impl Event {
    /// The op that undoes this event, if nothing touched the same nodes since.
    pub fn inverse(&self) -> Op {
        Op::SetTo(self.changes.iter().rev().map(Change::inverse).collect())
    }

    /// The op that does this event again on a graph in the state before it.
    pub fn replay(&self) -> Op {
        Op::SetTo(self.changes.to_vec())
    }
}

/// Why an op was refused. Nothing changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OpError {
    /// An op names an object that is not in the graph.
    #[error("no object {0}")]
    NoObject(ObjectId),
    /// An op names a place that is not in the graph.
    #[error("no place {0}")]
    NoPlace(PlaceId),
    /// An op names a room that is not in the graph.
    #[error("no room {0}")]
    NoRoom(RoomId),
    /// An op names a building that is not in the graph.
    #[error("no building {0}")]
    NoBuilding(BuildingId),
    /// An op names a group that is not in the graph.
    #[error("no group {0}")]
    NoGroup(GroupId),
    /// An op names a robot that is not in the graph.
    #[error("no agent {0}")]
    NoAgent(AgentId),
    /// An op removes an edge or relation that is not in the graph.
    #[error("no such edge")]
    NoEdge,
    /// An edge or relation joins a node to itself, or a merge an object with itself.
    #[error("a node cannot be joined to itself")]
    SelfJoin,
    /// A number is NaN or infinite, or out of its range.
    #[error("{node}: {field} is not a finite number in its range")]
    BadNumber {
        /// Kind of node.
        node: &'static str,
        /// Field of the node.
        field: &'static str,
    },
    /// A name or label is empty, or the name of a room is taken.
    #[error("{node}: {field} is empty or taken")]
    BadName {
        /// Kind of node.
        node: &'static str,
        /// Field of the node.
        field: &'static str,
    },
    /// A group with fewer than two members.
    #[error("group {0} has fewer than two members")]
    SmallGroup(GroupId),
    /// A pose earlier than the newest of its robot.
    #[error("agent {0}: pose is older than the newest one")]
    OldPose(AgentId),
    /// `Op::SetTo` found another state than the recorded one.
    #[error("the graph is not in the state before the recorded change")]
    NotTheRecordedState,
    /// A configuration value out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
}

/// A configuration value that makes no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} must be {rule}")]
pub struct ConfigError {
    /// The field.
    pub field: &'static str,
    /// What it must be.
    pub rule: &'static str,
}
