//! `omnivln fuse DIR --out mesh.ply`: posed scans become a surface, a distance field and places.
//!
//! They come from a folder of scans and poses (`fuse/folder.rs`), or from a recording and the trajectory of its IMU
//! (`fuse/posed_recording.rs`). Everything is brought up to date after each scan, as on a robot; the times are CPU seconds of the thread that
//! does it, reading not included.

mod folder;
mod posed_recording;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc::sync_channel;

use anyhow::{Context, Result, ensure};
use arena::mission::stage_clock::{CpuScope, StageClock};
use arena::mission::volumetric_map::{DistanceField, Mesh, PlaceConfig, PlaceGraph, Volume, VolumeConfig};
use arena::progress::ProgressView;
use arena::whole_file::write_whole;
use clap::{Args, ValueEnum};
use nalgebra::Point3;
use serde_json::{Value, json};

use self::folder::ScanFolder;
use self::posed_recording::PosedRecording;
use crate::recording_args::RecordingArgs;

/// What a ray tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// The surface it ends at; nothing that went away is cleared, there is no free space and so no places
    Band,
    /// The surface, and that the way to it is free
    Clear,
}

/// Options of `fuse`.
#[derive(Debug, Args)]
pub struct FuseOptions {
    /// Folder with poses.csv and scan_0000.ply, ...; with --trajectory a bag of ROS 2, or a folder with meta.json
    scans: PathBuf,
    /// Where the IMU of the recording was: a file of lines "t x y z qx qy qz qw", as `odometry` writes it
    #[arg(long, value_name = "TUM")]
    trajectory: Option<PathBuf>,
    #[command(flatten)]
    recording: RecordingArgs,
    /// Edge of a voxel, metres
    #[arg(long, default_value_t = 0.05, value_name = "METRES")]
    voxel: f64,
    /// Surfaces only, or free space too
    #[arg(long, value_enum, default_value_t = Mode::Clear)]
    mode: Mode,
    /// With 2 or more, scans are read while others are fused; the results are the same, byte by byte
    #[arg(long, default_value_t = 1, value_name = "N")]
    threads: usize,
    /// Mesh file to write (binary PLY)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Places and their edges, as JSON
    #[arg(long, value_name = "FILE")]
    places: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Reads, fuses, writes, prints.
pub fn run(options: &FuseOptions) -> Result<ExitCode> {
    ensure!((1..=64).contains(&options.threads), "--threads must be between 1 and 64, not {}", options.threads);
    ensure!(
        options.trajectory.is_some() || options.recording.is_empty(),
        "--rig and topics are for recordings: say with --trajectory where the IMU was"
    );
    ensure!(options.places.is_none() || options.mode == Mode::Clear, "--places needs free space: use --mode clear");
    let config = volume_config(options.voxel);
    config.validate().with_context(|| format!("--voxel {}", options.voxel))?;
    let source = Source::open(options)?;
    let mut map = Map::new(config, options.mode)?;
    let count = source.len().unwrap_or(0) as u64;
    let template =
        if count > 0 { "{elapsed_precise} [{bar:30}] {pos}/{len} {msg}" } else { "{elapsed_precise} {spinner} {msg}" };
    let view = ProgressView::new(count, template, options.quiet);
    if options.threads == 1 {
        for scan in source.scans()? {
            map.fold(&scan?)?;
            map.tell(&view, source.len());
        }
    } else {
        std::thread::scope(|scope| -> Result<()> {
            // Two scans ahead are enough to keep the other thread busy, and bound the memory.
            let (send, receive) = sync_channel(2);
            let reads = &source;
            scope.spawn(move || {
                let scans = reads.scans().unwrap_or_else(|error| Box::new(std::iter::once(Err(error))));
                for scan in scans {
                    // The other side is gone once something failed there: nothing more to read.
                    if send.send(scan).is_err() {
                        return;
                    }
                }
            });
            for scan in receive {
                map.fold(&scan?)?;
                map.tell(&view, source.len());
            }
            Ok(())
        })?;
    }
    view.finish();
    ensure!(map.scans > 0, "{} holds no scan that could be fused", options.scans.display());
    let mesh = map.complete_mesh();
    write_whole(&options.out, |out| mesh.write_ply(out))?;
    if let Some(file) = &options.places {
        let text = serde_json::to_string(&places_json(&map.places))?;
        write_whole(file, |out| out.write_all(text.as_bytes()))?;
    }
    let summary = map.summary(&mesh);
    if options.json {
        arena::say!("{summary}");
    } else {
        print_summary(&summary);
    }
    Ok(ExitCode::SUCCESS)
}

/// Lengths in proportion to the voxel: the band reaches four voxels in front of a surface and one and a half behind it.
fn volume_config(voxel_m: f64) -> VolumeConfig {
    VolumeConfig {
        voxel_m,
        truncation_m: 4.0 * voxel_m,
        behind_m: 1.5 * voxel_m,
        max_range_m: 20.0f64.min(10_000.0 * voxel_m),
        min_weight: 1,
        ..VolumeConfig::default()
    }
}

/// What grows with the scans, and what it costs.
struct Map {
    mode: Mode,
    volume: Volume,
    field: DistanceField,
    places: PlaceGraph,
    scans: usize,
    points: usize,
    skipped: usize,
    clock: StageClock,
}

impl Map {
    fn new(config: VolumeConfig, mode: Mode) -> Result<Self> {
        let resolution_m = 2.0 * config.voxel_m;
        Ok(Self {
            mode,
            volume: Volume::new(config)?,
            field: DistanceField::new(resolution_m, 20.0 * resolution_m),
            places: PlaceGraph::new(PlaceConfig::default())?,
            scans: 0,
            points: 0,
            skipped: 0,
            clock: StageClock::new(CpuScope::Thread),
        })
    }

    fn fold(&mut self, scan: &PosedScan) -> Result<()> {
        let Self { volume, field, places, clock, .. } = self;
        let report = clock
            .time("integrate", || match self.mode {
                Mode::Band => volume.integrate_band(&scan.origin, &scan.points),
                Mode::Clear => volume.integrate(&scan.origin, &scan.points),
            })
            .with_context(|| format!("the pose of {}", scan.name))?;
        ensure!(
            report.refused_blocks == 0,
            "{}: the map is full ({} blocks); the pose may be wrong, or --voxel is too small for this place",
            scan.name,
            volume.config().max_blocks
        );
        clock.time("labels", || volume.vote_instances(&scan.labelled));
        clock.time("mesh", || volume.update_mesh());
        if self.mode == Mode::Clear {
            let update = clock.time("distance", || field.update(volume));
            ensure!(
                update.refused_blocks == 0,
                "{}: the distance field cannot span the map; the pose may be wrong",
                scan.name
            );
            clock.time("places", || places.update(field));
        }
        self.scans += 1;
        self.points += scan.points.len();
        self.skipped += scan.skipped + report.non_finite + report.too_near;
        Ok(())
    }

    /// The mesh with every change in it.
    fn complete_mesh(&mut self) -> Mesh {
        let Self { volume, clock, .. } = self;
        clock.time("mesh", || volume.complete_mesh());
        self.volume.mesh()
    }

    /// How far it is; without a terminal every tenth scan is news.
    fn tell(&self, view: &ProgressView, of: Option<usize>) {
        let line = format!(
            "scan {}{}: {} blocks, {} places",
            self.scans,
            of.map_or(String::new(), |count| format!(" of {count}")),
            self.volume.block_count(),
            self.places.places().len()
        );
        view.show(self.scans as u64, &line, self.scans.is_multiple_of(10) || Some(self.scans) == of);
    }

    fn summary(&self, mesh: &Mesh) -> Value {
        let observed = self.volume.observed_voxels();
        let figures = self.clock.figures();
        let cpu = |stage: &str| figures.get(stage).map_or(0.0, |stage| stage.cpu_ms_total * 1e-3);
        json!({
            "scans": self.scans,
            "points": self.points,
            "points_skipped": self.skipped,
            "cpu_s_integrate": cpu("integrate"),
            "cpu_s_labels": cpu("labels"),
            "cpu_s_mesh": cpu("mesh"),
            "cpu_s_distance": cpu("distance"),
            "cpu_s_places": cpu("places"),
            "blocks": self.volume.block_count(),
            "observed_voxels": observed,
            "bytes_per_observed_voxel": self.volume.memory_bytes() as f64 / observed.max(1) as f64,
            "mesh_vertices": mesh.vertices.len(),
            "mesh_faces": mesh.faces.len(),
            "places": self.places.places().len(),
            "place_edges": self.places.edges().len(),
        })
    }
}

/// A scan in the world's frame.
struct PosedScan {
    /// What it is called in complaints.
    name: String,
    origin: Point3<f64>,
    points: Vec<Point3<f32>>,
    /// The points that carry a label, with it and with their instance (0 = none).
    labelled: Vec<(Point3<f32>, u16, u16)>,
    /// Points that had no pose or no angle, or were not finite.
    skipped: usize,
}

/// Scans one after the other; an error ends them.
type Scans = Box<dyn Iterator<Item = Result<PosedScan>>>;

/// Where scans and poses come from.
enum Source {
    Folder(ScanFolder),
    Recording(Box<PosedRecording>),
}

impl Source {
    fn open(options: &FuseOptions) -> Result<Source> {
        match &options.trajectory {
            Some(trajectory) => Ok(Source::Recording(Box::new(PosedRecording::open(options, trajectory)?))),
            None => Ok(Source::Folder(ScanFolder::open(&options.scans)?)),
        }
    }

    /// Number of scans, where that is known before.
    fn len(&self) -> Option<usize> {
        match self {
            Source::Folder(folder) => Some(folder.len()),
            Source::Recording(_) => None,
        }
    }

    fn scans(&self) -> Result<Scans> {
        match self {
            Source::Folder(folder) => Ok(folder.scans()),
            Source::Recording(recording) => recording.scans(),
        }
    }
}

/// Nodes are `[x, y, z, clearance]`, edges `[i, j, clearance]` with numbers of nodes; metres.
fn places_json(graph: &PlaceGraph) -> Value {
    let places = graph.places();
    let nodes: Vec<_> =
        places.iter().map(|p| json!([p.position.x, p.position.y, p.position.z, p.clearance_m])).collect();
    let number = |id| places.binary_search_by_key(&id, |p| p.id).expect("the ends of an edge are places");
    let edges: Vec<_> = graph.edges().iter().map(|e| json!([number(e.a), number(e.b), e.clearance_m])).collect();
    let ids: Vec<_> = places.iter().map(|p| p.id.0).collect();
    json!({ "nodes": nodes, "edges": edges, "ids": ids })
}

fn print_summary(summary: &Value) {
    let number = |key: &str| summary[key].as_f64().unwrap_or(0.0);
    let scans = number("scans").max(1.0);
    arena::say!(
        "{} scans, {} points; {} blocks, {} observed voxels at {:.1} bytes",
        summary["scans"],
        summary["points"],
        summary["blocks"],
        summary["observed_voxels"],
        number("bytes_per_observed_voxel")
    );
    arena::say!(
        "mesh: {} vertices, {} faces; {} places, {} edges",
        summary["mesh_vertices"],
        summary["mesh_faces"],
        summary["places"],
        summary["place_edges"]
    );
    arena::say!(
        "ms CPU a scan: integrate {:.1}, labels {:.1}, mesh {:.1}, distance {:.1}, places {:.1}; {:.2} million points per CPU second",
        1e3 * number("cpu_s_integrate") / scans,
        1e3 * number("cpu_s_labels") / scans,
        1e3 * number("cpu_s_mesh") / scans,
        1e3 * number("cpu_s_distance") / scans,
        1e3 * number("cpu_s_places") / scans,
        1e-6 * number("points") / number("cpu_s_integrate").max(1e-9)
    );
}
