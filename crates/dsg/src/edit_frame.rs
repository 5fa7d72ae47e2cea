//! Ops on robots, and the motion of everything: rigid, or by a corrected trajectory.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use crate::agent::{Agent, AgentPose};
use crate::apply::Edit;
use crate::bounds::Aabb;
use crate::check::{check_object, check_point, check_pose};
use crate::correct::PoseCorrection;
use crate::group::Group;
use crate::ids::AgentId;
use crate::object::Object;
use crate::op::{Change, OpError};
use crate::place::Place;
use crate::relation::Verdict;
use crate::room::{Building, Room, RoomEdge};

/// How things move.
trait Motion {
    fn point(&self, point: &Point3<f64>) -> Point3<f64>;
    fn bounds(&self, bounds: &Aabb) -> Aabb;
    /// The motion of what belongs to a moment: the poses of robots, the way of a mover.
    fn at(&self, stamp_ns: i64) -> Isometry3<f64>;
}

impl Motion for Isometry3<f64> {
    fn point(&self, point: &Point3<f64>) -> Point3<f64> {
        self * point
    }

    fn bounds(&self, bounds: &Aabb) -> Aabb {
        bounds.transformed(self)
    }

    fn at(&self, _stamp_ns: i64) -> Isometry3<f64> {
        *self
    }
}

impl Motion for PoseCorrection {
    fn point(&self, point: &Point3<f64>) -> Point3<f64> {
        self.moved(point).0
    }

    fn bounds(&self, bounds: &Aabb) -> Aabb {
        self.moved_box(bounds)
    }

    fn at(&self, stamp_ns: i64) -> Isometry3<f64> {
        self.motion_at(stamp_ns)
    }
}

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
        self.move_all(motion)
    }

    pub(crate) fn correct_poses(&mut self, correction: &PoseCorrection) -> Result<(), OpError> {
        self.move_all(correction)
    }

    /// Every node, box, pose and way by one motion.
    fn move_all(&mut self, motion: &impl Motion) -> Result<(), OpError> {
        for object in self.graph.objects.values().cloned().collect::<Vec<_>>() {
            let bounds = motion.bounds(&object.bounds);
            let mut moved = Object { bounds, centroid: bounds.center(), ..(*object).clone() };
            moved.trajectory.iter_mut().for_each(|point| point.position = motion.at(point.stamp_ns) * point.position);
            check_object(&moved)?;
            self.set_object(object.id, Some(Arc::new(moved)));
        }
        for place in self.graph.places.values().copied().collect::<Vec<_>>() {
            let position = motion.point(&place.position);
            check_point("place", "position", &position)?;
            self.set_place(place.id, Some(Place { position, ..place }));
        }
        for room in self.graph.rooms.values().cloned().collect::<Vec<_>>() {
            self.set_room(room.id, Some(Arc::new(Room { center: motion.point(&room.center), ..(*room).clone() })));
        }
        for (key, edge) in self.graph.room_edges.clone() {
            self.set_room_edge(key, Some(RoomEdge { doorway: motion.point(&edge.doorway), ..edge }));
        }
        for building in self.graph.buildings.values().cloned().collect::<Vec<_>>() {
            let mut moved = Building { center: motion.point(&building.center), ..(*building).clone() };
            for storey in &mut moved.storeys {
                let at = Point3::new(building.center.x, building.center.y, storey.height_m);
                storey.height_m = motion.point(&at).z;
            }
            self.set_building(moved.id, Some(Arc::new(moved)));
        }
        for group in self.graph.groups.values().cloned().collect::<Vec<_>>() {
            self.set_group(group.id, Some(Arc::new(Group { center: motion.point(&group.center), ..(*group).clone() })));
        }
        for agent in self.graph.agents.values().cloned().collect::<Vec<_>>() {
            let mut moved = (*agent).clone();
            moved
                .trajectory
                .iter_mut()
                .for_each(|pose| pose.world_from_body = motion.at(pose.stamp_ns) * pose.world_from_body);
            self.set_agent(moved.id, Some(Arc::new(moved)));
        }
        for (key, mut relation) in self.graph.relations.clone() {
            if let Verdict::Blocked(point) = &mut relation.evidence.verdict {
                *point = motion.point(point);
                self.set_relation(key, Some(relation));
            }
        }
        // The builder's points are those of the old places; the boxes, which are right, bring them back at the next look.
        self.forget_points();
        Ok(())
    }
}
