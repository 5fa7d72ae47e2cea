//! A way through all rooms of a building, and a pilot that knows the truth and drives along it.
//!
//! For experiments in which the sensors are judged and not the robot's decisions: the same way for every arm.

use anyhow::{Result, ensure};
use mission::stream::Command;
use nalgebra::{Isometry3, Point2};
use omni_sim::building::Building;

use crate::floor::TrueFloor;

/// A way on the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct Tour {
    /// Corners, one cell apart.
    pub points: Vec<Point2<f64>>,
}

impl Tour {
    /// From `start` through the widest place of every room of the lowest storey that a circle of `radius_m` can reach, each
    /// time to the nearest room not yet seen.
    ///
    /// # Errors
    /// If the start is not free.
    pub fn through_rooms(building: &Building, floor: &TrueFloor, start: &Point2<f64>, radius_m: f64) -> Result<Tour> {
        // A hand's breadth for the pilot, who cuts corners a little; where a door leaves less, none.
        const ROOM_M: f64 = 0.12;
        let Some(mut at) = floor.cell_of(start) else { anyhow::bail!("the tour's start is outside the building") };
        ensure!(floor.clearance_m(at) >= radius_m, "the robot does not fit at the tour's start");
        let mut goals: Vec<usize> = building
            .rooms
            .iter()
            .filter(|room| (room.floor_z_m - floor.floor_z_m).abs() < 0.1)
            .filter_map(|room| {
                let inside = |cell: &usize| room.rects.iter().any(|rect| rect.contains(&floor.center_of(*cell)));
                (0..floor.len())
                    .filter(inside)
                    .max_by(|a, b| floor.clearance_m(*a).total_cmp(&floor.clearance_m(*b)).then(b.cmp(a)))
            })
            .collect();
        let mut points = vec![*start];
        while !goals.is_empty() {
            let mut left_m = floor.distances_from(&[at], radius_m + ROOM_M);
            if goals.iter().all(|goal| left_m[*goal].is_infinite()) {
                left_m = floor.distances_from(&[at], radius_m);
            }
            let nearest = (0..goals.len())
                .min_by(|a, b| left_m[goals[*a]].total_cmp(&left_m[goals[*b]]))
                .expect("there is a goal");
            let goal = goals.swap_remove(nearest);
            if left_m[goal].is_finite() {
                points.extend(way_back(floor, &left_m, goal).into_iter().rev());
                at = goal;
            }
        }
        Ok(Tour { points })
    }

    /// Its length.
    pub fn length_m(&self) -> f64 {
        self.points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
    }
}

/// From a cell down the distances to where they are zero.
fn way_back(floor: &TrueFloor, distance_m: &[f64], from: usize) -> Vec<Point2<f64>> {
    let mut cell = from;
    let mut way = vec![floor.center_of(cell)];
    while distance_m[cell] > 0.0 {
        // Sixteen directions fill the distances; the steepest of them leads back.
        let slope = |next: &usize| {
            (distance_m[cell] - distance_m[*next]) / (floor.center_of(cell) - floor.center_of(*next)).norm()
        };
        let Some(next) = floor
            .neighbours_of(cell)
            .filter(|next| distance_m[*next] < distance_m[cell])
            .max_by(|a, b| slope(a).total_cmp(&slope(b)).then(b.cmp(a)))
        else {
            break;
        };
        cell = next;
        way.push(floor.center_of(cell));
    }
    way
}

/// Drives a ground robot along a tour by what is true.
#[derive(Debug, Clone)]
pub struct Pilot {
    points: Vec<Point2<f64>>,
    next: usize,
    speed_mps: f64,
    max_yaw_rate_radps: f64,
}

impl Pilot {
    /// Along `tour` at a speed.
    pub fn new(tour: &Tour, speed_mps: f64, max_yaw_rate_radps: f64) -> Pilot {
        Pilot { points: tour.points.clone(), next: 0, speed_mps, max_yaw_rate_radps }
    }

    /// Whether the end is reached.
    pub fn is_done(&self) -> bool {
        self.next >= self.points.len()
    }

    /// Toward the point a little ahead: turned first, then forward.
    pub fn command(&mut self, truth: &Isometry3<f64>) -> Command {
        const AHEAD_M: f64 = 0.25;
        let at = Point2::from(truth.translation.vector.xy());
        while self.points.get(self.next).is_some_and(|point| (point - at).norm() < AHEAD_M) {
            self.next += 1;
        }
        let Some(point) = self.points.get(self.next) else {
            return Command::Velocity { forward_mps: 0.0, left_mps: 0.0, yaw_rate_radps: 0.0 };
        };
        let way = point - at;
        let error_rad = mission::goal::wrap(way.y.atan2(way.x) - truth.rotation.euler_angles().2);
        let yaw_rate_radps = (2.5 * error_rad).clamp(-self.max_yaw_rate_radps, self.max_yaw_rate_radps);
        let forward_mps = self.speed_mps * error_rad.cos().max(0.0).powi(4);
        Command::Velocity { forward_mps, left_mps: 0.0, yaw_rate_radps }
    }
}
