//! The route of a flight: a lattice search between free points near start and goal, then its bends cut.

use nalgebra::{Point3, Vector3};

use super::config::AirConfig;
use super::obstacles::Surroundings;
use super::search::{SearchGrid, SearchOutcome};
use crate::aerial::AirPlanError;

/// A start that is not free may move this far to a free lattice point.
const START_PULL_M: f64 = 0.6;

/// A lattice route with the exact start in front and, if it is free, the exact goal at the end; and where it ends.
pub(crate) fn lattice_route(
    start: &Point3<f64>,
    goal: &Point3<f64>,
    grid: &SearchGrid,
    config: &AirConfig,
    expansions: &mut usize,
) -> Result<(Vec<Vector3<f64>>, Point3<f64>), AirPlanError> {
    let from = grid.nearest_free(start, START_PULL_M).ok_or(AirPlanError::StartBlocked)?;
    let own = grid.node(goal).filter(|&node| grid.is_free(node));
    let to = match own {
        Some(node) => node,
        None => grid.nearest_free(goal, config.goal_pull_m).ok_or(AirPlanError::GoalBlocked)?,
    };
    match grid.search(from, to, goal_height(goal, config), config, expansions) {
        SearchOutcome::NoRoute => Err(AirPlanError::NoRoute),
        SearchOutcome::ExpansionLimit => Err(AirPlanError::SearchLimit { expansions: *expansions }),
        SearchOutcome::Found(points) => {
            let end = if own.is_some() { *goal } else { grid.position(to) };
            let mut route = vec![start.coords];
            route.extend(points.iter().map(|p| p.coords));
            if own.is_some() {
                route.push(end.coords);
            }
            Ok((route, end))
        }
    }
}

/// The box of the start and the route grown by what its corridor can reach, inside what was searched.
pub(crate) fn bounds_of(
    route: &[Vector3<f64>],
    start: &Point3<f64>,
    grid: &SearchGrid,
    config: &AirConfig,
) -> (Point3<f64>, Point3<f64>) {
    let reach = Vector3::repeat(config.corridor_reach_m);
    let low = route.iter().fold(start.coords, |m, p| m.inf(p)) - reach;
    let high = route.iter().fold(start.coords, |m, p| m.sup(p)) + reach;
    let (grid_low, grid_high) = grid.bounds();
    (Point3::from(low.sup(&grid_low.coords)), Point3::from(high.inf(&grid_high.coords)))
}

/// Cuts bends: from each kept point to the furthest later one that is clear and not dearer than the way round.
/// `Err`: where the exact check refuses a leg.
pub(crate) fn shortcut(
    route: &[Vector3<f64>],
    surroundings: &Surroundings,
    grid: &SearchGrid,
    preferred_z: f64,
    config: &AirConfig,
) -> Result<Vec<Vector3<f64>>, Point3<f64>> {
    let price =
        |p: &Vector3<f64>| grid.node(&Point3::from(*p)).map_or(1.0, |node| grid.price(node, preferred_z, config));
    let cost = |a: &Vector3<f64>, b: &Vector3<f64>| {
        let length = (b - a).norm();
        let steps = (length / (2.0 * config.search_resolution_m)).ceil().max(1.0) as usize;
        (0..steps).map(|k| price(&(a + (b - a) * ((k as f64 + 0.5) / steps as f64)))).sum::<f64>() * length
            / steps as f64
    };
    let mut along = vec![0.0];
    for leg in route.windows(2) {
        along.push(along[along.len() - 1] + cost(&leg[0], &leg[1]));
    }
    let mut kept = vec![route[0]];
    let mut at = 0;
    while at + 1 < route.len() {
        let good = |to: usize| {
            let way_round = along[to] - along[at];
            cost(&route[at], &route[to]) <= 1.1 * way_round + 1e-9 && surroundings.is_clear(&route[at], &route[to])
        };
        // The furthest of a ladder of lengths, then refined by bisection.
        let mut next = at;
        let mut stride = 1;
        while at + stride < route.len() && good(at + stride) {
            next = at + stride;
            stride *= 2;
        }
        if next == at {
            // Not even the single step is clear (or it costs more than itself, which cannot be).
            if !surroundings.is_clear(&route[at], &route[at + 1]) {
                return Err(Point3::from(route[if at == 0 { 1 } else { at }]));
            }
            next = at + 1;
        }
        let mut beyond = (at + stride).min(route.len());
        while beyond - next > 1 {
            let middle = next + (beyond - next) / 2;
            if good(middle) {
                next = middle;
            } else {
                beyond = middle;
            }
        }
        if (route[next] - route[at]).norm() > 1e-9 {
            kept.push(route[next]);
        }
        at = next;
    }
    if kept.len() == 1 {
        kept.push(route[route.len() - 1]);
    }
    Ok(kept)
}

pub(crate) fn goal_height(goal: &Point3<f64>, config: &AirConfig) -> f64 {
    config.preferred_height_m.unwrap_or(goal.z)
}
