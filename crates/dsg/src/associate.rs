//! Which view of a frame shows which known object.

use nalgebra::Point3;

use crate::bounds::Aabb;
use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::labels::label_similarity;
use crate::memory::{ObjectMemory, drift_m, robust_bounds, thin};
use crate::object::Object;
use crate::observe::{AssociationConfig, ObjectEvidence};

/// Labels at least this alike may be the same thing seen badly (look-alikes).
const LIKE: f64 = 0.5;
/// Labels at least this alike are the same word or nearly so.
const SAME: f64 = 0.75;
/// Points of a view that are compared with objects.
const SAMPLE: usize = 192;

/// One piece of evidence, checked and measured.
pub(crate) struct View<'a> {
    pub index: usize,
    pub stamp_ns: i64,
    pub labels: Vec<(String, f64)>,
    pub caption: &'a str,
    pub score: f32,
    pub color: Option<[u8; 3]>,
    pub track: Option<u64>,
    pub evidence_points: &'a [Point3<f32>],
    pub sample: Vec<Point3<f64>>,
    pub bounds: Aabb,
}

impl<'a> View<'a> {
    /// `None` for evidence with too few points, a NaN, no label or a low score.
    pub fn new(index: usize, evidence: &'a ObjectEvidence, config: &AssociationConfig) -> Option<View<'a>> {
        // Half a light second: voxel indices stay in range.
        const FAR_M: f32 = 1.0e7;
        let is_good = |p: &Point3<f32>| p.iter().all(|x| x.abs() < FAR_M);
        let score = evidence.score.min(1.0);
        let scored = !evidence.score.is_nan() && score >= config.min_score.max(f32::MIN_POSITIVE);
        if evidence.points.len() < config.min_points || !scored || !evidence.points.iter().all(is_good) {
            return None;
        }
        let total: f64 = evidence.label_weights.iter().map(|(_, w)| *w).filter(|w| w.is_finite() && *w > 0.0).sum();
        let mut labels: Vec<(String, f64)> = evidence
            .label_weights
            .iter()
            .filter(|(label, weight)| *weight > 0.0 && weight.is_finite() && !label.trim().is_empty())
            .map(|(label, weight)| (label.trim().to_lowercase(), weight / total))
            .collect();
        labels.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        if labels.is_empty() || !total.is_finite() {
            return None;
        }
        let sample = thin(&evidence.points, SAMPLE);
        let weighted: Vec<(Point3<f64>, f64)> = sample.iter().map(|point| (*point, 1.0)).collect();
        let bounds = robust_bounds(&weighted)?;
        Some(View {
            index,
            stamp_ns: evidence.stamp_ns,
            labels,
            caption: evidence.caption.trim(),
            score,
            color: evidence.color,
            track: evidence.track,
            evidence_points: &evidence.points,
            sample,
            bounds,
        })
    }

    /// The label with the largest share.
    pub fn top_label(&self) -> &str {
        &self.labels[0].0
    }
}

/// How well a view fits an object.
#[derive(Debug, Clone, Copy)]
struct Fit {
    /// Share of the view's points on the object's points.
    overlap: f64,
    /// 1 at the same centre, 0 at the gate and beyond.
    closeness: f64,
    /// Likeness of the labels.
    likeness: f64,
    /// Diagonal of the smaller over that of the larger.
    size_ratio: f64,
    /// Whether the frame may have drifted noticeably since the object was seen.
    is_stale: bool,
    /// Whether the view carries a video number that has proved to be this object's.
    is_tracked: bool,
}

/// The object that a view shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Match {
    pub object: ObjectId,
    /// Without the video number it would not have been a match.
    pub is_by_track: bool,
}

/// For each view the object it shows, `None` for a new one. Greedy by fit: deterministic, and as good as an optimal
/// assignment where gates are narrow.
pub(crate) fn associate(graph: &SceneGraph, views: &[View], config: &AssociationConfig) -> Vec<Option<Match>> {
    let mut fits: Vec<(f64, ObjectId, usize, Fit)> = Vec::new();
    for object in graph.objects() {
        let Some(memory) = graph.memory.get(&object.id).filter(|_| object.trajectory.is_empty()) else {
            continue;
        };
        for (at, view) in views.iter().enumerate() {
            if view.bounds.gap_m(&object.bounds) > 0.4 {
                continue;
            }
            let fit = fit(view, object, memory, config);
            if is_same_thing(&fit, config) {
                // The number breaks ties between neighbours; it weighs less than any of the others.
                let tracked = 0.1 * f64::from(u8::from(fit.is_tracked));
                let score = 0.5 * fit.overlap + 0.3 * fit.closeness + 0.2 * fit.likeness + tracked;
                fits.push((score, object.id, at, fit));
            } else if is_same_by_track(&fit, config) {
                // Only for a view that place and name put nowhere: behind all others.
                fits.push((fit.overlap - 1.0, object.id, at, fit));
            }
        }
    }
    fits.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));

    let mut object_of = vec![None; views.len()];
    let mut taken: Vec<ObjectId> = Vec::new();
    for (_, object, at, fit) in fits {
        // A segmenter may cut a thing in two: the second piece joins only if it lies on the thing as known before.
        let is_piece = fit.overlap >= 0.5 && (fit.likeness >= SAME || fit.is_tracked);
        if object_of[at].is_none() && (!taken.contains(&object) || is_piece) {
            object_of[at] = Some(Match { object, is_by_track: !is_same_thing(&fit, config) });
            taken.push(object);
        }
    }
    object_of
}

fn is_same_thing(fit: &Fit, config: &AssociationConfig) -> bool {
    if fit.likeness >= SAME {
        return fit.overlap >= config.overlap || fit.closeness > 0.0;
    }
    if fit.likeness >= LIKE {
        return fit.overlap >= config.overlap.max(0.4) || fit.closeness >= 0.5;
    }
    // The label says nothing. Same points and about the same size: the same thing, called by another name. A book on a
    // table lies near the table's points too, but is much smaller.
    let on_it = fit.overlap >= config.blind_overlap && fit.size_ratio >= 0.5;
    let in_its_place = fit.is_stale && fit.closeness >= 0.5 && fit.size_ratio >= 0.7;
    on_it || in_its_place
}

/// The number of the video says it, and the place does not speak against it. The book on a table may have got the
/// table's number by a switch, so a view that is called otherwise must not be much smaller.
fn is_same_by_track(fit: &Fit, config: &AssociationConfig) -> bool {
    let lies_on_it = fit.overlap >= config.track_overlap && fit.size_ratio >= 0.3;
    fit.is_tracked && (lies_on_it || (fit.likeness >= LIKE && fit.closeness > 0.0))
}

fn fit(view: &View, object: &Object, memory: &ObjectMemory, config: &AssociationConfig) -> Fit {
    let age_s = (view.stamp_ns - object.last_seen_ns).max(0) as f64 * 1e-9;
    let half_side = |bounds: &Aabb| bounds.sides_m().x.max(bounds.sides_m().y) / 2.0;
    let smaller = half_side(&view.bounds).min(half_side(&object.bounds));
    let gate_m = config.center_gate_m + 0.5 * smaller + drift_m(age_s);
    let distance_m = (view.bounds.center() - object.centroid).norm();
    let (a, b) = (view.bounds.diagonal_m(), object.bounds.diagonal_m());
    Fit {
        overlap: memory.overlap(&view.sample, config.reach_m),
        closeness: (1.0 - distance_m / gate_m).max(0.0),
        likeness: likeness(&view.labels, object),
        size_ratio: (a.min(b) + 0.02) / (a.max(b) + 0.02),
        is_stale: age_s > 10.0,
        is_tracked: view.track.and_then(|number| memory.tracks.get(&number)).is_some_and(|track| {
            let age_s = (view.stamp_ns - track.last_seen_ns) as f64 * 1e-9;
            track.run >= config.track_run && age_s < config.track_s
        }),
    }
}

/// Likeness of the view's labels and the object's votes: that of the two winners, or the mean over both distributions if
/// that is higher.
fn likeness(labels: &[(String, f64)], object: &Object) -> f64 {
    let winners = label_similarity(&labels[0].0, &object.label);
    if winners >= SAME {
        return winners;
    }
    let total: f64 = object.votes.values().sum();
    if total <= 0.0 {
        return winners;
    }
    let mean: f64 = labels
        .iter()
        .flat_map(|(label, share)| {
            object.votes.iter().map(move |(voted, votes)| share * votes / total * label_similarity(label, voted))
        })
        .sum();
    winners.max(mean)
}
