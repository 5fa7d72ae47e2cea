//! Turning to see: a robot whose sensors look ahead only sees what is beside and behind it by turning in place.
//!
//! At the beginning and wherever it came to look for something, it turns once round in steps of its field of view; the last step would
//! show again what it saw first. A robot that sees all round never turns for this.

use std::f64::consts::TAU;

use crate::goal::{Goal, GoalStatus, wrap};
use crate::mission::Mission;

/// Turns still to be made.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LookRound {
    /// Steps left.
    pub(crate) left: u32,
    /// Whether the first one, at the very beginning, was begun.
    has_begun: bool,
    /// Where it looks next.
    next_rad: f64,
    step_rad: f64,
    /// When this step began.
    since_s: f64,
}

/// A step that takes longer is given up: there is no room to turn, or nobody moves.
const PATIENCE_S: f64 = 12.0;

/// Steps from one look to the next over a whole turn, for a field of view.
fn steps(view_rad: f64) -> u32 {
    // Neighbouring looks overlap a little: edges of the view are seen worst.
    const OVERLAP: f64 = 0.9;
    ((TAU / (OVERLAP * view_rad)).ceil() as u32).saturating_sub(1)
}

impl Mission {
    /// Whether the robot sees all round.
    pub(crate) fn sees_all_round(&self) -> bool {
        self.config.view_rad >= TAU - 1e-6
    }

    /// Begins to look round, if that shows anything new.
    pub(crate) fn look_round(&mut self, t_s: f64) {
        let Some(odometry) = &self.world.odometry else { return };
        if self.sees_all_round() {
            return;
        }
        let left = steps(self.config.view_rad);
        let step_rad = TAU / f64::from(left + 1);
        let next_rad = wrap(odometry.world_from_body.rotation.euler_angles().2 + step_rad);
        self.looking = LookRound { left, has_begun: true, next_rad, step_rad, since_s: t_s };
        self.turn();
    }

    /// The first look; true while the robot is busy looking round.
    pub(crate) fn is_looking_round(&mut self, t_s: f64) -> bool {
        if !self.looking.has_begun {
            self.looking.has_begun = true;
            self.look_round(t_s);
        }
        if self.looking.left == 0 {
            return false;
        }
        match self.body.status() {
            GoalStatus::Underway if t_s - self.looking.since_s > PATIENCE_S => {
                self.journal.notes.push((t_s, "there is no room to turn and look".into()));
                self.body.set_goal(Goal::Stay);
                self.looking.left = 0;
                false
            }
            GoalStatus::Underway => true,
            GoalStatus::Arrived => {
                self.looking.left -= 1;
                self.looking.next_rad = wrap(self.looking.next_rad + self.looking.step_rad);
                if self.looking.left > 0 {
                    self.looking.since_s = t_s;
                    self.turn();
                }
                self.looking.left > 0
            }
            // Where it cannot turn it sees what it sees.
            GoalStatus::Failed(_) => {
                self.looking.left = 0;
                false
            }
        }
    }

    fn turn(&mut self) {
        self.body.set_goal(Goal::Turn { heading_rad: self.looking.next_rad });
        self.body.replan(&self.world, &mut self.journal.clock);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_directions_are_seen() {
        for degrees in 30..=359 {
            let view_rad = f64::from(degrees).to_radians();
            let looks = f64::from(steps(view_rad) + 1);
            assert!(looks * view_rad >= TAU, "{degrees}");
            assert!(TAU / looks <= view_rad);
        }
        assert_eq!((steps(90_f64.to_radians()), steps(TAU * 0.99)), (4, 1));
    }
}
