//! The local policy: a path and the last scans to a velocity command, fifty times a second.
//!
//! Every cycle tries a fixed set of arcs (a lattice of speeds and turn rates round pure pursuit), rolls each out with
//! limited acceleration, scores progress, deviation and nearness, and takes the best one *from which the robot can
//! still brake to rest without touching an obstacle point*. If no arc passes it brakes; the brake was checked in the
//! cycle before. So a standing world is never touched, at any speed. No randomness, no clock.

use nalgebra::{Point2, Vector2};

use super::footprint::Footprint;
use super::motion::{Free, Ramp, Twist, can_stop};
use super::obstacles::{ObstacleField, Pose};
use super::path::Path;
use super::policy_config::{LocalPolicyConfig, LocalPolicyError};
use super::traffic::{GroundMover, Traffic};
use crate::zone::SpeedZone;

/// What the policy is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LocalStatus {
    /// Following the path.
    Driving,
    /// Turning on the spot toward the path or to the final heading.
    Turning,
    /// At the end of the path.
    Arrived,
    /// Not moving although it should: the path is obstructed, or the input was not finite.
    Blocked,
    /// Backing off or turning away after being blocked.
    Recovering,
}

/// A velocity command in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalCommand {
    /// Forward.
    pub vx: f64,
    /// To the left.
    pub vy: f64,
    /// Counter-clockwise.
    pub yaw_rate: f64,
    /// What the policy is doing.
    pub status: LocalStatus,
    /// Distance between the footprint and the nearest obstacle point (negative: inside), at most the slow-down clearance or 0.5 m.
    pub clearance_m: f64,
    /// How often it has been blocked since it last arrived or drove half a metre.
    pub blocked_count: u32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Follow,
    Turn { direction: f64 },
    Hold { left_s: f64 },
    Recover { left_s: f64 },
}

/// The policy with its memory: last command, mode, and how long it has not moved.
#[derive(Debug, Clone)]
pub struct LocalPolicy {
    pub(super) config: LocalPolicyConfig,
    pub(super) footprint: Footprint,
    pub(super) field: ObstacleField,
    pub(super) traffic: Traffic,
    slow: Vec<SpeedZone>,
    pub(super) ramp: Ramp,
    mode: Mode,
    pub(super) last: Twist,
    anchor: Option<Pose>,
    idle_s: f64,
    blocked_count: u32,
}

/// Turning on the spot starts above the first and ends below the second heading error.
const TURN_ABOVE_RAD: f64 = 1.0;
const TURN_BELOW_RAD: f64 = 0.35;
/// Below this distance the end of the path is approached in any direction, without turning first.
const APPROACH_M: f64 = 0.45;
const HOLD_S: f64 = 0.6;
const RECOVER_S: f64 = 2.0;

impl LocalPolicy {
    /// A policy at rest.
    ///
    /// # Errors
    /// [`LocalPolicyError`] if the configuration does not hold.
    pub fn new(config: LocalPolicyConfig) -> Result<LocalPolicy, LocalPolicyError> {
        config.validate()?;
        let footprint = Footprint::new(&config.footprint).ok_or(LocalPolicyError::BadFootprint)?;
        let ramp = Ramp { accel_mps2: config.max_accel_mps2, yaw_accel_radps2: config.max_yaw_accel_radps2 };
        Ok(LocalPolicy {
            config,
            footprint,
            field: ObstacleField::default(),
            traffic: Traffic::default(),
            slow: Vec::new(),
            ramp,
            mode: Mode::Follow,
            last: Twist::default(),
            anchor: None,
            idle_s: 0.0,
            blocked_count: 0,
        })
    }

    /// From now on the robot is only so fast where any part of its circle is in one of these zones (in the world), and brakes before.
    pub fn limit_speed(&mut self, zones: Vec<SpeedZone>) {
        self.slow = zones;
    }

    /// The largest speed from which the robot can slow down in time for every zone.
    pub(super) fn speed_limit_mps(&self, pose: &Pose) -> f64 {
        let (c, at) = (&self.config, Point2::new(pose.x, pose.y));
        let radius_m = self.footprint.circumscribed_radius_m + c.margin_m;
        // A little less than all of the brake, so that the robot slows down instead of being refused its speed at every step.
        let brake_mps2 = 0.8 * c.max_accel_mps2;
        let limits = self.slow.iter().map(|slow| slow.speed_at(&at, radius_m, brake_mps2, c.max_speed_mps));
        limits.fold(c.max_speed_mps, f64::min)
    }

    /// One cycle. `pose` is (x, y, yaw) in the world, `velocity` is (vx, vy, yaw rate) in the body frame as measured,
    /// `path` is in the world and ends at the goal; an empty path means stay. Obstacle points that are not finite are
    /// skipped; a pose or path that is not finite brakes with [`LocalStatus::Blocked`]. `movers` are where they are now.
    pub fn command(
        &mut self,
        pose: (f64, f64, f64),
        velocity: (f64, f64, f64),
        path: &[Point2<f64>],
        final_heading: Option<f64>,
        obstacles_in_world: &[Point2<f32>],
        movers: &[GroundMover],
    ) -> LocalCommand {
        let numbers = [pose.0, pose.1, pose.2, velocity.0, velocity.1, velocity.2, final_heading.unwrap_or(0.0)];
        if numbers.iter().any(|v| !v.is_finite()) {
            return self.brake_blindly();
        }
        let pose = Pose { x: pose.0, y: pose.1, yaw: pose.2 };
        let now = self.velocity_now(&Twist { vx: velocity.0, vy: velocity.1, w: velocity.2 });
        let clearance_m = self.look(&pose, &now, obstacles_in_world, movers);
        let (target, status) = if path.is_empty() {
            (self.align(&pose, &now, final_heading), LocalStatus::Arrived)
        } else if let Some(path) = Path::new(path) {
            self.choose(&pose, &now, &path, final_heading, clearance_m)
        } else {
            return self.brake_blindly();
        };
        self.last = target;
        LocalCommand {
            vx: target.vx,
            vy: target.vy,
            yaw_rate: target.w,
            status,
            clearance_m,
            blocked_count: self.blocked_count,
        }
    }

    /// The velocity the base is about to have: the last command where the measurement lags behind it, else the measurement.
    fn velocity_now(&self, measured: &Twist) -> Twist {
        let lag = Ramp { accel_mps2: self.ramp.accel_mps2 * 0.25, yaw_accel_radps2: self.ramp.yaw_accel_radps2 * 0.25 };
        lag.toward(measured, &self.last, 1.0)
    }

    fn look(&mut self, pose: &Pose, now: &Twist, points: &[Point2<f32>], movers: &[GroundMover]) -> f64 {
        let c = &self.config;
        let speed = c.max_speed_mps.max(now.vx.hypot(now.vy));
        let stop_m = 0.5 * speed * speed / c.max_accel_mps2 + speed * c.period_s;
        let reach_m = stop_m.max(speed * c.horizon_s) + self.footprint.circumscribed_radius_m + c.slow_clearance_m;
        self.field.update(points, &Point2::new(pose.x, pose.y), reach_m.min(8.0), 0.3);
        self.traffic.watch(movers, &self.footprint, pose, c.margin_m, reach_m, c.horizon_s, c.period_s);
        self.field.set_required(&self.footprint, pose, c.margin_m, c.slow_clearance_m.max(0.5))
    }

    fn choose(
        &mut self,
        pose: &Pose,
        now: &Twist,
        path: &Path,
        final_heading: Option<f64>,
        clearance_m: f64,
    ) -> (Twist, LocalStatus) {
        let p = Point2::new(pose.x, pose.y);
        let to_end = path.end() - p;
        let (s, _) = path.project(&p);
        let remaining = (path.length() - s).max(to_end.norm());
        if to_end.norm() <= self.config.goal_tolerance_m && path.length() - s <= 2.0 * self.config.goal_tolerance_m {
            self.rest();
            let error = final_heading.map_or(0.0, |h| wrap(h - pose.yaw));
            let status = if error.abs() <= self.config.heading_tolerance_rad {
                LocalStatus::Arrived
            } else {
                LocalStatus::Turning
            };
            return (self.align(pose, now, final_heading), status);
        }
        self.watch(pose);
        if let Some(held) = self.blocked(pose, now) {
            return held;
        }
        if remaining < APPROACH_M && self.config.max_lateral_speed_mps > 0.0 {
            let wanted = self.approach(pose, &to_end, final_heading);
            return (self.first_safe(pose, now, &[wanted, Twist { w: 0.0, ..wanted }]), LocalStatus::Driving);
        }
        // In the narrow the corner is not to be cut.
        let ahead = self.config.lookahead_m * (clearance_m / self.config.slow_clearance_m).clamp(0.5, 1.0);
        let carrot = path.toward(&p, s, ahead);
        let error = wrap(carrot.y.atan2(carrot.x) - pose.yaw);
        self.decide_to_turn(error);
        if let Mode::Turn { direction } = self.mode {
            return (self.turn(pose, now, error, direction), LocalStatus::Turning);
        }
        (self.follow(pose, now, path, s, error, remaining, clearance_m), LocalStatus::Driving)
    }

    /// Keeps track of how long the robot has not got anywhere. Turning on the spot counts a third.
    fn watch(&mut self, pose: &Pose) {
        let travelled = |a: &Pose| (pose.x - a.x).hypot(pose.y - a.y);
        match self.anchor {
            Some(anchor) if travelled(&anchor) < 0.12 => {
                let weight = if matches!(self.mode, Mode::Turn { .. }) { 0.33 } else { 1.0 };
                if matches!(self.mode, Mode::Follow | Mode::Turn { .. }) {
                    self.idle_s += weight * self.config.period_s;
                }
            }
            _ => {
                self.anchor = Some(*pose);
                self.idle_s = 0.0;
            }
        }
        if self.idle_s >= self.config.stuck_after_s {
            self.idle_s = 0.0;
            self.blocked_count += 1;
            self.mode = Mode::Hold { left_s: HOLD_S };
        }
    }

    fn rest(&mut self) {
        self.mode = Mode::Follow;
        self.anchor = None;
        self.idle_s = 0.0;
        self.blocked_count = 0;
    }

    /// Holding and recovering, when in one of these modes.
    fn blocked(&mut self, pose: &Pose, now: &Twist) -> Option<(Twist, LocalStatus)> {
        let dt = self.config.period_s;
        match self.mode {
            Mode::Hold { left_s } => {
                self.mode =
                    if left_s > dt { Mode::Hold { left_s: left_s - dt } } else { Mode::Recover { left_s: RECOVER_S } };
                Some((self.first_safe(pose, now, &[]), LocalStatus::Blocked))
            }
            Mode::Recover { left_s } => {
                self.mode = if left_s > dt { Mode::Recover { left_s: left_s - dt } } else { Mode::Follow };
                let target = self.recovery(pose, now);
                Some((target, LocalStatus::Recovering))
            }
            _ => None,
        }
    }

    /// Ways out in a fixed order that starts elsewhere after every failure: back, turn left, turn right, sideways.
    fn recovery(&self, pose: &Pose, now: &Twist) -> Twist {
        let c = &self.config;
        let (back, side, w) =
            (c.max_reverse_speed_mps.min(0.2), c.max_lateral_speed_mps.min(0.15), 0.6 * c.max_yaw_rate_radps);
        let ways = [
            Twist { vx: -back, ..Twist::default() },
            Twist { w, ..Twist::default() },
            Twist { vy: side, ..Twist::default() },
            Twist { vx: -back, w: 0.5 * w, ..Twist::default() },
            Twist { w: -w, ..Twist::default() },
            Twist { vy: -side, ..Twist::default() },
            Twist { vx: -back, w: -0.5 * w, ..Twist::default() },
        ];
        let shift = (self.blocked_count as usize).saturating_sub(1) * 2;
        let ordered: Vec<Twist> = (0..ways.len()).map(|k| ways[(k + shift) % ways.len()]).collect();
        // Prefer a way that stays free for a second; it is then kept by the same rule in the next cycle.
        let lasting = ordered.iter().find(|way| self.roll_out(pose, now, way, 1.0, None).hit_s.is_none()).copied();
        let list: Vec<Twist> = lasting.into_iter().chain(ordered).collect();
        self.first_safe(pose, now, &list)
    }

    fn decide_to_turn(&mut self, error: f64) {
        self.mode = match self.mode {
            Mode::Turn { .. } if error.abs() < TURN_BELOW_RAD => Mode::Follow,
            // Keep the direction while the error is about half a turn, where its sign means nothing.
            Mode::Turn { direction } if error.abs() > 2.6 => Mode::Turn { direction },
            Mode::Turn { .. } => Mode::Turn { direction: error.signum() },
            _ if error.abs() > TURN_ABOVE_RAD => Mode::Turn { direction: error.signum() },
            other => other,
        };
    }

    /// Turns on the spot; where the body has no room for it, tries the other way round and small shifts.
    fn turn(&self, pose: &Pose, now: &Twist, error: f64, direction: f64) -> Twist {
        let c = &self.config;
        let rate = (2.0 * error.abs())
            .min((2.0 * 0.7 * c.max_yaw_accel_radps2 * error.abs()).sqrt())
            .min(c.max_yaw_rate_radps);
        let w = direction * rate.max(0.15_f64.min(c.max_yaw_rate_radps));
        let (vx, vy) = (0.3 * c.max_reverse_speed_mps, 0.5 * c.max_lateral_speed_mps);
        let ways = [
            Twist { w, ..Twist::default() },
            Twist { vy, w, ..Twist::default() },
            Twist { vy: -vy, w, ..Twist::default() },
            Twist { vx, w, ..Twist::default() },
            Twist { vx: -vx, w, ..Twist::default() },
        ];
        let lasting = ways.iter().find(|way| self.roll_out(pose, now, way, 0.6, None).hit_s.is_none()).copied();
        let list: Vec<Twist> = lasting.into_iter().chain([Twist { w: -w, ..Twist::default() }]).collect();
        self.first_safe(pose, now, &list)
    }

    /// Straight at a near goal, in the body frame, so slowly that it can stop there.
    fn approach(&self, pose: &Pose, to_end: &Vector2<f64>, final_heading: Option<f64>) -> Twist {
        let c = &self.config;
        let (sin, cos) = pose.yaw.sin_cos();
        let distance = to_end.norm();
        let limit = self.speed_limit_mps(pose);
        let speed = (0.7 * 2.0 * c.max_accel_mps2 * distance).sqrt().min(limit).min(1.5 * distance);
        let direction = to_end / distance.max(1e-9);
        let (fx, fy) = (cos * direction.x + sin * direction.y, cos * direction.y - sin * direction.x);
        let limit_x = if fx >= 0.0 { c.max_speed_mps } else { c.max_reverse_speed_mps };
        // One common factor keeps the direction.
        let share = (limit_x / (speed * fx).abs().max(1e-9))
            .min(c.max_lateral_speed_mps / (speed * fy).abs().max(1e-9))
            .min(1.0);
        let error = final_heading.map_or(0.0, |h| wrap(h - pose.yaw));
        let w = (1.5 * error).clamp(-c.max_yaw_rate_radps, c.max_yaw_rate_radps);
        Twist { vx: speed * fx * share, vy: speed * fy * share, w }
    }

    /// Stands and turns to the final heading.
    fn align(&self, pose: &Pose, now: &Twist, final_heading: Option<f64>) -> Twist {
        let c = &self.config;
        let error = final_heading.map_or(0.0, |h| wrap(h - pose.yaw));
        if error.abs() <= 0.5 * c.heading_tolerance_rad {
            return self.first_safe(pose, now, &[]);
        }
        let rate =
            (1.5 * error.abs()).min((1.4 * c.max_yaw_accel_radps2 * error.abs()).sqrt()).min(c.max_yaw_rate_radps);
        let way = Twist { w: rate * error.signum(), ..Twist::default() };
        self.first_safe(pose, now, &[way, Twist { w: -way.w, ..way }])
    }

    /// The first of the wanted velocities whose first step can be followed by a stop; else the brake itself.
    pub(super) fn first_safe(&self, pose: &Pose, now: &Twist, wanted: &[Twist]) -> Twist {
        let c = &self.config;
        for target in wanted {
            let first = self.ramp.toward(now, target, c.period_s);
            let (field, traffic, footprint) = (&self.field, &self.traffic, &self.footprint);
            let free = Free { field, traffic, footprint, margin_m: c.margin_m, slow: &self.slow };
            if can_stop(&free, &self.ramp, c.period_s, pose, &first) {
                return first;
            }
        }
        self.ramp.toward(now, &Twist::default(), c.period_s)
    }

    fn brake_blindly(&mut self) -> LocalCommand {
        self.last = self.ramp.toward(&self.last, &Twist::default(), self.config.period_s);
        let Twist { vx, vy, w } = self.last;
        LocalCommand {
            vx,
            vy,
            yaw_rate: w,
            status: LocalStatus::Blocked,
            clearance_m: 0.0,
            blocked_count: self.blocked_count,
        }
    }
}

/// An angle in (-pi, pi].
pub(super) fn wrap(angle: f64) -> f64 {
    let turned = angle.rem_euclid(std::f64::consts::TAU);
    if turned > std::f64::consts::PI { turned - std::f64::consts::TAU } else { turned }
}
