//! The sensor's motion during a scan, tabulated: the fast form of the chain of transforms in [`crate::deskew`].
//!
//! Exact transforms every 250 microseconds, entries of the matrices blended linearly between. The blend is off by
//! (omega h)^2 / 8 of the range: 1e-6 at 10 rad/s, that is 0.01 mm at 10 m.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

const STEP_NS: u32 = 250_000;

/// Transforms from the sensor to the reference frame over the offsets of one scan.
pub(crate) struct MotionTable<F> {
    nodes: Vec<Option<(Matrix3<f32>, Vector3<f32>)>>,
    exact: F,
}

impl<F: Fn(u32) -> Option<Isometry3<f64>>> MotionTable<F> {
    /// Tabulates `exact` (offset in nanoseconds to transform) from zero to `duration_s`, at most the range of u32.
    pub(crate) fn new(duration_s: f64, exact: F) -> MotionTable<F> {
        let steps = (duration_s * 1e9 / f64::from(STEP_NS)) as u32 + 1;
        let node = |step: u32| {
            let transform = exact(step.saturating_mul(STEP_NS))?;
            let matrix = transform.rotation.to_rotation_matrix().into_inner();
            Some((matrix.cast(), transform.translation.vector.cast()))
        };
        MotionTable { nodes: (0..=steps).map(node).collect(), exact }
    }

    /// The point in the reference frame; `None` where there is no transform.
    pub(crate) fn apply(&self, offset_ns: u32, point: &Point3<f32>) -> Option<Point3<f32>> {
        let step = (offset_ns / STEP_NS) as usize;
        match (self.nodes.get(step), self.nodes.get(step + 1)) {
            (Some(Some((matrix, offset))), Some(Some((next_matrix, next_offset)))) => {
                let share = (offset_ns % STEP_NS) as f32 / STEP_NS as f32;
                let here = matrix * point.coords + offset;
                let there = next_matrix * point.coords + next_offset;
                Some(Point3::from(here + (there - here) * share))
            }
            // At the ends of the trajectory a node may lie outside while the point is still inside.
            _ => Some(((self.exact)(offset_ns)? * point.cast::<f64>()).cast::<f32>()),
        }
    }
}
