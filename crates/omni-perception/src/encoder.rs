//! The motor's angle at any time: encoder samples, unwrapped and interpolated.
//!
//! At one turn a second a millisecond is 0.36 degrees, that is 31 mm at 5 m: so the angle is taken at each point's own
//! time, and a constant latency of the encoder can be corrected.

use std::f64::consts::{PI, TAU};

use thiserror::Error;

use crate::Stamp;

/// Angles are interpolated over gaps up to this; in a longer one the rotor may have done anything.
const MAX_GAP_S: f64 = 0.25;
/// A longer silence must be confirmed by a second reading: one wrong stamp would shut out all later ones.
const MAX_JUMP_S: f64 = 2.0;
/// Ten turns a second: no mount of a LiDAR turns faster. Angles in degrees do, nearly always.
const MAX_RATE_RADPS: f64 = 10.0 * TAU;
/// Between readings that are nearer in time, the rate says nothing: stamps jitter.
const MIN_STEP_S: f64 = 5e-4;

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
    /// The sample is far ahead of the last one. If the next one follows it, the clock has moved, and it is taken.
    #[error("the sample at {stamp} is more than {MAX_JUMP_S} s ahead of the last one at {last}")]
    JumpsAhead {
        /// Time of the sample.
        stamp: Stamp,
        /// Time of the last sample of the track.
        last: Stamp,
    },
    /// Since the last sample the rotor would have turned faster than any mount does.
    #[error(
        "at {stamp} the rotor turns at {rate_radps:.0} rad/s, more than ten times a second: angles are radians, not degrees"
    )]
    TooFast {
        /// Time of the sample.
        stamp: Stamp,
        /// Speed since the last sample.
        rate_radps: f64,
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
    /// A reading far ahead that waits for another one.
    ahead: Option<Stamp>,
}

impl EncoderTrack {
    /// An empty track of a turning mount. A reading stamped t shows the angle at t - `latency_s`.
    pub fn rotating(latency_s: f64) -> EncoderTrack {
        let latency_ns = (latency_s * 1e9).round() as i64;
        EncoderTrack { samples: Vec::new(), fixed_angle_rad: None, latency_ns, ahead: None }
    }

    /// A mount that stands at angle zero for ever.
    pub fn fixed() -> EncoderTrack {
        EncoderTrack { samples: Vec::new(), fixed_angle_rad: Some(0.0), latency_ns: 0, ahead: None }
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
    /// [`EncoderError`] if the angle is not finite, the time does not advance or jumps ahead, or the rotor turns too fast.
    pub fn push(&mut self, sample: EncoderSample) -> Result<(), EncoderError> {
        let stamp = sample.stamp.plus_ns(-self.latency_ns);
        if !sample.angle_rad.is_finite() {
            return Err(EncoderError::NotFinite { stamp: sample.stamp });
        }
        let Some(last) = self.samples.last().copied() else {
            self.samples.push(EncoderSample { stamp, ..sample });
            return Ok(());
        };
        if stamp <= last.stamp {
            return Err(EncoderError::NotLater { stamp, last: last.stamp });
        }
        let jumps = |from: Stamp| stamp <= from || stamp.seconds_since(from) > MAX_JUMP_S;
        if jumps(last.stamp) && self.ahead.is_none_or(jumps) {
            self.ahead = Some(stamp);
            return Err(EncoderError::JumpsAhead { stamp, last: last.stamp });
        }
        self.ahead = None;
        let step_rad = (sample.angle_rad - last.angle_rad + PI).rem_euclid(TAU) - PI;
        let rate_radps = step_rad.abs() / stamp.seconds_since(last.stamp).max(MIN_STEP_S);
        if rate_radps > MAX_RATE_RADPS {
            return Err(EncoderError::TooFast { stamp, rate_radps });
        }
        self.samples.push(EncoderSample { stamp, angle_rad: last.angle_rad + step_rad });
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

    /// The unwrapped angle at `stamp`, linear between readings; `None` outside them and in gaps of more than a quarter of a
    /// second.
    pub fn angle_rad(&self, stamp: Stamp) -> Option<f64> {
        if self.fixed_angle_rad.is_some() {
            return self.fixed_angle_rad;
        }
        let after = self.samples.partition_point(|sample| sample.stamp <= stamp);
        let before = self.samples.get(after.checked_sub(1)?)?;
        match self.samples.get(after) {
            Some(next) => {
                let gap_s = next.stamp.seconds_since(before.stamp);
                let share = stamp.seconds_since(before.stamp) / gap_s;
                let angle_rad = before.angle_rad + share * (next.angle_rad - before.angle_rad);
                (gap_s <= MAX_GAP_S || stamp == before.stamp).then_some(angle_rad)
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
        track.push(sample(2, 0.1)).expect("valid");
        let middle = track.angle_rad(Stamp(1_000_000)).expect("inside");
        assert!((middle - 0.05).abs() < 1e-12);
    }

    #[test]
    fn one_wrong_stamp_is_passed_over_and_a_clock_that_moved_is_followed() {
        let mut track = EncoderTrack::from_samples(&[sample(0, 0.0), sample(2, 0.01)]).expect("valid");
        assert!(matches!(track.push(sample(3_000_000, 0.02)), Err(EncoderError::JumpsAhead { .. })));
        track.push(sample(4, 0.02)).expect("back to normal");
        assert!(matches!(track.push(sample(9_000, 0.0)), Err(EncoderError::JumpsAhead { .. })));
        track.push(sample(9_002, 0.01)).expect("confirmed");
        // Nothing is known of the time between.
        assert_eq!(track.angle_rad(Stamp(5_000_000_000)), None);
        assert!((track.angle_rad(Stamp(4_000_000)).expect("a reading") - 0.02).abs() < 1e-12);
    }

    #[test]
    fn degrees_are_noticed() {
        // Half a turn a second, read 500 times a second.
        let mut track = EncoderTrack::rotating(0.0);
        let refused = (0..500).filter(|k| track.push(sample(2 * k, 0.36 * *k as f64)).is_err()).count();
        assert!(refused > 450, "{refused}");
        let mut track = EncoderTrack::rotating(0.0);
        assert!((0..500).all(|k| track.push(sample(2 * k, (0.36 * k as f64).to_radians())).is_ok()));
    }

    #[test]
    fn latency_and_forgetting() {
        let mut track = EncoderTrack::rotating(0.001);
        for ms in 0..10 {
            track.push(sample(ms, 0.05 * ms as f64)).expect("valid");
        }
        track.forget_before(Stamp(5_500_000));
        let angle = track.angle_rad(Stamp(5_500_000)).expect("kept");
        assert!((angle - 0.325).abs() < 1e-12);
        assert_eq!(track.angle_rad(Stamp(4_000_000)), None);
        assert_eq!(EncoderTrack::fixed().angle_rad(Stamp(i64::MIN)), Some(0.0));
    }
}
