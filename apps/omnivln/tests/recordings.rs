//! `omnivln record` and `omnivln odometry` as a program meets them: a bag of three seconds, followed.

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
