//! Follows a way with the true pose: a walking robot steers toward a point ahead, a flying one gets smooth set-points.

use mission::robot_model::{RobotKind, RobotModel};
use mission::stream::{Command, FlightSetPoint};
use nalgebra::{Isometry3, Point2, Point3, Vector2, Vector3};

use crate::tour::Tour;

/// How the way is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PilotConfig {
    /// Stands still for so long before anything moves, so that a filter can find gravity and its biases. Default 2 s.
    pub rest_s: f64,
    /// Speed on the way, default 0.7 m/s: that of somebody who carries a camera through a flat.
    pub speed_mps: f64,
    /// Height of flight above the floor, default 1.2 m.
    pub flight_height_m: f64,
    /// Stands still for so long at the end. Default 1 s.
    pub end_rest_s: f64,
}

impl Default for PilotConfig {
    fn default() -> Self {
        PilotConfig { rest_s: 2.0, speed_mps: 0.7, flight_height_m: 1.2, end_rest_s: 1.0 }
    }
}

/// The point ahead toward which a walking robot steers.
const LOOKAHEAD_M: f64 = 0.35;
/// Turning rate for a heading error.
const STEER_PER_S: f64 = 2.5;
/// Largest turning rate.
const TURN_RADPS: f64 = 1.2;
/// Braking toward the end of the way.
const BRAKE_MPS2: f64 = 0.4;
/// Where there is less room than this beside it, a flying robot goes more slowly in proportion, for its set-points lag behind
/// the way and cut its corners ...
const NARROW_M: f64 = 0.25;
/// ... but not below this part of its speed.
const SLOWEST_PART: f64 = 0.3;
/// How far ahead it looks for narrow places.
const FORESIGHT_M: f64 = 0.6;
/// Vertical speed of take-off.
const CLIMB_MPS: f64 = 0.5;
/// Pace of the filter that makes set-points smooth: position error, velocity and acceleration die out with it.
const SMOOTH_RADPS: f64 = 7.0;

/// Follows one way, asked once per control period.
#[derive(Debug, Clone)]
pub struct Pilot {
    config: PilotConfig,
    kind: RobotKind,
    way: Vec<Point2<f64>>,
    room_m: Vec<f64>,
    /// Length of the way up to each of its points.
    along_m: Vec<f64>,
    progress_m: f64,
    floor_z_m: f64,
    ended_s: Option<f64>,
    flight: Flight,
}

/// The smooth set-point: position, heading and their derivatives.
#[derive(Debug, Clone, Copy)]
struct Flight {
    position: [Vector3<f64>; 3],
    jerk: Vector3<f64>,
    yaw_rad: f64,
    yaw_rate_radps: f64,
}

impl Pilot {
    /// A pilot for a tour (of at least one point) with a robot that stands at `start`.
    pub fn new(config: PilotConfig, robot: &RobotModel, tour: &Tour, start: &Isometry3<f64>, floor_z_m: f64) -> Pilot {
        let (way, room_m) = (tour.way.clone(), tour.room_m.clone());
        let mut along_m = vec![0.0];
        for pair in way.windows(2) {
            along_m.push(along_m[along_m.len() - 1] + (pair[1] - pair[0]).norm());
        }
        let flight = Flight {
            position: [start.translation.vector, Vector3::zeros(), Vector3::zeros()],
            jerk: Vector3::zeros(),
            yaw_rad: start.rotation.euler_angles().2,
            yaw_rate_radps: 0.0,
        };
        let speed_mps = config.speed_mps.min(robot.limits.max_speed_mps);
        let config = PilotConfig { speed_mps, ..config };
        Pilot { config, kind: robot.kind, way, room_m, along_m, progress_m: 0.0, floor_z_m, ended_s: None, flight }
    }

    /// Length of the way.
    pub fn length_m(&self) -> f64 {
        self.along_m[self.along_m.len() - 1]
    }

    /// How much of it lies behind the robot.
    pub fn progress_m(&self) -> f64 {
        self.progress_m
    }

    /// Whether the way is done and the robot has stood still at its end.
    pub fn is_over(&self, now_s: f64) -> bool {
        self.ended_s.is_some_and(|ended_s| now_s >= ended_s + self.config.end_rest_s)
    }

    /// What to do for the next `step_s`.
    pub fn command(&mut self, now_s: f64, step_s: f64, world_from_body: &Isometry3<f64>) -> Command {
        match self.kind {
            RobotKind::Ground => self.walk(now_s, world_from_body),
            RobotKind::Aerial => self.fly(now_s, step_s),
        }
    }

    /// Speed of flight for the narrowest place of the way just ahead.
    fn flight_speed_mps(&self) -> f64 {
        let at = |along_m: f64| self.along_m.partition_point(|at_m| *at_m < along_m).min(self.room_m.len());
        let ahead = &self.room_m[at(self.progress_m)..at(self.progress_m + FORESIGHT_M)];
        let room_m = ahead.iter().copied().fold(f64::INFINITY, f64::min);
        self.config.speed_mps * (room_m / NARROW_M).clamp(SLOWEST_PART, 1.0)
    }

    fn point_at(&self, along_m: f64) -> Point2<f64> {
        let after = self.along_m.partition_point(|at_m| *at_m < along_m).min(self.way.len() - 1);
        let before = after.saturating_sub(1);
        let length_m = self.along_m[after] - self.along_m[before];
        let share = if length_m > 0.0 { ((along_m - self.along_m[before]) / length_m).clamp(0.0, 1.0) } else { 1.0 };
        self.way[before] + (self.way[after] - self.way[before]) * share
    }

    fn walk(&mut self, now_s: f64, world_from_body: &Isometry3<f64>) -> Command {
        let stand = Command::Velocity { forward_mps: 0.0, left_mps: 0.0, yaw_rate_radps: 0.0 };
        if now_s < self.config.rest_s || self.ended_s.is_some() {
            return stand;
        }
        // The nearest point of the way, looked for only a little ahead: the way may cross itself.
        let at = Point2::from(world_from_body.translation.vector.xy());
        let mut best_m = f64::INFINITY;
        let from_m = self.progress_m;
        let first = self.along_m.partition_point(|at_m| *at_m < from_m);
        for (point, along_m) in self.way[first..].iter().zip(&self.along_m[first..]) {
            if *along_m > from_m + 2.0 * LOOKAHEAD_M {
                break;
            }
            let distance_m = (point - at).norm();
            if distance_m < best_m {
                (best_m, self.progress_m) = (distance_m, *along_m);
            }
        }
        let left_m = self.length_m() - self.progress_m;
        let target = self.point_at(self.progress_m + LOOKAHEAD_M);
        let ahead = target - at;
        if left_m < 0.05 || (left_m < LOOKAHEAD_M && ahead.norm() < 0.1) {
            self.ended_s = Some(now_s);
            return stand;
        }
        let in_body = world_from_body.rotation.inverse() * Vector3::new(ahead.x, ahead.y, 0.0);
        let error_rad = in_body.y.atan2(in_body.x);
        // Turn first, then walk: a sharp corner is taken on the spot.
        let straight = error_rad.cos().max(0.0).powi(4);
        let speed_mps = self.config.speed_mps.min((2.0 * BRAKE_MPS2 * (left_m + 0.05)).sqrt());
        Command::Velocity {
            forward_mps: speed_mps * straight,
            left_mps: 0.0,
            yaw_rate_radps: (STEER_PER_S * error_rad).clamp(-TURN_RADPS, TURN_RADPS),
        }
    }

    /// The target runs along the way; position, velocity and acceleration of the set-point follow it as a filter of third order
    /// with three equal poles, so that they are the derivatives of each other.
    fn fly(&mut self, now_s: f64, step_s: f64) -> Command {
        let is_armed = now_s >= self.config.rest_s;
        let height_m = self.floor_z_m + self.config.flight_height_m;
        let start_m = self.flight.position[0].z;
        if is_armed {
            let climbed_m = start_m + CLIMB_MPS * step_s;
            let has_height = start_m > height_m - 0.1;
            if has_height {
                self.progress_m = (self.progress_m + self.flight_speed_mps() * step_s).min(self.length_m());
            }
            let at = self.point_at(self.progress_m);
            let z_m = if has_height { height_m } else { climbed_m + 3.0 * CLIMB_MPS / SMOOTH_RADPS };
            self.smooth(&Vector3::new(at.x, at.y, z_m.min(height_m)), step_s);
            self.turn(step_s);
            if self.ended_s.is_none() && self.progress_m >= self.length_m() && self.flight.position[1].norm() < 0.02 {
                self.ended_s = Some(now_s);
            }
        }
        let [position, velocity, acceleration] = self.flight.position;
        Command::Flight(FlightSetPoint {
            position_in_world: Point3::from(position),
            velocity_in_world_mps: velocity,
            acceleration_in_world_mps2: acceleration,
            jerk_in_world_mps3: self.flight.jerk,
            yaw_rad: self.flight.yaw_rad,
            yaw_rate_radps: self.flight.yaw_rate_radps,
            is_armed,
        })
    }

    fn smooth(&mut self, target: &Vector3<f64>, step_s: f64) {
        let w = SMOOTH_RADPS;
        let [position, velocity, acceleration] = &mut self.flight.position;
        // (s + w)^3 = s^3 + 3 w s^2 + 3 w^2 s + w^3
        let jerk = (target - *position) * w.powi(3) - *velocity * (3.0 * w * w) - *acceleration * (3.0 * w);
        *position += (*velocity + (*acceleration / 2.0 + jerk * (step_s / 6.0)) * step_s) * step_s;
        *velocity += (*acceleration + jerk * (step_s / 2.0)) * step_s;
        *acceleration += jerk * step_s;
        self.flight.jerk = jerk;
    }

    /// The nose follows the way.
    fn turn(&mut self, step_s: f64) {
        let velocity: Vector2<f64> = self.flight.position[1].xy();
        let wanted_radps = if velocity.norm() > 0.15 {
            let error_rad = velocity.y.atan2(velocity.x) - self.flight.yaw_rad;
            let error_rad = error_rad.sin().atan2(error_rad.cos());
            (STEER_PER_S * error_rad).clamp(-TURN_RADPS, TURN_RADPS)
        } else {
            0.0
        };
        // The rate changes smoothly too.
        let rate_radps = &mut self.flight.yaw_rate_radps;
        *rate_radps += (wanted_radps - *rate_radps) * (step_s * SMOOTH_RADPS).min(1.0);
        self.flight.yaw_rad += *rate_radps * step_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A way with room on all sides.
    fn wide(way: Vec<Point2<f64>>) -> Tour {
        Tour { room_m: vec![1.0; way.len()], way, rooms: Vec::new(), length_m: 0.0 }
    }

    #[test]
    fn set_points_are_derivatives_of_each_other_and_reach_the_end() {
        let robot = RobotModel::builtin_quadrotor();
        let way: Vec<Point2<f64>> = (0..40).map(|k| Point2::new(0.05 * f64::from(k), 0.0)).collect();
        let start = Isometry3::translation(0.0, 0.0, 0.2);
        let mut pilot = Pilot::new(PilotConfig::default(), &robot, &wide(way), &start, 0.0);
        let (mut now_s, mut last): (f64, Option<FlightSetPoint>) = (0.0, None);
        while !pilot.is_over(now_s) {
            let Command::Flight(point) = pilot.command(now_s, 0.02, &start) else { panic!("an aerial robot flies") };
            assert_eq!(point.is_armed, now_s >= 2.0);
            if let Some(last) = last {
                let moved = (point.position_in_world - last.position_in_world) / 0.02;
                let mean = (point.velocity_in_world_mps + last.velocity_in_world_mps) / 2.0;
                assert!((moved - mean).norm() < 0.01, "at {now_s}");
                assert!((point.velocity_in_world_mps - last.velocity_in_world_mps).norm() / 0.02 < 4.0, "at {now_s}");
            }
            last = Some(point);
            now_s += 0.02;
            assert!(now_s < 30.0, "never ends");
        }
        let end = last.unwrap().position_in_world;
        assert!((end - Point3::new(1.95, 0.0, 1.2)).norm() < 0.02, "{end}");
    }

    #[test]
    fn a_point_mass_walks_round_a_corner_and_stops_at_the_end() {
        let robot = RobotModel::builtin_quadruped();
        let mut way: Vec<Point2<f64>> = (0..40).map(|k| Point2::new(0.05 * f64::from(k), 0.0)).collect();
        way.extend((1..40).map(|k| Point2::new(1.95, 0.05 * f64::from(k))));
        let (mut x, mut y, mut yaw_rad, mut now_s) = (0.0_f64, 0.0_f64, 2.0_f64, 0.0);
        let pose = |x: f64, y: f64, yaw_rad: f64| Isometry3::new(Vector3::new(x, y, 0.3), Vector3::z() * yaw_rad);
        let mut pilot = Pilot::new(PilotConfig::default(), &robot, &wide(way.clone()), &pose(x, y, yaw_rad), 0.0);
        let mut worst_m: f64 = 0.0;
        while !pilot.is_over(now_s) {
            let Command::Velocity { forward_mps, yaw_rate_radps, .. } =
                pilot.command(now_s, 0.02, &pose(x, y, yaw_rad))
            else {
                panic!("a ground robot walks")
            };
            x += forward_mps * yaw_rad.cos() * 0.02;
            y += forward_mps * yaw_rad.sin() * 0.02;
            yaw_rad += yaw_rate_radps * 0.02;
            now_s += 0.02;
            assert!(now_s < 40.0, "never ends");
            let off_m = way.iter().map(|point| (point - Point2::new(x, y)).norm()).fold(f64::INFINITY, f64::min);
            worst_m = worst_m.max(off_m);
        }
        assert!((Point2::new(x, y) - way[way.len() - 1]).norm() < 0.12);
        assert!(worst_m < 0.12, "{worst_m}");
    }
}
