//! Whether a place or a straight way keeps the clearance from all that was seen: exact, by a march along stored distances.

use nalgebra::{Point2, Vector2};

use super::super::clearance::HALF_DIAGONAL;
use super::memory::{Memory, Spot};
use super::tile::{SIDE, Through, Tile};

impl Memory {
    /// Whether a spot is at least the clearance away from everything a way may not touch. Exact.
    pub fn is_free(&self, spot: &Spot, through: Through) -> bool {
        Reader::new(self, spot, spot, through).is_free(&spot.at)
    }

    /// Whether the straight segment stays on one storey and keeps the clearance, both ends included. Exact: the nearest point of a union of
    /// squares to a segment with free ends is a convex corner, or the segment crosses the union, which the march sees.
    pub fn is_clear(&self, a: &Spot, b: &Spot, through: Through) -> bool {
        let is_level = (a.floor_m - b.floor_m).abs() <= self.same_layer_m;
        let mut reader = Reader::new(self, a, b, through);
        is_level && reader.is_free(&a.at) && reader.is_free(&b.at) && reader.is_passable()
    }
}

/// Reads distances along one segment; keeps the tile it is on.
struct Reader<'a> {
    memory: &'a Memory,
    from: &'a Spot,
    across: Vector2<f64>,
    rise_m: f64,
    through: Through,
    key: (i32, i32),
    tile: Option<&'a Tile>,
}

impl<'a> Reader<'a> {
    fn new(memory: &'a Memory, from: &'a Spot, to: &Spot, through: Through) -> Self {
        let mut reader = Reader {
            memory,
            from,
            across: to.at - from.at,
            rise_m: to.floor_m - from.floor_m,
            through,
            key: (0, 0),
            tile: None,
        };
        reader.enter((0, 0));
        reader
    }

    fn enter(&mut self, key: (i32, i32)) {
        // The floor of the segment beside the middle of the tile: the same from either end.
        let mut floor_m = self.from.floor_m;
        if self.rise_m != 0.0 {
            let middle = Point2::new((f64::from(key.0) + 0.5) * SIDE as f64, (f64::from(key.1) + 0.5) * SIDE as f64);
            let along = (middle - self.from.at).dot(&self.across) / self.across.norm_squared().max(1e-12);
            floor_m += self.rise_m * along.clamp(0.0, 1.0);
        }
        self.key = key;
        self.tile = self.memory.tile_at(key, floor_m).map(|id| &self.memory.tiles[id as usize]);
    }

    fn tile(&mut self, key: (i32, i32)) -> Option<&'a Tile> {
        if key != self.key {
            self.enter(key);
        }
        self.tile
    }

    /// Distance at the lattice point nearest to `(x, y)`: the true one differs by at most half a diagonal.
    fn nearest(&mut self, x: f64, y: f64) -> f64 {
        let (i, j) = ((x + 0.5).floor() as i64, (y + 0.5).floor() as i64);
        let tile = self.tile(((i >> 6) as i32, (j >> 6) as i32));
        let squared = match (tile, self.through) {
            (Some(tile), through) => tile.barrier(through).squared[(j & 63) as usize][(i & 63) as usize],
            (None, Through::Known) => 0,
            (None, Through::Unknown) => 255,
        };
        self.memory.root(squared)
    }

    fn is_free(&mut self, p: &Point2<f64>) -> bool {
        let radius = self.memory.radius;
        let near = self.nearest(p.x, p.y);
        if near - HALF_DIAGONAL >= radius {
            return true;
        }
        near + HALF_DIAGONAL >= radius && self.squares_are_beyond(p)
    }

    /// Whether no square is nearer to a point than the radius, by looking at each.
    fn squares_are_beyond(&mut self, p: &Point2<f64>) -> bool {
        let radius = self.memory.radius;
        let limit = radius * radius - 1e-9;
        for y in (p.y - radius).floor() as i64..=(p.y + radius).floor() as i64 {
            let dy = (y as f64 - p.y).max(p.y - y as f64 - 1.0).max(0.0);
            for x in (p.x - radius).floor() as i64..=(p.x + radius).floor() as i64 {
                let dx = (x as f64 - p.x).max(p.x - x as f64 - 1.0).max(0.0);
                if dx * dx + dy * dy < limit && self.is_barred(x, y) {
                    return false;
                }
            }
        }
        true
    }

    fn is_barred(&mut self, x: i64, y: i64) -> bool {
        let through = self.through;
        let tile = self.tile(((x >> 6) as i32, (y >> 6) as i32));
        let bit = |rows: &[u64; SIDE]| rows[(y & 63) as usize] >> (x & 63) & 1 == 1;
        match (tile, through) {
            (Some(tile), Through::Known) => !bit(&tile.free),
            (Some(tile), Through::Unknown) => bit(&tile.occupied),
            (None, through) => through == Through::Known,
        }
    }

    /// The march along the segment, whose ends are free.
    fn is_passable(&mut self) -> bool {
        let length = self.across.norm();
        if length < 1e-12 {
            return true;
        }
        let (radius, a, direction) = (self.memory.radius, self.from.at, self.across / length);
        let mut unsure: Option<(f64, f64)> = None;
        let mut s = 0.0;
        loop {
            let distance = self.nearest(a.x + direction.x * s, a.y + direction.y * s);
            if distance + HALF_DIAGONAL < radius {
                return false;
            }
            let spare = distance - HALF_DIAGONAL - radius;
            if spare < 0.5 {
                unsure = Some((unsure.map_or(s - 0.5, |u| u.0), s + 0.5));
            } else if let Some((low, high)) = unsure.take()
                && !self.corners_are_beyond(&direction, low.max(0.0), high.min(length))
            {
                return false;
            }
            if s >= length {
                break;
            }
            s = (s + spare.max(0.5)).min(length);
        }
        unsure.is_none_or(|(low, high)| self.corners_are_beyond(&direction, low.max(0.0), high.min(length)))
    }

    /// Whether no convex corner is nearer than the radius to the part `[low, high]` of the segment.
    fn corners_are_beyond(&mut self, direction: &Vector2<f64>, low: f64, high: f64) -> bool {
        let (radius, a, through) = (self.memory.radius, self.from.at, self.through);
        // Strictly inside only: a corner at exactly the clearance is fine (1e-9: rounding of the projections).
        let limit = radius * radius - 1e-9;
        let (p, q) = (a + direction * low, a + direction * high);
        for j in (p.y.min(q.y) - radius).ceil() as i64..=(p.y.max(q.y) + radius).floor() as i64 {
            // The part of the segment within the radius of this row of lattice points.
            let (mut s0, mut s1) = (low, high);
            if direction.y.abs() > 1e-12 {
                let (t0, t1) = ((j as f64 - radius - a.y) / direction.y, (j as f64 + radius - a.y) / direction.y);
                s0 = s0.max(t0.min(t1));
                s1 = s1.min(t0.max(t1));
                if s0 > s1 {
                    continue;
                }
            }
            let (x0, x1) = (a.x + direction.x * s0, a.x + direction.x * s1);
            let (i0, i1) = ((x0.min(x1) - radius).ceil() as i64, (x0.max(x1) + radius).floor() as i64);
            for tx in i0 >> 6..=i1 >> 6 {
                let mut bits = match (self.tile((tx as i32, (j >> 6) as i32)), through) {
                    (Some(tile), _) => tile.barrier(through).corners[(j & 63) as usize],
                    // Nothing is known there: only its own corner can stick out into what is.
                    (None, Through::Known) => u64::from(j & 63 == 0),
                    (None, Through::Unknown) => 0,
                };
                let first = (i0 - tx * 64).clamp(0, 63);
                let last = (i1 - tx * 64).clamp(0, 63);
                bits &= (u64::MAX << first) & (u64::MAX >> (63 - last));
                while bits != 0 {
                    let i = tx * 64 + i64::from(bits.trailing_zeros());
                    bits &= bits - 1;
                    let w = Point2::new(i as f64, j as f64) - a;
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
