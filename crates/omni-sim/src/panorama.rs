//! The panoramic camera: colour picture and masks at one time.

use crate::equirect::Equirect;
use crate::motion::Motion;
use crate::render::{Rendering, render};
use crate::segmenter::{MaskRecord, SegmenterConfig, SegmenterConfigError, segment};
use crate::world::World;
use nalgebra::Isometry3;
use thiserror::Error;

/// Numbers of the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct PanoramaConfig {
    /// Columns over the full circle (1920).
    pub width: u32,
    /// Rows (640).
    pub height: u32,
    /// Elevation of the upper border (+60 degrees: square pixels at 1920 x 640).
    pub phi_top_rad: f64,
    /// Elevation of the lower border (-60 degrees).
    pub phi_bottom_rad: f64,
    /// Pictures a second (2).
    pub rate_hz: f64,
    /// Farther surfaces are black (60).
    pub max_range_m: f64,
}

impl Default for PanoramaConfig {
    fn default() -> Self {
        PanoramaConfig {
            width: 1920,
            height: 640,
            phi_top_rad: 60_f64.to_radians(),
            phi_bottom_rad: -60_f64.to_radians(),
            rate_hz: 2.0,
            max_range_m: 60.0,
        }
    }
}

impl PanoramaConfig {
    /// Checks every number.
    pub fn validate(&self) -> Result<(), PanoramaError> {
        let right_angle = std::f64::consts::FRAC_PI_2;
        let good = (8..=16_384).contains(&self.width)
            && (8..=8_192).contains(&self.height)
            && self.phi_top_rad <= right_angle
            && self.phi_bottom_rad >= -right_angle
            && self.phi_bottom_rad < self.phi_top_rad
            && self.rate_hz > 0.0
            && self.rate_hz <= 1000.0
            && self.max_range_m > 0.0
            && self.max_range_m < 1e5;
        if good { Ok(()) } else { Err(PanoramaError::Config) }
    }

    /// Its geometry.
    pub fn view(&self) -> Equirect {
        Equirect {
            width: self.width,
            height: self.height,
            phi_top_rad: self.phi_top_rad,
            phi_bottom_rad: self.phi_bottom_rad,
        }
    }

    /// Time between pictures.
    pub fn period_ns(&self) -> i64 {
        (1e9 / self.rate_hz).round() as i64
    }
}

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PanoramaError {
    /// A number of the camera's configuration is out of its range.
    #[error("a number of the panorama's configuration is out of range")]
    Config,
    /// A number of the segmenter's configuration is out of its range.
    #[error(transparent)]
    Segmenter(#[from] SegmenterConfigError),
    /// The motion is not known at this time.
    #[error("the motion is not known at {stamp_ns} ns")]
    MotionUnknown {
        /// The time asked for.
        stamp_ns: i64,
    },
    /// The motion returned NaN or infinity.
    #[error("the motion is not finite")]
    NotFinite,
}

/// A picture with the segmenter's masks.
#[derive(Debug, Clone, PartialEq)]
pub struct PanoramaRecord {
    /// Time of the picture.
    pub stamp_ns: i64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major, three bytes a pixel.
    pub rgb: Vec<u8>,
    /// Detections.
    pub masks: Vec<MaskRecord>,
}

/// Takes a picture at `stamp_ns` and segments it. The camera's axes are those of a body: x forward, y left, z up.
pub fn capture(
    world: &World,
    motion: &dyn Motion,
    body_from_camera: &Isometry3<f64>,
    config: &PanoramaConfig,
    segmenter: &SegmenterConfig,
    stamp_ns: i64,
) -> Result<PanoramaRecord, PanoramaError> {
    capture_with_truth(world, motion, body_from_camera, config, segmenter, stamp_ns).map(|(record, _)| record)
}

/// The same with the instance in every pixel, which must not reach a robot.
pub fn capture_with_truth(
    world: &World,
    motion: &dyn Motion,
    body_from_camera: &Isometry3<f64>,
    config: &PanoramaConfig,
    segmenter: &SegmenterConfig,
    stamp_ns: i64,
) -> Result<(PanoramaRecord, Rendering), PanoramaError> {
    config.validate()?;
    segmenter.validate()?;
    let (from_ns, to_ns) = motion.span_ns();
    if stamp_ns < from_ns || stamp_ns > to_ns {
        return Err(PanoramaError::MotionUnknown { stamp_ns });
    }
    let state = motion.at(stamp_ns);
    if !state.is_finite() {
        return Err(PanoramaError::NotFinite);
    }
    let world_from_camera = state.world_from_body * body_from_camera;
    let snapshot = world.at(stamp_ns);
    let mut rendering = render(&snapshot, &world_from_camera, &config.view(), config.max_range_m);
    let masks = segment(&snapshot, &rendering, &world_from_camera, stamp_ns, segmenter);
    let record = PanoramaRecord {
        stamp_ns,
        width: config.width,
        height: config.height,
        rgb: std::mem::take(&mut rendering.rgb),
        masks,
    };
    Ok((record, rendering))
}
