//! `omnivln bench nav` and `bench coverage`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use arena::bench_coverage::{BenchCoverage, Coverage, bench_coverage};
use arena::bench_nav::{BenchNav, bench_nav};
use arena::cli::{load_robot, stop_at_ctrl_c};
use arena::mission::robot_model::RobotKind;
use arena::run::RunConfig;
use clap::{Args, ValueEnum};

/// Which robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Robot {
    /// The quadruped.
    Ground,
    /// The quadrotor.
    Aerial,
}

impl From<Robot> for RobotKind {
    fn from(robot: Robot) -> RobotKind {
        match robot {
            Robot::Ground => RobotKind::Ground,
            Robot::Aerial => RobotKind::Aerial,
        }
    }
}

/// Options of `bench nav`.
#[derive(Debug, Args)]
pub struct NavOptions {
    /// The robot
    #[arg(long, value_enum)]
    robot: Robot,
    /// Number of buildings, one instruction each
    #[arg(long, default_value_t = 20)]
    scenes: usize,
    /// Run only these of the scenes, to look at some again
    #[arg(long, value_delimiter = ',', value_name = "INDEX")]
    only: Vec<usize>,
    /// Seed from which buildings, instructions and starts are drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Another robot model
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Factor on what the segmenter gets wrong
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    noise: f64,
    /// Keep every run folder below DIR
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Give up after so many seconds of simulated time
    #[arg(long, default_value_t = 600.0)]
    max_time: f64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Runs the bench and prints its table or its JSON.
pub fn nav(options: &NavOptions) -> Result<ExitCode> {
    let kind = RobotKind::from(options.robot);
    anyhow::ensure!(options.scenes > 0, "--scenes must be at least 1");
    anyhow::ensure!(
        options.noise.is_finite() && options.noise >= 0.0,
        "--noise must be a number that is not negative, not {}",
        options.noise
    );
    anyhow::ensure!(
        options.max_time.is_finite() && options.max_time > 0.0,
        "--max-time must be a positive number of seconds, not {}",
        options.max_time
    );
    let robot = load_robot(options.urdf.as_deref(), kind)?;
    let mut config = RunConfig { max_time_s: options.max_time, ..RunConfig::default() };
    config.simulation.segmenter.noise_scale = options.noise;
    let stop = stop_at_ctrl_c()?;
    let all: Vec<usize> = (0..options.scenes).collect();
    let indices = if options.only.is_empty() { &all } else { &options.only };
    if let Some(index) = indices.iter().find(|index| **index >= options.scenes) {
        anyhow::bail!("--only {index}: there are {} scenes, numbered from 0", options.scenes);
    }
    let result =
        bench_nav(&robot, kind, indices, options.seed, &config, options.keep.as_deref(), options.quiet, &stop)?;
    if options.json {
        arena::say!("{}", serde_json::to_string(&result)?);
    } else {
        print_table(indices, &result);
    }
    Ok(ExitCode::SUCCESS)
}

fn print_table(indices: &[usize], result: &BenchNav) {
    arena::say!("run  ok   path m  short m   spl  sim s  wall s  dec  tokens  hits  scene       instruction / reason");
    for (index, run) in indices.iter().zip(&result.runs) {
        arena::say!(
            "{index:3}  {:3} {:7.1} {:8} {:5.2} {:6.0} {:7.0} {:4} {:7} {:5}  {:10}  \"{}\"{}",
            if run.success { "yes" } else { "NO" },
            run.path_m,
            run.shortest_m.map_or("-".to_owned(), |m| format!("{m:.1}")),
            run.spl,
            run.sim_s,
            run.wall_s,
            run.decisions,
            run.prompt_tokens,
            run.collisions,
            run.scene,
            run.instruction,
            if run.success { String::new() } else { format!("\n     -> {}", run.reason) },
        );
    }
    let drawn = &result.drawn;
    arena::say!(
        "\ndrawn: rooms {:?}; kinds {}; target hidden at the start {:.0} %; rival of the class {:.0} %; median shortest way {:.1} m",
        drawn.rooms,
        drawn.kinds.iter().map(|(kind, share)| format!("{kind} {:.0} %", share * 100.0)).collect::<Vec<_>>().join(", "),
        drawn.target_hidden * 100.0,
        drawn.rival_exists * 100.0,
        drawn.shortest_median_m
    );
    arena::say!(
        "{} of {} right ({:.0} %), mean SPL {:.2}, {} collisions, {:.1}x real time, {:.0} s on the wall",
        result.runs.iter().filter(|run| run.success).count(),
        result.runs.len(),
        result.success_rate * 100.0,
        result.spl_mean,
        result.collisions,
        result.realtime_factor,
        result.wall_s
    );
}

/// Options of `bench coverage`.
#[derive(Debug, Args)]
pub struct CoverageOptions {
    /// Number of buildings, each surveyed with both mounts
    #[arg(long, default_value_t = 10)]
    seeds: usize,
    /// Seed of the first building; the others follow
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Runs the bench and prints its table or its JSON.
pub fn coverage(options: &CoverageOptions) -> Result<ExitCode> {
    anyhow::ensure!(options.seeds > 0, "--seeds must be at least 1");
    let robot = load_robot(None, RobotKind::Ground)?;
    let stop = stop_at_ctrl_c()?;
    let result = bench_coverage(&robot, options.seed, options.seeds, &RunConfig::default(), options.quiet, &stop)?;
    if options.json {
        arena::say!("{}", serde_json::to_string(&result)?);
    } else {
        print_coverage(&result);
    }
    Ok(ExitCode::SUCCESS)
}

fn print_coverage(result: &BenchCoverage) {
    let row = |name: &str, mount: &str, c: &Coverage| {
        arena::say!(
            "{name:>8}  {mount:9} {:9.3} {:7.3} {:6.3} {:12.3} {:11.3} {:9.1} {:8.1}",
            c.precision,
            c.recall,
            c.f1,
            c.solid_angle_fraction,
            c.map_recall,
            c.known_after_s,
            c.objects
        );
    };
    arena::say!("    seed  mount     precision  recall     F1  solid angle  map recall  known s  objects");
    for seed in &result.seeds {
        row(&seed.seed.to_string(), "rotating", &seed.rotating);
        row("", "fixed", &seed.fixed);
    }
    row("mean", "rotating", &result.mean.rotating);
    row("", "fixed", &result.mean.fixed);
    row("std", "rotating", &result.std.rotating);
    row("", "fixed", &result.std.fixed);
}
