//! Sorting a graph into the three tiers of the prompt, with names, octants and distances: the whole geometry of a prompt.

use std::collections::HashMap;

use dsg::{ObjectId, PlaceId, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3};

use crate::names::class_token;
use crate::octant::{Bearing, Octant, octant_of, point_in_body};
use crate::prompt::{Naming, PromptConfig};
use crate::situation::room_of;
use crate::vocabulary::{Class, class_similarity, functional_group};

/// What is looked at.
pub struct View<'a> {
    /// The graph.
    pub graph: &'a SceneGraph,
    /// The pose.
    pub world_from_body: &'a Isometry3<f64>,
    /// Frontier places.
    pub frontiers: &'a [PlaceId],
    /// Places to look from.
    pub unseen: &'a [PlaceId],
    /// Path lengths.
    pub path_length: &'a dyn Fn(&Point3<f64>) -> Option<f64>,
    /// Classes the instruction mentions.
    pub nouns: &'a [String],
    /// Radii, naming.
    pub config: &'a PromptConfig,
}

/// The sorted scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Tiers {
    /// The agent's room: its name in the prompt and its own name, if it has one.
    pub here: Option<(RoomId, String, Option<String>)>,
    /// Focal radius, for the text.
    pub focal_radius_m: f64,
    /// Own room within the radius, nearest first.
    pub focal: Vec<Item>,
    /// Own room beyond, nearest first.
    pub peripheral: Vec<Item>,
    /// Other rooms, nearest first.
    pub rooms: Vec<RoomItem>,
    /// Frontiers and places to look from, nearest first, spread out.
    pub places: Vec<PlaceItem>,
    /// Words of a caption.
    pub max_caption_words: usize,
}

/// One object of the agent's room.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// Which.
    pub id: ObjectId,
    /// Its name.
    pub name: String,
    /// Functional group.
    pub group: &'static str,
    /// Its octant.
    pub octant: Octant,
    /// Distance of its centre from the body origin.
    pub distance_m: f64,
    /// Whether the instruction mentions its class.
    pub is_asked: bool,
    /// Its caption.
    pub caption: String,
}

/// One other room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomItem {
    /// Which; None for objects that no room holds.
    pub id: Option<RoomId>,
    /// `room3`, or `outside`.
    pub name: String,
    /// Its own name, if it says more than a number.
    pub label: Option<String>,
    /// Direction of its centre.
    pub bearing: Bearing,
    /// Distance of its centre.
    pub distance_m: f64,
    /// Whether it holds a class the instruction mentions.
    pub is_asked: bool,
    /// Its objects by group (sorted by name) and class.
    pub groups: Vec<GroupItem>,
    /// Names of all its objects.
    pub objects: Vec<(String, ObjectId)>,
}

/// A functional group in another room.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupItem {
    /// Its word.
    pub group: &'static str,
    /// Class words with counts, sorted.
    pub counts: Vec<(String, usize)>,
    /// Distance of its nearest object.
    pub nearest_m: f64,
    /// Distance of its farthest object.
    pub farthest_m: f64,
}

/// A place to explore.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceItem {
    /// Which.
    pub id: PlaceId,
    /// `frontier1` or `view1`.
    pub name: String,
    /// Direction.
    pub bearing: Bearing,
    /// Length of the way, or the straight distance where that is unknown.
    pub distance_m: f64,
}

struct ClassFacts {
    token: String,
    group: &'static str,
    is_asked: bool,
}

struct Row<'a> {
    object: &'a dsg::Object,
    class: usize,
    in_body: Point3<f64>,
    distance_m: f64,
}

/// Sorts. Cost: O(n log n) in objects, linear in rooms and places.
pub fn tiers(view: &View) -> Tiers {
    let position = Point3::from(view.world_from_body.translation.vector);
    let here = room_of(view.graph, &position);
    let (classes, mut rows) = rows(view);
    let by_distance = |a: &Row, b: &Row| a.distance_m.total_cmp(&b.distance_m).then(a.object.id.cmp(&b.object.id));
    if view.config.naming == Naming::Rank {
        rows.sort_by(by_distance); // else by id, as the graph lists them: the order gives the ordinals
    }
    let mut ordinals: HashMap<(Option<RoomId>, &str), usize> = HashMap::new();
    let names: Vec<String> = rows
        .iter()
        .map(|row| {
            let facts = &classes[row.class];
            let ordinal = ordinals.entry((row.object.room, facts.token.as_str())).and_modify(|n| *n += 1).or_insert(1);
            let mut name = if row.object.room == here { String::new() } else { room_name(row.object.room) + "." };
            name.push_str(&facts.token);
            name.push_str(&ordinal.to_string());
            name
        })
        .collect();

    let (mut focal, mut peripheral) = (Vec::new(), Vec::new());
    let mut elsewhere: HashMap<Option<RoomId>, Vec<usize>> = HashMap::new();
    for (index, row) in rows.iter().enumerate() {
        if row.object.room != here {
            elsewhere.entry(row.object.room).or_default().push(index);
            continue;
        }
        let facts = &classes[row.class];
        let item = Item {
            id: row.object.id,
            name: names[index].clone(),
            group: facts.group,
            octant: octant_of(&row.in_body, view.config.camera_height_m),
            distance_m: row.distance_m,
            is_asked: facts.is_asked,
            caption: if facts.is_asked { row.object.caption.clone() } else { String::new() },
        };
        if row.distance_m <= view.config.focal_radius_m { focal.push(item) } else { peripheral.push(item) }
    }
    for items in [&mut focal, &mut peripheral] {
        items.sort_by(|a: &Item, b: &Item| a.distance_m.total_cmp(&b.distance_m).then(a.id.cmp(&b.id)));
    }

    let mut rooms: Vec<RoomItem> = Vec::new();
    let others = view
        .graph
        .rooms()
        .filter(|room| Some(room.id) != here)
        .map(|room| (Some(room.id), room.center, own_name(&room.name)));
    for (id, center, label) in others {
        let members = elsewhere.remove(&id).unwrap_or_default();
        rooms.push(room_item(view, id, label, &center, &members, &rows, &classes, &names));
    }
    if let Some(members) = elsewhere.remove(&None).filter(|_| here.is_some()) {
        let center = rows[members[0]].object.centroid;
        rooms.push(room_item(view, None, None, &center, &members, &rows, &classes, &names));
    }
    rooms.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.id.cmp(&b.id)));

    let own =
        here.and_then(|id| view.graph.room(id)).map(|room| (room.id, room_name(Some(room.id)), own_name(&room.name)));
    Tiers {
        here: own,
        focal_radius_m: view.config.focal_radius_m,
        focal,
        peripheral,
        rooms,
        places: places(view),
        max_caption_words: view.config.max_caption_words,
    }
}

fn rows<'a>(view: &View<'a>) -> (Vec<ClassFacts>, Vec<Row<'a>>) {
    let asked: Vec<Class> = view.nouns.iter().map(|noun| Class::new(noun)).collect();
    let mut index: HashMap<&str, usize> = HashMap::new();
    let mut classes: Vec<ClassFacts> = Vec::new();
    let rows = view
        .graph
        .objects()
        .map(|object| {
            let class = *index.entry(object.label.as_str()).or_insert_with(|| {
                let class = Class::new(&object.label);
                let is_asked = asked.iter().any(|noun| class_similarity(noun, &class) >= 0.5);
                classes.push(ClassFacts {
                    token: class_token(&object.label),
                    group: functional_group(&class),
                    is_asked,
                });
                classes.len() - 1
            });
            let in_body = point_in_body(view.world_from_body, &object.centroid);
            Row { object, class, in_body, distance_m: in_body.coords.norm() }
        })
        .collect();
    (classes, rows)
}

#[allow(clippy::too_many_arguments)] // parts of one loop
fn room_item(
    view: &View,
    id: Option<RoomId>,
    label: Option<String>,
    center: &Point3<f64>,
    members: &[usize],
    rows: &[Row],
    classes: &[ClassFacts],
    names: &[String],
) -> RoomItem {
    let in_body = point_in_body(view.world_from_body, center);
    let mut groups: Vec<GroupItem> = Vec::new();
    for &member in members {
        let (facts, distance_m) = (&classes[rows[member].class], rows[member].distance_m);
        let at = groups.iter().position(|group| group.group == facts.group).unwrap_or_else(|| {
            groups.push(GroupItem {
                group: facts.group,
                counts: Vec::new(),
                nearest_m: f64::INFINITY,
                farthest_m: 0.0,
            });
            groups.len() - 1
        });
        let group = &mut groups[at];
        group.nearest_m = group.nearest_m.min(distance_m);
        group.farthest_m = group.farthest_m.max(distance_m);
        match group.counts.iter_mut().find(|(token, _)| *token == facts.token) {
            Some((_, count)) => *count += 1,
            None => group.counts.push((facts.token.clone(), 1)),
        }
    }
    for group in &mut groups {
        group.counts.sort();
    }
    groups.sort_by_key(|group| group.group);
    RoomItem {
        id,
        name: room_name(id),
        label,
        bearing: Bearing::of(&in_body),
        distance_m: in_body.coords.norm(),
        is_asked: members.iter().any(|member| classes[rows[*member].class].is_asked),
        groups,
        objects: members.iter().map(|member| (names[*member].clone(), rows[*member].object.id)).collect(),
    }
}

/// Frontiers and places to look from: the nearest first, each at least 1.5 m from those before it.
fn places(view: &View) -> Vec<PlaceItem> {
    const MAX_PLACES: usize = 6;
    const SPREAD_M: f64 = 1.5;
    let mut out = Vec::new();
    for (list, word) in [(view.frontiers, "frontier"), (view.unseen, "view")] {
        let mut sorted: Vec<(f64, PlaceId, Point3<f64>)> = list
            .iter()
            .filter_map(|id| view.graph.place(*id))
            .filter_map(|place| Some(((view.path_length)(&place.position)?, place.id, place.position)))
            .filter(|(distance_m, _, _)| distance_m.is_finite())
            .collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut chosen: Vec<Point3<f64>> = Vec::new();
        for (distance_m, id, position) in sorted {
            if chosen.len() == MAX_PLACES {
                break;
            }
            if chosen.iter().all(|other| (other - position).norm() >= SPREAD_M) {
                chosen.push(position);
                let bearing = Bearing::of(&point_in_body(view.world_from_body, &position));
                out.push(PlaceItem { id, name: format!("{word}{}", chosen.len()), bearing, distance_m });
            }
        }
    }
    out
}

fn room_name(id: Option<RoomId>) -> String {
    id.map_or_else(|| "outside".to_string(), |id| format!("room{}", id.0))
}

/// A room's own name for the text: letters, digits and spaces, at most 24 bytes; None for "room 3".
fn own_name(name: &str) -> Option<String> {
    let mut out = crate::vocabulary::normalise(name);
    while out.len() > 24 {
        out.pop();
    }
    let numbered = out.strip_prefix("room ").is_some_and(|rest| rest.bytes().all(|byte| byte.is_ascii_digit()));
    let out = out.trim_end().to_string();
    (!out.is_empty() && out != "room" && !numbered).then_some(out)
}
