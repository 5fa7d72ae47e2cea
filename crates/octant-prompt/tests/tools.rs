//! Every tool through its JSON: in a room laid out by hand, the answers are known without any operator of the crate.
//!
//! ```text
//!  y
//!  4 | lamp                       The robot stands at (2.5, 0.5) and looks along +y; left is -x.
//!  3 | shelf   desk    sofa       On the desk a mug, under it a box, over it a picture; a book between desk and sofa.
//!  0 |         robot              Next door, 3 m to the right of the border: a plant.
//!    +--1-------2.5-----4--- x
//! ```

mod support;

use std::f64::consts::FRAC_PI_2;

use dsg::ObjectId;
use nalgebra::Point3;
use octant_prompt::tools::{ToolBox, ToolError, call, call_text, definitions};
use octant_prompt::{Estimate, PromptConfig, Situation, build_prompt_for, parse_instruction};
use serde_json::{Value, json};
use support::{Put, graph, pose, put};

fn things() -> Vec<Put> {
    let wide = |label: &str, x: f64, y: f64| Put { size_m: 0.7, ..put(label, x, y, 0.35) };
    vec![
        wide("desk", 2.5, 3.0),
        wide("sofa", 4.0, 3.0),
        wide("shelf", 1.0, 3.0),
        Put { size_m: 0.1, ..put("mug", 2.5, 3.0, 0.75) },
        Put { size_m: 0.2, ..put("box", 2.5, 3.0, -0.15) },
        put("picture", 2.5, 3.2, 1.8),
        Put { size_m: 0.2, ..put("book", 3.25, 3.0, 0.1) },
        Put { caption: "a tall lamp".into(), ..put("lamp", 1.0, 4.5, 0.15) },
        put("plant", 8.0, 1.0, 0.15),
    ]
}

/// Calls a tool in the room.
fn ask(name: &str, arguments: Value) -> Result<Value, ToolError> {
    let graph = graph(2, &["study", "hallway"], &things());
    let instruction = parse_instruction("find the mug");
    // The plant's room is cut off.
    let path = |point: &Point3<f64>| (point.x < 5.0).then(|| (point.x - 2.5).abs() + (point.y - 0.5).abs());
    let can_stop = |_: ObjectId| false;
    let situation = Situation::new(&graph, pose(2.5, 0.5, FRAC_PI_2), &instruction, &path, &can_stop);
    let prompt = build_prompt_for(&situation, &PromptConfig::default(), &Estimate);
    let tools = ToolBox { situation: &situation, names: &prompt.names };
    let text = call_text(name, &arguments.to_string(), &tools);
    if arguments.to_string().len() <= 4096 {
        assert_eq!(text, call(name, &arguments, &tools), "text and value are one");
    }
    text
}

/// The ids of a list of results.
fn ids(name: &str, arguments: Value) -> Vec<String> {
    let answer = ask(name, arguments.clone()).unwrap_or_else(|error| panic!("{name} {arguments}: {error}"));
    let id = |row: &Value| row.get("id").unwrap_or(row).as_str().expect("an id").to_string();
    answer.as_array().expect("a list").iter().map(id).collect()
}

#[test]
fn relations_to_one_thing() {
    let first = |name: &str, id: &str| ids(name, json!({"id": id})).first().cloned().unwrap_or_default();
    assert_eq!(first("find_on", "desk1"), "mug1");
    assert_eq!(ids("find_supporting", json!({"id": "mug1"})), ["desk1"]);
    assert_eq!(first("find_below", "desk1"), "box1");
    assert_eq!(first("find_above", "mug1"), "picture1");
    assert_eq!(first("find_in_front_of", "picture1"), "desk1", "what is nearer to the robot, which looks at it");
    assert_eq!(ids("find_near", json!({"id": "desk1", "class": "book", "k": 3})), ["book1"]);
    assert_eq!(ids("find_farthest", json!({"id": "shelf1", "k": 1})).len(), 1);
    let far = ids("find_farthest", json!({"id": "shelf1"}));
    assert!(far.iter().position(|id| id.contains("plant")) == Some(0), "{far:?}");
    assert!(ids("find_near", json!({"id": "shelf1", "k": 0})).is_empty());
}

#[test]
fn sides_follow_the_view() {
    // The robot looks at the desk from the south: the shelf is on its left.
    assert_eq!(ids("find_left_of", json!({"id": "desk1", "class": "shelf"})), ["shelf1"]);
    assert_eq!(ids("find_right_of", json!({"id": "desk1", "class": "sofa", "view": "robot"})), ["sofa1"]);
    assert!(ids("find_left_of", json!({"id": "desk1", "class": "sofa"})).is_empty());
    // Facing the sofa, north-east is ahead: the shelf lies behind and to the left of the desk, the lamp behind the shelf.
    assert_eq!(ids("find_behind", json!({"id": "shelf1", "class": "lamp"})), ["lamp1"]);
    assert!(ids("find_in_front_of", json!({"id": "shelf1", "class": "lamp"})).is_empty());
    let facing = ids("find_behind", json!({"id": "desk1", "class": "sofa", "view": "facing sofa1"}));
    assert_eq!(facing, ["sofa1"], "seen along the line to the sofa it is beyond the desk");
    assert_eq!(ask("find_left_of", json!({"id": "desk1", "view": "facing nobody"})), Err(ToolError::UnknownId("view")));
    assert_eq!(ask("find_left_of", json!({"id": "desk1", "view": 7})), Err(ToolError::Argument("view")));
}

#[test]
fn between_orders_rooms_ways_and_facts() {
    assert_eq!(ids("find_between", json!({"a": "desk1", "b": "sofa1"})).first().map(String::as_str), Some("book1"));
    let wide = json!({"class": "thing", "key": "left_to_right"});
    let row = ids("order_by", wide);
    let at = |id: &str| row.iter().position(|other| other == id).unwrap_or_else(|| panic!("{id} in {row:?}"));
    assert!(at("shelf1") < at("desk1") && at("desk1") < at("sofa1"), "{row:?}");
    let near = ids("order_by", json!({"class": "thing", "key": "distance"}));
    assert!(near.iter().position(|id| id == "desk1") < near.iter().position(|id| id == "lamp1"), "{near:?}");
    assert_eq!(ids("order_by", json!({"class": "thing", "key": "height", "k": 1})), ["picture1"]);
    assert_eq!(ids("order_by", json!({"class": "desk", "key": "size"})), ["desk1"]);
    assert_eq!(ask("order_by", json!({"class": "desk", "key": "age"})), Err(ToolError::Argument("key")));
    assert_eq!(ids("objects_in", json!({"room": "room0", "class": "mug"})), ["mug1"]);
    assert_eq!(ids("objects_in", json!({"room": "room1"})).len(), 1);
    assert_eq!(ids("rooms_with", json!({"class": "plant"})), ["room1"]);
    assert!(ids("rooms_with", json!({"class": "unicorn"})).is_empty());
    assert_eq!(ask("path_length", json!({"id": "desk1"})).expect("known"), json!({"path_m": 2.5, "reachable": true}));
    let cut_off = ask("path_length", json!({"id": "room1"})).expect("known");
    assert_eq!(cut_off, json!({"path_m": null, "reachable": false}));
    let facts = ask("describe", json!({"id": "lamp1"})).expect("known");
    assert_eq!(
        (&facts["class"], &facts["caption"], &facts["room"]),
        (&json!("lamp"), &json!("a tall lamp"), &json!("room0"))
    );
    assert_eq!(facts["octant"], "front-left-bottom");
    assert_eq!(facts["size_m"], json!([0.3, 0.3, 0.3]));
}

#[test]
fn what_cannot_be_answered_is_an_error_that_names_the_argument() {
    assert_eq!(ask("find_on", json!({"id": "unicorn1"})), Err(ToolError::UnknownId("id")));
    assert_eq!(ask("find_on", json!({"id": "room0"})), Err(ToolError::UnknownId("id")), "a room carries nothing");
    assert_eq!(ask("find_on", json!({})), Err(ToolError::Argument("id")));
    assert_eq!(ask("find_on", json!({"id": "desk1", "k": -1})), Err(ToolError::Argument("k")));
    assert_eq!(ask("find_on", json!([])), Err(ToolError::BadArguments));
    assert_eq!(ask("format_disk", json!({})), Err(ToolError::UnknownTool));
    assert_eq!(ask("find_on", json!({"id": "x".repeat(5_000)})), Err(ToolError::BadArguments));
    assert_eq!(ids("find_on", json!({"id": "O1"})), ["mug1"], "ids of the graph are understood");
}

#[test]
fn every_tool_that_is_offered_exists_and_the_promised_ones_are_offered() {
    let definitions = definitions();
    let offered: Vec<&str> =
        definitions.as_array().expect("a list").iter().filter_map(|tool| tool["function"]["name"].as_str()).collect();
    for name in &offered {
        assert_ne!(ask(name, json!({})), Err(ToolError::UnknownTool), "{name}");
    }
    for promised in [
        "find_above",
        "find_below",
        "find_on",
        "find_supporting",
        "find_near",
        "find_farthest",
        "find_between",
        "find_left_of",
        "find_right_of",
        "find_in_front_of",
        "find_behind",
        "order_by",
        "objects_in",
        "rooms_with",
        "path_length",
        "describe",
    ] {
        assert!(offered.contains(&promised), "{promised}");
    }
}
