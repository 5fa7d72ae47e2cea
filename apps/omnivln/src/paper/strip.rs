//! A run as a strip: what the robot saw, and what it knew, at four moments.

use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use arena::map_picture::{MapDrawing, escape, map_svg, png_img};
use arena::mission::mission::{Mission, Outcome};
use arena::mission::omni_perception::MaskedPanorama;
use arena::mission::robot_model::RobotKind;
use arena::mission::stream::SensorEvent;
use arena::orders::Orders;
use arena::referee::Referee;
use arena::run::{RunConfig, Setup, Watched, run_watched};
use arena::scenario::{Scene, draw_start, robot_truth};
use arena::task::Task;
use nalgebra::Point2;

use super::layout::{Section, paragraph};

/// One moment, drawn.
struct Still {
    t_s: f64,
    activity: String,
    picture: String,
    map: String,
}

/// The middle of the panorama, where the robot looks ahead.
fn ahead(picture: &MaskedPanorama) -> String {
    let whole = picture
        .image
        .as_ref()
        .and_then(|image| image::RgbImage::from_raw(image.width, image.height, image.rgb.clone()));
    let Some(whole) = whole else { return "<p>The camera gave no picture.</p>".into() };
    let (width, height) = whole.dimensions();
    let cut = image::imageops::crop_imm(&whole, width / 3, height / 4, width / 3, height / 2).to_image();
    png_img(&cut, "width:100%")
}

fn still(t_s: f64, mission: &Mission, picture: &MaskedPanorama, path: &[Point2<f64>]) -> Still {
    let world = &mission.world;
    let drawing = MapDrawing {
        rooms: world.rooms.as_ref(),
        path,
        nouns: &mission.phrases(),
        end: path.last().copied(),
        target: match &mission.outcome {
            Some(Outcome::Stopped { at, .. }) => Some(at.xy()),
            _ => None,
        },
        ..MapDrawing::default()
    };
    Still { t_s, activity: mission.activity(), picture: ahead(picture), map: map_svg(&world.graph, &drawing) }
}

/// "go to the nearest chair", as in the paper.
pub fn section(paper: &super::Paper) -> Result<Section> {
    const SCENE: &str = "flat";
    const TEXT: &str = "go to the nearest chair";
    const SEED: u64 = 1;
    /// A picture is drawn so often, seconds; four of them are shown.
    const EVERY_S: f64 = 1.0;
    eprintln!("   a run in scene {SCENE}, for pictures");
    let robot = arena::cli::load_robot(None, RobotKind::Ground)?;
    let scene = Scene::open(SCENE, &robot)?;
    let config = RunConfig::default();
    // The referee does not judge "nearest": any chair is right.
    let task = Task { text: TEXT.to_owned(), ..Task::read("find the chair", &scene.building)? };
    let referee = Referee::new(&scene.building, &scene.world, robot_truth(&robot, config.mission.flight_height_m), 0);
    let start = draw_start(&referee, &robot, SEED)?;
    let setup = Setup {
        config: &config,
        robot: &robot,
        scene: &scene,
        task: &task,
        start: &start,
        known: None,
        seed: SEED,
        vehicle: None,
        orders: Orders::default(),
    };
    let (mut stills, mut path, mut picture, mut next_s) = (Vec::new(), Vec::new(), None, 0.0);
    let result = run_watched(setup, &Arc::new(AtomicBool::new(false)), &mut |_| {}, &mut |watched| match watched {
        Watched::Event(SensorEvent::Panorama(seen)) => picture = Some(seen.clone()),
        Watched::Event(_) => {}
        Watched::Cycle(now_s, mission) => {
            if let Some(odometry) = &mission.world.odometry {
                path.push(Point2::from(odometry.world_from_body.translation.vector.xy()));
            }
            if let Some(picture) = picture.as_ref().filter(|_| now_s >= next_s) {
                next_s = now_s + EVERY_S;
                stills.push(still(now_s, mission, picture, &path));
            }
        }
    })?;
    if let Some(picture) = &picture {
        stills.push(still(result.summary.sim_s, &result.mission, picture, &path));
    }
    let last = stills.len().saturating_sub(1);
    let chosen = [last.min(3), last / 3, 2 * last / 3, last];
    let mut body = paragraph(&format!(
        "\"{TEXT}\" in scene {SCENE}, seed {SEED}: above what the camera sees ahead, below what the robot knows. The referee, to whom any chair is right: {}",
        result.summary.reason
    ));
    body.push_str("<div style=\"display:grid;grid-template-columns:repeat(4,1fr);gap:.6rem\">");
    for still in chosen.iter().filter_map(|index| stills.get(*index)) {
        let _ = write!(
            body,
            "<figure>{}{}<figcaption>{:.0} s: {}</figcaption></figure>",
            still.picture,
            still.map,
            still.t_s,
            escape(&still.activity)
        );
    }
    body.push_str("</div>");
    body.push_str(&paper.own_command("strip"));
    Ok(Section { id: "strip", title: "A run", body, claims: Vec::new() })
}
