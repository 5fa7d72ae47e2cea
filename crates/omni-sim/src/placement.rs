//! Puts one thing after another into a room: along walls, in corners, in the middle, beside or in front of what stands there
//! already. A place is taken only if nothing overlaps, doors stay free, and the robot's disc still gets from every door to
//! every other and to everything placed so far.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point2, Point3, Vector2};
use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use crate::building::{Bounds, Rect};
use crate::catalog::{Class, Mount, class};
use crate::colors::draw_color;
use crate::item::{Item, THIN_M, extent};
use crate::models::build;
use crate::passage::{PassageMap, Reach};
use crate::shape::Placement;
use crate::viewing::is_usable;
use crate::walls::{CEILING_M, WallFace};

/// Gap between furniture and the wall behind it, metres.
const WALL_GAP_M: f64 = 0.03;
/// Places tried with the passage test before a thing is left out.
const FLOODS: usize = 6;

/// Where a thing goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// Back to a wall, in the middle of a free stretch.
    WallMiddle,
    /// Back to a wall, towards a corner.
    WallCorner,
    /// In a corner of the room.
    Corner,
    /// Free-standing in the middle.
    Center,
    /// Directly beside a thing of the same row (kitchen units), or in a corner to begin one.
    Row,
    /// Beside the parent, same wall.
    Beside,
    /// In front of the parent, facing it, at this distance.
    InFront(f64),
    /// Round the parent, facing it.
    Around,
    /// Back to the wall that the parent looks at.
    Opposite,
    /// On a wall.
    Hung,
    /// On an outer wall.
    OuterWall,
    /// Below the parent on the same wall.
    Below,
}

/// A room to be furnished.
#[derive(Debug, Clone)]
pub struct RoomSpace {
    /// Free floor.
    pub floor: Vec<Rect>,
    /// Walls without openings.
    pub faces: Vec<WallFace>,
    /// Doorways: middle at the wall's surface, direction into the room, width.
    pub doors: Vec<(Point2<f64>, Vector2<f64>, f64)>,
    /// Parts of the floor where nothing may stand and nobody walks (a flight of stairs).
    pub closed: Vec<Rect>,
    /// Height of the floor.
    pub floor_z_m: f64,
    /// Width kept free.
    pub passage_m: f64,
}

/// The work in progress in one room.
pub struct Furnisher<'a> {
    /// Source of chance of this room.
    pub rng: &'a mut ChaCha8Rng,
    /// The room.
    pub space: &'a RoomSpace,
    /// What stands so far.
    pub items: Vec<Item>,
    keep_free: Vec<Rect>,
    map: PassageMap,
    /// Colour of each class in this room: sets match.
    palette: Vec<(&'static str, &'static str, &'static str)>,
}

impl<'a> Furnisher<'a> {
    /// An empty room.
    pub fn new(rng: &'a mut ChaCha8Rng, space: &'a RoomSpace) -> Self {
        let fronts: Vec<_> = space.doors.iter().map(|d| (d.0, d.1)).collect();
        let mut map = PassageMap::new(&space.floor, &space.faces, &fronts, space.passage_m);
        space.closed.iter().for_each(|r| map.block(r));
        let keep_free = space
            .doors
            .iter()
            .map(|(middle, inward, width)| {
                let side = Vector2::new(-inward.y, inward.x) * (width / 2.0 + 0.05);
                let (a, b) = (middle + side, middle - side + inward * (space.passage_m + 0.1));
                Rect { min: a.inf(&b), max: a.sup(&b) }
            })
            .collect();
        Self { rng, space, items: Vec::new(), keep_free, map, palette: Vec::new() }
    }

    /// Draws a thing of a class and finds a place for it; its index, or `None` if there is no room for it.
    pub fn put(&mut self, name: &str, place: Place, parent: Option<usize>) -> Option<usize> {
        let class = class(name)?;
        let (size, color, material) = self.draw(class, place);
        let mut candidates = self.candidates(class, size, place, parent);
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rgb = draw_color(self.rng, color);
        let model = build(class.form, size.0, size.1, size.2, rgb);
        let mut floods = 0;
        for (_, placement) in candidates {
            let bounds = model.bounds(&placement);
            if !self.is_clear(class, &bounds) {
                continue;
            }
            let item = Item {
                class,
                color,
                rgb,
                material,
                parts: model.part_bounds(&placement),
                model: model.clone(),
                placement,
                bounds,
                support: None,
                with: self.companion(place, parent, &bounds),
                is_mover: false,
            };
            if self.accept(item) {
                return Some(self.items.len() - 1);
            }
            floods += 1;
            if floods >= FLOODS {
                break;
            }
        }
        None
    }

    /// What a thing is placed with: its parent, or the unit of the row that it touches.
    fn companion(&self, place: Place, parent: Option<usize>, bounds: &Bounds) -> Option<usize> {
        const TOUCHING_M: f64 = 0.01;
        let is_neighbour = |item: &Item| is_row_unit(item.class.name) && item.bounds.gap_m(bounds) < TOUCHING_M;
        parent.or_else(|| self.items.iter().position(is_neighbour).filter(|_| place == Place::Row))
    }

    /// Adds an item whose place is already known (a door leaf), if it leaves the passages free.
    pub fn accept(&mut self, item: Item) -> bool {
        if item.is_obstacle() {
            let mut map = self.map.clone();
            map.block(&item.bounds.footprint());
            let Some(reach) = map.reach() else {
                return false;
            };
            if !is_usable(&item, &reach) || !self.items.iter().all(|i| is_usable(i, &reach)) {
                return false;
            }
            self.map = map;
        }
        self.items.push(item);
        true
    }

    /// Keeps the floor before something on a wall clear from now on, as deep as the passage.
    pub fn keep_front_free(&mut self, index: usize) {
        let item = &self.items[index];
        self.keep_free.push(front_of(&item.bounds.footprint(), item.front(), self.space.passage_m + 0.1));
    }

    /// Where the disc gets now. `None` only in a room too small for the disc.
    pub fn reach(&self) -> Option<Reach> {
        self.map.reach()
    }

    /// True if a thing with these bounds overlaps nothing, stands inside the room and off the doors' fronts.
    pub fn is_clear(&self, class: &Class, bounds: &Bounds) -> bool {
        let foot = bounds.footprint();
        let covered: f64 = self
            .space
            .floor
            .iter()
            .map(|r| {
                let w = (r.max.x.min(foot.max.x) - r.min.x.max(foot.min.x)).max(0.0);
                let h = (r.max.y.min(foot.max.y) - r.min.y.max(foot.min.y)).max(0.0);
                w * h
            })
            .sum();
        if covered < foot.area_m2() - 1e-9 || bounds.max.z > self.space.floor_z_m + CEILING_M {
            return false;
        }
        let tall = bounds.max.z - self.space.floor_z_m > 1.15;
        let thin = matches!(class.mount, Mount::Wall(_)) && class.size_m[1].1 <= THIN_M;
        let hits = |item: &Item| {
            if bounds.overlaps(&item.bounds, 1e-9) {
                return true;
            }
            // Nothing tall in front of a window, a picture or a mirror.
            let covers = |hung: &Bounds, other: &Bounds| {
                let grown = Bounds {
                    min: Point3::new(hung.min.x - 0.1, hung.min.y - 0.1, hung.min.z),
                    max: Point3::new(hung.max.x + 0.1, hung.max.y + 0.1, hung.max.z),
                };
                grown.overlaps(other, 1e-9)
            };
            matches!(item.class.mount, Mount::Wall(_)) && tall && covers(&item.bounds, bounds)
                || thin && covers(bounds, &item.bounds)
        };
        let overlaps = |zone: &Rect| zone.overlaps(&foot, 1e-9);
        !self.items.iter().any(hits)
            && !self.space.closed.iter().any(overlaps)
            && (thin || !self.keep_free.iter().any(overlaps))
    }

    /// Size (width, depth, height), colour and material of a new thing; sets in one room match.
    fn draw(&mut self, class: &'static Class, place: Place) -> ((f64, f64, f64), &'static str, &'static str) {
        let mut draw = |range: (f64, f64)| {
            let v: f64 = if range.0 < range.1 { self.rng.random_range(range.0..range.1) } else { range.0 };
            (v * 200.0).round() / 200.0
        };
        let size = class.size_m.map(&mut draw);
        let known = self.palette.iter().find(|(name, _, _)| *name == class.name);
        let matches = matches!(place, Place::Row | Place::Around | Place::Beside) || self.rng.random_bool(0.4);
        let (color, material) = match known {
            Some((_, color, material)) if matches => (*color, *material),
            _ => (
                class.colors.choose(self.rng).copied().unwrap_or("grey"),
                class.materials.choose(self.rng).copied().unwrap_or("wood"),
            ),
        };
        if known.is_none() {
            self.palette.push((class.name, color, material));
        }
        ((size[0], size[1], size[2]), color, material)
    }

    /// Possible placements with a score, better ones higher.
    fn candidates(
        &mut self,
        class: &Class,
        (width, depth, height): (f64, f64, f64),
        place: Place,
        parent: Option<usize>,
    ) -> Vec<(f64, Placement)> {
        let z = self.space.floor_z_m + if let Mount::Wall(z) = class.mount { z } else { 0.0 };
        let gap = if matches!(class.mount, Mount::Wall(_)) { 0.0 } else { WALL_GAP_M };
        let parent = parent.map(|p| self.items[p].clone());
        let mut list: Vec<(f64, Placement)> = Vec::new();
        let at = |p: Point2<f64>, yaw_rad: f64| Placement { origin: Point3::new(p.x, p.y, z), yaw_rad };
        match (place, &parent) {
            (Place::Beside, Some(p)) => {
                let front = p.front();
                let left = Vector2::new(-front.y, front.x);
                let back = Point2::new(p.placement.origin.x, p.placement.origin.y) - front * extent(p, front) / 2.0;
                let reach = (extent(p, left) + width) / 2.0;
                for side in [-1.0, 1.0] {
                    let step = reach + self.rng.random_range(0.02..0.10);
                    let score = self.rng.random_range(0.0..1.0);
                    list.push((score, at(back + left * side * step + front * depth / 2.0, p.placement.yaw_rad)));
                }
            }
            (Place::InFront(distance), Some(p)) => {
                let front = p.front();
                let left = Vector2::new(-front.y, front.x);
                let middle = Point2::new(p.placement.origin.x, p.placement.origin.y);
                for k in 0..6 {
                    let away = (extent(p, front) + depth) / 2.0 + distance + 0.03 * f64::from(k % 3);
                    let slide = left * self.rng.random_range(-0.08..0.08);
                    let turn = if distance < 0.2 { self.rng.random_range(-0.12..0.12) } else { 0.0 };
                    list.push((-f64::from(k), at(middle + front * away + slide, p.placement.yaw_rad + PI + turn)));
                }
            }
            (Place::Around, Some(p)) => {
                let front = p.front();
                let left = Vector2::new(-front.y, front.x);
                let middle = Point2::new(p.placement.origin.x, p.placement.origin.y);
                let (long, deep) = (extent(p, left), extent(p, front));
                let seats = ((long - 0.1) / (width + 0.12)).floor().max(1.0) as i32;
                for side in [1.0, -1.0] {
                    for k in 0..seats {
                        let slide = (f64::from(k) + 0.5) / f64::from(seats) * long - long / 2.0;
                        let away = (deep + depth) / 2.0 + self.rng.random_range(0.04..0.10);
                        let turn = self.rng.random_range(-0.06..0.06);
                        let yaw = p.placement.yaw_rad + if side > 0.0 { PI } else { 0.0 };
                        let score = 1.0 + self.rng.random_range(0.0..0.5);
                        list.push((score, at(middle + front * side * away + left * slide, yaw + turn)));
                    }
                    let away = (long + depth) / 2.0 + self.rng.random_range(0.04..0.10);
                    let yaw = p.placement.yaw_rad - side * FRAC_PI_2;
                    list.push((self.rng.random_range(0.0..0.6), at(middle + left * side * away, yaw)));
                }
            }
            (Place::Below, Some(p)) => {
                let front = p.front();
                let back = Point2::new(p.placement.origin.x, p.placement.origin.y) - front * extent(p, front) / 2.0;
                list.push((0.0, at(back + front * depth / 2.0, p.placement.yaw_rad)));
            }
            (Place::Center, _) => {
                let r = self.space.floor[0];
                let along_x = r.width_m() > r.height_m();
                for k in 0..12 {
                    let spread = 0.06 * f64::from(k);
                    let shift =
                        Vector2::new(self.rng.random_range(-1.0..1.0), self.rng.random_range(-1.0..1.0)) * spread;
                    // The long side of the model lies along y, so it is turned if the room is long along x.
                    let turn = if along_x != (k >= 9) { FRAC_PI_2 } else { 0.0 };
                    list.push((-f64::from(k), at(r.center() + shift, turn)));
                }
            }
            (Place::Row, _) => {
                let row: Vec<Item> = self.items.iter().filter(|i| is_row_unit(i.class.name)).cloned().collect();
                for unit in &row {
                    let front = unit.front();
                    let left = Vector2::new(-front.y, front.x);
                    let back = Point2::new(unit.placement.origin.x, unit.placement.origin.y)
                        - front * extent(unit, front) / 2.0;
                    for side in [-1.0, 1.0] {
                        let step = (extent(unit, left) + width) / 2.0 + 0.004;
                        let score = self.rng.random_range(2.0..3.0);
                        let p = back + left * side * step + front * depth / 2.0;
                        list.push((score, at(p, unit.placement.yaw_rad)));
                    }
                }
                self.along_walls(&mut list, width, depth, gap, z, Place::WallCorner, None);
            }
            _ => self.along_walls(&mut list, width, depth, gap, z, place, parent.as_ref()),
        }
        // Hung things keep clear of the ceiling by their own mount; tall ones were drawn to fit.
        list.retain(|(_, p)| p.origin.z + height <= self.space.floor_z_m + CEILING_M);
        list
    }

    /// Places with the back to a wall.
    #[allow(clippy::too_many_arguments)]
    fn along_walls(
        &mut self,
        list: &mut Vec<(f64, Placement)>,
        width: f64,
        depth: f64,
        gap: f64,
        z: f64,
        place: Place,
        parent: Option<&Item>,
    ) {
        let faces: Vec<WallFace> = self.space.faces.clone();
        for face in &faces {
            if place == Place::OuterWall && !face.is_outer {
                continue;
            }
            let spare = face.length_m() - width;
            let clear = 2.0 * WALL_GAP_M;
            if spare < clear {
                continue;
            }
            let along = (face.b - face.a).normalize();
            let yaw_rad = face.inward.y.atan2(face.inward.x);
            // An end of the face is a corner of the room if the room does not go on round it (a doorway, an outer corner of an L).
            let is_corner = |end: Point2<f64>, outward: Vector2<f64>| {
                let beyond = end + (outward + face.inward) * 0.1;
                !self.space.floor.iter().any(|r| r.contains(&beyond))
            };
            let corners = [is_corner(face.a, -along), is_corner(face.b, along)];
            for k in 0..8 {
                if place == Place::Corner && (k > 1 || !corners[k]) {
                    continue;
                }
                let s = match (place, k) {
                    (Place::Corner | Place::WallCorner, 0) => WALL_GAP_M,
                    (Place::Corner | Place::WallCorner, 1) => spare - WALL_GAP_M,
                    (Place::WallMiddle | Place::OuterWall | Place::Opposite, 0) => spare / 2.0,
                    _ => self.rng.random_range(WALL_GAP_M..spare - WALL_GAP_M + 1e-6),
                };
                let p = face.a + along * (s + width / 2.0) + face.inward * (gap + depth / 2.0);
                let noise = self.rng.random_range(0.0..1.0);
                let from_middle = (s - spare / 2.0).abs() / (spare / 2.0).max(0.1);
                let to_corner = if s < spare / 2.0 { corners[0] } else { corners[1] };
                let door = self.space.doors.iter().map(|d| (d.0 - p).norm()).fold(3.0, f64::min) / 3.0;
                let score = match place {
                    Place::WallMiddle => 1.2 * (1.0 - from_middle) + door,
                    Place::WallCorner => 0.8 * from_middle * f64::from(u8::from(to_corner)) + 0.4 * door,
                    Place::Opposite => match parent {
                        Some(o) => {
                            let front = o.front();
                            if face.inward.dot(&front) > -0.5 {
                                continue;
                            }
                            let to = p - Point2::new(o.placement.origin.x, o.placement.origin.y);
                            3.0 - (to.x * front.y - to.y * front.x).abs()
                        }
                        None => 0.0,
                    },
                    _ => 0.0,
                };
                list.push((score + noise, Placement { origin: Point3::new(p.x, p.y, z), yaw_rad }));
            }
        }
    }
}

/// Kitchen units stand in rows.
fn is_row_unit(name: &str) -> bool {
    matches!(name, "counter" | "sink" | "stove" | "fridge" | "dishwasher" | "washing machine" | "dryer")
}

/// The rectangle before a footprint.
fn front_of(foot: &Rect, front: Vector2<f64>, depth_m: f64) -> Rect {
    let shift = front * depth_m;
    Rect { min: foot.min.inf(&(foot.min + shift)), max: foot.max.sup(&(foot.max + shift)) }
}
