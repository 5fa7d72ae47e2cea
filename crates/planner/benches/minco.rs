//! Claims: MINCO forward and adjoint <= 0.3 us a piece, linear to 1e5 pieces; cost and gradient with penalties <= 1.6 us a piece;
//! the inscribed ellipsoid <= 0.4 ms; flights through 5, 10, 20, 50 polytopes, proof included, <= 4, 10, 30, 130 ms.
#[path = "../tests/support/mod.rs"]
mod support;

use divan::{Bencher, counter::ItemsCount};
use nalgebra::Vector3;
use planner::air::ellipsoid::inscribed_ellipsoid;
use planner::air::penalty::{PenalisedSpline, PenaltyWeights};
use planner::{InteriorSettings, Minco, MincoGradient, fly_corridor};
use support::corridors::{chain, limits};

fn main() {
    divan::main();
}

#[divan::bench(args = [10, 1000, 100_000])]
fn forward_and_adjoint(bencher: Bencher, pieces: usize) {
    let point = |k: usize| Vector3::new(k as f64, (0.7 * k as f64).sin(), (0.3 * k as f64).cos());
    let zero = Vector3::zeros();
    let (head, tail) = ([point(0), zero, zero], [point(pieces), zero, zero]);
    let inner: Vec<_> = (1..pieces).map(point).collect();
    let times: Vec<f64> = (0..pieces).map(|k| 0.8 + 0.1 * (k % 7) as f64).collect();
    let mut spline = Minco::<3>::solve(&head, &tail, &inner, &times).unwrap();
    let by_coefficients = vec![Vector3::new(0.1, 0.2, 0.3); 6 * pieces];
    let by_durations = vec![1.0; pieces];
    let (mut adjoint, mut gradient) = (Vec::new(), MincoGradient::default());
    bencher.counter(ItemsCount::new(pieces)).bench_local(|| {
        spline.solve_again(&head, &tail, &inner, &times).unwrap();
        spline.propagate_into(&by_coefficients, &by_durations, &mut adjoint, &mut gradient);
        gradient.durations[0]
    });
}

/// Order 4, where durations are alike and where they are a thousand times apart.
#[divan::bench(args = [1.0, 1000.0])]
fn order_four(bencher: Bencher, ratio: f64) {
    const PIECES: usize = 1000;
    let point = |k: usize| Vector3::new(k as f64, (0.7 * k as f64).sin(), (0.3 * k as f64).cos());
    let (head, tail) = ([point(0), Vector3::zeros(), Vector3::zeros(), Vector3::zeros()], [Vector3::zeros(); 4]);
    let inner: Vec<_> = (1..PIECES).map(point).collect();
    let times: Vec<f64> = (0..PIECES).map(|k| if k % 7 == 3 { 1.0 / ratio } else { 1.0 }).collect();
    let mut spline = Minco::<4>::solve(&head, &tail, &inner, &times).unwrap();
    bencher.counter(ItemsCount::new(PIECES)).bench_local(|| spline.solve_again(&head, &tail, &inner, &times));
}

/// At a flight that was found, where every limit that binds is touched, and at one a tenth faster, which breaks limits in
/// most pieces: what the optimiser meets in between.
#[divan::bench(args = [(false, 1.0), (false, 0.9), (true, 1.0), (true, 0.9)])]
fn cost_and_gradient(bencher: Bencher, (is_agile, pace): (bool, f64)) {
    const PIECES: usize = 20;
    let limits = limits(is_agile);
    let (start, goal, corridor) = chain(7, PIECES);
    let flight = fly_corridor(&start, &goal, &corridor, &limits, &InteriorSettings::default()).unwrap();
    let inner: Vec<_> = flight.trajectory.pieces[1..].iter().map(|p| p.coefficients[0]).collect();
    let times: Vec<f64> = flight.trajectory.pieces.iter().map(|p| pace * p.duration_s).collect();
    let mut cost =
        PenalisedSpline::new(&start, &goal, &corridor, &flight.polytope_of, &limits, PenaltyWeights::default())
            .unwrap();
    let mut gradient = MincoGradient::default();
    bencher.counter(ItemsCount::new(PIECES)).bench_local(|| cost.evaluate(&inner, &times, &mut gradient));
}

/// The same sample by sample: what four samples at a time are worth.
#[divan::bench]
fn agile_cost_and_gradient_plainly(bencher: Bencher) {
    const PIECES: usize = 20;
    let limits = limits(true);
    let (start, goal, corridor) = chain(7, PIECES);
    let flight = fly_corridor(&start, &goal, &corridor, &limits, &InteriorSettings::default()).unwrap();
    let inner: Vec<_> = flight.trajectory.pieces[1..].iter().map(|p| p.coefficients[0]).collect();
    let times: Vec<f64> = flight.trajectory.pieces.iter().map(|p| 0.9 * p.duration_s).collect();
    let mut cost =
        PenalisedSpline::new(&start, &goal, &corridor, &flight.polytope_of, &limits, PenaltyWeights::default())
            .unwrap();
    let mut gradient = MincoGradient::default();
    bencher.counter(ItemsCount::new(PIECES)).bench_local(|| cost.evaluate_plainly(&inner, &times, &mut gradient));
}

#[divan::bench]
fn ellipsoid(bencher: Bencher) {
    let (_, _, corridor) = chain(5, 30);
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) % corridor.len();
        inscribed_ellipsoid(&corridor[k])
    });
}

#[divan::bench(args = [5, 10, 20, 50])]
fn flight(bencher: Bencher, pieces: usize) {
    let limits = limits(false);
    let problems: Vec<_> = (0..20).map(|seed| chain(1000 + seed, pieces)).collect();
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) % problems.len();
        let (start, goal, corridor) = &problems[k];
        fly_corridor(start, goal, corridor, &limits, &InteriorSettings::default()).is_ok()
    });
}
