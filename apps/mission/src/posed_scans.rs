//! The scans of a recording, straightened on a way that is already known.

use nalgebra::Isometry3;
use omni_perception::{
    DeskewConfig, DeskewedScan, EncoderError, EncoderTrack, ReferenceTime, RotatingMount, Stamp, Trajectory,
    TrajectoryError, deskew,
};

use crate::recording::{RecordedRig, RecordingError};
use crate::scan_queue::ScanQueue;
use crate::stream::SensorEvent;
use crate::tum::trajectory;

/// Straightens one scan after the other; each waits until the motor's angle has passed its end, but not for ever: where the encoder is
/// silent, its points are dropped, and the scan says how many.
pub struct PosedScans<I> {
    events: I,
    mount: RotatingMount,
    encoder: EncoderTrack,
    is_rotating: bool,
    trajectory: Trajectory,
    queue: ScanQueue,
    is_over: bool,
}

/// Why there is no scan at a place of the stream.
#[derive(Debug, thiserror::Error)]
pub enum PosedScanError {
    /// The way has no pose around the scan, or one with a gap of more than a quarter of a second.
    #[error("the scan at {0}: the trajectory has no poses around it")]
    NoPose(Stamp),
    /// An angle of the motor could not be used.
    #[error(transparent)]
    Encoder(#[from] EncoderError),
    /// An event could not be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

impl<I: Iterator<Item = Result<SensorEvent, RecordingError>>> PosedScans<I> {
    /// `imu_poses` are those of the IMU in the world, as trajectories have them, in the order of time. An angle stamped t was true at
    /// `t - encoder_latency_s`.
    ///
    /// # Errors
    /// [`TrajectoryError`] if the poses are not finite or not in order.
    pub fn new(
        events: I,
        rig: &RecordedRig,
        encoder_latency_s: f64,
        imu_poses: &[(Stamp, Isometry3<f64>)],
    ) -> Result<Self, TrajectoryError> {
        let imu_from_body = rig.body_from_imu.inverse();
        let body_poses: Vec<_> = imu_poses.iter().map(|(stamp, pose)| (*stamp, pose * imu_from_body)).collect();
        Ok(PosedScans {
            events,
            mount: rig.mount,
            encoder: if rig.is_rotating { EncoderTrack::rotating(encoder_latency_s) } else { EncoderTrack::fixed() },
            is_rotating: rig.is_rotating,
            trajectory: trajectory(&body_poses)?,
            queue: ScanQueue::default(),
            is_over: false,
        })
    }
}

impl<I: Iterator<Item = Result<SensorEvent, RecordingError>>> Iterator for PosedScans<I> {
    type Item = Result<DeskewedScan, PosedScanError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            // Due when nothing more will be said about its time.
            let known_until = self.encoder.last();
            let is_known = !self.is_rotating || self.is_over;
            let due = self.queue.next_if(|scan| is_known || known_until.is_some_and(|last| last >= scan.end()));
            if let Some(scan) = due {
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
                Some(Ok(SensorEvent::Scan(scan))) => self.queue.push(scan),
                Some(Ok(SensorEvent::Encoder(sample))) => {
                    if let Err(error) = self.encoder.push(sample) {
                        return Some(Err(error.into()));
                    }
                }
                Some(Ok(_)) => {}
                Some(Err(error)) => return Some(Err(error.into())),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_events::encoder;
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use omni_perception::{RawPoint, RawScan};

    /// A point straight ahead of the sensor, all through the scan.
    fn scan(ms: i64) -> SensorEvent {
        let points =
            (0..100).map(|k| RawPoint { position: Point3::new(2.0, 0.0, 0.0), offset_ns: k * 990_000, ring: 0 });
        SensorEvent::Scan(RawScan { start: Stamp(ms * 1_000_000), points: points.collect() })
    }

    fn angle(ms: i64) -> SensorEvent {
        encoder(ms, 1e-3 * ms as f64)
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
        let scans: Vec<_> = PosedScans::new(events.into_iter().map(Ok), &rig, 0.0, &poses).expect("sound").collect();
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

    #[test]
    fn a_silent_encoder_costs_points_and_not_memory_and_is_told() {
        let still: Vec<_> = (0..=60).map(|k| (Stamp(k * 100_000_000), Isometry3::identity())).collect();
        // The angle is told for one second, once with a step back; then never again.
        let mut events: Vec<_> = (0..1000).step_by(10).map(angle).chain([angle(5)]).collect();
        events.extend((1..50).map(|k| scan(100 * k)));
        let identity = Isometry3::identity();
        let mount = RotatingMount { body_from_stator: identity, rotor_from_sensor: identity };
        let rig = RecordedRig { mount, is_rotating: true, body_from_imu: identity };
        let mut scans = PosedScans::new(events.into_iter().map(Ok), &rig, 0.0, &still).expect("sound");
        let (mut whole, mut without_points, mut encoder_faults) = (0, 0, 0);
        while let Some(item) = scans.next() {
            assert!(scans.queue.len() <= 11, "{} scans wait", scans.queue.len());
            match item {
                Ok(scan) if scan.dropped.outside_time == 0 => whole += 1,
                Ok(scan) => without_points += usize::from(scan.points_in_body.is_empty()),
                Err(PosedScanError::Encoder(_)) => encoder_faults += 1,
                Err(error) => panic!("{error}"),
            }
        }
        // Scans of 0.1 to 0.9 s, the last of which ends 8 ms after the last angle.
        assert_eq!((whole, encoder_faults), (8, 1));
        assert!(without_points >= 39, "{without_points}");
    }
}
