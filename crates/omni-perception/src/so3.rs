//! Small pieces of the rotation group: the hat map and the inverse right Jacobian.

use nalgebra::{Matrix3, Vector3};

/// Inverse of the right Jacobian: d/dt Log(R) = Jr^-1(Log R) omega_body.
///
/// Valid below a full turn; series near zero.
pub fn right_jacobian_inverse(rotation_vector: &Vector3<f64>) -> Matrix3<f64> {
    let angle = rotation_vector.norm();
    let hat = rotation_vector.cross_matrix();
    let quadratic = if angle < 1e-4 {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    Matrix3::identity() + 0.5 * hat + quadratic * hat * hat
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// Central differences with a step of 1e-6 on a smooth function.
    const DIFFERENCE_TOL: f64 = 1e-8;

    #[test]
    fn the_jacobian_is_the_derivative_of_the_logarithm() {
        let rate = Vector3::new(0.4, -1.0, 0.7);
        for axis in [Vector3::new(1e-6, 2e-6, 0.0), Vector3::new(0.3, -0.2, 0.5), Vector3::new(1.8, 1.5, -1.0)] {
            let start = UnitQuaternion::from_scaled_axis(axis);
            let log = |t: f64| (start * UnitQuaternion::from_scaled_axis(rate * t)).scaled_axis();
            let numeric = (log(1e-6) - log(-1e-6)) / 2e-6;
            assert!((right_jacobian_inverse(&axis) * rate - numeric).norm() < DIFFERENCE_TOL);
        }
    }
}
