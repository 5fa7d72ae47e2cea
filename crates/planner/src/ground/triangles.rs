//! The free space between polygons as triangles: who is whose neighbour, and which triangle holds a point.
//!
//! All questions of side are answered exactly (Shewchuk's predicates): a point on a wall is on it, not beside it by an ulp.

use nalgebra::{Point2, Vector2};
use robust::{Coord, orient2d};
use spade::{ConstrainedDelaunayTriangulation, Triangulation};

use super::polygon_map::PolygonError;

/// No triangle: a wall.
pub(crate) const WALL: u32 = u32::MAX;

/// Twice the signed area of a, b, c: positive if they turn left, zero exactly if they lie on one line.
pub(crate) fn turn(a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>) -> f64 {
    let coord = |p: &Point2<f64>| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// Triangles of free space. Side `k` of a triangle leads from corner `k` to corner `k + 1`, the triangle on its left.
#[derive(Debug, Clone)]
pub(crate) struct Triangles {
    pub points: Vec<Point2<f64>>,
    pub corners: Vec<[u32; 3]>,
    /// Behind each side: 4 * triangle + its side, or [`WALL`].
    pub behind: Vec<[u32; 3]>,
    /// Number of the connected part of each triangle.
    pub part_of: Vec<u32>,
    /// Triangles round each point: `fans[starts[p]..starts[p + 1]]`, as 4 * triangle + corner.
    fans: Vec<u32>,
    starts: Vec<u32>,
    buckets: Buckets,
}

impl Triangles {
    /// Triangulates what lies to the left of all rings (numbers of `points`, each ring closed, no ring touching another).
    pub fn new(points: Vec<Point2<f64>>, rings: &[std::ops::Range<u32>]) -> Result<Triangles, PolygonError> {
        let place = |p: &Point2<f64>| spade::Point2::new(p.x, p.y);
        let next = |ring: &std::ops::Range<u32>, k: u32| if k + 1 == ring.end { ring.start } else { k + 1 };
        let sides: Vec<[usize; 2]> =
            rings.iter().flat_map(|ring| ring.clone().map(move |k| [k as usize, next(ring, k) as usize])).collect();
        let mut crossing = None;
        let note = |side: [usize; 2]| crossing = crossing.or(Some(side));
        let places = points.iter().map(place).collect();
        let mesh =
            ConstrainedDelaunayTriangulation::<spade::Point2<f64>>::try_bulk_load_cdt(places, sides.clone(), note)
                .map_err(|_| PolygonError::TooLarge)?;
        if mesh.num_vertices() != points.len() {
            return Err(PolygonError::Touching);
        }
        if let Some([from, to]) = crossing {
            return Err(PolygonError::Crossing { from: points[from], to: points[to] });
        }
        if mesh.num_constraints() != sides.len() {
            return Err(PolygonError::Touching);
        }

        // What is left of a wall is free, and so is what can be reached from there.
        let mut number = vec![WALL; mesh.num_all_faces()];
        let mut free = Vec::new();
        let handle = |k: usize| spade::handles::FixedVertexHandle::from_index(k);
        for [from, to] in sides {
            let edge = mesh.get_edge_from_neighbors(handle(from), handle(to)).ok_or(PolygonError::Touching)?;
            let Some(face) = edge.face().as_inner() else { return Err(PolygonError::NotEnclosed) };
            if number[face.index()] == WALL {
                number[face.index()] = free.len() as u32;
                free.push(face);
            }
        }
        let mut at = 0;
        while at < free.len() {
            for edge in free[at].adjacent_edges() {
                if edge.is_constraint_edge() {
                    continue;
                }
                let Some(face) = edge.rev().face().as_inner() else { return Err(PolygonError::NotEnclosed) };
                if number[face.index()] == WALL {
                    number[face.index()] = free.len() as u32;
                    free.push(face);
                }
            }
            at += 1;
        }
        let corners: Vec<[u32; 3]> =
            free.iter().map(|face| face.vertices().map(|vertex| vertex.index() as u32)).collect();
        let side_from = |triangle: usize, corner: u32| corners[triangle].iter().position(|other| *other == corner);
        let mut behind = vec![[WALL; 3]; free.len()];
        for (triangle, face) in free.iter().enumerate() {
            for edge in face.adjacent_edges().iter().filter(|edge| !edge.is_constraint_edge()) {
                let other = number[edge.rev().face().index()];
                let [from, to] = [edge.from(), edge.to()].map(|vertex| vertex.index() as u32);
                if let (Some(side), Some(back)) = (side_from(triangle, from), side_from(other as usize, to)) {
                    behind[triangle][side] = 4 * other + back as u32;
                }
            }
        }
        let buckets = Buckets::new(&points, &corners);
        let (fans, starts) = fans(points.len(), &corners);
        let part_of = parts(&behind);
        Ok(Triangles { points, corners, behind, part_of, fans, starts, buckets })
    }

    /// Corners of a triangle.
    pub fn places(&self, triangle: u32) -> [&Point2<f64>; 3] {
        self.corners[triangle as usize].map(|corner| &self.points[corner as usize])
    }

    /// Triangles with a corner at point `p`: (triangle, which corner).
    pub fn fan(&self, p: u32) -> impl Iterator<Item = (u32, usize)> + '_ {
        let fan = self.starts[p as usize] as usize..self.starts[p as usize + 1] as usize;
        self.fans[fan].iter().map(|packed| (packed / 4, (packed % 4) as usize))
    }

    /// A triangle that holds a point, its border included.
    pub fn holding(&self, p: &Point2<f64>) -> Option<u32> {
        let holds = |triangle: &&u32| {
            let [a, b, c] = self.places(**triangle);
            turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
        };
        self.buckets.near(p).iter().find(holds).copied()
    }

    /// The point of the free space (of one part of it, if given) that is nearest to `p`. O(n).
    pub fn nearest(&self, p: &Point2<f64>, part: Option<u32>) -> Option<Point2<f64>> {
        let triangles = (0..self.corners.len() as u32)
            .filter(|triangle| part.is_none_or(|part| self.part_of[*triangle as usize] == part));
        let nearest = triangles.map(|triangle| nearest_of(self.places(triangle), p));
        nearest.min_by(|a, b| (a - p).norm_squared().total_cmp(&(b - p).norm_squared()))
    }
}

fn fans(points: usize, corners: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0_u32; points + 1];
    for corner in corners.iter().flatten() {
        starts[*corner as usize + 1] += 1;
    }
    for k in 1..starts.len() {
        starts[k] += starts[k - 1];
    }
    let mut next = starts.clone();
    let mut fans = vec![0; 3 * corners.len()];
    for (triangle, corners) in corners.iter().enumerate() {
        for (k, corner) in corners.iter().enumerate() {
            let slot = &mut next[*corner as usize];
            fans[*slot as usize] = (4 * triangle + k) as u32;
            *slot += 1;
        }
    }
    (fans, starts)
}

fn parts(behind: &[[u32; 3]]) -> Vec<u32> {
    let mut part_of = vec![WALL; behind.len()];
    let mut count = 0;
    for first in 0..behind.len() {
        if part_of[first] != WALL {
            continue;
        }
        let mut waiting = vec![first];
        part_of[first] = count;
        while let Some(triangle) = waiting.pop() {
            for other in behind[triangle].iter().filter(|other| **other != WALL).map(|other| (other / 4) as usize) {
                if part_of[other] == WALL {
                    part_of[other] = count;
                    waiting.push(other);
                }
            }
        }
        count += 1;
    }
    part_of
}

/// The nearest point of a triangle that turns left.
fn nearest_of([a, b, c]: [&Point2<f64>; 3], p: &Point2<f64>) -> Point2<f64> {
    let sides = [(a, b), (b, c), (c, a)];
    if sides.iter().all(|(from, to)| turn(from, to, p) >= 0.0) {
        return *p;
    }
    let on_side = |(from, to): (&Point2<f64>, &Point2<f64>)| {
        let along = to - from;
        from + along * ((p - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0)
    };
    let nearest = sides.map(on_side);
    let distance = |q: &&Point2<f64>| (*q - p).norm_squared();
    *nearest.iter().min_by(|q, r| distance(q).total_cmp(&distance(r))).unwrap_or(a)
}

/// Triangles by the squares that their boxes meet.
#[derive(Debug, Clone)]
struct Buckets {
    origin: Point2<f64>,
    side: f64,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Buckets {
    fn new(points: &[Point2<f64>], corners: &[[u32; 3]]) -> Buckets {
        let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
        let mut high = Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY);
        for p in points {
            (low, high) = (low.inf(p), high.sup(p));
        }
        let size: Vector2<f64> = high - low;
        let side = (size.x * size.y / corners.len().max(1) as f64).sqrt().max(size.x.max(size.y) / 1024.0).max(1e-300);
        let count = |length: f64| (length / side).floor().min(1024.0) as usize + 1;
        let (columns, rows) = (count(size.x), count(size.y));
        let mut buckets = Buckets { origin: low, side, columns, rows, starts: Vec::new(), triangles: Vec::new() };
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (triangle, corners) in corners.iter().enumerate() {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            let ((x0, y0), (x1, y1)) = (buckets.square(&a.inf(&b).inf(&c)), buckets.square(&a.sup(&b).sup(&c)));
            let squares = (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| y * columns + x));
            pairs.extend(squares.map(|square| (square as u32, triangle as u32)));
        }
        pairs.sort_unstable();
        buckets.starts = vec![0; columns * rows + 1];
        for (square, _) in &pairs {
            buckets.starts[*square as usize + 1] += 1;
        }
        for k in 1..buckets.starts.len() {
            buckets.starts[k] += buckets.starts[k - 1];
        }
        buckets.triangles = pairs.into_iter().map(|(_, triangle)| triangle).collect();
        buckets
    }

    /// The square of a point; of one outside the nearest.
    fn square(&self, p: &Point2<f64>) -> (usize, usize) {
        let index = |x: f64, count: usize| (x / self.side).floor().clamp(0.0, (count - 1) as f64) as usize;
        (index(p.x - self.origin.x, self.columns), index(p.y - self.origin.y, self.rows))
    }

    fn near(&self, p: &Point2<f64>) -> &[u32] {
        let (x, y) = self.square(p);
        let square = y * self.columns + x;
        &self.triangles[self.starts[square] as usize..self.starts[square + 1] as usize]
    }
}
