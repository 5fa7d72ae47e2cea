//! Whether a robot that is asked to move does move: by its odometry, for its answers say "done" either way.

use nalgebra::Vector3;

use crate::unitree::session::Velocity;
use crate::unitree::walker::WalkerState;

/// Slower is a robot that may as well stand: not counted as asked to move.
const ASKED: (f64, f64) = (0.1, 0.2);
/// So far from where it was, m and rad, it has moved.
const MOVED: (f64, f64) = (0.05, 0.1);

/// How long the robot has been asked to move from where it is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Progress {
    anchor: Option<(Vector3<f64>, f64)>,
    asked_ns: i64,
}

impl Progress {
    /// It was asked for a velocity for a time.
    pub fn ask(&mut self, velocity: &Velocity, period_ns: i64) {
        let speed_mps = velocity.forward_mps.hypot(velocity.left_mps);
        if speed_mps >= ASKED.0 || velocity.yaw_rate_radps.abs() >= ASKED.1 {
            self.asked_ns = self.asked_ns.saturating_add(period_ns);
        }
    }

    /// It is there now.
    pub fn see(&mut self, state: &WalkerState) {
        let here = (state.world_from_body.translation.vector, state.yaw_rad());
        let has_moved = self.anchor.is_none_or(|(position, yaw_rad)| {
            let turned = (here.1 - yaw_rad).sin().atan2((here.1 - yaw_rad).cos());
            (here.0 - position).xy().norm() > MOVED.0 || turned.abs() > MOVED.1
        });
        if has_moved {
            *self = Progress { anchor: Some(here), asked_ns: 0 };
        }
    }

    /// For how long it was asked to move and has not.
    pub fn ignored_ns(&self) -> i64 {
        self.asked_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unitree::message::SportModeState;

    #[test]
    fn only_motion_ends_the_wait() {
        let at = |x: f32| {
            let mut message = SportModeState { position: [x, 0.0, 0.3], ..SportModeState::default() };
            message.imu.quaternion = [1.0, 0.0, 0.0, 0.0];
            WalkerState::of(0, &message).expect("a pose")
        };
        let fast = Velocity { forward_mps: 0.5, ..Velocity::default() };
        let mut progress = Progress::default();
        for _ in 0..10 {
            progress.see(&at(0.0));
            progress.ask(&fast, 50);
            progress.ask(&Velocity { forward_mps: 0.05, ..Velocity::default() }, 50);
        }
        assert_eq!(progress.ignored_ns(), 500);
        progress.see(&at(0.04));
        assert_eq!(progress.ignored_ns(), 500);
        progress.see(&at(0.06));
        assert_eq!(progress.ignored_ns(), 0);
    }
}
