//! A call that is sent until it is answered, a bounded number of times.
//!
//! Every time it has a new number: a number twice is an error to the service. An answer to any of them counts. Answers to numbers that
//! are not ours belong to other programs; one to our number but another function is a lie.

use crate::unitree::message::{Request, Response};
use crate::unitree::sport::{Call, Outcome};

/// When a call is sent again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetryConfig {
    /// Wait for an answer (1 s, the makers' own).
    pub period_ns: i64,
    /// At most so often (4).
    pub max_sent: u8,
}

impl Default for RetryConfig {
    fn default() -> Self {
        Self { period_ns: 1_000_000_000, max_sent: 4 }
    }
}

/// How a call ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Answered with 0.
    Done,
    /// Answered with something else; after the last time it was sent, if the answer was "not now".
    Refused(Outcome),
    /// Sent so many times without an answer.
    Unanswered(u8),
}

/// One call under way.
#[derive(Debug, Clone, PartialEq)]
pub struct CallInFlight {
    call: Call,
    ids: Vec<i64>,
    next_ns: i64,
    last_answer: Option<Outcome>,
}

impl CallInFlight {
    /// To be sent at the next [`poll`](Self::poll).
    pub fn new(call: Call, now_ns: i64) -> Self {
        Self { call, ids: Vec::new(), next_ns: now_ns, last_answer: None }
    }

    /// Whether it was sent at all.
    pub fn is_sent(&self) -> bool {
        !self.ids.is_empty()
    }

    /// What to send now with the number `next_id`, which is then used up; nothing while an answer may still come.
    ///
    /// # Errors
    /// How it ended without having been done.
    pub fn poll(&mut self, now_ns: i64, next_id: &mut i64, config: &RetryConfig) -> Result<Option<Request>, Verdict> {
        if now_ns < self.next_ns {
            return Ok(None);
        }
        if self.ids.len() >= usize::from(config.max_sent) {
            let unanswered = Verdict::Unanswered(config.max_sent);
            return Err(self.last_answer.map_or(unanswered, Verdict::Refused));
        }
        // None of the calls made here holds a number that could be other than finite.
        let Ok(request) = self.call.request(*next_id) else { return Err(Verdict::Refused(Outcome::BadParameter)) };
        self.ids.push(*next_id);
        *next_id = next_id.wrapping_add(1);
        self.next_ns = now_ns.saturating_add(config.period_ns);
        Ok(Some(request))
    }

    /// Takes an answer; `Some` when that ends it.
    pub fn answer(&mut self, response: &Response) -> Option<Verdict> {
        if !self.ids.contains(&response.id) {
            return None;
        }
        if response.api_id != self.call.api_id() {
            return Some(Verdict::Refused(Outcome::OtherFunction));
        }
        match response.outcome() {
            Outcome::Done => Some(Verdict::Done),
            outcome if outcome.is_passing() => {
                self.last_answer = Some(outcome);
                None
            }
            outcome => Some(Verdict::Refused(outcome)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn answer(id: i64, api_id: i64, code: i32) -> Response {
        Response { id, api_id, code, ..Response::default() }
    }

    #[test]
    fn it_is_sent_again_with_new_numbers_and_given_up() {
        let (config, mut id) = (RetryConfig { period_ns: S, max_sent: 3 }, 7);
        let mut call = CallInFlight::new(Call::StandUp, 0);
        let sent: Vec<i64> = (0..6)
            .filter_map(|half| call.poll(half * S / 2, &mut id, &config).expect("still waiting"))
            .map(|request| request.id)
            .collect();
        assert_eq!((sent, id), (vec![7, 8, 9], 10));
        assert_eq!(call.poll(3 * S, &mut id, &config), Err(Verdict::Unanswered(3)));
    }

    #[test]
    fn answers_are_told_apart() {
        let (config, mut id) = (RetryConfig { period_ns: S, max_sent: 2 }, 7);
        let mut call = CallInFlight::new(Call::StandUp, 0);
        assert_eq!(call.answer(&answer(7, 1004, 0)), None, "nothing was asked yet");
        assert!(call.poll(0, &mut id, &config).expect("waiting").is_some());
        assert_eq!(call.answer(&answer(8, 1004, 0)), None, "somebody else's");
        assert_eq!(call.answer(&answer(7, 1005, 0)), Some(Verdict::Refused(Outcome::OtherFunction)));
        assert_eq!(call.answer(&answer(7, 1004, 3204)), Some(Verdict::Refused(Outcome::BadParameter)));
        assert_eq!(call.answer(&answer(7, 1004, 4202)), None, "not yet");
        assert!(call.poll(S, &mut id, &config).expect("waiting").is_some());
        assert_eq!(call.clone().answer(&answer(7, 1004, 0)), Some(Verdict::Done), "late, to the first");
        assert_eq!(call.poll(2 * S, &mut id, &config), Err(Verdict::Refused(Outcome::NotInitialised)));
    }
}
