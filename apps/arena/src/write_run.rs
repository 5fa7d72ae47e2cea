//! Fills the run folder: everything that a person, a program or another run needs.

use anyhow::Result;
use mission::mission::Outcome;
use nalgebra::{Isometry3, Point2};

use crate::map_picture::{MapDrawing, in_map, navigation_img};
use crate::orders::script_of;
use crate::report::report_html;
use crate::run::RunResult;
use crate::run_folder::RunFolder;
use crate::scenario::Scene;
use crate::truth_folder::write_truth;

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
    write_truth(folder, result, &scene.building)?;

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
