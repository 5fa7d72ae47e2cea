//! `omnivln bench patrol`: hours of errands in one building.

use std::process::ExitCode;

use anyhow::{Result, ensure};
use arena::cli::{load_robot, stop_at_ctrl_c};
use arena::mission::robot_model::RobotKind;
use arena::mission::stage_clock::CpuScope;
use arena::patrol::{Patrol, patrol};
use arena::progress::ProgressView;
use arena::run::RunConfig;
use arena::scenario::Scene;
use clap::Args;

use crate::bench::Robot;
use crate::memory::rss_mib;

/// Options of `bench patrol`.
#[derive(Debug, Args)]
pub struct PatrolOptions {
    /// The robot
    #[arg(long, value_enum, default_value = "ground")]
    robot: Robot,
    /// The building: a name or a number
    #[arg(long, default_value = "office", value_name = "NAME|SEED")]
    scene: String,
    /// Simulated hours
    #[arg(long, default_value_t = 2.0)]
    hours: f64,
    /// Seed of noise, start and errands
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Runs it and prints what grew.
pub fn run(options: &PatrolOptions) -> Result<ExitCode> {
    ensure!(
        options.hours.is_finite() && options.hours > 0.0 && options.hours <= 48.0,
        "--hours takes a number between 0 and 48, not {}",
        options.hours
    );
    let kind = RobotKind::from(options.robot);
    let robot = load_robot(None, kind)?;
    let scene = Scene::open(&options.scene, &robot)?;
    let stop = stop_at_ctrl_c()?;
    let duration_s = options.hours * 3600.0;
    let view = ProgressView::new(duration_s as u64, "{elapsed_precise} [{bar:30}] {pos}/{len} s {msg}", options.quiet);
    let config = RunConfig { cpu_scope: CpuScope::Thread, keeps_postures: false, ..RunConfig::default() };
    // One thread, so that its CPU seconds are those of the robot.
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let result = alone.install(|| {
        patrol(&config, &robot, &scene, options.seed, duration_s, &rss_mib, &stop, &mut |progress| {
            view.show(progress.sim_s as u64, &progress.activity, progress.is_news);
        })
    })?;
    view.finish();
    if options.json {
        arena::say!("{}", serde_json::to_string(&result)?);
    } else {
        print(&result);
    }
    Ok(ExitCode::SUCCESS)
}

fn print(result: &Patrol) {
    arena::say!(
        "{} robot, scene {}, {:.1} h simulated in {:.0} s: {} of {} errands right, {:.0} m, {} collisions",
        result.robot,
        result.scene,
        result.sim_s / 3600.0,
        result.wall_s,
        result.right,
        result.errands,
        result.path_m,
        result.collisions
    );
    result.failures.iter().for_each(|failure| arena::say!("  {failure}"));
    let times = &result.scan_to_command_ms;
    arena::say!("from a scan to the command: median {:.1} ms, p99 {:.1} ms of CPU time", times.median, times.p99);
    arena::say!("odometry: lost for {:.1} s, begun anew {} times", result.lost_s, result.odometry_resets);
    let mib = |mib: Option<f64>| mib.map_or("unknown".to_owned(), |mib| format!("{mib:.0} MiB"));
    let every = (result.memory.len() / 8).max(1);
    for sample in result.memory.iter().step_by(every) {
        arena::say!("  after {:5.0} s: {}, {} things known", sample.sim_s, mib(sample.rss_mib), sample.objects);
    }
    if let Some(growth) = result.growth_percent {
        arena::say!("memory grew by {growth:.1} % in the second half");
    }
}
