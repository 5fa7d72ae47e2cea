//! Gates: straight ways through places where the robot fits lengthwise but has no room to turn.
//!
//! A long robot is narrower than the circle it sweeps when it turns. Between two places with room to turn it may drive a
//! straight leg that keeps only the half of its width from every blocked square:
//!
//! ```text
//! gate (a, b):   dist(a), dist(b) >= clearance,   dist(segment a-b) >= passing < clearance
//! ```
//!
//! Gates are looked for only where there is no wider way: a flood of the narrow space starts from all wide parts at once;
//! where the floods of two parts meet lies a passage between them, and the straight line through the widest point of the
//! meeting with the most room becomes the gate. Both parts then count as one.

use std::collections::VecDeque;

use nalgebra::{Point2, Vector2};

use super::clearance::HALF_DIAGONAL;
use super::lattice::NEIGHBOURS;
use super::vertex::Vertex;
use super::visibility::VisibilityGraph;

/// A straight leg between two places with room to turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gate {
    /// Its ends as vertices of the graph.
    pub ends: [u32; 2],
}

/// No gate is longer, end to end.
const LONGEST_M: f64 = 4.0;
/// Two gates between the same parts are at least so far apart.
const APART_M: f64 = 1.0;
/// More passages than this are not looked at: noise at the rim of a map makes some.
const MOST_PASSAGES: usize = 64;
/// Directions tried through a passage.
const DIRECTIONS: usize = 36;
/// What a metre of length is worth in metres of room to the sides.
const ROOM_PER_LENGTH: f64 = 0.03;
/// The ends are moved on into the open by at most this, while that makes room to turn.
const ONWARD_M: f64 = 0.25;
/// A robot this near to the line of a gate is in it.
const IN_GATE_M: f64 = 0.25;

impl VisibilityGraph {
    /// The same graph with gates: straight legs that keep only `passing_m` from every blocked square (half the robot's width
    /// and what it sways), at least two cells. With `passing_m` not below the clearance there are none.
    #[must_use]
    pub fn with_gates(mut self, passing_m: f64) -> VisibilityGraph {
        if !passing_m.is_finite() {
            return self;
        }
        let passing = (passing_m / self.grid.resolution_m).max(2.0);
        if passing >= self.radius {
            return self;
        }
        let lines: Vec<[usize; 2]> =
            self.passages(passing).iter().filter_map(|middle| self.line_through(middle, passing)).collect();
        lines.into_iter().for_each(|ends| self.add_gate(ends));
        self
    }

    /// The ends of the gates in world coordinates.
    pub fn gates(&self) -> Vec<[Point2<f64>; 2]> {
        let at = |vertex: u32| self.grid.to_world(&self.vertices[vertex as usize].at);
        self.gates.iter().map(|gate| gate.ends.map(at)).collect()
    }

    /// The gate that a point (cell units) without room to turn lies in, and the point of its line nearest to it.
    pub(crate) fn gate_at(&self, p: &Point2<f64>) -> Option<(Gate, Point2<f64>)> {
        let within = IN_GATE_M / self.grid.resolution_m;
        let near = self.gates.iter().map(|gate| {
            let [a, b] = gate.ends.map(|end| self.vertices[end as usize].at);
            let along = b - a;
            let at = a + along * ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            ((at - p).norm(), *gate, at)
        });
        let (distance, gate, at) = near.min_by(|x, y| x.0.total_cmp(&y.0))?;
        (distance <= within).then_some((gate, at))
    }

    /// The widest point of every passage between two parts of the wide space, widest first.
    fn passages(&self, passing: f64) -> Vec<Point2<f64>> {
        let threshold = (passing * passing + 0.5).ceil() as u32;
        let squared = self.field.squared_all();
        let nx = self.lattice.nx;
        let mut part: Vec<u32> = (0..squared.len()).map(|k| self.lattice.component(k)).collect();
        let mut queue: VecDeque<usize> = (0..part.len()).filter(|&k| part[k] != 0).collect();
        let mut meetings: Vec<(u32, usize, (u32, u32))> = Vec::new();
        while let Some(k) = queue.pop_front() {
            let (i, j) = ((k % nx) as i64, (k / nx) as i64);
            for (di, dj) in NEIGHBOURS {
                // The border of the lattice is blocked: what is free has all its neighbours.
                let other = (j + dj) as usize * nx + (i + di) as usize;
                if part[other] == 0 && squared[other] >= threshold {
                    part[other] = part[k];
                    queue.push_back(other);
                } else if part[other] != 0 && part[other] != part[k] {
                    meetings.push((squared[k], k, (part[k].min(part[other]), part[k].max(part[other]))));
                }
            }
        }
        meetings.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
        let apart = APART_M / self.grid.resolution_m;
        let mut kept: Vec<(Point2<f64>, (u32, u32))> = Vec::new();
        for (_, k, parts) in meetings {
            let at = Point2::new((k % nx) as f64, (k / nx) as f64);
            if kept.len() < MOST_PASSAGES && kept.iter().all(|(other, of)| *of != parts || (other - at).norm() >= apart)
            {
                kept.push((at, parts));
            }
        }
        kept.into_iter().map(|(at, _)| at).collect()
    }

    /// The straight line through a point of a passage with the most room, between lattice points with room to turn in two parts
    /// of the wide space.
    fn line_through(&self, middle: &Point2<f64>, passing: f64) -> Option<[usize; 2]> {
        let mut best: Option<(f64, [usize; 2])> = None;
        for k in 0..DIRECTIONS {
            let angle = std::f64::consts::PI * k as f64 / DIRECTIONS as f64;
            let direction = Vector2::new(angle.cos(), angle.sin());
            let Some(a) = self.open_end(middle, &-direction, passing) else { continue };
            let Some(b) = self.open_end(middle, &direction, passing) else { continue };
            let [from, to] = [a, b].map(|k| self.lattice.point(k));
            let length = (to - from).norm();
            if self.lattice.component(a) == self.lattice.component(b)
                || length * self.grid.resolution_m > LONGEST_M
                || !self.keeps(&from, &to, passing)
            {
                continue;
            }
            let worth = self.least_room(&from, &to) - ROOM_PER_LENGTH * length;
            if best.is_none_or(|(most, _)| worth > most) {
                best = Some((worth, [a, b]));
            }
        }
        best.map(|(_, ends)| ends)
    }

    /// The lattice point where the way from `middle` along `direction` first has room to turn, or has most of it soon after.
    fn open_end(&self, middle: &Point2<f64>, direction: &Vector2<f64>, passing: f64) -> Option<usize> {
        let longest = LONGEST_M / self.grid.resolution_m;
        let onward = ONWARD_M / self.grid.resolution_m;
        let mut end: Option<(f64, f64, usize)> = None;
        let mut s = 0.0;
        while s <= end.map_or(longest, |(first, _, _)| first + onward) {
            let p = middle + direction * s;
            let room = self.field.nearest(p.x, p.y);
            if room + HALF_DIAGONAL < passing {
                break;
            }
            let k = (p.y + 0.5).floor() as usize * self.lattice.nx + (p.x + 0.5).floor() as usize;
            if self.lattice.component(k) != 0 && end.is_none_or(|(_, most, _)| room > most) {
                end = Some((end.map_or(s, |(first, _, _)| first), room, k));
            }
            s += 0.5;
        }
        end.map(|(_, _, k)| k)
    }

    fn least_room(&self, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
        let steps = (b - a).norm().ceil().max(1.0) as usize;
        let at = |s: usize| a + (b - a) * (s as f64 / steps as f64);
        (0..=steps).map(|s| self.field.nearest(at(s).x, at(s).y)).fold(f64::INFINITY, f64::min)
    }

    fn add_gate(&mut self, ends: [usize; 2]) {
        let [a, b] = ends.map(|k| self.lattice.point(k));
        let gate = Gate { ends: [self.add_vertex(a), self.add_vertex(b)] };
        let length = (b - a).norm();
        let [from, to] = gate.ends;
        self.edges[from as usize].push((to, length));
        self.edges[to as usize].push((from, length));
        self.lattice.link(ends);
        self.gates.push(gate);
    }

    /// A vertex that no obstacle holds: every line through it is taut.
    fn add_vertex(&mut self, at: Point2<f64>) -> u32 {
        let index = self.vertices.len() as u32;
        let seen = self.seen_from(&at);
        for &(other, length) in &seen {
            self.edges[other as usize].push((index, length));
        }
        self.vertices.push(Vertex { at, before: Vector2::zeros(), after: Vector2::zeros() });
        self.edges.push(seen);
        index
    }
}
