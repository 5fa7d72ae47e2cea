//! graph.json: the whole graph as one JSON document, schema "omni-dsg".
//!
//! Version 1.0. Ids are integers, exact to 64 bits. Fields that this version does not know, in the document or in any
//! record, are kept and written back; a newer major version is refused.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::io::{self, Write};

use serde_json::{Map, Value, json};

use crate::check::{check_place, check_place_edge};
use crate::faults::Faults;
use crate::graph::{NextIds, SceneGraph};
use crate::load::{Cursor, LoadError};
use crate::op::{Op, OpError};
use crate::place::{Place, PlaceEdge};
use crate::records::{self, PlaceEdgeRecord, PlaceRecord};
use crate::scan::Document;

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

/// Records are written in portions of this size.
const PORTION_BYTES: usize = 1 << 16;

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
    let mut out = Vec::new();
    write_document(graph, None, &mut out).expect("memory takes all bytes");
    out
}

/// A graph from a JSON document. The log is empty and begins at the document's revision.
///
/// # Errors
/// Every fault of the text, a record or a reference, with its JSON path. Never a panic, whatever the bytes.
pub fn graph_from_json(bytes: &[u8]) -> Result<SceneGraph, LoadError> {
    read_document(bytes, &mut Faults::fatal()).map(|(graph, _)| graph)
}

pub(crate) fn write_document(graph: &SceneGraph, mesh: Option<&MeshReference>, out: &mut impl Write) -> io::Result<()> {
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
    out.write_all(b"{\n")?;
    // The head in reading order, not in that of the alphabet.
    let order = ["schema", "version", "revision", "next_ids", "metadata", "mesh"];
    let first = order.iter().filter_map(|key| head.remove(*key).map(|value| ((*key).to_owned(), value)));
    for (key, value) in first.collect::<Vec<_>>().into_iter().chain(head) {
        writeln!(out, "{}: {value},", json!(key))?;
    }
    let mut lists = Lists { out, graph, portion: Vec::new() };
    lists.list("objects", graph.objects().map(|o| (o.id.to_string(), records::from_object(o))))?;
    lists.plain("places", graph.places().map(|p| (p, PlaceRecord::from(p))), |p| p.id.to_string())?;
    let edges = graph.place_edges().map(|e| (e, PlaceEdgeRecord::from(e)));
    lists.plain("place_edges", edges, |e| format!("{}-{}", e.a, e.b))?;
    lists.list("rooms", graph.rooms().map(|r| (r.id.to_string(), records::from_room(r))))?;
    let edges = graph.room_edges().map(|e| (format!("{}-{}", e.a, e.b), records::from_room_edge(e)));
    lists.list("room_edges", edges)?;
    lists.list("buildings", graph.buildings().map(|b| (b.id.to_string(), records::from_building(b))))?;
    lists.list("groups", graph.groups().map(|g| (g.id.to_string(), records::from_group(g))))?;
    let relations = graph.relations.values().map(|r| (format!("{:?}", r.key()), records::from_relation(r)));
    lists.list("relations", relations)?;
    lists.list("agents", graph.agents().map(|a| (a.id.to_string(), records::from_agent(a))))?;
    let known = graph.memory.iter().filter(|(id, _)| graph.object(**id).is_some());
    lists.list("memory", known.map(|(id, memory)| (String::new(), records::from_memory(*id, memory))))?;
    lists.out.write_all(b"\n}\n")
}

/// Writes lists of records, with the unknown fields they were read with.
struct Lists<'a, W: Write> {
    out: &'a mut W,
    graph: &'a SceneGraph,
    portion: Vec<u8>,
}

impl<W: Write> Lists<'_, W> {
    fn list(&mut self, name: &str, records: impl Iterator<Item = (String, Map<String, Value>)>) -> io::Result<()> {
        self.open(name);
        for (index, (key, mut record)) in records.enumerate() {
            self.separate(index)?;
            self.add_unknown(name, &key, &mut record);
            serde_json::to_writer(&mut self.portion, &record)?;
        }
        self.close()
    }

    /// The same for records that are many and small: nothing in between but the record itself.
    fn plain<N, R: serde::Serialize>(
        &mut self,
        name: &str,
        records: impl Iterator<Item = (N, R)>,
        key: impl Fn(&N) -> String,
    ) -> io::Result<()> {
        let is_any_unknown = self.has_unknown(name);
        self.open(name);
        for (index, (node, record)) in records.enumerate() {
            self.separate(index)?;
            let key = if is_any_unknown { key(&node) } else { String::new() };
            if is_any_unknown && self.graph.unknown_fields.contains_key(&format!("{name}/{key}")) {
                let mut map = match serde_json::to_value(&record)? {
                    Value::Object(map) => map,
                    _ => Map::new(),
                };
                self.add_unknown(name, &key, &mut map);
                serde_json::to_writer(&mut self.portion, &map)?;
            } else {
                serde_json::to_writer(&mut self.portion, &record)?;
            }
        }
        self.close()
    }

    fn has_unknown(&self, name: &str) -> bool {
        let start = format!("{name}/");
        self.graph.unknown_fields.range(start.clone()..).next().is_some_and(|(key, _)| key.starts_with(&start))
    }

    fn add_unknown(&self, name: &str, key: &str, record: &mut Map<String, Value>) {
        if let Some(unknown) = self.graph.unknown_fields.get(&format!("{name}/{key}")) {
            for (field, value) in unknown {
                record.entry(field.clone()).or_insert_with(|| value.clone());
            }
        }
    }

    fn open(&mut self, name: &str) {
        if name != "objects" {
            self.portion.extend_from_slice(b",\n");
        }
        self.portion.extend_from_slice(format!("\"{name}\": [").as_bytes());
    }

    fn separate(&mut self, index: usize) -> io::Result<()> {
        self.portion.extend_from_slice(if index == 0 { b"\n" } else { b",\n" });
        if self.portion.len() >= PORTION_BYTES {
            self.out.write_all(&self.portion)?;
            self.portion.clear();
        }
        Ok(())
    }

    fn close(&mut self) -> io::Result<()> {
        self.portion.push(b']');
        self.out.write_all(&self.portion)?;
        self.portion.clear();
        Ok(())
    }
}

pub(crate) fn read_document(
    bytes: &[u8],
    faults: &mut Faults,
) -> Result<(SceneGraph, Option<MeshReference>), LoadError> {
    let (document, fault) = Document::scan(bytes);
    if let Some(fault) = fault {
        faults.note(fault)?;
    }
    check_header(&document)?;
    let mut loader = Loader { document: &document, graph: SceneGraph::new(), faults };
    loader.head()?;
    loader.nodes()?;
    let Loader { mut graph, faults, .. } = loader;
    graph.index_place_edges();
    graph.revision = read_field(&document, "revision", |c| c.u64())?.unwrap_or(0);
    graph.check_room_to_grow()?;
    graph.clear_log();
    let mesh = match read_field(&document, "mesh", mesh_reference) {
        Ok(mesh) => mesh,
        Err(fault) => faults.instead(fault)?,
    };
    Ok((graph, mesh))
}

fn check_header(document: &Document) -> Result<(), LoadError> {
    let is_ours = read_field(document, "schema", |c| if c.str()? == SCHEMA { Ok(()) } else { Err(not_ours(c)) })?;
    is_ours.ok_or_else(|| LoadError::Schema { path: crate::load::JsonPath("$.schema".into()) })?;
    let major = read_field(document, "version", |c| c.get("major")?.u64())?;
    let major = major.ok_or_else(|| LoadError::Missing { path: crate::load::JsonPath("$.version".into()) })?;
    if major > MAJOR {
        return Err(LoadError::NewerVersion { major, supported: MAJOR });
    }
    Ok(())
}

fn not_ours(at: &Cursor) -> LoadError {
    LoadError::Schema { path: at.path() }
}

/// What a field of the document says; null counts as absent.
pub(crate) fn read_field<T>(
    document: &Document,
    name: &str,
    read: impl FnOnce(&Cursor) -> Result<T, LoadError>,
) -> Result<Option<T>, LoadError> {
    let Some(text) = document.field(name) else {
        return Ok(None);
    };
    let value = document.parse(text)?;
    if value.is_null() { Ok(None) } else { read(&Cursor::field(&value, name)).map(Some) }
}

/// The mesh that a document names, whatever else is in it.
pub(crate) fn named_mesh(bytes: &[u8]) -> Option<MeshReference> {
    let (document, _) = Document::scan(bytes);
    read_field(&document, "mesh", mesh_reference).ok().flatten()
}

fn mesh_reference(mesh: &Cursor) -> Result<MeshReference, LoadError> {
    let file = mesh.get("file")?;
    // Only a plain name: a graph file must not make us read elsewhere.
    let name = file.str()?;
    if name.is_empty() || name.contains(['/', '\\', '\0']) || name == ".." {
        return Err(file.wrong("a file name"));
    }
    Ok(MeshReference {
        file: name.to_owned(),
        sha256: mesh.get("sha256")?.str()?.to_owned(),
        vertices: mesh.find("vertices").map_or(Ok(0), |c| c.u64())?,
        faces: mesh.find("faces").map_or(Ok(0), |c| c.u64())?,
    })
}

/// Fills a graph record by record, with the checks of [`SceneGraph::apply`]. A fault ends the reading or, in salvage, the record.
struct Loader<'d, 'f> {
    document: &'d Document<'d>,
    graph: SceneGraph,
    faults: &'f mut Faults,
}

impl Loader<'_, '_> {
    /// Metadata, ids, and what a newer version has put beside the lists.
    fn head(&mut self) -> Result<(), LoadError> {
        let document = self.document;
        self.graph.metadata = read_field(document, "metadata", |c| c.map().cloned())
            .or_else(|e| self.faults.instead(e))?
            .unwrap_or_default();
        if let Some(ids) = read_field(document, "next_ids", next_ids).or_else(|e| self.faults.instead(e))? {
            self.graph.next = ids;
        }
        for name in document.names().filter(|name| !DOCUMENT.contains(name)) {
            let text = document.field(name).unwrap_or_default();
            match document.parse(text) {
                Ok(value) => {
                    self.graph.unknown_fields.entry(String::new()).or_default().insert(name.to_owned(), value);
                }
                Err(error) => self.faults.note(error)?,
            }
        }
        Ok(())
    }

    fn nodes(&mut self) -> Result<(), LoadError> {
        self.places()?;
        self.place_edges()?;
        self.each("rooms", records::ROOM, |this, at| {
            let mut room = records::room(at)?;
            let is_new = this.graph.room(room.id).is_none();
            let mut is_twice = false;
            let (graph, faults) = (&this.graph, &mut *this.faults);
            faults.retain(&mut room.places, |id| {
                let place = graph.place(*id).ok_or_else(|| at.dangling(id.0))?;
                is_twice |= place.room.is_some();
                Ok(())
            })?;
            Ok((room.id.to_string(), is_new && !is_twice, Op::PutRoom(Box::new(room))))
        })?;
        self.each("room_edges", records::ROOM_EDGE, |this, at| {
            let edge = records::room_edge(at)?;
            for id in [edge.a, edge.b] {
                this.graph.room(id).ok_or_else(|| at.dangling(id.0))?;
            }
            let is_new = !this.graph.room_edges.contains_key(&(edge.a, edge.b));
            Ok((format!("{}-{}", edge.a, edge.b), is_new, Op::PutRoomEdge(edge)))
        })?;
        self.each("buildings", records::BUILDING, |this, at| {
            let mut building = records::building(at)?;
            let (graph, faults) = (&this.graph, &mut *this.faults);
            faults.retain(&mut building.rooms, |id| graph.room(*id).map(drop).ok_or_else(|| at.dangling(id.0)))?;
            let is_new = graph.building(building.id).is_none();
            Ok((building.id.to_string(), is_new, Op::PutBuilding(Box::new(building))))
        })?;
        self.each("objects", records::OBJECT, |this, at| {
            let mut object = records::object(at)?;
            let (graph, faults) = (&this.graph, &mut *this.faults);
            let room = |id: &_| graph.room(*id).map(drop).ok_or_else(|| dangling_field(at, "room", id.0));
            faults.keep(&mut object.room, room)?;
            let place = |id: &_| graph.place(*id).map(drop).ok_or_else(|| dangling_field(at, "place", id.0));
            faults.keep(&mut object.place, place)?;
            let is_new = graph.object(object.id).is_none();
            Ok((object.id.to_string(), is_new, Op::PutObject(Box::new(object))))
        })?;
        self.each("groups", records::GROUP, |this, at| {
            let mut group = records::group(at)?;
            let mut is_twice = false;
            let (graph, faults) = (&this.graph, &mut *this.faults);
            faults.retain(&mut group.members, |id| {
                let member = graph.object(*id).ok_or_else(|| at.dangling(id.0))?;
                is_twice |= member.group.is_some();
                Ok(())
            })?;
            let object = |id: &_| graph.object(*id).map(drop).ok_or_else(|| dangling_field(at, "support", id.0));
            faults.keep(&mut group.support, object)?;
            let room = |id: &_| graph.room(*id).map(drop).ok_or_else(|| dangling_field(at, "room", id.0));
            faults.keep(&mut group.room, room)?;
            let is_new = graph.group(group.id).is_none() && !is_twice;
            Ok((group.id.to_string(), is_new, Op::PutGroup(Box::new(group))))
        })?;
        self.each("relations", records::RELATION, |this, at| {
            let relation = records::relation(at)?;
            for id in [Some(relation.subject), Some(relation.object), relation.other].into_iter().flatten() {
                this.graph.object(id).ok_or_else(|| at.dangling(id.0))?;
            }
            let is_new = !this.graph.relations.contains_key(&relation.key());
            Ok((format!("{:?}", relation.key()), is_new, Op::PutRelation(relation)))
        })?;
        self.each("agents", records::AGENT, |this, at| {
            let agent = records::agent(at)?;
            let is_new = this.graph.agent(agent.id).is_none();
            Ok((agent.id.to_string(), is_new, Op::PutAgent(Box::new(agent))))
        })?;
        self.records("memory", |this, at| {
            let (id, memory) = records::memory(at)?;
            this.graph.object(id).ok_or_else(|| at.dangling(id.0))?;
            if this.graph.memory.contains_key(&id) {
                return Err(at.duplicate());
            }
            this.graph.memory.insert(id, memory);
            Ok(())
        })
    }

    fn places(&mut self) -> Result<(), LoadError> {
        let fast = |text: &[u8]| serde_json::from_slice::<PlaceRecord>(text).ok().map(Place::from);
        let name = |place: &Place| place.id.to_string();
        self.plain("places", records::PLACE, fast, records::place, name, |graph, place| {
            check_place(&place)?;
            // Rooms own the membership.
            Ok(insert(&mut graph.places, place.id, Place { room: None, ..place }))
        })
    }

    fn place_edges(&mut self) -> Result<(), LoadError> {
        let fast = |text: &[u8]| serde_json::from_slice::<PlaceEdgeRecord>(text).ok().map(PlaceEdge::from);
        let name = |edge: &PlaceEdge| format!("{}-{}", edge.a, edge.b);
        self.plain("place_edges", records::PLACE_EDGE, fast, records::place_edge, name, |graph, edge| {
            check_place_edge(&edge)?;
            for id in [edge.a, edge.b] {
                graph.place(id).ok_or(OpError::NoPlace(id))?;
            }
            Ok(insert(&mut graph.place_edges, (edge.a, edge.b), edge))
        })
    }

    /// Reads a list of many small records: `fast` reads those that are as we write them, `plain` all others and all faults.
    /// `add` says whether the item is the first of its key, and changes nothing if it is not.
    fn plain<T: Copy>(
        &mut self,
        name: &'static str,
        fields: &[&str],
        fast: impl Fn(&[u8]) -> Option<T>,
        plain: impl Fn(&Cursor) -> Result<T, LoadError>,
        key: impl Fn(&T) -> String,
        add: impl Fn(&mut SceneGraph, T) -> Result<bool, OpError>,
    ) -> Result<(), LoadError> {
        let document = self.document;
        for (index, span) in document.items(name).unwrap_or_default().iter().enumerate() {
            let text = document.text(*span);
            if let Some(item) = fast(text)
                && let Ok(true) = add(&mut self.graph, item)
            {
                continue;
            }
            // A fault, or something more than we know: the plain way finds out what.
            let result = document.parse(text).and_then(|value| {
                let at = Cursor::record(&value, name, index);
                let item = plain(&at)?;
                match add(&mut self.graph, item) {
                    Ok(true) => keep_unknown(&mut self.graph, &format!("{name}/{}", key(&item)), &at, fields),
                    Ok(false) => Err(at.duplicate()),
                    Err(OpError::NoPlace(id)) => Err(at.dangling(id.0)),
                    Err(error) => Err(at.refused(error)),
                }
            });
            if let Err(error) = result {
                self.faults.note(error)?;
            }
        }
        Ok(())
    }

    /// Reads one list: `read` gives the key of a record, whether it is the first of its id, and the op that adds it.
    fn each(
        &mut self,
        name: &'static str,
        fields: &[&str],
        read: impl Fn(&mut Self, &Cursor) -> Result<(String, bool, Op), LoadError>,
    ) -> Result<(), LoadError> {
        self.records(name, |this, at| {
            let (key, is_new, op) = read(this, at)?;
            if !is_new {
                return Err(at.duplicate());
            }
            this.graph.apply(op).map_err(|error| at.refused(error))?;
            keep_unknown(&mut this.graph, &format!("{name}/{key}"), at, fields)
        })
    }

    fn records(
        &mut self,
        name: &'static str,
        read: impl Fn(&mut Self, &Cursor) -> Result<(), LoadError>,
    ) -> Result<(), LoadError> {
        let document = self.document;
        for (index, span) in document.items(name).unwrap_or_default().iter().enumerate() {
            let result =
                document.parse(document.text(*span)).and_then(|value| read(self, &Cursor::record(&value, name, index)));
            if let Err(error) = result {
                self.faults.note(error)?;
            }
        }
        Ok(())
    }
}

/// Whether the key was free.
fn insert<K: Ord, V>(map: &mut BTreeMap<K, V>, key: K, value: V) -> bool {
    match map.entry(key) {
        Entry::Vacant(free) => {
            free.insert(value);
            true
        }
        Entry::Occupied(_) => false,
    }
}

pub(crate) fn next_ids(at: &Cursor) -> Result<NextIds, LoadError> {
    let field = |name| at.get(name)?.u64().map(|next: u64| next.max(1));
    Ok(NextIds { object: field("object")?, room: field("room")?, group: field("group")? })
}

fn dangling_field(at: &Cursor, field: &'static str, id: u64) -> LoadError {
    at.get(field).map_or_else(|error| error, |field| field.dangling(id))
}

fn keep_unknown(graph: &mut SceneGraph, key: &str, at: &Cursor, fields: &[&str]) -> Result<(), LoadError> {
    let unknown: Map<String, Value> = at
        .map()?
        .iter()
        .filter(|(field, _)| !fields.contains(&field.as_str()))
        .map(|(field, value)| (field.clone(), value.clone()))
        .collect();
    if !unknown.is_empty() {
        graph.unknown_fields.insert(key.to_owned(), unknown);
    }
    Ok(())
}
