//! `omnivln ask SCENE "INSTRUCTION"`: the reasoning on a saved scene graph, without a robot; with `--plan` the way of one (`ask_plan.rs`).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use arena::frame::pose_in_map;
use arena::mission::dsg::{SceneGraph, folder, graph_from_json, read_spark_dsg};
use arena::mission::octant_prompt::{
    Critic, Estimate, PromptConfig, Situation, SymbolicReasoner, build_prompt_for, candidates, decide_with_critic,
    parse_instruction,
};
use arena::options::{Pose, parse_pose};
use clap::Args;
use nalgebra::{Isometry3, Point3};
use serde_json::{Value, json};

use crate::bench::Robot;

/// Options of `ask`.
#[derive(Debug, Args)]
pub struct AskOptions {
    /// A run folder, our graph.json, or a spark_dsg JSON file
    pub scene: PathBuf,
    /// What to find, in English
    pub instruction: String,
    /// Where the robot stands: metres and degrees; by default where the graph's robot was last, or in the middle of a room
    #[arg(long, value_name = "X,Y,Z,YAW", allow_hyphen_values = true, value_parser = parse_pose)]
    pub pose: Option<Pose>,
    /// JSON file {"number": "name"} with names for numeric labels
    #[arg(long, value_name = "FILE")]
    pub labels: Option<PathBuf>,
    /// Largest number of tokens in the prompt
    #[arg(long, default_value_t = 600)]
    budget: usize,
    /// Plan the way of a robot, step by step, from graph and map of a run folder alone; exit code 1 where there is none for it
    #[arg(long)]
    pub plan: bool,
    /// Plan for this robot, on the ground or with rotors; what it needs round itself comes from here
    #[arg(long, value_name = "FILE", requires = "plan")]
    pub urdf: Option<PathBuf>,
    /// Plan for a robot of this kind: the built-in one, by default that on the ground
    #[arg(long, value_enum, requires = "plan")]
    pub robot: Option<Robot>,
    /// Draw map and way into one page
    #[arg(long, value_name = "FILE", requires = "plan")]
    pub html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// Loads, reasons, prints.
pub fn run(options: &AskOptions) -> Result<ExitCode> {
    if options.plan {
        return crate::ask_plan::run(options);
    }
    let labels = options.labels.as_deref().map(read_labels).transpose()?;
    let graph = load_graph(&options.scene, labels.as_ref())?;
    let instruction = parse_instruction(&options.instruction);
    ensure!(
        !instruction.steps.is_empty(),
        "the instruction \"{}\" names nothing to go to; say for example \"find the mug near the sink\"",
        options.instruction
    );
    let pose = options.pose.as_ref().map_or_else(|| default_pose(&graph), |pose| Ok(pose_in_map(pose)))?;

    // Without a map, ways are straight lines, and nothing can be stopped at that is not within arm's reach.
    let here = Point3::from(pose.translation.vector);
    let path_length = |point: &Point3<f64>| Some((point - here).norm());
    const STOP_M: f64 = 1.0;
    let can_stop = |id| {
        graph.object(id).is_some_and(|object| {
            let nearest = here.coords.sup(&object.bounds.min.coords).inf(&object.bounds.max.coords);
            (nearest.xy() - here.coords.xy()).norm() <= STOP_M
        })
    };
    let frontiers: Vec<_> = graph.frontiers().map(|place| place.id).collect();
    let situation = Situation {
        frontiers: &frontiers,
        stop_distance_m: STOP_M,
        ..Situation::new(&graph, pose, &instruction, &path_length, &can_stop)
    };
    let config = PromptConfig {
        budget_tokens: options.budget,
        camera_height_m: situation.camera_height_m,
        ..PromptConfig::default()
    };
    config.validate().context("the token budget")?;
    let prompt = build_prompt_for(&situation, &config, &Estimate);
    let critic = Critic::default();
    let mut reasoner = SymbolicReasoner::default();
    let record = decide_with_critic(&mut reasoner, &critic, &situation, &prompt, 0, &mut SymbolicReasoner::default());
    let found = candidates(&situation, &critic.grounding);

    let rooms: Vec<Value> = graph
        .rooms()
        .map(|room| {
            let objects = graph.objects().filter(|object| object.room == Some(room.id)).count();
            json!({
                "id": room.id.to_string(), "name": room.name, "center": [room.center.x, room.center.y, room.center.z],
                "objects": objects,
            })
        })
        .collect();
    let ranked: Vec<Value> = found
        .objects
        .iter()
        .take(10)
        .filter_map(|candidate| {
            let object = graph.object(candidate.found.id)?;
            Some(json!({
                "id": object.id.to_string(), "label": object.label, "score": candidate.found.total,
                "accepted": candidate.is_accepted,
                "room": object.room.map(|room| room.to_string()),
                "position": [object.centroid.x, object.centroid.y, object.centroid.z],
            }))
        })
        .collect();
    let reply = record.reply.as_ref();
    let trace: Vec<Value> = reply
        .into_iter()
        .flat_map(|reply| &reply.trace)
        .map(|step| json!({"step": step.step.word(), "input": step.input, "output": step.output}))
        .collect();
    let action = reply.map_or_else(|| "hold".to_owned(), |reply| reply.action.text(&prompt.names));
    let objections: Vec<String> = record.objections().map(|critique| critique.message.clone()).collect();
    let verdict = if reply.is_some() { "accepted".to_owned() } else { format!("rejected: {}", objections.join("; ")) };

    if options.json {
        let answer = json!({
            "rooms": rooms, "candidates": ranked, "prompt": prompt.text, "prompt_tokens": prompt.tokens,
            "trace": trace, "action": action, "verdict": verdict,
        });
        arena::say!("{answer}");
    } else {
        print_answer(&graph, &rooms, &ranked, &prompt.text, prompt.tokens, &trace, &action, &verdict);
    }
    Ok(ExitCode::SUCCESS)
}

#[allow(clippy::too_many_arguments)] // the parts of one page
fn print_answer(
    graph: &SceneGraph,
    rooms: &[Value],
    ranked: &[Value],
    prompt: &str,
    tokens: usize,
    trace: &[Value],
    action: &str,
    verdict: &str,
) {
    arena::say!("Scene: {} rooms, {} objects, {} places", rooms.len(), graph.objects().count(), graph.places().count());
    for room in rooms {
        arena::say!("  {} {} ({} objects)", text(&room["id"]), text(&room["name"]), room["objects"]);
    }
    arena::say!("\nCandidates:");
    if ranked.is_empty() {
        arena::say!("  none");
    }
    for candidate in ranked {
        arena::say!(
            "  {} {} (score {:.2}, room {})",
            text(&candidate["id"]),
            text(&candidate["label"]),
            candidate["score"].as_f64().unwrap_or(0.0),
            candidate["room"].as_str().unwrap_or("unknown")
        );
    }
    arena::say!("\nPrompt ({tokens} tokens):\n{prompt}\n\nReasoning:");
    for step in trace {
        arena::say!("  {}: {} -> {}", text(&step["step"]), text(&step["input"]), text(&step["output"]));
    }
    arena::say!("\nAction: {action}\nCritic: {verdict}");
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or("")
}

/// A folder of ours, a file of ours, or a file of spark_dsg.
fn load_graph(path: &Path, labels: Option<&BTreeMap<u32, String>>) -> Result<SceneGraph> {
    if path.is_dir() {
        return Ok(folder::load(path).with_context(|| format!("reading the run folder {}", path.display()))?.graph);
    }
    const LARGEST: u64 = 1 << 31;
    let size = std::fs::metadata(path).with_context(|| format!("reading {}", path.display()))?.len();
    ensure!(size <= LARGEST, "{} has {size} bytes; at most {LARGEST} are read", path.display());
    let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    // Ours says so in its first keys; everything else is tried as spark_dsg.
    let ours = graph_from_json(&bytes);
    match ours {
        Ok(graph) => Ok(graph),
        Err(our_error) => {
            let is_ours = bytes.windows(10).take(4096).any(|window| window == b"\"omni-dsg\"");
            if is_ours {
                bail!("{}: {our_error}", path.display());
            }
            read_spark_dsg(&bytes, labels)
                .with_context(|| format!("{} is neither a scene graph of ours nor one of spark_dsg", path.display()))
        }
    }
}

fn read_labels(path: &Path) -> Result<BTreeMap<u32, String>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading the labels {}", path.display()))?;
    let names: BTreeMap<String, String> = serde_json::from_str(&text)
        .with_context(|| format!("{} is not a JSON object {{\"number\": \"name\"}}", path.display()))?;
    names
        .into_iter()
        .map(|(number, name)| {
            let number =
                number.parse().with_context(|| format!("{}: '{number}' is not a label number", path.display()))?;
            Ok((number, name))
        })
        .collect()
}

/// Where the graph's robot was last; else the middle of the room with the smallest id, else of everything.
pub fn default_pose(graph: &SceneGraph) -> Result<Isometry3<f64>> {
    if let Some(last) = graph.agents().filter_map(|agent| agent.trajectory.last()).max_by_key(|pose| pose.stamp_ns) {
        return Ok(last.world_from_body);
    }
    let at = graph
        .rooms()
        .map(|room| room.center)
        .next()
        .or_else(|| graph.places().map(|place| place.position).next())
        .or_else(|| graph.objects().map(|object| object.centroid).next())
        .context("the scene graph is empty: it has no room, place or object")?;
    Ok(Isometry3::translation(at.x, at.y, at.z))
}
