//! The surface as triangles: surface nets (Gibson 1998) per block, only where something changed.
//!
//! A cell is the cube between eight neighbouring voxel centres. A cell whose corners lie on both sides of the surface gets one
//! vertex, the mean of the crossings on its twelve edges. Every voxel edge that crosses the surface gives one quad between
//! its four cells. A block owns the cells and edges that begin in it, so the mesh of the whole is the sum of the blocks, and a vertex is
//! named by its cell: the name stays as long as the surface runs through the cell.

use std::collections::hash_map::Entry;

use nalgebra::Point3;
use rustc_hash::FxHashMap;

use crate::block::{Block, BlockKey, VoxelSet, local_of};
use crate::stride::voxel_of;
use crate::volume::Volume;
use crate::votes::Votes;

mod cell;
mod patch;
mod shape;

use cell::cell_tag;
use patch::{Layer, Patch};
use shape::{Shape, Tolerance};

/// Triangles with a label per vertex. Faces are counter-clockwise seen from free space.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Positions in world, metres.
    pub vertices: Vec<Point3<f32>>,
    /// Label of each vertex, 0 = none.
    pub labels: Vec<u16>,
    /// Instance of each vertex, 0 = none; empty if the mesh knows no instances.
    pub instances: Vec<u16>,
    /// Three vertex numbers a triangle.
    pub faces: Vec<[u32; 3]>,
}

/// What [`Volume::update_mesh`] did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshDelta {
    /// Blocks whose part of the mesh was made anew, ascending.
    pub updated: Vec<BlockKey>,
    /// Blocks that had a part and now have none, ascending.
    pub removed: Vec<BlockKey>,
    /// Vertices of the whole mesh.
    pub vertices: usize,
    /// Triangles of the whole mesh.
    pub faces: usize,
}

/// Name of a vertex: the first voxel of its cell. It stays while the surface stays within the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VertexId(pub [i32; 3]);

/// What one block adds to the mesh, by names: for those who keep the mesh and take over what an update changed.
///
/// Put the patches of [`MeshDelta::updated`] in the place of the old ones and drop those of [`MeshDelta::removed`]; then the mesh is all
/// vertices, and of all quads whose four corners exist the triangles 0-1-2 and 0-2-3.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshPatch {
    /// Names of the vertices, ascending within a layer of cells.
    pub ids: Vec<VertexId>,
    /// Positions, labels and instances of the vertices (no faces).
    pub vertices: Mesh,
    /// Corners of quads, some of them in neighbouring blocks; one whose corner does not exist touches what nobody saw.
    pub quads: Vec<[VertexId; 4]>,
}

impl Volume {
    /// Brings the mesh up to date; looks only at blocks whose surface changed since the last call by more than a fifth of a voxel
    /// (or whose labels did), and at the neighbours that share a changed voxel with them. So a vertex may lag by a centimetre, and
    /// one between an old surface and a block that was seen to be free only since may be missing;
    /// [`complete_mesh`](Self::complete_mesh) leaves nothing out.
    pub fn update_mesh(&mut self) -> MeshDelta {
        let units_per_voxel = self.config.voxel_m * f64::from(self.thresholds.units_per_m);
        let tolerance = Tolerance { moved: (0.2 * units_per_voxel) as i16, near: (1.1 * units_per_voxel) as i16 };
        self.mesh_again(&tolerance, self.mesh_cache.seen)
    }

    /// The same for every change, however small, also of those before the last call: the mesh that
    /// [`rebuild_mesh`](Self::rebuild_mesh) makes. It compares the whole map with what was meshed; for a mesh that is kept.
    pub fn complete_mesh(&mut self) -> MeshDelta {
        self.mesh_again(&Tolerance { moved: 0, near: i16::MAX }, 0)
    }

    fn mesh_again(&mut self, tolerance: &Tolerance, since: u32) -> MeshDelta {
        let mut stale = self.stale_blocks(tolerance, since);
        stale.append(&mut self.mesh_cache.waiting);
        in_order(&mut stale);
        let mut delta = MeshDelta::default();
        let mut part = MeshPart::default();
        let mut patch = Patch::new();
        for key in stale {
            if self.reaches_archive(key) {
                self.mesh_cache.waiting.push(key);
                continue;
            }
            self.fill_part(key, &mut patch, &mut part);
            if part.cells.is_empty() && part.quads.is_empty() {
                if self.mesh_cache.remove(key) {
                    delta.removed.push(key);
                }
            } else {
                // What the cache held there is the next part's room.
                part = self.mesh_cache.insert(key, part);
                delta.updated.push(key);
            }
        }
        self.mesh_cache.seen = self.revision;
        delta.vertices = self.mesh_cache.vertices;
        delta.faces = 2 * self.mesh_cache.quads;
        delta
    }

    /// Whether some of the voxels that a block's cells touch are kept elsewhere: then its part of the mesh stays as it is.
    fn reaches_archive(&self, key: BlockKey) -> bool {
        let corner = |k: i32| key.offset(k & 1, k >> 1 & 1, k >> 2);
        !self.archived.is_empty() && (0..8).any(|k| self.archived.contains(&corner(k).packed()))
    }

    /// Makes the whole mesh anew, of what is in memory.
    pub fn rebuild_mesh(&mut self) -> MeshDelta {
        self.mesh_cache = MeshCache::default();
        self.complete_mesh()
    }

    /// The whole mesh as of the last [`update_mesh`](Self::update_mesh), blocks in ascending order.
    pub fn mesh(&self) -> Mesh {
        let mut ranks: Vec<usize> = (0..self.mesh_cache.parts.len()).collect();
        ranks.sort_unstable_by_key(|rank| self.mesh_cache.parts[*rank].0);
        let mut first_vertex = vec![0u32; ranks.len()];
        let mut mesh = Mesh::default();
        mesh.vertices.reserve(self.mesh_cache.vertices);
        mesh.faces.reserve(2 * self.mesh_cache.quads);
        for rank in &ranks {
            let part = &self.mesh_cache.parts[*rank].1;
            first_vertex[*rank] = mesh.vertices.len() as u32;
            mesh.vertices.extend_from_slice(&part.vertices);
            mesh.push_tags(&part.tags);
        }
        for rank in &ranks {
            let (key, part) = &self.mesh_cache.parts[*rank];
            for quad in &part.quads {
                if let Some(corners) = self.quad_vertices(*key, quad, &first_vertex) {
                    mesh.faces.extend(split(corners));
                }
            }
        }
        mesh
    }

    /// The part of the mesh that one block owns, with its own copy of the border vertices; for viewers that replace blocks.
    pub fn block_mesh(&self, key: BlockKey) -> Option<Mesh> {
        let rank = *self.mesh_cache.rank.get(&key.packed())?;
        let part = &self.mesh_cache.parts[rank].1;
        let mut mesh = Mesh::default();
        let mut number = FxHashMap::default();
        for quad in &part.quads {
            let Some(corners) = self.quad_cells(key, quad) else {
                continue;
            };
            let corners = corners.map(|(rank, slot)| {
                *number.entry((rank, slot)).or_insert_with(|| {
                    let source = &self.mesh_cache.parts[rank].1;
                    mesh.vertices.push(source.vertices[slot]);
                    mesh.push_tags(&source.tags[slot..=slot]);
                    mesh.vertices.len() as u32 - 1
                })
            });
            mesh.faces.extend(split(corners));
        }
        Some(mesh)
    }

    /// The patch of one block, see [`MeshPatch`]; `None` if it has no part of the mesh.
    pub fn mesh_patch(&self, key: BlockKey) -> Option<MeshPatch> {
        let rank = *self.mesh_cache.rank.get(&key.packed())?;
        let part = &self.mesh_cache.parts[rank].1;
        let mut patch = MeshPatch::default();
        patch.vertices.vertices.extend_from_slice(&part.vertices);
        patch.vertices.push_tags(&part.tags);
        patch.ids.extend(part.cells.iter().map(|cell| VertexId(voxel_of(key, u32::from(*cell)))));
        for quad in &part.quads {
            patch.quads.push(quad.cells(key).map(VertexId));
        }
        Some(patch)
    }

    /// Names of the vertices of [`mesh`](Self::mesh), in its order.
    pub fn vertex_ids(&self) -> Vec<VertexId> {
        let mut ids = Vec::with_capacity(self.mesh_cache.vertices);
        let mut parts: Vec<_> = self.mesh_cache.parts.iter().collect();
        parts.sort_unstable_by_key(|(key, _)| *key);
        for (key, part) in parts {
            ids.extend(part.cells.iter().map(|cell| VertexId(voxel_of(*key, u32::from(*cell)))));
        }
        ids
    }

    /// Blocks to mesh again: the changed ones, and those on their negative sides whose cells reach to a changed voxel.
    fn stale_blocks(&mut self, tolerance: &Tolerance, since: u32) -> Vec<BlockKey> {
        let cache = &mut self.mesh_cache;
        let mut stale = Vec::new();
        let leaves_nothing_out = tolerance.moved == 0;
        let changed = self.recent.iter().map(|id| &self.blocks[id as usize]);
        for block in changed.take_while(|block| block.newest_revision() > since) {
            let shape = match cache.shape.entry(block.key.packed()) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(_) if block.near_surface == [0; 8] => {
                    // It has no shape that could have moved, but its first voxels may be the outer corners of cells on the surface.
                    if leaves_nothing_out {
                        stale.extend((0..8).map(|k| block.key.offset(-(k & 1), -(k >> 1 & 1), -(k >> 2))));
                    }
                    continue;
                }
                Entry::Vacant(entry) => entry.insert(Box::new(Shape::NONE)),
            };
            let moved = shape.moved(block, tolerance);
            if moved == [0; 8] {
                continue;
            }
            // Voxels that a neighbour's mesh still shows as they were: small changes must add up against that.
            let mut kept: VoxelSet = [0; 8];
            for corner in 0..8 {
                // The neighbour's cells reach the voxels with coordinate zero along the axes in which it is another block.
                let reached = FACE_MASK[corner as usize & 3];
                let layers = if corner & 4 == 0 { 8 } else { 1 };
                if moved[..layers].iter().any(|layer| layer & reached != 0) {
                    stale.push(block.key.offset(-(corner & 1), -(corner >> 1 & 1), -(corner >> 2)));
                } else {
                    kept[..layers].iter_mut().for_each(|layer| *layer |= reached);
                }
            }
            shape.take(block, &kept);
        }
        stale
    }

    fn fill_part(&self, key: BlockKey, patch: &mut Patch, part: &mut MeshPart) {
        part.clear();
        let blocks: [Option<&Block>; 8] =
            std::array::from_fn(|k| self.block(key.offset(k as i32 & 1, k as i32 >> 1 & 1, k as i32 >> 2)));
        if !patch.read(&blocks) {
            return;
        }
        part.take_crossings(&patch.layers);
        let voxel = self.config.voxel_m as f32;
        // The first voxel's centre, rounded once.
        let base = key.first_voxel().map(|v| ((f64::from(v) + 0.5) * self.config.voxel_m) as f32);
        let votes = blocks.map(|block| block.and_then(|block| block.votes.as_deref()));
        let has_votes = votes.iter().any(Option::is_some);
        let votes = votes.map(|votes| votes.unwrap_or(&NOBODY));
        let mut offsets = [[0.0; 64]; 3];
        for cells in part.cells.chunks(64) {
            patch.vertices(cells, &mut offsets);
            let [x, y, z] = &offsets;
            let offsets = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]);
            let placed = cells.iter().map(|cell| local_to_voxel(*cell)).zip(offsets);
            part.vertices.extend(placed.clone().map(|(cell, offset)| {
                let at = |axis: usize| base[axis] + (cell[axis] as f32 + offset[axis]) * voxel;
                Point3::new(at(0), at(1), at(2))
            }));
            if has_votes {
                part.tags.extend(placed.map(|(cell, offset)| cell_tag(&votes, cell, offset)));
            }
        }
        part.tags.resize(part.cells.len(), (0, 0));
    }

    /// Vertex numbers of a quad in the whole mesh, counter-clockwise from free space.
    fn quad_vertices(&self, key: BlockKey, quad: &Quad, first_vertex: &[u32]) -> Option<[u32; 4]> {
        Some(self.quad_cells(key, quad)?.map(|(rank, slot)| first_vertex[rank] + slot as u32))
    }

    /// (part, slot in the part) of a quad's four cells; `None` if one of them has no vertex (it touches unknown voxels).
    fn quad_cells(&self, key: BlockKey, quad: &Quad) -> Option<[(usize, usize); 4]> {
        let mut corners = [(0, 0); 4];
        for (corner, cell) in corners.iter_mut().zip(quad.cells(key)) {
            let rank = *self.mesh_cache.rank.get(&BlockKey::of_voxel(cell).packed())?;
            let slot = self.mesh_cache.parts[rank].1.cells.binary_search(&(local_of(cell) as u16)).ok()?;
            *corner = (rank, slot);
        }
        Some(corners)
    }
}

impl Mesh {
    /// Labels and instances of the vertices pushed last.
    pub(crate) fn push_tags(&mut self, tags: &[(u16, u16)]) {
        if tags.iter().any(|(_, instance)| *instance != 0) {
            self.instances.resize(self.labels.len(), 0);
        }
        self.labels.extend(tags.iter().map(|(label, _)| *label));
        if !self.instances.is_empty() || tags.iter().any(|(_, instance)| *instance != 0) {
            self.instances.extend(tags.iter().map(|(_, instance)| *instance));
        }
    }
}

fn split<T: Copy>(corners: [T; 4]) -> [[T; 3]; 2] {
    [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
}

/// Column, row and layer of a block's cell.
fn local_to_voxel(cell: u16) -> [usize; 3] {
    let cell = usize::from(cell);
    [cell & 7, cell >> 3 & 7, cell >> 6]
}

/// Sorts and takes out what is there twice.
fn in_order(keys: &mut Vec<BlockKey>) {
    // By one number each: a third of the comparisons.
    keys.sort_unstable_by_key(|key| key.ordinal());
    keys.dedup();
}

/// Of blocks that nobody voted on.
static NOBODY: Votes = Votes::NONE;

/// Numbers of the ones of a set.
fn ones(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let next = (set != 0).then(|| set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        next
    })
}

#[derive(Debug, Clone)]
struct Quad {
    voxel: [u8; 3],
    axis: u8,
    flip: bool,
}

impl Quad {
    /// The four cells round the edge, counter-clockwise from free space.
    fn cells(&self, key: BlockKey) -> [[i32; 3]; 4] {
        let first = key.first_voxel();
        let axis = usize::from(self.axis);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut cells = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
            let mut cell = [0, 1, 2].map(|a| first[a] + i32::from(self.voxel[a]));
            cell[u] -= 1 - du;
            cell[v] -= 1 - dv;
            cell
        });
        if self.flip {
            cells.reverse();
        }
        cells
    }
}

/// One block's cells, ascending, and quads.
#[derive(Debug, Clone, Default)]
struct MeshPart {
    cells: Vec<u16>,
    vertices: Vec<Point3<f32>>,
    /// Label and instance.
    tags: Vec<(u16, u16)>,
    quads: Vec<Quad>,
}

impl MeshPart {
    /// Lists cells and quads, and makes room for the vertices.
    fn take_crossings(&mut self, layers: &[Layer; 8]) {
        let count = |set: u64| set.count_ones() as usize;
        let cells = layers.iter().map(|layer| count(layer.cells)).sum();
        self.cells.reserve(cells);
        self.vertices.reserve(cells);
        self.tags.reserve(cells);
        self.quads.reserve(layers.iter().flat_map(|layer| layer.edges).map(count).sum());
        for (z, layer) in layers.iter().enumerate() {
            self.cells.extend(ones(layer.cells).map(|cell| (cell + 64 * z) as u16));
            // Row by row, in a row axis by axis.
            let mut rows = layer.edges[0] | layer.edges[1] | layer.edges[2];
            while rows != 0 {
                let shift = rows.trailing_zeros() & !7;
                rows &= !(0xff << shift);
                let [x, y, z_edges] = layer.edges.map(|edges| edges >> shift & 0xff);
                let outside = layer.outside >> shift;
                self.quads.extend(ones(x | y << 8 | z_edges << 16).map(|edge| Quad {
                    voxel: [edge as u8 & 7, shift as u8 >> 3, z as u8],
                    axis: edge as u8 >> 3,
                    flip: outside >> (edge & 7) & 1 == 1,
                }));
            }
        }
    }

    fn clear(&mut self) {
        self.cells.clear();
        self.vertices.clear();
        self.tags.clear();
        self.quads.clear();
    }
}

/// In a layer: all voxels, x = 0, y = 0, x = y = 0.
const FACE_MASK: [u64; 4] = [u64::MAX, 0x0101_0101_0101_0101, 0xff, 1];

/// The mesh so far, by block.
#[derive(Debug, Clone, Default)]
pub(crate) struct MeshCache {
    seen: u32,
    /// Of all parts.
    vertices: usize,
    quads: usize,
    parts: Vec<(BlockKey, MeshPart)>,
    rank: FxHashMap<u64, usize>,
    shape: FxHashMap<u64, Box<Shape>>,
    /// Blocks to mesh again when their neighbours are back from the archive.
    waiting: Vec<BlockKey>,
}

impl MeshCache {
    /// Puts a part in its place and gives back what was there.
    fn insert(&mut self, key: BlockKey, part: MeshPart) -> MeshPart {
        self.vertices += part.vertices.len();
        self.quads += part.quads.len();
        let old = match self.rank.get(&key.packed()) {
            Some(rank) => std::mem::replace(&mut self.parts[*rank].1, part),
            None => {
                self.rank.insert(key.packed(), self.parts.len());
                self.parts.push((key, part));
                MeshPart::default()
            }
        };
        self.vertices -= old.vertices.len();
        self.quads -= old.quads.len();
        old
    }

    fn remove(&mut self, key: BlockKey) -> bool {
        let Some(rank) = self.rank.remove(&key.packed()) else {
            return false;
        };
        let (_, part) = self.parts.swap_remove(rank);
        self.vertices -= part.vertices.len();
        self.quads -= part.quads.len();
        if let Some((moved, _)) = self.parts.get(rank) {
            self.rank.insert(moved.packed(), rank);
        }
        true
    }
}
