//! graph.json: the whole graph as one JSON document, schema "omni-dsg".
//!
//! Version 1.0. Ids are integers, exact to 64 bits. Fields that this version does not know, in the document or in any
//! record, are kept and written back; a newer major version is refused.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use crate::graph::{NextIds, SceneGraph};
use crate::load::{Cursor, LoadError, parse};
use crate::op::Op;
use crate::records;

/// Name of the format.
pub const SCHEMA: &str = "omni-dsg";
/// Major version written, and newest read.
pub const MAJOR: u64 = 1;
/// Minor version written.
pub const MINOR: u64 = 0;

/// Fields of the document.
#[rustfmt::skip]
const DOCUMENT: &[&str] = &[
    "schema", "version", "revision", "next_ids", "metadata", "mesh", "objects", "places", "place_edges", "rooms",
    "room_edges", "buildings", "groups", "relations", "agents", "memory",
];

/// The mesh that belongs to a graph file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeshReference {
    /// File name in the same folder.
    pub file: String,
    /// SHA-256 of its bytes, hex.
    pub sha256: String,
    /// Number of vertices.
    pub vertices: u64,
    /// Number of faces.
    pub faces: u64,
}

/// The graph as a JSON document, one record per line.
pub fn graph_to_json(graph: &SceneGraph) -> Vec<u8> {
    document(graph, None)
}

/// A graph from a JSON document. The log is empty and begins at the document's revision.
///
/// # Errors
/// Every fault of the text, a record or a reference, with its JSON path. Never a panic, whatever the bytes.
pub fn graph_from_json(bytes: &[u8]) -> Result<SceneGraph, LoadError> {
    read_document(bytes).map(|(graph, _)| graph)
}

pub(crate) fn document(graph: &SceneGraph, mesh: Option<&MeshReference>) -> Vec<u8> {
    let mut out = Vec::new();
    let mut head = Map::new();
    head.insert("schema".into(), json!(SCHEMA));
    head.insert("version".into(), json!({ "major": MAJOR, "minor": MINOR }));
    head.insert("revision".into(), json!(graph.revision));
    let next = graph.next;
    head.insert("next_ids".into(), json!({ "object": next.object, "room": next.room, "group": next.group }));
    head.insert("metadata".into(), Value::Object(graph.metadata.clone()));
    if let Some(mesh) = mesh {
        let record =
            json!({ "file": mesh.file, "sha256": mesh.sha256, "vertices": mesh.vertices, "faces": mesh.faces });
        head.insert("mesh".into(), record);
    }
    head.extend(graph.unknown_fields.get("").cloned().unwrap_or_default());
    out.extend_from_slice(b"{\n");
    // The head in reading order, not in that of the alphabet.
    let order = ["schema", "version", "revision", "next_ids", "metadata", "mesh"];
    let first = order.iter().filter_map(|key| head.remove(*key).map(|value| ((*key).to_owned(), value)));
    for (key, value) in first.collect::<Vec<_>>().into_iter().chain(head) {
        out.extend_from_slice(format!("{}: {value},\n", json!(key)).as_bytes());
    }
    let mut writer = Lists { out, graph };
    writer.list("objects", graph.objects().map(|o| (o.id.to_string(), records::from_object(o))));
    writer.list("places", graph.places().map(|p| (p.id.to_string(), records::from_place(p))));
    let edges = graph.place_edges().map(|e| (format!("{}-{}", e.a, e.b), records::from_place_edge(e)));
    writer.list("place_edges", edges);
    writer.list("rooms", graph.rooms().map(|r| (r.id.to_string(), records::from_room(r))));
    let edges = graph.room_edges().map(|e| (format!("{}-{}", e.a, e.b), records::from_room_edge(e)));
    writer.list("room_edges", edges);
    writer.list("buildings", graph.buildings().map(|b| (b.id.to_string(), records::from_building(b))));
    writer.list("groups", graph.groups().map(|g| (g.id.to_string(), records::from_group(g))));
    let relations = graph.relations.values().map(|r| (format!("{:?}", r.key()), records::from_relation(r)));
    writer.list("relations", relations);
    writer.list("agents", graph.agents().map(|a| (a.id.to_string(), records::from_agent(a))));
    let known = graph.memory.iter().filter(|(id, _)| graph.object(**id).is_some());
    writer.list("memory", known.map(|(id, memory)| (String::new(), records::from_memory(*id, memory))));
    let mut out = writer.out;
    out.truncate(out.len() - 2);
    out.extend_from_slice(b"\n}\n");
    out
}

/// Writes lists of records, with the unknown fields they were read with.
struct Lists<'a> {
    out: Vec<u8>,
    graph: &'a SceneGraph,
}

impl Lists<'_> {
    fn list(&mut self, name: &str, records: impl Iterator<Item = (String, Map<String, Value>)>) {
        self.out.extend_from_slice(format!("\"{name}\": [").as_bytes());
        let mut separator = "\n";
        for (key, mut record) in records {
            if let Some(unknown) = self.graph.unknown_fields.get(&format!("{name}/{key}")) {
                for (field, value) in unknown {
                    record.entry(field.clone()).or_insert_with(|| value.clone());
                }
            }
            self.out.extend_from_slice(separator.as_bytes());
            self.out.extend_from_slice(Value::Object(record).to_string().as_bytes());
            separator = ",\n";
        }
        self.out.extend_from_slice(b"],\n");
    }
}

pub(crate) fn read_document(bytes: &[u8]) -> Result<(SceneGraph, Option<MeshReference>), LoadError> {
    let value = parse(bytes)?;
    let root = Cursor::root(&value);
    let schema = root.get("schema")?;
    if schema.str()? != SCHEMA {
        return Err(LoadError::Schema { path: schema.path() });
    }
    let major = root.get("version")?.get("major")?.u64()?;
    if major > MAJOR {
        return Err(LoadError::NewerVersion { major, supported: MAJOR });
    }
    let mut loader = Loader { graph: SceneGraph::new(), unknown: BTreeMap::new() };
    loader.keep_unknown("", &root, DOCUMENT)?;
    loader.nodes(&root)?;
    let Loader { mut graph, unknown } = loader;
    graph.unknown_fields = unknown;
    graph.metadata = records::metadata(&root)?;
    if let Some(next) = root.find("next_ids") {
        let mut read = NextIds { ..graph.next };
        for (field, slot) in [("object", &mut read.object), ("room", &mut read.room), ("group", &mut read.group)] {
            *slot = (*slot).max(next.get(field)?.u64()?);
        }
        graph.next = read;
    }
    graph.revision = root.find("revision").map_or(Ok(0), |c| c.u64())?;
    graph.clear_log();
    Ok((graph, mesh_reference(&root)?))
}

fn mesh_reference(root: &Cursor) -> Result<Option<MeshReference>, LoadError> {
    let Some(mesh) = root.find("mesh") else {
        return Ok(None);
    };
    let file = mesh.get("file")?;
    // Only a plain name: a graph file must not make us read elsewhere.
    let name = file.str()?;
    if name.is_empty() || name.contains(['/', '\\', '\0']) || name == ".." {
        return Err(file.wrong("a file name"));
    }
    Ok(Some(MeshReference {
        file: name.to_owned(),
        sha256: mesh.get("sha256")?.str()?.to_owned(),
        vertices: mesh.find("vertices").map_or(Ok(0), |c| c.u64())?,
        faces: mesh.find("faces").map_or(Ok(0), |c| c.u64())?,
    }))
}

/// Fills a graph through the same ops as everybody, so that every check of [`SceneGraph::apply`] holds for files.
struct Loader {
    graph: SceneGraph,
    unknown: BTreeMap<String, Map<String, Value>>,
}

impl Loader {
    fn nodes(&mut self, root: &Cursor) -> Result<(), LoadError> {
        self.each(root, "places", records::PLACE, |graph, at| {
            let place = records::place(at)?;
            let is_new = graph.place(place.id).is_none();
            Ok((place.id.to_string(), is_new, vec![Op::PutPlace(place)]))
        })?;
        self.each(root, "place_edges", records::PLACE_EDGE, |graph, at| {
            let edge = records::place_edge(at)?;
            for id in [edge.a, edge.b] {
                graph.place(id).ok_or_else(|| at.dangling(id.0))?;
            }
            let is_new = graph.place_edge(edge.a, edge.b).is_none();
            Ok((format!("{}-{}", edge.a, edge.b), is_new, vec![Op::PutPlaceEdge(edge)]))
        })?;
        self.each(root, "rooms", records::ROOM, |graph, at| {
            let room = records::room(at)?;
            let mut is_new = graph.room(room.id).is_none();
            for id in &room.places {
                let place = graph.place(*id).ok_or_else(|| at.dangling(id.0))?;
                // A place in two rooms.
                is_new &= place.room.is_none();
            }
            Ok((room.id.to_string(), is_new, vec![Op::PutRoom(Box::new(room))]))
        })?;
        self.each(root, "room_edges", records::ROOM_EDGE, |graph, at| {
            let edge = records::room_edge(at)?;
            for id in [edge.a, edge.b] {
                graph.room(id).ok_or_else(|| at.dangling(id.0))?;
            }
            let is_new = !graph.room_edges.contains_key(&(edge.a, edge.b));
            Ok((format!("{}-{}", edge.a, edge.b), is_new, vec![Op::PutRoomEdge(edge)]))
        })?;
        self.each(root, "buildings", records::BUILDING, |graph, at| {
            let building = records::building(at)?;
            for id in &building.rooms {
                graph.room(*id).ok_or_else(|| at.dangling(id.0))?;
            }
            let is_new = graph.building(building.id).is_none();
            Ok((building.id.to_string(), is_new, vec![Op::PutBuilding(Box::new(building))]))
        })?;
        self.each(root, "objects", records::OBJECT, |graph, at| {
            let object = records::object(at)?;
            if let Some(id) = object.room.filter(|id| graph.room(*id).is_none()) {
                return Err(at.get("room")?.dangling(id.0));
            }
            if let Some(id) = object.place.filter(|id| graph.place(*id).is_none()) {
                return Err(at.get("place")?.dangling(id.0));
            }
            let is_new = graph.object(object.id).is_none();
            Ok((object.id.to_string(), is_new, vec![Op::PutObject(Box::new(object))]))
        })?;
        self.each(root, "groups", records::GROUP, |graph, at| {
            let group = records::group(at)?;
            let mut is_new = graph.group(group.id).is_none();
            for id in group.members.iter().chain(&group.support) {
                let member = graph.object(*id).ok_or_else(|| at.dangling(id.0))?;
                is_new &= member.group.is_none();
            }
            if let Some(id) = group.room.filter(|id| graph.room(*id).is_none()) {
                return Err(at.get("room")?.dangling(id.0));
            }
            Ok((group.id.to_string(), is_new, vec![Op::PutGroup(Box::new(group))]))
        })?;
        self.each(root, "relations", records::RELATION, |graph, at| {
            let relation = records::relation(at)?;
            for id in [Some(relation.subject), Some(relation.object), relation.other].into_iter().flatten() {
                graph.object(id).ok_or_else(|| at.dangling(id.0))?;
            }
            let is_new = !graph.relations.contains_key(&relation.key());
            Ok((format!("{:?}", relation.key()), is_new, vec![Op::PutRelation(relation)]))
        })?;
        self.each(root, "agents", records::AGENT, |graph, at| {
            let agent = records::agent(at)?;
            let is_new = graph.agent(agent.id).is_none();
            Ok((agent.id.to_string(), is_new, vec![Op::PutAgent(Box::new(agent))]))
        })?;
        if let Some(list) = root.find("memory") {
            for item in list.items()? {
                let (id, memory) = records::memory(&item)?;
                self.graph.object(id).ok_or_else(|| item.dangling(id.0))?;
                if self.graph.memory.insert(id, memory).is_some() {
                    return Err(item.duplicate());
                }
            }
        }
        Ok(())
    }

    /// Reads one list: `read` gives the key of a record, whether it is the first of its id, and the ops that add it.
    fn each(
        &mut self,
        root: &Cursor,
        name: &'static str,
        fields: &[&str],
        read: impl Fn(&SceneGraph, &Cursor) -> Result<(String, bool, Vec<Op>), LoadError>,
    ) -> Result<(), LoadError> {
        let Some(list) = root.find(name) else {
            return Ok(());
        };
        for item in list.items()? {
            let (key, is_new, ops) = read(&self.graph, &item)?;
            if !is_new {
                return Err(item.duplicate());
            }
            for op in ops {
                self.graph.apply(op).map_err(|error| item.refused(error))?;
            }
            self.keep_unknown(&format!("{name}/{key}"), &item, fields)?;
        }
        Ok(())
    }

    fn keep_unknown(&mut self, key: &str, at: &Cursor, fields: &[&str]) -> Result<(), LoadError> {
        let unknown: Map<String, Value> = at
            .map()?
            .iter()
            .filter(|(field, _)| !fields.contains(&field.as_str()))
            .map(|(field, value)| (field.clone(), value.clone()))
            .collect();
        if !unknown.is_empty() {
            self.unknown.insert(key.to_owned(), unknown);
        }
        Ok(())
    }
}
