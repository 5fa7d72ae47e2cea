//! Who decides: the trait behind which a rule-based reasoner, a recorded script and a language model stand.

use crate::action::Action;
use crate::critic::Critique;
use crate::prompt::Prompt;
use crate::reply::ReplyError;
use crate::situation::Situation;

/// Decides on the next action from a situation and the prompt that describes it.
///
/// Implementations: [`crate::SymbolicReasoner`] (default), [`crate::ScriptedReasoner`] (tests, replay), and the HTTP client of the apps.
pub trait Reasoner {
    /// One decision. `critiques` are the objections to the earlier attempts of this very decision.
    ///
    /// # Errors
    /// When no action could be obtained; the caller retries or falls back.
    fn decide(
        &mut self,
        situation: &Situation,
        prompt: &Prompt,
        critiques: &[Critique],
    ) -> Result<Reply, ReasonerError>;

    /// A short name for logs.
    fn name(&self) -> &str;

    /// What went wrong during the last decision, as a sentence for people; a reasoner that asks nobody has nothing to say.
    fn take_trouble(&mut self) -> Option<String> {
        None
    }
}

/// An action with its reasons.
#[derive(Debug, Clone, PartialEq)]
pub struct Reply {
    /// The action; not yet verified.
    pub action: Action,
    /// The four steps of the hierarchical chain of thought.
    pub trace: Vec<TraceStep>,
    /// How sure, in [0, 1]: for the symbolic reasoner the margin between best and second candidate.
    pub confidence: f64,
    /// The raw answer; for the symbolic reasoner the trace as text.
    pub text: String,
    /// Tokens of the answer, if the model reported them.
    pub answer_tokens: Option<usize>,
}

impl Reply {
    /// True when the action, once verified, ends the present step.
    pub fn completes_step(&self) -> bool {
        matches!(self.action, Action::Stop(_))
    }
}

/// One step of the chain of thought.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceStep {
    /// Which.
    pub step: ReasoningStep,
    /// What it looked at.
    pub input: String,
    /// What it found.
    pub output: String,
}

/// The four steps of OmniVLN section III-C.2, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ReasoningStep {
    /// Rooms that are reachable and fit the description.
    RoomFiltering,
    /// The octant of the next motion.
    Orientation,
    /// Places where such a thing is usual.
    FunctionalGroup,
    /// One node, or a short list.
    Localisation,
}

impl ReasoningStep {
    /// The word in logs: `room filtering`, ...
    pub fn word(self) -> &'static str {
        match self {
            ReasoningStep::RoomFiltering => "room filtering",
            ReasoningStep::Orientation => "orientation",
            ReasoningStep::FunctionalGroup => "functional group",
            ReasoningStep::Localisation => "localisation",
        }
    }
}

/// Why no action came.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReasonerError {
    /// The answer was no action.
    #[error("unusable reply: {0}")]
    Reply(#[from] ReplyError),
    /// The model could not be reached, or answered with an error.
    #[error("the model is unreachable")]
    Unreachable,
    /// The model took longer than allowed.
    #[error("the model did not answer in time")]
    TimedOut,
    /// A script has no line left.
    #[error("the script has ended")]
    ScriptEnded,
    /// The instruction has no such step.
    #[error("the instruction has no step {0}")]
    NoSuchStep(usize),
}
