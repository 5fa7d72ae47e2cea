//! The obstacles near a route: points in buckets, and the distance each of them must keep.

use nalgebra::{Point3, Vector3};

use super::config::AirConfig;
use super::search::{SAME_M, SearchGrid};

const BUCKET_M: f64 = 0.5;
/// Round every leg the corridor has at least this much room: consecutive polytopes have to overlap.
pub(crate) const THINNEST_M: f64 = 0.004;

/// A point that the body's centre must keep away from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Obstacle {
    pub at: Vector3<f64>,
    /// Distance from the point that is demanded.
    pub needed_m: f64,
    /// Distance that is liked.
    pub liked_m: f64,
}

/// Obstacle points of a box, with the point where the flight starts (which may be nearer to some than is demanded
/// elsewhere: those must not come nearer still).
pub(crate) struct Surroundings<'a> {
    grid: &'a SearchGrid<'a>,
    start: Vector3<f64>,
    low: Vector3<f64>,
    size: [usize; 3],
    first: Vec<u32>,
    points: Vec<Vector3<f64>>,
    needed_m: f64,
    comfort_m: f64,
    resolution_m: f64,
}

impl<'a> Surroundings<'a> {
    pub fn new(
        points: &[Point3<f64>],
        start: &Point3<f64>,
        low: &Point3<f64>,
        high: &Point3<f64>,
        grid: &'a SearchGrid<'a>,
        config: &AirConfig,
    ) -> Self {
        let mut size = [0usize; 3];
        for axis in 0..3 {
            size[axis] = ((high[axis] - low[axis]) / BUCKET_M).ceil().max(1.0) as usize;
        }
        let bucket = |p: &Point3<f64>| {
            let mut index = [0usize; 3];
            for axis in 0..3 {
                let k = (p[axis] - low[axis]) / BUCKET_M;
                if !k.is_finite() {
                    return None;
                }
                // Points beyond the box still count: they go to its border.
                index[axis] = k.clamp(0.0, size[axis] as f64 - 1.0) as usize;
            }
            Some((index[2] * size[1] + index[1]) * size[0] + index[0])
        };
        let sorted: Vec<(usize, Vector3<f64>)> =
            points.iter().filter_map(|p| bucket(p).map(|b| (b, p.coords))).collect();
        let mut first = vec![0u32; size[0] * size[1] * size[2] + 1];
        for (b, _) in &sorted {
            first[b + 1] += 1;
        }
        for k in 1..first.len() {
            first[k] += first[k - 1];
        }
        let mut next = first.clone();
        let mut stored = vec![Vector3::zeros(); sorted.len()];
        for (b, p) in sorted {
            stored[next[b] as usize] = p;
            next[b] += 1;
        }
        Surroundings {
            grid,
            start: start.coords,
            low: low.coords,
            size,
            first,
            points: stored,
            needed_m: config.clearance_m() + config.obstacle_radius_m,
            comfort_m: config.comfort_m,
            resolution_m: config.search_resolution_m,
        }
    }

    /// The largest distance that any obstacle demands.
    pub fn furthest_m(&self) -> f64 {
        self.needed_m
    }

    /// Everything within `reach_m` of the box of a segment that may bind: obstacle points and unknown lattice points.
    pub fn near(&self, a: &Vector3<f64>, b: &Vector3<f64>, reach_m: f64) -> Vec<Obstacle> {
        let mut found = Vec::new();
        let reach = Vector3::repeat(reach_m);
        let (low, high) = (a.inf(b) - reach, a.sup(b) + reach);
        self.for_points(&low, &high, |p| {
            if (0..3).all(|axis| p[axis] >= low[axis] && p[axis] <= high[axis]) {
                let needed_m = self.needed_m.min((p - self.start).norm() - THINNEST_M);
                found.push(Obstacle { at: *p, needed_m, liked_m: self.needed_m + self.comfort_m });
            }
        });
        // What nobody has seen may be anything: it is kept away from like an obstacle, and comfort is for obstacles.
        self.grid.for_unknown_border(&low, &high, |at| {
            let needed_m = self.needed_m.min((at - self.start).norm() - THINNEST_M);
            found.push(Obstacle { at, needed_m, liked_m: needed_m });
            true
        });
        found
    }

    /// Whether a straight flight keeps every demanded distance. Exact on the points.
    pub fn is_clear(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
        let wanted = self.needed_m + THINNEST_M;
        let reach = Vector3::repeat(wanted);
        let (low, high) = (a.inf(b) - reach, a.sup(b) + reach);
        let mut clear = true;
        self.for_points(&low, &high, |p| {
            let d = (p - nearest_on_segment(a, b, p)).norm();
            clear &= d >= wanted || d >= (p - self.start).norm() - SAME_M;
        });
        if !clear {
            return false;
        }
        let steps = ((b - a).norm() / (0.25 * self.resolution_m)).ceil().max(1.0) as usize;
        let mut last = usize::MAX;
        for k in 0..=steps {
            let p = Point3::from(a + (b - a) * (k as f64 / steps as f64));
            let Some(node) = self.grid.node(&p) else {
                return false;
            };
            if node != last {
                let is_start = self.grid.node(&Point3::from(self.start)) == Some(node);
                if self.grid.clearance(node).is_none() && !is_start {
                    return false;
                }
                last = node;
            }
        }
        self.grid.for_unknown_border(&low, &high, |at| {
            let apart = (at - nearest_on_segment(a, b, &at)).norm();
            apart >= wanted || apart >= (at - self.start).norm() - SAME_M
        })
    }

    /// Moves a point out of what it is too near to, by at most a cell: to the middle of a gap that the lattice misses.
    pub fn centred(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let wanted = self.needed_m + 0.02;
        let reach = Vector3::repeat(wanted + self.resolution_m);
        let mut near = Vec::new();
        self.for_points(&(point - reach), &(point + reach), |p| near.push(*p));
        self.grid.for_unknown_border(&(point - reach), &(point + reach), |at| {
            near.push(at);
            true
        });
        let least = |p: &Vector3<f64>| near.iter().map(|o| (o - p).norm()).fold(f64::INFINITY, f64::min);
        let mut best = (least(point), *point);
        let mut step = 0.5 * self.resolution_m;
        while step > 0.002 && best.0 < wanted {
            let mut improved = false;
            for axis in 0..3 {
                for sign in [1.0, -1.0] {
                    let mut p = best.1;
                    p[axis] += sign * step;
                    let clearance = least(&p);
                    if clearance > best.0 + 1e-4 && (p - point).norm() <= self.resolution_m {
                        best = (clearance, p);
                        improved = true;
                    }
                }
            }
            if !improved {
                step *= 0.5;
            }
        }
        best.1
    }

    fn for_points(&self, low: &Vector3<f64>, high: &Vector3<f64>, mut visit: impl FnMut(&Vector3<f64>)) {
        let range = |axis: usize| {
            let last = self.size[axis] as f64 - 1.0;
            let a = ((low[axis] - self.low[axis]) / BUCKET_M).floor().clamp(0.0, last);
            let b = ((high[axis] - self.low[axis]) / BUCKET_M).floor().clamp(0.0, last);
            a as usize..=b as usize
        };
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let bucket = (z * self.size[1] + y) * self.size[0] + x;
                    self.points[self.first[bucket] as usize..self.first[bucket + 1] as usize]
                        .iter()
                        .for_each(&mut visit);
                }
            }
        }
    }
}

/// The point of segment `a`-`b` nearest to `p`.
pub(crate) fn nearest_on_segment(a: &Vector3<f64>, b: &Vector3<f64>, p: &Vector3<f64>) -> Vector3<f64> {
    let u = b - a;
    let squared = u.norm_squared();
    let t = if squared > 0.0 { ((p - a).dot(&u) / squared).clamp(0.0, 1.0) } else { 0.0 };
    a + u * t
}
