//! From the named meshes of somebody else's scene to a building with its truth.
//!
//! A mesh called `room_kitchen` is the volume of a room and is not seen; walls, floors and what has no name of its own are
//! structure; every other mesh is a thing of the class its name says (`chair.001`, `red_mug_2`). The lowest floor is found, free
//! is what nothing of the structure stands on, and where no volumes say which rooms there are, the caller cuts the free floor.

use std::collections::BTreeMap;

use nalgebra::{Point2, Point3, Vector3};
use thiserror::Error;

use crate::building::{Bounds, Building, ObjectTruth, RoomKind, RoomTruth};
use crate::caption::write_captions;
use crate::catalog::class;
use crate::colors::color_name;
use crate::furniture::essentials;
use crate::generator::name_rooms;
use crate::mesh::TriangleMesh;
use crate::mesh_name::{Meaning, color_in, meaning_of};
use crate::plan_image::door_truth;
use crate::plan_rooms::{PlanRooms, SOLID};
use crate::walls::CEILING_M;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Edge of a cell of the free floor, metres.
pub const RESOLUTION_M: f64 = 0.05;
/// Structure between these heights over the floor is in the way, metres.
const WALL_M: (f64, f64) = (0.1, 1.8);
/// Largest extent of a scene, metres.
const LARGEST_M: f64 = 200.0;
/// Most cells painted in all before a scene is given up.
const MOST_PAINTED: u64 = 1 << 30;
/// A thing stands on another if its foot is so near to a surface of that, metres.
const TOUCHING_M: f64 = 0.03;

/// A mesh with the name its author gave it; z up, metres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NamedMesh {
    /// Name; may be empty.
    pub name: String,
    /// Corners.
    pub vertices: Vec<Point3<f64>>,
    /// Three vertex indices per triangle.
    pub faces: Vec<[u32; 3]>,
    /// Colour per triangle.
    pub colors: Vec<[u8; 3]>,
}

/// Why named meshes are no building.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ImportError {
    /// A triangle names a vertex that is not there, or lists differ in length.
    #[error("the mesh \"{name}\" has {vertices} vertices and a triangle that names another")]
    Index {
        /// Name of the mesh.
        name: String,
        /// Number of its vertices.
        vertices: usize,
    },
    /// A vertex is NaN, infinite, or farther than 200 m from the others.
    #[error(
        "the mesh \"{name}\" has a vertex that is no number or makes the scene larger than {LARGEST_M} m; units are metres"
    )]
    Extent {
        /// Name of the mesh.
        name: String,
    },
    /// There is no level surface to stand on.
    #[error(
        "the scene has no floor: no level triangle of the structure that faces up (the axis that points up may be another)"
    )]
    NoFloor,
    /// Nothing of the floor is free, or no room was found on it.
    #[error("the scene has a floor, and no room on it")]
    NoRoom,
    /// So many large triangles that nobody would wait.
    #[error("the scene has too many large triangles: more than {MOST_PAINTED} cells of the floor would be painted")]
    TooLarge,
}

/// Makes a building of named meshes. `cut` gives the rooms of a free floor that has no volumes (free cells from the north-west corner
/// row by row, width, height; numbers from 1, 0 for none).
///
/// # Errors
/// Meshes that are none, a scene without floor or rooms, or one that is too large.
pub fn assemble(
    meshes: &[NamedMesh],
    cut: impl FnOnce(&[bool], usize, usize) -> Vec<u32>,
) -> Result<Building, ImportError> {
    check(meshes)?;
    let meanings: Vec<Meaning> = meshes.iter().map(|mesh| meaning_of(&mesh.name)).collect();
    let floor_z_m = lowest_floor(meshes, &meanings).ok_or(ImportError::NoFloor)?;
    let (rooms, south_west, kinds) = find_rooms(meshes, &meanings, floor_z_m, cut)?;
    // The corner of the raster becomes the origin, the floor zero.
    let shift = Vector3::new(-south_west.x, -south_west.y, -floor_z_m);
    let mut building = Building {
        rooms: (0..rooms.count() as u32)
            .map(|id| RoomTruth {
                id,
                kind: RoomKind::Hallway,
                name: String::new(),
                rects: rooms.rects(|at| rooms.room[at] == id + 1),
                floor_z_m: 0.0,
                height_m: CEILING_M,
                storey: 0,
            })
            .collect(),
        doors: rooms.openings().iter().map(door_truth).collect(),
        objects: Vec::new(),
        mesh: TriangleMesh::default(),
        movers: Vec::new(),
    };
    for (mesh, meaning) in meshes.iter().zip(&meanings) {
        let instance = match meaning {
            Meaning::Room(_) => continue,
            Meaning::Thing(class) if !mesh.faces.is_empty() => {
                let id = building.objects.len() as u32 + 1;
                let object = thing(mesh, class, id, shift, &building.rooms);
                building.objects.push(object);
                id
            }
            _ => 0,
        };
        push_mesh(&mut building.mesh, mesh, instance, shift);
    }
    find_supports(&mut building);
    for (room, named) in building.rooms.iter_mut().zip(&kinds) {
        room.kind = named.unwrap_or_else(|| kind_by_contents(room.id, &building.objects));
    }
    name_rooms(&mut building.rooms);
    write_captions(&mut ChaCha8Rng::seed_from_u64(0), &mut building.objects);
    Ok(building)
}

fn check(meshes: &[NamedMesh]) -> Result<(), ImportError> {
    let (mut low, mut high) = (Point3::new(f64::MAX, f64::MAX, f64::MAX), Point3::new(f64::MIN, f64::MIN, f64::MIN));
    for mesh in meshes {
        let (name, vertices) = (mesh.name.clone(), mesh.vertices.len());
        let is_inside = |face: &[u32; 3]| face.iter().all(|corner| (*corner as usize) < vertices);
        if !mesh.faces.iter().all(is_inside) || mesh.colors.len() != mesh.faces.len() {
            return Err(ImportError::Index { name, vertices });
        }
        for vertex in &mesh.vertices {
            (low, high) = (low.inf(vertex), high.sup(vertex));
            let is_small = vertex.iter().all(|v| v.is_finite()) && (high - low).amax() <= LARGEST_M;
            if !is_small || vertex.coords.amax() > 1e6 {
                return Err(ImportError::Extent { name });
            }
        }
    }
    Ok(())
}

fn triangles(mesh: &NamedMesh) -> impl Iterator<Item = [Point3<f64>; 3]> + '_ {
    mesh.faces.iter().map(|face| face.map(|corner| mesh.vertices[corner as usize]))
}

/// Twice the area times the normal.
fn normal([a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

/// The lowest height at which level triangles of the structure that face up have a fifth of the area they have anywhere.
fn lowest_floor(meshes: &[NamedMesh], meanings: &[Meaning]) -> Option<f64> {
    let mut area_at: BTreeMap<i64, f64> = BTreeMap::new();
    let structure = meshes.iter().zip(meanings).filter(|(_, meaning)| **meaning == Meaning::Structure);
    for triangle in structure.flat_map(|(mesh, _)| triangles(mesh)) {
        let n = normal(&triangle);
        if n.z > 0.99 * n.norm() {
            *area_at.entry((triangle[0].z / 0.02).round() as i64).or_default() += n.z / 2.0;
        }
    }
    let most = area_at.values().copied().fold(0.0, f64::max);
    area_at.into_iter().find(|(_, area)| *area > 0.0 && *area >= 0.2 * most).map(|(bin, _)| bin as f64 * 0.02)
}

/// Rooms on cells, the south-west corner of the cells, and the kinds that names of volumes say.
type FoundRooms = (PlanRooms, Point2<f64>, Vec<Option<RoomKind>>);

fn find_rooms(
    meshes: &[NamedMesh],
    meanings: &[Meaning],
    floor_z_m: f64,
    cut: impl FnOnce(&[bool], usize, usize) -> Vec<u32>,
) -> Result<FoundRooms, ImportError> {
    let (mut low, mut high) = (Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN));
    for vertex in meshes.iter().flat_map(|mesh| &mesh.vertices) {
        (low, high) = (low.inf(&vertex.xy()), high.sup(&vertex.xy()));
    }
    let cells = |extent: f64| (extent / RESOLUTION_M).ceil().max(1.0) as usize;
    let mut canvas = Canvas { low, width: cells(high.x - low.x), height: cells(high.y - low.y), painted: 0 };
    let (width, height) = (canvas.width, canvas.height);
    let mut free = vec![false; width * height];
    let mut is_blocked = vec![false; width * height];
    let mut labels = vec![0_u32; width * height];
    let mut kinds = Vec::new();
    for (mesh, meaning) in meshes.iter().zip(meanings) {
        if let Meaning::Room(kind) = meaning {
            kinds.push(*kind);
            for [a, b, c] in triangles(mesh) {
                canvas.paint(&[a.xy(), b.xy(), c.xy()], false, &mut |at| labels[at] = kinds.len() as u32)?;
            }
        }
        if *meaning != Meaning::Structure {
            continue;
        }
        for triangle in triangles(mesh) {
            let n = normal(&triangle);
            if n.z > 0.99 * n.norm() && (triangle[0].z - floor_z_m).abs() <= TOUCHING_M {
                let [a, b, c] = triangle;
                canvas.paint(&[a.xy(), b.xy(), c.xy()], false, &mut |at| free[at] = true)?;
            }
            let slice = between(&triangle, floor_z_m + WALL_M.0, floor_z_m + WALL_M.1);
            if !slice.is_empty() {
                canvas.paint(&slice, true, &mut |at| is_blocked[at] = true)?;
            }
        }
    }
    (0..free.len()).for_each(|at| free[at] &= !is_blocked[at]);
    if kinds.is_empty() {
        labels = cut(&free, width, height);
        kinds = vec![None; labels.iter().copied().max().unwrap_or(0) as usize];
    }
    // Only rooms with a free cell are numbered.
    let used: std::collections::BTreeSet<u32> =
        labels.iter().zip(&free).filter(|(_, free)| **free).map(|(label, _)| *label).filter(|l| *l != 0).collect();
    let kept: Vec<u32> = labels.iter().map(|label| if used.contains(label) { *label } else { 0 }).collect();
    let kinds: Vec<Option<RoomKind>> = used.iter().map(|label| kinds[*label as usize - 1]).collect();
    if kinds.is_empty() {
        return Err(ImportError::NoRoom);
    }
    let rooms = PlanRooms::grown(&free, &kept, width, height, RESOLUTION_M);
    debug_assert!(rooms.room.iter().any(|room| *room != SOLID));
    // Rows go from the north on the canvas and one ring of cells lies round them.
    let south_west = Point2::new(low.x - RESOLUTION_M, low.y - RESOLUTION_M);
    Ok((rooms, south_west, kinds))
}

/// The part of a triangle between two heights, from above.
fn between(triangle: &[Point3<f64>; 3], low: f64, high: f64) -> Vec<Point2<f64>> {
    let mut polygon: Vec<Point3<f64>> = triangle.to_vec();
    for (sign, height) in [(1.0, low), (-1.0, high)] {
        let over = |p: &Point3<f64>| sign * (p.z - height);
        let mut clipped = Vec::with_capacity(polygon.len() + 1);
        for (k, p) in polygon.iter().enumerate() {
            let q = &polygon[(k + 1) % polygon.len()];
            if over(p) >= 0.0 {
                clipped.push(*p);
            }
            if (over(p) >= 0.0) != (over(q) >= 0.0) {
                clipped.push(p + (q - p) * (over(p) / (over(p) - over(q))));
            }
        }
        polygon = clipped;
    }
    polygon.iter().map(|p| p.xy()).collect()
}

/// Cells seen from above, rows from the north.
struct Canvas {
    low: Point2<f64>,
    width: usize,
    height: usize,
    painted: u64,
}

impl Canvas {
    /// Visits the cells whose middle lies in a convex polygon, and with `with_border` those that its border crosses.
    fn paint(
        &mut self,
        polygon: &[Point2<f64>],
        with_border: bool,
        visit: &mut dyn FnMut(usize),
    ) -> Result<(), ImportError> {
        let in_cells = |p: &Point2<f64>| Point2::from((p - self.low) / RESOLUTION_M);
        let corners: Vec<Point2<f64>> = polygon.iter().map(in_cells).collect();
        let (width, height) = (self.width, self.height);
        let mut put = |x: f64, y: f64| {
            let (x, y) = (x.floor().clamp(0.0, width as f64 - 1.0), y.floor().clamp(0.0, height as f64 - 1.0));
            visit((height - 1 - y as usize) * width + x as usize);
        };
        let (bottom, top) = corners.iter().fold((f64::MAX, f64::MIN), |(low, high), p| (low.min(p.y), high.max(p.y)));
        let mut row = (bottom - 0.5).ceil().max(0.0);
        while row + 0.5 <= top && row < height as f64 {
            let y = row + 0.5;
            let (mut from, mut to) = (f64::MAX, f64::MIN);
            for (k, p) in corners.iter().enumerate() {
                let q = &corners[(k + 1) % corners.len()];
                if (p.y <= y) != (q.y <= y) {
                    let x = p.x + (q.x - p.x) * (y - p.y) / (q.y - p.y);
                    (from, to) = (from.min(x), to.max(x));
                }
            }
            let mut x = (from - 0.5).ceil().max(0.0);
            while x + 0.5 <= to && x < width as f64 {
                put(x, y);
                self.painted += 1;
                x += 1.0;
            }
            self.painted += 1;
            if self.painted > MOST_PAINTED {
                return Err(ImportError::TooLarge);
            }
            row += 1.0;
        }
        for k in 0..if with_border { corners.len() } else { 0 } {
            let (p, q) = (corners[k], corners[(k + 1) % corners.len()]);
            let steps = (2.0 * (q - p).amax()).ceil().max(1.0);
            // A border between two cells belongs to neither: a wall's face lies there, and the wall behind it.
            let mut step = 0.5;
            while step < steps {
                let at = p + (q - p) * (step / steps);
                if (0..2).all(|axis| (at[axis] - at[axis].round()).abs() > 1e-6) {
                    put(at.x, at.y);
                }
                step += 1.0;
            }
            self.painted += steps as u64;
        }
        Ok(())
    }
}

fn push_mesh(out: &mut TriangleMesh, mesh: &NamedMesh, instance: u32, shift: Vector3<f64>) {
    let first = out.vertices.len() as u32;
    out.vertices.extend(mesh.vertices.iter().map(|vertex| (vertex + shift).cast::<f32>()));
    out.faces.extend(mesh.faces.iter().map(|face| face.map(|corner| first + corner)));
    out.instances.extend(std::iter::repeat_n(instance, mesh.faces.len()));
    out.colors.extend(&mesh.colors);
}

fn thing(mesh: &NamedMesh, name: &str, id: u32, shift: Vector3<f64>, rooms: &[RoomTruth]) -> ObjectTruth {
    let (mut min, mut max) = (Point3::new(f64::MAX, f64::MAX, f64::MAX), Point3::new(f64::MIN, f64::MIN, f64::MIN));
    for corner in mesh.faces.iter().flatten() {
        let corner = mesh.vertices[*corner as usize] + shift;
        (min, max) = (min.inf(&corner), max.sup(&corner));
    }
    let bounds = Bounds { min, max };
    // The colour of most of its surface.
    let mut area_of: BTreeMap<[u8; 3], f64> = BTreeMap::new();
    for (triangle, color) in triangles(mesh).zip(&mesh.colors) {
        *area_of.entry(*color).or_default() += normal(&triangle).norm();
    }
    let rgb = area_of.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or([128; 3], |(color, _)| color);
    let middle = bounds.center().xy();
    let off = |room: &RoomTruth| room.rects.iter().map(|r| r.distance_m(&middle)).fold(f64::INFINITY, f64::min);
    let room = rooms.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map_or(0, |room| room.id);
    let known = class(name);
    ObjectTruth {
        id,
        class: name.to_owned(),
        color: color_in(&mesh.name).unwrap_or_else(|| color_name(rgb)).to_owned(),
        rgb,
        material: known.and_then(|k| k.materials.first()).copied().unwrap_or("plain").to_owned(),
        function: known.map_or("some purpose", |k| k.function).to_owned(),
        caption: String::new(),
        bounds,
        yaw_rad: 0.0,
        room,
        supported_by: None,
        placed_with: None,
    }
}

/// A thing above the floor stands on the other that has a level face under its middle, where its foot is.
fn find_supports(building: &mut Building) {
    let mesh = &building.mesh;
    let mut level: Vec<(f64, u32, [Point3<f64>; 3])> = (0..mesh.faces.len())
        .filter(|face| mesh.instances[*face] != 0)
        .map(|face| (face, mesh.faces[face].map(|corner| mesh.vertices[corner as usize].cast::<f64>())))
        .filter(|(_, triangle)| normal(triangle).z > 0.9 * normal(triangle).norm())
        .map(|(face, [a, b, c])| (a.z.max(b.z).max(c.z), mesh.instances[face], [a, b, c]))
        .collect();
    level.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for object in &mut building.objects {
        let (foot_m, middle) = (object.bounds.min.z, object.bounds.center());
        if foot_m <= 2.0 * TOUCHING_M {
            continue;
        }
        let is_under = |[a, b, c]: &[Point3<f64>; 3]| {
            let side = |p: &Point3<f64>, q: &Point3<f64>| {
                (q.x - p.x) * (middle.y - p.y) - (q.y - p.y) * (middle.x - p.x) >= -1e-9
            };
            side(a, b) && side(b, c) && side(c, a)
        };
        let first = level.partition_point(|(z, ..)| *z < foot_m - TOUCHING_M);
        object.supported_by = level[first..]
            .iter()
            .take_while(|(z, ..)| *z <= foot_m + TOUCHING_M)
            .find(|(_, instance, triangle)| *instance != object.id && is_under(triangle))
            .map(|(_, instance, _)| *instance);
    }
}

/// The kind whose essentials are there, most of them first; a room without any is a way to others.
fn kind_by_contents(room: u32, objects: &[ObjectTruth]) -> RoomKind {
    let share = |kind: RoomKind| {
        let wanted = essentials(kind);
        let is_there = |name: &&&str| objects.iter().any(|o| o.room == room && o.class == **name);
        (!wanted.is_empty()).then(|| (wanted.iter().filter(is_there).count() * 12 / wanted.len(), wanted.len()))
    };
    RoomKind::ALL
        .into_iter()
        .filter_map(|kind| share(kind).filter(|(share, _)| *share > 0).map(|share| (share, kind)))
        .max_by_key(|(share, kind)| (*share, std::cmp::Reverse(*kind)))
        .map_or(RoomKind::Hallway, |(_, kind)| kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_a_mesh_is() {
        let thing = |name: &str| Meaning::Thing(name.to_owned());
        assert_eq!(meaning_of("chair.001"), thing("chair"));
        assert_eq!(meaning_of("red_mug_2"), thing("mug"));
        assert_eq!(meaning_of("OFFICE-CHAIR.012"), thing("office chair"));
        assert_eq!(meaning_of("grand piano"), thing("grand piano"));
        assert_eq!(meaning_of("room_living_room_2"), Meaning::Room(Some(RoomKind::LivingRoom)));
        assert_eq!(meaning_of("room_kitchen"), Meaning::Room(Some(RoomKind::Kitchen)));
        assert_eq!(meaning_of("room_cellar"), Meaning::Room(None));
        for name in ["", "Cube.003", "wall_north", "walls", "Outer Wall 3", "Plane", "12", "doorframe"] {
            assert_eq!(meaning_of(name), Meaning::Structure, "{name}");
        }
    }
}
