//! In the air: from a goal to set-points. Planned take-off, proved flights through known free space, hover, planned landing.
//!
//! A flight is flown only with its proof, only through space that was seen free, and ends at rest. It is left early only for
//! another proved one or for a brake that is free on the map; when the map shows something inside the robot's ball along the
//! rest of it, or something moves into its way, for the shortest brake there is. Where a flight leads only a part of the way
//! (the rest is not known yet, or beyond the horizon), the next one is planned before its braking begins.

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use planner::{
    AirConfig, AirSpace, Battery, FlightState, Geofence, HeadingPlan, PolynomialTrajectory, SpeedZone, fly_up,
};
use robot_model::RobotModel;

use crate::air_checks::is_column_free;
use crate::emergency::Emergency;
use crate::flight_limits::flight_limits;
use crate::goal::{Goal, GoalStatus, wrap};
use crate::navigation::NavigationMap;
use crate::stream::{Command, FlightSetPoint};
use crate::zones::{MARGIN_M, Zones};
use stages::limit_at;

mod rehearsal;
mod replan;
mod stages;

/// Climb and descent.
const CLIMB_MPS: f64 = 0.5;
/// Fraction of the yaw-rate limit used: a slow turn disturbs the LiDAR least.
const YAW_PART: f64 = 0.5;
/// Slower than this counts as at rest.
const RESTING_MPS: f64 = 0.05;
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
    /// In the frame of the odometry; the one of the configuration is in the map's.
    geofence: Option<Geofence>,
    battery: Option<Battery>,
    charge: f64,
    emergency: Option<Emergency>,
    /// Where it may only be slow, in the map.
    slow: Vec<SpeedZone>,
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
            geofence: None,
            battery: None,
            charge: 1.0,
            emergency: None,
            slow: Vec::new(),
            path: Vec::new(),
            clearance_m: f64::INFINITY,
        }
    }

    /// Keeps `margin_m` for what its body may be off the set-point, stays inside a fence (in the frame of the odometry, the only one
    /// that is known before the map), and flies nowhere from where the battery would not bring it back.
    pub fn limit(&mut self, margin_m: f64, geofence: Option<Geofence>, battery: Option<Battery>) {
        self.config.margin_m = margin_m;
        self.geofence = geofence;
        self.battery = battery;
    }

    /// Is slow from now on where the zones say so.
    pub fn limit_speed(&mut self, zones: &Zones) {
        self.slow = zones.speed_zones();
    }

    /// Climb and descent where it is.
    fn climb_mps(&self, at: &Point3<f64>) -> f64 {
        limit_at(&self.slow, &at.xy(), self.zone_reach_m(), CLIMB_MPS)
    }

    /// As near as that to a speed zone it is inside: its ball, and what may be wrong about its place.
    fn zone_reach_m(&self) -> f64 {
        self.config.radius_m + MARGIN_M
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

    /// Leaves the floor from where the robot stands, on a planned climb. The fence is put where it belongs in the map.
    ///
    /// # Errors
    /// Why it stays on the floor, for people.
    pub fn take_off(
        &mut self,
        world_from_body: &Isometry3<f64>,
        map_from_odometry: &Isometry3<f64>,
        air: &AirSpace,
    ) -> Result<(), &'static str> {
        if self.phase != Phase::Grounded {
            return Ok(());
        }
        self.config.geofence = self.geofence.as_ref().map(|fence| fence.transformed(map_from_odometry));
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
        let climb_mps = self.climb_mps(&here);
        let climb = fly_up(&FlightState::resting_at(here), self.flight_height_m, climb_mps, limits)
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
        self.config.geofence = self.config.geofence.as_ref().map(|fence| fence.transformed(new_from_old));
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
