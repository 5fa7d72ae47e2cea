//! Contacts of a robot with the world, decided by rapier's collision pipeline.
//!
//! rapier holds the static mesh as one triangle mesh, each mover as another, and the robot's collision shapes on one
//! kinematic body. [`ContactWorld::contacts`] puts the body and the movers where they are and reads the contact manifolds.
//! Nothing is integrated by rapier; what a contact does to the motion is decided in [`crate::ground_base`] and
//! [`crate::quadrotor`]. All conversions to rapier's types are in this file.

pub use crate::touch::TouchCounter;

use crate::mesh::{InstanceId, TriangleMesh};
use crate::world::World;
use nalgebra::{Isometry3, Point3, Vector3};
use rapier3d::math::{Pose, Vector};
use rapier3d::pipeline::CollisionPipeline;
use rapier3d::prelude::{
    ActiveCollisionTypes, BroadPhaseBvh, Collider, ColliderBuilder, ColliderHandle, ColliderSet, ContactManifold,
    Group, InteractionGroups, InteractionTestMode, IslandManager, NarrowPhase, PairContacts, RigidBodyBuilder,
    RigidBodyHandle, RigidBodySet, TriMeshFlags,
};
use thiserror::Error;

/// A solid on the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct CollisionShape {
    /// Pose of the shape in the body.
    pub body_from_shape: Isometry3<f64>,
    /// What it is.
    pub geometry: ShapeGeometry,
}

/// Convex solids.
#[derive(Debug, Clone, PartialEq)]
pub enum ShapeGeometry {
    /// A box by its half sizes.
    Box {
        /// Half of the size along x, y and z.
        half_m: Vector3<f64>,
    },
    /// A cylinder about the shape's z axis, as in URDF.
    Cylinder {
        /// Radius.
        radius_m: f64,
        /// Half of the length along z.
        half_length_m: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius_m: f64,
    },
    /// The convex hull of points.
    ConvexHull {
        /// At least four points that do not lie in a plane.
        points: Vec<Point3<f64>>,
    },
}

/// The robot and a thing in one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Time of the query.
    pub stamp_ns: i64,
    /// What is touched; 0 is the structure.
    pub instance: InstanceId,
    /// Where, in the world frame, on the thing.
    pub point: Point3<f64>,
    /// Unit vector from the thing towards the robot.
    pub normal: Vector3<f64>,
    /// How deep the robot is in the thing, positive.
    pub depth_m: f64,
}

/// Why contacts cannot be computed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ContactError {
    /// The robot has no collision shape.
    #[error("the robot has no collision shape")]
    NoShape,
    /// A shape is flat, empty or not finite.
    #[error("collision shape {index} is flat, empty or not finite")]
    Shape {
        /// Its index.
        index: usize,
    },
    /// rapier refuses the mesh of the world or of a mover.
    #[error("a mesh cannot be used for contacts")]
    Mesh,
}

/// Contacts of one robot with one world.
pub struct ContactWorld {
    pipeline: CollisionPipeline,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    robot: RigidBodyHandle,
    robot_colliders: Vec<ColliderHandle>,
    /// Instance of each triangle of the static mesh.
    static_instances: Vec<InstanceId>,
    movers: Vec<Moving>,
    static_collider: Option<ColliderHandle>,
    reach_m: f64,
}

impl std::fmt::Debug for ContactWorld {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ContactWorld")
            .field("shapes", &self.robot_colliders.len())
            .field("movers", &self.movers.len())
            .finish_non_exhaustive()
    }
}

/// A mover, and what rapier has of it.
struct Moving {
    /// Its number in the world.
    number: usize,
    body: RigidBodyHandle,
    collider: ColliderHandle,
    mover: crate::mesh::Mover,
}

const WORLD: Group = Group::GROUP_1;
const ROBOT: Group = Group::GROUP_2;

impl ContactWorld {
    /// Puts a robot into a world. Instances in `ignored` (such as the robot's own moving legs) are never touched.
    pub fn new(world: &World, shapes: &[CollisionShape], ignored: &[InstanceId]) -> Result<ContactWorld, ContactError> {
        if shapes.is_empty() {
            return Err(ContactError::NoShape);
        }
        let mut bodies = RigidBodySet::new();
        let mut colliders = ColliderSet::new();
        let robot = bodies.insert(RigidBodyBuilder::kinematic_position_based());
        let mut robot_colliders = Vec::with_capacity(shapes.len());
        let mut reach_m: f64 = 0.0;
        for (index, shape) in shapes.iter().enumerate() {
            let collider = robot_collider(shape).ok_or(ContactError::Shape { index })?;
            let aabb = collider.compute_aabb();
            let corner = aabb.mins.abs().max(aabb.maxs.abs());
            reach_m = reach_m.max(f64::from(corner.length()));
            robot_colliders.push(colliders.insert_with_parent(collider, robot, &mut bodies));
        }
        let (kept, static_instances) = without(world.static_mesh(), ignored);
        let static_collider = match kept.faces.is_empty() {
            true => None,
            false => Some(colliders.insert(mesh_collider(&kept)?)),
        };
        let mut movers = Vec::new();
        for (number, mover) in world.movers().enumerate() {
            if ignored.contains(&mover.instance) || mover.mesh.faces.is_empty() {
                continue;
            }
            let start = pose(&mover.path[0].1);
            let body = bodies.insert(RigidBodyBuilder::kinematic_position_based().pose(start));
            let collider = colliders.insert_with_parent(mesh_collider(&mover.mesh)?, body, &mut bodies);
            movers.push(Moving { number, body, collider, mover: mover.clone() });
        }
        Ok(ContactWorld {
            pipeline: CollisionPipeline::new(),
            islands: IslandManager::new(),
            broad_phase: BroadPhaseBvh::new(),
            narrow_phase: NarrowPhase::new(),
            bodies,
            colliders,
            robot,
            robot_colliders,
            static_instances,
            movers,
            static_collider,
            reach_m,
        })
    }

    /// All places where the robot at `world_from_body` is in something at `stamp_ns`, the deepest first; empty when the pose
    /// is not finite.
    pub fn contacts(&mut self, world_from_body: &Isometry3<f64>, stamp_ns: i64) -> Vec<Contact> {
        let finite = world_from_body.to_homogeneous().iter().all(|x| x.is_finite());
        if !finite {
            return Vec::new();
        }
        if let Some(body) = self.bodies.get_mut(self.robot) {
            body.set_position(pose(world_from_body), true);
        }
        for moving in &self.movers {
            let target = pose(&moving.mover.pose_at(stamp_ns));
            if let Some(body) = self.bodies.get_mut(moving.body)
                && *body.position() != target
            {
                body.set_position(target, true);
            }
        }
        self.pipeline.step(
            PREDICTION_M,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &(),
            &(),
        );
        let mut contacts = Vec::new();
        for &shape in &self.robot_colliders {
            for pair in self.narrow_phase.contact_pairs_with(shape) {
                let PairContacts::Rigid(rigid) = &pair.contacts else {
                    continue;
                };
                let robot_is_first = pair.collider1 == shape;
                let other = if robot_is_first { pair.collider2 } else { pair.collider1 };
                for manifold in &rigid.manifolds {
                    self.read_manifold(manifold, shape, other, robot_is_first, stamp_ns, &mut contacts);
                }
            }
        }
        contacts.sort_by(|a: &Contact, b| {
            let key = |c: &Contact| (c.instance, c.point.x, c.point.y, c.point.z);
            b.depth_m.total_cmp(&a.depth_m).then(key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal))
        });
        contacts
    }

    /// A mover goes on, as in the world ([`World::go_on`]).
    pub fn go_on(&mut self, mover: usize, stamp_ns: i64, pose: Isometry3<f64>, keep_ns: i64) {
        if let Some(moving) = self.movers.iter_mut().find(|moving| moving.number == mover) {
            moving.mover.go_on(stamp_ns, pose, keep_ns);
        }
    }

    /// Radius of a ball about the body's origin that holds all shapes.
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    fn read_manifold(
        &self,
        manifold: &ContactManifold,
        shape: ColliderHandle,
        other: ColliderHandle,
        robot_is_first: bool,
        stamp_ns: i64,
        contacts: &mut Vec<Contact>,
    ) {
        let subshape = if robot_is_first { manifold.subshape2 } else { manifold.subshape1 };
        let Some(instance) = self.instance_of(other, subshape) else {
            return;
        };
        let (Some(thing), Some(robot)) = (self.colliders.get(other), self.colliders.get(shape)) else {
            return;
        };
        // Normals point out of their shape; the thing's one points towards the robot.
        let normal = thing.position().rotation * if robot_is_first { manifold.local_n2 } else { manifold.local_n1 };
        for point in manifold.points.iter().filter(|p| p.dist < 0.0) {
            let local = if robot_is_first { point.local_p2 } else { point.local_p1 };
            let in_world = thing.position().transform_point(local);
            // Deep in a thin wall the normal may point through it: the robot's own centre says which side is out.
            let outward = (robot.position().translation - in_world).dot(normal);
            let normal = if outward < 0.0 && -point.dist > 0.02 { -normal } else { normal };
            contacts.push(Contact {
                stamp_ns,
                instance,
                point: Point3::new(in_world.x, in_world.y, in_world.z).cast(),
                normal: Vector3::new(normal.x, normal.y, normal.z).cast(),
                depth_m: f64::from(-point.dist),
            });
        }
    }

    fn instance_of(&self, collider: ColliderHandle, triangle: u32) -> Option<InstanceId> {
        if Some(collider) == self.static_collider {
            return self.static_instances.get(triangle as usize).copied();
        }
        let moving = self.movers.iter().find(|moving| moving.collider == collider);
        moving.map(|moving| moving.mover.instance)
    }
}

/// Pairs nearer than this are looked at; only what penetrates is reported.
const PREDICTION_M: f32 = 0.002;

fn pose(iso: &Isometry3<f64>) -> Pose {
    iso.cast::<f32>().into()
}

fn vector(v: &Point3<f64>) -> Vector {
    Vector::new(v.x as f32, v.y as f32, v.z as f32)
}

/// Only pairs of robot and world are ever computed.
fn grouped(builder: ColliderBuilder, own: Group, other: Group) -> Collider {
    builder
        .active_collision_types(ActiveCollisionTypes::all())
        .collision_groups(InteractionGroups::new(own, other, InteractionTestMode::And))
        .build()
}

/// `None` for a shape without volume or with NaN.
pub(crate) fn robot_collider(shape: &CollisionShape) -> Option<Collider> {
    let good = |x: f64| x.is_finite() && x > 1e-6;
    if !shape.body_from_shape.to_homogeneous().iter().all(|x| x.is_finite()) {
        return None;
    }
    let mut placed = shape.body_from_shape;
    let builder = match &shape.geometry {
        ShapeGeometry::Box { half_m } => half_m
            .iter()
            .all(|x| good(*x))
            .then(|| ColliderBuilder::cuboid(half_m.x as f32, half_m.y as f32, half_m.z as f32))?,
        ShapeGeometry::Cylinder { radius_m, half_length_m } => {
            // rapier's cylinders stand along y: a quarter turn about x takes y to z.
            placed *= Isometry3::rotation(Vector3::x() * std::f64::consts::FRAC_PI_2);
            (good(*radius_m) && good(*half_length_m))
                .then(|| ColliderBuilder::cylinder(*half_length_m as f32, *radius_m as f32))?
        }
        ShapeGeometry::Sphere { radius_m } => good(*radius_m).then(|| ColliderBuilder::ball(*radius_m as f32))?,
        ShapeGeometry::ConvexHull { points } => {
            if points.len() < 4 || !points.iter().flat_map(|p| p.iter()).all(|x| x.is_finite()) {
                return None;
            }
            let (first, rest) = points.split_first()?;
            let mut spread = nalgebra::Matrix3::zeros();
            for p in rest {
                let d = p - first;
                spread += d * d.transpose();
            }
            // Points in a plane have no hull with a volume.
            if spread.symmetric_eigenvalues().min() < 1e-12 {
                return None;
            }
            let points: Vec<Vector> = points.iter().map(vector).collect();
            ColliderBuilder::convex_hull(&points)?
        }
    };
    Some(grouped(builder.position(pose(&placed)), ROBOT, WORLD))
}

/// A part of the world that no mesh is needed for.
pub(crate) fn world_group(builder: ColliderBuilder) -> Collider {
    grouped(builder, WORLD, ROBOT)
}

fn mesh_collider(mesh: &TriangleMesh) -> Result<Collider, ContactError> {
    let vertices = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
    // Flags would renumber the triangles; contacts are two-sided as they are.
    let builder = ColliderBuilder::trimesh_with_flags(vertices, mesh.faces.clone(), TriMeshFlags::empty());
    let builder = builder.map_err(|_| ContactError::Mesh)?;
    Ok(grouped(builder, WORLD, ROBOT))
}

/// The mesh without the triangles of some instances and without triangles of no area, and the instance of what is left.
fn without(mesh: &TriangleMesh, ignored: &[InstanceId]) -> (TriangleMesh, Vec<InstanceId>) {
    let mut kept = TriangleMesh { vertices: mesh.vertices.clone(), ..TriangleMesh::default() };
    for (face, instance) in mesh.faces.iter().zip(&mesh.instances) {
        let [a, b, c] = face.map(|i| mesh.vertices[i as usize]);
        let area = (b - a).cross(&(c - a)).norm();
        if !ignored.contains(instance) && area > 1e-10 {
            kept.faces.push(*face);
            kept.instances.push(*instance);
        }
    }
    let instances = std::mem::take(&mut kept.instances);
    (kept, instances)
}
