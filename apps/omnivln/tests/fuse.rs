//! `omnivln fuse` as a program meets it: stable keys, the same bytes at any number of threads, complaints that name the place.

mod support;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use support::omnivln;

fn fuse(arguments: &[&str]) -> (Option<i32>, String, String) {
    omnivln(&[&["fuse"], arguments].concat())
}

const HEADER: &str = "index,stamp,tx,ty,tz,qx,qy,qz,qw\n";

/// A room of 4 m x 3 m x 2.5 m seen from three places; the sensor looks backwards (half a turn about z).
fn write_room(folder: &Path) {
    let mut table = HEADER.to_owned();
    for index in 0..3 {
        let sensor = [1.0 + 0.5 * f64::from(index), 1.4, 1.0];
        let mut bytes = Vec::new();
        let mut count = 0;
        for row in 0..90 {
            for column in 0..180 {
                let elevation = (f64::from(row) + 0.5 - 45.0) * 2f64.to_radians();
                let azimuth = f64::from(column) * 2f64.to_radians();
                let ray = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
                let mut range = f64::INFINITY;
                for (axis, size) in [4.0, 3.0, 2.5].into_iter().enumerate() {
                    let wall = if ray[axis] > 0.0 { size } else { 0.0 };
                    range = range.min((wall - sensor[axis]) / ray[axis]);
                }
                for value in [-ray[0] * range, -ray[1] * range, ray[2] * range] {
                    bytes.extend((value as f32).to_le_bytes());
                }
                bytes.extend(2u16.to_le_bytes());
                count += 1;
            }
        }
        let mut file = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
             property float z\nproperty ushort label\nend_header\n"
        )
        .into_bytes();
        file.extend(bytes);
        fs::write(folder.join(format!("scan_{index:04}.ply")), file).unwrap();
        table += &format!("{index},{}.0,{},{},{},0,0,1,0\n", index, sensor[0], sensor[1], sensor[2]);
    }
    fs::write(folder.join("poses.csv"), table).unwrap();
}

const KEYS: [&str; 15] = [
    "scans",
    "points",
    "points_skipped",
    "cpu_s_integrate",
    "cpu_s_labels",
    "cpu_s_mesh",
    "cpu_s_distance",
    "cpu_s_places",
    "blocks",
    "observed_voxels",
    "bytes_per_observed_voxel",
    "mesh_vertices",
    "mesh_faces",
    "places",
    "place_edges",
];

#[test]
fn a_room_becomes_a_mesh_and_places_with_the_same_bytes_at_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let mut files = Vec::new();
    for threads in ["1", "2", "4"] {
        let (out, places) = (path(&format!("{threads}.ply")), path(&format!("{threads}.json")));
        let arguments = [&path(""), "--out", &out, "--places", &places, "--threads", threads, "--json"];
        let (code, text, err) = fuse(&arguments);
        assert_eq!(code, Some(0), "{err}");
        let summary: Value = serde_json::from_str(&text).unwrap();
        let keys: BTreeSet<&str> = summary.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys, KEYS.into_iter().collect());
        assert_eq!((summary["scans"].as_u64(), summary["points"].as_u64()), (Some(3), Some(3 * 180 * 90)));
        assert!(summary["bytes_per_observed_voxel"].as_f64().unwrap() < 11.0, "{summary}");
        files.push((fs::read(&out).unwrap(), fs::read(&places).unwrap()));
    }
    assert!(files.iter().all(|file| *file == files[0]), "threads change nothing");

    // Every vertex lies on a wall, the floor or the ceiling, in the world's frame, and carries the label of the scans.
    let mesh = &files[0].0;
    let end = mesh.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&mesh[..end]).unwrap();
    let count: usize = header.split("element vertex ").nth(1).unwrap().split('\n').next().unwrap().parse().unwrap();
    assert!(count > 8000, "{count} vertices of a room with 59 square metres");
    let mut unlabelled = 0;
    for vertex in mesh[end..].chunks_exact(14).take(count) {
        let at = |k: usize| f32::from_le_bytes(vertex[4 * k..4 * k + 4].try_into().unwrap());
        let off = [at(0), 4.0 - at(0), at(1), 3.0 - at(1), at(2), 2.5 - at(2)].map(f32::abs);
        assert!(off.into_iter().fold(f32::INFINITY, f32::min) < 0.03, "{:?}", [at(0), at(1), at(2)]);
        let label = u16::from_le_bytes([vertex[12], vertex[13]]);
        assert!(label == 2 || label == 0, "{label}");
        unlabelled += usize::from(label == 0);
    }
    // The rays are 2 degrees apart, up to 9 cm on the walls: some 5 cm cells were meshed, but no return in them voted.
    assert!(unlabelled * 20 < count, "{unlabelled} of {count} vertices carry no label");
    let places: Value = serde_json::from_slice(&files[0].1).unwrap();
    let nodes = places["nodes"].as_array().unwrap();
    assert!(!nodes.is_empty());
    for node in nodes {
        let at = |k: usize| node[k].as_f64().unwrap();
        let truth = [at(0), 4.0 - at(0), at(1), 3.0 - at(1), at(2), 2.5 - at(2)].into_iter().fold(2.0, f64::min);
        assert!((at(3) - truth).abs() <= 0.1, "{node}: {truth}");
    }
}

#[test]
fn the_band_alone_gives_the_surface_but_no_places() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (code, text, err) = fuse(&[&path(""), "--mode", "band", "--voxel", "0.1", "--out", &path("m.ply"), "--json"]);
    assert_eq!(code, Some(0), "{err}");
    let summary: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((summary["places"].as_u64(), summary["cpu_s_distance"].as_f64()), (Some(0), Some(0.0)));
    assert!(summary["mesh_vertices"].as_u64().unwrap() > 2000);
}

#[test]
fn bad_input_ends_with_two_and_a_sentence_and_the_old_mesh_stays() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("mesh.ply");
    fs::write(&out, "the old one").unwrap();
    let refused = |poses: Option<&str>, scan: &[u8], more: &[&str], words: &[&str]| {
        let scans = tempfile::tempdir().unwrap();
        if let Some(poses) = poses {
            fs::write(scans.path().join("poses.csv"), poses).unwrap();
        }
        fs::write(scans.path().join("scan_0000.ply"), scan).unwrap();
        let mut arguments = vec![scans.path().to_str().unwrap(), "--out", out.to_str().unwrap()];
        arguments.extend(more);
        let (code, text, err) = fuse(&arguments);
        assert_eq!((code, text.as_str()), (Some(2), ""), "{words:?}: {err}");
        for word in words {
            assert!(err.contains(word), "says nothing of {word:?}: {err}");
        }
        assert_eq!(fs::read_to_string(&out).unwrap(), "the old one");
    };
    let ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n\0\0\0\0\0\0\x80\x3f\0\0\0\0";
    let row = |row: &str| format!("{HEADER}{row}");
    let good = row("0,0,0,0,0,0,0,0,1");
    refused(None, ply, &[], &["poses.csv"]);
    refused(Some(""), ply, &[], &["poses.csv", "index"]);
    refused(Some(HEADER), ply, &[], &["no poses"]);
    refused(Some("index,tx\n"), ply, &[], &["\"ty\""]);
    refused(Some(&row("0,0,nan,0,0,0,0,0,1")), ply, &[], &["line 2", "tx"]);
    refused(Some(&row("0,0,0,0")), ply, &[], &["line 2", "too few"]);
    refused(Some(&row("0,0,0,0,0,0,0,0,0")), ply, &[], &["line 2", "quaternion"]);
    refused(Some(&row("0,0,0,0,0,0,0,0,1\n0,1,1000,0,0,0,0,0,1")), ply, &[], &["line 3", "jumps"]);
    refused(Some(&row("7,0,0,0,0,0,0,0,1")), ply, &[], &["scan_0007.ply"]);
    refused(Some(&row("0,0,1e12,0,0,0,0,0,1")), ply, &[], &["scan_0000.ply"]);
    refused(Some(&good), b"plain text", &[], &["scan_0000.ply"]);
    refused(Some(&good), &ply[..ply.len() - 3], &[], &["scan_0000.ply"]);
    refused(Some(&good), &ply[..ply.len() - 3], &["--threads", "2"], &["scan_0000.ply"]);
    for voxel in ["0", "nan", "-1"] {
        refused(Some(&good), ply, &[&format!("--voxel={voxel}")], &["--voxel"]);
    }
    refused(Some(&good), ply, &["--threads", "0"], &["--threads"]);
    refused(Some(&good), ply, &["--mode", "band", "--places", "p.json"], &["--mode clear"]);
}

/// The shell lets files grow to 8 blocks only and keeps the signal away, so that writing fails half-way: to the program, a full disk.
#[cfg(unix)]
#[test]
fn on_a_full_disk_the_old_mesh_stays_whole() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path());
    let out = folder.path().join("mesh.ply");
    fs::write(&out, "the old one").unwrap();
    let script = r#"trap '' XFSZ; ulimit -f 8; exec "$0" fuse "$1" --out "$2" --quiet"#;
    let program = env!("CARGO_BIN_EXE_omnivln");
    let output = Command::new("sh").args(["-c", script, program]).arg(folder.path()).arg(&out).output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{err}");
    assert!(err.contains("mesh.ply"), "{err}");
    assert_eq!(fs::read_to_string(&out).unwrap(), "the old one");
    let left = fs::read_dir(folder.path())
        .unwrap()
        .filter(|f| f.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(left.count(), 0, "nothing is left lying about");
}
