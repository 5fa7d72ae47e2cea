//! A model far away, as an experiment imagines it: every call takes its time in the simulated world, some are never answered, and for a
//! while nobody can be reached at all.
//!
//! The robot waits for no answer: it goes on with the goal it has, or stands. An answer that comes late is verified at the graph as it
//! is then, like any other; where none comes, the reasoner on board takes the step ([`octant_prompt::decide_with_critic`]).

use octant_prompt::{Critique, Prompt, Reasoner, ReasonerError, Reply, Situation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How calls fare.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkConfig {
    /// Time from a call to its answer, drawn evenly on a logarithmic scale between these two, seconds.
    pub latency_s: (f64, f64),
    /// Share of calls that are lost: nothing comes back, and after `timeout_s` nobody waits any longer.
    pub loss: f64,
    /// From this time on (s of the mission), for so long (s), every call is lost.
    pub outage_s: Option<(f64, f64)>,
    /// Longest wait for an answer, default 20 s: that of [`crate::openai::ChatConfig`].
    pub timeout_s: f64,
    /// Of the draws.
    pub seed: u64,
}

impl Default for LinkConfig {
    fn default() -> Self {
        LinkConfig { latency_s: (0.2, 0.2), loss: 0.0, outage_s: None, timeout_s: 20.0, seed: 0 }
    }
}

impl LinkConfig {
    /// The name of the first number that makes no sense.
    pub(crate) fn wrong(&self) -> Option<(&'static str, f64)> {
        let is_time = |s: f64| s.is_finite() && s >= 0.0;
        let (low, high) = self.latency_s;
        let (from_s, for_s) = self.outage_s.unwrap_or((0.0, 0.0));
        let checks = [
            ("link.latency_s", low, is_time(low)),
            ("link.latency_s", high, is_time(high) && high >= low),
            ("link.loss", self.loss, (0.0..=1.0).contains(&self.loss)),
            ("link.outage_s", from_s, is_time(from_s)),
            ("link.outage_s", for_s, is_time(for_s)),
            ("link.timeout_s", self.timeout_s, is_time(self.timeout_s)),
        ];
        checks.into_iter().find(|(_, _, is_good)| !is_good).map(|(name, value, _)| (name, value))
    }
}

/// The way to the model.
#[derive(Debug, Clone)]
pub struct Link {
    config: LinkConfig,
    rng: ChaCha8Rng,
}

impl Link {
    /// A way.
    pub fn new(config: LinkConfig) -> Link {
        let rng = ChaCha8Rng::seed_from_u64(config.seed ^ 0x006C_696E_6B00);
        Link { config, rng }
    }

    /// The reasoner at its far end, for a decision that begins at `t_s`.
    pub fn to<'a>(&'a mut self, reasoner: &'a mut dyn Reasoner, t_s: f64) -> FarReasoner<'a> {
        FarReasoner { link: self, reasoner, now_s: t_s }
    }

    /// How long a call that begins at `now_s` takes, and whether it is answered.
    fn call(&mut self, now_s: f64) -> (f64, bool) {
        let (low, high) = self.config.latency_s;
        // Always as many draws for a call, so that arms of an experiment that differ in one number share the others.
        let (place, luck): (f64, f64) = (self.rng.random(), self.rng.random());
        let latency_s =
            if high > low && low > 0.0 { low * (high / low).powf(place) } else { low + (high - low) * place };
        let is_out = self.config.outage_s.is_some_and(|(from_s, for_s)| (from_s..from_s + for_s).contains(&now_s));
        if is_out || luck < self.config.loss || latency_s > self.config.timeout_s {
            return (self.config.timeout_s, false);
        }
        (latency_s, true)
    }
}

/// A reasoner whose answers take their time.
pub struct FarReasoner<'a> {
    link: &'a mut Link,
    reasoner: &'a mut dyn Reasoner,
    now_s: f64,
}

impl FarReasoner<'_> {
    /// When the last answer was there, or nobody waited for it any longer.
    pub fn done_s(&self) -> f64 {
        self.now_s
    }
}

impl Reasoner for FarReasoner<'_> {
    fn decide(
        &mut self,
        situation: &Situation,
        prompt: &Prompt,
        critiques: &[Critique],
    ) -> Result<Reply, ReasonerError> {
        let (took_s, is_answered) = self.link.call(self.now_s);
        self.now_s += took_s;
        if is_answered { self.reasoner.decide(situation, prompt, critiques) } else { Err(ReasonerError::TimedOut) }
    }

    fn name(&self) -> &str {
        self.reasoner.name()
    }

    fn take_trouble(&mut self) -> Option<String> {
        self.reasoner.take_trouble()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_call_takes_its_latency_or_the_timeout(
            low in 0.01..5.0_f64, more in 0.0..20.0_f64, loss in 0.0..=1.0_f64, seed in 0_u64..50, now_s in 0.0..100.0_f64,
        ) {
            let config = LinkConfig { latency_s: (low, low + more), loss, outage_s: Some((30.0, 20.0)), seed, ..LinkConfig::default() };
            prop_assert_eq!(config.wrong(), None);
            let mut link = Link::new(config.clone());
            let (took_s, is_answered) = link.call(now_s);
            if is_answered {
                prop_assert!(took_s >= low * 0.999 && took_s <= (low + more) * 1.001 && took_s <= config.timeout_s);
                prop_assert!(!(30.0..50.0).contains(&now_s));
            } else {
                prop_assert_eq!(took_s, config.timeout_s);
            }
            prop_assert_eq!(Link::new(config).call(now_s), (took_s, is_answered));
        }
    }

    #[test]
    fn a_fifth_is_a_fifth() {
        let mut link = Link::new(LinkConfig { loss: 0.2, ..LinkConfig::default() });
        let lost = (0..5000).filter(|_| !link.call(0.0).1).count();
        assert!((900..1100).contains(&lost), "{lost}");
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        let wrong = |config: LinkConfig| config.wrong().map(|(name, _)| name);
        assert_eq!(wrong(LinkConfig { latency_s: (2.0, 1.0), ..LinkConfig::default() }), Some("link.latency_s"));
        assert_eq!(wrong(LinkConfig { loss: 1.5, ..LinkConfig::default() }), Some("link.loss"));
        assert_eq!(
            wrong(LinkConfig { outage_s: Some((f64::NAN, 1.0)), ..LinkConfig::default() }),
            Some("link.outage_s")
        );
    }
}
