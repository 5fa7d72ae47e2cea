//! The run as a 3D recording (`recording.rrd`) for the Rerun viewer, version 0.36: `rerun recording.rrd`.
//!
//! Everything lies below `map`, the frame of the robot's own odometry. What was known at the end (surface, objects,
//! places, rooms) is static; the robot, its way, its curves and its thoughts move along the time line `sim_time`.
//! The truth hangs below `map/truth`, which stands where the building truly is in that map, so drift can be seen.
//! Written from start to end in one go into a file; nothing is sent to anybody.

use std::path::Path;

use anyhow::{Context, Result};
use mission::dsg::Object;
use mission::journal::{CurveSample, Journal};
use mission::mission::Outcome;
use mission::robot_model::{CollisionShape, JointKind, RobotModel};
use mission::volumetric_map::Mesh;
use mission::world_model::WorldModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rerun::blueprint::{
    Blueprint, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial3DView, TextLogView, TimePanel,
    TimeSeriesView, Vertical,
};
use rerun::external::re_sdk_types::blueprint::components::{PanelState, PlayState};
use rerun::{
    Boxes3D, Color, FillMode, LineStrip3D, LineStrips3D, Mesh3D, Points3D, Quaternion, RecordingStream,
    RecordingStreamBuilder, Rgba32, Scalars, SerializedComponentColumn, SeriesLines, TextLog, TextLogLevel, TimeColumn,
    Transform3D, ViewCoordinates, entity_path,
};

use crate::name_color::name_color;
use crate::run::{Posture, RunResult};
use crate::scenario::Scene;

/// The time line: seconds since the mission began.
const TIME_LINE: &str = "sim_time";
/// Surfaces higher than this above the floor are kept apart, and hidden at first: ceiling and walls hide everything else.
const CUT_M: f64 = 1.3;
/// At most so many steps in which the way grows; a step holds the whole way so far.
const GROWTH_STEPS: usize = 300;
/// Points of the growing way are at least this far apart.
const WAY_STEP_M: f64 = 0.08;

const START: Color = Color(Rgba32(0x1A7F_37FF));
const WAY: Color = Color(Rgba32(0x3C82_EBFF));
const TARGET: Color = Color(Rgba32(0xDC1E_1EFF));
const FRONTIER: Color = Color(Rgba32(0xE07B_00FF));
const NAME: Color = Color(Rgba32(0xE6E6_E6FF));
const GREY: Color = Color(Rgba32(0x9696_96FF));

/// Writes the recording of a run to `path`.
///
/// # Errors
/// What the disk says, and values that the recording's format refuses.
pub fn write_recording(path: &Path, result: &RunResult, scene: &Scene) -> Result<()> {
    let summary = &result.summary;
    let recording = RecordingStreamBuilder::new("omnivln")
        .recording_name(format!("{} in {}: {}", summary.model, scene.name, summary.instruction))
        .enabled(true) // built with this feature the file is wanted, whatever the environment's RERUN says
        .with_blueprint(blueprint())
        .save(path)
        .with_context(|| format!("creating {}", path.display()))?;
    let world = &result.mission.world;
    let journal = result.journal();

    recording.log_static("map", &ViewCoordinates::RIGHT_HAND_Z_UP())?;
    log_mesh(&recording, world)?;
    log_objects(&recording, world, &result.mission.phrases())?;
    log_places(&recording, world)?;
    log_rooms(&recording, world)?;
    log_truth(&recording, result, scene)?;
    log_marks(&recording, result)?;
    log_body(&recording, result.mission.robot(), &result.postures)?;
    log_way(&recording, &journal.curves)?;
    log_curves(&recording, &journal.curves)?;
    log_thoughts(&recording, result)?;
    recording.flush_blocking().with_context(|| format!("writing {}", path.display()))
}

/// How the viewer opens: the map beside the curves and the robot's thoughts, at the first moment.
fn blueprint() -> Blueprint {
    let map = Spatial3DView::new("Map").with_origin("map").with_contents([
        "+ $origin/**",
        "- $origin/mesh/above/**",
        "- $origin/objects/unconfirmed/**",
        "- $origin/truth/objects/**",
    ]);
    let curve =
        |name: &str, path: &str| -> ContainerLike { TimeSeriesView::new(name).with_origin(path.to_owned()).into() };
    let beside = Vertical::new([
        curve("Speed (m/s)", "curves/speed"),
        curve("Distance to the nearest obstacle (m)", "curves/clearance"),
        curve("Tokens sent", "curves/tokens"),
        TextLogView::new("Decisions").with_origin("log").into(),
    ])
    .with_row_shares([1.0, 1.0, 1.0, 2.0]);
    Blueprint::new(Horizontal::new([map.into(), beside.into()]).with_column_shares([3.0, 2.0]))
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(
            TimePanel::new()
                .with_state(PanelState::Collapsed)
                .with_timeline(TIME_LINE)
                .with_play_state(PlayState::Paused),
        )
}

/// The surface in two parts, below and above [`CUT_M`].
fn log_mesh(recording: &RecordingStream, world: &WorldModel) -> Result<()> {
    let mesh = world.volume.mesh();
    let names = world.label_names();
    let colors: Vec<Color> = mesh
        .labels
        .iter()
        .map(|id| names.get(id).map_or(Color::from_rgb(196, 196, 190), |name| color_of(name)))
        .collect();
    let normals = vertex_normals(&mesh);
    let cut_m = (world.floor_m + CUT_M) as f32;
    let (above, below): (Vec<[u32; 3]>, Vec<[u32; 3]>) =
        mesh.faces.iter().partition(|face| face.iter().any(|v| mesh.vertices[*v as usize].z > cut_m));
    for (path, faces) in [("map/mesh/below", below), ("map/mesh/above", above)] {
        let (vertices, faces) = only_used(&faces, mesh.vertices.len());
        if faces.is_empty() {
            continue;
        }
        let part = Mesh3D::new(vertices.iter().map(|v| <[f32; 3]>::from(mesh.vertices[*v])))
            .with_vertex_normals(vertices.iter().map(|v| <[f32; 3]>::from(normals[*v])))
            .with_vertex_colors(vertices.iter().map(|v| colors[*v]))
            .with_triangle_indices(faces);
        recording.log_static(path, &part)?;
    }
    Ok(())
}

/// Area-weighted means of the normals of the faces around each vertex: without normals the viewer draws no shading.
fn vertex_normals(mesh: &Mesh) -> Vec<Vector3<f32>> {
    let mut normals = vec![Vector3::zeros(); mesh.vertices.len()];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
        let area = (b - a).cross(&(c - a)); // twice the area, along the face's normal
        for v in face {
            normals[*v as usize] += area;
        }
    }
    normals.iter().map(|n| n.try_normalize(0.0).unwrap_or_else(Vector3::z)).collect()
}

/// The vertices that `faces` use, and the faces in terms of these.
fn only_used(faces: &[[u32; 3]], vertices: usize) -> (Vec<usize>, Vec<[u32; 3]>) {
    let mut new_index = vec![u32::MAX; vertices];
    let mut used = Vec::new();
    let faces = faces
        .iter()
        .map(|face| {
            face.map(|v| {
                let index = &mut new_index[v as usize];
                if *index == u32::MAX {
                    *index = used.len() as u32;
                    used.push(v as usize);
                }
                *index
            })
        })
        .collect();
    (used, faces)
}

fn color_of(name: &str) -> Color {
    let [r, g, b] = name_color(name);
    Color::from_rgb(r, g, b)
}

/// Objects as boxes in their own colours; those that the instruction names have thicker edges and orange names.
fn log_objects(recording: &RecordingStream, world: &WorldModel, nouns: &[String]) -> Result<()> {
    let is_named = |object: &Object| nouns.iter().any(|noun| object.label.contains(noun.as_str()));
    for (path, is_confirmed) in [("map/objects/confirmed", true), ("map/objects/unconfirmed", false)] {
        let objects: Vec<&Object> = world.graph.objects().filter(|object| object.confirmed == is_confirmed).collect();
        if objects.is_empty() {
            continue;
        }
        let boxes = Boxes3D::from_centers_and_half_sizes(
            objects.iter().map(|object| <[f64; 3]>::from(object.bounds.center())),
            objects.iter().map(|object| <[f64; 3]>::from(object.bounds.sides_m() * 0.5)),
        )
        .with_colors(objects.iter().map(|object| {
            let [r, g, b] = object.color.unwrap_or([150, 150, 150]);
            Color::from_rgb(r, g, b)
        }))
        .with_radii(objects.iter().map(|object| if is_named(object) { 0.025_f32 } else { 0.008 }))
        .with_labels(objects.iter().map(|object| format!("{} {}: {}", object.id, object.label, object.caption)))
        .with_show_labels(false);
        recording.log_static(path, &boxes)?;
        // A label has the colour of its box, and a dark one cannot be read: the names stand apart, in light letters.
        let names = Points3D::new(objects.iter().map(|object| <[f64; 3]>::from(object.bounds.center())))
            .with_colors(objects.iter().map(|object| if is_named(object) { FRONTIER } else { NAME }))
            .with_radii([0.01_f32])
            .with_labels(objects.iter().map(|object| object.label.clone()))
            .with_show_labels(true);
        recording.log_static(format!("{path}/names"), &names)?;
    }
    Ok(())
}

/// The skeleton of the free space; frontiers are larger and orange.
fn log_places(recording: &RecordingStream, world: &WorldModel) -> Result<()> {
    let places: Vec<_> = world.graph.places().collect();
    let points = Points3D::new(places.iter().map(|place| <[f64; 3]>::from(place.position)))
        .with_colors(places.iter().map(|place| if place.is_frontier() { FRONTIER } else { GREY }))
        .with_radii(places.iter().map(|place| if place.is_frontier() { 0.08_f32 } else { 0.02 }));
    recording.log_static("map/places/points", &points)?;
    let edges = world.graph.place_edges().filter_map(|edge| {
        let (a, b) = (world.graph.place(edge.a)?, world.graph.place(edge.b)?);
        Some(strip([a.position, b.position]))
    });
    let edges = LineStrips3D::new(edges).with_colors([GREY]).with_radii([0.005_f32]);
    Ok(recording.log_static("map/places/edges", &edges)?)
}

fn log_rooms(recording: &RecordingStream, world: &WorldModel) -> Result<()> {
    let rooms: Vec<_> = world.graph.rooms().collect();
    let points = Points3D::new(rooms.iter().map(|room| <[f64; 3]>::from(room.center)))
        .with_colors(rooms.iter().map(|room| color_of(&room.id.to_string())))
        .with_labels(rooms.iter().map(|room| room.name.clone()))
        .with_show_labels(true)
        .with_radii([0.12_f32]);
    Ok(recording.log_static("map/rooms", &points)?)
}

/// What the robot could not know: its true way, the true objects (hidden at first) and what it touched.
fn log_truth(recording: &RecordingStream, result: &RunResult, scene: &Scene) -> Result<()> {
    // From here on downwards coordinates are those of the building.
    recording.log_static("map/truth", &transform(&result.truth.truth_from_map.inverse()))?;
    let way = result.truth.poses.iter().map(|(_, pose)| Point3::from(pose.translation.vector));
    let way = LineStrips3D::new([strip(way)]).with_colors([GREY]).with_radii([0.015_f32]);
    recording.log_static("map/truth/path", &way)?;
    let objects = &scene.building.objects;
    let boxes = Boxes3D::from_centers_and_half_sizes(
        objects.iter().map(|object| <[f64; 3]>::from(nalgebra::center(&object.bounds.min, &object.bounds.max))),
        objects.iter().map(|object| <[f64; 3]>::from((object.bounds.max - object.bounds.min) * 0.5)),
    )
    .with_colors([GREY])
    .with_labels(objects.iter().map(|object| object.class.clone()));
    recording.log_static("map/truth/objects", &boxes)?;
    let touches = &result.truth.touches;
    let points = Points3D::new(touches.iter().map(|touch| touch.at_m))
        .with_colors([TARGET])
        .with_radii([0.06_f32])
        .with_labels(touches.iter().map(|touch| format!("touched {}", touch.what)));
    Ok(recording.log_static("map/truth/touches", &points)?)
}

/// Start, stop and target.
fn log_marks(recording: &RecordingStream, result: &RunResult) -> Result<()> {
    let curves = &result.journal().curves;
    let at = |sample: &CurveSample| Point3::new(sample.pose[0], sample.pose[1], sample.pose[2]);
    let target = match &result.mission.outcome {
        Some(Outcome::Stopped { at, .. }) => Some(*at),
        _ => None,
    };
    let marks =
        [(curves.first().map(at), "start", START), (curves.last().map(at), "stop", WAY), (target, "target", TARGET)];
    for (position, name, color) in marks {
        let Some(position) = position else { continue };
        let mark = Points3D::new([<[f64; 3]>::from(position)])
            .with_colors([color])
            .with_radii([0.10_f32])
            .with_labels([name])
            .with_show_labels(true);
        recording.log_static(format!("map/marks/{name}"), &mark)?;
    }
    Ok(())
}

/// The robot as the boxes around its collision shapes, where it believed to be; each link that its joints move moves on its own.
fn log_body(recording: &RecordingStream, robot: &RobotModel, postures: &[Posture]) -> Result<()> {
    let joints_move = postures.iter().any(|posture| !posture.joints.is_empty());
    let (moved, fixed): (Vec<CollisionShape>, Vec<CollisionShape>) =
        robot.collision_shapes.iter().cloned().partition(|shape| joints_move && is_moved(robot, &shape.link));
    let solid = |shapes: &[CollisionShape]| boxes_of(shapes).with_colors([WAY]).with_fill_mode(FillMode::Solid);
    recording.log_static("map/robot/body", &solid(&fixed))?;
    if postures.is_empty() {
        return Ok(());
    }
    let stamps = || times(postures.iter().map(|posture| posture.t_s));
    recording.send_columns("map/robot", [stamps()], moves(postures.iter().map(|p| p.map_from_body))?)?;

    let poses: Vec<Vec<Isometry3<f64>>> = postures
        .iter()
        .filter(|posture| !posture.joints.is_empty())
        .map(|posture| robot.tree.body_from_links(&posture.joints))
        .collect::<Result<_, _>>()?;
    for link in robot.tree.links() {
        // Shapes are known in the body, in the stance.
        let link_from_body = robot.frames[&link.name].inverse();
        let own = moved.iter().filter(|shape| shape.link == link.name).cloned();
        let own: Vec<CollisionShape> = own
            .map(|shape| CollisionShape { body_from_shape: link_from_body * shape.body_from_shape, ..shape })
            .collect();
        let (false, Some(index)) = (own.is_empty(), robot.tree.link_named(&link.name)) else { continue };
        let path = entity_path!["map", "robot", "legs", link.name.clone()];
        recording.log_static(path.clone(), &solid(&own))?;
        recording.send_columns(path, [stamps()], moves(poses.iter().map(|links| links[index]))?)?;
    }
    Ok(())
}

/// Whether a moving joint is between the link and the body.
fn is_moved(robot: &RobotModel, link: &str) -> bool {
    let joints = robot.tree.joints();
    let above = |link: usize| robot.tree.joint_above(link);
    let first = robot.tree.link_named(link).and_then(above);
    std::iter::successors(first, |joint| above(joints[*joint].parent))
        .any(|joint| joints[joint].kind != JointKind::Fixed)
}

/// Columns of a transform that changes with time.
fn moves(
    poses: impl Iterator<Item = Isometry3<f64>> + Clone,
) -> Result<impl Iterator<Item = SerializedComponentColumn>> {
    let columns = Transform3D::update_fields()
        .with_many_translation(poses.clone().map(|pose| <[f64; 3]>::from(pose.translation.vector)))
        .with_many_quaternion(poses.map(|pose| quaternion(&pose.rotation)))
        .columns_of_unit_batches()?;
    Ok(columns)
}

/// Smallest boxes around the shapes, each along the axes of its own frame.
fn boxes_of(shapes: &[CollisionShape]) -> Boxes3D {
    let span = |shape: &CollisionShape, sign: f64| -> Vector3<f64> {
        let support = |axis: usize| {
            let mut direction = Vector3::zeros();
            direction[axis] = sign;
            sign * shape.geometry.support(&Isometry3::identity(), &direction)
        };
        Vector3::new(support(0), support(1), support(2))
    };
    let center =
        |shape: &CollisionShape| shape.body_from_shape * Point3::from((span(shape, 1.0) + span(shape, -1.0)) * 0.5);
    Boxes3D::from_centers_and_half_sizes(
        shapes.iter().map(|shape| <[f64; 3]>::from(center(shape))),
        shapes.iter().map(|shape| <[f64; 3]>::from((span(shape, 1.0) - span(shape, -1.0)) * 0.5)),
    )
    .with_quaternions(shapes.iter().map(|shape| quaternion(&shape.body_from_shape.rotation)))
}

/// Where the robot believed to have been, growing with time.
fn log_way(recording: &RecordingStream, curves: &[CurveSample]) -> Result<()> {
    let style = LineStrips3D::update_fields().with_colors([WAY]).with_radii([0.03_f32]);
    recording.log_static("map/path", &style)?;
    if curves.is_empty() {
        return Ok(());
    }
    let stride = curves.len().div_ceil(GROWTH_STEPS);
    let (mut way, mut stamps, mut strips) = (Vec::<Point3<f64>>::new(), Vec::new(), Vec::new());
    for (index, sample) in curves.iter().enumerate() {
        let here = Point3::new(sample.pose[0], sample.pose[1], sample.pose[2]);
        if way.last().is_none_or(|last| (here - last).norm() >= WAY_STEP_M) {
            way.push(here);
        }
        if index % stride == 0 || index + 1 == curves.len() {
            stamps.push(sample.t_s);
            strips.push(strip(way.iter().copied().chain([here])));
        }
    }
    let growth = LineStrips3D::update_fields().with_strips(strips);
    Ok(recording.send_columns("map/path", [times(stamps)], growth.columns_of_unit_batches()?)?)
}

fn log_curves(recording: &RecordingStream, curves: &[CurveSample]) -> Result<()> {
    type Value = fn(&CurveSample) -> f64;
    let all: [(&str, &str, Color, Value); 3] = [
        ("curves/speed", "speed, m/s", WAY, |sample| sample.speed_mps),
        ("curves/clearance", "clearance, m", TARGET, |sample| sample.clearance_m),
        ("curves/tokens", "tokens sent", FRONTIER, |sample| sample.prompt_tokens as f64),
    ];
    for (path, name, color, value) in all {
        recording.log_static(path, &SeriesLines::new().with_colors([color]).with_names([name]))?;
        // A clearance is infinite while nothing is near.
        let samples: Vec<(f64, f64)> =
            curves.iter().map(|sample| (sample.t_s, value(sample))).filter(|(_, value)| value.is_finite()).collect();
        if !samples.is_empty() {
            let values = Scalars::new(samples.iter().map(|(_, value)| *value)).columns_of_unit_batches()?;
            recording.send_columns(path, [times(samples.iter().map(|(t_s, _)| *t_s))], values)?;
        }
    }
    Ok(())
}

/// Decisions with their reasons, notes, touches and the verdict, in the order of time.
fn log_thoughts(recording: &RecordingStream, result: &RunResult) -> Result<()> {
    let mut lines = decision_lines(result.journal());
    lines.extend(result.journal().notes.iter().map(|(t_s, note)| (*t_s, TextLogLevel::WARN, note.clone())));
    let touches = &result.truth.touches;
    lines.extend(touches.iter().map(|touch| (touch.t_s, TextLogLevel::ERROR, format!("touched {}", touch.what))));
    lines.push((result.summary.sim_s, TextLogLevel::INFO, result.summary.reason.clone()));
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    let rows = TextLog::update_fields()
        .with_many_text(lines.iter().map(|(_, _, text)| text.as_str()))
        .with_many_level(lines.iter().map(|(_, level, _)| *level));
    Ok(recording.send_columns("log", [times(lines.iter().map(|(t_s, _, _)| *t_s))], rows.columns_of_unit_batches()?)?)
}

/// One line for each step of the reasoning, then the action, then what the critic had against it.
fn decision_lines(journal: &Journal) -> Vec<(f64, &'static str, String)> {
    let mut lines = Vec::new();
    for decision in &journal.decisions {
        let t_s = decision.decided_s;
        for trace in &decision.trace {
            lines.push((t_s, TextLogLevel::DEBUG, format!("{}: {}", trace.step, trace.output)));
        }
        let (level, who) = if decision.is_fallback {
            (TextLogLevel::WARN, format!("{}, fallback", decision.reasoner))
        } else {
            (TextLogLevel::INFO, decision.reasoner.clone())
        };
        let text = format!(
            "#{} step {}: {} ({who}, confidence {:.2}, {} tokens)",
            decision.index,
            decision.step + 1,
            decision.action,
            decision.confidence,
            decision.prompt_tokens
        );
        lines.push((t_s, level, text));
        let objections = decision.verdicts.iter().filter(|verdict| *verdict != "accepted");
        lines.extend(objections.map(|verdict| (t_s, TextLogLevel::WARN, verdict.clone())));
    }
    lines
}

fn times(seconds: impl IntoIterator<Item = f64>) -> TimeColumn {
    TimeColumn::new_duration_secs(TIME_LINE, seconds)
}

fn strip(points: impl IntoIterator<Item = Point3<f64>>) -> LineStrip3D {
    LineStrip3D::from_iter(points.into_iter().map(<[f64; 3]>::from))
}

fn transform(parent_from_child: &Isometry3<f64>) -> Transform3D {
    let Isometry3 { rotation, translation: Translation3 { vector } } = parent_from_child;
    Transform3D::from_translation_rotation(<[f64; 3]>::from(*vector), quaternion(rotation))
}

fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    Quaternion::from_xyzw(rotation.coords.map(|c| c as f32).into())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use mission::robot_model::RobotModel;
    use rerun::external::re_log_encoding::DecoderApp;
    use rerun::log::{Chunk, LogMsg};

    use super::*;
    use crate::referee::Referee;
    use crate::run::{RunConfig, Setup, run};
    use crate::scenario::{draw_start, robot_truth};
    use crate::task::Task;

    #[test]
    fn a_recording_holds_the_map_and_one_body_pose_for_each_sample() {
        let robot = RobotModel::builtin_quadruped();
        let scene = Scene::open("flat", &robot).unwrap();
        // The first second shows how the walls run; only then is there a place in the map.
        let config = RunConfig { max_time_s: 4.0, ..RunConfig::default() };
        let task = Task::read("find the mug near the sink", &scene.building).unwrap();
        let truth = robot_truth(&robot, config.mission.flight_height_m);
        let start = draw_start(&Referee::new(&scene.building, &scene.world, truth, 0), &robot, 0).unwrap();
        let (config, robot, task, start) = (&config, &robot, &task, &start);
        let setup = Setup {
            config,
            robot,
            scene: &scene,
            task,
            start,
            known: None,
            seed: 0,
            vehicle: None,
            orders: crate::orders::Orders::default(),
        };
        let result = run(setup, &Arc::default(), &mut |_| ()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recording.rrd");
        write_recording(&path, &result, &scene).unwrap();

        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let (mut rows, mut is_blueprint_active) = (BTreeMap::<(String, bool), usize>::new(), false);
        for message in DecoderApp::decode_lazy(file) {
            match message.unwrap() {
                LogMsg::ArrowMsg(_, message) => {
                    let chunk = Chunk::from_arrow_msg(&message).unwrap();
                    *rows.entry((chunk.entity_path().to_string(), chunk.is_static())).or_default() += chunk.num_rows();
                }
                LogMsg::BlueprintActivationCommand(_) => is_blueprint_active = true,
                LogMsg::SetStoreInfo(_) => {}
            }
        }
        assert!(is_blueprint_active);
        for path in
            ["/map/mesh/below", "/map/objects/confirmed", "/map/places/points", "/map/robot/body", "/map/truth/path"]
        {
            assert_eq!(rows.get(&(path.to_owned(), true)), Some(&1), "{path} in {rows:?}");
        }
        let samples = result.journal().curves.len();
        assert!(samples > 5);
        for path in ["/map/path", "/curves/speed", "/curves/tokens"] {
            assert_eq!(rows.get(&(path.to_owned(), false)), Some(&samples), "{path} in {rows:?}");
        }
        // The body and each of its moving links, 25 times a second.
        let postures = result.postures.len();
        assert!(postures > 40, "{postures}");
        assert_eq!(rows.get(&("/map/robot".to_owned(), false)), Some(&postures), "{rows:?}");
        for leg in &result.mission.robot().legs {
            for path in ["thigh", "calf", "foot"].map(|part| format!("/map/robot/legs/{}_{part}", leg.name)) {
                assert_eq!(rows.get(&(path.clone(), true)), Some(&1), "{path} in {rows:?}");
                assert_eq!(rows.get(&(path.clone(), false)), Some(&postures), "{path} in {rows:?}");
            }
        }
        assert!(rows[&("/log".to_owned(), false)] > 0);
    }

    #[test]
    fn the_built_in_body_keeps_its_size() {
        // A box around a shape is as large as the shape: a box stays itself.
        let shape = CollisionShape {
            link: "trunk".into(),
            body_from_shape: Isometry3::translation(0.1, 0.2, 0.3),
            geometry: mission::robot_model::Geometry::Box { half: Vector3::new(0.3, 0.2, 0.1) },
        };
        let expected = Boxes3D::from_centers_and_half_sizes([[0.1, 0.2, 0.3_f64]], [[0.3, 0.2, 0.1_f64]])
            .with_quaternions([quaternion(&UnitQuaternion::identity())]);
        assert_eq!(boxes_of(&[shape]), expected);
    }
}
