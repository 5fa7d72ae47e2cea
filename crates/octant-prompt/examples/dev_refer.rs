//! scratch
use std::collections::HashMap;
use std::time::Instant;
use nalgebra::Point3;
use octant_prompt::grounding::Scene;
use octant_prompt::refer_set::{read_scene, read_utterance};
use octant_prompt::{ground, parse_referring};
fn main() {
    let folder = "/work/shared/data/grounding";
    let half: Option<u8> = std::env::args().nth(1).and_then(|x| x.parse().ok());
    let scenes: HashMap<String, Scene> = std::fs::read_to_string(format!("{folder}/scenes.jsonl")).unwrap().lines().map(|l| read_scene(l).unwrap()).collect();
    let mut t = Vec::new();
    for line in std::fs::read_to_string(format!("{folder}/utterances.jsonl")).unwrap().lines() {
        let (q, key) = read_utterance(line).unwrap();
        if half.is_some_and(|h| h != q.half()) { continue; }
        let scene = &scenes[&q.scene];
        let labels: Vec<&str> = scene.classes.iter().map(|c| c.text.as_str()).collect();
        let s = Instant::now();
        let goal = parse_referring(&q.text, &labels);
        let found = goal.as_ref().map(|g| ground(g, scene, &middle(scene))).unwrap_or_default();
        t.push(s.elapsed().as_nanos() as f64 * 1e-3);
        println!("{}", serde_json::json!({"set": key.set, "scene": q.scene, "text": q.text, "target": key.target, "label": key.label, "n_same": key.n_same, "relation": key.relation,
            "vd": q.is_view_dependent(), "parsed": goal.map(|g| { let v = g.view.as_ref().map(|v| format!(" <{:?} {}>", v.kind, v.anchor)).unwrap_or_default(); format!("{g}{v}") }), "top": found.iter().take(4).map(|m| (m.id.0, scene.classes[scene.things[m.index].classes[0].0 as usize].text.clone(), (m.rank*1e4).round()/1e4)).collect::<Vec<_>>(),
            "right": found.first().is_some_and(|m| m.id.0 == key.target)}));
    }
    t.sort_by(f64::total_cmp);
    eprintln!("median us {:.1} p95 {:.1}", t[t.len()/2], t[t.len()*95/100]);
}
fn middle(scene: &Scene) -> Point3<f64> {
    let all = scene.things.iter().map(|t| t.bounds).reduce(|a, b| a.union(&b)).expect("objects");
    let c = all.center();
    Point3::new(c.x, c.y, 1.5)
}
