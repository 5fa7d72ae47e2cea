//! Kannala and Brandt's fisheye with four coefficients, as OpenCV (`fisheye`) and Kalibr (`pinhole-equi`) write it:
//!
//! ```text
//! r(angle) = angle + k1 angle^3 + k2 angle^5 + k3 angle^7 + k4 angle^9,   u = fx r x/rho + cx,  v = fy r y/rho + cy
//! ```
//! J. Kannala, S. Brandt, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
//! lenses", TPAMI 2006, Eq. 6.

use nalgebra::{Point3, Unit, Vector3};

use super::intrinsics::{check_finite, check_max_angle};
use super::radial::{self, MIN_SLOPE};
use super::roots::{first_root, solve_increasing};
use super::{Intrinsics, Pixel};
use crate::CameraError;

/// A fisheye after Kannala and Brandt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KannalaBrandt {
    intrinsics: Intrinsics,
    k: [f64; 4],
    max_angle_rad: f64,
    max_radius: f64,
}

impl KannalaBrandt {
    /// The lens with the coefficients `k`, which sees nothing farther than `max_angle_rad` from its axis (half its field
    /// of view; pi if unknown). The domain ends earlier where the polynomial stops rising.
    ///
    /// # Errors
    /// [`CameraError`] names the number that is out of its range.
    pub fn new(intrinsics: Intrinsics, k: [f64; 4], max_angle_rad: f64) -> Result<KannalaBrandt, CameraError> {
        intrinsics.validate()?;
        check_finite("distortion", &k)?;
        check_max_angle(max_angle_rad)?;
        // The slope of r is a polynomial in the square of the angle.
        let slope = [1.0 - MIN_SLOPE, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3]];
        let turns_back_at = first_root(&slope, 0.0, max_angle_rad * max_angle_rad).map(f64::sqrt);
        let max_angle_rad = turns_back_at.unwrap_or(max_angle_rad).min(max_angle_rad);
        Ok(KannalaBrandt { intrinsics, k, max_angle_rad, max_radius: radius(&k, max_angle_rad).0 })
    }

    /// See [`super::Camera::project`].
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Pixel> {
        let (right, down) = radial::place(point_in_camera, self.max_angle_rad, |angle| radius(&self.k, angle).0)?;
        self.intrinsics.pixel(right, down)
    }

    /// See [`super::Camera::unproject`].
    pub fn unproject(&self, pixel: Pixel) -> Option<Unit<Vector3<f64>>> {
        radial::direction(self.intrinsics.plane(pixel)?, self.max_radius, |r| {
            solve_increasing(|angle| radius(&self.k, angle), r, 0.0, self.max_angle_rad, r)
        })
    }

    /// Size, focal lengths and centre.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// The coefficients.
    pub fn k(&self) -> &[f64; 4] {
        &self.k
    }

    /// Where the domain ends, from the axis.
    pub fn max_angle_rad(&self) -> f64 {
        self.max_angle_rad
    }
}

/// r and its slope.
fn radius(k: &[f64; 4], angle: f64) -> (f64, f64) {
    let s = angle * angle;
    let r = angle * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
    (r, 1.0 + s * (3.0 * k[0] + s * (5.0 * k[1] + s * (7.0 * k[2] + s * 9.0 * k[3]))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Camera 0 of TUM-VI, 512 x 512.
    fn tum_vi(max_angle_rad: f64) -> KannalaBrandt {
        let intrinsics = Intrinsics {
            width_px: 512,
            height_px: 512,
            fx_px: 190.978477,
            fy_px: 190.973307,
            cx_px: 254.931706,
            cy_px: 256.897443,
        };
        KannalaBrandt::new(intrinsics, [0.00348239, 0.00071503, -0.00205324, 0.00020294], max_angle_rad).expect("sound")
    }

    #[test]
    fn forward_left_up_and_behind() {
        let camera = tum_vi(PI);
        let axis = camera.project(&Point3::new(2.0, 0.0, 0.0)).expect("on the axis");
        assert!((axis.u - 255.431706).abs() < 1e-9 && (axis.v - 257.397443).abs() < 1e-9);
        // One radian to the left: r = 1 + the sum of the coefficients.
        let left = camera.project(&Point3::new(1_f64.cos(), 1_f64.sin(), 0.0)).expect("inside");
        let r = 1.0 + 0.00348239 + 0.00071503 - 0.00205324 + 0.00020294;
        assert!((left.u - (255.431706 - 190.978477 * r)).abs() < 1e-9 && (left.v - axis.v).abs() < 1e-9);
        let up = camera.project(&Point3::new(1.0, 0.0, 1.0)).expect("inside");
        assert!(up.v < axis.v && (up.u - axis.u).abs() < 1e-9);
        assert_eq!(camera.project(&Point3::new(-1.0, 0.0, 0.0)), None);
        assert_eq!(camera.project(&Point3::origin()), None);
        assert_eq!(camera.project(&Point3::new(f64::NAN, 0.0, 1.0)), None);
        assert_eq!(tum_vi(0.5).project(&Point3::new(1_f64.cos(), 1_f64.sin(), 0.0)), None);
    }

    #[test]
    fn the_domain_ends_where_the_polynomial_turns_back() {
        let intrinsics =
            Intrinsics { width_px: 1000, height_px: 1000, fx_px: 300.0, fy_px: 300.0, cx_px: 499.5, cy_px: 499.5 };
        // r = angle - 0.2 angle^3 has slope 0.01 at angle^2 = 0.99/0.6.
        let camera = KannalaBrandt::new(intrinsics, [-0.2, 0.0, 0.0, 0.0], PI).expect("sound");
        assert!((camera.max_angle_rad() - (0.99_f64 / 0.6).sqrt()).abs() < 1e-12);
        // Beyond it the raw formula gives a place inside the image; the camera gives nothing.
        let beyond = Point3::new(FRAC_PI_2.cos(), FRAC_PI_2.sin(), 0.0);
        assert!(radius(camera.k(), FRAC_PI_2).0 < camera.max_radius);
        assert_eq!(camera.project(&beyond), None);
        assert_eq!(camera.unproject(Pixel { u: 500.0 + 300.0 * 1.2 * camera.max_radius, v: 500.0 }), None);
    }

    #[test]
    fn unsound_parameters_are_refused() {
        let intrinsics = *tum_vi(PI).intrinsics();
        let refused = KannalaBrandt::new(intrinsics, [0.0, f64::NAN, 0.0, 0.0], PI);
        assert!(matches!(refused, Err(CameraError::Parameter { name: "distortion", .. })));
        let refused = KannalaBrandt::new(intrinsics, [0.0; 4], 4.0);
        assert!(matches!(refused, Err(CameraError::Parameter { name: "max_angle_rad", .. })));
    }
}
