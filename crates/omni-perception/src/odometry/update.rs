//! The iterated update: the state that agrees best with the prediction and with the planes of the map.
//!
//! ```text
//! minimise  |x - x_hat|^2_P + sum_i w_i r_i(x)^2,    r = n . (R q + p) - d      (FAST-LIO2 Eq. 14)
//! H_i = [n^T, (q x R^T n)^T]  for (p, theta);   A = H^T W H, g = -H^T W r       6 x 6 and 6
//! e  = P_6 (I + A P_66)^-1 (A e_6 + g)          the next error from the prediction
//! P' = P - P_6 (I + A P_66)^-1 A P_6^T
//! ```
//! with P_6 the first six columns of P. The form is exact Gauss-Newton in the tangent of the prediction (the columns
//! of theta are multiplied by Jr(e_theta)), costs one Cholesky of 6 x 6 whatever the number of points, and needs no
//! inverse of P, which may be nearly singular.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

use crate::odometry::propagation::symmetric;
use crate::odometry::state::{Covariance, DOF, ImuState, POSITION, ROTATION, Tangent, VELOCITY, right_jacobian};

/// Residuals larger than this many standard deviations lose weight (Huber).
const HUBER_SIGMAS: f64 = 2.0;
/// A step below this many metres and radians ends the iteration.
const CONVERGED_STEP: f64 = 1e-5;

/// One weighted point and its plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneResidual {
    /// The point in the IMU frame at the time of the state.
    pub point: Vector3<f64>,
    /// Unit normal of the plane in the world.
    pub normal: Vector3<f64>,
    /// Distance of the plane along its normal: 0 = normal . x - distance.
    pub distance_m: f64,
    /// Variance of the residual, m^2.
    pub variance_m2: f64,
}

impl PlaneResidual {
    /// Height of the point above the plane.
    pub fn value(&self, state: &ImuState) -> f64 {
        self.normal.dot(&(state.rotation * self.point + state.position_m)) - self.distance_m
    }
}

/// Everything the residuals say at one state: the normal equations of (p, theta).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalEquations {
    /// H^T W H.
    pub information: Matrix6<f64>,
    /// -H^T W r.
    pub gradient: Vector6<f64>,
    /// Sum of n n^T over the residuals that keep their weight: how many cells look along each direction.
    pub directions: Matrix3<f64>,
    /// The same for turns: sum of (q x R^T n)(q x R^T n)^T / |q|^2.
    pub turns: Matrix3<f64>,
    /// Sum of the weighted squares.
    pub cost: f64,
}

impl NormalEquations {
    /// Adds the residuals up, in their order.
    pub fn new(state: &ImuState, residuals: &[PlaneResidual]) -> NormalEquations {
        let rotation = state.rotation.to_rotation_matrix().into_inner();
        let mut upper = [0.0; 21];
        let mut gradient = [0.0; 6];
        let (mut directions, mut turns) = (Matrix3::zeros(), Matrix3::zeros());
        let mut cost = 0.0;
        for residual in residuals {
            let value = residual.normal.dot(&(rotation * residual.point + state.position_m)) - residual.distance_m;
            let sigmas = (value * value / residual.variance_m2).sqrt();
            let robust = if sigmas > HUBER_SIGMAS { HUBER_SIGMAS / sigmas } else { 1.0 };
            let weight = robust / residual.variance_m2;
            let normal = residual.normal;
            let turn = residual.point.cross(&(rotation.tr_mul(&normal)));
            let row = [normal.x, normal.y, normal.z, turn.x, turn.y, turn.z];
            let mut k = 0;
            for i in 0..6 {
                let weighted = weight * row[i];
                gradient[i] -= weighted * value;
                for other in &row[i..] {
                    upper[k] += weighted * other;
                    k += 1;
                }
            }
            directions += normal * normal.transpose() * robust;
            turns += turn * turn.transpose() * (robust / residual.point.norm_squared().max(1e-6));
            cost += weight * value * value;
        }
        let mut information = Matrix6::zeros();
        let mut k = 0;
        for i in 0..6 {
            for j in i..6 {
                information[(i, j)] = upper[k];
                information[(j, i)] = upper[k];
                k += 1;
            }
        }
        NormalEquations { information, gradient: Vector6::from(gradient), directions, turns, cost }
    }

    /// The same without what it says outside the kept directions: Zhang, Kaess, Singh 2016, as a projection.
    pub fn projected(&self, keep: &Matrix6<f64>) -> NormalEquations {
        NormalEquations {
            information: keep * self.information * keep.transpose(),
            gradient: keep * self.gradient,
            ..*self
        }
    }
}

/// The outcome of an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Updated {
    /// The state.
    pub state: ImuState,
    /// Its covariance.
    pub covariance: Covariance,
    /// Normal equations at the last step.
    pub equations: NormalEquations,
    /// Steps taken.
    pub iterations: usize,
    /// Whether the last step was below a hundredth of a millimetre.
    pub has_converged: bool,
}

/// Iterates from `start` (the prediction, or a better guess). `keep` projects the measurements
/// ([`NormalEquations::projected`]); what it leaves out of the position is not corrected at all, nor is the velocity there:
/// the walls of a corridor are known to a millimetre, and a map bent by a thousandth would else move the state along it
/// through the correlations (a "consider" update, Schmidt 1966).
/// `None` if the covariance of the pose is not positive definite or a number is not finite.
pub fn update(
    predicted: &ImuState,
    covariance: &Covariance,
    start: &ImuState,
    residuals: &[PlaneResidual],
    max_iterations: usize,
    keep: impl Fn(&NormalEquations) -> Matrix6<f64>,
) -> Option<Updated> {
    let columns: SMatrix<f64, DOF, 6> = covariance.fixed_columns::<6>(0).into_owned();
    let pose: Matrix6<f64> = covariance.fixed_view::<6, 6>(0, 0).into_owned();
    // P_66 = C C^T; then (I + A P_66)^-1 A = C^-T (I - (I + B)^-1) C^-1 with B = C^T A C, symmetric.
    let factor = pose.cholesky()?.l();
    let mut state = *start;
    let mut error = state.boxminus(predicted);
    for iteration in 1.. {
        let equations = NormalEquations::new(&state, residuals);
        let kept = keep(&equations);
        let equations = equations.projected(&kept);
        let held = held(&kept);
        let turned = in_tangent_of_prediction(&equations, &error);
        let (information, gradient) = (&turned.information, &turned.gradient);
        let inner = (Matrix6::identity() + factor.transpose() * information * factor).cholesky()?;
        // (I + A C C^T)^-1 = C^-T (I + B)^-1 C^T.
        let error_of_pose: Vector6<f64> = error.fixed_rows::<6>(0).into_owned();
        let pull = information * error_of_pose + gradient;
        let solved = inner.solve(&(factor.transpose() * pull));
        let solved = factor.transpose().solve_upper_triangular(&solved)?;
        let next: Tangent = held.map_or_else(|| columns * solved, |held| held * (columns * solved));
        let step = (next - error).fixed_rows::<6>(0).amax();
        error = next;
        state = predicted.boxplus(&error);
        if !state.is_finite() {
            return None;
        }
        let has_converged = step < CONVERGED_STEP;
        if has_converged || iteration >= max_iterations {
            let whitened: SMatrix<f64, 6, DOF> = factor.solve_lower_triangular(&columns.transpose())?;
            let share = Matrix6::identity() - inner.inverse();
            let posterior = covariance - whitened.transpose() * share * whitened;
            let posterior = match &held {
                Some(held) => considered(covariance, &posterior, information, held),
                None => posterior,
            };
            let covariance = symmetric(&reset(&posterior, &error));
            return Some(Updated { state, covariance, equations, iterations: iteration, has_converged });
        }
    }
    None
}

/// The projection of the whole error that leaves out what `kept` leaves out of the pose; `None` for none.
fn held(kept: &Matrix6<f64>) -> Option<Covariance> {
    if *kept == Matrix6::identity() {
        return None;
    }
    let mut held = Covariance::identity();
    let translations = kept.fixed_view::<3, 3>(0, 0);
    held.fixed_view_mut::<3, 3>(POSITION, POSITION).copy_from(&translations);
    held.fixed_view_mut::<3, 3>(VELOCITY, VELOCITY).copy_from(&translations);
    held.fixed_view_mut::<3, 3>(ROTATION, ROTATION).copy_from(&kept.fixed_view::<3, 3>(3, 3));
    Some(held)
}

/// Covariance after an update whose gain was cut to `held` K: Joseph's form, right for any gain.
/// K H = P' A and K R K^T = P' A P' with A = H^T W H in the first six rows and columns.
fn considered(prior: &Covariance, posterior: &Covariance, information: &Matrix6<f64>, held: &Covariance) -> Covariance {
    let columns: SMatrix<f64, DOF, 6> = held * posterior.fixed_columns::<6>(0);
    let mut left = Covariance::identity();
    let mut cut = left.fixed_columns_mut::<6>(0);
    cut -= columns * information;
    left * prior * left.transpose() + columns * information * columns.transpose()
}

/// The columns of theta times Jr(e_theta): from the tangent of the current state to that of the prediction.
fn in_tangent_of_prediction(equations: &NormalEquations, error: &Tangent) -> NormalEquations {
    let mut jacobian = Matrix6::identity();
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&right_jacobian(&error.fixed_rows::<3>(ROTATION).into_owned()));
    NormalEquations {
        information: jacobian.transpose() * equations.information * jacobian,
        gradient: jacobian.transpose() * equations.gradient,
        ..*equations
    }
}

/// Moves the covariance from the tangent of the prediction to that of the new state.
fn reset(covariance: &Covariance, error: &Tangent) -> Covariance {
    let mut jacobian = Covariance::identity();
    jacobian
        .fixed_view_mut::<3, 3>(ROTATION, ROTATION)
        .copy_from(&right_jacobian(&error.fixed_rows::<3>(ROTATION).into_owned()));
    jacobian * covariance * jacobian.transpose()
}
