//! The shortest way between polygons: what a floor plan knows exactly.
//!
//! ```text
//! rings --triangles--> free space --sight--> corners that see each other
//!     both ends taut --> tangents: a rubber band round obstacles uses no other edges
//! start, goal --sight--> tangents to them --A*--> shortest way
//! ```
//!
//! A point robot may touch walls and corners. Sides are decided by exact predicates, so nothing depends on a tolerance; lengths are
//! sums of rounded square roots. A corner is passed with its obstacle on the left or on the right: two nodes of the search, which
//! halves the branches.

use std::cell::Cell;
use std::collections::BinaryHeap;

use nalgebra::Point2;

use super::lattice::Entry;
use super::sight::{Bounds, Eye, Sight};
use super::triangles::{Triangles, turn};

/// Coordinates up to this: exact predicates do not overflow.
const LARGEST: f64 = 1e12;

/// What is wrong with a map of polygons.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PolygonError {
    /// A ring is no ring.
    #[error("ring {ring} has {count} corners; it needs three that are not on one line")]
    NoRing {
        /// 0 is the outer one, then the holes.
        ring: usize,
        /// Its corners.
        count: usize,
    },
    /// A coordinate is not finite or too large.
    #[error("corner {corner} of ring {ring} is not a number of at most 1e12")]
    NotFinite {
        /// 0 is the outer one, then the holes.
        ring: usize,
        /// From 0.
        corner: usize,
    },
    /// Two sides cross each other.
    #[error("the side from {from} to {to} crosses another one")]
    Crossing {
        /// One end.
        from: Point2<f64>,
        /// The other.
        to: Point2<f64>,
    },
    /// Rings touch, or a corner appears twice.
    #[error("rings touch each other, or a corner appears twice; move them apart or join them")]
    Touching,
    /// A hole lies outside of the outer ring, or in another hole.
    #[error("a hole lies outside of the outer ring or in another hole")]
    NotEnclosed,
    /// More corners than numbers for them.
    #[error("the map has too many corners")]
    TooLarge,
}

/// Why there is no way.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoWay {
    /// A coordinate is not finite.
    #[error("start or goal is not a finite point")]
    NotFinite,
    /// The start is in a wall, or in no part of the map.
    #[error("the start is {by}; the nearest free point is {nearest}")]
    StartBlocked {
        /// What it is in.
        by: Obstruction,
        /// The nearest free point.
        nearest: Point2<f64>,
    },
    /// The goal is in a wall, or in no part of the map.
    #[error("the goal is {by}; the nearest point that can be reached is {nearest}")]
    GoalBlocked {
        /// What it is in.
        by: Obstruction,
        /// The nearest point in the part of the start.
        nearest: Point2<f64>,
    },
    /// Both are free, and walls are between them everywhere.
    #[error("walls part start and goal; the nearest point that can be reached is {nearest}")]
    Unreachable {
        /// The nearest point in the part of the start.
        nearest: Point2<f64>,
    },
}

/// What a point is in that is not in free space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstruction {
    /// Beyond the outer ring: another building, or none.
    Outside,
    /// This hole, counted from 0: a wall, a piece of furniture.
    Hole(usize),
}

impl std::fmt::Display for Obstruction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Obstruction::Outside => f.write_str("outside of the map"),
            Obstruction::Hole(hole) => write!(f, "inside hole {hole} of the map"),
        }
    }
}

/// A shortest way.
#[derive(Debug, Clone, PartialEq)]
pub struct PolygonRoute {
    /// From start to goal, a point at each bend.
    pub points: Vec<Point2<f64>>,
    /// Sum of the legs.
    pub length: f64,
}

/// Free space between polygons, made ready for shortest ways.
#[derive(Debug, Clone)]
pub struct PolygonMap {
    triangles: Triangles,
    /// Points of the outer ring, then of each hole.
    rings: Vec<std::ops::Range<u32>>,
    /// Per point its neighbours on its ring, before and after, and whether a way can bend round it.
    neighbours: Vec<[u32; 2]>,
    is_bend: Vec<bool>,
    /// Tangents from each node (2 * point + side): `tangents[starts[node]..starts[node + 1]]`.
    tangents: Vec<Tangent>,
    starts: Vec<u32>,
}

/// A taut edge to a node.
#[derive(Debug, Clone, Copy)]
struct Tangent {
    node: u32,
    length: f64,
}

/// No node.
const NONE: u32 = u32::MAX;

/// How far it is to a node, and what is left at least.
#[derive(Debug, Clone, Copy)]
struct Reached {
    distance: f64,
    /// NaN until somebody asks.
    to_goal: f64,
    before: u32,
}

impl PolygonMap {
    /// `outer` encloses the free space, `holes` are taken out of it; either may turn either way. Any unit of length.
    ///
    /// # Errors
    /// [`PolygonError`].
    pub fn new(outer: &[Point2<f64>], holes: &[Vec<Point2<f64>>]) -> Result<PolygonMap, PolygonError> {
        let mut points: Vec<Point2<f64>> = Vec::new();
        let mut rings = Vec::new();
        for (ring, corners) in std::iter::once(outer).chain(holes.iter().map(Vec::as_slice)).enumerate() {
            if let Some(corner) = corners.iter().position(|p| !p.iter().all(|x| x.abs() <= LARGEST)) {
                return Err(PolygonError::NotFinite { ring, corner });
            }
            let area: f64 =
                corners.iter().zip(corners.iter().cycle().skip(1)).map(|(p, q)| p.coords.perp(&q.coords)).sum();
            if corners.len() < 3 || area == 0.0 {
                return Err(PolygonError::NoRing { ring, count: corners.len() });
            }
            let start = points.len();
            points.extend_from_slice(corners);
            // The free space on the left: outside round, holes the other way.
            if (area > 0.0) != (ring == 0) {
                points[start..].reverse();
            }
            let end =
                u32::try_from(points.len()).ok().filter(|end| *end < u32::MAX / 8).ok_or(PolygonError::TooLarge)?;
            rings.push(start as u32..end);
        }
        let mut neighbours = vec![[0; 2]; points.len()];
        for ring in &rings {
            for k in ring.clone() {
                let before = if k == ring.start { ring.end - 1 } else { k - 1 };
                (neighbours[k as usize][0], neighbours[before as usize][1]) = (before, k);
            }
        }
        let bends = |(p, [before, after]): (&Point2<f64>, &[u32; 2])| {
            turn(&points[*before as usize], p, &points[*after as usize]) <= 0.0
        };
        let is_bend = points.iter().zip(&neighbours).map(bends).collect();
        let triangles = Triangles::new(points, &rings)?;
        let mut map = PolygonMap { triangles, rings, neighbours, is_bend, tangents: Vec::new(), starts: Vec::new() };
        map.connect();
        Ok(map)
    }

    /// Corners of all rings.
    pub fn corner_count(&self) -> usize {
        self.neighbours.len()
    }

    /// Tangents between corners, each counted once.
    pub fn tangent_count(&self) -> usize {
        self.tangents.len() / 2
    }

    /// The shortest way.
    ///
    /// # Errors
    /// [`NoWay`] offers the nearest point that can be reached instead.
    pub fn route(&self, start: &Point2<f64>, goal: &Point2<f64>) -> Result<PolygonRoute, NoWay> {
        if !(start.coords.iter().chain(goal.coords.iter())).all(|x| x.abs() <= LARGEST) {
            return Err(NoWay::NotFinite);
        }
        let map = &self.triangles;
        let nearest = |part| map.nearest(goal, Some(part)).unwrap_or(*goal);
        let from = map.holding(start).ok_or_else(|| NoWay::StartBlocked {
            by: self.what_holds(start),
            nearest: map.nearest(start, None).unwrap_or(*start),
        })?;
        let part = map.part_of[from as usize];
        let to = map
            .holding(goal)
            .ok_or_else(|| NoWay::GoalBlocked { by: self.what_holds(goal), nearest: nearest(part) })?;
        if map.part_of[to as usize] != part {
            return Err(NoWay::Unreachable { nearest: nearest(part) });
        }
        self.shortest(start, from, goal, to).ok_or_else(|| NoWay::Unreachable { nearest: nearest(part) })
    }

    /// What a point that is in no triangle is in.
    fn what_holds(&self, p: &Point2<f64>) -> Obstruction {
        let points = &self.triangles.points;
        // A ray to the right crosses the ring an odd number of times.
        let is_in = |ring: &std::ops::Range<u32>| {
            let crosses = |k: &u32| {
                let (a, b) = (&points[*k as usize], &points[self.neighbours[*k as usize][1] as usize]);
                (a.y > p.y) != (b.y > p.y) && (turn(a, b, p) > 0.0) == (b.y > a.y)
            };
            ring.clone().filter(crosses).count() % 2 == 1
        };
        self.rings[1..].iter().position(is_in).map_or(Obstruction::Outside, Obstruction::Hole)
    }

    /// A* over tangents; `from` and `to` are triangles of one part that hold start and goal.
    fn shortest(&self, start: &Point2<f64>, from: u32, goal: &Point2<f64>, to: u32) -> Option<PolygonRoute> {
        let mut sight = Sight::default();
        let nodes = 2 * self.corner_count();
        let the_goal = nodes as u32;
        let mut best = vec![Reached { distance: f64::INFINITY, to_goal: f64::NAN, before: NONE }; nodes + 1];
        let mut heap = BinaryHeap::new();
        let place = |node: u32| &self.triangles.points[node as usize / 2];
        // What the start sees: perhaps the goal, in its triangle or as the corner that it is.
        let (from_eye, to_eye) = (self.eye(start, from), self.eye(goal, to));
        let is_seen = Cell::new(false);
        let see = |what: bool| is_seen.set(is_seen.get() || what);
        sight.look(
            &self.triangles,
            from_eye,
            start,
            |p| {
                see(to_eye == Eye::Corner(p));
                let length = (self.triangles.points[p as usize] - start).norm();
                let nodes = self.nodes_at(p, start, &self.triangles.points[p as usize]);
                nodes.into_iter().flatten().for_each(|node| best[node as usize].distance = length);
            },
            |triangle, cone| {
                let is_in =
                    |cone: Bounds| turn(start, &cone.right, goal) >= 0.0 && turn(start, &cone.left, goal) <= 0.0;
                see(triangle == to && cone.is_none_or(is_in));
                !is_seen.get()
            },
        );
        if is_seen.get() {
            return Some(PolygonRoute { points: vec![*start, *goal], length: (goal - start).norm() });
        }
        for (node, reached) in best.iter_mut().enumerate().filter(|(_, reached)| reached.distance.is_finite()) {
            reached.to_goal = (place(node as u32) - goal).norm();
            heap.push(Entry {
                cost: reached.distance + reached.to_goal,
                distance: reached.distance,
                node: node as u32,
            });
        }
        // What the goal sees.
        let mut sees_goal: Vec<u32> = Vec::new();
        let towards = |p: u32| self.nodes_at(p, &self.triangles.points[p as usize], goal).into_iter().flatten();
        sight.look(&self.triangles, to_eye, goal, |p| sees_goal.extend(towards(p)), |_, _| true);
        sees_goal.sort_unstable();
        // No way over a node can be shorter than there and straight on.
        while let Some(Entry { distance, node, .. }) = heap.pop() {
            if node == the_goal {
                break;
            }
            let here = best[node as usize];
            if distance > here.distance {
                continue;
            }
            if sees_goal.binary_search(&node).is_ok() && distance + here.to_goal < best[nodes].distance {
                best[nodes] = Reached { distance: distance + here.to_goal, to_goal: 0.0, before: node };
                heap.push(Entry { cost: distance + here.to_goal, distance: distance + here.to_goal, node: the_goal });
            }
            let tangents = self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize;
            for tangent in &self.tangents[tangents] {
                let (distance, there) = (distance + tangent.length, &mut best[tangent.node as usize]);
                if distance >= there.distance {
                    continue;
                }
                if there.to_goal.is_nan() {
                    there.to_goal = (place(tangent.node) - goal).norm();
                }
                (there.distance, there.before) = (distance, node);
                let cost = distance + there.to_goal;
                if cost < best[nodes].distance {
                    heap.push(Entry { cost, distance, node: tangent.node });
                }
            }
        }
        let mut node = best[nodes].before;
        if node == NONE {
            return None;
        }
        let mut points = vec![*goal];
        while node != NONE {
            points.push(*place(node));
            node = best[node as usize].before;
        }
        points.push(*start);
        points.reverse();
        points.dedup();
        let length = points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        Some(PolygonRoute { points, length })
    }

    /// Who looks from `at`, in a triangle that holds it.
    fn eye(&self, at: &Point2<f64>, triangle: u32) -> Eye {
        let corners = self.triangles.corners[triangle as usize];
        let corner = corners.into_iter().find(|p| self.triangles.points[*p as usize] == *at);
        corner.map_or(Eye::Inside(triangle), Eye::Corner)
    }

    /// The nodes of point `p` for who travels along a line: with its obstacle on the left (even), on the right (odd), on both sides
    /// of a flat wall, or none if the line would cut it, or no way bends there.
    fn nodes_at(&self, p: u32, from: &Point2<f64>, to: &Point2<f64>) -> [Option<u32>; 2] {
        if !self.is_bend[p as usize] {
            return [None; 2];
        }
        let [before, after] = self.neighbours[p as usize].map(|q| turn(from, to, &self.triangles.points[q as usize]));
        [(before >= 0.0 && after >= 0.0).then_some(2 * p), (before <= 0.0 && after <= 0.0).then_some(2 * p + 1)]
    }

    fn connect(&mut self) {
        let mut sight = Sight::default();
        let mut pairs: Vec<(u32, Tangent)> = Vec::new();
        let points = &self.triangles.points;
        for u in (0..points.len() as u32).filter(|u| self.is_bend[*u as usize]) {
            let from = &points[u as usize];
            let seen = |v: u32| {
                if v <= u {
                    return;
                }
                let to = &points[v as usize];
                let length = (to - from).norm();
                for a in self.nodes_at(u, from, to).into_iter().flatten() {
                    for b in self.nodes_at(v, from, to).into_iter().flatten() {
                        pairs.push((a, Tangent { node: b, length }));
                        // The other way round the obstacle is on the other side.
                        pairs.push((b ^ 1, Tangent { node: a ^ 1, length }));
                    }
                }
            };
            sight.look(&self.triangles, Eye::Corner(u), from, seen, |_, _| true);
        }
        pairs.sort_by_key(|(from, tangent)| (*from, tangent.node));
        self.starts = vec![0; 2 * points.len() + 1];
        for (from, _) in &pairs {
            self.starts[*from as usize + 1] += 1;
        }
        for k in 1..self.starts.len() {
            self.starts[k] += self.starts[k - 1];
        }
        self.tangents = pairs.into_iter().map(|(_, tangent)| tangent).collect();
    }
}
