//! `omnivln dsg`: from one format into the other and back, differences, faults, and the keys that programs read.

mod support;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::Value;
use support::{json, keys, omnivln};

/// A file of theirs, written by hand: two rooms, a chair, a person who walks, a pose, a mesh.
fn theirs(folder: &Path) -> PathBuf {
    let path = folder.join("theirs.json");
    let id = |letter: u8, index: u64| (u64::from(letter) << 56) + index;
    let place = |index: u64, x: f64| {
        serde_json::json!({ "id": id(b'p', index), "layer": 3, "partition": 0, "attributes":
            { "type": "PlaceNodeAttributes", "position": [x, 1.0, 1.0], "distance": 0.8, "num_basis_points": 3 } })
    };
    let room = |index: u64, name: &str| {
        serde_json::json!({ "id": id(b'R', index), "layer": 4, "partition": 0, "attributes":
            { "type": "RoomNodeAttributes", "position": [index, 1.0, 1.0], "name": name } })
    };
    let edge = |a: u64, b: u64| serde_json::json!({ "source": a, "target": b, "info": { "type": "EdgeAttributes" } });
    let version = serde_json::json!({ "project_name": "main", "version": { "major": 1, "minor": 1, "patch": 3 } });
    let file = serde_json::json!({
        "SPARK_DSG_header": version, "layer_keys": [], "layer_names": {}, "metadata": { "map": "test" },
        "nodes": [
            place(0, 1.0), place(1, 4.0), room(0, "kitchen"), room(1, "den"),
            { "id": id(b'O', 1), "layer": 2, "partition": 0, "attributes": { "type": "ObjectNodeAttributes", "name": "chair_1",
              "position": [1.0, 1.2, 0.4], "semantic_label": 5, "mesh_connections": [0, 1, 2] } },
            { "id": id(b'O', 2), "layer": 2, "partition": 0, "attributes": { "type": "KhronosObjectAttributes", "name": "person",
              "first_observed_ns": [1], "last_observed_ns": [9], "trajectory_timestamps": [1, 9],
              "trajectory_positions": [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5]], "position": [1.0, 0.0, 0.5] } },
            { "id": id(b'a', 0), "layer": 2, "partition": 97, "attributes": { "type": "AgentNodeAttributes",
              "position": [1.0, 1.0, 0.5], "timestamp": 7 } },
        ],
        "edges": [
            edge(id(b'R', 0), id(b'p', 0)), edge(id(b'R', 1), id(b'p', 1)), edge(id(b'p', 0), id(b'O', 1)),
            edge(id(b'p', 0), id(b'p', 1)), edge(id(b'p', 0), id(b'a', 0)),
        ],
        "mesh": { "header": version, "has_colors": false, "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "labels": [5, 5, 5],
                  "faces": [[0, 1, 2]] },
    });
    std::fs::write(&path, file.to_string()).expect("a temporary folder takes files");
    path
}

#[test]
fn a_graph_goes_into_our_format_and_back_without_a_difference() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let original = theirs(folder.path());
    let at = |name: &str| folder.path().join(name).display().to_string();
    let original = original.display().to_string();
    for (from, to, format) in [
        (original.clone(), at("ours"), "omni"),
        (original.clone(), at("ours.json"), "omni"),
        (at("ours"), at("back.json"), "spark-dsg"),
        (at("ours.json"), at("back2.json"), "spark-dsg"),
    ] {
        let (code, _, error) = omnivln(&["dsg", "convert", &from, &to, "--to", format]);
        assert_eq!(code, Some(0), "{error}");
        let (code, said, error) = omnivln(&["dsg", "diff", &original, &to]);
        assert_eq!((code, said.trim()), (Some(0), "no difference"), "{error}");
    }
    assert_eq!(std::fs::read(at("back.json")).unwrap(), std::fs::read(at("back2.json")).unwrap());
    // Their graph has no way between the rooms that it did not have.
    let back: Value = serde_json::from_slice(&std::fs::read(at("back.json")).unwrap()).unwrap();
    assert_eq!((back["nodes"].as_array().unwrap().len(), back["edges"].as_array().unwrap().len()), (7, 5));
    assert_eq!(back["mesh"]["labels"], serde_json::json!([5, 5, 5]));

    let info = json(&["dsg", "info", &original, "--json"]);
    let promised = [
        "agents",
        "buildings",
        "edges",
        "format",
        "groups",
        "mesh_faces",
        "mesh_vertices",
        "moving",
        "nodes",
        "objects",
        "places",
        "poses",
        "relations",
        "revision",
        "rooms",
        "summary",
    ];
    assert_eq!(keys(&info), BTreeSet::from(promised));
    assert_eq!((&info["nodes"], &info["edges"], &info["moving"]), (&7.into(), &5.into(), &1.into()));
    let (_, text, _) = omnivln(&["dsg", "info", &at("ours")]);
    assert!(text.contains("kitchen (R0") && text.contains("chair (O1)") && text.contains("moving"), "{text}");

    // A difference has a line and an exit code.
    let changed = std::fs::read_to_string(&original).unwrap().replace("chair_1", "stool_1");
    std::fs::write(at("changed.json"), changed).unwrap();
    let (code, said, _) = omnivln(&["dsg", "diff", &original, &at("changed.json")]);
    assert_eq!(code, Some(1));
    assert!(said.contains("object O1 label: \"chair\" -> \"stool\""), "{said}");
    let (_, said, _) = omnivln(&["dsg", "diff", &original, &at("changed.json"), "--json"]);
    let differences: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(keys(&differences), BTreeSet::from(["differences", "mesh_same"]));

    let time = json(&["dsg", "time", &original, "--json"]);
    assert_eq!(keys(&time), BTreeSet::from(["edges", "load_cpu_s", "nodes", "peak_rss_mib", "save_cpu_s"]));
}

#[test]
fn faults_have_a_line_each_and_what_is_whole_is_saved() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = theirs(folder.path());
    let broken = folder.path().join("broken.json").display().to_string();
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace("\"distance\":0.8", "\"distance\":\"wide\"");
    std::fs::write(&broken, &text).unwrap();
    let whole = path.display().to_string();
    let (code, said, _) = omnivln(&["dsg", "check", &whole, &broken]);
    assert_eq!(code, Some(1), "{said}");
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines.iter().all(|line| line.starts_with(&broken)), "{lines:?}");
    assert!(lines[0].ends_with("$.nodes[0].attributes.distance is not a number"), "{lines:?}");
    assert_eq!(omnivln(&["dsg", "check", &whole]).0, Some(0));

    let (code, _, error) = omnivln(&["dsg", "info", &broken]);
    assert!(code == Some(2) && error.contains("broken.json") && error.contains("$.nodes[0]"), "{error}");
    let saved = folder.path().join("saved").display().to_string();
    let (code, _, error) = omnivln(&["dsg", "convert", &broken, &saved, "--to", "omni", "--salvage"]);
    assert_eq!(code, Some(0), "{error}");
    let info = json(&["dsg", "info", &saved, "--json"]);
    assert_eq!((&info["places"], &info["objects"], &info["rooms"]), (&0.into(), &2.into(), &2.into()));

    for (name, text) in
        [("empty.json", ""), ("list.json", "[1]"), ("other.json", "{\"a\":1}"), ("binary", "\u{1}\u{2}")]
    {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let (code, said, _) = omnivln(&["dsg", "check", &path.display().to_string()]);
        assert_eq!(code, Some(1), "{name}: {said}");
        assert!(said.contains("neither a graph.json of ours nor"), "{name}: {said}");
    }
    let (code, _, error) = omnivln(&["dsg", "info", "/nowhere/graph.json"]);
    assert!(code == Some(2) && error.contains("/nowhere/graph.json"), "{error}");
}
