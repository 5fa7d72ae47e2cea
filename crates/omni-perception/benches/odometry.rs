//! Claim guarded here: the odometry takes at most 5 ms of one core for a scan of 32 x 1024 points with its IMU and encoder
//! readings, map included, so that it runs at 10 Hz on a twentieth of a core.

#[path = "../tests/support/mod.rs"]
mod support;

use divan::Bencher;
use omni_perception::*;
use support::drive::{Drive, IMU_HZ, odometry, walk};

fn main() {
    divan::main();
}

/// The odometry three seconds into a walk, and what comes in the next 0.1 s.
fn next_scan(columns: u32, threads: usize) -> (LidarInertialOdometry, Vec<ImuSample>, RawScan) {
    let drive = Drive { columns, to_s: 4.0, ..Drive::new(walk) };
    let mut odometry = odometry(LioConfig { threads, ..LioConfig::default() });
    Drive { to_s: 3.0, columns, ..Drive::new(walk) }.run(&mut odometry);
    let scan = drive.scan(3.0);
    for sample in drive.encoder() {
        // Those up to three seconds are there already.
        let _ = odometry.push_encoder(&sample);
    }
    let newest = odometry.estimate().stamp;
    let count = (0.11 * IMU_HZ) as usize;
    let imu = drive.imu().into_iter().filter(|sample| sample.stamp > newest).take(count).collect();
    (odometry, imu, scan)
}

#[divan::bench(args = [720, 1024], sample_count = 50)]
fn one_scan(bencher: Bencher, columns: u32) {
    let (odometry, imu, scan) = next_scan(columns, 1);
    bencher.with_inputs(|| odometry.clone()).bench_local_values(|mut odometry| {
        for sample in &imu {
            odometry.push_imu(sample).expect("in order");
        }
        let report = odometry.push_scan(&scan).expect("in order");
        assert!(report.is_update_valid);
        odometry
    });
}

#[divan::bench(sample_count = 50)]
fn twenty_imu_samples(bencher: Bencher) {
    let (odometry, imu, _) = next_scan(300, 1);
    bencher.with_inputs(|| odometry.clone()).bench_local_values(|mut odometry| {
        for sample in &imu {
            odometry.push_imu(sample).expect("in order");
        }
        odometry
    });
}
