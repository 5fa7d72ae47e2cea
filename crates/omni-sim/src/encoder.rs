//! The angle encoder of the LiDAR's motor.

use crate::lidar::RotatingMount;
use std::f64::consts::TAU;

/// Numbers of the encoder.
#[derive(Debug, Clone, PartialEq)]
pub struct EncoderConfig {
    /// Samples a second (500).
    pub rate_hz: f64,
    /// Lines a turn (16384); 0 for an encoder without steps.
    pub lines: u32,
}

impl Default for EncoderConfig {
    fn default() -> Self {
        EncoderConfig { rate_hz: 500.0, lines: 16_384 }
    }
}

/// A sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderRecord {
    /// Time of the angle.
    pub stamp_ns: i64,
    /// Angle of the motor in `[0, 2 pi)`.
    pub angle_rad: f64,
}

/// What the encoder reads at `stamp_ns`: the nearest line.
pub fn encoder_sample(mount: &RotatingMount, config: &EncoderConfig, stamp_ns: i64) -> EncoderRecord {
    let angle_rad = mount.angle_rad(stamp_ns);
    let lines = f64::from(config.lines);
    EncoderRecord {
        stamp_ns,
        angle_rad: if config.lines == 0 {
            angle_rad
        } else {
            ((angle_rad / TAU * lines).round() / lines * TAU).rem_euclid(TAU)
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    #[test]
    fn reads_the_nearest_line() {
        let mount = RotatingMount::rotating(Isometry3::identity());
        let config = EncoderConfig { lines: 4, ..EncoderConfig::default() };
        // 0.3 s at half a turn a second: 54 degrees, nearest quarter turn 90 degrees.
        let read = encoder_sample(&mount, &config, 300_000_000).angle_rad;
        assert!((read - TAU / 4.0).abs() < 1e-12);
        // Just before a full turn the nearest line is line 0.
        assert_eq!(encoder_sample(&mount, &config, 1_999_000_000).angle_rad, 0.0);
    }
}
