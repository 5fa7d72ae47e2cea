//! The robot model: URDF and TOML in, everything that plans, simulates or projects needs out.

use crate::description::{self, Description, MotionLimits, Mount, RobotKind};
use crate::envelope::{Disc, envelope, swept_shapes};
use crate::error::ModelError;
use crate::inertia::MassProperties;
use crate::leg::Leg;
use crate::sensors::{LidarMotor, SensorMounts, rotor_from_sensor};
use crate::shape::CollisionShape;
use crate::tree::{AnglesError, KinematicTree};
use crate::urdf::{self, MeshReader};
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Vector3};
use std::collections::BTreeMap;

/// Standard gravity, for the check that a robot can hover.
const GRAVITY_MPS2: f64 = 9.80665;

/// A robot in its nominal stance. All poses and points are in the body frame: the root link of the URDF, x forward, y left, z up.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotModel {
    /// Name in the URDF.
    pub name: String,
    /// Walks or flies.
    pub kind: RobotKind,
    /// Mass of the whole robot.
    pub mass_kg: f64,
    /// Centre of mass of the whole robot.
    pub center_of_mass: Point3<f64>,
    /// Inertia of the whole robot about its centre of mass, body axes, kg m^2.
    pub inertia: Matrix3<f64>,
    /// Height of the body origin above the floor when the robot stands on it.
    pub stance_height_m: f64,
    /// Convex hull of the collision shapes seen from above, counter-clockwise.
    pub footprint: Vec<Point2<f64>>,
    /// Lowest and highest z of the collision shapes.
    pub height_span_m: (f64, f64),
    /// Radius about the vertical through the body origin that the robot needs to turn in place.
    pub circumscribed_radius_m: f64,
    /// Radius of the largest circle about the body origin inside the footprint.
    pub inscribed_radius_m: f64,
    /// Radius of the ball about the body origin that holds the robot at any attitude.
    pub bounding_sphere_radius_m: f64,
    /// Collision shapes in the stance, rotors and wheels as the discs they sweep, payload included.
    pub collision_shapes: Vec<CollisionShape>,
    /// Pose of every link in the stance, also of links that are fixed to others.
    pub frames: BTreeMap<String, Isometry3<f64>>,
    /// Poses of the sensors.
    pub sensors: SensorMounts,
    /// How fast the robot may move.
    pub limits: MotionLimits,
    /// Rotors in the order of the TOML; empty for a ground robot.
    pub rotors: Vec<Rotor>,
    /// Linear drag along the body axes, N per m/s.
    pub drag: Vector3<f64>,
    /// Three-joint legs in the order of the TOML.
    pub legs: Vec<Leg>,
    /// Links and joints.
    pub tree: KinematicTree,
    /// Stance angles, in the order of [`KinematicTree::moving_joints`].
    pub stance: Vec<f64>,
}

/// A rotor: thrust `k w^2` along its z axis and reaction torque `-direction * moment_ratio * thrust` about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Rotor {
    /// Name of its link.
    pub link: String,
    /// Hub, with z along the thrust.
    pub body_from_rotor: Isometry3<f64>,
    /// +1: counter-clockwise seen from above, -1: clockwise.
    pub direction: f64,
    /// Thrust over the square of the speed, N s^2 (per rad^2).
    pub thrust_coefficient_n_s2: f64,
    /// Reaction torque over thrust, m.
    pub moment_ratio_m: f64,
    /// Largest speed.
    pub max_speed_radps: f64,
    /// Time constant of the first-order lag when speeding up.
    pub time_constant_up_s: f64,
    /// Time constant of the first-order lag when slowing down.
    pub time_constant_down_s: f64,
    /// Radius of the disc the propeller sweeps.
    pub radius_m: f64,
}

impl Rotor {
    /// Thrust at a rotor speed, N.
    pub fn thrust_n(&self, speed_radps: f64) -> f64 {
        self.thrust_coefficient_n_s2 * speed_radps * speed_radps
    }
}

impl RobotModel {
    /// Reads a robot. `toml` carries what a URDF cannot (see the crate page); pass an empty text to learn which keys are needed.
    /// `read_mesh` finds the bytes of a mesh by the name the URDF gives it and is asked for collision meshes only;
    /// [`crate::mesh_candidates`] lists the places to look.
    ///
    /// # Errors
    /// See [`ModelError`]; each names the element or key.
    pub fn parse(urdf: &str, toml: &str, read_mesh: MeshReader<'_>) -> Result<RobotModel, ModelError> {
        // 1. The tree of links, and the TOML resolved against it.
        let (name, tree) = urdf::read(urdf, read_mesh)?;
        let description = description::read(toml, &name, &tree)?;
        let stance = description.stance.clone();
        // 2. Where every link is in the stance.
        let poses = tree.body_from_links(&stance).expect("the stance has one finite angle for each moving joint");
        let place = |mount: &Mount| poses[mount.link] * mount.link_from_mount;
        // 3. Mass of links and payload.
        let mass = whole_mass(&tree, &poses, &description);
        if mass.mass_kg <= 0.0 {
            return Err(ModelError::NoMass);
        }
        // 4. Space: shapes with rotors and wheels swept, payload added.
        let discs: Vec<Disc> = description.rotors.iter().map(|r| Disc { link: r.link, radius_m: r.radius_m }).collect();
        let mut collision_shapes = swept_shapes(&tree, &stance, &discs);
        collision_shapes.extend(description.payload.iter().map(|payload| CollisionShape {
            link: payload.name.clone(),
            body_from_shape: place(&payload.mount),
            geometry: payload.geometry.clone(),
        }));
        let space = envelope(&collision_shapes).ok_or(ModelError::NoCollisionShape)?;
        // 5. Sensors, rotors, legs.
        let sensors = SensorMounts {
            body_from_lidar_stator: place(&description.lidar),
            rotor_from_sensor: rotor_from_sensor(description.tilt_rad, description.sensor_offset_m),
            body_from_imu: place(&description.imu),
            body_from_camera: place(&description.camera),
            lidar: LidarMotor { rotation_hz: description.rotation_hz, tilt_rad: description.tilt_rad },
        };
        let rotors = place_rotors(&tree, &poses, &description);
        check_hover(description.kind, &rotors, mass.mass_kg)?;
        let legs = description.legs.iter().map(|leg| Leg::new(&tree, leg)).collect();
        let frames = tree.links().iter().zip(&poses).map(|(link, pose)| (link.name.clone(), *pose)).collect();
        Ok(RobotModel {
            name,
            kind: description.kind,
            mass_kg: mass.mass_kg,
            center_of_mass: mass.center_of_mass,
            inertia: mass.inertia,
            stance_height_m: -space.height_span_m.0,
            footprint: space.footprint,
            height_span_m: space.height_span_m,
            circumscribed_radius_m: space.circumscribed_radius_m,
            inscribed_radius_m: space.inscribed_radius_m,
            bounding_sphere_radius_m: space.bounding_sphere_radius_m,
            collision_shapes,
            frames,
            sensors,
            limits: description.limits,
            rotors,
            drag: description.drag,
            legs,
            tree,
            stance,
        })
    }

    /// Pose of every link in the body frame with the named joints at the given angles and all others in the stance.
    ///
    /// # Errors
    /// A name that is not a moving joint, or an angle that is not finite. Limits are not enforced.
    pub fn frames_at(&self, angles: &BTreeMap<String, f64>) -> Result<BTreeMap<String, Isometry3<f64>>, AnglesError> {
        let joints = self.tree.moving_joints().iter().map(|joint| self.tree.joints()[*joint].name.clone());
        let mut named: BTreeMap<String, f64> = joints.zip(self.stance.iter().copied()).collect();
        named.extend(angles.iter().map(|(name, angle)| (name.clone(), *angle)));
        let poses = self.tree.body_from_links(&self.tree.angles_from(&named)?)?;
        Ok(self.tree.links().iter().zip(poses).map(|(link, pose)| (link.name.clone(), pose)).collect())
    }

    /// Sum of the largest thrusts of all rotors, N; 0 for a ground robot.
    pub fn max_thrust_n(&self) -> f64 {
        self.rotors.iter().map(|rotor| rotor.thrust_n(rotor.max_speed_radps)).sum()
    }
}

fn whole_mass(tree: &KinematicTree, poses: &[Isometry3<f64>], description: &Description) -> MassProperties {
    let links = tree.links().iter().zip(poses).map(|(link, pose)| link.mass.in_frame(pose));
    let payload = description.payload.iter().map(|payload| {
        let body_from_payload = poses[payload.mount.link] * payload.mount.link_from_mount;
        payload.geometry.filled(payload.mass_kg).in_frame(&body_from_payload)
    });
    MassProperties::combined(&links.chain(payload).collect::<Vec<_>>())
}

fn place_rotors(tree: &KinematicTree, poses: &[Isometry3<f64>], description: &Description) -> Vec<Rotor> {
    let Some(constants) = description.rotor else {
        return Vec::new();
    };
    let place = |entry: &description::RotorEntry| Rotor {
        link: tree.links()[entry.link].name.clone(),
        body_from_rotor: poses[entry.link],
        direction: entry.direction,
        thrust_coefficient_n_s2: constants.thrust_coefficient_n_s2,
        moment_ratio_m: constants.moment_ratio_m,
        max_speed_radps: constants.max_speed_radps,
        time_constant_up_s: constants.time_constant_up_s,
        time_constant_down_s: constants.time_constant_down_s,
        radius_m: entry.radius_m,
    };
    description.rotors.iter().map(place).collect()
}

fn check_hover(kind: RobotKind, rotors: &[Rotor], mass_kg: f64) -> Result<(), ModelError> {
    let lift = |rotor: &Rotor| rotor.thrust_n(rotor.max_speed_radps) * (rotor.body_from_rotor * Vector3::z()).z;
    let thrust_n: f64 = rotors.iter().map(lift).sum();
    let weight_n = mass_kg * GRAVITY_MPS2;
    if kind == RobotKind::Aerial && thrust_n <= weight_n {
        return Err(ModelError::CannotHover { thrust_n, weight_n });
    }
    Ok(())
}
