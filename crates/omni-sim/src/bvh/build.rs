//! Building the tree: binned surface-area splits into a binary tree (Wald 2007), then folded to four children a node.

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
