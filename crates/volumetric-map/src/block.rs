//! A block of 8 x 8 x 8 voxels: distances, weights, label votes, and three bit sets that answer the common questions
//! (known? occupied? settled?) 64 voxels at a time.
//!
//! A voxel's number in its block is `x + 8 y + 64 z`; in a bit set that is bit `x + 8 y` of word `z`, so one word is
//! one horizontal layer of 64 columns.

use crate::config::VolumeConfig;
use crate::votes::Votes;

/// Voxels in a block.
pub const BLOCK_VOXELS: usize = 512;
/// The stored distance that means "one truncation distance".
pub(crate) const DISTANCE_ONE: i16 = 32_000;
/// No block.
pub(crate) const NONE: u32 = u32::MAX;

/// Where a block lies, in blocks from the world origin. Ordered by z, then y, then x.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BlockKey {
    /// Block layer.
    pub z: i32,
    /// Block row.
    pub y: i32,
    /// Block column.
    pub x: i32,
}

impl BlockKey {
    /// The block that holds a voxel.
    pub fn of_voxel(voxel: [i32; 3]) -> Self {
        Self { x: voxel[0] >> 3, y: voxel[1] >> 3, z: voxel[2] >> 3 }
    }

    /// The block's first voxel.
    pub fn first_voxel(self) -> [i32; 3] {
        [self.x << 3, self.y << 3, self.z << 3]
    }

    /// The neighbouring block.
    pub fn offset(self, dx: i32, dy: i32, dz: i32) -> Self {
        Self { x: self.x + dx, y: self.y + dy, z: self.z + dz }
    }

    /// 21 bits a coordinate: unique as long as the key is within +-2^20 blocks (+-400 km at 5 cm).
    pub(crate) fn packed(self) -> u64 {
        let bits = |v: i32| u64::from((v as u32) & 0x1f_ffff);
        bits(self.x) | bits(self.y) << 21 | bits(self.z) << 42
    }

    /// A number in the order of the keys, within the same bounds.
    pub(crate) fn ordinal(self) -> u64 {
        const HALF: i32 = 1 << 20;
        self.offset(HALF, HALF, HALF).packed()
    }
}

/// Number of a voxel in its block.
#[inline]
pub(crate) fn local_of(voxel: [i32; 3]) -> usize {
    ((voxel[0] & 7) | (voxel[1] & 7) << 3 | (voxel[2] & 7) << 6) as usize
}

/// One bit a voxel.
pub(crate) type VoxelSet = [u64; 8];

pub(crate) const ALL_VOXELS: VoxelSet = [u64::MAX; 8];

#[inline]
pub(crate) fn contains(set: &VoxelSet, local: usize) -> bool {
    set[local >> 6] >> (local & 63) & 1 == 1
}

#[inline]
pub(crate) fn insert(set: &mut VoxelSet, local: usize) {
    set[local >> 6] |= 1 << (local & 63);
}

/// One horizontal layer of what is kept for each voxel of a block.
#[inline]
pub(crate) fn layer_of<T>(values: &[T; BLOCK_VOXELS], z: usize) -> &[T; 64] {
    values[64 * z..][..64].try_into().expect("a layer has 64 voxels")
}

/// The set of a layer's voxels for which something holds.
#[inline]
pub(crate) fn set_of(layer: &[bool; 64]) -> u64 {
    let mut set = 0;
    for (y, row) in layer.chunks_exact(8).enumerate() {
        // Byte i of a word goes to bit 56 + i by the term 2^(56 - 7 i) of the factor; no two terms meet, so nothing is carried.
        let bytes = u64::from_le_bytes(std::array::from_fn(|x| u8::from(row[x])));
        set |= bytes.wrapping_mul(0x0102_0408_1020_4080) >> 56 << (8 * y);
    }
    set
}

#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub key: BlockKey,
    /// Weight >= min_weight.
    pub known: VoxelSet,
    /// Known, and the centre at most a quarter voxel in front of a surface (0.45 if it was occupied before).
    pub occupied: VoxelSet,
    /// Observed, and within four fifths of the truncation of a surface: looking through needs a second thought.
    pub near_surface: VoxelSet,
    /// Firmly free: looking through once more changes nothing.
    pub settled: VoxelSet,
    /// Scan in which the three sets below were last started afresh.
    pub scan: u32,
    /// Voxels in the truncation band of a return of this scan.
    pub in_band: VoxelSet,
    /// Voxels that hold a return of this scan.
    pub hit: VoxelSet,
    /// Voxels that a ray of this scan looked through.
    pub seen_through: VoxelSet,
    /// Last scan that changed `known` or `occupied`.
    pub occupancy_revision: u32,
    /// Last scan that changed distances inside the band, or votes.
    pub surface_revision: u32,
    pub weight: [u8; BLOCK_VOXELS],
    pub distance: [i16; BLOCK_VOXELS],
    pub votes: Option<Box<Votes>>,
}

impl Block {
    pub fn new(key: BlockKey) -> Self {
        Self {
            key,
            known: [0; 8],
            occupied: [0; 8],
            near_surface: [0; 8],
            settled: [0; 8],
            scan: 0,
            in_band: [0; 8],
            hit: [0; 8],
            seen_through: [0; 8],
            occupancy_revision: 0,
            surface_revision: 0,
            weight: [0; BLOCK_VOXELS],
            distance: [0; BLOCK_VOXELS],
            votes: None,
        }
    }

    /// Forgets what earlier scans marked; true the first time in a scan.
    #[inline]
    pub fn begin_scan(&mut self, scan: u32) -> bool {
        if self.scan == scan {
            return false;
        }
        self.scan = scan;
        self.in_band = [0; 8];
        self.hit = [0; 8];
        self.seen_through = [0; 8];
        true
    }

    /// Recomputes the bit sets of the given voxels from distances and weights; true if what the map answers has changed.
    pub fn refresh(&mut self, voxels: &VoxelSet, thresholds: &Thresholds) -> bool {
        let mut is_changed = false;
        for (z, voxels) in voxels.iter().enumerate() {
            let mut rest = *voxels;
            if rest == 0 {
                continue;
            }
            let weights: &[u8; 64] = self.weight[z * 64..][..64].try_into().expect("a layer has 64 voxels");
            let distances: &[i16; 64] = self.distance[z * 64..][..64].try_into().expect("a layer has 64 voxels");
            let before = self.occupied[z];
            let [mut known, mut occupied, mut near, mut settled] = [0u64; 4];
            while rest != 0 {
                let i = rest.trailing_zeros();
                rest &= rest - 1;
                let (weight, distance) = (weights[i as usize & 63], distances[i as usize & 63]);
                let is_known = weight >= thresholds.min_weight;
                // Hysteresis: range noise must not flip voxels at the border, and all that hangs on them, with every scan.
                let until = if before >> i & 1 == 1 { thresholds.occupied_until } else { thresholds.occupied_below };
                known |= u64::from(is_known) << i;
                occupied |= u64::from(is_known & (distance < until)) << i;
                near |= u64::from((weight > 0) & (distance < thresholds.near_below)) << i;
                settled |=
                    u64::from((weight >= thresholds.settled_weight) & (distance >= thresholds.settled_above)) << i;
            }
            let put = |word: u64, new: u64| word & !*voxels | new;
            let (known, occupied) = (put(self.known[z], known), put(before, occupied));
            is_changed |= known != self.known[z] || occupied != before;
            self.known[z] = known;
            self.occupied[z] = occupied;
            self.near_surface[z] = put(self.near_surface[z], near);
            self.settled[z] = put(self.settled[z], settled);
        }
        is_changed
    }

    /// The last change of anything.
    pub fn newest_revision(&self) -> u32 {
        self.occupancy_revision.max(self.surface_revision)
    }

    /// Folds one observation of a signed distance into a voxel.
    #[inline]
    pub fn observe_distance(&mut self, local: usize, distance: f32, thresholds: &Thresholds) {
        let old = f32::from(self.distance[local]);
        let mut weight = self.weight[local];
        // A surface where the map was sure of free space: something came (or the pose was corrected). Believe it quickly.
        if old > thresholds.contradiction_above && distance < thresholds.contradiction_below {
            weight = weight.min(CONTRADICTION_WEIGHT);
        }
        let new = old + (distance - old) * thresholds.reciprocal[usize::from(weight) + 1];
        self.distance[local] = new as i16;
        self.weight[local] = (weight + 1).min(thresholds.max_weight);
    }

    /// Folds one scan that looked through a voxel.
    #[inline]
    pub fn observe_free(&mut self, local: usize, thresholds: &Thresholds) {
        let old = f32::from(self.distance[local]);
        let weight = self.weight[local];
        let clear = thresholds.clear_weight;
        let share = f32::from(clear) * thresholds.reciprocal[usize::from(weight) + usize::from(clear)];
        let new = old + (f32::from(DISTANCE_ONE) - old) * share;
        // Truncation towards zero would stop short of the limit; round up, free space is free.
        self.distance[local] = new.ceil() as i16;
        self.weight[local] = (weight + clear).min(thresholds.max_weight);
    }
}

/// The weight left to a "free" that a return contradicts: half a dozen returns close a voxel.
const CONTRADICTION_WEIGHT: u8 = 1;

/// The numbers of the configuration in stored units.
#[derive(Debug, Clone)]
pub(crate) struct Thresholds {
    pub min_weight: u8,
    pub max_weight: u8,
    pub clear_weight: u8,
    pub settled_weight: u8,
    pub settled_above: i16,
    /// Occupied below this: a quarter of a voxel, so that an occupied cell sticks out of the true surface by at most three
    /// quarters of a voxel, and a surface on the border of two voxels does not flicker with the noise.
    pub occupied_below: i16,
    /// An occupied voxel stays so up to this: less than half a voxel, so it sticks out by less than one.
    pub occupied_until: i16,
    pub near_below: i16,
    pub contradiction_above: f32,
    pub contradiction_below: f32,
    /// Stored units per metre.
    pub units_per_m: f32,
    /// 1 / n.
    pub reciprocal: [f32; 256],
}

impl Thresholds {
    pub fn new(config: &VolumeConfig) -> Self {
        let units_per_m = f64::from(DISTANCE_ONE) / config.truncation_m;
        let mut reciprocal = [1.0; 256];
        for (n, value) in reciprocal.iter_mut().enumerate().skip(1) {
            *value = 1.0 / n as f32;
        }
        Self {
            min_weight: config.min_weight,
            max_weight: config.max_weight,
            clear_weight: config.clear_weight,
            settled_weight: (2 * config.clear_weight).min(config.max_weight).max(config.min_weight),
            settled_above: (0.98 * f64::from(DISTANCE_ONE)) as i16,
            occupied_below: (0.25 * config.voxel_m * units_per_m) as i16,
            occupied_until: (0.45 * config.voxel_m * units_per_m) as i16,
            near_below: (0.8 * f64::from(DISTANCE_ONE)) as i16,
            contradiction_above: 0.35 * f32::from(DISTANCE_ONE),
            contradiction_below: (config.voxel_m.min(0.4 * config.truncation_m) * units_per_m) as f32,
            units_per_m: units_per_m as f32,
            reciprocal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_neighbouring_voxels_across_zero() {
        assert_eq!(BlockKey::of_voxel([-1, 0, 7]), BlockKey { x: -1, y: 0, z: 0 });
        assert_eq!(local_of([-1, 0, 7]), 7 + 64 * 7);
        assert_ne!(BlockKey { x: -1, y: 0, z: 0 }.packed(), BlockKey { x: 1, y: 0, z: 0 }.packed());
        let (low, high) = (BlockKey { x: 1, y: 0, z: -1 }, BlockKey { x: -1, y: 0, z: 0 });
        assert!(low < high && low.ordinal() < high.ordinal());
        assert_eq!(BlockKey { x: -1, y: 2, z: 3 }.first_voxel(), [-8, 16, 24]);
    }

    #[test]
    fn a_layer_of_answers_as_a_set() {
        for set in [0, u64::MAX, 1, 1 << 63, 0x8040_2010_0804_0201, 0x0123_4567_89ab_cdef] {
            assert_eq!(set_of(&std::array::from_fn(|i| set >> i & 1 == 1)), set);
        }
    }

    #[test]
    fn a_firm_surface_opens_after_a_few_scans_that_look_through_and_closes_after_a_few_returns() {
        let thresholds = Thresholds::new(&VolumeConfig::default());
        let mut block = Block::new(BlockKey { x: 0, y: 0, z: 0 });
        let inside = -0.05 * thresholds.units_per_m;
        for _ in 0..50 {
            block.observe_distance(0, inside, &thresholds);
        }
        block.refresh(&ALL_VOXELS, &thresholds);
        assert!(contains(&block.occupied, 0) && block.weight[0] == 20);
        let mut scans = 0;
        while contains(&block.occupied, 0) {
            block.observe_free(0, &thresholds);
            block.refresh(&ALL_VOXELS, &thresholds);
            scans += 1;
        }
        // By hand: -0.05 -> 0.0167 -> 0.0611, an occupied voxel stays so up to 0.0225.
        assert_eq!(scans, 2);
        for _ in 0..50 {
            block.observe_free(0, &thresholds);
        }
        block.refresh(&ALL_VOXELS, &thresholds);
        assert!(contains(&block.settled, 0));
        let mut returns = 0;
        while !contains(&block.occupied, 0) {
            block.observe_distance(0, 0.0, &thresholds);
            block.refresh(&ALL_VOXELS, &thresholds);
            returns += 1;
        }
        // By hand: 0.15 -> 0.075 -> 0.0375 with weight one, then a mean: 0.025, 0.019, 0.015, 0.0125 (rounded down).
        assert!((5..=7).contains(&returns), "{returns}");
    }
}
