//! The world as triangles: one mesh for the building and everything that stands still in it, one for each thing that moves.

use nalgebra::{Isometry3, Point3};

/// What a triangle belongs to: `0` is the structure (walls, floor, ceiling, door frames), everything else is the
/// [`crate::building::ObjectTruth::id`] of an object. Never reaches a robot.
pub type InstanceId = u32;

/// Triangles with an instance and a colour each, in metres. Winding is counter-clockwise seen from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Corner positions.
    pub vertices: Vec<Point3<f32>>,
    /// Three vertex indices per triangle.
    pub faces: Vec<[u32; 3]>,
    /// Instance per triangle.
    pub instances: Vec<InstanceId>,
    /// Base colour per triangle, before shading.
    pub colors: Vec<[u8; 3]>,
}

/// A rigid thing that moves (a door leaf, a chair that is pushed, a person, a leg of the robot): its own mesh in its own
/// frame and a pose at any time.
#[derive(Debug, Clone)]
pub struct Mover {
    /// Instance of all its triangles.
    pub instance: InstanceId,
    /// Shape in the mover's frame.
    pub mesh: TriangleMesh,
    /// Key poses in time order, interpolated linearly in position and along the shortest rotation; constant before the
    /// first and after the last. Never empty.
    pub path: Vec<(i64, Isometry3<f64>)>,
}
