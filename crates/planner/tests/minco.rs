//! Laws of MINCO for orders 2, 3 and 4, and the stored vectors.
#![cfg(feature = "air")]
mod support;

use nalgebra::{Rotation3, Vector3};
use planner::{Minco, MincoGradient};
use proptest::prelude::*;

/// Order 4 at durations a thousand times apart.
const ORDER_4_AT_EXTREMES: f64 = 1e-9;

/// A problem: states at the ends (position, velocity, acceleration, jerk), inner points, durations.
#[derive(Debug, Clone)]
struct Problem {
    head: [Vector3<f64>; 4],
    tail: [Vector3<f64>; 4],
    inner: Vec<Vector3<f64>>,
    times: Vec<f64>,
}

fn vector(reach: f64) -> impl Strategy<Value = Vector3<f64>> {
    proptest::array::uniform3(-reach..reach).prop_map(Vector3::from)
}

/// Up to seven pieces; durations between `1 / ratio` and 1 (times 1.7).
fn problem(ratio: f64) -> impl Strategy<Value = Problem> {
    let state = || proptest::array::uniform4(vector(2.0));
    let leg = (vector(3.0), -ratio.ln()..0.0).prop_map(|(q, log)| (q, 1.7 * f64::exp(log)));
    (state(), state(), proptest::collection::vec(leg, 1..8)).prop_map(|(head, tail, legs)| Problem {
        head,
        tail,
        inner: legs[1..].iter().map(|l| l.0).collect(),
        times: legs.iter().map(|l| l.1).collect(),
    })
}

fn solve<const S: usize>(p: &Problem) -> Minco<S> {
    let state = |s: &[Vector3<f64>; 4]| std::array::from_fn(|k| s[k]);
    Minco::<S>::solve(&state(&p.head), &state(&p.tail), &p.inner, &p.times).unwrap()
}

fn derivative(c: &[Vector3<f64>], k: usize, t: f64) -> Vector3<f64> {
    (k..c.len())
        .rev()
        .fold(Vector3::zeros(), |sum, j| sum * t + c[j] * (j - k + 1..=j).map(|m| m as f64).product::<f64>())
}

/// Numbers of a piece as large as they get: the scale of rounding of the k-th derivative.
fn size(c: &[Vector3<f64>], k: usize, t: f64) -> f64 {
    (k..c.len())
        .map(|j| c[j].norm() * (j - k + 1..=j).map(|m| m as f64).product::<f64>() * t.powi((j - k) as i32))
        .sum()
}

/// The spline meets its conditions and is C^(2s-2), which is the condition of optimality (MINCO Theorem 2).
fn check_optimal<const S: usize>(p: &Problem, relative: f64) -> Result<(), TestCaseError> {
    let spline = solve::<S>(p);
    let pieces: Vec<&[Vector3<f64>]> = spline.coefficients().chunks(2 * S).collect();
    for k in 0..S {
        let last = pieces.len() - 1;
        prop_assert!((derivative(pieces[0], k, 0.0) - p.head[k]).norm() <= relative * (1.0 + size(pieces[0], k, 0.0)));
        let end = derivative(pieces[last], k, p.times[last]);
        prop_assert!((end - p.tail[k]).norm() <= relative * (1.0 + size(pieces[last], k, p.times[last])));
    }
    for i in 0..p.inner.len() {
        prop_assert!((derivative(pieces[i + 1], 0, 0.0) - p.inner[i]).norm() <= relative);
        for k in 0..=2 * S - 2 {
            let (a, b) = (derivative(pieces[i], k, p.times[i]), derivative(pieces[i + 1], k, 0.0));
            // In units of the shorter piece: what a rounding of the positions does to the k-th derivative.
            let unit = p.times[i].min(p.times[i + 1]).min(1.0).powi(k as i32);
            let scale = 1.0 + size(pieces[i], k, p.times[i]) + size(pieces[i + 1], k, p.times[i + 1]);
            let scale = scale.max(10.0 / unit);
            prop_assert!((a - b).norm() <= relative * scale, "order {S}, derivative {k} at {i}: {a} {b}");
        }
    }
    Ok(())
}

fn check_laws<const S: usize>(
    p: &Problem,
    factor: f64,
    turn: Vector3<f64>,
    shift: Vector3<f64>,
) -> Result<(), TestCaseError> {
    let energy = solve::<S>(p).energy();
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-8 * a.abs().max(b.abs()).max(1e-6);
    // Time reversed: odd derivatives change sign.
    let turned = |s: &[Vector3<f64>; 4]| std::array::from_fn(|k| if k % 2 == 1 { -s[k] } else { s[k] });
    let reversed = Problem {
        head: turned(&p.tail),
        tail: turned(&p.head),
        inner: p.inner.iter().rev().copied().collect(),
        times: p.times.iter().rev().copied().collect(),
    };
    prop_assert!(close(solve::<S>(&reversed).energy(), energy));
    // Slower by a factor: effort falls with its power 2s - 1.
    let slowed = |s: &[Vector3<f64>; 4]| std::array::from_fn(|k| s[k] / factor.powi(k as i32));
    let slower = Problem {
        head: slowed(&p.head),
        tail: slowed(&p.tail),
        inner: p.inner.clone(),
        times: p.times.iter().map(|t| t * factor).collect(),
    };
    prop_assert!(close(solve::<S>(&slower).energy() * factor.powi(2 * S as i32 - 1), energy));
    // A rigid motion changes nothing but the frame.
    let rotation = Rotation3::new(turn);
    let moved = |s: &[Vector3<f64>; 4]| {
        std::array::from_fn(|k| rotation * s[k] + if k == 0 { shift } else { Vector3::zeros() })
    };
    let elsewhere = Problem {
        head: moved(&p.head),
        tail: moved(&p.tail),
        inner: p.inner.iter().map(|q| rotation * q + shift).collect(),
        times: p.times.clone(),
    };
    prop_assert!(close(solve::<S>(&elsewhere).energy(), energy));
    Ok(())
}

/// Any cost of coefficients and durations, here a random linear one plus the effort, against central differences.
fn check_gradient<const S: usize>(p: &Problem, weights: &[Vector3<f64>]) -> Result<(), TestCaseError> {
    let weight = |k: usize| weights[k % weights.len()];
    let cost = |p: &Problem| {
        let spline = solve::<S>(p);
        let linear: f64 = spline.coefficients().iter().enumerate().map(|(k, c)| weight(k).dot(c)).sum();
        linear + p.times.iter().map(|t| t * t).sum::<f64>()
    };
    let spline = solve::<S>(p);
    let by_coefficients: Vec<_> = (0..spline.coefficients().len()).map(weight).collect();
    let by_durations: Vec<f64> = p.times.iter().map(|t| 2.0 * t).collect();
    compare(p, &spline.propagate(&by_coefficients, &by_durations), cost)?;
    compare(p, &spline.energy_gradient(), |p| solve::<S>(p).energy())
}

fn compare(p: &Problem, gradient: &MincoGradient, cost: impl Fn(&Problem) -> f64) -> Result<(), TestCaseError> {
    // Five-point differences: error h^4.
    let difference = |at: &dyn Fn(f64) -> Problem, h: f64| {
        (8.0 * (cost(&at(h)) - cost(&at(-h))) - (cost(&at(2.0 * h)) - cost(&at(-2.0 * h)))) / (12.0 * h)
    };
    let scale = cost(p).abs() + gradient.inner_points.iter().map(|g| g.norm()).fold(1.0, f64::max);
    for k in 0..p.inner.len() {
        for axis in 0..3 {
            let at = |h: f64| {
                let mut moved = p.clone();
                moved.inner[k][axis] += h;
                moved
            };
            let d = difference(&at, 1e-3);
            prop_assert!(
                (d - gradient.inner_points[k][axis]).abs() <= 1e-7 * scale,
                "{d} {}",
                gradient.inner_points[k]
            );
        }
    }
    for k in 0..p.times.len() {
        let at = |h: f64| {
            let mut moved = p.clone();
            moved.times[k] += h;
            moved
        };
        let d = difference(&at, 1e-3 * p.times[k]);
        prop_assert!(
            (d - gradient.durations[k]).abs() <= 1e-6 * (scale / p.times[k] + gradient.durations[k].abs()),
            "{d} {}",
            gradient.durations[k]
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn splines_are_optimal(p in problem(10.0)) {
        check_optimal::<2>(&p, 1e-11)?;
        check_optimal::<3>(&p, 1e-11)?;
        check_optimal::<4>(&p, 1e-10)?;
    }

    /// What rounding leaves at durations a thousand times apart.
    #[test]
    fn splines_are_optimal_at_extreme_ratios(p in problem(1000.0)) {
        check_optimal::<2>(&p, 1e-11)?;
        check_optimal::<3>(&p, 1e-11)?;
        check_optimal::<4>(&p, ORDER_4_AT_EXTREMES)?;
    }

    #[test]
    fn reversal_scaling_and_rigid_motion(p in problem(10.0), factor in 0.2..5.0f64, turn in vector(3.0), shift in vector(50.0)) {
        check_laws::<2>(&p, factor, turn, shift)?;
        check_laws::<3>(&p, factor, turn, shift)?;
        check_laws::<4>(&p, factor, turn, shift)?;
    }

    #[test]
    fn gradients_agree_with_differences(p in problem(4.0), weights in proptest::collection::vec(vector(1.0), 11)) {
        check_gradient::<2>(&p, &weights)?;
        check_gradient::<3>(&p, &weights)?;
        check_gradient::<4>(&p, &weights)?;
    }
}

/// Solving again in place gives the same bits as solving anew, whatever was there before.
#[test]
fn solving_again_is_solving() {
    let zero = [Vector3::zeros(); 3];
    let points: Vec<Vector3<f64>> = (1..6).map(|k| Vector3::new(f64::from(k), f64::from(k * k % 5), 1.0)).collect();
    let end = [Vector3::new(6.0, 0.0, 0.0), zero[0], zero[0]];
    let mut used = Minco::<3>::solve(&zero, &end, &points, &[1.0; 6]).unwrap();
    used.solve_again(&zero, &end, &points[..2], &[0.5, 2.0, 1.0]).unwrap();
    let fresh = Minco::<3>::solve(&zero, &end, &points[..2], &[0.5, 2.0, 1.0]).unwrap();
    assert_eq!(used.coefficients(), fresh.coefficients());
    assert_eq!(used.energy_gradient(), fresh.energy_gradient());
}

#[test]
fn equals_the_stored_vectors() {
    let Some(text) = support::shared_aerial("minco_vectors.json") else { return };
    let cases: serde_json::Value = serde_json::from_str(&text).unwrap();
    const RELATIVE_TOL: f64 = 1e-9;
    let mut worst = 0.0f64;
    let mut seen = 0;
    for case in cases.as_array().unwrap() {
        let state = |key: &str| {
            let rows = support::rows(&case[key]);
            std::array::from_fn(|k| rows.get(k).copied().unwrap_or_default())
        };
        let times = support::numbers(&case["durations"]);
        let p =
            Problem { head: state("head"), tail: state("tail"), inner: support::rows(&case["inner_points"]), times };
        let (energy, coefficients, gradient) = match case["s"].as_u64().unwrap() {
            2 => outcome(solve::<2>(&p)),
            3 => outcome(solve::<3>(&p)),
            _ => outcome(solve::<4>(&p)),
        };
        let compare = |a: &[f64], b: &[f64]| {
            let size = b.iter().fold(1e-300f64, |m, x| m.max(x.abs()));
            a.iter().zip(b).map(|(x, y)| (x - y).abs() / size).fold(0.0, f64::max)
        };
        let flat = |v: &[Vector3<f64>]| v.iter().flat_map(|x| [x.x, x.y, x.z]).collect::<Vec<f64>>();
        worst = worst
            .max(compare(&[energy], &[case["energy"].as_f64().unwrap()]))
            .max(compare(&flat(&coefficients), &flat(&support::rows(&case["coeffs"]))))
            .max(compare(&flat(&gradient.inner_points), &flat(&support::rows(&case["dE_dq"]))))
            .max(compare(&gradient.durations, &support::numbers(&case["dE_dT"])));
        seen += 1;
    }
    println!("{seen} cases, worst relative difference {worst:e}");
    assert!(seen == 18 && worst < RELATIVE_TOL, "{worst:e}");
}

fn outcome<const S: usize>(spline: Minco<S>) -> (f64, Vec<Vector3<f64>>, MincoGradient) {
    (spline.energy(), spline.coefficients().to_vec(), spline.energy_gradient())
}
