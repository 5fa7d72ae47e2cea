//! First hit of a ray with a static set of triangles: a flat tree of boxes, four children a node.
//!
//! Built once by binned surface-area splits (Wald 2007) as a binary tree, then folded to four children so that one visit
//! tests four boxes in the lanes of one SIMD vector (glam's `Vec4`, which needs no unsafe code here). Triangles are stored four a leaf in the same way. The triangle test is
//! Moeller-Trumbore with a tolerance of [`EDGE_TOLERANCE`] on the barycentric coordinates: without it, 32-bit rounding
//! lets about one ray in 25 000 slip through the edge two triangles share; with ten times as much, silhouettes grow.
//! Triangles are hit from both sides.

mod build;

use glamx::Vec4;
use nalgebra::{Point3, Vector3};

/// Slack on the barycentric coordinates; 1e-6 still leaks, 1e-4 adds hits beside silhouettes (measured with parry).
pub const EDGE_TOLERANCE: f32 = 1e-5;

/// First triangle a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleHit {
    /// Distance along the ray in multiples of its direction's length.
    pub distance: f32,
    /// Index of the triangle in the order it was given.
    pub triangle: u32,
}

/// A tree over triangles that do not move.
#[derive(Debug, Clone, Default)]
pub struct Bvh {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// The memory one traversal needs, kept by the caller so that rays allocate nothing.
#[derive(Debug, Clone, Default)]
pub struct RayStack(Vec<(f32, u32)>);

impl Bvh {
    /// Builds the tree. Indices must be valid; triangles with a non-finite corner or without area are never hit.
    pub fn build(vertices: &[Point3<f32>], faces: &[[u32; 3]]) -> Bvh {
        build::build(vertices, faces)
    }

    /// First triangle with `distance < max_distance` along `direction`, which need not have length one.
    /// Of two triangles at the same distance the lower index wins.
    #[inline]
    pub fn cast(
        &self,
        origin: &Point3<f32>,
        direction: &Vector3<f32>,
        max_distance: f32,
        stack: &mut RayStack,
    ) -> Option<TriangleHit> {
        if self.nodes.is_empty() {
            return None;
        }
        let ray = Ray::new(origin, direction);
        let mut best = TriangleHit { distance: max_distance, triangle: NO_TRIANGLE };
        let stack = &mut stack.0;
        stack.clear();
        let mut current = 0;
        loop {
            if current & LEAF == 0 {
                let node = &self.nodes[current as usize];
                let (entries, mut entered) = node.entries(&ray, best.distance);
                // Go on with the nearest child, keep the others for later.
                let (mut nearest, mut next) = (f32::INFINITY, NO_CHILD);
                while entered != 0 {
                    let lane = (entered.trailing_zeros() & 3) as usize;
                    entered &= entered - 1;
                    let (entry, child) = (entries[lane], node.child[lane]);
                    if next == NO_CHILD {
                        (nearest, next) = (entry, child);
                    } else if entry < nearest {
                        stack.push((nearest, next));
                        (nearest, next) = (entry, child);
                    } else {
                        stack.push((entry, child));
                    }
                }
                if next != NO_CHILD {
                    current = next;
                    continue;
                }
            } else {
                self.leaves[(current & !LEAF) as usize].cast(&ray, &mut best);
            }
            loop {
                match stack.pop() {
                    None => return (best.triangle != NO_TRIANGLE).then_some(best),
                    Some((entry, index)) if entry <= best.distance => {
                        current = index;
                        break;
                    }
                    Some(_) => {}
                }
            }
        }
    }

    /// Whether any triangle lies at `distance < max_distance`.
    pub fn is_hit(
        &self,
        origin: &Point3<f32>,
        direction: &Vector3<f32>,
        max_distance: f32,
        stack: &mut RayStack,
    ) -> bool {
        self.cast(origin, direction, max_distance, stack).is_some()
    }
}

const NO_TRIANGLE: u32 = u32::MAX;
const NO_CHILD: u32 = u32::MAX;
/// Marks a child index as a leaf.
const LEAF: u32 = 1 << 31;
const WIDTH: usize = 4;

/// A ray with what every test needs, in all lanes.
struct Ray {
    origin: [Vec4; 3],
    direction: [Vec4; 3],
    inverse: [Vec4; 3],
    is_negative: [usize; 3],
}

impl Ray {
    #[inline]
    fn new(origin: &Point3<f32>, direction: &Vector3<f32>) -> Ray {
        // A zero component would give 0 * infinity = NaN for an origin on a slab; a tiny one gives 0.
        let inverse = [0, 1, 2].map(|k| {
            let d = direction[k];
            1.0 / if d.abs() < 1e-20 { 1e-20_f32.copysign(d) } else { d }
        });
        Ray {
            origin: [0, 1, 2].map(|k| Vec4::splat(origin[k])),
            direction: [0, 1, 2].map(|k| Vec4::splat(direction[k])),
            inverse: inverse.map(Vec4::splat),
            is_negative: inverse.map(|i| usize::from(i < 0.0)),
        }
    }
}

/// Four boxes, lane by lane: `bounds[axis][0]` are the low and `bounds[axis][1]` the high sides.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Node {
    bounds: [[Vec4; 2]; 3],
    child: [u32; WIDTH],
}

impl Node {
    /// Distance at which the ray enters each box, and one bit for each box that it enters before `max`.
    #[inline(always)]
    fn entries(&self, ray: &Ray, max: f32) -> ([f32; WIDTH], u32) {
        let mut near = Vec4::ZERO;
        let mut far = Vec4::splat(max);
        for axis in 0..3 {
            let low = self.bounds[axis][ray.is_negative[axis]];
            let high = self.bounds[axis][1 - ray.is_negative[axis]];
            near = near.max((low - ray.origin[axis]) * ray.inverse[axis]);
            far = far.min((high - ray.origin[axis]) * ray.inverse[axis]);
        }
        // Two roundings of 2^-24 each: leave the box a little later (Ize 2013).
        let entered = near.cmple(far * Vec4::splat(1.000_000_4));
        (near.to_array(), entered.bitmask())
    }
}

/// Four triangles, lane by lane: corner, two edges from it. Unused lanes have no area and are never hit.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Leaf {
    corner: [Vec4; 3],
    edge1: [Vec4; 3],
    edge2: [Vec4; 3],
    triangle: [u32; WIDTH],
}

impl Leaf {
    #[inline(always)]
    fn cast(&self, ray: &Ray, best: &mut TriangleHit) {
        // Moeller-Trumbore: solve origin + t d = corner + u e1 + v e2 by Cramer's rule.
        let p = cross(&ray.direction, &self.edge2);
        let inverse = Vec4::ONE / dot(&self.edge1, &p);
        let s = [ray.origin[0] - self.corner[0], ray.origin[1] - self.corner[1], ray.origin[2] - self.corner[2]];
        let u = dot(&s, &p) * inverse;
        let q = cross(&s, &self.edge1);
        let v = dot(&ray.direction, &q) * inverse;
        let t = dot(&self.edge2, &q) * inverse;
        // NaN and infinity (no area, ray in the plane) fail these comparisons.
        let edge = Vec4::splat(-EDGE_TOLERANCE);
        let inside = u.cmpge(edge)
            & v.cmpge(edge)
            & (u + v).cmple(Vec4::splat(1.0 + EDGE_TOLERANCE))
            & t.cmpge(Vec4::ZERO)
            & t.cmple(Vec4::splat(best.distance));
        let mut hits = inside.bitmask();
        let distance = t.to_array();
        while hits != 0 {
            let lane = (hits.trailing_zeros() & 3) as usize;
            hits &= hits - 1;
            let (t, triangle) = (distance[lane], self.triangle[lane]);
            // Ties go to the lower index; the bound itself (no triangle yet) is exclusive.
            let is_tie = t == best.distance && best.triangle != NO_TRIANGLE;
            if t < best.distance || (is_tie && triangle < best.triangle) {
                *best = TriangleHit { distance: t, triangle };
            }
        }
    }
}

#[inline(always)]
fn cross(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn dot(a: &[Vec4; 3], b: &[Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> (Vec<Point3<f32>>, Vec<[u32; 3]>) {
        let v = vec![
            Point3::new(2.0, -1.0, -1.0),
            Point3::new(2.0, 1.0, -1.0),
            Point3::new(2.0, 1.0, 1.0),
            Point3::new(2.0, -1.0, 1.0),
        ];
        (v, vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn a_square_two_metres_ahead_is_hit_at_two_metres() {
        let (v, f) = square();
        let bvh = Bvh::build(&v, &f);
        let mut stack = RayStack::default();
        let mut hit =
            |d: [f32; 3], max| bvh.cast(&Point3::origin(), &Vector3::from(d), max, &mut stack).map(|h| h.distance);
        assert_eq!(hit([1.0, 0.0, 0.0], 10.0), Some(2.0)); // on the diagonal both triangles share
        assert_eq!(hit([2.0, 0.5, -0.5], 10.0), Some(1.0)); // direction of length > 1
        assert_eq!(hit([-1.0, 0.0, 0.0], 10.0), None);
        assert_eq!(hit([1.0, 0.0, 0.0], 2.0), None); // the bound is exclusive
        assert_eq!(hit([1.0, 0.6, 0.0], 10.0), None); // beside it
    }

    #[test]
    fn nothing_is_hit_in_an_empty_or_flat_set() {
        let mut stack = RayStack::default();
        let x = Vector3::x();
        assert_eq!(Bvh::build(&[], &[]).cast(&Point3::origin(), &x, 9.0, &mut stack), None);
        let (v, _) = square();
        let no_area = Bvh::build(&v, &[[0, 0, 1], [1, 1, 1]]);
        assert_eq!(no_area.cast(&Point3::origin(), &x, 9.0, &mut stack), None);
    }
}
