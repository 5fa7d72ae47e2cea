//! `omnivln record`, `odometry`, `map` and `fuse` as a program meets them: a bag of some seconds, followed and mapped.

mod support;

use std::fs;
use std::path::Path;

use support::{json, keys, omnivln};

/// Stamp and position of each line.
fn trajectory(path: &Path) -> Vec<[f64; 4]> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            assert_eq!(words.len(), 8, "{line}");
            assert_eq!(words[0].split('.').nth(1).map(str::len), Some(9), "nine decimals: {line}");
            [0, 1, 2, 3].map(|k| words[k].parse().unwrap())
        })
        .collect()
}

#[test]
fn a_recording_is_followed() {
    let root = tempfile::tempdir().unwrap();
    let path = |name: &str| root.path().join(name).to_str().unwrap().to_owned();
    let bag = path("bag");
    let described = json(&["record", "--scene", "flat", "--max-time", "5", "--quiet", "--json", "--out", &bag]);
    assert_eq!(described["scans"], 50);

    let summary = json(&["odometry", &bag, "--out", &path("one.tum"), "--map-out", &path("map"), "--json"]);
    let promised = [
        "scans",
        "scans_tracked",
        "cpu_ms_per_scan_median",
        "cpu_ms_per_scan_p95",
        "rss_growth_mib",
        "status_counts",
        "degenerate_scans",
        "dropped",
    ];
    assert_eq!(keys(&summary), promised.into());
    assert_eq!(summary["scans"], 50);
    assert!(summary["scans_tracked"].as_u64().unwrap() >= 44, "{summary}");
    assert!(fs::metadata(path("map")).unwrap().len() > 1000);

    // The robot stood for two seconds and then walked: both trajectories say how far.
    let (ours, truth) =
        (trajectory(Path::new(&path("one.tum"))), trajectory(&Path::new(&bag).join("truth/trajectory.tum")));
    let moved_m = |way: &[[f64; 4]], to_s: f64| {
        let at = way.iter().min_by(|a, b| (a[0] - to_s).abs().total_cmp(&(b[0] - to_s).abs())).unwrap();
        (1..4).map(|k| (at[k] - way[0][k]).powi(2)).sum::<f64>().sqrt()
    };
    let end_s = ours.last().unwrap()[0];
    let (by_odometry_m, in_truth_m) = (moved_m(&ours, end_s), moved_m(&truth, end_s));
    assert!(in_truth_m > 0.1, "{in_truth_m}");
    assert!((by_odometry_m - in_truth_m).abs() < 0.02, "{by_odometry_m} {in_truth_m}");

    // Threads change nothing.
    json(&["odometry", &bag, "--out", &path("two.tum"), "--threads", "2", "--json"]);
    assert_eq!(fs::read(path("one.tum")).unwrap(), fs::read(path("two.tum")).unwrap());

    // A rig that does not turn takes the points that the driver straightened for the motor; its pose is the file's.
    let rig = "version = 1\n[lidar]\nmount = \"fixed\"\nlink = \"body\"\nxyz_m = [0.0, 0.0, 0.1]\n[imu]\nlink = \"body\"\n[[camera]]\nname = \"p\"\nlink = \"body\"\n\
               model = \"equirectangular\"\nwidth_px = 64\nheight_px = 32\nphi_top_rad = 1.0\nphi_bottom_rad = -1.0\n";
    fs::write(path("rig.toml"), rig).unwrap();
    let summary = json(&["odometry", &bag, "--rig", &path("rig.toml"), "--out", &path("rig.tum"), "--json"]);
    assert!(summary["scans_tracked"].as_u64().unwrap() >= 40, "{summary}");
    assert!(!summary["dropped"].as_object().unwrap().contains_key("encoder_not_later"));
    // The topic may be named; one that is not there is refused with those that are.
    let (code, _, err) = omnivln(&["odometry", &bag, "--points", "/nowhere", "--out", &path("no.tum")]);
    assert_eq!(code, Some(2));
    assert!(err.contains("/points_raw") && !Path::new(&path("no.tum")).exists(), "{err}");

    // Cut in the middle: what was there is followed, and the loss is told.
    let mcap = Path::new(&bag).join("bag_0.mcap");
    let bytes = fs::read(&mcap).unwrap();
    fs::write(&mcap, &bytes[..bytes.len() / 2]).unwrap();
    let summary = json(&["odometry", &bag, "--out", &path("cut.tum"), "--json"]);
    assert_eq!(summary["dropped"]["files_truncated"], 1, "{summary}");
    assert!(summary["scans"].as_u64().unwrap() < 40);
}

#[test]
fn what_cannot_be_followed_ends_with_two_and_leaves_no_file() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out.tum");
    let refused = |recording: &Path, words: &[&str]| {
        let (code, _, err) = omnivln(&["odometry", recording.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        assert_eq!(code, Some(2), "{err}");
        words.iter().for_each(|word| assert!(err.contains(word), "says nothing of {word:?}: {err}"));
        assert!(!out.exists());
    };
    refused(root.path(), &["is no recording", "meta.json"]);
    fs::write(root.path().join("x.mcap"), b"not a bag").unwrap();
    refused(&root.path().join("x.mcap"), &["x.mcap"]);
    fs::remove_file(root.path().join("x.mcap")).unwrap();
    fs::write(root.path().join("meta.json"), "{\"t0\": 0.0}").unwrap();
    refused(root.path(), &["meta.json"]);
}

/// Vertices of a mesh as a program wrote it.
fn vertices(path: &Path) -> Vec<[f32; 3]> {
    let bytes = fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let count: usize = header.split("element vertex ").nth(1).unwrap().split('\n').next().unwrap().parse().unwrap();
    let properties = header.split("element face").next().unwrap();
    let stride = 4 * properties.matches("property float").count() + 2 * properties.matches("property ushort").count();
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    (0..count).map(|k| [0, 4, 8].map(|axis| number(end + k * stride + axis))).collect()
}

#[test]
fn a_recording_alone_becomes_a_map_that_is_asked_and_fused_again_on_its_own_trajectory() {
    let root = tempfile::tempdir().unwrap();
    let path = |name: &str| root.path().join(name).to_str().unwrap().to_owned();
    let bag = path("bag");
    json(&["record", "--scene", "flat", "--seed", "2", "--max-time", "4", "--quiet", "--json", "--out", &bag]);
    // What a robot must not know is not there to be read.
    fs::remove_dir_all(Path::new(&bag).join("truth")).unwrap();
    fs::remove_dir_all(Path::new(&bag).join("tasks")).unwrap();

    let summary = json(&["map", &bag, "--out", &path("map"), "--quiet", "--json"]);
    let promised = [
        "scans",
        "images",
        "duration_s",
        "path_m",
        "rooms",
        "objects",
        "places",
        "mesh_vertices",
        "mesh_faces",
        "is_interrupted",
        "dropped",
        "not_used",
        "stages",
    ];
    assert_eq!(keys(&summary), promised.into());
    let count = |key: &str| summary[key].as_u64().unwrap();
    assert_eq!((count("scans"), summary["dropped"].as_object().unwrap().len()), (40, 0));
    assert!(count("rooms") >= 1 && count("objects") >= 3 && count("places") >= 5, "{summary}");
    assert_eq!(count("mesh_vertices") as usize, vertices(Path::new(&path("map/mesh.ply"))).len());
    for file in
        ["graph.json", "map.bin", "map.json", "map.svg", "scene_graph.txt", "scene_objects.json", "trajectory.tum"]
    {
        assert!(fs::metadata(Path::new(&path("map")).join(file)).unwrap().len() > 100, "{file}");
    }
    let answer = json(&["ask", &path("map"), "go to the bedroom", "--json"]);
    assert!(!answer["rooms"].as_array().unwrap().is_empty());
    // Who has read enough closes the pipe: no panic.
    #[cfg(unix)]
    {
        let script = r#""$0" ask "$1" "go to the bedroom" | true"#;
        let arguments = ["-c", script, env!("CARGO_BIN_EXE_omnivln"), &path("map")];
        let output = std::process::Command::new("sh").args(arguments).output().unwrap();
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    // A disk that is full is told.
    #[cfg(target_os = "linux")]
    {
        let script = r#"exec "$0" ask "$1" "go to the bedroom" > /dev/full"#;
        let arguments = ["-c", script, env!("CARGO_BIN_EXE_omnivln"), &path("map")];
        let output = std::process::Command::new("sh").args(arguments).output().unwrap();
        let err = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && err.starts_with("error: writing to stdout"), "{err}");
    }
    fs::rename(Path::new(&bag).join("masks"), path("masks")).unwrap();
    let bare = json(&["map", &bag, "--out", &path("bare"), "--quiet", "--json"]);
    assert_eq!((bare["objects"].as_u64(), bare["images"].as_u64()), (Some(0), Some(0)));
    assert!(bare["rooms"].as_u64().unwrap() >= 1);
    let masks = path("masks");
    let with_masks = json(&["map", &bag, "--masks", &masks, "--out", &path("masked"), "--quiet", "--json"]);
    // The masks are the same, wherever they lie: the same bytes again, apart from the times.
    for file in ["graph.json", "map.bin", "mesh.ply", "trajectory.tum"] {
        assert!(fs::read(path(&format!("map/{file}"))).unwrap() == fs::read(path(&format!("masked/{file}"))).unwrap());
    }
    assert_eq!(with_masks["objects"], summary["objects"]);

    // Fused on the trajectory of the odometry: in the frame of that trajectory, level, the floor of the room is one plane.
    json(&["odometry", &bag, "--out", &path("imu.tum"), "--json"]);
    let fuse = |threads: &str| {
        let (out, imu) = (path(&format!("{threads}.ply")), path("imu.tum"));
        json(&["fuse", &bag, "--trajectory", &imu, "--out", &out, "--threads", threads, "--quiet", "--json"]);
        fs::read(out).unwrap()
    };
    assert!(fuse("1") == fuse("2"), "threads change nothing");
    let heights: Vec<f32> = vertices(Path::new(&path("1.ply"))).into_iter().map(|v| v[2]).collect();
    let lowest = heights.iter().copied().fold(f32::INFINITY, f32::min);
    let on_floor = heights.iter().filter(|z| (lowest..lowest + 0.06).contains(*z)).count();
    assert!(10 * on_floor > heights.len(), "{on_floor} of {} vertices within 6 cm of {lowest} m", heights.len());
}

#[test]
fn what_cannot_be_mapped_ends_with_two_and_a_sentence() {
    let root = tempfile::tempdir().unwrap();
    let path = |name: &str| root.path().join(name).to_str().unwrap().to_owned();
    fs::create_dir(path("empty")).unwrap();
    fs::create_dir(path("masks")).unwrap();
    fs::write(path("short.tum"), "1 0 0 0 0 0 0 1\n").unwrap();
    fs::write(path("broken.tum"), "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0\n").unwrap();
    let (empty, out) = (path("empty"), path("out"));
    for (arguments, words) in [
        (vec!["map", &empty, "--out", &out], vec!["empty", "metadata.yaml"]),
        (vec!["map", &empty, "--out", &out, "--masks", &path("masks")], vec!["masks", "STAMP.json"]),
        (vec!["map", &empty, "--out", &out, "--height", "NaN"], vec!["--height"]),
        (vec!["map", &empty, "--out", &out, "--rig", &path("no.toml")], vec!["no.toml"]),
        (vec!["map", &empty, "--out", &out, "--phrases", "mug"], vec!["--segmenter"]),
        (vec!["fuse", &empty, "--out", &out, "--trajectory", &path("short.tum")], vec!["1 poses"]),
        (vec!["fuse", &empty, "--out", &out, "--trajectory", &path("broken.tum")], vec!["line 2"]),
        (vec!["fuse", &empty, "--out", &out, "--trajectory", &path("no.tum")], vec!["no.tum"]),
    ] {
        let (code, text, err) = omnivln(&arguments);
        assert_eq!((code, text.as_str()), (Some(2), ""), "{arguments:?}: {err}");
        words.iter().for_each(|word| assert!(err.contains(word), "{arguments:?} says nothing of {word:?}: {err}"));
        assert!(!Path::new(&out).exists());
    }
}
