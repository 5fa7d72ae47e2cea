//! scratch: words of half 0 that nothing knows
use std::collections::*;
use octant_prompt::refer_set::*;
use octant_prompt::lexicon::{Mark, tokens};
use octant_prompt::vocabulary::*;
fn main() {
    let folder = "/work/shared/data/grounding";
    let scenes: HashMap<String, _> = std::fs::read_to_string(format!("{folder}/scenes.jsonl")).unwrap().lines().map(|l| read_scene(l).unwrap()).collect();
    let mut n: BTreeMap<String, (usize, Vec<String>)> = BTreeMap::new();
    for line in std::fs::read_to_string(format!("{folder}/utterances.jsonl")).unwrap().lines() {
        let (q, key) = read_utterance(line).unwrap();
        if q.half() != 0 || key.set == "sr3d" { continue; }
        let scene = &scenes[&q.scene];
        let is = |p: &str| canonical(p).is_some() || scene.classes.iter().any(|c| c.text == p);
        for t in tokens(&q.text, &is) {
            if t.mark == Mark::Word {
                let w = singular_phrase(&t.text);
                let known = is(&w) || color_rgb(&t.text).is_some() || material(&t.text).is_some() || scene.classes.iter().any(|c| c.text.split(' ').any(|x| x == w));
                if !known { let e = n.entry(t.text.clone()).or_default(); e.0 += 1; e.1.push(q.text.clone()); }
            }
        }
    }
    let mut v: Vec<_> = n.into_iter().collect();
    v.sort_by_key(|(_, c)| std::cmp::Reverse(c.0));
    for (w, (c, t)) in v { println!("{c} {w} | {}", t.iter().take(2).cloned().collect::<Vec<_>>().join(" | ")); }
}
