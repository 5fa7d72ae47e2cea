//! What the robot knows of a building: with a LiDAR that turns and one that does not, and after hours.

use anyhow::Result;
use arena::intervals::paired_mean_95;
use serde::Deserialize;

use super::layout::{Claim, Finding, Section, command, difference, paragraph, table};
use super::{Paper, words};

#[derive(Deserialize)]
struct Surveys {
    seeds: Vec<Pair>,
}

#[derive(Deserialize)]
struct Pair {
    rotating: Known,
    fixed: Known,
}

#[derive(Deserialize)]
struct Known {
    precision: f64,
    recall: f64,
    f1: f64,
    solid_angle_fraction: f64,
    map_recall: f64,
    objects: f64,
    #[serde(default)]
    known_after_s: Option<f64>,
}

type Figure = (&'static str, fn(&Known) -> f64, usize);

/// Rotating against fixed.
pub fn mounts(paper: &Paper) -> Result<Section> {
    let mut args = words("bench coverage --seed 1 --seeds");
    args.push(paper.sizes.coverage.to_string());
    let found: Surveys = paper.experiments.result(&args)?;
    let n = found.seeds.len();
    const FIGURES: [Figure; 7] = [
        ("object F1", |known| known.f1, 3),
        ("precision of objects", |known| known.precision, 3),
        ("recall of objects", |known| known.recall, 3),
        ("right objects", |known| known.objects, 1),
        ("median time until known, s", |known| known.known_after_s.unwrap_or(f64::NAN), 1),
        ("directions seen in a turn", |known| known.solid_angle_fraction, 3),
        ("visible surface in the map", |known| known.map_recall, 3),
    ];
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / n.max(1) as f64;
    let gain = |of: fn(&Known) -> f64| {
        paired_mean_95(&found.seeds.iter().map(|pair| of(&pair.rotating) - of(&pair.fixed)).collect::<Vec<_>>())
    };
    let rows: Vec<Vec<String>> = FIGURES
        .iter()
        .map(|(name, of, decimals)| {
            vec![
                (*name).to_owned(),
                format!("{:.decimals$}", mean(&mut found.seeds.iter().map(|pair| of(&pair.rotating)))),
                format!("{:.decimals$}", mean(&mut found.seeds.iter().map(|pair| of(&pair.fixed)))),
                difference(&gain(*of), 1.0, *decimals, ""),
            ]
        })
        .collect();
    let (f1, objects) = (gain(|known| known.f1), gain(|known| known.objects));
    let claims = vec![
        Claim {
            claim: "A rotating LiDAR makes better maps of things: object F1".into(),
            paper: "-".into(),
            ours: difference(&f1, 1.0, 3, ""),
            n,
            finding: Finding::positive(&f1),
            comparable: "The paper counts nodes and does not say how many are right.",
        },
        Claim {
            claim: "... and more of them: right objects".into(),
            paper: "85 instead of 61 (one building)".into(),
            ours: difference(&objects, 1.0, 1, " objects"),
            n,
            finding: Finding::positive(&objects),
            comparable: "The paper's figure is of one drive; ours counts an object only once and only if it is there.",
        },
    ];
    let body = paragraph(&format!(
        "{n} buildings, each surveyed twice along the same way with the same pipeline; only the mount differs. An object counts if it is a true one of that class at that place, once."
    )) + &table(&["mean", "rotating", "fixed", "difference in pairs"], &rows)
        + &command(&args);
    Ok(Section { id: "mounts", title: "Rotating or fixed LiDAR", body, claims })
}

#[derive(Deserialize)]
struct Patrol {
    sim_s: f64,
    errands: usize,
    right: usize,
    path_m: f64,
    collisions: usize,
    lost_s: f64,
    odometry_resets: u64,
    scan_to_command_ms: Times,
    growth_percent: Option<f64>,
    memory: Vec<Sample>,
}

#[derive(Deserialize)]
struct Times {
    median: f64,
    p99: f64,
}

#[derive(Deserialize)]
struct Sample {
    sim_s: f64,
    rss_mib: Option<f64>,
}

/// Hours of errands.
pub fn patrol(paper: &Paper) -> Result<Section> {
    let mut args = words("bench patrol --scene flat --hours");
    args.push(paper.sizes.patrol_hours.to_string());
    let found: Patrol = paper.experiments.result(&args)?;
    let Times { median, p99 } = found.scan_to_command_ms;
    let rows = [
        vec!["simulated".into(), format!("{:.2} h, {:.0} m", found.sim_s / 3600.0, found.path_m)],
        vec!["errands right".into(), format!("{} of {}", found.right, found.errands)],
        vec!["collisions".into(), found.collisions.to_string()],
        vec!["odometry lost; begun anew".into(), format!("{:.1} s; {} times", found.lost_s, found.odometry_resets)],
        vec!["scan to command, CPU time".into(), format!("median {median:.1} ms, p99 {p99:.1} ms (bar 50 ms)")],
        vec![
            "growth of memory in the second half".into(),
            found.growth_percent.map_or("-".into(), |percent| format!("{percent:.1} % (bar 5 %)")),
        ],
    ];
    let curve: Vec<(f64, f64)> =
        found.memory.iter().filter_map(|sample| Some((sample.sim_s, sample.rss_mib?))).collect();
    let mut claims = vec![Claim {
        claim: "From a scan to the command that heeds it p99 is at most 50 ms (our bar)".into(),
        paper: "-".into(),
        ours: format!("{p99:.1} ms"),
        n: (10.0 * found.sim_s) as usize,
        finding: if p99 <= 50.0 { Finding::Shown } else { Finding::Refuted },
        comparable: "CPU time on this machine.",
    }];
    if let Some(percent) = found.growth_percent {
        claims.push(Claim {
            claim: "Memory grows by less than 5 % in the second half of a patrol (our bar)".into(),
            paper: "-".into(),
            ours: format!("{percent:.1} %"),
            n: found.memory.len(),
            finding: match (percent < 5.0, found.sim_s >= 7000.0) {
                (_, false) => Finding::Open,
                (true, true) => Finding::Shown,
                (false, true) => Finding::Refuted,
            },
            comparable: "The bar is for two hours; less shows nothing.",
        });
    }
    let body = paragraph("Errand after errand in one building.")
        + &table(&["", ""], &rows)
        + &arena::chart::curves("Resident memory", "MiB", &[("memory", curve)])
        + &command(&args);
    Ok(Section { id: "patrol", title: "Hours on patrol", body, claims })
}
