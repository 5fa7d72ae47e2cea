//! On the ground: from a goal to velocities. The route follows the map, the local policy follows what the last scans show.

use nalgebra::{Isometry3, Point2, Vector3};
use planner::{GroundMover, LocalPolicy, LocalPolicyConfig, LocalPolicyError, LocalStatus};
use robot_model::RobotModel;

use crate::goal::{Goal, GoalStatus, wrap};
use crate::navigation::NavigationMap;
use crate::stream::Command;
use crate::zones::Zones;

/// Standing blocked so long is one failed attempt.
const PATIENCE_S: f64 = 4.0;
/// Whoever is this near may be what it waits for.
const WAITED_FOR_M: f64 = 2.0;
/// A heading this near is met.
const TURNED_RAD: f64 = 0.12;

/// Drives a ground robot to one goal after another.
pub struct Drive {
    policy: LocalPolicy,
    goal: Goal,
    path: Vec<Point2<f64>>,
    status: GoalStatus,
    attempts: u32,
    blocked_s: f64,
    clearance_m: f64,
    config: DriveConfig,
}

/// Patience and period of a [`Drive`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveConfig {
    /// Time between commands.
    pub period_s: f64,
    /// Failed attempts after which a goal is unreachable.
    pub max_attempts: u32,
}

impl Drive {
    /// Limits, footprint and margins of this robot.
    pub fn new(robot: &RobotModel, config: DriveConfig) -> Result<Self, LocalPolicyError> {
        let limits = &robot.limits;
        let policy = LocalPolicy::new(LocalPolicyConfig {
            max_speed_mps: limits.max_speed_mps,
            max_reverse_speed_mps: limits.max_reverse_speed_mps,
            max_lateral_speed_mps: limits.max_lateral_speed_mps,
            max_yaw_rate_radps: limits.max_yaw_rate_radps,
            max_accel_mps2: limits.max_accel_mps2,
            max_yaw_accel_radps2: limits.max_yaw_accel_radps2,
            footprint: robot.footprint.clone(),
            period_s: config.period_s,
            ..LocalPolicyConfig::default()
        })?;
        Ok(Self {
            policy,
            goal: Goal::Stay,
            path: Vec::new(),
            status: GoalStatus::Arrived,
            attempts: 0,
            blocked_s: 0.0,
            clearance_m: f64::INFINITY,
            config,
        })
    }

    /// Is slow from now on where the zones say so.
    pub fn limit_speed(&mut self, zones: &Zones) {
        self.policy.limit_speed(zones.speed_zones());
    }

    /// Takes a new goal; the old one is forgotten.
    pub fn set_goal(&mut self, goal: Goal) {
        self.path.clear();
        self.attempts = 0;
        self.blocked_s = 0.0;
        self.status = if goal == Goal::Stay { GoalStatus::Arrived } else { GoalStatus::Underway };
        self.goal = goal;
    }

    /// How it goes with the present goal.
    pub fn status(&self) -> &GoalStatus {
        &self.status
    }

    /// The way still to go.
    pub fn path(&self) -> &[Point2<f64>] {
        &self.path
    }

    /// Distance from the outline to the nearest obstacle at the last command.
    pub fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    /// Near enough to be content when the last step is barred.
    fn is_about_there(&self, here: &Point2<f64>) -> bool {
        matches!(self.goal, Goal::Reach { target, tolerance_m, .. } if (target - here).norm() <= 2.0 * tolerance_m.min(0.25))
    }

    /// Finds the way anew on a fresh map.
    pub fn replan(&mut self, navigation: &NavigationMap, world_from_body: &Isometry3<f64>) {
        let Goal::Reach { target, tolerance_m, .. } = self.goal else { return };
        if self.status != GoalStatus::Underway {
            return;
        }
        let here = Point2::from(world_from_body.translation.vector.xy());
        match navigation.route_toward(&here, &target, tolerance_m) {
            Some(points) => {
                self.attempts = 0;
                self.path = points;
            }
            None => {
                self.attempts += 1;
                if self.attempts >= self.config.max_attempts {
                    self.path.clear();
                    self.status = GoalStatus::Failed(navigation.obstacle_at(&target).reason());
                }
            }
        }
    }

    /// The velocity for the next period. `velocity` is (forward, left, yaw rate) as measured.
    pub fn command(
        &mut self,
        world_from_body: &Isometry3<f64>,
        velocity: Vector3<f64>,
        obstacles: &[Point2<f32>],
        movers: &[GroundMover],
    ) -> Command {
        let at = world_from_body.translation.vector;
        let (_, _, yaw_rad) = world_from_body.rotation.euler_angles();
        let here = Point2::new(at.x, at.y);
        let (path, heading) = match (&self.goal, &self.status) {
            (Goal::Reach { heading_rad, target, tolerance_m }, GoalStatus::Underway) => {
                let end = self.path.last().copied();
                let is_there = (target - here).norm() <= *tolerance_m
                    && end.is_some_and(|end| (end - here).norm() <= tolerance_m.min(0.25));
                if is_there && heading_rad.is_none() {
                    self.status = GoalStatus::Arrived;
                }
                (self.path.clone(), *heading_rad)
            }
            (Goal::Turn { heading_rad }, GoalStatus::Underway) => {
                if wrap(heading_rad - yaw_rad).abs() < TURNED_RAD {
                    self.status = GoalStatus::Arrived;
                }
                (Vec::new(), Some(*heading_rad))
            }
            _ => (Vec::new(), None),
        };
        let (pose, velocity) = ((at.x, at.y, yaw_rad), (velocity.x, velocity.y, velocity.z));
        let local = self.policy.command(pose, velocity, &path, heading, obstacles, movers);
        self.clearance_m = local.clearance_m;
        if self.status == GoalStatus::Underway {
            match local.status {
                LocalStatus::Arrived if !path.is_empty() => {
                    let is_near = match &self.goal {
                        Goal::Reach { target, tolerance_m, .. } => (target - here).norm() <= *tolerance_m,
                        _ => true,
                    };
                    self.status =
                        if is_near { GoalStatus::Arrived } else { GoalStatus::Failed("the way ends before the goal") };
                }
                // As near as what stands there lets it.
                LocalStatus::Blocked if self.is_about_there(&here) => self.status = GoalStatus::Arrived,
                // Somebody near is waited for: they go on.
                LocalStatus::Blocked if movers.iter().any(|mover| (mover.position - here).norm() < WAITED_FOR_M) => {}
                LocalStatus::Blocked => {
                    self.blocked_s += self.config.period_s;
                    if self.blocked_s > PATIENCE_S {
                        self.blocked_s = 0.0;
                        self.attempts += 1;
                        if self.attempts >= self.config.max_attempts {
                            self.status = GoalStatus::Failed("the way is blocked by something the map did not show");
                        }
                    }
                }
                _ => self.blocked_s = 0.0,
            }
        }
        Command::Velocity { forward_mps: local.vx, left_mps: local.vy, yaw_rate_radps: local.yaw_rate }
    }
}
