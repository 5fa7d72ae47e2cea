//! Writing spark_dsg: nodes and edges of ours as theirs, with what only we know in their open metadata.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::io::{self, Write};

use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::graph::{NextIds, SceneGraph};
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::load::Cursor;
use crate::mesh::Mesh;
use crate::object::Object;
use crate::place::Place;
use crate::records;
use crate::relation::Verdict;
use crate::room::Room;
use crate::rooms::{RoomConfig, name_rooms};
use crate::spark::{BUILDING, GROUP, MAX_INDEX, OBJECT, PLACE, ROOM, symbol};
use crate::spark_attributes as attributes;
use crate::spark_kept::{KEPT, OURS, restore};
use crate::spark_read::{crossings, place_edge_info, plain_info, with_storeys};

/// Records are written in portions of this size.
const PORTION_BYTES: usize = 1 << 16;

/// Writes the whole document.
pub(crate) fn write(graph: &SceneGraph, mesh: Option<&Mesh>, out: &mut impl Write) -> io::Result<()> {
    let names = Names::of(graph);
    let mut writer = Writer { graph, names, out, portion: Vec::new(), count: 0, labels: Labels::of(graph) };
    writer.document(mesh)
}

/// The names of layers that their files declare; ours has one more where there are groups.
pub(crate) fn layer_names(has_groups: bool) -> Value {
    let primary = |layer: u8| json!({ "layer": layer, "partition": 0 });
    let mut names = json!({
        "AGENTS": primary(2), "OBJECTS": primary(2), "PLACES": primary(3), "ROOMS": primary(4), "BUILDINGS": primary(5),
    });
    if has_groups {
        names["GROUPS"] = json!({ "layer": 2, "partition": 1 });
    }
    names
}

/// The layers of a graph.
pub(crate) fn layer_keys(graph: &SceneGraph) -> Vec<Value> {
    let mut keys: Vec<(u32, u32)> = [2, 3, 4, 5].map(|layer| (layer, 0)).into();
    if graph.groups().next().is_some() {
        keys.push((2, 1));
    }
    keys.extend(partitions(graph).into_values().map(|partition| (2, partition)));
    keys.into_iter().map(|(layer, partition)| json!({ "layer": layer, "partition": partition })).collect()
}

/// The partition of each robot: a letter. Ids that are letters (they come from such files) keep theirs; 0 is 'a'.
fn partitions(graph: &SceneGraph) -> BTreeMap<AgentId, u32> {
    // The letters of other nodes are taken: two nodes must not share a symbol.
    let is_free = |byte: u8| byte.is_ascii_alphabetic() && !b"OpPRBGtS".contains(&byte);
    let is_letter = |id: u64| u8::try_from(id).is_ok_and(is_free);
    let mut given: BTreeMap<AgentId, u32> =
        graph.agents().filter(|agent| is_letter(agent.id.0)).map(|agent| (agent.id, agent.id.0 as u32)).collect();
    let mut taken: BTreeSet<u32> = given.values().copied().collect();
    for agent in graph.agents().filter(|agent| !is_letter(agent.id.0)) {
        let letters = (b'a'..=b'z').skip(agent.id.0.min(25) as usize).filter(|byte| is_free(*byte)).map(u32::from);
        let free = letters.chain(256..).find(|partition| !taken.contains(partition));
        let partition = free.unwrap_or(u32::MAX);
        taken.insert(partition);
        given.insert(agent.id, partition);
    }
    given
}

/// What was kept of a record of theirs.
fn kept<'g>(graph: &'g SceneGraph, list: &str, id: &impl std::fmt::Display) -> Option<&'g Value> {
    graph.unknown_fields.get(&format!("{list}/{id}"))?.get(KEPT)
}

/// What was kept of a document of theirs.
fn kept_of_document<'g>(graph: &'g SceneGraph, name: &str) -> Option<&'g Value> {
    graph.unknown_fields.get("")?.get(KEPT)?.get(name)
}

/// Their ids of our nodes: letter and number, except where they had another or the number is too large.
struct Names {
    /// Lists of which something is kept.
    is_kept: BTreeSet<&'static str>,
    unusual: BTreeMap<(u8, u64), u64>,
    taken: HashSet<u64>,
    free: FreeIds,
}

/// Numbers that nobody has, from the last one down: no search starts anew.
#[derive(Default)]
struct FreeIds(BTreeMap<u8, u64>);

impl FreeIds {
    /// The wished id if it is free, else the last free one of the letter.
    fn take(&mut self, letter: u8, wish: Option<u64>, taken: &mut HashSet<u64>) -> u64 {
        let next = self.0.entry(letter).or_insert(MAX_INDEX);
        let mut id = wish.unwrap_or_else(|| symbol(letter, MAX_INDEX - 1));
        while !taken.insert(id) {
            *next -= 1;
            id = symbol(letter, *next);
        }
        id
    }
}

impl Names {
    fn of(graph: &SceneGraph) -> Names {
        let lists = ["objects", "places", "rooms", "buildings", "groups", "agents", "place_edges", "room_edges"];
        let has = |list: &&&str| {
            let start = format!("{list}/");
            graph.unknown_fields.range(start.clone()..).next().is_some_and(|(key, _)| key.starts_with(&start))
        };
        let is_kept: BTreeSet<&'static str> = lists.iter().filter(has).copied().collect();
        let mut names = Names { is_kept, unusual: BTreeMap::new(), taken: HashSet::new(), free: FreeIds::default() };
        let mut wishes: Vec<((u8, u64), Option<u64>)> = Vec::new();
        {
            let mut see = |letter: u8, list: &'static str, number: u64, id: &dyn std::fmt::Display| {
                let of_theirs = if names.is_kept.contains(list) { kept(graph, list, &id) } else { None };
                let wish = of_theirs.and_then(|kept| kept.get("id")?.as_u64());
                if wish.is_some() || number >= MAX_INDEX {
                    wishes.push(((letter, number), wish));
                } else {
                    names.taken.insert(symbol(letter, number));
                }
            };
            graph.objects.keys().for_each(|id| see(OBJECT, "objects", id.0, id));
            graph.places.keys().for_each(|id| see(PLACE, "places", id.0, id));
            graph.rooms.keys().for_each(|id| see(ROOM, "rooms", id.0, id));
            graph.buildings.keys().for_each(|id| see(BUILDING, "buildings", id.0, id));
            graph.groups.keys().for_each(|id| see(GROUP, "groups", id.0, id));
        }
        for ((letter, number), wish) in wishes {
            let id = names.free.take(letter, wish, &mut names.taken);
            names.unusual.insert((letter, number), id);
        }
        names
    }

    fn id(&self, letter: u8, number: u64) -> u64 {
        if self.unusual.is_empty() {
            return symbol(letter, number);
        }
        self.unusual.get(&(letter, number)).copied().unwrap_or_else(|| symbol(letter, number))
    }

    fn object(&self, id: ObjectId) -> u64 {
        self.id(OBJECT, id.0)
    }

    fn place(&self, id: PlaceId) -> u64 {
        self.id(PLACE, id.0)
    }

    fn room(&self, id: RoomId) -> u64 {
        self.id(ROOM, id.0)
    }

    fn building(&self, id: BuildingId) -> u64 {
        self.id(BUILDING, id.0)
    }

    fn group(&self, id: GroupId) -> u64 {
        self.id(GROUP, id.0)
    }
}

/// Numbers for labels: theirs where they gave one, else the next.
#[derive(Default)]
struct Labels {
    numbers: BTreeMap<String, u32>,
    /// Those that we gave.
    own: BTreeMap<String, u32>,
}

impl Labels {
    fn of(graph: &SceneGraph) -> Labels {
        let mut labels = Labels::default();
        let mut open = BTreeSet::new();
        for object in graph.objects() {
            // What they said of it while it was called so; nothing is also something.
            let theirs = kept(graph, "objects", &object.id).and_then(|kept| {
                let then = kept.get("instead_of")?.get("semantic_label")?.as_str()?;
                (then == object.label).then_some(kept.get("attributes")?.get("semantic_label")?)
            });
            let number = theirs.and_then(Value::as_u64).and_then(|number| u32::try_from(number).ok());
            if let Some(number) = number.filter(|number| *number != attributes::NO_LABEL) {
                labels.numbers.entry(object.label.clone()).or_insert(number);
            } else if theirs.is_none() {
                open.insert(object.label.clone());
            }
        }
        let mut next = labels.numbers.values().max().map_or(1, |most| most.saturating_add(1));
        for label in open {
            if !labels.numbers.contains_key(&label) {
                labels.numbers.insert(label.clone(), next);
                labels.own.insert(label, next);
                next = next.saturating_add(1);
            }
        }
        labels
    }
}

/// A place as most are.
#[derive(Serialize)]
struct PlainPlace {
    attributes: PlainPlaceAttributes,
    id: u64,
    layer: u8,
    partition: u8,
}

#[derive(Serialize)]
struct PlainPlaceAttributes {
    distance: f64,
    num_basis_points: u8,
    position: [f64; 3],
    r#type: &'static str,
}

/// An edge as most are.
#[derive(Serialize)]
struct PlainEdge {
    info: PlainInfo,
    source: u64,
    target: u64,
}

#[derive(Serialize)]
struct PlainInfo {
    r#type: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    weight: Option<f64>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    weighted: bool,
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
        write!(self.out, "],\"metadata\":{}", self.metadata())?;
        if let Some(mesh) = mesh {
            write!(self.out, ",\"mesh\":")?;
            crate::spark_mesh::write(mesh, self.out)?;
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
            let storeys =
                with_storeys(crate::room::Building { storeys: Vec::new(), ..building.clone() }, &rooms).storeys;
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
            let ids = self.pose_ids(id, partition);
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
        let attributes = PlainPlaceAttributes {
            distance: place.clearance_m,
            num_basis_points: place.basis_points,
            position: place.position.into(),
            r#type: "PlaceNodeAttributes",
        };
        self.record(&PlainPlace { attributes, id, layer: 3, partition: 0 })
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

    /// Their ids of a robot's poses.
    fn pose_ids(&self, id: AgentId, partition: u32) -> Vec<u64> {
        let of_poses = kept(self.graph, "agents", &id).and_then(|kept| kept.get("poses"));
        let count = self.graph.agents[&id].trajectory.len();
        let wish = |index: usize| {
            let of_pose = of_poses.and_then(|poses| poses.get(index.to_string()));
            of_pose.and_then(|kept| kept.get("id")?.as_u64()).unwrap_or_else(|| symbol(partition as u8, index as u64))
        };
        // The same each time it is asked: nodes and edges need them.
        let (mut free, mut taken) = (FreeIds::default(), HashSet::new());
        (0..count).map(|index| free.take(partition as u8, Some(wish(index)), &mut taken)).collect()
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
            let info = PlainInfo { r#type: "EdgeAttributes", weight: Some(edge.clearance_m), weighted: true };
            self.record(&PlainEdge { info, source, target })?;
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
        for (id, partition) in partitions(graph) {
            let ids = self.pose_ids(id, partition);
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
                let info = PlainInfo { r#type: "EdgeAttributes", weight: None, weighted: false };
                self.record(&PlainEdge { info, source, target })
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
                add_ours(&mut info, without(records::from_room_edge(edge), &["a", "b"]));
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
    fn is_middle(&self, edge: &crate::room::RoomEdge) -> bool {
        let middle = || nalgebra::center(&self.graph.rooms[&edge.a].center, &self.graph.rooms[&edge.b].center);
        edge.width_m == 0.0 && edge.doorway == middle()
    }

    // The document

    /// The graph's metadata, with what their document has no other place for.
    fn metadata(&self) -> Value {
        let graph = self.graph;
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
            let letter = char::from_u32(partition).filter(char::is_ascii_alphabetic);
            let usual = letter.map_or_else(|| format!("robot {partition}"), |letter| format!("robot {letter}"));
            if id.0 != u64::from(partition) || agent.name != usual || agent.trajectory.is_empty() {
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
        if !self.labels.own.is_empty() {
            ours.insert("labels".into(), json!(self.labels.own));
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

/// Puts what only we know into their open metadata.
fn add_ours(attributes: &mut Map<String, Value>, ours: Map<String, Value>) {
    let metadata = attributes.entry("metadata").or_insert_with(|| json!({}));
    if !metadata.is_object() {
        *metadata = json!({});
    }
    metadata[OURS] = Value::Object(ours);
}

fn without(mut record: Map<String, Value>, fields: &[&str]) -> Map<String, Value> {
    record.retain(|field, _| !fields.contains(&field.as_str()));
    record
}
