//! ops.log: the recent events of a graph, one JSON record per line with a CRC-32. It is the history for
//! [`SceneGraph::changes_since`]; the state is in graph.json.

use std::sync::Arc;

use serde_json::{Map, Value, json};

use crate::graph::SceneGraph;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::load::{Cursor, LoadError, parse};
use crate::op::{Change, Event};
use crate::records;

impl SceneGraph {
    /// Empties the log; it begins at the present revision.
    pub(crate) fn clear_log(&mut self) {
        self.log.clear();
        self.log_start = self.revision;
        self.log_changes = 0;
    }
}

/// The events in the graph's log, as lines.
pub fn log_to_lines(graph: &SceneGraph) -> Vec<u8> {
    let mut out = Vec::new();
    for event in &graph.log {
        let changes: Vec<Value> = event.changes.iter().map(from_change).collect();
        let body = json!({ "revision": event.revision, "changes": changes }).to_string();
        out.extend_from_slice(format!("{:08x} {body}\n", crc32(body.as_bytes())).as_bytes());
    }
    out
}

/// Puts the events of a log into a graph loaded from the graph.json saved with it. Events newer than the graph are refused.
///
/// # Errors
/// [`LoadError::Log`] with the line for anything that is not a record in order with a right checksum; the graph's log is empty
/// then.
pub fn read_log(graph: &mut SceneGraph, bytes: &[u8]) -> Result<(), LoadError> {
    graph.clear_log();
    let mut events: Vec<Event> = Vec::new();
    for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        if line.is_empty() {
            continue;
        }
        let damaged = || LoadError::Log { line: index + 1 };
        let event = read_line(line).ok_or_else(damaged)?;
        let is_in_order = events.last().is_none_or(|last| last.revision < event.revision);
        if !is_in_order || event.revision > graph.revision || event.revision == 0 {
            return Err(damaged());
        }
        events.push(event);
    }
    if let Some(first) = events.first() {
        graph.log_start = first.revision - 1;
        graph.log_changes = events.iter().map(|event| event.changes.len()).sum();
        graph.log = events;
    }
    Ok(())
}

fn read_line(line: &[u8]) -> Option<Event> {
    let (sum, body) = (line.get(..8)?, line.get(9..)?);
    let sum = u32::from_str_radix(std::str::from_utf8(sum).ok()?, 16).ok()?;
    if line.get(8) != Some(&b' ') || crc32(body) != sum {
        return None;
    }
    let value = parse(body).ok()?;
    let root = Cursor::root(&value);
    let revision = root.get("revision").ok()?.u64().ok()?;
    let list = root.get("changes").ok()?;
    let changes: Option<Vec<Change>> = list.items().ok()?.map(|item| change(&item).ok()).collect();
    Some(Event { revision, changes: changes?.into() })
}

fn from_change(change: &Change) -> Value {
    fn both<T>(
        kind: &str,
        id: Value,
        before: Option<&T>,
        after: Option<&T>,
        write: impl Fn(&T) -> Map<String, Value>,
    ) -> Value {
        json!({ "node": kind, "id": id, "before": before.map(&write), "after": after.map(&write) })
    }
    use Change::*;
    match change {
        Object(id, b, a) => both("object", json!(id), b.as_deref(), a.as_deref(), records::from_object),
        Place(id, b, a) => both("place", json!(id), b.as_ref(), a.as_ref(), records::from_place),
        PlaceEdge(id, b, a) => both("place_edge", json!(id), b.as_ref(), a.as_ref(), records::from_place_edge),
        Room(id, b, a) => both("room", json!(id), b.as_deref(), a.as_deref(), records::from_room),
        RoomEdge(id, b, a) => both("room_edge", json!(id), b.as_ref(), a.as_ref(), records::from_room_edge),
        Building(id, b, a) => both("building", json!(id), b.as_deref(), a.as_deref(), records::from_building),
        Group(id, b, a) => both("group", json!(id), b.as_deref(), a.as_deref(), records::from_group),
        Relation(key, b, a) => {
            let id = json!([key.0, key.1.word(), key.2, key.3]);
            both("relation", id, b.as_ref(), a.as_ref(), records::from_relation)
        }
        Agent(id, b, a) => both("agent", json!(id), b.as_deref(), a.as_deref(), records::from_agent),
        AgentPose(id, b, a) => {
            let (before, after) = (b.as_ref().map(records::from_agent_pose), a.as_ref().map(records::from_agent_pose));
            json!({ "node": "agent_pose", "id": id, "before": before, "after": after })
        }
    }
}

fn change(at: &Cursor) -> Result<Change, LoadError> {
    fn both<T>(
        at: &Cursor,
        read: impl Fn(&Cursor) -> Result<T, LoadError>,
    ) -> Result<(Option<T>, Option<T>), LoadError> {
        let before = at.find("before").map(|c| read(&c)).transpose()?;
        let after = at.find("after").map(|c| read(&c)).transpose()?;
        Ok((before, after))
    }
    fn shared<T>((before, after): (Option<T>, Option<T>)) -> (Option<Arc<T>>, Option<Arc<T>>) {
        (before.map(Arc::new), after.map(Arc::new))
    }
    let id = at.get("id")?;
    let pair = || -> Result<(u64, u64), LoadError> {
        let parts: Vec<Cursor> = id.items()?.collect();
        let [a, b] = parts.as_slice() else {
            return Err(id.wrong("a pair of ids"));
        };
        Ok((a.u64()?, b.u64()?))
    };
    let node = at.get("node")?;
    Ok(match node.str()? {
        "object" => {
            let (b, a) = shared(both(at, records::object)?);
            Change::Object(ObjectId(id.u64()?), b, a)
        }
        "place" => {
            let (b, a) = both(at, records::place)?;
            Change::Place(PlaceId(id.u64()?), b, a)
        }
        "place_edge" => {
            let (b, a) = both(at, records::place_edge)?;
            let (from, to) = pair()?;
            Change::PlaceEdge((PlaceId(from), PlaceId(to)), b, a)
        }
        "room" => {
            let (b, a) = shared(both(at, records::room)?);
            Change::Room(RoomId(id.u64()?), b, a)
        }
        "room_edge" => {
            let (b, a) = both(at, records::room_edge)?;
            let (from, to) = pair()?;
            Change::RoomEdge((RoomId(from), RoomId(to)), b, a)
        }
        "building" => {
            let (b, a) = shared(both(at, records::building)?);
            Change::Building(BuildingId(id.u64()?), b, a)
        }
        "group" => {
            let (b, a) = shared(both(at, records::group)?);
            Change::Group(GroupId(id.u64()?), b, a)
        }
        "relation" => {
            let (b, a) = both(at, records::relation)?;
            let key = b.or(a).map(|relation| relation.key()).ok_or_else(|| at.wrong("a change"))?;
            Change::Relation(key, b, a)
        }
        "agent" => {
            let (b, a) = shared(both(at, records::agent)?);
            Change::Agent(AgentId(id.u64()?), b, a)
        }
        "agent_pose" => {
            let (b, a) = both(at, records::agent_pose)?;
            Change::AgentPose(AgentId(id.u64()?), b, a)
        }
        _ => return Err(LoadError::UnknownType { path: node.path() }),
    })
}

/// CRC-32 (IEEE 802.3, reflected), as in zip and PNG.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 })
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::bounds::Aabb;
    use crate::object::Object;
    use crate::op::Op;

    #[test]
    fn crc_of_the_standard_check_string() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn a_log_survives_the_file_and_damage_is_found() {
        let mut graph = SceneGraph::new();
        for id in 1..=3 {
            let bounds = Aabb::at(Point3::new(id as f64, 0.1, 0.2));
            graph.apply(Op::PutObject(Box::new(Object::new(ObjectId(id), "chair", bounds)))).unwrap();
        }
        graph.apply(Op::RemoveObject(ObjectId(2))).unwrap();
        let lines = log_to_lines(&graph);
        let mut loaded = graph.snapshot();
        read_log(&mut loaded, &lines).unwrap();
        assert_eq!(loaded.changes_since(0), graph.changes_since(0));

        let mut damaged = lines.clone();
        damaged[40] ^= 1;
        assert!(matches!(read_log(&mut loaded, &damaged), Err(LoadError::Log { line: 1 })));
        assert!(matches!(read_log(&mut loaded, &lines[..lines.len() - 5]), Err(LoadError::Log { line: 4 })));
    }
}
