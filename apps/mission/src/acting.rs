//! From a verified action to a goal of the body, and what comes of it: arrived, failed, done.

use dsg::{ObjectId, RoomId, SceneGraph};
use nalgebra::{Point2, Point3};
use octant_prompt::{Action, Critique, CritiqueCode};
use omni_perception::Stamp;

use crate::approach::{Stand, floor_distance_m, stand_before};
use crate::goal::{Goal, GoalStatus};
use crate::mission::{Mission, Outcome, StepDone};

/// Near enough to the place before a thing.
pub(crate) const STAND_TOLERANCE_M: f64 = 0.2;
/// Near enough to the middle of a room.
pub(crate) const ROOM_TOLERANCE_M: f64 = 1.0;

/// What the robot is after, on behalf of which action.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// Nothing yet.
    None,
    /// An action that moves the body.
    Action(Action),
    /// Where it set out.
    Start,
}

impl Target {
    /// For the progress line.
    pub fn describe(&self, graph: &SceneGraph) -> String {
        match self {
            Target::None => "looking around".into(),
            Target::Start => "going back to where it started".into(),
            Target::Action(Action::Explore(_)) => "exploring".into(),
            // What it goes to may have turned out to be something else, or nothing, on the way.
            Target::Action(Action::GoNear(id)) => match graph.object(*id) {
                Some(object) => format!("going to the {}", object.label),
                None => "going to where something was seen".into(),
            },
            Target::Action(Action::GoToRoom(id)) => match graph.room(*id) {
                Some(room) => format!("going to the {}", room.name),
                None => "going to where a room was".into(),
            },
            Target::Action(Action::TurnTo(octant)) => format!("turning to {octant}"),
            Target::Action(action) => action.to_string(),
        }
    }
}

/// What the mission remembers for its decisions within one step of the instruction.
#[derive(Debug, Clone, Default)]
pub struct StepMemory {
    /// Rooms the robot has been in.
    pub visited: Vec<RoomId>,
    /// Objects it has arrived at.
    pub inspected: Vec<ObjectId>,
    /// Objects it came near to, but not as near as it should: once more, on the map as it is now known.
    pub approached: Vec<ObjectId>,
    /// What failed, until when it is left alone, and how often it has failed.
    pub rejected: Vec<Failure>,
    /// How often a search that seemed over was taken up again.
    pub reprieves: u32,
    /// How often somebody was asked which one is meant.
    pub questions: u32,
    /// Which one somebody said is meant.
    pub chosen: Option<crate::asking::Chosen>,
    /// Somebody said that any will do, or nobody said anything.
    pub any_will_do: bool,
}

/// An action that failed. Maps grow, so it may succeed later.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    pub(crate) critique: Critique,
    pub(crate) until_s: f64,
    times: u32,
}

#[cfg(test)]
impl Failure {
    /// A failure that counts until a time.
    pub(crate) fn until(critique: Critique, until_s: f64) -> Failure {
        Failure { critique, until_s, times: 1 }
    }
}

impl Mission {
    /// Turns a verified action into a goal of the body, or into the end of a step.
    pub(crate) fn act(&mut self, action: Action, t_s: f64) {
        match &action {
            Action::Stop(target) => self.step_is_done(*target, t_s),
            Action::GiveUp { reason } => {
                let reason = self.with_offer(reason);
                self.finish(Outcome::GaveUp { reason });
            }
            _ => {
                let is_same = self.target == Target::Action(action.clone());
                if is_same && *self.body.status() == GoalStatus::Underway {
                    return;
                }
                match self.goal_of(&action) {
                    Some(goal) => {
                        if let Action::Explore(id) = &action
                            && let Some(at) = self.world.graph.place(*id).map(|place| place.position.xy())
                        {
                            self.world.coverage.set_out(&at);
                        }
                        self.arrived_s = None;
                        self.body.set_goal(goal);
                        self.target = Target::Action(action);
                        let (body, world, clock) = (&mut self.body, &self.world, &mut self.journal.clock);
                        body.replan(world, clock);
                    }
                    None => {
                        self.target = Target::Action(action);
                        self.failed("no place to stand was found");
                        self.target = Target::None;
                    }
                }
            }
        }
    }

    /// Where the body must be for an action.
    fn goal_of(&mut self, action: &Action) -> Option<Goal> {
        let odometry = self.world.odometry.as_ref()?;
        let here = Point2::from(odometry.world_from_body.translation.vector.xy());
        match action {
            Action::GoNear(id) => {
                let object = self.world.graph.object(*id)?.clone();
                self.stands_before_target = true;
                let stand = self.stand_for(*id, &here);
                if let Some(stand) = stand {
                    return Some(Goal::Reach {
                        target: stand.at,
                        tolerance_m: STAND_TOLERANCE_M,
                        heading_rad: Some(stand.heading_rad),
                    });
                }
                // Not enough of the floor is known there yet: as near as can be, and look again.
                const LOOK_FROM_M: f64 = 4.0;
                self.stands_before_target = false;
                let (nearest, off_m) = self.world.navigation.nearest_reachable(&here, &object.centroid.xy())?;
                let is_progress = off_m <= LOOK_FROM_M && (nearest - here).norm() > 0.3;
                is_progress.then_some(Goal::Reach { target: nearest, tolerance_m: 0.3, heading_rad: None })
            }
            Action::Explore(id) => {
                let place = self.world.graph.place(*id)?;
                // The way may end before unmeasured space; from there more of it is seen.
                Some(Goal::Reach { target: place.position.xy(), tolerance_m: 4.0, heading_rad: None })
            }
            Action::GoToRoom(id) => {
                let room = self.world.graph.room(*id)?;
                Some(Goal::Reach { target: room.center.xy(), tolerance_m: ROOM_TOLERANCE_M, heading_rad: None })
            }
            Action::TurnTo(octant) => {
                let (_, _, yaw_rad) = odometry.world_from_body.rotation.euler_angles();
                Some(Goal::Turn { heading_rad: yaw_rad + octant.heading_rad() })
            }
            Action::Stop(_) | Action::GiveUp { .. } => None,
        }
    }

    /// The best place to look at a thing, for a robot that comes from `here`; `None` if it cannot get near.
    pub(crate) fn stand_for(&self, id: ObjectId, here: &Point2<f64>) -> Option<Stand> {
        const FALLBACK_M: f64 = 1.3;
        /// Inside the stop distance by so much: the body ends a little off its goal.
        const SPARE_M: f64 = 0.15;
        stand_before(
            &self.world.graph.object(id)?.bounds,
            &self.reach_from(here),
            self.world.floor_m + self.world.camera_height_m(),
            self.config.stop_distance_m - SPARE_M,
            FALLBACK_M,
            &|eye, thing| self.world.is_clear(eye, thing),
            &|point| self.world.navigation.lacking_m(point),
        )
    }

    /// The critic agreed that the present step is done: the next one, or the end.
    fn step_is_done(&mut self, target: octant_prompt::Target, t_s: f64) {
        let graph = &self.world.graph;
        let (name, at) = match target {
            octant_prompt::Target::Object(id) => match graph.object(id) {
                Some(object) => (format!("{} {}", object.label, id), object.centroid),
                None => return,
            },
            octant_prompt::Target::Room(id) => match graph.room(id) {
                Some(room) => (format!("{} {}", room.name, id), room.center),
                None => return,
            },
        };
        self.end_step(name, at, t_s);
    }

    /// The present step is done, at something: the next one, or the end.
    pub(crate) fn end_step(&mut self, name: String, at: Point3<f64>, t_s: f64) {
        let step = self.step_index;
        let stamp = self.world.odometry.as_ref().map_or(self.start, |o| o.stamp);
        self.steps_done.push(StepDone { step, stamp });
        self.step_index += 1;
        self.memory = StepMemory::default();
        self.target = Target::None;
        self.next_decision_s = t_s;
        self.body.set_goal(Goal::Stay);
        if self.step_index >= self.instruction.steps.len() {
            self.finish(Outcome::Stopped { target: name, at });
        }
    }

    /// The body is where the action wanted it, and has looked at the thing there since `looked_since_s`.
    pub(crate) fn arrived(&mut self, looked_since_s: Option<f64>) {
        let Some(odometry) = self.world.odometry else { return };
        let here = Point2::from(odometry.world_from_body.translation.vector.xy());
        if let Target::Action(Action::GoNear(id)) = self.target
            && self.stands_before_target
        {
            // A thing seen a few times, and in no image from nearby, is something else, or nothing. One seen often may be
            // hidden from here: behind a neighbour, under a shelf.
            const OFTEN: u32 = 8;
            let is_shown = |since_s: f64| {
                self.world.graph.object(id).is_none_or(|object| {
                    object.observations >= OFTEN || self.seconds(Stamp(object.last_seen_ns)) >= since_s
                })
            };
            if looked_since_s.is_some_and(|since_s| !is_shown(since_s)) {
                self.failed("no image from nearby shows it");
                self.body.set_goal(Goal::Stay);
                self.target = Target::None;
                return;
            }
            let is_far = self
                .world
                .graph
                .object(id)
                .is_some_and(|object| floor_distance_m(&object.bounds, &here) > self.config.stop_distance_m);
            if is_far && !self.memory.approached.contains(&id) {
                self.memory.approached.push(id);
            } else if !self.memory.inspected.contains(&id) {
                self.memory.inspected.push(id);
            }
        }
        if let Target::Action(Action::Explore(place)) = &self.target
            && let Some(place) = self.world.graph.place(*place)
        {
            // Stood there and it is still a frontier: nothing more is to be seen from here.
            let at = place.position.xy();
            const NEAR_M: f64 = 1.5;
            const PAUSE_S: f64 = 10.0;
            if (here - at).norm() < NEAR_M {
                self.world.coverage.give_up(&at);
            } else {
                // As near as could be, and not near enough: perhaps from elsewhere.
                self.world.coverage.postpone(&at, self.seconds(odometry.stamp) + PAUSE_S);
            }
        }
    }

    /// The body could not do what the action wanted.
    pub(crate) fn failed(&mut self, why: &'static str) {
        let Target::Action(action) = self.target.clone() else { return };
        let now_s = self.world.odometry.as_ref().map_or(0.0, |o| self.seconds(o.stamp));
        self.journal.notes.push((now_s, format!("{action}: {why}")));
        let index = self.memory.rejected.iter().position(|f| f.critique.action.as_ref() == Some(&action));
        let times = index.map_or(0, |index| self.memory.rejected[index].times) + 1;
        // Twice as long after every failure: the map may have grown in the meantime.
        const PAUSE_S: f64 = 6.0;
        let until_s = now_s + PAUSE_S * f64::from(1_u32 << times.min(8));
        if let Action::Explore(place) = &action
            && let Some(place) = self.world.graph.place(*place)
        {
            let at = place.position.xy();
            self.world.coverage.postpone(&at, until_s);
        }
        let critique =
            Critique { code: CritiqueCode::Failed, message: format!("{action} failed: {why}"), action: Some(action) };
        let failure = Failure { critique, until_s, times };
        match index {
            Some(index) => self.memory.rejected[index] = failure,
            None => self.memory.rejected.push(failure),
        }
    }
}
