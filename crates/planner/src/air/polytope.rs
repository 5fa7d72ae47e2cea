//! Convex polytopes as half-spaces.

use nalgebra::{Point3, Vector3};

use super::proof::smaller;

/// The points with `normal . x <= offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// Unit normal, pointing out.
    pub normal: Vector3<f64>,
    /// Signed distance of the plane from the origin along the normal.
    pub offset_m: f64,
}

/// An intersection of half-spaces.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Polytope {
    /// The faces, box faces first.
    pub faces: Vec<HalfSpace>,
}

impl Polytope {
    /// An axis-aligned box.
    pub fn from_box(low: &Point3<f64>, high: &Point3<f64>) -> Polytope {
        let mut faces = Vec::with_capacity(16);
        for axis in 0..3 {
            let mut normal = Vector3::zeros();
            normal[axis] = 1.0;
            faces.push(HalfSpace { normal, offset_m: high[axis] });
            faces.push(HalfSpace { normal: -normal, offset_m: -low[axis] });
        }
        Polytope { faces }
    }

    /// Distance to the nearest face from inside (m); negative outside (the largest violation). Infinite without faces, NaN if the
    /// point or a face is not a number.
    pub fn slack(&self, point: &Vector3<f64>) -> f64 {
        self.faces.iter().map(|f| f.offset_m - f.normal.dot(point)).fold(f64::INFINITY, smaller)
    }

    /// Whether the point is inside or on the border.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        self.slack(&point.coords) >= 0.0
    }
}
