//! A language model as the reasoner: the prompt goes out, one action comes back, whatever else comes is refused.

use octant_prompt::{Critique, Prompt, Reasoner, ReasonerError, Reply, Situation, messages, parse_reply};

use crate::openai::{ChatConfig, ChatError, chat};

/// Asks an OpenAI-compatible server. Bounded in time, size and number of requests by its [`ChatConfig`].
#[derive(Debug, Clone)]
pub struct LlmReasoner {
    config: ChatConfig,
    name: String,
    /// The last failure in words, for the report.
    pub last_error: Option<ChatError>,
}

impl LlmReasoner {
    /// A model on a server.
    pub fn new(config: ChatConfig) -> Self {
        Self { name: config.model.clone(), config, last_error: None }
    }
}

impl Reasoner for LlmReasoner {
    fn decide(&mut self, _: &Situation, prompt: &Prompt, critiques: &[Critique]) -> Result<Reply, ReasonerError> {
        let user = messages::user_text(prompt, critiques);
        let schema = messages::reply_schema(&prompt.names);
        match chat(&self.config, messages::system_text(), &user, Some(&schema)) {
            Ok(answer) => {
                let mut reply = parse_reply(&answer.text, &prompt.names)?;
                reply.answer_tokens = answer.answer_tokens;
                Ok(reply)
            }
            Err(error) => {
                let failure = match error {
                    ChatError::Timeout(_) => ReasonerError::TimedOut,
                    _ => ReasonerError::Unreachable,
                };
                self.last_error = Some(error);
                Err(failure)
            }
        }
    }

    fn name(&self) -> &str {
        &self.name
    }
}
