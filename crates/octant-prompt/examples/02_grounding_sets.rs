//! Lesson 2: how often does the rule-based grounder find the object a person meant?
//!
//! Two public sets of referring expressions over real rooms: Sr3D (from templates) and Nr3D (written by people). The grounder gets the
//! sentence and the labelled boxes of the room, and must name one box among all. Setting: true boxes and true labels, developer part.
//! The same code grounds the robot's scene graph; here the viewer stands in the middle of the room.
//!
//! Run: `cargo run --release -p octant-prompt --example 02_grounding_sets [-- --errors N]`

use std::collections::{BTreeMap, HashMap};
use std::time::Instant;

use dsg::{Aabb, ObjectId};
use nalgebra::{Point3, Vector3};
use octant_prompt::grounding::{Scene, Thing};
use octant_prompt::{ground, parse_referring};
use serde_json::Value;

fn main() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/grounding");
    let (Ok(scenes), Ok(utterances)) = (
        std::fs::read_to_string(format!("{folder}/scenes.jsonl")),
        std::fs::read_to_string(format!("{folder}/utterances.jsonl")),
    ) else {
        eprintln!("skipped: no grounding sets in {folder}");
        return;
    };
    let mut errors_to_show: usize =
        std::env::args().skip_while(|arg| arg != "--errors").nth(1).and_then(|n| n.parse().ok()).unwrap_or(0);

    let wanted_set = std::env::args().skip_while(|arg| arg != "--set").nth(1).unwrap_or_default();

    // 1. The rooms: labelled boxes.
    let scenes: HashMap<String, Scene> =
        scenes.lines().map(|line| scene(&serde_json::from_str(line).expect("JSON"))).collect();

    // 2. Each sentence: parse, ground, compare.
    let mut tally: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    let (mut parse_s, mut ground_s, mut count) = (0.0, 0.0, 0);
    for line in utterances.lines() {
        let row: Value = serde_json::from_str(line).expect("JSON");
        let text = row["text"].as_str().expect("text");
        let scene = &scenes[row["scene"].as_str().expect("scene")];
        let labels: Vec<&str> = scene.classes.iter().map(|class| class.text.as_str()).collect();
        let start = Instant::now();
        let goal = parse_referring(text, &labels);
        parse_s += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let answer = goal.as_ref().and_then(|goal| ground(goal, scene, &middle(scene)).first().map(|found| found.id.0));
        ground_s += start.elapsed().as_secs_f64();
        count += 1;
        let is_right = answer == row["target"].as_u64();
        let set = row["set"].as_str().expect("set").to_string();
        let hard = if row["n_same"].as_u64() > Some(2) { "hard" } else { "easy" };
        let mut keys = vec![set.clone(), format!("{set} {hard}")];
        keys.extend(row["relation"].as_str().map(|relation| format!("{set} {relation}")));
        for key in keys {
            let entry = tally.entry(key).or_default();
            entry.0 += usize::from(is_right);
            entry.1 += 1;
        }
        if !is_right && errors_to_show > 0 && set.starts_with(&wanted_set) {
            errors_to_show -= 1;
            println!(
                "WRONG {text}\n   parsed: {}\n   wanted {} {}",
                goal.map_or_else(|| "-".into(), |goal| goal.to_string()),
                row["label"],
                row["target"]
            );
        }
    }

    // 3. What it found.
    for (key, (right, all)) in &tally {
        println!("{key:24} {:6.2} %  of {all}", 100.0 * *right as f64 / *all as f64);
    }
    println!(
        "time a query: parse {:.0} us, ground {:.0} us",
        1e6 * parse_s / count as f64,
        1e6 * ground_s / count as f64
    );
    let share = |key: &str| tally[key].0 as f64 / tally[key].1 as f64;
    assert!(share("sr3d") > 0.8 && share("nr3d-train") > 0.5, "far above chance (0.44 and 0.38 among the class)");
}

fn scene(row: &Value) -> (String, Scene) {
    let mut scene = Scene::default();
    for object in row["objects"].as_array().expect("objects") {
        let number = |index: usize| object[index].as_f64().unwrap_or(0.0);
        let class = scene.intern(object[1].as_str().expect("label"));
        scene.things.push(Thing {
            id: ObjectId(object[0].as_u64().expect("id")),
            classes: vec![(class, 1.0)],
            bounds: Aabb::from_center(
                Point3::new(number(2), number(3), number(4)),
                Vector3::new(number(5), number(6), number(7)),
            ),
            color: Some([number(8), number(9), number(10)]),
            words: String::new(),
            color_name: None,
            room: None,
            front: object[11].as_array().map(|p| {
                Point3::new(p[0].as_f64().unwrap_or(0.0), p[1].as_f64().unwrap_or(0.0), p[2].as_f64().unwrap_or(0.0))
            }),
            trust: 1.0,
        });
    }
    (row["scene"].as_str().expect("scene").to_string(), scene)
}

fn middle(scene: &Scene) -> Point3<f64> {
    let all = scene.things.iter().map(|thing| thing.bounds).reduce(|a, b| a.union(&b)).expect("a room has objects");
    let center = all.center();
    Point3::new(center.x, center.y, 1.5)
}
