//! What the present step could end at, given all that is known: the common ground of the symbolic reasoner and the critic.
//!
//! Both use the same rule for "this is it", so an answer of a language model is measured by what the graph says, not by what another
//! heuristic would have done.

use dsg::{ObjectId, PlaceId, RoomId};

use crate::action::{Action, Target};
use crate::grounding::{GroundingConfig, Match, Scene, ground, room_score};
use crate::instruction::{RoomReference, SpatialRelation, StepKind, Superlative};
use crate::premise;
use crate::search::{self, SearchPlace};
use crate::situation::Situation;
use crate::symbolic::is_doubtful;
use crate::vocabulary::STAND_IN;

/// Known answers to the present step.
#[derive(Debug, Clone)]
pub struct Candidates {
    /// The scene as the grounder sees it.
    pub scene: Scene,
    /// Objects with a fitting class, best first; those that failed before are left out.
    pub objects: Vec<ObjectCandidate>,
    /// Rooms with their score for the room named in the step (or in the step before), best first; empty if none is named.
    pub rooms: Vec<RoomCandidate>,
    /// The room in which the robot should look first, and which it must be in if the step says so.
    pub room: Option<RoomReference>,
    /// Places still worth a visit, best first.
    pub places: Vec<SearchPlace>,
    /// The best answer that is good enough to act on now.
    pub chosen: Option<Choice>,
    /// Known things that answer to every word of the step as well as the chosen one, itself included, the nearest first. More than one:
    /// the words do not say which is meant. Empty where they pick one themselves ("the nearest"), and where any will do.
    pub equals: Vec<ObjectId>,
}

/// An object that may be meant.
#[derive(Debug, Clone)]
pub struct ObjectCandidate {
    /// Its scores.
    pub found: Match,
    /// Length of the way to it.
    pub path_m: Option<f64>,
    /// Whether every part of the expression holds well enough.
    pub is_accepted: bool,
}

/// A room that may be meant.
#[derive(Debug, Clone, Copy)]
pub struct RoomCandidate {
    /// Which.
    pub id: RoomId,
    /// How well it fits, in [0, 1].
    pub score: f64,
    /// Length of the way to it.
    pub path_m: Option<f64>,
}

/// What to go for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The target.
    pub target: Target,
    /// Score of the target times its margin to the runner-up, in [0, 1].
    pub confidence: f64,
    /// True if nothing is left to search and this is the best guess rather than a clear answer.
    pub is_guess: bool,
}

/// Reads the situation. Cost: linear in objects x anchors, plus one path query for each candidate and search place.
pub fn candidates(situation: &Situation, config: &GroundingConfig) -> Candidates {
    let scene = Scene::from_graph(situation.graph, situation.floor());
    let Some(step) = situation.step() else {
        return Candidates {
            scene,
            objects: Vec::new(),
            rooms: Vec::new(),
            room: None,
            places: Vec::new(),
            chosen: None,
            equals: Vec::new(),
        };
    };
    let room = step.goal.room.clone().or_else(|| context_room(situation));
    let rooms = rooms(situation, room.as_ref(), &scene);
    let objects = if step.kind == StepKind::FindObject { objects(situation, &scene, config) } else { Vec::new() };
    let places = search::places(situation, &scene, &rooms, config.searches_by_steps);
    let mut out = Candidates { scene, objects, rooms, room, places, chosen: None, equals: Vec::new() };
    (out.chosen, out.equals) = match step.kind {
        StepKind::FindObject => choose_object(situation, &out, config),
        StepKind::GoToRoom => (choose_room(situation, &out, config), Vec::new()),
        StepKind::ReturnToStart => (None, Vec::new()),
    };
    out
}

impl Candidates {
    /// The candidate with this id.
    pub fn object(&self, id: ObjectId) -> Option<&ObjectCandidate> {
        self.objects.iter().find(|candidate| candidate.found.id == id)
    }

    /// The score of this room; None if the step names no room.
    pub fn room_score(&self, id: RoomId) -> Option<f64> {
        self.rooms.iter().find(|candidate| candidate.id == id).map(|candidate| candidate.score)
    }

    /// True while a reachable place is left to search.
    pub fn has_search_left(&self) -> bool {
        !self.places.is_empty()
    }

    /// The search place with this id.
    pub fn place(&self, id: PlaceId) -> Option<&SearchPlace> {
        self.places.iter().find(|place| place.id == id)
    }
}

/// "go to the kitchen, then find the mug": the mug is looked for in the kitchen first.
fn context_room(situation: &Situation) -> Option<RoomReference> {
    let before = situation.instruction.steps.get(situation.step_index.checked_sub(1)?)?;
    let here = situation.step()?;
    if before.kind != StepKind::GoToRoom || here.goal.floor.is_some() || !here.goal.excluded_rooms.is_empty() {
        return None;
    }
    before.goal.room.clone()
}

fn rooms(situation: &Situation, reference: Option<&RoomReference>, scene: &Scene) -> Vec<RoomCandidate> {
    let Some(reference) = reference else {
        return Vec::new();
    };
    let floor = situation.step().and_then(|step| step.goal.floor).map(|floor| floor.resolve(scene.floor));
    let mut rooms: Vec<RoomCandidate> = (0..scene.rooms.len())
        .map(|index| {
            let facts = &scene.rooms[index];
            let storey = if floor.is_none_or(|floor| floor == facts.floor) { 1.0 } else { 0.05 };
            RoomCandidate {
                id: facts.id,
                score: storey * room_score(reference, index, scene, &situation.viewer()),
                path_m: situation.path_to_room(facts.id),
            }
        })
        .collect();
    rooms.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.id.cmp(&b.id)));
    rooms
}

fn objects(situation: &Situation, scene: &Scene, config: &GroundingConfig) -> Vec<ObjectCandidate> {
    let Some(step) = situation.step() else {
        return Vec::new();
    };
    let found = ground(&step.goal, scene, &situation.viewer());
    // What only stands in for a word helps to find other things; nobody goes there for it.
    let fresh =
        found.into_iter().filter(|found| found.class > STAND_IN && !situation.has_failed(&Action::GoNear(found.id)));
    fresh
        .map(|found| {
            let is_accepted = found.is_accepted(config);
            ObjectCandidate { path_m: situation.path_to_object(found.id), is_accepted, found }
        })
        .collect()
}

/// The choice, and what answers as well as it.
fn choose_object(
    situation: &Situation,
    known: &Candidates,
    config: &GroundingConfig,
) -> (Option<Choice>, Vec<ObjectId>) {
    const NOTHING: (Option<Choice>, Vec<ObjectId>) = (None, Vec::new());
    let Some(step) = situation.step() else { return NOTHING };
    let goal = &step.goal;
    if let Some(meant) = situation.meant {
        // Somebody said so; no other will do.
        let Some(candidate) = known.object(meant).filter(|candidate| candidate.path_m.is_some()) else {
            return NOTHING;
        };
        let choice = Choice { target: Target::Object(meant), confidence: candidate.found.class, is_guess: false };
        return (Some(choice), Vec::new());
    }
    let searching = known.has_search_left();
    // A room of the step before is a preference, not a condition: outside it an object counts less, and only once that room is seen.
    let preferred = |candidate: &ObjectCandidate| {
        goal.room.is_some()
            || known.room.is_none()
            || known.scene.things[candidate.found.index].room.is_some_and(|room| {
                known.room_score(known.scene.rooms[room].id).is_some_and(|score| score >= config.accept_relation)
            })
    };
    let room_is_open = known.places.iter().any(|place| place.is_in_wanted_room);
    let weight = |candidate: &ObjectCandidate| candidate.found.total * if preferred(candidate) { 1.0 } else { 0.75 };
    // While places are left, a better answer may be in one of them: only a clear one ends the search.
    let is_clear = |candidate: &ObjectCandidate| {
        /// What half a room says about its kind counts less: its open side may belong to the next room.
        const HALF_SEEN: f64 = 0.8;
        let found = &candidate.found;
        let room = known.scene.things[found.index].room.map(|room| known.scene.rooms[room].id);
        let is_half_seen = known.places.iter().any(|place| place.is_frontier && room.is_some() && place.room == room);
        let room_score = if goal.room.is_some() && is_half_seen { HALF_SEEN * found.room } else { found.room };
        let weakest = found.class.min(found.weakest_relation).min(room_score);
        !searching || (weakest >= config.accept_while_searching && !is_doubtful(situation, found.id, &goal.class))
    };
    let pool: Vec<&ObjectCandidate> = known
        .objects
        .iter()
        .filter(|candidate| {
            candidate.is_accepted
                && is_clear(candidate)
                && candidate.path_m.is_some()
                && (preferred(candidate) || !room_is_open)
        })
        .collect();
    let equals = equals(situation, &pool, known);
    // "The mug" says that there is one: with somebody to ask, the robot looks whether that is so before it stops at the first.
    let may_have_equals = situation.may_ask && !goal.is_any && goal.is_bare() && equals.len() < 2;
    let may_be_beaten = searching && (needs_whole_map(goal, known) || may_have_equals);
    if !pool.is_empty() && !may_be_beaten {
        return (pick(situation, &pool, &weight, false), equals);
    }
    if searching {
        return NOTHING;
    }
    let guesses: Vec<&ObjectCandidate> = known
        .objects
        .iter()
        .filter(|candidate| candidate.path_m.is_some() && premise::may_be_meant(candidate, situation, known, config))
        .collect();
    (pick(situation, &guesses, &weight, true), Vec::new())
}

/// Those of the pool that answer to every word as well as its best. Weights play no part: of two mugs near a sink the nearer one is
/// no more meant.
fn equals(situation: &Situation, pool: &[&ObjectCandidate], known: &Candidates) -> Vec<ObjectId> {
    /// Scores of class and attributes closer than this say the same.
    const SAME: f64 = 0.9;
    let Some(step) = situation.step().filter(|step| !step.goal.is_any && !step.goal.picks_one()) else {
        return Vec::new();
    };
    if step.goal.class.is_plural {
        return Vec::new(); // "find the mugs": the first will do
    }
    let best = |of: fn(&Match) -> f64| pool.iter().map(|candidate| of(&candidate.found)).fold(0.0, f64::max);
    let (class, attributes) = (best(|found| found.class), best(|found| found.attributes));
    let mut equals: Vec<&&ObjectCandidate> = pool
        .iter()
        .filter(|candidate| {
            let is_confirmed = situation.graph.object(candidate.found.id).is_some_and(|object| object.confirmed);
            let found = &candidate.found;
            is_confirmed && found.class >= SAME * class && found.attributes >= SAME * attributes
        })
        .collect();
    equals.sort_by(|a, b| {
        let way = |candidate: &ObjectCandidate| candidate.path_m.unwrap_or(f64::INFINITY);
        way(a).total_cmp(&way(b)).then(a.found.id.cmp(&b.found.id))
    });
    // A box in a box is the same thing, seen twice.
    let mut apart: Vec<&&ObjectCandidate> = Vec::new();
    for candidate in equals {
        let bounds = |candidate: &ObjectCandidate| known.scene.things[candidate.found.index].bounds;
        if apart.iter().all(|other| bounds(other).intersection(&bounds(candidate)).is_none()) {
            apart.push(candidate);
        }
    }
    apart.into_iter().map(|candidate| candidate.found.id).collect()
}

/// Extremes over the whole scene are known only when the scene is ("the largest box"); "nearest" and sides are judged on what is seen.
fn needs_whole_map(goal: &crate::instruction::Referring, known: &Candidates) -> bool {
    let global = |superlative: &Superlative| {
        matches!(
            superlative,
            Superlative::Largest
                | Superlative::Smallest
                | Superlative::Tallest
                | Superlative::Shortest
                | Superlative::Longest
                | Superlative::Widest
                | Superlative::Narrowest
                | Superlative::Highest
                | Superlative::Lowest
                | Superlative::Farthest
        )
    };
    let relation = |relation: SpatialRelation| relation == SpatialRelation::Farthest;
    let extreme = goal.superlatives.iter().any(global) || goal.relations.iter().any(|clause| relation(clause.relation));
    // Within a named room only that room must be seen.
    extreme && known.places.iter().any(|place| place.is_frontier && (goal.room.is_none() || place.is_in_wanted_room))
}

/// The nearest of those that are about as good as the best.
fn pick(
    situation: &Situation,
    pool: &[&ObjectCandidate],
    weight: &dyn Fn(&ObjectCandidate) -> f64,
    is_guess: bool,
) -> Option<Choice> {
    /// A share of the best score above which candidates count as equal; the boxes of a growing map shake by about this much.
    const AS_GOOD: f64 = 0.8;
    /// The object already being approached wins against one up to this much nearer, so that the robot does not swing between two.
    const LOYALTY: f64 = 0.6;
    let best = pool.iter().map(|candidate| weight(candidate)).fold(0.0, f64::max);
    let current = situation.last_action.and_then(Action::object);
    let effort = |candidate: &ObjectCandidate| {
        candidate.path_m.unwrap_or(f64::INFINITY) * if current == Some(candidate.found.id) { LOYALTY } else { 1.0 }
    };
    let equals = pool.iter().filter(|candidate| weight(candidate) >= AS_GOOD * best);
    let chosen = equals.min_by(|a, b| effort(a).total_cmp(&effort(b)).then(a.found.id.cmp(&b.found.id)))?;
    let second = pool
        .iter()
        .filter(|candidate| candidate.found.id != chosen.found.id)
        .map(|candidate| weight(candidate))
        .fold(0.0, f64::max);
    let score = weight(chosen);
    let margin = if score > 0.0 { ((score - second) / score).clamp(0.0, 1.0) } else { 0.0 };
    Some(Choice {
        target: Target::Object(chosen.found.id),
        confidence: (score * (0.5 + 0.5 * margin)).clamp(0.0, 1.0),
        is_guess,
    })
}

fn choose_room(situation: &Situation, known: &Candidates, config: &GroundingConfig) -> Option<Choice> {
    let open: Vec<&RoomCandidate> = known
        .rooms
        .iter()
        .filter(|room| room.path_m.is_some() && !situation.has_failed(&Action::GoToRoom(room.id)))
        .collect();
    let best = open.first()?;
    let clear = best.score >= config.accept_relation;
    if !clear && (known.has_search_left() || best.score < config.accept_at_last) {
        return None;
    }
    let loyal = |room: &RoomCandidate| situation.last_action == Some(&Action::GoToRoom(room.id));
    let effort = |room: &RoomCandidate| room.path_m.unwrap_or(f64::INFINITY) * if loyal(room) { 0.6 } else { 1.0 };
    let chosen = open
        .iter()
        .filter(|room| room.score >= 0.8 * best.score)
        .min_by(|a, b| effort(a).total_cmp(&effort(b)).then(a.id.cmp(&b.id)))?;
    let second = open.iter().filter(|room| room.id != chosen.id).map(|room| room.score).fold(0.0, f64::max);
    Some(Choice {
        target: Target::Room(chosen.id),
        confidence: (chosen.score * (0.5 + 0.5 * (1.0 - second / chosen.score).clamp(0.0, 1.0))).clamp(0.0, 1.0),
        is_guess: !clear,
    })
}

/// True when the robot is in the room and not on its threshold.
pub fn is_well_inside(situation: &Situation, id: RoomId) -> bool {
    /// Half a robot: within this of a doorway its body is in two rooms.
    const THRESHOLD_M: f64 = 0.6;
    let position = situation.position();
    situation.room() == Some(id)
        && situation.graph.doors_of(id).iter().all(|door| (door.doorway - position).xy().norm() >= THRESHOLD_M)
}
