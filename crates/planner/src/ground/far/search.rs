//! Ways to a goal: A* over the nodes, with the edges to start and goal measured only where the search asks for them.
//!
//! FAR keeps a goal as a node with votes. Here a goal costs nothing until it is asked for: a node is tried as the last one when the search
//! takes it up, a first node is measured when its turn comes, so a search measures about as many segments as it expands nodes.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Point3;

use super::DynamicVisibilityGraph;
use super::memory::Spot;
use super::node::NodeKind;
use super::tile::Through;
use super::window::is_sane;

/// A start nearer to an obstacle than the clearance is moved at most this far.
const MAX_PULL_M: f64 = 0.75;
/// Start and goal may be this many cells apart: 3 km at 15 cm.
const MOST_CELLS: f64 = 20_000.0;

/// Sine of the angle by which the first and the last leg may cut into a surface: more than edges may, because a node that was pulled tight in a
/// gap may have to do for the vertex that found no room there.
const END_SLACK: f64 = 0.35;

/// A way with its bends.
#[derive(Debug, Clone, PartialEq)]
pub struct FarRoute {
    /// From the start to the goal, both moved into free space if they were not free: at least two points.
    pub points: Vec<Point3<f64>>,
    /// For each point whether it is a node, and of which kind.
    pub kinds: Vec<Option<NodeKind>>,
    /// Sum of the legs.
    pub length_m: f64,
    /// What the way leads through: an attempt may turn out to be none.
    pub through: Through,
    /// How far the start was moved.
    pub start_pull_m: f64,
    /// How far the goal was moved.
    pub goal_pull_m: f64,
}

/// Why there is no way.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoRoute {
    /// A coordinate is not finite, or start and goal are more than 20,000 cells apart.
    #[error("start and goal must be finite and at most 20,000 cells apart")]
    NotAPlace,
    /// Nothing free within 0.75 m of the start.
    #[error("there is no room for the robot within 0.75 m of the start")]
    StartBlocked,
    /// Nothing free within the goal's radius.
    #[error(
        "there is no room for the robot at the goal or near it; the nearest node that can be reached is {off_m:.1} m from it"
    )]
    GoalBlocked {
        /// A place that can be reached, the node nearest to the goal.
        nearest: Point3<f64>,
        /// How far from the goal that is.
        off_m: f64,
    },
    /// Both are free, and nothing joins them.
    #[error("no way leads from the start to the goal; the nearest node that can be reached is {off_m:.1} m from it")]
    Apart {
        /// A place that can be reached, the node nearest to the goal.
        nearest: Point3<f64>,
        /// How far from the goal that is.
        off_m: f64,
    },
}

/// Whether a segment can be measured in bounded time.
pub(crate) fn are_near(a: &Spot, b: &Spot) -> bool {
    (a.at - b.at).norm() <= MOST_CELLS
}

impl DynamicVisibilityGraph {
    /// The shortest way through what is known to be free; failing that, an attempt through what was not seen; failing that, a way on the
    /// lattice of cells, for gaps that only the robot's circle fits through (milliseconds, where the others take a fraction of one).
    ///
    /// # Errors
    /// Why there is none, with the reachable node nearest to the goal.
    pub fn route(&self, start: &Point3<f64>, goal: &Point3<f64>) -> Result<FarRoute, NoRoute> {
        // A known way to another place than the goal is worth less than an attempt at the goal.
        let known = self.known_route(start, goal);
        if let Some(route) = known.as_ref().filter(|route| route.goal_pull_m == 0.0) {
            return Ok(route.clone());
        }
        let attempt = self.route_through(start, goal, Through::Unknown);
        attempt.or_else(|reason| known.or_else(|| self.route_through_gap(start, goal)).ok_or(reason))
    }

    /// The way on the lattice, through the known if there is one.
    pub(super) fn route_through_gap(&self, start: &Point3<f64>, goal: &Point3<f64>) -> Option<FarRoute> {
        let (given_start, given_goal) = (self.spot(start), self.spot(goal));
        let is_level = (start.z - goal.z).abs() <= self.config.same_layer_m;
        if !(is_sane(start) && is_sane(goal) && is_level && are_near(&given_start, &given_goal)) {
            return None;
        }
        [Through::Known, Through::Unknown].into_iter().find_map(|through| {
            let (from, to) = self.free_ends(&given_start, &given_goal, through).ok()?;
            let way = self.memory.lattice_way(&from, &to, through)?;
            let kinds = vec![None; way.len()];
            Some(self.route_of(way, kinds, through, &given_start, &given_goal))
        })
    }

    /// The shortest way through the known, without asking why there is none.
    pub(super) fn known_route(&self, start: &Point3<f64>, goal: &Point3<f64>) -> Option<FarRoute> {
        let (given_start, given_goal) = (self.spot(start), self.spot(goal));
        let is_sane = is_sane(start) && is_sane(goal) && are_near(&given_start, &given_goal);
        let (from, to) = is_sane.then(|| self.free_ends(&given_start, &given_goal, Through::Known).ok())??;
        let slots = self.search(&from, Some(&to), &to, Through::Known).0?;
        Some(self.route_over(&from, &slots, &to, Through::Known, (&given_start, &given_goal)))
    }

    /// The shortest way of one sort. Every leg keeps the clearance from every square last seen occupied (and, through the known, from all that
    /// was not seen free), exactly; moved ends excepted.
    ///
    /// # Errors
    /// As [`DynamicVisibilityGraph::route`].
    pub fn route_through(
        &self,
        start: &Point3<f64>,
        goal: &Point3<f64>,
        through: Through,
    ) -> Result<FarRoute, NoRoute> {
        let (given_start, given_goal) = (self.spot(start), self.spot(goal));
        if !(is_sane(start) && is_sane(goal) && are_near(&given_start, &given_goal)) {
            return Err(NoRoute::NotAPlace);
        }
        let (from, to) = match self.free_ends(&given_start, &given_goal, through) {
            Ok(ends) => ends,
            Err(None) => return Err(NoRoute::StartBlocked),
            Err(Some(from)) => {
                let (nearest, off_m) = self.search(&from, None, &given_goal, through).1;
                return Err(NoRoute::GoalBlocked { nearest, off_m });
            }
        };
        let (found, (nearest, off_m)) = self.search(&from, Some(&to), &to, through);
        let Some(slots) = found else { return Err(NoRoute::Apart { nearest, off_m }) };
        Ok(self.route_over(&from, &slots, &to, through, (&given_start, &given_goal)))
    }

    fn route_over(&self, from: &Spot, slots: &[u32], to: &Spot, through: Through, given: (&Spot, &Spot)) -> FarRoute {
        let mut spots = vec![*from];
        let mut kinds = vec![None];
        for node in slots.iter().filter_map(|slot| self.node(*slot)) {
            spots.push(node.spot());
            kinds.push(Some(node.kind));
        }
        spots.push(*to);
        kinds.push(None);
        self.route_of(spots, kinds, through, given.0, given.1)
    }

    /// Start and goal moved into free space; the start alone if there is none for the goal, nothing if there is none for the start.
    fn free_ends(&self, start: &Spot, goal: &Spot, through: Through) -> Result<(Spot, Spot), Option<Spot>> {
        let from = self.freed(start, MAX_PULL_M / self.config.voxel_m, through).ok_or(None)?;
        let to = self.freed(goal, self.config.goal_adjust_radius_m / self.config.voxel_m, through).ok_or(Some(from))?;
        Ok((from, to))
    }

    fn route_of(
        &self,
        spots: Vec<Spot>,
        kinds: Vec<Option<NodeKind>>,
        through: Through,
        start: &Spot,
        goal: &Spot,
    ) -> FarRoute {
        let points: Vec<Point3<f64>> = spots.iter().map(|spot| self.world(spot)).collect();
        let length_m = points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        let off_m = |a: &Spot, b: Option<&Spot>| b.map_or(0.0, |b| (a.at - b.at).norm() * self.config.voxel_m);
        let (start_pull_m, goal_pull_m) = (off_m(start, spots.first()), off_m(goal, spots.last()));
        FarRoute { points, kinds, length_m, through, start_pull_m, goal_pull_m }
    }

    /// The spot itself if it is free, else the nearest free lattice point within reach.
    fn freed(&self, spot: &Spot, reach: f64, through: Through) -> Option<Spot> {
        match self.memory.is_free(spot, through) {
            true => Some(*spot),
            false => self.memory.nearest_free(spot, reach, through, |_| true),
        }
    }

    /// A* from a free spot. Slots of the nodes between start and goal if there is a way; and the reached node (or the start) nearest to
    /// `target`, with its distance in metres.
    fn search(
        &self,
        from: &Spot,
        to: Option<&Spot>,
        target: &Spot,
        through: Through,
    ) -> (Option<Vec<u32>>, (Point3<f64>, f64)) {
        let memory = &self.memory;
        let off = |spot: &Spot| (spot.at - target.at).norm();
        let mut nearest = (off(from), self.world(from));
        if to.is_some_and(|to| memory.is_clear(from, to, through)) {
            return (Some(Vec::new()), (nearest.1, nearest.0 * self.config.voxel_m));
        }
        const START: u32 = u32::MAX;
        // Per slot: length of the way to it, the node before it, and whether it was expanded.
        let mut best = vec![(f64::INFINITY, START, false); self.nodes.len()];
        let mut open = BinaryHeap::new();
        let range = self.config.range_m / self.config.voxel_m;
        let mut near = Vec::new();
        self.nodes_near(&from.at, range, from.floor_m, &mut near);
        for slot in near {
            let Some(node) = self.node(slot) else { continue };
            let across = node.vertex.at - from.at;
            let length = across.norm();
            if length <= range && node.vertex.is_taut(&across, length, END_SLACK) {
                open.push(Step { bound: length + off(&node.spot()), length, slot, before: START });
            }
        }
        let mut end: Option<(f64, u32)> = None;
        while let Some(step) = open.pop() {
            if end.is_some_and(|(length, _)| step.bound >= length) {
                break;
            }
            let (_, _, is_expanded) = best[step.slot as usize];
            let Some(node) = self.node(step.slot).filter(|_| !is_expanded) else { continue };
            let spot = node.spot();
            if step.before == START && !memory.is_clear(from, &spot, through) {
                continue;
            }
            best[step.slot as usize] = (step.length, step.before, true);
            let left = off(&spot);
            if left < nearest.0 {
                nearest = (left, self.world(&spot));
            }
            if let Some(to) = to {
                let across = to.at - spot.at;
                let (left, whole) = (across.norm(), step.length + across.norm());
                let is_shorter = end.is_none_or(|(length, _)| whole < length);
                if is_shorter && node.vertex.is_taut(&across, left, END_SLACK) && memory.is_clear(&spot, to, through) {
                    end = Some((whole, step.slot));
                }
            }
            for link in &node.links {
                let pair = &self.edges.pairs[link.pair as usize];
                let length = step.length + pair.length;
                let known = best[link.to as usize];
                if known.2 || length >= known.0 || !pair.is_usable(through) {
                    continue;
                }
                let Some(other) = self.node(link.to) else { continue };
                best[link.to as usize] = (length, step.slot, false);
                let bound = length + (other.vertex.at - target.at).norm();
                open.push(Step { bound, length, slot: link.to, before: step.slot });
            }
        }
        let slots = end.map(|(_, last)| {
            let mut slots = Vec::new();
            let mut slot = last;
            while slot != START {
                slots.push(slot);
                slot = best[slot as usize].1;
            }
            slots.reverse();
            slots
        });
        (slots, (nearest.1, nearest.0 * self.config.voxel_m))
    }
}

/// An entry of the queue: smallest bound first, ties by slot, so that searches are the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    bound: f64,
    length: f64,
    slot: u32,
    before: u32,
}

impl Eq for Step {}

impl Ord for Step {
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound.total_cmp(&self.bound).then(other.slot.cmp(&self.slot)).then(other.before.cmp(&self.before))
    }
}

impl PartialOrd for Step {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
