//! Rooms over time: the parts of the place graph become rooms that keep their id, get a kind from their contents, and are
//! joined by doorways under one building.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix2, Point3, Vector2};

use crate::graph::SceneGraph;
use crate::ids::{BuildingId, PlaceId, RoomId};
use crate::object::Object;
use crate::op::{ConfigError, Op, OpError};
use crate::place::Place;
use crate::room::{Building, Room, RoomEdge, Storey};
use crate::room_kind::{RoomShape, Rows, room_kind_with};

/// One part of the free space, from a partition of the place graph or of the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomPart {
    /// Its places. Unknown ids are ignored; a place in two parts belongs to the first.
    pub places: Vec<PlaceId>,
    /// Middle of its floor at the height of its places.
    pub center: Point3<f64>,
    /// Its floor area.
    pub area_m2: f64,
    /// Its storey.
    pub floor: i32,
}

/// How rooms are kept and named.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomConfig {
    /// Jaccard overlap of places above which a part is an old room. Default 0.3.
    pub min_jaccard: f64,
    /// Share of the smaller one's places above which a part is an old room all the same: rooms grow while they are
    /// explored. Default 0.5.
    pub min_containment: f64,
    /// Probability from which a kind names the room. Default 0.6.
    pub name_confidence: f64,
}

impl Default for RoomConfig {
    fn default() -> RoomConfig {
        RoomConfig { min_jaccard: 0.3, min_containment: 0.5, name_confidence: 0.6 }
    }
}

impl RoomConfig {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for (field, share) in [
            ("min_jaccard", self.min_jaccard),
            ("min_containment", self.min_containment),
            ("name_confidence", self.name_confidence),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return Err(ConfigError { field, rule: "in [0, 1]" });
            }
        }
        Ok(())
    }
}

/// What became of the parts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RoomReport {
    /// The room of each part, in the order of the parts.
    pub room_of: Vec<RoomId>,
    /// Rooms that are new.
    pub created: Vec<RoomId>,
    /// Rooms that are gone.
    pub removed: Vec<RoomId>,
    /// The revision afterwards.
    pub revision: u64,
}

/// Makes the graph's rooms those of `parts`: one batch.
///
/// A part keeps the id (and a user's name) of the old room it overlaps most. `doorways` are (part, part, middle, width);
/// of several between two parts the widest is kept. `part_of_point` says in which part a point lies, to give objects and
/// groups their room; where it says `None` an object keeps its room if that still exists, or takes that of its place.
///
/// # Errors
/// A bad configuration or a NaN; nothing is changed then.
pub fn update_rooms(
    graph: &mut SceneGraph,
    parts: &[RoomPart],
    doorways: &[(usize, usize, Point3<f64>, f64)],
    part_of_point: &dyn Fn(&Point3<f64>) -> Option<usize>,
    config: &RoomConfig,
) -> Result<RoomReport, OpError> {
    config.validate()?;
    let members = members_of(graph, parts);

    // Identity: which part is which old room.
    let (room_of, created) = identify(graph, parts, &members, part_of_point, config);
    let removed: Vec<RoomId> = graph.rooms().map(|room| room.id).filter(|id| !room_of.contains(id)).collect();

    // Objects stand in parts.
    let room_of_object: BTreeMap<_, _> = graph
        .objects()
        .map(|object| {
            let of_point = part_of_point(&object.centroid).and_then(|part| room_of.get(part).copied());
            let of_place = || {
                let place = object.place?;
                let part = members.iter().position(|places| places.contains(&place))?;
                Some(room_of[part])
            };
            (object.id, of_point.or(object.room.filter(|room| room_of.contains(room))).or_else(of_place))
        })
        .collect();

    // Kinds and names.
    let shapes = shapes_of(graph, &members, doorways);
    let mut rooms: Vec<Room> = Vec::new();
    let mut contents: BTreeMap<RoomId, Vec<&Object>> = BTreeMap::new();
    for (object, room) in graph.objects().zip(room_of_object.values()) {
        if let Some(room) = room {
            contents.entry(*room).or_default().push(object);
        }
    }
    let mut rows = Rows::new();
    for (part, id) in room_of.iter().enumerate() {
        let contents = contents.get(id).into_iter().flatten().copied();
        let guess = room_kind_with(&mut rows, contents, shapes[part]);
        let known = graph.room(*id).cloned().unwrap_or_else(|| Room::new(*id, parts[part].center));
        rooms.push(Room {
            kind: guess.as_ref().map(|guess| guess.kind.to_owned()),
            kind_confidence: guess.map_or(0.0, |guess| guess.confidence),
            center: parts[part].center,
            places: members[part].iter().copied().collect(),
            area_m2: parts[part].area_m2,
            floor: parts[part].floor,
            ..known
        });
    }
    name_rooms(&mut rooms, config);

    // One batch. Names are set in two steps because two rooms may swap them.
    let mut ops: Vec<Op> = removed.iter().map(|id| Op::RemoveRoom(*id)).collect();
    for room in &rooms {
        let is_renamed = graph.room(room.id).is_some_and(|known| known.name != room.name);
        if is_renamed {
            let known = graph.room(room.id).expect("just found").clone();
            ops.push(Op::PutRoom(Box::new(Room { name: format!("\u{0}{}", room.id), ..known })));
        }
    }
    rooms.sort_by_key(|room| room.id);
    let building = building_of(graph, &rooms);
    let is_news = |room: &Room| graph.room(room.id) != Some(room);
    ops.extend(rooms.into_iter().filter(is_news).map(|room| Op::PutRoom(Box::new(room))));
    ops.extend(door_ops(graph, &room_of, doorways, &removed));
    for object in graph.objects() {
        let room = room_of_object[&object.id];
        // Places are renewed while the map grows; an object that lost its place gets the nearest.
        let place = object.place.or_else(|| graph.place_nearest(&object.centroid).map(|place| place.id));
        if object.room != room || object.place != place {
            ops.push(Op::PutObject(Box::new(Object { room, place, ..object.clone() })));
        }
    }
    ops.push(Op::PutBuilding(Box::new(building)));
    let event = graph.apply(Op::Batch(ops))?;
    Ok(RoomReport { room_of, created, removed, revision: event.revision })
}

/// The places of each part that exist, each place in one part only.
fn members_of(graph: &SceneGraph, parts: &[RoomPart]) -> Vec<BTreeSet<PlaceId>> {
    let mut taken = BTreeSet::new();
    let own = |part: &RoomPart| {
        part.places.iter().copied().filter(|id| graph.place(*id).is_some() && taken.insert(*id)).collect()
    };
    parts.iter().map(own).collect()
}

/// The room id of each part, and which of them are new. Passes of falling strength, each greedy by overlap: Jaccard of the
/// places; share of the smaller one; the old centre lies in the part.
fn identify(
    graph: &SceneGraph,
    parts: &[RoomPart],
    members: &[BTreeSet<PlaceId>],
    part_of_point: &dyn Fn(&Point3<f64>) -> Option<usize>,
    config: &RoomConfig,
) -> (Vec<RoomId>, Vec<RoomId>) {
    let mut room_of: Vec<Option<RoomId>> = vec![None; parts.len()];
    let mut overlaps: Vec<(bool, f64, RoomId, usize)> = Vec::new();
    let part_of: BTreeMap<PlaceId, usize> =
        members.iter().enumerate().flat_map(|(part, places)| places.iter().map(move |place| (*place, part))).collect();
    for room in graph.rooms() {
        let mut common_with: BTreeMap<usize, usize> = BTreeMap::new();
        for part in room.places.iter().filter_map(|place| part_of.get(place)) {
            *common_with.entry(*part).or_default() += 1;
        }
        for (part, common) in common_with {
            let (places, common) = (&members[part], common as f64);
            let jaccard = common / (room.places.len() as f64 + places.len() as f64 - common);
            let containment = common / room.places.len().min(places.len()) as f64;
            if jaccard > config.min_jaccard {
                overlaps.push((true, jaccard, room.id, part));
            } else if containment >= config.min_containment {
                overlaps.push((false, common, room.id, part));
            }
        }
    }
    overlaps.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)).then(a.3.cmp(&b.3)));
    let mut taken = BTreeSet::new();
    for (_, _, room, part) in overlaps {
        if room_of[part].is_none() && !taken.contains(&room) {
            room_of[part] = Some(room);
            taken.insert(room);
        }
    }
    // Places are renewed while the map grows; a room whose places all changed is still where it was.
    for room in graph.rooms().filter(|room| !taken.contains(&room.id)) {
        if let Some(part) = part_of_point(&room.center)
            && room_of.get(part) == Some(&None)
            && parts[part].floor == room.floor
        {
            room_of[part] = Some(room.id);
        }
    }
    let mut next = graph.next_room_id();
    let mut created = Vec::new();
    let ids = room_of.into_iter().map(|known| {
        known.unwrap_or_else(|| {
            let id = next;
            next.0 += 1;
            created.push(id);
            id
        })
    });
    (ids.collect(), created)
}

fn shapes_of(
    graph: &SceneGraph,
    members: &[BTreeSet<PlaceId>],
    doorways: &[(usize, usize, Point3<f64>, f64)],
) -> Vec<RoomShape> {
    let shape = |(part, places): (usize, &BTreeSet<PlaceId>)| {
        let places: Vec<&Place> = places.iter().filter_map(|id| graph.place(*id)).collect();
        let beyond = doorways.iter().filter_map(|door| match (door.0 == part, door.1 == part) {
            (true, false) => Some(door.1),
            (false, true) => Some(door.0),
            _ => None,
        });
        RoomShape { elongation: elongation(&places), doors: beyond.collect::<BTreeSet<usize>>().len() }
    };
    members.iter().enumerate().map(shape).collect()
}

/// Length over width of the free space: the extents of the places along their principal axes, each widened by the clearance
/// on both sides (a room of 3 x 5 m has all its places on one line of 2 m). 1 for fewer than four places.
fn elongation(places: &[&Place]) -> f64 {
    if places.len() < 4 {
        return 1.0;
    }
    let points: Vec<Vector2<f64>> = places.iter().map(|place| place.position.coords.xy()).collect();
    let mean = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let scatter: Matrix2<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    // Furniture narrows most places; the wide ones tell of the walls.
    let mut clearances: Vec<f64> = places.iter().map(|place| place.clearance_m).collect();
    clearances.sort_by(f64::total_cmp);
    let clearance_m = clearances[clearances.len() * 3 / 4].max(0.2);
    let extent_m = |axis: usize| {
        let along = points.iter().map(|p| (p - mean).dot(&eigen.eigenvectors.column(axis)));
        let (low, high) = along.fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        high - low + 2.0 * clearance_m
    };
    let (a, b) = (extent_m(0), extent_m(1));
    a.max(b) / a.min(b)
}

/// Names from kinds where they are sure enough; "room N" otherwise; a user's name always. The older room keeps the plain
/// name, later ones are numbered.
pub(crate) fn name_rooms(rooms: &mut [Room], config: &RoomConfig) {
    let mut taken: BTreeSet<String> =
        rooms.iter().filter(|room| room.is_user_named).map(|room| room.name.clone()).collect();
    let mut order: Vec<usize> = (0..rooms.len()).filter(|&at| !rooms[at].is_user_named).collect();
    order.sort_by_key(|&at| rooms[at].id);
    // A room whose present name still fits keeps it, so that "bedroom 2" does not become "bedroom" because the first went.
    let wish = |room: &Room| match &room.kind {
        Some(kind) if room.kind_confidence >= config.name_confidence => kind.clone(),
        // Once named, doubt must be serious before the name goes.
        Some(kind) if room.kind_confidence >= 0.6 * config.name_confidence && is_numbered(&room.name, kind) => {
            kind.clone()
        }
        _ => String::new(),
    };
    let wishes: Vec<String> = rooms.iter().map(wish).collect();
    let mut waiting = Vec::new();
    for at in order {
        let keeps = !wishes[at].is_empty() && is_numbered(&rooms[at].name, &wishes[at]);
        if !(keeps && taken.insert(rooms[at].name.clone())) {
            waiting.push(at);
        }
    }
    for at in waiting {
        let plain = format!("room {}", rooms[at].id.0);
        let base = if wishes[at].is_empty() { plain } else { wishes[at].clone() };
        let numbered = (2..).map(|n| format!("{base} {n}"));
        let name = std::iter::once(base.clone()).chain(numbered).find(|name| !taken.contains(name));
        rooms[at].name = name.expect("names are numbered without end");
        taken.insert(rooms[at].name.clone());
    }
}

/// Whether a name is the kind, or the kind and a number.
pub(crate) fn is_numbered(name: &str, kind: &str) -> bool {
    match name.strip_prefix(kind) {
        Some("") => true,
        Some(rest) => rest.strip_prefix(' ').is_some_and(|n| n.parse::<u32>().is_ok()),
        None => false,
    }
}

fn door_ops(
    graph: &SceneGraph,
    room_of: &[RoomId],
    doorways: &[(usize, usize, Point3<f64>, f64)],
    removed: &[RoomId],
) -> Vec<Op> {
    let mut doors: BTreeMap<(RoomId, RoomId), RoomEdge> = BTreeMap::new();
    for (from, to, doorway, width_m) in doorways {
        let (Some(&from), Some(&to)) = (room_of.get(*from), room_of.get(*to)) else {
            continue;
        };
        if from == to {
            continue;
        }
        let door = RoomEdge { a: from.min(to), b: from.max(to), doorway: *doorway, width_m: *width_m };
        let widest = doors.entry((door.a, door.b)).or_insert(door);
        if door.width_m > widest.width_m {
            *widest = door;
        }
    }
    let gone = graph.room_edges().filter(|edge| !doors.contains_key(&(edge.a, edge.b)));
    // Edges of removed rooms go with them.
    let gone = gone.filter(|edge| !removed.contains(&edge.a) && !removed.contains(&edge.b));
    let mut ops: Vec<Op> = gone.map(|edge| Op::RemoveRoomEdge(edge.a, edge.b)).collect();
    ops.extend(doors.into_values().map(Op::PutRoomEdge));
    ops
}

fn building_of(graph: &SceneGraph, rooms: &[Room]) -> Building {
    let count = rooms.len().max(1) as f64;
    let sum: nalgebra::Vector3<f64> = rooms.iter().map(|room| room.center.coords).sum();
    let mut floors: BTreeMap<i32, (f64, u32)> = BTreeMap::new();
    for room in rooms {
        let storey = floors.entry(room.floor).or_insert((0.0, 0));
        storey.0 += room.center.z;
        storey.1 += 1;
    }
    let storey = |(floor, (sum, rooms)): (i32, (f64, u32))| Storey { floor, height_m: sum / f64::from(rooms), rooms };
    let known = graph.buildings().next();
    Building {
        id: known.map_or(BuildingId(0), |building| building.id),
        name: known.map_or_else(|| "building".to_owned(), |building| building.name.clone()),
        center: (sum / count).into(),
        rooms: rooms.iter().map(|room| room.id).collect(),
        storeys: floors.into_iter().map(storey).collect(),
    }
}
