//! The robot's body in the simulator: the mission's commands in, true motion and touches out.
//!
//! Numbers come from the robot model; nothing about a robot stands here as a constant.

use anyhow::{Context, Result};
use mission::autopilot::Autopilot;
use mission::omni_perception::Stamp;
use mission::robot_model::{GaitError, Geometry, RobotKind, RobotModel};
use mission::stream::Command;
use nalgebra::{Isometry3, Vector3};
use omni_sim::contact::{CollisionShape, Contact, ContactWorld, ShapeGeometry, TouchCounter};
use omni_sim::ground_base::{GroundBase, GroundBaseConfig, VelocityCommand};
use omni_sim::motion::{KinematicState, Motion};
use omni_sim::quadrotor::{Quadrotor, QuadrotorConfig, RotorConfig};
use omni_sim::towed::{ToldPose, TowedBody};
use omni_sim::world::World;

use crate::estimate_frame::EstimateFrame;
use crate::legs::Legs;

/// A thing that was left for half a second is touched anew.
const RELEASE_S: f64 = 0.5;
/// The flight controller's period.
const AUTOPILOT_S: f64 = 0.0025;
/// Motion is kept this long for the sensors.
const MEMORY_NS: i64 = 1_000_000_000;
/// Feet or skids that meet the floor more slowly than this stand on it; faster is a crash.
const LANDING_MPS: f64 = 1.0;

/// A body of either kind with its contacts.
pub struct SimulatedBody {
    kind: Kind,
    contacts: ContactWorld,
    counter: TouchCounter,
    reported: usize,
    floor_z_m: f64,
    is_walker: bool,
    hover_radps: f64,
    has_power: bool,
    legs: Result<Legs, GaitError>,
}

enum Kind {
    Ground(Box<GroundBase>),
    Air(Box<Quadrotor>, Box<Autopilot>),
    /// Moved by somebody else.
    Towed(Box<TowedBody>),
}

impl SimulatedBody {
    /// Puts the robot at `start`. If `is_towed`, it obeys no command: it goes where it is told to be ([`tell`](Self::tell)).
    pub fn new(robot: &RobotModel, world: &World, start: &Isometry3<f64>, is_towed: bool) -> Result<SimulatedBody> {
        let shapes: Vec<CollisionShape> = robot
            .collision_shapes
            .iter()
            .map(|shape| CollisionShape {
                body_from_shape: shape.body_from_shape,
                geometry: match &shape.geometry {
                    Geometry::Box { half } => ShapeGeometry::Box { half_m: *half },
                    Geometry::Cylinder { radius, half_length } => {
                        ShapeGeometry::Cylinder { radius_m: *radius, half_length_m: *half_length }
                    }
                    Geometry::Sphere { radius } => ShapeGeometry::Sphere { radius_m: *radius },
                    Geometry::ConvexHull(points) => ShapeGeometry::ConvexHull { points: points.clone() },
                },
            })
            .collect();
        let contacts = ContactWorld::new(world, &shapes, &[]).context("setting up the contacts")?;
        let floor_z_m = start.translation.vector.z - robot.stance_height_m;
        let kind = match robot.kind {
            _ if is_towed => Kind::Towed(Box::new(TowedBody::new(0, *start))),
            RobotKind::Ground => Kind::Ground(Box::new(ground_base(robot, start, floor_z_m)?)),
            RobotKind::Aerial => {
                let quadrotor =
                    Quadrotor::new(quadrotor_config(robot), 0, *start, 0.0).context("setting up the quadrotor")?;
                let autopilot = Autopilot::new(robot).context("setting up the flight controller")?;
                Kind::Air(Box::new(quadrotor), Box::new(autopilot))
            }
        };
        let hover_radps = match robot.kind {
            RobotKind::Ground => 1.0,
            RobotKind::Aerial => quadrotor_config(robot).hover_speed_radps(),
        };
        let counter = TouchCounter::new(RELEASE_S);
        let is_walker = robot.kind == RobotKind::Ground;
        let legs = Legs::standing(robot, start, floor_z_m);
        let has_power = true;
        Ok(SimulatedBody { kind, contacts, counter, reported: 0, floor_z_m, is_walker, hover_radps, has_power, legs })
    }

    /// Hears a new command.
    pub fn hear(&mut self, command: &Command, now_ns: i64) {
        if let (Kind::Air(_, autopilot), Command::Flight(set_point)) = (&mut self.kind, command) {
            autopilot.set(Stamp(now_ns), *set_point);
        }
    }

    /// Where a towed body is at `now_ns`; another does not listen.
    pub fn tell(&mut self, now_ns: i64, told: ToldPose) -> Result<()> {
        match &mut self.kind {
            Kind::Towed(body) => body.tell(now_ns, told).context("putting the body where it is told to be"),
            Kind::Ground(_) | Kind::Air(..) => Ok(()),
        }
    }

    /// Follows the command for one tick. A flight controller sees what the odometry sees, not the truth.
    pub fn advance(&mut self, command: &Command, now_ns: i64, tick_ns: i64, believed: &EstimateFrame) -> Result<()> {
        let touched = match (&mut self.kind, command) {
            (Kind::Ground(base), Command::Velocity { forward_mps, left_mps, yaw_rate_radps }) => {
                let command =
                    VelocityCommand { forward_mps: *forward_mps, left_mps: *left_mps, yaw_rate_radps: *yaw_rate_radps };
                base.forget_before(now_ns - MEMORY_NS);
                base.step(tick_ns as f64 * 1e-9, &command, Some(&mut self.contacts)).context("moving the base")?
            }
            (Kind::Air(quadrotor, autopilot), Command::Flight(_)) => {
                quadrotor.forget_before(now_ns - MEMORY_NS);
                let mut touched = Vec::new();
                let steps = ((tick_ns as f64 * 1e-9) / AUTOPILOT_S).round().max(1.0) as i64;
                for step in 0..steps {
                    let state = quadrotor.state();
                    let seen = believed.estimate(&state, Stamp(now_ns + step * tick_ns / steps));
                    let mut speeds = autopilot.rotor_speeds_radps(&seen);
                    if !self.has_power {
                        speeds.fill(0.0);
                    }
                    let dt_s = tick_ns as f64 * 1e-9 / steps as f64;
                    let contacts = quadrotor.step(dt_s, &speeds, Some(&mut self.contacts)).context("flying")?;
                    let floor_z_m = self.floor_z_m;
                    let speed_mps = state.velocity_world.norm();
                    touched.extend(contacts.into_iter().filter(|contact| !is_landing(contact, speed_mps, floor_z_m)));
                }
                touched
            }
            (Kind::Towed(body), _) => {
                body.forget_before(now_ns - MEMORY_NS);
                let contacts = body.step(tick_ns as f64 * 1e-9, Some(&mut self.contacts)).context("towing the body")?;
                // Whoever walks has feet on the floor at any speed; only how fast they come down counts.
                let velocity = body.state().velocity_world;
                let speed_mps = if self.is_walker { velocity.z.abs() } else { velocity.norm() };
                let floor_z_m = self.floor_z_m;
                contacts.into_iter().filter(|contact| !is_landing(contact, speed_mps, floor_z_m)).collect()
            }
            // A command for another body: nothing moves, nothing breaks.
            _ => Vec::new(),
        };
        self.counter.observe(&touched);
        if let Ok(legs) = &mut self.legs {
            let obeyed = match (&self.kind, command) {
                (Kind::Ground(_), Command::Velocity { forward_mps, left_mps, yaw_rate_radps }) => {
                    Some(VelocityCommand {
                        forward_mps: *forward_mps,
                        left_mps: *left_mps,
                        yaw_rate_radps: *yaw_rate_radps,
                    })
                }
                _ => None,
            };
            let state = match &self.kind {
                Kind::Ground(base) => base.state(),
                Kind::Air(quadrotor, _) => quadrotor.state(),
                Kind::Towed(body) => body.state(),
            };
            legs.follow(&state, obeyed.as_ref(), tick_ns as f64 * 1e-9)?;
        }
        Ok(())
    }

    /// The legs, or why they do not move.
    pub fn legs(&self) -> Result<&Legs, &GaitError> {
        self.legs.as_ref()
    }

    /// Something that moves goes on, as in the world ([`World::go_on`]).
    pub fn go_on(&mut self, mover: usize, stamp_ns: i64, pose: Isometry3<f64>, keep_ns: i64) {
        self.contacts.go_on(mover, stamp_ns, pose, keep_ns);
    }

    /// The battery is empty: rotors stop.
    pub fn cut_power(&mut self) {
        self.has_power = false;
    }

    /// Power of the rotors as a share of what hovering takes: the cube of their speeds; of rotors that are somebody else's, all or
    /// nothing, as commanded. Others have none.
    pub fn power_share(&self, command: &Command) -> f64 {
        let quadrotor = match (&self.kind, command) {
            (Kind::Air(quadrotor, _), _) => quadrotor,
            (Kind::Towed(_), Command::Flight(point)) if point.is_armed => return 1.0,
            _ => return 0.0,
        };
        let speeds = quadrotor.rotor_speeds_radps();
        let share = |speed: &f64| (speed / self.hover_radps).powi(3);
        speeds.iter().map(share).sum::<f64>() / speeds.len().max(1) as f64
    }

    /// Touches since the last call.
    pub fn take_touches(&mut self) -> Vec<Contact> {
        let new = self.counter.touches()[self.reported..].to_vec();
        self.reported += new.len();
        new
    }

    /// Whether it is under way: faster than what a controller at rest trembles with.
    pub fn moves(&self) -> bool {
        const REST: (f64, f64) = (0.02, 0.05);
        let state = self.state();
        state.velocity_world.norm() > REST.0 || state.angular_velocity_body.norm() > REST.1
    }

    /// State now.
    pub fn state(&self) -> KinematicState {
        match &self.kind {
            Kind::Ground(base) => base.state(),
            Kind::Air(quadrotor, _) => quadrotor.state(),
            Kind::Towed(body) => body.state(),
        }
    }

    /// The motion of the last second.
    pub fn motion(&self) -> &dyn Motion {
        match &self.kind {
            Kind::Ground(base) => base.track(),
            Kind::Air(quadrotor, _) => quadrotor.track(),
            Kind::Towed(body) => body.track(),
        }
    }
}

/// Standing on the floor, taking off from it or coming down on it gently is no collision.
fn is_landing(contact: &Contact, speed_mps: f64, floor_z_m: f64) -> bool {
    contact.instance == 0
        && contact.normal.z.abs() > 0.7
        && contact.point.z - floor_z_m < 0.05
        && speed_mps < LANDING_MPS
}

fn ground_base(robot: &RobotModel, start: &Isometry3<f64>, floor_z_m: f64) -> Result<GroundBase> {
    let limits = &robot.limits;
    let config = GroundBaseConfig {
        stance_height_m: robot.stance_height_m,
        max_speed_mps: limits.max_speed_mps,
        max_reverse_mps: limits.max_reverse_speed_mps,
        max_lateral_mps: limits.max_lateral_speed_mps,
        max_yaw_rate_radps: limits.max_yaw_rate_radps,
        max_accel_mps2: limits.max_accel_mps2,
        max_yaw_accel_radps2: limits.max_yaw_accel_radps2,
        ..GroundBaseConfig::default()
    };
    let at = start.translation.vector;
    let (_, _, yaw_rad) = start.rotation.euler_angles();
    GroundBase::new(config, 0, (at.x, at.y, yaw_rad), floor_z_m).context("setting up the base")
}

fn quadrotor_config(robot: &RobotModel) -> QuadrotorConfig {
    QuadrotorConfig {
        mass_kg: robot.mass_kg,
        center_of_mass: robot.center_of_mass,
        inertia_kgm2: robot.inertia,
        rotors: robot
            .rotors
            .iter()
            .map(|rotor| RotorConfig {
                position_m: rotor.body_from_rotor.translation.vector.into(),
                axis: rotor.body_from_rotor.rotation * Vector3::z(),
                spin: rotor.direction,
                thrust_coefficient_n_s2: rotor.thrust_coefficient_n_s2,
                moment_ratio_m: rotor.moment_ratio_m,
                max_speed_radps: rotor.max_speed_radps,
                time_constant_up_s: rotor.time_constant_up_s,
                time_constant_down_s: rotor.time_constant_down_s,
                drag_kg_per_rad: Vector3::zeros(),
            })
            .collect(),
        drag_ns_per_m: robot.drag,
        ..QuadrotorConfig::x500()
    }
}
