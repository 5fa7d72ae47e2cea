//! Steps 1 and 2 of [`integrate`](crate::integrate) as they run: with [`Stride`]s instead of plain walks, from block to block by links
//! instead of the hash, and past firmly free blocks in one step.

use crate::block::{BlockKey, NONE, local_of};
use crate::integrate::{Band, Ray, Scan};
use crate::ray::{RayWalk, fixed};
use crate::stride::{Step, Stride, voxel_of};
use crate::volume::Volume;

impl Volume {
    pub(crate) fn pull_bands_fast(&mut self, rays: &[Ray], scan: &mut Scan) {
        let band = Band::of(self);
        for ray in rays {
            if let Some(end) = ray.end {
                self.pull_band(ray, end, &band, scan);
            }
        }
    }

    fn pull_band(&mut self, ray: &Ray, end: [i32; 3], band: &Band, scan: &mut Scan) {
        let walk = RayWalk::new(scan.origin.into(), ray.direction.into(), (ray.range - band.front).max(0.0));
        let mut stride = Stride::new(&walk);
        let (range, stop) = (fixed(ray.range), fixed(ray.range + band.behind));
        let mut id = self.enter_near(stride.key, ray.end_block, BlockKey::of_voxel(end), scan);
        let end_local = local_of(end) as u32;
        loop {
            let step = if id == NONE {
                stride.walk_block(stop, |_, _| {})
            } else {
                let thresholds = &self.thresholds;
                let block = &mut self.blocks[id as usize];
                let is_end_block = id == ray.end_block;
                stride.walk_block(stop, |local, foot| {
                    let depth = range - foot;
                    let (layer, bit) = ((local >> 6 & 7) as usize, 1u64 << (local & 63));
                    let is_hit = block.hit[layer] & bit != 0;
                    let slides_over = is_hit && depth > band.half_voxel && !(is_end_block && local == end_local);
                    if foot <= stop && !slides_over {
                        block.observe_distance((local & 511) as usize, band.stored(depth), thresholds);
                        block.in_band[layer] |= bit;
                    }
                })
            };
            let Step::Left(side) = step else { return };
            id = self.next_block(id, &stride, side, scan);
            if id != NONE {
                self.touch(id, scan);
            }
        }
    }

    pub(crate) fn look_through_fast(&mut self, rays: &[Ray], scan: &mut Scan) {
        let first = BlockKey::of_voxel(scan.origin.map(crate::ray::floor).into());
        for ray in rays.iter().filter(|ray| ray.is_clearing) {
            scan.report.clearing_rays += 1;
            if let Some(stop) = ray.clears_until() {
                let start = self.enter(first, scan);
                self.look_along(ray, start, stop, scan);
            }
        }
    }

    fn look_along(&mut self, ray: &Ray, start: u32, stop: i64, scan: &mut Scan) {
        let mut stride = Stride::new(&RayWalk::new(scan.origin.into(), ray.direction.into(), 0.0));
        let mut id = start;
        loop {
            let step = if id == NONE || self.nodes[id as usize].is_settled {
                stride.skip_block(stop)
            } else {
                self.touch(id, scan);
                stride.catch_up();
                self.look_through_block(id, &mut stride, ray, stop, scan)
            };
            let Step::Left(side) = step else { return };
            id = self.next_block(id, &stride, side, scan);
        }
    }

    /// Marks what a ray passes in one block.
    fn look_through_block(&mut self, id: u32, stride: &mut Stride, ray: &Ray, stop: i64, scan: &Scan) -> Step {
        let key = stride.key;
        let block = &self.blocks[id as usize];
        let mut seen = block.seen_through;
        let step = stride.walk_block(stop, |local, _| {
            let (layer, bit) = ((local >> 6 & 7) as usize, 1u64 << (local & 63));
            if block.near_surface[layer] & bit == 0
                || (block.in_band[layer] | block.hit[layer] | seen[layer]) & bit == 0
                    && self.may_clear(id, voxel_of(key, local), ray, &scan.origin)
            {
                seen[layer] |= bit;
            }
        });
        self.blocks[id as usize].seen_through = seen;
        step
    }

    /// The block that a walk came into, by the link of the block it left.
    #[inline(always)]
    pub(crate) fn next_block(&mut self, left: u32, stride: &Stride, side: usize, scan: &mut Scan) -> u32 {
        if left != NONE {
            let next = self.nodes[left as usize].links[side];
            if next != NONE {
                return next;
            }
        }
        self.enter(stride.key, scan)
    }

    /// A block at most one off another in each axis, by links.
    fn enter_near(&mut self, key: BlockKey, other: u32, other_key: BlockKey, scan: &mut Scan) -> u32 {
        let mut id = other;
        for (axis, delta) in [key.x - other_key.x, key.y - other_key.y, key.z - other_key.z].into_iter().enumerate() {
            id = match delta {
                0 => id,
                1 | -1 if id != NONE => self.nodes[id as usize].links[2 * axis + usize::from(delta > 0)],
                _ => NONE,
            };
        }
        if id == NONE { self.enter(key, scan) } else { self.touch(id, scan) }
    }
}
