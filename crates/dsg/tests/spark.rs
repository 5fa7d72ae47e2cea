//! spark_dsg both ways: nothing is lost in either direction, and what others have changed holds.

mod support;

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use dsg::{
    Format, LoadError, Mesh, MeshPly, Object, ObjectId, Op, Opened, SceneGraph, graph_from_json, graph_to_json,
    read_spark_dsg, salvage, write_spark_dsg,
};
use nalgebra::Point3;
use proptest::prelude::*;
use serde_json::Value;
use support::graphs::graphs;

fn spark(graph: &SceneGraph) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_spark_dsg(graph, None, &mut bytes).unwrap();
    bytes
}

/// Bytes of a shared file, `None` (with a note) where the folder is absent.
fn shared(name: &str) -> Option<Vec<u8>> {
    let path = format!("{}/../../../shared/data/dsg/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        eprintln!("skipped: {path} is not there");
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

    #[test]
    fn a_graph_of_ours_survives_their_file(graph in graphs()) {
        let bytes = spark(&graph);
        let back = read_spark_dsg(&bytes, None).unwrap();
        prop_assert_eq!(back.check_invariants(), Ok(()));
        // What differs is easier to read in the files.
        let text = |graph: &SceneGraph| String::from_utf8(graph_to_json(graph)).unwrap();
        prop_assert_eq!(text(&back), text(&graph.snapshot()));
        prop_assert!(back.has_same_content(&graph));
        prop_assert_eq!(spark(&back), bytes);
    }
}

#[test]
fn their_graphs_survive_our_file() {
    let Some(defaults) = defaults() else { return };
    for name in [
        "four_rooms.json",
        "four_rooms_nomesh.json",
        "apartment_dsg.json",
        "minimal_foreign.json",
        "minimal_resaved.json",
    ] {
        let Some(bytes) = shared(name) else { return };
        let graph = read_spark_dsg(&bytes, None).unwrap();
        let through_ours = graph_from_json(&graph_to_json(&graph)).unwrap();
        for graph in [&graph, &through_ours] {
            let back = read_spark_dsg(&spark(graph), None).unwrap();
            let text = |graph: &SceneGraph| String::from_utf8(graph_to_json(graph)).unwrap();
            let (a, b) = (text(&back), text(graph));
            if let Some((a, b)) = a.lines().zip(b.lines()).find(|(a, b)| a != b) {
                let at = a.bytes().zip(b.bytes()).position(|(a, b)| a != b).unwrap_or(0);
                let part = |line: &str| line.chars().skip(at.saturating_sub(80)).take(200).collect::<String>();
                panic!("{name}: {} became {}", part(b), part(a));
            }
        }
        // Word for word: every node with every attribute that is in their file is in ours, or stands at its default.
        let parse = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).unwrap();
        let (theirs, ours) = (parse(&bytes), parse(&spark(&graph)));
        let list = |file: &Value, name: &str| file[name].as_array().unwrap().clone();
        assert_eq!(list(&theirs, "nodes").len(), list(&ours, "nodes").len(), "{name}");
        assert_eq!(list(&theirs, "edges").len(), list(&ours, "edges").len(), "{name}");
        let ours: std::collections::BTreeMap<u64, Value> =
            list(&ours, "nodes").into_iter().map(|node| (node["id"].as_u64().unwrap(), node)).collect();
        for node in list(&theirs, "nodes") {
            let own = &ours[&node["id"].as_u64().unwrap()];
            assert_eq!(own["layer"], node["layer"]);
            let kind = node["attributes"]["type"].as_str().unwrap();
            for (field, value) in node["attributes"].as_object().unwrap() {
                let is_same = match own["attributes"].get(field) {
                    Some(own) => is_same_numbers(own, value) || is_old(field, value),
                    // What is not written must be what their own writer puts for nothing.
                    None => is_same_numbers(&defaults[kind][field], value) || is_nothing(kind, field, value),
                };
                assert!(is_same, "{name} {} {field}: {value} became {}", node["id"], own["attributes"][field]);
            }
        }
    }
}

/// The defaults of theirs, by type and field: what their library wrote for a file that says hardly anything.
fn defaults() -> Option<Value> {
    let file: Value = serde_json::from_slice(&shared("minimal_resaved.json")?).unwrap();
    let mut defaults = serde_json::json!({});
    for node in file["nodes"].as_array().unwrap() {
        let kind = node["attributes"]["type"].as_str().unwrap();
        if kind != "ObjectNodeAttributes" || defaults[kind].is_null() {
            defaults[kind] = node["attributes"].clone();
        }
    }
    Some(defaults)
}

/// Nothing in fields that the hand-written file gives a value or does not have.
fn is_nothing(kind: &str, field: &str, value: &Value) -> bool {
    match field {
        "name" => value == "",
        "color" => {
            *value == serde_json::json!({ "r": 0, "g": 0, "b": 0, "a": 255 }) || *value == serde_json::json!([0, 0, 0])
        }
        "bounding_box" => value["type"] == "INVALID",
        "metadata" => *value == serde_json::json!({}),
        "semantic_feature" => value["data"].is_null(),
        "is_active" | "is_predicted" | "registered" => kind == "KhronosObjectAttributes" && *value == false,
        "last_update_time_ns" => *value == 0,
        "mesh_connections" => *value == serde_json::json!([]),
        "world_R_object" => value["w"] == 1.0,
        _ => false,
    }
}

/// Fields that files up to 1.0.x write in another form.
fn is_old(field: &str, value: &Value) -> bool {
    (field == "color" && value.is_array()) || (field == "bounding_box" && value.get("min").is_some())
}

fn is_same_numbers(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same_numbers(a, b)),
        (Value::Object(a), Value::Object(b)) => a.len() == b.len() && a.iter().all(|(k, a)| is_same_numbers(a, &b[k])),
        _ => a == b || a.as_f64().zip(b.as_f64()).is_some_and(|(a, b)| a == b),
    }
}

#[test]
fn a_person_comes_with_trajectory_and_presence() {
    let Some(bytes) = shared("four_rooms.json") else { return };
    let graph = read_spark_dsg(&bytes, None).unwrap();
    let person = graph.objects().find(|object| object.is_dynamic()).unwrap();
    assert_eq!(person.trajectory.len(), 3);
    assert_eq!(person.trajectory[1].stamp_ns, 2_000_000_000);
    assert_eq!(person.trajectory[1].position, Point3::new(6.5, 2.0, f64::from(0.9_f32)));
    assert_eq!(person.presence(), [dsg::Presence { first_ns: 1_000_000_000, last_ns: 3_000_000_000 }]);
}

#[test]
fn what_their_tools_have_moved_or_renamed_holds() {
    let mut graph = SceneGraph::new();
    let mut mug =
        Object::new(ObjectId(7), "mug", dsg::Aabb { min: Point3::new(0.0, 0.0, 0.7), max: Point3::new(0.1, 0.1, 0.8) });
    mug.votes.insert("cup".into(), 0.25);
    mug.caption = "a blue mug".into();
    graph.apply(Op::PutObject(Box::new(mug.clone()))).unwrap();
    let mut file: Value = serde_json::from_slice(&spark(&graph)).unwrap();
    let attributes = &mut file["nodes"][0]["attributes"];
    attributes["position"] = serde_json::json!([2.0, 3.0, 0.5]);
    attributes["bounding_box"]["world_P_center"] = serde_json::json!([2.0, 3.0, 0.5]);
    attributes["name"] = "cup".into();
    let back = read_spark_dsg(&serde_json::to_vec(&file).unwrap(), None).unwrap();
    let moved = back.object(ObjectId(7)).unwrap();
    assert!((moved.centroid - Point3::new(2.0, 3.0, 0.5)).norm() < 1e-6);
    assert_eq!((moved.label.as_str(), moved.caption.as_str()), ("cup", "a blue mug"));
    assert_eq!(moved.votes, mug.votes);
}

#[test]
fn two_rooms_of_one_name_are_told_apart_and_get_it_back() {
    let Some(bytes) = shared("four_rooms_nomesh.json") else { return };
    let text = String::from_utf8(bytes).unwrap();
    let named =
        text.replace("\"name\":\"R(0)\"", "\"name\":\"Kitchen\"").replace("\"name\":\"R(1)\"", "\"name\":\"Kitchen\"");
    let graph = read_spark_dsg(named.as_bytes(), None).unwrap();
    let names: Vec<&str> = graph.rooms().map(|room| room.name.as_str()).collect();
    assert_eq!(names[..2], ["Kitchen", "Kitchen 2"]);
    let again = String::from_utf8(spark(&graph)).unwrap();
    assert_eq!(again.matches("\"name\":\"Kitchen\"").count(), 2);
}

fn triangle() -> Mesh {
    Mesh {
        points: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.0, 1.0, 0.2]],
        colors: vec![[1, 2, 3, 255]; 3],
        labels: vec![4, 5, 6],
        stamps: vec![1 << 60; 3],
        first_seen_stamps: Vec::new(),
        faces: vec![[0, 1, 2]],
    }
}

#[test]
fn every_format_opens_converts_and_keeps_the_mesh() {
    let dir = tempfile::tempdir().unwrap();
    let mut graph = SceneGraph::new();
    graph.apply(Op::PutObject(Box::new(Object::new(ObjectId(1), "mug", dsg::Aabb::at(Point3::origin()))))).unwrap();
    let mut ply = Vec::new();
    triangle().write_ply(&mut ply).unwrap();
    let opened = Opened::new(graph, Some(ply));
    for (name, format) in [("folder", Format::Omni), ("one.json", Format::Omni), ("theirs.json", Format::SparkDsg)] {
        let path = dir.path().join(name);
        opened.save(&path, format).unwrap();
        let again = dsg::open(&path).unwrap();
        assert_eq!(again.format, format, "{name}");
        assert!(again.graph.has_same_content(&opened.graph), "{name}");
        assert_eq!(again.mesh().unwrap(), Some(triangle()), "{name}");
    }
    assert!(dir.path().join("one.mesh.ply").exists());
    // graph.json of a folder is the folder.
    assert!(dsg::open(&dir.path().join("folder/graph.json")).unwrap().mesh.is_some());
    let refused = opened.save(&dir.path().join("folder"), Format::SparkDsg).unwrap_err().to_string();
    assert!(refused.contains("file name"), "{refused}");
}

#[test]
fn of_a_damaged_file_everything_whole_is_saved() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("damaged.json");
    let Some(bytes) = shared("four_rooms_nomesh.json") else { return };
    let text = String::from_utf8(bytes).unwrap();
    let whole = read_spark_dsg(text.as_bytes(), None).unwrap();
    // A NaN, a duplicate and a dangling edge: three records are lost, and what they hold together.
    let broken = text
        .replacen("\"distance\":", "\"distance\":NaN,\"x\":", 1)
        .replacen("\"edges\":[", "\"edges\":[{\"source\":1,\"target\":2,\"info\":{\"type\":\"EdgeAttributes\"}},", 1)
        .replacen("\"nodes\":[", "\"nodes\":[{\"id\":7},", 1);
    std::fs::write(&path, &broken).unwrap();
    assert!(dsg::open(&path).is_err());
    let saved = salvage(&path).unwrap();
    saved.opened.graph.check_invariants().unwrap();
    assert_eq!(saved.opened.graph.places().count(), whole.places().count() - 1);
    assert_eq!(saved.opened.graph.objects().count(), whole.objects().count());
    let faults: Vec<String> = saved.faults.iter().map(ToString::to_string).collect();
    assert_eq!(faults[0], "$.nodes[0].layer is missing");
    assert!(
        faults.iter().any(|fault| fault == "$.edges[0].source refers to a node that does not exist: 1"),
        "{faults:?}"
    );
    assert_eq!(saved.fault_count, faults.len());
    // Cut anywhere: what comes before is saved, and the graph is sound.
    let ours = dir.path().join("ours.json");
    let text = graph_to_json(&whole);
    let mut most = 0;
    for part in 1..20 {
        std::fs::write(&ours, &text[..text.len() * part / 20]).unwrap();
        if let Ok(saved) = salvage(&ours) {
            saved.opened.graph.check_invariants().unwrap();
            assert!(saved.fault_count > 0);
            assert!(saved.opened.graph.node_count() >= most);
            most = saved.opened.graph.node_count();
        }
    }
    assert!(most > whole.places().count());
}

#[test]
fn hostile_files_of_theirs_are_typed_errors() {
    let file = |nodes: &str, edges: &str, rest: &str| {
        format!(
            "{{\"SPARK_DSG_header\":{{\"project_name\":\"main\",\"version\":{{\"major\":1,\"minor\":1,\"patch\":3}}}},\
             \"layer_keys\":[],\"layer_names\":{{}},\"nodes\":[{nodes}],\"edges\":[{edges}]{rest}}}"
        )
    };
    let object = |id: u64, more: &str| {
        format!("{{\"id\":{id},\"layer\":2,\"attributes\":{{\"type\":\"ObjectNodeAttributes\"{more}}}}}")
    };
    let read = |text: String| read_spark_dsg(text.as_bytes(), None);
    // The same index under every letter: all are kept, none twice.
    let nodes: Vec<String> = (65_u64..91).map(|letter| object(letter << 56 | 5, "")).collect();
    let graph = read(file(&nodes.join(","), "", "")).unwrap();
    assert_eq!(graph.objects().count(), 26);
    let again = read_spark_dsg(&spark(&graph), None).unwrap();
    assert_eq!(graph_to_json(&again), graph_to_json(&graph));
    // Ours in their metadata may say anything.
    for ours in ["5", "{}", "{\"id\":18446744073709551615}", "{\"id\":3,\"label\":7}", "[]", "{\"min\":[0]}"] {
        let text = file(&object(1, &format!(",\"metadata\":{{\"omni_dsg\":{ours}}}")), "", "");
        let _ = read(text);
        let text = file(&object(1, ""), "", &format!(",\"metadata\":{{\"omni_dsg\":{ours}}}"));
        let _ = read(text);
    }
    let unknown = "{\"unknown_fields\":{\"\":{\"spark_dsg\":5},\"objects/O1\":{\"spark_dsg\":[]}}}";
    let text = file(&object(1, ",\"registered\":true"), "", &format!(",\"metadata\":{{\"omni_dsg\":{unknown}}}"));
    read_spark_dsg(&spark(&read(text).unwrap()), None).unwrap();
    assert!(read(file("", "", ",\"metadata\":3")).is_ok());
    let deep = file(&object(1, &format!(",\"metadata\":{}1{}", "[".repeat(400), "]".repeat(400))), "", "");
    assert!(matches!(read(deep), Err(LoadError::Syntax { .. })));
    let broken_kept = "{\"schema\":\"omni-dsg\",\"version\":{\"major\":1,\"minor\":0},\"spark_dsg\":7,\
         \"objects\":[{\"id\":1,\"label\":\"mug\",\"min\":[0,0,0],\"max\":[1,1,1],\"spark_dsg\":{\"id\":\"x\",\"attributes\":[1]}}]}";
    let graph = graph_from_json(broken_kept.as_bytes()).unwrap();
    read_spark_dsg(&spark(&graph), None).unwrap();
}

/// Not a test of its own: what the child of the next one does until it is killed.
#[test]
fn child_saves_for_ever() {
    let Ok(dir) = std::env::var("DSG_SAVE_FOR_EVER") else { return };
    let first: u64 = std::env::var("DSG_SAVE_FROM").unwrap().parse().unwrap();
    for round in first.. {
        let graph = generation(round % 50 + 1);
        let mut ply = Vec::new();
        mesh_of(&graph).write_ply(&mut ply).unwrap();
        let mesh = MeshPly { bytes: &ply, vertices: 3, faces: 1 };
        dsg::folder::save(dir.as_ref(), &graph, Some(&mesh)).unwrap();
    }
}

/// A graph that says which it is in every node, and its mesh in every label.
fn generation(number: u64) -> SceneGraph {
    let mut graph = SceneGraph::new();
    for id in 1..=number {
        let object = Object::new(ObjectId(id), &format!("thing of {number}"), dsg::Aabb::at(Point3::origin()));
        graph.apply(Op::PutObject(Box::new(object))).unwrap();
    }
    graph
}

fn mesh_of(graph: &SceneGraph) -> Mesh {
    Mesh { labels: vec![graph.objects().count() as u32; 3], ..triangle() }
}

#[test]
fn a_process_killed_at_any_moment_of_saving_leaves_a_whole_graph() {
    let dir = tempfile::tempdir().unwrap();
    let run = dir.path().join("run");
    let mut seen = std::collections::BTreeSet::new();
    let mut dice = support::Dice(7);
    // How long a child takes until it has saved once; the machine decides.
    let mut first_save = Duration::ZERO;
    for kill in 0..40_u32 {
        let start = Instant::now();
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "child_saves_for_ever", "--nocapture"])
            .env("DSG_SAVE_FOR_EVER", &run)
            .env("DSG_SAVE_FROM", (7 * kill).to_string())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // The first has to save once; then any moment, also within the repair of what the last one left.
        if kill == 0 {
            while !run.join("ops.log").exists() && child.try_wait().unwrap().is_none() {
                std::thread::sleep(Duration::from_millis(2));
            }
            first_save = start.elapsed();
        } else {
            std::thread::sleep(first_save.mul_f64(3.0 * (dice.next() % 1000) as f64 / 1000.0));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let loaded = dsg::folder::load(&run).unwrap_or_else(|error| panic!("after kill {kill}: {error}"));
        loaded.graph.check_invariants().unwrap();
        let number = loaded.graph.objects().count() as u64;
        assert!(loaded.graph.has_same_content(&generation(number)), "kill {kill}: a mixture");
        let mesh = Mesh::from_ply(&loaded.mesh.expect("it was saved with one")).unwrap();
        assert_eq!(mesh.labels, vec![number as u32; 3], "kill {kill}: the mesh of another graph");
        seen.insert(number);
    }
    assert!(seen.len() > 3, "the kills hit only {seen:?}, a save takes {first_save:?}");
}
