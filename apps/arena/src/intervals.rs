//! How sure a figure is: 95 % intervals of shares, of differences between paired shares, and of means of paired differences.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// The normal distribution's 97.5 % point.
const Z: f64 = 1.959_963_984_540_054;

/// A figure and the interval that holds the true one in 95 of 100 such experiments.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The figure.
    pub value: f64,
    /// Its interval.
    pub interval_95: [f64; 2],
}

impl Estimate {
    /// The same difference seen from the other side.
    pub fn negated(&self) -> Estimate {
        let [low, high] = self.interval_95;
        Estimate { value: -self.value, interval_95: [-high, -low] }
    }

    /// Whether the interval leaves out zero.
    pub fn is_clear(&self) -> bool {
        self.interval_95[0] > 0.0 || self.interval_95[1] < 0.0
    }
}

/// Wilson's interval of a share: Wilson, J. Am. Stat. Assoc. 22 (1927) 209. Everything is possible where nothing was counted.
pub fn wilson_95(right: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (n as f64, right as f64 / n as f64);
    let middle = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    [((middle - half) / scale).max(0.0), ((middle + half) / scale).min(1.0)]
}

/// Share of the second minus share of the first, over the same cases: Newcombe, Stat. Med. 17 (1998) 2635, method 10. It is not
/// of width zero where both did the same in every case, as a bootstrap would be.
pub fn paired_shares_95(pairs: &[(bool, bool)]) -> Estimate {
    let n = pairs.len();
    if n == 0 {
        return Estimate { value: 0.0, interval_95: [-1.0, 1.0] };
    }
    let count = |first: bool, second: bool| pairs.iter().filter(|pair| **pair == (first, second)).count();
    // a both, b only the second, c only the first, d neither.
    let (a, b, c, d) = (count(true, true), count(false, true), count(true, false), count(false, false));
    let share = |right: usize| right as f64 / n as f64;
    let (p2, p1) = (share(a + b), share(a + c));
    let ([l2, u2], [l1, u1]) = (wilson_95(a + b, n), wilson_95(a + c, n));
    let margins = ((a + b) * (c + d) * (a + c) * (b + d)) as f64;
    let (same, other) = ((a * d) as f64, (b * c) as f64);
    let phi = if margins == 0.0 {
        0.0
    } else if same > other {
        // With the continuity correction that keeps few discordant pairs from promising too much.
        (same - other - n as f64 / 2.0).max(0.0) / margins.sqrt()
    } else {
        (same - other) / margins.sqrt()
    };
    let root = |x: f64, y: f64| (x * x - 2.0 * phi * x * y + y * y).max(0.0).sqrt();
    let value = p2 - p1;
    let low = value - root(p2 - l2, u1 - p1);
    let high = value + root(u2 - p2, p1 - l1);
    Estimate { value, interval_95: [low.max(-1.0), high.min(1.0)] }
}

/// Share of the second minus share of the first, each (right, of) and over cases of its own: Newcombe, Stat. Med. 17 (1998) 873, method 10.
pub fn shares_95((right_1, n_1): (usize, usize), (right_2, n_2): (usize, usize)) -> Estimate {
    let share = |right: usize, n: usize| right as f64 / n.max(1) as f64;
    let ([l1, u1], [l2, u2]) = (wilson_95(right_1, n_1), wilson_95(right_2, n_2));
    let (p1, p2) = (share(right_1, n_1), share(right_2, n_2));
    let value = p2 - p1;
    Estimate { value, interval_95: [value - (p2 - l2).hypot(u1 - p1), value + (u2 - p2).hypot(p1 - l1)] }
}

/// The mean of differences, or of anything else, with the interval between the percentiles of 4000 seeded bootstrap samples. Of fewer than six it has no bounds: even
/// if all agree in sign, chance does that once in sixteen times with five.
pub fn paired_mean_95(differences: &[f64]) -> Estimate {
    const SAMPLES: usize = 4000;
    const FEWEST: usize = 6;
    let n = differences.len();
    let value = differences.iter().sum::<f64>() / n.max(1) as f64;
    if n < FEWEST {
        return Estimate { value, interval_95: [f64::NEG_INFINITY, f64::INFINITY] };
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0x626F_6F74);
    let mut means: Vec<f64> =
        (0..SAMPLES).map(|_| (0..n).map(|_| differences[rng.random_range(0..n)]).sum::<f64>() / n as f64).collect();
    means.sort_by(f64::total_cmp);
    let at = |share: f64| means[((SAMPLES - 1) as f64 * share).round() as usize];
    Estimate { value, interval_95: [at(0.025), at(0.975)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_wilson() {
        // The example of Newcombe, Stat. Med. 17 (1998) 857, table I: 81 of 263.
        let near = |found: [f64; 2], wanted: [f64; 2]| found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 5e-5);
        assert!(near(wilson_95(81, 263), [0.2553, 0.3662]));
        assert!(near(wilson_95(0, 20), [0.0, 0.1611]));
        assert_eq!(wilson_95(0, 0), [0.0, 1.0]);
    }

    #[test]
    fn five_that_agree_show_nothing_and_six_do() {
        assert!(!paired_mean_95(&[1.0; 5]).is_clear());
        assert!(paired_mean_95(&[1.0; 6]).is_clear());
    }

    #[test]
    fn the_interval_of_two_shares() {
        // The first example of Newcombe, Stat. Med. 17 (1998) 873, table II: 56 of 70 and 48 of 80.
        let found = shares_95((48, 80), (56, 70));
        let near = |a: f64, b: f64| (a - b).abs() < 5e-5;
        assert!(near(found.interval_95[0], 0.0524) && near(found.interval_95[1], 0.3339), "{found:?}");
    }

    #[test]
    fn equal_arms_are_not_proven_equal() {
        let same = paired_shares_95(&[(true, true); 20]);
        assert_eq!(same.value, 0.0);
        assert!(same.interval_95[0] < -0.1 && same.interval_95[1] > 0.1, "{same:?}");
        assert_eq!(paired_shares_95(&[]).interval_95, [-1.0, 1.0]);
    }

    #[test]
    fn swapping_the_arms_mirrors_the_interval() {
        let pairs: Vec<(bool, bool)> = (0..40).map(|k| (k % 3 != 0, k % 7 != 0)).collect();
        let swapped: Vec<(bool, bool)> = pairs.iter().map(|(a, b)| (*b, *a)).collect();
        let (one, other) = (paired_shares_95(&pairs), paired_shares_95(&swapped));
        assert!((one.value + other.value).abs() < 1e-12);
        assert!((one.interval_95[0] + other.interval_95[1]).abs() < 1e-12);
    }

    /// What an interval promises: of many experiments with a known difference, about 95 of 100 hold it.
    #[test]
    fn intervals_hold_what_they_promise() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mut shares, mut means) = (0, 0);
        const EXPERIMENTS: usize = 400;
        for _ in 0..EXPERIMENTS {
            // The second arm is right in 0.80 of the cases, the first in 0.62, and they share luck.
            let pairs: Vec<(bool, bool)> = (0..60)
                .map(|_| {
                    let (luck, first, second): (f64, f64, f64) = (rng.random(), rng.random(), rng.random());
                    let both = luck < 0.5;
                    (both || first < 0.24, both || second < 0.6)
                })
                .collect();
            let [low, high] = paired_shares_95(&pairs).interval_95;
            shares += usize::from(low <= 0.18 && 0.18 <= high);
            let differences: Vec<f64> = (0..40).map(|_| rng.random::<f64>() + rng.random::<f64>()).collect();
            let [low, high] = paired_mean_95(&differences).interval_95;
            means += usize::from(low <= 1.0 && 1.0 <= high);
        }
        let enough = EXPERIMENTS * 91 / 100;
        assert!(shares >= enough && means >= enough, "{shares} and {means} of {EXPERIMENTS}");
        assert!(shares < EXPERIMENTS && means < EXPERIMENTS);
    }
}
