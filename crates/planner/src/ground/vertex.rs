//! Vertices round a convex corner: where a disc of the robot's radius may bend round an obstacle.
//!
//! They lie on a polygon circumscribed about the circle of the clearance round the corner, each with the two directions in
//! which the inflated outline passes it. An edge of a shortest path leaves the obstacle on one side at both its ends, like a
//! rubber band ([`Vertex::is_taut`]; FAR Planner's reduced directions).

use nalgebra::{Point2, Vector2};

/// Vertices are circumscribed with steps of at most this turn: 8 % longer radius at 45 degrees.
const MAX_TURN_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// A vertex of a visibility graph, in cell units, with the two directions of the inflated outline there (obstacle on the left).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vertex {
    pub at: Point2<f64>,
    pub before: Vector2<f64>,
    pub after: Vector2<f64>,
}

impl Vertex {
    /// Whether a straight line along `across` through this vertex has the obstacle on one side only; `slack` is the sine of the
    /// angle by which it may fail.
    pub fn is_taut(&self, across: &Vector2<f64>, length: f64, slack: f64) -> bool {
        let slack = slack * length;
        let (first, second) = (self.before.perp(across), across.perp(&self.after));
        (first >= -slack && second >= -slack) || (first <= slack && second <= slack)
    }
}

/// Calls `found` for the vertices outside the convex corners of one simplified ring (obstacle on the left). A vertex lies outside the
/// wavering of the simplified walls at its corner, `waver(k)` cells, where there is room for it (`is_free`), else tight; where there is
/// no room at all there is none. Corners that turn by less than `least_turn_rad` are walls.
pub(crate) fn vertices_round(
    ring: &[[f64; 2]],
    radius: f64,
    waver: impl Fn(usize) -> f64,
    least_turn_rad: f64,
    is_free: impl Fn(&Point2<f64>) -> bool,
    mut found: impl FnMut(Vertex),
) {
    let n = ring.len();
    for k in 0..n {
        let corner = Point2::from(ring[k]);
        let before = (corner - Point2::from(ring[(k + n - 1) % n])).normalize();
        let after = (Point2::from(ring[(k + 1) % n]) - corner).normalize();
        let turn = before.perp(&after).atan2(before.dot(&after));
        if turn <= least_turn_rad {
            continue;
        }
        let steps = (turn / MAX_TURN_RAD - 1e-9).ceil().max(1.0);
        let step = turn / steps;
        for s in 0..steps as usize {
            let outward = rotate(&Vector2::new(before.y, -before.x), (s as f64 + 0.5) * step);
            let directions = (rotate(&before, s as f64 * step), rotate(&before, (s as f64 + 1.0) * step));
            for room in [waver(k).max(1e-6), 0.5 * waver(k), 1e-6] {
                let at = corner + outward * ((radius + room) / (0.5 * step).cos());
                if is_free(&at) {
                    found(Vertex { at, before: directions.0, after: directions.1 });
                    break;
                }
            }
        }
    }
}

fn rotate(v: &Vector2<f64>, angle: f64) -> Vector2<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_gets_two_vertices_at_each_corner_on_the_circumscribed_octagon() {
        let ring = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let mut vertices = Vec::new();
        vertices_round(&ring, 1.0, |_| 0.0, 1e-6, |_| true, |v| vertices.push(v));
        assert_eq!(vertices.len(), 8);
        // At the corner (2, 2): outward at 22.5 and 67.5 degrees, 1 / cos(22.5 degrees) away.
        let tan = (std::f64::consts::PI / 8.0).tan();
        let expected = [Point2::new(3.0, 2.0 + tan), Point2::new(2.0 + tan, 3.0)];
        for (vertex, at) in vertices[4..6].iter().zip(expected) {
            assert!((vertex.at - at).norm() < 1e-5, "{:?}", vertex.at);
        }
        // Straight up past the right side is taut, straight away from the corner is not.
        assert!(vertices[4].is_taut(&Vector2::new(0.0, 1.0), 1.0, 0.01));
        assert!(!vertices[4].is_taut(&Vector2::new(1.0, 0.4), 1.08, 0.01));
    }

    #[test]
    fn where_there_is_no_room_there_is_no_vertex() {
        let ring = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let mut count = 0;
        vertices_round(&ring, 1.0, |_| 1.5, 1e-6, |p| p.x < 1.0, |_| count += 1);
        assert_eq!(count, 4);
    }
}
