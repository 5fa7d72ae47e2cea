//! A model of PX4 toward an offboard program, and a link that loses, doubles, delays and reorders datagrams.
//!
//! Written from PX4's published rules and not from the session's code: it judges what the session sends.

#![allow(dead_code)] // every test takes what it needs

pub mod messages;

use robot_link::mavlink::signing::{Signer, SigningKey};
use robot_link::mavlink::{
    AttitudeQuaternion, BatteryStatus, CommandAck, CommandLong, FrameReader, FrameWriter, Heartbeat, LocalPositionNed,
    Message, StatusText, Timesync,
};

pub const MS: i64 = 1_000_000;
pub const OFFBOARD: u32 = 6 << 16;
pub const POSITION: u32 = 3 << 16;
pub const LAND: u32 = 4 << 16 | 6 << 24;

/// The autopilot.
pub struct ModelPx4 {
    pub system_id: u8,
    pub custom_mode: u32,
    pub is_armed: bool,
    /// North, east, down.
    pub position: [f32; 3],
    /// Answers to commands, 0 unless set.
    pub answer_to_mode: u8,
    pub answer_to_arming: u8,
    /// No answers at all.
    pub is_mute: bool,
    /// No pose.
    pub has_no_estimate: bool,
    /// What it says of its battery, in percent, if anything.
    pub battery: Option<i8>,
    /// Rules that were broken.
    pub violations: Vec<String>,
    /// Commands received, with their times.
    pub commands: Vec<(i64, CommandLong)>,
    /// Set-points received: time, position or `None` for "stand still", velocity.
    pub set_points: Vec<(i64, Option<[f32; 3]>, [f32; 3])>,
    pub odometry: usize,
    pub reader: FrameReader,
    writer: FrameWriter,
    signer: Option<Signer>,
    clock_offset_ns: i64,
    target: Option<[f32; 3]>,
    stream_since_ns: i64,
}

impl ModelPx4 {
    pub fn new() -> ModelPx4 {
        ModelPx4 {
            system_id: 1,
            custom_mode: POSITION,
            is_armed: false,
            position: [0.0; 3],
            answer_to_mode: 0,
            answer_to_arming: 0,
            is_mute: false,
            has_no_estimate: false,
            battery: None,
            violations: Vec::new(),
            commands: Vec::new(),
            set_points: Vec::new(),
            odometry: 0,
            reader: FrameReader::new(),
            writer: FrameWriter::new(1, 1),
            signer: None,
            clock_offset_ns: 77_000_000_000,
            target: None,
            stream_since_ns: 0,
        }
    }

    pub fn sign(&mut self, key: SigningKey) {
        self.signer = Some(Signer::new(key, 0, 1_000_000));
    }

    /// Takes a datagram; returns answers.
    pub fn receive(&mut self, now_ns: i64, datagram: &[u8]) -> Vec<Vec<u8>> {
        let mut answers = Vec::new();
        for received in self.reader.read(datagram) {
            match received.message {
                Message::CommandLong(command) => {
                    self.commands.push((now_ns, command));
                    let result = self.obey(now_ns, &command);
                    let (command, target_system, target_component) =
                        (command.command, received.system_id, received.component_id);
                    let ack = CommandAck { command, result, target_system, target_component, ..CommandAck::default() };
                    if !self.is_mute {
                        answers.push(Message::CommandAck(ack));
                    }
                }
                Message::SetPositionTargetLocalNed(target) => {
                    let is_fresh = self.set_points.last().is_some_and(|(last, ..)| now_ns - last < 500 * MS);
                    if !is_fresh {
                        self.stream_since_ns = now_ns;
                    }
                    let position = (target.type_mask & 7 == 0).then_some(target.position);
                    if !position.unwrap_or_default().iter().chain(&target.velocity).all(|x| x.is_finite()) {
                        self.violations.push("a set-point is not finite".into());
                    }
                    self.target = position;
                    self.set_points.push((now_ns, position, target.velocity));
                }
                Message::Timesync(Timesync { tc1: 0, ts1 }) => {
                    answers.push(Message::Timesync(Timesync { tc1: now_ns + self.clock_offset_ns, ts1 }));
                }
                Message::Odometry(_) => self.odometry += 1,
                _ => {}
            }
        }
        self.reader.end_of_datagram();
        answers.iter().map(|message| self.frame(message)).collect()
    }

    /// PX4: more than a second of set-points, none of them more than half a second apart.
    fn has_proof_of_life(&self, now_ns: i64) -> bool {
        let is_fresh = self.set_points.last().is_some_and(|(last, ..)| now_ns - last <= 500 * MS);
        is_fresh && now_ns - self.stream_since_ns >= 1000 * MS
    }

    fn obey(&mut self, now_ns: i64, command: &CommandLong) -> u8 {
        match command.command {
            176 if command.params[..2] == [1.0, 6.0] => {
                if !self.has_proof_of_life(now_ns) {
                    self.violations.push(format!("OFFBOARD without a stream at {now_ns}"));
                    return 1;
                }
                if self.answer_to_mode == 0 {
                    self.custom_mode = OFFBOARD;
                }
                self.answer_to_mode
            }
            400 if command.params[0] == 1.0 => {
                if !self.has_proof_of_life(now_ns) {
                    self.violations.push(format!("armed without a stream at {now_ns}"));
                    return 1;
                }
                self.is_armed |= self.answer_to_arming == 0;
                self.answer_to_arming
            }
            400 if self.position[2] < -0.1 => {
                self.violations.push("motors off in the air".into());
                1
            }
            400 => {
                self.is_armed = false;
                0
            }
            21 => {
                self.custom_mode = LAND;
                0
            }
            511 => 0,
            other => {
                self.violations.push(format!("command {other} was not expected"));
                3
            }
        }
    }

    /// Five milliseconds of flight; what it says of itself.
    pub fn step(&mut self, now_ns: i64) -> Vec<Vec<u8>> {
        let position = self.position;
        let mut velocity = [0.0f32; 3];
        if self.is_armed && self.custom_mode == OFFBOARD {
            let toward =
                |target: [f32; 3]| std::array::from_fn(|axis| (2.0 * (target[axis] - position[axis])).clamp(-3.0, 3.0));
            velocity = self.target.map_or(velocity, toward);
        } else if self.is_armed && self.custom_mode == LAND && position[2] < 0.0 {
            velocity[2] = 0.7;
        }
        self.position = std::array::from_fn(|axis| position[axis] + 0.005 * velocity[axis]);
        self.position[2] = self.position[2].min(0.0);
        let (tick, mut said) = (now_ns / (5 * MS), Vec::new());
        let time_boot_ms = ((now_ns + self.clock_offset_ns) / MS) as u32;
        if tick % 200 == 0 {
            let base_mode = 1 | if self.is_armed { 128 } else { 0 };
            let (custom_mode, vehicle_type, autopilot) = (self.custom_mode, 2, 12);
            let heartbeat =
                Heartbeat { custom_mode, vehicle_type, autopilot, base_mode, system_status: 4, mavlink_version: 3 };
            said.push(Message::Heartbeat(heartbeat));
        }
        if tick % 100 == 0
            && let Some(battery_remaining) = self.battery
        {
            said.push(Message::BatteryStatus(BatteryStatus { battery_remaining, ..BatteryStatus::default() }));
        }
        if tick % 7 == 0 && !self.has_no_estimate {
            let position = self.position;
            said.push(Message::LocalPositionNed(LocalPositionNed { time_boot_ms, position, velocity }));
        }
        if tick % 4 == 0 && !self.has_no_estimate {
            let attitude = [1.0, 0.0, 0.0, 0.0];
            said.push(Message::AttitudeQuaternion(AttitudeQuaternion {
                time_boot_ms,
                attitude,
                ..AttitudeQuaternion::default()
            }));
        }
        said.iter().map(|message| self.frame(message)).collect()
    }

    /// A sentence for people.
    pub fn say(&mut self, words: &str) -> Vec<u8> {
        let mut text = [0; 50];
        text[..words.len()].copy_from_slice(words.as_bytes());
        self.frame(&Message::StatusText(StatusText { severity: 3, text, id: 0, chunk: 0 }))
    }

    fn frame(&mut self, message: &Message) -> Vec<u8> {
        self.writer.system_id = self.system_id;
        match &mut self.signer {
            None => self.writer.write(message),
            Some(signer) => self.writer.write_signed(message, signer, 0).expect("time stamps are left"),
        }
    }
}

/// Draws of a link, from a seed: a number in 0..1.
pub struct Dice(pub u64);

impl Dice {
    pub fn roll(&mut self) -> f64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// One direction of a link.
pub struct Lossy {
    pub loss: f64,
    pub doubling: f64,
    pub delay_ms: f64,
    pub dice: Dice,
    under_way: Vec<(i64, u64, Vec<u8>)>,
    sent: u64,
}

impl Lossy {
    pub fn new(loss: f64, doubling: f64, delay_ms: f64, seed: u64) -> Lossy {
        Lossy { loss, doubling, delay_ms, dice: Dice(seed), under_way: Vec::new(), sent: 0 }
    }

    pub fn send(&mut self, now_ns: i64, datagram: Vec<u8>) {
        let copies = 1 + usize::from(self.dice.roll() < self.doubling);
        for _ in 0..copies {
            if self.dice.roll() >= self.loss {
                let arrival = now_ns + (self.dice.roll() * self.delay_ms * 1e6) as i64;
                self.sent += 1;
                self.under_way.push((arrival, self.sent, datagram.clone()));
            }
        }
    }

    /// What arrives by now, in order of arrival.
    pub fn arrived(&mut self, now_ns: i64) -> Vec<Vec<u8>> {
        let mut here: Vec<_> = self.under_way.extract_if(.., |(arrival, ..)| *arrival <= now_ns).collect();
        here.sort_by_key(|(arrival, number, _)| (*arrival, *number));
        here.into_iter().map(|(.., datagram)| datagram).collect()
    }
}
