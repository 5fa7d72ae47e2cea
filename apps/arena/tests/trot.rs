//! Twelve motors carry a robot that could fall: the gait of the missions, with forces.

use arena::mission::robot_model::{RobotModel, quadruped_texts};
use arena::trot::{TrotConfig, TrotReport, trot};

fn walked(config: &TrotConfig) -> TrotReport {
    let report = trot(&RobotModel::builtin_quadruped(), config).expect("a robot with legs");
    eprintln!("{report:?}");
    report
}

#[test]
fn it_trots_five_metres_and_does_not_fall() {
    let report = walked(&TrotConfig::default());
    assert!(!report.has_fallen && report.distance_m >= 5.0, "{report:?}");
    assert!(report.beside_m < 0.3 && report.worst_tilt_rad < 0.3, "{report:?}");
}

#[test]
fn motors_that_are_too_weak_let_it_fall() {
    let (urdf, toml) = quadruped_texts();
    let weak = urdf.replace("effort=\"23.7\"", "effort=\"3\"").replace("effort=\"45.43\"", "effort=\"3\"");
    assert_ne!(weak, urdf);
    let weak = RobotModel::parse(&weak, toml, &|_| None).expect("a sound robot");
    let report = trot(&weak, &TrotConfig { max_time_s: 5.0, ..TrotConfig::default() }).expect("a robot with legs");
    assert!(report.has_fallen && report.distance_m < 5.0, "{report:?}");
}

/// The same numbers again, and a way that is a circle.
#[test]
fn it_turns_as_commanded() {
    let config = TrotConfig { yaw_rate_radps: 0.5, distance_m: 1.2, ..TrotConfig::default() };
    let report = walked(&config);
    assert!(!report.has_fallen, "{report:?}");
    assert!((report.turned_rad - 0.5 * report.seconds).abs() < 0.4, "{report:?}");
    assert_eq!(walked(&config), report);
}
