//! The visibility graph: corners of the inflated obstacles, joined where a robot may bend round both.
//!
//! A vertex lies outside a convex corner of a simplified obstacle polygon, on a polygon circumscribed
//! about the circle of radius `clearance`; an edge is kept if it is *taut* (it touches both corners like a
//! rubber band: only such edges can be part of a shortest path, FAR Planner rule b) and *visible*.
//! Visible is exact: no blocked square comes nearer to the segment than `clearance`.

use nalgebra::{Point2, Vector2};

use super::clearance::{ClearanceField, HALF_DIAGONAL};
use super::gates::Gate;
use super::grid::{GridView, GroundError, PaddedGrid};
use super::lattice::Lattice;
use super::outline::{Corner, outlines, simplify};
use super::vertex::{Vertex, vertices_round};

/// Douglas-Peucker tolerance in cells: a straight wall at any angle wavers by less than 1, noise adds half.
const SIMPLIFY_CELLS: f64 = 1.5;
/// A corner that turns by less is none.
const LEAST_TURN_RAD: f64 = 1e-6;
/// Sine of the slack of the tautness test: simplified polygons differ from the true ones by a few degrees.
const TAUT_SLACK: f64 = 0.12;
/// Corners are looked up in square buckets of this many cells.
const BUCKET_CELLS: f64 = 8.0;

/// A route through free space.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// From the start (pulled into free space) to the goal (pulled into free space), at least one point.
    pub points: Vec<Point2<f64>>,
    /// Sum of the legs.
    pub length_m: f64,
    /// How far the start was moved to become free, 0 if it was.
    pub start_pull_m: f64,
    /// How far the goal was moved to become free, 0 if it was.
    pub goal_pull_m: f64,
}

/// Free space of a robot of a given clearance: polygons, taut edges, and the lattice that decides what is reachable.
#[derive(Debug, Clone)]
pub struct VisibilityGraph {
    pub(crate) grid: PaddedGrid,
    pub(crate) field: ClearanceField,
    pub(crate) lattice: Lattice,
    pub(crate) vertices: Vec<Vertex>,
    /// Per vertex: (other vertex, length in cells), ascending.
    pub(crate) edges: Vec<Vec<(u32, f64)>>,
    /// The clearance in cells.
    pub(crate) radius: f64,
    /// Straight legs with less room ([`VisibilityGraph::with_gates`]).
    pub(crate) gates: Vec<Gate>,
    corners: CornerIndex,
    polygons: Vec<Vec<Point2<f64>>>,
}

impl VisibilityGraph {
    /// Builds the graph of the places where a disc of radius `clearance_m` fits between the blocked squares.
    /// Cells outside the grid count as blocked. Cost: linear in the cells plus (corners)^2 cheap tests.
    ///
    /// # Errors
    /// A grid that is empty, too large or of the wrong length; numbers that are not finite; a clearance below two cells.
    pub fn build(grid: &GridView, clearance_m: f64) -> Result<VisibilityGraph, GroundError> {
        let grid = PaddedGrid::new(grid)?;
        if !clearance_m.is_finite() {
            return Err(GroundError::NotFinite);
        }
        let radius = clearance_m / grid.resolution_m;
        if radius < 2.0 {
            return Err(GroundError::ClearanceTooSmall { clearance_m, resolution_m: grid.resolution_m });
        }
        let field = ClearanceField::new(&grid);
        let lattice = Lattice::new(&field, radius);
        let rings = outlines(&grid);
        let corners = CornerIndex::new(&grid, &rings);
        let simple: Vec<Vec<[f64; 2]>> = rings.iter().map(|ring| simplify(ring, SIMPLIFY_CELLS)).collect();
        let polygons =
            simple.iter().map(|ring| ring.iter().map(|c| grid.to_world(&Point2::new(c[0], c[1]))).collect()).collect();
        let mut graph = VisibilityGraph {
            grid,
            field,
            lattice,
            vertices: Vec::new(),
            edges: Vec::new(),
            radius,
            gates: Vec::new(),
            corners,
            polygons,
        };
        let mut vertices = Vec::new();
        for ring in &simple {
            let is_free = |p: &Point2<f64>| graph.is_free(p);
            vertices_round(ring, radius, |_| SIMPLIFY_CELLS, LEAST_TURN_RAD, is_free, |v| vertices.push(v));
        }
        graph.vertices = vertices;
        graph.connect();
        Ok(graph)
    }

    /// Simplified obstacle outlines in world coordinates (obstacle on the left): for pictures and reports.
    pub fn polygons(&self) -> &[Vec<Point2<f64>>] {
        &self.polygons
    }

    /// Number of vertices of the graph.
    pub fn vertex_count(&self) -> usize {
        self.vertices.len()
    }

    /// Number of undirected edges of the graph.
    pub fn edge_count(&self) -> usize {
        self.edges.iter().map(Vec::len).sum::<usize>() / 2
    }

    /// Distance from a world point to the nearest blocked square, exact up to 2 m (and 2 m beyond).
    pub fn clearance_at(&self, point: &Point2<f64>) -> f64 {
        let p = self.grid.to_cells(point);
        if !(p.x.is_finite() && p.y.is_finite()) {
            return 0.0;
        }
        let reach = 2.0 / self.grid.resolution_m;
        let bound = (self.field.nearest(p.x, p.y) + HALF_DIAGONAL).min(reach);
        self.grid.distance_to_blocked(&p, bound) * self.grid.resolution_m
    }

    /// Whether the straight segment keeps the clearance from every blocked square.
    pub fn is_clear(&self, a: &Point2<f64>, b: &Point2<f64>) -> bool {
        let (a, b) = (self.grid.to_cells(a), self.grid.to_cells(b));
        self.is_free(&a) && self.is_free(&b) && self.is_visible(&a, &b)
    }

    fn connect(&mut self) {
        let n = self.vertices.len();
        self.edges = vec![Vec::new(); n];
        for a in 0..n {
            for b in a + 1..n {
                let (from, to) = (self.vertices[a], self.vertices[b]);
                let across = to.at - from.at;
                let length = across.norm();
                if from.is_taut(&across, length, TAUT_SLACK)
                    && to.is_taut(&across, length, TAUT_SLACK)
                    && self.is_visible(&from.at, &to.at)
                {
                    self.edges[a].push((b as u32, length));
                    self.edges[b].push((a as u32, length));
                }
            }
        }
    }

    /// Whether a point (cell units) is at least the clearance away from every blocked square. Exact.
    pub(crate) fn is_free(&self, p: &Point2<f64>) -> bool {
        let near = self.field.nearest(p.x, p.y);
        if near - HALF_DIAGONAL >= self.radius {
            return true;
        }
        near + HALF_DIAGONAL >= self.radius && self.grid.distance_to_blocked(p, self.radius + 1.0) >= self.radius
    }

    /// Whether the segment between two free points keeps the clearance. Exact.
    pub(crate) fn is_visible(&self, a: &Point2<f64>, b: &Point2<f64>) -> bool {
        self.keeps(a, b, self.radius)
    }

    /// Whether the segment between two points that are `radius` cells from every blocked square keeps that distance. Exact:
    /// where the lattice cannot tell, the convex corners near the segment are measured (the nearest point of a union of squares
    /// to a segment whose ends are free is a convex corner, or the segment crosses the union, which the march sees).
    pub(crate) fn keeps(&self, a: &Point2<f64>, b: &Point2<f64>, radius: f64) -> bool {
        let across = b - a;
        let length = across.norm();
        if length < 1e-12 {
            return true;
        }
        let direction = across / length;
        let mut unsure: Option<(f64, f64)> = None;
        let mut s = 0.0;
        loop {
            let distance = self.field.nearest(a.x + direction.x * s, a.y + direction.y * s);
            if distance + HALF_DIAGONAL < radius {
                return false;
            }
            let spare = distance - HALF_DIAGONAL - radius;
            if spare < 0.5 {
                unsure = Some((unsure.map_or(s - 0.5, |u| u.0), s + 0.5));
            }
            if s >= length {
                break;
            }
            s = (s + spare.max(0.5)).min(length);
        }
        match unsure {
            None => true,
            Some((low, high)) => self.corners.all_beyond(a, &direction, low.max(0.0), high.min(length), radius),
        }
    }

    /// Vertices that can be seen from a free point and from which a taut path can leave: (vertex, length in cells).
    pub(crate) fn seen_from(&self, p: &Point2<f64>) -> Vec<(u32, f64)> {
        let mut seen = Vec::new();
        for (k, vertex) in self.vertices.iter().enumerate() {
            let across = vertex.at - p;
            let length = across.norm();
            if vertex.is_taut(&across, length, TAUT_SLACK) && self.is_visible(p, &vertex.at) {
                seen.push((k as u32, length));
            }
        }
        seen
    }
}

/// Convex corners of the exact outlines, in square buckets.
#[derive(Debug, Clone)]
struct CornerIndex {
    nx: i64,
    ny: i64,
    start: Vec<u32>,
    points: Vec<[f64; 2]>,
}

impl CornerIndex {
    fn new(grid: &PaddedGrid, rings: &[Vec<Corner>]) -> Self {
        let nx = (grid.width as f64 / BUCKET_CELLS) as i64 + 1;
        let ny = (grid.height as f64 / BUCKET_CELLS) as i64 + 1;
        let convex = || rings.iter().flatten().filter(|c| c.convex).map(|c| [f64::from(c.x), f64::from(c.y)]);
        let bucket = |p: &[f64; 2]| ((p[1] / BUCKET_CELLS) as i64 * nx + (p[0] / BUCKET_CELLS) as i64) as usize;
        let mut start = vec![0u32; (nx * ny) as usize + 1];
        for p in convex() {
            start[bucket(&p) + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut next = start.clone();
        let mut points = vec![[0.0; 2]; start[start.len() - 1] as usize];
        for p in convex() {
            let slot = &mut next[bucket(&p)];
            points[*slot as usize] = p;
            *slot += 1;
        }
        CornerIndex { nx, ny, start, points }
    }

    /// Whether no corner is nearer than `radius` to the part `[low, high]` of the ray from `a`.
    fn all_beyond(&self, a: &Point2<f64>, direction: &Vector2<f64>, low: f64, high: f64, radius: f64) -> bool {
        let (p, q) = (a + direction * low, a + direction * high);
        let column = |x: f64| ((x / BUCKET_CELLS).floor() as i64).clamp(0, self.nx - 1);
        let row = |y: f64| ((y / BUCKET_CELLS).floor() as i64).clamp(0, self.ny - 1);
        // Strictly inside only: a corner at exactly the clearance is fine (1e-9: rounding of the projections).
        let limit = radius * radius - 1e-9;
        let (y_low, y_high) = (p.y.min(q.y), p.y.max(q.y));
        for by in row(y_low - radius)..=row(y_high + radius) {
            // The part of the segment whose y is within `radius` of this row of buckets.
            let (row_low, row_high) = (by as f64 * BUCKET_CELLS - radius, (by + 1) as f64 * BUCKET_CELLS + radius);
            let (mut s0, mut s1) = (low, high);
            if direction.y.abs() > 1e-12 {
                let (t0, t1) = ((row_low - a.y) / direction.y, (row_high - a.y) / direction.y);
                s0 = s0.max(t0.min(t1));
                s1 = s1.min(t0.max(t1));
                if s0 > s1 {
                    continue;
                }
            }
            let (x0, x1) = (a.x + direction.x * s0, a.x + direction.x * s1);
            for bx in column(x0.min(x1) - radius)..=column(x0.max(x1) + radius) {
                let bucket = (by * self.nx + bx) as usize;
                for c in &self.points[self.start[bucket] as usize..self.start[bucket + 1] as usize] {
                    let w = Point2::from(*c) - a;
                    let s = w.dot(direction).clamp(low, high);
                    if (w - direction * s).norm_squared() < limit {
                        return false;
                    }
                }
            }
        }
        true
    }
}
