use nalgebra::Vector3;
use planner::air::{corridor_flight::*, flatness::Airframe, interior::InteriorSettings, limits::*};
use planner::{HalfSpace, Polytope};
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let read = |p: &str| -> serde_json::Value { serde_json::from_str(&std::fs::read_to_string(p).unwrap()).unwrap() };
    let file = read(&args[1]);
    let reference = args.get(2).filter(|a| *a != "-").map(|p| read(p));
    let agile = args.get(3).is_some_and(|a| a == "agile");
    let m = &file["meta"]; let (l, v) = (&m["limits"], &m["vehicle"]);
    let f = |x: &serde_json::Value| x.as_f64().unwrap();
    let airframe = Airframe { mass_kg: f(&v["mass"]), gravity_mps2: f(&v["g"]), drag_across: f(&v["drag_h"]), drag_along: f(&v["drag_v"]), drag_parasitic: f(&v["drag_parasitic"]), speed_epsilon: f(&v["speed_eps"]) };
    let limits = FlightLimits { max_speed_mps: if agile { 12.0 } else { f(&l["v_max"]) }, max_accel_mps2: f64::INFINITY, airframe: Some(airframe), max_tilt_rad: f(&l["tilt_max"]), max_rate_radps: f(&l["omega_max"]), min_thrust_n: f(&l["thrust_min"]), max_thrust_n: f(&l["thrust_max"]), min_duration_s: 0.05, time_weight: if agile { 500.0 } else { 20.0 } };
    let vec = |x: &serde_json::Value| Vector3::new(f(&x[0]), f(&x[1]), f(&x[2]));
    let state = |x: &serde_json::Value| [vec(&x["p"]), vec(&x["v"]), vec(&x["a"])];
    let mut settings = InteriorSettings::default();
    if let Some(s) = args.get(4) { settings.shrink = s.parse().unwrap(); }
    if let Some(s) = args.get(5) { settings.last_weight = s.parse().unwrap(); }
    if let Some(s) = args.get(6) { settings.stage_gain = s.parse().unwrap(); }
    if let Some(s) = args.get(7) { settings.last_gain = s.parse().unwrap(); }
    if let Some(s) = args.get(8) { settings.stage_steps = s.parse().unwrap(); }
    let (mut ratios, mut times, mut steps, mut bad) = (vec![], vec![], vec![], 0);
    for (k, p) in file["problems"].as_array().unwrap().iter().enumerate() {
        let corridor: Vec<Polytope> = p["polytopes"].as_array().unwrap().iter().map(|q| Polytope { faces: q.as_array().unwrap().iter().map(|r| { let n = vec(r); HalfSpace { normal: n / n.norm(), offset_m: -f(&r[3]) / n.norm() } }).collect() }).collect();
        let (s, g) = (state(&p["start"]), state(&p["goal"]));
        if std::env::var("ONLY").is_ok_and(|o| o != k.to_string()) { continue; }
        let reps = if std::env::var("TRACE").is_ok() {1} else {5};
        let mut best = f64::INFINITY;
        let mut out = None;
        for _ in 0..reps { let t = Instant::now(); out = Some(fly_corridor(&s, &g, &corridor, &limits, &settings)); best = best.min(t.elapsed().as_secs_f64() * 1e3); }
        times.push(best);
        match out.unwrap() {
            Ok(o) => {
                steps.push(o.steps as f64);
                if let Some(r) = &reference { ratios.push(o.cost / f(&r["rows"][k]["cost"])); if args.len() > 9 {println!("{k} {:.4} steps {} {:.2} ms minT {:.3} cost {:.2} effort {:.2} peer {:.2} {:.2}", ratios[ratios.len()-1], o.steps, best, o.trajectory.pieces.iter().map(|p| p.duration_s).fold(9.0, f64::min), o.cost, o.effort, f(&r["rows"][k]["cost"]), f(&r["rows"][k]["energy"]));} }
            }
            Err(e) => { bad += 1; println!("{k} {e}"); }
        }
    }
    let q = |v: &mut Vec<f64>| { v.sort_by(f64::total_cmp); let n = v.len(); if n == 0 { return "-".into() } format!("min {:.4} med {:.4} p95 {:.4} max {:.4}", v[0], v[n / 2], v[(n * 95 / 100).min(n - 1)], v[n - 1]) };
    println!("bad {bad} ratio {}", q(&mut ratios));
    println!("ms {}", q(&mut times));
    println!("steps {}", q(&mut steps));
}
