//! An OpenAI-compatible server in this process that answers as a test wants: well, badly, late or never.
#![allow(dead_code)]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::{Value, json};

/// What the server does with one request.
pub enum Answer {
    /// A chat completion with this text.
    Say(String),
    /// Any status and body.
    Raw(&'static str, Vec<u8>),
    /// Nothing for so long, then the line is closed.
    Silence(Duration),
}

/// A running server; it ends with the process.
pub struct FakeServer {
    pub base_url: String,
    requests: Arc<Mutex<Vec<Value>>>,
}

impl FakeServer {
    /// Starts it; `answer` gets each request with its running number.
    pub fn start(answer: impl Fn(usize, &Value) -> Answer + Send + 'static) -> FakeServer {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let base_url = format!("http://{}/v1", listener.local_addr().expect("a bound port"));
        let requests: Arc<Mutex<Vec<Value>>> = Arc::default();
        let seen = Arc::clone(&requests);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let Some(request) = read_request(&stream) else { continue };
                let number = {
                    let mut seen = seen.lock().expect("nobody panics with it");
                    seen.push(request.clone());
                    seen.len() - 1
                };
                respond(stream, answer(number, &request));
            }
        });
        FakeServer { base_url, requests }
    }

    /// An address where nobody listens: a port that was free a moment ago.
    pub fn down() -> String {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        format!("http://{}/v1", listener.local_addr().expect("a bound port"))
    }

    /// Bodies of the requests so far.
    pub fn requests(&self) -> Vec<Value> {
        self.requests.lock().expect("nobody panics with it").clone()
    }
}

/// The values that the schema of a request allows for a field.
pub fn allowed(request: &Value, field: &str) -> Vec<String> {
    request
        .pointer(&format!("/response_format/json_schema/schema/properties/{field}/enum"))
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(|value| value.as_str().map(str::to_owned))
        .collect()
}

fn read_request(mut stream: &TcpStream) -> Option<Value> {
    stream.set_read_timeout(Some(Duration::from_secs(5))).ok()?;
    let mut bytes = Vec::new();
    let mut buffer = [0_u8; 16 * 1024];
    loop {
        let read = stream.read(&mut buffer).ok().filter(|read| *read > 0)?;
        bytes.extend_from_slice(&buffer[..read]);
        let Some(end) = bytes.windows(4).position(|window| window == b"\r\n\r\n") else { continue };
        let head = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
        let length = head.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse::<usize>().ok());
        let body = &bytes[end + 4..];
        match length {
            Some(length) if body.len() >= length => return serde_json::from_slice(&body[..length]).ok(),
            // Chunked: the last chunk is empty.
            None if body.ends_with(b"0\r\n\r\n") => {
                let text = String::from_utf8_lossy(body).into_owned();
                let json: String = text.split("\r\n").skip(1).step_by(2).collect();
                return serde_json::from_str(&json).ok();
            }
            _ => {}
        }
    }
}

fn respond(mut stream: TcpStream, answer: Answer) {
    let (status, body) = match answer {
        Answer::Silence(pause) => {
            // Kept open in another thread, so that the next request is heard meanwhile.
            std::thread::spawn(move || {
                std::thread::sleep(pause);
                drop(stream);
            });
            return;
        }
        Answer::Raw(status, body) => (status, body),
        Answer::Say(text) => {
            let body = json!({
                "choices": [{"index": 0, "message": {"role": "assistant", "content": text}, "finish_reason": "stop"}],
                "usage": {"prompt_tokens": 100, "completion_tokens": 7},
            });
            ("200 OK", body.to_string().into_bytes())
        }
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    // The client may be gone; that is its right.
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&body));
}
