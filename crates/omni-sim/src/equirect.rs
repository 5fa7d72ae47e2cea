//! The panorama's geometry: which direction each pixel looks in.
//!
//! The picture a viewer inside sees: `u = W/2 (1 - theta/pi)` (left of the middle is left of the robot, the seam is behind
//! it), `v = H (phi_top - phi)/(phi_top - phi_bottom)`, pixel centres at +0.5. `theta` and `phi` are azimuth and elevation
//! in the camera frame, whose axes are those of a body: x forward, y left, z up.

use nalgebra::Vector3;
use std::f64::consts::PI;

/// Size and vertical limits of an equirectangular picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equirect {
    /// Columns, over the full circle.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Elevation of the upper border.
    pub phi_top_rad: f64,
    /// Elevation of the lower border.
    pub phi_bottom_rad: f64,
}

impl Equirect {
    /// Azimuth of column coordinate `u`.
    pub fn theta_rad(&self, u: f64) -> f64 {
        PI * (1.0 - 2.0 * u / f64::from(self.width))
    }

    /// Elevation of row coordinate `v`.
    pub fn phi_rad(&self, v: f64) -> f64 {
        self.phi_top_rad - (self.phi_top_rad - self.phi_bottom_rad) * v / f64::from(self.height)
    }

    /// Direction of the pixel coordinate `(u, v)` in the camera frame.
    pub fn direction(&self, u: f64, v: f64) -> Vector3<f64> {
        let (sin_theta, cos_theta) = self.theta_rad(u).sin_cos();
        let (sin_phi, cos_phi) = self.phi_rad(v).sin_cos();
        Vector3::new(cos_phi * cos_theta, cos_phi * sin_theta, sin_phi)
    }

    /// Pixel coordinate of a direction in the camera frame; `v` may lie outside the picture.
    pub fn pixel(&self, direction: &Vector3<f64>) -> (f64, f64) {
        let theta = direction.y.atan2(direction.x);
        let phi = direction.z.atan2(direction.x.hypot(direction.y));
        let u = f64::from(self.width) / 2.0 * (1.0 - theta / PI);
        let v = f64::from(self.height) * (self.phi_top_rad - phi) / (self.phi_top_rad - self.phi_bottom_rad);
        (u.rem_euclid(f64::from(self.width)), v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn left_of_the_robot_is_left_in_the_picture() {
        let view = Equirect { width: 1920, height: 640, phi_top_rad: PI / 3.0, phi_bottom_rad: -PI / 3.0 };
        assert_eq!(view.pixel(&Vector3::x()), (960.0, 320.0));
        let (u, v) = view.pixel(&Vector3::new(0.0, 1.0, 1.0));
        assert!((u - 480.0).abs() < 1e-9 && (v - 80.0).abs() < 1e-9); // 45 degrees up: 15 of 120 from the top
        for (u, v) in [(0.5, 0.5), (1919.5, 639.5), (700.25, 320.0)] {
            let (a, b) = view.pixel(&view.direction(u, v));
            assert!((a - u).abs() < 1e-9 && (b - v).abs() < 1e-9);
        }
    }
}
