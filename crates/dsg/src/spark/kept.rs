//! What spark_dsg files say and this graph has no place for: kept word for word, and written back.
//!
//! A node of theirs becomes a node of ours; what we would write for that node is compared with what they wrote, and every
//! field that differs is kept beside what stood in its stead (`attributes` and `instead_of` of the record's field
//! `spark_dsg`). On the way back a kept field stands as long as ours is still what it was then; where we have changed our mind
//! since, ours stands. So nothing of theirs is lost, nothing of ours is overruled, and no field needs a rule of its own.

use serde_json::{Map, Value, json};

use crate::graph::SceneGraph;

/// The field of a record (and of the document) under which theirs is kept.
pub(crate) const KEPT: &str = "spark_dsg";
/// The key of their open metadata under which ours travels.
pub(crate) const OURS: &str = "omni_dsg";

/// What was kept of a record of theirs.
pub(crate) fn kept<'g>(graph: &'g SceneGraph, list: &str, id: &impl std::fmt::Display) -> Option<&'g Value> {
    graph.unknown_fields.get(&format!("{list}/{id}"))?.get(KEPT)
}

/// What was kept of a document of theirs.
pub(crate) fn kept_of_document<'g>(graph: &'g SceneGraph, name: &str) -> Option<&'g Value> {
    graph.unknown_fields.get("")?.get(KEPT)?.get(name)
}

/// Keeps a value of theirs beside the lists.
pub(crate) fn keep_in_document(graph: &mut SceneGraph, name: &str, value: Value) {
    put_kept(graph.unknown_fields.entry(String::new()).or_default(), name, value);
}

/// Keeps a value of theirs in a record.
pub(crate) fn put_kept(record: &mut Map<String, Value>, name: &str, value: Value) {
    let kept = record.entry(KEPT).or_insert_with(|| json!({}));
    if !kept.is_object() {
        *kept = json!({});
    }
    kept[name] = value;
}

/// The fields of `theirs` that `ours` would not bring back, as `{"attributes": .., "instead_of": ..}`; `None` if there are none.
pub(crate) fn keep(theirs: &Map<String, Value>, ours: &Map<String, Value>) -> Option<Map<String, Value>> {
    let mut attributes = Map::new();
    let mut instead_of = Map::new();
    for (field, value) in theirs {
        let value = modern(field, value);
        match ours.get(field) {
            Some(own) if is_same(own, &value) => {}
            Some(own) => {
                attributes.insert(field.clone(), value);
                instead_of.insert(field.clone(), own.clone());
            }
            None if is_default(field, &value) => {}
            None => drop(attributes.insert(field.clone(), value)),
        }
    }
    // What we would write and they did not, where it is more than the default.
    for (field, own) in ours {
        if !theirs.contains_key(field) && !is_default(field, own) {
            attributes.insert(field.clone(), Value::Null);
            instead_of.insert(field.clone(), own.clone());
        }
    }
    if attributes.is_empty() {
        return None;
    }
    let mut kept = Map::from_iter([("attributes".to_owned(), Value::Object(attributes))]);
    if !instead_of.is_empty() {
        kept.insert("instead_of".into(), Value::Object(instead_of));
    }
    Some(kept)
}

/// Puts what was kept back into what we write.
pub(crate) fn restore(ours: &mut Map<String, Value>, kept: &Value) {
    let instead_of = kept.get("instead_of");
    for (field, value) in kept.get("attributes").and_then(Value::as_object).into_iter().flatten() {
        let then = instead_of.and_then(|map| map.get(field));
        let stands = match (ours.get(field), then) {
            (Some(now), Some(then)) => is_same(now, then),
            (None, then) => then.is_none(),
            (Some(_), None) => false,
        };
        if stands && value.is_null() {
            ours.remove(field);
        } else if stands {
            ours.insert(field.clone(), value.clone());
        }
    }
}

/// Values of files up to 1.0.x as later versions write them.
fn modern(field: &str, value: &Value) -> Value {
    match (field, value) {
        ("color", Value::Array(channels)) => {
            let channel = |k: usize| channels.get(k).cloned().unwrap_or(json!(255));
            json!({ "r": channel(0), "g": channel(1), "b": channel(2), "a": channel(3) })
        }
        ("bounding_box", Value::Object(theirs)) if theirs.contains_key("min") && theirs.contains_key("max") => {
            let mut modern = theirs.clone();
            let corner = |name: &str, k: usize| theirs.get(name).and_then(|corner| corner.get(k)?.as_f64());
            let side = |k: usize| corner("max", k).zip(corner("min", k)).map_or(0.0, |(max, min)| max - min);
            modern.remove("min");
            modern.remove("max");
            modern.insert("dimensions".into(), json!([side(0), side(1), side(2)]));
            Value::Object(modern)
        }
        _ => value.clone(),
    }
}

/// Whether a reader of theirs would take the field for this value if it were not there.
fn is_default(field: &str, value: &Value) -> bool {
    let is = |default: Value| is_same(value, &default);
    match field {
        "is_active" | "is_predicted" | "registered" | "active_frontier" | "need_cleanup" | "anti_frontier"
        | "weighted" => is(json!(false)),
        "real_place" => is(json!(true)),
        "last_update_time_ns" | "num_basis_points" | "num_frontier_voxels" | "distance" => is(json!(0)),
        "weight" => is(json!(1.0)),
        "name" => is(json!("")),
        "semantic_label" => is(json!(u32::MAX)),
        "metadata" | "semantic_class_probabilities" | "details" => value.is_null() || is(json!({})),
        "color" => is(json!({ "r": 0, "g": 0, "b": 0, "a": 255 })),
        "position" | "frontier_scale" => is(json!([0, 0, 0])),
        "orientation" | "world_R_object" | "world_R_body" => is(json!({ "w": 1, "x": 0, "y": 0, "z": 0 })),
        "semantic_feature" => {
            value.get("data").is_none_or(Value::is_null) && value.get("rows").is_none_or(|rows| rows == 0)
        }
        "bounding_box" => value.get("type").is_some_and(|kind| kind == "INVALID"),
        "mesh_connections"
        | "pcl_mesh_connections"
        | "voxblox_mesh_connections"
        | "mesh_vertex_labels"
        | "deformation_connections"
        | "dbow_ids"
        | "dbow_values"
        | "first_observed_ns"
        | "last_observed_ns"
        | "trajectory_positions"
        | "trajectory_timestamps"
        | "dynamic_object_points" => value.is_null() || value.as_array().is_some_and(Vec::is_empty),
        _ => false,
    }
}

/// Equal values; a number is equal however it is written.
pub(crate) fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => match (a.as_u64(), b.as_u64(), a.as_i64(), b.as_i64()) {
            (Some(a), Some(b), ..) => a == b,
            (_, _, Some(a), Some(b)) => a == b,
            _ => a.as_f64() == b.as_f64(),
        },
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b)),
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(key, a)| b.get(key).is_some_and(|b| is_same(a, b)))
        }
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(value: Value) -> Map<String, Value> {
        value.as_object().unwrap().clone()
    }

    #[test]
    fn what_differs_comes_back_until_we_change_our_mind() {
        let theirs =
            map(json!({ "name": "chair_0", "position": [1, 2, 3], "mesh_connections": [1, 2], "is_active": false }));
        let ours =
            map(json!({ "name": "chair", "position": [1.0, 2.0, 3.0], "color": { "r": 9, "g": 0, "b": 0, "a": 255 } }));
        let kept = keep(&theirs, &ours).unwrap();
        let back = |mut ours: Map<String, Value>| {
            restore(&mut ours, &Value::Object(kept.clone()));
            ours
        };
        let mut expected = theirs.clone();
        expected.remove("is_active");
        assert!(is_same(&Value::Object(back(ours.clone())), &Value::Object(expected)));
        let mut changed = ours.clone();
        changed.insert("name".into(), json!("stool"));
        changed.insert("color".into(), json!({ "r": 8, "g": 0, "b": 0, "a": 255 }));
        let now = back(changed);
        assert_eq!((&now["name"], &now["color"]["r"]), (&json!("stool"), &json!(8)));
        assert_eq!(now["mesh_connections"], json!([1, 2]));
        assert!(keep(&ours, &ours).is_none());
    }

    #[test]
    fn old_boxes_and_colours_are_kept_in_the_new_form() {
        let old =
            map(json!({ "color": [1, 2, 3], "bounding_box": { "type": "RAABB", "min": [0, 0, 0], "max": [1, 2, 3] } }));
        let kept = keep(&old, &Map::new()).unwrap();
        let attributes = &kept["attributes"];
        assert_eq!(attributes["color"], json!({ "r": 1, "g": 2, "b": 3, "a": 255 }));
        assert_eq!(attributes["bounding_box"], json!({ "type": "RAABB", "dimensions": [1.0, 2.0, 3.0] }));
    }
}
