//! How an op changes the graph: all or nothing, with every touched node recorded, and its consequences in the same event.
//!
//! [`SceneGraph::apply`] -> `Edit::run` (one arm per op, in `edit_*.rs`) -> the `set_*` methods of `write.rs`, which write one
//! node and record the change. On an error the recorded changes are taken back in reverse. Consequences (a removed place leaves its room, its
//! edges and its objects) are further `set_*` calls, so undo needs no rules of its own.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::memory::ObjectMemory;
use crate::op::{Change, Event, LoggedEvent, Op, OpError};

/// Changes kept in the log before the older half is dropped: some ten minutes of a robot's run, a few megabytes.
const LOG_CHANGES: usize = 32_768;

impl SceneGraph {
    /// Changes the graph, or fails and leaves it as it was. The revision rises by one unless nothing changed.
    pub fn apply(&mut self, op: Op) -> Result<Event, OpError> {
        let mut edit = Edit { graph: self, changes: Vec::new(), points: None };
        if let Err(error) = edit.run(op) {
            let changes = std::mem::take(&mut edit.changes);
            for change in changes.iter().rev() {
                edit.write(&change.inverse());
            }
            if let Some(points) = edit.points {
                edit.graph.memory = points;
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
pub(crate) struct Edit<'a> {
    pub(crate) graph: &'a mut SceneGraph,
    pub(crate) changes: Vec<Change>,
    /// The builder's memory before it was forgotten.
    points: Option<BTreeMap<ObjectId, ObjectMemory>>,
}

impl Edit<'_> {
    /// Forgets the builder's points of all objects.
    pub(crate) fn forget_points(&mut self) {
        let points = std::mem::take(&mut self.graph.memory);
        self.points.get_or_insert(points);
    }

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
            Op::CorrectPoses(correction) => self.correct_poses(&correction),
            Op::Batch(ops) => ops.into_iter().try_for_each(|op| self.run(op)),
            Op::SetTo(changes) => {
                changes.into_iter().try_for_each(|change| self.set_to(change))?;
                // The builder's points may be those of another state.
                self.forget_points();
                // The states come from outside: together they must make a graph.
                self.graph.check_invariants().map_err(|_| OpError::NotTheRecordedState)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::bounds::Aabb;
    use crate::ids::{PlaceId, RoomId};
    use crate::object::Object;
    use crate::place::{Place, PlaceEdge};
    use crate::room::Room;

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
