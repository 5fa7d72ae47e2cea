//! Robots that move: the whole system in many buildings, with and without its parts, with a reasoner far away, on instructions of others.

use anyhow::Result;
use arena::bench_arms::{Figures, paired};
use arena::buildings::ENDINGS;
use arena::instructions::{SAMPLE_ANSWERS, SAMPLE_INSTRUCTIONS, by_kind};
use arena::intervals::{Estimate, paired_mean_95, shares_95, wilson_95};
use arena::summary::Summary;
use arena::whole_file::write_whole;
use serde::Deserialize;

use super::layout::{Claim, Finding, Section, command, difference, paragraph, table, with_interval};
use super::{Paper, words};

#[derive(Deserialize)]
struct Nav {
    runs: Vec<Summary>,
}

const ROBOTS: [&str; 2] = ["ground", "aerial"];

/// Runs of one robot over all seeds, and the commands that made them.
struct Pool {
    runs: Vec<Summary>,
    commands: String,
}

/// The bench of a robot with `numbers[k]` buildings of seed `k + 1`.
fn pool(paper: &Paper, robot: &str, numbers: &[usize], more: &str) -> Result<Pool> {
    let mut all = Pool { runs: Vec::new(), commands: String::new() };
    for (at, scenes) in numbers.iter().enumerate() {
        let mut args = words(&format!("bench nav --robot {robot} --scenes {scenes} --seed {}", at + 1));
        args.extend(words(more));
        args.extend(paper.buildings(at));
        let found: Nav = paper.experiments.result(&args)?;
        all.runs.extend(found.runs);
        all.commands.push_str(&command(&args));
    }
    Ok(all)
}

/// Whether the walls of the building are not of our generator.
fn is_from_elsewhere(run: &Summary) -> bool {
    ENDINGS.iter().any(|ending| run.scene.contains(&format!(".{ending}")))
}

fn counted(runs: &[&Summary]) -> (usize, usize) {
    (runs.iter().filter(|run| run.success).count(), runs.len())
}

fn success((right, n): (usize, usize)) -> Estimate {
    Estimate { value: right as f64 / n.max(1) as f64, interval_95: wilson_95(right, n) }
}

fn mean_spl(runs: &[&Summary]) -> Estimate {
    paired_mean_95(&runs.iter().map(|run| run.spl).collect::<Vec<_>>())
}

/// The whole system in buildings that it has never seen, and in those that it has surveyed.
pub fn whole_system(paper: &Paper) -> Result<Section> {
    let mut section = Section { id: "system", title: "The whole system", ..Section::default() };
    let mut rows = Vec::new();
    let (mut commands, mut failures) = (String::new(), String::new());
    for robot in ROBOTS {
        let arms = [
            ("unknown buildings", &paper.sizes.nav, "", 0.45),
            ("known buildings", &paper.sizes.known, "--known", 0.80),
        ];
        for (what, numbers, more, spl_bar) in arms {
            let pool = pool(paper, robot, numbers, more)?;
            let all: Vec<&Summary> = pool.runs.iter().collect();
            let (elsewhere, ours): (Vec<&Summary>, Vec<&Summary>) = all.iter().partition(|run| is_from_elsewhere(run));
            for (name, runs) in [("all", &all), ("our generator", &ours), ("from elsewhere", &elsewhere)] {
                if runs.is_empty() || (name != "all" && elsewhere.is_empty()) {
                    continue;
                }
                let count = counted(runs);
                rows.push(vec![
                    format!("{robot}, {what}: {name}"),
                    count.1.to_string(),
                    with_interval(&success(count), 100.0, 1, " %"),
                    with_interval(&mean_spl(runs), 1.0, 3, ""),
                    runs.iter().map(|run| run.collisions).sum::<usize>().to_string(),
                    format!("{:.0}", runs.iter().map(|run| run.sim_s).sum::<f64>() / runs.len() as f64),
                ]);
            }
            let n = all.len();
            section.claims.push(Claim {
                claim: format!("The {robot} robot succeeds in at least 90 % of {what} (our bar, lower bound)"),
                paper: "-".into(),
                ours: with_interval(&success(counted(&all)), 100.0, 1, " %"),
                n,
                finding: Finding::at_least(0.9, &success(counted(&all))),
                comparable: "The paper reports no such figure for whole drives.",
            });
            let spl = mean_spl(&all);
            section.claims.push(Claim {
                claim: format!("... by short ways: SPL of at least {spl_bar} (our bar)"),
                paper: "-".into(),
                ours: with_interval(&spl, 1.0, 3, ""),
                n,
                finding: Finding::at_least(spl_bar, &spl),
                comparable: "The paper reports no SPL.",
            });
            if !elsewhere.is_empty() && !ours.is_empty() {
                let drop = shares_95(counted(&elsewhere), counted(&ours));
                section.claims.push(Claim {
                    claim: format!("The {robot} robot loses at most 5 points in buildings of others ({what})"),
                    paper: "-".into(),
                    ours: difference(&drop, 100.0, 1, " points"),
                    n,
                    finding: Finding::at_least(-0.05, &drop.negated()),
                    comparable: "The paper has one laboratory and one generator.",
                });
            }
            commands.push_str(&pool.commands);
            for run in all.iter().filter(|run| !run.success) {
                failures.push_str(&format!(
                    "<li>{}</li>",
                    arena::map_picture::escape(&format!(
                        "{robot}, {what}, {} (seed {}): \"{}\": {}",
                        run.scene, run.seed, run.instruction, run.reason
                    ))
                ));
            }
        }
    }
    let note = if paper.has_plans() {
        "Every second building is a floor plan of others, furnished by our generator as usual, shuffled and uniformly in turn."
    } else {
        "No floor plans were given (--plans), so all buildings are of our generator, with the furniture of kinds of rooms as usual for the first seed, exchanged for the \
         second, and any furniture anywhere for the third: buildings from elsewhere are not shown here."
    };
    section.body = paragraph(&format!(
        "One instruction in each building, the embedded reasoner, noisy sensors, a segmenter that errs, own odometry. {note} Success: the robot stopped of its own accord \
         within reach of a right thing, or in the right room, as a referee who knows the truth has it."
    )) + &table(&["", "n", "success", "SPL", "collisions", "simulated s"], &rows)
        + &commands;
    if !failures.is_empty() {
        section.body.push_str(&format!("<details><summary>What failed</summary><ul>{failures}</ul></details>"));
    }
    Ok(section)
}

/// An arm of an experiment: what it is called, and the options that make it.
type ArmWords = (&'static str, &'static str);

/// All arms beside the first, which has no options: over the same buildings, starts and seeds.
struct Arms {
    names: Vec<&'static str>,
    runs: Vec<Vec<Summary>>,
    table: String,
    commands: String,
}

fn arms(paper: &Paper, robot: &str, base: &'static str, others: &[ArmWords]) -> Result<Arms> {
    let mut found = Arms { names: Vec::new(), runs: Vec::new(), table: String::new(), commands: String::new() };
    for (name, options) in std::iter::once(&(base, "")).chain(others) {
        let mut args = words(&format!("bench nav --robot {robot} --scenes {} --seed 1", paper.sizes.arm));
        args.extend(words(options));
        let nav: Nav = paper.experiments.result(&args)?;
        found.names.push(name);
        found.runs.push(nav.runs);
        found.commands.push_str(&command(&args));
    }
    let mut rows = Vec::new();
    for (name, runs) in found.names.iter().zip(&found.runs) {
        let figures = Figures::of(runs);
        rows.push(vec![
            (*name).to_owned(),
            figures.n.to_string(),
            with_interval(&figures.success, 100.0, 1, " %"),
            format!("{:.3}", figures.spl),
            format!("{:.0}", figures.tokens),
            format!("{:.1}", figures.decisions),
            format!("{:.1}", figures.turned_in_place_rad),
            figures.first_sighting_s.map_or("-".into(), |s| format!("{s:.1}")),
            figures.collisions.to_string(),
        ]);
    }
    let mut differences = Vec::new();
    for (name, runs) in found.names.iter().zip(&found.runs).skip(1) {
        let pairs = paired(name, &found.runs[0], runs);
        differences.push(vec![
            (*name).to_owned(),
            difference(&pairs.success, 100.0, 1, ""),
            difference(&pairs.spl, 1.0, 3, ""),
            difference(&pairs.tokens, 1.0, 0, ""),
            difference(&pairs.decisions, 1.0, 1, ""),
            difference(&pairs.turned_in_place_rad, 1.0, 1, ""),
            difference(&pairs.first_sighting_s, 1.0, 1, ""),
        ]);
    }
    found.table = table(
        &["", "n", "success", "SPL", "tokens", "decisions", "turned, rad", "first sighting, s", "collisions"],
        &rows,
    ) + &paragraph(&format!("Difference to \"{base}\", run by run:"))
        + &table(
            &["", "success, points", "SPL", "tokens", "decisions", "turned, rad", "first sighting, s"],
            &differences,
        );
    Ok(found)
}

/// Seeing all round against ninety degrees ahead.
pub fn sensing(paper: &Paper) -> Result<Section> {
    let mut section = Section { id: "sensing", title: "All round or 90 degrees ahead", ..Section::default() };
    section.body = paragraph(
        "The same robots with LiDAR and camera cut to 90 degrees ahead. To look round they have to turn, and they do: before they give up a place, and when they \
         arrive. Turning is counted while the robot stands; the first sighting is when ten LiDAR points have met a right thing, in truth.",
    );
    for robot in ROBOTS {
        let arms = arms(paper, robot, "all round", &[("90 degrees ahead", "--sensing narrow")])?;
        let pairs = paired("narrow", &arms.runs[0], &arms.runs[1]);
        let n = arms.runs[0].len();
        let claims = [
            ("succeeds more often", pairs.success.negated(), 100.0, 1, " points"),
            ("turns less on the spot", pairs.turned_in_place_rad, 1.0, 1, " rad saved"),
            ("sees a right thing earlier", pairs.first_sighting_s, 1.0, 1, " s saved"),
        ];
        for (what, gain, factor, decimals, unit) in claims {
            section.claims.push(Claim {
                claim: format!("The {robot} robot that sees all round {what} than with a narrow view"),
                paper: "claimed, not measured".into(),
                ours: difference(&gain, factor, decimals, unit),
                n,
                finding: Finding::positive(&gain),
                comparable: "The paper gives no figure for it.",
            });
        }
        section.body.push_str(&format!("<h3>{robot}</h3>{}{}", arms.table, arms.commands));
    }
    Ok(section)
}

/// The flat list against octants and tiers, while the robot drives.
pub fn prompts(paper: &Paper) -> Result<Section> {
    let mut section =
        Section { id: "prompts", title: "Octants and tiers or a flat list, while driving", ..Section::default() };
    let arms_here = arms(paper, "ground", "octants", &[("flat list", "--prompt flat")])?;
    let pairs = paired("flat", &arms_here.runs[0], &arms_here.runs[1]);
    let n = arms_here.runs[0].len();
    section.claims.push(Claim {
        claim: "Octants save tokens of a whole drive".into(),
        paper: "-44.6 % in the mean of Table II".into(),
        ours: difference(&pairs.tokens.negated(), 1.0, 0, " tokens"),
        n,
        finding: Finding::positive(&pairs.tokens),
        comparable: "The paper counts single questions on drawn scenes.",
    });
    section.claims.push(Claim {
        claim: "... and lose no success (at most 5 points)".into(),
        paper: "+11.68 % at best (abstract)".into(),
        ours: difference(&pairs.success.negated(), 100.0, 1, " points"),
        n,
        finding: Finding::at_least(-0.05, &pairs.success.negated()),
        comparable: "Equal by construction: the embedded reasoner reads the scene graph and not the text.",
    });
    section.body = paragraph(
        "The same reasoner, critic and limit of calls; only the text of the prompt differs. The embedded reasoner reads the scene graph itself, so its decisions cannot \
         depend on the text: here only the tokens are measured, and success is equal by construction. What a list does to a language model is measured with --llm.",
    ) + &arms_here.table
        + &arms_here.commands;
    if paper.has_model() {
        let mut found = Vec::new();
        for form in ["octant", "flat"] {
            let mut args =
                words(&format!("bench nav --robot ground --scenes {} --seed 1 --prompt {form}", paper.sizes.arm));
            args.extend(paper.model.iter().cloned());
            found.push(paper.experiments.result::<Nav>(&args)?.runs);
            section.body.push_str(&command(&args));
        }
        let pairs = paired("octant", &found[1], &found[0]);
        section.claims.push(Claim {
            claim: "A language model drives better with octants than with a flat list".into(),
            paper: "+11.68 % at best (abstract)".into(),
            ours: difference(&pairs.success, 100.0, 1, " points"),
            n: found[0].len(),
            finding: Finding::positive(&pairs.success),
            comparable: "Whole drives instead of single decisions, another model.",
        });
    }
    Ok(section)
}

/// What each part brings: without it, and with more noise.
pub fn ablations(paper: &Paper) -> Result<Section> {
    const ARMS: [ArmWords; 16] = [
        ("LiDAR held still", "--lidar fixed"),
        ("without rooms", "--ablate rooms"),
        ("without pruning of relations", "--ablate pruning"),
        ("without verification", "--ablate verify"),
        ("without octants", "--ablate octants"),
        ("without tiers", "--ablate tiers"),
        ("without steps", "--ablate steps"),
        ("without the critic", "--ablate critic"),
        ("without votes", "--ablate vote"),
        ("no errors of the segmenter", "--noise 0"),
        ("errors of the segmenter x2", "--noise 2"),
        ("errors of the segmenter x4", "--noise 4"),
        ("true poses that drift", "--drift 1"),
        ("true poses that drift x4", "--drift 4"),
        ("noise of the IMU x2", "--imu-noise 2"),
        ("noise of the IMU x4", "--imu-noise 4"),
    ];
    let arms = arms(paper, "ground", "everything", &ARMS)?;
    let body = paragraph(
        "The ground robot without one part at a time, and with more noise, in the same buildings with the same starts and seeds. Octants and tiers change the text of \
         the prompt only, which the embedded reasoner does not read. Where an interval holds zero, this many buildings do not show that the part matters.",
    ) + &arms.table
        + &arms.commands;
    Ok(Section { id: "parts", title: "What each part brings", body, claims: Vec::new() })
}

/// A reasoner far away.
pub fn far_away(paper: &Paper) -> Result<Section> {
    const ARMS: [ArmWords; 4] = [
        ("answers after 0.1 to 15 s", "--llm-latency 0.1..15"),
        ("a fifth of the calls lost", "--llm-loss 0.2"),
        ("away for a minute", "--llm-outage 20+60"),
        ("all of it", "--llm-latency 0.1..15 --llm-loss 0.2 --llm-outage 20+60"),
    ];
    let arms = arms(paper, "ground", "on board", &ARMS)?;
    let n = arms.runs[0].len();
    let claims = arms.runs.iter().zip(&arms.names).skip(1).map(|(runs, name)| {
        let pairs = paired(name, &arms.runs[0], runs);
        Claim {
            claim: format!("Success falls by at most 2 points when the reasoner is far ({name})"),
            paper: "-".into(),
            ours: difference(&pairs.success, 100.0, 1, " points"),
            n,
            finding: Finding::at_least(-0.02, &pairs.success),
            comparable: "The paper says that slow answers are a hazard, and gives no figure.",
        }
    });
    let claims = claims.collect();
    let body = paragraph(
        "The answer of the reasoner comes late, or never, in simulated time; the robot goes on with what it was about, or holds. After 20 s without an answer the reasoner on board takes \
         the step. An answer is judged by the critic against the graph of the moment in which it arrives, so that nothing unverified is carried out (a test holds it).",
    ) + &arms.table
        + &arms.commands;
    Ok(Section { id: "far", title: "Delay and loss", body, claims })
}

/// Sentences that our grammar did not draw.
pub fn instructions(paper: &Paper) -> Result<Section> {
    // The name says how many, for what is kept of a command must not be of another file.
    let every = paper.sizes.every_instruction;
    let lines: Vec<&str> = SAMPLE_INSTRUCTIONS.lines().step_by(every).collect();
    let file = |name: String, text: String| -> Result<String> {
        let path = paper.out.join("data").join(name);
        write_whole(&path, |out| out.write_all(text.as_bytes()))?;
        Ok(path.display().to_string())
    };
    let questions = file(format!("instructions-{}.jsonl", lines.len()), lines.join("\n") + "\n")?;
    let answers = file("answers.jsonl".into(), SAMPLE_ANSWERS.into())?;
    let mut body = paragraph(
        "Sentences with slips and other words, about things that are not there (the robot must say so), about one of several (it must ask, and is answered), and with \
         steps. They were written by the people who wrote the robot, so they show what it is built for and not what strangers would say; bench nav --instructions takes anybody's. The ground robot only: \
         buildings are drawn for the robot, and the true ids in the file are of its buildings.",
    );
    let mut args = words("bench nav --robot ground --instructions");
    args.extend([questions, "--answers".to_owned(), answers]);
    let found: Nav = paper.experiments.result(&args)?;
    let rows: Vec<Vec<String>> = by_kind(&found.runs)
        .iter()
        .map(|(kind, figures)| {
            let spl = figures.spl.map_or("-".into(), |spl| format!("{spl:.2}"));
            let right = with_interval(&success((figures.right, figures.n)), 100.0, 1, " %");
            vec![kind.clone(), figures.n.to_string(), right, spl]
        })
        .collect();
    body.push_str(&(table(&["kind", "n", "right", "SPL"], &rows) + &command(&args)));
    Ok(Section { id: "instructions", title: "Instructions by kind", body, claims: Vec::new() })
}
