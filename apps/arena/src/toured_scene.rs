//! A drawn building that a robot fits into, a start in it, and a tour of all its rooms: what surveys are made of.

use anyhow::{Result, bail};
use mission::robot_model::RobotModel;
use nalgebra::{Isometry3, Point2};
use rand::{Rng, RngExt};

use crate::referee::Referee;
use crate::run::RunConfig;
use crate::scenario::{Scene, draw_start, robot_truth};
use crate::tour::Tour;

/// What a survey needs.
pub struct TouredScene {
    /// The building.
    pub scene: Scene,
    /// Where the body stands at first.
    pub start: Isometry3<f64>,
    /// Its way.
    pub tour: Tour,
    /// Seed of the noise.
    pub run_seed: u64,
}

impl TouredScene {
    /// Draws buildings, each made by `make` from a seed, until the robot fits into one.
    ///
    /// # Errors
    /// If it fits into none of thirty, or a building cannot be made.
    pub fn draw(
        rng: &mut impl Rng,
        robot: &RobotModel,
        config: &RunConfig,
        make: &dyn Fn(u64) -> Result<Scene>,
    ) -> Result<TouredScene> {
        const BUILDINGS: usize = 30;
        for _ in 0..BUILDINGS {
            let scene = make(rng.random::<u32>().into())?;
            let run_seed = rng.random::<u32>().into();
            if let Some((start, tour)) = tour_of(&scene, robot, config, run_seed) {
                return Ok(TouredScene { scene, start, tour, run_seed });
            }
        }
        bail!("this robot fits into none of {BUILDINGS} buildings")
    }
}

/// A start drawn with `seed`, and a tour of all rooms from there; `None` where the robot does not fit or cannot get round.
pub fn tour_of(scene: &Scene, robot: &RobotModel, config: &RunConfig, seed: u64) -> Option<(Isometry3<f64>, Tour)> {
    let body = robot_truth(robot, config.mission.flight_height_m);
    let referee = Referee::new(&scene.building, &scene.world, body.clone(), 0);
    let start = draw_start(&referee, robot, seed).ok()?;
    let at = Point2::from(start.translation.vector.xy());
    Some((start, Tour::plan(referee.floor(), &scene.building, body.radius_m, &at)?))
}
