//! Trajectories as text, in the form of the TUM benchmarks: `t x y z qx qy qz qw` a line, seconds and metres, `#` before remarks.
//!
//! Seconds are written and read as whole numbers of nanoseconds: seconds since 1970 in a float would lose the last digits.

use std::io;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use omni_perception::{OdometryEstimate, Stamp, Trajectory, TrajectoryError};
use thiserror::Error;

/// Why a trajectory cannot be read.
#[derive(Debug, Error)]
pub enum TumError {
    /// The file cannot be read.
    #[error("reading {}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line is not eight numbers.
    #[error("{} line {line}: \"{found}\" is not \"t x y z qx qy qz qw\" with finite numbers and a quaternion of length 1", .path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Its beginning.
        found: String,
    },
    /// Times do not ascend.
    #[error("{} line {line}: {stamp} is not later than the line before", .path.display())]
    NotLater {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Its time.
        stamp: Stamp,
    },
    /// Fewer than two poses.
    #[error("{} holds {count} poses; two are the least that make a way", .path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Poses in it.
        count: usize,
    },
}

/// One line, with its end.
pub fn tum_line(stamp: Stamp, pose: &Isometry3<f64>) -> String {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    let (s, ns) = (stamp.0.div_euclid(1_000_000_000), stamp.0.rem_euclid(1_000_000_000));
    format!("{s}.{ns:09} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}\n", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
}

/// Reads a file of poses in the order of time.
///
/// # Errors
/// [`TumError`] names the line and what would be accepted.
pub fn read_tum(path: &Path) -> Result<Vec<(Stamp, Isometry3<f64>)>, TumError> {
    let text = std::fs::read_to_string(path).map_err(|source| TumError::Io { path: path.to_owned(), source })?;
    let mut poses: Vec<(Stamp, Isometry3<f64>)> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default().trim();
        if content.is_empty() {
            continue;
        }
        let (path, line) = (path.to_owned(), index + 1);
        let Some(pose) = parse(content) else {
            return Err(TumError::Line { path, line, found: content.chars().take(60).collect() });
        };
        if poses.last().is_some_and(|(last, _)| *last >= pose.0) {
            return Err(TumError::NotLater { path, line, stamp: pose.0 });
        }
        poses.push(pose);
    }
    if poses.len() < 2 {
        return Err(TumError::TooShort { path: path.to_owned(), count: poses.len() });
    }
    Ok(poses)
}

fn parse(line: &str) -> Option<(Stamp, Isometry3<f64>)> {
    let mut words = line.split([' ', '\t', ',']).filter(|word| !word.is_empty());
    let stamp = seconds(words.next()?)?;
    let mut numbers = [0.0; 7];
    for number in &mut numbers {
        *number = words.next()?.parse().ok().filter(|number: &f64| number.is_finite())?;
    }
    let [x, y, z, qx, qy, qz, qw] = numbers;
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    let is_sound = words.next().is_none() && (quaternion.norm() - 1.0).abs() < 1e-2;
    is_sound.then(|| {
        (stamp, Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(quaternion)))
    })
}

/// Seconds to the nanosecond; whoever writes `1.7e9` has lost them already.
fn seconds(text: &str) -> Option<Stamp> {
    let exact = || {
        let (whole, part) = text.split_once('.').unwrap_or((text, ""));
        let is_plain = !whole.is_empty() && whole.bytes().chain(part.bytes()).all(|byte| byte.is_ascii_digit());
        let nanoseconds: String = part.chars().chain("000000000".chars()).take(9).collect();
        let (whole, part): (i64, i64) = (whole.parse().ok()?, nanoseconds.parse().ok()?);
        if is_plain { whole.checked_mul(1_000_000_000)?.checked_add(part).map(Stamp) } else { None }
    };
    let rounded = || text.parse().ok().filter(|s: &f64| s.abs() < 9e9).map(|s| Stamp((s * 1e9).round() as i64));
    exact().or_else(rounded)
}

/// The motion through poses of the body, with the velocities that their neighbours show.
///
/// # Errors
/// [`TrajectoryError`] if a pose or a velocity is not finite, or a time not later than the one before.
pub fn trajectory(poses: &[(Stamp, Isometry3<f64>)]) -> Result<Trajectory, TrajectoryError> {
    let mut trajectory = Trajectory::default();
    for (index, (stamp, pose)) in poses.iter().enumerate() {
        let (before, after) = (&poses[index.saturating_sub(1)], &poses[(index + 1).min(poses.len() - 1)]);
        let dt_s = after.0.seconds_since(before.0);
        let turn = (before.1.rotation.inverse() * after.1.rotation).scaled_axis();
        let way = after.1.translation.vector - before.1.translation.vector;
        let per_second = |total: Vector3<f64>| if dt_s > 0.0 { total / dt_s } else { Vector3::zeros() };
        let estimate = OdometryEstimate {
            velocity_in_world_mps: per_second(way),
            angular_velocity_in_body_radps: per_second(turn),
            ..OdometryEstimate::at_rest(*stamp, *pose)
        };
        trajectory.push(&estimate)?;
    }
    Ok(trajectory)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().expect("a place for files");
        std::fs::write(file.path(), text).expect("room");
        file
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(
            stamps in prop::collection::btree_set(0..2_000_000_000_000_000_000_i64, 2..20), seed in -3.0..3.0_f64
        ) {
            let pose = |k: usize| Isometry3::new(
                Vector3::new(seed, k as f64, -seed * k as f64),
                Vector3::new(0.3 * seed, -0.2, 0.1 * k as f64)
            );
            let poses: Vec<_> = stamps.into_iter().enumerate().map(|(k, ns)| (Stamp(ns), pose(k))).collect();
            let text: String = poses.iter().map(|(stamp, pose)| tum_line(*stamp, pose)).collect();
            let read = read_tum(file(&text).path()).unwrap();
            prop_assert_eq!(read.len(), poses.len());
            for ((stamp, pose), (read_stamp, read)) in poses.iter().zip(&read) {
                prop_assert_eq!(stamp, read_stamp);
                prop_assert!((pose.translation.vector - read.translation.vector).norm() < 1e-8);
                prop_assert!(pose.rotation.angle_to(&read.rotation) < 1e-8);
            }
        }
    }

    #[test]
    fn a_date_keeps_its_nanoseconds() {
        let line = tum_line(Stamp(1_700_000_000_000_000_007), &Isometry3::translation(1.0, 2.0, 3.0));
        assert!(line.starts_with("1700000000.000000007 1.000000000 2.0"), "{line}");
    }

    #[test]
    fn remarks_commas_and_exponents_are_read_and_nonsense_is_refused_with_its_line() {
        let poses = read_tum(file("# t x y z\n0.5 0 0 0 0 0 0 1\n\n1.5e0, 1,0,0, 0,0,0,1 # end\n").path()).unwrap();
        assert_eq!(poses.iter().map(|(stamp, _)| stamp.0).collect::<Vec<_>>(), [500_000_000, 1_500_000_000]);
        for (text, wanted) in [
            ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n", "line 2: \"1 0 0 0 0 0 1\""),
            ("0 0 0 0 0 0 0 1\n1 0 0 NaN 0 0 0 1\n", "line 2"),
            ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 0\n", "line 2"),
            ("0 0 0 0 0 0 0 1 9\n", "line 1"),
            ("x 0 0 0 0 0 0 1\n", "line 1"),
            ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "line 2"),
            ("1 0 0 0 0 0 0 1\n", "1 poses"),
            ("", "0 poses"),
        ] {
            let error = read_tum(file(text).path()).expect_err("nonsense").to_string();
            assert!(error.contains(wanted), "{text:?}: {error}");
        }
    }

    #[test]
    fn a_jump_that_no_number_holds_is_refused() {
        let path = file("0 -1e308 0 0 0 0 0 1\n1e-9 1e308 0 0 0 0 0 1\n");
        let poses = read_tum(path.path()).expect("finite");
        assert!(matches!(trajectory(&poses), Err(TrajectoryError::NotFinite { .. })));
    }

    #[test]
    fn between_poses_the_motion_is_smooth() {
        // A circle of 1 m at 1 rad/s, ten poses a second: between them to a tenth of a millimetre.
        let at = |t: f64| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * t);
            Isometry3::from_parts(Translation3::new(t.cos(), t.sin(), 0.0), turn)
        };
        let poses: Vec<_> = (0..30).map(|k| (Stamp(k * 100_000_000), at(0.1 * k as f64))).collect();
        let trajectory = trajectory(&poses).expect("sound");
        for k in 100..2800 {
            let t = 0.001 * f64::from(k);
            let pose = trajectory.world_from_body(Stamp(i64::from(k) * 1_000_000)).expect("inside");
            assert!((pose.translation.vector - at(t).translation.vector).norm() < 1e-4);
            assert!(pose.rotation.angle_to(&at(t).rotation) < 1e-4);
        }
    }
}
