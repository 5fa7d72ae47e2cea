//! scratch timing
#[path = "../tests/support/mod.rs"]
mod support;
use nalgebra::Point3;
fn cpu() -> f64 { std::fs::read_to_string("/proc/thread-self/schedstat").unwrap().split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9 }
use planner::{AirConfig, FlightState, plan_air};
fn main() {
    for seed in 1..8 {
        let voxels = support::flat_3d(1.05, seed);
        let config = AirConfig { ..AirConfig::default() };
        let mut best = 0.0;
        let mut text = String::new();
        for _ in 0..10 {
            let t = cpu();
            let plan = plan_air(&FlightState::resting_at(Point3::new(1.5, 1.5, 1.3)), &Point3::new(15.5, 8.5, 1.3), &|p| voxels.distance(p), &|a, b| voxels.obstacles(a, b), &config);
            best += (cpu() - t) / 10.0;
            text = match plan {
                Ok(p) => {
                    let len: f64 = p.route.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
                    let faces: usize = p.corridor.iter().map(|c| c.faces.len()).sum();
                    format!("len {len:.1} dur {:.1} pieces {} polytopes {} faces {faces} exp {} v {:.2} a {:.2} slack {:.3}", p.trajectory.duration(), p.trajectory.pieces.len(), p.corridor.len(), p.expansions, p.certificate.max_speed_mps, p.certificate.max_accel_mps2, p.certificate.corridor_slack_m)
                }
                Err(e) => format!("{e}"),
            };
        }
        println!("seed {seed}: {:.2} ms {text}", best * 1e3);
    }
}
