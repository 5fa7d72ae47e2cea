//! Corridors and the strips of rooms beside them: the bones of a plan with a spine.
//!
//! One corridor makes an I with a strip on each side (one strip may be shorter, or a large room closes the end); two make an L
//! or a T; three a U or a Z. Lengths follow from the area that the rooms ask for.

use rand::{Rng, RngExt};

use crate::floorplan::{Cells, UNIT_M};

/// A strip of rooms beside a corridor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Strip {
    area: Cells,
    /// Rooms follow each other along x (else along y).
    along_x: bool,
    /// The corridor lies at the larger coordinate of the other axis (north or east).
    corridor_high: bool,
}

impl Strip {
    /// The whole strip.
    pub fn area(&self) -> Cells {
        self.area
    }

    /// Extent along the corridor, units.
    pub fn length(&self) -> i32 {
        if self.along_x { self.area.x1 - self.area.x0 } else { self.area.y1 - self.area.y0 }
    }

    /// Extent away from the corridor, units.
    pub fn depth(&self) -> i32 {
        if self.along_x { self.area.y1 - self.area.y0 } else { self.area.x1 - self.area.x0 }
    }

    /// The piece from `l0` to `l1` along the corridor and from `d0` to `d1` away from it.
    pub fn cells(&self, l0: i32, l1: i32, d0: i32, d1: i32) -> Cells {
        let a = &self.area;
        let (base, low, high) = if self.along_x { (a.x0, a.y0, a.y1) } else { (a.y0, a.x0, a.x1) };
        let (e0, e1) = if self.corridor_high { (high - d1, high - d0) } else { (low + d0, low + d1) };
        if self.along_x { Cells::new(base + l0, e0, base + l1, e1) } else { Cells::new(e0, base + l0, e1, base + l1) }
    }

    /// Cuts a piece of full depth off the front; `None` if too little would be left for a room.
    pub fn take_front(&mut self, length: i32) -> Option<Cells> {
        if self.length() < length + 60 {
            return None;
        }
        let piece = self.cells(0, length, 0, self.depth());
        if self.along_x {
            self.area.x0 += length;
        } else {
            self.area.y0 += length;
        }
        Some(piece)
    }
}

/// Corridors and strips of one storey.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skeleton {
    /// Each is a room.
    pub corridors: Vec<Cells>,
    /// To be cut into rooms. Strip 0 holds the stairwell, if there is one.
    pub strips: Vec<Strip>,
    /// A room that closes the end of the corridor.
    pub end_room: Option<Cells>,
}

/// A random skeleton with this many corridors (1 to 3) whose rooms have `area_m2` together; `None` if the drawn lengths
/// contradict each other.
pub fn draw_skeleton(rng: &mut impl Rng, corridors: usize, area_m2: f64, with_stairs: bool) -> Option<Skeleton> {
    let area = area_m2 / (UNIT_M * UNIT_M);
    match corridors {
        1 => single(rng, area, with_stairs),
        2 => branched(rng, area, with_stairs),
        _ => double_branched(rng, area, with_stairs),
    }
}

/// Depth of a strip, units: 3.6 to 5.2 m, at least 4.6 m where stairs must fit.
fn depth(rng: &mut impl Rng, with_stairs: bool) -> i32 {
    if with_stairs { rng.random_range(47..=53) * 2 } else { rng.random_range(36..=52) * 2 }
}

/// Width of a corridor, units: 1.6 to 2.2 m between centre lines.
fn corridor_width(rng: &mut impl Rng) -> i32 {
    rng.random_range(16..=22) * 2
}

fn snapped(units: f64) -> i32 {
    (units / 2.0).round() as i32 * 2
}

fn row(x0: i32, y0: i32, x1: i32, y1: i32, corridor_high: bool) -> Strip {
    Strip { area: Cells::new(x0, y0, x1, y1), along_x: true, corridor_high }
}

fn column(x0: i32, y0: i32, x1: i32, y1: i32, corridor_high: bool) -> Strip {
    Strip { area: Cells::new(x0, y0, x1, y1), along_x: false, corridor_high }
}

/// An I: strip, corridor, strip.
fn single(rng: &mut impl Rng, area: f64, with_stairs: bool) -> Option<Skeleton> {
    let (d1, d2, c) = (depth(rng, with_stairs), depth(rng, false), corridor_width(rng));
    let (y1, y2, y3) = (d1, d1 + c, d1 + c + d2);
    let kind = rng.random_range(0..10);
    if kind < 4 {
        // A room of width `end` closes the corridor and takes the end of the upper strip too.
        let end = rng.random_range(38..=50) * 2;
        let length = snapped((area - f64::from(end * c)) / f64::from(d1 + d2));
        if length - end < 60 {
            return None;
        }
        return Some(Skeleton {
            corridors: vec![Cells::new(0, y1, length - end, y2)],
            strips: vec![row(0, 0, length, y1, true), row(0, y2, length - end, y3, false)],
            end_room: Some(Cells::new(length - end, y1, length, y3)),
        });
    }
    // Both strips run along; the upper may begin later.
    let late = if kind < 7 { 0 } else { rng.random_range(10..=40) * 2 };
    let length = snapped((area + f64::from(late * d2)) / f64::from(d1 + d2));
    if length - late < 60 {
        return None;
    }
    Some(Skeleton {
        corridors: vec![Cells::new(0, y1, length, y2)],
        strips: vec![row(0, 0, length, y1, true), row(late, y2, length, y3, false)],
        end_room: None,
    })
}

/// An L or a T: a second corridor leaves the first northwards.
fn branched(rng: &mut impl Rng, area: f64, with_stairs: bool) -> Option<Skeleton> {
    let (d1, d2, d3, d4) = (depth(rng, with_stairs), depth(rng, false), depth(rng, false), depth(rng, false));
    let (c1, c2) = (corridor_width(rng), corridor_width(rng));
    let (y1, y2, y3) = (d1, d1 + c1, d1 + c1 + d2);
    // The main wing takes 50 to 75 % of the area, the branch the rest.
    let main = area * rng.random_range(0.5..0.75);
    let length = snapped((main + f64::from(d2 * c2)) / f64::from(d1 + d2));
    let branch = snapped((area - main) / f64::from(d3 + d4));
    let spare = length - d3 - c2 - d4;
    if spare < 0 || branch < 60 {
        return None;
    }
    // An L (branch at the end) or a T with at least a room's width on the far side.
    let right = if rng.random_bool(0.5) { 0 } else { rng.random_range(0..=spare / 2) * 2 };
    let x2 = length - right - d4;
    let x1 = x2 - c2;
    Some(Skeleton {
        corridors: vec![Cells::new(0, y1, length, y2), Cells::new(x1, y2, x2, y3 + branch)],
        strips: vec![
            row(0, 0, length, y1, true),
            row(0, y2, x1, y3, false),
            row(x2, y2, length, y3, false),
            column(x1 - d3, y3, x1, y3 + branch, true),
            column(x2, y3, x2 + d4, y3 + branch, false),
        ],
        end_room: None,
    })
}

/// A U (both branches north) or a Z (one north, one south).
fn double_branched(rng: &mut impl Rng, area: f64, with_stairs: bool) -> Option<Skeleton> {
    let d: Vec<i32> = (0..6).map(|i| depth(rng, with_stairs && i == 0)).collect();
    let (c1, c2, c3) = (corridor_width(rng), corridor_width(rng), corridor_width(rng));
    let (y1, y2, y3) = (d[0], d[0] + c1, d[0] + c1 + d[1]);
    let main = area * rng.random_range(0.4..0.6);
    let length = snapped((main + f64::from(d[1] * c2)) / f64::from(d[0] + d[1]));
    let rest = (area - main) / 2.0;
    let (east, west) = (snapped(rest / f64::from(d[2] + d[3])), snapped(rest / f64::from(d[4] + d[5])));
    if east < 60 || west < 60 {
        return None;
    }
    // Eastern branch northwards at the end of the main wing.
    let x2 = length - d[3];
    let x1 = x2 - c2;
    let mut strips = Vec::new();
    let mut corridors = vec![Cells::new(0, y1, length, y2), Cells::new(x1, y2, x2, y3 + east)];
    // Western branch at the other end, northwards or southwards.
    let (w1, w2) = (d[4], d[4] + c3);
    let north = rng.random_bool(0.5);
    if north {
        // The court between the wings is at least 3 m wide.
        if x1 - d[2] - (w2 + d[5]) < 60 {
            return None;
        }
        corridors.push(Cells::new(w1, y2, w2, y3 + west));
        strips.push(row(0, 0, length, y1, true));
        strips.push(row(0, y2, w1, y3, false));
        strips.push(row(w2, y2, x1, y3, false));
        strips.push(column(0, y3, w1, y3 + west, true));
        strips.push(column(w2, y3, w2 + d[5], y3 + west, false));
    } else {
        if w2 + d[5] > length || x1 - d[2] < 0 {
            return None;
        }
        corridors.push(Cells::new(w1, -west, w2, y1));
        strips.push(row(w2, 0, length, y1, true));
        strips.push(row(0, 0, w1, y1, true));
        strips.push(row(0, y2, x1, y3, false));
        strips.push(column(0, -west, w1, 0, true));
        strips.push(column(w2, -west, w2 + d[5], 0, false));
    }
    strips.push(row(x2, y2, length, y3, false));
    strips.push(column(x1 - d[2], y3, x1, y3 + east, true));
    strips.push(column(x2, y3, length, y3 + east, false));
    Some(Skeleton { corridors, strips, end_room: None })
}
