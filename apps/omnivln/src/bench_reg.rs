//! `omnivln bench reg`: for how many things of recorded rooms is there a description that passes? It must be understood by a listener (the
//! grounder, which reads the text and the boxes), and by plain inequalities on the boxes (`clause_truth`, which shares no operator with the
//! listener) be true of this thing and of no other with its label. The paper's Table I on more than its 44 objects.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, ensure};
use arena::mission::octant_prompt::describe::{describe, describe_from_a_view, describe_without_a_view, is_hull};
use arena::mission::octant_prompt::refer_set::read_scene;
use clap::Args;
use serde_json::json;

use crate::bench_page::{Page, ReportOptions};
use crate::json_lines::{read_lines, write_lines};

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
    #[command(flatten)]
    report: ReportOptions,
}

/// Describes, checks, prints.
pub fn run(options: &RegOptions) -> Result<ExitCode> {
    let scenes = read_lines(&options.scenes, |line| Ok(read_scene(line)?))?;
    ensure!(!scenes.is_empty() && options.count > 0, "{} holds no scene to describe", options.scenes.display());
    let step = (scenes.len() / options.count).max(1);
    let (mut objects, mut accepted, mut words, mut without_view, mut from_view) = (0, 0, 0, 0, 0);
    let mut written = Vec::new();
    for (name, scene) in scenes.iter().step_by(step).take(options.count) {
        for (index, thing) in scene.things.iter().enumerate() {
            if is_hull(scene.label(index)) {
                continue;
            }
            objects += 1;
            let found = describe(scene, thing.id);
            if let Some(found) = &found {
                accepted += 1;
                words += found.words();
            }
            without_view += usize::from(describe_without_a_view(scene, thing.id).is_some());
            from_view += usize::from(describe_from_a_view(scene, thing.id).is_some());
            written.push(json!({"scene": name, "id": thing.id.0, "text": found.map(|found| found.text)}));
        }
    }
    write_lines(options.out.as_deref(), &written)?;
    let share = |right: usize, all: usize| (all > 0).then(|| right as f64 / all as f64);
    let percent = |right| share(right, objects).map(|share| 100.0 * share);
    let words_mean = share(words, accepted);
    options.report.write_page(|| {
        Page {
            title: "Descriptions of things",
            note: "Share of things with a description that the listener resolves to exactly that thing and that by the boxes is true of \
                   it and of no other with its label. The paper: 44 objects, one description of either kind for each; \
                   here: all things of the given rooms, and whether such a description was found.",
            columns: ["", "any", "view-independent", "view-dependent"].map(str::to_string).to_vec(),
            rows: vec![
                ("paper, flat".into(), vec![Some(77.27), Some(86.36), Some(68.18)]),
                ("paper, hierarchical".into(), vec![Some(93.18), Some(95.45), Some(90.91)]),
                ("ours".into(), [accepted, without_view, from_view].map(percent).to_vec()),
            ],
            decimals: 2,
            unit: "%",
            drawn: vec![0, 1, 2],
        }
        .html()
    })?;
    if options.report.json {
        // These sets hold one room a scene: there is no other room to be wrong about.
        let report = json!({
            "objects": objects, "accepted": share(accepted, objects), "vi": share(without_view, objects),
            "vd": share(from_view, objects), "cross_room_errors": null, "words_mean": words_mean,
        });
        arena::say!("{report}");
    } else {
        arena::say!(
            "{objects} things: {accepted} have a description that passes, {:.1} words in the mean; {without_view} have one that depends on no \
             viewer, {from_view} one that does",
            words_mean.unwrap_or(0.0)
        );
    }
    Ok(ExitCode::SUCCESS)
}
