//! What the builder remembers of an object besides the node: its points with their recency, its captions and its colour.
//!
//! The points are kept as a bounded set of voxel means. A box fitted to them must do two things at once: cover sides that
//! were seen once from the other end of the room, and follow the newest evidence when the map frame has drifted. So stale
//! voxels go only where the fresh ones do *not* lie on what was known (else nothing has drifted, and a glimpse of one corner
//! from afar must not eat the rest of the thing), and only those closer to fresh voxels than the frame can have drifted since:
//! they are the same surface, seen before the drift. A stale voxel farther away is a side that is not in view now, and stays.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use crate::bounds::Aabb;
use crate::ids::ObjectId;
use crate::object::Object;
use crate::splits::Cut;

/// Side of a voxel at first; doubled for objects that need more than [`MAX_CELLS`].
const VOXEL_M: f64 = 0.05;
/// Bound on the voxels of one object; 1024 at 5 cm is the surface of a wardrobe.
const MAX_CELLS: usize = 1024;
/// Weight of a new frame in a voxel's mean.
const NEWEST_SHARE: f32 = 0.3;
/// A voxel not hit for this long (in frames that showed the object) is stale.
const FRESH_S: f64 = 8.0;
/// Where so many of the fresh voxels lie on stale ones, nothing has drifted.
const SETTLED_SHARE: f64 = 0.3;
/// Share of the weight trimmed at each end of each axis of a box.
const TRIM: f64 = 0.015;
/// ... and across the wall from the box of what hangs on it.
const FLAT_TRIM: f64 = 0.15;
/// Labels whose captions are kept.
const MAX_CAPTIONS: usize = 8;
/// Video numbers that are kept: only the last seconds count.
const MAX_TRACKS: usize = 4;

/// How far the map frame may have moved under an object that was last seen `age_s` ago. 0.5 % of the path and 0.5 degrees
/// per 10 m at walking speed make 0.2 to 0.3 m in 40 s; beyond that the odometry is assumed to have been corrected.
pub fn drift_m(age_s: f64) -> f64 {
    (0.007 * age_s.max(0.0)).min(0.30)
}

/// Memory of one object.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectMemory {
    /// Side of a voxel.
    pub(crate) voxel_m: f64,
    /// Voxels, ascending by key.
    pub(crate) cells: Vec<Cell>,
    /// Best caption per label, with its score.
    pub(crate) captions: BTreeMap<String, (f32, String)>,
    /// Sum of colours and their number.
    pub(crate) color_sum: [f64; 3],
    pub(crate) color_count: u32,
    /// How often it was seen in one frame with a neighbour as something else.
    pub(crate) apart: BTreeMap<ObjectId, u32>,
    /// Looks at its place since it was last seen, and those that went through it.
    pub(crate) looks: u32,
    pub(crate) looks_through: u32,
    /// Video numbers that are its own at present.
    pub(crate) tracks: BTreeMap<u64, Track>,
    /// Where it has been seen as two pieces. Not kept in files.
    pub(crate) cut: Option<Cut>,
}

/// How well a video number is known to be an object's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Track {
    /// When it was last found there by place and name.
    pub last_seen_ns: i64,
    /// How often in a row, without having been anything else in between.
    pub run: u32,
}

/// One voxel of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    pub key: [i32; 3],
    pub mean: Point3<f32>,
    /// Frames that hit it.
    pub hits: u16,
    pub last_seen_ns: i64,
}

impl Default for ObjectMemory {
    fn default() -> ObjectMemory {
        ObjectMemory {
            voxel_m: VOXEL_M,
            cells: Vec::new(),
            captions: BTreeMap::new(),
            color_sum: [0.0; 3],
            color_count: 0,
            apart: BTreeMap::new(),
            looks: 0,
            looks_through: 0,
            tracks: BTreeMap::new(),
            cut: None,
        }
    }
}

impl ObjectMemory {
    /// A memory for an object that has none (it came from a file): points on the surface of its box.
    pub fn from_box(object: &Object) -> ObjectMemory {
        let mut memory = ObjectMemory::default();
        let sides = object.bounds.sides_m();
        let steps = sides.map(|side| (side / VOXEL_M).ceil().clamp(1.0, 12.0) as usize);
        let mut points = Vec::new();
        for i in 0..=steps.x {
            for j in 0..=steps.y {
                for k in 0..=steps.z {
                    let on_surface = i == 0 || j == 0 || k == 0 || i == steps.x || j == steps.y || k == steps.z;
                    if on_surface {
                        let share = Vector3::new(
                            i as f64 / steps.x as f64,
                            j as f64 / steps.y as f64,
                            k as f64 / steps.z as f64,
                        );
                        points.push((object.bounds.min + sides.component_mul(&share)).cast::<f32>());
                    }
                }
            }
        }
        memory.absorb(&points, object.last_seen_ns);
        if !object.caption.is_empty() {
            memory.remember_caption(&object.label, 0.0, &object.caption);
        }
        if let Some(color) = object.color {
            memory.remember_color(color);
        }
        memory
    }

    /// It was seen under a video number; of too many the oldest is forgotten.
    pub(crate) fn remember_track(&mut self, number: u64, seen: Track) {
        let track = self.tracks.entry(number).or_insert(Track { last_seen_ns: seen.last_seen_ns, run: 0 });
        track.last_seen_ns = track.last_seen_ns.max(seen.last_seen_ns);
        track.run = track.run.saturating_add(seen.run);
        while self.tracks.len() > MAX_TRACKS {
            let oldest = self.tracks.iter().min_by_key(|(number, track)| (track.last_seen_ns, **number));
            let oldest = oldest.map(|(number, _)| *number);
            oldest.and_then(|number| self.tracks.remove(&number));
        }
    }

    /// Takes in the points of one frame.
    pub fn absorb(&mut self, points: &[Point3<f32>], stamp_ns: i64) {
        // Points of one voxel become neighbours; the stable sort keeps their order, so sums are the same everywhere.
        let mut keyed: Vec<([i32; 3], &Point3<f32>)> =
            points.iter().map(|point| (key_of(point, self.voxel_m), point)).collect();
        keyed.sort_by_key(|(key, _)| *key);
        for hits in keyed.chunk_by(|a, b| a.0 == b.0) {
            let key = hits[0].0;
            let sum: Vector3<f32> = hits.iter().map(|(_, point)| point.coords).sum();
            let mean = Point3::from(sum / hits.len() as f32);
            match self.cells.binary_search_by_key(&key, |cell| cell.key) {
                Ok(at) => {
                    let cell = &mut self.cells[at];
                    cell.mean += (mean - cell.mean) * NEWEST_SHARE;
                    cell.hits = cell.hits.saturating_add(1);
                    cell.last_seen_ns = cell.last_seen_ns.max(stamp_ns);
                }
                Err(at) => self.cells.insert(at, Cell { key, mean, hits: 1, last_seen_ns: stamp_ns }),
            }
        }
        while self.cells.len() > MAX_CELLS {
            self.voxel_m *= 2.0;
            self.rebin(Vector3::zeros());
        }
    }

    /// Moves all points (the frame has drifted by this much since they were seen).
    pub fn shift(&mut self, by: &Vector3<f64>) {
        self.rebin(by.cast::<f32>());
    }

    /// Sorts voxels that came from a file.
    pub(crate) fn settle(&mut self) {
        self.rebin(Vector3::zeros());
    }

    fn rebin(&mut self, by: Vector3<f32>) {
        let old = std::mem::take(&mut self.cells);
        let mut cells: BTreeMap<[i32; 3], Cell> = BTreeMap::new();
        for mut cell in old {
            cell.mean += by;
            cell.key = key_of(&cell.mean, self.voxel_m);
            cells
                .entry(cell.key)
                .and_modify(|known| {
                    let total = f32::from(known.hits) + f32::from(cell.hits);
                    known.mean += (cell.mean - known.mean) * (f32::from(cell.hits) / total);
                    known.hits = known.hits.saturating_add(cell.hits);
                    known.last_seen_ns = known.last_seen_ns.max(cell.last_seen_ns);
                })
                .or_insert(cell);
        }
        self.cells = cells.into_values().collect();
    }

    /// Takes in the memory of an object that turned out to be this one.
    pub fn merge(&mut self, other: ObjectMemory) {
        self.voxel_m = self.voxel_m.max(other.voxel_m);
        self.cells.extend(other.cells);
        self.rebin(Vector3::zeros());
        while self.cells.len() > MAX_CELLS {
            self.voxel_m *= 2.0;
            self.rebin(Vector3::zeros());
        }
        for (label, (score, caption)) in &other.captions {
            self.remember_caption(label, *score, caption);
        }
        for (sum, more) in self.color_sum.iter_mut().zip(other.color_sum) {
            *sum += more;
        }
        self.color_count += other.color_count;
        for (id, count) in other.apart {
            *self.apart.entry(id).or_insert(0) += count;
        }
        for (number, track) in other.tracks {
            self.remember_track(number, track);
        }
        self.looks = 0;
        self.looks_through = 0;
    }

    /// Drops stale voxels that the newest evidence replaces (see the head of this file).
    pub fn forget_smear(&mut self, newest_ns: i64) {
        let age_s = |cell: &Cell| (newest_ns - cell.last_seen_ns) as f64 * 1e-9;
        let fresh: Vec<Point3<f32>> = self.cells.iter().filter(|c| age_s(c) <= FRESH_S).map(|c| c.mean).collect();
        if fresh.len() < 3 || fresh.len() == self.cells.len() {
            return;
        }
        // Fresh voxels that were known before, or lie within a voxel of stale ones: the frame is where it was.
        let stale: Vec<Point3<f32>> = self.cells.iter().filter(|c| age_s(c) > FRESH_S).map(|c| c.mean).collect();
        let is_known = |p: &&Point3<f32>| stale.iter().any(|s| (s - **p).norm_squared() <= (VOXEL_M * VOXEL_M) as f32);
        let stride = fresh.len().div_ceil(160);
        let wanted = (SETTLED_SHARE * fresh.len().div_ceil(stride) as f64).ceil() as usize;
        if fresh.iter().step_by(stride).filter(is_known).take(wanted).count() == wanted {
            return;
        }
        let around = Aabb::around(fresh.iter().map(|point| point.cast::<f64>()));
        // A bounded, evenly spread sample is enough to tell near from far.
        let sample: Vec<Point3<f32>> = fresh.into_iter().step_by(stride).collect();
        self.cells.retain(|cell| {
            let age_s = age_s(cell);
            let reach_m = 0.03 + drift_m(age_s);
            let is_near = |p: &Point3<f32>| (p - cell.mean).norm_squared() <= (reach_m * reach_m) as f32;
            let mean = cell.mean.cast::<f64>();
            age_s <= FRESH_S
                || around.is_none_or(|around| !around.inflated(reach_m).contains(&mean))
                || !sample.iter().any(is_near)
        });
    }

    /// The box: weighted percentiles of the voxel means, weights being frames (up to 8). `None` without points.
    pub fn bounds(&self) -> Option<Aabb> {
        let weighted: Vec<(Point3<f64>, f64)> =
            self.cells.iter().map(|cell| (cell.mean.cast::<f64>(), f64::from(cell.hits.min(8)))).collect();
        robust_bounds(&weighted)
    }

    /// The same for a thing that is flat and hangs on a wall: across the wall the box goes where most of its points are. A mask
    /// that bleeds over its edge takes points before and behind the wall along, which would make it as deep as a cupboard.
    pub fn flat_bounds(&self) -> Option<Aabb> {
        let mut bounds = self.bounds()?;
        let across = if bounds.sides_m().x < bounds.sides_m().y { 0 } else { 1 };
        let mut along: Vec<(f64, f64)> =
            self.cells.iter().map(|cell| (f64::from(cell.mean[across]), f64::from(cell.hits.min(8)))).collect();
        along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = along.iter().map(|(_, weight)| weight).sum();
        bounds.min[across] = percentile(along.iter().copied(), FLAT_TRIM * total);
        bounds.max[across] = percentile(along.iter().rev().copied(), FLAT_TRIM * total);
        Some(bounds)
    }

    /// Share of the points that lie within `reach_m` (at most a voxel and a half) of a remembered point.
    pub fn overlap(&self, points: &[Point3<f64>], reach_m: f64) -> f64 {
        if points.is_empty() {
            return 0.0;
        }
        // Most points of a neighbour are outside: decide them by the box of the voxels.
        let keys = self.cells.iter().map(|cell| Point3::from(cell.key.map(|k| f64::from(k) * self.voxel_m)));
        let Some(around) = Aabb::around(keys).map(|bounds| bounds.inflated(reach_m + self.voxel_m)) else {
            return 0.0;
        };
        let is_near =
            |point: &&Point3<f64>| around.contains(point) && self.has_near(&point.cast::<f32>(), reach_m as f32);
        let near = points.iter().filter(is_near).count();
        near as f64 / points.len() as f64
    }

    fn has_near(&self, point: &Point3<f32>, reach_m: f32) -> bool {
        let [x, y, z] = key_of(point, self.voxel_m);
        for i in x.saturating_sub(1)..=x.saturating_add(1) {
            for j in y.saturating_sub(1)..=y.saturating_add(1) {
                // The cells of one column are neighbours in the sorted list.
                let first = self.cells.partition_point(|cell| cell.key < [i, j, z.saturating_sub(1)]);
                let column = self.cells[first..].iter().take_while(|cell| cell.key <= [i, j, z.saturating_add(1)]);
                for cell in column {
                    if (cell.mean - point).norm_squared() <= reach_m * reach_m {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// The voxel means.
    pub fn points(&self) -> Vec<Point3<f64>> {
        self.cells.iter().map(|cell| cell.mean.cast::<f64>()).collect()
    }

    /// Keeps a caption if it is the best for its label.
    pub fn remember_caption(&mut self, label: &str, score: f32, caption: &str) {
        if caption.is_empty() {
            return;
        }
        let has_room = self.captions.len() < MAX_CAPTIONS;
        match self.captions.get_mut(label) {
            Some(best) if score > best.0 => *best = (score, caption.to_owned()),
            Some(_) => {}
            None if has_room => drop(self.captions.insert(label.to_owned(), (score, caption.to_owned()))),
            None => {}
        }
    }

    /// The best caption for a label.
    pub fn caption(&self, label: &str) -> Option<&str> {
        self.captions.get(label).map(|(_, caption)| caption.as_str())
    }

    /// Takes in the colour of one frame.
    pub fn remember_color(&mut self, color: [u8; 3]) {
        for (sum, channel) in self.color_sum.iter_mut().zip(color) {
            *sum += f64::from(channel);
        }
        self.color_count += 1;
    }

    /// Mean colour over frames.
    pub fn color(&self) -> Option<[u8; 3]> {
        let count = f64::from(self.color_count);
        (self.color_count > 0).then(|| self.color_sum.map(|sum| (sum / count).round() as u8))
    }
}

/// Means of the points per voxel: an even sample of a surface, at most `max` of them.
pub(crate) fn thin(points: &[Point3<f32>], max: usize) -> Vec<Point3<f64>> {
    let mut memory = ObjectMemory::default();
    memory.absorb(points, 0);
    let stride = memory.cells.len().div_ceil(max).max(1);
    memory.cells.iter().step_by(stride).map(|cell| cell.mean.cast::<f64>()).collect()
}

/// Box between the [`TRIM`] and `1 - TRIM` weighted percentiles of each axis.
pub(crate) fn robust_bounds(weighted: &[(Point3<f64>, f64)]) -> Option<Aabb> {
    if weighted.is_empty() {
        return None;
    }
    let total: f64 = weighted.iter().map(|(_, weight)| weight).sum();
    let mut bounds = Aabb::at(weighted[0].0);
    for axis in 0..3 {
        let mut along: Vec<(f64, f64)> = weighted.iter().map(|(point, weight)| (point[axis], *weight)).collect();
        along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        bounds.min[axis] = percentile(along.iter().copied(), TRIM * total);
        bounds.max[axis] = percentile(along.iter().rev().copied(), TRIM * total);
    }
    Some(bounds)
}

fn percentile(along: impl Iterator<Item = (f64, f64)>, weight: f64) -> f64 {
    let mut passed = 0.0;
    let mut last = 0.0;
    for (value, more) in along {
        passed += more;
        last = value;
        if passed > weight {
            break;
        }
    }
    last
}

pub(crate) fn key_of(point: &Point3<f32>, voxel_m: f64) -> [i32; 3] {
    [0, 1, 2].map(|k| (f64::from(point[k]) / voxel_m).floor() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    /// A 0.4 m square plate at x, in the y-z plane.
    fn plate(x: f32) -> Vec<Point3<f32>> {
        (0..400).map(|i| Point3::new(x, 0.02 * (i % 20) as f32, 0.02 * (i / 20) as f32)).collect()
    }

    #[test]
    fn stale_points_near_fresh_ones_go_and_far_ones_stay() {
        let mut memory = ObjectMemory::default();
        memory.absorb(&plate(0.0), 0);
        memory.absorb(&plate(1.0), 0);
        memory.absorb(&plate(0.2), 40 * SECOND_NS);
        memory.forget_smear(40 * SECOND_NS);
        let bounds = memory.bounds().unwrap();
        assert!((bounds.min.x - 0.2).abs() < 0.01, "the plate has followed: {bounds:?}");
        assert!((bounds.max.x - 1.0).abs() < 0.01, "the far side is still there: {bounds:?}");
    }

    #[test]
    fn a_glimpse_of_a_corner_does_not_eat_the_rest() {
        // Found by bench map: bins and keyboards shrank to a few centimetres when they were seen again from afar.
        let mut memory = ObjectMemory::default();
        memory.absorb(&plate(0.0), 0);
        let whole = memory.bounds().unwrap();
        let corner: Vec<Point3<f32>> = plate(0.01).into_iter().filter(|p| p.y < 0.11 && p.z < 0.11).collect();
        memory.absorb(&corner, 60 * SECOND_NS);
        memory.forget_smear(60 * SECOND_NS);
        let bounds = memory.bounds().unwrap();
        assert!((bounds.sides_m() - whole.sides_m()).norm() < 0.03, "{bounds:?}");
    }

    #[test]
    fn the_set_is_bounded_and_keeps_its_extent() {
        let mut memory = ObjectMemory::default();
        let sheet: Vec<_> =
            (0..40_000).map(|i| Point3::new(0.02 * (i % 200) as f32, 0.02 * (i / 200) as f32, 0.0)).collect();
        memory.absorb(&sheet, 0);
        assert!(memory.cells.len() <= MAX_CELLS);
        assert!((memory.bounds().unwrap().sides_m().x - 4.0).abs() < 0.4);
    }

    #[test]
    fn what_hangs_on_a_wall_is_flat_whatever_its_mask_took_along() {
        let mut memory = ObjectMemory::default();
        for frame in 0..10 {
            memory.absorb(&plate(0.0), frame * SECOND_NS);
        }
        let behind: Vec<Point3<f32>> = plate(0.3).into_iter().filter(|p| p.y < 0.1).collect();
        for frame in 0..5 {
            memory.absorb(&behind, frame * SECOND_NS);
        }
        assert!(memory.bounds().unwrap().sides_m().x > 0.25);
        let flat = memory.flat_bounds().unwrap();
        assert!(flat.sides_m().x < 0.05 && flat.sides_m().y > 0.3, "{flat:?}");
    }

    #[test]
    fn a_few_wild_points_do_not_move_the_box() {
        let mut memory = ObjectMemory::default();
        for frame in 0..10 {
            memory.absorb(&plate(0.0), frame * SECOND_NS);
        }
        memory.absorb(&[Point3::new(3.0, 0.0, 0.0)], 10 * SECOND_NS);
        assert!(memory.bounds().unwrap().max.x < 0.05);
    }

    #[test]
    fn merging_memories_keeps_all_hits() {
        let (mut a, mut b) = (ObjectMemory::default(), ObjectMemory::default());
        a.absorb(&plate(0.0), 0);
        b.absorb(&plate(0.0), SECOND_NS);
        let hits = |memory: &ObjectMemory| memory.cells.iter().map(|cell| u32::from(cell.hits)).sum::<u32>();
        let both = hits(&a) + hits(&b);
        a.merge(b);
        assert_eq!(hits(&a), both);
    }
}
