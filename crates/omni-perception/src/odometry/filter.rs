//! The filter without its surroundings: a belief, a map, and one scan at a time.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::odometry::config::LioConfig;
use crate::odometry::inertial::{ImuBuffer, Motion};
use crate::odometry::propagation::{Knot, symmetric};
use crate::odometry::report::ScanReport;
use crate::odometry::state::{Covariance, ImuState, ROTATION, VELOCITY};
use crate::odometry::sweep::{SensorMotion, Sweep, SweepLimits};
use crate::odometry::tracking::{Rig, additions, stride, track};
use crate::odometry::voxel_map::VoxelMap;
use crate::odometry::wide::align;
use crate::{RawScan, Stamp};

/// Fewest points that begin a map.
const MIN_FIRST_POINTS: usize = 500;
/// Spread of a pose that was found by a wide search.
const FOUND_POSITION_SIGMA_M: f64 = 0.03;
const FOUND_ROTATION_SIGMA_RAD: f64 = 0.01;

/// What a standing body may still move.
const STANDING_SIGMA_MPS: f64 = 0.01;

/// State and covariance at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Belief {
    pub state: ImuState,
    pub covariance: Covariance,
}

/// Belief at the end of the last scan, and the map.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    pub belief: Belief,
    pub map: VoxelMap,
    /// The way through the last scan.
    pub knots: Vec<Knot>,
    /// Directions without information in the last scan.
    pub unobserved: Vec<Vector3<f64>>,
}

impl Filter {
    /// A filter that begins.
    pub(crate) fn new(belief: Belief, map: VoxelMap) -> Filter {
        Filter { belief, map, knots: Vec::new(), unobserved: Vec::new() }
    }

    /// Tracks a scan from a prediction to its end and puts it into the map. The report's status is left to the
    /// caller.
    #[allow(clippy::too_many_arguments)] // as track
    pub(crate) fn step(
        &mut self,
        scan: &RawScan,
        rig: &Rig,
        imu: &ImuBuffer,
        sweep: &mut Sweep,
        predicted: Belief,
        knots: Vec<Knot>,
        config: &LioConfig,
    ) -> ScanReport {
        let mut report = ScanReport { stamp: predicted.state.stamp, ..ScanReport::default() };
        self.knots.clone_from(&knots);
        self.belief = predicted;
        let Belief { state, covariance } = &predicted;
        let Some(tracked) = track(scan, rig, imu, &self.map, sweep, state, covariance, knots, &self.unobserved, config)
        else {
            return report;
        };
        if let Some(updated) = &tracked.updated {
            self.belief = Belief { state: updated.state, covariance: updated.covariance };
            report.is_update_valid = true;
        }
        report.begins_map = self.map.is_empty() && sweep.points() >= MIN_FIRST_POINTS;
        if report.is_update_valid || report.begins_map {
            let pose = self.belief.state.world_from_imu();
            let additions = additions(sweep, &self.map, &tracked, &pose);
            self.map.insert(&additions);
            self.knots = tracked.knots;
        }
        report.dropped = sweep.dropped;
        report.residuals = tracked.residuals;
        report.inliers = tracked.inliers;
        report.outliers = tracked.outliers;
        report.iterations = tracked.iterations;
        report.rmse_m = tracked.rmse_m;
        if report.is_update_valid {
            self.unobserved.clone_from(&tracked.degeneracy.translations);
        }
        report.degeneracy = tracked.degeneracy;
        report.map_voxels = self.map.len();
        report
    }

    /// Looks for the scan's pose farther off than a cell. The belief with that pose, if it fits.
    pub(crate) fn search(
        &self,
        scan: &RawScan,
        rig: &Rig,
        sweep: &mut Sweep,
        predicted: &Belief,
        knots: &[Knot],
        config: &LioConfig,
    ) -> Option<Belief> {
        let points = points_in_imu(scan, rig, sweep, &self.map, &predicted.state, knots, config)?;
        let world_from_imu = align(&self.map, &points, &predicted.state.world_from_imu())?;
        let mut found = *predicted;
        found.state.position_m = world_from_imu.translation.vector;
        found.state.rotation = world_from_imu.rotation;
        // The pose is known anew and owes nothing to what was believed before.
        for k in 0..6 {
            found.covariance.row_mut(k).fill(0.0);
            found.covariance.column_mut(k).fill(0.0);
            let sigma = if k < ROTATION { FOUND_POSITION_SIGMA_M } else { FOUND_ROTATION_SIGMA_RAD };
            found.covariance[(k, k)] = sigma * sigma;
        }
        for k in VELOCITY..VELOCITY + 3 {
            found.covariance[(k, k)] += 0.3 * 0.3;
        }
        Some(found)
    }
}

/// The belief once it is known that the body stands: v = 0 with a small spread. Along a corridor nothing else says so, and
/// only this tells the accelerometer's bias from gravity there.
pub(crate) fn standing(belief: &Belief) -> Option<Belief> {
    let covariance = &belief.covariance;
    let columns = covariance.fixed_columns::<3>(VELOCITY).into_owned();
    let spread = covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY) + Matrix3::identity() * STANDING_SIGMA_MPS.powi(2);
    let gain = columns * spread.cholesky()?.inverse();
    let state = belief.state.boxplus(&(gain * -belief.state.velocity_mps));
    Some(Belief { state, covariance: symmetric(&(covariance - gain * columns.transpose())) })
}

/// The scan thinned by the map's voxels, without regard to planes, in the IMU frame at its end.
pub(crate) fn points_in_imu(
    scan: &RawScan,
    rig: &Rig,
    sweep: &mut Sweep,
    map: &VoxelMap,
    end: &ImuState,
    knots: &[Knot],
    config: &LioConfig,
) -> Option<Vec<Point3<f64>>> {
    let motion = SensorMotion::new(scan, end.stamp, knots, &rig.encoder, &rig.imu_mount, map)?;
    let limits = SweepLimits {
        min_range_m: config.min_range_m,
        max_range_m: config.max_range_m,
        gate_m: f32::INFINITY,
        stride: stride(scan, config),
    };
    sweep.collect(scan, &motion, map, &limits, config.threads);
    let imu_from_world = end.world_from_imu().inverse();
    Some(sweep.patches.iter().map(|patch| imu_from_world * (map.centre(patch.key) + patch.mean())).collect())
}

/// Carries a belief to a later time; the knots of the way come with it.
pub(crate) fn carry(
    belief: &Belief,
    to: Stamp,
    motion: Motion,
    imu: &ImuBuffer,
    config: &LioConfig,
) -> (Belief, Vec<Knot>) {
    let mut knots = Vec::with_capacity(32);
    let (state, covariance) = imu.predict(&belief.state, &belief.covariance, to, motion, config, &mut knots);
    (Belief { state, covariance }, knots)
}

/// The same belief in another world.
pub(crate) fn moved(belief: &Belief, new_from_old: &Isometry3<f64>) -> Belief {
    let state = &belief.state;
    let turn = new_from_old.rotation;
    let moved = ImuState {
        position_m: (new_from_old * Point3::from(state.position_m)).coords,
        rotation: turn * state.rotation,
        velocity_mps: turn * state.velocity_mps,
        gravity_frame: turn * state.gravity_frame,
        ..*state
    };
    let mut jacobian = Covariance::identity();
    let matrix = turn.to_rotation_matrix().into_inner();
    for at in [0, VELOCITY] {
        jacobian.fixed_view_mut::<3, 3>(at, at).copy_from(&matrix);
    }
    Belief { state: moved, covariance: jacobian * belief.covariance * jacobian.transpose() }
}
