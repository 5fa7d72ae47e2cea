//! What moves near a robot on the ground, and when the robot may move among it.
//!
//! ```text
//! d(t) = distance of the footprint at t to the circle of the mover at q + t u, less its growth g t
//! a motion is admissible if, until `PASSING_S` after it has come to rest, d(t) >= margin at all t
//! ```
//! Who cannot move without coming too near to somebody who walks, stands, and the walker passes: then a contact is the walker's. From
//! somebody who stands, one may go away.

use nalgebra::{Point2, Vector2};

use super::footprint::Footprint;
use super::obstacles::Pose;

/// A circle on the floor that goes on as it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundMover {
    /// Its middle now, in the world.
    pub position: Point2<f64>,
    /// Its velocity (m/s), taken as constant.
    pub velocity_mps: Vector2<f64>,
    /// Radius of the circle that holds it.
    pub radius_m: f64,
    /// By how much the circle grows in a second: what is not known about the velocity.
    pub growth_mps: f64,
}

/// The robot rests for so long before anybody can touch it.
pub(crate) const PASSING_S: f64 = 1.0;
/// A mover that is slower stands.
const STANDS_MPS: f64 = 0.2;
/// Who walked this near has not come to stand there: he is stopped by the robot, and goes on when it moves.
const PRESSING_M: f64 = 0.5;
/// For so long after.
const ALERT_S: f64 = 2.0;

/// Movers, and what each must be kept from.
#[derive(Debug, Clone, Default)]
pub(crate) struct Traffic {
    movers: Vec<(GroundMover, f64)>,
    /// For so long nobody near is believed to stand.
    alert_s: f64,
}

impl Traffic {
    /// Those within reach of a robot at `pose`; numbers that are none are skipped. Movers that stand need not be left further than they
    /// are, unless they have just walked up to the robot.
    #[allow(clippy::too_many_arguments)] // one for each thing that says who is near
    pub fn watch(
        &mut self,
        movers: &[GroundMover],
        footprint: &Footprint,
        pose: &Pose,
        margin_m: f64,
        reach_m: f64,
        horizon_s: f64,
        period_s: f64,
    ) {
        self.movers.clear();
        let is_sound = |mover: &&GroundMover| {
            let numbers = mover.position.iter().chain(mover.velocity_mps.iter());
            numbers.chain([&mover.radius_m, &mover.growth_mps]).all(|x| x.is_finite())
        };
        let presses = |mover: &GroundMover| {
            mover.velocity_mps.norm() >= STANDS_MPS && distance_m(footprint, pose, mover, 0.0) < PRESSING_M
        };
        let is_pressed = movers.iter().filter(is_sound).any(presses);
        self.alert_s = if is_pressed { ALERT_S } else { (self.alert_s - period_s).max(0.0) };
        for mover in movers.iter().filter(is_sound) {
            let now_m = distance_m(footprint, pose, mover, 0.0);
            let speed_mps = mover.velocity_mps.norm();
            if now_m > reach_m + (speed_mps + mover.growth_mps) * horizon_s {
                continue;
            }
            let mut mover = *mover;
            let mut keep_m = margin_m;
            if speed_mps < STANDS_MPS && self.alert_s == 0.0 {
                // A rounding less than now; more would let the robot creep nearer cycle by cycle.
                keep_m = margin_m.min(now_m - 1e-6);
                mover.growth_mps = mover.growth_mps.min(speed_mps);
            }
            self.movers.push((mover, keep_m));
        }
    }

    /// Whether the footprint at `pose`, `t_s` from now, keeps what it must from everybody.
    pub fn is_free(&self, footprint: &Footprint, pose: &Pose, t_s: f64) -> bool {
        self.movers.iter().all(|(mover, keep_m)| distance_m(footprint, pose, mover, t_s) >= *keep_m)
    }

    /// Least distance to anybody's circle `t_s` from now.
    pub fn clearance_m(&self, footprint: &Footprint, pose: &Pose, t_s: f64) -> f64 {
        self.movers.iter().map(|(mover, _)| distance_m(footprint, pose, mover, t_s)).fold(f64::INFINITY, f64::min)
    }

    pub fn is_empty(&self) -> bool {
        self.movers.is_empty()
    }
}

fn distance_m(footprint: &Footprint, pose: &Pose, mover: &GroundMover, t_s: f64) -> f64 {
    let at = mover.position + mover.velocity_mps * t_s;
    let (sin, cos) = pose.yaw.sin_cos();
    let (dx, dy) = (at.x - pose.x, at.y - pose.y);
    let body = Point2::new(cos * dx + sin * dy, cos * dy - sin * dx);
    footprint.distance(&body) - mover.radius_m - mover.growth_mps * t_s
}
