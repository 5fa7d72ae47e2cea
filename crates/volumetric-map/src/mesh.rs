//! The surface as triangles: surface nets (Gibson 1998) per block, only where something changed.
//!
//! A cell is the cube between eight neighbouring voxel centres. A cell whose corners lie on both sides of the surface gets one
//! vertex, the mean of the crossings on its twelve edges. Every voxel edge that crosses the surface gives one quad between
//! its four cells. A block owns the cells and edges that begin in it, so the mesh of the whole is the sum of the blocks, and a vertex is
//! named by its cell: the name stays as long as the surface runs through the cell.

use std::collections::hash_map::Entry;

use nalgebra::Point3;
use rustc_hash::FxHashMap;

use crate::block::{BLOCK_VOXELS, Block, BlockKey, VoxelSet, local_of};
use crate::stride::voxel_of;
use crate::volume::Volume;

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
/// vertices, and all faces whose three corners exist.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshPatch {
    /// Names of the vertices, ascending within a layer of cells.
    pub ids: Vec<VertexId>,
    /// Positions, labels and instances of the vertices (no faces).
    pub vertices: Mesh,
    /// Corners of triangles, some of them in neighbouring blocks.
    pub faces: Vec<[VertexId; 3]>,
}

impl Volume {
    /// Brings the mesh up to date; looks only at blocks whose surface changed since the last call by more than a fifth of a voxel
    /// (or whose labels did), and at the neighbours that share a changed voxel with them. So a vertex may lag by a centimetre;
    /// [`complete_mesh`](Self::complete_mesh) leaves nothing out.
    pub fn update_mesh(&mut self) -> MeshDelta {
        let units_per_voxel = self.config.voxel_m * f64::from(self.thresholds.units_per_m);
        let tolerance = Tolerance { moved: (0.2 * units_per_voxel) as u16, near: (1.1 * units_per_voxel) as u16 };
        self.mesh_again(&tolerance, self.mesh_cache.seen)
    }

    /// The same for every change, however small, also of those before the last call: the mesh that
    /// [`rebuild_mesh`](Self::rebuild_mesh) makes. It compares the whole map with what was meshed; for a mesh that is kept.
    pub fn complete_mesh(&mut self) -> MeshDelta {
        self.mesh_again(&Tolerance { moved: 0, near: u16::MAX }, 0)
    }

    fn mesh_again(&mut self, tolerance: &Tolerance, since: u32) -> MeshDelta {
        let mut stale = self.stale_blocks(tolerance, since);
        stale.append(&mut self.mesh_cache.waiting);
        stale.sort_unstable();
        stale.dedup();
        let mut delta = MeshDelta::default();
        let mut part = MeshPart::default();
        for key in stale {
            if self.reaches_archive(key) {
                self.mesh_cache.waiting.push(key);
                continue;
            }
            self.fill_part(key, &mut part);
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
            patch.faces.extend(split(quad.cells(key).map(VertexId)));
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
        let changed = self.recent.iter().map(|id| &self.blocks[id as usize]);
        for block in changed.take_while(|block| block.newest_revision() > since) {
            let shape = match cache.shape.entry(block.key.packed()) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(_) if block.near_surface == [0; 8] => continue,
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

    fn fill_part(&self, key: BlockKey, part: &mut MeshPart) {
        part.clear();
        let corner_blocks: [Option<&Block>; 8] =
            std::array::from_fn(|k| self.block(key.offset(k as i32 & 1, k as i32 >> 1 & 1, k as i32 >> 2)));
        let Some(patch) = Patch::of(&corner_blocks) else {
            return;
        };
        let voxel = self.config.voxel_m as f32;
        // The first voxel's centre, rounded once.
        let base = key.first_voxel().map(|v| ((f64::from(v) + 0.5) * self.config.voxel_m) as f32);
        let has_votes = corner_blocks.iter().flatten().any(|block| block.votes.is_some());
        for z in 0..8usize {
            for y in 0..8usize {
                let (cells, edges) = patch.crossings(y, z);
                for axis in 0..3u8 {
                    for x in ones(edges[usize::from(axis)]) {
                        let flip = patch.outside[9 * z + y] >> x & 1 == 1;
                        part.quads.push(Quad { voxel: [x as u8, y as u8, z as u8], axis, flip });
                    }
                }
                for x in ones(cells) {
                    let offset = patch.cell_vertex(x + 9 * y + 81 * z);
                    let at = |axis: usize, local: usize| base[axis] + (local as f32 + offset[axis]) * voxel;
                    part.cells.push((x + 8 * y + 64 * z) as u16);
                    part.vertices.push(Point3::new(at(0, x), at(1, y), at(2, z)));
                    part.tags.push(if has_votes { cell_tag(&corner_blocks, [x, y, z], offset) } else { (0, 0) });
                }
            }
        }
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

/// Label and instance of a cell's vertex: what leads in the voxel nearest to it, or where nobody voted on that one, what has the most
/// votes among the eight voxels of the cell; ties to the smaller.
fn cell_tag(blocks: &[Option<&Block>; 8], cell: [usize; 3], offset: [f32; 3]) -> (u16, u16) {
    let vote_of = |corner: [usize; 3]| {
        let at = [cell[0] + corner[0], cell[1] + corner[1], cell[2] + corner[2]];
        let votes = blocks[at[0] >> 3 | at[1] >> 3 << 1 | at[2] >> 3 << 2]?.votes.as_ref()?;
        let local = (at[0] & 7) | (at[1] & 7) << 3 | (at[2] & 7) << 6;
        votes.leader(local).map(|tag| (tag, u32::from(votes.count[local])))
    };
    if let Some((tag, _)) = vote_of(offset.map(|part| usize::from(part > 0.5))) {
        return tag;
    }
    let votes: [_; 8] = std::array::from_fn(|k| vote_of([k & 1, k >> 1 & 1, k >> 2]));
    let tally = |tag| votes.iter().flatten().filter(|vote| vote.0 == tag).map(|vote| vote.1).sum::<u32>();
    let best = votes.iter().flatten().map(|vote| vote.0).max_by_key(|tag| (tally(*tag), std::cmp::Reverse(*tag)));
    best.unwrap_or((0, 0))
}

fn split<T: Copy>(corners: [T; 4]) -> [[T; 3]; 2] {
    [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
}

/// Positions of the ones of a row.
fn ones(mut row: u16) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let next = (row != 0).then(|| row.trailing_zeros() as usize);
        row &= row.wrapping_sub(1);
        next
    })
}

struct Patch {
    distance: [i16; 729],
    /// Rows along x, number `9 z + y`: bit x is set where the voxel is known and inside, or known and outside.
    inside: [u16; 81],
    outside: [u16; 81],
}

impl Patch {
    /// The 9^3 voxels that a block's cells touch, from it and its seven positive neighbours; `None` if there is no such block, or
    /// none of the voxels lies inside something.
    fn of(blocks: &[Option<&Block>; 8]) -> Option<Self> {
        blocks[0]?;
        if blocks.iter().flatten().all(|block| block.near_surface == [0; 8]) {
            return None;
        }
        let mut patch = Self { distance: [0; 729], inside: [0; 81], outside: [0; 81] };
        for (corner, block) in blocks.iter().enumerate() {
            let Some(block) = block else { continue };
            let (shift_x, shift_y, shift_z) = (corner & 1, corner >> 1 & 1, corner >> 2);
            let range = |shift: usize| if shift == 1 { 8..9usize } else { 0..8usize };
            let width = if shift_x == 1 { 1 } else { 8 };
            for z in range(shift_z) {
                for y in range(shift_y) {
                    let first = (y & 7) << 3 | (z & 7) << 6;
                    let known = (block.known[z & 7] >> (8 * (y & 7)) & if width == 8 { 0xff } else { 1 }) as u16;
                    let to = 8 * shift_x + 9 * y + 81 * z;
                    patch.distance[to..to + width].copy_from_slice(&block.distance[first..first + width]);
                    // Only voxels near a surface can lie inside.
                    let near = (block.near_surface[z & 7] >> (8 * (y & 7))) as u16 & known;
                    let inside = ones(near).fold(0, |bits, x| bits | u16::from(block.distance[first + x] < 0) << x);
                    patch.inside[9 * z + y] |= (known & inside) << (8 * shift_x);
                    patch.outside[9 * z + y] |= (known & !inside) << (8 * shift_x);
                }
            }
        }
        patch.inside.iter().any(|row| *row != 0).then_some(patch)
    }

    /// In the row (y, z) of cells: which have all corners known and lie on both sides; and which voxels begin a crossing edge along x,
    /// y and z.
    fn crossings(&self, y: usize, z: usize) -> (u16, [u16; 3]) {
        let row = 9 * z + y;
        let four = [row, row + 1, row + 9, row + 10];
        let (mut inside, mut outside, mut known) = (0, 0, u16::MAX);
        for r in four {
            inside |= self.inside[r] | self.inside[r] >> 1;
            outside |= self.outside[r] | self.outside[r] >> 1;
            let both = self.inside[r] | self.outside[r];
            known &= both & both >> 1;
        }
        let (i, o) = (self.inside[row], self.outside[row]);
        let crossing = |i2: u16, o2: u16| (i & o2 | o & i2) & 0xff;
        (
            inside & outside & known & 0xff,
            [
                crossing(i >> 1, o >> 1),
                crossing(self.inside[row + 1], self.outside[row + 1]),
                crossing(self.inside[row + 9], self.outside[row + 9]),
            ],
        )
    }

    /// Mean of the crossings on the edges of a cell that has some, in voxels from the cell's first voxel centre.
    fn cell_vertex(&self, base: usize) -> [f32; 3] {
        let d: [f32; 8] =
            std::array::from_fn(|k| f32::from(self.distance[base + (k & 1) + 9 * (k >> 1 & 1) + 81 * (k >> 2)]));
        // The four edges of an axis together, without branches: selections of four lanes each.
        let along = |first: [usize; 4], step: usize| {
            let mut crossing = [0f32; 4];
            let mut at = [0f32; 4];
            for (lane, a) in first.into_iter().enumerate() {
                let (a, b) = (d[a], d[a + step]);
                let is_crossing = (a < 0.0) != (b < 0.0);
                crossing[lane] = if is_crossing { 1.0 } else { 0.0 };
                at[lane] = if is_crossing { a / (a - b) } else { 0.0 };
            }
            (crossing, at)
        };
        // Corner k lies at (k & 1, k >> 1 & 1, k >> 2): of the edges along an axis the lanes run over the other two.
        let (cx, x) = along([0, 2, 4, 6], 1);
        let (cy, y) = along([0, 1, 4, 5], 2);
        let (cz, z) = along([0, 1, 2, 3], 4);
        let sum = |v: [f32; 4]| (v[0] + v[1]) + (v[2] + v[3]);
        let scale = 1.0 / (sum(cx) + sum(cy) + sum(cz));
        [
            (sum(x) + (cy[1] + cy[3]) + (cz[1] + cz[3])) * scale,
            (sum(y) + (cx[1] + cx[3]) + (cz[2] + cz[3])) * scale,
            (sum(z) + (cx[2] + cx[3]) + (cy[2] + cy[3])) * scale,
        ]
    }
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
    fn clear(&mut self) {
        self.cells.clear();
        self.vertices.clear();
        self.tags.clear();
        self.quads.clear();
    }
}

/// What a block looked like when it was last meshed.
#[derive(Debug, Clone)]
struct Shape {
    known: VoxelSet,
    /// Where the distance may be small.
    near_surface: VoxelSet,
    distance: [i16; BLOCK_VOXELS],
    label: Option<Box<[u16; BLOCK_VOXELS]>>,
    instance: Option<Box<[u16; BLOCK_VOXELS]>>,
}

impl Shape {
    /// Of a block that was never meshed: every known voxel is new.
    const NONE: Self =
        Self { known: [0; 8], near_surface: [0; 8], distance: [0; BLOCK_VOXELS], label: None, instance: None };

    /// Takes over what the block looks like now, except for the distances of some voxels.
    fn take(&mut self, block: &Block, kept: &VoxelSet) {
        for (z, kept) in kept.iter().enumerate() {
            let layer = 64 * z..64 * z + 64;
            let mut old = [0; 64];
            old.copy_from_slice(&self.distance[layer.clone()]);
            self.distance[layer].copy_from_slice(&block.distance[64 * z..][..64]);
            let mut rest = *kept;
            while rest != 0 {
                let local = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                self.distance[64 * z + local] = old[local];
            }
            self.near_surface[z] = block.near_surface[z] | self.near_surface[z] & *kept;
        }
        self.known = block.known;
        if let Some(votes) = &block.votes {
            match &mut self.label {
                Some(label) => label.copy_from_slice(&votes.label),
                None => self.label = Some(Box::new(votes.label)),
            }
            self.instance.clone_from(&votes.instance);
        }
    }

    /// Voxels that are not what they were: known or not, label, or, near the surface, distance.
    fn moved(&self, block: &Block, tolerance: &Tolerance) -> VoxelSet {
        let mut moved: VoxelSet = std::array::from_fn(|z| self.known[z] ^ block.known[z]);
        for (z, moved) in moved.iter_mut().enumerate() {
            if tolerance.moved > 0 && self.near_surface[z] | block.near_surface[z] == 0 {
                continue;
            }
            let (old, new) = (&self.distance[64 * z..][..64], &block.distance[64 * z..][..64]);
            // Only near the surface: a voxel far from it that changes moves no vertex.
            let is_moved = |(a, b): (&i16, &i16)| {
                (a.abs_diff(*b) > tolerance.moved) & (a.unsigned_abs().min(b.unsigned_abs()) < tolerance.near)
            };
            if old.iter().zip(new).fold(false, |any, pair| any | is_moved(pair)) {
                for (bit, pair) in old.iter().zip(new).enumerate() {
                    *moved |= u64::from(is_moved(pair)) << bit;
                }
            }
        }
        let none = [0; BLOCK_VOXELS];
        let votes = block.votes.as_ref();
        for (old, new) in [
            (self.label.as_deref(), votes.map(|votes| &votes.label)),
            (self.instance.as_deref(), votes.and_then(|votes| votes.instance.as_deref())),
        ] {
            let (old, new) = (old.unwrap_or(&none), new.unwrap_or(&none));
            if old != new {
                for (local, (old, new)) in old.iter().zip(new).enumerate() {
                    moved[local >> 6] |= u64::from(old != new) << (local & 63);
                }
            }
        }
        moved
    }
}

/// In stored units.
struct Tolerance {
    /// A voxel has moved if its distance changed by more than this.
    moved: u16,
    /// And was or is nearer to the surface than this.
    near: u16,
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
