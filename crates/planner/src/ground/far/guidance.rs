//! From a goal to the next way-point, cycle by cycle: free way or attempt, when to keep the old way, where to drive to.

use nalgebra::Point3;

use super::DynamicVisibilityGraph;
use super::search::{FarRoute, NoRoute};
use super::tile::Through;

/// How near to a point counts as there, in m (FAR's `converge_distance`).
const CONVERGE_M: f64 = 0.5;
/// Cycles for which an old way is kept against a new one that turns back, and in which a lost way is driven on (`path_momentum`).
const MOMENTUM: u32 = 3;
/// Cycles at the goal until it counts as reached (`reach_goal_votes`).
const REACH_VOTES: u32 = 3;

/// Leads a robot to one goal. Call [`Guide::next`] once a cycle after the update.
#[derive(Debug, Clone)]
pub struct Guide {
    goal: Point3<f64>,
    route: Option<FarRoute>,
    momentum: u32,
    reached: u32,
    /// Whether a way through known space was there in one of the last cycles.
    known_ago: Option<u32>,
}

/// What to do now.
#[derive(Debug, Clone, PartialEq)]
pub enum Guidance {
    /// Drive to the way-point; `route` is where it leads.
    Drive {
        /// In sight of the robot with the full clearance, as far along the route's first leg as the local planner looks.
        waypoint: Point3<f64>,
        /// The whole way.
        route: FarRoute,
    },
    /// The robot is there.
    Arrived,
    /// There is no way, not even an attempt.
    NoWay(NoRoute),
}

impl Guide {
    /// A goal in the world (x, y, floor).
    pub fn new(goal: Point3<f64>) -> Self {
        Guide { goal, route: None, momentum: 0, reached: 0, known_ago: None }
    }

    /// The next way-point. Known free space first; if it has no way (for three cycles, after it had one), an attempt. The old
    /// way stays while it is clear and the new one would turn the robot round, for at most three cycles.
    pub fn next(&mut self, graph: &DynamicVisibilityGraph, robot: &Point3<f64>) -> Guidance {
        let is_near = |p: &Point3<f64>| (p.xy() - robot.xy()).norm() <= CONVERGE_M;
        let is_same_floor = (self.goal.z - robot.z).abs() <= graph.config().same_layer_m;
        let end = self.route.as_ref().and_then(|route| route.points.last().copied()).unwrap_or(self.goal);
        self.reached = if is_same_floor && is_near(&end) { self.reached + 1 } else { 0 };
        if self.reached >= REACH_VOTES {
            return Guidance::Arrived;
        }
        let fresh = self.plan(graph, robot);
        let route = match (fresh, self.kept(graph, robot)) {
            (Ok(fresh), Some(old)) if turns_back(&fresh, &old, robot) && self.momentum < MOMENTUM => {
                self.momentum += 1;
                old
            }
            (Ok(fresh), _) => {
                self.momentum = 0;
                fresh
            }
            (Err(_), Some(old)) if self.momentum < MOMENTUM => {
                self.momentum += 1;
                old
            }
            (Err(reason), _) => {
                self.route = None;
                return Guidance::NoWay(reason);
            }
        };
        self.route = Some(route.clone());
        let waypoint = waypoint(graph, &route, robot);
        Guidance::Drive { waypoint, route }
    }

    fn plan(&mut self, graph: &DynamicVisibilityGraph, robot: &Point3<f64>) -> Result<FarRoute, NoRoute> {
        match graph.known_route(robot, &self.goal) {
            // A goal that is moved is not reached: an attempt may reach it.
            Some(route) if route.goal_pull_m == 0.0 => {
                self.known_ago = Some(0);
                Ok(route)
            }
            known => {
                self.known_ago = self.known_ago.map(|ago| ago + 1).filter(|ago| *ago < MOMENTUM);
                if self.known_ago.is_some()
                    && let Some(old) = self.kept(graph, robot)
                {
                    return Ok(old);
                }
                let attempt = graph.route_through(robot, &self.goal, Through::Unknown);
                attempt.or_else(|reason| known.or_else(|| graph.route_through_gap(robot, &self.goal)).ok_or(reason))
            }
        }
    }

    /// The old way from where the robot is now, if all of it is still clear.
    fn kept(&self, graph: &DynamicVisibilityGraph, robot: &Point3<f64>) -> Option<FarRoute> {
        let old = self.route.as_ref()?;
        let n = old.points.len();
        // From the furthest point of it that is in sight.
        let next = (1..n).rev().find(|&k| graph.is_clear(robot, &old.points[k], old.through))?;
        let mut points = vec![*robot];
        points.extend(&old.points[next..]);
        let mut kinds = vec![None];
        kinds.extend(&old.kinds[next..]);
        let is_whole = points.windows(2).all(|leg| graph.is_clear(&leg[0], &leg[1], old.through));
        let length_m = points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        is_whole.then(|| FarRoute { points, kinds, length_m, start_pull_m: 0.0, ..old.clone() })
    }
}

/// Whether the first legs of two ways point in opposite directions.
fn turns_back(fresh: &FarRoute, old: &FarRoute, robot: &Point3<f64>) -> bool {
    let first = |route: &FarRoute| (route.points[1] - robot).xy();
    first(fresh).dot(&first(old)) < 0.0
}

/// The first point of the way that is not yet reached, moved on along its leg (FAR's extension) as far as the local planner looks and the
/// robot has a clear line to: it drives past a corner and not to it.
fn waypoint(graph: &DynamicVisibilityGraph, route: &FarRoute, robot: &Point3<f64>) -> Point3<f64> {
    let last = route.points.len() - 1;
    let ahead = (1..last).find(|&k| (route.points[k] - robot).norm() > CONVERGE_M).unwrap_or(last);
    // A bend that is nearly reached may still stand before the next.
    let is_in_sight = |k: &usize| graph.is_clear(robot, &route.points[*k], route.through);
    let ahead = (1..=ahead).rev().find(is_in_sight).unwrap_or(1);
    let point = route.points[ahead];
    let leg = point - robot;
    let length = leg.norm();
    let range = graph.config().local_planner_range_m;
    if ahead == last || length >= range || length < 1e-9 {
        return point;
    }
    let step = graph.config().near_m;
    let steps = ((range - length) / step).floor() as u32;
    let extended = |k: u32| point + leg * (f64::from(k) * step / length);
    (1..=steps).map(extended).take_while(|p| graph.is_clear(robot, p, route.through)).last().unwrap_or(point)
}
