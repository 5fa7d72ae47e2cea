//! A scan put to the map: each point at its own time, added up by the cell of the map it falls into.
//!
//! One pass over the points does three things that other odometries do one after the other: straightening (knots of
//! the IMU and the motor's angle), thinning (all points of a cell become one weighted point; nothing is thrown away),
//! and association (the cell's plane is at hand, so each point is tested against it alone). The sums are integers
//! (micrometres), so they are exact: neither the order of the points nor the number of threads changes a bit.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rustc_hash::FxHashMap;

use crate::odometry::plane::Moments;
use crate::odometry::propagation::Knot;
use crate::odometry::voxel_map::{NO_CELL, VoxelKey, VoxelMap};
use crate::{Dropped, EncoderTrack, RawPoint, RawScan, RotatingMount, Stamp};

/// Time between exact transforms. Between them matrices are blended; at 20 rad/s that is off by
/// (20 * 5e-4)^2 / 8 = 1e-5 of the range, a tenth of a millimetre at 10 m.
const STEP_NS: u32 = 500_000;
/// Units of the sums in a metre.
const UNITS_PER_M: f32 = 1_048_576.0;
/// Beams with a memory of their last cell.
const RINGS: usize = 128;
/// How far the encoder may be continued beyond its last reading.
const ENCODER_EXTRAPOLATION_S: f64 = 0.01;

/// The points of one scan inside one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Patch {
    pub key: VoxelKey,
    /// The cell of the map, or [`NO_CELL`].
    pub cell: u32,
    /// The cell's plane; zero if it has none.
    plane: [f32; 4],
    /// Points that agree with the plane (all points, where there is none).
    pub count: u32,
    /// Points that do not.
    pub outliers: u32,
    sum: [i64; 3],
    scatter: [i64; 6],
}

impl Patch {
    pub(crate) fn has_plane(&self) -> bool {
        self.plane[..3] != [0.0; 3]
    }

    /// Mean of the points, from the middle of the voxel.
    pub(crate) fn mean(&self) -> Vector3<f64> {
        let share = 1.0 / (f64::from(UNITS_PER_M) * f64::from(self.count.max(1)));
        Vector3::from(self.sum.map(|s| s as f64 * share))
    }

    /// Moments of the points, from the middle of the voxel.
    pub(crate) fn moments(&self) -> Moments {
        if self.count == 0 {
            return Moments::default();
        }
        let unit = 1.0 / f64::from(UNITS_PER_M);
        let count = f64::from(self.count);
        let mean = Vector3::from(self.sum.map(|s| s as f64 * unit)) / count;
        let [xx, xy, xz, yy, yz, zz] = self.scatter.map(|s| s as f64 * unit * unit);
        let about_middle = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Moments { count, mean, scatter: about_middle - mean * mean.transpose() * count }
    }

    /// Takes over the points of the same cell from another part of the scan.
    fn join(&mut self, other: &Patch) {
        self.count += other.count;
        self.outliers += other.outliers;
        self.sum.iter_mut().zip(other.sum).for_each(|(sum, more)| *sum += more);
        self.scatter.iter_mut().zip(other.scatter).for_each(|(sum, more)| *sum += more);
    }

    fn add(&mut self, units: [i32; 3]) {
        let [x, y, z] = units.map(i64::from);
        self.count += 1;
        self.sum[0] += x;
        self.sum[1] += y;
        self.sum[2] += z;
        self.scatter[0] += x * x;
        self.scatter[1] += x * y;
        self.scatter[2] += x * z;
        self.scatter[3] += y * y;
        self.scatter[4] += y * z;
        self.scatter[5] += z * z;
    }
}

/// Where the sensor was at any time of a scan, relative to a corner of a voxel near it.
pub(crate) struct SensorMotion {
    /// Voxel whose low corner is the origin.
    pub anchor: VoxelKey,
    nodes: Vec<Option<(Matrix3<f32>, Vector3<f32>)>>,
    /// The sensor in the middle of the scan.
    pub sensor: Vector3<f32>,
}

impl SensorMotion {
    /// The chain world <- IMU <- stator <- rotor <- sensor at steps of half a millisecond.
    pub(crate) fn new(
        scan: &RawScan,
        end: Stamp,
        knots: &[Knot],
        encoder: &EncoderTrack,
        imu_mount: &RotatingMount,
        map: &VoxelMap,
    ) -> Option<SensorMotion> {
        let first = knots.first()?;
        let anchor = map.key(&Point3::from(first.position_m))?;
        let corner = map.centre(anchor).coords - Vector3::repeat(0.5 * f64::from(map.cell_m()));
        let steps = (end.0.saturating_sub(scan.start.0).max(0) as u64 / u64::from(STEP_NS)) as u32 + 1;
        let mut at = 0;
        let mut exact = |step: u32| -> Option<Isometry3<f64>> {
            let stamp = scan.start.plus_ns(i64::from(step) * i64::from(STEP_NS));
            while at + 1 < knots.len() && knots[at + 1].stamp <= stamp {
                at += 1;
            }
            // A knot may be continued backwards a little, for points just before the last scan's end.
            if stamp.seconds_since(knots[at].stamp) < -0.02 {
                return None;
            }
            let angle = encoder.extrapolated_angle_rad(stamp, ENCODER_EXTRAPOLATION_S)?;
            Some(knots[at].world_from_imu(stamp) * imu_mount.body_from_sensor(angle))
        };
        let nodes: Vec<_> = (0..=steps)
            .map(|step| {
                let transform = exact(step)?;
                let matrix = transform.rotation.to_rotation_matrix().into_inner();
                Some((matrix.cast::<f32>(), (transform.translation.vector - corner).cast::<f32>()))
            })
            .collect();
        let sensor = nodes[nodes.len() / 2].or_else(|| nodes.iter().flatten().next().copied())?.1;
        Some(SensorMotion { anchor, nodes, sensor })
    }

    fn at(&self, offset_ns: u32) -> Option<(Matrix3<f32>, Vector3<f32>)> {
        let step = (offset_ns / STEP_NS) as usize;
        let (from, to) = ((*self.nodes.get(step)?)?, (*self.nodes.get(step + 1)?)?);
        let share = (offset_ns % STEP_NS) as f32 / STEP_NS as f32;
        Some((from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share))
    }
}

/// Which points count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SweepLimits {
    pub min_range_m: f32,
    pub max_range_m: f32,
    /// Largest distance from the plane.
    pub gate_m: f32,
    /// Every n-th point is used.
    pub stride: usize,
}

/// The patches of a scan, and buffers that live from scan to scan.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sweep {
    /// The patches of the last scan, ordered by voxel.
    pub patches: Vec<Patch>,
    /// What was left out.
    pub dropped: Dropped,
    parts: Vec<Part>,
}

impl Sweep {
    /// Adds up the points of a scan, in as many parts as there are `threads`.
    pub(crate) fn collect(
        &mut self,
        scan: &RawScan,
        motion: &SensorMotion,
        map: &VoxelMap,
        limits: &SweepLimits,
        threads: usize,
    ) {
        self.parts.resize_with(threads.max(1), Part::default);
        let size = scan.points.len().div_ceil(self.parts.len()).next_multiple_of(limits.stride).max(1);
        let mut chunks = scan.points.chunks(size);
        let (first, others) = self.parts.split_first_mut().expect("there is at least one part");
        std::thread::scope(|scope| {
            let first_chunk = chunks.next().unwrap_or(&[]);
            for part in others {
                let chunk = chunks.next().unwrap_or(&[]);
                scope.spawn(|| part.collect(chunk, motion, map, limits));
            }
            first.collect(first_chunk, motion, map, limits);
        });
        self.join();
    }

    /// Points in all patches.
    pub(crate) fn points(&self) -> usize {
        self.patches.iter().map(|patch| (patch.count + patch.outliers) as usize).sum()
    }

    /// Puts the parts together. The sums are whole numbers: where the scan was cut does not show.
    fn join(&mut self) {
        self.patches.clear();
        self.dropped = Dropped::default();
        for part in &self.parts {
            self.patches.extend_from_slice(&part.patches);
            self.dropped.non_finite += part.dropped.non_finite;
            self.dropped.outside_time += part.dropped.outside_time;
            self.dropped.too_near += part.dropped.too_near;
            self.dropped.too_far += part.dropped.too_far;
        }
        self.patches.sort_unstable_by_key(|patch| patch.key);
        self.patches.dedup_by(|next, kept| {
            let is_same = next.key == kept.key;
            if is_same {
                kept.join(next);
            }
            is_same
        });
    }
}

/// What one thread adds up.
#[derive(Debug, Clone, Default)]
struct Part {
    patches: Vec<Patch>,
    patch_of_voxel: FxHashMap<[i32; 3], u32>,
    dropped: Dropped,
}

impl Part {
    fn collect(&mut self, points: &[RawPoint], motion: &SensorMotion, map: &VoxelMap, limits: &SweepLimits) {
        self.patches.clear();
        self.patch_of_voxel.clear();
        self.dropped = Dropped::default();
        let (min2, max2) = (limits.min_range_m.powi(2), limits.max_range_m.powi(2));
        let (cell_m, cells_per_m) = (map.cell_m(), 1.0 / map.cell_m());
        let mut last = (u32::MAX, None);
        let mut last_of_ring = [([i32::MIN; 3], 0_u32); RINGS];
        for point in points.iter().step_by(limits.stride) {
            let RawPoint { position, offset_ns, ring } = point;
            let square = position.coords.norm_squared();
            // Written so that NaN goes here as well.
            if !(square >= min2 && square <= max2) {
                count_dropped(&mut self.dropped, square, min2);
                continue;
            }
            // The points of one column share their time.
            if *offset_ns != last.0 || last.1.is_none() {
                last = (*offset_ns, motion.at(*offset_ns));
            }
            let Some((matrix, offset)) = &last.1 else {
                self.dropped.outside_time += 1;
                continue;
            };
            let world = matrix * position.coords + offset;
            let local = world.map(|x| (x * cells_per_m).floor());
            let voxel = [local.x as i32, local.y as i32, local.z as i32];
            let from_middle = world - local.map(|x| (x + 0.5) * cell_m);
            // Neighbouring returns of a beam mostly fall into one cell.
            let memory = &mut last_of_ring[usize::from(*ring) % RINGS];
            if memory.0 != voxel {
                *memory = (voxel, self.patch(voxel, motion, map));
            }
            let patch = &mut self.patches[memory.1 as usize];
            let [x, y, z, height] = patch.plane;
            let distance = x * from_middle.x + y * from_middle.y + z * from_middle.z + height;
            // Without a plane the distance is zero.
            if distance.abs() > limits.gate_m {
                patch.outliers += 1;
                continue;
            }
            let units = from_middle * UNITS_PER_M;
            patch.add([units.x as i32, units.y as i32, units.z as i32]);
        }
    }

    fn patch(&mut self, voxel: [i32; 3], motion: &SensorMotion, map: &VoxelMap) -> u32 {
        let patches = &mut self.patches;
        *self.patch_of_voxel.entry(voxel).or_insert_with(|| {
            let key = [0, 1, 2].map(|k| motion.anchor[k].saturating_add(voxel[k]));
            let middle = Vector3::from(voxel.map(|k| (k as f32 + 0.5) * map.cell_m()));
            let cell = map.cell_towards(key, &(motion.sensor - middle));
            let plane = if cell == NO_CELL { [0.0; 4] } else { map.cells()[cell as usize].plane };
            patches.push(Patch { key, cell, plane, count: 0, outliers: 0, sum: [0; 3], scatter: [0; 6] });
            (patches.len() - 1) as u32
        })
    }
}

#[cold]
fn count_dropped(dropped: &mut Dropped, square: f32, min2: f32) {
    match square {
        _ if !square.is_finite() => dropped.non_finite += 1,
        _ if square < min2 => dropped.too_near += 1,
        _ => dropped.too_far += 1,
    }
}
