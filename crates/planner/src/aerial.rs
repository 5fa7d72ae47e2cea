//! The aerial planner: A* -> shortcut -> convex corridor -> MINCO -> certificate.

use nalgebra::{Point3, Vector3};

use crate::air::FlightState;
use crate::air::certificate::Certificate;
use crate::air::config::{AirConfig, AirConfigError};
use crate::air::corridor::polytope_around;
use crate::air::obstacles::Surroundings;
use crate::air::polytope::Polytope;
use crate::air::refine::{Refined, refine};
use crate::air::route::{bounds_of, goal_height, lattice_route, shortcut};
use crate::air::search::SearchGrid;
use crate::air::stop::stop_piece;
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
    pub certificate: Certificate,
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
    /// The start moves so that no certified flight was found, not even one that brakes first.
    #[error("no certified trajectory from this moving start: too near to something, or too fast")]
    NotCertified,
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
/// [`AirPlanError`]. A trajectory that is not certified is never returned.
pub fn plan_air(
    start: &FlightState,
    goal: &Point3<f64>,
    distance: &dyn Fn(&Point3<f64>) -> Option<f64>,
    obstacles_in_box: ObstaclesInBox,
    config: &AirConfig,
) -> Result<AirPlan, AirPlanError> {
    check(start, goal, config)?;
    let way = way_through(start, None, goal, distance, obstacles_in_box, config)?;
    let head = [start.p.coords, start.v, start.a];
    if let Some(refined) = refine(&head, &way.route, &way.corridor, way.kept_m, config) {
        return Ok(way.plan(refined, goal));
    }
    // Moving too fast for that bend: once more with room to brake, from the point where it would come to rest.
    let brake = stop_piece(&head, config.max_accel_mps2);
    let rest = Point3::from(brake.sample(brake.duration_s).p.coords);
    let way = way_through(start, Some(rest), goal, distance, obstacles_in_box, config)?;
    let refined = refine(&head, &way.route, &way.corridor, way.kept_m, config).ok_or(AirPlanError::NotCertified)?;
    Ok(way.plan(refined, goal))
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
    fn plan(self, refined: Refined, goal: &Point3<f64>) -> AirPlan {
        AirPlan {
            trajectory: refined.trajectory,
            corridor: self.corridor,
            polytope_of: refined.polytope_of,
            certificate: refined.certificate,
            route: self.route.into_iter().map(Point3::from).collect(),
            goal_pull_m: (self.end - goal).norm(),
            expansions: self.expansions,
        }
    }
}

/// Steps 1 to 3. With `brake_to`, the first leg leads straight there.
fn way_through(
    start: &FlightState,
    brake_to: Option<Point3<f64>>,
    goal: &Point3<f64>,
    distance: &dyn Fn(&Point3<f64>) -> Option<f64>,
    obstacles_in_box: ObstaclesInBox,
    config: &AirConfig,
) -> Result<Way, AirPlanError> {
    let mut grid = SearchGrid::new(&start.p, goal, distance, config);
    if !grid.is_usable() {
        return Err(AirPlanError::TooFar);
    }
    let from = brake_to.unwrap_or(start.p);
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
        if brake_to.is_some_and(|rest| !surroundings.is_clear(&start.p.coords, &rest.coords)) {
            return Err(AirPlanError::NotCertified);
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
    if speed_mps > config.max_speed_mps || accel_mps2 > config.max_accel_mps2 {
        return Err(AirPlanError::StartTooFast { speed_mps, accel_mps2 });
    }
    Ok(())
}

/// What the corridor keeps from obstacle surfaces: less than asked for only where the start itself is nearer.
fn kept_clearance(start: &FlightState, points: &[Point3<f64>], config: &AirConfig) -> f64 {
    points.iter().map(|p| (p - start.p).norm() - config.obstacle_radius_m - 1e-6).fold(config.clearance_m(), f64::min)
}
