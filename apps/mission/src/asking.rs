//! "Which one?": the robot asks when what it heard fits several things, holds while it waits, and takes the answer like any other order.
//!
//! Asked is only where somebody can answer ([`Control::AskMe`]). Question and answer stand in the
//! journal, so that a run can be repeated. The sentence and the reading of the answer are the prompt crate's
//! ([`mod@octant_prompt::which_one`]).

use dsg::ObjectId;
use nalgebra::Point3;
use octant_prompt::lexicon::{Mark, tokens};
use octant_prompt::vocabulary::{Class, class_similarity};
use octant_prompt::{
    Action, Meant, Referring, Target, WhichOne, candidates, parse_instruction, read_answer, which_one,
};
use omni_perception::Stamp;
use serde::Serialize;

use crate::mission::{Mission, Outcome};
use crate::snapshot::Snapshot;
use crate::steering::{Control, ControlError};

/// So long the robot holds for an answer before it goes to any of them.
const PATIENCE_S: f64 = 60.0;
/// So often it asks about one step.
const MOST_QUESTIONS: u32 = 3;

/// A question that waits for its answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// When it was asked, seconds since the mission began.
    pub t_s: f64,
    /// The sentence, and the things it names.
    pub which: WhichOne,
    /// The entry in [`crate::journal::Journal::decisions`] that holds it.
    entry: usize,
}

/// A question in the journal.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct QuestionEntry {
    /// The sentence.
    pub text: String,
    /// What it names: ids and descriptions.
    pub things: Vec<(String, String)>,
    /// What somebody answered; none if nobody did in time.
    pub answer: Option<String>,
    /// What the robot made of it.
    pub meaning: String,
}

/// The thing that somebody said is meant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen {
    id: ObjectId,
    /// Where it was seen last: ids change when things are told apart or put together.
    at: Point3<f64>,
}

impl Mission {
    /// The question that waits for an answer.
    pub fn question(&self) -> Option<&Question> {
        self.question.as_ref()
    }

    /// How often it has asked.
    pub fn questions_asked(&self) -> usize {
        self.journal.decisions.iter().filter(|decision| decision.question.is_some()).count()
    }

    /// How often about the present instruction.
    pub fn questions_about_this(&self) -> usize {
        self.questions_asked() - self.asked_before
    }

    /// What a line means while a question waits: an answer to it, unless it names another thing to go to.
    pub fn understood(&self, control: Control) -> Control {
        let (Some(_), Control::Instruct(text)) = (&self.question, &control) else { return control };
        let is_order =
            tokens(text, &|_| false).first().is_some_and(|first| matches!(first.mark, Mark::Verb | Mark::Enter));
        let names_a_thing = parse_instruction(text).steps.first().is_some_and(|step| !step.goal.class.is_wildcard());
        if is_order && names_a_thing { control } else { Control::Answer(text.clone()) }
    }

    /// From now on somebody answers.
    pub(crate) fn ask_me(&mut self) {
        self.may_ask = true;
    }

    /// The chosen thing as it is known now.
    pub(crate) fn meant(&mut self) -> Option<ObjectId> {
        const MOVED_M: f64 = 0.5;
        let chosen = self.memory.chosen?;
        let class = self.instruction.steps.get(self.step_index).map(|step| step.goal.class.clone())?;
        let graph = &self.world.graph;
        let off_m = |object: &dsg::Object| (object.centroid - chosen.at).norm();
        let is_like_it = |object: &&dsg::Object| {
            off_m(object) < MOVED_M && class_similarity(&class, &Class::new(&object.label)) >= MOVED_M
        };
        let now = graph.object(chosen.id).or_else(|| {
            graph.objects().filter(is_like_it).min_by(|a, b| off_m(a).total_cmp(&off_m(b)).then(a.id.cmp(&b.id)))
        });
        self.memory.chosen = now.map(|object| Chosen { id: object.id, at: object.centroid });
        self.memory.chosen.map(|chosen| chosen.id)
    }

    /// Asks instead of doing `action`, if that goes to one of several things that are meant as much. The last decision of the journal
    /// is the one that the question belongs to.
    pub(crate) fn asks_first(&mut self, action: &Action, now: &Snapshot, t_s: f64) -> bool {
        let (Action::GoNear(id) | Action::Stop(Target::Object(id))) = action else { return false };
        if !self.may_ask || self.memory.any_will_do || self.memory.chosen.is_some() {
            return false;
        }
        let grounding = &self.critic.grounding;
        let equals = now.with_situation(|situation| candidates(situation, grounding).equals);
        if equals.len() < 2 || !equals.contains(id) {
            return false;
        }
        let which = now.with_situation(|situation| which_one(situation, grounding, &equals));
        self.put_question(which, t_s);
        true
    }

    fn put_question(&mut self, which: WhichOne, t_s: f64) {
        self.memory.questions += 1;
        self.journal.notes.push((t_s, format!("asks: {}", which.text)));
        let things = which.things.iter().map(|(id, words)| (id.to_string(), words.clone())).collect();
        if let Some(decision) = self.journal.decisions.last_mut() {
            let text = which.text.clone();
            decision.question = Some(QuestionEntry { text, things, ..QuestionEntry::default() });
        }
        let entry = self.journal.decisions.len().saturating_sub(1);
        self.question = Some(Question { t_s, which, entry });
        self.drop_goal();
    }

    /// Nobody answers for ever: then any of them will do.
    pub(crate) fn wait_for_answer(&mut self, t_s: f64) {
        let Some(question) = self.question.take_if(|question| t_s - question.t_s > PATIENCE_S) else { return };
        self.note_answer(&question, None, "nobody answered; it goes to any".into());
        self.memory.any_will_do = true;
        self.next_decision_s = t_s;
    }

    /// Takes the answer to the question that waits.
    pub(crate) fn hear_answer(&mut self, text: &str, now: Stamp) -> Result<(), ControlError> {
        let t_s = self.seconds(now);
        let Some(question) = self.question.take() else { return Err(ControlError::NothingAsked) };
        let Some(snapshot) = self.snapshot() else {
            self.question = Some(question);
            return Err(ControlError::NothingAsked);
        };
        let listed: Vec<ObjectId> = question.which.things.iter().map(|(id, _)| *id).collect();
        let grounding = self.critic.grounding.clone();
        let meant = snapshot.with_situation(|situation| read_answer(text, &listed, situation, &grounding));
        self.next_decision_s = t_s;
        let again = match meant {
            Meant::One(id) => match self.world.graph.object(id).map(|object| object.centroid) {
                Some(at) => {
                    self.memory.chosen = Some(Chosen { id, at });
                    self.note_answer(&question, Some(text), format!("it goes to {id}"));
                    return Ok(());
                }
                None => listed, // gone meanwhile
            },
            Meant::Any => {
                self.memory.any_will_do = true;
                self.note_answer(&question, Some(text), "any will do".into());
                return Ok(());
            }
            Meant::Other(goal) if !snapshot.search_is_over(&self.critic) => {
                self.note_answer(&question, Some(text), "none of those; it looks on".into());
                self.refine(*goal);
                return Ok(());
            }
            Meant::Several(some) => some,
            Meant::Other(_) | Meant::Unclear => listed,
        };
        let again: Vec<ObjectId> = again.into_iter().filter(|id| self.world.graph.object(*id).is_some()).collect();
        if self.memory.questions >= MOST_QUESTIONS || again.is_empty() {
            self.note_answer(&question, Some(text), "not understood".into());
            let class =
                self.instruction.steps.get(self.step_index).map_or_else(String::new, |step| step.goal.to_string());
            let reason = format!(
                "I asked {} times which {class} is meant, and none that I know answers to \"{text}\".",
                self.memory.questions
            );
            self.finish(Outcome::GaveUp { reason });
            return Ok(());
        }
        let is_narrower = again.len() < question.which.things.len();
        let meaning = if is_narrower { "it fits more than one" } else { "not understood" };
        self.note_answer(&question, Some(text), format!("{meaning}; it asks again"));
        let mut which = snapshot.with_situation(|situation| which_one(situation, &grounding, &again));
        if !is_narrower {
            which.text = format!("None that I know answers to \"{text}\". {}", which.text);
        }
        // The new question stands with the decision of the first, as a decision of its own would have no prompt.
        let repeated = self.journal.decisions.get(question.entry).cloned();
        self.journal.decisions.extend(repeated.map(|decision| crate::journal::DecisionEntry {
            index: self.journal.decisions.len(),
            decided_s: t_s,
            prompt_tokens: 0,
            answer_tokens: 0,
            ..decision
        }));
        self.put_question(which, t_s);
        Ok(())
    }

    /// The step with what an answer added.
    fn refine(&mut self, goal: Referring) {
        if let Some(step) = self.instruction.steps.get_mut(self.step_index) {
            step.goal = goal;
        }
        self.nouns = self.instruction.nouns().iter().map(|noun| Class::new(noun)).collect();
        self.interest.clear();
    }

    fn note_answer(&mut self, question: &Question, answer: Option<&str>, meaning: String) {
        let entry = self.journal.decisions.get_mut(question.entry).and_then(|decision| decision.question.as_mut());
        if let Some(entry) = entry {
            entry.answer = answer.map(str::to_owned);
            entry.meaning = meaning;
        }
    }
}
