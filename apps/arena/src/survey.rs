//! A survey: a robot is driven through a building, and its own side makes of the sensors what it can: poses, map, scene graph.
//!
//! No mission: nothing is decided, so that two arms of an experiment see from the same places.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use mission::odometer::with_poses;
use mission::omni_perception::RawScan;
use mission::robot_model::RobotModel;
use mission::stage_clock::StageClock;
use mission::stream::SensorEvent;
use mission::world_model::WorldModel;
use nalgebra::Isometry3;

use crate::pilot::{Pilot, PilotConfig};
use crate::run::RunConfig;
use crate::scenario::Scene;
use crate::simulation::Simulation;
use crate::tour::Tour;

/// What an observer of a survey sees.
pub enum Moment<'a> {
    /// A scan came in.
    Scan(&'a RawScan),
    /// The robot's side has drawn its conclusions.
    Refreshed {
        /// They are in here.
        world: &'a WorldModel,
        /// Where its map lies in the building.
        truth_from_map: Isometry3<f64>,
        /// Where the robot truly is.
        truth_from_body: Isometry3<f64>,
    },
}

/// The end of a survey.
pub struct Surveyed {
    /// What is known.
    pub world: WorldModel,
    /// How many LiDAR points each instance got.
    pub points_on: BTreeMap<u32, u64>,
    /// How long it took.
    pub sim_s: f64,
}

/// Control period.
const STEP_NS: i64 = 20_000_000;

/// Drives `robot` along `tour` from `start`, and tells `observe` what happens and when. Returns what is known at the end.
///
/// # Errors
/// What the simulator or the setting up of the robot's side says.
#[allow(clippy::too_many_arguments)] // one for each thing that decides the survey
pub fn survey(
    config: &RunConfig,
    robot: &RobotModel,
    scene: &Scene,
    start: &Isometry3<f64>,
    tour: &Tour,
    floor_z_m: f64,
    seed: u64,
    observe: &mut dyn FnMut(f64, Moment),
) -> Result<Surveyed> {
    let start_in_map = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
    let mut simulation = Simulation::new(&config.simulation, robot, scene, start, &start_in_map, seed)?;
    let mut clock = StageClock::new(config.cpu_scope);
    let mut world = WorldModel::new(robot, &config.mission, simulation.camera(), 0.0).context("setting up the map")?;
    let mut odometer = config.mission.odometry.odometer(robot, &start_in_map)?;
    let pilot_config = PilotConfig { flight_height_m: config.mission.flight_height_m, ..PilotConfig::default() };
    let mut pilot = Pilot::new(pilot_config, robot, tour, start, floor_z_m);
    let mut next_refresh_s = 0.0;
    loop {
        let now_s = simulation.seconds();
        let is_over = pilot.is_over(now_s);
        if !is_over {
            let command = pilot.command(now_s, STEP_NS as f64 * 1e-9, &simulation.true_pose());
            for event in simulation.advance(&command, STEP_NS, &mut clock)? {
                if let SensorEvent::Scan(scan) = &event {
                    observe(now_s, Moment::Scan(scan));
                }
                for event in with_poses(&mut odometer, event, &mut clock) {
                    world.see(event, &mut clock);
                }
            }
        }
        // At the end once more, for what the last images brought.
        if is_over || now_s >= next_refresh_s {
            next_refresh_s = now_s + config.mission.refresh_period_s;
            world.refresh(now_s, &mut clock);
            let truth_from_map = start * start_in_map.inverse() * world.frame().map_from_odometry.inverse();
            let truth_from_body = simulation.true_pose();
            observe(now_s, Moment::Refreshed { world: &world, truth_from_map, truth_from_body });
        }
        if is_over {
            return Ok(Surveyed { world, points_on: simulation.lidar_points_on().clone(), sim_s: now_s });
        }
    }
}
