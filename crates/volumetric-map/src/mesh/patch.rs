//! The voxels that a block's cells touch, and what their signs say: cells and edges on the surface, a layer of 64 at a time.

use crate::block::{Block, layer_of, set_of};

use super::FACE_MASK;
use super::cell::cell_vertex;

/// Room for the 9^3 voxels of one block after the other: the block's own and the first ones of its seven positive neighbours.
pub(super) struct Patch {
    /// Rows along x, number `9 z + y`; nine numbers of a row count, and only those that touch a cell of `layers`.
    distance: [[i16; ROW]; 81],
    /// Of the cells and edges that begin in layer z.
    pub layers: [Layer; 8],
    /// Room for the corners of 64 cells: of the four edges along x, both ends of each in one word.
    corners: [[u32; 64]; 4],
}

/// Sixteen, so that a row is copied as a whole and found without a multiplication.
const ROW: usize = 16;

/// Bit `x + 8 y` is the cell or edge that begins in voxel (x, y).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Layer {
    /// Cells whose corners are all known and lie on both sides.
    pub cells: u64,
    /// Edges along x, y and z that cross the surface.
    pub edges: [u64; 3],
    /// Voxels known to lie outside.
    pub outside: u64,
}

impl Patch {
    pub fn new() -> Self {
        Self { distance: [[0; ROW]; 81], layers: [Layer::default(); 8], corners: [[0; 64]; 4] }
    }

    /// Reads a block and its positive neighbours (number `x + 2 y + 4 z`); false, and nothing is read, if there is no such block or none
    /// of the voxels lies inside something.
    pub fn read(&mut self, blocks: &[Option<&Block>; 8]) -> bool {
        if blocks[0].is_none() {
            return false;
        }
        let signs: [Signs; 9] = std::array::from_fn(|z| Signs::of(&blocks[z >> 3 << 2..][..4], z & 7));
        if signs.iter().all(|signs| signs.any_inside == 0) {
            return false;
        }
        for (layer, pair) in self.layers.iter_mut().zip(signs.windows(2)) {
            *layer = Layer::between(&pair[0], &pair[1]);
        }
        for z in 0..9 {
            let touches = |layer: Option<&Layer>| layer.is_some_and(|layer| layer.cells != 0);
            if touches(self.layers.get(z)) || touches(self.layers.get(z.wrapping_sub(1))) {
                self.read_distances(blocks, z);
            }
        }
        true
    }

    fn read_distances(&mut self, blocks: &[Option<&Block>; 8], z: usize) {
        for (y, row) in self.distance[9 * z..][..9].iter_mut().enumerate() {
            let first = (y & 7) << 3 | (z & 7) << 6;
            let number = y >> 3 << 1 | z >> 3 << 2;
            if let Some(block) = blocks[number] {
                row[..8].copy_from_slice(&block.distance[first..first + 8]);
            }
            if let Some(block) = blocks[number + 1] {
                row[8] = block.distance[first];
            }
        }
    }

    /// Where the vertices of some cells lie, at most 64, in voxels from each cell's first voxel centre: all x, all y, all z.
    pub fn vertices(&mut self, cells: &[u16], offsets: &mut [[f32; 64]; 3]) {
        let row = self.distance.as_flattened();
        for (slot, cell) in cells.iter().enumerate() {
            let cell = usize::from(*cell);
            let first = (cell & 7) + ROW * (cell >> 3 & 7) + 9 * ROW * (cell >> 6);
            for (edge, corners) in self.corners.iter_mut().enumerate() {
                let at = first + ROW * (edge & 1) + 9 * ROW * (edge >> 1);
                corners[slot] = u32::from(row[at] as u16) | u32::from(row[at + 1] as u16) << 16;
            }
        }
        let [x, y, z] = offsets;
        // Whole groups of lanes: what is left over holds old corners and is not used.
        for slot in 0..cells.len().next_multiple_of(4).min(64) {
            let vertex = cell_vertex(std::array::from_fn(|k| {
                f32::from((self.corners[k >> 1][slot] >> (16 * (k & 1))) as u16 as i16)
            }));
            [x[slot], y[slot], z[slot]] = vertex;
        }
    }
}

/// Signs of a layer of voxels, and of the voxels one further along x, along y, and along both.
struct Signs {
    /// Known and inside, known and outside.
    inside: [u64; 4],
    outside: [u64; 4],
    any_inside: u64,
    any_outside: u64,
    all_known: u64,
}

impl Signs {
    /// Of layer z of a block and its neighbours along x, y and both.
    fn of(blocks: &[Option<&Block>], z: usize) -> Self {
        let mut known = [0; 4];
        let mut negative = [0; 4];
        for (k, block) in blocks.iter().enumerate() {
            let Some(block) = block else { continue };
            known[k] = block.known[z] & FACE_MASK[k];
            // Only voxels near a surface can lie inside.
            if block.near_surface[z] & known[k] != 0 {
                let distance = layer_of(&block.distance, z);
                negative[k] = set_of(&distance.map(|d| d < 0)) & block.near_surface[z];
            }
        }
        let inside = with_next(std::array::from_fn(|k| known[k] & negative[k]));
        let outside = with_next(std::array::from_fn(|k| known[k] & !negative[k]));
        let any = |sets: &[u64; 4]| sets[0] | sets[1] | sets[2] | sets[3];
        Self {
            any_inside: any(&inside),
            any_outside: any(&outside),
            all_known: (0..4).fold(u64::MAX, |all, k| all & (inside[k] | outside[k])),
            inside,
            outside,
        }
    }
}

/// Of a layer's set and those of its neighbours along x, y and both: the set, and what is in it one further along x, y and both.
fn with_next([own, in_x, in_y, in_xy]: [u64; 4]) -> [u64; 4] {
    let next_x = |own: u64, beyond: u64| own >> 1 & !(FACE_MASK[1] << 7) | (beyond & FACE_MASK[1]) << 7;
    let next_y = |own: u64, beyond: u64| own >> 8 | beyond << 56;
    let along_x = next_x(own, in_x);
    [own, along_x, next_y(own, in_y), next_y(along_x, next_x(in_y, in_xy))]
}

impl Layer {
    /// Of the cells between two layers of voxels.
    fn between(lower: &Signs, upper: &Signs) -> Self {
        let own = (lower.inside[0], lower.outside[0]);
        let crossing = |inside: u64, outside: u64| own.0 & outside | own.1 & inside;
        Self {
            cells: (lower.any_inside | upper.any_inside)
                & (lower.any_outside | upper.any_outside)
                & lower.all_known
                & upper.all_known,
            edges: [
                crossing(lower.inside[1], lower.outside[1]),
                crossing(lower.inside[2], lower.outside[2]),
                crossing(upper.inside[0], upper.outside[0]),
            ],
            outside: lower.outside[0],
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::block::{BlockKey, VoxelSet, contains};

    /// A block where a surface may be anywhere, some voxels are unknown and some far from anything.
    fn random_block(rng: &mut ChaCha8Rng) -> Block {
        let mut block = Block::new(BlockKey { x: 0, y: 0, z: 0 });
        let set = |rng: &mut ChaCha8Rng| -> VoxelSet { std::array::from_fn(|_| rng.next_u64() | rng.next_u64()) };
        block.known = std::array::from_fn(|z| set(rng)[z] | set(rng)[z]);
        block.near_surface = set(rng);
        block.distance = std::array::from_fn(|_| (rng.next_u32() % 24_000) as i16 - 6_000);
        block
    }

    /// The distance of one of the 9^3 voxels, far outside where it is not near a surface; `None` where unknown.
    fn distance(blocks: &[Option<&Block>; 8], [x, y, z]: [usize; 3]) -> Option<i16> {
        let block = blocks[x >> 3 | y >> 3 << 1 | z >> 3 << 2]?;
        let local = (x & 7) | (y & 7) << 3 | (z & 7) << 6;
        contains(&block.known, local).then_some(block.distance[local])
    }

    fn is_inside(blocks: &[Option<&Block>; 8], voxel: [usize; 3]) -> Option<bool> {
        let [x, y, z] = voxel;
        let local = (x & 7) | (y & 7) << 3 | (z & 7) << 6;
        let is_negative = distance(blocks, voxel)? < 0;
        Some(is_negative && contains(&blocks[x >> 3 | y >> 3 << 1 | z >> 3 << 2]?.near_surface, local))
    }

    fn check(blocks: &[Option<&Block>; 8]) {
        let mut patch = Patch::new();
        let was_read = patch.read(blocks);
        for cell in 0..512usize {
            let at = |k: usize| [(cell & 7) + (k & 1), (cell >> 3 & 7) + (k >> 1 & 1), (cell >> 6) + (k >> 2)];
            let corners: [_; 8] = std::array::from_fn(|k| is_inside(blocks, at(k)));
            let known: Vec<bool> = corners.iter().flatten().copied().collect();
            let is_cell = known.len() == 8 && known.contains(&true) && known.contains(&false);
            let layer = if was_read { patch.layers[cell >> 6] } else { Layer::default() };
            let has = |set: u64| set >> (cell & 63) & 1 == 1;
            assert_eq!(has(layer.cells), is_cell, "cell {cell}");
            for (axis, edges) in layer.edges.into_iter().enumerate() {
                let ends = corners[0].zip(corners[1 << axis]);
                assert_eq!(has(edges), ends.is_some_and(|(a, b)| a != b), "edge {cell} {axis}");
            }
            if is_cell {
                assert_eq!(has(layer.outside), corners[0] == Some(false));
                let mut offsets = [[0.0; 64]; 3];
                // Not alone in its group of lanes.
                patch.vertices(&[cell as u16; 5], &mut offsets);
                let plain = cell_vertex(std::array::from_fn(|k| f32::from(distance(blocks, at(k)).unwrap())));
                assert_eq!(offsets.map(|axis| axis[4].to_bits()), plain.map(f32::to_bits), "vertex {cell}");
            }
        }
    }

    #[test]
    fn layers_say_what_each_cell_says_by_itself() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for missing in [0u8, 0b1000_0000, 0b0101_0110, 0b1111_1110, 0b0000_0001] {
            let blocks: [Block; 8] = std::array::from_fn(|_| random_block(&mut rng));
            check(&std::array::from_fn(|k| (missing >> k & 1 == 0).then_some(&blocks[k])));
        }
        // Nothing inside.
        let mut free = random_block(&mut rng);
        free.distance = free.distance.map(|d| d.max(0));
        assert!(!Patch::new().read(&[Some(&free); 8]));
    }

    #[test]
    fn a_vertex_by_hand() {
        // A plane a quarter of the way from the lower to the upper corners.
        let offset = cell_vertex([-1.0, -1.0, -1.0, -1.0, 3.0, 3.0, 3.0, 3.0]);
        assert_eq!(offset, [0.5, 0.5, 0.25]);
        // A corner cut off: the mean of three crossings, each halfway along its edge.
        let offset = cell_vertex([-1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
        assert!(offset.iter().all(|o| (o - 1.0 / 6.0).abs() < 1e-6));
    }
}
