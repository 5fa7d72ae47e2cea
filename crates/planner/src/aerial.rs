//! The aerial planner: A* -> shortcut -> convex corridor -> flight -> proof.

use nalgebra::{Point3, Vector3};

use crate::air::FlightState;
use crate::air::config::{AirConfig, AirConfigError};
use crate::air::corridor::polytope_around;
use crate::air::corridor_flight::{CorridorError, CorridorFlight, fly_corridor};
use crate::air::interior::InteriorSettings;
use crate::air::obstacles::{Surroundings, THINNEST_M};
use crate::air::polytope::Polytope;
use crate::air::proof::FlightProof;
use crate::air::route::{bounds_of, goal_height, lattice_route, shortcut};
use crate::air::search::SearchGrid;
use crate::air::stop::stop_trajectory;
use crate::air::trajectory::PolynomialTrajectory;

/// A flight that was proved to stay in its corridor within its limits.
#[derive(Debug, Clone)]
pub struct AirPlan {
    /// From the start state to rest at the goal.
    pub trajectory: PolynomialTrajectory,
    /// One polytope per leg of the route; consecutive ones overlap.
    pub corridor: Vec<Polytope>,
    /// Per piece of the trajectory: its polytope.
    pub polytope_of: Vec<usize>,
    /// What was proved; it always holds.
    pub proof: FlightProof,
    /// What every point of the corridor keeps from obstacle surfaces: less than [`AirConfig::clearance_m`] only where the start
    /// itself is nearer.
    pub clearance_m: f64,
    /// The shortcut route, start first.
    pub route: Vec<Point3<f64>>,
    /// How far the end is from the goal that was asked for (0 unless that was not free).
    pub goal_pull_m: f64,
    /// Lattice points the search expanded.
    pub expansions: usize,
}

/// Lists the obstacle points in a box, given its low and its high corner.
pub type ObstaclesInBox<'a> = &'a dyn Fn(&Point3<f64>, &Point3<f64>) -> Vec<Point3<f64>>;

/// Why there is no plan.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum AirPlanError {
    /// The configuration does not hold.
    #[error(transparent)]
    Config(#[from] AirConfigError),
    /// Start or goal is not finite.
    #[error("start and goal must be finite")]
    NotFinite,
    /// Start and goal are too far apart for the search box.
    #[error("start and goal are too far apart")]
    TooFar,
    /// The start is faster or accelerates more than the limits allow.
    #[error("the start moves at {speed_mps} m/s, {accel_mps2} m/s^2: beyond the limits")]
    StartTooFast {
        /// Its speed.
        speed_mps: f64,
        /// Its acceleration.
        accel_mps2: f64,
    },
    /// No free point near the start that can be reached from it.
    #[error("the start is in an obstacle or in unknown space, and so is everything round it")]
    StartBlocked,
    /// No free point near the goal.
    #[error("the goal is in an obstacle or in unknown space, and so is everything round it")]
    GoalBlocked,
    /// Everything reachable was searched.
    #[error("no route for this vehicle")]
    NoRoute,
    /// The bound on the search was met.
    #[error("the search stopped after {expansions} expansions")]
    SearchLimit {
        /// How many.
        expansions: usize,
    },
    /// There is a corridor, but no flight in it was proved, not even one that brakes first.
    #[error("no proved flight from this start: {0}")]
    NotProved(CorridorError),
}

/// Routes that an exact check refuses are searched again at most this often.
const RETRIES: usize = 5;
/// Plans a flight to rest at `goal`.
///
/// `distance` is the distance from a point to the nearest obstacle *point* (cell centre), `None` where unknown, which counts as
/// blocked. `obstacles_in_box` lists the obstacle points in a box (low corner, high corner). Both must tell of the same map.
/// Deterministic; the work is bounded by counts.
///
/// # Errors
/// [`AirPlanError`]. A flight that is not proved is never returned.
pub fn plan_air(
    start: &FlightState,
    goal: &Point3<f64>,
    distance: &dyn Fn(&Point3<f64>) -> Option<f64>,
    obstacles_in_box: ObstaclesInBox,
    config: &AirConfig,
) -> Result<AirPlan, AirPlanError> {
    check(start, goal, config)?;
    let way = way_through(start, None, goal, distance, obstacles_in_box, config)?;
    let refused = match way.fly(start, config) {
        Ok(flight) => return Ok(way.plan(flight, goal)),
        Err(error) => error,
    };
    // Moving too fast for that bend: once more with room to brake, by way of the point where it would come to rest.
    let rest = stop_trajectory(start, &config.limits).sample(f64::MAX).p;
    let way = way_through(start, Some((rest, refused)), goal, distance, obstacles_in_box, config)?;
    let flight = way.fly(start, config).map_err(AirPlanError::NotProved)?;
    Ok(way.plan(flight, goal))
}

/// A route and its corridor, still without times.
struct Way {
    route: Vec<Vector3<f64>>,
    corridor: Vec<Polytope>,
    kept_m: f64,
    end: Point3<f64>,
    expansions: usize,
}

impl Way {
    /// Step 4: to rest at the end of the route, proved.
    fn fly(&self, start: &FlightState, config: &AirConfig) -> Result<CorridorFlight, CorridorError> {
        let zero = Vector3::zeros();
        let head = [start.p.coords, start.v, start.a];
        fly_corridor(
            &head,
            &[self.end.coords, zero, zero],
            &self.corridor,
            &config.limits,
            &InteriorSettings::default(),
        )
    }

    fn plan(self, flight: CorridorFlight, goal: &Point3<f64>) -> AirPlan {
        AirPlan {
            trajectory: flight.trajectory,
            corridor: self.corridor,
            polytope_of: flight.polytope_of,
            proof: flight.proof,
            clearance_m: self.kept_m,
            route: self.route.into_iter().map(Point3::from).collect(),
            goal_pull_m: (self.end - goal).norm(),
            expansions: self.expansions,
        }
    }
}

/// Steps 1 to 3. With `brake_to` the first leg leads straight there; if it cannot, what was refused before stays refused.
fn way_through(
    start: &FlightState,
    brake_to: Option<(Point3<f64>, CorridorError)>,
    goal: &Point3<f64>,
    distance: &dyn Fn(&Point3<f64>) -> Option<f64>,
    obstacles_in_box: ObstaclesInBox,
    config: &AirConfig,
) -> Result<Way, AirPlanError> {
    let mut grid = SearchGrid::new(&start.p, goal, distance, config);
    if !grid.is_usable() {
        return Err(AirPlanError::TooFar);
    }
    let from = brake_to.map_or(start.p, |(rest, _)| rest);
    let mut expansions = 0;
    for _ in 0..=RETRIES {
        // 1. A* between free lattice points near start and goal.
        let (mut points_of_route, end) = match lattice_route(&from, goal, &grid, config, &mut expansions) {
            Err(AirPlanError::NoRoute | AirPlanError::GoalBlocked | AirPlanError::StartBlocked) if grid.relax() => {
                lattice_route(&from, goal, &grid, config, &mut expansions)?
            }
            other => other?,
        };
        // 2. The exact points, and the route with its bends cut where that is not dearer.
        let (low, high) = bounds_of(&points_of_route, &start.p, &grid, config);
        let beyond = Vector3::repeat(config.clearance_m() + config.obstacle_radius_m);
        let points = obstacles_in_box(&(low - beyond), &(high + beyond));
        let surroundings = Surroundings::new(&points, &start.p, &low, &high, &grid, config);
        if let Some((rest, refused)) = brake_to
            && !surroundings.is_clear(&start.p.coords, &rest.coords)
        {
            return Err(AirPlanError::NotProved(refused));
        }
        let inner = 1..points_of_route.len() - 1;
        points_of_route[inner].iter_mut().for_each(|p| *p = surroundings.centred(p));
        let mut route = match shortcut(&points_of_route, &surroundings, &grid, goal_height(goal, config), config) {
            Ok(route) => route,
            Err(place) => {
                grid.forbid(&place);
                continue;
            }
        };
        if brake_to.is_some() {
            route.insert(0, start.p.coords);
        }
        // 3. One polytope per leg.
        let corridor: Vec<Polytope> = route
            .windows(2)
            .map(|leg| polytope_around(&leg[0], &leg[1], config.corridor_reach_m, &low, &high, &surroundings))
            .collect();
        let kept_m = kept_clearance(start, &points, config);
        return Ok(Way { route, corridor, kept_m, end, expansions });
    }
    Err(AirPlanError::NoRoute)
}

fn check(start: &FlightState, goal: &Point3<f64>, config: &AirConfig) -> Result<(), AirPlanError> {
    config.validate()?;
    let numbers = start.p.iter().chain(start.v.iter()).chain(start.a.iter()).chain(goal.iter());
    // 1e6 m: beyond that a lattice index would not be exact.
    if numbers.into_iter().any(|x| !(x.is_finite() && x.abs() < 1e6)) {
        return Err(AirPlanError::NotFinite);
    }
    let (speed_mps, accel_mps2) = (start.v.norm(), start.a.norm());
    if speed_mps > config.limits.max_speed_mps || accel_mps2 > config.limits.max_accel_mps2 {
        return Err(AirPlanError::StartTooFast { speed_mps, accel_mps2 });
    }
    Ok(())
}

/// What the corridor keeps from obstacle surfaces: less than asked for only where the start itself is nearer.
fn kept_clearance(start: &FlightState, points: &[Point3<f64>], config: &AirConfig) -> f64 {
    points.iter().map(|p| (p - start.p).norm() - config.obstacle_radius_m - THINNEST_M).fold(config.clearance_m(), f64::min)
}
