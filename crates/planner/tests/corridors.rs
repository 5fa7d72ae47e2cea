//! Flights through corridors and voxels: proved, checked again by samples, as good as convex programs, and refused with a reason.
#![cfg(feature = "air")]
mod support;

use nalgebra::{Matrix3, Point3, Vector3};
use planner::air::depth::deepest_point;
use planner::air::ellipsoid::inscribed_ellipsoid;
use planner::air::region::region;
use planner::air::vertices::vertices;
use planner::*;
use proptest::prelude::*;
use support::corridors::{chain, limits};
use support::{SplitMix, numbers, rows, shared_aerial};

/// Dense samples of everything that was promised, written down again from the definitions.
fn check_by_samples(
    flight: &CorridorFlight,
    corridor: &[Polytope],
    limits: &FlightLimits,
    ends: [&[Vector3<f64>; 3]; 2],
) {
    // Rounding of a polynomial of degree five at a few metres.
    const TOL: f64 = 1e-8;
    assert!(flight.proof.holds && flight.proof.violation(limits) == Violation::default());
    assert_eq!(flight.polytope_of.len(), flight.trajectory.pieces.len());
    assert!(flight.polytope_of.windows(2).all(|w| w[1] == w[0] || w[1] == w[0] + 1), "every polytope in order");
    assert_eq!((flight.polytope_of[0], flight.polytope_of.last()), (0, Some(&(corridor.len() - 1))));
    let frame = limits.airframe.unwrap();
    for (piece, k) in flight.trajectory.pieces.iter().zip(&flight.polytope_of) {
        assert!(piece.duration_s >= limits.min_duration_s);
        for j in 0..=300 {
            let s = piece.sample(piece.duration_s * f64::from(j) / 300.0);
            assert!(corridor[*k].slack(&s.p.coords) >= -TOL && s.v.norm() <= limits.max_speed_mps + TOL);
            let out = frame.demand(&s.v, &s.a, &s.jerk, 0.0, 0.0);
            let up = nalgebra::UnitQuaternion::new_unchecked(out.attitude) * Vector3::z();
            assert!(up.angle(&Vector3::z()) <= limits.max_tilt_rad + 1e-7);
            assert!(out.body_rate_radps.norm() <= limits.max_rate_radps + TOL);
            assert!((limits.min_thrust_n - TOL..=limits.max_thrust_n + TOL).contains(&out.thrust_n));
        }
    }
    for pair in flight.trajectory.pieces.windows(2) {
        let (a, b) = (pair[0].sample(pair[0].duration_s), pair[1].sample(0.0));
        assert!((a.p - b.p).norm() < 1e-8 && (a.v - b.v).norm() < 1e-8 && (a.a - b.a).norm() < 1e-6);
    }
    let last = flight.trajectory.pieces.last().unwrap();
    for (s, state) in [flight.trajectory.sample(0.0), last.sample(last.duration_s)].iter().zip(ends) {
        assert!(
            (s.p.coords - state[0]).norm() < 1e-8 && (s.v - state[1]).norm() < 1e-8 && (s.a - state[2]).norm() < 1e-6
        );
    }
    let weighed = flight.effort + limits.time_weight * flight.trajectory.duration();
    assert!((weighed - flight.cost).abs() < 1e-9 * flight.cost);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn chains_are_flown_within_every_limit(seed in any::<u64>(), count in 1usize..14, is_agile in any::<bool>()) {
        let (start, goal, corridor) = chain(seed, count);
        let limits = limits(is_agile);
        let flight = fly_corridor(&start, &goal, &corridor, &limits, &InteriorSettings::default());
        let flight = flight.map_err(|e| TestCaseError::fail(e.to_string()))?;
        check_by_samples(&flight, &corridor, &limits, [&start, &goal]);
        let again = fly_corridor(&start, &goal, &corridor, &limits, &InteriorSettings::default()).unwrap();
        prop_assert_eq!(again.trajectory, flight.trajectory, "the same bits");
    }

    /// The ellipsoid is inside, and the vertices are on the faces and inside all others.
    #[test]
    fn vertices_and_ellipsoids_are_inside(seed in any::<u64>()) {
        let (_, _, corridor) = chain(seed, 1);
        let corners = vertices(&corridor[0]).unwrap();
        prop_assert!(corners.len() >= 4);
        for v in &corners {
            prop_assert!(corridor[0].slack(v) >= -1e-6);
            prop_assert!(corridor[0].faces.iter().filter(|f| (f.offset_m - f.normal.dot(v)).abs() < 1e-6).count() >= 3);
        }
        let e = inscribed_ellipsoid(&corridor[0]).unwrap();
        for f in &corridor[0].faces {
            prop_assert!(e.shape.tr_mul(&f.normal).norm() + f.normal.dot(&e.centre) <= f.offset_m + 1e-7);
        }
        let (point, depth) = deepest_point(corridor[0].faces.iter(), &Vector3::zeros()).unwrap();
        prop_assert!((corridor[0].slack(&point) - depth).abs() < 1e-6);
        // No larger ball is inside: the ellipsoid holds at least as much as the largest ball.
        prop_assert!(e.volume() >= 4.0 / 3.0 * std::f64::consts::PI * depth.powi(3) - 1e-6);
    }

    /// The line is inside, and no point of any cube is.
    #[test]
    fn regions_hold_the_line_and_no_part_of_a_voxel(seed in any::<u64>(), count in 0usize..60) {
        let mut random = SplitMix(seed);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| reach * (2.0 * random.unit() - 1.0));
        let (a, b) = (vector(2.0), vector(2.0));
        let half = 0.125;
        let cubes: Vec<Vector3<f64>> = (0..count).map(|_| (vector(12.0).map(f64::round) + Vector3::repeat(0.5)) * (2.0 * half)).collect();
        let around = Polytope::from_box(&Point3::new(-3.0, -3.0, -3.0), &Point3::new(3.0, 3.0, 3.0));
        if let Some(found) = region(&a, &b, &around, &cubes, 2.0 * half, 1e-3) {
            prop_assert!(found.slack(&a) > 0.0 && found.slack(&b) > 0.0);
            for cube in &cubes {
                // A convex set misses a cube if one face has all of the cube on its outside.
                let support = |n: &Vector3<f64>| half * n.abs().sum();
                let is_outside = |f: &HalfSpace| f.normal.dot(cube) - support(&f.normal) >= f.offset_m - 1e-9;
                prop_assert!(found.faces.iter().any(is_outside), "a part of {cube} is inside");
            }
        } else {
            let touches = |t: f64| cubes.iter().any(|c| (a + (b - a) * t - c).amax() <= half + 0.02);
            prop_assert!((0..=400).any(|k| touches(f64::from(k) / 400.0)), "refused though nothing is near");
        }
    }
}

/// Two methods that share neither iteration nor solver meet at the same optimum.
#[test]
fn the_barrier_is_as_good_as_convex_programs() {
    for seed in [3, 8] {
        let (start, goal, corridor) = chain(seed, 4);
        let limits = limits(false);
        let barrier = fly_corridor(&start, &goal, &corridor, &limits, &InteriorSettings::default()).unwrap();
        let programs = fly_corridor_hard(&start, &goal, &corridor, &limits).unwrap();
        check_by_samples(&programs, &corridor, &limits, [&start, &goal]);
        // Both stop a little above the optimum: the barrier by its weight, the descent by its tolerance.
        let ratio = barrier.cost / programs.cost;
        assert!((0.999..1.001).contains(&ratio), "seed {seed}: {ratio}");
    }
}

#[test]
fn what_cannot_be_flown_is_refused_at_once_with_the_reason() {
    let (start, goal, corridor) = chain(4, 3);
    let good = limits(false);
    let fly = |start: &[Vector3<f64>; 3], corridor: &[Polytope], limits: &FlightLimits| {
        fly_corridor(start, &goal, corridor, limits, &InteriorSettings::default()).map(|_| ()).unwrap_err()
    };
    assert_eq!(fly(&start, &[], &good), CorridorError::Empty);
    let mut off = start;
    off[0].z += 100.0;
    assert!(matches!(fly(&off, &corridor, &good), CorridorError::StartOutside { .. }));
    off[0].z = f64::NAN;
    assert_eq!(fly(&off, &corridor, &good), CorridorError::NotFinite);
    let mut fast = start;
    fast[1] = Vector3::new(9.0, 0.0, 0.0);
    assert!(matches!(fly(&fast, &corridor, &good), CorridorError::TooFast { end: "start", .. }));
    assert!(matches!(fly(&start, &corridor[..1], &good), CorridorError::GoalOutside { .. }));
    let apart = [
        corridor[0].clone(),
        Polytope::from_box(&Point3::new(50.0, 0.0, 0.0), &Point3::new(60.0, 9.0, 9.0)),
        corridor[2].clone(),
    ];
    assert!(
        matches!(fly(&start, &apart, &good), CorridorError::NoOverlap { first: 0, second: 1, depth_m } if depth_m < 0.0)
    );
    let mut crooked = corridor.clone();
    crooked[1].faces[0].normal *= 2.0;
    assert_eq!(fly(&start, &crooked, &good), CorridorError::BadPolytope { polytope: 1 });
    for bad in [
        FlightLimits { max_speed_mps: f64::NAN, ..good },
        FlightLimits { min_duration_s: 0.0, ..good },
        FlightLimits { airframe: good.airframe.map(|a| Airframe { mass_kg: 0.0, ..a }), ..good },
        FlightLimits { max_tilt_rad: 1.6, ..good },
        FlightLimits { min_thrust_n: 7.0, ..good },
    ] {
        assert!(matches!(fly(&start, &corridor, &bad), CorridorError::Limits(_)));
    }
    // Two boxes that only touch.
    let touching = [
        Polytope::from_box(&Point3::new(-1.0, -1.0, -1.0), &Point3::new(1.0, 1.0, 1.0)),
        Polytope::from_box(&Point3::new(1.0, -1.0, -1.0), &Point3::new(3.0, 1.0, 1.0)),
    ];
    let zero = Vector3::zeros();
    let beyond = [Vector3::new(2.0, 0.0, 0.0), zero, zero];
    let refused = fly_corridor(&[zero; 3], &beyond, &touching, &good, &InteriorSettings::default()).map(|_| ());
    assert!(matches!(refused, Err(CorridorError::NoOverlap { .. })), "{refused:?}");
}

/// A vehicle of which only speed and acceleration are known, and one that cannot stop before the wall.
#[test]
fn without_an_airframe_acceleration_is_the_limit_and_a_wall_too_near_is_said() {
    let (start, goal, corridor) = chain(12, 6);
    let slow = FlightLimits { airframe: None, max_speed_mps: 1.5, max_accel_mps2: 2.0, ..limits(false) };
    let flight = fly_corridor(&start, &goal, &corridor, &slow, &InteriorSettings::default()).unwrap();
    let duration = flight.trajectory.duration();
    for k in 0..=5000 {
        let s = flight.trajectory.sample(duration * f64::from(k) / 5000.0);
        assert!(s.v.norm() <= 1.5 + 1e-9 && s.a.norm() <= 2.0 + 1e-9);
    }
    let length: f64 =
        flight.trajectory.pieces.windows(2).map(|w| (w[1].coefficients[0] - w[0].coefficients[0]).norm()).sum();
    assert!(duration < 4.0 + length, "{duration} s for {length} m is not what these limits allow");
    let zero = Vector3::zeros();
    let cell = [Polytope::from_box(&Point3::new(-1.0, -1.0, -1.0), &Point3::new(1.0, 1.0, 1.0))];
    let dashing = [Vector3::new(0.9, 0.0, 0.0), Vector3::new(3.9, 0.0, 0.0), zero];
    let refused = fly_corridor(&dashing, &[zero; 3], &cell, &limits(false), &InteriorSettings::default()).map(|_| ());
    assert!(matches!(refused, Err(CorridorError::NotProved { .. })), "{refused:?}");
}

/// Turning about on the spot: start and goal are one point.
#[test]
fn a_flight_of_no_length_is_a_flight() {
    let zero = Vector3::zeros();
    let cell = [Polytope::from_box(&Point3::new(-1.0, -1.0, -1.0), &Point3::new(1.0, 1.0, 1.0))];
    let flight = fly_corridor(&[zero; 3], &[zero; 3], &cell, &limits(false), &InteriorSettings::default()).unwrap();
    check_by_samples(&flight, &cell, &limits(false), [&[zero; 3], &[zero; 3]]);
    let moving = [zero, Vector3::new(0.7, 0.0, 0.0), zero];
    let back = fly_corridor(&moving, &[zero; 3], &cell, &limits(false), &InteriorSettings::default()).unwrap();
    check_by_samples(&back, &cell, &limits(false), [&moving, &[zero; 3]]);
}

#[test]
fn ellipsoids_equal_the_stored_ones() {
    let (Some(stored), Some(corridors)) =
        (shared_aerial("mvie_vectors.json"), shared_aerial("corridors_chain_10.json"))
    else {
        return;
    };
    let parse = |text: &str| -> serde_json::Value { serde_json::from_str(text).unwrap() };
    let (stored, corridors) = (parse(&stored), parse(&corridors));
    let mut seen = 0;
    for row in stored["rows"].as_array().unwrap() {
        let problem = corridors["problems"].as_array().unwrap().iter().find(|p| p["id"] == row["id"]).unwrap();
        let faces = problem["polytopes"][row["polytope"].as_u64().unwrap() as usize].as_array().unwrap();
        let faces = faces.iter().map(|r| {
            let r = numbers(r);
            HalfSpace { normal: Vector3::new(r[0], r[1], r[2]), offset_m: -r[3] }
        });
        let found = inscribed_ellipsoid(&Polytope { faces: faces.collect() }).unwrap();
        let q = rows(&row["Q"]);
        let q = Matrix3::from_rows(&[q[0].transpose(), q[1].transpose(), q[2].transpose()]);
        // Both solvers stop at 1e-8 of the objective; the maximiser is known to its square root.
        assert!((found.volume() / row["volume"].as_f64().unwrap() - 1.0).abs() < 1e-6);
        assert!((found.centre - Vector3::from_iterator(numbers(&row["center"]))).norm() < 1e-3);
        assert!((found.shape * found.shape.transpose() - q).norm() < 1e-3 * q.norm());
        seen += 1;
    }
    assert_eq!(seen, 60);
}

/// A forest of boxes: the flight enters no grown voxel, and its corridor none either.
#[test]
fn a_forest_is_crossed_outside_every_grown_voxel() {
    let mut random = SplitMix(31);
    let mut map = VoxelMap::free(&Point3::new(-10.0, -10.0, 0.0), &Point3::new(10.0, 10.0, 5.0), 0.25).unwrap();
    let (start, goal) = (Point3::new(-9.0, -2.0, 1.5), Point3::new(9.0, 3.0, 2.2));
    for _ in 0..40 {
        let (x, y, h) = (16.0 * random.unit() - 8.0, 19.0 * random.unit() - 9.5, 1.5 + 3.5 * random.unit());
        let r = 0.2 + 0.6 * random.unit();
        map.occupy_box(&Point3::new(x - r, y - r, 0.0), &Point3::new(x + r, y + r, h));
    }
    let grown = map.dilated(2);
    let found = fly_voxels(&grown, &start, &goal, 0.0, &limits(false), &InteriorSettings::default()).unwrap();
    let at_rest = |p: &Point3<f64>| [p.coords, Vector3::zeros(), Vector3::zeros()];
    check_by_samples(&found.flight, &found.corridor, &limits(false), [&at_rest(&start), &at_rest(&goal)]);
    let duration = found.flight.trajectory.duration();
    assert!((0..5000).all(|k| grown.is_free(&found.flight.trajectory.sample(duration * f64::from(k) / 5000.0).p)));
    assert!(found.route.len() > 2, "it had to turn");
    let fly = |start: &Point3<f64>, goal: &Point3<f64>| {
        fly_voxels(&grown, start, goal, 0.0, &limits(false), &InteriorSettings::default()).map(|_| ()).unwrap_err()
    };
    assert_eq!(fly(&Point3::new(0.0, 0.0, 77.0), &goal), VoxelFlightError::StartBlocked);
    assert_eq!(fly(&start, &Point3::new(f64::NAN, 0.0, 1.0)), VoxelFlightError::GoalBlocked);
}

/// Limits that are switched off, numbers at the edge of sense, settings that would never end: an answer, proved or refused.
#[test]
fn whatever_the_numbers_there_is_an_answer() {
    let (start, goal, corridor) = chain(20, 3);
    let good = limits(false);
    let usual = InteriorSettings::default();
    let fly = |limits: &FlightLimits, settings: &InteriorSettings| {
        fly_corridor(&start, &goal, &corridor, limits, settings).map(|f| f.proof.holds)
    };
    let strong = FlightLimits { max_thrust_n: f64::INFINITY, ..good };
    assert_eq!(fly(&strong, &usual), Ok(true));
    assert!(fly_corridor_hard(&start, &goal, &corridor, &strong).unwrap().proof.holds);
    let free = FlightLimits { max_rate_radps: f64::INFINITY, min_thrust_n: f64::NEG_INFINITY, ..strong };
    assert_eq!(fly(&free, &usual), Ok(true));
    for settings in [
        InteriorSettings { shrink: 1.0, ..usual },
        InteriorSettings { shrink: f64::NAN, ..usual },
        InteriorSettings { last_weight: 0.0, last_softness: 0.0, ..usual },
    ] {
        assert_eq!(fly(&good, &settings), Ok(true), "{settings:?}");
    }
    for limits in [
        FlightLimits { min_duration_s: 1e300, ..good },
        FlightLimits { min_duration_s: 1e-300, ..good },
        FlightLimits { time_weight: 1e300, ..good },
        FlightLimits { time_weight: 1e-300, ..good },
        FlightLimits { max_speed_mps: 1e-9, ..good },
        FlightLimits { max_speed_mps: 1e300, ..good },
    ] {
        if let Ok(holds) = fly(&limits, &usual) {
            assert!(holds);
        }
    }
}
