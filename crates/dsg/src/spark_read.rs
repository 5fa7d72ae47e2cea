//! Reading spark_dsg: their nodes and edges become ours, one record at a time.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use nalgebra::Point3;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::agent::{Agent, AgentPose};
use crate::check::{check_place, check_place_edge};
use crate::faults::Faults;
use crate::file::read_field;
use crate::graph::SceneGraph;
use crate::group::Group;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::load::{Cursor, JsonPath, LoadError};
use crate::object::Object;
use crate::op::Op;
use crate::place::{Place, PlaceEdge};
use crate::records;
use crate::relation::Relation;
use crate::room::{Building, Room, RoomEdge, Storey};
use crate::rooms::{RoomConfig, name_rooms};
use crate::scan::Document;
use crate::spark::{BUILDING, GROUP, MAX_INDEX, OBJECT, PLACE, ROOM, symbol};
use crate::spark_attributes as attributes;
use crate::spark_kept::{KEPT, OURS, is_same, keep};

/// Newest major version read.
const MAJOR: u64 = 1;

/// What a node of theirs is here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
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

/// A place as most are: nothing in it but what we have fields for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainPlace<'a> {
    id: u64,
    layer: u8,
    #[serde(default)]
    partition: u32,
    #[serde(borrow)]
    attributes: PlainPlaceAttributes<'a>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainPlaceAttributes<'a> {
    r#type: &'a str,
    position: [f64; 3],
    distance: f64,
    num_basis_points: u8,
    #[serde(default)]
    active_frontier: bool,
    #[serde(default)]
    anti_frontier: bool,
    #[serde(default)]
    is_active: bool,
    #[serde(default)]
    is_predicted: bool,
    #[serde(default)]
    need_cleanup: bool,
    #[serde(default)]
    real_place: Option<bool>,
    #[serde(default)]
    last_update_time_ns: u64,
    #[serde(default)]
    num_frontier_voxels: u32,
    #[serde(default)]
    name: &'a str,
    #[serde(default)]
    semantic_label: Option<u32>,
    #[serde(default, rename = "color")]
    _color: Option<Black>,
    #[serde(default, rename = "bounding_box")]
    bounds: Option<NoBox<'a>>,
    #[serde(default, rename = "semantic_feature")]
    _feature: Option<NoFeature>,
    #[serde(default)]
    orientation: Option<Turn>,
    #[serde(default)]
    frontier_scale: [f64; 3],
    #[serde(default, rename = "metadata")]
    _metadata: Option<NoFields>,
    #[serde(default, rename = "deformation_connections")]
    _deformation: Option<[u8; 0]>,
    #[serde(default, rename = "mesh_vertex_labels")]
    _labels: Option<[u8; 0]>,
    #[serde(default, rename = "pcl_mesh_connections")]
    _pcl: Option<[u8; 0]>,
    #[serde(default, rename = "voxblox_mesh_connections")]
    _voxblox: Option<[u8; 0]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoFields {}

#[derive(Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Black {
    r: u8,
    g: u8,
    b: u8,
    a: u8,
}

#[derive(Deserialize)]
struct NoBox<'a> {
    #[serde(borrow)]
    r#type: &'a str,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoFeature {
    rows: u32,
    #[serde(rename = "cols")]
    _cols: u32,
    #[serde(rename = "data")]
    _data: (),
}

#[derive(Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Turn {
    w: f64,
    x: f64,
    y: f64,
    z: f64,
}

impl PlainPlace<'_> {
    /// The place, if there is nothing more to it.
    fn place(self) -> Option<(u64, Place)> {
        let a = self.attributes;
        let is_plain = self.layer == 3
            && self.partition == 0
            && a.r#type == "PlaceNodeAttributes"
            && !(a.anti_frontier || a.is_active || a.is_predicted || a.need_cleanup)
            && a.active_frontier == (a.num_frontier_voxels > 0)
            && a.real_place.is_none_or(|real| real)
            && a.last_update_time_ns == 0
            && a.name.is_empty()
            && a.semantic_label.is_none_or(|label| label == attributes::NO_LABEL)
            && a._color.is_none_or(|color| color == Black { r: 0, g: 0, b: 0, a: 255 })
            && a.bounds.is_none_or(|bounds| bounds.r#type == "INVALID")
            && a._feature.is_none_or(|feature| feature.rows == 0)
            && a.orientation.is_none_or(|turn| turn == Turn { w: 1.0, x: 0.0, y: 0.0, z: 0.0 })
            && a.frontier_scale == [0.0; 3]
            && a.distance >= 0.0
            && self.id >> 56 == u64::from(PLACE);
        let place = Place {
            id: PlaceId(self.id & (MAX_INDEX - 1)),
            position: Point3::from(a.position),
            clearance_m: a.distance,
            basis_points: a.num_basis_points,
            frontier_cells: a.num_frontier_voxels,
            room: None,
        };
        is_plain.then_some((self.id, place))
    }
}

/// An edge as most are.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainEdge<'a> {
    source: u64,
    target: u64,
    #[serde(borrow)]
    info: PlainInfo<'a>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainInfo<'a> {
    r#type: &'a str,
    #[serde(default)]
    weighted: bool,
    #[serde(default)]
    weight: Option<f64>,
    #[serde(default, rename = "metadata")]
    _metadata: Option<NoFields>,
}

/// A record as most are, or nothing. The text is checked once as a whole, not string by string.
fn plain<'a, T: Deserialize<'a>>(text: &'a [u8]) -> Option<T> {
    serde_json::from_str(std::str::from_utf8(text).ok()?).ok()
}

/// Reads a document.
pub(crate) struct Import<'d, 't, 'f> {
    document: &'d Document<'d>,
    label_names: Option<&'t BTreeMap<u32, String>>,
    faults: &'f mut Faults,
    kinds: HashMap<u64, Kind>,
    graph: SceneGraph,
    objects: BTreeMap<ObjectId, Object>,
    /// Objects that we wrote ourselves: nothing about them is to be guessed.
    ours: HashSet<ObjectId>,
    our_buildings: HashSet<BuildingId>,
    rooms: BTreeMap<RoomId, Room>,
    /// What they say of the rooms, until these have their names.
    room_attributes: BTreeMap<RoomId, (u64, Map<String, Value>)>,
    buildings: BTreeMap<BuildingId, Building>,
    groups: BTreeMap<GroupId, Group>,
    agents: BTreeMap<u32, Vec<Pose>>,
    edges: HashSet<(u64, u64)>,
    /// Ways between rooms: theirs, with what we wrote into it.
    room_pairs: BTreeMap<(RoomId, RoomId), Option<RoomEdge>>,
    relations: Vec<Relation>,
    /// Edges between poses of one robot.
    pose_edges: HashSet<(u64, u64)>,
    /// Nodes and edges without counterpart, as they stand.
    other_nodes: Vec<Value>,
    other_edges: Vec<Value>,
}

struct Pose {
    spark_id: u64,
    pose: AgentPose,
    kept: Option<Map<String, Value>>,
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
            if self.is_plain_place(text) {
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
            if self.is_plain_edge(text) {
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
    fn is_plain_place(&mut self, text: &[u8]) -> bool {
        let Some((spark_id, place)) = plain::<PlainPlace>(text).and_then(PlainPlace::place) else {
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
        let ours = a.find("metadata").and_then(|metadata| metadata.value.get(OURS));
        // The low 56 bits, or the id that we gave it. Two letters may share an index: the later node takes the next free one.
        let index = ours.and_then(|ours| ours.get("id")?.as_u64()).unwrap_or(spark_id & (MAX_INDEX - 1));
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
                    building.storeys = building_of_ours(record, id)?.storeys;
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
                    group.support = record.get("support").and_then(Value::as_u64).map(ObjectId);
                    group.room = record.get("room").and_then(Value::as_u64).map(RoomId);
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
    fn keep_node(
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
    fn is_plain_edge(&mut self, text: &[u8]) -> bool {
        let Some(PlainEdge { source, target, info }) = plain(text) else {
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
        let no_info = Value::Object(Map::new());
        let info = at.find("info").map_or(&no_info, |info| info.value);
        let info_at = Cursor::field(info, "info");
        let ours = info.get("metadata").and_then(|metadata| metadata.get(OURS));
        let theirs = without_ours(info_at.map()?);
        // Children first: the larger layer is the parent.
        let (child, parent) = if a.layer() <= b.layer() { (a, b) } else { (b, a) };
        let is_structure = match (child, parent) {
            (Kind::Place(a), Kind::Place(b)) => {
                let is_weighted =
                    at.find("info").and_then(|c| c.find("weighted").map(|c| c.bool())).unwrap_or(Ok(false))?;
                let least = self.graph.places[&a].clearance_m.min(self.graph.places[&b].clearance_m);
                let clearance_m = match at.find("info").and_then(|c| c.find("weight").map(|c| c.f64())) {
                    Some(weight) if is_weighted => weight?.max(0.0),
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
                let way = ours.map(|ours| room_edge_of_ours(ours, a, b)).transpose()?;
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
                if let Some(list) = ours.and_then(|ours| ours.get("relations")) {
                    let list_at = Cursor::field(list, "edges");
                    for relation in list_at.items()? {
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

    /// The graph. What it refuses is reported at the root: every single record was read before.
    fn build(mut self, beside: Beside) -> Result<SceneGraph, LoadError> {
        let refused = |source| LoadError::Refused { path: JsonPath("$".into()), source };
        for room in self.rooms.values_mut() {
            room.places.sort_unstable();
        }
        let rooms = self.named_rooms();
        self.keep_rooms(&rooms);
        let mut graph = std::mem::take(&mut self.graph);
        // Rooms own the membership: it comes back with them.
        graph.places.values_mut().for_each(|place| place.room = None);
        graph.index_place_edges();
        for room in &rooms {
            for place in &room.places {
                if let Some(place) = graph.places.get_mut(place) {
                    place.room = Some(room.id);
                }
            }
        }
        for room in rooms.iter().cloned() {
            graph
                .apply(Op::PutRoom(Box::new(room)))
                .or_else(|error| self.faults.note(refused(error)).map(|()| nothing()))?;
        }
        // A graph with a history is ours: it says which ways it has.
        let mut ops = self.ways(&mut graph, beside.revision == 0);
        for building in std::mem::take(&mut self.buildings).into_values() {
            let is_ours = self.our_buildings.contains(&building.id);
            ops.push(Op::PutBuilding(Box::new(if is_ours { building } else { with_storeys(building, &rooms) })));
        }
        let along_x = AlongX::of(&graph);
        for mut object in std::mem::take(&mut self.objects).into_values() {
            if object.place.is_none()
                && !self.ours.contains(&object.id)
                && let Some(nearest) = along_x.nearest(&object.centroid)
            {
                object.place = Some(nearest);
                let record = graph.unknown_fields.entry(format!("objects/{}", object.id)).or_default();
                put_kept(record, "inferred_place", json!(nearest));
            }
            object.room = object.room.filter(|room| graph.room(*room).is_some());
            if !self.ours.contains(&object.id) {
                object.room = graph.place(object.place.unwrap_or(PlaceId(u64::MAX))).and_then(|place| place.room);
            }
            ops.push(Op::PutObject(Box::new(object)));
        }
        for op in ops {
            graph.apply(op).or_else(|error| self.faults.note(refused(error)).map(|()| nothing()))?;
        }
        let mut ops = Vec::new();
        for mut group in std::mem::take(&mut self.groups).into_values() {
            group.support = group.support.filter(|support| group.members.contains(support));
            group.room = group.room.filter(|room| graph.room(*room).is_some());
            if group.members.len() >= 2 {
                ops.push(Op::PutGroup(Box::new(group)));
            }
        }
        ops.extend(std::mem::take(&mut self.relations).into_iter().map(Op::PutRelation));
        ops.extend(beside.dropped_relations.into_iter().map(Op::PutRelation));
        for (robot, poses) in std::mem::take(&mut self.agents) {
            ops.push(Op::PutAgent(Box::new(self.agent(&mut graph, robot, poses, &beside.agents))));
        }
        let without_pose = |id: &u64| graph.agent(AgentId(*id)).is_none();
        let mut lonely: Vec<(u64, String)> = beside.agents.into_values().filter(|(id, _)| without_pose(id)).collect();
        lonely.sort();
        for (id, name) in lonely {
            let is_put = ops.iter().any(|op| matches!(op, Op::PutAgent(agent) if agent.id.0 == id));
            if !is_put {
                ops.push(Op::PutAgent(Box::new(Agent { id: AgentId(id), name, trajectory: Vec::new() })));
            }
        }
        for op in ops {
            graph.apply(op).or_else(|error| self.faults.note(refused(error)).map(|()| nothing()))?;
        }
        self.keep_document(&mut graph);
        graph.revision = beside.revision;
        if let Some(next) = beside.next {
            graph.next.object = graph.next.object.max(next.object);
            graph.next.room = graph.next.room.max(next.room);
            graph.next.group = graph.next.group.max(next.group);
        }
        graph.clear_log();
        Ok(graph)
    }

    /// Rooms with their names; what is kept of each is known only now.
    fn named_rooms(&mut self) -> Vec<Room> {
        let mut rooms: Vec<Room> = std::mem::take(&mut self.rooms).into_values().collect();
        // They allow two rooms of one name.
        let mut taken: BTreeSet<String> = BTreeSet::new();
        for room in rooms.iter_mut().filter(|room| room.is_user_named) {
            let numbered = (2..).map(|n| format!("{} {n}", room.name));
            let name = std::iter::once(room.name.clone()).chain(numbered).find(|name| !taken.contains(name));
            room.name = name.expect("there is always a next number");
            taken.insert(room.name.clone());
        }
        name_rooms(&mut rooms, &RoomConfig::default());
        rooms
    }

    fn keep_rooms(&mut self, rooms: &[Room]) {
        let mut theirs = std::mem::take(&mut self.room_attributes);
        for room in rooms {
            if let Some((spark_id, theirs)) = theirs.remove(&room.id) {
                let own = attributes::room_attributes(room);
                self.keep_node("rooms", &room.id, spark_id, symbol(ROOM, room.id.0), &theirs, &own);
            }
        }
    }

    /// One way per pair of rooms that an edge joins.
    fn ways(&mut self, graph: &mut SceneGraph, is_to_infer: bool) -> Vec<Op> {
        let mut ways = crossings(graph);
        if !is_to_infer {
            ways.retain(|pair, _| self.room_pairs.contains_key(pair));
        }
        let mut theirs = BTreeSet::new();
        for (pair, way) in std::mem::take(&mut self.room_pairs) {
            let (Some(a), Some(b)) = (graph.room(pair.0), graph.room(pair.1)) else {
                continue;
            };
            let unknown =
                RoomEdge { a: pair.0, b: pair.1, doorway: nalgebra::center(&a.center, &b.center), width_m: 0.0 };
            let known = way.or_else(|| ways.remove(&pair)).unwrap_or(unknown);
            ways.insert(pair, known);
            theirs.insert(pair);
        }
        // Ways that they have no edge for.
        for pair in ways.keys().filter(|pair| !theirs.contains(pair)) {
            let record = graph.unknown_fields.entry(format!("room_edges/{}-{}", pair.0, pair.1)).or_default();
            record.insert(KEPT.into(), json!({ "inferred": true }));
        }
        ways.into_values().map(Op::PutRoomEdge).collect()
    }

    /// A robot's poses by time, and what is kept of them.
    fn agent(
        &self,
        graph: &mut SceneGraph,
        robot: u32,
        mut poses: Vec<Pose>,
        names: &BTreeMap<u32, (u64, String)>,
    ) -> Agent {
        poses.sort_by_key(|pose| pose.pose.stamp_ns);
        let letter = char::from_u32(robot).filter(char::is_ascii_alphabetic);
        let name = letter.map_or_else(|| format!("robot {robot}"), |letter| format!("robot {letter}"));
        let (id, name) = names.get(&robot).cloned().unwrap_or((u64::from(robot), name));
        let mut kept = Map::new();
        let mut of_poses = Map::new();
        for (index, pose) in poses.iter().enumerate() {
            let mut of_pose = pose.kept.clone().unwrap_or_default();
            if pose.spark_id != symbol(robot as u8, index as u64) {
                of_pose.insert("id".into(), json!(pose.spark_id));
            }
            if !of_pose.is_empty() {
                of_poses.insert(index.to_string(), Value::Object(of_pose));
            }
        }
        if !of_poses.is_empty() {
            kept.insert("poses".into(), Value::Object(of_poses));
        }
        let pair = |i: usize| {
            let (a, b) = (poses[i - 1].spark_id, poses[i].spark_id);
            (a.min(b), a.max(b))
        };
        let apart: Vec<usize> = (1..poses.len()).filter(|i| !self.pose_edges.contains(&pair(*i))).collect();
        if !apart.is_empty() {
            kept.insert("apart".into(), json!(apart));
        }
        // Edges that skip poses.
        let chain: HashSet<(u64, u64)> = (1..poses.len()).map(pair).collect();
        let ids: HashSet<u64> = poses.iter().map(|pose| pose.spark_id).collect();
        let mut other: Vec<&(u64, u64)> =
            self.pose_edges.iter().filter(|edge| ids.contains(&edge.0) && !chain.contains(edge)).collect();
        other.sort_unstable();
        if !other.is_empty() {
            kept.insert("edges".into(), json!(other));
        }
        let id = AgentId(id);
        if !kept.is_empty() {
            let record = graph.unknown_fields.entry(format!("agents/{id}")).or_default();
            record.insert(KEPT.into(), Value::Object(kept));
        }
        Agent { id, name, trajectory: poses.into_iter().map(|pose| pose.pose).collect() }
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

    fn keep_document(&mut self, graph: &mut SceneGraph) {
        let (nodes, edges) = (std::mem::take(&mut self.other_nodes), std::mem::take(&mut self.other_edges));
        if !nodes.is_empty() {
            keep_in_document(graph, "nodes", Value::Array(nodes));
        }
        if !edges.is_empty() {
            keep_in_document(graph, "edges", Value::Array(edges));
        }
        let field = |name| self.document.field(name).and_then(|text| self.document.parse(text).ok());
        if let Some(names) =
            field("layer_names").filter(|names| !is_same(names, &crate::spark_write::layer_names(false)))
            && !is_same(&names, &crate::spark_write::layer_names(true))
            && names.as_object().is_some_and(|names| names.values().all(Value::is_object))
        {
            keep_in_document(graph, "layer_names", names);
        }
        let written = crate::spark_write::layer_keys(graph);
        if let Some(Value::Array(mut keys)) = field("layer_keys") {
            keys.retain(|key| key.is_object() && !written.iter().any(|own| is_same(own, key)));
            if !keys.is_empty() {
                keep_in_document(graph, "layer_keys", Value::Array(keys));
            }
        }
    }
}

/// Keeps a value of theirs beside the lists.
fn keep_in_document(graph: &mut SceneGraph, name: &str, value: Value) {
    put_kept(graph.unknown_fields.entry(String::new()).or_default(), name, value);
}

/// Keeps a value of theirs in a record.
fn put_kept(record: &mut Map<String, Value>, name: &str, value: Value) {
    let kept = record.entry(KEPT).or_insert_with(|| json!({}));
    if !kept.is_object() {
        *kept = json!({});
    }
    kept[name] = value;
}

/// Places by their x, to find the nearest without looking at all.
struct AlongX(Vec<(Point3<f64>, PlaceId)>);

impl AlongX {
    fn of(graph: &SceneGraph) -> AlongX {
        let mut places: Vec<(Point3<f64>, PlaceId)> = graph.places().map(|place| (place.position, place.id)).collect();
        places.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
        AlongX(places)
    }

    /// As [`SceneGraph::place_nearest`] finds it.
    fn nearest(&self, point: &Point3<f64>) -> Option<PlaceId> {
        let middle = self.0.partition_point(|(at, _)| at.x < point.x);
        let mut best: Option<(f64, PlaceId)> = None;
        let mut look = |(at, id): &(Point3<f64>, PlaceId)| {
            let squared = (at - point).norm_squared();
            if best.is_none_or(|(least, known)| (squared, *id) < (least, known)) {
                best = Some((squared, *id));
            }
            // Farther along x nothing can be nearer.
            (at.x - point.x).powi(2) <= best.map_or(f64::INFINITY, |(least, _)| least)
        };
        let (before, after) = self.0.split_at(middle);
        // `all` ends where the look says so; whether it did is of no interest.
        let _ = before.iter().rev().all(&mut look);
        let _ = after.iter().all(&mut look);
        best.map(|(_, id)| id)
    }
}

fn nothing() -> crate::op::Event {
    crate::op::Event { revision: 0, changes: [].into() }
}

/// What we write beside the nodes, into the metadata of their graph.
#[derive(Default)]
struct Beside {
    revision: u64,
    next: Option<crate::graph::NextIds>,
    /// By partition: id and name.
    agents: BTreeMap<u32, (u64, String)>,
    dropped_relations: Vec<Relation>,
    /// Numbers that we gave to labels.
    labels: BTreeMap<String, u64>,
}

impl Beside {
    fn read(at: &Cursor, graph: &mut SceneGraph) -> Result<Beside, LoadError> {
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

/// Their attributes without what is ours in the metadata.
fn without_ours(theirs: &Map<String, Value>) -> Map<String, Value> {
    let mut theirs = theirs.clone();
    if let Some(Value::Object(metadata)) = theirs.get_mut("metadata") {
        metadata.remove(OURS);
    }
    theirs
}

/// The object that we wrote, as far as theirs still says the same.
fn object_of_ours(record: &Value, plain: Object, theirs: &Map<String, Value>) -> Result<Object, LoadError> {
    let record = with_id(record, plain.id.0);
    let ours = records::object(&Cursor::field(&record, "omni_dsg"))?;
    let written = attributes::object_attributes(&ours);
    let still = |field: &str| match (written.get(field), theirs.get(field)) {
        (Some(a), Some(b)) => is_same(a, b),
        (a, b) => a.is_none() && b.is_none_or(|b| is_same(b, &json!({ "r": 0, "g": 0, "b": 0, "a": 255 }))),
    };
    let mut object = Object { metadata: plain.metadata, place: None, group: None, ..ours };
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
fn room_of_ours(record: &Value, plain: Room, theirs: &Map<String, Value>) -> Result<Room, LoadError> {
    let record = with_id(record, plain.id.0);
    let ours = records::room(&Cursor::field(&record, "omni_dsg"))?;
    let written = attributes::room_attributes(&ours);
    let still = |field: &str| written.get(field).zip(theirs.get(field)).is_some_and(|(a, b)| is_same(a, b));
    let mut room = Room { metadata: plain.metadata, places: Vec::new(), ..ours };
    if !still("position") {
        room.center = plain.center;
    }
    if !still("name") {
        (room.name, room.is_user_named) = (plain.name, plain.is_user_named);
    }
    Ok(room)
}

fn building_of_ours(record: &Value, id: BuildingId) -> Result<Building, LoadError> {
    let record = with_id(record, id.0);
    records::building(&Cursor::field(&record, "omni_dsg"))
}

fn room_edge_of_ours(record: &Value, a: RoomId, b: RoomId) -> Result<RoomEdge, LoadError> {
    let mut record = record.clone();
    if let Value::Object(record) = &mut record {
        record.insert("a".into(), json!(a));
        record.insert("b".into(), json!(b));
    }
    records::room_edge(&Cursor::field(&record, "omni_dsg"))
}

fn with_id(record: &Value, id: u64) -> Value {
    let mut record = record.clone();
    if let Value::Object(record) = &mut record {
        record.insert("id".into(), json!(id));
    }
    record
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

/// For every two rooms that an edge between places joins: the middle of the widest such edge.
pub(crate) fn crossings(graph: &SceneGraph) -> BTreeMap<(RoomId, RoomId), RoomEdge> {
    let mut ways: BTreeMap<(RoomId, RoomId), RoomEdge> = BTreeMap::new();
    for edge in graph.place_edges() {
        let (from, to) = (&graph.places[&edge.a], &graph.places[&edge.b]);
        let (Some(a), Some(b)) = (from.room, to.room) else {
            continue;
        };
        if a == b {
            continue;
        }
        let doorway = nalgebra::center(&from.position, &to.position);
        let way = RoomEdge { a: a.min(b), b: a.max(b), doorway, width_m: 2.0 * edge.clearance_m };
        let widest = ways.entry((way.a, way.b)).or_insert(way);
        if way.width_m > widest.width_m {
            *widest = way;
        }
    }
    ways
}

/// Without storeys of its own a building has one.
pub(crate) fn with_storeys(mut building: Building, rooms: &[Room]) -> Building {
    let heights: Vec<f64> =
        rooms.iter().filter(|room| building.rooms.contains(&room.id)).map(|room| room.center.z).collect();
    if building.storeys.is_empty() && !heights.is_empty() {
        let height_m = heights.iter().sum::<f64>() / heights.len() as f64;
        building.storeys = vec![Storey { floor: 0, height_m, rooms: heights.len() as u32 }];
    }
    building
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
