//! The DDS types of the sport service: `unitree_api::msg::dds_::Request_`, `Response_` and `unitree_go::msg::dds_::SportModeState_`.

use crate::unitree::cdr::{CdrError, CdrReader, CdrWriter};

/// Topic of requests.
pub const REQUEST_TOPIC: &str = "rt/api/sport/request";
/// Topic of responses.
pub const RESPONSE_TOPIC: &str = "rt/api/sport/response";
/// Topic of states.
pub const STATE_TOPIC: &str = "rt/sportmodestate";
/// DDS name of [`Request`].
pub const REQUEST_TYPE: &str = "unitree_api::msg::dds_::Request_";
/// DDS name of [`Response`].
pub const RESPONSE_TYPE: &str = "unitree_api::msg::dds_::Response_";
/// DDS name of [`SportModeState`].
pub const STATE_TYPE: &str = "unitree_go::msg::dds_::SportModeState_";

/// A call to the robot.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Request {
    /// Unique number of the call.
    pub id: i64,
    /// Which function.
    pub api_id: i64,
    /// 0 unless a lease is held.
    pub lease_id: i64,
    /// Priority.
    pub priority: i32,
    /// No response wanted.
    pub no_reply: bool,
    /// JSON text.
    pub parameter: String,
    /// Further data.
    pub binary: Vec<u8>,
}

/// The robot's answer.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Response {
    /// Number of the call answered.
    pub id: i64,
    /// Which function.
    pub api_id: i64,
    /// 0: done; see [`crate::unitree::sport::Outcome`].
    pub code: i32,
    /// JSON text.
    pub data: String,
    /// Further data.
    pub binary: Vec<u8>,
}

/// The state of the walking robot, published many times a second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SportModeState {
    /// Seconds of the stamp.
    pub stamp_s: i32,
    /// Nanoseconds of the stamp.
    pub stamp_ns: u32,
    /// Error code.
    pub error_code: u32,
    /// The robot's own IMU.
    pub imu: ImuState,
    /// 0 idle, 1 balance stand, 3 locomotion, 5 lying, 6 joints locked, 7 damping, 8 recovery stand, 10 sitting.
    pub mode: u8,
    /// Progress of a movement.
    pub progress: f32,
    /// 0 idle, 1 trot, 2 run, 3 climb, 4 down, 9 adjust.
    pub gait_type: u8,
    /// Foot lift, m.
    pub foot_raise_height_m: f32,
    /// Position in the odometry frame, m.
    pub position: [f32; 3],
    /// Height of the body, m.
    pub body_height_m: f32,
    /// Velocity, m/s.
    pub velocity: [f32; 3],
    /// Turning speed.
    pub yaw_speed_radps: f32,
    /// Ranges to obstacles.
    pub range_obstacle: [f32; 4],
    /// Foot forces, raw.
    pub foot_force: [i16; 4],
    /// Feet (x, y, z) in the body frame.
    pub foot_position_body: [f32; 12],
    /// Foot speeds in the body frame.
    pub foot_speed_body: [f32; 12],
}

/// The IMU inside the robot.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuState {
    /// Attitude (w, x, y, z).
    pub quaternion: [f32; 4],
    /// Angular velocity, rad/s.
    pub gyroscope: [f32; 3],
    /// Specific force, m/s^2.
    pub accelerometer: [f32; 3],
    /// Roll, pitch, yaw.
    pub rpy: [f32; 3],
    /// Degrees Celsius.
    pub temperature: u8,
}

impl Request {
    /// The DDS payload.
    pub fn to_cdr(&self) -> Vec<u8> {
        let mut out = CdrWriter::new();
        out.number(self.id.to_le_bytes());
        out.number(self.api_id.to_le_bytes());
        out.number(self.lease_id.to_le_bytes());
        out.number(self.priority.to_le_bytes());
        out.bool(self.no_reply);
        out.string(&self.parameter);
        out.bytes(&self.binary);
        out.finish()
    }

    /// Reads a DDS payload.
    ///
    /// # Errors
    /// See [`CdrError`].
    pub fn from_cdr(payload: &[u8]) -> Result<Self, CdrError> {
        let mut input = CdrReader::new(payload)?;
        Ok(Self {
            id: i64::from_le_bytes(input.number()?),
            api_id: i64::from_le_bytes(input.number()?),
            lease_id: i64::from_le_bytes(input.number()?),
            priority: i32::from_le_bytes(input.number()?),
            no_reply: input.bool()?,
            parameter: input.string()?,
            binary: input.bytes()?.to_vec(),
        })
    }
}

impl Response {
    /// The DDS payload.
    pub fn to_cdr(&self) -> Vec<u8> {
        let mut out = CdrWriter::new();
        out.number(self.id.to_le_bytes());
        out.number(self.api_id.to_le_bytes());
        out.number(self.code.to_le_bytes());
        out.string(&self.data);
        out.bytes(&self.binary);
        out.finish()
    }

    /// Reads a DDS payload.
    ///
    /// # Errors
    /// See [`CdrError`].
    pub fn from_cdr(payload: &[u8]) -> Result<Self, CdrError> {
        let mut input = CdrReader::new(payload)?;
        Ok(Self {
            id: i64::from_le_bytes(input.number()?),
            api_id: i64::from_le_bytes(input.number()?),
            code: i32::from_le_bytes(input.number()?),
            data: input.string()?,
            binary: input.bytes()?.to_vec(),
        })
    }
}

impl SportModeState {
    /// The DDS payload, in the layout of the ROS 2 messages (without the path points that the SDK appends).
    pub fn to_cdr(&self) -> Vec<u8> {
        let mut out = CdrWriter::new();
        let floats =
            |out: &mut CdrWriter, values: &[f32]| values.iter().for_each(|value| out.number(value.to_le_bytes()));
        out.number(self.stamp_s.to_le_bytes());
        out.number(self.stamp_ns.to_le_bytes());
        out.number(self.error_code.to_le_bytes());
        floats(&mut out, &self.imu.quaternion);
        floats(&mut out, &self.imu.gyroscope);
        floats(&mut out, &self.imu.accelerometer);
        floats(&mut out, &self.imu.rpy);
        out.number([self.imu.temperature]);
        out.number([self.mode]);
        floats(&mut out, &[self.progress]);
        out.number([self.gait_type]);
        floats(&mut out, &[self.foot_raise_height_m]);
        floats(&mut out, &self.position);
        floats(&mut out, &[self.body_height_m]);
        floats(&mut out, &self.velocity);
        floats(&mut out, &[self.yaw_speed_radps]);
        floats(&mut out, &self.range_obstacle);
        self.foot_force.iter().for_each(|force| out.number(force.to_le_bytes()));
        floats(&mut out, &self.foot_position_body);
        floats(&mut out, &self.foot_speed_body);
        out.finish()
    }

    /// Reads a DDS payload; path points at its end (SDK layout) are left unread.
    ///
    /// # Errors
    /// See [`CdrError`].
    pub fn from_cdr(payload: &[u8]) -> Result<Self, CdrError> {
        let mut input = CdrReader::new(payload)?;
        let stamp_s = i32::from_le_bytes(input.number()?);
        let stamp_ns = u32::from_le_bytes(input.number()?);
        let error_code = u32::from_le_bytes(input.number()?);
        let imu = ImuState {
            quaternion: input.floats()?,
            gyroscope: input.floats()?,
            accelerometer: input.floats()?,
            rpy: input.floats()?,
            temperature: input.number::<1>()?[0],
        };
        Ok(Self {
            stamp_s,
            stamp_ns,
            error_code,
            imu,
            mode: input.number::<1>()?[0],
            progress: input.floats::<1>()?[0],
            gait_type: input.number::<1>()?[0],
            foot_raise_height_m: input.floats::<1>()?[0],
            position: input.floats()?,
            body_height_m: input.floats::<1>()?[0],
            velocity: input.floats()?,
            yaw_speed_radps: input.floats::<1>()?[0],
            range_obstacle: input.floats()?,
            foot_force: {
                let mut force = [0; 4];
                for value in &mut force {
                    *value = i16::from_le_bytes(input.number()?);
                }
                force
            },
            foot_position_body: input.floats()?,
            foot_speed_body: input.floats()?,
        })
    }
}
