//! A stand-in for a language model, in this process: a chat server on the loopback that answers at once, from the prompt alone, by the readers
//! of `prompt_reader`. What it measures is everything but the model.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};

use anyhow::{Context, Result};
use serde_json::{Value, json};

use crate::prompt_reader::{read_flat, read_ours};

/// Name under which it reports itself.
pub const NAME: &str = "in-process reader";
/// Longest request that is read.
const MAX_BYTES: usize = 4 << 20;

/// Starts it; it ends with the process. Returns its address.
///
/// # Errors
/// If no port can be had.
pub fn start() -> Result<String> {
    let listener = TcpListener::bind("127.0.0.1:0").context("no port on the loopback can be had")?;
    let base_url = format!("http://{}/v1", listener.local_addr()?);
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // A line that breaks is the client's business.
            let _ = answer(stream);
        }
    });
    Ok(base_url)
}

fn answer(mut stream: TcpStream) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    let mut reader = BufReader::new(stream.try_clone()?);
    let mut length = 0;
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line)? == 0 {
            return Ok(()); // somebody only measured the way
        }
        if line.trim().is_empty() {
            break;
        }
        if let Some((name, value)) = line.split_once(':')
            && name.eq_ignore_ascii_case("content-length")
        {
            length = value.trim().parse().unwrap_or(0);
        }
    }
    let mut body = vec![0; length.min(MAX_BYTES)];
    reader.read_exact(&mut body)?;
    let request: Value = serde_json::from_slice(&body).unwrap_or_default();
    let prompt = request.pointer("/messages/1/content").and_then(Value::as_str).unwrap_or_default();
    let text = said_about(prompt);
    stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nConnection: close\r\n\r\n")?;
    // Word by word, as a model would.
    for word in text.split_inclusive(' ') {
        let event = json!({"choices": [{"index": 0, "delta": {"content": word}}]});
        stream.write_all(format!("data: {event}\n\n").as_bytes())?;
    }
    stream.write_all(b"data: [DONE]\n\n")
}

/// The answer to a prompt of either format.
fn said_about(prompt: &str) -> String {
    if prompt.contains("\"position\":") {
        return json!({"id": read_flat(prompt).and_then(|id| id.parse::<u64>().ok())}).to_string();
    }
    // Without the tool for the length of a way, the first of several rooms has to do: rooms are listed by distance.
    let action = read_ours(prompt, |_| Some(0.0)).unwrap_or_default();
    let (verb, target) = action.trim_end_matches(')').split_once('(').unwrap_or(("", ""));
    json!({"object": target, "target": target, "stop": verb == "stop"}).to_string()
}
