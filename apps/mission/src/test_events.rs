//! What tests put into a stream.

use nalgebra::Vector3;
use omni_perception::{EncoderSample, ImuSample, Stamp};

use crate::stream::SensorEvent;

/// At rest, level.
pub(crate) fn imu(ms: i64) -> SensorEvent {
    SensorEvent::Imu(ImuSample {
        stamp: Stamp(ms * 1_000_000),
        angular_velocity_radps: Vector3::zeros(),
        specific_force_mps2: Vector3::new(0.0, 0.0, 9.81),
    })
}

/// The motor at an angle.
pub(crate) fn encoder(ms: i64, angle_rad: f64) -> SensorEvent {
    SensorEvent::Encoder(EncoderSample { stamp: Stamp(ms * 1_000_000), angle_rad })
}
