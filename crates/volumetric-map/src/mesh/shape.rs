//! What a block looked like when it was last meshed, and what has moved since.

use crate::block::{BLOCK_VOXELS, Block, VoxelSet, layer_of, set_of};

/// In stored units.
pub(super) struct Tolerance {
    /// A voxel has moved if its distance changed by more than this.
    pub moved: i16,
    /// And was or is nearer to the surface than this.
    pub near: i16,
}

/// What a block looked like when it was last meshed.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    known: VoxelSet,
    /// Where the distance may be small.
    near_surface: VoxelSet,
    distance: [i16; BLOCK_VOXELS],
    label: Option<Box<[u16; BLOCK_VOXELS]>>,
    instance: Option<Box<[u16; BLOCK_VOXELS]>>,
}

impl Shape {
    /// Of a block that was never meshed: every known voxel is new.
    pub const NONE: Self =
        Self { known: [0; 8], near_surface: [0; 8], distance: [0; BLOCK_VOXELS], label: None, instance: None };

    /// Takes over what the block looks like now, except for the distances of some voxels.
    pub fn take(&mut self, block: &Block, kept: &VoxelSet) {
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
    pub fn moved(&self, block: &Block, tolerance: &Tolerance) -> VoxelSet {
        let mut moved: VoxelSet = std::array::from_fn(|z| self.known[z] ^ block.known[z]);
        for (z, moved) in moved.iter_mut().enumerate() {
            if tolerance.moved > 0 && self.near_surface[z] | block.near_surface[z] == 0 {
                continue;
            }
            *moved |= moved_in_layer(layer_of(&self.distance, z), layer_of(&block.distance, z), tolerance);
        }
        let votes = block.votes.as_ref();
        add_different(&mut moved, self.label.as_deref(), votes.map(|votes| &votes.label));
        add_different(&mut moved, self.instance.as_deref(), votes.and_then(|votes| votes.instance.as_deref()));
        moved
    }
}

/// Voxels whose distance changed. Only near the surface: a voxel far from it that changes moves no vertex.
fn moved_in_layer(old: &[i16; 64], new: &[i16; 64], tolerance: &Tolerance) -> u64 {
    let Tolerance { moved, near } = *tolerance;
    let is_near = |d: i16| (-near < d) & (d < near);
    set_of(&std::array::from_fn(|i| {
        // What does not fit is more than any tolerance.
        let change = old[i].saturating_sub(new[i]);
        ((change > moved) | (change < -moved)) & (is_near(old[i]) | is_near(new[i]))
    }))
}

/// Adds the voxels whose tag is another; no tags are tags of zero.
fn add_different(moved: &mut VoxelSet, old: Option<&[u16; BLOCK_VOXELS]>, new: Option<&[u16; BLOCK_VOXELS]>) {
    let (old, new) = match (old, new) {
        (None, None) => return,
        (old, new) => (old.unwrap_or(&[0; BLOCK_VOXELS]), new.unwrap_or(&[0; BLOCK_VOXELS])),
    };
    if old == new {
        return;
    }
    for (z, moved) in moved.iter_mut().enumerate() {
        let (old, new) = (layer_of(old, z), layer_of(new, z));
        *moved |= set_of(&std::array::from_fn(|i| old[i] != new[i]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voxel_moves_by_more_than_the_tolerance_and_only_near_the_surface() {
        let tolerance = Tolerance { moved: 1600, near: 8800 };
        let every = Tolerance { moved: 0, near: i16::MAX };
        let cases = [
            // old, new, moved by more than the tolerance near the surface, moved at all
            (0, 0, false, false),
            (0, 1600, false, true),
            (0, 1601, true, true),
            (0, -1601, true, true),
            (-1000, 1000, true, true),
            (8799, 32_000, true, true),
            (32_000, -8799, true, true),
            (8800, 32_000, false, true),
            (-8800, 8800, false, true),
            (32_000, -32_000, false, true),
            (-32_000, 31_999, false, true),
            (32_000, 32_000, false, false),
        ];
        let (mut old, mut new) = ([0; 64], [0; 64]);
        let (mut near, mut all) = (0, 0);
        for (i, (a, b, is_near, is_any)) in cases.into_iter().enumerate() {
            (old[5 * i], new[5 * i]) = (a, b);
            near |= u64::from(is_near) << (5 * i);
            all |= u64::from(is_any) << (5 * i);
        }
        for (old, new) in [(&old, &new), (&new, &old)] {
            assert_eq!(moved_in_layer(old, new, &tolerance), near);
            assert_eq!(moved_in_layer(old, new, &every), all);
        }
    }
}
