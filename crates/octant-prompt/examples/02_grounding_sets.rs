//! Lesson 2: how often does the rule-based grounder find the object a person meant?
//!
//! Two public sets of referring expressions over real rooms: Sr3D (from templates) and Nr3D (written by people). The grounder gets the
//! sentence and the labelled boxes of the room, and must name one box among all. Setting: true boxes and true labels, developer part.
//! The same code grounds the robot's scene graph; here the viewer stands in the middle of the room. `omnivln refer` does the same for any
//! files of this layout and reports more.
//!
//! Run: `cargo run --release -p octant-prompt --example 02_grounding_sets`

use std::collections::{BTreeMap, HashMap};

use octant_prompt::grounding::Scene;
use octant_prompt::refer_set::{answer, read_scene, read_utterance};

fn main() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/grounding");
    let (Ok(scenes), Ok(utterances)) = (
        std::fs::read_to_string(format!("{folder}/scenes.jsonl")),
        std::fs::read_to_string(format!("{folder}/utterances.jsonl")),
    ) else {
        eprintln!("skipped: no grounding sets in {folder}");
        return;
    };

    // 1. The rooms: labelled boxes.
    let scenes: HashMap<String, Scene> = scenes.lines().map(|line| read_scene(line).expect("a scene")).collect();

    // 2. Each sentence: what the grounder sees, and what only the scorer sees.
    let mut tally: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for line in utterances.lines() {
        let (question, key) = read_utterance(line).expect("an utterance");
        let found = answer(&question.text, &scenes[&question.scene]);
        let is_right = found.is_some_and(|id| id.0 == key.target);
        // The rules were made on the sentences of half 0. Of half 1 only the scores were seen, but they were, while choosing among rules.
        for name in [key.set.clone(), format!("{}, half {}", key.set, question.half())] {
            let entry = tally.entry(name).or_default();
            entry.0 += usize::from(is_right);
            entry.1 += 1;
        }
    }

    // 3. What it found.
    for (name, (right, all)) in &tally {
        println!("{name:32} {:6.2} %  of {all}", 100.0 * *right as f64 / *all as f64);
    }
    let share = |name: &str| tally[name].0 as f64 / tally[name].1 as f64;
    assert!(share("sr3d") >= 0.99 && share("nr3d-train") >= 0.66);
}
