//! A body that is where somebody else says: an autopilot on a link, a motion-capture room.
//!
//! Told poses come now and then, rounded and with jitter, and cannot be differentiated; sensors need a motion that can. So the body
//! is towed by a spring and a damper toward the told pose and velocity, in translation and in rotation:
//!
//! ```text
//! a = w^2 (p_told - p) + 2 w (v_told - v)          critically damped, cut to `max_accel_mps2`
//! ```
//!
//! A told pose is carried on, or back, with its velocities to the time of each step. At a steady speed the body is
//! exactly where it is told to be; under an acceleration `a` it is `a / w^2` behind (2.5 mm per m/s^2).

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::contact::{Contact, ContactWorld};
use crate::motion::KinematicState;
use crate::track::{MotionTrack, Piece};

/// A told pose with its velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToldPose {
    /// Where the body (forward, left, up) is said to be, m.
    pub world_from_body: Isometry3<f64>,
    /// How fast, in the world, m/s.
    pub velocity_world: Vector3<f64>,
    /// How it turns, in the body, rad/s.
    pub angular_velocity_body: Vector3<f64>,
}

impl ToldPose {
    /// At rest.
    pub fn resting_at(world_from_body: Isometry3<f64>) -> ToldPose {
        ToldPose { world_from_body, velocity_world: Vector3::zeros(), angular_velocity_body: Vector3::zeros() }
    }

    fn is_finite(&self) -> bool {
        let vectors = [self.world_from_body.translation.vector, self.velocity_world, self.angular_velocity_body];
        vectors.iter().flat_map(|v| v.iter()).chain(self.world_from_body.rotation.coords.iter()).all(|x| x.is_finite())
    }
}

/// The spring's frequency `w`: a pose that is wrong by the 1 ms of its time stamp at 1 m/s shakes the body by 0.4 m/s^2.
const STIFFNESS_RADPS: f64 = 20.0;
/// Nothing that flies here accelerates harder; a told pose that jumps is followed, not copied.
const MAX_ACCEL_MPS2: f64 = 40.0;
/// The same for turns.
const MAX_TURN_RADPS2: f64 = 200.0;
/// A told pose is carried on for this long.
const LONGEST_S: f64 = 0.1;
/// Longest step of the integration.
const MAX_PIECE_NS: i64 = 2_500_000;

/// Why a step was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TowError {
    /// A told number is NaN or infinite.
    #[error("a told pose or velocity is not finite")]
    NotFinite,
    /// The step is not positive or longer than a second.
    #[error("the time step is not positive or longer than a second")]
    Step,
}

/// The body and its motion so far.
#[derive(Debug, Clone)]
pub struct TowedBody {
    told: (i64, ToldPose),
    state: KinematicState,
    track: MotionTrack,
}

impl TowedBody {
    /// At rest.
    pub fn new(start_ns: i64, world_from_body: Isometry3<f64>) -> TowedBody {
        let state = KinematicState::at_rest(start_ns, world_from_body);
        TowedBody { told: (start_ns, ToldPose::resting_at(world_from_body)), state, track: MotionTrack::new(state) }
    }

    /// Where the body is said to be at `stamp_ns`.
    ///
    /// # Errors
    /// [`TowError::NotFinite`]; what was told before holds.
    pub fn tell(&mut self, stamp_ns: i64, told: ToldPose) -> Result<(), TowError> {
        if !told.is_finite() {
            return Err(TowError::NotFinite);
        }
        self.told = (stamp_ns, told);
        Ok(())
    }

    /// Moves on by `dt_s`; returns what is touched at the end. Contacts do not push: where the body is, somebody else says.
    ///
    /// # Errors
    /// [`TowError::Step`].
    pub fn step(&mut self, dt_s: f64, contacts: Option<&mut ContactWorld>) -> Result<Vec<Contact>, TowError> {
        let total_ns = (dt_s * 1e9).round();
        if !(1.0..=1e9).contains(&total_ns) {
            return Err(TowError::Step);
        }
        let (total_ns, start_ns) = (total_ns as i64, self.track.end_ns());
        let pieces = (total_ns + MAX_PIECE_NS - 1) / MAX_PIECE_NS;
        for i in 0..pieces {
            self.advance(start_ns + total_ns * (i + 1) / pieces);
        }
        Ok(contacts.map_or_else(Vec::new, |world| world.contacts(&self.state.world_from_body, self.track.end_ns())))
    }

    /// One piece, up to `end_ns`.
    fn advance(&mut self, end_ns: i64) {
        let (start, start_ns) = (self.state, self.track.end_ns());
        let (stamp_ns, told) = &self.told;
        let age_s = ((end_ns - stamp_ns) as f64 * 1e-9).clamp(-LONGEST_S, LONGEST_S);
        let there =
            Piece::reaching(&start, start_ns, end_ns, &start.acceleration_world, &start.angular_acceleration_body);
        let there = there.at(end_ns);
        let w = STIFFNESS_RADPS;
        let off = told.world_from_body.translation.vector + told.velocity_world * age_s
            - there.world_from_body.translation.vector;
        let acceleration = off * (w * w) + (told.velocity_world - there.velocity_world) * (2.0 * w);
        let turned =
            told.world_from_body.rotation * UnitQuaternion::from_scaled_axis(told.angular_velocity_body * age_s);
        let off = (there.world_from_body.rotation.inverse() * turned).scaled_axis();
        let turn = off * (w * w) + (told.angular_velocity_body - there.angular_velocity_body) * (2.0 * w);
        let (acceleration, turn) = (acceleration.cap_magnitude(MAX_ACCEL_MPS2), turn.cap_magnitude(MAX_TURN_RADPS2));
        let piece = Piece::reaching(&start, start_ns, end_ns, &acceleration, &turn);
        self.state = piece.at(end_ns);
        self.track.push(piece);
    }

    /// State now.
    pub fn state(&self) -> KinematicState {
        self.state
    }

    /// The motion so far.
    pub fn track(&self) -> &MotionTrack {
        &self.track
    }

    /// Forgets the motion before a stamp.
    pub fn forget_before(&mut self, stamp_ns: i64) {
        self.track.forget_before(stamp_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of 2 m at 1.6 m/s, nose ahead.
    fn circle(t_s: f64) -> ToldPose {
        let (r, w) = (2.0, 0.8);
        let (s, c) = (w * t_s).sin_cos();
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), w * t_s);
        ToldPose {
            world_from_body: Isometry3::from_parts(Vector3::new(r * c, r * s, 1.0).into(), turn),
            velocity_world: Vector3::new(-s, c, 0.0) * (r * w),
            angular_velocity_body: Vector3::z() * w,
        }
    }

    #[test]
    fn it_is_where_it_is_told_to_be() {
        // Starting at speed would be a jump: let it settle for a second.
        let mut body = TowedBody::new(0, circle(0.0).world_from_body);
        let mut worst: f64 = 0.0;
        for tick in 1..1000 {
            let t_s = f64::from(tick) * 0.005;
            body.tell(i64::from(tick) * 5_000_000, circle(t_s)).unwrap();
            body.step(0.005, None).unwrap();
            let off = body.state().world_from_body.inverse() * circle(t_s).world_from_body;
            if t_s > 1.0 {
                worst = worst.max(off.translation.vector.norm()).max(off.rotation.angle());
            }
        }
        // 1.28 m/s^2 / w^2 = 3.2 mm.
        assert!((0.003..0.0035).contains(&worst), "{worst}");
    }

    #[test]
    fn a_jump_is_followed_smoothly() {
        let mut body = TowedBody::new(0, Isometry3::identity());
        let told = ToldPose::resting_at(Isometry3::translation(1.0, 0.0, 0.0));
        let mut before = body.state();
        body.tell(0, told).unwrap();
        for _ in 0..400 {
            body.step(0.005, None).unwrap();
            let now = body.state();
            assert!(now.acceleration_world.norm() <= MAX_ACCEL_MPS2 + 1e-9);
            assert!((now.velocity_world - before.velocity_world).norm() <= 0.005 * MAX_ACCEL_MPS2 + 1e-9);
            before = now;
        }
        assert!((before.world_from_body.translation.x - 1.0).abs() < 1e-6, "{before:?}");
        let nan = ToldPose { velocity_world: Vector3::repeat(f64::NAN), ..told };
        assert_eq!(body.tell(0, nan), Err(TowError::NotFinite));
        assert_eq!(body.step(0.0, None), Err(TowError::Step));
        assert_eq!(body.state(), before);
    }
}
