//! Scaramuzza's model of fisheyes and mirrors (the OCamCalib toolbox): a polynomial in the distance from the centre.
//!
//! ```text
//! (row, column) = A (x', y') + centre,  A = [[c, d], [e, 1]]
//! ray = (x', y', a0 + a1 r + a2 r^2 + ...),  r = |(x', y')|
//! ```
//! In the toolbox's frame x' goes down the rows, y' along the columns, and so z points *away* from the scene: a0 is
//! negative. Here the sign is normalised, `ahead(r) = -sign(a0) (a0 + a1 r + ...)` turned so that the axis looks forward,
//! and the angle from the axis is `atan2(r, ahead(r))`.
//!
//! The toolbox's inverse polynomial is a fit that misses by up to a pixel; it only starts the search here.
//!
//! D. Scaramuzza, A. Martinelli, R. Siegwart, "A Toolbox for Easily Calibrating Omnidirectional Cameras", IROS 2006.

use nalgebra::{Point3, Unit, Vector3};

use super::Pixel;
use super::intrinsics::{check_finite, check_max_angle, check_size, is_on_image};
use super::radial::{self, MIN_SLOPE};
use super::roots::{evaluate, first_root, solve_increasing};
use crate::CameraError;

/// The numbers of a calibration, as its text file has them ([`super::parse_ocam_text`]).
#[derive(Debug, Clone, PartialEq)]
pub struct OcamCalibration {
    /// Width of the image.
    pub width_px: u32,
    /// Height of the image.
    pub height_px: u32,
    /// a0, a1, ...: from the radius in pixels to the third coordinate of the ray (`ocam_model.ss`).
    pub polynomial: Vec<f64>,
    /// b0, b1, ...: from the angle above the image plane to the radius (`ocam_model.invpol`); may be empty.
    pub inverse_polynomial: Vec<f64>,
    /// Row and column of the centre, the first pixel's centre at 0.
    pub centre_row_column_px: [f64; 2],
    /// c, d, e of the affine map.
    pub affine: [f64; 3],
}

/// A fisheye or mirror after Scaramuzza.
#[derive(Debug, Clone, PartialEq)]
pub struct Ocam {
    calibration: OcamCalibration,
    /// Coefficients of `ahead(r)`.
    ahead: Vec<f64>,
    max_angle_rad: f64,
    max_radius_px: f64,
}

impl Ocam {
    /// The camera of a calibration, which sees nothing farther than `max_angle_rad` from its axis (half its field of view;
    /// pi if unknown). The domain ends earlier at the farthest corner of the image, or where the angle stops rising.
    ///
    /// # Errors
    /// [`CameraError`] names the number that is out of its range.
    pub fn new(calibration: OcamCalibration, max_angle_rad: f64) -> Result<Ocam, CameraError> {
        check_size(calibration.width_px, calibration.height_px)?;
        check_finite("polynomial", &calibration.polynomial)?;
        check_finite("inverse polynomial", &calibration.inverse_polynomial)?;
        check_finite("centre", &calibration.centre_row_column_px)?;
        check_finite("affine parameters", &calibration.affine)?;
        check_max_angle(max_angle_rad)?;
        let a0 = calibration.polynomial.first().copied().unwrap_or(0.0);
        if a0 == 0.0 {
            return Err(CameraError::Parameter { name: "a0", value: a0, accepts: "a number that is not zero" });
        }
        let [c, d, e] = calibration.affine;
        // A shear or a stretch of a sensor is a few thousandths; half is no calibration of anything.
        if !((0.5..2.0).contains(&c) && d.abs() < 0.5 && e.abs() < 0.5) {
            let accepts = "c between 0.5 and 2, d and e between -0.5 and 0.5";
            return Err(CameraError::Parameter { name: "affine parameters", value: c - d * e, accepts });
        }
        let ahead: Vec<f64> = calibration.polynomial.iter().map(|a| a * a0.signum()).collect();
        // d angle/dr = (ahead - r ahead')/(r^2 + ahead^2): its numerator is a polynomial.
        let mut rising: Vec<f64> = ahead.iter().enumerate().map(|(i, a)| a * (1.0 - i as f64)).collect();
        rising[0] -= MIN_SLOPE * ahead[0];
        let corner_px = corner_radius(&calibration);
        let rises_to_px = first_root(&rising, 0.0, corner_px).unwrap_or(corner_px);
        let end_rad = angle(&ahead, rises_to_px).0;
        let mut camera = Ocam { calibration, ahead, max_angle_rad: end_rad, max_radius_px: rises_to_px };
        if max_angle_rad < end_rad {
            camera.max_radius_px = camera.radius(max_angle_rad);
            camera.max_angle_rad = max_angle_rad;
        }
        Ok(camera)
    }

    /// See [`super::Camera::project`].
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Pixel> {
        let (right, down) = radial::place(point_in_camera, self.max_angle_rad, |angle| self.radius(angle))?;
        let (pixel, [row_centre, column_centre]) = (&self.calibration, self.calibration.centre_row_column_px);
        let [c, d, e] = pixel.affine;
        let (row, column) = (c * down + d * right + row_centre, e * down + right + column_centre);
        let pixel = Pixel { u: column + 0.5, v: row + 0.5 };
        is_on_image(&pixel, self.calibration.width_px, self.calibration.height_px).then_some(pixel)
    }

    /// See [`super::Camera::unproject`].
    pub fn unproject(&self, pixel: Pixel) -> Option<Unit<Vector3<f64>>> {
        if !is_on_image(&pixel, self.calibration.width_px, self.calibration.height_px) {
            return None;
        }
        radial::direction(plane(&self.calibration, pixel), self.max_radius_px, |r| angle(&self.ahead, r).0)
    }

    /// The numbers it was made of.
    pub fn calibration(&self) -> &OcamCalibration {
        &self.calibration
    }

    /// Where the domain ends, from the axis.
    pub fn max_angle_rad(&self) -> f64 {
        self.max_angle_rad
    }

    /// The radius at an angle inside the domain.
    fn radius(&self, wanted_rad: f64) -> f64 {
        let above_plane = wanted_rad - std::f64::consts::FRAC_PI_2; // the toolbox's theta
        let guess = evaluate(&self.calibration.inverse_polynomial, above_plane).0;
        solve_increasing(|r| angle(&self.ahead, r), wanted_rad, 0.0, self.max_radius_px, guess)
    }
}

/// The angle from the axis at a radius, and its slope.
fn angle(ahead: &[f64], r: f64) -> (f64, f64) {
    let (g, g_slope) = evaluate(ahead, r);
    (r.atan2(g), (g - r * g_slope) / (r * r + g * g))
}

/// The place (right, down) of a pixel on the plane of (y', x').
fn plane(calibration: &OcamCalibration, pixel: Pixel) -> (f64, f64) {
    let [row_centre, column_centre] = calibration.centre_row_column_px;
    let [c, d, e] = calibration.affine;
    let (row, column) = (pixel.v - 0.5 - row_centre, pixel.u - 0.5 - column_centre);
    // The inverse of [[c, d], [e, 1]].
    let det = c - d * e;
    let (down, right) = ((row - d * column) / det, (c * column - e * row) / det);
    (right, down)
}

fn corner_radius(calibration: &OcamCalibration) -> f64 {
    let (width, height) = (f64::from(calibration.width_px), f64::from(calibration.height_px));
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
    let radius = |(u, v)| {
        let (right, down) = plane(calibration, Pixel { u, v });
        right.hypot(down)
    };
    corners.into_iter().map(radius).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    /// ahead = 100 - r^2/400: at r = 200 the ray is level, at 100 it looks 75 ahead.
    fn bowl() -> OcamCalibration {
        OcamCalibration {
            width_px: 500,
            height_px: 400,
            polynomial: vec![-100.0, 0.0, 1.0 / 400.0],
            inverse_polynomial: Vec::new(),
            centre_row_column_px: [199.5, 249.5],
            affine: [1.0, 0.0, 0.0],
        }
    }

    #[test]
    fn rows_go_down_and_columns_right() {
        let camera = Ocam::new(bowl(), PI).expect("sound");
        let axis = camera.project(&Point3::new(1.0, 0.0, 0.0)).expect("on the axis");
        assert_eq!((axis.u, axis.v), (250.0, 200.0));
        let right = camera.project(&Point3::new(75.0, -100.0, 0.0)).expect("inside");
        assert!((right.u - 350.0).abs() < 1e-9 && (right.v - 200.0).abs() < 1e-9, "{right:?}");
        let below = camera.project(&Point3::new(75.0, 0.0, -100.0)).expect("inside");
        assert!((below.u - 250.0).abs() < 1e-9 && (below.v - 300.0).abs() < 1e-9, "{below:?}");
        let level = camera.unproject(Pixel { u: 50.0, v: 200.0 }).expect("inside");
        assert!((level.into_inner() - Vector3::y()).norm() < 1e-12, "left of the camera");
    }

    #[test]
    fn a_positive_a0_means_the_same_lens() {
        let turned = OcamCalibration { polynomial: vec![100.0, 0.0, -1.0 / 400.0], ..bowl() };
        let (a, b) = (Ocam::new(bowl(), PI).expect("sound"), Ocam::new(turned, PI).expect("sound"));
        let point = Point3::new(1.0, 2.0, -0.5);
        assert_eq!(a.project(&point), b.project(&point));
    }

    #[test]
    fn the_affine_map_is_undone() {
        let sheared = OcamCalibration { affine: [1.01, 0.02, -0.03], ..bowl() };
        let camera = Ocam::new(sheared.clone(), PI).expect("sound");
        let pixel = Pixel { u: 300.0, v: 150.0 };
        let (right, down) = plane(&sheared, pixel);
        assert!((1.01 * down + 0.02 * right + 200.0 - 150.0).abs() < 1e-12);
        assert!((-0.03 * down + right + 250.0 - 300.0).abs() < 1e-12);
        let back =
            camera.project(&Point3::from(camera.unproject(pixel).expect("inside").into_inner())).expect("inside");
        assert!((back.u - 300.0).abs() < 1e-10 && (back.v - 150.0).abs() < 1e-10);
    }

    #[test]
    fn the_domain_ends_at_the_corner_or_the_wanted_angle_or_where_the_angle_turns_back() {
        let camera = Ocam::new(bowl(), PI).expect("sound");
        let corner = 250_f64.hypot(200.0);
        assert!((camera.max_angle_rad() - corner.atan2(100.0 - corner * corner / 400.0)).abs() < 1e-12);
        let narrow = Ocam::new(bowl(), FRAC_PI_4).expect("sound");
        assert_eq!(narrow.max_angle_rad(), FRAC_PI_4);
        assert_eq!(narrow.project(&Point3::new(75.0, -100.0, 0.0)), None);
        assert_eq!(narrow.unproject(Pixel { u: 350.0, v: 200.0 }), None);
        // ahead = 100 + r^2/400 turns back at r = 200: the angle there is the largest.
        let folding = OcamCalibration { polynomial: vec![-100.0, 0.0, -1.0 / 400.0], ..bowl() };
        let folding = Ocam::new(folding, PI).expect("sound");
        assert!(folding.max_radius_px < 200.0 && folding.max_radius_px > 198.0, "{}", folding.max_radius_px);
        assert!(folding.max_angle_rad() < FRAC_PI_2);
    }

    #[test]
    fn unsound_parameters_are_refused() {
        for polynomial in [vec![], vec![0.0, 1.0], vec![f64::NAN]] {
            assert!(Ocam::new(OcamCalibration { polynomial, ..bowl() }, PI).is_err());
        }
        let squashed = OcamCalibration { affine: [0.0, 0.0, 0.0], ..bowl() };
        assert!(matches!(Ocam::new(squashed, PI), Err(CameraError::Parameter { name: "affine parameters", .. })));
    }
}
