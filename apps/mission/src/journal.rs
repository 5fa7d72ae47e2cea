//! What happened, for people and for replay: every decision in full, and curves over time.

use serde::Serialize;

use crate::asking::QuestionEntry;
use crate::stage_clock::StageClock;
use crate::steering::ControlEntry;

/// One decision from prompt to verdict. Serialised as one line of `decisions.jsonl`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DecisionEntry {
    /// Running number from 0.
    pub index: usize,
    /// Seconds since the mission began at which the snapshot was taken.
    pub asked_s: f64,
    /// ... and at which the verdict fell.
    pub decided_s: f64,
    /// Revision of the scene graph in the prompt.
    pub revision: u64,
    /// Revision at which the verdict was given.
    pub verdict_revision: u64,
    /// Which step of the instruction it serves.
    pub step: usize,
    /// Who answered.
    pub reasoner: String,
    /// Full text sent.
    pub prompt: String,
    /// Its tokens.
    pub prompt_tokens: usize,
    /// Full text received, of all tries.
    pub replies: Vec<String>,
    /// Tokens received.
    pub answer_tokens: usize,
    /// The four steps of the reasoning, as `(step, input, output)`.
    pub trace: Vec<TraceEntry>,
    /// The accepted action.
    pub action: String,
    /// `accepted`, or why a proposal was rejected, one line each.
    pub verdicts: Vec<String>,
    /// True if the embedded reasoner had to take the step for a language model.
    pub is_fallback: bool,
    /// Confidence of the reasoner, 0 to 1.
    pub confidence: f64,
    /// Where the robot believed to be: x, y, z, yaw.
    pub pose: [f64; 4],
    /// What it asked instead of doing it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub question: Option<QuestionEntry>,
}

/// One line of a reasoning trace.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TraceEntry {
    /// Name of the step.
    pub step: String,
    /// What it looked at.
    pub input: String,
    /// What it concluded.
    pub output: String,
}

/// A sample of the curves of a run: five a second, and fewer in long runs ([`Journal::sample`]).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct CurveSample {
    /// Seconds since the mission began.
    pub t_s: f64,
    /// Estimated position and heading.
    pub pose: [f64; 4],
    /// Estimated speed.
    pub speed_mps: f64,
    /// Distance from the robot's outline to the nearest obstacle of the last scans.
    pub clearance_m: f64,
    /// Tokens sent so far.
    pub prompt_tokens: usize,
    /// Objects in the graph.
    pub objects: usize,
    /// Rooms in the graph.
    pub rooms: usize,
}

/// Everything that the robot's side writes down.
#[derive(Debug, Clone, Default)]
pub struct Journal {
    /// Decisions in order.
    pub decisions: Vec<DecisionEntry>,
    /// Curves.
    pub curves: Vec<CurveSample>,
    /// Between two samples of the curves is so much more time than at the beginning: a power of two.
    pub thinned: u32,
    /// Where the time went.
    pub clock: StageClock,
    /// What people said while it ran, in order.
    pub controls: Vec<ControlEntry>,
    /// Things worth telling a person, with their time: a sensor that was ignored, a model that did not answer.
    pub notes: Vec<(f64, String)>,
}

/// More samples than this no picture shows.
const MOST_SAMPLES: usize = 8192;

impl Journal {
    /// Adds a sample to the curves. From 8192 on every second one goes and the next ones come half as often, so that a patrol of days
    /// needs no more memory than one of an hour.
    pub fn sample(&mut self, sample: CurveSample) {
        self.curves.push(sample);
        if self.curves.len() >= MOST_SAMPLES {
            let mut index = 0;
            self.curves.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.thinned += 1;
        }
    }

    /// Tokens sent in all prompts.
    pub fn prompt_tokens(&self) -> usize {
        self.decisions.iter().map(|decision| decision.prompt_tokens).sum()
    }

    /// Tokens received in all answers.
    pub fn answer_tokens(&self) -> usize {
        self.decisions.iter().map(|decision| decision.answer_tokens).sum()
    }
}
