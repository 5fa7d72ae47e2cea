//! A flight over a field: waypoints, no corridor, and still every limit proved.
//!
//! MINCO with penalties finds a smooth flight that passes each waypoint within a reach; penalties alone would exceed limits a
//! little, so it is asked for less until the proof holds at every instant: speed, acceleration, tilt, thrust and body rate.
//! Then the heading is planned along it: ahead, and at the end back to where it came from.
//!
//! Run: `cargo run -p planner --example 03_a_flight_by_waypoints`

use nalgebra::Vector3;
use planner::{Airframe, FlightLimits, HeadingPlan, fly_waypoints};

fn main() {
    // 1. The vehicle and what it may do.
    let airframe = Airframe {
        mass_kg: 1.5,
        gravity_mps2: 9.81,
        drag_across: 0.3,
        drag_along: 0.2,
        drag_parasitic: 0.01,
        speed_epsilon: 1e-4,
    };
    let limits = FlightLimits {
        max_speed_mps: 6.0,
        max_accel_mps2: 5.0,
        airframe: Some(airframe),
        max_tilt_rad: 0.5,
        max_rate_radps: 1.5,
        min_thrust_n: 5.0,
        max_thrust_n: 26.0,
        min_duration_s: 0.1,
        time_weight: 50.0,
    };

    // 2. Four waypoints of a survey, from rest to rest.
    let at_rest = |p: Vector3<f64>| [p, Vector3::zeros(), Vector3::zeros()];
    let (start, goal) = (Vector3::new(0.0, 0.0, 10.0), Vector3::new(0.0, 24.0, 10.0));
    let waypoints = [
        Vector3::new(30.0, 0.0, 12.0),
        Vector3::new(30.0, 12.0, 12.0),
        Vector3::new(0.0, 12.0, 11.0),
        Vector3::new(15.0, 20.0, 14.0),
    ];
    let reach_m = 0.5;
    let flight =
        fly_waypoints(&at_rest(start), &waypoints, &at_rest(goal), reach_m, &limits).expect("nothing is in the way");
    println!(
        "{:.1} s in {} pieces, {} rounds",
        flight.trajectory.duration(),
        flight.trajectory.pieces.len(),
        flight.rounds
    );

    // 3. What was proved, and what samples say.
    let proof = &flight.proof;
    println!(
        "proved: {:.2} m/s, {:.2} m/s^2, tilt {:.2} rad, rate {:.2} rad/s, thrust {:.1} to {:.1} N",
        proof.max_speed_mps,
        proof.max_accel_mps2,
        proof.max_tilt_rad,
        proof.max_rate_radps,
        proof.min_thrust_n,
        proof.max_thrust_n
    );
    let fastest = (0..=2000)
        .map(|k| flight.trajectory.sample(flight.trajectory.duration() * f64::from(k) / 2000.0).v.norm())
        .fold(0.0, f64::max);
    assert!(proof.holds && fastest <= proof.max_speed_mps && fastest > 3.0);
    let mut end_s = 0.0;
    for (piece, waypoint) in flight.trajectory.pieces.iter().zip(&waypoints) {
        end_s += piece.duration_s;
        let off = (flight.trajectory.sample(end_s).p.coords - waypoint).norm();
        println!("waypoint after {end_s:.1} s, {off:.2} m off");
        assert!(off <= reach_m + 1e-6);
    }

    // 4. Where it looks: never faster than 0.8 rad/s, and at the end to the east, where it first flew.
    let heading = HeadingPlan::along(&flight.trajectory, 0.0, 0.0, Some(0.0), 0.8);
    let (look_rad, _) = heading.sample(f64::MAX);
    assert!(look_rad.sin().abs() < 1e-6 && look_rad.cos() > 0.0);
    println!("it has turned by {:.1} rad in {:.1} s and looks east again", look_rad, heading.duration());
}
