//! From their nodes and edges, all read, to a graph: rooms get names, objects a place, robots a trajectory, and what has no counterpart
//! here is kept.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use nalgebra::Point3;
use serde_json::{Map, Value, json};

use crate::agent::Agent;
use crate::graph::SceneGraph;
use crate::ids::{AgentId, PlaceId, RoomId};
use crate::load::{JsonPath, LoadError};
use crate::op::Op;
use crate::room::{Building, Room, RoomEdge, Storey};
use crate::rooms::{RoomConfig, name_rooms};
use crate::spark::attributes;
use crate::spark::kept::{KEPT, is_same, keep_in_document, put_kept};
use crate::spark::names::{layer_keys, layer_names, usual_name};
use crate::spark::ours::Beside;
use crate::spark::read::{Import, Pose};
use crate::spark::{ROOM, symbol};

impl Import<'_, '_, '_> {
    /// The graph. What it refuses is reported at the root: every single record was read before.
    pub(super) fn build(mut self, beside: Beside) -> Result<SceneGraph, LoadError> {
        for room in self.rooms.values_mut() {
            room.places.sort_unstable();
        }
        let rooms = self.named_rooms();
        self.keep_rooms(&rooms);
        let mut graph = std::mem::take(&mut self.graph);
        // Rooms own the membership: it comes back with them.
        graph.places.values_mut().for_each(|place| place.room = None);
        graph.index_place_edges();
        for room in rooms.iter().cloned() {
            self.apply(&mut graph, Op::PutRoom(Box::new(room)))?;
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
                object.room = object.place.and_then(|place| graph.place(place)).and_then(|place| place.room);
            }
            ops.push(Op::PutObject(Box::new(object)));
        }
        for op in ops {
            self.apply(&mut graph, op)?;
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
            self.apply(&mut graph, op)?;
        }
        self.keep_document(&mut graph);
        graph.revision = beside.revision;
        if let Some(next) = beside.next {
            graph.next.object = graph.next.object.max(next.object);
            graph.next.room = graph.next.room.max(next.room);
            graph.next.group = graph.next.group.max(next.group);
        }
        graph.check_room_to_grow()?;
        graph.clear_log();
        Ok(graph)
    }

    /// A fault of the graph as a whole.
    fn apply(&mut self, graph: &mut SceneGraph, op: Op) -> Result<(), LoadError> {
        let path = || JsonPath("$".into());
        graph.apply(op).map(drop).or_else(|source| self.faults.note(LoadError::Refused { path: path(), source }))
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
        let (id, name) = names.get(&robot).cloned().unwrap_or_else(|| (u64::from(robot), usual_name(robot)));
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

    fn keep_document(&mut self, graph: &mut SceneGraph) {
        let (nodes, edges) = (std::mem::take(&mut self.other_nodes), std::mem::take(&mut self.other_edges));
        if !nodes.is_empty() {
            keep_in_document(graph, "nodes", Value::Array(nodes));
        }
        if !edges.is_empty() {
            keep_in_document(graph, "edges", Value::Array(edges));
        }
        let field = |name| self.document.field(name).and_then(|text| self.document.parse(text).ok());
        if let Some(names) = field("layer_names").filter(|names| !is_same(names, &layer_names(false)))
            && !is_same(&names, &layer_names(true))
            && names.as_object().is_some_and(|names| names.values().all(Value::is_object))
        {
            keep_in_document(graph, "layer_names", names);
        }
        let written = layer_keys(graph);
        if let Some(Value::Array(mut keys)) = field("layer_keys") {
            keys.retain(|key| key.is_object() && !written.iter().any(|own| is_same(own, key)));
            if !keys.is_empty() {
                keep_in_document(graph, "layer_keys", Value::Array(keys));
            }
        }
    }
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

/// For every two rooms that an edge between places joins: the middle of the widest such edge.
pub(super) fn crossings(graph: &SceneGraph) -> BTreeMap<(RoomId, RoomId), RoomEdge> {
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
pub(super) fn with_storeys(mut building: Building, rooms: &[Room]) -> Building {
    let heights: Vec<f64> =
        rooms.iter().filter(|room| building.rooms.contains(&room.id)).map(|room| room.center.z).collect();
    if building.storeys.is_empty() && !heights.is_empty() {
        let height_m = heights.iter().sum::<f64>() / heights.len() as f64;
        building.storeys = vec![Storey { floor: 0, height_m, rooms: heights.len() as u32 }];
    }
    building
}
