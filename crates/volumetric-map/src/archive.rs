//! A bounded map: blocks far from the robot move to an archive and come back.
//!
//! An archive is a [`Volume`] like any other: it can be asked, saved and loaded. What leaves a volume is not forgotten by those who read
//! it: the distance field, the mesh and the places keep what they saw last, until the blocks are back and change.
//!
//! ```text
//! volume --archive_outside(box)--> archive --save--> file --load--> archive --restore--> volume
//! ```
//! The sequence gives back the same distances, weights and votes. Where both sides hold a block (the robot came back before its archive
//! did), the observations are joined as if one sensor had made them all.

use nalgebra::Point3;
use thiserror::Error;

use crate::block::{ALL_VOXELS, BLOCK_VOXELS, Block, BlockKey, Thresholds};
use crate::volume::Volume;
use crate::votes::Votes;

/// What [`Volume::restore`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RestoreReport {
    /// Blocks that were put back as they were.
    pub added: usize,
    /// Blocks that the volume had made anew in the meantime; their observations were joined.
    pub joined: usize,
}

/// An archive that cannot be put back; the volume is unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum RestoreError {
    /// Voxels of another size or distances of another scale.
    #[error(
        "the archive has voxels of {archive_m} m cut at {archive_cut_m} m, the volume {volume_m} m cut at {volume_cut_m} m"
    )]
    OtherGrid {
        /// Edge of a voxel of the archive, metres.
        archive_m: f64,
        /// Truncation of the archive, metres.
        archive_cut_m: f64,
        /// Edge of a voxel of the volume, metres.
        volume_m: f64,
        /// Truncation of the volume, metres.
        volume_cut_m: f64,
    },
    /// Together they would have more blocks than `max_blocks`.
    #[error("{blocks} blocks are more than the {limit} that the volume may hold")]
    Full {
        /// Blocks of both.
        blocks: usize,
        /// The volume's limit.
        limit: usize,
    },
}

impl Volume {
    /// Takes the blocks that lie wholly outside the box `min`..`max` (metres in world) out of memory and returns them.
    ///
    /// A box that is reversed or not a number takes nothing out. Costs one look at each block, and some for each that leaves.
    #[must_use = "what leaves the map is lost if it is not kept"]
    pub fn archive_outside(&mut self, min: &Point3<f64>, max: &Point3<f64>) -> Self {
        let mut archive = self.empty_copy();
        let edge = 8.0 * self.config.voxel_m;
        let is_box = (0..3).all(|axis| min[axis] <= max[axis]);
        let is_outside = |key: BlockKey| {
            [key.x, key.y, key.z]
                .into_iter()
                .enumerate()
                .any(|(axis, k)| f64::from(k + 1) * edge < min[axis] || f64::from(k) * edge > max[axis])
        };
        let mut id = 0;
        while is_box && id < self.blocks.len() {
            if is_outside(self.blocks[id].key) {
                let mut block = self.remove_block(id as u32);
                // All of it is new to a reader of the archive.
                block.occupancy_revision = self.revision;
                block.surface_revision = self.revision;
                self.archived.insert(block.key.packed());
                archive.push_block(block);
            } else {
                id += 1;
            }
        }
        archive
    }

    /// Puts the blocks of an archive back.
    ///
    /// # Errors
    /// [`RestoreError`] if the two do not fit together or not into memory; the archive comes back with it, and nothing is changed.
    pub fn restore(&mut self, archive: Self) -> Result<RestoreReport, Box<(RestoreError, Self)>> {
        let (a, v) = (&archive.config, &self.config);
        if a.voxel_m.to_bits() != v.voxel_m.to_bits() || a.truncation_m.to_bits() != v.truncation_m.to_bits() {
            let error = RestoreError::OtherGrid {
                archive_m: a.voxel_m,
                archive_cut_m: a.truncation_m,
                volume_m: v.voxel_m,
                volume_cut_m: v.truncation_m,
            };
            return Err(Box::new((error, archive)));
        }
        let new = archive.blocks.iter().filter(|block| self.block_id(block.key).is_none()).count();
        if self.blocks.len() + new > self.config.max_blocks {
            let error = RestoreError::Full { blocks: self.blocks.len() + new, limit: self.config.max_blocks };
            return Err(Box::new((error, archive)));
        }
        self.revision += 1;
        let mut report = RestoreReport::default();
        for mut block in archive.blocks {
            block.scan = 0;
            if let Some(id) = self.block_id(block.key) {
                let here = &mut self.blocks[id as usize];
                join(here, &block, &self.thresholds);
                here.occupancy_revision = self.revision;
                here.surface_revision = self.revision;
                self.nodes[id as usize].is_settled = here.settled == ALL_VOXELS;
                self.recent.renew(id);
                report.joined += 1;
            } else {
                block.occupancy_revision = self.revision;
                block.surface_revision = self.revision;
                self.push_block(block);
                report.added += 1;
            }
        }
        Ok(report)
    }
}

/// Joins the observations of another block to a block: weighted means of the distances, and the winner of both votes.
fn join(here: &mut Block, other: &Block, thresholds: &Thresholds) {
    for local in 0..BLOCK_VOXELS {
        let (a, b) = (u16::from(here.weight[local]), u16::from(other.weight[local]));
        if b == 0 {
            continue;
        }
        let sum = f32::from(here.distance[local]) * f32::from(a) + f32::from(other.distance[local]) * f32::from(b);
        here.distance[local] = (sum * thresholds.reciprocal[usize::from(a + b)]).round() as i16;
        here.weight[local] = (a + b).min(u16::from(thresholds.max_weight)) as u8;
    }
    if let Some(others) = &other.votes {
        here.votes.get_or_insert_with(Votes::none).join(others);
    }
    for (word, other) in here.occupied.iter_mut().zip(other.occupied) {
        // Either memory of "was occupied" may keep a voxel so; the distances decide.
        *word |= other;
    }
    here.refresh(&ALL_VOXELS, thresholds);
}
