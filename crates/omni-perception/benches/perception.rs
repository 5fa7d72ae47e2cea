//! Claims guarded here: deskew of 32 thousand points in at most 2 ms; label transfer of at least 10 million points a
//! second (327 thousand points and 9 masks on a 1920 x 640 panorama: at most 32 ms); stitching of two fisheyes to
//! 1920 x 640 pixels in at most 8 ms; projection with range buffer and visibility (`project_and_see_327k_points`) of 20 million
//! points a second. What was measured: the crate's README.

#[path = "../tests/support/mod.rs"]
mod support;

use std::sync::OnceLock;

use divan::Bencher;
use nalgebra::Point3;
use omni_perception::*;
use support::{Moment, Noise, Scene, TURNING_RADPS, encoder, mount, scan, trajectory};

fn main() {
    divan::main();
}

fn moment() -> &'static Moment {
    static MOMENT: OnceLock<Moment> = OnceLock::new();
    MOMENT.get_or_init(|| Moment::new(1, 0.015, 2))
}

#[divan::bench]
fn deskew_32k_points(bencher: Bencher) {
    let (scan, _) = scan(&Scene::living_room(), 0.0, TURNING_RADPS, 0.015, &mut Noise(1));
    let (trajectory, encoder) = (trajectory(-0.1, 0.2, 200.0), encoder(-0.1, 0.2, TURNING_RADPS));
    bencher.bench(|| deskew(&scan, &encoder, &mount(), &trajectory, ReferenceTime::End, &DeskewConfig::default()));
}

#[divan::bench]
fn deskew_32k_points_exactly(bencher: Bencher) {
    let (scan, _) = scan(&Scene::living_room(), 0.0, TURNING_RADPS, 0.015, &mut Noise(1));
    let (trajectory, encoder) = (trajectory(-0.1, 0.2, 200.0), encoder(-0.1, 0.2, TURNING_RADPS));
    bencher
        .bench(|| deskew_exactly(&scan, &encoder, &mount(), &trajectory, ReferenceTime::End, &DeskewConfig::default()));
}

#[divan::bench]
fn label_327k_points(bencher: Bencher) {
    let moment = moment();
    let camera_from_world = moment.world_from_camera.inverse().cast::<f32>();
    let points: Vec<Point3<f32>> = moment.points_in_world.iter().map(|p| camera_from_world * p).collect();
    bencher.bench(|| transfer_labels(&points, &moment.camera, &moment.masks, &LabelConfig::default()));
}

#[divan::bench]
fn project_and_see_327k_points(bencher: Bencher) {
    let moment = moment();
    let camera_from_world = moment.world_from_camera.inverse().cast::<f32>();
    let points: Vec<Point3<f32>> = moment.points_in_world.iter().map(|p| camera_from_world * p).collect();
    let mut visibility = Visibility::new(&moment.camera, &LabelConfig::default()).expect("sound");
    let mut visible = Vec::new();
    bencher
        .counter(divan::counter::ItemsCount::new(points.len()))
        .bench_local(|| visibility.see(divan::black_box(&points), &mut visible));
}

#[divan::bench]
fn observe_327k_points(bencher: Bencher) {
    let moment = moment();
    let panorama = moment.panorama();
    bencher.bench(|| {
        let config = ObservationConfig::default();
        observe_panorama(&panorama, &moment.points_in_world, &moment.world_from_camera, &moment.camera, &config)
    });
}

#[divan::bench]
fn no_masks_327k_points(bencher: Bencher) {
    let moment = moment();
    let points = &moment.points_in_world;
    bencher.bench(|| transfer_labels(points, &moment.camera, &[], &LabelConfig::default()));
}

/// Two fisheyes of 1024 x 1024 pixels and 190 degrees, back to back, and what they see.
fn fisheyes() -> ([Lens; 2], Vec<RgbImage>) {
    use nalgebra::{Isometry3, Vector3};
    let intrinsics =
        Intrinsics { width_px: 1024, height_px: 1024, fx_px: 305.0, fy_px: 305.0, cx_px: 511.5, cy_px: 511.5 };
    let lens = camera::KannalaBrandt::new(intrinsics, [0.004, -0.002, 0.0005, -0.0001], 95_f64.to_radians());
    let lens = Camera::KannalaBrandt(lens.expect("sound"));
    let lenses = [1.0, -1.0].map(|side| Lens {
        camera: lens.clone(),
        panorama_from_lens: Isometry3::new(
            Vector3::y() * 0.015 * side,
            Vector3::z() * std::f64::consts::FRAC_PI_2 * side,
        ),
    });
    let mut noise = Noise(5);
    let image = || RgbImage {
        width: 1024,
        height: 1024,
        rgb: (0..3 << 20).map(|i: u32| i.wrapping_mul(i >> 7) as u8).collect(),
    };
    let mut images = vec![image(), image()];
    images[0].rgb.iter_mut().step_by(17).for_each(|value| *value = (255.0 * noise.uniform()) as u8);
    (lenses, images)
}

#[divan::bench]
fn stitch_1920x640(bencher: Bencher) {
    let (lenses, images) = fisheyes();
    let stitcher = Stitcher::new(&lenses, &StitchConfig::default()).expect("sound");
    let mut panorama = RgbImage { width: 0, height: 0, rgb: Vec::new() };
    let gains = [[1.02, 0.98, 1.0], [0.98, 1.02, 1.0]];
    bencher.bench_local(|| stitcher.stitch_into(&images, &gains, &mut panorama));
}

#[divan::bench]
fn stitch_1920x640_with_gains(bencher: Bencher) {
    let (lenses, images) = fisheyes();
    let stitcher = Stitcher::new(&lenses, &StitchConfig::default()).expect("sound");
    bencher.bench_local(|| stitcher.stitch(&images));
}

#[divan::bench(sample_count = 5)]
fn stitch_1920x640_plainly(bencher: Bencher) {
    let (lenses, images) = fisheyes();
    bencher.bench_local(|| stitch_plainly(&lenses, &StitchConfig::default(), &images, &[[1.0; 3]; 2]));
}

#[divan::bench(sample_count = 5)]
fn table_of_1920x640(bencher: Bencher) {
    let (lenses, _) = fisheyes();
    bencher.bench_local(|| Stitcher::new(&lenses, &StitchConfig::default()));
}
