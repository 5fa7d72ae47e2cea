//! What a flyer decides on each fresh map: fly on, plan anew, brake, or choose where to land.

use nalgebra::{Point2, Point3};
use planner::{
    AirConfig, AirPlan, AirPlanError, AirSpace, FlightLimits, FlightState, HeadingPlan, Movers, PolynomialTrajectory,
    TouchDown, fly_down, plan_air,
};

use super::stages::{Stage, exceeded, first_stage};
use super::{Fly, Following, LandingWish, Phase, RESTING_MPS, YAW_PART};
use crate::air_checks::{INTRUSION_M, is_column_free, keeps, keeps_to_the_known, landing_places};
use crate::emergency::{Emergency, RETURN_ROOM};
use crate::goal::{Goal, GoalStatus};

/// The next part of a way is planned when so much of the present one is left: more than it takes to brake.
const REPLAN_BEFORE_S: f64 = 2.0;
/// A part of a way counts as progress if it leaves so much less of it.
pub(super) const PROGRESS_M: f64 = 0.5;

impl Fly {
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
        let Some(route) = route.filter(|route| !route.is_empty()) else {
            self.fail_once("no way through what is known");
            return;
        };
        let at_height = |point: Point2<f64>| Point3::new(point.x, point.y, self.flight_height_m);
        let stage = first_stage(route, &self.slow, self.zone_reach_m(), self.config.limits.max_speed_mps);
        let goal = at_height(stage.end);
        if let Some(following) = self.flying.as_ref().filter(|_| is_free) {
            let ends_there = (following.end() - goal).norm() < 0.15;
            if ends_there || (following.left_m > 0.0 && following.left_s() > REPLAN_BEFORE_S) {
                self.has_planned |= ends_there && stage.left_m == 0.0;
                return;
            }
        }
        let start = self.state();
        let half = at_height(middle_of(route));
        match self.plan_stage(&start, &goal, &stage, air) {
            Ok(plan) if self.refuses(&plan, &target, way_home_m) => {
                self.fail_once("the battery would not bring it back from there");
            }
            Ok(plan) if plan.left_m > 0.0 => self.follow_part(plan), // also where the way goes on behind its stage
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
                    && let Ok(plan) = self.plan_stage(&start, &half, &Stage { left_m: 0.0, ..stage }, air)
                    && !self.refuses(&plan, &target, way_home_m)
                {
                    let left_m = plan.left_m + (plan.trajectory.sample(f64::MAX).p - goal).norm();
                    self.follow(AirPlan { left_m, ..plan });
                }
            }
        }
    }

    /// A flight to the end of a stage within its limit. One that would touch a slower zone all the same, beside the way, is flown as slowly as
    /// that demands.
    pub(super) fn plan_stage(
        &self,
        start: &FlightState,
        goal: &Point3<f64>,
        stage: &Stage,
        air: &AirSpace,
    ) -> Result<AirPlan, AirPlanError> {
        let within = |max_mps: f64| {
            let limits = FlightLimits { max_speed_mps: max_mps, ..self.config.limits };
            let plan = plan_air(start, goal, air, &AirConfig { limits, ..self.config.clone() })?;
            Ok::<AirPlan, AirPlanError>(AirPlan { left_m: plan.left_m + stage.left_m, ..plan })
        };
        let mut max_mps = stage.max_mps;
        let mut plan = within(max_mps)?;
        // Each time the limit is that of another, slower zone.
        while let Some(slower_mps) = exceeded(&plan.trajectory, &self.slow, self.zone_reach_m(), max_mps)
            && slower_mps < max_mps
        {
            max_mps = slower_mps;
            plan = within(max_mps)?;
        }
        Ok(plan)
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
    pub(super) fn look_along(&mut self) {
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
        keeps(rest, self.config.radius_m - INTRUSION_M, air) && movers.slack_m(rest) >= 0.0
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
    pub(super) fn state(&self) -> FlightState {
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
            let cell_m = self.config.search_resolution_m;
            if !must && !keeps_to_the_known(&brake, self.config.clearance_m(), cell_m, air) {
                return;
            }
        }
        self.stop();
    }

    /// Comes to rest from the present set-point by the shortest brake.
    pub(super) fn stop(&mut self) {
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
    pub(super) fn go_down(&mut self) {
        let touch = TouchDown { descent_mps: self.climb_mps(&self.hover), ..TouchDown::default() };
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
}

/// The point half way along a polyline.
pub(super) fn middle_of(route: &[Point2<f64>]) -> Point2<f64> {
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
    use crate::stream::Command;
    use nalgebra::{Isometry3, Vector3};
    use robot_model::RobotModel;

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
