//! One scan into the volume: the truncation band of every return, then the free space before it.
//!
//! 1. *Band.* Returns pull the voxels from three in front of them to `behind` behind them towards their own signed
//!    distance along the ray (Curless and Levoy 1996, with a capped weight, so that the map follows the newest evidence).
//! 2. *Look-through.* Rays that end in different voxels mark what they pass, stopping one voxel before the return. A voxel
//!    that holds a return of this scan, or lies in its band, is never cleared by this scan; a voxel near a surface is cleared only if
//!    none of its face neighbours holds a return of this scan and the ray ends well off the surface that the voxel
//!    belongs to. That keeps floors and table tops at grazing angles, table legs and door frames.
//! 3. *Clear.* Each marked voxel takes one observation of free space per scan, however many rays passed.
//!
//! This file is the text, with the plain walk for steps 1 and 2 ([`Volume::integrate_plainly`]); what runs is
//! `integrate_fast`, which is held to the same bytes. Cost: about six voxels for each return that pulls;
//! the fast walk crosses blocks that are firmly free already in one step.

use nalgebra::{Point3, Vector3};
use thiserror::Error;

use crate::block::{Block, BlockKey, DISTANCE_ONE, NONE, contains, insert, local_of};
use crate::ray::{RayWalk, fixed};
use crate::returns::{LANES, Returns};
use crate::volume::{MAX_VOXEL_INDEX, Volume};

/// What one call of [`Volume::integrate`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct IntegrationReport {
    /// Returns within range.
    pub integrated: usize,
    /// Points with a coordinate that is not finite; skipped.
    pub non_finite: usize,
    /// Points nearer than `min_range_m`; skipped.
    pub too_near: usize,
    /// Points farther than `max_range_m`; they clear, but mark no surface.
    pub beyond_range: usize,
    /// Rays that were walked to clear free space.
    pub clearing_rays: usize,
    /// Voxels that took an observation of free space.
    pub cleared_voxels: usize,
    /// Blocks made by this scan.
    pub new_blocks: usize,
    /// Blocks that could not be made because the volume is full.
    pub refused_blocks: usize,
}

impl std::ops::AddAssign for IntegrationReport {
    fn add_assign(&mut self, other: Self) {
        self.integrated += other.integrated;
        self.non_finite += other.non_finite;
        self.too_near += other.too_near;
        self.beyond_range += other.beyond_range;
        self.clearing_rays += other.clearing_rays;
        self.cleared_voxels += other.cleared_voxels;
        self.new_blocks += other.new_blocks;
        self.refused_blocks += other.refused_blocks;
    }
}

/// A scan that cannot be integrated at all.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum IntegrationError {
    /// The sensor position is not finite or farther than a million voxels from the world origin.
    #[error("the sensor position {0:?} is not finite or too far from the world origin")]
    Origin([f64; 3]),
}

impl Volume {
    /// Folds one scan into the map: an unorganised cloud in world coordinates, seen from `origin_in_world`.
    ///
    /// Points that are not finite are skipped and counted. The result depends on nothing but the sequence of calls.
    ///
    /// # Errors
    /// [`IntegrationError::Origin`] if the sensor position is no place; the map is then unchanged.
    pub fn integrate(
        &mut self,
        origin_in_world: &Point3<f64>,
        points_in_world: &[Point3<f32>],
    ) -> Result<IntegrationReport, IntegrationError> {
        self.fold(origin_in_world, points_in_world, Self::pull_bands_fast, Self::look_through_fast)
    }

    /// The same without steps 2 and 3: surfaces only, nothing is ever seen free beyond the truncation band and nothing that
    /// went away is cleared. For offline meshes of still scenes.
    ///
    /// # Errors
    /// As [`integrate`](Self::integrate).
    pub fn integrate_band(
        &mut self,
        origin_in_world: &Point3<f64>,
        points_in_world: &[Point3<f32>],
    ) -> Result<IntegrationReport, IntegrationError> {
        self.fold(origin_in_world, points_in_world, Self::pull_bands_fast, |_, _, _| {})
    }

    /// [`integrate`](Self::integrate) voxel by voxel: the same bytes, slower. For readers and tests.
    ///
    /// # Errors
    /// As [`integrate`](Self::integrate).
    pub fn integrate_plainly(
        &mut self,
        origin_in_world: &Point3<f64>,
        points_in_world: &[Point3<f32>],
    ) -> Result<IntegrationReport, IntegrationError> {
        self.fold(origin_in_world, points_in_world, Self::pull_bands, Self::look_through)
    }

    pub(crate) fn fold(
        &mut self,
        origin_in_world: &Point3<f64>,
        points_in_world: &[Point3<f32>],
        pull_bands: impl FnOnce(&mut Self, &[Ray], &mut Scan),
        look_through: impl FnOnce(&mut Self, &[Ray], &mut Scan),
    ) -> Result<IntegrationReport, IntegrationError> {
        let origin = origin_in_world.coords / self.config.voxel_m;
        if origin.iter().any(|q| q.is_nan() || q.abs() >= MAX_VOXEL_INDEX / 4.0) {
            return Err(IntegrationError::Origin([origin_in_world.x, origin_in_world.y, origin_in_world.z]));
        }
        self.revision += 1;
        self.scans = self.scans.wrapping_add(1);
        let blocks_before = self.blocks.len();
        let mut scan = Scan {
            report: IntegrationReport::default(),
            touched: Vec::new(),
            origin,
            last_entered: (BlockKey { x: i32::MAX, y: 0, z: 0 }, NONE),
        };
        let rays = self.mark_returns(points_in_world, &mut scan);
        pull_bands(self, &rays, &mut scan);
        look_through(self, &rays, &mut scan);
        self.clear_marked(&mut scan);
        scan.report.new_blocks = self.blocks.len() - blocks_before;
        Ok(scan.report)
    }

    /// Checks the points, marks the voxels that hold returns, and chooses which rays pull and which clear.
    ///
    /// The first return in a voxel clears when the voxel has its turn: every `clear_every`-th scan, on a checkerboard. All
    /// pull.
    fn mark_returns(&mut self, points: &[Point3<f32>], scan: &mut Scan) -> Vec<Ray> {
        let scale = 1.0 / self.config.voxel_m;
        let (near, far) = ((self.config.min_range_m * scale).max(1e-6), self.config.max_range_m * scale);
        let turn = u32::try_from(self.config.clear_every).unwrap_or(u32::MAX);
        let mut rays = Vec::with_capacity(points.len());
        let mut returns = Returns::new();
        for chunk in points.chunks(LANES) {
            returns.take(chunk, scale, &scan.origin, far);
            for lane in 0..chunk.len() {
                let range = returns.range[lane];
                if !range.is_finite() {
                    scan.report.non_finite += 1;
                    continue;
                }
                if range < near {
                    scan.report.too_near += 1;
                    continue;
                }
                let (direction, end) = (returns.direction(lane), returns.end(lane));
                let checker = end[0].wrapping_add(end[1]).wrapping_add(end[2]) as u32;
                let phase = checker.wrapping_add(self.scans);
                // The usual turns are powers of two; a division for each point is felt.
                let is_turn = if turn.is_power_of_two() { phase & (turn - 1) == 0 } else { phase.is_multiple_of(turn) };
                if range > far {
                    scan.report.beyond_range += 1;
                    rays.push(Ray { direction, range: far, end: None, end_block: NONE, is_clearing: is_turn });
                    continue;
                }
                scan.report.integrated += 1;
                let id = self.enter(BlockKey::of_voxel(end), scan);
                if id == NONE {
                    continue;
                }
                let block = &mut self.blocks[id as usize];
                let local = local_of(end);
                let is_first = !contains(&block.hit, local);
                insert(&mut block.hit, local);
                rays.push(Ray { direction, range, end: Some(end), end_block: id, is_clearing: is_first && is_turn });
            }
        }
        rays
    }

    /// Step 1, voxel by voxel.
    fn pull_bands(&mut self, rays: &[Ray], scan: &mut Scan) {
        let band = Band::of(self);
        for ray in rays {
            let Some(end) = ray.end else { continue };
            let mut walk = RayWalk::new(scan.origin.into(), ray.direction.into(), (ray.range - band.front).max(0.0));
            let (range, stop) = (fixed(ray.range), fixed(ray.range + band.behind));
            let mut id = self.enter(BlockKey::of_voxel(walk.index), scan);
            loop {
                if id != NONE {
                    let block = &mut self.blocks[id as usize];
                    let local = local_of(walk.index);
                    let depth = range - walk.foot;
                    // A ray that slides over a surface and ends farther on says nothing against a voxel that another ray hit.
                    let slides_over = depth > band.half_voxel && walk.index != end && contains(&block.hit, local);
                    if walk.foot <= stop && !slides_over {
                        block.observe_distance(local, band.stored(depth), &self.thresholds);
                        insert(&mut block.in_band, local);
                    }
                }
                let (axis, t) = walk.next_border();
                if t > stop {
                    break;
                }
                id = self.cross(id, &mut walk, axis, scan);
            }
        }
    }

    /// Step 2, voxel by voxel.
    fn look_through(&mut self, rays: &[Ray], scan: &mut Scan) {
        for ray in rays.iter().filter(|ray| ray.is_clearing) {
            scan.report.clearing_rays += 1;
            let Some(stop) = ray.clears_until() else { continue };
            let mut walk = RayWalk::new(scan.origin.into(), ray.direction.into(), 0.0);
            let mut id = self.enter(BlockKey::of_voxel(walk.index), scan);
            loop {
                if id != NONE {
                    let block = &self.blocks[id as usize];
                    let local = local_of(walk.index);
                    let is_open = !contains(&block.near_surface, local)
                        || !contains(&block.in_band, local)
                            && !contains(&block.hit, local)
                            && self.may_clear(id, walk.index, ray, &scan.origin);
                    if is_open {
                        insert(&mut self.blocks[id as usize].seen_through, local);
                    }
                }
                let (axis, t) = walk.next_border();
                if t > stop {
                    break;
                }
                id = self.cross(id, &mut walk, axis, scan);
            }
        }
    }

    /// One voxel on; the block it is in.
    fn cross(&mut self, id: u32, walk: &mut RayWalk, axis: usize, scan: &mut Scan) -> u32 {
        let left = BlockKey::of_voxel(walk.index);
        walk.cross(axis);
        let key = BlockKey::of_voxel(walk.index);
        if key == left { id } else { self.enter(key, scan) }
    }

    /// May a ray clear the voxel near a surface that it stands in?
    pub(crate) fn may_clear(&self, id: u32, voxel: [i32; 3], ray: &Ray, origin: &Vector3<f64>) -> bool {
        let here = f64::from(self.blocks[id as usize].distance[local_of(voxel)]);
        let noticeable = 0.6 * f64::from(self.thresholds.units_per_m) * self.config.voxel_m;
        // The surfaces the voxel may belong to: the border of a solid (by the gradient of the distance), or a sheet that is free on
        // both sides of one axis. A pole or a crumb is a sheet along two axes or three: no surface that a ray could slide over.
        let center = Vector3::from(voxel.map(|i| f64::from(i) + 0.5));
        let rest = ray.range - (center - origin).dot(&ray.direction);
        let mut gradient = Vector3::zeros();
        let mut sheets = 0;
        let mut ends_off_sheet = true;
        for axis in 0..3 {
            let mut rise = [0.0; 2];
            for (side, rise) in rise.iter_mut().enumerate() {
                let Some((block, local)) = self.face_neighbour(id, voxel, axis, side) else {
                    continue;
                };
                if block.scan == self.revision && contains(&block.hit, local) {
                    return false;
                }
                if block.weight[local] > 0 {
                    *rise = f64::from(block.distance[local]) - here;
                }
            }
            gradient[axis] = rise[1] - rise[0];
            if rise[0].min(rise[1]) > noticeable {
                sheets += 1;
                ends_off_sheet = rest * ray.direction[axis].abs() > CLEAR_DEPTH_VOXELS;
            }
        }
        // A ray that ends in the tangent plane of the surface slid over it and says nothing against it.
        let steepness = gradient.norm();
        let ends_off_border = rest * gradient.dot(&ray.direction).abs() > CLEAR_DEPTH_VOXELS * steepness;
        match (sheets, steepness > noticeable) {
            (0, true) => ends_off_border,
            (1, true) => ends_off_border || ends_off_sheet,
            (1, false) => ends_off_sheet,
            _ => true,
        }
    }

    fn face_neighbour(&self, id: u32, voxel: [i32; 3], axis: usize, side: usize) -> Option<(&Block, usize)> {
        let mut other = voxel;
        other[axis] += if side == 1 { 1 } else { -1 };
        let id = if other[axis] >> 3 == voxel[axis] >> 3 { id } else { self.nodes[id as usize].links[2 * axis + side] };
        (id != NONE).then(|| (&self.blocks[id as usize], local_of(other)))
    }

    /// Step 3, and the bit sets of what changed.
    fn clear_marked(&mut self, scan: &mut Scan) {
        for id in &scan.touched {
            let block = &mut self.blocks[*id as usize];
            let (mut cleared, mut pulled) = (0, 0);
            let mut is_surface_cleared = false;
            let mut changed = block.in_band;
            for (z, changed) in changed.iter_mut().enumerate() {
                let mut marked = block.seen_through[z] & !block.in_band[z] & !block.settled[z];
                is_surface_cleared |= marked & block.occupied[z] != 0;
                pulled |= *changed;
                *changed |= marked;
                cleared += marked.count_ones() as usize;
                while marked != 0 {
                    let local = z * 64 + marked.trailing_zeros() as usize;
                    marked &= marked - 1;
                    block.observe_free(local, &self.thresholds);
                }
            }
            if cleared == 0 && pulled == 0 {
                continue;
            }
            scan.report.cleared_voxels += cleared;
            let is_occupancy_changed = block.refresh(&changed, &self.thresholds);
            if is_occupancy_changed {
                block.occupancy_revision = self.revision;
            }
            if pulled != 0 || is_surface_cleared {
                block.surface_revision = self.revision;
            }
            if block.newest_revision() == self.revision {
                self.recent.renew(*id);
            }
            self.nodes[*id as usize].is_settled = block.settled == [u64::MAX; 8];
        }
    }

    /// The block of a key, made if need be and marked as touched.
    pub(crate) fn enter(&mut self, key: BlockKey, scan: &mut Scan) -> u32 {
        if scan.last_entered.0 != key {
            let id = self.ensure_block(key).map_or(NONE, |id| self.touch(id, scan));
            scan.last_entered = (key, id);
        }
        scan.report.refused_blocks += usize::from(scan.last_entered.1 == NONE);
        scan.last_entered.1
    }

    #[inline]
    pub(crate) fn touch(&mut self, id: u32, scan: &mut Scan) -> u32 {
        if self.blocks[id as usize].begin_scan(self.revision) {
            scan.touched.push(id);
        }
        id
    }
}

/// A ray that must end this far (in voxels) off a voxel's tangent plane before it counts against the voxel.
const CLEAR_DEPTH_VOXELS: f64 = 1.5;

pub(crate) struct Scan {
    pub report: IntegrationReport,
    /// Blocks touched by this scan, in the order of touching.
    pub touched: Vec<u32>,
    /// Sensor position, voxels.
    pub origin: Vector3<f64>,
    /// Neighbouring returns mostly enter the same block: saves the hash.
    pub last_entered: (BlockKey, u32),
}

/// Lengths in voxels.
pub(crate) struct Ray {
    pub direction: Vector3<f64>,
    pub range: f64,
    /// The voxel of the return; none beyond the range.
    pub end: Option<[i32; 3]>,
    /// Its block.
    pub end_block: u32,
    pub is_clearing: bool,
}

impl Ray {
    /// It looks through what lies nearer than this: one voxel before the return, or all the way if there is none.
    pub fn until(&self) -> f64 {
        if self.end.is_some() { self.range - 1.0 } else { self.range }
    }

    /// The same in fixed point; `None` if nothing is left.
    pub fn clears_until(&self) -> Option<i64> {
        let stop = self.until();
        (stop > 0.0).then(|| fixed(stop))
    }
}

/// The truncation band, in voxels.
pub(crate) struct Band {
    pub front: f64,
    pub behind: f64,
    /// In fixed point.
    pub half_voxel: i64,
    /// Stored units per fixed-point unit.
    units: f32,
}

impl Band {
    pub fn of(volume: &Volume) -> Self {
        let scale = 1.0 / volume.config.voxel_m;
        let units_per_voxel = f64::from(volume.thresholds.units_per_m) * volume.config.voxel_m;
        Self {
            // Three voxels in front are more than the zero crossing depends on; beyond, looking through says the same.
            front: (volume.config.truncation_m * scale).min(3.0),
            behind: volume.config.behind_m * scale,
            half_voxel: fixed(0.5),
            units: (units_per_voxel / crate::ray::UNITS) as f32,
        }
    }

    /// A depth before the return as the voxels store it.
    #[inline(always)]
    pub fn stored(&self, depth: i64) -> f32 {
        (depth as f32 * self.units).min(f32::from(DISTANCE_ONE))
    }
}
