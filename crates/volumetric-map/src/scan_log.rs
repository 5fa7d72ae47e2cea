//! When the trajectory is corrected, the map is made again from the scans: this is the log that keeps them, and the making.
//!
//! A loop closure moves poses of the past. A distance volume cannot be bent after them, so either it is cut into rigid submaps that move
//! against each other, or the scans are kept and integrated again at their new poses. We keep the scans (`DESIGN.md` says why): in the
//! sensor's frame, thinned to what the voxels can tell apart, within a bound on memory. A map that was made again holds the same bytes
//! as one that was made from the corrected poses in the first place.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use rustc_hash::FxHashSet;
use thiserror::Error;

use crate::block::{Block, BlockKey};
use crate::integrate::{IntegrationError, IntegrationReport};
use crate::ray::floor;
use crate::volume::Volume;

/// One scan as it was seen.
#[derive(Debug, Clone)]
struct KeptScan {
    world_from_sensor: Isometry3<f64>,
    points_in_sensor: Arc<[Point3<f32>]>,
    /// Label and instance of each point; empty if the scan has none.
    tags: Arc<[(u16, u16)]>,
}

/// Scans in the frame of their sensor, with the poses they are believed to have been taken from.
#[derive(Debug, Clone)]
pub struct ScanLog {
    scans: Vec<KeptScan>,
    bytes: usize,
    max_bytes: usize,
}

/// A scan that cannot be kept; the log is unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ScanLogError {
    /// It would take more memory than the log may.
    #[error("the log would take {bytes} bytes, it may take {limit}")]
    Full {
        /// With the scan.
        bytes: usize,
        /// The log's limit.
        limit: usize,
    },
    /// The pose is not finite, or the voxel size is not positive and finite.
    #[error("the pose of a scan, or the size to thin it to, is not finite or not positive")]
    NotFinite,
    /// There are tags, but not one for each point.
    #[error("{points} points have {tags} tags")]
    Tags {
        /// Points of the scan.
        points: usize,
        /// Tags that came with them.
        tags: usize,
    },
    /// A corrected trajectory has another number of poses than the log has scans.
    #[error("{poses} poses for {scans} scans")]
    Poses {
        /// Poses given.
        poses: usize,
        /// Scans kept.
        scans: usize,
    },
}

impl ScanLog {
    /// An empty log that refuses scans beyond a number of bytes. A scan of 30 000 returns thinned to 5 cm takes about 0.2 MB in a room.
    pub fn new(max_bytes: usize) -> Self {
        Self { scans: Vec::new(), bytes: 0, max_bytes }
    }

    /// Number of scans.
    pub fn len(&self) -> usize {
        self.scans.len()
    }

    /// Whether nothing was kept yet.
    pub fn is_empty(&self) -> bool {
        self.scans.is_empty()
    }

    /// Memory that the points take, bytes.
    pub fn memory_bytes(&self) -> usize {
        self.bytes
    }

    /// Keeps a scan: of the returns in one cube of `thin_m` the first, in their order. Points that are not finite are dropped.
    /// `tags` holds a label and an instance (0 = none) for each point, or nothing. Returns the number of points kept.
    ///
    /// # Errors
    /// [`ScanLogError`]; the log is unchanged then.
    pub fn push(
        &mut self,
        world_from_sensor: &Isometry3<f64>,
        points_in_sensor: &[Point3<f32>],
        tags: &[(u16, u16)],
        thin_m: f64,
    ) -> Result<usize, ScanLogError> {
        if !tags.is_empty() && tags.len() != points_in_sensor.len() {
            return Err(ScanLogError::Tags { points: points_in_sensor.len(), tags: tags.len() });
        }
        let is_length = thin_m.is_finite() && thin_m > 0.0;
        if !is_length || !is_finite(world_from_sensor) {
            return Err(ScanLogError::NotFinite);
        }
        let mut taken = FxHashSet::default();
        let mut is_first = |point: &Point3<f32>| {
            let cube = point.coords.map(|v| floor((f64::from(v) / thin_m).clamp(-1e9, 1e9)));
            point.iter().all(|v| v.is_finite()) && taken.insert([cube.x, cube.y, cube.z])
        };
        let kept: Vec<usize> = (0..points_in_sensor.len()).filter(|i| is_first(&points_in_sensor[*i])).collect();
        let per_point = size_of::<Point3<f32>>() + if tags.is_empty() { 0 } else { size_of::<(u16, u16)>() };
        let bytes = self.bytes + size_of::<KeptScan>() + per_point * kept.len();
        if bytes > self.max_bytes {
            return Err(ScanLogError::Full { bytes, limit: self.max_bytes });
        }
        self.bytes = bytes;
        self.scans.push(KeptScan {
            world_from_sensor: *world_from_sensor,
            points_in_sensor: kept.iter().map(|i| points_in_sensor[*i]).collect(),
            tags: if tags.is_empty() { Arc::from([]) } else { kept.iter().map(|i| tags[*i]).collect() },
        });
        Ok(kept.len())
    }

    /// Takes over a corrected trajectory: one pose for each scan, in their order. Returns the farthest that any sensor position moved,
    /// metres, and the largest turn, radians: whoever holds the map decides whether that is worth making it again.
    ///
    /// # Errors
    /// [`ScanLogError::Poses`] or [`ScanLogError::NotFinite`]; no pose is changed then.
    pub fn correct(&mut self, world_from_sensor: &[Isometry3<f64>]) -> Result<[f64; 2], ScanLogError> {
        if world_from_sensor.len() != self.scans.len() {
            return Err(ScanLogError::Poses { poses: world_from_sensor.len(), scans: self.scans.len() });
        }
        if !world_from_sensor.iter().all(is_finite) {
            return Err(ScanLogError::NotFinite);
        }
        let mut farthest = [0.0f64; 2];
        for (scan, new) in self.scans.iter_mut().zip(world_from_sensor) {
            let change = scan.world_from_sensor.inverse() * new;
            farthest[0] = farthest[0].max(change.translation.vector.norm());
            farthest[1] = farthest[1].max(change.rotation.angle());
            scan.world_from_sensor = *new;
        }
        Ok(farthest)
    }

    /// Makes a map of all scans again, from nothing. The volume goes on as the same for its readers: the distance field, the places and
    /// the mesh take over what changed, and places that are still there keep their names. What was archived is forgotten.
    ///
    /// # Errors
    /// [`IntegrationError`] if a pose lies too far out; the volume is unchanged then.
    pub fn rebuild(&self, volume: &mut Volume) -> Result<IntegrationReport, IntegrationError> {
        let mut fresh = volume.empty_copy();
        let mut total = IntegrationReport::default();
        for scan in &self.scans {
            let place = |point: &Point3<f32>| (scan.world_from_sensor * point.cast::<f64>()).cast::<f32>();
            let points: Vec<_> = scan.points_in_sensor.iter().map(place).collect();
            total += fresh.integrate(&scan.world_from_sensor.translation.vector.into(), &points)?;
            if !scan.tags.is_empty() {
                let tagged: Vec<_> = points.iter().zip(scan.tags.iter()).map(|(p, (l, i))| (*p, *l, *i)).collect();
                fresh.vote_instances(&tagged);
            }
        }
        // Blocks that are no longer seen stay, empty, so that the readers learn that nothing is known there.
        let gone: Vec<BlockKey> =
            volume.blocks.iter().map(|block| block.key).filter(|key| fresh.block_id(*key).is_none()).collect();
        fresh.revision += 1;
        for key in gone {
            let mut block = Block::new(key);
            block.occupancy_revision = fresh.revision;
            block.surface_revision = fresh.revision;
            fresh.push_block(block);
        }
        fresh.mesh_cache = std::mem::take(&mut volume.mesh_cache);
        *volume = fresh;
        Ok(total)
    }
}

fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|v| v.is_finite())
}
