//! A robot that does not know where it is: it does not leave the floor, and comes back to it.

use mission::config::MissionConfig;
use mission::mission::{Mission, Outcome};
use mission::octant_prompt::SymbolicReasoner;
use mission::odometer::OdometrySource;
use mission::omni_perception::{Equirectangular, OdometryEstimate, Stamp, TrackingStatus};
use mission::reasoning::Mind;
use mission::robot_model::RobotModel;
use mission::stream::{Command, SensorEvent};
use nalgebra::Isometry3;

struct Flight {
    mission: Mission,
    start: Isometry3<f64>,
    ms: i64,
}

impl Flight {
    fn new() -> Flight {
        let robot = RobotModel::builtin_quadrotor();
        let start = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
        let config = MissionConfig { odometry: OdometrySource::Stream, ..MissionConfig::default() };
        let mind = Mind::Embedded(Box::new(SymbolicReasoner::default()));
        let camera = Equirectangular::default();
        let mission = Mission::new(&robot, "find the mug", config, camera, mind, Stamp(0), &start).expect("sound");
        Flight { mission, start, ms: 0 }
    }

    /// Some time with odometry of this status; the highest place that was asked for, above the start.
    fn go_on(&mut self, ms: i64, status: TrackingStatus) -> f64 {
        let mut highest_m = 0.0_f64;
        for _ in 0..ms / 20 {
            self.ms += 20;
            let stamp = Stamp(self.ms * 1_000_000);
            let estimate = OdometryEstimate { status, ..OdometryEstimate::at_rest(stamp, self.start) };
            self.mission.perceive([SensorEvent::Odometry(estimate)]);
            if let Command::Flight(target) = self.mission.cycle(stamp) {
                highest_m = highest_m.max(target.position_in_world.z - self.start.translation.vector.z);
            }
        }
        highest_m
    }
}

#[test]
fn nobody_takes_off_without_a_pose() {
    let mut flight = Flight::new();
    flight.go_on(1500, TrackingStatus::Tracking);
    assert!(flight.go_on(4000, TrackingStatus::Lost) < 0.01, "it stays on the floor");
    assert!(flight.mission.activity().contains("lost its way"), "{}", flight.mission.activity());
    assert!(flight.mission.outcome.is_none(), "the pose may come back");
    assert!(flight.go_on(2000, TrackingStatus::Tracking) > 0.2, "and then it takes off");
}

#[test]
fn who_loses_the_pose_on_the_way_up_comes_down() {
    let mut flight = Flight::new();
    let highest_m = flight.go_on(3000, TrackingStatus::Tracking);
    assert!((0.1..1.0).contains(&highest_m), "on its way up: {highest_m} m");
    flight.go_on(20, TrackingStatus::Lost);
    match &flight.mission.outcome {
        Some(Outcome::GaveUp { reason }) => assert!(reason.contains("take-off"), "{reason}"),
        other => panic!("{other:?}"),
    }
    // It climbs at half a metre a second: to brake takes a few centimetres, and then it goes down.
    assert!(flight.go_on(1500, TrackingStatus::Lost) < highest_m + 0.15, "not up");
    flight.go_on(500, TrackingStatus::Lost);
    assert!(flight.go_on(20, TrackingStatus::Lost) < highest_m - 0.05, "down");
}
