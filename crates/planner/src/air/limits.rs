//! What a flight may not exceed, and what it costs.

use nalgebra::Vector3;

use super::flatness::Airframe;

/// Limits of a flight. Infinity switches one off (the least thrust: 0 or less).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightLimits {
    /// Speed (m/s).
    pub max_speed_mps: f64,
    /// Acceleration (m/s^2).
    pub max_accel_mps2: f64,
    /// What the limits of the rotors need: mass and drag. Without it the three limits below do not count.
    pub airframe: Option<Airframe>,
    /// Angle between the thrust axis and the vertical (rad), below a quarter turn.
    pub max_tilt_rad: f64,
    /// Body rate without yaw rate (rad/s).
    pub max_rate_radps: f64,
    /// Least thrust (N).
    pub min_thrust_n: f64,
    /// Greatest thrust (N).
    pub max_thrust_n: f64,
    /// No piece is shorter (s).
    pub min_duration_s: f64,
    /// What a second costs, in units of the effort (m^2/s^6 for jerk).
    pub time_weight: f64,
}

/// Why limits were refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LimitsError {
    /// A limit is not a number, or not positive.
    #[error("{what} must be a positive number, not {value}")]
    NotPositive {
        /// Its name.
        what: &'static str,
        /// What it was.
        value: f64,
    },
    /// The limits leave no thrust, or the vehicle cannot hover between them.
    #[error("hovering needs {hover_n} N, which is not between {min_n} N and {max_n} N")]
    CannotHover {
        /// Mass times gravity.
        hover_n: f64,
        /// Least thrust.
        min_n: f64,
        /// Greatest thrust.
        max_n: f64,
    },
    /// The tilt limit is a quarter turn or more.
    #[error("the greatest tilt must be below a quarter turn, not {max_tilt_rad} rad")]
    TiltTooLarge {
        /// What it was.
        max_tilt_rad: f64,
    },
}

impl FlightLimits {
    /// Checks every number. Infinite limits are allowed, NaN is not.
    ///
    /// # Errors
    /// [`LimitsError`].
    pub fn validate(&self) -> Result<(), LimitsError> {
        let positive = |what, value: f64| {
            if value > 0.0 { Ok(()) } else { Err(LimitsError::NotPositive { what, value }) }
        };
        let finite = |what, value: f64| {
            if value > 0.0 && value.is_finite() { Ok(()) } else { Err(LimitsError::NotPositive { what, value }) }
        };
        // Without any speed limit a flight would still be bounded by effort, but no bound on the work would be known.
        finite("the greatest speed", self.max_speed_mps)?;
        positive("the greatest acceleration", self.max_accel_mps2)?;
        finite("the shortest duration", self.min_duration_s)?;
        finite("the weight of time", self.time_weight)?;
        let Some(airframe) = &self.airframe else { return Ok(()) };
        finite("the mass", airframe.mass_kg)?;
        finite("gravity", airframe.gravity_mps2)?;
        finite("the smoothing of the speed", airframe.speed_epsilon)?;
        let drags = [airframe.drag_across, airframe.drag_along, airframe.drag_parasitic];
        if let Some(&value) = drags.iter().find(|d| !(d.is_finite() && **d >= 0.0)) {
            return Err(LimitsError::NotPositive { what: "drag (or zero)", value });
        }
        positive("the greatest tilt", self.max_tilt_rad)?;
        positive("the greatest body rate", self.max_rate_radps)?;
        if self.max_tilt_rad >= std::f64::consts::FRAC_PI_2 {
            return Err(LimitsError::TiltTooLarge { max_tilt_rad: self.max_tilt_rad });
        }
        let (hover_n, min_n, max_n) = (airframe.mass_kg * airframe.gravity_mps2, self.min_thrust_n, self.max_thrust_n);
        if !(min_n < hover_n && hover_n < max_n) {
            return Err(LimitsError::CannotHover { hover_n, min_n, max_n });
        }
        Ok(())
    }

    /// What differences of thrust are measured by (N): the greatest thrust, or twice that of hovering where there is no such limit.
    pub(crate) fn thrust_scale_n(&self) -> f64 {
        match &self.airframe {
            Some(airframe) if !self.max_thrust_n.is_finite() => 2.0 * airframe.mass_kg * airframe.gravity_mps2,
            _ => self.max_thrust_n,
        }
    }
}

/// Position, velocity and acceleration at one end of a flight.
pub type BoundaryState = [Vector3<f64>; 3];
