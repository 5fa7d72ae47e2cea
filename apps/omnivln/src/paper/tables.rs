//! The paper's tables and what needs no robot that moves: descriptions (Table I), tokens (Table II), answers by dataset, latency.

use std::collections::BTreeMap;

use anyhow::Result;
use arena::chart::bars;
use arena::intervals::{Estimate, shares_95, wilson_95};
use serde::Deserialize;

use super::layout::{Claim, Finding, Section, command, difference, paragraph, table, with_interval};
use super::{Paper, words};
use crate::bench_latency::PAPER_S;
use crate::bench_reg as reg;
use crate::bench_tiers as tiers;
use crate::bench_tokens::{PAPER_FLAT, PAPER_OURS};

const DATASETS: [&str; 9] = ["D1", "D2", "D3", "D4", "D5", "D6", "D7", "D8", "D9"];

#[derive(Deserialize)]
struct Reg {
    objects: usize,
    accepted: f64,
    vi: f64,
    vd: f64,
    cross_room_errors: usize,
    llm_hierarchical: Option<RegModel>,
    llm_flat: Option<RegModel>,
}

#[derive(Deserialize)]
struct RegModel {
    objects: usize,
    accepted: f64,
    cross_room_errors: usize,
}

fn right(share: f64, n: usize) -> usize {
    (share * n as f64).round() as usize
}

fn share(share: f64, n: usize) -> Estimate {
    Estimate { value: share, interval_95: wilson_95(right(share, n), n) }
}

fn percent(value: f64, n: usize) -> String {
    with_interval(&share(value, n), 100.0, 1, " %")
}

/// Table I.
pub fn descriptions(paper: &Paper) -> Result<Section> {
    let mut args = words("bench reg --seed 1 --labs");
    args.push(paper.sizes.labs.to_string());
    args.extend(paper.model.iter().cloned());
    let found: Reg = paper.experiments.result(&args)?;
    let n = found.objects;
    let in_paper = |(name, percent): &(&str, [f64; 3])| -> Vec<String> {
        let mut row = vec![(*name).to_owned(), "44".to_owned()];
        row.extend(percent.map(|percent| format!("{percent:.2} %")));
        row.push("-".into());
        row
    };
    let mut rows: Vec<Vec<String>> = reg::PAPER.iter().map(in_paper).collect();
    rows.extend([vec![
        "ours, by rules from the scene graph".into(),
        n.to_string(),
        percent(found.accepted, n),
        percent(found.vi, n),
        percent(found.vd, n),
        found.cross_room_errors.to_string(),
    ]]);
    for (name, model) in [("model, scene graph", &found.llm_hierarchical), ("model, list alone", &found.llm_flat)] {
        if let Some(model) = model {
            let any = percent(model.accepted, model.objects);
            let [none, errors] = ["-".to_owned(), model.cross_room_errors.to_string()];
            rows.push(vec![name.into(), model.objects.to_string(), any, none.clone(), none, errors]);
        }
    }
    let mut claims = vec![Claim {
        claim: "A description that holds exists for 93.18 % of the things".into(),
        paper: "93.18 % of 44".into(),
        ours: percent(found.accepted, n),
        n,
        finding: Finding::at_least(0.9318, &share(found.accepted, n)),
        comparable: "The measure is like the paper's; its laboratory and its judges are not at hand, and our speaker is a set of rules and no language model.",
    }];
    if let (Some(ours), Some(flat)) = (&found.llm_hierarchical, &found.llm_flat) {
        let of = |model: &RegModel| (right(model.accepted, model.objects), model.objects);
        let gain = shares_95(of(flat), of(ours));
        claims.push(Claim {
            claim: "The scene graph makes a model's descriptions better than a flat list does".into(),
            paper: "+15.91 points".into(),
            ours: difference(&gain, 100.0, 1, " points"),
            n: ours.objects,
            finding: Finding::positive(&gain),
            comparable: "Same question, another model and other rooms.",
        });
    }
    let body = paragraph(
        "Share of things for which a description passes: a listener that knows the truth resolves it to that thing, and plain inequalities on the true \
         boxes agree. The robot speaks from its own map of laboratories that it has surveyed. The paper's rows are Table I. It reports one description of \
         either kind for each of 44 objects, judged by people; the flat row needs a language model to describe from a list, and is there with --llm only.",
    ) + &table(
        &["", "n", "any (paper: overall)", "view-independent", "view-dependent", "lead to a wrong room"],
        &rows,
    ) + &command(&args);
    Ok(Section { id: "descriptions", title: "Table I: descriptions of things", body, claims })
}

#[derive(Deserialize)]
struct Tokens {
    #[serde(flatten)]
    rows: BTreeMap<String, serde_json::Value>,
    growth_r2: f64,
}

#[derive(Deserialize)]
struct TokenRow {
    n: f64,
    flat_json: f64,
    flat_body: f64,
    caption_free: f64,
    ours: f64,
    ours_episode: f64,
    paired_reduction: Estimate,
}

/// Table II.
pub fn tokens(paper: &Paper) -> Result<Section> {
    let mut args = words("bench tokens --seeds");
    args.push(paper.sizes.seeds.to_string());
    let found: Tokens = paper.experiments.result(&args)?;
    let rows: Vec<TokenRow> = DATASETS
        .iter()
        .map(|name| Ok(TokenRow::deserialize(found.rows.get(*name).unwrap_or(&serde_json::Value::Null))?))
        .collect::<Result<_>>()?;
    let paper_reduction: Vec<f64> =
        PAPER_OURS.iter().zip(PAPER_FLAT).map(|(ours, flat)| 100.0 * (1.0 - ours / flat)).collect();
    let line = |name: &str, values: &mut dyn Iterator<Item = String>| -> Vec<String> {
        std::iter::once(name.to_owned()).chain(values).collect()
    };
    let ours =
        |name: &str, of: &dyn Fn(&TokenRow) -> f64| line(name, &mut rows.iter().map(|row| format!("{:.1}", of(row))));
    let mut head = vec![""];
    head.extend(DATASETS);
    let lines = vec![
        line("paper, flat list", &mut PAPER_FLAT.iter().map(|tokens| format!("{tokens:.1}"))),
        line("paper, hierarchical", &mut PAPER_OURS.iter().map(|tokens| format!("{tokens:.1}"))),
        line("paper, reduction %", &mut paper_reduction.iter().map(|percent| format!("{percent:.1}"))),
        ours("here, flat list (JSON)", &|row| row.flat_json),
        ours("here, flat list in the body frame", &|row| row.flat_body),
        ours("here, ours", &|row| row.ours),
        ours("here, flat list without captions", &|row| row.caption_free),
        ours("here, a whole episode", &|row| row.ours_episode),
        line(
            "reduction of questions, %",
            &mut rows.iter().map(|row| with_interval(&row.paired_reduction, 100.0, 1, "")),
        ),
        ours("questions", &|row| row.n),
    ];
    let mean = paper_reduction.iter().sum::<f64>() / 9.0;
    let overall = 100.0 * (1.0 - PAPER_OURS.iter().sum::<f64>() / PAPER_FLAT.iter().sum::<f64>());
    let last = &rows[8].paired_reduction;
    let claims = vec![Claim {
        claim: "Octants and tiers cost fewer tokens than a flat list (D9)".into(),
        paper: "-69.98 %, the abstract says up to -61.7 %".into(),
        ours: with_interval(&last.negated(), 100.0, 1, " %"),
        n: rows[8].n as usize,
        finding: Finding::positive(last),
        comparable: "The scenes follow the paper's description, its captions are not known; tokens are estimated without a vocabulary unless bench tokens is given one.",
    }];
    let series = [
        ("paper, flat", PAPER_FLAT.to_vec()),
        ("paper, hierarchical", PAPER_OURS.to_vec()),
        ("flat list", rows.iter().map(|row| row.flat_json).collect()),
        ("ours", rows.iter().map(|row| row.ours).collect()),
    ];
    let body = paragraph(&format!(
        "Tokens of the prompt to \"go to the nearest ...\" on nine scenes drawn as the paper describes them. The 61.7 % of its abstract matches none of its \
         tables: the nine reductions of its Table II are those of the third row, at most {:.2} %, {mean:.1} % in the mean, and {overall:.1} % over the sums. Our \
         prompt is also shorter because a flat list in JSON spends tokens on numbers and names of fields; the other \
         two lists show what the numbers and what the captions cost. With the number of objects the prompt grows as its logarithm (R2 {:.3}).",
        paper_reduction.iter().copied().fold(0.0, f64::max),
        found.growth_r2
    )) + &table(&head, &lines)
        + &bars("Tokens of a prompt", "tokens", &DATASETS, &series)
        + &command(&args);
    Ok(Section { id: "tokens", title: "Table II: tokens", body, claims })
}

#[derive(Deserialize)]
struct TierRow {
    n: usize,
    flat: f64,
    ours: f64,
}

/// The paper's figure of success rates over D1 to D9.
pub fn by_dataset(paper: &Paper) -> Result<Section> {
    let mut args = words("bench tiers --seeds");
    args.push(paper.sizes.seeds.to_string());
    let found: BTreeMap<String, serde_json::Value> = paper.experiments.result(&args)?;
    let rows: Vec<TierRow> = DATASETS
        .iter()
        .map(|name| Ok(TierRow::deserialize(found.get(*name).unwrap_or(&serde_json::Value::Null))?))
        .collect::<Result<_>>()?;
    let said = |percent: &Option<f64>| percent.map_or("-".to_owned(), |percent| format!("{percent:.0}"));
    let mut head = vec![""];
    head.extend(DATASETS);
    let line = |name: &str, values: &mut dyn Iterator<Item = String>| -> Vec<String> {
        std::iter::once(name.to_owned()).chain(values).collect()
    };
    let mut lines = vec![
        line("paper, flat list, %", &mut tiers::PAPER_FLAT.iter().map(said)),
        line("paper, hierarchical, %", &mut tiers::PAPER_OURS.iter().map(said)),
        line(
            "reader of the flat list",
            &mut rows.iter().map(|row| with_interval(&share(row.flat, row.n), 100.0, 0, "")),
        ),
        line("reader of our prompt", &mut rows.iter().map(|row| with_interval(&share(row.ours, row.n), 100.0, 0, ""))),
        line("questions", &mut rows.iter().map(|row| row.n.to_string())),
    ];
    let mut commands = command(&args);
    let mut claims = Vec::new();
    let count = |of: &dyn Fn(&TierRow) -> f64| rows.iter().map(|row| right(of(row), row.n)).sum::<usize>();
    let n: usize = rows.iter().map(|row| row.n).sum();
    let gain = shares_95((count(&|row| row.flat), n), (count(&|row| row.ours), n));
    claims.push(Claim {
        claim: "Our prompt leads to more right answers than the flat list: a reader that makes no mistake".into(),
        paper: "+20 points in D3, +64 in D9; the abstract says up to +11.68 %".into(),
        ours: difference(&gain, 100.0, 1, " points"),
        n,
        finding: Finding::positive(&gain),
        comparable: "Not with the paper's: a reader without mistakes shows whether a prompt says enough, and a flat list says all. What a list does to a language model is measured with --llm only.",
    });
    if paper.has_model() {
        let args = latency_args(paper);
        let found: Latency = paper.experiments.result(&args)?;
        let of = |format: &LatencyFormat| -> Vec<(usize, usize)> {
            DATASETS.iter().map(|name| format.by_scene.get(*name).map_or((0, 0), |row| (row.right, row.n))).collect()
        };
        let shown = |name: &str, counts: &[(usize, usize)]| {
            line(name, &mut counts.iter().map(|(right, n)| percent(*right as f64 / (*n).max(1) as f64, *n)))
        };
        let (flat, ours) = (of(&found.flat), of(&found.ours));
        lines.push(shown("model, flat list", &flat));
        lines.push(shown("model, our prompt", &ours));
        let sum = |counts: &[(usize, usize)]| counts.iter().fold((0, 0), |all, one| (all.0 + one.0, all.1 + one.1));
        let gain = shares_95(sum(&flat), sum(&ours));
        claims.push(Claim {
            claim: "Our prompt leads a language model to more right answers than the flat list".into(),
            paper: "+20 points in D3, +64 in D9; the abstract says up to +11.68 %".into(),
            ours: difference(&gain, 100.0, 1, " points"),
            n: sum(&ours).1,
            finding: Finding::positive(&gain),
            comparable: "Same kind of scenes and question, another model; one decision and not a whole drive.",
        });
        commands.push_str(&command(&args));
    }
    let body = paragraph(
        "Right answers to \"go to the nearest ...\" from the prompt alone. The readers make no mistake of their own: they show whether what is needed is in the text. \
         The paper drives a model with it, and its success falls with the length of the list; a reader's does not. The 11.68 % of its abstract \
         matches nothing here either: what its text reports are +20 points in D3 and +64 in D9.",
    ) + &table(&head, &lines)
        + &commands;
    Ok(Section { id: "datasets", title: "Success by dataset, D1 to D9", body, claims })
}

#[derive(Deserialize)]
struct Latency {
    model: String,
    flat: LatencyFormat,
    ours: LatencyFormat,
}

#[derive(Deserialize)]
struct LatencyFormat {
    n: usize,
    accepted: f64,
    right: f64,
    prompt_tokens_mean: f64,
    build_us: Quantiles,
    decision_ms: Quantiles,
    by_scene: BTreeMap<String, Counted>,
}

#[derive(Deserialize)]
struct Quantiles {
    p50: Option<f64>,
    p95: Option<f64>,
}

#[derive(Deserialize)]
struct Counted {
    n: usize,
    right: usize,
}

fn latency_args(paper: &Paper) -> Vec<String> {
    let mut args = words("bench latency --decisions");
    args.push(paper.sizes.decisions.to_string());
    args.extend(paper.model.iter().cloned());
    args
}

/// The paper's seconds of a decision.
pub fn latency(paper: &Paper) -> Result<Section> {
    let args = latency_args(paper);
    let found: Latency = paper.experiments.result(&args)?;
    let ms = |value: Option<f64>| value.map_or("-".into(), |ms| format!("{ms:.1} ms"));
    let row = |name: &str, format: &LatencyFormat| {
        vec![
            name.to_owned(),
            format.n.to_string(),
            format!("{:.0}", format.prompt_tokens_mean),
            ms(format.build_us.p50.map(|us| 1e-3 * us)),
            ms(format.decision_ms.p50),
            ms(format.decision_ms.p95),
            percent(format.accepted, format.n),
            percent(format.right, format.n),
        ]
    };
    let in_paper = |name: &str, seconds: f64| {
        let mut row = vec!["-".to_owned(); 8];
        row[0] = name.to_owned();
        row[4] = format!("{:.0} ms (mean)", 1e3 * seconds);
        row
    };
    let rows = [
        in_paper("paper, flat list", PAPER_S[0]),
        in_paper("paper, hierarchical", PAPER_S[1]),
        row("flat list", &found.flat),
        row("our prompt", &found.ours),
    ];
    let who = if paper.has_model() {
        format!("Both prompts were put to {}.", found.model)
    } else {
        "Without --llm a reader in this process answers at once: what is measured is all but the thinking of a model, and nothing about the paper's seconds. The \
         reader has no tools here and guesses among things that a prompt only counts."
            .to_owned()
    };
    let body = paragraph(&format!(
        "Time of a decision, from the scene graph to an action that the critic accepts. {who} The paper: 12.4 s with the flat list, 3.8 s with its prompt, \
         and geometry in less than 10 ms; times on a clock differ from run to run."
    )) + &table(
        &["", "n", "prompt tokens", "build, p50", "decision, p50", "decision, p95", "accepted", "right"],
        &rows,
    ) + &command(&args);
    let claims = vec![Claim {
        claim: "The geometry behind a prompt takes less than 10 ms".into(),
        paper: "< 10 ms".into(),
        ours: ms(found.ours.build_us.p95.map(|us| 1e-3 * us)) + ", p95",
        n: found.ours.n,
        finding: if found.ours.build_us.p95.is_some_and(|us| us < 1e4) { Finding::Shown } else { Finding::Refuted },
        comparable: "Same work, another machine.",
    }];
    Ok(Section { id: "latency", title: "Latency of a decision", body, claims })
}
