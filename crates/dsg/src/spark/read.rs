//! Reading spark_dsg: their nodes and edges become ours, one record at a time.

use std::collections::{BTreeMap, HashMap, HashSet};

use serde_json::{Map, Value, json};

use crate::agent::AgentPose;
use crate::check::{check_place, check_place_edge};
use crate::faults::Faults;
use crate::file::read_field;
use crate::graph::SceneGraph;
use crate::group::Group;
use crate::ids::{BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::load::{Cursor, JsonPath, LoadError};
use crate::object::Object;
use crate::place::PlaceEdge;
use crate::records;
use crate::relation::Relation;
use crate::room::{Building, Room, RoomEdge};
use crate::scan::Document;
use crate::spark::attributes::{self, place_edge_info, plain_info};
use crate::spark::kept::{KEPT, OURS, keep, keep_in_document};
use crate::spark::ours::{Beside, object_of_ours, room_edge_of_ours, room_of_ours, without_ours};
use crate::spark::plain::{EdgeText, PlaceText, plain};
use crate::spark::{BUILDING, GROUP, MAX_INDEX, OBJECT, PLACE, symbol};

/// Newest major version read.
const MAJOR: u64 = 1;

/// What a node of theirs is here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Object(ObjectId),
    Place(PlaceId),
    Room(RoomId),
    Building(BuildingId),
    Group(GroupId),
    /// A pose of the robot of that partition.
    Pose(u32),
    /// Without counterpart.
    Other,
}

impl Kind {
    /// Its layer there.
    fn layer(self) -> u8 {
        match self {
            Kind::Object(_) | Kind::Group(_) | Kind::Pose(_) => 2,
            Kind::Place(_) => 3,
            Kind::Room(_) => 4,
            Kind::Building(_) => 5,
            Kind::Other => 0,
        }
    }
}

/// Reads a document.
pub(crate) struct Import<'d, 't, 'f> {
    pub(super) document: &'d Document<'d>,
    pub(super) label_names: Option<&'t BTreeMap<u32, String>>,
    pub(super) faults: &'f mut Faults,
    pub(super) kinds: HashMap<u64, Kind>,
    pub(super) graph: SceneGraph,
    pub(super) objects: BTreeMap<ObjectId, Object>,
    /// Objects that we wrote ourselves: nothing about them is to be guessed.
    pub(super) ours: HashSet<ObjectId>,
    pub(super) our_buildings: HashSet<BuildingId>,
    pub(super) rooms: BTreeMap<RoomId, Room>,
    /// What they say of the rooms, until these have their names.
    pub(super) room_attributes: BTreeMap<RoomId, (u64, Map<String, Value>)>,
    pub(super) buildings: BTreeMap<BuildingId, Building>,
    pub(super) groups: BTreeMap<GroupId, Group>,
    pub(super) agents: BTreeMap<u32, Vec<Pose>>,
    pub(super) edges: HashSet<(u64, u64)>,
    /// Ways between rooms: theirs, with what we wrote into it.
    pub(super) room_pairs: BTreeMap<(RoomId, RoomId), Option<RoomEdge>>,
    pub(super) relations: Vec<Relation>,
    /// Edges between poses of one robot.
    pub(super) pose_edges: HashSet<(u64, u64)>,
    /// Nodes and edges without counterpart, as they stand.
    pub(super) other_nodes: Vec<Value>,
    pub(super) other_edges: Vec<Value>,
}

/// A pose of a robot.
pub(super) struct Pose {
    pub spark_id: u64,
    pub pose: AgentPose,
    pub kept: Option<Map<String, Value>>,
}

impl<'d, 't, 'f> Import<'d, 't, 'f> {
    pub fn new(
        document: &'d Document<'d>,
        label_names: Option<&'t BTreeMap<u32, String>>,
        faults: &'f mut Faults,
    ) -> Import<'d, 't, 'f> {
        Import {
            document,
            label_names,
            faults,
            kinds: HashMap::new(),
            graph: SceneGraph::new(),
            objects: BTreeMap::new(),
            ours: HashSet::new(),
            our_buildings: HashSet::new(),
            rooms: BTreeMap::new(),
            room_attributes: BTreeMap::new(),
            buildings: BTreeMap::new(),
            groups: BTreeMap::new(),
            agents: BTreeMap::new(),
            edges: HashSet::new(),
            room_pairs: BTreeMap::new(),
            relations: Vec::new(),
            pose_edges: HashSet::new(),
            other_nodes: Vec::new(),
            other_edges: Vec::new(),
        }
    }

    /// The graph of the document.
    pub fn run(mut self) -> Result<SceneGraph, LoadError> {
        self.check_header()?;
        let beside = self.read_metadata()?;
        let document = self.document;
        for name in ["nodes", "edges"] {
            if document.items(name).is_none() {
                self.faults.note(LoadError::Missing { path: JsonPath(format!("$.{name}")) })?;
            }
        }
        for (index, span) in document.items("nodes").unwrap_or_default().iter().enumerate() {
            let text = document.text(*span);
            if self.take_plain_place(text) {
                continue;
            }
            let result = document
                .parse(text)
                .and_then(|value| self.node(&Cursor::record(&value, "nodes", index), &value, &beside));
            if let Err(fault) = result {
                self.faults.note(fault)?;
            }
        }
        for (index, span) in document.items("edges").unwrap_or_default().iter().enumerate() {
            let text = document.text(*span);
            if self.take_plain_edge(text) {
                continue;
            }
            let result =
                document.parse(text).and_then(|value| self.edge(&Cursor::record(&value, "edges", index), &value));
            if let Err(fault) = result {
                self.faults.note(fault)?;
            }
        }
        self.build(beside)
    }

    fn check_header(&mut self) -> Result<(), LoadError> {
        let major = read_field(self.document, "SPARK_DSG_header", |c| c.get("version")?.get("major")?.u64())?;
        match major {
            Some(major) if major > MAJOR => Err(LoadError::NewerVersion { major, supported: MAJOR }),
            Some(_) if self.document.field("layer_keys").is_none() => {
                self.faults.note(LoadError::Missing { path: JsonPath("$.layer_keys".into()) })
            }
            _ => Ok(()),
        }
    }

    /// Takes a place of which there is nothing more to say; `false` leaves the node to the plain way.
    fn take_plain_place(&mut self, text: &[u8]) -> bool {
        let Some((spark_id, place)) = plain::<PlaceText>(text).and_then(PlaceText::place) else {
            return false;
        };
        if self.kinds.contains_key(&spark_id)
            || self.graph.places.contains_key(&place.id)
            || check_place(&place).is_err()
        {
            return false;
        }
        self.kinds.insert(spark_id, Kind::Place(place.id));
        self.graph.places.insert(place.id, place);
        true
    }

    fn node(&mut self, at: &Cursor, value: &Value, beside: &Beside) -> Result<(), LoadError> {
        let id_at = at.get("id")?;
        let spark_id = id_at.u64()?;
        let layer = at.get("layer")?.i64()?;
        let partition = at.find("partition").map_or(Ok(0), |c| c.u32())?;
        if self.kinds.contains_key(&spark_id) {
            return Err(at.duplicate());
        }
        let a = at.get("attributes")?;
        let node_type = a.get("type")?;
        let metadata = a.find("metadata");
        let ours = metadata.as_ref().and_then(|metadata| metadata.find(OURS));
        let ours = ours.as_ref();
        // The low 56 bits, or the id that we gave it. Two letters may share an index: the later node takes the next free one.
        let own_id = ours.and_then(|ours| ours.value.get("id")?.as_u64());
        let index = own_id.unwrap_or(spark_id & (MAX_INDEX - 1));
        let mut theirs = without_ours(a.map()?);
        let kind = match node_type.str()? {
            "ObjectNodeAttributes" | "KhronosObjectAttributes" => {
                let id = ObjectId(free(index, &self.objects, ObjectId, |id| id.0));
                let plain = attributes::object(id, &a, self.label_names)?;
                let object = match ours {
                    Some(record) => {
                        self.ours.insert(id);
                        object_of_ours(record, plain, &theirs)?
                    }
                    None => plain,
                };
                // A number that we gave stands for the word.
                let given = beside.labels.get(&object.label).copied();
                if given.is_some() && given == theirs.get("semantic_label").and_then(Value::as_u64) {
                    theirs.insert("semantic_label".into(), json!(object.label));
                }
                self.keep_node(
                    "objects",
                    &id,
                    spark_id,
                    symbol(OBJECT, id.0),
                    &theirs,
                    &attributes::object_attributes(&object),
                );
                self.objects.insert(id, object);
                Kind::Object(id)
            }
            "PlaceNodeAttributes" if partition == 0 && layer == 3 => {
                let id = PlaceId(free(index, &self.graph.places, PlaceId, |id| id.0));
                let place = attributes::place(id, &a)?;
                check_place(&place).map_err(|error| at.refused(error))?;
                self.keep_node(
                    "places",
                    &id,
                    spark_id,
                    symbol(PLACE, id.0),
                    &theirs,
                    &attributes::place_attributes(&place),
                );
                self.graph.places.insert(id, place);
                Kind::Place(id)
            }
            "RoomNodeAttributes" => {
                let id = RoomId(free(index, &self.rooms, RoomId, |id| id.0));
                let plain = attributes::room(id, &a)?;
                let room = match ours {
                    Some(record) => room_of_ours(record, plain, &theirs)?,
                    None => plain,
                };
                self.room_attributes.insert(id, (spark_id, theirs));
                self.rooms.insert(id, room);
                Kind::Room(id)
            }
            "SemanticNodeAttributes" if layer == 5 => {
                let id = BuildingId(free(index, &self.buildings, BuildingId, |id| id.0));
                let mut building = attributes::building(id, &a)?;
                if let Some(record) = ours {
                    building.storeys = records::building(record)?.storeys;
                    self.our_buildings.insert(id);
                }
                let own = attributes::building_attributes(&building);
                self.keep_node("buildings", &id, spark_id, symbol(BUILDING, id.0), &theirs, &own);
                self.buildings.insert(id, building);
                Kind::Building(id)
            }
            "SemanticNodeAttributes" if layer == 2 && partition == 1 => {
                let id = GroupId(free(index, &self.groups, GroupId, |id| id.0));
                let mut group = attributes::group(id, &a)?;
                if let Some(record) = ours {
                    group.support = record.find("support").map(|c| c.u64().map(ObjectId)).transpose()?;
                    group.room = record.find("room").map(|c| c.u64().map(RoomId)).transpose()?;
                }
                self.keep_node(
                    "groups",
                    &id,
                    spark_id,
                    symbol(GROUP, id.0),
                    &theirs,
                    &attributes::group_attributes(&group),
                );
                self.groups.insert(id, group);
                Kind::Group(id)
            }
            "AgentNodeAttributes" => {
                // Up to 1.0.x the robot is `prefix`; from 1.1.0 on it is the partition.
                let robot = at.find("prefix").map_or(Ok(partition), |c| c.u32())?;
                let pose = attributes::pose(&a, at)?;
                // In files up to 1.0.x the stamp is beside the attributes: it is not missing.
                theirs.entry("timestamp").or_insert_with(|| json!(pose.stamp_ns));
                let kept = keep(&theirs, &attributes::pose_attributes(&pose, spark_id));
                self.agents.entry(robot).or_default().push(Pose { spark_id, pose, kept });
                Kind::Pose(robot)
            }
            "NodeAttributes"
            | "SemanticNodeAttributes"
            | "PlaceNodeAttributes"
            | "Place2dNodeAttributes"
            | "TraversabilityNodeAttributes"
            | "TravNodeAttributes" => {
                self.other_nodes.push(value.clone());
                Kind::Other
            }
            _ => {
                return Err(LoadError::UnknownType { path: node_type.path() });
            }
        };
        self.kinds.insert(spark_id, kind);
        Ok(())
    }

    /// Keeps of a node what we would not write.
    pub(super) fn keep_node(
        &mut self,
        list: &str,
        id: &impl std::fmt::Display,
        spark_id: u64,
        usual_id: u64,
        theirs: &Map<String, Value>,
        ours: &Map<String, Value>,
    ) {
        let mut kept = keep(theirs, ours).unwrap_or_default();
        if spark_id != usual_id {
            kept.insert("id".into(), json!(spark_id));
        }
        self.keep_record(format!("{list}/{id}"), kept);
    }

    fn keep_record(&mut self, key: String, kept: Map<String, Value>) {
        if !kept.is_empty() {
            let record = self.graph.unknown_fields.entry(key).or_default();
            record.insert(KEPT.into(), Value::Object(kept));
        }
    }

    /// Takes an edge of which there is nothing more to say.
    fn take_plain_edge(&mut self, text: &[u8]) -> bool {
        let Some(EdgeText { source, target, info }) = plain(text) else {
            return false;
        };
        let pair = (source.min(target), source.max(target));
        let (Some(&a), Some(&b)) = (self.kinds.get(&source), self.kinds.get(&target)) else {
            return false;
        };
        if source == target || info.r#type != "EdgeAttributes" || !self.edges.insert(pair) {
            return false;
        }
        let taken = match (a, b) {
            (Kind::Place(a), Kind::Place(b)) => match info.weight {
                Some(clearance_m) if info.weighted && clearance_m >= 0.0 => {
                    let edge = PlaceEdge { a: a.min(b), b: a.max(b), clearance_m };
                    self.graph.place_edges.insert((edge.a, edge.b), edge);
                    true
                }
                _ => false,
            },
            _ if info.weighted || info.weight.is_some_and(|weight| weight != 1.0) => false,
            (Kind::Room(a), Kind::Place(b)) => self.put_into_room(b, a),
            (Kind::Place(a), Kind::Object(b)) => self.put_at_place(b, a),
            _ => false,
        };
        if !taken {
            self.edges.remove(&pair);
        }
        taken
    }

    /// Several parents are allowed there; the first stays.
    fn put_into_room(&mut self, place: PlaceId, room: RoomId) -> bool {
        let (Some(place), Some(parent)) = (self.graph.places.get_mut(&place), self.rooms.get_mut(&room)) else {
            return false;
        };
        let is_first = place.room.is_none();
        if is_first {
            place.room = Some(room);
            parent.places.push(place.id);
        }
        is_first
    }

    fn put_at_place(&mut self, object: ObjectId, place: PlaceId) -> bool {
        let Some(object) = self.objects.get_mut(&object) else {
            return false;
        };
        let is_first = object.place.is_none();
        object.place = object.place.or(Some(place));
        is_first
    }

    fn edge(&mut self, at: &Cursor, value: &Value) -> Result<(), LoadError> {
        let (source_at, target_at) = (at.get("source")?, at.get("target")?);
        let (source, target) = (source_at.u64()?, target_at.u64()?);
        let a = *self.kinds.get(&source).ok_or_else(|| source_at.dangling(source))?;
        let b = *self.kinds.get(&target).ok_or_else(|| target_at.dangling(target))?;
        let pair = (source.min(target), source.max(target));
        if source == target || self.edges.contains(&pair) {
            return Err(at.duplicate());
        }
        let info_at = at.get("info")?;
        let theirs = without_ours(info_at.map()?);
        let metadata = info_at.find("metadata");
        let ours = metadata.as_ref().and_then(|metadata| metadata.find(OURS));
        // Children first: the larger layer is the parent.
        let (child, parent) = if a.layer() <= b.layer() { (a, b) } else { (b, a) };
        let is_structure = match (child, parent) {
            (Kind::Place(a), Kind::Place(b)) => {
                let is_weighted = info_at.find("weighted").map_or(Ok(false), |c| c.bool())?;
                let least = self.graph.places[&a].clearance_m.min(self.graph.places[&b].clearance_m);
                let clearance_m = match info_at.find("weight") {
                    Some(weight) if is_weighted => weight.f64()?.max(0.0),
                    _ => least,
                };
                let edge = PlaceEdge { a: a.min(b), b: a.max(b), clearance_m };
                check_place_edge(&edge).map_err(|error| at.refused(error))?;
                let kept = keep(&theirs, &place_edge_info(&edge)).unwrap_or_default();
                self.keep_record(format!("place_edges/{}-{}", edge.a, edge.b), kept);
                self.graph.place_edges.insert((edge.a, edge.b), edge);
                self.edges.insert(pair);
                return Ok(());
            }
            (Kind::Object(object), Kind::Place(place)) => self.put_at_place(object, place),
            (Kind::Place(place), Kind::Room(room)) => self.put_into_room(place, room),
            (Kind::Room(a), Kind::Room(b)) => {
                let way = ours.as_ref().map(|ours| room_edge_of_ours(ours, a, b)).transpose()?;
                self.room_pairs.insert((a.min(b), a.max(b)), way);
                let kept = keep(&theirs, &plain_info()).unwrap_or_default();
                self.keep_record(format!("room_edges/{}-{}", a.min(b), a.max(b)), kept);
                self.edges.insert(pair);
                return Ok(());
            }
            (Kind::Room(room), Kind::Building(building)) => self.buildings.get_mut(&building).is_some_and(|building| {
                building.rooms.push(room);
                true
            }),
            (Kind::Object(object), Kind::Group(group)) | (Kind::Group(group), Kind::Object(object)) => {
                self.groups.get_mut(&group).is_some_and(|group| {
                    group.members.push(object);
                    true
                })
            }
            (Kind::Object(_), Kind::Object(_)) => {
                if let Some(list) = ours.as_ref().and_then(|ours| ours.find("relations")) {
                    for relation in list.items()? {
                        self.relations.push(records::relation(&relation)?);
                    }
                }
                // An edge that says nothing but our relations comes again with them.
                ours.is_some() && keep(&theirs, &plain_info()).is_none()
            }
            (Kind::Pose(a), Kind::Pose(b)) if a == b => {
                self.pose_edges.insert(pair);
                true
            }
            _ => false,
        };
        self.edges.insert(pair);
        let is_plain = keep(&theirs, &plain_info()).is_none();
        if !(is_structure && is_plain) {
            let mut record = value.clone();
            if let Value::Object(record) = &mut record {
                record.insert("info".into(), Value::Object(theirs));
                if is_structure {
                    record.insert("structure".into(), Value::Bool(true));
                }
            }
            self.other_edges.push(record);
        }
        Ok(())
    }

    /// Metadata of the graph: theirs is ours, except what we wrote into it.
    fn read_metadata(&mut self) -> Result<Beside, LoadError> {
        let value = match self.document.field("metadata").map(|text| self.document.parse(text)) {
            Some(Ok(value)) => value,
            Some(Err(fault)) => return self.faults.note(fault).map(|()| Beside::default()),
            None => return Ok(Beside::default()),
        };
        match value {
            Value::Object(mut map) => {
                let ours = map.remove(OURS);
                self.graph.metadata = map;
                let graph = &mut self.graph;
                let beside = ours.map(|ours| Beside::read(&Cursor::field(&ours, "metadata"), graph)).transpose();
                beside.or_else(|fault| self.faults.instead(fault)).map(Option::unwrap_or_default)
            }
            Value::Null => Ok(Beside::default()),
            // Theirs may be any JSON.
            other => {
                keep_in_document(&mut self.graph, "metadata", other);
                Ok(Beside::default())
            }
        }
    }
}

/// The index, or one that no node has yet.
fn free<K: Ord + Copy, V>(
    index: u64,
    nodes: &BTreeMap<K, V>,
    id: impl Fn(u64) -> K,
    index_of: impl Fn(K) -> u64,
) -> u64 {
    if !nodes.contains_key(&id(index)) {
        return index;
    }
    let last = nodes.last_key_value().map_or(0, |(id, _)| index_of(*id));
    last.checked_add(1).unwrap_or_else(|| {
        (0..=u64::MAX).find(|index| !nodes.contains_key(&id(*index))).expect("2^64 nodes do not fit into a file")
    })
}
