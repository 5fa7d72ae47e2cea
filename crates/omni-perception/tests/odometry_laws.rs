//! Laws of the filter's parts: manifold, prediction, update, map.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::odometry::degeneracy::Degeneracy;
use omni_perception::odometry::plane::{Moments, PlaneTest};
use omni_perception::odometry::propagation::{ImuInput, propagate_covariance, step, symmetric, transition};
use omni_perception::odometry::state::{
    ACCEL_BIAS, Covariance, DOF, GRAVITY, GYRO_BIAS, ImuState, POSITION, ROTATION, Tangent, VELOCITY,
};
use omni_perception::odometry::update::{NormalEquations, PlaneResidual, update};
use omni_perception::{LioConfig, Stamp};
use proptest::prelude::*;

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    vector(3.0).prop_map(UnitQuaternion::from_scaled_axis)
}

fn state() -> impl Strategy<Value = ImuState> {
    (vector(10.0), rotation(), vector(3.0), vector(0.05), vector(0.3), rotation()).prop_map(
        |(position_m, rotation, velocity_mps, gyro_bias_radps, accel_bias_mps2, gravity_frame)| ImuState {
            stamp: Stamp(7_000_000_000),
            position_m,
            rotation,
            velocity_mps,
            gyro_bias_radps,
            accel_bias_mps2,
            gravity_frame,
        },
    )
}

fn input() -> impl Strategy<Value = ImuInput> {
    (vector(15.0), vector(30.0)).prop_map(|(rate_radps, force_mps2)| ImuInput {
        rate_radps,
        force_mps2,
        is_coasting: false,
    })
}

fn tangent(size: f64) -> impl Strategy<Value = Tangent> {
    prop::collection::vec(-size..size, DOF).prop_map(|numbers| Tangent::from_column_slice(&numbers))
}

/// A covariance of any correlations: L L^T with the scale of a tracked state, and a little of its own in each direction.
fn covariance() -> impl Strategy<Value = Covariance> {
    prop::collection::vec(-1.0..1.0_f64, DOF * DOF).prop_map(|numbers| {
        let factor = Covariance::from_column_slice(&numbers) * 0.02;
        symmetric(&(factor * factor.transpose() + Covariance::identity() * 1e-6))
    })
}

/// A few planes all round, each with a point near it.
fn residuals() -> impl Strategy<Value = Vec<(Vector3<f64>, Vector3<f64>, f64)>> {
    let one = (vector(5.0), vector(1.0), -0.05..0.05_f64);
    prop::collection::vec(one, 3..40).prop_map(|all| {
        all.into_iter().filter(|(_, n, _)| n.norm() > 0.1).map(|(p, n, r)| (p, n.normalize(), r)).collect()
    })
}

fn at(state: &ImuState, points: &[(Vector3<f64>, Vector3<f64>, f64)]) -> Vec<PlaneResidual> {
    points
        .iter()
        .map(|&(point, normal, height_m)| PlaneResidual {
            point,
            normal,
            distance_m: normal.dot(&(state.rotation * point + state.position_m)) - height_m,
            variance_m2: 4e-4,
        })
        .collect()
}

mod manifold {
    use super::*;

    proptest! {
        #[test]
        fn boxminus_undoes_boxplus(state in state(), error in tangent(0.8)) {
            prop_assert!((state.boxplus(&error).boxminus(&state) - error).amax() < 1e-9);
        }

        #[test]
        fn boxplus_undoes_boxminus(from in state(), to in state()) {
            // Opposite directions of gravity have no shortest turn.
            prop_assume!(from.gravity_mps2().dot(&to.gravity_mps2()) > -95.0);
            let there = from.boxplus(&to.boxminus(&from));
            prop_assert!((there.position_m - to.position_m).norm() < 1e-9);
            prop_assert!(there.rotation.angle_to(&to.rotation) < 1e-7);
            prop_assert!((there.gravity_mps2() - to.gravity_mps2()).norm() < 1e-6);
        }

        #[test]
        fn gravity_keeps_its_length_and_its_jacobian_is_its_derivative(state in state(), error in tangent(1e-5)) {
            let moved = state.boxplus(&error);
            prop_assert!((moved.gravity_mps2().norm() - 9.81).abs() < 1e-9);
            let linear = state.gravity_jacobian() * error.fixed_rows::<2>(GRAVITY);
            prop_assert!((moved.gravity_mps2() - state.gravity_mps2() - linear).norm() < 1e-8);
        }
    }
}

mod prediction {
    use super::*;

    proptest! {
        #[test]
        fn the_transition_is_the_derivative_of_the_step(state in state(), input in input(), dt_ms in 1_i64..20) {
            let until = state.stamp.plus_ns(dt_ms * 1_000_000);
            let exact = transition(&state, &input, until);
            let (end, _) = step(&state, &input, until);
            const H: f64 = 1e-6;
            for column in 0..DOF {
                let mut error = Tangent::zeros();
                error[column] = H;
                let plus = step(&state.boxplus(&error), &input, until).0.boxminus(&end);
                let minus = step(&state.boxplus(&-error), &input, until).0.boxminus(&end);
                let numeric = (plus - minus) / (2.0 * H);
                prop_assert!((numeric - exact.column(column)).amax() < 1e-6, "column {column}: {}", numeric - exact.column(column));
            }
        }

        #[test]
        fn covariance_stays_positive_definite(
            state in state(), start in covariance(), inputs in prop::collection::vec(input(), 1..60)
        ) {
            let (mut state, mut covariance) = (state, start);
            for input in &inputs {
                let until = state.stamp.plus_ns(5_000_000);
                covariance = propagate_covariance(&covariance, &state, input, until, &LioConfig::default(), 1.0);
                state = step(&state, input, until).0;
            }
            prop_assert!(covariance.cholesky().is_some());
            prop_assert_eq!(covariance, covariance.transpose());
        }

        #[test]
        fn one_long_step_is_many_short_ones_for_constant_input(state in state(), rate in vector(0.5), force in vector(5.0)) {
            // Exact in rotation; the mid-point of the force leaves a remainder of third order.
            let input = ImuInput { rate_radps: rate, force_mps2: force, is_coasting: false };
            let (long, _) = step(&state, &input, state.stamp.plus_ns(10_000_000));
            let (mut short, mut at) = (state, state.stamp);
            for _ in 0..10 {
                at = at.plus_ns(1_000_000);
                short = step(&short, &input, at).0;
            }
            prop_assert!(long.rotation.angle_to(&short.rotation) < 1e-7);
            prop_assert!((long.velocity_mps - short.velocity_mps).norm() < 1e-6);
            prop_assert!((long.position_m - short.position_m).norm() < 1e-6);
        }
    }
}

mod correction {
    use super::*;

    fn all(_: &NormalEquations) -> Matrix6<f64> {
        Matrix6::identity()
    }

    proptest! {
        #[test]
        fn the_gradient_is_the_derivative_of_the_residuals(state in state(), points in residuals()) {
            const H: f64 = 1e-6;
            for residual in at(&state, &points) {
                let one = NormalEquations::new(&state, &[residual]);
                // gradient = -H^T W r, so H = -gradient / (W r); the weight cancels in the ratio of two states' values.
                for k in 0..6 {
                    let mut error = Tangent::zeros();
                    error[k] = H;
                    let slope = (residual.value(&state.boxplus(&error)) - residual.value(&state.boxplus(&-error))) / (2.0 * H);
                    let weight = if residual.value(&state).abs() > 1e-9 {
                        let gradient: f64 = one.gradient[k];
                        prop_assert!((gradient + slope * weight_of(&residual, &state) * residual.value(&state)).abs() < 1e-4 * (1.0 + gradient.abs()));
                        weight_of(&residual, &state)
                    } else {
                        1.0 / residual.variance_m2
                    };
                    prop_assert!((one.information[(k, k)] - weight * slope * slope).abs() < 1e-4 * (1.0 + one.information[(k, k)]));
                }
            }
        }

        #[test]
        fn an_update_reaches_the_least_squares_solution(state in state(), covariance in covariance(), points in residuals()) {
            // The textbook form on all 17 numbers at the solution: P^-1 e = -H^T W r, with the residuals small enough to be linear.
            let residuals = at(&state, &points.iter().map(|&(p, n, r)| (p, n, 0.02 * r)).collect::<Vec<_>>());
            let updated = update(&state, &covariance, &state, &residuals, 30, all).expect("positive definite");
            let error = updated.state.boxminus(&state);
            let pull = covariance.cholesky().expect("positive definite").solve(&error);
            let push = NormalEquations::new(&updated.state, &residuals).gradient;
            let scale = 1.0 + push.amax();
            for k in 0..DOF {
                let expected = if k < 6 { push[k] } else { 0.0 };
                prop_assert!((pull[k] - expected).abs() < 0.02 * scale, "{k}: {} {expected}", pull[k]);
            }
        }

        #[test]
        fn the_posterior_is_smaller_and_positive_definite(state in state(), covariance in covariance(), points in residuals()) {
            let residuals = at(&state, &points);
            let updated = update(&state, &covariance, &state, &residuals, 4, all).expect("positive definite");
            prop_assert!(updated.covariance.cholesky().is_some());
            let shrunk = covariance - updated.covariance;
            prop_assert!(shrunk.trace() > -1e-9);
            // Held directions: still positive definite, and the state does not move along them.
            let axis = points[0].1;
            let degeneracy = Degeneracy { translations: vec![axis], ..Degeneracy::default() };
            let held = update(&state, &covariance, &state, &residuals, 4, |_| degeneracy.keep()).expect("positive definite");
            prop_assert!(held.covariance.cholesky().is_some());
            prop_assert!((held.state.position_m - state.position_m).dot(&axis).abs() < 1e-9);
            prop_assert!((held.state.velocity_mps - state.velocity_mps).dot(&axis).abs() < 1e-9);
            let along = |c: &Covariance| axis.dot(&(c.fixed_view::<3, 3>(POSITION, POSITION) * axis));
            prop_assert!(along(&held.covariance) > 0.9 * along(&covariance));
        }

        #[test]
        fn an_update_turns_with_the_world(
            state in state(), covariance in covariance(), points in residuals(), yaw in -3.0..3.0_f64, shift in vector(20.0)
        ) {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
            let new_from_old = Isometry3::from_parts(Translation3::from(shift), turn);
            let moved = |s: &ImuState| ImuState {
                position_m: (new_from_old * Point3::from(s.position_m)).coords,
                rotation: turn * s.rotation,
                velocity_mps: turn * s.velocity_mps,
                gravity_frame: turn * s.gravity_frame,
                ..*s
            };
            let mut jacobian = Covariance::identity();
            for block in [POSITION, VELOCITY] {
                jacobian.fixed_view_mut::<3, 3>(block, block).copy_from(&turn.to_rotation_matrix().into_inner());
            }
            let residuals = at(&state, &points);
            let turned: Vec<PlaneResidual> = residuals
                .iter()
                .map(|r| PlaneResidual { normal: turn * r.normal, distance_m: r.distance_m + (turn * r.normal).dot(&shift), ..*r })
                .collect();
            let here = update(&state, &covariance, &state, &residuals, 4, all).expect("positive definite");
            let covariance = symmetric(&(jacobian * covariance * jacobian.transpose()));
            let there = update(&moved(&state), &covariance, &moved(&state), &turned, 4, all).expect("positive definite");
            let expected = moved(&here.state);
            // Rounding moves a residual across its gate now and then: hundredths of a millimetre, not more.
            prop_assert!((there.state.position_m - expected.position_m).norm() < 1e-5);
            prop_assert!(there.state.rotation.angle_to(&expected.rotation) < 1e-5);
            prop_assert!((there.state.gyro_bias_radps - expected.gyro_bias_radps).norm() < 1e-5);
            let expected = jacobian * here.covariance * jacobian.transpose();
            prop_assert!((there.covariance - expected).amax() < 1e-5);
        }

        #[test]
        fn without_residuals_nothing_changes(state in state(), covariance in covariance()) {
            let updated = update(&state, &covariance, &state, &[], 4, all).expect("positive definite");
            prop_assert!(updated.state.boxminus(&state).amax() < 1e-9);
            prop_assert!((updated.covariance - covariance).amax() < 1e-9);
        }
    }

    fn weight_of(residual: &PlaneResidual, state: &ImuState) -> f64 {
        let sigmas = residual.value(state).abs() / residual.variance_m2.sqrt();
        let robust = if sigmas > 2.0 { 2.0 / sigmas } else { 1.0 };
        robust / residual.variance_m2
    }

    #[test]
    fn the_error_state_is_laid_out_without_gaps() {
        assert_eq!([POSITION, ROTATION, VELOCITY, GYRO_BIAS, ACCEL_BIAS, GRAVITY, DOF], [0, 3, 6, 9, 12, 15, 17]);
    }
}

mod regions {
    use super::*;

    fn of(points: &[Vector3<f64>]) -> Moments {
        let mut all = Moments::default();
        points.iter().for_each(|p| all.merge(&Moments { count: 1.0, mean: *p, scatter: Matrix3::zeros() }));
        all
    }

    proptest! {
        #[test]
        fn moments_do_not_depend_on_how_points_are_grouped(points in prop::collection::vec(vector(2.0), 2..40), cut in 0.0..1.0_f64) {
            let cut = (points.len() as f64 * cut) as usize;
            let (mut left, right, whole) = (of(&points[..cut]), of(&points[cut..]), of(&points));
            left.merge(&right);
            prop_assert!((left.mean - whole.mean).norm() < 1e-12);
            prop_assert!((left.scatter - whole.scatter).amax() < 1e-9);
            let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
            let scatter: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
            prop_assert!((whole.mean - mean).norm() < 1e-12 && (whole.scatter - scatter).amax() < 1e-9);
        }

        #[test]
        fn points_on_a_plane_give_that_plane(
            normal in vector(1.0), distance in -5.0..5.0_f64, points in prop::collection::vec(vector(1.0), 12..40)
        ) {
            prop_assume!(normal.norm() > 0.1);
            let normal = normal.normalize();
            let flat: Vec<_> = points.iter().map(|p| p - normal * (normal.dot(p) - distance)).collect();
            let test = PlaneTest { min_count: 4.0, max_thickness_m: 0.02, min_width_m: 0.05 };
            if let Some(plane) = test.fit(&of(&flat)) {
                prop_assert!(plane.normal.dot(&normal).abs() > 1.0 - 1e-6);
                prop_assert!((plane.normal.dot(&plane.point.coords).abs() - distance.abs()).abs() < 1e-6);
            }
        }
    }
}
