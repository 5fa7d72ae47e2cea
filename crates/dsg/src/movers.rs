//! Things that move by themselves: a person seen here and then there is one object with a trajectory, present from when to when.
//!
//! What stands still is recognised by its points ([`crate::observe`]); what moves is recognised by where it can have gone since. A
//! view belongs to the mover whose expected place it is nearest to, within the reach of its greatest speed; a video number that
//! the mover had a moment ago decides between two. After an absence it is the same one only if it could have walked there.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};

use crate::bounds::Aabb;
use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::labels::label_similarity;
use crate::object::Object;
use crate::op::{ConfigError, Op, OpError};
use crate::presence::{TrackPoint, extend};
use crate::vote::{add_votes, winner};

/// The number a mover was last seen under, in the object's metadata.
const TRACK: &str = "track";

/// A moving thing seen in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct MoverEvidence {
    /// When.
    pub stamp_ns: i64,
    /// What the segmenter calls it.
    pub label: String,
    /// The segmenter's score in `[0, 1]`.
    pub score: f32,
    /// Box around its points, world frame.
    pub bounds: Aabb,
    /// The number of the thing in the segmenter's video, if it tracks.
    pub track: Option<u64>,
}

/// How views become movers.
#[derive(Debug, Clone, PartialEq)]
pub struct MoverConfig {
    /// Greatest speed, default 2.5 m/s.
    pub max_speed_m_s: f64,
    /// Error of a middle, default 0.35 m: a person is seen from one side at a time.
    pub gate_m: f64,
    /// Unseen for longer it was away: a new stretch of presence. Default 5 s.
    pub away_s: f64,
    /// Unseen for longer it is somebody else. Default 30 s.
    pub forget_s: f64,
    /// Views from which a mover is believed. Default 3.
    pub confirm_observations: u32,
    /// Points of a trajectory; above, every other older one goes. Default 4096.
    pub max_points: usize,
}

impl Default for MoverConfig {
    fn default() -> MoverConfig {
        MoverConfig {
            max_speed_m_s: 2.5,
            gate_m: 0.35,
            away_s: 5.0,
            forget_s: 30.0,
            confirm_observations: 3,
            max_points: 4096,
        }
    }
}

impl MoverConfig {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let lengths = [
            ("max_speed_m_s", self.max_speed_m_s),
            ("gate_m", self.gate_m),
            ("away_s", self.away_s),
            ("forget_s", self.forget_s),
        ];
        for (field, value) in lengths {
            if !(value > 0.0 && value < 1e6) {
                return Err(ConfigError { field, rule: "positive and finite" });
            }
        }
        if self.max_points < 2 {
            return Err(ConfigError { field: "max_points", rule: "at least 2" });
        }
        Ok(())
    }
}

/// Folds the movers of one frame into the graph; for each view the object it shows, `None` where a view has no sound box, no label or
/// no score.
///
/// # Errors
/// A bad configuration.
pub fn observe_movers(
    graph: &mut SceneGraph,
    evidence: &[MoverEvidence],
    config: &MoverConfig,
) -> Result<Vec<Option<ObjectId>>, OpError> {
    config.validate()?;
    let is_sound = |view: &MoverEvidence| {
        view.bounds.is_valid() && !view.label.trim().is_empty() && (0.0..=1.0).contains(&view.score) && view.score > 0.0
    };
    // Nearest first; each view and each mover once.
    let mut pairs: Vec<(bool, f64, usize, ObjectId)> = Vec::new();
    for (index, view) in evidence.iter().enumerate().filter(|(_, view)| is_sound(view)) {
        for object in graph.objects().filter(|object| !object.trajectory.is_empty()) {
            if let Some(distance_m) = distance_m(object, view, config) {
                let is_number = view.track.is_some() && number_of(object) == view.track;
                pairs.push((!is_number, distance_m, index, object.id));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then((a.2, a.3).cmp(&(b.2, b.3))));
    let mut assigned: BTreeMap<usize, ObjectId> = BTreeMap::new();
    let mut taken: BTreeSet<ObjectId> = BTreeSet::new();
    for (_, _, index, id) in pairs {
        if !assigned.contains_key(&index) && taken.insert(id) {
            assigned.insert(index, id);
        }
    }
    let mut next = graph.next_object_id();
    let mut shown = vec![None; evidence.len()];
    let mut ops = Vec::new();
    for (index, view) in evidence.iter().enumerate().filter(|(_, view)| is_sound(view)) {
        let known = assigned.get(&index).and_then(|id| graph.object(*id)).cloned();
        let object = known.unwrap_or_else(|| {
            let id = next;
            next.0 += 1;
            unborn(id, view)
        });
        shown[index] = Some(object.id);
        ops.push(Op::PutObject(Box::new(folded(graph, object, view, config))));
    }
    graph.apply(Op::Batch(ops))?;
    Ok(shown)
}

/// Takes out of the graph whoever was last seen so long before `now_ns` that nobody could know him again ([`MoverConfig::forget_s`]); returns
/// how many those were. Where they had been is in the log of operations.
///
/// # Errors
/// A bad configuration.
pub fn forget_movers(graph: &mut SceneGraph, now_ns: i64, config: &MoverConfig) -> Result<usize, OpError> {
    config.validate()?;
    let forget_ns = (config.forget_s * 1e9) as i64;
    let is_gone = |object: &&Object| {
        object.trajectory.last().is_some_and(|last| now_ns.saturating_sub(last.stamp_ns) > forget_ns)
    };
    let gone: Vec<Op> = graph.objects().filter(is_gone).map(|object| Op::RemoveObject(object.id)).collect();
    let count = gone.len();
    if count > 0 {
        graph.apply(Op::Batch(gone))?;
    }
    Ok(count)
}

fn unborn(id: ObjectId, view: &MoverEvidence) -> Object {
    Object {
        votes: BTreeMap::new(),
        observations: 0,
        confirmed: false,
        first_seen_ns: view.stamp_ns,
        last_seen_ns: view.stamp_ns,
        ..Object::new(id, &view.label, view.bounds)
    }
}

fn number_of(object: &Object) -> Option<u64> {
    object.metadata.get(TRACK)?.as_u64()
}

/// How far a view is from where a mover is expected; `None` if it cannot be there or is another kind of thing.
fn distance_m(object: &Object, view: &MoverEvidence, config: &MoverConfig) -> Option<f64> {
    let last = object.trajectory.last()?;
    let away_s = (view.stamp_ns - last.stamp_ns) as f64 * 1e-9;
    if !(away_s > 0.0 && away_s <= config.forget_s) || label_similarity(&object.label, &view.label) < 0.5 {
        return None;
    }
    let at = view.bounds.center();
    let walked_m = (at - last.position).norm();
    if walked_m > config.gate_m + config.max_speed_m_s * away_s {
        return None;
    }
    // Its pace goes on for a second or so, not for ever.
    let expected = last.position + velocity_m_s(object, config) * away_s.min(1.0);
    Some((at - expected).norm())
}

/// Velocity of a mover over the last half second or the last two points of its trajectory, world frame, at most as fast as movers are;
/// zero for what has fewer points.
pub fn velocity_m_s(object: &Object, config: &MoverConfig) -> Vector3<f64> {
    let Some((last, before)) = object.trajectory.split_last() else {
        return Vector3::zeros();
    };
    let earlier = before.iter().rev().find(|point| last.stamp_ns - point.stamp_ns >= 500_000_000).or(before.last());
    let Some(earlier) = earlier.filter(|point| last.stamp_ns > point.stamp_ns) else {
        return Vector3::zeros();
    };
    let seconds = (last.stamp_ns - earlier.stamp_ns) as f64 * 1e-9;
    ((last.position - earlier.position) / seconds).cap_magnitude(config.max_speed_m_s)
}

/// A view becomes part of a mover.
fn folded(graph: &SceneGraph, mut object: Object, view: &MoverEvidence, config: &MoverConfig) -> Object {
    let position: Point3<f64> = view.bounds.center();
    add_votes(&mut object.votes, &[(view.label.clone(), 1.0)], f64::from(view.score));
    (object.label, object.label_margin) = winner(&object.votes);
    object.observations = object.observations.saturating_add(1);
    object.confirmed |= object.observations >= config.confirm_observations;
    object.first_seen_ns = object.first_seen_ns.min(view.stamp_ns);
    object.last_seen_ns = object.last_seen_ns.max(view.stamp_ns);
    extend(&mut object.presence, view.stamp_ns, (config.away_s * 1e9) as i64);
    object.trajectory.push(TrackPoint { stamp_ns: view.stamp_ns, position });
    if object.trajectory.len() > config.max_points {
        // The newer half stays as it is.
        let half = object.trajectory.len() / 2;
        let mut index = 0;
        object.trajectory.retain(|_| {
            index += 1;
            index > half || index % 2 == 1
        });
    }
    (object.bounds, object.centroid) = (view.bounds, position);
    let place = graph.place_nearest(&position);
    object.place = place.map(|place| place.id);
    object.room = place.and_then(|place| place.room);
    match view.track {
        Some(number) => drop(object.metadata.insert(TRACK.into(), number.into())),
        None => drop(object.metadata.remove(TRACK)),
    }
    object
}
