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
//! Cost: about six voxels for each return that pulls; the walk jumps over blocks that are firmly free already.

use nalgebra::{Point3, Vector3};
use thiserror::Error;

use crate::block::{Block, BlockKey, DISTANCE_ONE, NONE, contains, insert, local_of};
use crate::ray::{RayWalk, floor};
use crate::volume::{MAX_VOXEL_INDEX, Volume};

/// What one call of [`Volume::integrate`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct IntegrationReport {
    /// Returns within range that pulled the band.
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
        let scale = 1.0 / self.config.voxel_m;
        let origin = origin_in_world.coords * scale;
        if origin.iter().any(|q| q.is_nan() || q.abs() >= MAX_VOXEL_INDEX / 4.0) {
            return Err(IntegrationError::Origin([origin_in_world.x, origin_in_world.y, origin_in_world.z]));
        }
        self.revision += 1;
        let blocks_before = self.blocks.len();
        let mut scan = Scan {
            report: IntegrationReport::default(),
            touched: Vec::new(),
            origin,
            last_entered: (BlockKey { x: i32::MAX, y: 0, z: 0 }, NONE),
        };
        let rays = self.mark_returns(points_in_world, &mut scan);
        for ray in &rays {
            if let Some(end) = ray.end {
                self.pull_band(ray, end, &mut scan);
            }
        }
        for id in &scan.touched {
            let block = &mut self.blocks[*id as usize];
            let pulled = block.in_band;
            block.refresh(|z| pulled[z] != 0, &self.thresholds, self.revision);
        }
        for ray in rays.iter().filter(|ray| ray.is_clearing) {
            scan.report.clearing_rays += 1;
            self.look_through(ray, &mut scan);
        }
        self.clear_marked(&mut scan);
        scan.report.new_blocks = self.blocks.len() - blocks_before;
        Ok(scan.report)
    }

    /// Checks the points, marks the voxels that hold returns, and chooses which rays pull and which clear.
    ///
    /// The first return in a voxel pulls, and clears when the voxel has its turn: every `clear_every`-th scan, on a checkerboard. The
    /// others pull too unless they fall on a surface that is firmly known, to which they add little.
    fn mark_returns(&mut self, points: &[Point3<f32>], scan: &mut Scan) -> Vec<Ray> {
        let scale = 1.0 / self.config.voxel_m;
        let (near, far) = (self.config.min_range_m * scale, self.config.max_range_m * scale);
        let mut rays = Vec::with_capacity(points.len() / 2);
        let turn = self.config.clear_every as i64;
        let firm = self.config.max_weight / 2;
        for point in points {
            let offset = point.coords.cast::<f64>() * scale - scan.origin;
            let range = offset.norm();
            if !range.is_finite() {
                scan.report.non_finite += 1;
                continue;
            }
            if range < near || range < 1e-6 {
                scan.report.too_near += 1;
                continue;
            }
            let direction = offset / range;
            let tip = if range > far { scan.origin + direction * far } else { scan.origin + offset };
            let end: [i32; 3] = tip.map(floor).into();
            let is_turn =
                (end.iter().map(|i| i64::from(*i)).sum::<i64>() + i64::from(self.revision)).rem_euclid(turn) == 0;
            if range > far {
                scan.report.beyond_range += 1;
                if is_turn {
                    rays.push(Ray { direction, range: far, end: None, is_clearing: true });
                }
                continue;
            }
            scan.report.integrated += 1;
            let id = self.enter(BlockKey::of_voxel(end), scan);
            if id == NONE {
                continue;
            }
            let block = &mut self.blocks[id as usize];
            block.surface_revision = self.revision;
            let local = local_of(end);
            let is_first = !contains(&block.hit, local);
            insert(&mut block.hit, local);
            let is_firm = contains(&block.near_surface, local) && block.weight[local] >= firm;
            if is_first || !is_firm {
                rays.push(Ray { direction, range, end: Some(end), is_clearing: is_first && is_turn });
            }
        }
        rays
    }

    /// Step 1 for one return.
    fn pull_band(&mut self, ray: &Ray, end: [i32; 3], scan: &mut Scan) {
        let scale = 1.0 / self.config.voxel_m;
        // Three voxels in front are more than the zero crossing depends on; beyond, looking through says the same.
        let (front, behind) = ((self.config.truncation_m * scale).min(3.0), self.config.behind_m * scale);
        let units_per_voxel = f64::from(self.thresholds.units_per_m) * self.config.voxel_m;
        let mut walk = RayWalk::new(scan.origin.into(), ray.direction.into(), (ray.range - front).max(0.0));
        let mut id = self.enter(BlockKey::of_voxel(walk.index), scan);
        loop {
            if id != NONE {
                let block = &mut self.blocks[id as usize];
                let local = local_of(walk.index);
                let center = Vector3::from(walk.index.map(|i| f64::from(i) + 0.5));
                let signed = ray.range - (center - scan.origin).dot(&ray.direction);
                // A ray that slides over a surface and ends farther on says nothing against a voxel that another ray hit.
                let slides_over = signed > 0.5 && walk.index != end && contains(&block.hit, local);
                if signed >= -behind && !slides_over {
                    let stored = (signed * units_per_voxel).min(f64::from(DISTANCE_ONE)) as f32;
                    block.observe_distance(local, stored, &self.thresholds);
                    insert(&mut block.in_band, local);
                }
            }
            let (axis, t) = walk.next_border();
            if t > ray.range + behind {
                return;
            }
            walk.cross(axis);
            id = self.follow(id, &walk, axis, scan);
        }
    }

    /// Step 2 for one ray.
    fn look_through(&mut self, ray: &Ray, scan: &mut Scan) {
        // One voxel before the return, or all the way if there is none.
        let stop = if ray.end.is_some() { ray.range - 1.0 } else { ray.range };
        if stop <= 0.0 {
            return;
        }
        let mut walk = RayWalk::new(scan.origin.into(), ray.direction.into(), 0.0);
        let mut id = self.enter(BlockKey::of_voxel(walk.index), scan);
        loop {
            if id != NONE {
                let block = &mut self.blocks[id as usize];
                if block.all_settled {
                    walk.jump_to_block_end();
                } else {
                    let local = local_of(walk.index);
                    if !contains(&block.near_surface, local) {
                        insert(&mut block.seen_through, local);
                    } else if !contains(&block.seen_through, local)
                        && !contains(&block.in_band, local)
                        && !contains(&block.hit, local)
                        && self.may_clear(id, &walk, ray, &scan.origin)
                    {
                        insert(&mut self.blocks[id as usize].seen_through, local);
                    }
                }
            }
            let (axis, t) = walk.next_border();
            if t > stop {
                return;
            }
            walk.cross(axis);
            id = self.follow(id, &walk, axis, scan);
        }
    }

    /// May a ray clear the voxel near a surface that it stands in?
    fn may_clear(&self, id: u32, walk: &RayWalk, ray: &Ray, origin: &Vector3<f64>) -> bool {
        let here = f64::from(self.blocks[id as usize].distance[local_of(walk.index)]);
        let noticeable = 0.6 * f64::from(self.thresholds.units_per_m) * self.config.voxel_m;
        // The surfaces the voxel may belong to: the border of a solid (by the gradient of the distance), or a sheet that is free on
        // both sides of one axis. A pole or a crumb is a sheet along two axes or three: no surface that a ray could slide over.
        let center = Vector3::from(walk.index.map(|i| f64::from(i) + 0.5));
        let rest = ray.range - (center - origin).dot(&ray.direction);
        let mut gradient = Vector3::zeros();
        let mut sheets = 0;
        let mut ends_off_sheet = true;
        for axis in 0..3 {
            let mut rise = [0.0; 2];
            for (side, rise) in rise.iter_mut().enumerate() {
                let Some((block, local)) = self.face_neighbour(id, walk.index, axis, side) else {
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
        let id =
            if other[axis] >> 3 == voxel[axis] >> 3 { id } else { self.blocks[id as usize].links[2 * axis + side] };
        (id != NONE).then(|| (&self.blocks[id as usize], local_of(other)))
    }

    /// Step 3.
    fn clear_marked(&mut self, scan: &mut Scan) {
        for id in &scan.touched {
            let block = &mut self.blocks[*id as usize];
            let mut cleared = 0;
            let mut layers = [false; 8];
            for (z, layer) in layers.iter_mut().enumerate() {
                let mut marked = block.seen_through[z] & !block.in_band[z] & !block.settled[z];
                if marked & block.occupied[z] != 0 {
                    block.surface_revision = self.revision;
                }
                cleared += marked.count_ones() as usize;
                *layer = marked != 0;
                while marked != 0 {
                    let local = z * 64 + marked.trailing_zeros() as usize;
                    marked &= marked - 1;
                    block.observe_free(local, &self.thresholds);
                }
            }
            if cleared > 0 {
                block.refresh(|z| layers[z], &self.thresholds, self.revision);
                scan.report.cleared_voxels += cleared;
            }
        }
    }

    /// The block of a key, made if need be and marked as touched.
    fn enter(&mut self, key: BlockKey, scan: &mut Scan) -> u32 {
        if scan.last_entered.0 == key {
            return scan.last_entered.1;
        }
        match self.ensure_block(key) {
            Some(id) => {
                scan.last_entered = (key, id);
                self.touch(id, scan)
            }
            None => {
                scan.report.refused_blocks += 1;
                NONE
            }
        }
    }

    /// The block after the walk has crossed a border of `axis`.
    #[inline(always)]
    fn follow(&mut self, id: u32, walk: &RayWalk, axis: usize, scan: &mut Scan) -> u32 {
        let entered = if walk.step[axis] > 0 { 0 } else { 7 };
        if walk.index[axis] & 7 == entered { self.next_block(id, walk, axis, scan) } else { id }
    }

    fn next_block(&mut self, id: u32, walk: &RayWalk, axis: usize, scan: &mut Scan) -> u32 {
        if id != NONE {
            let next = self.blocks[id as usize].links[2 * axis + usize::from(walk.step[axis] > 0)];
            if next != NONE {
                return self.touch(next, scan);
            }
        }
        self.enter(BlockKey::of_voxel(walk.index), scan)
    }

    #[inline]
    fn touch(&mut self, id: u32, scan: &mut Scan) -> u32 {
        if self.blocks[id as usize].begin_scan(self.revision) {
            scan.touched.push(id);
        }
        id
    }
}

/// A ray that must end this far (in voxels) off a voxel's tangent plane before it counts against the voxel.
const CLEAR_DEPTH_VOXELS: f64 = 1.5;

struct Scan {
    report: IntegrationReport,
    /// Blocks touched by this scan, in the order of touching.
    touched: Vec<u32>,
    /// Sensor position, voxels.
    origin: Vector3<f64>,
    /// Neighbouring returns mostly enter the same block: saves the hash.
    last_entered: (BlockKey, u32),
}

/// Lengths in voxels.
struct Ray {
    direction: Vector3<f64>,
    range: f64,
    /// The voxel of the return; none beyond the range.
    end: Option<[i32; 3]>,
    is_clearing: bool,
}
