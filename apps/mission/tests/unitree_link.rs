//! The link over real DDS and in real time, against an independent stand-in for the robot where python3 and cyclonedds are present.
#![cfg(feature = "unitree")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use mission::unitree::{UnitreeConfig, UnitreeError, UnitreeLink};
use robot_link::unitree::{Fault, Phase, SessionConfig, Velocity};

static NEVER: AtomicBool = AtomicBool::new(false);

fn config(domain: u16) -> UnitreeConfig {
    UnitreeConfig { interface: "lo".into(), domain, session: SessionConfig::default() }
}

/// The stand-in beside the repository, if it can be run here: listening in a domain of its own for some seconds.
fn peer(domain: u16, seconds: u32, report: &Path) -> Option<Child> {
    let script: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/bench/unitree_peer.py");
    let mut has = Command::new("python3");
    has.args(["-c", "import cyclonedds"]).stderr(Stdio::null());
    if !script.is_file() || !has.status().is_ok_and(|status| status.success()) {
        eprintln!("skipped: python3 with cyclonedds, or ../shared/bench/unitree_peer.py, is not here");
        return None;
    }
    let mut peer = Command::new("python3");
    peer.arg(script).args(["--no-multicast", "--strict-state", "--domain", &domain.to_string()]);
    peer.args(["--seconds", &seconds.to_string(), "--report"]).arg(report).stdout(Stdio::null());
    Some(peer.spawn().expect("python3 starts"))
}

fn drive(link: &UnitreeLink, velocity: Velocity, seconds: f64) {
    let begin = Instant::now();
    while begin.elapsed().as_secs_f64() < seconds {
        link.drive(&velocity);
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn an_interface_that_is_not_here_is_named_with_those_that_are() {
    let nowhere = UnitreeConfig { interface: "nowhere0".into(), ..config(71) };
    let error = UnitreeLink::open(&nowhere).err().expect("there is no such interface");
    assert!(error.to_string().contains("\"nowhere0\"") && error.to_string().contains("lo"), "{error}");
}

#[test]
fn nobody_there_is_a_sentence_with_the_types() {
    let link = UnitreeLink::open(&config(72)).expect("the loopback is here");
    let error = link.wait_until_ready(Duration::from_secs(2), &NEVER).expect_err("nobody is there");
    assert!(matches!(error, UnitreeError::Silent { .. }), "{error}");
    for words in ["on lo", "domain 72", "rt/api/sport/request", "unitree_go::msg::dds_::SportModeState_"] {
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn from_stand_up_to_lying_down_with_no_protocol_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = folder.path().join("report.json");
    let Some(mut peer) = peer(73, 20, &report) else { return };
    let link = UnitreeLink::open(&config(73)).expect("the loopback is here");
    link.wait_until_ready(Duration::from_secs(10), &NEVER).expect("the stand-in answers");
    link.stand_up(Duration::from_secs(10), &NEVER).expect("it stands up");
    let from = link.pose_at(link.now_ns()).expect("a state came").world_from_body.translation.vector;
    drive(&link, Velocity { forward_mps: 0.5, ..Velocity::default() }, 3.0);
    let pose = link.pose_at(link.now_ns()).expect("a state came");
    // 0.5 m/s for 3 s, less 0.1 s of accelerating and a little for a busy machine.
    let way_m = (pose.world_from_body.translation.vector - from).norm();
    assert!((1.2..1.6).contains(&way_m), "{way_m}");
    // Nobody says anything any more: it stands long before the stand-in's own second is over.
    std::thread::sleep(Duration::from_millis(800));
    let pose = link.pose_at(link.now_ns()).expect("a state came");
    assert!(pose.velocity_in_world_mps.norm() < 0.05, "{pose:?}");
    link.lie_down(Duration::from_secs(10)).expect("it lies down");
    assert_eq!((link.phase(), link.fault()), (Phase::Down, None));
    drop(link);
    assert!(peer.wait().expect("it ends by itself").success());
    let judged: serde_json::Value = serde_json::from_slice(&std::fs::read(report).expect("a report")).expect("JSON");
    assert_eq!(judged["n_errors"], 0, "{judged:#}");
    let count = |api: &str| judged["counts"][api].as_u64().unwrap_or(0);
    assert_eq!(["1004", "1002", "1005", "1001"].map(count), [1, 1, 1, 0], "{judged:#}");
    assert!((50..=66).contains(&count("1008")) && count("1003") >= 1, "{judged:#}");
}

#[test]
fn a_robot_that_is_gone_is_a_fault_and_does_not_hang() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(mut peer) = peer(74, 60, &folder.path().join("report.json")) else { return };
    let link = UnitreeLink::open(&config(74)).expect("the loopback is here");
    link.wait_until_ready(Duration::from_secs(10), &NEVER).expect("the stand-in answers");
    link.stand_up(Duration::from_secs(10), &NEVER).expect("it stands up");
    peer.kill().expect("it can be stopped");
    peer.wait().expect("it ends");
    drive(&link, Velocity { forward_mps: 0.5, ..Velocity::default() }, 2.0);
    assert!(matches!(link.fault(), Some(Fault::LinkLost { .. })), "{:?}", link.fault());
    let begin = Instant::now();
    drop(link);
    assert!(begin.elapsed() < Duration::from_secs(10));
}
