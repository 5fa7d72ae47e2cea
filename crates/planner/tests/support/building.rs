//! Buildings of many rooms for robots that know nothing yet: truth, a scanner of limited range, what was seen, windows of it.

use nalgebra::{Point2, Point3};
use planner::ground::far::window::{Seen, Window};

use super::SplitMix;

/// A rectangle of cells, `[x0, y0, x1, y1]`, the last two not included.
pub type Rect = [i64; 4];

/// What really stands there.
#[derive(Debug, Clone)]
pub struct Building {
    pub voxel_m: f64,
    pub width: i64,
    pub height: i64,
    pub occupied: Vec<bool>,
    /// Middle of each room in metres.
    pub rooms: Vec<Point2<f64>>,
    /// Openings in the walls, and the two rooms they join.
    pub doors: Vec<(Rect, usize, usize)>,
    pub boxes: Vec<Rect>,
}

impl Building {
    /// `columns` x `rows` rooms of 5 x 4 m, walls one cell thick, joined by doors of 1.2 m: a tree of doors drawn from the seed (so that there
    /// are dead ends), every `extra`-th other wall opened as well, and `boxes` boxes a room.
    pub fn of_rooms(columns: usize, rows: usize, voxel_m: f64, seed: u64, extra: u64, boxes: usize) -> Self {
        let mut random = SplitMix(seed);
        let cell = |m: f64| (m / voxel_m).round() as i64;
        let (room_w, room_h, door) = (cell(5.0), cell(4.0), cell(1.2));
        let (width, height) = (columns as i64 * room_w + 1, rows as i64 * room_h + 1);
        let mut building = Building {
            voxel_m,
            width,
            height,
            occupied: vec![false; (width * height) as usize],
            rooms: Vec::new(),
            doors: Vec::new(),
            boxes: Vec::new(),
        };
        for c in 0..=columns as i64 {
            building.fill([c * room_w, 0, c * room_w + 1, height], true);
        }
        for r in 0..=rows as i64 {
            building.fill([0, r * room_h, width, r * room_h + 1], true);
        }
        let corner = |room: usize| ((room % columns) as i64 * room_w, (room / columns) as i64 * room_h);
        for room in 0..columns * rows {
            let (x, y) = corner(room);
            let middle = |low: i64, size: i64| (low as f64 + 0.5 * (size + 1) as f64) * voxel_m;
            building.rooms.push(Point2::new(middle(x, room_w), middle(y, room_h)));
        }
        // Walls between rooms in a drawn order; a door where it joins two parts (Kruskal), and now and then besides.
        let mut walls: Vec<(u64, usize, usize)> = Vec::new();
        for room in 0..columns * rows {
            if room % columns + 1 < columns {
                walls.push((random.next(), room, room + 1));
            }
            if room / columns + 1 < rows {
                walls.push((random.next(), room, room + columns));
            }
        }
        walls.sort_unstable();
        let mut part: Vec<usize> = (0..columns * rows).collect();
        for (k, (_, a, b)) in walls.into_iter().enumerate() {
            let (pa, pb) = (part[a], part[b]);
            if pa == pb && (extra == 0 || !(k as u64).is_multiple_of(extra)) {
                continue;
            }
            part.iter_mut().filter(|p| **p == pb).for_each(|p| *p = pa);
            let ((x, y), along) = (corner(b), (random.unit() * 0.6 + 0.2));
            let rect = if b == a + 1 {
                let low = y + 1 + ((room_h - 1 - door) as f64 * along) as i64;
                [x, low, x + 1, low + door]
            } else {
                let low = x + 1 + ((room_w - 1 - door) as f64 * along) as i64;
                [low, y, low + door, y + 1]
            };
            building.fill(rect, false);
            building.doors.push((rect, a, b));
        }
        for room in 0..columns * rows {
            let (x, y) = corner(room);
            for _ in 0..boxes {
                let size = |random: &mut SplitMix| cell(0.3 + 0.7 * random.unit()).max(1);
                let (w, h) = (size(&mut random), size(&mut random));
                // Away from the walls by a little more than the robot needs (0.8 m), and from the middle of the room.
                let gap = cell(0.9);
                let place = |random: &mut SplitMix, low: i64, room: i64, size: i64| {
                    low + gap + (random.unit() * (room - 2 * gap - size).max(1) as f64) as i64
                };
                let (bx, by) = (place(&mut random, x, room_w, w), place(&mut random, y, room_h, h));
                let middle = building.rooms[room] / voxel_m;
                let keeps = cell(0.6) as f64;
                let is_off = (bx as f64 - keeps > middle.x || ((bx + w) as f64) + keeps < middle.x)
                    || (by as f64 - keeps > middle.y || ((by + h) as f64) + keeps < middle.y);
                if is_off {
                    building.put_box([bx, by, bx + w, by + h]);
                }
            }
        }
        building
    }

    pub fn put_box(&mut self, rect: Rect) {
        self.fill(rect, true);
        self.boxes.push(rect);
    }

    pub fn fill(&mut self, rect: Rect, value: bool) {
        for y in rect[1].max(0)..rect[3].min(self.height) {
            for x in rect[0].max(0)..rect[2].min(self.width) {
                self.occupied[(y * self.width + x) as usize] = value;
            }
        }
    }

    pub fn is_occupied(&self, x: i64, y: i64) -> bool {
        x < 0 || y < 0 || x >= self.width || y >= self.height || self.occupied[(y * self.width + x) as usize]
    }

    /// Distance from a point to the nearest occupied square, by looking at all within `reach_m` (returned if there is none).
    pub fn distance(&self, p: &Point2<f64>, reach_m: f64) -> f64 {
        let p = p / self.voxel_m;
        let reach = reach_m / self.voxel_m;
        let mut best = reach;
        for y in (p.y - reach).floor() as i64..=(p.y + reach).floor() as i64 {
            for x in (p.x - reach).floor() as i64..=(p.x + reach).floor() as i64 {
                if self.is_occupied(x, y) {
                    let dx = (x as f64 - p.x).max(p.x - x as f64 - 1.0).max(0.0);
                    let dy = (y as f64 - p.y).max(p.y - y as f64 - 1.0).max(0.0);
                    best = best.min(dx.hypot(dy));
                }
            }
        }
        best * self.voxel_m
    }

    /// The room in which a point is nearest to the middle.
    pub fn room_at(&self, p: &Point2<f64>) -> usize {
        let off = |k: &usize| (self.rooms[*k] - p).norm_squared();
        (0..self.rooms.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
    }
}

/// What a robot has seen of a building.
#[derive(Debug, Clone)]
pub struct Belief {
    pub width: i64,
    pub height: i64,
    pub voxel_m: f64,
    pub seen: Vec<Seen>,
}

impl Belief {
    pub fn new(building: &Building) -> Self {
        let (width, height) = (building.width, building.height);
        Belief { width, height, voxel_m: building.voxel_m, seen: vec![Seen::Unknown; (width * height) as usize] }
    }

    /// Everything as it is.
    pub fn of_all(building: &Building) -> Self {
        let seen = building.occupied.iter().map(|o| if *o { Seen::Occupied } else { Seen::Free }).collect();
        Belief { seen, ..Belief::new(building) }
    }

    pub fn get(&self, x: i64, y: i64) -> Seen {
        if x < 0 || y < 0 || x >= self.width || y >= self.height {
            return Seen::Unknown;
        }
        self.seen[(y * self.width + x) as usize]
    }

    /// A full turn of a scanner: rays walk from cell to cell until they meet something.
    pub fn scan(&mut self, building: &Building, at: &Point2<f64>, range_m: f64, rays: usize) {
        self.scan_with(building, at, range_m, rays, || 0.0);
    }

    /// The same, with every range off by what `noise_m` says.
    pub fn scan_with(
        &mut self,
        building: &Building,
        at: &Point2<f64>,
        range_m: f64,
        rays: usize,
        mut noise_m: impl FnMut() -> f64,
    ) {
        let p = at / self.voxel_m;
        let range = range_m / self.voxel_m;
        for k in 0..rays {
            let (sin, cos) = (std::f64::consts::TAU * (k as f64 + 0.5) / rays as f64).sin_cos();
            let (mut x, mut y) = (p.x.floor() as i64, p.y.floor() as i64);
            let next = |c: f64, d: f64| if d > 0.0 { (c.floor() + 1.0 - c) / d } else { (c.floor() - c) / d };
            let mut entered = 0.0;
            let (mut tx, mut ty) = (next(p.x, cos), next(p.y, sin));
            loop {
                if x < 0 || y < 0 || x >= self.width || y >= self.height {
                    break;
                }
                let cell = (y * self.width + x) as usize;
                if building.occupied[cell] {
                    // The point that is measured lies a little before or behind the surface.
                    let off = noise_m() / self.voxel_m;
                    let reach = if off == 0.0 { 0.0 } else { entered + off };
                    let (hx, hy) = ((p.x + cos * reach).floor() as i64, (p.y + sin * reach).floor() as i64);
                    let hit = if off == 0.0 { cell } else { (hy * self.width + hx) as usize };
                    if off == 0.0 || (hx >= 0 && hy >= 0 && hx < self.width && hy < self.height) {
                        self.seen[hit] = Seen::Occupied;
                    }
                    break;
                }
                self.seen[cell] = Seen::Free;
                if tx.min(ty) > range {
                    break;
                }
                entered = tx.min(ty);
                if tx < ty {
                    x += if cos > 0.0 { 1 } else { -1 };
                    tx += (1.0 / cos).abs();
                } else {
                    y += if sin > 0.0 { 1 } else { -1 };
                    ty += (1.0 / sin).abs();
                }
            }
        }
    }

    /// The square of `side` cells round a place, into `cells`.
    pub fn window<'a>(&self, at: &Point2<f64>, side: usize, cells: &'a mut Vec<Seen>) -> Window<'a> {
        let half = side as i64 / 2;
        let first_cell = [(at.x / self.voxel_m).floor() as i64 - half, (at.y / self.voxel_m).floor() as i64 - half];
        cells.clear();
        cells.resize(side * side, Seen::Unknown);
        for (j, row) in cells.chunks_exact_mut(side).enumerate() {
            let y = first_cell[1] + j as i64;
            if y < 0 || y >= self.height {
                continue;
            }
            let (low, high) = (first_cell[0].max(0), (first_cell[0] + side as i64).min(self.width));
            if low < high {
                let to = (low - first_cell[0]) as usize;
                let from = (y * self.width + low) as usize;
                row[to..to + (high - low) as usize].copy_from_slice(&self.seen[from..from + (high - low) as usize]);
            }
        }
        Window { first_cell, width: side, height: side, seen: cells }
    }
}

/// A place on the ground floor.
pub fn ground(p: &Point2<f64>) -> Point3<f64> {
    Point3::new(p.x, p.y, 0.0)
}

/// Moves a point robot along points by `step_m`.
pub fn advance(from: &Point2<f64>, points: &[Point2<f64>], step_m: f64) -> Point2<f64> {
    let (mut at, mut left) = (*from, step_m);
    for p in points {
        let leg = p - at;
        let length = leg.norm();
        if length > left {
            return at + leg * (left / length);
        }
        (at, left) = (*p, left - length);
    }
    at
}
