//! A survey: a robot is driven through a building, and its own side makes of the sensors what it can: poses, map, scene graph.
//!
//! No mission: nothing is decided, so that two arms of an experiment see from the same places.

use anyhow::{Context, Result};
use mission::localiser::{Localiser, OdometrySource};
use mission::omni_perception::RawScan;
use mission::robot_model::RobotModel;
use mission::stage_clock::StageClock;
use mission::stream::SensorEvent;
use mission::world_model::WorldModel;
use nalgebra::Isometry3;

use crate::run::RunConfig;
use crate::scenario::Scene;
use crate::simulation::Simulation;
use crate::tour::{Pilot, Tour};

/// What an observer of a survey sees.
pub enum Moment<'a> {
    /// A scan came in.
    Scan(&'a RawScan),
    /// The robot's side has drawn its conclusions; where its map lies in the building goes with it.
    Refreshed(&'a WorldModel, Isometry3<f64>),
}

/// Control period.
const STEP_NS: i64 = 20_000_000;
/// Standing still before and after.
const STAND_S: f64 = 2.0;

/// Drives `robot` along `tour` from `start`, and tells `observe` what happens and when. Returns what is known at the end.
///
/// # Errors
/// What the simulator or the setting up of the robot's side says.
pub fn survey(
    config: &RunConfig,
    robot: &RobotModel,
    scene: &Scene,
    start: &Isometry3<f64>,
    tour: &Tour,
    seed: u64,
    observe: &mut dyn FnMut(f64, Moment),
) -> Result<WorldModel> {
    const SPEED_MPS: f64 = 0.7;
    let start_in_map = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
    let mut simulation = Simulation::new(&config.simulation, robot, scene, start, &start_in_map, seed)?;
    let mut clock = StageClock::new(config.cpu_scope);
    let mut world = WorldModel::new(robot, &config.mission, simulation.camera(), 0.0).context("setting up the map")?;
    let mut localiser = match &config.mission.odometry {
        OdometrySource::LidarInertial(lio) => Some(Localiser::new(lio, robot, &start_in_map)?),
        OdometrySource::Stream => None,
    };
    let mut pilot = Pilot::new(tour, SPEED_MPS.min(robot.limits.max_speed_mps), 0.5 * robot.limits.max_yaw_rate_radps);
    let (mut next_refresh_s, mut end_s) = (0.0, f64::INFINITY);
    while simulation.seconds() < end_s {
        let now_s = simulation.seconds();
        let standing = now_s < STAND_S;
        let command = if standing { still() } else { pilot.command(&simulation.true_pose()) };
        if pilot.is_done() && end_s.is_infinite() {
            end_s = now_s + STAND_S;
        }
        for event in simulation.advance(&command, STEP_NS, &mut clock)? {
            if let SensorEvent::Scan(scan) = &event {
                observe(now_s, Moment::Scan(scan));
            }
            match &mut localiser {
                Some(localiser) => {
                    for event in localiser.follow(event, &mut clock) {
                        world.see(event, &mut clock);
                    }
                }
                None => world.see(event, &mut clock),
            }
        }
        if now_s >= next_refresh_s {
            next_refresh_s = now_s + config.mission.refresh_period_s;
            world.refresh(now_s, &mut clock);
            let truth_from_map = start * start_in_map.inverse() * world.frame().map_from_odometry.inverse();
            observe(now_s, Moment::Refreshed(&world, truth_from_map));
        }
    }
    Ok(world)
}

fn still() -> mission::stream::Command {
    mission::stream::Command::Velocity { forward_mps: 0.0, left_mps: 0.0, yaw_rate_radps: 0.0 }
}
