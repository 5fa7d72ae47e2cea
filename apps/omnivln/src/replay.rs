//! `omnivln replay RUN`: the robot's side of a recorded run once more, from what its sensors said, to the same decisions.
//!
//! There is no simulator in this: the mission gets `events.bin` cycle by cycle, `commands.txt` at its times, and for a language model the
//! replies that `decisions.jsonl` holds. What it decides now is compared with what it decided then, line by line.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use arena::mission::event_log::EventLogReader;
use arena::mission::mission::{Mission, Outcome};
use arena::mission::octant_prompt::SymbolicReasoner;
use arena::mission::reasoning::{Mind, RecordedDecision};
use arena::mission::steering::parse_script;
use arena::progress::ProgressView;
use arena::run_setup::{RUN_FILE, RunFile, robot_side};
use clap::Args;
use serde_json::{Value, json};

/// Options of `replay`.
#[derive(Debug, Args)]
#[command(
    after_help = "Exit codes: 0 every decision is the same; 1 one differs; 2 the run cannot be replayed (it needs --record when it is run)."
)]
pub struct ReplayOptions {
    /// A run folder that was made with --record
    run: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Fields of a decision that a server says and nobody else knows.
const SAID_BY_SERVERS: [&str; 1] = ["answer_tokens"];

/// Runs again, compares, prints.
pub fn run(options: &ReplayOptions) -> Result<ExitCode> {
    let run = &options.run;
    let file = RunFile::read(&run.join(RUN_FILE))?;
    let side = robot_side(&file)?;
    let wanted = lines_of(&run.join("decisions.jsonl"))?;
    let mind = match &side.options.model {
        Some(model) => Mind::Recorded(wanted.iter().map(|line| recorded(line, model)).collect::<Result<_>>()?),
        None => Mind::Embedded(Box::new(SymbolicReasoner::default())),
    };
    if side.options.vlm.is_some() {
        bail!("the run asked a vision model (--vlm), whose answers are not kept; it cannot be replayed");
    }
    let script = match std::fs::read_to_string(run.join("commands.txt")) {
        Ok(text) => parse_script(&text).with_context(|| format!("reading {}", run.join("commands.txt").display()))?,
        Err(_) => Vec::new(),
    };
    let log = run.join("events.bin");
    let input = File::open(&log).with_context(|| {
        format!("reading {}; a run keeps what its sensors said if it is run with --record", log.display())
    })?;
    let mut reader =
        EventLogReader::new(BufReader::new(input)).with_context(|| format!("reading {}", log.display()))?;

    let mut mission = Mission::new(
        &side.robot,
        &file.instruction,
        side.mission,
        side.camera,
        mind,
        file.start(),
        &side.start_in_map,
    )?;
    if let Some(known) = side.known {
        mission.know(known);
    }
    let _ = mission.idle();
    let view = ProgressView::new(0, "{elapsed_precise} {spinner} {wide_msg}", options.quiet);
    let mut orders = script.into_iter().peekable();
    let (mut cycles, mut next_news_s) = (0_u64, 0.0);
    while let Some(cycle) = reader.next_cycle().with_context(|| format!("reading {}", log.display()))? {
        mission.perceive(cycle.events);
        let t_s = mission.seconds(cycle.now);
        while let Some((_, control)) = orders.next_if(|(due_s, _)| *due_s <= t_s) {
            // What was refused then stands as a remark in the script and is not here.
            mission.control(&control, cycle.now).with_context(|| format!("at {t_s:.2} s, \"{}\"", control.line()))?;
        }
        mission.cycle(cycle.now);
        cycles += 1;
        if t_s >= next_news_s {
            next_news_s = t_s + 1.0;
            view.show(0, &format!("{t_s:.0} s: {}", mission.activity()), false);
        }
    }
    view.finish();
    ensure!(cycles > 0, "{} holds no cycle", log.display());

    // Written and read as those of the run were: a reader of decimals may be off in the last bit, and then is so in both.
    let reread = |decision| serde_json::from_str(&serde_json::to_string(decision)?);
    let decided: Vec<Value> = mission.journal.decisions.iter().map(reread).collect::<Result<_, serde_json::Error>>()?;
    let first = (0..decided.len().max(wanted.len())).find_map(|index| {
        let what = difference(wanted.get(index), decided.get(index), side.options.model.is_some())?;
        Some((index, what))
    });
    let outcome = match &mission.outcome {
        Some(Outcome::Stopped { target, .. }) => format!("stopped at {target}"),
        Some(Outcome::GaveUp { reason }) => format!("gave up: {reason}"),
        None => "was still under way".to_owned(),
    };
    if options.json {
        arena::say!(
            "{}",
            json!({
                "equal": first.is_none(), "decisions": decided.len(), "recorded_decisions": wanted.len(), "cycles": cycles,
                "outcome": outcome, "first_difference": first.as_ref().map(|(index, what)| json!({"decision": index, "what": what})),
            })
        );
    } else {
        arena::say!("{cycles} cycles from {}: the robot {outcome}.", log.display());
        match &first {
            None => arena::say!("All {} decisions are those of the run, byte for byte.", decided.len()),
            Some((index, what)) => arena::say!("Decision {index} differs: {what}."),
        }
    }
    Ok(if first.is_none() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// What is not the same in two decisions.
fn difference(then: Option<&Value>, now: Option<&Value>, has_server: bool) -> Option<String> {
    let (then, now) = match (then, now) {
        (Some(then), Some(now)) => (then, now),
        (Some(_), None) => return Some("it is not taken any more".into()),
        (None, Some(_)) => return Some("it was not taken then".into()),
        (None, None) => return None,
    };
    let keys = then.as_object()?.keys().chain(now.as_object()?.keys());
    let key = keys
        .filter(|key| !(has_server && SAID_BY_SERVERS.contains(&key.as_str())))
        .find(|key| then[key.as_str()] != now[key.as_str()])?;
    Some(format!("\"{key}\" was {} and is {}", short(&then[key.as_str()]), short(&now[key.as_str()])))
}

fn short(value: &Value) -> String {
    let text = value.to_string();
    let cut: String = text.chars().take(120).collect();
    if cut.len() < text.len() { format!("{cut}...") } else { text }
}

fn lines_of(path: &Path) -> Result<Vec<Value>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let parse = |(index, line): (usize, &str)| {
        serde_json::from_str(line).with_context(|| format!("{} line {}", path.display(), index + 1))
    };
    text.lines().enumerate().map(parse).collect()
}

/// What a model said, from a line of `decisions.jsonl`.
fn recorded(line: &Value, model: &str) -> Result<RecordedDecision> {
    let number = |key: &str| line[key].as_f64().with_context(|| format!("a decision has no \"{key}\""));
    let replies = line["replies"].as_array().context("a decision has no \"replies\"")?;
    // The last of them is the embedded reasoner's, where that took the step.
    let own = replies.len() - usize::from(line["is_fallback"].as_bool().unwrap_or(false)).min(replies.len());
    let text = |reply: &Value| reply.as_str().filter(|text| !text.starts_with('(')).map(str::to_owned);
    Ok(RecordedDecision {
        asked_s: number("asked_s")?,
        decided_s: number("decided_s")?,
        replies: replies[..own].iter().map(text).collect(),
        name: model.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named() {
        let then = json!({"prompt": "a", "answer_tokens": 3, "asked_s": 1.5});
        let mut now = then.clone();
        assert_eq!(difference(Some(&then), Some(&now), false), None);
        now["answer_tokens"] = json!(4);
        assert_eq!(difference(Some(&then), Some(&now), true), None);
        assert!(difference(Some(&then), Some(&now), false).unwrap().contains("answer_tokens"));
        now["prompt"] = json!("b".repeat(500));
        assert!(difference(Some(&then), Some(&now), true).unwrap().len() < 250);
        assert!(difference(None, Some(&now), true).is_some() && difference(None, None, true).is_none());
    }

    #[test]
    fn what_the_model_said_is_told_from_what_was_said_in_its_stead() {
        let line = json!({"asked_s": 1.0, "decided_s": 2.0, "replies": ["{}", "(the model is unreachable)", "x"], "is_fallback": true});
        let recorded = recorded(&line, "m").unwrap();
        assert_eq!(recorded.replies, [Some("{}".to_owned()), None]);
        assert!(super::recorded(&json!({}), "m").is_err());
    }
}
