//! Collision shapes: boxes, cylinders, spheres and convex hulls, with exact support values and swept discs.
//!
//! The support value of a convex set `K` in direction `d` is `h(d) = max over p in K of d . p`. Bounds, hulls and swept volumes
//! all come from it or from the finitely many points that span a shape.

use crate::inertia::MassProperties;
use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};

/// Shape of a collision body, about the origin of its own frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// A box.
    Box {
        /// Half the edge lengths, m.
        half: Vector3<f64>,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Half the length, m.
        half_length: f64,
    },
    /// A ball.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
    /// The convex hull of these points, m.
    ConvexHull(Vec<Point3<f64>>),
}

/// A collision shape placed in the body frame.
#[derive(Debug, Clone, PartialEq)]
pub struct CollisionShape {
    /// Name of the link or payload that carries it.
    pub link: String,
    /// Pose of the shape.
    pub body_from_shape: Isometry3<f64>,
    /// The shape.
    pub geometry: Geometry,
}

/// Points on a circle that stand for it: the corners of a polygon round it, at most 0.5 % outside.
const CIRCLE_SIDES: usize = 32;

impl Geometry {
    /// Largest `direction . p` over the shape placed at `frame_from_shape`; exact. `direction` need not have unit length.
    pub fn support(&self, frame_from_shape: &Isometry3<f64>, direction: &Vector3<f64>) -> f64 {
        let center = direction.dot(&frame_from_shape.translation.vector);
        let d = frame_from_shape.rotation.inverse_transform_vector(direction);
        center
            + match self {
                Self::Box { half } => d.abs().dot(half),
                Self::Cylinder { radius, half_length } => d.xy().norm() * radius + d.z.abs() * half_length,
                Self::Sphere { radius } => d.norm() * radius,
                Self::ConvexHull(points) => points.iter().map(|p| d.dot(&p.coords)).fold(f64::NEG_INFINITY, f64::max),
            }
    }

    /// Points in the frame whose convex hull, seen along z, covers the shape. The corners of polytopes are exact; round
    /// shapes get a polygon round them that touches them exactly in the directions +-x and +-y.
    pub fn outline(&self, frame_from_shape: &Isometry3<f64>) -> Vec<Point3<f64>> {
        let corner = |x: f64, y: f64, z: f64| frame_from_shape * Point3::new(x, y, z);
        match self {
            Self::Box { half } => SIGNS.iter().map(|s| corner(s[0] * half.x, s[1] * half.y, s[2] * half.z)).collect(),
            Self::Cylinder { radius, half_length } => {
                let x_axis = frame_from_shape * Vector3::x() * *radius;
                let y_axis = frame_from_shape * Vector3::y() * *radius;
                let ends = [-half_length, *half_length];
                ends.iter().flat_map(|z| circle_outline(&corner(0.0, 0.0, *z), &x_axis, &y_axis)).collect()
            }
            Self::Sphere { radius } => {
                circle_outline(&corner(0.0, 0.0, 0.0), &(Vector3::x() * *radius), &(Vector3::y() * *radius))
            }
            Self::ConvexHull(points) => points.iter().map(|p| frame_from_shape * p).collect(),
        }
    }

    /// The cylinder about an axis through the origin of the frame that the shape fills or touches when it turns a full turn:
    /// radius, and the range along the axis. Exact for polytopes, balls, and cylinders parallel to the axis; at most 0.5 % of
    /// the radius too large otherwise.
    pub fn swept_about(&self, axis: &Unit<Vector3<f64>>, frame_from_shape: &Isometry3<f64>) -> SweptCylinder {
        let off_axis = |v: &Vector3<f64>| (v - axis.scale(axis.dot(v))).norm();
        let center = frame_from_shape.translation.vector;
        let radius = match self {
            Self::Sphere { radius } => off_axis(&center) + radius,
            Self::Cylinder { radius, .. } if off_axis(&(frame_from_shape * Vector3::z())) < 1e-9 => {
                off_axis(&center) + radius
            }
            Self::Cylinder { radius, half_length } => {
                let x_axis = frame_from_shape * Vector3::x() * *radius;
                let y_axis = frame_from_shape * Vector3::y() * *radius;
                [-half_length, *half_length]
                    .iter()
                    .flat_map(|z| circle_outline(&(frame_from_shape * Point3::new(0.0, 0.0, *z)), &x_axis, &y_axis))
                    .map(|p| off_axis(&p.coords))
                    .fold(0.0, f64::max)
            }
            // The distance to a line is convex, so its maximum is at a corner.
            Self::Box { .. } | Self::ConvexHull(_) => {
                self.outline(frame_from_shape).iter().map(|p| off_axis(&p.coords)).fold(0.0, f64::max)
            }
        };
        SweptCylinder {
            radius,
            low: -self.support(frame_from_shape, &-axis.into_inner()),
            high: self.support(frame_from_shape, axis),
        }
    }

    /// Mass properties of the shape filled evenly with `mass_kg`; a hull is filled as the box round it.
    pub fn filled(&self, mass_kg: f64) -> MassProperties {
        let mut center_of_mass = Point3::origin();
        let diagonal = match self {
            Self::Box { half } => box_moments(half),
            Self::Cylinder { radius, half_length } => {
                let side = radius * radius / 4.0 + half_length * half_length / 3.0;
                Vector3::new(side, side, radius * radius / 2.0)
            }
            Self::Sphere { radius } => Vector3::repeat(0.4 * radius * radius),
            Self::ConvexHull(points) => {
                let low = points.iter().fold(Vector3::repeat(f64::INFINITY), |low, p| low.inf(&p.coords));
                let high = points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |high, p| high.sup(&p.coords));
                center_of_mass = Point3::from((low + high) / 2.0);
                box_moments(&((high - low) / 2.0))
            }
        };
        MassProperties { mass_kg, center_of_mass, inertia: Matrix3::from_diagonal(&(diagonal * mass_kg)) }
    }
}

/// What a shape fills when it turns about an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweptCylinder {
    /// Largest distance from the axis, m.
    pub radius: f64,
    /// Lowest point along the axis, m.
    pub low: f64,
    /// Highest point along the axis, m.
    pub high: f64,
}

/// Smallest and largest coordinates over all shapes, exact; `None` without shapes.
pub fn bounds(shapes: &[CollisionShape]) -> Option<(Point3<f64>, Point3<f64>)> {
    let reach = |direction: &Vector3<f64>| {
        shapes
            .iter()
            .map(|shape| shape.geometry.support(&shape.body_from_shape, direction))
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let high = axes.map(|axis| reach(&axis));
    let low = axes.map(|axis| -reach(&-axis));
    (!shapes.is_empty()).then(|| (Point3::from(low), Point3::from(high)))
}

const SIGNS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, 1.0, 1.0],
    [1.0, -1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, 1.0, 1.0],
];

fn box_moments(half: &Vector3<f64>) -> Vector3<f64> {
    let square = half.component_mul(half) / 3.0;
    Vector3::new(square.y + square.z, square.z + square.x, square.x + square.y)
}

/// Corners of a polygon round the circle `center + cos(t) x_axis + sin(t) y_axis`, in its plane.
///
/// Tangents at parameters `a < b` meet at parameter `(a + b) / 2`, further out by `1 / cos((b - a) / 2)`; an affine image of
/// tangents are tangents, so the projected polygon is round the projected ellipse. Besides evenly spaced tangents the four
/// that bound the circle in x and y are taken, which makes those bounds exact.
fn circle_outline(center: &Point3<f64>, x_axis: &Vector3<f64>, y_axis: &Vector3<f64>) -> Vec<Point3<f64>> {
    use std::f64::consts::{PI, TAU};
    let mut tangents: Vec<f64> = (0..CIRCLE_SIDES).map(|k| TAU * k as f64 / CIRCLE_SIDES as f64).collect();
    for axis in 0..2 {
        let extreme = y_axis[axis].atan2(x_axis[axis]).rem_euclid(TAU);
        tangents.extend([extreme, (extreme + PI).rem_euclid(TAU)]);
    }
    tangents.sort_by(f64::total_cmp);
    let next = tangents.iter().skip(1).copied().chain(std::iter::once(tangents[0] + TAU));
    let meet = |(a, b): (&f64, f64)| {
        let (middle, stretch) = ((a + b) / 2.0, 1.0 / ((b - a) / 2.0).cos());
        center + (x_axis * middle.cos() + y_axis * middle.sin()) * stretch
    };
    tangents.iter().zip(next).map(meet).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn a_blade_sweeps_a_disc() {
        // A blade 0.28 x 0.02 x 0.001 about z: half its diagonal.
        let blade = Geometry::Box { half: Vector3::new(0.14, 0.01, 0.0005) };
        let swept = blade.swept_about(&Vector3::z_axis(), &Isometry3::translation(0.0, 0.0, 0.06));
        assert!((swept.radius - 0.14f64.hypot(0.01)).abs() < 1e-12);
        assert!((swept.low - 0.0595).abs() < 1e-12 && (swept.high - 0.0605).abs() < 1e-12);
    }

    #[test]
    fn a_lying_cylinder_is_bounded_by_its_rims() {
        let roll = UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
        let pose = Isometry3::from_parts(nalgebra::Translation3::new(0.0, 1.0, 0.0), roll);
        let cylinder = Geometry::Cylinder { radius: 0.5, half_length: 0.25 };
        for (direction, expected) in
            [(Vector3::x(), 0.5), (Vector3::y(), 1.25), (-Vector3::y(), -0.75), (Vector3::z(), 0.5)]
        {
            assert!((cylinder.support(&pose, &direction) - expected).abs() < 1e-12);
            let outline = cylinder.outline(&pose);
            let reach = outline.iter().map(|p| p.coords.dot(&direction)).fold(f64::NEG_INFINITY, f64::max);
            assert!(direction.z != 0.0 || (reach - expected).abs() < 1e-12, "{direction}: {reach} for {expected}");
        }
    }

    #[test]
    fn a_filled_cube() {
        let cube = Geometry::Box { half: Vector3::repeat(0.5) };
        assert!((cube.filled(6.0).inertia - Matrix3::identity()).norm() < 1e-12, "m a^2 / 6 = 1");
        assert!(cube.filled(6.0).check().is_ok());
    }
}
