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
