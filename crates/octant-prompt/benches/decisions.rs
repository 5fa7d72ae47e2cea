//! Claims guarded here: a prompt for 50 objects in 15 us, for 10,000 objects in 100 rooms in 2 ms; 200 tokens counted exactly in 80 us (with
//! `QWEN_TOKENIZER_JSON`); a sentence grounded in a room of 40 things in 40 us; a decision among 300 objects in 2 ms.
//! Run: `cargo bench -p octant-prompt`.

#[path = "../tests/support/mod.rs"]
mod support;

use dsg::{ObjectId, SceneGraph};
use nalgebra::Point3;
use octant_prompt::{
    BytePairs, Critic, Estimate, PromptConfig, Prompter, Situation, SymbolicReasoner, TokenCounter, build_prompt,
    build_prompt_for, decide_with_critic, parse_instruction,
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

/// 50 objects in the three other rooms, as in the scene D9 of the paper.
#[divan::bench]
fn prompt_d9(bencher: divan::Bencher) {
    const CLASSES: [&str; 4] = ["chair", "table", "cabinet", "sofa"];
    let things: Vec<support::Put> = (0..50)
        .map(|k| {
            let (x, y) = support::corner(1 + k % 3);
            support::put(
                CLASSES[k * 7 % 4],
                x + (k * 37 % 45) as f64 * 0.1 + 0.2,
                y + (k * 61 % 45) as f64 * 0.1 + 0.2,
                0.5,
            )
        })
        .collect();
    let graph = support::graph(4, &[], &things);
    let pose = support::pose(2.5, 2.5, 0.0);
    bencher.bench(|| build_prompt(&graph, &pose, "go to the nearest chair", &roomy(), &Estimate));
}

#[divan::bench]
fn prompt_of_10_000_objects_in_100_rooms(bencher: divan::Bencher) {
    let graph = scene(10_000, 100);
    let pose = support::pose(2.5, 2.5, 0.4);
    bencher.bench(|| build_prompt(&graph, &pose, "go to the nearest chair", &roomy(), &Estimate));
}

/// The same building once it has been sorted by rooms, from another pose.
#[divan::bench]
fn prompt_of_10_000_objects_after_a_step(bencher: divan::Bencher) {
    let graph = scene(10_000, 100);
    let prompter = Prompter::new(&graph, "go to the nearest chair");
    let mut x = 2.0;
    bencher.bench_local(|| {
        x = if x > 3.0 { 2.0 } else { x + 0.01 };
        prompter.prompt(&support::pose(x, 2.5, 0.4), &roomy(), &Estimate)
    });
}

fn roomy() -> PromptConfig {
    PromptConfig { budget_tokens: 100_000, ..PromptConfig::default() }
}

#[divan::bench]
fn exact_count_of_a_prompt(bencher: divan::Bencher) {
    let Some(path) = std::env::var_os("QWEN_TOKENIZER_JSON") else {
        eprintln!("skipped: QWEN_TOKENIZER_JSON names no tokenizer.json");
        return;
    };
    let qwen = BytePairs::read(std::fs::File::open(path).expect("the file opens")).expect("a tokenizer");
    let graph = scene(50, 4);
    let text =
        build_prompt(&graph, &support::pose(2.5, 2.5, 0.0), "go to the nearest chair", &PromptConfig::default(), &qwen)
            .text;
    let mut end = text.len();
    while qwen.count(&text[..end]) > 200 {
        end -= 1; // ASCII
    }
    bencher.bench(|| qwen.count(divan::black_box(&text[..end])));
}

/// Sentence to id: parse and ground in a room of forty things.
#[divan::bench(args = ["the chair near the window", "facing the desk, the smaller plant on the left", "the mug on the table between the sofa and the lamp"])]
fn grounding(bencher: divan::Bencher, sentence: &str) {
    let scene = octant_prompt::grounding::Scene::from_graph(&scene(40, 1), 0);
    bencher.bench(|| octant_prompt::refer_set::answer(divan::black_box(sentence), &scene));
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
