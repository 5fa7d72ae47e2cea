//! In the air: from a goal to set-points. Planned take-off, proved flights through known free space, hover, planned landing.
//!
//! A flight is flown only with its proof, only through space that was seen free, and ends at rest. It is left early only for
//! another proved one or for a brake that is free on the map; when the map shows something inside the robot's ball along the
//! rest of it, or something moves into its way, for the shortest brake there is. Where a flight leads only a part of the way
//! (the rest is not known yet, or beyond the horizon), the next one is planned before its braking begins.

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use planner::{
    AirConfig, AirPlan, AirPlanError, AirSpace, Battery, FlightState, Geofence, HeadingPlan, Movers,
    PolynomialTrajectory, TouchDown, fly_down, fly_up, plan_air,
};
use robot_model::RobotModel;

use crate::air_checks::{INTRUSION_M, is_column_free, keeps, landing_places};
use crate::emergency::{Emergency, RETURN_ROOM};
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
/// The next part of a way is planned when so much of the present one is left: more than it takes to brake.
const REPLAN_BEFORE_S: f64 = 2.0;
/// A part of a way counts as progress if it leaves so much less of it.
const PROGRESS_M: f64 = 0.5;
/// The set-point is so far below the body: it stands on something.
const STANDS_M: f64 = 0.25;

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

/// How far the landing is decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LandingWish {
    No,
    /// It shall land; where is not known yet.
    Wanted,
    /// Straight down from where it comes to rest.
    Below,
}

/// What is flown now, and for how long.
struct Following {
    trajectory: PolynomialTrajectory,
    t_s: f64,
    /// Length of the way beyond its end.
    left_m: f64,
}

impl Following {
    fn rest(&self) -> PolynomialTrajectory {
        self.trajectory.rest_from(self.t_s)
    }

    fn end(&self) -> Point3<f64> {
        self.trajectory.sample(f64::MAX).p
    }

    fn left_s(&self) -> f64 {
        self.trajectory.duration() - self.t_s
    }
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
    /// Least way left beyond any part flown toward the present goal.
    least_left_m: f64,
    flying: Option<Following>,
    /// The present trajectory is not wanted any more; it is left where a brake is free, at the latest at its end.
    wants_stop: bool,
    landing: LandingWish,
    /// Set-point when nothing is flown.
    hover: Point3<f64>,
    heading: HeadingPlan,
    heading_t_s: f64,
    yaw_rad: f64,
    yaw_rate_radps: f64,
    flight_height_m: f64,
    ground_clearance_m: f64,
    /// Where it took off.
    home: Option<Point2<f64>>,
    battery: Option<Battery>,
    charge: f64,
    emergency: Option<Emergency>,
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
            least_left_m: f64::INFINITY,
            flying: None,
            wants_stop: false,
            landing: LandingWish::No,
            hover: Point3::new(0.0, 0.0, landed_z_m),
            heading: HeadingPlan::along(&PolynomialTrajectory::default(), 0.0, 0.0, None, 1.0),
            heading_t_s: 0.0,
            yaw_rad: 0.0,
            yaw_rate_radps: 0.0,
            flight_height_m: flight_z_m,
            ground_clearance_m: landed_z_m,
            home: None,
            battery: None,
            charge: 1.0,
            emergency: None,
            path: Vec::new(),
            clearance_m: f64::INFINITY,
        }
    }

    /// Keeps `margin_m` for what its body may be off the set-point, stays inside a fence (of the map's frame), and flies nowhere from
    /// where the battery would not bring it back.
    pub fn limit(&mut self, margin_m: f64, geofence: Option<Geofence>, battery: Option<Battery>) {
        self.config.margin_m = margin_m;
        self.config.geofence = geofence;
        self.battery = battery;
    }

    /// Present phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Whether it goes back or down for the battery's sake; goals are not taken any more then.
    pub fn emergency(&self) -> Option<Emergency> {
        self.emergency
    }

    /// Where it took off.
    pub fn home(&self) -> Option<Point2<f64>> {
        self.home
    }

    /// Leaves the floor from where the robot stands, on a planned climb.
    ///
    /// # Errors
    /// Why it stays on the floor, for people.
    pub fn take_off(&mut self, world_from_body: &Isometry3<f64>, air: &AirSpace) -> Result<(), &'static str> {
        if self.phase != Phase::Grounded {
            return Ok(());
        }
        let here = Point3::from(world_from_body.translation.vector);
        let top = Point3::new(here.x, here.y, self.flight_height_m);
        if self.config.geofence.as_ref().is_some_and(|fence| fence.slack_m(&top) < 0.0) {
            return Err("the place above it is outside the fence");
        }
        // The floor touches the ball, and above it nobody may have looked; what is known there must be free.
        if !is_column_free(&here, self.flight_height_m, self.ground_clearance_m, self.config.radius_m, air) {
            return Err("there is no room to fly above where it stands");
        }
        let limits = &self.config.limits;
        let climb = fly_up(&FlightState::resting_at(here), self.flight_height_m, CLIMB_MPS, limits)
            .map_err(|_| "no climb to its flight height was proved")?;
        self.hover = here;
        self.yaw_rad = world_from_body.rotation.euler_angles().2;
        self.home = Some(here.xy());
        self.flying = Some(Following { trajectory: climb.trajectory, t_s: 0.0, left_m: 0.0 });
        self.phase = Phase::TakeOff;
        self.look_along();
        Ok(())
    }

    /// Stops, and goes down there, or nearby where there is room below. It may be asked again at any time.
    pub fn land(&mut self) {
        match self.phase {
            Phase::Flying if self.landing == LandingWish::No => {
                self.set_goal(Goal::Stay);
                self.landing = LandingWish::Wanted;
            }
            Phase::TakeOff if self.landing == LandingWish::No => {
                // It came up this way, so it is free.
                self.landing = LandingWish::Below;
                self.stop();
            }
            Phase::Grounded => self.phase = Phase::Landed,
            _ => {}
        }
    }

    /// The map's frame became another one while the robot stood or hovered: it goes on standing there.
    pub fn change_frame(&mut self, new_from_old: &Isometry3<f64>, floor_rise_m: f64) {
        self.set_goal(Goal::Stay);
        self.wants_stop = false;
        self.flying = None;
        self.path.clear();
        self.hover = new_from_old * self.hover;
        self.home = self.home.map(|home| (new_from_old * Point3::new(home.x, home.y, 0.0)).xy());
        self.yaw_rad = wrap(self.yaw_rad + new_from_old.rotation.euler_angles().2);
        self.look_along();
        self.flight_height_m += floor_rise_m;
        self.ground_clearance_m += floor_rise_m;
        self.config.preferred_height_m = Some(self.flight_height_m);
    }

    /// Takes a new goal; the trajectory being flown goes on until the next plan replaces it. No goal is taken any more once
    /// it was told to land, or has to for its battery's sake.
    pub fn set_goal(&mut self, goal: Goal) {
        if self.landing == LandingWish::No && self.emergency.is_none() {
            self.take_goal(goal);
        }
    }

    fn take_goal(&mut self, goal: Goal) {
        self.attempts = 0;
        self.has_planned = false;
        self.least_left_m = f64::INFINITY;
        self.status = if goal == Goal::Stay { GoalStatus::Arrived } else { GoalStatus::Underway };
        self.wants_stop = goal == Goal::Stay;
        self.goal = goal;
        self.look_along();
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

    /// The battery says how full it is (0 to 1); `way_home_m` is the way back from here. Goes back or down when it must.
    pub fn set_charge(&mut self, charge: f64, way_home_m: Option<f64>) {
        self.charge = charge;
        let (Some(battery), Some(home)) = (&self.battery, self.home) else { return };
        if self.phase != Phase::Flying || self.landing != LandingWish::No {
            return;
        }
        let due = Emergency::due(self.emergency, battery, charge, way_home_m);
        if due == self.emergency {
            return;
        }
        match due {
            Some(Emergency::Returning) => {
                self.take_goal(Goal::Reach { target: home, tolerance_m: 0.5, heading_rad: None });
            }
            _ => {
                self.take_goal(Goal::Stay);
                self.landing = LandingWish::Wanted;
            }
        }
        self.emergency = due;
    }

    /// Plans anew on a fresh map: for a new goal, for the next part of a way, or because the old plan is no longer free. `route`
    /// is the way in the plane; where no flight to its end is found, half of it is flown, for more will be seen from there.
    /// `way_home_m` tells the length of the way back from a place.
    pub fn replan(
        &mut self,
        route: Option<&[Point2<f64>]>,
        air: &AirSpace,
        way_home_m: &dyn Fn(&Point2<f64>) -> Option<f64>,
    ) {
        if self.phase != Phase::Flying {
            return;
        }
        let is_free = self.flying.as_ref().is_none_or(|following| self.is_still_free(&following.rest(), air));
        if !is_free || self.wants_stop {
            self.brake(!is_free, air);
        }
        if self.emergency == Some(Emergency::Returning) && self.status != GoalStatus::Underway {
            // Home, or there is no way home.
            self.emergency =
                Some(if self.status == GoalStatus::Arrived { Emergency::Returning } else { Emergency::LandingHere });
            self.landing = if self.landing == LandingWish::No { LandingWish::Wanted } else { self.landing };
        }
        if self.landing == LandingWish::Wanted && self.flying.is_none() {
            self.choose_landing(air);
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
        if let Some(following) = self.flying.as_ref().filter(|_| is_free) {
            let ends_there = (following.end() - goal).norm() < 0.15;
            if ends_there || (following.left_m > 0.0 && following.left_s() > REPLAN_BEFORE_S) {
                self.has_planned |= ends_there;
                return;
            }
        }
        let start = self.state();
        let half = at_height(middle_of(route));
        match plan_air(&start, &goal, air, &self.config) {
            Ok(plan) if self.refuses(&plan, &target, way_home_m) => {
                self.fail_once("the battery would not bring it back from there");
            }
            Ok(plan) if plan.left_m > 0.0 => self.follow_part(plan),
            Ok(plan) => {
                let is_there = (plan.trajectory.sample(f64::MAX).p.xy() - target).norm() <= tolerance_m;
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
            // Somebody is in the way: it waits until he has passed.
            Err(AirPlanError::MoverInTheWay { .. }) => {}
            // A part of the way is flown to its end first.
            Err(_) if self.flying.as_ref().is_some_and(|following| following.left_m > 0.0) => {}
            Err(error) => {
                self.fail_once(sentence(&error));
                if self.status == GoalStatus::Underway
                    && let Ok(plan) = plan_air(&start, &half, air, &self.config)
                    && !self.refuses(&plan, &target, way_home_m)
                {
                    let left_m = plan.left_m + (plan.trajectory.sample(f64::MAX).p - goal).norm();
                    self.follow(AirPlan { left_m, ..plan });
                }
            }
        }
    }

    /// Whether the battery would not bring it back after this flight. The way home itself is never refused.
    fn refuses(&self, plan: &AirPlan, target: &Point2<f64>, way_home_m: &dyn Fn(&Point2<f64>) -> Option<f64>) -> bool {
        let (Some(battery), Some(home)) = (&self.battery, &self.home) else { return false };
        if (target - home).norm() < 1.0 || self.emergency.is_some() {
            return false;
        }
        let end = plan.trajectory.sample(f64::MAX).p.xy();
        // Where nobody knows the way back, it is the way there.
        let back_m = way_home_m(&end).or_else(|| Some(way_home_m(&self.hover.xy())? + length_of(&plan.route)));
        let duration_s = plan.trajectory.duration();
        let back_m = back_m.map_or(f64::INFINITY, |way_m| RETURN_ROOM * way_m);
        battery.allow(duration_s, &plan.proof, &self.config.limits, back_m, self.charge).is_err()
    }

    /// A part of the way; one that brings it no nearer counts as an attempt.
    fn follow_part(&mut self, plan: AirPlan) {
        if plan.left_m > self.least_left_m - PROGRESS_M {
            self.fail_once("the rest of the way does not show");
        }
        self.least_left_m = self.least_left_m.min(plan.left_m);
        if self.status == GoalStatus::Underway {
            self.follow(plan);
        }
    }

    fn follow(&mut self, plan: AirPlan) {
        self.wants_stop = false;
        self.path = plan.route.iter().map(|point| point.xy()).collect();
        self.flying = Some(Following { trajectory: plan.trajectory, t_s: 0.0, left_m: plan.left_m });
        self.look_along();
    }

    fn fail_once(&mut self, why: &'static str) {
        self.attempts += 1;
        if self.attempts >= self.max_attempts {
            self.wants_stop = true;
            self.status = GoalStatus::Failed(why);
        }
    }

    /// Where to look from now on: ahead, at the end to where the goal says; hovering, there at once.
    fn look_along(&mut self) {
        let look = match self.goal {
            Goal::Turn { heading_rad } => Some(heading_rad),
            Goal::Reach { heading_rad, .. } => {
                heading_rad.filter(|_| self.flying.as_ref().is_none_or(|f| f.left_m == 0.0))
            }
            Goal::Stay => None,
        };
        let limit = YAW_PART * self.max_yaw_rate_radps;
        let rest = self.flying.as_ref().map(Following::rest).unwrap_or_default();
        self.heading = HeadingPlan::along(&rest, self.yaw_rad, self.yaw_rate_radps, look, limit);
        self.heading_t_s = 0.0;
    }

    /// Whether what is left of a proved flight is still free. What is not known any more was known when it was proved.
    fn is_still_free(&self, rest: &PolynomialTrajectory, air: &AirSpace) -> bool {
        let movers = Movers { list: air.movers, keep_m: self.config.radius_m, horizon_s: self.config.prediction_s };
        keeps(rest, self.config.radius_m - INTRUSION_M, true, air) && movers.slack_m(rest) >= 0.0
    }

    /// Down here if there is room; else above the nearest place where there is, else here all the same.
    fn choose_landing(&mut self, air: &AirSpace) {
        let here = self.hover;
        let (ground_m, radius_m) = (self.ground_clearance_m, self.config.radius_m);
        let is_free = |p: &Point3<f64>| is_column_free(p, ground_m, ground_m, radius_m, air);
        let start = FlightState::resting_at(here);
        let beside = if is_free(&here) {
            None
        } else {
            let mut flights =
                landing_places(here).filter(is_free).filter_map(|p| plan_air(&start, &p, air, &self.config).ok());
            flights.find(|plan| plan.left_m == 0.0 && is_free(&plan.trajectory.sample(f64::MAX).p))
        };
        self.landing = LandingWish::Below;
        if let Some(plan) = beside {
            self.follow(plan);
        }
    }

    /// The set-point as a state: where a new trajectory begins.
    fn state(&self) -> FlightState {
        match &self.flying {
            Some(following) => {
                let sample = following.trajectory.sample(following.t_s);
                FlightState { p: sample.p, v: sample.v, a: sample.a }
            }
            None => FlightState::resting_at(self.hover),
        }
    }

    /// Replaces what is flown by a short braking trajectory, if that is free or `must` be. Otherwise the proved one is flown on;
    /// it ends at rest too.
    fn brake(&mut self, must: bool, air: &AirSpace) {
        let state = self.state();
        if self.flying.is_some() && state.v.norm() > RESTING_MPS {
            let brake = planner::stop_trajectory(&state, &self.config.limits);
            // Nobody proved it free: it has to keep the distance that a proof would ask for.
            if !must && !keeps(&brake, self.config.clearance_m(), false, air) {
                return;
            }
        }
        self.stop();
    }

    /// Comes to rest from the present set-point by the shortest brake.
    fn stop(&mut self) {
        self.wants_stop = false;
        if self.flying.is_none() {
            return;
        }
        let state = self.state();
        self.path.clear();
        if state.v.norm() <= RESTING_MPS {
            self.hover = state.p;
            self.flying = None;
        } else {
            let trajectory = planner::stop_trajectory(&state, &self.config.limits);
            self.flying = Some(Following { trajectory, t_s: 0.0, left_m: 0.0 });
        }
        self.look_along();
    }

    /// Begins the descent from rest.
    fn go_down(&mut self) {
        let touch = TouchDown { descent_mps: CLIMB_MPS, ..TouchDown::default() };
        let here = FlightState::resting_at(self.hover);
        // Lower than that it is down already.
        let Ok(down) = fly_down(&here, self.ground_clearance_m, &touch, &self.config.limits) else {
            self.phase = Phase::Landed;
            return;
        };
        self.phase = Phase::Landing;
        self.flying = Some(Following { trajectory: down.trajectory, t_s: 0.0, left_m: 0.0 });
        self.goal = Goal::Stay;
        self.look_along();
    }

    /// The set-point for the next period.
    pub fn command(&mut self, world_from_body: &Isometry3<f64>, distance_m: Option<f64>) -> Command {
        // On the floor the ball touches it, which means nothing.
        let in_the_air = self.phase == Phase::Flying;
        self.clearance_m = distance_m.filter(|_| in_the_air).map_or(f64::INFINITY, |d| d - self.config.radius_m);
        let actual = Point3::from(world_from_body.translation.vector);
        let (mut velocity, mut acceleration, mut jerk) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        if let Some(following) = &mut self.flying {
            following.t_s += self.period_s;
            let duration_s = following.trajectory.duration();
            let sample = following.trajectory.sample(following.t_s.min(duration_s));
            self.hover = sample.p;
            if following.t_s < duration_s {
                (velocity, acceleration, jerk) = (sample.v, sample.a, sample.jerk);
            } else {
                self.flying = None;
                self.path.clear();
            }
        }
        self.heading_t_s += self.period_s;
        let (yaw_rad, yaw_rate_radps) = self.heading.sample(self.heading_t_s);
        (self.yaw_rad, self.yaw_rate_radps) = (wrap(yaw_rad), yaw_rate_radps);
        match self.phase {
            Phase::Grounded | Phase::Landed => self.hover = actual,
            Phase::TakeOff if self.flying.is_none() => {
                if self.landing != LandingWish::No {
                    self.go_down();
                } else if (actual.z - self.flight_height_m).abs() < 0.1 {
                    self.phase = Phase::Flying;
                }
            }
            Phase::Landing => {
                let is_down = actual.z < self.ground_clearance_m + 0.03 || actual.z > self.hover.z + STANDS_M;
                if is_down || self.flying.is_none() {
                    self.phase = Phase::Landed;
                    self.flying = None;
                }
            }
            Phase::Flying => {
                self.judge(&actual);
                if self.landing == LandingWish::Below && self.flying.is_none() {
                    self.go_down();
                }
            }
            Phase::TakeOff => {}
        }
        Command::Flight(FlightSetPoint {
            position_in_world: self.hover,
            velocity_in_world_mps: velocity,
            acceleration_in_world_mps2: acceleration,
            jerk_in_world_mps3: jerk,
            yaw_rad: self.yaw_rad,
            yaw_rate_radps: self.yaw_rate_radps,
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

fn length_of(route: &[Point3<f64>]) -> f64 {
    route.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
}

/// Why there is no flight, for people.
fn sentence(error: &AirPlanError) -> &'static str {
    match error {
        AirPlanError::StartBlocked => "it hovers in a place that the map does not call free",
        AirPlanError::GoalBlocked => "there is no room for it at the goal",
        AirPlanError::NoRoute => "no way is wide enough for it",
        AirPlanError::SearchLimit { .. } | AirPlanError::TooFar => "the way is too long to be searched",
        AirPlanError::OutsideFence { .. } => "it would be outside the fence",
        AirPlanError::MoverInTheWay { .. } => "something moves in its way",
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
        fly.flying = Some(Following { trajectory: certified, t_s: 0.0, left_m: 0.0 });
        fly.phase = Phase::Flying;
        fly.set_goal(Goal::Stay);
        let distance = |p: &Point3<f64>| Some(wall_m - p.x);
        fly.brake(false, &AirSpace { distance: &distance, obstacles: &|_, _| Vec::new(), movers: &[] });
        fly.flying.is_some_and(|following| following.trajectory.duration() < duration_s)
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
                &AirSpace { distance: &distance, obstacles: &wall, movers: &[] },
                &|_| None,
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
