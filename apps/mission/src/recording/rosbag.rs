//! A bag of ROS 2 as a recording: a rosbag2 folder with MCAP inside, or a single `.mcap` file, read without ROS.
//!
//! ```text
//! /points_raw or /points   sensor_msgs/PointCloud2    scans, with a time in each point
//! /imu                     sensor_msgs/Imu
//! /joint_states            sensor_msgs/JointState     angle of the LiDAR's motor, only for a LiDAR that turns
//! /tf_static               tf2_msgs/TFMessage         where the sensors sit
//! /panorama/compressed     sensor_msgs/CompressedImage
//! ```
//! Topics are found by their types, so the names may be others. A first look (`survey`) at the beginning decides which topics
//! to read and how the points tell their time ([`point_times`]); then messages become events one by one. Poses in the bag, true
//! or estimated, are not looked at.

pub mod clock_guard;
pub mod error;
pub mod frames;
pub mod mcap_stream;
pub mod point_cloud;
pub mod point_times;
pub mod ros_messages;
mod survey;
pub mod writer;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};
use omni_perception::{EncoderSample, ImuSample, MaskedPanorama, RgbImage, Stamp};

use self::clock_guard::ClockGuard;
use self::error::BagError;
use self::mcap_stream::{McapStream, Message, StreamFaults};
use self::ros_messages::{CompressedImage, Imu, JointState, PointCloud2, decode};
use self::survey::{Chosen, Survey};
use super::{RecordedRig, Recording, RecordingError};
use crate::stream::SensorEvent;

/// Events wait this long for earlier ones that were written later.
const REORDER_S: f64 = 0.25;

/// What to read of a bag.
#[derive(Debug, Clone, PartialEq)]
pub struct BagOptions {
    /// Topic of the scans; by default the only one, or of several the one in a turning frame.
    pub points_topic: Option<String>,
    /// Topic of the IMU; by default the only one.
    pub imu_topic: Option<String>,
    /// Topic of the motor's angle; by default the only one.
    pub encoder_topic: Option<String>,
    /// Topic of the images; by default the only one, and none of several.
    pub image_topic: Option<String>,
    /// Where the sensors sit, if the bag does not say it or says it wrong.
    pub rig: Option<RecordedRig>,
    /// Refuse points without times (true). Else all points of a scan count as measured at its header's stamp.
    pub are_point_times_needed: bool,
    /// Decode images (true).
    pub are_images_needed: bool,
}

impl Default for BagOptions {
    fn default() -> Self {
        BagOptions {
            points_topic: None,
            imu_topic: None,
            encoder_topic: None,
            image_topic: None,
            rig: None,
            are_point_times_needed: true,
            are_images_needed: true,
        }
    }
}

/// Whether a path looks like something that [`open`] reads: a file `*.mcap`, or a folder with such files or `metadata.yaml`.
pub fn is_bag(path: &Path) -> bool {
    is_mcap(path) || (path.is_dir() && (path.join("metadata.yaml").is_file() || !mcap_files(path).is_empty()))
}

/// Opens a bag with the topics and frames that it has.
///
/// # Errors
/// [`BagError`] in a [`RecordingError`] if it cannot be read or does not hold what a recording needs.
pub fn open(path: &Path) -> Result<Recording, RecordingError> {
    let bag = Bag::open(path, &BagOptions::default())?;
    Ok(Recording { rig: bag.rig, events: Box::new(bag.events) })
}

/// An open bag.
pub struct Bag {
    /// Where LiDAR and IMU sit.
    pub rig: RecordedRig,
    /// Where the camera sits, x forward, z up, if the bag holds images and says it.
    pub body_from_camera: Option<Isometry3<f64>>,
    /// What the sensors said, by the time of delivery.
    pub events: BagEvents,
}

impl Bag {
    /// Opens a bag.
    ///
    /// # Errors
    /// [`BagError`] if it cannot be read or does not hold what a recording needs.
    pub fn open(path: &Path, options: &BagOptions) -> Result<Bag, BagError> {
        let files = files_of(path)?;
        let survey = Survey::of(&mut McapStream::new(files.clone()))?;
        let chosen = survey.choose(path, options)?;
        let stator = chosen.encoder.as_ref().map(|(_, frame, _)| frame.as_str());
        let rig = match options.rig {
            Some(rig) => rig,
            None => survey.frames.rig(&chosen.points_frame, &chosen.imu_frame, stator)?,
        };
        let body_from_camera = match &chosen.image {
            Some((_, frame)) => survey.frames.pose(survey.frames.body(&chosen.imu_frame)?, frame)?,
            None => None,
        };
        let events = BagEvents::new(McapStream::new(files), chosen, options.are_images_needed);
        Ok(Bag { rig, body_from_camera, events })
    }
}

fn is_mcap(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|extension| extension == "mcap")
}

fn mcap_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_mcap(path)).collect();
    // rosbag2 numbers the parts: name_0, name_1, ..., name_10.
    files.sort_by_key(|path| {
        let name = path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let number = name.rsplit('_').next().and_then(|digits| digits.parse::<u64>().ok());
        (number, name)
    });
    files
}

/// The files of a bag in the order of time. The folder's own list (`metadata.yaml`) is missing where a recording was cut off,
/// and its order is that of the names: so the names are what is read.
fn files_of(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    if path.is_file() {
        return Ok(vec![path.to_path_buf()]);
    }
    let entries = fs::read_dir(path);
    entries.map_err(|source| BagError::Read { path: path.to_path_buf(), source })?;
    let files = mcap_files(path);
    if files.is_empty() { Err(BagError::NoFile { path: path.to_path_buf() }) } else { Ok(files) }
}

/// The events of a bag by the time of delivery; faults come as items at the place where they were found.
pub struct BagEvents {
    stream: McapStream,
    chosen: Chosen,
    are_images_needed: bool,
    points: ClockGuard,
    imu: ClockGuard,
    encoder: ClockGuard,
    image: ClockGuard,
    sorter: Sorter,
    seen: StreamFaults,
    is_over: bool,
}

/// Puts events in order of their delivery within a short time.
#[derive(Default)]
struct Sorter {
    waiting: BinaryHeap<Reverse<Waiting>>,
    ready: VecDeque<Result<SensorEvent, RecordingError>>,
    newest: Option<Stamp>,
    count: u64,
}

/// Ordered by time, then by place in the bag.
struct Waiting {
    stamp: Stamp,
    place: u64,
    event: SensorEvent,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.stamp, self.place).cmp(&(other.stamp, other.place))
    }
}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Waiting {}

impl Sorter {
    fn take(&mut self, item: Result<SensorEvent, RecordingError>) {
        match item {
            Ok(event) => {
                let stamp = event.stamp();
                self.newest = self.newest.max(Some(stamp));
                self.waiting.push(Reverse(Waiting { stamp, place: self.count, event }));
                self.count += 1;
            }
            Err(error) => self.ready.push_back(Err(error)),
        }
    }

    fn next(&mut self, is_over: bool) -> Option<Result<SensorEvent, RecordingError>> {
        if let Some(item) = self.ready.pop_front() {
            return Some(item);
        }
        let Reverse(first) = self.waiting.peek()?;
        let is_due = is_over || self.newest.is_some_and(|newest| newest.seconds_since(first.stamp) >= REORDER_S);
        if is_due { self.waiting.pop().map(|Reverse(first)| Ok(first.event)) } else { None }
    }
}

impl BagEvents {
    fn new(stream: McapStream, chosen: Chosen, are_images_needed: bool) -> BagEvents {
        let encoder = chosen.encoder.as_ref().map_or("", |(topic, _, _)| topic.as_str());
        let image = chosen.image.as_ref().map_or("", |(topic, _)| topic.as_str());
        BagEvents {
            points: ClockGuard::new(&chosen.points),
            imu: ClockGuard::new(&chosen.imu),
            encoder: ClockGuard::new(encoder),
            image: ClockGuard::new(image),
            stream,
            are_images_needed,
            chosen,
            sorter: Sorter::default(),
            seen: StreamFaults::default(),
            is_over: false,
        }
    }

    /// Reads one message. What cannot be read of it is a fault in the stream of events.
    fn read_on(&mut self) {
        let sorter = &mut self.sorter;
        match self.stream.next_message() {
            Ok(Some(message)) => {
                let topic = message.channel.topic.as_str();
                let (encoder, image) = (&self.chosen.encoder, &self.chosen.image);
                let result = if topic == self.chosen.imu {
                    read_imu(&message, &self.chosen, &mut self.imu, sorter)
                } else if encoder.as_ref().is_some_and(|(name, _, _)| name == topic) {
                    read_encoder(&message, &self.chosen, &mut self.encoder, sorter)
                } else if topic == self.chosen.points {
                    read_scan(&message, &self.chosen, &mut self.points, sorter)
                } else if self.are_images_needed && image.as_ref().is_some_and(|(name, _)| name == topic) {
                    read_image(&message, &mut self.image, sorter)
                } else {
                    Ok(())
                };
                if let Err(error) = result {
                    sorter.take(Err(error.into()));
                }
            }
            Ok(None) => self.is_over = true,
            Err(error) => {
                sorter.take(Err(error.into()));
                self.is_over = true;
            }
        }
        if self.sorter.ready.iter().any(|item| matches!(item, Err(RecordingError::Bag(BagError::ClockReset { .. })))) {
            self.is_over = true;
        }
        self.report_faults();
        if self.is_over {
            let guards = [&mut self.imu, &mut self.encoder, &mut self.points, &mut self.image];
            for event in guards.into_iter().filter_map(ClockGuard::finish) {
                self.sorter.take(Ok(event));
            }
        }
    }

    fn report_faults(&mut self) {
        let now = self.stream.faults();
        for _ in self.seen.broken_chunks..now.broken_chunks {
            self.sorter.take(Err(BagError::BrokenChunk.into()));
        }
        for _ in self.seen.truncated_files..now.truncated_files {
            self.sorter.take(Err(BagError::Truncated.into()));
        }
        for _ in self.seen.messages_without_channel..now.messages_without_channel {
            self.sorter.take(Err(BagError::UnknownChannel.into()));
        }
        self.seen = now;
    }
}

impl Iterator for BagEvents {
    type Item = Result<SensorEvent, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(item) = self.sorter.next(self.is_over) {
                return Some(item);
            }
            if self.is_over {
                return None;
            }
            self.read_on();
        }
    }
}

fn payload_error(message: &Message<'_>) -> impl Fn(ros_messages::CdrError) -> BagError {
    let topic = message.channel.topic.clone();
    move |source| BagError::Message { topic: topic.clone(), source }
}

fn read_imu(
    message: &Message<'_>,
    chosen: &Chosen,
    guard: &mut ClockGuard,
    sorter: &mut Sorter,
) -> Result<(), BagError> {
    let imu = decode::<Imu>(message.payload).map_err(payload_error(message))?;
    let vector = |v: &ros_messages::Vector3| Vector3::new(v.x, v.y, v.z);
    let stamp = imu.header.stamp.stamp();
    let sample = ImuSample {
        stamp,
        angular_velocity_radps: vector(&imu.angular_velocity),
        specific_force_mps2: vector(&imu.linear_acceleration) * chosen.force_unit_mps2,
    };
    guard.take(stamp, SensorEvent::Imu(sample), |item| sorter.take(item));
    Ok(())
}

fn read_encoder(
    message: &Message<'_>,
    chosen: &Chosen,
    guard: &mut ClockGuard,
    sorter: &mut Sorter,
) -> Result<(), BagError> {
    let state = decode::<JointState>(message.payload).map_err(payload_error(message))?;
    let joint = chosen.encoder.as_ref().map_or("", |(_, _, joint)| joint.as_str());
    let index = if joint.is_empty() { Some(0) } else { state.name.iter().position(|name| name == joint) };
    // Several nodes may publish on the topic, each its own joints.
    let Some(&angle_rad) = index.and_then(|index| state.position.get(index)) else { return Ok(()) };
    let stamp = state.header.stamp.stamp();
    guard.take(stamp, SensorEvent::Encoder(EncoderSample { stamp, angle_rad }), |item| sorter.take(item));
    Ok(())
}

fn read_scan(
    message: &Message<'_>,
    chosen: &Chosen,
    guard: &mut ClockGuard,
    sorter: &mut Sorter,
) -> Result<(), BagError> {
    let cloud = decode::<PointCloud2<'_>>(message.payload).map_err(payload_error(message))?;
    let (topic, stamp) = (&message.channel.topic, cloud.header.stamp.stamp());
    let (scan, count) = point_cloud::scan_of(&cloud, chosen.times.as_ref()).map_err(|fault| BagError::Cloud {
        topic: topic.clone(),
        stamp,
        fault,
    })?;
    if count > 0 {
        sorter.take(Err(BagError::PointsWithoutTime { topic: topic.clone(), stamp: scan.start, count }.into()));
    }
    guard.take(stamp, SensorEvent::Scan(scan), |item| sorter.take(item));
    Ok(())
}

fn read_image(message: &Message<'_>, guard: &mut ClockGuard, sorter: &mut Sorter) -> Result<(), BagError> {
    let file = decode::<CompressedImage<'_>>(message.payload).map_err(payload_error(message))?;
    let stamp = file.header.stamp.stamp();
    let Some(image) = decode_image(file.data) else {
        return Err(BagError::Image { topic: message.channel.topic.clone(), stamp, format: file.format });
    };
    let panorama = MaskedPanorama { stamp, masks: Vec::new(), image: Some(image) };
    guard.take(stamp, SensorEvent::Panorama(panorama), |item| sorter.take(item));
    Ok(())
}

/// The pixels of a PNG or JPEG file.
fn decode_image(file: &[u8]) -> Option<RgbImage> {
    let reader = image::ImageReader::new(Cursor::new(file)).with_guessed_format().ok()?;
    let pixels = reader.decode().ok()?.into_rgb8();
    let (width, height) = pixels.dimensions();
    Some(RgbImage { width, height, rgb: pixels.into_raw() })
}
