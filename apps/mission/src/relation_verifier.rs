//! OmniVLN Eq. 7 without a vision model: how likely a relation between two near things is, given that their boxes are uncertain.
//!
//! The graph proposes relations from boxes as if these were exact. A box that was seen five times from one side is not: its faces
//! are off by centimetres, and a relation that hangs on one of them is not worth telling a language model. The score is the
//! probability that the defining inequality holds when each face has a normal error that shrinks with the number of looks.
//! Departure: Eq. 7 asks a vision-language model; its threshold and its place are the same.

use dsg::{Object, RelationKind};

/// Error of a face after one look: range noise, mask borders, odometry.
const FACE_ERROR_M: f64 = 0.06;
/// ... and what no number of looks removes: voxels and drift.
const FACE_FLOOR_M: f64 = 0.015;
/// "On" allows so much air or overlap between the two faces: the foot of a monitor is too thin to be seen.
const CONTACT_M: f64 = 0.35;
/// ... and so much between the footprints: of a counter higher than the eyes only the front is seen.
const UNSEEN_TOP_M: f64 = 0.40;
/// "Above" and "under" allow so much between the footprints: a picture hangs on the wall behind the sofa.
const BEHIND_M: f64 = 0.25;
/// Largest gap of things that are near each other, as in the graph's own proposal.
const NEAR_M: f64 = 1.1;

/// Probability in `[0, 1]` that the relation holds. 1 for kinds that are proposed from more than two boxes.
pub fn geometric_score(subject: &Object, object: &Object, kind: RelationKind) -> f64 {
    let sigma_m = face_error_m(subject).hypot(face_error_m(object));
    let (a, b) = (&subject.bounds, &object.bounds);
    match kind {
        RelationKind::Near => normal_cdf((NEAR_M - a.gap_m(b)) / sigma_m),
        // Two borders: neither floating over it nor sunk into it.
        RelationKind::On => {
            let air_m = a.min.z - b.max.z;
            let over = normal_cdf((CONTACT_M - air_m) / sigma_m);
            // A support is hollow (a chair's seat is below its back): sinking in counts from the support's own top third.
            let depth_m = (b.max.z - b.min.z).max(CONTACT_M) * 0.7;
            let under = normal_cdf((depth_m + air_m) / sigma_m);
            over * under * plan_overlap(subject, object, UNSEEN_TOP_M, sigma_m)
        }
        RelationKind::Above => {
            normal_cdf((a.min.z - b.max.z) / sigma_m) * plan_overlap(subject, object, BEHIND_M, sigma_m)
        }
        RelationKind::Under => {
            // What stands beneath a table top lies within the table's box.
            let roof_m = if a.max.z <= b.min.z { b.min.z } else { b.max.z };
            let head_m = roof_m - a.max.z;
            normal_cdf(head_m / sigma_m) * plan_overlap(subject, object, BEHIND_M, sigma_m)
        }
        RelationKind::Inside => {
            let sticks_out_m = (0..3)
                .map(|axis| (b.min[axis] - a.min[axis]).max(a.max[axis] - b.max[axis]))
                .fold(f64::NEG_INFINITY, f64::max);
            normal_cdf((CONTACT_M - sticks_out_m) / sigma_m)
        }
        RelationKind::Between => 1.0,
    }
}

fn face_error_m(object: &Object) -> f64 {
    FACE_FLOOR_M.hypot(FACE_ERROR_M / f64::from(object.observations.max(1)).sqrt())
}

/// Probability that seen from above the two are at most `apart_m` apart: the gap between the footprints is negative where they
/// overlap.
fn plan_overlap(subject: &Object, object: &Object, apart_m: f64, sigma_m: f64) -> f64 {
    let (a, b) = (&subject.bounds, &object.bounds);
    let gap_m =
        (0..2).map(|axis| (b.min[axis] - a.max[axis]).max(a.min[axis] - b.max[axis])).fold(f64::NEG_INFINITY, f64::max);
    normal_cdf((apart_m - gap_m) / sigma_m)
}

/// Standard normal distribution function by the logistic that comes nearest to it (error below 0.01).
fn normal_cdf(x: f64) -> f64 {
    1.0 / (1.0 + (-1.702 * x).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsg::{Aabb, ObjectId};
    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;

    fn thing(id: u64, center: [f64; 3], sides_m: [f64; 3], observations: u32) -> Object {
        let bounds = Aabb::from_center(Point3::from(center), Vector3::from(sides_m));
        Object { observations, ..Object::new(ObjectId(id), "thing", bounds) }
    }

    #[test]
    fn a_mug_on_a_table_is_on_it_and_one_beside_it_is_not() {
        let table = thing(1, [0.0, 0.0, 0.37], [1.4, 0.8, 0.74], 20);
        let mug = thing(2, [0.3, 0.2, 0.79], [0.1, 0.1, 0.1], 10);
        let beside = thing(3, [1.2, 0.0, 0.79], [0.1, 0.1, 0.1], 10);
        let lamp = thing(4, [0.0, 0.0, 1.8], [0.3, 0.3, 0.3], 10);
        assert!(geometric_score(&mug, &table, RelationKind::On) > 0.9);
        assert!(geometric_score(&beside, &table, RelationKind::On) < 0.1);
        assert!(geometric_score(&lamp, &table, RelationKind::On) < 0.1);
        assert!(geometric_score(&lamp, &table, RelationKind::Above) > 0.9);
        assert!(geometric_score(&table, &lamp, RelationKind::Under) > 0.9);
    }

    #[test]
    fn a_bin_under_a_desk_stands_within_the_desks_box() {
        let desk = thing(1, [0.0, 0.0, 0.37], [1.4, 0.8, 0.74], 20);
        let bin = |z_m: f64| thing(2, [0.3, 0.2, z_m], [0.3, 0.3, 0.4], 10);
        assert!(geometric_score(&bin(0.2), &desk, RelationKind::Under) > 0.9);
        assert!(geometric_score(&bin(0.9), &desk, RelationKind::Under) < 0.1);
    }

    #[test]
    fn a_monitor_whose_foot_was_not_seen_is_on_its_desk() {
        let desk = thing(1, [0.0, 0.0, 0.37], [1.4, 0.8, 0.74], 20);
        let monitor = thing(2, [0.0, 0.2, 1.14], [0.5, 0.1, 0.4], 20);
        assert!(geometric_score(&monitor, &desk, RelationKind::On) > 0.9);
    }

    #[test]
    fn what_hangs_on_a_centimetre_is_doubtful_until_it_was_seen_often() {
        let shelf = |n| thing(1, [0.0, 0.0, 1.0], [1.0, 0.4, 0.1], n);
        // Its footprint ends 3 cm farther from the shelf's than "above" allows.
        let box_ = |n| thing(2, [0.0, 0.53, 1.3], [0.2, 0.1, 0.2], n);
        let once = geometric_score(&box_(1), &shelf(1), RelationKind::Above);
        let often = geometric_score(&box_(100), &shelf(100), RelationKind::Above);
        assert!(once > 0.3 && often < 0.1, "{once} {often}");
    }

    proptest! {
        #[test]
        fn scores_are_probabilities_and_nearer_is_never_less_near(
            gap_m in 0.0..3.0_f64, more_m in 0.0..2.0_f64, n in 1_u32..50, side_m in 0.05..2.0_f64,
        ) {
            let a = thing(1, [0.0, 0.0, 0.5], [side_m, side_m, 1.0], n);
            let at = |gap_m: f64| thing(2, [side_m / 2.0 + gap_m + 0.1, 0.0, 0.5], [0.2, 0.2, 0.2], n);
            for kind in RelationKind::ALL {
                let score = geometric_score(&a, &at(gap_m), kind);
                prop_assert!((0.0..=1.0).contains(&score), "{kind:?} {score}");
            }
            let near = |gap_m| geometric_score(&a, &at(gap_m), RelationKind::Near);
            prop_assert!(near(gap_m) >= near(gap_m + more_m));
        }
    }
}
