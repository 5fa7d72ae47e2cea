//! A recording becomes a map: odometry, surface, distances, places, rooms and things. Nobody decides, nobody moves.
//!
//! The same parts as in a [`Mission`](crate::mission::Mission), in the same order: what a robot would have known after such a way
//! is what comes out.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use omni_perception::{Equirectangular, Stamp};
use robot_model::RobotModel;

use crate::config::MissionConfig;
use crate::error::MissionError;
use crate::odometer::{Odometer, with_poses};
use crate::recording::RecordingError;
use crate::stage_clock::{CpuScope, StageClock};
use crate::stream::SensorEvent;
use crate::world_model::WorldModel;

/// Time between two poses of the way.
const POSE_PERIOD_NS: i64 = 100_000_000;

/// The robot's side of a recording.
pub struct MappingRun {
    odometer: Option<Odometer>,
    camera: Equirectangular,
    refresh_ns: i64,
    first: Option<Stamp>,
    next_refresh: Option<Stamp>,
    /// Everything known so far.
    pub world: WorldModel,
    /// What each stage took.
    pub clock: StageClock,
    /// Where the body was, in the map: about ten poses a second.
    pub way: Vec<(Stamp, Isometry3<f64>)>,
    /// Scans that came, whether they could be used or not.
    pub scans: usize,
    /// Pictures with masks.
    pub images: usize,
    /// What could not be used, by reason.
    pub dropped: BTreeMap<&'static str, usize>,
}

impl MappingRun {
    /// For a robot whose sensors sit where those of the recording sat, and which stands at the beginning with its body
    /// `height_m` over the floor.
    ///
    /// # Errors
    /// [`MissionError`] if the configuration makes no sense.
    pub fn new(
        robot: &RobotModel,
        config: &MissionConfig,
        camera: Equirectangular,
        height_m: f64,
    ) -> Result<MappingRun, MissionError> {
        let start = Isometry3::translation(0.0, 0.0, height_m);
        Ok(MappingRun {
            odometer: config.odometry.odometer(robot, &start)?,
            camera,
            refresh_ns: (config.refresh_period_s * 1e9) as i64,
            first: None,
            next_refresh: None,
            world: WorldModel::new(robot, config, camera, 0.0)?,
            clock: StageClock::new(CpuScope::Thread),
            way: Vec::new(),
            scans: 0,
            images: 0,
            dropped: BTreeMap::new(),
        })
    }

    /// Takes one item of a recording whose pictures have masks already ([`crate::segmented`]).
    pub fn push(&mut self, item: Result<SensorEvent, RecordingError>) {
        let event = match item {
            Ok(event) => event,
            Err(error) => {
                self.scans += usize::from(error.is_scan());
                return *self.dropped.entry(error.loss()).or_default() += error.count();
            }
        };
        match &event {
            SensorEvent::Scan(_) => self.scans += 1,
            SensorEvent::Panorama(panorama) => {
                let size = panorama.image.as_ref().map(|image| (image.width, image.height));
                if size.is_some_and(|size| size != (self.camera.width_px, self.camera.height_px)) {
                    return *self.dropped.entry("images_of_another_size").or_default() += 1;
                }
                self.images += 1;
            }
            _ => {}
        }
        let now = event.stamp();
        self.first.get_or_insert(now);
        for event in with_poses(&mut self.odometer, event, &mut self.clock) {
            self.world.see(event, &mut self.clock);
        }
        if let Some(here) = &self.world.odometry
            && self.way.last().is_none_or(|(last, _)| here.stamp.0 - last.0 >= POSE_PERIOD_NS)
        {
            self.way.push((here.stamp, here.world_from_body));
        }
        if self.next_refresh.is_none_or(|next| now >= next) {
            self.next_refresh = Some(now.plus_ns(self.refresh_ns));
            self.world.refresh(self.seconds(now), &mut self.clock);
        }
    }

    /// The recording is over: the last conclusions are drawn.
    pub fn finish(&mut self) {
        let now = self.world.odometry.map_or(0.0, |newest| self.seconds(newest.stamp));
        self.world.refresh(now, &mut self.clock);
        self.world.volume.complete_mesh();
    }

    /// Length of the way, metres.
    pub fn way_m(&self) -> f64 {
        let step =
            |pair: &[(Stamp, Isometry3<f64>)]| (pair[1].1.translation.vector - pair[0].1.translation.vector).norm();
        self.way.windows(2).map(step).fold(0.0, |sum, step| sum + step) // an empty sum of floats is -0
    }

    /// Seconds since the first event.
    pub fn seconds(&self, stamp: Stamp) -> f64 {
        self.first.map_or(0.0, |first| stamp.seconds_since(first))
    }

    /// What was not used, in sentences.
    pub fn unused(&self) -> Vec<String> {
        let mut sentences = self.world.account();
        sentences.extend(self.odometer.iter().flat_map(|odometer| odometer.refused.sentences()));
        sentences.extend(
            self.dropped.iter().map(|(reason, count)| format!("left out: {count} times {}", reason.replace('_', " "))),
        );
        sentences
    }
}
