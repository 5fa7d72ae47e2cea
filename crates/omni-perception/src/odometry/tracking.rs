//! One scan against the map: association, update, and, where the correction was large, both once more.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3};

use crate::odometry::config::LioConfig;
use crate::odometry::degeneracy::Degeneracy;
use crate::odometry::inertial::ImuBuffer;
use crate::odometry::propagation::Knot;
use crate::odometry::state::{Covariance, ImuState, POSITION, ROTATION};
use crate::odometry::sweep::{Patch, SensorMotion, Sweep, SweepLimits};
use crate::odometry::update::{PlaneResidual, Updated, update};
use crate::odometry::voxel_map::{Addition, NO_CELL, VoxelMap};
use crate::{EncoderTrack, RawScan, RotatingMount};

/// Passes over the points at most.
const MAX_PASSES: usize = 3;
/// A correction beyond which straightening and association are done again: 2 cm, or 2 cm at 5 m.
const REDO_M: f64 = 0.02;
const REDO_RAD: f64 = 0.004;
/// Fewest cells that make an update; which directions they leave open is asked separately.
const MIN_RESIDUALS: usize = 40;
/// Share of the points in known cells that must lie on their planes.
const MIN_INLIER_SHARE: f64 = 0.35;
/// A closet shows two dozen cells: so few are believed if nearly all of them agree, and most of what is seen lies in cells
/// of the map at all. After the robot was carried elsewhere, some dozen cells fit by chance, but most are new.
const MIN_RESIDUALS_OF_A_CLOSET: usize = 8;
const MIN_INLIER_SHARE_OF_A_CLOSET: f64 = 0.9;
const MIN_KNOWN_SHARE_OF_A_CLOSET: f64 = 0.6;
/// Points farther from their cell's plane than this many of the map's plane thicknesses are no part of it.
const GATE_THICKNESSES: f64 = 2.2;
/// What the prediction may be off at most without a search beyond the home cell.
pub(crate) const MAX_SPREAD_M: f64 = 0.1;
/// Range at which an error of rotation is weighed against one of position.
const LEVER_M: f64 = 3.0;

/// The rig as the filter sees it.
#[derive(Debug, Clone)]
pub(crate) struct Rig {
    /// The mount with the IMU in place of the body.
    pub imu_mount: RotatingMount,
    pub encoder: EncoderTrack,
}

/// A scan put to the map.
#[derive(Debug, Clone)]
pub(crate) struct Tracked {
    pub updated: Option<Updated>,
    /// The pose at the scan's end that the patches were collected with.
    pub swept_with: Isometry3<f64>,
    /// Where the sensor was in the world.
    pub sensor: Point3<f64>,
    pub degeneracy: Degeneracy,
    pub residuals: usize,
    pub inliers: usize,
    pub outliers: usize,
    pub iterations: usize,
    pub rmse_m: f64,
}

/// Tracks one scan that ends at the time of `predicted`. `knots` lead from `from` to there.
#[allow(clippy::too_many_arguments)] // each is one thing that the scan meets
pub(crate) fn track(
    scan: &RawScan,
    rig: &Rig,
    imu: &ImuBuffer,
    map: &VoxelMap,
    sweep: &mut Sweep,
    predicted: &ImuState,
    covariance: &Covariance,
    mut knots: Vec<Knot>,
    unobserved: &[Vector3<f64>],
    config: &LioConfig,
) -> Option<Tracked> {
    let from = knots.first()?.stamp;
    let mut spread_m = spread(covariance, unobserved);
    let mut start = *predicted;
    let mut iterations = 0;
    let mut pass = 0;
    loop {
        pass += 1;
        let motion = SensorMotion::new(scan, predicted.stamp, &knots, &rig.encoder, &rig.imu_mount, map)?;
        let gate_m = GATE_THICKNESSES * map.plane_thickness_m() + 3.0 * spread_m.min(MAX_SPREAD_M);
        let limits = SweepLimits {
            min_range_m: config.min_range_m,
            max_range_m: config.max_range_m,
            gate_m: gate_m as f32,
            stride: stride(scan, config),
        };
        sweep.collect(scan, &motion, map, &limits, config.threads);
        let swept_with = start.world_from_imu();
        let corner = map.centre(motion.anchor) - Vector3::repeat(0.5 * f64::from(map.cell_m()));
        let sensor = corner + motion.sensor.cast::<f64>();
        let (residuals, inliers, outliers) = residuals(sweep, map, &swept_with, &sensor, config);
        let mut degeneracy = Degeneracy::default();
        let share = inliers as f64 / (inliers + outliers).max(1) as f64;
        let is_enough = residuals.len() >= MIN_RESIDUALS && share >= MIN_INLIER_SHARE;
        let is_closet = residuals.len() >= MIN_RESIDUALS_OF_A_CLOSET
            && share >= MIN_INLIER_SHARE_OF_A_CLOSET
            && known_share(sweep) >= MIN_KNOWN_SHARE_OF_A_CLOSET;
        let updated = if is_enough || is_closet {
            let keep = std::cell::Cell::new(None::<Matrix6<f64>>);
            let found = std::cell::RefCell::new(Degeneracy::default());
            let result = update(predicted, covariance, &start, &residuals, config.max_iterations, |equations| {
                // Decided once, at the first step: the set of directions must not change within an iteration.
                keep.get().unwrap_or_else(|| {
                    let degeneracy = Degeneracy::of(equations, config.min_cells_per_direction);
                    keep.set(Some(degeneracy.keep()));
                    *found.borrow_mut() = degeneracy;
                    keep.get().unwrap_or_else(Matrix6::identity)
                })
            });
            degeneracy = found.into_inner();
            result
        } else {
            None
        };
        if let Some(updated) = &updated {
            iterations += updated.iterations;
            let moved_m = (updated.state.position_m - start.position_m).norm();
            let turned_rad = updated.state.rotation.angle_to(&start.rotation);
            if pass < MAX_PASSES && (moved_m > REDO_M || turned_rad > REDO_RAD) {
                start = updated.state;
                knots = imu.knots_back_from(&start, from, config);
                spread_m = REDO_M;
                continue;
            }
        }
        let cost = updated.as_ref().map_or(0.0, |u| mean_square(&u.state, &residuals));
        return Some(Tracked {
            updated,
            swept_with,
            sensor,
            degeneracy,
            residuals: residuals.len(),
            inliers,
            outliers,
            iterations,
            rmse_m: cost.sqrt(),
        });
    }
}

/// Share of the points that lie in cells of the map, with a plane or without.
fn known_share(sweep: &Sweep) -> f64 {
    let points = |patch: &&Patch| f64::from(patch.count + patch.outliers);
    let known: f64 = sweep.patches.iter().filter(|patch| patch.cell != NO_CELL).map(|patch| points(&patch)).sum();
    known / sweep.points().max(1) as f64
}

/// Every how many points of a scan are used.
pub(crate) fn stride(scan: &RawScan, config: &LioConfig) -> usize {
    scan.points.len().div_ceil(config.max_points_per_scan).max(1)
}

/// How far the prediction may be off at a few metres' range, in the directions that were observed lately: along a
/// corridor it may be off by much, and no plane stands in the way.
pub(crate) fn spread(covariance: &Covariance, unobserved: &[Vector3<f64>]) -> f64 {
    let block = covariance.fixed_view::<3, 3>(POSITION, POSITION);
    let along: f64 = unobserved.iter().map(|direction| direction.dot(&(block * direction))).sum();
    let position = (block.trace() - along).max(0.0);
    let rotation = covariance.fixed_view::<3, 3>(ROTATION, ROTATION).trace();
    (position + LEVER_M * LEVER_M * rotation).sqrt()
}

fn mean_square(state: &ImuState, residuals: &[PlaneResidual]) -> f64 {
    let sum: f64 = residuals.iter().map(|r| r.value(state).powi(2)).sum();
    sum / residuals.len().max(1) as f64
}

/// One residual per patch with a plane: its mean, weighted by the number of its points.
fn residuals(
    sweep: &Sweep,
    map: &VoxelMap,
    swept_with: &Isometry3<f64>,
    sensor: &Point3<f64>,
    config: &LioConfig,
) -> (Vec<PlaneResidual>, usize, usize) {
    let imu_from_world = swept_with.inverse();
    let (mut inliers, mut outliers) = (0, 0);
    let mut residuals = Vec::with_capacity(sweep.patches.len());
    for patch in sweep.patches.iter().filter(|patch| patch.has_plane()) {
        inliers += patch.count as usize;
        outliers += patch.outliers as usize;
        if patch.count <= patch.outliers {
            continue;
        }
        let cell = &map.cells()[patch.cell as usize];
        let [x, y, z, offset] = cell.plane.map(f64::from);
        let (normal, centre) = (Vector3::new(x, y, z), map.centre(patch.key));
        let in_world = centre + patch.mean();
        let ray = in_world - sensor;
        let range_m = ray.norm().max(1e-3);
        let cosine = normal.dot(&ray) / range_m;
        // Noise along the ray counts by the cosine of incidence, noise across it by the sine.
        let across_m = range_m * config.beam_sigma_rad;
        let point_variance =
            config.range_sigma_m.powi(2) * cosine * cosine + across_m * across_m * (1.0 - cosine * cosine);
        residuals.push(PlaneResidual {
            point: (imu_from_world * in_world).coords,
            normal,
            distance_m: normal.dot(&centre.coords) - offset,
            variance_m2: point_variance / f64::from(patch.count)
                + f64::from(cell.plane_variance_m2)
                + config.map_sigma_m.powi(2),
        });
    }
    (residuals, inliers, outliers)
}

/// What the scan adds to the map, seen from the corrected pose at its end.
pub(crate) fn additions(
    sweep: &Sweep,
    map: &VoxelMap,
    tracked: &Tracked,
    world_from_imu: &Isometry3<f64>,
) -> Vec<Addition> {
    let correction = world_from_imu * tracked.swept_with.inverse();
    let sensor = correction * tracked.sensor;
    let addition = |patch: &crate::odometry::sweep::Patch| {
        let centre = map.centre(patch.key);
        let mut moments = patch.moments();
        // The shape is not turned: a correction is a fraction of a degree.
        moments.mean = correction * (centre + moments.mean) - centre;
        let view = (sensor - centre).try_normalize(1e-9).unwrap_or_else(Vector3::z);
        let is_contradicted = patch.outliers > patch.count && patch.outliers >= 3;
        Addition { key: patch.key, cell: patch.cell, moments, view, is_contradicted }
    };
    sweep.patches.iter().map(addition).collect()
}
