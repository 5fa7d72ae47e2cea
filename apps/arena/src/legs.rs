//! The legs of a simulated robot: joints that go along with the base, wherever it goes.
//!
//! The base is what moves the robot, its contacts and its sensors; the legs follow it ([`Gait`]) and touch nothing. As before, the
//! robot's own LiDAR and camera see no part of the robot, and its contacts are those of its stance.

use anyhow::{Context, Result};
use mission::robot_model::{BaseMotion, Gait, GaitConfig, GaitError, MotionLimits, RobotModel};
use nalgebra::{Isometry3, UnitQuaternion, Vector2, Vector3};
use omni_sim::ground_base::VelocityCommand;
use omni_sim::motion::KinematicState;

/// Legs under a moving base.
pub struct Legs {
    gait: Gait,
    limits: MotionLimits,
    worst_miss_m: f64,
}

impl Legs {
    /// All feet on the floor at `floor_z_m`, below a robot at `start`.
    ///
    /// # Errors
    /// No legs, or legs of a kind that the gait does not know.
    pub fn standing(robot: &RobotModel, start: &Isometry3<f64>, floor_z_m: f64) -> Result<Legs, GaitError> {
        let gait = Gait::new(GaitConfig::default(), robot, start, floor_z_m)?;
        Ok(Legs { gait, limits: robot.limits, worst_miss_m: 0.0 })
    }

    /// The base is now there, `tick_s` later; `command` is what it obeys, if it obeys anything.
    pub fn follow(&mut self, base: &KinematicState, command: Option<&VelocityCommand>, tick_s: f64) -> Result<()> {
        let heading =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), base.world_from_body.rotation.euler_angles().2);
        let velocity = base.velocity_world.xy();
        let wanted = command.map_or(velocity, |command| {
            let limits = &self.limits;
            let forward = command.forward_mps.clamp(-limits.max_reverse_speed_mps, limits.max_speed_mps);
            let left = command.left_mps.clamp(-limits.max_lateral_speed_mps, limits.max_lateral_speed_mps);
            (heading * Vector3::new(forward, left, 0.0)).xy()
        });
        let motion = BaseMotion {
            world_from_body: base.world_from_body,
            velocity_in_world_mps: Vector2::new(velocity.x, velocity.y),
            yaw_rate_radps: (base.world_from_body.rotation * base.angular_velocity_body).z,
            excess_velocity_in_world_mps: velocity - wanted,
        };
        self.gait.step(tick_s, &motion).context("moving the legs")?;
        self.worst_miss_m = self.worst_miss_m.max(self.gait.missed_by_m());
        Ok(())
    }

    /// The gait: angles of all joints, and the feet.
    pub fn gait(&self) -> &Gait {
        &self.gait
    }

    /// By how much at most a leg could not reach where its foot stood, m: what the base asked too much.
    pub fn worst_miss_m(&self) -> f64 {
        self.worst_miss_m
    }
}
