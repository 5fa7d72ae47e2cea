//! Three-joint legs (hip about x, thigh and calf about y) and their closed-form inverse kinematics.
//!
//! Seen along the hip axis the foot lies at distance `d` (the sideways offset of the leg) beside the thigh plane; in that plane the
//! thigh `l1` and the calf `l2` form a triangle:
//!
//! ```text
//! y' = side * d,   z' = -sqrt(y^2 + z^2 - d^2)                 hip angle turns (y', z') into (y, z)
//! cos(calf) = (x^2 + z'^2 - l1^2 - l2^2) / (2 l1 l2)            knee behind: calf < 0
//! thigh = atan2(-x, -z') - atan2(l2 sin(calf), l1 + l2 cos(calf))
//! ```

use crate::description::LegEntry;
use crate::tree::KinematicTree;
use nalgebra::Point3;

/// A leg and its lengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Leg {
    /// Name in the TOML ("FL").
    pub name: String,
    /// Places of hip, thigh and calf in the list of moving joints.
    pub slots: [usize; 3],
    /// Name of the foot link.
    pub foot: String,
    /// The point on the hip axis from which the leg hangs, in the body frame.
    pub hip_in_body: Point3<f64>,
    /// Sideways offset from the hip axis to the plane of the leg; left is positive.
    pub hip_offset_m: f64,
    /// Thigh axis to calf axis.
    pub thigh_length_m: f64,
    /// Calf axis to foot.
    pub calf_length_m: f64,
    /// Limits of hip, thigh and calf; infinite where there are none.
    pub limits_rad: [(f64, f64); 3],
}

impl Leg {
    pub(crate) fn new(tree: &KinematicTree, entry: &LegEntry) -> Self {
        let zero = vec![0.0; tree.moving_joints().len()];
        let poses = tree.body_from_links(&zero).expect("one zero for each moving joint");
        let at_zero = |link: usize| Point3::from(poses[link].translation.vector);
        let joint_of = |slot: usize| &tree.joints()[tree.moving_joints()[slot]];
        let [hip, thigh, calf] = entry.slots.map(|slot| at_zero(joint_of(slot).child));
        let foot = at_zero(entry.foot);
        Self {
            name: entry.name.clone(),
            slots: entry.slots,
            foot: tree.links()[entry.foot].name.clone(),
            // At zero the leg hangs straight down; x and z of the thigh axis, y of the hip axis.
            hip_in_body: Point3::new(thigh.x, hip.y, hip.z),
            hip_offset_m: foot.y - hip.y,
            thigh_length_m: thigh.z - calf.z,
            calf_length_m: calf.z - foot.z,
            limits_rad: entry.slots.map(|slot| {
                (joint_of(slot).lower.unwrap_or(f64::NEG_INFINITY), joint_of(slot).upper.unwrap_or(f64::INFINITY))
            }),
        }
    }

    /// Hip, thigh and calf angles that put the foot's origin at `foot_in_body`, knee backwards; `None` when it is out of reach or a
    /// joint would leave its limits. The leg must hang straight down at zero, as the legs of the Unitree robots do.
    pub fn inverse(&self, foot_in_body: &Point3<f64>) -> Option<[f64; 3]> {
        let p = foot_in_body - self.hip_in_body;
        let (l1, l2, d) = (self.thigh_length_m, self.calf_length_m, self.hip_offset_m);
        let below_squared = p.y * p.y + p.z * p.z - d * d;
        let below = (below_squared >= 0.0).then(|| -below_squared.sqrt())?;
        let hip = p.z.atan2(p.y) - below.atan2(d);
        let cosine = (p.x * p.x + below_squared - l1 * l1 - l2 * l2) / (2.0 * l1 * l2);
        let calf = -(-1.0..=1.0).contains(&cosine).then(|| cosine.acos())?;
        let thigh = (-p.x).atan2(-below) - (l2 * calf.sin()).atan2(l1 + l2 * calf.cos());
        let angles = [wrapped(hip), wrapped(thigh), calf];
        let is_allowed =
            angles.iter().zip(&self.limits_rad).all(|(angle, (lower, upper))| (*lower..=*upper).contains(angle));
        is_allowed.then_some(angles)
    }
}

/// The same angle in (-pi, pi].
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}
