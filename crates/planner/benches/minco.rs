//! Claims: MINCO forward and adjoint take <= 0.3 us per piece, linear to 1e5 pieces.

use divan::{Bencher, counter::ItemsCount};
use nalgebra::Vector3;
use planner::{Minco, MincoGradient};

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
