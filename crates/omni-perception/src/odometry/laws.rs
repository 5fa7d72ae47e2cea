//! Generators for the laws of the filter's private parts, and the laws that join several of them: long runs, and scans put
//! into the map twice.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use crate::odometry::config::LioConfig;
use crate::odometry::degeneracy::Degeneracy;
use crate::odometry::filter::{Belief, standing};
use crate::odometry::propagation::{ImuInput, Inflation, propagate_covariance, step, symmetric};
use crate::odometry::state::{Covariance, DOF, GRAVITY_MPS2, ImuState, Tangent};
use crate::odometry::sweep::{SensorMotion, Sweep, SweepLimits};
use crate::odometry::tracking::{Tracked, additions};
use crate::odometry::update::{PlaneResidual, update};
use crate::odometry::voxel_map::{Cell, VoxelMap};
use crate::{EncoderTrack, RawPoint, RawScan, RotatingMount, Stamp};

pub(crate) fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

pub(crate) fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    vector(3.0).prop_map(UnitQuaternion::from_scaled_axis)
}

/// Any state, and any correlations of the size of a tracked state's.
pub(crate) fn belief() -> impl Strategy<Value = Belief> {
    let state = (vector(10.0), rotation(), vector(3.0), vector(0.05), vector(0.3), rotation());
    (state, prop::collection::vec(-1.0..1.0_f64, DOF * DOF)).prop_map(|((p, rotation, v, bg, ba, gravity_frame), m)| {
        let factor = Covariance::from_column_slice(&m) * 0.02;
        Belief {
            state: ImuState {
                stamp: Stamp(7_000_000_000),
                position_m: p,
                rotation,
                velocity_mps: v,
                gyro_bias_radps: bg,
                accel_bias_mps2: ba,
                gravity_frame,
            },
            covariance: symmetric(&(factor * factor.transpose() + Covariance::identity() * 1e-6)),
        }
    })
}

/// The belief in a state that is off by an error.
pub(crate) fn off_by(belief: &Belief, error: &Tangent) -> Belief {
    Belief { state: belief.state.boxplus(error), covariance: belief.covariance }
}

/// A tenth of a second of the filter's life.
#[derive(Debug, Clone)]
struct Tenth {
    rate_radps: Vector3<f64>,
    push_mps2: Vector3<f64>,
    /// A gap or a saturated sample.
    is_doubtful: bool,
    /// Points, raw normals, heights above the planes.
    planes: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
    /// How many axes of translation and of rotation the planes say nothing about.
    held: (usize, usize),
    axes: UnitQuaternion<f64>,
    is_standing: bool,
}

fn tenth() -> impl Strategy<Value = Tenth> {
    let plane = (vector(8.0), vector(1.0), -0.03..0.03_f64);
    let planes = prop_oneof![1 => Just(Vec::new()), 4 => prop::collection::vec(plane, 1..60)];
    let held =
        prop_oneof![3 => Just((0, 0)), 3 => Just((1, 0)), 1 => Just((2, 1)), 1 => Just((3, 0)), 1 => Just((3, 3))];
    (vector(8.0), vector(5.0), prop::bool::weighted(0.05), planes, held, rotation(), prop::bool::weighted(0.2))
        .prop_map(|(rate_radps, push_mps2, is_doubtful, planes, held, axes, is_standing)| Tenth {
            rate_radps,
            push_mps2,
            is_doubtful,
            planes,
            held,
            axes,
            is_standing,
        })
}

/// One scan's worth of the filter, each of its parts in turn. Calls `check` after each.
fn live(belief: &Belief, tenth: &Tenth, mut check: impl FnMut(&'static str, &Belief)) -> Belief {
    let config = LioConfig::default();
    let Belief { mut state, mut covariance } = *belief;
    for _ in 0..20 {
        let until = state.stamp.plus_ns(5_000_000);
        let force_mps2 = tenth.push_mps2 + state.rotation.inverse() * Vector3::z() * GRAVITY_MPS2;
        let input = ImuInput { rate_radps: tenth.rate_radps, force_mps2, is_coasting: false };
        let inflation = if tenth.is_doubtful { Inflation { gyro: 1e6, accel: 1e4 } } else { Inflation::NONE };
        covariance = propagate_covariance(&covariance, &state, &input, until, &config, inflation);
        state = step(&state, &input, until).0;
    }
    let mut belief = Belief { state, covariance };
    check("propagated", &belief);
    let residuals: Vec<PlaneResidual> = tenth
        .planes
        .iter()
        .filter_map(|(point, normal, height_m)| {
            let normal = normal.try_normalize(0.05)?;
            let distance_m = normal.dot(&(state.rotation * point + state.position_m)) - height_m;
            Some(PlaneResidual { point: *point, normal, distance_m, variance_m2: 4e-4 })
        })
        .collect();
    let axes = tenth.axes.to_rotation_matrix().into_inner();
    let first = |count: usize| (0..count).map(|k| axes.column(k).into_owned()).collect();
    let held = Degeneracy { translations: first(tenth.held.0), rotations: first(tenth.held.1), weakest_cells: 0.0 };
    let keep: Matrix6<f64> = held.keep();
    let updated = update(&belief.state, &belief.covariance, &belief.state, &residuals, 4, |_| keep);
    let updated = updated.expect("the covariance of the pose is positive definite");
    belief = Belief { state: updated.state, covariance: updated.covariance };
    check("updated", &belief);
    if tenth.is_standing {
        belief = standing(&belief).expect("the covariance of the velocity is positive definite");
        check("standing", &belief);
    }
    belief
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn covariance_stays_symmetric_and_positive_definite_for_hundreds_of_scans(
        start in belief(), tenths in prop::collection::vec(tenth(), 200..300)
    ) {
        let mut belief = start;
        for (number, tenth) in tenths.iter().enumerate() {
            let mut failure = None;
            belief = live(&belief, tenth, |part, belief| {
                let covariance = &belief.covariance;
                let is_sound = *covariance == covariance.transpose() && covariance.cholesky().is_some();
                if !(is_sound && belief.state.is_finite()) {
                    failure.get_or_insert((part, covariance.symmetric_eigenvalues()));
                }
            });
            prop_assert!(failure.is_none(), "scan {}: {:?}", number, failure);
        }
    }
}

/// How far planes move when the scan they were made of comes again, once or several times: half of them, 99 of 100, all;
/// and the share that is given up, of thin cells that the first scan let borrow points from farther off. Measured over a
/// hundred rooms: 0, 2.6 and 12 mm for once, and one room in some hundred gives up 1.4 % (the last of the regressions); for
/// 79 times 0.1, 6.7, 25 mm and 3 %. The limits are twice that.
const TWICE: [f64; 4] = [1e-4, 0.005, 0.03, 0.03];
const OFTEN: [f64; 4] = [5e-4, 0.014, 0.05, 0.06];

/// A scan without motion: rays to all sides in a room of three sizes, from a place inside, with 1.5 cm of noise.
fn scan_of_room(half_m: &Vector3<f64>, world_from_imu: &Isometry3<f64>, seed: u64) -> RawScan {
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut points = Vec::new();
    for k in 0..12_000 {
        // A spiral on the sphere: as even as can be.
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 12_000.0;
        let around = 2.399_963 * f64::from(k);
        let direction = Vector3::new((1.0 - z * z).sqrt() * around.cos(), (1.0 - z * z).sqrt() * around.sin(), z);
        let in_world = world_from_imu.rotation * direction;
        let to_wall = |axis: usize| {
            let wall = half_m[axis].copysign(in_world[axis]);
            (wall - world_from_imu.translation.vector[axis]) / in_world[axis]
        };
        let range_m = (0..3).map(to_wall).fold(f64::INFINITY, f64::min);
        let noise_m = 0.015 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
        points.push(RawPoint {
            position: Point3::from(direction * (range_m + noise_m)).cast(),
            offset_ns: 5_000 * k as u32,
            ring: 0,
        });
    }
    RawScan { start: Stamp(7_000_000_000), points }
}

/// Puts a scan from a body that stands into the map, as `Filter::step` does. The number of points that fell into cells.
fn put(scan: &RawScan, world_from_imu: &Isometry3<f64>, map: &mut VoxelMap, sweep: &mut Sweep) -> usize {
    let still = ImuState {
        position_m: world_from_imu.translation.vector,
        rotation: world_from_imu.rotation,
        ..ImuState::at_rest(scan.start)
    };
    let weight = ImuInput {
        rate_radps: Vector3::zeros(),
        force_mps2: still.rotation.inverse() * -still.gravity_mps2(),
        is_coasting: false,
    };
    let (_, knot) = step(&still, &weight, scan.end());
    let mount = RotatingMount { body_from_stator: Isometry3::identity(), rotor_from_sensor: Isometry3::identity() };
    let motion = SensorMotion::new(scan, scan.end(), &[knot], &EncoderTrack::fixed(), &mount, map).expect("covered");
    let gate_m = (2.2 * map.plane_thickness_m()) as f32;
    sweep.collect(scan, &motion, map, &SweepLimits { min_range_m: 0.1, max_range_m: 100.0, gate_m, stride: 1 }, 1);
    let tracked = Tracked {
        updated: None,
        swept_with: *world_from_imu,
        sensor: Point3::from(still.position_m),
        degeneracy: Degeneracy::default(),
        residuals: 0,
        inliers: 0,
        outliers: 0,
        iterations: 0,
        rmse_m: 0.0,
    };
    map.insert(&additions(sweep, map, &tracked, world_from_imu));
    sweep.points()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    #[test]
    fn the_same_scan_again_adds_nothing_and_moves_no_plane(
        half in prop::array::uniform3(1.5..4.0_f64), place in prop::array::uniform3(-0.6..0.6_f64), turn in rotation(),
        seed in any::<u64>()
    ) {
        let half = Vector3::from(half);
        let world_from_imu = Isometry3::from_parts(Translation3::from(half.component_mul(&Vector3::from(place))), turn);
        let scan = scan_of_room(&half, &world_from_imu, seed);
        let mut map = VoxelMap::new(0.25, 100_000, 60, 0.06);
        let mut sweep = Sweep::default();
        let points = put(&scan, &world_from_imu, &mut map, &mut sweep);
        let before = map.clone();
        // What the notes mean by idempotent. A cell is not refused its second scan: it counts twice, and is fitted again
        // until it is finished. So its plane may move by the little that the first scan left open, and no more.
        let voxels = |map: &VoxelMap| map.cells().iter().map(|cell| cell.key).collect::<BTreeSet<_>>();
        let height = |cell: &Cell, at: [f32; 3]| {
            let [x, y, z, offset] = cell.plane;
            f64::from(x * at[0] + y * at[1] + z * at[2] + offset)
        };
        for again in 1..8 {
            let last = map.clone();
            prop_assert_eq!(put(&scan, &world_from_imu, &mut map, &mut sweep), points);
            map.check_invariants();
            // Not one new voxel; now and then the other side of one at an edge.
            prop_assert_eq!(voxels(&map), voxels(&before));
            prop_assert!(map.len() as f64 <= 1.01 * before.len() as f64, "{} {}", map.len(), before.len());
            // A finished cell does not change by a bit.
            for (old, new) in last.cells().iter().zip(map.cells()).filter(|(old, _)| old.count >= 60.0) {
                prop_assert_eq!((old.count, old.mean_m, old.plane), (new.count, new.mean_m, new.plane));
            }
            // The planes stay where they are: so far at the middle of their points.
            let (mut moves_m, mut lost) = (Vec::new(), 0);
            for (old, new) in before.cells().iter().zip(map.cells()).filter(|(old, _)| old.has_plane()) {
                match new.has_plane() {
                    true => moves_m.push((height(old, old.mean_m) - height(new, old.mean_m)).abs()),
                    false => lost += 1,
                }
            }
            moves_m.sort_by(f64::total_cmp);
            let count = moves_m.len();
            let [middle_m, most_m, all_m] = [moves_m[count / 2], moves_m[count * 99 / 100], moves_m[count - 1]];
            let limits = if again == 1 { TWICE } else { OFTEN };
            prop_assert!(
                middle_m < limits[0] && most_m < limits[1] && all_m < limits[2] && f64::from(lost) < limits[3] * count as f64,
                "{}: {} {} {}, {} lost of {}", again, middle_m, most_m, all_m, lost, count
            );
        }
    }
}
