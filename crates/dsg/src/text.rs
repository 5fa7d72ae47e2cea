//! The graph for a language model or a person: `scene_graph.txt` (rooms, groups, objects) and `scene_objects.json`.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::object::Object;
use crate::room::Room;

/// Rooms, in them groups, in them objects, each on a line, then the relations. Metres, one decimal.
pub fn scene_graph_text(graph: &SceneGraph) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_graph(graph, &mut text);
    text
}

fn write_graph(graph: &SceneGraph, out: &mut String) -> std::fmt::Result {
    let objects: Vec<&Object> = graph.confirmed_objects().collect();
    for building in graph.buildings() {
        let storeys = building.storeys.len().max(1);
        writeln!(out, "{}: {}, {}", building.name, count(graph.rooms.len(), "room"), count(storeys, "storey"))?;
    }
    for room in graph.rooms() {
        write_room(graph, room, out)?;
        let here: Vec<&Object> = objects.iter().copied().filter(|object| object.room == Some(room.id)).collect();
        write_objects(graph, &here, out)?;
    }
    let elsewhere: Vec<&Object> = objects.iter().copied().filter(|object| object.room.is_none()).collect();
    if !elsewhere.is_empty() {
        writeln!(out, "in no room:")?;
        write_objects(graph, &elsewhere, out)?;
    }
    let frontiers = graph.frontiers().count();
    if frontiers > 0 {
        writeln!(out, "unexplored: {}", count(frontiers, "frontier place"))?;
    }
    Ok(())
}

fn write_room(graph: &SceneGraph, room: &Room, out: &mut String) -> std::fmt::Result {
    write!(out, "{} ({}", room.name, room.id)?;
    if let Some(kind) = room.kind.as_ref().filter(|kind| !room.name.starts_with(*kind)) {
        write!(out, ", {} {:.0} %", kind, 100.0 * room.kind_confidence)?;
    }
    if room.floor != 0 {
        write!(out, ", floor {}", room.floor)?;
    }
    if room.area_m2 > 0.0 {
        write!(out, ", {:.1} m2", room.area_m2)?;
    }
    write!(out, ", centre {})", position(&room.center))?;
    let doors: Vec<String> = graph
        .doors_of(room.id)
        .into_iter()
        .filter_map(|door| {
            let other = graph.room(door.other(room.id)?)?;
            let width = if door.width_m > 0.0 { format!(" {:.1} m wide", door.width_m) } else { String::new() };
            Some(format!("{} ({}) at {}{width}", other.name, other.id, position(&door.doorway)))
        })
        .collect();
    if !doors.is_empty() {
        write!(out, ", doors to {}", doors.join(", "))?;
    }
    writeln!(out, ":")
}

fn write_objects(graph: &SceneGraph, objects: &[&Object], out: &mut String) -> std::fmt::Result {
    let mut groups: Vec<_> = objects.iter().filter_map(|object| object.group).collect();
    groups.sort_unstable();
    groups.dedup();
    for id in groups {
        let Some(group) = graph.group(id) else {
            continue;
        };
        writeln!(out, "  {} ({}):", group.name, group.id)?;
        for object in objects.iter().filter(|object| object.group == Some(id)) {
            write_object(graph, object, "    ", out)?;
        }
    }
    for object in objects.iter().filter(|object| object.group.is_none()) {
        write_object(graph, object, "  ", out)?;
    }
    Ok(())
}

fn write_object(graph: &SceneGraph, object: &Object, indent: &str, out: &mut String) -> std::fmt::Result {
    let sides = object.bounds.sides_m();
    write!(out, "{indent}{} ({}) at {}", object.label, object.id, position(&object.centroid))?;
    write!(out, ", {:.1} x {:.1} x {:.1} m", sides.x, sides.y, sides.z)?;
    for key in ["color", "material", "function"] {
        if let Some(word) = object.attributes.get(key) {
            write!(out, ", {}{word}", if key == "function" { "for " } else { "" })?;
        }
    }
    if object.is_dynamic() {
        write!(out, ", moving")?;
    }
    for line in relation_words(graph, object.id) {
        write!(out, "; {line}")?;
    }
    if !object.caption.is_empty() {
        write!(out, "; \"{}\"", object.caption.replace('\n', " "))?;
    }
    writeln!(out)
}

/// "on table (O3)", "near sink (O4)" for the relations whose subject it is, and near in both directions.
fn relation_words(graph: &SceneGraph, id: ObjectId) -> Vec<String> {
    let name = |id: ObjectId| graph.object(id).map_or_else(String::new, |object| format!("{} ({id})", object.label));
    graph
        .relations_of(id)
        .filter(|relation| relation.subject == id || relation.kind == crate::relation::RelationKind::Near)
        .map(|relation| {
            let to = if relation.subject == id { relation.object } else { relation.subject };
            match relation.other {
                Some(other) => format!("{} {} and {}", relation.kind, name(to), name(other)),
                None => format!("{} {}", relation.kind, name(to)),
            }
        })
        .collect()
}

fn position(p: &nalgebra::Point3<f64>) -> String {
    // Adding zero turns -0.0 into 0.0.
    let tenth = |x: f64| (x * 10.0).round() / 10.0 + 0.0;
    format!("({:.1}, {:.1}, {:.1})", tenth(p.x), tenth(p.y), tenth(p.z))
}

fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// `{"revision", "rooms": [{"id", "name", "kind", "objects": [{"id", "type", "position", "size", ...}]}], "elsewhere": [...]}`.
pub fn scene_objects_json(graph: &SceneGraph) -> String {
    let rooms: Vec<Value> = graph
        .rooms()
        .map(|room| {
            let objects = graph.confirmed_objects().filter(|object| object.room == Some(room.id));
            let objects: Vec<Value> = objects.map(|object| describe(graph, object)).collect();
            let doors: Vec<String> =
                graph.doors_of(room.id).iter().filter_map(|door| Some(door.other(room.id)?.to_string())).collect();
            json!({ "id": room.id.to_string(), "name": room.name, "kind": room.kind, "floor": room.floor,
                    "doors_to": doors, "objects": objects })
        })
        .collect();
    let elsewhere: Vec<Value> = graph
        .confirmed_objects()
        .filter(|object| object.room.is_none())
        .map(|object| describe(graph, object))
        .collect();
    let document = json!({ "revision": graph.revision(), "rooms": rooms, "elsewhere": elsewhere });
    let mut text = serde_json::to_string_pretty(&document).expect("a tree of plain values always prints");
    text.push('\n');
    text
}

fn describe(graph: &SceneGraph, object: &Object) -> Value {
    let centimetre = |x: f64| (x * 100.0).round() / 100.0 + 0.0;
    let list = |v: [f64; 3]| Value::from(v.map(centimetre).to_vec());
    let mut map = Map::new();
    map.insert("id".into(), json!(object.id.to_string()));
    map.insert("type".into(), json!(object.label));
    map.insert("position".into(), list(object.centroid.coords.into()));
    map.insert("size".into(), list(object.bounds.sides_m().into()));
    if !object.attributes.is_empty() {
        map.insert("attributes".into(), json!(object.attributes));
    }
    if !object.caption.is_empty() {
        map.insert("caption".into(), json!(object.caption));
    }
    if let Some(group) = object.group.and_then(|group| graph.group(group)) {
        map.insert("group".into(), json!(group.name));
    }
    let relations: Vec<Value> = graph
        .relations_of(object.id)
        .filter(|relation| relation.subject == object.id)
        .map(|r| json!({ "kind": r.kind.word(), "object": r.object.to_string(), "other": r.other.map(|o| o.to_string()) }))
        .map(|value| match value {
            Value::Object(map) => Value::Object(map.into_iter().filter(|(_, value)| !value.is_null()).collect()),
            other => other,
        })
        .collect();
    if !relations.is_empty() {
        map.insert("relations".into(), Value::from(relations));
    }
    Value::Object(map)
}
