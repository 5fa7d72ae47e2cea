//! "Come back to where you started": a step that the body does by itself, since no map shows where it began.

use nalgebra::{Point2, Point3};
use octant_prompt::StepKind;

use crate::acting::Target;
use crate::goal::{Goal, GoalStatus};
use crate::mission::{Mission, Outcome};

/// Near enough to the start.
const TOLERANCE_M: f64 = 0.3;
/// Tries, with a pause between them in which the map may grow.
const TRIES: u32 = 4;
const PAUSE_S: f64 = 3.0;
/// Standing so long on the way is as good as a failure.
const STUCK_S: f64 = 10.0;

/// The way back: where to, and how often it has failed.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct WayHome {
    /// Where the robot stood when it knew where it was, in the map's frame.
    pub start: Option<Point2<f64>>,
    failures: u32,
    next_try_s: f64,
}

impl WayHome {
    /// A new instruction: what failed may be tried again.
    pub(crate) fn forgive(&mut self) {
        *self = WayHome { start: self.start, ..WayHome::default() };
    }
}

impl Mission {
    /// Keeps the place from which the robot sets out.
    pub(crate) fn remember_start(&mut self) {
        if let (None, Some(odometry)) = (self.way_home.start, &self.world.odometry) {
            self.way_home.start = Some(Point2::from(odometry.world_from_body.translation.vector.xy()));
        }
    }

    /// Whether the present step is to be back at the start.
    pub(crate) fn is_returning(&self) -> bool {
        self.instruction.steps.get(self.step_index).is_some_and(|step| step.kind == StepKind::ReturnToStart)
    }

    /// One look at how the way back goes.
    pub(crate) fn return_to_start(&mut self, t_s: f64) {
        let Some(start) = self.way_home.start else { return };
        // An answer to an earlier step is not wanted any more.
        if t_s < self.way_home.next_try_s || self.pending.is_some() {
            return;
        }
        if self.target != Target::Start {
            self.target = Target::Start;
            self.body.set_goal(Goal::Reach { target: start, tolerance_m: TOLERANCE_M, heading_rad: None });
            self.body.replan(&self.world, &mut self.journal.clock);
            return;
        }
        let stood_s = self.has_stood_s(t_s);
        let why = match *self.body.status() {
            GoalStatus::Arrived => {
                let at = Point3::new(start.x, start.y, self.world.floor_m);
                self.end_step("where it started".into(), at, t_s);
                return;
            }
            GoalStatus::Failed(why) => why,
            GoalStatus::Underway if stood_s > STUCK_S => "it stands still on the way",
            GoalStatus::Underway => return,
        };
        self.journal.notes.push((t_s, format!("back to the start: {why}")));
        self.way_home.failures += 1;
        self.way_home.next_try_s = t_s + PAUSE_S;
        self.target = Target::None;
        self.body.set_goal(Goal::Stay);
        if self.way_home.failures >= TRIES {
            self.finish(Outcome::GaveUp { reason: format!("I found no way back to where I started: {why}.") });
        }
    }
}
