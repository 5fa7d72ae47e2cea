//! The ROS 2 messages that a recording is made of, as they lie in a bag: CDR behind a header of four bytes.
//!
//! Field order and types are those of the ROS 2 interfaces of the same names; the definitions go into the bag as schemas, so
//! that a reader without ROS can decode it. Sequences of bytes are borrowed from the payload: a scan is not copied to be read.

use omni_perception::Stamp;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A message type with what a bag must say about it.
pub trait RosMessage {
    /// Name, for example "sensor_msgs/msg/Imu".
    const TYPE: &'static str;
    /// Definition in the form "ros2msg", with the types it is made of.
    const DEFINITION: &'static str;
    /// Hash of the type's description (REP 2016), as bags of version 7 and later carry it.
    const HASH: &'static str;
}

/// Why a payload is no message of the expected type.
#[derive(Debug, Error)]
pub enum CdrError {
    /// The four bytes before the data name an encoding other than plain CDR.
    #[error("a payload begins with {found:02x?}; plain CDR begins with 00 00 or 00 01")]
    Encapsulation {
        /// The first bytes, as many as there are.
        found: Vec<u8>,
    },
    /// The data ends too soon or holds something that the type does not allow.
    #[error("a payload of {bytes} bytes is no {message}")]
    Malformed {
        /// The type that was expected.
        message: &'static str,
        /// Size of the payload.
        bytes: usize,
    },
}

/// Writes a message as payload (little endian) over what is in `payload`.
///
/// # Errors
/// Only if a sequence does not know its length, which none of the types here can cause.
pub fn encode<M: RosMessage + Serialize>(message: &M, payload: &mut Vec<u8>) -> Result<(), CdrError> {
    payload.clear();
    payload.extend_from_slice(&[0, 1, 0, 0]);
    cdr_encoding::to_writer::<M, byteorder::LittleEndian, _>(&mut *payload, message)
        .map_err(|_| CdrError::Malformed { message: M::TYPE, bytes: payload.len() })
}

/// Reads a message from a payload of either byte order.
///
/// # Errors
/// [`CdrError`] if the payload is of another encoding or too short.
pub fn decode<'a, M: RosMessage + Deserialize<'a>>(payload: &'a [u8]) -> Result<M, CdrError> {
    let (header, data) = payload.split_at(payload.len().min(4));
    let result = match header {
        [0, 0, _, _] => cdr_encoding::from_bytes::<M, byteorder::BigEndian>(data),
        [0, 1, _, _] => cdr_encoding::from_bytes::<M, byteorder::LittleEndian>(data),
        _ => return Err(CdrError::Encapsulation { found: header.to_vec() }),
    };
    result.map(|(message, _)| message).map_err(|_| CdrError::Malformed { message: M::TYPE, bytes: payload.len() })
}

/// `builtin_interfaces/Time`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds on top, below 10^9 in a sound message.
    pub nanosec: u32,
}

impl Time {
    /// The stamp in the form of ROS; `None` before 1901 and after 2038, which ROS cannot write.
    pub fn from_stamp(stamp: Stamp) -> Option<Time> {
        let sec = i32::try_from(stamp.0.div_euclid(1_000_000_000)).ok()?;
        Some(Time { sec, nanosec: stamp.0.rem_euclid(1_000_000_000) as u32 })
    }

    /// The stamp of ours.
    pub fn stamp(self) -> Stamp {
        Stamp(i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec))
    }
}

/// `std_msgs/Header`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Header {
    /// Time of the data.
    pub stamp: Time,
    /// Frame of the data.
    pub frame_id: String,
}

/// `geometry_msgs/Vector3` and `geometry_msgs/Point`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(missing_docs)] // x, y, z say it
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/Quaternion`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(missing_docs)] // x, y, z, w say it
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

/// `sensor_msgs/Imu`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Imu {
    /// Time and frame.
    pub header: Header,
    /// Not measured here: the covariance below begins with -1.
    pub orientation: Quaternion,
    /// Row by row.
    pub orientation_covariance: [f64; 9],
    /// rad/s.
    pub angular_velocity: Vector3,
    /// Row by row.
    pub angular_velocity_covariance: [f64; 9],
    /// Specific force, m/s^2.
    pub linear_acceleration: Vector3,
    /// Row by row.
    pub linear_acceleration_covariance: [f64; 9],
}

/// `sensor_msgs/JointState`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointState {
    /// Time and frame.
    pub header: Header,
    /// Joints.
    pub name: Vec<String>,
    /// Angle of each, rad.
    pub position: Vec<f64>,
    /// May be empty.
    pub velocity: Vec<f64>,
    /// May be empty.
    pub effort: Vec<f64>,
}

/// `sensor_msgs/PointField`: where in a point a number lies.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct PointField {
    /// Name.
    pub name: String,
    /// Bytes from the point's start.
    pub offset: u32,
    /// 1 to 8: i8, u8, i16, u16, i32, u32, f32, f64.
    pub datatype: u8,
    /// Numbers in a row; 1 for all that matters here.
    pub count: u32,
}

/// `sensor_msgs/PointCloud2`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PointCloud2<'a> {
    /// Time and frame.
    pub header: Header,
    /// Rows; 1 for a cloud without order.
    pub height: u32,
    /// Points in a row.
    pub width: u32,
    /// Layout of a point.
    pub fields: Vec<PointField>,
    /// Byte order of the points.
    pub is_bigendian: bool,
    /// Bytes of a point.
    pub point_step: u32,
    /// Bytes of a row.
    pub row_step: u32,
    /// The points.
    #[serde(borrow, serialize_with = "as_bytes")]
    pub data: &'a [u8],
    /// No point is NaN.
    pub is_dense: bool,
}

/// `sensor_msgs/CompressedImage`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct CompressedImage<'a> {
    /// Time and frame.
    pub header: Header,
    /// For example "jpeg" or "rgb8; png compressed rgb8".
    pub format: String,
    /// The file.
    #[serde(borrow, serialize_with = "as_bytes")]
    pub data: &'a [u8],
}

/// `geometry_msgs/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Pose {
    /// Position.
    pub position: Vector3,
    /// Rotation.
    pub orientation: Quaternion,
}

/// `geometry_msgs/PoseStamped`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Time and frame.
    pub header: Header,
    /// Pose of whatever the topic is about in that frame.
    pub pose: Pose,
}

/// `geometry_msgs/Transform`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Transform {
    /// Translation.
    pub translation: Vector3,
    /// Rotation.
    pub rotation: Quaternion,
}

/// `geometry_msgs/TransformStamped`: the pose of the child in the header's frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Time and parent.
    pub header: Header,
    /// Child.
    pub child_frame_id: String,
    /// Parent from child.
    pub transform: Transform,
}

/// `tf2_msgs/TFMessage`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TfMessage {
    /// The transforms.
    pub transforms: Vec<TransformStamped>,
}

/// A sequence of bytes in one go instead of one by one.
fn as_bytes<S: serde::Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}

/// Definitions of parts, as they follow the message's own in a schema.
macro_rules! part {
    ($name:literal, $fields:literal) => {
        concat!(
            "================================================================================\n",
            "MSG: ",
            $name,
            "\n",
            $fields
        )
    };
}
macro_rules! header {
    () => {
        concat!(
            part!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
            part!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n")
        )
    };
}
macro_rules! vector3 {
    () => {
        part!("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n")
    };
}
macro_rules! quaternion {
    () => {
        part!("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n")
    };
}
macro_rules! message {
    ($type:ty, $name:literal, $hash:literal, $($definition:expr),+) => {
        impl RosMessage for $type {
            const TYPE: &'static str = $name;
            const DEFINITION: &'static str = concat!($($definition),+);
            const HASH: &'static str = concat!("RIHS01_", $hash);
        }
    };
}

message!(
    Imu,
    "sensor_msgs/msg/Imu",
    "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n",
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n",
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    header!(),
    quaternion!(),
    vector3!()
);
message!(
    JointState,
    "sensor_msgs/msg/JointState",
    "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    header!()
);
message!(
    PointCloud2<'_>,
    "sensor_msgs/msg/PointCloud2",
    "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n",
    "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
    header!(),
    // With its constants: kiss-icp asks the type that it makes from the schema for them.
    part!(
        "sensor_msgs/PointField",
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n\
         uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"
    )
);
message!(
    CompressedImage<'_>,
    "sensor_msgs/msg/CompressedImage",
    "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "std_msgs/Header header\nstring format\nuint8[] data\n",
    header!()
);
message!(
    PoseStamped,
    "geometry_msgs/msg/PoseStamped",
    "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    header!(),
    part!("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    part!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    quaternion!()
);
message!(
    TfMessage,
    "tf2_msgs/msg/TFMessage",
    "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "geometry_msgs/TransformStamped[] transforms\n",
    part!(
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
    header!(),
    part!("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"),
    vector3!(),
    quaternion!()
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_by_hand() {
        // stamp 1 s + 2 ns; frame "ab": length 3 with its zero; padding to 4; one name; padding; one position.
        let header = Header { stamp: Time { sec: 1, nanosec: 2 }, frame_id: "ab".into() };
        let state = JointState { header, name: vec!["m".into()], position: vec![0.5], ..JointState::default() };
        let mut payload = Vec::new();
        encode(&state, &mut payload).unwrap();
        let mut expected = vec![0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, b'a', b'b', 0, 0];
        expected.extend([1, 0, 0, 0, 2, 0, 0, 0, b'm', 0, 0, 0]); // at 28 of the data: the count of positions
        expected.extend([1, 0, 0, 0]);
        expected.extend(0.5_f64.to_le_bytes());
        expected.extend([0; 8]); // no velocity, no effort
        assert_eq!(payload, expected);
        assert_eq!(decode::<JointState>(&payload).unwrap(), state);
    }

    #[test]
    fn the_schema_of_points_names_the_types_of_numbers() {
        assert!(PointCloud2::DEFINITION.contains("MSG: sensor_msgs/PointField\nuint8 INT8=1\n"));
        assert!(PointCloud2::DEFINITION.contains("uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\n"));
    }

    #[test]
    fn bytes_are_borrowed_and_bad_payloads_are_refused() {
        let cloud = PointCloud2 { data: &[1, 2, 3], width: 1, is_dense: true, ..PointCloud2::default() };
        let mut payload = Vec::new();
        encode(&cloud, &mut payload).unwrap();
        assert_eq!(decode::<PointCloud2>(&payload).unwrap(), cloud);
        for cut in 0..payload.len() {
            assert!(decode::<PointCloud2>(&payload[..cut]).is_err(), "cut at {cut}");
        }
        payload[1] = 7; // parameter list
        assert!(matches!(decode::<PointCloud2>(&payload), Err(CdrError::Encapsulation { .. })));
    }

    #[test]
    fn stamps_before_1970_keep_their_nanoseconds() {
        for ns in [0, 1, -1, 1_700_000_000_123_456_789, -1_500_000_000] {
            assert_eq!(Time::from_stamp(Stamp(ns)).unwrap().stamp(), Stamp(ns));
        }
        assert_eq!(Time::from_stamp(Stamp(i64::MAX)), None);
    }
}
