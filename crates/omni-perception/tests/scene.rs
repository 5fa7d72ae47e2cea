//! Label transfer in a furnished room: who gets which label, and do the boxes of things stay true?

mod support;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use omni_perception::*;
use support::Moment;

#[test]
fn report() {
    for (name, bleed, noise, erosion, cell) in [("plain", 0, 0.0, 0, 4), ("eroded", 2, 0.015, 2, 4), ("no erosion", 2, 0.015, 0, 4)] {
        let moment = Moment::new(1, noise, bleed);
        for (e, pose) in [
            ("", Isometry3::identity()),
            ("err", Isometry3::from_parts(Translation3::new(0.005, 0.0, 0.0), UnitQuaternion::from_euler_angles(0.0, 0.003, 0.01))),
        ] {
            let mut config = ObservationConfig::default();
            config.labels.erosion_px = erosion;
            config.labels.cell_px = cell;
            let t = std::time::Instant::now();
            let seen = observe_panorama(&moment.panorama(), &moment.points_in_world, &(moment.world_from_camera * pose), &moment.camera, &config).unwrap();
            println!("{name} {e}: {} points {:?} {:?}", moment.points_in_world.len(), t.elapsed(), seen.report);
            for (m, mask) in moment.masks.iter().enumerate() {
                let thing = moment.scene.names.iter().position(|n| *n == mask.label).unwrap();
                let own = moment.things.iter().filter(|x| **x == thing).count();
                let (mut right, mut wrong) = (0, 0);
                let (lo, hi) = moment.scene.bounds(thing);
                let (mut bmin, mut bmax) = (Point3::from([f32::MAX; 3]), Point3::from([f32::MIN; 3]));
                for (p, label) in seen.mask_of_point.iter().enumerate() {
                    if *label == Some(m as u16) {
                        if moment.things[p] == thing { right += 1 } else { wrong += 1 }
                        bmin = bmin.inf(&moment.points_in_world[p]);
                        bmax = bmax.sup(&moment.points_in_world[p]);
                    }
                }
                let d1 = bmin.cast::<f64>() - lo;
                let d2 = bmax.cast::<f64>() - hi;
                println!("  {:10} area {:6} own {own:6} right {right:6} wrong {wrong:4}  min {:+.2} {:+.2} {:+.2} max {:+.2} {:+.2} {:+.2}", mask.label, mask.rle.area(), d1.x, d1.y, d1.z, d2.x, d2.y, d2.z);
            }
        }
    }
}
