//! Random graphs, made by random ops.

use dsg::{
    Aabb, Agent, AgentId, AgentPose, Building, BuildingId, Evidence, EvidenceSource, Group, GroupId, Object, ObjectId,
    Op, Place, PlaceEdge, PlaceId, Presence, Relation, RelationKind, Room, RoomEdge, RoomId, SceneGraph, TrackPoint,
    Verdict,
};
use nalgebra::{Isometry3, Point3, Vector3};
use proptest::prelude::*;

/// One random op from small numbers: ids in 0..6, so that ops meet each other, and often refuse.
pub fn op(kind: u8, a: u64, b: u64, x: f64) -> Op {
    let (object, other) = (ObjectId(a % 6), ObjectId(b % 6));
    let (place, place_b) = (PlaceId(a % 6), PlaceId(b % 6));
    let (room, room_b) = (RoomId(a % 4), RoomId(b % 4));
    match kind % 21 {
        0..=2 => {
            let mut put =
                Object::new(object, ["chair", "table", "mug"][(b % 3) as usize], Aabb::at(Point3::new(x, 0.1, 0.2)));
            put.label = ["chair", "table", "Mug 2", "O(3)"][(a % 4) as usize].to_owned();
            put.color = (b.is_multiple_of(4)).then_some([a as u8, 7, 0]);
            put.last_seen_ns = a as i64 - 3;
            put.first_seen_ns = -5;
            if b.is_multiple_of(5) {
                put.presence = vec![Presence { first_ns: -2, last_ns: 1 }, Presence { first_ns: 3, last_ns: 9 }];
                put.trajectory = (0..a % 3)
                    .map(|k| TrackPoint { stamp_ns: k as i64, position: Point3::new(x, k as f64, 0.1) })
                    .collect();
            }
            put.room = (b.is_multiple_of(3)).then_some(room_b);
            put.place = (b.is_multiple_of(2)).then_some(place_b);
            Op::PutObject(Box::new(put))
        }
        3 => Op::RemoveObject(object),
        4 => Op::MergeObjects { from: object, into: other },
        5 | 6 => Op::PutPlace(Place {
            id: place,
            position: Point3::new(x, b as f64, 1.0),
            clearance_m: x.abs(),
            basis_points: 3,
            frontier_cells: (b % 2) as u32,
            room: Some(room_b),
        }),
        7 => Op::RemovePlace(place),
        8 => Op::PutPlaceEdge(PlaceEdge { a: place, b: place_b, clearance_m: x.abs() }),
        9 => Op::RemovePlaceEdge(place, place_b),
        10 | 11 => {
            let mut put = Room::new(room, Point3::new(x, 0.0, 1.0));
            put.places = vec![place, place_b];
            Op::PutRoom(Box::new(put))
        }
        12 => Op::RemoveRoom(room),
        13 => Op::PutRoomEdge(RoomEdge { a: room, b: room_b, doorway: Point3::new(x, 0.0, 1.0), width_m: 0.9 }),
        14 => Op::NameRoom(room, ["den", "study", ""][(b % 3) as usize].to_owned()),
        15 | 16 => Op::PutGroup(Box::new(Group {
            id: GroupId(a % 3),
            name: "table group".to_owned(),
            support: Some(other),
            members: vec![object, other, ObjectId((a + b) % 6)],
            room: (b.is_multiple_of(2)).then_some(room_b),
            center: Point3::origin(),
        })),
        17 => Op::PutRelation(Relation {
            subject: object,
            kind: RelationKind::ALL[(b % 6) as usize],
            object: other,
            other: (b % 6 == 5).then_some(ObjectId((a + b) % 6)),
            evidence: Evidence {
                verdict: [Verdict::Holds, Verdict::Blocked(Point3::new(x, 0.0, 0.0)), Verdict::Rejected]
                    [(a % 3) as usize],
                source: EvidenceSource::Stated,
                distance_m: x.abs(),
                score: 1.0,
            },
        }),
        18 => Op::PutBuilding(Box::new(Building {
            id: BuildingId(0),
            name: "home".to_owned(),
            center: Point3::origin(),
            rooms: vec![room, room_b],
            storeys: Vec::new(),
        })),
        19 => match b % 3 {
            0 => Op::PutAgent(Box::new(Agent { id: AgentId(0), name: "dog".to_owned(), trajectory: Vec::new() })),
            _ => Op::AddAgentPose(
                AgentId(0),
                AgentPose { stamp_ns: a as i64, world_from_body: Isometry3::new(Vector3::x() * x, Vector3::z() * x) },
            ),
        },
        _ => match b % 4 {
            0 => Op::Transform(Isometry3::new(Vector3::new(x, 0.0, 0.1), Vector3::z() * 0.3)),
            1 => Op::RemoveGroup(GroupId(a % 3)),
            2 => Op::Batch(vec![Op::RemoveObject(object), Op::RemovePlace(place_b)]),
            _ => Op::RemoveRoomEdge(room, room_b),
        },
    }
}

pub fn ops() -> impl Strategy<Value = Vec<Op>> {
    prop::collection::vec((any::<u8>(), 0..12_u64, 0..12_u64, -3.0..3.0_f64), 0..60)
        .prop_map(|list| list.into_iter().map(|(kind, a, b, x)| op(kind, a, b, x)).collect())
}

/// A graph made by random ops; those that are refused are skipped.
pub fn graphs() -> impl Strategy<Value = SceneGraph> {
    ops().prop_map(|ops| {
        let mut graph = SceneGraph::new();
        ops.into_iter().for_each(|op| drop(graph.apply(op)));
        graph
    })
}
