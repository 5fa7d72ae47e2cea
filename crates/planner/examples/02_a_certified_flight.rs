//! A flight round a pillar that is proved before it is flown.
//!
//! The planner finds a route, cuts space into convex polytopes round it, finds the best flight through them by Newton's method,
//! and then *proves* with Bernstein control points that the flight stays inside, below the speed and below the acceleration
//! limit, at every instant and not only at samples.
//!
//! Run: `cargo run -p planner --example 02_a_certified_flight`

use nalgebra::{Point3, Vector3};
use planner::{AirConfig, AirSpace, FlightState, plan_air};

fn main() {
    // 1. The world: a floor, a ceiling, a pillar of 10 cm voxels. The distance is to the nearest voxel centre.
    let mut voxels: Vec<Point3<f64>> = Vec::new();
    for z in 0..25 {
        for k in 0..6 {
            for j in 0..6 {
                voxels.push(Point3::new(
                    2.75 + 0.1 * f64::from(k),
                    -0.25 + 0.1 * f64::from(j),
                    0.05 + 0.1 * f64::from(z),
                ));
            }
        }
    }
    let distance = |p: &Point3<f64>| {
        let pillar = voxels.iter().map(|v| (v - p).norm()).fold(f64::INFINITY, f64::min);
        // Floor and ceiling as planes of centres; outside the room nothing is known.
        let inside = p.x.abs() < 8.0 && p.y.abs() < 3.0 && p.z > 0.1 && p.z < 2.5;
        inside.then(|| pillar.min(p.z - 0.05).min(2.55 - p.z))
    };
    let obstacles = |low: &Point3<f64>, high: &Point3<f64>| {
        let mut points: Vec<Point3<f64>> =
            voxels.iter().filter(|v| (0..3).all(|k| v[k] >= low[k] && v[k] <= high[k])).copied().collect();
        for z in [0.05, 2.55] {
            let (mut x, y_low) = (low.x, low.y);
            while x <= high.x {
                let mut y = y_low;
                while y <= high.y {
                    points.push(Point3::new(x, y, z));
                    y += 0.1;
                }
                x += 0.1;
            }
        }
        points
    };

    // 2. Plan from one side of the pillar to the other, starting at half a metre per second.
    let start = FlightState { v: Vector3::new(0.5, 0.0, 0.0), ..FlightState::resting_at(Point3::new(0.0, 0.0, 1.2)) };
    let goal = Point3::new(6.0, 0.2, 1.4);
    let config = AirConfig::default();
    let space = AirSpace { distance: &distance, obstacles: &obstacles, movers: &[] };
    let plan = plan_air(&start, &goal, &space, &config).expect("there is room on both sides");
    println!(
        "route of {} points after {} expansions, corridor of {} polytopes",
        plan.route.len(),
        plan.expansions,
        plan.corridor.len()
    );
    println!("{} pieces, {:.2} s", plan.trajectory.pieces.len(), plan.trajectory.duration());

    // 3. The proof.
    let c = &plan.proof;
    println!(
        "proved: speed <= {:.3} m/s, acceleration <= {:.3} m/s^2, {:.3} m from obstacle surfaces",
        c.max_speed_mps, c.max_accel_mps2, plan.clearance_m
    );

    // 4. And the samples, which can only agree.
    let (mut fastest, mut nearest) = (0.0f64, f64::INFINITY);
    for k in 0..=1000 {
        let s = plan.trajectory.sample(plan.trajectory.duration() * f64::from(k) / 1000.0);
        fastest = fastest.max(s.v.norm());
        nearest = nearest.min(distance(&s.p).expect("in known space") - config.obstacle_radius_m);
    }
    println!("sampled: speed {fastest:.3} m/s, {nearest:.3} m");
    assert!(c.holds && fastest <= c.max_speed_mps && nearest >= plan.clearance_m - 0.09);
    assert!((plan.trajectory.sample(1e9).p - goal).norm() < 1e-6);
}
