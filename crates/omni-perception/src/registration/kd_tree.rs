//! A kd-tree over points that do not change: nearest point, and the nearest few.
//!
//! Built once by median splits of the widest axis; the points lie in the order of the leaves, so that neighbours in space are
//! neighbours in memory. The distance from a query to a cell is brought up to date one axis at a time (Arya and Mount,
//! "Algorithms for fast vector quantization", DCC 1993). Ties go to the point that comes first in [`KdTree::points`].

use nalgebra::Point3;

/// Points in a leaf: few enough to split well, many enough to scan in one go.
const LEAF: usize = 8;
/// Most neighbours that [`KdTree::nearest_few`] finds.
pub const MOST_NEIGHBOURS: usize = 32;

/// The tree. Coordinates are finite.
#[derive(Debug, Clone, Default)]
pub struct KdTree {
    nodes: Vec<Node>,
    points: Vec<Point3<f32>>,
}

#[derive(Debug, Clone, Copy)]
enum Node {
    /// Left child is the next node.
    Split {
        axis: u8,
        at: f32,
        right: u32,
    },
    Leaf {
        first: u32,
        end: u32,
    },
}

/// The nearest few points, nearest first.
#[derive(Debug, Clone, Copy)]
pub struct Neighbours {
    wanted: usize,
    found: usize,
    squared_m2: [f32; MOST_NEIGHBOURS],
    index: [u32; MOST_NEIGHBOURS],
}

impl KdTree {
    /// Builds the tree. Cost: n log n.
    pub fn new(mut points: Vec<Point3<f32>>) -> Self {
        let mut nodes = Vec::with_capacity(2 * points.len() / LEAF + 1);
        let len = points.len();
        build(&mut nodes, &mut points, 0, len);
        Self { nodes, points }
    }

    /// The points in the order of the tree.
    pub fn points(&self) -> &[Point3<f32>] {
        &self.points
    }

    /// Index of the point nearest to `query` and its squared distance, if one is nearer than `squared_m2`.
    pub fn nearest(&self, query: &Point3<f32>, squared_m2: f32) -> Option<(usize, f32)> {
        let mut best = (u32::MAX, squared_m2);
        if !self.points.is_empty() {
            self.nearest_in(0, query, [0.0; 3], 0.0, &mut best);
        }
        (best.0 != u32::MAX).then_some((best.0 as usize, best.1))
    }

    fn nearest_in(&self, node: usize, query: &Point3<f32>, offset: [f32; 3], cell_m2: f32, best: &mut (u32, f32)) {
        match self.nodes[node] {
            Node::Leaf { first, end } => {
                for (index, point) in (first..).zip(&self.points[first as usize..end as usize]) {
                    let squared = (point - query).norm_squared();
                    if squared < best.1 {
                        *best = (index, squared);
                    }
                }
            }
            Node::Split { axis, at, right } => {
                let (near, far, other, other_m2) = descend(node, axis, at, right, query, offset, cell_m2);
                self.nearest_in(near, query, offset, cell_m2, best);
                if other_m2 < best.1 {
                    self.nearest_in(far, query, other, other_m2, best);
                }
            }
        }
    }

    /// The `wanted` points nearest to `query` (at most [`MOST_NEIGHBOURS`]); fewer where there are not so many.
    pub fn nearest_few(&self, query: &Point3<f32>, wanted: usize) -> Neighbours {
        let mut few = Neighbours {
            wanted: wanted.clamp(1, MOST_NEIGHBOURS),
            found: 0,
            squared_m2: [f32::INFINITY; MOST_NEIGHBOURS],
            index: [0; MOST_NEIGHBOURS],
        };
        if !self.points.is_empty() {
            self.few_in(0, query, [0.0; 3], 0.0, &mut few);
        }
        few
    }

    fn few_in(&self, node: usize, query: &Point3<f32>, offset: [f32; 3], cell_m2: f32, few: &mut Neighbours) {
        match self.nodes[node] {
            Node::Leaf { first, end } => {
                for (index, point) in (first..).zip(&self.points[first as usize..end as usize]) {
                    few.offer(index, (point - query).norm_squared());
                }
            }
            Node::Split { axis, at, right } => {
                let (near, far, other, other_m2) = descend(node, axis, at, right, query, offset, cell_m2);
                self.few_in(near, query, offset, cell_m2, few);
                if other_m2 < few.reach_m2() {
                    self.few_in(far, query, other, other_m2, few);
                }
            }
        }
    }
}

impl Neighbours {
    /// Indices into [`KdTree::points`], nearest first.
    pub fn indices(&self) -> &[u32] {
        &self.index[..self.found]
    }

    /// Squared distances, ascending.
    pub fn squared_m2(&self) -> &[f32] {
        &self.squared_m2[..self.found]
    }

    /// Only what is nearer than this can still come in.
    fn reach_m2(&self) -> f32 {
        self.squared_m2[self.wanted - 1]
    }

    fn offer(&mut self, index: u32, squared_m2: f32) {
        if squared_m2 >= self.reach_m2() {
            return;
        }
        let mut at = self.found.min(self.wanted - 1);
        while at > 0 && self.squared_m2[at - 1] > squared_m2 {
            self.squared_m2[at] = self.squared_m2[at - 1];
            self.index[at] = self.index[at - 1];
            at -= 1;
        }
        self.squared_m2[at] = squared_m2;
        self.index[at] = index;
        self.found = (self.found + 1).min(self.wanted);
    }
}

/// Near child, far child, and the far cell's offset and squared distance.
fn descend(
    node: usize,
    axis: u8,
    at: f32,
    right: u32,
    query: &Point3<f32>,
    offset: [f32; 3],
    cell_m2: f32,
) -> (usize, usize, [f32; 3], f32) {
    let axis = usize::from(axis);
    let beyond = query[axis] - at;
    let (near, far) = if beyond < 0.0 { (node + 1, right as usize) } else { (right as usize, node + 1) };
    let mut other = offset;
    other[axis] = beyond;
    (near, far, other, cell_m2 - offset[axis] * offset[axis] + beyond * beyond)
}

fn build(nodes: &mut Vec<Node>, points: &mut [Point3<f32>], first: usize, end: usize) {
    let slice = &mut points[first..end];
    if slice.len() <= LEAF {
        nodes.push(Node::Leaf { first: first as u32, end: end as u32 });
        return;
    }
    let (mut low, mut high) = (slice[0].coords, slice[0].coords);
    for point in slice.iter() {
        low = low.inf(&point.coords);
        high = high.sup(&point.coords);
    }
    let axis = (high - low).imax();
    let middle = slice.len() / 2;
    slice.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    let at = slice[middle][axis];
    let node = nodes.len();
    nodes.push(Node::Split { axis: axis as u8, at, right: 0 });
    build(nodes, points, first, first + middle);
    let right = nodes.len() as u32;
    nodes[node] = Node::Split { axis: axis as u8, at, right };
    build(nodes, points, first + middle, end);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Few distinct values make ties and coincident points likely.
    fn points(most: usize) -> impl Strategy<Value = Vec<Point3<f32>>> {
        let coordinate = prop_oneof![(-4..4i8).prop_map(f32::from), -4.0..4.0f32];
        proptest::collection::vec(proptest::array::uniform3(coordinate).prop_map(Point3::from), 0..most)
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_a_search_through_all_finds(
            cloud in points(200), query in proptest::array::uniform3(-5.0..5.0f32).prop_map(Point3::from), wanted in 1..12usize,
        ) {
            let tree = KdTree::new(cloud.clone());
            let mut all: Vec<f32> = cloud.iter().map(|point| (point - query).norm_squared()).collect();
            all.sort_by(f32::total_cmp);
            prop_assert_eq!(tree.nearest(&query, f32::INFINITY).map(|found| found.1), all.first().copied());
            let few = tree.nearest_few(&query, wanted);
            prop_assert_eq!(few.squared_m2(), &all[..wanted.min(all.len())]);
            for (index, squared) in few.indices().iter().zip(few.squared_m2()) {
                prop_assert_eq!((tree.points()[*index as usize] - query).norm_squared(), *squared);
            }
        }
    }

    #[test]
    fn what_lies_beyond_the_reach_is_not_found() {
        let tree = KdTree::new(vec![Point3::new(1.0, 0.0, 0.0)]);
        assert_eq!(tree.nearest(&Point3::origin(), 1.0), None);
        assert_eq!(tree.nearest(&Point3::origin(), 1.1), Some((0, 1.0)));
        assert_eq!(KdTree::default().nearest(&Point3::origin(), 1.0), None);
    }
}
