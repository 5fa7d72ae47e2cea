//! The panorama's camera model: directions to pixels of an equirectangular image and back.
//!
//! ```text
//! theta = atan2(y, x), phi = atan2(z, hypot(x, y))                         OmniVLN Eq. 2
//! u = W/2 (1 - theta/pi), v = H (phi_top - phi) / (phi_top - phi_bottom)   OmniVLN Eq. 3
//! ```
//! in the camera frame (x forward, y left, z up) at the time of the image. Pixel centres are at +0.5; u wraps behind
//! the camera.

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use nalgebra::{Point3, Unit, Vector3};
use thiserror::Error;

/// An equirectangular camera.
///
/// Departures from the paper: its u grows with theta, which mirrors the picture (see [`pixel_as_printed`]); its v
/// spans 180 degrees, which would squash the pixels of a 3:1 image; its asin of z/|P| can leave its domain by rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equirectangular {
    /// W, the full turn.
    pub width_px: u32,
    /// H.
    pub height_px: u32,
    /// Elevation of the upper edge of the image.
    pub phi_top_rad: f64,
    /// Elevation of the lower edge of the image.
    pub phi_bottom_rad: f64,
}

/// A position in the image; the pixel is (floor(u), floor(v)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// To the right, in [0, W).
    pub u: f64,
    /// Down, in [0, H).
    pub v: f64,
}

/// Why a camera was refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum CameraError {
    /// Width or height is zero or above 32768.
    #[error("an image of {width_px} x {height_px} pixels")]
    Size {
        /// Width given.
        width_px: u32,
        /// Height given.
        height_px: u32,
    },
    /// The elevations are not -pi/2 <= bottom < top <= pi/2.
    #[error("elevations from {phi_bottom_rad} to {phi_top_rad} rad")]
    Elevations {
        /// Lower edge given.
        phi_bottom_rad: f64,
        /// Upper edge given.
        phi_top_rad: f64,
    },
    /// A number of a lens is out of its range.
    #[error("{name} = {value}: must be {accepts}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The range in words.
        accepts: &'static str,
    },
}

impl Default for Equirectangular {
    /// 1920 x 640 with square pixels: 60 degrees up and down.
    fn default() -> Self {
        Equirectangular { width_px: 1920, height_px: 640, phi_top_rad: FRAC_PI_3, phi_bottom_rad: -FRAC_PI_3 }
    }
}

impl Equirectangular {
    /// Checks size and elevations.
    ///
    /// # Errors
    /// [`CameraError`] names the value that is wrong.
    pub fn validate(&self) -> Result<(), CameraError> {
        let (width_px, height_px) = (self.width_px, self.height_px);
        if !(1..=32768).contains(&width_px) || !(1..=32768).contains(&height_px) {
            return Err(CameraError::Size { width_px, height_px });
        }
        let (phi_bottom_rad, phi_top_rad) = (self.phi_bottom_rad, self.phi_top_rad);
        let half = 0.5 * PI + 1e-12; // a right angle computed in another way
        if !(-half <= phi_bottom_rad && phi_bottom_rad < phi_top_rad && phi_top_rad <= half) {
            return Err(CameraError::Elevations { phi_bottom_rad, phi_top_rad });
        }
        Ok(())
    }

    /// The pixel that sees a point of the camera frame; `None` above or below the image, at the origin, or for NaN.
    ///
    /// Straight up and down have no theta; the middle column stands for them.
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Pixel> {
        let (x, y, z) = (point_in_camera.x, point_in_camera.y, point_in_camera.z);
        let norm = point_in_camera.coords.norm();
        if !(norm > 0.0 && norm.is_finite()) {
            return None;
        }
        // OmniVLN Eq. 2
        let theta = if x == 0.0 && y == 0.0 { 0.0 } else { y.atan2(x) };
        let phi = z.atan2(x.hypot(y));
        // OmniVLN Eq. 3
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        let u = 0.5 * width * (1.0 - theta / PI);
        let v = height * (self.phi_top_rad - phi) / (self.phi_top_rad - self.phi_bottom_rad);
        let is_inside = (0.0..height).contains(&v);
        is_inside.then_some(Pixel { u: if u >= width { u - width } else { u }, v })
    }

    /// The direction that a pixel sees. Any u (wraps) and v.
    pub fn unproject(&self, u: f64, v: f64) -> Unit<Vector3<f64>> {
        let theta = PI * (1.0 - 2.0 * u / f64::from(self.width_px));
        let span = self.phi_top_rad - self.phi_bottom_rad;
        let phi = self.phi_top_rad - span * v / f64::from(self.height_px);
        let direction = Vector3::new(phi.cos() * theta.cos(), phi.cos() * theta.sin(), phi.sin());
        Unit::new_normalize(direction)
    }

    /// Angle between neighbouring columns at the horizon.
    pub fn column_angle_rad(&self) -> f64 {
        TAU / f64::from(self.width_px)
    }

    /// Angle between neighbouring rows.
    pub fn row_angle_rad(&self) -> f64 {
        (self.phi_top_rad - self.phi_bottom_rad) / f64::from(self.height_px)
    }
}

/// OmniVLN Eq. 2 and 3 exactly as printed: mirrored, 180 degrees high. For data made that way.
///
/// u in [0, W], v in [0, H]; `None` for the origin or NaN.
pub fn pixel_as_printed(point_in_camera: &Point3<f64>, width_px: u32, height_px: u32) -> Option<Pixel> {
    let norm = point_in_camera.coords.norm();
    if !(norm > 0.0 && norm.is_finite()) {
        return None;
    }
    let theta = point_in_camera.y.atan2(point_in_camera.x);
    let phi = (point_in_camera.z / norm).clamp(-1.0, 1.0).asin();
    let u = 0.5 * f64::from(width_px) * (1.0 + theta / PI);
    let v = 0.5 * f64::from(height_px) * (1.0 - phi / (0.5 * PI));
    Some(Pixel { u, v })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(point: [f64; 3], expected: Option<(f64, f64)>) {
        let pixel = Equirectangular::default().project(&Point3::from(point));
        match (pixel, expected) {
            (Some(pixel), Some((u, v))) => {
                assert!((pixel.u - u).abs() < 1e-9 && (pixel.v - v).abs() < 1e-9, "{pixel:?}");
            }
            (pixel, expected) => {
                assert_eq!(pixel.is_some(), expected.is_some(), "{point:?} {pixel:?}")
            }
        }
    }

    #[test]
    fn eq_2_and_3_forward_left_right_behind() {
        check([2.0, 0.0, 0.0], Some((960.0, 320.0)));
        check([0.0, 2.0, 0.0], Some((480.0, 320.0))); // left of the body is left in the picture
        check([0.0, -2.0, 0.0], Some((1440.0, 320.0)));
        check([-2.0, 0.0, 0.0], Some((0.0, 320.0)));
        check([-2.0, -0.0, 0.0], Some((0.0, 320.0))); // theta = -pi: u = W wraps to 0
        check([1.0, 0.0, 1.0], Some((960.0, 80.0))); // 45 of 60 degrees up
        check([1.0, 0.0, 2.0], None);
        check([0.0, 0.0, 0.0], None);
        check([f64::NAN, 0.0, 1.0], None);
    }

    #[test]
    fn the_printed_form_is_the_mirror_image() {
        let whole = Equirectangular { phi_top_rad: 0.5 * PI, phi_bottom_rad: -0.5 * PI, ..Default::default() };
        let point = Point3::new(1.0, 2.0, 0.5);
        let (ours, printed) =
            (whole.project(&point).expect("inside"), pixel_as_printed(&point, 1920, 640).expect("inside"));
        assert!((ours.u + printed.u - 1920.0).abs() < 1e-9);
        assert!((ours.v - printed.v).abs() < 1e-9);
        let up = whole.project(&Point3::new(0.0, 0.0, 1.0)).expect("inside");
        assert_eq!((up.u, up.v), (960.0, 0.0));
    }

    #[test]
    fn unsound_cameras_are_refused() {
        assert_eq!(Equirectangular::default().validate(), Ok(()));
        let zero = Equirectangular { width_px: 0, ..Default::default() };
        assert!(matches!(zero.validate(), Err(CameraError::Size { .. })));
        let upside_down = Equirectangular { phi_top_rad: -2.0, ..Default::default() };
        assert!(matches!(upside_down.validate(), Err(CameraError::Elevations { .. })));
    }
}
