//! A small world of boxes with exact rays and exact distances, and a rotating LiDAR in it.
#![allow(dead_code)] // every test file uses its own part

use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use volumetric_map::{BeamGrid, Cell, OccupancyGrid};

/// Flat grids of fewer than `sides` cells along x and y, of which `free` parts against three are free.
pub fn flat_grid(sides: usize, free: u32) -> impl Strategy<Value = OccupancyGrid> {
    let cell = prop_oneof![free => Just(Cell::Free), 2 => Just(Cell::Occupied), 1 => Just(Cell::Unknown)];
    (1..sides, 1..sides).prop_flat_map(move |(width, height)| {
        prop::collection::vec(cell.clone(), width * height).prop_map(move |cells| OccupancyGrid {
            origin: Point2::new(-1.0, 0.5),
            resolution_m: 0.05,
            width,
            height,
            cells,
        })
    })
}

/// An axis-aligned solid box.
#[derive(Debug, Clone, Copy)]
pub struct Solid {
    pub min: Vector3<f64>,
    pub max: Vector3<f64>,
    pub label: u16,
}

/// Solids only; free space is the rest.
#[derive(Debug, Clone, Default)]
pub struct World {
    pub solids: Vec<Solid>,
}

pub const FLOOR: u16 = 1;
pub const WALL: u16 = 2;
pub const CEILING: u16 = 3;
pub const TABLE: u16 = 4;
pub const CABINET: u16 = 5;

pub const HEIGHT: f64 = 2.5;
pub const DOOR_HEIGHT: f64 = 2.05;
pub const STOREY: f64 = 2.9;

impl World {
    pub fn push(&mut self, min: [f64; 3], max: [f64; 3], label: u16) {
        self.solids.push(Solid { min: min.into(), max: max.into(), label });
    }

    /// A wall along x (or y) at the given coordinate, 0.10 m thick, with door openings [from, to].
    pub fn wall(&mut self, along_x: bool, at: f64, from: f64, to: f64, doors: &[[f64; 2]]) {
        let mut piece = |a: f64, b: f64, low: f64| {
            let (lo, hi) = (at - 0.05, at + 0.05);
            if along_x {
                self.push([a, lo, low], [b, hi, HEIGHT], WALL);
            } else {
                self.push([lo, a, low], [hi, b, HEIGHT], WALL);
            }
        };
        let mut start = from;
        for door in doors {
            piece(start, door[0], 0.0);
            piece(door[0], door[1], DOOR_HEIGHT);
            start = door[1];
        }
        piece(start, to, 0.0);
    }

    pub fn table(&mut self, x: f64, y: f64, lx: f64, ly: f64) {
        self.push([x - lx / 2.0, y - ly / 2.0, 0.70], [x + lx / 2.0, y + ly / 2.0, 0.74], TABLE);
        for sx in [-1.0, 1.0] {
            for sy in [-1.0, 1.0] {
                let (cx, cy) = (x + sx * (lx / 2.0 - 0.05), y + sy * (ly / 2.0 - 0.05));
                self.push([cx - 0.025, cy - 0.025, 0.0], [cx + 0.025, cy + 0.025, 0.70], TABLE);
            }
        }
    }

    fn shell(x0: f64, y0: f64, x1: f64, y1: f64) -> Self {
        let mut world = Self::default();
        world.push([x0 - 1.0, y0 - 1.0, -0.2], [x1 + 1.0, y1 + 1.0, 0.0], FLOOR);
        world.push([x0 - 1.0, y0 - 1.0, HEIGHT], [x1 + 1.0, y1 + 1.0, HEIGHT + 0.2], CEILING);
        world.wall(false, x0, y0 - 0.05, y1 + 0.05, &[]);
        world.wall(false, x1, y0 - 0.05, y1 + 0.05, &[]);
        world.wall(true, y0, x0 - 0.05, x1 + 0.05, &[]);
        world.wall(true, y1, x0 - 0.05, x1 + 0.05, &[]);
        world
    }

    /// Two rooms of 5 m x 4 m side by side (x 0..5 and 5..10, y 0..4), a door of 1.0 m between them at y 1.5..2.5, a table in each
    /// and a cabinet.
    pub fn two_rooms() -> Self {
        let mut world = Self::shell(0.03, 0.02, 10.01, 4.04);
        world.wall(false, 5.02, 0.02, 4.04, &[[1.5, 2.5]]);
        world.table(1.5, 3.0, 1.2, 0.7);
        world.table(8.0, 1.0, 1.2, 0.7);
        world.push([2.8, 0.07, 0.0], [3.8, 0.50, 1.8], CABINET);
        world
    }

    /// A flat of 10 m x 10 m with four rooms round two inner walls, four doors of 1.0 m.
    pub fn flat() -> Self {
        let mut world = Self::shell(0.0, 0.0, 10.0, 10.0);
        world.wall(false, 5.0, 0.0, 10.0, &[[2.0, 3.0], [7.0, 8.0]]);
        world.wall(true, 5.0, 0.0, 10.0, &[[1.5, 2.5], [7.2, 8.2]]);
        world.table(1.2, 1.0, 1.4, 0.8);
        world.table(8.4, 1.2, 0.8, 1.4);
        world.table(8.0, 9.0, 1.6, 0.8);
        world.table(1.6, 8.4, 1.4, 0.8);
        world.push([4.2, 0.1, 0.0], [4.9, 0.6, 1.8], CABINET);
        world.push([5.1, 9.2, 0.0], [5.6, 9.9, 1.8], CABINET);
        world.push([0.1, 5.6, 0.0], [0.5, 6.4, 1.2], CABINET);
        world.push([9.4, 3.4, 0.0], [9.9, 4.2, 1.8], CABINET);
        world
    }

    /// Thirty rooms of 4 m x 4 m on two storeys, fifteen each in three rows of five; and a way through all rooms of a storey that passes
    /// each door once. The upper floor lies at [`STOREY`].
    pub fn thirty_rooms() -> (Self, Vec<[f64; 2]>) {
        let mut storey = Self::shell(0.0, 0.0, 20.0, 12.0);
        for k in 1..5 {
            let at = 4.0 * f64::from(k);
            storey.wall(false, at, 0.0, 12.0, &[[1.5, 2.5], [5.5, 6.5], [9.5, 10.5]]);
        }
        // The rows hang together at their ends only.
        storey.wall(true, 4.0, 0.0, 20.0, &[[17.5, 18.5]]);
        storey.wall(true, 8.0, 0.0, 20.0, &[[1.5, 2.5]]);
        for (column, row) in (0..15).map(|room| (room % 5, room / 5)) {
            let (x, y) = (4.0 * f64::from(column), 4.0 * f64::from(row));
            storey.push([x + 0.2, y + 0.2, 0.0], [x + 0.7, y + 1.0 + 0.04 * f64::from(column), 1.2], CABINET);
            storey.table(x + 3.2, y + 3.3, 0.8, 0.6);
        }
        let mut world = storey.clone();
        for solid in storey.solids {
            let up = Vector3::new(0.0, 0.0, STOREY);
            world.solids.push(Solid { min: solid.min + up, max: solid.max + up, label: solid.label });
        }
        (world, vec![[2.0, 2.0], [18.0, 2.0], [18.0, 6.0], [2.0, 6.0], [2.0, 10.0], [18.0, 10.0]])
    }

    /// An empty corridor, 14 m long and 2 m wide.
    pub fn corridor() -> Self {
        Self::shell(0.0, 0.0, 14.0, 2.0)
    }

    /// Distance along a ray to the first solid and its label.
    pub fn cast(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<(f64, u16)> {
        let mut best: Option<(f64, u16)> = None;
        for solid in &self.solids {
            let (mut near, mut far) = (0.0f64, best.map_or(f64::INFINITY, |b| b.0));
            for axis in 0..3 {
                let inverse = 1.0 / direction[axis];
                let a = (solid.min[axis] - origin[axis]) * inverse;
                let b = (solid.max[axis] - origin[axis]) * inverse;
                if a.is_nan() || b.is_nan() {
                    continue;
                }
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            if near < far && near > 0.0 {
                best = Some((near, solid.label));
            }
        }
        best
    }

    /// Exact distance of a point to the nearest solid; zero inside.
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        let to = |s: &Solid| (s.min - p.coords).sup(&(p.coords - s.max)).sup(&Vector3::zeros()).norm();
        self.solids.iter().map(to).fold(f64::INFINITY, f64::min)
    }

    /// Signed distance of a point to the surface of the union of solids, negative inside (exact to the nearest face of the solid
    /// it is in).
    pub fn signed_distance(&self, p: &Point3<f64>) -> f64 {
        let outside = self.distance(p);
        if outside > 0.0 {
            return outside;
        }
        let depth = |s: &Solid| (p.coords - s.min).inf(&(s.max - p.coords)).min();
        -self.solids.iter().map(depth).fold(0.0, f64::max)
    }

    /// Distance in the plane to the nearest solid that reaches into the height band.
    pub fn flat_distance(&self, x: f64, y: f64, low: f64, high: f64) -> f64 {
        let to = |s: &&Solid| {
            let dx = (s.min.x - x).max(x - s.max.x).max(0.0);
            let dy = (s.min.y - y).max(y - s.max.y).max(0.0);
            dx.hypot(dy)
        };
        self.solids.iter().filter(|s| s.max.z > low && s.min.z < high).map(|s| to(&s)).fold(f64::INFINITY, f64::min)
    }
}

/// A spinning LiDAR of `rings` x `columns` rays, turned about the vertical by a motor, its spin axis tilted by 30 degrees.
pub struct Lidar {
    pub rings: usize,
    pub columns: usize,
    pub noise_m: f64,
    pub tilt_rad: f64,
    pub motor_radps: f64,
    /// Between the lowest and the highest ring.
    pub fov_rad: f64,
    rng: ChaCha8Rng,
    scans: u32,
}

impl Lidar {
    pub fn new(rings: usize, columns: usize, noise_m: f64, seed: u64) -> Self {
        Self {
            rings,
            columns,
            noise_m,
            tilt_rad: 30f64.to_radians(),
            motor_radps: std::f64::consts::PI,
            fov_rad: 45f64.to_radians(),
            rng: ChaCha8Rng::seed_from_u64(seed),
            scans: 0,
        }
    }

    fn uniform(&mut self) -> f64 {
        (f64::from(self.rng.next_u32()) + 0.5) / 4_294_967_296.0
    }

    pub fn gauss(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// The beams, in the frame of [`mount`](Self::mount).
    pub fn beams(&self) -> BeamGrid {
        let elevation = |ring: usize| (ring as f64 / (self.rings - 1).max(1) as f64 - 0.5) * self.fov_rad;
        BeamGrid::new((0..self.rings).map(elevation).collect(), self.columns, 0.0).unwrap()
    }

    /// How the spinning part stands on the sensor in the next scan.
    pub fn mount(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.motor_radps * 0.1 * f64::from(self.scans))
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.tilt_rad)
    }

    /// One scan (10 Hz) from the sensor's true pose: points in the sensor's gravity-aligned frame, with labels.
    pub fn scan(&mut self, world: &World, world_from_sensor: &Isometry3<f64>) -> Vec<(Point3<f32>, u16)> {
        let mount = self.mount();
        self.scans += 1;
        let mut points = Vec::with_capacity(self.rings * self.columns);
        for column in 0..self.columns {
            let azimuth = std::f64::consts::TAU * column as f64 / self.columns as f64;
            for ring in 0..self.rings {
                let elevation = (ring as f64 / (self.rings - 1).max(1) as f64 - 0.5) * self.fov_rad;
                let ray =
                    Vector3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
                let in_sensor = mount * ray;
                let in_world = world_from_sensor.rotation * in_sensor;
                let Some((range, label)) = world.cast(&world_from_sensor.translation.vector, &in_world) else {
                    continue;
                };
                let noisy = range + self.noise_m * self.gauss();
                points.push((Point3::from((in_sensor * noisy).cast::<f32>()), label));
            }
        }
        points
    }
}

/// A level sensor pose.
pub fn pose(x: f64, y: f64, z: f64, yaw_rad: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad))
}

pub fn in_world(points: &[(Point3<f32>, u16)], world_from_sensor: &Isometry3<f64>) -> Vec<Point3<f32>> {
    points.iter().map(|(p, _)| (world_from_sensor * p.cast::<f64>()).cast::<f32>()).collect()
}

/// Poses every `step_m` along a way, looking ahead, with the length of the way so far.
pub fn drive(way: &[[f64; 2]], height: f64, step_m: f64) -> Vec<(Isometry3<f64>, f64)> {
    let mut out = Vec::new();
    let mut travelled = 0.0;
    for leg in way.windows(2) {
        let (dx, dy) = (leg[1][0] - leg[0][0], leg[1][1] - leg[0][1]);
        let length = dx.hypot(dy);
        let steps = (length / step_m).round().max(1.0) as usize;
        for k in 0..steps {
            let t = k as f64 / steps as f64;
            out.push((pose(leg[0][0] + t * dx, leg[0][1] + t * dy, height, dy.atan2(dx)), travelled + t * length));
        }
        travelled += length;
    }
    out
}
