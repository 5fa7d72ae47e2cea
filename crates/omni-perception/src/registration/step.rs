//! One Gauss-Newton step of generalised ICP: normal equations of the pairs, and their solution.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3, Vector6};

use crate::registration::surface::Surface;
use crate::registration::{Freedom, NONE, RegistrationConfig};

/// The normal equations of one round, in the source frame.
pub(crate) struct Sums {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    pub(crate) pairs: usize,
}

impl Sums {
    pub(crate) fn of(
        source: &Surface,
        target: &Surface,
        nearest: &[u32],
        target_from_source: &Isometry3<f64>,
        config: &RegistrationConfig,
    ) -> Sums {
        let source_from_target = target_from_source.inverse();
        let turn = source_from_target.rotation.to_rotation_matrix();
        // d^T M d of a pair that is robust_m apart along both normals.
        let half_weight_cost = config.robust_m * config.robust_m / (2.0 * config.flatness);
        let mut sums = Sums { information: Matrix6::zeros(), gradient: Vector6::zeros(), pairs: 0 };
        let (mut vv, mut vw, mut ww) = (Matrix3::zeros(), Matrix3::zeros(), Matrix3::zeros());
        let (mut gv, mut gw) = (Vector3::zeros(), Vector3::zeros());
        for (rank, index) in nearest.iter().enumerate() {
            if *index == NONE {
                continue;
            }
            let point = source.points()[rank].coords.cast::<f64>();
            let other = source_from_target * target.points()[*index as usize].cast::<f64>();
            let difference = other.coords - point;
            let normal_s = source.normals[rank].cast::<f64>();
            let normal_t = turn * target.normals[*index as usize].cast::<f64>();
            let metric = metric(&normal_s, &normal_t, config.flatness);
            let pull = metric * difference;
            let cost = difference.dot(&pull);
            // Cauchy: the weight of rho(c) = s log(1 + c / s).
            let weight = 1.0 / (1.0 + cost / half_weight_cost);
            let (metric, pull) = (metric * weight, pull * weight);
            // d(T Exp(v, w) p) = R (v + w x p): the Jacobian of d in the source frame is -[I, -hat(p)].
            let hat = point.cross_matrix();
            let metric_hat = metric * hat;
            vv += metric;
            vw -= metric_hat;
            ww -= hat * metric_hat;
            gv += pull;
            gw += point.cross(&pull);
            sums.pairs += 1;
        }
        sums.information.fixed_view_mut::<3, 3>(0, 0).copy_from(&vv);
        sums.information.fixed_view_mut::<3, 3>(0, 3).copy_from(&vw);
        sums.information.fixed_view_mut::<3, 3>(3, 0).copy_from(&vw.transpose());
        sums.information.fixed_view_mut::<3, 3>(3, 3).copy_from(&ww);
        sums.gradient.fixed_rows_mut::<3>(0).copy_from(&gv);
        sums.gradient.fixed_rows_mut::<3>(3).copy_from(&gw);
        sums
    }

    /// The Gauss-Newton step; `None` if some direction is open.
    pub(crate) fn solve(mut self, freedom: Freedom) -> Option<Vector6<f64>> {
        for axis in held(freedom) {
            self.gradient[*axis] = 0.0;
        }
        let step = hold(self.information, freedom).cholesky()?.solve(&self.gradient);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}

/// Coordinates of a step that may not move: turns about x and y.
pub(crate) fn held(freedom: Freedom) -> &'static [usize] {
    match freedom {
        Freedom::Free => &[],
        Freedom::Level => &[3, 4],
    }
}

/// The information matrix with the held coordinates cut out, so that it can be inverted.
pub(crate) fn hold(mut information: Matrix6<f64>, freedom: Freedom) -> Matrix6<f64> {
    for axis in held(freedom) {
        information.row_mut(*axis).fill(0.0);
        information.column_mut(*axis).fill(0.0);
        information[(*axis, *axis)] = 1.0;
    }
    information
}

/// The inverse of `C_source + C_target` for two surface points with these normals (zero: as free in every direction).
fn metric(a: &Vector3<f64>, b: &Vector3<f64>, flatness: f64) -> Matrix3<f64> {
    let k = 1.0 - flatness;
    // 2 I - k (a a^T + b b^T): symmetric, eigenvalues from 2 e to 2, so the inverse by cofactors is safe.
    let xx = 2.0 - k * (a.x * a.x + b.x * b.x);
    let yy = 2.0 - k * (a.y * a.y + b.y * b.y);
    let zz = 2.0 - k * (a.z * a.z + b.z * b.z);
    let xy = -k * (a.x * a.y + b.x * b.y);
    let xz = -k * (a.x * a.z + b.x * b.z);
    let yz = -k * (a.y * a.z + b.y * b.z);
    let (cxx, cxy, cxz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (cyy, cyz, czz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let over = 1.0 / (xx * cxx + xy * cxy + xz * cxz);
    Matrix3::new(cxx, cxy, cxz, cxy, cyy, cyz, cxz, cyz, czz) * over
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::registration::tests::{corner, rooms};
    use crate::registration::{Cloud, pair};

    #[test]
    fn the_metric_is_the_inverse_of_both_covariances() {
        let (a, b) = (Vector3::new(0.6, 0.0, 0.8), Vector3::new(0.0, 1.0, 0.0));
        let of = |n: &Vector3<f64>| Matrix3::identity() - 0.98 * n * n.transpose();
        assert!((metric(&a, &b, 0.02) * (of(&a) + of(&b)) - Matrix3::identity()).norm() < 1e-12);
        assert!(
            (metric(&Vector3::zeros(), &Vector3::zeros(), 0.02) - Matrix3::from_diagonal_element(0.5)).norm() < 1e-12
        );
    }

    #[test]
    fn the_gradient_is_the_derivative_of_the_cost() {
        // Weights that do not change with the pose: the robust scale is out of reach.
        let config = RegistrationConfig { robust_m: 1e6, ..rooms() };
        let source = Surface::new(&corner(), &config, Cloud::Source).unwrap();
        let target = Surface::new(&corner(), &config, Cloud::Target).unwrap();
        let pose = Isometry3::new(Vector3::new(0.03, -0.02, 0.01), Vector3::new(0.02, -0.01, 0.03));
        let mut nearest = vec![NONE; source.points().len()];
        pair(&source, &target, &pose, &config, &mut nearest);
        let sums = Sums::of(&source, &target, &nearest, &pose, &config);
        // Pairs and metrics are those of `pose`, as in a Gauss-Newton step.
        let cost = |moved: &Isometry3<f64>| -> f64 {
            let each = source.points().iter().zip(&source.normals).zip(&nearest);
            each.filter(|(_, index)| **index != NONE)
                .map(|((point, normal), index)| {
                    let normal = pose.rotation * normal.cast::<f64>();
                    let metric = metric(&normal, &target.normals[*index as usize].cast::<f64>(), config.flatness);
                    let d = target.points()[*index as usize].cast::<f64>() - moved * point.cast::<f64>();
                    d.dot(&(metric * d))
                })
                .sum()
        };
        const STEP: f64 = 1e-6;
        for axis in 0..6 {
            let nudge = |h: f64| {
                let mut step = Vector6::zeros();
                step[axis] = h;
                let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
                pose * Isometry3::from_parts(step.fixed_rows::<3>(0).into_owned().into(), turn)
            };
            let numeric = (cost(&nudge(STEP)) - cost(&nudge(-STEP))) / (2.0 * STEP);
            // gradient = -1/2 dcost/dstep; central differences of sums over 4000 pairs.
            assert!((sums.gradient[axis] + 0.5 * numeric).abs() < 1e-4 * (1.0 + numeric.abs()), "axis {axis}");
        }
    }
}
