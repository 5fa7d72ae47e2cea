//! Claims: on a flat of 12 rooms (17 x 10 m) at 5 cm the visibility graph is built in <= 25 ms, a route takes <= 5 ms and a
//! cycle of the local policy with 4000 points <= 1 ms; a flight across the flat on 10 cm voxels is planned in <= 30 ms.
#[path = "../tests/support/mod.rs"]
mod support;

use divan::Bencher;
use nalgebra::{Point2, Point3};
use planner::{AirConfig, AirSpace, FlightState, LocalPolicy, LocalPolicyConfig, VisibilityGraph, plan_air};

fn main() {
    divan::main();
}

#[divan::bench]
fn visibility_graph(bencher: Bencher) {
    let picture = support::flat(1.0, 2000);
    bencher.bench_local(|| VisibilityGraph::build(&picture.view(), 0.406));
}

#[divan::bench]
fn route(bencher: Bencher) {
    let picture = support::flat(1.0, 0);
    let graph = VisibilityGraph::build(&picture.view(), 0.406).unwrap();
    bencher.bench_local(|| graph.route(&Point2::new(2.5, 2.0), &Point2::new(14.5, 8.0)));
}

#[divan::bench]
fn fifty_lengths(bencher: Bencher) {
    let picture = support::flat(1.0, 0);
    let graph = VisibilityGraph::build(&picture.view(), 0.406).unwrap();
    let goals: Vec<Point2<f64>> =
        (0..50).map(|k| Point2::new(1.0 + f64::from(k % 10) * 1.6, 1.0 + f64::from(k / 10) * 1.9)).collect();
    bencher.bench_local(|| graph.lengths_from(&Point2::new(2.5, 2.0), &goals));
}

/// Two walls of 2000 points with a gap of a metre ahead; every cycle sees new points.
#[divan::bench]
fn local_policy_cycle(bencher: Bencher) {
    let mut points: Vec<Point2<f32>> = (0..2000u16)
        .flat_map(|k| {
            let t = f32::from(k) / 2000.0;
            [
                Point2::new(0.8 + 0.05 * (37.0 * t).sin(), 0.5 + 2.0 * t),
                Point2::new(0.8 + 0.05 * (31.0 * t).cos(), -0.5 - 2.0 * t),
            ]
        })
        .collect();
    let path = [Point2::new(0.0, 0.0), Point2::new(3.0, 0.0)];
    let mut policy = LocalPolicy::new(LocalPolicyConfig::default()).unwrap();
    let mut cycle = 0u32;
    bencher.bench_local(|| {
        cycle += 1;
        points[0].x += 1e-6;
        // To and fro, so that the policy is never stuck.
        policy.command((0.25 * f64::from(cycle / 50 % 2), 0.02, 0.1), (0.4, 0.0, 0.0), &path, None, &points, &[])
    });
}

#[divan::bench(sample_count = 20)]
fn flight_across_a_flat(bencher: Bencher) {
    let voxels = support::flat_3d(1.1, 2);
    let start = FlightState::resting_at(Point3::new(1.5, 1.5, 1.3));
    let config = AirConfig::default();
    let space = AirSpace { distance: &|p| voxels.distance(p), obstacles: &|a, b| voxels.obstacles(a, b), movers: &[] };
    bencher.bench_local(|| plan_air(&start, &Point3::new(15.3, 8.4, 1.4), &space, &config));
}
