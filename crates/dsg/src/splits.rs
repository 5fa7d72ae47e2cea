//! Objects that turn out to be two: one mask over two chairs from afar, two masks from near.
//!
//! A segmenter also cuts one thing in two now and then, so it takes frames: two views of one object that lie beside each other,
//! at the same cut again and again, in at least half of all frames that ever showed it.

use std::collections::BTreeMap;

use crate::associate::View;
use crate::bounds::Aabb;
use crate::duplicates::{note_seen_as_two, refit};
use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::memory::{Cell, ObjectMemory};
use crate::object::Object;
use crate::observe::AssociationConfig;
use crate::op::{Op, OpError};
use crate::vote::add_votes;

/// How far a piece may seem to lie beside where it lay (m).
const BESIDE_M: f64 = 0.10;
/// Share of the points of one piece that may lie in the box of the other.
const INSIDE: f64 = 0.1;

/// Where an object has been seen as two pieces, and what was said of each.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cut {
    pieces: [Piece; 2],
    /// Frames that showed both.
    frames: u32,
}

#[derive(Debug, Clone, PartialEq)]
struct Piece {
    bounds: Aabb,
    votes: BTreeMap<String, f64>,
}

impl Piece {
    fn of(view: &View) -> Piece {
        let mut piece = Piece { bounds: view.bounds, votes: BTreeMap::new() };
        piece.vote(view);
        piece
    }

    fn vote(&mut self, view: &View) {
        add_votes(&mut self.votes, &view.labels, f64::from(view.score));
    }

    fn is_shown_by(&self, view: &View) -> bool {
        self.bounds.inflated(BESIDE_M).contains(&view.bounds.center())
    }
}

/// Remembers the two largest views that one frame had of an object, if they lie beside each other.
pub(crate) fn note_cut(memory: &mut ObjectMemory, views: &[&View]) {
    let mut views = views.to_vec();
    views.sort_by_key(|view| (std::cmp::Reverse(view.evidence_points.len()), view.index));
    let [a, b, ..] = views[..] else { return };
    let inside = |view: &View, other: &View| {
        let count = view.sample.iter().filter(|point| other.bounds.contains(point)).count();
        count as f64 > INSIDE * view.sample.len() as f64
    };
    if inside(a, b) || inside(b, a) {
        return;
    }
    let shows = |cut: &Cut, a: &View, b: &View| {
        let [first, second] = &cut.pieces;
        first.is_shown_by(a) && second.is_shown_by(b) && !first.is_shown_by(b) && !second.is_shown_by(a)
    };
    match &mut memory.cut {
        Some(cut) if shows(cut, a, b) || shows(cut, b, a) => {
            let (first, second) = if shows(cut, a, b) { (a, b) } else { (b, a) };
            cut.frames += 1;
            for (piece, view) in cut.pieces.iter_mut().zip([first, second]) {
                piece.bounds = view.bounds;
                piece.vote(view);
            }
        }
        cut => *cut = Some(Cut { pieces: [a, b].map(Piece::of), frames: 1 }),
    }
}

/// Divides the objects of `seen` that have been seen as two often enough. The piece with more points stays what it was. Returns
/// (divided, new).
pub(crate) fn split_pairs(
    graph: &mut SceneGraph,
    seen: &[ObjectId],
    config: &AssociationConfig,
) -> Result<Vec<(ObjectId, ObjectId)>, OpError> {
    let mut split = Vec::new();
    for &id in seen {
        let Some(object) = graph.object(id) else { continue };
        let is_two = |cut: &Cut| cut.frames >= config.split_frames && 2 * cut.frames >= object.observations;
        let memory = graph.memory.get(&id).filter(|memory| memory.cut.as_ref().is_some_and(is_two));
        let Some((memory, cut)) = memory.and_then(|memory| Some((memory, memory.cut.as_ref()?))) else { continue };
        let frames = cut.frames;
        let (kept, (piece, taken)) = divide(memory, cut);
        if taken.points().is_empty() {
            continue;
        }
        let mut stays = object.clone();
        for (label, votes) in &piece.votes {
            if let Some(all) = stays.votes.get_mut(label).filter(|all| **all > *votes) {
                *all -= votes;
            }
        }
        let mut new = Object {
            votes: piece.votes.clone(),
            observations: frames,
            confirmed: false,
            first_seen_ns: object.first_seen_ns,
            last_seen_ns: object.last_seen_ns,
            room: object.room,
            place: object.place,
            ..Object::new(graph.next_object_id(), "unknown", piece.bounds)
        };
        refit(&mut stays, &kept, config);
        refit(&mut new, &taken, config);
        let new_id = new.id;
        graph.apply(Op::Batch(vec![Op::PutObject(Box::new(stays)), Op::PutObject(Box::new(new))]))?;
        graph.memory.insert(id, kept);
        graph.memory.insert(new_id, taken);
        note_seen_as_two(graph, id, new_id, frames);
        split.push((id, new_id));
    }
    Ok(split)
}

/// What is remembered of the piece that stays, and the other piece with what is remembered of it: each point belongs to the
/// nearer one.
fn divide<'a>(memory: &ObjectMemory, cut: &'a Cut) -> (ObjectMemory, (&'a Piece, ObjectMemory)) {
    let [first, second] = &cut.pieces;
    let is_second = |cell: &Cell| {
        let point = cell.mean.cast::<f64>();
        second.bounds.distance_to_point_m(&point) < first.bounds.distance_to_point_m(&point)
    };
    let (b, a): (Vec<Cell>, Vec<Cell>) = memory.cells.iter().partition(|cell| is_second(cell));
    let (kept, (piece, taken)) = if a.len() >= b.len() { (a, (second, b)) } else { (b, (first, a)) };
    // Captions and video numbers spoke of both.
    let stays =
        ObjectMemory { cells: kept, cut: None, tracks: BTreeMap::new(), captions: BTreeMap::new(), ..memory.clone() };
    let new = ObjectMemory { voxel_m: memory.voxel_m, cells: taken, ..ObjectMemory::default() };
    (stays, (piece, new))
}
