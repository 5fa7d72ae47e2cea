//! `omnivln record`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail, ensure};
use arena::cli::{load_robot, stop_at_ctrl_c};
use arena::dataset::make_dataset;
use arena::mission::robot_model::RobotKind;
use arena::options::LidarMount;
use arena::record::{RECORDING_MARK, RecordConfig, record};
use arena::run_folder::RunFolder;
use arena::scenario::Scene;
use clap::Args;
use serde_json::Value;

use crate::bench::Robot;

/// Options of `record`.
#[derive(Debug, Args)]
#[command(
    after_help = "The folder is a bag of ROS 2 (metadata.yaml and an MCAP file) that kiss-icp, rko_lio and genz-lio read as it \
is, and beside the bag masks/, tasks/ and truth/. With --dataset it holds many such folders and index.json. docs/dataset.md describes both."
)]
pub struct RecordOptions {
    /// The building: a name (flat, office, corridor, narrow-door, spin), a number, the seed of a generated building, or a file: a floor
    /// plan (FILE.png, 5 cm a pixel, white is free; FILE.png#7 for other rooms of it, #7,shuffled or #7,uniform for other furniture), or a
    /// scene with named objects (.obj, .gltf, .glb)
    #[arg(long, value_name = "NAME|SEED|FILE", default_value = "flat", conflicts_with = "dataset")]
    scene: String,
    /// Folder to write; an earlier recording there is replaced once this one is complete
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The robot that carries the sensors (of a dataset both take turns)
    #[arg(long, value_enum, default_value_t = Robot::Ground, conflicts_with = "dataset")]
    robot: Robot,
    /// Robot to use instead of the built-in one; FILE.toml beside it carries what URDF cannot
    #[arg(long, value_name = "FILE", conflicts_with = "dataset")]
    urdf: Option<PathBuf>,
    /// Mount of the LiDAR
    #[arg(long, value_enum, default_value_t = LidarMount::Rotating)]
    lidar: LidarMount,
    /// Seed of start pose, noise and tasks; with --dataset of everything
    #[arg(long, default_value_t = 1, value_name = "S")]
    seed: u64,
    /// Make N recordings, each in a building of its own, split by building into train, val and test
    #[arg(long, value_name = "N")]
    dataset: Option<usize>,
    /// Cut a recording after so many seconds; by default it lasts until every room was visited
    #[arg(long, value_name = "SECONDS")]
    max_time: Option<f64>,
    /// Print one JSON object: what recording.json or index.json says
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Records and says what was recorded.
pub fn run(options: &RecordOptions) -> Result<ExitCode> {
    if let Some(max_time_s) = options.max_time {
        ensure!(
            max_time_s.is_finite() && max_time_s > 0.0,
            "--max-time must be a positive number of seconds, not {max_time_s}"
        );
    }
    let mut config = RecordConfig { max_time_s: options.max_time, ..RecordConfig::default() };
    config.simulation.is_lidar_fixed = options.lidar == LidarMount::Fixed;
    let description = match options.dataset {
        Some(count) => dataset(options, &config, count)?,
        None => single(options, &config)?,
    };
    if options.json {
        arena::say!("{description}");
    } else {
        say(options, &description);
    }
    Ok(ExitCode::SUCCESS)
}

fn single(options: &RecordOptions, config: &RecordConfig) -> Result<Value> {
    let kind = RobotKind::from(options.robot);
    let robot = load_robot(options.urdf.as_deref(), kind)?;
    let scene = Scene::open(&options.scene, &robot)?;
    let folder = RunFolder::marked(&options.out, RECORDING_MARK, "recording")?;
    let stop = stop_at_ctrl_c()?;
    let mut next_s = 0.0;
    let description = record(config, &robot, &scene, options.seed, &folder, &stop, &mut |progress| {
        if !options.quiet && progress.sim_s >= next_s {
            next_s = progress.sim_s + 5.0;
            eprintln!("t {:5.1} s | {:.1} of {:.1} m", progress.sim_s, progress.done_m, progress.length_m);
        }
    })?;
    folder.publish()?;
    Ok(description)
}

fn dataset(options: &RecordOptions, config: &RecordConfig, count: usize) -> Result<Value> {
    if count > 100_000 {
        bail!("--dataset {count}: at most 100000 recordings at once");
    }
    let stop = stop_at_ctrl_c()?;
    let mut next = (0, 0.0);
    make_dataset(&options.out, count, options.seed, config, &stop, &mut |number, entry, progress| {
        if !options.quiet && (number, progress.sim_s) >= next {
            next = (number, progress.sim_s + 10.0);
            let folder = entry.folder(number);
            eprintln!("{folder} | t {:5.1} s | {:.1} of {:.1} m", progress.sim_s, progress.done_m, progress.length_m);
        }
    })
}

fn say(options: &RecordOptions, description: &Value) {
    let out = options.out.display();
    match description["recordings"].as_array() {
        Some(recordings) => arena::say!("{} recordings in {out}, described in {out}/index.json", recordings.len()),
        None => arena::say!(
            "{:.1} s and {:.1} m through {} rooms: {} scans, {} panoramas, {} tasks in {out}",
            description["duration_s"].as_f64().unwrap_or(0.0),
            description["path_m"].as_f64().unwrap_or(0.0),
            description["rooms"],
            description["scans"],
            description["panoramas"],
            description["tasks"],
        ),
    }
}
