//! The stable keys of what a run leaves, and that a run folder is complete.

mod support;

use std::collections::BTreeSet;

use arena::mission::robot_model::RobotKind;
use arena::run_folder::RunFolder;
use arena::write_run::write_run;
use serde_json::Value;
use support::{coarse, scene, short_run};

/// The keys that the work order promises ...
const PROMISED: [&str; 21] = [
    "success",
    "reason",
    "robot",
    "scene",
    "seed",
    "instruction",
    "target",
    "path_m",
    "shortest_m",
    "spl",
    "sim_s",
    "wall_s",
    "cpu_s",
    "decisions",
    "prompt_tokens",
    "answer_tokens",
    "collisions",
    "min_clearance_m",
    "rooms_found",
    "objects_found",
    "stages",
];
/// ... and those we added: the name of the model, the kind of sentence, whether a person stopped it, what became of the
/// pictures.
const ADDED: [&str; 13] = [
    "first_sighting_s",
    "turned_in_place_rad",
    "lost_s",
    "odometry_resets",
    "contacts_with_people",
    "keep_out_entries",
    "zones",
    "model",
    "kind",
    "interrupted",
    "images",
    "images_without_masks",
    "segmenter_error",
];

const FILES: [&str; 14] = [
    "summary.json",
    "report.html",
    "graph.json",
    "mesh.ply",
    "map.bin",
    "map.json",
    "scene_graph.txt",
    "scene_objects.json",
    "decisions.jsonl",
    "truth/trajectory.tum",
    "truth/objects.json",
    "truth/rooms.json",
    "truth/contacts.json",
    "truth/frame.json",
];

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

#[test]
fn a_run_folder_is_complete_has_the_promised_keys_and_can_be_known() {
    let scene = scene("spin");
    let text = "find the sofa";
    let result = short_run(&coarse(4.0), RobotKind::Ground, &scene, text, 3);
    let root = tempfile::tempdir().expect("a place for a run folder");
    let folder = RunFolder::new(&root.path().join("run")).expect("a new folder");
    write_run(&folder, &result, &scene).expect("written");
    let path = folder.publish().expect("published");

    for file in FILES {
        let size = std::fs::metadata(path.join(file)).map(|data| data.len());
        assert!(size.as_ref().is_ok_and(|size| *size > 0), "{file}: {size:?}");
    }
    let read = |file: &str| -> Value {
        serde_json::from_slice(&std::fs::read(path.join(file)).expect("it was written")).expect("it is JSON")
    };
    let summary = read("summary.json");
    assert_eq!(keys(&summary), PROMISED.iter().chain(&ADDED).copied().collect());
    let stages = summary["stages"].as_object().expect("stages by name");
    assert!(stages.len() >= 5);
    for (name, stage) in stages {
        assert_eq!(keys(stage), BTreeSet::from(["calls", "cpu_ms_total", "cpu_ms_p95", "cpu_ms_p99"]), "{name}");
    }
    let lines = std::fs::read_to_string(path.join("decisions.jsonl")).expect("decisions");
    assert_eq!(lines.lines().count() as u64, summary["decisions"].as_u64().expect("a count"));

    // The folder can be known another day, with the same graph.
    let known = arena::mission::archive::load(&path).expect("what was saved can be loaded");
    assert_eq!(known.graph.confirmed_objects().count() as u64, summary["objects_found"].as_u64().expect("a count"));
    assert_eq!(known.graph.rooms().count() as u64, summary["rooms_found"].as_u64().expect("a count"));
    let report = std::fs::read_to_string(path.join("report.html")).expect("a report");
    assert!(report.contains("<svg") && !report.contains("<script") && !report.contains("src=\"http"), "self-contained");
}
