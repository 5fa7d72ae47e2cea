//! The linear part of a camera: from its normalised plane to pixels.

use crate::{CameraError, Pixel};

/// Image size, focal lengths and centre, as calibration tools write them: the centre of the first pixel is at 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Width of the image.
    pub width_px: u32,
    /// Height of the image.
    pub height_px: u32,
    /// Pixels per unit of the plane to the right.
    pub fx_px: f64,
    /// Pixels per unit of the plane downward.
    pub fy_px: f64,
    /// Column of the optical axis.
    pub cx_px: f64,
    /// Row of the optical axis.
    pub cy_px: f64,
}

impl Intrinsics {
    /// Checks the size (1 to 32768) and that focal lengths are positive and all numbers finite.
    ///
    /// # Errors
    /// [`CameraError`] names the number that is wrong.
    pub fn validate(&self) -> Result<(), CameraError> {
        check_size(self.width_px, self.height_px)?;
        for (name, value) in [("fx_px", self.fx_px), ("fy_px", self.fy_px)] {
            if !(value > 0.0 && value < 1e6) {
                return Err(CameraError::Parameter { name, value, accepts: "a positive number below 1e6" });
            }
        }
        // The axis may lie off the image (a cut-out), but not absurdly far.
        for (name, value) in [("cx_px", self.cx_px), ("cy_px", self.cy_px)] {
            if value.is_nan() || value.abs() >= 1e6 {
                return Err(CameraError::Parameter { name, value, accepts: "a number between -1e6 and 1e6" });
            }
        }
        Ok(())
    }

    /// The pixel of a place of the plane (right, down); `None` off the image.
    pub(super) fn pixel(&self, right: f64, down: f64) -> Option<Pixel> {
        let pixel = Pixel { u: self.fx_px * right + self.cx_px + 0.5, v: self.fy_px * down + self.cy_px + 0.5 };
        is_on_image(&pixel, self.width_px, self.height_px).then_some(pixel)
    }

    /// The place of the plane (right, down) of a pixel; `None` off the image.
    pub(super) fn plane(&self, pixel: Pixel) -> Option<(f64, f64)> {
        is_on_image(&pixel, self.width_px, self.height_px)
            .then(|| ((pixel.u - 0.5 - self.cx_px) / self.fx_px, (pixel.v - 0.5 - self.cy_px) / self.fy_px))
    }
}

/// Whether a position is on an image, its far edges included; not for NaN.
pub(super) fn is_on_image(pixel: &Pixel, width_px: u32, height_px: u32) -> bool {
    (0.0..=f64::from(width_px)).contains(&pixel.u) && (0.0..=f64::from(height_px)).contains(&pixel.v)
}

pub(super) fn check_size(width_px: u32, height_px: u32) -> Result<(), CameraError> {
    if (1..=32768).contains(&width_px) && (1..=32768).contains(&height_px) {
        return Ok(());
    }
    Err(CameraError::Size { width_px, height_px })
}

/// Checks an angle from the axis beyond which a lens shows nothing.
pub(super) fn check_max_angle(value: f64) -> Result<(), CameraError> {
    if value > 0.0 && value <= std::f64::consts::PI {
        return Ok(());
    }
    Err(CameraError::Parameter { name: "max_angle_rad", value, accepts: "an angle in (0, pi]" })
}

/// Checks that all numbers of a list are finite.
pub(super) fn check_finite(name: &'static str, values: &[f64]) -> Result<(), CameraError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(CameraError::Parameter { name, value, accepts: "finite numbers" }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: Intrinsics = Intrinsics { width_px: 4, height_px: 2, fx_px: 2.0, fy_px: 1.0, cx_px: 1.5, cy_px: 0.5 };

    #[test]
    fn the_first_pixel_has_its_centre_at_zero_for_the_tools_and_at_one_half_here() {
        // The axis of a calibrated 4 x 2 image is between its middle pixels: (1.5, 0.5) there, (2, 1) here.
        assert_eq!(SMALL.pixel(0.0, 0.0), Some(Pixel { u: 2.0, v: 1.0 }));
        assert_eq!(SMALL.pixel(0.5, 0.5), Some(Pixel { u: 3.0, v: 1.5 }));
        assert_eq!(SMALL.plane(Pixel { u: 3.0, v: 1.5 }), Some((0.5, 0.5)));
        assert_eq!(SMALL.pixel(2.0, 0.0), None);
        assert_eq!(SMALL.plane(Pixel { u: -0.1, v: 1.0 }), None);
        assert_eq!(SMALL.plane(Pixel { u: f64::NAN, v: 1.0 }), None);
    }

    #[test]
    fn unsound_numbers_are_refused() {
        assert_eq!(SMALL.validate(), Ok(()));
        assert!(matches!(Intrinsics { width_px: 0, ..SMALL }.validate(), Err(CameraError::Size { .. })));
        for bad in [f64::NAN, 0.0, -3.0, f64::INFINITY] {
            let refused = Intrinsics { fy_px: bad, ..SMALL }.validate();
            assert!(matches!(refused, Err(CameraError::Parameter { name: "fy_px", .. })));
        }
        let refused = Intrinsics { cx_px: f64::NAN, ..SMALL }.validate();
        assert!(matches!(refused, Err(CameraError::Parameter { name: "cx_px", .. })));
    }
}
