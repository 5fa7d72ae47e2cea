//! Objects of the graph against the things of the building: who is whom, by place alone; then names, doubles and distances.
//!
//! Both boxes are grown by 5 cm on every side (a box is measured to about a voxel), and their intersection over union is the
//! weight of the pair; pairs below 0.1 are none. The best one-to-one choice says who is whom, whatever the names. A graph
//! object that is left over and lies on a thing that is taken is a double of it, otherwise a false alarm; both are wrong.

use std::collections::{BTreeMap, BTreeSet};

use mission::dsg::ObjectId;
use nalgebra::Vector3;
use omni_sim::building::{Bounds, ObjectTruth};
use serde::Serialize;

use super::assign::assign;
use super::ratio::{Ratio, Spread};

/// Only things with at least so many LiDAR points count for recall.
pub const SEEN_POINTS: u64 = 30;
/// Boxes are grown by this before they are compared.
const SLACK_M: f64 = 0.05;
/// Least intersection over union of a pair.
const LEAST_IOU: f64 = 0.1;

/// A confirmed object of the graph, in the coordinates of the building.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// In the graph.
    pub id: ObjectId,
    /// Its name there.
    pub label: String,
    /// Its box.
    pub bounds: Bounds,
}

/// Figures of layer 2.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ObjectFigures {
    /// Things in the building.
    pub things: usize,
    /// Of the graph's confirmed objects, those that are a thing, each thing once, whatever the name.
    pub precision: Ratio,
    /// ... and have its name.
    pub precision_with_label: Ratio,
    /// Of the things with at least [`SEEN_POINTS`] LiDAR points, those that are in the graph.
    pub recall: Ratio,
    /// ... under their name.
    pub recall_with_label: Ratio,
    /// Of the things in the graph, those with more than one object on them.
    pub duplicates: Ratio,
    /// Of the objects that are a thing, those with its name.
    pub label_accuracy: Ratio,
    /// Distances between the middles of the boxes of an object and its thing.
    pub centroid_error_m: Spread,
}

impl ObjectFigures {
    /// Of several buildings.
    pub fn pooled<'a>(all: impl Iterator<Item = &'a ObjectFigures> + Clone) -> ObjectFigures {
        let ratio = |pick: fn(&ObjectFigures) -> Ratio| Ratio::pooled(all.clone().map(pick));
        ObjectFigures {
            things: all.clone().map(|figures| figures.things).sum(),
            precision: ratio(|f| f.precision),
            precision_with_label: ratio(|f| f.precision_with_label),
            recall: ratio(|f| f.recall),
            recall_with_label: ratio(|f| f.recall_with_label),
            duplicates: ratio(|f| f.duplicates),
            label_accuracy: ratio(|f| f.label_accuracy),
            centroid_error_m: Spread::pooled(all.clone().map(|f| &f.centroid_error_m)),
        }
    }
}

/// Who is whom.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Matching {
    /// For each thing the object that is it: indices into the two lists.
    pub known_of_thing: Vec<Option<usize>>,
    /// Objects that are doubles: (object, thing).
    pub doubles: Vec<(usize, usize)>,
    /// Objects where nothing is.
    pub nowhere: Vec<usize>,
}

impl Matching {
    /// Finds it.
    pub fn of(known: &[Known], things: &[ObjectTruth]) -> Matching {
        let overlap = |thing: &ObjectTruth, object: &Known| iou(&grown(&thing.bounds), &grown(&object.bounds));
        let weights: Vec<Vec<f64>> = things
            .iter()
            .map(|thing| known.iter().map(|object| Some(overlap(thing, object)).filter(|iou| *iou >= LEAST_IOU)))
            .map(|row| row.map(|iou| iou.unwrap_or(0.0)).collect())
            .collect();
        let known_of_thing = assign(&weights);
        let matched: BTreeSet<usize> = known_of_thing.iter().flatten().copied().collect();
        let (mut doubles, mut nowhere) = (Vec::new(), Vec::new());
        for index in (0..known.len()).filter(|index| !matched.contains(index)) {
            match lies_on(&known[index], things, &known_of_thing, &weights, index) {
                Some(thing) => doubles.push((index, thing)),
                None => nowhere.push(index),
            }
        }
        Matching { known_of_thing, doubles, nowhere }
    }

    /// The thing that each matched object is, as an index.
    pub fn thing_of(&self, known: &[Known]) -> BTreeMap<ObjectId, usize> {
        let pairs = self.known_of_thing.iter().enumerate();
        pairs.filter_map(|(thing, object)| Some((known[(*object)?].id, thing))).collect()
    }
}

/// The taken thing that a left-over object lies on: the one it overlaps most as a pair, or one of its name around its middle.
fn lies_on(
    object: &Known,
    things: &[ObjectTruth],
    known_of_thing: &[Option<usize>],
    weights: &[Vec<f64>],
    index: usize,
) -> Option<usize> {
    let taken = || (0..things.len()).filter(|thing| known_of_thing[*thing].is_some());
    let by_overlap = taken().filter(|thing| weights[*thing][index] > 0.0);
    let middle = object.bounds.center();
    let is_around = |thing: &usize| {
        things[*thing].class == object.label && things[*thing].bounds.distance_m(&middle) <= 2.0 * SLACK_M
    };
    by_overlap
        .max_by(|a, b| weights[*a][index].total_cmp(&weights[*b][index]).then(b.cmp(a)))
        .or_else(|| taken().find(is_around))
}

/// The figures; `points_on` are the LiDAR points that each instance got.
pub fn object_figures(
    known: &[Known],
    things: &[ObjectTruth],
    matching: &Matching,
    points_on: &BTreeMap<u32, u64>,
) -> ObjectFigures {
    let pairs: Vec<(&ObjectTruth, Option<&Known>)> =
        std::iter::zip(things, matching.known_of_thing.iter().map(|known_at| known_at.map(|at| &known[at]))).collect();
    let is_named = |thing: &ObjectTruth, object: &Known| thing.class == object.label;
    let matched = || pairs.iter().filter_map(|(thing, object)| Some((*thing, (*object)?)));
    let named = matched().filter(|(thing, object)| is_named(thing, object)).count();
    let is_seen = |thing: &ObjectTruth| points_on.get(&thing.id).copied().unwrap_or(0) >= SEEN_POINTS;
    let seen = || pairs.iter().filter(|(thing, _)| is_seen(thing));
    let doubled: BTreeSet<usize> = matching.doubles.iter().map(|(_, thing)| *thing).collect();
    ObjectFigures {
        things: things.len(),
        precision: Ratio::new(matched().count(), known.len()),
        precision_with_label: Ratio::new(named, known.len()),
        recall: Ratio::counted(seen().map(|(_, object)| object.is_some())),
        recall_with_label: Ratio::counted(
            seen().map(|(thing, object)| object.is_some_and(|object| is_named(thing, object))),
        ),
        duplicates: Ratio::new(doubled.len(), matched().count()),
        label_accuracy: Ratio::new(named, matched().count()),
        centroid_error_m: Spread::of(
            matched().map(|(thing, object)| (thing.bounds.center() - object.bounds.center()).norm()),
        ),
    }
}

fn grown(bounds: &Bounds) -> Bounds {
    let slack = Vector3::repeat(SLACK_M);
    Bounds { min: bounds.min - slack, max: bounds.max + slack }
}

/// Volume of what two boxes share over the volume of what they cover.
pub fn iou(a: &Bounds, b: &Bounds) -> f64 {
    let volume = |bounds: &Bounds| (bounds.max - bounds.min).product();
    let shared = (0..3).map(|k| (a.max[k].min(b.max[k]) - a.min[k].max(b.min[k])).max(0.0)).product::<f64>();
    let both = volume(a) + volume(b) - shared;
    if both > 0.0 { shared / both } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map_score::test_things::thing;
    use nalgebra::Point3;

    fn known(id: u64, label: &str, center: [f64; 3], side_m: f64) -> Known {
        let (center, half) = (Point3::from(center), Vector3::repeat(side_m / 2.0));
        Known { id: ObjectId(id), label: label.into(), bounds: Bounds { min: center - half, max: center + half } }
    }

    fn figures(known: &[Known], things: &[ObjectTruth], points: u64) -> ObjectFigures {
        let points_on = things.iter().map(|thing| (thing.id, points)).collect();
        object_figures(known, things, &Matching::of(known, things), &points_on)
    }

    #[test]
    fn half_of_a_cube_beside_itself() {
        let cube = |x: f64| known(0, "box", [x, 0.0, 0.0], 1.0).bounds;
        assert!((iou(&cube(0.0), &cube(0.5)) - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(iou(&cube(0.0), &cube(2.0)), 0.0);
    }

    #[test]
    fn right_wrong_name_double_false_alarm_and_missed_by_hand() {
        let things = [
            thing(1, "chair", [0.0, 0.0, 0.5], 0.5),
            thing(2, "stool", [3.0, 0.0, 0.5], 0.5),
            thing(3, "mug", [6.0, 0.0, 0.5], 0.1),
        ];
        let graph = [
            known(10, "chair", [0.03, 0.04, 0.5], 0.5),
            known(11, "chair", [0.2, 0.0, 0.5], 0.3),
            known(12, "side table", [3.0, 0.0, 0.5], 0.5),
            known(13, "stool", [9.0, 9.0, 0.5], 0.5),
        ];
        let found = figures(&graph, &things, 30);
        assert_eq!(found.precision, Ratio::new(2, 4));
        assert_eq!(found.precision_with_label, Ratio::new(1, 4));
        assert_eq!(found.recall, Ratio::new(2, 3));
        assert_eq!(found.recall_with_label, Ratio::new(1, 3));
        assert_eq!(found.duplicates, Ratio::new(1, 2));
        assert_eq!(found.label_accuracy, Ratio::new(1, 2));
        assert!((found.centroid_error_m.all[1] - 0.05).abs() < 1e-12);
        // What hardly a ray met need not be known, but does not make the known ones wrong.
        let hardly = figures(&graph, &things, 29);
        assert_eq!((hardly.recall.of, hardly.precision.hits), (0, 2));
    }

    #[test]
    fn two_books_side_by_side_are_two_and_a_mug_is_not_its_table() {
        let things = [thing(1, "book", [0.0, 0.0, 0.5], 0.2), thing(2, "book", [0.21, 0.0, 0.5], 0.2)];
        let graph = [known(1, "book", [0.02, 0.0, 0.5], 0.2), known(2, "book", [0.22, 0.0, 0.5], 0.2)];
        assert_eq!(Matching::of(&graph, &things).known_of_thing, [Some(0), Some(1)]);
        let table = [thing(1, "table", [0.0, 0.0, 0.5], 1.0)];
        let mug = [known(1, "mug", [0.0, 0.0, 0.9], 0.1)];
        assert_eq!(Matching::of(&mug, &table).nowhere, [0]);
    }
}
