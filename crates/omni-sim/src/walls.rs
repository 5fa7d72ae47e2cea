//! From centre lines to walls with a thickness: free floor of each room, wall faces to put furniture against, doorways, and
//! the closed triangle mesh of the structure.
//!
//! Every line of the plan is replaced by two lines half a wall thickness away on either side; between all these lines lie
//! cells that are wholly room, doorway, wall or outside. All surfaces are borders between such cells, so they close up.

use nalgebra::{Point2, Point3, Vector2};

use crate::building::{DoorAxis, DoorTruth, Rect};
use crate::doors::PlanDoor;
use crate::floorplan::{StoreyPlan, UNIT_M};
use crate::mesh::TriangleMesh;
use crate::shape::push_quad;

/// Clear height of doorways, metres.
pub const DOOR_HEIGHT_M: f64 = 2.05;
/// Floor to ceiling, metres.
pub const CEILING_M: f64 = 2.5;
/// Ceiling of one storey to the floor of the next, metres.
pub const SLAB_M: f64 = 0.3;
/// Floor to floor, metres.
pub const STOREY_M: f64 = CEILING_M + SLAB_M;

/// What fills a cell between the lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fill {
    Outside,
    Wall,
    Room(usize),
    Door(usize),
}

/// A straight piece of a room's wall without openings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallFace {
    /// One end, at the wall's surface.
    pub a: Point2<f64>,
    /// The other end.
    pub b: Point2<f64>,
    /// Away from the wall into the room, unit length, along an axis.
    pub inward: Vector2<f64>,
    /// The open air lies behind this wall.
    pub is_outer: bool,
}

impl WallFace {
    /// Length, metres.
    pub fn length_m(&self) -> f64 {
        (self.b - self.a).norm()
    }

    /// As a rectangle without thickness.
    pub fn rect(&self) -> Rect {
        Rect { min: self.a.inf(&self.b), max: self.a.sup(&self.b) }
    }
}

/// One storey with walls.
#[derive(Debug, Clone)]
pub struct StoreyWalls {
    /// Height of the floor.
    pub floor_z_m: f64,
    /// Free floor of each room, largest rectangle first.
    pub floors: Vec<Vec<Rect>>,
    /// Wall faces of each room.
    pub faces: Vec<Vec<WallFace>>,
    /// The doorways as rectangles within the wall, in the order of the plan's doors.
    pub openings: Vec<Rect>,
    xs: Vec<f64>,
    ys: Vec<f64>,
    fill: Vec<Fill>,
}

/// Colours of the structure in one room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finish {
    /// Walls.
    pub wall: [u8; 3],
    /// Floor.
    pub floor: [u8; 3],
}

/// Paint outside and in the doorways.
pub(crate) const TRIM: [u8; 3] = [225, 222, 215];
/// All ceilings.
pub(crate) const CEILING: [u8; 3] = [240, 240, 238];

impl StoreyWalls {
    /// Gives the lines of a plan a thickness. `hole` is cut into the grid so that a shaft may open there.
    pub fn new(plan: &StoreyPlan, doors: &[PlanDoor], thickness_m: f64, floor_z_m: f64, hole: Option<Rect>) -> Self {
        let half = thickness_m / 2.0;
        let openings: Vec<Rect> = doors.iter().map(|d| opening_rect(d, half)).collect();
        let mut xs = Vec::new();
        let mut ys = Vec::new();
        for c in plan.rooms.iter().flat_map(|r| &r.parts) {
            xs.extend([c.x0, c.x1].iter().flat_map(|&x| [f64::from(x) * UNIT_M - half, f64::from(x) * UNIT_M + half]));
            ys.extend([c.y0, c.y1].iter().flat_map(|&y| [f64::from(y) * UNIT_M - half, f64::from(y) * UNIT_M + half]));
        }
        for r in openings.iter().chain(hole.iter()) {
            xs.extend([r.min.x, r.max.x]);
            ys.extend([r.min.y, r.max.y]);
        }
        for lines in [&mut xs, &mut ys] {
            lines.sort_by(f64::total_cmp);
            lines.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
            // A ring of outside cells all round.
            lines.insert(0, lines[0] - 1.0);
            lines.push(lines[lines.len() - 1] + 1.0);
        }
        let label = |p: Point2<f64>| {
            plan.rooms.iter().position(|r| {
                r.parts.iter().any(|c| {
                    let units = |v: i32| f64::from(v) * UNIT_M;
                    p.x >= units(c.x0) && p.x < units(c.x1) && p.y >= units(c.y0) && p.y < units(c.y1)
                })
            })
        };
        let reach = half - 1e-6;
        let mut fill = Vec::with_capacity((xs.len() - 1) * (ys.len() - 1));
        for y in ys.windows(2) {
            for x in xs.windows(2) {
                let c = Point2::new((x[0] + x[1]) / 2.0, (y[0] + y[1]) / 2.0);
                let here = label(c);
                let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
                let plain = corners.iter().all(|(sx, sy)| label(c + Vector2::new(sx * reach, sy * reach)) == here);
                fill.push(match (plain, here, openings.iter().position(|o| o.contains(&c))) {
                    (true, Some(room), _) => Fill::Room(room),
                    (true, None, _) => Fill::Outside,
                    (false, _, Some(door)) => Fill::Door(door),
                    (false, _, None) => Fill::Wall,
                });
            }
        }
        let mut walls = Self { floor_z_m, floors: Vec::new(), faces: Vec::new(), openings, xs, ys, fill };
        for room in 0..plan.rooms.len() {
            let mut floor = walls.merged(|f| f == Fill::Room(room));
            floor.sort_by(|a, b| b.area_m2().total_cmp(&a.area_m2()));
            walls.floors.push(floor);
            let faces = walls.wall_faces(room);
            walls.faces.push(faces);
        }
        walls
    }

    /// The doors as truth. `first_room` is the id of the storey's first room.
    pub fn door_truths(&self, doors: &[PlanDoor], first_room: u32) -> Vec<DoorTruth> {
        doors
            .iter()
            .zip(&self.openings)
            .map(|(d, r)| DoorTruth {
                rooms: (first_room + d.rooms.0 as u32, first_room + d.rooms.1 as u32),
                center: Point3::new(r.center().x, r.center().y, self.floor_z_m),
                width_m: d.width_m(),
                height_m: DOOR_HEIGHT_M,
                axis: if d.opening.vertical { DoorAxis::X } else { DoorAxis::Y },
            })
            .collect()
    }

    /// Adds the storey's inner surfaces: floors, ceilings, walls, lintels and jambs. `hole_below` and `hole_above` are left
    /// open in floor and ceiling.
    pub fn push_inside(
        &self,
        mesh: &mut TriangleMesh,
        finishes: &[Finish],
        hole_below: Option<Rect>,
        hole_above: Option<Rect>,
    ) {
        let (z0, zd, z1) = (self.floor_z_m, self.floor_z_m + DOOR_HEIGHT_M, self.floor_z_m + CEILING_M);
        for (room, finish) in finishes.iter().enumerate() {
            for (z, hole, color) in [(z0, hole_below, finish.floor), (z1, hole_above, CEILING)] {
                for r in self.merged_where(|f, c| f == Fill::Room(room) && !hole.is_some_and(|h| h.contains(&c))) {
                    push_level(mesh, &r, z, z == z0, color);
                }
            }
            self.push_borders(mesh, Fill::Room(room), |f| f == Fill::Wall, z0, z1, finish.wall);
            self.push_borders(mesh, Fill::Room(room), |f| matches!(f, Fill::Door(_)), zd, z1, finish.wall);
        }
        for (door, r) in self.openings.iter().enumerate() {
            push_level(mesh, r, z0, true, TRIM);
            push_level(mesh, r, zd, false, TRIM);
            self.push_borders(mesh, Fill::Door(door), |f| f == Fill::Wall, z0, zd, TRIM);
        }
        // The sides of the shaft through the slab.
        if let Some(h) = hole_above {
            let corners = [(h.min.x, h.min.y), (h.max.x, h.min.y), (h.max.x, h.max.y), (h.min.x, h.max.y)];
            for k in 0..4 {
                let ((ax, ay), (bx, by)) = (corners[k], corners[(k + 1) % 4]);
                push_wall(mesh, (ax, ay), (bx, by), z1, z1 + SLAB_M, CEILING);
            }
        }
    }

    /// Adds the outer shell of a building whose storeys share this outline, from `z0` to `z1`: facades, underside and roof.
    pub fn push_shell(&self, mesh: &mut TriangleMesh, z0: f64, z1: f64) {
        self.push_borders(mesh, Fill::Outside, |f| f == Fill::Wall, z0, z1, TRIM);
        for r in self.merged(|f| f != Fill::Outside) {
            push_level(mesh, &r, z0, false, TRIM);
            push_level(mesh, &r, z1, true, TRIM);
        }
    }

    fn at(&self, ix: usize, iy: usize) -> Fill {
        self.fill[iy * (self.xs.len() - 1) + ix]
    }

    fn size(&self) -> (usize, usize) {
        (self.xs.len() - 1, self.ys.len() - 1)
    }

    /// Covers the cells that satisfy `take` with few rectangles.
    fn merged(&self, take: impl Fn(Fill) -> bool) -> Vec<Rect> {
        self.merged_where(|f, _| take(f))
    }

    fn merged_where(&self, take: impl Fn(Fill, Point2<f64>) -> bool) -> Vec<Rect> {
        let (w, h) = self.size();
        let mid = |lines: &[f64], i: usize| (lines[i] + lines[i + 1]) / 2.0;
        let mut open: Vec<bool> =
            (0..w * h).map(|i| take(self.fill[i], Point2::new(mid(&self.xs, i % w), mid(&self.ys, i / w)))).collect();
        let mut rects = Vec::new();
        for iy in 0..h {
            for ix in 0..w {
                if !open[iy * w + ix] {
                    continue;
                }
                let mut jx = ix;
                while jx < w && open[iy * w + jx] {
                    jx += 1;
                }
                let mut jy = iy;
                while jy < h && (ix..jx).all(|x| open[jy * w + x]) {
                    (ix..jx).for_each(|x| open[jy * w + x] = false);
                    jy += 1;
                }
                rects.push(Rect::new(self.xs[ix], self.ys[iy], self.xs[jx], self.ys[jy]));
            }
        }
        rects
    }

    /// Borders of cells of kind `inside` towards cells that satisfy `beyond`, as straight runs
    /// `(start, end)` with `inside` on the left-hand side.
    fn runs(&self, inside: Fill, beyond: impl Fn(usize, usize) -> bool) -> Vec<(Point2<f64>, Point2<f64>)> {
        let (w, h) = self.size();
        let is = |ix: usize, iy: usize| self.at(ix, iy) == inside;
        let mut runs: Vec<(Point2<f64>, Point2<f64>)> = Vec::new();
        let push = |runs: &mut Vec<(Point2<f64>, Point2<f64>)>, a: Point2<f64>, b: Point2<f64>, forward: bool| {
            if let Some(last) = runs.last_mut() {
                if forward && last.1 == a {
                    last.1 = b;
                    return;
                }
                if !forward && last.0 == b {
                    last.0 = a;
                    return;
                }
            }
            runs.push((a, b));
        };
        let p = |ix: usize, iy: usize| Point2::new(self.xs[ix], self.ys[iy]);
        for iy in 0..h {
            let mut row = Vec::new();
            (0..w)
                .filter(|&ix| iy > 0 && is(ix, iy) && beyond(ix, iy - 1))
                .for_each(|ix| push(&mut row, p(ix, iy), p(ix + 1, iy), true));
            runs.append(&mut row);
            let mut row = Vec::new();
            (0..w)
                .filter(|&ix| iy + 1 < h && is(ix, iy) && beyond(ix, iy + 1))
                .for_each(|ix| push(&mut row, p(ix + 1, iy + 1), p(ix, iy + 1), false));
            runs.append(&mut row);
        }
        for ix in 0..w {
            let mut column = Vec::new();
            (0..h)
                .filter(|&iy| ix > 0 && is(ix, iy) && beyond(ix - 1, iy))
                .for_each(|iy| push(&mut column, p(ix, iy + 1), p(ix, iy), false));
            runs.append(&mut column);
            let mut column = Vec::new();
            (0..h)
                .filter(|&iy| ix + 1 < w && is(ix, iy) && beyond(ix + 1, iy))
                .for_each(|iy| push(&mut column, p(ix + 1, iy), p(ix + 1, iy + 1), true));
            runs.append(&mut column);
        }
        runs
    }

    fn push_borders(
        &self,
        mesh: &mut TriangleMesh,
        inside: Fill,
        beyond: impl Fn(Fill) -> bool,
        z0: f64,
        z1: f64,
        color: [u8; 3],
    ) {
        for (a, b) in self.runs(inside, |ix, iy| beyond(self.at(ix, iy))) {
            push_wall(mesh, (a.x, a.y), (b.x, b.y), z0, z1, color);
        }
    }

    fn wall_faces(&self, room: usize) -> Vec<WallFace> {
        let is_open_air = |p: Point2<f64>| {
            let at = |lines: &[f64], v: f64| lines.windows(2).position(|l| v > l[0] && v < l[1]);
            match (at(&self.xs, p.x), at(&self.ys, p.y)) {
                (Some(ix), Some(iy)) => self.at(ix, iy) == Fill::Outside,
                _ => true,
            }
        };
        self.runs(Fill::Room(room), |ix, iy| self.at(ix, iy) == Fill::Wall)
            .into_iter()
            .map(|(a, b)| {
                let along = (b - a).normalize();
                let inward = Vector2::new(-along.y, along.x);
                // Thicker than any wall: what lies 20 cm behind the face, sampled along it.
                let behind = |s: f64| is_open_air(a + (b - a) * s - inward * 0.2);
                WallFace { a, b, inward, is_outer: [0.1, 0.3, 0.5, 0.7, 0.9].iter().all(|&s| behind(s)) }
            })
            .collect()
    }
}

/// The doorway's rectangle in the wall.
fn opening_rect(door: &PlanDoor, half: f64) -> Rect {
    let o = &door.opening;
    let (line, from, to) = (f64::from(o.line) * UNIT_M, f64::from(o.from) * UNIT_M, f64::from(o.to) * UNIT_M);
    if o.vertical {
        Rect::new(line - half, from, line + half, to)
    } else {
        Rect::new(from, line - half, to, line + half)
    }
}

/// A horizontal rectangle of structure, facing up or down.
pub(crate) fn push_level(mesh: &mut TriangleMesh, r: &Rect, z: f64, up: bool, color: [u8; 3]) {
    let corner = |x: f64, y: f64| Point3::new(x, y, z);
    let mut quad =
        [corner(r.min.x, r.min.y), corner(r.max.x, r.min.y), corner(r.max.x, r.max.y), corner(r.min.x, r.max.y)];
    if !up {
        quad.reverse();
    }
    push_quad(mesh, quad, 0, color);
}

/// A vertical rectangle of structure above the line from `a` to `b`, facing the left-hand side of the line.
pub(crate) fn push_wall(mesh: &mut TriangleMesh, a: (f64, f64), b: (f64, f64), z0: f64, z1: f64, color: [u8; 3]) {
    let quad =
        [Point3::new(b.0, b.1, z0), Point3::new(a.0, a.1, z0), Point3::new(a.0, a.1, z1), Point3::new(b.0, b.1, z1)];
    push_quad(mesh, quad, 0, color);
}
