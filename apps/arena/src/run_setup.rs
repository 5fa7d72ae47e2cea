//! What a run was asked for, written into its folder, and the robot's side made of it again.

use std::path::Path;

use anyhow::{Context, Result, bail};
use clap::Parser;
use mission::archive::Known;
use mission::config::MissionConfig;
use mission::omni_perception::{Equirectangular, Stamp};
use mission::rig::Rig;
use mission::robot_model::{RobotKind, RobotModel};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::cli::{load_rig, load_robot, read_zones, word};
use crate::frame::pose_in_map;
use crate::options::Options;
use crate::run::RunConfig;
use crate::simulation::SimulationConfig;

/// Its file in a run folder.
pub const RUN_FILE: &str = "run.json";
/// Version of its layout.
const VERSION: u32 = 1;

/// How a run was started.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunFile {
    version: u32,
    /// `ground` or `aerial`.
    robot: String,
    /// The folder in which the files of the arguments were found.
    folder: String,
    /// The command line after the program's name.
    arguments: Vec<String>,
    /// What the robot heard first.
    pub instruction: String,
    start_ns: i64,
}

/// The robot's side of a run, ready to begin.
pub struct RobotSide {
    /// What the command line said.
    pub options: Options,
    /// The robot, fitted with its rig.
    pub robot: RobotModel,
    /// Its settings.
    pub mission: MissionConfig,
    /// The panorama of its stream.
    pub camera: Equirectangular,
    /// What it knew of the building.
    pub known: Option<Known>,
    /// Where its odometry began.
    pub start_in_map: Isometry3<f64>,
}

/// Everything that a command line decides about both sides, scene and start aside.
pub struct Prepared {
    /// The robot, fitted with its rig.
    pub robot: RobotModel,
    /// Settings.
    pub config: RunConfig,
    /// What it knows of the building.
    pub known: Option<Known>,
}

/// Loads what the options name.
///
/// # Errors
/// A file that cannot be read, by name.
pub fn prepare(options: &Options, kind: RobotKind) -> Result<Prepared> {
    let mut robot = load_robot(options.urdf.as_deref(), kind)?;
    let rig: Option<Rig> = options.rig.as_deref().map(|rig| load_rig(rig, &robot)).transpose()?;
    if let Some(rig) = &rig {
        robot = rig.fitted(&robot);
    }
    let mut known = options.known.as_deref().map(mission::archive::load).transpose()?;
    if let (Some(known), Some(pose)) = (&mut known, &options.start) {
        // Whatever height was given, the robot stands on the floor of the map.
        let mut start = pose_in_map(pose);
        start.translation.vector.z = known.floor_m + robot.stance_height_m;
        known.start = Some(start);
    }
    let mut config = RunConfig::new(options);
    if let Some(rig) = rig {
        config.carry(rig);
    }
    if let Some(path) = &options.synonyms {
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        config.mission.label_names.add_table(&text).with_context(|| format!("reading {}", path.display()))?;
    }
    if let Some(path) = &options.zones {
        config.mission.zones =
            read_zones(path, options, &robot).with_context(|| format!("reading the zones {}", path.display()))?;
        config.truth_from_known = options
            .known
            .as_deref()
            .and_then(|known| crate::frame::frame_of(known).ok())
            .map(|frame| frame.truth_from_map());
    }
    Ok(Prepared { robot, config, known })
}

impl RunFile {
    /// Of this program's own command line.
    ///
    /// # Errors
    /// If the present folder has no name.
    pub fn of_this_program(kind: RobotKind, instruction: &str) -> Result<RunFile> {
        Ok(RunFile {
            version: VERSION,
            robot: word(kind).to_owned(),
            folder: std::env::current_dir().context("finding the present folder")?.to_string_lossy().into_owned(),
            arguments: std::env::args().skip(1).collect(),
            instruction: instruction.to_owned(),
            start_ns: 0,
        })
    }

    /// When the mission began.
    pub fn start(&self) -> Stamp {
        Stamp(self.start_ns)
    }

    /// Reads one.
    ///
    /// # Errors
    /// A file that is not there, or of another version.
    pub fn read(path: &Path) -> Result<RunFile> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("reading {}; a run that can be replayed is run with --record", path.display()))?;
        let file: RunFile = serde_json::from_str(&text).with_context(|| format!("reading {}", path.display()))?;
        if file.version != VERSION {
            bail!("{} has version {}; this program reads version {VERSION}", path.display(), file.version);
        }
        Ok(file)
    }
}

/// The robot's side as it was when the run began. Files that its command line names have to be where they were.
///
/// # Errors
/// Arguments that this program does not know, and files that are gone.
pub fn robot_side(file: &RunFile) -> Result<RobotSide> {
    let kind = match file.robot.as_str() {
        "ground" => RobotKind::Ground,
        "aerial" => RobotKind::Aerial,
        other => bail!("run.json: \"{other}\" is neither ground nor aerial"),
    };
    let arguments = std::iter::once(file.robot.clone()).chain(file.arguments.iter().cloned());
    let mut options = Options::try_parse_from(arguments).context("run.json: the command line of the run")?;
    options.settle_in(Path::new(&file.folder));
    let Prepared { robot, config, known } = prepare(&options, kind)?;
    let robot = match config.simulation.is_lidar_fixed {
        true => crate::run::with_fixed_lidar(&robot),
        false => robot,
    };
    let start_in_map = crate::run::start_in_map(known.as_ref(), &robot);
    let camera = camera_of(&config.simulation);
    Ok(RobotSide { options, robot, mission: config.mission, camera, known, start_in_map })
}

/// The panorama that a simulation with these settings carries.
pub fn camera_of(simulation: &SimulationConfig) -> Equirectangular {
    let mut simulation = simulation.clone();
    if let Some(rig) = simulation.rig.clone() {
        simulation.carry(&rig);
    }
    let camera = &simulation.panorama;
    Equirectangular {
        width_px: camera.width,
        height_px: camera.height,
        phi_top_rad: camera.phi_top_rad,
        phi_bottom_rad: camera.phi_bottom_rad,
    }
}
