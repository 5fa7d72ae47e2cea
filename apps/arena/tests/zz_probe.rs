mod support;
use support::*;
use arena::mission::robot_model::RobotKind;
#[test]
fn probe() {
    for (kind, name, text) in [(RobotKind::Ground, "flat", "find the mug near the sink"), (RobotKind::Aerial, "flat", "find the mug near the sink"), (RobotKind::Ground,"spin","find the sofa"),(RobotKind::Aerial,"spin","find the sofa")] {
        let s = scene(name);
        for seed in 1..3 {
        for c in [short(15.0), coarse(15.0)] {
        let t = std::time::Instant::now();
        let r = short_run(&c, kind, &s, text, seed);
        println!("{kind:?} {name} {seed} wall {:.1} sim {} path {:.2} dec {} {}", t.elapsed().as_secs_f64(), r.summary.sim_s, r.summary.path_m, r.summary.decisions, r.summary.reason);
        for d in &r.journal().decisions { println!("   {:.1} {} {:?}", d.decided_s, d.action, d.verdicts); }
        } }
    }
}
