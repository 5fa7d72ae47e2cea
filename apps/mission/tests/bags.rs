//! Laws of bags: what is written is read, bit for bit; what is unclear is refused in a sentence; what is broken is counted and
//! never a panic.

use std::fs;
use std::path::{Path, PathBuf};

use mission::omni_perception::{EncoderSample, ImuSample, RawPoint, RawScan, Stamp};
use mission::recording::rosbag::error::BagError;
use mission::recording::rosbag::frames::transform;
use mission::recording::rosbag::ros_messages::{
    Header, Imu, JointState, PointCloud2, PointField, TfMessage, Time, TransformStamped, Vector3 as RosVector,
};
use mission::recording::rosbag::writer::{BAG_FILE, BagWriter};
use mission::recording::rosbag::{Bag, BagOptions};
use mission::recording::{RecordingError, open};
use mission::stream::SensorEvent;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;

const T0_NS: i64 = 1_700_000_000_000_000_000;
const SCAN_NS: i64 = 100_000_000;

/// How a driver might write the time of a point.
#[derive(Debug, Clone, Copy)]
struct TimeStyle {
    field: &'static str,
    /// Code of `sensor_msgs/PointField`.
    datatype: u8,
    ns_per_unit: f64,
    is_absolute: bool,
    /// The header carries the time of the scan's end.
    is_stamped_at_end: bool,
    is_bigendian: bool,
}

const OURS: TimeStyle = TimeStyle {
    field: "t",
    datatype: 6,
    ns_per_unit: 1.0,
    is_absolute: false,
    is_stamped_at_end: false,
    is_bigendian: false,
};

impl TimeStyle {
    /// Largest error of a stamp: half a unit, or what a float of the type cannot hold.
    fn tolerance_ns(&self) -> i64 {
        let from_float = match (self.datatype, self.is_absolute) {
            (8, true) => 600.0,
            (7, _) => 10.0,
            (8, false) => 0.0,
            _ => self.ns_per_unit,
        };
        from_float as i64
    }

    fn value(&self, after_header_ns: i64, header_ns: i64) -> f64 {
        let ns = if self.is_absolute { header_ns + after_header_ns } else { after_header_ns };
        ns as f64 / self.ns_per_unit
    }

    fn bytes(&self, value: f64) -> Vec<u8> {
        macro_rules! number {
            ($type:ty) => {
                if self.is_bigendian {
                    (value as $type).to_be_bytes().to_vec()
                } else {
                    (value as $type).to_le_bytes().to_vec()
                }
            };
        }
        match self.datatype {
            5 => number!(i32),
            6 => number!(u32),
            7 => number!(f32),
            _ => number!(f64),
        }
    }

    fn float(&self, value: f32) -> [u8; 4] {
        if self.is_bigendian { value.to_be_bytes() } else { value.to_le_bytes() }
    }
}

/// A bag under way.
struct Maker {
    writer: BagWriter,
    style: TimeStyle,
}

fn header(stamp: Stamp, frame: &str) -> Header {
    Header { stamp: Time::from_stamp(stamp).unwrap(), frame_id: frame.to_owned() }
}

impl Maker {
    fn new(folder: &Path, style: TimeStyle) -> Maker {
        Maker { writer: BagWriter::create(folder).unwrap(), style }
    }

    fn frames(&mut self, edges: &[(&str, &str, Isometry3<f64>)]) {
        let transforms = edges
            .iter()
            .map(|(parent, child, pose)| TransformStamped {
                header: header(Stamp(T0_NS), parent),
                child_frame_id: (*child).to_owned(),
                transform: transform(pose),
            })
            .collect();
        self.writer.write("/tf_static", Stamp(T0_NS), &TfMessage { transforms }).unwrap();
    }

    fn event(&mut self, event: &SensorEvent) {
        match event {
            SensorEvent::Imu(sample) => self.imu("/imu", sample),
            SensorEvent::Encoder(sample) => {
                let state = JointState {
                    header: header(sample.stamp, "lidar"),
                    name: vec!["leg".into(), "lidar_motor".into()],
                    position: vec![0.3, sample.angle_rad],
                    ..JointState::default()
                };
                self.writer.write("/joint_states", sample.stamp, &state).unwrap();
            }
            SensorEvent::Scan(scan) => self.scan("/points_raw", "lidar_raw", scan),
            _ => unreachable!("not made here"),
        }
    }

    fn imu(&mut self, topic: &str, sample: &ImuSample) {
        let vector = |v: &Vector3<f64>| RosVector { x: v.x, y: v.y, z: v.z };
        let message = Imu {
            header: header(sample.stamp, "imu"),
            angular_velocity: vector(&sample.angular_velocity_radps),
            linear_acceleration: vector(&sample.specific_force_mps2),
            ..Imu::default()
        };
        self.writer.write(topic, sample.stamp, &message).unwrap();
    }

    fn scan(&mut self, topic: &str, frame: &str, scan: &RawScan) {
        let style = self.style;
        let end_ns = if style.is_stamped_at_end { SCAN_NS } else { 0 };
        let stamp = scan.start.plus_ns(end_ns);
        let mut data = Vec::new();
        for point in &scan.points {
            point.position.iter().for_each(|value| data.extend(style.float(*value)));
            data.extend(if style.is_bigendian { point.ring.to_be_bytes() } else { point.ring.to_le_bytes() });
            data.extend(style.bytes(style.value(i64::from(point.offset_ns) - end_ns, stamp.0)));
        }
        let field = |name: &str, offset, datatype| PointField { name: name.into(), offset, datatype, count: 1 };
        let point_step = 14 + style.bytes(0.0).len() as u32;
        let message = PointCloud2 {
            header: header(stamp, frame),
            height: 1,
            width: scan.points.len() as u32,
            fields: vec![
                field("x", 0, 7),
                field("y", 4, 7),
                field("z", 8, 7),
                field("ring", 12, 4),
                field(style.field, 14, style.datatype),
            ],
            is_bigendian: style.is_bigendian,
            point_step,
            row_step: data.len() as u32,
            data: &data,
            is_dense: true,
        };
        self.writer.write(topic, scan.start.plus_ns(SCAN_NS), &message).unwrap();
    }

    fn finish(self) {
        self.writer.finish().unwrap();
    }
}

fn rig_frames() -> [(&'static str, &'static str, Isometry3<f64>); 3] {
    let turned = |x: f64| {
        Isometry3::from_parts(Vector3::new(x, 0.02, 0.1).into(), UnitQuaternion::from_euler_angles(0.1, -0.2, x))
    };
    [("base_link", "imu", turned(0.05)), ("imu", "lidar", turned(0.3)), ("rotor", "lidar_raw", turned(0.5))]
}

fn imu_sample(ns: i64, value: f64) -> ImuSample {
    ImuSample {
        stamp: Stamp(T0_NS + ns),
        angular_velocity_radps: Vector3::new(0.1, value, -0.3),
        specific_force_mps2: Vector3::new(0.2, -value, 9.7),
    }
}

/// A scan of 30 points over its whole sweep.
fn scan(start_ns: i64, value: f32) -> RawScan {
    let point =
        |k: u32| RawPoint { position: Point3::new(value, k as f32, -1.5), offset_ns: k * 3_400_000, ring: k as u16 };
    RawScan { start: Stamp(T0_NS + start_ns), points: (0..30).map(point).collect() }
}

/// Events of some tenths of a second in the order of delivery.
fn events(tenths: i64, values: &[f64]) -> Vec<SensorEvent> {
    let value = |k: i64| values[k as usize % values.len()];
    let mut events = Vec::new();
    for k in 0..tenths * 20 {
        let ns = k * 5_000_000;
        events.push(SensorEvent::Encoder(EncoderSample { stamp: Stamp(T0_NS + ns + 1), angle_rad: value(k) }));
        events.push(SensorEvent::Imu(imu_sample(ns + 2, value(k + 1))));
    }
    for k in 0..tenths {
        events.push(SensorEvent::Scan(scan(k * SCAN_NS, value(k) as f32)));
    }
    events.sort_by_key(SensorEvent::stamp);
    events
}

fn make(folder: &Path, style: TimeStyle, events: &[SensorEvent]) {
    let mut maker = Maker::new(folder, style);
    maker.frames(&rig_frames());
    events.iter().for_each(|event| maker.event(event));
    maker.finish();
}

/// Events as comparable text; -0 and NaN keep their bits.
fn show(event: &SensorEvent) -> String {
    let bits = |values: &Vector3<f64>| values.map(f64::to_bits);
    match event {
        SensorEvent::Imu(imu) => {
            format!("{:?} {:?} {:?}", imu.stamp, bits(&imu.angular_velocity_radps), bits(&imu.specific_force_mps2))
        }
        SensorEvent::Encoder(sample) => format!("{:?} {:x}", sample.stamp, sample.angle_rad.to_bits()),
        SensorEvent::Scan(scan) => {
            let points: Vec<_> =
                scan.points.iter().map(|p| (p.position.coords.map(f32::to_bits), p.offset_ns, p.ring)).collect();
            format!("{:?} {points:?}", scan.start)
        }
        other => format!("{other:?}"),
    }
}

fn read(path: &Path) -> (Vec<SensorEvent>, Vec<RecordingError>) {
    let (mut events, mut faults) = (Vec::new(), Vec::new());
    for item in open(path).unwrap().events {
        match item {
            Ok(event) => events.push(event),
            Err(fault) => faults.push(fault),
        }
    }
    (events, faults)
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("bag");
    (root, path)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn what_is_written_is_read_bit_for_bit(values in proptest::collection::vec(any::<f64>(), 1..9), tenths in 1_i64..12) {
        // The unit of the accelerometer is told by its size, so the first samples are sound ones.
        let mut values = values;
        values[0] = 0.5;
        let (_root, path) = folder();
        let written = events(tenths, &values);
        make(&path, OURS, &written);
        let recording = open(&path).unwrap();
        let [(_, _, body_from_imu), (_, _, imu_from_lidar), (_, _, rotor_from_sensor)] = rig_frames();
        prop_assert!(recording.rig.is_rotating);
        prop_assert_eq!(recording.rig.body_from_imu, body_from_imu);
        prop_assert_eq!(recording.rig.mount.rotor_from_sensor, rotor_from_sensor);
        let body_from_stator = body_from_imu * imu_from_lidar;
        prop_assert!((recording.rig.mount.body_from_stator.to_homogeneous() - body_from_stator.to_homogeneous()).norm() < 1e-12);
        let (read, faults) = read(&path);
        prop_assert!(faults.is_empty(), "{faults:?}");
        prop_assert_eq!(read.iter().map(show).collect::<Vec<_>>(), written.iter().map(show).collect::<Vec<_>>());
    }

    #[test]
    fn a_bag_cut_anywhere_or_with_wrong_bytes_gives_what_is_sound_and_counts_the_rest(
        cut in 0.0_f64..1.0,
        wrong in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
    ) {
        let (_root, path) = folder();
        let written = events(8, &[0.5, 0.25, -0.75]);
        make(&path, OURS, &written);
        let whole = fs::read(path.join(BAG_FILE)).unwrap();
        let shown: Vec<String> = written.iter().map(show).collect();

        let check = |bytes: &[u8]| {
            let file = path.join("hostile.mcap");
            fs::write(&file, bytes).unwrap();
            // Refused as a whole, or read in part: never a panic, never a made-up event.
            let Ok(recording) = open(&file) else { return Ok(()) };
            let (mut read, mut faults) = (0, 0);
            for item in recording.events {
                match item {
                    Ok(event) => {
                        prop_assert!(shown.contains(&show(&event)));
                        read += 1;
                    }
                    Err(_) => faults += 1,
                }
            }
            prop_assert!(read == shown.len() || faults > 0, "{read} of {} without a word", shown.len());
            Ok(())
        };
        check(&whole[..(whole.len() as f64 * cut) as usize])?;
        let mut broken = whole.clone();
        wrong.iter().for_each(|(index, byte)| broken[index.index(whole.len())] = *byte);
        check(&broken)?;
    }
}

#[test]
fn every_way_to_tell_the_time_gives_the_same_scans() {
    let absolute = |style| TimeStyle { is_absolute: true, ..style };
    let styles = [
        OURS,
        TimeStyle { field: "offset_time", ..OURS },
        TimeStyle { field: "time", datatype: 7, ns_per_unit: 1e9, ..OURS },
        TimeStyle { field: "time", datatype: 7, ns_per_unit: 1e9, is_stamped_at_end: true, is_bigendian: true, ..OURS },
        TimeStyle { field: "timestamps", datatype: 8, ns_per_unit: 1e9, ..OURS },
        TimeStyle { field: "timestamp", datatype: 8, ns_per_unit: 1e3, ..OURS },
        TimeStyle { field: "t", datatype: 6, ns_per_unit: 1e3, is_bigendian: true, ..OURS },
        TimeStyle { field: "t", datatype: 5, ns_per_unit: 1e3, is_stamped_at_end: true, ..OURS },
        TimeStyle { field: "time_offset", datatype: 7, ns_per_unit: 1e6, ..OURS },
        absolute(TimeStyle { field: "timestamp", datatype: 8, ns_per_unit: 1e9, ..OURS }),
        absolute(TimeStyle { field: "timestamp", datatype: 8, ns_per_unit: 1e9, is_stamped_at_end: true, ..OURS }),
        absolute(TimeStyle { field: "timestamp", datatype: 8, ns_per_unit: 1e3, ..OURS }),
        absolute(TimeStyle { field: "timestamp", datatype: 8, ns_per_unit: 1.0, ..OURS }),
    ];
    let written = events(6, &[0.5]);
    for style in styles {
        let (_root, path) = folder();
        make(&path, style, &written);
        let (read, faults) = read(&path);
        assert!(faults.is_empty(), "{style:?}: {faults:?}");
        let scans = |events: &[SensorEvent]| -> Vec<RawScan> {
            let scan =
                |event: &SensorEvent| if let SensorEvent::Scan(scan) = event { Some(scan.clone()) } else { None };
            events.iter().filter_map(scan).collect()
        };
        let (read, written) = (scans(&read), scans(&written));
        assert_eq!(read.len(), written.len());
        for (read, written) in read.iter().zip(&written) {
            for (a, b) in read.points.iter().zip(&written.points) {
                let error_ns = (read.start.0 + i64::from(a.offset_ns)) - (written.start.0 + i64::from(b.offset_ns));
                assert!(error_ns.abs() <= style.tolerance_ns(), "{style:?}: {error_ns} ns");
                assert_eq!((a.position, a.ring), (b.position, b.ring));
            }
        }
    }
}

fn refusal(path: &Path) -> String {
    let error = open(path).err().expect("it is refused").to_string();
    println!("{error}");
    error
}

#[test]
fn what_is_unclear_is_refused_with_what_was_found_and_what_would_do() {
    // A time that nobody can understand: the same for all points.
    let (_root, path) = folder();
    make(&path, TimeStyle { ns_per_unit: 1e15, ..OURS }, &events(4, &[0.5]));
    let text = refusal(&path);
    assert!(text.contains("field t of the points on /points_raw spans 0") && text.contains("nanoseconds"), "{text}");

    // No time at all; read without it only when asked to.
    let (_root, path) = folder();
    make(&path, TimeStyle { field: "intensity", ..OURS }, &events(4, &[0.5]));
    let text = refusal(&path);
    assert!(text.contains("x, y, z, ring, intensity") && text.contains("timestamps"), "{text}");
    let options = BagOptions { are_point_times_needed: false, ..BagOptions::default() };
    let instant = Bag::open(&path, &options).unwrap();
    assert!(instant.events.filter_map(Result::ok).any(|event| matches!(event, SensorEvent::Scan(_))));

    // No IMU; two IMUs; no transform; another kind of file; nothing.
    let (_root, path) = folder();
    let mut maker = Maker::new(&path, OURS);
    maker.frames(&rig_frames());
    maker.event(&SensorEvent::Scan(scan(0, 1.0)));
    maker.finish();
    let text = refusal(&path);
    assert!(
        text.contains("no topic of type sensor_msgs/msg/Imu") && text.contains("/points_raw (sensor_msgs"),
        "{text}"
    );

    let (_root, path) = folder();
    let mut maker = Maker::new(&path, OURS);
    maker.frames(&rig_frames());
    maker.imu("/imu", &imu_sample(0, 0.0));
    maker.imu("/camera/imu", &imu_sample(1, 0.0));
    maker.event(&SensorEvent::Scan(scan(0, 1.0)));
    maker.finish();
    let text = refusal(&path);
    assert!(text.contains("/camera/imu, /imu"), "{text}");
    let options = BagOptions { imu_topic: Some("/imu".into()), encoder_topic: None, ..BagOptions::default() };
    assert!(
        matches!(Bag::open(&path, &options).err(), Some(BagError::NoTransform { .. })),
        "it turns and has no encoder"
    );

    let (_root, path) = folder();
    let mut maker = Maker::new(&path, OURS);
    maker.imu("/imu", &imu_sample(0, 0.0));
    maker.event(&SensorEvent::Scan(scan(0, 1.0)));
    maker.finish();
    let text = refusal(&path);
    assert!(text.contains("\"imu\" to frame \"lidar_raw\"") && text.contains("rig file"), "{text}");

    fs::write(path.join("text.mcap"), "this is no bag, though it is long enough to hold a header").unwrap();
    assert!(refusal(&path.join("text.mcap")).contains("no MCAP file"));
    let (_root, path) = folder();
    fs::create_dir_all(&path).unwrap();
    fs::write(path.join("metadata.yaml"), "rosbag2_bagfile_information:\n").unwrap();
    fs::write(path.join("bag_0.db3"), "SQLite format 3").unwrap();
    assert!(refusal(&path).contains("no .mcap file"));
    assert!(refusal(&path.join("missing")).contains("no recording"));
}

#[test]
fn a_fixed_lidar_needs_no_encoder_and_a_bag_may_come_in_parts_or_out_of_order() {
    let (_root, path) = folder();
    let mut maker = Maker::new(&path, OURS);
    maker.frames(&rig_frames());
    // The scan is written before the samples that it spans, as a driver with little latency does.
    let samples: Vec<ImuSample> = (0..40).map(|k| imu_sample(k * 5_000_000, 0.1)).collect();
    maker.scan("/points", "lidar", &scan(0, 2.0));
    samples.iter().for_each(|sample| maker.imu("/imu", sample));
    maker.finish();
    let part = |seconds: i64| {
        let (root, second) = folder();
        let mut maker = Maker::new(&second, OURS);
        let ns = seconds * 1_000_000_000;
        (0..40).for_each(|k| maker.imu("/imu", &imu_sample(ns + k * 5_000_000, 0.1)));
        maker.scan("/points", "lidar", &scan(ns, 2.0));
        maker.finish();
        (root, second.join(BAG_FILE))
    };
    // Ten comes after two, whatever the alphabet says.
    for (name, seconds) in [("bag_10.mcap", 2), ("bag_2.mcap", 1)] {
        let (_root, file) = part(seconds);
        fs::copy(file, path.join(name)).unwrap();
    }
    let recording = open(&path).unwrap();
    assert!(!recording.rig.is_rotating);
    assert_eq!(recording.rig.mount.rotor_from_sensor, Isometry3::identity());
    let (read, faults) = read(&path);
    assert!(faults.is_empty(), "{faults:?}");
    assert_eq!(read.len(), 3 * 41);
    assert!(read.windows(2).all(|pair| pair[0].stamp() <= pair[1].stamp()), "by the time of delivery");
}

#[test]
fn gravities_become_metres_and_bad_messages_are_counted() {
    let (_root, path) = folder();
    let mut maker = Maker::new(&path, OURS);
    maker.frames(&rig_frames());
    for k in 0..60 {
        let mut sample = imu_sample(k * 5_000_000, 0.0);
        sample.specific_force_mps2 = Vector3::new(0.0, 0.0, 1.01);
        maker.imu("/imu", &sample);
    }
    maker.imu("/imu", &imu_sample(10_000_000, 0.0)); // goes back
    let mut bad = scan(0, 2.0);
    bad.points[3].position.x = f32::NAN;
    bad.points[4].offset_ns = 4_000_000_000;
    maker.scan("/points", "lidar", &scan(0, 2.0));
    bad.start = Stamp(T0_NS + SCAN_NS);
    // The wild time widens the span of one scan; the others decide.
    maker.scan("/points", "lidar", &bad);
    maker.scan("/points", "lidar", &RawScan { start: Stamp(T0_NS + 2 * SCAN_NS), ..scan(0, 2.0) });
    maker.scan("/points", "lidar", &RawScan { start: Stamp(T0_NS + 3 * SCAN_NS), points: Vec::new() });
    maker.finish();
    let (read, faults) = read(&path);
    let force = read
        .iter()
        .find_map(|event| if let SensorEvent::Imu(imu) = event { Some(imu.specific_force_mps2.z) } else { None });
    assert!((force.unwrap() - 1.01 * 9.806_65).abs() < 1e-9);
    let scans: Vec<usize> = read
        .iter()
        .filter_map(|event| if let SensorEvent::Scan(scan) = event { Some(scan.points.len()) } else { None })
        .collect();
    assert_eq!(scans, [30, 29, 30, 0]);
    let is =
        |test: fn(&BagError) -> bool| faults.iter().any(|f| matches!(f, RecordingError::Bag(error) if test(error)));
    assert!(is(|error| matches!(error, BagError::NotLater { .. })));
    assert!(is(|error| matches!(error, BagError::PointsWithoutTime { count: 1, .. })));
    assert_eq!(faults.len(), 2, "{faults:?}");
}
