//! Fisheye cameras: what a lens with a known curve sees, with the instance in every pixel.
//!
//! A lens is round about its axis: a direction at the angle `a` from it falls at the radius `r(a)`. Real lenses are
//! described by one of three curves ([`Curve`]). The simulator never inverts a formula: it tabulates the curve once,
//! finely enough for 1e-7 rad, and reads the table both ways, so that nothing here can share a mistake with a robot's
//! camera models.
//!
//! The camera's axes are those of a body: x along the optical axis, y left, z up. Pixel centres lie at +0.5; `center_px`
//! and the curves are given as calibration tools write them, with the first pixel's centre at 0.

use crate::mesh::InstanceId;
use crate::motion::Motion;
use crate::panorama::PanoramaError;
use crate::render::{BLOCK, BoxInView, Eye, boxes_in_view, render_through};
use crate::world::{Snapshot, World};
use nalgebra::{Isometry3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use thiserror::Error;

/// From the angle to the radius.
#[derive(Debug, Clone, PartialEq)]
pub enum Curve {
    /// `r = a + k[0] a^3 + k[1] a^5 + k[2] a^7 + k[3] a^9`, times the focal length (Kannala and Brandt).
    OddPolynomial {
        /// Coefficients.
        k: [f64; 4],
    },
    /// `r = sin a/(alpha d + (1 - alpha)(xi + cos a))`, `d = |(sin a, xi + cos a)|`, times the focal length (double sphere).
    DoubleSphere {
        /// Distance of the spheres.
        xi: f64,
        /// Shift of the pinhole.
        alpha: f64,
    },
    /// The ray of the radius r, in pixels, goes `|c[0]| -+ ...` ahead for r to the side: `c[0] + c[1] r + c[2] r^2 + ...`
    /// with the sign that makes `c[0]` positive (Scaramuzza).
    Rays {
        /// Coefficients.
        c: Vec<f64>,
    },
}

/// Numbers of a fisheye.
#[derive(Debug, Clone, PartialEq)]
pub struct FisheyeConfig {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The curve.
    pub curve: Curve,
    /// Pixels per unit of the curve's radius, to the right and downward; 1 for [`Curve::Rays`].
    pub focal_px: [f64; 2],
    /// Share of the radius to the right that goes down, and the other way: a slanted sensor (usually 0).
    pub slant: [f64; 2],
    /// Column and row of the axis.
    pub center_px: [f64; 2],
    /// Angle from the axis beyond which the lens shows nothing.
    pub max_angle_rad: f64,
    /// Farther surfaces are black (60).
    pub max_range_m: f64,
}

/// Why there is no fisheye.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FisheyeError {
    /// A number is out of its range.
    #[error("a number of the fisheye's configuration is out of range")]
    Config,
    /// The radius does not grow with the angle up to `max_angle_rad`.
    #[error("the fisheye's radius does not grow up to its largest angle")]
    Curve,
}

/// A fisheye with its table and the direction of every pixel.
#[derive(Debug, Clone)]
pub struct Fisheye {
    config: FisheyeConfig,
    /// Radius and angle, both growing.
    table: Vec<(f64, f64)>,
    /// By row, a block wider and higher than the picture.
    directions: Vec<Option<Vector3<f32>>>,
}

/// A picture of a fisheye.
#[derive(Debug, Clone, PartialEq)]
pub struct FisheyeRecord {
    /// Time of the picture.
    pub stamp_ns: i64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major, three bytes a pixel; black outside the lens.
    pub rgb: Vec<u8>,
}

/// The truth of a picture, which must not reach a robot: instances column by column, 0 for the structure and nothing.
pub type FisheyeTruth = Vec<InstanceId>;

/// Takes a picture at `stamp_ns`.
pub fn photograph(
    world: &World,
    motion: &dyn Motion,
    body_from_camera: &Isometry3<f64>,
    fisheye: &Fisheye,
    stamp_ns: i64,
) -> Result<(FisheyeRecord, FisheyeTruth), PanoramaError> {
    let (from_ns, to_ns) = motion.span_ns();
    if stamp_ns < from_ns || stamp_ns > to_ns {
        return Err(PanoramaError::MotionUnknown { stamp_ns });
    }
    let state = motion.at(stamp_ns);
    if !state.is_finite() {
        return Err(PanoramaError::NotFinite);
    }
    let (rgb, instances) = fisheye.render(&world.at(stamp_ns), &(state.world_from_body * body_from_camera));
    let FisheyeConfig { width, height, .. } = fisheye.config;
    Ok((FisheyeRecord { stamp_ns, width, height, rgb }, instances))
}

impl Fisheye {
    /// Tabulates the curve and the directions.
    pub fn new(config: FisheyeConfig) -> Result<Fisheye, FisheyeError> {
        let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
        let good = (8..=8192).contains(&config.width)
            && (8..=8192).contains(&config.height)
            && config.focal_px.iter().all(|f| (1e-3..1e6).contains(f))
            && config.slant.iter().all(|s| s.abs() < 0.5)
            && finite(&config.center_px)
            && config.max_angle_rad > 0.0
            && config.max_angle_rad <= PI
            && config.max_range_m > 0.0
            && config.max_range_m < 1e5;
        if !good {
            return Err(FisheyeError::Config);
        }
        let table = tabulate(&config)?;
        let mut fisheye = Fisheye { config, table, directions: Vec::new() };
        let (wide, high) = (fisheye.stride(), fisheye.config.height as usize + BLOCK + 1);
        fisheye.directions = (0..wide * high)
            .map(|index| fisheye.direction_at((index % wide) as f64 + 0.5, (index / wide) as f64 + 0.5))
            .map(|direction| direction.map(|d| d.cast()))
            .collect();
        Ok(fisheye)
    }

    /// Its numbers.
    pub fn config(&self) -> &FisheyeConfig {
        &self.config
    }

    /// Colour, row-major, and instances, column-major, of what a camera at `world_from_camera` sees.
    pub fn render(&self, snapshot: &Snapshot<'_>, world_from_camera: &Isometry3<f64>) -> (Vec<u8>, FisheyeTruth) {
        let boxes = boxes_in_view(snapshot, world_from_camera, |low, high| self.box_in_view(low, high));
        self.render_with(snapshot, world_from_camera, BLOCK, boxes)
    }

    /// The plain text of [`Fisheye::render`]: one ray a pixel.
    pub fn render_every_pixel(
        &self,
        snapshot: &Snapshot<'_>,
        world_from_camera: &Isometry3<f64>,
    ) -> (Vec<u8>, FisheyeTruth) {
        self.render_with(snapshot, world_from_camera, 1, Vec::new())
    }

    fn render_with(
        &self,
        snapshot: &Snapshot<'_>,
        world_from_camera: &Isometry3<f64>,
        block: usize,
        boxes: Vec<BoxInView>,
    ) -> (Vec<u8>, FisheyeTruth) {
        let size = (self.config.width as usize, self.config.height as usize);
        let picture = render_through(self, size, snapshot, world_from_camera, self.config.max_range_m, block, boxes);
        (picture.rgb, picture.instances)
    }

    /// Direction of a picture coordinate in the camera frame; `None` outside the lens.
    pub fn direction_at(&self, u: f64, v: f64) -> Option<Vector3<f64>> {
        let FisheyeConfig { focal_px: [fx, fy], slant: [down_by_right, right_by_down], center_px: [cx, cy], .. } =
            self.config;
        // The inverse of u = fx right + right_by_down down, v = down_by_right right + fy down.
        let (du, dv) = (u - 0.5 - cx, v - 0.5 - cy);
        let det = fx * fy - right_by_down * down_by_right;
        let (right, down) = ((fy * du - right_by_down * dv) / det, (fx * dv - down_by_right * du) / det);
        let radius = right.hypot(down);
        let angle = look_up(&self.table, radius, |entry| entry.0, |entry| entry.1)?;
        let (sin, cos) = angle.sin_cos();
        let (right, down) = if radius > 0.0 { (right / radius, down / radius) } else { (0.0, 0.0) };
        Some(Vector3::new(cos, -sin * right, -sin * down))
    }

    /// Picture coordinate of a direction in the camera frame, also off the picture; angles beyond the lens count as its
    /// edge.
    fn pixel_near(&self, direction: &Vector3<f64>) -> (f64, f64) {
        let (right, down) = (-direction.y, -direction.z);
        let side = right.hypot(down);
        let angle = side.atan2(direction.x).min(self.table[self.table.len() - 1].1);
        let radius = look_up(&self.table, angle, |entry| entry.1, |entry| entry.0).unwrap_or(0.0);
        let (right, down) = if side > 0.0 { (right / side * radius, down / side * radius) } else { (0.0, 0.0) };
        let FisheyeConfig { focal_px: [fx, fy], slant: [down_by_right, right_by_down], center_px: [cx, cy], .. } =
            self.config;
        (fx * right + right_by_down * down + cx + 0.5, down_by_right * right + fy * down + cy + 0.5)
    }

    /// A rectangle of the picture around a box given in the camera frame.
    fn box_in_view(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> Option<BoxInView> {
        let (width, height) = (self.config.width as usize, self.config.height as usize);
        let gap = |k: usize| low[k].max(-high[k]).max(0.0);
        let nearest = gap(0).hypot(gap(1)).hypot(gap(2)) as f32;
        let seen = |columns, rows, size_px| {
            let finest = BoxInView::finest_of(size_px);
            Some(BoxInView { instance: 0, nearest, finest, columns, rows })
        };
        let everywhere = || seen((0, width), (0, height), width.max(height) as f64);
        // The cone around the ball around the box.
        let (middle, reach) = ((low + high) / 2.0, (high - low).norm() / 2.0);
        let distance = middle.norm();
        if distance <= reach {
            return everywhere();
        }
        let half_view = (reach / distance).asin();
        let off_axis = middle.y.hypot(middle.z).atan2(middle.x);
        if off_axis - half_view > self.config.max_angle_rad {
            return None;
        }
        if off_axis + half_view >= PI || half_view >= FRAC_PI_2 {
            return everywhere();
        }
        let along = middle / distance;
        let across = along.cross(&if along.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
        let other = along.cross(&across);
        const POINTS: usize = 24;
        let (sin, cos) = half_view.sin_cos();
        let (mut first, mut last) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in 0..POINTS {
            let (s, c) = (TAU * point as f64 / POINTS as f64).sin_cos();
            let (u, v) = self.pixel_near(&(along * cos + (across * c + other * s) * sin));
            first = [first[0].min(u), first[1].min(v)];
            last = [last[0].max(u), last[1].max(v)];
        }
        // Between the points the outline bulges by less than a twentieth.
        let size = (last[0] - first[0]).max(last[1] - first[1]);
        let margin = 2.0 + 0.05 * size;
        let range = |k: usize, end: usize| {
            let (from, to) = (first[k] - margin, last[k] + margin);
            (to >= 0.0 && from <= end as f64).then(|| (from.max(0.0) as usize, (to.ceil() as usize).min(end)))
        };
        seen(range(0, width)?, range(1, height)?, size)
    }

    fn stride(&self) -> usize {
        self.config.width as usize + BLOCK + 1
    }
}

impl Eye for Fisheye {
    fn direction(&self, x: usize, y: usize) -> Option<Vector3<f32>> {
        self.directions[y * self.stride() + x]
    }
}

/// Radius and angle at even steps of one of them.
fn tabulate(config: &FisheyeConfig) -> Result<Vec<(f64, f64)>, FisheyeError> {
    /// Linear between entries: 2 rad/8192 squared over 8 is 7e-9 rad for a curve of curvature 1.
    const STEPS: usize = 8192;
    let end = config.max_angle_rad;
    let angles = (0..=STEPS).map(|step| end * step as f64 / STEPS as f64);
    let table: Vec<(f64, f64)> = match &config.curve {
        Curve::OddPolynomial { k } => {
            angles.map(|a| (a + k[0] * a.powi(3) + k[1] * a.powi(5) + k[2] * a.powi(7) + k[3] * a.powi(9), a)).collect()
        }
        Curve::DoubleSphere { xi, alpha } => angles
            .map(|a| {
                let (side, ahead) = (a.sin(), xi + a.cos());
                (side / (alpha * side.hypot(ahead) + (1.0 - alpha) * ahead), a)
            })
            .collect(),
        Curve::Rays { c } => {
            let farthest = f64::from(config.width).hypot(f64::from(config.height));
            let sign = c.first().map_or(1.0, |c| c.signum());
            let ahead = |r: f64| sign * c.iter().rev().fold(0.0, |sum, c| sum * r + c);
            let radii = (0..=STEPS).map(|step| farthest * step as f64 / STEPS as f64);
            radii.map(|r| (r, r.atan2(ahead(r)))).take_while(|(_, angle)| *angle <= end).collect()
        }
    };
    let grows = table.windows(2).all(|pair| pair[0].0 < pair[1].0 && pair[0].1 < pair[1].1);
    let is_sound = table.len() > 1 && grows && table.iter().all(|(r, a)| r.is_finite() && a.is_finite());
    if is_sound { Ok(table) } else { Err(FisheyeError::Curve) }
}

/// The value at a key between the entries of a table; `None` beyond its last key.
fn look_up(
    table: &[(f64, f64)],
    key: f64,
    key_of: impl Fn(&(f64, f64)) -> f64,
    value_of: impl Fn(&(f64, f64)) -> f64,
) -> Option<f64> {
    let after = table.partition_point(|entry| key_of(entry) < key);
    if after == 0 {
        return table.first().map(&value_of);
    }
    let (low, high) = (table.get(after - 1)?, table.get(after)?);
    let share = (key - key_of(low)) / (key_of(high) - key_of(low));
    Some(value_of(low) + share * (value_of(high) - value_of(low)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(curve: Curve) -> FisheyeConfig {
        FisheyeConfig {
            width: 200,
            height: 160,
            curve,
            focal_px: [50.0, 51.0],
            slant: [0.0, 0.0],
            center_px: [99.5, 79.5],
            max_angle_rad: 1.6,
            max_range_m: 60.0,
        }
    }

    #[test]
    fn right_in_the_picture_is_right_of_the_camera() {
        let fisheye = Fisheye::new(config(Curve::OddPolynomial { k: [0.0; 4] })).expect("sound");
        let close = |a: Vector3<f64>, b: Vector3<f64>| assert!((a - b).norm() < 1e-7, "{a} {b}");
        close(fisheye.direction_at(100.0, 80.0).expect("axis"), Vector3::x());
        close(fisheye.direction_at(150.0, 80.0).expect("one radian"), Vector3::new(1_f64.cos(), -1_f64.sin(), 0.0));
        close(fisheye.direction_at(100.0, 131.0).expect("one radian"), Vector3::new(1_f64.cos(), 0.0, -1_f64.sin()));
        assert_eq!(fisheye.direction_at(100.0 + 50.0 * 1.7, 80.0), None);
    }

    #[test]
    fn there_and_back() {
        let curves = [
            Curve::OddPolynomial { k: [0.01, -0.002, 0.0, 0.0] },
            Curve::DoubleSphere { xi: -0.2, alpha: 0.6 },
            Curve::Rays { c: vec![-60.0, 0.0, 0.004] },
        ];
        for curve in curves {
            let focal_px = if matches!(curve, Curve::Rays { .. }) { [1.0, 1.0] } else { [50.0, 51.0] };
            let fisheye =
                Fisheye::new(FisheyeConfig { focal_px, slant: [0.01, -0.02], ..config(curve) }).expect("sound");
            for (u, v) in [(100.0, 80.0), (20.3, 90.1), (130.0, 22.0), (99.0, 140.0)] {
                let direction = fisheye.direction_at(u, v).expect("inside");
                assert!((direction.norm() - 1.0).abs() < 1e-12);
                let (a, b) = fisheye.pixel_near(&direction);
                assert!((a - u).abs() < 1e-4 && (b - v).abs() < 1e-4, "{u} {v} {a} {b}");
            }
        }
    }

    #[test]
    fn lenses_that_fold_and_bad_numbers_are_refused() {
        let folding = config(Curve::OddPolynomial { k: [-0.3, 0.0, 0.0, 0.0] });
        assert_eq!(Fisheye::new(folding).err(), Some(FisheyeError::Curve));
        let nothing = config(Curve::Rays { c: vec![] });
        assert_eq!(Fisheye::new(nothing).err(), Some(FisheyeError::Curve));
        let blind = FisheyeConfig { max_angle_rad: f64::NAN, ..config(Curve::OddPolynomial { k: [0.0; 4] }) };
        assert_eq!(Fisheye::new(blind).err(), Some(FisheyeError::Config));
    }
}
