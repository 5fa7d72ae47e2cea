//! Random numbers by address instead of by order.
//!
//! A sensor draws the noise of "scan 17, column 400, beam 3" from a hash of exactly these numbers (SplitMix64 finaliser,
//! Steele, Lea, Flood 2014). So a draw does not depend on how many draws came before it, on the number of threads, or on
//! whether another sensor is switched on, and one more draw in one place changes nothing elsewhere.

/// The address of a random number; addresses are made longer with [`NoiseKey::with`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoiseKey(u64);

impl NoiseKey {
    /// The root address of everything drawn from `seed`.
    pub fn new(seed: u64) -> Self {
        NoiseKey(mix(seed.wrapping_add(GOLDEN)))
    }

    /// The address below this one with the number `part`.
    #[inline]
    pub fn with(self, part: u64) -> Self {
        NoiseKey(mix(self.0.rotate_left(23) ^ mix(part.wrapping_add(GOLDEN))))
    }

    /// The address below this one with a text.
    pub fn with_text(self, text: &str) -> Self {
        // FNV-1a: short class names, no adversary.
        let hash =
            text.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
        self.with(hash)
    }

    /// The raw 64 bits of this address.
    #[inline]
    pub fn bits(self) -> u64 {
        mix(self.0)
    }

    /// Uniform in `[0, 1)`.
    #[inline]
    pub fn uniform(self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in `[low, high)`.
    pub fn between(self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform index below `count`; 0 when `count` is 0.
    pub fn index(self, count: usize) -> usize {
        // The multiply-shift of Lemire; the bias of count / 2^64 is nothing here.
        ((u128::from(self.bits()) * count as u128) >> 64) as usize
    }

    /// Two independent standard normal numbers (Box-Muller).
    #[inline]
    pub fn normal_pair(self) -> (f64, f64) {
        let u = 1.0 - self.uniform(); // in (0, 1]: the logarithm stays finite
        let v = self.with(1).uniform();
        let radius = (-2.0 * u.ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
        (radius * cos, radius * sin)
    }

    /// A standard normal number: the first of [`NoiseKey::normal_pair`].
    #[inline]
    pub fn normal(self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.with(1).uniform()).cos()
    }

    /// Number of events of a Poisson process with the given mean (Knuth); means above 50 are cut to 50.
    pub fn poisson(self, mean: f64) -> usize {
        let limit = (-mean.clamp(0.0, 50.0)).exp();
        let mut product = 1.0;
        for count in 0..1000 {
            product *= self.with(count).uniform();
            if product <= limit {
                return count as usize;
            }
        }
        1000
    }
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

#[inline]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let n = 100_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n {
            let (a, b) = NoiseKey::new(3).with(i).normal_pair();
            sum += a + b;
            squares += a * a + b * b;
        }
        let count = 2.0 * n as f64;
        assert!((sum / count).abs() < 0.01, "mean {}", sum / count);
        assert!((squares / count - 1.0).abs() < 0.02);
    }

    #[test]
    fn poisson_has_the_mean_it_was_given() {
        let total: usize = (0..20_000).map(|i| NoiseKey::new(5).with(i).poisson(0.3)).sum();
        assert!((total as f64 / 20_000.0 - 0.3).abs() < 0.02);
        assert_eq!(NoiseKey::new(5).poisson(0.0), 0);
    }

    #[test]
    fn addresses_differ_by_every_part() {
        let root = NoiseKey::new(1);
        assert_ne!(root.with(1).bits(), root.with(2).bits());
        assert_ne!(root.with(1).with(2).bits(), root.with(2).with(1).bits());
        assert_ne!(root.with_text("cup").bits(), root.with_text("mug").bits());
        assert_eq!(root.with(7).uniform(), NoiseKey::new(1).with(7).uniform());
    }
}
