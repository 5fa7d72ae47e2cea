//! The whole program with a walking robot in place of the simulated body, in real time.
#![cfg(feature = "unitree")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn robot(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_omnivln-ground"))
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
fn a_wrong_interface_and_nobody_there_are_sentences_and_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, err) = robot(folder.path(), &["find the unicorn", "--unitree", "nowhere0"]);
    assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
    assert!(err.contains("no network interface \"nowhere0\""), "{err}");
    let nobody = ["find the unicorn", "--unitree", "lo", "--unitree-domain", "81"];
    let (code, out, err) = robot(folder.path(), &nobody);
    assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
    assert!(err.contains("no robot answers on lo") && err.contains("rt/api/sport/request"), "{err}");
    assert!(!folder.path().join("runs").exists(), "nothing was made");
    let (code, _, _) = robot(folder.path(), &["find the unicorn", "--unitree-domain", "2"]);
    assert_eq!(code, Some(2), "a domain without a robot");
}

/// The checking stand-in beside the repository, if python3 and cyclonedds are here to run it.
fn peer_script() -> Option<PathBuf> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/bench/unitree_peer.py");
    let mut has = Command::new("python3");
    has.args(["-c", "import cyclonedds"]).stderr(Stdio::null());
    let is_here = script.is_file() && has.status().is_ok_and(|status| status.success());
    if !is_here {
        eprintln!("skipped: python3 with cyclonedds, or ../shared/bench/unitree_peer.py, is not here");
    }
    is_here.then_some(script)
}

/// A short walk: the stand-in finds no protocol error, and the robot lies again at the end.
#[test]
fn the_checking_peer_finds_no_error_from_stand_up_to_lying_down() {
    let Some(script) = peer_script() else { return };
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report.json");
    let mut peer = Command::new("python3");
    // The stand-in runs for its whole duration; the robot walks for 15 s of it and needs some to stand up and lie down.
    peer.arg(script).args(["--no-multicast", "--strict-state", "--domain", "82", "--seconds", "45", "--report"]);
    let mut peer = peer.arg(&report).stdout(Stdio::null()).spawn().expect("python3 starts");
    let arguments = ["find the unicorn", "--unitree", "lo", "--unitree-domain", "82", "--max-time", "15", "--quiet"];
    let (code, out, err) = robot(folder.path(), &arguments);
    peer.wait().expect("the stand-in ends by itself");
    let read = |path: PathBuf| -> serde_json::Value { serde_json::from_slice(&fs::read(path).unwrap()).unwrap() };
    let judged = read(report);
    assert_eq!(code, Some(1), "there is no unicorn: {out} {err}");
    assert!(out.contains("did not arrive") || out.contains("gave up"), "{out}");
    assert_eq!(judged["n_errors"], 0, "{judged:#}");
    let count = |api: &str| judged["counts"][api].as_u64().unwrap_or(0);
    assert_eq!(["1004", "1002", "1005", "1001"].map(count), [1, 1, 1, 0], "{judged:#}");
    assert!(count("1008") > 100, "{judged:#}");
    assert!(judged["path_m"].as_f64().unwrap() > 0.5, "{judged:#}");
    let summary = read(folder.path().join("runs/ground-flat-1/summary.json"));
    assert_eq!(summary["collisions"].as_u64(), Some(0));
}
