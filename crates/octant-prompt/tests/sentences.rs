//! What the grammar promises, end to end: in rooms laid out by hand each sentence means one thing, known by construction.

mod support;

use dsg::{Aabb, Object, ObjectId, Op, Room, RoomId, SceneGraph};
use nalgebra::{Point3, Vector3};
use octant_prompt::grounding::{Scene, ground};
use octant_prompt::parser::parse_referring;
use octant_prompt::{
    Action, Critic, CritiqueCode, Estimate, Named, Naming, PromptConfig, Situation, SymbolicReasoner, Target,
    build_prompt_for, decide_with_critic, parse_instruction,
};
use support::{Put, graph, pose, put};

/// Id, label, middle, side, colour, room.
type Row = (u64, &'static str, [f64; 3], f64, &'static str, u64);

/// One hall on each of two storeys. The viewer stands at the origin and looks along x, so that left is +y.
fn halls() -> Scene {
    let mut graph = SceneGraph::new();
    for floor in 0..2 {
        let center = Point3::new(0.0, 0.0, 3.0 * f64::from(floor));
        let room = Room { floor, ..Room::new(RoomId(floor as u64), center) };
        graph.apply(Op::PutRoom(Box::new(room))).expect("room");
    }
    let things: [Row; 15] = [
        (1, "chair", [4.0, 2.0, 0.4], 0.5, "red", 0),
        (2, "chair", [4.0, 0.0, 0.4], 0.5, "blue", 0),
        (3, "chair", [4.0, -2.0, 0.4], 0.5, "red", 0),
        (4, "chair", [-3.0, 0.0, 0.4], 0.9, "blue", 0),
        (5, "desk", [4.0, 1.0, 0.4], 0.8, "white", 0),
        (6, "sofa", [6.0, -2.0, 0.4], 0.9, "grey", 0),
        (7, "lamp", [6.0, 0.4, 1.5], 0.3, "white", 0),
        (8, "mug", [4.0, 1.0, 0.85], 0.1, "white", 0),
        (9, "mug", [-3.0, 2.0, 0.05], 0.1, "red", 0),
        (10, "door", [-5.0, 0.0, 1.0], 0.9, "brown", 0),
        (11, "box", [5.0, -2.0, 0.2], 0.3, "brown", 0),
        (12, "box", [-3.0, -3.0, 0.2], 0.3, "brown", 0),
        (13, "bed", [2.0, 0.0, 3.4], 1.0, "white", 1),
        (14, "chair", [-2.0, 0.0, 3.4], 0.5, "red", 1),
        (15, "bed", [-4.0, 3.0, 0.4], 1.0, "white", 0),
    ];
    for (id, label, [x, y, z], side_m, color, room) in things {
        let bounds = Aabb::from_center(Point3::new(x, y, z), Vector3::repeat(side_m));
        let mut object =
            Object { room: Some(RoomId(room)), confirmed: true, ..Object::new(ObjectId(id), label, bounds) };
        object.attributes.insert("color".into(), color.into());
        graph.apply(Op::PutObject(Box::new(object))).expect("object");
    }
    Scene::from_graph(&graph, 0)
}

fn check(text: &str, expected: u64) {
    let scene = halls();
    let labels: Vec<&str> = scene.classes.iter().map(|class| class.text.as_str()).collect();
    let goal = parse_referring(text, &labels).unwrap_or_else(|| panic!("{text}: no expression"));
    let found = ground(&goal, &scene, &Point3::new(0.0, 0.0, 1.5));
    let ranked: Vec<u64> = found.iter().take(4).map(|each| each.id.0).collect();
    assert_eq!(ranked.first(), Some(&expected), "{text}: {goal} found {ranked:?}");
}

#[test]
fn colours_and_negation() {
    check("the blue chair next to the desk", 2);
    check("the mug that is not white", 9);
    check("the mug on the desk", 8);
    check("the mug that is not on the desk", 9);
    check("the box not near the sofa", 12);
    check("the chair without a desk next to it, the large one", 4);
}

#[test]
fn ordinals_and_superlatives() {
    check("the largest chair", 4);
    check("the second chair from the sofa", 2);
    check("the chair closest to the door", 4);
    check("the chair farthest from the lamp", 4);
    check("facing the desk, the leftmost chair", 1);
    check("facing the desk, the second chair from the right", 2);
    check("facing the desk, the rightmost red chair", 3);
}

#[test]
fn between_nested_and_views() {
    check("the box between the chair and the sofa", 11);
    check("the chair between the desk and the sofa", 2);
    check("the mug on the desk next to the blue chair", 8);
    check("facing the desk, the chair right of the desk", 2);
    check("with your back to the desk, the red thing on the right, a mug", 9);
    check("looking at the sofa from the door, the chair left of the desk", 1);
}

#[test]
fn floors_count_from_where_the_viewer_is() {
    check("the bed upstairs", 13);
    check("the bed on the first floor", 15);
    check("the bed on the second floor", 13);
    check("the chair on the second floor", 14);
}

/// What the built-in reasoner does about a step, with everything reachable; it can stop at things within 1 m.
fn decide(graph: &SceneGraph, text: &str, step: usize, x: f64, y: f64) -> Action {
    let instruction = parse_instruction(text);
    let path = |point: &Point3<f64>| Some((point.x - x).hypot(point.y - y));
    let can_stop = |id: ObjectId| {
        graph.object(id).is_some_and(|object| (object.centroid.x - x).hypot(object.centroid.y - y) < 1.0)
    };
    let everything: Vec<ObjectId> = graph.objects().map(|object| object.id).collect();
    let situation = Situation {
        step_index: step,
        inspected: &everything,
        ..Situation::new(graph, pose(x, y, 0.0), &instruction, &path, &can_stop)
    };
    let prompt = build_prompt_for(&situation, &PromptConfig::default(), &Estimate);
    let mut asked = SymbolicReasoner::default();
    let mut fallback = SymbolicReasoner::default();
    let record = decide_with_critic(&mut asked, &Critic::default(), &situation, &prompt, 2, &mut fallback);
    record.reply.expect("the rules always answer").action
}

#[test]
fn several_steps_are_done_in_their_order() {
    let text = "go to the kitchen, then find the mug on the table left of the sink";
    // Two tables in the kitchen (room 1, x from 5 to 10); a mug on each, another one here. The sink is at the far wall.
    let big = |label: &str, x: f64, y: f64| Put { size_m: 0.7, ..put(label, x, y, 0.35) };
    let small = |x: f64, y: f64, z: f64| Put { size_m: 0.1, ..put("mug", x, y, z) };
    let things = [
        big("sink", 9.5, 2.5),
        big("table", 9.0, 4.0),
        big("table", 7.0, 0.6),
        small(9.0, 4.0, 0.75),
        small(7.0, 0.6, 0.75),
        small(2.0, 2.0, 0.05),
    ];
    let graph = graph(2, &["hallway", "kitchen"], &things);
    assert_eq!(parse_instruction(text).steps.len(), 2);
    assert_eq!(decide(&graph, text, 0, 2.5, 2.5), Action::GoToRoom(RoomId(1)));
    assert_eq!(decide(&graph, text, 0, 7.5, 2.5), Action::Stop(Target::Room(RoomId(1))));
    // From the door of the kitchen the sink is ahead and the first table on its left.
    assert_eq!(decide(&graph, text, 1, 6.0, 2.5), Action::GoNear(ObjectId(4)));
    assert_eq!(decide(&graph, text, 1, 8.5, 3.6), Action::Stop(Target::Object(ObjectId(4))));
}

#[test]
fn names_follow_the_distance_or_stay() {
    let chairs = [put("chair", 1.0, 2.5, 0.3), put("chair", 4.5, 2.5, 0.3)];
    let graph = graph(1, &[], &chairs);
    let instruction = parse_instruction("find the chair");
    let path = |_: &Point3<f64>| Some(1.0);
    let can_stop = |_: ObjectId| false;
    let first_chair = |naming: Naming, x: f64| {
        let situation = Situation::new(&graph, pose(x, 2.5, 0.0), &instruction, &path, &can_stop);
        let prompt = build_prompt_for(&situation, &PromptConfig { naming, ..PromptConfig::default() }, &Estimate);
        prompt.names.get("chair1")
    };
    let object = |id| Some(Named::Object(ObjectId(id)));
    assert_eq!((first_chair(Naming::Rank, 1.5), first_chair(Naming::Rank, 4.0)), (object(1), object(2)));
    assert_eq!((first_chair(Naming::Stable, 1.5), first_chair(Naming::Stable, 4.0)), (object(1), object(1)));
}

#[test]
fn an_answer_to_an_older_revision_is_judged_by_the_graph_of_now() {
    let mut graph = graph(1, &[], &[put("mug", 2.0, 2.0, 0.8), put("vase", 4.0, 2.0, 0.8)]);
    let instruction = parse_instruction("find the mug");
    let path = |_: &Point3<f64>| Some(1.0);
    let can_stop = |_: ObjectId| false;
    let check = |graph: &SceneGraph, revision: u64| {
        let situation = Situation::new(graph, pose(2.5, 2.5, 0.0), &instruction, &path, &can_stop);
        Critic::default().check(&Action::GoNear(ObjectId(1)), &situation, revision).map_err(|objection| objection.code)
    };
    let asked_at = graph.revision();
    assert_eq!(check(&graph, asked_at), Ok(()));
    // It turns out to be a bottle: the same action is no longer what was asked for.
    let mut bottle = graph.object(ObjectId(1)).expect("known").clone();
    bottle.label = "bottle".into();
    bottle.votes = [("bottle".to_string(), 30.0)].into_iter().collect();
    graph.apply(Op::PutObject(Box::new(bottle))).expect("relabelled");
    assert_eq!(check(&graph, asked_at), Err(CritiqueCode::TargetMismatch));
    // It is gone: the name is stale for whoever was asked before, unknown to whoever is asked now.
    graph.apply(Op::RemoveObject(ObjectId(1))).expect("removed");
    assert_eq!(check(&graph, asked_at), Err(CritiqueCode::StaleName));
    assert_eq!(check(&graph, graph.revision()), Err(CritiqueCode::UnknownId));
}
