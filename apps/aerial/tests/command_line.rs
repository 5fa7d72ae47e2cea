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
