//! One mind for two bodies: the same graph, pose and instruction give byte-equal prompts, actions and verdicts whichever robot asks.

use dsg::{Aabb, Object, ObjectId, Op, Place, PlaceId, Room, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3, Vector3};
use octant_prompt::{
    Critic, Estimate, PromptConfig, Situation, SymbolicReasoner, build_prompt_for, decide_with_critic, messages,
    parse_instruction,
};
use proptest::prelude::*;
use robot_model::RobotModel;

const LABELS: [&str; 8] = ["mug", "sink", "chair", "table", "plant", "lamp", "shelf", "book"];
const INSTRUCTIONS: [&str; 6] = [
    "find the mug near the sink",
    "go to the plant in the kitchen",
    "find the chair",
    "go to the kitchen, then find the lamp",
    "find the book on the table",
    "find the unicorn",
];

/// Two rooms with places, one of them a frontier, and things at any height.
fn graph(things: &[(usize, f64, f64, f64)]) -> SceneGraph {
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
                frontier_cells: if id.0 == 5 { 40 } else { 0 },
                room: None,
            }));
        }
        let center = Point3::new(5.0 * room as f64 + 2.5, 2.5, 0.3);
        let mut room_node = Room { places, ..Room::new(RoomId(room), center) };
        room_node.name = ["kitchen", "hallway"][room as usize].to_owned();
        apply(Op::PutRoom(Box::new(room_node)));
    }
    for (index, (label, x, y, z)) in things.iter().enumerate() {
        let bounds = Aabb::from_center(Point3::new(*x, *y, *z), Vector3::repeat(0.2));
        let mut object = Object::new(ObjectId(index as u64 + 1), LABELS[*label], bounds);
        object.room = Some(RoomId(u64::from(*x >= 5.0)));
        object.confirmed = true;
        apply(Op::PutObject(Box::new(object)));
    }
    graph
}

/// What goes to a model and what comes of it, all in one text.
fn thoughts(robot: &RobotModel, camera_height_m: f64, graph: &SceneGraph, pose: Isometry3<f64>, text: &str) -> String {
    let instruction = parse_instruction(text);
    let here = Point3::from(pose.translation.vector);
    let path_length = |point: &Point3<f64>| Some((point - here).norm());
    let can_stop = |id: ObjectId| graph.object(id).is_some_and(|object| (object.centroid - here).norm() < 1.0);
    let frontiers: Vec<PlaceId> = graph.frontiers().map(|place| place.id).collect();
    let situation = Situation {
        frontiers: &frontiers,
        camera_height_m,
        ..Situation::new(graph, pose, &instruction, &path_length, &can_stop)
    };
    let config = PromptConfig { camera_height_m, ..PromptConfig::default() };
    let prompt = build_prompt_for(&situation, &config, &Estimate);
    let (critic, mut reasoner) = (Critic::default(), SymbolicReasoner::default());
    let record = decide_with_critic(&mut reasoner, &critic, &situation, &prompt, 3, &mut SymbolicReasoner::default());
    let schema = messages::reply_schema(&prompt.names);
    assert!(!prompt.text.contains(&robot.name), "the prompt does not name the robot");
    format!("{}\n{schema}\n{record:?}", prompt.text)
}

fn things() -> impl Strategy<Value = Vec<(usize, f64, f64, f64)>> {
    let thing = (0..LABELS.len(), 0.2..9.8_f64, 0.2..4.8_f64, 0.0..2.0_f64);
    prop::collection::vec(thing, 0..14)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_same_graph_pose_and_instruction_give_equal_bytes_whichever_robot_asks(
        things in things(), x in 0.5..9.5_f64, y in 0.5..4.5_f64, yaw_rad in -3.2..3.2_f64, which in 0..INSTRUCTIONS.len(),
    ) {
        let graph = graph(&things);
        let pose = Isometry3::new(Vector3::new(x, y, 0.3), Vector3::z() * yaw_rad);
        // Eq. 9 splits at the height of the eye, which is part of the pose from which both look.
        const EYE_M: f64 = 0.42;
        let [ground, air] = [RobotModel::builtin_quadruped(), RobotModel::builtin_quadrotor()]
            .map(|robot| thoughts(&robot, EYE_M, &graph, pose, INSTRUCTIONS[which]));
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
