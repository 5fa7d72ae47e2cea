//! How an op changes the graph: all or nothing, with every touched node recorded, and its consequences in the same event.
//!
//! [`SceneGraph::apply`] -> [`Edit::run`] (one arm per op) -> the `set_*` methods, which write one node and record the
//! change. On an error the recorded changes are taken back in reverse. Consequences (a removed place leaves its room, its
//! edges and its objects) are further `set_*` calls, so undo needs no rules of its own.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use crate::agent::{Agent, AgentPose};
use crate::graph::SceneGraph;
use crate::group::Group;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::object::Object;
use crate::op::{Change, Event, LoggedEvent, Op, OpError};
use crate::place::{Place, PlaceEdge};
use crate::relation::{Relation, RelationKey};
use crate::room::{Building, Room, RoomEdge};

/// Changes kept in the log before the older half is dropped: some ten minutes of a robot's run, a few megabytes.
const LOG_CHANGES: usize = 32_768;

impl SceneGraph {
    /// Changes the graph, or fails and leaves it as it was. The revision rises by one unless nothing changed.
    pub fn apply(&mut self, op: Op) -> Result<Event, OpError> {
        let mut edit = Edit { graph: self, changes: Vec::new() };
        if let Err(error) = edit.run(op) {
            let changes = std::mem::take(&mut edit.changes);
            for change in changes.iter().rev() {
                edit.write(&change.inverse());
            }
            return Err(error);
        }
        let changes: Arc<[Change]> = edit.changes.into();
        if changes.is_empty() {
            return Ok(Event { revision: self.revision, changes });
        }
        self.revision += 1;
        let event = Event { revision: self.revision, changes };
        self.remember(event.clone());
        Ok(event)
    }

    /// The events after `revision`, oldest first. The log is bounded: if `revision` is before [`SceneGraph::log_start`], the
    /// list begins there, and the caller should read the graph as a whole.
    pub fn changes_since(&self, revision: u64) -> &[LoggedEvent] {
        let first = self.log.partition_point(|event| event.revision <= revision);
        &self.log[first..]
    }

    /// The revision from which the log is complete.
    pub fn log_start(&self) -> u64 {
        self.log_start
    }

    fn remember(&mut self, event: Event) {
        self.log_changes += event.changes.len();
        self.log.push(event);
        if self.log_changes > LOG_CHANGES && self.log.len() > 1 {
            let dropped = self.log.len() / 2;
            self.log_start = self.log[dropped - 1].revision;
            self.log_changes -= self.log.drain(..dropped).map(|event| event.changes.len()).sum::<usize>();
        }
    }
}

/// An op under way.
struct Edit<'a> {
    graph: &'a mut SceneGraph,
    changes: Vec<Change>,
}

impl Edit<'_> {
    fn run(&mut self, op: Op) -> Result<(), OpError> {
        match op {
            Op::PutObject(object) => self.put_object(*object),
            Op::RemoveObject(id) => self.remove_object(id),
            Op::MergeObjects { from, into } => self.merge_objects(from, into),
            Op::PutPlace(place) => self.put_place(place),
            Op::RemovePlace(id) => self.remove_place(id),
            Op::PutPlaceEdge(edge) => self.put_place_edge(edge),
            Op::RemovePlaceEdge(a, b) => {
                self.graph.place_edge(a, b).ok_or(OpError::NoEdge)?;
                self.set_place_edge((a.min(b), a.max(b)), None);
                Ok(())
            }
            Op::PutRoom(room) => self.put_room(*room),
            Op::RemoveRoom(id) => self.remove_room(id),
            Op::NameRoom(id, name) => self.name_room(id, name),
            Op::PutRoomEdge(edge) => self.put_room_edge(edge),
            Op::RemoveRoomEdge(a, b) => {
                let key = (a.min(b), a.max(b));
                self.graph.room_edges.get(&key).ok_or(OpError::NoEdge)?;
                self.set_room_edge(key, None);
                Ok(())
            }
            Op::PutBuilding(building) => self.put_building(*building),
            Op::RemoveBuilding(id) => {
                self.graph.building(id).ok_or(OpError::NoBuilding(id))?;
                self.set_building(id, None);
                Ok(())
            }
            Op::PutGroup(group) => self.put_group(*group),
            Op::RemoveGroup(id) => self.remove_group(id),
            Op::PutRelation(relation) => self.put_relation(relation),
            Op::RemoveRelation(key) => {
                self.graph.relations.get(&key).ok_or(OpError::NoEdge)?;
                self.set_relation(key, None);
                Ok(())
            }
            Op::PutAgent(agent) => self.put_agent(*agent),
            Op::AddAgentPose(id, pose) => self.add_agent_pose(id, pose),
            Op::RemoveAgent(id) => {
                self.graph.agent(id).ok_or(OpError::NoAgent(id))?;
                self.set_agent(id, None);
                Ok(())
            }
            Op::Transform(motion) => self.transform(&motion),
            Op::Batch(ops) => ops.into_iter().try_for_each(|op| self.run(op)),
            Op::SetTo(changes) => {
                changes.into_iter().try_for_each(|change| self.set_to(change))?;
                // The states come from outside: together they must make a graph.
                self.graph.check_invariants().map_err(|_| OpError::NotTheRecordedState)
            }
        }
    }

    // Objects

    fn put_object(&mut self, mut object: Object) -> Result<(), OpError> {
        check_object(&object)?;
        if let Some(room) = object.room {
            self.graph.room(room).ok_or(OpError::NoRoom(room))?;
        }
        if let Some(place) = object.place {
            self.graph.place(place).ok_or(OpError::NoPlace(place))?;
        }
        object.group = self.graph.object(object.id).and_then(|known| known.group);
        self.set_object(object.id, Some(Arc::new(object)));
        Ok(())
    }

    fn remove_object(&mut self, id: ObjectId) -> Result<(), OpError> {
        let object = self.graph.objects.get(&id).cloned().ok_or(OpError::NoObject(id))?;
        self.remove_relations_of(id);
        if let Some(group) = object.group {
            self.leave_group(id, group);
        }
        self.set_object(id, None);
        Ok(())
    }

    fn remove_relations_of(&mut self, id: ObjectId) {
        let keys: Vec<RelationKey> =
            self.graph.relations.keys().filter(|(a, _, b, c)| *a == id || *b == id || *c == Some(id)).copied().collect();
        for key in keys {
            self.set_relation(key, None);
        }
    }

    fn merge_objects(&mut self, from: ObjectId, into: ObjectId) -> Result<(), OpError> {
        if from == into {
            return Err(OpError::SelfJoin);
        }
        let gone = self.graph.objects.get(&from).cloned().ok_or(OpError::NoObject(from))?;
        let mut merged = self.graph.object(into).ok_or(OpError::NoObject(into))?.clone();
        for (label, votes) in &gone.votes {
            *merged.votes.entry(label.clone()).or_insert(0.0) += votes;
        }
        let old_label = std::mem::take(&mut merged.label);
        (merged.label, merged.label_margin) = crate::vote::winner(&merged.votes);
        if merged.label != old_label || merged.caption.is_empty() {
            if merged.label == gone.label && !gone.caption.is_empty() {
                merged.caption = gone.caption.clone();
            }
        }
        for (key, value) in &gone.attributes {
            merged.attributes.entry(key.clone()).or_insert_with(|| value.clone());
        }
        merged.color = merged.color.or(gone.color);
        merged.bounds = merged.bounds.union(&gone.bounds);
        merged.centroid = merged.bounds.center();
        merged.first_seen_ns = merged.first_seen_ns.min(gone.first_seen_ns);
        merged.last_seen_ns = merged.last_seen_ns.max(gone.last_seen_ns);
        merged.observations = merged.observations.saturating_add(gone.observations);
        merged.confirmed |= gone.confirmed;
        merged.room = merged.room.or(gone.room);
        merged.place = merged.place.or(gone.place);
        self.remove_object(from)?;
        // Leaving its group may have dissolved it: membership is what the graph says now.
        merged.group = self.graph.object(into).and_then(|object| object.group);
        self.set_object(into, Some(Arc::new(merged)));
        Ok(())
    }

    // Places

    fn put_place(&mut self, mut place: Place) -> Result<(), OpError> {
        check_point("place", "position", &place.position)?;
        check_range("place", "clearance_m", place.clearance_m, 0.0)?;
        place.room = self.graph.place(place.id).and_then(|known| known.room);
        self.set_place(place.id, Some(place));
        Ok(())
    }

    fn remove_place(&mut self, id: PlaceId) -> Result<(), OpError> {
        let place = *self.graph.place(id).ok_or(OpError::NoPlace(id))?;
        let neighbours: Vec<PlaceId> = self.graph.place_neighbours(id).collect();
        for other in neighbours {
            self.set_place_edge((id.min(other), id.max(other)), None);
        }
        let objects: Vec<Arc<Object>> =
            self.graph.objects.values().filter(|object| object.place == Some(id)).cloned().collect();
        for object in objects {
            self.set_object(object.id, Some(Arc::new(Object { place: None, ..(*object).clone() })));
        }
        if let Some(room) = place.room {
            self.leave_room(id, room);
        }
        self.set_place(id, None);
        Ok(())
    }

    fn put_place_edge(&mut self, edge: PlaceEdge) -> Result<(), OpError> {
        check_range("place edge", "clearance_m", edge.clearance_m, 0.0)?;
        let (a, b) = (edge.a.min(edge.b), edge.a.max(edge.b));
        if a == b {
            return Err(OpError::SelfJoin);
        }
        for id in [a, b] {
            self.graph.place(id).ok_or(OpError::NoPlace(id))?;
        }
        self.set_place_edge((a, b), Some(PlaceEdge { a, b, ..edge }));
        Ok(())
    }

    /// Takes a place out of its room's list.
    fn leave_room(&mut self, place: PlaceId, room: RoomId) {
        if let Some(mut changed) = self.graph.room(room).cloned() {
            changed.places.retain(|member| *member != place);
            self.set_room(room, Some(Arc::new(changed)));
        }
    }

    // Rooms and buildings

    fn put_room(&mut self, mut room: Room) -> Result<(), OpError> {
        check_point("room", "center", &room.center)?;
        check_range("room", "area_m2", room.area_m2, 0.0)?;
        check_range("room", "kind_confidence", room.kind_confidence, 0.0)?;
        self.check_room_name(room.id, &room.name)?;
        room.places.sort_unstable();
        room.places.dedup();
        for place in &room.places {
            self.graph.place(*place).ok_or(OpError::NoPlace(*place))?;
        }
        let old = self.graph.room(room.id).map(|known| known.places.clone()).unwrap_or_default();
        for place in old.iter().filter(|place| room.places.binary_search(place).is_err()) {
            self.set_room_of_place(*place, None);
        }
        // Places that come from other rooms, room by room: one change per room, not one per place.
        let mut others: Vec<RoomId> = room.places.iter().filter_map(|place| self.graph.places[place].room).collect();
        others.sort_unstable();
        others.dedup();
        for other in others.into_iter().filter(|other| *other != room.id) {
            if let Some(mut changed) = self.graph.room(other).cloned() {
                changed.places.retain(|place| room.places.binary_search(place).is_err());
                self.set_room(other, Some(Arc::new(changed)));
            }
        }
        for place in &room.places {
            self.set_room_of_place(*place, Some(room.id));
        }
        self.set_room(room.id, Some(Arc::new(room)));
        Ok(())
    }

    fn check_room_name(&self, id: RoomId, name: &str) -> Result<(), OpError> {
        let taken = self.graph.rooms().any(|room| room.id != id && room.name == name);
        if name.trim().is_empty() || taken {
            return Err(OpError::BadName { node: "room", field: "name" });
        }
        Ok(())
    }

    fn set_room_of_place(&mut self, id: PlaceId, room: Option<RoomId>) {
        let place = self.graph.places[&id];
        self.set_place(id, Some(Place { room, ..place }));
    }

    fn remove_room(&mut self, id: RoomId) -> Result<(), OpError> {
        let room = self.graph.rooms.get(&id).cloned().ok_or(OpError::NoRoom(id))?;
        for place in &room.places {
            self.set_room_of_place(*place, None);
        }
        let objects: Vec<Arc<Object>> =
            self.graph.objects.values().filter(|object| object.room == Some(id)).cloned().collect();
        for object in objects {
            self.set_object(object.id, Some(Arc::new(Object { room: None, ..(*object).clone() })));
        }
        let groups: Vec<Arc<Group>> =
            self.graph.groups.values().filter(|group| group.room == Some(id)).cloned().collect();
        for group in groups {
            self.set_group(group.id, Some(Arc::new(Group { room: None, ..(*group).clone() })));
        }
        let doors: Vec<(RoomId, RoomId)> =
            self.graph.room_edges.keys().filter(|(a, b)| *a == id || *b == id).copied().collect();
        for door in doors {
            self.set_room_edge(door, None);
        }
        let buildings: Vec<Arc<Building>> =
            self.graph.buildings.values().filter(|building| building.rooms.contains(&id)).cloned().collect();
        for building in buildings {
            let mut changed = (*building).clone();
            changed.rooms.retain(|member| *member != id);
            self.set_building(changed.id, Some(Arc::new(changed)));
        }
        self.set_room(id, None);
        Ok(())
    }

    fn name_room(&mut self, id: RoomId, name: String) -> Result<(), OpError> {
        let room = self.graph.room(id).ok_or(OpError::NoRoom(id))?.clone();
        let name = name.trim().to_owned();
        self.check_room_name(id, &name)?;
        self.set_room(id, Some(Arc::new(Room { name, is_user_named: true, ..room })));
        Ok(())
    }

    fn put_room_edge(&mut self, edge: RoomEdge) -> Result<(), OpError> {
        check_point("room edge", "doorway", &edge.doorway)?;
        check_range("room edge", "width_m", edge.width_m, 0.0)?;
        let (a, b) = (edge.a.min(edge.b), edge.a.max(edge.b));
        if a == b {
            return Err(OpError::SelfJoin);
        }
        for id in [a, b] {
            self.graph.room(id).ok_or(OpError::NoRoom(id))?;
        }
        self.set_room_edge((a, b), Some(RoomEdge { a, b, ..edge }));
        Ok(())
    }

    fn put_building(&mut self, mut building: Building) -> Result<(), OpError> {
        check_point("building", "center", &building.center)?;
        for storey in &building.storeys {
            check_range("building", "height_m", storey.height_m, f64::NEG_INFINITY)?;
        }
        building.rooms.sort_unstable();
        building.rooms.dedup();
        for room in &building.rooms {
            self.graph.room(*room).ok_or(OpError::NoRoom(*room))?;
        }
        self.set_building(building.id, Some(Arc::new(building)));
        Ok(())
    }

    // Groups and relations

    fn put_group(&mut self, mut group: Group) -> Result<(), OpError> {
        check_point("group", "center", &group.center)?;
        if group.name.trim().is_empty() {
            return Err(OpError::BadName { node: "group", field: "name" });
        }
        group.members.sort_unstable();
        group.members.dedup();
        for member in group.members.iter().chain(&group.support) {
            self.graph.object(*member).ok_or(OpError::NoObject(*member))?;
        }
        if group.members.len() < 2 {
            return Err(OpError::SmallGroup(group.id));
        }
        if let Some(room) = group.room {
            self.graph.room(room).ok_or(OpError::NoRoom(room))?;
        }
        group.support = group.support.filter(|support| group.members.binary_search(support).is_ok());
        let old = self.graph.group(group.id).map(|known| known.members.clone()).unwrap_or_default();
        for member in old.iter().filter(|member| group.members.binary_search(member).is_err()) {
            self.set_group_of_object(*member, None);
        }
        for member in group.members.clone() {
            match self.graph.objects[&member].group {
                Some(other) if other != group.id => self.leave_group(member, other),
                _ => {}
            }
            self.set_group_of_object(member, Some(group.id));
        }
        self.set_group(group.id, Some(Arc::new(group)));
        Ok(())
    }

    fn remove_group(&mut self, id: GroupId) -> Result<(), OpError> {
        let group = self.graph.groups.get(&id).cloned().ok_or(OpError::NoGroup(id))?;
        for member in &group.members {
            self.set_group_of_object(*member, None);
        }
        self.set_group(id, None);
        Ok(())
    }

    /// Takes an object out of a group; a group of one dissolves.
    fn leave_group(&mut self, object: ObjectId, group: GroupId) {
        self.set_group_of_object(object, None);
        let Some(mut changed) = self.graph.group(group).cloned() else { return };
        changed.members.retain(|member| *member != object);
        changed.support = changed.support.filter(|support| *support != object);
        if changed.members.len() < 2 {
            for member in &changed.members {
                self.set_group_of_object(*member, None);
            }
            self.set_group(group, None);
        } else {
            self.set_group(group, Some(Arc::new(changed)));
        }
    }

    fn set_group_of_object(&mut self, id: ObjectId, group: Option<GroupId>) {
        if let Some(object) = self.graph.objects.get(&id).filter(|object| object.group != group) {
            let changed = Object { group, ..(**object).clone() };
            self.set_object(id, Some(Arc::new(changed)));
        }
    }

    fn put_relation(&mut self, relation: Relation) -> Result<(), OpError> {
        check_range("relation", "distance_m", relation.evidence.distance_m, 0.0)?;
        check_range("relation", "score", relation.evidence.score, 0.0)?;
        if let crate::relation::Verdict::Blocked(point) = &relation.evidence.verdict {
            check_point("relation", "blocked", point)?;
        }
        let ends = [Some(relation.subject), Some(relation.object), relation.other];
        for id in ends.into_iter().flatten() {
            self.graph.object(id).ok_or(OpError::NoObject(id))?;
        }
        if relation.subject == relation.object
            || relation.other == Some(relation.subject)
            || relation.other == Some(relation.object)
        {
            return Err(OpError::SelfJoin);
        }
        self.set_relation(relation.key(), Some(relation));
        Ok(())
    }

    // Robots and the frame

    fn put_agent(&mut self, agent: Agent) -> Result<(), OpError> {
        for pose in &agent.trajectory {
            check_pose(&pose.world_from_body)?;
        }
        if agent.trajectory.windows(2).any(|pair| pair[0].stamp_ns > pair[1].stamp_ns) {
            return Err(OpError::OldPose(agent.id));
        }
        self.set_agent(agent.id, Some(Arc::new(agent)));
        Ok(())
    }

    fn add_agent_pose(&mut self, id: AgentId, pose: AgentPose) -> Result<(), OpError> {
        check_pose(&pose.world_from_body)?;
        let agent = self.graph.agent(id).ok_or(OpError::NoAgent(id))?;
        if agent.trajectory.last().is_some_and(|newest| newest.stamp_ns > pose.stamp_ns) {
            return Err(OpError::OldPose(id));
        }
        self.record(Change::AgentPose(id, None, Some(pose)));
        Ok(())
    }

    fn transform(&mut self, motion: &Isometry3<f64>) -> Result<(), OpError> {
        check_pose(motion)?;
        for object in self.graph.objects.values().cloned().collect::<Vec<_>>() {
            let bounds = object.bounds.transformed(motion);
            let moved = Object { bounds, centroid: bounds.center(), ..(*object).clone() };
            check_object(&moved)?;
            self.set_object(object.id, Some(Arc::new(moved)));
        }
        for place in self.graph.places.values().copied().collect::<Vec<_>>() {
            self.set_place(place.id, Some(Place { position: motion * place.position, ..place }));
        }
        for room in self.graph.rooms.values().cloned().collect::<Vec<_>>() {
            self.set_room(room.id, Some(Arc::new(Room { center: motion * room.center, ..(*room).clone() })));
        }
        for (key, edge) in self.graph.room_edges.clone() {
            self.set_room_edge(key, Some(RoomEdge { doorway: motion * edge.doorway, ..edge }));
        }
        for building in self.graph.buildings.values().cloned().collect::<Vec<_>>() {
            let mut moved = Building { center: motion * building.center, ..(*building).clone() };
            moved.storeys.iter_mut().for_each(|storey| storey.height_m += motion.translation.z);
            self.set_building(moved.id, Some(Arc::new(moved)));
        }
        for group in self.graph.groups.values().cloned().collect::<Vec<_>>() {
            self.set_group(group.id, Some(Arc::new(Group { center: motion * group.center, ..(*group).clone() })));
        }
        for agent in self.graph.agents.values().cloned().collect::<Vec<_>>() {
            let mut moved = (*agent).clone();
            moved.trajectory.iter_mut().for_each(|pose| pose.world_from_body = motion * pose.world_from_body);
            self.set_agent(moved.id, Some(Arc::new(moved)));
        }
        for (key, mut relation) in self.graph.relations.clone() {
            if let crate::relation::Verdict::Blocked(point) = &mut relation.evidence.verdict {
                *point = motion * *point;
                self.set_relation(key, Some(relation));
            }
        }
        Ok(())
    }

    // Recorded states

    fn set_to(&mut self, change: Change) -> Result<(), OpError> {
        let graph = &*self.graph;
        let is_as_recorded = match &change {
            Change::Object(id, before, _) => graph.objects.get(id) == before.as_ref(),
            Change::Place(id, before, _) => graph.places.get(id) == before.as_ref(),
            Change::PlaceEdge(id, before, _) => graph.place_edges.get(id) == before.as_ref(),
            Change::Room(id, before, _) => graph.rooms.get(id) == before.as_ref(),
            Change::RoomEdge(id, before, _) => graph.room_edges.get(id) == before.as_ref(),
            Change::Building(id, before, _) => graph.buildings.get(id) == before.as_ref(),
            Change::Group(id, before, _) => graph.groups.get(id) == before.as_ref(),
            Change::Relation(id, before, _) => graph.relations.get(id) == before.as_ref(),
            Change::Agent(id, before, _) => graph.agents.get(id) == before.as_ref(),
            Change::AgentPose(id, before, after) => match (graph.agent(*id), before, after) {
                (Some(_), None, Some(_)) => true,
                (Some(agent), Some(pose), None) => agent.trajectory.last() == Some(pose),
                _ => false,
            },
        };
        if !is_as_recorded {
            return Err(OpError::NotTheRecordedState);
        }
        self.record(change);
        Ok(())
    }

    fn set_object(&mut self, id: ObjectId, after: Option<Arc<Object>>) {
        let before = self.graph.objects.get(&id).cloned();
        if before != after {
            self.record(Change::Object(id, before, after));
        }
    }

    fn set_place(&mut self, id: PlaceId, after: Option<Place>) {
        let before = self.graph.places.get(&id).copied();
        if before != after {
            self.record(Change::Place(id, before, after));
        }
    }

    fn set_place_edge(&mut self, key: (PlaceId, PlaceId), after: Option<PlaceEdge>) {
        let before = self.graph.place_edges.get(&key).copied();
        if before != after {
            self.record(Change::PlaceEdge(key, before, after));
        }
    }

    fn set_room(&mut self, id: RoomId, after: Option<Arc<Room>>) {
        let before = self.graph.rooms.get(&id).cloned();
        if before != after {
            self.record(Change::Room(id, before, after));
        }
    }

    fn set_room_edge(&mut self, key: (RoomId, RoomId), after: Option<RoomEdge>) {
        let before = self.graph.room_edges.get(&key).copied();
        if before != after {
            self.record(Change::RoomEdge(key, before, after));
        }
    }

    fn set_building(&mut self, id: BuildingId, after: Option<Arc<Building>>) {
        let before = self.graph.buildings.get(&id).cloned();
        if before != after {
            self.record(Change::Building(id, before, after));
        }
    }

    fn set_group(&mut self, id: GroupId, after: Option<Arc<Group>>) {
        let before = self.graph.groups.get(&id).cloned();
        if before != after {
            self.record(Change::Group(id, before, after));
        }
    }

    fn set_relation(&mut self, key: RelationKey, after: Option<Relation>) {
        let before = self.graph.relations.get(&key).copied();
        if before != after {
            self.record(Change::Relation(key, before, after));
        }
    }

    fn set_agent(&mut self, id: AgentId, after: Option<Arc<Agent>>) {
        let before = self.graph.agents.get(&id).cloned();
        if before != after {
            self.record(Change::Agent(id, before, after));
        }
    }

    fn record(&mut self, change: Change) {
        self.write(&change);
        self.changes.push(change);
    }

    /// Writes the state after a change into the maps and their indices.
    fn write(&mut self, change: &Change) {
        let graph = &mut *self.graph;
        match change {
            Change::Object(id, _, after) => {
                put(&mut graph.objects, *id, after.clone());
                graph.next.object = graph.next.object.max(id.0.saturating_add(1));
            }
            Change::Place(id, _, after) => put(&mut graph.places, *id, *after),
            Change::PlaceEdge((a, b), _, after) => {
                put(&mut graph.place_edges, (*a, *b), *after);
                for (from, to) in [(*a, *b), (*b, *a)] {
                    let neighbours = graph.place_neighbours.entry(from).or_default();
                    if after.is_some() {
                        neighbours.insert(to);
                    } else {
                        neighbours.remove(&to);
                    }
                    if neighbours.is_empty() {
                        graph.place_neighbours.remove(&from);
                    }
                }
            }
            Change::Room(id, _, after) => {
                put(&mut graph.rooms, *id, after.clone());
                graph.next.room = graph.next.room.max(id.0.saturating_add(1));
            }
            Change::RoomEdge(key, _, after) => put(&mut graph.room_edges, *key, *after),
            Change::Building(id, _, after) => put(&mut graph.buildings, *id, after.clone()),
            Change::Group(id, _, after) => {
                put(&mut graph.groups, *id, after.clone());
                graph.next.group = graph.next.group.max(id.0.saturating_add(1));
            }
            Change::Relation(key, _, after) => {
                put(&mut graph.relations, *key, *after);
                for to in [Some(key.2), key.3].into_iter().flatten() {
                    let keys = graph.relations_to.entry(to).or_default();
                    if after.is_some() {
                        keys.insert(*key);
                    } else {
                        keys.remove(key);
                    }
                    if keys.is_empty() {
                        graph.relations_to.remove(&to);
                    }
                }
            }
            Change::Agent(id, _, after) => put(&mut graph.agents, *id, after.clone()),
            Change::AgentPose(id, _, after) => {
                if let Some(agent) = graph.agents.get_mut(id) {
                    let trajectory = &mut Arc::make_mut(agent).trajectory;
                    match after {
                        Some(pose) => trajectory.push(*pose),
                        None => drop(trajectory.pop()),
                    }
                }
            }
        }
    }
}

fn put<K: Ord, V>(map: &mut std::collections::BTreeMap<K, V>, key: K, value: Option<V>) {
    match value {
        Some(value) => drop(map.insert(key, value)),
        None => drop(map.remove(&key)),
    }
}

fn check_object(object: &Object) -> Result<(), OpError> {
    let bad = |field| Err(OpError::BadNumber { node: "object", field });
    if object.label.trim().is_empty() {
        return Err(OpError::BadName { node: "object", field: "label" });
    }
    if !object.bounds.is_valid() {
        return bad("bounds");
    }
    check_point("object", "centroid", &object.centroid)?;
    if !(0.0..=1.0).contains(&object.label_margin) {
        return bad("label_margin");
    }
    if object.votes.values().any(|votes| !(votes.is_finite() && *votes >= 0.0)) {
        return bad("votes");
    }
    if object.first_seen_ns > object.last_seen_ns {
        return bad("last_seen_ns");
    }
    Ok(())
}

fn check_point(node: &'static str, field: &'static str, point: &Point3<f64>) -> Result<(), OpError> {
    if point.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(OpError::BadNumber { node, field }) }
}

fn check_range(node: &'static str, field: &'static str, value: f64, least: f64) -> Result<(), OpError> {
    if value.is_finite() && value >= least { Ok(()) } else { Err(OpError::BadNumber { node, field }) }
}

fn check_pose(pose: &Isometry3<f64>) -> Result<(), OpError> {
    let rotation = pose.rotation.coords.iter().all(|x| x.is_finite());
    check_point("agent", "world_from_body", &pose.translation.vector.into())?;
    if rotation { Ok(()) } else { Err(OpError::BadNumber { node: "agent", field: "world_from_body" }) }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::bounds::Aabb;

    fn object(id: u64, x: f64) -> Op {
        let bounds = Aabb::from_center(Point3::new(x, 0.0, 0.0), Vector3::repeat(0.4));
        Op::PutObject(Box::new(Object::new(ObjectId(id), "chair", bounds)))
    }

    fn place(id: u64) -> Op {
        let position = Point3::new(id as f64, 0.0, 1.0);
        Op::PutPlace(Place {
            id: PlaceId(id),
            position,
            clearance_m: 1.0,
            basis_points: 3,
            frontier_cells: 0,
            room: None,
        })
    }

    fn room(id: u64, places: &[u64]) -> Op {
        let mut room = Room::new(RoomId(id), Point3::origin());
        room.places = places.iter().copied().map(PlaceId).collect();
        Op::PutRoom(Box::new(room))
    }

    #[test]
    fn an_op_that_changes_nothing_keeps_the_revision() {
        let mut graph = SceneGraph::new();
        assert_eq!(graph.apply(object(1, 0.0)).unwrap().revision, 1);
        let again = graph.apply(object(1, 0.0)).unwrap();
        assert_eq!((again.revision, again.changes.len()), (1, 0));
    }

    #[test]
    fn a_failing_batch_leaves_no_trace() {
        let mut graph = SceneGraph::new();
        graph.apply(place(1)).unwrap();
        let before = graph.clone();
        let batch = Op::Batch(vec![place(2), Op::RemovePlace(PlaceId(1)), Op::RemovePlace(PlaceId(9))]);
        assert_eq!(graph.apply(batch), Err(OpError::NoPlace(PlaceId(9))));
        assert!(graph.has_same_content(&before));
        assert_eq!(graph.revision(), 1);
        graph.check_invariants().unwrap();
    }

    #[test]
    fn removing_a_place_reaches_room_edges_and_objects_and_undo_brings_all_back() {
        let mut graph = SceneGraph::new();
        for op in [place(1), place(2), room(1, &[1, 2]), object(1, 0.0)] {
            graph.apply(op).unwrap();
        }
        graph.apply(Op::PutPlaceEdge(PlaceEdge { a: PlaceId(2), b: PlaceId(1), clearance_m: 0.5 })).unwrap();
        let mut standing = graph.object(ObjectId(1)).unwrap().clone();
        standing.place = Some(PlaceId(1));
        graph.apply(Op::PutObject(Box::new(standing))).unwrap();

        let before = graph.clone();
        let event = graph.apply(Op::RemovePlace(PlaceId(1))).unwrap();
        assert_eq!(graph.room(RoomId(1)).unwrap().places, [PlaceId(2)]);
        assert_eq!(graph.object(ObjectId(1)).unwrap().place, None);
        assert_eq!(graph.place_edges().count(), 0);
        graph.check_invariants().unwrap();

        graph.apply(event.inverse()).unwrap();
        assert!(graph.has_same_content(&before));
        graph.check_invariants().unwrap();
        assert_eq!(graph.changes_since(event.revision).len(), 1);
    }

    #[test]
    fn a_room_takes_places_from_another() {
        let mut graph = SceneGraph::new();
        for op in [place(1), place(2), room(1, &[1, 2]), room(2, &[2])] {
            graph.apply(op).unwrap();
        }
        assert_eq!(graph.room(RoomId(1)).unwrap().places, [PlaceId(1)]);
        assert_eq!(graph.place(PlaceId(2)).unwrap().room, Some(RoomId(2)));
        graph.check_invariants().unwrap();
    }

    #[test]
    fn merged_objects_add_their_votes() {
        let mut graph = SceneGraph::new();
        let chair = Object::new(ObjectId(1), "chair", Aabb::at(Point3::origin()));
        let mut stool = Object::new(ObjectId(2), "stool", Aabb::at(Point3::new(0.2, 0.0, 0.0)));
        stool.votes.insert("stool".into(), 3.0);
        stool.caption = "a wooden stool".into();
        graph.apply(Op::PutObject(Box::new(chair))).unwrap();
        graph.apply(Op::PutObject(Box::new(stool))).unwrap();
        graph.apply(Op::MergeObjects { from: ObjectId(2), into: ObjectId(1) }).unwrap();
        let merged = graph.object(ObjectId(1)).unwrap();
        assert_eq!((merged.label.as_str(), merged.label_margin, merged.observations), ("stool", 0.5, 2));
        assert_eq!(merged.caption, "a wooden stool");
        assert_eq!(graph.objects().count(), 1);
    }

    #[test]
    fn bad_numbers_are_refused() {
        let mut graph = SceneGraph::new();
        assert!(matches!(graph.apply(object(1, f64::NAN)), Err(OpError::BadNumber { .. })));
        assert_eq!(graph.revision(), 0);
    }
}
