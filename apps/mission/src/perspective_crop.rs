//! A normal picture cut from the panorama, around two things: what a vision-language model is shown (OmniVLN Eq. 7).
//!
//! ```text
//!   panorama (a full turn)                          crop: a pinhole at the panorama's camera
//!   +----------+-----------+----------+             +---------------+   looks at the middle of the two boxes, level,
//!   |          |  [A] [B]  |          |    aim      |   [ A ]       |   as wide as both need with a margin,
//!   +----------+-----------+----------+   ----->    |       [  B  ] |   but between 30 and 100 degrees
//!                                        render     +---------------+
//! ```
//! Models know photographs; the equirectangular picture bends straight edges and has a seam through whatever is behind the robot. [`aim`] is
//! cheap and says where the virtual camera looks, [`render`] fills its pixels, with nothing but these numbers in common.
//!
//! Frames: the crop's camera frame is that of every camera here, x forward, y left, z up; pixel centres at +0.5.

use std::f64::consts::TAU;

use dsg::Aabb;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::camera::{Intrinsics, PinholeRadtan};
use omni_perception::{CameraError, Equirectangular, Pixel, RgbImage};
use thiserror::Error;

/// Size and opening of the crop.
#[derive(Debug, Clone, PartialEq)]
pub struct CropConfig {
    /// Width and height, default 384: what vision encoders take without scaling.
    pub side_px: u32,
    /// Free border on each side as a share of the half width, default 0.15.
    pub margin: f64,
    /// Narrowest opening, default 30 degrees: below it the panorama's pixels are only blown up.
    pub min_fov_rad: f64,
    /// Widest opening, default 100 degrees: beyond it a pinhole stretches its corners.
    pub max_fov_rad: f64,
}

impl Default for CropConfig {
    fn default() -> CropConfig {
        CropConfig {
            side_px: 384,
            margin: 0.15,
            min_fov_rad: 30.0_f64.to_radians(),
            max_fov_rad: 100.0_f64.to_radians(),
        }
    }
}

/// Where the virtual camera stands and looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Pose of the crop's camera; its x axis looks at the middle of what the two boxes cover, its y axis is level.
    pub world_from_crop: Isometry3<f64>,
    /// Opening across and down.
    pub fov_rad: f64,
    /// Width and height.
    pub side_px: u32,
    /// What each box covers: left, top, right, bottom, cut at the border.
    pub rectangles_px: [[f64; 4]; 2],
    /// Whether both boxes are inside entirely; false if they need more than the widest opening.
    pub is_whole: bool,
}

impl Aim {
    /// Focal length in pixels.
    pub fn focal_px(&self) -> f64 {
        0.5 * f64::from(self.side_px) / (0.5 * self.fov_rad).tan()
    }

    /// The virtual camera, as a model that projects and unprojects.
    ///
    /// # Errors
    /// [`CameraError`] for sizes beyond those of any camera.
    pub fn lens(&self) -> Result<PinholeRadtan, CameraError> {
        let (focal_px, middle_px) = (self.focal_px(), 0.5 * f64::from(self.side_px) - 0.5);
        let intrinsics = Intrinsics {
            width_px: self.side_px,
            height_px: self.side_px,
            fx_px: focal_px,
            fy_px: focal_px,
            cx_px: middle_px,
            cy_px: middle_px,
        };
        PinholeRadtan::new(intrinsics, [0.0; 5], std::f64::consts::PI)
    }
}

/// Why there is no crop.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CropError {
    /// A box, the eye, or a number of the configuration is not finite or out of its range.
    #[error("a box or a pose is not finite, or the opening is not between 0 and 180 degrees")]
    NotFinite,
    /// The camera is between the boxes, or in one of them.
    #[error("the camera is too near: a part of the things is beside or behind it")]
    TooNear,
    /// The picture does not have the bytes of its size, or no size.
    #[error("a picture of {width} x {height} pixels has {bytes} bytes")]
    Picture {
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
        /// Bytes found.
        bytes: usize,
    },
    /// The panorama's camera or the crop's makes no sense.
    #[error("no camera: {0}")]
    Camera(CameraError),
}

/// Looks from `eye` (world frame) at two boxes. Straight up and down are allowed.
///
/// # Errors
/// [`CropError::NotFinite`], [`CropError::TooNear`].
pub fn aim(eye: &Point3<f64>, boxes: [&Aabb; 2], config: &CropConfig) -> Result<Aim, CropError> {
    let is_sound = boxes.iter().all(|bounds| bounds.is_valid())
        && eye.iter().all(|x| x.is_finite())
        && config.side_px > 0
        && config.margin >= 0.0
        && config.min_fov_rad > 0.0
        && config.min_fov_rad <= config.max_fov_rad
        && config.max_fov_rad < std::f64::consts::PI;
    if !is_sound {
        return Err(CropError::NotFinite);
    }
    let mut forward = boxes[0].union(boxes[1]).center() - eye;
    // The middle of the boxes is not the middle of what they cover: the near one is larger. Twice moved there, the rest is small.
    for _ in 0..2 {
        let rotation = level_toward(&forward)?;
        let [left, top, right, bottom] = union(covered(eye, &rotation, boxes)?);
        forward = rotation * Vector3::new(1.0, -0.5 * (left + right), -0.5 * (top + bottom));
    }
    let rotation = level_toward(&forward)?;
    let tangents = covered(eye, &rotation, boxes)?;
    let widest = union(tangents).iter().fold(0.0_f64, |widest, tangent| widest.max(tangent.abs()));
    let fov_rad = (2.0 * (widest * (1.0 + config.margin)).atan()).clamp(config.min_fov_rad, config.max_fov_rad);
    let mut aim = Aim {
        world_from_crop: Isometry3::from_parts(Translation3::from(eye.coords), rotation),
        fov_rad,
        side_px: config.side_px,
        rectangles_px: [[0.0; 4]; 2],
        is_whole: widest <= (0.5 * fov_rad).tan(),
    };
    let (focal_px, side_px) = (aim.focal_px(), f64::from(config.side_px));
    aim.rectangles_px = tangents.map(|sides| sides.map(|t| (0.5 * side_px + focal_px * t).clamp(0.0, side_px)));
    Ok(aim)
}

/// x along `forward`, y level.
fn level_toward(forward: &Vector3<f64>) -> Result<UnitQuaternion<f64>, CropError> {
    if forward.norm() < 1e-6 {
        return Err(CropError::TooNear);
    }
    let yaw_rad = forward.y.atan2(forward.x);
    let elevation_rad = forward.z.atan2(forward.x.hypot(forward.y));
    Ok(UnitQuaternion::from_euler_angles(0.0, -elevation_rad, yaw_rad))
}

/// What each box covers of the plane at distance 1: left, top, right, bottom (right and down are positive).
fn covered(
    eye: &Point3<f64>,
    world_from_crop: &UnitQuaternion<f64>,
    boxes: [&Aabb; 2],
) -> Result<[[f64; 4]; 2], CropError> {
    // Nearer to the plane of the lens than this, tangents are no measure of anything.
    const LEAST_COSINE: f64 = 0.02;
    let mut sides = [[f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY]; 2];
    for (sides, bounds) in sides.iter_mut().zip(boxes) {
        for corner in corners(bounds) {
            let seen = world_from_crop.inverse_transform_vector(&(corner - eye));
            if seen.norm() < 1e-6 || seen.x < LEAST_COSINE * seen.norm() {
                return Err(CropError::TooNear);
            }
            let (right, down) = (-seen.y / seen.x, -seen.z / seen.x);
            *sides = [sides[0].min(right), sides[1].min(down), sides[2].max(right), sides[3].max(down)];
        }
    }
    Ok(sides)
}

fn union([a, b]: [[f64; 4]; 2]) -> [f64; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

/// The eight corners of a box.
pub fn corners(bounds: &Aabb) -> [Point3<f64>; 8] {
    std::array::from_fn(|k| {
        let side = |axis: usize| if k >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        Point3::new(side(0), side(1), side(2))
    })
}

/// Fills the crop from the panorama, bilinear, across the seam; black above and below the panorama. Where the crop is
/// coarser than the panorama, each pixel is the mean of several looks. The panorama's size is that of `picture`; of `camera`
/// the elevations count.
///
/// # Errors
/// [`CropError::Picture`], [`CropError::Camera`].
pub fn render(
    picture: &RgbImage,
    camera: &Equirectangular,
    world_from_camera: &Isometry3<f64>,
    aim: &Aim,
) -> Result<RgbImage, CropError> {
    let RgbImage { width, height, rgb } = picture;
    if rgb.is_empty() || u64::from(*width) * u64::from(*height) * 3 != rgb.len() as u64 {
        return Err(CropError::Picture { width: *width, height: *height, bytes: rgb.len() });
    }
    let camera = Equirectangular { width_px: *width, height_px: *height, ..*camera };
    camera.validate().map_err(CropError::Camera)?;
    let (focal_px, middle_px) = (aim.focal_px(), 0.5 * f64::from(aim.side_px));
    let camera_from_crop = world_from_camera.rotation.inverse() * aim.world_from_crop.rotation;
    let looks = (f64::from(*width) / TAU / focal_px).ceil().clamp(1.0, 4.0) as u32;
    let side = aim.side_px;
    let mut crop = Vec::with_capacity(3 * side as usize * side as usize);
    for row in 0..side {
        for column in 0..side {
            let mut sum = [0.0; 3];
            for look in 0..looks * looks {
                let part = |k: u32| (f64::from(k) + 0.5) / f64::from(looks);
                // The pinhole of `Aim::lens`, which the tests hold against this, without its search for a distortion.
                let (u, v) = (f64::from(column) + part(look % looks), f64::from(row) + part(look / looks));
                let direction = Vector3::new(focal_px, middle_px - u, middle_px - v);
                let Some(seen) = camera.project(&Point3::from(camera_from_crop * direction)) else { continue };
                let color = bilinear(picture, seen);
                sum = std::array::from_fn(|channel| sum[channel] + color[channel]);
            }
            crop.extend(sum.map(|channel| (channel / f64::from(looks * looks)).round().clamp(0.0, 255.0) as u8));
        }
    }
    Ok(RgbImage { width: side, height: side, rgb: crop })
}

/// The colour at a place of a full turn: columns wrap, rows end.
fn bilinear(picture: &RgbImage, at: Pixel) -> [f64; 3] {
    let (width, height) = (i64::from(picture.width), i64::from(picture.height));
    let (x, y) = (at.u - 0.5, at.v - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (right_share, low_share) = (x - left, y - top);
    let mut color = [0.0; 3];
    for (step_x, step_y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let column = (left as i64 + step_x).rem_euclid(width) as usize;
        let row = (top as i64 + step_y).clamp(0, height - 1) as usize;
        let share_x = if step_x == 0 { 1.0 - right_share } else { right_share };
        let share_y = if step_y == 0 { 1.0 - low_share } else { low_share };
        let start = 3 * (row * width as usize + column);
        for (channel, value) in color.iter_mut().zip(&picture.rgb[start..start + 3]) {
            *channel += share_x * share_y * f64::from(*value);
        }
    }
    color
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(x: f64, y: f64, z: f64, side_m: f64) -> Aabb {
        Aabb::from_center(Point3::new(x, y, z), Vector3::repeat(side_m))
    }

    #[test]
    fn two_cubes_ahead_are_framed_left_and_right() {
        // Front faces at x = 2, from y = -1.1 to 1.1: the tangent is 0.55, with the margin 0.6325.
        let (left, right) = (cube(2.1, 1.0, 0.0, 0.2), cube(2.1, -1.0, 0.0, 0.2));
        let aim = aim(&Point3::origin(), [&left, &right], &CropConfig::default()).unwrap();
        assert!((0.5 * aim.fov_rad - 0.6325_f64.atan()).abs() < 1e-9 && aim.is_whole, "{aim:?}");
        let [a, b] = aim.rectangles_px;
        assert!(a[2] < 192.0 && 192.0 < b[0], "left is left: {a:?} {b:?}");
        assert!((a[0] - 192.0 * 0.15 / 1.15).abs() < 1e-6 && (b[2] - (384.0 - 192.0 * 0.15 / 1.15)).abs() < 1e-6);
        assert!((a[1] - (192.0 - 0.05 * aim.focal_px())).abs() < 1e-6, "10 cm up at 2 m");
    }

    #[test]
    fn the_opening_stays_between_30_and_100_degrees() {
        let config = CropConfig::default();
        let fov = |a: &Aabb, b: &Aabb| aim(&Point3::origin(), [a, b], &config).unwrap();
        let far = fov(&cube(9.0, 0.0, 0.0, 0.1), &cube(9.0, 0.2, 0.0, 0.1));
        assert_eq!((far.fov_rad, far.is_whole), (config.min_fov_rad, true));
        let near = fov(&cube(1.0, 2.0, 0.0, 0.2), &cube(1.0, -2.0, 0.0, 0.2));
        assert_eq!((near.fov_rad, near.is_whole), (config.max_fov_rad, false));
        assert!(near.rectangles_px.iter().flatten().all(|x| (0.0..=384.0).contains(x)));
    }

    #[test]
    fn who_stands_between_the_things_or_has_no_numbers_gets_no_picture() {
        let config = CropConfig::default();
        let (front, back) = (cube(1.0, 0.0, 0.0, 0.2), cube(-1.0, 0.0, 0.0, 0.2));
        assert_eq!(aim(&Point3::origin(), [&front, &back], &config), Err(CropError::TooNear));
        assert_eq!(aim(&Point3::origin(), [&front, &cube(0.0, 0.0, 0.0, 9.0)], &config), Err(CropError::TooNear));
        assert_eq!(
            aim(&Point3::origin(), [&front, &cube(f64::NAN, 0.0, 0.0, 1.0)], &config),
            Err(CropError::NotFinite)
        );
        let wide = CropConfig { max_fov_rad: 4.0, ..config };
        assert_eq!(aim(&Point3::origin(), [&front, &front], &wide), Err(CropError::NotFinite));
        let below = cube(0.0, 0.0, -2.0, 0.3);
        assert!(aim(&Point3::origin(), [&below, &below], &CropConfig::default()).unwrap().is_whole, "straight down");
    }

    #[test]
    fn a_picture_without_its_bytes_is_refused() {
        let thing = cube(2.0, 0.0, 0.0, 0.3);
        let aim = aim(&Point3::origin(), [&thing, &thing], &CropConfig::default()).unwrap();
        let render = |picture: &RgbImage| {
            render(picture, &Equirectangular::default(), &Isometry3::identity(), &aim).map(|crop| crop.rgb.len())
        };
        let short = RgbImage { width: 8, height: 4, rgb: vec![0; 95] };
        assert_eq!(render(&short), Err(CropError::Picture { width: 8, height: 4, bytes: 95 }));
        let none = RgbImage { width: 0, height: 4, rgb: vec![] };
        assert!(matches!(render(&none), Err(CropError::Picture { .. })));
        assert_eq!(render(&RgbImage { width: 8, height: 4, rgb: vec![7; 96] }), Ok(3 * 384 * 384));
    }
}
