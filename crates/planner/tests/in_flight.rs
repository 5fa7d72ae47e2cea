//! What a flight commits to while the world is only partly known and partly moving, where it looks, and its other limits.
#![cfg(feature = "air")]
mod support;

use nalgebra::{Point2, Point3, Vector3};
use planner::air::limits::BoundaryState;
use planner::*;
use proptest::prelude::*;
use support::{SplitMix, Voxels};

fn plan(
    voxels: &Voxels,
    start: &FlightState,
    goal: &Point3<f64>,
    movers: &[Mover],
    config: &AirConfig,
) -> Result<AirPlan, AirPlanError> {
    let space = AirSpace { distance: &|p| voxels.distance(p), obstacles: &|a, b| voxels.obstacles(a, b), movers };
    plan_air(start, goal, &space, config)
}

/// A hall of 8 m x 6 m with floor and ceiling.
fn hall() -> Voxels {
    let mut voxels = Voxels::new([8.0, 6.0, 2.8], &[[0.0, 0.0, 0.0, 8.0, 6.0, 0.1], [0.0, 0.0, 2.7, 8.0, 6.0, 2.8]]);
    voxels.measure();
    voxels
}

fn config() -> AirConfig {
    AirConfig { radius_m: 0.25, ..AirConfig::default() }
}

fn limits() -> FlightLimits {
    let airframe = Airframe {
        mass_kg: 1.2,
        gravity_mps2: 9.81,
        drag_across: 0.25,
        drag_along: 0.12,
        drag_parasitic: 0.0,
        speed_epsilon: 1e-4,
    };
    FlightLimits {
        max_speed_mps: 3.0,
        max_accel_mps2: 4.0,
        airframe: Some(airframe),
        max_tilt_rad: 0.4,
        max_rate_radps: 1.5,
        min_thrust_n: 4.0,
        max_thrust_n: 20.0,
        min_duration_s: 0.1,
        time_weight: 50.0,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// The proof against movers is sound: no sample is nearer than the proved slack says; and not idle: it is near the truth.
    #[test]
    fn nothing_that_moves_comes_nearer_than_proved(seed in any::<u64>(), speed in 0.0..3.0f64, growth in 0.0..0.5f64) {
        let mut random = SplitMix(seed);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| reach * (2.0 * random.unit() - 1.0));
        let zero = Vector3::zeros();
        let points = [vector(3.0), vector(3.0), vector(3.0), vector(3.0)];
        let spline = Minco::<3>::solve(&[points[0], zero, zero], &[points[3], zero, zero], &points[1..3], &[1.2, 0.9, 1.4]).unwrap();
        let flight = PolynomialTrajectory::from_minco(&spline);
        let mover = Mover { position: Point3::from(vector(4.0)), velocity_mps: vector(1.0) * speed, radius_m: 0.3, growth_mps: growth };
        for horizon_s in [1.5, 5.0] {
            let movers = Movers { list: &[mover], keep_m: 0.4, horizon_s };
            let slack_m = movers.slack_m(&flight);
            let sampled = (0..=4000).map(|k| {
                let t = horizon_s * f64::from(k) / 4000.0;
                (flight.sample(t).p - (mover.position + mover.velocity_mps * t)).norm() - 0.7 - growth * t
            }).fold(f64::INFINITY, f64::min);
            // A flight that is truly too near may stop the search for the bound at any instant that shows it.
            if sampled >= 0.0 {
                prop_assert!(slack_m <= sampled + 1e-9, "{slack_m} proved, {sampled} sampled");
            }
            prop_assert_eq!(slack_m >= 0.0 && sampled < -1e-9, false, "{} proved, {} sampled", slack_m, sampled);
            prop_assert!(slack_m >= 0.0 || sampled < 1e-3, "not proved although {} m are left", sampled);
        }
    }

    /// Whoever walks through the hall: the flight is proved to keep away from him, or there is none and the reason is he.
    #[test]
    fn flights_among_people_keep_away_from_them(x in 2.0..6.0f64, y in 0.5..5.5f64, heading in -3.1..3.1f64, speed in 0.0..1.6f64) {
        let voxels = hall();
        let config = config();
        let start = FlightState::resting_at(Point3::new(1.0, 3.0, 1.3));
        let walker = Mover {
            position: Point3::new(x, y, 1.2),
            velocity_mps: Vector3::new(heading.cos(), heading.sin(), 0.0) * speed,
            radius_m: 0.4,
            growth_mps: 0.05,
        };
        match plan(&voxels, &start, &Point3::new(7.0, 3.0, 1.3), &[walker], &config) {
            Ok(plan) => {
                prop_assert!(plan.proof.holds && plan.proof.mover_slack_m >= 0.0);
                for k in 0..=600 {
                    let t = config.prediction_s * f64::from(k) / 600.0;
                    let apart = (plan.trajectory.sample(t).p - (walker.position + walker.velocity_mps * t)).norm();
                    prop_assert!(apart >= config.clearance_m() + 0.4 + 0.05 * t - 1e-9, "{apart} m at {t} s");
                }
            }
            Err(error) => prop_assert!(!matches!(error, AirPlanError::NotFinite | AirPlanError::Config(_)), "{error}"),
        }
    }

    /// The heading starts where it was, never turns faster than allowed, never jumps, and looks at the end where it shall.
    #[test]
    fn headings_keep_the_turning_limit_and_arrive(
        seed in any::<u64>(), yaw in -9.0..9.0f64, rate in -1.0..1.0f64, look in proptest::option::of(-3.1..3.1f64), limit in 0.2..2.0f64,
    ) {
        let mut random = SplitMix(seed);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| reach * (2.0 * random.unit() - 1.0));
        let zero = Vector3::zeros();
        let points = [vector(5.0), vector(5.0), vector(5.0)];
        let spline = Minco::<3>::solve(&[points[0], zero, zero], &[points[2], zero, zero], &points[1..2], &[2.5, 3.0]).unwrap();
        let flight = PolynomialTrajectory::from_minco(&spline);
        let rate = rate.clamp(-limit, limit);
        let heading = HeadingPlan::along(&flight, yaw, rate, look, limit);
        let first = heading.sample(0.0);
        prop_assert!((first.0 - yaw).abs() < 1e-12 && (first.1 - rate).abs() < 1e-9);
        let steps = 4000;
        let dt = heading.duration() / f64::from(steps);
        let mut before = first;
        for k in 1..=steps {
            let now = heading.sample(dt * f64::from(k));
            prop_assert!(now.1.abs() <= limit + 1e-9, "turns at {} rad/s", now.1);
            prop_assert!((now.0 - before.0).abs() <= limit * dt + 1e-9, "jumps");
            // From one limit to the other takes a step of the plan at least.
            prop_assert!((now.1 - before.1).abs() <= 2.0 * limit * dt / 0.1 + 1e-9, "its rate jumps");
            before = now;
        }
        if let Some(look) = look {
            let (end, _) = heading.sample(f64::MAX);
            prop_assert!((end - look).sin().abs() < 1e-6 && (end - look).cos() > 0.0, "looks to {end}, not to {look}");
        }
    }

    /// Every waypoint is passed within its reach and every limit kept, by proof and by samples.
    #[test]
    fn waypoints_are_passed_within_every_limit(seed in any::<u64>(), count in 0usize..6, speed in 0.0..2.5f64) {
        let mut random = SplitMix(seed);
        let mut at = Vector3::new(0.0, 0.0, 5.0);
        let start: BoundaryState = [at, Vector3::new(speed, 0.0, 0.0), Vector3::zeros()];
        let mut points = Vec::new();
        for _ in 0..=count {
            at += Vector3::new(1.5 + 4.0 * random.unit(), 6.0 * random.unit() - 3.0, 2.0 * random.unit() - 1.0);
            points.push(at);
        }
        let goal = points.pop().unwrap();
        let limits = limits();
        let reach_m = 0.2;
        let flight = fly_waypoints(&start, &points, &[goal, Vector3::zeros(), Vector3::zeros()], reach_m, &limits)
            .map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert!(flight.proof.holds);
        prop_assert_eq!(flight.trajectory.pieces.len(), count + 1);
        let mut end_s = 0.0;
        for (piece, point) in flight.trajectory.pieces.iter().zip(points.iter().chain([&goal])) {
            end_s += piece.duration_s;
            let there = flight.trajectory.sample(end_s - 1e-12).p.coords;
            prop_assert!((there - point).norm() <= reach_m + 1e-6);
        }
        for k in 0..=3000 {
            let s = flight.trajectory.sample(end_s * f64::from(k) / 3000.0);
            prop_assert!(s.v.norm() <= limits.max_speed_mps + 1e-8 && s.a.norm() <= limits.max_accel_mps2 + 1e-8);
            let demand = limits.airframe.unwrap().demand(&s.v, &s.a, &s.jerk, 0.0, 0.0);
            prop_assert!(demand.body_rate_radps.norm() <= limits.max_rate_radps + 1e-7);
            prop_assert!(demand.thrust_n <= limits.max_thrust_n + 1e-8 && demand.thrust_n >= limits.min_thrust_n - 1e-8);
        }
    }

    /// Up to rest and down to a slow touch, inside the column and within the limits of climbing.
    #[test]
    fn take_off_and_landing_are_proved(height in 0.1..6.0f64, drift in -0.04..0.04f64) {
        let limits = limits();
        let ground = FlightState::resting_at(Point3::new(1.0, -2.0, 0.2));
        let up = fly_up(&ground, 0.2 + height, 0.5, &limits).unwrap();
        let top = up.trajectory.sample(f64::MAX).p;
        prop_assert!(up.proof.holds && up.proof.max_speed_mps <= 0.5 + 1e-9 && (top - Point3::new(1.0, -2.0, 0.2 + height)).norm() < 1e-6);
        let hover = FlightState { v: Vector3::new(drift, 0.0, 0.0), ..FlightState::resting_at(top) };
        let touch = TouchDown::default();
        let down = fly_down(&hover, 0.2, &touch, &limits).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert!(down.proof.holds);
        let duration = down.trajectory.duration();
        let mut before = f64::INFINITY;
        for k in 0..=500 {
            let s = down.trajectory.sample(duration * f64::from(k) / 500.0 * (1.0 - 1e-12));
            prop_assert!(s.p.z <= before + 1e-9, "it never rises");
            prop_assert!((s.p.xy() - top.xy()).norm() < 0.22 && s.v.norm() <= touch.descent_mps + 1e-9);
            prop_assert!(height < 0.4 || s.p.z >= 0.2 + touch.slow_m || (s.v.z + touch.touch_mps).abs() < 1e-6, "it touches slowly: {} at {}", s.v.z, s.p.z);
            before = s.p.z;
        }
        prop_assert!((before - (0.2 - touch.below_m)).abs() < 0.02 + 1e-6, "it goes on until the ground ends it: {before}");
    }
}

/// The far end of the hall is not known: the flight commits to the known part only, at rest at its end, and says how much is left.
/// What is learnt on the way is used before that end, and the set-point does not jump.
#[test]
fn a_flight_into_the_unknown_ends_in_the_known_and_goes_on_when_more_is_seen() {
    let whole = hall();
    let config = config();
    let seen_to = |x: f64| {
        let mut voxels = hall();
        for k in 0..voxels.unknown.len() {
            voxels.unknown[k] = voxels.center(k).x > x;
        }
        voxels.measure();
        voxels
    };
    let goal = Point3::new(7.0, 3.0, 1.3);
    let mut state = FlightState::resting_at(Point3::new(1.0, 3.0, 1.3));
    let mut slowest: f64 = f64::INFINITY;
    let mut parts = 0;
    for _ in 0..40 {
        // It sees three metres ahead of itself.
        let map = seen_to(state.p.x + 3.0);
        let plan =
            plan(&map, &state, &goal, &[], &config).unwrap_or_else(|e| panic!("{e} after {parts} parts, {state:?}"));
        assert!(plan.proof.holds);
        let (end, duration) = (plan.trajectory.sample(f64::MAX).p, plan.trajectory.duration());
        for k in 0..=200 {
            let p = plan.trajectory.sample(duration * f64::from(k) / 200.0).p;
            assert!(map.distance(&p).is_some(), "it commits to nothing unknown");
            // Nor does any part of its body: an unknown voxel is kept away from like an occupied one.
            let nearest = (0..map.unknown.len())
                .filter(|k| map.unknown[*k])
                .map(|k| (map.center(k) - p).norm())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest >= config.clearance_m() + config.obstacle_radius_m - 1e-9, "{nearest} m at {p}");
        }
        if plan.left_m == 0.0 {
            assert!((end - goal).norm() < 1e-6);
            break;
        }
        parts += 1;
        assert!((plan.goal_pull_m - (end - goal).norm()).abs() < 1e-9 && plan.left_m >= plan.goal_pull_m - 0.2);
        // Half a second later it has seen more and plans anew from where it is.
        let s = plan.trajectory.sample(0.5);
        state = FlightState { p: s.p, v: s.v, a: s.a };
        if parts > 4 {
            slowest = slowest.min(s.v.norm());
        }
    }
    assert!(parts > 2, "{parts} parts");
    assert!(slowest > 0.5, "it does not stop where the known ended before: {slowest} m/s");
    // A near horizon is a limit too, in known space.
    let near = AirConfig { horizon_m: 2.0, ..config };
    let part = plan(&whole, &FlightState::resting_at(Point3::new(1.0, 3.0, 1.3)), &goal, &[], &near).unwrap();
    assert!((part.left_m - 4.0).abs() < 0.3 && part.trajectory.sample(f64::MAX).v.norm() == 0.0, "{}", part.left_m);
}

#[test]
fn a_walker_who_crosses_is_let_pass_or_gone_round_and_one_who_blocks_everything_is_the_reason() {
    let voxels = hall();
    let config = config();
    let start = FlightState::resting_at(Point3::new(1.0, 3.0, 1.3));
    let goal = Point3::new(7.0, 3.0, 1.3);
    let alone = plan(&voxels, &start, &goal, &[], &config).unwrap();
    // He is in the middle of the way when the flight would be there.
    let meets_s = (0..).map(|k| 0.01 * f64::from(k)).find(|t| alone.trajectory.sample(*t).p.x > 3.0).unwrap();
    let walker = |speed: f64| Mover {
        position: Point3::new(3.0, 3.0 - speed * meets_s, 1.2),
        velocity_mps: Vector3::new(0.0, speed, 0.0),
        radius_m: 0.4,
        growth_mps: 0.0,
    };
    let crossing = [walker(1.0)];
    let movers = Movers { list: &crossing, keep_m: config.clearance_m(), horizon_s: config.prediction_s };
    assert!(movers.slack_m(&alone.trajectory) < 0.0, "alone it would meet him");
    let among = plan(&voxels, &start, &goal, &crossing, &config).unwrap();
    assert!(among.proof.mover_slack_m >= 0.0 && movers.slack_m(&among.trajectory) >= 0.0);
    // Somebody as large as the hall.
    let wall = [Mover {
        position: Point3::new(4.5, 3.0, 1.2),
        velocity_mps: Vector3::zeros(),
        radius_m: 3.2,
        growth_mps: 0.0,
    }];
    let refused = plan(&voxels, &start, &Point3::new(7.5, 3.0, 1.3), &wall, &config).err();
    assert!(matches!(refused, Some(AirPlanError::MoverInTheWay { missing_m }) if missing_m > 0.0), "{refused:?}");
    // A mover that is no number is never proved away.
    let nonsense = [Mover { position: Point3::new(f64::NAN, 0.0, 0.0), ..walker(1.0) }];
    assert!(plan(&voxels, &start, &goal, &nonsense, &config).is_err());
}

#[test]
fn no_flight_crosses_the_fence() {
    let voxels = hall();
    // The straight way at y = 3 is outside: the fence is a wedge that leaves the north of the hall.
    let corners = [[0.5, 2.5], [4.0, 3.6], [7.5, 2.5], [7.5, 5.5], [0.5, 5.5]];
    let dented = corners.map(|c| Point2::new(c[0], c[1]));
    assert!(matches!(Geofence::new(&dented, 0.2, 2.0), Err(GeofenceError::NotConvex { .. })));
    let corners = [[0.5, 2.5], [7.5, 2.5], [7.5, 5.5], [0.5, 5.5]].map(|c| Point2::new(c[0], c[1]));
    let fence = Geofence::new(&corners, 0.2, 1.5).unwrap();
    let config = AirConfig { geofence: Some(fence.clone()), ..config() };
    let start = FlightState { v: Vector3::new(0.8, -0.5, 0.2), ..FlightState::resting_at(Point3::new(1.0, 3.2, 1.3)) };
    let plan_to = |start: &FlightState, goal: Point3<f64>| plan(&voxels, start, &goal, &[], &config);
    let flight = plan_to(&start, Point3::new(7.0, 2.6, 1.45)).unwrap();
    let duration = flight.trajectory.duration();
    for k in 0..=1000 {
        let p = flight.trajectory.sample(duration * f64::from(k) / 1000.0).p;
        assert!(fence.slack_m(&p) >= -1e-9, "{p} is outside");
    }
    let outside = plan_to(&start, Point3::new(7.0, 2.0, 1.3)).err();
    assert!(
        matches!(outside, Some(AirPlanError::OutsideFence { end: "goal", outside_m }) if (outside_m - 0.5).abs() < 1e-9)
    );
    let escaped = FlightState::resting_at(Point3::new(1.0, 3.0, 1.9));
    assert!(matches!(
        plan_to(&escaped, Point3::new(7.0, 3.0, 1.3)),
        Err(AirPlanError::OutsideFence { end: "start", .. })
    ));
}

#[test]
fn bad_waypoints_and_columns_are_refused_at_once() {
    let limits = limits();
    let at_rest = |x: f64| [Vector3::new(x, 0.0, 5.0), Vector3::zeros(), Vector3::zeros()];
    let (start, goal) = (at_rest(0.0), at_rest(9.0));
    let way = [Vector3::new(4.0, 1.0, 5.0)];
    let refused = |way: &[Vector3<f64>], reach| fly_waypoints(&start, way, &goal, reach, &limits).err();
    assert_eq!(refused(&way, 0.0), Some(WaypointError::BadReach { reach_m: 0.0 }));
    assert!(matches!(refused(&way, f64::NAN), Some(WaypointError::BadReach { .. })));
    assert_eq!(refused(&[way[0], Vector3::repeat(f64::NAN)], 0.2), Some(WaypointError::NotFinite { waypoint: 1 }));
    assert_eq!(refused(&[way[0], way[0]], 0.2), Some(WaypointError::NoLeg { point: 2, reach_m: 0.2 }));
    let fast = [start[0], Vector3::new(9.0, 0.0, 0.0), start[2]];
    let error = fly_waypoints(&fast, &way, &goal, 0.2, &limits).err();
    assert!(matches!(error, Some(WaypointError::Flight(CorridorError::TooFast { end: "start", .. }))));
    let massless = FlightLimits { airframe: Some(Airframe { mass_kg: 0.0, ..limits.airframe.unwrap() }), ..limits };
    assert!(fly_waypoints(&start, &way, &goal, 0.2, &massless).is_err());
    let nan = FlightState::resting_at(Point3::new(f64::NAN, 0.0, 0.0));
    assert!(fly_up(&nan, 1.0, 0.5, &limits).is_err() && fly_down(&nan, 0.0, &TouchDown::default(), &limits).is_err());
    let still = TouchDown { touch_mps: 0.0, ..TouchDown::default() };
    assert!(fly_down(&FlightState::resting_at(Point3::new(0.0, 0.0, 2.0)), 0.0, &still, &limits).is_err());
}
