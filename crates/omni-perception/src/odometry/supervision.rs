//! How far to trust the pose, and what to do when it cannot be trusted.
//!
//! Without a valid update the inertial sensor carries the state: well for a second, then a bias grows with the square
//! of time. So after [`COAST_S`] the velocity fades away: the output stays where it is rather than fly off. When scans fit
//! the map again, also from some way off, tracking goes on; when they do not for [`RESTART_S`], the map is begun anew from
//! the pose that is held.

use nalgebra::{Matrix3, Vector3};

use crate::Stamp;
use crate::odometry::TrackingStatus;
use crate::odometry::config::LioConfig;
use crate::odometry::filter::{Belief, carry};
use crate::odometry::inertial::{ImuBuffer, Motion};
use crate::odometry::propagation::Knot;
use crate::odometry::report::ScanReport;
use crate::odometry::state::POSITION;
use crate::odometry::tracking::{MAX_SPREAD_M, spread};

/// Time for which the inertial sensor alone is believed.
const COAST_S: f64 = 1.0;
/// Time in which the velocity fades to a third after that.
const FADE_S: f64 = 0.3;
/// Time for which scans may fail to fit the map before it is given up.
const RESTART_S: f64 = 2.0;
/// Beyond this spread the covariance grows no more: the position is unknown.
const UNKNOWN_M: f64 = 10.0;

/// What is remembered from update to update.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Supervision {
    pub status: TrackingStatus,
    /// Time of the last valid update.
    pub last_valid: Option<Stamp>,
    /// Time of the first of the scans that show something and do not fit.
    misfit_since: Option<Stamp>,
    /// The next scan may lie anywhere near.
    pub must_search: bool,
}

impl Supervision {
    /// Begins to track.
    pub(crate) fn begin(&mut self, stamp: Stamp, must_search: bool) {
        *self =
            Supervision { status: TrackingStatus::Tracking, last_valid: Some(stamp), misfit_since: None, must_search };
    }

    /// Lost, with nothing to go on from.
    pub(crate) fn lost() -> Supervision {
        Supervision { status: TrackingStatus::Lost, ..Supervision::default() }
    }

    fn seconds_without_update(&self, now: Stamp) -> f64 {
        self.last_valid.map_or(0.0, |last| now.seconds_since(last))
    }

    /// How the state is carried on at `now`.
    fn motion(&self, now: Stamp) -> Motion {
        if self.seconds_without_update(now) > COAST_S { Motion::Coasting } else { Motion::Inertial }
    }

    /// Carries a belief on as far as it can be trusted: v(t) = v exp(-t / fade) once the inertial sensor cannot be.
    pub(crate) fn carried(
        &self,
        before: &Belief,
        now: Stamp,
        imu: &ImuBuffer,
        config: &LioConfig,
    ) -> (Belief, Vec<Knot>) {
        let motion = self.motion(now);
        if motion == Motion::Inertial {
            return carry(before, now, motion, imu, config);
        }
        let dt_s = now.seconds_since(before.state.stamp).max(1e-9);
        let left = (-dt_s / FADE_S).exp();
        let mut mean = *before;
        mean.state.velocity_mps *= (1.0 - left) * FADE_S / dt_s;
        let (mut belief, knots) = carry(&mean, now, motion, imu, config);
        belief.state.velocity_mps = before.state.velocity_mps * left;
        let position: Matrix3<f64> = belief.covariance.fixed_view::<3, 3>(POSITION, POSITION).into_owned();
        if position.trace() > UNKNOWN_M * UNKNOWN_M {
            belief.covariance = before.covariance;
        }
        (belief, knots)
    }

    /// Whether a usual update may miss the map.
    pub(crate) fn should_search(&self, predicted: &Belief, unobserved: &[Vector3<f64>], lost_after_s: f64) -> bool {
        self.must_search
            || self.seconds_without_update(predicted.state.stamp) > lost_after_s
            || spread(&predicted.covariance, unobserved) > 1.5 * MAX_SPREAD_M
    }

    /// Takes over what a scan showed.
    pub(crate) fn judge(&mut self, report: &ScanReport, kept_points: usize, lost_after_s: f64) {
        if report.is_update_valid || report.begins_map {
            self.last_valid = Some(report.stamp);
            self.misfit_since = None;
            self.must_search = false;
            let is_observed = report.degeneracy.is_none();
            self.status = if is_observed { TrackingStatus::Tracking } else { TrackingStatus::Degenerate };
            return;
        }
        if kept_points > 1000 {
            self.misfit_since.get_or_insert(report.stamp);
        } else {
            self.misfit_since = None;
        }
        self.watch(report.stamp, lost_after_s);
    }

    /// Notices that updates stay away.
    pub(crate) fn watch(&mut self, now: Stamp, lost_after_s: f64) {
        if self.last_valid.is_some() && self.seconds_without_update(now) > lost_after_s {
            self.status = TrackingStatus::Lost;
        }
    }

    /// Whether the map should be given up.
    pub(crate) fn should_restart(&self, now: Stamp) -> bool {
        self.status == TrackingStatus::Lost
            && self.misfit_since.is_some_and(|since| now.seconds_since(since) > RESTART_S)
    }
}
