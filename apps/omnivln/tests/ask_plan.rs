//! `ask --plan`: ways from saved files alone. Laws on generated plans of two rooms, the program's answers, and a run that goes the way.

mod support;

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arena::mission::archive::{Known, load, save};
use arena::mission::config::MissionConfig;
use arena::mission::dsg::{Aabb, Object, ObjectId, Op};
use arena::mission::navigation::Room;
use arena::mission::omni_perception::Equirectangular;
use arena::mission::robot_model::RobotModel;
use arena::mission::route_plan::{RoutePlan, along, plan_routes};
use arena::mission::volumetric_map::{Cell, OccupancyGrid};
use arena::mission::world_model::WorldModel;
use arena::orders::Orders;
use arena::referee::Referee;
use arena::run::{RunConfig, RunResult, Setup, run};
use arena::scenario::{Scene, draw_start, robot_truth};
use arena::task::Task;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use omni_sim::scenes::named_scene;
use proptest::prelude::*;
use support::{keys, omnivln};

/// Two rooms of 4 m x 4 m beside each other with a door between, and a mug on a post in the right one.
#[derive(Debug, Clone)]
struct TwoRooms {
    door_m: f64,
    door_y: f64,
    mug: [f64; 2],
    /// Middles of columns.
    columns: Vec<[f64; 2]>,
}

const WALL_X: f64 = 4.0;
const HEIGHT_M: f64 = 2.3;

impl TwoRooms {
    /// Boxes that stop rays: low and high corner.
    fn boxes(&self) -> Vec<([f64; 3], [f64; 3])> {
        let (low, high) = (self.door_y - 0.5 * self.door_m, self.door_y + 0.5 * self.door_m);
        let mut boxes = vec![
            ([-0.2, -0.2, -0.2], [8.2, 4.2, 0.0]),
            ([-0.2, -0.2, HEIGHT_M], [8.2, 4.2, HEIGHT_M + 0.2]),
            ([-0.2, -0.2, 0.0], [8.2, 0.0, HEIGHT_M]),
            ([-0.2, 4.0, 0.0], [8.2, 4.2, HEIGHT_M]),
            ([-0.2, 0.0, 0.0], [0.0, 4.0, HEIGHT_M]),
            ([8.0, 0.0, 0.0], [8.2, 4.0, HEIGHT_M]),
            ([WALL_X - 0.06, 0.0, 0.0], [WALL_X + 0.06, low, HEIGHT_M]),
            ([WALL_X - 0.06, high, 0.0], [WALL_X + 0.06, 4.0, HEIGHT_M]),
            ([self.mug[0] - 0.15, self.mug[1] - 0.15, 0.0], [self.mug[0] + 0.15, self.mug[1] + 0.15, 0.8]),
        ];
        boxes.extend(self.columns.iter().map(|[x, y]| ([x - 0.1, y - 0.1, 0.0], [x + 0.1, y + 0.1, HEIGHT_M])));
        boxes
    }

    /// The building as a robot keeps it, seen from eight places.
    fn known(&self) -> Known {
        let world = self.world();
        let (labels, floor_m) = (world.label_names(), world.floor_m);
        Known { graph: world.graph, volume: world.volume, labels, floor_m, start: None }
    }

    fn world(&self) -> WorldModel {
        let (robot, config) = (RobotModel::builtin_quadruped(), MissionConfig::default());
        let mut world = WorldModel::new(&robot, &config, Equirectangular::default(), 0.0).expect("an empty world");
        let boxes = self.boxes();
        for (x, y) in
            [(0.8, 0.8), (0.8, 3.2), (3.0, 0.8), (3.0, 3.2), (4.0, self.door_y), (5.0, 3.2), (5.0, 0.8), (7.4, 2.0)]
        {
            let eye = Point3::new(x, y, 0.6);
            if boxes.iter().any(|(low, high)| (0..3).all(|a| low[a] < eye[a] && eye[a] < high[a])) {
                continue;
            }
            let points = seen_from(&eye, &boxes);
            world.volume.integrate(&eye, &points).expect("an eye that is somewhere");
        }
        let mug = Point3::new(self.mug[0], self.mug[1], 0.85);
        let mut object = Object::new(ObjectId(1), "mug", Aabb::from_center(mug, Vector3::repeat(0.1)));
        (object.observations, object.confirmed) = (20, true);
        world.graph.apply(Op::PutObject(Box::new(object))).expect("a valid object");
        world
    }
}

/// Where rays in all directions end.
fn seen_from(eye: &Point3<f64>, boxes: &[([f64; 3], [f64; 3])]) -> Vec<Point3<f32>> {
    const AROUND: usize = 480;
    const UP: usize = 160;
    let rays = (0..AROUND).flat_map(|a| (1..UP).map(move |e| (a, e)));
    let ends = rays.filter_map(|(a, e)| {
        let azimuth = std::f64::consts::TAU * a as f64 / AROUND as f64;
        let elevation = std::f64::consts::PI * (e as f64 / UP as f64 - 0.5);
        let ray = Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
        let hits = boxes.iter().filter_map(|(low, high)| {
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for axis in 0..3 {
                let (p, q) = ((low[axis] - eye[axis]) / ray[axis], (high[axis] - eye[axis]) / ray[axis]);
                (enter, leave) = (enter.max(p.min(q)), leave.min(p.max(q)));
            }
            (enter <= leave && enter > 0.0).then_some(enter)
        });
        let length_m = hits.fold(f64::INFINITY, f64::min);
        length_m.is_finite().then(|| (eye + ray * length_m).cast::<f32>())
    });
    ends.collect()
}

fn start() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(1.2, 2.0, 0.3), Vector3::zeros())
}

/// A robot whose footprint is so much larger.
fn scaled(robot: &RobotModel, factor: f64) -> RobotModel {
    let mut robot = robot.clone();
    robot.footprint.iter_mut().for_each(|p| *p = Point2::from(p.coords * factor));
    robot.circumscribed_radius_m *= factor;
    robot.inscribed_radius_m *= factor;
    robot
}

fn plan(rooms: &TwoRooms, robot: &RobotModel) -> RoutePlan {
    let known = Known { start: Some(start()), ..rooms.known() };
    plan_routes(robot, known, "find the mug", &MissionConfig::default()).expect("a start on free floor").0
}

/// Distance from a point to the nearest cell that is not free, by asking all of them.
fn room_at(grid: &OccupancyGrid, point: &Point2<f64>) -> f64 {
    let mut least_m = f64::INFINITY;
    for iy in 0..grid.height {
        for ix in 0..grid.width {
            if grid.get(ix, iy) != Cell::Free {
                least_m = least_m.min((grid.center(ix, iy) - point).norm());
            }
        }
    }
    least_m
}

fn two_rooms() -> impl Strategy<Value = TwoRooms> {
    let column = prop_oneof![[0.3..2.4_f64, 0.3..0.9_f64], [5.8..7.6_f64, 3.3..3.8_f64]];
    let mug = [6.0..7.4_f64, 0.4..2.6_f64];
    (0.75..1.4_f64, 1.0..3.0_f64, mug, prop::collection::vec(column, 0..3))
        .prop_map(|(door_m, door_y, mug, columns)| TwoRooms { door_m, door_y, mug, columns })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// On the saved map, asked cell by cell and not through the planner, every place of a way has the room that this robot needs to pass,
    /// and its last place the room to turn; and it begins and ends where it says.
    #[test]
    fn a_way_keeps_the_robots_room_on_the_saved_map(rooms in two_rooms()) {
        let robot = RobotModel::builtin_quadruped();
        let answer = plan(&rooms, &robot);
        // 5 cm cells: their middles are what is measured to.
        const CELL_M: f64 = 0.05;
        let room = Room::of(&robot);
        let needed_m = room.passing_m.unwrap_or(room.turning_m);
        if rooms.door_m > 2.0 * room.turning_m + 4.0 * CELL_M {
            prop_assert!(answer.why_not.is_none(), "a door of {} m: {:?}", rooms.door_m, answer.why_not);
        }
        let known = rooms.known();
        let top_m = robot.stance_height_m + robot.height_span_m.1 + 0.05;
        let grid = known.volume.ground_grid(0.0, 0.10, top_m);
        for leg in &answer.legs {
            let way: Vec<Point2<f64>> = leg.route.iter().map(|p| p.xy()).collect();
            prop_assert!((way[0] - Point2::new(1.2, 2.0)).norm() < 1e-9);
            prop_assert_eq!(*way.last().unwrap(), leg.stand);
            for point in along(&way).step_by(5) {
                let room_m = room_at(&grid, &point);
                prop_assert!(room_m >= needed_m - CELL_M, "{room_m:.3} m at {point}, {needed_m:.3} m needed");
            }
            prop_assert!(room_at(&grid, &leg.stand) >= room.turning_m - CELL_M);
            prop_assert!(leg.min_clearance_m >= needed_m - CELL_M);
            let length_m: f64 = way.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
            prop_assert!((length_m - leg.length_m).abs() < 1e-9);
            prop_assert!(leg.distance_m < 1.3);
            // At the robot's greatest speed it takes no less.
            let seconds = leg.seconds.expect("what can be planned can be rehearsed");
            prop_assert!(seconds >= leg.length_m / robot.limits.max_speed_mps - 0.5, "{seconds} s");
        }
    }
}

fn rooms() -> TwoRooms {
    TwoRooms { door_m: 1.0, door_y: 2.4, mug: [6.8, 1.2], columns: vec![] }
}

#[test]
fn a_robot_that_is_too_wide_for_the_door_is_told_where_it_can_get() {
    let robot = RobotModel::builtin_quadruped();
    let narrow = plan(&rooms(), &robot);
    assert!(narrow.why_not.is_none(), "{:?}", narrow.why_not);
    assert!(narrow.legs[0].length_m > 4.0 && narrow.legs[0].is_visible && narrow.legs[0].distance_m <= 0.85);
    let wide = plan(&rooms(), &scaled(&robot, 2.2));
    assert!(wide.legs.is_empty());
    let no_route = wide.why_not.expect("it does not fit");
    let (nearest, off_m) = no_route.nearest.expect("it knows where the mug is");
    assert!(nearest.x < WALL_X && off_m > 2.0, "{nearest} {off_m}");
    assert!(
        no_route.sentence.contains("mug") && no_route.sentence.contains("cannot get there"),
        "{}",
        no_route.sentence
    );
}

#[test]
fn a_flight_is_proved_and_keeps_its_ball_clear() {
    let robot = RobotModel::builtin_quadrotor();
    let answer = plan(&TwoRooms { door_m: 1.3, ..rooms() }, &robot);
    assert!(answer.why_not.is_none(), "{:?}", answer.why_not);
    let leg = &answer.legs[0];
    assert!(leg.is_proved && leg.seconds.is_some_and(|s| s > leg.length_m / robot.limits.max_speed_mps), "{leg:?}");
    assert!(leg.min_clearance_m >= robot.circumscribed_radius_m, "{}", leg.min_clearance_m);
    assert!((leg.route[0].z - 1.2).abs() < 1e-6);
}

#[test]
fn the_program_answers_with_stable_keys_and_codes() {
    let folder = tempfile::tempdir().expect("a folder");
    save(&rooms().world(), folder.path()).expect("the folder is there");
    let (path, page) = (folder.path().to_str().unwrap(), folder.path().join("way.html"));
    let ask = |text: &str, more: &[&str]| {
        let mut arguments = vec!["ask", path, text, "--plan", "--pose", "1.2,2,0,0"];
        arguments.extend(more);
        omnivln(&arguments)
    };
    let (code, out, err) =
        ask("find the mug, then come back to where you started", &["--json", "--html", page.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{err}");
    let answer: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    let expected = ["instruction", "robot", "found", "legs", "length_m", "seconds", "why_not"];
    assert_eq!(keys(&answer), expected.into_iter().collect());
    let legs = answer["legs"].as_array().unwrap();
    assert_eq!(legs.len(), 2, "{answer}");
    let of_leg = ["step", "target", "stand", "route", "length_m", "min_clearance_m", "seconds", "proved"];
    assert_eq!(keys(&legs[0]), of_leg.into_iter().collect());
    assert_eq!((&legs[0]["target"]["id"], &legs[0]["target"]["label"]), (&"O1".into(), &"mug".into()));
    assert!(legs[1]["target"]["id"].is_null());
    let lengths = [0, 1].map(|k: usize| legs[k]["length_m"].as_f64().unwrap());
    assert!((lengths[0] - lengths[1]).abs() < 0.5, "there and back: {lengths:?}");
    let page = fs::read_to_string(page).expect("a page");
    assert!(page.contains("<svg") && page.contains("polyline") && !page.contains("http://localhost"));
    // For people.
    let (code, out, _) = ask("find the mug", &["--robot", "aerial"]);
    assert!(matches!(code, Some(0 | 1)), "{out}");
    assert!(out.contains("Robot: "));
    // What is not there, and what cannot be read.
    let (code, out, _) = ask("find the piano", &["--json"]);
    assert_eq!(code, Some(1), "{out}");
    let answer: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    assert!(answer["why_not"]["sentence"].as_str().is_some_and(|sentence| !sentence.is_empty()));
    for arguments in [
        ["ask", path, "find the mug", "--plan", "--pose", "-40,2,0,0"],
        ["ask", path, "", "--plan", "--pose", "1.2,2,0,0"],
        ["ask", "/nowhere", "find the mug", "--plan", "--pose", "1.2,2,0,0"],
    ] {
        let (code, _, err) = omnivln(&arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {err}");
    }
    let (code, ..) = omnivln(&["ask", path, "find the mug", "--html", "x.html"]);
    assert_eq!(code, Some(2), "--html is for --plan");
    fs::write(folder.path().join("map.bin"), b"no map").unwrap();
    assert_eq!(ask("find the mug", &[]).0, Some(2));
}

fn run_in(scene: &Scene, text: &str, known: Option<Known>, start: &Isometry3<f64>, max_time_s: f64) -> RunResult {
    let mut config = RunConfig { max_time_s, ..RunConfig::default() };
    config.simulation.lidar.columns /= 2;
    let (config, robot) = (&config, &RobotModel::builtin_quadruped());
    let task = &Task::read(text, &scene.building).expect("the referee understands the sentence");
    let stop = Arc::new(AtomicBool::new(false));
    let setup = Setup { config, robot, scene, task, start, known, seed: 2, vehicle: None, orders: Orders::default() };
    run(setup, &stop, &mut |_| {}).expect("the run can be set up")
}

/// A run in the known building drives the way that was planned before it: about as long, and it ends where the plan ends.
fn drives_as_planned(name: &str, first_text: &str, first_s: f64, text: &str, into: &Path) -> (f64, f64, f64) {
    let scene = Scene::new(name, named_scene(name).expect("a named scene")).expect("a world");
    let robot = RobotModel::builtin_quadruped();
    let truth = robot_truth(&robot, 1.2);
    let referee = Referee::new(&scene.building, &scene.world, truth, 0);
    let from = |seed| draw_start(&referee, &robot, seed).expect("room for the robot");
    let earlier = run_in(&scene, first_text, None, &from(1), first_s);
    save(&earlier.mission.world, into).expect("the folder is there");
    let start = from(2);
    let in_map = earlier.truth.truth_from_map.inverse() * start;
    let known = || Known { start: Some(in_map), ..load(into).expect("what was saved can be loaded") };
    let (plan, _) = plan_routes(&robot, known(), text, &MissionConfig::default()).expect("a start on free floor");
    assert!(plan.why_not.is_none(), "{:?}", plan.why_not);
    let result = run_in(&scene, text, Some(known()), &start, 120.0);
    assert!(result.summary.success, "{}", result.summary.reason);
    let leg = &plan.legs[0];
    let end = earlier.truth.truth_from_map.inverse() * result.truth.poses.last().unwrap().1;
    let off_m = (Point2::from(end.translation.vector.xy()) - leg.stand).norm();
    (leg.length_m, result.summary.path_m, off_m)
}

#[test]
fn a_run_from_the_same_pose_drives_the_planned_way() {
    let folder = tempfile::tempdir().expect("a folder");
    let (planned_m, driven_m, off_m) = drives_as_planned("spin", "find the sofa", 15.0, "find the sofa", folder.path());
    println!("planned {planned_m:.2} m, driven {driven_m:.2} m, {off_m:.2} m from the planned stand");
    assert!((driven_m - planned_m).abs() <= 0.1 * planned_m + 0.3, "planned {planned_m} m, driven {driven_m} m");
    assert!(off_m <= 0.4, "{off_m} m from the planned stand");
}

/// The same through a whole flat. `cargo test --release -p omnivln --test ask_plan -- --ignored --nocapture`.
#[test]
#[ignore = "a whole exploration of a flat and a run in it"]
fn a_run_through_a_flat_drives_the_planned_way() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "find the mug near the sink";
    let (planned_m, driven_m, off_m) = drives_as_planned("flat", text, 300.0, text, folder.path());
    println!("planned {planned_m:.2} m, driven {driven_m:.2} m, {off_m:.2} m from the planned stand");
    assert!((driven_m - planned_m).abs() <= 0.1 * planned_m, "planned {planned_m} m, driven {driven_m} m");
    assert!(off_m <= 0.4, "{off_m} m from the planned stand");
}
