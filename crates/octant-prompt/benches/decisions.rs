//! Claims guarded here: a prompt for 50 objects in 50 us, a decision among 300 objects in 2 ms, an instruction parsed in 50 us.
//! Run: `cargo bench -p octant-prompt`.

#[path = "../tests/support/mod.rs"]
mod support;

use dsg::{ObjectId, SceneGraph};
use nalgebra::Point3;
use octant_prompt::{
    Critic, Estimate, PromptConfig, Situation, SymbolicReasoner, build_prompt, build_prompt_for, decide_with_critic,
    parse_instruction,
};

fn main() {
    divan::main();
}

/// `count` objects of twelve classes spread over ten rooms.
fn scene(count: usize, rooms: usize) -> SceneGraph {
    const CLASSES: [&str; 12] =
        ["chair", "table", "mug", "sink", "sofa", "lamp", "bookshelf", "plant", "trash can", "bed", "desk", "monitor"];
    let things: Vec<support::Put> = (0..count)
        .map(|k| {
            let (x, y) = support::corner(k % rooms);
            let (dx, dy) = ((k * 37 % 45) as f64 * 0.1 + 0.2, (k * 61 % 45) as f64 * 0.1 + 0.2);
            let caption = "a white thing made of wood with a smooth surface standing near the wall lit by a lamp from above used every day".to_string();
            support::Put { caption, ..support::put(CLASSES[k * 7 % 12], x + dx, y + dy, (k % 5) as f64 * 0.3) }
        })
        .collect();
    support::graph(rooms, &["kitchen"], &things)
}

#[divan::bench(args = [50, 300, 1000])]
fn prompt(bencher: divan::Bencher, count: usize) {
    let graph = scene(count, 10);
    let pose = support::pose(2.5, 2.5, 0.4);
    bencher.bench(|| build_prompt(&graph, &pose, "find the mug near the sink", &PromptConfig::default(), &Estimate));
}

#[divan::bench]
fn instruction() -> octant_prompt::Instruction {
    parse_instruction(divan::black_box("go to the kitchen, then find the red mug on the table near the window"))
}

#[divan::bench(args = [50, 300])]
fn symbolic_decision(bencher: divan::Bencher, count: usize) {
    with_situation(count, |situation| bencher.bench_local(|| SymbolicReasoner::default().reply(situation)));
}

#[divan::bench(args = [50, 300])]
fn whole_decision_with_prompt_and_critic(bencher: divan::Bencher, count: usize) {
    with_situation(count, |situation| {
        bencher.bench_local(|| {
            let prompt = build_prompt_for(situation, &PromptConfig::default(), &Estimate);
            decide_with_critic(
                &mut SymbolicReasoner::default(),
                &Critic::default(),
                situation,
                &prompt,
                2,
                &mut SymbolicReasoner::default(),
            )
        });
    });
}

fn with_situation(count: usize, run: impl FnOnce(&Situation)) {
    let graph = scene(count, 10);
    let instruction = parse_instruction("find the red mug near the sink in the meeting room");
    let path = |point: &Point3<f64>| Some(point.coords.norm());
    let can_stop = |_: ObjectId| false;
    let places: Vec<dsg::PlaceId> = graph.places().map(|place| place.id).collect();
    let situation = Situation {
        frontiers: &places[..30],
        unseen: &places[30..],
        ..Situation::new(&graph, support::pose(2.5, 2.5, 0.4), &instruction, &path, &can_stop)
    };
    run(&situation);
}
