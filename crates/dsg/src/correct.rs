//! A corrected trajectory moves everything that was seen along it: nodes, boxes, poses and mesh, by one field of motions.
//!
//! A loop closure or a survey says where the robot truly was. The motion from each old pose to its new one is known; what lies
//! between and around moves by the mean of the motions of the poses near it, weighted with a Gaussian of the distance. One field for
//! all: a mug, its box, the table under it and the mesh of both stay together, and a correction that is the same for all poses
//! is that rigid motion exactly. (Hydra interpolates likewise between control points; its boxes were once left behind.)

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3, Vector4};

use crate::agent::AgentPose;
use crate::bounds::Aabb;
use crate::check::check_pose;
use crate::graph::SceneGraph;
use crate::op::{Event, Op, OpError};

/// Poses closer than this, and turned less than [`KNOT_RAD`], share a knot: thousands of poses, some hundred knots.
const KNOT_M: f64 = 0.25;
/// See [`KNOT_M`].
const KNOT_RAD: f64 = 0.1;
/// Width of the Gaussian beside the way itself, and its growth with the distance from it.
const WIDTH_M: f64 = 0.75;
const WIDTH_PER_M: f64 = 0.5;
/// Weights below this share of the largest change nothing that can be seen.
const LEAST_WEIGHT: f64 = 1e-9;

/// Where a trajectory was thought to be and where it is.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseCorrection {
    /// All old poses with the motion to the new ones, by time.
    poses: Vec<Knot>,
    /// Those that the field of motions is made of.
    knots: Vec<Knot>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    stamp_ns: i64,
    at: Point3<f64>,
    motion: Isometry3<f64>,
}

/// Why two trajectories make no correction.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CorrectionError {
    /// One of them has no pose.
    #[error("the {0} trajectory has no pose")]
    Empty(&'static str),
    /// Stamps go backwards or a pose is not finite.
    #[error("pose {index} of the {which} trajectory is not finite or older than the one before")]
    Pose {
        /// "old" or "new".
        which: &'static str,
        /// Its number, from 0.
        index: usize,
    },
    /// They have no time in common.
    #[error("the trajectories do not overlap in time")]
    Apart,
}

impl PoseCorrection {
    /// The correction from `old` to `new`, both by time. The new trajectory is interpolated at the old stamps; old poses outside its
    /// time move with its first or last.
    ///
    /// # Errors
    /// [`CorrectionError`] for a trajectory that is empty, out of order or not finite, and for two without common time.
    pub fn new(old: &[AgentPose], new: &[AgentPose]) -> Result<PoseCorrection, CorrectionError> {
        check("old", old)?;
        check("new", new)?;
        let (first, last) = (new[0].stamp_ns, new[new.len() - 1].stamp_ns);
        if old[old.len() - 1].stamp_ns < first || old[0].stamp_ns > last {
            return Err(CorrectionError::Apart);
        }
        let within: Vec<Knot> = old
            .iter()
            .filter(|pose| (first..=last).contains(&pose.stamp_ns))
            .map(|pose| Knot {
                stamp_ns: pose.stamp_ns,
                at: pose.world_from_body.translation.vector.into(),
                motion: interpolated(new, pose.stamp_ns) * pose.world_from_body.inverse(),
            })
            .collect();
        if within.is_empty() {
            return Err(CorrectionError::Apart);
        }
        // Poses outside the time of the new trajectory: the nearest motion in time.
        let motion_of = |stamp_ns: i64| {
            let after = within.partition_point(|knot| knot.stamp_ns <= stamp_ns);
            within[after.saturating_sub(1)].motion
        };
        let knot = |pose: &AgentPose| Knot {
            stamp_ns: pose.stamp_ns,
            at: pose.world_from_body.translation.vector.into(),
            motion: motion_of(pose.stamp_ns),
        };
        let poses: Vec<Knot> = old.iter().map(knot).collect();
        let mut knots: Vec<Knot> = Vec::new();
        for pose in &poses {
            let is_far = |knot: &Knot| {
                (knot.at - pose.at).norm() > KNOT_M
                    || knot.motion.rotation.angle_to(&pose.motion.rotation) > KNOT_RAD
                    || (knot.motion * pose.at - pose.motion * pose.at).norm() > 0.1 * KNOT_M
            };
            if knots.last().is_none_or(is_far) {
                knots.push(*pose);
            }
        }
        Ok(PoseCorrection { poses, knots })
    }

    /// Where a point goes, and how what is there turns.
    pub fn moved(&self, point: &Point3<f64>) -> (Point3<f64>, UnitQuaternion<f64>) {
        let squared = |knot: &Knot| (knot.at - point).norm_squared();
        let least = self.knots.iter().map(squared).fold(f64::INFINITY, f64::min);
        let width_m = WIDTH_M + WIDTH_PER_M * least.sqrt();
        let (mut sum, mut displacement, mut turn) = (0.0, Vector3::zeros(), Vector4::zeros());
        let reference = self.knots[0].motion.rotation.coords;
        for knot in &self.knots {
            let weight = (-(squared(knot) - least) / (2.0 * width_m * width_m)).exp();
            if weight < LEAST_WEIGHT {
                continue;
            }
            sum += weight;
            displacement += weight * (knot.motion * point - point);
            // A quaternion and its negative are one rotation.
            let q = knot.motion.rotation.coords;
            turn += weight * if q.dot(&reference) < 0.0 { -q } else { q };
        }
        let turn = UnitQuaternion::try_new(turn.into(), 1e-9).unwrap_or_else(|| self.knots[0].motion.rotation);
        (point + displacement / sum, turn)
    }

    /// Where a box goes: its middle by the field, its sides as large as the turned box needs.
    pub fn moved_box(&self, bounds: &Aabb) -> Aabb {
        let center = bounds.center();
        let (to, turn) = self.moved(&center);
        let about = Isometry3::from_parts(Translation3::from(to.coords), turn);
        Aabb { min: bounds.min - center.coords, max: bounds.max - center.coords }.transformed(&about)
    }

    /// The motion of what belongs to a moment rather than to a place: poses, and points of things that move.
    pub fn motion_at(&self, stamp_ns: i64) -> Isometry3<f64> {
        let after = self.poses.partition_point(|knot| knot.stamp_ns <= stamp_ns);
        let (Some(before), Some(next)) = (self.poses.get(after.wrapping_sub(1)), self.poses.get(after)) else {
            return self.poses[after.min(self.poses.len() - 1)].motion;
        };
        let share = (stamp_ns - before.stamp_ns) as f64 / (next.stamp_ns - before.stamp_ns).max(1) as f64;
        between(&before.motion, &next.motion, share)
    }

    /// Moves the vertices of a mesh, or other points on the map.
    pub fn move_points(&self, points: &mut [[f32; 3]]) {
        for point in points {
            let (to, _) = self.moved(&Point3::from(*point).cast::<f64>());
            *point = to.cast::<f32>().into();
        }
    }
}

/// Corrects a graph and the vertices of its mesh together: one op, one revision, undone as one.
///
/// # Errors
/// What [`SceneGraph::apply`] refuses; then neither has changed.
pub fn correct_poses(
    graph: &mut SceneGraph,
    mesh: &mut [[f32; 3]],
    correction: &PoseCorrection,
) -> Result<Event, OpError> {
    let event = graph.apply(Op::CorrectPoses(Box::new(correction.clone())))?;
    correction.move_points(mesh);
    Ok(event)
}

fn check(which: &'static str, poses: &[AgentPose]) -> Result<(), CorrectionError> {
    if poses.is_empty() {
        return Err(CorrectionError::Empty(which));
    }
    for (index, pose) in poses.iter().enumerate() {
        let is_later = index == 0 || poses[index - 1].stamp_ns <= pose.stamp_ns;
        if !is_later || check_pose(&pose.world_from_body).is_err() {
            return Err(CorrectionError::Pose { which, index });
        }
    }
    Ok(())
}

/// A trajectory at a time within it.
fn interpolated(poses: &[AgentPose], stamp_ns: i64) -> Isometry3<f64> {
    let after = poses.partition_point(|pose| pose.stamp_ns <= stamp_ns);
    let before = &poses[after.saturating_sub(1)];
    let Some(next) = poses.get(after) else {
        return before.world_from_body;
    };
    let share = (stamp_ns - before.stamp_ns) as f64 / (next.stamp_ns - before.stamp_ns).max(1) as f64;
    between(&before.world_from_body, &next.world_from_body, share.clamp(0.0, 1.0))
}

fn between(a: &Isometry3<f64>, b: &Isometry3<f64>, share: f64) -> Isometry3<f64> {
    let translation = a.translation.vector.lerp(&b.translation.vector, share);
    // Half a turn between two poses has no shortest way: the earlier stands.
    let rotation = a.rotation.try_slerp(&b.rotation, share, 1e-9).unwrap_or(a.rotation);
    Isometry3::from_parts(translation.into(), rotation)
}
