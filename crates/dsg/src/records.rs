//! Nodes and edges as JSON records and back. Used by graph.json and ops.log.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::agent::{Agent, AgentPose};
use crate::bounds::Aabb;
use crate::group::Group;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::load::{Cursor, LoadError};
use crate::memory::{Cell, ObjectMemory};
use crate::object::Object;
use crate::place::{Place, PlaceEdge};
use crate::presence::{Presence, TrackPoint};
use crate::relation::{Evidence, EvidenceSource, Relation, RelationKind, Verdict};
use crate::room::{Building, Room, RoomEdge, Storey};

/// A record without its null fields.
fn record(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map.into_iter().filter(|(_, value)| !value.is_null()).collect(),
        _ => Map::new(),
    }
}

fn point(p: &Point3<f64>) -> Value {
    json!([p.x, p.y, p.z])
}

/// Fields of an object record.
#[rustfmt::skip]
pub(crate) const OBJECT: &[&str] = &[
    "id", "label", "label_margin", "votes", "caption", "color", "attributes", "centroid", "min", "max", "room", "place",
    "group", "first_seen_ns", "last_seen_ns", "presence", "trajectory", "observations", "confirmed", "metadata",
];

pub(crate) fn from_object(object: &Object) -> Map<String, Value> {
    let stretch = |p: &Presence| json!([p.first_ns, p.last_ns]);
    let stretches = || object.presence.iter().map(stretch).collect::<Vec<_>>();
    let track_point = |p: &TrackPoint| json!([p.stamp_ns, p.position.x, p.position.y, p.position.z]);
    let trajectory = || object.trajectory.iter().map(track_point).collect::<Vec<_>>();
    record(json!({
        "id": object.id,
        "label": object.label,
        "label_margin": object.label_margin,
        "votes": object.votes,
        "caption": object.caption,
        "color": object.color,
        "attributes": object.attributes,
        "centroid": point(&object.centroid),
        "min": point(&object.bounds.min),
        "max": point(&object.bounds.max),
        "room": object.room,
        "place": object.place,
        "group": object.group,
        "first_seen_ns": object.first_seen_ns,
        "last_seen_ns": object.last_seen_ns,
        "presence": (!object.presence.is_empty()).then(stretches),
        "trajectory": (!object.trajectory.is_empty()).then(trajectory),
        "observations": object.observations,
        "confirmed": object.confirmed,
        "metadata": object.metadata,
    }))
}

pub(crate) fn object(at: &Cursor) -> Result<Object, LoadError> {
    let mut votes = BTreeMap::new();
    if let Some(found) = at.find("votes") {
        for (label, value) in found.map()? {
            let value = value.as_f64().ok_or_else(|| found.wrong("a map of numbers"))?;
            votes.insert(label.clone(), value);
        }
    }
    let mut attributes = BTreeMap::new();
    if let Some(found) = at.find("attributes") {
        for (key, value) in found.map()? {
            let value = value.as_str().ok_or_else(|| found.wrong("a map of strings"))?;
            attributes.insert(key.clone(), value.to_owned());
        }
    }
    let mut presence = Vec::new();
    if let Some(list) = at.find("presence") {
        for item in list.items()? {
            let parts: Vec<Cursor> = item.items()?.collect();
            let [first, last] = parts.as_slice() else {
                return Err(item.wrong("a first and a last stamp"));
            };
            presence.push(Presence { first_ns: first.i64()?, last_ns: last.i64()? });
        }
    }
    let mut trajectory = Vec::new();
    if let Some(list) = at.find("trajectory") {
        for item in list.items()? {
            let parts: Vec<Cursor> = item.items()?.collect();
            let [stamp, x, y, z] = parts.as_slice() else {
                return Err(item.wrong("a stamp and three coordinates"));
            };
            let position = Point3::new(x.f64()?, y.f64()?, z.f64()?);
            trajectory.push(TrackPoint { stamp_ns: stamp.i64()?, position });
        }
    }
    let bounds = Aabb { min: at.get("min")?.point()?, max: at.get("max")?.point()? };
    Ok(Object {
        id: ObjectId(at.get("id")?.u64()?),
        label: at.get("label")?.str()?.to_owned(),
        label_margin: at.find("label_margin").map_or(Ok(1.0), |c| c.f64())?,
        votes,
        caption: text(at, "caption")?,
        color: at.find("color").map(|c| color(&c)).transpose()?,
        attributes,
        centroid: at.find("centroid").map_or(Ok(bounds.center()), |c| c.point())?,
        bounds,
        room: at.find("room").map(|c| c.u64().map(RoomId)).transpose()?,
        place: at.find("place").map(|c| c.u64().map(PlaceId)).transpose()?,
        group: at.find("group").map(|c| c.u64().map(GroupId)).transpose()?,
        first_seen_ns: at.find("first_seen_ns").map_or(Ok(0), |c| c.i64())?,
        last_seen_ns: at.find("last_seen_ns").map_or(Ok(0), |c| c.i64())?,
        presence,
        trajectory,
        observations: at.find("observations").map_or(Ok(1), |c| c.u32())?,
        confirmed: at.find("confirmed").map_or(Ok(true), |c| c.bool())?,
        metadata: metadata(at)?,
    })
}

fn text(at: &Cursor, key: &'static str) -> Result<String, LoadError> {
    at.find(key).map_or(Ok(String::new()), |c| c.str().map(str::to_owned))
}

fn color(at: &Cursor) -> Result<[u8; 3], LoadError> {
    let numbers = at.numbers::<3>()?;
    let is_byte = |x: &f64| (0.0..=255.0).contains(x) && x.fract() == 0.0;
    if numbers.iter().all(is_byte) { Ok(numbers.map(|x| x as u8)) } else { Err(at.wrong("three bytes")) }
}

pub(crate) fn metadata(at: &Cursor) -> Result<Map<String, Value>, LoadError> {
    at.find("metadata").map_or(Ok(Map::new()), |c| c.map().cloned())
}

/// Fields of a place record.
pub(crate) const PLACE: &[&str] = &["id", "position", "clearance_m", "basis_points", "frontier_cells", "room"];

/// A place as it stands in the file.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaceRecord {
    id: PlaceId,
    position: [f64; 3],
    clearance_m: f64,
    #[serde(default)]
    basis_points: u8,
    #[serde(default)]
    frontier_cells: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    room: Option<RoomId>,
}

impl From<&Place> for PlaceRecord {
    fn from(place: &Place) -> PlaceRecord {
        let &Place { id, position, clearance_m, basis_points, frontier_cells, room } = place;
        PlaceRecord { id, position: position.into(), clearance_m, basis_points, frontier_cells, room }
    }
}

impl From<PlaceRecord> for Place {
    fn from(record: PlaceRecord) -> Place {
        let PlaceRecord { id, position, clearance_m, basis_points, frontier_cells, room } = record;
        Place { id, position: position.into(), clearance_m, basis_points, frontier_cells, room }
    }
}

pub(crate) fn from_place(place: &Place) -> Map<String, Value> {
    record(json!(PlaceRecord::from(place)))
}

pub(crate) fn place(at: &Cursor) -> Result<Place, LoadError> {
    Ok(Place {
        id: PlaceId(at.get("id")?.u64()?),
        position: at.get("position")?.point()?,
        clearance_m: at.get("clearance_m")?.f64()?,
        basis_points: at.find("basis_points").map_or(Ok(0), |c| c.u8())?,
        frontier_cells: at.find("frontier_cells").map_or(Ok(0), |c| c.u32())?,
        room: at.find("room").map(|c| c.u64().map(RoomId)).transpose()?,
    })
}

/// Fields of a place edge record.
pub(crate) const PLACE_EDGE: &[&str] = &["a", "b", "clearance_m"];

/// A place edge as it stands in the file.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaceEdgeRecord {
    a: PlaceId,
    b: PlaceId,
    clearance_m: f64,
}

impl From<&PlaceEdge> for PlaceEdgeRecord {
    fn from(edge: &PlaceEdge) -> PlaceEdgeRecord {
        PlaceEdgeRecord { a: edge.a, b: edge.b, clearance_m: edge.clearance_m }
    }
}

impl From<PlaceEdgeRecord> for PlaceEdge {
    fn from(record: PlaceEdgeRecord) -> PlaceEdge {
        let PlaceEdgeRecord { a, b, clearance_m } = record;
        PlaceEdge { a: a.min(b), b: a.max(b), clearance_m }
    }
}

pub(crate) fn from_place_edge(edge: &PlaceEdge) -> Map<String, Value> {
    record(json!(PlaceEdgeRecord::from(edge)))
}

pub(crate) fn place_edge(at: &Cursor) -> Result<PlaceEdge, LoadError> {
    let (a, b) = (at.get("a")?.u64()?, at.get("b")?.u64()?);
    Ok(PlaceEdge { a: PlaceId(a.min(b)), b: PlaceId(a.max(b)), clearance_m: at.get("clearance_m")?.f64()? })
}

/// Fields of a room record.
#[rustfmt::skip]
pub(crate) const ROOM: &[&str] = &[
    "id", "name", "is_user_named", "kind", "kind_confidence", "center", "places", "area_m2", "floor", "metadata",
];

pub(crate) fn from_room(room: &Room) -> Map<String, Value> {
    record(json!({
        "id": room.id,
        "name": room.name,
        "is_user_named": room.is_user_named,
        "kind": room.kind,
        "kind_confidence": room.kind_confidence,
        "center": point(&room.center),
        "places": room.places,
        "area_m2": room.area_m2,
        "floor": room.floor,
        "metadata": room.metadata,
    }))
}

pub(crate) fn room(at: &Cursor) -> Result<Room, LoadError> {
    let places = ids(at, "places")?.into_iter().map(PlaceId).collect();
    let id = RoomId(at.get("id")?.u64()?);
    Ok(Room {
        id,
        name: at.find("name").map_or(Ok(format!("room {}", id.0)), |c| c.str().map(str::to_owned))?,
        is_user_named: at.find("is_user_named").map_or(Ok(false), |c| c.bool())?,
        kind: at.find("kind").map(|c| c.str().map(str::to_owned)).transpose()?,
        kind_confidence: at.find("kind_confidence").map_or(Ok(0.0), |c| c.f64())?,
        center: at.get("center")?.point()?,
        places,
        area_m2: at.find("area_m2").map_or(Ok(0.0), |c| c.f64())?,
        floor: at.find("floor").map_or(Ok(0), |c| c.i32())?,
        metadata: metadata(at)?,
    })
}

fn ids(at: &Cursor, key: &'static str) -> Result<Vec<u64>, LoadError> {
    match at.find(key) {
        Some(list) => list.items()?.map(|item| item.u64()).collect(),
        None => Ok(Vec::new()),
    }
}

/// Fields of a room edge record.
pub(crate) const ROOM_EDGE: &[&str] = &["a", "b", "doorway", "width_m"];

pub(crate) fn from_room_edge(edge: &RoomEdge) -> Map<String, Value> {
    record(json!({ "a": edge.a, "b": edge.b, "doorway": point(&edge.doorway), "width_m": edge.width_m }))
}

pub(crate) fn room_edge(at: &Cursor) -> Result<RoomEdge, LoadError> {
    let (a, b) = (at.get("a")?.u64()?, at.get("b")?.u64()?);
    Ok(RoomEdge {
        a: RoomId(a.min(b)),
        b: RoomId(a.max(b)),
        doorway: at.get("doorway")?.point()?,
        width_m: at.find("width_m").map_or(Ok(0.0), |c| c.f64())?,
    })
}

/// Fields of a building record.
pub(crate) const BUILDING: &[&str] = &["id", "name", "center", "rooms", "storeys"];

pub(crate) fn from_building(building: &Building) -> Map<String, Value> {
    let storey = |s: &Storey| json!({ "floor": s.floor, "height_m": s.height_m, "rooms": s.rooms });
    record(json!({
        "id": building.id,
        "name": building.name,
        "center": point(&building.center),
        "rooms": building.rooms,
        "storeys": building.storeys.iter().map(storey).collect::<Vec<_>>(),
    }))
}

pub(crate) fn building(at: &Cursor) -> Result<Building, LoadError> {
    let mut storeys = Vec::new();
    if let Some(list) = at.find("storeys") {
        for item in list.items()? {
            storeys.push(Storey {
                floor: item.get("floor")?.i32()?,
                height_m: item.get("height_m")?.f64()?,
                rooms: item.get("rooms")?.u32()?,
            });
        }
    }
    Ok(Building {
        id: BuildingId(at.get("id")?.u64()?),
        name: text(at, "name")?,
        center: at.get("center")?.point()?,
        rooms: ids(at, "rooms")?.into_iter().map(RoomId).collect(),
        storeys,
    })
}

/// Fields of a group record.
pub(crate) const GROUP: &[&str] = &["id", "name", "support", "members", "room", "center"];

pub(crate) fn from_group(group: &Group) -> Map<String, Value> {
    record(json!({
        "id": group.id,
        "name": group.name,
        "support": group.support,
        "members": group.members,
        "room": group.room,
        "center": point(&group.center),
    }))
}

pub(crate) fn group(at: &Cursor) -> Result<Group, LoadError> {
    Ok(Group {
        id: GroupId(at.get("id")?.u64()?),
        name: at.get("name")?.str()?.to_owned(),
        support: at.find("support").map(|c| c.u64().map(ObjectId)).transpose()?,
        members: ids(at, "members")?.into_iter().map(ObjectId).collect(),
        room: at.find("room").map(|c| c.u64().map(RoomId)).transpose()?,
        center: at.get("center")?.point()?,
    })
}

/// Fields of a relation record.
#[rustfmt::skip]
pub(crate) const RELATION: &[&str] = &[
    "subject", "kind", "object", "other", "verdict", "blocked_at", "source", "distance_m", "score",
];

pub(crate) fn from_relation(relation: &Relation) -> Map<String, Value> {
    let (verdict, blocked_at) = match &relation.evidence.verdict {
        Verdict::Holds => ("holds", Value::Null),
        Verdict::Blocked(at) => ("blocked", point(at)),
        Verdict::Rejected => ("rejected", Value::Null),
    };
    let source = match relation.evidence.source {
        EvidenceSource::Geometry => "geometry",
        EvidenceSource::Verifier => "verifier",
        EvidenceSource::Stated => "stated",
    };
    record(json!({
        "subject": relation.subject,
        "kind": relation.kind.word(),
        "object": relation.object,
        "other": relation.other,
        "verdict": verdict,
        "blocked_at": blocked_at,
        "source": source,
        "distance_m": relation.evidence.distance_m,
        "score": relation.evidence.score,
    }))
}

pub(crate) fn relation(at: &Cursor) -> Result<Relation, LoadError> {
    let kind = at.get("kind")?;
    let unknown = |c: &Cursor| LoadError::UnknownType { path: c.path() };
    let verdict = match at.find("verdict") {
        None => Verdict::Holds,
        Some(c) => match c.str()? {
            "holds" => Verdict::Holds,
            "blocked" => Verdict::Blocked(at.get("blocked_at")?.point()?),
            "rejected" => Verdict::Rejected,
            _ => return Err(unknown(&c)),
        },
    };
    let source = match at.find("source") {
        None => EvidenceSource::Stated,
        Some(c) => match c.str()? {
            "geometry" => EvidenceSource::Geometry,
            "verifier" => EvidenceSource::Verifier,
            "stated" => EvidenceSource::Stated,
            _ => return Err(unknown(&c)),
        },
    };
    Ok(Relation {
        subject: ObjectId(at.get("subject")?.u64()?),
        kind: RelationKind::from_word(kind.str()?).ok_or_else(|| unknown(&kind))?,
        object: ObjectId(at.get("object")?.u64()?),
        other: at.find("other").map(|c| c.u64().map(ObjectId)).transpose()?,
        evidence: Evidence {
            verdict,
            source,
            distance_m: at.find("distance_m").map_or(Ok(0.0), |c| c.f64())?,
            score: at.find("score").map_or(Ok(1.0), |c| c.f64())?,
        },
    })
}

/// Fields of an agent record.
pub(crate) const AGENT: &[&str] = &["id", "name", "trajectory"];

pub(crate) fn from_agent(agent: &Agent) -> Map<String, Value> {
    let trajectory: Vec<Value> = agent.trajectory.iter().map(from_agent_pose).collect();
    record(json!({ "id": agent.id, "name": agent.name, "trajectory": trajectory }))
}

pub(crate) fn from_agent_pose(pose: &AgentPose) -> Value {
    let Isometry3 { rotation, translation } = pose.world_from_body;
    json!({
        "stamp_ns": pose.stamp_ns,
        "position": [translation.x, translation.y, translation.z],
        "rotation": { "w": rotation.w, "x": rotation.i, "y": rotation.j, "z": rotation.k },
    })
}

pub(crate) fn agent(at: &Cursor) -> Result<Agent, LoadError> {
    let mut trajectory = Vec::new();
    if let Some(list) = at.find("trajectory") {
        for item in list.items()? {
            trajectory.push(agent_pose(&item)?);
        }
    }
    Ok(Agent { id: AgentId(at.get("id")?.u64()?), name: text(at, "name")?, trajectory })
}

pub(crate) fn agent_pose(at: &Cursor) -> Result<AgentPose, LoadError> {
    Ok(AgentPose { stamp_ns: at.get("stamp_ns")?.i64()?, world_from_body: at.pose()? })
}

/// The builder's memory of an object. Voxels are `[x, y, z, hits, last_seen_ns]`.
pub(crate) fn from_memory(id: ObjectId, memory: &ObjectMemory) -> Map<String, Value> {
    let cell = |c: &Cell| json!([c.mean.x, c.mean.y, c.mean.z, c.hits, c.last_seen_ns]);
    record(json!({
        "object": id,
        "voxel_m": memory.voxel_m,
        "cells": memory.cells.iter().map(cell).collect::<Vec<_>>(),
        "captions": memory.captions.iter().map(|(label, (score, caption))| json!([label, score, caption])).collect::<Vec<_>>(),
        "color_sum": memory.color_sum,
        "color_count": memory.color_count,
        "apart": memory.apart.iter().map(|(id, count)| json!([id, count])).collect::<Vec<_>>(),
        "looks": memory.looks,
        "looks_through": memory.looks_through,
    }))
}

pub(crate) fn memory(at: &Cursor) -> Result<(ObjectId, ObjectMemory), LoadError> {
    let mut memory = ObjectMemory { voxel_m: at.get("voxel_m")?.f64()?, ..ObjectMemory::default() };
    if !(memory.voxel_m > 1e-3 && memory.voxel_m < 1e6) {
        return Err(at.get("voxel_m")?.wrong("a length of 1 mm or more"));
    }
    for item in at.get("cells")?.items()? {
        let parts: Vec<Cursor> = item.items()?.collect();
        let [x, y, z, hits, stamp] = parts.as_slice() else {
            return Err(item.wrong("a voxel"));
        };
        let mean = Point3::new(x.f64()? as f32, y.f64()? as f32, z.f64()? as f32);
        if mean.iter().any(|x| x.abs() > 1e7) {
            return Err(item.wrong("a voxel"));
        }
        let hits = u16::try_from(hits.u64()?).map_err(|_| hits.wrong("a count"))?;
        let key = crate::memory::key_of(&mean, memory.voxel_m);
        memory.cells.push(Cell { key, mean, hits: hits.max(1), last_seen_ns: stamp.i64()? });
    }
    // A mean that has followed the evidence may have left its voxel; keys are made anew either way.
    memory.settle();
    if let Some(list) = at.find("captions") {
        for item in list.items()? {
            let parts: Vec<Cursor> = item.items()?.collect();
            let [label, score, caption] = parts.as_slice() else {
                return Err(item.wrong("a caption"));
            };
            memory.remember_caption(label.str()?, score.f64()? as f32, caption.str()?);
        }
    }
    if let Some(sum) = at.find("color_sum") {
        memory.color_sum = sum.numbers::<3>()?;
        memory.color_count = at.get("color_count")?.u32()?;
    }
    if let Some(list) = at.find("apart") {
        for item in list.items()? {
            let parts: Vec<Cursor> = item.items()?.collect();
            let [id, count] = parts.as_slice() else {
                return Err(item.wrong("an id and a count"));
            };
            memory.apart.insert(ObjectId(id.u64()?), count.u32()?);
        }
    }
    memory.looks = at.find("looks").map_or(Ok(0), |c| c.u32())?;
    memory.looks_through = at.find("looks_through").map_or(Ok(0), |c| c.u32())?;
    Ok((ObjectId(at.get("object")?.u64()?), memory))
}
