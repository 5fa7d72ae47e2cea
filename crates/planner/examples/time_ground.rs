//! scratch timing
#[path = "../tests/support/mod.rs"]
mod support;
use nalgebra::Point2;
fn cpu() -> f64 { std::fs::read_to_string("/proc/thread-self/schedstat").unwrap().split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9 }
use planner::VisibilityGraph;
fn main() {
    {
        use nalgebra::Point2;
        let mut policy = planner::LocalPolicy::new(planner::LocalPolicyConfig::default()).unwrap();
        // door of 1 m at x = 2.5..2.6 and 4000 points
        for (name, spread) in [("cluttered", 0.6f32), ("open", 2.5)] {
        let mut pts = vec![];
        for k in 0..2000 { let t = k as f32 / 2000.0; pts.push(Point2::new(0.5 + (t*37.0).sin()*0.05, 0.5 + t*2.0)); pts.push(Point2::new(0.5 + (t*31.0).cos()*0.05, -0.5 - t*2.0)); }
        for p in &mut pts { if spread > 1.0 { p.x += 1.5; } }
        let path = [Point2::new(0.0,0.0), Point2::new(3.0,0.0)];
        let mut best = [f64::MAX; 2]; let mut sum = 0.0; let n = 500;
        for k in 0..n {
            if k % 5 == 0 { pts[0].x += 1e-4; }
            let t = cpu();
            let c = policy.command((0.3, 0.02, 0.1), (0.4, 0.0, 0.0), &path, None, &pts);
            let e = cpu() - t; sum += e;
            best[usize::from(k % 5 == 0)] = best[usize::from(k % 5 == 0)].min(e);
            std::hint::black_box(c);
        }
        println!("local {name}: same points {:.3} ms, new points {:.3} ms, mean {:.3}", best[0]*1e3, best[1]*1e3, sum / n as f64 * 1e3);
        }
    }
    for seed in [0, 1000, 2000, 3000, 4000, 5000] {
        let picture = support::flat(1.0, seed);
        let mut best = [f64::MAX; 3];
        let goals: Vec<Point2<f64>> = (0..50).map(|k| Point2::new(1.0 + (k % 10) as f64 * 1.6, 1.0 + (k / 10) as f64 * 1.9)).collect();
        let mut info = (0, 0, 0, None);
        for _ in 0..60 {
            let t = cpu();
            let g = VisibilityGraph::build(&picture.view(), 0.406).unwrap();
            best[0] = best[0].min(cpu() - t);
            let t = cpu();
            let r = g.route(&Point2::new(2.5, 2.0), &Point2::new(14.5, 8.0));
            best[1] = best[1].min(cpu() - t);
            let t = cpu();
            let l = g.lengths_from(&Point2::new(2.5, 2.0), &goals);
            best[2] = best[2].min(cpu() - t);
            info = (g.vertex_count(), g.edge_count(), l.iter().flatten().count(), r.map(|r| (r.length_m, r.points.len())));
        }
        println!("seed {seed}: build {:.2} ms route {:.3} ms lengths {:.3} ms {info:?}", best[0] * 1e3, best[1] * 1e3, best[2] * 1e3);
    }
}
