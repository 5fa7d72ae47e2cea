//! Writing one node: the change is recorded, the maps and their indices follow.

use std::sync::Arc;

use crate::agent::Agent;
use crate::apply::Edit;
use crate::group::Group;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::object::Object;
use crate::op::{Change, OpError};
use crate::place::{Place, PlaceEdge};
use crate::relation::{Relation, RelationKey};
use crate::room::{Building, Room, RoomEdge};

impl Edit<'_> {
    pub(crate) fn set_to(&mut self, change: Change) -> Result<(), OpError> {
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

    pub(crate) fn set_object(&mut self, id: ObjectId, after: Option<Arc<Object>>) {
        let before = self.graph.objects.get(&id).cloned();
        if before != after {
            self.record(Change::Object(id, before, after));
        }
    }

    pub(crate) fn set_place(&mut self, id: PlaceId, after: Option<Place>) {
        let before = self.graph.places.get(&id).copied();
        if before != after {
            self.record(Change::Place(id, before, after));
        }
    }

    pub(crate) fn set_place_edge(&mut self, key: (PlaceId, PlaceId), after: Option<PlaceEdge>) {
        let before = self.graph.place_edges.get(&key).copied();
        if before != after {
            self.record(Change::PlaceEdge(key, before, after));
        }
    }

    pub(crate) fn set_room(&mut self, id: RoomId, after: Option<Arc<Room>>) {
        let before = self.graph.rooms.get(&id).cloned();
        if before != after {
            self.record(Change::Room(id, before, after));
        }
    }

    pub(crate) fn set_room_edge(&mut self, key: (RoomId, RoomId), after: Option<RoomEdge>) {
        let before = self.graph.room_edges.get(&key).copied();
        if before != after {
            self.record(Change::RoomEdge(key, before, after));
        }
    }

    pub(crate) fn set_building(&mut self, id: BuildingId, after: Option<Arc<Building>>) {
        let before = self.graph.buildings.get(&id).cloned();
        if before != after {
            self.record(Change::Building(id, before, after));
        }
    }

    pub(crate) fn set_group(&mut self, id: GroupId, after: Option<Arc<Group>>) {
        let before = self.graph.groups.get(&id).cloned();
        if before != after {
            self.record(Change::Group(id, before, after));
        }
    }

    pub(crate) fn set_relation(&mut self, key: RelationKey, after: Option<Relation>) {
        let before = self.graph.relations.get(&key).copied();
        if before != after {
            self.record(Change::Relation(key, before, after));
        }
    }

    pub(crate) fn set_agent(&mut self, id: AgentId, after: Option<Arc<Agent>>) {
        let before = self.graph.agents.get(&id).cloned();
        if before != after {
            self.record(Change::Agent(id, before, after));
        }
    }

    pub(crate) fn record(&mut self, change: Change) {
        self.write(&change);
        self.changes.push(change);
    }

    /// Writes the state after a change into the maps and their indices.
    pub(crate) fn write(&mut self, change: &Change) {
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
