//! A box turned about the vertical: what a model fitted to a thing tells beyond its axis-aligned bounds.

use nalgebra::{Point3, Rotation2, Vector2, Vector3};

/// Centre, full sides along its own axes, and the angle of its x axis in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientedBox {
    /// Middle.
    pub center: Point3<f64>,
    /// Full side lengths along its own axes.
    pub sides_m: Vector3<f64>,
    /// Direction of its x axis, from the world's x axis, counter-clockwise.
    pub yaw_rad: f64,
}

impl OrientedBox {
    /// A plan point in the axes of the box, from its centre.
    pub fn in_box(&self, plan_point: Vector2<f64>) -> Vector2<f64> {
        Rotation2::new(-self.yaw_rad) * (plan_point - self.center.xy().coords)
    }

    /// The four corners in plan, counter-clockwise.
    pub fn corners(&self) -> [Vector2<f64>; 4] {
        let half = self.sides_m.xy() / 2.0;
        let turn = Rotation2::new(self.yaw_rad);
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| self.center.xy().coords + turn * Vector2::new(x * half.x, y * half.y))
    }
}
