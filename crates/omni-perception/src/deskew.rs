//! Motion compensation of a scan: every point is moved to where the body would have seen it at one reference time.
//!
//! ```text
//! p_ref = world_from_body(t_ref)^-1 * world_from_body(t) * body_from_stator * Rz(angle(t)) * rotor_from_sensor * p
//! ```
//! with t the point's own time (OmniVLN Eq. 1, with the trajectory's knots in place of one constant twist and the
//! LiDAR's mount in place of the camera's). The pose of the result is the pose at the reference time.

use nalgebra::{Isometry3, Point3};
use thiserror::Error;

use crate::motion_table::MotionTable;
use crate::{EncoderTrack, RawPoint, RawScan, RotatingMount, Stamp, Trajectory};

/// The time at which the deskewed scan stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReferenceTime {
    /// Start of the scan.
    Start,
    /// Halfway between the start and the latest point.
    Mid,
    /// The latest point.
    #[default]
    End,
    /// Any time inside the trajectory.
    At(Stamp),
}

impl ReferenceTime {
    /// The time meant for a scan from `start` to `end`.
    pub fn stamp(self, start: Stamp, end: Stamp) -> Stamp {
        match self {
            ReferenceTime::Start => start,
            ReferenceTime::Mid => start.plus_ns(end.0.saturating_sub(start.0) / 2),
            ReferenceTime::End => end,
            ReferenceTime::At(stamp) => stamp,
        }
    }
}

/// Which points are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeskewConfig {
    /// Nearer returns are the robot itself or no return at all. Default 0.3 m.
    pub min_range_m: f32,
    /// Farther returns are dropped. Default 100 m.
    pub max_range_m: f32,
}

impl Default for DeskewConfig {
    fn default() -> Self {
        DeskewConfig { min_range_m: 0.3, max_range_m: 100.0 }
    }
}

impl DeskewConfig {
    /// Checks 0 <= min < max.
    ///
    /// # Errors
    /// [`DeskewError::Config`] otherwise.
    pub fn validate(&self) -> Result<(), DeskewError> {
        if self.min_range_m >= 0.0 && self.min_range_m < self.max_range_m {
            return Ok(());
        }
        Err(DeskewError::Config { min_range_m: self.min_range_m, max_range_m: self.max_range_m })
    }
}

/// Why there is no deskewed scan.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum DeskewError {
    /// The range limits are not 0 <= min < max.
    #[error("the range limits {min_range_m} .. {max_range_m} m are not sound")]
    Config {
        /// Low limit.
        min_range_m: f32,
        /// High limit.
        max_range_m: f32,
    },
    /// The trajectory has no pose at the reference time.
    #[error("there is no pose at the reference time {stamp}")]
    NoReferencePose {
        /// The reference time.
        stamp: Stamp,
    },
}

/// How many points were left out, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dropped {
    /// A coordinate was NaN or infinite.
    pub non_finite: usize,
    /// No pose or no encoder angle at the point's time.
    pub outside_time: usize,
    /// Nearer than the limit.
    pub too_near: usize,
    /// Farther than the limit.
    pub too_far: usize,
}

/// A scan as if taken in one instant. The vectors run in parallel, in the order of the raw scan.
#[derive(Debug, Clone, PartialEq)]
pub struct DeskewedScan {
    /// The reference time.
    pub stamp: Stamp,
    /// The body at the reference time.
    pub world_from_body: Isometry3<f64>,
    /// The sensor's origin at the reference time (rays start within centimetres of it).
    pub sensor_origin_in_body: Point3<f64>,
    /// The points.
    pub points_in_body: Vec<Point3<f32>>,
    /// Beam of each point.
    pub rings: Vec<u16>,
    /// Nanoseconds of each point after the start of the raw scan.
    pub offsets_ns: Vec<u32>,
    /// What was left out.
    pub dropped: Dropped,
}

impl DeskewedScan {
    /// The points in the world.
    pub fn points_in_world(&self) -> Vec<Point3<f32>> {
        let matrix = self.world_from_body.rotation.to_rotation_matrix().into_inner().cast::<f32>();
        let offset = self.world_from_body.translation.vector.cast::<f32>();
        self.points_in_body.iter().map(|p| Point3::from(matrix * p.coords + offset)).collect()
    }

    /// The sensor's origin in the world.
    pub fn sensor_origin_in_world(&self) -> Point3<f64> {
        self.world_from_body * self.sensor_origin_in_body
    }
}

/// Deskews a scan. About 15 ns a point.
///
/// Transforms are exact every quarter of a millisecond and blended between (`motion_table`); that is
/// within 0.02 mm of [`deskew_exactly`] for any motion a robot survives.
///
/// # Errors
/// [`DeskewError`] for an unsound configuration or a reference time without a pose. Points without a pose are
/// dropped and counted, never clamped.
pub fn deskew(
    scan: &RawScan,
    encoder: &EncoderTrack,
    mount: &RotatingMount,
    trajectory: &Trajectory,
    reference: ReferenceTime,
    config: &DeskewConfig,
) -> Result<DeskewedScan, DeskewError> {
    let frame = ReferenceFrame::new(scan, encoder, mount, trajectory, reference, config)?;
    let table =
        MotionTable::new(scan.end().seconds_since(scan.start), |offset_ns| frame.reference_from_sensor(offset_ns));
    Ok(collect(scan, config, &frame, |point| table.apply(point.offset_ns, &point.position)))
}

/// The plain form: the full chain of transforms for every point. The fast form is tested against it.
///
/// # Errors
/// As [`deskew`].
pub fn deskew_exactly(
    scan: &RawScan,
    encoder: &EncoderTrack,
    mount: &RotatingMount,
    trajectory: &Trajectory,
    reference: ReferenceTime,
    config: &DeskewConfig,
) -> Result<DeskewedScan, DeskewError> {
    let frame = ReferenceFrame::new(scan, encoder, mount, trajectory, reference, config)?;
    Ok(collect(scan, config, &frame, |point| {
        let reference_from_sensor = frame.reference_from_sensor(point.offset_ns)?;
        Some((reference_from_sensor * point.position.cast::<f64>()).cast::<f32>())
    }))
}

/// Everything that a point's transform needs besides its time.
struct ReferenceFrame<'a> {
    start: Stamp,
    encoder: &'a EncoderTrack,
    mount: &'a RotatingMount,
    trajectory: &'a Trajectory,
    stamp: Stamp,
    world_from_body: Isometry3<f64>,
    body_from_world: Isometry3<f64>,
}

impl<'a> ReferenceFrame<'a> {
    fn new(
        scan: &RawScan,
        encoder: &'a EncoderTrack,
        mount: &'a RotatingMount,
        trajectory: &'a Trajectory,
        reference: ReferenceTime,
        config: &DeskewConfig,
    ) -> Result<ReferenceFrame<'a>, DeskewError> {
        config.validate()?;
        let (start, stamp) = (scan.start, reference.stamp(scan.start, scan.end()));
        let world_from_body = trajectory.world_from_body(stamp).ok_or(DeskewError::NoReferencePose { stamp })?;
        let body_from_world = world_from_body.inverse();
        Ok(ReferenceFrame { start, encoder, mount, trajectory, stamp, world_from_body, body_from_world })
    }

    fn reference_from_sensor(&self, offset_ns: u32) -> Option<Isometry3<f64>> {
        let stamp = self.start.plus_ns(i64::from(offset_ns));
        let body_from_sensor = self.mount.body_from_sensor(self.encoder.angle_rad(stamp)?);
        // OmniVLN Eq. 1
        Some(self.body_from_world * self.trajectory.world_from_body(stamp)? * body_from_sensor)
    }
}

fn collect(
    scan: &RawScan,
    config: &DeskewConfig,
    frame: &ReferenceFrame,
    to_reference: impl Fn(&RawPoint) -> Option<Point3<f32>>,
) -> DeskewedScan {
    let angle_rad = frame.encoder.angle_rad(frame.stamp).unwrap_or(0.0);
    let mut result = DeskewedScan {
        stamp: frame.stamp,
        world_from_body: frame.world_from_body,
        sensor_origin_in_body: frame.mount.body_from_sensor(angle_rad) * Point3::origin(),
        points_in_body: Vec::with_capacity(scan.points.len()),
        rings: Vec::with_capacity(scan.points.len()),
        offsets_ns: Vec::with_capacity(scan.points.len()),
        dropped: Dropped::default(),
    };
    for point in &scan.points {
        let range_m = point.position.coords.norm();
        if !range_m.is_finite() {
            result.dropped.non_finite += 1;
        } else if range_m < config.min_range_m {
            result.dropped.too_near += 1;
        } else if range_m > config.max_range_m {
            result.dropped.too_far += 1;
        } else if let Some(point_in_body) = to_reference(point) {
            result.points_in_body.push(point_in_body);
            result.rings.push(point.ring);
            result.offsets_ns.push(point.offset_ns);
        } else {
            result.dropped.outside_time += 1;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EncoderSample, OdometryEstimate};
    use nalgebra::Vector3;
    use std::f64::consts::PI;

    fn point(x: f32, y: f32, offset_ns: u32) -> RawPoint {
        RawPoint { position: Point3::new(x, y, 0.0), offset_ns, ring: 7 }
    }

    fn mount() -> RotatingMount {
        RotatingMount { body_from_stator: Isometry3::identity(), rotor_from_sensor: Isometry3::identity() }
    }

    /// Driving at 2 m/s towards a wall 5 m ahead at the start of the scan.
    fn drive() -> Trajectory {
        let start = OdometryEstimate {
            velocity_in_world_mps: Vector3::new(2.0, 0.0, 0.0),
            ..OdometryEstimate::at_rest(Stamp(0), Isometry3::identity())
        };
        Trajectory::from_constant_twist(&start, 0.1).expect("valid")
    }

    #[test]
    fn eq_1_a_wall_stays_a_wall() {
        let points = vec![point(5.0, 0.0, 0), point(4.9, 0.0, 50_000_000), point(4.8, 0.0, 100_000_000)];
        let scan = RawScan { start: Stamp(0), points };
        for (reference, x) in [(ReferenceTime::Start, 5.0), (ReferenceTime::Mid, 4.9), (ReferenceTime::End, 4.8)] {
            let result = deskew(&scan, &EncoderTrack::fixed(), &mount(), &drive(), reference, &DeskewConfig::default());
            let result = result.expect("pose is known");
            assert!(result.points_in_body.iter().all(|p| (p.x - x).abs() < 1e-5));
            assert!(result.points_in_world().iter().all(|p| (p.x - 5.0).abs() < 1e-5));
            assert_eq!(result.rings, [7; 3]);
        }
    }

    #[test]
    fn the_motor_turns_while_the_body_stands() {
        // Half a turn in the scan: the same wall point is seen at two rotor angles.
        let track = [(0, 0.0), (60_000_000, 0.6 * PI), (100_000_000, PI)];
        let track = track.map(|(ns, angle_rad)| EncoderSample { stamp: Stamp(ns), angle_rad });
        let track = EncoderTrack::from_samples(&track).expect("valid");
        let still = OdometryEstimate::at_rest(Stamp(0), Isometry3::identity());
        let still = Trajectory::from_constant_twist(&still, 0.1).expect("valid");
        let scan = RawScan { start: Stamp(0), points: vec![point(3.0, 0.0, 0), point(0.0, -3.0, 50_000_000)] };
        let result = deskew(&scan, &track, &mount(), &still, ReferenceTime::Start, &DeskewConfig::default());
        for p in &result.expect("pose is known").points_in_body {
            assert!((p - Point3::new(3.0, 0.0, 0.0)).norm() < 1e-5, "{p}");
        }
    }

    #[test]
    fn what_is_left_out_is_counted() {
        let points = vec![
            point(f32::NAN, 0.0, 0),
            point(0.0, 0.0, 0),
            point(500.0, 0.0, 0),
            point(5.0, 0.0, 100_000_001),
            point(5.0, 0.0, 99_999_999),
        ];
        let scan = RawScan { start: Stamp(0), points };
        let run = |reference, config: DeskewConfig| {
            deskew(&scan, &EncoderTrack::fixed(), &mount(), &drive(), reference, &config)
        };
        let result = run(ReferenceTime::Start, DeskewConfig::default()).expect("pose is known");
        assert_eq!(result.dropped, Dropped { non_finite: 1, outside_time: 1, too_near: 1, too_far: 1 });
        assert_eq!(result.points_in_body.len(), 1);
        let late = run(ReferenceTime::End, DeskewConfig::default());
        assert!(matches!(late, Err(DeskewError::NoReferencePose { .. })));
        let bad = DeskewConfig { min_range_m: f32::NAN, ..DeskewConfig::default() };
        assert!(matches!(run(ReferenceTime::Start, bad), Err(DeskewError::Config { .. })));
    }
}
