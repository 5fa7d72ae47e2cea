//! The double sphere model (Kalibr `ds`): two unit spheres, `xi` apart, and a pinhole moved by `alpha`.
//!
//! ```text
//! d1 = |P|, d2 = sqrt(x^2 + y^2 + (xi d1 + z)^2),   u = fx x/(alpha d2 + (1 - alpha)(xi d1 + z)) + cx,  v alike
//! ```
//! V. Usenko, N. Demmel, D. Cremers, "The Double Sphere Camera Model", 3DV 2018, Eq. 40 to 52.

use nalgebra::{Point3, Unit, Vector3};

use super::intrinsics::check_max_angle;
use super::radial::{self, MIN_SLOPE};
use super::{Intrinsics, Pixel};
use crate::CameraError;

/// A fisheye of two spheres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleSphere {
    intrinsics: Intrinsics,
    xi: f64,
    alpha: f64,
    max_angle_rad: f64,
    max_radius: f64,
}

impl DoubleSphere {
    /// The lens with `xi` in (-1, 1] and `alpha` in [0, 1], which sees nothing farther than `max_angle_rad` from its axis
    /// (half its field of view; pi if unknown). The domain ends earlier where the model stops being one to one.
    ///
    /// # Errors
    /// [`CameraError`] names the number that is out of its range.
    pub fn new(intrinsics: Intrinsics, xi: f64, alpha: f64, max_angle_rad: f64) -> Result<DoubleSphere, CameraError> {
        intrinsics.validate()?;
        if !(xi > -1.0 && xi <= 1.0) {
            return Err(CameraError::Parameter { name: "xi", value: xi, accepts: "a number in (-1, 1]" });
        }
        if !(0.0..=1.0).contains(&alpha) {
            return Err(CameraError::Parameter { name: "alpha", value: alpha, accepts: "a number in [0, 1]" });
        }
        check_max_angle(max_angle_rad)?;
        let max_angle_rad = last_rising_angle(xi, alpha, max_angle_rad);
        Ok(DoubleSphere { intrinsics, xi, alpha, max_angle_rad, max_radius: radius(xi, alpha, max_angle_rad).0 })
    }

    /// See [`super::Camera::project`].
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Pixel> {
        let (right, down) =
            radial::place(point_in_camera, self.max_angle_rad, |angle| radius(self.xi, self.alpha, angle).0)?;
        self.intrinsics.pixel(right, down)
    }

    /// See [`super::Camera::unproject`].
    pub fn unproject(&self, pixel: Pixel) -> Option<Unit<Vector3<f64>>> {
        radial::direction(self.intrinsics.plane(pixel)?, self.max_radius, |r| angle(self.xi, self.alpha, r))
    }

    /// Size, focal lengths and centre.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Distance of the spheres.
    pub fn xi(&self) -> f64 {
        self.xi
    }

    /// Shift of the pinhole.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// Where the domain ends, from the axis.
    pub fn max_angle_rad(&self) -> f64 {
        self.max_angle_rad
    }
}

/// r of a direction on the unit sphere, and its slope by the angle.
fn radius(xi: f64, alpha: f64, angle: f64) -> (f64, f64) {
    let (sin, cos) = angle.sin_cos();
    let shifted = xi + cos;
    let d2 = sin.hypot(shifted);
    let below = alpha * d2 + (1.0 - alpha) * shifted;
    let below_slope = -sin * (alpha * xi / d2 + 1.0 - alpha);
    (sin / below, (cos * below - sin * below_slope) / (below * below))
}

/// Eq. 49 to 52 for a place at radius r.
fn angle(xi: f64, alpha: f64, r: f64) -> f64 {
    let r2 = r * r;
    let root = (1.0 - (2.0 * alpha - 1.0) * r2).max(0.0).sqrt();
    let mz = (1.0 - alpha * alpha * r2) / (alpha * root + 1.0 - alpha);
    let scale = (mz * xi + (mz * mz + (1.0 - xi * xi) * r2).sqrt()) / (mz * mz + r2);
    (scale * r).atan2(scale * mz - xi)
}

/// The largest angle up to which the model is valid (Eq. 43, 44: z > -w2 d1) and r rises by at least [`MIN_SLOPE`] of its
/// slope at the axis.
fn last_rising_angle(xi: f64, alpha: f64, wanted_rad: f64) -> f64 {
    let w1 = if alpha <= 0.5 { alpha / (1.0 - alpha) } else { (1.0 - alpha) / alpha };
    let w2 = (w1 + xi) / (2.0 * w1 * xi + xi * xi + 1.0).sqrt();
    let valid_rad = (-w2).clamp(-1.0, 1.0).acos();
    // At the limit itself r is infinite for alpha <= 0.5: any image ends before.
    let end_rad = wanted_rad.min(valid_rad * (1.0 - 1e-9));
    let rises = |angle: f64| {
        let (r, slope) = radius(xi, alpha, angle);
        r >= 0.0 && slope >= MIN_SLOPE / (1.0 + xi)
    };
    const STEPS: usize = 1000;
    let at = |step: usize| end_rad * step as f64 / STEPS as f64;
    let Some(first_bad) = (1..=STEPS).find(|&step| !rises(at(step))) else { return end_rad };
    let (mut low, mut high) = (at(first_bad - 1), at(first_bad));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if rises(middle) { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn intrinsics() -> Intrinsics {
        Intrinsics { width_px: 512, height_px: 512, fx_px: 158.0, fy_px: 157.0, cx_px: 255.0, cy_px: 257.0 }
    }

    #[test]
    fn without_shift_it_is_a_pinhole() {
        let camera = DoubleSphere::new(intrinsics(), 0.0, 0.0, PI).expect("sound");
        let pixel = camera.project(&Point3::new(2.0, -1.0, -0.5)).expect("inside");
        assert!((pixel.u - (255.5 + 158.0 * 0.5)).abs() < 1e-12 && (pixel.v - (257.5 + 157.0 * 0.25)).abs() < 1e-12);
        assert_eq!(camera.project(&Point3::new(-0.1, 1.0, 0.0)), None);
    }

    #[test]
    fn eq_40_by_hand() {
        // P = (3, 0, 4) in optical axes with xi = 0.2, alpha = 0.6: d1 = 5, d2 = hypot(3, 5), below = 0.6 d2 + 2.
        let camera = DoubleSphere::new(intrinsics(), 0.2, 0.6, PI).expect("sound");
        let pixel = camera.project(&Point3::new(4.0, -3.0, 0.0)).expect("inside");
        let below = 0.6 * 34_f64.sqrt() + 0.4 * 5.0;
        assert!((pixel.u - (255.5 + 158.0 * 3.0 / below)).abs() < 1e-12);
    }

    #[test]
    fn the_slope_is_the_derivative_and_the_domain_ends_before_the_fold() {
        for (xi, alpha) in [(-0.17, 0.59), (0.3, 0.8), (0.9, 0.4), (-0.5, 0.5)] {
            let camera = DoubleSphere::new(intrinsics(), xi, alpha, PI).expect("sound");
            for step in 1..=20 {
                let a = camera.max_angle_rad() * f64::from(step) / 20.0 * 0.999;
                let h = 1e-6;
                let difference = (radius(xi, alpha, a + h).0 - radius(xi, alpha, a - h).0) / (2.0 * h);
                let slope = radius(xi, alpha, a).1;
                assert!((difference - slope).abs() < 1e-4 * slope.abs().max(1.0), "{xi} {alpha} {a}");
                assert!(slope > 0.0);
            }
        }
    }

    #[test]
    fn unsound_parameters_are_refused() {
        for (xi, alpha, name) in
            [(-1.0, 0.5, "xi"), (f64::NAN, 0.5, "xi"), (0.0, 1.1, "alpha"), (0.0, f64::NAN, "alpha")]
        {
            let refused = DoubleSphere::new(intrinsics(), xi, alpha, PI);
            assert!(matches!(refused, Err(CameraError::Parameter { name: n, .. }) if n == name), "{refused:?}");
        }
    }
}
