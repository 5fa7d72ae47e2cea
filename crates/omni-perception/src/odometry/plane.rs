//! Points of a small region as moments, and the plane through them.
//!
//! Moments of disjoint sets merge exactly (Chan, Golub, LeVeque 1979), so a region's plane costs nothing per point.

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};

/// Number, mean and scatter of a set of points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Number (or weight) of points.
    pub count: f64,
    /// Their mean.
    pub mean: Vector3<f64>,
    /// Sum of (p - mean)(p - mean)^T.
    pub scatter: Matrix3<f64>,
}

impl Default for Moments {
    fn default() -> Self {
        Moments { count: 0.0, mean: Vector3::zeros(), scatter: Matrix3::zeros() }
    }
}

impl Moments {
    /// Moments of both sets together.
    pub fn merge(&mut self, other: &Moments) {
        let count = self.count + other.count;
        if other.count <= 0.0 {
            return;
        }
        let difference = other.mean - self.mean;
        self.scatter += other.scatter + difference * difference.transpose() * (self.count * other.count / count);
        self.mean += difference * (other.count / count);
        self.count = count;
    }

    /// The same shape with the weight of at most `limit` points.
    pub fn limited(&self, limit: f64) -> Moments {
        let share = (limit / self.count).min(1.0);
        Moments { count: self.count * share, mean: self.mean, scatter: self.scatter * share }
    }
}

/// A plane with what is known about its accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: Vector3<f64>,
    /// A point on it: the mean of its points.
    pub point: Point3<f64>,
    /// Variance of the points about it, m^2.
    pub thickness_m2: f64,
    /// Variance of the points along the narrower direction of the plane, m^2.
    pub width_m2: f64,
    /// Points behind it.
    pub count: f64,
}

impl Plane {
    /// Variance of the plane's height at a place `offset_m` from its middle, m^2.
    pub fn variance_at(&self, offset_m: f64) -> f64 {
        self.thickness_m2 / self.count * (1.0 + offset_m * offset_m / self.width_m2)
    }
}

/// What makes a set of points a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneTest {
    /// Fewest points.
    pub min_count: f64,
    /// Largest standard deviation about the plane, m.
    pub max_thickness_m: f64,
    /// Smallest standard deviation in both directions of the plane, m: points on a line have no normal.
    pub min_width_m: f64,
}

impl PlaneTest {
    /// The plane through the points, if they are one.
    pub fn fit(&self, moments: &Moments) -> Option<Plane> {
        if moments.count < self.min_count {
            return None;
        }
        let covariance = moments.scatter / moments.count;
        // Cheap refusals first: the smallest variance is at most a third of the trace and at least det / (trace/2)^2.
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let [thin, middle, _] = order;
        let (thickness_m2, width_m2) = (eigen.eigenvalues[thin].max(0.0), eigen.eigenvalues[middle]);
        let is_plane = thickness_m2 <= self.max_thickness_m.powi(2)
            && width_m2 >= self.min_width_m.powi(2)
            && width_m2 >= 4.0 * thickness_m2;
        let normal = eigen.eigenvectors.column(thin).into_owned();
        is_plane.then(|| Plane {
            normal,
            point: Point3::from(moments.mean),
            thickness_m2,
            width_m2,
            count: moments.count,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(points: &[[f64; 3]]) -> Moments {
        let mut all = Moments::default();
        for &point in points {
            all.merge(&Moments { count: 1.0, mean: Vector3::from(point), scatter: Matrix3::zeros() });
        }
        all
    }

    const TEST: PlaneTest = PlaneTest { min_count: 4.0, max_thickness_m: 0.03, min_width_m: 0.03 };

    #[test]
    fn four_corners_of_a_square() {
        let all = moments(&[[1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [-1.0, 0.0, 2.0], [0.0, -1.0, 2.0]]);
        assert_eq!((all.count, all.mean), (4.0, Vector3::new(0.0, 0.0, 2.0)));
        let plane = TEST.fit(&all).expect("a plane");
        assert!((plane.normal.z.abs() - 1.0).abs() < 1e-12);
        assert!((plane.width_m2 - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_line_and_a_ball_are_no_planes() {
        assert_eq!(TEST.fit(&moments(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])), None);
        let ball =
            [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
        assert_eq!(TEST.fit(&moments(&ball)), None);
        assert_eq!(TEST.fit(&moments(&ball[..3])), None);
    }
}
