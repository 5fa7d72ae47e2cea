//! Soft spatial relations between boxes, each in [0, 1] with 0.5 as "about half of the people would say so".
//!
//! All fall strictly with distance as long as they do not vanish, so that a ranking always has a nearest one; and all are absolute, so that
//! a robot can also say that nothing it knows is near enough. The shapes follow notes of the field (LaSP's encoders, Sr3D's generator:
//! support gap <= 0.15 m, overlap > 0.3); the distances are those of rooms, boxes are allowed the 0.1 m of a mapped box.

use dsg::Aabb;
use nalgebra::{Point3, Vector2};

use crate::instruction::SpatialRelation;
use crate::oriented_box::OrientedBox;

/// Gap at which "near" is worth 0.5, metres.
const NEAR_HALF_M: f64 = 1.2;
/// Vertical error of a mapped box that costs nothing, metres: two voxels.
const BOX_ERROR_M: f64 = 0.1;

/// Where left, right, front and behind are seen from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewer {
    /// Where the viewer stands.
    pub position: Point3<f64>,
    /// Fixed plan direction of the view; None = the viewer looks at the anchor.
    pub forward: Option<Vector2<f64>>,
}

impl Viewer {
    /// Plan direction of the view when judging a relation to `anchor`.
    pub fn forward_to(&self, anchor: &Point3<f64>) -> Vector2<f64> {
        let towards = self.forward.unwrap_or_else(|| (anchor - self.position).xy());
        towards.try_normalize(1e-9).unwrap_or_else(Vector2::x)
    }
}

/// The facts about one thing that relations need.
#[derive(Debug, Clone, Copy)]
pub struct Shape<'a> {
    /// Its box.
    pub bounds: &'a Aabb,
    /// A point on its front face, if it has a front and that is known.
    pub front: Option<Point3<f64>>,
    /// Its box along its own axes, if that is known.
    pub oriented: Option<&'a OrientedBox>,
    /// Things are kept inside it (shelf, sink).
    pub is_container: bool,
}

/// Score of `subject relation anchor` for relations with one anchor. [`SpatialRelation::Closest`], `Farthest` and `Between` need more
/// than a pair: the first two are scored like `Near` and `Far` here.
pub fn relation_score(relation: SpatialRelation, subject: &Shape, anchor: &Shape, viewer: &Viewer) -> f64 {
    let (a, b) = (subject.bounds, anchor.bounds);
    match relation {
        SpatialRelation::Near | SpatialRelation::Closest => near(a, b),
        SpatialRelation::Far | SpatialRelation::Farthest => 1.0 - near(a, b),
        SpatialRelation::On => on(a, b, anchor.is_container),
        SpatialRelation::Supporting => on(b, a, subject.is_container),
        SpatialRelation::Under => under(a, b),
        SpatialRelation::Above => above(a, b),
        SpatialRelation::Inside => inside(a, b).max(if anchor.is_container { on(a, b, true) } else { 0.0 }),
        SpatialRelation::Containing => inside(b, a).max(if subject.is_container { on(b, a, true) } else { 0.0 }),
        // Used with it: where no group is known, what is on, in or near it may be. A known one decides in `groups.rs`.
        SpatialRelation::With | SpatialRelation::InGroup => {
            on(b, a, subject.is_container).max(inside(b, a)).max(0.9 * near(a, b))
        }
        SpatialRelation::Opposite => 1.0 / (1.0 + (nearness_key_m(a, b) / 3.0).powi(3)),
        SpatialRelation::AtEnd => near(a, b) * (0.4 + 0.6 * at_end(a, b)),
        SpatialRelation::Between => near(a, b),
        SpatialRelation::LeftOf | SpatialRelation::RightOf | SpatialRelation::InFrontOf | SpatialRelation::Behind => {
            lateral(relation, a, anchor, viewer)
        }
    }
}

/// The distance by which things are called nearer: the gap of the boxes, a tenth of the distance of the centres to break ties of
/// touching boxes.
pub fn nearness_key_m(a: &Aabb, b: &Aabb) -> f64 {
    a.gap_m(b) + 0.1 * (a.center() - b.center()).norm()
}

fn near(a: &Aabb, b: &Aabb) -> f64 {
    1.0 / (1.0 + (nearness_key_m(a, b) / NEAR_HALF_M).powi(3))
}

/// 1 beyond a short side of `b`, 0 beyond a long one; 1 for a square.
fn at_end(a: &Aabb, b: &Aabb) -> f64 {
    let half = b.sides_m().xy() / 2.0;
    let offset = (a.center() - b.center()).xy().abs();
    let (over_x_m, over_y_m) = (offset.x - half.x, offset.y - half.y);
    let (over_end_m, over_side_m) = if half.x >= half.y { (over_x_m, over_y_m) } else { (over_y_m, over_x_m) };
    if half.x.max(half.y) < 1.2 * half.x.min(half.y) {
        return 1.0;
    }
    1.0 / (1.0 + (-6.0 * (over_end_m - over_side_m)).exp())
}

fn on(a: &Aabb, b: &Aabb, container: bool) -> f64 {
    let overlap = a.footprint_overlap(b);
    let gap_m = a.horizontal_gap_m(b);
    if overlap <= 0.0 {
        return 0.15 * (-3.0 * gap_m).exp(); // beside it: a mapped box may be off, but this is not "on"
    }
    let dz_m = a.min.z - b.max.z;
    let rests = (-((dz_m.abs() - BOX_ERROR_M).max(0.0)) / 0.2).exp();
    // A mapped table often includes what lies on it, and a shelf has inner boards: then the thing is within the box, above its middle.
    let (size_a, size_b) = (a.sides_m(), b.sides_m());
    let smaller = size_a.x * size_a.y < size_b.x * size_b.y;
    let held = if container && b.inflated(BOX_ERROR_M).contains(&a.center()) {
        0.9
    } else if smaller && a.center().z > b.center().z && a.center().z < b.max.z + BOX_ERROR_M {
        0.7
    } else {
        0.0
    };
    let order = if a.center().z >= b.center().z { 1.0 } else { 0.2 };
    (overlap / 0.3).min(1.0) * (rests * order).max(held)
}

fn under(a: &Aabb, b: &Aabb) -> f64 {
    let overlap = a.footprint_overlap(b);
    if overlap <= 0.0 {
        return 0.15 * (-3.0 * a.horizontal_gap_m(b)).exp();
    }
    let sticks_out_m = (a.max.z - b.max.z).max(0.0);
    let order = if a.center().z < b.center().z { 1.0 } else { 0.2 };
    let drop_m = (b.min.z - a.max.z).max(0.0);
    (overlap / 0.3).min(1.0) * order * (-sticks_out_m / 0.2 - 0.2 * drop_m).exp()
}

fn above(a: &Aabb, b: &Aabb) -> f64 {
    let gap_m = a.horizontal_gap_m(b);
    let order = if a.center().z > b.center().z { 1.0 } else { 0.1 };
    let sinks_m = (b.max.z - a.min.z - BOX_ERROR_M).max(0.0);
    let rise_m = (a.min.z - b.max.z).max(0.0);
    let overlap = a.footprint_overlap(b);
    let side = if overlap > 0.0 { (overlap / 0.2).min(1.0) } else { 0.6 * (-3.0 * gap_m).exp() };
    side * order * (-sinks_m / 0.3 - 0.3 * rise_m).exp()
}

fn inside(a: &Aabb, b: &Aabb) -> f64 {
    let b = b.inflated(0.05);
    (0..3)
        .map(|k| {
            let common = (a.max[k].min(b.max[k]) - a.min[k].max(b.min[k])).max(0.0);
            let side = (a.max[k] - a.min[k]).max(0.01);
            (common.max(if a.min[k] >= b.min[k] && a.max[k] <= b.max[k] { 0.01 } else { 0.0 }) / side).min(1.0)
        })
        .product()
}

fn lateral(relation: SpatialRelation, a: &Aabb, anchor: &Shape, viewer: &Viewer) -> f64 {
    let b = anchor.bounds;
    let offset = (a.center() - b.center()).xy();
    let Some(direction) = offset.try_normalize(1e-6) else {
        return 0.0;
    };
    let forward = match (viewer.forward, anchor.front) {
        // An anchor with a front and nobody's view in the text: the viewer looks at the front (Sr3D's allocentric relations).
        (None, Some(front)) => facing_front(anchor, &front).unwrap_or_else(|| viewer.forward_to(&b.center())),
        _ => viewer.forward_to(&b.center()),
    };
    let left = Vector2::new(-forward.y, forward.x);
    let cosine = match relation {
        SpatialRelation::LeftOf => direction.dot(&left),
        SpatialRelation::RightOf => -direction.dot(&left),
        SpatialRelation::InFrontOf => -direction.dot(&forward),
        _ => direction.dot(&forward),
    };
    cosine.max(0.0) * (-0.35 * a.horizontal_gap_m(b)).exp()
}

/// Plan direction of somebody who looks at the front of a thing.
pub fn facing_front(thing: &Shape, front: &Point3<f64>) -> Option<Vector2<f64>> {
    let center = thing.oriented.map_or_else(|| thing.bounds.center(), |oriented| oriented.center);
    (center - front).xy().try_normalize(1e-6)
}

/// Score of "`subject` is between `a` and `b`" in plan: on the way from one to the other, not beside it or beyond the ends.
pub fn between_score(subject: &Aabb, a: &Aabb, b: &Aabb) -> f64 {
    let (p, q, s) = (a.center().xy(), b.center().xy(), subject.center().xy());
    let axis = q - p;
    let length_m = axis.norm();
    if length_m < 1e-6 {
        return 0.0;
    }
    let along = (s - p).dot(&axis) / (length_m * length_m);
    let across_m = ((s - p).x * axis.y - (s - p).y * axis.x).abs() / length_m;
    let half_width_m = 0.25 * (a.sides_m().xy().norm() + b.sides_m().xy().norm()) / 2.0;
    let beyond = (along - 1.0).max(-along).max(0.0);
    (-1.2 * (across_m - half_width_m).max(0.0) - 6.0 * beyond - 0.8 * (along - 0.5).abs()).exp()
        * (-0.05 * length_m).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn cube(x: f64, y: f64, z: f64, side_m: f64) -> Aabb {
        Aabb::from_center(Point3::new(x, y, z), Vector3::repeat(side_m))
    }

    fn score(relation: SpatialRelation, a: &Aabb, b: &Aabb) -> f64 {
        let viewer = Viewer { position: Point3::new(-5.0, 0.0, 0.0), forward: None };
        let shape = |bounds| Shape { bounds, front: None, oriented: None, is_container: false };
        relation_score(relation, &shape(a), &shape(b), &viewer)
    }

    #[test]
    fn a_mug_on_a_table_is_on_it_and_near_it_and_not_under_it() {
        let table = Aabb { min: Point3::new(0.0, 0.0, 0.0), max: Point3::new(1.6, 0.8, 0.75) };
        let mug = cube(0.5, 0.4, 0.80, 0.1);
        assert!(score(SpatialRelation::On, &mug, &table) > 0.95);
        assert!(score(SpatialRelation::Supporting, &table, &mug) > 0.95);
        assert!(score(SpatialRelation::Near, &mug, &table) > 0.9);
        assert!(score(SpatialRelation::Under, &mug, &table) < 0.3);
        // The same mug when the mapped table has swallowed it.
        let swollen = Aabb { max: Point3::new(1.6, 0.8, 0.9), ..table };
        assert!(score(SpatialRelation::On, &mug, &swollen) > 0.5);
        let bin = cube(0.5, 0.4, 0.2, 0.3);
        assert!(score(SpatialRelation::Under, &bin, &table) > 0.9);
        assert!(score(SpatialRelation::On, &bin, &table) < 0.3);
    }

    #[test]
    fn sides_are_those_of_a_viewer_looking_at_the_anchor() {
        // The viewer stands at x = -5 and looks along +x: +y is left, nearer x is in front.
        let desk = cube(0.0, 0.0, 0.4, 0.8);
        assert!(score(SpatialRelation::LeftOf, &cube(0.0, 1.0, 0.4, 0.4), &desk) > 0.8);
        assert_eq!(score(SpatialRelation::RightOf, &cube(0.0, 1.0, 0.4, 0.4), &desk), 0.0);
        assert!(score(SpatialRelation::InFrontOf, &cube(-1.0, 0.0, 0.4, 0.4), &desk) > 0.8);
        assert!(score(SpatialRelation::Behind, &cube(1.0, 0.0, 0.4, 0.4), &desk) > 0.8);
    }

    #[test]
    fn near_has_its_half_at_the_named_distance() {
        let value = score(SpatialRelation::Near, &cube(0.0, 0.0, 0.0, 0.2), &cube(1.3, 0.0, 0.0, 0.2));
        assert!((0.4..0.6).contains(&value), "{value}"); // gap 1.1 m, centres 1.3 m: key 1.23 m
        assert!(
            (score(SpatialRelation::Near, &cube(0.0, 0.0, 0.0, 1.0), &cube(0.0, 0.0, 0.0, 1.0)) - 1.0).abs() < 1e-12
        );
    }

    #[test]
    fn between_is_on_the_way() {
        let (sofa, tv) = (cube(0.0, 0.0, 0.4, 0.8), cube(4.0, 0.0, 0.4, 0.8));
        assert!(between_score(&cube(2.0, 0.0, 0.2, 0.5), &sofa, &tv) > 0.7);
        assert!(between_score(&cube(2.0, 3.0, 0.2, 0.5), &sofa, &tv) < 0.1);
        assert!(between_score(&cube(6.0, 0.0, 0.2, 0.5), &sofa, &tv) < 0.1);
        assert_eq!(between_score(&sofa, &sofa, &sofa), 0.0);
    }
}
