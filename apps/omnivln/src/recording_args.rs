//! What the subcommands that read a recording may be told about it.

use std::path::PathBuf;

use anyhow::Result;
use arena::cli::read_rig;
use arena::mission::recording::RecordingOptions;
use arena::mission::rig::Rig;
use arena::mission::robot_model::RobotModel;
use clap::Args;

/// Rig and topics.
#[derive(Debug, Args)]
pub struct RecordingArgs {
    /// Where the sensors sit, as a rig file (see apps/mission/rigs), for recordings that do not say it, or say it wrong
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Topic of the scans in a bag, where there are several
    #[arg(long, value_name = "TOPIC")]
    points: Option<String>,
    /// Topic of the IMU
    #[arg(long, value_name = "TOPIC")]
    imu: Option<String>,
    /// Topic of the motor's angle
    #[arg(long, value_name = "TOPIC")]
    encoder: Option<String>,
}

impl RecordingArgs {
    /// The rig of the file. Without a robot its poses are relative to the body.
    pub fn rig(&self, robot: Option<&RobotModel>) -> Result<Option<Rig>> {
        self.rig.as_ref().map(|path| read_rig(path, robot)).transpose()
    }

    /// Whether nothing was told.
    pub fn is_empty(&self) -> bool {
        self.rig.is_none() && self.points.is_none() && self.imu.is_none() && self.encoder.is_none()
    }

    /// How to read the recording; without its images.
    pub fn options(&self, rig: Option<&Rig>) -> RecordingOptions {
        RecordingOptions {
            points_topic: self.points.clone(),
            imu_topic: self.imu.clone(),
            encoder_topic: self.encoder.clone(),
            rig: rig.map(Rig::recorded),
            are_images_needed: false,
            ..RecordingOptions::default()
        }
    }
}
