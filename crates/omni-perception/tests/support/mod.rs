//! A furnished room made of boxes, with a LiDAR, a panoramic camera and a segmenter of its own.
//!
//! Nothing of the crate's mathematics is used to make the data except the camera's unprojection, which has its own
//! tests; a common mistake would cancel.
#![allow(dead_code)] // each test file uses its part

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::*;

/// An axis-aligned box of one thing (a thing may have several).
pub struct Block {
    pub thing: usize,
    pub min: Point3<f64>,
    pub max: Point3<f64>,
}

pub struct Scene {
    /// Thing 0 is the room itself.
    pub names: Vec<&'static str>,
    pub blocks: Vec<Block>,
}

/// A small generator (splitmix64), so that the data needs no crate.
pub struct Noise(pub u64);

impl Noise {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Standard normal (sum of twelve).
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

impl Scene {
    /// A 7 x 6 m room; the robot stands near its middle.
    pub fn living_room() -> Scene {
        let mut scene = Scene { names: vec!["room"], blocks: Vec::new() };
        let wall = |min: [f64; 3], max: [f64; 3]| Block { thing: 0, min: min.into(), max: max.into() };
        scene.blocks.extend([
            wall([-3.6, -3.1, -0.1], [3.6, 3.1, 0.0]),
            wall([-3.6, -3.1, 2.5], [3.6, 3.1, 2.6]),
            wall([3.5, -3.1, 0.0], [3.6, 3.1, 2.5]),
            wall([-3.6, -3.1, 0.0], [-3.5, 3.1, 2.5]),
            wall([-3.6, 3.0, 0.0], [3.6, 3.1, 2.5]),
            wall([-3.6, -3.1, 0.0], [3.6, -3.0, 2.5]),
        ]);
        // A low sideboard with a mug on it, against the wall ahead.
        scene.add("sideboard", &[([2.9, -0.8, 0.0], [3.45, 0.8, 0.6])]);
        scene.add("mug", &[([3.00, 0.30, 0.6], [3.08, 0.38, 0.70])]);
        scene.add("lamp", &[([3.1, -0.5, 0.6], [3.3, -0.3, 0.95])]);
        // A chair in front of the left wall.
        scene.add(
            "chair",
            &[
                ([0.3, 2.0, 0.42], [0.75, 2.45, 0.47]),
                ([0.3, 2.41, 0.47], [0.75, 2.45, 0.95]),
                ([0.3, 2.0, 0.0], [0.34, 2.04, 0.42]),
                ([0.71, 2.0, 0.0], [0.75, 2.04, 0.42]),
                ([0.3, 2.41, 0.0], [0.34, 2.45, 0.42]),
                ([0.71, 2.41, 0.0], [0.75, 2.45, 0.42]),
            ],
        );
        // A table behind the robot (across the seam) and a sofa at the right wall, a box half hidden by a post.
        scene.add(
            "table",
            &[
                ([-2.6, -0.6, 0.50], [-1.6, 0.6, 0.54]),
                ([-1.66, -0.6, 0.0], [-1.6, -0.54, 0.5]),
                ([-1.66, 0.54, 0.0], [-1.6, 0.6, 0.5]),
                ([-2.6, -0.6, 0.0], [-2.54, -0.54, 0.5]),
                ([-2.6, 0.54, 0.0], [-2.54, 0.6, 0.5]),
            ],
        );
        scene.add("sofa", &[([-0.9, -2.95, 0.0], [0.9, -2.1, 0.42]), ([-0.9, -2.95, 0.42], [0.9, -2.65, 0.85])]);
        scene.add("box", &[([1.9, -2.4, 0.0], [2.3, -2.0, 0.5])]);
        scene.add("post", &[([1.5, -1.75, 0.0], [1.6, -1.65, 2.0])]);
        scene.add("clock", &[([-3.5, 1.5, 1.2], [-3.46, 1.8, 1.5])]);
        scene
    }

    fn add(&mut self, name: &'static str, boxes: &[([f64; 3], [f64; 3])]) {
        let thing = self.names.len();
        self.names.push(name);
        self.blocks.extend(boxes.iter().map(|(min, max)| Block { thing, min: (*min).into(), max: (*max).into() }));
    }

    /// Distance along a unit direction to the first block, and its thing.
    pub fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<(f64, usize)> {
        let inverse = direction.map(|x| 1.0 / x);
        let mut best: Option<(f64, usize)> = None;
        for block in &self.blocks {
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for axis in 0..3 {
                let a = (block.min[axis] - origin[axis]) * inverse[axis];
                let b = (block.max[axis] - origin[axis]) * inverse[axis];
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
            if enter <= leave && enter > 1e-6 && best.is_none_or(|(distance, _)| enter < distance) {
                best = Some((enter, block.thing));
            }
        }
        best
    }

    /// The box around all blocks of a thing.
    pub fn bounds(&self, thing: usize) -> (Point3<f64>, Point3<f64>) {
        let blocks = self.blocks.iter().filter(|block| block.thing == thing);
        blocks.fold((Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3])), |(min, max), block| {
            (min.inf(&block.min), max.sup(&block.max))
        })
    }
}

/// The body's true motion: an arc with some bobbing, about 0.7 m/s and 0.5 rad/s.
pub fn world_from_body(t_s: f64) -> Isometry3<f64> {
    let yaw = 0.5 * t_s + 0.1 * (6.0 * t_s).sin();
    let position = Translation3::new(0.7 * t_s - 0.3, 0.1 * t_s * t_s, 0.31 + 0.01 * (12.0 * t_s).sin());
    let pitch = 0.02 * (12.0 * t_s).cos();
    Isometry3::from_parts(position, UnitQuaternion::from_euler_angles(0.0, pitch, yaw))
}

/// Knots of the true motion from central differences, at `rate_hz`.
pub fn trajectory(from_s: f64, to_s: f64, rate_hz: f64) -> Trajectory {
    let knots = ((to_s - from_s) * rate_hz).round() as usize;
    let estimates: Vec<OdometryEstimate> = (0..=knots)
        .map(|k| {
            let t = from_s + k as f64 / rate_hz;
            let (before, after) = (world_from_body(t - 1e-5), world_from_body(t + 1e-5));
            OdometryEstimate {
                velocity_in_world_mps: (after.translation.vector - before.translation.vector) / 2e-5,
                angular_velocity_in_body_radps: (before.rotation.inverse() * after.rotation).scaled_axis() / 2e-5,
                ..OdometryEstimate::at_rest(Stamp(0).plus_seconds(t), world_from_body(t))
            }
        })
        .collect();
    Trajectory::from_estimates(&estimates).expect("knots advance")
}

/// The camera on its mast.
pub fn body_from_camera() -> Isometry3<f64> {
    Isometry3::translation(0.05, 0.0, 0.42)
}

/// The LiDAR on its motor, tilted by 30 degrees.
pub fn mount() -> RotatingMount {
    RotatingMount {
        body_from_stator: Isometry3::translation(0.05, 0.0, 0.30),
        rotor_from_sensor: Isometry3::from_parts(
            Translation3::new(0.0, 0.0, 0.02),
            UnitQuaternion::from_euler_angles(0.0, 30_f64.to_radians(), 0.0),
        ),
    }
}

/// The motor's usual rate: half a turn a second.
pub const TURNING_RADPS: f64 = std::f64::consts::PI;

pub fn encoder(from_s: f64, to_s: f64, rate_radps: f64) -> EncoderTrack {
    let samples: Vec<EncoderSample> = (0..=((to_s - from_s) * 500.0).round() as usize)
        .map(|k| from_s + k as f64 / 500.0)
        .map(|t| EncoderSample { stamp: Stamp(0).plus_seconds(t), angle_rad: rate_radps * t })
        .collect();
    EncoderTrack::from_samples(&samples).expect("samples advance")
}

/// One scan of 32 x 1024 rays in 0.1 s, and the thing each return comes from.
pub fn scan(
    scene: &Scene,
    start_s: f64,
    motor_rate_radps: f64,
    range_noise_m: f64,
    noise: &mut Noise,
) -> (RawScan, Vec<usize>) {
    let mut scan = RawScan { start: Stamp(0).plus_seconds(start_s), points: Vec::new() };
    let mut things = Vec::new();
    for column in 0..1024 {
        let offset_ns = (column as f64 * 0.1e9 / 1024.0) as u32;
        let t = start_s + f64::from(offset_ns) * 1e-9;
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, motor_rate_radps * t);
        let world_from_sensor = world_from_body(t)
            * mount().body_from_stator
            * Isometry3::from_parts(Translation3::identity(), turn)
            * mount().rotor_from_sensor;
        let azimuth = std::f64::consts::TAU * f64::from(column) / 1024.0;
        for ring in 0..32_u16 {
            let elevation = (-22.5 + 45.0 * f64::from(ring) / 31.0).to_radians();
            let direction =
                Vector3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
            let origin = world_from_sensor * Point3::origin();
            let Some((range, thing)) = scene.cast(&origin, &(world_from_sensor.rotation * direction)) else {
                continue;
            };
            let position = Point3::from(direction * (range + range_noise_m * noise.normal())).cast::<f32>();
            scan.points.push(RawPoint { position, offset_ns, ring });
            things.push(thing);
        }
    }
    (scan, things)
}

/// The thing that each pixel truly shows, row by row.
pub fn render(scene: &Scene, world_from_camera: &Isometry3<f64>, camera: &Equirectangular) -> Vec<usize> {
    let origin = world_from_camera * Point3::origin();
    let pixels = (0..camera.height_px).flat_map(|row| (0..camera.width_px).map(move |column| (column, row)));
    pixels
        .map(|(column, row)| {
            let direction = camera.unproject(f64::from(column) + 0.5, f64::from(row) + 0.5);
            scene.cast(&origin, &(world_from_camera.rotation * direction.into_inner())).map_or(0, |hit| hit.1)
        })
        .collect()
}

/// Masks of all things as a segmenter gives them: grown over their border by `bleed_px` (a square).
pub fn segment(scene: &Scene, image: &[usize], camera: &Equirectangular, bleed_px: i64) -> Vec<Mask> {
    let (width, height) = (i64::from(camera.width_px), i64::from(camera.height_px));
    let mut masks = Vec::new();
    for (thing, name) in scene.names.iter().enumerate().skip(1) {
        let mut rows = vec![false; image.len()];
        for (index, _) in image.iter().enumerate().filter(|(_, seen)| **seen == thing) {
            let (column, row) = (index as i64 % width, index as i64 / width);
            for dv in -bleed_px..=bleed_px {
                for du in -bleed_px..=bleed_px {
                    let (u, v) = ((column + du).rem_euclid(width), row + dv);
                    if (0..height).contains(&v) {
                        rows[(v * width + u) as usize] = true;
                    }
                }
            }
        }
        if rows.contains(&true) {
            let rle = Rle::from_rows(camera.width_px, camera.height_px, &rows).expect("whole image");
            masks.push(Mask { caption: format!("a {name}"), ..Mask::new(rle, *name, 0.8) });
        }
    }
    masks
}

/// Everything around one image at t = 0: world points of ten scans, their things, the masks.
pub struct Moment {
    pub scene: Scene,
    pub points_in_world: Vec<Point3<f32>>,
    pub things: Vec<usize>,
    pub image: Vec<usize>,
    pub masks: Vec<Mask>,
    pub camera: Equirectangular,
    pub world_from_camera: Isometry3<f64>,
}

impl Moment {
    pub fn new(seed: u64, range_noise_m: f64, bleed_px: i64) -> Moment {
        Moment::with_motor(seed, range_noise_m, bleed_px, TURNING_RADPS)
    }

    pub fn with_motor(seed: u64, range_noise_m: f64, bleed_px: i64, motor_rate_radps: f64) -> Moment {
        let scene = Scene::living_room();
        let mut noise = Noise(seed);
        let (trajectory, encoder) = (trajectory(-0.5, 0.5, 200.0), encoder(-0.5, 0.5, motor_rate_radps));
        let (mut points_in_world, mut things) = (Vec::new(), Vec::new());
        for k in 0..10 {
            let (scan, mut of_scan) =
                scan(&scene, -0.5 + 0.1 * f64::from(k), motor_rate_radps, range_noise_m, &mut noise);
            let config = DeskewConfig { min_range_m: 0.0, ..DeskewConfig::default() };
            let deskewed = deskew(&scan, &encoder, &mount(), &trajectory, ReferenceTime::End, &config);
            let deskewed = deskewed.expect("covered");
            assert_eq!(deskewed.points_in_body.len(), scan.points.len());
            points_in_world.extend(deskewed.points_in_world());
            things.append(&mut of_scan);
        }
        let camera = Equirectangular::default();
        let world_from_camera = world_from_body(0.0) * body_from_camera();
        let image = render(&scene, &world_from_camera, &camera);
        let masks = segment(&scene, &image, &camera, bleed_px);
        Moment { scene, points_in_world, things, image, masks, camera, world_from_camera }
    }

    pub fn panorama(&self) -> MaskedPanorama {
        MaskedPanorama { stamp: Stamp(0), masks: self.masks.clone(), image: None }
    }
}

pub mod drive;
