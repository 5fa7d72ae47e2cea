//! Whether a flight leaves enough in the battery for the way back.
//!
//! ```text
//! power ~ thrust^(3/2)     momentum theory: what hovering costs times (f / m g)^(3/2), with f the proved greatest thrust
//! needed = flight + way back + landing  <=  charge - reserve     in seconds of hovering
//! ```

use super::limits::FlightLimits;
use super::proof::FlightProof;

/// A battery as a limit of flights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Battery {
    /// How long a full one carries the hovering vehicle.
    pub endurance_s: f64,
    /// Share of a full one that no plan may use.
    pub reserve: f64,
    /// Speed on which the time for the way back is reckoned.
    pub cruise_mps: f64,
    /// Time for a landing.
    pub landing_s: f64,
}

/// Why a battery was refused, or a flight for its sake.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BatteryError {
    /// A number makes no sense.
    #[error(
        "a battery needs a positive endurance and speed, a reserve in [0, 1) and a time for landing that is not negative"
    )]
    BadBattery,
    /// What is left is not a share.
    #[error("the charge must be between 0 and 1, not {charge}")]
    BadCharge {
        /// What it was.
        charge: f64,
    },
    /// The flight, the way back and the reserve are more than what is left.
    #[error(
        "the flight and the way back take {needed_s:.0} s of hovering, the battery has {left_s:.0} s above its reserve"
    )]
    NotEnough {
        /// What they would take.
        needed_s: f64,
        /// What is left above the reserve.
        left_s: f64,
    },
}

impl Battery {
    /// Checks every number.
    ///
    /// # Errors
    /// [`BatteryError::BadBattery`].
    pub fn validate(&self) -> Result<(), BatteryError> {
        let positive = [self.endurance_s, self.cruise_mps].iter().all(|x| *x > 0.0 && x.is_finite());
        let rest = (0.0..1.0).contains(&self.reserve) && self.landing_s >= 0.0 && self.landing_s.is_finite();
        if positive && rest { Ok(()) } else { Err(BatteryError::BadBattery) }
    }

    /// Seconds of hovering above the reserve; negative below it.
    pub fn left_s(&self, charge: f64) -> f64 {
        (charge - self.reserve) * self.endurance_s
    }

    /// What a way takes, and the landing after it.
    pub fn return_s(&self, way_m: f64) -> f64 {
        way_m / self.cruise_mps + self.landing_s
    }

    /// Whether a proved flight of `duration_s` can be flown with `charge` (0 to 1), and then a way of `way_back_m` and a landing.
    ///
    /// # Errors
    /// [`BatteryError`].
    pub fn allow(
        &self,
        duration_s: f64,
        proof: &FlightProof,
        limits: &FlightLimits,
        way_back_m: f64,
        charge: f64,
    ) -> Result<(), BatteryError> {
        self.validate()?;
        if !(0.0..=1.0).contains(&charge) {
            return Err(BatteryError::BadCharge { charge });
        }
        let effort = limits.airframe.map_or(1.0, |a| {
            let hover_n = a.mass_kg * a.gravity_mps2;
            (proof.max_thrust_n / hover_n).max(1.0).powf(1.5)
        });
        let (needed_s, left_s) = (duration_s * effort + self.return_s(way_back_m), self.left_s(charge));
        if needed_s <= left_s { Ok(()) } else { Err(BatteryError::NotEnough { needed_s, left_s }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::air::config::AirConfig;

    #[test]
    fn a_flight_that_does_not_leave_the_way_back_is_refused() {
        let battery = Battery { endurance_s: 600.0, reserve: 0.2, cruise_mps: 1.0, landing_s: 10.0 };
        let limits = AirConfig::default().limits;
        let proof = FlightProof {
            holds: true,
            corridor_slack_m: 0.1,
            mover_slack_m: f64::INFINITY,
            max_speed_mps: 1.0,
            max_accel_mps2: 1.0,
            max_tilt_rad: 0.0,
            max_rate_radps: 0.0,
            min_thrust_n: f64::INFINITY,
            max_thrust_n: 0.0,
        };
        // 600 s full, 120 s of reserve: at half charge 180 s are left for 50 s of flight, the way back and 10 s of landing.
        assert_eq!(battery.allow(50.0, &proof, &limits, 119.0, 0.5), Ok(()));
        let refused = battery.allow(50.0, &proof, &limits, 121.0, 0.5);
        assert_eq!(refused, Err(BatteryError::NotEnough { needed_s: 181.0, left_s: 180.0 }));
        assert!(battery.allow(1.0, &proof, &limits, f64::NAN, 1.0).is_err(), "nobody knows the way back");
        assert!(battery.allow(1.0, &proof, &limits, 1.0, f64::NAN).is_err());
        assert!(Battery { reserve: 1.0, ..battery }.validate().is_err());
        assert!(Battery { endurance_s: f64::NAN, ..battery }.validate().is_err());
    }
}
