//! What the robot says of itself, checked: a pose that is one, a velocity that is a number, a mode with a name.

use std::fmt;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use crate::unitree::message::SportModeState;

/// The mode of the sport service, as in [`SportModeState::mode`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SportMode(pub u8);

impl SportMode {
    /// Lying down.
    pub const LYING: SportMode = SportMode(5);
    /// Joints locked, as `StandUp` leaves them.
    pub const LOCKED: SportMode = SportMode(6);
    /// All joints soft.
    pub const DAMPING: SportMode = SportMode(7);
    /// Sitting.
    pub const SITTING: SportMode = SportMode(10);

    /// Whether it is off its legs, or lets itself down.
    pub fn is_down(self) -> bool {
        [Self::LYING, Self::DAMPING, Self::SITTING].contains(&self)
    }
}

impl fmt::Display for SportMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.0 {
            0 => "standing",
            1 => "balance stand",
            2 => "pose",
            3 => "locomotion",
            5 => "lying",
            6 => "joints locked",
            7 => "damping",
            8 => "recovery stand",
            10 => "sitting",
            mode => return write!(f, "mode {mode}"),
        })
    }
}

/// A state of the robot. Its world is that of its own odometry: level, without north.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WalkerState {
    /// When it arrived, on our clock.
    pub stamp_ns: i64,
    /// The robot's own stamp, on its clock; `None` if it keeps none.
    pub robot_ns: Option<i64>,
    /// Where it says it is, FLU body.
    pub world_from_body: Isometry3<f64>,
    /// Velocity.
    pub velocity_in_world_mps: Vector3<f64>,
    /// Turning, counter-clockwise from above.
    pub yaw_rate_radps: f64,
    /// Height of the body over the ground.
    pub body_height_m: f64,
    /// What it does.
    pub mode: SportMode,
}

/// A quaternion this far from length 1 is none.
const UNIT_TOL: f64 = 0.1;

impl WalkerState {
    /// The state in a message that arrived at `stamp_ns`; `None` if a number is not finite or the attitude is no rotation.
    pub fn of(stamp_ns: i64, message: &SportModeState) -> Option<WalkerState> {
        let [w, x, y, z] = message.imu.quaternion.map(f64::from);
        let attitude = Quaternion::new(w, x, y, z);
        let position = Vector3::from(message.position.map(f64::from));
        let velocity_in_world_mps = Vector3::from(message.velocity.map(f64::from));
        let numbers = [f64::from(message.yaw_speed_radps), f64::from(message.body_height_m), attitude.norm()];
        let finite =
            position.iter().chain(velocity_in_world_mps.iter()).chain(&numbers).all(|number| number.is_finite());
        if !finite || (attitude.norm() - 1.0).abs() > UNIT_TOL {
            return None;
        }
        let stamp = (message.stamp_s, message.stamp_ns);
        Some(WalkerState {
            stamp_ns,
            robot_ns: (stamp != (0, 0)).then(|| i64::from(stamp.0) * 1_000_000_000 + i64::from(stamp.1)),
            world_from_body: Isometry3::from_parts(position.into(), UnitQuaternion::from_quaternion(attitude)),
            velocity_in_world_mps,
            yaw_rate_radps: numbers[0],
            body_height_m: numbers[1],
            mode: SportMode(message.mode),
        })
    }

    /// Angle between the body's up and the world's.
    pub fn tilt_rad(&self) -> f64 {
        (self.world_from_body.rotation * Vector3::z()).angle(&Vector3::z())
    }

    /// Heading.
    pub fn yaw_rad(&self) -> f64 {
        self.world_from_body.rotation.euler_angles().2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing() -> SportModeState {
        let mut message = SportModeState { position: [1.0, 2.0, 0.3], body_height_m: 0.3, ..SportModeState::default() };
        message.imu.quaternion = [0.0, 0.0, 0.0, 1.0];
        message
    }

    #[test]
    fn w_comes_first() {
        let state = WalkerState::of(5, &standing()).expect("a pose");
        assert!((state.yaw_rad().abs() - std::f64::consts::PI).abs() < 1e-6 && state.tilt_rad() < 1e-6);
        let mut on_its_back = standing();
        on_its_back.imu.quaternion = [0.0, 1.0, 0.0, 0.0];
        assert!(WalkerState::of(5, &on_its_back).expect("a pose").tilt_rad() > 3.0);
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        let spoiled = |spoil: fn(&mut SportModeState)| {
            let mut message = standing();
            spoil(&mut message);
            WalkerState::of(5, &message)
        };
        assert_eq!(spoiled(|message| message.position[1] = f32::NAN), None);
        assert_eq!(spoiled(|message| message.velocity[2] = f32::INFINITY), None);
        assert_eq!(spoiled(|message| message.imu.quaternion = [0.0; 4]), None);
        assert_eq!(spoiled(|message| message.body_height_m = f32::NAN), None);
        assert_eq!(SportMode(7).to_string() + &SportMode(99).to_string(), "dampingmode 99");
    }
}
