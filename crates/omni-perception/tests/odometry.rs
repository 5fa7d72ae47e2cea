//! The odometry on small simulated drives: what it must do, and what it must survive.

mod support;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::*;
use support::drive::*;

/// The worst errors, shown with --nocapture.
fn worst(errors: &[(f64, f64)]) -> (f64, f64) {
    let worst = support::drive::worst(errors);
    println!("worst {:.4} m {:.3} deg", worst.0, worst.1);
    worst
}

/// Estimates of the scans that were tracked.
fn estimates(run: &[(ScanReport, Option<OdometryEstimate>)]) -> Vec<OdometryEstimate> {
    let is_tracked = |(report, _): &&(ScanReport, _)| report.status != TrackingStatus::Initialising;
    run.iter().filter(is_tracked).filter_map(|(_, estimate)| *estimate).collect()
}

fn count(run: &[(ScanReport, Option<OdometryEstimate>)], status: TrackingStatus) -> usize {
    run.iter().filter(|(report, _)| report.status == status).count()
}

#[test]
fn a_walk_is_followed_to_the_millimetre() {
    let drive = Drive::new(walk);
    let mut odometry = odometry(LioConfig::default());
    let run = drive.run(&mut odometry);
    let estimates = estimates(&run);
    assert!(estimates.len() >= 54, "{}", estimates.len());
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates));
    assert!(position_m < 0.008 && rotation_deg < 0.15, "{position_m} m, {rotation_deg} deg");
    assert_eq!(count(&run, TrackingStatus::Lost) + count(&run, TrackingStatus::Degenerate), 0);
    odometry.map().check_invariants();
    // The body begins in the origin, level, looking along x.
    let first = estimates[0].world_from_body;
    assert!(first.translation.vector.norm() < 0.01, "{first}");
    let (_, _, yaw) = first.rotation.euler_angles();
    assert!(yaw.abs() < 0.01);
    // Velocity and rate of the body, in the body's own frame of reference.
    let last = odometry.estimate();
    let t = last.stamp.seconds_since(Stamp(0));
    let body = |t: f64| walk(t) * body_from_imu().inverse();
    let (before, after) = (body(t - 1e-3), body(t + 1e-3));
    let speed = (after.translation.vector - before.translation.vector).norm() / 2e-3;
    assert!((last.velocity_in_world_mps.norm() - speed).abs() < 0.02);
    let rate = (before.rotation.inverse() * after.rotation).scaled_axis() / 2e-3;
    assert!((last.angular_velocity_in_body_radps - rate).norm() < 0.05);
    // The covariance is of the size of the errors.
    let sigma_m = last.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
    assert!((1e-5..0.02).contains(&sigma_m), "{sigma_m}");
}

#[test]
fn noise_settings_wrong_by_a_factor_of_three_only_degrade() {
    let drive = Drive { to_s: 5.0, ..Drive::new(walk) };
    for factor in [0.3, 3.0] {
        let usual = LioConfig::default();
        let config = LioConfig {
            gyro_noise_density: usual.gyro_noise_density * factor,
            accel_noise_density: usual.accel_noise_density * factor,
            gyro_bias_walk_density: usual.gyro_bias_walk_density * factor,
            accel_bias_walk_density: usual.accel_bias_walk_density * factor,
            range_sigma_m: usual.range_sigma_m * factor,
            ..usual
        };
        let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&drive.run(&mut odometry(config)))));
        assert!(position_m < 0.02 && rotation_deg < 0.3, "{factor}: {position_m} m, {rotation_deg} deg");
    }
}

#[test]
fn noise_settings_wrong_in_any_direction_only_degrade() {
    // Each of the five by a factor of its own between 0.3 and 3, even in the logarithm.
    let drive = Drive { to_s: 4.0, columns: 160, ..Drive::new(walk) };
    let mut noise = support::Noise(2024);
    for case in 0..5 {
        let factors = [(); 5].map(|()| 0.3_f64 * 10.0_f64.powf(noise.uniform()));
        let usual = LioConfig::default();
        let config = LioConfig {
            gyro_noise_density: usual.gyro_noise_density * factors[0],
            accel_noise_density: usual.accel_noise_density * factors[1],
            gyro_bias_walk_density: usual.gyro_bias_walk_density * factors[2],
            accel_bias_walk_density: usual.accel_bias_walk_density * factors[3],
            range_sigma_m: usual.range_sigma_m * factors[4],
            ..usual
        };
        let run = drive.run(&mut odometry(config));
        let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&run)));
        assert!(position_m < 0.02 && rotation_deg < 0.3, "{case} {factors:.2?}: {position_m} m, {rotation_deg} deg");
        assert_eq!(count(&run, TrackingStatus::Lost), 0);
    }
}

#[test]
fn a_turn_faster_than_the_gyroscope_can_show() {
    // Peaks of 18 rad/s, eleven of them. A range of 17 hides half a degree of each, one of 15 as much as twenty, and while
    // it does only the scans, bent as they are by the wrong rate, say where the body looks. (With half the rate hidden
    // each turn is ninety degrees short, and a room of four walls looks the same: that cannot be followed.)
    for (range_radps, limit_m, limit_deg) in [(17.0, 0.05, 1.5), (15.0, 0.3, 10.0)] {
        let drive = Drive { imu_range: (range_radps, 150.0), ..Drive::new(whirl) };
        let clipped = drive.imu().iter().filter(|s| s.angular_velocity_radps.amax() >= range_radps).count();
        assert!(clipped > 100, "{clipped}");
        let mut odometry = odometry(LioConfig { gyro_range_radps: range_radps, ..LioConfig::default() });
        let mut farthest: f64 = 0.0;
        let run = drive.run_with(&mut odometry, |estimate| {
            farthest = farthest.max(estimate.world_from_body.translation.vector.norm());
        });
        let errors = drive.errors(&estimates(&run));
        let (position_m, rotation_deg) = worst(&errors);
        println!("{range_radps} rad/s: {clipped} samples clipped, never farther than {farthest:.2} m");
        assert!(position_m < limit_m && rotation_deg < limit_deg, "{range_radps}: {position_m} m, {rotation_deg} deg");
        assert!(farthest < 1.0, "{farthest}");
        // After each turn it knows again: within any 0.7 s there is a scan that is right.
        for after in errors.windows(7) {
            let best = after.iter().fold((f64::MAX, f64::MAX), |best, e| (best.0.min(e.0), best.1.min(e.1)));
            assert!(best.0 < 0.02 && best.1 < 0.3, "{after:?}");
        }
    }
}

#[test]
fn it_starts_while_it_moves() {
    let drive = Drive { to_s: 4.0, ..Drive::new(walk_from_the_first) };
    let mut odometry = odometry(LioConfig::default());
    let run = drive.run(&mut odometry);
    let first = run.iter().find(|(report, _)| report.status == TrackingStatus::Tracking).expect("it starts");
    assert!(first.0.stamp.seconds_since(Stamp(0)) <= 1.0, "{}", first.0.stamp);
    let estimates = estimates(&run);
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates));
    assert!(position_m < 0.03 && rotation_deg < 0.5, "{position_m} m, {rotation_deg} deg");
    // The world is level.
    for estimate in &estimates {
        let t = estimate.stamp.seconds_since(Stamp(0));
        let up = (walk_from_the_first(t) * body_from_imu().inverse()).rotation.inverse() * Vector3::z();
        let tilt = (estimate.world_from_body.rotation.inverse() * Vector3::z()).angle(&up);
        assert!(tilt.to_degrees() < 1.5, "{}", tilt.to_degrees());
    }
}

#[test]
fn a_fixed_lidar_needs_no_encoder() {
    let drive = Drive { motor_radps: 0.0, to_s: 4.0, ..Drive::new(walk) };
    let mut odometry = odometry(LioConfig { is_rotating: false, ..LioConfig::default() });
    let estimates = estimates(&drive.run(&mut odometry));
    assert!(estimates.len() >= 34);
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates));
    assert!(position_m < 0.01 && rotation_deg < 0.2, "{position_m} m, {rotation_deg} deg");
    // With the flag left at its default the scans wait for an encoder, and say so.
    let mut waiting = support::drive::odometry(LioConfig::default());
    drive.imu().iter().for_each(|sample| waiting.push_imu(sample).expect("in order"));
    let scan = drive.scan(1.0);
    assert!(!waiting.is_ready_for(&scan));
    assert!(matches!(waiting.push_scan(&scan), Err(ScanFault::EncoderMissing { .. })));
}

#[test]
fn a_thousand_degrees_a_second() {
    let drive = Drive { to_s: 5.0, ..Drive::new(whirl) };
    let fastest = drive.imu().iter().map(|s| s.angular_velocity_radps.norm()).fold(0.0, f64::max);
    assert!(fastest.to_degrees() > 1000.0, "{}", fastest.to_degrees());
    let run = drive.run(&mut odometry(LioConfig::default()));
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&run)));
    assert!(position_m < 0.02 && rotation_deg < 0.5, "{position_m} m, {rotation_deg} deg");
    assert_eq!(count(&run, TrackingStatus::Lost), 0);
}

#[test]
fn an_empty_corridor_is_degenerate_along_its_axis() {
    let drive = Drive { scene: corridor(), to_s: 6.0, ..Drive::new(stride) };
    let run = drive.run(&mut odometry(LioConfig::default()));
    let tracked: Vec<_> = run.iter().filter(|(r, _)| r.is_update_valid).collect();
    assert!(tracked.len() > 40);
    let axis = (estimates(&run)[0].world_from_body * body_from_imu()).rotation
        * (stride(1.0).rotation.inverse() * Vector3::x());
    let mut degenerate = 0;
    let weakest = tracked.iter().map(|(report, _)| report.degeneracy.weakest_cells);
    println!("along the axis at most {:.2} cells", weakest.fold(0.0, f64::max));
    for (report, _) in &tracked {
        if let [direction] = report.degeneracy.translations[..] {
            assert!(direction.dot(&axis).abs() > 0.99, "{direction}");
            assert_eq!(report.status, TrackingStatus::Degenerate);
            degenerate += 1;
        }
    }
    assert!(degenerate as f64 > 0.9 * tracked.len() as f64, "{degenerate} of {}", tracked.len());
    // No jump: the inertial sensor carries the axis; everything else stays exact.
    let estimates = estimates(&run);
    let errors = drive.errors(&estimates);
    assert!(worst(&errors).0 < 0.5, "{:?}", worst(&errors));
    assert!(worst(&errors).1 < 0.5, "{:?}", worst(&errors));
    for pair in errors.windows(2) {
        assert!((pair[1].0 - pair[0].0).abs() < 0.03);
    }
    let last = estimates.last().expect("tracked");
    let spread = last.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    assert!((axis.transpose() * spread * axis)[0].sqrt() > 0.02, "the filter knows what it does not know");
}

#[test]
fn a_fifth_of_moving_points() {
    let drive = Drive { moving: crowd, ..Drive::new(walk) };
    let still = Drive::new(walk);
    let share = {
        // Points whose range differs from the empty room's.
        let (with, without) = (drive.scan(3.0), still.scan(3.0));
        let differs =
            |(a, b): (&RawPoint, &RawPoint)| (a.position.coords.norm() - b.position.coords.norm()).abs() > 0.1;
        with.points.iter().zip(&without.points).filter(|&pair| differs(pair)).count() as f64 / with.points.len() as f64
    };
    assert!((0.2..0.45).contains(&share), "{share}");
    let run = drive.run(&mut odometry(LioConfig::default()));
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&run)));
    assert!(position_m < 0.03 && rotation_deg < 0.5, "{position_m} m, {rotation_deg} deg");
}

#[test]
fn a_crooked_mount_and_a_late_clock() {
    let tilt = Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_euler_angles(0.01, 0.01, 0.01));
    let crooked = Drive { mount_error: tilt, ..Drive::new(walk) };
    let late = Drive { lidar_clock_s: 0.005, ..Drive::new(walk) };
    for drive in [crooked, late] {
        let run = drive.run(&mut odometry(LioConfig::default()));
        let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&run)));
        assert!(position_m < 0.1 && rotation_deg < 2.0, "{position_m} m, {rotation_deg} deg");
        assert_eq!(count(&run, TrackingStatus::Lost), 0);
    }
}

#[test]
fn lost_in_the_dark_and_back() {
    // Short: the inertial sensor bridges it. Long: the output stays bounded, and tracking returns.
    for (until_s, error_m) in [(3.2, 0.02), (5.5, 0.2)] {
        let drive = Drive { blind_s: (3.0, until_s), to_s: 8.0, ..Drive::new(walk) };
        let mut odometry = odometry(LioConfig::default());
        let mut farthest: f64 = 0.0;
        let mut was_lost_after_s = None;
        let run = drive.run_with(&mut odometry, |estimate| {
            farthest = farthest.max(estimate.world_from_body.translation.vector.norm());
            if estimate.status == TrackingStatus::Lost && was_lost_after_s.is_none() {
                was_lost_after_s = Some(estimate.stamp.seconds_since(Stamp(0)) - 3.0);
            }
        });
        assert!(farthest < 4.0, "{farthest}");
        assert_eq!(was_lost_after_s.is_some(), until_s > 4.0);
        assert!(was_lost_after_s.is_none_or(|s| s < 0.5), "{was_lost_after_s:?}");
        let after: Vec<_> = estimates(&run).into_iter().filter(|e| e.stamp.seconds_since(Stamp(0)) > 6.5).collect();
        assert!(after.iter().all(|e| e.status == TrackingStatus::Tracking), "{until_s}");
        let mut all = estimates(&run)[..1].to_vec();
        all.extend(after);
        let (position_m, _) = worst(&drive.errors(&all));
        assert!(position_m < error_m, "{until_s}: {position_m} m");
        assert!(run.iter().all(|(report, _)| !report.has_restarted));
    }
}

#[test]
fn carried_elsewhere_it_begins_anew() {
    // Blind while it is carried out of the room into a corridor.
    let drive = Drive { to_s: 3.0, ..Drive::new(walk) };
    let mut odometry = odometry(LioConfig::default());
    drive.run(&mut odometry);
    let before = odometry.estimate().world_from_body;
    let elsewhere = Drive { from_s: 4.0, to_s: 11.0, scene: square_hall(), ..Drive::new(walk) };
    let mut held = 0;
    let run = elsewhere.run_with(&mut odometry, |estimate| {
        let spread = estimate.covariance.symmetric_eigenvalues();
        assert!(spread.min() > 0.0 && spread.max() < 200.0, "{spread}");
        // Between the restart and the next start nothing is known of the pose that is held, and the covariance says so.
        if estimate.status == TrackingStatus::Lost && estimate.velocity_in_world_mps == Vector3::zeros() {
            assert_eq!(*estimate, OdometryEstimate::assumed(estimate.stamp, estimate.world_from_body, estimate.status));
            assert!(spread.min() > 3.0, "{spread}");
            held += 1;
        }
    });
    assert!(held > 50, "{held}");
    assert_eq!(run.iter().filter(|(report, _)| report.has_restarted).count(), 1);
    let last = odometry.estimate();
    assert_eq!(last.status, TrackingStatus::Tracking);
    assert!((last.world_from_body.translation.vector - before.translation.vector).norm() < 6.0);
}

/// Walls at the ends are met face on: there the noise of ranges shows in full, and a wall is no less a plane for it.
#[test]
fn the_walls_at_a_corridors_ends_hold_the_pose() {
    let ends = [-3.0, 9.0].map(|x: f64| support::Block {
        thing: 0,
        min: [x - 0.1, -1.3, 0.0].into(),
        max: [x + 0.1, 1.3, 2.6].into(),
    });
    let mut scene = corridor();
    scene.blocks.extend(ends);
    // A cheap IMU: alone it would not do for six seconds.
    let drive = Drive { scene, to_s: 6.0, imu_noise: (2e-3, 5e-2), ..Drive::new(stride) };
    let run = drive.run(&mut odometry(LioConfig::default()));
    let tracked = run.iter().filter(|(report, _)| report.is_update_valid).count();
    let degenerate = count(&run, TrackingStatus::Degenerate);
    assert!(tracked > 40 && degenerate * 10 < tracked, "{degenerate} of {tracked}");
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&run)));
    assert!(position_m < 0.02 && rotation_deg < 0.3, "{position_m} m, {rotation_deg} deg");
}

/// Floor, ceiling and four walls, seen from within.
fn empty_room(low: [f64; 3], high: [f64; 3]) -> support::Scene {
    let side = |axis: usize, at: f64, thick: f64| {
        let (mut min, mut max) = (low.map(|x| x - 0.1), high.map(|x| x + 0.1));
        (min[axis], max[axis]) = (at.min(at + thick), at.max(at + thick));
        support::Block { thing: 0, min: min.into(), max: max.into() }
    };
    let blocks = (0..3).flat_map(|axis| [side(axis, low[axis], -0.1), side(axis, high[axis], 0.1)]).collect();
    support::Scene { names: vec!["room"], blocks }
}

/// A hall that does not look like the room.
fn square_hall() -> support::Scene {
    let mut hall = empty_room([-6.0, -5.0, -2.0], [6.0, 5.0, 5.0]);
    let pillar = support::Block { thing: 0, min: [3.0, 2.0, -2.0].into(), max: [4.0, 3.5, 2.0].into() };
    hall.blocks.push(pillar);
    hall
}

/// A closet shows two dozen cells, and hardly its floor and ceiling. That is no reason to be lost: what is seen holds the
/// pose, and of the rest the covariance says how little is known.
#[test]
fn a_closet_leaves_directions_open_but_nobody_is_lost_in_it() {
    fn sway(t: f64) -> Isometry3<f64> {
        let g = gate(t);
        let shift = Vector3::new((2.0 * t).sin(), (2.6 * t).sin(), 1.5 * (1.7 * t).sin()) * (0.04 * g);
        let turn = UnitQuaternion::from_euler_angles(0.03 * g * (3.0 * t).sin(), 0.0, 0.3 * g * t.sin());
        Isometry3::from_parts((shift + Vector3::new(-0.5, -0.2, 1.0)).into(), turn)
    }
    for (low, high) in [
        ([-0.88, -0.58, 0.65], [-0.12, 0.18, 1.50]),
        ([-0.93, -0.63, 0.60], [-0.07, 0.23, 1.50]),
        ([-1.10, -0.56, 0.65], [0.00, 0.16, 1.50]),
    ] {
        let drive = Drive { scene: empty_room(low, high), to_s: 5.0, ..Drive::new(sway) };
        let mut odometry = odometry(LioConfig::default());
        let run = drive.run(&mut odometry);
        let most = run.iter().map(|(report, _)| report.residuals).max().expect("scans");
        assert!((8..40).contains(&most), "a closet shows few cells, not {most}");
        assert!(run.iter().all(|(report, _)| report.status != TrackingStatus::Lost && !report.has_restarted));
        let estimates = estimates(&run);
        assert!(estimates.iter().any(|estimate| estimate.status == TrackingStatus::Degenerate));
        for (estimate, (position_m, rotation_deg)) in estimates.iter().zip(drive.errors(&estimates)) {
            let sigma_m = estimate.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
            assert!(position_m < 0.02 + 4.0 * sigma_m, "{position_m} m with {sigma_m} m");
            assert!(rotation_deg < 4.0, "{rotation_deg} deg");
        }
    }
}

#[test]
fn a_silent_imu_for_a_moment() {
    let drive = Drive { deaf_s: (3.0, 3.2), ..Drive::new(walk) };
    let run = drive.run(&mut odometry(LioConfig::default()));
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&run)));
    assert!(position_m < 0.05 && rotation_deg < 1.0, "{position_m} m, {rotation_deg} deg");
    assert_eq!(run.last().expect("scans").0.status, TrackingStatus::Tracking);
}

#[test]
fn standing_for_long_changes_nothing() {
    let drive = Drive { to_s: 12.0, ..Drive::new(|_| walk(0.0)) };
    let mut odometry = odometry(LioConfig::default());
    let mut sizes = Vec::new();
    let run = drive.run(&mut odometry);
    sizes.extend(run.iter().map(|(report, _)| report.map_voxels));
    let (position_m, rotation_deg) = worst(&drive.errors(&estimates(&run)));
    assert!(position_m < 0.003 && rotation_deg < 0.05, "{position_m} m, {rotation_deg} deg");
    // One turn of the motor takes two seconds; after three, hardly a cell is new.
    let (early, late) = (sizes[40], sizes[sizes.len() - 1]);
    assert!(late as f64 <= 1.1 * early as f64, "{early} {late}");
}

#[test]
fn it_continues_in_a_saved_map() {
    let drive = Drive { to_s: 5.0, ..Drive::new(walk) };
    let mut first = odometry(LioConfig::default());
    drive.run(&mut first);
    let mut bytes = Vec::new();
    first.map().write(&mut bytes).expect("memory");
    let map = VoxelMap::read(&bytes[..], 100_000).expect("sound");
    assert_eq!(map.points(), first.map().points());
    // Told a start that is off by 30 cm and 6 degrees.
    let told =
        Isometry3::from_parts(Translation3::new(0.25, -0.15, 0.0), UnitQuaternion::from_euler_angles(0.0, 0.0, 0.1));
    let mut second = LidarInertialOdometry::with_map(LioConfig::default(), mount(), body_from_imu(), map, Some(told))
        .expect("sound");
    let again = Drive { seed: 5, to_s: 4.0, ..Drive::new(walk) };
    let run = again.run(&mut second);
    let (ours, theirs) = (estimates(&run), Drive { to_s: 4.0, ..Drive::new(walk) });
    let reference = estimates(&theirs.run(&mut odometry(LioConfig::default())));
    for estimate in &ours {
        let same = reference.iter().find(|e| e.stamp == estimate.stamp).expect("the same scans");
        let between = same.world_from_body.inverse() * estimate.world_from_body;
        assert!(between.translation.vector.norm() < 0.02, "{}: {between}", estimate.stamp);
    }
    assert!(ours.len() > 30);
}

#[test]
fn the_map_has_a_hard_cap() {
    let config = LioConfig { max_map_voxels: 1500, ..LioConfig::default() };
    let drive = Drive { to_s: 4.0, ..Drive::new(walk) };
    let mut odometry = odometry(config);
    let run = drive.run(&mut odometry);
    assert!(run.iter().all(|(report, _)| report.map_voxels <= 1500));
    assert!(run.iter().any(|(report, _)| report.map_voxels > 1200));
    odometry.map().check_invariants();
    let (position_m, _) = worst(&drive.errors(&estimates(&run)));
    assert!(position_m < 0.05, "{position_m}");
}

#[test]
fn same_bits_with_any_number_of_threads_and_any_order_of_points() {
    let drive = Drive { to_s: 2.5, ..Drive::new(walk) };
    let poses = |threads: usize, is_reversed: bool| {
        let mut odometry = odometry(LioConfig { threads, ..LioConfig::default() });
        let (imu, encoder) = (drive.imu(), drive.encoder());
        encoder.iter().for_each(|sample| odometry.push_encoder(sample).expect("in order"));
        let mut poses = Vec::new();
        let mut next = 0;
        for mut scan in drive.scans() {
            if is_reversed {
                scan.points.reverse();
            }
            while next < imu.len() && (next == 0 || imu[next - 1].stamp < scan.end()) {
                odometry.push_imu(&imu[next]).expect("in order");
                next += 1;
            }
            odometry.push_scan(&scan).expect("in order");
            poses.push(odometry.estimate());
        }
        poses
    };
    let one = poses(1, false);
    assert_eq!(one, poses(2, false));
    assert_eq!(one, poses(3, false));
    assert_eq!(one, poses(1, true));
}

#[test]
fn reference_times_lie_on_the_way() {
    let drive = Drive { to_s: 3.0, ..Drive::new(walk) };
    let at = |reference: ReferenceTime| {
        let run = drive.run(&mut odometry(LioConfig { reference, ..LioConfig::default() }));
        estimates(&run)
    };
    let [start, middle, end] = [ReferenceTime::Start, ReferenceTime::Mid, ReferenceTime::End].map(at);
    let span_s = end[5].stamp.seconds_since(start[5].stamp);
    assert!(
        (span_s - 0.0997).abs() < 1e-3 && (middle[5].stamp.seconds_since(start[5].stamp) - span_s / 2.0).abs() < 1e-6
    );
    for all in [&start, &middle, &end] {
        let (position_m, rotation_deg) = worst(&drive.errors(all));
        assert!(position_m < 0.008 && rotation_deg < 0.15, "{position_m} m, {rotation_deg} deg");
    }
    // The way through the last scan serves the plain deskew.
    let mut odometry = odometry(LioConfig::default());
    drive.run(&mut odometry);
    let mut encoder = EncoderTrack::rotating(0.0);
    drive.encoder().into_iter().for_each(|sample| encoder.push(sample).expect("in order"));
    let scan = drive.scan(2.9);
    let trajectory = odometry.trajectory_of_scan();
    let deskewed =
        deskew(&scan, &encoder, &mount(), &trajectory, ReferenceTime::Mid, &DeskewConfig::default()).expect("covered");
    assert!(deskewed.dropped.outside_time * 50 < scan.points.len(), "{:?}", deskewed.dropped);
}

#[test]
fn before_the_start_nothing_is_known() {
    let estimate = odometry(LioConfig::default()).estimate();
    assert_eq!((estimate.status, estimate.world_from_body), (TrackingStatus::Initialising, Isometry3::identity()));
    assert!(estimate.covariance.symmetric_eigenvalues().min() > 3.0);
}

#[test]
fn the_body_at_any_time_of_the_last_scan() {
    let drive = Drive { to_s: 3.0, ..Drive::new(walk) };
    let mut odometry = odometry(LioConfig::default());
    let run = drive.run(&mut odometry);
    let scan = drive.scan(2.9);
    let (start, end) = (scan.start, scan.end());
    let span_ns = end.0 - start.0;
    let trajectory = odometry.trajectory_of_scan();
    let mut all = estimates(&run)[..1].to_vec();
    for k in 0..=40 {
        let stamp = start.plus_ns(span_ns * k / 40);
        let estimate = odometry.estimate_at(stamp).expect("inside the scan");
        assert_eq!(estimate.stamp, stamp);
        assert!(estimate.covariance.symmetric_eigenvalues().min() > 0.0);
        // The curve through the same knots.
        let on_curve = trajectory.world_from_body(stamp).expect("inside the scan");
        assert!((on_curve.translation.vector - estimate.world_from_body.translation.vector).norm() < 1e-4);
        assert!(on_curve.rotation.angle_to(&estimate.world_from_body.rotation) < 1e-3);
        // Pose and velocity belong together, across the knots as well.
        if let Some(before) = odometry.estimate_at(stamp.plus_ns(-1_000_000)) {
            let step = estimate.world_from_body.translation.vector - before.world_from_body.translation.vector;
            let mean = (estimate.velocity_in_world_mps + before.velocity_in_world_mps) * 0.5;
            assert!((step / 1e-3 - mean).norm() < 0.02, "{k}: {}", step / 1e-3 - mean);
        }
        all.push(estimate);
    }
    let (position_m, rotation_deg) = worst(&drive.errors(&all));
    assert!(position_m < 0.008 && rotation_deg < 0.15, "{position_m} m, {rotation_deg} deg");
    // An earlier pose is known about as well, not exactly as well, and never better by the noise of the way.
    let sigma_m = |e: &OdometryEstimate| e.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
    let (first, last) = (&all[1], &all[41]);
    assert!(first.covariance != last.covariance);
    assert!((0.5..5.0).contains(&(sigma_m(first) / sigma_m(last))), "{} {}", sigma_m(first), sigma_m(last));
    println!("sigma at the start {:.5} m, at the end {:.5} m", sigma_m(first), sigma_m(last));
    // The four reference times are four such times; outside the way there is none.
    for reference in
        [ReferenceTime::Start, ReferenceTime::Mid, ReferenceTime::End, ReferenceTime::At(start.plus_ns(12_345_678))]
    {
        let mut other = support::drive::odometry(LioConfig { reference, ..LioConfig::default() });
        let at_scan = drive.run(&mut other).last().expect("scans").1;
        assert_eq!(at_scan, odometry.estimate_at(reference.stamp(start, end)));
        assert!(at_scan.is_some());
    }
    assert_eq!(Some(*last), odometry.estimate_at(end));
    assert_eq!(odometry.estimate_at(end.plus_ns(1)), None);
    assert!(odometry.estimate_at(start.plus_ns(-1_000)).is_some(), "the way begins at the end of the scan before");
    assert_eq!(odometry.estimate_at(start.plus_ns(-10_000_000)), None);
    assert_eq!(support::drive::odometry(LioConfig::default()).estimate_at(start), None);
}

#[test]
fn hostile_input_is_refused_or_counted() {
    let drive = Drive { to_s: 2.0, ..Drive::new(walk) };
    let mut odometry = odometry(LioConfig::default());
    drive.run(&mut odometry);
    let before = odometry.estimate();
    let mut sample = *drive.imu().last().expect("samples");
    sample.angular_velocity_radps.x = f64::NAN;
    assert!(matches!(odometry.push_imu(&sample), Err(omni_perception::ImuFault::NotFinite { .. })));
    let old = drive.imu()[3];
    assert!(matches!(odometry.push_imu(&old), Err(ImuFault::NotLater { .. })));
    assert!(matches!(odometry.push_scan(&drive.scan(0.5)), Err(ScanFault::NotLater { .. })));
    assert!(matches!(odometry.push_scan(&drive.scan(7.0)), Err(ScanFault::ImuMissing { .. })));
    let mut endless = drive.scan(2.0);
    endless.points[0].offset_ns = u32::MAX;
    assert!(matches!(odometry.push_scan(&endless), Err(ScanFault::TooLong { .. })));
    assert_eq!(odometry.estimate(), before);

    // A scan of rubbish: counted, and the inertial sensor goes on.
    let more = Drive { from_s: 2.02, to_s: 2.6, ..Drive::new(walk) };
    for sample in more.imu() {
        let _ = odometry.push_imu(&sample);
    }
    for sample in more.encoder() {
        let _ = odometry.push_encoder(&sample);
    }
    let mut rubbish = drive.scan(2.1);
    for (k, point) in rubbish.points.iter_mut().enumerate() {
        point.position = [
            Point3::new(f32::NAN, 0.0, 0.0),
            Point3::new(f32::INFINITY, 1.0, 0.0),
            Point3::new(0.01, 0.0, 0.0),
            Point3::new(1e30, 0.0, 0.0),
        ][k % 4];
    }
    let report = odometry.push_scan(&rubbish).expect("counted");
    assert!(!report.is_update_valid);
    let quarter = rubbish.points.len() / 4;
    assert!(report.dropped.non_finite >= 2 * quarter && report.dropped.too_near >= quarter);
    let empty = RawScan { start: Stamp(0).plus_seconds(2.31), points: Vec::new() };
    assert!(!odometry.push_scan(&empty).expect("an empty scan is one").is_update_valid);
    let report = odometry.push_scan(&drive.scan(2.4)).expect("sound again");
    assert!(report.is_update_valid);
    // A clock that jumps far ahead.
    let late = ImuSample { stamp: Stamp(i64::MAX - 5), ..drive.imu()[0] };
    assert!(matches!(odometry.push_imu(&late), Err(ImuFault::JumpsAhead { .. })));
    let later = ImuSample { stamp: Stamp(i64::MAX - 4), ..late };
    odometry.push_imu(&later).expect("the second one confirms it");
    let estimate = odometry.estimate();
    assert!(estimate.world_from_body.translation.vector.norm() < 100.0);
    assert_eq!(estimate.status, TrackingStatus::Lost);
}
