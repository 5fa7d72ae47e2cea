//! `omnivln odometry RECORDING --out TUM`: the trajectory of a recording.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail, ensure};
use arena::mission::odometry_run::OdometryRun;
use arena::mission::omni_perception::LioConfig;
use arena::mission::recording::{self, RecordingError};
use arena::mission::tum::tum_line;
use arena::whole_file::write_whole;
use clap::Args;
use serde_json::{Value, json};

use crate::memory::peak_rss_mib;
use crate::recording_args::RecordingArgs;
use arena::quantile::quantile;

/// Options of `odometry`.
#[derive(Debug, Args)]
pub struct OdometryOptions {
    /// A bag of ROS 2 (folder or .mcap), or a folder with meta.json, imu.csv, motor.csv and scans/
    recording: PathBuf,
    /// Where to write the trajectory: one line "t x y z qx qy qz qw" per scan, the pose of the IMU in a level world at
    /// the time of the scan's last point
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    about: RecordingArgs,
    /// Where to keep the map
    #[arg(long, value_name = "FILE")]
    map_out: Option<PathBuf>,
    /// Threads; the result is the same to the bit
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    threads: u32,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Warnings of one kind that are printed; the rest is counted.
const MOST_WARNINGS: usize = 3;

/// Runs the odometry over the recording.
pub fn run(options: &OdometryOptions) -> Result<ExitCode> {
    let rig = options.about.rig(None)?;
    let recording = recording::open_with(&options.recording, &options.about.options(rig.as_ref()))?;
    let config = LioConfig { threads: options.threads as usize, ..LioConfig::default() };
    let config = rig.as_ref().map_or(config.clone(), |rig| rig.odometry(config));
    let mut run = OdometryRun::new(&recording.rig, config)?;
    let body_from_imu = recording.rig.body_from_imu;
    let mut trajectory = String::new();
    let mut warned: BTreeMap<&str, usize> = BTreeMap::new();
    let before_mib = peak_rss_mib();
    for event in recording.events {
        if let Err(error) = &event {
            let count = warned.entry(error.loss()).or_default();
            *count += 1;
            match *count {
                ..=MOST_WARNINGS => eprintln!("warning: {}", with_causes(error)),
                count if count == MOST_WARNINGS + 1 => eprintln!("warning: more of these are only counted"),
                _ => (),
            }
        }
        run.push(event, |_, estimate| {
            if let Some(estimate) = estimate {
                trajectory += &tum_line(estimate.stamp, &(estimate.world_from_body * body_from_imu));
            }
        });
    }
    run.finish();
    let growth_mib = before_mib.zip(peak_rss_mib()).map(|(before, after)| after - before);
    ensure!(run.scans > 0, "{} holds no scans", options.recording.display());
    let tracked = run.scans_tracked();
    if tracked == 0 {
        let left_out: Vec<String> = run.dropped.iter().map(|(reason, count)| format!("{reason}: {count}")).collect();
        let left_out = if left_out.is_empty() { "nothing".to_owned() } else { left_out.join(", ") };
        bail!(
            "not one of {} scans of {} could be followed (left out: {left_out}); the filter needs half a second at rest, \
             or half a second of scans and an IMU in rad/s and m/s^2 (or g), with clocks that agree",
            run.scans,
            options.recording.display()
        );
    }
    write_whole(&options.out, |out| out.write_all(trajectory.as_bytes()))?;
    if let Some(path) = &options.map_out {
        write_whole(path, |out| run.odometry.map().write(out))?;
    }

    if options.json {
        arena::say!("{}", summary(&run, growth_mib));
    } else {
        arena::say!("{} scans, {tracked} tracked -> {}", run.scans, options.out.display());
        if let (Some(median), Some(p95)) = (quantile(&run.cpu_ms, 0.5), quantile(&run.cpu_ms, 0.95)) {
            arena::say!("CPU per scan: median {median:.2} ms, 95 % below {p95:.2} ms");
        }
        for (status, count) in &run.status_counts {
            arena::say!("  {status}: {count}");
        }
        for (reason, count) in &run.dropped {
            arena::say!("  left out, {reason}: {count}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The keys are promised.
fn summary(run: &OdometryRun, growth_mib: Option<f64>) -> Value {
    json!({
        "scans": run.scans,
        "scans_tracked": run.scans_tracked(),
        "cpu_ms_per_scan_median": quantile(&run.cpu_ms, 0.5),
        "cpu_ms_per_scan_p95": quantile(&run.cpu_ms, 0.95),
        "rss_growth_mib": growth_mib,
        "status_counts": run.status_counts,
        "degenerate_scans": run.degenerate_scans,
        "dropped": run.dropped,
    })
}

fn with_causes(error: &RecordingError) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text += &format!(": {more}");
        }
        cause = error.source();
    }
    text
}
