//! Object localisation: how well each known thing answers to a referring expression.
//!
//! A thing's score is the product of its parts: class (synonyms, votes), attributes, room, each relation to the best anchor (anchors are
//! grounded by the same rule, so nesting costs nothing new), extremes among the remaining candidates, and trust in the observation.
//! Works on plain [`Thing`]s, so the same code grounds a robot's scene graph ([`Scene::from_graph`]) and a recorded data set.

use std::collections::HashMap;

use dsg::{Aabb, ObjectId, RoomId, SceneGraph};
use nalgebra::{Point3, Vector2};

use crate::instruction::{
    AttributeKind, Referring, RelationClause, RoomReference, SpatialRelation, Superlative, ViewKind,
};
use crate::relations::{Shape, Viewer, between_score, nearness_key_m, relation_score};
use crate::vocabulary::{
    Class, class_similarity, color_rgb, is_container, kind_probabilities, kind_similarity, material, normalise,
};

/// What counts as "yes".
#[derive(Debug, Clone, PartialEq)]
pub struct GroundingConfig {
    /// Least class score of a thing that may be the target at once. Synonyms, kinds and general words pass; look-alikes (0.5) do not. Default 0.6.
    pub accept: f64,
    /// Least score of every single relation and of the room. Default 0.5.
    pub accept_relation: f64,
    /// Least score of the attributes together. Default 0.4: an unknown colour (0.5) passes, a wrong one does not.
    pub accept_attributes: f64,
    /// Least total of the best guess once nothing is left to search. Default 0.12.
    pub accept_at_last: f64,
}

impl Default for GroundingConfig {
    fn default() -> Self {
        GroundingConfig { accept: 0.6, accept_relation: 0.5, accept_attributes: 0.4, accept_at_last: 0.12 }
    }
}

/// A number of the configuration is not in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("every threshold of the grounding must be in [0, 1]")]
pub struct GroundingConfigError;

impl GroundingConfig {
    /// Checks that every threshold is in [0, 1].
    pub fn validate(&self) -> Result<(), GroundingConfigError> {
        let all = [self.accept, self.accept_relation, self.accept_attributes, self.accept_at_last];
        if all.iter().all(|value| (0.0..=1.0).contains(value)) { Ok(()) } else { Err(GroundingConfigError) }
    }
}

/// One thing of the scene.
#[derive(Debug, Clone)]
pub struct Thing {
    /// The caller's id.
    pub id: ObjectId,
    /// Classes it may be: index into [`Scene::classes`] and weight in [0, 1], the winner with 1.
    pub classes: Vec<(u32, f64)>,
    /// Its box in the world.
    pub bounds: Aabb,
    /// Mean colour.
    pub color: Option<[f64; 3]>,
    /// Colour, material and other words said about it (normalised, one space between).
    pub words: String,
    /// Name of its colour, if the graph holds one.
    pub color_name: Option<String>,
    /// Index into [`Scene::rooms`].
    pub room: Option<usize>,
    /// A point on its front face, if known.
    pub front: Option<Point3<f64>>,
    /// How far the observation is trusted, in (0, 1].
    pub trust: f64,
}

/// One room of the scene.
#[derive(Debug, Clone)]
pub struct RoomFacts {
    /// The caller's id.
    pub id: RoomId,
    /// Its name, normalised.
    pub name: String,
    /// What the graph takes it for, with confidence.
    pub kind: Option<(String, f64)>,
    /// Probability of each kind of [`kind_probabilities`] from its contents.
    pub probabilities: Vec<(&'static str, f64)>,
    /// Storey.
    pub floor: i32,
}

/// Everything the grounder knows.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The things, in ascending order of ids.
    pub things: Vec<Thing>,
    /// The rooms, in ascending order of ids.
    pub rooms: Vec<RoomFacts>,
    /// Distinct classes.
    pub classes: Vec<Class>,
    /// Storey of the viewer.
    pub floor: i32,
    index: HashMap<String, u32>,
}

impl Scene {
    /// Reads a scene graph. `floor` is the storey the robot is on. Movers (people) are left out as targets only by their class.
    pub fn from_graph(graph: &SceneGraph, floor: i32) -> Scene {
        let mut scene = Scene { floor, ..Scene::default() };
        let room_index: HashMap<RoomId, usize> =
            graph.rooms().enumerate().map(|(index, room)| (room.id, index)).collect();
        let mut contents: Vec<Vec<u32>> = vec![Vec::new(); room_index.len()];
        for object in graph.objects() {
            let top = object.votes.values().copied().fold(0.0, f64::max);
            let mut classes: Vec<(u32, f64)> = vec![(scene.intern(&object.label), 1.0)];
            for (label, votes) in &object.votes {
                if *label != object.label && top > 0.0 && *votes > 0.0 {
                    classes.push((scene.intern(label), (votes / top).min(1.0)));
                }
            }
            let room = object.room.and_then(|id| room_index.get(&id).copied());
            if let Some(room) = room {
                contents[room].push(classes[0].0);
            }
            let mut words = normalise(&object.caption);
            for value in object.attributes.values() {
                words.push(' ');
                words.push_str(&normalise(value));
            }
            scene.things.push(Thing {
                id: object.id,
                classes,
                bounds: object.bounds,
                color: object.color.map(|rgb| rgb.map(f64::from)),
                words,
                color_name: object.attributes.get("color").map(|name| normalise(name)),
                room,
                front: None,
                trust: trust(object),
            });
        }
        for (room, mut seen) in graph.rooms().zip(contents) {
            seen.sort_unstable();
            seen.dedup();
            let seen: Vec<Class> = seen.into_iter().map(|index| scene.classes[index as usize].clone()).collect();
            scene.rooms.push(RoomFacts {
                id: room.id,
                name: normalise(&room.name),
                kind: room.kind.as_ref().map(|kind| (normalise(kind), room.kind_confidence)),
                probabilities: kind_probabilities(&seen),
                floor: room.floor,
            });
        }
        scene
    }

    /// The index of a label in [`Scene::classes`], added if it is new.
    pub fn intern(&mut self, label: &str) -> u32 {
        if let Some(index) = self.index.get(label) {
            return *index;
        }
        let index = self.classes.len() as u32;
        self.classes.push(Class::new(label));
        self.index.insert(label.to_string(), index);
        index
    }

    /// The room with this id.
    pub fn room(&self, id: RoomId) -> Option<&RoomFacts> {
        self.rooms.binary_search_by(|room| room.id.cmp(&id)).ok().map(|index| &self.rooms[index])
    }
}

/// Confirmed objects count fully; a first sight counts for something.
fn trust(object: &dsg::Object) -> f64 {
    if object.confirmed {
        1.0
    } else if object.observations >= 2 {
        0.85
    } else {
        0.7
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
    /// Room and storey.
    pub room: f64,
    /// The weakest relation.
    pub weakest_relation: f64,
    /// Product of everything, with extremes and trust.
    pub total: f64,
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
    matches.sort_by(|a, b| b.total.total_cmp(&a.total).then(a.id.cmp(&b.id)));
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
    } else if facts.name == reference.name {
        0.98 // a kind may be a guess, and so may a name made from it
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

fn matches(goal: &Referring, scene: &Scene, viewer: &Viewer, depth: usize) -> Vec<Match> {
    let mut similarity: Vec<f64> = scene.classes.iter().map(|class| class_similarity(&goal.class, class)).collect();
    if similarity.contains(&1.0) {
        // Where things bear the very word that was said, those that bear another word for it are meant less.
        const OTHER_WORD: f64 = 0.75;
        similarity.iter_mut().filter(|value| **value == 0.95).for_each(|value| *value *= OTHER_WORD);
    }
    let mut found: Vec<Match> = Vec::new();
    for (index, thing) in scene.things.iter().enumerate() {
        let class =
            thing.classes.iter().map(|(class, weight)| similarity[*class as usize] * weight).fold(0.0, f64::max);
        if class > 0.05 {
            found.push(Match {
                id: thing.id,
                index,
                class,
                attributes: 1.0,
                room: 1.0,
                weakest_relation: 1.0,
                total: class * thing.trust,
            });
        }
    }
    if found.is_empty() || depth > 6 {
        return found;
    }
    let room_scores = rooms(goal, scene, viewer);
    for each in &mut found {
        let thing = &scene.things[each.index];
        each.attributes = goal
            .attributes
            .iter()
            .map(|attribute| attribute_score(attribute.kind, &attribute.word, attribute.negated, thing))
            .product();
        // A thing that no room holds yet may stand in any.
        each.room = room_scores.as_ref().map_or(1.0, |scores| thing.room.map_or(0.4, |room| scores[room]));
        each.total *= each.attributes * each.room;
    }
    for clause in &goal.relations {
        relate(clause, &mut found, scene, viewer, depth);
    }
    extremes(goal, &mut found, scene, viewer);
    found
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

fn attribute_score(kind: AttributeKind, word: &str, negated: bool, thing: &Thing) -> f64 {
    /// What is not known about a thing.
    const UNKNOWN: f64 = 0.5;
    let score = match kind {
        AttributeKind::Color => color_score(word, thing).unwrap_or(UNKNOWN),
        AttributeKind::Material => {
            let mut said = thing.words.split(' ').filter_map(material).peekable();
            match said.peek() {
                None => UNKNOWN,
                Some(_) => {
                    if said.any(|name| name == word) {
                        0.97
                    } else {
                        0.2
                    }
                }
            }
        }
        AttributeKind::Size(_) => return 1.0, // among the candidates, see `extremes`
        AttributeKind::Other => {
            let said =
                thing.words.split(' ').any(|other| other == word) || thing.words.contains(word) && word.contains(' ');
            if said { 0.97 } else { 0.6 }
        }
    };
    if negated { 1.02 - score.max(0.02) } else { score }
}

/// Colour by name where a name is known, else by the mean colour; both where both are known.
fn color_score(word: &str, thing: &Thing) -> Option<f64> {
    let wanted = color_rgb(word)?;
    // Captions open with the thing itself; later words are about its surroundings.
    let in_caption = || thing.words.split(' ').take(8).find(|said| color_rgb(said).is_some());
    let named = thing.color_name.as_deref().filter(|name| color_rgb(name).is_some()).or_else(in_caption).map(|name| {
        let is_grey = |word: &str| matches!(word, "gray" | "grey");
        if name == word || (is_grey(name) && is_grey(word)) {
            1.0
        } else {
            let rgb = color_rgb(name).expect("filtered above");
            0.4 * color_closeness(&wanted, &rgb)
        }
    });
    let measured = thing.color.map(|rgb| color_closeness(&wanted, &rgb));
    match (named, measured) {
        (Some(named), Some(measured)) => Some(0.75 * named + 0.25 * measured),
        (named, measured) => named.or(measured),
    }
}

/// 1 for equal colours, 0.5 at a distance of about 60 in a space of lightness (counted half, it follows the lamp) and two opponent axes.
fn color_closeness(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let opponent = |c: &[f64; 3]| [0.5 * (c[0] + c[1] + c[2]) / 3.0, c[0] - c[1], 0.5 * (c[0] + c[1]) - c[2]];
    let (a, b) = (opponent(a), opponent(b));
    let distance = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
    1.0 / (1.0 + (distance / 60.0).powi(2))
}

/// Multiplies the score of one relation clause into every candidate.
fn relate(clause: &RelationClause, found: &mut [Match], scene: &Scene, viewer: &Viewer, depth: usize) {
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
    for (each, score) in found.iter_mut().zip(scores) {
        const FLOOR: f64 = 1e-4; // a wrong relation never erases the class: at the end of a search it still ranks
        let score = if clause.negated { 1.0 - score } else { score }.clamp(FLOOR, 1.0);
        each.weakest_relation = each.weakest_relation.min(score);
        each.total *= score;
    }
}

fn shape<'a>(thing: &'a Thing, scene: &Scene) -> Shape<'a> {
    Shape {
        bounds: &thing.bounds,
        front: thing.front,
        is_container: thing.classes.first().is_some_and(|(class, _)| is_container(&scene.classes[*class as usize])),
    }
}

fn best_anchor(relation: SpatialRelation, each: &Match, anchors: &[Match], scene: &Scene, viewer: &Viewer) -> f64 {
    let subject = &scene.things[each.index];
    let subject_shape = shape(subject, scene);
    let score = |anchor: &Match| {
        let thing = &scene.things[anchor.index];
        let score = relation_score(relation, &subject_shape, &shape(thing, scene), viewer);
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

/// Superlatives, sizes and ordinals, among the candidates that the rest of the expression leaves.
fn extremes(goal: &Referring, found: &mut [Match], scene: &Scene, viewer: &Viewer) {
    let sizes = goal.attributes.iter().filter_map(|attribute| match attribute.kind {
        AttributeKind::Size(size) => Some((size, if attribute.negated { -0.6 } else { 0.6 })),
        _ => None,
    });
    let strong = goal.superlatives.iter().map(|superlative| (*superlative, 3.0));
    let wanted: Vec<(Superlative, f64)> = strong.chain(sizes).collect();
    if wanted.is_empty() && goal.ordinal.is_none() {
        return;
    }
    let best = found.iter().map(|each| each.total).fold(0.0, f64::max);
    let remaining: Vec<usize> = (0..found.len()).filter(|index| found[*index].total >= 0.5 * best).collect();
    if remaining.len() < 2 {
        return;
    }
    let order = goal.superlatives.first().copied().unwrap_or(Superlative::Nearest);
    let order_keys = keys(order, &remaining, found, scene, viewer);
    for (superlative, strength) in wanted {
        if goal.ordinal.is_some() && strength > 1.0 && superlative == order {
            continue; // it is the direction of counting
        }
        let keys = keys(superlative, &remaining, found, scene, viewer);
        let (low, high) =
            keys.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), key| (low.min(*key), high.max(*key)));
        let span = (high - low).max(1e-9);
        for (&index, key) in remaining.iter().zip(&keys) {
            let rank = if strength < 0.0 { (high - key) / span } else { (key - low) / span };
            found[index].total *= (-strength.abs() * rank).exp();
        }
    }
    if let Some(ordinal) = goal.ordinal {
        let mut sorted: Vec<(f64, usize)> =
            order_keys.into_iter().zip(remaining).map(|(key, index)| (key, index)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let wanted =
            if ordinal == u32::MAX { sorted.len() - 1 } else { (ordinal.max(1) as usize - 1).min(sorted.len() - 1) };
        for (position, (_, index)) in sorted.into_iter().enumerate() {
            if position != wanted {
                found[index].total *= 0.1;
            }
        }
    }
}

/// The key by which a superlative orders: the wanted end is the least.
fn keys(superlative: Superlative, remaining: &[usize], found: &[Match], scene: &Scene, viewer: &Viewer) -> Vec<f64> {
    let boxes: Vec<&Aabb> = remaining.iter().map(|index| &scene.things[found[*index].index].bounds).collect();
    let middle = Point3::from(
        boxes.iter().map(|bounds| bounds.center().coords).sum::<nalgebra::Vector3<f64>>() / boxes.len() as f64,
    );
    let forward = viewer.forward_to(&middle);
    let left = Vector2::new(-forward.y, forward.x);
    let key = |bounds: &Aabb| {
        let (center, sides) = (bounds.center(), bounds.sides_m());
        let offset = (center - viewer.position).xy();
        match superlative {
            Superlative::Nearest | Superlative::Frontmost => bounds.distance_to_point_m(&viewer.position),
            Superlative::Farthest | Superlative::Backmost => -bounds.distance_to_point_m(&viewer.position),
            Superlative::Largest => -bounds.volume_m3().max(1e-9).cbrt(),
            Superlative::Smallest => bounds.volume_m3().max(1e-9).cbrt(),
            Superlative::Tallest => -sides.z,
            Superlative::Shortest => sides.z,
            Superlative::Longest | Superlative::Widest => -sides.x.max(sides.y),
            Superlative::Narrowest => sides.x.max(sides.y),
            Superlative::Highest => -center.z,
            Superlative::Lowest => center.z,
            Superlative::Leftmost => -offset.dot(&left),
            Superlative::Rightmost => offset.dot(&left),
            Superlative::Middle => (center - middle).xy().norm(),
            Superlative::Corner => -corner_key_m(bounds, scene),
        }
    };
    boxes.into_iter().map(key).collect()
}

/// Distance from the middle of all things along both axes: large in the corners.
fn corner_key_m(bounds: &Aabb, scene: &Scene) -> f64 {
    let all = scene.things.iter().map(|thing| thing.bounds).reduce(|a, b| a.union(&b)).unwrap_or(*bounds);
    let offset = (bounds.center() - all.center()).xy();
    offset.x.abs().min(offset.y.abs())
}

/// The viewer of an expression: from its view clause, else at `position`, looking at each anchor.
fn viewer_of(goal: &Referring, scene: &Scene, position: &Point3<f64>) -> Viewer {
    let plain = Viewer { position: *position, forward: None };
    let Some(view) = &goal.view else { return plain };
    let mut seen = matches(&view.anchor, scene, &plain, 1);
    seen.sort_by(|a, b| b.total.total_cmp(&a.total).then(a.id.cmp(&b.id)));
    let Some(best) = seen.first() else {
        return plain;
    };
    let anchor = scene.things[best.index].bounds.center();
    let towards = (anchor - position).xy();
    match view.kind {
        // Whoever faces a thing with a front looks at its front.
        ViewKind::Facing => {
            let front = scene.things[best.index].front.map(|front| (anchor - front).xy());
            Viewer { position: *position, forward: Some(front.unwrap_or(towards)) }
        }
        ViewKind::BackTo => Viewer { position: *position, forward: Some(-towards) },
        ViewKind::From => Viewer { position: anchor, forward: Some(-towards) },
    }
}
