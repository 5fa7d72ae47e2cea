//! The motor's angle at any time: encoder samples, unwrapped and interpolated.
//!
//! At one turn a second a millisecond is 0.36 degrees, that is 31 mm at 5 m: so the angle is taken at each point's own
//! time, and a constant latency of the encoder can be corrected.

use std::f64::consts::{PI, TAU};

use thiserror::Error;

use crate::Stamp;

/// One reading of the motor's encoder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderSample {
    /// Time of the reading.
    pub stamp: Stamp,
    /// Angle of the rotor about the stator's z axis, any multiple of a turn added.
    pub angle_rad: f64,
}

/// Why a sample was refused. The track stays as it was.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum EncoderError {
    /// The angle is not a finite number.
    #[error("the angle at {stamp} is not finite")]
    NotFinite {
        /// Time of the sample.
        stamp: Stamp,
    },
    /// The sample is not later than the last one.
    #[error("the sample at {stamp} is not later than the last one at {last}")]
    NotLater {
        /// Time of the sample.
        stamp: Stamp,
        /// Time of the last sample of the track.
        last: Stamp,
    },
}

/// The angle of the rotor over time.
#[derive(Debug, Clone, PartialEq)]
pub struct EncoderTrack {
    /// Unwrapped angles.
    samples: Vec<EncoderSample>,
    /// The angle of a mount that does not turn.
    fixed_angle_rad: Option<f64>,
    latency_ns: i64,
}

impl EncoderTrack {
    /// An empty track of a turning mount. A reading stamped t shows the angle at t - `latency_s`.
    pub fn rotating(latency_s: f64) -> EncoderTrack {
        let latency_ns = (latency_s * 1e9).round() as i64;
        EncoderTrack { samples: Vec::new(), fixed_angle_rad: None, latency_ns }
    }

    /// A mount that stands at angle zero for ever.
    pub fn fixed() -> EncoderTrack {
        EncoderTrack { samples: Vec::new(), fixed_angle_rad: Some(0.0), latency_ns: 0 }
    }

    /// A track without latency from samples in the order of time.
    ///
    /// # Errors
    /// [`EncoderError`] at the first bad sample.
    pub fn from_samples(samples: &[EncoderSample]) -> Result<EncoderTrack, EncoderError> {
        let mut track = EncoderTrack::rotating(0.0);
        samples.iter().try_for_each(|&sample| track.push(sample))?;
        Ok(track)
    }

    /// Adds a reading. Between two readings the rotor must turn less than half a turn (the shorter way is taken).
    ///
    /// # Errors
    /// [`EncoderError`] if the angle is not finite or the time does not advance.
    pub fn push(&mut self, sample: EncoderSample) -> Result<(), EncoderError> {
        let stamp = sample.stamp.plus_ns(-self.latency_ns);
        if !sample.angle_rad.is_finite() {
            return Err(EncoderError::NotFinite { stamp: sample.stamp });
        }
        let angle_rad = match self.samples.last() {
            Some(last) if stamp <= last.stamp => {
                return Err(EncoderError::NotLater { stamp, last: last.stamp });
            }
            Some(last) => {
                let step = (sample.angle_rad - last.angle_rad + PI).rem_euclid(TAU) - PI;
                last.angle_rad + step
            }
            None => sample.angle_rad,
        };
        self.samples.push(EncoderSample { stamp, angle_rad });
        Ok(())
    }

    /// Forgets readings that are no longer needed for times from `stamp` on.
    pub fn forget_before(&mut self, stamp: Stamp) {
        let after = self.samples.partition_point(|sample| sample.stamp <= stamp);
        self.samples.drain(..after.saturating_sub(1));
    }

    /// Time of the last reading; `None` without one.
    pub fn last(&self) -> Option<Stamp> {
        Some(self.samples.last()?.stamp)
    }

    /// The angle at `stamp`, continued at the last rate for at most `limit_s` beyond the last reading.
    pub fn extrapolated_angle_rad(&self, stamp: Stamp, limit_s: f64) -> Option<f64> {
        match self.samples[..] {
            [.., before, last] if self.fixed_angle_rad.is_none() && stamp > last.stamp => {
                let beyond_s = stamp.seconds_since(last.stamp);
                let rate_radps = (last.angle_rad - before.angle_rad) / last.stamp.seconds_since(before.stamp);
                (beyond_s <= limit_s).then_some(last.angle_rad + rate_radps * beyond_s)
            }
            _ => self.angle_rad(stamp),
        }
    }

    /// The unwrapped angle at `stamp`, linear between readings; `None` outside them.
    pub fn angle_rad(&self, stamp: Stamp) -> Option<f64> {
        if self.fixed_angle_rad.is_some() {
            return self.fixed_angle_rad;
        }
        let after = self.samples.partition_point(|sample| sample.stamp <= stamp);
        let before = self.samples.get(after.checked_sub(1)?)?;
        match self.samples.get(after) {
            Some(next) => {
                let share = stamp.seconds_since(before.stamp) / next.stamp.seconds_since(before.stamp);
                Some(before.angle_rad + share * (next.angle_rad - before.angle_rad))
            }
            None => (stamp == before.stamp).then_some(before.angle_rad),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(ms: i64, angle_rad: f64) -> EncoderSample {
        EncoderSample { stamp: Stamp(ms * 1_000_000), angle_rad }
    }

    #[test]
    fn the_angle_goes_on_across_the_turn() {
        let track = EncoderTrack::from_samples(&[sample(0, 3.1), sample(2, -3.1)]).expect("valid");
        let middle = track.angle_rad(Stamp(1_000_000)).expect("inside");
        assert!((middle - PI).abs() < 1e-12);
        assert_eq!(track.angle_rad(Stamp(-1)), None);
        assert_eq!(track.angle_rad(Stamp(2_000_001)), None);
        assert!(track.angle_rad(Stamp(2_000_000)).is_some());
    }

    #[test]
    fn bad_samples_change_nothing() {
        let mut track = EncoderTrack::from_samples(&[sample(0, 0.0)]).expect("valid");
        assert!(matches!(track.push(sample(0, 1.0)), Err(EncoderError::NotLater { .. })));
        assert!(matches!(track.push(sample(1, f64::NAN)), Err(EncoderError::NotFinite { .. })));
        track.push(sample(2, 1.0)).expect("valid");
        assert_eq!(track.angle_rad(Stamp(1_000_000)), Some(0.5));
    }

    #[test]
    fn latency_and_forgetting() {
        let mut track = EncoderTrack::rotating(0.001);
        for ms in 0..10 {
            track.push(sample(ms, 0.1 * ms as f64)).expect("valid");
        }
        track.forget_before(Stamp(5_500_000));
        let angle = track.angle_rad(Stamp(5_500_000)).expect("kept");
        assert!((angle - 0.65).abs() < 1e-12);
        assert_eq!(track.angle_rad(Stamp(4_000_000)), None);
        assert_eq!(EncoderTrack::fixed().angle_rad(Stamp(i64::MIN)), Some(0.0));
    }
}
