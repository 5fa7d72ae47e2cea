//! Reads scene graphs that spark_dsg wrote (JSON, versions 1.0.0 and 1.1.x).
//!
//! Node ids there are 64 bits: a letter in the top 8 and an index in the rest. Here the kind of node is a type, so an object
//! `O(12)` becomes O12. Their layers map one to one; agents become trajectories; an edge between places carries its clearance
//! as the weight; where they have no doorway we take the widest crossing between two rooms. Oriented boxes become the
//! axis-aligned boxes around them. What has no counterpart here (2-D places, traversability) is counted in the
//! graph's metadata under `spark_skipped_nodes`.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, UnitQuaternion};
use serde_json::{Value, json};

use crate::agent::{Agent, AgentPose};
use crate::graph::SceneGraph;
use crate::group::Group;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::load::{Cursor, LoadError, parse};
use crate::object::Object;
use crate::op::Op;
use crate::place::{Place, PlaceEdge};
use crate::room::{Building, Room, RoomEdge, Storey};
use crate::rooms::{RoomConfig, name_rooms};
use crate::spark_attributes::{bounds, building, color, group, is_symbol, place, position, room, without_number};

/// Newest major version read.
const MAJOR: u64 = 1;
/// The label that says "none".
const NO_LABEL: u32 = u32::MAX;

/// A scene graph from spark_dsg JSON. Objects are called by `label_names`, else by their name there, else "label 11".
///
/// # Errors
/// Every fault of the text, a node or an edge, with its JSON path. Never a panic, whatever the bytes.
pub fn read_spark_dsg(bytes: &[u8], label_names: Option<&BTreeMap<u32, String>>) -> Result<SceneGraph, LoadError> {
    let value = parse(bytes)?;
    let root = Cursor::root(&value);
    check_header(&root)?;
    let mut import = Import { label_names, ..Import::default() };
    for node in root.get("nodes")?.items()? {
        import.node(&node)?;
    }
    for edge in root.get("edges")?.items()? {
        import.edge(&edge)?;
    }
    let mut graph = import.build(&root)?;
    if let Some(metadata) = root.find("metadata") {
        // theirs may be any JSON
        match metadata.value {
            Value::Object(map) => graph.metadata.extend(map.clone()),
            other => drop(graph.metadata.insert("spark_metadata".into(), other.clone())),
        }
    }
    graph.clear_log();
    Ok(graph)
}

/// Without a header it is 1.0.0, which has `layer_ids`.
fn check_header(root: &Cursor) -> Result<(), LoadError> {
    root.map()?;
    match root.find("SPARK_DSG_header") {
        Some(header) => {
            let major = header.get("version")?.get("major")?.u64()?;
            if major > MAJOR {
                return Err(LoadError::NewerVersion { major, supported: MAJOR });
            }
            root.get("layer_keys").map(drop)
        }
        None if root.find("layer_ids").is_some() => Ok(()),
        None => Err(LoadError::Schema { path: root.path() }),
    }
}

/// What a node of theirs is here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Object(ObjectId),
    Place(PlaceId),
    Room(RoomId),
    Building(BuildingId),
    Group(GroupId),
    Pose,
    Skipped,
}

#[derive(Default)]
struct Import<'t> {
    label_names: Option<&'t BTreeMap<u32, String>>,
    kinds: BTreeMap<u64, Kind>,
    objects: BTreeMap<ObjectId, Object>,
    places: BTreeMap<PlaceId, Place>,
    rooms: BTreeMap<RoomId, Room>,
    buildings: BTreeMap<BuildingId, Building>,
    groups: BTreeMap<GroupId, Group>,
    agents: BTreeMap<u32, Vec<AgentPose>>,
    edges: BTreeSet<(u64, u64)>,
    place_edges: Vec<PlaceEdge>,
    room_pairs: BTreeSet<(RoomId, RoomId)>,
    skipped: u64,
}

impl Kind {
    /// Its layer there.
    fn layer(self) -> u8 {
        match self {
            Kind::Object(_) | Kind::Group(_) | Kind::Pose => 2,
            Kind::Place(_) => 3,
            Kind::Room(_) => 4,
            Kind::Building(_) => 5,
            Kind::Skipped => 0,
        }
    }
}

impl Import<'_> {
    fn node(&mut self, at: &Cursor) -> Result<(), LoadError> {
        let id_at = at.get("id")?;
        let id = id_at.u64()?;
        let layer = at.get("layer")?.i64()?;
        let partition = at.find("partition").map_or(Ok(0), |c| c.u32())?;
        if self.kinds.contains_key(&id) {
            return Err(at.duplicate());
        }
        let attributes = at.get("attributes")?;
        let node_type = attributes.get("type")?;
        // The low 56 bits. Two letters may share an index: the later node takes the next free one.
        let index = id & ((1 << 56) - 1);
        let kind = match node_type.str()? {
            "ObjectNodeAttributes" | "KhronosObjectAttributes" => {
                let key = free(index, |i| self.objects.contains_key(&ObjectId(i)));
                let object = self.object(ObjectId(key), id, &attributes)?;
                self.objects.insert(object.id, object);
                Kind::Object(ObjectId(key))
            }
            "PlaceNodeAttributes" if partition == 0 => {
                let key = free(index, |i| self.places.contains_key(&PlaceId(i)));
                self.places.insert(PlaceId(key), place(PlaceId(key), &attributes)?);
                Kind::Place(PlaceId(key))
            }
            "RoomNodeAttributes" => {
                let key = free(index, |i| self.rooms.contains_key(&RoomId(i)));
                self.rooms.insert(RoomId(key), room(RoomId(key), &attributes)?);
                Kind::Room(RoomId(key))
            }
            "SemanticNodeAttributes" if layer == 5 => {
                let key = free(index, |i| self.buildings.contains_key(&BuildingId(i)));
                self.buildings.insert(BuildingId(key), building(BuildingId(key), &attributes)?);
                Kind::Building(BuildingId(key))
            }
            "SemanticNodeAttributes" if layer == 2 && partition == 1 => {
                let key = free(index, |i| self.groups.contains_key(&GroupId(i)));
                self.groups.insert(GroupId(key), group(GroupId(key), &attributes)?);
                Kind::Group(GroupId(key))
            }
            "AgentNodeAttributes" => {
                // Up to 1.0.x the robot is `prefix` and the stamp stands beside the id; from 1.1.0 on it is the partition.
                let robot = at.find("prefix").map_or(Ok(partition), |c| c.u32())?;
                let stamp = attributes.find("timestamp").or_else(|| at.find("timestamp"));
                let stamp_ns = stamp.map_or(Ok(0), |c| c.i64())?;
                let rotation =
                    attributes.find("world_R_body").map_or(Ok(UnitQuaternion::identity()), |c| c.quaternion())?;
                let position = position(&attributes)?;
                let world_from_body = Isometry3::from_parts(position.coords.into(), rotation);
                self.agents.entry(robot).or_default().push(AgentPose { stamp_ns, world_from_body });
                Kind::Pose
            }
            "NodeAttributes"
            | "SemanticNodeAttributes"
            | "PlaceNodeAttributes"
            | "Place2dNodeAttributes"
            | "TraversabilityNodeAttributes"
            | "TravNodeAttributes" => {
                self.skipped += 1;
                Kind::Skipped
            }
            _ => {
                return Err(LoadError::UnknownType { path: node_type.path() });
            }
        };
        self.kinds.insert(id, kind);
        Ok(())
    }

    fn object(&self, id: ObjectId, spark_id: u64, at: &Cursor) -> Result<Object, LoadError> {
        let position = position(at)?;
        let bounds = bounds(at, &position)?;
        let name = at.find("name").map_or(Ok(""), |c| c.str())?;
        let number = at.find("semantic_label").map_or(Ok(NO_LABEL), |c| c.u32())?;
        let from_table = self.label_names.and_then(|names| names.get(&number)).map(String::as_str);
        let from_name = (!name.is_empty() && !is_symbol(name)).then(|| without_number(name));
        let label = match from_table.or(from_name).map(str::trim).filter(|label| !label.is_empty()) {
            Some(label) => label.to_lowercase(),
            None if number == NO_LABEL => "unknown".to_owned(),
            None => format!("label {number}"),
        };
        let mut object = Object::new(id, &label, bounds);
        object.metadata = at.find("metadata").and_then(|c| c.value.as_object().cloned()).unwrap_or_default();
        if let Some(caption) = object.metadata.get("caption").and_then(Value::as_str) {
            object.caption = caption.to_owned();
        }
        object.color = at.find("color").map(|c| color(&c)).transpose()?;
        // Their colours come from a label table, not from a camera: kept, but not made into a word.
        object.attributes = crate::attributes::attributes_of(&object.caption, None);
        object.metadata.insert("spark_id".into(), json!(spark_id));
        object.metadata.insert("semantic_label".into(), json!(number));
        if !name.is_empty() {
            object.metadata.insert("name".into(), json!(name));
        }
        let updated = at.find("last_update_time_ns").map_or(Ok(0), |c| c.u64())?;
        object.last_seen_ns = i64::try_from(updated).unwrap_or(i64::MAX);
        object.first_seen_ns = object.last_seen_ns;
        if let Some(first) = at.find("first_observed_ns") {
            for stamp in first.items()? {
                object.first_seen_ns = object.first_seen_ns.min(i64::try_from(stamp.u64()?).unwrap_or(i64::MAX));
            }
        }
        // Khronos: an object with a trajectory moves.
        if let Some(trajectory) = at.find("trajectory_positions")
            && trajectory.items()?.count() > 1
        {
            object.metadata.insert("dynamic".into(), Value::Bool(true));
        }
        Ok(object)
    }

    fn edge(&mut self, at: &Cursor) -> Result<(), LoadError> {
        let (source_at, target_at) = (at.get("source")?, at.get("target")?);
        let (source, target) = (source_at.u64()?, target_at.u64()?);
        let a = *self.kinds.get(&source).ok_or_else(|| source_at.dangling(source))?;
        let b = *self.kinds.get(&target).ok_or_else(|| target_at.dangling(target))?;
        if source == target || !self.edges.insert((source.min(target), source.max(target))) {
            return Err(at.duplicate());
        }
        // Children first: the larger layer is the parent.
        let (child, parent) = if a.layer() <= b.layer() { (a, b) } else { (b, a) };
        match (child, parent) {
            (Kind::Place(a), Kind::Place(b)) => {
                let info = at.find("info");
                let is_weighted = info.as_ref().and_then(|c| c.find("weighted")).map_or(Ok(false), |c| c.bool())?;
                let weight = info.as_ref().and_then(|c| c.find("weight"));
                let least = self.places[&a].clearance_m.min(self.places[&b].clearance_m);
                let clearance_m = match weight {
                    Some(weight) if is_weighted => weight.f64()?.max(0.0),
                    _ => least,
                };
                self.place_edges.push(PlaceEdge { a, b, clearance_m });
            }
            (Kind::Object(object), Kind::Place(place)) => {
                if let Some(object) = self.objects.get_mut(&object) {
                    object.place = Some(object.place.map_or(place, |known| known.min(place)));
                }
            }
            (Kind::Place(place), Kind::Room(room)) => {
                // Several parents are allowed there; the first stays.
                if let (Some(place), Some(room)) = (self.places.get_mut(&place), self.rooms.get_mut(&room))
                    && place.room.is_none()
                {
                    place.room = Some(room.id);
                    room.places.push(place.id);
                }
            }
            (Kind::Room(a), Kind::Room(b)) => drop(self.room_pairs.insert((a.min(b), a.max(b)))),
            (Kind::Room(room), Kind::Building(building)) => {
                if let Some(building) = self.buildings.get_mut(&building) {
                    building.rooms.push(room);
                }
            }
            (Kind::Object(object), Kind::Group(group)) | (Kind::Group(group), Kind::Object(object)) => {
                if let Some(group) = self.groups.get_mut(&group) {
                    group.members.push(object);
                }
            }
            // Agent to agent, agent to place: in the trajectory.
            _ => {}
        }
        Ok(())
    }

    /// The graph, through ops. What they refuse is reported at the root: every single record was read before.
    fn build(mut self, root: &Cursor) -> Result<SceneGraph, LoadError> {
        let mut graph = SceneGraph::new();
        let doors = self.doors();
        let mut rooms: Vec<Room> = std::mem::take(&mut self.rooms).into_values().collect();
        name_rooms(&mut rooms, &RoomConfig::default());
        let mut ops: Vec<Op> = self.places.values().map(|place| Op::PutPlace(*place)).collect();
        ops.extend(self.place_edges.iter().map(|edge| Op::PutPlaceEdge(*edge)));
        ops.extend(rooms.iter().cloned().map(|room| Op::PutRoom(Box::new(room))));
        ops.extend(doors.into_iter().map(Op::PutRoomEdge));
        for mut building in std::mem::take(&mut self.buildings).into_values() {
            let heights: Vec<f64> =
                rooms.iter().filter(|room| building.rooms.contains(&room.id)).map(|room| room.center.z).collect();
            if !heights.is_empty() {
                let height_m = heights.iter().sum::<f64>() / heights.len() as f64;
                building.storeys = vec![Storey { floor: 0, height_m, rooms: heights.len() as u32 }];
            }
            ops.push(Op::PutBuilding(Box::new(building)));
        }
        for mut object in std::mem::take(&mut self.objects).into_values() {
            if object.place.is_none() {
                let distance = |place: &Place| (place.position - object.centroid).norm_squared();
                let nearest = self.places.values().min_by(|a, b| distance(a).total_cmp(&distance(b)));
                object.place = nearest.map(|place| place.id);
            }
            object.room = object.place.and_then(|place| self.places[&place].room);
            ops.push(Op::PutObject(Box::new(object)));
        }
        for group in std::mem::take(&mut self.groups).into_values().filter(|group| group.members.len() >= 2) {
            ops.push(Op::PutGroup(Box::new(group)));
        }
        for (robot, mut trajectory) in std::mem::take(&mut self.agents) {
            trajectory.sort_by_key(|pose| pose.stamp_ns);
            let letter = char::from_u32(robot).filter(char::is_ascii_alphabetic);
            let name = letter.map_or_else(|| format!("robot {robot}"), |letter| format!("robot {letter}"));
            ops.push(Op::PutAgent(Box::new(Agent { id: AgentId(u64::from(robot)), name, trajectory })));
        }
        graph.apply(Op::Batch(ops)).map_err(|error| root.refused(error))?;
        if self.skipped > 0 {
            graph.metadata.insert("spark_skipped_nodes".into(), json!(self.skipped));
        }
        Ok(graph)
    }

    /// One way per pair of rooms that an edge joins: the middle of the widest edge between their places.
    fn doors(&self) -> Vec<RoomEdge> {
        let mut doors: BTreeMap<(RoomId, RoomId), RoomEdge> = BTreeMap::new();
        for edge in &self.place_edges {
            let (from, to) = (&self.places[&edge.a], &self.places[&edge.b]);
            let (Some(a), Some(b)) = (from.room, to.room) else {
                continue;
            };
            if a == b {
                continue;
            }
            let doorway = nalgebra::center(&from.position, &to.position);
            let door = RoomEdge { a: a.min(b), b: a.max(b), doorway, width_m: 2.0 * edge.clearance_m };
            let widest = doors.entry((door.a, door.b)).or_insert(door);
            if door.width_m > widest.width_m {
                *widest = door;
            }
        }
        for &(a, b) in &self.room_pairs {
            let doorway = nalgebra::center(&self.rooms[&a].center, &self.rooms[&b].center);
            doors.entry((a, b)).or_insert(RoomEdge { a, b, doorway, width_m: 0.0 });
        }
        doors.into_values().collect()
    }
}

fn free(index: u64, is_taken: impl Fn(u64) -> bool) -> u64 {
    (index..).find(|candidate| !is_taken(*candidate)).expect("2^56 nodes do not fit into a file")
}
