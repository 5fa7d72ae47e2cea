//! Laws of the crate, one module per concept.

mod support;

use std::collections::BTreeMap;

use dsg::{Aabb, Object, ObjectId, Op, PlaceId, Relation, RelationKind, Room, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3, Vector3};
use proptest::prelude::*;
use support::graphs::{graphs, ops};

/// A failing case is printed and then becomes a named test; no file of seeds.
fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases) }
}

mod ops {
    use super::*;

    proptest! {
        #![proptest_config(super::cases(64))]

        #[test]
        fn every_op_keeps_the_invariants_or_changes_nothing(ops in super::ops()) {
            let mut graph = SceneGraph::new();
            for op in ops {
                let before = graph.clone();
                match graph.apply(op) {
                    Ok(event) => prop_assert_eq!(
                        graph.revision(),
                        before.revision() + u64::from(!event.changes.is_empty())
                    ),
                    Err(_) => {
                        prop_assert!(graph.has_same_content(&before));
                        prop_assert_eq!(graph.revision(), before.revision());
                    }
                }
                prop_assert_eq!(graph.check_invariants(), Ok(()));
            }
        }

        #[test]
        fn undo_undoes_and_replay_repeats(ops in super::ops()) {
            let mut graph = SceneGraph::new();
            let mut states = vec![graph.clone()];
            for op in ops {
                if graph.apply(op).is_ok_and(|event| !event.changes.is_empty()) {
                    states.push(graph.clone());
                }
            }
            let events = graph.changes_since(0).to_vec();
            prop_assert_eq!(events.len(), states.len() - 1);

            let mut replica = SceneGraph::new();
            for (event, state) in events.iter().zip(&states[1..]) {
                replica.apply(event.replay()).unwrap();
                prop_assert!(replica.has_same_content(state));
                prop_assert_eq!(replica.revision(), state.revision());
            }
            for (event, state) in events.iter().zip(&states).rev() {
                graph.apply(event.inverse()).unwrap();
                prop_assert!(graph.has_same_content(state));
                prop_assert_eq!(graph.check_invariants(), Ok(()));
            }
        }

        #[test]
        fn ids_are_never_offered_twice(ops in super::ops()) {
            let mut graph = SceneGraph::new();
            let mut given = std::collections::BTreeSet::new();
            for op in ops {
                drop(graph.apply(op));
                given.extend(graph.objects().map(|object| object.id));
                prop_assert!(!given.contains(&graph.next_object_id()));
            }
        }
    }
}

mod files {
    use super::*;

    proptest! {
        #![proptest_config(super::cases(64))]

        #[test]
        fn load_undoes_save_and_saves_the_same_bytes(graph in super::graphs()) {
            let bytes = dsg::graph_to_json(&graph);
            let loaded = dsg::graph_from_json(&bytes).unwrap();
            prop_assert!(loaded.has_same_content(&graph));
            prop_assert_eq!(loaded.revision(), graph.revision());
            prop_assert_eq!(loaded.next_object_id(), graph.next_object_id());
            prop_assert_eq!(loaded.check_invariants(), Ok(()));
            prop_assert_eq!(dsg::graph_to_json(&loaded), bytes);
        }

        #[test]
        fn the_log_survives_the_file(graph in super::graphs()) {
            let mut loaded = dsg::graph_from_json(&dsg::graph_to_json(&graph)).unwrap();
            dsg::oplog::read_log(&mut loaded, &dsg::oplog::log_to_lines(&graph)).unwrap();
            prop_assert_eq!(loaded.changes_since(0), graph.changes_since(0));
            prop_assert_eq!(loaded.check_invariants(), Ok(()));
        }

        #[test]
        fn no_damage_of_a_file_panics_or_makes_a_broken_graph(
            graph in super::graphs(),
            cut in any::<prop::sample::Index>(),
            hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        ) {
            let mut bytes = dsg::graph_to_json(&graph);
            prop_assert!(dsg::graph_from_json(&bytes[..cut.index(bytes.len() - 2)]).is_err());
            for (at, value) in hits {
                let at = at.index(bytes.len());
                bytes[at] = b"0123456789-.,:\"{}[]ne"[usize::from(value) % 21];
            }
            if let Ok(graph) = dsg::graph_from_json(&bytes) {
                prop_assert_eq!(graph.check_invariants(), Ok(()));
            }
        }
    }
}

mod votes {
    use super::*;

    proptest! {
        #![proptest_config(super::cases(64))]

        #[test]
        fn the_order_of_merges_does_not_matter(
            labels in prop::collection::vec((0..4_usize, 0.0..1.0_f64, 0.0..1.0_f64), 2..7),
            order in any::<prop::sample::Index>(),
        ) {
            let names = ["chair", "stool", "table", "desk"];
            let merge_all = |order: &[usize]| {
                let mut graph = SceneGraph::new();
                for (at, (label, share, weight)) in labels.iter().enumerate() {
                    let mut object = Object::new(ObjectId(at as u64), names[*label], Aabb::at(Point3::origin()));
                    object.votes = BTreeMap::new();
                    let weights = [(names[*label].to_owned(), *share), ("thing".to_owned(), 1.0 - share)];
                    dsg::vote::add_votes(&mut object.votes, &weights, *weight);
                    graph.apply(Op::PutObject(Box::new(object))).unwrap();
                }
                for pair in order.windows(2) {
                    let (from, into) = (ObjectId(pair[0] as u64), ObjectId(pair[1] as u64));
                    graph.apply(Op::MergeObjects { from, into }).unwrap();
                }
                let left = graph.objects().next().unwrap().clone();
                (left.votes, left.label, left.label_margin, left.observations)
            };
            let straight: Vec<usize> = (0..labels.len()).collect();
            let mut turned = straight.clone();
            turned.rotate_left(order.index(labels.len()));
            turned.reverse();
            prop_assert_eq!(merge_all(&straight), merge_all(&turned));
        }

        #[test]
        fn the_margin_is_a_share_and_the_winner_has_most(votes in prop::collection::btree_map("[a-d]", 0.0..9.0_f64, 0..5)) {
            let (label, margin) = dsg::vote::winner(&votes);
            prop_assert!((0.0..=1.0).contains(&margin));
            let most = votes.values().copied().fold(0.0, f64::max);
            prop_assert_eq!(votes.get(&label).copied().unwrap_or(0.0), most);
        }
    }
}

mod association {
    use super::*;
    use crate::support::{Trouble, USUAL, Walk, thing};

    proptest! {
        #![proptest_config(super::cases(12))]

        #[test]
        fn a_static_thing_is_one_object_whatever_the_noise_and_the_labels(
            sides in [0.06..2.0_f64, 0.06..1.0_f64, 0.06..1.8_f64],
            confusion in 0.0..0.4_f64,
            noise_m in 0.0..0.025_f64,
            seed in any::<u64>(),
        ) {
            let things = vec![thing("cabinet", "fridge", [4.0, 3.6, 0.7], sides)];
            // Half a minute and 21 m of path: 0.1 m of drift.
            let trouble = Trouble { confusion, noise_m, drift_m: 0.1, ..USUAL };
            let walk = Walk { things, trouble, frames: 60, seed };
            let mut graph = SceneGraph::new();
            let config = dsg::AssociationConfig::default();
            for frame in 0..walk.frames {
                dsg::observe_objects(&mut graph, &walk.frame(frame).0, &config).unwrap();
                prop_assert!(graph.objects().count() <= 1, "frame {}: {:?}", frame,
                    graph.objects().map(|o| (o.id, o.bounds)).collect::<Vec<_>>());
            }
        }

        #[test]
        fn remembered_points_are_found_as_by_brute_force(
            known in prop::collection::vec([-0.3..0.3_f32, -0.3..0.3_f32, -0.3..0.3_f32], 1..80),
            asked in prop::collection::vec([-0.4..0.4_f64, -0.4..0.4_f64, -0.4..0.4_f64], 1..30),
            reach_m in 0.005..0.05_f64,
        ) {
            let known: Vec<Point3<f32>> = known.into_iter().map(Point3::from).collect();
            let asked: Vec<Point3<f64>> = asked.into_iter().map(Point3::from).collect();
            let mut memory = dsg::memory::ObjectMemory::default();
            memory.absorb(&known, 0);
            let points = memory.points();
            let is_near = |p: &&Point3<f64>| {
                let (p, reach) = (p.cast::<f32>(), reach_m as f32);
                points.iter().any(|q| (q.cast::<f32>() - p).norm_squared() <= reach * reach)
            };
            let brute = asked.iter().filter(is_near).count() as f64 / asked.len() as f64;
            prop_assert_eq!(memory.overlap(&asked, reach_m), brute);
        }
    }
}

mod rooms {
    use super::*;
    use dsg::{PlaceState, PlaceUpdate, RoomConfig, RoomPart, update_places, update_rooms};

    /// A row of `lengths.len()` rooms of places 1 m apart.
    fn row(lengths: &[usize]) -> (SceneGraph, Vec<RoomPart>) {
        let mut graph = SceneGraph::new();
        let mut parts = Vec::new();
        let mut next = 0;
        for length in lengths {
            let places: Vec<PlaceId> = (next..next + *length as u64).map(PlaceId).collect();
            let put = places.iter().map(|id| PlaceState {
                id: *id,
                position: Point3::new(id.0 as f64, 0.0, 1.0),
                clearance_m: 0.8,
                basis_points: 3,
                frontier_cells: 0,
            });
            update_places(&mut graph, &PlaceUpdate { put: put.collect(), ..PlaceUpdate::default() }).unwrap();
            let center = Point3::new(next as f64 + *length as f64 / 2.0, 0.0, 1.0);
            parts.push(RoomPart { places, center, area_m2: *length as f64, floor: 0 });
            next += *length as u64;
        }
        (graph, parts)
    }

    fn nowhere(_: &Point3<f64>) -> Option<usize> {
        None
    }

    proptest! {
        #![proptest_config(super::cases(64))]

        #[test]
        fn rooms_keep_their_ids_whatever_the_order_of_the_parts(
            lengths in prop::collection::vec(1..9_usize, 1..7),
            turn in any::<prop::sample::Index>(),
        ) {
            let (mut graph, mut parts) = row(&lengths);
            let config = RoomConfig::default();
            let first = update_rooms(&mut graph, &parts, &[], &nowhere, &config).unwrap();
            prop_assert_eq!(graph.check_invariants(), Ok(()));
            let revision = graph.revision();
            let turn = turn.index(parts.len());
            parts.rotate_left(turn);
            let second = update_rooms(&mut graph, &parts, &[], &nowhere, &config).unwrap();
            let mut expected = first.room_of.clone();
            expected.rotate_left(turn);
            prop_assert_eq!(second.room_of, expected);
            prop_assert_eq!(graph.revision(), revision);
        }

        #[test]
        fn a_room_that_loses_a_third_of_its_places_and_grows_keeps_its_id(length in 3..12_usize, more in 0..30_u64) {
            let (mut graph, mut parts) = row(&[length, 4]);
            let config = RoomConfig::default();
            let first = update_rooms(&mut graph, &parts, &[], &nowhere, &config).unwrap();
            let gone: Vec<PlaceId> = (0..length as u64 / 3).map(PlaceId).collect();
            let new: Vec<PlaceState> = (100..100 + more)
                .map(|id| PlaceState {
                    id: PlaceId(id),
                    position: Point3::new(0.0, id as f64, 1.0),
                    clearance_m: 0.5,
                    basis_points: 3,
                    frontier_cells: 1,
                })
                .collect();
            parts[0].places.retain(|place| !gone.contains(place));
            parts[0].places.extend(new.iter().map(|place| place.id));
            update_places(&mut graph, &PlaceUpdate { put: new, removed: gone, ..PlaceUpdate::default() }).unwrap();
            let second = update_rooms(&mut graph, &parts, &[], &nowhere, &config).unwrap();
            prop_assert_eq!(first.room_of, second.room_of);
            prop_assert_eq!(graph.check_invariants(), Ok(()));
        }
    }

    #[test]
    fn a_users_name_survives_splitting_and_merging() {
        let (mut graph, parts) = row(&[6, 4]);
        let config = RoomConfig::default();
        let ids = update_rooms(&mut graph, &parts, &[], &nowhere, &config).unwrap().room_of;
        graph.apply(Op::NameRoom(ids[0], "Ada's room".to_owned())).unwrap();
        // Split off two places, then join everything.
        let part = |places: std::ops::Range<u64>| RoomPart {
            places: places.map(PlaceId).collect(),
            center: Point3::new(1.0, 0.0, 1.0),
            area_m2: 1.0,
            floor: 0,
        };
        let split = update_rooms(&mut graph, &[part(4..6), part(0..4), part(6..10)], &[], &nowhere, &config).unwrap();
        assert_eq!(split.room_of[1..], ids[..]);
        assert_eq!(graph.room(ids[0]).unwrap().name, "Ada's room");
        let joined = update_rooms(&mut graph, &[part(0..10)], &[], &nowhere, &config).unwrap();
        assert_eq!(joined.removed.len(), 2);
        graph.check_invariants().unwrap();
    }

    #[test]
    fn contents_name_rooms_and_a_second_bedroom_is_numbered() {
        let (mut graph, parts) = row(&[4, 4, 4]);
        let in_part = |p: &Point3<f64>| Some((p.x / 4.0).floor().clamp(0.0, 2.0) as usize);
        for (id, label, x) in [(1, "stove", 1.0), (2, "fridge", 2.0), (3, "bed", 5.0), (4, "bed", 9.0)] {
            let object = Object::new(ObjectId(id), label, Aabb::at(Point3::new(x, 0.0, 0.5)));
            graph.apply(Op::PutObject(Box::new(object))).unwrap();
        }
        let doors = [(0, 1, Point3::new(4.0, 0.0, 1.0), 0.9), (1, 0, Point3::new(4.0, 1.0, 1.0), 0.7)];
        update_rooms(&mut graph, &parts, &doors, &in_part, &RoomConfig::default()).unwrap();
        let names: Vec<&str> = graph.rooms().map(|room| room.name.as_str()).collect();
        assert_eq!(names, ["kitchen", "bedroom", "bedroom 2"]);
        assert_eq!(graph.room_edges().map(|edge| edge.width_m).collect::<Vec<_>>(), [0.9]);
        assert_eq!(graph.object(ObjectId(3)).unwrap().room, Some(RoomId(2)));
        assert_eq!(graph.buildings().next().unwrap().rooms.len(), 3);
        // Without its bed the second room is doubtful, but the third does not take its name back and forth.
        graph.apply(Op::RemoveObject(ObjectId(3))).unwrap();
        update_rooms(&mut graph, &parts, &doors, &in_part, &RoomConfig::default()).unwrap();
        let names: Vec<&str> = graph.rooms().map(|room| room.name.as_str()).collect();
        assert_eq!(names, ["kitchen", "room 2", "bedroom 2"]);
    }
}

mod relations {
    use super::*;
    use dsg::{GroupConfig, RelationConfig, update_groups, update_relations};

    fn scene() -> impl Strategy<Value = SceneGraph> {
        let boxes =
            ([0.0..6.0_f64, 0.0..6.0_f64, 0.0..1.5_f64], [0.05..1.5_f64, 0.05..1.5_f64, 0.05..1.5_f64], 0..6_usize);
        prop::collection::vec(boxes, 0..25).prop_map(|boxes| {
            let mut graph = SceneGraph::new();
            graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::origin())))).unwrap();
            for (at, (center, sides, label)) in boxes.into_iter().enumerate() {
                let label = ["chair", "table", "mug", "shelf", "lamp", "book"][label];
                let bounds = Aabb::from_center(Point3::from(center), Vector3::from(sides));
                let object = Object { room: Some(RoomId(1)), ..Object::new(ObjectId(at as u64 + 1), label, bounds) };
                graph.apply(Op::PutObject(Box::new(object))).unwrap();
            }
            graph
        })
    }

    fn all(graph: &SceneGraph) -> Vec<Relation> {
        graph.relations().chain(graph.dropped_relations()).copied().collect()
    }

    proptest! {
        #![proptest_config(super::cases(64))]

        #[test]
        fn an_update_after_an_update_changes_nothing(mut graph in scene()) {
            let wall = |a: &Point3<f64>, b: &Point3<f64>| ((a.x - 3.0) * (b.x - 3.0) < 0.0).then(|| nalgebra::center(a, b));
            let yes = |_: &Object, _: &Object, _: RelationKind| 1.0;
            update_relations(&mut graph, &wall, &yes, &RelationConfig::default()).unwrap();
            prop_assert_eq!(graph.check_invariants(), Ok(()));
            let (revision, before) = (graph.revision(), all(&graph));
            update_relations(&mut graph, &wall, &yes, &RelationConfig::default()).unwrap();
            prop_assert_eq!(all(&graph), before);
            prop_assert_eq!(graph.revision(), revision);
        }

        #[test]
        fn the_order_of_ids_does_not_decide_what_is_near(graph in scene()) {
            // The set of near pairs equals brute force over boxes, contact and vertical relations aside.
            let mut graph = graph;
            let clear = |_: &Point3<f64>, _: &Point3<f64>| None;
            let yes = |_: &Object, _: &Object, _: RelationKind| 1.0;
            let config = RelationConfig { max_near: 1000, ..RelationConfig::default() };
            update_relations(&mut graph, &clear, &yes, &config).unwrap();
            let objects: Vec<Object> = graph.objects().cloned().collect();
            for (at, a) in objects.iter().enumerate() {
                for b in &objects[at + 1..] {
                    let related = graph.relations_of(a.id).any(|r| [r.subject, r.object].contains(&b.id));
                    prop_assert!(related || a.bounds.gap_m(&b.bounds) > config.near_m, "{} {}", a.id, b.id);
                }
            }
        }

        #[test]
        fn groups_are_of_one_room_small_and_stable(mut graph in scene()) {
            update_groups(&mut graph, &GroupConfig::default()).unwrap();
            prop_assert_eq!(graph.check_invariants(), Ok(()));
            for group in graph.groups() {
                prop_assert!(group.support.is_some());
                let bounds = group.members.iter().map(|id| graph.object(*id).unwrap().bounds);
                let sides = bounds.reduce(|a, b| a.union(&b)).unwrap().sides_m();
                prop_assert!(sides.x.hypot(sides.y) <= GroupConfig::default().max_extent_m);
            }
            let mut names: Vec<&str> = graph.groups().map(|group| group.name.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            prop_assert_eq!(names.len(), graph.groups().count());
        }

        #[test]
        fn a_rigid_motion_there_and_back_is_none(graph in super::graphs(), x in -5.0..5.0_f64, turn in -3.0..3.0_f64) {
            let mut moved = graph.clone();
            // A quarter turn keeps axis-aligned boxes as they are; other turns may only make them larger.
            let motion = Isometry3::new(Vector3::new(x, 1.0, 0.2), Vector3::z() * turn);
            if moved.apply(Op::Transform(motion)).is_ok() {
                moved.apply(Op::Transform(motion.inverse())).unwrap();
                for (a, b) in graph.objects().zip(moved.objects()) {
                    prop_assert!((a.centroid - b.centroid).norm() < 1e-9);
                    prop_assert!(b.bounds.inflated(1e-9).contains(&a.bounds.min));
                }
                for (a, b) in graph.places().zip(moved.places()) {
                    prop_assert!((a.position - b.position).norm() < 1e-9);
                }
            }
        }
    }
}
