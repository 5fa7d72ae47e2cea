//! `omnivln refer`: which object does a sentence mean? The grounder on recorded rooms, scored.
//!
//! The grounder is given the sentence and the boxes ([`Question`]); the [`AnswerKey`] of each line goes to the tally only.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use arena::mission::octant_prompt::grounding::Scene;
use arena::mission::octant_prompt::refer_set::{
    AnswerKey, Question, answer, answer_with_prior, read_scene, read_utterance,
};
use clap::Args;
use serde_json::{Value, json};

use crate::bench_page::ReportOptions;
use crate::json_lines::{read_lines, write_lines};
use arena::quantile::quantile;

/// Options of `refer`.
#[derive(Debug, Args)]
pub struct ReferOptions {
    /// Scenes of labelled boxes, a JSON object a line
    #[arg(long, value_name = "FILE")]
    scenes: PathBuf,
    /// Sentences with their answers, a JSON object a line
    #[arg(long, value_name = "FILE")]
    utterances: PathBuf,
    /// Also report with the prior that the class meant has several instances
    #[arg(long)]
    prior: bool,
    /// Only the sentences of one half of a fixed split: the grounder's rules were made on those of half 0; the scores of half 1 were
    /// looked at while choosing among rules, its sentences were not
    #[arg(long, value_name = "0|1", value_parser = clap::value_parser!(u8).range(0..=1))]
    half: Option<u8>,
    /// Write the id chosen for each sentence, a JSON object a line
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOptions,
}

/// Reads, answers, scores, prints.
pub fn run(options: &ReferOptions) -> Result<ExitCode> {
    let scenes = read_lines(&options.scenes, |line| Ok(read_scene(line)?))?;
    let scenes: HashMap<String, Scene> = scenes.into_iter().collect();
    let utterances = read_lines(&options.utterances, |line| Ok(read_utterance(line)?))?;
    let wanted = |question: &Question| options.half.is_none_or(|half| half == question.half());
    let utterances: Vec<(Question, AnswerKey)> =
        utterances.into_iter().filter(|(question, _)| wanted(question)).collect();
    ensure!(!utterances.is_empty(), "{} holds no sentence to answer", options.utterances.display());

    let mut plain = Tally::default();
    let mut with_prior = Tally::default();
    let mut chosen = Vec::new();
    for (question, key) in &utterances {
        let scene = scenes
            .get(&question.scene)
            .with_context(|| format!("no scene \"{}\" in {}", question.scene, options.scenes.display()))?;
        let start = Instant::now();
        let id = answer(&question.text, scene).map(|id| id.0);
        let us = start.elapsed().as_secs_f64() * 1e6;
        plain.add(question, key, id, us);
        if options.prior {
            with_prior.add(question, key, answer_with_prior(&question.text, scene).map(|id| id.0), us);
        }
        chosen.push(json!({"set": key.set, "scene": question.scene, "text": question.text, "id": id}));
    }

    write_lines(options.out.as_deref(), &chosen)?;
    options.report.write_page(|| crate::refer_page::page(&plain.json()))?;
    if options.report.json {
        let mut report = json!({"sets": plain.json(), "prior": false});
        if options.prior {
            report["sets_with_prior"] = with_prior.json();
        }
        arena::say!("{report}");
    } else {
        plain.print("");
        if options.prior {
            with_prior.print(", with the prior");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Right and all, for each set and each part of it.
#[derive(Debug, Default)]
struct Tally {
    sets: BTreeMap<String, SetTally>,
}

#[derive(Debug, Default)]
struct SetTally {
    all: Share,
    parts: BTreeMap<&'static str, Share>,
    relations: BTreeMap<String, Share>,
    us: Vec<f64>,
}

#[derive(Debug, Default, Clone, Copy)]
struct Share {
    right: usize,
    n: usize,
}

impl Share {
    fn add(&mut self, is_right: bool) {
        self.right += usize::from(is_right);
        self.n += 1;
    }

    /// Null for nothing.
    fn value(self) -> Option<f64> {
        (self.n > 0).then(|| self.right as f64 / self.n as f64)
    }
}

impl Tally {
    fn add(&mut self, question: &Question, key: &AnswerKey, id: Option<u64>, us: f64) {
        let is_right = id == Some(key.target);
        let set = self.sets.entry(key.set.clone()).or_default();
        set.all.add(is_right);
        set.us.push(us);
        let parts = [
            if key.is_easy() { "easy" } else { "hard" },
            if question.is_view_dependent() { "view_dependent" } else { "view_independent" },
            if question.half() == 0 { "half_0" } else { "half_1" },
        ];
        for part in parts {
            set.parts.entry(part).or_default().add(is_right);
        }
        if let Some(relation) = &key.relation {
            set.relations.entry(relation.clone()).or_default().add(is_right);
        }
    }

    fn json(&self) -> Value {
        let sets = self.sets.iter().map(|(name, set)| {
            let part = |name: &str| set.parts.get(name).copied().unwrap_or_default().value();
            let mut value = json!({
                "n": set.all.n, "accuracy": set.all.value(), "easy": part("easy"), "hard": part("hard"),
                "view_dependent": part("view_dependent"), "view_independent": part("view_independent"),
                "half_0": part("half_0"), "half_1": part("half_1"), "us_median": quantile(&set.us, 0.5),
            });
            if !set.relations.is_empty() {
                value["relations"] = set
                    .relations
                    .iter()
                    .map(|(name, share)| (name.clone(), json!({"n": share.n, "accuracy": share.value()})))
                    .collect();
            }
            (name.clone(), value)
        });
        Value::Object(sets.collect())
    }

    fn print(&self, suffix: &str) {
        for (name, set) in &self.sets {
            let percent =
                |share: Share| share.value().map_or_else(|| "-".into(), |value| format!("{:.2} %", 100.0 * value));
            arena::say!(
                "{name}{suffix}: {} of {} sentences, {:.0} us median",
                percent(set.all),
                set.all.n,
                quantile(&set.us, 0.5).unwrap_or(0.0)
            );
            for (part, share) in &set.parts {
                arena::say!("  {part:18} {:>9} of {}", percent(*share), share.n);
            }
            for (relation, share) in &set.relations {
                arena::say!("  {relation:18} {:>9} of {}", percent(*share), share.n);
            }
        }
    }
}
