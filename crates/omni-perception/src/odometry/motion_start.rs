//! The first state of a body that moves: from half a second of scans.
//!
//! 1. Scan to scan, with the gyroscope's rotation and a constant velocity, gives positions p_k without knowing gravity.
//! 2. `p(t) = p_0 + v_0 t + g t^2 / 2 + S(t)` with S the force integrated twice along the gyroscope's rotation is
//!    linear in v_0 and g (the idea of LiDAR_IMU_Init, Zhu et al. 2022): least squares, |g| = 9.81.
//! 3. The world is turned level and the filter itself runs through the same scans, twice: the second time from where
//!    the first one says the body was at the beginning.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::RawScan;
use crate::odometry::config::LioConfig;
use crate::odometry::filter::{Belief, Filter, carry, moved, points_in_imu};
use crate::odometry::inertial::{ImuBuffer, Motion};
use crate::odometry::initialisation::first_covariance;
use crate::odometry::state::{GRAVITY_MPS2, ImuState};
use crate::odometry::sweep::Sweep;
use crate::odometry::tracking::Rig;
use crate::odometry::voxel_map::{Addition, VoxelMap};
use crate::odometry::wide::align;

/// Scans that are needed.
pub(crate) const SCANS: usize = 6;
/// Accepted lengths of the gravity found, m/s^2: otherwise the scans were matched wrongly.
const GRAVITY_RANGE_MPS2: (f64, f64) = (8.0, 11.6);
/// Root mean square of the residuals of the last scan of a good start, m.
const MAX_RMSE_M: f64 = 0.03;

/// A filter that stands at the end of the last of the scans, in a level world with the IMU's first position as origin
/// and any heading. `empty` is a map without cells.
pub(crate) fn start_in_motion(
    scans: &[RawScan],
    rig: &Rig,
    imu: &ImuBuffer,
    sweep: &mut Sweep,
    empty: &VoxelMap,
    config: &LioConfig,
) -> Option<Filter> {
    if imu.samples().front()?.stamp > scans.first()?.start {
        return None;
    }
    let poses = relative_poses(scans, rig, imu, sweep, empty, config)?;
    let first = velocity_and_gravity(&poses, imu, config)?;
    let covariance = first_covariance(config, 0.3, 0.02, 0.05);
    let rough = run(&first, &covariance, scans, rig, imu, sweep, empty, config)?.0;
    let beginning = back_to(&rough.belief.state, scans.first()?, imu, config)?;
    let covariance = first_covariance(config, 0.05, 0.01, 0.02);
    let (filter, rmse_m) = run(&beginning, &covariance, scans, rig, imu, sweep, empty, config)?;
    (rmse_m < MAX_RMSE_M).then_some(filter)
}

/// Poses at the ends of the scans (with velocities), in a frame of any tilt.
fn relative_poses(
    scans: &[RawScan],
    rig: &Rig,
    imu: &ImuBuffer,
    sweep: &mut Sweep,
    empty: &VoxelMap,
    config: &LioConfig,
) -> Option<Vec<ImuState>> {
    let covariance = first_covariance(config, 1.0, 0.01, 1.0);
    let mut velocity = Vector3::zeros();
    let mut poses: Vec<ImuState> = Vec::new();
    // The first round begins with a velocity of zero, so its first scan is smeared; the second knows better.
    for _ in 0..3 {
        poses.clear();
        let mut map = empty.clone();
        let first = ImuState { velocity_mps: velocity, ..ImuState::at_rest(scans.first()?.start) };
        let mut belief = Belief { state: first, covariance };
        for scan in scans {
            let (predicted, knots) = carry(&belief, scan.end(), Motion::Coasting, imu, config);
            let points = points_in_imu(scan, rig, sweep, &map, &predicted.state, &knots, config)?;
            let mut state = predicted.state;
            if let Some(last) = poses.last() {
                let pose = align(&map, &points, &state.world_from_imu())?;
                let dt_s = state.stamp.seconds_since(last.stamp);
                state.position_m = pose.translation.vector;
                state.rotation = pose.rotation;
                state.velocity_mps = (state.position_m - last.position_m) / dt_s;
                if poses.len() == 1 {
                    velocity = state.velocity_mps;
                }
            }
            let correction = state.world_from_imu() * predicted.state.world_from_imu().inverse();
            let additions: Vec<Addition> = sweep
                .patches
                .iter()
                .map(|patch| {
                    let in_world = correction * (empty.centre(patch.key) + patch.mean());
                    let mut moments = patch.moments();
                    // Corrections may exceed a cell here, so points may belong to another one.
                    let key = empty.key(&in_world).unwrap_or(patch.key);
                    moments.mean = in_world - empty.centre(key);
                    let view = (state.position_m - in_world.coords).try_normalize(1e-9).unwrap_or_else(Vector3::z);
                    let cell = map.cell_towards(key, &(state.position_m - empty.centre(key).coords).cast());
                    Addition { key, cell, moments, view, is_contradicted: false }
                })
                .collect();
            map.insert(&merged(additions));
            poses.push(state);
            belief = Belief { state, covariance };
        }
    }
    Some(poses)
}

/// One addition per cell, in the order of the voxels.
fn merged(mut additions: Vec<Addition>) -> Vec<Addition> {
    additions.sort_by_key(|addition| addition.key);
    let mut result: Vec<Addition> = Vec::with_capacity(additions.len());
    for addition in additions {
        match result.last_mut() {
            Some(last) if last.key == addition.key && last.cell == addition.cell => {
                last.moments.merge(&addition.moments);
            }
            _ => result.push(addition),
        }
    }
    result
}

/// Velocity and gravity by least squares; the state at the end of the first scan in a level world.
fn velocity_and_gravity(poses: &[ImuState], imu: &ImuBuffer, config: &LioConfig) -> Option<ImuState> {
    let first = poses.first()?;
    // S(t) along the rotation that the scans gave: the force integrated twice, without gravity.
    let (mut swept, mut speed, mut now) = (Vector3::zeros(), Vector3::<f64>::zeros(), *first);
    let mut sums = [0.0; 3];
    let mut right = [Vector3::zeros(); 2];
    let mut rows = Vec::new();
    for pose in &poses[1..] {
        for interval in imu.intervals(now.stamp, pose.stamp, config) {
            let dt_s = interval.until.seconds_since(now.stamp);
            let turn = UnitQuaternion::from_scaled_axis(interval.input.rate_radps * (0.5 * dt_s));
            let force = now.rotation * turn * interval.input.force_mps2;
            swept += speed * dt_s + force * (0.5 * dt_s * dt_s);
            speed += force * dt_s;
            now.rotation = now.rotation * turn * turn;
            now.stamp = interval.until;
        }
        // The scans' rotation does not drift.
        now.rotation = pose.rotation;
        let t = pose.stamp.seconds_since(first.stamp);
        let moved = pose.position_m - first.position_m - swept;
        let (a, b) = (t, 0.5 * t * t);
        sums = [sums[0] + a * a, sums[1] + a * b, sums[2] + b * b];
        right = [right[0] + moved * a, right[1] + moved * b];
        rows.push((a, b, moved));
    }
    let determinant = sums[0] * sums[2] - sums[1] * sums[1];
    if determinant <= 0.0 {
        return None;
    }
    let gravity = (right[1] * sums[0] - right[0] * sums[1]) / determinant;
    let (low, high) = GRAVITY_RANGE_MPS2;
    if !(low..=high).contains(&gravity.norm()) {
        return None;
    }
    // With the length known, the velocity once more.
    let gravity = gravity * (GRAVITY_MPS2 / gravity.norm());
    let velocity = rows.iter().map(|(a, b, moved)| (moved - gravity * *b) * *a).sum::<Vector3<f64>>() / sums[0];
    let level = UnitQuaternion::rotation_between(&-gravity, &Vector3::z())
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let state = ImuState { velocity_mps: velocity, ..*first };
    let belief = Belief { state, covariance: crate::odometry::state::Covariance::zeros() };
    let turned = moved(&belief, &Isometry3::from_parts(Translation3::identity(), level)).state;
    Some(ImuState { gravity_frame: UnitQuaternion::identity(), ..turned })
}

/// The filter through all scans with a new map; with the residual of the last scan. The first state is that at the
/// end of the first scan.
#[allow(clippy::too_many_arguments)] // as track
fn run(
    first: &ImuState,
    covariance: &crate::odometry::state::Covariance,
    scans: &[RawScan],
    rig: &Rig,
    imu: &ImuBuffer,
    sweep: &mut Sweep,
    empty: &VoxelMap,
    config: &LioConfig,
) -> Option<(Filter, f64)> {
    let beginning = match first.stamp > scans.first()?.start {
        true => back_to(first, scans.first()?, imu, config)?,
        false => *first,
    };
    let belief = Belief { state: beginning, covariance: *covariance };
    let mut filter = Filter::new(belief, empty.clone());
    let mut last = f64::INFINITY;
    for scan in scans {
        let (predicted, knots) = carry(&filter.belief, scan.end(), Motion::Inertial, imu, config);
        let report = filter.step(scan, rig, imu, sweep, predicted, knots, config);
        if !report.is_update_valid && !report.begins_map {
            return None;
        }
        last = report.rmse_m;
    }
    Some((filter, last))
}

/// The state at the start of a scan that leads to `end`.
fn back_to(end: &ImuState, scan: &RawScan, imu: &ImuBuffer, config: &LioConfig) -> Option<ImuState> {
    let knot = *imu.knots_back_from(end, scan.start, config).first()?;
    Some(ImuState {
        stamp: knot.stamp,
        position_m: knot.position_m,
        rotation: knot.rotation,
        velocity_mps: knot.velocity_mps,
        ..*end
    })
}
