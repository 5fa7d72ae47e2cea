//! `omnivln bench tiers`: does a prompt say enough? Readers that get nothing but the prompt answer on the nine scenes, for the flat list
//! and for ours; `--export` and `--import` let any model anywhere be the reader.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use arena::mission::dsg::{ObjectId, SceneGraph};
use arena::mission::octant_prompt::{Estimate, NameTable, flat_json, parse_reply, point_in_body, tools};
use clap::Args;
use serde_json::{Map, Value, json};

use crate::bench_page::{Page, ReportOptions};
use crate::bench_tokens::prompt_of;
use crate::json_lines::{read_lines, write_lines};
use crate::nine_scenes::{agent, classes_of, in_situation, nine_scene};
use crate::prompt_reader::{read_flat, read_ours};

/// Success on D1 to D9 with the flat list, in per cent, as far as the paper's text says it of its figure.
pub const PAPER_FLAT: [Option<f64>; 9] =
    [None, None, Some(80.0), Some(100.0), Some(100.0), Some(100.0), None, None, Some(16.0)];
/// The same with its hierarchical prompt.
pub const PAPER_OURS: [Option<f64>; 9] = {
    let all = Some(100.0);
    [all, all, all, all, all, all, None, None, Some(80.0)]
};

/// Options of `bench tiers`.
#[derive(Debug, Args)]
pub struct TiersOptions {
    /// Number of scenes drawn for each of D1 to D9
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Write the prompts, a JSON object a line: {"key", "format", "prompt"}
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Score these answers instead of the built-in readers': {"key", "format", "answer"} a line; for flat an id, for ours an action
    #[arg(long, value_name = "FILE")]
    import: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOptions,
}

/// One question: a scene and a class, with both prompts.
struct Question {
    key: String,
    flat: String,
    ours: String,
    names: NameTable,
    right: ObjectId,
}

/// Asks, scores, prints.
pub fn run(options: &TiersOptions) -> Result<ExitCode> {
    let given = options.import.as_deref().map(read_answers).transpose()?;
    let mut exported = Vec::new();
    let mut report = Map::new();
    let (mut flat_percent, mut ours_percent) = (Vec::new(), Vec::new());
    for number in 1..=9 {
        let (mut flat, mut ours, mut n) = (0, 0, 0);
        for seed in 0..options.seeds {
            let graph = nine_scene(number, seed);
            for class in classes_of(&graph) {
                let question = question(&graph, number, seed, &class)?;
                let (flat_answer, ours_answer) = match &given {
                    Some(given) => (
                        given.get(&(question.key.clone(), "flat".into())).cloned(),
                        given.get(&(question.key.clone(), "ours".into())).cloned(),
                    ),
                    None => (read_flat(&question.flat), ours_reader(&graph, &class, &question)),
                };
                flat += usize::from(flat_answer.is_some_and(|answer| first_number(&answer) == Some(question.right.0)));
                ours += usize::from(ours_answer.is_some_and(|answer| {
                    parse_reply(&answer, &question.names)
                        .is_ok_and(|reply| reply.action.object() == Some(question.right))
                }));
                n += 1;
                for (format, prompt) in [("flat", &question.flat), ("ours", &question.ours)] {
                    exported.push(json!({"key": question.key, "format": format, "prompt": prompt}));
                }
            }
        }
        let share = |right: usize| right as f64 / f64::from(n);
        flat_percent.push(Some(100.0 * share(flat)));
        ours_percent.push(Some(100.0 * share(ours)));
        report.insert(format!("D{number}"), json!({"flat": share(flat), "ours": share(ours), "n": n}));
    }
    write_lines(options.export.as_deref(), &exported)?;
    report.insert("reader".into(), json!(if given.is_some() { "imported" } else { "symbolic" }));
    options.report.write_page(|| {
        let mut columns = vec![String::new()];
        columns.extend((1..=9).map(|number| format!("D{number}")));
        Page {
            title: "Right answers from the prompt alone",
            note: "\"go to the nearest ...\" on the nine scenes, in per cent; readers that make no mistake of their own. Of the paper, what its text says.",
            columns,
            rows: vec![
                ("paper, flat".into(), PAPER_FLAT.to_vec()),
                ("paper, hierarchical".into(), PAPER_OURS.to_vec()),
                ("flat json".into(), flat_percent),
                ("ours".into(), ours_percent),
            ],
            decimals: 1,
            unit: "%",
            drawn: vec![0, 1, 2, 3],
            rest: String::new(),
        }
        .html()
    })?;
    if options.report.json {
        arena::say!("{}", Value::Object(report));
    } else {
        for (name, row) in &report {
            arena::say!("{name}: {row}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn question(graph: &SceneGraph, number: usize, seed: u64, class: &str) -> Result<Question> {
    let instruction = format!("go to the nearest {class}");
    let prompt = prompt_of(graph, &agent(), &instruction, &Estimate);
    let of_class = graph.objects().filter(|object| object.label == class);
    let right = of_class
        .map(|object| (point_in_body(&agent(), &object.centroid).coords.norm(), object.id))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
        .context("a class without an object")?;
    Ok(Question {
        key: format!("D{number}-{seed}-{class}"),
        flat: flat_json(graph, &agent(), &instruction),
        ours: prompt.text,
        names: prompt.names,
        right: right.1,
    })
}

/// The reader of our prompt, with the one tool it needs.
fn ours_reader(graph: &SceneGraph, class: &str, question: &Question) -> Option<String> {
    in_situation(graph, &format!("go to the nearest {class}"), |situation| {
        let tools = tools::ToolBox { situation, names: &question.names };
        let path_m = |name: &str| tools::call("path_length", &json!({"id": name}), &tools).ok()?["path_m"].as_f64();
        read_ours(&question.ours, path_m)
    })
}

fn first_number(answer: &str) -> Option<u64> {
    answer.split(|c: char| !c.is_ascii_digit()).find(|part| !part.is_empty())?.parse().ok()
}

/// (key, format) -> answer.
fn read_answers(path: &Path) -> Result<HashMap<(String, String), String>> {
    let answers = read_lines(path, |line| {
        let row: Value = serde_json::from_str(line)?;
        let text = |key: &str| -> Result<String> {
            Ok(row[key].as_str().with_context(|| format!("\"{key}\" must be a text"))?.to_string())
        };
        Ok(((text("key")?, text("format")?), text("answer")?))
    })?;
    Ok(answers.into_iter().collect())
}
