//! A recording holds what the sensors said, bit for bit, in the layout that other readers know, and nothing true where the robot
//! reads.

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arena::dataset::{INDEX, make_dataset};
use arena::mission::omni_perception::{RawScan, Stamp};
use arena::mission::recording::open;
use arena::mission::recording::rosbag::mcap_stream::McapStream;
use arena::mission::recording::rosbag::ros_messages::{Imu, JointState, PointCloud2, PoseStamped, RosMessage, decode};
use arena::mission::recording::rosbag::writer::BAG_FILE;
use arena::mission::robot_model::RobotKind;
use arena::mission::segmented::segmented;
use arena::mission::segmenter_folder::FolderSegmenter;
use arena::mission::stage_clock::{CpuScope, StageClock};
use arena::mission::stream::SensorEvent;
use arena::pilot::{Pilot, PilotConfig};
use arena::record::{EPOCH_NS, RECORDING_MARK, RecordConfig, record};
use arena::record_topics::TopicWriter;
use arena::run_folder::RunFolder;
use arena::simulation::Simulation;
use arena::tour::Tour;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use serde_json::Value;
use support::{robot, scene};

/// Little LiDAR, little camera.
fn small(max_time_s: f64) -> RecordConfig {
    let mut config = RecordConfig { max_time_s: Some(max_time_s), ..RecordConfig::default() };
    config.simulation.lidar.columns = 128;
    config.simulation.lidar.beams = 8;
    config.simulation.panorama.width = 480;
    config.simulation.panorama.height = 160;
    config
}

fn recorded(config: &RecordConfig, kind: RobotKind, folder: &Path) -> Value {
    let stop = Arc::new(AtomicBool::new(false));
    let staged = RunFolder::marked(folder, RECORDING_MARK, "recording").unwrap();
    let description = record(config, &robot(kind), &scene("spin"), 3, &staged, &stop, &mut |_| {}).unwrap();
    staged.publish().unwrap();
    description
}

/// Every file below a folder with its bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            all.extend(files(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else {
            all.insert(name, fs::read(&path).unwrap());
        }
    }
    all
}

#[test]
fn the_same_seed_gives_the_same_bytes_at_one_and_two_threads() {
    let root = tempfile::tempdir().unwrap();
    let with_threads = |threads: usize| {
        let folder = root.path().join(threads.to_string());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| recorded(&small(1.2), RobotKind::Ground, &folder));
        files(&folder)
    };
    let (one, two) = (with_threads(1), with_threads(2));
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(two[name] == *bytes, "{name} differs");
    }
}

#[test]
fn what_the_sensors_said_is_read_bit_for_bit_and_the_stators_points_are_the_rotors_points_turned() {
    let root = tempfile::tempdir().unwrap();
    let (config, spin) = (small(1.0), scene("spin"));
    for kind in [RobotKind::Ground, RobotKind::Aerial] {
        let robot = robot(kind);
        let folder = root.path().join(format!("{kind:?}"));
        let start = support::start(&spin, &robot, &support::short(1.0), 5);
        let mut simulation = Simulation::new(&config.simulation, &robot, &spin, &start, &start, 5).unwrap();
        let mut topics = TopicWriter::create(&folder, &robot.sensors, EPOCH_NS).unwrap();
        let mut clock = StageClock::new(CpuScope::Thread);
        let mut pilot = Pilot::new(
            PilotConfig { rest_s: 0.1, ..PilotConfig::default() },
            &robot,
            &Tour {
                way: vec![start.translation.vector.xy().into(), (start * Point3::new(1.0, 0.0, 0.0)).xy()],
                room_m: vec![1.0; 2],
                rooms: Vec::new(),
                length_m: 1.0,
            },
            &start,
            0.0,
        );
        let mut said = Vec::new();
        for _ in 0..60 {
            let command = pilot.command(simulation.seconds(), 0.02, &simulation.true_pose());
            for event in simulation.advance(&command, 20_000_000, &mut clock).unwrap() {
                let event = match event {
                    SensorEvent::Imu(sample) => {
                        topics.imu(&sample, &simulation.true_pose_at(sample.stamp)).unwrap();
                        SensorEvent::Imu(sample)
                    }
                    SensorEvent::Encoder(sample) => {
                        topics.encoder(&sample).unwrap();
                        SensorEvent::Encoder(sample)
                    }
                    SensorEvent::Scan(scan) => {
                        topics.scan(&scan, scan.start.plus_ns(100_000_000)).unwrap();
                        SensorEvent::Scan(scan)
                    }
                    SensorEvent::Panorama(mut panorama) => {
                        topics.panorama(&panorama).unwrap();
                        panorama.masks.clear(); // they lie beside the bag
                        SensorEvent::Panorama(panorama)
                    }
                    SensorEvent::Odometry(_) | SensorEvent::Battery(_) => continue,
                };
                said.push(event);
            }
        }
        topics.finish().unwrap();
        // The sensors deliver a scan with the tick after its last point; the order of a recording is that of the stamps.
        said.sort_by_key(SensorEvent::stamp);
        let recording = open(&folder).unwrap();
        let sensors = &robot.sensors;
        assert_eq!(recording.rig.body_from_imu, sensors.body_from_imu);
        assert_eq!(recording.rig.mount.rotor_from_sensor, sensors.rotor_from_sensor);
        let difference = recording.rig.mount.body_from_stator.inverse() * sensors.body_from_lidar_stator;
        assert!(difference.translation.vector.norm() < 1e-12 && difference.rotation.angle() < 1e-7);
        let read: Vec<SensorEvent> = recording.events.map(Result::unwrap).collect();
        assert_eq!(read.len(), said.len());
        for (read, said) in read.iter().zip(&said) {
            assert_same(read, said);
        }

        check_stator_points(&folder, &simulation_scans(&said), sensors);
    }
}

fn assert_same(read: &SensorEvent, said: &SensorEvent) {
    let later = |stamp: Stamp| stamp.plus_ns(EPOCH_NS);
    match (read, said) {
        (SensorEvent::Imu(a), SensorEvent::Imu(b)) => {
            assert_eq!(a.stamp, later(b.stamp));
            assert_eq!(a.angular_velocity_radps, b.angular_velocity_radps);
            assert_eq!(a.specific_force_mps2, b.specific_force_mps2);
        }
        (SensorEvent::Encoder(a), SensorEvent::Encoder(b)) => {
            assert_eq!((a.stamp, a.angle_rad), (later(b.stamp), b.angle_rad));
        }
        (SensorEvent::Scan(a), SensorEvent::Scan(b)) => {
            assert_eq!((a.start, &a.points), (later(b.start), &b.points));
        }
        (SensorEvent::Panorama(a), SensorEvent::Panorama(b)) => {
            assert_eq!((a.stamp, &a.image), (later(b.stamp), &b.image));
        }
        (read, said) => panic!("{read:?} instead of {said:?}"),
    }
}

fn simulation_scans(events: &[SensorEvent]) -> Vec<RawScan> {
    let scan = |event: &SensorEvent| if let SensorEvent::Scan(scan) = event { Some(scan.clone()) } else { None };
    events.iter().filter_map(scan).collect()
}

/// The simulator's own mount, which knows the motor's angle without an encoder, says where the points of `/points` are.
fn check_stator_points(folder: &Path, scans: &[RawScan], sensors: &arena::mission::robot_model::SensorMounts) {
    let mount = omni_sim::lidar::RotatingMount {
        body_from_stator: nalgebra::Isometry3::identity(),
        rotor_from_sensor: sensors.rotor_from_sensor,
        rate_hz: sensors.lidar.rotation_hz,
        phase_rad: 0.0,
    };
    let mut stream = McapStream::new(vec![folder.join(BAG_FILE)]);
    let mut clouds = 0;
    while let Some(message) = stream.next_message().unwrap() {
        if message.channel.topic != "/points" {
            continue;
        }
        let cloud: PointCloud2<'_> = decode(message.payload).unwrap();
        let scan = &scans[clouds];
        assert_eq!(cloud.width as usize, scan.points.len());
        for (bytes, raw) in cloud.data.chunks_exact(24).zip(&scan.points) {
            let number = |k: usize| f32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().unwrap());
            let stator_from_sensor = mount.body_from_sensor(scan.start.0 + i64::from(raw.offset_ns));
            let expected = stator_from_sensor * raw.position.cast::<f64>();
            let error_m = (Point3::new(number(0), number(1), number(2)).cast::<f64>() - expected).norm();
            // Half a line of 16384 is 0.2 mrad; interpolation between two readings adds nothing.
            assert!(error_m < 4e-4 * expected.coords.norm().max(1.0), "{error_m}");
            assert_eq!(number(3), 0.0, "no label in disguise");
        }
        clouds += 1;
    }
    assert_eq!(clouds, scans.len());
}

#[test]
fn the_folder_has_what_readers_expect_and_nothing_true_where_the_robot_reads() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("recording");
    let description = recorded(&small(1.2), RobotKind::Ground, &folder);
    let all = files(&folder);
    let text = |name: &str| String::from_utf8(all[name].clone()).unwrap();

    // Topics: types, counts, frames.
    let mut stream = McapStream::new(vec![folder.join(BAG_FILE)]);
    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    let mut last_log_ns = 0;
    while let Some(message) = stream.next_message().unwrap() {
        assert_eq!(message.channel.encoding, "cdr");
        assert!(message.log_time_ns >= last_log_ns, "messages stand in the order of their log times");
        last_log_ns = message.log_time_ns;
        *counts.entry(format!("{} {}", message.channel.topic, message.channel.message_type)).or_default() += 1;
        if message.channel.message_type == PointCloud2::TYPE {
            let cloud: PointCloud2<'_> = decode(message.payload).unwrap();
            assert_eq!((cloud.height, cloud.point_step, cloud.is_dense), (1, 24, true));
            assert_eq!(cloud.data.len(), 24 * cloud.width as usize);
            // The header is the scan's start, the message is written at its end.
            assert_eq!(message.log_time_ns as i64 - cloud.header.stamp.stamp().0, 100_000_000);
        }
        if message.channel.message_type == Imu::TYPE {
            assert_eq!(decode::<Imu>(message.payload).unwrap().orientation_covariance[0], -1.0);
        }
    }
    let expected = [
        ("/ground_truth geometry_msgs/msg/PoseStamped", 240),
        ("/imu sensor_msgs/msg/Imu", 240),
        // 500 a second of the LiDAR's motor, 50 of the legs.
        ("/joint_states sensor_msgs/msg/JointState", 601 + 60),
        ("/panorama/compressed sensor_msgs/msg/CompressedImage", 3),
        ("/points sensor_msgs/msg/PointCloud2", 12),
        ("/points_raw sensor_msgs/msg/PointCloud2", 12),
        ("/tf_static tf2_msgs/msg/TFMessage", 1),
    ];
    assert_eq!(counts, expected.into_iter().map(|(topic, count)| (topic.to_owned(), count)).collect());

    // metadata.yaml says the same.
    let metadata = text("metadata.yaml");
    for line in ["  version: 9\n", "  storage_identifier: mcap\n", "    - bag_0.mcap\n", "        name: /points\n"] {
        assert!(metadata.contains(line), "{line} in\n{metadata}");
    }
    assert!(metadata.contains(&format!("  message_count: {}\n", counts.values().sum::<u64>())));

    // Masks and truth for each panorama; answers apart from questions.
    let names = |prefix: &str| -> Vec<&str> { all.keys().filter_map(|name| name.strip_prefix(prefix)).collect() };
    assert_eq!(names("masks/").len(), 3);
    assert_eq!(names("masks/"), names("truth/masks/"));
    let (questions, answers) = (text("tasks/tasks.jsonl"), text("tasks/answers.jsonl"));
    assert!(!questions.is_empty() && questions.lines().count() == answers.lines().count());
    assert_eq!(description["tasks"], questions.lines().count());
    assert_eq!(text("truth/trajectory.tum").lines().count(), 241, "a heading and 240 poses");
    for line in questions.lines() {
        let question: Value = serde_json::from_str(line).unwrap();
        let keys: Vec<&String> = question.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["id", "instruction", "kind"]);
    }
    for name in names("masks/") {
        let masks: Value = serde_json::from_slice(&all[&format!("masks/{name}")]).unwrap();
        for annotation in masks["annotations"].as_array().unwrap() {
            let keys = annotation.as_object().unwrap().keys().filter(|key| *key != "object_id");
            let keys: Vec<&String> = keys.collect();
            assert_eq!(keys, ["bbox", "caption", "class_name", "score", "segmentation"], "no instance");
        }
    }
    let is_robots = |name: &&String| !name.starts_with("truth/") && !name.contains("answers");
    assert_eq!(all.keys().filter(is_robots).count(), 3 + 3 + 1, "bag, metadata, description; masks; tasks");

    // What reads a recording takes no pose from it.
    let events: Vec<SensorEvent> = open(&folder).unwrap().events.map(Result::unwrap).collect();
    assert!(!events.iter().any(|event| matches!(event, SensorEvent::Odometry(_))));
}

/// What a viewer of robots would do with the bag: put the legs where `/joint_states` says, at the true pose of the same time. The feet
/// walk: some are down at any time, those do not slide, and all of them go along.
#[test]
fn the_joints_of_a_bag_put_the_feet_on_the_floor() {
    let root = tempfile::tempdir().unwrap();
    for is_lidar_fixed in [false, true] {
        let folder = root.path().join(format!("{is_lidar_fixed}"));
        let mut config = small(5.0);
        config.simulation.is_lidar_fixed = is_lidar_fixed;
        config.simulation.panorama.rate_hz = 0.01;
        config.pilot.rest_s = 0.5;
        let description = recorded(&config, RobotKind::Ground, &folder);
        assert_eq!(description["legs"]["worst_miss_m"], 0.0);
        let robot = robot(RobotKind::Ground);
        let body_from_imu = robot.sensors.body_from_imu;
        let (mut truth, mut states) = (BTreeMap::new(), Vec::new());
        let mut stream = McapStream::new(vec![folder.join(BAG_FILE)]);
        while let Some(message) = stream.next_message().unwrap() {
            if message.channel.message_type == PoseStamped::TYPE {
                let stamped: PoseStamped = decode(message.payload).unwrap();
                let (p, q) = (stamped.pose.position, stamped.pose.orientation);
                let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
                let world_from_imu = Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), turn);
                truth.insert(stamped.header.stamp.stamp(), world_from_imu * body_from_imu.inverse());
            }
            if message.channel.message_type == JointState::TYPE {
                let state: JointState = decode(message.payload).unwrap();
                if state.name.len() > 1 {
                    states.push((state.header.stamp.stamp(), state.name.into_iter().zip(state.position).collect()));
                }
            }
        }
        assert_eq!(states.len(), 250);
        let feet = |(stamp, angles): &(Stamp, BTreeMap<String, f64>)| -> Vec<Point3<f64>> {
            let frames = robot.frames_at(angles).unwrap();
            let place = |foot: &str| truth[stamp] * Point3::from(frames[foot].translation.vector);
            robot.legs.iter().map(|leg| place(&leg.foot)).collect()
        };
        let all: Vec<_> = states.iter().map(feet).collect();
        let sole_m = robot.stance_height_m + robot.frames["FL_foot"].translation.z;
        let (mut stood, mut swung) = (0, [false; 4]);
        for pair in all.windows(2) {
            let still = (0..4).filter(|leg| (pair[1][*leg] - pair[0][*leg]).norm() < 1e-6).count();
            assert!(
                still >= 2 || pair.iter().any(|feet| feet.iter().filter(|foot| foot.z - sole_m < 1e-3).count() >= 2)
            );
            stood += usize::from(still == 4);
            (0..4).for_each(|leg| swung[leg] |= pair[1][leg].z - sole_m > 0.03);
        }
        assert!(stood >= 20 && swung == [true; 4], "stood in {stood} of 250 steps, swung {swung:?}");
        let way = |from: &Point3<f64>, to: &Point3<f64>| (to - from).xy().norm();
        let body_m = (truth[&states[249].0].translation.vector - truth[&states[0].0].translation.vector).xy().norm();
        assert!(body_m > 0.5 && (0..4).all(|leg| (way(&all[0][leg], &all[249][leg]) - body_m).abs() < 0.6), "{body_m}");
        // And the reader of recordings takes the LiDAR's motor from the same topic, if there is one.
        let events: Vec<SensorEvent> = open(&folder).unwrap().events.map(Result::unwrap).collect();
        let encoders = events.iter().filter(|event| matches!(event, SensorEvent::Encoder(_))).count();
        assert_eq!(encoders > 2000, !is_lidar_fixed, "{encoders}");
    }
}

#[test]
fn a_tour_goes_through_every_room_without_a_touch_and_comes_home() {
    let root = tempfile::tempdir().unwrap();
    for kind in [RobotKind::Ground, RobotKind::Aerial] {
        let mut config = RecordConfig { max_time_s: None, ..small(0.0) };
        // Only the motion matters here.
        config.simulation.lidar.beams = 1;
        config.simulation.lidar.columns = 8;
        config.simulation.panorama.rate_hz = 0.01;
        let folder = root.path().join(format!("{kind:?}"));
        let staged = RunFolder::marked(&folder, RECORDING_MARK, "recording").unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let flat = scene("flat");
        let description = record(&config, &robot(kind), &flat, 1, &staged, &stop, &mut |_| {}).unwrap();
        staged.publish().unwrap();
        assert_eq!(description["touches"], 0, "{kind:?}");
        assert_eq!(description["is_cut"], false);
        let mut visited: Vec<u64> =
            description["rooms_visited"].as_array().unwrap().iter().filter_map(Value::as_u64).collect();
        visited.sort_unstable();
        visited.dedup();
        assert_eq!(visited.len(), flat.building.rooms.len());
        let (path_m, tour_m) = (description["path_m"].as_f64().unwrap(), description["tour_m"].as_f64().unwrap());
        assert!((0.8..1.3).contains(&(path_m / tour_m)), "{kind:?}: {path_m} of {tour_m} m");
        let trajectory = fs::read_to_string(folder.join("truth/trajectory.tum")).unwrap();
        let at = |line: &str| -> Vec<f64> { line.split(' ').skip(1).take(2).map(|n| n.parse().unwrap()).collect() };
        let lines: Vec<&str> = trajectory.lines().skip(1).collect();
        let (first, last) = (at(lines[0]), at(lines[lines.len() - 1]));
        assert!((first[0] - last[0]).hypot(first[1] - last[1]) < 0.6, "{first:?} {last:?}");
    }
}

#[test]
fn a_dataset_goes_on_where_it_stopped_and_leaves_other_folders_alone() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("dataset");
    let stop = Arc::new(AtomicBool::new(false));
    let mut made = Vec::new();
    let mut run =
        |count: usize| make_dataset(&folder, count, 1, &small(0.3), &stop, &mut |number, _, _| made.push(number));
    let first = run(1).unwrap();
    let second = run(2).unwrap();
    made.dedup();
    assert_eq!(made, [0, 1], "the first was kept");
    assert_eq!(first["recordings"][0], second["recordings"][0]);
    let index: Value = serde_json::from_slice(&fs::read(folder.join(INDEX)).unwrap()).unwrap();
    assert_eq!(index, second);
    for recording in index["recordings"].as_array().unwrap() {
        let path = folder.join(recording["folder"].as_str().unwrap());
        assert!(open(&path).unwrap().rig.is_rotating, "{}", path.display());
    }
    let foreign = root.path().join("photos");
    fs::create_dir(&foreign).unwrap();
    fs::write(foreign.join("cat.png"), b"meow").unwrap();
    let error = make_dataset(&foreign, 1, 1, &small(0.3), &stop, &mut |_, _, _| {}).unwrap_err().to_string();
    assert!(error.contains("no dataset"), "{error}");
}

/// What stands in `masks/` comes with the pictures; a picture without a file is a fault, and no picture of nothing.
#[test]
fn masks_beside_a_bag_come_with_its_pictures() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("bag");
    recorded(&small(1.2), RobotKind::Ground, &folder);
    let phrases = ["mug".to_owned()];
    let seen = || {
        let segmenter = FolderSegmenter::open(&folder.join("masks")).unwrap();
        let events = segmented(open(&folder).unwrap().events, segmenter, &phrases, &[]);
        let (mut pictures, mut faults) = (Vec::new(), Vec::new());
        for item in events {
            match item {
                Ok(SensorEvent::Panorama(panorama)) => pictures.push(panorama),
                Ok(_) => {}
                Err(error) => faults.push((error.loss(), error.to_string())),
            }
        }
        (pictures, faults)
    };
    let (pictures, faults) = seen();
    assert_eq!((pictures.len(), faults.len()), (3, 0), "{faults:?}");
    assert!(pictures.iter().all(|panorama| !panorama.masks.is_empty() && panorama.image.is_some()));
    assert!(
        pictures.iter().flat_map(|panorama| &panorama.masks).any(|mask| mask.track.is_some()),
        "numbers of the video"
    );
    let one = fs::read_dir(folder.join("masks")).unwrap().next().unwrap().unwrap().path();
    fs::remove_file(one).unwrap();
    let (pictures, faults) = seen();
    assert_eq!((pictures.len(), faults.len()), (2, 1));
    assert_eq!(faults[0].0, "images_without_masks");
    assert!(faults[0].1.contains("no file of masks"), "{faults:?}");
}

/// A dataset that is there is kept only if it is what would be made now.
#[test]
fn recordings_of_other_settings_are_made_anew() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("set");
    let stop = Arc::new(AtomicBool::new(false));
    let make = |is_fixed: bool, max_time_s: f64| {
        let mut config = small(max_time_s);
        config.simulation.is_lidar_fixed = is_fixed;
        let mut made = 0;
        let index = make_dataset(&folder, 1, 5, &config, &stop, &mut |_, _, _| made += 1).unwrap();
        (index["recordings"][0].clone(), made > 0)
    };
    let (first, was_made) = make(false, 0.3);
    assert!(was_made && first["lidar"] == "rotating");
    assert!(!make(false, 0.3).1, "kept");
    let (second, was_made) = make(true, 0.3);
    assert!(was_made && second["lidar"] == "fixed");
    let (third, was_made) = make(true, 0.6);
    assert!(was_made && third["duration_s"].as_f64().unwrap() > 0.5, "{third}");
}
