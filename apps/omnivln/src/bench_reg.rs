//! `omnivln bench reg`: for how many things is there a description that passes (the paper's Table I)? It must be understood by a listener (the
//! grounder, which reads the text and the boxes), and by plain inequalities on the boxes (`clause_truth`, which shares no operator with the
//! listener) be true of this thing and of no other with its label.
//!
//! With `--scenes` the things of recorded rooms are described; without, those of generated laboratories that the robot has surveyed: it
//! speaks from its scene graph, and is judged by the truth. With `--llm` a language model describes them too.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use arena::cli::load_robot;
use arena::lab_survey::{SurveyedLab, survey_lab};
use arena::mission::dsg::ObjectId;
use arena::mission::octant_prompt::describe::{
    Description, describe, describe_from_a_view, describe_without_a_view, is_hull,
};
use arena::mission::octant_prompt::grounding::Scene;
use arena::mission::octant_prompt::refer_set::read_scene;
use arena::mission::openai::ChatConfig;
use arena::mission::robot_model::RobotKind;
use arena::mission::stage_clock::CpuScope;
use arena::run::RunConfig;
use arena::workers::on_each_core;
use clap::Args;
use serde_json::{Value, json};

use crate::bench_page::{Page, ReportOptions};
use crate::json_lines::{read_lines, write_lines};
use crate::reg_lab::{Lab, Verdict};
use crate::reg_model::{Given, described_by_model};

/// The paper's Table I, per cent of 44 things: overall (the mean), view-independent, view-dependent.
pub const PAPER: [(&str, [f64; 3]); 2] =
    [("paper, flat", [77.27, 86.36, 68.18]), ("paper, hierarchical", [93.18, 95.45, 90.91])];

/// Options of `bench reg`.
#[derive(Debug, Args)]
pub struct RegOptions {
    /// Describe the things of these scenes of labelled boxes, a JSON object a line, instead of laboratories
    #[arg(long, value_name = "FILE")]
    scenes: Option<PathBuf>,
    /// Describe things of this many scenes, spread over the file
    #[arg(long, default_value_t = 60, requires = "scenes")]
    count: usize,
    /// Number of laboratories, each drawn from a seed and surveyed by the robot
    #[arg(long, default_value_t = 4, conflicts_with = "scenes", value_parser = clap::value_parser!(u64).range(1..=1000))]
    labs: u64,
    /// Seed of the first laboratory; the others follow
    #[arg(long, default_value_t = 1, conflicts_with = "scenes")]
    seed: u64,
    /// Also let a language model behind an OpenAI-compatible server describe the things of the laboratories
    #[arg(long, value_name = "URL", conflicts_with = "scenes")]
    llm: Option<String>,
    /// Name of the model on that server
    #[arg(long, value_name = "NAME", default_value = "default", requires = "llm")]
    model: String,
    /// Longest wait for one answer of the model, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, requires = "llm")]
    llm_timeout: f64,
    /// Write the descriptions, a JSON object a line
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOptions,
}

/// What was counted over things.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    objects: usize,
    accepted: usize,
    without_view: usize,
    from_view: usize,
    cross_room: usize,
    words: usize,
}

impl Tally {
    fn add(&mut self, other: &Tally) {
        self.objects += other.objects;
        self.accepted += other.accepted;
        self.without_view += other.without_view;
        self.from_view += other.from_view;
        self.cross_room += other.cross_room;
        self.words += other.words;
    }

    fn share(&self, right: usize) -> Option<f64> {
        (self.objects > 0).then(|| right as f64 / self.objects as f64)
    }

    fn words_mean(&self) -> Option<f64> {
        (self.accepted > 0).then(|| self.words as f64 / self.accepted as f64)
    }
}

/// Describes, checks, prints.
pub fn run(options: &RegOptions) -> Result<ExitCode> {
    let mut written = Vec::new();
    let mut models = Vec::new();
    let tally = match &options.scenes {
        Some(path) => recorded_rooms(path, options.count, &mut written)?,
        None => laboratories(options, &mut written, &mut models)?,
    };
    write_lines(options.out.as_deref(), &written)?;
    options.report.write_page(|| page(options, &tally, &models))?;
    if options.report.json {
        let mut report = json!({
            "objects": tally.objects,
            "accepted": tally.share(tally.accepted),
            "vi": tally.share(tally.without_view),
            "vd": tally.share(tally.from_view),
            // Recorded scenes are one room each: there is no other room to be wrong about.
            "cross_room_errors": if options.scenes.is_some() { Value::Null } else { json!(tally.cross_room) },
            "words_mean": tally.words_mean(),
        });
        for (name, tally) in &models {
            report[*name] = json!({
                "objects": tally.objects, "accepted": tally.share(tally.accepted), "cross_room_errors": tally.cross_room,
                "words_mean": tally.words_mean(),
            });
        }
        arena::say!("{report}");
    } else {
        let Tally { objects, accepted, without_view, from_view, cross_room, .. } = tally;
        arena::say!(
            "{objects} things: {accepted} have a description that passes, {:.1} words in the mean; {without_view} have one that depends on no \
             viewer, {from_view} one that does; {cross_room} descriptions lead to a wrong room",
            tally.words_mean().unwrap_or(0.0)
        );
        for (name, tally) in &models {
            arena::say!(
                "{name}: {} of {} pass, {} lead to a wrong room",
                tally.accepted,
                tally.objects,
                tally.cross_room
            );
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The three descriptions of a thing: the shortest, the shortest without a view, the shortest from one.
fn described(scene: &Scene, id: ObjectId) -> [Option<Description>; 3] {
    [describe(scene, id), describe_without_a_view(scene, id), describe_from_a_view(scene, id)]
}

/// Counts one thing, given which of its descriptions pass.
fn counted(found: &[Option<Description>; 3], verdicts: [Option<Verdict>; 3]) -> Tally {
    let passes = |at: usize| usize::from(verdicts[at].is_some_and(|verdict| verdict.is_accepted));
    Tally {
        objects: 1,
        accepted: passes(0),
        without_view: passes(1),
        from_view: passes(2),
        cross_room: usize::from(verdicts[0].is_some_and(|verdict| verdict.is_cross_room)),
        words: passes(0) * found[0].as_ref().map_or(0, Description::words),
    }
}

fn recorded_rooms(path: &std::path::Path, count: usize, written: &mut Vec<Value>) -> Result<Tally> {
    let scenes = read_lines(path, |line| Ok(read_scene(line)?))?;
    ensure!(!scenes.is_empty() && count > 0, "{} holds no scene to describe", path.display());
    let step = (scenes.len() / count).max(1);
    let chosen: Vec<&(String, Scene)> = scenes.iter().step_by(step).take(count).collect();
    let results = on_each_core(chosen.len(), |at| {
        let (name, scene) = chosen[at];
        let (mut tally, mut lines) = (Tally::default(), Vec::new());
        for (_, thing) in scene.things.iter().enumerate().filter(|(index, _)| !is_hull(scene.label(*index))) {
            // What `describe` returns has passed: speaker, listener and checker see the same boxes.
            let found = described(scene, thing.id);
            let passed = Verdict { is_accepted: true, fault: "", is_cross_room: false };
            tally.add(&counted(&found, [0, 1, 2].map(|at| found[at].as_ref().map(|_| passed))));
            let text = |at: usize| found[at].as_ref().map(|found: &Description| found.text.as_str());
            lines.push(json!({"scene": name, "id": thing.id.0, "text": text(0), "vi": text(1), "vd": text(2)}));
        }
        (tally, lines)
    })?;
    let mut tally = Tally::default();
    for (scene, lines) in results {
        tally.add(&scene);
        written.extend(lines);
    }
    Ok(tally)
}

fn laboratories(
    options: &RegOptions,
    written: &mut Vec<Value>,
    models: &mut Vec<(&'static str, Tally)>,
) -> Result<Tally> {
    let robot = load_robot(None, RobotKind::Ground)?;
    let config = RunConfig { cpu_scope: CpuScope::Thread, ..RunConfig::default() };
    let labs = on_each_core(options.labs as usize, |at| {
        let surveyed = survey_lab(&robot, options.seed + at as u64, &config)?;
        eprintln!("laboratory {} of {} surveyed", at + 1, options.labs);
        anyhow::Ok((Lab::new(&surveyed), surveyed))
    })?;
    let labs = labs.into_iter().collect::<Result<Vec<(Lab, SurveyedLab)>>>()?;
    let mut tally = Tally::default();
    for (at, (lab, _)) in labs.iter().enumerate() {
        for index in described_things(lab) {
            let found = described(&lab.known, lab.known.things[index].id);
            let verdicts = [0, 1, 2].map(|at| found[at].as_ref().map(|found| lab.check(found, index)));
            tally.add(&counted(&found, verdicts));
            let row = |at: usize| {
                let found: &Description = found[at].as_ref()?;
                Some(
                    json!({"text": found.text, "fault": verdicts[at]?.fault, "cross_room": verdicts[at]?.is_cross_room}),
                )
            };
            let id = lab.known.things[index].id.0;
            written.push(json!({"scene": format!("lab{}", options.seed + at as u64), "id": id, "any": row(0), "vi": row(1), "vd": row(2)}));
        }
    }
    if let Some(url) = &options.llm {
        let chat_config = ChatConfig { timeout_s: options.llm_timeout, ..ChatConfig::new(url, &options.model) };
        for (name, given) in [("llm_hierarchical", Given::Hierarchy), ("llm_flat", Given::List)] {
            models.push((name, by_model(&labs, &chat_config, given, name, written)?));
        }
    }
    Ok(tally)
}

/// Everything the robot believes in, but for walls and floors.
fn described_things(lab: &Lab) -> impl Iterator<Item = usize> + '_ {
    (0..lab.known.things.len()).filter(|index| !is_hull(lab.known.label(*index)))
}

fn by_model(
    labs: &[(Lab, SurveyedLab)],
    chat_config: &ChatConfig,
    given: Given,
    name: &str,
    written: &mut Vec<Value>,
) -> Result<Tally> {
    let mut tally = Tally::default();
    for (at, (lab, surveyed)) in labs.iter().enumerate() {
        for index in described_things(lab) {
            let id = lab.known.things[index].id;
            let text = described_by_model(chat_config, surveyed, id, lab.known.label(index), given)
                .with_context(|| format!("asking for a description of {id}"))?;
            let verdict = text.as_deref().map(|text| lab.check_text(text, index));
            let is_accepted = verdict.is_some_and(|verdict| verdict.is_accepted);
            tally.add(&Tally {
                objects: 1,
                accepted: usize::from(is_accepted),
                cross_room: usize::from(verdict.is_some_and(|verdict| verdict.is_cross_room)),
                words: if is_accepted { text.as_deref().unwrap_or("").split(' ').count() } else { 0 },
                ..Tally::default()
            });
            written.push(json!({"scene": format!("lab {at}"), "id": id.0, name: text, "accepted": is_accepted}));
        }
    }
    Ok(tally)
}

fn page(options: &RegOptions, tally: &Tally, models: &[(&'static str, Tally)]) -> String {
    let percent = |tally: &Tally, right: usize| tally.share(right).map(|share| 100.0 * share);
    let ours = [tally.accepted, tally.without_view, tally.from_view].map(|right| percent(tally, right)).to_vec();
    let mut rows = PAPER.map(|(name, percent)| (name.to_string(), percent.map(Some).to_vec())).to_vec();
    rows.push(("ours, by rules".into(), ours));
    let model_row = |(name, tally): &(&str, Tally)| {
        let name = if *name == "llm_flat" { "model, list alone" } else { "model, scene graph" };
        (name.to_string(), vec![percent(tally, tally.accepted), None, None])
    };
    rows.extend(models.iter().map(model_row));
    let what = if options.scenes.is_some() {
        "all things of the given rooms, each of which is one scene".to_string()
    } else {
        format!(
            "all things of {} generated laboratories that the robot believes in after its survey, judged by the truth of the simulator; \
             {} of the descriptions lead to a wrong room",
            options.labs, tally.cross_room
        )
    };
    Page {
        title: "Descriptions of things",
        note: &format!(
            "Share of things, in per cent, with a description that the listener resolves to exactly that thing and that is true of it and of no \
             other with its label; {:.1} words in the mean. The paper: 44 objects, one description of either kind for each. Here: {} things, {what}.",
            tally.words_mean().unwrap_or(0.0),
            tally.objects
        ),
        columns: ["", "any (paper: mean)", "view-independent", "view-dependent"].map(str::to_string).to_vec(),
        drawn: (0..rows.len()).collect(),
        rows,
        decimals: 2,
        unit: "%",
        rest: String::new(),
    }
    .html()
}
