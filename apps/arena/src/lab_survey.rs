//! A laboratory as a robot knows it after a survey, beside the truth: what descriptions of things are made from, and what they are
//! checked against (the paper's Table I).

use anyhow::{Context, Result};
use mission::dsg::SceneGraph;
use mission::robot_model::RobotModel;
use nalgebra::Isometry3;
use omni_sim::building::Building;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::run::RunConfig;
use crate::scenario::Scene;
use crate::survey::{Moment, survey};
use crate::toured_scene::TouredScene;

/// Both sides.
pub struct SurveyedLab {
    /// The truth.
    pub building: Building,
    /// What the robot made of its sensors.
    pub graph: SceneGraph,
    /// Where its map lies in the building.
    pub truth_from_map: Isometry3<f64>,
}

/// Draws the laboratory of a seed and lets the robot look at all of it, with its own odometry, mapping and segmented pictures.
///
/// # Errors
/// If the robot fits into none of the buildings drawn, or the survey fails.
pub fn survey_lab(robot: &RobotModel, seed: u64, config: &RunConfig) -> Result<SurveyedLab> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x004C_6162);
    let TouredScene { scene, start, tour, run_seed } =
        TouredScene::draw(&mut rng, robot, config, &|seed| Scene::lab(seed, robot))?;
    let floor_z_m = start.translation.vector.z - robot.stance_height_m;
    let mut truth_from_map = Isometry3::identity();
    let surveyed = survey(config, robot, &scene, &start, &tour, floor_z_m, run_seed, &mut |_, moment| {
        if let Moment::Refreshed { truth_from_map: last, .. } = moment {
            truth_from_map = last;
        }
    })
    .with_context(|| format!("surveying the laboratory of seed {seed}"))?;
    Ok(SurveyedLab { building: scene.building, graph: surveyed.world.graph, truth_from_map })
}
