//! A folder as `make_lio_sequence.py` writes it: `meta.json`, `imu.csv`, `motor.csv` and `scans/NNNNNN.npz`.
//!
//! Of each scan the points in the turning sensor's frame are taken (`xyz_raw`, with `t` and `ring`) and the motor's
//! angle from `motor.csv`. Without `motor.csv` the points in the stator's frame (`xyz`) of a fixed LiDAR are taken.
//! The true trajectory and the labels in the folder are not looked at.

use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use omni_perception::{EncoderSample, ImuSample, RawPoint, RawScan, RotatingMount, Stamp};
use serde::Deserialize;

use crate::recording::npz::{Npz, NpzError};
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

/// Opens a folder.
///
/// # Errors
/// [`RecordingError`] if the description or a table cannot be read. A line or a scan that cannot be read is an
/// error in the stream.
pub fn open(folder: &Path) -> Result<Recording, RecordingError> {
    let path = folder.join("meta.json");
    let text = read(&path)?;
    let meta: Meta =
        serde_json::from_str(&text).map_err(|source| RecordingError::Json { path: path.clone(), source })?;
    let field = |field, expected| RecordingError::Field { path: path.clone(), field, expected };
    if meta.t0.is_nan() || meta.t0.abs() >= 9e9 {
        return Err(field("t0", "seconds within 64 bits of nanoseconds"));
    }
    let pose = "a unit quaternion x, y, z, w and a position x, y, z";
    let mut mount = RotatingMount {
        body_from_stator: isometry(&meta.T_imu_lidar_quat_xyzw_xyz)
            .ok_or_else(|| field("T_imu_lidar_quat_xyzw_xyz", pose))?,
        rotor_from_sensor: isometry(&meta.T_rotor_sensor_quat_xyzw_xyz)
            .ok_or_else(|| field("T_rotor_sensor_quat_xyzw_xyz", pose))?,
    };
    let motor = folder.join("motor.csv");
    let is_rotating = motor.is_file();
    if !is_rotating {
        mount.rotor_from_sensor = Isometry3::identity();
    }

    let imu = folder.join("imu.csv");
    let imu = table(&imu, "t,gx,gy,gz,ax,ay,az", |stamp, [gx, gy, gz, ax, ay, az]: [f64; 6]| {
        SensorEvent::Imu(ImuSample {
            stamp,
            angular_velocity_radps: Vector3::new(gx, gy, gz),
            specific_force_mps2: Vector3::new(ax, ay, az),
        })
    })?;
    let encoder = match is_rotating {
        true => table(&motor, "t,angle", |stamp, [angle_rad]: [f64; 1]| {
            SensorEvent::Encoder(EncoderSample { stamp, angle_rad })
        })?,
        false => VecDeque::new(),
    };
    let points = if is_rotating { "xyz_raw" } else { "xyz" };
    let t0 = Stamp((meta.t0 * 1e9).round() as i64);
    let scans = ScanFiles { files: scan_files(folder)?, t0, points };
    let sources: [Box<dyn Iterator<Item = Item>>; 3] =
        [Box::new(imu.into_iter()), Box::new(encoder.into_iter()), Box::new(scans)];
    let heads = sources.map(|mut source| (source.next(), source));
    let rig = RecordedRig { mount, is_rotating, body_from_imu: Isometry3::identity() };
    Ok(Recording { rig, events: Box::new(Merged { heads }) })
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
}

impl Iterator for ScanFiles {
    type Item = Item;

    fn next(&mut self) -> Option<Item> {
        let path = self.files.pop_front()?;
        let scan = read_scan(&path, self.t0, self.points);
        Some(scan.map(SensorEvent::Scan).map_err(|source| RecordingError::Scan { path, source }))
    }
}

fn read_scan(path: &Path, t0: Stamp, points: &'static str) -> Result<RawScan, NpzError> {
    let mut file = Npz::open(path)?;
    let positions = file.rows_of_three(points)?;
    let times_s = file.doubles("t")?;
    let rings = file.bytes("ring")?;
    for (name, size, length) in [("t", 8, times_s.len()), ("ring", 1, rings.len())] {
        if length != positions.len() {
            let (found, expected) = ((length * size) as u64, (positions.len() * size) as u64);
            return Err(NpzError::Length { name, found, expected });
        }
    }
    // Times that are not finite or lie more than four seconds after the first are no times of one sweep.
    let start_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
    let start_ns = (start_s * 1e9).round();
    if times_s.iter().any(|t| t.is_nan() || t - start_s > 4.0 || t.abs() > 1e9) {
        return Err(NpzError::Type { name: "t", expected: "seconds of one sweep" });
    }
    let point = |((position, t), ring): ((&[f32; 3], &f64), &u8)| RawPoint {
        position: Point3::from(*position),
        offset_ns: ((t * 1e9).round() - start_ns) as u32,
        ring: u16::from(*ring),
    };
    let start = if times_s.is_empty() { t0 } else { t0.plus_ns(start_ns as i64) };
    Ok(RawScan { start, points: positions.iter().zip(&times_s).zip(&rings).map(point).collect() })
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
    let error = |index| RecordingError::Line { path: path.to_owned(), line: index + 1, columns };
    Ok(lines.map(|(index, line)| parse(line).ok_or_else(|| error(index))).collect())
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
