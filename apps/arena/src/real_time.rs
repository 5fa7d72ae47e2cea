//! A run that goes by the wall clock.
//!
//! When a step takes longer than its 20 ms the next ones are made up for; when the run falls behind by more than 0.2 s, what is lost
//! is lost, and counted.

use std::time::Duration;

use mission::omni_perception::Stamp;

/// A run may be this much behind the wall clock and make up for it.
const MAX_BEHIND_NS: i64 = 200_000_000;
/// A run that fell further behind than this was none in real time.
const TOO_SLOW_S: f64 = 1.0;
/// So much may be lost at once, and this share of the time for ever.
const MOST_BACKLOG_NS: i64 = 1_000_000_000;
const FORGIVEN_SHARE: i64 = 20;

/// How the run's clock lies to that of a link.
#[derive(Debug, Clone, Copy, Default)]
pub struct RealTime {
    /// The link's time at the run's zero.
    zero_ns: i64,
    is_begun: bool,
    lost_ns: i64,
    backlog: Backlog,
}

impl RealTime {
    /// Waits until it is `stamp` on the run's clock, which begins with the first call; `now_ns` is the link's clock. The stamp on that.
    pub fn wait_for(&mut self, stamp: Stamp, now_ns: impl Fn() -> i64) -> i64 {
        if !self.is_begun {
            (self.is_begun, self.zero_ns) = (true, now_ns() - stamp.0);
        }
        let ahead_ns = self.zero_ns + stamp.0 - now_ns();
        if ahead_ns > 0 {
            std::thread::sleep(Duration::from_nanos(ahead_ns.unsigned_abs()));
        }
        let mut lost_ns = 0;
        if -ahead_ns > MAX_BEHIND_NS {
            lost_ns = -ahead_ns;
            self.zero_ns += lost_ns;
            self.lost_ns += lost_ns;
        }
        self.backlog.add(stamp.0, lost_ns);
        self.link_ns(stamp)
    }

    /// A stamp of the run on the link's clock.
    pub fn link_ns(&self, stamp: Stamp) -> i64 {
        self.zero_ns + stamp.0
    }

    /// By how much it has fallen behind of late, if that is too much to see where the body goes.
    pub fn hopelessly_behind_s(&self) -> Option<f64> {
        (self.backlog.recent_ns > MOST_BACKLOG_NS).then_some(self.backlog.recent_ns as f64 * 1e-9)
    }

    /// "; the run fell behind ...".
    pub fn account(&self) -> String {
        let lost_s = self.lost_ns as f64 * 1e-9;
        let verdict = if lost_s > TOO_SLOW_S {
            ": this machine is too slow or too busy for it, and set-points stalled"
        } else {
            ""
        };
        format!("the run fell behind the clock by {lost_s:.1} s in all{verdict}")
    }
}

/// How far a run has fallen behind lately: what was lost, less a share of the time that has passed since.
#[derive(Debug, Clone, Copy, Default)]
struct Backlog {
    recent_ns: i64,
    at_ns: i64,
}

impl Backlog {
    fn add(&mut self, stamp_ns: i64, lost_ns: i64) {
        let passed_ns = (stamp_ns - self.at_ns).max(0);
        self.at_ns = stamp_ns;
        self.recent_ns = (self.recent_ns - passed_ns / FORGIVEN_SHARE).max(0) + lost_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hiccup_now_and_then_is_forgiven_and_a_run_that_falls_behind_for_good_is_not() {
        let after = |period_ns: i64, lost_ns: i64, steps: i64| {
            let mut backlog = Backlog::default();
            (1..=steps).for_each(|k| backlog.add(k * period_ns, lost_ns));
            backlog.recent_ns
        };
        // A quarter of a second lost every ten seconds, for an hour.
        assert!(after(10_000_000_000, 250_000_000, 360) < MOST_BACKLOG_NS);
        // 25 s lost in 235 s: as the overloaded machine did that touched the building.
        assert!(after(2_000_000_000, 215_000_000, 20) > MOST_BACKLOG_NS);
        assert!(after(20_000_000, 1_100_000_000, 1) > MOST_BACKLOG_NS, "at once");
    }
}
