//! Queries on the visibility graph: one route, many lengths, the nearest reachable point.

use std::collections::BinaryHeap;

use nalgebra::Point2;

use super::gates::Gate;
use super::lattice::Entry;
use super::visibility::{Route, VisibilityGraph};

/// A start or goal inside the inflation is moved at most this far.
pub const MAX_PULL_M: f64 = 0.75;
/// Points of a finished route are moved away from walls until they have this much clearance on top.
const COMFORT_M: f64 = 0.35;
/// ... but not further than this from where the shortest path has them.
const MAX_SHIFT_M: f64 = 0.30;

/// Why there is no way, and what can be reached instead.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unreached {
    /// A coordinate is not finite.
    #[error("start and goal must be finite")]
    NotFinite,
    /// Nothing free within [`MAX_PULL_M`] of the start.
    #[error("there is no room for the robot at the start or near it")]
    StartBlocked,
    /// The goal lies beyond the map.
    #[error(
        "the goal is outside of the map; the nearest place that can be reached is {off_m:.1} m from it, at {nearest}"
    )]
    GoalOutside {
        /// The place nearest to the goal that can be reached.
        nearest: Point2<f64>,
        /// How far from the goal that is.
        off_m: f64,
    },
    /// Something stands at the goal, and it has no room beside that.
    #[error(
        "there is no room for the robot at the goal; the nearest place that can be reached is {off_m:.1} m from it, at {nearest}"
    )]
    GoalBlocked {
        /// The place nearest to the goal that can be reached.
        nearest: Point2<f64>,
        /// How far from the goal that is.
        off_m: f64,
    },
    /// There is room at both ends, and nothing joins them.
    #[error("no way leads to the goal; the nearest place that can be reached is {off_m:.1} m from it, at {nearest}")]
    Apart {
        /// The place nearest to the goal that can be reached.
        nearest: Point2<f64>,
        /// How far from the goal that is.
        off_m: f64,
    },
}

impl VisibilityGraph {
    /// The same as [`VisibilityGraph::route`], with a reason and an offer where there is no way.
    ///
    /// # Errors
    /// [`Unreached`].
    pub fn find(&self, start: &Point2<f64>, goal: &Point2<f64>) -> Result<Route, Unreached> {
        if let Some(route) = self.route(start, goal) {
            return Ok(route);
        }
        if !start.iter().chain(goal.iter()).all(|x| x.is_finite()) {
            return Err(Unreached::NotFinite);
        }
        let (nearest, off_m) = self.nearest_reachable(start, goal).ok_or(Unreached::StartBlocked)?;
        let at = self.grid.to_cells(goal);
        // The ring of blocked cells round the map is not the map.
        let is_inside = |x: f64, cells: usize| x >= 1.0 && x < (cells - 1) as f64;
        if !(is_inside(at.x, self.grid.width) && is_inside(at.y, self.grid.height)) {
            return Err(Unreached::GoalOutside { nearest, off_m });
        }
        Err(match self.pull(goal, None) {
            None => Unreached::GoalBlocked { nearest, off_m },
            Some(_) => Unreached::Apart { nearest, off_m },
        })
    }

    /// The shortest route, its bends moved away from walls where there is room. `None` if there is none, if start or
    /// goal has no free point within [`MAX_PULL_M`], or if a coordinate is not finite.
    ///
    /// Every leg keeps the clearance of the graph from every blocked square, exactly; one that is a gate
    /// ([`VisibilityGraph::with_gates`]) keeps what the gates keep.
    pub fn route(&self, start: &Point2<f64>, goal: &Point2<f64>) -> Option<Route> {
        let to = self.pull(goal, None)?;
        let from = self.depart(start, Some(to.component))?;
        let mut points = self.shortest(&from, &to)?;
        self.relax(&mut points);
        let resolution = self.grid.resolution_m;
        let points: Vec<Point2<f64>> = points.iter().map(|p| self.grid.to_world(p)).collect();
        let length_m = points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        Some(Route { points, length_m, start_pull_m: from.moved * resolution, goal_pull_m: to.moved * resolution })
    }

    /// Route lengths from one start to many goals by one search, m; `None` where there is no route. Bends are not moved
    /// away from walls here, so a length differs from that of [`VisibilityGraph::route`] by 0.6 m a bend at most.
    pub fn lengths_from(&self, start: &Point2<f64>, goals: &[Point2<f64>]) -> Vec<Option<f64>> {
        let mut from: Vec<Start> = Vec::new();
        goals.iter().map(|goal| self.length_to(start, goal, &mut from)).collect()
    }

    /// The reachable free point nearest to `goal`, and its distance from `goal` in metres. `None` if the start has no
    /// free point within [`MAX_PULL_M`].
    pub fn nearest_reachable(&self, start: &Point2<f64>, goal: &Point2<f64>) -> Option<(Point2<f64>, f64)> {
        let from = self.depart(start, None)?;
        let to = self.grid.to_cells(goal);
        if self.is_free(&to) && self.pull(goal, None).is_some_and(|end| end.component == from.component) {
            return Some((*goal, 0.0));
        }
        let everywhere = (self.lattice.nx + self.lattice.ny) as f64 + (to - from.at).norm();
        let (k, moved) = self.lattice.nearest(&to, everywhere, |k, _| self.lattice.component(k) == from.component)?;
        let at = Point2::new((k % self.lattice.nx) as f64, (k / self.lattice.nx) as f64);
        Some((self.grid.to_world(&at), moved * self.grid.resolution_m))
    }

    /// Where a route from `start` begins: in the gate it stands in, else in free space.
    fn depart(&self, start: &Point2<f64>, component: Option<u32>) -> Option<End> {
        let p = self.grid.to_cells(start);
        let in_gate = if self.is_free(&p) { None } else { self.gate_at(&p) };
        let Some((gate, at)) = in_gate else { return self.pull(start, component) };
        let end = self.vertices[gate.ends[0] as usize].at;
        let anchor = end.y as usize * self.lattice.nx + end.x as usize;
        Some(End { at, anchor, component: self.lattice.component(anchor), moved: (at - p).norm(), gate: Some(gate) })
    }

    /// Moves a point into free space. With `component`, into that part of it if one can get there without touching
    /// a blocked cell.
    fn pull(&self, point: &Point2<f64>, component: Option<u32>) -> Option<End> {
        let p = self.grid.to_cells(point);
        let reach = MAX_PULL_M / self.grid.resolution_m;
        // A free point belongs to the component of a lattice point it can see, and is not moved.
        if self.is_free(&p) {
            let seen = |wanted: Option<u32>| {
                self.lattice.nearest(&p, 2.0, |k, at| {
                    wanted.is_none_or(|c| self.lattice.component(k) == c) && self.is_visible(&p, at)
                })
            };
            if let Some((k, _)) = component.and_then(|c| seen(Some(c))).or_else(|| seen(None)) {
                return Some(End { at: p, anchor: k, component: self.lattice.component(k), moved: 0.0, gate: None });
            }
        }
        let nearest = |wanted: Option<u32>| {
            self.lattice.nearest(&p, reach, |k, at| match wanted {
                None => true,
                Some(c) => self.lattice.component(k) == c && self.is_unblocked(&p, at),
            })
        };
        let (k, moved) = component.and_then(|c| nearest(Some(c))).or_else(|| nearest(None))?;
        let at = Point2::new((k % self.lattice.nx) as f64, (k / self.lattice.nx) as f64);
        Some(End { at, anchor: k, component: self.lattice.component(k), moved, gate: None })
    }

    /// Whether the straight segment meets no blocked cell, except those round its first point.
    fn is_unblocked(&self, a: &Point2<f64>, b: &Point2<f64>) -> bool {
        let steps = ((b - a).norm() * 4.0).ceil().max(1.0) as usize;
        let mut has_left = false;
        (0..=steps).all(|s| {
            let p = a + (b - a) * (s as f64 / steps as f64);
            let blocked = self.grid.is_blocked(p.x.floor() as i64, p.y.floor() as i64);
            has_left |= !blocked;
            !(blocked && has_left)
        })
    }

    fn shortest(&self, from: &End, to: &End) -> Option<Vec<Point2<f64>>> {
        if from.component != to.component {
            return None;
        }
        if self.is_visible(&from.at, &to.at) {
            return Some(vec![from.at, to.at]);
        }
        let tree = self.tree(from);
        if let Some((_, last)) = self.best_entry(&tree, &to.at) {
            let mut points = vec![to.at];
            let mut vertex = last;
            while vertex != u32::MAX {
                points.push(self.vertices[vertex as usize].at);
                vertex = tree[vertex as usize].1;
            }
            points.push(from.at);
            points.reverse();
            return Some(points);
        }
        // The graph misses a passage that only the circle fits through: the lattice does not.
        let mut points = self.lattice.path(from.anchor, to.anchor)?;
        points.insert(0, from.at);
        points.push(to.at);
        Some(self.shortcut(&points))
    }

    /// Dijkstra over the vertices: per vertex (distance in cells, parent).
    fn tree(&self, from: &End) -> Vec<(f64, u32)> {
        let mut best = vec![(f64::INFINITY, u32::MAX); self.vertices.len()];
        let mut heap = BinaryHeap::new();
        let first = match from.gate {
            Some(gate) => gate.ends.map(|end| (end, (self.vertices[end as usize].at - from.at).norm())).to_vec(),
            None => self.seen_from(&from.at),
        };
        for (vertex, length) in first {
            best[vertex as usize].0 = length;
            heap.push(Entry { cost: length, distance: length, node: vertex });
        }
        while let Some(Entry { distance, node, .. }) = heap.pop() {
            if distance > best[node as usize].0 {
                continue;
            }
            for &(other, length) in &self.edges[node as usize] {
                let reached = distance + length;
                if reached < best[other as usize].0 {
                    best[other as usize] = (reached, node);
                    heap.push(Entry { cost: reached, distance: reached, node: other });
                }
            }
        }
        best
    }

    /// The cheapest vertex from which a point is reached: (length of the whole way, vertex).
    fn best_entry(&self, tree: &[(f64, u32)], to: &Point2<f64>) -> Option<(f64, u32)> {
        // In order of the bound, so that the expensive visibility test runs a few times only.
        let mut ways: Vec<(f64, u32)> = tree
            .iter()
            .enumerate()
            .filter(|(_, t)| t.0.is_finite())
            .map(|(k, t)| (t.0 + (self.vertices[k].at - to).norm(), k as u32))
            .collect();
        ways.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        ways.into_iter().find(|(_, k)| self.is_visible(&self.vertices[*k as usize].at, to))
    }

    fn length_to(&self, start: &Point2<f64>, goal: &Point2<f64>, starts: &mut Vec<Start>) -> Option<f64> {
        let to = self.pull(goal, None)?;
        // One search per component the start can be pulled into: nearly always one.
        let known = starts.iter().position(|s| s.end.component == to.component);
        let index = match known {
            Some(index) => index,
            None => {
                let end = self.depart(start, Some(to.component))?;
                if end.component != to.component {
                    return None;
                }
                starts.push(Start { tree: self.tree(&end), end, lattice: None });
                starts.len() - 1
            }
        };
        let from = &mut starts[index];
        let cells = if self.is_visible(&from.end.at, &to.at) {
            (to.at - from.end.at).norm()
        } else if let Some((length, _)) = self.best_entry(&from.tree, &to.at) {
            length
        } else {
            let distances = from.lattice.get_or_insert_with(|| self.lattice.distances(from.end.anchor));
            distances[to.anchor]
        };
        Some(cells * self.grid.resolution_m)
    }

    /// Cuts a lattice path short: from each kept point to the furthest later point it sees.
    fn shortcut(&self, points: &[Point2<f64>]) -> Vec<Point2<f64>> {
        let mut kept = vec![points[0]];
        let mut at = 0;
        while at + 1 < points.len() {
            let mut next = at + 1;
            let mut stride = 1;
            // Doubling, then single steps: visibility along a path is nearly monotone.
            while at + stride < points.len() {
                if self.is_visible(&points[at], &points[at + stride]) {
                    next = at + stride;
                    stride *= 2;
                } else {
                    break;
                }
            }
            while next + 1 < points.len() && self.is_visible(&points[at], &points[next + 1]) {
                next += 1;
            }
            kept.push(points[next]);
            at = next;
        }
        kept
    }

    /// Moves the bends up the clearance, a cell at a time, while both legs stay clear.
    fn relax(&self, points: &mut [Point2<f64>]) {
        let resolution = self.grid.resolution_m;
        let comfort = self.radius + COMFORT_M / resolution;
        let original: Vec<Point2<f64>> = points.to_vec();
        for _ in 0..12 {
            let mut moved = false;
            for k in 1..points.len().saturating_sub(1) {
                let p = points[k];
                let here = self.field.nearest(p.x, p.y);
                if here >= comfort {
                    continue;
                }
                let mut best = (here, p);
                for (dx, dy) in [
                    (1.0, 0.0),
                    (0.7, 0.7),
                    (0.0, 1.0),
                    (-0.7, 0.7),
                    (-1.0, 0.0),
                    (-0.7, -0.7),
                    (0.0, -1.0),
                    (0.7, -0.7),
                ] {
                    let candidate = Point2::new(p.x + dx, p.y + dy);
                    let clearance = self.field.nearest(candidate.x, candidate.y);
                    let near = (candidate - original[k]).norm() * resolution <= MAX_SHIFT_M;
                    if clearance > best.0 + 0.05 && near {
                        best = (clearance, candidate);
                    }
                }
                let candidate = best.1;
                let clear = candidate != p
                    && self.is_free(&candidate)
                    && self.is_visible(&points[k - 1], &candidate)
                    && self.is_visible(&candidate, &points[k + 1]);
                if clear {
                    points[k] = candidate;
                    moved = true;
                }
            }
            if !moved {
                break;
            }
        }
    }
}

/// A start or goal in free space, in cell units.
#[derive(Debug, Clone, Copy)]
struct End {
    at: Point2<f64>,
    /// A free lattice point that sees it.
    anchor: usize,
    component: u32,
    moved: f64,
    /// The gate it stands in, without room to turn.
    gate: Option<Gate>,
}

/// A start with what was searched from it.
#[derive(Debug)]
struct Start {
    end: End,
    tree: Vec<(f64, u32)>,
    lattice: Option<Vec<f64>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::grid::GridView;

    /// 6 x 4 m at 10 cm: a table of 1 m, and a closed room on the right.
    #[test]
    fn a_goal_that_cannot_be_says_why_and_what_can() {
        let (width, height) = (60, 40);
        let table = |x: usize, y: usize| (15..25).contains(&x) && (15..25).contains(&y);
        let blocked: Vec<bool> = (0..width * height).map(|k| k % width == 40 || table(k % width, k / width)).collect();
        let view = GridView { origin: Point2::new(-1.0, 0.0), resolution_m: 0.1, width, height, blocked: &blocked };
        let graph = VisibilityGraph::build(&view, 0.3).unwrap();
        let (start, far) = (Point2::new(-0.5, 2.0), Point2::new(9.0, 2.0));
        let find = |x: f64, y: f64| graph.find(&start, &Point2::new(x, y)).unwrap_err();
        // From the wall at x = 3 m the circle keeps 0.3 m.
        let Unreached::GoalOutside { nearest, off_m } = find(far.x, far.y) else { panic!("{:?}", find(far.x, far.y)) };
        assert!((2.4..=2.7).contains(&nearest.x) && (off_m - (far - nearest).norm()).abs() < 0.11, "{nearest} {off_m}");
        assert!(matches!(find(4.0, 2.0), Unreached::Apart { .. }), "{:?}", find(4.0, 2.0));
        // From the table it is moved to the floor, 0.75 m at most.
        assert!(graph.find(&Point2::new(0.7, 2.0), &start).is_ok());
        assert_eq!(find(f64::NAN, 0.0), Unreached::NotFinite);
        for offered in [find(far.x, far.y), find(4.0, 2.0)] {
            let (Unreached::GoalOutside { nearest, .. } | Unreached::Apart { nearest, .. }) = offered else { continue };
            assert!(graph.find(&start, &nearest).is_ok(), "{offered}");
        }
        // In the middle of a table that is wider than what a goal may be moved.
        let wide: Vec<bool> = (0..width * height).map(|k| (k % width) > 20 && (8..32).contains(&(k / width))).collect();
        let view = GridView { blocked: &wide, ..view };
        let graph = VisibilityGraph::build(&view, 0.3).unwrap();
        assert_eq!(graph.find(&Point2::new(3.0, 2.0), &start), Err(Unreached::StartBlocked));
        let error = graph.find(&start, &Point2::new(3.0, 2.0)).unwrap_err();
        assert!(matches!(error, Unreached::GoalBlocked { off_m, .. } if off_m > 0.75), "{error}");
    }
}
