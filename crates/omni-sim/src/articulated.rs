//! A robot of several bodies on motors, on a flat floor, with all its forces: rapier's multibody behind plain records.
//!
//! Each motor is a spring and a damper toward a target angle and a target speed, cut to the torque the joint can bear:
//!
//! ```text
//! torque = clamp(k (q_target - q) + d (q'_target - q'), -max, max)          solved implicitly, so stiff motors do not ring
//! ```
//!
//! The simulated robots of the other modules are kinematic bases: fast, and enough to test a mission. This one falls over when its
//! legs do not hold it. All conversions to rapier's types of joints are in this file; shapes are [`crate::contact`]'s.

use crate::contact::{CollisionShape, robot_collider, world_group};
use nalgebra::{Isometry3, Matrix3, Point3, Unit, UnitQuaternion, Vector3};
use rapier3d::math::{Pose, Vector};
use rapier3d::prelude::{
    BroadPhaseBvh, CCDSolver, ColliderBuilder, ColliderHandle, ColliderSet, GenericJoint, GenericJointBuilder,
    ImpulseJointSet, IntegrationParameters, IslandManager, JointAxesMask, JointAxis, MassProperties, MotorModel,
    MultibodyJointHandle, MultibodyJointSet, NarrowPhase, PhysicsPipeline, RigidBodyBuilder, RigidBodyHandle,
    RigidBodySet, SoftBodySet,
};

/// One body. Its frame is the frame of the joint that moves it.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkRecord {
    /// What it hangs on; `None` for the first body, which is free.
    pub joint: Option<HingeRecord>,
    /// Mass, more than 0.
    pub mass_kg: f64,
    /// Centre of mass in the body.
    pub center_of_mass: Point3<f64>,
    /// About the centre of mass, along the axes of the body, kg m^2.
    pub inertia_kgm2: Matrix3<f64>,
    /// What touches the floor.
    pub shapes: Vec<CollisionShape>,
}

/// A motor between a body and one before it.
#[derive(Debug, Clone, PartialEq)]
pub struct HingeRecord {
    /// Index of the body that carries the motor, less than that of the body it moves.
    pub parent: usize,
    /// The moved body at angle 0.
    pub parent_from_joint: Isometry3<f64>,
    /// In the moved body.
    pub axis: Unit<Vector3<f64>>,
    /// Smallest and largest angle, if there are any.
    pub limits_rad: Option<(f64, f64)>,
    /// Largest torque.
    pub max_torque_nm: f64,
}

/// How hard motors pull.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorGains {
    /// Torque for an angle, Nm/rad.
    pub stiffness_nm_per_rad: f64,
    /// Torque for a speed, Nm s/rad.
    pub damping_nms_per_rad: f64,
}

/// A shape that touches the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Standing {
    /// Index of the body.
    pub body: usize,
    /// Index among its shapes.
    pub shape: usize,
}

/// Why there is no such robot.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ArticulatedError {
    /// No body at all, or not one angle for each motor.
    #[error("{bodies} bodies and {angles} angles; accepted is at least one body, and an angle for each but the first")]
    Count {
        /// Bodies given.
        bodies: usize,
        /// Angles given.
        angles: usize,
    },
    /// The first body hangs on something, or another one on nothing or on a body that comes after it.
    #[error("body {body} must {}", if *body == 0 { "hang on nothing" } else { "hang on a body before it" })]
    Order {
        /// Its index.
        body: usize,
    },
    /// A mass, inertia, pose, angle or limit that is not finite or impossible.
    #[error("body {body} has a number that is not finite, or a mass or torque that is not positive")]
    Number {
        /// Its index.
        body: usize,
    },
    /// A shape that is flat, empty or not finite.
    #[error("shape {shape} of body {body} is flat, empty or not finite")]
    Shape {
        /// Index of the body.
        body: usize,
        /// Its index.
        shape: usize,
    },
    /// A step that is not positive or longer than 10 ms.
    #[error("the time step must be more than 0 and at most 0.01 s")]
    Step,
}

/// Friction of soles on a floor.
const FRICTION: f32 = 0.8;
const GRAVITY_MPS2: f32 = 9.81;

/// The bodies, their motors and the floor.
pub struct Articulated {
    pipeline: PhysicsPipeline,
    parameters: IntegrationParameters,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    rigid: RigidBodySet,
    colliders: ColliderSet,
    hinges: MultibodyJointSet,
    /// What rapier steps besides, empty here.
    others: (ImpulseJointSet, SoftBodySet, CCDSolver),
    bodies: Vec<RigidBodyHandle>,
    /// Of each body but the first.
    joints: Vec<MultibodyJointHandle>,
    floor: ColliderHandle,
    shapes: Vec<(ColliderHandle, Standing)>,
}

impl std::fmt::Debug for Articulated {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Articulated").field("bodies", &self.bodies.len()).finish_non_exhaustive()
    }
}

impl Articulated {
    /// At rest at `world_from_first` with motors at `angles` (one for each body but the first), over a floor of height `floor_z_m`.
    ///
    /// # Errors
    /// See [`ArticulatedError`].
    pub fn new(
        records: &[LinkRecord],
        world_from_first: &Isometry3<f64>,
        angles: &[f64],
        floor_z_m: f64,
    ) -> Result<Articulated, ArticulatedError> {
        if records.is_empty() || angles.len() + 1 != records.len() {
            return Err(ArticulatedError::Count { bodies: records.len(), angles: angles.len() });
        }
        let (mut rigid, mut colliders, mut hinges) =
            (RigidBodySet::new(), ColliderSet::new(), MultibodyJointSet::new());
        let (mut bodies, mut joints, mut shapes) = (Vec::new(), Vec::new(), Vec::new());
        for (body, record) in records.iter().enumerate() {
            record.check(body, angles)?;
            let com = record.center_of_mass;
            let inertia = rapier3d::math::Matrix::from_cols_array_2d(&record.inertia_kgm2.cast::<f32>().into());
            let com = Vector::new(com.x as f32, com.y as f32, com.z as f32);
            let mass = MassProperties::with_inertia_matrix(com, record.mass_kg as f32, inertia);
            let builder = RigidBodyBuilder::dynamic().additional_mass_properties(mass).can_sleep(false);
            let builder = if body == 0 { builder.pose(pose(world_from_first)) } else { builder };
            let handle = rigid.insert(builder);
            for (shape, solid) in record.shapes.iter().enumerate() {
                let mut collider = robot_collider(solid).ok_or(ArticulatedError::Shape { body, shape })?;
                collider.set_density(0.0);
                collider.set_friction(FRICTION);
                let collider = colliders.insert_with_parent(collider, handle, &mut rigid);
                shapes.push((collider, Standing { body, shape }));
            }
            bodies.push(handle);
            if let Some(hinge) = &record.joint {
                let joint = hinges.insert(bodies[hinge.parent], handle, hinge.joint(), true);
                joints.push(joint.ok_or(ArticulatedError::Order { body })?);
            }
        }
        let floor = ColliderBuilder::cuboid(500.0, 500.0, 1.0)
            .translation(Vector::new(0.0, 0.0, floor_z_m as f32 - 1.0))
            .friction(FRICTION);
        let floor = colliders.insert(world_group(floor));
        let parameters = IntegrationParameters { num_solver_iterations: 8, ..IntegrationParameters::default() };
        let mut robot = Articulated {
            pipeline: PhysicsPipeline::new(),
            parameters,
            islands: IslandManager::new(),
            broad_phase: BroadPhaseBvh::new(),
            narrow_phase: NarrowPhase::new(),
            rigid,
            colliders,
            hinges,
            others: (ImpulseJointSet::new(), SoftBodySet::new(), CCDSolver::new()),
            bodies,
            joints,
            floor,
            shapes,
        };
        robot.bend(angles);
        Ok(robot)
    }

    /// Puts the motors at angles, the first body where it is.
    fn bend(&mut self, angles: &[f64]) {
        let Some(first) = self.joints.first() else { return };
        let Some((multibody, _)) = self.hinges.get_mut(*first) else { return };
        // The order of coordinates is rapier's: ask each link for its own.
        let mut moved = vec![0.0; 6 + angles.len()];
        for (handle, angle) in self.bodies[1..].iter().zip(angles) {
            let link = multibody.links().find(|link| link.rigid_body_handle() == *handle);
            if let Some(slot) = link.and_then(|link| moved.get_mut(link.assembly_id())) {
                *slot = *angle as f32;
            }
        }
        multibody.forward_kinematics(&self.rigid, true);
        multibody.apply_displacements(&moved);
        multibody.forward_kinematics(&self.rigid, false);
        multibody.update_rigid_bodies(&mut self.rigid, true);
    }

    /// What the motors are to do from now on: an angle and a speed for each.
    pub fn drive(&mut self, targets: &[(f64, f64)], gains: &MotorGains) {
        for (handle, (angle, speed)) in self.joints.iter().zip(targets) {
            if let Some((multibody, id)) = self.hinges.get_mut(*handle)
                && let Some(link) = multibody.link_mut(id)
            {
                let (stiffness, damping) = (gains.stiffness_nm_per_rad as f32, gains.damping_nms_per_rad as f32);
                link.joint.data.set_motor(JointAxis::AngX, *angle as f32, *speed as f32, stiffness, damping);
            }
        }
    }

    /// A blow against the first body: so much faster from now on.
    pub fn push(&mut self, change_mps: &Vector3<f64>) {
        let Some(first) = self.joints.first() else { return };
        if let Some((multibody, _)) = self.hinges.get_mut(*first) {
            // The first three coordinates of the free body are its place in the world.
            multibody.generalized_velocity_mut().iter_mut().zip(change_mps.iter()).for_each(|(v, d)| *v += *d as f32);
        }
    }

    /// Lets `dt_s` pass.
    ///
    /// # Errors
    /// [`ArticulatedError::Step`].
    pub fn step(&mut self, dt_s: f64) -> Result<(), ArticulatedError> {
        if !(dt_s > 0.0 && dt_s <= 0.01) {
            return Err(ArticulatedError::Step);
        }
        self.parameters.dt = dt_s as f32;
        self.pipeline.step(
            Vector::new(0.0, 0.0, -GRAVITY_MPS2),
            &self.parameters,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.rigid,
            &mut self.colliders,
            &mut self.others.0,
            &mut self.hinges,
            &mut self.others.1,
            &mut self.others.2,
            &(),
            &(),
        );
        Ok(())
    }

    /// Pose of a body.
    pub fn world_from_body(&self, body: usize) -> Isometry3<f64> {
        let found = self.bodies.get(body).and_then(|handle| self.rigid.get(*handle));
        found.map_or(Isometry3::identity(), |body| Isometry3::<f32>::from(*body.position()).cast())
    }

    /// Velocity of the centre of mass of the first body in the world, and how it turns there.
    pub fn velocity(&self) -> (Vector3<f64>, Vector3<f64>) {
        let first = self.rigid.get(self.bodies[0]);
        let vector = |v: Vector| Vector3::new(v.x, v.y, v.z).cast();
        first.map_or((Vector3::zeros(), Vector3::zeros()), |body| (vector(body.linvel()), vector(body.angvel())))
    }

    /// Angles of the motors.
    pub fn angles(&self) -> Vec<f64> {
        let angle = |handle: &MultibodyJointHandle| {
            let (multibody, id) = self.hinges.get(*handle)?;
            Some(f64::from(multibody.link(id)?.joint.coords()[3]))
        };
        self.joints.iter().map(|handle| angle(handle).unwrap_or(0.0)).collect()
    }

    /// What touches the floor, in the order of the records.
    pub fn standing(&self) -> Vec<Standing> {
        let touching = |collider: ColliderHandle| {
            self.narrow_phase.contact_pair(collider, self.floor).is_some_and(|pair| pair.has_any_active_contact())
        };
        self.shapes.iter().filter(|(collider, _)| touching(*collider)).map(|(_, standing)| *standing).collect()
    }
}

impl LinkRecord {
    fn check(&self, body: usize, angles: &[f64]) -> Result<(), ArticulatedError> {
        let order = match &self.joint {
            None => body == 0,
            Some(hinge) => hinge.parent < body,
        };
        if !order {
            return Err(ArticulatedError::Order { body });
        }
        let mut numbers = self.center_of_mass.iter().chain(self.inertia_kgm2.iter());
        let is_good = self.mass_kg > 0.0 && self.mass_kg.is_finite() && numbers.all(|x| x.is_finite());
        let is_hinge_good = self.joint.as_ref().is_none_or(|hinge| {
            let (low, high) = hinge.limits_rad.unwrap_or((-1.0, 1.0));
            hinge.max_torque_nm > 0.0
                && hinge.max_torque_nm.is_finite()
                && low <= high
                && low.is_finite()
                && high.is_finite()
                && hinge.parent_from_joint.to_homogeneous().iter().all(|x| x.is_finite())
                && angles.get(body - 1).is_some_and(|angle| angle.is_finite())
        });
        if is_good && is_hinge_good { Ok(()) } else { Err(ArticulatedError::Number { body }) }
    }
}

impl HingeRecord {
    fn joint(&self) -> GenericJoint {
        // rapier's hinge turns about x of both joint frames.
        let body_from_hinge = UnitQuaternion::rotation_between(&Vector3::x(), &self.axis)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI));
        let body_from_hinge = Isometry3::from_parts(Default::default(), body_from_hinge);
        let builder = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
            .local_frame1(pose(&(self.parent_from_joint * body_from_hinge)))
            .local_frame2(pose(&body_from_hinge))
            .motor_model(JointAxis::AngX, MotorModel::ForceBased)
            .motor_max_force(JointAxis::AngX, self.max_torque_nm as f32);
        match self.limits_rad {
            Some((low, high)) => builder.limits(JointAxis::AngX, [low as f32, high as f32]).build(),
            None => builder.build(),
        }
    }
}

fn pose(iso: &Isometry3<f64>) -> Pose {
    iso.cast::<f32>().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::ShapeGeometry;

    fn ball(radius_m: f64) -> CollisionShape {
        CollisionShape { body_from_shape: Isometry3::identity(), geometry: ShapeGeometry::Sphere { radius_m } }
    }

    fn body(mass_kg: f64, joint: Option<HingeRecord>, shapes: Vec<CollisionShape>) -> LinkRecord {
        let inertia_kgm2 = Matrix3::identity() * (0.01 * mass_kg);
        LinkRecord { joint, mass_kg, center_of_mass: Point3::origin(), inertia_kgm2, shapes }
    }

    /// An arm of 0.5 m with a weight at its end, on a block so heavy that it does not move.
    fn arm(max_torque_nm: f64) -> Vec<LinkRecord> {
        let block = CollisionShape {
            body_from_shape: Isometry3::identity(),
            geometry: ShapeGeometry::Box { half_m: Vector3::new(1.0, 1.0, 0.5) },
        };
        let hinge = HingeRecord {
            parent: 0,
            parent_from_joint: Isometry3::translation(0.0, 0.0, 2.0),
            axis: Vector3::y_axis(),
            limits_rad: Some((-3.0, 3.0)),
            max_torque_nm,
        };
        let mut weight = body(1.0, Some(hinge), Vec::new());
        weight.center_of_mass = Point3::new(0.5, 0.0, 0.0);
        vec![LinkRecord { inertia_kgm2: Matrix3::identity() * 1e4, ..body(1e5, None, vec![block]) }, weight]
    }

    const STIFF: MotorGains = MotorGains { stiffness_nm_per_rad: 500.0, damping_nms_per_rad: 20.0 };

    fn after(records: &[LinkRecord], angle: f64, target: f64, seconds: f64) -> Articulated {
        let mut robot =
            Articulated::new(records, &Isometry3::translation(0.0, 0.0, 0.5), &[angle], 0.0).expect("sound");
        robot.drive(&[(target, 0.0)], &STIFF);
        for _ in 0..(seconds / 0.002) as usize {
            robot.step(0.002).expect("a good step");
        }
        robot
    }

    #[test]
    fn a_motor_sags_by_torque_over_stiffness() {
        // 1 kg at 0.5 m: 4.905 Nm, over 500 Nm/rad. About y a weight ahead turns the arm down, which is positive.
        let angle = after(&arm(10.0), 0.0, 0.0, 2.0).angles()[0];
        assert!((angle - 4.905 / 500.0).abs() < 5e-4, "{angle}");
    }

    #[test]
    fn a_motor_too_weak_lets_go() {
        // 3 Nm hold the arm where 4.905 cos(angle) = 3; it comes from above and swings past, so only falling is asked.
        let angle = after(&arm(3.0), 0.0, 0.0, 0.6).angles()[0];
        assert!(angle > 0.3, "{angle}");
        let held = after(&arm(5.5), 0.0, 0.0, 0.6).angles()[0];
        assert!(held < 0.05, "{held}");
    }

    #[test]
    fn angles_and_poses_agree() {
        let robot = Articulated::new(&arm(10.0), &Isometry3::translation(1.0, 2.0, 0.5), &[0.4], 0.0).expect("sound");
        let expected = Isometry3::translation(1.0, 2.0, 2.5) * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.4);
        let off = expected.inverse() * robot.world_from_body(1);
        assert!(off.translation.vector.norm() < 1e-5 && off.rotation.angle() < 1e-3, "{off}");
        assert!((robot.angles()[0] - 0.4).abs() < 1e-6);
    }

    #[test]
    fn a_ball_falls_and_stands() {
        let mut robot =
            Articulated::new(&[body(2.0, None, vec![ball(0.1)])], &Isometry3::translation(0.0, 0.0, 1.1), &[], 0.0)
                .expect("sound");
        for _ in 0..100 {
            robot.step(0.002).expect("a good step");
        }
        // 0.2 s: 9.81 * 0.04 / 2.
        let fallen_m = 1.1 - robot.world_from_body(0).translation.z;
        assert!((fallen_m - 0.1962).abs() < 0.003 && robot.standing().is_empty(), "{fallen_m}");
        for _ in 0..1000 {
            robot.step(0.002).expect("a good step");
        }
        assert!((robot.world_from_body(0).translation.z - 0.1).abs() < 0.003);
        assert_eq!(robot.standing(), vec![Standing { body: 0, shape: 0 }]);
    }

    #[test]
    fn bad_records_are_refused() {
        let at = Isometry3::identity();
        let check = |records: &[LinkRecord], angles: &[f64], expected: ArticulatedError| {
            assert_eq!(Articulated::new(records, &at, angles, 0.0).err(), Some(expected));
        };
        check(&[], &[], ArticulatedError::Count { bodies: 0, angles: 0 });
        check(&arm(1.0), &[], ArticulatedError::Count { bodies: 2, angles: 0 });
        check(&arm(1.0), &[f64::NAN], ArticulatedError::Number { body: 1 });
        check(&arm(-1.0), &[0.0], ArticulatedError::Number { body: 1 });
        check(&[body(0.0, None, Vec::new())], &[], ArticulatedError::Number { body: 0 });
        check(&[body(1.0, None, vec![ball(0.0)])], &[], ArticulatedError::Shape { body: 0, shape: 0 });
        let mut late = arm(1.0);
        late[1].joint.as_mut().expect("a hinge").parent = 1;
        check(&late, &[0.0], ArticulatedError::Order { body: 1 });
        let mut robot = Articulated::new(&[body(1.0, None, Vec::new())], &at, &[], 0.0).expect("sound");
        assert_eq!(robot.step(0.5), Err(ArticulatedError::Step));
        assert_eq!(robot.step(f64::NAN), Err(ArticulatedError::Step));
    }
}
