//! Bernstein form of a quintic piece without allocation: a piece lies in the convex hull of its points, and so does each half.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use nalgebra::Vector3;

use super::hermite::factor;

/// Control points of the position and its first three derivatives over `[0, T]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct QuinticPoints {
    pub position: [Vector3<f64>; 6],
    pub velocity: [Vector3<f64>; 5],
    pub acceleration: [Vector3<f64>; 4],
    pub jerk: [Vector3<f64>; 3],
}

impl QuinticPoints {
    /// From at most six coefficients in ascending powers of local time; `None` if there are more, or if the duration is not a
    /// positive number.
    pub fn new(coefficients: &[Vector3<f64>], duration_s: f64) -> Option<Self> {
        let is_known = coefficients.len() <= 6 && duration_s > 0.0 && duration_s.is_finite();
        is_known.then(|| QuinticPoints {
            position: points::<6>(coefficients, 0, duration_s),
            velocity: points::<5>(coefficients, 1, duration_s),
            acceleration: points::<4>(coefficients, 2, duration_s),
            jerk: points::<3>(coefficients, 3, duration_s),
        })
    }
}

/// The k-th derivative as N Bernstein points: `b_i = sum_j C(i,j) / C(N-1,j) a_j` of the powers of `u = t / T`.
fn points<const N: usize>(coefficients: &[Vector3<f64>], k: usize, duration_s: f64) -> [Vector3<f64>; N] {
    let mut b = [Vector3::zeros(); N];
    let mut power = 1.0;
    for j in 0..N {
        if let Some(c) = coefficients.get(j + k) {
            b[j] = c * (factor(j + k, k) * power / binomial(N - 1, j));
        }
        power *= duration_s;
    }
    // C(i,j) by Pascal's rule in place.
    for level in 1..N {
        for i in (level..N).rev() {
            let below = b[i - 1];
            b[i] += below;
        }
    }
    b
}

const fn binomial(n: usize, k: usize) -> f64 {
    factor(n, k) / factor(k, k)
}

/// De Casteljau at the middle.
pub(crate) fn halves<const N: usize>(points: &[Vector3<f64>; N]) -> ([Vector3<f64>; N], [Vector3<f64>; N]) {
    let mut left = [Vector3::zeros(); N];
    let mut work = *points;
    for level in 0..N {
        left[level] = work[0];
        for i in 0..N - 1 - level {
            work[i] = (work[i] + work[i + 1]) * 0.5;
        }
    }
    // What is left in `work` is the right half: entry i stopped at level N - 1 - i.
    (left, work)
}

/// The value in the middle and a radius round it that holds all points.
pub(crate) fn ball<const N: usize>(points: &[Vector3<f64>; N]) -> (Vector3<f64>, f64) {
    let middle = halves(points).0[N - 1];
    let radius = points.iter().map(|p| (p - middle).norm_squared()).fold(0.0, f64::max).sqrt();
    (middle, radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::air::minco::derivative;

    #[test]
    fn points_begin_and_end_on_the_curve_and_halves_meet_on_it() {
        let c: Vec<Vector3<f64>> =
            (0..6).map(|k| Vector3::new(f64::from(k) - 2.0, 0.5 * f64::from(k), 0.3 * f64::from(k * k))).collect();
        let whole = QuinticPoints::new(&c, 1.7).unwrap();
        let (position, velocity) = (halves(&whole.position), halves(&whole.velocity));
        let (acceleration, jerk) = (halves(&whole.acceleration), halves(&whole.jerk));
        let at = |k, t| derivative(&c, k, t);
        for (k, t, p) in [
            (0, 0.0, whole.position[0]),
            (0, 1.7, whole.position[5]),
            (1, 1.7, whole.velocity[4]),
            (2, 0.0, whole.acceleration[0]),
            (3, 1.7, whole.jerk[2]),
            (0, 0.85, position.0[5]),
            (0, 0.85, position.1[0]),
            (1, 0.85, velocity.1[0]),
            (2, 1.7, acceleration.1[3]),
            (3, 0.85, jerk.0[2]),
        ] {
            assert!((at(k, t) - p).norm() < 1e-9, "derivative {k} at {t}");
        }
        assert!(QuinticPoints::new(&[Vector3::zeros(); 7], 1.0).is_none());
        assert!(QuinticPoints::new(&c, 0.0).is_none() && QuinticPoints::new(&c, f64::NAN).is_none());
    }
}
