//! Limits and taste of the local policy.

use nalgebra::Point2;

use super::footprint::Footprint;

/// Limits and taste of a [`super::local_policy::LocalPolicy`].
#[derive(Debug, Clone, PartialEq)]
pub struct LocalPolicyConfig {
    /// Forward speed limit (0.6).
    pub max_speed_mps: f64,
    /// Backward speed limit, used to recover and to reach a near goal (0.3).
    pub max_reverse_speed_mps: f64,
    /// Sideways speed limit; 0 for a base that cannot (0.2).
    pub max_lateral_speed_mps: f64,
    /// Turn rate limit (1.0).
    pub max_yaw_rate_radps: f64,
    /// Acceleration and braking limit in the plane (1.0).
    pub max_accel_mps2: f64,
    /// Turn acceleration limit (2.5).
    pub max_yaw_accel_radps2: f64,
    /// Distance of the point on the path that is steered at (0.6).
    pub lookahead_m: f64,
    /// Outline in the body frame; its convex hull is used (0.70 x 0.33 box).
    pub footprint: Vec<Point2<f64>>,
    /// Distance kept from obstacle points beyond the footprint (0.04).
    pub margin_m: f64,
    /// Period of the loop (0.02).
    pub period_s: f64,
    /// Arrived when the body origin is this near to the path's end (0.12).
    pub goal_tolerance_m: f64,
    /// ... and the final heading, if given, is met to this (0.10).
    pub heading_tolerance_rad: f64,
    /// Speed falls from full to a third as the clearance falls from this to the margin (0.30).
    pub slow_clearance_m: f64,
    /// Length of the roll-outs (2.0).
    pub horizon_s: f64,
    /// Blocked after this long without moving (2.0).
    pub stuck_after_s: f64,
}

impl Default for LocalPolicyConfig {
    fn default() -> Self {
        LocalPolicyConfig {
            max_speed_mps: 0.6,
            max_reverse_speed_mps: 0.3,
            max_lateral_speed_mps: 0.2,
            max_yaw_rate_radps: 1.0,
            max_accel_mps2: 1.0,
            max_yaw_accel_radps2: 2.5,
            lookahead_m: 0.6,
            footprint: vec![
                Point2::new(0.35, 0.165),
                Point2::new(-0.35, 0.165),
                Point2::new(-0.35, -0.165),
                Point2::new(0.35, -0.165),
            ],
            margin_m: 0.04,
            period_s: 0.02,
            goal_tolerance_m: 0.12,
            heading_tolerance_rad: 0.10,
            slow_clearance_m: 0.30,
            horizon_s: 2.0,
            stuck_after_s: 2.0,
        }
    }
}

/// Why a [`LocalPolicyConfig`] was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LocalPolicyError {
    /// A limit, distance or time is not finite, negative, or zero where it may not be.
    #[error("limits, distances and times must be finite and positive (lateral and reverse speed and margin may be 0)")]
    BadLimit,
    /// The footprint's points do not span an area or are not finite.
    #[error("the footprint must have three points that span an area")]
    BadFootprint,
}

impl LocalPolicyConfig {
    /// Checks every number.
    ///
    /// # Errors
    /// [`LocalPolicyError`].
    pub fn validate(&self) -> Result<(), LocalPolicyError> {
        let positive = [
            self.max_speed_mps,
            self.max_yaw_rate_radps,
            self.max_accel_mps2,
            self.max_yaw_accel_radps2,
            self.lookahead_m,
            self.period_s,
            self.goal_tolerance_m,
            self.heading_tolerance_rad,
            self.slow_clearance_m,
            self.horizon_s,
            self.stuck_after_s,
        ];
        let not_negative = [self.max_reverse_speed_mps, self.max_lateral_speed_mps, self.margin_m];
        let good = positive.iter().all(|v| v.is_finite() && *v > 0.0)
            && not_negative.iter().all(|v| v.is_finite() && *v >= 0.0);
        // The roll-outs are bounded in number of steps.
        if !good || self.horizon_s > 10.0 || self.max_speed_mps / self.max_accel_mps2 > 1000.0 * self.period_s {
            return Err(LocalPolicyError::BadLimit);
        }
        Footprint::new(&self.footprint).map(|_| ()).ok_or(LocalPolicyError::BadFootprint)
    }
}
