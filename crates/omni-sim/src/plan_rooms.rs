//! A floor plan as pixels with rooms: where each ends, which openings join them, and a neighbourhood of a few of them.
//!
//! Rows run from south to north, one ring of solid pixels lies all round. Whoever labels the rooms labels their middles; every
//! free pixel that is joined to a labelled one belongs to the nearest label, so two rooms touch in the opening between them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::{Point2, Vector2};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::building::{DoorAxis, Rect};
use crate::floor::distance_to_blocked;

/// Solid pixels: wall, outside, a room that was left out.
pub const SOLID: u32 = 0;
/// Narrower openings are slits, not doors, metres.
const SLIT_M: f64 = 0.45;
/// Smaller rooms are left out of a cut, square metres.
const SMALLEST_ROOM_M2: f64 = 4.0;
/// ... and so are those in which the robot's middle has less than this to be at, square metres.
const LEAST_SPACE_M2: f64 = 0.8;

/// Rooms on pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRooms {
    /// Pixels from west to east.
    pub width: usize,
    /// Pixels from south to north.
    pub height: usize,
    /// Edge of a pixel, metres.
    pub resolution_m: f64,
    /// [`SOLID`], or the room's number from 1, row by row from the south-west corner at the origin.
    pub room: Vec<u32>,
    /// Distance to the nearest solid pixel, metres.
    clearance_m: Vec<f32>,
}

/// An opening between two rooms.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    /// The rooms, smaller number first.
    pub rooms: (u32, u32),
    /// Its middle: the place with most room.
    pub center: Point2<f64>,
    /// Width of the widest ball that rolls through.
    pub width_m: f64,
    /// Direction in which one walks through.
    pub axis: DoorAxis,
    /// Unit vector along the axis from the first room into the second.
    pub into_second: Vector2<f64>,
    /// Pixels on both sides of the border.
    pub pixels: Vec<usize>,
}

/// A straight piece of a border between pixels, in pixels, with what was asked for on the left-hand side of `from` -> `to`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct PixelRun {
    /// Runs along y.
    pub vertical: bool,
    /// The constant coordinate.
    pub line: usize,
    /// Smaller end of the other coordinate.
    pub low: usize,
    /// Larger end.
    pub high: usize,
    /// What was asked for lies on the side of larger coordinates.
    pub is_beyond: bool,
}

impl PlanRooms {
    /// Rooms grown from labels (0 for none, any other number for a room) over the free pixels; both row by row from the north-west
    /// corner, `width * height` of them. Rooms are numbered by their labels.
    pub fn grown(free: &[bool], labels: &[u32], width: usize, height: usize, resolution_m: f64) -> PlanRooms {
        let numbers: BTreeSet<u32> = labels.iter().copied().filter(|label| *label != 0).collect();
        let number_of: BTreeMap<u32, u32> = numbers.into_iter().zip(1..).collect();
        let (w, h) = (width + 2, height + 2);
        let mut is_free = vec![false; w * h];
        let mut room = vec![SOLID; w * h];
        for row in 0..height {
            for column in 0..width {
                let (from, to) = (row * width + column, (height - row) * w + column + 1);
                is_free[to] = free[from];
                room[to] = if free[from] { number_of.get(&labels[from]).copied().unwrap_or(SOLID) } else { SOLID };
            }
        }
        let mut queue: VecDeque<usize> = (0..w * h).filter(|at| room[*at] != SOLID).collect();
        while let Some(at) = queue.pop_front() {
            for next in [at - 1, at + 1, at - w, at + w] {
                if is_free[next] && room[next] == SOLID {
                    room[next] = room[at];
                    queue.push_back(next);
                }
            }
        }
        PlanRooms::of(room, w, h, resolution_m)
    }

    fn of(room: Vec<u32>, width: usize, height: usize, resolution_m: f64) -> PlanRooms {
        let is_free: Vec<bool> = room.iter().map(|room| *room != SOLID).collect();
        let scale = resolution_m / crate::floor::CELL_M;
        let clearance_m =
            distance_to_blocked(&is_free, width, height).into_iter().map(|d| (f64::from(d) * scale) as f32).collect();
        PlanRooms { width, height, resolution_m, room, clearance_m }
    }

    /// Number of rooms.
    pub fn count(&self) -> usize {
        self.room.iter().copied().max().unwrap_or(SOLID) as usize
    }

    /// South-west corner of a pixel.
    pub fn corner(&self, x: usize, y: usize) -> Point2<f64> {
        Point2::new(x as f64 * self.resolution_m, y as f64 * self.resolution_m)
    }

    /// Middle of a pixel.
    pub fn center(&self, at: usize) -> Point2<f64> {
        let half = self.resolution_m / 2.0;
        self.corner(at % self.width, at / self.width) + Vector2::new(half, half)
    }

    /// Distance from a pixel's middle to the nearest solid one, less half a pixel, metres.
    pub fn clearance_m(&self, at: usize) -> f64 {
        f64::from(self.clearance_m[at])
    }

    /// Area of each room, the first at index 1, square metres.
    pub fn areas_m2(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.count() + 1];
        self.room.iter().for_each(|room| areas[*room as usize] += self.resolution_m * self.resolution_m);
        areas
    }

    /// Covers the pixels that satisfy `take` with disjoint rectangles, the largest first.
    pub fn rects(&self, take: impl Fn(usize) -> bool) -> Vec<Rect> {
        let (w, h) = (self.width, self.height);
        let mut open: Vec<bool> = (0..w * h).map(take).collect();
        let mut rects = Vec::new();
        for y in 0..h {
            for x in 0..w {
                if !open[y * w + x] {
                    continue;
                }
                let x1 = (x..w).find(|x| !open[y * w + x]).unwrap_or(w);
                let y1 = (y..h).find(|y| !(x..x1).all(|x| open[y * w + x])).unwrap_or(h);
                (y..y1).for_each(|y| open[y * w + x..y * w + x1].fill(false));
                let (low, high) = (self.corner(x, y), self.corner(x1, y1));
                rects.push(Rect { min: low, max: high });
            }
        }
        rects.sort_by(|a, b| b.area_m2().total_cmp(&a.area_m2()));
        rects
    }

    /// Borders of the pixels that satisfy `inside` towards those that satisfy `beyond`, as straight runs.
    pub fn runs(&self, inside: impl Fn(usize) -> bool, beyond: impl Fn(usize) -> bool) -> Vec<PixelRun> {
        let (w, h) = (self.width, self.height);
        let mut runs: Vec<PixelRun> = Vec::new();
        let mut push = |run: PixelRun| match runs.last_mut() {
            Some(last)
                if last.high == run.low
                    && (last.vertical, last.line, last.is_beyond) == (run.vertical, run.line, run.is_beyond) =>
            {
                last.high = run.high;
            }
            _ => runs.push(run),
        };
        for is_beyond in [true, false] {
            for y in 1..h {
                for x in 0..w {
                    let (south, north) = ((y - 1) * w + x, y * w + x);
                    let (own, other) = if is_beyond { (north, south) } else { (south, north) };
                    if inside(own) && beyond(other) {
                        push(PixelRun { vertical: false, line: y, low: x, high: x + 1, is_beyond });
                    }
                }
            }
            for x in 1..w {
                for y in 0..h {
                    let (west, east) = (y * w + x - 1, y * w + x);
                    let (own, other) = if is_beyond { (east, west) } else { (west, east) };
                    if inside(own) && beyond(other) {
                        push(PixelRun { vertical: true, line: x, low: y, high: y + 1, is_beyond });
                    }
                }
            }
        }
        runs
    }

    /// The ends of a run, what was asked for on the left-hand side.
    pub fn ends(&self, run: &PixelRun) -> (Point2<f64>, Point2<f64>) {
        let point = |along: usize| {
            if run.vertical { self.corner(run.line, along) } else { self.corner(along, run.line) }
        };
        // North of a line that runs east is its left-hand side, east of one that runs south too.
        let forward = run.vertical != run.is_beyond;
        if forward { (point(run.low), point(run.high)) } else { (point(run.high), point(run.low)) }
    }

    /// Openings between rooms, by their rooms and then from south to north. Slits are left out.
    pub fn openings(&self) -> Vec<Opening> {
        let w = self.width;
        let mut borders: BTreeMap<(u32, u32), BTreeSet<usize>> = BTreeMap::new();
        for at in 0..self.room.len() {
            let (x, y) = (at % w, at / w);
            let neighbours = [(x + 1 < w).then(|| at + 1), (y + 1 < self.height).then(|| at + w)];
            for next in neighbours.into_iter().flatten() {
                let (a, b) = (self.room[at], self.room[next]);
                if a != b && a != SOLID && b != SOLID {
                    borders.entry((a.min(b), a.max(b))).or_default().extend([at, next]);
                }
            }
        }
        let mut openings = Vec::new();
        for (rooms, mut left) in borders {
            while let Some(first) = left.pop_first() {
                let mut pixels = vec![first];
                let mut next = 0;
                while next < pixels.len() {
                    let at = pixels[next];
                    for other in [at - w - 1, at - w, at - w + 1, at - 1, at + 1, at + w - 1, at + w, at + w + 1] {
                        if left.remove(&other) {
                            pixels.push(other);
                        }
                    }
                    next += 1;
                }
                pixels.sort_unstable();
                openings.extend(self.opening(rooms, pixels));
            }
        }
        openings
    }

    fn opening(&self, rooms: (u32, u32), pixels: Vec<usize>) -> Option<Opening> {
        let mean = |of: &dyn Fn(usize) -> bool| {
            let chosen: Vec<usize> = pixels.iter().copied().filter(|at| of(*at)).collect();
            let sum: Vector2<f64> = chosen.iter().map(|at| self.center(*at).coords).sum();
            Point2::from(sum / chosen.len().max(1) as f64)
        };
        let middle = mean(&|_| true);
        let off = |at: usize| (self.center(at) - middle).norm_squared();
        let widest = pixels
            .iter()
            .copied()
            .max_by(|a, b| self.clearance_m[*a].total_cmp(&self.clearance_m[*b]).then(off(*b).total_cmp(&off(*a))))?;
        // The border of two pixels' rows: the ball's middle lies on a pixel's, so half a pixel is missing on each side.
        let width_m = 2.0 * self.clearance_m(widest) + self.resolution_m;
        let extent = |of: &dyn Fn(usize) -> usize| {
            let values = pixels.iter().map(|at| of(*at));
            values.clone().max().unwrap_or(0) - values.min().unwrap_or(0)
        };
        let (wide, high) = (extent(&|at| at % self.width), extent(&|at| at / self.width));
        let axis = if high >= wide { DoorAxis::X } else { DoorAxis::Y };
        let across = mean(&|at| self.room[at] == rooms.1) - mean(&|at| self.room[at] == rooms.0);
        let into_second = match axis {
            DoorAxis::X => Vector2::new(if across.x < 0.0 { -1.0 } else { 1.0 }, 0.0),
            _ => Vector2::new(0.0, if across.y < 0.0 { -1.0 } else { 1.0 }),
        };
        let center = self.center(widest);
        (width_m >= SLIT_M).then_some(Opening { rooms, center, width_m, axis, into_second, pixels })
    }

    /// `count` rooms round a drawn one that a disc of this radius can visit from there, all else solid; fewer if there are not so
    /// many together, and at least two. Rooms behind narrower openings are left out: no opening is widened, none is made.
    pub fn cut(&self, rng: &mut ChaCha8Rng, count: usize, radius_m: f64) -> Option<PlanRooms> {
        let is_core = self.cores(radius_m);
        let pixel_m2 = self.resolution_m * self.resolution_m;
        let areas = self.areas_m2();
        let mut core_m2 = vec![0.0; areas.len()];
        (0..is_core.len()).filter(|at| is_core[*at]).for_each(|at| core_m2[self.room[at] as usize] += pixel_m2);
        let suits = |room: u32| areas[room as usize] >= SMALLEST_ROOM_M2 && core_m2[room as usize] >= LEAST_SPACE_M2;
        let mut joined: BTreeSet<(u32, u32)> = BTreeSet::new();
        for at in 0..self.room.len() - self.width {
            for next in [at + 1, at + self.width] {
                let (a, b) = (self.room[at], self.room[next]);
                if a != b && is_core[at] && is_core[next] && suits(a) && suits(b) {
                    joined.extend([(a, b), (b, a)]);
                }
            }
        }
        let mut seeds: Vec<u32> = (1..areas.len() as u32).filter(|room| suits(*room)).collect();
        seeds.shuffle(rng);
        let mut best: Vec<u32> = Vec::new();
        for seed in seeds {
            let mut kept = vec![seed];
            while kept.len() < count {
                let edge: Vec<u32> =
                    joined.iter().filter(|(a, b)| kept.contains(a) && !kept.contains(b)).map(|(_, b)| *b).collect();
                if edge.is_empty() {
                    break;
                }
                kept.push(edge[rng.random_range(0..edge.len())]);
            }
            if kept.len() > best.len() {
                best = kept;
            }
            if best.len() >= count {
                break;
            }
        }
        best.sort_unstable();
        (best.len() >= 2).then(|| self.only(&best))
    }

    /// Of every room the largest connected part in which a disc of this radius fits.
    fn cores(&self, radius_m: f64) -> Vec<bool> {
        let w = self.width;
        let fits = |at: usize| self.room[at] != SOLID && self.clearance_m(at) >= radius_m;
        let mut seen = vec![false; self.room.len()];
        let mut largest: Vec<Vec<usize>> = vec![Vec::new(); self.count() + 1];
        for first in 0..self.room.len() {
            if seen[first] || !fits(first) {
                continue;
            }
            seen[first] = true;
            let mut part = vec![first];
            let mut next = 0;
            while next < part.len() {
                let at = part[next];
                for other in [at - 1, at + 1, at - w, at + w] {
                    if !seen[other] && fits(other) && self.room[other] == self.room[at] {
                        seen[other] = true;
                        part.push(other);
                    }
                }
                next += 1;
            }
            let of = &mut largest[self.room[first] as usize];
            if part.len() > of.len() {
                *of = part;
            }
        }
        let mut is_core = vec![false; self.room.len()];
        largest.into_iter().flatten().for_each(|at| is_core[at] = true);
        is_core
    }

    /// These rooms, numbered anew in their order, on as few pixels as hold them.
    fn only(&self, kept: &[u32]) -> PlanRooms {
        let number = |room: u32| kept.iter().position(|k| *k == room).map_or(SOLID, |at| at as u32 + 1);
        let inside: Vec<usize> = (0..self.room.len()).filter(|at| kept.contains(&self.room[*at])).collect();
        let range = |of: &dyn Fn(usize) -> usize| {
            let values = inside.iter().map(|at| of(*at));
            (values.clone().min().unwrap_or(1) - 1, values.max().unwrap_or(1) + 1)
        };
        let ((x0, x1), (y0, y1)) = (range(&|at| at % self.width), range(&|at| at / self.width));
        let (w, h) = (x1 - x0 + 1, y1 - y0 + 1);
        let room = (0..w * h).map(|at| number(self.room[(y0 + at / w) * self.width + x0 + at % w])).collect();
        PlanRooms::of(room, w, h, self.resolution_m)
    }
}
