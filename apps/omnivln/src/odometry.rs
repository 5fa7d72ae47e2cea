//! `omnivln odometry RECORDING --out TUM`: the trajectory of a recording.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use arena::mission::odometry_run::OdometryRun;
use arena::mission::omni_perception::{LioConfig, OdometryEstimate};
use arena::mission::recording;
use clap::Args;
use nalgebra::Isometry3;
use serde_json::{Value, json};

/// Options of `odometry`.
#[derive(Debug, Args)]
pub struct OdometryOptions {
    /// A folder with meta.json, imu.csv, motor.csv and scans/
    recording: PathBuf,
    /// Where to write the trajectory: one line "t x y z qx qy qz qw" per scan, the pose of the IMU in a level world at
    /// the time of the scan's last point
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
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

/// Runs the odometry over the recording.
pub fn run(options: &OdometryOptions) -> Result<ExitCode> {
    let recording = recording::open(&options.recording)?;
    let config = LioConfig { threads: options.threads as usize, ..LioConfig::default() };
    let mut run = OdometryRun::new(&recording.rig, config)?;
    let body_from_imu = recording.rig.body_from_imu;
    let mut trajectory = String::new();
    let mut tracked = 0;
    let before_mib = peak_rss_mib();
    for event in recording.events {
        if let Err(error) = &event {
            eprintln!("warning: {error}");
        }
        run.push(event, |_, estimate| {
            if let Some(estimate) = estimate {
                tracked += 1;
                write_pose(&mut trajectory, &estimate, &body_from_imu);
            }
        });
    }
    run.finish();
    let growth_mib = before_mib.zip(peak_rss_mib()).map(|(before, after)| after - before);
    ensure!(run.scans > 0, "{} holds no scans", options.recording.display());
    write_whole(&options.out, trajectory.as_bytes())?;
    if let Some(path) = &options.map_out {
        let mut bytes = Vec::new();
        run.odometry.map().write(&mut bytes).context("writing the map")?;
        write_whole(path, &bytes)?;
    }

    if options.json {
        println!("{}", summary(&run, tracked, growth_mib));
    } else {
        println!("{} scans, {tracked} with a pose -> {}", run.scans, options.out.display());
        if let (Some(median), Some(p95)) = (quantile(&run.cpu_ms, 0.5), quantile(&run.cpu_ms, 0.95)) {
            println!("CPU per scan: median {median:.2} ms, 95 % below {p95:.2} ms");
        }
        for (status, count) in &run.status_counts {
            println!("  {status}: {count}");
        }
        for (reason, count) in &run.dropped {
            println!("  left out, {reason}: {count}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The keys are promised.
fn summary(run: &OdometryRun, tracked: usize, growth_mib: Option<f64>) -> Value {
    json!({
        "scans": run.scans,
        "scans_tracked": tracked,
        "cpu_ms_per_scan_median": quantile(&run.cpu_ms, 0.5),
        "cpu_ms_per_scan_p95": quantile(&run.cpu_ms, 0.95),
        "rss_growth_mib": growth_mib,
        "status_counts": run.status_counts,
        "degenerate_scans": run.degenerate_scans,
        "dropped": run.dropped,
    })
}

fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((values.len() as f64 - 1.0) * share).round() as usize).copied()
}

/// One line of a TUM trajectory; the seconds are written from integers, with all nine decimals.
fn write_pose(text: &mut String, estimate: &OdometryEstimate, body_from_imu: &Isometry3<f64>) {
    let pose = estimate.world_from_body * body_from_imu;
    let (p, q) = (pose.translation.vector, pose.rotation.coords);
    let (whole, nanoseconds) = (estimate.stamp.0.div_euclid(1_000_000_000), estimate.stamp.0.rem_euclid(1_000_000_000));
    let _ = writeln!(
        text,
        "{whole}.{nanoseconds:09} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9}",
        p.x, p.y, p.z, q.x, q.y, q.z, q.w
    );
}

/// Writes beside the place and renames, so that there is never half a file.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let name = path.file_name().with_context(|| format!("{} names no file", path.display()))?;
    let temporary = path.with_file_name(format!(".{}.part", name.to_string_lossy()));
    fs::write(&temporary, bytes).with_context(|| format!("writing {}", temporary.display()))?;
    fs::rename(&temporary, path).with_context(|| format!("writing {}", path.display()))
}

/// Peak memory of this process, MiB; Linux only.
fn peak_rss_mib() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use arena::mission::omni_perception::{RotatingMount, Stamp};
    use arena::mission::recording::RecordedRig;

    #[test]
    fn the_promised_keys() {
        let identity = Isometry3::identity();
        let mount = RotatingMount { body_from_stator: identity, rotor_from_sensor: identity };
        let rig = RecordedRig { mount, is_rotating: true, body_from_imu: identity };
        let mut run = OdometryRun::new(&rig, LioConfig::default()).expect("sound");
        run.cpu_ms = vec![3.0, 1.0, 2.0];
        let summary = summary(&run, 0, None);
        let keys: Vec<&str> = summary.as_object().expect("an object").keys().map(String::as_str).collect();
        assert_eq!(
            keys,
            [
                "cpu_ms_per_scan_median",
                "cpu_ms_per_scan_p95",
                "degenerate_scans",
                "dropped",
                "rss_growth_mib",
                "scans",
                "scans_tracked",
                "status_counts"
            ]
        );
        assert_eq!(summary["cpu_ms_per_scan_median"], 2.0);
    }

    #[test]
    fn nine_decimals_of_a_date() {
        let estimate =
            OdometryEstimate::at_rest(Stamp(1_700_000_000_099_861_111), Isometry3::translation(1.0, -2.0, 0.5));
        let mut text = String::new();
        write_pose(&mut text, &estimate, &Isometry3::identity());
        assert_eq!(
            text,
            "1700000000.099861111 1.000000000 -2.000000000 0.500000000 0.000000000 0.000000000 0.000000000 1.000000000\n"
        );
    }
}
