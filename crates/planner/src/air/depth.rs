//! The deepest point of an intersection of half-spaces: a linear program in four variables.
//!
//! `max t  such that  n_i . x + t <= d_i` (unit normals). A feasible start is always known (any x, and t small), so a
//! primal-dual interior-point method needs no first phase, and a negative optimum says that nothing is inside.

use nalgebra::{Matrix4, Vector3, Vector4};

use super::polytope::HalfSpace;

/// Iterations; it converges in ten to twenty.
const MAX_ITERATIONS: usize = 60;
/// Complementarity at which the point is as deep as rounding lets it be, and at which it is deep enough where the
/// factorisation fails first (m, in units of the multipliers, which sum to 1).
const CLOSED: f64 = 1e-11;
const NEARLY_CLOSED: f64 = 1e-6;
/// Where the faces leave the point free, it is no deeper than this (m).
const DEEPEST_M: f64 = 1e3;

/// The deepest point of a set of half-spaces and its distance to the nearest face: negative if nothing is inside (then the
/// point violates the faces least). `near` is only where to begin. `None` if it did not converge (unbounded directions or
/// numbers that are not finite).
pub fn deepest_point<'a>(
    faces: impl Iterator<Item = &'a HalfSpace> + Clone,
    near: &Vector3<f64>,
) -> Option<(Vector3<f64>, f64)> {
    // Rows n, 1; the last one is t <= DEEPEST_M.
    let row = |face: &HalfSpace| Vector4::new(face.normal.x, face.normal.y, face.normal.z, 1.0);
    let cap = (Vector4::new(0.0, 0.0, 0.0, 1.0), DEEPEST_M);
    let rows: Vec<(Vector4<f64>, f64)> =
        faces.map(|face| (row(face), face.offset_m - face.normal.dot(near))).chain([cap]).collect();
    let least = rows.iter().map(|r| r.1).fold(f64::INFINITY, f64::min);
    if !least.is_finite() {
        return None;
    }
    let mut y = Vector4::new(0.0, 0.0, 0.0, least - 1.0);
    let count = rows.len() as f64;
    let mut slack: Vec<f64> = rows.iter().map(|(n, d)| d - n.dot(&y)).collect();
    let mut dual = vec![1.0 / count; rows.len()];
    let cost = Vector4::new(0.0, 0.0, 0.0, -1.0);
    let mut correction = vec![0.0; rows.len()];
    for iteration in 0..=MAX_ITERATIONS {
        let gap = slack.iter().zip(&dual).map(|(s, z)| s * z).sum::<f64>() / count;
        let unmet = rows.iter().zip(&dual).fold(cost, |sum, ((n, _), z)| sum + n * *z);
        // The point itself is inside at every iteration: what is left open is only whether a deeper one exists.
        let found = Some((near + y.xyz(), y.w));
        if gap < CLOSED && unmet.amax() < 1e-7 {
            return found;
        }
        if iteration == MAX_ITERATIONS {
            return if gap < NEARLY_CLOSED && unmet.amax() < 1e-3 { found } else { None };
        }
        let mut matrix = Matrix4::zeros();
        for (((n, _), s), z) in rows.iter().zip(&slack).zip(&dual) {
            matrix += n * n.transpose() * (z / s);
        }
        // Directions that no face bounds: a little of the identity keeps the point where it is.
        matrix += Matrix4::identity() * (1e-14 * matrix.trace());
        let Some(factor) = matrix.cholesky() else {
            return if gap < NEARLY_CLOSED && unmet.amax() < 1e-3 { found } else { None };
        };
        // Mehrotra: first toward gap 0, then with the centring and the second-order term that this suggests.
        let mut target = 0.0;
        correction.fill(0.0);
        for pass in 0..2 {
            let mut right = -cost;
            for (((n, _), s), c) in rows.iter().zip(&slack).zip(&correction) {
                right -= n * ((target - c) / s);
            }
            let step = factor.solve(&right);
            let mut shortest = 1.0f64;
            let mut after = 0.0;
            let each = rows.iter().zip(&slack).zip(&dual).zip(&correction);
            let moves: Vec<(f64, f64)> = each
                .map(|((((n, _), s), z), c)| {
                    let ds = -n.dot(&step);
                    (ds, (target - c) / s - z - z / s * ds)
                })
                .collect();
            for ((s, z), (ds, dz)) in slack.iter().zip(&dual).zip(&moves) {
                if *ds < 0.0 {
                    shortest = shortest.min(-0.995 * s / ds);
                }
                if *dz < 0.0 {
                    shortest = shortest.min(-0.995 * z / dz);
                }
            }
            if pass == 0 {
                for ((s, z), (ds, dz)) in slack.iter().zip(&dual).zip(&moves) {
                    after += (s + shortest * ds) * (z + shortest * dz);
                }
                let ratio = after / count / gap;
                target = gap * ratio * ratio * ratio;
                for (c, (ds, dz)) in correction.iter_mut().zip(&moves) {
                    *c = ds * dz;
                }
            } else {
                y += step * shortest;
                for ((z, s), ((n, d), (_, dz))) in dual.iter_mut().zip(&mut slack).zip(rows.iter().zip(&moves)) {
                    *s = (d - n.dot(&y)).max(1e-300);
                    *z += shortest * dz;
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::air::polytope::Polytope;
    use nalgebra::Point3;

    fn depth(low: [f64; 3], high: [f64; 3]) -> Option<(Vector3<f64>, f64)> {
        let polytope = Polytope::from_box(&Point3::from(low), &Point3::from(high));
        deepest_point(polytope.faces.iter(), &Vector3::new(7.0, -3.0, 2.0))
    }

    #[test]
    fn depth_of_boxes() {
        let (p, t) = depth([0.0; 3], [2.0, 4.0, 6.0]).unwrap();
        assert!((t - 1.0).abs() < 1e-8 && (p.x - 1.0).abs() < 1e-8, "{p} {t}");
        // Flat: a depth of zero. Inside out: negative by half the gap.
        assert!(depth([0.0; 3], [2.0, 4.0, 0.0]).unwrap().1.abs() < 1e-8);
        assert!((depth([0.0; 3], [2.0, 4.0, -1.0]).unwrap().1 + 0.5).abs() < 1e-8);
        assert_eq!(depth([0.0; 3], [2.0, 4.0, f64::NAN]), None);
        assert_eq!(deepest_point([].iter(), &Vector3::zeros()).map(|d| d.1.round()), Some(DEEPEST_M));
    }
}
