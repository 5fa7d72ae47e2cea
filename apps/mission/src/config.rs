//! All numbers of a mission in one place, with unit, meaning and reason.

use octant_prompt::{PromptConfig, PromptForm};
use omni_perception::{EncoderTrack, LabelNames};
use planner::{Battery, Geofence};
use robot_model::RobotModel;
use volumetric_map::VolumeConfig;

use crate::ablation::{Ablation, Part};
use crate::coverage::CoverageConfig;
use crate::error::MissionError;
use crate::link::LinkConfig;
use crate::odometer::OdometrySource;
use crate::rig::Rig;
use crate::rooms::RoomConfig;
use crate::segmenter::STANDING;
use crate::vision_verifier::VisionConfig;
use crate::zones::Zones;

/// Rates, resolutions and patience of a mission. What depends on the robot comes from its
/// [`RobotModel`], not from here.
#[derive(Debug, Clone)]
pub struct MissionConfig {
    /// Who says where the robot is.
    pub odometry: OdometrySource,
    /// Volume of the map; voxels of 5 cm, because doors of 1.0 m must stay open for a robot of 0.75 m.
    pub volume: VolumeConfig,
    /// Rooms.
    pub rooms: RoomConfig,
    /// Exploration.
    pub coverage: CoverageConfig,
    /// Text for the language model.
    pub prompt: PromptConfig,
    /// Distance field and places, default 0.10 m.
    pub field_resolution_m: f64,
    /// Distances beyond this are not computed, default 2.0 m.
    pub field_max_distance_m: f64,
    /// Mesh, distance field, places, rooms: every so many seconds, default 0.5.
    pub refresh_period_s: f64,
    /// Commands: every so many seconds, default 0.02.
    pub control_period_s: f64,
    /// Standing still at the start until the LiDAR's motor has turned once round, default 2.0 s.
    pub first_look_s: f64,
    /// From the snapshot to the answer of the embedded reasoner, default 0.2 s: a robot goes on while somebody thinks,
    /// and a replay must give the same bytes, so the delay is a number and not the clock.
    pub reasoning_latency_s: f64,
    /// Instead of that: a model far away, whose calls take their time in the simulated world, default none.
    pub link: Option<LinkConfig>,
    /// What an experiment leaves out, default nothing.
    pub without: Ablation,
    /// Two decisions are at least this far apart, default 1.0 s.
    pub decision_period_s: f64,
    /// Standing before the thing it went to, the robot looks at it for this long before it decides, default 2.5 s: five
    /// images from nearby.
    pub close_look_s: f64,
    /// Other words for the names of things: the built-in table, and a user's on top.
    pub label_names: LabelNames,
    /// What the segmenter always looks for besides the nouns of the instruction.
    pub standing_phrases: Vec<String>,
    /// Labels wait so long for the scans around their image, default 0.4 s.
    pub label_delay_s: f64,
    /// ... and take points of scans at most this far from the image time, default 1.0 s: with the delay two thirds of a turn of
    /// the LiDAR's motor, for what lies low beside the robot is seen from one side of the turn only.
    pub label_window_s: f64,
    /// The robot stops at most this far from the box of its target (floor distance), default 0.85 m: the referee asks
    /// for 1.0 m, the rest is for odometry drift and the box.
    pub stop_distance_m: f64,
    /// Critiques before the embedded reasoner takes a step, default 3.
    pub max_retries: usize,
    /// Height at which the aerial robot flies, above the floor, default 1.2 m.
    pub flight_height_m: f64,
    /// What an aerial robot's body may be off its set-point, beyond what its ball keeps from obstacles anyway, default 0.02 m: the
    /// simulated one is off by less than one, and a door of a metre has two or three to spare.
    pub tracking_margin_m: f64,
    /// Obstacles of the last scans are kept for this long, default 2.1 s: one turn of the LiDAR's motor shows all sides.
    pub obstacle_memory_s: f64,
    /// Tries to reach one goal before it counts as unreachable, default 3.
    pub max_attempts: u32,
    /// Where an aerial robot may be, in the frame of its odometry, default anywhere.
    pub geofence: Option<Geofence>,
    /// Horizontal field of view of camera and LiDAR, its middle straight ahead, default all round.
    pub view_rad: f64,
    /// Battery of an aerial robot, default none: it counts as full. The stream says how full it is.
    pub battery: Option<Battery>,
    /// Where the robot may not be or may only be slow, default nowhere.
    pub zones: Zones,
    /// A vision-language model that is shown short relations (Eq. 7), default none: geometry judges them.
    pub vision: Option<VisionConfig>,
}

impl Default for MissionConfig {
    fn default() -> Self {
        Self {
            odometry: OdometrySource::LidarInertial(Box::default()),
            volume: VolumeConfig::default(),
            rooms: RoomConfig::default(),
            coverage: CoverageConfig::default(),
            prompt: PromptConfig::default(),
            field_resolution_m: 0.10,
            field_max_distance_m: 2.0,
            refresh_period_s: 0.5,
            control_period_s: 0.02,
            first_look_s: 2.0,
            reasoning_latency_s: 0.2,
            link: None,
            without: Ablation::default(),
            decision_period_s: 1.0,
            close_look_s: 2.5,
            label_names: LabelNames::default(),
            standing_phrases: STANDING.iter().map(|phrase| (*phrase).to_owned()).collect(),
            label_delay_s: 0.4,
            label_window_s: 1.0,
            stop_distance_m: 0.85,
            max_retries: 3,
            flight_height_m: 1.2,
            tracking_margin_m: 0.02,
            obstacle_memory_s: 2.1,
            max_attempts: 3,
            geofence: None,
            view_rad: std::f64::consts::TAU,
            battery: None,
            zones: Zones::default(),
            vision: None,
        }
    }
}

impl MissionConfig {
    /// Checks the numbers that nobody else checks: each is finite, and positive or at least not negative.
    ///
    /// # Errors
    /// [`MissionError::Config`] with the name of the first one that is not.
    pub fn validate(&self) -> Result<(), MissionError> {
        let positive = [
            ("field_resolution_m", self.field_resolution_m),
            ("field_max_distance_m", self.field_max_distance_m),
            ("refresh_period_s", self.refresh_period_s),
            ("control_period_s", self.control_period_s),
            ("label_window_s", self.label_window_s),
            ("stop_distance_m", self.stop_distance_m),
            ("flight_height_m", self.flight_height_m),
            ("obstacle_memory_s", self.obstacle_memory_s),
            ("view_rad", self.view_rad),
            ("max_attempts", f64::from(self.max_attempts)),
        ];
        let not_negative = [
            ("first_look_s", self.first_look_s),
            ("reasoning_latency_s", self.reasoning_latency_s),
            ("decision_period_s", self.decision_period_s),
            ("close_look_s", self.close_look_s),
            ("label_delay_s", self.label_delay_s),
            ("tracking_margin_m", self.tracking_margin_m),
        ];
        if let Some((name, value)) = positive.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return Err(MissionError::Config { name, value, accepted: "a positive number" });
        }
        if let Some((name, value)) = not_negative.into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0)) {
            return Err(MissionError::Config { name, value, accepted: "a number that is not negative" });
        }
        if let Some((name, value)) = self.link.as_ref().and_then(LinkConfig::wrong) {
            let accepted =
                "a number that is not negative, a share from 0 to 1, or a longest time that is not below the shortest";
            return Err(MissionError::Config { name, value, accepted });
        }
        if let Some(battery) = &self.battery {
            battery.validate()?;
        }
        self.vision.as_ref().map_or(Ok(()), VisionConfig::validate)
    }
}

impl MissionConfig {
    /// Leaves parts of the method out.
    pub fn leave_out(&mut self, without: Ablation) {
        self.prompt.form = match (without.keeps(Part::Tiers), without.keeps(Part::Octants)) {
            (false, _) => PromptForm::WithoutTiers,
            (true, false) => PromptForm::WithoutOctants,
            (true, true) => self.prompt.form,
        };
        self.without = without;
    }

    /// Takes over what a rig says of the LiDAR's mount. The robot model must be fitted with the rig too ([`Rig::fitted`]).
    pub fn fit(&mut self, rig: &Rig) {
        if let OdometrySource::LidarInertial(lio) = &mut self.odometry {
            **lio = rig.odometry((**lio).clone());
        }
    }

    /// The track of the LiDAR's motor before its first reading; a fixed LiDAR has no encoder and stands at zero for ever.
    pub fn encoder_track(&self, robot: &RobotModel) -> EncoderTrack {
        match &self.odometry {
            _ if robot.sensors.lidar.rotation_hz == 0.0 => EncoderTrack::fixed(),
            OdometrySource::LidarInertial(lio) => EncoderTrack::rotating(lio.encoder_latency_s),
            OdometrySource::Stream => EncoderTrack::rotating(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_of_zero_is_refused_by_name() {
        MissionConfig::default().validate().unwrap();
        let broken = MissionConfig { refresh_period_s: 0.0, ..MissionConfig::default() };
        assert!(broken.validate().unwrap_err().to_string().contains("refresh_period_s"));
        let broken = MissionConfig { close_look_s: f64::NAN, ..MissionConfig::default() };
        assert!(broken.validate().unwrap_err().to_string().contains("close_look_s"));
    }
}
