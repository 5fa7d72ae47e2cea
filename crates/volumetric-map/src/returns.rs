//! What the integration needs to know of a return, worked out for many at a time in plain loops that compile to vector instructions.

use nalgebra::{Point3, Vector3};

/// Returns worked out together.
pub(crate) const LANES: usize = 64;

/// Lengths in voxels. What belongs to points that are not finite, or lie at the sensor, has no meaning.
pub(crate) struct Returns {
    pub range: [f64; LANES],
    direction: [[f64; LANES]; 3],
    end: [[i32; LANES]; 3],
}

impl Returns {
    pub fn new() -> Self {
        Self { range: [0.0; LANES], direction: [[0.0; LANES]; 3], end: [[0; LANES]; 3] }
    }

    /// Takes up to [`LANES`] points (metres in world) seen from `origin` (voxels); rays end at `far` at the latest.
    pub fn take(&mut self, points: &[Point3<f32>], voxels_per_m: f64, origin: &Vector3<f64>, far: f64) {
        let n = points.len().min(LANES);
        let [x, y, z] = &mut self.direction;
        for (i, point) in points[..n].iter().enumerate() {
            x[i] = f64::from(point.x) * voxels_per_m - origin.x;
            y[i] = f64::from(point.y) * voxels_per_m - origin.y;
            z[i] = f64::from(point.z) * voxels_per_m - origin.z;
        }
        let mut cut = [0.0; LANES];
        for i in 0..n {
            let range = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
            self.range[i] = range;
            cut[i] = if range > far { far / range } else { 1.0 };
        }
        for (axis, offset) in self.direction.iter_mut().enumerate() {
            let end = &mut self.end[axis];
            for i in 0..n {
                end[i] = floor(origin[axis] + offset[i] * cut[i]);
                offset[i] /= self.range[i];
            }
        }
    }

    /// Unit vector from the sensor.
    #[inline]
    pub fn direction(&self, lane: usize) -> Vector3<f64> {
        Vector3::new(self.direction[0][lane], self.direction[1][lane], self.direction[2][lane])
    }

    /// The voxel in which the return, or the ray's cut end, lies.
    #[inline]
    pub fn end(&self, lane: usize) -> [i32; 3] {
        [self.end[0][lane], self.end[1][lane], self.end[2][lane]]
    }
}

/// Largest whole number not above a value below 2^31, without a branch or a checked cast.
#[inline(always)]
fn floor(value: f64) -> i32 {
    // The sum's last bit is worth one: the value rounded to the nearest stands in its low bits.
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    let sum = value + SHIFT;
    let nearest = sum - SHIFT;
    (sum.to_bits() as i32).wrapping_sub(i32::from(nearest > value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floors() {
        for k in -4000..4000 {
            let value = f64::from(k) * 0.125;
            assert_eq!(floor(value), value.floor() as i32, "{value}");
        }
        assert_eq!([floor(4e6 + 0.7), floor(-4e6 - 0.2), floor(-1e-12)], [4_000_000, -4_000_001, -1]);
    }

    #[test]
    fn three_returns_by_hand() {
        let points = [Point3::new(0.3, 0.0, 0.4f32), Point3::new(0.0, -1.0, 0.0), Point3::new(f32::NAN, 0.0, 0.0)];
        let mut returns = Returns::new();
        returns.take(&points, 10.0, &Vector3::new(0.0, 0.0, 0.5), 5.0);
        // (3, 0, 3.5) from the sensor; (0, -10, -0.5), cut to half its length.
        assert!((returns.range[0] - 21.25f64.sqrt()).abs() < 1e-6);
        assert_eq!(returns.end(0), [3, 0, 4]);
        assert!((returns.direction(1) * 100.25f64.sqrt() - Vector3::new(0.0, -10.0, -0.5)).norm() < 1e-9);
        assert_eq!(returns.end(1), [0, -5, 0]);
        assert!(returns.range[2].is_nan());
    }
}
