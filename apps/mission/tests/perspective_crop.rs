//! Laws of the crop: both boxes are in it, every pixel shows what the pinhole says, and the panorama's seam is nowhere.

use mission::dsg::Aabb;
use mission::omni_perception::{Equirectangular, Pixel, RgbImage};
use mission::perspective_crop::{Aim, CropConfig, aim, corners, render};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

const WIDTH: u32 = 720;
const HEIGHT: u32 = 240;
const CAMERA: Equirectangular = Equirectangular {
    width_px: WIDTH,
    height_px: HEIGHT,
    phi_top_rad: std::f64::consts::FRAC_PI_3,
    phi_bottom_rad: -std::f64::consts::FRAC_PI_3,
};
const SMALL: CropConfig =
    CropConfig { side_px: 64, margin: 0.15, min_fov_rad: std::f64::consts::FRAC_PI_6, max_fov_rad: 1.745 };

/// A panorama whose colours are the direction in the world, so that a pixel says where it looks.
fn directions(world_from_camera: &Isometry3<f64>) -> RgbImage {
    let mut rgb = Vec::new();
    for row in 0..HEIGHT {
        for column in 0..WIDTH {
            let seen = world_from_camera.rotation
                * CAMERA.unproject(f64::from(column) + 0.5, f64::from(row) + 0.5).into_inner();
            rgb.extend(seen.iter().map(|x| (127.5 + 127.5 * x).round() as u8));
        }
    }
    RgbImage { width: WIDTH, height: HEIGHT, rgb }
}

fn at(picture: &RgbImage, column: u32, row: u32) -> [u8; 3] {
    picture.at(column, row).expect("inside")
}

prop_compose! {
    fn a_box()(center in prop::array::uniform3(-3.0..3.0_f64), sides in prop::array::uniform3(0.02..0.8_f64)) -> Aabb {
        Aabb::from_center(Point3::from(center), Vector3::from(sides))
    }
}

prop_compose! {
    fn a_pose()(at in prop::array::uniform3(-3.0..3.0_f64), yaw in -7.0..7.0_f64, tilt in -0.3..0.3_f64, roll in -0.3..0.3_f64)
        -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(Vector3::from(at)), UnitQuaternion::from_euler_angles(roll, tilt, yaw))
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn all_corners_are_inside_with_the_margin_and_up_is_up(a in a_box(), b in a_box(), eye in prop::array::uniform3(-3.0..3.0_f64)) {
        let config = CropConfig::default();
        let Ok(aim) = aim(&Point3::from(eye), [&a, &b], &config) else { return Ok(()) };
        prop_assert!((config.min_fov_rad..=config.max_fov_rad).contains(&aim.fov_rad));
        let lens = aim.lens().expect("a camera");
        let side = f64::from(config.side_px);
        for (bounds, [left, top, right, bottom]) in [(a, aim.rectangles_px[0]), (b, aim.rectangles_px[1])] {
            for corner in corners(&bounds) {
                let pixel = lens.project(&aim.world_from_crop.inverse_transform_point(&corner));
                prop_assert!(pixel.is_some() || !aim.is_whole, "a corner is not in the picture");
                let Some(Pixel { u, v }) = pixel else { continue };
                prop_assert!(u >= left - 1e-6 && u <= right + 1e-6 && v >= top - 1e-6 && v <= bottom + 1e-6);
                if aim.fov_rad < config.max_fov_rad {
                    let free_px = 0.5 * side * (1.0 - 1.0 / 1.15) - 1e-6;
                    prop_assert!(u.min(v) >= free_px && u.max(v) <= side - free_px, "{u} {v}");
                }
            }
        }
        // Level: what is left of the middle is as high as the middle.
        prop_assert!((aim.world_from_crop.rotation * Vector3::y()).z.abs() < 1e-9);
        prop_assert!((aim.world_from_crop.rotation * Vector3::z()).z >= -1e-9);
    }

    #[test]
    fn every_pixel_shows_the_direction_that_the_pinhole_says(a in a_box(), b in a_box(), pose in a_pose()) {
        let eye = Point3::from(pose.translation.vector);
        let Ok(aim) = aim(&eye, [&a, &b], &SMALL) else { return Ok(()) };
        let crop = render(&directions(&pose), &CAMERA, &pose, &aim).expect("a picture");
        let lens = aim.lens().expect("a camera");
        let mut compared = 0;
        for (column, row) in (0..64).step_by(5).flat_map(|column| (0..64).step_by(5).map(move |row| (column, row))) {
            let direction = lens.unproject(Pixel { u: f64::from(column) + 0.5, v: f64::from(row) + 0.5 }).expect("inside");
            let expected = aim.world_from_crop.rotation * direction.into_inner();
            // Where the panorama ends there is nothing to compare with.
            let elevation = (pose.rotation.inverse() * expected).z.asin();
            if elevation.abs() > 1.0 {
                continue;
            }
            compared += 1;
            let shown = at(&crop, column, row).map(|x| (f64::from(x) - 127.5) / 127.5);
            prop_assert!((Vector3::from(shown) - expected).norm() < 0.03, "{column} {row}: {shown:?} {expected:?}");
        }
        prop_assert!(compared > 0 || aim.world_from_crop.rotation.euler_angles().1.abs() > 0.3);
    }

    #[test]
    fn the_seam_makes_no_difference(a in a_box(), b in a_box(), pose in a_pose(), shift in 1..WIDTH) {
        let eye = Point3::from(pose.translation.vector);
        let Ok(aim) = aim(&eye, [&a, &b], &SMALL) else { return Ok(()) };
        let unlike = unlike_after_a_turn(&pose, &aim, shift);
        prop_assert!(unlike <= 12, "{unlike} values differ");
    }
}

/// The camera turned to the left by some columns sees the same, that many columns farther right: how many values of the crop
/// are not the same. The picture is noise, so that one wrong pixel shows. Rounding may tip a value at a half, or a look at the very
/// edge of the panorama.
fn unlike_after_a_turn(pose: &Isometry3<f64>, aim: &Aim, shift: u32) -> usize {
    let noise = (0..3 * WIDTH * HEIGHT).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let picture = RgbImage { width: WIDTH, height: HEIGHT, rgb: noise };
    let turn_rad = std::f64::consts::TAU * f64::from(shift) / f64::from(WIDTH);
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, turn_rad);
    let turned = Isometry3::from_parts(pose.translation, pose.rotation * turn);
    let mut moved = picture.clone();
    for line in moved.rgb.chunks_exact_mut(3 * WIDTH as usize) {
        line.rotate_right(3 * shift as usize);
    }
    let one = render(&picture, &CAMERA, pose, aim).expect("a picture");
    let other = render(&moved, &CAMERA, &turned, aim).expect("a picture");
    one.rgb.iter().zip(&other.rgb).filter(|(p, q)| p.abs_diff(**q) > 1).count()
}

#[test]
fn things_right_behind_the_robot_look_as_they_would_ahead() {
    let boxes = [-0.3, 0.3].map(|y| Aabb::from_center(Point3::new(-2.0, y, 0.0), Vector3::repeat(0.3)));
    let aim = aim(&Point3::origin(), [&boxes[0], &boxes[1]], &SMALL).expect("both behind");
    assert_eq!(unlike_after_a_turn(&Isometry3::identity(), &aim, WIDTH / 2), 0);
}

/// Centre of what is red.
fn red_middle(picture: &RgbImage) -> Option<(f64, f64)> {
    let mut sum = (0.0, 0.0, 0.0);
    for (column, row) in (0..picture.width).flat_map(|column| (0..picture.height).map(move |row| (column, row))) {
        let [red, green, _] = at(picture, column, row).map(f64::from);
        let weight = (red - green).max(0.0);
        sum = (sum.0 + weight * (f64::from(column) + 0.5), sum.1 + weight * (f64::from(row) + 0.5), sum.2 + weight);
    }
    (sum.2 > 0.0).then(|| (sum.0 / sum.2, sum.1 / sum.2))
}

fn check_marker(marker: Point3<f64>, things: [Point3<f64>; 2]) {
    let pose = Isometry3::translation(0.2, -0.1, 1.0);
    let direction = (marker - pose.translation.vector).coords.normalize();
    let mut picture = RgbImage { width: WIDTH, height: HEIGHT, rgb: vec![90; (3 * WIDTH * HEIGHT) as usize] };
    for row in 0..HEIGHT {
        for column in 0..WIDTH {
            let seen = CAMERA.unproject(f64::from(column) + 0.5, f64::from(row) + 0.5);
            if seen.dot(&direction) > 0.03_f64.cos() {
                let start = (3 * (row * WIDTH + column)) as usize;
                picture.rgb[start..start + 3].copy_from_slice(&[250, 0, 0]);
            }
        }
    }
    let boxes = things.map(|center| Aabb::from_center(center, Vector3::repeat(0.2)));
    let config = CropConfig::default();
    let aim: Aim = aim(&Point3::from(pose.translation.vector), [&boxes[0], &boxes[1]], &config).expect("both ahead");
    let crop = render(&picture, &CAMERA, &pose, &aim).expect("a picture");
    let expected = aim.lens().expect("a camera").project(&aim.world_from_crop.inverse_transform_point(&marker));
    let expected = expected.expect("in the picture");
    let (u, v) = red_middle(&crop).expect("the marker");
    // A pixel of this panorama is two of the crop.
    assert!((u - expected.u).hypot(v - expected.v) < 1.5, "{u} {v} {expected:?}");
}

#[test]
fn a_marker_lands_where_the_pinhole_says_ahead_and_behind_and_below() {
    let things = |x: f64, y: f64, z: f64| [Point3::new(x, y - 0.3, z), Point3::new(x, y + 0.3, z)];
    check_marker(Point3::new(2.0, 0.3, 1.0), things(2.0, 0.0, 1.0));
    check_marker(Point3::new(-2.0, 0.05, 1.1), things(-2.0, 0.0, 1.0)); // right at the seam
    check_marker(Point3::new(-1.5, -0.3, 0.2), things(-1.5, 0.0, 0.3));
    check_marker(Point3::new(0.1, 1.4, 1.9), things(0.0, 1.5, 1.8));
}
