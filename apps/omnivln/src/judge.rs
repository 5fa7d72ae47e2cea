//! `omnivln judge RUN`: the verdict on a run once more, from its `truth/` alone.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use arena::truth_folder::judge;
use clap::Args;
use serde_json::{Value, json};

/// Options of `judge`.
#[derive(Debug, Args)]
#[command(
    after_help = "Exit codes: 0 the verdict is that of summary.json, or there is none to compare; 1 it differs; 2 truth/ cannot be read."
)]
pub struct JudgeOptions {
    /// A run folder
    run: PathBuf,
    /// Print one JSON object: the judged keys of summary.json, and the keys that differ
    #[arg(long)]
    json: bool,
}

/// Lengths may differ by what nine decimals of a trajectory leave open.
const TOLERANCE: f64 = 1e-5;

/// Judges, compares, prints.
pub fn run(options: &JudgeOptions) -> Result<ExitCode> {
    let judgement = judge(&options.run)?;
    let verdict = &judgement.verdict;
    let mut judged = serde_json::to_value(verdict)?;
    judged["instruction"] = json!(judgement.task.text);
    judged["sim_s"] = json!(judgement.sim_s);
    let path = options.run.join("summary.json");
    let summary: Option<Value> = match std::fs::read_to_string(&path) {
        Ok(text) => Some(serde_json::from_str(&text).with_context(|| format!("reading {}", path.display()))?),
        Err(_) => None,
    };
    let different: Vec<String> = match (&summary, judged.as_object()) {
        (Some(summary), Some(judged)) => judged
            .iter()
            .filter(|(key, value)| summary.get(key).is_some_and(|said| !is_same(said, value)))
            .map(|(key, _)| key.clone())
            .collect(),
        _ => Vec::new(),
    };
    if options.json {
        judged["differs"] = json!(different);
        arena::say!("{judged}");
    } else {
        arena::say!("\"{}\": {}", judgement.task.text, verdict.reason);
        for step in &verdict.steps {
            let right = if step.right { "done" } else { "not done" };
            arena::say!("  step {}: declared at {:.1} s, {right}", step.step + 1, step.declared_s);
        }
        let shortest = verdict.shortest_m.map_or("none".to_owned(), |m| format!("{m:.2} m"));
        arena::say!(
            "  way {:.2} m in {:.1} s, shortest way {shortest}, SPL {:.3}",
            verdict.path_m,
            judgement.sim_s,
            verdict.spl
        );
        arena::say!(
            "  {} collisions, {} contacts with people, {} entries into zones",
            verdict.collisions,
            verdict.contacts_with_people,
            verdict.keep_out_entries
        );
        match (&summary, different.is_empty()) {
            (None, _) => arena::say!("There is no summary.json to compare it with."),
            (Some(_), true) => arena::say!("summary.json says the same."),
            (Some(_), false) => arena::say!("summary.json says otherwise about: {}", different.join(", ")),
        }
    }
    Ok(if different.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Equal, numbers to [`TOLERANCE`] of their size.
fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b)),
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(key, value)| b.get(key).is_some_and(|other| is_same(value, other)))
        }
        _ => match (a.as_f64(), b.as_f64()) {
            (Some(a), Some(b)) => (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()).max(1.0),
            _ => a == b,
        },
    }
}
