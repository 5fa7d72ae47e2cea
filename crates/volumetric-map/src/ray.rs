//! Walking a ray through voxels: Amanatides and Woo 1987, with a jump over whole blocks.

/// A ray on its way through the voxel grid. Lengths are in voxels.
#[derive(Debug, Clone)]
pub(crate) struct RayWalk {
    /// The voxel the walk stands in.
    pub index: [i32; 3],
    /// -1, 0 or 1 an axis.
    pub step: [i32; 3],
    /// Ray length at which the next border of each axis is crossed.
    t_next: [f64; 3],
    t_delta: [f64; 3],
    /// Borders per length: the inverse of `t_delta`.
    rate: [f64; 3],
}

/// Largest whole number not above; the plain `f64::floor` is a library call on the baseline x86-64.
#[inline]
pub(crate) fn floor(value: f64) -> i32 {
    let whole = value as i32;
    whole - i32::from(value < f64::from(whole))
}

impl RayWalk {
    /// Starts `t_start` along the ray from `origin` (in voxels) in the unit direction.
    pub fn new(origin: [f64; 3], direction: [f64; 3], t_start: f64) -> Self {
        let mut walk = Self {
            index: [0; 3],
            step: [0; 3],
            t_next: [f64::INFINITY; 3],
            t_delta: [f64::INFINITY; 3],
            rate: [0.0; 3],
        };
        for axis in 0..3 {
            let d = direction[axis];
            walk.index[axis] = floor(origin[axis] + d * t_start);
            if d.abs() > 1e-12 {
                let inverse = 1.0 / d;
                let border = f64::from(walk.index[axis]) + if d > 0.0 { 1.0 } else { 0.0 };
                walk.step[axis] = if d > 0.0 { 1 } else { -1 };
                walk.t_next[axis] = (border - origin[axis]) * inverse;
                walk.t_delta[axis] = inverse.abs();
                walk.rate[axis] = d.abs();
            }
        }
        walk
    }

    /// The axis whose border comes next and the ray length there.
    #[inline]
    pub fn next_border(&self) -> (usize, f64) {
        // Selections, not branches: which axis comes next is as good as random, and a wrong guess costs more than the step.
        let [x, y, z] = self.t_next;
        let is_y = y < x;
        let (axis, t) = (usize::from(is_y), if is_y { y } else { x });
        let is_z = z < t;
        (if is_z { 2 } else { axis }, if is_z { z } else { t })
    }

    /// Crosses the next border of an axis.
    #[inline]
    pub fn cross(&mut self, axis: usize) {
        self.index[axis] += self.step[axis];
        self.t_next[axis] += self.t_delta[axis];
    }

    /// Stands in the last voxel of this 8^3 block before the ray leaves it; the next [`cross`](Self::cross) leaves.
    pub fn jump_to_block_end(&mut self) {
        // Borders each axis has yet to cross inside the block before the one that leaves it.
        let left: [i32; 3] = std::array::from_fn(|axis| {
            let local = self.index[axis] & 7;
            if self.step[axis] > 0 { 7 - local } else { local }
        });
        let leave = |axis: usize| self.t_next[axis] + f64::from(left[axis]) * self.t_delta[axis];
        // An axis that never moves has infinite borders; zero borders left times infinity is no number, and is not the minimum.
        let t_leave = leave(0).min(leave(1)).min(leave(2));
        for (axis, left) in left.into_iter().enumerate() {
            if self.step[axis] == 0 || self.t_next[axis] >= t_leave {
                continue;
            }
            let crossed = (1 + floor((t_leave - self.t_next[axis]) * self.rate[axis])).min(left);
            self.index[axis] += crossed * self.step[axis];
            self.t_next[axis] += f64::from(crossed) * self.t_delta[axis];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voxels(origin: [f64; 3], direction: [f64; 3], length: f64) -> Vec<[i32; 3]> {
        let mut walk = RayWalk::new(origin, direction, 0.0);
        let mut out = vec![walk.index];
        loop {
            let (axis, t) = walk.next_border();
            if t > length {
                return out;
            }
            walk.cross(axis);
            out.push(walk.index);
        }
    }

    #[test]
    fn a_straight_and_a_slanted_ray_by_hand() {
        assert_eq!(voxels([0.5, 0.5, 0.5], [-1.0, 0.0, 0.0], 2.0), [[0, 0, 0], [-1, 0, 0], [-2, 0, 0]]);
        let s = 5.0f64.sqrt();
        assert_eq!(voxels([0.5, 0.6, 0.5], [2.0 / s, 1.0 / s, 0.0], 2.2), [[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0]]);
    }

    #[test]
    fn a_jump_ends_where_the_steps_end() {
        for k in 0..200u32 {
            let a = f64::from(k) * 0.37;
            let direction = [a.cos() * (0.3 * a).cos(), a.sin() * (0.3 * a).cos(), (0.3 * a).sin()];
            let origin = [3.3 + (a * 7.0).sin(), 4.1, 2.7 + (a * 3.0).cos()];
            let mut jump = RayWalk::new(origin, direction, 0.0);
            let mut steps = jump.clone();
            jump.jump_to_block_end();
            loop {
                let (axis, _) = steps.next_border();
                let mut ahead = steps.clone();
                ahead.cross(axis);
                if ahead.index.map(|i| i >> 3) != steps.index.map(|i| i >> 3) {
                    break;
                }
                steps = ahead;
            }
            assert_eq!(jump.index, steps.index, "ray {k}");
        }
    }
}
