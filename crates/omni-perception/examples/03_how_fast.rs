//! How long does one panorama take? CPU time of the thread (a loaded machine does not count), best of ten tenths of a second.
//!
//! `cargo run --release -p omni-perception --example 03_how_fast`

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Vector3};
use omni_perception::*;
use support::{Moment, Noise, Scene, TURNING_RADPS, encoder, mount, scan, trajectory};

fn main() {
    // 1. One scan of 32 x 1024 points, deskewed on 200 Hz knots with the motor's angle at each point's time.
    let (raw, _) = scan(&Scene::living_room(), 0.0, TURNING_RADPS, 0.015, &mut Noise(1));
    let (trajectory, encoder) = (trajectory(-0.1, 0.2, 200.0), encoder(-0.1, 0.2, TURNING_RADPS));
    let deskewing = best(|| {
        let config = DeskewConfig::default();
        let scan = deskew(&raw, &encoder, &mount(), &trajectory, ReferenceTime::End, &config);
        assert!(scan.is_ok());
    });
    println!("deskew of {} points: {:.2} ms", raw.points.len(), deskewing.as_secs_f64() * 1e3);

    // 2. Ten scans around one panorama with nine masks.
    let moment = Moment::new(1, 0.015, 2);
    let (panorama, config) = (moment.panorama(), ObservationConfig::default());
    let observe = |panorama: &MaskedPanorama| {
        let (points, pose) = (&moment.points_in_world, &moment.world_from_camera);
        observe_panorama(panorama, points, pose, &moment.camera, &config).expect("sound")
    };
    let empty = MaskedPanorama::default();
    let projecting = best(|| assert!(observe(&empty).objects.is_empty()));
    let observing = best(|| assert!(!observe(&panorama).objects.is_empty()));
    let count = moment.points_in_world.len();
    let per_second = count as f64 / observing.as_secs_f64() / 1e6;
    println!(
        "{count} points, {} masks: {:.1} ms, {per_second:.1} million points a second",
        panorama.masks.len(),
        observing.as_secs_f64() * 1e3
    );
    println!("  of that projection and range buffer: {:.1} ms", projecting.as_secs_f64() * 1e3);
    assert_eq!(observe(&panorama).objects.len(), panorama.masks.len());

    // 3. Two fisheyes of 1024 x 1024 pixels and 190 degrees to one panorama of 1920 x 640.
    let (lenses, images) = two_fisheyes();
    let stitcher = Stitcher::new(&lenses, &StitchConfig::default()).expect("sound");
    let gains = stitcher.gains(&images).expect("fits");
    let mut panorama = RgbImage { width: 0, height: 0, rgb: Vec::new() };
    let stitching = best(|| stitcher.stitch_into(&images, &gains, &mut panorama).expect("fits"));
    let measuring = best(|| assert_eq!(stitcher.gains(&images).expect("fits").len(), 2));
    let (stitching, measuring) = (stitching.as_secs_f64() * 1e3, measuring.as_secs_f64() * 1e3);
    println!("stitching of 1920 x 640 pixels: {stitching:.1} ms; gains of the lenses: {measuring:.1} ms");
}

/// Back to back, each with a chequered picture.
fn two_fisheyes() -> ([Lens; 2], [RgbImage; 2]) {
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
    let field = |i: u32| ((i / 48 + i / 3072 / 16) % 2 * 150 + i % 50) as u8;
    let image = || RgbImage { width: 1024, height: 1024, rgb: (0..3 << 20).map(field).collect() };
    (lenses, [image(), image()])
}

/// The counter moves in steps of some milliseconds, so each measurement repeats the work for a while.
fn best(mut work: impl FnMut()) -> Duration {
    let mut best = Duration::MAX;
    for _ in 0..10 {
        let start = cpu_time();
        let mut repeats = 0;
        while cpu_time() - start < Duration::from_millis(100) {
            work();
            repeats += 1;
        }
        best = best.min((cpu_time() - start) / repeats);
    }
    best
}

/// CPU time of this thread where Linux tells it, else time since the first call.
fn cpu_time() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    match stat.split_whitespace().next().and_then(|ns| ns.parse().ok()) {
        Some(ns) => Duration::from_nanos(ns),
        None => START.get_or_init(Instant::now).elapsed(),
    }
}
