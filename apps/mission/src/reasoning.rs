//! The mind of the mission: when to think, what about, and what becomes of the answer.
//!
//! The reasoner gets a snapshot and is never waited for. Its answer is verified twice: against the snapshot by the loop of
//! actor and critic, and again at the revision of the graph at which it comes in.

use std::sync::mpsc::{Receiver, TryRecvError};

use octant_prompt::vocabulary::{Class, class_similarity};
use octant_prompt::{
    Action, Attempt, Critique, CritiqueCode, Estimate, Prompt, Reasoner, ReasonerError, Reply, Situation,
    SymbolicReasoner, TokenCounter, parse_reply,
};

use crate::acting::Target;
use crate::goal::{Goal, GoalStatus};
use crate::journal::{DecisionEntry, TraceEntry};
use crate::mission::{Mission, Outcome};
use crate::snapshot::Answer;
use crate::standstill::{STUCK_S, Standstill};

/// A question that has been asked.
pub struct Pending {
    asked_s: f64,
    revision: u64,
    pose: [f64; 4],
    answer: Waiting,
    /// Nobody wants the answer any more; a model that is thinking is waited for all the same, for there is one of it.
    is_dropped: bool,
}

#[allow(clippy::large_enum_variant)] // there is one of it
enum Waiting {
    /// The embedded reasoner has answered; the answer counts from this time on.
    Due(f64, Box<Answer>),
    /// In an earlier run nobody waited for the answer.
    Never,
    /// A model is thinking in another thread; it gives itself back with the answer.
    Thread(Receiver<(Box<dyn Reasoner + Send>, Answer)>),
}

impl Mission {
    /// Whether something happened that calls for a decision.
    pub(crate) fn must_think(&mut self, t_s: f64) -> bool {
        if self.pending.is_some() || t_s < self.next_decision_s {
            return false;
        }
        let stood_s = self.has_stood_s(t_s);
        match *self.body.status() {
            GoalStatus::Arrived => {
                // Before a thing, the robot looks at it for a moment: a few more images settle its label and its place.
                if self.stands_before_target && matches!(self.target, Target::Action(Action::GoNear(_))) {
                    let since_s = *self.arrived_s.get_or_insert(t_s);
                    if t_s - since_s < self.config.close_look_s {
                        return false;
                    }
                }
                // Who came to look for something looks round first, if it has to turn for that.
                if matches!(self.target, Target::Action(Action::Explore(_)))
                    && !self.sees_all_round()
                    && !self.has_looked
                {
                    self.has_looked = true;
                    self.look_round(t_s);
                    return false;
                }
                self.has_looked = false;
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
            GoalStatus::Underway if stood_s > STUCK_S => {
                self.failed("it stands still on the way");
                // What comes next has its own time.
                self.standstill = Standstill::default();
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

    /// How long the body has been standing although it is under way.
    pub(crate) fn has_stood_s(&mut self, t_s: f64) -> f64 {
        let Some(odometry) = &self.world.odometry else { return 0.0 };
        let pose = &odometry.world_from_body;
        let yaw_rad = pose.rotation.euler_angles().2;
        let is_underway = *self.body.status() == GoalStatus::Underway;
        self.standstill.seconds(t_s, pose.translation.vector.xy().into(), yaw_rad, is_underway)
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

    /// Asks for a decision on a snapshot of what is known now.
    pub(crate) fn ask(&mut self, t_s: f64) {
        let Some(mut snapshot) = self.snapshot() else { return };
        if snapshot.search_is_over(&self.critic) && self.revive_search(t_s) {
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
                let link = &mut self.link;
                let (answer, due_s) = self.journal.clock.time("reasoning", || match link {
                    Some(link) => {
                        let mut far = link.to(reasoner.as_mut(), t_s);
                        let answer = snapshot.decide(&mut far, critic, config);
                        (answer, far.done_s())
                    }
                    None => (snapshot.decide(reasoner.as_mut(), critic, config), t_s + config.reasoning_latency_s),
                });
                if let Some(trouble) = reasoner.take_trouble() {
                    self.journal.notes.push((t_s, trouble));
                }
                self.reasoner = Some(Mind::Embedded(reasoner));
                Waiting::Due(due_s, Box::new(answer))
            }
            Some(Mind::Recorded(recorded)) => {
                let (critic, config) = (&self.critic, &self.config);
                // A question whose answer nobody wanted any more has none.
                let waiting = recorded.iter().find(|decision| (decision.asked_s - t_s).abs() < 1e-6).map(|decision| {
                    let mut reasoner = Recorded { name: &decision.name, replies: decision.replies.iter() };
                    Waiting::Due(decision.decided_s, Box::new(snapshot.decide(&mut reasoner, critic, config)))
                });
                self.reasoner = Some(Mind::Recorded(recorded));
                waiting.unwrap_or(Waiting::Never)
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
        self.pending = Some(Pending { asked_s: t_s, revision, pose, answer, is_dropped: false });
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
        let Pending { asked_s, revision, pose, answer, is_dropped } = pending;
        let answer = match answer {
            Waiting::Due(due_s, answer) if t_s >= due_s => *answer,
            Waiting::Due(..) | Waiting::Never => {
                self.pending = Some(Pending { asked_s, revision, pose, answer, is_dropped });
                return;
            }
            Waiting::Thread(receiver) => match receiver.try_recv() {
                Ok((mut reasoner, answer)) => {
                    if let Some(trouble) = reasoner.take_trouble() {
                        self.journal.notes.push((t_s, trouble));
                    }
                    self.reasoner = Some(Mind::Remote(reasoner));
                    answer
                }
                Err(TryRecvError::Empty) => {
                    let answer = Waiting::Thread(receiver);
                    self.pending = Some(Pending { asked_s, revision, pose, answer, is_dropped });
                    return;
                }
                Err(TryRecvError::Disconnected) => {
                    self.journal.notes.push((t_s, "the reasoner died; the embedded one goes on".into()));
                    self.reasoner = Some(Mind::Embedded(Box::new(SymbolicReasoner::default())));
                    return;
                }
            },
        };
        if is_dropped {
            return;
        }
        let Some(now) = self.snapshot() else { return };
        let mut entry = self.entry(t_s, asked_s, revision, pose, &answer);
        entry.verdict_revision = now.graph.revision();
        let Some(action) = answer.record.reply.as_ref().map(|reply| reply.action.clone()) else {
            entry.verdicts.push("no proposal was accepted; the robot holds".into());
            self.journal.decisions.push(entry);
            self.unsure += 1;
            const PATIENCE: u32 = 20;
            if self.unsure >= PATIENCE {
                // Nobody could be agreed with, and yet there is somewhere to look: there, before anything is given up.
                if let Some(place) = now.places_left(&self.critic).first().copied() {
                    self.unsure = 0;
                    self.act(Action::Explore(place), t_s);
                    return;
                }
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
                if !self.asks_first(&action, &now, t_s) {
                    self.act(action, t_s);
                }
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

    /// The question that was asked, if any, is about something that nobody wants any more.
    pub(crate) fn drop_question(&mut self) {
        match &mut self.pending {
            Some(Pending { answer: Waiting::Thread(_), is_dropped, .. }) => *is_dropped = true,
            pending => *pending = None,
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
            question: None,
        }
    }
}

/// Who reasons for a mission.
pub enum Mind {
    /// The simulated world waits for it; its delay is a number, so that a replay gives the same bytes.
    Embedded(Box<dyn Reasoner + Send>),
    /// Takes its time in another thread.
    Remote(Box<dyn Reasoner + Send>),
    /// Says what it said in an earlier run, and when: for its replay.
    Recorded(Vec<RecordedDecision>),
}

/// What a model said to one question of an earlier run.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedDecision {
    /// When it was asked.
    pub asked_s: f64,
    /// When the answer came in.
    pub decided_s: f64,
    /// Its replies, one for each try; `None` where none came or it could not be read.
    pub replies: Vec<Option<String>>,
    /// Its name.
    pub name: String,
}

/// The replies of one decision.
struct Recorded<'a> {
    name: &'a str,
    replies: std::slice::Iter<'a, Option<String>>,
}

impl Reasoner for Recorded<'_> {
    fn decide(&mut self, _: &Situation, prompt: &Prompt, _: &[Critique]) -> Result<Reply, ReasonerError> {
        match self.replies.next() {
            Some(Some(text)) => Ok(parse_reply(text, &prompt.names)?),
            Some(None) | None => Err(ReasonerError::Unreachable),
        }
    }

    fn name(&self) -> &str {
        self.name
    }
}
