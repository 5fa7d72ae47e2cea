//! Where the vehicle was and is, at any time of the last second, from reports that come now and then.

use std::collections::VecDeque;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use robot_link::mavlink::vehicle::{AttitudeReport, PositionReport};

/// A pose with its velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehiclePose {
    /// In the autopilot's local world (ENU), FLU body.
    pub world_from_body: Isometry3<f64>,
    /// In that world.
    pub velocity_in_world_mps: Vector3<f64>,
    /// In the body.
    pub angular_velocity_in_body_radps: Vector3<f64>,
}

/// Reports kept: more than a second at 50 Hz.
const KEPT: usize = 64;
/// A report is carried on with its velocity for this long; then it stands.
const CARRIED_S: f64 = 0.15;

/// The reports of the last second.
#[derive(Debug, Clone, Default)]
pub struct PoseHistory {
    positions: VecDeque<PositionReport>,
    attitudes: VecDeque<AttitudeReport>,
}

impl PoseHistory {
    /// Takes what is newer than what is known.
    pub fn add(&mut self, position: Option<&PositionReport>, attitude: Option<&AttitudeReport>) {
        if let Some(report) = position
            && self.positions.back().is_none_or(|last| last.stamp_ns < report.stamp_ns)
        {
            keep(&mut self.positions, *report);
        }
        if let Some(report) = attitude
            && self.attitudes.back().is_none_or(|last| last.stamp_ns < report.stamp_ns)
        {
            keep(&mut self.attitudes, *report);
        }
    }

    /// The pose at a time: between reports, or carried on from the nearest. `None` before the first of both kinds.
    pub fn at(&self, stamp_ns: i64) -> Option<VehiclePose> {
        let (position, velocity) = self.position_at(stamp_ns)?;
        let (rotation, rate) = self.attitude_at(stamp_ns)?;
        Some(VehiclePose {
            world_from_body: Isometry3::from_parts(position.into(), rotation),
            velocity_in_world_mps: velocity,
            angular_velocity_in_body_radps: rate,
        })
    }

    fn position_at(&self, stamp_ns: i64) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let next = self.positions.partition_point(|report| report.stamp_ns <= stamp_ns);
        let carried = |report: &PositionReport| {
            let age_s = seconds(stamp_ns, report.stamp_ns);
            let at = report.position_in_world + report.velocity_in_world_mps * age_s.clamp(-CARRIED_S, CARRIED_S);
            let is_known = age_s.abs() <= CARRIED_S;
            (at, if is_known { report.velocity_in_world_mps } else { Vector3::zeros() })
        };
        match (next.checked_sub(1).and_then(|i| self.positions.get(i)), self.positions.get(next)) {
            (Some(before), Some(after)) => {
                let part = seconds(stamp_ns, before.stamp_ns) / seconds(after.stamp_ns, before.stamp_ns);
                let ((p0, v0), (p1, v1)) = (carried(before), carried(after));
                Some((p0.lerp(&p1, part), v0.lerp(&v1, part)))
            }
            (Some(one), None) | (None, Some(one)) => Some(carried(one)),
            (None, None) => None,
        }
    }

    fn attitude_at(&self, stamp_ns: i64) -> Option<(UnitQuaternion<f64>, Vector3<f64>)> {
        let next = self.attitudes.partition_point(|report| report.stamp_ns <= stamp_ns);
        match (next.checked_sub(1).and_then(|i| self.attitudes.get(i)), self.attitudes.get(next)) {
            (Some(before), Some(after)) => {
                let part = seconds(stamp_ns, before.stamp_ns) / seconds(after.stamp_ns, before.stamp_ns);
                let turn = (before.world_from_body.inverse() * after.world_from_body).scaled_axis() * part;
                let rate = before.angular_velocity_in_body_radps.lerp(&after.angular_velocity_in_body_radps, part);
                Some((before.world_from_body * UnitQuaternion::from_scaled_axis(turn), rate))
            }
            (Some(one), None) | (None, Some(one)) => {
                let age_s = seconds(stamp_ns, one.stamp_ns);
                let rate = one.angular_velocity_in_body_radps;
                let turn = UnitQuaternion::from_scaled_axis(rate * age_s.clamp(-CARRIED_S, CARRIED_S));
                let is_known = age_s.abs() <= CARRIED_S;
                Some((one.world_from_body * turn, if is_known { rate } else { Vector3::zeros() }))
            }
            (None, None) => None,
        }
    }
}

fn keep<T>(queue: &mut VecDeque<T>, item: T) {
    if queue.len() == KEPT {
        queue.pop_front();
    }
    queue.push_back(item);
}

fn seconds(later_ns: i64, earlier_ns: i64) -> f64 {
    // An autopilot may claim any time: no difference of integers.
    (later_ns as f64 - earlier_ns as f64) * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn between_and_behind_reports_it_flies_on_and_then_stands() {
        let mut history = PoseHistory::default();
        assert_eq!(history.at(0), None);
        // 2 m/s to the east, turning left by 1 rad/s, reports every 35 and 20 ms.
        for k in 0..100 {
            let (at_ns, turned_ns) = (k * 35 * MS, k * 20 * MS);
            let position = PositionReport {
                stamp_ns: at_ns,
                position_in_world: Vector3::new(2.0 * at_ns as f64 * 1e-9, 0.0, 1.0),
                velocity_in_world_mps: Vector3::new(2.0, 0.0, 0.0),
            };
            let attitude = AttitudeReport {
                stamp_ns: turned_ns,
                world_from_body: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turned_ns as f64 * 1e-9),
                angular_velocity_in_body_radps: Vector3::z(),
            };
            history.add(Some(&position), Some(&attitude));
            history.add(Some(&position), Some(&attitude));
        }
        assert_eq!((history.positions.len(), history.attitudes.len()), (KEPT, KEPT));
        for stamp_ns in [1900 * MS, 1911 * MS, 2030 * MS] {
            let pose = history.at(stamp_ns).expect("known");
            assert!((pose.world_from_body.translation.x - 2.0 * stamp_ns as f64 * 1e-9).abs() < 1e-9);
            assert!((pose.world_from_body.rotation.angle() - stamp_ns as f64 * 1e-9).abs() < 1e-9);
            assert_eq!((pose.velocity_in_world_mps.x, pose.angular_velocity_in_body_radps.z), (2.0, 1.0));
        }
        let late = history.at(9000 * MS).expect("known");
        assert!((late.world_from_body.translation.x - 2.0 * (3.465 + CARRIED_S)).abs() < 1e-9);
        assert_eq!(late.velocity_in_world_mps, Vector3::zeros());
    }
}
