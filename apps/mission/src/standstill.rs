//! Nothing hangs: a body that is under way and has stood still for long gets no nearer, whatever it believes.

use nalgebra::Point2;

use crate::goal::wrap;

/// Whoever moves by less than this stands,
const MOVED_M: f64 = 0.2;
/// unless it turns by more than this.
const TURNED_RAD: f64 = 0.3;
/// Longer than any body needs to plan, to brake, or to wait for something that passes.
pub(crate) const STUCK_S: f64 = 20.0;

/// Since when, and where.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Standstill {
    mark: Option<(f64, Point2<f64>, f64)>,
}

impl Standstill {
    /// Seconds for which a body that wants to go somewhere has been standing.
    pub(crate) fn seconds(&mut self, now_s: f64, at: Point2<f64>, yaw_rad: f64, is_underway: bool) -> f64 {
        let stands = |(_, place, heading): (f64, Point2<f64>, f64)| {
            (place - at).norm() < MOVED_M && wrap(heading - yaw_rad).abs() < TURNED_RAD
        };
        match self.mark.filter(|mark| is_underway && stands(*mark)) {
            Some((since_s, _, _)) => now_s - since_s,
            None => {
                self.mark = Some((now_s, at, yaw_rad));
                0.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acting::Target;
    use crate::config::MissionConfig;
    use crate::goal::Goal;
    use crate::mission::Mission;
    use crate::odometer::OdometrySource;
    use crate::reasoning::Mind;
    use crate::stream::SensorEvent;
    use nalgebra::Isometry3;
    use octant_prompt::{Action, Octant, SymbolicReasoner};
    use omni_perception::{Equirectangular, OdometryEstimate, Stamp};
    use robot_model::RobotModel;

    #[test]
    fn who_moves_turns_or_has_arrived_does_not_stand() {
        let mut standstill = Standstill::default();
        let here = Point2::new(1.0, 2.0);
        assert_eq!(standstill.seconds(10.0, here, 3.1, true), 0.0);
        // Swaying is standing, also across the seam of the angle.
        assert_eq!(standstill.seconds(15.0, here + nalgebra::Vector2::new(0.1, -0.1), -3.1, true), 5.0);
        assert_eq!(standstill.seconds(16.0, here, 2.7, true), 0.0, "it turned");
        assert_eq!(standstill.seconds(20.0, here, 2.7, true), 4.0);
        assert_eq!(standstill.seconds(21.0, here + nalgebra::Vector2::new(0.3, 0.0), 2.7, true), 0.0, "it moved");
        assert_eq!(
            standstill.seconds(31.0, here + nalgebra::Vector2::new(0.3, 0.0), 2.7, false),
            0.0,
            "it has arrived"
        );
    }

    /// A quadruped that is told to turn and cannot: it believes for ever that it is about to.
    #[test]
    fn a_goal_is_given_up_when_the_body_stands_for_long() {
        let robot = RobotModel::builtin_quadruped();
        let start = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
        let config = MissionConfig { odometry: OdometrySource::Stream, ..MissionConfig::default() };
        let mind = Mind::Embedded(Box::new(SymbolicReasoner::default()));
        let camera = Equirectangular::default();
        let mut mission = Mission::new(&robot, "find the mug", config, camera, mind, Stamp(0), &start).expect("sound");
        mission.target = Target::Action(Action::TurnTo(Octant::BackLeftTop));
        mission.body.set_goal(Goal::Turn { heading_rad: 2.0 });
        let mut given_up_s = None;
        for ms in (20..30_000).step_by(20) {
            let stamp = Stamp(ms * 1_000_000);
            mission.perceive([SensorEvent::Odometry(OdometryEstimate::at_rest(stamp, start))]);
            mission.cycle(stamp);
            if given_up_s.is_none() && !mission.journal.notes.is_empty() {
                given_up_s = Some(1e-3 * ms as f64);
            }
        }
        assert!(mission.journal.notes[0].1.contains("stands still"), "{:?}", mission.journal.notes);
        let given_up_s = given_up_s.expect("it was given up");
        assert!((STUCK_S..STUCK_S + 5.0).contains(&given_up_s), "{given_up_s} s");
    }
}
