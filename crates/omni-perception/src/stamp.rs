//! Time: integer nanoseconds that come in with the data. Nothing here reads a clock.

use std::fmt;

/// A point in time, nanoseconds of the clock of the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Stamp(pub i64);

impl Stamp {
    /// Seconds from `earlier` to this stamp (negative if `earlier` is later). Exact to a nanosecond up to 100 days.
    pub fn seconds_since(self, earlier: Stamp) -> f64 {
        // The difference is taken in integers (wide, so that no stamp overflows) and only then becomes a float.
        (i128::from(self.0) - i128::from(earlier.0)) as f64 * 1e-9
    }

    /// This stamp moved by whole nanoseconds; stays at the ends of the range.
    pub fn plus_ns(self, ns: i64) -> Stamp {
        Stamp(self.0.saturating_add(ns))
    }

    /// This stamp moved by seconds, rounded to nanoseconds; stays at the ends of the range.
    pub fn plus_seconds(self, seconds: f64) -> Stamp {
        self.plus_ns((seconds * 1e9).round() as i64)
    }
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09}s", self.0.div_euclid(1_000_000_000), self.0.rem_euclid(1_000_000_000))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_exact_far_from_zero() {
        let late = Stamp(1_700_000_000_000_000_001);
        assert_eq!(late.seconds_since(Stamp(1_700_000_000_000_000_000)), 1e-9);
        assert_eq!(late.plus_seconds(0.1).seconds_since(late), 0.1);
        assert_eq!(Stamp(i64::MAX).plus_ns(5), Stamp(i64::MAX));
        assert_eq!(Stamp(1_500_000_000).to_string(), "1.500000000s");
    }
}
