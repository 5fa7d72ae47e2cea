//! Cameras: directions to pixels and back, for the lenses that robots carry.
//!
//! | model | file | parameters as written by |
//! | --- | --- | --- |
//! | [`Equirectangular`] | `equirectangular.rs` | the paper's panorama (Eq. 2, 3) |
//! | [`KannalaBrandt`] | `camera/kannala_brandt.rs` | OpenCV `fisheye`, Kalibr `pinhole-equi` |
//! | [`DoubleSphere`] | `camera/double_sphere.rs` | Basalt, Kalibr `ds` |
//! | [`Ocam`] | `camera/ocam.rs` | OCamCalib text files (Scaramuzza) |
//! | [`PinholeRadtan`] | `camera/pinhole_radtan.rs` | OpenCV, Kalibr `pinhole-radtan` |
//!
//! All share one camera frame, that of a body: x forward (along the optical axis), y left, z up. The optical frame of
//! the calibration tools (x right, y down, z forward) lives inside the models only; [`camera_from_optical`] converts a
//! calibrated pose. [`Pixel`]s have their centres at +0.5; calibration tools put the centre of the first pixel at 0, and
//! the half pixel is added inside, so the parameters go in as the tools write them.
//!
//! A model that leaves its domain returns `None`: behind the lens, beyond the angle at which its curve turns back, off
//! the image. Inside, `unproject(project(P))` is the direction of P within 1e-9 rad (`tests/cameras.rs`).

use nalgebra::{Matrix3, Point3, Rotation3, Unit, UnitQuaternion, Vector3};

use crate::{Equirectangular, Pixel};

pub mod double_sphere;
pub mod intrinsics;
pub mod kannala_brandt;
pub mod ocam;
pub mod ocam_text;
pub mod pinhole_radtan;
mod radial;
mod roots;

pub use double_sphere::DoubleSphere;
pub use intrinsics::Intrinsics;
pub use kannala_brandt::KannalaBrandt;
pub use ocam::{Ocam, OcamCalibration};
pub use ocam_text::{OcamTextError, parse_ocam_text};
pub use pinhole_radtan::PinholeRadtan;

/// A calibrated camera.
#[derive(Debug, Clone, PartialEq)]
pub enum Camera {
    /// A finished panorama.
    Equirectangular(Equirectangular),
    /// A fisheye with an odd polynomial in the angle.
    KannalaBrandt(KannalaBrandt),
    /// A fisheye of two unit spheres.
    DoubleSphere(DoubleSphere),
    /// A fisheye or mirror with a polynomial in the radius.
    Ocam(Ocam),
    /// A normal lens.
    PinholeRadtan(PinholeRadtan),
}

/// What a camera can see at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    /// Width of the image.
    pub width_px: u32,
    /// Height of the image.
    pub height_px: u32,
    /// Directions farther than this from the optical axis are never seen; nearer ones are where they fall into the
    /// image. Pi for a panorama.
    pub max_angle_rad: f64,
}

impl Camera {
    /// The pixel that sees a point of the camera frame; `None` outside the domain, at the origin, or for NaN.
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Pixel> {
        match self {
            Camera::Equirectangular(camera) => camera.project(point_in_camera),
            Camera::KannalaBrandt(camera) => camera.project(point_in_camera),
            Camera::DoubleSphere(camera) => camera.project(point_in_camera),
            Camera::Ocam(camera) => camera.project(point_in_camera),
            Camera::PinholeRadtan(camera) => camera.project(point_in_camera),
        }
    }

    /// The direction, in the camera frame, that a pixel sees; `None` off the image, outside the domain, or for NaN.
    pub fn unproject(&self, pixel: Pixel) -> Option<Unit<Vector3<f64>>> {
        match self {
            Camera::Equirectangular(camera) => {
                let (width, height) = (f64::from(camera.width_px), f64::from(camera.height_px));
                let is_inside = (0.0..=width).contains(&pixel.u) && (0.0..=height).contains(&pixel.v);
                is_inside.then(|| camera.unproject(pixel.u, pixel.v))
            }
            Camera::KannalaBrandt(camera) => camera.unproject(pixel),
            Camera::DoubleSphere(camera) => camera.unproject(pixel),
            Camera::Ocam(camera) => camera.unproject(pixel),
            Camera::PinholeRadtan(camera) => camera.unproject(pixel),
        }
    }

    /// Size of the image and greatest angle from the axis.
    pub fn domain(&self) -> Domain {
        let of = |intrinsics: &Intrinsics, max_angle_rad: f64| Domain {
            width_px: intrinsics.width_px,
            height_px: intrinsics.height_px,
            max_angle_rad,
        };
        match self {
            Camera::Equirectangular(camera) => {
                Domain { width_px: camera.width_px, height_px: camera.height_px, max_angle_rad: std::f64::consts::PI }
            }
            Camera::KannalaBrandt(camera) => of(camera.intrinsics(), camera.max_angle_rad()),
            Camera::DoubleSphere(camera) => of(camera.intrinsics(), camera.max_angle_rad()),
            Camera::Ocam(camera) => Domain {
                width_px: camera.calibration().width_px,
                height_px: camera.calibration().height_px,
                max_angle_rad: camera.max_angle_rad(),
            },
            Camera::PinholeRadtan(camera) => of(camera.intrinsics(), camera.max_angle_rad()),
        }
    }
}

/// Turns a calibration tool's optical frame (x right, y down, z forward) into the camera frame (x forward, y left, z up):
/// `body_from_camera = body_from_optical * camera_from_optical().inverse()`.
pub fn camera_from_optical() -> UnitQuaternion<f64> {
    let matrix = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}

/// A point of the camera frame in optical axes: right, down, forward; `None` for the origin, NaN and infinity.
fn optical_from_camera(point: &Point3<f64>) -> Option<[f64; 3]> {
    let norm = point.coords.norm();
    (norm > 0.0 && norm.is_finite()).then(|| [-point.y, -point.z, point.x])
}

/// A direction in optical axes as one of the camera frame.
fn camera_direction(right: f64, down: f64, forward: f64) -> Unit<Vector3<f64>> {
    Unit::new_normalize(Vector3::new(forward, -right, -down))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn optical_axes_are_right_down_forward() {
        let turn = camera_from_optical();
        assert!((turn * Vector3::z() - Vector3::x()).norm() < 1e-15); // forward
        assert!((turn * Vector3::x() + Vector3::y()).norm() < 1e-15); // right is minus left
        assert!((turn * Vector3::y() + Vector3::z()).norm() < 1e-15); // down is minus up
        let [right, down, forward] = optical_from_camera(&Point3::new(3.0, 1.0, 2.0)).expect("a point");
        assert_eq!((right, down, forward), (-1.0, -2.0, 3.0));
        assert!(
            (camera_direction(right, down, forward).into_inner() - Vector3::new(3.0, 1.0, 2.0).normalize()).norm()
                < 1e-15
        );
    }

    #[test]
    fn a_panorama_is_a_camera_too() {
        let camera = Camera::Equirectangular(Equirectangular::default());
        assert_eq!(camera.domain(), Domain { width_px: 1920, height_px: 640, max_angle_rad: std::f64::consts::PI });
        let pixel = camera.project(&Point3::new(1.0, 0.0, 0.0)).expect("ahead");
        assert_eq!((pixel.u, pixel.v), (960.0, 320.0));
        assert!((camera.unproject(pixel).expect("inside").into_inner() - Vector3::x()).norm() < 1e-15);
        assert_eq!(camera.unproject(Pixel { u: 1.0, v: 640.5 }), None);
        assert_eq!(camera.unproject(Pixel { u: f64::NAN, v: 1.0 }), None);
    }
}
