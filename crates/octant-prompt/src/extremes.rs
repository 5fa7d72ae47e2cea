//! Superlatives, sizes and ordinals: properties of a thing among the others.

use dsg::Aabb;
use nalgebra::{Point3, Vector2};

use crate::grounding::Match;
use crate::instruction::{AttributeKind, Referring, Superlative};
use crate::relations::Viewer;
use crate::scene::Scene;

/// Superlatives, sizes and ordinals, among the candidates that the rest of the expression leaves.
pub(crate) fn extremes(
    goal: &Referring,
    found: &mut [Match],
    score: impl Fn(&mut Match) -> &mut f64,
    scene: &Scene,
    viewer: &Viewer,
) {
    let sizes = goal.attributes.iter().filter_map(|attribute| match attribute.kind {
        AttributeKind::Size(size) => Some((size, if attribute.negated { -0.6 } else { 0.6 })),
        _ => None,
    });
    let strong = goal.superlatives.iter().map(|superlative| (*superlative, 3.0));
    let wanted: Vec<(Superlative, f64)> = strong.chain(sizes).collect();
    let ordinal = goal.ordinal.filter(|_| goal.ordinal_clause().is_none());
    if wanted.is_empty() && ordinal.is_none() {
        return;
    }
    let best = found.iter_mut().map(|each| *score(each)).fold(0.0, f64::max);
    let remaining: Vec<usize> = (0..found.len()).filter(|index| *score(&mut found[*index]) >= 0.5 * best).collect();
    if remaining.len() < 2 {
        return;
    }
    let order = goal.superlatives.first().copied().unwrap_or(Superlative::Nearest);
    let order_keys = keys(order, &remaining, found, scene, viewer);
    for (superlative, strength) in wanted {
        if ordinal.is_some() && strength > 1.0 && superlative == order {
            continue; // it is the direction of counting
        }
        let keys = keys(superlative, &remaining, found, scene, viewer);
        let (low, high) =
            keys.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), key| (low.min(*key), high.max(*key)));
        let span = (high - low).max(1e-9);
        for (&index, key) in remaining.iter().zip(&keys) {
            let rank = if strength < 0.0 { (high - key) / span } else { (key - low) / span };
            *score(&mut found[index]) *= (-strength.abs() * rank).exp();
        }
    }
    if let Some(ordinal) = ordinal {
        let mut sorted: Vec<(f64, usize)> = order_keys.into_iter().zip(remaining).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let wanted =
            if ordinal == u32::MAX { sorted.len() - 1 } else { (ordinal.max(1) as usize - 1).min(sorted.len() - 1) };
        for (position, (_, index)) in sorted.into_iter().enumerate() {
            if position != wanted {
                *score(&mut found[index]) *= 0.1;
            }
        }
    }
}

/// The key of every candidate, the wanted end least.
pub(crate) fn in_order(superlative: Superlative, found: &[Match], scene: &Scene, viewer: &Viewer) -> Vec<f64> {
    keys(superlative, &(0..found.len()).collect::<Vec<_>>(), found, scene, viewer)
}

/// The key by which a superlative orders: the wanted end is the least.
fn keys(superlative: Superlative, remaining: &[usize], found: &[Match], scene: &Scene, viewer: &Viewer) -> Vec<f64> {
    let boxes: Vec<&Aabb> = remaining.iter().map(|index| &scene.things[found[*index].index].bounds).collect();
    let mean = Point3::from(
        boxes.iter().map(|bounds| bounds.center().coords).sum::<nalgebra::Vector3<f64>>() / boxes.len() as f64,
    );
    // Two things have no middle one: then that of the scene counts.
    let middle = if boxes.len() > 2 { mean } else { scene_middle(scene) };
    let forward = viewer.forward_to(&mean);
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
            Superlative::Alone => -alone_key_m(bounds, &boxes),
        }
    };
    boxes.iter().copied().map(key).collect()
}

/// Gap to the nearest of the others.
fn alone_key_m(bounds: &Aabb, all: &[&Aabb]) -> f64 {
    let others = all.iter().filter(|other| !std::ptr::eq(**other, bounds));
    others.map(|other| other.gap_m(bounds)).fold(f64::INFINITY, f64::min).min(100.0)
}

/// Distance from the middle of all things along both axes: large in the corners.
fn corner_key_m(bounds: &Aabb, scene: &Scene) -> f64 {
    let offset = (bounds.center() - scene_middle(scene)).xy();
    offset.x.abs().min(offset.y.abs())
}

/// Middle of the box round all things.
fn scene_middle(scene: &Scene) -> Point3<f64> {
    let all = scene.things.iter().map(|thing| thing.bounds).reduce(|a, b| a.union(&b));
    all.map_or_else(Point3::origin, |all| all.center())
}
