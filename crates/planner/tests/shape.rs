//! Flatness, free numbers, penalties and the shape of a flight: derivatives, inverses, stored vectors.
#![cfg(feature = "air")]
mod support;

use nalgebra::{Point3, Quaternion, Vector3};
use planner::air::diffeomorphism::*;
use planner::air::lbfgs::{LbfgsSettings, LbfgsStatus};
use planner::air::penalty::{PenalisedSpline, PenaltyError, PenaltyWeights};
use planner::air::shape::{Place, shape};
use planner::{Airframe, FlightLimits, MincoGradient, Polytope};
use proptest::prelude::*;
use support::{corridors, numbers, shared_aerial};

fn vector(reach: f64) -> impl Strategy<Value = Vector3<f64>> {
    proptest::array::uniform3(-reach..reach).prop_map(Vector3::from)
}

/// Tighter than usual, so that random flights break every one of them.
fn limits() -> FlightLimits {
    FlightLimits {
        max_speed_mps: 3.0,
        max_tilt_rad: 0.6,
        max_rate_radps: 1.5,
        min_thrust_n: 4.0,
        max_thrust_n: 8.0,
        ..corridors::limits(false)
    }
}

#[test]
fn flatness_equals_the_stored_vectors() {
    let Some(text) = shared_aerial("flatness_vectors.json") else { return };
    let cases: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut worst = 0.0f64;
    for case in cases.as_array().unwrap() {
        let number = |key: &str| case[key].as_f64().unwrap();
        let three = |key: &str| Vector3::from_iterator(numbers(&case[key]));
        let four = |key: &str| {
            let q = numbers(&case[key]);
            Quaternion::new(q[0], q[1], q[2], q[3])
        };
        let airframe = Airframe {
            mass_kg: number("mass"),
            gravity_mps2: number("g"),
            drag_across: number("dh"),
            drag_along: number("dv"),
            drag_parasitic: number("cp"),
            speed_epsilon: number("eps"),
        };
        let (v, a, j) = (three("vel"), three("acc"), three("jerk"));
        let out = airframe.demand(&v, &a, &j, number("yaw"), number("yaw_rate"));
        let g =
            airframe.demand_reverse(&v, &a, &j, number("yaw"), number("g_thrust"), &four("g_quat"), &three("g_omega"));
        let relative = |difference: f64, size: f64| difference / size.max(1.0);
        worst = worst
            .max(relative((out.thrust_n - number("thrust")).abs(), number("thrust").abs()))
            .max((out.attitude - four("quat_wxyz")).norm())
            .max(relative((out.body_rate_radps - three("omega")).norm(), three("omega").norm()))
            .max(relative((g.velocity - three("grad_vel")).norm(), three("grad_vel").norm()))
            .max(relative((g.acceleration - three("grad_acc")).norm(), three("grad_acc").norm()))
            .max(relative((g.jerk - three("grad_jerk")).norm(), three("grad_jerk").norm()))
            .max(relative((g.yaw - number("grad_yaw")).abs(), number("grad_yaw").abs()))
            .max((g.yaw_rate - number("grad_yaw_rate")).abs());
    }
    println!("worst relative difference {worst:e}");
    assert!(cases.as_array().unwrap().len() == 40 && worst < 1e-9, "{worst:e}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn durations_come_back(t in 0.06..50.0f64, tau in -20.0..20.0f64) {
        prop_assert!((duration(duration_inverse(t, 0.05), 0.05) - t).abs() < 1e-9 * t);
        let h = 1e-6;
        let difference = (duration(tau + h, 0.05) - duration(tau - h, 0.05)) / (2.0 * h);
        prop_assert!((difference - duration_slope(tau)).abs() < 1e-6 * (1.0 + difference.abs()));
        prop_assert!(duration(tau, 0.05) > 0.05);
    }

    #[test]
    fn balls_hold_their_points(centre in vector(5.0), y in vector(0.57), xi in proptest::array::uniform3(-3.0..3.0f64), g in vector(1.0)) {
        let point = centre + y * 2.0;
        let back = ball_point(&centre, 2.0, &ball_inverse(&centre, 2.0, &point));
        prop_assert!((back - point).norm() < 1e-9);
        prop_assert!((ball_point(&centre, 2.0, &xi) - centre).norm() <= 2.0 + 1e-12);
        let gradient = ball_gradient(2.0, &xi, &g);
        for k in 0..3 {
            let at = |h: f64| { let mut x = xi; x[k] += h; g.dot(&ball_point(&centre, 2.0, &x)) };
            prop_assert!(((at(1e-6) - at(-1e-6)) / 2e-6 - gradient[k]).abs() < 1e-6);
        }
    }

    #[test]
    fn hulls_hold_their_points(vertices in proptest::collection::vec(vector(3.0), 1..9), w in proptest::collection::vec(0.05..1.0f64, 9), g in vector(1.0)) {
        let n = vertices.len();
        let total: f64 = w[..n].iter().sum();
        let point = vertices.iter().zip(&w).fold(Vector3::zeros(), |s, (v, w)| s + v * (w / total));
        let mut xi = vec![0.0; n];
        hull_inverse(&vertices, &point, &mut xi);
        prop_assert!((hull_point(&vertices, &xi) - point).norm() < 0.01, "{}", hull_point(&vertices, &xi) - point);
        let xi: Vec<f64> = w[..n].to_vec();
        let mut gradient = vec![0.0; n];
        hull_gradient(&vertices, &xi, &g, &mut gradient);
        for k in 0..n {
            let at = |h: f64| { let mut x = xi.clone(); x[k] += h; g.dot(&hull_point(&vertices, &x)) };
            prop_assert!(((at(1e-6) - at(-1e-6)) / 2e-6 - gradient[k]).abs() < 1e-5 * (1.0 + gradient[k].abs()));
        }
    }

    /// Four samples at a time say what the formulas say sample by sample, whatever the number of samples and whichever limits are violated.
    #[test]
    fn samples_side_by_side_are_the_samples_one_by_one(
        points in proptest::collection::vec(vector(1.5), 4), times in proptest::collection::vec(0.3..2.5f64, 5),
        intervals in 0usize..20, reach in 0.3..3.0f64, parasitic in 0.0..0.05f64,
    ) {
        let airframe = Airframe { drag_parasitic: parasitic, ..limits().airframe.unwrap() };
        let limits = FlightLimits { airframe: Some(airframe), ..limits() };
        let corridor = [Polytope::from_box(&Point3::new(-reach, -1.0, -1.0), &Point3::new(reach, 1.2, 0.9))];
        let zero = Vector3::zeros();
        let (head, tail) = ([zero, Vector3::new(1.0, 0.0, 0.0), zero], [Vector3::new(0.5, 0.5, 0.5), zero, zero]);
        let weights = PenaltyWeights { intervals, ..PenaltyWeights::default() };
        let mut cost = PenalisedSpline::new(&head, &tail, &corridor, &[0; 5], &limits, weights).unwrap();
        let (mut fast, mut plain) = (MincoGradient::default(), MincoGradient::default());
        let value = cost.evaluate(&points, &times, &mut fast);
        let expected = cost.evaluate_plainly(&points, &times, &mut plain);
        // Sums of a hundred terms in another order.
        const RELATIVE_TOL: f64 = 1e-11;
        prop_assert!((value - expected).abs() <= RELATIVE_TOL * expected.abs(), "{value} {expected}");
        let scale = plain.durations.iter().fold(expected.abs(), |m, g| m.max(g.abs()));
        let scale = plain.inner_points.iter().fold(scale, |m, g| m.max(g.norm()));
        for (a, b) in fast.inner_points.iter().zip(&plain.inner_points) {
            prop_assert!((a - b).norm() <= RELATIVE_TOL * scale, "{a} {b}");
        }
        for (a, b) in fast.durations.iter().zip(&plain.durations) {
            prop_assert!((a - b).abs() <= RELATIVE_TOL * scale, "{a} {b}");
        }
    }

    /// Every limit is violated somewhere in such flights; the gradient is that of the cost all the same.
    #[test]
    fn penalties_have_their_gradient(points in proptest::collection::vec(vector(1.5), 4), times in proptest::collection::vec(0.3..1.2f64, 5)) {
        let limits = limits();
        let corridor = [Polytope::from_box(&Point3::new(-1.0, -1.0, -1.0), &Point3::new(1.0, 1.2, 0.9))];
        let zero = Vector3::zeros();
        let (head, tail) = ([zero, Vector3::new(1.0, 0.0, 0.0), zero], [Vector3::new(0.5, 0.5, 0.5), zero, zero]);
        let mut cost = PenalisedSpline::new(&head, &tail, &corridor, &[0; 5], &limits, PenaltyWeights::default()).unwrap();
        let mut gradient = MincoGradient::default();
        let mut unused = MincoGradient::default();
        let value = cost.evaluate(&points, &times, &mut gradient);
        prop_assert!(value.is_finite());
        let scale = gradient.durations.iter().fold(value.abs(), |m, g| m.max(g.abs()));
        for k in 0..4 {
            for axis in 0..3 {
                let mut at = |h: f64| { let mut q = points.clone(); q[k][axis] += h; cost.evaluate(&q, &times, &mut unused) };
                let d = (at(1e-6) - at(-1e-6)) / 2e-6;
                prop_assert!((d - gradient.inner_points[k][axis]).abs() < 1e-4 * scale, "{d} {}", gradient.inner_points[k][axis]);
            }
        }
        for k in 0..5 {
            let mut at = |h: f64| { let mut t = times.clone(); t[k] += h; cost.evaluate(&points, &t, &mut unused) };
            let d = (at(1e-6) - at(-1e-6)) / 2e-6;
            prop_assert!((d - gradient.durations[k]).abs() < 1e-4 * scale, "{d} {}", gradient.durations[k]);
        }
    }
}

/// Waypoints without a corridor: balls of 20 cm, one big box round everything.
#[test]
fn waypoints_are_passed_nearly_within_limits_and_bit_for_bit_again() {
    let limits = FlightLimits {
        max_tilt_rad: 1.0,
        max_rate_radps: 2.1,
        min_thrust_n: 2.0,
        max_thrust_n: 12.0,
        time_weight: 100.0,
        ..limits()
    };
    let around = [Polytope::from_box(&Point3::new(-50.0, -50.0, -50.0), &Point3::new(50.0, 50.0, 50.0))];
    let centres = [Vector3::new(4.0, 0.0, 1.0), Vector3::new(4.0, 4.0, 2.0), Vector3::new(0.0, 4.0, 1.0)];
    let places = centres.map(|centre| Place::Ball { centre, radius_m: 0.2 });
    let zero = Vector3::zeros();
    let run = || {
        shape(
            &[zero; 3],
            &[Vector3::new(0.0, 8.0, 1.0), zero, zero],
            &places,
            &around,
            &[0; 4],
            &centres,
            &[2.0; 4],
            &limits,
            &PenaltyWeights::default(),
            &LbfgsSettings::default(),
        )
        .unwrap()
    };
    let found = run();
    assert_eq!(found.report.status, LbfgsStatus::Converged);
    for (state, centre) in found.spline.states()[1..4].iter().zip(&centres) {
        assert!((state[0] - centre).norm() <= 0.2 + 1e-9);
    }
    let fastest = (0..400)
        .map(|k| {
            let trajectory = planner::PolynomialTrajectory::from_minco(&found.spline);
            trajectory.sample(trajectory.duration() * f64::from(k) / 400.0).v.norm()
        })
        .fold(0.0, f64::max);
    assert!(fastest > 2.5 && fastest < 3.0 + 0.01, "{fastest}");
    assert_eq!(run().spline.coefficients(), found.spline.coefficients());
}

#[test]
fn shapes_that_cannot_be_are_refused_with_the_reason() {
    let around = [Polytope::from_box(&Point3::new(-9.0, -9.0, -9.0), &Point3::new(9.0, 9.0, 9.0))];
    let zero = [Vector3::zeros(); 3];
    let end = [Vector3::new(4.0, 0.0, 0.0), zero[0], zero[0]];
    let middle = [Vector3::new(2.0, 1.0, 0.0)];
    let ball = |radius_m: f64| Place::Ball { centre: middle[0], radius_m };
    let attempt = |place: Place, polytope_of: &[usize], times: &[f64], limits: &FlightLimits| {
        let (weights, settings) = (PenaltyWeights::default(), LbfgsSettings::default());
        shape(&zero, &end, &[place], &around, polytope_of, &middle, times, limits, &weights, &settings)
    };
    let good = limits();
    let refused =
        |place, of: &[usize], times: &[f64], limits| attempt(place, of, times, limits).map(|_| ()).unwrap_err();
    assert!(attempt(ball(0.2), &[0, 0], &[2.0; 2], &good).is_ok());
    assert_eq!(refused(ball(0.0), &[0, 0], &[2.0; 2], &good), PenaltyError::NoPlace { place: 0 });
    assert_eq!(refused(Place::Hull(Vec::new()), &[0, 0], &[2.0; 2], &good), PenaltyError::NoPlace { place: 0 });
    let nowhere = PenaltyError::NoPolytope { piece: 1, polytope: 3, count: 1 };
    assert_eq!(refused(ball(0.2), &[0, 3], &[2.0; 2], &good), nowhere);
    assert!(matches!(refused(ball(0.2), &[0, 0], &[2.0; 3], &good), PenaltyError::Spline(_)));
    assert!(matches!(refused(ball(0.2), &[0, 0], &[f64::NAN, 2.0], &good), PenaltyError::Spline(_)));
    let massless = FlightLimits { airframe: good.airframe.map(|a| Airframe { mass_kg: 0.0, ..a }), ..good };
    assert!(matches!(refused(ball(0.2), &[0, 0], &[2.0; 2], &massless), PenaltyError::Limits(_)));
    // Infinity switches a limit off.
    let strong = FlightLimits { max_thrust_n: f64::INFINITY, max_rate_radps: f64::INFINITY, ..good };
    assert!(attempt(ball(0.2), &[0, 0], &[2.0; 2], &strong).unwrap().report.cost.is_finite());
}
