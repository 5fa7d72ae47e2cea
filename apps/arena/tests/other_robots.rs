//! A change of robot without a change of code: what fits through a door is decided by the URDF.

mod support;

use std::path::{Path, PathBuf};

use arena::cli::load_robot;
use arena::mission::robot_model::{RobotKind, RobotModel};
use nalgebra::{Isometry3, Point2, Translation3, UnitQuaternion, Vector3};
use support::{coarse, run_from, scene};

/// The official file of a robot, if the data is here.
fn official(file: &str) -> Option<RobotModel> {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/urdf/unitree_ros").join(file);
    if !path.is_file() {
        eprintln!("skipped: {} is not here", path.display());
        return None;
    }
    Some(load_robot(Some(&path), RobotKind::Ground).expect("the official file is sound"))
}

/// In the study, facing the door of 0.7 m; the living room is behind it.
fn before_the_door(robot: &RobotModel) -> Isometry3<f64> {
    let scene = scene("narrow-door");
    let door = scene.building.doors[0].center;
    let at = Point2::new(door.x - 1.6, door.y);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.0);
    Isometry3::from_parts(Translation3::new(at.x, at.y, robot.stance_height_m), turn)
}

#[test]
fn the_narrow_door_is_refused_to_a_large_robot() {
    let Some(b2) = official("b2_description/urdf/b2_description.urdf") else { return };
    let narrow = scene("narrow-door");
    let door = &narrow.building.doors[0];
    assert!((door.width_m - 0.7).abs() < 0.02);
    let large = run_from(&coarse(90.0), &b2, &narrow, "go to the living room", &before_the_door(&b2), 1);
    assert!(!large.summary.success && large.summary.collisions == 0, "{}", large.summary.reason);
    // It never was in the door.
    assert!(large.truth.poses.iter().all(|(_, pose)| pose.translation.vector.x < door.center.x - 0.3));
}

#[test]
fn the_narrow_door_is_taken_by_a_small_one() {
    let Some(a1) = official("a1_description/urdf/a1.urdf") else { return };
    let narrow = scene("narrow-door");
    // Too long to turn in the door: it passes lengthwise, in that direction and no other.
    assert!(2.0 * a1.circumscribed_radius_m > narrow.building.doors[0].width_m);
    let small = run_from(&coarse(90.0), &a1, &narrow, "go to the living room", &before_the_door(&a1), 1);
    assert!(small.summary.success && small.summary.collisions == 0, "{}", small.summary.reason);
}
