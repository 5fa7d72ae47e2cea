//! The scans of a recording, straightened on a way that is already known.

use std::collections::VecDeque;

use nalgebra::Isometry3;
use omni_perception::{
    DeskewConfig, DeskewedScan, EncoderTrack, RawScan, ReferenceTime, RotatingMount, Stamp, Trajectory, deskew,
};

use crate::recording::{RecordedRig, RecordingError};
use crate::stream::SensorEvent;
use crate::tum::trajectory;

/// Straightens one scan after the other; each waits until the motor's angle has passed its end.
pub struct PosedScans<I> {
    events: I,
    mount: RotatingMount,
    encoder: EncoderTrack,
    is_rotating: bool,
    trajectory: Trajectory,
    waiting: VecDeque<RawScan>,
    is_over: bool,
}

/// Why there is no scan at a place of the stream.
#[derive(Debug, thiserror::Error)]
pub enum PosedScanError {
    /// The way has no pose around the scan, or one with a gap of more than a quarter of a second.
    #[error("the scan at {0}: the trajectory has no poses around it")]
    NoPose(Stamp),
    /// An event could not be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

impl<I: Iterator<Item = Result<SensorEvent, RecordingError>>> PosedScans<I> {
    /// `imu_poses` are those of the IMU in the world, as trajectories have them, in the order of time.
    pub fn new(events: I, rig: &RecordedRig, encoder_latency_s: f64, imu_poses: &[(Stamp, Isometry3<f64>)]) -> Self {
        let imu_from_body = rig.body_from_imu.inverse();
        let body_poses: Vec<_> = imu_poses.iter().map(|(stamp, pose)| (*stamp, pose * imu_from_body)).collect();
        PosedScans {
            events,
            mount: rig.mount,
            encoder: if rig.is_rotating { EncoderTrack::rotating(encoder_latency_s) } else { EncoderTrack::fixed() },
            is_rotating: rig.is_rotating,
            trajectory: trajectory(&body_poses),
            waiting: VecDeque::new(),
            is_over: false,
        }
    }

    /// The oldest scan that waits, if nothing more will be said about its time.
    fn due(&mut self) -> Option<RawScan> {
        let first = self.waiting.front()?;
        let has_passed = !self.is_rotating || self.encoder.last().is_some_and(|last| last >= first.end());
        if self.is_over || has_passed { self.waiting.pop_front() } else { None }
    }
}

impl<I: Iterator<Item = Result<SensorEvent, RecordingError>>> Iterator for PosedScans<I> {
    type Item = Result<DeskewedScan, PosedScanError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(scan) = self.due() {
                let config = DeskewConfig::default();
                let straight = deskew(&scan, &self.encoder, &self.mount, &self.trajectory, ReferenceTime::End, &config);
                self.encoder.forget_before(scan.start.plus_ns(-1_000_000_000));
                return Some(straight.map_err(|_| PosedScanError::NoPose(scan.start)));
            }
            if self.is_over {
                return None;
            }
            match self.events.next() {
                None => self.is_over = true,
                Some(Ok(SensorEvent::Scan(scan))) => self.waiting.push_back(scan),
                // An angle that is out of order leaves a gap, and the scan there its points.
                Some(Ok(SensorEvent::Encoder(sample))) => drop(self.encoder.push(sample)),
                Some(Ok(_)) => {}
                Some(Err(error)) => return Some(Err(error.into())),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use omni_perception::{EncoderSample, RawPoint};

    /// A point straight ahead of the sensor, all through the scan.
    fn scan(ms: i64) -> SensorEvent {
        let points =
            (0..100).map(|k| RawPoint { position: Point3::new(2.0, 0.0, 0.0), offset_ns: k * 990_000, ring: 0 });
        SensorEvent::Scan(RawScan { start: Stamp(ms * 1_000_000), points: points.collect() })
    }

    fn angle(ms: i64) -> SensorEvent {
        SensorEvent::Encoder(EncoderSample { stamp: Stamp(ms * 1_000_000), angle_rad: 1e-3 * ms as f64 })
    }

    #[test]
    fn scans_are_put_where_the_imu_was_and_those_off_the_way_are_told() {
        // The motor turns at 1 rad/s, the body the other way: so the sensor looks along x for ever. The IMU is turned in the
        // body, and the body moves along y at 1 m/s from 0.2 s on to 1 s.
        let body_from_imu = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.4, 0.5, 0.6));
        let world_from_body = |t: f64| {
            Isometry3::from_parts(Vector3::new(0.0, t, 0.0).into(), UnitQuaternion::from_scaled_axis(-Vector3::z() * t))
        };
        let poses: Vec<_> = (200..=1000)
            .step_by(50)
            .map(|ms| (Stamp(ms * 1_000_000), world_from_body(1e-3 * ms as f64) * body_from_imu))
            .collect();
        let mut events: Vec<_> = (0..1300).step_by(10).map(angle).collect();
        events.extend((0..1200).step_by(100).map(scan));
        events.sort_by_key(SensorEvent::stamp);
        let identity = Isometry3::identity();
        let mount = RotatingMount { body_from_stator: identity, rotor_from_sensor: identity };
        let rig = RecordedRig { mount, is_rotating: true, body_from_imu };
        let scans: Vec<_> = PosedScans::new(events.into_iter().map(Ok), &rig, 0.0, &poses).collect();
        assert_eq!(scans.len(), 12);
        let mut lost = Vec::new();
        for (index, scan) in scans.into_iter().enumerate() {
            match scan {
                Ok(scan) => {
                    for (point, offset_ns) in scan.points_in_world().iter().zip(&scan.offsets_ns) {
                        let t = 0.1 * index as f64 + f64::from(*offset_ns) * 1e-9;
                        let off = point.cast::<f64>() - Point3::new(2.0, t, 0.0);
                        assert!(off.norm() < 1e-3, "{t}: {point}");
                    }
                }
                Err(PosedScanError::NoPose(stamp)) => lost.push(stamp.0 / 100_000_000),
                Err(error) => panic!("{error}"),
            }
        }
        assert_eq!(lost, [0, 1, 10, 11]);
    }
}
