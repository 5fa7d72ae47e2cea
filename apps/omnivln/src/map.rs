//! `omnivln map RECORDING --out DIR`: a building from a recording alone.
//!
//! Odometry, surface, places, rooms and things, as the robot would have had them. The folder is what `--known` begins with and what
//! `ask` answers from.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::{Context, Result, bail, ensure};
use arena::cli::{load_robot, stop_at_ctrl_c};
use arena::map_picture::{MapDrawing, map_svg};
use arena::mission::archive;
use arena::mission::config::MissionConfig;
use arena::mission::dsg::{scene_graph_text, scene_objects_json};
use arena::mission::mapping_run::MappingRun;
use arena::mission::omni_perception::Equirectangular;
use arena::mission::recording::{self, RecordingError, RecordingOptions};
use arena::mission::robot_model::RobotKind;
use arena::mission::segmented::segmented;
use arena::mission::segmenter::STANDING;
use arena::mission::segmenter_folder::FolderSegmenter;
use arena::mission::segmenter_http::{HttpSegmenter, HttpSegmenterConfig};
use arena::mission::stream::SensorEvent;
use arena::mission::tum::tum_line;
use arena::progress::ProgressView;
use arena::record::RECORDING_MARK;
use arena::run_folder::RunFolder;
use clap::Args;
use nalgebra::Point2;
use serde_json::{Value, json};

use crate::bench::Robot;
use crate::recording_args::RecordingArgs;

/// File that says what was mapped, and that it is whole.
const MAPPING_MARK: &str = "mapping.json";
/// Seconds of the recording between two lines of progress.
const NEWS_S: f64 = 5.0;

/// Options of `map`.
#[derive(Debug, Args)]
pub struct MapOptions {
    /// A bag of ROS 2 (folder or .mcap), or a folder with meta.json, imu.csv, motor.csv and scans/
    recording: PathBuf,
    /// Folder to write; an earlier map there is replaced once this one is complete
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The robot that carried the sensors; without it what the recording says, else ground
    #[arg(long, value_enum)]
    robot: Option<Robot>,
    /// Robot to use instead of the built-in one; FILE.toml beside it carries what URDF cannot
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    #[command(flatten)]
    about: RecordingArgs,
    /// Height of the body's origin over the floor at the beginning; without it that of the robot at rest
    #[arg(long, value_name = "METRES")]
    height: Option<f64>,
    /// Folder of masks, one JSON file a picture; without it masks/ in the recording
    #[arg(long, value_name = "DIR", conflicts_with = "segmenter")]
    masks: Option<PathBuf>,
    /// A service that segments the pictures
    #[arg(long, value_name = "URL")]
    segmenter: Option<String>,
    /// What the service shall look for besides its standing list
    #[arg(long, value_delimiter = ',', value_name = "NOUNS", requires = "segmenter")]
    phrases: Vec<String>,
    /// Table of names that mean the same, one "name = other name" a line
    #[arg(long, value_name = "FILE")]
    synonyms: Option<PathBuf>,
    /// Topic of the panorama
    #[arg(long, value_name = "TOPIC")]
    image: Option<String>,
    /// Print one JSON object: what mapping.json says
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Reads, maps, writes, prints.
pub fn run(options: &MapOptions) -> Result<ExitCode> {
    let said = Said::of(&options.recording)?;
    let kind = options.robot.map_or(said.robot, RobotKind::from);
    let robot = load_robot(options.urdf.as_deref(), kind)?;
    let rig = options.about.rig(Some(&robot))?;
    let height_m = options.height.unwrap_or(robot.stance_height_m);
    ensure!(height_m.is_finite() && height_m >= 0.0, "--height must be a number of metres from 0 up, not {height_m}");
    let source = Source::of(options)?;
    let recording_options = RecordingOptions {
        image_topic: options.image.clone(),
        are_images_needed: !matches!(source, Source::None),
        ..options.about.options(rig.as_ref())
    };
    let recording = recording::open_with(&options.recording, &recording_options)?;

    let mut config = MissionConfig::default();
    if let Some(path) = &options.synonyms {
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        config.label_names.add_table(&text).with_context(|| format!("reading {}", path.display()))?;
    }
    if let Some(rig) = &rig {
        config.fit(rig);
    }
    let (robot, camera) = match &rig {
        Some(rig) => (rig.fitted(&robot), rig.camera()),
        None => (recording.rig.fitted(&robot, recording.body_from_camera), said.panorama),
    };
    let mut run = MappingRun::new(&robot, &config, camera, height_m)?;

    let folder = RunFolder::marked(&options.out, MAPPING_MARK, "map folder")?;
    let stop = stop_at_ctrl_c()?;
    let standing: Vec<String> = STANDING.iter().map(|noun| (*noun).to_owned()).collect();
    let events = match source {
        Source::None => recording.events,
        Source::Files(segmenter) => Box::new(segmented(recording.events, segmenter, &options.phrases, &standing)),
        Source::Service(segmenter) => Box::new(segmented(recording.events, segmenter, &options.phrases, &standing)),
    };
    let view = ProgressView::new(0, "{elapsed_precise} {spinner} {wide_msg}", options.quiet);
    let is_interrupted = follow(&mut run, events, &view, &stop);
    view.finish();
    if run.way.is_empty() {
        bail!(
            "{} shows no way: {} scans were read, and the odometry never began{}; it needs half a second at rest, or half a second \
             of scans and an IMU in rad/s and m/s^2 (or g), with clocks that agree",
            options.recording.display(),
            run.scans,
            in_brackets(&run.unused())
        );
    }
    run.finish();

    let summary = summary(&run, is_interrupted);
    write(&folder, &run, &summary)?;
    let path = folder.publish()?;
    if options.json {
        arena::say!("{summary}");
    } else {
        print_summary(&run, &summary, &path);
    }
    Ok(ExitCode::SUCCESS)
}

/// Follows the recording to its end; true if somebody stopped it before.
fn follow(
    run: &mut MappingRun,
    events: impl Iterator<Item = Result<SensorEvent, RecordingError>>,
    view: &ProgressView,
    stop: &std::sync::atomic::AtomicBool,
) -> bool {
    let mut next_s = 0.0;
    for event in events {
        run.push(event);
        let Some(now_s) = run.world.odometry.map(|newest| run.seconds(newest.stamp)) else { continue };
        if now_s >= next_s {
            next_s = now_s + NEWS_S;
            let graph = &run.world.graph;
            let line = format!(
                "t {now_s:5.1} s | {:.1} m of way | {} rooms, {} objects",
                run.way_m(),
                graph.rooms().count(),
                graph.confirmed_objects().count()
            );
            view.show(now_s as u64, &line, true);
        }
        if stop.load(Ordering::Relaxed) {
            return true;
        }
    }
    false
}

/// Who says what is in the pictures.
enum Source {
    /// Nobody: the map knows no things.
    None,
    Files(FolderSegmenter),
    Service(HttpSegmenter),
}

impl Source {
    fn of(options: &MapOptions) -> Result<Source> {
        if let Some(url) = &options.segmenter {
            return Ok(Source::Service(HttpSegmenter::new(HttpSegmenterConfig::new(url))));
        }
        let beside = options.recording.join("masks");
        let folder = match &options.masks {
            Some(folder) => folder,
            None if beside.is_dir() => &beside,
            None => {
                if !options.quiet {
                    eprintln!(
                        "no masks: the map will know rooms and places, but no things (see --masks and --segmenter)"
                    );
                }
                return Ok(Source::None);
            }
        };
        let segmenter = FolderSegmenter::open(folder)?;
        ensure!(
            !segmenter.is_empty(),
            "{} holds no masks: files are named by the time of their picture in nanoseconds, STAMP.json",
            folder.display()
        );
        Ok(Source::Files(segmenter))
    }
}

/// What a recording of ours says of itself beside the bag.
struct Said {
    robot: RobotKind,
    panorama: Equirectangular,
}

impl Said {
    fn of(recording: &Path) -> Result<Said> {
        let mut said = Said { robot: RobotKind::Ground, panorama: Equirectangular::default() };
        let path = recording.join(RECORDING_MARK);
        if !path.is_file() {
            return Ok(said);
        }
        let file = File::open(&path).with_context(|| format!("opening {}", path.display()))?;
        let description: Value =
            serde_json::from_reader(file).with_context(|| format!("reading {}", path.display()))?;
        if description["robot"] == "aerial" {
            said.robot = RobotKind::Aerial;
        }
        let panorama = &description["panorama"];
        if panorama.is_object() {
            let pixels = |key: &str| panorama[key].as_u64().and_then(|value| u32::try_from(value).ok());
            let angle = |key: &str| panorama[key].as_f64();
            let found = (pixels("width_px"), pixels("height_px"), angle("phi_top_rad"), angle("phi_bottom_rad"));
            let (Some(width_px), Some(height_px), Some(phi_top_rad), Some(phi_bottom_rad)) = found else {
                bail!("{}: panorama needs width_px, height_px, phi_top_rad, phi_bottom_rad", path.display());
            };
            said.panorama = Equirectangular { width_px, height_px, phi_top_rad, phi_bottom_rad };
            said.panorama.validate().with_context(|| format!("{}: panorama", path.display()))?;
        }
        Ok(said)
    }
}

/// The keys are promised.
fn summary(run: &MappingRun, is_interrupted: bool) -> Value {
    let (graph, volume) = (&run.world.graph, &run.world.volume);
    let mesh = volume.mesh();
    json!({
        "scans": run.scans,
        "images": run.images,
        "duration_s": run.way.last().map_or(0.0, |(stamp, _)| run.seconds(*stamp)),
        "path_m": run.way_m(),
        "rooms": graph.rooms().count(),
        "objects": graph.confirmed_objects().count(),
        "places": graph.places().count(),
        "mesh_vertices": mesh.vertices.len(),
        "mesh_faces": mesh.faces.len(),
        "is_interrupted": is_interrupted,
        "dropped": run.dropped,
        "not_used": run.unused(),
        "stages": run.clock.figures(),
    })
}

fn write(folder: &RunFolder, run: &MappingRun, summary: &Value) -> Result<()> {
    let world = &run.world;
    archive::save(world, folder.path())?;
    folder.write("scene_graph.txt", scene_graph_text(&world.graph).as_bytes())?;
    folder.write("scene_objects.json", scene_objects_json(&world.graph).as_bytes())?;
    let mut trajectory = String::from("# t_s x y z qx qy qz qw: pose of the body in the map, z up\n");
    run.way.iter().for_each(|(stamp, pose)| trajectory += &tum_line(*stamp, pose));
    folder.write("trajectory.tum", trajectory.as_bytes())?;
    let path: Vec<Point2<f64>> = run.way.iter().map(|(_, pose)| pose.translation.vector.xy().into()).collect();
    let drawing =
        MapDrawing { rooms: world.rooms.as_ref(), path: &path, end: path.last().copied(), ..MapDrawing::default() };
    folder.write("map.svg", map_svg(&world.graph, &drawing).as_bytes())?;
    folder.write(MAPPING_MARK, &serde_json::to_vec_pretty(summary)?)
}

fn print_summary(run: &MappingRun, summary: &Value, path: &Path) {
    arena::say!(
        "{:.1} s and {:.1} m of way: {} rooms, {} objects, {} places, {} triangles",
        summary["duration_s"].as_f64().unwrap_or(0.0),
        run.way_m(),
        summary["rooms"],
        summary["objects"],
        summary["places"],
        summary["mesh_faces"],
    );
    run.unused().iter().for_each(|sentence| arena::say!("  {sentence}"));
    arena::say!("Look at {}", path.join("map.svg").display());
}

fn in_brackets(sentences: &[String]) -> String {
    if sentences.is_empty() { String::new() } else { format!(" ({})", sentences.join("; ")) }
}
