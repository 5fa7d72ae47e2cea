//! `omnivln register A.ply B.ply`: where one scan lies in another.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use arena::frame::pose_in_map;
use arena::mission::omni_perception::registration::fit;
use arena::mission::omni_perception::{RegistrationConfig, register};
use arena::mission::stage_clock::CpuScope;
use arena::mission::volumetric_map::read_ply_points;
use arena::options::{Pose, parse_pose};
use clap::Args;
use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use serde_json::json;

/// Options of `register`.
#[derive(Debug, Args)]
pub struct RegisterOptions {
    /// The scan that is moved (PLY: ascii or binary little-endian, x, y, z as float or double, metres)
    source: PathBuf,
    /// The scan that stays
    target: PathBuf,
    /// Where A lies in B, roughly: metres and degrees
    #[arg(long, value_name = "X,Y,Z,YAW", allow_hyphen_values = true, value_parser = parse_pose)]
    guess: Option<Pose>,
    /// Both scans are thinned to one point per cube of this edge, metres
    #[arg(long, value_name = "M", default_value_t = RegistrationConfig::default().leaf_m)]
    leaf: f64,
    /// Points farther apart are no pair, metres
    #[arg(long, value_name = "M", default_value_t = RegistrationConfig::default().max_distance_m)]
    max_distance: f64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Reads, aligns, prints. `t` takes points of A into B; inliers and their root mean square distance are counted over all points
/// of A, `cpu_ms` is the time of the alignment from the points to the pose.
pub fn run(options: &RegisterOptions) -> Result<ExitCode> {
    for (name, value, range) in
        [("--leaf", options.leaf, 1e-3..=100.0), ("--max-distance", options.max_distance, 1e-3..=1e3)]
    {
        ensure!(range.contains(&value), "{name} {value}: accepted are {} to {} metres", range.start(), range.end());
    }
    let (source, source_at) = read(&options.source)?;
    let (target, target_at) = read(&options.target)?;
    let config = RegistrationConfig {
        leaf_m: options.leaf,
        max_distance_m: options.max_distance,
        ..RegistrationConfig::default()
    };
    let guess = options.guess.as_ref().map_or_else(Isometry3::identity, pose_in_map);
    // The clouds are read about their own middles, so that f32 holds them wherever on Earth they lie.
    let near = |far: &Isometry3<f64>| Translation3::from(-target_at) * far * Translation3::from(source_at);

    let clock = CpuScope::Thread.now();
    let registration = register(&source, &target, &near(&guess), &config)
        .with_context(|| format!("aligning {} with {}", options.source.display(), options.target.display()))?;
    let cpu_ms = 1e3 * clock.elapsed().as_secs_f64();

    let found = fit(&source, &target, &registration.target_from_source, options.max_distance);
    let t = (Translation3::from(target_at) * registration.target_from_source * Translation3::from(-source_at))
        .to_homogeneous();
    let rows: Vec<Vec<f64>> = t.row_iter().map(|row| row.iter().copied().collect()).collect();
    if options.json {
        let answer = json!({
            "t": rows, "inliers": found.inliers, "rmse_m": found.rmse_m, "cpu_ms": cpu_ms,
            "points": source.len(), "iterations": registration.iterations, "converged": registration.converged,
        });
        arena::say!("{answer}");
    } else {
        arena::say!("Pose of {} in {}:", options.source.display(), options.target.display());
        for row in &rows {
            arena::say!("  {:12.8} {:12.8} {:12.8} {:12.6}", row[0], row[1], row[2], row[3]);
        }
        arena::say!(
            "{} of {} points within {} m, {:.4} m from the nearest (root mean square)",
            found.inliers,
            source.len(),
            options.max_distance,
            found.rmse_m
        );
        let ending = if registration.converged { "" } else { ", not converged: the pose is the last step's" };
        arena::say!("{} rounds, {cpu_ms:.1} ms{ending}", registration.iterations);
    }
    Ok(ExitCode::SUCCESS)
}

/// The points about their middle, and the middle.
fn read(path: &Path) -> Result<(Vec<Point3<f32>>, Vector3<f64>)> {
    ensure!(!path.is_dir(), "{} is a folder; a PLY file is needed", path.display());
    let file = File::open(path).with_context(|| format!("opening {}", path.display()))?;
    let points = read_ply_points(file).with_context(|| format!("reading {}", path.display()))?;
    let finite: Vec<&Point3<f64>> = points.iter().filter(|point| point.iter().all(|c| c.is_finite())).collect();
    ensure!(!finite.is_empty(), "{}: none of its {} points is finite", path.display(), points.len());
    let middle = finite.iter().map(|point| point.coords / finite.len() as f64).sum::<Vector3<f64>>();
    // What is near stays as it is.
    const NEAR_M: f64 = 1000.0;
    let middle = if middle.norm() < NEAR_M { Vector3::zeros() } else { middle };
    Ok((points.iter().map(|point| (point - middle).cast::<f32>()).collect(), middle))
}
