//! One blocking HTTP request with a deadline and a bounded answer: what all services that the robot asks have in common.
//!
//! Plain HTTP on purpose: such services run on the robot or in the same building.

use std::io::Read;
use std::time::Duration;

use serde_json::Value;
use thiserror::Error;

/// Why there is no body.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PostError {
    /// The address is not one of a plain HTTP server.
    #[error("'{0}' is no address of a plain HTTP service; it looks like http://127.0.0.1:8091/path")]
    Address(String),
    /// Nobody answers there, or the connection broke.
    #[error("{url} cannot be reached: {cause}")]
    Unreachable {
        /// The address asked.
        url: String,
        /// What the network said.
        cause: String,
    },
    /// It took longer than the deadline.
    #[error("no answer within {0} s")]
    Timeout(String),
    /// It answered with an error.
    #[error("it answered with status {status}: {body}")]
    Status {
        /// HTTP status.
        status: u16,
        /// Beginning of the body.
        body: String,
    },
    /// The body is longer than what is read.
    #[error("the answer is longer than {max_bytes} bytes")]
    TooLong {
        /// Longest body that is read.
        max_bytes: u64,
    },
}

impl PostError {
    /// Whether asking again may help: a refusal will be repeated, a broken connection may not be.
    pub fn is_passing(&self) -> bool {
        !matches!(self, PostError::Address(_) | PostError::Status { status: 400..=499, .. })
    }
}

/// Sends `request` and returns the body of a good answer.
///
/// # Errors
/// See [`PostError`]; nothing takes longer than `timeout_s`, and at most `max_bytes` are read.
pub fn post_json(url: &str, request: &Value, timeout_s: f64, max_bytes: u64) -> Result<Vec<u8>, PostError> {
    post_json_in_pieces(url, request, timeout_s, max_bytes, &mut |_| ())
}

/// The same; `arrived` is called with the body so far whenever more of a good answer has come.
///
/// # Errors
/// As [`post_json`].
pub fn post_json_in_pieces(
    url: &str,
    request: &Value,
    timeout_s: f64,
    max_bytes: u64,
    arrived: &mut dyn FnMut(&[u8]),
) -> Result<Vec<u8>, PostError> {
    if !url.starts_with("http://") {
        return Err(PostError::Address(url.to_owned()));
    }
    let timeout = || PostError::Timeout(format!("{timeout_s}"));
    let unreachable = |cause: String| PostError::Unreachable { url: url.to_owned(), cause };
    let agent: ureq::Agent = ureq::Agent::config_builder()
        .timeout_global(Some(Duration::from_secs_f64(timeout_s)))
        .http_status_as_error(false)
        .build()
        .into();
    let mut response = agent.post(url).send_json(request).map_err(|error| match error {
        ureq::Error::Timeout(_) => timeout(),
        other => unreachable(other.to_string()),
    })?;
    let status = response.status().as_u16();
    let is_good = (200..300).contains(&status);
    let mut body = Vec::new();
    let mut reader = response.body_mut().as_reader().take(max_bytes + 1);
    let mut piece = [0_u8; 8 * 1024];
    loop {
        match reader.read(&mut piece) {
            Ok(0) => break,
            Ok(count) => {
                body.extend_from_slice(&piece[..count]);
                if is_good {
                    arrived(&body);
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => {
                let is_timeout = error.kind() == std::io::ErrorKind::TimedOut || error.to_string().contains("timeout");
                return Err(if is_timeout { timeout() } else { unreachable(error.to_string()) });
            }
        }
    }
    if body.len() as u64 > max_bytes {
        return Err(PostError::TooLong { max_bytes });
    }
    if !is_good {
        let text: String = String::from_utf8_lossy(&body).chars().take(200).collect();
        return Err(PostError::Status { status, body: text });
    }
    Ok(body)
}
