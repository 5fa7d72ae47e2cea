//! Points per second of CPU time through projection, visibility and labels, on one core: the figure that the front end
//! promises (20 million). Thread time instead of the clock on the wall, for machines that do other things as well.

#[path = "../tests/support/mod.rs"]
mod support;

use cpu_time::ThreadTime;
use nalgebra::Point3;
use omni_perception::*;
use support::Moment;

fn main() {
    let moment = Moment::new(1, 0.015, 2);
    let camera_from_world = moment.world_from_camera.inverse().cast::<f32>();
    let points: Vec<Point3<f32>> = moment.points_in_world.iter().map(|p| camera_from_world * p).collect();
    let config = ObservationConfig::default();
    let panorama = moment.panorama();
    let mut counts = (0, 0, 0);
    report("no masks", points.len(), || {
        counts.0 = transfer_labels(&points, &moment.camera, &[], &config.labels).expect("sound").report.unmasked;
    });
    report("labels of 9 masks", points.len(), || {
        let transfer = transfer_labels(&points, &moment.camera, &moment.masks, &config.labels).expect("sound");
        counts.1 = transfer.report.labelled;
    });
    report("observations of 9 masks", points.len(), || {
        let world_from_camera = &moment.world_from_camera;
        let seen = observe_panorama(&panorama, &moment.points_in_world, world_from_camera, &moment.camera, &config);
        counts.2 = seen.expect("sound").objects.len();
    });
    println!("{} unmasked; {} labelled; {} things", counts.0, counts.1, counts.2);
}

/// The fastest of some rounds: what else runs on the machine only slows down.
fn report(what: &str, points: usize, mut run: impl FnMut()) {
    let times_s = (0..30).map(|_| {
        let start = ThreadTime::now();
        run();
        start.elapsed().as_secs_f64()
    });
    let best_s = times_s.fold(f64::INFINITY, f64::min);
    println!("{what}: {:.2} ms, {:.1} million points a second", 1e3 * best_s, points as f64 / best_s * 1e-6);
}
