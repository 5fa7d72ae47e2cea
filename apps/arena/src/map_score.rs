//! The scene graph against the truth: objects, places, doorways, relations, groups, ids of rooms.
//!
//! Pure scoring: the robot's graph, brought into the coordinates of the building, and the building go in, counts come out.
//! Each subject has a file of its own that says what counts.

pub mod assign;
pub mod groups;
pub mod objects;
pub mod places;
pub mod ratio;
pub mod relation_truth;
pub mod relations;
pub mod room_ids;
#[cfg(test)]
pub(crate) mod test_things;

use std::collections::{BTreeMap, BTreeSet};

use mission::dsg::{Aabb, ObjectId, Relation, RoomId, SceneGraph};
use nalgebra::Isometry3;
use omni_sim::building::{Bounds, Building, ObjectTruth};
use omni_sim::world::World;
use serde::Serialize;

use groups::{GroupFigures, true_groups};
use objects::{Known, Matching, ObjectFigures, SEEN_POINTS, object_figures};
use places::{
    DoorwayFigures, KnownDoorway, KnownPlace, PlaceFigures, doorway_figures, find_doors, identify_rooms, place_figures,
};
use relation_truth::{Holds, relation_truth};
use relations::{RelationFigures, key_among_things, relation_figures};
use room_ids::{RoomIdFigures, RoomIds};

/// All figures of one building, or of several.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MapScore {
    /// Layer 2.
    pub objects: ObjectFigures,
    /// Layer 3 in layer 4.
    pub places: PlaceFigures,
    /// Between rooms.
    pub doorways: DoorwayFigures,
    /// Between objects.
    pub relations: RelationFigures,
    /// Among objects.
    pub groups: GroupFigures,
    /// Over time.
    pub room_ids: RoomIdFigures,
}

impl MapScore {
    /// Of several buildings: counts added, errors thrown together, the index of the groups averaged.
    pub fn pooled<'a>(all: impl Iterator<Item = &'a MapScore> + Clone) -> MapScore {
        MapScore {
            objects: ObjectFigures::pooled(all.clone().map(|score| &score.objects)),
            places: PlaceFigures::pooled(all.clone().map(|score| &score.places)),
            doorways: DoorwayFigures::pooled(all.clone().map(|score| &score.doorways)),
            relations: RelationFigures::pooled(all.clone().map(|score| &score.relations)),
            groups: GroupFigures::pooled(all.clone().map(|score| &score.groups)),
            room_ids: RoomIdFigures::pooled(all.map(|score| &score.room_ids)),
        }
    }
}

/// What the referee knows of a survey besides the building.
#[derive(Debug, Clone, Default)]
pub struct Witness {
    /// LiDAR points on each instance.
    pub points_on: BTreeMap<u32, u64>,
    /// Rooms in which the middle of the robot was.
    pub entered: BTreeSet<u32>,
    /// The rooms' ids over time.
    pub room_ids: RoomIds,
}

/// Compares, and says in sentences what is wrong.
pub fn map_score(
    building: &Building,
    world: &World,
    graph: &SceneGraph,
    truth_from_map: &Isometry3<f64>,
    witness: &Witness,
) -> (MapScore, Vec<String>) {
    let things = &building.objects;
    let known = known_objects(graph, truth_from_map);
    let matching = Matching::of(&known, things);
    let objects = object_figures(&known, things, &matching, &witness.points_on);
    let thing_of = matching.thing_of(&known);

    let places = known_places(graph, truth_from_map);
    let room_of = identify_rooms(building, &places);
    let doorways = known_doorways(graph, truth_from_map);
    let doors = find_doors(building, &doorways, &witness.entered);

    let id_of: BTreeMap<ObjectId, u32> = thing_of.iter().map(|(object, thing)| (*object, things[*thing].id)).collect();
    let among: Vec<&ObjectTruth> = thing_of.values().collect::<BTreeSet<_>>().iter().map(|at| &things[**at]).collect();
    let truth = relation_truth(building, world, &among);
    let relations: Vec<Relation> = graph.relations().chain(graph.dropped_relations()).copied().collect();

    let true_group = true_groups(things);
    // Objects without a group are alone: their own number, beyond all numbers of groups.
    let group_of = |object: &ObjectId| {
        let group = graph.object(*object).and_then(|object| object.group);
        group.map_or((1 << 63) | object.0, |group| group.0)
    };
    let pairs: Vec<(u32, u64)> = id_of.iter().map(|(object, thing)| (true_group[thing], group_of(object))).collect();

    let score = MapScore {
        objects,
        places: place_figures(building, &places, &room_of, graph.frontiers().count()),
        doorways: doorway_figures(building, &doorways, &doors, &room_of),
        relations: relation_figures(&relations, &id_of, &truth),
        groups: GroupFigures::of(&pairs),
        room_ids: witness.room_ids.figures(),
    };
    let mut mistakes = object_mistakes(&known, things, &matching, &witness.points_on);
    mistakes.extend(place_mistakes(building, &places, &room_of));
    for (door, _) in doors.iter().filter(|(_, doorway)| doorway.is_none()) {
        let (a, b) = door.rooms;
        mistakes.push(format!("door between rooms {a} and {b} at {:.2} {:.2} not found", door.center.x, door.center.y));
    }
    mistakes.extend(relation_mistakes(building, &relations, &id_of, &truth));
    mistakes.extend(group_mistakes(building, &pairs, &id_of));
    for (room, old, new, now_s) in &witness.room_ids.changes {
        mistakes.push(format!("room {room} was {old} and became {new} at {now_s:.1} s"));
    }
    (score, mistakes)
}

/// Confirmed objects in the coordinates of the building.
fn known_objects(graph: &SceneGraph, truth_from_map: &Isometry3<f64>) -> Vec<Known> {
    let known = |object: &mission::dsg::Object| {
        let Aabb { min, max } = object.bounds.transformed(truth_from_map);
        Known { id: object.id, label: object.label.clone(), bounds: Bounds { min, max } }
    };
    graph.confirmed_objects().map(known).collect()
}

/// Places of the skeleton with their rooms.
pub fn known_places(graph: &SceneGraph, truth_from_map: &Isometry3<f64>) -> Vec<KnownPlace> {
    let skeleton = graph.places().filter(|place| !place.is_frontier());
    skeleton.map(|place| (truth_from_map * place.position, place.room)).collect()
}

fn known_doorways(graph: &SceneGraph, truth_from_map: &Isometry3<f64>) -> Vec<KnownDoorway> {
    let known = |edge: &mission::dsg::RoomEdge| KnownDoorway {
        rooms: (edge.a, edge.b),
        at: (truth_from_map * edge.doorway).xy(),
        width_m: edge.width_m,
    };
    graph.room_edges().map(known).collect()
}

/// "mug 12".
fn called(things: &[ObjectTruth], id: u32) -> String {
    let class = things.iter().find(|thing| thing.id == id).map_or("thing", |thing| &thing.class);
    format!("{class} {id}")
}

fn object_mistakes(
    known: &[Known],
    things: &[ObjectTruth],
    matching: &Matching,
    points_on: &BTreeMap<u32, u64>,
) -> Vec<String> {
    let mut mistakes = Vec::new();
    let at = |bounds: &Bounds| {
        let (middle, sides) = (bounds.center(), bounds.max - bounds.min);
        format!(
            "at {:.2} {:.2} {:.2}, {:.2} x {:.2} x {:.2} m",
            middle.x, middle.y, middle.z, sides.x, sides.y, sides.z
        )
    };
    for (thing, object) in std::iter::zip(things, &matching.known_of_thing) {
        let points = points_on.get(&thing.id).copied().unwrap_or(0);
        match object.map(|index| &known[index]) {
            None if points >= SEEN_POINTS => {
                mistakes.push(format!("missed {} {} ({points} points)", called(things, thing.id), at(&thing.bounds)));
            }
            None => {}
            Some(object) => {
                if object.label != thing.class {
                    mistakes.push(format!("{} {} is called {}", called(things, thing.id), object.id, object.label));
                }
                let off = object.bounds.center() - thing.bounds.center();
                if off.norm() > 0.1 {
                    let (truly, found) = (at(&thing.bounds), at(&object.bounds));
                    mistakes.push(format!("{} {} is {truly} but found {found}", called(things, thing.id), object.id));
                }
            }
        }
    }
    for (object, thing) in &matching.doubles {
        let object = &known[*object];
        let thing = called(things, things[*thing].id);
        mistakes.push(format!("{} {} {} is a double of {thing}", object.label, object.id, at(&object.bounds)));
    }
    for object in matching.nowhere.iter().map(|index| &known[*index]) {
        mistakes.push(format!("{} {} {} is not there", object.label, object.id, at(&object.bounds)));
    }
    mistakes
}

/// The room that a place lies in, and the one it has in the graph.
type TrueAndKnown = (Option<u32>, Option<RoomId>);
/// Places, and the sums of their coordinates.
type CountAndSums = (usize, f64, f64);

fn place_mistakes(building: &Building, places: &[KnownPlace], room_of: &BTreeMap<u32, RoomId>) -> Vec<String> {
    let mut wrong: BTreeMap<TrueAndKnown, CountAndSums> = BTreeMap::new();
    for (at, id) in places {
        let room = building.room_at(at).map(|room| room.id);
        if id.is_none() || room.is_none() || room.and_then(|room| room_of.get(&room)) != id.as_ref() {
            let sum = wrong.entry((room, *id)).or_insert((0, 0.0, 0.0));
            *sum = (sum.0 + 1, sum.1 + at.x, sum.2 + at.y);
        }
    }
    let name = |room: Option<u32>| match room.and_then(|room| building.rooms.get(room as usize)) {
        Some(room) => format!("room {} ({})", room.id, room.name),
        None => "no room".to_owned(),
    };
    let sentence = |((room, id), (count, x, y)): (TrueAndKnown, CountAndSums)| {
        let known = id.map_or("nothing".to_owned(), |id| id.to_string());
        let truly = room_of.iter().find(|(_, known)| Some(**known) == id).map(|(room, _)| *room);
        let mean = (x / count as f64, y / count as f64);
        format!("{count} places of {} are in {known} ({}), about {:.1} {:.1}", name(room), name(truly), mean.0, mean.1)
    };
    wrong.into_iter().map(sentence).collect()
}

fn relation_mistakes(
    building: &Building,
    relations: &[Relation],
    id_of: &BTreeMap<ObjectId, u32>,
    truth: &BTreeMap<relation_truth::Key, Holds>,
) -> Vec<String> {
    let say = |key: &relation_truth::Key| {
        let name = |id| called(&building.objects, id);
        let other = key.3.map(|other| format!(" and {}", name(other))).unwrap_or_default();
        format!("{} {} {}{other}", name(key.0), key.1, name(key.2))
    };
    let mut found = BTreeMap::new();
    for relation in relations {
        if let Some(key) = key_among_things(relation, id_of) {
            found.insert(key, relation.evidence);
        }
    }
    let mut mistakes = Vec::new();
    for (key, evidence) in &found {
        if evidence.verdict == mission::dsg::Verdict::Holds && !truth.contains_key(key) {
            let rooms = (building.object(key.0).map(|o| o.room), building.object(key.2).map(|o| o.room));
            let across = if rooms.0 == rooms.1 { "" } else { " (two rooms)" };
            mistakes.push(format!(
                "not true: {}{across}, {:.1} m, score {:.2}",
                say(key),
                evidence.distance_m,
                evidence.score
            ));
        }
    }
    for key in truth.iter().filter(|(_, holds)| **holds == Holds::Yes).map(|(key, _)| key) {
        match found.get(key) {
            None => mistakes.push(format!("not proposed: {}", say(key))),
            Some(evidence) if evidence.verdict != mission::dsg::Verdict::Holds => {
                mistakes.push(format!("dropped: {} ({:?}, score {:.2})", say(key), evidence.verdict, evidence.score));
            }
            Some(_) => {}
        }
    }
    mistakes
}

fn group_mistakes(building: &Building, pairs: &[(u32, u64)], id_of: &BTreeMap<ObjectId, u32>) -> Vec<String> {
    let mut found: BTreeMap<u64, BTreeMap<u32, Vec<String>>> = BTreeMap::new();
    let mut truly: BTreeMap<u32, BTreeMap<u64, Vec<String>>> = BTreeMap::new();
    for ((group, known), thing) in std::iter::zip(pairs, id_of.values()) {
        let name = called(&building.objects, *thing);
        found.entry(*known).or_default().entry(*group).or_default().push(name.clone());
        truly.entry(*group).or_default().entry(*known).or_default().push(name);
    }
    let parts = |parts: Vec<Vec<String>>| parts.iter().map(|part| part.join(", ")).collect::<Vec<_>>().join(" | ");
    let joined = found.into_values().filter(|by| by.len() > 1).map(|by| by.into_values().collect());
    let torn = truly.into_values().filter(|by| by.len() > 1).map(|by| by.into_values().collect());
    let joined = joined.map(|by| format!("wrongly one group: {}", parts(by)));
    joined.chain(torn.map(|by| format!("torn group: {}", parts(by)))).collect()
}
