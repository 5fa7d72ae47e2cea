//! A client for any OpenAI-compatible server: one blocking request with a deadline, a bounded body and a typed failure. [`chat`] sends
//! words, [`chat_about_picture`] words and a picture.
//!
//! Plain HTTP on purpose: such servers run on the robot or in the same building. What comes back is hostile until the
//! prompt crate has parsed and checked it.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};
use thiserror::Error;

use crate::http_post::{PostError, post_json};

/// Where the model is and how long we wait for it.
#[derive(Debug, Clone, PartialEq)]
pub struct ChatConfig {
    /// Up to and including the version, e.g. `http://127.0.0.1:8091/v1`.
    pub base_url: String,
    /// Name of the model on that server.
    pub model: String,
    /// Longest wait for one answer in seconds, default 20.
    pub timeout_s: f64,
    /// Requests for one answer, default 2: a second one if the first failed on the way.
    pub attempts: u32,
    /// Longest answer in tokens, default 300.
    pub max_answer_tokens: u32,
}

impl ChatConfig {
    /// Defaults for a server and a model.
    pub fn new(base_url: &str, model: &str) -> Self {
        Self {
            base_url: base_url.trim_end_matches('/').to_owned(),
            model: model.to_owned(),
            timeout_s: 20.0,
            attempts: 2,
            max_answer_tokens: 300,
        }
    }
}

/// Longest body that is read: an answer has a few hundred tokens.
pub(crate) const MAX_BODY_BYTES: u64 = 256 * 1024;

/// What the server said.
#[derive(Debug, Clone, PartialEq)]
pub struct ChatReply {
    /// Text of the first choice.
    pub text: String,
    /// Tokens as the server counted them, if it did.
    pub prompt_tokens: Option<usize>,
    /// Tokens of the answer, if the server counted them.
    pub answer_tokens: Option<usize>,
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ChatError {
    /// The address is not one of a plain HTTP server.
    #[error("'{0}' is no address of a language-model server; it looks like http://127.0.0.1:8091/v1")]
    Address(String),
    /// Nobody answers there, or the connection broke.
    #[error("the language-model server at {url} cannot be reached: {cause}")]
    Unreachable {
        /// The address asked.
        url: String,
        /// What the network said.
        cause: String,
    },
    /// It took longer than the deadline.
    #[error("the language-model server did not answer within {0} s")]
    Timeout(String),
    /// It answered with an error.
    #[error("the language-model server answered with status {status}: {body}")]
    Status {
        /// HTTP status.
        status: u16,
        /// Beginning of the body.
        body: String,
    },
    /// The body is not what the interface promises.
    #[error("the language-model server sent an answer that cannot be read: {0}")]
    Unreadable(&'static str),
}

/// Asks once: a system text, a user text, and optionally a JSON schema that the answer shall obey.
pub fn chat(config: &ChatConfig, system: &str, user: &str, schema: Option<&Value>) -> Result<ChatReply, ChatError> {
    send(config, system, json!(user), schema.map(|schema| ("action", schema)))
}

/// Asks once about a picture: the JPEG goes as a data URL beside the user text. `schema` has a name and the JSON schema.
pub fn chat_about_picture(
    config: &ChatConfig,
    system: &str,
    user: &str,
    jpeg: &[u8],
    schema: (&str, &Value),
) -> Result<ChatReply, ChatError> {
    let url = format!("data:image/jpeg;base64,{}", BASE64.encode(jpeg));
    let content = json!([{"type": "text", "text": user}, {"type": "image_url", "image_url": {"url": url}}]);
    send(config, system, content, Some(schema))
}

fn send(
    config: &ChatConfig,
    system: &str,
    content: Value,
    schema: Option<(&str, &Value)>,
) -> Result<ChatReply, ChatError> {
    if !config.base_url.starts_with("http://") {
        return Err(ChatError::Address(config.base_url.clone()));
    }
    let request = request_for(config, system, content, schema);
    let url = format!("{}/chat/completions", config.base_url);
    let mut last = ChatError::Unreadable("no request was made");
    for _ in 0..config.attempts.max(1) {
        match post_json(&url, &request, config.timeout_s, MAX_BODY_BYTES).map_err(|error| chat_error(error, config)) {
            Ok(body) => return read_reply(&body),
            // A refusal will be repeated; a broken connection may not be.
            Err(error @ ChatError::Status { status: 400..=499, .. }) => return Err(error),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// The body of a request.
pub(crate) fn request_for(config: &ChatConfig, system: &str, content: Value, schema: Option<(&str, &Value)>) -> Value {
    let mut request = json!({
        "model": config.model,
        "temperature": 0,
        "max_tokens": config.max_answer_tokens,
        "messages": [
            {"role": "system", "content": system},
            {"role": "user", "content": content},
        ],
    });
    if let Some((name, schema)) = schema {
        request["response_format"] =
            json!({"type": "json_schema", "json_schema": {"name": name, "strict": true, "schema": schema}});
    }
    request
}

/// What went wrong on the way, in the words of a chat.
pub(crate) fn chat_error(error: PostError, config: &ChatConfig) -> ChatError {
    match error {
        PostError::Address(address) => ChatError::Address(address),
        PostError::Unreachable { url, cause } => ChatError::Unreachable { url, cause },
        PostError::Timeout(_) => ChatError::Timeout(format!("{:.0}", config.timeout_s)),
        PostError::Status { status, body } => ChatError::Status { status, body },
        PostError::TooLong { .. } => ChatError::Unreadable("it is longer than 256 KiB"),
    }
}

pub(crate) fn read_reply(body: &[u8]) -> Result<ChatReply, ChatError> {
    let value: Value = serde_json::from_slice(body).map_err(|_| ChatError::Unreadable("it is not JSON"))?;
    let text = value
        .pointer("/choices/0/message/content")
        .and_then(Value::as_str)
        .ok_or(ChatError::Unreadable("it has no choices[0].message.content"))?;
    let count = |path: &str| value.pointer(path).and_then(Value::as_u64).map(|n| n as usize);
    Ok(ChatReply {
        text: text.to_owned(),
        prompt_tokens: count("/usage/prompt_tokens"),
        answer_tokens: count("/usage/completion_tokens"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpListener;
    use std::time::Duration;

    /// A server in this process that answers the next requests with the given bytes, then is gone.
    fn fake_server(answers: Vec<Vec<u8>>, delay: Duration) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            for answer in answers {
                let Ok((mut stream, _)) = listener.accept() else { return };
                // Head and body may come in two pieces: read until nothing more comes, or closing would reset the line.
                let mut buffer = [0_u8; 65536];
                let _ = stream.set_read_timeout(Some(Duration::from_millis(50)));
                while stream.read(&mut buffer).is_ok_and(|n| n > 0) {}
                std::thread::sleep(delay);
                let _ = stream.write_all(&answer);
            }
        });
        format!("http://{address}/v1")
    }

    fn http(status: &str, body: &str) -> Vec<u8> {
        format!("HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}", body.len())
            .into_bytes()
    }

    fn ask(url: &str, timeout_s: f64) -> Result<ChatReply, ChatError> {
        let config = ChatConfig { timeout_s, attempts: 1, ..ChatConfig::new(url, "test") };
        chat(&config, "system", "user", None)
    }

    #[test]
    fn a_good_answer_is_read() {
        let body = r#"{"choices":[{"message":{"content":"{\"action\":\"stop\"}"}}],"usage":{"prompt_tokens":12,"completion_tokens":5}}"#;
        let url = fake_server(vec![http("200 OK", body)], Duration::ZERO);
        let reply = ask(&url, 5.0).unwrap();
        assert_eq!(reply.text, r#"{"action":"stop"}"#);
        assert_eq!((reply.prompt_tokens, reply.answer_tokens), (Some(12), Some(5)));
    }

    #[test]
    fn every_failure_has_its_own_sentence() {
        assert!(matches!(ask("ftp://somewhere", 1.0), Err(ChatError::Address(_))));
        assert!(matches!(ask("http://127.0.0.1:9", 1.0), Err(ChatError::Unreachable { .. })));
        let url = fake_server(vec![http("500 Internal Server Error", "out of memory")], Duration::ZERO);
        assert!(matches!(ask(&url, 5.0), Err(ChatError::Status { status: 500, .. })));
        let url = fake_server(vec![http("200 OK", "<html>")], Duration::ZERO);
        assert_eq!(ask(&url, 5.0), Err(ChatError::Unreadable("it is not JSON")));
        let url = fake_server(vec![http("200 OK", "{}")], Duration::ZERO);
        assert!(matches!(ask(&url, 5.0), Err(ChatError::Unreadable(_))));
        let url = fake_server(vec![http("200 OK", &"x".repeat(300_000))], Duration::ZERO);
        assert_eq!(ask(&url, 5.0), Err(ChatError::Unreadable("it is longer than 256 KiB")));
    }

    #[test]
    fn a_slow_or_truncated_answer_ends_at_the_deadline() {
        let url = fake_server(vec![http("200 OK", "{}")], Duration::from_secs(3));
        let start = std::time::Instant::now();
        assert!(matches!(ask(&url, 0.3), Err(ChatError::Timeout(_))), "slow");
        assert!(start.elapsed() < Duration::from_secs(2));
        let mut cut = http("200 OK", r#"{"choices":[]}"#);
        cut.truncate(cut.len() - 5);
        let url = fake_server(vec![cut], Duration::ZERO);
        assert!(ask(&url, 1.0).is_err());
    }
}
