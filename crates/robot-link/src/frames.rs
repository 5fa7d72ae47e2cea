//! Frames of the project (ENU world, FLU body) and of PX4 (NED world, FRD body).
//!
//! ```text
//! (north, east, down) = (y, x, -z) of (east, north, up)          forward, right, down = (x, -y, -z) of forward, left, up
//! q_ned_from_frd = q_ned_from_enu * q_enu_from_flu * q_flu_from_frd
//! yaw_ned = pi/2 - yaw_enu
//! ```
//!
//! Both changes of axes are half turns, so each is its own inverse; the functions are still named by direction, because the
//! caller's arguments are not. A world that is level but not aligned with north (the start frame of an odometry) goes with the body's
//! change of axes to LOCAL_FRD.

use nalgebra::{Matrix6, Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU};

/// World vector or position, ENU to NED.
pub fn ned_from_enu(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y, v.x, -v.z)
}

/// World vector or position, NED to ENU.
pub fn enu_from_ned(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y, v.x, -v.z)
}

/// Body vector, FLU to FRD; also a level world without north, to LOCAL_FRD.
pub fn frd_from_flu(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.y, -v.z)
}

/// Body vector, FRD to FLU; also LOCAL_FRD to a level world without north.
pub fn flu_from_frd(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.y, -v.z)
}

/// Attitude: `q_enu_from_flu` to `q_ned_from_frd`.
pub fn ned_frd_attitude(enu_from_flu: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    world_half_turn() * enu_from_flu * body_half_turn()
}

/// Attitude: `q_ned_from_frd` to `q_enu_from_flu`.
pub fn enu_flu_attitude(ned_from_frd: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    world_half_turn().inverse() * ned_from_frd * body_half_turn().inverse()
}

/// Attitude in a level world without north: FLU world and body to FRD world and body.
pub fn local_frd_attitude(flu_world_from_flu: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    body_half_turn() * flu_world_from_flu * body_half_turn()
}

/// Attitude in a level world without north: FRD world and body to FLU world and body.
pub fn local_flu_attitude(frd_world_from_frd: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    body_half_turn().inverse() * frd_world_from_frd * body_half_turn().inverse()
}

/// Yaw counter-clockwise from east to yaw clockwise from north, in (-pi, pi].
pub fn ned_yaw(enu_yaw_rad: f64) -> f64 {
    wrapped(FRAC_PI_2 - enu_yaw_rad)
}

/// Yaw clockwise from north to yaw counter-clockwise from east, in (-pi, pi].
pub fn enu_yaw(ned_yaw_rad: f64) -> f64 {
    wrapped(FRAC_PI_2 - ned_yaw_rad)
}

/// Covariance of (translation, rotation), both in a level FLU world, to LOCAL_FRD: only signs change.
pub fn local_frd_covariance(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    const SIGN: [f64; 6] = [1.0, -1.0, -1.0, 1.0, -1.0, -1.0];
    Matrix6::from_fn(|row, column| SIGN[row] * SIGN[column] * covariance[(row, column)])
}

/// The same angle in (-pi, pi].
pub fn wrapped(angle_rad: f64) -> f64 {
    let turned = angle_rad.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

fn world_half_turn() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0))
}

fn body_half_turn() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flying_north_nose_north() {
        // Nose to the north in ENU is a yaw of a quarter turn; in NED it is the identity.
        let enu_from_flu = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
        assert!(ned_frd_attitude(&enu_from_flu).angle() < 1e-12);
        assert!(ned_yaw(FRAC_PI_2).abs() < 1e-12);
        // East of north, 3 up: north 2, east 1, down -3.
        assert_eq!(ned_from_enu(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(2.0, 1.0, -3.0));
        assert_eq!(frd_from_flu(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(1.0, -2.0, -3.0));
    }

    #[test]
    fn a_left_turn_is_a_negative_yaw_for_px4() {
        let left = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.3);
        assert!((local_frd_attitude(&left).euler_angles().2 + 0.3).abs() < 1e-12);
        assert!((wrapped(3.0 * PI) - PI).abs() < 1e-12 && (wrapped(-PI) - PI).abs() < 1e-12);
    }
}
