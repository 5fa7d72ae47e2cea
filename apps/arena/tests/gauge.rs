//! The battery of a vehicle that somebody else moves: its own gauge counts, and a model of its discharge only until it speaks.

mod support;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use arena::mission::mission::Mission;
use arena::mission::omni_perception::Stamp;
use arena::mission::robot_model::RobotKind;
use arena::mission::stream::Command;
use arena::run::{RunResult, Setup, run};
use arena::task::Task;
use arena::vehicle::Vehicle;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use omni_sim::towed::ToldPose;
use support::{coarse, robot, scene, start};

/// It is at once where it is told to be, and says how full its battery is by a table of times.
struct Obedient {
    truth_from_odometry: Isometry3<f64>,
    pose: ToldPose,
    now_s: f64,
    gauge: fn(f64) -> Option<f64>,
}

impl Vehicle for Obedient {
    fn pose_when_due(&mut self, stamp: Stamp) -> ToldPose {
        self.now_s = stamp.0 as f64 * 1e-9;
        self.pose
    }

    fn obey(&mut self, _: Stamp, command: &Command, _: &Mission) -> Result<()> {
        if let Command::Flight(point) = command
            && point.is_armed
        {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), point.yaw_rad);
            let there = Isometry3::from_parts(point.position_in_world.into(), turn);
            self.pose = ToldPose {
                world_from_body: self.truth_from_odometry * there,
                velocity_world: self.truth_from_odometry * point.velocity_in_world_mps,
                angular_velocity_body: Vector3::z() * point.yaw_rate_radps,
            };
        }
        Ok(())
    }

    fn charge(&self) -> Option<f64> {
        (self.gauge)(self.now_s)
    }

    fn rest(&mut self) -> Result<()> {
        Ok(())
    }

    fn deed(&self) -> &'static str {
        "flight"
    }

    fn account(&self) -> String {
        "flown by a table".into()
    }
}

/// Looks for what is not there with a battery for `endurance_s`.
fn search(endurance_s: f64, max_time_s: f64, gauge: fn(f64) -> Option<f64>) -> RunResult {
    let mut config = coarse(max_time_s);
    config.simulation.battery_endurance_s = Some(endurance_s);
    config.mission.battery = Some(arena::flight_options::battery(endurance_s, 1.0 / 6.0));
    let (robot, scene) = (robot(RobotKind::Aerial), scene("flat"));
    let start = start(&scene, &robot, &config, 1);
    let start_in_odometry = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
    let mut vehicle = Obedient {
        truth_from_odometry: start * start_in_odometry.inverse(),
        pose: ToldPose::resting_at(start),
        now_s: 0.0,
        gauge,
    };
    let task = Task::read("find the unicorn", &scene.building).unwrap();
    let setup = Setup {
        config: &config,
        robot: &robot,
        scene: &scene,
        task: &task,
        start: &start,
        known: None,
        seed: 1,
        vehicle: Some(&mut vehicle),
        orders: arena::orders::Orders::default(),
    };
    run(setup, &Arc::new(AtomicBool::new(false)), &mut |_| {}).unwrap()
}

#[test]
fn a_gauge_that_falls_brings_it_back_though_a_model_would_be_full() {
    // Nine seconds of hovering above the reserve: the landing takes eight.
    let result = search(600.0, 40.0, |now_s| Some(if now_s < 9.0 { 0.9 } else { 0.182 }));
    assert!(result.summary.reason.contains("battery is low"), "{}", result.summary.reason);
    assert!(result.summary.sim_s > 9.0 && result.summary.sim_s < 30.0, "{} s", result.summary.sim_s);
    assert_eq!(result.summary.collisions, 0);
}

#[test]
fn without_a_gauge_a_model_counts_and_with_a_full_one_it_does_not() {
    let model = search(20.0, 40.0, |_| None);
    assert!(model.summary.reason.contains("battery is low"), "{}", model.summary.reason);
    let full = search(20.0, 1.2 * model.summary.sim_s, |_| Some(1.0));
    assert!(!full.summary.reason.contains("battery"), "{}", full.summary.reason);
    assert_eq!(full.summary.collisions, 0);
}
