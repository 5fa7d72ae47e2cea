//! A building as the robot knows it from another day: it surveyed it, with nobody about, and kept graph and map.

use anyhow::{Context, Result};
use mission::archive::Known;
use mission::robot_model::RobotModel;
use omni_sim::crowd::CrowdConfig;

use crate::run::RunConfig;
use crate::scenario::Scene;
use crate::survey::survey;
use crate::toured_scene::tour_of;

/// Lets `robot` look at all of `scene` from a drawn start, with its own odometry, mapping and segmented pictures. Where it will stand the
/// next time it has to find out by itself.
///
/// # Errors
/// If it fits nowhere, or the survey fails.
pub fn survey_of(robot: &RobotModel, scene: &Scene, seed: u64, config: &RunConfig) -> Result<Known> {
    // Other noise, another start than the run to come.
    let seed = seed ^ 0x006B_6E6F_776E;
    let mut config = config.clone();
    config.simulation.crowd = CrowdConfig::default();
    let (start, tour) = tour_of(scene, robot, &config, seed).context("this robot cannot get round the building")?;
    let floor_z_m = start.translation.vector.z - robot.stance_height_m;
    let world = survey(&config, robot, scene, &start, &tour, floor_z_m, seed, &mut |_, _| {})
        .with_context(|| format!("surveying scene {}", scene.name))?
        .world;
    let labels = world.label_names();
    Ok(Known { graph: world.graph, volume: world.volume, labels, floor_m: world.floor_m, start: None })
}
