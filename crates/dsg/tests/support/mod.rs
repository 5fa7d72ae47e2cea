//! A small flat with furniture, seen frame by frame through a drifting, confused and blind segmenter: the input of
//! association as the robot has it, with the truth beside it.

#![allow(dead_code)]

pub mod graphs;

use dsg::ObjectEvidence;
use nalgebra::{Isometry3, Point3, Vector3};

/// A small deterministic generator (splitmix64): tests need numbers, not a dependency.
pub struct Dice(pub u64);

impl Dice {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Roughly normal, unit variance.
    pub fn normal(&mut self) -> f64 {
        ((0..4).map(|_| self.unit()).sum::<f64>() - 2.0) * 3.0_f64.sqrt()
    }
}

/// A thing of the truth.
#[derive(Debug, Clone)]
pub struct Thing {
    pub label: &'static str,
    /// What the segmenter mistakes it for.
    pub look_alike: &'static str,
    pub center: Point3<f64>,
    pub sides: Vector3<f64>,
}

pub fn thing(label: &'static str, look_alike: &'static str, center: [f64; 3], sides: [f64; 3]) -> Thing {
    Thing { label, look_alike, center: Point3::from(center), sides: Vector3::from(sides) }
}

/// Furniture of a flat along 12 m: chairs close together, small things close together on tables, a chair at a desk.
pub fn furniture() -> Vec<Thing> {
    vec![
        thing("dining table", "desk", [2.0, 3.6, 0.375], [1.6, 0.9, 0.75]),
        thing("chair", "stool", [1.6, 2.85, 0.45], [0.45, 0.45, 0.9]),
        thing("chair", "stool", [2.4, 2.85, 0.45], [0.45, 0.45, 0.9]),
        thing("chair", "stool", [1.6, 4.35, 0.45], [0.45, 0.45, 0.9]),
        thing("chair", "stool", [2.4, 4.35, 0.45], [0.45, 0.45, 0.9]),
        thing("mug", "bowl", [1.8, 3.6, 0.80], [0.09, 0.09, 0.10]),
        thing("bottle", "vase", [2.3, 3.7, 0.88], [0.09, 0.09, 0.26]),
        thing("sofa", "bed", [6.0, 3.5, 0.4], [2.0, 0.9, 0.8]),
        thing("coffee table", "bench", [6.0, 2.2, 0.22], [1.0, 0.6, 0.44]),
        thing("tv", "picture", [6.0, 0.2, 1.1], [1.1, 0.08, 0.65]),
        thing("desk", "table", [10.0, 0.5, 0.37], [1.4, 0.7, 0.74]),
        thing("monitor", "picture", [10.0, 0.4, 0.98], [0.55, 0.15, 0.42]),
        thing("office chair", "armchair", [10.0, 1.4, 0.5], [0.6, 0.6, 1.0]),
        thing("bookshelf", "cabinet", [11.8, 3.0, 0.9], [0.35, 1.0, 1.8]),
        thing("plant", "lamp", [8.2, 0.4, 0.5], [0.4, 0.4, 1.0]),
        thing("bed", "sofa", [14.0, 2.5, 0.3], [1.6, 2.0, 0.6]),
        thing("nightstand", "stool", [14.0, 1.1, 0.27], [0.45, 0.4, 0.54]),
    ]
}

/// What spoils the view.
#[derive(Debug, Clone, Copy)]
pub struct Trouble {
    /// Share of things called by their look-alike; one decision per thing and six frames (three seconds).
    pub confusion: f64,
    /// Share of views missed.
    pub miss: f64,
    /// Drift of the map frame at the end, and its direction.
    pub drift_m: f64,
    pub heading_rad: f64,
    /// Noise of a point.
    pub noise_m: f64,
}

pub const USUAL: Trouble = Trouble { confusion: 0.08, miss: 0.15, drift_m: 0.3, heading_rad: 0.03, noise_m: 0.015 };

/// The robot walks up and down the flat, `frames` frames at 2 Hz and 0.7 m/s.
pub struct Walk {
    pub things: Vec<Thing>,
    pub trouble: Trouble,
    pub frames: usize,
    pub seed: u64,
}

impl Walk {
    pub fn stamp_ns(&self, frame: usize) -> i64 {
        frame as i64 * 500_000_000
    }

    pub fn robot(&self, frame: usize) -> Point3<f64> {
        let along = (0.35 * frame as f64) % 28.0;
        let x = if along < 14.0 { along } else { 28.0 - along };
        Point3::new(x, 1.75 + 0.6 * (0.3 * x).sin(), 0.73)
    }

    /// Map frame at this time from the true world.
    pub fn map_from_world(&self, frame: usize) -> Isometry3<f64> {
        let share = frame as f64 / self.frames.max(1) as f64;
        let shift = Vector3::new(0.8, -0.6, 0.05) * (self.trouble.drift_m * share);
        Isometry3::new(shift, Vector3::z() * (self.trouble.heading_rad * share / 4.0))
    }

    /// What the segmenter and the LiDAR give for a frame, with the index of the thing each piece shows.
    pub fn frame(&self, frame: usize) -> (Vec<ObjectEvidence>, Vec<usize>) {
        let robot = self.robot(frame);
        let map_from_world = self.map_from_world(frame);
        let (mut evidence, mut shows) = (Vec::new(), Vec::new());
        for (index, thing) in self.things.iter().enumerate() {
            let distance = (thing.center - robot).norm();
            if distance > 5.5 {
                continue;
            }
            let mut dice = Dice(self.seed ^ (index as u64) << 32 ^ frame as u64);
            let mut slow = Dice(self.seed ^ 0xABCD ^ (index as u64) << 32 ^ (frame / 6) as u64);
            if dice.unit() < self.trouble.miss {
                continue;
            }
            let points = visible_points(thing, &robot, self.trouble.noise_m, &mut dice);
            if points.len() < 4 {
                continue;
            }
            let is_confused = slow.unit() < self.trouble.confusion;
            let label = if is_confused { thing.look_alike } else { thing.label };
            let points = points.iter().map(|p| (map_from_world * p).cast::<f32>()).collect();
            evidence.push(ObjectEvidence {
                stamp_ns: self.stamp_ns(frame),
                label_weights: vec![(label.to_owned(), 1.0)],
                caption: format!("a {label}"),
                score: dice.range(0.5, 0.95) as f32,
                points,
                color: None,
                track: None,
            });
            shows.push(index);
        }
        (evidence, shows)
    }
}

/// Points on the faces that look at the robot, about as dense as a spinning LiDAR's at this distance.
fn visible_points(thing: &Thing, robot: &Point3<f64>, noise_m: f64, dice: &mut Dice) -> Vec<Point3<f64>> {
    let distance = (thing.center - robot).norm().max(0.5);
    let mut points = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut normal = Vector3::zeros();
            normal[axis] = side;
            let face = thing.center + normal * (thing.sides[axis] / 2.0);
            let incidence = normal.dot(&(robot - face)) / (robot - face).norm();
            if incidence <= 0.02 {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let area = thing.sides[u] * thing.sides[v];
            // About 30 000 rays over the sphere.
            let count = (2500.0 * area * incidence / (distance * distance)).min(1500.0);
            let count = count.floor() as usize + usize::from(dice.unit() < count.fract());
            for _ in 0..count {
                let mut point = face;
                point[u] += thing.sides[u] * (dice.unit() - 0.5);
                point[v] += thing.sides[v] * (dice.unit() - 0.5);
                let along = (point - robot).normalize();
                points.push(point + along * (noise_m * dice.normal()));
            }
        }
    }
    points
}
