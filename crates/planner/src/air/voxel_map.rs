//! A box of voxels, some of them occupied: growing them, ways through the rest, and straight lines that are free.
//!
//! A voxel is a closed cube; outside the box everything is occupied. The search is A* over 26 neighbours; a diagonal step
//! needs every voxel free that shares the corner or edge it passes, so that a straight flight between the centres touches
//! nothing. Ties are broken by the number of the voxel: the same map gives the same route.

use std::collections::BinaryHeap;

use nalgebra::{Point3, Vector3};

use super::guide::Entry;

/// How much the distance to the goal counts beyond what is certain: fewer expansions, routes at most so much longer.
const GREED: f32 = 1.02;

/// Occupied and free voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelMap {
    low: Point3<f64>,
    voxel_m: f64,
    size: [usize; 3],
    is_occupied: Vec<bool>,
}

/// Why a map was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum VoxelMapError {
    /// Corners or edge are not finite, or the box has no inside.
    #[error("a map needs finite corners, the low one below the high one, and a voxel of a positive size")]
    BadBox,
    /// More voxels than are sensible.
    #[error("{voxels} voxels; at most {} fit", VoxelMap::MAX_VOXELS)]
    TooLarge {
        /// How many there would be.
        voxels: f64,
    },
}

impl VoxelMap {
    /// Most voxels of a map.
    pub const MAX_VOXELS: usize = 1 << 26;

    /// A free map. The box is covered by whole voxels from its low corner on.
    ///
    /// # Errors
    /// [`VoxelMapError`].
    pub fn free(low: &Point3<f64>, high: &Point3<f64>, voxel_m: f64) -> Result<Self, VoxelMapError> {
        let finite = low.iter().chain(high.iter()).all(|x| x.is_finite()) && voxel_m.is_finite();
        if !finite || voxel_m <= 0.0 || (0..3).any(|k| high[k] <= low[k]) {
            return Err(VoxelMapError::BadBox);
        }
        // A voxel that only rounding adds is none.
        let count = |k: usize| ((high[k] - low[k]) / voxel_m - 1e-6).ceil().max(1.0);
        let voxels = count(0) * count(1) * count(2);
        if voxels > Self::MAX_VOXELS as f64 {
            return Err(VoxelMapError::TooLarge { voxels });
        }
        let size = [count(0) as usize, count(1) as usize, count(2) as usize];
        Ok(VoxelMap { low: *low, voxel_m, size, is_occupied: vec![false; size[0] * size[1] * size[2]] })
    }

    /// Occupies every voxel whose centre lies in a box.
    pub fn occupy_box(&mut self, low: &Point3<f64>, high: &Point3<f64>) {
        let range = |k: usize| {
            let first = ((low[k] - self.low[k]) / self.voxel_m - 0.5).ceil().max(0.0) as usize;
            let beyond = ((high[k] - self.low[k]) / self.voxel_m - 0.5).floor() + 1.0;
            first..(beyond.max(0.0) as usize).min(self.size[k])
        };
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let at = self.number([x, y, z]);
                    self.is_occupied[at] = true;
                }
            }
        }
    }

    /// The map with every free voxel occupied that touches an occupied one, `rounds` times. What lies outside does not grow in.
    pub fn dilated(&self, rounds: usize) -> VoxelMap {
        // A cube is a product of lines: one axis after the other, whole rows and slabs at a time.
        let [width, height, _] = self.size;
        let mut grown = self.clone();
        let mut before = Vec::with_capacity(grown.is_occupied.len());
        for _ in 0..rounds {
            for line in grown.is_occupied.chunks_exact_mut(width) {
                before.clear();
                before.extend_from_slice(line);
                touch(&mut line[1..], &before[..width - 1]);
                touch(&mut line[..width - 1], &before[1..]);
            }
            for slab in grown.is_occupied.chunks_exact_mut(width * height) {
                before.clear();
                before.extend_from_slice(slab);
                let beyond = slab.len() - width;
                touch(&mut slab[width..], &before[..beyond]);
                touch(&mut slab[..beyond], &before[width..]);
            }
            before.clear();
            before.extend_from_slice(&grown.is_occupied);
            let beyond = before.len() - width * height;
            touch(&mut grown.is_occupied[width * height..], &before[..beyond]);
            touch(&mut grown.is_occupied[..beyond], &before[width * height..]);
        }
        grown
    }

    /// Edge of a voxel.
    pub fn voxel_m(&self) -> f64 {
        self.voxel_m
    }

    /// Corners of the box.
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        let span = Vector3::new(self.size[0] as f64, self.size[1] as f64, self.size[2] as f64) * self.voxel_m;
        (self.low, self.low + span)
    }

    /// Whether a point is inside the box and in a free voxel.
    pub fn is_free(&self, p: &Point3<f64>) -> bool {
        self.voxel(p).is_some_and(|at| !self.is_occupied[at])
    }

    /// Centres of the occupied voxels that touch a box and have a free neighbour: what can bound a piece of free space.
    pub fn surface_in_box(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> Vec<Vector3<f64>> {
        let index = |v: f64, k: usize| ((v - self.low[k]) / self.voxel_m).floor().clamp(0.0, self.size[k] as f64 - 1.0);
        let range = |k: usize| index(low[k], k) as usize..=index(high[k], k) as usize;
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        let mut found = Vec::new();
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let at = self.number([x, y, z]);
                    if !self.is_occupied[at] {
                        continue;
                    }
                    let index = [x, y, z];
                    let is_surface = (0..3).any(|k| {
                        (index[k] > 0 && !self.is_occupied[at - strides[k]])
                            || (index[k] + 1 < self.size[k] && !self.is_occupied[at + strides[k]])
                    });
                    if is_surface {
                        found.push(self.centre(at).coords);
                    }
                }
            }
        }
        found
    }

    /// Whether every point within `margin_m` (per axis) of a straight line is free.
    pub fn is_line_free(&self, a: &Point3<f64>, b: &Point3<f64>, margin_m: f64) -> bool {
        let length = (b - a).norm();
        let steps = (length / (0.2 * self.voxel_m)).ceil().max(1.0) as usize;
        // Cubes round the samples hold the line and its margin.
        let reach = 0.5 * length / steps as f64 + margin_m;
        (0..=steps).all(|k| self.is_cube_free(&(a + (b - a) * (k as f64 / steps as f64)), reach))
    }

    fn is_cube_free(&self, p: &Point3<f64>, reach: f64) -> bool {
        let (mut first, mut last) = ([0usize; 3], [0usize; 3]);
        for k in 0..3 {
            let low = ((p[k] - reach - self.low[k]) / self.voxel_m).floor();
            let high = ((p[k] + reach - self.low[k]) / self.voxel_m).floor();
            // The margin may reach out of the box, the line may not.
            let here = ((p[k] - self.low[k]) / self.voxel_m).floor();
            if !(here >= 0.0 && here <= self.size[k] as f64) {
                return false;
            }
            first[k] = low.max(0.0) as usize;
            last[k] = (high.max(0.0) as usize).min(self.size[k] - 1);
        }
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    if self.is_occupied[self.number([x, y, z])] {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// A shortest way between two free points, along voxel centres and then with its bends cut; `None` if there is none, or if
    /// either end is not free. `margin_m` is what cut bends keep from occupied voxels per axis.
    pub fn route(&self, from: &Point3<f64>, to: &Point3<f64>, margin_m: f64) -> Option<Vec<Point3<f64>>> {
        if !(self.is_free(from) && self.is_free(to)) {
            return None;
        }
        if self.is_line_free(from, to, margin_m) {
            return Some(vec![*from, *to]);
        }
        let cells = self.search(self.voxel(from)?, self.voxel(to)?)?;
        let mut points = vec![*from];
        points.extend(cells.iter().map(|at| self.centre(*at)));
        points.push(*to);
        Some(self.cut_bends(&points, margin_m))
    }

    /// A* from voxel to voxel.
    fn search(&self, from: usize, to: usize) -> Option<Vec<usize>> {
        let goal = self.index(to);
        let estimate = |at: usize| {
            let index = self.index(at);
            let mut d: [f32; 3] = std::array::from_fn(|k| index[k].abs_diff(goal[k]) as f32);
            d.sort_by(f32::total_cmp);
            // Steps over corners, edges and faces.
            GREED * (d[0] * 3f32.sqrt() + (d[1] - d[0]) * 2f32.sqrt() + (d[2] - d[1]))
        };
        let lengths = STEPS.map(|s| ((s[0] * s[0] + s[1] * s[1] + s[2] * s[2]) as f32).sqrt());
        // Cost + 1, so that zeroed memory means "not seen".
        let mut cost = vec![0f32; self.is_occupied.len()];
        let mut came = vec![0u8; self.is_occupied.len()];
        let mut heap = BinaryHeap::new();
        cost[from] = 1.0;
        heap.push(Entry { estimate: estimate(from), cost: 0.0, node: from as u32 });
        while let Some(Entry { cost: reached, node, .. }) = heap.pop() {
            let node = node as usize;
            if reached + 1.0 > cost[node] {
                continue;
            }
            if node == to {
                return Some(self.trace(from, to, &came));
            }
            let free = self.free_neighbours(node);
            for (k, step) in STEPS.iter().enumerate() {
                if free & NEEDED[k] != NEEDED[k] {
                    continue;
                }
                let other = (node as i64 + self.offset(*step)) as usize;
                let next = reached + lengths[k];
                if cost[other] != 0.0 && next + 1.0 >= cost[other] {
                    continue;
                }
                cost[other] = next + 1.0;
                came[other] = k as u8;
                heap.push(Entry { estimate: next + estimate(other), cost: next, node: other as u32 });
            }
        }
        None
    }

    fn trace(&self, from: usize, to: usize, came: &[u8]) -> Vec<usize> {
        let mut cells = vec![to];
        let mut at = to;
        while at != from {
            at = (at as i64 - self.offset(STEPS[came[at] as usize])) as usize;
            cells.push(at);
        }
        cells.reverse();
        cells
    }

    fn offset(&self, step: [i32; 3]) -> i64 {
        let [width, height, _] = self.size;
        i64::from(step[0]) + (i64::from(step[1]) + i64::from(step[2]) * height as i64) * width as i64
    }

    /// Bit `(dx + 1) + 3 (dy + 1) + 9 (dz + 1)` for each free voxel of the 27 round one, itself included.
    fn free_neighbours(&self, at: usize) -> u32 {
        let index = self.index(at);
        let mut free = 0;
        let mut bit = 0;
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let step = [dx, dy, dz];
                    let is_inside =
                        (0..3).all(|k| index[k].checked_add_signed(step[k] as isize).is_some_and(|i| i < self.size[k]));
                    if is_inside && !self.is_occupied[(at as i64 + self.offset(step)) as usize] {
                        free |= 1 << bit;
                    }
                    bit += 1;
                }
            }
        }
        free
    }

    /// From each kept point to the furthest later one in a free straight line; the ladder of lengths is searched by halving.
    fn cut_bends(&self, points: &[Point3<f64>], margin_m: f64) -> Vec<Point3<f64>> {
        let mut kept = vec![points[0]];
        let mut at = 0;
        while at + 1 < points.len() {
            let is_free = |to: usize| self.is_line_free(&points[at], &points[to], margin_m);
            let (mut next, mut stride) = (at + 1, 1);
            while at + stride < points.len() && (stride == 1 || is_free(at + stride)) {
                next = at + stride;
                stride *= 2;
            }
            let mut beyond = (at + stride).min(points.len());
            while beyond - next > 1 {
                let middle = next + (beyond - next) / 2;
                if is_free(middle) {
                    next = middle;
                } else {
                    beyond = middle;
                }
            }
            if points[next] != points[at] {
                kept.push(points[next]);
            }
            at = next;
        }
        kept
    }

    fn voxel(&self, p: &Point3<f64>) -> Option<usize> {
        let mut index = [0; 3];
        for k in 0..3 {
            let i = ((p[k] - self.low[k]) / self.voxel_m).floor();
            if !(i >= 0.0 && i < self.size[k] as f64) {
                return None;
            }
            index[k] = i as usize;
        }
        Some(self.number(index))
    }

    fn number(&self, index: [usize; 3]) -> usize {
        (index[2] * self.size[1] + index[1]) * self.size[0] + index[0]
    }

    fn index(&self, at: usize) -> [usize; 3] {
        [at % self.size[0], at / self.size[0] % self.size[1], at / (self.size[0] * self.size[1])]
    }

    fn centre(&self, at: usize) -> Point3<f64> {
        let index = self.index(at);
        self.low + Vector3::from_fn(|k, _| (index[k] as f64 + 0.5) * self.voxel_m)
    }
}

/// The 26 neighbours.
const STEPS: [[i32; 3]; 26] = {
    let mut steps = [[0; 3]; 26];
    let (mut k, mut count) = (0, 0);
    while k < 27 {
        if k != 13 {
            steps[count] = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
            count += 1;
        }
        k += 1;
    }
    steps
};

/// For each step, the voxels that have to be free: all of the box between the two neighbours.
const NEEDED: [u32; 26] = {
    let mut needed = [0; 26];
    let mut k = 0;
    while k < 26 {
        let mut corner = 0;
        while corner < 8 {
            let mut bit = 0;
            let mut place = 1;
            let mut axis = 0;
            while axis < 3 {
                let part = if corner >> axis & 1 == 1 { STEPS[k][axis] } else { 0 };
                bit += (part + 1) * place;
                place *= 3;
                axis += 1;
            }
            needed[k] |= 1 << bit;
            corner += 1;
        }
        k += 1;
    }
    needed
};

/// Occupies where the neighbour is.
fn touch(line: &mut [bool], neighbour: &[bool]) {
    for (own, other) in line.iter_mut().zip(neighbour) {
        *own |= *other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_gone_round_and_growth_closes_the_gap() {
        let mut map = VoxelMap::free(&Point3::origin(), &Point3::new(4.0, 4.0, 1.0), 0.25).unwrap();
        map.occupy_box(&Point3::new(1.8, 0.0, 0.0), &Point3::new(2.2, 3.5, 1.0));
        let (a, b) = (Point3::new(0.5, 0.5, 0.5), Point3::new(3.5, 0.5, 0.5));
        assert!(!map.is_line_free(&a, &b, 0.0));
        let route = map.route(&a, &b, 0.02).unwrap();
        assert!(route.len() >= 3 && route.iter().any(|p| p.y > 3.5), "{route:?}");
        assert!(route.windows(2).all(|w| map.is_line_free(&w[0], &w[1], 0.0)));
        assert_eq!(map.dilated(2).route(&a, &b, 0.02), None);
        assert_eq!(map.route(&a, &Point3::new(2.0, 1.0, 0.5), 0.02), None, "in the wall");
        assert_eq!(map.route(&a, &Point3::new(9.0, 1.0, 0.5), 0.02), None, "outside");
    }

    #[test]
    fn nonsense_is_refused() {
        let free = |high: f64, voxel: f64| VoxelMap::free(&Point3::origin(), &Point3::new(high, 1.0, 1.0), voxel);
        assert_eq!(free(f64::NAN, 0.1).err(), Some(VoxelMapError::BadBox));
        assert_eq!(free(1.0, 0.0).err(), Some(VoxelMapError::BadBox));
        assert!(matches!(free(1e9, 0.1), Err(VoxelMapError::TooLarge { .. })));
    }
}
