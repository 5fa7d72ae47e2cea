//! Laws of zones on the ground: whatever it is told, the robot enters none that it must keep out of, and is slow where it has to be.
#![cfg(feature = "ground")]

mod support;

use nalgebra::{Isometry2, Point2, Vector2};
use planner::{LocalPolicy, LocalPolicyConfig, SpeedZone, Zone};
use proptest::prelude::*;
use support::base::{Pose, step};

const PERIOD_S: f64 = 0.02;
/// Half the sides of the default footprint.
const HALF_M: (f64, f64) = (0.35, 0.165);
/// Where the posts of a fence stand off the zone, and how far apart they are.
const FENCE_M: (f64, f64) = (0.05, 0.03);

fn outline(pose: Pose) -> Vec<Point2<f64>> {
    let world_from_body = Isometry2::new(Vector2::new(pose.0, pose.1), pose.2);
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
    corners.iter().map(|(x, y)| world_from_body * Point2::new(x * HALF_M.0, y * HALF_M.1)).collect()
}

/// A star round a place: bearings in order, so it never crosses itself.
fn star() -> impl Strategy<Value = Vec<Point2<f64>>> {
    let place = (0.9..2.5f64, -3.1..3.1f64);
    (place, prop::collection::vec(0.25..1.6f64, 3..9)).prop_map(|((range, bearing), radii)| {
        let middle = Point2::new(range * bearing.cos(), range * bearing.sin());
        let count = radii.len() as f64;
        let corner = |(k, radius): (usize, &f64)| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / count).sin_cos();
            middle + Vector2::new(cos, sin) * *radius
        };
        radii.iter().enumerate().map(corner).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    /// Sent from place to place with the zone in the way or as the goal, with limits of any kind, the outline stays out of it.
    #[test]
    fn no_zone_is_entered(
        corners in star(), goals in prop::collection::vec((-4.0..4.0f64, -4.0..4.0f64), 1..5),
        speed in 0.3..2.0f64, accel in 0.6..2.5f64, yaw in -3.1..3.1f64,
    ) {
        let zone = Zone::new(&corners).expect("a star");
        prop_assume!(!zone.overlaps(&outline((0.0, 0.0, yaw))));
        let fence: Vec<Point2<f32>> = zone.fence(FENCE_M.0, FENCE_M.1).iter().map(|post| post.cast()).collect();
        let config = LocalPolicyConfig { max_speed_mps: speed, max_accel_mps2: accel, ..LocalPolicyConfig::default() };
        let mut policy = LocalPolicy::new(config).unwrap();
        let (mut pose, mut velocity) = ((0.0, 0.0, yaw), (0.0, 0.0, 0.0));
        for (gx, gy) in goals {
            let path = [Point2::new(pose.0, pose.1), Point2::new(gx, gy)];
            for _ in 0..250 {
                let c = policy.command(pose, velocity, &path, None, &fence, &[]);
                pose = step(pose, &c, PERIOD_S);
                velocity = (c.vx, c.vy, c.yaw_rate);
                prop_assert!(!zone.overlaps(&outline(pose)), "entered at {pose:?}");
            }
        }
    }

    /// With any part of its circle in a speed zone the robot is not faster than the zone allows, having braked before; and it gets
    /// through.
    #[test]
    fn inside_a_speed_zone_it_is_slow(
        corners in star(), limit in 0.05..0.5f64, goals in prop::collection::vec((-4.0..4.0f64, -4.0..4.0f64), 1..4),
        speed in 0.3..2.0f64, accel in 0.6..2.5f64, yaw in -3.1..3.1f64,
    ) {
        let slow = SpeedZone::new(&corners, limit).expect("a star");
        let config = LocalPolicyConfig { max_speed_mps: speed, max_accel_mps2: accel, ..LocalPolicyConfig::default() };
        let mut policy = LocalPolicy::new(config).unwrap();
        policy.limit_speed(vec![slow.clone()]);
        let radius_m = HALF_M.0.hypot(HALF_M.1);
        let (mut pose, mut velocity) = ((0.0, 0.0, yaw), (0.0, 0.0, 0.0));
        for (gx, gy) in goals {
            let path = [Point2::new(pose.0, pose.1), Point2::new(gx, gy)];
            for _ in 0..300 {
                let before = Point2::new(pose.0, pose.1);
                let c = policy.command(pose, velocity, &path, None, &[], &[]);
                pose = step(pose, &c, PERIOD_S);
                velocity = (c.vx, c.vy, c.yaw_rate);
                let after = Point2::new(pose.0, pose.1);
                let near_m = slow.zone.distance_m(&before).min(slow.zone.distance_m(&after));
                let speed_mps = c.vx.hypot(c.vy);
                prop_assert!(near_m > radius_m || speed_mps <= limit + 1e-6, "{speed_mps} m/s, {near_m} m from the zone");
            }
        }
    }
}

/// Slow is not stopped: through a zone of two metres at 0.2 m/s, and fast again behind it.
#[test]
fn a_speed_zone_is_crossed_at_its_speed() {
    let corners = [[2.0, -1.0], [4.0, -1.0], [4.0, 1.0], [2.0, 1.0]].map(Point2::from);
    let mut policy = LocalPolicy::new(LocalPolicyConfig::default()).unwrap();
    policy.limit_speed(vec![SpeedZone::new(&corners, 0.2).unwrap()]);
    let path = [Point2::origin(), Point2::new(7.0, 0.0)];
    let (mut pose, mut velocity, mut steps) = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), [0, 0, 0]);
    while pose.0 < 6.8 {
        let c = policy.command(pose, velocity, &path, None, &[], &[]);
        pose = step(pose, &c, PERIOD_S);
        velocity = (c.vx, c.vy, c.yaw_rate);
        steps[usize::from(pose.0 > 1.6) + usize::from(pose.0 > 4.4)] += 1;
        assert!(steps.iter().sum::<i32>() < 2000, "it stands at {pose:?}");
    }
    let mean = |metres: f64, count: i32| metres / (f64::from(count) * PERIOD_S);
    assert!(mean(2.8, steps[1]) > 0.17, "{} m/s inside", mean(2.8, steps[1]));
    assert!(mean(1.6, steps[0]) > 0.35 && mean(2.4, steps[2]) > 0.35, "{steps:?}");
}
