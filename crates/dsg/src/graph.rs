//! The scene graph: five layers, read access, and queries. Changes go through [`SceneGraph::apply`] only.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::Point3;
use serde_json::{Map, Value};

use crate::agent::Agent;
use crate::group::Group;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::memory::ObjectMemory;
use crate::object::Object;
use crate::op::LoggedEvent;
use crate::place::{Place, PlaceEdge};
use crate::relation::{Relation, RelationKey, Verdict};
use crate::room::{Building, Room, RoomEdge};

/// Objects, places, rooms, a building, the robots, and the edges between them, with a revision and a log of changes.
///
/// All listings are in ascending order of ids. Cloning shares the nodes and is cheap; [`SceneGraph::snapshot`] also leaves
/// out the log and the memory of the builder.
#[derive(Debug, Clone, Default)]
pub struct SceneGraph {
    pub(crate) revision: u64,
    pub(crate) objects: BTreeMap<ObjectId, Arc<Object>>,
    pub(crate) places: BTreeMap<PlaceId, Place>,
    pub(crate) place_edges: BTreeMap<(PlaceId, PlaceId), PlaceEdge>,
    pub(crate) place_neighbours: BTreeMap<PlaceId, BTreeSet<PlaceId>>,
    pub(crate) rooms: BTreeMap<RoomId, Arc<Room>>,
    pub(crate) room_edges: BTreeMap<(RoomId, RoomId), RoomEdge>,
    pub(crate) buildings: BTreeMap<BuildingId, Arc<Building>>,
    pub(crate) groups: BTreeMap<GroupId, Arc<Group>>,
    pub(crate) relations: BTreeMap<RelationKey, Relation>,
    /// Reverse index of `relations`: for a subject, the others it is related to are in the key order already; this one
    /// is for the `object` and `other` side.
    pub(crate) relations_to: BTreeMap<ObjectId, BTreeSet<RelationKey>>,
    pub(crate) agents: BTreeMap<AgentId, Arc<Agent>>,
    /// Graph-wide metadata, kept in files.
    pub(crate) metadata: Map<String, Value>,
    /// Fields of newer minor versions, by JSON path of their record; written back.
    pub(crate) unknown_fields: BTreeMap<String, Map<String, Value>>,
    pub(crate) next: NextIds,
    pub(crate) log: Vec<LoggedEvent>,
    pub(crate) log_start: u64,
    pub(crate) log_changes: usize,
    /// The builder's memory of each object (points with recency, captions). Not part of the state that ops change and
    /// undo: it can be rebuilt from the box.
    pub(crate) memory: BTreeMap<ObjectId, ObjectMemory>,
}

/// Ids that the graph will give next. They only rise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NextIds {
    pub object: u64,
    pub room: u64,
    pub group: u64,
}

impl Default for NextIds {
    fn default() -> NextIds {
        NextIds { object: 1, room: 1, group: 1 }
    }
}

impl SceneGraph {
    /// Makes the index of neighbours anew from the edges, after many were put in at once.
    pub(crate) fn index_place_edges(&mut self) {
        let mut ends: Vec<(PlaceId, PlaceId)> = Vec::with_capacity(2 * self.place_edges.len());
        ends.extend(self.place_edges.keys().flat_map(|&(a, b)| [(a, b), (b, a)]));
        ends.sort_unstable();
        let of_one = ends.chunk_by(|x, y| x.0 == y.0);
        self.place_neighbours = of_one.map(|ends| (ends[0].0, ends.iter().map(|end| end.1).collect())).collect();
    }

    /// An empty graph at revision 0.
    pub fn new() -> SceneGraph {
        SceneGraph::default()
    }

    /// The number of changes so far.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The graph as it is now, without log and builder's memory: what a reasoner gets while the robot goes on.
    pub fn snapshot(&self) -> SceneGraph {
        SceneGraph {
            log: Vec::new(),
            log_start: self.revision,
            log_changes: 0,
            memory: BTreeMap::new(),
            revision: self.revision,
            objects: self.objects.clone(),
            places: self.places.clone(),
            place_edges: self.place_edges.clone(),
            place_neighbours: self.place_neighbours.clone(),
            rooms: self.rooms.clone(),
            room_edges: self.room_edges.clone(),
            buildings: self.buildings.clone(),
            groups: self.groups.clone(),
            relations: self.relations.clone(),
            relations_to: self.relations_to.clone(),
            agents: self.agents.clone(),
            metadata: self.metadata.clone(),
            unknown_fields: self.unknown_fields.clone(),
            next: self.next,
        }
    }

    /// All objects.
    pub fn objects(&self) -> impl Iterator<Item = &Object> {
        self.objects.values().map(Arc::as_ref)
    }

    /// Objects seen often and clearly enough to be believed.
    pub fn confirmed_objects(&self) -> impl Iterator<Item = &Object> {
        self.objects().filter(|object| object.confirmed)
    }

    /// One object.
    pub fn object(&self, id: ObjectId) -> Option<&Object> {
        self.objects.get(&id).map(Arc::as_ref)
    }

    /// All places.
    pub fn places(&self) -> impl Iterator<Item = &Place> {
        self.places.values()
    }

    /// One place.
    pub fn place(&self, id: PlaceId) -> Option<&Place> {
        self.places.get(&id)
    }

    /// Places where unknown space begins.
    pub fn frontiers(&self) -> impl Iterator<Item = &Place> {
        self.places().filter(|place| place.is_frontier())
    }

    /// All edges between places, by `(a, b)`.
    pub fn place_edges(&self) -> impl Iterator<Item = &PlaceEdge> {
        self.place_edges.values()
    }

    /// The edge between two places, in either order.
    pub fn place_edge(&self, a: PlaceId, b: PlaceId) -> Option<&PlaceEdge> {
        self.place_edges.get(&(a.min(b), a.max(b)))
    }

    /// The places joined to a place.
    pub fn place_neighbours(&self, id: PlaceId) -> impl Iterator<Item = PlaceId> {
        self.place_neighbours.get(&id).into_iter().flatten().copied()
    }

    /// All rooms.
    pub fn rooms(&self) -> impl Iterator<Item = &Room> {
        self.rooms.values().map(Arc::as_ref)
    }

    /// One room.
    pub fn room(&self, id: RoomId) -> Option<&Room> {
        self.rooms.get(&id).map(Arc::as_ref)
    }

    /// All ways between rooms, by `(a, b)`.
    pub fn room_edges(&self) -> impl Iterator<Item = &RoomEdge> {
        self.room_edges.values()
    }

    /// The way between two rooms, in either order: they are connected if there is one.
    pub fn room_edge(&self, a: RoomId, b: RoomId) -> Option<&RoomEdge> {
        self.room_edges.get(&(a.min(b), a.max(b)))
    }

    /// Whether two objects are in one functional group.
    pub fn are_in_same_group(&self, a: ObjectId, b: ObjectId) -> bool {
        let group = |id| self.object(id).and_then(|object| object.group);
        group(a).is_some() && group(a) == group(b)
    }

    /// The ways out of a room, by the id of the room on the other side.
    pub fn doors_of(&self, id: RoomId) -> Vec<&RoomEdge> {
        let mut doors: Vec<&RoomEdge> = self.room_edges().filter(|edge| edge.other(id).is_some()).collect();
        doors.sort_by_key(|edge| edge.other(id));
        doors
    }

    /// All buildings.
    pub fn buildings(&self) -> impl Iterator<Item = &Building> {
        self.buildings.values().map(Arc::as_ref)
    }

    /// One building.
    pub fn building(&self, id: BuildingId) -> Option<&Building> {
        self.buildings.get(&id).map(Arc::as_ref)
    }

    /// All functional groups.
    pub fn groups(&self) -> impl Iterator<Item = &Group> {
        self.groups.values().map(Arc::as_ref)
    }

    /// One group.
    pub fn group(&self, id: GroupId) -> Option<&Group> {
        self.groups.get(&id).map(Arc::as_ref)
    }

    /// All robots.
    pub fn agents(&self) -> impl Iterator<Item = &Agent> {
        self.agents.values().map(Arc::as_ref)
    }

    /// One robot.
    pub fn agent(&self, id: AgentId) -> Option<&Agent> {
        self.agents.get(&id).map(Arc::as_ref)
    }

    /// The relations that hold, by (subject, kind, object).
    pub fn relations(&self) -> impl Iterator<Item = &Relation> {
        self.relations.values().filter(|relation| relation.evidence.verdict == Verdict::Holds)
    }

    /// The relations that were pruned (Eq. 6) or rejected (Eq. 7), with the reason.
    pub fn dropped_relations(&self) -> impl Iterator<Item = &Relation> {
        self.relations.values().filter(|relation| relation.evidence.verdict != Verdict::Holds)
    }

    /// The relations that hold with this object on any side.
    pub fn relations_of(&self, id: ObjectId) -> impl Iterator<Item = &Relation> {
        let as_subject = self.relations_from(id);
        let as_object = self.relations_to.get(&id).into_iter().flatten().filter_map(|key| self.relations.get(key));
        as_subject.chain(as_object).filter(|relation| relation.evidence.verdict == Verdict::Holds)
    }

    /// All relations whose subject it is, dropped ones too.
    pub(crate) fn relations_from(&self, id: ObjectId) -> impl Iterator<Item = &Relation> {
        let first = (id, crate::relation::RelationKind::Near, ObjectId(0), None);
        self.relations.range(first..).take_while(move |(key, _)| key.0 == id).map(|(_, relation)| relation)
    }

    /// The objects of a room.
    pub fn objects_in(&self, room: RoomId) -> Vec<&Object> {
        self.objects().filter(|object| object.room == Some(room)).collect()
    }

    /// The place nearest to a point; of equals the one with the smaller id.
    pub fn place_nearest(&self, point: &Point3<f64>) -> Option<&Place> {
        self.places().min_by(|a, b| (a.position - point).norm_squared().total_cmp(&(b.position - point).norm_squared()))
    }

    /// The room of a point: that of the place whose free sphere it is deepest in or nearest to. `None` without rooms.
    pub fn room_at(&self, point: &Point3<f64>) -> Option<RoomId> {
        let outside_m = |place: &Place| (place.position - point).norm() - place.clearance_m;
        let with_room = self.places().filter(|place| place.room.is_some());
        with_room.min_by(|a, b| outside_m(a).total_cmp(&outside_m(b))).and_then(|place| place.room)
    }

    /// The objects whose boxes come within `radius_m` of a point, nearest first (ties by id), with the distance to the box.
    pub fn objects_within(&self, point: &Point3<f64>, radius_m: f64) -> Vec<(&Object, f64)> {
        let distances = self.objects().map(|object| (object, object.bounds.distance_to_point_m(point)));
        let mut near: Vec<(&Object, f64)> = distances.filter(|(_, distance_m)| *distance_m <= radius_m).collect();
        near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.id.cmp(&b.0.id)));
        near
    }

    /// Number of nodes: objects, places, rooms, buildings, and poses of robots.
    pub fn node_count(&self) -> usize {
        let poses: usize = self.agents().map(|agent| agent.trajectory.len()).sum();
        self.objects.len() + self.places.len() + self.rooms.len() + self.buildings.len() + poses
    }

    /// Number of edges: between places, between rooms, relations that hold, from each node to its parent (object to place,
    /// place to room, room to building), from each member to its group, and from pose to pose.
    pub fn edge_count(&self) -> usize {
        let placed = self.objects().filter(|object| object.place.is_some()).count();
        let roomed = self.places().filter(|place| place.room.is_some()).count();
        let housed: usize = self.buildings().map(|building| building.rooms.len()).sum();
        let grouped: usize = self.groups().map(|group| group.members.len()).sum();
        let steps: usize = self.agents().map(|agent| agent.trajectory.len().saturating_sub(1)).sum();
        let within = self.place_edges.len() + self.room_edges.len() + self.relations().count();
        within + placed + roomed + housed + grouped + steps
    }

    /// Metadata of the graph as a whole.
    pub fn metadata(&self) -> &Map<String, Value> {
        &self.metadata
    }

    /// Metadata of the graph as a whole, to change it. It is outside the log and does not change the revision.
    pub fn metadata_mut(&mut self) -> &mut Map<String, Value> {
        &mut self.metadata
    }

    /// The id the next new object should have.
    pub fn next_object_id(&self) -> ObjectId {
        ObjectId(self.next.object)
    }

    /// The id the next new room should have.
    pub fn next_room_id(&self) -> RoomId {
        RoomId(self.next.room)
    }

    /// The id the next new group should have.
    pub fn next_group_id(&self) -> GroupId {
        GroupId(self.next.group)
    }

    /// Whether both hold the same nodes, edges and metadata (revision and log aside).
    pub fn has_same_content(&self, other: &SceneGraph) -> bool {
        self.objects == other.objects
            && self.places == other.places
            && self.place_edges == other.place_edges
            && self.rooms == other.rooms
            && self.room_edges == other.room_edges
            && self.buildings == other.buildings
            && self.groups == other.groups
            && self.relations == other.relations
            && self.agents == other.agents
            && self.metadata == other.metadata
    }
}
