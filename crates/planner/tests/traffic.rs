//! Laws of the local policy among people, and of stopping in time.
#![cfg(feature = "ground")]

mod support;

use nalgebra::{Point2, Vector2};
use planner::{GroundMover, LocalPolicy, LocalPolicyConfig, LocalStatus};
use proptest::prelude::*;
use support::base::{Pose, step};

const PERIOD_S: f64 = 0.02;
/// Half the sides of the default footprint.
const HALF_M: (f64, f64) = (0.35, 0.165);

/// Distance of a point from the rectangle of the robot, by the rectangle's own formula.
fn distance_m(pose: Pose, at: &Point2<f64>) -> f64 {
    let (sin, cos) = pose.2.sin_cos();
    let (dx, dy) = (at.x - pose.0, at.y - pose.1);
    let (x, y) = ((cos * dx + sin * dy).abs() - HALF_M.0, (cos * dy - sin * dx).abs() - HALF_M.1);
    x.max(0.0).hypot(y.max(0.0)) + x.max(y).min(0.0)
}

fn mover(at: Point2<f64>, velocity_mps: Vector2<f64>) -> GroundMover {
    GroundMover { position: at, velocity_mps, radius_m: 0.3, growth_mps: 0.2 }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]

    /// Walkers who go straight on and heed nobody: the robot never touches one unless it had been standing for half a second.
    #[test]
    fn nobody_is_touched_by_a_robot_that_moves(
        walkers in prop::collection::vec((2.0..5.0f64, -3.1..3.1f64, 0.0..1.5f64, -0.8..0.8f64), 1..6),
        goals in prop::collection::vec((-4.0..4.0f64, -4.0..4.0f64), 1..4),
        speed in 0.3..1.5f64, accel in 0.8..2.0f64, yaw in -3.1..3.1f64,
    ) {
        let config = LocalPolicyConfig { max_speed_mps: speed, max_accel_mps2: accel, ..LocalPolicyConfig::default() };
        let mut policy = LocalPolicy::new(config).unwrap();
        // They come from all round, more or less toward the middle.
        let mut people: Vec<GroundMover> = walkers
            .iter()
            .map(|(range, bearing, pace, off)| {
                let at = Point2::new(range * bearing.cos(), range * bearing.sin());
                let heading = bearing + std::f64::consts::PI + off;
                mover(at, Vector2::new(heading.cos(), heading.sin()) * *pace)
            })
            .collect();
        let (mut pose, mut velocity, mut still_s) = ((0.0, 0.0, yaw), (0.0, 0.0, 0.0), 1.0);
        for (gx, gy) in goals {
            let path = [Point2::new(pose.0, pose.1), Point2::new(gx, gy)];
            for _ in 0..200 {
                let c = policy.command(pose, velocity, &path, None, &[], &people);
                pose = step(pose, &c, PERIOD_S);
                velocity = (c.vx, c.vy, c.yaw_rate);
                people.iter_mut().for_each(|person| person.position += person.velocity_mps * PERIOD_S);
                still_s = if velocity == (0.0, 0.0, 0.0) { still_s + PERIOD_S } else { 0.0 };
                for person in &people {
                    let apart_m = distance_m(pose, &person.position) - person.radius_m;
                    prop_assert!(apart_m > 0.0 || still_s >= 0.5 - 1e-9, "{apart_m} m after {still_s} s at rest");
                }
            }
        }
    }

    /// One who crosses the way is let pass, however closely, by a robot that stands; and the goal is reached after.
    #[test]
    fn who_crosses_the_way_is_let_pass(pace in 0.4..1.4f64, ahead in 1.0..2.5f64, from_left: bool) {
        let mut policy = LocalPolicy::new(LocalPolicyConfig::default()).unwrap();
        let side = if from_left { 1.0 } else { -1.0 };
        let mut person = mover(Point2::new(ahead, side * 2.5), Vector2::new(0.0, -side * pace));
        let path = [Point2::origin(), Point2::new(4.0, 0.0)];
        let (mut pose, mut velocity, mut still_s) = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0);
        for _ in 0..1500 {
            let c = policy.command(pose, velocity, &path, None, &[], &[person]);
            pose = step(pose, &c, PERIOD_S);
            velocity = (c.vx, c.vy, c.yaw_rate);
            person.position += person.velocity_mps * PERIOD_S;
            still_s = if velocity == (0.0, 0.0, 0.0) { still_s + PERIOD_S } else { 0.0 };
            prop_assert!(distance_m(pose, &person.position) > person.radius_m || still_s >= 0.5);
            if c.status == LocalStatus::Arrived {
                return Ok(());
            }
        }
        prop_assert!(false, "it stands at {pose:?}");
    }
}

/// Somebody who stands beside the robot does not nail it down, and numbers that are none are nobody.
#[test]
fn one_may_leave_somebody_who_stands() {
    let mut policy = LocalPolicy::new(LocalPolicyConfig::default()).unwrap();
    let beside = mover(Point2::new(0.0, 0.165 + 0.32), Vector2::zeros());
    let nobody = mover(Point2::new(f64::NAN, 0.0), Vector2::new(f64::INFINITY, 0.0));
    let path = [Point2::origin(), Point2::new(3.0, 0.0)];
    let (mut pose, mut velocity) = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0));
    for _ in 0..600 {
        let c = policy.command(pose, velocity, &path, None, &[], &[beside, nobody]);
        pose = step(pose, &c, PERIOD_S);
        velocity = (c.vx, c.vy, c.yaw_rate);
        assert!(distance_m(pose, &beside.position) >= beside.radius_m);
    }
    assert!((pose.0 - 3.0).abs() < 0.2, "{pose:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// At full speed toward a wall that comes into sight when it can just be stopped before it: it is, in no more than the braking
    /// distance, whatever the limits.
    #[test]
    fn it_stops_within_its_braking_distance(
        speed in 0.1..2.0f64, accel in 0.4..3.0f64, spare in 0.0..0.3f64, wall_yaw in -0.5..0.5f64, lateral in -0.3..0.3f64,
    ) {
        let config = LocalPolicyConfig {
            max_speed_mps: speed, max_accel_mps2: accel, max_lateral_speed_mps: 0.3, ..LocalPolicyConfig::default()
        };
        let margin_m = config.margin_m;
        let mut policy = LocalPolicy::new(config).unwrap();
        let along = (speed * speed + lateral * lateral).sqrt();
        // One period passes before the brake bites, and the footprint is tested every 4 cm of motion.
        let braking_m = 0.5 * along * along / accel + 2.0 * along * PERIOD_S;
        let normal = Vector2::new(wall_yaw.cos(), wall_yaw.sin());
        let corner = HALF_M.0 * normal.x.abs() + HALF_M.1 * normal.y.abs();
        let wall_m = corner + margin_m + braking_m + spare;
        let foot = Point2::from(normal * wall_m);
        let tangent = Vector2::new(-normal.y, normal.x);
        let wall: Vec<Point2<f32>> =
            (-40..=40).map(|k| (foot + tangent * (0.05 * f64::from(k))).cast()).collect();
        let path = [Point2::origin(), Point2::from(normal * (wall_m + 2.0))];
        let (mut pose, mut velocity) = ((0.0, 0.0, 0.0), (speed, lateral, 0.0));
        // It learns of the wall while it is that fast.
        for _ in 0..((along / accel / PERIOD_S) as usize + 3) {
            let c = policy.command(pose, velocity, &path, None, &wall, &[]);
            pose = step(pose, &c, PERIOD_S);
            velocity = (c.vx, c.vy, c.yaw_rate);
            for point in &wall {
                prop_assert!(distance_m(pose, &point.cast()) > 0.0, "touched at {pose:?} with {velocity:?}");
            }
        }
    }
}
