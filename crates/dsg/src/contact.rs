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

/// Things that hang on walls: flat, without a foot.
#[rustfmt::skip]
const HUNG: &[&str] = &[
    "picture", "painting", "poster", "photo", "mirror", "clock", "window", "whiteboard", "blackboard", "board", "map", "sign",
    "screen", "towel", "radiator", "curtain", "blind", "door", "switch", "calendar",
];

/// Whether a thing of this name hangs on a wall or is part of it.
pub(crate) fn hangs(label: &str) -> bool {
    label != "alarm clock" && label.rsplit(' ').next().is_some_and(|last| HUNG.contains(&last))
}

/// Things that hold others within them; within the box of anything else a thing is only so by an error of the boxes.
#[rustfmt::skip]
const CONTAINERS: &[&str] = &[
    "shelf", "bookshelf", "bookcase", "rack", "cabinet", "cupboard", "wardrobe", "closet", "drawer", "drawers", "box", "crate",
    "basket", "bin", "can", "bag", "fridge", "refrigerator", "freezer", "oven", "microwave", "dishwasher", "machine", "dryer",
    "bathtub", "bowl", "vase", "pot", "toolbox", "suitcase", "backpack", "showcase", "case", "locker", "cart",
];

fn can_contain(label: &str) -> bool {
    label.rsplit(' ').next().is_some_and(|last| CONTAINERS.contains(&last))
}

/// On, inside or under by touching boxes.
pub(crate) fn contact(subject: &Object, object: &Object, config: &RelationConfig) -> Option<RelationKind> {
    let (s, o) = (&subject.bounds, &object.bounds);
    let (s_size, o_size) = (s.sides_m(), o.sides_m());
    let is_over = s.footprint_overlap(o) >= 0.5 && s_size.x * s_size.y <= 1.5 * o_size.x * o_size.y;
    if !is_over {
        return None;
    }
    let is_on_top = (s.min.z - o.max.z).abs() <= config.contact_m && s.center().z > o.center().z;
    // A window begins where the desk before it ends, and rests on nothing.
    if is_on_top && !hangs(&subject.label) {
        return Some(RelationKind::On);
    }
    let is_within = o.inflated(0.05).contains(&s.min) && o.inflated(0.05).contains(&s.max);
    let is_open = object.label.rsplit(' ').next().is_some_and(|last| OPEN.contains(&last));
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
    (is_within && can_contain(&object.label) && s.volume_m3() <= 0.5 * o.volume_m3()).then_some(RelationKind::Inside)
}

/// Over the object (or over its edge: a picture hangs on the wall behind the sofa), with a gap. `bottom_m` is where the subject
/// begins, feet that were not seen and all.
pub(crate) fn is_above(subject: &Object, bottom_m: f64, object: &Object, config: &RelationConfig) -> bool {
    const BEHIND_M: f64 = 0.25;
    let gap_m = bottom_m - object.bounds.max.z;
    gap_m > config.contact_m
        && gap_m <= config.above_m
        && subject.bounds.footprint_overlap(&object.bounds.inflated(BEHIND_M)) >= 0.5
}
