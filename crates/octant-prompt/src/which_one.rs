//! "Which one?": the question about things that answer to the same words, and what the answer to it means.
//!
//! The robot names each thing by a description of its own ([`crate::describe`]) and its id. An answer is read among them alone: an id,
//! a place in the list, "any", or words that tell them apart ("the one on the desk", "the red one", "in the kitchen").

use dsg::ObjectId;

use crate::candidates::{Candidates, candidates};
use crate::describe::describe_without_a_view;
use crate::grounding::{GroundingConfig, Scene, ground};
use crate::instruction::{AttributeKind, Referring, RelationClause, SpatialRelation};
use crate::noun_phrase::adjective;
use crate::parser::parse_referring;
use crate::premise::{article, plain_words};
use crate::situation::Situation;
use crate::vocabulary::{class_similarity, is_known, normalise};

/// A question and the things it is about.
#[derive(Debug, Clone, PartialEq)]
pub struct WhichOne {
    /// The sentence.
    pub text: String,
    /// The things, in the order in which the sentence names them, each as the robot would describe it.
    pub things: Vec<(ObjectId, String)>,
}

/// What an answer means.
#[derive(Debug, Clone, PartialEq)]
pub enum Meant {
    /// This one.
    One(ObjectId),
    /// Whichever.
    Any,
    /// It tells some of them from the others, not one.
    Several(Vec<ObjectId>),
    /// It describes none of them; the step with what it says.
    Other(Box<Referring>),
    /// It says nothing about them.
    Unclear,
}

/// Most things that a question names.
const MOST_NAMED: usize = 5;

/// Asks about things of the graph, at least one, in this order.
pub fn which_one(situation: &Situation, config: &GroundingConfig, ids: &[ObjectId]) -> WhichOne {
    let known = candidates(situation, config);
    let named = ids.iter().take(MOST_NAMED);
    let things: Vec<(ObjectId, String)> = named.map(|id| (*id, description(*id, situation, &known))).collect();
    let list: Vec<String> = things.iter().map(|(id, words)| format!("{words} ({id})")).collect();
    let more =
        if ids.len() > MOST_NAMED { format!(", or one of {} others", ids.len() - MOST_NAMED) } else { String::new() };
    let class = situation.step().map_or("one".into(), |step| match step.goal.class.is_wildcard() {
        true => "one".into(),
        false => step.goal.class.text.clone(),
    });
    let (last, front) = list.split_last().map_or(("", &[][..]), |(last, front)| (last.as_str(), front));
    let list = match (front.is_empty(), more.is_empty()) {
        (true, _) => last.to_owned(),
        (false, true) => format!("{}, or {last}", front.join(", ")),
        (false, false) => format!("{}, {last}", front.join(", ")),
    };
    WhichOne { text: format!("Which {class} do you mean: {list}{more}?"), things }
}

/// The shortest description that singles the thing out wherever one stands; where none is found, its looks and its room.
fn description(id: ObjectId, situation: &Situation, known: &Candidates) -> String {
    if let Some(description) = describe_without_a_view(&known.scene, id) {
        return description.text;
    }
    let Some(candidate) = known.object(id) else { return "something".into() };
    let words = plain_words(known, candidate);
    let room = known.scene.things[candidate.found.index].room;
    let room = room.and_then(|room| situation.graph.room(known.scene.rooms[room].id));
    let place = room.map_or(String::new(), |room| format!(" in the {}", room.name));
    format!("{} {words}{place}", article(&words))
}

/// Reads an answer about `listed`, the things of a question in its order. The present step of the situation is the one that was asked
/// about. Any text is accepted.
pub fn read_answer(text: &str, listed: &[ObjectId], situation: &Situation, config: &GroundingConfig) -> Meant {
    let said = normalise(text);
    let words: Vec<&str> = said.split(' ').filter(|word| !word.is_empty()).collect();
    if let Some(id) = words.iter().find_map(|word| word.strip_prefix('o')?.parse().ok().map(ObjectId)) {
        return if listed.contains(&id) { Meant::One(id) } else { Meant::Unclear };
    }
    if is_any(&words) {
        return Meant::Any;
    }
    let place_in_list = |n: u32| match n {
        u32::MAX => listed.last(),
        n => (n as usize).checked_sub(1).and_then(|n| listed.get(n)),
    };
    if let Some(number) = number(&words) {
        return place_in_list(number).map_or(Meant::Unclear, |id| Meant::One(*id));
    }
    let Some(step) = situation.step() else { return Meant::Unclear };
    let scene = Scene::from_graph(situation.graph, situation.floor());
    let labels: Vec<&str> = scene.classes.iter().map(|class| class.text.as_str()).collect();
    let is_about = |answer: &Referring| {
        let (said, asked) = (&answer.class, &step.goal.class);
        said.text.is_empty()
            || said.is_wildcard()
            || class_similarity(said, asked).max(class_similarity(asked, said)) >= 0.5
    };
    // "in the kitchen", "near the sink": of the one that is meant.
    let in_full = || parse_referring(&format!("the one {text}"), &labels);
    let Some(mut answer) = parse_referring(text, &labels).or_else(in_full) else { return Meant::Unclear };
    if !is_about(&answer)
        && let Some(full) = in_full()
        && is_about(&full)
        && !(full.relations.is_empty() && full.room.is_none())
    {
        answer = full;
    }
    let is_known = is_known(&answer.class) || adjective(&answer.class.text).is_some();
    if !is_about(&answer)
        && !is_known
        && !scene.classes.iter().any(|class| class_similarity(&answer.class, class) >= 0.5)
    {
        return Meant::Unclear;
    }
    let counts_only = answer.superlatives.is_empty() && answer.relations.is_empty() && answer.attributes.is_empty();
    if let Some(number) = answer.ordinal.filter(|_| counts_only) {
        return place_in_list(number).map_or(Meant::Unclear, |id| Meant::One(*id));
    }
    let Some(goal) = joined(&step.goal, is_about(&answer), answer) else { return Meant::Unclear };
    // Left and right are those of the robot that asks.
    let found = ground(&goal, &scene, &situation.position());
    /// Of the listed things the one near the sink may be 2 m from it.
    const LEAST_RELATION: f64 = 0.15;
    let mut fitting: Vec<_> = found
        .iter()
        .filter(|found| {
            listed.contains(&found.id)
                && found.weakest_attribute >= config.accept_attributes
                && found.room >= config.accept_relation
                && (found.weakest_relation >= LEAST_RELATION || goal.picks_one())
        })
        .collect();
    fitting.sort_by(|a, b| b.rank.total_cmp(&a.rank).then(a.id.cmp(&b.id)));
    let Some(best) = fitting.first() else { return Meant::Other(Box::new(goal)) };
    /// Ranks closer than this do not tell things apart; the boxes of a map shake by about as much.
    const ALIKE: f64 = 0.75;
    let alike: Vec<ObjectId> =
        fitting.iter().filter(|found| found.rank >= ALIKE * best.rank).map(|found| found.id).collect();
    match alike.as_slice() {
        [one] => Meant::One(*one),
        _ if goal.picks_one() => Meant::One(best.id),
        _ => Meant::Several(listed.iter().copied().filter(|id| alike.contains(id)).collect()),
    }
}

/// "any", "either of them", "it does not matter".
fn is_any(words: &[&str]) -> bool {
    const WHICHEVER: [&str; 12] = [
        "any",
        "anyone",
        "either",
        "whichever",
        "whatever",
        "no matter",
        "doesnt matter",
        "not matter",
        "dont care",
        "not care",
        "you choose",
        "all the same",
    ];
    let said = format!(" {} ", words.join(" "));
    WHICHEVER.iter().any(|phrase| said.contains(&format!(" {phrase} ")))
}

/// "2", "number 2", "the 2".
fn number(words: &[&str]) -> Option<u32> {
    let rest: Vec<&&str> =
        words.iter().filter(|word| !matches!(**word, "the" | "number" | "no" | "nr" | "one")).collect();
    match rest.as_slice() {
        [digits] => digits.parse().ok(),
        _ => None,
    }
}

/// The step with what the answer adds; None if it adds nothing.
fn joined(asked: &Referring, is_about_it: bool, answer: Referring) -> Option<Referring> {
    let mut goal = asked.clone();
    if !is_about_it {
        match adjective(&answer.class.text) {
            Some(attribute) => goal.attributes.push(attribute), // "red"
            None => {
                // "the desk": the one that has to do with it
                let anchors = vec![answer];
                goal.relations.push(RelationClause { relation: SpatialRelation::Near, anchors, negated: false });
                return Some(goal);
            }
        }
    }
    let is_kind = is_about_it && !answer.class.text.is_empty() && !answer.class.is_wildcard();
    if is_kind && answer.class.text != asked.class.text {
        goal.class = answer.class; // "the coffee table" among tables
    } else if answer.attributes.is_empty()
        && answer.relations.is_empty()
        && answer.superlatives.is_empty()
        && answer.ordinal.is_none()
        && answer.room.is_none()
        && answer.excluded_rooms.is_empty()
        && goal.attributes.len() == asked.attributes.len()
    {
        return None;
    }
    goal.attributes.extend(answer.attributes.into_iter().filter(|attribute| attribute.kind != AttributeKind::Other));
    goal.relations.extend(answer.relations);
    goal.superlatives.extend(answer.superlatives);
    goal.ordinal = answer.ordinal.or(goal.ordinal);
    goal.room = answer.room.or(goal.room);
    goal.excluded_rooms.extend(answer.excluded_rooms);
    Some(goal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parser::parse_instruction;
    use dsg::{Aabb, Object, Op, Room, RoomId, SceneGraph};
    use nalgebra::{Isometry3, Point3, Vector3};

    /// Two mugs on a desk and beside a sink in one room, a third in the kitchen.
    fn graph() -> SceneGraph {
        let mut graph = SceneGraph::new();
        for (room, name) in [(0, "office"), (1, "kitchen")] {
            let center = Point3::new(10.0 * room as f64, 0.0, 0.0);
            let kind = Some(name.to_owned());
            let room = Room { name: name.into(), kind, kind_confidence: 0.95, ..Room::new(RoomId(room), center) };
            graph.apply(Op::PutRoom(Box::new(room))).expect("a room");
        }
        let things = [
            (1, "mug", [1.0, 0.0, 0.8], 0.1, "red", 0),
            (2, "mug", [-3.0, 0.0, 0.8], 0.1, "white", 0),
            (3, "mug", [10.0, 0.0, 0.8], 0.1, "white", 1),
            (4, "desk", [1.0, 0.0, 0.36], 0.75, "brown", 0),
            (5, "sink", [-3.0, 0.5, 0.6], 0.4, "white", 0),
        ];
        for (id, label, [x, y, z], side_m, color, room) in things {
            let bounds = Aabb::from_center(Point3::new(x, y, z), Vector3::repeat(side_m));
            let object =
                Object { room: Some(RoomId(room)), confirmed: true, ..Object::new(ObjectId(id), label, bounds) };
            let mut object = object;
            object.attributes.insert("color".into(), color.into());
            graph.apply(Op::PutObject(Box::new(object))).expect("an object");
        }
        graph
    }

    fn ask<T>(use_it: impl FnOnce(&Situation) -> T) -> T {
        let (graph, instruction) = (graph(), parse_instruction("find the mug"));
        let path = |point: &Point3<f64>| Some(point.coords.xy().norm());
        let never = |_: ObjectId| false;
        let situation = Situation::new(&graph, Isometry3::identity(), &instruction, &path, &never);
        use_it(&Situation { may_ask: true, ..situation })
    }

    fn meant(answer: &str) -> Meant {
        let listed = [1, 2, 3].map(ObjectId);
        ask(|situation| read_answer(answer, &listed, situation, &GroundingConfig::default()))
    }

    #[test]
    fn three_mugs_are_equal_and_each_has_a_description_that_is_understood() {
        ask(|situation| {
            let config = GroundingConfig::default();
            let known = candidates(situation, &config);
            assert_eq!(known.equals, [1, 2, 3].map(ObjectId));
            let question = which_one(situation, &config, &known.equals);
            assert!(
                question.text.starts_with("Which mug do you mean: ") && question.text.contains("(O2)"),
                "{question:?}"
            );
            for (id, words) in &question.things {
                assert_eq!(read_answer(words, &known.equals, situation, &config), Meant::One(*id), "{words}");
            }
        });
    }

    #[test]
    fn answers_by_place_looks_number_and_id() {
        for (answer, id) in [
            ("the one on the desk", 1),
            ("the mug near the sink", 2),
            ("near the sink please", 2),
            ("the red one", 1),
            ("red", 1),
            ("the one in the kitchen", 3),
            ("kitchen", 3),
            ("in the kitchen", 3),
            ("the second", 2),
            ("the 3rd one", 3),
            ("the last one", 3),
            ("2", 2),
            ("number 1", 1),
            ("O3", 3),
            ("I mean o2.", 2),
            ("the desk", 1),
            ("the one that is not on the desk, in the office", 2),
        ] {
            assert_eq!(meant(answer), Meant::One(ObjectId(id)), "{answer}");
        }
    }

    #[test]
    fn answers_that_do_not_say_which() {
        for answer in ["any", "either of them", "I don't care", "whichever you like"] {
            assert_eq!(meant(answer), Meant::Any, "{answer}");
        }
        for answer in ["", "the mug", "O77", "the seventh", "hm?", "99"] {
            assert_eq!(meant(answer), Meant::Unclear, "{answer}");
        }
        assert_eq!(meant("the white one"), Meant::Several(vec![ObjectId(2), ObjectId(3)]));
        assert!(matches!(meant("the green one"), Meant::Other(goal) if goal.attributes[0].word == "green"));
    }

    #[test]
    fn with_an_article_that_leaves_it_open_nobody_is_asked() {
        let graph = graph();
        let path = |point: &Point3<f64>| Some(point.coords.xy().norm());
        let never = |_: ObjectId| false;
        for (text, count) in [
            ("find a mug", 0),
            ("find any mug", 0),
            ("go to one of the mugs", 0),
            ("find the nearest mug", 0),
            ("find the white mug", 2),
            ("find the mug in the office", 2),
        ] {
            let instruction = parse_instruction(text);
            let situation = Situation::new(&graph, Isometry3::identity(), &instruction, &path, &never);
            assert_eq!(candidates(&situation, &GroundingConfig::default()).equals.len(), count, "{text}");
        }
    }
}
