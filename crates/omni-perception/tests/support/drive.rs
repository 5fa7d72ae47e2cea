//! A simulated drive for the odometry: any motion through any boxes, an IMU, an encoder, a LiDAR on its motor, and what
//! can be wrong with them. The derivatives of the motion are taken by differences; nothing of the crate is used.
#![allow(dead_code)] // each test file uses its part

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::*;

use super::{Block, Noise, Scene};

/// What happens, and what is wrong.
pub struct Drive {
    pub scene: Scene,
    /// `world_from_imu` over time.
    pub motion: fn(f64) -> Isometry3<f64>,
    /// Blocks that are elsewhere at every time.
    pub moving: fn(f64) -> Vec<Block>,
    pub from_s: f64,
    pub to_s: f64,
    pub columns: u32,
    pub range_noise_m: f64,
    /// Densities of gyroscope and accelerometer.
    pub imu_noise: (f64, f64),
    pub gyro_bias: Vector3<f64>,
    pub accel_bias: Vector3<f64>,
    /// The LiDAR is mounted this much otherwise than the filter is told.
    pub mount_error: Isometry3<f64>,
    /// The LiDAR's clock is behind by this.
    pub lidar_clock_s: f64,
    /// Scans in this span of time see nothing.
    pub blind_s: (f64, f64),
    /// No IMU sample in this span of time.
    pub deaf_s: (f64, f64),
    /// Zero: a fixed LiDAR without an encoder.
    pub motor_radps: f64,
    pub seed: u64,
}

pub const IMU_HZ: f64 = 200.0;

impl Drive {
    pub fn new(motion: fn(f64) -> Isometry3<f64>) -> Drive {
        Drive {
            scene: Scene::living_room(),
            motion,
            moving: |_| Vec::new(),
            from_s: 0.0,
            to_s: 6.0,
            columns: 220,
            range_noise_m: 0.015,
            imu_noise: (2.5e-4, 3e-3),
            gyro_bias: Vector3::new(0.004, -0.003, 0.002),
            accel_bias: Vector3::new(0.04, -0.03, 0.05),
            mount_error: Isometry3::identity(),
            lidar_clock_s: 0.0,
            blind_s: (0.0, 0.0),
            deaf_s: (0.0, 0.0),
            motor_radps: std::f64::consts::PI,
            seed: 1,
        }
    }

    pub fn imu(&self) -> Vec<ImuSample> {
        let mut noise = Noise(self.seed.wrapping_mul(7919));
        let mut white =
            |density: f64| Vector3::new(noise.normal(), noise.normal(), noise.normal()) * (density * IMU_HZ.sqrt());
        let count = ((self.to_s - self.from_s) * IMU_HZ) as usize;
        (0..=count + 4)
            .map(|k| self.from_s + k as f64 / IMU_HZ)
            .filter(|t| !(self.deaf_s.0 < *t && *t < self.deaf_s.1))
            .map(|t| {
                const H: f64 = 1e-4;
                let [before, now, after] = [t - H, t, t + H].map(self.motion);
                let rate = (before.rotation.inverse() * after.rotation).scaled_axis() / (2.0 * H);
                let [p0, p1, p2] = [before, now, after].map(|pose| pose.translation.vector);
                let acceleration = (p0 - p1 * 2.0 + p2) / (H * H);
                let force = now.rotation.inverse() * (acceleration + Vector3::z() * 9.81);
                ImuSample {
                    stamp: Stamp(0).plus_seconds(t),
                    angular_velocity_radps: rate + self.gyro_bias + white(self.imu_noise.0),
                    specific_force_mps2: force + self.accel_bias + white(self.imu_noise.1),
                }
            })
            .collect()
    }

    pub fn encoder(&self) -> Vec<EncoderSample> {
        let count = ((self.to_s - self.from_s) * 500.0) as usize;
        let at = |t: f64| EncoderSample { stamp: Stamp(0).plus_seconds(t), angle_rad: self.motor_radps * t };
        let count = if self.motor_radps == 0.0 { return Vec::new() } else { count };
        (0..=count + 10).map(|k| at(self.from_s - 0.01 + k as f64 / 500.0)).collect()
    }

    /// A scan of 0.1 s.
    pub fn scan(&self, start_s: f64) -> RawScan {
        let mut noise = Noise(self.seed.wrapping_mul(104_729).wrapping_add((start_s * 1e3) as u64));
        let mut points = Vec::new();
        let mut scene = Scene { names: Vec::new(), blocks: Vec::new() };
        let is_blind = self.blind_s.0 <= start_s && start_s < self.blind_s.1;
        for column in 0..if is_blind { 0 } else { self.columns } {
            let share = f64::from(column) / f64::from(self.columns);
            let t = start_s + 0.1 * share;
            if column % 30 == 0 {
                let still = self.scene.blocks.iter().map(|b| Block { thing: b.thing, min: b.min, max: b.max });
                scene.blocks = still.chain((self.moving)(t)).collect();
            }
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, self.motor_radps * t);
            let world_from_sensor = (self.motion)(t)
                * self.mount_error
                * imu_mount().body_from_stator
                * Isometry3::from_parts(Translation3::identity(), turn)
                * imu_mount().rotor_from_sensor;
            let azimuth = -std::f64::consts::TAU * share;
            for ring in 0..32_u16 {
                let elevation = (-22.5 + 45.0 * f64::from(ring) / 31.0).to_radians();
                let direction =
                    Vector3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
                let origin = world_from_sensor * Point3::origin();
                let Some((range, _)) = scene.cast(&origin, &(world_from_sensor.rotation * direction)) else {
                    continue;
                };
                let range = range + noise.normal() * self.range_noise_m;
                points.push(RawPoint {
                    position: Point3::from(direction * range).cast(),
                    offset_ns: (share * 1e8) as u32,
                    ring,
                });
            }
        }
        RawScan { start: Stamp(0).plus_seconds(start_s + self.lidar_clock_s), points }
    }

    pub fn scans(&self) -> Vec<RawScan> {
        let count = ((self.to_s - self.from_s) * 10.0).round() as usize;
        (0..count).map(|k| self.scan(self.from_s + 0.1 * k as f64)).collect()
    }

    /// Feeds everything in the order of time; after each scan the report and the estimate at its end.
    pub fn run(&self, odometry: &mut LidarInertialOdometry) -> Vec<(ScanReport, Option<OdometryEstimate>)> {
        self.run_with(odometry, |_| ())
    }

    /// The same with a look at every newest estimate.
    pub fn run_with(
        &self,
        odometry: &mut LidarInertialOdometry,
        mut look: impl FnMut(&OdometryEstimate),
    ) -> Vec<(ScanReport, Option<OdometryEstimate>)> {
        let (imu, encoder) = (self.imu(), self.encoder());
        let (mut next_imu, mut next_encoder) = (0, 0);
        let mut result = Vec::new();
        for scan in self.scans() {
            let end = scan.end();
            while next_encoder < encoder.len() && encoder[next_encoder].stamp <= end.plus_ns(4_000_000) {
                odometry.push_encoder(&encoder[next_encoder]).expect("in order");
                next_encoder += 1;
            }
            while next_imu < imu.len() && (next_imu == 0 || imu[next_imu - 1].stamp < end) {
                odometry.push_imu(&imu[next_imu]).expect("in order");
                look(&odometry.estimate());
                next_imu += 1;
            }
            if !odometry.is_ready_for(&scan) {
                continue;
            }
            let report = odometry.push_scan(&scan).expect("in order");
            result.push((report, odometry.estimate_at_scan()));
        }
        result
    }

    /// Position and rotation errors of estimates against the true motion, after the first of them is laid onto it: the
    /// odometry cannot know where it began.
    pub fn errors(&self, estimates: &[OdometryEstimate]) -> Vec<(f64, f64)> {
        let truth = |e: &OdometryEstimate| {
            (self.motion)(e.stamp.seconds_since(Stamp(0)) - self.lidar_clock_s) * body_from_imu().inverse()
        };
        let Some(first) = estimates.first() else { return Vec::new() };
        let true_from_ours = truth(first) * first.world_from_body.inverse();
        let error = |e: &OdometryEstimate| {
            let ours = true_from_ours * e.world_from_body;
            let truth = truth(e);
            let apart_m = (ours.translation.vector - truth.translation.vector).norm();
            (apart_m, ours.rotation.angle_to(&truth.rotation).to_degrees())
        };
        estimates.iter().map(error).collect()
    }
}

/// The worst of the errors.
pub fn worst(errors: &[(f64, f64)]) -> (f64, f64) {
    errors.iter().fold((0.0, 0.0), |worst, error| (error.0.max(worst.0), error.1.max(worst.1)))
}

/// The LiDAR's mount on the IMU.
pub fn imu_mount() -> RotatingMount {
    RotatingMount {
        body_from_stator: Isometry3::from_parts(
            Translation3::new(0.06, -0.02, 0.11),
            UnitQuaternion::from_euler_angles(-0.05, 0.2, 0.09),
        ),
        rotor_from_sensor: Isometry3::from_parts(
            Translation3::new(0.0, 0.03, 0.05),
            UnitQuaternion::from_euler_angles(0.52, 0.0, 0.0),
        ),
    }
}

/// The IMU in the body.
pub fn body_from_imu() -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(0.1, 0.05, 0.2), UnitQuaternion::from_euler_angles(0.1, -0.05, 0.8))
}

/// The mount as the filter is told it.
pub fn mount() -> RotatingMount {
    RotatingMount { body_from_stator: body_from_imu() * imu_mount().body_from_stator, ..imu_mount() }
}

pub fn odometry(config: LioConfig) -> LidarInertialOdometry {
    LidarInertialOdometry::new(config, mount(), body_from_imu()).expect("sound")
}

/// Zero up to a second, then smoothly to one within one and a half.
pub fn gate(t: f64) -> f64 {
    let x = ((t - 1.0) / 1.5).clamp(0.0, 1.0);
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

/// Stands for a second, then walks on a figure of eight.
pub fn walk(t: f64) -> Isometry3<f64> {
    let g = gate(t);
    let position = Translation3::new(
        -0.5 + g * 0.9 * (0.9 * t).sin(),
        -0.2 + g * 0.6 * (1.3 * t).sin(),
        1.0 + g * 0.03 * (11.0 * t).sin(),
    );
    let rotation = UnitQuaternion::from_euler_angles(
        g * 0.07 * (3.8 * t).sin(),
        g * 0.06 * (5.1 * t).cos(),
        0.4 + g * 0.8 * (0.9 * t).sin(),
    );
    Isometry3::from_parts(position, rotation)
}

/// The same without standing.
pub fn walk_from_the_first(t: f64) -> Isometry3<f64> {
    walk(t + 10.0)
}

/// Stands, then turns to and fro with peaks of a thousand degrees a second.
pub fn whirl(t: f64) -> Isometry3<f64> {
    let g = gate(t);
    let yaw = g * 3.4 * (5.2 * t).sin();
    let position = Translation3::new(-0.5 + g * 0.3 * (1.1 * t).sin(), -0.2 + g * 0.3 * (0.9 * t).sin(), 1.0);
    Isometry3::from_parts(position, UnitQuaternion::from_euler_angles(g * 0.1 * (2.0 * t).sin(), 0.0, yaw))
}

/// Stands, then walks along x at 0.8 m/s.
pub fn stride(t: f64) -> Isometry3<f64> {
    // The integral of the gate.
    let x = ((t - 1.0) / 1.5).clamp(0.0, 1.0);
    let way = 1.5 * x.powi(4) * (2.5 - 3.0 * x + x * x) + (t - 2.5).max(0.0);
    let position = Translation3::new(0.8 * way, 0.1 * gate(t) * (2.0 * t).sin(), 1.2);
    let rotation = UnitQuaternion::from_euler_angles(0.03 * gate(t) * (7.0 * t).sin(), 0.0, 0.2 * gate(t) * t.sin());
    Isometry3::from_parts(position, rotation)
}

/// A corridor of 200 m without anything in it.
pub fn corridor() -> Scene {
    let wall = |min: [f64; 3], max: [f64; 3]| Block { thing: 0, min: min.into(), max: max.into() };
    Scene {
        names: vec!["corridor"],
        blocks: vec![
            wall([-100.0, -1.3, -0.1], [100.0, 1.3, 0.0]),
            wall([-100.0, -1.3, 2.6], [100.0, 1.3, 2.7]),
            wall([-100.0, 1.2, 0.0], [100.0, 1.3, 2.6]),
            wall([-100.0, -1.3, 0.0], [100.0, -1.2, 2.6]),
        ],
    }
}

/// People that walk about: a fifth of all points.
pub fn crowd(t: f64) -> Vec<Block> {
    let person = |x: f64, y: f64| Block {
        thing: 9,
        min: [x - 0.25, y - 0.25, 0.0].into(),
        max: [x + 0.25, y + 0.25, 1.8].into(),
    };
    (0..11)
        .map(|k| {
            let phase = f64::from(k) * 0.57;
            let (x, y) = (2.6 * (0.5 * t + phase).cos(), 2.3 * (0.5 * t + phase).sin());
            person(x, y + 0.3 * (1.3 * t + phase).sin())
        })
        .collect()
}
