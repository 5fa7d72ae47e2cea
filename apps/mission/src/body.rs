//! The two bodies behind one face: what the mind wants is the same, how it is done is not.

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use planner::{AirSpace, GroundMover};
use robot_model::{RobotKind, RobotModel};

use crate::closed_air::ClosedAir;
use crate::config::MissionConfig;
use crate::drive::{Drive, DriveConfig};
use crate::emergency::Emergency;
use crate::error::MissionError;
use crate::fly::{Fly, Phase};
use crate::goal::{Goal, GoalStatus};
use crate::movers::movers;
use crate::stage_clock::StageClock;
use crate::stream::Command;
use crate::world_model::WorldModel;

/// A body that carries out goals.
pub enum Body {
    /// On legs or wheels.
    Ground(Box<Drive>),
    /// With rotors.
    Air(Box<Fly>),
}

impl Body {
    /// The body of this robot, at rest on a floor at `floor_m`.
    pub fn new(robot: &RobotModel, config: &MissionConfig, floor_m: f64) -> Result<Body, MissionError> {
        Ok(match robot.kind {
            RobotKind::Ground => {
                let drive = DriveConfig { period_s: config.control_period_s, max_attempts: config.max_attempts };
                Body::Ground(Box::new(Drive::new(robot, drive)?))
            }
            RobotKind::Aerial => {
                let (flight_z_m, landed_z_m) = (floor_m + config.flight_height_m, floor_m + robot.stance_height_m);
                let mut fly = Fly::new(robot, flight_z_m, landed_z_m, config.control_period_s, config.max_attempts);
                fly.limit(config.tracking_margin_m, config.geofence.clone(), config.battery);
                Body::Air(Box::new(fly))
            }
        })
    }

    /// What to command before anything is known.
    pub fn idle(&mut self) -> Command {
        match self {
            Body::Ground(_) => Command::Velocity { forward_mps: 0.0, left_mps: 0.0, yaw_rate_radps: 0.0 },
            Body::Air(fly) => fly.command(&Isometry3::identity(), None),
        }
    }

    /// Off the floor, if that is what this body does first.
    ///
    /// # Errors
    /// Why it cannot, for people.
    pub fn begin(&mut self, world: &WorldModel) -> Result<(), &'static str> {
        let (Body::Air(fly), Some(odometry)) = (self, &world.odometry) else { return Ok(()) };
        let map_from_odometry = world.frame().map_from_odometry;
        with_air(world, |air| fly.take_off(&odometry.world_from_body, &map_from_odometry, air))
    }

    /// What the battery makes it do, whatever its goal was.
    pub fn emergency(&self) -> Option<Emergency> {
        match self {
            Body::Ground(_) => None,
            Body::Air(fly) => fly.emergency(),
        }
    }

    /// Whether goals can be taken now.
    pub fn is_ready(&self) -> bool {
        match self {
            Body::Ground(_) => true,
            Body::Air(fly) => fly.phase() == Phase::Flying,
        }
    }

    /// Whether it is on its way up from the floor.
    pub fn is_taking_off(&self) -> bool {
        matches!(self, Body::Air(fly) if fly.phase() == Phase::TakeOff)
    }

    /// Whether the body has come to rest for good.
    pub fn is_down(&self) -> bool {
        match self {
            Body::Ground(_) => true,
            Body::Air(fly) => matches!(fly.phase(), Phase::Landed | Phase::Grounded),
        }
    }

    /// Comes down where it is.
    pub fn land(&mut self) {
        if let Body::Air(fly) = self {
            fly.land();
        }
    }

    /// The map's frame became another one while the body stood: `new_from_old` is a turn about the vertical and a shift, and the
    /// floor rose by `floor_rise_m`.
    pub fn change_frame(&mut self, new_from_old: &Isometry3<f64>, floor_rise_m: f64) {
        match self {
            Body::Ground(drive) => drive.set_goal(Goal::Stay),
            Body::Air(fly) => fly.change_frame(new_from_old, floor_rise_m),
        }
    }

    /// Takes a new goal.
    pub fn set_goal(&mut self, goal: Goal) {
        match self {
            Body::Ground(drive) => drive.set_goal(goal),
            Body::Air(fly) => fly.set_goal(goal),
        }
    }

    /// How it goes with the present goal.
    pub fn status(&self) -> &GoalStatus {
        match self {
            Body::Ground(drive) => drive.status(),
            Body::Air(fly) => fly.status(),
        }
    }

    /// The way still to go, seen from above.
    pub fn path(&self) -> &[Point2<f64>] {
        match self {
            Body::Ground(drive) => drive.path(),
            Body::Air(fly) => fly.path(),
        }
    }

    /// Distance from the body to the nearest obstacle at the last command.
    pub fn clearance_m(&self) -> f64 {
        match self {
            Body::Ground(drive) => drive.clearance_m(),
            Body::Air(fly) => fly.clearance_m(),
        }
    }

    /// Finds its way anew on a fresh map.
    pub fn replan(&mut self, world: &WorldModel, clock: &mut StageClock) {
        let Some(odometry) = &world.odometry else { return };
        match self {
            Body::Ground(drive) => clock.time("route", || {
                drive.limit_speed(&world.zones);
                drive.replan(&world.navigation, &odometry.world_from_body);
            }),
            Body::Air(fly) => clock.time("trajectory", || {
                let fly_home = fly.home();
                let here = Point2::from(odometry.world_from_body.translation.vector.xy());
                let way_home_m = |from: &Point2<f64>| {
                    let home = fly_home?;
                    let way = world.navigation.route_toward(from, &home, 0.5)?;
                    Some(way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum())
                };
                if let Some(charge) = world.battery_charge {
                    fly.set_charge(charge, way_home_m(&here));
                }
                fly.limit_speed(&world.zones);
                let route = fly.route(&world.navigation, &here);
                with_air(world, |air| fly.replan(route.as_deref(), air, &way_home_m));
            }),
        }
    }

    /// The command for the next period.
    pub fn command(
        &mut self,
        world_from_body: &Isometry3<f64>,
        velocity_in_body: Vector3<f64>,
        obstacles: &[Point2<f32>],
        movers: &[GroundMover],
        distance_m: Option<f64>,
    ) -> Command {
        match self {
            Body::Ground(drive) => drive.command(world_from_body, velocity_in_body, obstacles, movers),
            Body::Air(fly) => fly.command(world_from_body, distance_m),
        }
    }
}

/// The world as a planner asks about it: the map, the zones to keep out of, and what the graph says moves.
pub(crate) fn with_air<T>(world: &WorldModel, ask: impl FnOnce(&AirSpace) -> T) -> T {
    let movers = world.odometry.map_or_else(Vec::new, |odometry| movers(&world.graph, odometry.stamp));
    let closed = ClosedAir { zones: &world.zones, posts: world.zone_posts(), far_m: world.field.max_distance_m() };
    let distance = |point: &Point3<f64>| closed.distance_m(point, world.field.distance(point));
    let obstacles =
        |low: &Point3<f64>, high: &Point3<f64>| closed.obstacles(low, high, world.field.occupied_points(low, high));
    ask(&AirSpace { distance: &distance, obstacles: &obstacles, movers: &movers })
}
