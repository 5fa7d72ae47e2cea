//! How long something took, for as many times as there may be: bins of one percent, so that a robot on patrol for days needs no more
//! memory for its times than one on an errand.

/// Times by bins whose widths grow by a percent: a quantile is right to half a percent, from a microsecond to half an hour.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TimeHistogram {
    /// Number of times in each bin, up to the last that is not empty.
    counts: Vec<u32>,
    total: u64,
}

/// A bin's upper edge over its lower one.
const GROWTH: f64 = 1.01;
/// The last bin takes everything from half an hour on.
const LAST_BIN: usize = 2143;

impl TimeHistogram {
    /// Counts one more.
    pub fn add(&mut self, microseconds: u32) {
        let bin = bin_of(microseconds);
        if self.counts.len() <= bin {
            self.counts.resize(bin + 1, 0);
        }
        self.counts[bin] = self.counts[bin].saturating_add(1);
        self.total += 1;
    }

    /// Counts all that another one counted.
    pub fn merge(&mut self, other: &TimeHistogram) {
        if self.counts.len() < other.counts.len() {
            self.counts.resize(other.counts.len(), 0);
        }
        for (mine, theirs) in self.counts.iter_mut().zip(&other.counts) {
            *mine = mine.saturating_add(*theirs);
        }
        self.total += other.total;
    }

    /// How many there are.
    pub fn len(&self) -> u64 {
        self.total
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.total == 0
    }

    /// The time below which `share` of all lie, by the nearest rank, in microseconds; None for none.
    pub fn quantile_us(&self, share: f64) -> Option<f64> {
        let rank = ((self.total.checked_sub(1)? as f64) * share.clamp(0.0, 1.0)).round() as u64;
        let mut below = 0;
        let bin = self.counts.iter().position(|count| {
            below += u64::from(*count);
            below > rank
        })?;
        Some(if bin == 0 { 0.0 } else { GROWTH.powf(bin as f64 - 0.5) })
    }
}

/// Bin 0 holds what took less than a microsecond, bin n what took GROWTH^(n-1) to GROWTH^n.
fn bin_of(microseconds: u32) -> usize {
    if microseconds == 0 {
        return 0;
    }
    let exponent = f64::from(microseconds).ln() / GROWTH.ln();
    (exponent.floor() as usize + 1).min(LAST_BIN)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn by_hand() {
        let mut times = TimeHistogram::default();
        assert_eq!((times.quantile_us(0.5), times.is_empty()), (None, true));
        times.add(0);
        assert_eq!(times.quantile_us(0.5), Some(0.0));
        times.add(1000);
        times.add(u32::MAX);
        assert!((times.quantile_us(0.5).unwrap() / 1000.0 - 1.0).abs() < 0.01);
        assert!(times.counts.len() <= LAST_BIN + 1);
    }

    proptest! {
        #[test]
        fn a_quantile_is_that_of_the_sorted_times_to_a_percent(
            times in prop::collection::vec(0_u32..2_000_000, 1..200), share in 0.0..=1.0_f64, cut in 0_usize..200,
        ) {
            let (first, second) = times.split_at(cut.min(times.len()));
            let (mut all, mut rest) = (TimeHistogram::default(), TimeHistogram::default());
            first.iter().for_each(|time| all.add(*time));
            second.iter().for_each(|time| rest.add(*time));
            all.merge(&rest);
            let mut sorted = times.clone();
            sorted.sort_unstable();
            let exact = f64::from(sorted[((times.len() - 1) as f64 * share).round() as usize]);
            let found = all.quantile_us(share).unwrap();
            prop_assert_eq!(all.len(), times.len() as u64);
            prop_assert!((found - exact).abs() <= 0.01 * exact, "{} for {}", found, exact);
        }
    }
}
