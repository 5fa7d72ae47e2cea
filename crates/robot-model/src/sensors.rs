//! Where the sensors sit on the body, and how the rotating LiDAR turns.
//!
//! ```text
//! p_body = body_from_lidar_stator * Rz(motor angle) * rotor_from_sensor * p_sensor
//! ```
//!
//! The motor turns about the z axis of the stator; the sensor's own spin axis is tilted against it, so that one motor turn
//! covers the whole sphere.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Poses of the sensors in the stance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorMounts {
    /// Stator of the LiDAR motor; its z axis is the motor axis.
    pub body_from_lidar_stator: Isometry3<f64>,
    /// The LiDAR on its rotor: tilt and offset.
    pub rotor_from_sensor: Isometry3<f64>,
    /// The IMU.
    pub body_from_imu: Isometry3<f64>,
    /// The panoramic camera: x forward, y left, z up (not an optical frame).
    pub body_from_camera: Isometry3<f64>,
    /// How the LiDAR motor turns.
    pub lidar: LidarMotor,
}

/// The motor that turns the LiDAR.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LidarMotor {
    /// Turns per second about the stator's z axis; 0: fixed.
    pub rotation_hz: f64,
    /// Angle between the motor axis and the spin axis of the sensor.
    pub tilt_rad: f64,
}

impl SensorMounts {
    /// Pose of the LiDAR sensor in the body at a motor angle.
    pub fn body_from_sensor(&self, motor_angle_rad: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), motor_angle_rad);
        self.body_from_lidar_stator * turn * self.rotor_from_sensor
    }
}

/// The sensor on its rotor, tilted about the rotor's y axis.
pub(crate) fn rotor_from_sensor(tilt_rad: f64, offset_m: [f64; 3]) -> Isometry3<f64> {
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt_rad);
    Isometry3::from_parts(Translation3::from(Vector3::from(offset_m)), tilt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn the_spin_axis_precesses_about_the_motor_axis() {
        let mounts = SensorMounts {
            body_from_lidar_stator: Isometry3::translation(0.0, 0.0, 0.3),
            rotor_from_sensor: rotor_from_sensor(0.5, [0.0, 0.0, 0.1]),
            body_from_imu: Isometry3::identity(),
            body_from_camera: Isometry3::identity(),
            lidar: LidarMotor { rotation_hz: 0.5, tilt_rad: 0.5 },
        };
        let start = mounts.body_from_sensor(0.0) * Vector3::z();
        let half_turn = mounts.body_from_sensor(PI) * Vector3::z();
        assert!((start - Vector3::new(0.5f64.sin(), 0.0, 0.5f64.cos())).norm() < 1e-12);
        assert!((half_turn - Vector3::new(-0.5f64.sin(), 0.0, 0.5f64.cos())).norm() < 1e-12);
        assert!((mounts.body_from_sensor(1.0).translation.vector - Vector3::new(0.0, 0.0, 0.4)).norm() < 1e-12);
    }
}
