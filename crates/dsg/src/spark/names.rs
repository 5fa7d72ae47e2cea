//! What they call things: layers, node symbols, partitions of robots, numbers of labels.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use serde_json::{Value, json};

use crate::graph::SceneGraph;
use crate::ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
use crate::spark::attributes::NO_LABEL;
use crate::spark::kept::kept;
use crate::spark::{BUILDING, GROUP, MAX_INDEX, OBJECT, PLACE, ROOM, symbol};

/// The names of layers that their files declare; ours has one more where there are groups.
pub(crate) fn layer_names(has_groups: bool) -> Value {
    let primary = |layer: u8| json!({ "layer": layer, "partition": 0 });
    let mut names = json!({
        "AGENTS": primary(2), "OBJECTS": primary(2), "PLACES": primary(3), "ROOMS": primary(4), "BUILDINGS": primary(5),
    });
    if has_groups {
        names["GROUPS"] = json!({ "layer": 2, "partition": 1 });
    }
    names
}

/// The layers of a graph.
pub(crate) fn layer_keys(graph: &SceneGraph) -> Vec<Value> {
    let mut keys: Vec<(u32, u32)> = [2, 3, 4, 5].map(|layer| (layer, 0)).into();
    if graph.groups().next().is_some() {
        keys.push((2, 1));
    }
    keys.extend(partitions(graph).into_values().map(|partition| (2, partition)));
    keys.into_iter().map(|(layer, partition)| json!({ "layer": layer, "partition": partition })).collect()
}

/// The partition of each robot: a letter. Ids that are letters (they come from such files) keep theirs; 0 is 'a'.
pub(super) fn partitions(graph: &SceneGraph) -> BTreeMap<AgentId, u32> {
    // The letters of other nodes are taken: two nodes must not share a symbol.
    let is_free = |byte: u8| byte.is_ascii_alphabetic() && !b"OpPRBGtS".contains(&byte);
    let is_letter = |id: u64| u8::try_from(id).is_ok_and(is_free);
    let mut given: BTreeMap<AgentId, u32> =
        graph.agents().filter(|agent| is_letter(agent.id.0)).map(|agent| (agent.id, agent.id.0 as u32)).collect();
    let mut taken: BTreeSet<u32> = given.values().copied().collect();
    for agent in graph.agents().filter(|agent| !is_letter(agent.id.0)) {
        let letters = (b'a'..=b'z').skip(agent.id.0.min(25) as usize).filter(|byte| is_free(*byte)).map(u32::from);
        let free = letters.chain(256..).find(|partition| !taken.contains(partition));
        let partition = free.unwrap_or(u32::MAX);
        taken.insert(partition);
        given.insert(agent.id, partition);
    }
    given
}

/// What a robot of a partition is called if nobody has named it.
pub(super) fn usual_name(partition: u32) -> String {
    let letter = char::from_u32(partition).filter(char::is_ascii_alphabetic);
    letter.map_or_else(|| format!("robot {partition}"), |letter| format!("robot {letter}"))
}

/// Their ids of our nodes: letter and number, except where they had another or the number is too large.
pub(super) struct Names {
    /// Lists of which something is kept.
    pub is_kept: BTreeSet<&'static str>,
    unusual: BTreeMap<(u8, u64), u64>,
    /// All ids that are given.
    pub taken: HashSet<u64>,
    poses: BTreeMap<AgentId, Vec<u64>>,
    free: FreeIds,
}

/// Numbers that nobody has, from the last one down: no search starts anew.
#[derive(Default)]
struct FreeIds(BTreeMap<u8, u64>);

impl FreeIds {
    /// The wished id if it is free, else the last free one of the letter.
    fn take(&mut self, letter: u8, wish: Option<u64>, taken: &mut HashSet<u64>) -> u64 {
        let next = self.0.entry(letter).or_insert(MAX_INDEX);
        let mut id = wish.unwrap_or_else(|| symbol(letter, MAX_INDEX - 1));
        while !taken.insert(id) {
            *next -= 1;
            id = symbol(letter, *next);
        }
        id
    }
}

impl Names {
    pub fn of(graph: &SceneGraph) -> Names {
        let lists = ["objects", "places", "rooms", "buildings", "groups", "agents", "place_edges", "room_edges"];
        let has = |list: &&&str| {
            let start = format!("{list}/");
            graph.unknown_fields.range(start.clone()..).next().is_some_and(|(key, _)| key.starts_with(&start))
        };
        let is_kept: BTreeSet<&'static str> = lists.iter().filter(has).copied().collect();
        let mut names = Names {
            is_kept,
            unusual: BTreeMap::new(),
            taken: HashSet::new(),
            poses: BTreeMap::new(),
            free: FreeIds::default(),
        };
        let mut wishes: Vec<((u8, u64), Option<u64>)> = Vec::new();
        {
            let mut see = |letter: u8, list: &'static str, number: u64, id: &dyn std::fmt::Display| {
                let of_theirs = if names.is_kept.contains(list) { kept(graph, list, &id) } else { None };
                let wish = of_theirs.and_then(|kept| kept.get("id")?.as_u64());
                if wish.is_some() || number >= MAX_INDEX {
                    wishes.push(((letter, number), wish));
                } else {
                    names.taken.insert(symbol(letter, number));
                }
            };
            graph.objects.keys().for_each(|id| see(OBJECT, "objects", id.0, id));
            graph.places.keys().for_each(|id| see(PLACE, "places", id.0, id));
            graph.rooms.keys().for_each(|id| see(ROOM, "rooms", id.0, id));
            graph.buildings.keys().for_each(|id| see(BUILDING, "buildings", id.0, id));
            graph.groups.keys().for_each(|id| see(GROUP, "groups", id.0, id));
        }
        for ((letter, number), wish) in wishes {
            let id = names.free.take(letter, wish, &mut names.taken);
            names.unusual.insert((letter, number), id);
        }
        // Poses: the letter of the robot and the number of the pose, or the id that they had.
        for (id, partition) in partitions(graph) {
            let of_poses = kept(graph, "agents", &id).and_then(|kept| kept.get("poses"));
            let wish = |index: usize| {
                let of_pose = of_poses.and_then(|poses| poses.get(index.to_string()));
                of_pose.and_then(|kept| kept.get("id")?.as_u64()).unwrap_or(symbol(partition as u8, index as u64))
            };
            let count = graph.agents[&id].trajectory.len();
            let ids = (0..count).map(|index| names.free.take(partition as u8, Some(wish(index)), &mut names.taken));
            names.poses.insert(id, ids.collect());
        }
        names
    }

    fn id(&self, letter: u8, number: u64) -> u64 {
        if self.unusual.is_empty() {
            return symbol(letter, number);
        }
        self.unusual.get(&(letter, number)).copied().unwrap_or_else(|| symbol(letter, number))
    }

    /// Those of a robot's poses.
    pub fn poses(&self, id: AgentId) -> &[u64] {
        self.poses.get(&id).map_or(&[], Vec::as_slice)
    }

    pub fn object(&self, id: ObjectId) -> u64 {
        self.id(OBJECT, id.0)
    }

    pub fn place(&self, id: PlaceId) -> u64 {
        self.id(PLACE, id.0)
    }

    pub fn room(&self, id: RoomId) -> u64 {
        self.id(ROOM, id.0)
    }

    pub fn building(&self, id: BuildingId) -> u64 {
        self.id(BUILDING, id.0)
    }

    pub fn group(&self, id: GroupId) -> u64 {
        self.id(GROUP, id.0)
    }
}

/// Numbers for labels: theirs where they gave one, else the next.
#[derive(Default)]
pub(super) struct Labels {
    pub numbers: BTreeMap<String, u32>,
    /// Those that we gave.
    pub own: BTreeMap<String, u32>,
}

impl Labels {
    pub fn of(graph: &SceneGraph) -> Labels {
        let mut labels = Labels::default();
        let mut open = BTreeSet::new();
        for object in graph.objects() {
            // What they said of it while it was called so; nothing is also something.
            let theirs = kept(graph, "objects", &object.id).and_then(|kept| {
                let then = kept.get("instead_of")?.get("semantic_label")?.as_str()?;
                (then == object.label).then_some(kept.get("attributes")?.get("semantic_label")?)
            });
            let number = theirs.and_then(Value::as_u64).and_then(|number| u32::try_from(number).ok());
            if let Some(number) = number.filter(|number| *number != NO_LABEL) {
                labels.numbers.entry(object.label.clone()).or_insert(number);
            } else if theirs.is_none() {
                open.insert(object.label.clone());
            }
        }
        let mut next = labels.numbers.values().max().map_or(1, |most| most.saturating_add(1));
        for label in open {
            if !labels.numbers.contains_key(&label) {
                labels.numbers.insert(label.clone(), next);
                labels.own.insert(label, next);
                next = next.saturating_add(1);
            }
        }
        labels
    }
}
