//! First hit of a ray with a static set of triangles: a flat tree of boxes, four children a node.
//!
//! Built once by binned surface-area splits (Wald 2007) as a binary tree, then folded to four children so that one visit
//! tests four boxes in the lanes of one SIMD vector (glam's `Vec4`, which needs no unsafe code here). Triangles are stored four a leaf in the same way. The triangle test is
//! Moeller-Trumbore with a tolerance of [`EDGE_TOLERANCE`] on the barycentric coordinates: without it, 32-bit rounding
//! lets about one ray in 25 000 slip through the edge two triangles share; with ten times as much, silhouettes grow.
//! Triangles are hit from both sides.

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

mod build {
    use super::{Bvh, LEAF, Leaf, NO_TRIANGLE, Node, WIDTH};
    use glamx::Vec4;
    use nalgebra::{Point3, Vector3};

    const BINS: usize = 16;

    #[derive(Clone, Copy)]
    struct Bounds {
        low: Vector3<f32>,
        high: Vector3<f32>,
    }

    impl Bounds {
        const EMPTY: Bounds = Bounds {
            low: Vector3::new(f32::INFINITY, f32::INFINITY, f32::INFINITY),
            high: Vector3::new(f32::NEG_INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY),
        };

        fn grow(&mut self, p: &Vector3<f32>) {
            self.low = self.low.inf(p);
            self.high = self.high.sup(p);
        }

        fn join(&mut self, other: &Bounds) {
            self.low = self.low.inf(&other.low);
            self.high = self.high.sup(&other.high);
        }

        /// Half of the surface; 0 for an empty box.
        fn area(&self) -> f32 {
            let d = self.high - self.low;
            if d.x < 0.0 { 0.0 } else { d.x * d.y + d.y * d.z + d.z * d.x }
        }
    }

    struct Item {
        bounds: Bounds,
        center: Vector3<f32>,
        triangle: u32,
    }

    enum Binary {
        Inner { bounds: Bounds, left: usize, right: usize },
        Leaf { bounds: Bounds, from: usize, to: usize },
    }

    impl Binary {
        fn bounds(&self) -> &Bounds {
            match self {
                Binary::Inner { bounds, .. } | Binary::Leaf { bounds, .. } => bounds,
            }
        }
    }

    pub(super) fn build(vertices: &[Point3<f32>], faces: &[[u32; 3]]) -> Bvh {
        let mut items: Vec<Item> = Vec::with_capacity(faces.len());
        for (triangle, face) in faces.iter().enumerate() {
            let corners = face.map(|i| vertices[i as usize].coords);
            if corners.iter().all(|c| c.iter().all(|x| x.is_finite())) {
                let mut bounds = Bounds::EMPTY;
                corners.iter().for_each(|c| bounds.grow(c));
                items.push(Item { bounds, center: (bounds.low + bounds.high) * 0.5, triangle: triangle as u32 });
            }
        }
        let mut bvh = Bvh::default();
        if items.is_empty() {
            return bvh;
        }
        let mut binary = Vec::new();
        let end = items.len();
        let root = split(&mut items, 0, end, &mut binary);
        bvh.nodes.push(empty_node());
        fold(&binary, root, 0, &items, vertices, faces, &mut bvh);
        bvh
    }

    /// Splits items `from..to` until at most four are left; returns the index of the new node.
    fn split(items: &mut [Item], from: usize, to: usize, binary: &mut Vec<Binary>) -> usize {
        let mut bounds = Bounds::EMPTY;
        let mut centers = Bounds::EMPTY;
        for item in &items[from..to] {
            bounds.join(&item.bounds);
            centers.grow(&item.center);
        }
        if to - from <= WIDTH {
            binary.push(Binary::Leaf { bounds, from, to });
            return binary.len() - 1;
        }
        // Where every split is as bad (equal centres), halve by count: the depth stays logarithmic.
        let middle = match best_split(&items[from..to], &centers) {
            Some((axis, limit)) => from + partition(&mut items[from..to], axis, limit),
            None => (from + to) / 2,
        };
        let left = split(items, from, middle, binary);
        let right = split(items, middle, to, binary);
        binary.push(Binary::Inner { bounds, left, right });
        binary.len() - 1
    }

    /// The axis and bin border with the least expected cost, `None` when all centres fall into one bin.
    fn best_split(items: &[Item], centers: &Bounds) -> Option<(usize, f32)> {
        let mut best: Option<(f32, usize, f32)> = None;
        for axis in 0..3 {
            let low = centers.low[axis];
            let extent = centers.high[axis] - low;
            if extent <= 0.0 {
                continue;
            }
            let mut count = [0usize; BINS];
            let mut bounds = [Bounds::EMPTY; BINS];
            for item in items {
                let bin = bin_of(item.center[axis], low, extent);
                count[bin] += 1;
                bounds[bin].join(&item.bounds);
            }
            let mut right_cost = [0.0_f32; BINS];
            let (mut sum, mut joined) = (0, Bounds::EMPTY);
            for bin in (1..BINS).rev() {
                sum += count[bin];
                joined.join(&bounds[bin]);
                right_cost[bin] = blocks(sum) * joined.area();
            }
            let (mut sum, mut joined) = (0, Bounds::EMPTY);
            for bin in 0..BINS - 1 {
                sum += count[bin];
                joined.join(&bounds[bin]);
                if sum == 0 || sum == items.len() {
                    continue;
                }
                let cost = blocks(sum) * joined.area() + right_cost[bin + 1];
                if best.is_none_or(|(c, _, _)| cost < c) {
                    let border = low + extent * (bin + 1) as f32 / BINS as f32;
                    best = Some((cost, axis, border));
                }
            }
        }
        let (_, axis, border) = best?;
        let below = items.iter().filter(|i| i.center[axis] < border).count();
        (below > 0 && below < items.len()).then_some((axis, border))
    }

    /// Leaves hold four triangles, so cost goes by groups of four.
    fn blocks(count: usize) -> f32 {
        count.div_ceil(WIDTH) as f32
    }

    fn bin_of(center: f32, low: f32, extent: f32) -> usize {
        (((center - low) / extent * BINS as f32) as usize).min(BINS - 1)
    }

    /// Stable partition, so that the tree depends on nothing but the input's order.
    fn partition(items: &mut [Item], axis: usize, border: f32) -> usize {
        items.sort_by_key(|item| item.center[axis] >= border);
        items.partition_point(|item| item.center[axis] < border)
    }

    /// Fills node `at` of the wide tree with up to four descendants of `root`: the largest box is opened first.
    fn fold(
        binary: &[Binary],
        root: usize,
        at: usize,
        items: &[Item],
        vertices: &[Point3<f32>],
        faces: &[[u32; 3]],
        bvh: &mut Bvh,
    ) {
        let mut children = vec![root];
        while children.len() < WIDTH {
            let widest = children
                .iter()
                .enumerate()
                .filter(|(_, c)| matches!(binary[**c], Binary::Inner { .. }))
                .max_by(|a, b| {
                    let area = |i: usize| binary[i].bounds().area();
                    area(*a.1).total_cmp(&area(*b.1))
                })
                .map(|(k, _)| k);
            let Some(k) = widest else { break };
            if let Binary::Inner { left, right, .. } = binary[children[k]] {
                children[k] = left;
                children.insert(k + 1, right);
            }
        }
        for (lane, &child) in children.iter().enumerate() {
            let bounds = binary[child].bounds();
            for axis in 0..3 {
                bvh.nodes[at].bounds[axis][0][lane] = bounds.low[axis];
                bvh.nodes[at].bounds[axis][1][lane] = bounds.high[axis];
            }
            bvh.nodes[at].child[lane] = match binary[child] {
                Binary::Leaf { from, to, .. } => {
                    bvh.leaves.push(leaf_of(&items[from..to], vertices, faces));
                    (bvh.leaves.len() - 1) as u32 | LEAF
                }
                Binary::Inner { .. } => {
                    bvh.nodes.push(empty_node());
                    let next = bvh.nodes.len() - 1;
                    fold(binary, child, next, items, vertices, faces, bvh);
                    next as u32
                }
            };
        }
    }

    /// Four boxes turned inside out: no ray enters them.
    fn empty_node() -> Node {
        let side = [Vec4::splat(f32::INFINITY), Vec4::splat(f32::NEG_INFINITY)];
        Node { bounds: [side; 3], child: [0; WIDTH] }
    }

    fn leaf_of(items: &[Item], vertices: &[Point3<f32>], faces: &[[u32; 3]]) -> Leaf {
        let mut leaf = Leaf {
            corner: [Vec4::ZERO; 3],
            edge1: [Vec4::ZERO; 3],
            edge2: [Vec4::ZERO; 3],
            triangle: [NO_TRIANGLE; WIDTH],
        };
        for (lane, item) in items.iter().enumerate() {
            let [a, b, c] = faces[item.triangle as usize].map(|i| vertices[i as usize]);
            for axis in 0..3 {
                leaf.corner[axis][lane] = a[axis];
                leaf.edge1[axis][lane] = b[axis] - a[axis];
                leaf.edge2[axis][lane] = c[axis] - a[axis];
            }
            leaf.triangle[lane] = item.triangle;
        }
        leaf
    }
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
