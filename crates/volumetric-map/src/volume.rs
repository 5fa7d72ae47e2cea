//! The hashed truncated signed distance volume: 8^3-voxel blocks that know their neighbours.

use nalgebra::{Point3, Vector3};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::block::{ALL_VOXELS, Block, BlockKey, NONE, Thresholds, contains, local_of};
use crate::config::{ConfigError, VolumeConfig};
use crate::mesh::MeshCache;
use crate::ray::floor;
use crate::recent::Recent;
use crate::votes::Votes;

/// What the map says about a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub enum Cell {
    /// Nothing was ever seen here.
    #[default]
    Unknown,
    /// Seen through.
    Free,
    /// A surface, or the inside of a thing just behind one.
    Occupied,
}

/// A map of signed distances, free space and labels that grows where points fall.
///
/// Made by [`Volume::new`], fed by [`Volume::integrate`](crate::Volume::integrate) and [`Volume::vote_labels`], read by
/// [`Volume::observe`], the grids, the mesh and [`DistanceField`](crate::DistanceField).
#[derive(Debug, Clone)]
pub struct Volume {
    pub(crate) config: VolumeConfig,
    pub(crate) thresholds: Thresholds,
    pub(crate) blocks: Vec<Block>,
    /// What walks need to know of each block.
    pub(crate) nodes: Vec<Node>,
    pub(crate) recent: Recent,
    index: FxHashMap<u64, u32>,
    /// Number of the last change (scan or vote).
    pub(crate) revision: u32,
    /// Scans integrated so far: whose turn it is to clear.
    pub(crate) scans: u32,
    pub(crate) mesh_cache: MeshCache,
    /// Keys of blocks that are kept elsewhere (see `archive`).
    pub(crate) archived: FxHashSet<u64>,
}

/// A block in the net of blocks; small, so that walks stay in the cache.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// Face neighbours: -x, +x, -y, +y, -z, +z; [`NONE`] where there is none.
    pub links: [u32; 6],
    /// Every voxel of the block is firmly free.
    pub is_settled: bool,
}

impl Volume {
    /// An empty volume.
    ///
    /// # Errors
    /// [`ConfigError`] if the configuration is not valid.
    pub fn new(config: VolumeConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self {
            thresholds: Thresholds::new(&config),
            config,
            blocks: Vec::new(),
            nodes: Vec::new(),
            recent: Recent::default(),
            index: FxHashMap::default(),
            revision: 0,
            scans: 0,
            mesh_cache: MeshCache::default(),
            archived: FxHashSet::default(),
        })
    }

    /// An empty volume with the same settings.
    pub(crate) fn empty_copy(&self) -> Self {
        Self {
            config: self.config.clone(),
            thresholds: self.thresholds.clone(),
            blocks: Vec::new(),
            nodes: Vec::new(),
            recent: Recent::default(),
            index: FxHashMap::default(),
            revision: self.revision,
            scans: 0,
            mesh_cache: MeshCache::default(),
            archived: FxHashSet::default(),
        }
    }

    /// The configuration it was made with.
    pub fn config(&self) -> &VolumeConfig {
        &self.config
    }

    /// Number of blocks in memory.
    pub fn block_count(&self) -> usize {
        self.blocks.len()
    }

    /// Rises by one with every scan and every vote; readers use it to find what changed.
    pub fn revision(&self) -> u32 {
        self.revision
    }

    /// Unknown, free or occupied at a world point. Points that are not finite are unknown.
    pub fn observe(&self, point: &Point3<f64>) -> Cell {
        self.voxel_of(point).map_or(Cell::Unknown, |voxel| self.observe_voxel(voxel))
    }

    /// The stored signed distance at a world point, metres, positive in front of surfaces and cut at the truncation;
    /// `None` where unknown.
    pub fn signed_distance(&self, point: &Point3<f64>) -> Option<f64> {
        let voxel = self.voxel_of(point)?;
        let block = self.block(BlockKey::of_voxel(voxel))?;
        let local = local_of(voxel);
        contains(&block.known, local).then(|| f64::from(block.distance[local]) / f64::from(self.thresholds.units_per_m))
    }

    /// The label that leads in the voxel at a world point; `None` where nobody voted.
    pub fn label_at(&self, point: &Point3<f64>) -> Option<u16> {
        self.leader_at(point).map(|(label, _)| label)
    }

    /// The instance that leads in the voxel at a world point; `None` where nobody voted for one.
    pub fn instance_at(&self, point: &Point3<f64>) -> Option<u16> {
        self.leader_at(point).map(|(_, instance)| instance).filter(|instance| *instance != 0)
    }

    fn leader_at(&self, point: &Point3<f64>) -> Option<(u16, u16)> {
        let voxel = self.voxel_of(point)?;
        self.block(BlockKey::of_voxel(voxel))?.votes.as_ref()?.leader(local_of(voxel))
    }

    /// Votes for the label of the voxels that hold the points: a Misra-Gries count with one slot, so that the majority of a
    /// voxel's votes wins whatever their order. Label 0 means "none" and is skipped, as are points that are not finite or
    /// lie where the map has no block (integrate first, then vote). Returns the number of votes counted.
    pub fn vote_labels(&mut self, labelled: &[(Point3<f32>, u16)]) -> usize {
        self.vote(labelled.iter().map(|(point, label)| (point, *label, 0)))
    }

    /// The same with an instance (0 = none known) beside each label: (point, label, instance). What is voted for is the pair, so
    /// two things of one label keep apart where they touch.
    pub fn vote_instances(&mut self, labelled: &[(Point3<f32>, u16, u16)]) -> usize {
        self.vote(labelled.iter().map(|(point, label, instance)| (point, *label, *instance)))
    }

    fn vote<'a>(&mut self, labelled: impl Iterator<Item = (&'a Point3<f32>, u16, u16)>) -> usize {
        self.revision += 1;
        let mut counted = 0;
        // Neighbouring points mostly lie in the same block: saves the hash.
        let mut last: Option<(BlockKey, u32)> = None;
        for (point, label, instance) in labelled.filter(|(_, label, _)| *label != 0) {
            let Some(voxel) = self.voxel_of(&point.cast::<f64>()) else {
                continue;
            };
            let key = BlockKey::of_voxel(voxel);
            let known = last.filter(|(other, _)| *other == key).map(|(_, id)| id);
            let Some(id) = known.or_else(|| self.block_id(key)) else {
                continue;
            };
            last = Some((key, id));
            counted += 1;
            let block = &mut self.blocks[id as usize];
            if block.votes.get_or_insert_with(Votes::none).vote(local_of(voxel), label, instance, 1) {
                block.surface_revision = self.revision;
                self.recent.renew(id);
            }
        }
        counted
    }

    /// World bounds (min, max) of all blocks, metres; `None` when empty.
    pub fn bounds(&self) -> Option<(Point3<f64>, Point3<f64>)> {
        let first = self.blocks.first()?.key;
        let mut low = [first.x, first.y, first.z];
        let mut high = low;
        for block in &self.blocks {
            for (axis, v) in [block.key.x, block.key.y, block.key.z].into_iter().enumerate() {
                low[axis] = low[axis].min(v);
                high[axis] = high[axis].max(v);
            }
        }
        let edge = 8.0 * self.config.voxel_m;
        let at = |k: [i32; 3], add: i32| Point3::from(Vector3::from(k.map(|v| f64::from(v + add) * edge)));
        Some((at(low, 0), at(high, 1)))
    }

    /// World position of a voxel's centre.
    pub fn voxel_center(&self, voxel: [i32; 3]) -> Point3<f64> {
        Point3::from(Vector3::from(voxel.map(|i| (f64::from(i) + 0.5) * self.config.voxel_m)))
    }

    /// The voxel that holds a world point; `None` if not finite or absurdly far away.
    pub fn voxel_of(&self, point: &Point3<f64>) -> Option<[i32; 3]> {
        let mut voxel = [0; 3];
        for axis in 0..3 {
            let q = point[axis] / self.config.voxel_m;
            if q.is_nan() || q.abs() >= MAX_VOXEL_INDEX {
                return None;
            }
            voxel[axis] = floor(q);
        }
        Some(voxel)
    }

    /// Blocks whose occupancy, band or votes changed after a revision, in no particular order.
    pub(crate) fn changed_since(&self, revision: u32) -> impl Iterator<Item = &Block> {
        self.recent.iter().map(|id| &self.blocks[id as usize]).take_while(move |b| b.newest_revision() > revision)
    }

    /// Number of voxels that took at least one observation.
    pub fn observed_voxels(&self) -> usize {
        self.blocks.iter().map(|block| block.weight.iter().filter(|weight| **weight > 0).count()).sum()
    }

    /// Bytes taken by the blocks, their votes and the index (with its room to grow); the mesh is not counted.
    pub fn memory_bytes(&self) -> usize {
        let votes: usize = self.blocks.iter().filter_map(|b| b.votes.as_ref()).map(|votes| votes.bytes()).sum();
        let index = self.index.capacity() * 8 / 7 * (size_of::<(u64, u32)>() + 1);
        self.blocks.len() * (size_of::<Block>() + size_of::<Node>() + size_of::<[u32; 2]>()) + votes + index
    }

    /// Checks everything that must hold between the parts; for tests.
    ///
    /// # Panics
    /// With the name of the rule that is broken.
    pub fn check_invariants(&self) {
        assert_eq!(self.index.len(), self.blocks.len(), "index and blocks have one entry per block");
        for (id, block) in self.blocks.iter().enumerate() {
            assert_eq!(self.block_id(block.key), Some(id as u32), "the index finds the block");
            for (side, link) in self.nodes[id].links.iter().enumerate() {
                let expected = self.block_id(neighbour_key(block.key, side)).unwrap_or(NONE);
                assert_eq!(*link, expected, "links agree with the index");
            }
            let mut copy = block.clone();
            copy.refresh(&ALL_VOXELS, &self.thresholds);
            assert_eq!(copy.known, block.known, "known set follows the weights");
            assert_eq!(copy.occupied, block.occupied, "occupied set follows the distances");
            assert_eq!(copy.settled, block.settled, "settled set follows both");
            assert_eq!(self.nodes[id].is_settled, block.settled == ALL_VOXELS, "summary follows the settled set");
            assert!(block.weight.iter().all(|w| *w <= self.config.max_weight), "weights are capped");
        }
        let order: Vec<u32> = self.recent.iter().map(|id| self.blocks[id as usize].newest_revision()).collect();
        assert_eq!(order.len(), self.blocks.len(), "every block is in the list of changes");
        assert!(order.windows(2).all(|w| w[0] >= w[1]), "changes are listed from the newest");
    }

    pub(crate) fn observe_voxel(&self, voxel: [i32; 3]) -> Cell {
        let Some(block) = self.block(BlockKey::of_voxel(voxel)) else {
            return Cell::Unknown;
        };
        let local = local_of(voxel);
        if contains(&block.occupied, local) {
            Cell::Occupied
        } else if contains(&block.known, local) {
            Cell::Free
        } else {
            Cell::Unknown
        }
    }

    #[inline]
    pub(crate) fn block_id(&self, key: BlockKey) -> Option<u32> {
        self.index.get(&key.packed()).copied()
    }

    #[inline]
    pub(crate) fn block(&self, key: BlockKey) -> Option<&Block> {
        self.block_id(key).map(|id| &self.blocks[id as usize])
    }

    /// Finds or makes a block; `None` when the volume is full.
    pub(crate) fn ensure_block(&mut self, key: BlockKey) -> Option<u32> {
        if let Some(id) = self.block_id(key) {
            return Some(id);
        }
        if self.blocks.len() >= self.config.max_blocks {
            return None;
        }
        let mut block = Block::new(key);
        block.occupancy_revision = self.revision;
        Some(self.push_block(block))
    }

    /// Adds a block whose key is new and that changed at the present revision, and ties it to its neighbours.
    pub(crate) fn push_block(&mut self, block: Block) -> u32 {
        let id = self.blocks.len() as u32;
        let key = block.key;
        self.index.insert(key.packed(), id);
        self.archived.remove(&key.packed());
        let is_settled = block.settled == ALL_VOXELS;
        self.blocks.push(block);
        self.nodes.push(Node { links: [NONE; 6], is_settled });
        self.recent.push();
        for side in 0..6 {
            let neighbour = self.block_id(neighbour_key(key, side)).unwrap_or(NONE);
            self.nodes[id as usize].links[side] = neighbour;
            if neighbour != NONE {
                self.nodes[neighbour as usize].links[side ^ 1] = id;
            }
        }
        id
    }
}

impl Volume {
    /// Takes a block out; the last one takes its number.
    pub(crate) fn remove_block(&mut self, id: u32) -> Block {
        self.index.remove(&self.blocks[id as usize].key.packed());
        self.tie_neighbours(id, NONE);
        self.recent.remove(id);
        let block = self.blocks.swap_remove(id as usize);
        self.nodes.swap_remove(id as usize);
        if (id as usize) < self.blocks.len() {
            self.index.insert(self.blocks[id as usize].key.packed(), id);
            self.tie_neighbours(id, id);
        }
        block
    }

    /// Lets the neighbours of a block link to this number instead.
    fn tie_neighbours(&mut self, id: u32, number: u32) {
        for side in 0..6 {
            let neighbour = self.nodes[id as usize].links[side];
            if neighbour != NONE {
                self.nodes[neighbour as usize].links[side ^ 1] = number;
            }
        }
    }
}

/// Voxel indices stay well inside what a block key can hold.
pub(crate) const MAX_VOXEL_INDEX: f64 = (1 << 22) as f64;

fn neighbour_key(key: BlockKey, side: usize) -> BlockKey {
    let step = if side & 1 == 1 { 1 } else { -1 };
    match side >> 1 {
        0 => key.offset(step, 0, 0),
        1 => key.offset(0, step, 0),
        _ => key.offset(0, 0, step),
    }
}
