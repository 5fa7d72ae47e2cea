//! Sorting a graph into the three tiers of the prompt, with names, octants and distances: the whole geometry of a prompt.

use dsg::{ObjectId, PlaceId, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3};
use rustc_hash::FxHashMap;

use crate::instruction::RoomReference;
use crate::names::class_token;
use crate::octant::{Bearing, octant_of, point_in_body};
use crate::prompt::{Naming, PromptConfig};
use crate::situation::room_of;
use crate::tier_items::{AreaItem, GroupItem, Item, PlaceItem, RoomItem, Run, Tiers};
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
    /// Rooms the instruction names.
    pub rooms: &'a [RoomReference],
    /// Radii, naming.
    pub config: &'a PromptConfig,
}

/// Most things of the own room that are listed one by one; of more than that, the nearest [`NEAREST_LISTED`].
const MAX_LISTED: usize = 32;
/// Things listed where the own room holds too many.
const NEAREST_LISTED: usize = 12;
/// Most other rooms with a line each; of more than that, the nearest [`NEAREST_LINES`].
const MAX_LINES: usize = 8;
/// Rooms with a line where there are too many.
const NEAREST_LINES: usize = 6;
/// Rooms named in the instruction that get a line wherever they are.
const MAX_NAMED: usize = 4;
/// Where the first ring of areas ends, metres.
const RING_M: f64 = 20.0;
/// Each further ring ends this many times as far.
const RING_GROWTH: f64 = 3.0;
/// Rings are not counted beyond this.
const MAX_RING: i32 = 20;

pub(crate) struct ClassFacts {
    token: String,
    group: &'static str,
    pub(crate) is_asked: bool,
}

#[derive(Clone, Copy)]
pub(crate) struct Row {
    id: ObjectId,
    class: usize,
    in_body: Point3<f64>,
    distance_m: f64,
}

/// Where the objects of a room are described.
#[derive(Clone, Copy)]
pub(crate) enum Part {
    Here,
    Line(usize),
    Area(usize),
}

/// Another room, before its objects are known.
pub(crate) struct Other<'a> {
    id: Option<RoomId>,
    room: Option<&'a dsg::Room>,
    in_body: Point3<f64>,
    distance_m: f64,
    is_named: bool,
}

/// Sorts. Cost: linear in objects and places, O(n log n) in rooms and in the objects of the own room and of the rooms with a line.
/// [`crate::tier_index`] does the same without touching all objects again, for another pose in the same graph.
pub fn tiers(view: &View) -> Tiers {
    let position = Point3::from(view.world_from_body.translation.vector);
    let here = room_of(view.graph, &position);
    let homeless = view.graph.objects().filter(|object| object.room.is_none());
    let parted = Parted::new(view, here, nearest(homeless.map(|object| &object.centroid), &position));

    // One pass over the objects.
    let mut classes = Classes::new(view.nouns);
    let mut rows = PartRows::new(&parted);
    for object in view.graph.objects() {
        let class = classes.of(&object.label);
        let Some((part, room_m)) = parted.part_of(object.room) else { continue };
        if let Part::Area(area) = part {
            let room = object.room.filter(|_| classes.facts[class].is_asked);
            rows.count(area, class, 1, room.map(|room| (room_m, room)));
        } else {
            rows.list(view, part, object, class, &classes);
        }
    }
    finish(view, here, parted, rows, &classes)
}

/// Which room is described where.
pub(crate) struct Parted<'a> {
    parts: FxHashMap<Option<RoomId>, (Part, f64)>,
    lines: Vec<Other<'a>>,
    areas: Vec<AreaItem>,
}

impl<'a> Parted<'a> {
    /// Sorts the rooms; `homeless` is the nearest thing that no room holds.
    pub(crate) fn new(view: &View<'a>, here: Option<RoomId>, homeless: Option<&Point3<f64>>) -> Parted<'a> {
        let others = others(view, here, homeless);
        let is_lined = lined(&others);
        let (mut parts, mut lines, mut areas) = (FxHashMap::default(), Vec::new(), Vec::<AreaItem>::new());
        let mut area_of: FxHashMap<(i32, &str), usize> = FxHashMap::default();
        for (other, is_lined) in others.into_iter().zip(is_lined) {
            let (id, distance_m) = (other.id, other.distance_m);
            let part = if is_lined {
                lines.push(other);
                Part::Line(lines.len() - 1)
            } else {
                Part::Area(area(&other, &mut areas, &mut area_of))
            };
            parts.insert(id, (part, distance_m));
        }
        // Where the robot is in no room, what no room holds is around it.
        parts.insert(here, (Part::Here, 0.0));
        Parted { parts, lines, areas }
    }

    /// Where the things of a room are described, and how far away the room is.
    pub(crate) fn part_of(&self, room: Option<RoomId>) -> Option<(Part, f64)> {
        self.parts.get(&room).or_else(|| self.parts.get(&None)).copied()
    }
}

/// What goes into each part.
pub(crate) struct PartRows<'a> {
    own: Vec<Row>,
    own_captions: FxHashMap<ObjectId, &'a str>,
    lines: Vec<Vec<Row>>,
    /// Per area and class.
    counts: Vec<Vec<u32>>,
    /// (area, class) -> the nearest room with a thing of an asked class.
    nearest_asked: FxHashMap<(usize, usize), (f64, RoomId)>,
}

impl<'a> PartRows<'a> {
    pub(crate) fn new(parted: &Parted) -> PartRows<'a> {
        PartRows {
            own: Vec::new(),
            own_captions: FxHashMap::default(),
            lines: vec![Vec::new(); parted.lines.len()],
            counts: vec![Vec::new(); parted.areas.len()],
            nearest_asked: FxHashMap::default(),
        }
    }

    /// Things of an area, of one class; `asked` is their room and its distance, if the class is asked for.
    pub(crate) fn count(&mut self, area: usize, class: usize, count: u32, asked: Option<(f64, RoomId)>) {
        let counts = &mut self.counts[area];
        if counts.len() <= class {
            counts.resize(class + 1, 0);
        }
        counts[class] += count;
        if let Some(found) = asked {
            let best = self.nearest_asked.entry((area, class)).or_insert(found);
            if found < *best {
                *best = found;
            }
        }
    }

    /// A thing of the own room or of a room with a line.
    pub(crate) fn list(
        &mut self,
        view: &View<'a>,
        part: Part,
        object: &'a dsg::Object,
        class: usize,
        classes: &Classes,
    ) {
        let in_body = point_in_body(view.world_from_body, &object.centroid);
        let row = Row { id: object.id, class, in_body, distance_m: in_body.coords.norm() };
        if let Part::Line(line) = part {
            self.lines[line].push(row);
            return;
        }
        if classes.facts[class].is_asked && !object.caption.is_empty() {
            self.own_captions.insert(object.id, &object.caption);
        }
        self.own.push(row);
    }
}

pub(crate) fn finish(view: &View, here: Option<RoomId>, parted: Parted, rows: PartRows, classes: &Classes) -> Tiers {
    let mut areas = parted.areas;
    fill_areas(&mut areas, &rows.counts, &rows.nearest_asked, classes);
    let (focal, peripheral, crowd) = own_room(view, rows.own, &rows.own_captions, classes);
    let lines = parted.lines.iter().zip(rows.lines);
    let rooms = lines.map(|(other, rows)| room_item(view, other, rows, classes)).collect();
    let own =
        here.and_then(|id| view.graph.room(id)).map(|room| (room.id, room_name(Some(room.id)), own_name(&room.name)));
    Tiers {
        here: own,
        focal_radius_m: view.config.focal_radius_m,
        focal,
        peripheral,
        crowd,
        rooms,
        areas,
        places: places(view),
        max_caption_words: view.config.max_caption_words,
    }
}

/// The point nearest to `position`; of equal ones the first.
pub(crate) fn nearest<'a>(
    points: impl Iterator<Item = &'a Point3<f64>>,
    position: &Point3<f64>,
) -> Option<&'a Point3<f64>> {
    points.min_by(|a, b| (*a - position).norm_squared().total_cmp(&(*b - position).norm_squared()))
}

/// All other rooms, nearest first; last, what no room holds, if there is any and the robot is in a room.
fn others<'a>(view: &View<'a>, here: Option<RoomId>, homeless: Option<&Point3<f64>>) -> Vec<Other<'a>> {
    let of = |id, room: Option<&'a dsg::Room>, center: &Point3<f64>| {
        let in_body = point_in_body(view.world_from_body, center);
        let is_named = room.is_some_and(|room| view.rooms.iter().any(|asked| asked.is_answered_by(room)));
        Other { id, room, in_body, distance_m: in_body.coords.norm(), is_named }
    };
    let rooms = view.graph.rooms().filter(|room| Some(room.id) != here);
    let mut out: Vec<Other> = rooms.map(|room| of(Some(room.id), Some(room), &room.center)).collect();
    out.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.id.cmp(&b.id)));
    if let (Some(centroid), true) = (homeless, here.is_some()) {
        out.push(of(None, None, centroid));
    }
    out
}

/// Which of the rooms get a line: the nearest, the named ones, and what no room holds.
fn lined(others: &[Other]) -> Vec<bool> {
    let mut named = 0;
    let lines = if others.len() > MAX_LINES { NEAREST_LINES } else { MAX_LINES };
    others
        .iter()
        .enumerate()
        .map(|(index, other)| {
            named += usize::from(other.is_named);
            index < lines || other.id.is_none() || (other.is_named && named <= MAX_NAMED)
        })
        .collect()
}

/// The area of a room, made if it is the first in it. Rooms come nearest first, and so do areas.
fn area(other: &Other, areas: &mut Vec<AreaItem>, known: &mut FxHashMap<(i32, &str), usize>) -> usize {
    let ring = (other.distance_m / RING_M).log(RING_GROWTH).clamp(-1.0, f64::from(MAX_RING)).floor() as i32;
    let (x, y) = (other.in_body.x, other.in_body.y);
    let side = match (x.abs() >= y.abs(), x >= 0.0, y >= 0.0) {
        (true, true, _) => "front",
        (true, false, _) => "back",
        (false, _, true) => "left",
        (false, _, false) => "right",
    };
    let index = *known.entry((ring, side)).or_insert_with(|| {
        areas.push(AreaItem {
            side,
            nearest_m: other.distance_m,
            farthest_m: other.distance_m,
            rooms: 0,
            objects: 0,
            counts: Vec::new(),
            asked: Vec::new(),
        });
        areas.len() - 1
    });
    areas[index].rooms += 1;
    areas[index].farthest_m = other.distance_m;
    index
}

fn fill_areas(
    areas: &mut [AreaItem],
    counts: &[Vec<u32>],
    asked: &FxHashMap<(usize, usize), (f64, RoomId)>,
    classes: &Classes,
) {
    for (index, area) in areas.iter_mut().enumerate() {
        for (class, count) in counts[index].iter().enumerate().filter(|(_, count)| **count > 0) {
            area.objects += *count as usize;
            let token = &classes.facts[class].token;
            match area.counts.iter_mut().find(|(known, _)| known == token) {
                Some((_, sum)) => *sum += *count as usize,
                None => area.counts.push((token.clone(), *count as usize)),
            }
            if let Some((distance_m, room)) = asked.get(&(index, class)) {
                area.asked.push((token.clone(), *room, *distance_m));
            }
        }
        area.counts.sort();
        area.asked.sort_by(|a, b| a.0.cmp(&b.0).then(a.2.total_cmp(&b.2)).then(a.1.cmp(&b.1)));
        area.asked.dedup_by(|later, first| later.0 == first.0);
    }
}

/// What is known about the labels met so far.
pub(crate) struct Classes<'a> {
    pub(crate) facts: Vec<ClassFacts>,
    index: FxHashMap<&'a str, usize>,
    asked: Vec<Class>,
}

impl<'a> Classes<'a> {
    pub(crate) fn new(nouns: &[String]) -> Classes<'a> {
        let asked = nouns.iter().map(|noun| Class::new(noun)).collect();
        Classes { facts: Vec::new(), index: FxHashMap::default(), asked }
    }

    pub(crate) fn of(&mut self, label: &'a str) -> usize {
        let (facts, asked) = (&mut self.facts, &self.asked);
        *self.index.entry(label).or_insert_with(|| {
            let class = Class::new(label);
            let is_asked = asked.iter().any(|noun| class_similarity(noun, &class) >= 0.5);
            facts.push(ClassFacts { token: class_token(label), group: functional_group(&class), is_asked });
            facts.len() - 1
        })
    }
}

/// Ordinals of the rows of one room within their class words: by distance, or by id. Sorts the rows accordingly.
fn ordinals(view: &View, rows: &mut [Row], classes: &Classes) -> Vec<usize> {
    match view.config.naming {
        Naming::Rank => rows.sort_unstable_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.id.cmp(&b.id))),
        Naming::Stable => rows.sort_unstable_by_key(|row| row.id),
    }
    let mut seen: Vec<(&str, usize)> = Vec::new();
    rows.iter()
        .map(|row| {
            let token = classes.facts[row.class].token.as_str();
            match seen.iter_mut().find(|(known, _)| *known == token) {
                Some((_, count)) => {
                    *count += 1;
                    *count
                }
                None => {
                    seen.push((token, 1));
                    1
                }
            }
        })
        .collect()
}

fn own_room(
    view: &View,
    mut rows: Vec<Row>,
    captions: &FxHashMap<ObjectId, &str>,
    classes: &Classes,
) -> (Vec<Item>, Vec<Item>, Vec<Run>) {
    let ordinals = ordinals(view, &mut rows, classes);
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by(|a, b| rows[*a].distance_m.total_cmp(&rows[*b].distance_m).then(rows[*a].id.cmp(&rows[*b].id)));
    let listed = if rows.len() > MAX_LISTED { NEAREST_LISTED } else { rows.len() };
    let (mut focal, mut peripheral) = (Vec::new(), Vec::new());
    for &index in &order[..listed] {
        let (row, facts) = (&rows[index], &classes.facts[rows[index].class]);
        let item = Item {
            id: row.id,
            name: format!("{}{}", facts.token, ordinals[index]),
            group: facts.group,
            octant: octant_of(&row.in_body, view.config.camera_height_m),
            distance_m: row.distance_m,
            is_asked: facts.is_asked,
            caption: captions.get(&row.id).map_or_else(String::new, |caption| (*caption).to_string()),
        };
        if row.distance_m <= view.config.focal_radius_m { focal.push(item) } else { peripheral.push(item) }
    }
    let mut rest: Vec<usize> = order[listed..].to_vec();
    rest.sort_unstable();
    let rest: Vec<(Row, usize)> = rest.into_iter().map(|index| (rows[index], ordinals[index])).collect();
    (focal, peripheral, runs(&rest, classes))
}

/// Rows by class word, sorted by word.
fn runs(rows: &[(Row, usize)], classes: &Classes) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (row, ordinal) in rows {
        let token = &classes.facts[row.class].token;
        match runs.iter_mut().find(|run| run.token == *token) {
            Some(run) => run.ids.push((*ordinal, row.id)),
            None => runs.push(Run { token: token.clone(), ids: vec![(*ordinal, row.id)] }),
        }
    }
    runs.sort_by(|a, b| a.token.cmp(&b.token));
    runs
}

fn room_item(view: &View, other: &Other, mut rows: Vec<Row>, classes: &Classes) -> RoomItem {
    let ordinals = ordinals(view, &mut rows, classes);
    let mut groups: Vec<(&'static str, Vec<(Row, usize)>)> = Vec::new();
    for (row, ordinal) in rows.iter().zip(ordinals) {
        let group = classes.facts[row.class].group;
        match groups.iter_mut().find(|(known, _)| *known == group) {
            Some((_, members)) => members.push((*row, ordinal)),
            None => groups.push((group, vec![(*row, ordinal)])),
        }
    }
    groups.sort_by_key(|(group, _)| *group);
    let group_item = |(group, members): (&'static str, Vec<(Row, usize)>)| {
        let distances = || members.iter().map(|(row, _)| row.distance_m);
        GroupItem {
            group,
            nearest_m: distances().fold(f64::INFINITY, f64::min),
            farthest_m: distances().fold(0.0, f64::max),
            classes: runs(&members, classes),
        }
    };
    let mut asked: Vec<String> = rows
        .iter()
        .map(|row| &classes.facts[row.class])
        .filter(|facts| facts.is_asked)
        .map(|facts| facts.token.clone())
        .collect();
    asked.sort_unstable();
    asked.dedup();
    RoomItem {
        id: other.id,
        name: room_name(other.id),
        label: other.room.and_then(|room| own_name(&room.name)),
        bearing: Bearing::of(&other.in_body),
        distance_m: other.distance_m,
        is_asked: other.is_named || !asked.is_empty(),
        asked,
        objects: rows.len(),
        groups: groups.into_iter().map(group_item).collect(),
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

pub(crate) fn room_name(id: Option<RoomId>) -> String {
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
