//! `omnivln plan-ground` as a program meets it: stable keys, ways as long as they say, complaints with the place.

mod support;

use std::collections::BTreeSet;
use std::fs;

use serde_json::{Value, json};
use support::omnivln;

fn plan_ground(map: &Value, arguments: &[&str]) -> (Option<i32>, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("map.json");
    fs::write(&file, map.to_string()).unwrap();
    omnivln(&[&["plan-ground", file.to_str().unwrap()], arguments].concat())
}

#[test]
fn ways_have_stable_keys_and_bend_at_corners() {
    let map = json!({
        "outer": [[0, 0], [10, 0], [10, 10], [0, 10]],
        "holes": [[[4, 0.5], [6, 0.5], [6, 9], [4, 9]]],
        "pairs": [{"start": [1, 5], "goal": [9, 5]}, {"start": [1, 5], "goal": [4.5, 5]}],
    });
    let (code, out, _) = plan_ground(&map, &["--json"]);
    assert_eq!(code, Some(1), "one of two goals is in a wall");
    assert_eq!(out.trim_end().lines().count(), 1, "one JSON object");
    let result: Value = serde_json::from_str(&out).unwrap();
    let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    assert_eq!(keys(&result), ["build_ms", "pairs", "tangents", "vertices"].map(str::to_owned).into());
    let way = &result["pairs"][0];
    assert_eq!(keys(way), ["length", "path", "query_us"].map(str::to_owned).into());
    assert_eq!(way["path"], json!([[1.0, 5.0], [4.0, 9.0], [6.0, 9.0], [9.0, 5.0]]));
    assert_eq!(way["length"], json!(12.0));
    assert_eq!(result["vertices"], json!(8));
    let reason = result["pairs"][1]["reason"].as_str().unwrap();
    assert!(reason.contains("inside hole 0 of the map; the nearest point that can be reached is {4, 5}"), "{reason}");
    assert_eq!(result["pairs"][1]["nearest"], json!([4.0, 5.0]));
    let (code, out, _) = plan_ground(&map, &[]);
    assert!(
        code == Some(1) && out.contains("1 of 2 ways") && out.contains("pair 1: the goal is inside hole 0"),
        "{out}"
    );
}

#[test]
fn what_is_no_map_is_refused_with_file_and_reason() {
    let crossing = json!({"outer": [[0, 0], [4, 0], [1, 4], [4, 9]], "pairs": []});
    for (map, wanted) in [
        (json!({"outer": [[0, 0], [1, 0], [1, 1]]}), "missing field `pairs`"),
        (json!({"outer": [[0, 0], [1, 0]], "pairs": []}), "ring 0 has 2 corners"),
        (json!({"outer": [[0, 0], [1e13, 0], [0, 1]], "pairs": []}), "corner 1 of ring 0"),
        (crossing, "crosses"),
    ] {
        let (code, out, error) = plan_ground(&map, &["--json"]);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{error}");
        assert!(error.contains("map.json") && error.contains(wanted), "{error}");
    }
}

/// Two rooms of 4 x 5 m with a door of `door_m` in the wall between, and a way through it.
fn two_rooms(door_m: f64) -> Value {
    let (low, high) = (2.5 - 0.5 * door_m, 2.5 + 0.5 * door_m);
    json!({
        "outer": [[0, 0], [4, 0], [4, low], [4.1, low], [4.1, 0], [8, 0], [8, 5], [4.1, 5], [4.1, high], [4, high], [4, 5], [0, 5]],
        "pairs": [{"start": [1, 1], "goal": [7, 4]}],
    })
}

#[test]
fn a_robot_takes_doors_that_its_outline_fits_through() {
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../../crates/robot-model/models/quadruped.urdf");
    let plan = |map: &Value, arguments: &[&str]| {
        let (code, out, error) = plan_ground(map, &[&["--json", "--urdf", urdf], arguments].concat());
        let result: Value = serde_json::from_str(&out).unwrap_or_else(|_| panic!("{error}"));
        (code, result)
    };
    let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    let straight_m = 45.0_f64.sqrt();
    // Wide: round the posts. Narrow: straight through. Narrower: not at all, and the nearest point is before the door.
    let (code, wide) = plan(&two_rooms(1.5), &[]);
    assert_eq!(code, Some(0));
    let wanted = ["build_ms", "cell_m", "gates", "pairs", "passing_m", "turning_m", "vertices"];
    assert_eq!(keys(&wide), wanted.map(str::to_owned).into());
    let length = wide["pairs"][0]["length"].as_f64().unwrap();
    assert!(wide["gates"] == 0 && length >= straight_m - 1e-9 && length < 1.03 * straight_m, "{length}");
    let (turning_m, passing_m) = (wide["turning_m"].as_f64().unwrap(), wide["passing_m"].as_f64().unwrap());
    assert!(passing_m < turning_m);
    let door_m = turning_m + passing_m;
    let (code, narrow) = plan(&two_rooms(door_m), &[]);
    assert!(code == Some(0) && narrow["gates"] == 1, "{narrow}");
    let (code, refused) = plan(&two_rooms(2.0 * passing_m - 0.02), &[]);
    let reason = refused["pairs"][0]["reason"].as_str().unwrap();
    assert!(code == Some(1) && reason.contains("the nearest point it gets to is [3."), "{reason}");
    // The same map in units of 25 cm.
    let small = scaled(&two_rooms(1.5), 4.0);
    let (_, small) = plan(&small, &["--scale", "0.25"]);
    assert!((small["pairs"][0]["length"].as_f64().unwrap() / 4.0 - length).abs() < 1e-6);
}

/// Every number times a factor.
fn scaled(value: &Value, factor: f64) -> Value {
    match value {
        Value::Number(number) => json!(number.as_f64().unwrap() * factor),
        Value::Array(list) => list.iter().map(|item| scaled(item, factor)).collect(),
        Value::Object(map) => {
            Value::Object(map.iter().map(|(key, item)| (key.clone(), scaled(item, factor))).collect())
        }
        other => other.clone(),
    }
}
