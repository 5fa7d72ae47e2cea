//! The actor-critic loop: propose, check, retry with the objection, fall back. No action leaves it unverified.

use crate::critic::{Critic, Critique, CritiqueCode};
use crate::prompt::Prompt;
use crate::reasoner::{Reasoner, ReasonerError, Reply};
use crate::situation::Situation;

/// One decision with everything that led to it.
#[derive(Debug, Clone, PartialEq)]
pub struct DecisionRecord {
    /// The verified reply; None if neither the reasoner nor the fallback had one: the robot holds.
    pub reply: Option<Reply>,
    /// All attempts, in order.
    pub attempts: Vec<Attempt>,
    /// Who gave the reply.
    pub decided_by: String,
    /// True if the reasoner's attempts were used up.
    pub is_fallback: bool,
}

/// One attempt.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// Who.
    pub by: String,
    /// What came.
    pub outcome: Result<Reply, ReasonerError>,
    /// The objection; None for the accepted attempt.
    pub objection: Option<Critique>,
}

impl DecisionRecord {
    /// The objections, in order.
    pub fn objections(&self) -> impl Iterator<Item = &Critique> {
        self.attempts.iter().filter_map(|attempt| attempt.objection.as_ref())
    }
}

/// Asks `reasoner` up to `1 + max_retries` times, each time with the objections so far, then `fallback` once. A model that cannot be
/// reached or is late is not asked again in this decision.
pub fn decide_with_critic(
    reasoner: &mut dyn Reasoner,
    critic: &Critic,
    situation: &Situation,
    prompt: &Prompt,
    max_retries: usize,
    fallback: &mut dyn Reasoner,
) -> DecisionRecord {
    let mut attempts = Vec::new();
    let mut critiques = Vec::new();
    for _ in 0..=max_retries {
        let outcome = attempt(reasoner, critic, situation, prompt, &mut critiques, &mut attempts);
        if let Some(reply) = outcome {
            return DecisionRecord {
                reply: Some(reply),
                attempts,
                decided_by: reasoner.name().to_string(),
                is_fallback: false,
            };
        }
        let hopeless = matches!(
            attempts.last().map(|attempt| &attempt.outcome),
            Some(Err(ReasonerError::Unreachable
                | ReasonerError::TimedOut
                | ReasonerError::ScriptEnded
                | ReasonerError::NoSuchStep(_)))
        );
        if hopeless {
            break;
        }
    }
    let reply = attempt(fallback, critic, situation, prompt, &mut critiques, &mut attempts);
    DecisionRecord { reply, attempts, decided_by: fallback.name().to_string(), is_fallback: true }
}

fn attempt(
    reasoner: &mut dyn Reasoner,
    critic: &Critic,
    situation: &Situation,
    prompt: &Prompt,
    critiques: &mut Vec<Critique>,
    attempts: &mut Vec<Attempt>,
) -> Option<Reply> {
    let outcome = reasoner.decide(situation, prompt, critiques);
    let objection = match &outcome {
        Ok(reply) => critic.check(&reply.action, situation, prompt.revision).err(),
        Err(error) => Some(Critique { code: CritiqueCode::Unparsable, action: None, message: error.to_string() }),
    };
    let accepted = if objection.is_none() { outcome.as_ref().ok().cloned() } else { None };
    critiques.extend(objection.clone());
    attempts.push(Attempt { by: reasoner.name().to_string(), outcome, objection });
    accepted
}
