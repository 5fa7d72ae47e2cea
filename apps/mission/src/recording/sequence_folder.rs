//! A folder as `make_lio_sequence.py` writes it: `meta.json`, `imu.csv`, `motor.csv` and `scans/NNNNNN.npz`.
//!
//! Of each scan the points in the turning sensor's frame are taken (`xyz_raw`, with `t` and `ring`) and the motor's
//! angle from `motor.csv`. Without `motor.csv`, or with a rig that does not turn, the points in the stator's frame (`xyz`)
//! are taken. Times of points may be in any unit, after `t0` or since 1970; specific forces may be in multiples of gravity.
//! The true trajectory and the labels in the folder are not looked at.

use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use omni_perception::{EncoderSample, ImuSample, RawPoint, RawScan, RotatingMount, Stamp};
use serde::Deserialize;

use crate::recording::npz::{Npz, NpzError};
use crate::recording::rosbag::point_times::TimeUnit;
use crate::recording::rosbag::survey::force_unit_mps2;
use crate::recording::{RecordedRig, Recording, RecordingError};
use crate::stream::SensorEvent;

/// What is used of `meta.json`.
#[derive(Debug, Deserialize)]
#[allow(non_snake_case)] // the file's own names
struct Meta {
    t0: f64,
    T_imu_lidar_quat_xyzw_xyz: [f64; 7],
    T_rotor_sensor_quat_xyzw_xyz: [f64; 7],
}

/// Opens a folder; `rig` takes the place of what `meta.json` says about the sensors.
///
/// # Errors
/// [`RecordingError`] if the description or a table cannot be read. A line or a scan that cannot be read is an
/// error in the stream, but a table without one good line is refused.
pub fn open(folder: &Path, rig: Option<RecordedRig>) -> Result<Recording, RecordingError> {
    let path = folder.join("meta.json");
    let text = read(&path)?;
    let meta: Meta =
        serde_json::from_str(&text).map_err(|source| RecordingError::Json { path: path.clone(), source })?;
    let field = |field, expected| RecordingError::Field { path: path.clone(), field, expected };
    if meta.t0.is_nan() || meta.t0.abs() >= 9e9 {
        return Err(field("t0", "seconds within 64 bits of nanoseconds"));
    }
    let motor = folder.join("motor.csv");
    let rig = match rig {
        Some(rig) => rig,
        None => {
            let pose = "a unit quaternion x, y, z, w and a position x, y, z";
            let lidar = isometry(&meta.T_imu_lidar_quat_xyzw_xyz);
            let sensor = isometry(&meta.T_rotor_sensor_quat_xyzw_xyz);
            let is_rotating = motor.is_file();
            let body_from_stator = lidar.ok_or_else(|| field("T_imu_lidar_quat_xyzw_xyz", pose))?;
            let sensor = sensor.ok_or_else(|| field("T_rotor_sensor_quat_xyzw_xyz", pose))?;
            let rotor_from_sensor = if is_rotating { sensor } else { Isometry3::identity() };
            let mount = RotatingMount { body_from_stator, rotor_from_sensor };
            RecordedRig { mount, is_rotating, body_from_imu: Isometry3::identity() }
        }
    };

    let mut imu =
        table(&folder.join("imu.csv"), "t,gx,gy,gz,ax,ay,az", |stamp, [gx, gy, gz, ax, ay, az]: [f64; 6]| {
            SensorEvent::Imu(ImuSample {
                stamp,
                angular_velocity_radps: Vector3::new(gx, gy, gz),
                specific_force_mps2: Vector3::new(ax, ay, az),
            })
        })?;
    scale_forces(&mut imu);
    let encoder = match rig.is_rotating {
        true if !motor.is_file() => return Err(RecordingError::NoMotor { path: motor }),
        true => table(&motor, "t,angle", |stamp, [angle_rad]: [f64; 1]| {
            SensorEvent::Encoder(EncoderSample { stamp, angle_rad })
        })?,
        false => VecDeque::new(),
    };
    let points = if rig.is_rotating { "xyz_raw" } else { "xyz" };
    let t0 = Stamp((meta.t0 * 1e9).round() as i64);
    let scans = ScanFiles { files: scan_files(folder)?, t0, points, times: None, newest: t0 };
    let sources: [Box<dyn Iterator<Item = Item>>; 3] =
        [Box::new(imu.into_iter()), Box::new(encoder.into_iter()), Box::new(scans)];
    let heads = sources.map(|mut source| (source.next(), source));
    Ok(Recording { rig, body_from_camera: None, events: Box::new(Merged { heads }) })
}

/// Forces in multiples of gravity become m/s^2.
fn scale_forces(imu: &mut VecDeque<Item>) {
    const SAMPLES: usize = 50;
    let forces = imu.iter().filter_map(|item| match item {
        Ok(SensorEvent::Imu(sample)) => Some(sample.specific_force_mps2.norm()),
        _ => None,
    });
    let unit_mps2 = force_unit_mps2(&forces.take(SAMPLES).collect::<Vec<_>>());
    for item in imu {
        if let Ok(SensorEvent::Imu(sample)) = item {
            sample.specific_force_mps2 *= unit_mps2;
        }
    }
}

type Item = Result<SensorEvent, RecordingError>;
type Head = (Option<Item>, Box<dyn Iterator<Item = Item>>);

/// Three streams joined by the time of their heads; an error is passed on as soon as it is a head. Equal times: the
/// IMU first, then the encoder, then the scan.
struct Merged {
    heads: [Head; 3],
}

impl Iterator for Merged {
    type Item = Item;

    fn next(&mut self) -> Option<Item> {
        let time = |head: &Head| match &head.0 {
            Some(Ok(event)) => Some(event.stamp()),
            Some(Err(_)) => Some(Stamp(i64::MIN)),
            None => None,
        };
        let first = self.heads.iter_mut().filter_map(|head| Some((time(head)?, head))).min_by_key(|(time, _)| *time)?.1;
        std::mem::replace(&mut first.0, first.1.next())
    }
}

/// Scans, read one at a time.
struct ScanFiles {
    files: VecDeque<PathBuf>,
    t0: Stamp,
    points: &'static str,
    /// Known from the first scan with points on.
    times: Option<FolderTimes>,
    /// Start of the newest scan; an empty one counts as right after it.
    newest: Stamp,
}

/// How the points tell their time.
#[derive(Debug, Clone, Copy)]
struct FolderTimes {
    unit: TimeUnit,
    /// Since 1970, not since t0.
    is_absolute: bool,
}

impl FolderTimes {
    fn of(min: f64, max: f64, t0: Stamp) -> Option<FolderTimes> {
        let unit = TimeUnit::of_sweep(max - min, None)?;
        // A recording of more than a day is none.
        let after_s = [0, t0.0].map(|zero_ns| (min * unit.nanoseconds() - zero_ns as f64) * 1e-9);
        let is_absolute = after_s.map(|s| (-2.0..86_400.0).contains(&s)) != [true, false];
        (!is_absolute || (-2.0..86_400.0).contains(&after_s[1])).then_some(FolderTimes { unit, is_absolute })
    }

    /// After t0.
    fn ns(&self, t: f64, t0: Stamp) -> i64 {
        let ns = t * self.unit.nanoseconds();
        if self.is_absolute { (ns - t0.0 as f64).round() as i64 } else { ns.round() as i64 }
    }
}

impl Iterator for ScanFiles {
    type Item = Item;

    fn next(&mut self) -> Option<Item> {
        let path = self.files.pop_front()?;
        let scan = self.read(&path);
        if let Ok(scan) = &scan {
            self.newest = scan.start;
        }
        Some(scan.map(SensorEvent::Scan))
    }
}

impl ScanFiles {
    fn read(&mut self, path: &Path) -> Result<RawScan, RecordingError> {
        let failed = |source| RecordingError::Scan { path: path.to_owned(), source };
        let (positions, times, rings) = arrays(path, self.points).map_err(failed)?;
        let finite = times.iter().copied().filter(|t| t.is_finite());
        let (min, max) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), t| (min.min(t), max.max(t)));
        if times.is_empty() {
            return Ok(RawScan { start: self.newest.plus_ns(1), points: Vec::new() });
        }
        let unclear = || RecordingError::PointTimes { path: path.to_owned(), min, max };
        let known = self.times.or_else(|| FolderTimes::of(min, max, self.t0)).ok_or_else(unclear)?;
        self.times = Some(known);
        // Times that are not finite or lie more than four seconds after the first are no times of one sweep.
        if times.iter().any(|t| !t.is_finite()) || (max - min) * known.unit.nanoseconds() > 4e9 {
            return Err(unclear());
        }
        let start_ns = known.ns(min, self.t0);
        let point = |((position, t), ring): ((&[f32; 3], &f64), &u8)| RawPoint {
            position: Point3::from(*position),
            offset_ns: (known.ns(*t, self.t0) - start_ns) as u32,
            ring: u16::from(*ring),
        };
        let points = positions.iter().zip(&times).zip(&rings).map(point).collect();
        Ok(RawScan { start: self.t0.plus_ns(start_ns), points })
    }
}

type Arrays = (Vec<[f32; 3]>, Vec<f64>, Vec<u8>);

fn arrays(path: &Path, points: &'static str) -> Result<Arrays, NpzError> {
    let mut file = Npz::open(path)?;
    let (positions, times, rings) = (file.rows_of_three(points)?, file.doubles("t")?, file.bytes("ring")?);
    for (name, length) in [("t", times.len()), ("ring", rings.len())] {
        if length != positions.len() {
            return Err(NpzError::Count { name, found: length, expected: positions.len() });
        }
    }
    Ok((positions, times, rings))
}

fn scan_files(folder: &Path) -> Result<VecDeque<PathBuf>, RecordingError> {
    let scans = folder.join("scans");
    let failed = |source| RecordingError::Io { path: scans.clone(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(&scans).map_err(failed)? {
        files.push(entry.map_err(failed)?.path());
    }
    files.retain(|path| path.extension().is_some_and(|extension| extension == "npz"));
    files.sort();
    Ok(files.into())
}

/// A table with one heading line: a time in seconds, then N numbers. A line that is not that is an error in its place.
fn table<const N: usize>(
    path: &Path,
    columns: &'static str,
    event: impl Fn(Stamp, [f64; N]) -> SensorEvent,
) -> Result<VecDeque<Item>, RecordingError> {
    let parse = |line: &str| -> Option<SensorEvent> {
        let mut cells = line.split(',');
        let stamp = decimal_stamp(cells.next()?.trim())?;
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = cells.next()?.trim().parse().ok()?;
        }
        cells.next().is_none().then(|| event(stamp, numbers))
    };
    let text = read(path)?;
    let lines = text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty());
    let error = |index: usize, line: &str| {
        let found = line.chars().take(60).collect();
        RecordingError::Line { path: path.to_owned(), line: index + 1, found, columns }
    };
    let mut items: VecDeque<Item> = lines.map(|(index, line)| parse(line).ok_or_else(|| error(index, line))).collect();
    // Not one good line: the table holds something else.
    if items.iter().all(Result::is_err)
        && let Some(Err(first)) = items.pop_front()
    {
        return Err(first);
    }
    Ok(items)
}

/// Decimal seconds to nanoseconds, digit by digit: a float would lose a quarter of a microsecond at today's dates.
fn decimal_stamp(text: &str) -> Option<Stamp> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = fraction.get(..fraction.len().min(9))?;
    if !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let whole_s: i64 = whole.parse().ok()?;
    let fraction_ns: i64 = format!("{digits:0<9}").parse().ok()?;
    let fraction_ns = if whole.starts_with('-') { -fraction_ns } else { fraction_ns };
    Some(Stamp(whole_s.checked_mul(1_000_000_000)?.checked_add(fraction_ns)?))
}

fn isometry(numbers: &[f64; 7]) -> Option<Isometry3<f64>> {
    let [x, y, z, w, px, py, pz] = *numbers;
    let quaternion = Quaternion::new(w, x, y, z);
    let is_sound = (quaternion.norm() - 1.0).abs() < 1e-3 && [px, py, pz].iter().all(|p| p.is_finite());
    let parts = (Translation3::new(px, py, pz), UnitQuaternion::from_quaternion(quaternion));
    is_sound.then(|| Isometry3::from_parts(parts.0, parts.1))
}

fn read(path: &Path) -> Result<String, RecordingError> {
    fs::read_to_string(path).map_err(|source| RecordingError::Io { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.bytes());
        bytes.extend(data);
        bytes
    }

    fn npz(path: &Path, times_s: &[f64]) {
        let mut writer = zip::ZipWriter::new(fs::File::create(path).unwrap());
        let positions: Vec<u8> = (0..3 * times_s.len()).flat_map(|k| (k as f32).to_le_bytes()).collect();
        let times: Vec<u8> = times_s.iter().flat_map(|t| t.to_le_bytes()).collect();
        let count = times_s.len();
        for (name, array) in [
            ("xyz_raw.npy", npy("<f4", &format!("{count}, 3"), &positions)),
            ("t.npy", npy("<f8", &format!("{count},"), &times)),
            ("ring.npy", npy("|u1", &format!("{count},"), &vec![7; count])),
        ] {
            writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            writer.write_all(&array).unwrap();
        }
        writer.finish().unwrap();
    }

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write(
            "meta.json",
            r#"{"t0": 1700000000.0, "T_imu_lidar_quat_xyzw_xyz": [0,0,0,1, 0.06,-0.02,0.11],
                "T_rotor_sensor_quat_xyzw_xyz": [0.25881904510252074,0,0,0.9659258262890683, 0,0.03,0.05], "more": []}"#,
        );
        write(
            "imu.csv",
            "t,gx,gy,gz,ax,ay,az\n1700000000.000000,1,2,3,4,5,6\n1700000000.005000,0,0,nan,0,0,9.8\nrubbish\n",
        );
        write("motor.csv", "t,angle\n1700000000.000000,0.5\n1700000000.002000,0.6\n");
        fs::create_dir(folder.path().join("scans")).unwrap();
        npz(&folder.path().join("scans/000000.npz"), &[0.003, 0.001, 0.004]);
        folder
    }

    #[test]
    fn events_come_in_the_order_of_time_with_stamps_to_the_nanosecond() {
        let folder = folder();
        let recording = crate::recording::open(folder.path()).unwrap();
        assert!(recording.rig.is_rotating);
        assert_eq!(recording.rig.mount.body_from_stator.translation.vector, Vector3::new(0.06, -0.02, 0.11));
        let events: Vec<Item> = recording.events.collect();
        let t = 1_700_000_000_000_000_000_i64;
        let stamps: Vec<Option<i64>> = events.iter().map(|e| e.as_ref().ok().map(|e| e.stamp().0 - t)).collect();
        // IMU, motor, motor, scan (at its last point), IMU with a NaN that the odometry will refuse, and a line that is none.
        assert_eq!(stamps, [Some(0), Some(0), Some(2_000_000), Some(4_000_000), Some(5_000_000), None]);
        assert!(matches!(events[5], Err(RecordingError::Line { line: 4, .. })));
        let Ok(SensorEvent::Scan(scan)) = &events[3] else { panic!("{:?}", events[3]) };
        assert_eq!(scan.start.0 - t, 1_000_000);
        let offsets: Vec<u32> = scan.points.iter().map(|point| point.offset_ns).collect();
        assert_eq!(offsets, [2_000_000, 0, 3_000_000]);
        assert_eq!((scan.points[1].position, scan.points[1].ring), (Point3::new(3.0, 4.0, 5.0), 7));
    }

    #[test]
    fn damaged_scans_are_items_and_damaged_descriptions_are_errors() {
        let folder = folder();
        let scan = folder.path().join("scans/000000.npz");
        let bytes = fs::read(&scan).unwrap();
        fs::write(folder.path().join("scans/000001.npz"), &bytes[..bytes.len() / 2]).unwrap();
        npz(&folder.path().join("scans/000002.npz"), &[0.2, 9.0]);
        npz(&folder.path().join("scans/000003.npz"), &[0.3, f64::NAN]);
        let events: Vec<Item> = open(folder.path(), None).unwrap().events.collect();
        let failed = events
            .iter()
            .filter(|event| matches!(event, Err(RecordingError::Scan { .. } | RecordingError::PointTimes { .. })))
            .count();
        assert_eq!(failed, 3);
        fs::write(folder.path().join("meta.json"), "{").unwrap();
        assert!(matches!(open(folder.path(), None), Err(RecordingError::Json { .. })));
        fs::remove_file(folder.path().join("meta.json")).unwrap();
        let error = crate::recording::open(folder.path()).err().unwrap();
        assert!(error.to_string().contains("meta.json"), "{error}");
    }

    /// The scan's start and offsets, whatever the times are counted in.
    #[test]
    fn times_in_any_unit_and_from_any_zero() {
        let folder = folder();
        let scan = folder.path().join("scans/000000.npz");
        let t0 = 1_700_000_000.0;
        for (unit, zero) in [(1.0, 0.0), (1e3, 0.0), (1e6, 0.0), (1e9, 0.0), (1e3, t0), (1e6, t0), (1.0, t0)] {
            npz(&scan, &[0.25, 0.2, 0.3].map(|t| (t + zero) * unit));
            let events: Vec<Item> = open(folder.path(), None).unwrap().events.collect();
            let scan = events.iter().find_map(|event| match event {
                Ok(SensorEvent::Scan(scan)) => Some(scan),
                _ => None,
            });
            let scan = scan.unwrap_or_else(|| panic!("{unit} {zero}: {events:?}"));
            let start_ns = scan.start.0 - 1_700_000_000_000_000_000;
            // A double holds today's date to a quarter of a microsecond.
            assert!((start_ns - 200_000_000).abs() < 1_000, "{unit} {zero}: {start_ns}");
            assert!((i64::from(scan.points[2].offset_ns) - 100_000_000).abs() < 1_000, "{unit} {zero}");
        }
        for times in [[0.2, 0.2, 0.2], [0.2, 1e12, 0.3], [5e5, 5e5 + 0.1, 5e5]] {
            npz(&scan, &times);
            let events: Vec<Item> = open(folder.path(), None).unwrap().events.collect();
            let fault = events.iter().find_map(|event| match event {
                Err(error @ RecordingError::PointTimes { .. }) => Some(error.to_string()),
                _ => None,
            });
            assert!(fault.as_ref().is_some_and(|fault| fault.contains("accepted are seconds")), "{times:?}: {fault:?}");
        }
        // An empty scan is a scan of its own time.
        npz(&scan, &[0.25, 0.2, 0.3]);
        npz(&folder.path().join("scans/000001.npz"), &[]);
        let scans = open(folder.path(), None).unwrap().events.filter(|e| matches!(e, Ok(SensorEvent::Scan(_)))).count();
        assert_eq!(scans, 2);
    }

    #[test]
    fn forces_in_g_are_understood_and_a_table_of_something_else_is_refused() {
        let folder = folder();
        let imu = folder.path().join("imu.csv");
        fs::write(&imu, "t,gx,gy,gz,ax,ay,az\n1700000000.0,0,0,0,0,0.1,0.99\n1700000000.005,0,0,0,0,0.1,0.99\n")
            .unwrap();
        let events: Vec<Item> = open(folder.path(), None).unwrap().events.collect();
        let force = events.iter().find_map(|event| match event {
            Ok(SensorEvent::Imu(sample)) => Some(sample.specific_force_mps2.z),
            _ => None,
        });
        assert!((force.unwrap() - 9.708_58).abs() < 1e-4, "{force:?}");
        // Milliseconds do not fit into nanoseconds of 64 bits.
        fs::write(&imu, "t,gx,gy,gz,ax,ay,az\n1700000000005.0,0,0,0,0,0,9.8\n1700000000010.0,0,0,0,0,0,9.8\n").unwrap();
        let error = open(folder.path(), None).err().unwrap().to_string();
        assert!(error.contains("line 2") && error.contains("1700000000005.0") && error.contains("seconds"), "{error}");
    }

    #[test]
    fn a_rig_decides_which_points_are_read() {
        let folder = folder();
        let rig = |is_rotating| {
            let mount = RotatingMount {
                body_from_stator: Isometry3::translation(1.0, 2.0, 3.0),
                rotor_from_sensor: Isometry3::identity(),
            };
            RecordedRig { mount, is_rotating, body_from_imu: Isometry3::identity() }
        };
        let turning = open(folder.path(), Some(rig(true))).unwrap();
        assert_eq!(turning.rig, rig(true));
        // The scan has no points in the stator's frame: the rig that stands still asks for them.
        let events: Vec<Item> = open(folder.path(), Some(rig(false))).unwrap().events.collect();
        assert!(
            events.iter().any(|event| event.as_ref().is_err_and(|error| error.to_string().contains("xyz"))),
            "{events:?}"
        );
        assert!(!events.iter().any(|event| matches!(event, Ok(SensorEvent::Encoder(_)))));
        fs::remove_file(folder.path().join("motor.csv")).unwrap();
        assert!(matches!(open(folder.path(), Some(rig(true))), Err(RecordingError::NoMotor { .. })));
    }

    #[test]
    fn decimal_seconds() {
        assert_eq!(decimal_stamp("1700000000.123456"), Some(Stamp(1_700_000_000_123_456_000)));
        assert_eq!(decimal_stamp("5"), Some(Stamp(5_000_000_000)));
        assert_eq!(decimal_stamp("-0.5"), Some(Stamp(-500_000_000)));
        for bad in ["", "nan", "1.2e3", "1.-5", "99999999999999", "1.2.3"] {
            assert_eq!(decimal_stamp(bad), None, "{bad}");
        }
    }
}
