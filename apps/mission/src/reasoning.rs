//! The mind of the mission: when to think, what about, and what becomes of the answer.
//!
//! The reasoner gets a snapshot and is never waited for. Its answer is verified twice: against the snapshot by the loop of
//! actor and critic, and again at the revision of the graph at which it comes in.

use std::sync::mpsc::{Receiver, TryRecvError};

use dsg::{ObjectId, PlaceId, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point2, Point3};
use octant_prompt::{
    Action, Attempt, Critic, Critique, CritiqueCode, DecisionRecord, Estimate, Instruction, Prompt, Reasoner,
    Situation, SymbolicReasoner, TokenCounter, build_prompt_for, decide_with_critic,
};

use octant_prompt::vocabulary::{Class, class_similarity};
use omni_perception::Stamp;

use crate::approach::{floor_distance_m, in_front_of, stand_before};
use crate::config::MissionConfig;
use crate::goal::{Goal, GoalStatus};
use crate::journal::{DecisionEntry, TraceEntry};
use crate::mission::{Mission, Outcome, StepDone};
use crate::reach::ReachMap;

/// Something can be reached if the robot can stand within this of it.
const BESIDE_M: f64 = 1.3;
/// ... and, when nothing else is left to search, looked at if it can stand within this of it.
const IN_VIEW_M: f64 = 3.5;

/// What the robot is after, on behalf of which action.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// Nothing yet.
    None,
    /// An action that moves the body.
    Action(Action),
}

impl Target {
    /// For the progress line.
    pub fn describe(&self, graph: &SceneGraph) -> String {
        let label = |id: &ObjectId| graph.object(*id).map_or_else(|| id.to_string(), |object| object.label.clone());
        match self {
            Target::None => "looking around".into(),
            Target::Action(Action::Explore(_)) => "exploring".into(),
            Target::Action(Action::GoNear(id)) => format!("going to the {}", label(id)),
            Target::Action(Action::GoToRoom(id)) => {
                format!("going to the {}", graph.room(*id).map_or_else(|| id.to_string(), |room| room.name.clone()))
            }
            Target::Action(Action::TurnTo(octant)) => format!("turning to {octant}"),
            Target::Action(action) => action.to_string(),
        }
    }
}

/// Everything a reasoner may look at, owned, as it was when the question was asked.
#[derive(Clone)]
pub struct Snapshot {
    graph: SceneGraph,
    world_from_body: Isometry3<f64>,
    instruction: Instruction,
    step_index: usize,
    camera_height_m: f64,
    reach: ReachMap,
    beside_m: f64,
    stoppable: Vec<ObjectId>,
    frontiers: Vec<PlaceId>,
    visited: Vec<RoomId>,
    inspected: Vec<ObjectId>,
    rejected: Vec<Critique>,
    stop_distance_m: f64,
    asked_from: Point3<f64>,
    last_action: Option<Action>,
}

impl Snapshot {
    /// Whether no frontier is left that can be reached and has not failed.
    fn search_is_over(&self) -> bool {
        let is_open = |id: &PlaceId| {
            let failed = |critique: &Critique| critique.action.as_ref() == Some(&Action::Explore(*id));
            let position = self.graph.place(*id).map(|place| place.position);
            !self.rejected.iter().any(failed)
                && position.is_some_and(|position| self.reach.length_to(&position, self.beside_m).is_some())
        };
        !self.frontiers.iter().any(is_open)
    }

    /// Calls `use_it` with the borrowed form that the prompt crate takes.
    fn with_situation<T>(&self, use_it: impl FnOnce(&Situation) -> T) -> T {
        let path_length = |point: &Point3<f64>| self.reach.length_to(point, self.beside_m);
        let can_stop = |id: ObjectId| self.stoppable.contains(&id);
        let situation = Situation {
            step_index: self.step_index,
            camera_height_m: self.camera_height_m,
            frontiers: &self.frontiers,
            visited: &self.visited,
            inspected: &self.inspected,
            rejected: &self.rejected,
            stop_distance_m: self.stop_distance_m,
            asked_from: Some(self.asked_from),
            last_action: self.last_action.as_ref(),
            ..Situation::new(&self.graph, self.world_from_body, &self.instruction, &path_length, &can_stop)
        };
        use_it(&situation)
    }

    /// Prompt, reasoner, critic: one decision on this snapshot.
    fn decide(&self, reasoner: &mut dyn Reasoner, critic: &Critic, config: &MissionConfig) -> Answer {
        self.with_situation(|situation| {
            let prompt_config =
                octant_prompt::PromptConfig { camera_height_m: self.camera_height_m, ..config.prompt.clone() };
            let prompt = build_prompt_for(situation, &prompt_config, &Estimate);
            let record = decide_with_critic(
                reasoner,
                critic,
                situation,
                &prompt,
                config.max_retries,
                &mut SymbolicReasoner::default(),
            );
            Answer { prompt, record }
        })
    }
}

/// A decision and the prompt it answers.
pub struct Answer {
    prompt: Prompt,
    record: DecisionRecord,
}

/// A question that has been asked.
pub struct Pending {
    asked_s: f64,
    revision: u64,
    pose: [f64; 4],
    answer: Waiting,
}

#[allow(clippy::large_enum_variant)] // there is one of it
enum Waiting {
    /// The embedded reasoner has answered; the answer counts from this time on.
    Due(f64, Box<Answer>),
    /// A model is thinking in another thread; it gives itself back with the answer.
    Thread(Receiver<(Box<dyn Reasoner + Send>, Answer)>),
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
}

/// An action that failed. Maps grow, so it may succeed later.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    critique: Critique,
    until_s: f64,
    times: u32,
}

impl Mission {
    /// Whether something happened that calls for a decision.
    pub(crate) fn must_think(&mut self, t_s: f64) -> bool {
        if self.pending.is_some() || t_s < self.next_decision_s {
            return false;
        }
        match *self.body.status() {
            GoalStatus::Arrived => {
                // Before a thing, the robot looks at it for a moment: a few more images settle its label and its place.
                if self.stands_before_target && matches!(self.target, Target::Action(Action::GoNear(_))) {
                    let since_s = *self.arrived_s.get_or_insert(t_s);
                    if t_s - since_s < self.config.close_look_s {
                        return false;
                    }
                }
                let looked_since_s = self.arrived_s.take();
                self.arrived(looked_since_s);
                return true;
            }
            GoalStatus::Failed(why) => {
                // Counted once; the body stands until the next decision gives it another goal.
                self.failed(why);
                self.body.set_goal(Goal::Stay);
                self.target = Target::None;
                return true;
            }
            GoalStatus::Underway => {}
        }
        // A frontier that is no frontier any more is not worth the rest of the way.
        if let Target::Action(Action::Explore(place)) = &self.target
            && self.world.graph.place(*place).is_none_or(|place| !place.is_frontier())
        {
            return true;
        }
        // Something of the kinds that the instruction names appeared, moved to another room, or went.
        let interest = self.interest();
        if interest != self.interest {
            self.interest = interest;
            return true;
        }
        false
    }

    /// What is known of the kinds of things that the instruction names, as numbers that change when it matters.
    fn interest(&self) -> Vec<u64> {
        // Look-alikes count: a cup may turn out to be the mug.
        const LOOK_ALIKE: f64 = 0.5;
        let nouns = &self.nouns;
        self.world
            .graph
            .confirmed_objects()
            .filter(|object| nouns.iter().any(|noun| class_similarity(noun, &Class::new(&object.label)) >= LOOK_ALIKE))
            .flat_map(|object| [object.id.0, object.room.map_or(u64::MAX, |room| room.0)])
            .collect()
    }

    fn arrived(&mut self, looked_since_s: Option<f64>) {
        if let Target::Action(Action::GoNear(id)) = self.target
            && self.stands_before_target
        {
            // A thing that no image from nearby shows is something else, or nothing.
            let last_seen_s =
                self.world.graph.object(id).map_or(f64::INFINITY, |o| self.seconds(Stamp(o.last_seen_ns)));
            if looked_since_s.is_some_and(|since_s| last_seen_s < since_s) {
                self.failed("no image from nearby shows it");
                self.body.set_goal(Goal::Stay);
                self.target = Target::None;
                return;
            }
            let here = self.world.odometry.as_ref().map(|o| Point2::from(o.world_from_body.translation.vector.xy()));
            let bounds = self.world.graph.object(id).map(|object| object.bounds);
            let is_far = here
                .zip(bounds)
                .is_some_and(|(here, bounds)| floor_distance_m(&bounds, &here) > self.config.stop_distance_m);
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
            let here = self.world.odometry.as_ref().map(|o| Point2::from(o.world_from_body.translation.vector.xy()));
            let now_s = self.world.odometry.as_ref().map_or(0.0, |o| self.seconds(o.stamp));
            const NEAR_M: f64 = 1.5;
            const PAUSE_S: f64 = 10.0;
            if here.is_some_and(|here| (here - at).norm() < NEAR_M) {
                self.world.coverage.give_up(&at);
            } else {
                // As near as could be, and not near enough: perhaps from elsewhere.
                self.world.coverage.postpone(&at, now_s + PAUSE_S);
            }
        }
    }

    fn failed(&mut self, why: &'static str) {
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

    /// Asks for a decision on a snapshot of what is known now.
    pub(crate) fn ask(&mut self, t_s: f64) {
        let Some(mut snapshot) = self.snapshot() else { return };
        if snapshot.search_is_over() && self.revive_search(t_s) {
            snapshot = self.snapshot().expect("it was there a moment ago");
        }
        self.interest = self.interest();
        self.next_decision_s = t_s + self.config.decision_period_s;
        let revision = snapshot.graph.revision();
        let at = snapshot.world_from_body.translation.vector;
        let pose = [at.x, at.y, at.z, snapshot.world_from_body.rotation.euler_angles().2];
        let answer = match self.reasoner.take() {
            Some(Mind::Embedded(mut reasoner)) => {
                let (critic, config) = (&self.critic, &self.config);
                let answer =
                    self.journal.clock.time("reasoning", || snapshot.decide(reasoner.as_mut(), critic, config));
                self.reasoner = Some(Mind::Embedded(reasoner));
                Waiting::Due(t_s + self.config.reasoning_latency_s, Box::new(answer))
            }
            Some(Mind::Remote(mut reasoner)) => {
                let (sender, receiver) = std::sync::mpsc::channel();
                let (critic, config) = (self.critic.clone(), self.config.clone());
                std::thread::spawn(move || {
                    let answer = snapshot.decide(reasoner.as_mut(), &critic, &config);
                    // The mission may be over; then nobody wants the answer.
                    let _ = sender.send((reasoner, answer));
                });
                Waiting::Thread(receiver)
            }
            None => return,
        };
        self.pending = Some(Pending { asked_s: t_s, revision, pose, answer });
    }

    /// Before the robot guesses or gives up: what failed is tried again, and patches that it can only look into count too.
    /// False when that was done often enough.
    fn revive_search(&mut self, t_s: f64) -> bool {
        const REPRIEVES: u32 = 3;
        if self.memory.reprieves >= REPRIEVES {
            return false;
        }
        self.memory.reprieves += 1;
        self.memory.rejected.retain(|failure| !matches!(failure.critique.action, Some(Action::Explore(_))));
        self.world.offer_again(t_s, &mut self.journal.clock);
        self.journal.notes.push((t_s, "nothing left to search; what failed before is tried again".into()));
        true
    }

    /// Takes an answer that has come in, verifies it at the present revision, and acts on it.
    pub(crate) fn take_answer(&mut self, t_s: f64) {
        let Some(pending) = self.pending.take() else { return };
        let Pending { asked_s, revision, pose, answer } = pending;
        let answer = match answer {
            Waiting::Due(due_s, answer) if t_s >= due_s => *answer,
            Waiting::Due(..) => {
                self.pending = Some(Pending { asked_s, revision, pose, answer });
                return;
            }
            Waiting::Thread(receiver) => match receiver.try_recv() {
                Ok((reasoner, answer)) => {
                    self.reasoner = Some(Mind::Remote(reasoner));
                    answer
                }
                Err(TryRecvError::Empty) => {
                    self.pending = Some(Pending { asked_s, revision, pose, answer: Waiting::Thread(receiver) });
                    return;
                }
                Err(TryRecvError::Disconnected) => {
                    self.journal.notes.push((t_s, "the reasoner died; the embedded one goes on".into()));
                    self.reasoner = Some(Mind::Embedded(Box::new(SymbolicReasoner::default())));
                    return;
                }
            },
        };
        let Some(now) = self.snapshot() else { return };
        let mut entry = self.entry(t_s, asked_s, revision, pose, &answer);
        entry.verdict_revision = now.graph.revision();
        let Some(action) = answer.record.reply.as_ref().map(|reply| reply.action.clone()) else {
            entry.verdicts.push("no proposal was accepted; the robot holds".into());
            self.journal.decisions.push(entry);
            self.unsure += 1;
            const PATIENCE: u32 = 20;
            if self.unsure >= PATIENCE {
                let reason = "No action passed the critic any more, so the search is over.".into();
                self.finish(Outcome::GaveUp { reason });
            }
            return;
        };
        self.unsure = 0;
        let verdict = now.with_situation(|situation| self.critic.check(&action, situation, answer.prompt.revision));
        match verdict {
            Ok(()) => {
                entry.verdicts.push("accepted".into());
                self.journal.decisions.push(entry);
                self.act(action, t_s);
            }
            Err(critique) => {
                entry.verdicts.push(format!("rejected at revision {}: {}", now.graph.revision(), critique.message));
                self.journal.decisions.push(entry);
                // The map changed while the reasoner thought: ask again at once.
                if critique.code == CritiqueCode::StaleName {
                    self.next_decision_s = t_s;
                }
            }
        }
    }

    /// Turns a verified action into a goal of the body, or into the end of a step.
    fn act(&mut self, action: Action, t_s: f64) {
        match &action {
            Action::Stop(target) => self.step_is_done(*target, t_s),
            Action::GiveUp { reason } => self.finish(Outcome::GaveUp { reason: reason.clone() }),
            _ => {
                let is_same = self.target == Target::Action(action.clone());
                if is_same && *self.body.status() == GoalStatus::Underway {
                    return;
                }
                match self.goal_of(&action) {
                    Some(goal) => {
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
                const FALLBACK_M: f64 = 1.3;
                self.stands_before_target = true;
                let stand = stand_before(
                    &object.bounds,
                    &self.reach_from(&here),
                    self.world.floor_m + self.world.camera_height_m(),
                    self.config.stop_distance_m - 0.15,
                    FALLBACK_M,
                    &|eye, thing| self.world.is_clear(eye, thing),
                    &|point| self.world.navigation.lacking_m(point),
                );
                if let Some(stand) = stand {
                    return Some(Goal::Reach {
                        target: stand.at,
                        tolerance_m: 0.2,
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
                Some(Goal::Reach { target: room.center.xy(), tolerance_m: 1.0, heading_rad: None })
            }
            Action::TurnTo(octant) => {
                let (_, _, yaw_rad) = odometry.world_from_body.rotation.euler_angles();
                Some(Goal::Turn { heading_rad: yaw_rad + octant.heading_rad() })
            }
            Action::Stop(_) | Action::GiveUp { .. } => None,
        }
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

    /// What is known now, in the form that a reasoner may keep.
    fn snapshot(&mut self) -> Option<Snapshot> {
        let odometry = self.world.odometry?;
        let here = Point2::from(odometry.world_from_body.translation.vector.xy());
        self.remember_room(&odometry.world_from_body);
        let now_s = self.seconds(odometry.stamp);
        let reach = self.reach_from(&here);
        let graph = self.world.graph.snapshot();
        let eye_m = self.world.floor_m + self.world.camera_height_m();
        let eye = Point3::new(here.x, here.y, eye_m);
        const BEST_EFFORT_M: f64 = 1.35;
        let my_room = graph.room_at(&Point3::from(odometry.world_from_body.translation.vector));
        let stoppable = graph
            .objects()
            .filter(|object| {
                let distance_m = floor_distance_m(&object.bounds, &here);
                let has_arrived = self.memory.inspected.contains(&object.id);
                let is_visible =
                    || self.world.is_clear(&eye, &in_front_of(&eye, &object.bounds.center(), &object.bounds));
                // Behind clutter in the same room is as good as visible, behind a wall is not.
                let is_in_my_room = || object.room.is_some() && object.room == my_room;
                let limit_m = if has_arrived { BEST_EFFORT_M } else { self.config.stop_distance_m };
                distance_m <= limit_m && (is_visible() || (has_arrived && is_in_my_room()))
            })
            .map(|object| object.id)
            .collect();
        let frontiers = graph.frontiers().map(|place| place.id).collect();
        Some(Snapshot {
            world_from_body: odometry.world_from_body,
            instruction: self.instruction.clone(),
            step_index: self.step_index,
            // One height for every robot, or two robots at one pose would split the same room differently.
            camera_height_m: self.config.prompt.camera_height_m,
            reach,
            beside_m: if self.memory.reprieves == 0 { BESIDE_M } else { IN_VIEW_M },
            stoppable,
            frontiers,
            visited: self.memory.visited.clone(),
            inspected: self.memory.inspected.clone(),
            rejected: self
                .memory
                .rejected
                .iter()
                .filter(|failure| failure.until_s > now_s)
                .map(|failure| failure.critique.clone())
                .collect(),
            stop_distance_m: self.config.stop_distance_m,
            asked_from: self.asked_from,
            last_action: match &self.target {
                Target::Action(action) => Some(action.clone()),
                Target::None => None,
            },
            graph,
        })
    }

    fn reach_from(&self, here: &Point2<f64>) -> ReachMap {
        ReachMap::new(&self.world.navigation.grid, here, self.world.navigation.clearance_m())
    }

    fn remember_room(&mut self, world_from_body: &Isometry3<f64>) {
        let at = Point3::from(world_from_body.translation.vector);
        if let Some(room) = self.world.graph.room_at(&at)
            && !self.memory.visited.contains(&room)
        {
            self.memory.visited.push(room);
        }
    }

    fn entry(&self, t_s: f64, asked_s: f64, revision: u64, pose: [f64; 4], answer: &Answer) -> DecisionEntry {
        let record = &answer.record;
        let reply = record.reply.as_ref();
        // Each try of a model sends the prompt again; the embedded reasoner reads it once.
        let sent = record.attempts.iter().filter(|attempt| attempt.by == record.attempts[0].by).count().max(1);
        let received = |attempt: &Attempt| match &attempt.outcome {
            Ok(reply) => (reply.text.clone(), reply.answer_tokens.unwrap_or_else(|| Estimate.count(&reply.text))),
            Err(error) => (format!("({error})"), 0),
        };
        let replies: Vec<(String, usize)> = record.attempts.iter().map(received).collect();
        DecisionEntry {
            index: self.journal.decisions.len(),
            asked_s,
            decided_s: t_s,
            revision,
            verdict_revision: revision,
            step: self.step_index,
            reasoner: record.decided_by.clone(),
            prompt: answer.prompt.text.clone(),
            prompt_tokens: answer.prompt.tokens * sent,
            answer_tokens: replies.iter().map(|(_, tokens)| tokens).sum(),
            replies: replies.into_iter().map(|(text, _)| text).collect(),
            trace: reply
                .into_iter()
                .flat_map(|reply| &reply.trace)
                .map(|step| TraceEntry {
                    step: step.step.word().to_owned(),
                    input: step.input.clone(),
                    output: step.output.clone(),
                })
                .collect(),
            action: reply.map_or_else(|| "hold".to_owned(), |reply| reply.action.text(&answer.prompt.names)),
            verdicts: record.objections().map(|critique| format!("rejected: {}", critique.message)).collect(),
            is_fallback: record.is_fallback,
            confidence: reply.map_or(0.0, |reply| reply.confidence),
            pose,
        }
    }
}

/// Who reasons for a mission.
pub enum Mind {
    /// Answers at once; its delay is a number, so that a replay gives the same bytes.
    Embedded(Box<dyn Reasoner + Send>),
    /// Takes its time in another thread.
    Remote(Box<dyn Reasoner + Send>),
}
