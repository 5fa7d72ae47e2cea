//! Several lenses to one panorama.
//!
//! For each pixel of the panorama and each lens i:
//! ```text
//! P = distance * direction of the pixel                       a sphere about the panorama's centre
//! pixel_i = project_i(lens_i_from_panorama P)
//! margin_i = angle from there to the edge of the lens, or to the border of its image
//! weight_i = S(margin_i/feather) S(1 - (best margin - margin_i)/feather),   S(x) = x^2 (3 - 2x) on [0, 1]
//! colour = sum of weight_i gain_i image_i(pixel_i) / sum of weight_i
//! ```
//! The first factor lets a lens fade out towards its own edge; the second keeps the band in which two lenses are mixed
//! `feather` wide however much they overlap, because mixed pictures of near things are ghosts. On things nearer or
//! farther than `distance` the lenses disagree by their parallax, `offset |1/range - 1/distance|`, and only in that band.
//!
//! [`stitch_plainly`] is this text, pixel by pixel. [`Stitcher`] has the geometry in a table (`stitch/table.rs`) and does
//! only the mixing. Gains come from what the lenses see in common (`stitch/gains.rs`).
//!
//! Masks and labels need no other mathematics than those of a panorama: the segmenter sees the stitched image, and
//! [`crate::observe_panorama`] works with [`StitchConfig::panorama`] at the panorama's pose. Where no lens looks, the
//! image is black.

use nalgebra::{Isometry3, Point3};
use thiserror::Error;

use crate::camera::Camera;
use crate::{CameraError, Equirectangular, Pixel, RgbImage};

mod gains;
mod lanes;
mod table;

pub use gains::Gain;
pub use table::{LensPixel, Stitcher};

/// One camera of several.
#[derive(Debug, Clone, PartialEq)]
pub struct Lens {
    /// Its model.
    pub camera: Camera,
    /// Where it sits, seen from the panorama's centre.
    pub panorama_from_lens: Isometry3<f64>,
}

/// What the panorama shall be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StitchConfig {
    /// Its geometry. Default 1920 x 640, 60 degrees up and down.
    pub panorama: Equirectangular,
    /// Things at this distance from the centre join without a step, default 4 m: the usual wall of a room.
    pub distance_m: f64,
    /// Width of the band in which lenses fade, default 0.1 rad.
    pub feather_rad: f64,
}

impl Default for StitchConfig {
    fn default() -> Self {
        StitchConfig { panorama: Equirectangular::default(), distance_m: 4.0, feather_rad: 0.1 }
    }
}

impl StitchConfig {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`StitchError::Panorama`] or [`StitchError::Parameter`] with the first number that is out of its range.
    pub fn validate(&self) -> Result<(), StitchError> {
        self.panorama.validate()?;
        let check = |name, value: f64, low: f64, high: f64, accepts| match (low..=high).contains(&value) {
            true => Ok(()),
            false => Err(StitchError::Parameter { name, value, accepts }),
        };
        check("distance_m", self.distance_m, 0.1, 1e6, "a distance from 0.1 to 1e6 m")?;
        check("feather_rad", self.feather_rad, 1e-4, 3.2, "an angle from 0.0001 to 3.2 rad")
    }
}

/// Why there is no panorama.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum StitchError {
    /// There is no lens, or more than 255.
    #[error("{count} lenses; 1 to 255 can be stitched")]
    LensCount {
        /// Number of lenses.
        count: usize,
    },
    /// The panorama's geometry is not sound.
    #[error("the panorama: {0}")]
    Panorama(#[from] CameraError),
    /// A number of the configuration is out of its range.
    #[error("{name} = {value}: must be {accepts}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The range in words.
        accepts: &'static str,
    },
    /// The pose of a lens is not finite.
    #[error("the pose of lens {lens} is not finite")]
    Pose {
        /// Its index.
        lens: usize,
    },
    /// The image of a lens is smaller than 3 x 3 pixels or larger than 32768 x 32768.
    #[error("lens {lens} has {width_px} x {height_px} pixels; 3 x 3 up to 32768 x 32768 can be stitched")]
    LensSize {
        /// Its index.
        lens: usize,
        /// Width.
        width_px: u32,
        /// Height.
        height_px: u32,
    },
    /// There are more or fewer images or gains than lenses.
    #[error("{given} {what} for {lenses} lenses")]
    Count {
        /// `images` or `gains`.
        what: &'static str,
        /// Number given.
        given: usize,
        /// Number of lenses.
        lenses: usize,
    },
    /// An image has another size than its lens, or fewer bytes than its size says.
    #[error(
        "image {lens} has {width} x {height} pixels in {bytes} bytes; its lens has {lens_width_px} x {lens_height_px}"
    )]
    Image {
        /// Its index.
        lens: usize,
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
        /// Bytes of the image.
        bytes: usize,
        /// Width of the lens.
        lens_width_px: u32,
        /// Height of the lens.
        lens_height_px: u32,
    },
}

/// The plain form: the formulas above for every pixel. The fast form is tested against it.
///
/// # Errors
/// [`StitchError`] for unsound numbers, or images or gains that do not belong to the lenses.
pub fn stitch_plainly(
    lenses: &[Lens],
    config: &StitchConfig,
    images: &[RgbImage],
    gains: &[Gain],
) -> Result<RgbImage, StitchError> {
    check_lenses(lenses, config)?;
    let sizes: Vec<[u32; 2]> = lenses.iter().map(size).collect();
    check_images(&sizes, images)?;
    check_count("gains", gains.len(), lenses.len())?;
    let eyes: Vec<Eye> = lenses.iter().map(Eye::new).collect();
    let (width, height) = (config.panorama.width_px, config.panorama.height_px);
    let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
    for row in 0..height {
        for column in 0..width {
            let looks = looks_at(&eyes, config, column, row);
            let value_of = |channel: usize| -> f64 {
                looks
                    .iter()
                    .map(|look| {
                        let value = bilinear(&images[look.lens], &look.pixel, channel);
                        look.weight * (value * f64::from(gains[look.lens][channel])).min(255.0)
                    })
                    .sum()
            };
            rgb.extend([0, 1, 2].map(|channel| value_of(channel).round() as u8));
        }
    }
    Ok(RgbImage { width, height, rgb })
}

/// One lens's part in a pixel of the panorama.
struct Look {
    lens: usize,
    pixel: Pixel,
    /// The weights of a pixel add up to 1.
    weight: f64,
}

/// A lens with what is needed of it for every pixel.
struct Eye<'a> {
    camera: &'a Camera,
    lens_from_panorama: Isometry3<f64>,
    max_angle_rad: f64,
    size_px: [f64; 2],
    rad_per_px: f64,
}

impl<'a> Eye<'a> {
    fn new(lens: &'a Lens) -> Eye<'a> {
        let domain = lens.camera.domain();
        let size_px = [f64::from(domain.width_px), f64::from(domain.height_px)];
        // Scale of the image at its axis, for distances to its border; without an axis in the image a rough one will do.
        const STEP_RAD: f64 = 1e-3;
        let at = |y: f64| lens.camera.project(&Point3::new(1.0, y, 0.0));
        let rad_per_px = match (at(0.0), at(STEP_RAD)) {
            (Some(a), Some(b)) => STEP_RAD / (a.u - b.u).hypot(a.v - b.v),
            _ => 2.0 * domain.max_angle_rad / size_px[0].min(size_px[1]),
        };
        Eye {
            camera: &lens.camera,
            lens_from_panorama: lens.panorama_from_lens.inverse(),
            max_angle_rad: domain.max_angle_rad,
            size_px,
            rad_per_px,
        }
    }

    /// Where a point of the panorama's frame appears, and how far that is from the edge of what the lens sees.
    fn look(&self, point_in_panorama: &Point3<f64>) -> Option<(Pixel, f64)> {
        let point = self.lens_from_panorama * point_in_panorama;
        let pixel = self.camera.project(&point)?;
        let to_edge_rad = match self.camera {
            Camera::Equirectangular(_) => f64::INFINITY, // round: no edge at the sides
            _ => self.max_angle_rad - point.y.hypot(point.z).atan2(point.x),
        };
        let [width, height] = self.size_px;
        let to_border_px = match self.camera {
            Camera::Equirectangular(_) => pixel.v.min(height - pixel.v),
            _ => pixel.u.min(width - pixel.u).min(pixel.v).min(height - pixel.v),
        };
        Some((pixel, to_edge_rad.min(to_border_px * self.rad_per_px)))
    }
}

/// The lenses that see a pixel of the panorama, in their order.
fn looks_at(eyes: &[Eye], config: &StitchConfig, column: u32, row: u32) -> Vec<Look> {
    let direction = config.panorama.unproject(f64::from(column) + 0.5, f64::from(row) + 0.5);
    let point = Point3::from(direction.into_inner() * config.distance_m);
    let seen: Vec<(usize, Pixel, f64)> = eyes
        .iter()
        .enumerate()
        .filter_map(|(lens, eye)| eye.look(&point).map(|(pixel, margin)| (lens, pixel, margin)))
        .collect();
    let best = seen.iter().map(|(_, _, margin)| *margin).fold(0.0, f64::max);
    let weight = |margin: f64| {
        let behind = if margin < best { (best - margin) / config.feather_rad } else { 0.0 };
        smoothstep(margin / config.feather_rad) * smoothstep(1.0 - behind)
    };
    let sum: f64 = seen.iter().map(|(_, _, margin)| weight(*margin)).sum();
    if sum == 0.0 {
        return Vec::new();
    }
    seen.into_iter()
        .map(|(lens, pixel, margin)| Look { lens, pixel, weight: weight(margin) / sum })
        .filter(|look| look.weight > 0.0)
        .collect()
}

fn smoothstep(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// One channel of an image between its pixel centres; at the border the last pixel goes on.
fn bilinear(image: &RgbImage, pixel: &Pixel, channel: usize) -> f64 {
    let axis = |position: f64, size: u32| {
        let last = f64::from(size - 1);
        let from_centre = (position - 0.5).clamp(0.0, last);
        let low = from_centre.floor().min((last - 1.0).max(0.0));
        (low as usize, from_centre - low)
    };
    let ((x, fx), (y, fy)) = (axis(pixel.u, image.width), axis(pixel.v, image.height));
    let at = |x: usize, y: usize| f64::from(image.rgb[3 * (y * image.width as usize + x) + channel]);
    let row = |y: usize| at(x, y) * (1.0 - fx) + at(x + 1, y) * fx;
    row(y) * (1.0 - fy) + row(y + 1) * fy
}

fn size(lens: &Lens) -> [u32; 2] {
    let domain = lens.camera.domain();
    [domain.width_px, domain.height_px]
}

fn check_lenses(lenses: &[Lens], config: &StitchConfig) -> Result<(), StitchError> {
    config.validate()?;
    if lenses.is_empty() || lenses.len() > 255 {
        return Err(StitchError::LensCount { count: lenses.len() });
    }
    for (index, lens) in lenses.iter().enumerate() {
        if !lens.panorama_from_lens.to_homogeneous().iter().all(|x| x.is_finite()) {
            return Err(StitchError::Pose { lens: index });
        }
        let [width_px, height_px] = size(lens);
        if !(3..=32768).contains(&width_px) || !(3..=32768).contains(&height_px) {
            return Err(StitchError::LensSize { lens: index, width_px, height_px });
        }
    }
    Ok(())
}

fn check_images(sizes: &[[u32; 2]], images: &[RgbImage]) -> Result<(), StitchError> {
    check_count("images", images.len(), sizes.len())?;
    for (lens, (image, &[lens_width_px, lens_height_px])) in images.iter().zip(sizes).enumerate() {
        let bytes = image.rgb.len();
        let is_same = (image.width, image.height) == (lens_width_px, lens_height_px);
        if !is_same || bytes != 3 * lens_width_px as usize * lens_height_px as usize {
            let (width, height) = (image.width, image.height);
            return Err(StitchError::Image { lens, width, height, bytes, lens_width_px, lens_height_px });
        }
    }
    Ok(())
}

fn check_count(what: &'static str, given: usize, lenses: usize) -> Result<(), StitchError> {
    if given == lenses { Ok(()) } else { Err(StitchError::Count { what, given, lenses }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Intrinsics, KannalaBrandt};
    use nalgebra::Vector3;
    use std::f64::consts::PI;

    fn lens(yaw_rad: f64, half_view_rad: f64) -> Lens {
        let intrinsics =
            Intrinsics { width_px: 200, height_px: 200, fx_px: 55.0, fy_px: 55.0, cx_px: 99.5, cy_px: 99.5 };
        Lens {
            camera: Camera::KannalaBrandt(KannalaBrandt::new(intrinsics, [0.0; 4], half_view_rad).expect("sound")),
            panorama_from_lens: Isometry3::rotation(Vector3::z() * yaw_rad),
        }
    }

    fn small() -> StitchConfig {
        let panorama = Equirectangular { width_px: 240, height_px: 80, ..Equirectangular::default() };
        StitchConfig { panorama, ..StitchConfig::default() }
    }

    fn grey(value: u8) -> RgbImage {
        RgbImage { width: 200, height: 200, rgb: vec![value; 3 * 200 * 200] }
    }

    #[test]
    fn each_lens_fills_its_side_and_between_them_they_fade() {
        // Views of 190 degrees to the left and to the right; the panorama's middle is between them.
        let lenses = [lens(0.5 * PI, 95_f64.to_radians()), lens(-0.5 * PI, 95_f64.to_radians())];
        let gains = [[1.0; 3]; 2];
        let panorama = stitch_plainly(&lenses, &small(), &[grey(50), grey(150)], &gains).expect("sound");
        let at = |column: u32| panorama.at(column, 40).expect("inside")[0];
        assert_eq!((at(60), at(180)), (50, 150)); // straight left, straight right
        let ahead = [at(119), at(120)];
        assert!(ahead[0] < 100 && ahead[1] > 100 && ahead[0] > 80 && ahead[1] < 120, "{ahead:?}");
        assert!((100..140).all(|column| at(column) <= at(column + 1)), "rising from one side to the other");
        // The band is 0.1 rad wide, 3.8 columns: beyond 3 columns nothing is mixed.
        assert_eq!((at(116), at(123)), (50, 150));
    }

    #[test]
    fn where_no_lens_looks_it_is_black() {
        let panorama = stitch_plainly(&[lens(0.0, 1.0)], &small(), &[grey(77)], &[[1.0; 3]]).expect("sound");
        assert_eq!(panorama.at(120, 40), Some([77; 3]));
        assert_eq!(panorama.at(0, 40), Some([0; 3]));
        assert_eq!(panorama.at(170, 40), Some([0; 3])); // 75 degrees to the right
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let lenses = [lens(0.0, 1.0)];
        let run = |config: &StitchConfig, images: &[RgbImage], gains: &[Gain]| {
            stitch_plainly(&lenses, config, images, gains).expect_err("unsound")
        };
        let one = [[1.0; 3]];
        assert!(matches!(run(&small(), &[], &one), StitchError::Count { what: "images", .. }));
        assert!(matches!(run(&small(), &[grey(1)], &[]), StitchError::Count { what: "gains", .. }));
        let mut short = grey(1);
        short.rgb.pop();
        assert!(matches!(run(&small(), &[short], &one), StitchError::Image { lens: 0, .. }));
        let near = StitchConfig { distance_m: f64::NAN, ..small() };
        assert!(matches!(run(&near, &[grey(1)], &one), StitchError::Parameter { name: "distance_m", .. }));
        assert!(matches!(stitch_plainly(&[], &small(), &[], &[]), Err(StitchError::LensCount { count: 0 })));
        let mut lost = lens(0.0, 1.0);
        lost.panorama_from_lens.translation.vector.x = f64::NAN;
        let refused = stitch_plainly(&[lost], &small(), &[grey(1)], &one);
        assert!(matches!(refused, Err(StitchError::Pose { lens: 0 })));
    }
}
