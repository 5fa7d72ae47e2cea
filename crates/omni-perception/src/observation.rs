//! What one panorama says about the things in it: for each thing its points in the world, its names with weights, its
//! colour. A graph of objects associates these over time.

use nalgebra::{Isometry3, Point3};
use rustc_hash::FxHashSet;

use crate::fast_projection::View;
use crate::label_transfer::{LabelConfig, LabelError, LabelReport, transfer_labels_seen};
use crate::near_mode::{floor, quantile};
use crate::vote::frame_histogram;
use crate::{Equirectangular, Mask, MaskedPanorama, Stamp};

/// Parameters of [`observe_panorama`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservationConfig {
    /// How points are labelled.
    pub labels: LabelConfig,
    /// Things with fewer points are not reported. Default 4 (a mug at 3 m has 8 to 30 in a second).
    pub min_points: usize,
    /// Things with more points than this are thinned, small ones never. Default 500.
    pub thin_above: usize,
    /// Thinning keeps one point a cube of this edge. Default 0.02 m.
    pub thin_m: f32,
    /// At this range an observation counts half. Default 5 m.
    pub half_weight_range_m: f64,
}

impl Default for ObservationConfig {
    fn default() -> Self {
        ObservationConfig {
            labels: LabelConfig::default(),
            min_points: 4,
            thin_above: 500,
            thin_m: 0.02,
            half_weight_range_m: 5.0,
        }
    }
}

impl ObservationConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`LabelError::Config`] names the first parameter that is out of its range.
    pub fn validate(&self) -> Result<(), LabelError> {
        self.labels.validate()?;
        let checks =
            [("thin_m", f64::from(self.thin_m), 1e-4), ("half_weight_range_m", self.half_weight_range_m, 1e-3)];
        match checks.into_iter().find(|(_, value, low)| !(*low..=f64::MAX).contains(value)) {
            Some((name, value, low)) => Err(LabelError::Config { name, value, low, high: f64::MAX }),
            None => Ok(()),
        }
    }
}

/// One thing in one panorama.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectObservation {
    /// Time of the image.
    pub stamp: Stamp,
    /// Its names and their shares of this frame's vote (sum 1), largest first, ties by name.
    pub label_weights: Vec<(String, f64)>,
    /// Caption of the best mask.
    pub caption: String,
    /// Score of the best mask.
    pub score: f32,
    /// How much this frame's vote is worth in (0, 1]: the score, less with the square of the range.
    pub weight: f64,
    /// Its points.
    pub points_in_world: Vec<Point3<f32>>,
    /// Median distance from the camera.
    pub range_m: f64,
    /// Median colour of the pixels that its points fall on.
    pub color_rgb: Option<[u8; 3]>,
    /// Whether it reaches the upper or lower edge of the image: then it is larger than it looks.
    pub touches_image_border: bool,
    /// Number of the thing in the segmenter's video: that of its best mask which has one. A hint, see [`Mask::track`].
    pub track: Option<u64>,
}

/// Result of [`observe_panorama`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Observations {
    /// The things with enough points, in the order of their first mask.
    pub objects: Vec<ObjectObservation>,
    /// Index of the mask of each given point.
    pub mask_of_point: Vec<Option<u16>>,
    /// What happened to the points.
    pub report: LabelReport,
}

/// Labels the points and gathers them by thing.
///
/// `points_in_world` are the deskewed points of the scans within about half a second of the image;
/// `world_from_camera` is the camera (x forward, y left, z up) at the time of the image.
///
/// # Errors
/// [`LabelError`] for an unsound camera or configuration.
pub fn observe_panorama(
    panorama: &MaskedPanorama,
    points_in_world: &[Point3<f32>],
    world_from_camera: &Isometry3<f64>,
    camera: &Equirectangular,
    config: &ObservationConfig,
) -> Result<Observations, LabelError> {
    config.validate()?;
    let masks = &panorama.masks;
    let view = View::from_world(world_from_camera);
    let transfer = transfer_labels_seen(points_in_world, &view, camera, masks, &config.labels)?;
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); masks.len()];
    for (point, mask) in transfer.mask_of_point.iter().enumerate() {
        if let Some(mask) = mask {
            members[usize::from(transfer.thing_of_mask[usize::from(*mask)])].push(point as u32);
        }
    }
    let mut objects = Vec::new();
    for (thing, members) in members.iter().enumerate() {
        if members.is_empty() || members.len() < config.min_points {
            continue;
        }
        let is_of_thing = |mask: &usize| usize::from(transfer.thing_of_mask[*mask]) == thing;
        let names: Vec<&Mask> = (0..masks.len()).filter(is_of_thing).map(|mask| &masks[mask]).collect();
        let in_camera: Vec<Point3<f32>> =
            members.iter().map(|&member| view.in_camera(&points_in_world[member as usize])).collect();
        let ranges = in_camera.iter().map(|point| point.coords.norm()).collect();
        let range_m = f64::from(quantile(ranges, 0.5));
        let (label_weights, best) = frame_histogram(&names);
        objects.push(ObjectObservation {
            stamp: panorama.stamp,
            label_weights,
            caption: best.caption.clone(),
            score: best.score,
            weight: frame_weight(best.score, range_m, config),
            points_in_world: thin(points_in_world, members, config),
            range_m,
            color_rgb: median_color(panorama, &in_camera, camera),
            touches_image_border: names.iter().any(|mask| touches_border(mask)),
            track: track_of(&names),
        });
    }
    Ok(Observations { objects, mask_of_point: transfer.mask_of_point, report: transfer.report })
}

/// The things of [`observe_panorama`] alone. An unsound camera or configuration sees nothing.
pub fn observe_objects(
    panorama: &MaskedPanorama,
    points_in_world: &[Point3<f32>],
    world_from_camera: &Isometry3<f64>,
    camera: &Equirectangular,
    config: &ObservationConfig,
) -> Vec<ObjectObservation> {
    observe_panorama(panorama, points_in_world, world_from_camera, camera, config)
        .map_or_else(|_| Vec::new(), |observations| observations.objects)
}

/// Score times the inverse variance of the position, which grows with the square of the range.
fn frame_weight(score: f32, range_m: f64, config: &ObservationConfig) -> f64 {
    let relative = range_m / config.half_weight_range_m;
    f64::from(sound_score(score)) / (1.0 + relative * relative)
}

/// A score in [1e-3, 1]; segmenters write anything.
pub(crate) fn sound_score(score: f32) -> f32 {
    if score.is_nan() { 1e-3 } else { score.clamp(1e-3, 1.0) }
}

fn thin(points: &[Point3<f32>], members: &[u32], config: &ObservationConfig) -> Vec<Point3<f32>> {
    let all = members.iter().map(|&member| points[member as usize]);
    if members.len() <= config.thin_above {
        return all.collect();
    }
    let mut taken = FxHashSet::with_capacity_and_hasher(members.len() / 2, Default::default());
    all.filter(|p| taken.insert([p.x, p.y, p.z].map(|x| floor(x / config.thin_m)))).collect()
}

fn median_color(
    panorama: &MaskedPanorama,
    points_in_camera: &[Point3<f32>],
    camera: &Equirectangular,
) -> Option<[u8; 3]> {
    let image = panorama.image.as_ref()?;
    if (image.width, image.height) != (camera.width_px, camera.height_px) {
        return None;
    }
    // A few hundred pixels tell the colour.
    let stride = points_in_camera.len().div_ceil(400).max(1);
    let mut channels: [Vec<u8>; 3] = Default::default();
    for point in points_in_camera.iter().step_by(stride) {
        let pixel = camera.project(&point.cast::<f64>());
        let color = pixel.and_then(|pixel| image.at(pixel.u as u32, pixel.v as u32));
        for (channel, value) in channels.iter_mut().zip(color.into_iter().flatten()) {
            channel.push(value);
        }
    }
    if channels[0].is_empty() {
        return None;
    }
    Some(channels.map(|mut channel| {
        let middle = channel.len() / 2;
        *channel.select_nth_unstable(middle).1
    }))
}

/// The video number of the mask with the highest score among those that have one; of equal scores the first.
fn track_of(masks: &[&Mask]) -> Option<u64> {
    let numbered = masks.iter().filter_map(|mask| Some((sound_score(mask.score), mask.track?)));
    numbered.reduce(|best, next| if next.0 > best.0 { next } else { best }).map(|(_, track)| track)
}

fn touches_border(mask: &Mask) -> bool {
    let height = mask.rle.height();
    mask.rle.spans().any(|span| span.top == 0 || span.bottom == height)
}
