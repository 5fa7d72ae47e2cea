mod support;
use nalgebra::Point2;
use planner::ground::far::{DynamicVisibilityGraph, config::FarConfig, tile::Through};
use planner::{GridView, VisibilityGraph};
use support::building::*;
use std::time::Instant;

#[test]
fn full() {
    for seed in 1..6 {
    let b = Building::of_rooms(6, 5, 0.15, seed, 3, 2);
    let belief = Belief::of_all(&b);
    let mut g = DynamicVisibilityGraph::new(FarConfig::default()).unwrap();
    let mut cells = Vec::new();
    let at = b.rooms[0];
    let mut n = 0;
    loop {
        let w = belief.window(&at, 401, &mut cells);
        let t = Instant::now();
        let u = g.update(&ground(&at), &w).unwrap();
        println!("{n} {:?} {u:?}", t.elapsed());
        n += 1;
        if u.unsettled == 0 || n > 80 { break; }
    }
    g.check_invariants();
    println!("nodes {} edges {}", g.nodes().count(), g.edges().count());
    let blocked = b.occupied.clone();
    let view = GridView { origin: Point2::origin(), resolution_m: 0.15, width: b.width as usize, height: b.height as usize, blocked: &blocked };
    let s = VisibilityGraph::build(&view, 0.4).unwrap();
    for k in 1..30 {
        let t = Instant::now();
        let r = g.route_through(&ground(&at), &ground(&b.rooms[k]), Through::Known);
        let e = t.elapsed();
        let o = s.lengths_from(&at, &[b.rooms[k]])[0];
        match r { Ok(r) => println!("{k} {:.3} {:?} ratio {:.4} {e:?} {}", r.length_m, o, r.length_m / o.unwrap_or(f64::NAN), r.points.len()), Err(e) => println!("{k} {e} {o:?}") }
    }
    }
}
