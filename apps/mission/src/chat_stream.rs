//! A chat request that is timed: the way to the server, the first words of the answer, the whole of it.
//!
//! The answer is asked for as a stream of server-sent events (`data: {...}` lines that end with `data: [DONE]`), so that the first token can be
//! seen coming. A server that sends one JSON object all the same is understood too; then only what it says itself about its first token
//! (`timings.first_token_ms`) is known.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::http_post::post_json_in_pieces;
use crate::openai::{ChatConfig, ChatError, MAX_BODY_BYTES, chat_error, read_reply, request_for};

/// An answer and when it came.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedReply {
    /// The text.
    pub text: String,
    /// Time to open a connection to the server: one way there and back, without any thinking.
    pub network_s: f64,
    /// From the request to the first token, if that can be known.
    pub first_token_s: Option<f64>,
    /// From the request to the end of the answer.
    pub answer_s: f64,
}

/// Asks once and measures. `attempts` of the configuration does not count here: a second request would hide what happened to the first.
///
/// # Errors
/// As [`crate::openai::chat`].
pub fn chat_timed(
    config: &ChatConfig,
    system: &str,
    user: &str,
    schema: (&str, &Value),
) -> Result<TimedReply, ChatError> {
    let network_s = connecting_s(config)?;
    let mut request = request_for(config, system, json!(user), Some(schema));
    request["stream"] = json!(true);
    let url = format!("{}/chat/completions", config.base_url);
    let start = Instant::now();
    let mut first_token_s = None;
    let mut seen = 0;
    let body = post_json_in_pieces(&url, &request, config.timeout_s, MAX_BODY_BYTES, &mut |body| {
        // Only whole lines; each is looked at once.
        while let Some(length) = body[seen..].iter().position(|byte| *byte == b'\n') {
            let line = &body[seen..seen + length];
            seen += length + 1;
            if first_token_s.is_none() && words_of_event(line).is_some_and(|words| !words.is_empty()) {
                first_token_s = Some(start.elapsed().as_secs_f64());
            }
        }
    })
    .map_err(|error| chat_error(error, config))?;
    let answer_s = start.elapsed().as_secs_f64();
    let is_stream = body.trim_ascii_start().starts_with(b"data:");
    let text = if is_stream {
        body.split(|byte| *byte == b'\n').filter_map(words_of_event).collect()
    } else {
        let value: Option<Value> = serde_json::from_slice(&body).ok();
        let told = value.and_then(|value| value.pointer("/timings/first_token_ms")?.as_f64());
        first_token_s = told.filter(|ms| (0.0..=1e3 * answer_s).contains(ms)).map(|ms| 1e-3 * ms);
        read_reply(&body)?.text
    };
    Ok(TimedReply { text, network_s, first_token_s, answer_s })
}

/// The words in one event; None for lines that are no event with words.
fn words_of_event(line: &[u8]) -> Option<String> {
    let data = line.strip_prefix(b"data:")?.trim_ascii();
    let event: Value = serde_json::from_slice(data).ok()?;
    event.pointer("/choices/0/delta/content").and_then(Value::as_str).map(str::to_owned)
}

fn connecting_s(config: &ChatConfig) -> Result<f64, ChatError> {
    let host =
        config.base_url.strip_prefix("http://").and_then(|rest| rest.split('/').next()).filter(|host| !host.is_empty());
    let Some(host) = host else { return Err(ChatError::Address(config.base_url.clone())) };
    let with_port = if host.rsplit(':').next().is_some_and(|port| port.parse::<u16>().is_ok()) {
        host.to_owned()
    } else {
        format!("{host}:80")
    };
    let unreachable = |cause: String| ChatError::Unreachable { url: config.base_url.clone(), cause };
    let address = with_port.to_socket_addrs().map_err(|error| unreachable(error.to_string()))?.next();
    let address = address.ok_or_else(|| unreachable("the name has no address".into()))?;
    let start = Instant::now();
    TcpStream::connect_timeout(&address, Duration::from_secs_f64(config.timeout_s.clamp(0.001, 1e6)))
        .map_err(|error| unreachable(error.to_string()))?;
    Ok(start.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpListener;

    /// Sends the parts of a body with a pause before each.
    fn server(content_type: &'static str, parts: Vec<String>, pause: Duration) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let mut stream = stream;
                let mut buffer = [0_u8; 65536];
                let _ = stream.set_read_timeout(Some(Duration::from_millis(50)));
                let mut got = 0;
                while stream.read(&mut buffer).is_ok_and(|n| {
                    got += n;
                    n > 0
                }) {}
                if got == 0 {
                    continue; // only a connection
                }
                let _ = write!(stream, "HTTP/1.1 200 OK\r\nContent-Type: {content_type}\r\nConnection: close\r\n\r\n");
                for part in &parts {
                    std::thread::sleep(pause);
                    let _ = stream.write_all(part.as_bytes());
                }
                return;
            }
        });
        format!("http://{address}/v1")
    }

    fn ask(url: &str) -> Result<TimedReply, ChatError> {
        let config = ChatConfig { timeout_s: 5.0, ..ChatConfig::new(url, "m") };
        chat_timed(&config, "s", "u", ("action", &json!({"type": "object"})))
    }

    #[test]
    fn a_stream_is_joined_and_its_first_token_is_seen_before_its_last() {
        let event = |words: &str| format!("data: {}\n\n", json!({"choices": [{"delta": {"content": words}}]}));
        let role = format!("data: {}\n\n", json!({"choices": [{"delta": {"role": "assistant"}}]}));
        let parts = vec![role, event("{\"a\""), event(": 1}"), "data: [DONE]\n\n".into()];
        let reply = ask(&server("text/event-stream", parts, Duration::from_millis(60))).unwrap();
        assert_eq!(reply.text, "{\"a\": 1}");
        let first_s = reply.first_token_s.unwrap();
        assert!(first_s > 0.1 && first_s + 0.1 < reply.answer_s, "{reply:?}");
        assert!(reply.network_s < 0.1);
    }

    #[test]
    fn a_server_that_does_not_stream_is_understood() {
        let body =
            json!({"choices": [{"message": {"content": "hello"}}], "timings": {"first_token_ms": 1.5}}).to_string();
        let reply = ask(&server("application/json", vec![body], Duration::from_millis(20))).unwrap();
        assert_eq!((reply.text.as_str(), reply.first_token_s), ("hello", Some(1.5e-3)));
        assert!(matches!(
            ask(&server("text/html", vec!["<html>".into()], Duration::ZERO)),
            Err(ChatError::Unreadable(_))
        ));
        assert!(matches!(ask("http://127.0.0.1:9/v1"), Err(ChatError::Unreachable { .. })));
        assert!(matches!(ask("ftp://x"), Err(ChatError::Address(_))));
    }
}
