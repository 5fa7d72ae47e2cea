//! The proof and the certificate against dense samples: no bound may be below what any instant demands, whatever the trajectory.
#![cfg(feature = "air")]
mod support;

use nalgebra::{Point3, Vector3};
use planner::*;
use proptest::prelude::*;
use support::SplitMix;
use support::corridors::{chain, limits};

const SAMPLES: u32 = 400;

/// What a piece really does, from the definitions: least slack, speed, acceleration, tilt, rate, least and most thrust.
fn sampled(piece: &Piece, polytope: &Polytope, frame: &Airframe) -> [f64; 7] {
    let mut worst = [f64::INFINITY, 0.0, 0.0, 0.0, 0.0, f64::INFINITY, f64::NEG_INFINITY];
    for k in 0..=SAMPLES {
        let s = piece.sample(piece.duration_s * f64::from(k) / f64::from(SAMPLES));
        let out = frame.demand(&s.v, &s.a, &s.jerk, 0.0, 0.0);
        let up = nalgebra::UnitQuaternion::new_unchecked(out.attitude) * Vector3::z();
        worst[0] = worst[0].min(polytope.slack(&s.p.coords));
        worst[1] = worst[1].max(s.v.norm());
        worst[2] = worst[2].max(s.a.norm());
        worst[3] = worst[3].max(up.angle(&Vector3::z()));
        worst[4] = worst[4].max(out.body_rate_radps.norm());
        worst[5] = worst[5].min(out.thrust_n);
        worst[6] = worst[6].max(out.thrust_n);
    }
    worst
}

/// Proved bounds against samples of one piece.
fn check(piece: &Piece, polytope: &Polytope, limits: &FlightLimits) -> Result<(), TestCaseError> {
    let trajectory = PolynomialTrajectory { pieces: vec![piece.clone()] };
    let corridor = std::slice::from_ref(polytope);
    let proof = prove(&trajectory, corridor, &[0], limits);
    let [slack, speed, accel, tilt, rate, least, most] = sampled(piece, polytope, &limits.airframe.unwrap());
    // Rounding: of the numbers' size, and of quaternions near the vertical.
    let tol = 1e-9 * (1.0 + accel + speed + rate);
    prop_assert!(proof.corridor_slack_m <= slack + tol, "slack {slack}");
    prop_assert!(proof.max_speed_mps >= speed - tol, "speed {speed}");
    prop_assert!(proof.max_accel_mps2 >= accel - tol, "accel {accel}");
    prop_assert!(proof.max_tilt_rad >= tilt - 1e-7, "tilt {tilt} {proof:?}");
    prop_assert!(proof.max_rate_radps >= rate - 1e-7 * (1.0 + rate), "rate {rate} {proof:?}");
    prop_assert!(proof.min_thrust_n <= least + tol && proof.max_thrust_n >= most - tol, "{least} {most} {proof:?}");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any quintic, from hovering to tumbling, any vehicle, any limits: where the middle of a piece breaks a limit its bounds are
    /// those of the whole piece, so the radii are tested wide, and otherwise after some halvings. Of constant jerk and without
    /// drag single terms of the bounds have to carry alone.
    #[test]
    fn bounds_hold_for_any_quintic(seed in any::<u64>(), log_duration in -4.0..1.0f64, wildness in -6.0..3.5f64, powers in 4usize..7, drag in prop::sample::select(vec![0.0, 0.3, 3.0])) {
        let mut random = SplitMix(seed);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| reach * (2.0 * random.unit() - 1.0));
        let duration_s = log_duration.exp();
        let wild = wildness.exp();
        let mut coefficients = vec![
            vector(3.0), vector(6.0), vector(4.0),
            vector(wild / duration_s), vector(wild / duration_s.powi(2)), vector(wild / duration_s.powi(3)),
        ];
        coefficients.truncate(powers);
        let piece = Piece { duration_s, coefficients };
        let reach = 1.0 + 6.0 * random.unit();
        let polytope = Polytope::from_box(&Point3::new(-reach, -reach, -reach), &Point3::new(reach, reach, reach));
        let mut limits = limits(random.unit() < 0.5);
        limits.max_tilt_rad = 0.2 + 1.3 * random.unit();
        limits.max_rate_radps = 0.3 + 6.0 * random.unit();
        limits.max_accel_mps2 = 1.0 + 20.0 * random.unit();
        if let Some(frame) = &mut limits.airframe {
            frame.drag_across = drag * random.unit();
            frame.drag_along = drag * random.unit();
            frame.drag_parasitic = drag * random.unit();
        }
        check(&piece, &polytope, &limits)?;
    }

    /// Flights that touch their limits, and the same a little disturbed: the verdict is about the thousandth beyond.
    #[test]
    fn bounds_hold_at_the_limits(seed in any::<u64>(), is_agile in any::<bool>(), log_noise in -25.0..-3.0f64) {
        let (start, goal, corridor) = chain(seed, 3);
        let limits = limits(is_agile);
        let flight = fly_corridor(&start, &goal, &corridor, &limits, &InteriorSettings::default()).unwrap();
        let mut random = SplitMix(!seed);
        for (piece, k) in flight.trajectory.pieces.iter().zip(&flight.polytope_of) {
            check(piece, &corridor[*k], &limits)?;
            let mut disturbed = piece.clone();
            for c in &mut disturbed.coefficients {
                c.iter_mut().for_each(|x| *x *= 1.0 + log_noise.exp() * (2.0 * random.unit() - 1.0));
            }
            check(&disturbed, &corridor[*k], &limits)?;
        }
    }
}

/// Nothing is known of numbers that are none, of time that does not pass, of pieces that do not join, of limits that are none.
#[test]
fn nonsense_is_never_proved() {
    let good = limits(false);
    let (start, goal, corridor) = chain(6, 2);
    let flight = fly_corridor(&start, &goal, &corridor, &good, &InteriorSettings::default()).unwrap();
    let verdict = |trajectory: &PolynomialTrajectory, corridor: &[Polytope], limits: &FlightLimits| {
        prove(trajectory, corridor, &flight.polytope_of, limits).holds
    };
    assert!(verdict(&flight.trajectory, &corridor, &good));
    let change = |edit: &dyn Fn(&mut PolynomialTrajectory)| {
        let mut trajectory = flight.trajectory.clone();
        edit(&mut trajectory);
        verdict(&trajectory, &corridor, &good)
    };
    for k in 0..6 {
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(!change(&|t| t.pieces[1].coefficients[k].y = bad), "coefficient {k} is {bad}");
        }
    }
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        assert!(!change(&|t| t.pieces[0].duration_s = bad), "a duration of {bad} s");
    }
    let point = Piece { duration_s: f64::NAN, coefficients: vec![start[0]] };
    assert!(!change(&|t| t.pieces[0] = point.clone()), "a point for no time");
    assert!(!change(&|t| t.pieces.clear()));
    assert!(!change(&|t| t.pieces[1].coefficients[0].x += 1e-3), "a leap");
    assert!(!change(&|t| t.pieces[1].coefficients[2].x += 1e-3), "a jerk without end");
    let mut crooked = corridor.clone();
    crooked[1].faces[3].normal.x = f64::NAN;
    assert!(!verdict(&flight.trajectory, &crooked, &good));
    let shortest = flight.trajectory.pieces.iter().map(|p| p.duration_s).fold(f64::INFINITY, f64::min);
    let frame = good.airframe.unwrap();
    for bad in [
        FlightLimits { max_thrust_n: f64::NAN, ..good },
        FlightLimits { min_thrust_n: f64::NAN, ..good },
        FlightLimits { min_duration_s: 1.01 * shortest, ..good },
        FlightLimits { airframe: Some(Airframe { drag_across: -5.0, ..frame }), ..good },
    ] {
        assert!(!prove(&flight.trajectory, &corridor, &flight.polytope_of, &bad).holds, "{bad:?}");
    }
    assert!(!verdict(&flight.trajectory, &corridor, &FlightLimits { max_speed_mps: f64::NAN, ..good }));
}
