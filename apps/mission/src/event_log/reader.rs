//! The log read again, cycle by cycle. Any bytes are accepted: what nobody writes is an error.

use std::io::{self, BufRead, Cursor, Read};

use image::{ImageFormat, ImageReader, Limits};
use nalgebra::{Isometry3, Matrix6, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use omni_perception::{
    EncoderSample, ImuSample, Mask, MaskedPanorama, OdometryEstimate, RawPoint, RawScan, RgbImage, Rle, Stamp,
    TrackingStatus,
};

use super::{EventLogError, LONGEST_TEXT, MAGIC, MOST, WIDEST_PX};
use crate::stream::{BatteryState, SensorEvent};

/// One cycle, with what was perceived before it.
#[derive(Debug, Clone)]
pub struct LoggedCycle {
    /// Its time.
    pub now: Stamp,
    /// In the order in which the mission saw them.
    pub events: Vec<SensorEvent>,
}

/// Reads a log cycle by cycle.
pub struct EventLogReader<R> {
    input: R,
    cycles: u64,
}

impl<R: BufRead> EventLogReader<R> {
    /// Begins.
    ///
    /// # Errors
    /// [`EventLogError::Magic`] if it is something else.
    pub fn new(mut input: R) -> Result<EventLogReader<R>, EventLogError> {
        let mut magic = Vec::new();
        (&mut input).take(MAGIC.len() as u64).read_to_end(&mut magic)?;
        if magic == MAGIC { Ok(EventLogReader { input, cycles: 0 }) } else { Err(EventLogError::Magic) }
    }

    /// The next cycle; `None` at the end. What comes after the last cycle was perceived by nobody.
    ///
    /// # Errors
    /// A log that is cut, or a record that nobody writes.
    pub fn next_cycle(&mut self) -> Result<Option<LoggedCycle>, EventLogError> {
        let mut events = Vec::new();
        loop {
            if self.input.fill_buf()?.is_empty() {
                return Ok(None);
            }
            match self.byte()? {
                0 => {
                    let now = Stamp(self.i64()?);
                    self.cycles += 1;
                    return Ok(Some(LoggedCycle { now, events }));
                }
                tag => events.push(self.event(tag)?),
            }
        }
    }

    fn event(&mut self, tag: u8) -> Result<SensorEvent, EventLogError> {
        let stamp = Stamp(self.i64()?);
        Ok(match tag {
            1 => SensorEvent::Imu(ImuSample {
                stamp,
                angular_velocity_radps: self.vector()?,
                specific_force_mps2: self.vector()?,
            }),
            2 => SensorEvent::Encoder(EncoderSample { stamp, angle_rad: self.f64()? }),
            3 => {
                let position = self.vector()?;
                let coords: [f64; 4] = self.f64s()?;
                // Bit for bit: the writer's quaternion had length one already.
                let rotation = UnitQuaternion::new_unchecked(Quaternion::from(nalgebra::Vector4::from(coords)));
                SensorEvent::Odometry(OdometryEstimate {
                    stamp,
                    world_from_body: Isometry3::from_parts(Translation3::from(position), rotation),
                    velocity_in_world_mps: self.vector()?,
                    angular_velocity_in_body_radps: self.vector()?,
                    covariance: Matrix6::from_column_slice(&self.f64s::<36>()?),
                    status: match self.byte()? {
                        0 => TrackingStatus::Initialising,
                        1 => TrackingStatus::Tracking,
                        2 => TrackingStatus::Degenerate,
                        3 => TrackingStatus::Lost,
                        _ => return Err(self.wrong("a status that is none")),
                    },
                })
            }
            4 => {
                let count = self.count()?;
                let mut points = Vec::new();
                for _ in 0..count {
                    let position = Point3::new(self.f32()?, self.f32()?, self.f32()?);
                    points.push(RawPoint { position, offset_ns: self.u32()?, ring: self.u16()? });
                }
                SensorEvent::Scan(RawScan { start: stamp, points })
            }
            5 => {
                let count = self.count()?;
                let mut masks = Vec::new();
                for _ in 0..count {
                    masks.push(self.mask()?);
                }
                SensorEvent::Panorama(MaskedPanorama { stamp, masks, image: self.image()? })
            }
            6 => SensorEvent::Battery(BatteryState { stamp, charge: self.f64()? }),
            _ => return Err(self.wrong("a record of an unknown kind")),
        })
    }

    fn mask(&mut self) -> Result<Mask, EventLogError> {
        let (width, height) = (self.u32()?, self.u32()?);
        let count = self.count()?;
        let mut runs = Vec::new();
        for _ in 0..count {
            runs.push(self.u32()?);
        }
        let rle = Rle::from_counts(width, height, &runs).map_err(|_| self.wrong("a mask that fits no picture"))?;
        let score = self.f32()?;
        let (has_track, track) = (self.byte()? != 0, u64::from_le_bytes(self.bytes()?));
        Ok(Mask { rle, score, track: has_track.then_some(track), label: self.text()?, caption: self.text()? })
    }

    fn image(&mut self) -> Result<Option<RgbImage>, EventLogError> {
        let length = u64::from(self.count()?);
        if length == 0 {
            return Ok(None);
        }
        let mut bytes = Vec::new();
        (&mut self.input).take(length).read_to_end(&mut bytes)?;
        if (bytes.len() as u64) < length {
            return Err(EventLogError::Truncated { cycles: self.cycles });
        }
        let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
        let mut limits = Limits::default();
        (limits.max_image_width, limits.max_image_height) = (Some(WIDEST_PX), Some(WIDEST_PX));
        reader.limits(limits);
        let picture = reader.decode().map_err(|_| self.wrong("a picture that is no PNG"))?.into_rgb8();
        Ok(Some(RgbImage { width: picture.width(), height: picture.height(), rgb: picture.into_raw() }))
    }

    fn text(&mut self) -> Result<String, EventLogError> {
        let length = self.u32()?;
        if length > LONGEST_TEXT {
            return Err(self.wrong("a text longer than any"));
        }
        let mut bytes = vec![0; length as usize];
        self.fill(&mut bytes)?;
        String::from_utf8(bytes).map_err(|_| self.wrong("a text that is no UTF-8"))
    }

    fn count(&mut self) -> Result<u32, EventLogError> {
        let count = self.u32()?;
        if count > MOST { Err(self.wrong("a list longer than any")) } else { Ok(count) }
    }

    fn vector(&mut self) -> Result<Vector3<f64>, EventLogError> {
        Ok(Vector3::from(self.f64s::<3>()?))
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N], EventLogError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    fn f64(&mut self) -> Result<f64, EventLogError> {
        self.bytes().map(f64::from_le_bytes)
    }

    fn f32(&mut self) -> Result<f32, EventLogError> {
        self.bytes().map(f32::from_le_bytes)
    }

    fn i64(&mut self) -> Result<i64, EventLogError> {
        self.bytes().map(i64::from_le_bytes)
    }

    fn u32(&mut self) -> Result<u32, EventLogError> {
        self.bytes().map(u32::from_le_bytes)
    }

    fn u16(&mut self) -> Result<u16, EventLogError> {
        self.bytes().map(u16::from_le_bytes)
    }

    fn byte(&mut self) -> Result<u8, EventLogError> {
        self.bytes::<1>().map(|[byte]| byte)
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], EventLogError> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), EventLogError> {
        self.input.read_exact(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => EventLogError::Truncated { cycles: self.cycles },
            _ => EventLogError::Io(error),
        })
    }

    fn wrong(&self, what: &'static str) -> EventLogError {
        EventLogError::Record { cycles: self.cycles, what }
    }
}
