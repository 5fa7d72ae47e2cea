//! Arms side by side: what each did in the same runs, and how sure the differences are.

use serde::Serialize;

use crate::bench_nav::BenchNav;
use crate::intervals::{Estimate, paired_mean_95, paired_shares_95, wilson_95};
use crate::summary::Summary;

/// The result of an experiment, as `--json` prints it.
#[derive(Debug, Clone, Serialize)]
pub struct BenchArms {
    /// The option that was varied.
    pub varied: String,
    /// Each arm, in the order given.
    pub arms: Vec<Arm>,
    /// Each arm but the first against the first.
    pub paired: Vec<Paired>,
}

/// One arm.
#[derive(Debug, Clone, Serialize)]
pub struct Arm {
    /// Its name.
    pub name: String,
    /// Means over its runs.
    pub figures: Figures,
    /// All of it.
    pub bench: BenchNav,
}

/// What an arm's runs were like on the mean.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Runs.
    pub n: usize,
    /// Share of successes, with Wilson's interval.
    pub success: Estimate,
    /// SPL.
    pub spl: f64,
    /// Tokens of prompts and answers in a run.
    pub tokens: f64,
    /// Decisions in a run.
    pub decisions: f64,
    /// Angle turned while standing, in a run.
    pub turned_in_place_rad: f64,
    /// Seconds until a right thing was first seen, over the runs in which one was.
    pub first_sighting_s: Option<f64>,
    /// Simulated seconds of a run.
    pub sim_s: f64,
    /// Touches in all runs.
    pub collisions: usize,
}

/// Differences to the first arm, run by run.
#[derive(Debug, Clone, Serialize)]
pub struct Paired {
    /// The arm.
    pub name: String,
    /// Success.
    pub success: Estimate,
    /// SPL.
    pub spl: Estimate,
    /// Tokens.
    pub tokens: Estimate,
    /// Decisions.
    pub decisions: Estimate,
    /// Angle turned while standing.
    pub turned_in_place_rad: Estimate,
    /// Seconds to the first sighting, of the runs in which both had one.
    pub first_sighting_s: Estimate,
    /// Simulated seconds.
    pub sim_s: Estimate,
}

impl Paired {
    /// Every difference with its name and how many decimals it is worth.
    pub fn rows(&self) -> [(&'static str, Estimate, usize); 7] {
        [
            ("right", self.success, 3),
            ("SPL", self.spl, 3),
            ("tokens", self.tokens, 0),
            ("decisions", self.decisions, 1),
            ("turned in place, rad", self.turned_in_place_rad, 1),
            ("first sighting, s", self.first_sighting_s, 1),
            ("simulated, s", self.sim_s, 1),
        ]
    }
}

fn tokens(run: &Summary) -> f64 {
    (run.prompt_tokens + run.answer_tokens) as f64
}

impl Figures {
    /// Of the runs of a bench.
    pub fn of(runs: &[Summary]) -> Figures {
        let n = runs.len();
        let right = runs.iter().filter(|run| run.success).count();
        let mean = |of: &dyn Fn(&Summary) -> f64| runs.iter().map(of).sum::<f64>() / n.max(1) as f64;
        let sightings: Vec<f64> = runs.iter().filter_map(|run| run.first_sighting_s).collect();
        Figures {
            n,
            success: Estimate { value: right as f64 / n.max(1) as f64, interval_95: wilson_95(right, n) },
            spl: mean(&|run| run.spl),
            tokens: mean(&tokens),
            decisions: mean(&|run| run.decisions as f64),
            turned_in_place_rad: mean(&|run| run.turned_in_place_rad),
            first_sighting_s: (!sightings.is_empty()).then(|| sightings.iter().sum::<f64>() / sightings.len() as f64),
            sim_s: mean(&|run| run.sim_s),
            collisions: runs.iter().map(|run| run.collisions).sum(),
        }
    }
}

impl BenchArms {
    /// Arms that were run over the same scenes.
    pub fn new(varied: &str, arms: Vec<(String, BenchNav)>) -> BenchArms {
        let paired = match arms.split_first() {
            Some(((_, first), others)) => {
                others.iter().map(|(name, other)| paired(name, &first.runs, &other.runs)).collect()
            }
            None => Vec::new(),
        };
        let arms = arms.into_iter().map(|(name, bench)| Arm { name, figures: Figures::of(&bench.runs), bench });
        BenchArms { varied: varied.to_owned(), arms: arms.collect(), paired }
    }
}

/// Differences of the runs of an arm to those of the first, which were of the same scenes in the same order.
pub fn paired(name: &str, first: &[Summary], other: &[Summary]) -> Paired {
    let difference = |of: &dyn Fn(&Summary) -> f64| {
        paired_mean_95(&first.iter().zip(other).map(|(a, b)| of(b) - of(a)).collect::<Vec<_>>())
    };
    let successes: Vec<(bool, bool)> = first.iter().zip(other).map(|(a, b)| (a.success, b.success)).collect();
    let sightings: Vec<f64> =
        first.iter().zip(other).filter_map(|(a, b)| Some(b.first_sighting_s? - a.first_sighting_s?)).collect();
    Paired {
        name: name.to_owned(),
        success: paired_shares_95(&successes),
        spl: difference(&|run| run.spl),
        tokens: difference(&tokens),
        decisions: difference(&|run| run.decisions as f64),
        turned_in_place_rad: difference(&|run| run.turned_in_place_rad),
        first_sighting_s: paired_mean_95(&sightings),
        sim_s: difference(&|run| run.sim_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_taken_run_by_run() {
        let run = |success: bool, tokens: usize, sighting: Option<f64>| Summary {
            success,
            prompt_tokens: tokens,
            first_sighting_s: sighting,
            ..Summary::default()
        };
        let first = [run(true, 100, Some(1.0)), run(true, 900, Some(2.0)), run(false, 50, None)];
        let other = [run(true, 150, Some(3.0)), run(false, 950, None), run(false, 100, Some(1.0))];
        let found = paired("b", &first, &other);
        // Tokens differ by 50 in every run, however much the runs differ.
        assert_eq!(found.tokens.value, 50.0);
        let twice = [first.clone(), first.clone()].concat();
        let others = [other.clone(), other.clone()].concat();
        assert_eq!(paired("b", &twice, &others).tokens.interval_95, [50.0, 50.0]);
        assert!((found.success.value + 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(found.first_sighting_s.value, 2.0);
        assert_eq!(Figures::of(&other).first_sighting_s, Some(2.0));
    }
}
