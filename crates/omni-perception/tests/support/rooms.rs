//! Buildings of boxes: walls with doors, furniture, all drawn from a seed; their surface as a map and what a LiDAR sees in them.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand_free::Draw;

/// Numbers from a seed (SplitMix64).
pub mod rand_free {
    /// The state.
    #[derive(Debug, Clone)]
    pub struct Draw(pub u64);

    impl Draw {
        /// Uniform in [0, 1).
        pub fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        }

        /// Uniform between two numbers.
        pub fn between(&mut self, low: f64, high: f64) -> f64 {
            low + (high - low) * self.unit()
        }

        /// Roughly normal: twelve uniform numbers.
        pub fn normal(&mut self) -> f64 {
            (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
        }
    }
}

type Cuboid = ([f64; 3], [f64; 3]);

/// Height of the walls.
const WALL_M: f64 = 2.5;
/// The LiDAR, in the frame of a pose.
pub const EYE: Point3<f32> = Point3::new(0.0, 0.0, 0.6);
/// Half the thickness of a wall.
const HALF_M: f64 = 0.05;

/// Rooms in a row, with a door from each to the next.
#[derive(Debug, Clone)]
pub struct Building {
    pub boxes: Vec<Cuboid>,
    /// Inner rectangles of the rooms: min x, min y, max x, max y.
    pub rooms: Vec<[f64; 4]>,
}

impl Building {
    /// Rooms of 3 to 6 m with up to six pieces of furniture each.
    pub fn drawn(seed: u64, rooms: usize) -> Building {
        let mut draw = Draw(seed);
        let mut building = Building { boxes: Vec::new(), rooms: Vec::new() };
        let mut x = 0.0;
        for room in 0..rooms {
            let (wide, deep) = (draw.between(3.0, 6.0), draw.between(3.0, 6.0));
            building.add_room(x, wide, deep, room + 1 < rooms, draw.between(0.3, deep.min(3.0) - 1.3));
            for _ in 0..3 + (draw.unit() * 4.0) as usize {
                let size = [draw.between(0.3, 1.2), draw.between(0.3, 1.2), draw.between(0.4, 2.0)];
                let at = [x + draw.between(0.1, wide - size[0] - 0.1), draw.between(0.1, deep - size[1] - 0.1)];
                building.boxes.push(([at[0], at[1], 0.0], [at[0] + size[0], at[1] + size[1], size[2]]));
            }
            x += wide;
        }
        building
    }

    /// Two rooms with the same walls, doors that mirror each other away, and the same furniture.
    pub fn twins() -> Building {
        let mut building = Building { boxes: Vec::new(), rooms: Vec::new() };
        for x in [0.0, 6.0] {
            building.add_room(x, 4.0, 5.0, false, 0.0);
            building.boxes.push(([x + 0.5, 0.5, 0.0], [x + 1.4, 1.0, 0.8]));
            building.boxes.push(([x + 2.6, 3.5, 0.0], [x + 3.2, 4.8, 1.7]));
        }
        building
    }

    fn add_room(&mut self, x: f64, wide: f64, deep: f64, has_door: bool, door_y: f64) {
        self.rooms.push([x + HALF_M, HALF_M, x + wide - HALF_M, deep - HALF_M]);
        let mut wall = |x0: f64, y0: f64, x1: f64, y1: f64| {
            self.boxes.push(([x0 - HALF_M, y0 - HALF_M, 0.0], [x1 + HALF_M, y1 + HALF_M, WALL_M]));
        };
        wall(x, 0.0, x + wide, 0.0);
        wall(x, deep, x + wide, deep);
        if x == 0.0 || !has_door {
            wall(x, 0.0, x, deep);
        }
        if has_door {
            // The wall to the next room is as deep as the deepest can be.
            wall(x + wide, 0.0, x + wide, door_y);
            wall(x + wide, door_y + 1.0, x + wide, 6.0);
        } else {
            wall(x + wide, 0.0, x + wide, 6.0_f64.min(deep));
        }
        self.boxes.push(([x, 0.0, -0.1], [x + wide, deep, 0.0]));
    }

    /// Points on all faces, 5 cm apart, with noise.
    pub fn surface(&self, noise_m: f64, seed: u64) -> Vec<Point3<f32>> {
        const STEP_M: f64 = 0.05;
        let mut draw = Draw(seed ^ 77);
        let mut points = Vec::new();
        for (min, max) in &self.boxes {
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for side in [min[axis], max[axis]] {
                    for i in 0..=((max[u] - min[u]) / STEP_M) as usize {
                        for j in 0..=((max[v] - min[v]) / STEP_M) as usize {
                            let mut point = Point3::origin();
                            point[axis] = side + noise_m * draw.normal();
                            point[u] = min[u] + i as f64 * STEP_M;
                            point[v] = min[v] + j as f64 * STEP_M;
                            points.push(point.cast::<f32>());
                        }
                    }
                }
            }
        }
        points
    }

    /// A free place in a room with a heading; the pose of a scan (level, on the floor) in the building.
    pub fn free_pose(&self, room: usize, seed: u64) -> Isometry3<f64> {
        let mut draw = Draw(seed ^ 0xF00D);
        let [x0, y0, x1, y1] = self.rooms[room];
        for _ in 0..1000 {
            let (x, y) = (draw.between(x0 + 0.3, x1 - 0.3), draw.between(y0 + 0.3, y1 - 0.3));
            let is_free = self.boxes.iter().all(|(min, max)| {
                max[2] <= 0.0 || x < min[0] - 0.3 || x > max[0] + 0.3 || y < min[1] - 0.3 || y > max[1] + 0.3
            });
            if is_free {
                let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), draw.between(-3.1, 3.1));
                return Isometry3::from_parts(nalgebra::Translation3::new(x, y, 0.0), turn);
            }
        }
        panic!("room {room} is full");
    }

    /// What a LiDAR 0.6 m above the floor sees all round at `pose`, in the frame of the pose.
    pub fn scan(&self, pose: &Isometry3<f64>, noise_m: f64, seed: u64) -> Vec<Point3<f32>> {
        let mut draw = Draw(seed ^ 0x5CA7);
        let eye = pose * Point3::new(0.0, 0.0, 0.6);
        let mut points = Vec::new();
        for elevation in -20..=24 {
            for azimuth in 0..360 {
                let (e, a) = ((elevation as f64 * 2.0).to_radians(), (azimuth as f64).to_radians());
                let ray = Vector3::new(a.cos() * e.cos(), a.sin() * e.cos(), e.sin());
                let Some(range_m) = self.first_hit(&eye, &(pose.rotation * ray)) else { continue };
                if range_m < 12.0 {
                    let at = Point3::new(0.0, 0.0, 0.6) + ray * (range_m + noise_m * draw.normal());
                    points.push(at.cast::<f32>());
                }
            }
        }
        points
    }

    fn first_hit(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> Option<f64> {
        let hit = |(min, max): &Cuboid| {
            let (mut near, mut far) = (0.0_f64, f64::INFINITY);
            for axis in 0..3 {
                let (a, b) = ((min[axis] - eye[axis]) / ray[axis], (max[axis] - eye[axis]) / ray[axis]);
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            (near < far && near > 0.0).then_some(near)
        };
        self.boxes.iter().filter_map(hit).min_by(f64::total_cmp)
    }
}
