//! The surface by marching cubes (Lorensen and Cline 1987): the plain text beside the surface nets of [`mesh`](crate::mesh), for comparison.
//!
//! A cube between eight neighbouring voxel centres is cut where the distance changes its sign: one vertex on each of its edges that
//! crosses, shared by the cubes round the edge. On a face of the cube the surface leaves a line from where the border of the face, walked
//! counter-clockwise from outside, enters the solid to where it next leaves it. The face's other cube walks the other way round and
//! draws the same line backwards: so the lines close to loops within a cube, neighbouring cubes fit together also where a face
//! is crossed four times, and no table of 256 cases is needed. As many triangles as the surface nets, but thinner ones.

use rustc_hash::FxHashMap;

use crate::block::{Block, BlockKey, contains, local_of};
use crate::mesh::Mesh;
use crate::volume::Volume;

/// A mesh whose vertices lie on edges of the voxel grid.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MarchedSurface {
    /// Faces are counter-clockwise seen from free space.
    pub mesh: Mesh,
    /// The edge each vertex lies on: from a voxel's centre along an axis to the next.
    pub edges: Vec<GridEdge>,
}

/// An edge of the voxel grid: from the centre of a voxel to that of its next neighbour along an axis (0, 1, 2).
pub type GridEdge = ([i32; 3], u8);

impl Volume {
    /// The surface of the whole map by marching cubes, of cubes whose eight voxels are known. Nothing is kept between calls.
    pub fn marching_cubes(&self) -> MarchedSurface {
        let mut surface = MarchedSurface::default();
        let mut number = FxHashMap::default();
        let mut keys: Vec<BlockKey> = self.blocks.iter().map(|block| block.key).collect();
        keys.sort_unstable();
        for key in keys {
            for local in 0..512 {
                let cube = crate::stride::voxel_of(key, local);
                let Some(distance) = self.corners(cube) else { continue };
                for polygon in loops(&distance) {
                    let vertices = polygon.iter().map(|edge| {
                        let (a, axis) = EDGES[usize::from(*edge)];
                        let grid_edge = (corner(cube, a), axis);
                        let t = distance[a] / (distance[a] - distance[a | 1 << axis]);
                        *number.entry(grid_edge).or_insert_with(|| self.put_vertex(&mut surface, grid_edge, t))
                    });
                    let vertices: Vec<u32> = vertices.collect();
                    for k in 2..vertices.len() {
                        surface.mesh.faces.push([vertices[0], vertices[k - 1], vertices[k]]);
                    }
                }
            }
        }
        surface
    }

    /// Stored distances at a cube's corners; `None` if one is not known.
    fn corners(&self, cube: [i32; 3]) -> Option<[f32; 8]> {
        let mut distance = [0.0; 8];
        for (k, distance) in distance.iter_mut().enumerate() {
            *distance = self.known_at(corner(cube, k)).map(|(block, local)| f32::from(block.distance[local]))?;
        }
        Some(distance)
    }

    fn known_at(&self, voxel: [i32; 3]) -> Option<(&Block, usize)> {
        let block = self.block(BlockKey::of_voxel(voxel))?;
        contains(&block.known, local_of(voxel)).then_some((block, local_of(voxel)))
    }

    /// A vertex a part of the way along an edge, with the label and instance of the voxel it is nearer to, or of the other.
    fn put_vertex(&self, surface: &mut MarchedSurface, (voxel, axis): GridEdge, t: f32) -> u32 {
        let mut next = voxel;
        next[usize::from(axis)] += 1;
        let near_first = if t > 0.5 { [next, voxel] } else { [voxel, next] };
        let leader = |voxel: [i32; 3]| self.known_at(voxel).and_then(|(block, i)| block.votes.as_ref()?.leader(i));
        let (label, instance) = near_first.into_iter().find_map(leader).unwrap_or((0, 0));
        let mut at = self.voxel_center(voxel);
        at[usize::from(axis)] += f64::from(t) * self.config.voxel_m;
        surface.mesh.vertices.push(at.cast::<f32>());
        surface.mesh.push_tags(&[(label, instance)]);
        surface.edges.push((voxel, axis));
        surface.edges.len() as u32 - 1
    }
}

/// Corner k of a cube lies at (k & 1, k >> 1 & 1, k >> 2).
fn corner(cube: [i32; 3], k: usize) -> [i32; 3] {
    [0, 1, 2].map(|axis| cube[axis] + (k >> axis & 1) as i32)
}

/// The edges of a cube: first corner, axis.
const EDGES: [(usize, u8); 12] =
    [(0, 0), (2, 0), (4, 0), (6, 0), (0, 1), (1, 1), (4, 1), (5, 1), (0, 2), (1, 2), (2, 2), (3, 2)];

/// Number of the edge between two corners that differ in one bit.
fn edge_between(a: usize, b: usize) -> u8 {
    let axis = (a ^ b).trailing_zeros() as u8;
    EDGES.iter().position(|edge| *edge == (a & b, axis)).expect("corners that differ in one bit share an edge") as u8
}

/// The loops of edges along which the surface cuts the border of a cube, counter-clockwise seen from free space.
fn loops(distance: &[f32; 8]) -> Vec<Vec<u8>> {
    let is_inside = distance.map(|d| d < 0.0);
    if is_inside.iter().all(|inside| *inside == is_inside[0]) {
        return Vec::new();
    }
    let mut next = [None; 12];
    for face in 0..6 {
        let (axis, side) = (face >> 1, face & 1);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut ring = [0, 1 << u, 1 << u | 1 << v, 1 << v].map(|corner| corner | side << axis);
        if side == 0 {
            // Seen from outside the lower face is the other way round.
            ring.reverse();
        }
        for k in 0..4 {
            if !is_inside[ring[k]] && is_inside[ring[(k + 1) % 4]] {
                let mut leaves = k + 1;
                while is_inside[ring[(leaves + 1) % 4]] {
                    leaves += 1;
                }
                let enter = edge_between(ring[k], ring[(k + 1) % 4]);
                next[usize::from(enter)] = Some(edge_between(ring[leaves % 4], ring[(leaves + 1) % 4]));
            }
        }
    }
    let mut out = Vec::new();
    for start in 0..12 {
        let mut polygon = Vec::new();
        let mut at = start;
        while let Some(other) = next[at].take() {
            polygon.push(at as u8);
            at = usize::from(other);
        }
        if !polygon.is_empty() {
            out.push(polygon);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// Signs from a bit mask: set is inside.
    fn corners_of(case: u32) -> [f32; 8] {
        std::array::from_fn(|k| if case >> k & 1 == 1 { -1.0 } else { 1.0 })
    }

    #[test]
    fn one_corner_is_cut_off_by_a_triangle_that_faces_the_others() {
        let found = loops(&corners_of(1));
        assert_eq!(found.len(), 1);
        let at = |edge: u8| {
            let (a, axis) = EDGES[usize::from(edge)];
            let mut p = Point3::new((a & 1) as f32, (a >> 1 & 1) as f32, (a >> 2) as f32);
            p[usize::from(axis)] += 0.5;
            p
        };
        let [a, b, c] = [at(found[0][0]), at(found[0][1]), at(found[0][2])];
        assert_eq!(found[0].len(), 3);
        assert!((b - a).cross(&(c - a)).dot(&Point3::new(1.0, 1.0, 1.0).coords) > 0.0);
    }

    #[test]
    fn in_each_of_256_cases_the_loops_pass_every_crossing_edge_once() {
        for case in 0..256 {
            let distance = corners_of(case);
            let mut passed = [0; 12];
            for polygon in loops(&distance) {
                assert!((3..=7).contains(&polygon.len()), "case {case}");
                polygon.iter().for_each(|edge| passed[usize::from(*edge)] += 1);
            }
            for (edge, passed) in passed.into_iter().enumerate() {
                let (a, axis) = EDGES[edge];
                let is_crossing = (distance[a] < 0.0) != (distance[a | 1 << axis] < 0.0);
                assert_eq!(passed, i32::from(is_crossing), "case {case}, edge {edge}");
            }
        }
    }
}
