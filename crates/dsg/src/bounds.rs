//! Axis-aligned boxes in the world frame: the size of things, and the distances between them.

use nalgebra::{Isometry3, Point3, Vector2, Vector3};

/// A closed axis-aligned box in the world frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub min: Point3<f64>,
    /// Greatest corner; no component is below that of `min`.
    pub max: Point3<f64>,
}

impl Aabb {
    /// The box of one point: zero size.
    pub fn at(point: Point3<f64>) -> Aabb {
        Aabb { min: point, max: point }
    }

    /// The box with this centre and these full side lengths.
    pub fn from_center(center: Point3<f64>, sides_m: Vector3<f64>) -> Aabb {
        Aabb { min: center - sides_m / 2.0, max: center + sides_m / 2.0 }
    }

    /// The smallest box around the points; `None` for no points.
    pub fn around(points: impl IntoIterator<Item = Point3<f64>>) -> Option<Aabb> {
        let mut points = points.into_iter();
        let first = Aabb::at(points.next()?);
        Some(points.fold(first, |bounds, point| bounds.union(&Aabb::at(point))))
    }

    /// The middle of the box.
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// Full side lengths.
    pub fn sides_m(&self) -> Vector3<f64> {
        self.max - self.min
    }

    /// Length of the diagonal.
    pub fn diagonal_m(&self) -> f64 {
        self.sides_m().norm()
    }

    /// Volume in cubic metres.
    pub fn volume_m3(&self) -> f64 {
        self.sides_m().product()
    }

    /// The same box, `margin_m` larger on every side.
    pub fn inflated(&self, margin_m: f64) -> Aabb {
        let margin = Vector3::repeat(margin_m);
        Aabb { min: self.min - margin, max: self.max + margin }
    }

    /// The smallest box that holds both.
    pub fn union(&self, other: &Aabb) -> Aabb {
        Aabb { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// The common part, `None` if the boxes do not touch.
    pub fn intersection(&self, other: &Aabb) -> Option<Aabb> {
        let both = Aabb { min: self.min.sup(&other.min), max: self.max.inf(&other.max) };
        (0..3).all(|k| both.min[k] <= both.max[k]).then_some(both)
    }

    /// Whether the point lies in the box or on its surface.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        (0..3).all(|k| self.min[k] <= point[k] && point[k] <= self.max[k])
    }

    /// The point of the box nearest to `point` (the point itself if inside).
    pub fn nearest(&self, point: &Point3<f64>) -> Point3<f64> {
        point.coords.zip_zip_map(&self.min.coords, &self.max.coords, f64::clamp).into()
    }

    /// Distance from the box to a point; zero inside.
    pub fn distance_to_point_m(&self, point: &Point3<f64>) -> f64 {
        (self.nearest(point) - point).norm()
    }

    /// Gap between two boxes; zero if they touch or overlap.
    pub fn gap_m(&self, other: &Aabb) -> f64 {
        let gap = |k: usize| (self.min[k] - other.max[k]).max(other.min[k] - self.max[k]).max(0.0);
        Vector3::new(gap(0), gap(1), gap(2)).norm()
    }

    /// Gap between the footprints on the floor (x and y only); zero if they overlap.
    pub fn horizontal_gap_m(&self, other: &Aabb) -> f64 {
        let gap = |k: usize| (self.min[k] - other.max[k]).max(other.min[k] - self.max[k]).max(0.0);
        Vector2::new(gap(0), gap(1)).norm()
    }

    /// Share of the smaller footprint (x and y) that lies over the other, in `[0, 1]`. Sides below one centimetre count
    /// as one centimetre, so that a picture on a wall has a footprint.
    pub fn footprint_overlap(&self, other: &Aabb) -> f64 {
        const THIN_M: f64 = 0.01;
        let share = |k: usize| {
            let common = self.max[k].min(other.max[k]) - self.min[k].max(other.min[k]);
            let smaller = (self.max[k] - self.min[k]).min(other.max[k] - other.min[k]);
            if common < 0.0 { 0.0 } else { (common.max(THIN_M) / smaller.max(THIN_M)).min(1.0) }
        };
        share(0) * share(1)
    }

    /// The box around this box after a rigid motion.
    pub fn transformed(&self, motion: &Isometry3<f64>) -> Aabb {
        let center = motion * self.center();
        let half = self.sides_m() / 2.0;
        let turned = motion.rotation.to_rotation_matrix().matrix().abs() * half;
        Aabb { min: center - turned, max: center + turned }
    }

    /// Whether all six numbers are finite and `min <= max`.
    pub fn is_valid(&self) -> bool {
        (0..3).all(|k| self.min[k].is_finite() && self.max[k].is_finite() && self.min[k] <= self.max[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(x: f64) -> Aabb {
        Aabb::from_center(Point3::new(x, 0.0, 0.0), Vector3::repeat(1.0))
    }

    #[test]
    fn gap_and_overlap_of_two_cubes() {
        assert_eq!(cube(0.0).gap_m(&cube(3.0)), 2.0);
        assert_eq!(cube(0.0).gap_m(&cube(0.5)), 0.0);
        assert_eq!(cube(0.0).intersection(&cube(0.5)).unwrap().volume_m3(), 0.5);
        assert!(cube(0.0).intersection(&cube(3.0)).is_none());
        assert_eq!(cube(0.0).footprint_overlap(&cube(0.5)), 0.5);
        assert_eq!(cube(0.0).footprint_overlap(&cube(3.0)), 0.0);
    }

    #[test]
    fn a_quarter_turn_swaps_sides() {
        let slab = Aabb::from_center(Point3::origin(), Vector3::new(4.0, 2.0, 1.0));
        let turned = slab.transformed(&Isometry3::rotation(Vector3::z() * std::f64::consts::FRAC_PI_2));
        assert!((turned.sides_m() - Vector3::new(2.0, 4.0, 1.0)).norm() < 1e-12);
    }
}
