//! The fast form of [`Equirectangular::project`]: single precision, for hundreds of thousands of points an image.
//!
//! The arc tangent is a polynomial with an error below 1e-6 rad, that is 0.001 pixels of a 1920-pixel panorama.

use nalgebra::Point3;

use crate::Equirectangular;

/// The camera's numbers, prepared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FastProjection {
    width: f32,
    height: f32,
    columns_per_rad: f32,
    rows_per_rad: f32,
    phi_top_rad: f32,
}

impl FastProjection {
    pub(crate) fn new(camera: &Equirectangular) -> FastProjection {
        FastProjection {
            width: camera.width_px as f32,
            height: camera.height_px as f32,
            columns_per_rad: (1.0 / camera.column_angle_rad()) as f32,
            rows_per_rad: (1.0 / camera.row_angle_rad()) as f32,
            phi_top_rad: camera.phi_top_rad as f32,
        }
    }

    /// (u, v, range); u in [0, W). The range is zero if the point is not in the image (or NaN, or the origin).
    pub(crate) fn project(&self, point: &Point3<f32>) -> (f32, f32, f32) {
        const OUTSIDE: (f32, f32, f32) = (0.0, 0.0, 0.0);
        let horizontal_sq = point.x * point.x + point.y * point.y;
        let range = (horizontal_sq + point.z * point.z).sqrt();
        if !(range > 0.0 && range < f32::INFINITY) {
            return OUTSIDE;
        }
        // OmniVLN Eq. 2
        let theta = if horizontal_sq == 0.0 {
            0.0
        } else {
            atan2(point.y, point.x)
        };
        let phi = atan2(point.z, horizontal_sq.sqrt());
        // OmniVLN Eq. 3
        let u = 0.5 * self.width - theta * self.columns_per_rad;
        let v = (self.phi_top_rad - phi) * self.rows_per_rad;
        if !(v >= 0.0 && v < self.height) {
            return OUTSIDE;
        }
        let wrapped = if u < 0.0 {
            u + self.width
        } else if u >= self.width {
            u - self.width
        } else {
            u
        };
        // Adding the width to a tiny negative number may round up to the width itself.
        (if wrapped < self.width { wrapped } else { 0.0 }, v, range)
    }
}

/// atan2 by a minimax polynomial of atan on [0, 1] (Hastings' form with eight coefficients).
fn atan2(y: f32, x: f32) -> f32 {
    let (short, long) = if y.abs() < x.abs() {
        (y.abs(), x.abs())
    } else {
        (x.abs(), y.abs())
    };
    if long == 0.0 {
        return 0.0;
    }
    let ratio = short / long;
    let s = ratio * ratio;
    // Abramowitz and Stegun 4.4.49: |error| <= 2e-8.
    let series = ((((((((0.002_866_225_7 * s - 0.016_165_737) * s + 0.042_909_613) * s
        - 0.075_289_64)
        * s
        + 0.106_562_64)
        * s
        - 0.142_088_99)
        * s
        + 0.199_935_51)
        * s
        - 0.333_331_45)
        * s)
        * ratio
        + ratio;
    let quarter = if y.abs() < x.abs() {
        series
    } else {
        std::f32::consts::FRAC_PI_2 - series
    };
    let half = if x < 0.0 {
        std::f32::consts::PI - quarter
    } else {
        quarter
    };
    if y < 0.0 { -half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Single precision in u up to 1920: one unit in the last place is 1.2e-4 pixels.
    const PIXEL_TOL: f64 = 2e-3;

    #[test]
    fn fast_equals_plain() {
        let camera = Equirectangular::default();
        let fast = FastProjection::new(&camera);
        for step in 0..40_000 {
            let (a, b) = (step as f64 * 0.618_034, step as f64 * 0.003);
            let direction = nalgebra::Vector3::new(a.cos(), a.sin(), (b.sin()) * 1.6);
            let point = Point3::from(direction * (0.5 + 10.0 * (b * 1.7).cos().abs()));
            let single = point.cast::<f32>();
            let (u, v, range) = fast.project(&single);
            let Some(pixel) = camera.project(&single.cast()) else {
                assert!(range == 0.0 || v < 0.01 || v > 639.99);
                continue;
            };
            if range == 0.0 {
                assert!(pixel.v < 0.01 || pixel.v > 639.99);
                continue;
            }
            let across = (f64::from(u) - pixel.u).abs();
            assert!(across.min(1920.0 - across) < PIXEL_TOL, "{u} {pixel:?}");
            assert!((f64::from(v) - pixel.v).abs() < PIXEL_TOL, "{v} {pixel:?}");
        }
        let nothing = [
            Point3::origin(),
            Point3::new(f32::NAN, 1.0, 0.0),
            Point3::new(f32::INFINITY, 1.0, 0.0),
        ];
        assert!(nothing.iter().all(|point| fast.project(point).2 == 0.0));
        assert_eq!(fast.project(&Point3::new(-1.0, -1e-12, 0.0)).0, 0.0);
    }
}
