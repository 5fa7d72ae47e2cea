//! Files of a hundred thousand nodes, and the update after a scan in a building of thirty rooms.
//!
//! `cargo bench -p dsg`. Beside spark_dsg: `python3 ../shared/bench/dsg_peers.py 100000 --keep DIR`, then `omnivln dsg time
//! DIR/graph_100000.json` in the same minute.

use divan::{Bencher, counter::BytesCount};
use dsg::{
    Aabb, Agent, AgentId, AgentPose, AssociationConfig, GroupConfig, Object, ObjectEvidence, ObjectId, Op, Place,
    PlaceEdge, PlaceId, PlaceState, PlaceUpdate, RelationConfig, RelationKind, Room, RoomConfig, RoomId, RoomPart,
    SceneGraph, graph_from_json, graph_to_json, observe_objects, read_spark_dsg, update_groups, update_places,
    update_relations, update_rooms, write_spark_dsg,
};
use nalgebra::{Isometry3, Point3, Vector3};

fn main() {
    divan::main();
}

/// A tenth objects, the rest places on a grid with their neighbours, seventy places to a room.
fn large(nodes: u64) -> SceneGraph {
    let mut graph = SceneGraph::new();
    let (objects, rooms) = (nodes / 10, nodes / 70);
    let places = nodes - objects - rooms;
    let side = (places as f64).sqrt().ceil() as u64;
    let mut ops = Vec::new();
    for i in 0..places {
        let (x, y) = (i % side, i / side);
        let position = Point3::new(x as f64 + 0.01 * (i % 10) as f64, y as f64, 1.0);
        let clearance_m = 0.3 + (i % 97) as f64 * 0.0103;
        ops.push(Op::PutPlace(Place {
            id: PlaceId(i),
            position,
            clearance_m,
            basis_points: 3,
            frontier_cells: 0,
            room: None,
        }));
        let back = [(x > 0).then(|| i - 1), i.checked_sub(side), i.checked_sub(side + 1).filter(|_| x > 0)];
        for j in back.into_iter().flatten() {
            ops.push(Op::PutPlaceEdge(PlaceEdge {
                a: PlaceId(j),
                b: PlaceId(i),
                clearance_m: (i % 89) as f64 * 0.0113,
            }));
        }
    }
    let mut members: Vec<Vec<PlaceId>> = vec![Vec::new(); rooms as usize];
    (0..places).for_each(|i| members[(i * rooms / places) as usize].push(PlaceId(i)));
    for (id, places) in members.into_iter().enumerate() {
        ops.push(Op::PutRoom(Box::new(Room {
            places,
            ..Room::new(RoomId(id as u64), Point3::new(id as f64, 0.0, 1.0))
        })));
    }
    for i in 0..objects {
        let at = Point3::new((i % side) as f64, (i / side) as f64, 0.5);
        let object = Object::new(
            ObjectId(i),
            ["chair", "table", "mug"][(i % 3) as usize],
            Aabb::from_center(at, Vector3::new(0.5, 0.5, 1.0)),
        );
        ops.push(Op::PutObject(Box::new(Object { place: Some(PlaceId(i * 7 % places)), ..object })));
    }
    graph.apply(Op::Batch(ops)).expect("a sound graph");
    graph
}

#[divan::bench(args = [10_000, 100_000], sample_count = 3)]
fn load_ours(bencher: Bencher, nodes: u64) {
    let bytes = graph_to_json(&large(nodes));
    bencher.counter(BytesCount::from(bytes.len())).bench(|| graph_from_json(&bytes).expect("it was written by us"));
}

#[divan::bench(args = [10_000, 100_000], sample_count = 3)]
fn save_ours(bencher: Bencher, nodes: u64) {
    let graph = large(nodes);
    bencher.bench(|| graph_to_json(&graph));
}

#[divan::bench(args = [10_000, 100_000], sample_count = 3)]
fn load_spark_dsg(bencher: Bencher, nodes: u64) {
    let bytes = spark(&large(nodes));
    bencher
        .counter(BytesCount::from(bytes.len()))
        .bench(|| read_spark_dsg(&bytes, None).expect("it was written by us"));
}

#[divan::bench(args = [10_000, 100_000], sample_count = 3)]
fn save_spark_dsg(bencher: Bencher, nodes: u64) {
    let graph = large(nodes);
    bencher.bench(|| spark(&graph));
}

fn spark(graph: &SceneGraph) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_spark_dsg(graph, None, &mut bytes).expect("memory takes all bytes");
    bytes
}

// The update after a scan

/// Six by five rooms of 5 m, in each forty places and twenty things.
fn building() -> (SceneGraph, Vec<RoomPart>) {
    let mut graph = SceneGraph::new();
    let mut parts = Vec::new();
    let mut seed = 1_u64;
    let mut dice = |low: f64, high: f64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let labels = ["chair", "desk", "monitor", "mug", "shelf", "plant", "lamp", "book"];
    for room in 0..30_u64 {
        let (x, y) = (5.0 * (room % 6) as f64, 5.0 * (room / 6) as f64);
        let mut ops = Vec::new();
        let ids: Vec<PlaceId> = (0..40).map(|k| PlaceId(room * 40 + k)).collect();
        for (k, id) in ids.iter().enumerate() {
            let position = Point3::new(x + 0.5 + 0.6 * (k % 8) as f64, y + 0.5 + 0.9 * (k / 8) as f64, 1.0);
            ops.push(Op::PutPlace(Place {
                id: *id,
                position,
                clearance_m: 0.4,
                basis_points: 3,
                frontier_cells: 0,
                room: None,
            }));
            if k > 0 {
                ops.push(Op::PutPlaceEdge(PlaceEdge { a: ids[k - 1], b: *id, clearance_m: 0.4 }));
            }
        }
        for k in 0..20_u64 {
            let at = Point3::new(x + dice(0.3, 4.7), y + dice(0.3, 4.7), dice(0.2, 1.2));
            let sides = Vector3::new(dice(0.1, 1.2), dice(0.1, 0.8), dice(0.1, 0.8));
            let object =
                Object::new(ObjectId(room * 20 + k + 1), labels[(k % 8) as usize], Aabb::from_center(at, sides));
            ops.push(Op::PutObject(Box::new(object)));
        }
        graph.apply(Op::Batch(ops)).expect("sound");
        parts.push(RoomPart { places: ids, center: Point3::new(x + 2.5, y + 2.5, 1.0), area_m2: 25.0, floor: 0 });
    }
    let robot = Agent { id: AgentId(0), name: "robot".into(), trajectory: Vec::new() };
    graph.apply(Op::PutAgent(Box::new(robot))).expect("sound");
    (graph, parts)
}

/// What one scan changes: a few places, six things seen, the rooms cut anew, relations, groups, a pose.
fn update(graph: &mut SceneGraph, parts: &[RoomPart], tick: u64) {
    let room = tick % 30;
    let put = (0..5).map(|k| {
        let known = *graph.place(PlaceId(room * 40 + k)).expect("it is there");
        let position = known.position + Vector3::new(0.001 * (tick % 3) as f64, 0.0, 0.0);
        PlaceState { id: known.id, position, clearance_m: 0.4, basis_points: 3, frontier_cells: 0 }
    });
    let news = PlaceUpdate { put: put.collect(), ..PlaceUpdate::default() };
    update_places(graph, &news).expect("sound");
    let seen: Vec<ObjectEvidence> = (1..=6)
        .map(|k| {
            let object = graph.object(ObjectId(room * 20 + k)).expect("it is there");
            let corner = |i: usize| {
                let share = Vector3::new((i % 7) as f64 / 6.0, (i / 7 % 7) as f64 / 6.0, (i / 49) as f64 / 2.0);
                (object.bounds.min + object.bounds.sides_m().component_mul(&share)).cast::<f32>()
            };
            ObjectEvidence {
                stamp_ns: 1 + tick as i64 * 100_000_000,
                label_weights: vec![(object.label.clone(), 1.0)],
                caption: String::new(),
                score: 0.9,
                points: (0..147).map(corner).collect(),
                color: None,
                track: None,
            }
        })
        .collect();
    observe_objects(graph, &seen, &AssociationConfig::default()).expect("sound");
    let room_of = |point: &Point3<f64>| Some(((point.y / 5.0) as usize * 6 + (point.x / 5.0) as usize).min(29));
    update_rooms(graph, parts, &[], &room_of, &RoomConfig::default()).expect("sound");
    let clear = |_: &Point3<f64>, _: &Point3<f64>| None;
    let yes = |_: &Object, _: &Object, _: RelationKind| 1.0;
    update_relations(graph, &clear, &yes, &RelationConfig::default()).expect("sound");
    update_groups(graph, &GroupConfig::default()).expect("sound");
    let pose = AgentPose { stamp_ns: tick as i64 * 100_000_000, world_from_body: Isometry3::identity() };
    graph.apply(Op::AddAgentPose(AgentId(0), pose)).expect("sound");
}

/// After so many scans: the age of the map makes no difference.
#[divan::bench(args = [30, 1_000, 5_000], sample_count = 20, sample_size = 5)]
fn update_after_a_scan(bencher: Bencher, age: u64) {
    let (mut graph, parts) = building();
    for tick in 0..age {
        update(&mut graph, &parts, tick);
    }
    let mut tick = age;
    bencher.bench_local(|| {
        tick += 1;
        update(&mut graph, &parts, tick);
    });
}
