//! What the sensors deliver, as plain records.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use crate::Stamp;

/// One LiDAR return.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawPoint {
    /// Position in the sensor frame at the time of this very point.
    pub position: Point3<f32>,
    /// Nanoseconds after the start of the scan.
    pub offset_ns: u32,
    /// Beam number.
    pub ring: u16,
}

/// One sweep of the LiDAR.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RawScan {
    /// Time of offset zero.
    pub start: Stamp,
    /// The returns in any order.
    pub points: Vec<RawPoint>,
}

impl RawScan {
    /// Time of the latest point (the start if there is none).
    pub fn end(&self) -> Stamp {
        let longest = self.points.iter().map(|point| point.offset_ns).max().unwrap_or(0);
        self.start.plus_ns(i64::from(longest))
    }
}

/// One reading of the inertial sensor, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuSample {
    /// Time of the reading.
    pub stamp: Stamp,
    /// Angular velocity of the sensor.
    pub angular_velocity_radps: Vector3<f64>,
    /// Acceleration minus gravity: at rest it points up with 9.81.
    pub specific_force_mps2: Vector3<f64>,
}

/// How the LiDAR sits on a motor that turns about the stator's z axis.
///
/// ```text
/// p_body = body_from_stator * Rz(angle) * rotor_from_sensor * p_sensor
/// ```
/// A fixed LiDAR is the same with the angle zero ([`crate::EncoderTrack::fixed`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotatingMount {
    /// The motor's fixed part in the body.
    pub body_from_stator: Isometry3<f64>,
    /// The sensor on the motor's moving part (for example tilted by 30 degrees).
    pub rotor_from_sensor: Isometry3<f64>,
}

impl RotatingMount {
    /// The sensor in the body while the motor stands at `angle_rad`.
    pub fn body_from_sensor(&self, angle_rad: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad);
        self.body_from_stator * turn * self.rotor_from_sensor
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_quarter_turn_moves_forward_to_the_left() {
        let mount = RotatingMount {
            body_from_stator: Isometry3::translation(0.1, 0.0, 0.3),
            rotor_from_sensor: Isometry3::identity(),
        };
        let point = mount.body_from_sensor(FRAC_PI_2) * Point3::new(2.0, 0.0, 0.0);
        assert!((point - Point3::new(0.1, 2.0, 0.3)).norm() < 1e-12);
    }
}
