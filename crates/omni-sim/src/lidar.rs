//! A spinning LiDAR, on a rotating mount or fixed: every column of rays is cast at its own time, from where the sensor is
//! at that time.
//!
//! The sensor turns about its own z axis once a scan (columns), the mount's motor turns the sensor about the z axis of the
//! stator ([`RotatingMount`]): `p_body = body_from_stator * Rz(angle(t)) * rotor_from_sensor * p_sensor`.

use crate::bvh::RayStack;
use crate::mesh::InstanceId;
use crate::motion::Motion;
use crate::noise::NoiseKey;
use crate::world::World;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::f64::consts::TAU;
use thiserror::Error;

/// Numbers of the sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct LidarConfig {
    /// Rays in a column (32).
    pub beams: u16,
    /// Columns in a scan (1024).
    pub columns: u32,
    /// Scans a second (10).
    pub rate_hz: f64,
    /// Angle between the lowest and the highest beam, half of it below the sensor's equator (45 degrees).
    pub vertical_fov_rad: f64,
    /// Nearer surfaces give no point (0.15).
    pub min_range_m: f64,
    /// Farther surfaces give no point (30).
    pub max_range_m: f64,
    /// Standard deviation of the range (0.015).
    pub range_noise_m: f64,
    /// Share of rays that are lost for no reason (0.003).
    pub dropout: f64,
    /// Angle of incidence from the surface's normal beyond which rays begin to get lost; at 90 degrees all are
    /// (80 degrees).
    pub grazing_rad: f64,
    /// Seed of noise and dropouts.
    pub seed: u64,
}

impl Default for LidarConfig {
    fn default() -> Self {
        LidarConfig {
            beams: 32,
            columns: 1024,
            rate_hz: 10.0,
            vertical_fov_rad: 45_f64.to_radians(),
            min_range_m: 0.15,
            max_range_m: 30.0,
            range_noise_m: 0.015,
            dropout: 0.003,
            grazing_rad: 80_f64.to_radians(),
            seed: 0,
        }
    }
}

impl LidarConfig {
    /// Checks every number.
    pub fn validate(&self) -> Result<(), LidarError> {
        let ranges = self.min_range_m >= 0.0 && self.max_range_m > self.min_range_m && self.max_range_m.is_finite();
        let good = self.beams >= 1
            && self.columns >= 1
            && self.columns <= 65_536
            && self.rate_hz > 0.0
            && self.rate_hz <= 1000.0
            && (0.0..=std::f64::consts::PI).contains(&self.vertical_fov_rad)
            && ranges
            && (0.0..1.0).contains(&self.range_noise_m)
            && (0.0..=1.0).contains(&self.dropout)
            && (0.0..=std::f64::consts::FRAC_PI_2).contains(&self.grazing_rad);
        if good { Ok(()) } else { Err(LidarError::Config) }
    }

    /// Time of a whole scan.
    pub fn period_ns(&self) -> i64 {
        (1e9 / self.rate_hz).round() as i64
    }
}

/// Why there is no scan.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LidarError {
    /// A number of the configuration is out of its range.
    #[error("a number of the LiDAR's configuration is out of range")]
    Config,
    /// The motion is not known for the whole scan.
    #[error("the motion is known from {from_ns} to {to_ns} ns, the scan starts at {start_ns} ns")]
    MotionUnknown {
        /// First known stamp.
        from_ns: i64,
        /// Last known stamp.
        to_ns: i64,
        /// Start of the scan.
        start_ns: i64,
    },
    /// The motion returned NaN or infinity.
    #[error("the motion is not finite during the scan")]
    NotFinite,
}

/// Where the sensor sits and how its motor turns it.
#[derive(Debug, Clone, PartialEq)]
pub struct RotatingMount {
    /// The motor's stator in the body; its z is the motor's axis.
    pub body_from_stator: Isometry3<f64>,
    /// The sensor on the motor's rotor; its z is the axis the beams spin about.
    pub rotor_from_sensor: Isometry3<f64>,
    /// Turns of the motor a second (0.5); 0 for a fixed sensor.
    pub rate_hz: f64,
    /// Angle at stamp 0.
    pub phase_rad: f64,
}

impl RotatingMount {
    /// Motor of 0.5 rev/s about the vertical through `body_from_stator`, spin axis tilted by 30 degrees.
    pub fn rotating(body_from_stator: Isometry3<f64>) -> Self {
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 30_f64.to_radians());
        RotatingMount {
            body_from_stator,
            rotor_from_sensor: Isometry3::from_parts(Translation3::identity(), tilt),
            rate_hz: 0.5,
            phase_rad: 0.0,
        }
    }

    /// The same sensor standing upright and still.
    pub fn fixed(body_from_sensor: Isometry3<f64>) -> Self {
        RotatingMount {
            body_from_stator: body_from_sensor,
            rotor_from_sensor: Isometry3::identity(),
            rate_hz: 0.0,
            phase_rad: 0.0,
        }
    }

    /// Angle of the motor at a time, in `[0, 2 pi)`.
    pub fn angle_rad(&self, stamp_ns: i64) -> f64 {
        // Whole seconds and the rest apart: stamps since 1970 keep their nanoseconds.
        let seconds = stamp_ns.div_euclid(1_000_000_000) as f64;
        let rest = stamp_ns.rem_euclid(1_000_000_000) as f64 * 1e-9;
        let turns = (seconds * self.rate_hz).fract() + rest * self.rate_hz;
        (turns * TAU + self.phase_rad).rem_euclid(TAU)
    }

    /// Pose of the sensor in the body at a time.
    pub fn body_from_sensor(&self, stamp_ns: i64) -> Isometry3<f64> {
        let angle = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.angle_rad(stamp_ns));
        self.body_from_stator * angle * self.rotor_from_sensor
    }
}

/// A measured point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LidarPoint {
    /// In the sensor frame at the point's own time.
    pub position: Point3<f32>,
    /// Time after the scan's start.
    pub offset_ns: u32,
    /// Beam, 0 is the lowest.
    pub ring: u16,
}

/// One turn of the sensor; lost rays have no point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LidarScanRecord {
    /// Time of the first column.
    pub start_ns: i64,
    /// Points by time, then by ring.
    pub points: Vec<LidarPoint>,
}

/// Casts one scan that starts at `start_ns` and lasts `config.period_ns()`.
///
/// The same arguments give the same points at any number of threads.
pub fn scan(
    world: &World,
    motion: &dyn Motion,
    mount: &RotatingMount,
    config: &LidarConfig,
    start_ns: i64,
) -> Result<LidarScanRecord, LidarError> {
    scan_with_truth(world, motion, mount, config, start_ns).map(|(record, _)| record)
}

/// Points and the instance of each.
type PointsWithTruth = (Vec<LidarPoint>, Vec<InstanceId>);

/// The same scan, and beside it the instance that each of its points lies on: for a referee.
pub fn scan_with_truth(
    world: &World,
    motion: &dyn Motion,
    mount: &RotatingMount,
    config: &LidarConfig,
    start_ns: i64,
) -> Result<(LidarScanRecord, Vec<InstanceId>), LidarError> {
    config.validate()?;
    let (from_ns, to_ns) = motion.span_ns();
    if start_ns < from_ns || column_stamp(config, start_ns, config.columns - 1) > to_ns {
        return Err(LidarError::MotionUnknown { from_ns, to_ns, start_ns });
    }
    let directions = beam_directions(config);
    let columns: Vec<u32> = (0..config.columns).collect();
    // 64 columns a task: enough work to pay for a thread's attention.
    let parts: Result<Vec<PointsWithTruth>, LidarError> = columns
        .par_chunks(64)
        .map(|chunk| {
            let mut points = Vec::with_capacity(chunk.len() * directions.len());
            let mut instances = Vec::with_capacity(chunk.len() * directions.len());
            let mut stack = RayStack::default();
            for &column in chunk {
                let stamp_ns = column_stamp(config, start_ns, column);
                let state = motion.at(stamp_ns);
                if !state.is_finite() {
                    return Err(LidarError::NotFinite);
                }
                let world_from_sensor = state.world_from_body * mount.body_from_sensor(stamp_ns);
                let caster = Column {
                    world,
                    config,
                    world_from_sensor: &world_from_sensor.cast(),
                    stamp_ns,
                    offset_ns: (stamp_ns - start_ns) as u32,
                    azimuth: TAU * f64::from(column) / f64::from(config.columns),
                };
                caster.cast(&directions, &mut stack, &mut points, &mut instances);
            }
            Ok((points, instances))
        })
        .collect();
    let (points, instances): (Vec<_>, Vec<_>) = parts?.into_iter().unzip();
    Ok((LidarScanRecord { start_ns, points: points.concat() }, instances.concat()))
}

/// Time at which a column is measured.
fn column_stamp(config: &LidarConfig, start_ns: i64, column: u32) -> i64 {
    start_ns + i64::from(column) * config.period_ns() / i64::from(config.columns)
}

/// Sine and cosine of each beam's elevation, lowest first.
fn beam_directions(config: &LidarConfig) -> Vec<(f32, f32)> {
    (0..config.beams)
        .map(|ring| {
            let share = match config.beams {
                1 => 0.5,
                n => f64::from(ring) / f64::from(n - 1),
            };
            let (sin, cos) = ((share - 0.5) * config.vertical_fov_rad).sin_cos();
            (sin as f32, cos as f32)
        })
        .collect()
}

struct Column<'a> {
    world: &'a World,
    config: &'a LidarConfig,
    world_from_sensor: &'a Isometry3<f32>,
    stamp_ns: i64,
    offset_ns: u32,
    azimuth: f64,
}

impl Column<'_> {
    fn cast(
        &self,
        beams: &[(f32, f32)],
        stack: &mut RayStack,
        points: &mut Vec<LidarPoint>,
        instances: &mut Vec<InstanceId>,
    ) {
        let snapshot = self.world.at(self.stamp_ns);
        let rotation = self.world_from_sensor.rotation.to_rotation_matrix();
        let origin = Point3::from(self.world_from_sensor.translation.vector);
        let (sin, cos) = (self.azimuth.sin() as f32, self.azimuth.cos() as f32);
        let cos_grazing = self.config.grazing_rad.cos() as f32;
        let max_range = self.config.max_range_m as f32;
        // A stamp is one column of one scan, so it is the address of the column's noise.
        let noise = NoiseKey::new(self.config.seed).with(self.stamp_ns as u64);
        for (ring, &(up, flat)) in beams.iter().enumerate() {
            let in_sensor = Vector3::new(flat * cos, flat * sin, up);
            let direction = rotation * in_sensor;
            let Some((range, surface)) = snapshot.cast(&origin, &direction, max_range, stack) else {
                continue;
            };
            let key = noise.with(ring as u64);
            let cos_incidence = snapshot.normal(surface).dot(&direction).abs();
            let grazing = (1.0 - cos_incidence / cos_grazing).max(0.0);
            if key.uniform() < self.config.dropout + f64::from(grazing * grazing) {
                continue;
            }
            let range = f64::from(range) + self.config.range_noise_m * key.with(2).normal();
            if range < self.config.min_range_m || range > self.config.max_range_m {
                continue;
            }
            points.push(LidarPoint {
                position: Point3::from(in_sensor * range as f32),
                offset_ns: self.offset_ns,
                ring: ring as u16,
            });
            instances.push(self.world.instance_of(surface));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_turn_a_second_is_half_a_turn_after_one_second() {
        let mount = RotatingMount::rotating(Isometry3::identity());
        assert!((mount.angle_rad(1_000_000_000) - std::f64::consts::PI).abs() < 1e-12);
        assert!(mount.angle_rad(2_000_000_000).abs() < 1e-12);
        assert!((mount.angle_rad(-500_000_000) - 1.5 * std::f64::consts::PI).abs() < 1e-12);
        let since_1970 = 1_700_000_000_250_000_000;
        assert!((mount.angle_rad(since_1970) - TAU / 8.0).abs() < 1e-9);
    }

    #[test]
    fn tilted_spin_axis_goes_round_the_vertical() {
        let mount = RotatingMount::rotating(Isometry3::translation(0.0, 0.0, 0.3));
        let axis = |ns| mount.body_from_sensor(ns) * Vector3::z();
        assert!((axis(0) - Vector3::new(0.5, 0.0, 0.75_f64.sqrt())).norm() < 1e-12);
        assert!((axis(1_000_000_000) - Vector3::new(-0.5, 0.0, 0.75_f64.sqrt())).norm() < 1e-12);
    }

    #[test]
    fn bad_numbers_are_refused() {
        for config in [
            LidarConfig { beams: 0, ..LidarConfig::default() },
            LidarConfig { rate_hz: f64::NAN, ..LidarConfig::default() },
            LidarConfig { max_range_m: 0.0, ..LidarConfig::default() },
        ] {
            assert_eq!(config.validate(), Err(LidarError::Config));
        }
    }
}
