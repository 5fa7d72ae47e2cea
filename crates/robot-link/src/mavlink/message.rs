//! The messages of an offboard session, field by field in wire order (little endian, widest fields first, extensions last).
//!
//! A payload shorter than the message is filled with zeros, as MAVLink 2 prescribes; a longer one carries extensions from a newer
//! dialect, which are ignored.

/// What a frame reader must know about a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Specification {
    /// Checksum of the field definitions.
    pub crc_extra: u8,
    /// Payload with all extensions known here.
    pub length: usize,
}

/// The specification of a message known here.
pub fn specification(id: u32) -> Option<Specification> {
    let (crc_extra, length) = match id {
        0 => (50, 9),
        1 => (124, 31),
        31 => (246, 48),
        32 => (185, 28),
        76 => (152, 33),
        77 => (143, 10),
        84 => (143, 53),
        111 => (34, 16),
        147 => (154, 36),
        253 => (83, 54),
        331 => (91, 233),
        _ => return None,
    };
    Some(Specification { crc_extra, length })
}

/// A message known here.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// "I am here", once a second.
    Heartbeat(Heartbeat),
    /// How the vehicle is, its battery among others.
    SysStatus(SysStatus),
    /// Which way the vehicle is turned.
    AttitudeQuaternion(AttitudeQuaternion),
    /// Where the vehicle is.
    LocalPositionNed(LocalPositionNed),
    /// A command.
    CommandLong(CommandLong),
    /// The answer to a command.
    CommandAck(CommandAck),
    /// Where to be.
    SetPositionTargetLocalNed(SetPositionTargetLocalNed),
    /// Clock comparison.
    Timesync(Timesync),
    /// How one battery is.
    BatteryStatus(BatteryStatus),
    /// A sentence for people.
    StatusText(StatusText),
    /// Where the robot is, from our own odometry.
    Odometry(Box<Odometry>),
}

/// HEARTBEAT (0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Heartbeat {
    /// Mode of the autopilot; PX4: main mode << 16 | sub mode << 24.
    pub custom_mode: u32,
    /// MAV_TYPE: 2 quadrotor, 18 onboard controller.
    pub vehicle_type: u8,
    /// MAV_AUTOPILOT: 12 PX4, 8 none.
    pub autopilot: u8,
    /// Flags: 128 armed, 1 custom mode.
    pub base_mode: u8,
    /// MAV_STATE: 3 standby, 4 active.
    pub system_status: u8,
    /// Always 3.
    pub mavlink_version: u8,
}

/// SYS_STATUS (1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SysStatus {
    /// Sensors that are there, that are switched on, and that work: MAV_SYS_STATUS_SENSOR flags.
    pub sensors: [u32; 3],
    /// Load of the main loop, 0.1 %.
    pub load: u16,
    /// Battery, mV; 65535 unknown.
    pub voltage_battery: u16,
    /// Battery, 10 mA; -1 unknown.
    pub current_battery: i16,
    /// Share of packets lost, 0.01 %; packets lost; four counters of the autopilot's own.
    pub errors: [u16; 6],
    /// Battery, percent left; -1 unknown.
    pub battery_remaining: i8,
}

/// ATTITUDE_QUATERNION (31).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AttitudeQuaternion {
    /// Time since boot, ms.
    pub time_boot_ms: u32,
    /// Attitude (w, x, y, z): FRD body to NED.
    pub attitude: [f32; 4],
    /// Roll, pitch and yaw speed in the FRD body, rad/s.
    pub angular_velocity: [f32; 3],
    /// Turn to apply for display, all zero for none; not used here.
    pub display_offset: [f32; 4],
}

/// LOCAL_POSITION_NED (32).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LocalPositionNed {
    /// Time since boot, ms.
    pub time_boot_ms: u32,
    /// North, east, down, m.
    pub position: [f32; 3],
    /// North, east, down, m/s.
    pub velocity: [f32; 3],
}

/// COMMAND_LONG (76).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CommandLong {
    /// Parameters 1 to 7.
    pub params: [f32; 7],
    /// MAV_CMD.
    pub command: u16,
    /// Addressed system.
    pub target_system: u8,
    /// Addressed component.
    pub target_component: u8,
    /// 0 first, +1 with every repetition.
    pub confirmation: u8,
}

/// COMMAND_ACK (77).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CommandAck {
    /// The command answered.
    pub command: u16,
    /// MAV_RESULT: 0 accepted.
    pub result: u8,
    /// Percent while in progress.
    pub progress: u8,
    /// Further reason.
    pub result_param2: i32,
    /// Who sent the command.
    pub target_system: u8,
    /// Who sent the command.
    pub target_component: u8,
}

/// SET_POSITION_TARGET_LOCAL_NED (84).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SetPositionTargetLocalNed {
    /// Time since boot, ms.
    pub time_boot_ms: u32,
    /// North, east, down, m.
    pub position: [f32; 3],
    /// North, east, down, m/s.
    pub velocity: [f32; 3],
    /// North, east, down, m/s^2.
    pub acceleration: [f32; 3],
    /// Clockwise from north, rad.
    pub yaw: f32,
    /// Clockwise, rad/s.
    pub yaw_rate: f32,
    /// Which of the above to ignore.
    pub type_mask: u16,
    /// Addressed system.
    pub target_system: u8,
    /// Addressed component.
    pub target_component: u8,
    /// MAV_FRAME: 1 LOCAL_NED.
    pub coordinate_frame: u8,
}

/// TIMESYNC (111).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timesync {
    /// Time of the answering side, ns; 0 in a request.
    pub tc1: i64,
    /// Time of the asking side, ns.
    pub ts1: i64,
}

/// BATTERY_STATUS (147).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BatteryStatus {
    /// Drawn so far, mAh; -1 unknown.
    pub current_consumed: i32,
    /// Drawn so far, hJ; -1 unknown.
    pub energy_consumed: i32,
    /// 0.01 degrees Celsius; 32767 unknown.
    pub temperature: i16,
    /// Of each cell, mV; 65535 for none.
    pub voltages: [u16; 10],
    /// 10 mA; -1 unknown.
    pub current_battery: i16,
    /// Which battery.
    pub id: u8,
    /// MAV_BATTERY_FUNCTION: what it drives.
    pub battery_function: u8,
    /// MAV_BATTERY_TYPE: its chemistry.
    pub battery_type: u8,
    /// Percent left; -1 unknown.
    pub battery_remaining: i8,
}

/// STATUSTEXT (253).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatusText {
    /// MAV_SEVERITY: 0 emergency, 3 error, 4 warning, 6 information.
    pub severity: u8,
    /// The text, filled up with zeros.
    pub text: [u8; 50],
    /// Which of several long texts this is a part of; 0 when it is one by itself.
    pub id: u16,
    /// Which part.
    pub chunk: u8,
}

impl StatusText {
    /// What it says: printable ASCII only, whatever was sent.
    pub fn words(&self) -> String {
        let said = self.text.iter().take_while(|byte| **byte != 0);
        said.map(|byte| if byte.is_ascii_graphic() { char::from(*byte) } else { ' ' }).collect::<String>().trim().into()
    }
}

/// ODOMETRY (331).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Odometry {
    /// Time, microseconds.
    pub time_usec: u64,
    /// Position in `frame_id`, m.
    pub position: [f32; 3],
    /// Attitude (w, x, y, z): `child_frame_id` to `frame_id`.
    pub attitude: [f32; 4],
    /// Velocity in `child_frame_id`, m/s.
    pub velocity: [f32; 3],
    /// Angular velocity in `child_frame_id`, rad/s.
    pub angular_velocity: [f32; 3],
    /// Upper triangle, row by row, of the covariance of position and attitude; NaN first: unknown.
    pub pose_covariance: [f32; 21],
    /// Upper triangle, row by row, of the covariance of the velocities; NaN first: unknown.
    pub velocity_covariance: [f32; 21],
    /// MAV_FRAME of the pose: 1 LOCAL_NED, 20 LOCAL_FRD.
    pub frame_id: u8,
    /// MAV_FRAME of the velocities: 12 BODY_FRD.
    pub child_frame_id: u8,
    /// +1 with every jump of the estimate.
    pub reset_counter: u8,
    /// MAV_ESTIMATOR_TYPE: 2 vision, 3 VIO, 7 LiDAR.
    pub estimator_type: u8,
    /// Percent; 0 unknown, -1 failed.
    pub quality: i8,
}

impl Message {
    /// Number of the message.
    pub fn id(&self) -> u32 {
        match self {
            Self::Heartbeat(_) => 0,
            Self::SysStatus(_) => 1,
            Self::AttitudeQuaternion(_) => 31,
            Self::LocalPositionNed(_) => 32,
            Self::CommandLong(_) => 76,
            Self::CommandAck(_) => 77,
            Self::SetPositionTargetLocalNed(_) => 84,
            Self::Timesync(_) => 111,
            Self::BatteryStatus(_) => 147,
            Self::StatusText(_) => 253,
            Self::Odometry(_) => 331,
        }
    }

    /// The whole payload, trailing zeros included.
    pub fn payload(&self) -> Vec<u8> {
        let mut out = Vec::new();
        match self {
            Self::Heartbeat(m) => {
                out.extend(m.custom_mode.to_le_bytes());
                out.extend([m.vehicle_type, m.autopilot, m.base_mode, m.system_status, m.mavlink_version]);
            }
            Self::SysStatus(m) => {
                m.sensors.iter().for_each(|flags| out.extend(flags.to_le_bytes()));
                out.extend(m.load.to_le_bytes());
                out.extend(m.voltage_battery.to_le_bytes());
                out.extend(m.current_battery.to_le_bytes());
                m.errors.iter().for_each(|count| out.extend(count.to_le_bytes()));
                out.extend(m.battery_remaining.to_le_bytes());
            }
            Self::AttitudeQuaternion(m) => {
                out.extend(m.time_boot_ms.to_le_bytes());
                floats(&mut out, &m.attitude);
                floats(&mut out, &m.angular_velocity);
                floats(&mut out, &m.display_offset);
            }
            Self::LocalPositionNed(m) => {
                out.extend(m.time_boot_ms.to_le_bytes());
                floats(&mut out, &m.position);
                floats(&mut out, &m.velocity);
            }
            Self::CommandLong(m) => {
                floats(&mut out, &m.params);
                out.extend(m.command.to_le_bytes());
                out.extend([m.target_system, m.target_component, m.confirmation]);
            }
            Self::CommandAck(m) => {
                out.extend(m.command.to_le_bytes());
                out.extend([m.result, m.progress]);
                out.extend(m.result_param2.to_le_bytes());
                out.extend([m.target_system, m.target_component]);
            }
            Self::SetPositionTargetLocalNed(m) => {
                out.extend(m.time_boot_ms.to_le_bytes());
                for vector in [&m.position, &m.velocity, &m.acceleration] {
                    floats(&mut out, vector);
                }
                floats(&mut out, &[m.yaw, m.yaw_rate]);
                out.extend(m.type_mask.to_le_bytes());
                out.extend([m.target_system, m.target_component, m.coordinate_frame]);
            }
            Self::Timesync(m) => {
                out.extend(m.tc1.to_le_bytes());
                out.extend(m.ts1.to_le_bytes());
            }
            Self::BatteryStatus(m) => {
                out.extend(m.current_consumed.to_le_bytes());
                out.extend(m.energy_consumed.to_le_bytes());
                out.extend(m.temperature.to_le_bytes());
                m.voltages.iter().for_each(|voltage| out.extend(voltage.to_le_bytes()));
                out.extend(m.current_battery.to_le_bytes());
                out.extend([m.id, m.battery_function, m.battery_type]);
                out.extend(m.battery_remaining.to_le_bytes());
            }
            Self::StatusText(m) => {
                out.push(m.severity);
                out.extend(m.text);
                out.extend(m.id.to_le_bytes());
                out.push(m.chunk);
            }
            Self::Odometry(m) => {
                out.extend(m.time_usec.to_le_bytes());
                floats(&mut out, &m.position);
                floats(&mut out, &m.attitude);
                floats(&mut out, &m.velocity);
                floats(&mut out, &m.angular_velocity);
                floats(&mut out, &m.pose_covariance);
                floats(&mut out, &m.velocity_covariance);
                out.extend([m.frame_id, m.child_frame_id, m.reset_counter, m.estimator_type]);
                out.extend(m.quality.to_le_bytes());
            }
        }
        out
    }

    /// Reads a payload of any length; `None` for a message not known here.
    pub fn from_payload(id: u32, payload: &[u8]) -> Option<Message> {
        specification(id)?;
        let mut f = Fields { payload, at: 0 };
        Some(match id {
            0 => Self::Heartbeat(Heartbeat {
                custom_mode: u32::from_le_bytes(f.take()),
                vehicle_type: f.byte(),
                autopilot: f.byte(),
                base_mode: f.byte(),
                system_status: f.byte(),
                mavlink_version: f.byte(),
            }),
            1 => Self::SysStatus(SysStatus {
                sensors: std::array::from_fn(|_| u32::from_le_bytes(f.take())),
                load: u16::from_le_bytes(f.take()),
                voltage_battery: u16::from_le_bytes(f.take()),
                current_battery: i16::from_le_bytes(f.take()),
                errors: std::array::from_fn(|_| u16::from_le_bytes(f.take())),
                battery_remaining: i8::from_le_bytes(f.take()),
            }),
            31 => Self::AttitudeQuaternion(AttitudeQuaternion {
                time_boot_ms: u32::from_le_bytes(f.take()),
                attitude: f.floats(),
                angular_velocity: f.floats(),
                display_offset: f.floats(),
            }),
            32 => Self::LocalPositionNed(LocalPositionNed {
                time_boot_ms: u32::from_le_bytes(f.take()),
                position: f.floats(),
                velocity: f.floats(),
            }),
            76 => Self::CommandLong(CommandLong {
                params: f.floats(),
                command: u16::from_le_bytes(f.take()),
                target_system: f.byte(),
                target_component: f.byte(),
                confirmation: f.byte(),
            }),
            77 => Self::CommandAck(CommandAck {
                command: u16::from_le_bytes(f.take()),
                result: f.byte(),
                progress: f.byte(),
                result_param2: i32::from_le_bytes(f.take()),
                target_system: f.byte(),
                target_component: f.byte(),
            }),
            84 => Self::SetPositionTargetLocalNed(SetPositionTargetLocalNed {
                time_boot_ms: u32::from_le_bytes(f.take()),
                position: f.floats(),
                velocity: f.floats(),
                acceleration: f.floats(),
                yaw: f32::from_le_bytes(f.take()),
                yaw_rate: f32::from_le_bytes(f.take()),
                type_mask: u16::from_le_bytes(f.take()),
                target_system: f.byte(),
                target_component: f.byte(),
                coordinate_frame: f.byte(),
            }),
            111 => Self::Timesync(Timesync { tc1: i64::from_le_bytes(f.take()), ts1: i64::from_le_bytes(f.take()) }),
            147 => Self::BatteryStatus(BatteryStatus {
                current_consumed: i32::from_le_bytes(f.take()),
                energy_consumed: i32::from_le_bytes(f.take()),
                temperature: i16::from_le_bytes(f.take()),
                voltages: std::array::from_fn(|_| u16::from_le_bytes(f.take())),
                current_battery: i16::from_le_bytes(f.take()),
                id: f.byte(),
                battery_function: f.byte(),
                battery_type: f.byte(),
                battery_remaining: i8::from_le_bytes(f.take()),
            }),
            253 => Self::StatusText(StatusText {
                severity: f.byte(),
                text: f.take(),
                id: u16::from_le_bytes(f.take()),
                chunk: f.byte(),
            }),
            331 => Self::Odometry(Box::new(Odometry {
                time_usec: u64::from_le_bytes(f.take()),
                position: f.floats(),
                attitude: f.floats(),
                velocity: f.floats(),
                angular_velocity: f.floats(),
                pose_covariance: f.floats(),
                velocity_covariance: f.floats(),
                frame_id: f.byte(),
                child_frame_id: f.byte(),
                reset_counter: f.byte(),
                estimator_type: f.byte(),
                quality: i8::from_le_bytes(f.take()),
            })),
            _ => return None,
        })
    }
}

fn floats(out: &mut Vec<u8>, values: &[f32]) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

/// Reads fields in order; past the end everything is zero.
struct Fields<'a> {
    payload: &'a [u8],
    at: usize,
}

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let bytes = std::array::from_fn(|i| self.payload.get(self.at + i).copied().unwrap_or(0));
        self.at += N;
        bytes
    }

    fn byte(&mut self) -> u8 {
        self.take::<1>()[0]
    }

    fn floats<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| f32::from_le_bytes(self.take()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn payloads_have_their_published_lengths() {
        let odometry = Odometry {
            time_usec: 1,
            position: [0.0; 3],
            attitude: [1.0, 0.0, 0.0, 0.0],
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            pose_covariance: [0.0; 21],
            velocity_covariance: [0.0; 21],
            frame_id: 20,
            child_frame_id: 12,
            reset_counter: 0,
            estimator_type: 7,
            quality: -1,
        };
        for message in [
            Message::Heartbeat(Heartbeat::default()),
            Message::CommandLong(CommandLong::default()),
            Message::CommandAck(CommandAck::default()),
            Message::SetPositionTargetLocalNed(SetPositionTargetLocalNed::default()),
            Message::Timesync(Timesync::default()),
            Message::SysStatus(SysStatus::default()),
            Message::BatteryStatus(BatteryStatus::default()),
            Message::AttitudeQuaternion(AttitudeQuaternion::default()),
            Message::LocalPositionNed(LocalPositionNed::default()),
            Message::StatusText(StatusText { severity: 6, text: [b'x'; 50], id: 0, chunk: 0 }),
            Message::Odometry(Box::new(odometry)),
        ] {
            let length = specification(message.id()).map(|specification| specification.length);
            assert_eq!(Some(message.payload().len()), length, "{message:?}");
        }
    }

    #[test]
    fn a_text_is_printable_whatever_was_sent() {
        let mut text = [0; 50];
        text[..8].copy_from_slice(b" a\x1b[2J\xffb");
        assert_eq!(StatusText { severity: 3, text, id: 0, chunk: 0 }.words(), "a [2J b");
        assert_eq!(StatusText { severity: 3, text: [0xC3; 50], id: 0, chunk: 0 }.words(), "");
    }

    #[test]
    fn a_cut_payload_means_zeros() {
        assert_eq!(
            Message::from_payload(77, &[0x90, 1]),
            Some(Message::CommandAck(CommandAck { command: 400, ..CommandAck::default() }))
        );
        assert_eq!(Message::from_payload(12345, &[]), None);
    }
}
