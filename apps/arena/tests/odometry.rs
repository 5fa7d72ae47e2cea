//! The robot knows where it is from its sensors alone: whole short runs against the truth.

mod support;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arena::buildings::Buildings;
use arena::mission::robot_model::{RobotKind, RobotModel};
use arena::orders::Orders;
use arena::run::{RunConfig, RunResult, Setup, run};
use arena::scenario::draw_scenario;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use support::{scene, short_run};

/// Largest distance and turn between where the robot believed to be and where it was.
fn errors(result: &RunResult) -> (f64, f64) {
    let (mut worst_m, mut worst_rad) = (0.0_f64, 0.0_f64);
    let journal = result.journal();
    assert!(journal.curves.len() > 20, "the robot kept a diary");
    for sample in &journal.curves {
        let [x, y, z, yaw_rad] = sample.pose;
        let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
        let believed = result.truth.truth_from_map * Isometry3::from_parts(Vector3::new(x, y, z).into(), heading);
        // Both logs are kept at full tenths of a second of the same clock.
        let stamp_ns = (sample.t_s * 1e9).round() as i64;
        let Some((_, truth)) = result.truth.poses.iter().find(|(at_ns, _)| (at_ns - stamp_ns).abs() < 10_000_000)
        else {
            continue;
        };
        worst_m = worst_m.max((believed.translation.vector - truth.translation.vector).norm());
        let (_, _, true_yaw_rad) = truth.rotation.euler_angles();
        let (_, _, yaw_rad) = believed.rotation.euler_angles();
        worst_rad = worst_rad.max(arena::mission::goal::wrap(yaw_rad - true_yaw_rad).abs());
    }
    (worst_m, worst_rad)
}

fn check(kind: RobotKind, name: &str, max_time_s: f64) {
    let config = RunConfig { max_time_s, ..RunConfig::default() };
    let result = short_run(&config, kind, &scene(name), "find the mug near the sink", 3);
    assert!(result.summary.path_m > 1.0, "the robot moved {} m", result.summary.path_m);
    let (worst_m, worst_rad) = errors(&result);
    assert!(worst_m > 1e-6, "an estimate without any error is no estimate");
    assert!(worst_m < 0.03, "{worst_m} m");
    assert!(worst_rad.to_degrees() < 0.5, "{} degrees", worst_rad.to_degrees());
}

#[test]
fn a_walking_robot_knows_where_it_is_to_centimetres() {
    check(RobotKind::Ground, "flat", 12.0);
}

#[test]
fn a_flying_robot_knows_where_it_is_to_centimetres() {
    check(RobotKind::Aerial, "office", 12.0);
}

/// A start in a closet, where a scan meets two dozen cells of the map: the robot once took off without knowing where it was.
#[test]
fn a_flying_robot_starts_in_a_closet() {
    let robot = RobotModel::builtin_quadrotor();
    let config = RunConfig { max_time_s: 7.0, ..RunConfig::default() };
    let drawn = draw_scenario(2, 19, &robot, config.mission.flight_height_m, &Buildings::default())
        .expect("it was drawn before");
    let stop = Arc::new(AtomicBool::new(false));
    let (scene, task, start, seed) = (&drawn.scene, &drawn.task, &drawn.start, drawn.seed);
    let setup = Setup {
        config: &config,
        robot: &robot,
        scene,
        task,
        start,
        known: None,
        seed,
        vehicle: None,
        orders: Orders::default(),
    };
    let result = run(setup, &stop, &mut |_| {}).expect("it runs");
    assert_eq!(result.summary.collisions, 0, "{}", result.summary.reason);
    let height_m = result.truth.poses.last().expect("poses").1.translation.vector.z - drawn.start.translation.vector.z;
    assert!(height_m > 0.5, "it flies: {height_m} m");
    // Two dozen cells hold it less well than a room does.
    assert!(errors(&result).0 < 0.08, "{:?}", errors(&result));
}
