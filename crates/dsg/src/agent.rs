//! Robots in the graph: where they were, and when.

use nalgebra::Isometry3;

use crate::ids::AgentId;

/// A robot and its trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct Agent {
    /// Its id.
    pub id: AgentId,
    /// What people call it.
    pub name: String,
    /// Poses in time order.
    pub trajectory: Vec<AgentPose>,
}

/// One pose of a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AgentPose {
    /// When.
    pub stamp_ns: i64,
    /// Where.
    pub world_from_body: Isometry3<f64>,
}
