//! Where this robot can go: the map cut at its height, its clearance, and ways through what is known.
//!
//! Both robots travel in the plane here: the ground robot because it must, the aerial one because indoors it keeps its
//! height and leaves the third dimension to the corridor of its trajectory.

use nalgebra::{Isometry3, Point2};
use planner::{GridView, GroundError, VisibilityGraph};
use robot_model::{RobotKind, RobotModel};
use rustc_hash::FxHashSet;
use volumetric_map::{Cell, OccupancyGrid, Volume};

use crate::zones::{MARGIN_M, Zones};

/// On the ground the route may cut this much into the circle that the robot sweeps when it turns: through a door it goes straight,
/// and the local policy keeps the true outline clear whatever the route says. Without it a door of 1.0 m, drawn with cells of
/// 5 cm at an odd angle, closes.
const GROUND_CUT_M: f64 = 0.04;
/// ... but never nearer than this to half its width.
const GROUND_MARGIN_M: f64 = 0.10;
/// Through what is too narrow to turn in a ground robot goes straight. It sways by so much sideways, ...
const SWAY_M: f64 = 0.05;
/// ... and its heading by so much, which moves its ends.
const SWAY_RAD: f64 = 0.14;
/// What the robot may drive over: thresholds, carpet edges, noise of the floor.
const STEP_M: f64 = 0.10;
/// Room above the robot's highest point.
const HEADROOM_M: f64 = 0.05;

/// The plane as this robot meets it, rebuilt from the volume at every refresh.
pub struct NavigationMap {
    /// Free, occupied, unknown at the robot's height.
    pub grid: OccupancyGrid,
    /// Ways with at least the robot's own circle free.
    graph: Option<VisibilityGraph>,
    /// Cells over which the robot has stood; they are free whatever the sensors' blind spots say.
    stood_on: FxHashSet<(i64, i64)>,
    room: Room,
    radius_m: f64,
    /// In the map.
    pub(crate) zones: Zones,
}

/// Room that a robot keeps round the middle of its body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// Where it may turn.
    pub turning_m: f64,
    /// On a straight leg between two such places, with its nose along it; `None` for a robot that makes no difference.
    pub passing_m: Option<f64>,
}

impl Room {
    /// What the outline in its URDF asks for.
    pub fn of(robot: &RobotModel) -> Room {
        let radius_m = robot.circumscribed_radius_m;
        match robot.kind {
            RobotKind::Ground => {
                let farthest =
                    |of: fn(&Point2<f64>) -> f64| robot.footprint.iter().map(|p| of(p).abs()).fold(0.0, f64::max);
                Room {
                    turning_m: (radius_m - GROUND_CUT_M).max(robot.inscribed_radius_m + GROUND_MARGIN_M),
                    passing_m: Some(farthest(|p| p.y) + SWAY_M + SWAY_RAD * farthest(|p| p.x)),
                }
            }
            RobotKind::Aerial => Room { turning_m: radius_m, passing_m: None },
        }
    }

    /// The graph of ways with this room.
    ///
    /// # Errors
    /// A grid or a clearance that [`VisibilityGraph::build`] refuses.
    pub fn graph(&self, view: &GridView) -> Result<VisibilityGraph, GroundError> {
        let graph = VisibilityGraph::build(view, self.turning_m)?;
        Ok(match self.passing_m {
            Some(passing_m) => graph.with_gates(passing_m),
            None => graph,
        })
    }
}

impl NavigationMap {
    /// Nothing known.
    pub fn new(robot: &RobotModel) -> Self {
        let radius_m = robot.circumscribed_radius_m;
        Self {
            grid: OccupancyGrid {
                origin: Point2::origin(),
                resolution_m: 0.05,
                width: 0,
                height: 0,
                cells: Vec::new(),
            },
            graph: None,
            stood_on: FxHashSet::default(),
            room: Room::of(robot),
            radius_m,
            zones: Zones::default(),
        }
    }

    /// Zones to keep out of are as good as walls from the next refresh on, and only here: rooms and things know nothing of them.
    pub fn heed(&mut self, zones: &Zones) {
        self.zones.clone_from(zones);
    }

    /// Whether the robot has been put into the map yet.
    pub fn has_begun(&self) -> bool {
        !self.stood_on.is_empty()
    }

    /// Cuts the volume at the robot's height. `floor_m` is the height of the floor in the map, `body_height_m` the height
    /// at which the body moves above it, `blind_m` how far from the body's middle the floor comes into sight.
    pub fn refresh(
        &mut self,
        volume: &Volume,
        robot: &RobotModel,
        world_from_body: &Isometry3<f64>,
        floor_m: f64,
        body_height_m: f64,
        blind_m: f64,
    ) {
        let (low_m, high_m) = robot.height_span_m;
        self.grid = match robot.kind {
            RobotKind::Ground => {
                let top_m = robot.stance_height_m + high_m + HEADROOM_M;
                volume.ground_grid(floor_m, STEP_M, top_m)
            }
            RobotKind::Aerial => {
                let body_m = floor_m + body_height_m;
                volume.slice(body_m + low_m - HEADROOM_M, body_m + high_m + HEADROOM_M, None)
            }
        };
        // The sensors are blind for what is nearest to the body's outline. Where it was switched on they never saw the floor
        // under their lowest ray: it counts as free unless something stands up from it. Later they have seen it from afar.
        const BLIND_M: f64 = 0.12;
        const MOST_BLIND_M: f64 = 1.5;
        let usual_m = self.radius_m + BLIND_M;
        let reach_m = if self.has_begun() { usual_m } else { usual_m.max(blind_m.min(MOST_BLIND_M)) };
        self.remember_footprint(&Point2::from(world_from_body.translation.vector.xy()), reach_m);
        let stood_on = &self.stood_on;
        for iy in 0..self.grid.height {
            for ix in 0..self.grid.width {
                let cell = &mut self.grid.cells[iy * self.grid.width + ix];
                if *cell == Cell::Unknown {
                    let x = self.grid.origin.x + (ix as f64 + 0.5) * self.grid.resolution_m;
                    let y = self.grid.origin.y + (iy as f64 + 0.5) * self.grid.resolution_m;
                    if stood_on.contains(&key(x, y)) {
                        *cell = Cell::Free;
                    }
                }
            }
        }
        self.close();
        let blocked: Vec<bool> = self.grid.cells.iter().map(|cell| *cell != Cell::Free).collect();
        let view = GridView {
            origin: self.grid.origin,
            resolution_m: self.grid.resolution_m,
            width: self.grid.width,
            height: self.grid.height,
            blocked: &blocked,
        };
        self.graph = self.room.graph(&view).ok();
    }

    /// Straight ways through places too narrow to turn in, end to end.
    pub fn gates(&self) -> Vec<[Point2<f64>; 2]> {
        self.graph.as_ref().map(VisibilityGraph::gates).unwrap_or_default()
    }

    /// Every cell that a zone to keep out of touches, with its margin, is occupied.
    fn close(&mut self) {
        let resolution_m = self.grid.resolution_m;
        let reach_m = std::f64::consts::FRAC_1_SQRT_2 * resolution_m;
        let grow = nalgebra::Vector2::repeat(MARGIN_M + reach_m);
        for keep_out in &self.zones.keep_out {
            let (low, high) = keep_out.zone.bounds();
            let range = |low: f64, high: f64, origin: f64, count: usize| {
                let cell = |x: f64| ((x - origin) / resolution_m).floor();
                cell(low).max(0.0) as usize..(cell(high) + 1.0).clamp(0.0, count as f64) as usize
            };
            let (low, high) = (low - grow, high + grow);
            for iy in range(low.y, high.y, self.grid.origin.y, self.grid.height) {
                for ix in range(low.x, high.x, self.grid.origin.x, self.grid.width) {
                    if keep_out.zone.distance_m(&self.grid.center(ix, iy)) <= MARGIN_M + reach_m {
                        self.grid.cells[iy * self.grid.width + ix] = Cell::Occupied;
                    }
                }
            }
        }
    }

    fn remember_footprint(&mut self, at: &Point2<f64>, reach_m: f64) {
        let reach = (reach_m / KEY_M).ceil() as i64;
        let (cx, cy) = key(at.x, at.y);
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                if dx * dx + dy * dy <= reach * reach {
                    self.stood_on.insert((cx + dx, cy + dy));
                }
            }
        }
    }

    /// The shortest way from `start` to `goal` through known free space.
    pub fn route(&self, start: &Point2<f64>, goal: &Point2<f64>) -> Option<planner::Route> {
        self.graph.as_ref()?.route(start, goal)
    }

    /// The way to `goal`; if that cannot be reached, to the reachable point nearest to it, if that is within `tolerance_m`.
    pub fn route_toward(&self, start: &Point2<f64>, goal: &Point2<f64>, tolerance_m: f64) -> Option<Vec<Point2<f64>>> {
        let route = self.route(start, goal).or_else(|| {
            let (nearest, off_m) = self.nearest_reachable(start, goal)?;
            (off_m <= tolerance_m).then(|| self.route(start, &nearest)).flatten()
        });
        route.map(|route| route.points)
    }

    /// The reachable point nearest to `goal`, and how far from it that is.
    pub fn nearest_reachable(&self, start: &Point2<f64>, goal: &Point2<f64>) -> Option<(Point2<f64>, f64)> {
        self.graph.as_ref()?.nearest_reachable(start, goal)
    }

    /// Lengths of the ways from `start` to each goal, `None` where there is none through known free space.
    pub fn lengths_from(&self, start: &Point2<f64>, goals: &[Point2<f64>]) -> Vec<Option<f64>> {
        match &self.graph {
            Some(graph) => graph.lengths_from(start, goals),
            None => vec![None; goals.len()],
        }
    }

    /// Radius of the robot's circle with its margin.
    pub fn clearance_m(&self) -> f64 {
        self.room.turning_m
    }

    /// How much room the robot lacks at `point` to turn on the spot with a hand's breadth to spare; 0 where it has it.
    pub fn lacking_m(&self, point: &Point2<f64>) -> f64 {
        const SPARE_M: f64 = 0.08;
        (self.radius_m + SPARE_M - self.clearance_at(point)).max(0.0)
    }

    /// Distance to the nearest cell that is not free, up to 2 m.
    pub fn clearance_at(&self, point: &Point2<f64>) -> f64 {
        self.graph.as_ref().map_or(0.0, |graph| graph.clearance_at(point))
    }

    /// Middles of the cells within `range_m` of `center` where the robot may not be: what is occupied, which the last scans may
    /// not show because they are blind there, and the rim of what nobody has seen, where there may be no floor.
    pub fn barred_near(&self, center: &Point2<f64>, range_m: f64) -> Vec<Point2<f32>> {
        let reach = (range_m / self.grid.resolution_m).ceil() as i64;
        let mut points = Vec::new();
        let Some((cx, cy)) = self.grid.cell_of(center) else { return points };
        let (width, height) = (self.grid.width as i64, self.grid.height as i64);
        let content = |ix: i64, iy: i64| match ix >= 0 && iy >= 0 && ix < width && iy < height {
            true => self.grid.get(ix as usize, iy as usize),
            false => Cell::Unknown,
        };
        let is_rim = |ix: i64, iy: i64| {
            [(1, 0), (-1, 0), (0, 1), (0, -1)].iter().any(|(dx, dy)| content(ix + dx, iy + dy) == Cell::Free)
        };
        for iy in (cy as i64 - reach).max(0)..(cy as i64 + reach + 1).min(height) {
            for ix in (cx as i64 - reach).max(0)..(cx as i64 + reach + 1).min(width) {
                let is_barred = match content(ix, iy) {
                    Cell::Free => false,
                    Cell::Occupied => true,
                    Cell::Unknown => is_rim(ix, iy),
                };
                let middle = self.grid.center(ix as usize, iy as usize);
                if is_barred && (middle - center).norm() <= range_m {
                    points.push(Point2::new(middle.x as f32, middle.y as f32));
                }
            }
        }
        points
    }
}

/// Edge of a remembered cell.
const KEY_M: f64 = 0.05;

fn key(x: f64, y: f64) -> (i64, i64) {
    ((x / KEY_M).floor() as i64, (y / KEY_M).floor() as i64)
}
