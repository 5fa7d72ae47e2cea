//! The normal lens with radial and tangential distortion, as OpenCV and Kalibr (`pinhole-radtan`) write it:
//!
//! ```text
//! s = x^2 + y^2,  R = 1 + k1 s + k2 s^2 + k3 s^3                     x, y: point over depth
//! x' = x R + 2 p1 x y + p2 (s + 2 x^2),   y' = y R + p1 (s + 2 y^2) + 2 p2 x y
//! ```
//! D. C. Brown, "Close-range camera calibration", 1971; OpenCV `calib3d`, section "Detailed description".
//!
//! The map is the gradient of a potential: its Jacobian is symmetric. Where the smaller eigenvalue stays positive on a
//! disc, the potential is convex, so the map is one to one there and has exactly one way back. That disc is the domain;
//! beyond it strong lenses fold outside directions back into the image.

use nalgebra::{Point3, Unit, Vector3};

use super::intrinsics::{check_finite, check_max_angle};
use super::radial::MIN_SLOPE;
use super::{Intrinsics, Pixel, camera_direction, optical_from_camera};
use crate::CameraError;

/// A normal lens after Brown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinholeRadtan {
    intrinsics: Intrinsics,
    distortion: [f64; 5],
    max_radius: f64,
}

impl PinholeRadtan {
    /// The lens with `[k1, k2, p1, p2, k3]` (OpenCV's order; Kalibr has no k3: 0), which sees nothing farther than
    /// `max_angle_rad` from its axis (pi if unknown). The domain ends earlier where the distortion stops being one to one.
    ///
    /// # Errors
    /// [`CameraError`] names the number that is out of its range.
    pub fn new(intrinsics: Intrinsics, distortion: [f64; 5], max_angle_rad: f64) -> Result<PinholeRadtan, CameraError> {
        intrinsics.validate()?;
        check_finite("distortion", &distortion)?;
        check_max_angle(max_angle_rad)?;
        Ok(PinholeRadtan { intrinsics, distortion, max_radius: convex_radius(&distortion, max_angle_rad) })
    }

    /// See [`super::Camera::project`].
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Pixel> {
        let [x, y, z] = optical_from_camera(point_in_camera)?;
        if z <= 0.0 || x.hypot(y) > self.max_radius * z {
            return None;
        }
        let ([right, down], _) = distorted(&self.distortion, x / z, y / z);
        self.intrinsics.pixel(right, down)
    }

    /// See [`super::Camera::unproject`].
    pub fn unproject(&self, pixel: Pixel) -> Option<Unit<Vector3<f64>>> {
        let (right, down) = self.intrinsics.plane(pixel)?;
        let (x, y) = undistorted(&self.distortion, self.max_radius, right, down)?;
        Some(camera_direction(x, y, 1.0))
    }

    /// Size, focal lengths and centre.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// k1, k2, p1, p2, k3.
    pub fn distortion(&self) -> &[f64; 5] {
        &self.distortion
    }

    /// Where the domain ends, from the axis.
    pub fn max_angle_rad(&self) -> f64 {
        self.max_radius.atan()
    }
}

/// The distorted place and the Jacobian's entries xx, xy, yy.
fn distorted(&[k1, k2, p1, p2, k3]: &[f64; 5], x: f64, y: f64) -> ([f64; 2], [f64; 3]) {
    let s = x * x + y * y;
    let radial = 1.0 + s * (k1 + s * (k2 + s * k3));
    let radial_slope = k1 + s * (2.0 * k2 + s * 3.0 * k3); // by s
    let place = [
        x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
    ];
    let jacobian = [
        radial + 2.0 * x * x * radial_slope + 2.0 * p1 * y + 6.0 * p2 * x,
        2.0 * x * y * radial_slope + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + 2.0 * y * y * radial_slope + 6.0 * p1 * y + 2.0 * p2 * x,
    ];
    (place, jacobian)
}

/// Radius of the disc on which the smaller eigenvalue of the Jacobian is at least [`MIN_SLOPE`].
fn convex_radius(distortion: &[f64; 5], max_angle_rad: f64) -> f64 {
    const RINGS: u32 = 256;
    const SPOKES: u32 = 32; // around the axis the Jacobian is a trigonometric polynomial of order 2
    /// Beyond 89 degrees a pinhole has no image.
    const WIDEST_RAD: f64 = 1.5533;
    let end_rad = max_angle_rad.min(WIDEST_RAD);
    let radius = |ring: u32| (end_rad * f64::from(ring) / f64::from(RINGS)).tan();
    let is_convex = |r: f64| {
        (0..SPOKES).all(|spoke| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(spoke) / f64::from(SPOKES)).sin_cos();
            let (_, [xx, xy, yy]) = distorted(distortion, r * cos, r * sin);
            0.5 * (xx + yy) - (0.5 * (xx - yy)).hypot(xy) >= MIN_SLOPE
        })
    };
    match (1..=RINGS).find(|&ring| !is_convex(radius(ring))) {
        Some(ring) => radius(ring - 1),
        None => radius(RINGS),
    }
}

/// The place whose distorted image is (right, down), by Newton's method with halved steps; `None` outside the disc.
fn undistorted(distortion: &[f64; 5], max_radius: f64, right: f64, down: f64) -> Option<(f64, f64)> {
    const STEPS: usize = 100;
    let miss = |x: f64, y: f64| {
        let ([a, b], jacobian) = distorted(distortion, x, y);
        ([a - right, b - down], jacobian)
    };
    let shrink = (max_radius / right.hypot(down)).min(1.0);
    let (mut x, mut y) = (right * shrink, down * shrink);
    let ([mut ex, mut ey], mut jacobian) = miss(x, y);
    for _ in 0..STEPS {
        let [xx, xy, yy] = jacobian;
        let det = xx * yy - xy * xy;
        let (dx, dy) = ((yy * ex - xy * ey) / det, (xx * ey - xy * ex) / det);
        if dx.hypot(dy) <= 4.0 * f64::EPSILON * (1.0 + x.hypot(y)) {
            break;
        }
        let mut step = 1.0;
        let is_better = loop {
            let (nx, ny) = (x - step * dx, y - step * dy);
            let pull = (max_radius / nx.hypot(ny)).min(1.0);
            let (nx, ny) = (nx * pull, ny * pull);
            let ([nex, ney], next) = miss(nx, ny);
            if nex.hypot(ney) < ex.hypot(ey) {
                (x, y, ex, ey, jacobian) = (nx, ny, nex, ney, next);
                break true;
            }
            step *= 0.5;
            if step < 1e-4 {
                break false;
            }
        };
        if !is_better {
            break;
        }
    }
    let is_found = ex.hypot(ey) <= 1e-13 * (1.0 + right.hypot(down));
    is_found.then_some((x, y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn intrinsics() -> Intrinsics {
        Intrinsics { width_px: 640, height_px: 480, fx_px: 400.0, fy_px: 410.0, cx_px: 319.5, cy_px: 239.5 }
    }

    #[test]
    fn without_distortion_it_is_similar_triangles() {
        let camera = PinholeRadtan::new(intrinsics(), [0.0; 5], PI).expect("sound");
        let pixel = camera.project(&Point3::new(2.0, -1.0, -0.5)).expect("inside");
        assert!((pixel.u - 520.0).abs() < 1e-12 && (pixel.v - 342.5).abs() < 1e-12);
        assert_eq!(camera.project(&Point3::new(-2.0, -1.0, -0.5)), None);
        assert_eq!(camera.project(&Point3::new(0.0, 1.0, 0.0)), None);
        assert_eq!(camera.project(&Point3::new(1.0, 2.0, 0.0)), None); // off the image
    }

    #[test]
    fn brown_by_hand() {
        // x = 0.5, y = 0.25: s = 0.3125.
        let camera = PinholeRadtan::new(intrinsics(), [0.1, 0.0, 0.01, 0.02, 0.0], PI).expect("sound");
        let pixel = camera.project(&Point3::new(1.0, -0.5, -0.25)).expect("inside");
        let radial = 1.0 + 0.1 * 0.3125;
        let x = 0.5 * radial + 2.0 * 0.01 * 0.125 + 0.02 * (0.3125 + 0.5);
        let y = 0.25 * radial + 0.01 * (0.3125 + 0.125) + 2.0 * 0.02 * 0.125;
        assert!((pixel.u - (320.0 + 400.0 * x)).abs() < 1e-12 && (pixel.v - (240.0 + 410.0 * y)).abs() < 1e-12);
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        let distortion = [-0.3, 0.1, 0.002, -0.003, -0.01];
        let (x, y, h) = (0.4, -0.6, 1e-6);
        let (_, [xx, xy, yy]) = distorted(&distortion, x, y);
        let difference = |dx: f64, dy: f64| {
            let (a, b) = (distorted(&distortion, x + dx, y + dy).0, distorted(&distortion, x - dx, y - dy).0);
            [(a[0] - b[0]) / (2.0 * h), (a[1] - b[1]) / (2.0 * h)]
        };
        let ([ax, ay], [bx, by]) = (difference(h, 0.0), difference(0.0, h));
        assert!((ax - xx).abs() < 1e-8 && (ay - xy).abs() < 1e-8 && (bx - xy).abs() < 1e-8 && (by - yy).abs() < 1e-8);
    }

    #[test]
    fn folded_directions_are_not_seen() {
        // r - 0.3 r^3 turns back at r = 1.05; r = 1.7 would land at 0.226, in the middle of the image.
        let camera = PinholeRadtan::new(intrinsics(), [-0.3, 0.0, 0.0, 0.0, 0.0], PI).expect("sound");
        assert!(camera.max_angle_rad() < 1.06_f64.atan());
        assert_eq!(camera.project(&Point3::new(1.0, -1.7, 0.0)), None);
        // And no pixel beyond the largest image radius (0.703) unprojects.
        assert_eq!(camera.unproject(Pixel { u: 320.0 + 400.0 * 0.71, v: 240.0 }), None);
        assert!(camera.unproject(Pixel { u: 320.0 + 400.0 * 0.69, v: 240.0 }).is_some());
    }
}
