//! What always holds in a graph. Property tests call [`SceneGraph::check_invariants`] after every operation.

use crate::graph::SceneGraph;
use crate::ids::{ObjectId, PlaceId, RoomId};

/// A broken invariant: a bug of this crate.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InvariantError {
    /// An object is stored under another id or names a room, place or group that does not exist or does not know it.
    #[error("object {0} is inconsistent")]
    Object(ObjectId),
    /// A place is stored under another id, or its room does not list it.
    #[error("place {0} is inconsistent")]
    Place(PlaceId),
    /// A room lists a place that does not exist or belongs elsewhere, or shares its name.
    #[error("room {0} is inconsistent")]
    Room(RoomId),
    /// A group lists a member that does not exist or belongs elsewhere, or has fewer than two.
    #[error("a group is inconsistent")]
    Group,
    /// A place edge dangles or its neighbour index is wrong.
    #[error("the place edge {0}-{1} is inconsistent")]
    PlaceEdge(PlaceId, PlaceId),
    /// A room edge dangles.
    #[error("the room edge {0}-{1} is inconsistent")]
    RoomEdge(RoomId, RoomId),
    /// A building lists a room that does not exist.
    #[error("a building is inconsistent")]
    Building,
    /// A relation dangles or its index is wrong.
    #[error("the relation {0} -> {1} is inconsistent")]
    Relation(ObjectId, ObjectId),
    /// An id was given that a later node could get again.
    #[error("an id could be reused")]
    NextId,
    /// The log is not in order or does not end at the revision.
    #[error("the log is inconsistent")]
    Log,
}

impl SceneGraph {
    /// Checks all cross-references, indices, ids and the log. Linear in the size of the graph.
    pub fn check_invariants(&self) -> Result<(), InvariantError> {
        self.check_objects()?;
        self.check_places_and_rooms()?;
        self.check_edges()?;
        self.check_log()
    }

    fn check_objects(&self) -> Result<(), InvariantError> {
        for (&id, object) in &self.objects {
            let room_ok = object.room.is_none_or(|room| self.rooms.contains_key(&room));
            let place_ok = object.place.is_none_or(|place| self.places.contains_key(&place));
            let group_ok = object
                .group
                .is_none_or(|group| self.group(group).is_some_and(|group| group.members.binary_search(&id).is_ok()));
            if object.id != id || !room_ok || !place_ok || !group_ok || !object.bounds.is_valid() {
                return Err(InvariantError::Object(id));
            }
            if id.0 != u64::MAX && self.next.object <= id.0 {
                return Err(InvariantError::NextId);
            }
        }
        for (&id, group) in &self.groups {
            let members_ok = group.members.iter().all(|m| self.object(*m).is_some_and(|o| o.group == Some(id)));
            let sorted = group.members.is_sorted_by(|a, b| a < b);
            let support_ok = group.support.is_none_or(|support| group.members.contains(&support));
            let room_ok = group.room.is_none_or(|room| self.rooms.contains_key(&room));
            if group.id != id || group.members.len() < 2 || !members_ok || !sorted || !support_ok || !room_ok {
                return Err(InvariantError::Group);
            }
            if id.0 != u64::MAX && self.next.group <= id.0 {
                return Err(InvariantError::NextId);
            }
        }
        if self.memory.keys().any(|id| self.next.object <= id.0) {
            return Err(InvariantError::NextId);
        }
        Ok(())
    }

    fn check_places_and_rooms(&self) -> Result<(), InvariantError> {
        for (&id, place) in &self.places {
            let room_ok = place
                .room
                .is_none_or(|room| self.room(room).is_some_and(|room| room.places.binary_search(&id).is_ok()));
            if place.id != id || !room_ok {
                return Err(InvariantError::Place(id));
            }
        }
        let mut names: Vec<&str> = self.rooms().map(|room| room.name.as_str()).collect();
        names.sort_unstable();
        for (&id, room) in &self.rooms {
            let places_ok = room.places.iter().all(|p| self.place(*p).is_some_and(|place| place.room == Some(id)));
            let sorted = room.places.is_sorted_by(|a, b| a < b);
            if room.id != id || !places_ok || !sorted || room.name.trim().is_empty() {
                return Err(InvariantError::Room(id));
            }
            if names.windows(2).any(|pair| pair[0] == pair[1] && pair[0] == room.name) {
                return Err(InvariantError::Room(id));
            }
            if id.0 != u64::MAX && self.next.room <= id.0 {
                return Err(InvariantError::NextId);
            }
        }
        for (&id, building) in &self.buildings {
            if building.id != id || building.rooms.iter().any(|room| !self.rooms.contains_key(room)) {
                return Err(InvariantError::Building);
            }
        }
        Ok(())
    }

    fn check_edges(&self) -> Result<(), InvariantError> {
        for (&(a, b), edge) in &self.place_edges {
            let ends_ok = a < b && (edge.a, edge.b) == (a, b) && self.place(a).is_some() && self.place(b).is_some();
            let index_ok = [(a, b), (b, a)]
                .iter()
                .all(|(from, to)| self.place_neighbours.get(from).is_some_and(|neighbours| neighbours.contains(to)));
            if !ends_ok || !index_ok {
                return Err(InvariantError::PlaceEdge(a, b));
            }
        }
        let indexed: usize = self.place_neighbours.values().map(|neighbours| neighbours.len()).sum();
        if indexed != 2 * self.place_edges.len() {
            return Err(InvariantError::PlaceEdge(PlaceId(0), PlaceId(0)));
        }
        for (&(a, b), edge) in &self.room_edges {
            if a >= b || (edge.a, edge.b) != (a, b) || self.room(a).is_none() || self.room(b).is_none() {
                return Err(InvariantError::RoomEdge(a, b));
            }
        }
        let mut indexed = 0;
        for (key, relation) in &self.relations {
            let ends = [Some(key.0), Some(key.2), key.3];
            let ends_ok = ends.into_iter().flatten().all(|id| self.object(id).is_some());
            let index_ok =
                ends[1..].iter().flatten().all(|to| self.relations_to.get(to).is_some_and(|k| k.contains(key)));
            if relation.key() != *key || !ends_ok || !index_ok {
                return Err(InvariantError::Relation(key.0, key.2));
            }
            indexed += 1 + usize::from(key.3.is_some());
        }
        if indexed != self.relations_to.values().map(|keys| keys.len()).sum::<usize>() {
            return Err(InvariantError::Relation(ObjectId(0), ObjectId(0)));
        }
        Ok(())
    }

    fn check_log(&self) -> Result<(), InvariantError> {
        let in_order = self.log.windows(2).all(|pair| pair[0].revision < pair[1].revision);
        let ends_here = self.log.last().is_none_or(|event| event.revision <= self.revision);
        let starts_after = self.log.first().is_none_or(|event| event.revision > self.log_start);
        let counted = self.log.iter().map(|event| event.changes.len()).sum::<usize>() == self.log_changes;
        if in_order && ends_here && starts_after && counted { Ok(()) } else { Err(InvariantError::Log) }
    }
}
