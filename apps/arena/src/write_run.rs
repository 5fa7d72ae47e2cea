//! Fills the run folder: everything that a person, a program or another run needs.

use anyhow::Result;
use mission::mission::Outcome;
use mission::omni_perception::Stamp;
use mission::tum::tum_line;
use nalgebra::{Isometry3, Point2};
use serde_json::json;

use crate::map_picture::{MapDrawing, in_map, navigation_img};
use crate::orders::script_of;
use crate::report::report_html;
use crate::run::{Frame, RunResult};
use crate::run_folder::RunFolder;
use crate::scenario::Scene;

/// Writes all files of a run.
pub fn write_run(folder: &RunFolder, result: &RunResult, scene: &Scene) -> Result<()> {
    let world = &result.mission.world;
    let journal = result.journal();

    // What the robot knows, for the next run and for other programs.
    mission::archive::save(world, folder.path())?;
    folder.write("scene_graph.txt", mission::dsg::scene_graph_text(&world.graph).as_bytes())?;
    folder.write("scene_objects.json", mission::dsg::scene_objects_json(&world.graph).as_bytes())?;

    // What it thought.
    let mut lines = Vec::new();
    for decision in &journal.decisions {
        serde_json::to_writer(&mut lines, decision)?;
        lines.push(b'\n');
    }
    folder.write("decisions.jsonl", &lines)?;

    // What people said, as a script that says it again.
    if !journal.controls.is_empty() {
        folder.write("commands.txt", script_of(journal).as_bytes())?;
    }

    // What truly was.
    write_truth(folder, result, scene)?;

    // For people.
    let poses: Vec<Isometry3<f64>> = result.truth.poses.iter().map(|(_, pose)| *pose).collect();
    let path: Vec<Point2<f64>> = journal.curves.iter().map(|c| Point2::new(c.pose[0], c.pose[1])).collect();
    let true_path = in_map(&result.truth.truth_from_map.inverse(), &poses);
    let drawing = MapDrawing {
        rooms: world.rooms.as_ref(),
        path: &path,
        true_path: &true_path,
        nouns: &result.mission.phrases(),
        end: path.last().copied(),
        target: match &result.mission.outcome {
            Some(Outcome::Stopped { at, .. }) => Some(at.xy()),
            _ => None,
        },
        zones: Some(&world.zones),
    };
    let here = path.last().copied().unwrap_or_else(Point2::origin);
    let navigation = navigation_img(&world.navigation, &here);
    folder
        .write("report.html", report_html(&result.summary, &world.graph, &drawing, &navigation, journal).as_bytes())?;
    #[cfg(feature = "viz")]
    crate::viz::write_recording(&folder.path().join("recording.rrd"), result, scene)?;

    // Last: the mark of a complete run.
    folder.write("summary.json", &serde_json::to_vec_pretty(&result.summary)?)
}

/// `truth/`: with these files anybody can judge the run again.
fn write_truth(folder: &RunFolder, result: &RunResult, scene: &Scene) -> Result<()> {
    let mut trajectory = String::from("# t_s x y z qx qy qz qw, true pose of the body in the building\n");
    for (stamp_ns, pose) in &result.truth.poses {
        trajectory.push_str(&tum_line(Stamp(*stamp_ns), pose));
    }
    folder.write("truth/trajectory.tum", trajectory.as_bytes())?;
    let objects: Vec<_> = scene
        .building
        .objects
        .iter()
        .map(|object| {
            json!({
                "id": object.id, "class": object.class, "color": object.color, "material": object.material,
                "function": object.function, "caption": object.caption, "room": object.room,
                "supported_by": object.supported_by,
                "min_m": [object.bounds.min.x, object.bounds.min.y, object.bounds.min.z],
                "max_m": [object.bounds.max.x, object.bounds.max.y, object.bounds.max.z],
            })
        })
        .collect();
    folder.write("truth/objects.json", &serde_json::to_vec_pretty(&objects)?)?;
    let rooms: Vec<_> = scene
        .building
        .rooms
        .iter()
        .map(|room| {
            let rects: Vec<_> = room.rects.iter().map(|r| json!([r.min.x, r.min.y, r.max.x, r.max.y])).collect();
            json!({
                "id": room.id, "name": room.name, "kind": room.kind.name(), "rects_m": rects,
                "floor_z_m": room.floor_z_m, "storey": room.storey,
            })
        })
        .collect();
    folder.write("truth/rooms.json", &serde_json::to_vec_pretty(&rooms)?)?;
    folder.write("truth/contacts.json", &serde_json::to_vec_pretty(&result.truth.touches)?)?;
    let steps: Vec<_> = result
        .truth
        .steps
        .iter()
        .map(|(step, stamp_ns, done)| json!({"step": step, "declared_s": *stamp_ns as f64 * 1e-9, "right": done}))
        .collect();
    folder.write("truth/task.json", &serde_json::to_vec_pretty(&json!({"task": result.task, "declared": steps}))?)?;
    let truth_from_map = &result.truth.truth_from_map;
    let frame = Frame {
        position_m: truth_from_map.translation.vector.into(),
        yaw_rad: truth_from_map.rotation.euler_angles().2,
        floor_m: scene.building.rooms.first().map_or(0.0, |room| room.floor_z_m),
    };
    folder.write("truth/frame.json", &serde_json::to_vec_pretty(&frame)?)
}
