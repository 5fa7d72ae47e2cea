//! `bench map`: what the scene graph knows of a building after a survey, against the truth.
//!
//! A drawn building is toured by the robot with its own odometry, mapping and segmented pictures; nothing true reaches them.
//! Then the referee compares layer by layer ([`crate::map_score`]). Everything is in the frame in which the map began, so the
//! drift of the odometry counts against the graph.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use anyhow::{Context, Result, ensure};
use mission::robot_model::{RobotKind, RobotModel};
use mission::stage_clock::CpuScope;
use nalgebra::{Isometry3, Point2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::cli::word;
use crate::frame::Frame;
use crate::map_score::room_ids::room_round;
use crate::map_score::{MapScore, Witness, known_places, map_score};
use crate::progress::ProgressView;
use crate::record_truth::write_building;
use crate::run::RunConfig;
use crate::run_folder::RunFolder;
use crate::scenario::Scene;
use crate::survey::{Moment, survey};
use crate::toured_scene::TouredScene;
use crate::workers::on_each_core;

/// The result, as `--json` prints it.
#[derive(Debug, Clone, Serialize)]
pub struct BenchMap {
    /// `ground` or `aerial`.
    pub robot: String,
    /// Seed of the bench.
    pub seed: u64,
    /// Every building.
    pub scenes: Vec<SceneScore>,
    /// All buildings together.
    pub pooled: MapScore,
}

/// One building.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SceneScore {
    /// Seed of the building.
    pub scene: String,
    /// Its rooms.
    pub rooms: usize,
    /// Length of the way.
    pub path_m: f64,
    /// Duration of the survey.
    pub sim_s: f64,
    /// The figures.
    #[serde(flatten)]
    pub score: MapScore,
}

/// Surveys the scenes with these indices of the bench with `seed`. With `keep`, graph, map, truth and a list of what is wrong are written
/// below it. Progress goes to stderr unless `is_quiet`.
///
/// # Errors
/// If a building cannot be surveyed.
#[allow(clippy::too_many_arguments)] // one for each thing that decides the bench
pub fn bench_map(
    robot: &RobotModel,
    kind: RobotKind,
    indices: &[usize],
    seed: u64,
    config: &RunConfig,
    keep: Option<&Path>,
    is_quiet: bool,
    stop: &Arc<AtomicBool>,
) -> Result<BenchMap> {
    let view = ProgressView::new(indices.len() as u64, "{elapsed_precise} [{bar:30}] {pos}/{len} {msg}", is_quiet);
    let config = RunConfig { cpu_scope: CpuScope::Thread, ..config.clone() };
    let finished = AtomicUsize::new(0);
    let scenes = on_each_core(indices.len(), |position| {
        let index = indices[position];
        ensure!(!stop.load(Ordering::Relaxed), "the bench was interrupted");
        let folder = keep.map(|keep| keep.join(format!("{}-{seed}-{index:03}", word(kind))));
        let one = one_scene(robot, seed, index, &config, folder.as_deref(), stop)
            .with_context(|| format!("surveying building {index} of seed {seed}"));
        let done = finished.fetch_add(1, Ordering::Relaxed) + 1;
        view.show(done as u64, &format!("{done} of {} surveys", indices.len()), true);
        one
    })?;
    view.finish();
    let scenes = scenes.into_iter().collect::<Result<Vec<_>>>()?;
    let pooled = MapScore::pooled(scenes.iter().map(|scene| &scene.score));
    Ok(BenchMap { robot: word(kind).to_owned(), seed, scenes, pooled })
}

fn draw_scene(seed: u64, index: usize, robot: &RobotModel, config: &RunConfig) -> Result<TouredScene> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (0x004D_6170 + index as u64));
    TouredScene::draw(&mut rng, robot, config, &|seed| Scene::drawn(seed, robot))
}

fn one_scene(
    robot: &RobotModel,
    seed: u64,
    index: usize,
    config: &RunConfig,
    folder: Option<&Path>,
    stop: &Arc<AtomicBool>,
) -> Result<SceneScore> {
    // Refused before the robot has moved.
    let folder = folder.map(|folder| RunFolder::marked(folder, MARK, "folder of a survey")).transpose()?;
    let TouredScene { scene, start, tour, run_seed } = draw_scene(seed, index, robot, config)?;
    let building = &scene.building;
    let radius_m = robot.circumscribed_radius_m;
    let floor_z_m = start.translation.vector.z - robot.stance_height_m;
    let mut witness = Witness::default();
    let mut last_frame = Isometry3::identity();
    let surveyed = survey(config, robot, &scene, &start, &tour, floor_z_m, run_seed, &mut |now_s, moment| {
        let Moment::Refreshed { world, truth_from_map, truth_from_body } = moment else { return };
        last_frame = truth_from_map;
        let at = Point2::from(truth_from_body.translation.vector.xy());
        witness.entered.extend(building.rooms.iter().find(|room| room.contains(&at)).map(|room| room.id));
        if let Some(room) = room_round(&building.rooms, &at, radius_m) {
            witness.room_ids.enter(room);
        }
        let places = known_places(&world.graph, &truth_from_map);
        let in_rooms = places.iter().filter_map(|(at, id)| Some((building.room_at(at)?.id, (*id)?)));
        witness.room_ids.look(now_s, in_rooms);
    })?;
    ensure!(!stop.load(Ordering::Relaxed), "the bench was interrupted");
    witness.points_on = surveyed.points_on;
    let graph = &surveyed.world.graph;
    let (score, mistakes) = map_score(building, &scene.world, graph, &last_frame, &witness);
    let scored = SceneScore {
        scene: scene.name.clone(),
        rooms: building.rooms.len(),
        path_m: tour.length_m,
        sim_s: surveyed.sim_s,
        score,
    };
    if let Some(folder) = folder {
        mission::archive::save(&surveyed.world, folder.path())?;
        folder.write("scene_graph.txt", mission::dsg::scene_graph_text(graph).as_bytes())?;
        write_building(&folder, building)?;
        let frame = Frame {
            position_m: last_frame.translation.vector.into(),
            yaw_rad: last_frame.rotation.euler_angles().2,
            floor_m: floor_z_m,
        };
        folder.write("truth/frame.json", &serde_json::to_vec_pretty(&frame)?)?;
        folder.write("truth/points.json", &serde_json::to_vec(&witness.points_on)?)?;
        folder.write("mistakes.txt", (mistakes.join("\n") + "\n").as_bytes())?;
        folder.write(MARK, &serde_json::to_vec_pretty(&scored)?)?;
        folder.publish()?;
    }
    Ok(scored)
}

/// The figures of one scene; marks a complete folder of `--keep`.
const MARK: &str = "map_score.json";

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(value: &serde_json::Value) -> Vec<&str> {
        value.as_object().expect("an object").keys().map(String::as_str).collect()
    }

    #[test]
    fn the_promised_keys() {
        let scene = SceneScore { scene: "7".into(), ..SceneScore::default() };
        let pooled = MapScore::pooled([&scene.score].into_iter());
        let bench = BenchMap { robot: "ground".into(), seed: 1, scenes: vec![scene], pooled };
        let value = serde_json::to_value(&bench).expect("it serialises");
        assert_eq!(keys(&value), ["pooled", "robot", "scenes", "seed"]);
        let subjects = ["doorways", "groups", "objects", "places", "relations", "room_ids"];
        assert_eq!(keys(&value["pooled"]), subjects);
        let mut of_scene: Vec<&str> = subjects.iter().copied().chain(["path_m", "rooms", "scene", "sim_s"]).collect();
        of_scene.sort_unstable();
        assert_eq!(keys(&value["scenes"][0]), of_scene);
        let of = |subject: &str| keys(&value["pooled"][subject]).join(" ");
        assert_eq!(
            of("objects"),
            "centroid_error_m duplicates label_accuracy precision precision_with_label recall recall_with_label things"
        );
        assert_eq!(of("places"), "frontiers in_doorways known_rooms outside right_room true_rooms without_room");
        assert_eq!(of("doorways"), "found found_between_its_rooms place_error_m precision width_error_m");
        assert_eq!(of("relations"), "after_eq6 after_eq7 kinds proposed");
        assert_eq!(of("groups"), "adjusted_rand_index pair_precision pair_recall things worst");
        assert_eq!(of("room_ids"), "changes looks rooms");
        let pooled = &value["pooled"];
        assert_eq!(keys(&pooled["objects"]["precision"]), ["hits", "of", "value"]);
        assert_eq!(keys(&pooled["objects"]["centroid_error_m"]), ["count", "median", "p90"]);
        assert_eq!(keys(&pooled["relations"]["after_eq7"]), ["precision", "recall", "unsure"]);
        assert_eq!(keys(&pooled["relations"]["kinds"]), ["above", "between", "inside", "near", "on", "under"]);
        assert!(pooled["objects"]["precision"]["value"].is_null(), "nothing was counted");
    }

    #[test]
    fn the_same_seed_draws_the_same_building_and_another_one_another() {
        let robot = RobotModel::builtin_quadruped();
        let drawn = |seed, index| {
            let drawn = draw_scene(seed, index, &robot, &RunConfig::default()).unwrap();
            (drawn.scene.name, drawn.start, drawn.tour.way, drawn.run_seed)
        };
        assert_eq!(drawn(1, 0), drawn(1, 0));
        assert_ne!(drawn(1, 0).0, drawn(1, 1).0);
        assert_ne!(drawn(1, 0).0, drawn(2, 0).0);
    }
}
