//! What the robot is asked, and what counts as having done it.
//!
//! The referee reads the sentence with a grammar of its own, on the truth, so that a misunderstanding of the robot's parser
//! cannot hide in both. The grammar is small: verbs of going and finding, one noun phrase with colours, materials, one
//! relation or a room, and steps joined by "then". A sentence beyond it is refused before the robot moves.

use nalgebra::Point3;
use omni_sim::building::{Building, ObjectTruth};
use rand::{RngExt, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::rule::Rule;

/// Largest gap between two boxes that a referee calls "near".
pub const NEAR_M: f64 = 1.0;
/// A drawn relation is clear: the right object is nearer than this ...
const CLEARLY_NEAR_M: f64 = 0.6;
/// ... and every wrong one farther than this.
const CLEARLY_FAR_M: f64 = 1.8;

/// What has to be reached in one step; any of the listed things is right.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "reach")]
pub enum StepTruth {
    /// Stop where one of these objects can be seen from nearby.
    Object {
        /// True object ids.
        ids: Vec<u32>,
    },
    /// Be where the robot set out.
    Start,
    /// Be inside one of these rooms.
    Room {
        /// True room ids.
        ids: Vec<u32>,
    },
}

/// Kind of sentence, for the statistics of a bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskKind {
    /// "find the plant": any of the class.
    Class,
    /// "find the mug near the sink".
    Relation,
    /// "find the plant in the meeting room".
    Room,
    /// "find the red chair".
    Attribute,
    /// "go to the kitchen, then find the mug".
    TwoSteps,
    /// Written by a person; not drawn.
    Given,
}

/// A sentence and its meaning in the truth.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    /// What the robot hears.
    pub text: String,
    /// Kind of sentence.
    pub kind: TaskKind,
    /// What it takes, in order. A step without ids asks for something that is not there.
    pub steps: Vec<StepTruth>,
    /// When it counts as done.
    #[serde(default)]
    pub rule: Rule,
}

impl Task {
    /// The true objects of the last step, empty if it asks for a room or for nothing that exists.
    pub fn targets(&self) -> &[u32] {
        match self.steps.last() {
            Some(StepTruth::Object { ids }) => ids,
            _ => &[],
        }
    }

    /// Reads a sentence; `Err` says what the referee cannot judge.
    pub fn read(text: &str, building: &Building) -> Result<Task, TaskError> {
        let lower = text.to_lowercase().replace(['.', '!', '?'], " ");
        let mut steps = Vec::new();
        for part in lower
            .replace(", and then ", " then ")
            .replace(" and then ", " then ")
            .replace(", then ", " then ")
            .split(" then ")
        {
            steps.push(read_step(part, building)?);
        }
        Ok(Task { text: text.to_owned(), kind: TaskKind::Given, steps, rule: Rule::Reach })
    }
}

/// Why a sentence cannot be judged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TaskError {
    /// There is nothing to look for in it.
    NoGoal {
        /// The part that holds no goal.
        part: String,
    },
    /// Words after the goal that the referee does not understand.
    Beyond {
        /// Those words.
        words: String,
    },
}

impl std::fmt::Display for TaskError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            TaskError::NoGoal { part } => write!(
                f,
                "the instruction \"{}\" names nothing to go to; say for example \"find the mug near the sink\" or \"go to the kitchen\"",
                part.trim()
            ),
            TaskError::Beyond { words } => write!(
                f,
                "the simulator's referee cannot judge \"{words}\"; it knows \"find the [colour] THING [near|on|under|above|next to the THING] \
                 [in the ROOM]\", steps joined by \"then\""
            ),
        }
    }
}

impl std::error::Error for TaskError {}

/// Rooms that people pass through; nobody is sent to one by name.
const PASSAGES: [&str; 3] = ["hallway", "corridor", "stairwell"];

const VERBS: [&str; 22] = [
    "please", "can", "you", "find", "go", "navigate", "fly", "walk", "drive", "move", "look", "search", "locate",
    "bring", "take", "me", "to", "for", "near", "up", "towards", "stop",
];
const ARTICLES: [&str; 5] = ["the", "a", "an", "some", "any"];
const COLORS: [&str; 14] = [
    "black", "white", "grey", "gray", "red", "green", "blue", "yellow", "orange", "brown", "pink", "purple", "beige",
    "silver",
];

/// The sentences that send a robot back, in the referee's own grammar: "return", "go back" or "come back", then nothing, or "to" and
/// one of these.
fn is_way_back(words: &[&str]) -> bool {
    const PLACES: [&str; 9] = [
        "start",
        "the start",
        "your start",
        "the starting point",
        "your starting point",
        "where you started",
        "the place where you started",
        "where you came from",
        "the beginning",
    ];
    let said = words.join(" ");
    let said = said.strip_prefix("please ").unwrap_or(&said);
    let ways = ["return", "go back", "come back", "fly back", "walk back"];
    ways.iter()
        .filter_map(|way| said.strip_prefix(way))
        .any(|rest| rest.is_empty() || rest.strip_prefix(" to ").is_some_and(|place| PLACES.contains(&place)))
}

fn read_step(part: &str, building: &Building) -> Result<StepTruth, TaskError> {
    let words: Vec<&str> = part.split(|c: char| !c.is_alphanumeric() && c != '-').filter(|w| !w.is_empty()).collect();
    if is_way_back(&words) {
        return Ok(StepTruth::Start);
    }
    let start = words.iter().position(|w| !VERBS.contains(w)).unwrap_or(words.len());
    let words = &words[start..];
    if words.iter().all(|w| ARTICLES.contains(w)) {
        return Err(TaskError::NoGoal { part: part.to_owned() });
    }
    // "go to the kitchen": the whole phrase is a room.
    let phrase = strip_article(words).join(" ");
    let rooms = rooms_called(&phrase, building);
    if !rooms.is_empty() {
        return Ok(StepTruth::Room { ids: rooms });
    }
    let (phrase, room) = split_room(words);
    let room_ids = room.map(|name| rooms_called(&name, building));
    let (noun, relation) = split_relation(phrase);
    for named in std::iter::once(&noun).chain(relation.as_ref().map(|(_, anchor)| anchor)) {
        refuse_unknown_structure(named)?;
    }
    let ids = building
        .objects
        .iter()
        .filter(|object| is_called(object, &noun))
        .filter(|object| room_ids.as_ref().is_none_or(|ids| ids.contains(&object.room)))
        .filter(|object| match &relation {
            None => true,
            Some((relation, anchor)) => building.objects.iter().any(|other| {
                other.id != object.id && is_called(other, anchor) && holds(*relation, object, other, building)
            }),
        })
        .map(|object| object.id)
        .collect();
    Ok(StepTruth::Object { ids })
}

/// Relations that the referee judges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TruthRelation {
    Near,
    On,
    Under,
    Above,
}

fn holds(relation: TruthRelation, object: &ObjectTruth, anchor: &ObjectTruth, building: &Building) -> bool {
    match relation {
        TruthRelation::Near => object.room == anchor.room && object.bounds.gap_m(&anchor.bounds) <= NEAR_M,
        TruthRelation::On => rests_on(object, anchor.id, building),
        TruthRelation::Under => {
            overlaps_in_plan(object, anchor)
                && object.bounds.min.z < anchor.bounds.max.z - 0.2
                && object.bounds.center().z < anchor.bounds.center().z
        }
        TruthRelation::Above => overlaps_in_plan(object, anchor) && object.bounds.min.z >= anchor.bounds.max.z - 0.02,
    }
}

fn rests_on(object: &ObjectTruth, support: u32, building: &Building) -> bool {
    let mut current = object.supported_by;
    // A chain of supports is short; the bound guards against a loop in the truth.
    for _ in 0..8 {
        match current {
            Some(id) if id == support => return true,
            Some(id) => current = building.object(id).and_then(|o| o.supported_by),
            None => return false,
        }
    }
    false
}

fn overlaps_in_plan(a: &ObjectTruth, b: &ObjectTruth) -> bool {
    a.bounds.footprint().overlaps(&b.bounds.footprint(), 0.0)
}

/// "mug on the table in the kitchen" -> (["mug", "on", "the", "table"], "kitchen").
fn split_room<'a>(words: &'a [&'a str]) -> (&'a [&'a str], Option<String>) {
    match words.iter().rposition(|w| *w == "in" || *w == "inside") {
        Some(at) if at > 0 => (&words[..at], Some(strip_article(&words[at + 1..]).join(" "))),
        _ => (words, None),
    }
}

fn split_relation(words: &[&str]) -> (Vec<String>, Option<(TruthRelation, Vec<String>)>) {
    let owned = |part: &[&str]| strip_article(part).iter().map(|w| (*w).to_owned()).collect::<Vec<_>>();
    for (index, word) in words.iter().enumerate() {
        let relation = match *word {
            "near" | "by" | "beside" | "next" | "close" => TruthRelation::Near,
            "on" => TruthRelation::On,
            "under" | "below" | "beneath" => TruthRelation::Under,
            "above" | "over" => TruthRelation::Above,
            _ => continue,
        };
        let mut rest = &words[index + 1..];
        while rest.first().is_some_and(|w| ["to", "top", "of"].contains(w)) {
            rest = &rest[1..];
        }
        return (owned(&words[..index]), Some((relation, owned(rest))));
    }
    (owned(words), None)
}

/// Words that give a sentence a structure which this grammar does not have; unknown things are fine, they are just not there.
fn refuse_unknown_structure(words: &[String]) -> Result<(), TaskError> {
    const BEYOND: [&str; 16] = [
        "left", "right", "behind", "front", "between", "with", "without", "not", "nearest", "closest", "farthest",
        "largest", "smallest", "facing", "that", "which",
    ];
    match words.iter().position(|word| BEYOND.contains(&word.as_str())) {
        Some(at) => Err(TaskError::Beyond { words: words[at..].join(" ") }),
        None => Ok(()),
    }
}

fn strip_article<'a>(words: &'a [&'a str]) -> &'a [&'a str] {
    match words.first() {
        Some(word) if ARTICLES.contains(word) => &words[1..],
        _ => words,
    }
}

/// Whether `words` (adjectives, then a noun) describe the object: "chair" is also an "office chair".
fn is_called(object: &ObjectTruth, words: &[String]) -> bool {
    let mut noun: &[String] = words;
    while let Some(first) = noun.first() {
        let is_color = COLORS.contains(&first.as_str());
        let grey = |w: &str| if w == "gray" { "grey".to_owned() } else { w.to_owned() };
        let is_material = noun.len() > 1
            && object.material.split_whitespace().any(|m| m == first || m == first.trim_end_matches("en"));
        let names_class = object.class.split_whitespace().next() == Some(first.as_str());
        if is_color && noun.len() > 1 && !names_class {
            if object.color != grey(first) {
                return false;
            }
        } else if !is_material || names_class {
            break;
        }
        noun = &noun[1..];
    }
    let noun = noun.join(" ");
    if noun.is_empty() {
        return false;
    }
    let singular = noun.strip_suffix('s').unwrap_or(&noun);
    let is_class = |name: &str| object.class == name || object.class.ends_with(&format!(" {name}"));
    is_class(&noun) || is_class(singular)
}

fn rooms_called(phrase: &str, building: &Building) -> Vec<u32> {
    building
        .rooms
        .iter()
        .filter(|room| {
            let kind = room.kind.name();
            room.name == phrase || kind == phrase || kind.strip_suffix(" room") == Some(phrase)
        })
        .map(|room| room.id)
        .collect()
}

/// Draws sentences of a kind that have a clear meaning in this building, in random order.
pub fn draw(kind: TaskKind, building: &Building, rng: &mut ChaCha8Rng) -> Vec<Task> {
    let mut tasks = match kind {
        TaskKind::Class => draw_class(building),
        TaskKind::Relation => draw_relation(building),
        TaskKind::Room => draw_room(building),
        TaskKind::Attribute => draw_attribute(building),
        TaskKind::TwoSteps => draw_two_steps(building, rng),
        TaskKind::Given => Vec::new(),
    };
    // Fisher-Yates; each sentence once.
    for index in (1..tasks.len()).rev() {
        tasks.swap(index, rng.random_range(0..=index));
    }
    tasks
}

/// Things one can be sent to: seen from the floor, not too small, not a part of the building.
fn is_target(object: &ObjectTruth) -> bool {
    let size = object.bounds.max - object.bounds.min;
    let largest_m = size.x.max(size.y).max(size.z);
    largest_m >= 0.08
        && object.bounds.min.z < 1.6
        && !["door", "rug", "carpet", "curtain"].contains(&object.class.as_str())
}

fn classes(building: &Building) -> Vec<String> {
    let mut classes: Vec<String> = building.objects.iter().filter(|o| is_target(o)).map(|o| o.class.clone()).collect();
    classes.sort();
    classes.dedup();
    classes
}

fn of_class<'a>(class: &'a str, building: &'a Building) -> impl Iterator<Item = &'a ObjectTruth> {
    building.objects.iter().filter(move |o| o.class == class || o.class.ends_with(&format!(" {class}")))
}

fn object_task(text: String, kind: TaskKind, mut ids: Vec<u32>) -> Task {
    ids.sort_unstable();
    Task { text, kind, steps: vec![StepTruth::Object { ids }], rule: Rule::Reach }
}

fn draw_class(building: &Building) -> Vec<Task> {
    classes(building)
        .into_iter()
        .map(|class| {
            let ids = of_class(&class, building).map(|o| o.id).collect();
            object_task(format!("find the {class}"), TaskKind::Class, ids)
        })
        .collect()
}

fn draw_relation(building: &Building) -> Vec<Task> {
    let classes = classes(building);
    let mut tasks = Vec::new();
    for class in &classes {
        let all: Vec<&ObjectTruth> = of_class(class, building).collect();
        if all.len() < 2 {
            continue;
        }
        for anchor_class in &classes {
            if anchor_class == class || anchor_class.ends_with(class.as_str()) || class.ends_with(anchor_class.as_str())
            {
                continue;
            }
            let anchors: Vec<&ObjectTruth> = of_class(anchor_class, building).collect();
            // On: exactly those that rest on one; nothing is almost on something.
            let on: Vec<u32> =
                all.iter().filter(|o| anchors.iter().any(|a| rests_on(o, a.id, building))).map(|o| o.id).collect();
            let nearly_on = all.iter().any(|o| {
                !on.contains(&o.id) && anchors.iter().any(|a| o.room == a.room && o.bounds.gap_m(&a.bounds) < 0.3)
            });
            if !on.is_empty() && on.len() < all.len() && !nearly_on {
                tasks.push(object_task(format!("find the {class} on the {anchor_class}"), TaskKind::Relation, on));
                continue;
            }
            // Near: clearly near, all others clearly far.
            let gap = |o: &ObjectTruth| {
                anchors
                    .iter()
                    .filter(|a| a.room == o.room)
                    .map(|a| o.bounds.gap_m(&a.bounds))
                    .fold(f64::INFINITY, f64::min)
            };
            let near: Vec<u32> = all.iter().filter(|o| gap(o) <= CLEARLY_NEAR_M).map(|o| o.id).collect();
            let unclear = all.iter().any(|o| gap(o) > CLEARLY_NEAR_M && gap(o) < CLEARLY_FAR_M);
            if !near.is_empty() && near.len() < all.len() && !unclear {
                tasks.push(object_task(format!("find the {class} near the {anchor_class}"), TaskKind::Relation, near));
            }
        }
    }
    tasks
}

fn draw_room(building: &Building) -> Vec<Task> {
    let mut tasks = Vec::new();
    for class in classes(building) {
        let all: Vec<&ObjectTruth> = of_class(&class, building).collect();
        let mut kinds: Vec<&str> = all.iter().map(|o| building.rooms[o.room as usize].kind.name()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        if kinds.len() < 2 {
            continue;
        }
        for kind in kinds.into_iter().filter(|kind| !PASSAGES.contains(kind)) {
            let ids =
                all.iter().filter(|o| building.rooms[o.room as usize].kind.name() == kind).map(|o| o.id).collect();
            tasks.push(object_task(format!("find the {class} in the {kind}"), TaskKind::Room, ids));
        }
    }
    tasks
}

fn draw_attribute(building: &Building) -> Vec<Task> {
    let mut tasks = Vec::new();
    for class in classes(building) {
        let all: Vec<&ObjectTruth> = of_class(&class, building).collect();
        let mut colors: Vec<&str> = all.iter().map(|o| o.color.as_str()).collect();
        colors.sort_unstable();
        colors.dedup();
        if colors.len() < 2 {
            continue;
        }
        for color in colors {
            let ids = all.iter().filter(|o| o.color == color).map(|o| o.id).collect();
            tasks.push(object_task(format!("find the {color} {class}"), TaskKind::Attribute, ids));
        }
    }
    tasks
}

fn draw_two_steps(building: &Building, rng: &mut ChaCha8Rng) -> Vec<Task> {
    let mut first: Vec<Task> = building
        .rooms
        .iter()
        .filter(|room| !PASSAGES.contains(&room.kind.name()))
        .map(|room| Task {
            text: format!("go to the {}", room.kind.name()),
            kind: TaskKind::TwoSteps,
            steps: vec![StepTruth::Room { ids: rooms_called(room.kind.name(), building) }],
            rule: Rule::Reach,
        })
        .collect();
    first.dedup_by(|a, b| a.text == b.text);
    first.extend(draw_class(building));
    let second: Vec<Task> =
        [draw_class(building), draw_relation(building), draw_room(building), draw_attribute(building)].concat();
    let mut tasks = Vec::new();
    if first.is_empty() || second.is_empty() {
        return tasks;
    }
    for _ in 0..40 {
        let (a, b) = (first.choose(rng).expect("not empty"), second.choose(rng).expect("not empty"));
        if a.steps == b.steps {
            continue;
        }
        tasks.push(Task {
            text: format!("{}, then {}", a.text, b.text),
            kind: TaskKind::TwoSteps,
            steps: [a.steps.clone(), b.steps.clone()].concat(),
            rule: Rule::Reach,
        });
    }
    tasks
}

/// Middle of the true object, for a report.
pub fn center_of(id: u32, building: &Building) -> Option<Point3<f64>> {
    building.object(id).map(|object| object.bounds.center())
}
