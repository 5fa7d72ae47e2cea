//! Object localisation: how well each known thing answers to a referring expression.
//!
//! A thing's score is the product of its parts: class (synonyms, votes), attributes, room, each relation to the best anchor (anchors are
//! grounded by the same rule, so nesting costs nothing new), extremes among the remaining candidates, and trust in the observation.
//! Works on plain [`Thing`]s, so the same code grounds a robot's scene graph ([`Scene::from_graph`]) and a recorded data set.

use dsg::ObjectId;
use nalgebra::Point3;

use crate::attributes::attribute_score;
use crate::extremes::{extremes, in_order};
use crate::groups::group_score;
use crate::instruction::{Among, Referring, RelationClause, RoomReference, SpatialRelation, ViewKind};
use crate::relations::{Shape, Viewer, between_score, facing_front, nearness_key_m, relation_score};
pub use crate::scene::{GroupFacts, RoomFacts, Scene, Thing};
use crate::singling;
use crate::vocabulary::{class_similarity, is_container, kind_similarity, stand_in};

/// What counts as "yes".
#[derive(Debug, Clone, PartialEq)]
pub struct GroundingConfig {
    /// Least class score of a thing that may be the target at once. Synonyms, kinds and general words pass; look-alikes (0.5) do not. Default 0.6.
    pub accept: f64,
    /// Least score of every single relation and of the room. Default 0.5.
    pub accept_relation: f64,
    /// Least score of the attributes together. Default 0.4: an unknown colour (0.5) passes, a wrong one does not.
    pub accept_attributes: f64,
    /// Least class, relation and room score of an answer that ends the search although reachable places are left. Default 0.72: a
    /// general word for a special thing (0.7: "desk" for "reception desk") and a room of doubtful kind are not enough.
    pub accept_while_searching: f64,
    /// Least score of a room that is taken for the one that is named once nothing is left to search. Default 0.12.
    pub accept_at_last: f64,
    /// Whether a search weighs where such things are usual and what a way would show ([`crate::search`]); if not, the nearest place is next.
    /// Default true.
    pub searches_by_steps: bool,
}

impl Default for GroundingConfig {
    fn default() -> Self {
        GroundingConfig {
            accept: 0.6,
            accept_relation: 0.5,
            accept_attributes: 0.4,
            accept_while_searching: 0.72,
            accept_at_last: 0.12,
            searches_by_steps: true,
        }
    }
}

/// A number of the configuration is not in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("every threshold of the grounding must be in [0, 1]")]
pub struct GroundingConfigError;

impl GroundingConfig {
    /// Checks that every threshold is in [0, 1].
    pub fn validate(&self) -> Result<(), GroundingConfigError> {
        let all = [
            self.accept,
            self.accept_relation,
            self.accept_attributes,
            self.accept_while_searching,
            self.accept_at_last,
        ];
        if all.iter().all(|value| (0.0..=1.0).contains(value)) { Ok(()) } else { Err(GroundingConfigError) }
    }
}

/// How one thing answers to the expression, part by part; each in [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub struct Match {
    /// The thing.
    pub id: ObjectId,
    /// Its index in [`Scene::things`].
    pub index: usize,
    /// Class.
    pub class: f64,
    /// Colours, materials, other words.
    pub attributes: f64,
    /// The least of them.
    pub weakest_attribute: f64,
    /// Room and storey.
    pub room: f64,
    /// The weakest relation.
    pub weakest_relation: f64,
    /// Product of everything, with extremes and trust.
    pub total: f64,
    /// How much more it is meant than the others, by what the parts single out (`singling.rs`); only the order has a meaning.
    pub rank: f64,
}

impl Match {
    /// True when each part alone is good enough to stop at this thing.
    pub fn is_accepted(&self, config: &GroundingConfig) -> bool {
        self.class >= config.accept
            && self.attributes >= config.accept_attributes
            && self.room >= config.accept_relation
            && self.weakest_relation >= config.accept_relation
    }
}

/// Things with a class that answers at all, best first (ties by id).
pub fn ground(goal: &Referring, scene: &Scene, viewer_position: &Point3<f64>) -> Vec<Match> {
    let viewer = viewer_of(goal, scene, viewer_position);
    let mut matches = matches(goal, scene, &viewer, 0);
    matches.sort_by(|a, b| b.rank.total_cmp(&a.rank).then(a.id.cmp(&b.id)));
    matches
}

/// How well a room answers to a reference, in [0, 1].
pub fn room_score(reference: &RoomReference, room: usize, scene: &Scene, viewer_position: &Point3<f64>) -> f64 {
    let facts = &scene.rooms[room];
    let contents: f64 = reference
        .contains
        .iter()
        .map(|content| {
            let found = ground(content, scene, viewer_position);
            found
                .iter()
                .filter(|found| scene.things[found.index].room == Some(room))
                .map(|found| found.total)
                .fold(0.0, f64::max)
        })
        .product();
    let name = if reference.name.is_empty() {
        1.0
    } else if facts.name == reference.name && facts.is_name_given {
        0.98
    } else if let Some(kind) = &reference.kind {
        let by_contents = facts.probabilities.iter().find(|(name, _)| name == kind).map_or(0.0, |(_, p)| *p);
        match &facts.kind {
            Some((actual, confidence)) => {
                let actual = crate::vocabulary::room_kind(actual).unwrap_or(actual.as_str());
                let similarity = kind_similarity(kind, actual);
                if similarity >= 1.0 {
                    0.35 + 0.65 * confidence
                } else {
                    // The graph says otherwise; the contents count for what that leaves.
                    (similarity * confidence).max((1.0 - confidence) * by_contents)
                }
            }
            // Our own count of the contents, where the graph would not say: one or two things prove little.
            None => 0.8 * by_contents,
        }
    } else {
        0.02
    };
    name * contents
}

/// Class scores below this are no answer at all.
const LEAST_CLASS: f64 = 0.05;

fn matches(goal: &Referring, scene: &Scene, viewer: &Viewer, depth: usize) -> Vec<Match> {
    let mut similarity: Vec<f64> = scene.classes.iter().map(|class| class_similarity(&goal.class, class)).collect();
    if similarity.contains(&1.0) {
        // Where things bear the very word that was said, those that bear another word for it are meant less.
        const OTHER_WORD: f64 = 0.75;
        similarity.iter_mut().filter(|value| **value == 0.95).for_each(|value| *value *= OTHER_WORD);
    }
    if similarity.iter().all(|value| *value <= LEAST_CLASS) {
        similarity = scene.classes.iter().map(|class| stand_in(&goal.class, class)).collect();
    }
    let mut found: Vec<Match> = Vec::new();
    for (index, thing) in scene.things.iter().enumerate() {
        let class =
            thing.classes.iter().map(|(class, weight)| similarity[*class as usize] * weight).fold(0.0, f64::max);
        if class > LEAST_CLASS {
            found.push(Match {
                id: thing.id,
                index,
                class,
                attributes: 1.0,
                weakest_attribute: 1.0,
                room: 1.0,
                weakest_relation: 1.0,
                total: class * thing.trust,
                rank: thing.trust,
            });
        }
    }
    singling::class(&goal.class, &mut found, scene);
    if found.is_empty() || depth > 6 {
        return found;
    }
    let room_scores = rooms(goal, scene, viewer);
    for each in &mut found {
        let thing = &scene.things[each.index];
        for attribute in &goal.attributes {
            let score = attribute_score(attribute.kind, &attribute.word, attribute.negated, thing);
            each.attributes *= score;
            each.weakest_attribute = each.weakest_attribute.min(score);
        }
        // A thing that no room holds yet may stand in any.
        each.room = room_scores.as_ref().map_or(1.0, |scores| thing.room.map_or(0.4, |room| scores[room]));
        each.total *= each.attributes * each.room;
        each.rank *= each.attributes * each.room;
    }
    if let Some(among) = &goal.among {
        let members = members(among, scene, viewer, depth);
        for each in found.iter_mut().filter(|each| !members.contains(&each.index)) {
            multiply(each, 0.0);
            each.rank *= NO_MEMBER;
        }
    }
    for (position, clause) in goal.relations.iter().enumerate() {
        let ordinal = goal.ordinal.filter(|_| goal.ordinal_clause() == Some(position));
        relate(clause, ordinal, &mut found, scene, viewer, depth);
    }
    extremes(goal, &mut found, |each| &mut each.total, scene, viewer);
    extremes(goal, &mut found, |each| &mut each.rank, scene, viewer);
    found
}

/// What is left of a thing that is not among those that were set apart.
const NO_MEMBER: f64 = 0.02;

/// Indices of the things that are set apart: the first by the order that is named, or those that answer best.
fn members(among: &Among, scene: &Scene, viewer: &Viewer, depth: usize) -> Vec<usize> {
    let mut goal = among.goal.clone();
    let by_distance = |clause: &RelationClause| {
        !clause.negated && matches!(clause.relation, SpatialRelation::Closest | SpatialRelation::Farthest)
    };
    let clause = goal.relations.iter().position(by_distance).map(|at| goal.relations.remove(at));
    let superlative = if clause.is_none() { goal.superlatives.pop() } else { None };
    let found = matches(&goal, scene, viewer, depth + 1);
    let keys = match (clause, superlative) {
        (Some(clause), _) => {
            let anchors =
                clause.anchors.first().map_or_else(Vec::new, |anchor| matches(anchor, scene, viewer, depth + 1));
            singling::distances(clause.relation, &found, &anchors, scene)
        }
        (None, Some(superlative)) => in_order(superlative, &found, scene, viewer),
        (None, None) => vec![0.0; found.len()],
    };
    // Those that are about as good as the best by everything else compete by the order; the others follow.
    let top = found.iter().map(|each| each.rank).fold(0.0, f64::max);
    let sorting_key =
        |(each, key): &(Match, f64)| if each.rank >= 0.9 * top { (false, *key) } else { (true, -each.rank) };
    let mut found: Vec<(Match, f64)> = found.into_iter().zip(keys).collect();
    found.sort_by(|a, b| {
        let (first, second) = (sorting_key(a), sorting_key(b));
        first.0.cmp(&second.0).then(first.1.total_cmp(&second.1)).then(a.0.id.cmp(&b.0.id))
    });
    found.into_iter().take(among.count as usize).map(|(each, _)| each.index).collect()
}

/// Score of each room for the goal's room, excluded rooms and storey; None when the goal names none.
fn rooms(goal: &Referring, scene: &Scene, viewer: &Viewer) -> Option<Vec<f64>> {
    if goal.room.is_none() && goal.excluded_rooms.is_empty() && goal.floor.is_none() {
        return None;
    }
    let score = |room: usize| {
        let named = goal.room.as_ref().map_or(1.0, |reference| room_score(reference, room, scene, &viewer.position));
        let excluded: f64 = goal
            .excluded_rooms
            .iter()
            .map(|reference| 1.0 - room_score(reference, room, scene, &viewer.position))
            .product();
        let storey = goal
            .floor
            .map_or(1.0, |floor| if floor.resolve(scene.floor) == scene.rooms[room].floor { 1.0 } else { 0.05 });
        named * excluded * storey
    };
    Some((0..scene.rooms.len()).map(score).collect())
}

/// Multiplies the score of one relation clause into every candidate.
fn relate(
    clause: &RelationClause,
    ordinal: Option<u32>,
    found: &mut [Match],
    scene: &Scene,
    viewer: &Viewer,
    depth: usize,
) {
    if is_on_the_floor(clause) {
        let lowest_m = scene.things.iter().map(|thing| thing.bounds.min.z).fold(f64::INFINITY, f64::min);
        for each in found.iter_mut() {
            let height_m = scene.things[each.index].bounds.min.z - lowest_m;
            let score = (-(height_m - FLOOR_ERROR_M).max(0.0) / 0.2).exp();
            multiply(each, if clause.negated { 1.0 - score } else { score });
            each.rank *= (if clause.negated { 1.0 - score } else { score }).max(0.05);
        }
        pass_on(&clause.anchors[0], found, scene, viewer, depth);
        return;
    }
    let anchors: Vec<Vec<Match>> =
        clause.anchors.iter().map(|anchor| matches(anchor, scene, viewer, depth + 1)).collect();
    let scores: Vec<f64> = match clause.relation {
        SpatialRelation::Between => found.iter().map(|each| between(each, &anchors, scene)).collect(),
        SpatialRelation::Closest | SpatialRelation::Farthest => closest(clause.relation, found, &anchors, scene),
        relation => found
            .iter()
            .map(|each| best_anchor(relation, each, anchors.first().map_or(&[], Vec::as_slice), scene, viewer))
            .collect(),
    };
    if let (Some(ordinal), Some(anchors)) = (ordinal, anchors.first().filter(|anchors| !anchors.is_empty())) {
        let ranks = singling::nth(clause.relation, ordinal, found, anchors, scene);
        for (each, rank) in found.iter_mut().zip(ranks) {
            each.rank *= rank;
            multiply(each, rank);
        }
        return;
    }
    if anchors.iter().all(|anchors| !anchors.is_empty()) {
        let ranks = singling::relation(clause.relation, found, &anchors, scene, viewer);
        for (each, rank) in found.iter_mut().zip(ranks) {
            each.rank *= if clause.negated { 1.02 - rank } else { rank };
        }
        if let ([anchor], [[_]]) =
            (clause.anchors.as_slice(), anchors.iter().map(Vec::as_slice).collect::<Vec<_>>().as_slice())
        {
            pass_on(anchor, found, scene, viewer, depth);
        }
    }
    for (each, score) in found.iter_mut().zip(scores) {
        multiply(each, if clause.negated { 1.0 - score } else { score });
    }
}

/// "the box on the shelf next to the door", where there is one shelf: what is said about the only one is meant to tell the boxes apart.
fn pass_on(anchor: &Referring, found: &mut [Match], scene: &Scene, viewer: &Viewer, depth: usize) {
    for clause in &anchor.relations {
        let anchors: Vec<Vec<Match>> =
            clause.anchors.iter().map(|anchor| matches(anchor, scene, viewer, depth + 1)).collect();
        if anchors.iter().all(|anchors| !anchors.is_empty()) {
            let ranks = singling::relation(clause.relation, found, &anchors, scene, viewer);
            for (each, rank) in found.iter_mut().zip(ranks) {
                each.rank *= if clause.negated { 1.02 - rank } else { rank };
            }
        }
    }
    let said = Referring { superlatives: anchor.superlatives.clone(), ordinal: None, ..Referring::default() };
    extremes(&said, found, |each| &mut each.rank, scene, viewer);
}

fn multiply(each: &mut Match, score: f64) {
    const FLOOR: f64 = 1e-4; // a wrong relation never erases the class: at the end of a search it still ranks
    let score = score.clamp(FLOOR, 1.0);
    each.weakest_relation = each.weakest_relation.min(score);
    each.total *= score;
}

/// Height above the lowest thing known at which something may still stand on the floor, metres.
const FLOOR_ERROR_M: f64 = 0.2;

/// "on the floor": every storey has one, whether or not it is among the things.
fn is_on_the_floor(clause: &RelationClause) -> bool {
    clause.relation == SpatialRelation::On
        && matches!(clause.anchors.as_slice(), [floor] if matches!(floor.class.text.as_str(), "floor" | "ground"))
}

pub(crate) fn shape<'a>(thing: &'a Thing, scene: &Scene) -> Shape<'a> {
    Shape {
        bounds: &thing.bounds,
        front: thing.front,
        oriented: thing.oriented.as_ref(),
        is_container: thing.classes.first().is_some_and(|(class, _)| is_container(&scene.classes[*class as usize])),
    }
}

fn best_anchor(relation: SpatialRelation, each: &Match, anchors: &[Match], scene: &Scene, viewer: &Viewer) -> f64 {
    let subject = &scene.things[each.index];
    let subject_shape = shape(subject, scene);
    let score = |anchor: &Match| {
        let thing = &scene.things[anchor.index];
        let score = match relation {
            SpatialRelation::InGroup => group_score(each.index, anchor.index, scene, viewer),
            relation => relation_score(relation, &subject_shape, &shape(thing, scene), viewer),
        };
        // A wall between two rooms: close in metres, not near.
        let apart = matches!((subject.room, thing.room), (Some(a), Some(b)) if a != b);
        anchor.total * if apart && relation != SpatialRelation::Far { 0.4 * score } else { score }
    };
    let others = anchors.iter().filter(|anchor| anchor.index != each.index);
    if relation == SpatialRelation::Far {
        // Far from all of them; nothing known to be far from is half the truth.
        return others
            .map(|anchor| 1.0 - anchor.total * (1.0 - score(anchor) / anchor.total.max(1e-9)))
            .reduce(f64::min)
            .unwrap_or(0.5);
    }
    others.map(score).fold(0.0, f64::max)
}

fn between(each: &Match, anchors: &[Vec<Match>], scene: &Scene) -> f64 {
    /// Pairs are tried among this many best anchors of each side.
    const MAX_ANCHORS: usize = 12;
    let (first, second) = match anchors {
        [one] => (one, one), // "between the two windows"
        [first, second, ..] => (first, second),
        [] => return 0.0,
    };
    let best = |anchors: &[Match]| {
        let mut best: Vec<(f64, usize)> = anchors.iter().map(|anchor| (anchor.total, anchor.index)).collect();
        best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        best.truncate(MAX_ANCHORS);
        best
    };
    let (first, second) = (best(first), best(second));
    let subject = &scene.things[each.index].bounds;
    let mut top: f64 = 0.0;
    for &(weight_a, a) in &first {
        for &(weight_b, b) in &second {
            if a != b && a != each.index && b != each.index {
                top = top.max(
                    weight_a * weight_b * between_score(subject, &scene.things[a].bounds, &scene.things[b].bounds),
                );
            }
        }
    }
    top
}

/// Score by how much farther from the anchor a candidate is than the best one; `Farthest` mirrored.
fn closest(relation: SpatialRelation, found: &[Match], anchors: &[Vec<Match>], scene: &Scene) -> Vec<f64> {
    let anchors: &[Match] = anchors.first().map_or(&[], Vec::as_slice);
    let top = anchors.iter().map(|anchor| anchor.total).fold(0.0, f64::max);
    let sign = if relation == SpatialRelation::Closest { 1.0 } else { -1.0 };
    let keys: Vec<f64> = found
        .iter()
        .map(|each| {
            // Of several anchors of equal worth the nearest counts.
            let worthy = anchors.iter().filter(|anchor| anchor.index != each.index && anchor.total >= 0.7 * top);
            worthy
                .map(|anchor| nearness_key_m(&scene.things[each.index].bounds, &scene.things[anchor.index].bounds))
                .fold(f64::INFINITY, f64::min)
                * sign
        })
        .collect();
    // Only things of the class compete; a look-alike beside the anchor does not push the right one back.
    let class = found.iter().map(|each| each.class).fold(0.0, f64::max);
    let best = keys
        .iter()
        .zip(found)
        .filter(|(_, each)| each.class >= 0.8 * class)
        .map(|(key, _)| *key)
        .fold(f64::INFINITY, f64::min);
    // The best of all may still be far away; then a robot that has not seen everything had better look on.
    let absolute =
        if relation == SpatialRelation::Closest { 0.35 + 0.65 / (1.0 + (best.max(0.0) / 2.5).powi(3)) } else { 1.0 };
    keys.iter()
        .map(|key| {
            if key.is_finite() && best.is_finite() {
                absolute * top.min(1.0) * (-(key - best).max(0.0) / 0.7).exp()
            } else {
                0.0
            }
        })
        .collect()
}

/// The viewer of an expression: from its view clause, else at `position`, looking at each anchor.
fn viewer_of(goal: &Referring, scene: &Scene, position: &Point3<f64>) -> Viewer {
    let plain = Viewer { position: *position, forward: None };
    let Some(view) = &goal.view else { return plain };
    let mut seen = matches(&view.anchor, scene, &plain, 1);
    seen.sort_by(|a, b| b.rank.total_cmp(&a.rank).then(a.id.cmp(&b.id)));
    let Some(best) = seen.first() else {
        return plain;
    };
    let anchor = scene.things[best.index].bounds.center();
    let towards = (anchor - position).xy();
    match view.kind {
        // Whoever faces a thing with a front looks at its front.
        ViewKind::Facing => {
            let thing = shape(&scene.things[best.index], scene);
            let front = thing.front.and_then(|front| facing_front(&thing, &front));
            Viewer { position: *position, forward: Some(front.unwrap_or(towards)) }
        }
        ViewKind::BackTo => Viewer { position: *position, forward: Some(-towards) },
        ViewKind::From => Viewer { position: anchor, forward: Some(-towards) },
    }
}
