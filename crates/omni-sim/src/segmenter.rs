//! Masks as an open-vocabulary segmenter would give them: borders that bleed, things it misses, look-alikes it confuses,
//! things that are not there.
//!
//! Its errors hang together: whether a thing is confused, missed or badly outlined is drawn from the thing, the side it is
//! seen from (eight sectors) and a stretch of some seconds, so a confused object stays confused from that side for a
//! while, and looking again from the same place does not average the error away. Part of the misses is drawn anew each
//! frame. Video numbers (as SAM2 gives them) last for some time and are swapped now and then. Instance numbers only
//! select what was rendered; they reach neither the records nor the draws.

use crate::catalog;
use crate::mesh::InstanceId;
use crate::noise::NoiseKey;
use crate::region::{Region, regions_of};
use crate::render::Rendering;
use crate::world::{Snapshot, Thing};
use nalgebra::{Isometry3, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use thiserror::Error;

/// Numbers of the segmenter.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmenterConfig {
    /// Multiplies confusion, misses, false positives and bleeding (1); 0 gives the truth as pixels see it.
    pub noise_scale: f64,
    /// Share of things that are taken for a look-alike (0.08).
    pub confusion: f64,
    /// Share of things that are missed (0.15): of large and near ones. Small ones are missed up to 1.6 times as often,
    /// far ones up to 1.4 times, small and far ones up to twice.
    pub miss: f64,
    /// Mean number of things per frame that are not there (0.3).
    pub false_positives: f64,
    /// Border bleeding: a mask is dilated, eroded or shifted by this (2).
    pub bleed_px: f64,
    /// Time for which an error of a thing seen from one side stays (4).
    pub correlation_s: f64,
    /// Mean time for which a thing keeps its number in the video (20).
    pub track_s: f64,
    /// Share of masks that carry a neighbour's number (0.02).
    pub track_swaps: f64,
    /// Visible pixels of a 1920 panorama at which a thing counts as small (600); in proportion for other sizes.
    pub small_px: f64,
    /// Distance beyond which a thing counts as far (6).
    pub far_m: f64,
    /// Things with fewer visible pixels are never seen, whatever the noise (25).
    pub min_area_px: u32,
    /// What the segmenter was told to look for, such as the nouns of the instruction. They also are among the words
    /// for things that are not there.
    pub phrases: Vec<String>,
    /// Whether it gives only the classes in `phrases` (false: all it knows).
    pub only_phrases: bool,
    /// Gives no mask at all, for tests of what depends on masks (false).
    pub blank: bool,
    /// Seed of all draws.
    pub seed: u64,
}

impl Default for SegmenterConfig {
    fn default() -> Self {
        SegmenterConfig {
            noise_scale: 1.0,
            confusion: 0.08,
            miss: 0.15,
            false_positives: 0.3,
            bleed_px: 2.0,
            correlation_s: 4.0,
            track_s: 20.0,
            track_swaps: 0.02,
            small_px: 600.0,
            far_m: 6.0,
            min_area_px: 25,
            phrases: Vec::new(),
            only_phrases: false,
            blank: false,
            seed: 0,
        }
    }
}

/// A number of the segmenter's configuration is out of its range.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("a number of the segmenter's configuration is out of range")]
pub struct SegmenterConfigError;

impl SegmenterConfig {
    /// Checks every number.
    pub fn validate(&self) -> Result<(), SegmenterConfigError> {
        let share = |x: f64| (0.0..=1.0).contains(&x);
        let good = (0.0..=100.0).contains(&self.noise_scale)
            && share(self.confusion)
            && share(self.miss)
            && (0.0..=50.0).contains(&self.false_positives)
            && (0.0..=50.0).contains(&self.bleed_px)
            && self.correlation_s > 0.0
            && self.correlation_s < 1e6
            && self.track_s > 0.0
            && self.track_s < 1e6
            && share(self.track_swaps)
            && self.small_px > 0.0
            && self.far_m > 0.0;
        if good { Ok(()) } else { Err(SegmenterConfigError) }
    }
}

/// One detection.
#[derive(Debug, Clone, PartialEq)]
pub struct MaskRecord {
    /// COCO run lengths: column-major, zeros first.
    pub counts: Vec<u32>,
    /// Class, right or not.
    pub label: String,
    /// Confidence in `[0, 1]`.
    pub score: f32,
    /// A sentence about it, wrong where the label is wrong.
    pub caption: String,
    /// Number of the object in the video, as a tracker gives it: it stays for some time, then the thing has another one,
    /// and sometimes a neighbour's. It says nothing about instances.
    pub track: u64,
}

/// Segments a rendering. Masks may overlap; they come in the order of their first pixel.
pub fn segment(
    snapshot: &Snapshot<'_>,
    rendering: &Rendering,
    world_from_camera: &Isometry3<f64>,
    stamp_ns: i64,
    config: &SegmenterConfig,
) -> Vec<MaskRecord> {
    if config.blank {
        return Vec::new();
    }
    let frame = Frame {
        config,
        things: snapshot.world().things(),
        classes: snapshot.world().things().iter().map(|t| t.class.as_str()).collect(),
        width: rendering.view.width,
        height: rendering.view.height,
        stamp_ns,
    };
    let seen_from = directions_to_camera(snapshot, world_from_camera);
    let mut masks: Vec<(Region, MaskRecord)> = Vec::new();
    for (instance, region) in regions_of(&rendering.instances, rendering.view.height) {
        let (Some(thing), Some((view, noise))) = (snapshot.world().thing(instance), seen_from.get(&instance)) else {
            continue;
        };
        if config.only_phrases && !config.phrases.iter().any(|p| names(p, &thing.class)) {
            continue;
        }
        for part in region.split_at_seam(frame.width) {
            masks.extend(frame.detect(thing, part, view, *noise));
        }
    }
    masks.extend(frame.false_positives());
    // By first pixel, so that the order says nothing about instances.
    masks.sort_by(|a, b| {
        let first = |m: &(Region, MaskRecord)| m.0.runs().first().map(|r| (r.column, r.from));
        (first(a), &a.1.label, &a.1.counts).cmp(&(first(b), &b.1.label, &b.1.counts))
    });
    let mut masks: Vec<MaskRecord> = masks.into_iter().map(|(_, mask)| mask).collect();
    frame.swap_numbers(&mut masks);
    masks
}

/// Whether a phrase asks for a class: the same words, one more word before either, singular or plural.
fn names(phrase: &str, class: &str) -> bool {
    let clean = |s: &str| s.trim().trim_end_matches('s').to_lowercase();
    let (phrase, class) = (clean(phrase), clean(class));
    let ends = |long: &str, short: &str| long == short || (!short.is_empty() && long.ends_with(&format!(" {short}")));
    ends(&phrase, &class) || ends(&class, &phrase)
}

/// For each instance the vector from its box's centre to the camera, and the address of its draws.
fn directions_to_camera(
    snapshot: &Snapshot<'_>,
    world_from_camera: &Isometry3<f64>,
) -> BTreeMap<InstanceId, (Vector3<f64>, NoiseKey)> {
    let camera = world_from_camera.translation.vector;
    let mut found = BTreeMap::new();
    for extent in snapshot.world().extents() {
        let center = nalgebra::center(&extent.low, &extent.high);
        let in_world: Point3<f64> = match extent.mover {
            Some(mover) => (snapshot.mover_pose(mover) * center).cast(),
            None => center.cast(),
        };
        found.entry(extent.instance).or_insert((camera - in_world.coords, extent.noise));
    }
    found
}

/// What all detections of a picture share.
struct Frame<'a> {
    config: &'a SegmenterConfig,
    things: &'a [Thing],
    classes: BTreeSet<&'a str>,
    width: u32,
    height: u32,
    stamp_ns: i64,
}

impl Frame<'_> {
    /// The mask of one thing, `None` when it is missed.
    fn detect(
        &self,
        thing: &Thing,
        region: Region,
        to_camera: &Vector3<f64>,
        noise: NoiseKey,
    ) -> Option<(Region, MaskRecord)> {
        let config = self.config;
        let area = region.area();
        if area < u64::from(config.min_area_px.max(1)) {
            return None;
        }
        let root = NoiseKey::new(config.seed).with(noise.bits());
        let lasting = self.lasting(root, to_camera);
        let momentary = root.with(self.stamp_ns as u64);

        let scale = 1920.0 / f64::from(self.width);
        let smallness = (-(area as f64) * scale * scale / config.small_px).exp();
        let farness = (to_camera.norm() / config.far_m - 1.0).clamp(0.0, 1.0);
        let miss = config.noise_scale * config.miss * (1.0 + 0.6 * smallness + 0.4 * farness);
        // Two draws of which either may miss: 1 - (1 - 0.7 p)(1 - 0.3 p) is p within a few per cent of it.
        let miss = miss.min(0.9);
        if lasting.with(1).uniform() < 0.7 * miss || momentary.with(1).uniform() < 0.3 * miss {
            return None;
        }

        let mut score = 0.92 - 0.3 * smallness - 0.1 * farness;
        score += config.noise_scale.min(1.0) * momentary.with(2).between(-0.05, 0.05);
        let is_confused = lasting.with(3).uniform() < config.noise_scale * config.confusion;
        let wrong = is_confused.then(|| self.wrong_label(&thing.class, lasting.with(4))).flatten();
        let (label, caption) = match wrong {
            Some(label) => {
                score -= 0.15;
                let caption = self.wrong_caption(&label, &thing.color, lasting.with(5));
                (label, caption)
            }
            None => (thing.class.clone(), thing.caption.clone()),
        };
        let region = self.bleed(region, lasting.with(6));
        let score = score.clamp(0.05, 0.99) as f32;
        Some(self.record(region, label, score, caption, self.track(root)))
    }

    /// The number of a thing in the video at this time: another one after about `track_s`, for each thing at its own
    /// times.
    fn track(&self, root: NoiseKey) -> u64 {
        let stretch = self.config.track_s * 1e9;
        let time = self.stamp_ns as f64 / stretch + root.with(9).uniform();
        // Positive in 32 bits, as trackers count.
        root.with(10).with(time.floor() as i64 as u64).bits() >> 33
    }

    /// Some masks get the number of the next one: trackers confuse what passes before one another.
    fn swap_numbers(&self, masks: &mut [MaskRecord]) {
        let key = NoiseKey::new(self.config.seed).with_text("track swap").with(self.stamp_ns as u64);
        for next in 1..masks.len() {
            if key.with(next as u64).uniform() < self.config.noise_scale * self.config.track_swaps {
                let [a, b] = [next - 1, next].map(|index| masks[index].track);
                (masks[next - 1].track, masks[next].track) = (b, a);
            }
        }
    }

    /// The address of draws that stay while the thing is seen from one side, for some seconds.
    fn lasting(&self, root: NoiseKey, to_camera: &Vector3<f64>) -> NoiseKey {
        let azimuth = to_camera.y.atan2(to_camera.x);
        let sector = ((azimuth / TAU + 1.0) * 8.0).floor() as u64 % 8;
        // Each thing has its own beat, else all errors of a picture would change at once.
        let stretch = self.config.correlation_s * 1e9;
        let time = self.stamp_ns as f64 / stretch + root.with(8).uniform();
        root.with(sector).with(time.floor() as i64 as u64)
    }

    /// A look-alike; for a class without one any other class of the building. `None` when there is no other.
    fn wrong_label(&self, class: &str, key: NoiseKey) -> Option<String> {
        let others = catalog::class(class).map_or(&[][..], |c| c.look_alikes);
        if others.is_empty() {
            let known: Vec<&str> = self.classes.iter().copied().filter(|c| *c != class).collect();
            return known.get(key.index(known.len())).map(|c| c.to_string());
        }
        Some(others[key.index(others.len())].to_string())
    }

    /// The caption of another thing that is of this class, else a plain sentence.
    fn wrong_caption(&self, label: &str, color: &str, key: NoiseKey) -> String {
        let same: Vec<&Thing> = self.things.iter().filter(|t| t.class == label).collect();
        // The choice goes by caption, not by instance: numbers must not show.
        let mut captions: Vec<&str> = same.iter().map(|t| t.caption.as_str()).collect();
        captions.sort_unstable();
        match captions.get(key.index(captions.len())) {
            Some(caption) => caption.to_string(),
            None => plain_caption(label, color),
        }
    }

    /// One in four masks each: grown, shrunk, moved, clean.
    fn bleed(&self, region: Region, key: NoiseKey) -> Region {
        let reach = (self.config.bleed_px * self.config.noise_scale).round() as u32;
        let (width, height) = (self.width, self.height);
        let changed = match key.index(4) {
            _ if reach == 0 => return region,
            0 => region.dilated(reach, width, height),
            1 => region.eroded(reach, width, height),
            2 => {
                let (sin, cos) = (TAU * key.with(1).uniform()).sin_cos();
                let reach = f64::from(reach);
                let step = |x: f64| (x * reach).round() as i64;
                region.shifted(step(cos), step(sin), width, height)
            }
            _ => return region,
        };
        // What would vanish stays as it is: a thing was detected.
        if changed.is_empty() { region } else { changed }
    }

    /// Blobs that are nothing, with a word the segmenter knows or was asked for.
    fn false_positives(&self) -> Vec<(Region, MaskRecord)> {
        let key = NoiseKey::new(self.config.seed).with_text("false positive").with(self.stamp_ns as u64);
        let mut words: BTreeSet<&str> = self.config.phrases.iter().map(String::as_str).collect();
        if !self.config.only_phrases {
            words.extend(&self.classes);
        }
        let words: Vec<&str> = words.into_iter().collect();
        let count = match words.is_empty() {
            true => 0,
            false => key.poisson(self.config.false_positives * self.config.noise_scale),
        };
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        (0..count as u64)
            .filter_map(|i| {
                let key = key.with(i);
                // Sizes for a 1920 panorama, in proportion for others.
                let scale = width / 1920.0;
                let axis = |part| scale * key.with(part).between(6.0, 40.0);
                let center = (width * key.with(3).uniform(), height * key.with(4).between(0.2, 0.9));
                let region = Region::ellipse(center, (axis(1), axis(2)), self.width, self.height);
                let label = words[key.with(5).index(words.len())].to_string();
                let score = key.with(6).between(0.3, 0.55) as f32;
                let caption = plain_caption(&label, "");
                (!region.is_empty()).then(|| self.record(region, label, score, caption, key.with(7).bits() >> 33))
            })
            .collect()
    }

    fn record(&self, region: Region, label: String, score: f32, caption: String, track: u64) -> (Region, MaskRecord) {
        let counts = region.coco_counts(self.width, self.height);
        let mask = MaskRecord { counts, label, score, caption, track };
        (region, mask)
    }
}

fn plain_caption(label: &str, color: &str) -> String {
    let color = if color.is_empty() { "dim" } else { color };
    format!(
        "This appears to be a {color} {label}, seen only in part and without sharp outlines; it looks like an ordinary \
         {label} of usual size that somebody has put here."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phrase_names_a_class_in_singular_plural_and_with_more_words() {
        assert!(names("mug", "mug") && names("Chairs", "chair") && names("office chair", "chair"));
        assert!(names("plant", "potted plant"));
        assert!(!names("cup", "cupboard") && !names("", "mug") && !names("armchair", "chair"));
    }
}
