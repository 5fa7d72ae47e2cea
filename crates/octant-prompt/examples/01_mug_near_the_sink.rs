//! Lesson 1: from a scene graph and a sentence to a verified action.
//!
//! A robot stands in the living room of a flat of which it knows two rooms. It is told to find the mug near the sink. We look at what a
//! language model would be shown, at what the embedded reasoner makes of it, and at how the critic treats a hasty answer.
//!
//! Run: `cargo run -p octant-prompt --example 01_mug_near_the_sink`

use dsg::{Aabb, Object, ObjectId, Op, Place, PlaceId, Room, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3, Vector3};
use octant_prompt::{
    Action, Critic, Estimate, PromptConfig, ScriptedReasoner, Situation, SymbolicReasoner, TokenCounter,
    build_prompt_for, decide_with_critic, flat_json, octant_of, parse_instruction, point_in_body,
};

fn main() {
    // 1. The scene graph: two rooms, a doorway's width apart; a mug in each. One place still borders unknown space.
    let graph = flat().expect("all ops are valid");
    let world_from_body = Isometry3::new(Vector3::new(2.0, 2.0, 0.31), Vector3::z() * 0.0);

    // 2. Eq. 8 and 9: the kitchen's sink in the robot's own frame, and its octant.
    let sink = graph.object(ObjectId(3)).expect("put in step 1");
    let in_body = point_in_body(&world_from_body, &sink.centroid);
    println!(
        "the sink is at ({:.1}, {:.1}, {:.1}) in the body frame: {}",
        in_body.x,
        in_body.y,
        in_body.z,
        octant_of(&in_body, 0.42)
    );

    // 3. The instruction, as a tree.
    let instruction = parse_instruction("find the mug near the sink");
    println!("the goal reads: {}; the segmenter is asked for {:?}", instruction.steps[0].goal, instruction.nouns());

    // 4. The prompt, against the flat list.
    let straight = |point: &Point3<f64>| Some((point.xy() - Point3::new(2.0, 2.0, 0.0).xy()).norm());
    let never = |_: ObjectId| false;
    let frontiers = [PlaceId(2)];
    let situation =
        Situation { frontiers: &frontiers, ..Situation::new(&graph, world_from_body, &instruction, &straight, &never) };
    let prompt = build_prompt_for(&situation, &PromptConfig::default(), &Estimate);
    let flat_tokens = Estimate.count(&flat_json(&graph, &world_from_body, &instruction.text));
    println!("\n--- prompt: {} tokens (flat list: {flat_tokens}) ---\n{}\n---\n", prompt.tokens, prompt.text);

    // 5. A hasty model picks the mug beside it, then babbles; the critic objects; the embedded reasoner takes over.
    let mut model = ScriptedReasoner::new(["stop(mug1)", "I would go_near(the shiny one)"]);
    let record =
        decide_with_critic(&mut model, &Critic::default(), &situation, &prompt, 1, &mut SymbolicReasoner::default());
    for attempt in &record.attempts {
        let verdict = attempt
            .objection
            .as_ref()
            .map_or("accepted".to_string(), |critique| format!("{}: {}", critique.code.word(), critique.message));
        println!("{}: {verdict}", attempt.by);
    }

    // 6. The four steps of the accepted decision.
    let reply = record.reply.expect("the embedded reasoner always has one");
    for line in &reply.trace {
        println!("  {:16} {} -> {}", line.step.word(), line.input, line.output);
    }
    println!("action: {}", reply.action.text(&prompt.names));
    assert_eq!(reply.action, Action::GoNear(ObjectId(4)), "the mug of the kitchen, not the one beside the robot");
    assert!(record.is_fallback && prompt.tokens <= 600);
}

fn flat() -> Result<SceneGraph, dsg::OpError> {
    let mut graph = SceneGraph::new();
    for (id, name, x) in [(0, "living room", 2.0), (1, "kitchen", 7.0)] {
        let place = PlaceId(id);
        let position = Point3::new(x, 2.0, 0.3);
        graph.apply(Op::PutPlace(Place {
            id: place,
            position,
            clearance_m: 1.0,
            basis_points: 2,
            frontier_cells: 0,
            room: None,
        }))?;
        let room =
            Room { name: name.into(), is_user_named: true, places: vec![place], ..Room::new(RoomId(id), position) };
        graph.apply(Op::PutRoom(Box::new(room)))?;
    }
    let edge = Point3::new(7.0, 4.5, 0.3);
    graph.apply(Op::PutPlace(Place {
        id: PlaceId(2),
        position: edge,
        clearance_m: 0.5,
        basis_points: 2,
        frontier_cells: 12,
        room: None,
    }))?;
    let things = [
        (1, "sofa", "a long grey sofa with three seats", 0, Point3::new(2.0, 4.0, 0.4), 0.9),
        (2, "mug", "a white ceramic mug on the floor", 0, Point3::new(2.6, 1.4, 0.1), 0.1),
        (3, "sink", "a steel kitchen sink", 1, Point3::new(7.5, 3.8, 0.8), 0.5),
        (4, "mug", "a red ceramic mug beside the tap", 1, Point3::new(7.0, 3.8, 0.9), 0.1),
        (5, "fridge", "a tall white fridge", 1, Point3::new(8.5, 1.0, 0.9), 0.8),
    ];
    for (id, label, caption, room, at, side_m) in things {
        let mut object = Object::new(ObjectId(id), label, Aabb::from_center(at, Vector3::repeat(side_m)));
        object.caption = caption.into();
        object.room = Some(RoomId(room));
        graph.apply(Op::PutObject(Box::new(object)))?;
    }
    Ok(graph)
}
