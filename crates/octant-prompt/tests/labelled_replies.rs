//! Ten thousand labelled replies. The scenes are built so that the right answer is known by construction, not by the grounder: each
//! sentence names one thing by its support, its neighbour or its room, and the other things of its class stand elsewhere.

mod support;

use dsg::{ObjectId, PlaceId, RoomId, SceneGraph};
use nalgebra::Point3;
use octant_prompt::{Critic, Estimate, PromptConfig, Situation, build_prompt_for, parse_instruction, parse_reply};
use support::{Put, corner, graph, pose, put};

const REPLIES: usize = 10_000;
const ROOMS: [&str; 3] = ["kitchen", "bedroom", "office"];
const FURNITURE: [&str; 12] = [
    "table",
    "desk",
    "shelf",
    "bench",
    "dresser",
    "stove",
    "nightstand",
    "piano",
    "printer",
    "ottoman",
    "cart",
    "crib",
];
const SMALL: [&str; 6] = ["mug", "book", "bottle", "backpack", "vase", "laptop"];

/// SplitMix64.
struct Draw(u64);

impl Draw {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % count as u64) as usize
    }
}

struct World {
    graph: SceneGraph,
    sentence: String,
    target: ObjectId,
    target_room: usize,
    /// Things of the class that are not meant.
    twins: Vec<ObjectId>,
    /// Things of other classes, neither meant nor mentioned.
    strangers: Vec<ObjectId>,
    names_room: bool,
}

/// Four pieces of furniture a room, 3 m apart, all of different classes; three things of one class on three of them, in three rooms.
fn world(draw: &mut Draw) -> World {
    let mut classes = FURNITURE.to_vec();
    let mut things: Vec<Put> = Vec::new();
    for slot in 0..12 {
        let class = classes.swap_remove(draw.below(classes.len()));
        let (x, y) = corner(slot / 4);
        let (dx, dy) = (1.0 + 3.0 * (slot % 2) as f64, 1.0 + 3.0 * (slot / 2 % 2) as f64);
        things.push(Put { size_m: 0.6, ..put(class, x + dx, y + dy, 0.3) });
    }
    let small = SMALL[draw.below(SMALL.len())];
    let slots = [draw.below(4), 4 + draw.below(4), 8 + draw.below(4)];
    let kind = draw.below(3);
    for slot in slots {
        let base = things[slot].at;
        // On top, or on the floor a hand's breadth beside it.
        let at = if kind == 1 { Point3::new(base.x + 0.45, base.y, 0.1) } else { Point3::new(base.x, base.y, 0.7) };
        things.push(Put { size_m: 0.2, ..put(small, at.x, at.y, at.z) });
    }
    let meant = draw.below(3);
    let anchor = things[slots[meant]].label.clone();
    let sentence = match kind {
        0 => format!("find the {small} on the {anchor}"),
        1 => format!("find the {small} next to the {anchor}"),
        _ => format!("find the {small} in the {}", ROOMS[meant]),
    };
    let id = |index: usize| ObjectId(index as u64 + 1);
    World {
        graph: graph(3, &ROOMS, &things),
        sentence,
        target: id(12 + meant),
        target_room: meant,
        twins: (0..3).filter(|other| *other != meant).map(|other| id(12 + other)).collect(),
        strangers: (0..12).filter(|slot| *slot != slots[meant]).map(id).collect(),
        names_room: kind == 2,
    }
}

#[test]
fn valid_replies_pass_and_wrong_ones_are_caught() {
    let mut draw = Draw(20);
    let critic = Critic::default();
    let (mut valid, mut rejected, mut wrong, mut caught) = (0, 0, 0, 0);
    let mut missed: std::collections::BTreeMap<&str, usize> = Default::default();
    while valid + wrong < REPLIES {
        let world = world(&mut draw);
        let instruction = parse_instruction(&world.sentence);
        let is_there = draw.below(2) == 0;
        let is_cut_off = draw.below(5) == 0;
        // Rooms lie at y < 5 (0 and 1) and beyond (2); the robot stands in room 0.
        let room_at = |point: &Point3<f64>| support::room_index_at(point, 3);
        let path = |point: &Point3<f64>| {
            let blocked = is_cut_off && room_at(point) == Some(world.target_room) && world.target_room != 0;
            (!blocked).then(|| (point.x - 2.5).abs() + (point.y - 2.5).abs())
        };
        let can_stop = |id: ObjectId| is_there && id == world.target;
        let inspected = [world.target];
        let situation = Situation {
            inspected: if is_there { &inspected } else { &[] },
            ..Situation::new(&world.graph, pose(2.5, 2.5, 0.0), &instruction, &path, &can_stop)
        };
        let config = PromptConfig { budget_tokens: 2_000, ..PromptConfig::default() };
        let prompt = build_prompt_for(&situation, &config, &Estimate);
        let name = |id: ObjectId| prompt.names.name_of(octant_prompt::Named::Object(id)).unwrap_or("?").to_string();
        let reachable = path(&world.graph.object(world.target).expect("exists").centroid).is_some();
        let twin = name(world.twins[draw.below(world.twins.len())]);
        let stranger = name(world.strangers[draw.below(world.strangers.len())]);
        let target = name(world.target);
        let other_room = (world.target_room + 1 + draw.below(2)) % 3;

        let mut replies: Vec<(bool, &str, String)> = Vec::new();
        if reachable {
            replies.push((true, "approach", format!("go_near({target})")));
            replies.push((is_there, "stop", format!("stop({target})")));
            replies.push((false, "twin", format!("go_near({twin})")));
            replies.push((false, "give up", "give_up(nothing here)".into()));
            if world.target_room != 0 {
                replies.push((true, "room", format!("go_to_room(room{})", world.target_room)));
            }
            if world.names_room && other_room != 0 {
                replies.push((false, "other room", format!("go_to_room(room{other_room})")));
            }
        } else {
            replies.push((false, "cut off", format!("go_near({target})")));
            replies.push((false, "cut off room", format!("go_to_room(room{})", world.target_room)));
        }
        replies.push((false, "stop at twin", format!("stop({twin})")));
        replies.push((false, "stranger", format!("go_near({stranger})")));
        replies.push((false, "stop at stranger", format!("stop({stranger})")));
        replies.push((false, "room as thing", format!("stop(room{})", world.target_room)));
        replies.push((false, "no such room", "go_to_room(room7)".into()));
        replies.push((false, "nothing to explore", "explore(frontier1)".into()));
        replies.push((false, "here already", "go_to_room(room0)".into()));
        replies.push((true, "turn", "turn_to(front-left-top)".into()));

        for (is_valid, kind, text) in replies {
            let verdict = parse_reply(&text, &prompt.names)
                .map_err(|_| ())
                .and_then(|reply| critic.check(&reply.action, &situation, prompt.revision).map_err(|_| ()));
            if is_valid {
                valid += 1;
                rejected += usize::from(verdict.is_err());
            } else {
                wrong += 1;
                caught += usize::from(verdict.is_err());
            }
            if verdict.is_ok() != is_valid {
                *missed.entry(kind).or_default() += 1;
            }
        }
    }
    println!("valid {valid}, rejected {rejected}; wrong {wrong}, caught {caught}; misjudged by kind {missed:?}");
    assert!(rejected * 100 <= valid, "valid actions rejected: {rejected} of {valid}; {missed:?}");
    assert!(caught * 100 >= wrong * 95, "wrong actions caught: {caught} of {wrong}; {missed:?}");
}

#[test]
fn a_place_that_was_explored_is_refused_and_a_frontier_is_not() {
    let mut draw = Draw(3);
    let world = world(&mut draw);
    let instruction = parse_instruction("find the unicorn");
    let path = |_: &Point3<f64>| Some(1.0);
    let can_stop = |_: ObjectId| false;
    let frontiers = [PlaceId(4)];
    let situation = Situation {
        frontiers: &frontiers,
        ..Situation::new(&world.graph, pose(2.5, 2.5, 0.0), &instruction, &path, &can_stop)
    };
    let check = |place| Critic::default().check(&octant_prompt::Action::Explore(PlaceId(place)), &situation, 0).is_ok();
    assert!(check(4) && !check(5) && !check(9_999));
    assert!(Critic::default().check(&octant_prompt::Action::GoToRoom(RoomId(99)), &situation, 0).is_err());
}
