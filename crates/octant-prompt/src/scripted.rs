//! A reasoner that reads its replies from a list: tests, and the replay of recorded runs.

use std::collections::VecDeque;

use crate::critic::Critique;
use crate::prompt::Prompt;
use crate::reasoner::{Reasoner, ReasonerError, Reply};
use crate::reply::parse_reply;
use crate::situation::Situation;

/// Gives its texts in order, parsed against each prompt as a model's would be.
#[derive(Debug, Clone, Default)]
pub struct ScriptedReasoner {
    texts: VecDeque<String>,
}

impl ScriptedReasoner {
    /// A script.
    pub fn new(texts: impl IntoIterator<Item = impl Into<String>>) -> ScriptedReasoner {
        ScriptedReasoner { texts: texts.into_iter().map(Into::into).collect() }
    }

    /// Texts not yet given.
    pub fn remaining(&self) -> usize {
        self.texts.len()
    }
}

impl Reasoner for ScriptedReasoner {
    fn decide(
        &mut self,
        _situation: &Situation,
        prompt: &Prompt,
        _critiques: &[Critique],
    ) -> Result<Reply, ReasonerError> {
        let text = self.texts.pop_front().ok_or(ReasonerError::ScriptEnded)?;
        Ok(parse_reply(&text, &prompt.names)?)
    }

    fn name(&self) -> &str {
        "scripted"
    }
}
