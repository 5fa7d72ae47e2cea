//! Where the rooms lie: rectangles of a 5 cm raster that share their borders; a wall will stand on every border.
//!
//! Two families of plans. *Open*: a rectangle is cut in two again and again until every room has its piece (2 to 4 rooms).
//! *Spine*: corridors form an I, L, T, U or Z; strips of rooms lie on both sides, and small rooms are cut out of the corner of
//! their neighbour, which makes that one an L. Many random plans are drawn and the one that fits the wished areas and
//! proportions best is kept, mirrored and turned at random.
//! ```text
//!   +------+---------+-----+------+
//!   | bed  | living  | bath|      |      strip (depth d2)
//!   |      |         +-----+ bed  |
//!   |      |         | .... L ..  |
//!   +------+---------+------------+
//!   |  hallway                    |      corridor (width c)
//!   +-----------+---------+-------+
//!   |  kitchen  | study   | store |      strip (depth d1)
//!   +-----------+---------+-------+
//! ```

use rand::seq::SliceRandom;
use rand::{Rng, RngExt};

use crate::building::{RoomKind, Style};
use crate::fitness::{neighbour_bonus, room_cost};
use crate::program::{RoomWish, is_small, program, wish};
use crate::skeleton::{Skeleton, Strip, draw_skeleton};

/// Length of a plan unit: all wall centre lines lie on multiples of it.
pub const UNIT_M: f64 = 0.05;
/// Centre lines are drawn on even units only (10 cm), as builders do.
const STEP: i32 = 2;
/// Plans drawn for each storey.
const TRIALS: usize = 300;
/// Most plans drawn: large buildings are hard to fit, so they get more tries until a few acceptable plans are found.
const TRIALS_MAX: usize = 6000;
/// Acceptable plans to choose from.
const ACCEPTED: usize = 10;
/// Orders of rooms tried along each strip.
const STRIP_ORDERS: usize = 10;
/// Wall-to-wall width of a stairwell, units: two flights of 1.25 m.
pub const STAIRWELL_WIDTH: i32 = 54;

/// A rectangle in plan units, half open: wall centre lines on `x0`, `x1`, `y0`, `y1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cells {
    /// West.
    pub x0: i32,
    /// South.
    pub y0: i32,
    /// East.
    pub x1: i32,
    /// North.
    pub y1: i32,
}

impl Cells {
    /// From its four borders.
    pub fn new(x0: i32, y0: i32, x1: i32, y1: i32) -> Self {
        Self { x0, y0, x1, y1 }
    }

    /// Area, square metres.
    pub fn area_m2(&self) -> f64 {
        f64::from(self.x1 - self.x0) * f64::from(self.y1 - self.y0) * UNIT_M * UNIT_M
    }

    /// Longer side over shorter side.
    pub fn aspect(&self) -> f64 {
        let (w, h) = (f64::from(self.x1 - self.x0), f64::from(self.y1 - self.y0));
        w.max(h) / w.min(h)
    }

    /// Shorter side, metres.
    pub fn short_m(&self) -> f64 {
        f64::from((self.x1 - self.x0).min(self.y1 - self.y0)) * UNIT_M
    }
}

/// A room with its place: one rectangle, or several that touch.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRoom {
    /// Purpose.
    pub kind: RoomKind,
    /// Parts, disjoint, each touching the one before along a side.
    pub parts: Vec<Cells>,
}

/// One storey.
#[derive(Debug, Clone, PartialEq)]
pub struct StoreyPlan {
    /// All rooms; together they fill the outline.
    pub rooms: Vec<PlanRoom>,
}

/// Plans for all storeys: same outline, stairwell in the same place. `None` if nothing acceptable was drawn.
pub fn draw_plans(rng: &mut impl Rng, style: Style, rooms: usize, storeys: usize) -> Option<Vec<StoreyPlan>> {
    if storeys == 1 {
        let with_spine = rooms >= 5 || (rooms == 4 && rng.random_bool(0.4));
        let plan = if with_spine { draw_spine(rng, style, &[rooms])?.remove(0) } else { draw_open(rng, style, rooms)? };
        return Some(turned(rng, vec![plan]));
    }
    let upper = rooms / 2;
    let plans = draw_spine(rng, style, &[rooms - upper, upper])?;
    Some(turned(rng, plans))
}

/// Strips of rooms along corridors, for one or two storeys of the same skeleton.
fn draw_spine(rng: &mut impl Rng, style: Style, rooms: &[usize]) -> Option<Vec<StoreyPlan>> {
    let most = rooms.iter().copied().max()?;
    let with_stairs = rooms.len() > 1;
    let mut best: Option<(f64, Vec<StoreyPlan>)> = None;
    let mut accepted = 0;
    for trial in 0..TRIALS_MAX {
        if trial >= TRIALS && accepted >= ACCEPTED {
            break;
        }
        let corridors = corridor_count(rng, most);
        let stairs = usize::from(with_stairs);
        let wishes: Vec<Vec<RoomWish>> =
            rooms.iter().enumerate().map(|(s, &n)| program(rng, style, s as u32, n - corridors - stairs)).collect();
        let mean_area = wishes.iter().map(|w| w.iter().map(|x| x.area_m2).sum::<f64>()).sum::<f64>()
            / rooms.len() as f64
            + if with_stairs { wish(rng, RoomKind::Stairwell).area_m2 } else { 0.0 };
        let Some(skeleton) = draw_skeleton(rng, corridors, mean_area, with_stairs) else {
            continue;
        };
        let mut cost = 0.0;
        let mut plans = Vec::new();
        for wish in &wishes {
            let Some((c, plan)) = fill_skeleton(rng, style, &skeleton, wish.clone(), with_stairs) else {
                break;
            };
            cost += c;
            plans.push(plan);
        }
        if plans.len() < rooms.len() {
            continue;
        }
        accepted += 1;
        if best.as_ref().is_none_or(|(b, _)| cost < *b) {
            best = Some((cost, plans));
        }
    }
    best.map(|(_, plans)| plans)
}

/// Corridors that a storey of `rooms` rooms asks for, themselves counted among the rooms.
fn corridor_count(rng: &mut impl Rng, rooms: usize) -> usize {
    match rooms {
        0..=9 => 1,
        10..=11 => rng.random_range(1..=2),
        12..=16 => 2,
        17..=19 => rng.random_range(2..=3),
        _ => 3,
    }
}

/// Deals the rooms out to the strips and cuts each strip up; returns the cost (0 is perfect).
fn fill_skeleton(
    rng: &mut impl Rng,
    style: Style,
    skeleton: &Skeleton,
    mut wishes: Vec<RoomWish>,
    with_stairs: bool,
) -> Option<(f64, StoreyPlan)> {
    let corridor_kind = if style == Style::Flat { RoomKind::Hallway } else { RoomKind::Corridor };
    let mut rooms: Vec<PlanRoom> =
        skeleton.corridors.iter().map(|c| PlanRoom { kind: corridor_kind, parts: vec![*c] }).collect();
    let mut cost = 0.0;
    wishes.shuffle(rng);
    if let Some(end) = skeleton.end_room {
        let largest = (0..wishes.len()).max_by(|&a, &b| wishes[a].area_m2.total_cmp(&wishes[b].area_m2))?;
        let room = wishes.remove(largest);
        cost += room_cost(&room, &[end])?;
        rooms.push(PlanRoom { kind: room.kind, parts: vec![end] });
    }
    let mut strips = skeleton.strips.clone();
    if with_stairs {
        let stairs = strips[0].take_front(STAIRWELL_WIDTH)?;
        rooms.push(PlanRoom { kind: RoomKind::Stairwell, parts: vec![stairs] });
    }
    let total_wished: f64 = wishes.iter().map(|w| w.area_m2).sum();
    let total_strip: f64 = strips.iter().map(|s| s.area().area_m2()).sum();
    let mut next = 0;
    for (i, strip) in strips.iter().enumerate() {
        let quota = strip.area().area_m2() * total_wished / total_strip;
        let mut taken = 0.0;
        let from = next;
        let strips_left = strips.len() - 1 - i;
        while next < wishes.len() - strips_left.min(wishes.len()) {
            let more = wishes[next].area_m2;
            // Take the room if the quota is nearer with it than without it; the last strip takes all that is left.
            if next > from && strips_left > 0 && taken + 0.5 * more > quota {
                break;
            }
            taken += more;
            next += 1;
        }
        let (strip_cost, strip_rooms) = fill_strip_well(rng, strip, &wishes[from..next])?;
        cost += strip_cost;
        rooms.extend(strip_rooms);
    }
    if next != wishes.len() {
        return None;
    }
    cost -= neighbour_bonus(&rooms);
    Some((cost, StoreyPlan { rooms }))
}

/// The best of several orders of the rooms along a strip.
fn fill_strip_well(rng: &mut impl Rng, strip: &Strip, wishes: &[RoomWish]) -> Option<(f64, Vec<PlanRoom>)> {
    let mut order = wishes.to_vec();
    let mut best: Option<(f64, Vec<PlanRoom>)> = None;
    for _ in 0..STRIP_ORDERS {
        let mut rooms = Vec::new();
        if let Some(cost) = fill_strip(rng, strip, &order, &mut rooms)
            && best.as_ref().is_none_or(|(b, _)| cost < *b)
        {
            best = Some((cost, rooms));
        }
        order.shuffle(rng);
    }
    best
}

/// Cuts one strip into slots: a room each, or a small room in the corner of a larger one.
fn fill_strip(rng: &mut impl Rng, strip: &Strip, wishes: &[RoomWish], rooms: &mut Vec<PlanRoom>) -> Option<f64> {
    if wishes.is_empty() {
        return None;
    }
    let mut slots: Vec<&[RoomWish]> = Vec::new();
    let mut i = 0;
    while i < wishes.len() {
        let pair =
            i + 1 < wishes.len() && is_small(wishes[i].kind) != is_small(wishes[i + 1].kind) && strip.depth() >= 80;
        let width = if pair && rng.random_bool(0.75) { 2 } else { 1 };
        slots.push(&wishes[i..i + width]);
        i += width;
    }
    let total: f64 = wishes.iter().map(|w| w.area_m2).sum();
    let length = strip.length();
    let mut cost = 0.0;
    let mut at = 0;
    let mut done = 0.0;
    for slot in &slots {
        done += slot.iter().map(|w| w.area_m2).sum::<f64>();
        let end = ((f64::from(length) * done / total / f64::from(STEP)).round() as i32 * STEP).min(length);
        match slot {
            [one] => {
                let cells = strip.cells(at, end, 0, strip.depth());
                cost += room_cost(one, &[cells])?;
                rooms.push(PlanRoom { kind: one.kind, parts: vec![cells] });
            }
            [a, b] => {
                let (small, big) = if is_small(a.kind) { (a, b) } else { (b, a) };
                let depth = strip.depth();
                // The small room lies at the corridor, the large one keeps its own piece of corridor and bends behind it.
                let deepest = depth - 30;
                if deepest < 44 {
                    return None;
                }
                let small_depth = rng.random_range(22..=(deepest / STEP).min(34)) * STEP;
                let share = small.area_m2 / (small.area_m2 + big.area_m2);
                let wanted = share * f64::from(end - at) * f64::from(depth) / f64::from(small_depth);
                let small_width = (wanted / f64::from(STEP)).round() as i32 * STEP;
                if small_width < 44 || end - at - small_width < 50 {
                    return None;
                }
                let small_first = rng.random_bool(0.5);
                let cut = if small_first { at + small_width } else { end - small_width };
                let (s0, s1, b0, b1) = if small_first { (at, cut, cut, end) } else { (cut, end, at, cut) };
                let small_cells = strip.cells(s0, s1, 0, small_depth);
                let main = strip.cells(b0, b1, 0, depth);
                let behind = strip.cells(s0, s1, small_depth, depth);
                cost += room_cost(small, &[small_cells])? + room_cost(big, &[main, behind])? - 0.06;
                rooms.push(PlanRoom { kind: small.kind, parts: vec![small_cells] });
                rooms.push(PlanRoom { kind: big.kind, parts: vec![main, behind] });
            }
            _ => return None,
        }
        at = end;
    }
    Some(cost)
}

/// Cuts a rectangle in two until every room has its piece.
fn draw_open(rng: &mut impl Rng, style: Style, rooms: usize) -> Option<StoreyPlan> {
    let mut best: Option<(f64, StoreyPlan)> = None;
    for _ in 0..TRIALS {
        let mut wishes = program(rng, style, 0, rooms);
        wishes.shuffle(rng);
        let area: f64 = wishes.iter().map(|w| w.area_m2).sum();
        let aspect: f64 = rng.random_range(0.6..1.7);
        let snap = |metres: f64| (metres / UNIT_M / f64::from(STEP)).round() as i32 * STEP;
        let outline = Cells::new(0, 0, snap((area * aspect).sqrt()), snap((area / aspect).sqrt()));
        let mut plan = StoreyPlan { rooms: Vec::new() };
        let Some(mut cost) = split_open(rng, outline, &wishes, &mut plan.rooms) else {
            continue;
        };
        cost -= neighbour_bonus(&plan.rooms);
        if best.as_ref().is_none_or(|(b, _)| cost < *b) {
            best = Some((cost, plan));
        }
    }
    best.map(|(_, plan)| plan)
}

/// One cut of [`draw_open`]: the longer side is divided in proportion to the areas of the two halves of the list.
fn split_open(rng: &mut impl Rng, area: Cells, wishes: &[RoomWish], rooms: &mut Vec<PlanRoom>) -> Option<f64> {
    if let [one] = wishes {
        rooms.push(PlanRoom { kind: one.kind, parts: vec![area] });
        return room_cost(one, &[area]);
    }
    let cut = rng.random_range(1..wishes.len());
    let sum = |w: &[RoomWish]| w.iter().map(|x| x.area_m2).sum::<f64>();
    let share = sum(&wishes[..cut]) / sum(wishes);
    let along_x = area.x1 - area.x0 >= area.y1 - area.y0;
    let (low, high) = if along_x { (area.x0, area.x1) } else { (area.y0, area.y1) };
    let at = low + (f64::from(high - low) * share / f64::from(STEP)).round() as i32 * STEP;
    let (mut a, mut b) = (area, area);
    if along_x {
        (a.x1, b.x0) = (at, at);
    } else {
        (a.y1, b.y0) = (at, at);
    }
    Some(split_open(rng, a, &wishes[..cut], rooms)? + split_open(rng, b, &wishes[cut..], rooms)?)
}

/// A border between two rectangles: a piece of a vertical or horizontal line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Border {
    /// True if the line runs along y (constant x).
    pub vertical: bool,
    /// The constant coordinate.
    pub line: i32,
    /// Smaller end of the other coordinate.
    pub from: i32,
    /// Larger end.
    pub to: i32,
}

/// The side two disjoint rectangles share, if it has any length.
pub fn shared_border(a: &Cells, b: &Cells) -> Option<Border> {
    let (y0, y1) = (a.y0.max(b.y0), a.y1.min(b.y1));
    let (x0, x1) = (a.x0.max(b.x0), a.x1.min(b.x1));
    if y1 > y0 && (a.x1 == b.x0 || b.x1 == a.x0) {
        let line = if a.x1 == b.x0 { a.x1 } else { a.x0 };
        return Some(Border { vertical: true, line, from: y0, to: y1 });
    }
    if x1 > x0 && (a.y1 == b.y0 || b.y1 == a.y0) {
        let line = if a.y1 == b.y0 { a.y1 } else { a.y0 };
        return Some(Border { vertical: false, line, from: x0, to: x1 });
    }
    None
}

/// Mirrors and turns all storeys alike, then moves the lower left corner of the outline to the origin.
fn turned(rng: &mut impl Rng, mut plans: Vec<StoreyPlan>) -> Vec<StoreyPlan> {
    let (flip_x, flip_y, swap): (bool, bool, bool) = (rng.random(), rng.random(), rng.random());
    let map = |c: &Cells| {
        let mut c = *c;
        if flip_x {
            (c.x0, c.x1) = (-c.x1, -c.x0);
        }
        if flip_y {
            (c.y0, c.y1) = (-c.y1, -c.y0);
        }
        if swap { Cells::new(c.y0, c.x0, c.y1, c.x1) } else { c }
    };
    let parts = |plans: &mut Vec<StoreyPlan>, f: &dyn Fn(&Cells) -> Cells| {
        for part in plans.iter_mut().flat_map(|p| p.rooms.iter_mut()).flat_map(|r| r.parts.iter_mut()) {
            *part = f(part);
        }
    };
    parts(&mut plans, &map);
    let all = || plans.iter().flat_map(|p| &p.rooms).flat_map(|r| &r.parts);
    let (left, low) = (all().map(|c| c.x0).min().unwrap_or(0), all().map(|c| c.y0).min().unwrap_or(0));
    parts(&mut plans, &|c| Cells::new(c.x0 - left, c.y0 - low, c.x1 - left, c.y1 - low));
    plans
}
