//! How the base moves: velocity in the body frame, limited acceleration, arcs. All of it is exact copies of what
//! the policy commands, so that a checked stop is the stop that happens.

use nalgebra::{Point2, Vector2};

use super::footprint::Footprint;
use super::obstacles::{ObstacleField, Pose};
use super::traffic::{PASSING_S, Traffic};
use crate::zone::SpeedZone;

/// A measured velocity that takes longer to brake than this many periods is not believed to be safe.
const MAX_BRAKE_STEPS: usize = 2000;

/// Body velocity: forward, left, counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Twist {
    pub vx: f64,
    pub vy: f64,
    pub w: f64,
}

/// Acceleration limits and the period of the loop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ramp {
    pub accel_mps2: f64,
    pub yaw_accel_radps2: f64,
}

impl Ramp {
    /// The velocity after `dt_s` on the way to `target`.
    pub fn toward(&self, from: &Twist, target: &Twist, dt_s: f64) -> Twist {
        let change = Vector2::new(target.vx - from.vx, target.vy - from.vy);
        let most = self.accel_mps2 * dt_s;
        let share = if change.norm() > most { most / change.norm() } else { 1.0 };
        let most_yaw = self.yaw_accel_radps2 * dt_s;
        Twist {
            vx: from.vx + change.x * share,
            vy: from.vy + change.y * share,
            w: from.w + (target.w - from.w).clamp(-most_yaw, most_yaw),
        }
    }
}

impl Twist {
    pub fn is_zero(&self) -> bool {
        self.vx == 0.0 && self.vy == 0.0 && self.w == 0.0
    }
}

/// The pose after moving with a constant body velocity (midpoint rule; the error is third order in `w dt`).
pub(crate) fn advance(pose: &Pose, twist: &Twist, dt_s: f64) -> Pose {
    let (sin, cos) = (pose.yaw + 0.5 * twist.w * dt_s).sin_cos();
    Pose {
        x: pose.x + (cos * twist.vx - sin * twist.vy) * dt_s,
        y: pose.y + (sin * twist.vx + cos * twist.vy) * dt_s,
        yaw: pose.yaw + twist.w * dt_s,
    }
}

/// What a motion is tested against.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Free<'a> {
    pub field: &'a ObstacleField,
    pub traffic: &'a Traffic,
    pub footprint: &'a Footprint,
    pub margin_m: f64,
    /// Where it may only be slow.
    pub slow: &'a [SpeedZone],
}

/// Whether one may move like this at a place: faster than a zone allows only where no part of the body is in it.
fn is_slow_enough(free: &Free, pose: &Pose, twist: &Twist) -> bool {
    const ROUNDING_MPS: f64 = 1e-9;
    let speed_mps = twist.vx.hypot(twist.vy);
    let at = Point2::new(pose.x, pose.y);
    let reach_m = free.footprint.circumscribed_radius_m + free.margin_m;
    free.slow.iter().all(|slow| speed_mps <= slow.max_mps + ROUNDING_MPS || !slow.holds(&at, reach_m))
}

/// Whether a robot at rest from `from_s` on is left alone until it has stood for [`PASSING_S`].
fn passes(free: &Free, pose: &Pose, from_s: f64, period_s: f64) -> bool {
    let steps = (PASSING_S / period_s).ceil() as usize;
    free.traffic.is_empty()
        || (0..=steps).all(|k| free.traffic.is_free(free.footprint, pose, from_s + k as f64 * period_s))
}

/// Whether driving `first` for one period and then braking to rest touches nothing: the invariant of the policy.
/// The footprint is tested every `margin_m` of motion of its furthest corner (between two tests it cannot come
/// nearer to a point than half of that).
///
/// Movers are tested at every period, and until [`PASSING_S`] after the robot has come to rest: who stands still from the first step on
/// has nothing to prove, since there is nothing better to do.
pub(crate) fn can_stop(free: &Free, ramp: &Ramp, period_s: f64, start: &Pose, first: &Twist) -> bool {
    let Free { field, traffic, footprint, margin_m, .. } = *free;
    let (mut pose, mut twist) = (*start, *first);
    let stands = first.is_zero();
    if !is_slow_enough(free, start, first) {
        return false;
    }
    let spacing = margin_m.clamp(0.01, 0.04);
    let mut since_test = 0.0;
    for step in 1..=MAX_BRAKE_STEPS {
        pose = advance(&pose, &twist, period_s);
        if !is_slow_enough(free, &pose, &twist) {
            return false;
        }
        since_test += (twist.vx.hypot(twist.vy) + twist.w.abs() * footprint.circumscribed_radius_m) * period_s;
        twist = ramp.toward(&twist, &Twist::default(), period_s);
        let resting = twist.is_zero();
        if since_test >= spacing || resting {
            since_test = 0.0;
            if !field.is_free(footprint, &pose, margin_m) {
                return false;
            }
        }
        let t_s = step as f64 * period_s;
        if !stands && !traffic.is_free(footprint, &pose, t_s) {
            return false;
        }
        if resting {
            return stands || passes(free, &pose, t_s, period_s);
        }
    }
    false
}
