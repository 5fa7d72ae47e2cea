//! What an expression singles out: of several things that answer, which one is meant?
//!
//! [`crate::relations`] says whether a relation holds, for a robot that may know only half of the building. A listener who knows the
//! scene hears more in the same words: "the chair near the window" is the nearest of the chairs, however far, and "the desk" is no table
//! where a desk stands. These are the scores by which candidates are ordered.

use dsg::{Aabb, ObjectId};
use nalgebra::{Point2, Vector2};

use crate::grounding::{Match, shape};
use crate::groups::group_score;
use crate::instruction::SpatialRelation;
use crate::oriented_box::OrientedBox;
use crate::relations::{Shape, Viewer, between_score, facing_front, relation_score};
use crate::scene::Scene;
use crate::sides::share_in_zone;
use crate::vocabulary::Class;

/// What is left of a candidate for which a relation does not hold at all.
const FLOOR: f64 = 0.05;
/// Anchors that are this much less meant than the best one are not looked at.
const WORTHY: f64 = 0.4;
/// Gap below which one thing rests on the other, metres.
const TOUCH_M: f64 = 0.06;
/// Weight of a thing with another word where one bears the very word that was said.
const OTHER_WORD: f64 = 0.45;
/// Difference of distance that costs a factor of e, metres.
const SCALE_M: f64 = 0.8;
/// Candidates that are this much less meant than the best by everything said before do not compete.
const RIVAL: f64 = 0.9;
/// Most anchors that are looked at.
const MAX_ANCHORS: usize = 12;

/// Multiplies the weight of the class in: words compete, the one that was said wins.
pub(crate) fn class(asked: &Class, found: &mut [Match], scene: &Scene) {
    let best = found.iter().map(|each| each.class).fold(0.0, f64::max);
    for each in found {
        let label = scene.things[each.index].classes.first().map(|(class, _)| &scene.classes[*class as usize]);
        // Where one label is "kitchen cabinet" and another "kitchen cabinets", the number tells them apart.
        let number = label.is_none_or(|label| label.is_plural == asked.is_plural);
        // "bin": a storage bin bears the word, a trash can only its meaning.
        let bears = label.is_some_and(|label| label.text.split(' ').next_back() == Some(asked.text.as_str()));
        let class = if bears { each.class.max(0.95) } else { each.class };
        let word = if class < best { OTHER_WORD * (class / best).powi(4) } else { 1.0 };
        each.rank *= word * if number { 1.0 } else { 0.85 };
    }
}

/// Anchors worth a look, the best first, weights relative to it.
fn worthy(anchors: &[Match]) -> Vec<(f64, usize)> {
    let top = anchors.iter().map(|anchor| anchor.rank).fold(0.0, f64::max);
    let mut best: Vec<(f64, usize)> = anchors
        .iter()
        .filter(|anchor| anchor.rank >= WORTHY * top)
        .map(|anchor| ((anchor.rank / top.max(1e-300)), anchor.index))
        .collect();
    best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    best.truncate(MAX_ANCHORS);
    best
}

/// Score of each candidate for one relation, in (0, 1].
pub(crate) fn relation(
    relation: SpatialRelation,
    found: &[Match],
    anchors: &[Vec<Match>],
    scene: &Scene,
    viewer: &Viewer,
) -> Vec<f64> {
    let first = worthy(&anchors[0]);
    match relation {
        SpatialRelation::Near | SpatialRelation::Closest => nearness(found, &first, scene, 1.0),
        SpatialRelation::Far | SpatialRelation::Farthest => nearness(found, &first, scene, -1.0),
        SpatialRelation::Between => {
            let second = if anchors.len() > 1 { worthy(&anchors[1]) } else { first.clone() };
            found.iter().map(|each| between(each, &first, &second, scene).max(FLOOR)).collect()
        }
        SpatialRelation::AtEnd | SpatialRelation::InFrontOf | SpatialRelation::Behind => {
            let near = nearness(found, &first, scene, 1.0);
            let sides = found.iter().map(|each| {
                let subject = shape(&scene.things[each.index], scene);
                let score = |&(weight, index): &(f64, usize)| {
                    weight * pair(relation, &subject, &shape(&scene.things[index], scene), viewer)
                };
                first.iter().filter(|anchor| anchor.1 != each.index).map(score).fold(FLOOR, f64::max)
            });
            // Without a front of its own a thing has no sides that people agree about; they mean what is near.
            let has_sides = relation != SpatialRelation::AtEnd
                && first.iter().any(|(_, index)| scene.things[*index].front.is_some());
            let weight = if has_sides { 0.0 } else { 0.4 };
            near.into_iter().zip(sides).map(|(near, side)| near.powf(weight) * side).collect()
        }
        SpatialRelation::Opposite => opposite(found, &first, scene),
        SpatialRelation::InGroup => found
            .iter()
            .map(|each| {
                let score = |&(weight, index): &(f64, usize)| weight * group_score(each.index, index, scene, viewer);
                first.iter().filter(|anchor| anchor.1 != each.index).map(score).fold(FLOOR, f64::max)
            })
            .collect(),
        _ => found
            .iter()
            .map(|each| {
                let subject = shape(&scene.things[each.index], scene);
                let score = |&(weight, index): &(f64, usize)| {
                    weight * pair(relation, &subject, &shape(&scene.things[index], scene), viewer)
                };
                first.iter().filter(|anchor| anchor.1 != each.index).map(score).fold(FLOOR, f64::max)
            })
            .collect(),
    }
}

/// One relation of one pair.
fn pair(relation: SpatialRelation, subject: &Shape, anchor: &Shape, viewer: &Viewer) -> f64 {
    let score = relation_score(relation, subject, anchor, viewer);
    match relation {
        SpatialRelation::LeftOf | SpatialRelation::RightOf | SpatialRelation::InFrontOf | SpatialRelation::Behind => {
            // A thing with a front has sides of its own, unless the text lets the viewer look elsewhere.
            let Some((oriented, front)) = anchor.oriented.zip(anchor.front) else { return score };
            let is_looked_at = viewer.forward.is_none_or(|forward| {
                facing_front(anchor, &front).is_some_and(|own| own.dot(&forward) > 0.9 * forward.norm())
            });
            if !is_looked_at {
                return score;
            }
            let corners = subject.oriented.map_or_else(|| plan_corners(subject.bounds), OrientedBox::corners);
            0.25 * score + 0.75 * share_in_zone(relation, &corners, oriented)
        }
        // Under a window or a picture: what hangs on a wall has no footprint to be under.
        SpatialRelation::Under if subject.bounds.footprint_overlap(anchor.bounds) <= 0.0 => {
            let is_lower = subject.bounds.center().z < anchor.bounds.center().z;
            if is_lower { 0.6 * (-2.0 * subject.bounds.horizontal_gap_m(anchor.bounds)).exp() } else { 0.0 }
        }
        // What a thing stands on carries it rather than being under it.
        SpatialRelation::Under if anchor.bounds.min.z - subject.bounds.max.z < TOUCH_M => 0.75 * score,
        _ => score,
    }
}

/// Corners of the footprint, counter-clockwise.
fn plan_corners(bounds: &Aabb) -> [Vector2<f64>; 4] {
    let (low, high) = (bounds.min, bounds.max);
    [(high.x, high.y), (low.x, high.y), (low.x, low.y), (high.x, low.y)].map(|(x, y)| Vector2::new(x, y))
}

fn between(each: &Match, first: &[(f64, usize)], second: &[(f64, usize)], scene: &Scene) -> f64 {
    let subject = &scene.things[each.index].bounds;
    let mut top: f64 = 0.0;
    for &(weight_a, a) in first {
        for &(weight_b, b) in second {
            if a != b && a != each.index && b != each.index {
                let score = between_score(subject, &scene.things[a].bounds, &scene.things[b].bounds);
                top = top.max(weight_a * weight_b * score);
            }
        }
    }
    top
}

/// "Across from": on the other side of the middle of the room, as seen from the anchor.
fn opposite(found: &[Match], anchors: &[(f64, usize)], scene: &Scene) -> Vec<f64> {
    let score = |each: &Match, &(weight, index): &(f64, usize)| {
        let anchor = &scene.things[index];
        let from = anchor.bounds.center().xy();
        let across = middle_of_room(anchor.room, scene) - from;
        let offset = scene.things[each.index].bounds.center().xy() - from;
        let Some(inward) = across.try_normalize(1e-6) else { return FLOOR };
        let along_m = offset.dot(&inward);
        let aside_m = (offset - inward * along_m).norm();
        if along_m <= 0.0 { FLOOR } else { weight * (-aside_m / (0.3 + along_m)).exp() }
    };
    found
        .iter()
        .map(|each| {
            let others = anchors.iter().filter(|anchor| anchor.1 != each.index);
            others.map(|anchor| score(each, anchor)).fold(FLOOR, f64::max)
        })
        .collect()
}

/// Plan middle of the box round everything in a room (round the things that no room holds, for None).
fn middle_of_room(room: Option<usize>, scene: &Scene) -> Point2<f64> {
    let things = scene.things.iter().filter(|thing| thing.room == room);
    let all = things.map(|thing| thing.bounds).reduce(|a, b| a.union(&b));
    all.map_or_else(Point2::origin, |all| all.center().xy())
}

/// The distance by which candidates compete: the gap, and a part of the distance of the centres for things that touch.
fn key_m(a: &Aabb, b: &Aabb) -> f64 {
    a.gap_m(b) + 0.3 * (a.center() - b.center()).norm()
}

/// The n-th nearest to (or farthest from) the anchors among those of the class.
pub(crate) fn nth(relation: SpatialRelation, n: u32, found: &[Match], anchors: &[Match], scene: &Scene) -> Vec<f64> {
    let sign = if matches!(relation, SpatialRelation::Farthest) { -1.0 } else { 1.0 };
    let keys = keys_m(found, &worthy(anchors), scene, sign);
    let mut order: Vec<(f64, ObjectId)> = rivals(found, &keys).map(|index| (keys[index], found[index].id)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let position = if n == u32::MAX { order.len().saturating_sub(1) } else { n.max(1) as usize - 1 };
    let wanted = order.get(position.min(order.len().saturating_sub(1))).map(|(_, id)| *id);
    found.iter().map(|each| if Some(each.id) == wanted { 1.0 } else { FLOOR }).collect()
}

/// The key by which candidates are ordered, the nearest (or the farthest) first.
pub(crate) fn distances(relation: SpatialRelation, found: &[Match], anchors: &[Match], scene: &Scene) -> Vec<f64> {
    keys_m(found, &worthy(anchors), scene, if relation == SpatialRelation::Farthest { -1.0 } else { 1.0 })
}

/// Distance of each candidate to its nearest anchor, times `sign`.
fn keys_m(found: &[Match], anchors: &[(f64, usize)], scene: &Scene, sign: f64) -> Vec<f64> {
    found
        .iter()
        .map(|each| {
            let own = &scene.things[each.index].bounds;
            let key = |&(weight, index): &(f64, usize)| key_m(own, &scene.things[index].bounds) - SCALE_M * weight.ln();
            anchors.iter().filter(|anchor| anchor.1 != each.index).map(key).fold(f64::INFINITY, f64::min) * sign
        })
        .collect()
}

/// Candidates that compete for being the nearest: by all that was said before, they are meant about as much as the best.
fn rivals<'a>(found: &'a [Match], keys: &'a [f64]) -> impl Iterator<Item = usize> + 'a {
    let top = found.iter().map(|each| each.rank).fold(0.0, f64::max);
    (0..found.len()).filter(move |index| keys[*index].is_finite() && found[*index].rank >= RIVAL * top)
}

/// Nearest (`sign` 1) or farthest (-1) among those of the class.
fn nearness(found: &[Match], anchors: &[(f64, usize)], scene: &Scene, sign: f64) -> Vec<f64> {
    let keys = keys_m(found, anchors, scene, sign);
    let best = rivals(found, &keys).map(|index| keys[index]).fold(f64::INFINITY, f64::min);
    keys.iter()
        .map(|key| {
            if key.is_finite() && best.is_finite() {
                (-(key - best).max(0.0) / SCALE_M).exp().max(FLOOR)
            } else {
                FLOOR
            }
        })
        .collect()
}
