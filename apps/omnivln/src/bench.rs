//! `omnivln bench nav`, `bench coverage` and `bench map`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use arena::arms::{Arms, Setting};
use arena::bench_arms::BenchArms;
use arena::bench_coverage::{BenchCoverage, Coverage, bench_coverage};
use arena::bench_map::{BenchMap, bench_map};
use arena::bench_nav::{BenchNav, Given, bench_nav};
use arena::cli::{load_robot, stop_at_ctrl_c};
use arena::instructions::{Answers, open_instructions};
use arena::known_building::KnownFrom;
use arena::map_score::MapScore;
use arena::map_score::ratio::{Ratio, Spread};
use arena::mission::openai::ChatConfig;
use arena::mission::robot_model::RobotKind;
use arena::run::RunConfig;
use clap::{Args, ValueEnum};

use crate::building_options::BuildingOptions;

/// Which robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Robot {
    /// The quadruped.
    Ground,
    /// The quadrotor.
    Aerial,
}

impl From<Robot> for RobotKind {
    fn from(robot: Robot) -> RobotKind {
        match robot {
            Robot::Ground => RobotKind::Ground,
            Robot::Aerial => RobotKind::Aerial,
        }
    }
}

/// Which scenes a robot is put into, and what is done with the result: the options that the benches over scenes share.
#[derive(Debug, Args)]
struct SceneOptions {
    /// The robot
    #[arg(long, value_enum)]
    robot: Robot,
    /// Number of buildings
    #[arg(long, default_value_t = 20)]
    scenes: usize,
    /// Run only these of the scenes, to look at some again
    #[arg(long, value_delimiter = ',', value_name = "INDEX")]
    only: Vec<usize>,
    /// Seed from which buildings, starts and, where there are any, instructions are drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Another robot model
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Factor on what the segmenter gets wrong
    #[arg(long, default_value = "1", value_name = "FACTOR", value_delimiter = ',', value_parser = Setting::noise)]
    noise: Vec<Setting>,
    /// Keep the folder of every scene below DIR
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

impl SceneOptions {
    /// The scenes to run: all, or those asked for.
    fn indices(&self, scenes: usize) -> Result<Vec<usize>> {
        anyhow::ensure!(scenes > 0, "--scenes must be at least 1");
        if let Some(index) = self.only.iter().find(|index| **index >= scenes) {
            anyhow::bail!("--only {index}: there are {scenes} scenes, numbered from 0");
        }
        Ok(if self.only.is_empty() { (0..scenes).collect() } else { self.only.clone() })
    }
}

/// Options of `bench nav`: one instruction in each building; `--keep` keeps the run folders.
#[derive(Debug, Args)]
pub struct NavOptions {
    #[command(flatten)]
    scenes: SceneOptions,
    /// Give up after so many seconds of simulated time
    #[arg(long, default_value_t = 600.0)]
    max_time: f64,
    /// So many people walk about in each building (0 to 10)
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(..=10))]
    people: u32,
    /// The people do not heed the robot
    #[arg(long, requires = "people")]
    heedless: bool,
    /// The robot has surveyed each building before, and does not know where in it it stands
    #[arg(long)]
    known: bool,
    /// This share of the things in each building (0 to 1) was moved since the survey, or is gone
    #[arg(long, requires = "known", value_name = "SHARE")]
    moved: Option<f64>,
    /// Run the instructions of FILE instead of drawn ones, a JSON object a line: {"scene": "flat"|17, "text": "...", "targets": [ids of
    /// true objects; none: there is no such thing, and the robot must say so], "kind": "typo"}; also "rooms", "steps", "start", "seed"
    /// (documentation of arena::instructions)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scenes", "seed"])]
    instructions: Option<PathBuf>,
    /// Somebody answers when the robot asks which one is meant: lines {"scene": 17, "text": "...", "answer": "the one near the sink"}
    #[arg(long, value_name = "FILE")]
    answers: Option<PathBuf>,
    /// Base URL of an OpenAI-compatible server that reasons in place of the embedded rules, e.g. http://127.0.0.1:8091/v1
    #[arg(long, value_name = "URL")]
    llm: Option<String>,
    /// Name of the model on that server
    #[arg(long, value_name = "NAME", default_value = "default", requires = "llm")]
    model: String,
    #[command(flatten)]
    arms: ArmOptions,
    #[command(flatten)]
    buildings: BuildingOptions,
}

/// Runs the bench and prints its table or its JSON.
pub fn nav(options: &NavOptions) -> Result<ExitCode> {
    let asked = &options.scenes;
    let kind = RobotKind::from(asked.robot);
    let robot = load_robot(asked.urdf.as_deref(), kind)?;
    let instructions = options.instructions.as_deref().map(|path| open_instructions(path, &robot)).transpose()?;
    let answers = options.answers.as_deref().map(Answers::open).transpose()?;
    let indices = asked.indices(instructions.as_ref().map_or(asked.scenes, Vec::len))?;
    let given = Given { instructions: instructions.as_deref(), answers: answers.as_ref() };
    let max_time_s = options.max_time;
    anyhow::ensure!(
        max_time_s.is_finite() && max_time_s > 0.0,
        "--max-time must be a positive number of seconds, not {max_time_s}"
    );
    let llm = options.llm.as_deref().map(|url| ChatConfig::new(url, &options.model));
    let mut config = RunConfig { max_time_s, llm, ..RunConfig::default() };
    config.simulation.crowd.people = options.people;
    config.simulation.crowd.heeds_robot = !options.heedless;
    let stop = stop_at_ctrl_c()?;
    let moved = options.moved.unwrap_or(0.0);
    anyhow::ensure!((0.0..=1.0).contains(&moved), "--moved must be a share between 0 and 1, not {moved}");
    let known = options.known.then_some(KnownFrom { moved });
    let buildings = options.buildings.read()?;
    let arms = options.arms.arms(&asked.noise)?;
    let mut results = Vec::new();
    for (name, config) in arms.configs(&config) {
        let keep = asked.keep.as_ref().map(|keep| if arms.varied.is_empty() { keep.clone() } else { keep.join(&name) });
        let keep = keep.as_deref();
        let result =
            bench_nav(&robot, kind, &indices, given, asked.seed, &config, &buildings, known, keep, asked.quiet, &stop)?;
        if !asked.json {
            if !arms.varied.is_empty() {
                arena::say!("\n== {} {name}", arms.varied[0].option());
            }
            print_table(&indices, &result);
            if options.instructions.is_some() {
                print_kinds(&result);
            }
        }
        results.push((name, result));
    }
    match (arms.varied.first(), results.pop()) {
        (None, Some((_, result))) if asked.json => arena::say!("{}", serde_json::to_string(&result)?),
        (Some(varied), Some(last)) => {
            results.push(last);
            let result = BenchArms::new(varied.option(), results);
            if asked.json {
                arena::say!("{}", serde_json::to_string(&result)?);
            } else {
                print_arms(&result);
            }
        }
        _ => {}
    }
    Ok(ExitCode::SUCCESS)
}

/// What an experiment sets; of one option several values may be given, with commas between them: each is an arm, run over the same
/// buildings, starts and seeds, and compared with the first.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Experiments (several values of one of them, with commas between, are compared)")]
pub struct ArmOptions {
    /// LiDAR and camera all round, or 90 degrees ahead: omni, narrow
    #[arg(long, value_name = "WORD", value_delimiter = ',', value_parser = Setting::sensing)]
    sensing: Vec<Setting>,
    /// Text of the prompt, ours or a flat list of everything: octant, flat
    #[arg(long, value_name = "WORD", value_delimiter = ',', value_parser = Setting::prompt)]
    prompt: Vec<Setting>,
    /// Mount of the LiDAR: rotating, fixed
    #[arg(long, value_name = "WORD", value_delimiter = ',', value_parser = Setting::lidar)]
    lidar: Vec<Setting>,
    /// Leave a part out: none, rooms, pruning, verify, octants, tiers, steps, critic, vote
    #[arg(long, value_name = "WORD", value_delimiter = ',', value_parser = Setting::ablate)]
    ablate: Vec<Setting>,
    /// True poses that drift in place of the robot's own odometry: factor on half a per cent of the way and half a degree in 10 m
    #[arg(long, value_name = "FACTOR", value_delimiter = ',', value_parser = Setting::drift)]
    drift: Vec<Setting>,
    /// Factor on noise and biases of the IMU
    #[arg(long, value_name = "FACTOR", value_delimiter = ',', value_parser = Setting::imu_noise)]
    imu_noise: Vec<Setting>,
    /// The reasoner answers so late, in simulated seconds, as a model far away would: 2, or 0.1..15 for a draw at every call
    #[arg(long, value_name = "S", value_delimiter = ',', value_parser = Setting::latency)]
    llm_latency: Vec<Setting>,
    /// Share of its calls that are lost; after 20 s without an answer the reasoner on board takes the step
    #[arg(long, value_name = "SHARE", value_delimiter = ',', value_parser = Setting::loss)]
    llm_loss: Vec<Setting>,
    /// It cannot be reached from second AT on, for FOR seconds
    #[arg(long, value_name = "AT+FOR", value_delimiter = ',', value_parser = Setting::outage)]
    llm_outage: Vec<Setting>,
}

impl ArmOptions {
    /// What is kept and what is varied.
    fn arms(&self, noise: &[Setting]) -> Result<Arms> {
        Arms::new(&[
            &self.sensing,
            &self.prompt,
            &self.lidar,
            &self.ablate,
            noise,
            &self.drift,
            &self.imu_noise,
            &self.llm_latency,
            &self.llm_loss,
            &self.llm_outage,
        ])
    }
}

fn print_arms(result: &BenchArms) {
    arena::say!(
        "\n{:12} {:>4} {:>22} {:>6} {:>9} {:>6} {:>9} {:>9} {:>7}",
        result.varied,
        "n",
        "right (95 %)",
        "SPL",
        "tokens",
        "dec",
        "turned",
        "sighting",
        "sim s"
    );
    for arm in &result.arms {
        let f = &arm.figures;
        let [low, high] = f.success.interval_95;
        let sighting = f.first_sighting_s.map_or("-".to_owned(), |s| format!("{s:.1} s"));
        arena::say!(
            "{:12} {:4} {:>22} {:6.3} {:9.0} {:6.1} {:5.1} rad {sighting:>9} {:7.1}",
            arm.name,
            f.n,
            format!("{:.3} ({low:.2} to {high:.2})", f.success.value),
            f.spl,
            f.tokens,
            f.decisions,
            f.turned_in_place_rad,
            f.sim_s
        );
    }
    arena::say!("\ndifference to {} in the same runs, with 95 % intervals", result.arms[0].name);
    for paired in &result.paired {
        for (name, estimate, decimals) in paired.rows() {
            let [low, high] = estimate.interval_95;
            let clear = if estimate.is_clear() { "" } else { "   (not clear)" };
            arena::say!(
                "  {:10} {name:21} {:+.decimals$} ({low:+.decimals$} to {high:+.decimals$}){clear}",
                paired.name,
                estimate.value
            );
        }
    }
}

fn print_table(indices: &[usize], result: &BenchNav) {
    arena::say!("run  ok   path m  short m   spl  sim s  wall s  dec  tokens  hits  scene       instruction / reason");
    for (index, run) in indices.iter().zip(&result.runs) {
        arena::say!(
            "{index:3}  {:3} {:7.1} {:8} {:5.2} {:6.0} {:7.0} {:4} {:7} {:5}  {:10}  \"{}\"{}",
            if run.success { "yes" } else { "NO" },
            run.path_m,
            run.shortest_m.map_or("-".to_owned(), |m| format!("{m:.1}")),
            run.spl,
            run.sim_s,
            run.wall_s,
            run.decisions,
            run.prompt_tokens,
            run.collisions,
            run.scene,
            run.instruction,
            if run.success { String::new() } else { format!("\n     -> {}", run.reason) },
        );
    }
    let drawn = &result.drawn;
    arena::say!(
        "\ndrawn: rooms {:?}; kinds {}; target hidden at the start {:.0} %; rival of the class {:.0} %; median shortest way {:.1} m",
        drawn.rooms,
        drawn.kinds.iter().map(|(kind, share)| format!("{kind} {:.0} %", share * 100.0)).collect::<Vec<_>>().join(", "),
        drawn.target_hidden * 100.0,
        drawn.rival_exists * 100.0,
        drawn.shortest_median_m
    );
    arena::say!(
        "{} of {} right ({:.0} %), mean SPL {:.2}, {} collisions{}, {:.1}x real time, {:.0} s on the wall",
        result.runs.iter().filter(|run| run.success).count(),
        result.runs.len(),
        result.success_rate * 100.0,
        result.spl_mean,
        result.collisions,
        if result.people == 0 {
            String::new()
        } else {
            format!(", {} contacts with {} people", result.contacts_with_people, result.people)
        },
        result.realtime_factor,
        result.wall_s
    );
}

fn print_kinds(result: &BenchNav) {
    arena::say!("\nkind                  n  right   rate  95 %             SPL");
    for (kind, figures) in &result.by_kind {
        let spl = figures.spl.map_or("-".to_owned(), |spl| format!("{spl:.2}"));
        let [low, high] = figures.wilson_95;
        arena::say!("{kind:18} {:4} {:6} {:6.3}  {low:.3} to {high:.3}  {spl}", figures.n, figures.right, figures.rate);
    }
}

/// Options of `bench coverage`.
#[derive(Debug, Args)]
pub struct CoverageOptions {
    /// Number of buildings, each surveyed with both mounts
    #[arg(long, default_value_t = 10)]
    seeds: usize,
    /// Seed of the first building; the others follow
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Runs the bench and prints its table or its JSON.
pub fn coverage(options: &CoverageOptions) -> Result<ExitCode> {
    anyhow::ensure!(options.seeds > 0, "--seeds must be at least 1");
    let robot = load_robot(None, RobotKind::Ground)?;
    let stop = stop_at_ctrl_c()?;
    let result = bench_coverage(&robot, options.seed, options.seeds, &RunConfig::default(), options.quiet, &stop)?;
    if options.json {
        arena::say!("{}", serde_json::to_string(&result)?);
    } else {
        print_coverage(&result);
    }
    Ok(ExitCode::SUCCESS)
}

fn print_coverage(result: &BenchCoverage) {
    let row = |name: &str, mount: &str, c: &Coverage| {
        arena::say!(
            "{name:>8}  {mount:9} {:9.3} {:7.3} {:6.3} {:12.3} {:11.3} {:9.1} {:8.1}",
            c.precision,
            c.recall,
            c.f1,
            c.solid_angle_fraction,
            c.map_recall,
            c.known_after_s,
            c.objects
        );
    };
    arena::say!("    seed  mount     precision  recall     F1  solid angle  map recall  known s  objects");
    for seed in &result.seeds {
        row(&seed.seed.to_string(), "rotating", &seed.rotating);
        row("", "fixed", &seed.fixed);
    }
    row("mean", "rotating", &result.mean.rotating);
    row("", "fixed", &result.mean.fixed);
    row("std", "rotating", &result.std.rotating);
    row("", "fixed", &result.std.fixed);
}

/// Options of `bench map`; `--keep` keeps graph, map, truth and a list of what is wrong of every survey.
#[derive(Debug, Args)]
pub struct MapOptions {
    #[command(flatten)]
    scenes: SceneOptions,
}

/// Runs the bench and prints its table or its JSON.
pub fn map(options: &MapOptions) -> Result<ExitCode> {
    let asked = &options.scenes;
    let kind = RobotKind::from(asked.robot);
    let indices = asked.indices(asked.scenes)?;
    let [noise] = asked.noise[..] else { anyhow::bail!("--noise takes one number here") };
    let mut config = RunConfig::default();
    noise.apply(&mut config);
    let robot = load_robot(asked.urdf.as_deref(), kind)?;
    let stop = stop_at_ctrl_c()?;
    let result = bench_map(&robot, kind, &indices, asked.seed, &config, asked.keep.as_deref(), asked.quiet, &stop)?;
    if asked.json {
        arena::say!("{}", serde_json::to_string(&result)?);
    } else {
        print_map(&result);
    }
    Ok(ExitCode::SUCCESS)
}

fn print_map(result: &BenchMap) {
    arena::say!(
        "     scene rooms objects  prec  rec  dup label  cm  rooms doors  relations prec/rec  groups  ids changed"
    );
    let value = |ratio: &Ratio| ratio.value.map_or("   -".to_owned(), |value| format!("{value:.2}"));
    let row = |name: &str, rooms: usize, score: &MapScore| {
        let (objects, relations) = (&score.objects, &score.relations.after_eq7);
        arena::say!(
            "{name:>10} {rooms:5} {:7} {:>5} {:>4} {:4} {:>5} {:3.0}  {:>5} {:>5}  {:>9} / {:<9} {:6.2}  {:11}",
            objects.precision.of,
            value(&objects.precision),
            value(&objects.recall),
            objects.duplicates.hits,
            value(&objects.label_accuracy),
            objects.centroid_error_m.median.unwrap_or(f64::NAN) * 100.0,
            value(&score.places.right_room),
            value(&score.doorways.found),
            value(&relations.precision),
            value(&relations.recall),
            score.groups.adjusted_rand_index.unwrap_or(f64::NAN),
            score.room_ids.changes,
        );
    };
    for scene in &result.scenes {
        row(&scene.scene, scene.rooms, &scene.score);
    }
    let all = &result.pooled;
    row("all", all.places.true_rooms, all);
    let share = |name: &str, ratio: &Ratio| {
        arena::say!("  {name:44} {:>6} of {:<6} {}", ratio.hits, ratio.of, value(ratio));
    };
    let spread = |name: &str, spread: &Spread| {
        let cm = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{:.1} cm", value * 100.0));
        arena::say!("  {name:44} median {}, nine tenths below {}", cm(spread.median), cm(spread.p90));
    };
    arena::say!("\nobjects");
    share("precision by place", &all.objects.precision);
    share("recall of things with 30 LiDAR points", &all.objects.recall);
    share("things with more than one object", &all.objects.duplicates);
    share("names right, of objects that are a thing", &all.objects.label_accuracy);
    spread("distance of the middles", &all.objects.centroid_error_m);
    arena::say!("rooms");
    share("places in the right room", &all.places.right_room);
    arena::say!("  not counted: {} places in doorways, {} frontiers", all.places.in_doorways, all.places.frontiers);
    share("doorways found", &all.doorways.found);
    share("... between their two rooms", &all.doorways.found_between_its_rooms);
    share("doorways of the graph that are a door", &all.doorways.precision);
    spread("distance of the doorway", &all.doorways.place_error_m);
    spread("width of the doorway", &all.doorways.width_error_m);
    arena::say!(
        "  ids that changed: {}, of {} rooms over {} looks",
        all.room_ids.changes,
        all.room_ids.rooms,
        all.room_ids.looks
    );
    arena::say!(
        "relations                     precision            recall               within the error of measurement"
    );
    let stages = [
        ("as proposed", &all.relations.proposed),
        ("after Eq. 6", &all.relations.after_eq6),
        ("after Eq. 7", &all.relations.after_eq7),
    ];
    let counted = |ratio: &Ratio| format!("{} ({} of {})", value(ratio), ratio.hits, ratio.of);
    for (name, stage) in stages.into_iter().chain(all.relations.kinds.iter().map(|(kind, stage)| (*kind, stage))) {
        let (precision, recall) = (counted(&stage.precision), counted(&stage.recall));
        arena::say!("  {name:26}  {precision:20} {recall:20} {} of {}", stage.unsure.hits, stage.unsure.of);
    }
    arena::say!("groups");
    let index = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
    let (mean, worst) = (index(all.groups.adjusted_rand_index), index(all.groups.worst));
    arena::say!("  adjusted Rand index: mean {mean}, worst {worst}, over {} things", all.groups.things);
    share("pairs that are together, of those found", &all.groups.pair_precision);
    share("pairs found, of those that are together", &all.groups.pair_recall);
}
