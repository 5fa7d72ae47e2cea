//! Limits and gait of a ground base.

use thiserror::Error;

/// Limits and gait of a base.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundBaseConfig {
    /// Height of the body's origin above the floor (0.31).
    pub stance_height_m: f64,
    /// Forward speed limit (1.0).
    pub max_speed_mps: f64,
    /// Backward speed limit (0.5).
    pub max_reverse_mps: f64,
    /// Sideways speed limit (0.4).
    pub max_lateral_mps: f64,
    /// Turning speed limit (1.5).
    pub max_yaw_rate_radps: f64,
    /// Acceleration limit for each direction (2.0).
    pub max_accel_mps2: f64,
    /// Limit of the turning acceleration (4.0).
    pub max_yaw_accel_radps2: f64,
    /// Jerk limit (20).
    pub max_jerk_mps3: f64,
    /// Limit of the turning jerk (40).
    pub max_yaw_jerk_radps3: f64,
    /// Strides a second (3).
    pub stride_hz: f64,
    /// Heave amplitude at full speed (0.008).
    pub heave_m: f64,
    /// Pitch amplitude at full speed (0.6 degrees).
    pub pitch_rad: f64,
    /// Roll amplitude at full speed, at half the stride's rhythm (0.8 degrees).
    pub roll_rad: f64,
    /// What touches the robot within this height above the floor is what it stands on (0.04).
    pub support_height_m: f64,
    /// Distance from the axis at which a push turns the base as easily as it moves it (0.25).
    pub gyration_radius_m: f64,
}

impl Default for GroundBaseConfig {
    fn default() -> Self {
        GroundBaseConfig {
            stance_height_m: 0.31,
            max_speed_mps: 1.0,
            max_reverse_mps: 0.5,
            max_lateral_mps: 0.4,
            max_yaw_rate_radps: 1.5,
            max_accel_mps2: 2.0,
            max_yaw_accel_radps2: 4.0,
            max_jerk_mps3: 20.0,
            max_yaw_jerk_radps3: 40.0,
            stride_hz: 3.0,
            heave_m: 0.008,
            pitch_rad: 0.6_f64.to_radians(),
            roll_rad: 0.8_f64.to_radians(),
            support_height_m: 0.04,
            gyration_radius_m: 0.25,
        }
    }
}

/// Why the base cannot be made or moved.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GroundBaseError {
    /// A number of the configuration is out of its range.
    #[error("a number of the ground base's configuration is out of range")]
    Config,
    /// Start or command is NaN or infinite.
    #[error("the start or the command is not finite")]
    NotFinite,
    /// The step is not positive or longer than a second.
    #[error("the time step is not positive or longer than a second")]
    Step,
}

impl GroundBaseConfig {
    /// Checks every number.
    pub fn validate(&self) -> Result<(), GroundBaseError> {
        let positive = [
            self.max_speed_mps,
            self.max_accel_mps2,
            self.max_yaw_accel_radps2,
            self.max_jerk_mps3,
            self.max_yaw_jerk_radps3,
            self.gyration_radius_m,
        ];
        let not_negative = [
            self.stance_height_m,
            self.max_reverse_mps,
            self.max_lateral_mps,
            self.max_yaw_rate_radps,
            self.stride_hz,
            self.heave_m,
            self.pitch_rad,
            self.roll_rad,
            self.support_height_m,
        ];
        let good = positive.iter().all(|x| *x > 0.0 && x.is_finite())
            && not_negative.iter().all(|x| *x >= 0.0 && x.is_finite())
            && self.stride_hz <= 10.0
            && self.pitch_rad < 0.5
            && self.roll_rad < 0.5;
        if good { Ok(()) } else { Err(GroundBaseError::Config) }
    }
}
