//! The two ends of a mission: one sensor stream in, one command sink out.
//!
//! A simulator, a recorded bag and a live robot all look the same from here. The stream carries what a robot can know
//! and nothing else: no true pose, no instance id, no room name. [`Odometry`](SensorEvent::Odometry) is the output type
//! of the LiDAR-inertial odometry; whoever runs that filter puts its estimates into the stream.

use nalgebra::{Point3, Vector3};
use omni_perception::{EncoderSample, ImuSample, MaskedPanorama, OdometryEstimate, RawScan, Stamp};

/// One thing that the sensors said, in time order of [`SensorEvent::stamp`].
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // odometry is small beside a scan's points, and boxing 200 a second costs more
pub enum SensorEvent {
    /// Specific force and angular rate in the IMU frame (200 Hz).
    Imu(ImuSample),
    /// Angle of the LiDAR's motor (500 Hz).
    Encoder(EncoderSample),
    /// Where the odometry believes the robot is (200 Hz).
    Odometry(OdometryEstimate),
    /// One revolution of the LiDAR, stamped at its start, delivered after its end.
    Scan(RawScan),
    /// A panoramic image with the masks that the segmenter found in it.
    Panorama(MaskedPanorama),
    /// How full the battery is.
    Battery(BatteryState),
}

impl SensorEvent {
    /// Time at which the event is delivered: for a scan, the time of its last point.
    pub fn stamp(&self) -> Stamp {
        match self {
            SensorEvent::Imu(sample) => sample.stamp,
            SensorEvent::Encoder(sample) => sample.stamp,
            SensorEvent::Odometry(estimate) => estimate.stamp,
            SensorEvent::Scan(scan) => {
                let last = scan.points.iter().map(|p| p.offset_ns).max().unwrap_or(0);
                Stamp(scan.start.0 + i64::from(last))
            }
            SensorEvent::Panorama(panorama) => panorama.stamp,
            SensorEvent::Battery(battery) => battery.stamp,
        }
    }
}

/// What the battery's gauge says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatteryState {
    /// When.
    pub stamp: Stamp,
    /// 1 is full, 0 is empty.
    pub charge: f64,
}

/// What the robot shall do until the next command (50 Hz). A robot that hears nothing for 0.2 s stops by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Ground: velocity in the body frame, x forward, y left.
    Velocity {
        /// Forward speed.
        forward_mps: f64,
        /// Speed to the left.
        left_mps: f64,
        /// Turning rate, positive to the left.
        yaw_rate_radps: f64,
    },
    /// Air: a point of a trajectory, in the frame of the odometry.
    Flight(FlightSetPoint),
}

/// A set-point that a flight controller follows: position with its derivatives as feed-forward, and heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightSetPoint {
    /// Position of the body origin.
    pub position_in_world: Point3<f64>,
    /// Velocity feed-forward.
    pub velocity_in_world_mps: Vector3<f64>,
    /// Acceleration feed-forward.
    pub acceleration_in_world_mps2: Vector3<f64>,
    /// Jerk feed-forward.
    pub jerk_in_world_mps3: Vector3<f64>,
    /// Heading about world z, counter-clockwise from x.
    pub yaw_rad: f64,
    /// Its rate.
    pub yaw_rate_radps: f64,
    /// Rotors may stand still: on the ground before take-off or after landing.
    pub is_armed: bool,
}
