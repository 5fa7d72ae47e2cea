//! The last scans' obstacle points round the robot: exact points in buckets, and a distance picture that
//! answers "surely free" in one look-up.

use nalgebra::Point2;

use super::clearance::squared_distances;
use super::footprint::Footprint;

/// Cell of the distance picture.
const CELL_M: f64 = 0.05;
/// Side of a bucket of points.
const BUCKET_M: f64 = 0.15;
/// Two points in two cells: their distance is at least that of the cell centres minus two half diagonals.
const SLACK_M: f64 = CELL_M * std::f64::consts::SQRT_2;

/// A planar pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
}

/// Obstacle points in a square window.
#[derive(Debug, Clone, Default)]
pub(crate) struct ObstacleField {
    low: Point2<f64>,
    cells: usize,
    distance_m: Vec<f32>,
    buckets: usize,
    start: Vec<u32>,
    points: Vec<[f64; 2]>,
    /// Distance each point must keep: the margin, or what it has now if that is less.
    required: Vec<f64>,
    tightened: Vec<u32>,
    source: Vec<Point2<f32>>,
    centre: Point2<f64>,
    half_m: f64,
}

impl ObstacleField {
    /// Reads the points in reach of the robot; does nothing if they are the same as last time and the robot has moved
    /// less than `spare_m`.
    pub fn update(&mut self, points: &[Point2<f32>], centre: &Point2<f64>, reach_m: f64, spare_m: f64) {
        let near = (self.centre - centre).abs().max() <= spare_m && self.half_m >= reach_m + spare_m;
        if near && !self.start.is_empty() && self.source == points {
            return;
        }
        self.source.clear();
        self.source.extend_from_slice(points);
        self.centre = *centre;
        self.half_m = reach_m + spare_m;
        self.low = Point2::new(centre.x - self.half_m, centre.y - self.half_m);
        self.cells = (2.0 * self.half_m / CELL_M).ceil() as usize + 1;
        self.buckets = (2.0 * self.half_m / BUCKET_M).ceil() as usize + 1;
        self.sort_points();
        self.measure();
    }

    fn sort_points(&mut self) {
        let (low, n) = (self.low, self.buckets);
        let bucket = |p: &[f64; 2]| {
            let (bx, by) = ((p[0] - low.x) / BUCKET_M, (p[1] - low.y) / BUCKET_M);
            (bx >= 0.0 && by >= 0.0 && bx < n as f64 && by < n as f64).then(|| by as usize * n + bx as usize)
        };
        // Non-finite points fall outside every bucket and are skipped.
        let all: Vec<([f64; 2], usize)> = self
            .source
            .iter()
            .map(|p| [f64::from(p.x), f64::from(p.y)])
            .filter_map(|p| bucket(&p).map(|b| (p, b)))
            .collect();
        self.start = vec![0; n * n + 1];
        for (_, b) in &all {
            self.start[b + 1] += 1;
        }
        for k in 1..self.start.len() {
            self.start[k] += self.start[k - 1];
        }
        let mut next = self.start.clone();
        self.points = vec![[0.0; 2]; all.len()];
        for (p, b) in all {
            self.points[next[b] as usize] = p;
            next[b] += 1;
        }
        self.tightened.clear();
        self.required = vec![f64::INFINITY; self.points.len()];
    }

    fn measure(&mut self) {
        let n = self.cells;
        let mut occupied = vec![false; n * n];
        for p in &self.points {
            let (i, j) = (((p[0] - self.low.x) / CELL_M) as usize, ((p[1] - self.low.y) / CELL_M) as usize);
            if i < n && j < n {
                occupied[j * n + i] = true;
            }
        }
        self.distance_m = squared_distances(n, n, |i, j| occupied[j * n + i])
            .into_iter()
            .map(|d| (f64::from(d).sqrt() * CELL_M) as f32)
            .collect();
    }

    /// Sets what every point must keep from the footprint: `margin_m`, or its present distance where that is less, so
    /// that a robot that starts too near may leave but not come nearer. Returns the present Euclidean clearance, at
    /// most `reach_m`.
    pub fn set_required(&mut self, footprint: &Footprint, pose: &Pose, margin_m: f64, reach_m: f64) -> f64 {
        for k in self.tightened.drain(..) {
            self.required[k as usize] = f64::INFINITY;
        }
        let mut clearance = reach_m;
        let (sin, cos) = pose.yaw.sin_cos();
        let mut tightened = Vec::new();
        self.for_near(
            pose,
            footprint.circumscribed_radius_m + reach_m,
            |_, _| true,
            |k, p| {
                let (dx, dy) = (p[0] - pose.x, p[1] - pose.y);
                let body = Point2::new(cos * dx + sin * dy, cos * dy - sin * dx);
                let side = footprint.side_distance(body.x, body.y);
                if side < clearance {
                    clearance = clearance.min(footprint.distance(&body));
                }
                if side < margin_m {
                    // A rounding less than now; more would let the robot creep nearer cycle by cycle.
                    tightened.push((k as u32, side - 1e-6));
                }
                true
            },
        );
        for (k, required) in tightened {
            self.required[k as usize] = required;
            self.tightened.push(k);
        }
        clearance
    }

    /// Whether the footprint at `pose` keeps from every point what it must. Exact on the points (with mitred corners).
    pub fn is_free(&self, footprint: &Footprint, pose: &Pose, margin_m: f64) -> bool {
        if self.clearance_bound(footprint, pose) > margin_m {
            return true;
        }
        let (sin, cos) = pose.yaw.sin_cos();
        // A bucket further from every side than this cannot hold a point that binds.
        let beyond = margin_m + BUCKET_M * std::f64::consts::FRAC_1_SQRT_2;
        let body = |x: f64, y: f64| {
            let (dx, dy) = (x - pose.x, y - pose.y);
            footprint.side_distance(cos * dx + sin * dy, cos * dy - sin * dx)
        };
        // Mitred corners reach at most sqrt(2) margins out for corners of 90 degrees and more.
        let reach_m = footprint.circumscribed_radius_m + 1.5 * margin_m;
        self.for_near(
            pose,
            reach_m,
            |x, y| body(x, y) <= beyond,
            |k, p| body(p[0], p[1]) >= margin_m.min(self.required[k]),
        )
    }

    /// A lower bound of the distance between the footprint and the nearest point; may be negative.
    pub fn clearance_bound(&self, footprint: &Footprint, pose: &Pose) -> f64 {
        let (sin, cos) = pose.yaw.sin_cos();
        let mut least = f64::INFINITY;
        for d in &footprint.discs {
            let (x, y) = (pose.x + cos * d.x - sin * d.y, pose.y + sin * d.x + cos * d.y);
            let (i, j) = ((x - self.low.x) / CELL_M, (y - self.low.y) / CELL_M);
            if !(i >= 0.0 && j >= 0.0 && i < self.cells as f64 && j < self.cells as f64) {
                continue;
            }
            least = least.min(f64::from(self.distance_m[j as usize * self.cells + i as usize]));
        }
        least - footprint.disc_radius_m - SLACK_M
    }

    /// Calls `visit` for the points of the buckets in a square round the pose whose centre is wanted, until it returns false; whether it never did.
    fn for_near(
        &self,
        pose: &Pose,
        reach_m: f64,
        wants: impl Fn(f64, f64) -> bool,
        mut visit: impl FnMut(usize, &[f64; 2]) -> bool,
    ) -> bool {
        if self.points.is_empty() {
            return true;
        }
        let last = self.buckets as f64 - 1.0;
        let range = |v: f64, low: f64| {
            let a = ((v - reach_m - low) / BUCKET_M).floor().clamp(0.0, last);
            let b = ((v + reach_m - low) / BUCKET_M).floor().clamp(0.0, last);
            a as usize..=b as usize
        };
        for by in range(pose.y, self.low.y) {
            for bx in range(pose.x, self.low.x) {
                let bucket = by * self.buckets + bx;
                if self.start[bucket] == self.start[bucket + 1] {
                    continue;
                }
                let (x, y) = ((bx as f64 + 0.5) * BUCKET_M, (by as f64 + 0.5) * BUCKET_M);
                if !wants(self.low.x + x, self.low.y + y) {
                    continue;
                }
                for k in self.start[bucket] as usize..self.start[bucket + 1] as usize {
                    if !visit(k, &self.points[k]) {
                        return false;
                    }
                }
            }
        }
        true
    }
}
