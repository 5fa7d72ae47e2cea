//! The aerial reference robot: a quadrotor that is told what to find.
//!
//! `cargo run --release -p omnivln-aerial -- "go to the plant in the meeting room"`

use std::process::ExitCode;

use arena::mission::robot_model::RobotKind;

fn main() -> ExitCode {
    arena::cli::robot_main(RobotKind::Aerial, "office")
}
