//! Everything that a mission perceived, bit for bit and step by step, so that it can be run again to the same decisions.
//!
//! A bag of ROS 2 is for other programs; it sorts by time and composes transforms, and the last bits go. This file is for ourselves:
//! little-endian, records one after the other, each with a tag. What was perceived before a cycle comes before the record of that cycle.
//! Pictures are PNG, so that
//! no pixel is lost: the colours of things come from them.
//!
//! ```text
//! "omnivln events 1\n"
//! 0 cycle      now i64
//! 1 imu        stamp i64, angular velocity 3 f64, specific force 3 f64
//! 2 encoder    stamp i64, angle f64
//! 3 odometry   stamp i64, position 3 f64, quaternion xyzw 4 f64, velocity 3 f64, angular velocity 3 f64, covariance 36 f64, status u8
//! 4 scan       start i64, count u32, points: x y z f32, offset u32 ns, ring u16
//! 5 panorama   stamp i64, count u32, masks: width u32, height u32, runs u32, runs u32 each, score f32, track u8 and u64, label, caption;
//!              bytes of a PNG u32, 0 for no picture, and the PNG
//! 6 battery    stamp i64, charge f64
//! ```
//! Texts are a length u32 and UTF-8.

use std::io::{self, Write};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use omni_perception::{Stamp, TrackingStatus};
use thiserror::Error;

pub use self::reader::{EventLogReader, LoggedCycle};
use crate::stream::SensorEvent;

mod reader;

const MAGIC: &[u8] = b"omnivln events 1\n";
/// More of anything in one record is no record of a robot.
const MOST: u32 = 20_000_000;
/// Widest and highest picture.
const WIDEST_PX: u32 = 16_384;
/// Longest text.
const LONGEST_TEXT: u32 = 65_536;

/// Why a log cannot be read.
#[derive(Debug, Error)]
pub enum EventLogError {
    /// The file cannot be read.
    #[error("the log cannot be read")]
    Io(#[from] io::Error),
    /// Something else.
    #[error("it is no log of events: it does not begin with \"omnivln events 1\"")]
    Magic,
    /// It ends in the middle of a record.
    #[error("it ends in the middle of a record, after {cycles} cycles")]
    Truncated {
        /// Whole cycles before.
        cycles: u64,
    },
    /// A record that nobody writes.
    #[error("after {cycles} cycles: {what}")]
    Record {
        /// Whole cycles before.
        cycles: u64,
        /// What is wrong with it.
        what: &'static str,
    },
}

/// Writes a log.
pub struct EventLogWriter<W> {
    out: W,
    record: Vec<u8>,
}

impl<W: Write> EventLogWriter<W> {
    /// Begins.
    ///
    /// # Errors
    /// Of the writer.
    pub fn new(mut out: W) -> io::Result<EventLogWriter<W>> {
        out.write_all(MAGIC)?;
        Ok(EventLogWriter { out, record: Vec::new() })
    }

    /// What is perceived before the next cycle.
    ///
    /// # Errors
    /// Of the writer.
    pub fn event(&mut self, event: &SensorEvent) -> io::Result<()> {
        self.record.clear();
        let out = &mut self.record;
        match event {
            SensorEvent::Imu(sample) => {
                out.push(1);
                put_i64(out, sample.stamp.0);
                sample.angular_velocity_radps.iter().for_each(|x| put_f64(out, *x));
                sample.specific_force_mps2.iter().for_each(|x| put_f64(out, *x));
            }
            SensorEvent::Encoder(sample) => {
                out.push(2);
                put_i64(out, sample.stamp.0);
                put_f64(out, sample.angle_rad);
            }
            SensorEvent::Odometry(estimate) => {
                out.push(3);
                put_i64(out, estimate.stamp.0);
                estimate.world_from_body.translation.vector.iter().for_each(|x| put_f64(out, *x));
                estimate.world_from_body.rotation.coords.iter().for_each(|x| put_f64(out, *x));
                estimate.velocity_in_world_mps.iter().for_each(|x| put_f64(out, *x));
                estimate.angular_velocity_in_body_radps.iter().for_each(|x| put_f64(out, *x));
                estimate.covariance.iter().for_each(|x| put_f64(out, *x));
                out.push(match estimate.status {
                    TrackingStatus::Initialising => 0,
                    TrackingStatus::Tracking => 1,
                    TrackingStatus::Degenerate => 2,
                    TrackingStatus::Lost => 3,
                });
            }
            SensorEvent::Scan(scan) => {
                out.push(4);
                put_i64(out, scan.start.0);
                put_u32(out, scan.points.len() as u32);
                for point in &scan.points {
                    point.position.iter().for_each(|x| out.extend(x.to_le_bytes()));
                    put_u32(out, point.offset_ns);
                    out.extend(point.ring.to_le_bytes());
                }
            }
            SensorEvent::Panorama(panorama) => {
                out.push(5);
                put_i64(out, panorama.stamp.0);
                put_u32(out, panorama.masks.len() as u32);
                for mask in &panorama.masks {
                    put_u32(out, mask.rle.width());
                    put_u32(out, mask.rle.height());
                    let runs = mask.rle.counts();
                    put_u32(out, runs.len() as u32);
                    runs.iter().for_each(|run| put_u32(out, *run));
                    out.extend(mask.score.to_le_bytes());
                    out.push(u8::from(mask.track.is_some()));
                    out.extend(mask.track.unwrap_or(0).to_le_bytes());
                    put_text(out, &mask.label);
                    put_text(out, &mask.caption);
                }
                let at = out.len();
                put_u32(out, 0);
                if let Some(image) = &panorama.image {
                    PngEncoder::new_with_quality(&mut *out, CompressionType::Fast, FilterType::Adaptive)
                        .write_image(&image.rgb, image.width, image.height, ExtendedColorType::Rgb8)
                        .map_err(io::Error::other)?;
                    let bytes = (out.len() - at - 4) as u32;
                    out[at..at + 4].copy_from_slice(&bytes.to_le_bytes());
                }
            }
            SensorEvent::Battery(battery) => {
                out.push(6);
                put_i64(out, battery.stamp.0);
                put_f64(out, battery.charge);
            }
        }
        self.out.write_all(&self.record)
    }

    /// The cycle at `now`.
    ///
    /// # Errors
    /// Of the writer.
    pub fn cycle(&mut self, now: Stamp) -> io::Result<()> {
        self.out.write_all(&[0])?;
        self.out.write_all(&now.0.to_le_bytes())
    }

    /// The end.
    ///
    /// # Errors
    /// Of the writer.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn put_i64(out: &mut Vec<u8>, value: i64) {
    out.extend(value.to_le_bytes());
}

fn put_u32(out: &mut Vec<u8>, value: u32) {
    out.extend(value.to_le_bytes());
}

fn put_f64(out: &mut Vec<u8>, value: f64) {
    out.extend(value.to_le_bytes());
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    let mut end = text.len().min(LONGEST_TEXT as usize);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    put_u32(out, end as u32);
    out.extend(&text.as_bytes()[..end]);
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix6, Point3, Vector3};
    use omni_perception::{
        EncoderSample, ImuSample, Mask, MaskedPanorama, OdometryEstimate, RawPoint, RawScan, RgbImage, Rle,
    };
    use proptest::prelude::*;

    use super::*;
    use crate::stream::BatteryState;

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![any::<f64>().prop_filter("NaN is not equal to itself", |x| !x.is_nan()), Just(-0.0), Just(1e-308)]
    }

    fn vector() -> impl Strategy<Value = Vector3<f64>> {
        (number(), number(), number()).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    fn event() -> impl Strategy<Value = SensorEvent> {
        let stamp = || any::<i64>().prop_map(Stamp);
        let point = (any::<[f32; 3]>(), any::<u32>(), any::<u16>()).prop_map(|(p, offset_ns, ring)| RawPoint {
            position: Point3::from(p.map(|x| if x.is_nan() { 0.0 } else { x })),
            offset_ns,
            ring,
        });
        let mask = (prop::collection::vec(any::<bool>(), 12), "[a-z ä]{0,9}", any::<u8>(), any::<Option<u64>>())
            .prop_map(|(pixels, label, score, track)| Mask {
                rle: Rle::from_rows(4, 3, &pixels).unwrap(),
                caption: label.repeat(2),
                label,
                score: f32::from(score),
                track,
            });
        prop_oneof![
            (stamp(), vector(), vector()).prop_map(|(stamp, a, b)| SensorEvent::Imu(ImuSample {
                stamp,
                angular_velocity_radps: a,
                specific_force_mps2: b
            })),
            (stamp(), number()).prop_map(|(stamp, angle_rad)| SensorEvent::Encoder(EncoderSample { stamp, angle_rad })),
            (stamp(), prop::collection::vec(point, 0..5))
                .prop_map(|(start, points)| SensorEvent::Scan(RawScan { start, points })),
            (stamp(), prop::collection::vec(mask, 0..4), any::<Option<[u8; 36]>>()).prop_map(|(stamp, masks, rgb)| {
                let image = rgb.map(|rgb| RgbImage { width: 4, height: 3, rgb: rgb.to_vec() });
                SensorEvent::Panorama(MaskedPanorama { stamp, masks, image })
            }),
            (stamp(), number()).prop_map(|(stamp, charge)| SensorEvent::Battery(BatteryState { stamp, charge })),
            (stamp(), vector(), vector(), -3.0..3.0_f64).prop_map(|(stamp, a, b, yaw_rad)| {
                SensorEvent::Odometry(OdometryEstimate {
                    stamp,
                    world_from_body: Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::z() * yaw_rad),
                    velocity_in_world_mps: a,
                    angular_velocity_in_body_radps: b,
                    covariance: Matrix6::from_fn(|r, c| (r * 7 + c) as f64 / 3.0),
                    status: TrackingStatus::Degenerate,
                })
            }),
        ]
    }

    fn written(cycles: &[(i64, Vec<SensorEvent>)]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut writer = EventLogWriter::new(&mut bytes).unwrap();
        for (now, events) in cycles {
            events.iter().for_each(|event| writer.event(event).unwrap());
            writer.cycle(Stamp(*now)).unwrap();
        }
        writer.finish().unwrap();
        bytes
    }

    proptest! {
        #[test]
        fn what_was_perceived_comes_back_bit_for_bit(
            cycles in prop::collection::vec((any::<i64>(), prop::collection::vec(event(), 0..4)), 0..4),
        ) {
            let bytes = written(&cycles);
            let mut reader = EventLogReader::new(bytes.as_slice()).unwrap();
            let mut again = Vec::new();
            while let Some(cycle) = reader.next_cycle().unwrap() {
                again.push((cycle.now.0, cycle.events));
            }
            prop_assert_eq!(written(&again), bytes);
            prop_assert_eq!(again.len(), cycles.len());
        }

        #[test]
        fn no_broken_log_panics_or_hangs(
            cycles in prop::collection::vec((any::<i64>(), prop::collection::vec(event(), 0..4)), 1..3),
            at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<prop::sample::Index>(),
        ) {
            let mut bytes = written(&cycles);
            let index = at.index(bytes.len());
            bytes[index] = byte;
            bytes.truncate(cut.index(bytes.len() + 1));
            if let Ok(mut reader) = EventLogReader::new(bytes.as_slice()) {
                while let Ok(Some(_)) = reader.next_cycle() {}
            }
        }
    }

    #[test]
    fn a_cut_log_and_another_file_are_named() {
        let bytes =
            written(&[(5, vec![SensorEvent::Battery(BatteryState { stamp: Stamp(1), charge: 0.5 })]), (6, vec![])]);
        let cut = &bytes[..bytes.len() - 3];
        let mut reader = EventLogReader::new(cut).unwrap();
        assert_eq!(reader.next_cycle().unwrap().unwrap().now, Stamp(5));
        assert!(matches!(reader.next_cycle(), Err(EventLogError::Truncated { cycles: 1 })));
        assert!(matches!(EventLogReader::new(b"ply\n".as_slice()), Err(EventLogError::Magic)));
    }
}
