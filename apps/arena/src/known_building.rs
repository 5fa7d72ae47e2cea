//! A building as the robot knows it from another day: it surveyed it, with nobody about, and kept graph and map. Some things
//! may have stood elsewhere that day, or have gone since.

use anyhow::{Context, Result};
use mission::archive::Known;
use mission::robot_model::RobotModel;
use omni_sim::crowd::CrowdConfig;

use crate::run::RunConfig;
use crate::scenario::Scene;
use crate::survey::survey;
use crate::toured_scene::tour_of;

/// How the robot knows the buildings of a bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownFrom {
    /// Share of the things that stood elsewhere on the day of the survey, or are gone since (0 to 1).
    pub moved: f64,
}

/// The survey of `scene` as it was on another day.
///
/// # Errors
/// As [`survey_of`].
pub fn survey_before(
    from: KnownFrom,
    robot: &RobotModel,
    scene: &Scene,
    seed: u64,
    config: &RunConfig,
) -> Result<Known> {
    if from.moved <= 0.0 {
        return survey_of(robot, scene, seed, config);
    }
    let (then, _) = scene.building.earlier(from.moved, seed);
    survey_of(robot, &Scene::new(&scene.name, then)?, seed, config)
}

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
