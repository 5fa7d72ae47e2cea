//! The first look at a bag: which topics to read, in which frames, and how their points tell the time.

use std::collections::BTreeMap;
use std::path::Path;

use super::error::BagError;
use super::frames::StaticFrames;
use super::mcap_stream::{McapStream, Message};
use super::point_cloud::{range_of, time_field};
use super::point_times::{PointTimes, ScanTimes};
use super::ros_messages::{CompressedImage, Header, Imu, JointState, PointCloud2, RosMessage, TfMessage, decode};
use crate::recording::RecordingOptions;

/// Scans of a topic that decide about its times.
const SCANS: usize = 5;
/// IMU samples that decide about its unit.
const IMU_SAMPLES: usize = 50;
/// Messages and bytes after which the look ends whatever is still missing.
const MESSAGES: usize = 20_000;
const BYTES: usize = 256 << 20;

/// What a bag holds, as far as its beginning shows.
#[derive(Debug, Default)]
pub(super) struct Survey {
    pub(super) frames: StaticFrames,
    /// A frame whose transform is unsound; it matters only where no rig is given.
    unsound_frame: Option<String>,
    clouds: BTreeMap<String, CloudTopic>,
    imus: BTreeMap<String, ImuTopic>,
    joints: BTreeMap<String, JointTopic>,
    images: BTreeMap<String, String>,
    /// Every topic with its type.
    topics: BTreeMap<String, String>,
}

#[derive(Debug)]
struct CloudTopic {
    frame: String,
    fields: Vec<String>,
    time_field: Option<String>,
    scans: Vec<ScanTimes>,
}

#[derive(Debug)]
struct ImuTopic {
    frame: String,
    /// Lengths of the first specific forces.
    forces: Vec<f64>,
}

#[derive(Debug)]
struct JointTopic {
    /// Each joint with the frame of its messages; a joint without a name where messages carry none. Several nodes may publish on the
    /// topic.
    frames: BTreeMap<String, String>,
}

/// How the points of a recording tell their time.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum TimesKnown {
    /// So.
    So(PointTimes),
    /// In this field; no scan with a point has been seen yet.
    NotYet(String),
    /// They need not.
    Never,
}

impl TimesKnown {
    /// With the first scan that has a point in it, it is known.
    ///
    /// # Errors
    /// As [`PointTimes::decide`].
    pub(super) fn learn(&mut self, topic: &str, cloud: &PointCloud2<'_>) -> Result<(), BagError> {
        if let TimesKnown::NotYet(field) = self
            && let Ok(Some((min, max))) = range_of(cloud, field)
        {
            let scan = ScanTimes { header: cloud.header.stamp, min, max };
            *self = TimesKnown::So(PointTimes::decide(topic, field, &[scan])?);
        }
        Ok(())
    }

    pub(super) fn known(&self) -> Option<&PointTimes> {
        match self {
            TimesKnown::So(times) => Some(times),
            TimesKnown::NotYet(_) | TimesKnown::Never => None,
        }
    }
}

/// The topics of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chosen {
    pub(super) points: String,
    pub(super) points_frame: String,
    pub(super) times: TimesKnown,
    pub(super) imu: String,
    pub(super) imu_frame: String,
    /// Factor from the unit of the accelerometer to m/s^2.
    pub(super) force_unit_mps2: f64,
    /// Topic, frame of the stator, and name of the joint (empty where messages carry no names).
    pub(super) encoder: Option<(String, String, String)>,
    /// Topic and frame.
    pub(super) image: Option<(String, String)>,
}

impl Survey {
    /// Reads from the start of the bag until everything is known that its topics can tell.
    pub(super) fn of(stream: &mut McapStream) -> Result<Survey, BagError> {
        let mut survey = Survey::default();
        let (mut messages, mut bytes) = (0, 0);
        while messages < MESSAGES && bytes < BYTES {
            let Some(message) = stream.next_message()? else { break };
            (messages, bytes) = (messages + 1, bytes + message.payload.len());
            survey.look_at(&message)?;
            if messages % 100 == 0 && survey.is_enough() {
                break;
            }
        }
        Ok(survey)
    }

    /// Faults of single messages are for the reader that comes after; here they only teach nothing.
    fn look_at(&mut self, message: &Message<'_>) -> Result<(), BagError> {
        let topic = message.channel.topic.clone();
        let kind = message.channel.message_type.as_str();
        if !self.topics.contains_key(&topic) {
            self.topics.insert(topic.clone(), kind.to_owned());
        }
        if kind == TfMessage::TYPE && topic.ends_with("tf_static") {
            if let Ok(message) = decode::<TfMessage>(message.payload) {
                match self.frames.add(&message) {
                    Err(BagError::BadTransform { frame }) => self.unsound_frame = Some(frame),
                    other => other?,
                }
            }
        } else if kind == PointCloud2::TYPE {
            if let Ok(cloud) = decode::<PointCloud2<'_>>(message.payload) {
                self.look_at_cloud(topic, &cloud);
            }
        } else if kind == Imu::TYPE {
            if let Ok(imu) = decode::<Imu>(message.payload) {
                let known =
                    self.imus.entry(topic).or_insert(ImuTopic { frame: imu.header.frame_id, forces: Vec::new() });
                let force = imu.linear_acceleration;
                if known.forces.len() < IMU_SAMPLES {
                    known.forces.push(force.x.hypot(force.y).hypot(force.z));
                }
            }
        } else if kind == JointState::TYPE {
            if let Ok(state) = decode::<JointState>(message.payload) {
                let frame = state.header.frame_id;
                let known = self.joints.entry(topic).or_insert(JointTopic { frames: BTreeMap::new() });
                let names = if state.name.is_empty() { vec![String::new()] } else { state.name };
                names.into_iter().for_each(|name| _ = known.frames.entry(name).or_insert_with(|| frame.clone()));
            }
        } else if kind == CompressedImage::TYPE
            && let Ok(image) = decode::<CompressedImage<'_>>(message.payload)
        {
            let Header { frame_id, .. } = image.header;
            self.images.entry(topic).or_insert(frame_id);
        }
        Ok(())
    }

    fn look_at_cloud(&mut self, topic: String, cloud: &PointCloud2<'_>) {
        let known = self.clouds.entry(topic).or_insert_with(|| CloudTopic {
            frame: cloud.header.frame_id.clone(),
            fields: cloud.fields.iter().map(|field| field.name.clone()).collect(),
            time_field: time_field(cloud),
            scans: Vec::new(),
        });
        if known.scans.len() < SCANS
            && let Some(field) = &known.time_field
            && let Ok(Some((min, max))) = range_of(cloud, field)
        {
            known.scans.push(ScanTimes { header: cloud.header.stamp, min, max });
        }
    }

    fn is_enough(&self) -> bool {
        let is_full = |cloud: &CloudTopic| cloud.scans.len() >= SCANS || cloud.time_field.is_none();
        self.frames != StaticFrames::default()
            && !self.clouds.is_empty()
            && self.clouds.values().all(is_full)
            && !self.imus.is_empty()
            && self.imus.values().all(|imu| imu.forces.len() >= IMU_SAMPLES)
    }

    /// Chooses the topics.
    pub(super) fn choose(&self, bag: &Path, options: &RecordingOptions) -> Result<Chosen, BagError> {
        let imu = self.only(bag, Imu::TYPE, options.imu_topic.as_deref(), self.imus.keys().collect())?;
        let imu_frame = self.imus[&imu].frame.clone();
        let has_joints = !self.joints.is_empty();
        if let (Some(frame), None) = (&self.unsound_frame, options.rig) {
            return Err(BagError::BadTransform { frame: frame.clone() });
        }
        // In a frame that hangs together with the IMU's: the points of a fixed LiDAR, or of a stator.
        let is_still = |cloud: &CloudTopic| -> Result<bool, BagError> {
            Ok(self.frames.pose(self.frames.body(&imu_frame)?, &cloud.frame)?.is_some())
        };

        // With an encoder at hand the turning cloud is the one to take (the other is made from it), and with a rig the one
        // that it speaks of.
        let wants_turning = options.rig.map_or(has_joints, |rig| rig.is_rotating);
        let mut clouds: Vec<&String> = self.clouds.keys().collect();
        if clouds.len() > 1 {
            let fits = |cloud: &CloudTopic| is_still(cloud).is_ok_and(|is_still| is_still != wants_turning);
            let fitting: Vec<&String> =
                self.clouds.iter().filter(|(_, cloud)| fits(cloud)).map(|(topic, _)| topic).collect();
            if fitting.len() == 1 {
                clouds = fitting;
            }
        }
        let points = self.only(bag, PointCloud2::TYPE, options.points_topic.as_deref(), clouds)?;
        let cloud = &self.clouds[&points];
        let times = match (&cloud.time_field, options.are_point_times_needed) {
            (_, false) => TimesKnown::Never,
            (Some(field), true) if !cloud.scans.is_empty() => {
                TimesKnown::So(PointTimes::decide(&points, field, &cloud.scans)?)
            }
            (Some(field), true) => TimesKnown::NotYet(field.clone()),
            (None, true) => {
                return Err(BagError::NoTimeField { topic: points, fields: cloud.fields.clone() });
            }
        };
        let is_turning = match options.rig {
            Some(rig) => rig.is_rotating,
            None => has_joints && !is_still(cloud)?,
        };
        let encoder = if is_turning { Some(self.encoder(bag, options)?) } else { None };
        let image = match (&options.image_topic, self.images.len()) {
            (Some(topic), _) => self.images.get_key_value(topic),
            (None, 1) => self.images.first_key_value(),
            (None, _) => None,
        };
        Ok(Chosen {
            points_frame: cloud.frame.clone(),
            points,
            times,
            force_unit_mps2: force_unit_mps2(&self.imus[&imu].forces),
            imu,
            imu_frame,
            encoder,
            image: image.map(|(topic, frame)| (topic.clone(), frame.clone())),
        })
    }

    fn encoder(&self, bag: &Path, options: &RecordingOptions) -> Result<(String, String, String), BagError> {
        let topic = self.only(bag, JointState::TYPE, options.encoder_topic.as_deref(), self.joints.keys().collect())?;
        let joints: Vec<(&String, &String)> = self.joints[&topic].frames.iter().collect();
        let is_motor = |name: &str| name.to_lowercase().contains("lidar") || name.to_lowercase().contains("motor");
        let named: Vec<_> = joints.iter().filter(|(name, _)| is_motor(name)).collect();
        match (&joints[..], &named[..]) {
            ([(name, frame)], _) | (_, [(name, frame)]) => Ok((topic, (*frame).clone(), (*name).clone())),
            _ => Err(BagError::Joints { topic, found: joints.iter().map(|(name, _)| (*name).clone()).collect() }),
        }
    }

    /// The topic that was asked for, or the only one.
    fn only(
        &self,
        bag: &Path,
        wanted: &'static str,
        asked: Option<&str>,
        mut candidates: Vec<&String>,
    ) -> Result<String, BagError> {
        if let Some(asked) = asked {
            candidates.retain(|topic| *topic == asked);
        }
        match &candidates[..] {
            [single] => Ok((*single).clone()),
            [] => Err(BagError::NoTopic {
                path: bag.to_path_buf(),
                wanted,
                found: self.topics.iter().map(|(topic, kind)| format!("{topic} ({kind})")).collect(),
            }),
            several => Err(BagError::SeveralTopics {
                path: bag.to_path_buf(),
                wanted,
                found: several.iter().map(|topic| (*topic).clone()).collect(),
            }),
        }
    }
}

/// Some drivers give the specific force in multiples of gravity: at rest or in gentle motion its length is then about one.
pub(in crate::recording) fn force_unit_mps2(lengths: &[f64]) -> f64 {
    const STANDARD_GRAVITY_MPS2: f64 = 9.806_65;
    let mut lengths = lengths.to_vec();
    lengths.sort_by(f64::total_cmp);
    let median = lengths.get(lengths.len() / 2).copied().unwrap_or(STANDARD_GRAVITY_MPS2);
    if (0.7..1.4).contains(&median) { STANDARD_GRAVITY_MPS2 } else { 1.0 }
}
