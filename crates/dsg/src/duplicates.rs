//! Objects that turn out to be one, and objects that turn out to be nothing.

use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::labels::label_similarity;
use crate::memory::{ObjectMemory, drift_m};
use crate::object::Object;
use crate::observe::{AssociationConfig, fitted_bounds, looks_wanted};
use crate::op::{Op, OpError};
use crate::vote::winner;

/// Frames that showed two neighbours as two things, after which nearness alone does not make them one.
const APART_FRAMES: u32 = 3;

/// Counts, for each pair of neighbours seen in one frame, that they were two.
pub(crate) fn note_apart(graph: &mut SceneGraph, seen: &[ObjectId]) {
    for (at, &a) in seen.iter().enumerate() {
        for &b in &seen[at + 1..] {
            let near = match (graph.object(a), graph.object(b)) {
                (Some(first), Some(second)) => first.bounds.gap_m(&second.bounds) < 0.3,
                _ => false,
            };
            if near {
                note_seen_as_two(graph, a, b, 1);
            }
        }
    }
}

/// So many frames showed them as two.
pub(crate) fn note_seen_as_two(graph: &mut SceneGraph, a: ObjectId, b: ObjectId, frames: u32) {
    if let Some(memory) = graph.memory.get_mut(&a.min(b)) {
        *memory.apart.entry(a.max(b)).or_insert(0) += frames;
    }
}

/// Joins each object of `seen` with neighbours that are the same thing; the smaller id stays. Returns (gone, stayed).
pub(crate) fn merge_duplicates(
    graph: &mut SceneGraph,
    seen: &[ObjectId],
    config: &AssociationConfig,
) -> Result<Vec<(ObjectId, ObjectId)>, OpError> {
    let mut merged = Vec::new();
    for &id in seen {
        // Each merge removes one object, so this ends.
        while let Some(other) = duplicate_of(graph, id, config) {
            let (from, into) = (id.max(other), id.min(other));
            merge(graph, from, into, config)?;
            merged.push((from, into));
            if from == id {
                break;
            }
        }
    }
    Ok(merged)
}

fn duplicate_of(graph: &SceneGraph, id: ObjectId, config: &AssociationConfig) -> Option<ObjectId> {
    let object = graph.object(id)?;
    let near = graph.objects().filter(|other| other.id != id && other.bounds.gap_m(&object.bounds) < 0.3);
    near.filter(|other| is_duplicate(graph, object, other, config)).map(|other| other.id).next()
}

fn is_duplicate(graph: &SceneGraph, a: &Object, b: &Object, config: &AssociationConfig) -> bool {
    let (small, large) = if a.bounds.diagonal_m() <= b.bounds.diagonal_m() { (a, b) } else { (b, a) };
    let (Some(small_memory), Some(large_memory)) = (graph.memory.get(&small.id), graph.memory.get(&large.id)) else {
        return false;
    };
    let likeness = label_similarity(&a.label, &b.label);
    let apart = graph.memory.get(&a.id.min(b.id)).and_then(|memory| memory.apart.get(&a.id.max(b.id))).copied();
    let apart = apart.unwrap_or(0);
    let overlap = || large_memory.overlap(&small_memory.points(), config.reach_m);
    let is_tentative = !small.confirmed || !large.confirmed;
    let size_ratio = (small.bounds.diagonal_m() + 0.02) / (large.bounds.diagonal_m() + 0.02);
    if likeness >= 0.5 {
        // Nearly all points of one lie on the other: a piece of it, however often both were seen.
        // Look-alikes that are both believed need to be of one size: a side table under a table is small.
        if overlap() >= 0.7 && (likeness >= 0.75 || is_tentative || size_ratio >= 0.5) {
            return true;
        }
        // Never seen as two, and at most the drift apart: one thing, seen before and after the drift.
        let both_sides = a.bounds.intersection(&b.bounds).map_or(0.0, |both| both.volume_m3());
        let contained = both_sides / small.bounds.volume_m3().max(1e-6);
        let age_s = (a.last_seen_ns.max(b.last_seen_ns) - a.last_seen_ns.min(b.last_seen_ns)) as f64 * 1e-9;
        let sides_m = small.bounds.sides_m();
        let moved_m = (a.centroid - b.centroid).norm();
        let gate_m = 0.3 * sides_m.x.max(sides_m.y) / 2.0 + 0.7 * drift_m(age_s);
        return apart < APART_FRAMES && (contained >= 0.6 || (size_ratio >= 0.6 && moved_m <= gate_m));
    }
    // Other names. Two things cannot fill the same space, and two things that lie in one view are seen as two sooner or
    // later: what coincides in points and was never seen beside the other is a wrong name for it. A wrong name may last
    // for seconds, so its being believed is no argument.
    let is_same_size = size_ratio >= 0.5 && apart < APART_FRAMES;
    let is_part = apart == 0 && small.observations.min(large.observations) >= config.confirm_observations;
    (is_same_size || is_part) && overlap() >= 0.8
}

fn merge(graph: &mut SceneGraph, from: ObjectId, into: ObjectId, config: &AssociationConfig) -> Result<(), OpError> {
    graph.apply(Op::MergeObjects { from, into })?;
    if let Some(gone) = graph.memory.remove(&from) {
        graph.memory.entry(into).or_default().merge(gone);
    }
    let SceneGraph { objects, memory, .. } = graph;
    let (Some(object), Some(memory)) = (objects.get(&into), memory.get_mut(&into)) else {
        return Ok(());
    };
    memory.apart.remove(&from);
    memory.apart.remove(&into);
    memory.forget_smear(object.last_seen_ns);
    let mut object = Object::clone(object);
    let is_confirmed = object.confirmed;
    refit(&mut object, memory, config);
    object.confirmed |= is_confirmed;
    graph.apply(Op::PutObject(Box::new(object)))?;
    Ok(())
}

/// Name, box, caption and colour as votes and memory say them now.
pub(crate) fn refit(object: &mut Object, memory: &ObjectMemory, config: &AssociationConfig) {
    (object.label, object.label_margin) = winner(&object.votes);
    if let Some(bounds) = fitted_bounds(&object.label, memory) {
        object.bounds = bounds;
        object.centroid = bounds.center();
    }
    if let Some(caption) = memory.caption(&object.label) {
        object.caption = caption.to_owned();
    }
    object.color = memory.color().or(object.color);
    object.attributes = crate::attributes::attributes_of(&object.caption, object.color);
    object.confirmed =
        object.observations >= looks_wanted(object, config) && object.label_margin >= config.confirm_margin;
}

/// Removes objects that are not there: false alarms that were seen once or twice and not again although looked at, and
/// things that have been taken away. Returns their ids.
///
/// Call it once per frame of the camera, after [`crate::observe_objects`]. `seen_through` says of an object's place: `None` not
/// looked at in this frame (out of range or hidden), `Some(false)` looked at and something is there, `Some(true)` looked at
/// and the view goes through it. Objects seen in the frame itself (`last_seen_ns >= now_ns`) are not asked about.
///
/// # Errors
/// A bad configuration.
pub fn forget_ghosts(
    graph: &mut SceneGraph,
    now_ns: i64,
    seen_through: &dyn Fn(&Object) -> Option<bool>,
    config: &AssociationConfig,
) -> Result<Vec<ObjectId>, OpError> {
    config.validate()?;
    let mut gone = Vec::new();
    let SceneGraph { objects, memory, .. } = graph;
    for object in objects.values() {
        // A mover that is not where it was has walked on.
        if object.last_seen_ns >= now_ns || object.is_dynamic() {
            continue;
        }
        let Some(is_through) = seen_through(object) else {
            continue;
        };
        let memory = memory.entry(object.id).or_insert_with(|| ObjectMemory::from_box(object));
        memory.looks += 1;
        memory.looks_through += u32::from(is_through);
        let unconfirmed = !object.confirmed;
        // An object seen a few times needs more looks to be doubted than one seen once.
        let is_ghost = unconfirmed && memory.looks >= config.ghost_looks.saturating_mul(object.observations.max(1));
        let is_gone =
            memory.looks_through >= if unconfirmed { config.gone_looks.div_ceil(3) } else { config.gone_looks };
        if is_ghost || is_gone {
            gone.push(object.id);
        }
    }
    graph.apply(Op::Batch(gone.iter().map(|id| Op::RemoveObject(*id)).collect()))?;
    for id in &gone {
        graph.memory.remove(id);
    }
    Ok(gone)
}
