//! How fast a bag becomes events: one second of a LiDAR of 32 x 1024 at 10 Hz and an IMU of 200 Hz, from a file that the operating
//! system holds in memory.

use mission::omni_perception::Stamp;
use mission::recording::rosbag::ros_messages::{Header, Imu, PointCloud2, PointField, Time, Vector3};
use mission::recording::rosbag::writer::BagWriter;
use mission::recording::rosbag::{Bag, BagOptions};

const POINTS: u32 = 32 * 1024;

fn main() {
    divan::main();
}

fn header(ns: i64) -> Header {
    let stamp = Stamp(1_700_000_000_000_000_000 + ns);
    Header { stamp: Time::from_stamp(stamp).expect("before 2038"), frame_id: "lidar".into() }
}

fn write(folder: &std::path::Path) {
    let mut writer = BagWriter::create(folder).expect("a folder for the bench");
    let mut data = Vec::new();
    for k in 0..POINTS {
        for value in [k as f32 * 1e-3, 1.0, 2.0, 0.0] {
            data.extend(value.to_le_bytes());
        }
        data.extend((k / 32 * 97_000).to_le_bytes());
        data.extend([(k % 32) as u8, 0, 0, 0]);
    }
    let field = |name: &str, offset, datatype| PointField { name: name.into(), offset, datatype, count: 1 };
    for scan in 0..10_i64 {
        for sample in 0..20 {
            let ns = scan * 100_000_000 + sample * 5_000_000;
            let force = Vector3 { z: 9.81, ..Vector3::default() };
            let imu = Imu { header: header(ns), linear_acceleration: force, ..Imu::default() };
            writer.write("/imu", imu.header.stamp.stamp(), &imu).expect("written");
        }
        let cloud = PointCloud2 {
            header: header(scan * 100_000_000),
            height: 1,
            width: POINTS,
            fields: vec![field("x", 0, 7), field("y", 4, 7), field("z", 8, 7), field("t", 16, 6), field("ring", 20, 4)],
            point_step: 24,
            row_step: 24 * POINTS,
            data: &data,
            ..PointCloud2::default()
        };
        writer.write("/points", header((scan + 1) * 100_000_000).stamp.stamp(), &cloud).expect("written");
    }
    writer.finish().expect("written");
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn a_second_of_lidar_and_imu(bencher: divan::Bencher<'_, '_>) {
    let root = tempfile::tempdir().expect("a folder for the bench");
    write(root.path());
    bencher.counter(divan::counter::ItemsCount::new(10 * POINTS)).bench(|| {
        Bag::open(root.path(), &BagOptions::default()).expect("our own bag").events.filter_map(Result::ok).count()
    });
}
