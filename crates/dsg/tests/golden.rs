//! Files of others (spark_dsg, read where they lie) and our own: counts, names, faults, round trips.

use std::collections::BTreeMap;

use dsg::{
    LoadError, SceneGraph, graph_from_json, graph_to_json, read_spark_dsg, scene_graph_text, scene_objects_json,
};

/// Bytes of a shared file, `None` (with a note) where the folder is absent.
fn shared(name: &str) -> Option<Vec<u8>> {
    let path = format!("{}/../../../../shared/data/dsg/{name}", env!("CARGO_MANIFEST_DIR"));
    let near = format!("{}/../../../shared/data/dsg/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&near).or_else(|_| std::fs::read(&path)).ok();
    if bytes.is_none() {
        eprintln!("skipped: {near} is not there");
    }
    bytes
}

/// Objects, places, rooms, buildings, poses, place edges.
fn counts(graph: &SceneGraph) -> [usize; 6] {
    let poses = graph.agents().map(|agent| agent.trajectory.len()).sum();
    [
        graph.objects().count(),
        graph.places().count(),
        graph.rooms().count(),
        graph.buildings().count(),
        poses,
        graph.place_edges().count(),
    ]
}

#[test]
fn every_shared_graph_loads_with_the_counts_of_its_readme() {
    let check = |name, nodes, expected| {
        let Some(bytes) = shared(name) else { return };
        let graph = read_spark_dsg(&bytes, None).unwrap();
        assert_eq!(graph.node_count(), nodes, "{name}");
        assert_eq!(counts(&graph), expected, "{name}");
        graph.check_invariants().unwrap();
        // Ours holds all of it.
        let again = graph_from_json(&graph_to_json(&graph)).unwrap();
        assert!(again.has_same_content(&graph), "{name}");
        assert!(!scene_graph_text(&graph).is_empty());
        serde_json::from_str::<serde_json::Value>(&scene_objects_json(&graph)).unwrap();
    };
    check("four_rooms.json", 242, [27, 190, 4, 1, 20, 536]);
    check("four_rooms_nomesh.json", 242, [27, 190, 4, 1, 20, 536]);
    check("apartment_dsg.json", 296, [7, 185, 1, 1, 102, 396]);
    check("minimal_foreign.json", 6, [1, 2, 1, 1, 1, 1]);
    check("minimal_resaved.json", 6, [1, 2, 1, 1, 1, 1]);
}

#[test]
fn four_rooms_has_its_doors_labels_and_the_mover() {
    let Some(bytes) = shared("four_rooms.json") else {
        return;
    };
    let graph = read_spark_dsg(&bytes, None).unwrap();
    assert_eq!(graph.room_edges().count(), 4);
    // Truth: doors in the walls at x = 5 and y = 5, 0.9 m wide.
    for door in graph.room_edges() {
        let at = door.doorway;
        assert!((at.x - 5.0).abs() < 0.8 || (at.y - 5.0).abs() < 0.8, "{at}");
        assert!(door.width_m > 0.3 && door.width_m < 1.0, "{}", door.width_m);
    }
    let labels: Vec<&str> = graph.objects().map(|object| object.label.as_str()).collect();
    assert_eq!(labels.iter().filter(|label| **label == "chair").count(), 10);
    assert_eq!(graph.objects().filter(|object| object.is_dynamic()).count(), 1);
    // Every object stands in the room of the quadrant it is in: room = (x > 5) + 2 (y > 5).
    for object in graph.objects().filter(|object| !object.is_dynamic()) {
        let quadrant = u64::from(object.centroid.x > 5.0) + 2 * u64::from(object.centroid.y > 5.0);
        assert_eq!(object.room, Some(dsg::RoomId(quadrant)), "{}", object.id);
    }
}

#[test]
fn numeric_labels_take_names_from_a_table() {
    let Some(bytes) = shared("apartment_dsg.json") else {
        return;
    };
    let graph = read_spark_dsg(&bytes, None).unwrap();
    assert!(graph.objects().all(|object| object.label.starts_with("label ")));
    let number = |label: &str| label.strip_prefix("label ").unwrap().parse::<u32>().unwrap();
    let first = number(&graph.objects().next().unwrap().label);
    let table = BTreeMap::from([(first, "Couch".to_owned())]);
    let graph = read_spark_dsg(&bytes, Some(&table)).unwrap();
    assert_eq!(graph.objects().next().unwrap().label, "couch");
}

const SPARK: &str = r#"{"SPARK_DSG_header":{"project_name":"main","version":{"major":1,"minor":1,"patch":3}},
 "layer_keys":[],"layer_names":{},"nodes":[
 {"id":8070450532247928832,"layer":3,"partition":0,"attributes":{"type":"PlaceNodeAttributes","position":[1,1,1],"distance":0.8}},
 {"id":8070450532247928833,"layer":3,"partition":0,"attributes":{"type":"PlaceNodeAttributes","position":[2,1,1],"distance":0.6}}],
 "edges":[{"source":8070450532247928832,"target":8070450532247928833,"info":{"type":"EdgeAttributes"}}]}"#;

#[test]
fn faults_of_foreign_files_are_typed_and_say_where() {
    let error = |text: String| read_spark_dsg(text.as_bytes(), None).unwrap_err();
    read_spark_dsg(SPARK.as_bytes(), None).unwrap();
    assert!(matches!(error(SPARK[..300].into()), LoadError::Truncated { .. }));
    assert!(matches!(error(SPARK.replace("[1,1,1]", "[1,NaN,1]")), LoadError::Syntax { .. }));
    let null = error(SPARK.replace("[1,1,1]", "[1,null,1]"));
    assert_eq!(null.to_string(), "$.nodes[0].attributes.position[1] is not a finite number");
    let duplicate = error(SPARK.replace("8070450532247928833,\"layer\"", "8070450532247928832,\"layer\""));
    assert!(matches!(&duplicate, LoadError::Duplicate { path } if path.0 == "$.nodes[1]"), "{duplicate}");
    let dangling = error(SPARK.replace("\"target\":8070450532247928833", "\"target\":5"));
    assert_eq!(dangling.to_string(), "$.edges[0].target refers to a node that does not exist: 5");
    let float = error(SPARK.replace("\"source\":8070450532247928832", "\"source\":8.070450532247928e18"));
    assert!(matches!(&float, LoadError::Type { .. }), "{float}");
    let unknown = error(SPARK.replacen("PlaceNodeAttributes", "Mystery", 1));
    assert!(matches!(&unknown, LoadError::UnknownType { path } if path.0 == "$.nodes[0].attributes.type"), "{unknown}");
    assert!(matches!(error(SPARK.replace("\"major\":1", "\"major\":7")), LoadError::NewerVersion { .. }));
    assert!(matches!(error("{}".into()), LoadError::Schema { .. }));
    assert!(matches!(error("[".repeat(5000)), LoadError::Syntax { .. }));
}

const OURS: &str = r#"{"schema":"omni-dsg","version":{"major":1,"minor":9},"revision":41,"colour_space":"sRGB",
 "places":[{"id":18446744073709551615,"position":[0,0,1],"clearance_m":0.5,"smell":"coffee"}],
 "rooms":[{"id":2,"name":"kitchen","center":[0,0,1],"places":[18446744073709551615]}],
 "objects":[{"id":7,"label":"mug","min":[0,0,0],"max":[0.1,0.1,0.1],"room":2,"weight_kg":0.3}]}"#;

#[test]
fn unknown_fields_of_a_newer_minor_version_are_written_back_and_ids_are_exact() {
    let graph = graph_from_json(OURS.as_bytes()).unwrap();
    graph.check_invariants().unwrap();
    assert_eq!(graph.revision(), 41);
    let text = String::from_utf8(graph_to_json(&graph)).unwrap();
    for kept in ["\"colour_space\": \"sRGB\"", "\"smell\":\"coffee\"", "\"weight_kg\":0.3", "18446744073709551615"] {
        assert!(text.contains(kept), "{kept} in {text}");
    }
    assert_eq!(text.as_bytes(), graph_to_json(&graph_from_json(text.as_bytes()).unwrap()));
}

#[test]
fn faults_of_our_files_are_typed_and_say_where() {
    let error = |from: &str, to: &str| graph_from_json(OURS.replace(from, to).as_bytes()).unwrap_err().to_string();
    assert_eq!(error("\"room\":2", "\"room\":3"), "$.objects[0].room refers to a node that does not exist: 3");
    assert_eq!(error("\"label\":\"mug\",", ""), "$.objects[0].label is missing");
    assert_eq!(
        error("\"max\":[0.1", "\"max\":[-1"),
        "$.objects[0]: object: bounds is not a finite number in its range"
    );
    assert_eq!(error("\"clearance_m\":0.5", "\"clearance_m\":\"wide\""), "$.places[0].clearance_m is not a number");
    assert_eq!(error("\"major\":1", "\"major\":2"), "the file has version 2, this program reads up to 1");
    assert_eq!(error("omni-dsg", "cake"), "$.schema does not name a format that is read here");
    assert!(error("0.3}]", "0.3}").contains("line"));
}

#[test]
fn a_folder_is_saved_whole_and_checked() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path().join("run");
    let graph = graph_from_json(OURS.as_bytes()).unwrap();
    let mesh = dsg::MeshPly { bytes: b"ply mesh", vertices: 3, faces: 1 };
    dsg::folder::save(&dir, &graph, Some(&mesh)).unwrap();
    let loaded = dsg::folder::load(&dir).unwrap();
    assert!(loaded.graph.has_same_content(&graph));
    assert_eq!(loaded.mesh.as_deref(), Some(&b"ply mesh"[..]));

    // A crash after the new mesh and before the new graph: the old mesh is still found.
    std::fs::rename(dir.join("mesh.ply"), dir.join("mesh.prev.ply")).unwrap();
    std::fs::write(dir.join("mesh.ply"), b"newer mesh").unwrap();
    assert_eq!(dsg::folder::load(&dir).unwrap().mesh.as_deref(), Some(&b"ply mesh"[..]));
    std::fs::remove_file(dir.join("mesh.prev.ply")).unwrap();
    assert!(matches!(dsg::folder::load(&dir), Err(LoadError::MeshHash { .. })));

    // Saving again heals it, and leaves no other file behind.
    dsg::folder::save(&dir, &graph, Some(&mesh)).unwrap();
    let mut names: Vec<_> = std::fs::read_dir(&dir).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["graph.json", "mesh.ply", "ops.log"]);
    assert!(matches!(dsg::folder::load(&dir.join("nothing")), Err(LoadError::Io { .. })));
}
