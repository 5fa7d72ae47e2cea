//! Keeps the stamps of one topic going forward.
//!
//! A single stamp that lies back or far ahead is a fault of that message, which is passed over. Stamps that stay back are a clock
//! that was set: there the recording ends. A jump ahead that stays is a gap, and what comes after it is passed on.

use omni_perception::Stamp;

use super::error::BagError;
use crate::recording::RecordingError;
use crate::stream::SensorEvent;

/// A message this much after the one before waits until the next one confirms it.
const GAP_S: f64 = 2.0;
/// Stamps this far back ...
const RESET_S: f64 = 1.0;
/// ... and going forward there for this many messages are a clock that was set.
const RESET_MESSAGES: u32 = 3;

/// The state of one topic.
#[derive(Debug)]
pub(super) struct ClockGuard {
    topic: String,
    last: Option<Stamp>,
    waiting: Option<(Stamp, SensorEvent)>,
    /// The last stamp that lay back, and how many in a row went forward from there.
    back: Option<(Stamp, u32)>,
}

impl ClockGuard {
    pub(super) fn new(topic: &str) -> ClockGuard {
        ClockGuard { topic: topic.to_owned(), last: None, waiting: None, back: None }
    }

    /// Takes an event with the stamp of its message's header; what may be passed on goes to `out`.
    pub(super) fn take(
        &mut self,
        stamp: Stamp,
        event: SensorEvent,
        mut out: impl FnMut(Result<SensorEvent, RecordingError>),
    ) {
        if let (Some((ahead, waiting)), Some(last)) = (self.waiting.take(), self.last) {
            if stamp > ahead {
                self.last = Some(ahead);
                out(Ok(waiting));
            } else {
                let topic = self.topic.clone();
                out(Err(BagError::Ahead { topic, stamp: ahead, last, next: stamp }.into()));
            }
        }
        let Some(last) = self.last else {
            self.last = Some(stamp);
            return out(Ok(event));
        };
        let step_s = stamp.seconds_since(last);
        if stamp <= last {
            let topic = self.topic.clone();
            let in_a_row = match self.back {
                Some((back, count)) if stamp > back => count + 1,
                _ => 1,
            };
            self.back = Some((stamp, in_a_row));
            let error = if -step_s > RESET_S && in_a_row >= RESET_MESSAGES {
                BagError::ClockReset { topic, stamp, last }
            } else {
                BagError::NotLater { topic, stamp, last }
            };
            return out(Err(error.into()));
        }
        self.back = None;
        if step_s > GAP_S {
            self.waiting = Some((stamp, event));
            return;
        }
        self.last = Some(stamp);
        out(Ok(event));
    }

    /// The event that still waits when the recording ends.
    pub(super) fn finish(&mut self) -> Option<SensorEvent> {
        self.waiting.take().map(|(_, event)| event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omni_perception::EncoderSample;

    /// What becomes of stamps in milliseconds: those passed on, then the faults by word.
    fn check(stamps_ms: &[i64], expected_ms: &[i64], expected_faults: &[&str]) {
        let mut guard = ClockGuard::new("/joint_states");
        let (mut passed, mut faults) = (Vec::new(), Vec::new());
        for ms in stamps_ms {
            let stamp = Stamp(ms * 1_000_000);
            guard.take(stamp, SensorEvent::Encoder(EncoderSample { stamp, angle_rad: 0.0 }), |item| match item {
                Ok(event) => passed.push(event.stamp().0 / 1_000_000),
                Err(RecordingError::Bag(error)) => faults.push(match error {
                    BagError::NotLater { .. } => "back",
                    BagError::Ahead { .. } => "ahead",
                    BagError::ClockReset { .. } => "reset",
                    _ => "other",
                }),
                Err(_) => faults.push("other"),
            });
        }
        passed.extend(guard.finish().map(|event| event.stamp().0 / 1_000_000));
        assert_eq!(passed, expected_ms, "{stamps_ms:?}");
        assert_eq!(faults, expected_faults, "{stamps_ms:?}");
    }

    #[test]
    fn single_faults_are_passed_over_and_a_set_clock_ends_it() {
        check(&[0, 5, 10], &[0, 5, 10], &[]);
        check(&[0, 5, 5, 3, 10], &[0, 5, 10], &["back", "back"]);
        check(&[0, 5, 9000, 10, 15], &[0, 5, 10, 15], &["ahead"]);
        check(&[0, 5, 9000, 9005, 9010], &[0, 5, 9000, 9005, 9010], &[]);
        check(&[0, 5, 9000], &[0, 5, 9000], &[]);
        check(&[5000, 5005, 0, 5, 10], &[5000, 5005], &["back", "back", "reset"]);
        // A burst that came late is no set clock.
        check(&[100, 200, 150, 160, 170, 180, 210], &[100, 200, 210], &["back", "back", "back", "back"]);
    }
}
