//! `truth/` of a run folder: with these files alone anybody can judge the run again ([`crate::verdict`]).
//!
//! ```text
//! building.ply     every triangle, with its colour and the number of its thing (0: walls, floor, ceiling, frames)
//! objects.json     things: number, class, colour, box, room, what they stand on
//! rooms.json       rooms: name, kind, rectangles, floor, height
//! doors.json       openings: rooms, middle, width, height, direction
//! robot.json       what the referee knows of the robot: circle, heights, outline
//! task.json        what was asked, when it was heard, which steps the robot declared done and where it truly was, how it ended
//! trajectory.tum   true poses of the body, fifty a second (t x y z qx qy qz qw)
//! contacts.json    every touch
//! zones.json       zones in the frame of the building, if there were any
//! frame.json       where the robot's map lies in the building
//! ```

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use mission::omni_perception::Stamp;
use mission::tum::{read_tum, tum_line};
use mission::zones::Zones;
use nalgebra::{Isometry3, Point2, Point3, Quaternion, Translation3, UnitQuaternion};
use omni_sim::building::{Bounds, Building, DoorAxis, DoorTruth, ObjectTruth, Rect, RoomKind, RoomTruth};
use omni_sim::mesh::TriangleMesh;
use omni_sim::world::World;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::building_ply::{ply_of, read_ply};
use crate::frame::Frame;
use crate::record_truth::write_building;
use crate::referee::{Referee, RobotTruth};
use crate::run::RunResult;
use crate::run_folder::RunFolder;
use crate::simulation::Touch;
use crate::task::Task;
use crate::verdict::{Declared, Ending, Errand, TruthLog, Verdict, verdict};

/// Files of text in `truth/` are never larger.
const LARGEST_BYTES: u64 = 1 << 30;

/// `truth/task.json`.
#[derive(Debug, Serialize, Deserialize)]
struct TaskFile {
    task: Task,
    heard_ns: i64,
    declared: Vec<DeclaredEntry>,
    ending: Ending,
    trouble: Option<String>,
    errands: Vec<Errand>,
    /// How often the robot asked which of several things is meant.
    #[serde(default)]
    questions: usize,
    end_s: f64,
}

#[derive(Debug, Serialize, Deserialize)]
struct DeclaredEntry {
    step: usize,
    stamp_ns: i64,
    /// x, y, z, qx, qy, qz, qw.
    pose: [f64; 7],
}

/// `truth/robot.json`.
#[derive(Debug, Serialize, Deserialize)]
struct RobotFile {
    #[serde(flatten)]
    body: RobotTruth,
    footprint_m: Vec<[f64; 2]>,
}

/// Writes all of it.
pub fn write_truth(folder: &RunFolder, result: &RunResult, building: &Building) -> Result<()> {
    let truth = &result.truth;
    let mut trajectory = String::from("# t_s x y z qx qy qz qw, true pose of the body in the building\n");
    for (stamp_ns, pose) in &truth.poses {
        trajectory.push_str(&tum_line(Stamp(*stamp_ns), pose));
    }
    folder.write("truth/trajectory.tum", trajectory.as_bytes())?;
    folder.write("truth/building.ply", &ply_of(&building.mesh))?;
    write_building(folder, building)?;
    let json = |name: &str, value: Vec<u8>| folder.write(&format!("truth/{name}"), &value);
    let robot = RobotFile {
        body: result.body.clone(),
        footprint_m: result.mission.robot().footprint.iter().map(|corner| [corner.x, corner.y]).collect(),
    };
    json("robot.json", serde_json::to_vec_pretty(&robot)?)?;
    json("contacts.json", serde_json::to_vec_pretty(&truth.touches)?)?;
    let declared = truth.declared.iter().map(|declared| {
        let (t, q) = (declared.truth_from_body.translation.vector, declared.truth_from_body.rotation.coords);
        DeclaredEntry { step: declared.step, stamp_ns: declared.stamp_ns, pose: [t.x, t.y, t.z, q.x, q.y, q.z, q.w] }
    });
    let task = TaskFile {
        task: result.task.clone(),
        heard_ns: truth.heard_ns,
        declared: declared.collect(),
        ending: truth.ending.clone(),
        trouble: truth.trouble.clone(),
        errands: truth.errands.clone(),
        questions: truth.questions,
        end_s: result.summary.sim_s,
    };
    json("task.json", serde_json::to_vec_pretty(&task)?)?;
    if !truth.zones.is_empty() {
        json("zones.json", truth.zones.to_json().into_bytes())?;
    }
    let truth_from_map = &truth.truth_from_map;
    let frame = Frame {
        position_m: truth_from_map.translation.vector.into(),
        yaw_rad: truth_from_map.rotation.euler_angles().2,
        floor_m: building.rooms.first().map_or(0.0, |room| room.floor_z_m),
    };
    json("frame.json", serde_json::to_vec_pretty(&frame)?)
}

/// What the referee says of a run folder, from its `truth/` alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// What was asked.
    pub task: Task,
    /// The verdict.
    pub verdict: Verdict,
    /// How long it took, as `truth/` says.
    pub sim_s: f64,
}

/// Judges the run in `run` again.
///
/// # Errors
/// A file that is missing or cannot be read, by name.
pub fn judge(run: &Path) -> Result<Judgement> {
    let folder = run.join("truth");
    ensure!(folder.is_dir(), "{} has no truth/; what can be judged is the folder of a run", run.display());
    let building = read_building(&folder)?;
    let robot: RobotFile = read_json(&folder.join("robot.json"))?;
    let task: TaskFile = read_json(&folder.join("task.json"))?;
    let touches: Vec<Touch> = read_json(&folder.join("contacts.json"))?;
    let poses = read_tum(&folder.join("trajectory.tum"))?;
    let zones = match folder.join("zones.json") {
        path if path.exists() => {
            let text = read_text(&path)?;
            Zones::parse(&text).with_context(|| format!("reading {}", path.display()))?
        }
        _ => Zones::default(),
    };
    let declared = task.declared.iter().map(|entry| {
        let [x, y, z, qx, qy, qz, qw] = entry.pose;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
        let truth_from_body = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        Declared { step: entry.step, stamp_ns: entry.stamp_ns, truth_from_body }
    });
    let truth = TruthLog {
        poses: poses.into_iter().map(|(stamp, pose)| (stamp.0, pose)).collect(),
        heard_ns: task.heard_ns,
        touches,
        truth_from_map: Isometry3::identity(),
        zones,
        declared: declared.collect(),
        ending: task.ending,
        trouble: task.trouble,
        errands: task.errands,
        first_sighting_s: None,
        questions: task.questions,
    };
    let Some((_, start)) = truth.poses.first() else { bail!("{} holds no pose", folder.display()) };
    let world = World::of_building(&building).context("making the world of truth/building.ply")?;
    let start = Point2::from(start.translation.vector.xy());
    let footprint: Vec<Point2<f64>> = robot.footprint_m.iter().map(|corner| Point2::from(*corner)).collect();
    let referee = Referee::new(&building, &world, robot.body, 0).of_run_from(start);
    let verdict = verdict(&truth, &task.task, &referee, &footprint);
    Ok(Judgement { task: task.task, verdict, sim_s: task.end_s })
}

#[derive(Deserialize)]
struct RoomEntry {
    id: u32,
    name: String,
    kind: String,
    rects_m: Vec<[f64; 4]>,
    floor_z_m: f64,
    height_m: f64,
    storey: u32,
}

#[derive(Deserialize)]
struct DoorEntry {
    rooms: [u32; 2],
    center_m: [f64; 3],
    width_m: f64,
    height_m: f64,
    axis: String,
}

#[derive(Deserialize)]
struct ObjectEntry {
    id: u32,
    class: String,
    color: String,
    material: String,
    function: String,
    caption: String,
    room: u32,
    supported_by: Option<u32>,
    min_m: [f64; 3],
    max_m: [f64; 3],
}

/// The building of a `truth/` folder, as far as a referee needs it: without the colours by number and the fronts of things.
///
/// # Errors
/// A file that is missing or cannot be read, or numbers that do not belong together.
pub fn read_building(folder: &Path) -> Result<Building> {
    let rooms: Vec<RoomEntry> = read_json(&folder.join("rooms.json"))?;
    let rooms = rooms.into_iter().enumerate().map(|(index, room)| {
        ensure!(room.id as usize == index && !room.rects_m.is_empty(), "rooms.json: room {index} is not in its place");
        Ok(RoomTruth {
            id: room.id,
            kind: RoomKind::from_name(&room.kind)
                .with_context(|| format!("rooms.json: \"{}\" is no kind of room", room.kind))?,
            name: room.name,
            rects: room.rects_m.iter().map(|r| Rect::new(r[0], r[1], r[2], r[3])).collect(),
            floor_z_m: room.floor_z_m,
            height_m: room.height_m,
            storey: room.storey,
        })
    });
    let rooms = rooms.collect::<Result<Vec<_>>>()?;
    let doors: Vec<DoorEntry> = read_json(&folder.join("doors.json"))?;
    let doors = doors.into_iter().map(|door| {
        Ok(DoorTruth {
            rooms: (door.rooms[0], door.rooms[1]),
            center: Point3::from(door.center_m),
            width_m: door.width_m,
            height_m: door.height_m,
            axis: match door.axis.as_str() {
                "x" => DoorAxis::X,
                "y" => DoorAxis::Y,
                "z" => DoorAxis::Z,
                other => bail!("doors.json: \"{other}\" is no direction; x, y or z"),
            },
        })
    });
    let objects: Vec<ObjectEntry> = read_json(&folder.join("objects.json"))?;
    let objects = objects.into_iter().map(|object| ObjectTruth {
        id: object.id,
        class: object.class,
        color: object.color,
        rgb: [0; 3],
        material: object.material,
        function: object.function,
        caption: object.caption,
        bounds: Bounds { min: Point3::from(object.min_m), max: Point3::from(object.max_m) },
        yaw_rad: 0.0,
        room: object.room,
        supported_by: object.supported_by,
        placed_with: None,
    });
    let objects: Vec<ObjectTruth> = objects.collect();
    ensure!(objects.is_sorted_by_key(|object| object.id), "objects.json: the ids do not ascend");
    let path = folder.join("building.ply");
    let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
    let mesh: TriangleMesh = read_ply(&bytes).with_context(|| format!("reading {}", path.display()))?;
    Ok(Building { rooms, doors: doors.collect::<Result<Vec<_>>>()?, objects, mesh, movers: Vec::new() })
}

fn read_text(path: &Path) -> Result<String> {
    let size = std::fs::metadata(path).with_context(|| format!("reading {}", path.display()))?.len();
    ensure!(size <= LARGEST_BYTES, "{} has {size} bytes; at most {LARGEST_BYTES} are read", path.display());
    std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_str(&read_text(path)?).with_context(|| format!("reading {}", path.display()))
}
