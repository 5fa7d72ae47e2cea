//! Laws of the camera models: there and back within 1e-9 rad, nothing outside the domain; a real calibration.

use nalgebra::{Point3, Vector3};
use omni_perception::camera::{DoubleSphere, KannalaBrandt, Ocam, OcamCalibration, PinholeRadtan, parse_ocam_text};
use omni_perception::*;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// What the issue asks for.
const ROUND_TRIP_TOL_RAD: f64 = 1e-9;
/// Coordinates up to a few thousand pixels in double precision, times the steepest slope of a curve.
const PIXEL_TOL: f64 = 1e-7;

fn intrinsics() -> impl Strategy<Value = Intrinsics> {
    (200..3000_u32, 200..3000_u32, 80.0..2000.0_f64, 0.9..1.1_f64, 0.3..0.7_f64, 0.3..0.7_f64).prop_map(
        |(width_px, height_px, fx_px, ratio, cx, cy)| Intrinsics {
            width_px,
            height_px,
            fx_px,
            fy_px: fx_px * ratio,
            cx_px: cx * f64::from(width_px),
            cy_px: cy * f64::from(height_px),
        },
    )
}

fn max_angle() -> impl Strategy<Value = f64> {
    prop_oneof![Just(PI), 0.3..PI]
}

fn kannala_brandt() -> impl Strategy<Value = Camera> {
    let k = (-0.1..0.1_f64, -0.03..0.03_f64, -0.01..0.01_f64, -0.002..0.002_f64);
    (intrinsics(), k, max_angle()).prop_map(|(intrinsics, (a, b, c, d), end)| {
        Camera::KannalaBrandt(KannalaBrandt::new(intrinsics, [a, b, c, d], end).expect("sound"))
    })
}

fn double_sphere() -> impl Strategy<Value = Camera> {
    let alpha = prop_oneof![0.0..=1.0_f64, Just(0.5), Just(0.0), Just(1.0)];
    (intrinsics(), -0.9..=1.0_f64, alpha, max_angle()).prop_map(|(intrinsics, xi, alpha, end)| {
        Camera::DoubleSphere(DoubleSphere::new(intrinsics, xi, alpha, end).expect("sound"))
    })
}

/// Bowls and nearly flat ones, with a bad inverse polynomial half the time: it must not matter.
fn ocam() -> impl Strategy<Value = Camera> {
    let shape = (150.0..800.0_f64, -0.1..1.2_f64, -0.3..0.3_f64, -0.3..0.6_f64);
    let affine = (0.98..1.02_f64, -0.02..0.02_f64, -0.02..0.02_f64);
    let inverse = prop_oneof![Just(Vec::new()), prop::collection::vec(-1e3..1e3_f64, 1..9)];
    (shape, affine, inverse, 0.4..0.6_f64, max_angle()).prop_map(
        |((a0, a2, a3, a4), (c, d, e), inverse, centre, end)| {
            let calibration = OcamCalibration {
                width_px: 1024,
                height_px: 768,
                polynomial: vec![-a0, 0.0, a2 / a0, a3 / (a0 * a0), a4 / (a0 * a0 * a0)],
                inverse_polynomial: inverse,
                centre_row_column_px: [768.0 * centre, 1024.0 * (1.0 - centre)],
                affine: [c, d, e],
            };
            Camera::Ocam(Ocam::new(calibration, end).expect("sound"))
        },
    )
}

fn pinhole_radtan() -> impl Strategy<Value = Camera> {
    let distortion = (-0.4..0.4_f64, -0.2..0.2_f64, -0.005..0.005_f64, -0.005..0.005_f64, -0.05..0.05_f64);
    (intrinsics(), distortion, max_angle()).prop_map(|(intrinsics, (k1, k2, p1, p2, k3), end)| {
        Camera::PinholeRadtan(PinholeRadtan::new(intrinsics, [k1, k2, p1, p2, k3], end).expect("sound"))
    })
}

fn camera() -> impl Strategy<Value = Camera> {
    let panorama = (-FRAC_PI_2..-0.1_f64, 0.1..FRAC_PI_2).prop_map(|(phi_bottom_rad, phi_top_rad)| {
        Camera::Equirectangular(Equirectangular { phi_bottom_rad, phi_top_rad, ..Equirectangular::default() })
    });
    prop_oneof![kannala_brandt(), double_sphere(), ocam(), pinhole_radtan(), panorama]
}

/// Directions in all octants, many of them near the axis, level with the lens, straight behind, and at the lens's edge.
fn direction() -> impl Strategy<Value = (f64, f64)> {
    let angle = prop_oneof![
        4 => 0.0..PI,
        1 => -16.0..-1.0_f64, // 10^x: near the axis
        1 => Just(0.0),
        1 => Just(FRAC_PI_2),
        1 => Just(PI),
        2 => 10.0..11.0_f64, // this share of the lens's largest angle
    ];
    (angle, -PI..=PI)
}

fn point(camera: &Camera, (angle, azimuth): (f64, f64), range: f64) -> Point3<f64> {
    let angle = match angle {
        share if share >= 10.0 => (share - 10.0) * camera.domain().max_angle_rad,
        exponent if exponent < 0.0 => 10_f64.powf(exponent),
        angle => angle,
    };
    Point3::new(angle.cos(), angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin()) * range
}

/// Angle between two vectors without the loss of acos near zero.
fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]

    #[test]
    fn unproject_undoes_project(camera in camera(), direction in direction(), range in 1e-3..1e3_f64) {
        let point = point(&camera, direction, range);
        if let Some(pixel) = camera.project(&point) {
            let back = camera.unproject(pixel);
            prop_assert!(back.is_some(), "{point} went to {pixel:?}, and nothing comes back");
            let error = angle_between(&back.expect("checked"), &point.coords);
            prop_assert!(error < ROUND_TRIP_TOL_RAD, "{error:e} rad at {point}, {pixel:?}");
        }
    }

    #[test]
    fn project_undoes_unproject(camera in camera(), u in 0.0..1.0_f64, v in 0.0..1.0_f64) {
        let domain = camera.domain();
        let pixel = Pixel { u: u * f64::from(domain.width_px), v: v * f64::from(domain.height_px) };
        if let Some(direction) = camera.unproject(pixel) {
            // At the very edge of the lens rounding decides.
            if let Some(back) = camera.project(&Point3::from(direction.into_inner() * 3.0)) {
                let across = (back.u - pixel.u).abs();
                let across = across.min((f64::from(domain.width_px) - across).abs());
                let (tolerance, down) = (PIXEL_TOL * f64::from(domain.width_px), (back.v - pixel.v).abs());
                // The panorama's columns run together at its poles.
                let flat = direction.x.hypot(direction.y);
                prop_assert!(across * flat < tolerance && down < tolerance, "{pixel:?} {back:?}");
            } else {
                let angle = angle_between(&direction, &Vector3::x());
                prop_assert!(angle > domain.max_angle_rad - 1e-6 || u < 1e-9 || v < 1e-9 || u > 1.0 - 1e-9 || v > 1.0 - 1e-9);
            }
        }
    }

    #[test]
    fn outside_the_domain_there_is_no_pixel(camera in camera(), direction in direction(), range in 1e-3..1e3_f64) {
        let point = point(&camera, direction, range);
        let domain = camera.domain();
        match camera.project(&point) {
            Some(pixel) => {
                prop_assert!((0.0..=f64::from(domain.width_px)).contains(&pixel.u));
                prop_assert!((0.0..=f64::from(domain.height_px)).contains(&pixel.v));
                prop_assert!(angle_between(&point.coords, &Vector3::x()) <= domain.max_angle_rad + 1e-12);
            }
            None => prop_assert!(true),
        }
        if angle_between(&point.coords, &Vector3::x()) > domain.max_angle_rad + 1e-12 {
            prop_assert_eq!(camera.project(&point), None);
        }
    }

    #[test]
    fn the_range_does_not_matter(camera in camera(), direction in direction(), range in 1e-3..1e3_f64) {
        let (near, far) = (point(&camera, direction, 1.0), point(&camera, direction, range));
        if let (Some(a), Some(b)) = (camera.project(&near), camera.project(&far)) {
            let width = f64::from(camera.domain().width_px);
            let across = (a.u - b.u).abs();
            let is_pole = near.x.hypot(near.y) < 1e-9; // of a panorama
            prop_assert!((across.min((width - across).abs()) < 1e-4 || is_pole) && (a.v - b.v).abs() < 1e-4, "{a:?} {b:?}");
        }
    }

    #[test]
    fn nothing_comes_of_nothing(camera in camera(), x in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1e300)]) {
        prop_assert_eq!(camera.project(&Point3::origin()), None);
        for point in [Point3::new(x, 1.0, 1.0), Point3::new(1.0, x, 1.0), Point3::new(1.0, 1.0, -x)] {
            prop_assert_eq!(camera.project(&point), None);
        }
        for pixel in [Pixel { u: f64::NAN, v: 1.0 }, Pixel { u: 1.0, v: f64::NAN }, Pixel { u: -1.0, v: 1.0 }, Pixel { u: 1.0, v: x }] {
            prop_assert_eq!(camera.unproject(pixel), None);
        }
    }

    /// A lens of one model is drawn by another one: an equidistant fisheye is both a Kannala-Brandt lens without
    /// coefficients and, at small angles, every other model.
    #[test]
    fn all_models_agree_near_the_axis(angle in 0.0..1e-3_f64, azimuth in -PI..PI) {
        let intrinsics =
            Intrinsics { width_px: 1000, height_px: 1000, fx_px: 400.0, fy_px: 400.0, cx_px: 499.5, cy_px: 499.5 };
        let calibration = OcamCalibration {
            width_px: 1000,
            height_px: 1000,
            polynomial: vec![-400.0],
            inverse_polynomial: vec![],
            centre_row_column_px: [499.5, 499.5],
            affine: [1.0, 0.0, 0.0],
        };
        // At the centre the double sphere's slope is 1/(1 + xi).
        let wide = Intrinsics { fx_px: 480.0, fy_px: 480.0, ..intrinsics };
        let cameras = [
            Camera::KannalaBrandt(KannalaBrandt::new(intrinsics, [0.0; 4], PI).expect("sound")),
            Camera::DoubleSphere(DoubleSphere::new(wide, 0.2, 0.6, PI).expect("sound")),
            Camera::Ocam(Ocam::new(calibration, PI).expect("sound")),
            Camera::PinholeRadtan(PinholeRadtan::new(intrinsics, [0.0; 5], PI).expect("sound")),
        ];
        let point = Point3::new(angle.cos(), angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin());
        let expected = (500.0 - 400.0 * point.y, 500.0 - 400.0 * point.z);
        for camera in cameras {
            let pixel = camera.project(&point).expect("near the axis");
            // The models differ from the third power of the angle on.
            let tolerance = 400.0 * angle.powi(3) + 1e-9;
            prop_assert!((pixel.u - expected.0).abs() < tolerance && (pixel.v - expected.1).abs() < tolerance, "{camera:?}");
        }
    }

    #[test]
    fn no_text_makes_the_calibration_parser_panic(text in "[0-9eE.+\\-# \n]{0,200}") {
        if let Ok(calibration) = parse_ocam_text(&text) {
            let _ = Ocam::new(calibration, PI);
        }
    }
}

/// The calibration that ships with the OCamCalib toolbox. Other people's data: not in the repository.
#[test]
fn a_real_calibration_loads_and_agrees_with_its_own_inverse() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/lidar/fisheye/ocam_calib_results.txt");
    let Ok(text) = std::fs::read_to_string(path) else {
        println!("skipped: {path} is not here");
        return;
    };
    let calibration = parse_ocam_text(&text).expect("a real file");
    assert_eq!((calibration.width_px, calibration.height_px), (1024, 768));
    assert_eq!((calibration.polynomial.len(), calibration.inverse_polynomial.len()), (5, 8));
    let inverse = calibration.inverse_polynomial.clone();
    let [row_centre, column_centre] = calibration.centre_row_column_px;
    let camera = Camera::Ocam(Ocam::new(calibration, PI).expect("a real lens"));
    // The farthest corner of the picture is 640 pixels from the centre: there the polynomial says 75.9 degrees.
    let domain_deg = camera.domain().max_angle_rad.to_degrees();
    assert!((domain_deg - 75.9).abs() < 0.1, "{domain_deg}");
    let mut worst_px = 0.0_f64;
    for degrees in 1..=90 {
        let angle = f64::from(degrees).to_radians();
        let point = Point3::new(angle.cos(), -angle.sin(), 0.0); // to the right
        let Some(pixel) = camera.project(&point) else { continue };
        // The toolbox's own world2cam: theta from the image plane, radius by the inverse polynomial.
        let theta = angle - FRAC_PI_2;
        let radius = inverse.iter().rev().fold(0.0, |sum, b| sum * theta + b);
        worst_px = worst_px.max((pixel.u - 0.5 - (column_centre + radius)).abs());
        assert!((pixel.v - 0.5 - row_centre).abs() < 1e-9);
        let back = camera.unproject(pixel).expect("inside");
        assert!(angle_between(&back, &point.coords) < ROUND_TRIP_TOL_RAD);
    }
    assert!(worst_px < 1.0, "the inverse polynomial is {worst_px} px off"); // it is a fit, good to a pixel
    assert!(worst_px > 0.0);
}
