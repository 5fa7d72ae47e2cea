//! What the boxes of a pair say about touching and being one over the other.

use crate::object::Object;
use crate::relation::RelationKind;
use crate::relations::RelationConfig;

/// Things with an open top or room beneath: what lies within their box is on or under them, not inside.
#[rustfmt::skip]
const OPEN: &[&str] = &[
    "table", "desk", "bench", "workbench", "counter", "bed", "sofa", "couch", "chair", "armchair", "stool", "nightstand",
    "stand", "sideboard", "dresser", "rug", "carpet", "mat", "sink",
];

/// On, inside or under by touching boxes.
pub(crate) fn contact(subject: &Object, object: &Object, config: &RelationConfig) -> Option<RelationKind> {
    let (s, o) = (&subject.bounds, &object.bounds);
    let (s_size, o_size) = (s.sides_m(), o.sides_m());
    let is_over = s.footprint_overlap(o) >= 0.5 && s_size.x * s_size.y <= 1.5 * o_size.x * o_size.y;
    if !is_over {
        return None;
    }
    if (s.min.z - o.max.z).abs() <= config.contact_m && s.center().z > o.center().z {
        return Some(RelationKind::On);
    }
    let is_within = o.inflated(0.05).contains(&s.min) && o.inflated(0.05).contains(&s.max);
    let is_open = OPEN.iter().any(|open| object.label == *open || object.label.ends_with(&format!(" {open}")));
    if is_open {
        // Chairs and sofas have backs, desks have screens: what rests on them lies within their box, above the middle.
        // What stands on the same floor beneath them lies within it too, below the top.
        let rests = s.min.z > o.center().z - 0.1 * o_size.z && s.min.z <= o.max.z;
        let is_beneath = s.center().z < o.center().z && s.max.z <= o.max.z - 0.05 && s_size.z < 0.9 * o_size.z;
        return if rests && subject.bounds.volume_m3() < object.bounds.volume_m3() {
            Some(RelationKind::On)
        } else if is_beneath && s.footprint_overlap(o) >= 0.6 {
            Some(RelationKind::Under)
        } else {
            None
        };
    }
    (is_within && s.volume_m3() <= 0.5 * o.volume_m3()).then_some(RelationKind::Inside)
}

/// Over the object (or over its edge: a picture hangs on the wall behind the sofa), with a gap.
pub(crate) fn is_above(subject: &Object, object: &Object, config: &RelationConfig) -> bool {
    const BEHIND_M: f64 = 0.25;
    let gap_m = subject.bounds.min.z - object.bounds.max.z;
    gap_m > config.contact_m
        && gap_m <= config.above_m
        && subject.bounds.footprint_overlap(&object.bounds.inflated(BEHIND_M)) >= 0.5
}
