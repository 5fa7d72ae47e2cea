//! The samples of the IMU, and the prediction through them.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};
use thiserror::Error;

use crate::odometry::config::LioConfig;
use crate::odometry::propagation::{ImuInput, Inflation, Knot, propagate_covariance, step};
use crate::odometry::state::{Covariance, ImuState};
use crate::{ImuSample, Stamp};

/// Longer without a sample, and the force is no longer believed: the velocity is held.
const GAP_S: f64 = 0.05;
/// Variance of the noise over a gap or at a saturated sample, relative to the usual one.
const DOUBTFUL: Inflation = Inflation { gyro: 1e4, accel: 1e4 };
/// A gyroscope at its limit hides a turn that is faster by this share of its range, for about so long. With less the
/// filter believes the clipped turn, and a wrong place in the map with it.
const HIDDEN_SHARE: f64 = 0.2;
const HIDDEN_S: f64 = 0.05;
/// A longer silence must be confirmed by a second sample: one wrong stamp would shut out all later ones.
const MAX_JUMP_S: f64 = 2.0;
/// Samples kept: enough for scans that come two seconds late at 1 kHz.
const MAX_SAMPLES: usize = 4096;

/// Why a sample was refused. The odometry stays as it was.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ImuFault {
    /// A number is NaN or infinite.
    #[error("the IMU sample at {stamp} is not finite")]
    NotFinite {
        /// Time of the sample.
        stamp: Stamp,
    },
    /// The sample is not later than the last one.
    #[error("the IMU sample at {stamp} is not later than the last one at {last}")]
    NotLater {
        /// Time of the sample.
        stamp: Stamp,
        /// Time of the last one.
        last: Stamp,
    },
    /// The sample is far ahead of the last one. If the next one follows it, both clocks have moved, and it is taken.
    #[error("the IMU sample at {stamp} is more than {MAX_JUMP_S} s ahead of the last one at {last}")]
    JumpsAhead {
        /// Time of the sample.
        stamp: Stamp,
        /// Time of the last one.
        last: Stamp,
    },
}

/// How a prediction treats the accelerometer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Motion {
    /// The force accelerates the body.
    Inertial,
    /// The velocity stays as it is: without gravity the force says nothing.
    Coasting,
}

/// What was said from the last time up to `until`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    pub until: Stamp,
    pub input: ImuInput,
    pub inflation: Inflation,
    /// Too long without a sample: the force says nothing about it.
    pub is_gap: bool,
}

/// The newest samples.
#[derive(Debug, Clone, Default)]
pub(crate) struct ImuBuffer {
    samples: VecDeque<ImuSample>,
    /// A sample far ahead that waits for another one.
    ahead: Option<Stamp>,
}

impl ImuBuffer {
    pub(crate) fn push(&mut self, sample: &ImuSample) -> Result<(), ImuFault> {
        let stamp = sample.stamp;
        let is_finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite() && x.abs() < 1e9);
        if !is_finite(&sample.angular_velocity_radps) || !is_finite(&sample.specific_force_mps2) {
            return Err(ImuFault::NotFinite { stamp });
        }
        if let Some(last) = self.last().filter(|&last| stamp <= last) {
            return Err(ImuFault::NotLater { stamp, last });
        }
        let jumps = |from: Stamp| stamp <= from || stamp.seconds_since(from) > MAX_JUMP_S;
        if let Some(last) = self.last().filter(|&last| jumps(last) && self.ahead.is_none_or(jumps)) {
            self.ahead = Some(stamp);
            return Err(ImuFault::JumpsAhead { stamp, last });
        }
        self.ahead = None;
        if self.samples.len() == MAX_SAMPLES {
            self.samples.pop_front();
        }
        self.samples.push_back(*sample);
        Ok(())
    }

    pub(crate) fn last(&self) -> Option<Stamp> {
        Some(self.samples.back()?.stamp)
    }

    pub(crate) fn samples(&self) -> &VecDeque<ImuSample> {
        &self.samples
    }

    /// Forgets what is not needed for times from `stamp` on.
    pub(crate) fn forget_before(&mut self, stamp: Stamp) {
        while self.samples.get(1).is_some_and(|second| second.stamp <= stamp) {
            self.samples.pop_front();
        }
    }

    /// The inputs between two times, one per interval between samples; the last input is held beyond the last sample.
    pub(crate) fn intervals(&self, from: Stamp, to: Stamp, config: &LioConfig) -> Vec<Interval> {
        let mut result = Vec::new();
        let mut now = from;
        let mut next = self.samples.partition_point(|sample| sample.stamp <= from);
        while now < to {
            let tail = self.samples.get(next);
            let until = tail.map_or(to, |tail| tail.stamp.min(to));
            let head = next.checked_sub(1).and_then(|before| self.samples.get(before));
            if let Some(interval) = interval(head, tail, now, until, config) {
                result.push(interval);
            }
            now = until;
            next += 1;
        }
        result
    }

    /// Carries state and covariance to a later time; the knots of the way are added to `knots`.
    pub(crate) fn predict(
        &self,
        state: &ImuState,
        covariance: &Covariance,
        to: Stamp,
        motion: Motion,
        config: &LioConfig,
        knots: &mut Vec<Knot>,
    ) -> (ImuState, Covariance) {
        let (mut state, mut covariance) = (*state, *covariance);
        for interval in self.intervals(state.stamp, to, config) {
            let (input, inflation) = treated(&interval, &state, motion);
            covariance = propagate_covariance(&covariance, &state, &input, interval.until, config, inflation);
            let (next, knot) = step(&state, &input, interval.until);
            knots.push(Knot { inflation, ..knot });
            state = next;
        }
        state.stamp = state.stamp.max(to);
        (state, covariance)
    }

    /// The knots from `from` on that end in `end` (FAST-LIO2 Eq. 9): the way that was taken if `end` is where it led.
    pub(crate) fn knots_back_from(&self, end: &ImuState, from: Stamp, config: &LioConfig) -> Vec<Knot> {
        let intervals = self.intervals(from, end.stamp, config);
        let mut knots = Vec::with_capacity(intervals.len());
        let mut state = *end;
        for (k, interval) in intervals.iter().enumerate().rev() {
            let start = if k == 0 { from } else { intervals[k - 1].until };
            let dt_s = interval.until.seconds_since(start);
            let rate = interval.input.rate_radps - state.gyro_bias_radps;
            let turned = |share: f64| state.rotation * UnitQuaternion::from_scaled_axis(rate * (-share * dt_s));
            let acceleration = if interval.is_gap {
                Vector3::zeros()
            } else {
                turned(0.5) * (interval.input.force_mps2 - state.accel_bias_mps2) + state.gravity_mps2()
            };
            let velocity = state.velocity_mps - acceleration * dt_s;
            state = ImuState {
                stamp: start,
                position_m: state.position_m - velocity * dt_s - acceleration * (0.5 * dt_s * dt_s),
                rotation: UnitQuaternion::new_normalize(turned(1.0).into_inner()),
                velocity_mps: velocity,
                ..state
            };
            knots.push(Knot {
                stamp: start,
                rotation: state.rotation,
                position_m: state.position_m,
                velocity_mps: velocity,
                rate_radps: rate,
                acceleration_mps2: acceleration,
                inflation: interval.inflation,
            });
        }
        knots.reverse();
        knots
    }
}

fn interval(
    head: Option<&ImuSample>,
    tail: Option<&ImuSample>,
    from: Stamp,
    until: Stamp,
    config: &LioConfig,
) -> Option<Interval> {
    let (head, tail) = match (head, tail) {
        (Some(head), Some(tail)) => (head, tail),
        (Some(one), None) | (None, Some(one)) => (one, one),
        (None, None) => return None,
    };
    // Linear between the samples; its mean over the interval is its value in the middle.
    let period_s = tail.stamp.seconds_since(head.stamp);
    let middle_s = 0.5 * (from.seconds_since(head.stamp) + until.seconds_since(head.stamp));
    let share = if period_s > 0.0 { (middle_s / period_s).clamp(0.0, 1.0) } else { 0.0 };
    let input = ImuInput {
        rate_radps: head.angular_velocity_radps.lerp(&tail.angular_velocity_radps, share),
        force_mps2: head.specific_force_mps2.lerp(&tail.specific_force_mps2, share),
        is_coasting: false,
    };
    let is_gap = until.seconds_since(from) > GAP_S;
    let is_gyro_saturated =
        [head, tail].iter().any(|sample| sample.angular_velocity_radps.amax() >= config.gyro_range_radps);
    let is_accel_saturated =
        [head, tail].iter().any(|sample| sample.specific_force_mps2.amax() >= config.accel_range_mps2);
    let mut inflation = if is_gap || is_gyro_saturated || is_accel_saturated { DOUBTFUL } else { Inflation::NONE };
    if is_gyro_saturated {
        // An error of constant sign over tau is white noise of the density sigma sqrt(tau).
        let hidden = HIDDEN_SHARE * config.gyro_range_radps * HIDDEN_S.sqrt();
        inflation.gyro = inflation.gyro.max((hidden / config.gyro_noise_density).powi(2));
    }
    Some(Interval { until, input, inflation, is_gap })
}

/// The input with the force that the motion allows, and the factor of its noise.
fn treated(interval: &Interval, state: &ImuState, motion: Motion) -> (ImuInput, Inflation) {
    let dt_s = interval.until.seconds_since(state.stamp);
    let inflation = interval.inflation;
    if motion == Motion::Inertial && !interval.is_gap {
        return (interval.input, inflation);
    }
    // The force that just carries the body's weight, at mid-interval.
    let half = (interval.input.rate_radps - state.gyro_bias_radps) * (0.5 * dt_s);
    let middle = state.rotation * UnitQuaternion::from_scaled_axis(half);
    let force_mps2 = middle.inverse() * -state.gravity_mps2() + state.accel_bias_mps2;
    (ImuInput { force_mps2, is_coasting: true, ..interval.input }, inflation)
}
