//! The toolbox as a program meets it: stable keys on stdout, complaints on stderr, graphs that somebody else recorded.

mod support;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use arena::cli::load_robot;
use arena::mission::robot_model::RobotKind;
use serde_json::Value;
use support::{json, keys, omnivln};

const ASK_KEYS: [&str; 7] = ["rooms", "candidates", "prompt", "prompt_tokens", "trace", "action", "verdict"];

/// Graphs with other people's terms stay outside of the repository.
fn shared_graph(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/dsg").join(name);
    if path.is_file() {
        return Some(path);
    }
    // A worktree lies one level deeper.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/data/dsg").join(name);
    if !path.is_file() {
        println!("skipped: {} is not here", path.display());
    }
    path.is_file().then_some(path)
}

/// What must hold of any answer.
fn check_answer(answer: &Value) {
    assert_eq!(keys(answer), ASK_KEYS.into_iter().collect());
    let steps: Vec<&str> =
        answer["trace"].as_array().unwrap().iter().map(|step| step["step"].as_str().unwrap()).collect();
    assert_eq!(steps, ["room filtering", "orientation", "functional group", "localisation"], "the paper's four steps");
    for step in answer["trace"].as_array().unwrap() {
        assert_eq!(keys(step), BTreeSet::from(["step", "input", "output"]));
    }
    let tokens = answer["prompt_tokens"].as_u64().unwrap();
    assert!(tokens > 0 && tokens <= 600, "{tokens}");
    assert_eq!(answer["verdict"], "accepted");
}

#[test]
fn ask_answers_on_four_rooms() {
    let Some(path) = shared_graph("four_rooms.json") else { return };
    let path = path.to_str().unwrap();
    let class = "chair";
    let answer = json(&["ask", path, &format!("find the {class}"), "--json"]);
    check_answer(&answer);
    assert_eq!(answer["rooms"].as_array().unwrap().len(), 4);
    let sum: u64 = answer["rooms"].as_array().unwrap().iter().map(|room| room["objects"].as_u64().unwrap()).sum();
    assert!(sum >= 24, "nearly all of the 26 objects have a room: {sum}");
    let (_, again, _) = omnivln(&["ask", path, &format!("find the {class}"), "--json"]);
    assert_eq!(serde_json::from_str::<Value>(&again).unwrap(), answer, "same input, same answer");
    // For people, the same parts.
    let (code, page, _) = omnivln(&["ask", path, &format!("find the {class}"), "--pose", "1,1,1,90"]);
    assert_eq!(code, Some(0));
    for part in ["Scene: 4 rooms", "Candidates:", "Prompt (", "Reasoning:", "Action:", "Critic:"] {
        assert!(page.contains(part), "{part}: {page}");
    }
}

#[test]
fn ask_answers_on_the_old_apartment_with_numbers_or_names_for_labels() {
    let Some(path) = shared_graph("apartment_dsg.json") else { return };
    let path = path.to_str().unwrap();
    let bare = json(&["ask", path, "find label 11", "--json"]);
    assert_eq!(keys(&bare), ASK_KEYS.into_iter().collect());
    let labels = |answer: &Value| -> Vec<String> {
        answer["candidates"].as_array().unwrap().iter().map(|c| c["label"].as_str().unwrap().to_owned()).collect()
    };
    let prompt = bare["prompt"].as_str().unwrap();
    assert!(prompt.contains("label"), "numbers are shown as labels: {prompt}");
    assert!(labels(&bare).iter().any(|label| label == "label 11"), "{:?}", labels(&bare));

    let folder = tempfile::tempdir().unwrap();
    let names = folder.path().join("names.json");
    fs::write(&names, r#"{"11": "chair"}"#).unwrap();
    let named = json(&["ask", path, "find the chair", "--labels", names.to_str().unwrap(), "--json"]);
    check_answer(&named);
    assert!(labels(&named).iter().any(|label| label == "chair"), "{:?}", labels(&named));
}

#[test]
fn bench_nav_prints_its_promised_keys_and_ask_answers_on_the_folder_it_keeps() {
    let folder = tempfile::tempdir().unwrap();
    let keep = folder.path().join("kept");
    let arguments = [
        "bench",
        "nav",
        "--robot",
        "ground",
        "--scenes",
        "1",
        "--seed",
        "1",
        "--max-time",
        "4",
        "--json",
        "--quiet",
        "--keep",
        keep.to_str().unwrap(),
    ];
    let bench = json(&arguments);
    let promised = [
        "robot",
        "scenes",
        "seed",
        "success_rate",
        "spl_mean",
        "spl_unknown",
        "spl_known",
        "collisions",
        "people",
        "contacts_with_people",
        "graph_update_ms",
        "route_ms",
        "realtime_factor",
        "drawn",
        "runs",
    ];
    let added = ["wall_s", "by_kind"];
    assert_eq!(keys(&bench), promised.into_iter().chain(added).collect());
    assert_eq!(
        keys(&bench["drawn"]),
        BTreeSet::from(["rooms", "kinds", "target_hidden", "rival_exists", "shortest_median_m"])
    );
    assert_eq!((bench["robot"].as_str(), bench["scenes"].as_u64()), (Some("ground"), Some(1)));
    let runs = bench["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 1);

    let run = keep.join("ground-1-000");
    let summary: Value = serde_json::from_slice(&fs::read(run.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary, runs[0], "the bench prints what the run folder holds");
    let answer = json(&["ask", run.to_str().unwrap(), runs[0]["instruction"].as_str().unwrap(), "--json"]);
    assert_eq!(keys(&answer), ASK_KEYS.into_iter().collect());
    assert!(!answer["prompt"].as_str().unwrap().is_empty());
    let by_file = json(&["ask", run.join("graph.json").to_str().unwrap(), "find the unicorn", "--json"]);
    assert_eq!(keys(&by_file), ASK_KEYS.into_iter().collect());
}

/// Exit code 2 and a sentence with `words`.
fn check_refused(arguments: &[&str], words: &[&str]) {
    let (code, out, err) = omnivln(arguments);
    assert_eq!(code, Some(2), "{arguments:?}: {out}{err}");
    assert_eq!(out, "", "{arguments:?}");
    assert!(err.starts_with("error: "), "{arguments:?}: {err}");
    for word in words {
        assert!(err.contains(word), "{arguments:?} says nothing of {word:?}: {err}");
    }
}

#[test]
fn bad_input_of_ask_ends_with_two_and_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let here = folder.path().to_str().unwrap();
    check_refused(&["ask", "/nowhere/graph.json", "find the mug"], &["/nowhere/graph.json"]);
    check_refused(&["ask", here, "find the mug"], &[here]);
    for (name, text) in [
        ("empty.json", ""),
        ("prose.json", "not a graph"),
        ("object.json", "{}"),
        ("array.json", "[]"),
        ("ours.json", "{\"format\": \"omni-dsg\", \"version\": 99}"),
        ("cut.json", "{\"directed\": false, \"nodes\": [{\"id\": "),
    ] {
        let path = write(name, text);
        check_refused(&["ask", &path, "find the mug"], &[name]);
    }
    let deep = write("deep.json", &"[".repeat(200_000));
    check_refused(&["ask", &deep, "find the mug"], &["deep.json"]);
    check_refused(&["ask", here, ""], &[]);
    check_refused(&["ask", here, "find the mug", "--pose", "1,2"], &["x,y,z,yaw"]);
    check_refused(&["ask", here, "find the mug", "--labels", "/nowhere.json"], &["/nowhere.json"]);
    check_refused(&["bench", "nav", "--robot", "submarine"], &["ground", "aerial"]);
    check_refused(&["bench", "nav", "--robot", "ground", "--scenes", "0"], &["--scenes"]);
    check_refused(&["bench", "nav", "--robot", "ground", "--max-time=-1"], &["--max-time"]);
}

#[test]
fn the_known_robots_load_for_the_right_program_only() {
    for (kind, other) in [(RobotKind::Ground, "quadrotor.urdf"), (RobotKind::Aerial, "quadruped.urdf")] {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../crates/robot-model/models");
        assert!(load_robot(None, kind).is_ok());
        let refusal = load_robot(Some(&models.join(other)), kind).unwrap_err().to_string();
        assert!(refusal.contains("this program is for"), "{refusal}");
    }
}

/// A corner of three walls as an ascii PLY, shifted by `x`.
fn corner_ply(x: f64) -> String {
    let grid = || (0..60).flat_map(|i| (0..60).map(move |j| (f64::from(i) * 0.1, f64::from(j) * 0.1)));
    let mut rows = String::new();
    for (u, v) in grid() {
        rows += &format!("{} {v} 0\n{} 6 {v}\n{} {u} {v}\n", u + x, u + x, 6.0 + x);
    }
    let count = 3 * 60 * 60;
    format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty double x\nproperty double y\nproperty double z\nend_header\n{rows}"
    )
}

#[test]
fn register_prints_the_pose_of_the_first_scan_in_the_second() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("plain characters").to_owned();
    // The second lies far from the origin, as scans with geographic coordinates do.
    std::fs::write(path("a.ply"), corner_ply(0.0)).expect("written");
    std::fs::write(path("b.ply"), corner_ply(500_000.25)).expect("written");
    let answer = json(&["register", &path("a.ply"), &path("b.ply"), "--guess", "500000,0,0,2", "--json"]);
    let promised = BTreeSet::from(["t", "inliers", "rmse_m", "cpu_ms", "points", "iterations", "converged"]);
    assert_eq!(keys(&answer), promised);
    let t = |row: usize, column: usize| answer["t"][row][column].as_f64().expect("a number");
    assert!((t(0, 3) - 500_000.25).abs() < 0.02 && t(1, 3).abs() < 0.02 && t(2, 3).abs() < 0.02, "{answer}");
    assert!((t(0, 0) - 1.0).abs() < 1e-3 && t(3, 3) == 1.0);
    assert_eq!(answer["inliers"], 3 * 60 * 60);

    let (code, page, _) = omnivln(&["register", &path("a.ply"), &path("a.ply")]);
    assert_eq!(code, Some(0));
    assert!(page.contains("10800 of 10800 points"), "{page}");
    std::fs::write(path("cut.ply"), &corner_ply(0.0)[..300]).expect("written");
    check_refused(&["register", &path("cut.ply"), &path("a.ply")], &["cut.ply", "line 26"]);
    check_refused(&["register", &path("none.ply"), &path("a.ply")], &["none.ply"]);
    check_refused(&["register", &path("a.ply"), &path("b.ply")], &["b.ply", "lie near the target"]);
    check_refused(&["register", &path("a.ply"), &path("a.ply"), "--leaf", "0"], &["--leaf"]);
}
