//! Where to look next: OmniVLN's functional group inference turned into an order of search places.
//!
//! value = likelihood x gain / (path + 3 m). The likelihood is that of the place's room holding the target or an anchor (usual contents
//! of the kinds the room may be), or of being or leading to the room the instruction names. The gain of a frontier is the area that the
//! way to it would show, where somebody counted it ([`Situation::gain_m2`]), and else grows with its size; a place from which things were
//! not yet seen closely is worth much for small targets and little for large.

use dsg::{PlaceId, RoomId};
use nalgebra::Point3;

use crate::action::Action;
use crate::candidates::RoomCandidate;
use crate::grounding::{Scene, ground};
use crate::instruction::{Referring, StepKind};
use crate::situation::Situation;
use crate::vocabulary::{Class, affinity, is_small};

/// A place worth visiting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchPlace {
    /// Which.
    pub id: PlaceId,
    /// Where.
    pub position: Point3<f64>,
    /// Its room.
    pub room: Option<RoomId>,
    /// Length of the way to it.
    pub path_m: f64,
    /// True for the border of unknown space, false for a place to look from.
    pub is_frontier: bool,
    /// True if it lies in the room that the step (or the step before) names.
    pub is_in_wanted_room: bool,
    /// Chance that the search succeeds there, relative.
    pub likelihood: f64,
    /// The value by which places are ordered.
    pub value: f64,
}

/// All reachable search places, best first (ties by id). Places that failed before are left out.
/// Without `by_steps` the nearest comes first, whatever it is.
pub fn places(situation: &Situation, scene: &Scene, rooms: &[RoomCandidate], by_steps: bool) -> Vec<SearchPlace> {
    /// A way that shows so much counts 1, metres squared; a door into a room of which nothing is known.
    const FULL_GAIN_M2: f64 = 8.0;
    /// What a way counts that shows next to nothing, for the count may be wrong; and one that shows much.
    const LEAST_GAIN: f64 = 0.2;
    const MOST_GAIN: f64 = 1.5;
    /// Path length added to every place, metres: what turning and looking costs.
    const OVERHEAD_M: f64 = 3.0;
    let Some(step) = situation.step() else {
        return Vec::new();
    };
    let targets = wanted_classes(&step.goal);
    let small = step.kind == StepKind::FindObject && is_small(&step.goal.class);
    let anchors = anchor_positions(situation, &step.goal, scene);
    let going_to = situation.last_action.and_then(|action| match action {
        Action::Explore(id) => situation.graph.place(*id).map(|place| place.position),
        _ => None,
    });
    let room_likelihood: Vec<f64> = scene
        .rooms
        .iter()
        .map(|facts| facts.probabilities.iter().map(|(kind, p)| p * usual(kind, &targets)).sum())
        .collect();
    // Before anything is known about a room, it is as likely as a room of any kind.
    let unknown_room = 0.35;

    let mut out: Vec<SearchPlace> = Vec::new();
    let frontiers = situation.frontiers.iter().map(|id| (*id, true));
    let unseen = situation.unseen.iter().filter(|id| !situation.frontiers.contains(id)).map(|id| (*id, false));
    for (id, is_frontier) in frontiers.chain(unseen) {
        let Some(place) = situation.graph.place(id) else {
            continue;
        };
        if situation.has_failed(&Action::Explore(id)) {
            continue;
        }
        let Some(path_m) =
            (situation.path_length)(&place.position).filter(|path_m| path_m.is_finite() && *path_m >= 0.0)
        else {
            continue;
        };
        let facts_index = place.room.and_then(|room| scene.rooms.binary_search_by(|facts| facts.id.cmp(&room)).ok());
        let wanted_score = place
            .room
            .and_then(|room| rooms.iter().find(|candidate| candidate.id == room))
            .map(|candidate| candidate.score);
        let is_in_wanted_room = wanted_score.is_some_and(|score| score >= 0.5);
        let contents = facts_index.map_or(unknown_room, |index| room_likelihood[index]);
        let mut likelihood = if rooms.is_empty() {
            if is_frontier { 0.3 + 0.7 * contents } else { 0.15 + 0.85 * contents }
        } else {
            match wanted_score {
                // Inside the named room a search for a thing pays; a search for the room itself is over.
                Some(score) if score >= 0.5 => 1.5,
                Some(score) if is_frontier => leads_on(facts_index, scene).max(score),
                Some(score) => 0.1 + 0.5 * score,
                None => 0.5,
            }
        };
        let nearest_anchor_m =
            anchors.iter().map(|anchor| (anchor - place.position).xy().norm()).fold(f64::INFINITY, f64::min);
        if nearest_anchor_m < 3.5 {
            likelihood *= if is_frontier { 1.4 } else { 2.0 };
        }
        let gain = if is_frontier {
            match situation.gain_m2.and_then(|gain_m2| gain_m2(id)) {
                Some(area_m2) => (area_m2 / FULL_GAIN_M2).clamp(LEAST_GAIN, MOST_GAIN),
                None => 0.5 + 0.5 * (f64::from(place.frontier_cells) / 40.0).min(1.0),
            }
        } else if small {
            0.6
        } else {
            0.08
        };
        let loyalty = match going_to {
            Some(goal) if (goal - place.position).norm() < 1.5 => 1.3,
            _ => 1.0,
        };
        out.push(SearchPlace {
            id,
            position: place.position,
            room: place.room,
            path_m,
            is_frontier,
            is_in_wanted_room,
            likelihood,
            value: if by_steps { likelihood * gain * loyalty } else { loyalty } / (path_m + OVERHEAD_M),
        });
    }
    out.sort_by(|a, b| b.value.total_cmp(&a.value).then(a.id.cmp(&b.id)));
    out
}

/// The room kinds in which such things are usual, most usual first: for the trace.
pub fn usual_rooms(goal: &Referring, count: usize) -> Vec<&'static str> {
    let targets = wanted_classes(goal);
    let mut kinds: Vec<(f64, &'static str)> =
        crate::vocabulary::kind_probabilities(&[]).into_iter().map(|(kind, _)| (usual(kind, &targets), kind)).collect();
    kinds.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(b.1)));
    kinds.into_iter().filter(|(value, _)| *value > 0.1).take(count).map(|(_, kind)| kind).collect()
}

/// A frontier in another room leads on: corridors most, rooms of another known kind least.
fn leads_on(facts: Option<usize>, scene: &Scene) -> f64 {
    let Some(index) = facts else { return 0.5 };
    let corridor =
        scene.rooms[index].probabilities.iter().find(|(kind, _)| *kind == "corridor").map_or(0.0, |(_, p)| *p);
    let named = scene.rooms[index].kind.as_ref();
    match named {
        Some((kind, _)) if kind == "corridor" || kind == "lobby" => 0.7,
        Some((_, confidence)) => 0.45 - 0.15 * confidence,
        None => 0.45 + 0.25 * corridor,
    }
}

/// How usual the target (or, less, an anchor) is in rooms of a kind.
fn usual(kind: &str, targets: &[(Class, f64)]) -> f64 {
    targets.iter().map(|(class, weight)| weight * affinity(kind, class)).fold(0.0, f64::max)
}

/// The target with weight 1 and its anchors with less: a mug near a sink is looked for where sinks are.
fn wanted_classes(goal: &Referring) -> Vec<(Class, f64)> {
    let mut classes = vec![(goal.class.clone(), 1.0)];
    for clause in goal.relations.iter().filter(|clause| !clause.negated) {
        classes.extend(clause.anchors.iter().map(|anchor| (anchor.class.clone(), 0.9)));
    }
    if let Some(room) = &goal.room {
        classes.extend(room.contains.iter().map(|content| (content.class.clone(), 0.9)));
    }
    classes.retain(|(class, _)| !class.text.is_empty());
    classes
}

/// Positions of known anchors of the goal.
fn anchor_positions(situation: &Situation, goal: &Referring, scene: &Scene) -> Vec<Point3<f64>> {
    let anchors = goal.relations.iter().filter(|clause| !clause.negated).flat_map(|clause| &clause.anchors);
    let found = anchors.flat_map(|anchor| {
        ground(anchor, scene, &situation.viewer()).into_iter().filter(|found| found.total >= 0.5).take(8)
    });
    found.map(|found| scene.things[found.index].bounds.center()).collect()
}
