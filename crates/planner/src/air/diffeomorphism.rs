//! Free numbers for what is bounded: a duration above its floor, a point in a polytope, a point in a ball (MINCO section V).
//!
//! Each map is onto and smooth, so a minimum over the free numbers is one over what they stand for.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use nalgebra::Vector3;

/// A duration above `floor_s` from a free number: `T - floor = tau^2/2 + tau + 1` for `tau > 0`, else `1 / (tau^2/2 - tau + 1)`.
pub fn duration(tau: f64, floor_s: f64) -> f64 {
    floor_s + if tau > 0.0 { (0.5 * tau + 1.0) * tau + 1.0 } else { 1.0 / ((0.5 * tau - 1.0) * tau + 1.0) }
}

/// Its derivative.
pub fn duration_slope(tau: f64) -> f64 {
    if tau > 0.0 {
        tau + 1.0
    } else {
        let denominator = (0.5 * tau - 1.0) * tau + 1.0;
        (1.0 - tau) / (denominator * denominator)
    }
}

/// The free number of a duration; durations at or below the floor count as a thousandth of a second above it.
pub fn duration_inverse(duration_s: f64, floor_s: f64) -> f64 {
    let above = (duration_s - floor_s).max(1e-3);
    if above > 1.0 { (2.0 * above - 1.0).sqrt() - 1.0 } else { 1.0 - (2.0 / above - 1.0).sqrt() }
}

/// A point of the convex hull of `vertices` (at least one) from one free number for each: weights are squares of the unit
/// vector `xi / |xi|`; the last number is slack, it belongs to the first vertex like what the others leave.
pub fn hull_point(vertices: &[Vector3<f64>], xi: &[f64]) -> Vector3<f64> {
    let inverse = 1.0 / squared(xi);
    let others = vertices[1..].iter().zip(xi);
    others.fold(vertices[0], |q, (v, x)| q + (v - vertices[0]) * (x * x * inverse))
}

/// Gradient by the free numbers from that by the point.
pub fn hull_gradient(vertices: &[Vector3<f64>], xi: &[f64], by_point: &Vector3<f64>, by_xi: &mut [f64]) {
    let size = squared(xi).sqrt();
    let mut along = 0.0;
    for k in 0..xi.len() {
        let unit = xi[k] / size;
        by_xi[k] = vertices.get(k + 1).map_or(0.0, |v| 2.0 * unit * (v - vertices[0]).dot(by_point));
        along += unit * by_xi[k];
    }
    for (g, x) in by_xi.iter_mut().zip(xi) {
        *g = (*g - x / size * along) / size;
    }
}

/// Free numbers of a point of the hull, nearly: no weight is exactly zero, where the map has no slope.
pub fn hull_inverse(vertices: &[Vector3<f64>], point: &Vector3<f64>, xi: &mut [f64]) {
    let n = vertices.len();
    let mut weights = vec![1.0 / n as f64; n];
    let mut q = vertices.iter().fold(Vector3::zeros(), |s, v| s + v / n as f64);
    // Frank-Wolfe with away steps: toward the vertex that helps most, or away from the one that hurts most.
    for _ in 0..2000 {
        let left = point - q;
        if left.norm() < 1e-9 {
            break;
        }
        let score = |k: usize| left.dot(&(vertices[k] - q));
        let mut best = 0;
        let mut worst = usize::MAX;
        for k in 0..n {
            if score(k) > score(best) {
                best = k;
            }
            if weights[k] > 0.0 && (worst == usize::MAX || score(k) < score(worst)) {
                worst = k;
            }
        }
        let (k, longest) = if worst == usize::MAX || score(best) >= -score(worst) || weights[worst] >= 1.0 {
            (best, 1.0)
        } else {
            (worst, -weights[worst] / (1.0 - weights[worst]))
        };
        let way = vertices[k] - q;
        let share = left.dot(&way) / way.norm_squared().max(1e-300);
        let share = if longest > 0.0 { share.clamp(0.0, longest) } else { share.clamp(longest, 0.0) };
        weights.iter_mut().for_each(|w| *w *= 1.0 - share);
        weights[k] = (weights[k] + share).max(0.0);
        q += way * share;
    }
    for k in 0..n - 1 {
        xi[k] = weights[k + 1].max(1e-4).sqrt();
    }
    xi[n - 1] = weights[0].max(1e-4).sqrt();
}

/// A point of the closed ball: `centre + 2 r xi / (1 + |xi|^2)`.
pub fn ball_point(centre: &Vector3<f64>, radius_m: f64, xi: &[f64; 3]) -> Vector3<f64> {
    let x = Vector3::from(*xi);
    centre + x * (2.0 * radius_m / (1.0 + x.norm_squared()))
}

/// Gradient by the free numbers from that by the point.
pub fn ball_gradient(radius_m: f64, xi: &[f64; 3], by_point: &Vector3<f64>) -> [f64; 3] {
    let x = Vector3::from(*xi);
    let scale = 2.0 * radius_m / (1.0 + x.norm_squared());
    ((by_point - x * (2.0 * x.dot(by_point) / (1.0 + x.norm_squared()))) * scale).into()
}

/// Free numbers of a point of the ball; a point outside is moved to the border.
pub fn ball_inverse(centre: &Vector3<f64>, radius_m: f64, point: &Vector3<f64>) -> [f64; 3] {
    let y = (point - centre) / radius_m;
    let r = y.norm().min(1.0);
    if r < 1e-12 {
        return [0.0; 3];
    }
    // |y| = 2 x / (1 + x^2), the root with x <= 1.
    (y / y.norm() * (r / (1.0 + (1.0 - r * r).sqrt()))).into()
}

fn squared(xi: &[f64]) -> f64 {
    xi.iter().map(|x| x * x).sum()
}
