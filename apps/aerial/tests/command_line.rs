//! The flying program shares its command line with the walking one (tested there); here what differs: its robot.

use std::fs;
use std::path::Path;
use std::process::Command;

fn robot(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_omnivln-aerial"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("it starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("the robot speaks UTF-8");
    let (out, err) = (text(output.stdout), text(output.stderr));
    assert!(!err.contains("panicked"), "{err}");
    (output.status.code(), out, err)
}

#[test]
fn a_walking_robot_is_sent_to_the_other_program() {
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../crates/robot-model/models");
    for file in ["quadruped.urdf", "quadruped.toml"] {
        fs::copy(models.join(file), folder.path().join(file)).unwrap();
    }
    let (code, out, err) = robot(folder.path(), &["find the sofa", "--scene", "spin", "--urdf", "quadruped.urdf"]);
    assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
    assert!(err.contains("ground robot") && err.contains("omnivln-ground"), "{err}");
    assert!(!folder.path().join("runs").exists(), "nothing was made");
}

#[test]
fn a_short_flight_leaves_a_complete_folder_in_the_default_place() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, err) = robot(folder.path(), &["find the unicorn", "--scene", "spin", "--max-time", "3", "--quiet"]);
    assert_eq!((code, err.as_str()), (Some(1), ""), "{out}");
    let run = folder.path().join("runs/aerial-spin-1");
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(run.join("summary.json")).unwrap()).unwrap();
    assert_eq!((summary["robot"].as_str(), summary["collisions"].as_u64()), (Some("aerial"), Some(0)));
    assert_eq!(out.trim_end(), summary["reason"].as_str().unwrap());
    assert!(run.join("report.html").is_file() && run.join("truth/trajectory.tum").is_file());
}

#[test]
fn a_fence_is_read_or_refused_and_never_crossed() {
    let folder = tempfile::tempdir().unwrap();
    for (fence, says) in [("0,0 0,4 4,0", "counter-clockwise"), ("0,0 4,0 4;4", "neither a corner X,Y nor heights")] {
        let (code, out, err) = robot(folder.path(), &["find the mug", "--fence", fence]);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
        assert!(err.contains(says), "{err}");
    }
    let (code, _, err) = robot(folder.path(), &["find the mug", "--battery", "100", "--battery-reserve", "100"]);
    assert!(code == Some(2) && err.contains("from 0 to less than 100"), "{err}");
    // There is much to explore, all of it outside.
    let fence = "-1.2,-1.2 1.2,-1.2 1.2,1.2 -1.2,1.2 0..2";
    let arguments = ["find the mug", "--scene", "flat", "--fence", fence, "--max-time", "16", "--quiet"];
    let (code, out, err) = robot(folder.path(), &arguments);
    assert_eq!((code, err.as_str()), (Some(1), ""), "{out}");
    let run = folder.path().join("runs/aerial-flat-1");
    let report = fs::read_to_string(run.join("report.html")).unwrap();
    assert!(report.contains("it would be outside the fence"), "the report says why it did not go there");
    let truth = fs::read_to_string(run.join("truth/trajectory.tum")).unwrap();
    let places: Vec<[f64; 3]> = truth
        .lines()
        .map(|line| line.split_whitespace().filter_map(|word| word.parse().ok()).collect::<Vec<f64>>())
        .filter(|numbers| numbers.len() == 8)
        .map(|numbers| [numbers[1], numbers[2], numbers[3]])
        .collect();
    let start = places[0];
    let furthest_m = places.iter().map(|p| (p[0] - start[0]).hypot(p[1] - start[1])).fold(0.0, f64::max);
    let highest_m = places.iter().map(|p| p[2] - start[2]).fold(0.0, f64::max);
    assert!(highest_m > 0.9, "it flew: {highest_m} m");
    // The corner of the fence is 1.7 m away; the body follows its set-points within centimetres.
    assert!(furthest_m < 1.2 * std::f64::consts::SQRT_2 + 0.05, "it was {furthest_m} m from its start");
}
