//! A survey: a robot is driven through a building, and its own side makes of the sensors what it can: poses, map, scene graph.
//!
//! No mission: nothing is decided, so that two arms of an experiment see from the same places.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};
use mission::map_frame::MapFrame;
use mission::odometer::with_poses;
use mission::omni_perception::{Equirectangular, MaskedPanorama, RawScan};
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
    /// A segmented picture came in.
    Picture {
        /// The picture.
        picture: &'a MaskedPanorama,
        /// Where the robot believes to be in its map; none before its odometry runs.
        map_from_body: Option<Isometry3<f64>>,
    },
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
    /// What its pictures are like.
    pub camera: Equirectangular,
}

/// A robot that ends farther than this from the end of its way was somewhere else.
const OFF_THE_WAY_M: f64 = 0.5;
/// Control period.
const STEP_NS: i64 = 20_000_000;

/// Drives `robot` along `tour` from `start`, and tells `observe` what happens and when. Returns what is known at the end.
///
/// # Errors
/// What the simulator or the setting up of the robot's side says; a robot that is not at the end of the tour at the end, for what
/// it saw says nothing about the building then.
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
            // The pilot knows where the robot is; the flight controller takes orders in the world that it believes in.
            let command = pilot.command(now_s, STEP_NS as f64 * 1e-9, &simulation.true_pose());
            let command = MapFrame { map_from_odometry: simulation.true_from_believed() }.command_for_body(command);
            for event in simulation.advance(&command, STEP_NS, &mut clock)? {
                match &event {
                    SensorEvent::Scan(scan) => observe(now_s, Moment::Scan(scan)),
                    SensorEvent::Panorama(picture) => {
                        let map_from_body = world.odometry.as_ref().map(|odometry| odometry.world_from_body);
                        observe(now_s, Moment::Picture { picture, map_from_body });
                    }
                    _ => {}
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
            let left_m =
                tour.way.last().map_or(0.0, |end| (simulation.true_pose().translation.vector.xy() - end.coords).norm());
            ensure!(left_m <= OFF_THE_WAY_M, "the robot did not follow its way: {left_m:.1} m from its end at the end");
            return Ok(Surveyed {
                world,
                points_on: simulation.lidar_points_on().clone(),
                sim_s: now_s,
                camera: simulation.camera(),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::referee::Referee;
    use crate::scenario::{draw_start, robot_truth};
    use nalgebra::Point2;

    #[test]
    fn an_aircraft_flies_the_way_that_it_is_given_and_knows_where_it_is() {
        let robot = RobotModel::builtin_quadrotor();
        let config = RunConfig::default();
        let scene = Scene::drawn(5, &robot).unwrap();
        let body = robot_truth(&robot, config.mission.flight_height_m);
        let referee = Referee::new(&scene.building, &scene.world, body.clone(), 0);
        let start = draw_start(&referee, &robot, 3).unwrap();
        let at = Point2::from(start.translation.vector.xy());
        let mut tour = Tour::plan(referee.floor(), &scene.building, body.radius_m, &at).unwrap();
        tour.way.truncate(24);
        tour.room_m.truncate(24);
        let floor_z_m = start.translation.vector.z - robot.stance_height_m;
        let mut worst_m: f64 = 0.0;
        let mut flown_m: f64 = 0.0;
        survey(&config, &robot, &scene, &start, &tour, floor_z_m, 3, &mut |_, moment| {
            let Moment::Refreshed { world, truth_from_map, truth_from_body } = moment else { return };
            flown_m = flown_m.max((truth_from_body.translation.vector - start.translation.vector).xy().norm());
            if let Some(odometry) = &world.odometry {
                let believed = truth_from_map * odometry.world_from_body;
                worst_m = worst_m.max((believed.translation.vector - truth_from_body.translation.vector).norm());
            }
        })
        .unwrap();
        assert!(flown_m > 0.5 && worst_m < 0.05, "{flown_m} m flown, believed to be up to {worst_m} m elsewhere");
    }
}
