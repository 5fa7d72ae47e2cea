//! `omnivln bench latency`: where the time of a decision goes: writing the prompt, the way to the model, its first token, its answer, and
//! asking again after an objection. The flat list and our prompt are put to one and the same model; the same critic judges both.

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use arena::mission::chat_stream::{TimedReply, chat_timed};
use arena::mission::dsg::{ObjectId, SceneGraph};
use arena::mission::octant_prompt::{
    Action, Critic, Critique, Estimate, NameTable, Situation, TokenCounter, build_prompt_for, flat_json, parse_reply,
    reply_schema, system_text, user_text,
};
use arena::mission::openai::{ChatConfig, ChatError};
use clap::Args;
use serde_json::{Value, json};

use crate::bench_page::{Page, ReportOptions};
use crate::bench_tokens::roomy;
use crate::local_model;
use crate::nine_scenes::{agent, classes_of, in_situation, nine_scene};
use arena::quantile::quantile;

/// The paper's time of a decision with the flat list and with its hierarchical prompt, seconds.
pub const PAPER_S: [f64; 2] = [12.4, 3.8];
/// Times that an answer may be objected to before the decision is given up.
const MAX_RETRIES: usize = 2;

/// Options of `bench latency`.
#[derive(Debug, Args)]
pub struct LatencyOptions {
    /// Base URL of an OpenAI-compatible server, e.g. http://127.0.0.1:8091/v1; by default a reader in this process answers at once
    #[arg(long, value_name = "URL")]
    llm: Option<String>,
    /// Name of the model on that server
    #[arg(long, value_name = "NAME", default_value = "default", requires = "llm")]
    model: String,
    /// Longest wait for one answer, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    timeout: f64,
    /// Number of decisions with each format, in turn over the nine scenes
    #[arg(long, default_value_t = 90, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    decisions: u64,
    #[command(flatten)]
    report: ReportOptions,
}

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Flat,
    Ours,
}

/// The stages of one decision, milliseconds, and how it ended.
#[derive(Debug, Clone, Default)]
struct Decision {
    /// 1 to 9.
    scene: usize,
    build_us: f64,
    tokens: usize,
    /// These three of the first answer, if it came in time.
    network_ms: Option<f64>,
    first_token_ms: Option<f64>,
    answer_ms: Option<f64>,
    /// Everything, with all repetitions.
    decision_ms: f64,
    retries: usize,
    is_accepted: bool,
    is_right: bool,
}

/// Measures and prints.
pub fn run(options: &LatencyOptions) -> Result<ExitCode> {
    ensure!(options.timeout > 0.0 && options.timeout.is_finite(), "--timeout must be a positive number of seconds");
    let base_url = options.llm.clone().map_or_else(local_model::start, Ok)?;
    let model = if options.llm.is_some() { options.model.as_str() } else { local_model::NAME };
    let chat_config = ChatConfig { timeout_s: options.timeout, ..ChatConfig::new(&base_url, model) };
    let mut all: [Vec<Decision>; 2] = Default::default();
    for index in 0..options.decisions {
        let (number, seed) = (1 + (index % 9) as usize, index / 9);
        let graph = nine_scene(number, seed);
        let classes = classes_of(&graph);
        let class = &classes[seed as usize % classes.len()];
        for (at, format) in [Format::Flat, Format::Ours].into_iter().enumerate() {
            let mut decision = decide(&graph, class, format, &chat_config)
                .with_context(|| format!("asking about scene D{number} of seed {seed}"))?;
            decision.scene = number;
            all[at].push(decision);
        }
    }
    let [flat, ours] = &all;
    options.report.write_page(|| page(flat, ours, model))?;
    if options.report.json {
        arena::say!("{}", json!({"model": model, "flat": report(flat), "ours": report(ours)}));
    } else {
        arena::say!("{model}, {} decisions each; p50 and p95", options.decisions);
        for (name, decisions) in [("flat", flat), ("ours", ours)] {
            for (stage, unit, values) in stages(decisions) {
                let [half, most] =
                    [0.5, 0.95].map(|share| quantile(&values, share).map_or("-".into(), |value| format!("{value:.1}")));
                arena::say!("{name:5} {stage:12} {half:>10} {most:>10} {unit}");
            }
            let count = |is: fn(&Decision) -> bool| decisions.iter().filter(|decision| is(decision)).count();
            arena::say!(
                "{name:5} accepted {} and right {} of {}",
                count(|d| d.is_accepted),
                count(|d| d.is_right),
                decisions.len()
            );
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn decide(graph: &SceneGraph, class: &str, format: Format, chat_config: &ChatConfig) -> Result<Decision> {
    let instruction = format!("go to the nearest {class}");
    in_situation(graph, &instruction, |situation| {
        let start = Instant::now();
        let asked = match format {
            Format::Flat => Asked::flat(graph, &instruction),
            Format::Ours => Asked::ours(situation),
        };
        let mut decision = Decision { build_us: start.elapsed().as_secs_f64() * 1e6, ..Decision::default() };
        let mut user = asked.user.clone();
        for attempt in 0..=MAX_RETRIES {
            decision.retries = attempt;
            let reply = match chat_timed(chat_config, asked.system, &user, ("action", &asked.schema)) {
                Ok(reply) => reply,
                // Late or broken off: this attempt is lost, and its time is not.
                Err(ChatError::Timeout(_) | ChatError::Unreadable(_)) => continue,
                Err(other) => return Err(other.into()),
            };
            if attempt == 0 {
                let TimedReply { network_s, first_token_s, answer_s, .. } = reply;
                decision.network_ms = Some(1e3 * network_s);
                decision.first_token_ms = first_token_s.map(|seconds| 1e3 * seconds);
                decision.answer_ms = Some(1e3 * answer_s);
            }
            match asked.judged(&reply.text, situation) {
                Ok(action) => {
                    decision.is_accepted = true;
                    decision.is_right = action.object() == nearest(graph, class);
                    break;
                }
                Err(objection) => user = format!("{}\nRejected: {objection}", asked.user),
            }
        }
        decision.decision_ms = 1e3 * start.elapsed().as_secs_f64();
        // Counting is no part of deciding.
        decision.tokens = Estimate.count(&asked.user);
        Ok(decision)
    })
}

/// One question in one format.
struct Asked {
    system: &'static str,
    user: String,
    schema: Value,
    revision: u64,
    /// None for the flat list, whose ids are the graph's.
    names: Option<NameTable>,
}

impl Asked {
    fn flat(graph: &SceneGraph, instruction: &str) -> Asked {
        let ids: Vec<u64> = graph.objects().map(|object| object.id.0).collect();
        Asked {
            system: "You steer a robot through a building. Reply with one JSON object: the id of the object to go to.",
            user: flat_json(graph, &agent(), instruction),
            schema: json!({
                "type": "object", "properties": {"id": {"type": "integer", "enum": ids}}, "required": ["id"], "additionalProperties": false,
            }),
            revision: graph.revision(),
            names: None,
        }
    }

    fn ours(situation: &Situation) -> Asked {
        let prompt = build_prompt_for(situation, &roomy(), &Estimate);
        Asked {
            system: system_text(),
            user: user_text(&prompt, &[]),
            schema: reply_schema(&prompt.names),
            revision: prompt.revision,
            names: Some(prompt.names),
        }
    }

    /// The action if the critic accepts it, else the objection.
    fn judged(&self, text: &str, situation: &Situation) -> Result<Action, String> {
        let action = match &self.names {
            Some(names) => parse_reply(text, names).map_err(|error| error.to_string())?.action,
            None => {
                let row: Value =
                    serde_json::from_str(text.trim()).map_err(|_| "the reply is no JSON object".to_string())?;
                Action::GoNear(ObjectId(row["id"].as_u64().ok_or("\"id\" must be the number of an object")?))
            }
        };
        let verdict = Critic::default().check(&action, situation, self.revision);
        verdict.map(|()| action).map_err(|Critique { message, .. }| message)
    }
}

fn nearest(graph: &SceneGraph, class: &str) -> Option<ObjectId> {
    let here = agent().translation.vector;
    let of_class = graph.objects().filter(|object| object.label == class);
    let distances = of_class.map(|object| ((object.centroid.coords - here).norm(), object.id));
    distances.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, id)| id)
}

type Stage = (&'static str, &'static str, Vec<f64>);

fn stages(decisions: &[Decision]) -> [Stage; 6] {
    let each = |of: fn(&Decision) -> f64| decisions.iter().map(of).collect::<Vec<f64>>();
    [
        ("build", "us", each(|decision| decision.build_us)),
        ("network", "ms", decisions.iter().filter_map(|decision| decision.network_ms).collect()),
        ("first_token", "ms", decisions.iter().filter_map(|decision| decision.first_token_ms).collect()),
        ("answer", "ms", decisions.iter().filter_map(|decision| decision.answer_ms).collect()),
        ("retries", "", each(|decision| decision.retries as f64)),
        ("decision", "ms", each(|decision| decision.decision_ms)),
    ]
}

fn report(decisions: &[Decision]) -> Value {
    let count = decisions.len() as f64;
    let share = |is: fn(&Decision) -> bool| decisions.iter().filter(|decision| is(decision)).count() as f64 / count;
    let mut out = json!({
        "n": decisions.len(),
        "accepted": share(|decision| decision.is_accepted),
        "right": share(|decision| decision.is_right),
        "prompt_tokens_mean": decisions.iter().map(|decision| decision.tokens as f64).sum::<f64>() / count,
    });
    for number in 1..=9 {
        let of_scene = || decisions.iter().filter(|decision| decision.scene == number);
        out["by_scene"][format!("D{number}")] =
            json!({"n": of_scene().count(), "right": of_scene().filter(|decision| decision.is_right).count()});
    }
    for (stage, unit, values) in stages(decisions) {
        let key = if unit.is_empty() { stage.to_string() } else { format!("{stage}_{unit}") };
        out[key] = json!({"p50": quantile(&values, 0.5), "p95": quantile(&values, 0.95)});
    }
    out
}

fn page(flat: &[Decision], ours: &[Decision], model: &str) -> String {
    let row = |name: &str, decisions: &[Decision], share: f64| {
        let in_ms = |(_, unit, values): Stage| {
            quantile(&values, share).map(|value| if unit == "us" { 1e-3 * value } else { value })
        };
        (name.to_string(), stages(decisions).map(in_ms).to_vec())
    };
    let paper = |name: &str, seconds: f64| (name.to_string(), vec![None, None, None, None, None, Some(1e3 * seconds)]);
    Page {
        title: "Where the time of a decision goes",
        note: &format!(
            "\"go to the nearest ...\" on the nine scenes, {} decisions with each format, asked of: {model}. Milliseconds, but for the retries. \
             Network is the opening of a connection, the first token and the answer are those of the first request; the decision holds all \
             of it. The in-process reader is no model: with it, everything but the model's thinking is measured. The paper measured whole decisions with a \
             large model on other machines.",
            flat.len()
        ),
        columns: ["", "build", "network", "first token", "answer", "retries", "decision"].map(str::to_string).to_vec(),
        rows: vec![
            row("flat json, p50", flat, 0.5),
            row("flat json, p95", flat, 0.95),
            row("ours, p50", ours, 0.5),
            row("ours, p95", ours, 0.95),
            paper("paper, flat", PAPER_S[0]),
            paper("paper, hierarchical", PAPER_S[1]),
        ],
        decimals: 3,
        unit: "ms",
        drawn: vec![0, 2],
        rest: String::new(),
    }
    .html()
}
