//! Laws of the aerial planner and a flight of a small rigid body.
#![cfg(feature = "air")]
mod support;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use planner::*;
use proptest::prelude::*;
use support::{SplitMix, Voxels, flat_3d};

/// Every sampled point of a plan is inside its polytope, within the limits, and away from every voxel.
fn check_plan(voxels: &Voxels, plan: &AirPlan, config: &AirConfig, start: &FlightState) {
    assert!(plan.proof.holds);
    let mut t0 = 0.0;
    for (k, piece) in plan.trajectory.pieces.iter().enumerate() {
        let polytope = &plan.corridor[plan.polytope_of[k]];
        for j in 0..=40 {
            let s = piece.sample(piece.duration_s * f64::from(j) / 40.0);
            assert!(polytope.slack(&s.p.coords) >= -1e-8, "piece {k} leaves by {}", polytope.slack(&s.p.coords));
            assert!(
                s.v.norm() <= config.limits.max_speed_mps + 1e-8 && s.a.norm() <= config.limits.max_accel_mps2 + 1e-8
            );
            assert!(s.v.norm() <= plan.proof.max_speed_mps + 1e-8 && s.a.norm() <= plan.proof.max_accel_mps2 + 1e-8);
            let near = config.clearance_m() + config.obstacle_radius_m + 0.2;
            let reach = Vector3::repeat(near);
            for o in voxels.obstacles(&(s.p - reach), &(s.p + reach)) {
                let kept = (o - s.p).norm() - config.obstacle_radius_m;
                assert!(kept >= plan.clearance_m - 1e-6, "{kept} m at {t0} s");
            }
            assert!(voxels.distance(&s.p).is_some(), "in unknown space");
        }
        t0 += piece.duration_s;
    }
    let first = plan.trajectory.sample(0.0);
    assert!(
        (first.p - start.p).norm() < 1e-9 && (first.v - start.v).norm() < 1e-9 && (first.a - start.a).norm() < 1e-9
    );
    let end = plan.trajectory.sample(plan.trajectory.duration() - 1e-12);
    assert!(end.v.norm() < 1e-6 && end.a.norm() < 1e-6);
    for pair in plan.trajectory.pieces.windows(2) {
        let (a, b) = (pair[0].sample(pair[0].duration_s), pair[1].sample(0.0));
        assert!((a.p - b.p).norm() < 1e-7 && (a.v - b.v).norm() < 1e-7 && (a.a - b.a).norm() < 1e-6);
    }
    for pair in plan.corridor.windows(2).zip(&plan.route[1..]) {
        assert!(
            pair.0[0].slack(&pair.1.coords) >= -1e-9 && pair.0[1].slack(&pair.1.coords) >= -1e-9,
            "polytopes overlap"
        );
    }
}

fn plan(voxels: &Voxels, start: &FlightState, goal: &Point3<f64>, config: &AirConfig) -> Result<AirPlan, AirPlanError> {
    let space = AirSpace { distance: &|p| voxels.distance(p), obstacles: &|a, b| voxels.obstacles(a, b), movers: &[] };
    plan_air(start, goal, &space, config)
}

#[test]
fn flats_are_crossed_with_a_certificate() {
    let config = AirConfig::default();
    let mut flown = 0;
    for seed in 1..6 {
        let voxels = flat_3d(1.1, seed);
        let start = FlightState::resting_at(Point3::new(1.5, 1.5, 1.3));
        match plan(&voxels, &start, &Point3::new(15.3, 8.4, 1.4), &config) {
            Ok(plan) => {
                check_plan(&voxels, &plan, &config, &start);
                let straight = (plan.route[plan.route.len() - 1] - start.p).norm();
                let length: f64 = plan.route.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
                println!(
                    "seed {seed}: route {length:.1} m, {:.1} s, {} pieces",
                    plan.trajectory.duration(),
                    plan.trajectory.pieces.len()
                );
                assert!(
                    length >= straight - 1e-9 && plan.trajectory.duration() < 5.0 + length / 0.5,
                    "{} s for {length} m",
                    plan.trajectory.duration()
                );
                flown += 1;
            }
            Err(e) => assert_eq!(e, AirPlanError::NoRoute),
        }
    }
    assert!(flown >= 3);
}

/// Two rooms and a wall with a door, at every offset of the door against the voxels: 1.0 m leaves 8 or 9 free voxels.
#[test]
fn a_door_of_a_metre_is_passed_at_any_offset() {
    let config = AirConfig { radius_m: 0.374, margin_m: 0.02, ..AirConfig::default() };
    for free in [8.0, 9.0, 10.0] {
        for offset in 0..3 {
            let y = 1.5 + 0.1 * f64::from(offset);
            let mut voxels = Voxels::new(
                [5.0, 4.0, 2.7],
                &[
                    [0.0, 0.0, 0.0, 5.0, 4.0, 0.1],
                    [0.0, 0.0, 2.6, 5.0, 4.0, 2.7],
                    [2.5, 0.0, 0.0, 2.6, 4.0, 2.7],
                    [0.0, 0.0, 0.0, 5.0, 0.1, 2.7],
                    [0.0, 3.9, 0.0, 5.0, 4.0, 2.7],
                    [0.0, 0.0, 0.0, 0.1, 4.0, 2.7],
                    [4.9, 0.0, 0.0, 5.0, 4.0, 2.7],
                ],
            );
            voxels.carve(&[2.4, y, 0.1, 2.7, y + 0.1 * free, 2.15]);
            voxels.measure();
            let start = FlightState::resting_at(Point3::new(1.0, 2.7, 1.2));
            let plan = plan(&voxels, &start, &Point3::new(4.2, 1.0, 1.2), &config);
            let Ok(plan) = plan else { panic!("{free} voxels at {y}: {:?}", plan.err()) };
            check_plan(&voxels, &plan, &config, &start);
            println!(
                "{free} voxels at {y:.1}: {:.1} s, {} pieces",
                plan.trajectory.duration(),
                plan.trajectory.pieces.len()
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// With room to brake, no start within the limits is refused, wherever the goal lies: in the limit it stops and turns.
    #[test]
    fn a_moving_start_with_room_to_brake_is_never_refused(
        v in proptest::array::uniform3(-1.0..1.0f64), a in proptest::array::uniform3(-1.0..1.0f64), goal in proptest::array::uniform3(0.6..2.4f64),
    ) {
        let mut voxels = Voxels::new([8.0, 8.0, 3.0], &[]);
        voxels.measure();
        let config = AirConfig { radius_m: 0.25, ..AirConfig::default() };
        let (v, a) = (Vector3::from(v), Vector3::from(a));
        let start = FlightState {
            p: Point3::new(4.0, 4.0, 1.5),
            v: 1.4 * v.component_mul(&Vector3::new(1.0, 1.0, 0.2)) / v.norm().max(1.0),
            a: 1.5 * a.component_mul(&Vector3::new(1.0, 1.0, 0.2)) / a.norm().max(1.0),
        };
        let goal = Point3::new(goal[0] * 3.0, goal[1] * 3.0, goal[2]);
        let plan = plan(&voxels, &start, &goal, &config).map_err(|e| TestCaseError::fail(e.to_string()))?;
        check_plan(&voxels, &plan, &config, &start);
    }

    /// Random boxes, starts in motion, unknown regions: an answer is certified or an error.
    #[test]
    fn plans_are_certified_or_refused(
        seed in any::<u64>(), boxes in 0usize..14, speed in 0.0..1.2f64, heading in -3.1..3.1f64, unknown in any::<bool>(),
    ) {
        let mut random = SplitMix(seed);
        let mut solid = Vec::new();
        for _ in 0..boxes {
            let (x, y, z) = (6.0 * random.unit(), 6.0 * random.unit(), 3.0 * random.unit());
            solid.push([x, y, z, x + 0.1 + random.unit(), y + 0.1 + random.unit(), z + 0.1 + 1.5 * random.unit()]);
        }
        let mut voxels = Voxels::new([6.5, 6.5, 3.0], &solid);
        voxels.fill(&[2.3, 2.3, 0.9, 3.7, 3.7, 2.3], false);
        if unknown {
            for k in 0..voxels.unknown.len() {
                voxels.unknown[k] = voxels.center(k).x > 4.6;
            }
        }
        voxels.measure();
        let config = AirConfig { radius_m: 0.25, ..AirConfig::default() };
        let start = FlightState { p: Point3::new(3.0, 3.0, 1.6), v: Vector3::new(heading.cos(), heading.sin(), 0.1) * speed, a: Vector3::zeros() };
        let goal = Point3::new(6.5 * random.unit(), 6.5 * random.unit(), 3.0 * random.unit());
        if let Ok(plan) = plan(&voxels, &start, &goal, &config) {
            check_plan(&voxels, &plan, &config, &start);
            prop_assert!((plan.trajectory.sample(1e9).p - goal).norm() <= plan.goal_pull_m + 1e-6);
        }
    }

    /// The proof is sound: dense samples never exceed the proved bounds.
    #[test]
    fn bounds_hold_everywhere(points in proptest::collection::vec(proptest::array::uniform3(-3.0..3.0f64), 2..7), times in proptest::collection::vec(0.2..3.0f64, 6)) {
        let points: Vec<Vector3<f64>> = points.into_iter().map(Vector3::from).collect();
        let zero = Vector3::zeros();
        let n = points.len() - 1;
        let spline = Minco::<3>::solve(&[points[0], zero, zero], &[points[n], zero, zero], &points[1..n], &times[..n]).unwrap();
        let trajectory = PolynomialTrajectory::from_minco(&spline);
        let corridor = [Polytope::from_box(&Point3::new(-3.5, -3.5, -3.5), &Point3::new(3.5, 3.5, 3.5))];
        let limits = FlightLimits { max_speed_mps: 4.0, max_accel_mps2: 9.0, ..AirConfig::default().limits };
        let c = prove(&trajectory, &corridor, &vec![0; n], &limits);
        let (mut speed, mut accel, mut slack) = (0.0f64, 0.0f64, f64::INFINITY);
        for k in 0..=2000 {
            let s = trajectory.sample(trajectory.duration() * f64::from(k) / 2000.0);
            speed = speed.max(s.v.norm());
            accel = accel.max(s.a.norm());
            slack = slack.min(corridor[0].slack(&s.p.coords));
        }
        prop_assert!(speed <= c.max_speed_mps + 1e-9 && accel <= c.max_accel_mps2 + 1e-9 && slack >= c.corridor_slack_m - 1e-9);
        prop_assert_eq!(c.holds && (speed > 4.0 + 1e-6 || accel > 9.0 + 1e-6 || slack < -1e-6), false);
    }
}

#[test]
fn refusals_are_typed() {
    let voxels = flat_3d(1.1, 1);
    let config = AirConfig::default();
    let start = FlightState::resting_at(Point3::new(1.5, 1.5, 1.3));
    let goal = Point3::new(2.5, 2.0, 1.3);
    assert_eq!(plan(&voxels, &start, &Point3::new(f64::NAN, 0.0, 0.0), &config).err(), Some(AirPlanError::NotFinite));
    assert_eq!(plan(&voxels, &start, &Point3::new(8e5, 0.0, 0.0), &config).err(), Some(AirPlanError::TooFar));
    let fast = FlightState { v: Vector3::new(9.0, 0.0, 0.0), ..start };
    assert!(matches!(plan(&voxels, &fast, &goal, &config), Err(AirPlanError::StartTooFast { .. })));
    let outside = FlightState::resting_at(Point3::new(1.5, 1.5, 5.0));
    assert_eq!(plan(&voxels, &outside, &goal, &config).err(), Some(AirPlanError::StartBlocked));
    assert_eq!(plan(&voxels, &start, &Point3::new(1.5, 1.5, 9.0), &config).err(), Some(AirPlanError::GoalBlocked));
    let bad = AirConfig { radius_m: 0.0, ..config.clone() };
    assert!(matches!(plan(&voxels, &start, &goal, &bad), Err(AirPlanError::Config(_))));
    let little = AirConfig { max_expansions: 3, ..config.clone() };
    assert!(matches!(
        plan(&voxels, &start, &Point3::new(15.3, 8.4, 1.4), &little),
        Err(AirPlanError::SearchLimit { .. })
    ));
    // A start nearer to the floor than allowed takes off and never comes nearer.
    let low = FlightState::resting_at(Point3::new(2.5, 2.0, 0.45));
    if let Ok(plan) = plan(&voxels, &low, &goal, &config) {
        assert!(plan.clearance_m < config.clearance_m());
        check_plan(&voxels, &plan, &config, &low);
    }
}

/// A quadrotor of x500 size: first-order rotor lag, linear drag, rotors of the notes.
struct Quadrotor {
    state: BodyState,
    speeds: [f64; 4],
}

const MASS: f64 = 2.0643;
const K: f64 = 8.54858e-6;
const RATIO: f64 = 0.016;
const DIRECTIONS: [f64; 4] = [1.0, 1.0, -1.0, -1.0];

fn rotor_positions() -> [Vector3<f64>; 4] {
    [[0.174, -0.174], [-0.174, 0.174], [0.174, 0.174], [-0.174, -0.174]].map(|p| Vector3::new(p[0], p[1], 0.06))
}

fn inertia() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(0.0217, 0.0217, 0.04))
}

impl Quadrotor {
    fn step(&mut self, wanted: &[f64], dt: f64) {
        let (mut force, mut torque) = (0.0, Vector3::zeros());
        for k in 0..4 {
            let lag = if wanted[k] > self.speeds[k] { 0.0125 } else { 0.025 };
            self.speeds[k] += (wanted[k] - self.speeds[k]) * (dt / lag).min(1.0);
            let f = K * self.speeds[k] * self.speeds[k];
            force += f;
            torque += rotor_positions()[k].cross(&(Vector3::z() * f)) + Vector3::z() * (-DIRECTIONS[k] * RATIO * f);
        }
        let s = &mut self.state;
        let w = s.angular_velocity_in_body_radps;
        let drag = s.world_from_body
            * Vector3::new(0.3, 0.3, 0.2).component_mul(&s.world_from_body.inverse_transform_vector(&s.v));
        let a = (s.world_from_body * Vector3::z() * force - drag) / MASS - Vector3::z() * 9.81;
        let alpha = inertia().try_inverse().unwrap() * (torque - w.cross(&(inertia() * w)));
        s.p += s.v * dt + a * (0.5 * dt * dt);
        s.v += a * dt;
        s.angular_velocity_in_body_radps += alpha * dt;
        s.world_from_body *= UnitQuaternion::from_scaled_axis(s.angular_velocity_in_body_radps * dt);
    }
}

/// RMSE and largest error of following `reference(t)` for `seconds`, control at 250 Hz, the first 3 s not counted.
fn fly(reference: impl Fn(f64) -> (TrajectoryPoint, f64), seconds: f64, drag: f64) -> (f64, f64) {
    let mut controller = GeometricController::new(MASS, inertia());
    controller.drag_n_s_per_m = Vector3::new(drag, drag, drag);
    let mixer = RotorMixer::new(&rotor_positions(), &DIRECTIONS, &[K; 4], &[RATIO; 4], &[1000.0; 4]).unwrap();
    let first = reference(0.0);
    let mut quad = Quadrotor {
        state: BodyState {
            p: first.0.p,
            v: Vector3::zeros(),
            world_from_body: UnitQuaternion::from_euler_angles(0.0, 0.0, first.1),
            angular_velocity_in_body_radps: Vector3::zeros(),
        },
        speeds: [(MASS * 9.81 / 4.0 / K).sqrt(); 4],
    };
    let (mut sum, mut count, mut most) = (0.0, 0, 0.0f64);
    for k in 0..(seconds * 1000.0) as usize {
        let t = k as f64 * 1e-3;
        let (point, yaw) = reference(t);
        if k % 4 == 0 || k == 0 {
            let speeds = mixer.speeds(&controller.command(&quad.state, &point, yaw));
            for _ in 0..4 {
                quad.step(&speeds, 1e-3);
            }
            let (at, _) = reference(t + 4e-3);
            let error = (quad.state.p - at.p).norm();
            if t > 3.0 {
                sum += error * error;
                count += 1;
                most = most.max(error);
            }
        }
    }
    ((sum / f64::from(count)).sqrt(), most)
}

#[test]
fn circle_of_two_metres_is_tracked() {
    let rate = 1.6 / 2.0;
    let circle = |t: f64| {
        let (s, c) = (rate * t).sin_cos();
        let point = TrajectoryPoint {
            p: Point3::new(2.0 * c, 2.0 * s, 1.5),
            v: Vector3::new(-s, c, 0.0) * (2.0 * rate),
            a: Vector3::new(-c, -s, 0.0) * (2.0 * rate * rate),
            jerk: Vector3::new(s, -c, 0.0) * (2.0 * rate * rate * rate),
        };
        (point, (rate * t + std::f64::consts::FRAC_PI_2).rem_euclid(std::f64::consts::TAU))
    };
    let (known, known_most) = fly(circle, 15.0, 0.3);
    let (unknown, unknown_most) = fly(circle, 15.0, 0.0);
    println!(
        "2 m circle at 1.6 m/s: RMSE {known:.4} m (max {known_most:.4}) with drag known, {unknown:.4} m (max {unknown_most:.4}) with drag unknown"
    );
    assert!(known < 0.03 && unknown < 0.08);
}

#[test]
fn a_planned_flight_is_tracked() {
    let voxels = flat_3d(1.1, 2);
    let config = AirConfig::default();
    let plan =
        plan(&voxels, &FlightState::resting_at(Point3::new(1.5, 1.5, 1.3)), &Point3::new(6.5, 2.0, 1.3), &config);
    let Ok(plan) = plan else { panic!("{:?}", plan.err()) };
    let duration = plan.trajectory.duration();
    let (rmse, most) = fly(|t| (plan.trajectory.sample(t), 0.3), duration.max(4.0), 0.3);
    println!("flight of {duration:.1} s: RMSE {rmse:.4} m, max {most:.4} m");
    assert!(most < 0.05);
}
