//! The fast form of [`Equirectangular::project`]: single precision, for hundreds of thousands of points an image.
//!
//! The arc tangent is a polynomial with an error below 1e-6 rad, that is 0.001 pixels of a 1920-pixel panorama.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::Equirectangular;
use crate::vector_loops::widest;

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

    /// Projects up to [`BLOCK`] points; what the rest of `pixels` holds afterwards is no pixel of theirs.
    ///
    /// Coordinate by coordinate, so that each loop is one over plain arrays and becomes a vector loop.
    pub(crate) fn project_block(&self, points: &[Point3<f32>], view: &View, pixels: &mut PixelBlock) {
        widest(
            #[inline(always)]
            || self.project_each(points, view, pixels),
        );
    }

    #[inline(always)]
    fn project_each(&self, points: &[Point3<f32>], view: &View, pixels: &mut PixelBlock) {
        let (mut x, mut y, mut z) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
        for (index, point) in points.iter().enumerate().take(BLOCK) {
            (x[index], y[index], z[index]) = (point.x, point.y, point.z);
        }
        if let View::FromWorld { camera_in_world, camera_from_world } = view {
            for index in 0..BLOCK {
                let p = Point3::new(x[index], y[index], z[index]);
                let p = turned(camera_from_world, &(p.coords - camera_in_world));
                (x[index], y[index], z[index]) = (p.x, p.y, p.z);
            }
        }
        for index in 0..BLOCK {
            (pixels.u[index], pixels.v[index], pixels.range_m[index]) = self.project(x[index], y[index], z[index]);
        }
    }

    /// (u, v, range); u in [0, W). All zero if the point is not in the image (or NaN, or the origin).
    ///
    /// Selections instead of branches: where a point falls cannot be predicted.
    #[inline(always)]
    fn project(&self, x: f32, y: f32, z: f32) -> (f32, f32, f32) {
        let horizontal_sq = x * x + y * y;
        let range = (horizontal_sq + z * z).sqrt();
        // OmniVLN Eq. 2
        let theta = atan2(y, x);
        let phi = atan2(z, horizontal_sq.sqrt());
        // OmniVLN Eq. 3; theta = -pi is the seam, pi by rounding falls a trifle before zero.
        let u = 0.5 * self.width - theta * self.columns_per_rad;
        let u = if u >= self.width { u - self.width } else { u };
        let u = if u > 0.0 { u } else { 0.0 };
        let v = (self.phi_top_rad - phi) * self.rows_per_rad;
        let is_inside = (v >= 0.0) & (v < self.height) & (range > 0.0) & (range < f32::INFINITY);
        let keep = |number: f32| if is_inside { number } else { 0.0 };
        (keep(u), keep(v), keep(range))
    }
}

/// In which frame the points are given.
#[derive(Debug, Clone, Copy)]
pub(crate) enum View {
    /// That of the camera.
    Camera,
    /// Another one. The camera's position is taken off first, so that single precision suffices far from its origin.
    FromWorld { camera_in_world: Vector3<f32>, camera_from_world: Matrix3<f32> },
}

impl View {
    pub(crate) fn from_world(world_from_camera: &Isometry3<f64>) -> View {
        View::FromWorld {
            camera_in_world: world_from_camera.translation.vector.cast(),
            camera_from_world: world_from_camera.rotation.inverse().to_rotation_matrix().into_inner().cast(),
        }
    }

    /// A point in the camera's frame.
    pub(crate) fn in_camera(&self, point: &Point3<f32>) -> Point3<f32> {
        match self {
            View::Camera => *point,
            View::FromWorld { camera_in_world, camera_from_world } => {
                turned(camera_from_world, &(point.coords - camera_in_world))
            }
        }
    }
}

/// Written out, so that the loop over a block and the single point round alike.
#[inline(always)]
fn turned(m: &Matrix3<f32>, v: &Vector3<f32>) -> Point3<f32> {
    let row = |k: usize| m[(k, 0)] * v.x + m[(k, 1)] * v.y + m[(k, 2)] * v.z;
    Point3::new(row(0), row(1), row(2))
}

/// Points that are projected at a time: their coordinates stay in the first cache.
pub(crate) const BLOCK: usize = 256;

/// Where the points of a block fall; a range of zero means nowhere.
#[derive(Debug, Clone)]
pub(crate) struct PixelBlock {
    pub(crate) u: [f32; BLOCK],
    pub(crate) v: [f32; BLOCK],
    pub(crate) range_m: [f32; BLOCK],
}

impl Default for PixelBlock {
    fn default() -> Self {
        PixelBlock { u: [0.0; BLOCK], v: [0.0; BLOCK], range_m: [0.0; BLOCK] }
    }
}

/// atan2 by a polynomial of atan on [0, 1]; zero for (0, 0).
#[inline(always)]
fn atan2(y: f32, x: f32) -> f32 {
    let (across, along) = (y.abs(), x.abs());
    let is_steep = across > along;
    let (short, long) = if is_steep { (along, across) } else { (across, along) };
    let ratio = short / if long > f32::MIN_POSITIVE { long } else { f32::MIN_POSITIVE };
    let s = ratio * ratio;
    // Abramowitz and Stegun 4.4.49: |error| <= 2e-8.
    let mut sum = 0.002_866_225_7;
    sum = sum * s - 0.016_165_737;
    sum = sum * s + 0.042_909_613;
    sum = sum * s - 0.075_289_64;
    sum = sum * s + 0.106_562_64;
    sum = sum * s - 0.142_089;
    sum = sum * s + 0.199_935_51;
    sum = sum * s - 0.333_331_45;
    sum = sum * s + 1.0;
    let first = sum * ratio;
    let quarter = if is_steep { std::f32::consts::FRAC_PI_2 - first } else { first };
    let half = if x < 0.0 { std::f32::consts::PI - quarter } else { quarter };
    half.copysign(y)
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
            let (u, v, range) = fast.project(single.x, single.y, single.z);
            let Some(pixel) = camera.project(&single.cast()) else {
                assert!(range == 0.0 || !(0.01..=639.99).contains(&v));
                continue;
            };
            if range == 0.0 {
                assert!(!(0.01..=639.99).contains(&pixel.v));
                continue;
            }
            let across = (f64::from(u) - pixel.u).abs();
            assert!(across.min(1920.0 - across) < PIXEL_TOL, "{u} {pixel:?}");
            assert!((f64::from(v) - pixel.v).abs() < PIXEL_TOL, "{v} {pixel:?}");
        }
        let nothing = [Point3::origin(), Point3::new(f32::NAN, 1.0, 0.0), Point3::new(f32::INFINITY, 1.0, 0.0)];
        assert!(nothing.iter().all(|point| fast.project(point.x, point.y, point.z).2 == 0.0));
        assert_eq!(fast.project(-1.0, -1e-12, 0.0).0, 0.0);
        assert_eq!(fast.project(-1.0, 0.0, 0.0).0, 0.0);
        let whole = FastProjection::new(&Equirectangular {
            phi_top_rad: std::f64::consts::FRAC_PI_2,
            phi_bottom_rad: -std::f64::consts::FRAC_PI_2,
            ..camera
        });
        assert_eq!(whole.project(0.0, 0.0, 2.0).0, 960.0);
    }
}
