//! A robot on twelve motors walks five metres, or falls.
//!
//! In a mission the robot's base is moved and its legs are drawn after it. Here nothing moves the base but the feet: thirteen bodies of the
//! URDF's masses on motors of the URDF's torques, a floor with friction, and the gait that the missions use. The lesson: the same
//! footholds that look right also hold a body up, as long as what they are told is the velocity that the body truly has.
//!
//! `cargo run --release -p arena --example trot [ROBOT.urdf]`

use std::path::PathBuf;

use arena::cli::load_robot;
use arena::mission::robot_model::RobotKind;
use arena::trot::{TrotConfig, trot};

fn main() -> anyhow::Result<()> {
    let urdf = std::env::args().nth(1).map(PathBuf::from);
    let robot = load_robot(urdf.as_deref(), RobotKind::Ground)?;
    let plain = TrotConfig::default();
    let ways = [
        ("straight on", plain.clone()),
        ("in a circle", TrotConfig { yaw_rate_radps: 0.5, ..plain.clone() }),
        ("pushed aside", TrotConfig { push_mps: 0.3, ..plain }),
    ];
    for (name, config) in ways {
        let report = trot(&robot, &config)?;
        println!(
            "{} {name}: {:.2} m in {:.1} s with {} steps, {}; turned {:.2} rad, tilt at most {:.1} degrees, {:.2} m beside its line, feet slid {:.1} cm a metre",
            robot.name,
            report.distance_m,
            report.seconds,
            report.steps,
            if report.has_fallen { "fell" } else { "on its feet" },
            report.turned_rad,
            report.worst_tilt_rad.to_degrees(),
            report.beside_m,
            100.0 * report.slip_m_per_m,
        );
    }
    Ok(())
}
