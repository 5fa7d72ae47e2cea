//! The autopilot's clock against ours, from TIMESYNC.
//!
//! ```text
//! asked at t0 (ours), answered at T (theirs), heard at t1 (ours):   offset = T - (t0 + t1) / 2,   way = t1 - t0
//! ```
//!
//! The answer says the truth within half its way, so only answers with a short way count; the rest of their noise is averaged out.

use std::collections::VecDeque;

use crate::mavlink::message::Timesync;
use crate::mavlink::offboard::clock_offset_ns;

/// Ways remembered: the shortest of them says what a short way is.
const WAYS: usize = 16;
/// An answer may have been this much longer under way than the shortest.
const SLACK_NS: i64 = 1_000_000;
/// An answer to a question older than this is none of ours.
const LONGEST_WAY_NS: i64 = 10_000_000_000;
/// Weight of a new answer once the first ones are in.
const GAIN: f64 = 0.1;
/// An offset that differs by more than this is another clock: the autopilot started anew.
const JUMP_NS: i64 = 200_000_000;
/// So many answers in a row must say so.
const JUMPS_BELIEVED: u32 = 3;

/// Estimates the offset of the peer's clock.
#[derive(Debug, Clone, Default)]
pub struct ClockOffset {
    ways_ns: VecDeque<i64>,
    offset_ns: i64,
    accepted: u32,
    jumps: u32,
}

impl ClockOffset {
    /// Peer's clock minus ours; `None` before the first answer.
    pub fn offset_ns(&self) -> Option<i64> {
        (self.accepted > 0).then_some(self.offset_ns)
    }

    /// Answers that counted since the clock (re)started.
    pub fn accepted(&self) -> u32 {
        self.accepted
    }

    /// A time of the peer as one of ours; `None` before the first answer, or far outside of all time.
    pub fn ours(&self, theirs_ns: i64) -> Option<i64> {
        theirs_ns.checked_sub(self.offset_ns()?)
    }

    /// Takes an answer heard at `now_ns`. Returns whether it counted.
    pub fn hear(&mut self, answer: &Timesync, now_ns: i64) -> bool {
        let Some((offset_ns, way_ns)) = clock_offset_ns(answer, now_ns) else { return false };
        if way_ns > LONGEST_WAY_NS {
            return false;
        }
        if self.ways_ns.len() == WAYS {
            self.ways_ns.pop_front();
        }
        self.ways_ns.push_back(way_ns);
        let shortest_ns = self.ways_ns.iter().copied().min().unwrap_or(way_ns);
        if self.accepted > 0 && (offset_ns.saturating_sub(self.offset_ns)).saturating_abs() > JUMP_NS.max(way_ns) {
            self.jumps += 1;
            if self.jumps < JUMPS_BELIEVED {
                return false;
            }
            *self = ClockOffset::default();
            self.ways_ns.push_back(way_ns);
        } else if way_ns > shortest_ns.saturating_add(shortest_ns / 2).saturating_add(SLACK_NS) {
            return false;
        }
        self.jumps = 0;
        self.accepted = self.accepted.saturating_add(1);
        // A plain mean at first, then one that forgets, for clocks drift.
        let gain = GAIN.max(1.0 / f64::from(self.accepted));
        if self.accepted == 1 {
            self.offset_ns = offset_ns;
        } else {
            self.offset_ns += (gain * (offset_ns - self.offset_ns) as f64) as i64;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(asked_ns: i64, there_ns: i64, back_ns: i64, offset_ns: i64) -> (Timesync, i64) {
        (Timesync { tc1: asked_ns + there_ns + offset_ns, ts1: asked_ns }, asked_ns + there_ns + back_ns)
    }

    #[test]
    fn long_ways_do_not_count() {
        let mut clock = ClockOffset::default();
        assert_eq!(clock.ours(5), None);
        let (quick, at) = answer(1_000_000_000, 200_000, 200_000, 7_000_000);
        assert!(clock.hear(&quick, at));
        assert_eq!((clock.offset_ns(), clock.ours(8_000_000)), (Some(7_000_000), Some(1_000_000)));
        // 40 ms in a queue on the way back would shift the clock by 20 ms.
        let (slow, at) = answer(2_000_000_000, 200_000, 40_000_000, 7_000_000);
        assert!(!clock.hear(&slow, at));
        assert_eq!(clock.offset_ns(), Some(7_000_000));
    }

    #[test]
    fn nonsense_neither_counts_nor_overflows() {
        let mut clock = ClockOffset::default();
        for tc1 in [i64::MIN, i64::MAX, 1, -1] {
            for ts1 in [i64::MIN, i64::MAX, 0, 5_000_000_000, -5_000_000_000] {
                for now_ns in [0, 6_000_000_000] {
                    clock.hear(&Timesync { tc1, ts1 }, now_ns);
                    let _ = (clock.ours(i64::MAX), clock.ours(i64::MIN));
                }
            }
        }
        let mut fresh = ClockOffset::default();
        assert!(!fresh.hear(&Timesync { tc1: 7, ts1: 1_000_000_000 }, 60_000_000_000), "nobody waits for a minute");
    }

    #[test]
    fn another_clock_is_believed_the_third_time() {
        let mut clock = ClockOffset::default();
        for (second, offset_ns, is_taken) in
            [(1, 9_000_000_000, true), (2, 0, false), (3, 0, false), (4, 0, true), (5, 0, true)]
        {
            let (message, at) = answer(second * 1_000_000_000, 100_000, 100_000, offset_ns);
            assert_eq!(clock.hear(&message, at), is_taken, "{second}");
        }
        assert_eq!((clock.offset_ns(), clock.accepted()), (Some(0), 2));
    }
}
