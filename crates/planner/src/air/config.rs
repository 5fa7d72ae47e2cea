//! Limits and taste of the aerial planner.

use super::geofence::Geofence;
use super::limits::{FlightLimits, LimitsError};

/// Configuration of [`crate::plan_air`].
#[derive(Debug, Clone, PartialEq)]
pub struct AirConfig {
    /// Limits of the flight, proved at every instant (1.5 m/s, 2 m/s^2, no airframe; a second costs 100).
    pub limits: FlightLimits,
    /// Where the body's centre may be at all (none: anywhere).
    pub geofence: Option<Geofence>,
    /// At most so much of a route is flown by one plan; the rest is planned on the way (20).
    pub horizon_m: f64,
    /// What moves is believed to go on as it does for this long (3 s).
    pub prediction_s: f64,
    /// Radius of a ball round the body's centre that holds the whole vehicle (0.36).
    pub radius_m: f64,
    /// Distance kept beyond the radius, for tracking error and map noise (0.03).
    pub margin_m: f64,
    /// Extra distance that is liked but not demanded (0.25).
    pub comfort_m: f64,
    /// Every obstacle point stands for a ball of this radius: half a cell of the map (0.05).
    pub obstacle_radius_m: f64,
    /// Height at which to fly where there is a choice; `None`: the goal's.
    pub preferred_height_m: Option<f64>,
    /// Extra cost of a metre flown one metre off the preferred height (0.5).
    pub height_weight: f64,
    /// Extra cost of a metre flown with no clearance to spare (2.0).
    pub nearness_weight: f64,
    /// Spacing of the search lattice; best the resolution of the distance field, whose cells it is aligned to (0.10).
    pub search_resolution_m: f64,
    /// Bound on the search (150 000).
    pub max_expansions: usize,
    /// A corridor polytope reaches at most this far from its part of the route (0.8).
    pub corridor_reach_m: f64,
    /// A goal that is not free is replaced by the nearest free point within this distance (0.6).
    pub goal_pull_m: f64,
}

impl Default for AirConfig {
    fn default() -> Self {
        AirConfig {
            limits: FlightLimits {
                max_speed_mps: 1.5,
                max_accel_mps2: 2.0,
                airframe: None,
                max_tilt_rad: f64::INFINITY,
                max_rate_radps: f64::INFINITY,
                min_thrust_n: 0.0,
                max_thrust_n: f64::INFINITY,
                min_duration_s: 0.1,
                time_weight: 100.0,
            },
            geofence: None,
            horizon_m: 20.0,
            prediction_s: 3.0,
            radius_m: 0.36,
            margin_m: 0.03,
            comfort_m: 0.25,
            obstacle_radius_m: 0.05,
            preferred_height_m: None,
            height_weight: 0.5,
            nearness_weight: 2.0,
            search_resolution_m: 0.10,
            max_expansions: 150_000,
            corridor_reach_m: 0.8,
            goal_pull_m: 0.6,
        }
    }
}

/// Why an [`AirConfig`] was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum AirConfigError {
    /// The limits of the flight do not hold together.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// A horizon, prediction, radius, resolution or reach is not finite or not positive.
    #[error("horizon, prediction, radius, comfort, resolution and reach must be finite and positive")]
    NotPositive,
    /// A margin, weight or pull is not finite or negative.
    #[error("margin, weights, obstacle radius and goal pull must be finite and not negative")]
    Negative,
}

impl AirConfig {
    /// Distance the body's centre keeps from obstacle surfaces.
    pub fn clearance_m(&self) -> f64 {
        self.radius_m + self.margin_m
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`AirConfigError`].
    pub fn validate(&self) -> Result<(), AirConfigError> {
        self.limits.validate()?;
        let positive = [
            self.horizon_m,
            self.prediction_s,
            self.radius_m,
            self.comfort_m,
            self.search_resolution_m,
            self.corridor_reach_m,
        ];
        if positive.iter().any(|v| !(v.is_finite() && *v > 0.0)) {
            return Err(AirConfigError::NotPositive);
        }
        let height = self.preferred_height_m.unwrap_or(0.0);
        let not_negative =
            [self.margin_m, self.height_weight, self.nearness_weight, self.obstacle_radius_m, self.goal_pull_m];
        if not_negative.iter().any(|v| !(v.is_finite() && *v >= 0.0)) || !height.is_finite() {
            return Err(AirConfigError::Negative);
        }
        Ok(())
    }
}
