//! The referee: decides from the truth whether the robot did what it was asked.
//!
//! A *view point* of an object is a pose of the robot that is free for its circle, at most 1.0 m of floor from the object's
//! box, with an unblocked ray from the camera to the object. The robot succeeds if it declared stop within 0.5 m of way of
//! a view point, after every earlier step was done in order.

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use omni_sim::building::{Building, ObjectTruth};
use omni_sim::world::World;
use serde::{Deserialize, Serialize};

use crate::task::StepTruth;
use omni_sim::floor::TrueFloor;

/// Largest distance on the floor between a view point and the object's box.
pub const VIEW_DISTANCE_M: f64 = 1.0;
/// Largest way between where the robot stands and a view point.
pub const ARRIVAL_M: f64 = 0.5;

/// Largest distance from where the robot set out at which it is back.
pub const HOME_M: f64 = 1.0;

/// What the referee must know of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotTruth {
    /// Circle that the robot sweeps when it turns.
    pub radius_m: f64,
    /// Half the width of its body: it can stand this near to something.
    pub inscribed_radius_m: f64,
    /// Heights above the floor between which the robot is solid while it moves.
    pub solid_m: (f64, f64),
    /// Heights above the floor at which its camera may be.
    pub camera_heights_m: Vec<f64>,
}

/// Judges runs in one building with one robot.
pub struct Referee<'a> {
    building: &'a Building,
    world: &'a World,
    robot: RobotTruth,
    floor: TrueFloor,
    /// The same with everything from the floor up as an obstacle.
    ground: TrueFloor,
    /// Where the robot set out.
    start: Option<Point2<f64>>,
}

impl<'a> Referee<'a> {
    /// Looks at one storey of the building.
    pub fn new(building: &'a Building, world: &'a World, robot: RobotTruth, storey: u32) -> Self {
        let floor = TrueFloor::new(building, storey, robot.solid_m.0, robot.solid_m.1);
        let ground = TrueFloor::new(building, storey, 0.05, robot.solid_m.1);
        Self { building, world, robot, floor, ground, start: None }
    }

    /// The same for a run that begins here: without it nobody can be back at the start.
    pub fn of_run_from(self, start: Point2<f64>) -> Self {
        Self { start: Some(start), ..self }
    }

    /// The floor with its clearance.
    pub fn floor(&self) -> &TrueFloor {
        &self.floor
    }

    /// Whether nothing stands on the floor within `radius_m` of a cell, from the floor up to the robot's top: where it can
    /// be put down.
    pub fn stands_free(&self, cell: usize, radius_m: f64) -> bool {
        self.ground.clearance_m(cell) >= radius_m
    }

    /// Cells from which the object is seen as a view point demands.
    pub fn view_points(&self, object: &ObjectTruth) -> Vec<usize> {
        let footprint = object.bounds.footprint().grown(VIEW_DISTANCE_M);
        let mut cells = Vec::new();
        let step = omni_sim::floor::CELL_M;
        let mut y = footprint.min.y;
        while y <= footprint.max.y {
            let mut x = footprint.min.x;
            while x <= footprint.max.x {
                let point = Point2::new(x, y);
                if object.bounds.footprint().distance_m(&point) <= VIEW_DISTANCE_M
                    && let Some(cell) = self.floor.cell_of(&point)
                    && self.floor.clearance_m(cell) >= self.robot.radius_m
                    && self.sees_from(&self.floor.center_of(cell), object)
                {
                    cells.push(cell);
                }
                x += step;
            }
            y += step;
        }
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    /// Whether a camera over `at` has an unblocked ray to the object.
    pub fn sees_from(&self, at: &Point2<f64>, object: &ObjectTruth) -> bool {
        self.robot
            .camera_heights_m
            .iter()
            .any(|height_m| self.sees(&Point3::new(at.x, at.y, self.floor.floor_z_m + height_m), object))
    }

    /// Whether one of a dozen rays from `eye` to points of the object's box ends on the object.
    pub fn sees(&self, eye: &Point3<f64>, object: &ObjectTruth) -> bool {
        let (center, half) = (object.bounds.center(), (object.bounds.max - object.bounds.min) / 2.0);
        const AIMS: [[f64; 3]; 15] = [
            [0.0, 0.0, 0.0],
            [0.9, 0.0, 0.0],
            [-0.9, 0.0, 0.0],
            [0.0, 0.9, 0.0],
            [0.0, -0.9, 0.0],
            [0.0, 0.0, 0.9],
            [0.0, 0.0, -0.9],
            [0.8, 0.8, 0.8],
            [0.8, -0.8, 0.8],
            [-0.8, 0.8, 0.8],
            [-0.8, -0.8, 0.8],
            [0.8, 0.8, 0.0],
            [0.8, -0.8, 0.0],
            [-0.8, 0.8, 0.0],
            [-0.8, -0.8, 0.0],
        ];
        AIMS.iter().any(|aim| {
            let target = center + Vector3::new(aim[0] * half.x, aim[1] * half.y, aim[2] * half.z);
            let ray = target - eye;
            let range_m = ray.norm() + 2.0 * half.norm() + 0.1;
            self.world.ray(eye, &(ray / ray.norm().max(1e-9)), range_m, 0).is_some_and(|hit| hit.instance == object.id)
        })
    }

    /// Whether the robot at `truth_from_body` stands where the step wants it.
    pub fn is_done(&self, step: &StepTruth, truth_from_body: &Isometry3<f64>) -> bool {
        let at = Point2::from(truth_from_body.translation.vector.xy());
        match step {
            StepTruth::Start => self.start.is_some_and(|start| (at - start).norm() <= HOME_M),
            StepTruth::Room { ids } => {
                let probe = Point3::new(at.x, at.y, self.floor.floor_z_m + 0.5);
                self.building.room_at(&probe).is_some_and(|room| ids.contains(&room.id))
            }
            StepTruth::Object { ids } => {
                let Some(cell) = self.floor.cell_of(&at) else { return false };
                // The robot may stand nearer to furniture than its circle: its own surroundings are judged by its width.
                let reach = self.near_cells(cell);
                ids.iter().filter_map(|id| self.building.object(*id)).any(|object| {
                    self.view_points(object).iter().any(|view| reach.get(view).is_some_and(|way_m| *way_m <= ARRIVAL_M))
                })
            }
        }
    }

    /// Ways from a cell to those nearby, over cells where the robot's width fits.
    fn near_cells(&self, cell: usize) -> std::collections::BTreeMap<usize, f64> {
        let radius_m = self.robot.inscribed_radius_m.min(self.floor.clearance_m(cell));
        let mut reach = std::collections::BTreeMap::from([(cell, 0.0)]);
        let mut queue = std::collections::VecDeque::from([cell]);
        let origin = self.floor.center_of(cell);
        while let Some(here) = queue.pop_front() {
            let from = self.floor.center_of(here);
            let way_m = reach[&here];
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let step = nalgebra::Vector2::new(f64::from(dx), f64::from(dy)) * omni_sim::floor::CELL_M;
                    let Some(next) = self.floor.cell_of(&(from + step)) else { continue };
                    let next_way_m = way_m + step.norm();
                    let is_shorter = reach.get(&next).is_none_or(|known_m| next_way_m + 1e-9 < *known_m);
                    if is_shorter
                        && next_way_m <= ARRIVAL_M
                        && (self.floor.center_of(next) - origin).norm() <= ARRIVAL_M
                        && self.floor.clearance_m(next) >= radius_m
                    {
                        reach.insert(next, next_way_m);
                        queue.push_back(next);
                    }
                }
            }
        }
        reach
    }

    /// Length of the shortest way that does all steps in order, from `start`; `None` if there is none. For several steps,
    /// the sum of greedy legs: from the nearest place of each step to the nearest of the next.
    pub fn shortest_m(&self, steps: &[StepTruth], start: &Point2<f64>) -> Option<f64> {
        let mut from = vec![self.nearest_free(start)?];
        let mut total_m = 0.0;
        for step in steps {
            let distances_m = self.floor.distances_from(&from, self.robot.radius_m);
            let goals = self.goals_of(step);
            let (best_m, best) = goals
                .into_iter()
                .map(|cell| (distances_m[cell], cell))
                .filter(|(distance_m, _)| distance_m.is_finite())
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
            total_m += best_m;
            from = vec![best];
        }
        Some(total_m)
    }

    /// Cells at which a step is done.
    fn goals_of(&self, step: &StepTruth) -> Vec<usize> {
        match step {
            StepTruth::Object { ids } => ids
                .iter()
                .filter_map(|id| self.building.object(*id))
                .flat_map(|object| self.view_points(object))
                .collect(),
            StepTruth::Start => self.start.and_then(|start| self.nearest_free(&start)).into_iter().collect(),
            StepTruth::Room { ids } => (0..self.floor.len())
                .filter(|cell| {
                    let at = self.floor.center_of(*cell);
                    self.floor.clearance_m(*cell) >= self.robot.radius_m
                        && ids.iter().any(|id| self.building.rooms[*id as usize].contains(&at))
                })
                .collect(),
        }
    }

    /// The cell at `point`, or the nearest one where the robot's circle fits.
    pub fn nearest_free(&self, point: &Point2<f64>) -> Option<usize> {
        let cell = self.floor.cell_of(point)?;
        if self.floor.clearance_m(cell) >= self.robot.radius_m {
            return Some(cell);
        }
        (0..self.floor.len()).filter(|cell| self.floor.clearance_m(*cell) >= self.robot.radius_m).min_by(|a, b| {
            let distance_m = |cell: &usize| (self.floor.center_of(*cell) - point).norm();
            distance_m(a).total_cmp(&distance_m(b)).then(a.cmp(b))
        })
    }
}
