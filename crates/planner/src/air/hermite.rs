//! A polynomial piece of degree 2S - 1 by the states at its two ends: constant tables of the Hermite form.
//!
//! With `u = t / T` and scaled states `y_k = p^(k) T^k` at both ends, the coefficients of `u^0 .. u^(S-1)` are `y_k / k!` of
//! the start, and those of `u^S .. u^(2S-1)` are linear in both: `FROM_START y_start + FROM_END y_end`. The effort
//! `integral |p^(S)|^2 dt` is the quadratic form `T^(1-2S) y^T K y` with the blocks below. Entries of `K` are whole numbers, those of the
//! other tables multiples of `1 / (S-1)!`: they are rounded to that, since where durations are a thousand times apart a wrong last digit
//! in a table is worth a thousand million digits in the spline.

/// Tables for order `S`; rows and columns count from 0.
pub(crate) struct Hermite<const S: usize>;

type Square<const S: usize> = [[f64; S]; S];

impl<const S: usize> Hermite<S> {
    /// Coefficient of `u^(S+row)` by the column-th scaled derivative at the end.
    pub const FROM_END: Square<S> = multiples(&invert(end_conditions::<S>()), factor(S - 1, S - 1));
    /// The same at the start.
    pub const FROM_START: Square<S> = multiples(&from_start::<S>(), factor(S - 1, S - 1));
    /// `K` between start and start, start and end, end and end.
    pub const START_START: Square<S> = multiples(&sandwich(&Self::FROM_START, &Self::FROM_START), 1.0);
    /// Rows: start, columns: end.
    pub const START_END: Square<S> = multiples(&sandwich(&Self::FROM_START, &Self::FROM_END), 1.0);
    /// Rows and columns: end.
    pub const END_END: Square<S> = multiples(&sandwich(&Self::FROM_END, &Self::FROM_END), 1.0);
}

/// `j! / (j - k)!`: what the k-th derivative makes of the j-th power; 0 for `j < k`.
pub(crate) const fn factor(j: usize, k: usize) -> f64 {
    let mut product = 1.0;
    let mut m = 0;
    while m < k {
        product *= if j >= m { (j - m) as f64 } else { 0.0 };
        m += 1;
    }
    product
}

/// Row k: the k-th derivative at u = 1 of `u^S .. u^(2S-1)`.
const fn end_conditions<const S: usize>() -> Square<S> {
    let mut a = [[0.0; S]; S];
    let mut k = 0;
    while k < S {
        let mut j = 0;
        while j < S {
            a[k][j] = factor(S + j, k);
            j += 1;
        }
        k += 1;
    }
    a
}

/// The end conditions must undo what the low powers do at u = 1: the k-th scaled state y of the start is `y u^k / k!`.
const fn from_start<const S: usize>() -> Square<S> {
    let inverse = Hermite::<S>::FROM_END;
    let mut b = [[0.0; S]; S];
    let mut j = 0;
    while j < S {
        let mut k = 0;
        while k < S {
            let mut m = 0;
            while m <= k {
                b[j][k] -= inverse[j][m] / factor(k - m, k - m);
                m += 1;
            }
            k += 1;
        }
        j += 1;
    }
    b
}

/// `left^T G right` with the Gram matrix of the S-th derivatives of `u^S .. u^(2S-1)` on [0, 1].
const fn sandwich<const S: usize>(left: &Square<S>, right: &Square<S>) -> Square<S> {
    let mut k = [[0.0; S]; S];
    let mut row = 0;
    while row < S {
        let mut column = 0;
        while column < S {
            let mut i = 0;
            while i < S {
                let mut j = 0;
                while j < S {
                    let gram = factor(S + i, S) * factor(S + j, S) / (i + j + 1) as f64;
                    k[row][column] += left[i][row] * gram * right[j][column];
                    j += 1;
                }
                i += 1;
            }
            column += 1;
        }
        row += 1;
    }
    k
}

/// Each entry as the multiple of `1 / parts` that it is but for rounding.
const fn multiples<const S: usize>(table: &Square<S>, parts: f64) -> Square<S> {
    let mut exact = [[0.0; S]; S];
    let mut row = 0;
    while row < S {
        let mut column = 0;
        while column < S {
            exact[row][column] = (table[row][column] * parts).round() / parts;
            column += 1;
        }
        row += 1;
    }
    exact
}

/// Gauss-Jordan without pivoting: the leading minors of the end conditions are Wronskians of powers, never zero.
const fn invert<const S: usize>(mut a: Square<S>) -> Square<S> {
    let mut inverse = [[0.0; S]; S];
    let mut k = 0;
    while k < S {
        inverse[k][k] = 1.0;
        k += 1;
    }
    k = 0;
    while k < S {
        let pivot = a[k][k];
        let mut j = 0;
        while j < S {
            a[k][j] /= pivot;
            inverse[k][j] /= pivot;
            j += 1;
        }
        let mut row = 0;
        while row < S {
            if row != k {
                let share = a[row][k];
                j = 0;
                while j < S {
                    a[row][j] -= share * a[k][j];
                    inverse[row][j] -= share * inverse[k][j];
                    j += 1;
                }
            }
            row += 1;
        }
        k += 1;
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quintic_tables_are_the_known_ones() {
        assert_eq!(Hermite::<3>::FROM_END, [[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]]);
        assert_eq!(Hermite::<3>::FROM_START, [[-10.0, -6.0, -1.5], [15.0, 8.0, 1.5], [-6.0, -3.0, -0.5]]);
        // Rest to rest over one metre in one second costs 720 m^2/s^5.
        assert_eq!(Hermite::<3>::END_END[0][0], 720.0);
        // A cubic from rest to rest: 12.
        assert_eq!(Hermite::<2>::END_END[0][0], 12.0);
    }

    /// The tables of order 4 worked out with fractions.
    #[test]
    fn the_septic_tables_are_exact() {
        let k = [
            [100_800.0, -50_400.0, 10_080.0, -840.0],
            [-50_400.0, 25_920.0, -5_400.0, 480.0],
            [10_080.0, -5_400.0, 1_200.0, -120.0],
            [-840.0, 480.0, -120.0, 16.0],
        ];
        assert_eq!(Hermite::<4>::END_END, k);
        let between = [
            [-100_800.0, 50_400.0, -10_080.0, 840.0],
            [-50_400.0, 24_480.0, -4_680.0, 360.0],
            [-10_080.0, 4_680.0, -840.0, 60.0],
            [-840.0, 360.0, -60.0, 4.0],
        ];
        assert_eq!(Hermite::<4>::START_END, between);
        assert_eq!(Hermite::<4>::FROM_END[0], [35.0, -15.0, 2.5, -1.0 / 6.0]);
    }

    /// Moving a piece as a whole costs nothing, which the splines use: only differences of positions enter.
    #[test]
    fn translation_costs_nothing() {
        for k in 0..4 {
            assert_eq!(Hermite::<4>::START_START[k][0] + Hermite::<4>::START_END[k][0], 0.0);
            assert_eq!(Hermite::<4>::START_END[0][k] + Hermite::<4>::END_END[0][k], 0.0);
        }
    }
}
