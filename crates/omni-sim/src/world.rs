//! What can be seen and touched: the static mesh, the movers at any time, and what each instance is called.
//!
//! [`World::ray`] answers one ray; sensors take a [`Snapshot`] (the movers' poses at one time) and cast many. Every
//! triangle of the world has one number, its *surface*: static triangles first, then those of each mover.

mod check;
mod facet;

pub use check::WorldError;

use crate::building::Building;
use crate::bvh::{Bvh, RayStack};
use crate::mesh::{InstanceId, Mover, TriangleMesh};
use crate::noise::NoiseKey;
use check::{check_mesh, check_mover};
use nalgebra::{Isometry3, Point3, Vector3};
use std::collections::BTreeMap;

/// What a viewer would say about an instance. Instance 0 (the structure) needs no entry.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Thing {
    /// The instance of its triangles.
    pub instance: InstanceId,
    /// Class, as a segmenter names it ("mug").
    pub class: String,
    /// Name of its colour ("white"); may be empty.
    pub color: String,
    /// A sentence or two about it.
    pub caption: String,
}

/// The first thing a ray meets.
#[derive(Debug, Clone, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin.
    pub distance_m: f64,
    /// Where the ray meets the surface, in the world frame.
    pub point: Point3<f64>,
    /// Unit normal of the triangle, turned against the ray, in the world frame.
    pub normal: Vector3<f64>,
    /// What was hit; 0 is the structure.
    pub instance: InstanceId,
    /// The triangle's number in the whole world: static triangles first, then those of the movers.
    pub triangle: u32,
}

/// Triangles, movers and names.
#[derive(Debug, Clone)]
pub struct World {
    static_mesh: TriangleMesh,
    static_bvh: Bvh,
    movers: Vec<MovingMesh>,
    things: Vec<Thing>,
    surfaces: Vec<Surface>,
    extents: Vec<Extent>,
}

#[derive(Debug, Clone)]
struct MovingMesh {
    mover: Mover,
    bvh: Bvh,
    /// A ball that holds the mesh, in the mover's frame.
    center: Point3<f32>,
    radius: f32,
    /// Surface number of its first triangle.
    first_surface: u32,
}

/// What shading and segmentation need of a triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    /// Unit normal in the frame of its mesh.
    pub normal: Vector3<f32>,
    pub instance: InstanceId,
    /// Coplanar triangles of one instance and colour share a facet.
    pub facet: u32,
    pub color: [u8; 3],
}

/// Where the triangles of one instance and mesh are, in the frame of that mesh.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    pub instance: InstanceId,
    /// `None` for static triangles, else the index of the mover.
    pub mover: Option<usize>,
    pub low: Point3<f32>,
    pub high: Point3<f32>,
    /// Address of this thing's random numbers: made of its class and place, not of its instance number, so that
    /// renumbering the instances changes no draw.
    pub noise: NoiseKey,
}

impl World {
    /// Checks the input and builds the trees (about 100 ms for 50 000 triangles). Movers with one key pose never move:
    /// their triangles are added to the static mesh.
    pub fn new(mut static_mesh: TriangleMesh, movers: Vec<Mover>, mut things: Vec<Thing>) -> Result<World, WorldError> {
        check_mesh(&static_mesh)?;
        movers.iter().try_for_each(check_mover)?;
        things.sort_by_key(|t| t.instance);
        if let Some(pair) = things.windows(2).find(|w| w[0].instance == w[1].instance) {
            return Err(WorldError::DescribedTwice { instance: pair[0].instance });
        }
        let total = static_mesh.faces.len() + movers.iter().map(|m| m.mesh.faces.len()).sum::<usize>();
        if total >= 1 << 31 {
            return Err(WorldError::TooLarge);
        }

        let (still, movers): (Vec<Mover>, Vec<Mover>) = movers.into_iter().partition(|m| m.path.len() == 1);
        still.iter().for_each(|mover| bake(mover, &mut static_mesh));

        let mut facets = facet::Facets::default();
        let mut surfaces = Vec::with_capacity(total);
        surfaces_of(&static_mesh, None, &mut facets, &mut surfaces);
        let static_bvh = Bvh::build(&static_mesh.vertices, &static_mesh.faces);
        let moving = movers
            .into_iter()
            .map(|mover| {
                let first_surface = surfaces.len() as u32;
                let (center, radius) = ball_of(&mover.mesh);
                surfaces_of(&mover.mesh, Some(mover.instance), &mut facets, &mut surfaces);
                MovingMesh {
                    bvh: Bvh::build(&mover.mesh.vertices, &mover.mesh.faces),
                    center,
                    radius,
                    mover,
                    first_surface,
                }
            })
            .collect();
        let mut world = World { static_mesh, static_bvh, movers: moving, things, surfaces, extents: Vec::new() };
        world.extents = world.measure_extents();
        Ok(world)
    }

    /// The world of a generated building, with its objects' classes, colours and captions.
    pub fn of_building(building: &Building) -> Result<World, WorldError> {
        let things = building.objects.iter().map(|object| Thing {
            instance: object.id,
            class: object.class.clone(),
            color: object.color.clone(),
            caption: object.caption.clone(),
        });
        World::new(building.mesh.clone(), building.movers.clone(), things.collect())
    }

    /// The same world with more things that move: people who walk, say. They come after those that were there.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn with_movers(&self, movers: Vec<Mover>, things: Vec<Thing>) -> Result<World, WorldError> {
        let movers = self.movers().cloned().chain(movers).collect();
        World::new(self.static_mesh.clone(), movers, [self.things.clone(), things].concat())
    }

    /// A mover goes on to `pose` at `stamp_ns`, by its number in [`World::movers`]; see [`Mover::go_on`].
    pub fn go_on(&mut self, mover: usize, stamp_ns: i64, pose: Isometry3<f64>, keep_ns: i64) {
        if let Some(moving) = self.movers.get_mut(mover) {
            moving.mover.go_on(stamp_ns, pose, keep_ns);
        }
    }

    /// First thing along `direction` (any length but zero) within `max_distance_m`, with the movers where they are at
    /// `stamp_ns`. `None` also for input that is not finite.
    pub fn ray(
        &self,
        origin: &Point3<f64>,
        direction: &Vector3<f64>,
        max_distance_m: f64,
        stamp_ns: i64,
    ) -> Option<Hit> {
        let unit = direction.try_normalize(1e-12)?;
        if !origin.iter().chain(unit.iter()).all(|x| x.is_finite()) {
            return None;
        }
        let snapshot = self.at(stamp_ns);
        let (distance, surface) =
            snapshot.cast(&origin.cast(), &unit.cast(), max_distance_m as f32, &mut RayStack::default())?;
        let normal: Vector3<f64> = snapshot.normal(surface).cast();
        let facing = if normal.dot(&unit) > 0.0 { -normal } else { normal };
        Some(Hit {
            distance_m: f64::from(distance),
            point: origin + unit * f64::from(distance),
            normal: facing,
            instance: self.surfaces[surface as usize].instance,
            triangle: surface,
        })
    }

    /// Whether nothing lies on the segment from `from` to `to`, apart from a hand's breadth (`slack_m`) before `to`.
    pub fn is_clear(&self, from: &Point3<f64>, to: &Point3<f64>, slack_m: f64, stamp_ns: i64) -> bool {
        let step = to - from;
        let length = step.norm();
        length <= slack_m || self.ray(from, &step, length - slack_m, stamp_ns).is_none()
    }

    /// The world with every mover where it is at `stamp_ns`.
    pub fn at(&self, stamp_ns: i64) -> Snapshot<'_> {
        Snapshot {
            world: self,
            movers: self
                .movers
                .iter()
                .map(|moving| {
                    let pose: Isometry3<f32> = moving.mover.pose_at(stamp_ns).cast();
                    PosedMover { center: pose * moving.center, pose }
                })
                .collect(),
        }
    }

    /// The instance that a surface belongs to.
    pub fn instance_of(&self, surface: u32) -> InstanceId {
        self.surfaces[surface as usize].instance
    }

    /// What was said about an instance, `None` for the structure and for instances without an entry.
    pub fn thing(&self, instance: InstanceId) -> Option<&Thing> {
        let at = self.things.binary_search_by_key(&instance, |t| t.instance);
        at.ok().map(|i| &self.things[i])
    }

    /// All things, by instance.
    pub fn things(&self) -> &[Thing] {
        &self.things
    }

    /// The triangles that do not move: those given first, then those of movers with one pose.
    pub fn static_mesh(&self) -> &TriangleMesh {
        &self.static_mesh
    }

    /// The movers with more than one pose, in the order they were given.
    pub fn movers(&self) -> impl Iterator<Item = &Mover> {
        self.movers.iter().map(|m| &m.mover)
    }

    pub(crate) fn surface(&self, surface: u32) -> &Surface {
        &self.surfaces[surface as usize]
    }

    pub(crate) fn extents(&self) -> &[Extent] {
        &self.extents
    }

    fn measure_extents(&self) -> Vec<Extent> {
        let mut extents = Vec::new();
        self.extents_of(&self.static_mesh, None, &mut extents);
        for (index, moving) in self.movers.iter().enumerate() {
            self.extents_of(&moving.mover.mesh, Some(index), &mut extents);
        }
        extents
    }

    fn extents_of(&self, mesh: &TriangleMesh, mover: Option<usize>, extents: &mut Vec<Extent>) {
        for (instance, faces) in faces_by_instance(mesh, mover.map(|m| self.movers[m].mover.instance)) {
            if instance == 0 {
                continue;
            }
            let mut low = Point3::from([f32::INFINITY; 3]);
            let mut high = Point3::from([f32::NEG_INFINITY; 3]);
            for corner in faces.iter().flat_map(|&f| mesh.faces[f]) {
                low = low.inf(&mesh.vertices[corner as usize]);
                high = high.sup(&mesh.vertices[corner as usize]);
            }
            let class = self.thing(instance).map_or("", |t| t.class.as_str());
            let start = mover.map_or(Vector3::zeros(), |m| self.movers[m].mover.path[0].1.translation.vector);
            let center: Vector3<f64> = nalgebra::center(&low, &high).coords.cast() + start;
            let noise = center
                .iter()
                .fold(NoiseKey::new(0).with_text(class), |key, x| key.with((x * 1000.0).round() as i64 as u64));
            extents.push(Extent { instance, mover, low, high, noise });
        }
    }
}

/// A world at one time.
#[derive(Debug, Clone)]
pub struct Snapshot<'a> {
    world: &'a World,
    movers: Vec<PosedMover>,
}

#[derive(Debug, Clone)]
struct PosedMover {
    pose: Isometry3<f32>,
    /// Middle of its ball in the world.
    center: Point3<f32>,
}

impl Snapshot<'_> {
    /// Distance and surface of the first triangle along the unit vector `direction`.
    #[inline]
    pub fn cast(
        &self,
        origin: &Point3<f32>,
        direction: &Vector3<f32>,
        max_distance_m: f32,
        stack: &mut RayStack,
    ) -> Option<(f32, u32)> {
        let mut best = self
            .world
            .static_bvh
            .cast(origin, direction, max_distance_m, stack)
            .map(|hit| (hit.distance, hit.triangle));
        for (moving, posed) in self.world.movers.iter().zip(&self.movers) {
            let limit = best.map_or(max_distance_m, |(distance, _)| distance);
            let to_center = posed.center - origin;
            let along = to_center.dot(direction);
            let beside = (to_center - direction * along).norm_squared();
            if beside > moving.radius * moving.radius || along < -moving.radius || along - moving.radius > limit {
                continue;
            }
            let local_origin = posed.pose.inverse_transform_point(origin);
            let local_direction = posed.pose.inverse_transform_vector(direction);
            if let Some(hit) = moving.bvh.cast(&local_origin, &local_direction, limit, stack) {
                best = Some((hit.distance, hit.triangle + moving.first_surface));
            }
        }
        best
    }

    /// Unit normal of a surface in the world frame, on the side its winding says.
    #[inline]
    pub fn normal(&self, surface: u32) -> Vector3<f32> {
        let normal = self.world.surfaces[surface as usize].normal;
        if (surface as usize) < self.world.static_mesh.faces.len() {
            return normal;
        }
        let mover = self.world.movers.partition_point(|m| m.first_surface <= surface) - 1;
        self.movers[mover].pose * normal
    }

    /// The world this is a moment of.
    pub fn world(&self) -> &World {
        self.world
    }

    pub(crate) fn mover_pose(&self, mover: usize) -> &Isometry3<f32> {
        &self.movers[mover].pose
    }
}

impl Mover {
    /// Adds a key pose and forgets those older than `keep_ns` before it, except the newest of them. A pose that is not finite or not later
    /// than the last is none.
    pub fn go_on(&mut self, stamp_ns: i64, pose: Isometry3<f64>, keep_ns: i64) {
        let is_later = self.path.last().is_none_or(|(last, _)| *last < stamp_ns);
        if !is_later || !pose.to_homogeneous().iter().all(|x| x.is_finite()) {
            return;
        }
        let old = self.path.partition_point(|(stamp, _)| *stamp <= stamp_ns.saturating_sub(keep_ns));
        self.path.drain(..old.saturating_sub(1));
        self.path.push((stamp_ns, pose));
    }

    /// Pose in the world at `stamp_ns`: linear in position and along the shortest rotation between key poses, constant
    /// before the first and after the last.
    pub fn pose_at(&self, stamp_ns: i64) -> Isometry3<f64> {
        let next = self.path.partition_point(|(stamp, _)| *stamp <= stamp_ns);
        match (next.checked_sub(1).map(|i| &self.path[i]), self.path.get(next)) {
            (None, Some((_, first))) => *first,
            (Some((_, last)), None) => *last,
            (Some((t0, before)), Some((t1, after))) => {
                let s = (stamp_ns - t0) as f64 / (t1 - t0) as f64;
                before
                    .try_lerp_slerp(after, s, 1e-9)
                    // Half a turn apart: no shortest way, keep the earlier pose.
                    .unwrap_or(*before)
            }
            (None, None) => Isometry3::identity(),
        }
    }
}

/// Appends the surfaces of a mesh; a mover's instance overrides that of its triangles.
fn surfaces_of(
    mesh: &TriangleMesh,
    mover: Option<InstanceId>,
    facets: &mut facet::Facets,
    surfaces: &mut Vec<Surface>,
) {
    facets.next_mesh();
    for (face, corners) in mesh.faces.iter().enumerate() {
        let [a, b, c] = corners.map(|i| mesh.vertices[i as usize]);
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector3::z);
        let instance = mover.unwrap_or(mesh.instances[face]);
        let color = mesh.colors[face];
        surfaces.push(Surface { normal, instance, facet: facets.number(instance, color, &normal, &a), color });
    }
}

/// Adds the triangles of a mover with one pose to the static mesh.
fn bake(mover: &Mover, mesh: &mut TriangleMesh) {
    let base = mesh.vertices.len() as u32;
    let pose = &mover.path[0].1;
    let placed = mover.mesh.vertices.iter();
    mesh.vertices.extend(placed.map(|v| (pose * v.cast::<f64>()).cast::<f32>()));
    let faces = mover.mesh.faces.iter();
    mesh.faces.extend(faces.map(|f| f.map(|i| base + i)));
    mesh.instances.extend(std::iter::repeat_n(mover.instance, mover.mesh.faces.len()));
    mesh.colors.extend_from_slice(&mover.mesh.colors);
}

/// A ball about the middle of a mesh's box.
fn ball_of(mesh: &TriangleMesh) -> (Point3<f32>, f32) {
    let Some(first) = mesh.vertices.first() else {
        return (Point3::origin(), 0.0);
    };
    let low = mesh.vertices.iter().fold(*first, |a, b| a.inf(b));
    let high = mesh.vertices.iter().fold(*first, |a, b| a.sup(b));
    let center = nalgebra::center(&low, &high);
    let reach = |v: &Point3<f32>| (v - center).norm();
    (center, mesh.vertices.iter().map(reach).fold(0.0, f32::max) * 1.0001)
}

/// Faces of each instance, by instance.
fn faces_by_instance(mesh: &TriangleMesh, mover: Option<InstanceId>) -> BTreeMap<InstanceId, Vec<usize>> {
    let mut faces: BTreeMap<InstanceId, Vec<usize>> = BTreeMap::new();
    for (face, &instance) in mesh.instances.iter().enumerate() {
        faces.entry(mover.unwrap_or(instance)).or_default().push(face);
    }
    faces
}
