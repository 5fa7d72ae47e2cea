//! The people of a run: the simulator's crowd, who see the robot where it truly is, walk in its world and can be touched.

use anyhow::{Context, Result};
use mission::robot_model::RobotModel;
use nalgebra::{Isometry3, Point2};
use omni_sim::building::Building;
use omni_sim::crowd::{Crowd, CrowdConfig, RobotDisc, STEP_NS};
use omni_sim::motion::KinematicState;
use omni_sim::world::World;

use crate::body::SimulatedBody;

/// Nobody begins nearer to the robot than this.
const APART_M: f64 = 1.5;
/// Sensors look back no further.
const KEEP_NS: i64 = 2_000_000_000;

/// A crowd in a world.
pub struct People {
    crowd: Crowd,
    /// Number of their first mover in the world.
    first_mover: usize,
    next_ns: i64,
    radius_m: f64,
    core_m: f64,
}

impl People {
    /// People about the robot at `start`, and the world with them in it. `None` where nobody is asked for.
    pub fn new(
        config: CrowdConfig,
        building: &Building,
        world: &World,
        robot: &RobotModel,
        start: &Isometry3<f64>,
    ) -> Result<Option<(People, World)>> {
        if config.people == 0 {
            return Ok(None);
        }
        let first_instance = world.things().last().map_or(1, |thing| thing.instance + 1);
        let at = Point2::from(start.translation.vector.xy());
        let crowd = Crowd::new(building, config, first_instance, &at, APART_M + robot.circumscribed_radius_m);
        let first_mover = world.movers().count();
        let peopled = world.with_movers(crowd.movers(0), crowd.things()).context("putting people into the world")?;
        let people = People {
            crowd,
            first_mover,
            // The poses of the beginning stand for the first moment.
            next_ns: 0,
            radius_m: robot.circumscribed_radius_m,
            core_m: robot.inscribed_radius_m,
        };
        Ok(Some((people, peopled)))
    }

    /// Lets them walk until they are ahead of `now_ns`, so that every ray and contact meets them between two known poses.
    pub fn go_on(&mut self, now_ns: i64, robot: &KinematicState, world: &mut World, body: &mut SimulatedBody) {
        while self.next_ns <= now_ns {
            self.next_ns += STEP_NS;
            let disc = RobotDisc {
                at: Point2::from(robot.world_from_body.translation.vector.xy()),
                velocity: robot.velocity_world.xy(),
                radius_m: self.radius_m,
                core_m: self.core_m,
            };
            for (number, pose) in self.crowd.step(Some(&disc)).into_iter().enumerate() {
                let mover = self.first_mover + number;
                world.go_on(mover, self.next_ns, pose, KEEP_NS);
                body.go_on(mover, self.next_ns, pose, KEEP_NS);
            }
        }
    }
}
