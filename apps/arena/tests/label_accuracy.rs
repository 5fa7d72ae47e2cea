//! Labels on simulated rooms: which points get the name of the thing they lie on?
//!
//! Masks are exact, or as the simulated segmenter draws them; the camera's mounting is off by 0.3 degrees about any axis, its
//! clock by 10 ms, while the robot drives and turns. The figures of the work order: at least 97 % of the labelled points right,
//! 99 % of those farther than 5 pixels from the border of their mask, and 85 % of the visible points of things labelled.
//!
//! `LABEL_SEEDS=8 cargo test -p arena --release --test label_accuracy -- --nocapture` measures more buildings.

use std::collections::BTreeMap;

use arena::mission::omni_perception::{
    DeskewConfig, EncoderSample, EncoderTrack, Equirectangular, LabelNames, Mask, MaskedPanorama, ObservationConfig,
    OdometryEstimate, RawPoint, RawScan, ReferenceTime, Rle, RotatingMount, Span, Stamp, Trajectory, deskew,
    observe_panorama,
};
use arena::mission::robot_model::RobotModel;
use arena::mission::stage_clock::{CpuScope, StageClock};
use arena::referee::Referee;
use arena::scenario::{Scene, draw_start, robot_truth};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_sim::lidar::{self, LidarConfig};
use omni_sim::motion::{KinematicState, Motion};
use omni_sim::panorama::{PanoramaConfig, capture_with_truth};
use omni_sim::segmenter::SegmenterConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What is wrong with the camera and its masks.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Trouble {
    /// Nothing.
    None,
    /// Mounting and clock; the masks are exact.
    Camera,
    /// Mounting and clock, and masks that bleed by 2 pixels and now and then show nothing.
    CameraAndMasks,
    /// Mounting and clock, and masks that cover what stands on or before their thing.
    CameraAndFilledMasks,
}

/// What became of the points around some images.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    labelled: usize,
    right: usize,
    inner: usize,
    inner_right: usize,
    /// Points of things that the camera truly sees, and those among them that got their right label.
    visible: usize,
    found: usize,
    points: usize,
    masks: usize,
    images: usize,
    cpu_s: f64,
}

impl Count {
    fn add(&mut self, other: &Count) {
        self.labelled += other.labelled;
        self.right += other.right;
        self.inner += other.inner;
        self.inner_right += other.inner_right;
        self.visible += other.visible;
        self.found += other.found;
        self.points += other.points;
        self.masks += other.masks;
        self.images += other.images;
        self.cpu_s += other.cpu_s;
    }

    fn shares(&self) -> [f64; 3] {
        let share = |part: usize, of: usize| part as f64 / of.max(1) as f64;
        [share(self.right, self.labelled), share(self.inner_right, self.inner), share(self.found, self.visible)]
    }

    fn print(&self, what: &str) {
        let [right, inner, found] = self.shares();
        println!(
            "{what}: {:.2} % right, {:.2} % inside, {:.1} % of the visible found; {} points, {} masks, {:.1} ms of CPU an image",
            100.0 * right,
            100.0 * inner,
            100.0 * found,
            self.points / self.images.max(1),
            self.masks / self.images.max(1),
            1e3 * self.cpu_s / self.images.max(1) as f64,
        );
    }
}

/// A robot that drives an arc through its start.
struct Arc {
    start: Isometry3<f64>,
}

const SPEED_MPS: f64 = 0.4;
const TURN_RADPS: f64 = 0.8;

impl Motion for Arc {
    fn at(&self, stamp_ns: i64) -> KinematicState {
        let t = stamp_ns as f64 * 1e-9;
        let (sin, cos) = (TURN_RADPS * t).sin_cos();
        let radius = SPEED_MPS / TURN_RADPS;
        let in_start = Isometry3::from_parts(
            Translation3::new(radius * sin, radius * (1.0 - cos), 0.0),
            UnitQuaternion::from_euler_angles(0.0, 0.0, TURN_RADPS * t),
        );
        let turn = self.start.rotation;
        KinematicState {
            velocity_world: turn * Vector3::new(SPEED_MPS * cos, SPEED_MPS * sin, 0.0),
            acceleration_world: turn * Vector3::new(-sin, cos, 0.0) * (SPEED_MPS * TURN_RADPS),
            angular_velocity_body: Vector3::z() * TURN_RADPS,
            ..KinematicState::at_rest(stamp_ns, self.start * in_start)
        }
    }
}

/// Points around an image at time zero, each with the instance it lies on.
struct Moment<'a> {
    scene: &'a Scene,
    arc: Arc,
    body_from_camera: Isometry3<f64>,
    points_in_world: Vec<Point3<f32>>,
    instances: Vec<u32>,
}

impl<'a> Moment<'a> {
    fn new(scene: &'a Scene, robot: &RobotModel, seed: u64) -> Moment<'a> {
        let referee = Referee::new(&scene.building, &scene.world, robot_truth(robot, 1.2), 0);
        let arc = Arc { start: draw_start(&referee, robot, seed).expect("room for the robot") };
        let sensors = &robot.sensors;
        let mount = lidar::RotatingMount {
            body_from_stator: sensors.body_from_lidar_stator,
            rotor_from_sensor: sensors.rotor_from_sensor,
            rate_hz: sensors.lidar.rotation_hz,
            phase_rad: 0.0,
        };
        let known_mount =
            RotatingMount { body_from_stator: mount.body_from_stator, rotor_from_sensor: mount.rotor_from_sensor };
        let knot = |k: i64| {
            let state = arc.at(k * 5_000_000);
            OdometryEstimate {
                velocity_in_world_mps: state.velocity_world,
                angular_velocity_in_body_radps: state.angular_velocity_body,
                ..OdometryEstimate::at_rest(Stamp(state.stamp_ns), state.world_from_body)
            }
        };
        let trajectory = Trajectory::from_estimates(&(-240..=100).map(knot).collect::<Vec<_>>()).expect("advances");
        let angle = |k: i64| EncoderSample { stamp: Stamp(2_000_000 * k), angle_rad: mount.angle_rad(2_000_000 * k) };
        let encoder = EncoderTrack::from_samples(&(-600..=250).map(angle).collect::<Vec<_>>()).expect("advances");

        let config = LidarConfig { seed, ..LidarConfig::default() };
        let (mut points_in_world, mut instances) = (Vec::new(), Vec::new());
        // What the mission has at hand 0.4 s after the image.
        for k in -11..=3 {
            let record = lidar::scan(&scene.world, &arc, &mount, &config, k * config.period_ns()).expect("sound");
            let points: Vec<RawPoint> = record
                .points
                .iter()
                .map(|p| RawPoint { position: p.position, offset_ns: p.offset_ns, ring: p.ring })
                .collect();
            for point in &points {
                let stamp_ns = record.start_ns + i64::from(point.offset_ns);
                let world_from_sensor = arc.at(stamp_ns).world_from_body * mount.body_from_sensor(stamp_ns);
                let origin = world_from_sensor * Point3::origin();
                let ray = world_from_sensor * point.position.cast::<f64>() - origin;
                let hit = scene.world.ray(&origin, &ray.normalize(), 100.0, stamp_ns);
                instances.push(hit.map_or(0, |hit| hit.instance));
            }
            let scan = RawScan { start: Stamp(record.start_ns), points };
            let config = DeskewConfig { min_range_m: 0.0, max_range_m: 1e3 };
            let straight = deskew(&scan, &encoder, &known_mount, &trajectory, ReferenceTime::End, &config);
            points_in_world.extend(straight.expect("known motion").points_in_world());
            assert_eq!(points_in_world.len(), instances.len(), "no point is dropped");
        }
        Moment { scene, arc, body_from_camera: sensors.body_from_camera, points_in_world, instances }
    }

    /// Labels the points as the robot would and judges them.
    fn judge(&self, trouble: Trouble, seed: u64, clock: &mut StageClock) -> Count {
        let bleeds = trouble == Trouble::CameraAndMasks;
        let segmenter = SegmenterConfig {
            confusion: 0.0,
            miss: 0.0,
            bleed_px: if bleeds { 2.0 } else { 0.0 },
            false_positives: if bleeds { 1.0 } else { 0.0 },
            track_swaps: 0.0,
            seed,
            ..SegmenterConfig::default()
        };
        let config = PanoramaConfig::default();
        let (record, truth) =
            capture_with_truth(&self.scene.world, &self.arc, &self.body_from_camera, &config, &segmenter, 0)
                .expect("sound");
        let camera = Equirectangular {
            width_px: config.width,
            height_px: config.height,
            phi_top_rad: config.phi_top_rad,
            phi_bottom_rad: config.phi_bottom_rad,
        };
        let height = config.height;
        let instance_at = |u: u32, v: u32| truth.instances[(u * height + v) as usize];
        let rle = |counts: &[u32]| Rle::from_counts(config.width, height, counts).expect("whole image");
        let exact: Vec<Rle> = record.masks.iter().map(|mask| rle(&mask.counts)).collect();
        // The thing that a mask shows: the one with most of its pixels; nothing for false alarms.
        let instance_of_mask: Vec<u32> = exact
            .iter()
            .map(|rle| {
                let mut pixels: BTreeMap<u32, u64> = BTreeMap::new();
                for span in rle.spans() {
                    (span.top..span.bottom).for_each(|v| *pixels.entry(instance_at(span.column, v)).or_default() += 1);
                }
                let (instance, most) = pixels.into_iter().max_by_key(|(_, count)| *count).unwrap_or((0, 0));
                if 2 * most > rle.area() { instance } else { 0 }
            })
            .collect();
        let masks: Vec<Mask> = exact
            .into_iter()
            .zip(&record.masks)
            .map(|(rle, mask)| {
                let rle = if trouble == Trouble::CameraAndFilledMasks { filled(&rle) } else { rle };
                Mask::new(rle, mask.label.as_str(), mask.score)
            })
            .collect();
        let panorama = MaskedPanorama { stamp: Stamp(0), masks, image: None };

        let true_camera = self.arc.at(0).world_from_body * self.body_from_camera;
        let world_from_camera = match trouble {
            Trouble::None => true_camera,
            _ => self.wrong_camera(seed),
        };
        let config = ObservationConfig::default();
        let before_s = clock.figures().get("labels").map_or(0.0, |stage| stage.cpu_ms_total * 1e-3);
        let seen = clock
            .time("labels", || observe_panorama(&panorama, &self.points_in_world, &world_from_camera, &camera, &config))
            .expect("sound");
        let mut count = Count {
            points: self.points_in_world.len(),
            masks: panorama.masks.len(),
            images: 1,
            cpu_s: clock.figures()["labels"].cpu_ms_total * 1e-3 - before_s,
            ..Count::default()
        };

        let snapshot_ns = 0;
        let eye = true_camera * Point3::origin();
        let camera_from_world = world_from_camera.inverse();
        for ((point, &instance), mask) in self.points_in_world.iter().zip(&self.instances).zip(&seen.mask_of_point) {
            let point = point.cast::<f64>();
            let is_right = mask.is_some_and(|mask| instance != 0 && instance_of_mask[usize::from(mask)] == instance);
            if let Some(mask) = mask {
                count.labelled += 1;
                count.right += usize::from(is_right);
                let pixel = camera.project(&(camera_from_world * point)).expect("labelled points are in the image");
                if is_inner(&panorama.masks[usize::from(*mask)].rle, pixel.u as i64, pixel.v as i64) {
                    count.inner += 1;
                    count.inner_right += usize::from(is_right);
                }
            }
            if instance == 0 || !instance_of_mask.contains(&instance) {
                continue;
            }
            let ray = point - eye;
            let hit = self.scene.world.ray(&eye, &ray.normalize(), 100.0, snapshot_ns);
            let is_seen = hit.is_some_and(|hit| hit.instance == instance && hit.distance_m > ray.norm() - 0.05);
            if is_seen && camera.project(&(true_camera.inverse() * point)).is_some() {
                count.visible += 1;
                count.found += usize::from(is_right);
            }
        }
        count
    }

    /// The camera as the robot believes it to be: 0.3 degrees off about some axis, 10 ms early or late.
    fn wrong_camera(&self, seed: u64) -> Isometry3<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let axis = Vector3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
        let turn = UnitQuaternion::from_scaled_axis(axis.normalize() * 0.3_f64.to_radians());
        let late_ns = if rng.random::<bool>() { 10_000_000 } else { -10_000_000 };
        let mounted = self.body_from_camera * Isometry3::from_parts(Translation3::identity(), turn);
        self.arc.at(late_ns).world_from_body * mounted
    }
}

/// A mask that also covers what stands on or before its thing: in each column everything from its top to its bottom.
fn filled(rle: &Rle) -> Rle {
    let mut columns: BTreeMap<u32, (u32, u32)> = BTreeMap::new();
    for span in rle.spans() {
        let rows = columns.entry(span.column).or_insert((span.top, span.bottom));
        *rows = (rows.0.min(span.top), rows.1.max(span.bottom));
    }
    let spans = columns.into_iter().map(|(column, (top, bottom))| Span { column, top, bottom }).collect();
    Rle::from_spans(rle.width(), rle.height(), spans).expect("inside the same image")
}

/// Whether all pixels within 5 of this one belong to the mask (columns wrap; above and below the image nothing is known).
fn is_inner(mask: &Rle, u: i64, v: i64) -> bool {
    const REACH: i64 = 5;
    let (width, height) = (i64::from(mask.width()), i64::from(mask.height()));
    (-REACH..=REACH).all(|du| {
        (-REACH..=REACH).filter(|dv| du * du + dv * dv <= REACH * REACH).all(|dv| {
            let (u, v) = ((u + du).rem_euclid(width), v + dv);
            !(0..height).contains(&v) || mask.contains(u as u32, v as u32)
        })
    })
}

#[test]
fn labels_on_simulated_rooms_are_right() {
    let seeds = std::env::var("LABEL_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(2_u64);
    let robot = RobotModel::builtin_quadruped();
    let mut clock = StageClock::new(CpuScope::Thread);
    let troubles = [Trouble::None, Trouble::Camera, Trouble::CameraAndMasks, Trouble::CameraAndFilledMasks];
    let mut sums = [Count::default(); 4];
    for seed in 0..seeds {
        let scene = Scene::drawn(100 + seed, &robot).expect("a building");
        for place in 0..2 {
            let seed = 10 * seed + place;
            let moment = Moment::new(&scene, &robot, seed);
            for (sum, trouble) in sums.iter_mut().zip(troubles) {
                let count = moment.judge(trouble, seed, &mut clock);
                count.print(&format!("seed {seed:3} {trouble:?}"));
                sum.add(&count);
            }
        }
    }
    for (sum, trouble) in sums.iter().zip(troubles) {
        sum.print(&format!("all {trouble:?}"));
    }
    let [right, inner, found] = sums[1].shares();
    assert!(right >= 0.97, "{right} of the labelled points are right");
    assert!(inner >= 0.99, "{inner} of the labelled points inside masks are right");
    assert!(found >= 0.85, "{found} of the visible points of things are labelled");
    // With a real segmenter's masks the same holds but for a little.
    let [right, inner, found] = sums[2].shares();
    assert!(right >= 0.95 && inner >= 0.98 && found >= 0.75, "{right} {inner} {found}");
}

#[test]
fn names_of_the_simulator_are_canonical() {
    // Otherwise the names in the graph would not be those of the truth.
    let names = LabelNames::default();
    for seed in 0..12 {
        let scene = Scene::drawn(seed, &RobotModel::builtin_quadruped()).expect("a building");
        for object in &scene.building.objects {
            assert_eq!(names.canonical(&object.class), object.class);
        }
    }
}
