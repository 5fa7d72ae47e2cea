//! A folder of posed scans: `poses.csv` (columns `index`, `tx ty tz`, `qx qy qz qw`: world from sensor) and `scan_0000.ply` and so on
//! (binary, `float x y z` in the sensor's frame, `ushort label` and `ushort instance` if there are any).

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use arena::mission::volumetric_map::Mesh;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::{PosedScan, Scans};

/// The table of a folder, read.
pub struct ScanFolder {
    poses: Vec<(PathBuf, Isometry3<f64>)>,
}

impl ScanFolder {
    /// Reads the poses.
    pub fn open(folder: &Path) -> Result<ScanFolder> {
        Ok(ScanFolder { poses: read_poses(&folder.join("poses.csv"))? })
    }

    /// Number of scans.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Reads scan after scan.
    pub fn scans(&self) -> Scans {
        Box::new(self.poses.clone().into_iter().map(|(file, pose)| read_scan(&file, &pose)))
    }
}

fn read_scan(file: &Path, world_from_sensor: &Isometry3<f64>) -> Result<PosedScan> {
    let name = file.display().to_string();
    let input = File::open(file).with_context(|| format!("opening {name}"))?;
    let scan = Mesh::read_ply(input).with_context(|| format!("reading {name}"))?;
    let points: Vec<_> = scan.vertices.iter().map(|p| (world_from_sensor * p.cast::<f64>()).cast::<f32>()).collect();
    let instances = scan.instances.into_iter().chain(std::iter::repeat(0));
    let tagged = points.iter().zip(scan.labels).zip(instances).map(|((p, label), instance)| (*p, label, instance));
    let labelled = tagged.filter(|(_, label, _)| *label != 0).collect();
    Ok(PosedScan { name, origin: world_from_sensor.translation.vector.into(), points, labelled, skipped: 0 })
}

/// Between two scans nothing that carries a LiDAR moves farther than this.
const LONGEST_JUMP_M: f64 = 100.0;

/// Scan files and their poses, in the order of the table.
fn read_poses(file: &Path) -> Result<Vec<(PathBuf, Isometry3<f64>)>> {
    let text = std::fs::read_to_string(file).with_context(|| format!("reading {}", file.display()))?;
    let mut lines = text.lines().enumerate();
    let header: Vec<&str> = lines.next().map(|(_, line)| line.split(',').map(str::trim).collect()).unwrap_or_default();
    let mut columns = [0; 8];
    for (column, name) in columns.iter_mut().zip(["index", "tx", "ty", "tz", "qx", "qy", "qz", "qw"]) {
        *column = header.iter().position(|title| *title == name).with_context(|| {
            format!(
                "{}: the first line has no column \"{name}\" (wanted: index,stamp,tx,ty,tz,qx,qy,qz,qw)",
                file.display()
            )
        })?;
    }
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut poses: Vec<(PathBuf, Isometry3<f64>)> = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let place = || format!("{}, line {}", file.display(), number + 1);
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let mut values = [0.0; 8];
        for (value, column) in values.iter_mut().zip(columns) {
            let cell = cells.get(column).with_context(|| format!("{}: too few columns", place()))?;
            *value = cell
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .with_context(|| format!("{}: \"{cell}\" ({}) is not a finite number", place(), header[column]))?;
        }
        let [index, x, y, z, qx, qy, qz, qw] = values;
        ensure!(index >= 0.0 && index.fract() == 0.0, "{}: index {index} is not a whole number", place());
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        let norm = quaternion.norm();
        ensure!((0.9..1.1).contains(&norm), "{}: the quaternion has length {norm:.3}, it must be 1", place());
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(quaternion));
        if let Some((_, last)) = poses.last() {
            let jump_m = (pose.translation.vector - last.translation.vector).norm();
            ensure!(
                jump_m <= LONGEST_JUMP_M,
                "{}: the pose jumps by {jump_m:.1} m (at most {LONGEST_JUMP_M})",
                place()
            );
        }
        poses.push((folder.join(format!("scan_{index:04}.ply")), pose));
    }
    if poses.is_empty() {
        bail!("{} holds no poses", file.display());
    }
    Ok(poses)
}
