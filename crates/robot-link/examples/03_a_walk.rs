//! A whole walk of a quadruped as a state machine: no DDS, no clock, no thread. A robot in the same process answers.
//!
//! A Unitree robot takes calls: stand up, balance, move, stop, lie down. It answers "done" at once, whatever it does; a `Move` drives for a
//! second and must be repeated; and after standing up it may ignore `Move` for seconds. So the session believes the robot's state, not its
//! answers. Here the robot ignores us for six seconds, then walks; then our own commands stop coming, then they come again. On the
//! second walk the robot falls silent, and is damped.
//!
//! Run: `cargo run -p robot-link --example 03_a_walk`

#[path = "../tests/support/dog.rs"]
mod dog;

use dog::{MS, ModelDog};
use robot_link::unitree::{Phase, SessionConfig, Velocity, WalkSession};

fn main() {
    let (first, moves) = walk(false);
    assert_eq!(first, "Down: nothing went wrong");
    assert!((300..460).contains(&moves), "20 a second while commands came: {moves}");
    let (second, _) = walk(true);
    assert!(second.contains("the link to the robot is lost"), "{second}");
}

/// One walk; how it ended, and the number of `Move`s.
fn walk(falls_silent: bool) -> (String, usize) {
    println!("{}", if falls_silent { "\n--- the robot falls silent after 16 s" } else { "--- a walk to its end" });
    let mut session = WalkSession::new(SessionConfig::default()).expect("the defaults hold together");
    let mut robot = ModelDog::new();
    robot.deaf_ns = 6_000 * MS;
    let (mut last, mut now_ns) = (String::new(), 0);
    while now_ns < 40_000 * MS && !session.is_over() {
        now_ns += 20 * MS;
        let t_s = now_ns as f64 * 1e-9;
        // 1. What we want: walk in an arc, but for three seconds nobody here says so; then lie down.
        match t_s {
            _ if (1.0..24.0).contains(&t_s) => session.walk(now_ns),
            _ if t_s >= 24.0 => session.lie_down(now_ns),
            _ => {}
        }
        if !(12.0..15.0).contains(&t_s) {
            let arc = Velocity { forward_mps: 0.5, left_mps: 0.0, yaw_rate_radps: 0.3 };
            session.drive(now_ns, &arc).expect("finite");
        }
        // 2. What arrived: a state fifty times a second.
        let state = robot.step(now_ns);
        if !(falls_silent && t_s > 16.0) {
            session.receive_state(now_ns, &state);
        }
        // 3. What is due, and what the robot answers.
        session.advance(now_ns);
        for request in session.take_requests() {
            if let Some(answer) = robot.receive(now_ns, &request.to_cdr()) {
                session.receive_response(now_ns, &answer);
            }
        }
        let [x, y] = robot.position;
        let is_moving = robot.velocity[0] > 0.05;
        let line = format!("{:?}, the robot {}", session.phase(), if is_moving { "walks" } else { "does not walk" });
        if line != last {
            println!("{t_s:6.2} s  {line} at {x:.2}, {y:.2} m");
            last = line;
        }
    }
    assert!(robot.violations.is_empty(), "{:?}", robot.violations);
    let end = session.fault().map_or("nothing went wrong".to_owned(), ToString::to_string);
    println!("{end}");
    let phase = if session.phase() == Phase::Down { "Down" } else { "Ended" };
    (format!("{phase}: {end}"), robot.count(dog::MOVE))
}
