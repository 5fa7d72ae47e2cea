//! What both robots do with their command line: open the scene, run, tell the person, leave the right exit code.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail};
use clap::Parser;
use mission::rig::{BUILTIN_RIGS, Rig, builtin_rig};
use mission::robot_model::{RobotKind, RobotModel, builtin_toml, mesh_candidates};
use mission::zones::{ZoneFrame, Zones, ZonesError};

use crate::instructions::Answers;
use crate::options::Options;
use crate::orders::Orders;
use crate::progress::Progress;
use crate::progress::ProgressView;
use crate::run::{RunConfig, Setup, run};
use crate::run_folder::RunFolder;
use crate::run_setup::{Prepared, RUN_FILE, RunFile, prepare};
use crate::scenario::{Scene, draw_start, robot_truth};
use crate::task::Task;
use crate::vehicle::Vehicle;
use crate::write_run::write_run;

/// Whole program of a reference robot. `default_scene` is the named scene used without `--scene`.
pub fn robot_main(kind: RobotKind, default_scene: &str) -> ExitCode {
    // Clap itself exits with 2 for bad usage and 0 for --help.
    let options = Options::parse();
    match command(&options, kind, default_scene) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Whether the run was a success.
fn command(options: &Options, kind: RobotKind, default_scene: &str) -> Result<bool> {
    options.validate()?;
    options.flight.check(kind)?;
    let Prepared { robot, mut config, known } = prepare(options, kind)?;
    let scene_name = options.scene.clone().unwrap_or_else(|| default_scene.to_owned());
    let out = options.out.clone().unwrap_or_else(|| {
        // Of a file its name without folders.
        let scene = scene_name.rsplit(['/', '\\']).next().unwrap_or_default();
        PathBuf::from("runs").join(format!("{}-{scene}-{}", word(kind), options.seed))
    });
    let scene = Scene::open(&scene_name, &robot)?;
    let task = Task::read(&options.instruction, &scene.building)?;
    let start = match (&options.known, &options.start) {
        (Some(known), Some(pose)) => crate::frame::start_in_known_map(known, pose, &robot)?,
        _ => {
            let referee = crate::referee::Referee::new(
                &scene.building,
                &scene.world,
                robot_truth(&robot, config.mission.flight_height_m),
                0,
            );
            draw_start(&referee, &robot, options.seed)?
        }
    };

    let stop = stop_at_ctrl_c()?;
    let answers = options.answers.as_deref().map(Answers::open).transpose()?.unwrap_or_default();
    let answers = answers.about(&scene_name, &options.instruction);
    let orders = Orders::open(options.commands.as_deref(), options.quiet)?.with_answers(answers);
    let mut vehicle = open_vehicle(options, &robot, &start, &stop, &mut config)?;

    // Everything that can be refused has been: only now is anything written.
    let folder = RunFolder::new(&out)?;
    if options.record {
        let file = RunFile::of_this_program(kind, &options.instruction)?;
        folder.write(RUN_FILE, &serde_json::to_vec_pretty(&file)?)?;
        config.events_to = Some(folder.path().join("events.bin"));
    }
    let view = ProgressView::new(config.max_time_s as u64, "{elapsed_precise} {spinner} {wide_msg}", options.quiet);
    // An error ends the run here; the vehicle, dropped, lands or lies down.
    let setup = Setup {
        config: &config,
        robot: &robot,
        scene: &scene,
        task: &task,
        start: &start,
        known,
        seed: options.seed,
        vehicle: vehicle.as_deref_mut(),
        orders,
    };
    let result = run(setup, &stop, &mut |progress| show(&view, progress))?;
    view.finish();

    write_run(&folder, &result, &scene)?;
    let path = folder.publish()?;
    let summary = &result.summary;
    crate::say!("{}", summary.reason);
    if let Some(error) = &summary.segmenter_error {
        eprintln!("{} of {} pictures have no masks; last: {error}", summary.images_without_masks, summary.images);
    }
    if !options.quiet {
        crate::say!(
            "{} in {:.1} s of simulated time, {:.1} m of way (shortest {}), {} decisions, {} prompt tokens, {} collisions.",
            if summary.success { "Success" } else { "No success" },
            summary.sim_s,
            summary.path_m,
            summary.shortest_m.map_or("none".to_owned(), |m| format!("{m:.1} m")),
            summary.decisions,
            summary.prompt_tokens,
            summary.collisions,
        );
        if let Some(vehicle) = &vehicle {
            crate::say!("It was {}.", vehicle.account());
        }
        crate::say!("Look at {}", path.join("report.html").display());
    }
    Ok(summary.success)
}

/// What moves in place of the simulated body, if the command line names something; ready to go, at `start`.
#[allow(unused_variables)] // without features nobody but the simulation moves the body
fn open_vehicle(
    options: &Options,
    robot: &RobotModel,
    start: &nalgebra::Isometry3<f64>,
    stop: &Arc<AtomicBool>,
    config: &mut RunConfig,
) -> Result<Option<Box<dyn Vehicle>>> {
    #[cfg(feature = "px4")]
    if let Some(px4) = crate::px4_vehicle::Px4Vehicle::open(&options.px4, robot, start, stop)? {
        config.mission.tracking_margin_m = crate::px4_vehicle::TRACKING_MARGIN_M;
        return Ok(Some(Box::new(px4)));
    }
    #[cfg(feature = "unitree")]
    if let Some(dog) = crate::unitree_vehicle::UnitreeVehicle::open(&options.unitree, robot, start, stop)? {
        return Ok(Some(Box::new(dog)));
    }
    Ok(None)
}

/// The word in summaries and folder names.
pub fn word(kind: RobotKind) -> &'static str {
    match kind {
        RobotKind::Ground => "ground",
        RobotKind::Aerial => "aerial",
    }
}

/// The built-in robot of a kind, or the one in a URDF with its TOML: beside the file, or ours for robots we know.
pub fn load_robot(urdf: Option<&std::path::Path>, kind: RobotKind) -> Result<RobotModel> {
    let Some(urdf) = urdf else {
        return Ok(match kind {
            RobotKind::Ground => RobotModel::builtin_quadruped(),
            RobotKind::Aerial => RobotModel::builtin_quadrotor(),
        });
    };
    let text = std::fs::read_to_string(urdf).with_context(|| format!("reading the URDF {}", urdf.display()))?;
    let beside = urdf.with_extension("toml");
    let toml = if beside.is_file() {
        std::fs::read_to_string(&beside).with_context(|| format!("reading {}", beside.display()))?
    } else {
        let name = mission::robot_model::robot_name(&text).unwrap_or_default();
        builtin_toml(&name).unwrap_or("").to_owned()
    };
    let urdf = &std::path::absolute(urdf).with_context(|| format!("finding the folder of {}", urdf.display()))?;
    let folder = urdf.parent().unwrap_or(std::path::Path::new("/"));
    let read_mesh = |file: &str| mesh_candidates(file, folder).into_iter().find_map(|path| std::fs::read(path).ok());
    let robot = RobotModel::parse(&text, &toml, &read_mesh).with_context(|| {
        format!("loading the robot {} (what URDF cannot carry is read from {})", urdf.display(), beside.display())
    })?;
    if robot.kind != kind {
        let (own, wanted) = (word(robot.kind), word(kind));
        let n = if robot.kind == RobotKind::Aerial { "n" } else { "" };
        bail!(
            "{} is the model of a{n} {own} robot; this program is for {wanted} robots: use omnivln-{own}, or --robot {own} where there is that option",
            urdf.display(),
        );
    }
    Ok(robot)
}

/// The rig of a file, or one that ships with the program, if the simulator can play it.
///
/// # Errors
/// A sentence that says what is wrong with the file, or with playing it.
pub fn load_rig(rig: &std::path::Path, robot: &RobotModel) -> Result<Rig> {
    let parsed = read_rig(rig, Some(robot))?;
    crate::surround::check(&parsed).with_context(|| format!("simulating the rig {}", rig.display()))?;
    Ok(parsed)
}

/// The rig of a file, or one that ships with the program; files win over names. Without a robot its poses are relative to
/// the body.
///
/// # Errors
/// A sentence that says what is wrong with the file.
pub fn read_rig(rig: &std::path::Path, robot: Option<&RobotModel>) -> Result<Rig> {
    let folder = rig.parent().unwrap_or(std::path::Path::new("."));
    let read_file = |name: &str| std::fs::read_to_string(folder.join(name));
    let shipped = rig.to_str().and_then(builtin_rig).filter(|_| !rig.exists());
    let text = match shipped {
        Some(text) => text.to_owned(),
        None => std::fs::read_to_string(rig).with_context(|| {
            let names: Vec<&str> = BUILTIN_RIGS.iter().map(|(name, _)| *name).collect();
            format!("reading the rig {} ({} need no file)", rig.display(), names.join(", "))
        })?,
    };
    Rig::parse(&text, robot, &read_file).with_context(|| format!("reading the rig {}", rig.display()))
}

/// Zones from a file, in which the robot does not start.
///
/// # Errors
/// A sentence that says what is wrong, and where in the file.
pub(crate) fn read_zones(path: &std::path::Path, options: &Options, robot: &RobotModel) -> Result<Zones> {
    const LARGEST: u64 = 1 << 20;
    let size = std::fs::metadata(path)?.len();
    if size > LARGEST {
        bail!("the file has {size} bytes; at most {LARGEST} are read");
    }
    let zones = Zones::parse(&std::fs::read_to_string(path)?)?;
    match (zones.frame, &options.known, &options.start) {
        (ZoneFrame::Map, None, _) => return Err(ZonesError::NoMap.into()),
        (ZoneFrame::Map, Some(_), Some(pose)) => {
            zones.check_start(&robot.footprint, &crate::frame::pose_in_map(pose))?
        }
        (ZoneFrame::Map, Some(_), None) => {} // nobody knows yet where it stands
        (ZoneFrame::Start, ..) => zones.check_start(&robot.footprint, &nalgebra::Isometry3::identity())?,
    }
    Ok(zones)
}

/// One line: when, what, how much is known, how far to go.
fn show(view: &ProgressView, progress: &Progress) {
    let line = format!(
        "t {:5.1} s | {} | {} rooms, {} objects | {} decisions | {:.1} m to go",
        progress.sim_s, progress.activity, progress.rooms, progress.objects, progress.decisions, progress.left_m
    );
    view.show(progress.sim_s as u64, &line, progress.is_news);
}

/// A flag that Ctrl-C sets.
///
/// # Errors
/// If somebody else listens already.
pub fn stop_at_ctrl_c() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let on_signal = Arc::clone(&stop);
    ctrlc::set_handler(move || on_signal.store(true, Ordering::Relaxed)).context("listening for Ctrl-C")?;
    Ok(stop)
}
