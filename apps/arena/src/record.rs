//! A recording: the robot on a tour of a building, its sensors in a bag of ROS 2, and beside it masks, truth and tasks.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail};
use mission::omni_perception::{MaskedPanorama, Stamp};
use mission::robot_model::{GaitError, RobotModel};
use mission::stage_clock::{CpuScope, StageClock};
use mission::stream::SensorEvent;
use mission::tum::tum_line;
use nalgebra::{Isometry3, Point2};
use serde_json::{Value, json};

use crate::cli::word;
use crate::drift::DriftConfig;
use crate::pilot::{Pilot, PilotConfig};
use crate::record_topics::TopicWriter;
use crate::record_truth::{draw_tasks, masks_json, true_masks_json, write_building, write_tasks};
use crate::referee::Referee;
use crate::run::with_fixed_lidar;
use crate::run_folder::RunFolder;
use crate::scenario::{Scene, draw_start, robot_truth};
use crate::simulation::{Simulation, SimulationConfig};
use crate::tour::Tour;

/// File that says what a recording is, and that it is whole.
pub const RECORDING_MARK: &str = "recording.json";
/// Version of the layout of a recording's folder.
const VERSION: u32 = 1;
/// Period of the control loop.
const STEP_NS: i64 = 20_000_000;
/// Date of simulated time zero: 14 November 2023, so that stamps look like those of a robot.
pub const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

/// Settings of a recording.
#[derive(Debug, Clone, Default)]
pub struct RecordConfig {
    /// The world's side; its drift does not matter.
    pub simulation: SimulationConfig,
    /// How the tour is travelled.
    pub pilot: PilotConfig,
    /// The recording is cut here, if given.
    pub max_time_s: Option<f64>,
}

/// What a person may want to see while it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordProgress {
    /// Recorded time.
    pub sim_s: f64,
    /// Length of way done.
    pub done_m: f64,
    /// Length of the whole way.
    pub length_m: f64,
}

/// Records a tour of `scene` into `folder`, which is not yet published. Returns what [`RECORDING_MARK`] says.
///
/// # Errors
/// A robot that fits nowhere, a folder that cannot be written, an interruption by `stop`.
pub fn record(
    config: &RecordConfig,
    robot: &RobotModel,
    scene: &Scene,
    seed: u64,
    folder: &RunFolder,
    stop: &Arc<AtomicBool>,
    report: &mut dyn FnMut(RecordProgress),
) -> Result<Value> {
    let upright;
    let robot = if config.simulation.is_lidar_fixed {
        upright = with_fixed_lidar(robot);
        &upright
    } else {
        robot
    };
    let building = &scene.building;
    let truth = robot_truth(robot, config.pilot.flight_height_m);
    let referee = Referee::new(building, &scene.world, truth, 0);
    let start = draw_start(&referee, robot, seed)?;
    let start_at = Point2::from(start.translation.vector.xy());
    let tour = Tour::plan(referee.floor(), building, robot.circumscribed_radius_m, &start_at)
        .context("this robot fits nowhere in the building")?;
    let mut pilot = Pilot::new(config.pilot, robot, &tour, &start, referee.floor().floor_z_m);

    // Nobody steers by the odometry here, so it is the truth; it goes into no bag.
    let mut simulation_config = config.simulation.clone();
    simulation_config.drift = Some(DriftConfig { yaw_rad_per_m: 0.0, position_per_m: 0.0, ..DriftConfig::default() });
    let mut simulation = Simulation::new(&simulation_config, robot, scene, &start, &start, seed)?;
    let mut clock = StageClock::new(CpuScope::Thread);
    let mut recorder = Recorder {
        topics: TopicWriter::create(folder.path(), &robot.sensors, EPOCH_NS)?,
        folder,
        scene,
        body_from_imu: robot.sensors.body_from_imu,
        joints: joint_names(robot),
        trajectory: String::from("# t_s x y z qx qy qz qw: true pose of the IMU in the building, z up\n"),
        panoramas: 0,
        scans: 0,
    };
    let mut path_m = 0.0;
    let mut last = simulation.true_pose();
    let mut next_report_s = 0.0;
    let is_cut = loop {
        let now_s = simulation.seconds();
        let pose = simulation.true_pose();
        path_m += (pose.translation.vector - last.translation.vector).norm();
        last = pose;
        if pilot.is_over(now_s) {
            break false;
        }
        if config.max_time_s.is_some_and(|max_time_s| now_s >= max_time_s) {
            break true;
        }
        if stop.load(Ordering::Relaxed) {
            bail!("interrupted; nothing was kept");
        }
        if now_s >= next_report_s {
            next_report_s = now_s + 0.5;
            report(RecordProgress { sim_s: now_s, done_m: pilot.progress_m(), length_m: pilot.length_m() });
        }
        // A robot that is stuck would record for ever.
        if now_s > 60.0 + 10.0 * pilot.length_m() / config.pilot.speed_mps {
            bail!("the robot got stuck {:.1} m into a way of {:.1} m", pilot.progress_m(), pilot.length_m());
        }
        let command = pilot.command(now_s, STEP_NS as f64 * 1e-9, &pose);
        for event in simulation.advance(&command, STEP_NS, &mut clock)? {
            recorder.take(&event, &simulation)?;
        }
        recorder.legs(&simulation)?;
    };

    let Recorder { topics, trajectory, panoramas, scans, .. } = recorder;
    let written = topics.finish()?;
    folder.write("truth/trajectory.tum", trajectory.as_bytes())?;
    folder.write("truth/contacts.json", &serde_json::to_vec_pretty(simulation.touches())?)?;
    write_building(folder, building)?;
    let tasks = draw_tasks(&referee, building, &start_at, seed);
    write_tasks(folder, &tasks, building)?;
    let camera = simulation.camera();
    let topics: serde_json::Map<String, Value> = written
        .iter()
        .map(|(name, topic)| (name.clone(), json!({"type": topic.message_type, "messages": topic.messages})))
        .collect();
    let description = json!({
        "format": "omnivln-recording",
        "version": VERSION,
        "scene": scene.name,
        "seed": seed,
        "robot": word(robot.kind),
        "model": robot.name,
        "lidar": if config.simulation.is_lidar_fixed { "fixed" } else { "rotating" },
        "duration_s": simulation.seconds(),
        "is_cut": is_cut,
        "path_m": path_m,
        "tour_m": tour.length_m,
        "rooms": building.rooms.len(),
        "rooms_visited": if is_cut { Value::Null } else { json!(tour.rooms) },
        "objects": building.objects.len(),
        "touches": simulation.touches().len(),
        "legs": legs_json(&simulation),
        "scans": scans,
        "panoramas": panoramas,
        "tasks": tasks.len(),
        "epoch_ns": EPOCH_NS,
        "panorama": {
            "width_px": camera.width_px, "height_px": camera.height_px,
            "phi_top_rad": camera.phi_top_rad, "phi_bottom_rad": camera.phi_bottom_rad,
        },
        "topics": topics,
    });
    // Last: the mark of a whole recording.
    folder.write(RECORDING_MARK, &serde_json::to_vec_pretty(&description)?)?;
    Ok(description)
}

/// Names of the joints, in the order of their angles.
fn joint_names(robot: &RobotModel) -> Vec<String> {
    let joints = robot.tree.moving_joints().iter();
    joints.map(|joint| robot.tree.joints()[*joint].name.clone()).collect()
}

/// What the legs did: by how much at most a foot was where its leg could not reach, or why they did not move. Nothing without legs.
fn legs_json(simulation: &Simulation<'_>) -> Value {
    match simulation.legs() {
        Ok(legs) => json!({"worst_miss_m": legs.worst_miss_m()}),
        Err(GaitError::NoLegs { .. }) => Value::Null,
        Err(error) => json!({"still": error.to_string()}),
    }
}

/// Sends each event to where it belongs.
struct Recorder<'a> {
    topics: TopicWriter,
    folder: &'a RunFolder,
    scene: &'a Scene,
    body_from_imu: Isometry3<f64>,
    /// Names of the robot's joints.
    joints: Vec<String>,
    trajectory: String,
    panoramas: usize,
    scans: usize,
}

impl Recorder<'_> {
    fn take(&mut self, event: &SensorEvent, simulation: &Simulation<'_>) -> Result<()> {
        match event {
            SensorEvent::Imu(sample) => {
                let world_from_body = simulation.true_pose_at(sample.stamp);
                let date = sample.stamp.plus_ns(EPOCH_NS);
                self.trajectory.push_str(&tum_line(date, &(world_from_body * self.body_from_imu)));
                self.topics.imu(sample, &world_from_body)
            }
            SensorEvent::Encoder(sample) => self.topics.encoder(sample),
            SensorEvent::Scan(scan) => {
                self.scans += 1;
                // The scan comes with the tick in which it ended; its last point is a little older.
                let period_ns = simulation.scan_period_ns();
                self.topics.scan(scan, scan.start.plus_ns(period_ns))
            }
            SensorEvent::Panorama(panorama) => {
                self.panoramas += 1;
                self.topics.panorama(panorama)?;
                self.masks(panorama, simulation)
            }
            // A true pose in disguise: not for a bag. Nobody has asked for batteries in one.
            SensorEvent::Odometry(_) | SensorEvent::Battery(_) => Ok(()),
        }
    }

    /// How the joints stand now, if they move.
    fn legs(&mut self, simulation: &Simulation<'_>) -> Result<()> {
        match simulation.legs() {
            Ok(legs) => self.topics.joints(simulation.now(), &self.joints, legs.gait().angles()),
            Err(_) => Ok(()),
        }
    }

    fn masks(&self, panorama: &MaskedPanorama, simulation: &Simulation<'_>) -> Result<()> {
        let camera = simulation.camera();
        let size = (camera.width_px, camera.height_px);
        let date: Stamp = panorama.stamp.plus_ns(EPOCH_NS);
        let seen = masks_json(panorama, date, size);
        self.folder.write(&format!("masks/{}.json", date.0), &serde_json::to_vec(&seen)?)?;
        let instances = simulation.true_instances_at(panorama.stamp);
        let truth = true_masks_json(&instances, &self.scene.building, date, size)?;
        self.folder.write(&format!("truth/masks/{}.json", date.0), &serde_json::to_vec(&truth)?)
    }
}
