//! A recorded motion: a chain of pieces, each with constant jerk.
//!
//! Position is a cubic in time, its acceleration therefore linear and, because every piece starts with the value,
//! velocity and acceleration with which the one before it ended, continuous: the whole is twice differentiable, and
//! velocity and acceleration are its exact derivatives, not estimates. Rotation is either three Euler angles (ground
//! robots: yaw, pitch, roll, each a cubic) or `R(s) = R_0 Exp(phi(s))` with a cubic rotation vector (flying robots).

use crate::motion::{KinematicState, Motion};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::collections::VecDeque;

/// A number with its first and second derivative.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Jet {
    /// Value.
    pub value: f64,
    /// First derivative.
    pub rate: f64,
    /// Second derivative.
    pub acceleration: f64,
}

impl Jet {
    /// A constant.
    pub fn constant(value: f64) -> Jet {
        Jet { value, ..Jet::default() }
    }
}

/// A number that moves with constant jerk.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cubic {
    /// At the start of the piece.
    pub start: Jet,
    /// Constant third derivative.
    pub jerk: f64,
}

impl Cubic {
    /// The piece that starts at `start` and reaches the second derivative `acceleration` after `duration_s`.
    pub fn reaching(start: Jet, acceleration: f64, duration_s: f64) -> Cubic {
        Cubic { start, jerk: (acceleration - start.acceleration) / duration_s }
    }

    /// Value and derivatives `s` seconds after the start.
    #[inline]
    pub fn at(&self, s: f64) -> Jet {
        let Jet { value, rate, acceleration } = self.start;
        Jet {
            value: value + s * (rate + s * (acceleration / 2.0 + s * self.jerk / 6.0)),
            rate: rate + s * (acceleration + s * self.jerk / 2.0),
            acceleration: acceleration + s * self.jerk,
        }
    }
}

/// How the body turns within a piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Turn {
    /// `R = Rz(yaw) Ry(pitch) Rx(roll)`, in this order.
    Euler([Cubic; 3]),
    /// `R(s) = R_0 Exp(phi(s))`, `phi(s) = w s + a s^2/2 + j s^3/6`.
    Exponential {
        /// Rotation at the start.
        start: UnitQuaternion<f64>,
        /// Rotation vector from there, in the body frame; its value at the start is zero.
        vector: [Cubic; 3],
    },
}

/// A shake on top of the motion: a circle of radius `amplitude_m` in the world's horizontal plane, half as far along z,
/// run through at the angle `phase` (rotor imbalance).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vibration {
    /// Radius of the circle.
    pub amplitude_m: f64,
    /// Angle on it.
    pub phase: Cubic,
}

/// A piece of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Start.
    pub start_ns: i64,
    /// Length in time, positive.
    pub duration_ns: i64,
    /// Position of the body's origin in the world: x, y, z.
    pub position: [Cubic; 3],
    /// Rotation.
    pub turn: Turn,
    /// Shake on top.
    pub vibration: Option<Vibration>,
}

impl Piece {
    /// The piece that starts at `start_ns` with a state and ends at `end_ns` with these accelerations: of the origin in the
    /// world (m/s^2), and angular in the body (rad/s^2). `end_ns` must be later than `start_ns`.
    pub fn reaching(
        state: &KinematicState,
        start_ns: i64,
        end_ns: i64,
        acceleration: &Vector3<f64>,
        turn: &Vector3<f64>,
    ) -> Piece {
        let h = (end_ns - start_ns) as f64 * 1e-9;
        let position = [0, 1, 2].map(|k| {
            let start = Jet {
                value: state.world_from_body.translation.vector[k],
                rate: state.velocity_world[k],
                acceleration: state.acceleration_world[k],
            };
            Cubic::reaching(start, acceleration[k], h)
        });
        // The body's angular acceleration is phi'' - phi x phi'' / 2 + ...: solve for phi'' at the end.
        let phi = state.angular_velocity_body * h;
        let turn = turn + phi.cross(turn) / 2.0;
        let vector = [0, 1, 2].map(|k| {
            let start = Jet {
                value: 0.0,
                rate: state.angular_velocity_body[k],
                acceleration: state.angular_acceleration_body[k],
            };
            Cubic::reaching(start, turn[k], h)
        });
        Piece {
            start_ns,
            duration_ns: end_ns - start_ns,
            position,
            turn: Turn::Exponential { start: state.world_from_body.rotation, vector },
            vibration: None,
        }
    }

    /// State at `stamp_ns`, which is held to the piece's own time.
    pub fn at(&self, stamp_ns: i64) -> KinematicState {
        let inside_ns = stamp_ns.clamp(self.start_ns, self.start_ns + self.duration_ns) - self.start_ns;
        let s = inside_ns as f64 * 1e-9;
        let mut axes = self.position.map(|c| c.at(s));
        if let Some(vibration) = &self.vibration {
            vibration.shake(s, &mut axes);
        }
        let vector = |f: fn(&Jet) -> f64| Vector3::new(f(&axes[0]), f(&axes[1]), f(&axes[2]));
        let (rotation, rate, acceleration) = match &self.turn {
            Turn::Euler(angles) => euler_turn(angles.map(|c| c.at(s))),
            Turn::Exponential { start, vector } => exponential_turn(start, vector.map(|c| c.at(s))),
        };
        KinematicState {
            stamp_ns,
            world_from_body: Isometry3::from_parts(Translation3::from(vector(|j| j.value)), rotation),
            velocity_world: vector(|j| j.rate),
            acceleration_world: vector(|j| j.acceleration),
            angular_velocity_body: rate,
            angular_acceleration_body: acceleration,
        }
    }
}

impl Vibration {
    fn shake(&self, s: f64, axes: &mut [Jet; 3]) {
        let Jet { value, rate, acceleration } = self.phase.at(s);
        let (sin, cos) = value.sin_cos();
        let a = self.amplitude_m;
        let cosine =
            Jet { value: a * cos, rate: -a * sin * rate, acceleration: -a * (cos * rate * rate + sin * acceleration) };
        let sine =
            Jet { value: a * sin, rate: a * cos * rate, acceleration: a * (cos * acceleration - sin * rate * rate) };
        for (axis, jet, scale) in [(0, cosine, 1.0), (1, sine, 1.0), (2, cosine, 0.5)] {
            axes[axis].value += scale * jet.value;
            axes[axis].rate += scale * jet.rate;
            axes[axis].acceleration += scale * jet.acceleration;
        }
    }
}

/// Rotation, body rate and its derivative of yaw, pitch and roll.
fn euler_turn([yaw, pitch, roll]: [Jet; 3]) -> (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>) {
    let rotation = UnitQuaternion::from_euler_angles(roll.value, pitch.value, yaw.value);
    let (sr, cr) = roll.value.sin_cos();
    let (sp, cp) = pitch.value.sin_cos();
    let (dr, dp, dy) = (roll.rate, pitch.rate, yaw.rate);
    let (ddr, ddp, ddy) = (roll.acceleration, pitch.acceleration, yaw.acceleration);
    // Standard Euler-rate matrix of the z-y-x order, and its time derivative.
    let rate = Vector3::new(dr - dy * sp, dp * cr + dy * cp * sr, -dp * sr + dy * cp * cr);
    let acceleration = Vector3::new(
        ddr - ddy * sp - dy * dp * cp,
        ddp * cr - dp * dr * sr + ddy * cp * sr - dy * dp * sp * sr + dy * dr * cp * cr,
        -ddp * sr - dp * dr * cr + ddy * cp * cr - dy * dp * sp * cr - dy * dr * cp * sr,
    );
    (rotation, rate, acceleration)
}

/// Rotation, body rate and its derivative of `start * Exp(phi)`: with `c = phi x phi'`,
/// `w = phi' - A c + B phi x c`, `A = (1 - cos t)/t^2`, `B = (t - sin t)/t^3`, `t = |phi|`.
fn exponential_turn(
    start: &UnitQuaternion<f64>,
    vector: [Jet; 3],
) -> (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>) {
    let phi = Vector3::from(vector.map(|j| j.value));
    let d_phi = Vector3::from(vector.map(|j| j.rate));
    let dd_phi = Vector3::from(vector.map(|j| j.acceleration));
    let t2 = phi.norm_squared();
    // A, B and their derivatives by t, the latter divided by t.
    let (a, b, a_t, b_t) = if t2 < 2.5e-3 {
        (
            0.5 - t2 / 24.0 + t2 * t2 / 720.0,
            1.0 / 6.0 - t2 / 120.0 + t2 * t2 / 5040.0,
            -1.0 / 12.0 + t2 / 180.0 - t2 * t2 / 6720.0,
            -1.0 / 60.0 + t2 / 1260.0,
        )
    } else {
        let t = t2.sqrt();
        let a = (1.0 - t.cos()) / t2;
        let b = (t - t.sin()) / (t2 * t);
        (a, b, (t.sin() / t - 2.0 * a) / t2, (a - 3.0 * b) / t2)
    };
    let growth = phi.dot(&d_phi); // t t'
    let c = phi.cross(&d_phi);
    let d_c = phi.cross(&dd_phi);
    let rate = d_phi - c * a + phi.cross(&c) * b;
    let acceleration = dd_phi - c * (a_t * growth) - d_c * a
        + phi.cross(&c) * (b_t * growth)
        + (d_phi.cross(&c) + phi.cross(&d_c)) * b;
    (start * UnitQuaternion::from_scaled_axis(phi), rate, acceleration)
}

/// Pieces in time order without gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionTrack {
    rest: KinematicState,
    pieces: VecDeque<Piece>,
}

impl MotionTrack {
    /// A track without pieces: known at one moment only.
    pub fn new(start: KinematicState) -> MotionTrack {
        MotionTrack { rest: start, pieces: VecDeque::new() }
    }

    /// Appends a piece. It must start where and when the track ends; the caller's integrator sees to that.
    pub(crate) fn push(&mut self, piece: Piece) {
        debug_assert_eq!(piece.start_ns, self.end_ns());
        self.pieces.push_back(piece);
    }

    /// Forgets pieces that end at or before `stamp_ns`; the last piece always stays.
    pub fn forget_before(&mut self, stamp_ns: i64) {
        while self.pieces.len() > 1 {
            let first = &self.pieces[0];
            if first.start_ns + first.duration_ns > stamp_ns {
                break;
            }
            self.pieces.pop_front();
        }
    }

    /// Last stamp of the track.
    pub fn end_ns(&self) -> i64 {
        self.pieces.back().map_or(self.rest.stamp_ns, |p| p.start_ns + p.duration_ns)
    }

    /// State at the end.
    pub fn end(&self) -> KinematicState {
        self.at(self.end_ns())
    }

    /// The pieces, in time order.
    pub fn pieces(&self) -> impl Iterator<Item = &Piece> {
        self.pieces.iter()
    }
}

impl Motion for MotionTrack {
    fn at(&self, stamp_ns: i64) -> KinematicState {
        let next = self.pieces.partition_point(|p| p.start_ns <= stamp_ns);
        match self.pieces.get(next.saturating_sub(1)) {
            Some(piece) => piece.at(stamp_ns),
            None => KinematicState { stamp_ns, ..self.rest },
        }
    }

    fn span_ns(&self) -> (i64, i64) {
        let start = self.pieces.front().map_or(self.rest.stamp_ns, |p| p.start_ns);
        (start, self.end_ns())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central differences of the pose against the stated derivatives.
    fn check_derivatives(piece: &Piece) {
        const H_NS: i64 = 20_000;
        const H: f64 = H_NS as f64 * 1e-9;
        let middle = piece.start_ns + piece.duration_ns / 2;
        let (before, now, after) = (piece.at(middle - H_NS), piece.at(middle), piece.at(middle + H_NS));
        let position = |s: &KinematicState| s.world_from_body.translation.vector;
        let velocity = (position(&after) - position(&before)) / (2.0 * H);
        assert!((velocity - now.velocity_world).norm() < 1e-6, "velocity");
        let acceleration = (after.velocity_world - before.velocity_world) / (2.0 * H);
        assert!((acceleration - now.acceleration_world).norm() < 1e-5, "acceleration");
        let rotation = |s: &KinematicState| s.world_from_body.rotation;
        let rate = (rotation(&before).inverse() * rotation(&after)).scaled_axis() / (2.0 * H);
        assert!((rate - now.angular_velocity_body).norm() < 1e-6, "rate");
        let turn = (after.angular_velocity_body - before.angular_velocity_body) / (2.0 * H);
        assert!((turn - now.angular_acceleration_body).norm() < 1e-5, "angular acceleration");
    }

    fn cubic(value: f64, rate: f64, acceleration: f64, jerk: f64) -> Cubic {
        let start = Jet { value, rate, acceleration };
        Cubic { start, jerk }
    }

    #[test]
    fn stated_derivatives_are_those_of_the_pose() {
        let position = [cubic(1.0, 0.5, -0.3, 2.0), cubic(-2.0, 0.1, 0.7, -1.0), cubic(0.3, -0.2, 0.1, 0.4)];
        let angles = [cubic(3.0, 1.5, -2.0, 3.0), cubic(0.4, -0.7, 1.1, 2.0), cubic(-0.5, 0.9, -1.3, 1.0)];
        let from_zero = angles.map(|mut c| {
            c.start.value = 0.0;
            c
        });
        let start = UnitQuaternion::from_euler_angles(0.3, -0.2, 2.0);
        for duration_ns in [2_000_000, 1_000_000_000] {
            let turns = [Turn::Euler(angles), Turn::Exponential { start, vector: from_zero }];
            for turn in turns {
                let vibration = Some(Vibration { amplitude_m: 1e-3, phase: cubic(0.2, 30.0, 5.0, 1.0) });
                check_derivatives(&Piece { start_ns: 5_000_000_000, duration_ns, position, turn, vibration });
            }
        }
    }

    #[test]
    fn a_cubic_by_hand() {
        // x = 1 + 2 s + 3 s^2/2 + 6 s^3/6 at s = 2: 1 + 4 + 6 + 8.
        let jet = cubic(1.0, 2.0, 3.0, 6.0).at(2.0);
        assert_eq!((jet.value, jet.rate, jet.acceleration), (19.0, 20.0, 15.0));
    }
}
