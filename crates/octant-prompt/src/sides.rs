//! The four sides of a thing that has a front, as zones on the floor (the allocentric relations of Sr3D's generator).
//!
//! ```text
//!        \        /      Beyond a face the zone opens by 10 degrees over a depth of min(2 l, 1 m), l the depth of the box, and goes on
//!         \  front/      as a strip for 4 m. Left and right are those of a viewer who looks at the front.
//!     _____|______|_____
//!   right  | box  |  left
//! ```

use nalgebra::Vector2;

use crate::instruction::SpatialRelation;
use crate::oriented_box::OrientedBox;

/// tan 10 degrees.
const OPENING: f64 = 0.176_326_980_708_465;
/// Length of the strip behind the opening, metres.
const STRIP_M: f64 = 4.0;

/// Share of the plan polygon `subject` (convex, counter-clockwise) that lies in the zone of `anchor` named by the relation, in [0, 1];
/// zero for relations that are no side. The front of the box is at its negative x face.
pub fn share_in_zone(relation: SpatialRelation, subject: &[Vector2<f64>; 4], anchor: &OrientedBox) -> f64 {
    // Axes of the zone: `out` away from the face, `along` parallel to it.
    let (half_depth_m, half_width_m) = (anchor.sides_m.x / 2.0, anchor.sides_m.y / 2.0);
    let to_zone = |point: &Vector2<f64>| {
        let p = anchor.in_box(*point);
        match relation {
            SpatialRelation::InFrontOf => Vector2::new(-p.x - half_depth_m, p.y),
            SpatialRelation::Behind => Vector2::new(p.x - half_depth_m, p.y),
            // The viewer looks along +x of the box, so that its left is +y.
            SpatialRelation::LeftOf => Vector2::new(p.y - half_width_m, p.x),
            _ => Vector2::new(-p.y - half_width_m, p.x),
        }
    };
    let half_face_m = match relation {
        SpatialRelation::InFrontOf | SpatialRelation::Behind => half_width_m,
        SpatialRelation::LeftOf | SpatialRelation::RightOf => half_depth_m,
        _ => return 0.0,
    };
    let depth_m = (2.0 * anchor.sides_m.x).min(1.0);
    let polygon: Vec<Vector2<f64>> = subject.iter().map(to_zone).collect();
    let whole = area(&polygon);
    if whole < 1e-9 {
        return 0.0;
    }
    // Half-planes a x + b y <= c.
    let wide_m = half_face_m + depth_m * OPENING;
    let borders = [
        (-1.0, 0.0, 0.0),
        (1.0, 0.0, depth_m + STRIP_M),
        (-OPENING, 1.0, half_face_m),
        (-OPENING, -1.0, half_face_m),
        (0.0, 1.0, wide_m),
        (0.0, -1.0, wide_m),
    ];
    let inside = borders.into_iter().fold(polygon, |polygon, border| clipped(&polygon, border));
    (area(&inside) / whole).clamp(0.0, 1.0)
}

/// Sutherland-Hodgman against one half-plane.
fn clipped(polygon: &[Vector2<f64>], (a, b, c): (f64, f64, f64)) -> Vec<Vector2<f64>> {
    let over = |p: &Vector2<f64>| a * p.x + b * p.y - c;
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (index, point) in polygon.iter().enumerate() {
        let next = &polygon[(index + 1) % polygon.len()];
        let (here, there) = (over(point), over(next));
        if here <= 0.0 {
            out.push(*point);
        }
        if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
            out.push(point + (next - point) * (here / (here - there)));
        }
    }
    out
}

/// Area of a polygon (shoelace), not negative.
fn area(polygon: &[Vector2<f64>]) -> f64 {
    let twice: f64 = polygon.iter().zip(polygon.iter().cycle().skip(1)).map(|(p, q)| p.x * q.y - q.x * p.y).sum();
    twice.abs() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    /// 1 m deep, 2 m wide, front towards -x of the world.
    fn desk() -> OrientedBox {
        OrientedBox { center: Point3::new(0.0, 0.0, 0.4), sides_m: Vector3::new(1.0, 2.0, 0.8), yaw_rad: 0.0 }
    }

    fn square(x: f64, y: f64, side_m: f64) -> [Vector2<f64>; 4] {
        let h = side_m / 2.0;
        [(h, h), (-h, h), (-h, -h), (h, -h)].map(|(dx, dy)| Vector2::new(x + dx, y + dy))
    }

    #[test]
    fn the_four_sides_of_a_desk() {
        use SpatialRelation::*;
        for (relation, x, y) in [(InFrontOf, -1.5, 0.0), (Behind, 1.5, 0.0), (LeftOf, 0.0, 2.0), (RightOf, 0.0, -2.0)] {
            for other in [InFrontOf, Behind, LeftOf, RightOf] {
                let share = share_in_zone(other, &square(x, y, 0.4), &desk());
                assert!((share - if other == relation { 1.0 } else { 0.0 }).abs() < 1e-9, "{relation:?} {other:?}");
            }
        }
    }

    #[test]
    fn a_thing_over_the_border_counts_in_part() {
        // Front strip at 1 m depth: half width 1 + tan 10 deg. A 0.4 m square centred on that border is half inside.
        let share = share_in_zone(SpatialRelation::InFrontOf, &square(-2.5, 1.0 + OPENING, 0.4), &desk());
        assert!((share - 0.5).abs() < 1e-9, "{share}");
        // A quarter turn of everything changes nothing.
        let turned = OrientedBox { yaw_rad: std::f64::consts::FRAC_PI_2, ..desk() };
        let share = share_in_zone(SpatialRelation::InFrontOf, &square(-1.0 - OPENING, -2.5, 0.4), &turned);
        assert!((share - 0.5).abs() < 1e-9, "{share}");
    }
}
