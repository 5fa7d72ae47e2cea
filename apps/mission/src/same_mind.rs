//! Both robots' missions, with the same graph, pose, limits, memory and instruction: byte-equal decisions, from prompt to verdict.
//!
//! *Limits* are what the body can do: the room it needs round itself, and the height of its eye. Everything else that goes into a decision
//! must not know whose it is.

use dsg::{Aabb, Object, ObjectId, Op, Place, PlaceId, Room, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use octant_prompt::{Action, Critique, CritiqueCode, Reasoner, ScriptedReasoner, SymbolicReasoner};
use omni_perception::{Equirectangular, OdometryEstimate, Stamp};
use proptest::prelude::*;
use robot_model::RobotModel;
use volumetric_map::{Cell, OccupancyGrid};

use crate::acting::Failure;
use crate::config::MissionConfig;
use crate::mission::Mission;
use crate::navigation::NavigationMap;
use crate::odometer::OdometrySource;
use crate::reasoning::Mind;
use crate::steering::Control;

const LABELS: [&str; 9] = ["mug", "sink", "chair", "table", "plant", "lamp", "cup", "book", "sofa"];
const COLORS: [&str; 3] = ["red", "blue", "white"];
const INSTRUCTIONS: [&str; 10] = [
    "find the mug near the sink",
    "find the mug",
    "find a chair",
    "find teh red sofa",
    "go to the plant in the kitchen",
    "go to the kitchen, then find the lamp",
    "find the book on the table",
    "something to sit on",
    "find the unicorn",
    "find the largest table",
];

/// What both missions are given.
#[derive(Debug, Clone)]
struct Given {
    /// Label, colour, place, images.
    things: Vec<(usize, usize, [f64; 3], u32)>,
    /// Occupied boxes of the plan: cells.
    walls: Vec<[usize; 4]>,
    frontiers: Vec<bool>,
    at: [f64; 3],
    text: usize,
    may_ask: bool,
    inspected: Vec<u64>,
    failed: Vec<u64>,
    stop_distance_m: f64,
    /// What a model says; nothing: the rules decide.
    said: Vec<String>,
}

const CELLS: (usize, usize) = (100, 50);
const CELL_M: f64 = 0.1;

fn given() -> impl Strategy<Value = Given> {
    let thing = (0..LABELS.len(), 0..COLORS.len(), [0.2..9.8_f64, 0.2..4.8, 0.0..2.0], 1..60_u32);
    let wall = (0..CELLS.0, 0..CELLS.1, 1..12_usize, 1..6_usize).prop_map(|(x, y, w, h)| [x, y, w, h]);
    let said = prop_oneof![
        Just(Vec::new()),
        prop::collection::vec(
            prop_oneof![
                Just("go_near(mug1)".to_owned()),
                Just("stop(mug1)".to_owned()),
                Just("explore(frontier1)".to_owned()),
                Just("{\"action\": \"give_up\", \"target\": \"nothing\"}".to_owned()),
                "[a-z_]{2,12}\\([a-z]{2,8}[0-9]\\)",
            ],
            1..5
        ),
    ];
    let memory = (prop::collection::vec(0..14_u64, 0..4), prop::collection::vec(0..14_u64, 0..3));
    let world = (
        prop::collection::vec(thing, 0..14),
        prop::collection::vec(wall, 0..5),
        prop::collection::vec(any::<bool>(), 6),
    );
    let body = ([0.6..9.4_f64, 0.6..4.4, -3.2..3.2], 0.4..1.2_f64);
    (world, body, memory, said, 0..INSTRUCTIONS.len(), any::<bool>()).prop_map(
        |((things, walls, frontiers), (at, stop_distance_m), (inspected, failed), said, text, may_ask)| Given {
            things,
            walls,
            frontiers,
            at,
            text,
            may_ask,
            inspected,
            failed,
            stop_distance_m,
            said,
        },
    )
}

fn graph(given: &Given) -> SceneGraph {
    let mut graph = SceneGraph::new();
    let mut apply = |op| {
        graph.apply(op).expect("a valid operation");
    };
    for room in 0..2_u64 {
        let places: Vec<PlaceId> = (0..3).map(|k| PlaceId(room * 3 + k)).collect();
        for (k, id) in places.iter().enumerate() {
            apply(Op::PutPlace(Place {
                id: *id,
                position: Point3::new(5.0 * room as f64 + 1.0 + 1.5 * k as f64, 2.0, 0.3),
                clearance_m: 0.5,
                basis_points: 2,
                frontier_cells: if given.frontiers[id.0 as usize] { 40 } else { 0 },
                room: None,
            }));
        }
        let name = ["kitchen", "hallway"][room as usize].to_owned();
        let center = Point3::new(5.0 * room as f64 + 2.5, 2.5, 0.3);
        let kind = Some(name.clone());
        apply(Op::PutRoom(Box::new(Room {
            places,
            name,
            kind,
            kind_confidence: 0.8,
            ..Room::new(RoomId(room), center)
        })));
    }
    for (index, (label, color, [x, y, z], observations)) in given.things.iter().enumerate() {
        let bounds = Aabb::from_center(Point3::new(*x, *y, *z), Vector3::repeat(0.2));
        let mut object = Object::new(ObjectId(index as u64), LABELS[*label], bounds);
        (object.room, object.observations) = (Some(RoomId(u64::from(*x >= 5.0))), *observations);
        object.confirmed = *observations > 2;
        object.attributes.insert("color".into(), COLORS[*color].into());
        apply(Op::PutObject(Box::new(object)));
    }
    graph
}

fn plan(given: &Given) -> OccupancyGrid {
    let mut cells = vec![Cell::Free; CELLS.0 * CELLS.1];
    for [x, y, w, h] in &given.walls {
        for iy in *y..(y + h).min(CELLS.1) {
            for ix in *x..(x + w).min(CELLS.0) {
                cells[iy * CELLS.0 + ix] = Cell::Occupied;
            }
        }
    }
    OccupancyGrid { origin: Point2::origin(), resolution_m: CELL_M, width: CELLS.0, height: CELLS.1, cells }
}

/// What the mission of a robot decides and what becomes of it.
fn decided(robot: &RobotModel, given: &Given) -> String {
    /// Limits that both are given: those of the quadruped's body, and an eye at this height.
    const EYE_M: f64 = 0.8;
    let config = MissionConfig {
        odometry: OdometrySource::Stream,
        stop_distance_m: given.stop_distance_m,
        ..MissionConfig::default()
    };
    let mind: Box<dyn Reasoner + Send> = match given.said.is_empty() {
        true => Box::new(SymbolicReasoner::default()),
        false => Box::new(ScriptedReasoner::new(given.said.clone())),
    };
    let start = Isometry3::translation(1.0, 1.0, robot.stance_height_m);
    let text = INSTRUCTIONS[given.text];
    let mut mission =
        Mission::new(robot, text, config, Equirectangular::default(), Mind::Embedded(mind), Stamp(0), &start)
            .expect("a mission");
    mission.asked_from = Point3::new(1.0, 1.0, 0.3);
    let [x, y, yaw_rad] = given.at;
    let pose = Isometry3::new(Vector3::new(x, y, 0.3), Vector3::z() * yaw_rad);
    mission.world.odometry = Some(OdometryEstimate::at_rest(Stamp(1_000_000_000), pose));
    mission.world.floor_m = 0.0;
    mission.world.body_height_m = EYE_M - robot.sensors.body_from_camera.translation.vector.z;
    mission.world.graph = graph(given);
    mission.world.navigation = NavigationMap::new(&RobotModel::builtin_quadruped());
    mission.world.navigation.grid = plan(given);
    mission.world.slice = plan(given);
    mission.memory.inspected = given.inspected.iter().map(|id| ObjectId(*id)).collect();
    mission.memory.reprieves = 9; // the world behind the graph, in which a search is taken up again, is empty here
    mission.memory.rejected = given
        .failed
        .iter()
        .map(|id| {
            let action = Action::GoNear(ObjectId(*id));
            let critique = Critique { code: CritiqueCode::Failed, message: "no way".into(), action: Some(action) };
            Failure::until(critique, 1e9)
        })
        .collect();
    if given.may_ask {
        mission.control(&Control::AskMe, Stamp(0)).expect("it listens");
    }
    mission.ask(1.0);
    mission.take_answer(1.5);
    let entry = mission.journal.decisions.first().expect("it has decided");
    let decision = serde_json::to_string(entry).expect("a decision is written");
    assert!(!decision.contains(&robot.name), "{decision}");
    format!("{decision}\n{:?}\n{:?}\n{:?}", mission.question, mission.outcome, mission.steps_done.len())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn both_robots_missions_think_the_same_byte_for_byte(given in given()) {
        let [ground, air] = [RobotModel::builtin_quadruped(), RobotModel::builtin_quadrotor()].map(|robot| decided(&robot, &given));
        prop_assert_eq!(ground, air);
    }

    /// Two robots whose cameras look from the same point in the world: their body origins lie at different heights below it.
    #[test]
    fn robots_that_look_from_the_same_point_sort_things_into_the_same_octants(
        x in 0.5..9.5_f64, y in 0.5..4.5_f64, z in 0.0..2.0_f64, yaw_rad in -3.2..3.2_f64,
    ) {
        const EYE_M: f64 = 1.3;
        let thing = Point3::new(x, y, z);
        // At the split itself the two differences may round to either side.
        prop_assume!((z - EYE_M).abs() > 1e-9);
        let [ground, air] = [RobotModel::builtin_quadruped(), RobotModel::builtin_quadrotor()].map(|robot| {
            let camera_m = robot.sensors.body_from_camera.translation.vector.z;
            let pose = Isometry3::new(Vector3::new(5.0, 2.5, EYE_M - camera_m), Vector3::z() * yaw_rad);
            octant_prompt::octant_of(&octant_prompt::point_in_body(&pose, &thing), camera_m)
        });
        prop_assert_eq!(ground, air);
    }
}

/// The property could hold of missions that always say the same: these do not.
#[test]
fn the_decisions_depend_on_what_is_given() {
    let robot = RobotModel::builtin_quadrotor();
    let two_mugs = Given {
        things: vec![(0, 0, [2.0, 2.0, 0.8], 30), (0, 1, [8.0, 2.0, 0.8], 30)],
        walls: Vec::new(),
        frontiers: vec![false; 6],
        at: [5.0, 2.5, 0.0],
        text: 1,
        may_ask: true,
        inspected: Vec::new(),
        failed: Vec::new(),
        stop_distance_m: 0.85,
        said: Vec::new(),
    };
    assert!(decided(&robot, &two_mugs).contains("Which mug do you mean"));
    assert!(decided(&robot, &Given { may_ask: false, ..two_mugs.clone() }).contains("go_near"));
    assert!(decided(&robot, &Given { text: 8, ..two_mugs.clone() }).contains("There is no unicorn here"));
    let frontiers = vec![true; 6];
    assert!(decided(&robot, &Given { text: 8, frontiers, ..two_mugs.clone() }).contains("explore"));
    // Behind a wall across the hall there is no way.
    let walls = vec![[40, 0, 3, 50]];
    let far_behind = vec![(0, 0, [0.5, 2.0, 0.8], 30)];
    let walled = Given { walls, things: far_behind, may_ask: false, ..two_mugs };
    assert!(decided(&robot, &walled).contains("give_up"), "{}", decided(&robot, &walled));
}
