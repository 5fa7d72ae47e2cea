//! The aerial planner: A* -> shortcut -> convex corridor -> flight -> proof.
//!
//! What is returned is a commitment: it ends at rest in known space, whatever may be learnt on the way. Where the goal is further
//! than the horizon or behind what nobody has seen, it ends before that, and the next plan begins while it is flown.

use nalgebra::{Point3, Vector3};

use crate::air::FlightState;
use crate::air::config::{AirConfig, AirConfigError};
use crate::air::corridor::polytope_around;
use crate::air::corridor_flight::{CorridorError, CorridorFlight, by_barrier};
use crate::air::interior::InteriorSettings;
use crate::air::limits::FlightLimits;
use crate::air::movers::{Mover, Movers};
use crate::air::obstacles::{Surroundings, THINNEST_M};
use crate::air::polytope::Polytope;
use crate::air::proof::FlightProof;
use crate::air::route::{bounds_of, goal_height, lattice_route, shortcut};
use crate::air::search::SearchGrid;
use crate::air::stop::stop_trajectory;
use crate::air::swept::Swept;
use crate::air::trajectory::PolynomialTrajectory;

/// Lists the obstacle points in a box, given its low and its high corner.
pub type ObstaclesInBox<'a> = dyn Fn(&Point3<f64>, &Point3<f64>) -> Vec<Point3<f64>> + 'a;

/// What a planner may ask about the world. All of it must tell of the same map.
#[derive(Clone, Copy)]
pub struct AirSpace<'a> {
    /// Distance from a point to the nearest obstacle *point* (cell centre), `None` where unknown, which counts as blocked.
    pub distance: &'a dyn Fn(&Point3<f64>) -> Option<f64>,
    /// Obstacle points in a box.
    pub obstacles: &'a ObstaclesInBox<'a>,
    /// What moves, as it is when the flight begins.
    pub movers: &'a [Mover],
}

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
    /// How far the end is from the goal that was asked for (0 unless that was not free, or is beyond the flight's end).
    pub goal_pull_m: f64,
    /// Length of the route beyond the end: 0 where the flight leads to the goal, or to the free point near it.
    pub left_m: f64,
    /// Lattice points the search expanded.
    pub expansions: usize,
}

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
    /// Start or goal is outside the fence.
    #[error("the {end} is {outside_m} m outside the fence")]
    OutsideFence {
        /// Which.
        end: &'static str,
        /// By how much.
        outside_m: f64,
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
    /// There are flights, but something that moves comes too near to each that was tried, slower ones and ways round it too.
    #[error("something that moves would come {missing_m} m too near")]
    MoverInTheWay {
        /// What is missing on the first flight that was tried.
        missing_m: f64,
    },
}

/// Routes that an exact check refuses are searched again at most this often.
const RETRIES: usize = 5;
/// Shares of the speed limit at which a flight is tried where something moves: it may have passed by then.
const SLOWER: [f64; 2] = [0.5, 0.25];
/// A part of a way is worth a flight from this length on (m).
const LEAST_PART_M: f64 = 0.5;

/// Plans a flight to rest at `goal`, or to the last point of the way there that is known and within the horizon.
///
/// Deterministic; the work is bounded by counts.
///
/// # Errors
/// [`AirPlanError`]. A flight that is not proved is never returned.
pub fn plan_air(
    start: &FlightState,
    goal: &Point3<f64>,
    space: &AirSpace,
    config: &AirConfig,
) -> Result<AirPlan, AirPlanError> {
    check(start, goal, config)?;
    let first = plan_still(start, goal, space, config);
    if space.movers.is_empty() {
        return first;
    }
    let movers = Movers { list: space.movers, keep_m: config.clearance_m(), horizon_s: config.prediction_s };
    let plan = first?.among(&movers);
    if plan.proof.holds {
        return Ok(plan);
    }
    // Behind it, or round all it will pass: the quickest that is proved and leads as far.
    let slower = SLOWER.iter().filter_map(|share| {
        let limits = FlightLimits { max_speed_mps: share * config.limits.max_speed_mps, ..config.limits };
        plan_still(start, goal, space, &AirConfig { limits, ..config.clone() }).ok()
    });
    let swept = Swept::new(&movers, config.obstacle_radius_m);
    let distance = |p: &Point3<f64>| (space.distance)(p).map(|d| d.min(swept.distance_m(p)));
    let obstacles = |low: &Point3<f64>, high: &Point3<f64>| {
        let mut points = (space.obstacles)(low, high);
        points.extend(swept.points_in(low, high));
        points
    };
    let around = AirSpace { distance: &distance, obstacles: &obstacles, movers: &[] };
    slower
        .chain(plan_still(start, goal, &around, config).ok())
        .map(|plan| plan.among(&movers))
        .filter(|other| other.proof.holds && other.left_m <= plan.left_m)
        .min_by(|a, b| a.trajectory.duration().total_cmp(&b.trajectory.duration()))
        .ok_or(AirPlanError::MoverInTheWay { missing_m: -plan.proof.mover_slack_m })
}

/// The flight if nothing moves.
fn plan_still(
    start: &FlightState,
    goal: &Point3<f64>,
    space: &AirSpace,
    config: &AirConfig,
) -> Result<AirPlan, AirPlanError> {
    let way = way_through(start, None, goal, space, config)?;
    let refused = match way.fly(start, config) {
        Ok(flight) => return Ok(way.plan(flight, goal)),
        Err(error) => error,
    };
    // Moving too fast for that bend: once more with room to brake, by way of the point where it would come to rest.
    let rest = stop_trajectory(start, &config.limits).sample(f64::MAX).p;
    let way = way_through(start, Some((rest, refused)), goal, space, config)?;
    let flight = way.fly(start, config).map_err(AirPlanError::NotProved)?;
    Ok(way.plan(flight, goal))
}

impl AirPlan {
    /// The same plan, its proof extended to what moves.
    fn among(mut self, movers: &Movers) -> AirPlan {
        self.proof.mover_slack_m = movers.slack_m(&self.trajectory);
        self.proof.holds &= self.proof.mover_slack_m >= 0.0;
        self
    }
}

/// A route and its corridor, still without times.
struct Way {
    route: Vec<Vector3<f64>>,
    corridor: Vec<Polytope>,
    kept_m: f64,
    end: Point3<f64>,
    left_m: f64,
    expansions: usize,
}

impl Way {
    /// Step 4: to rest at the end of the route, proved.
    fn fly(&self, start: &FlightState, config: &AirConfig) -> Result<CorridorFlight, CorridorError> {
        let zero = Vector3::zeros();
        let head = [start.p.coords, start.v, start.a];
        by_barrier(&head, &[self.end.coords, zero, zero], &self.corridor, &config.limits, &InteriorSettings::default())
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
            left_m: self.left_m,
            expansions: self.expansions,
        }
    }
}

/// Steps 1 to 3. With `brake_to` the first leg leads straight there; if it cannot, what was refused before stays refused.
fn way_through(
    start: &FlightState,
    brake_to: Option<(Point3<f64>, CorridorError)>,
    goal: &Point3<f64>,
    space: &AirSpace,
    config: &AirConfig,
) -> Result<Way, AirPlanError> {
    let mut grid = SearchGrid::new(&start.p, goal, space.distance, config);
    if !grid.is_usable() {
        return Err(AirPlanError::TooFar);
    }
    let from = brake_to.map_or(start.p, |(rest, _)| rest);
    let mut expansions = 0;
    for _ in 0..=RETRIES {
        // 1. A* between free lattice points near start and goal: through the known, through gaps that the lattice misses, and as
        //    the last hope through the unknown, of which nothing will be flown.
        let mut found = lattice_route(&from, goal, &grid, config, &mut expansions);
        if is_closed(&found) && grid.relax() {
            found = lattice_route(&from, goal, &grid, config, &mut expansions);
        }
        if matches!(found, Err(AirPlanError::NoRoute | AirPlanError::GoalBlocked)) && grid.hope() {
            found = lattice_route(&from, goal, &grid, config, &mut expansions).or(found);
        }
        let (whole, end) = found?;
        let (mut points_of_route, left_m) = known_part(&whole, &start.p.coords, &grid, config);
        let end = if left_m > 0.0 { Point3::from(points_of_route[points_of_route.len() - 1]) } else { end };
        if left_m > 0.0 && length_of(&points_of_route) < LEAST_PART_M {
            // It is there, and what it cannot see from here it will not see: round that, if there is a way.
            let stuck_at = Point3::from(whole[points_of_route.len().min(whole.len() - 1)]);
            if grid.node(&stuck_at).is_none_or(|node| grid.clearance(node).is_none()) {
                return Err(AirPlanError::NoRoute);
            }
            grid.forbid(&stuck_at);
            continue;
        }
        // 2. The exact points, and the route with its bends cut where that is not dearer.
        let (low, high) = bounds_of(&points_of_route, &start.p, &grid, config);
        let beyond = Vector3::repeat(config.clearance_m() + config.obstacle_radius_m);
        let points = (space.obstacles)(&(low - beyond), &(high + beyond));
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
            .map(|leg| {
                let mut polytope =
                    polytope_around(&leg[0], &leg[1], config.corridor_reach_m, &low, &high, &surroundings);
                polytope.faces.extend(config.geofence.iter().flat_map(|fence| fence.faces()));
                polytope
            })
            .collect();
        let kept_m = kept_clearance(start, &points, config);
        return Ok(Way { route, corridor, kept_m, end, left_m, expansions });
    }
    Err(AirPlanError::NoRoute)
}

/// Whether a search met a closed end.
fn is_closed<T>(found: &Result<T, AirPlanError>) -> bool {
    matches!(found, Err(AirPlanError::NoRoute | AirPlanError::GoalBlocked | AirPlanError::StartBlocked))
}

/// The part of a route along which all that the body will pass is known, within the horizon, and the length of the rest.
fn known_part(
    route: &[Vector3<f64>],
    start: &Vector3<f64>,
    grid: &SearchGrid,
    config: &AirConfig,
) -> (Vec<Vector3<f64>>, f64) {
    let is_known = |p: &Vector3<f64>| {
        let is_centre_known = grid.node(&Point3::from(*p)).is_some_and(|node| grid.clearance(node).is_some());
        is_centre_known && grid.is_known_around(p, start, false)
    };
    let mut length_m = 0.0;
    let mut kept = 1;
    while kept < route.len() {
        length_m += (route[kept] - route[kept - 1]).norm();
        if length_m > config.horizon_m || !is_known(&route[kept]) {
            break;
        }
        kept += 1;
    }
    while kept > 2 && kept < route.len() && !grid.is_known_around(&route[kept - 1], start, true) {
        kept -= 1;
    }
    // A route of one point leads nowhere; where even its second one is not known, the caller finds it too short.
    let kept = kept.max(2).min(route.len());
    (route[..kept].to_vec(), length_of(&route[kept - 1..]))
}

fn length_of(route: &[Vector3<f64>]) -> f64 {
    route.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
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
    for (end, point) in [("start", &start.p), ("goal", goal)] {
        let slack_m = config.geofence.as_ref().map_or(0.0, |fence| fence.slack_m(point));
        if slack_m < 0.0 {
            return Err(AirPlanError::OutsideFence { end, outside_m: -slack_m });
        }
    }
    Ok(())
}

/// What the corridor keeps from obstacle surfaces: less than asked for only where the start itself is nearer.
fn kept_clearance(start: &FlightState, points: &[Point3<f64>], config: &AirConfig) -> f64 {
    points
        .iter()
        .map(|p| (p - start.p).norm() - config.obstacle_radius_m - THINNEST_M)
        .fold(config.clearance_m(), f64::min)
}
