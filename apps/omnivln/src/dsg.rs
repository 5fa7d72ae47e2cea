//! `omnivln dsg`: scene-graph files of ours and of spark_dsg: what is in them, from one into the other, what is different, what is wrong.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use arena::mission::dsg::{Format, LoadError, Opened, diff, open, salvage, scene_graph_text, scene_objects_json};
use arena::mission::stage_clock::CpuScope;
use clap::{Args, Subcommand, ValueEnum};
use serde_json::{Value, json};

use crate::memory::peak_rss_mib;

/// What to do. A FILE is a run folder, a graph.json, or a JSON file of spark_dsg.
#[derive(Debug, Subcommand)]
pub enum DsgCommand {
    /// What is in a graph: counts, then rooms, in them groups, in them objects
    Info(InfoOptions),
    /// Writes a graph in another format
    Convert(ConvertOptions),
    /// What is different between two graphs, one line each
    Diff(DiffOptions),
    /// What is wrong with a file, one line per fault
    Check(CheckOptions),
    /// How long loading and saving take, and how much memory loading
    Time(TimeOptions),
}

/// A format's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatName {
    /// Ours: a folder with graph.json, mesh.ply and ops.log; or one file NAME.json with NAME.mesh.ply and NAME.ops.log beside it
    Omni,
    /// JSON of spark_dsg 1.1.3 (Hydra, Khronos, Clio)
    SparkDsg,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Format {
        match name {
            FormatName::Omni => Format::Omni,
            FormatName::SparkDsg => Format::SparkDsg,
        }
    }
}

/// What is said of a file that is none.
const OTHER_KIND: &str = "neither a graph.json of ours nor a JSON file of spark_dsg (binary .sparkdsg files are not read: save them \
     as .json there)";

/// Options of `dsg info`.
#[derive(Debug, Args)]
pub struct InfoOptions {
    /// Scene graph
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Options of `dsg convert`.
#[derive(Debug, Args)]
pub struct ConvertOptions {
    /// Scene graph to read
    input: PathBuf,
    /// Where to write: a folder or NAME.json
    output: PathBuf,
    /// The format to write
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: FormatName,
    /// Read a damaged file: leave out what is broken, and say what
    #[arg(long)]
    salvage: bool,
}

/// Options of `dsg diff`.
#[derive(Debug, Args)]
pub struct DiffOptions {
    /// First scene graph
    first: PathBuf,
    /// Second scene graph
    second: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Options of `dsg check`.
#[derive(Debug, Args)]
pub struct CheckOptions {
    /// Scene graphs
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Options of `dsg time`.
#[derive(Debug, Args)]
pub struct TimeOptions {
    /// Scene graph
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs one of the commands.
pub fn run(command: &DsgCommand) -> Result<ExitCode> {
    match command {
        DsgCommand::Info(options) => info(options),
        DsgCommand::Convert(options) => convert(options),
        DsgCommand::Diff(options) => difference(options),
        DsgCommand::Check(options) => check(options),
        DsgCommand::Time(options) => time(options),
    }
}

fn opened(path: &Path) -> Result<Opened> {
    open(path).map_err(|error| named(path, error))
}

/// Errors of the disk name their file; all others are about the one that was asked for.
fn named(path: &Path, error: LoadError) -> anyhow::Error {
    match error {
        LoadError::Io { .. } | LoadError::MeshMissing { .. } | LoadError::MeshHash { .. } => error.into(),
        LoadError::Schema { .. } => anyhow::anyhow!("{}: {OTHER_KIND}", path.display()),
        error => anyhow::Error::from(error).context(path.display().to_string()),
    }
}

fn info(options: &InfoOptions) -> Result<ExitCode> {
    let opened = opened(&options.file)?;
    let graph = &opened.graph;
    let format = match opened.format {
        Format::Omni => "omni",
        Format::SparkDsg => "spark-dsg",
    };
    let mesh = opened.mesh().map_err(|error| named(&options.file, error))?;
    let (vertices, faces) = mesh.as_ref().map_or((0, 0), |mesh| (mesh.points.len(), mesh.faces.len()));
    let poses: usize = graph.agents().map(|agent| agent.trajectory.len()).sum();
    let moving = graph.objects().filter(|object| object.is_dynamic()).count();
    if options.json {
        let rooms: Value = serde_json::from_str(&scene_objects_json(graph)).context("the summary is no JSON")?;
        let answer = json!({
            "format": format, "nodes": opened.nodes, "edges": opened.edges, "revision": graph.revision(),
            "objects": graph.objects().count(), "moving": moving, "places": graph.places().count(),
            "rooms": graph.rooms().count(), "buildings": graph.buildings().count(), "groups": graph.groups().count(),
            "relations": graph.relations().count(), "agents": graph.agents().count(), "poses": poses,
            "mesh_vertices": vertices, "mesh_faces": faces, "summary": rooms,
        });
        arena::say!("{answer}");
        return Ok(ExitCode::SUCCESS);
    }
    arena::say!("{}: {format}, {} nodes, {} edges", options.file.display(), opened.nodes, opened.edges);
    arena::say!(
        "  objects {} ({moving} moving), places {}, rooms {}, buildings {}, groups {}, relations {}, poses {poses}, mesh {vertices} vertices and {faces} faces",
        graph.objects().count(),
        graph.places().count(),
        graph.rooms().count(),
        graph.buildings().count(),
        graph.groups().count(),
        graph.relations().count(),
    );
    arena::say!("{}", scene_graph_text(graph).trim_end());
    Ok(ExitCode::SUCCESS)
}

fn convert(options: &ConvertOptions) -> Result<ExitCode> {
    let opened = if options.salvage {
        let saved = salvage(&options.input).map_err(|error| named(&options.input, error))?;
        for fault in &saved.faults {
            eprintln!("left out: {fault}");
        }
        eprintln!("{} faults in {}", saved.fault_count, options.input.display());
        saved.opened
    } else {
        opened(&options.input)?
    };
    opened.save(&options.output, options.to.into()).map_err(|error| named(&options.output, error))?;
    eprintln!("{} nodes, {} edges -> {}", opened.nodes, opened.edges, options.output.display());
    Ok(ExitCode::SUCCESS)
}

/// 0: the same; 1: different.
fn difference(options: &DiffOptions) -> Result<ExitCode> {
    let (first, second) = (opened(&options.first)?, opened(&options.second)?);
    let differences = diff(&first.graph, &second.graph);
    let read = |opened: &Opened, path: &Path| opened.mesh().map_err(|error| named(path, error));
    let is_mesh_same = read(&first, &options.first)? == read(&second, &options.second)?;
    if options.json {
        let list: Vec<Value> = differences
            .iter()
            .map(|d| json!({ "node": d.node, "field": d.field, "before": d.before, "after": d.after }))
            .collect();
        arena::say!("{}", json!({ "differences": list, "mesh_same": is_mesh_same }));
    } else {
        for difference in &differences {
            arena::say!("{difference}");
        }
        if !is_mesh_same {
            arena::say!("the meshes are different");
        }
        if differences.is_empty() && is_mesh_same {
            arena::say!("no difference");
        }
    }
    Ok(if differences.is_empty() && is_mesh_same { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// 0: sound; 1: faults, one line each.
fn check(options: &CheckOptions) -> Result<ExitCode> {
    let mut reports = Vec::new();
    for path in &options.files {
        let (faults, count) = match salvage(path) {
            Ok(saved) => {
                let mut faults: Vec<String> = saved.faults.iter().map(ToString::to_string).collect();
                let mut count = saved.fault_count;
                let more = [
                    saved.opened.graph.check_invariants().err().map(|error| error.to_string()),
                    saved.opened.mesh().err().map(|error| error.to_string()),
                ];
                for fault in more.into_iter().flatten() {
                    count += 1;
                    faults.push(fault);
                }
                (faults, count)
            }
            Err(LoadError::Schema { .. }) => (vec![OTHER_KIND.to_owned()], 1),
            Err(error) => (vec![error.to_string()], 1),
        };
        if !options.json {
            for fault in &faults {
                arena::say!("{}: {fault}", path.display());
            }
            if count > faults.len() {
                arena::say!("{}: ... and {} more", path.display(), count - faults.len());
            }
            if count == 0 {
                eprintln!("{}: sound", path.display());
            }
        }
        reports.push((path, faults, count));
    }
    if options.json {
        let list: Vec<Value> = reports
            .iter()
            .map(|(path, faults, count)| json!({ "file": path.display().to_string(), "faults": faults, "fault_count": count }))
            .collect();
        arena::say!("{}", json!({ "files": list }));
    }
    let is_sound = reports.iter().all(|(_, _, count)| *count == 0);
    Ok(if is_sound { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn time(options: &TimeOptions) -> Result<ExitCode> {
    let clock = CpuScope::Thread.now();
    let opened = opened(&options.file)?;
    let load_cpu_s = clock.elapsed().as_secs_f64();
    // Before anything is saved: the peak of a process that only loads.
    let peak_rss_mib = peak_rss_mib();
    let folder = std::env::temp_dir().join(format!("omnivln-dsg-time-{}", std::process::id()));
    std::fs::create_dir_all(&folder).with_context(|| format!("creating {}", folder.display()))?;
    let clock = CpuScope::Thread.now();
    let saved = opened.save(&folder.join("saved.json"), opened.format);
    let save_cpu_s = clock.elapsed().as_secs_f64();
    let is_removed = std::fs::remove_dir_all(&folder);
    saved.map_err(|error| named(&folder, error))?;
    is_removed.with_context(|| format!("removing {}", folder.display()))?;
    ensure!(load_cpu_s.is_finite() && save_cpu_s.is_finite(), "the system does not tell the CPU time");
    if options.json {
        let answer = json!({
            "nodes": opened.nodes, "edges": opened.edges, "load_cpu_s": load_cpu_s, "save_cpu_s": save_cpu_s,
            "peak_rss_mib": peak_rss_mib,
        });
        arena::say!("{answer}");
    } else {
        arena::say!("{} nodes, {} edges", opened.nodes, opened.edges);
        arena::say!("load {load_cpu_s:.3} s, save {save_cpu_s:.3} s of CPU time");
        if let Some(mib) = peak_rss_mib {
            arena::say!("peak of the memory after loading {mib:.0} MiB");
        }
    }
    Ok(ExitCode::SUCCESS)
}
