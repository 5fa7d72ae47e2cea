//! Small scene graphs, generators, and a decoder that reads a prompt back.
#![allow(dead_code)] // each test file uses its part

use std::collections::BTreeMap;

use dsg::{Aabb, Object, ObjectId, Op, Place, PlaceId, Room, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3, Vector3};
use proptest::prelude::*;

/// Side of a square room, metres.
pub const ROOM_M: f64 = 5.0;

/// One object to be put into a graph.
#[derive(Debug, Clone)]
pub struct Put {
    pub label: String,
    pub caption: String,
    pub at: Point3<f64>,
    pub size_m: f64,
}

pub fn put(label: &str, x: f64, y: f64, z: f64) -> Put {
    Put { label: label.into(), caption: String::new(), at: Point3::new(x, y, z), size_m: 0.3 }
}

/// Corner of room `index` of a row of rooms two deep: 0 and 1 side by side, 2 and 3 behind them, and so on.
pub fn corner(index: usize) -> (f64, f64) {
    ((index % 2) as f64 * ROOM_M, (index / 2) as f64 * ROOM_M)
}

pub fn room_index_at(point: &Point3<f64>, rooms: usize) -> Option<usize> {
    (0..rooms).find(|index| {
        let (x, y) = corner(*index);
        (x..x + ROOM_M).contains(&point.x) && (y..y + ROOM_M).contains(&point.y)
    })
}

/// A graph of square rooms with nine places each and the given objects.
pub fn graph(rooms: usize, names: &[&str], objects: &[Put]) -> SceneGraph {
    let mut graph = SceneGraph::new();
    let mut apply = |op| {
        graph.apply(op).expect("valid op");
    };
    for index in 0..rooms {
        let (x, y) = corner(index);
        let places: Vec<PlaceId> = (0..9).map(|k| PlaceId((index * 9 + k) as u64)).collect();
        for (k, id) in places.iter().enumerate() {
            let position = Point3::new(x + 1.0 + 1.5 * (k % 3) as f64, y + 1.0 + 1.5 * (k / 3) as f64, 0.3);
            apply(Op::PutPlace(Place {
                id: *id,
                position,
                clearance_m: 0.5,
                basis_points: 2,
                frontier_cells: 0,
                room: None,
            }));
        }
        let center = Point3::new(x + ROOM_M / 2.0, y + ROOM_M / 2.0, 0.3);
        let mut room = Room { places, ..Room::new(RoomId(index as u64), center) };
        if let Some(name) = names.get(index).filter(|name| !name.is_empty()) {
            room.name = (*name).to_string();
            room.is_user_named = true;
        }
        apply(Op::PutRoom(Box::new(room)));
    }
    for (index, each) in objects.iter().enumerate() {
        let bounds = Aabb::from_center(each.at, Vector3::repeat(each.size_m));
        let mut object = Object::new(ObjectId(index as u64 + 1), &each.label, bounds);
        object.caption.clone_from(&each.caption);
        object.room = room_index_at(&each.at, rooms).map(|index| RoomId(index as u64));
        apply(Op::PutObject(Box::new(object)));
    }
    graph
}

pub fn pose(x: f64, y: f64, yaw_rad: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(x, y, 0.3), Vector3::z() * yaw_rad)
}

/// Labels: ordinary, confusable, hostile.
pub fn label() -> impl Strategy<Value = String> {
    prop_oneof![
        8 => prop::sample::select(vec!["chair", "table", "mug", "trash can", "sink", "box", "sofa"]).prop_map(str::to_string),
        1 => prop::sample::select(vec!["label 11", "x7", "a\nb: c; d", "TV", "caf\u{e9}", "room1", "-", "9", "\u{1F600}", "front-left-top: chair1 1.0"]).prop_map(str::to_string),
        1 => "\\PC{0,40}[a-z]", // the graph refuses blank labels
    ]
}

/// Objects anywhere in the rooms, some exactly at the origin of the pose, some coincident.
pub fn objects(rooms: usize, most: usize) -> impl Strategy<Value = Vec<Put>> {
    let depth = rooms.div_ceil(2) as f64 * ROOM_M;
    let at = (0.0..2.0 * ROOM_M, 0.0..depth, 0.0..2.4f64).prop_map(|(x, y, z)| Point3::new(x, y, z));
    let at = prop_oneof![9 => at, 1 => Just(Point3::new(2.5, 2.5, 0.3))];
    let caption = prop_oneof![3 => Just(String::new()), 3 => "[a-z ]{0,200}", 1 => "\\PC{0,200}"];
    prop::collection::vec((label(), caption, at), 0..=most)
        .prop_map(|rows| rows.into_iter().map(|(label, caption, at)| Put { label, caption, at, size_m: 0.2 }).collect())
}

/// (group, class, count) of a room's line.
pub type Groups = Vec<(String, String, usize)>;

/// A line about many rooms.
#[derive(Debug, Default, PartialEq)]
pub struct DecodedArea {
    pub side: String,
    /// Nearest and farthest room, whole metres.
    pub span_m: (f64, f64),
    pub rooms: usize,
    pub counts: Vec<(String, usize)>,
    /// (class, room, whole metres)
    pub first: Vec<(String, String, f64)>,
}

/// What a reader can tell from a prompt.
#[derive(Debug, Default, PartialEq)]
pub struct Decoded {
    /// Own room within the focal radius: name -> (octant, distance).
    pub focal: BTreeMap<String, (String, String)>,
    /// Own room beyond: name -> (octant, group, distance).
    pub peripheral: BTreeMap<String, (String, String, String)>,
    /// Other rooms: room -> (bearing, list of (group, class, count)).
    pub rooms: BTreeMap<String, (String, Groups)>,
    /// Own room, the rest: (class, count).
    pub crowd: Vec<(String, usize)>,
    /// Farther rooms by direction.
    pub areas: Vec<DecodedArea>,
    /// Of the rooms that are folded away: (class, room, whole metres).
    pub hidden_first: Vec<(String, String, f64)>,
    /// Objects and rooms that are only counted.
    pub hidden_objects: usize,
    pub hidden_rooms: usize,
}

/// Reads a prompt back, by the format alone. Captions must not hold `"; "` or a quote (they cannot: the writer replaces
/// them).
pub fn decode(text: &str) -> Decoded {
    let mut out = Decoded::default();
    let mut section = "";
    let number = |text: &str| text.split(' ').find_map(|word| word.parse::<usize>().ok()).unwrap_or(0);
    for line in text.lines().skip(1) {
        if line.starts_with("Instruction: ") {
            break;
        }
        if line.starts_with("Near (m)") {
            section = "near";
        } else if line.starts_with("This room") || line.starts_with("Nothing within") {
            section = "here";
        } else if line.starts_with("Other rooms") {
            section = "rooms";
        } else if line.starts_with("To explore") {
            section = "places";
        } else if line.starts_with("Farther rooms") {
            section = "areas";
        } else if let Some(rest) = line.strip_prefix("Also in this room: ") {
            out.crowd = counts(rest);
        } else if let Some(rest) = line.strip_prefix("Not shown: ") {
            let mut parts = rest.split("; ");
            let rest = parts.next().expect("counts");
            let mut words = rest.split(' ');
            out.hidden_rooms = words.next().map_or(0, number);
            out.hidden_first = parts.map(first_of).collect();
            out.hidden_objects += number(rest.split(", ").nth(1).unwrap_or(""));
        } else if let Some(rest) = line.strip_prefix("more near: ").or_else(|| line.strip_prefix("more here: ")) {
            out.hidden_objects += number(rest);
        } else if let Some(rest) = line.strip_prefix("Empty: ") {
            for range in rest.split(", ") {
                let (first, last) = range.split_once('-').unwrap_or((range, ""));
                let first: u64 = first.strip_prefix("room").expect("a room").parse().expect("its number");
                for room in first..=last.parse().unwrap_or(first) {
                    out.rooms.insert(format!("room{room}"), (String::new(), Groups::new()));
                }
            }
        } else if section == "near" {
            let (octant, rest) = line.split_once(": ").expect("octant: entries");
            for entry in rest.split("; ") {
                let mut words = entry.splitn(3, ' ');
                let (name, distance) = (words.next().expect("name"), words.next().expect("distance"));
                out.focal.insert(name.into(), (octant.into(), distance.into()));
            }
        } else if section == "here" {
            let (octant, rest) = line.split_once(": ").expect("octant: groups");
            for group in rest.split(", ") {
                let words: Vec<&str> = group.split(' ').collect();
                for pair in words[1..].chunks(2) {
                    out.peripheral.insert(pair[0].into(), (octant.into(), words[0].into(), pair[1].into()));
                }
            }
        } else if section == "areas" {
            out.areas.push(area(line));
        } else if section == "rooms" {
            let (head, rest) = line.split_once("m:").expect("room bearing distance");
            let name = head.split(' ').next().expect("room name");
            let bearing = head.rsplit(' ').nth(1).expect("bearing");
            let mut groups = Vec::new();
            for part in rest.split(',').map(str::trim).filter(|part| *part != "empty" && !part.is_empty()) {
                let words: Vec<&str> = part.split(' ').collect();
                let is_span = |word: &str| {
                    word.strip_suffix('m').is_some_and(|span| {
                        !span.is_empty() && span.bytes().all(|byte| byte.is_ascii_digit() || byte == b'-')
                    })
                };
                if !is_span(words[words.len() - 1]) {
                    // A line without groups.
                    groups.extend(counts(part).into_iter().map(|(class, count)| (String::new(), class, count)));
                    continue;
                }
                for word in &words[1..words.len() - 1] {
                    let (class, count) = octant_prompt::names::split_count(word);
                    groups.push((words[0].to_string(), class.to_string(), count));
                }
            }
            out.rooms.insert(name.into(), (bearing.into(), groups));
        }
    }
    out
}

fn counts(text: &str) -> Vec<(String, usize)> {
    let words = text.split(' ').filter(|word| !word.is_empty() && *word != "empty");
    words.map(octant_prompt::names::split_count).map(|(class, count)| (class.to_string(), count)).collect()
}

/// `front 16-30m, 6 rooms: chairx12 table; chair in room12 17m`
fn area(line: &str) -> DecodedArea {
    let (head, rest) = line.split_once(" rooms:").expect("a number of rooms");
    let (where_, rooms) = head.split_once(", ").expect("side and distance");
    let (side, span) = where_.split_once(' ').expect("side");
    let number = |text: &str| text.parse::<f64>().unwrap_or_else(|_| panic!("a number in {line:?}"));
    let span = span.strip_suffix('m').expect("metres");
    let span_m =
        span.split_once('-').map_or_else(|| (number(span), number(span)), |(low, high)| (number(low), number(high)));
    let mut parts = rest.split("; ");
    let counts = counts(parts.next().expect("counts").trim());
    DecodedArea {
        side: side.into(),
        span_m,
        rooms: rooms.parse().expect("rooms"),
        counts,
        first: parts.map(first_of).collect(),
    }
}

/// `chair in room12 17m`
fn first_of(part: &str) -> (String, String, f64) {
    let words: Vec<&str> = part.rsplitn(4, ' ').collect();
    let metres = words[0].strip_suffix('m').and_then(|metres| metres.parse().ok());
    (words[3].into(), words[1].into(), metres.unwrap_or_else(|| panic!("metres in {part:?}")))
}
