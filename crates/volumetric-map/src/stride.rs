//! The same walk as [`RayWalk`](crate::ray), for many rays: it knows when it leaves its block, and can cross a whole block in one step.
//!
//! The lengths at which a block is left are the lengths at which its last voxel is left, in the same fixed point, so the two walks agree
//! bit for bit. The axis is carried in the two lowest bits of a length: the least of three lengths names its axis, ties
//! go to the first axis by themselves, and a length equals the one at which the block is left only if it is that border.

use crate::block::BlockKey;
use crate::ray::RayWalk;

/// A walk that stands at a voxel of a block.
#[derive(Debug, Clone)]
pub(crate) struct Stride {
    /// Key of the block it stands in.
    pub key: BlockKey,
    /// Number of the voxel in the block; settled by [`catch_up`](Self::catch_up) after skipped blocks.
    pub local: u32,
    /// Ray length at the foot of the voxel's centre; lost with the first skipped block.
    pub foot: i64,
    /// Lengths of the next borders, and between borders, with the axis in the low bits (of `next` and `leave`).
    next: [i64; 3],
    delta: [i64; 3],
    /// Lengths at which the block is left.
    leave: [i64; 3],
    /// By axis, and once more so that two bits index it: what a border adds to `local` and to `foot`.
    add: [u32; 4],
    rate: [i64; 4],
    step: [i32; 3],
    /// The first voxel's number: an axis that never moves keeps its part.
    first: u32,
    /// Where and when the walk came into this block, if it skipped the last.
    skipped: Option<(usize, i64)>,
}

/// Why a walk through a block ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// It left the block through this side: -x, +x, -y, +y, -z, +z as 0 to 5.
    Left(usize),
    /// The next border lies beyond the end.
    End,
}

impl Stride {
    #[inline(always)]
    pub fn new(walk: &RayWalk) -> Self {
        let mut stride = Self {
            key: BlockKey::of_voxel(walk.index),
            local: 0,
            foot: walk.foot,
            next: [0; 3],
            delta: [0; 3],
            leave: [0; 3],
            add: [0; 4],
            rate: [walk.rate[0], walk.rate[1], walk.rate[2], 0],
            step: walk.step,
            first: 0,
            skipped: None,
        };
        for axis in 0..3 {
            let local = walk.index[axis] & 7;
            // 7 - local counting up, local counting down.
            let left = if walk.step[axis] > 0 { 7 - local } else { local };
            stride.local |= (local as u32) << (3 * axis);
            stride.next[axis] = walk.t_next[axis] << 2 | axis as i64;
            stride.delta[axis] = walk.t_delta[axis] << 2;
            let is_moving = walk.step[axis] != 0;
            stride.leave[axis] = stride.next[axis] + if is_moving { i64::from(left) * stride.delta[axis] } else { 0 };
            stride.add[axis] = (walk.step[axis] << (3 * axis)) as u32;
        }
        stride.first = stride.local;
        stride
    }

    /// Visits the voxels of this block (number in the block, foot) up to `end`, then enters the next block.
    #[inline(always)]
    pub fn walk_block(&mut self, end: i64, mut visit: impl FnMut(u32, i64)) -> Step {
        let end = end << 2 | 3;
        let leaves = self.leave[0].min(self.leave[1]).min(self.leave[2]);
        let [mut x, mut y, mut z] = self.next;
        let (mut local, mut foot) = (self.local, self.foot);
        let last = leaves.min(end + 1);
        loop {
            visit(local, foot);
            let t = x.min(y).min(z);
            if t >= last {
                self.next = [x, y, z];
                (self.local, self.foot) = (local, foot);
                if t > end {
                    return Step::End;
                }
                let axis = (t & 3) as usize;
                self.next[axis] += self.delta[axis];
                self.foot += self.rate[axis];
                // From the last voxel of the block to the first of the next.
                self.local ^= 7 << (3 * axis);
                return self.enter_next(axis);
            }
            // Selections, not branches: which axis comes next is as good as random, and a wrong guess costs more than the step.
            let axis = (t & 3) as usize;
            local = local.wrapping_add(self.add[axis]);
            foot += self.rate[axis];
            x = if x == t { x + self.delta[0] } else { x };
            y = if y == t { y + self.delta[1] } else { y };
            z = if z == t { z + self.delta[2] } else { z };
        }
    }

    /// Goes straight to where the ray leaves the block.
    #[inline(always)]
    pub fn skip_block(&mut self, end: i64) -> Step {
        let t = self.leave[0].min(self.leave[1]).min(self.leave[2]);
        if t > (end << 2 | 3) {
            return Step::End;
        }
        let axis = (t & 3) as usize;
        self.skipped = Some((axis, t));
        self.enter_next(axis)
    }

    /// Finds the voxel at which the walk entered this block, after skipped ones.
    #[inline]
    pub fn catch_up(&mut self) {
        let Some((entered, now)) = self.skipped.take() else { return };
        self.local = 0;
        for axis in 0..3 {
            if self.step[axis] == 0 {
                self.local |= self.first & 7 << (3 * axis);
                continue;
            }
            // Borders still to cross before the block is left, the one that leaves it among them: those later than now.
            let ahead = if axis == entered {
                8
            } else {
                let rest = self.leave[axis] - now;
                let mut whole = (rest as f64 / self.delta[axis] as f64) as i64;
                whole += i64::from((whole + 1) * self.delta[axis] <= rest);
                whole -= i64::from(whole * self.delta[axis] > rest);
                (whole + 1).min(8)
            };
            self.next[axis] = self.leave[axis] - (ahead - 1) * self.delta[axis];
            let local = if self.step[axis] > 0 { 8 - ahead } else { ahead - 1 };
            self.local |= (local as u32) << (3 * axis);
        }
    }

    #[inline(always)]
    fn enter_next(&mut self, axis: usize) -> Step {
        let step = self.step[axis];
        self.leave[axis] += 8 * self.delta[axis];
        match axis {
            0 => self.key.x += step,
            1 => self.key.y += step,
            _ => self.key.z += step,
        }
        Step::Left(2 * axis + usize::from(step > 0))
    }
}

/// World index of a voxel of a block.
#[inline]
pub(crate) fn voxel_of(key: BlockKey, local: u32) -> [i32; 3] {
    let [x, y, z] = key.first_voxel();
    [x + (local & 7) as i32, y + (local >> 3 & 7) as i32, z + (local >> 6) as i32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::{UNITS, fixed};

    /// Walks the blocks, skipping those that `skips` names, and compares with the plain walk wherever both stand.
    fn compare(origin: [f64; 3], direction: [f64; 3], skips: impl Fn(BlockKey) -> bool) {
        let end = fixed(60.0);
        let mut plain = RayWalk::new(origin, direction, 0.0);
        let mut expected = Vec::new();
        loop {
            expected.push((plain.index, plain.foot));
            let (axis, t) = plain.next_border();
            if t > end {
                break;
            }
            plain.cross(axis);
        }
        let mut stride = Stride::new(&RayWalk::new(origin, direction, 0.0));
        let mut expected = expected.into_iter().peekable();
        let mut is_foot_lost = false;
        loop {
            let key = stride.key;
            let step = if skips(key) {
                while expected.next_if(|(voxel, _)| BlockKey::of_voxel(*voxel) == key).is_some() {}
                is_foot_lost = true;
                stride.skip_block(end)
            } else {
                stride.catch_up();
                assert_eq!(Some(voxel_of(key, stride.local)), expected.peek().map(|e| e.0));
                stride.walk_block(end, |local, foot| {
                    let (voxel, plain_foot) = expected.next().expect("the plain walk is as long");
                    assert_eq!(voxel_of(key, local), voxel);
                    assert!(is_foot_lost || foot == plain_foot);
                })
            };
            if step == Step::End {
                break;
            }
        }
        assert_eq!(expected.next(), None, "the plain walk is no longer");
    }

    #[test]
    fn strides_meet_the_voxels_of_the_plain_walk() {
        for k in 0..400u32 {
            let a = f64::from(k) * 0.37;
            let direction = [a.cos() * (0.3 * a).cos(), a.sin() * (0.3 * a).cos(), (0.3 * a).sin()];
            let origin = [3.3 + (a * 7.0).sin(), 4.1, 2.7 + (a * 3.0).cos()];
            compare(origin, direction, |_| false);
            compare(origin, direction, |key| (key.x + 2 * key.y + 3 * key.z + k as i32) % 3 == 0);
            compare(origin, direction, |key| (key.x + key.y + key.z) % 4 != 0);
        }
    }

    #[test]
    fn ties_at_corners_and_rays_along_an_axis() {
        let (h, t) = (0.5f64.sqrt(), (1.0f64 / 3.0).sqrt());
        for direction in
            [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [h, h, 0.0], [-h, 0.0, h], [t, t, t], [-t, t, -t], [0.6, -0.8, 0.0]]
        {
            for origin in [[0.0; 3], [0.5; 3], [8.0, 4.0, 0.0]] {
                compare(origin, direction, |_| false);
                compare(origin, direction, |key| (key.x + key.y + key.z) % 2 == 0);
            }
        }
        assert_eq!(UNITS, (1u64 << 32) as f64);
    }
}
