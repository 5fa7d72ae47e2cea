//! The flights of a whole way, planned one after the other and not flown.

use nalgebra::{Point2, Point3};
use planner::{AirPlan, AirPlanError, AirSpace, FlightState, fly_up};

use super::replan::{PROGRESS_M, middle_of};
use super::stages::{Stage, first_stage};
use super::{CLIMB_MPS, Fly};

/// The way from a place, in the plane of flight.
pub type Route<'a> = dyn Fn(&Point2<f64>) -> Option<Vec<Point2<f64>>> + 'a;

/// More parts than that has no way in a building.
const MOST_PARTS: usize = 100;

impl Fly {
    /// The proved flights from rest at `from` (at flight height) to `target`, or within `tolerance_m` of it, as [`Fly::replan`] would find
    /// them on a map that shows nothing new on the way. `route(place)` is the way from a place in the plane of flight. Between two of them
    /// the robot comes to rest, which in the air it often need not: the time is the longest it takes.
    ///
    /// # Errors
    /// What the planner says where neither the whole rest of the way nor half of it has a proved flight.
    pub fn rehearse(
        &self,
        from: &Point2<f64>,
        target: &Point2<f64>,
        tolerance_m: f64,
        route: &Route<'_>,
        air: &AirSpace,
    ) -> Result<Vec<AirPlan>, AirPlanError> {
        let at_height = |point: &Point2<f64>| Point3::new(point.x, point.y, self.flight_height_m);
        let mut here = at_height(from);
        let mut flights: Vec<AirPlan> = Vec::new();
        let mut least_left_m = f64::INFINITY;
        while flights.len() < MOST_PARTS {
            let way = route(&here.xy()).filter(|way| !way.is_empty()).ok_or(AirPlanError::GoalBlocked)?;
            let stage = first_stage(&way, &self.slow, self.zone_reach_m(), self.config.limits.max_speed_mps);
            let start = FlightState::resting_at(here);
            let plan = self.plan_stage(&start, &at_height(&stage.end), &stage, air).or_else(|error| {
                let half = at_height(&middle_of(&way));
                let part = self.plan_stage(&start, &half, &Stage { left_m: 0.0, ..stage.clone() }, air);
                part.map(|plan| AirPlan { left_m: plan.left_m + (half - at_height(&stage.end)).norm(), ..plan })
                    .map_err(|_| error)
            })?;
            here = plan.trajectory.sample(f64::MAX).p;
            let left_m = plan.left_m;
            flights.push(plan);
            if (here.xy() - target).norm() <= tolerance_m {
                return Ok(flights);
            }
            if left_m <= 0.0 || left_m > least_left_m - PROGRESS_M {
                return Err(AirPlanError::GoalBlocked);
            }
            least_left_m = left_m;
        }
        Err(AirPlanError::GoalBlocked)
    }

    /// How long the climb from the floor takes.
    pub fn climb_s(&self, from: &Point2<f64>) -> Option<f64> {
        let ground = Point3::new(from.x, from.y, self.ground_clearance_m);
        let climb =
            fly_up(&FlightState::resting_at(ground), self.flight_height_m, CLIMB_MPS, &self.config.limits).ok()?;
        Some(climb.trajectory.duration())
    }
}
