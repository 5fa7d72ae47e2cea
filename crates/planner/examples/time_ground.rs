//! scratch timing
#[path = "../tests/support/mod.rs"]
mod support;
use nalgebra::Point2;
use planner::VisibilityGraph;
fn main() {
    for seed in [0, 1000, 2000, 3000, 4000, 5000] {
        let picture = support::flat(1.0, seed);
        let mut best = [f64::MAX; 3];
        let goals: Vec<Point2<f64>> = (0..50).map(|k| Point2::new(1.0 + (k % 10) as f64 * 1.6, 1.0 + (k / 10) as f64 * 1.9)).collect();
        let mut info = (0, 0, 0, None);
        for _ in 0..7 {
            let t = std::time::Instant::now();
            let g = VisibilityGraph::build(&picture.view(), 0.406).unwrap();
            best[0] = best[0].min(t.elapsed().as_secs_f64());
            let t = std::time::Instant::now();
            let r = g.route(&Point2::new(2.5, 2.0), &Point2::new(14.5, 8.0));
            best[1] = best[1].min(t.elapsed().as_secs_f64());
            let t = std::time::Instant::now();
            let l = g.lengths_from(&Point2::new(2.5, 2.0), &goals);
            best[2] = best[2].min(t.elapsed().as_secs_f64());
            info = (g.vertex_count(), g.edge_count(), l.iter().flatten().count(), r.map(|r| (r.length_m, r.points.len())));
        }
        println!("seed {seed}: build {:.2} ms route {:.3} ms lengths {:.3} ms {info:?}", best[0] * 1e3, best[1] * 1e3, best[2] * 1e3);
    }
}
