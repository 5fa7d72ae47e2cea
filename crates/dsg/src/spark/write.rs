//! Writing spark_dsg: nodes and edges of ours as theirs, with what only we know in their open metadata.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::graph::SceneGraph;
use crate::ids::{ObjectId, RoomId};
use crate::load::Cursor;
use crate::mesh::Mesh;
use crate::object::Object;
use crate::place::Place;
use crate::records;
use crate::room::{Building, Room, RoomEdge};
use crate::rooms::{RoomConfig, name_rooms};
use crate::spark::MAX_INDEX;
use crate::spark::attributes::{self, place_edge_info, plain_info};
use crate::spark::build::{crossings, with_storeys};
use crate::spark::kept::{kept, kept_of_document, restore};
use crate::spark::names::{Labels, Names, layer_keys, layer_names, partitions};
use crate::spark::ours::{add_ours, metadata, without};
use crate::spark::plain::{EdgeOut, InfoOut, PlaceAttributesOut, PlaceOut};

/// Records are written in portions of this size.
const PORTION_BYTES: usize = 1 << 16;

/// Writes the whole document.
pub(crate) fn write(graph: &SceneGraph, mesh: Option<&Mesh>, out: &mut impl Write) -> io::Result<()> {
    let names = Names::of(graph);
    let mut writer = Writer { graph, names, out, portion: Vec::new(), count: 0, labels: Labels::of(graph) };
    writer.document(mesh)
}

/// An edge with something to say: source, target, what it says.
type Said = (u64, u64, Map<String, Value>);

struct Writer<'g, 'o, W: Write> {
    graph: &'g SceneGraph,
    names: Names,
    labels: Labels,
    out: &'o mut W,
    portion: Vec<u8>,
    /// Records of the present list.
    count: usize,
}

impl<W: Write> Writer<'_, '_, W> {
    fn document(&mut self, mesh: Option<&Mesh>) -> io::Result<()> {
        let has_groups = self.graph.groups().next().is_some();
        let mut keys = layer_keys(self.graph);
        keys.extend(
            kept_of_document(self.graph, "layer_keys").and_then(Value::as_array).into_iter().flatten().cloned(),
        );
        let mut names = layer_names(has_groups);
        if let Some(Value::Object(theirs)) = kept_of_document(self.graph, "layer_names") {
            let mut all = theirs.clone();
            if has_groups {
                all.insert("GROUPS".into(), names["GROUPS"].clone());
            }
            names = Value::Object(all);
        }
        let header = json!({ "project_name": "main", "version": { "major": 1, "minor": 1, "patch": 3 } });
        write!(self.out, "{{\"SPARK_DSG_header\":{header},\"directed\":false,\"multigraph\":false,")?;
        write!(self.out, "\"layer_keys\":{},\"layer_names\":{names},", Value::Array(keys))?;
        write!(self.out, "\"nodes\":[")?;
        self.nodes()?;
        self.close()?;
        write!(self.out, "],\"edges\":[")?;
        self.edges()?;
        self.close()?;
        write!(self.out, "],\"metadata\":{}", metadata(self.graph, &self.labels.own))?;
        if let Some(mesh) = mesh {
            write!(self.out, ",\"mesh\":")?;
            crate::spark::mesh::write(mesh, self.out)?;
        }
        writeln!(self.out, "}}")
    }

    fn record(&mut self, record: &impl Serialize) -> io::Result<()> {
        if self.count > 0 {
            self.portion.extend_from_slice(b",\n");
        }
        self.count += 1;
        serde_json::to_writer(&mut self.portion, record)?;
        if self.portion.len() >= PORTION_BYTES {
            self.out.write_all(&self.portion)?;
            self.portion.clear();
        }
        Ok(())
    }

    fn close(&mut self) -> io::Result<()> {
        self.out.write_all(&self.portion)?;
        self.portion.clear();
        self.count = 0;
        Ok(())
    }

    // Nodes

    fn nodes(&mut self) -> io::Result<()> {
        let graph = self.graph;
        for object in graph.objects() {
            let attributes = self.object(object);
            self.node(self.names.object(object.id), 2, 0, attributes)?;
        }
        for place in graph.places() {
            self.place(place)?;
        }
        let plain = self.plain_rooms();
        for room in graph.rooms() {
            let mut attributes = self.restored("rooms", &room.id, attributes::room_attributes(room));
            if plain.get(&room.id) != Some(room) {
                let record = records::from_room(room);
                add_ours(&mut attributes, without(record, &["metadata", "places"]));
            }
            self.node(self.names.room(room.id), 4, 0, attributes)?;
        }
        let rooms: Vec<Room> = graph.rooms().cloned().collect();
        for building in graph.buildings() {
            let mut attributes = self.restored("buildings", &building.id, attributes::building_attributes(building));
            let storeys = with_storeys(Building { storeys: Vec::new(), ..building.clone() }, &rooms).storeys;
            if storeys != building.storeys || building.id.0 >= MAX_INDEX {
                add_ours(&mut attributes, without(records::from_building(building), &["rooms"]));
            }
            self.node(self.names.building(building.id), 5, 0, attributes)?;
        }
        for group in graph.groups() {
            let mut attributes = self.restored("groups", &group.id, attributes::group_attributes(group));
            if group.support.is_some() || group.room.is_some() || group.id.0 >= MAX_INDEX {
                let ours = json!({ "id": group.id, "support": group.support, "room": group.room });
                add_ours(&mut attributes, ours.as_object().cloned().unwrap_or_default());
            }
            self.node(self.names.group(group.id), 2, 1, attributes)?;
        }
        for (id, partition) in partitions(graph) {
            let ids = self.names.poses(id).to_vec();
            let of_poses = kept(graph, "agents", &id).and_then(|kept| kept.get("poses"));
            for (index, (pose, spark_id)) in graph.agents[&id].trajectory.iter().zip(ids).enumerate() {
                let mut attributes = attributes::pose_attributes(pose, spark_id);
                if let Some(of_pose) = of_poses.and_then(|poses| poses.get(index.to_string())) {
                    restore(&mut attributes, of_pose);
                }
                self.node(spark_id, 2, partition, attributes)?;
            }
        }
        for node in kept_of_document(graph, "nodes").and_then(Value::as_array).into_iter().flatten() {
            if node.get("id").and_then(Value::as_u64).is_some_and(|id| self.names.taken.insert(id)) {
                self.record(node)?;
            }
        }
        Ok(())
    }

    fn node(&mut self, id: u64, layer: u8, partition: u32, attributes: Map<String, Value>) -> io::Result<()> {
        self.names.taken.insert(id);
        self.record(&json!({ "attributes": attributes, "id": id, "layer": layer, "partition": partition }))
    }

    /// With what we keep of theirs.
    fn restored(
        &self,
        list: &'static str,
        id: &impl std::fmt::Display,
        mut attributes: Map<String, Value>,
    ) -> Map<String, Value> {
        if self.names.is_kept.contains(list)
            && let Some(kept) = kept(self.graph, list, id)
        {
            restore(&mut attributes, kept);
        }
        attributes
    }

    fn object(&self, object: &Object) -> Map<String, Value> {
        let graph = self.graph;
        let mut attributes = self.restored("objects", &object.id, attributes::object_attributes(object));
        if attributes.get("semantic_label").is_some_and(Value::is_string) {
            let number = self.labels.numbers.get(&object.label).copied().unwrap_or(attributes::NO_LABEL);
            attributes.insert("semantic_label".into(), json!(number));
        }
        // Would their fields alone bring it back?
        let value = Value::Object(attributes.clone());
        let plain = attributes::object(object.id, &Cursor::root(&value), None);
        let room = object.place.and_then(|place| graph.place(place)).and_then(|place| place.room);
        let is_plain = plain.is_ok_and(|plain| {
            let plain = Object { place: object.place, room, group: object.group, ..plain };
            plain == *object && object.id.0 < MAX_INDEX && (object.place.is_some() || graph.places.is_empty())
        });
        if !is_plain {
            add_ours(&mut attributes, without(records::from_object(object), &["metadata", "place", "group"]));
        }
        attributes
    }

    fn place(&mut self, place: &Place) -> io::Result<()> {
        let id = self.names.place(place.id);
        let is_large = place.id.0 >= MAX_INDEX;
        if place.is_frontier() || is_large || self.names.is_kept.contains("places") {
            let mut attributes = self.restored("places", &place.id, attributes::place_attributes(place));
            if is_large {
                add_ours(&mut attributes, Map::from_iter([("id".to_owned(), json!(place.id))]));
            }
            return self.node(id, 3, 0, attributes);
        }
        let attributes = PlaceAttributesOut {
            distance: place.clearance_m,
            num_basis_points: place.basis_points,
            position: place.position.into(),
            r#type: "PlaceNodeAttributes",
        };
        self.record(&PlaceOut { attributes, id, layer: 3, partition: 0 })
    }

    /// The rooms as their fields alone would bring them back.
    fn plain_rooms(&self) -> BTreeMap<RoomId, Room> {
        let mut rooms: Vec<Room> = Vec::new();
        for room in self.graph.rooms() {
            let value = Value::Object(self.restored("rooms", &room.id, attributes::room_attributes(room)));
            if let Ok(plain) = attributes::room(room.id, &Cursor::root(&value)) {
                rooms.push(Room { places: room.places.clone(), ..plain });
            }
        }
        name_rooms(&mut rooms, &RoomConfig::default());
        rooms.into_iter().filter(|room| room.id.0 < MAX_INDEX).map(|room| (room.id, room)).collect()
    }

    // Edges

    fn edges(&mut self) -> io::Result<()> {
        let graph = self.graph;
        let mut said = self.said();
        for edge in graph.place_edges() {
            let (source, target) = (self.names.place(edge.a), self.names.place(edge.b));
            if self.names.is_kept.contains("place_edges")
                && let Some(kept) = kept(graph, "place_edges", &format!("{}-{}", edge.a, edge.b))
            {
                let mut info = place_edge_info(edge);
                restore(&mut info, kept);
                self.record(&json!({ "info": info, "source": source, "target": target }))?;
                continue;
            }
            let info = InfoOut { r#type: "EdgeAttributes", weight: Some(edge.clearance_m), weighted: true };
            self.record(&EdgeOut { info, source, target })?;
        }
        for place in graph.places() {
            if let Some(room) = place.room {
                self.structure(self.names.room(room), self.names.place(place.id), &mut said)?;
            }
        }
        for object in graph.objects() {
            let inferred = kept(graph, "objects", &object.id).and_then(|kept| kept.get("inferred_place")?.as_u64());
            if let Some(place) = object.place.filter(|place| inferred != Some(place.0)) {
                self.structure(self.names.place(place), self.names.object(object.id), &mut said)?;
            }
        }
        for building in graph.buildings() {
            for room in &building.rooms {
                self.structure(self.names.building(building.id), self.names.room(*room), &mut said)?;
            }
        }
        for group in graph.groups() {
            for member in &group.members {
                self.structure(self.names.group(group.id), self.names.object(*member), &mut said)?;
            }
        }
        for id in graph.agents.keys().copied() {
            let ids = self.names.poses(id).to_vec();
            let list =
                |name| kept(graph, "agents", &id).and_then(|kept| kept.get(name)?.as_array()).into_iter().flatten();
            let apart: BTreeSet<u64> = list("apart").filter_map(Value::as_u64).collect();
            for (index, pair) in ids.windows(2).enumerate() {
                if !apart.contains(&(index as u64 + 1)) {
                    self.structure(pair[0], pair[1], &mut said)?;
                }
            }
            for edge in list("edges") {
                if let (Some(a), Some(b)) = (edge[0].as_u64(), edge[1].as_u64())
                    && ids.contains(&a)
                    && ids.contains(&b)
                {
                    self.structure(a, b, &mut said)?;
                }
            }
        }
        // What is left joins nodes that we do not join; if they are still there.
        for (source, target, mut info) in said.into_values() {
            let is_structure = info.remove("structure").is_some();
            if !is_structure && self.names.taken.contains(&source) && self.names.taken.contains(&target) {
                self.record(&json!({ "info": info, "source": source, "target": target }))?;
            }
        }
        Ok(())
    }

    /// An edge that follows from the graph; with what there is to say about it.
    fn structure(&mut self, source: u64, target: u64, said: &mut BTreeMap<(u64, u64), Said>) -> io::Result<()> {
        match said.remove(&(source.min(target), source.max(target))) {
            Some((_, _, mut info)) => {
                info.remove("structure");
                self.record(&json!({ "info": info, "source": source, "target": target }))
            }
            None => {
                let info = InfoOut { r#type: "EdgeAttributes", weight: None, weighted: false };
                self.record(&EdgeOut { info, source, target })
            }
        }
    }

    /// Edges with something to say: ways between rooms, relations, and what we keep of theirs.
    fn said(&self) -> BTreeMap<(u64, u64), Said> {
        let graph = self.graph;
        let mut said: BTreeMap<(u64, u64), Said> = BTreeMap::new();
        let key = |a: u64, b: u64| (a.min(b), a.max(b));
        let plain = crossings(graph);
        for edge in graph.room_edges() {
            let (a, b) = (self.names.room(edge.a), self.names.room(edge.b));
            let kept = kept(graph, "room_edges", &format!("{}-{}", edge.a, edge.b));
            let is_plain = plain.get(&(edge.a, edge.b)) == Some(edge);
            if is_plain && graph.revision == 0 && kept.is_some_and(|kept| kept.get("inferred").is_some()) {
                continue;
            }
            let mut info = plain_info();
            if let Some(kept) = kept {
                restore(&mut info, kept);
            }
            let is_guessed = self.is_middle(edge) && !plain.contains_key(&(edge.a, edge.b));
            if !(is_plain || is_guessed) {
                add_ours(&mut info, records::from_room_edge(edge));
            }
            said.insert(key(a, b), (a, b, info));
        }
        let mut of_pairs: BTreeMap<(ObjectId, ObjectId), Vec<Value>> = BTreeMap::new();
        for relation in graph.relations() {
            let pair = (relation.subject.min(relation.object), relation.subject.max(relation.object));
            of_pairs.entry(pair).or_default().push(Value::Object(records::from_relation(relation)));
        }
        for edge in kept_of_document(graph, "edges").and_then(Value::as_array).into_iter().flatten() {
            let end = |name: &str| edge.get(name).and_then(Value::as_u64);
            if let (Some(a), Some(b)) = (end("source"), end("target")) {
                let mut info = edge.get("info").and_then(Value::as_object).cloned().unwrap_or_default();
                if edge.get("structure").is_some() {
                    info.insert("structure".into(), Value::Bool(true));
                }
                said.entry(key(a, b)).or_insert((a, b, info));
            }
        }
        for ((a, b), relations) in of_pairs {
            let (a, b) = (self.names.object(a), self.names.object(b));
            let (_, _, info) = said.entry(key(a, b)).or_insert_with(|| (a, b, plain_info()));
            add_ours(info, Map::from_iter([("relations".to_owned(), Value::Array(relations))]));
        }
        said
    }

    /// A way of which nothing is known but the rooms.
    fn is_middle(&self, edge: &RoomEdge) -> bool {
        let middle = || nalgebra::center(&self.graph.rooms[&edge.a].center, &self.graph.rooms[&edge.b].center);
        edge.width_m == 0.0 && edge.doorway == middle()
    }
}
