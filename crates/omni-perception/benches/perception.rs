//! Claims guarded here: deskew of 32 thousand points in at most 2 ms; label transfer of at least 10 million points a
//! second (327 thousand points and 9 masks on a 1920 x 640 panorama: at most 32 ms).

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
