use octant_prompt::describe::*;
use octant_prompt::refer_set::read_scene;
use std::collections::BTreeMap;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let step: usize = std::env::args().nth(2).map_or(8, |s| s.parse().unwrap());
    let off: usize = std::env::args().nth(3).map_or(0, |s| s.parse().unwrap());
    let text = std::fs::read_to_string(path).unwrap();
    let (mut n, mut ok, mut vi, mut vd, mut words) = (0, 0, 0, 0, 0);
    let mut fails: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
    let t = std::time::Instant::now();
    for line in text.lines().skip(off).step_by(step) {
        let (name, scene) = read_scene(line).unwrap();
        for (index, thing) in scene.things.iter().enumerate() {
            if is_hull(scene.label(index)) {
                continue;
            }
            n += 1;
            let same = (0..scene.things.len()).filter(|o| scene.label(*o) == scene.label(index)).count();
            let d = describe(&scene, thing.id);
            let e = fails.entry(same).or_default();
            e.1 += 1;
            if let Some(d) = &d {
                ok += 1;
                words += d.words();
                if std::env::var("SHOW").is_ok() {
                    println!("{name} {} OK {}", thing.id.0, d.text);
                }
            } else {
                e.0 += 1;
                println!(
                    "{name} {} {} same {same} {:?} {:?}",
                    thing.id.0,
                    scene.label(index),
                    thing.bounds.center(),
                    thing.bounds.sides_m()
                );
            }
            if std::env::var("FULL").is_ok() {
                vi += usize::from(describe_without_a_view(&scene, thing.id).is_some());
                vd += usize::from(describe_from_a_view(&scene, thing.id).is_some());
            }
        }
    }
    println!(
        "n {n} ok {ok} {:.2}% vi {:.2}% vd {:.2}% words {:.2} in {:?}",
        100.0 * ok as f64 / n as f64,
        100.0 * vi as f64 / n as f64,
        100.0 * vd as f64 / n as f64,
        words as f64 / ok as f64,
        t.elapsed()
    );
    println!("{fails:?}");
}
