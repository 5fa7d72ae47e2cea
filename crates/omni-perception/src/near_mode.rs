//! The near mode: of all points under one mask, those of the thing itself.
//!
//! A mask shows a thing and, through gaps and at its border, what is behind it. The points are linked in space; of the
//! clusters that are big enough the nearest one is the thing. What lies deeper behind its front than a thing of this
//! apparent size is likely to reach is cut off.

use nalgebra::Point3;
use rustc_hash::FxHashMap;

/// Parameters, see [`crate::LabelConfig`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct NearMode {
    pub(crate) link_share: f32,
    pub(crate) max_link_m: f32,
    pub(crate) link_spacings: f32,
    pub(crate) near_share: f32,
    pub(crate) depth_ratio: f32,
    pub(crate) min_depth_m: f32,
}

/// How a mask looks: the scale on which the points of its thing belong together.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Apparent {
    /// Edge of a square of the mask's area, half as much again for things that are not square.
    pub(crate) size_rad: f32,
    /// Angle between its points if they were spread evenly.
    pub(crate) spacing_rad: f32,
}

/// Which of the points under a mask (in camera coordinates) belong to the near mode.
pub(crate) fn near_mode(points: &[Point3<f32>], apparent: &Apparent, config: &NearMode) -> Vec<bool> {
    if points.is_empty() {
        return Vec::new();
    }
    let ranges: Vec<f32> = points.iter().map(|point| point.coords.norm()).collect();
    let middle_m = quantile(ranges.clone(), 0.5);
    let by_size_m = (config.link_share * apparent.size_rad * middle_m).min(config.max_link_m);
    let link_m = by_size_m.max(config.link_spacings * apparent.spacing_rad * middle_m).max(MIN_LINK_M);
    let clusters = Clusters::new(points, &ranges, link_m);
    let is_near = clusters.near(config.near_share, link_m);
    let kept = || (0..points.len()).filter(|&index| is_near[clusters.of_point[index] as usize]);
    // The front is a low quantile, for a single stray return in front must not move it.
    let front_m = quantile(kept().map(|index| ranges[index]).collect(), 0.1);
    let depth_m = config.min_depth_m.max(config.depth_ratio * apparent.size_rad * front_m);
    let mut is_kept = vec![false; points.len()];
    kept().filter(|&index| ranges[index] <= front_m + depth_m).for_each(|index| is_kept[index] = true);
    is_kept
}

/// Noise of the returns: nothing is told apart below.
const MIN_LINK_M: f32 = 0.03;

/// Points linked in space.
struct Clusters {
    of_point: Vec<u32>,
    /// Number of points and their ranges at 10, 50 and 90 %.
    extents: Vec<(usize, [f32; 3])>,
}

impl Clusters {
    fn new(points: &[Point3<f32>], ranges: &[f32], link_m: f32) -> Clusters {
        let of_point = linked_clusters(points, link_m);
        let count = of_point.iter().max().map_or(0, |&last| last as usize + 1);
        let mut of_cluster: Vec<Vec<f32>> = vec![Vec::new(); count];
        for (&cluster, &range_m) in of_point.iter().zip(ranges) {
            of_cluster[cluster as usize].push(range_m);
        }
        let extent = |ranges: Vec<f32>| (ranges.len(), [0.1, 0.5, 0.9].map(|share| quantile(ranges.clone(), share)));
        Clusters { of_point, extents: of_cluster.into_iter().map(extent).collect() }
    }

    /// Which clusters are the thing: the nearest (by median range) of those with at least `near_share` of the
    /// largest one's points, and others beside it at the same range (a post in front cuts a thing in two).
    fn near(&self, near_share: f32, link_m: f32) -> Vec<bool> {
        let largest = self.extents.iter().map(|extent| extent.0).max().unwrap_or(0);
        let main = self
            .extents
            .iter()
            .filter(|extent| extent.0 as f32 >= near_share * largest as f32)
            .min_by(|a, b| a.1[1].total_cmp(&b.1[1]).then(b.0.cmp(&a.0)));
        let Some(&(count, [low_m, _, high_m])) = main else {
            return Vec::new();
        };
        let is_beside = |extent: &(usize, [f32; 3])| {
            let overlaps = extent.1[0] <= high_m + link_m && extent.1[2] >= low_m - link_m;
            overlaps && extent.0 as f32 >= BESIDE_SHARE * count as f32
        };
        self.extents.iter().map(is_beside).collect()
    }
}

/// Fewer points than this share of the thing's are no part of it but something at its border.
const BESIDE_SHARE: f32 = 0.1;

/// Cluster number of each point. Cells that touch (26 neighbours) are one cluster; their edge is chosen so that points
/// `link_m` apart are linked as often as not.
fn linked_clusters(points: &[Point3<f32>], link_m: f32) -> Vec<u32> {
    let edge_m = 0.7 * link_m;
    let cell_of = |p: &Point3<f32>| [p.x, p.y, p.z].map(|x| floor(x / edge_m));
    let cell_of_point: Vec<[i32; 3]> = points.iter().map(cell_of).collect();
    let mut numbers = CellNumbers::around(&cell_of_point);
    let mut cells: Vec<[i32; 3]> = Vec::new();
    // Neighbours in a scan mostly share a cell.
    let mut last = ([i32::MAX; 3], u32::MAX);
    let number_of_point: Vec<u32> = cell_of_point
        .iter()
        .map(|cell| {
            if last.1 == u32::MAX || last.0 != *cell {
                let number = numbers.get_or_insert(cell, cells.len() as u32);
                if number as usize == cells.len() {
                    cells.push(*cell);
                }
                last = (*cell, number);
            }
            last.1
        })
        .collect();
    let mut cluster_of_cell = vec![u32::MAX; cells.len()];
    let mut clusters = 0;
    let mut open = Vec::new();
    for start in 0..cells.len() {
        if cluster_of_cell[start] != u32::MAX {
            continue;
        }
        cluster_of_cell[start] = clusters;
        open.push(start as u32);
        while let Some(here) = open.pop() {
            numbers.for_each_neighbour(&cells[here as usize], |next| {
                if cluster_of_cell[next as usize] == u32::MAX {
                    cluster_of_cell[next as usize] = clusters;
                    open.push(next);
                }
            });
        }
        clusters += 1;
    }
    number_of_point.into_iter().map(|cell| cluster_of_cell[cell as usize]).collect()
}

/// `x.floor() as i32` without the call into the mathematics library.
#[inline]
pub(crate) fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole.saturating_sub(i32::from(whole as f32 > x))
}

/// Numbers of cells: a plain box of them where the cells lie close together, as they do for one thing, else a map.
enum CellNumbers {
    Box { low: [i32; 3], strides: [usize; 2], numbers: Vec<u32> },
    Map(FxHashMap<[i32; 3], u32>),
}

/// A larger box is not worth its memory (1 MiB).
const MAX_BOX: usize = 1 << 18;

impl CellNumbers {
    /// Room for these cells, no number given yet.
    fn around(cells: &[[i32; 3]]) -> CellNumbers {
        let (mut low, mut high) = ([i32::MAX; 3], [i32::MIN; 3]);
        for cell in cells {
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(cell[axis]), high[axis].max(cell[axis]));
            }
        }
        // With an empty cell on every side, so that neighbours need no test.
        let sides = [0, 1, 2].map(|axis| (i64::from(high[axis]) - i64::from(low[axis]) + 3).max(0) as usize);
        let size = sides.into_iter().try_fold(1_usize, |size, side| size.checked_mul(side));
        let has_room = low.iter().all(|&x| x > i32::MIN) && high.iter().all(|&x| x < i32::MAX);
        match size.filter(|&size| size <= MAX_BOX && has_room) {
            Some(size) => {
                let low = low.map(|x| x - 1);
                CellNumbers::Box { low, strides: [sides[0], sides[0] * sides[1]], numbers: vec![u32::MAX; size] }
            }
            None => CellNumbers::Map(FxHashMap::default()),
        }
    }

    fn index(low: &[i32; 3], strides: &[usize; 2], cell: &[i32; 3]) -> usize {
        let [x, y, z] = [0, 1, 2].map(|axis| (cell[axis] - low[axis]) as usize);
        x + strides[0] * y + strides[1] * z
    }

    fn get_or_insert(&mut self, cell: &[i32; 3], next: u32) -> u32 {
        match self {
            CellNumbers::Box { low, strides, numbers } => {
                let number = &mut numbers[CellNumbers::index(low, strides, cell)];
                if *number == u32::MAX {
                    *number = next;
                }
                *number
            }
            CellNumbers::Map(map) => *map.entry(*cell).or_insert(next),
        }
    }

    /// The cell itself and the 26 around it, as far as they have numbers. Order: x, then y, then z.
    fn for_each_neighbour(&self, cell: &[i32; 3], mut found: impl FnMut(u32)) {
        match self {
            CellNumbers::Box { low, strides, numbers } => {
                let middle = CellNumbers::index(low, strides, cell);
                for z in 0..3 {
                    for y in 0..3 {
                        let row = middle + strides[0] * y + strides[1] * z - strides[0] - strides[1] - 1;
                        numbers[row..row + 3].iter().filter(|number| **number != u32::MAX).for_each(|n| found(*n));
                    }
                }
            }
            CellNumbers::Map(map) => {
                for step in 0..27 {
                    let steps = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
                    let next = [0, 1, 2].map(|axis| cell[axis].saturating_add(steps[axis]));
                    if let Some(&number) = map.get(&next) {
                        found(number);
                    }
                }
            }
        }
    }
}

/// The value below which `share` of the numbers lie (the lowest for few numbers); zero for none.
pub(crate) fn quantile(mut numbers: Vec<f32>, share: f32) -> f32 {
    if numbers.is_empty() {
        return 0.0;
    }
    let index = ((numbers.len() - 1) as f32 * share) as usize;
    *numbers.select_nth_unstable_by(index, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: NearMode = NearMode {
        link_share: 0.3,
        max_link_m: 0.2,
        link_spacings: 3.0,
        near_share: 0.35,
        depth_ratio: 2.0,
        min_depth_m: 0.15,
    };

    fn check(points: &[Point3<f32>], size_rad: f32, kept: usize) {
        let near = near_mode(points, &Apparent { size_rad, spacing_rad: 0.005 }, &CONFIG);
        let expected: Vec<bool> = (0..points.len()).map(|index| index < kept).collect();
        assert_eq!(near, expected);
    }

    fn line(count: usize, x: f32) -> impl Iterator<Item = Point3<f32>> {
        (0..count).map(move |k| Point3::new(x, 0.02 * k as f32, 0.0))
    }

    #[test]
    fn the_wall_behind_is_left_out_even_if_it_has_more_points() {
        let chair_and_wall: Vec<_> = line(20, 3.0).chain(line(50, 3.5)).collect();
        check(&chair_and_wall, 0.2, 20);
    }

    #[test]
    fn a_few_stray_points_in_front_are_not_the_thing() {
        let mut points: Vec<_> = line(20, 3.0).collect();
        points.extend(line(6, 1.0));
        check(&points, 0.2, 20);
    }

    #[test]
    fn a_post_in_front_does_not_take_half_of_the_thing() {
        let right = (0..20).map(|k| Point3::new(3.0, 1.0 + 0.02 * k as f32, 0.0));
        let both_sides: Vec<_> = line(20, 3.0).chain(right).collect();
        check(&both_sides, 0.2, 40);
    }

    #[test]
    fn depth_is_limited_by_the_apparent_size() {
        // A cup (0.03 rad at 3 m = 9 cm) and the table top that runs on behind it without a gap.
        let point = |k: u16| Point3::new(3.0 + 0.02 * f32::from(k), 0.0, 0.0);
        let cup_and_table: Vec<_> = (0..20).map(point).collect();
        // Front 3.02 (a low quantile) and depth 2 x 0.03 x 3.02: kept up to 3.2012.
        check(&cup_and_table, 0.03, 11);
    }

    #[test]
    fn a_box_of_cells_and_a_map_of_cells_say_the_same() {
        let cells: Vec<[i32; 3]> = (0..300).map(|k| [k * 37 % 11 - 5, k * 17 % 7, k * 5 % 13 - 90]).collect();
        let number = |mut numbers: CellNumbers| {
            let mut next = 0;
            let of_cell: Vec<u32> = cells
                .iter()
                .map(|cell| {
                    let number = numbers.get_or_insert(cell, next);
                    next = next.max(number + 1);
                    number
                })
                .collect();
            let mut around = Vec::new();
            cells.iter().for_each(|cell| numbers.for_each_neighbour(cell, |next| around.push(next)));
            (of_cell, around)
        };
        let small = CellNumbers::around(&cells);
        assert!(matches!(small, CellNumbers::Box { .. }));
        assert_eq!(number(small), number(CellNumbers::Map(FxHashMap::default())));
        assert!(matches!(CellNumbers::around(&[[i32::MIN; 3], [i32::MAX; 3]]), CellNumbers::Map(_)));
        assert!(matches!(CellNumbers::around(&[[i32::MAX; 3]]), CellNumbers::Map(_)));
    }

    #[test]
    fn floors_are_those_of_the_library() {
        for x in [0.0, -0.0, 0.9, -0.1, -1.0, -1.5, 7.0, 1e9, -1e9, 3e9, -3e9, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(floor(x), x.floor() as i32, "{x}");
        }
    }

    #[test]
    fn one_point_and_no_point() {
        check(&[Point3::new(2.0, 0.0, 0.0)], 0.01, 1);
        check(&[], 0.01, 0);
    }
}
