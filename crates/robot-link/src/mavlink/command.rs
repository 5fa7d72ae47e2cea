//! A command until it is answered: sent, sent again with a higher confirmation, given up.

use std::fmt;

use crate::mavlink::message::{CommandAck, CommandLong};

/// Answers "in progress" that are listened to.
const MAX_DELAYS: u8 = 10;

/// How long to wait for an answer, and how often to ask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetryConfig {
    /// Time before it is sent again (0.7 s).
    pub period_ns: i64,
    /// Times it is sent at most (5).
    pub max_sent: u8,
    /// Time given to a command that is in progress, counted from the last such answer (5 s).
    pub progress_ns: i64,
}

impl Default for RetryConfig {
    fn default() -> Self {
        Self { period_ns: 700_000_000, max_sent: 5, progress_ns: 5_000_000_000 }
    }
}

/// MAV_RESULT, with what it means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AckResult(pub u8);

impl AckResult {
    /// Done, or begun.
    pub const ACCEPTED: AckResult = AckResult(0);
    /// Not now.
    pub const TEMPORARILY_REJECTED: AckResult = AckResult(1);
    /// Being done; another answer will come.
    pub const IN_PROGRESS: AckResult = AckResult(5);
}

impl fmt::Display for AckResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let meaning = match self.0 {
            0 => "accepted",
            1 => "temporarily rejected: the command is valid, but not in the present state",
            2 => "denied: the parameters are not allowed",
            3 => "unsupported: this autopilot does not know the command",
            4 => "failed: it was tried and did not work",
            5 => "in progress",
            6 => "cancelled",
            7 => "only as COMMAND_LONG",
            8 => "only as COMMAND_INT",
            9 => "unsupported frame of coordinates",
            other => return write!(f, "MAV_RESULT {other}, which has no meaning known here"),
        };
        f.write_str(meaning)
    }
}

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Accepted.
    Accepted,
    /// Answered with something else; after the last time it was sent, if the answer was "not now".
    Refused(AckResult),
    /// Sent so many times without an answer.
    Unanswered(u8),
}

/// One command under way.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandInFlight {
    command: CommandLong,
    sent: u8,
    next_ns: i64,
    delays: u8,
    last_answer: Option<AckResult>,
}

impl CommandInFlight {
    /// To be sent at the next [`poll`](Self::poll).
    pub fn new(command: CommandLong, now_ns: i64) -> Self {
        Self { command, sent: 0, next_ns: now_ns, delays: 0, last_answer: None }
    }

    /// What to send now, or how it ended; nothing while an answer may still come.
    pub fn poll(&mut self, now_ns: i64, config: &RetryConfig) -> Result<Option<CommandLong>, Verdict> {
        if now_ns < self.next_ns {
            return Ok(None);
        }
        if self.sent >= config.max_sent {
            return Err(self.last_answer.map_or(Verdict::Unanswered(self.sent), Verdict::Refused));
        }
        let command = CommandLong { confirmation: self.sent, ..self.command };
        self.sent += 1;
        self.next_ns = now_ns.saturating_add(config.period_ns);
        Ok(Some(command))
    }

    /// Takes an answer; `Some` when that ends it. Answers to other commands, or before it was sent, are not listened to.
    pub fn answer(&mut self, ack: &CommandAck, now_ns: i64, config: &RetryConfig) -> Option<Verdict> {
        if ack.command != self.command.command || self.sent == 0 {
            return None;
        }
        match AckResult(ack.result) {
            AckResult::ACCEPTED => Some(Verdict::Accepted),
            // "Not now" is asked again, as long as there are tries left.
            AckResult::TEMPORARILY_REJECTED => {
                self.last_answer = Some(AckResult::TEMPORARILY_REJECTED);
                None
            }
            // Whoever is in progress for ever is not waited for.
            AckResult::IN_PROGRESS if self.delays < MAX_DELAYS => {
                self.delays += 1;
                self.next_ns = now_ns.saturating_add(config.progress_ns);
                None
            }
            AckResult::IN_PROGRESS => None,
            result => Some(Verdict::Refused(result)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::offboard::arm;

    const S: i64 = 1_000_000_000;

    fn ack(result: u8) -> CommandAck {
        CommandAck { command: 400, result, ..CommandAck::default() }
    }

    #[test]
    fn it_is_sent_again_with_a_higher_confirmation_and_given_up() {
        let config = RetryConfig { period_ns: S, max_sent: 3, progress_ns: 5 * S };
        let mut arming = CommandInFlight::new(arm((1, 1), true, 0), 0);
        let mut sent = Vec::new();
        for second in 0..3 {
            sent.extend(arming.poll(second * S, &config).expect("still waiting").map(|command| command.confirmation));
            assert_eq!(arming.poll(second * S + 1, &config), Ok(None));
        }
        assert_eq!(sent, [0, 1, 2]);
        assert_eq!(arming.poll(3 * S, &config), Err(Verdict::Unanswered(3)));
    }

    #[test]
    fn answers_end_it_or_give_it_time() {
        let config = RetryConfig { period_ns: S, max_sent: 2, progress_ns: 5 * S };
        let mut arming = CommandInFlight::new(arm((1, 1), true, 0), 0);
        assert_eq!(arming.answer(&ack(0), 0, &config), None, "nothing was asked yet");
        assert!(arming.poll(0, &config).expect("waiting").is_some());
        assert_eq!(arming.answer(&CommandAck { command: 176, ..ack(0) }, 0, &config), None);
        assert_eq!(arming.answer(&ack(5), 0, &config), None);
        assert_eq!(arming.poll(4 * S, &config), Ok(None), "in progress");
        assert_eq!(arming.answer(&ack(2), 4 * S, &config), Some(Verdict::Refused(AckResult(2))));
        let mut busy = CommandInFlight::new(arm((1, 1), true, 0), 0);
        for now in [0, S] {
            assert!(busy.poll(now, &config).expect("waiting").is_some());
            assert_eq!(busy.answer(&ack(1), now, &config), None);
        }
        assert_eq!(busy.poll(2 * S, &config), Err(Verdict::Refused(AckResult::TEMPORARILY_REJECTED)));
        assert!(AckResult(3).to_string().contains("unsupported") && AckResult(77).to_string().contains("77"));
    }
}
