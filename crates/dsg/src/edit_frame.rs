//! Ops on robots, and the rigid motion of everything.

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::agent::{Agent, AgentPose};
use crate::apply::Edit;
use crate::check::{check_object, check_pose};
use crate::group::Group;
use crate::ids::AgentId;
use crate::object::Object;
use crate::op::{Change, OpError};
use crate::place::Place;
use crate::relation::Verdict;
use crate::room::{Building, Room, RoomEdge};

impl Edit<'_> {
    pub(crate) fn put_agent(&mut self, agent: Agent) -> Result<(), OpError> {
        for pose in &agent.trajectory {
            check_pose(&pose.world_from_body)?;
        }
        if agent.trajectory.windows(2).any(|pair| pair[0].stamp_ns > pair[1].stamp_ns) {
            return Err(OpError::OldPose(agent.id));
        }
        self.set_agent(agent.id, Some(Arc::new(agent)));
        Ok(())
    }

    pub(crate) fn add_agent_pose(&mut self, id: AgentId, pose: AgentPose) -> Result<(), OpError> {
        check_pose(&pose.world_from_body)?;
        let agent = self.graph.agent(id).ok_or(OpError::NoAgent(id))?;
        if agent.trajectory.last().is_some_and(|newest| newest.stamp_ns > pose.stamp_ns) {
            return Err(OpError::OldPose(id));
        }
        self.record(Change::AgentPose(id, None, Some(pose)));
        Ok(())
    }

    pub(crate) fn transform(&mut self, motion: &Isometry3<f64>) -> Result<(), OpError> {
        check_pose(motion)?;
        for object in self.graph.objects.values().cloned().collect::<Vec<_>>() {
            let bounds = object.bounds.transformed(motion);
            let mut moved = Object { bounds, centroid: bounds.center(), ..(*object).clone() };
            moved.trajectory.iter_mut().for_each(|point| point.position = motion * point.position);
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
            if let Verdict::Blocked(point) = &mut relation.evidence.verdict {
                *point = motion * *point;
                self.set_relation(key, Some(relation));
            }
        }
        Ok(())
    }
}
