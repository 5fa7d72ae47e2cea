//! Our frames through pymavlink and back, where python3 and pymavlink are there: it reads every field as we meant it, and writes
//! the same bytes. `tests/data/pymavlink_peer.py` is the other end; CONTRIBUTING.md says how to install it.

mod support;

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use robot_link::mavlink::signing::{Signer, SigningKey, Verifier};
use robot_link::mavlink::{FrameReader, FrameWriter, Message};

/// pymavlink in another process.
struct Peer {
    child: Child,
    ask: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peer {
    /// `None`, with a message, where it is not installed.
    fn start() -> Option<Peer> {
        let mut has = Command::new("python3");
        has.args(["-c", "import pymavlink.dialects.v20.common"]).stderr(Stdio::null());
        if !has.status().is_ok_and(|status| status.success()) {
            eprintln!("skipped: python3 with pymavlink is not here");
            return None;
        }
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/pymavlink_peer.py");
        let mut peer = Command::new("python3");
        peer.args([script, "echo"]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = peer.spawn().expect("python3 starts");
        let ask = child.stdin.take().expect("piped");
        let answers = BufReader::new(child.stdout.take().expect("piped"));
        Some(Peer { child, ask, answers })
    }

    /// The frame that pymavlink makes of ours, and the numbers of each field.
    fn echo(&mut self, kind: &str, frame: &[u8]) -> (Vec<u8>, Vec<(String, Vec<f64>)>) {
        let hex: String = frame.iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(self.ask, "{kind} {hex}").expect("it listens");
        let mut line = String::new();
        self.answers.read_line(&mut line).expect("it answers");
        let mut words = line.split_whitespace();
        let bytes = |hex: &str| -> Vec<u8> {
            (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex")).collect()
        };
        let again = bytes(words.next().unwrap_or_else(|| panic!("pymavlink refuses {hex}")));
        let numbers = |hex: &str| -> Vec<f64> {
            bytes(hex).chunks_exact(8).map(|eight| f64::from_le_bytes(eight.try_into().expect("eight"))).collect()
        };
        let field = |word: &str| word.split_once('=').map(|(name, hex)| (name.to_owned(), numbers(hex)));
        (again, words.filter_map(field).collect())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Our fields under pymavlink's names.
fn fields(message: &Message) -> Vec<(&'static str, Vec<f64>)> {
    let wide = |values: &[f32]| -> Vec<f64> { values.iter().map(|value| f64::from(*value)).collect() };
    let one = |value: f32| vec![f64::from(value)];
    let int = |value: i64| vec![value as f64];
    let xyz = |names: [&'static str; 3], v: &[f32; 3]| [0, 1, 2].map(|i| (names[i], one(v[i])));
    match message {
        Message::Heartbeat(m) => vec![
            ("custom_mode", int(m.custom_mode.into())),
            ("type", int(m.vehicle_type.into())),
            ("autopilot", int(m.autopilot.into())),
            ("base_mode", int(m.base_mode.into())),
            ("system_status", int(m.system_status.into())),
        ],
        Message::SysStatus(m) => {
            let mut out = vec![
                ("load", int(m.load.into())),
                ("voltage_battery", int(m.voltage_battery.into())),
                ("current_battery", int(m.current_battery.into())),
                ("battery_remaining", int(m.battery_remaining.into())),
            ];
            let sensors = [
                "onboard_control_sensors_present",
                "onboard_control_sensors_enabled",
                "onboard_control_sensors_health",
            ];
            out.extend(sensors.into_iter().zip(m.sensors.map(|flags| int(flags.into()))));
            let errors =
                ["drop_rate_comm", "errors_comm", "errors_count1", "errors_count2", "errors_count3", "errors_count4"];
            out.extend(errors.into_iter().zip(m.errors.map(|count| int(count.into()))));
            out
        }
        Message::BatteryStatus(m) => vec![
            ("current_consumed", int(m.current_consumed.into())),
            ("energy_consumed", int(m.energy_consumed.into())),
            ("temperature", int(m.temperature.into())),
            ("voltages", m.voltages.map(f64::from).to_vec()),
            ("current_battery", int(m.current_battery.into())),
            ("id", int(m.id.into())),
            ("battery_function", int(m.battery_function.into())),
            ("type", int(m.battery_type.into())),
            ("battery_remaining", int(m.battery_remaining.into())),
        ],
        Message::AttitudeQuaternion(m) => {
            let mut out =
                vec![("time_boot_ms", int(m.time_boot_ms.into())), ("repr_offset_q", wide(&m.display_offset))];
            out.extend(["q1", "q2", "q3", "q4"].into_iter().zip(m.attitude.map(one)));
            out.extend(xyz(["rollspeed", "pitchspeed", "yawspeed"], &m.angular_velocity));
            out
        }
        Message::LocalPositionNed(m) => {
            let mut out = vec![("time_boot_ms", int(m.time_boot_ms.into()))];
            out.extend(xyz(["x", "y", "z"], &m.position));
            out.extend(xyz(["vx", "vy", "vz"], &m.velocity));
            out
        }
        Message::CommandLong(m) => {
            let names = ["param1", "param2", "param3", "param4", "param5", "param6", "param7"];
            let mut out: Vec<_> = names.into_iter().zip(m.params.map(one)).collect();
            out.push(("command", int(m.command.into())));
            out.push(("target_system", int(m.target_system.into())));
            out.push(("target_component", int(m.target_component.into())));
            out.push(("confirmation", int(m.confirmation.into())));
            out
        }
        Message::CommandAck(m) => vec![
            ("command", int(m.command.into())),
            ("result", int(m.result.into())),
            ("progress", int(m.progress.into())),
            ("result_param2", int(m.result_param2.into())),
            ("target_system", int(m.target_system.into())),
            ("target_component", int(m.target_component.into())),
        ],
        Message::SetPositionTargetLocalNed(m) => {
            let mut out = vec![
                ("time_boot_ms", int(m.time_boot_ms.into())),
                ("yaw", one(m.yaw)),
                ("yaw_rate", one(m.yaw_rate)),
                ("type_mask", int(m.type_mask.into())),
                ("target_system", int(m.target_system.into())),
                ("target_component", int(m.target_component.into())),
                ("coordinate_frame", int(m.coordinate_frame.into())),
            ];
            out.extend(xyz(["x", "y", "z"], &m.position));
            out.extend(xyz(["vx", "vy", "vz"], &m.velocity));
            out.extend(xyz(["afx", "afy", "afz"], &m.acceleration));
            out
        }
        Message::Timesync(m) => vec![("tc1", int(m.tc1)), ("ts1", int(m.ts1))],
        Message::StatusText(m) => {
            // pymavlink ends a text at its first zero.
            let text = m.text.iter().take_while(|byte| **byte != 0).map(|byte| f64::from(*byte)).collect();
            vec![
                ("severity", int(m.severity.into())),
                ("text", text),
                ("id", int(m.id.into())),
                ("chunk_seq", int(m.chunk.into())),
            ]
        }
        Message::Odometry(m) => {
            let mut out = vec![
                ("time_usec", vec![m.time_usec as f64]),
                ("q", wide(&m.attitude)),
                ("pose_covariance", wide(&m.pose_covariance)),
                ("velocity_covariance", wide(&m.velocity_covariance)),
                ("frame_id", int(m.frame_id.into())),
                ("child_frame_id", int(m.child_frame_id.into())),
                ("reset_counter", int(m.reset_counter.into())),
                ("estimator_type", int(m.estimator_type.into())),
                ("quality", int(m.quality.into())),
            ];
            out.extend(xyz(["x", "y", "z"], &m.position));
            out.extend(xyz(["vx", "vy", "vz"], &m.velocity));
            out.extend(xyz(["rollspeed", "pitchspeed", "yawspeed"], &m.angular_velocity));
            out
        }
    }
}

/// 300 random messages, each of them as often signed as not.
#[test]
fn pymavlink_reads_what_we_mean_and_writes_what_we_write() {
    let Some(mut peer) = Peer::start() else { return };
    let mut runner = TestRunner::deterministic();
    let key = SigningKey::new(std::array::from_fn(|i| i as u8));
    let mut writer = FrameWriter::new(245, 191);
    let mut signer = Signer::new(key.clone(), 3, 40_000_000_000_000);
    let mut reader = FrameReader::demanding(Verifier::new(key, 0));
    for _ in 0..300 {
        let message = support::messages::message().new_tree(&mut runner).expect("a message").current();
        let plain = writer.write(&message);
        let signed = writer.write_signed(&message, &mut signer, 0).expect("time stamps are left");
        for (kind, frame) in [("plain", &plain), ("signed", &signed)] {
            let (again, theirs) = peer.echo(kind, frame);
            assert_eq!(&again, frame, "{kind} {message:?}");
            for (name, ours) in fields(&message) {
                let numbers = theirs.iter().find(|(theirs, _)| theirs == name).map(|(_, numbers)| numbers);
                assert_eq!(format!("{numbers:?}"), format!("{:?}", Some(&ours)), "{name} of {message:?}");
            }
        }
        // What it has signed, we accept.
        let (again, _) = peer.echo("signed", &writer.write_signed(&message, &mut signer, 0).expect("left"));
        assert_eq!(reader.read(&again).len(), 1);
    }
}
