//! `omnivln plan-ground MAP.json`: shortest ways between polygons, for pairs of start and goal: of a point, exactly, or with
//! `--urdf` of a robot, with room for its outline.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use arena::cli::load_robot;
use arena::mission::navigation::Room;
use arena::mission::planner::{NoWay, PolygonMap, Raster, Unreached};
use arena::mission::robot_model::RobotKind;
use clap::Args;
use nalgebra::Point2;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::problem_file::read;

/// Options of `plan-ground`.
#[derive(Debug, Args)]
pub struct PlanGroundOptions {
    /// Polygons and pairs: {"outer": [[x, y], ...], "holes": [ring, ...], "pairs": [{"start": [x, y], "goal": [x, y]}, ...]}
    file: PathBuf,
    /// Ways for this robot instead of a point: room to turn at every bend, and at least to pass lengthwise on straight legs
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Metres in one unit of the map, for --urdf
    #[arg(long, default_value_t = 1.0, value_name = "M", requires = "urdf")]
    scale: f64,
    /// Plans each pair this often and takes the shortest time; the ways are the same
    #[arg(long, default_value_t = 5, value_name = "N")]
    repeats: usize,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Deserialize)]
struct MapFile {
    outer: Vec<[f64; 2]>,
    #[serde(default)]
    holes: Vec<Vec<[f64; 2]>>,
    pairs: Vec<Pair>,
}

#[derive(Deserialize)]
struct Pair {
    start: [f64; 2],
    goal: [f64; 2],
}

/// Reads, builds, plans, prints.
pub fn run(options: &PlanGroundOptions) -> Result<ExitCode> {
    ensure!((1..=1000).contains(&options.repeats), "--repeats must be between 1 and 1000, not {}", options.repeats);
    let place = || options.file.display().to_string();
    let file: MapFile = serde_json::from_str(&read(&options.file)?).with_context(place)?;
    let ring = |ring: &Vec<[f64; 2]>| ring.iter().map(|p| Point2::from(*p)).collect::<Vec<_>>();
    let (outer, holes) = (ring(&file.outer), file.holes.iter().map(ring).collect::<Vec<_>>());
    if let Some(urdf) = &options.urdf {
        return with_room(options, urdf, &outer, &holes, &file.pairs);
    }
    let (map, build_ms) = fastest(options.repeats, || PolygonMap::new(&outer, &holes));
    let map = map.with_context(place)?;
    let pairs = file.pairs.iter().map(|pair| {
        let (start, goal) = (Point2::from(pair.start), Point2::from(pair.goal));
        let (way, query_ms) = fastest(options.repeats, || map.route(&start, &goal));
        Answer {
            way: way.map(|way| (way.length, way.points)).map_err(|error| (error.to_string(), nearest_of(&error))),
            query_us: 1e3 * query_ms,
        }
    });
    let answers: Vec<Answer> = pairs.collect();
    let build = json!({"build_ms": build_ms, "vertices": map.corner_count(), "tangents": map.tangent_count()});
    let built = format!("{} corners, {} tangents, built in {build_ms:.2} ms", map.corner_count(), map.tangent_count());
    print(options, build, &built, &answers)
}

/// The ways of a robot: polygons as cells, its room from its URDF, lengths in units of the map.
fn with_room(
    options: &PlanGroundOptions,
    urdf: &Path,
    outer: &[Point2<f64>],
    holes: &[Vec<Point2<f64>>],
    pairs: &[Pair],
) -> Result<ExitCode> {
    let scale = options.scale;
    ensure!(scale.is_finite() && scale > 0.0, "--scale must be a positive number of metres, not {scale}");
    let robot = load_robot(Some(urdf), RobotKind::Ground)?;
    let room = Room::of(&robot);
    let metres = |ring: &[Point2<f64>]| ring.iter().map(|p| p * scale).collect::<Vec<_>>();
    let (outer, holes) = (metres(outer), holes.iter().map(|ring| metres(ring)).collect::<Vec<_>>());
    const CELL_M: f64 = 0.05;
    let place = || options.file.display().to_string();
    let (graph, build_ms) = fastest(options.repeats, || -> Result<_> {
        let raster = Raster::new(&outer, &holes, CELL_M).with_context(place)?;
        let graph = room.graph(&raster.view()).with_context(|| {
            format!("{} at {scale} m a unit is too large for cells in which this robot's room counts", place())
        })?;
        Ok((raster.view().resolution_m, graph))
    });
    let (cell_m, graph) = graph?;
    let answers = pairs.iter().map(|pair| {
        let (start, goal) = (Point2::from(pair.start) * scale, Point2::from(pair.goal) * scale);
        let (way, query_ms) = fastest(options.repeats, || graph.find(&start, &goal));
        // A robot that stands where it has no room is not pulled elsewhere in silence.
        let moved_m = cell_m * std::f64::consts::SQRT_2;
        let way = match way {
            Ok(way) if way.start_pull_m > moved_m => Err(("the robot has no room at the start".to_owned(), None)),
            Ok(way) if way.goal_pull_m <= moved_m => {
                Ok((way.length_m / scale, way.points.iter().map(|p| p / scale).collect()))
            }
            Ok(_) => Err(graph.nearest_reachable(&start, &goal).map_or_else(
                || ("the robot has no room at the start".to_owned(), None),
                |(nearest, off_m)| refused("there is no room for it at the goal", nearest / scale, off_m),
            )),
            Err(Unreached::NotFinite | Unreached::StartBlocked) => {
                Err(("the robot has no room at the start".to_owned(), None))
            }
            Err(Unreached::GoalOutside { nearest, off_m }) => {
                Err(refused("the goal is outside of the map", nearest / scale, off_m))
            }
            Err(Unreached::GoalBlocked { nearest, off_m }) => {
                Err(refused("there is no room for it at the goal", nearest / scale, off_m))
            }
            Err(Unreached::Apart { nearest, off_m }) => Err(refused("no way is wide enough", nearest / scale, off_m)),
        };
        Answer { way, query_us: 1e3 * query_ms }
    });
    let answers: Vec<Answer> = answers.collect();
    let build = json!({
        "build_ms": build_ms, "vertices": graph.vertex_count(), "gates": graph.gates().len(), "cell_m": cell_m,
        "turning_m": room.turning_m, "passing_m": room.passing_m,
    });
    let built = format!(
        "{}: {:.3} m of room to turn, {:.3} m to pass straight; {} vertices, {} gates, built in {build_ms:.2} ms with cells of {cell_m:.3} m",
        robot.name,
        room.turning_m,
        room.passing_m.unwrap_or(room.turning_m),
        graph.vertex_count(),
        graph.gates().len()
    );
    print(options, build, &built, &answers)
}

/// Why this robot does not get there, and what it gets to instead, in units of the map.
fn refused(why: &str, nearest: Point2<f64>, off_m: f64) -> Refusal {
    let (x, y) = (nearest.x, nearest.y);
    let reason = format!(
        "this robot does not get to the goal ({why}); the nearest point it gets to is [{x:.3}, {y:.3}], {off_m:.2} m from it"
    );
    (reason, Some(nearest))
}

/// Why there is no way, and the place that is offered instead, if there is one.
type Refusal = (String, Option<Point2<f64>>);

/// What came of a pair.
struct Answer {
    /// Length and points in units of the map.
    way: Result<(f64, Vec<Point2<f64>>), Refusal>,
    query_us: f64,
}

fn print(options: &PlanGroundOptions, mut build: Value, built: &str, answers: &[Answer]) -> Result<ExitCode> {
    let (count, found) = (answers.len(), answers.iter().filter(|answer| answer.way.is_ok()).count());
    if options.json {
        let pairs = answers.iter().map(|answer| match &answer.way {
            Ok((length, points)) => {
                let path: Vec<[f64; 2]> = points.iter().map(|p| [p.x, p.y]).collect();
                json!({"length": length, "query_us": answer.query_us, "path": path})
            }
            Err((reason, nearest)) => {
                let nearest = nearest.map(|p| [p.x, p.y]);
                json!({"length": null, "query_us": answer.query_us, "path": [], "reason": reason, "nearest": nearest})
            }
        });
        build["pairs"] = pairs.collect();
        arena::say!("{build}");
    } else {
        let mean_us = answers.iter().map(|answer| answer.query_us).sum::<f64>() / count.max(1) as f64;
        arena::say!("{built}; {found} of {count} ways, {mean_us:.1} us each");
        for (number, answer) in answers.iter().enumerate() {
            if let Err((reason, _)) = &answer.way {
                arena::say!("pair {number}: {reason}");
            }
        }
    }
    Ok(if found == count { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The place that is offered instead: the nearest free one to the start, or that can be reached to the goal.
fn nearest_of(error: &NoWay) -> Option<Point2<f64>> {
    match error {
        NoWay::NotFinite => None,
        NoWay::StartBlocked { nearest, .. } | NoWay::GoalBlocked { nearest, .. } | NoWay::Unreachable { nearest } => {
            Some(*nearest)
        }
    }
}

/// The result, and the shortest time of so many runs (ms): what others did on the machine meanwhile is not in it.
fn fastest<T>(repeats: usize, mut work: impl FnMut() -> T) -> (T, f64) {
    let mut timed = || {
        let start = Instant::now();
        let result = work();
        (result, start.elapsed().as_secs_f64() * 1e3)
    };
    let (mut result, mut best_ms) = timed();
    for _ in 1..repeats {
        let ms;
        (result, ms) = timed();
        best_ms = best_ms.min(ms);
    }
    (result, best_ms)
}
