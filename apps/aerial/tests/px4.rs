//! The whole program with an autopilot in place of the simulated body, in real time.
#![cfg(feature = "px4")]

use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

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
fn nobody_there_is_a_sentence_and_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("udpout:{}", silent.local_addr().unwrap());
    let (code, out, err) = robot(folder.path(), &["find the unicorn", "--scene", "spin", "--px4", &address]);
    assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
    assert!(err.contains("no autopilot answers at udpout:127.0.0.1"), "{err}");
    assert!(!folder.path().join("runs").exists(), "nothing was made");
}

#[test]
fn addresses_and_keys_are_checked_first() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = robot(folder.path(), &["find the unicorn", "--px4", "127.0.0.1:14580"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("udpout:127.0.0.1:14580"), "{err}");
    fs::write(folder.path().join("key"), "0123").unwrap();
    let arguments = ["find the unicorn", "--scene", "spin", "--px4", "udpout:127.0.0.1:9", "--px4-key", "key"];
    let (code, _, err) = robot(folder.path(), &arguments);
    assert_eq!(code, Some(2));
    assert!(err.contains("64 hexadecimal digits") && err.contains("this has 4"), "{err}");
    let (code, _, _) = robot(folder.path(), &["find the unicorn", "--px4-system", "2"]);
    assert_eq!(code, Some(2), "a system id without an autopilot");
}

/// The checking peer beside the repository, if python3 and pymavlink are here to run it.
fn peer_script() -> Option<PathBuf> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/bench/mavlink_peer.py");
    let mut has = Command::new("python3");
    has.args(["-c", "import pymavlink.dialects.v20.common"]).stderr(Stdio::null());
    let is_here = script.is_file() && has.status().is_ok_and(|status| status.success());
    if !is_here {
        eprintln!("skipped: python3 with pymavlink, or ../shared/bench/mavlink_peer.py, is not here");
    }
    is_here.then_some(script)
}

/// A short flight: the checking peer finds no error, and the robot is down again with motors off.
#[test]
fn the_checking_peer_finds_no_error_from_take_off_to_landing() {
    let Some(script) = peer_script() else { return };
    let folder = tempfile::tempdir().unwrap();
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let report = folder.path().join("report.json");
    let mut peer = Command::new("python3");
    // The peer runs for its whole duration; the robot has 12 s of it and needs some to start and to land.
    peer.arg(script)
        .args(["--port", &port.to_string(), "--duration", "36", "--need-odometry", "--report"])
        .arg(&report);
    let mut peer = peer.stdout(Stdio::null()).spawn().expect("python3 starts");
    let address = format!("udpout:127.0.0.1:{port}");
    let arguments = ["find the unicorn", "--scene", "spin", "--px4", &address, "--max-time", "12", "--quiet"];
    let (code, out, err) = robot(folder.path(), &arguments);
    peer.wait().expect("the peer ends by itself");
    let read = |path: PathBuf| -> serde_json::Value { serde_json::from_slice(&fs::read(path).unwrap()).unwrap() };
    let judged = read(report);
    assert_eq!((code, err.as_str()), (Some(1), ""), "there is no unicorn: {out}");
    assert!(out.contains("did not arrive") || out.contains("gave up"), "{out}");
    assert!(judged["ok"].as_bool().unwrap(), "{judged:#}");
    assert!(judged["offboard_flight_s"].as_f64().unwrap() > 5.0, "{judged:#}");
    let events = judged["events"].to_string();
    let order = ["mode OFFBOARD", "armed", "mode LAND", "disarmed"].map(|event| events.find(event));
    assert!(order.is_sorted() && order[0].is_some(), "{events}");
    let summary = read(folder.path().join("runs/aerial-spin-1/summary.json"));
    assert_eq!(summary["collisions"].as_u64(), Some(0));
}
