//! Objects over time: what one frame shows becomes votes, points and captions of objects that persist.
//!
//! [`observe_objects`] reads like the paper's section: prepare the views, associate them with known objects, fold them in
//! (Eq. 4), join objects that turn out to be one, and divide those that turn out to be two. One frame is one batch: one revision.

use std::collections::BTreeMap;

use nalgebra::Point3;

use crate::associate::{View, associate};
use crate::attributes::attributes_of;
use crate::bounds::Aabb;
use crate::contact::hangs;
use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::memory::{ObjectMemory, Track, drift_m};
use crate::object::Object;
use crate::op::{ConfigError, Op, OpError};
use crate::vote::{add_votes, winner};

/// One thing seen in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectEvidence {
    /// When.
    pub stamp_ns: i64,
    /// Labels with their share of the points (any positive scale).
    pub label_weights: Vec<(String, f64)>,
    /// What the captioner says; may be empty.
    pub caption: String,
    /// The segmenter's score in `[0, 1]`: the weight of the frame in the vote.
    pub score: f32,
    /// Its points in the world frame.
    pub points: Vec<Point3<f32>>,
    /// Mean colour, if a camera saw it.
    pub color: Option<[u8; 3]>,
    /// The number of the thing in the segmenter's video, if it tracks. A hint: see [`AssociationConfig::track_s`].
    pub track: Option<u64>,
}

/// How views become objects.
#[derive(Debug, Clone, PartialEq)]
pub struct AssociationConfig {
    /// Whether frames vote for an object's label (Eq. 4); if not, the newest view decides. Default true.
    pub counts_votes: bool,
    /// Views with fewer finite points are skipped. Default 4.
    pub min_points: usize,
    /// Views below this score are skipped. Default 0.05.
    pub min_score: f32,
    /// Share of a view's points on an object of a like label that makes it a view of that object. Default 0.3.
    pub overlap: f64,
    /// The same where the labels have nothing in common: same place and size, whatever it is called. Default 0.6.
    pub blind_overlap: f64,
    /// How long a video number speaks for its object without a match by place and name. Default 3 s; 0 ignores numbers.
    /// Trackers switch and swap numbers, so numbers never tell two objects apart: they break ties, and they widen the
    /// gates for a view that place and name put nowhere and that lies on the object whose number it carries.
    pub track_s: f64,
    /// Matches by place and name in a row that make a number an object's. Default 3.
    pub track_run: u32,
    /// Share of a view's points on the object of its video number that makes it a view of that object whatever it is
    /// called. Default 0.4.
    pub track_overlap: f64,
    /// Distance below which a point lies on an object's points. Default 0.06 m.
    pub reach_m: f64,
    /// Centre distance allowed for small things between two frames, besides half their half side and the drift of the
    /// map frame. Default 0.06 m.
    pub center_gate_m: f64,
    /// Frames after which an object is believed. Default 3.
    pub confirm_observations: u32,
    /// Vote margin from which an object is believed. Default 0.2.
    pub confirm_margin: f64,
    /// Looks at the place of an unconfirmed object without seeing it again, after which it is forgotten. Default 8.
    pub ghost_looks: u32,
    /// Looks through the place of an object (nothing is there any more) after which it is forgotten. Default 6;
    /// unconfirmed objects go after a third.
    pub gone_looks: u32,
    /// Frames that showed an object as the same two pieces beside each other, after which it is two, if that is at least half
    /// of all frames that showed it. Default 6.
    pub split_frames: u32,
}

impl Default for AssociationConfig {
    fn default() -> AssociationConfig {
        AssociationConfig {
            counts_votes: true,
            min_points: 4,
            min_score: 0.05,
            overlap: 0.3,
            blind_overlap: 0.6,
            track_s: 3.0,
            track_run: 3,
            track_overlap: 0.4,
            reach_m: 0.06,
            center_gate_m: 0.06,
            confirm_observations: 3,
            confirm_margin: 0.2,
            ghost_looks: 8,
            gone_looks: 6,
            split_frames: 6,
        }
    }
}

impl AssociationConfig {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let error = |field, rule| Err(ConfigError { field, rule });
        if self.min_points == 0 {
            return error("min_points", "at least 1");
        }
        if self.split_frames == 0 {
            return error("split_frames", "at least 1");
        }
        for (field, share) in [
            ("overlap", self.overlap),
            ("blind_overlap", self.blind_overlap),
            ("track_overlap", self.track_overlap),
            ("confirm_margin", self.confirm_margin),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return error(field, "in [0, 1]");
            }
        }
        if !(self.track_s >= 0.0 && self.track_s.is_finite()) {
            return error("track_s", "not negative and finite");
        }
        for (field, length_m) in [("reach_m", self.reach_m), ("center_gate_m", self.center_gate_m)] {
            if !(length_m > 0.0 && length_m.is_finite()) {
                return error(field, "positive and finite");
            }
        }
        Ok(())
    }
}

/// What a frame did.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AssociationReport {
    /// For each piece of evidence the object it was found to show; `None` where it was skipped.
    pub object_of: Vec<Option<ObjectId>>,
    /// Objects that are new.
    pub created: Vec<ObjectId>,
    /// Objects that turned out to be others: (gone, stayed).
    pub merged: Vec<(ObjectId, ObjectId)>,
    /// Objects that turned out to be two: (stayed, new).
    pub split: Vec<(ObjectId, ObjectId)>,
    /// Evidence without enough finite points, score or labels.
    pub skipped: usize,
    /// The revision afterwards.
    pub revision: u64,
}

/// Folds what one frame shows into the graph's objects.
///
/// Association goes by place first: a view whose points lie on an object's points, or that is as near and as large as the
/// object, is that object even if the label differs (the vote decides the label); small things need a like label. Views of
/// one frame are different objects unless both lie on the same known one.
///
/// # Errors
/// A bad configuration; nothing else in practice, since views are checked and skipped at the door.
pub fn observe_objects(
    graph: &mut SceneGraph,
    evidence: &[ObjectEvidence],
    config: &AssociationConfig,
) -> Result<AssociationReport, OpError> {
    config.validate()?;
    let views: Vec<View> =
        evidence.iter().enumerate().filter_map(|(index, evidence)| View::new(index, evidence, config)).collect();
    let mut report = AssociationReport {
        object_of: vec![None; evidence.len()],
        skipped: evidence.len() - views.len(),
        ..AssociationReport::default()
    };
    recall(graph, &views);

    // Which view shows which object.
    let assigned = associate(graph, &views, config);

    // Fold the views into the objects.
    let mut touched: BTreeMap<ObjectId, Object> = BTreeMap::new();
    let mut next_id = graph.next_object_id();
    let mut seen_tracks: BTreeMap<u64, BTreeMap<ObjectId, i64>> = BTreeMap::new();
    for (view, known) in views.iter().zip(&assigned) {
        let id = known.map_or(next_id, |known| known.object);
        if known.is_none() {
            next_id.0 += 1;
            report.created.push(id);
        }
        let is_first_view_of_frame = !touched.contains_key(&id);
        let object = touched.entry(id).or_insert_with(|| graph.object(id).cloned().unwrap_or_else(|| unborn(id, view)));
        let memory = graph.memory.entry(id).or_default();
        fold(object, memory, view, is_first_view_of_frame, config);
        if let Some(track) = view.track
            && known.is_none_or(|known| !known.is_by_track)
        {
            // A match that rests on the number says nothing about the number.
            seen_tracks.entry(track).or_default().insert(id, view.stamp_ns);
        }
        report.object_of[view.index] = Some(id);
    }
    own_tracks(graph, &seen_tracks);
    for object in touched.values_mut() {
        object.place = graph.place_nearest(&object.centroid).map(|place| place.id);
        object.room = object.room.or_else(|| object.place.and_then(|place| graph.place(place)).and_then(|p| p.room));
    }
    let seen: Vec<ObjectId> = touched.keys().copied().collect();
    graph.apply(Op::Batch(touched.into_values().map(|object| Op::PutObject(Box::new(object))).collect()))?;

    // Objects that turn out to be one.
    crate::duplicates::note_apart(graph, &seen);
    report.merged = crate::duplicates::merge_duplicates(graph, &seen, config)?;
    for id in report.object_of.iter_mut().flatten() {
        while let Some((_, into)) = report.merged.iter().find(|(from, _)| from == id) {
            *id = *into;
        }
    }
    report.created.retain(|id| graph.object(*id).is_some());

    // Objects that turn out to be two.
    let mut views_of: BTreeMap<ObjectId, Vec<&View>> = BTreeMap::new();
    for view in &views {
        if let Some(id) = report.object_of[view.index] {
            views_of.entry(id).or_default().push(view);
        }
    }
    for (id, views) in &views_of {
        if let Some(memory) = graph.memory.get_mut(id) {
            crate::splits::note_cut(memory, views);
        }
    }
    let shown: Vec<ObjectId> = views_of.keys().copied().collect();
    report.split = crate::splits::split_pairs(graph, &shown, config)?;
    report.revision = graph.revision();
    Ok(report)
}

/// A number belongs to the object that was last seen under it, and to no other; one that two objects had in this frame
/// belongs to none. A thing that was cut into pieces in this frame was seen once.
fn own_tracks(graph: &mut SceneGraph, seen: &BTreeMap<u64, BTreeMap<ObjectId, i64>>) {
    for (number, holders) in seen {
        for (id, memory) in &mut graph.memory {
            match holders.get(id) {
                Some(&last_seen_ns) if holders.len() == 1 => {
                    memory.remember_track(*number, Track { last_seen_ns, run: 1 });
                }
                _ => {
                    memory.tracks.remove(number);
                }
            }
        }
    }
}

/// Gives a memory to every object near a view that has none, and drops memories of objects that are gone.
fn recall(graph: &mut SceneGraph, views: &[View]) {
    let SceneGraph { objects, memory, .. } = graph;
    memory.retain(|id, _| objects.contains_key(id));
    for object in objects.values() {
        let is_near = || views.iter().any(|view| view.bounds.gap_m(&object.bounds) < 1.0);
        if !memory.contains_key(&object.id) && is_near() {
            memory.insert(object.id, ObjectMemory::from_box(object));
        }
    }
}

fn unborn(id: ObjectId, view: &View) -> Object {
    Object {
        votes: BTreeMap::new(),
        observations: 0,
        confirmed: false,
        first_seen_ns: view.stamp_ns,
        last_seen_ns: view.stamp_ns,
        ..Object::new(id, "unknown", view.bounds)
    }
}

/// One view becomes part of an object.
fn fold(object: &mut Object, memory: &mut ObjectMemory, view: &View, is_first: bool, config: &AssociationConfig) {
    follow_drift(object, memory, view);
    memory.absorb(view.evidence_points, view.stamp_ns);
    object.first_seen_ns = object.first_seen_ns.min(view.stamp_ns);
    object.last_seen_ns = object.last_seen_ns.max(view.stamp_ns);
    memory.forget_smear(object.last_seen_ns);
    memory.looks = 0;
    memory.looks_through = 0;
    if let Some(bounds) = fitted_bounds(&object.label, memory) {
        object.bounds = bounds;
        object.centroid = bounds.center();
    }

    if !config.counts_votes {
        object.votes.clear();
    }
    // OmniVLN Eq. 4: one vote per frame, shared among the labels of its points, weighted by the score.
    add_votes(&mut object.votes, &view.labels, f64::from(view.score));
    (object.label, object.label_margin) = winner(&object.votes);
    object.observations = object.observations.saturating_add(u32::from(is_first));
    let looks = looks_wanted(object, config);
    object.confirmed = if object.confirmed {
        object.label_margin >= config.confirm_margin / 2.0 && object.observations >= looks
    } else {
        object.observations >= looks && object.label_margin >= config.confirm_margin
    };

    // A caption speaks for the label of its frame only: a wrong label comes with a wrong caption.
    let sharpness = (view.evidence_points.len() as f32 / 50.0).min(1.0);
    memory.remember_caption(view.top_label(), view.score * sharpness, view.caption);
    if let Some(color) = view.color {
        memory.remember_color(color);
    }
    object.caption = memory.caption(&object.label).unwrap_or_default().to_owned();
    object.color = memory.color();
    object.attributes = attributes_of(&object.caption, object.color);
}

/// The box of a thing of this name.
pub(crate) fn fitted_bounds(label: &str, memory: &ObjectMemory) -> Option<Aabb> {
    if hangs(label) { memory.flat_bounds() } else { memory.bounds() }
}

/// Frames after which an object is believed. A mask that bleeds over the edge of a thing paints a strip on the wall behind it:
/// thinner than anything that stands. A strip of a kind that does not hang on walls needs five times as many.
pub(crate) fn looks_wanted(object: &Object, config: &AssociationConfig) -> u32 {
    const THIN_M: f64 = 0.03;
    let sides_m = object.bounds.sides_m();
    let is_strip = sides_m.x.min(sides_m.y) < THIN_M && !hangs(&object.label);
    config.confirm_observations.saturating_mul(if is_strip { 5 } else { 1 })
}

/// An object that is seen again after a while, whole, and at a small distance from where it was: the map frame has drifted,
/// and what we remember moves along.
fn follow_drift(object: &Object, memory: &mut ObjectMemory, view: &View) {
    let age_s = (view.stamp_ns - object.last_seen_ns) as f64 * 1e-9;
    let by = view.bounds.center() - object.centroid;
    let (seen, known) = (view.bounds.sides_m(), object.bounds.sides_m());
    let is_whole = (0..3).all(|k| (seen[k] - known[k]).abs() <= 0.06_f64.max(0.25 * known[k]));
    if age_s > 5.0 && is_whole && by.norm() > 0.03 && by.norm() <= 0.1 + drift_m(age_s) {
        memory.shift(&by);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The upper face of a box, as points 2 cm apart.
    fn top(center: [f32; 3], sides: [f32; 2]) -> Vec<Point3<f32>> {
        let (columns, rows) = ((sides[0] / 0.02) as usize + 1, (sides[1] / 0.02) as usize + 1);
        let point = |i: usize| {
            let (u, v) = ((i % columns) as f32 * 0.02, (i / columns) as f32 * 0.02);
            Point3::new(center[0] - sides[0] / 2.0 + u, center[1] - sides[1] / 2.0 + v, center[2])
        };
        (0..columns * rows).map(point).collect()
    }

    fn view(frame: i64, label: &str, points: Vec<Point3<f32>>) -> ObjectEvidence {
        ObjectEvidence {
            stamp_ns: frame * 500_000_000,
            label_weights: vec![(label.to_owned(), 1.0)],
            caption: String::new(),
            score: 0.9,
            points,
            color: None,
            track: None,
        }
    }

    #[test]
    fn a_wrong_name_that_lasts_for_seconds_is_still_the_same_thing() {
        // Found by a simulated walk: half a coffee table, called a bench for 15 frames, became a believed bench.
        let mut graph = SceneGraph::new();
        let config = AssociationConfig::default();
        for frame in 0..20 {
            let table = view(frame, "coffee table", top([0.0, 0.0, 0.44], [1.0, 0.6]));
            observe_objects(&mut graph, &[table], &config).unwrap();
        }
        for frame in 20..35 {
            let bench = view(frame, "bench", top([-0.35, 0.0, 0.44], [0.3, 0.6]));
            observe_objects(&mut graph, &[bench], &config).unwrap();
        }
        let labels: Vec<&str> = graph.objects().map(|object| object.label.as_str()).collect();
        assert_eq!(labels, ["coffee table"]);
    }

    #[test]
    fn a_strip_on_a_wall_is_believed_late_and_a_picture_soon() {
        let config = AssociationConfig::default();
        let sheet: Vec<Point3<f32>> =
            (0..400).map(|i| Point3::new(0.0, 0.02 * (i % 20) as f32, 1.0 + 0.02 * (i / 20) as f32)).collect();
        let frames_until_believed = |label: &str| {
            let mut graph = SceneGraph::new();
            let mut is_believed = |frame: i64| {
                observe_objects(&mut graph, &[view(frame, label, sheet.clone())], &config).unwrap();
                graph.confirmed_objects().count() == 1
            };
            (1..=40).find(|frame| is_believed(*frame)).unwrap()
        };
        assert_eq!(frames_until_believed("picture"), 3);
        assert_eq!(frames_until_believed("workbench"), 15);
    }

    #[test]
    fn two_chairs_under_one_mask_are_two_once_they_are_seen_as_two() {
        let mut graph = SceneGraph::new();
        let config = AssociationConfig::default();
        let chair = |x: f32| top([x, 0.0, 0.45], [0.4, 0.4]);
        let both = [chair(-0.25), chair(0.25)].concat();
        for frame in 0..10 {
            observe_objects(&mut graph, &[view(frame, "chair", both.clone())], &config).unwrap();
        }
        assert_eq!(graph.objects().count(), 1);
        let mut split = Vec::new();
        for frame in 10..40 {
            // A glance now and then shows one of them only.
            let mut views = vec![view(frame, "chair", chair(-0.25)), view(frame, "chair", chair(0.25))];
            views.truncate(if frame % 7 == 0 { 1 } else { 2 });
            let report = observe_objects(&mut graph, &views, &config).unwrap();
            split.extend(report.split.into_iter().map(|pair| (frame, pair)));
        }
        let [(frame, (old, new))] = split[..] else { panic!("{split:?}") };
        assert!((20..30).contains(&frame) && old < new, "{split:?}");
        let mut chairs: Vec<&Object> = graph.confirmed_objects().collect();
        chairs.sort_by(|a, b| a.centroid.x.total_cmp(&b.centroid.x));
        assert_eq!(chairs.len(), 2);
        for (object, x) in chairs.iter().zip([-0.25, 0.25]) {
            assert!((object.centroid.x - x).abs() < 0.03 && object.bounds.sides_m().x < 0.45, "{object:?}");
        }
        graph.check_invariants().unwrap();
    }

    #[test]
    fn a_bench_that_a_segmenter_cuts_in_two_for_seconds_stays_one() {
        let mut graph = SceneGraph::new();
        let config = AssociationConfig::default();
        let piece = |x: f32| top([x, 0.0, 0.45], [0.7, 0.4]);
        let whole = [piece(-0.36), piece(0.36)].concat();
        for frame in 0..60 {
            let views = match frame % 20 {
                12..20 => vec![view(frame, "bench", piece(-0.36)), view(frame, "bench", piece(0.36))],
                _ => vec![view(frame, "bench", whole.clone())],
            };
            observe_objects(&mut graph, &views, &config).unwrap();
        }
        assert_eq!(graph.objects().count(), 1);
    }

    #[test]
    fn a_book_on_a_table_is_seen_beside_it_and_stays_a_book() {
        let mut graph = SceneGraph::new();
        let config = AssociationConfig::default();
        for frame in 0..30 {
            let table = view(frame, "coffee table", top([0.0, 0.0, 0.44], [1.0, 0.6]));
            let book = view(frame, "book", top([0.2, 0.1, 0.47], [0.2, 0.14]));
            observe_objects(&mut graph, &[table, book], &config).unwrap();
        }
        assert_eq!(graph.confirmed_objects().count(), 2);
    }
}
