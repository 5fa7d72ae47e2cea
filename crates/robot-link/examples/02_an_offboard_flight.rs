//! A whole offboard flight as a state machine: no socket, no clock, no thread. An autopilot in the same process answers.
//!
//! PX4 gives its controls away only to somebody who streams set-points already, answers commands or loses them, and takes its
//! mode back whenever its pilot wants. The session is told what arrives and what time it is, and says what to send. Here a
//! tenth of all datagrams is lost in each direction; then, in full flight, the pilot takes the sticks.
//!
//! Run: `cargo run -p robot-link --example 02_an_offboard_flight`

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::Vector3;
use robot_link::mavlink::stream::Reference;
use robot_link::mavlink::{FrameReader, Message, OffboardSession, Phase, SessionConfig};
use support::{Lossy, MS, ModelPx4, POSITION};

fn main() {
    let (first, second) = (fly(false), fly(true));
    assert_eq!(first, "Landed: nothing went wrong");
    assert!(second.contains("operator") || second.contains("mode"), "{second}");
}

/// One flight; how it ended.
fn fly(takes_sticks: bool) -> String {
    println!(
        "{}",
        if takes_sticks { "\n--- the pilot takes the sticks after eight seconds" } else { "--- a flight to its end" }
    );
    let mut session = OffboardSession::new(SessionConfig::default(), 0).expect("the defaults hold together");
    let mut px4 = ModelPx4::new();
    let (mut up, mut down) = (Lossy::new(0.1, 0.0, 5.0, 1), Lossy::new(0.1, 0.0, 5.0, 2));
    let mut tap = FrameReader::new();
    let (mut last, mut set_points, mut now_ns) = (String::new(), 0, 0);
    while now_ns < 40_000 * MS && !matches!(session.phase(), Phase::Landed | Phase::Ended) {
        now_ns += 10 * MS;
        // 1. What we want: fly, then three metres up and two to the east, then down.
        let t_s = now_ns as f64 * 1e-9;
        if (2.0..20.0).contains(&t_s) {
            session.fly(now_ns);
            let wanted = Vector3::new(2.0, 0.0, 3.0) * ((t_s - 4.0) / 8.0).clamp(0.0, 1.0);
            session.follow(now_ns, &Reference::resting_at(wanted, 0.0)).expect("finite");
        } else if t_s >= 20.0 {
            session.land(now_ns);
        }
        if takes_sticks && t_s > 8.0 {
            px4.custom_mode = POSITION;
        }
        // 2. What arrived; what is due; what is to be sent.
        for datagram in down.arrived(now_ns) {
            session.receive(now_ns, &datagram);
        }
        session.advance(now_ns);
        for frame in session.take_frames() {
            for received in tap.read(&frame) {
                match received.message {
                    Message::SetPositionTargetLocalNed(_) => set_points += 1,
                    Message::CommandLong(command) => {
                        println!("{t_s:6.2} s  -> command {}, try {}", command.command, command.confirmation + 1);
                    }
                    _ => {}
                }
            }
            up.send(now_ns, frame);
        }
        // 3. The other side.
        for datagram in up.arrived(now_ns) {
            px4.receive(now_ns, &datagram).into_iter().for_each(|answer| down.send(now_ns, answer));
        }
        px4.step(now_ns).into_iter().for_each(|said| down.send(now_ns, said));
        // 4. The timeline.
        let phase = format!("{:?}", session.phase());
        if phase != last {
            let [north, east, below] = px4.position;
            println!(
                "{t_s:6.2} s  {phase}: {set_points} set-points sent, armed {}, {north:.1} m north, {east:.1} m east, {:.1} m up",
                px4.is_armed, -below
            );
            last = phase;
        }
    }
    assert!(px4.violations.is_empty(), "the autopilot has objections: {:?}", px4.violations);
    let end = session.fault().map_or("nothing went wrong".to_owned(), ToString::to_string);
    println!("        {last}: {end}");
    format!("{last}: {end}")
}
