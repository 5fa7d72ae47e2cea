//! The robot's sensors as topics of a bag.
//!
//! ```text
//! /points               PointCloud2      frame "lidar": the motor's angle taken out, for readers that know no motor
//! /points_raw           PointCloud2      frame "lidar_raw": as the turning sensor saw it; not for a fixed LiDAR
//! /joint_states         JointState       frame "lidar", joint "lidar_motor"; not for a fixed LiDAR
//!                                        frame "base_link", the joints of the URDF 50 times a second; for robots with legs
//! /imu                  Imu              frame "imu"
//! /panorama/compressed  CompressedImage  frame "camera" (x forward, z up), PNG: no pixel is lost
//! /tf_static            TFMessage        base_link - imu - lidar, base_link - camera, rotor - lidar_raw
//! /ground_truth         PoseStamped      true pose of "imu" in "world"; nothing of ours reads it
//! ```
//! A point has 24 bytes: x, y, z, intensity (f32; this LiDAR measures none, so 0), t (u32, nanoseconds after the header's
//! stamp), ring (u16), two bytes of padding. The header's stamp is that of the scan's start; a scan is written when it ends.

use anyhow::{Context, Result, ensure};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use mission::omni_perception::{EncoderSample, EncoderTrack, ImuSample, MaskedPanorama, RawScan, RotatingMount, Stamp};
use mission::recording::rosbag::frames::transform;
use mission::recording::rosbag::ros_messages::{
    CompressedImage, Header, Imu, JointState, PointCloud2, PointField, Pose, PoseStamped, TfMessage, Time,
    TransformStamped, Vector3 as RosVector,
};
use mission::recording::rosbag::writer::{BagWriter, TopicSummary};
use mission::robot_model::SensorMounts;
use nalgebra::{Isometry3, Point3, Vector3};
use std::collections::BTreeMap;
use std::path::Path;

/// Bytes of a point.
const POINT_STEP: usize = 24;
/// Frame of true poses.
const WORLD: &str = "world";
/// The motor's joint.
const JOINT: &str = "lidar_motor";

/// Writes events of the simulator into a bag, at dates of a real clock.
pub struct TopicWriter {
    bag: BagWriter,
    epoch_ns: i64,
    mount: RotatingMount,
    is_rotating: bool,
    body_from_imu: Isometry3<f64>,
    encoder: EncoderTrack,
    points: Vec<u8>,
    image: Vec<u8>,
}

impl TopicWriter {
    /// Begins a bag. Stamps of events are written `epoch_ns` later.
    pub fn create(folder: &Path, sensors: &SensorMounts, epoch_ns: i64) -> Result<TopicWriter> {
        let is_rotating = sensors.lidar.rotation_hz != 0.0;
        let mount = RotatingMount {
            body_from_stator: sensors.body_from_lidar_stator,
            rotor_from_sensor: sensors.rotor_from_sensor,
        };
        let mut writer = TopicWriter {
            bag: BagWriter::create(folder)?,
            epoch_ns,
            is_rotating,
            body_from_imu: sensors.body_from_imu,
            encoder: if is_rotating { EncoderTrack::rotating(0.0) } else { EncoderTrack::fixed() },
            mount,
            points: Vec::new(),
            image: Vec::new(),
        };
        writer.frames(sensors)?;
        Ok(writer)
    }

    /// The static transforms. A fixed sensor's tilt and offset are part of the pose of "lidar".
    fn frames(&mut self, sensors: &SensorMounts) -> Result<()> {
        let mut body_from_lidar = sensors.body_from_lidar_stator;
        if !self.is_rotating {
            body_from_lidar *= sensors.rotor_from_sensor;
        }
        let imu_from_lidar = sensors.body_from_imu.inverse() * body_from_lidar;
        let mut edges = vec![
            ("base_link", "imu", sensors.body_from_imu),
            ("imu", "lidar", imu_from_lidar),
            ("base_link", "camera", sensors.body_from_camera),
        ];
        if self.is_rotating {
            edges.push(("rotor", "lidar_raw", sensors.rotor_from_sensor));
        }
        let transforms = edges
            .into_iter()
            .map(|(parent, child, pose)| {
                let header = self.header(Stamp(0), parent)?;
                Ok(TransformStamped { header, child_frame_id: child.to_owned(), transform: transform(&pose) })
            })
            .collect::<Result<Vec<_>>>()?;
        self.bag.write("/tf_static", self.date(Stamp(0)), &TfMessage { transforms })?;
        Ok(())
    }

    fn date(&self, stamp: Stamp) -> Stamp {
        stamp.plus_ns(self.epoch_ns)
    }

    fn header(&self, stamp: Stamp, frame: &str) -> Result<Header> {
        let stamp = Time::from_stamp(self.date(stamp)).context("a date after 2038 does not fit into ROS")?;
        Ok(Header { stamp, frame_id: frame.to_owned() })
    }

    /// An IMU sample, and where the IMU truly was.
    pub fn imu(&mut self, sample: &ImuSample, world_from_body: &Isometry3<f64>) -> Result<()> {
        let header = self.header(sample.stamp, "imu")?;
        let mut orientation_covariance = [0.0; 9];
        orientation_covariance[0] = -1.0; // there is no orientation in this message
        let message = Imu {
            header,
            orientation: mission::recording::rosbag::ros_messages::Quaternion { w: 1.0, ..Default::default() },
            orientation_covariance,
            angular_velocity: vector(&sample.angular_velocity_radps),
            linear_acceleration: vector(&sample.specific_force_mps2),
            ..Imu::default()
        };
        self.bag.write("/imu", self.date(sample.stamp), &message)?;
        let pose = transform(&(world_from_body * self.body_from_imu));
        let truth = PoseStamped {
            header: self.header(sample.stamp, WORLD)?,
            pose: Pose { position: pose.translation, orientation: pose.rotation },
        };
        self.bag.write("/ground_truth", self.date(sample.stamp), &truth)?;
        Ok(())
    }

    /// A reading of the motor's encoder; nothing for a fixed LiDAR.
    pub fn encoder(&mut self, sample: &EncoderSample) -> Result<()> {
        if !self.is_rotating {
            return Ok(());
        }
        self.encoder.push(*sample).context("the encoder")?;
        let message = JointState {
            header: self.header(sample.stamp, "lidar")?,
            name: vec![JOINT.to_owned()],
            position: vec![sample.angle_rad],
            ..JointState::default()
        };
        self.bag.write("/joint_states", self.date(sample.stamp), &message)?;
        Ok(())
    }

    /// Angles of the joints that the URDF names so: a message of its own, as of a node of its own.
    pub fn joints(&mut self, now: Stamp, names: &[String], angles: &[f64]) -> Result<()> {
        let header = self.header(now, "base_link")?;
        let message = JointState { header, name: names.to_vec(), position: angles.to_vec(), ..JointState::default() };
        self.bag.write("/joint_states", self.date(now), &message)?;
        Ok(())
    }

    /// A scan that ended at `now`.
    pub fn scan(&mut self, scan: &RawScan, now: Stamp) -> Result<()> {
        if !self.is_rotating {
            return self.cloud("/points", "lidar", scan, now, |position, _| Ok(position));
        }
        self.cloud("/points_raw", "lidar_raw", scan, now, |position, _| Ok(position))?;
        // What a driver with the encoder at hand would do: every point turned by the angle at its own time.
        let encoder = std::mem::replace(&mut self.encoder, EncoderTrack::fixed());
        let rotor_from_sensor = self.mount.rotor_from_sensor;
        let mut last = None;
        let result = self.cloud("/points", "lidar", scan, now, |position, stamp| {
            let stator_from_sensor = match last {
                Some((at, known)) if at == stamp => known,
                _ => {
                    let angle_rad = encoder.angle_rad(stamp).context("the encoder does not reach over the scan")?;
                    let upright = RotatingMount { body_from_stator: Isometry3::identity(), rotor_from_sensor };
                    upright.body_from_sensor(angle_rad)
                }
            };
            last = Some((stamp, stator_from_sensor));
            Ok((stator_from_sensor * position.cast::<f64>()).cast::<f32>())
        });
        self.encoder = encoder;
        self.encoder.forget_before(scan.start);
        result
    }

    fn cloud(
        &mut self,
        topic: &str,
        frame: &str,
        scan: &RawScan,
        now: Stamp,
        mut place: impl FnMut(Point3<f32>, Stamp) -> Result<Point3<f32>>,
    ) -> Result<()> {
        self.points.clear();
        for point in &scan.points {
            let position = place(point.position, scan.start.plus_ns(i64::from(point.offset_ns)))?;
            position.iter().for_each(|value| self.points.extend(value.to_le_bytes()));
            self.points.extend(0.0_f32.to_le_bytes());
            self.points.extend(point.offset_ns.to_le_bytes());
            self.points.extend(point.ring.to_le_bytes());
            self.points.extend([0, 0]);
        }
        let field = |name: &str, offset, datatype| PointField { name: name.to_owned(), offset, datatype, count: 1 };
        let message = PointCloud2 {
            header: self.header(scan.start, frame)?,
            height: 1,
            width: u32::try_from(scan.points.len())?,
            fields: vec![
                field("x", 0, 7),
                field("y", 4, 7),
                field("z", 8, 7),
                field("intensity", 12, 7),
                field("t", 16, 6),
                field("ring", 20, 4),
            ],
            is_bigendian: false,
            point_step: POINT_STEP as u32,
            row_step: u32::try_from(self.points.len())?,
            data: &self.points,
            is_dense: true,
        };
        self.bag.write(topic, now.plus_ns(self.epoch_ns), &message)?;
        Ok(())
    }

    /// A panorama.
    pub fn panorama(&mut self, panorama: &MaskedPanorama) -> Result<()> {
        let image = panorama.image.as_ref().context("a panorama without a picture")?;
        ensure!(image.rgb.len() == 3 * image.width as usize * image.height as usize, "a picture of a wrong size");
        self.image.clear();
        PngEncoder::new_with_quality(&mut self.image, CompressionType::Fast, FilterType::Adaptive)
            .write_image(&image.rgb, image.width, image.height, ExtendedColorType::Rgb8)
            .context("compressing a panorama")?;
        let message = CompressedImage {
            header: self.header(panorama.stamp, "camera")?,
            format: "rgb8; png compressed rgb8".to_owned(),
            data: &self.image,
        };
        self.bag.write("/panorama/compressed", panorama.stamp.plus_ns(self.epoch_ns), &message)?;
        Ok(())
    }

    /// Closes the bag and says what is in it.
    pub fn finish(self) -> Result<BTreeMap<String, TopicSummary>> {
        Ok(self.bag.finish()?)
    }
}

fn vector(vector: &Vector3<f64>) -> RosVector {
    RosVector { x: vector.x, y: vector.y, z: vector.z }
}
