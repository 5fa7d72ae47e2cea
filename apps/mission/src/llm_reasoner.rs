//! A language model as the reasoner: the prompt goes out, one action comes back, whatever else comes is refused.

use octant_prompt::{Critique, Prompt, Reasoner, ReasonerError, Reply, Situation, messages, parse_reply};

use crate::openai::{ChatConfig, ChatError, chat};

/// Asks an OpenAI-compatible server. Bounded in time, size and number of requests by its [`ChatConfig`].
#[derive(Debug, Clone)]
pub struct LlmReasoner {
    config: ChatConfig,
    name: String,
    /// The last failure since somebody asked.
    trouble: Option<ChatError>,
}

impl LlmReasoner {
    /// A model on a server.
    pub fn new(config: ChatConfig) -> Self {
        Self { name: config.model.clone(), config, trouble: None }
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
                self.trouble = Some(error);
                Err(failure)
            }
        }
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn take_trouble(&mut self) -> Option<String> {
        self.trouble.take().map(|error| error.to_string())
    }
}
