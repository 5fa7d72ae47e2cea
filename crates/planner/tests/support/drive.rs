//! A point robot that patrols a building, sees, and keeps a dynamic visibility graph: for benches and figures.

use nalgebra::{Point2, Point3, Vector2};
use planner::ground::far::window::Seen;
use planner::ground::far::{DynamicVisibilityGraph, Update, config::FarConfig};

use super::SplitMix;
use super::building::{Belief, Building, advance, ground};

/// A patrol from room to room, each drawn; every 50 cycles a box moves.
pub struct Patrol {
    pub building: Building,
    pub belief: Belief,
    pub graph: DynamicVisibilityGraph,
    pub at: Point2<f64>,
    pub goal: Point2<f64>,
    pub metres: f64,
    /// Standard deviation of a range.
    pub noise_m: f64,
    random: SplitMix,
    cycle: u32,
    side: usize,
    cells: Vec<Seen>,
    moving: Option<[i64; 4]>,
}

impl Patrol {
    pub fn new(building: Building, side: usize) -> Self {
        let config = FarConfig { voxel_m: building.voxel_m, ..FarConfig::default() };
        Patrol {
            belief: Belief::new(&building),
            graph: DynamicVisibilityGraph::new(config).unwrap(),
            at: building.rooms[0],
            goal: building.rooms[0],
            metres: 0.0,
            noise_m: 0.0,
            random: SplitMix(7),
            cycle: 0,
            side,
            cells: Vec::new(),
            moving: None,
            building,
        }
    }

    /// Scans, updates, plans, drives 0.2 m. `timed` is given the update and the search.
    pub fn step<T>(&mut self, timed: &mut impl FnMut(&mut dyn FnMut()) -> T) -> (T, T, Update) {
        self.look();
        let window = self.belief.window(&self.at, self.side, &mut self.cells);
        let (graph, here) = (&mut self.graph, ground(&self.at));
        let mut update = Update::default();
        let updating = timed(&mut || update = graph.update(&here, &window).unwrap());
        if (self.goal - self.at).norm() < 0.5 || self.cycle.is_multiple_of(400) {
            self.goal = self.any_room();
        }
        let goal = ground(&self.goal);
        let mut route = None;
        let searching = timed(&mut || {
            route = self.graph.route(&here, &goal).ok();
        });
        match route {
            Some(route) => {
                let points: Vec<Point2<f64>> = route.points.iter().map(|p| p.xy()).collect();
                let next = advance(&self.at, &points, 0.2);
                self.metres += (next - self.at).norm();
                self.at = next;
            }
            None => self.goal = self.any_room(),
        }
        (updating, searching, update)
    }

    /// The next poses and windows, without telling the graph.
    pub fn record(&mut self, cycles: usize) -> Vec<(Point3<f64>, [i64; 2], Vec<Seen>)> {
        let mut poses = Vec::new();
        for k in 0..cycles {
            let route =
                self.graph.route(&ground(&self.at), &ground(&self.goal)).map(|route| route.points).unwrap_or_default();
            let points: Vec<Point2<f64>> = route.iter().map(|p| p.xy()).collect();
            self.at = advance(&self.at, &points, 0.2);
            if (self.goal - self.at).norm() < 0.5 || k % 50 == 49 {
                self.goal = self.any_room();
            }
            self.look();
            let mut cells = Vec::new();
            let first_cell = self.belief.window(&self.at, self.side, &mut cells).first_cell;
            poses.push((ground(&self.at), first_cell, cells));
        }
        poses
    }

    fn any_room(&mut self) -> Point2<f64> {
        self.building.rooms[(self.random.next() % self.building.rooms.len() as u64) as usize]
    }

    /// Now and then moves a box; scans.
    fn look(&mut self) {
        if self.cycle.is_multiple_of(50) {
            if let Some(old) = self.moving.take() {
                self.building.fill(old, false);
            }
            let room = self.any_room();
            let cell = |m: f64| (m / self.building.voxel_m) as i64;
            let rect = [cell(room.x + 0.3), cell(room.y + 0.3), cell(room.x + 0.8), cell(room.y + 0.8)];
            if self.building.distance(&(room + Vector2::new(0.5, 0.5)), 0.4) >= 0.4 && (room - self.at).norm() > 2.0 {
                self.building.fill(rect, true);
                self.moving = Some(rect);
            }
        }
        self.cycle += 1;
        let (random, noise_m) = (&mut self.random, self.noise_m);
        let noise = || match noise_m {
            0.0 => 0.0,
            // A sum of twelve is nearly Gaussian; points lie a little before the surface.
            _ => noise_m * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0) - 1.5 * noise_m,
        };
        self.belief.scan_with(&self.building, &self.at, 10.0, 1440, noise);
    }
}

/// The median and the 99th percentile.
pub fn median_p99(times: &mut [f64]) -> (f64, f64) {
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], times[(times.len() * 99).div_ceil(100) - 1])
}
