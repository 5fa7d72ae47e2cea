//! Numbers of some 32 digits as unevaluated sums of two doubles (Dekker 1971), for the few places where sixteen are not enough.

use std::ops::{Add, Mul, Neg};

/// `high + low`, with `low` below the last digit of `high`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct DoubleDouble {
    pub high: f64,
    pub low: f64,
}

impl DoubleDouble {
    /// The sum of two doubles, exactly.
    pub fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let b_part = high - a;
        DoubleDouble { high, low: (a - (high - b_part)) + (b - b_part) }
    }

    /// The product of two doubles, exactly where nothing over- or underflows.
    pub fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
        DoubleDouble { high, low: ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low }
    }

    /// `1 / x` to all digits.
    pub fn reciprocal(x: f64) -> Self {
        let guess = x.recip();
        let DoubleDouble { high, low } = DoubleDouble::product(guess, x);
        let rest = (1.0 - high) - low;
        DoubleDouble::sum(guess, guess * rest)
    }
}

/// A double as the sum of two of half the digits (Veltkamp).
fn split(x: f64) -> (f64, f64) {
    const HALF: f64 = 134_217_729.0; // 2^27 + 1
    let scaled = HALF * x;
    let high = scaled - (scaled - x);
    (high, x - high)
}

impl From<f64> for DoubleDouble {
    fn from(high: f64) -> Self {
        DoubleDouble { high, low: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, low) = (DoubleDouble::sum(self.high, other.high), DoubleDouble::sum(self.low, other.low));
        let first = DoubleDouble::sum(high.high, high.low + low.high);
        DoubleDouble::sum(first.high, first.low + low.low)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        DoubleDouble { high: -self.high, low: -self.low }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = DoubleDouble::product(self.high, other.high);
        DoubleDouble::sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }
}

impl Mul<f64> for DoubleDouble {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        let product = DoubleDouble::product(self.high, factor);
        DoubleDouble::sum(product.high, product.low + self.low * factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_digits_are_kept() {
        // 1/3 of 3 is 1 but for the last of 32 digits, where a double is off by 1e-17.
        let third = DoubleDouble::reciprocal(3.0);
        let rest = third * 3.0 + DoubleDouble::from(-1.0);
        assert!((rest.high + rest.low).abs() < 1e-31, "{rest:?}");
        // (1 + e)^2 - 1 - 2 e is e^2, which a double forgets.
        let e = 2.0f64.powi(-40);
        let x = DoubleDouble::sum(1.0, e);
        let rest = x * x + -(DoubleDouble::from(1.0) + DoubleDouble::from(2.0 * e));
        assert_eq!(rest.high, e * e);
        assert_eq!(DoubleDouble::sum(1e16, 1.0), DoubleDouble { high: 1e16, low: 1.0 });
    }
}
