//! Laws of registration on rooms of boxes, and the real pair of scans in ../shared/data/lidar where that folder exists.

#[path = "support/rooms.rs"]
#[allow(dead_code)]
mod rooms;

use nalgebra::{Isometry3, Matrix4, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::registration::fit;
use omni_perception::{Freedom, RegistrationConfig, register};
use proptest::prelude::*;
use rooms::Building;

fn config() -> RegistrationConfig {
    RegistrationConfig { leaf_m: 0.10, ..RegistrationConfig::default() }
}

fn moved(cloud: &[Point3<f32>], by: &Isometry3<f64>) -> Vec<Point3<f32>> {
    cloud.iter().map(|point| (by * point.cast::<f64>()).cast::<f32>()).collect()
}

fn motion(most_m: f64, most_rad: f64) -> impl Strategy<Value = Isometry3<f64>> {
    let vector = |most: f64| proptest::array::uniform3(-most..most).prop_map(Vector3::from);
    (vector(most_m), vector(most_rad)).prop_map(|(shift, turn)| Isometry3::new(shift, turn))
}

/// 1.5 cm of noise on a few thousand points, thinned on grids that lie differently.
const SHIFT_TOL_M: f64 = 0.01;
const TURN_TOL_RAD: f64 = 0.004;

fn is_same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    let difference = a.inverse() * b;
    difference.translation.vector.norm() < SHIFT_TOL_M && difference.rotation.angle() < TURN_TOL_RAD
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Two looks at a room from different places give the way between them; the other way round gives the inverse.
    #[test]
    fn the_motion_between_two_scans_is_found_both_ways(seed in 0..1000u64, step in motion(0.25, 0.12)) {
        let building = Building::drawn(seed, 1);
        let at = building.free_pose(0, seed);
        // Level poses for the rays, then one cloud is tilted.
        let (a, b) = (building.scan(&at, 0.015, seed), building.scan(&at, 0.015, seed + 1));
        let b = moved(&b, &step);
        let there = register(&a, &b, &Isometry3::identity(), &config()).unwrap();
        let back = register(&b, &a, &Isometry3::identity(), &config()).unwrap();
        prop_assert!(there.converged && there.covariance.cholesky().is_some());
        prop_assert!(is_same(&there.target_from_source, &step), "{} for {}", there.target_from_source, step);
        prop_assert!(is_same(&back.target_from_source, &step.inverse()));
    }

    /// Where both clouds are moved together, so is the answer.
    #[test]
    fn a_motion_of_the_world_changes_nothing(seed in 0..1000u64, world in motion(20.0, 2.0)) {
        let building = Building::drawn(seed, 1);
        let at = building.free_pose(0, seed);
        let step = Isometry3::new(Vector3::new(0.1, 0.05, -0.02), Vector3::new(0.0, 0.02, 0.06));
        let (a, b) = (building.scan(&at, 0.015, seed), moved(&building.scan(&at, 0.015, seed + 1), &step));
        let found = register(&a, &moved(&b, &world), &world, &config()).unwrap();
        prop_assert!(is_same(&found.target_from_source, &(world * step)));
        let found = register(&moved(&a, &world), &b, &world.inverse(), &config()).unwrap();
        // Compared where the clouds are: an angle at the far origin would be metres there.
        prop_assert!(is_same(&(found.target_from_source * world), &step));
    }

    /// A level registration stays level, whatever the clouds would like.
    #[test]
    fn level_stays_level(seed in 0..1000u64, tilt in -0.05..0.05f64, yaw in -0.1..0.1f64) {
        let building = Building::drawn(seed, 1);
        let at = building.free_pose(0, seed);
        let step = Isometry3::new(Vector3::new(0.1, 0.05, 0.0), Vector3::new(tilt, 0.0, yaw));
        let (a, b) = (building.scan(&at, 0.015, seed), moved(&building.scan(&at, 0.015, seed + 1), &step));
        let level = RegistrationConfig { freedom: Freedom::Level, ..config() };
        let found = register(&a, &b, &Isometry3::identity(), &level).unwrap();
        let up = found.target_from_source.rotation * Vector3::z();
        prop_assert!((up - Vector3::z()).norm() < 1e-12);
        prop_assert_eq!(found.covariance[(3, 3)], 0.0);
    }
}

/// The errors over many noises are of the size that the covariance says: their mean square in its units is about six.
#[test]
fn the_covariance_is_of_the_right_size() {
    let building = Building::drawn(5, 1);
    let at = building.free_pose(0, 5);
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 0..24 {
        let (a, b) = (building.scan(&at, 0.015, 2 * seed), building.scan(&at, 0.015, 2 * seed + 1));
        let found = register(&a, &b, &Isometry3::identity(), &config()).unwrap();
        let (shift, turn) =
            (found.target_from_source.translation.vector, found.target_from_source.rotation.scaled_axis());
        let error = nalgebra::Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
        sum += error.dot(&(found.covariance.try_inverse().expect("it is positive definite") * error));
        count += 1.0;
    }
    let mean: f64 = sum / count;
    assert!((1.0..30.0).contains(&mean), "{mean}, expected about 6");
}

#[test]
fn the_same_clouds_give_the_same_bytes() {
    let building = Building::drawn(9, 2);
    let at = building.free_pose(1, 9);
    let (a, b) = (building.scan(&at, 0.015, 1), building.scan(&at, 0.015, 2));
    let once = register(&a, &b, &Isometry3::identity(), &config()).unwrap();
    assert_eq!(once, register(&a, &b, &Isometry3::identity(), &config()).unwrap());
}

/// Two scans of a spinning LiDAR with the pose between them (koide3/small_gicp, MIT). Its own GICP gets 0.7 cm, 0.33 degrees, and
/// root mean squares of 0.1988 m and 0.0888 m over all pairs within 1 m and 0.3 m.
#[test]
fn the_real_pair_is_aligned_as_well_as_its_peer_does_it() {
    let Some((source, target, truth)) = real_pair() else {
        println!("skipped: ../shared/data/lidar is not there");
        return;
    };
    let found = register(&source, &target, &Isometry3::identity(), &RegistrationConfig::default()).unwrap();
    let error = truth.inverse() * found.target_from_source;
    assert!(error.translation.vector.norm() <= 0.015, "{}", error.translation.vector.norm());
    assert!(error.rotation.angle().to_degrees() <= 0.45, "{}", error.rotation.angle().to_degrees());
    assert!(fit(&source, &target, &found.target_from_source, 1.0).rmse_m <= 0.1988);
    assert!(fit(&source, &target, &found.target_from_source, 0.3).rmse_m <= 0.0888);
}

/// Source, target, and the pose of the source in the target.
#[allow(clippy::type_complexity)] // source, target, pose
fn real_pair() -> Option<(Vec<Point3<f32>>, Vec<Point3<f32>>, Isometry3<f64>)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/lidar/");
    let cloud = |name: &str| -> Option<Vec<Point3<f32>>> {
        const END: &[u8] = b"end_header\n";
        let bytes = std::fs::read(format!("{folder}{name}")).ok()?;
        let body = bytes.windows(END.len()).position(|window| window == END)? + END.len();
        let float = |row: &[u8], at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
        Some(bytes[body..].chunks_exact(16).map(|r| Point3::new(float(r, 0), float(r, 4), float(r, 8))).collect())
    };
    let text = std::fs::read_to_string(format!("{folder}gicp_T_target_source.txt")).ok()?;
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
    let m = Matrix4::from_row_slice(&numbers);
    let truth = Isometry3::from_parts(
        Translation3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)]),
        UnitQuaternion::from_matrix(&m.fixed_view::<3, 3>(0, 0).into_owned()),
    );
    Some((cloud("gicp_source.ply")?, cloud("gicp_target.ply")?, truth))
}
