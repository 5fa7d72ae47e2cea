//! Where to stand to have a thing before one's eyes.

use dsg::Aabb;
use nalgebra::{Point2, Point3, Vector2};

use crate::reach::ReachMap;

/// A pose from which a thing can be looked at from nearby.
#[derive(Debug, Clone, PartialEq)]
pub struct Stand {
    /// Where the body's origin shall be.
    pub at: Point2<f64>,
    /// Heading toward the thing.
    pub heading_rad: f64,
    /// Floor distance to its box.
    pub distance_m: f64,
    /// Length of the way there.
    pub way_m: f64,
    /// Whether the map shows nothing between the eye and the thing.
    pub is_visible: bool,
}

/// Spacing of the candidate positions.
const STEP_M: f64 = 0.10;
/// What a hidden candidate costs against a visible one, in metres of way: the other side of a wall is no place to look from.
const HIDDEN_COST_M: f64 = 30.0;
/// What a metre beyond the wanted distance costs, in metres of way.
const FAR_COST: f64 = 20.0;
/// What a metre costs that the robot lacks for turning on the spot, in metres of way.
const TIGHT_COST: f64 = 15.0;

/// Finds the best place to look at `bounds` from at most `distance_m` (floor distance to the box), for an eye at `eye_m`
/// above the world's zero. If nothing is reachable that near, places up to `fallback_m` count, at a price. `is_clear(eye,
/// thing)` says whether the map shows nothing between, `lacking_m(point)` how much room the robot lacks there to turn.
/// `None` if the robot cannot get near at all.
pub fn stand_before(
    bounds: &Aabb,
    reach: &ReachMap,
    eye_m: f64,
    distance_m: f64,
    fallback_m: f64,
    is_clear: &dyn Fn(&Point3<f64>, &Point3<f64>) -> bool,
    lacking_m: &dyn Fn(&Point2<f64>) -> f64,
) -> Option<Stand> {
    let mut candidates: Vec<(Point2<f64>, f64)> = Vec::new();
    let (min, max) = (bounds.min.xy(), bounds.max.xy());
    let reach_m = fallback_m;
    let columns = ((max.x - min.x + 2.0 * reach_m) / STEP_M).ceil() as usize;
    let rows = ((max.y - min.y + 2.0 * reach_m) / STEP_M).ceil() as usize;
    for iy in 0..=rows {
        for ix in 0..=columns {
            let point = Point2::new(min.x - reach_m + ix as f64 * STEP_M, min.y - reach_m + iy as f64 * STEP_M);
            if floor_distance_m(bounds, &point) <= reach_m
                && let Some(way_m) = reach.length_at(&point)
            {
                candidates.push((point, way_m));
            }
        }
    }
    let middle = bounds.center();
    let mut best: Option<(f64, Stand)> = None;
    for (point, way_m) in &candidates {
        let way_m = *way_m;
        let distance = floor_distance_m(bounds, point);
        let toward = middle.xy() - point;
        let eye = Point3::new(point.x, point.y, eye_m);
        // The upper half of the thing is what a neighbour on the same table hides last.
        let aims = [middle, Point3::new(middle.x, middle.y, bounds.max.z - 0.2 * (bounds.max.z - bounds.min.z))];
        let is_visible = aims.iter().any(|aim| is_clear(&eye, &in_front_of(&eye, aim, bounds)));
        let cost = way_m
            + FAR_COST * (distance - distance_m).max(0.0)
            + if is_visible { 0.0 } else { HIDDEN_COST_M }
            + TIGHT_COST * lacking_m(point)
            // Among equals, a little room to breathe.
            + (0.4 - distance).max(0.0) * 2.0;
        if best.as_ref().is_none_or(|(least, _)| cost < *least - 1e-9) {
            let heading_rad = toward.y.atan2(toward.x);
            best = Some((cost, Stand { at: *point, heading_rad, distance_m: distance, way_m, is_visible }));
        }
    }
    best.map(|(_, stand)| stand)
}

/// Distance on the floor from a point to a box, zero over it.
pub fn floor_distance_m(bounds: &Aabb, point: &Point2<f64>) -> f64 {
    let dx = (bounds.min.x - point.x).max(point.x - bounds.max.x).max(0.0);
    let dy = (bounds.min.y - point.y).max(point.y - bounds.max.y).max(0.0);
    Vector2::new(dx, dy).norm()
}

/// The last free point on the way from the eye to the aim: where the line enters the box, and a voxel before it, or the
/// thing would hide itself.
pub(crate) fn in_front_of(eye: &Point3<f64>, aim: &Point3<f64>, bounds: &Aabb) -> Point3<f64> {
    const MARGIN_M: f64 = 0.12;
    let direction = aim - eye;
    let length_m = direction.norm();
    if length_m < 1e-6 {
        return *aim;
    }
    // Slabs: the first parameter at which the line is inside the box along all axes.
    let mut enter: f64 = 0.0;
    for axis in 0..3 {
        if direction[axis].abs() > 1e-9 {
            let a = (bounds.min[axis] - eye[axis]) / direction[axis];
            let b = (bounds.max[axis] - eye[axis]) / direction[axis];
            enter = enter.max(a.min(b));
        }
    }
    let along = (enter.min(1.0) - MARGIN_M / length_m).max(0.0);
    eye + direction * along
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_distance_is_zero_over_the_box_and_euclidean_beside_it() {
        let bounds = Aabb { min: Point3::new(0.0, 0.0, 0.5), max: Point3::new(1.0, 2.0, 0.8) };
        assert_eq!(floor_distance_m(&bounds, &Point2::new(0.5, 1.0)), 0.0);
        assert!((floor_distance_m(&bounds, &Point2::new(4.0, 6.0)) - 5.0).abs() < 1e-12);
    }

    #[test]
    fn the_line_ends_before_the_box() {
        let bounds = Aabb { min: Point3::new(2.0, -0.1, 0.0), max: Point3::new(2.2, 0.1, 1.0) };
        let end = in_front_of(&Point3::new(0.0, 0.0, 0.5), &bounds.center(), &bounds);
        assert!((end.x - 1.88).abs() < 1e-9, "{end}");
    }
}
