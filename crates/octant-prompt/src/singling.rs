//! What an expression singles out: of several things that answer, which one is meant?
//!
//! [`crate::relations`] says whether a relation holds, for a robot that may know only half of the building. A listener who knows the
//! scene hears more in the same words: "the chair near the window" is the nearest of the chairs, however far, and "the desk" is no table
//! where a desk stands. These are the scores by which candidates are ordered.

use dsg::Aabb;

use crate::grounding::{Match, shape};
use crate::instruction::SpatialRelation;
use crate::relations::{Viewer, between_score, relation_score};
use crate::scene::Scene;

/// What is left of a candidate for which a relation does not hold at all.
const FLOOR: f64 = 0.02;
/// Anchors that are this much less meant than the best one are not looked at.
const WORTHY: f64 = 0.15;
/// Most anchors that are looked at.
const MAX_ANCHORS: usize = 12;

/// Multiplies the weight of the class in: words compete, the one that was said wins.
pub(crate) fn class(found: &mut [Match]) {
    let best = found.iter().map(|each| each.class).fold(0.0, f64::max);
    for each in found {
        each.rank *= (each.class / best).powi(4);
    }
}

/// Anchors worth a look, the best first, weights relative to it.
fn worthy(anchors: &[Match]) -> Vec<(f64, usize)> {
    let top = anchors.iter().map(|anchor| anchor.rank).fold(0.0, f64::max);
    let mut best: Vec<(f64, usize)> = anchors
        .iter()
        .filter(|anchor| anchor.rank >= WORTHY * top)
        .map(|anchor| ((anchor.rank / top.max(1e-300)).sqrt(), anchor.index))
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
        _ => found
            .iter()
            .map(|each| {
                let subject = shape(&scene.things[each.index], scene);
                let score = |&(weight, index): &(f64, usize)| {
                    weight * relation_score(relation, &subject, &shape(&scene.things[index], scene), viewer)
                };
                first.iter().filter(|anchor| anchor.1 != each.index).map(score).fold(FLOOR, f64::max)
            })
            .collect(),
    }
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

/// The distance by which candidates compete: the gap, and a part of the distance of the centres for things that touch.
fn key_m(a: &Aabb, b: &Aabb) -> f64 {
    a.gap_m(b) + 0.3 * (a.center() - b.center()).norm()
}

/// Nearest (`sign` 1) or farthest (-1) among those of the class.
fn nearness(found: &[Match], anchors: &[(f64, usize)], scene: &Scene, sign: f64) -> Vec<f64> {
    /// Difference of distance that costs a factor of e, metres.
    const SCALE_M: f64 = 0.5;
    let keys: Vec<f64> = found
        .iter()
        .map(|each| {
            let own = &scene.things[each.index].bounds;
            let key = |&(weight, index): &(f64, usize)| key_m(own, &scene.things[index].bounds) - SCALE_M * weight.ln();
            anchors.iter().filter(|anchor| anchor.1 != each.index).map(key).fold(f64::INFINITY, f64::min) * sign
        })
        .collect();
    let class = found.iter().map(|each| each.class).fold(0.0, f64::max);
    let rivals = keys.iter().zip(found).filter(|(key, each)| key.is_finite() && each.class >= 0.9 * class);
    let best = rivals.map(|(key, _)| *key).fold(f64::INFINITY, f64::min);
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
