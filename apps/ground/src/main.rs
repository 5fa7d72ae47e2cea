//! The ground reference robot: a quadruped that is told what to find.
//!
//! `cargo run --release -p omnivln-ground -- "find the mug near the sink"`

use std::process::ExitCode;

use arena::mission::robot_model::RobotKind;

fn main() -> ExitCode {
    arena::cli::robot_main(RobotKind::Ground, "flat")
}
