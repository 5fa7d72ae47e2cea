//! A recording with the trajectory of its IMU: scans are straightened on it, with the motor's angle at each point's time.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Result;
use arena::mission::omni_perception::Stamp;
use arena::mission::posed_scans::{PosedScanError, PosedScans};
use arena::mission::recording::{self, RecordingOptions};
use arena::mission::tum::read_tum;
use nalgebra::Isometry3;

use super::{FuseOptions, PosedScan, Scans};

/// What is known before the first scan is read.
pub struct PosedRecording {
    path: PathBuf,
    options: RecordingOptions,
    encoder_latency_s: f64,
    imu_poses: Vec<(Stamp, Isometry3<f64>)>,
}

impl PosedRecording {
    /// Reads the trajectory and the rig; the recording is opened with its first scan.
    pub fn open(options: &FuseOptions, trajectory: &Path) -> Result<PosedRecording> {
        let rig = options.recording.rig(None)?;
        Ok(PosedRecording {
            path: options.scans.clone(),
            options: options.recording.options(rig.as_ref()),
            encoder_latency_s: rig.map_or(0.0, |rig| rig.lidar.encoder_latency_s),
            imu_poses: read_tum(trajectory)?,
        })
    }

    /// Scan after scan. What could not be used is counted, and told at the end.
    pub fn scans(&self) -> Result<Scans> {
        let recording = recording::open_with(&self.path, &self.options)?;
        let mut scans = PosedScans::new(recording.events, &recording.rig, self.encoder_latency_s, &self.imu_poses)?;
        let mut lost: BTreeMap<&str, usize> = BTreeMap::new();
        let mut count = 0;
        Ok(Box::new(std::iter::from_fn(move || {
            for scan in scans.by_ref() {
                match scan {
                    Ok(scan) => {
                        count += 1;
                        return Some(Ok(PosedScan {
                            name: format!("scan {count} at {}", scan.stamp),
                            origin: scan.sensor_origin_in_world(),
                            points: scan.points_in_world(),
                            labelled: Vec::new(),
                            skipped: scan.dropped.non_finite + scan.dropped.outside_time,
                        }));
                    }
                    Err(PosedScanError::NoPose(_)) => *lost.entry("scans_without_poses").or_default() += 1,
                    Err(PosedScanError::Encoder(_)) => *lost.entry("encoder_readings_unusable").or_default() += 1,
                    Err(PosedScanError::Recording(error)) => *lost.entry(error.loss()).or_default() += error.count(),
                }
            }
            for (reason, count) in std::mem::take(&mut lost) {
                eprintln!("left out: {count} times {}", reason.replace('_', " "));
            }
            None
        })))
    }
}
