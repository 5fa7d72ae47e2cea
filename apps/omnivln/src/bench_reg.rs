//! `omnivln bench reg`: one description for each thing of recorded rooms, checked by a listener (the grounder, which reads the text and the
//! boxes) and by plain inequalities on the boxes (`clause_truth`, which shares no operator with the listener). The paper's Table I on
//! more than its 44 objects.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use arena::mission::octant_prompt::clause_truth::is_true;
use arena::mission::octant_prompt::describe::{Description, describe, describe_from_a_view};
use arena::mission::octant_prompt::grounding::Scene;
use arena::mission::octant_prompt::refer_set::read_scene;
use arena::whole_file::write_whole;
use clap::Args;
use serde_json::json;

use crate::bench_page::Page;

/// Options of `bench reg`.
#[derive(Debug, Args)]
pub struct RegOptions {
    /// Scenes of labelled boxes, a JSON object a line
    #[arg(long, value_name = "FILE")]
    scenes: PathBuf,
    /// Describe things of this many scenes, spread over the file
    #[arg(long, default_value_t = 60)]
    count: usize,
    /// Write the descriptions, a JSON object a line
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write a page with table and chart
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Describes, checks, prints.
pub fn run(options: &RegOptions) -> Result<ExitCode> {
    let text = std::fs::read_to_string(&options.scenes)
        .with_context(|| format!("cannot read {}", options.scenes.display()))?;
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    ensure!(!lines.is_empty() && options.count > 0, "{} holds no scene to describe", options.scenes.display());
    let step = (lines.len() / options.count.min(lines.len())).max(1);
    let (mut objects, mut accepted, mut words, mut with_view, mut view_accepted) = (0, 0, 0, 0, 0);
    let mut written = Vec::new();
    for (at, line) in lines.iter().enumerate().step_by(step).take(options.count) {
        let (name, scene) =
            read_scene(line).with_context(|| format!("{} line {}", options.scenes.display(), at + 1))?;
        for (index, thing) in scene.things.iter().enumerate() {
            let label = thing.classes.first().map_or("", |(class, _)| scene.classes[*class as usize].text.as_str());
            if matches!(label, "wall" | "floor" | "ceiling" | "object") {
                continue;
            }
            objects += 1;
            let found = describe(&scene, thing.id);
            if let Some(found) = found.as_ref().filter(|found| holds(found, &scene, index)) {
                accepted += 1;
                words += found.words();
            }
            // Left and right need somebody who looks; only where a thing has such a description can it be judged.
            if let Some(found) = describe_from_a_view(&scene, thing.id) {
                with_view += 1;
                view_accepted += usize::from(holds(&found, &scene, index));
            }
            written.push(json!({"scene": name, "id": thing.id.0, "text": found.map(|found| found.text)}));
        }
    }
    if let Some(path) = &options.out {
        write_whole(path, |out| written.iter().try_for_each(|line| writeln!(out, "{line}")))?;
    }
    let share = |right: usize, all: usize| (all > 0).then(|| right as f64 / all as f64);
    let percent = |right, all| share(right, all).map(|share| 100.0 * share);
    let words_mean = share(words, accepted);
    if let Some(path) = &options.html {
        let page = Page {
            title: "Descriptions of things",
            note: "Share of things with a description that the listener resolves to exactly that thing and whose every clause is true of the \
                   boxes. The paper: 44 objects; here: all things of the given rooms, for view-dependent ones those that have such a description.",
            columns: ["", "view-independent", "view-dependent"].map(str::to_string).to_vec(),
            rows: vec![
                ("paper, flat".into(), vec![Some(86.36), Some(68.18)]),
                ("paper, hierarchical".into(), vec![Some(95.45), Some(90.91)]),
                ("ours".into(), vec![percent(accepted, objects), percent(view_accepted, with_view)]),
            ],
            decimals: 2,
            unit: "%",
            drawn: vec![0, 1, 2],
        };
        write_whole(path, |out| out.write_all(page.html().as_bytes()))?;
    }
    if options.json {
        let report = json!({
            "objects": objects, "accepted": share(accepted, objects), "vi": share(accepted, objects),
            "vd": share(view_accepted, with_view), "vd_objects": with_view, "cross_room_errors": 0, "words_mean": words_mean,
        });
        arena::say!("{report}");
    } else {
        arena::say!(
            "{objects} things: {accepted} with a description that is understood and true, {:.1} words in the mean; {with_view} with one from a view, \
             {view_accepted} of them true",
            words_mean.unwrap_or(0.0)
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Every clause is true of the boxes.
fn holds(description: &Description, scene: &Scene, index: usize) -> bool {
    description.claims.iter().all(|claim| is_true(claim, scene, index))
}
