//! Label transfer in a furnished room: who gets which label, and do the boxes of things stay true?

mod support;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use omni_perception::*;
use support::Moment;

#[test]
fn report() {
    let verbose = std::env::var("V").is_ok();
    let moment = Moment::new(1, 0.015, 2);
    let camera_in_world = moment.world_from_camera * Point3::origin();
    let visible: Vec<bool> = moment
        .points_in_world
        .iter()
        .zip(&moment.things)
        .map(|(p, thing)| {
            let ray = p.cast::<f64>() - camera_in_world;
            moment
                .scene
                .cast(&camera_in_world, &ray.normalize())
                .is_some_and(|(d, t)| t == *thing && d > ray.norm() - 0.1)
        })
        .collect();
    for (slope, cell) in [
        (4.0, 4),
        (8.0, 4),
        (12.0, 4),
        (20.0, 4),
        (8.0, 2),
        (12.0, 2),
        (20.0, 2),
        (12.0, 3),
    ] {
        for (e, pose) in [
            ("", Isometry3::identity()),
            (
                "err",
                Isometry3::from_parts(
                    Translation3::new(0.005, 0.0, 0.0),
                    UnitQuaternion::from_euler_angles(0.0, 0.003, 0.01),
                ),
            ),
        ] {
            let mut config = ObservationConfig::default();
            config.labels.max_slope = slope;
            config.labels.cell_px = cell;
            let t = std::time::Instant::now();
            let seen = observe_panorama(
                &moment.panorama(),
                &moment.points_in_world,
                &(moment.world_from_camera * pose),
                &moment.camera,
                &config,
            )
            .unwrap();
            println!(
                "slope {slope} cell {cell} {e}: {} points {:?} {:?}",
                moment.points_in_world.len(),
                t.elapsed(),
                seen.report
            );
            for (m, mask) in moment.masks.iter().enumerate() {
                let thing = moment
                    .scene
                    .names
                    .iter()
                    .position(|n| *n == mask.label)
                    .unwrap();
                let own = (0..visible.len())
                    .filter(|p| moment.things[*p] == thing && visible[*p])
                    .count();
                let (mut right, mut wrong) = (0, 0);
                let (lo, hi) = moment.scene.bounds(thing);
                let (mut bmin, mut bmax) =
                    (Point3::from([f32::MAX; 3]), Point3::from([f32::MIN; 3]));
                for (p, label) in seen.mask_of_point.iter().enumerate() {
                    if *label == Some(m as u16) {
                        if moment.things[p] == thing {
                            right += 1
                        } else {
                            wrong += 1
                        }
                        bmin = bmin.inf(&moment.points_in_world[p]);
                        bmax = bmax.sup(&moment.points_in_world[p]);
                    }
                }
                let d1 = bmin.cast::<f64>() - lo;
                let d2 = bmax.cast::<f64>() - hi;
                if verbose {
                    println!(
                        "  {:10} area {:6} own {own:6} right {right:6} wrong {wrong:4}  min {:+.2} {:+.2} {:+.2} max {:+.2} {:+.2} {:+.2}",
                        mask.label,
                        mask.rle.area(),
                        d1.x,
                        d1.y,
                        d1.z,
                        d2.x,
                        d2.y,
                        d2.z
                    );
                }
            }
        }
    }
}
