//! From masks to points: which mask does each point belong to, seen from the camera at the time of the image?
//!
//! 1. project all points and keep the nearest of each cell (`range_buffer`);
//! 2. look the point's pixel up in the eroded masks (`mask_index`);
//! 3. drop the points that the camera cannot see;
//! 4. of each thing keep the near mode (`near_mode`).
//!
//! Each step takes away points of the background, since a thing that grows by what is behind it is worse than one that
//! misses a rim.

use nalgebra::Point3;
use thiserror::Error;

use crate::equirectangular::CameraError;
use crate::fast_projection::View;
use crate::mask_group::group_masks;
use crate::mask_index::{Erosion, MaskIndex};
use crate::mask_outline::Outline;
use crate::near_mode::{Apparent, NearMode, near_mode};
use crate::range_buffer::{RangeBuffer, Tolerance};
use crate::{Equirectangular, Mask};

/// Parameters of [`transfer_labels`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelConfig {
    /// Masks are shrunk by a disc of this radius. Default 2: the bleed of usual segmenters.
    pub erosion_px: u32,
    /// Thin masks are shrunk less, so that this share of their area is left. Default 0.15.
    pub min_kept_share: f64,
    /// Edge of a cell of the range buffer. Default 2: with its neighbours it spans the angular gap of a LiDAR.
    pub cell_px: u32,
    /// A nearer point hides only what is farther by this much. Default 0.05 m.
    pub hidden_step_m: f32,
    /// ... or by this share of the range, if more. Default 0.02.
    pub hidden_step_share: f32,
    /// Tangent of the steepest angle under which a surface is still taken for one. Default 8 (83 degrees).
    pub max_slope: f32,
    /// Points of a thing are linked up to this share of its apparent size. Default 0.3.
    pub link_share: f32,
    /// ... but not farther than this. Default 0.20 m.
    pub max_link_m: f32,
    /// ... and at least up to this many times their mean spacing. Default 3.
    pub link_spacings: f32,
    /// A cluster with this share of the largest one's points can be the thing. Default 0.35.
    pub near_share: f32,
    /// A thing is at most this many times as deep as it looks wide. Default 2.
    pub depth_ratio: f32,
    /// ... and may always be this deep. Default 0.15 m.
    pub min_depth_m: f32,
    /// Masks that overlap by at least this IoU show the same thing. Default 0.5.
    pub same_thing_iou: f64,
}

impl Default for LabelConfig {
    fn default() -> Self {
        LabelConfig {
            erosion_px: 2,
            min_kept_share: 0.15,
            cell_px: 2,
            hidden_step_m: 0.05,
            hidden_step_share: 0.02,
            max_slope: 8.0,
            link_share: 0.3,
            max_link_m: 0.20,
            link_spacings: 3.0,
            near_share: 0.35,
            depth_ratio: 2.0,
            min_depth_m: 0.15,
            same_thing_iou: 0.5,
        }
    }
}

/// Why labels could not be transferred.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum LabelError {
    /// The camera is unsound.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A parameter is out of its range.
    #[error("{name} = {value} is not in [{low}, {high}]")]
    Config {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Lowest sound value.
        low: f64,
        /// Highest sound value.
        high: f64,
    },
}

impl LabelConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`LabelError::Config`] names the first parameter that is out of its range.
    pub fn validate(&self) -> Result<(), LabelError> {
        let checks = [
            ("erosion_px", f64::from(self.erosion_px), 0.0, 64.0),
            ("min_kept_share", self.min_kept_share, 0.0, 1.0),
            ("cell_px", f64::from(self.cell_px), 1.0, 256.0),
            ("hidden_step_m", self.hidden_step_m.into(), 0.0, f64::MAX),
            ("hidden_step_share", self.hidden_step_share.into(), 0.0, f64::MAX),
            ("max_slope", self.max_slope.into(), 0.0, f64::MAX),
            ("link_share", self.link_share.into(), 0.0, f64::MAX),
            ("max_link_m", self.max_link_m.into(), 0.0, f64::MAX),
            ("link_spacings", self.link_spacings.into(), 0.0, f64::MAX),
            ("near_share", self.near_share.into(), 0.0, 1.0),
            ("depth_ratio", self.depth_ratio.into(), 0.0, f64::MAX),
            ("min_depth_m", self.min_depth_m.into(), 0.0, f64::MAX),
            ("same_thing_iou", self.same_thing_iou, 0.0, 1.0),
        ];
        match checks.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => Err(LabelError::Config { name, value, low, high }),
            None => Ok(()),
        }
    }
}

/// What happened to the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LabelReport {
    /// A coordinate was NaN or infinite.
    pub non_finite: usize,
    /// Above or below the image.
    pub outside_image: usize,
    /// On no mask (after erosion).
    pub unmasked: usize,
    /// On a mask, but hidden from the camera.
    pub hidden: usize,
    /// On a mask and visible, but not part of the near mode.
    pub behind: usize,
    /// Labelled.
    pub labelled: usize,
    /// Masks of another size than the image.
    pub skipped_masks: usize,
}

/// Result of [`transfer_labels`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LabelTransfer {
    /// Index of the mask of each point.
    pub mask_of_point: Vec<Option<u16>>,
    /// Masks that show the same thing share a number: the smallest index among them.
    pub thing_of_mask: Vec<u16>,
    /// What happened to the points.
    pub report: LabelReport,
}

/// Labels points of the camera frame (at image time) with masks. About 50 ns a point.
///
/// Give all points of the scans within about half a second of the image, not only those on things: the others say
/// what hides what. Where masks overlap, one inside another is on top of it, else the one with the higher score.
///
/// # Errors
/// [`LabelError`] for an unsound camera or configuration. Points that are not finite and masks of the wrong size are
/// skipped and counted.
pub fn transfer_labels(
    points_in_camera: &[Point3<f32>],
    camera: &Equirectangular,
    masks: &[Mask],
    config: &LabelConfig,
) -> Result<LabelTransfer, LabelError> {
    transfer_labels_seen(points_in_camera, &View::Camera, camera, masks, config)
}

/// [`transfer_labels`] for points of any frame.
pub(crate) fn transfer_labels_seen(
    points: &[Point3<f32>],
    view: &View,
    camera: &Equirectangular,
    masks: &[Mask],
    config: &LabelConfig,
) -> Result<LabelTransfer, LabelError> {
    camera.validate()?;
    config.validate()?;
    let erosion = Erosion { radius_px: config.erosion_px, min_kept_share: config.min_kept_share };
    // A mask of another size is not expanded into columns: it may be of any size.
    let outlines: Vec<Outline> = masks
        .iter()
        .map(|mask| match (mask.rle.width(), mask.rle.height()) == (camera.width_px, camera.height_px) {
            true => Outline::new(&mask.rle),
            false => Outline::default(),
        })
        .collect();
    let index = MaskIndex::new(masks, &outlines, camera.width_px, camera.height_px, &erosion);
    let filled = RangeBuffer::fill(points, view, camera, config.cell_px, &index);
    let mut report = LabelReport {
        non_finite: filled.non_finite,
        outside_image: filled.outside_image,
        skipped_masks: index.skipped,
        ..LabelReport::default()
    };

    // The members of each thing, and the mask of each member.
    let thing_of_mask = group_masks(masks, &outlines, camera.width_px, config.same_thing_iou);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); masks.len()];
    let mut mask_of_point: Vec<Option<u16>> = vec![None; points.len()];
    let tolerance = Tolerance::of(config);
    for candidate in &filled.candidates {
        let mask = candidate.mask;
        if filled.buffer.is_visible((candidate.u, candidate.v), candidate.range_m, &tolerance) {
            mask_of_point[candidate.point as usize] = Some(mask);
            members[usize::from(thing_of_mask[usize::from(mask)])].push(candidate.point);
        } else {
            report.hidden += 1;
        }
    }

    let near = NearMode {
        link_share: config.link_share,
        max_link_m: config.max_link_m,
        link_spacings: config.link_spacings,
        near_share: config.near_share,
        depth_ratio: config.depth_ratio,
        min_depth_m: config.min_depth_m,
    };
    for (thing, members) in members.iter().enumerate().filter(|(_, members)| !members.is_empty()) {
        let (area_px, px) = (outlines[thing].area_px as f32, camera.row_angle_rad() as f32);
        let apparent =
            Apparent { size_rad: 1.5 * px * area_px.sqrt(), spacing_rad: px * (area_px / members.len() as f32).sqrt() };
        let positions: Vec<Point3<f32>> =
            members.iter().map(|&member| view.in_camera(&points[member as usize])).collect();
        let is_kept = near_mode(&positions, &apparent, &near);
        for (&member, is_kept) in members.iter().zip(is_kept) {
            if is_kept {
                report.labelled += 1;
            } else {
                mask_of_point[member as usize] = None;
                report.behind += 1;
            }
        }
    }
    let LabelReport { non_finite, outside_image, hidden, behind, labelled, .. } = report;
    report.unmasked = points.len() - non_finite - outside_image - hidden - behind - labelled;
    Ok(LabelTransfer { mask_of_point, thing_of_mask, report })
}

/// [`transfer_labels`] without the report. An unsound camera or configuration labels nothing.
pub fn label_points(
    points_in_camera: &[Point3<f32>],
    camera: &Equirectangular,
    masks: &[Mask],
    config: &LabelConfig,
) -> Vec<Option<u16>> {
    transfer_labels(points_in_camera, camera, masks, config)
        .map_or_else(|_| vec![None; points_in_camera.len()], |transfer| transfer.mask_of_point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rle;

    /// A mask over columns and rows of the default camera.
    fn mask(columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> Mask {
        let mut counts = vec![columns.start * 640 + rows.start];
        for column in columns.clone() {
            counts.push(rows.end - rows.start);
            let is_last = column + 1 == columns.end;
            counts.push(if is_last {
                (1920 - columns.end) * 640 + 640 - rows.end
            } else {
                640 - rows.end + rows.start
            });
        }
        let rle = Rle::from_counts(1920, 640, &counts).expect("fills the image");
        Mask::new(rle, "box", 0.9)
    }

    /// A square patch at `range_m` around a pixel, one point a pixel.
    fn patch(
        camera: &Equirectangular,
        columns: std::ops::Range<u32>,
        rows: std::ops::Range<u32>,
        range_m: f64,
    ) -> Vec<Point3<f32>> {
        let pixels = columns.flat_map(|column| rows.clone().map(move |row| (column, row)));
        pixels
            .map(|(u, v)| Point3::from(camera.unproject(f64::from(u) + 0.5, f64::from(v) + 0.5).into_inner() * range_m))
            .map(|p| p.cast::<f32>())
            .collect()
    }

    #[test]
    fn bleed_and_background_do_not_reach_the_thing() {
        // The thing fills columns 900..940 and rows 300..340 at 3 m; its mask bleeds by two pixels; a wall at 3.4 m fills
        // everything around it, and (from the LiDAR's other view) also stands behind the thing.
        let camera = Equirectangular::default();
        let thing = patch(&camera, 900..940, 300..340, 3.0);
        let wall = patch(&camera, 880..960, 280..360, 3.4);
        let points: Vec<_> = thing.iter().chain(&wall).copied().collect();
        let transfer = transfer_labels(&points, &camera, &[mask(898..942, 298..342)], &LabelConfig::default());
        let transfer = transfer.expect("sound");
        assert!(transfer.mask_of_point[..1600].iter().all(|mask| *mask == Some(0)));
        assert!(transfer.mask_of_point[1600..].iter().all(|mask| mask.is_none()));
        assert_eq!(transfer.report.labelled, 1600);
        assert_eq!(transfer.report.labelled + transfer.report.hidden + transfer.report.unmasked, points.len());
    }

    #[test]
    fn everything_is_counted_once() {
        let camera = Equirectangular::default();
        let mut points = patch(&camera, 900..904, 300..304, 3.0);
        points.extend([Point3::new(f32::NAN, 0.0, 0.0), Point3::new(0.0, 0.0, 1.0), Point3::new(-1.0, 0.0, 0.0)]);
        let small = Mask { rle: Rle::from_counts(2, 2, &[4]).expect("four"), ..mask(0..1, 0..1) };
        let transfer = transfer_labels(&points, &camera, &[mask(890..910, 290..310), small], &LabelConfig::default());
        let report = transfer.expect("sound").report;
        let expected = LabelReport {
            non_finite: 1,
            outside_image: 1,
            unmasked: 1,
            labelled: 16,
            skipped_masks: 1,
            ..Default::default()
        };
        assert_eq!(report, expected);
    }

    #[test]
    fn unsound_input_is_refused() {
        let config = LabelConfig { link_share: f32::NAN, ..LabelConfig::default() };
        let result = transfer_labels(&[], &Equirectangular::default(), &[], &config);
        assert!(matches!(result, Err(LabelError::Config { name: "link_share", .. })));
        let camera = Equirectangular { width_px: 0, ..Default::default() };
        assert!(matches!(transfer_labels(&[], &camera, &[], &LabelConfig::default()), Err(LabelError::Camera(_))));
        assert_eq!(label_points(&[Point3::origin()], &camera, &[], &LabelConfig::default()), [None]);
    }
}
