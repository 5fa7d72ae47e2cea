//! `omnivln bench tokens`: what a prompt costs on the nine scenes of the paper's Table II, and how it grows with the building.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};
use arena::chart::lines;
use arena::intervals::paired_mean_95;
use arena::mission::dsg::SceneGraph;
use arena::mission::octant_prompt::{
    BytePairs, Critic, Critique, Estimate, Prompt, PromptConfig, Reply, SymbolicReasoner, TokenCounter, build_prompt,
    build_prompt_for, caption_free, decide_with_critic, flat_json, flat_text, flat_text_in_body, reply_schema,
    system_text, tools, user_text,
};
use arena::whole_file::write_whole;
use clap::Args;
use nalgebra::Isometry3;
use serde_json::{Map, Value, json};

use crate::bench_page::{Page, ReportOptions, table};
use crate::nine_scenes::{CAMERA_HEIGHT_M, OBJECTS, agent, classes_of, grid, in_situation, middle_of, nine_scene};

/// The paper's Table II, tokens: the flat list.
pub const PAPER_FLAT: [f64; 9] = [402.60, 746.80, 1153.07, 398.80, 806.50, 1181.60, 1126.33, 2089.33, 3555.98];
/// Its hierarchical prompt.
pub const PAPER_OURS: [f64; 9] = [401.60, 440.40, 604.27, 291.80, 446.50, 584.93, 496.27, 735.27, 1067.62];
/// Sides of the grids of rooms whose prompts show the growth, ten objects a room.
const SIDES: [usize; 12] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64];
/// Objects a room in a building of a hundred rooms.
const CROWDS: [usize; 5] = [5, 10, 20, 50, 100];

/// Options of `bench tokens`.
#[derive(Debug, Args)]
pub struct TokensOptions {
    /// Count exactly, with the tokenizer.json of a model of the Qwen 2, 2.5 or 3 families; by default an estimate
    #[arg(long, value_name = "FILE")]
    tokenizer: Option<PathBuf>,
    /// Number of scenes drawn for each of D1 to D9
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Write every prompt of ours and of the baselines into DIR
    #[arg(long, value_name = "DIR")]
    dump: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOptions,
}

/// The formats that are compared.
const FORMATS: [&str; 5] = ["flat_json", "flat_text", "flat_body", "caption_free", "ours"];

/// Measures and prints.
pub fn run(options: &TokensOptions) -> Result<ExitCode> {
    let exact = options.tokenizer.as_deref().map(read_tokenizer).transpose()?;
    let counter: &dyn TokenCounter = exact.as_ref().map_or(&Estimate, |exact| exact);
    if let Some(folder) = &options.dump {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    let mut report = Map::new();
    let mut table: Vec<Vec<f64>> = vec![Vec::new(); FORMATS.len() + 1];
    for number in 1..=9 {
        let mut sums = vec![0.0; FORMATS.len() + 1];
        let mut count = 0.0;
        let mut reductions = Vec::new();
        for seed in 0..options.seeds {
            let graph = nine_scene(number, seed);
            for class in classes_of(&graph) {
                let text = format!("go to the nearest {class}");
                let texts = texts(&graph, &text, counter);
                let counted = texts.each_ref().map(|text| counter.count(text) as f64);
                sums.iter_mut().zip(counted).for_each(|(sum, tokens)| *sum += tokens);
                reductions.push(1.0 - counted[4] / counted[0]);
                *sums.last_mut().expect("one more than formats") += episode(&graph, &text, counter)? as f64;
                count += 1.0;
                if let Some(folder) = &options.dump {
                    for (name, text) in FORMATS.iter().zip(&texts) {
                        let path = folder.join(format!("D{number}-{seed}-{class}-{name}.txt"));
                        write_whole(&path, |out| out.write_all(text.as_bytes()))?;
                    }
                }
            }
        }
        let means: Vec<f64> = sums.iter().map(|sum| sum / count).collect();
        let mut row = json!({"objects": OBJECTS[number - 1], "n": count, "ours_episode": means[5], "reduction": 1.0 - means[4] / means[0]});
        // Of single questions, in pairs; the figure above is that of the means.
        row["paired_reduction"] = json!(paired_mean_95(&reductions));
        for (name, mean) in FORMATS.iter().zip(&means) {
            row[*name] = json!(mean);
        }
        report.insert(format!("D{number}"), row);
        for (column, mean) in table.iter_mut().zip(means) {
            column.push(mean);
        }
    }
    let growth = growth(counter);
    report.insert("growth".into(), growth.iter().map(Growth::json).collect());
    report.insert("growth_r2".into(), json!(r_squared(&growth)));
    report.insert("counter".into(), json!(if exact.is_some() { "exact" } else { "estimate" }));

    options.report.write_page(|| page(&table, &growth, exact.is_some()))?;
    if options.report.json {
        arena::say!("{}", Value::Object(report));
    } else {
        print(&table, &growth, exact.is_some());
    }
    Ok(ExitCode::SUCCESS)
}

/// Reads a tokenizer.json.
fn read_tokenizer(path: &Path) -> Result<BytePairs> {
    let file = std::fs::File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    BytePairs::read(std::io::BufReader::new(file)).with_context(|| path.display().to_string())
}

/// The prompt of the nine scenes, with a budget that it never reaches.
pub fn prompt_of(graph: &SceneGraph, pose: &Isometry3<f64>, instruction: &str, counter: &dyn TokenCounter) -> Prompt {
    build_prompt(graph, pose, instruction, &roomy(), counter)
}

/// A configuration whose budget cuts nothing here.
pub fn roomy() -> PromptConfig {
    PromptConfig { budget_tokens: 100_000, camera_height_m: CAMERA_HEIGHT_M, ..PromptConfig::default() }
}

/// The text of each format.
fn texts(graph: &SceneGraph, instruction: &str, counter: &dyn TokenCounter) -> [String; 5] {
    let pose = agent();
    [
        flat_json(graph, &pose, instruction),
        flat_text(graph, &pose, instruction),
        flat_text_in_body(graph, &pose, instruction),
        caption_free(graph, &pose, CAMERA_HEIGHT_M, instruction),
        prompt_of(graph, &pose, instruction, counter).text,
    ]
}

/// All that goes over the line until an action is accepted: for every attempt system text, prompt with the objections so far, schema with its
/// enum, tools, and an answer in full.
fn episode(graph: &SceneGraph, text: &str, counter: &dyn TokenCounter) -> Result<usize> {
    /// As a mission asks.
    const MAX_RETRIES: usize = 2;
    in_situation(graph, text, |situation| {
        let prompt = build_prompt_for(situation, &roomy(), counter);
        let (mut asked, mut fallback) = (SymbolicReasoner::default(), SymbolicReasoner::default());
        let record = decide_with_critic(&mut asked, &Critic::default(), situation, &prompt, MAX_RETRIES, &mut fallback);
        let every_time =
            [system_text().to_string(), reply_schema(&prompt.names).to_string(), tools::definitions().to_string()];
        let every_time: usize = every_time.iter().map(|text| counter.count(text)).sum();
        let mut objections: Vec<Critique> = Vec::new();
        let mut tokens = 0;
        for attempt in &record.attempts {
            let reply = attempt.outcome.as_ref().map_err(|error| error.clone())?;
            tokens +=
                every_time + counter.count(&user_text(&prompt, &objections)) + counter.count(&answer(reply, &prompt));
            objections.extend(attempt.objection.clone());
        }
        Ok(tokens)
    })
}

/// A reply as a model would write it: all steps and the action.
fn answer(reply: &Reply, prompt: &Prompt) -> String {
    let action = reply.action.text(&prompt.names);
    let (verb, target) = action.trim_end_matches(')').split_once('(').unwrap_or((&action, ""));
    let said = |index: usize| reply.trace.get(index).map_or("", |line| line.output.as_str());
    json!({
        "room": said(0), "direction": said(1), "group": said(2), "object": said(3), "target": target, "stop": verb == "stop",
    })
    .to_string()
}

/// One building.
struct Growth {
    rooms: usize,
    objects: usize,
    tokens: usize,
    build_us: f64,
}

impl Growth {
    fn json(&self) -> Value {
        json!({"objects": self.objects, "rooms": self.rooms, "tokens": self.tokens, "build_us": self.build_us})
    }
}

fn growth(counter: &dyn TokenCounter) -> Vec<Growth> {
    /// The fastest of at least this many builds is reported, and of as many as fit into this time: the others were disturbed.
    const REPEATS: usize = 5;
    const LEAST_S: f64 = 0.1;
    let sizes = SIDES.iter().map(|side| (*side, 10)).chain(CROWDS.iter().map(|each| (10, *each)));
    sizes
        .map(|(side, each)| {
            let graph = grid(side, each, 0);
            let pose = middle_of(side);
            let mut build_us = f64::INFINITY;
            let begun = Instant::now();
            let mut builds = 0;
            while builds < REPEATS || begun.elapsed().as_secs_f64() < LEAST_S {
                builds += 1;
                let start = Instant::now();
                std::hint::black_box(prompt_of(&graph, &pose, "go to the nearest chair", &Estimate));
                build_us = build_us.min(start.elapsed().as_secs_f64() * 1e6);
            }
            let prompt = prompt_of(&graph, &pose, "go to the nearest chair", counter);
            Growth { rooms: side * side, objects: side * side * each, tokens: prompt.tokens, build_us }
        })
        .collect()
}

/// Of tokens against log2(objects), over the buildings with ten objects a room.
fn r_squared(growth: &[Growth]) -> f64 {
    let points: Vec<(f64, f64)> =
        growth[..SIDES.len()].iter().map(|row| ((row.objects as f64).log2(), row.tokens as f64)).collect();
    let count = points.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|(x, y)| of(x - mx, y - my)).sum::<f64>();
    sum(&|x, y| x * y).powi(2) / (sum(&|x, _| x * x) * sum(&|_, y| y * y))
}

fn page(table: &[Vec<f64>], growth: &[Growth], is_exact: bool) -> String {
    let row = |name: &str, values: &[f64]| (name.to_string(), values.iter().copied().map(Some).collect());
    let reduction = |ours: &[f64], flat: &[f64]| -> Vec<f64> {
        ours.iter().zip(flat).map(|(ours, flat)| 100.0 * (1.0 - ours / flat)).collect()
    };
    let mut rows = vec![row("paper, flat", &PAPER_FLAT), row("paper, hierarchical", &PAPER_OURS)];
    rows.extend(FORMATS.iter().zip(table).map(|(name, values)| row(&name.replace('_', " "), values)));
    rows.push(row("ours, whole episode", &table[5]));
    rows.push(row("paper, reduction %", &reduction(&PAPER_OURS, &PAPER_FLAT)));
    rows.push(row("ours against flat json, reduction %", &reduction(&table[4], &table[0])));
    let mut columns = vec![String::new()];
    columns.extend((1..=9).map(|number| format!("D{number}")));
    Page {
        title: "Tokens of a prompt",
        note: &format!(
            "Mean over seeds and classes of \"go to the nearest ...\", counted {}. Whole episode: system text, prompt, schema, tools, answer.",
            if is_exact { "with the given tokenizer" } else { "by the estimate without a vocabulary" }
        ),
        columns,
        rows,
        decimals: 1,
        unit: "tokens",
        drawn: vec![0, 1, 2, 6],
        rest: growth_section(growth),
    }
    .html()
}

/// How a prompt grows with the building: table, and tokens over log2 of the objects, where logarithmic growth is a straight line.
fn growth_section(growth: &[Growth]) -> String {
    let columns = ["objects", "rooms", "tokens", "build, us"].map(str::to_string);
    let cells = |row: &Growth| vec![Some(row.rooms as f64), Some(row.tokens as f64), Some(row.build_us.round())];
    let rows: Vec<_> = growth.iter().map(|row| (row.objects.to_string(), cells(row))).collect();
    let points = |rows: &[Growth]| rows.iter().map(|row| ((row.objects as f64).log2(), row.tokens as f64)).collect();
    let (sides, crowds) = growth.split_at(SIDES.len());
    format!(
        "<h2>Growth with the building</h2><p>Ten objects a room in {} to {} rooms, then {} to {} objects a room in a hundred rooms. Of the first, tokens \
         against log2 of the objects have an R2 of {:.3}.</p>{}{}",
        sides[0].rooms,
        sides[sides.len() - 1].rooms,
        CROWDS[0],
        CROWDS[CROWDS.len() - 1],
        r_squared(growth),
        table(&columns, &rows, 0),
        lines(
            "Tokens of the prompt",
            "tokens",
            "log2 of the number of objects",
            &[("ten objects a room", points(sides)), ("a hundred rooms", points(crowds))]
        ),
    )
}

fn print(table: &[Vec<f64>], growth: &[Growth], is_exact: bool) {
    arena::say!("tokens, {}", if is_exact { "exact" } else { "estimated" });
    let names = FORMATS.iter().copied().chain(["ours_episode"]);
    for (name, values) in names.zip(table) {
        let cells: Vec<String> = values.iter().map(|value| format!("{value:8.1}")).collect();
        arena::say!("{name:14}{}", cells.join(""));
    }
    for row in growth {
        arena::say!(
            "{:6} objects in {:5} rooms: {:5} tokens, {:.0} us",
            row.objects,
            row.rooms,
            row.tokens,
            row.build_us
        );
    }
    arena::say!("R2 of tokens against log2(objects): {:.4}", r_squared(growth));
}
