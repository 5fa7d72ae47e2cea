//! `omnivln ask DIR "INSTRUCTION" --plan`: the way of a robot to what is asked for, from saved files alone.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use arena::cli::{load_robot, word};
use arena::frame::pose_in_map;
use arena::map_picture::{MapDrawing, escape, map_svg, navigation_img};
use arena::mission::archive;
use arena::mission::config::MissionConfig;
use arena::mission::mission::Mission;
use arena::mission::navigation::Room;
use arena::mission::octant_prompt::Target;
use arena::mission::robot_model::{RobotKind, RobotModel};
use arena::mission::route_plan::{PlannedLeg, RoutePlan, plan_routes};
use nalgebra::Point2;
use serde_json::{Value, json};

use crate::ask::{AskOptions, default_pose};

/// Loads, plans, prints: 0 where there is a way for every step, 1 where there is none.
pub fn run(options: &AskOptions) -> Result<ExitCode> {
    let folder = &options.scene;
    ensure!(
        folder.is_dir(),
        "--plan needs the folder of a run, with graph.json, map.bin and map.json; {} is no folder",
        folder.display()
    );
    ensure!(options.labels.is_none(), "--labels is for files of spark_dsg; --plan reads the folder of a run");
    let robot = robot_of(options)?;
    let mut known = archive::load(folder)?;
    let pose = options.pose.as_ref().map_or_else(|| default_pose(&known.graph), |pose| Ok(pose_in_map(pose)))?;
    known.start = Some(pose);
    let start = Point2::from(pose.translation.vector.xy());
    let config = MissionConfig::default();
    let (plan, mission) = plan_routes(&robot, known, &options.instruction, &config)
        .with_context(|| format!("planning in {}", folder.display()))?;
    if let Some(path) = &options.html {
        write_page(path, options, &robot, &plan, &mission, &start)?;
    }
    if options.json {
        arena::say!("{}", as_json(options, &robot, &plan));
    } else {
        print(&robot, &plan, &mission);
    }
    Ok(ExitCode::from(u8::from(plan.why_not.is_some())))
}

/// The robot of `--urdf`, whatever moves it, or a built-in one.
fn robot_of(options: &AskOptions) -> Result<RobotModel> {
    let urdf = options.urdf.as_deref();
    match options.robot {
        Some(robot) => load_robot(urdf, robot.into()),
        None => {
            load_robot(urdf, RobotKind::Ground).or_else(|error| load_robot(urdf, RobotKind::Aerial).map_err(|_| error))
        }
    }
}

fn as_json(options: &AskOptions, robot: &RobotModel, plan: &RoutePlan) -> Value {
    let room = Room::of(robot);
    let legs: Vec<Value> = plan.legs.iter().map(leg_json).collect();
    let total_s: Option<f64> = plan.legs.iter().map(|leg| leg.seconds).sum();
    json!({
        "instruction": options.instruction,
        "robot": {
            "name": robot.name, "kind": word(robot.kind), "turning_m": room.turning_m, "passing_m": room.passing_m,
        },
        "found": plan.why_not.is_none(),
        "legs": legs,
        "length_m": plan.legs.iter().map(|leg| leg.length_m).sum::<f64>(),
        "seconds": total_s,
        "why_not": plan.why_not.as_ref().map(|no_route| json!({
            "step": no_route.step, "sentence": no_route.sentence,
            "nearest": no_route.nearest.map(|(at, off_m)| json!({"position": [at.x, at.y], "off_m": off_m})),
        })),
    })
}

fn leg_json(leg: &PlannedLeg) -> Value {
    json!({
        "step": leg.step,
        "target": {"id": id_of(leg), "label": leg.label},
        "stand": {
            "position": [leg.stand.x, leg.stand.y], "heading_rad": leg.heading_rad,
            "distance_m": leg.distance_m, "in_sight": leg.is_visible,
        },
        "route": leg.route.iter().map(|p| [p.x, p.y, p.z]).collect::<Vec<_>>(),
        "length_m": leg.length_m,
        "min_clearance_m": leg.min_clearance_m,
        "seconds": leg.seconds,
        "proved": leg.is_proved,
    })
}

fn id_of(leg: &PlannedLeg) -> Option<String> {
    leg.target.map(|target| match target {
        Target::Object(id) => id.to_string(),
        Target::Room(id) => id.to_string(),
    })
}

fn print(robot: &RobotModel, plan: &RoutePlan, mission: &Mission) {
    let room = Room::of(robot);
    let passing = room.passing_m.map_or(String::new(), |m| format!(", {:.2} m to pass straight", 2.0 * m));
    arena::say!("Robot: {} ({}), {:.2} m to turn{passing}", robot.name, word(robot.kind), 2.0 * room.turning_m);
    for leg in &plan.legs {
        let id = id_of(leg).map_or(String::new(), |id| format!(" {id}"));
        arena::say!("\nStep {}: {}{id}", leg.step + 1, leg.label);
        let seconds = leg.seconds.map_or("time not known".to_owned(), |s| format!("about {s:.0} s"));
        let proved = match (robot.kind, leg.is_proved) {
            (RobotKind::Ground, _) => "",
            (RobotKind::Aerial, true) => ", every instant proved",
            (RobotKind::Aerial, false) => ", not proved: the way at flight height",
        };
        arena::say!(
            "  way     {:.1} m, {seconds}, clearance at least {:.2} m{proved}",
            leg.length_m,
            leg.min_clearance_m
        );
        let heading = leg.heading_rad.map_or(String::new(), |yaw| format!(", facing {:.0} degrees", yaw.to_degrees()));
        arena::say!("  stands  at {:.2}, {:.2}{heading}", leg.stand.x, leg.stand.y);
        if matches!(leg.target, Some(Target::Object(_))) {
            let sight = if leg.is_visible { "in sight" } else { "hidden by what stands there" };
            arena::say!("          {:.2} m from it, {sight}", leg.distance_m);
        }
        let corners: Vec<String> = corners(leg).map(|p| format!("{:.1},{:.1}", p.x, p.y)).collect();
        arena::say!("  by      {}", corners.join("  "));
    }
    if let Some(no_route) = &plan.why_not {
        arena::say!("\nStep {}: no way. {}", no_route.step + 1, no_route.sentence);
    } else if plan.legs.len() < mission.instruction.steps.len() {
        arena::say!("\nNot all steps were planned.");
    }
}

/// The corners of a way on the ground; about every metre of a flight.
fn corners(leg: &PlannedLeg) -> impl Iterator<Item = Point2<f64>> {
    const MOST: usize = 24;
    let every = leg.route.len().div_ceil(MOST).max(1);
    let last = leg.route.len().saturating_sub(1);
    leg.route.iter().enumerate().filter(move |(k, _)| k % every == 0 || *k == last).map(|(_, p)| p.xy())
}

/// One self-contained page: the ways on the map, and where this robot can go.
fn write_page(
    path: &Path,
    options: &AskOptions,
    robot: &RobotModel,
    plan: &RoutePlan,
    mission: &Mission,
    start: &Point2<f64>,
) -> Result<()> {
    let way: Vec<Point2<f64>> = plan.legs.iter().flat_map(|leg| leg.route.iter().map(|p| p.xy())).collect();
    let goal = plan.legs.last().and_then(|leg| match leg.target? {
        Target::Object(id) => mission.world.graph.object(id).map(|object| object.centroid.xy()),
        Target::Room(id) => mission.world.graph.room(id).map(|room| room.center.xy()),
    });
    let nearest = plan.why_not.as_ref().and_then(|no_route| no_route.nearest).map(|(at, _)| at);
    let drawing = MapDrawing {
        rooms: mission.world.rooms.as_ref(),
        path: if way.is_empty() { std::slice::from_ref(start) } else { &way },
        nouns: &mission.phrases(),
        end: nearest.or_else(|| plan.legs.last().map(|leg| leg.stand)),
        target: goal,
        ..MapDrawing::default()
    };
    let mut rows = String::new();
    for leg in &plan.legs {
        let seconds = leg.seconds.map_or("-".to_owned(), |s| format!("{s:.0} s"));
        rows.push_str(&format!(
            "<tr><td>{}</td><td>{}</td><td>{:.1} m</td><td>{seconds}</td><td>{:.2} m</td></tr>\n",
            leg.step + 1,
            escape(&leg.label),
            leg.length_m,
            leg.min_clearance_m
        ));
    }
    let why_not =
        plan.why_not.as_ref().map_or(String::new(), |no_route| format!("<p>{}</p>", escape(&no_route.sentence)));
    let page = format!(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title>\n\
         <style>body{{font-family:sans-serif;max-width:70em;margin:1em auto}}td,th{{padding:0.1em 0.8em;text-align:left}}</style>\n\
         <h1>{0}</h1><p>The way of {1}, planned from the files in {2}.</p>{why_not}\n\
         <table><tr><th>step</th><th>to</th><th>way</th><th>takes</th><th>clearance</th></tr>\n{rows}</table>\n{3}\n\
         <h2>Where this robot can go</h2>\n{4}\n</html>\n",
        escape(&options.instruction),
        escape(&robot.name),
        escape(&options.scene.display().to_string()),
        map_svg(&mission.world.graph, &drawing),
        navigation_img(&mission.world.navigation, start),
    );
    std::fs::write(path, page).with_context(|| format!("writing {}", path.display()))
}
