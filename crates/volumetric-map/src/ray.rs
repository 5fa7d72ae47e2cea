//! Walking a ray through voxels: Amanatides and Woo 1987, in fixed point, so that a walk that jumps (see [`stride`](crate::stride))
//! meets exactly the voxels of this one that does not.

/// Fixed-point units per voxel of ray length.
pub(crate) const UNITS: f64 = 4_294_967_296.0;
/// A border that a ray never reaches.
pub(crate) const NEVER: i64 = 1 << 60;

/// Ray length in fixed point, rounded; exact for lengths below 2^19 voxels, which no ray has.
#[inline]
pub(crate) fn fixed(length: f64) -> i64 {
    // The sum's last bit is worth one, so the number stands in its low bits; a checked cast costs three times as much.
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    ((length * UNITS + SHIFT).to_bits() as i64).wrapping_sub(SHIFT.to_bits() as i64)
}

/// A ray on its way through the voxel grid.
#[derive(Debug, Clone)]
pub(crate) struct RayWalk {
    /// The voxel the walk stands in.
    pub index: [i32; 3],
    /// -1, 0 or 1 an axis.
    pub step: [i32; 3],
    /// Ray length at which the next border of each axis is crossed.
    pub t_next: [i64; 3],
    /// Ray length between two borders of an axis.
    pub t_delta: [i64; 3],
    /// Ray length at the foot of the perpendicular from the voxel's centre.
    pub foot: i64,
    /// How far the foot moves on with each border of an axis.
    pub rate: [i64; 3],
}

/// Largest whole number not above; the plain `f64::floor` is a library call on the baseline x86-64.
#[inline]
pub(crate) fn floor(value: f64) -> i32 {
    let whole = value as i32;
    whole - i32::from(value < f64::from(whole))
}

impl RayWalk {
    /// Starts `t_start` along the ray from `origin` (in voxels) in the unit direction.
    #[inline]
    pub fn new(origin: [f64; 3], direction: [f64; 3], t_start: f64) -> Self {
        let mut walk =
            Self { index: [0; 3], step: [0; 3], t_next: [NEVER; 3], t_delta: [NEVER; 3], foot: 0, rate: [0; 3] };
        let mut foot = 0.0;
        for axis in 0..3 {
            let d = direction[axis];
            let index = floor(origin[axis] + d * t_start);
            walk.index[axis] = index;
            foot += (f64::from(index) + 0.5 - origin[axis]) * d;
            // A slower axis crosses no border within the longest range (10 000 voxels) unless it begins at one.
            if d.abs() > 1e-5 {
                let inverse = 1.0 / d;
                let border = f64::from(index) + if d > 0.0 { 1.0 } else { 0.0 };
                walk.step[axis] = if d > 0.0 { 1 } else { -1 };
                walk.t_next[axis] = fixed((border - origin[axis]) * inverse);
                walk.t_delta[axis] = fixed(inverse.abs());
                walk.rate[axis] = fixed(d.abs());
            }
        }
        walk.foot = fixed(foot);
        walk
    }

    /// The axis whose border comes next and the ray length there; ties go to the first axis.
    #[inline]
    pub fn next_border(&self) -> (usize, i64) {
        let [x, y, z] = self.t_next;
        let (axis, t) = if y < x { (1, y) } else { (0, x) };
        if z < t { (2, z) } else { (axis, t) }
    }

    /// Crosses the next border of an axis.
    #[inline]
    pub fn cross(&mut self, axis: usize) {
        self.index[axis] += self.step[axis];
        self.t_next[axis] += self.t_delta[axis];
        self.foot += self.rate[axis];
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
            if t > fixed(length) {
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
    fn fixed_point_rounds() {
        for (length, expected) in [(0.0, 0), (1.0, 1i64 << 32), (-2.5, -5 << 31), (1.6 / UNITS, 2), (-0.4 / UNITS, 0)] {
            assert_eq!(fixed(length), expected, "{length}");
        }
        assert_eq!(fixed(200_000.0), 200_000 << 32);
    }

    #[test]
    fn the_foot_follows_the_centre() {
        let (origin, direction) = ([0.3, 0.2, 0.9], [0.48, -0.6, 0.64]);
        let mut walk = RayWalk::new(origin, direction, 2.0);
        for _ in 0..50 {
            walk.cross(walk.next_border().0);
            let foot: f64 = (0..3).map(|a| (f64::from(walk.index[a]) + 0.5 - origin[a]) * direction[a]).sum();
            assert!((foot - walk.foot as f64 / UNITS).abs() < 1e-7);
        }
    }
}
