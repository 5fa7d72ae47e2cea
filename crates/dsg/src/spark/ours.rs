//! What only we know, in the open metadata of their nodes, edges and graph: written under `omni_dsg`, read again as far as theirs
//! still says the same.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use crate::graph::{NextIds, SceneGraph};
use crate::ids::RoomId;
use crate::load::{Cursor, LoadError};
use crate::object::Object;
use crate::records;
use crate::relation::{Relation, Verdict};
use crate::room::{Room, RoomEdge};
use crate::spark::attributes;
use crate::spark::kept::{KEPT, OURS, is_same, kept_of_document};
use crate::spark::names::{partitions, usual_name};

// Nodes and edges

/// Their attributes without what is ours in the metadata.
pub(super) fn without_ours(theirs: &Map<String, Value>) -> Map<String, Value> {
    let mut theirs = theirs.clone();
    if let Some(Value::Object(metadata)) = theirs.get_mut("metadata") {
        metadata.remove(OURS);
    }
    theirs
}

/// The object that we wrote, as far as theirs still says the same.
pub(super) fn object_of_ours(ours: &Cursor, plain: Object, theirs: &Map<String, Value>) -> Result<Object, LoadError> {
    let ours = records::object(ours)?;
    let written = attributes::object_attributes(&ours);
    let still = |field: &str| match (written.get(field), theirs.get(field)) {
        (Some(a), Some(b)) => is_same(a, b),
        (a, b) => a.is_none() && b.is_none_or(|b| is_same(b, &json!({ "r": 0, "g": 0, "b": 0, "a": 255 }))),
    };
    let mut object = Object { id: plain.id, metadata: plain.metadata, place: None, group: None, ..ours };
    if !(still("position") && still("bounding_box")) {
        (object.bounds, object.centroid) = (plain.bounds, plain.centroid);
    }
    if !still("name") {
        object.label = plain.label;
    }
    if !still("color") {
        object.color = plain.color;
    }
    Ok(object)
}

/// The room that we wrote, as far as theirs still says the same.
pub(super) fn room_of_ours(ours: &Cursor, plain: Room, theirs: &Map<String, Value>) -> Result<Room, LoadError> {
    let ours = records::room(ours)?;
    let written = attributes::room_attributes(&ours);
    let still = |field: &str| written.get(field).zip(theirs.get(field)).is_some_and(|(a, b)| is_same(a, b));
    let mut room = Room { id: plain.id, metadata: plain.metadata, places: Vec::new(), ..ours };
    if !still("position") {
        room.center = plain.center;
    }
    if !still("name") {
        (room.name, room.is_user_named) = (plain.name, plain.is_user_named);
    }
    Ok(room)
}

/// The way between two rooms that we wrote.
pub(super) fn room_edge_of_ours(ours: &Cursor, a: RoomId, b: RoomId) -> Result<RoomEdge, LoadError> {
    Ok(RoomEdge { a: a.min(b), b: a.max(b), ..records::room_edge(ours)? })
}

/// Puts what only we know into their open metadata.
pub(super) fn add_ours(attributes: &mut Map<String, Value>, ours: Map<String, Value>) {
    let metadata = attributes.entry("metadata").or_insert_with(|| json!({}));
    if !metadata.is_object() {
        *metadata = json!({});
    }
    metadata[OURS] = Value::Object(ours);
}

/// A record without some of its fields.
pub(super) fn without(mut record: Map<String, Value>, fields: &[&str]) -> Map<String, Value> {
    record.retain(|field, _| !fields.contains(&field.as_str()));
    record
}

// The document

/// What we write beside the nodes, into the metadata of their graph.
#[derive(Debug, Default)]
pub(super) struct Beside {
    pub revision: u64,
    pub next: Option<NextIds>,
    /// By partition: id and name.
    pub agents: BTreeMap<u32, (u64, String)>,
    pub dropped_relations: Vec<Relation>,
    /// Numbers that we gave to labels.
    pub labels: BTreeMap<String, u64>,
}

impl Beside {
    pub fn read(at: &Cursor, graph: &mut SceneGraph) -> Result<Beside, LoadError> {
        let mut beside = Beside { revision: at.find("revision").map_or(Ok(0), |c| c.u64())?, ..Beside::default() };
        beside.next = at.find("next_ids").map(|c| crate::file::next_ids(&c)).transpose()?;
        for agent in at.find("agents").as_ref().map(|c| c.items()).transpose()?.into_iter().flatten() {
            let entry = (agent.get("id")?.u64()?, agent.get("name")?.str()?.to_owned());
            beside.agents.insert(agent.get("partition")?.u32()?, entry);
        }
        for relation in at.find("dropped_relations").as_ref().map(|c| c.items()).transpose()?.into_iter().flatten() {
            beside.dropped_relations.push(records::relation(&relation)?);
        }
        for (label, number) in at.find("labels").as_ref().map(|c| c.map()).transpose()?.into_iter().flatten() {
            beside.labels.extend(number.as_u64().map(|number| (label.clone(), number)));
        }
        if let Some(unknown) = at.find("unknown_fields") {
            for (key, fields) in unknown.map()? {
                let fields = fields.as_object().into_iter().flatten().filter(|(field, _)| *field != KEPT);
                let fields: Map<String, Value> = fields.map(|(field, value)| (field.clone(), value.clone())).collect();
                graph.unknown_fields.entry(key.clone()).or_default().extend(fields);
            }
        }
        Ok(beside)
    }
}

/// The graph's metadata, with what their document has no other place for.
pub(super) fn metadata(graph: &SceneGraph, own_labels: &BTreeMap<String, u32>) -> Value {
    let mut ours = Map::new();
    if graph.revision > 0 {
        ours.insert("revision".into(), json!(graph.revision));
    }
    let next = graph.next;
    if next != derived_ids(graph) {
        ours.insert("next_ids".into(), json!({ "object": next.object, "room": next.room, "group": next.group }));
    }
    let mut agents = Vec::new();
    for (id, partition) in partitions(graph) {
        let agent = &graph.agents[&id];
        if id.0 != u64::from(partition) || agent.name != usual_name(partition) || agent.trajectory.is_empty() {
            agents.push(json!({ "partition": partition, "id": id, "name": agent.name }));
        }
    }
    if !agents.is_empty() {
        ours.insert("agents".into(), Value::Array(agents));
    }
    let is_dropped = |verdict: &Verdict| !matches!(verdict, Verdict::Holds);
    let dropped = graph.relations.values().filter(|relation| is_dropped(&relation.evidence.verdict));
    let dropped: Vec<Value> = dropped.map(|relation| Value::Object(records::from_relation(relation))).collect();
    if !dropped.is_empty() {
        ours.insert("dropped_relations".into(), Value::Array(dropped));
    }
    if !own_labels.is_empty() {
        ours.insert("labels".into(), json!(own_labels));
    }
    // Fields of newer versions of our format.
    let mut unknown = Map::new();
    for (key, fields) in &graph.unknown_fields {
        let fields = without(fields.clone(), &[KEPT]);
        if !fields.is_empty() {
            unknown.insert(key.clone(), Value::Object(fields));
        }
    }
    if !unknown.is_empty() {
        ours.insert("unknown_fields".into(), Value::Object(unknown));
    }
    if ours.is_empty()
        && graph.metadata.is_empty()
        && let Some(theirs) = kept_of_document(graph, "metadata")
    {
        return theirs.clone();
    }
    let mut metadata = graph.metadata.clone();
    if !ours.is_empty() {
        metadata.insert(OURS.into(), Value::Object(ours));
    }
    Value::Object(metadata)
}

/// The next ids of a graph of which nothing was ever removed.
fn derived_ids(graph: &SceneGraph) -> NextIds {
    let after = |last: Option<u64>| last.map_or(1, |last| last.saturating_add(1)).max(1);
    NextIds {
        object: after(graph.objects.keys().next_back().map(|id| id.0)),
        room: after(graph.rooms.keys().next_back().map(|id| id.0)),
        group: after(graph.groups.keys().next_back().map(|id| id.0)),
    }
}
