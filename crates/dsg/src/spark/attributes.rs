//! Attributes of spark_dsg nodes, both ways: for each kind of node what we read from theirs and what we write for ours.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use serde_json::{Map, Value, json};

use crate::agent::AgentPose;
use crate::bounds::Aabb;
use crate::group::Group;
use crate::ids::{BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::load::{Cursor, LoadError};
use crate::object::Object;
use crate::place::{Place, PlaceEdge};
use crate::presence::{self, Presence, TrackPoint};
use crate::room::{Building, Room};
use crate::spark::kept::OURS;

/// The label that says "none".
pub(crate) const NO_LABEL: u32 = u32::MAX;

fn map(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

fn point(p: &Point3<f64>) -> Value {
    json!([p.x, p.y, p.z])
}

fn rotation(q: &UnitQuaternion<f64>) -> Value {
    json!({ "w": q.w, "x": q.i, "y": q.j, "z": q.k })
}

/// Their open metadata without what is ours in it.
fn metadata(at: &Cursor) -> Map<String, Value> {
    let mut metadata = at.find("metadata").and_then(|c| c.value.as_object().cloned()).unwrap_or_default();
    metadata.remove(OURS);
    metadata
}

// Objects

/// An object by what they say of it alone. It is called by `label_names`, else by its name there, else "label 11".
pub(crate) fn object(
    id: ObjectId,
    at: &Cursor,
    label_names: Option<&BTreeMap<u32, String>>,
) -> Result<Object, LoadError> {
    let position = position(at)?;
    let bounds = bounds(at, &position)?;
    let name = at.find("name").map_or(Ok(""), |c| c.str())?;
    let number = at.find("semantic_label").map_or(Ok(NO_LABEL), |c| c.u32())?;
    let from_table = label_names.and_then(|names| names.get(&number)).map(String::as_str);
    let from_name = (!name.is_empty() && !is_symbol(name)).then(|| without_number(name));
    let label = match from_table.or(from_name).map(str::trim).filter(|label| !label.is_empty()) {
        Some(label) => label.to_lowercase(),
        None if number == NO_LABEL => "unknown".to_owned(),
        None => format!("label {number}"),
    };
    let mut object = Object::new(id, &label, bounds);
    object.metadata = metadata(at);
    if let Some(caption) = object.metadata.get("caption").and_then(Value::as_str) {
        object.caption = caption.to_owned();
    }
    object.color = at.find("color").map(|c| color(&c)).transpose()?;
    // Their colours come from a label table, not from a camera: kept, but not made into a word.
    object.attributes = crate::attributes::attributes_of(&object.caption, None);
    let updated = at.find("last_update_time_ns").map_or(Ok(0), |c| c.u64())?;
    object.last_seen_ns = i64::try_from(updated).unwrap_or(i64::MAX);
    object.first_seen_ns = object.last_seen_ns;
    (object.presence, object.trajectory) = history(at)?;
    if let (Some(first), Some(last)) = (object.presence.first(), object.presence.last()) {
        object.first_seen_ns = object.first_seen_ns.min(first.first_ns);
        object.last_seen_ns = object.last_seen_ns.max(last.last_ns);
    }
    Ok(object)
}

/// Khronos: when a thing was observed, and where it went. What makes no sense is no history.
fn history(at: &Cursor) -> Result<(Vec<Presence>, Vec<TrackPoint>), LoadError> {
    let stamps = |name| -> Result<Vec<i64>, LoadError> {
        let Some(list) = at.find(name) else { return Ok(Vec::new()) };
        list.items()?.map(|stamp| stamp.u64().map(|ns| i64::try_from(ns).unwrap_or(i64::MAX))).collect()
    };
    let (first, last) = (stamps("first_observed_ns")?, stamps("last_observed_ns")?);
    let pairs = first.iter().zip(&last);
    let mut presence: Vec<Presence> = pairs.map(|(&first_ns, &last_ns)| Presence { first_ns, last_ns }).collect();
    let times = stamps("trajectory_timestamps")?;
    let mut trajectory = Vec::new();
    if let Some(list) = at.find("trajectory_positions") {
        for (item, stamp_ns) in list.items()?.zip(&times) {
            trajectory.push(TrackPoint { stamp_ns: *stamp_ns, position: item.point()? });
        }
    }
    if !presence::is_sound(&presence, &[]) || first.len() != last.len() {
        presence.clear();
    }
    if !presence::is_sound(&[], &trajectory) {
        trajectory.clear();
    }
    Ok((presence, trajectory))
}

/// What we write for an object. `semantic_label` is its label, a word; the writer puts a number in its place.
pub(crate) fn object_attributes(object: &Object) -> Map<String, Value> {
    let mut attributes = map(json!({
        "type": "ObjectNodeAttributes",
        "position": point(&object.centroid),
        "name": object.label,
        "semantic_label": object.label,
        "bounding_box": aligned_box(&object.bounds),
        "last_update_time_ns": object.last_seen_ns.max(0),
        "metadata": object.metadata,
    }));
    if let Some([r, g, b]) = object.color {
        attributes.insert("color".into(), json!({ "r": r, "g": g, "b": b, "a": 255 }));
    }
    if !(object.presence.is_empty() && object.trajectory.is_empty()) {
        let stretches = object.presence();
        let single = |x: f64| f64::from(x as f32);
        let positions =
            object.trajectory.iter().map(|p| json!([single(p.position.x), single(p.position.y), single(p.position.z)]));
        let history = json!({
            "type": "KhronosObjectAttributes",
            "first_observed_ns": stretches.iter().map(|p| p.first_ns.max(0)).collect::<Vec<_>>(),
            "last_observed_ns": stretches.iter().map(|p| p.last_ns.max(0)).collect::<Vec<_>>(),
            "trajectory_positions": positions.collect::<Vec<_>>(),
            "trajectory_timestamps": object.trajectory.iter().map(|p| p.stamp_ns.max(0)).collect::<Vec<_>>(),
            // Their reader wants the two although they may be empty.
            "dynamic_object_points": [],
            "mesh": empty_mesh(),
        });
        attributes.extend(map(history));
    }
    attributes
}

/// A mesh without vertices, as theirs is written.
pub(crate) fn empty_mesh() -> Value {
    json!({
        "header": { "project_name": "main", "version": { "major": 1, "minor": 1, "patch": 3 } },
        "has_colors": true, "has_timestamps": false, "has_labels": false, "has_first_seen_stamps": false,
    })
}

fn aligned_box(bounds: &Aabb) -> Value {
    let single = |x: f64| f64::from(x as f32);
    let (sides, center) = (bounds.sides_m(), bounds.center());
    json!({
        "type": "AABB",
        "dimensions": [single(sides.x), single(sides.y), single(sides.z)],
        "world_P_center": [single(center.x), single(center.y), single(center.z)],
        "world_R_center": { "w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0 },
    })
}

// The other layers

pub(crate) fn position(at: &Cursor) -> Result<Point3<f64>, LoadError> {
    at.find("position").map_or(Ok(Point3::origin()), |c| c.point())
}

pub(crate) fn place(id: PlaceId, at: &Cursor) -> Result<Place, LoadError> {
    let is_frontier = at.find("active_frontier").map_or(Ok(false), |c| c.bool())?;
    let cells = at.find("num_frontier_voxels").map_or(Ok(0), |c| c.u32())?;
    Ok(Place {
        id,
        position: position(at)?,
        clearance_m: at.find("distance").map_or(Ok(0.0), |c| c.f64())?.max(0.0),
        basis_points: at.find("num_basis_points").map_or(Ok(0), |c| c.u32())?.min(255) as u8,
        frontier_cells: if is_frontier { cells.max(1) } else { 0 },
        room: None,
    })
}

/// What we write for a place.
pub(crate) fn place_attributes(place: &Place) -> Map<String, Value> {
    let mut attributes = map(json!({
        "type": "PlaceNodeAttributes",
        "position": point(&place.position),
        "distance": place.clearance_m,
        "num_basis_points": place.basis_points,
    }));
    if place.is_frontier() {
        attributes.insert("active_frontier".into(), Value::Bool(true));
        attributes.insert("num_frontier_voxels".into(), json!(place.frontier_cells));
    }
    attributes
}

pub(crate) fn room(id: RoomId, at: &Cursor) -> Result<Room, LoadError> {
    let mut room = Room::new(id, position(at)?);
    let sides = bounds(at, &room.center)?.sides_m();
    room.area_m2 = sides.x * sides.y;
    room.metadata = metadata(at);
    if let Some(probabilities) = at.find("semantic_class_probabilities") {
        let mut best: Option<(&str, f64)> = None;
        for (kind, probability) in probabilities.map()? {
            let probability = probability.as_f64().ok_or_else(|| probabilities.wrong("a map of numbers"))?;
            if best.is_none_or(|(_, known)| probability > known) {
                best = Some((kind, probability));
            }
        }
        if let Some((kind, probability)) = best.filter(|(kind, _)| !kind.trim().is_empty()) {
            room.kind = Some(kind.trim().to_lowercase());
            room.kind_confidence = probability.clamp(0.0, 1.0);
        }
    }
    let name = at.find("name").map_or(Ok(""), |c| c.str())?.trim();
    if !name.is_empty() && !is_symbol(name) {
        room.name = name.to_owned();
        // Somebody named it.
        room.is_user_named = true;
    }
    Ok(room)
}

/// What we write for a room.
pub(crate) fn room_attributes(room: &Room) -> Map<String, Value> {
    let mut attributes = map(json!({
        "type": "RoomNodeAttributes",
        "position": point(&room.center),
        "name": room.name,
        "metadata": room.metadata,
    }));
    if let Some(kind) = &room.kind {
        let probabilities = Map::from_iter([(kind.clone(), json!(room.kind_confidence))]);
        attributes.insert("semantic_class_probabilities".into(), Value::Object(probabilities));
    }
    attributes
}

pub(crate) fn building(id: BuildingId, at: &Cursor) -> Result<Building, LoadError> {
    let name = at.find("name").map_or(Ok(""), |c| c.str())?;
    let name = if name.is_empty() || is_symbol(name) { "building" } else { name }.to_owned();
    Ok(Building { id, name, center: position(at)?, rooms: Vec::new(), storeys: Vec::new() })
}

/// What we write for a building.
pub(crate) fn building_attributes(building: &Building) -> Map<String, Value> {
    let (name, position) = (&building.name, point(&building.center));
    map(json!({ "type": "SemanticNodeAttributes", "position": position, "name": name }))
}

pub(crate) fn group(id: GroupId, at: &Cursor) -> Result<Group, LoadError> {
    let name = at.find("name").map_or(Ok(""), |c| c.str())?;
    let name = if name.trim().is_empty() { format!("group {}", id.0) } else { name.to_owned() };
    Ok(Group { id, name, support: None, members: Vec::new(), room: None, center: position(at)? })
}

/// What we write for a functional group: a node of a layer of its own.
pub(crate) fn group_attributes(group: &Group) -> Map<String, Value> {
    let (name, position) = (&group.name, point(&group.center));
    map(json!({ "type": "SemanticNodeAttributes", "position": position, "name": name }))
}

/// A pose of a robot. `beside` is the node: up to 1.0.x the stamp stands there.
pub(crate) fn pose(at: &Cursor, beside: &Cursor) -> Result<AgentPose, LoadError> {
    let stamp = at.find("timestamp").or_else(|| beside.find("timestamp"));
    let stamp_ns = stamp.map_or(Ok(0), |c| c.i64())?;
    let rotation = at.find("world_R_body").map_or(Ok(UnitQuaternion::identity()), |c| c.quaternion())?;
    let world_from_body = Isometry3::from_parts(position(at)?.coords.into(), rotation);
    Ok(AgentPose { stamp_ns, world_from_body })
}

/// What we write for a pose; `spark_id` is that of its node.
pub(crate) fn pose_attributes(pose: &AgentPose, spark_id: u64) -> Map<String, Value> {
    let Isometry3 { rotation: turn, translation } = &pose.world_from_body;
    map(json!({
        "type": "AgentNodeAttributes",
        "position": [translation.x, translation.y, translation.z],
        "timestamp": pose.stamp_ns,
        "world_R_body": rotation(turn),
        "external_key": spark_id,
        "dbow_ids": null,
        "dbow_values": null,
    }))
}

/// What an edge without attributes of its own says.
pub(crate) fn plain_info() -> Map<String, Value> {
    Map::from_iter([("type".to_owned(), json!("EdgeAttributes"))])
}

/// What we write on an edge between places.
pub(crate) fn place_edge_info(edge: &PlaceEdge) -> Map<String, Value> {
    let mut info = plain_info();
    info.insert("weighted".into(), Value::Bool(true));
    info.insert("weight".into(), json!(edge.clearance_m));
    info
}

/// The axis-aligned box around theirs. 1.0.0 stores corners, later versions side lengths.
pub(crate) fn bounds(at: &Cursor, position: &Point3<f64>) -> Result<Aabb, LoadError> {
    let Some(theirs) = at.find("bounding_box") else {
        return Ok(Aabb::at(*position));
    };
    let is_invalid = theirs.find("type").map_or(Ok(false), |c| c.str().map(|t| t == "INVALID"))?;
    if is_invalid {
        return Ok(Aabb::at(*position));
    }
    let sides: Vector3<f64> = match theirs.find("dimensions") {
        Some(dimensions) => dimensions.point()?.coords,
        None => theirs.get("max")?.point()? - theirs.get("min")?.point()?,
    };
    if sides.iter().any(|side| *side < 0.0) {
        return Err(theirs.wrong("a box"));
    }
    let center = theirs.find("world_P_center").map_or(Ok(*position), |c| c.point())?;
    let is_aligned = theirs.find("type").map_or(Ok(true), |c| c.str().map(|t| t == "AABB"))?;
    let rotation = match theirs.find("world_R_center") {
        Some(rotation) if !is_aligned => rotation.quaternion()?,
        _ => UnitQuaternion::identity(),
    };
    let own = Aabb::from_center(Point3::origin(), sides);
    Ok(own.transformed(&Isometry3::from_parts(center.coords.into(), rotation)))
}

/// `{"r", "g", "b", "a"}`, or a list up to 1.0.2.
pub(crate) fn color(at: &Cursor) -> Result<[u8; 3], LoadError> {
    if at.value.is_object() {
        return Ok([at.get("r")?.u8()?, at.get("g")?.u8()?, at.get("b")?.u8()?]);
    }
    let channels: Vec<Cursor> = at.items()?.take(4).collect();
    match channels.as_slice() {
        [r, g, b, ..] => Ok([r.u8()?, g.u8()?, b.u8()?]),
        _ => Err(at.wrong("a colour")),
    }
}

/// Whether a name is only a node symbol: "O(12)".
pub(crate) fn is_symbol(name: &str) -> bool {
    let mut chars = name.trim().chars();
    let letter = chars.next().is_some_and(|c| c.is_ascii_alphabetic());
    let index = chars.as_str().strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
    letter && index.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()))
}

/// "chair_0" is a chair.
pub(crate) fn without_number(name: &str) -> &str {
    let name = name.trim();
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    match stem.strip_suffix(['_', ' ', '-']) {
        Some(stem) if stem.len() < name.len() && !stem.is_empty() => stem,
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_labels() {
        assert_eq!(without_number("chair_0"), "chair");
        assert_eq!(without_number("office chair 12"), "office chair");
        assert_eq!(without_number("chair"), "chair");
        assert_eq!(without_number("12"), "12");
        assert_eq!(without_number("box2"), "box2");
        assert!(is_symbol("O(12)"));
        assert!(!is_symbol("chair"));
    }
}
