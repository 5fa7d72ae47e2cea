//! In the air: from a goal to set-points. Take-off, certified trajectories through known free space, hover, landing.
//!
//! A trajectory is flown only with its certificate, only through space that was seen free, and ends at rest. It is left
//! early only for another certified one or for a brake that is free on the map; when the map shows something inside the
//! robot's ball along the rest of it, for the shortest brake there is.

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use planner::{AirConfig, AirPlan, AirPlanError, FlightState, PolynomialTrajectory, plan_air};
use robot_model::RobotModel;

use crate::flight_limits::flight_limits;
use crate::goal::{Goal, GoalStatus, wrap};
use crate::navigation::NavigationMap;
use crate::stream::{Command, FlightSetPoint};

/// Climb and descent.
const CLIMB_MPS: f64 = 0.5;
/// Fraction of the yaw-rate limit used: a slow turn disturbs the LiDAR least.
const YAW_PART: f64 = 0.5;

/// Slower than this counts as at rest.
const RESTING_MPS: f64 = 0.05;

/// Obstacle points in a box, given by its low and its high corner.
type ObstaclesIn<'a> = dyn Fn(&Point3<f64>, &Point3<f64>) -> Vec<Point3<f64>> + 'a;

/// What the flyer needs to see of the map.
pub struct AirSpace<'a> {
    /// Distance to the nearest obstacle, `None` where nobody has looked.
    pub distance: &'a dyn Fn(&Point3<f64>) -> Option<f64>,
    /// Surface points in a box.
    pub obstacles: &'a ObstaclesIn<'a>,
}

/// Phase of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// On the floor, rotors still.
    Grounded,
    /// Climbing to flight height.
    TakeOff,
    /// Hovering or following a trajectory.
    Flying,
    /// Descending to the floor.
    Landing,
    /// On the floor again.
    Landed,
}

/// Flies an aerial robot to one goal after another.
pub struct Fly {
    config: AirConfig,
    period_s: f64,
    max_attempts: u32,
    max_yaw_rate_radps: f64,
    phase: Phase,
    goal: Goal,
    status: GoalStatus,
    attempts: u32,
    /// A trajectory for the present goal has been found, or the robot was there already.
    has_planned: bool,
    /// What is flown ends half way, to see more of the rest.
    is_half_way: bool,
    /// Trajectory and the time on it.
    flying: Option<(PolynomialTrajectory, f64)>,
    /// The present trajectory is not wanted any more; it is left where a brake is free, at the latest at its end.
    wants_stop: bool,
    /// Down from where it stops.
    wants_landing: bool,
    /// Set-point when nothing is flown.
    hover: Point3<f64>,
    yaw_rad: f64,
    flight_height_m: f64,
    ground_clearance_m: f64,
    path: Vec<Point2<f64>>,
    clearance_m: f64,
}

impl Fly {
    /// Limits and ball of this robot. `flight_z_m` and `landed_z_m` are heights of the body origin in the map.
    pub fn new(robot: &RobotModel, flight_z_m: f64, landed_z_m: f64, period_s: f64, max_attempts: u32) -> Self {
        let config = AirConfig {
            limits: flight_limits(robot),
            radius_m: robot.circumscribed_radius_m,
            preferred_height_m: Some(flight_z_m),
            ..AirConfig::default()
        };
        Self {
            config,
            period_s,
            max_attempts,
            max_yaw_rate_radps: robot.limits.max_yaw_rate_radps,
            phase: Phase::Grounded,
            goal: Goal::Stay,
            status: GoalStatus::Arrived,
            attempts: 0,
            has_planned: false,
            is_half_way: false,
            flying: None,
            wants_stop: false,
            wants_landing: false,
            hover: Point3::new(0.0, 0.0, landed_z_m),
            yaw_rad: 0.0,
            flight_height_m: flight_z_m,
            ground_clearance_m: landed_z_m,
            path: Vec::new(),
            clearance_m: f64::INFINITY,
        }
    }

    /// Present phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Leaves the floor from where the robot stands.
    pub fn take_off(&mut self, world_from_body: &Isometry3<f64>) {
        if self.phase == Phase::Grounded {
            self.hover = Point3::from(world_from_body.translation.vector);
            self.yaw_rad = world_from_body.rotation.euler_angles().2;
            self.phase = Phase::TakeOff;
        }
    }

    /// Stops, and goes down there. It may be asked again at any time.
    pub fn land(&mut self) {
        match self.phase {
            Phase::Flying if !self.wants_landing => {
                self.set_goal(Goal::Stay);
                self.wants_landing = true;
            }
            Phase::Flying => {}
            Phase::TakeOff => self.phase = Phase::Landing,
            Phase::Grounded => self.phase = Phase::Landed,
            Phase::Landing | Phase::Landed => {}
        }
    }

    /// The map's frame became another one while the robot stood or hovered: it goes on standing there.
    pub fn change_frame(&mut self, new_from_old: &Isometry3<f64>, floor_rise_m: f64) {
        self.set_goal(Goal::Stay);
        self.wants_stop = false;
        self.flying = None;
        self.path.clear();
        self.hover = new_from_old * self.hover;
        self.yaw_rad = wrap(self.yaw_rad + new_from_old.rotation.euler_angles().2);
        self.flight_height_m += floor_rise_m;
        self.ground_clearance_m += floor_rise_m;
        self.config.preferred_height_m = Some(self.flight_height_m);
    }

    /// Takes a new goal; the trajectory being flown goes on until the next plan replaces it. No goal is taken any more once
    /// it was told to land.
    pub fn set_goal(&mut self, goal: Goal) {
        if self.wants_landing {
            return;
        }
        self.attempts = 0;
        self.has_planned = false;
        self.is_half_way = false;
        self.status = if goal == Goal::Stay { GoalStatus::Arrived } else { GoalStatus::Underway };
        self.wants_stop = goal == Goal::Stay;
        self.goal = goal;
    }

    /// How it goes with the present goal.
    pub fn status(&self) -> &GoalStatus {
        &self.status
    }

    /// The way still to go, seen from above.
    pub fn path(&self) -> &[Point2<f64>] {
        &self.path
    }

    /// Distance from the robot's ball to the nearest obstacle of the map at the last command.
    pub fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    /// The way to the goal in the plane of flight, or to a point within its tolerance.
    pub fn route(&self, navigation: &NavigationMap, here: &Point2<f64>) -> Option<Vec<Point2<f64>>> {
        let Goal::Reach { target, tolerance_m, .. } = self.goal else { return None };
        navigation.route_toward(here, &target, tolerance_m)
    }

    /// Plans anew on a fresh map: for a new goal, or because the old plan is no longer free. `route` is the way in the
    /// plane; where no flight to its end is found, half of it is flown, for more will be seen from there.
    pub fn replan(&mut self, route: Option<&[Point2<f64>]>, air: &AirSpace) {
        if self.phase != Phase::Flying {
            return;
        }
        let is_free = self.flying.as_ref().is_none_or(|(plan, t_s)| self.is_still_free(plan, *t_s, air));
        if !is_free || self.wants_stop {
            self.brake(!is_free, air);
        }
        let Goal::Reach { target, tolerance_m, .. } = self.goal else { return };
        if self.status != GoalStatus::Underway {
            return;
        }
        let Some((route, end)) = route.and_then(|route| Some((route, *route.last()?))) else {
            self.fail_once("no way through what is known");
            return;
        };
        let at_height = |point: Point2<f64>| Point3::new(point.x, point.y, self.flight_height_m);
        let goal = at_height(end);
        let ends_there = self.flying.as_ref().is_some_and(|(plan, _)| {
            let end = plan.sample(plan.duration()).p;
            (end - goal).norm() < 0.15
        });
        if is_free && (ends_there || (self.is_half_way && self.flying.is_some())) {
            self.has_planned |= ends_there;
            return;
        }
        let start = self.state();
        let half = at_height(middle_of(route));
        self.is_half_way = false;
        match plan_air(&start, &goal, air.distance, air.obstacles, &self.config) {
            Ok(plan) => {
                let duration_s = plan.trajectory.duration();
                let is_there = (plan.trajectory.sample(duration_s).p.xy() - target).norm() <= tolerance_m;
                if is_there {
                    self.attempts = 0;
                } else if self.flying.is_none() {
                    // The planner ends at a free point near a goal that is not free. From there it would end there again, for ever.
                    self.fail_once(sentence(&AirPlanError::GoalBlocked));
                }
                if self.status == GoalStatus::Underway {
                    self.has_planned = true;
                    self.follow(plan);
                }
            }
            // Too fast for any way from here: come to rest, and plan from there.
            Err(AirPlanError::NotProved(_) | AirPlanError::StartTooFast { .. }) if start.v.norm() > RESTING_MPS => {
                self.brake(false, air);
            }
            Err(error) => {
                self.fail_once(sentence(&error));
                if self.status == GoalStatus::Underway
                    && let Ok(plan) = plan_air(&start, &half, air.distance, air.obstacles, &self.config)
                {
                    self.is_half_way = true;
                    self.follow(plan);
                }
            }
        }
    }

    fn follow(&mut self, plan: AirPlan) {
        self.wants_stop = false;
        self.path = plan.route.iter().map(|point| point.xy()).collect();
        self.flying = Some((plan.trajectory, 0.0));
    }

    fn fail_once(&mut self, why: &'static str) {
        self.attempts += 1;
        if self.attempts >= self.max_attempts {
            self.wants_stop = true;
            self.status = GoalStatus::Failed(why);
        }
    }

    /// Whether what is left of a certified trajectory is still free. The map's voxels may shift by their size between two
    /// looks: only a real intrusion counts, and what is not known any more was known when it was certified.
    fn is_still_free(&self, plan: &PolynomialTrajectory, from_s: f64, air: &AirSpace) -> bool {
        Self::keeps(plan, from_s, self.config.radius_m - 0.05, true, air)
    }

    /// Whether a trajectory, from a time on, keeps `ball_m` away from what the map shows now. `if_unknown`: the answer where
    /// nobody has looked.
    fn keeps(plan: &PolynomialTrajectory, from_s: f64, ball_m: f64, if_unknown: bool, air: &AirSpace) -> bool {
        const STEP_S: f64 = 0.1;
        let steps = ((plan.duration() - from_s) / STEP_S).ceil().max(0.0) as usize;
        (0..=steps).all(|step| {
            let point = plan.sample((from_s + step as f64 * STEP_S).min(plan.duration())).p;
            (air.distance)(&point).map_or(if_unknown, |distance_m| distance_m >= ball_m)
        })
    }

    /// The set-point as a state: where a new trajectory begins.
    fn state(&self) -> FlightState {
        match &self.flying {
            Some((plan, t_s)) => {
                let sample = plan.sample(*t_s);
                FlightState { p: sample.p, v: sample.v, a: sample.a }
            }
            None => FlightState::resting_at(self.hover),
        }
    }

    /// Replaces what is flown by a short braking trajectory, if that is free or `must` be. Otherwise the certified one is
    /// flown on; it ends at rest too.
    fn brake(&mut self, must: bool, air: &AirSpace) {
        if self.flying.is_none() {
            self.wants_stop = false;
            return;
        }
        let state = self.state();
        if state.v.norm() <= RESTING_MPS {
            self.hover = state.p;
            self.flying = None;
        } else {
            let brake = planner::stop_trajectory(&state, &self.config.limits);
            // Nobody certified it: it has to keep the distance that a certificate would ask for.
            if !must && !Self::keeps(&brake, 0.0, self.config.clearance_m(), false, air) {
                return;
            }
            self.flying = Some((brake, 0.0));
        }
        self.wants_stop = false;
        self.path.clear();
    }

    /// The set-point for the next period.
    pub fn command(&mut self, world_from_body: &Isometry3<f64>, distance_m: Option<f64>) -> Command {
        // On the floor the ball touches it, which means nothing.
        let in_the_air = self.phase == Phase::Flying;
        self.clearance_m = distance_m.filter(|_| in_the_air).map_or(f64::INFINITY, |d| d - self.config.radius_m);
        let actual = Point3::from(world_from_body.translation.vector);
        let mut velocity = Vector3::zeros();
        let mut acceleration = Vector3::zeros();
        let mut jerk = Vector3::zeros();
        match self.phase {
            Phase::Grounded | Phase::Landed => self.hover = actual,
            Phase::TakeOff => {
                let left_m = self.flight_height_m - self.hover.z;
                velocity.z = left_m.clamp(0.0, CLIMB_MPS);
                self.hover.z += velocity.z.max(0.05).min(left_m.max(0.0) / self.period_s) * self.period_s;
                if left_m < 0.02 && (actual.z - self.flight_height_m).abs() < 0.1 {
                    self.phase = Phase::Flying;
                }
            }
            Phase::Landing => {
                velocity.z = -CLIMB_MPS.min(0.15 + 0.5 * (self.hover.z - self.ground_clearance_m).max(0.0));
                self.hover.z += velocity.z * self.period_s;
                if self.hover.z < self.ground_clearance_m - 0.3 || actual.z < self.ground_clearance_m + 0.03 {
                    self.phase = Phase::Landed;
                }
            }
            Phase::Flying => {
                if let Some((plan, t_s)) = &mut self.flying {
                    *t_s += self.period_s;
                    let sample = plan.sample(t_s.min(plan.duration()));
                    self.hover = sample.p;
                    if *t_s < plan.duration() {
                        velocity = sample.v;
                        acceleration = sample.a;
                        jerk = sample.jerk;
                    } else {
                        self.flying = None;
                        self.path.clear();
                    }
                }
                self.judge(&actual);
                if self.wants_landing && self.flying.is_none() {
                    self.phase = Phase::Landing;
                }
            }
        }
        let wanted_rad = match self.goal {
            Goal::Turn { heading_rad } => Some(heading_rad),
            Goal::Reach { heading_rad: Some(heading_rad), .. } if self.flying.is_none() => Some(heading_rad),
            _ if velocity.xy().norm() > 0.3 => Some(velocity.y.atan2(velocity.x)),
            _ => None,
        };
        let limit = YAW_PART * self.max_yaw_rate_radps;
        let yaw_rate = wanted_rad.map_or(0.0, |wanted| (1.5 * wrap(wanted - self.yaw_rad)).clamp(-limit, limit));
        self.yaw_rad = wrap(self.yaw_rad + yaw_rate * self.period_s);
        Command::Flight(FlightSetPoint {
            position_in_world: self.hover,
            velocity_in_world_mps: velocity,
            acceleration_in_world_mps2: acceleration,
            jerk_in_world_mps3: jerk,
            yaw_rad: self.yaw_rad,
            yaw_rate_radps: yaw_rate,
            is_armed: !matches!(self.phase, Phase::Grounded | Phase::Landed),
        })
    }

    /// Arrived when nothing is left to fly and the body is there too.
    fn judge(&mut self, actual: &Point3<f64>) {
        if self.status != GoalStatus::Underway {
            return;
        }
        match self.goal {
            Goal::Reach { target, tolerance_m, heading_rad } if self.has_planned => {
                let is_turned = heading_rad.is_none_or(|wanted| wrap(wanted - self.yaw_rad).abs() < 0.3);
                if self.flying.is_none() && (actual.xy() - target).norm() <= tolerance_m && is_turned {
                    self.status = GoalStatus::Arrived;
                }
            }
            Goal::Turn { heading_rad } if wrap(heading_rad - self.yaw_rad).abs() < 0.1 => {
                self.status = GoalStatus::Arrived;
            }
            _ => {}
        }
    }
}

/// The point half way along a polyline.
fn middle_of(route: &[Point2<f64>]) -> Point2<f64> {
    let total: f64 = route.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
    let mut left = 0.5 * total;
    for leg in route.windows(2) {
        let length = (leg[1] - leg[0]).norm();
        if length >= left && length > 0.0 {
            return leg[0] + (leg[1] - leg[0]) * (left / length);
        }
        left -= length;
    }
    route[route.len() - 1]
}

/// Why there is no flight, for people.
fn sentence(error: &AirPlanError) -> &'static str {
    match error {
        AirPlanError::StartBlocked => "it hovers in a place that the map does not call free",
        AirPlanError::GoalBlocked => "there is no room for it at the goal",
        AirPlanError::NoRoute => "no way is wide enough for it",
        AirPlanError::SearchLimit { .. } | AirPlanError::TooFar => "the way is too long to be searched",
        AirPlanError::NotProved(_) | AirPlanError::StartTooFast { .. } => "no proved flight from this motion",
        AirPlanError::Config(_) | AirPlanError::NotFinite => "the planner was given numbers that make no sense",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flies at a wall with 1 m/s and is told to stay; where the wall lets the ball pass by `beyond_m` beyond the place
    /// at which a brake would end, whether it brakes at once.
    fn brakes_with(beyond_m: f64) -> bool {
        let mut fly = Fly::new(&RobotModel::builtin_quadrotor(), 1.2, 0.2, 0.02, 3);
        let state = FlightState { p: Point3::new(0.0, 0.0, 1.2), v: Vector3::new(1.0, 0.0, 0.0), a: Vector3::zeros() };
        let brake = planner::stop_trajectory(&state, &fly.config.limits);
        let wall_m = brake.sample(brake.duration()).p.x + fly.config.radius_m + beyond_m;
        // Something gentler than the brake, so that one can be told from the other.
        let certified = planner::stop_trajectory(
            &state,
            &planner::FlightLimits { max_accel_mps2: 0.5 * fly.config.limits.max_accel_mps2, ..fly.config.limits },
        );
        let duration_s = certified.duration();
        fly.flying = Some((certified, 0.0));
        fly.phase = Phase::Flying;
        fly.set_goal(Goal::Stay);
        let distance = |p: &Point3<f64>| Some(wall_m - p.x);
        fly.brake(false, &AirSpace { distance: &distance, obstacles: &|_, _| Vec::new() });
        fly.flying.is_some_and(|(plan, _)| plan.duration() < duration_s)
    }

    #[test]
    fn a_goal_with_no_room_fails_after_some_attempts_and_is_not_flown_to_for_ever() {
        // A wall at x = 2 m; the goal is in front of it, where the ball has no room.
        let mut fly = Fly::new(&RobotModel::builtin_quadrotor(), 1.2, 0.2, 0.02, 3);
        fly.phase = Phase::Flying;
        fly.hover = Point3::new(0.0, 0.0, 1.2);
        let target = Point2::new(1.85, 0.0);
        fly.set_goal(Goal::Reach { target, tolerance_m: 0.1, heading_rad: None });
        let distance = |p: &Point3<f64>| Some((2.0 - p.x).max(0.0));
        let wall = |low: &Point3<f64>, high: &Point3<f64>| {
            let steps = |k: usize| (0..=((high[k] - low[k]) / 0.1) as usize).map(move |i| low[k] + 0.1 * i as f64);
            steps(1).flat_map(|y| steps(2).map(move |z| Point3::new(2.0, y, z))).collect()
        };
        let (mut pose, mut refreshes) = (Isometry3::translation(0.0, 0.0, 1.2), 0);
        while *fly.status() == GoalStatus::Underway {
            refreshes += 1;
            assert!(refreshes < 60, "half a minute at {}", pose.translation.vector);
            fly.replan(
                Some(&[pose.translation.vector.xy().into(), target]),
                &AirSpace { distance: &distance, obstacles: &wall },
            );
            for _ in 0..25 {
                let Command::Flight(point) = fly.command(&pose, None) else { panic!("it flies") };
                pose.translation.vector = point.position_in_world.coords;
            }
        }
        assert_eq!(*fly.status(), GoalStatus::Failed("there is no room for it at the goal"));
        assert!(pose.translation.vector.x > 1.2, "as near as there is room");
    }

    #[test]
    fn a_free_brake_keeps_as_much_distance_as_a_certificate() {
        let margin_m = AirConfig::default().margin_m;
        assert!(brakes_with(margin_m + 0.01));
        assert!(!brakes_with(margin_m - 0.01), "nobody certified a brake that ends nearer than that");
        assert!(!brakes_with(-0.04), "the slack of a certified flight is not for brakes");
    }
}
