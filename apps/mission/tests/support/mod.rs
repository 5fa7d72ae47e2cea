//! A service in this process that answers as a test wants: well, badly, late or never.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::Value;

/// What the service does with one request.
pub enum Answer {
    /// A status and a body.
    Say(&'static str, Vec<u8>),
    /// Promises more than it sends.
    CutOff(Vec<u8>),
    /// A byte now and then, without an end.
    Drip,
    /// Nothing for so long, then the line is closed.
    Silence(Duration),
}

/// A running service; it ends with the process.
pub struct FakeService {
    pub url: String,
    requests: Arc<Mutex<Vec<Value>>>,
}

impl FakeService {
    /// Starts it; `answer` gets each request with its running number.
    pub fn start(answer: impl Fn(usize, &Value) -> Answer + Send + 'static) -> FakeService {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let url = format!("http://{}/segment", listener.local_addr().expect("a bound port"));
        let requests: Arc<Mutex<Vec<Value>>> = Arc::default();
        let seen = Arc::clone(&requests);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let Some(request) = read_request(&stream) else { continue };
                let mut seen = seen.lock().expect("nobody panics with it");
                let answer = answer(seen.len(), &request);
                seen.push(request);
                drop(seen);
                // Each in its own thread, so that the next request is heard meanwhile.
                std::thread::spawn(move || respond(stream, answer));
            }
        });
        FakeService { url, requests }
    }

    /// An address where nobody listens: a port that was free a moment ago.
    pub fn down() -> String {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        format!("http://{}/segment", listener.local_addr().expect("a bound port"))
    }

    /// Bodies of the requests so far.
    pub fn requests(&self) -> Vec<Value> {
        self.requests.lock().expect("nobody panics with it").clone()
    }
}

fn read_request(mut stream: &TcpStream) -> Option<Value> {
    stream.set_read_timeout(Some(Duration::from_secs(5))).ok()?;
    let mut bytes = Vec::new();
    let mut buffer = [0_u8; 64 * 1024];
    loop {
        let read = stream.read(&mut buffer).ok().filter(|read| *read > 0)?;
        bytes.extend_from_slice(&buffer[..read]);
        let Some(end) = bytes.windows(4).position(|window| window == b"\r\n\r\n") else { continue };
        let head = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
        let length =
            head.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse::<usize>().ok())?;
        if bytes.len() >= end + 4 + length {
            return serde_json::from_slice(&bytes[end + 4..end + 4 + length]).ok();
        }
    }
}

/// The client may be gone; that is its right.
fn respond(mut stream: TcpStream, answer: Answer) {
    let head = |status: &str, length: usize| {
        format!(
            "HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
        )
    };
    let _ = match answer {
        Answer::Say(status, body) => {
            stream.write_all(head(status, body.len()).as_bytes()).and_then(|()| stream.write_all(&body))
        }
        Answer::CutOff(body) => {
            stream.write_all(head("200 OK", body.len() + 100).as_bytes()).and_then(|()| stream.write_all(&body))
        }
        Answer::Drip => {
            let mut result = stream.write_all(head("200 OK", 1 << 20).as_bytes());
            while result.is_ok() {
                std::thread::sleep(Duration::from_millis(50));
                result = stream.write_all(b" ");
            }
            result
        }
        Answer::Silence(pause) => {
            std::thread::sleep(pause);
            Ok(())
        }
    };
}
