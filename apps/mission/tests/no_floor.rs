//! A robot drives nowhere where no floor was seen, whatever its path says: neither into a hole nor onto what gave no answer.

use mission::navigation::NavigationMap;
use mission::planner::{LocalPolicy, LocalPolicyConfig};
use mission::robot_model::RobotModel;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use volumetric_map::{Volume, VolumeConfig};

/// Where the floor ends.
const EDGE_M: f64 = 1.5;

/// What lies beyond the edge.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Beyond {
    /// A floor 1.5 m lower.
    Hole,
    /// Nothing that sends a ray back.
    Nothing,
    /// More floor.
    Floor,
}

/// Rays from an eye 0.45 m over the floor, ten scans, each turned a little.
fn map(beyond: Beyond) -> Volume {
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let eye = Point3::new(0.0, 0.0, 0.45);
    for scan in 0..10 {
        let mut points = Vec::new();
        for k in 0..900 {
            let azimuth = (f64::from(k) + 0.1 * f64::from(scan)) / 900.0 * std::f64::consts::TAU;
            for ring in 0..60 {
                let down = (f64::from(ring) + 0.1 * f64::from(scan)) * 0.02 + 0.06;
                let toward = Vector3::new(azimuth.cos() * down.cos(), azimuth.sin() * down.cos(), -down.sin());
                let floor = eye + toward * (eye.z / -toward.z);
                let at = match beyond {
                    _ if floor.x <= EDGE_M => floor,
                    Beyond::Floor => floor,
                    Beyond::Hole => eye + toward * ((eye.z + 1.5) / -toward.z),
                    Beyond::Nothing => continue,
                };
                if (at - eye).norm() < 6.0 {
                    points.push(at.cast::<f32>());
                }
            }
        }
        volume.integrate(&eye, &points).unwrap();
    }
    volume
}

/// How far the nose gets in twenty seconds on a path that leads straight over the edge.
fn farthest_nose(beyond: Beyond) -> f64 {
    let robot = RobotModel::builtin_quadruped();
    let nose_m = robot.footprint.iter().map(|p| p.x).fold(0.0, f64::max);
    let mut navigation = NavigationMap::new(&robot);
    let volume = map(beyond);
    let config = LocalPolicyConfig {
        footprint: robot.footprint.clone(),
        max_speed_mps: robot.limits.max_speed_mps,
        ..LocalPolicyConfig::default()
    };
    let period_s = config.period_s;
    let mut policy = LocalPolicy::new(config).unwrap();
    let path = [Point2::new(0.0, 0.0), Point2::new(4.0, 0.0)];
    let (mut x, mut y, mut yaw, mut velocity) = (0.0, 0.0, 0.0_f64, (0.0, 0.0, 0.0));
    let mut farthest = 0.0_f64;
    for step in 0..(20.0 / period_s) as usize {
        if step % 25 == 0 {
            let pose = Isometry3::new(Vector3::new(x, y, robot.stance_height_m), Vector3::z() * yaw);
            navigation.refresh(&volume, &robot, &pose, 0.0, 0.0, 0.0);
        }
        let barred = navigation.barred_near(&Point2::new(x, y), 1.2);
        let command = policy.command((x, y, yaw), velocity, &path, None, &barred, &[]);
        velocity = (command.vx, command.vy, command.yaw_rate);
        let (sin, cos) = yaw.sin_cos();
        x += (cos * command.vx - sin * command.vy) * period_s;
        y += (sin * command.vx + cos * command.vy) * period_s;
        yaw += command.yaw_rate * period_s;
        for corner in &robot.footprint {
            farthest = farthest.max(x + corner.x * yaw.cos() - corner.y * yaw.sin());
        }
    }
    assert!(farthest > nose_m + 0.3, "{beyond:?}: it did not even set out");
    farthest
}

#[test]
fn the_nose_stays_over_floor_that_was_seen() {
    assert!(farthest_nose(Beyond::Floor) > 3.0, "where there is floor it goes on");
    for beyond in [Beyond::Hole, Beyond::Nothing] {
        let farthest = farthest_nose(beyond);
        assert!(farthest < EDGE_M, "{beyond:?}: the nose was at {farthest} m, the floor ends at {EDGE_M} m");
    }
}
