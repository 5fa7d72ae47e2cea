//! Laws of what moves: corrected trajectories carry everything along, movers keep their identity and their history.

mod support;

use dsg::{
    Aabb, AgentPose, CorrectionError, MoverConfig, MoverEvidence, ObjectId, Op, PoseCorrection, Presence, SceneGraph,
    correct_poses, forget_movers, observe_movers,
};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use support::graphs::graphs;

fn poses(way: impl Fn(f64) -> Isometry3<f64>) -> Vec<AgentPose> {
    (0..200).map(|k| AgentPose { stamp_ns: k * 100_000_000, world_from_body: way(k as f64 * 0.1) }).collect()
}

/// A walk along x, half a metre a second.
fn walk(t: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.5 * t, 0.3 * (t * 0.7).sin(), 0.5), Vector3::z() * 0.2 * t.sin())
}

fn rigid(x: f64, y: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(x, y, 0.3), UnitQuaternion::from_euler_angles(0.02, -0.01, yaw))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn a_correction_that_is_the_same_for_all_poses_is_that_rigid_motion(
        graph in graphs(), x in -3.0..3.0_f64, y in -3.0..3.0_f64, yaw in -1.0..1.0_f64,
    ) {
        let motion = rigid(x, y, yaw);
        let correction = PoseCorrection::new(&poses(walk), &poses(|t| motion * walk(t))).unwrap();
        let mut mesh: Vec<[f32; 3]> = graph.objects().map(|object| object.centroid.cast::<f32>().into()).collect();
        let (mut corrected, mut turned) = (graph.clone(), graph.clone());
        let before = graph.snapshot();
        let event = correct_poses(&mut corrected, &mut mesh, &correction).unwrap();
        turned.apply(Op::Transform(motion)).unwrap();
        let close = |a: &Point3<f64>, b: &Point3<f64>| (a - b).norm() < 1e-9;
        for (a, b) in corrected.objects().zip(turned.objects()) {
            prop_assert!(close(&a.bounds.min, &b.bounds.min) && close(&a.bounds.max, &b.bounds.max));
            for (a, b) in a.trajectory.iter().zip(&b.trajectory) {
                prop_assert!(close(&a.position, &b.position));
            }
        }
        prop_assert!(corrected.places().zip(turned.places()).all(|(a, b)| close(&a.position, &b.position)));
        prop_assert!(corrected.rooms().zip(turned.rooms()).all(|(a, b)| close(&a.center, &b.center)));
        prop_assert!(corrected.room_edges().zip(turned.room_edges()).all(|(a, b)| close(&a.doorway, &b.doorway)));
        for (a, b) in corrected.agents().zip(turned.agents()) {
            for (a, b) in a.trajectory.iter().zip(&b.trajectory) {
                prop_assert!((a.world_from_body.inverse() * b.world_from_body).translation.vector.norm() < 1e-9);
            }
        }
        // The mesh goes where the boxes go.
        for (object, vertex) in corrected.objects().zip(&mesh) {
            prop_assert!((object.centroid.cast::<f32>() - Point3::from(*vertex)).norm() < 1e-4);
        }
        prop_assert_eq!(corrected.check_invariants(), Ok(()));
        corrected.apply(event.inverse()).unwrap();
        prop_assert!(corrected.has_same_content(&before));
    }

    #[test]
    fn what_is_near_stays_together_and_moves_no_more_than_the_poses(
        at in prop::array::uniform3(-4.0..12.0_f64), beside in prop::array::uniform3(-0.05..0.05_f64), drift in -0.5..0.5_f64,
    ) {
        // A drift that grows along the way.
        let correction = PoseCorrection::new(&poses(walk), &poses(|t| {
            Isometry3::translation(0.0, drift * t / 20.0, 0.0) * walk(t)
        })).unwrap();
        let (a, b) = (Point3::from(at), Point3::from(at) + Vector3::from(beside));
        let ((to_a, _), (to_b, _)) = (correction.moved(&a), correction.moved(&b));
        prop_assert!((to_a - a).norm() <= drift.abs() + 1e-9);
        // At most a tenth of the distance is stretched: a mug does not leave its table.
        prop_assert!(((to_a - to_b) - (a - b)).norm() <= 0.3 * drift.abs() * (a - b).norm() + 1e-12);
        let bounds = Aabb::from_center(a, Vector3::repeat(0.2));
        prop_assert!((correction.moved_box(&bounds).center() - to_a).norm() < 1e-9);
    }

    #[test]
    fn corrected_poses_are_the_new_ones(seed in 0.0..1.0_f64) {
        let new = |t: f64| Isometry3::new(Vector3::new(0.1 * (t + seed).sin(), 0.05 * t, 0.0), Vector3::z() * 0.03 * t) * walk(t);
        let correction = PoseCorrection::new(&poses(walk), &poses(new)).unwrap();
        for (k, pose) in poses(walk).iter().enumerate() {
            let moved = correction.motion_at(pose.stamp_ns) * pose.world_from_body;
            let error = moved.inverse() * new(k as f64 * 0.1);
            prop_assert!(error.translation.vector.norm() < 1e-7, "pose {k}: {error}");
            prop_assert!(error.rotation.imag().norm() < 1e-7, "pose {k}: {error}");
        }
    }
}

#[test]
fn the_part_of_a_walk_before_the_drift_stays_where_it_is() {
    let late = |t: f64| Isometry3::translation(0.0, if t > 15.0 { 0.4 } else { 0.0 }, 0.0) * walk(t);
    let correction = PoseCorrection::new(&poses(walk), &poses(late)).unwrap();
    assert!((correction.moved(&Point3::new(1.0, 0.5, 0.0)).0.y - 0.5).abs() < 1e-6);
    assert!((correction.moved(&Point3::new(9.8, 0.5, 0.0)).0.y - 0.9).abs() < 0.02);
}

#[test]
fn trajectories_that_make_no_correction_are_refused() {
    let good = poses(walk);
    assert_eq!(PoseCorrection::new(&[], &good), Err(CorrectionError::Empty("old")));
    assert_eq!(PoseCorrection::new(&good, &[]), Err(CorrectionError::Empty("new")));
    let mut bad = good.clone();
    bad[3].world_from_body.translation.x = f64::NAN;
    assert_eq!(PoseCorrection::new(&good, &bad), Err(CorrectionError::Pose { which: "new", index: 3 }));
    let later: Vec<AgentPose> =
        good.iter().map(|pose| AgentPose { stamp_ns: pose.stamp_ns + 1_000_000_000_000, ..*pose }).collect();
    assert_eq!(PoseCorrection::new(&good, &later), Err(CorrectionError::Apart));
}

fn person(t: f64, at: [f64; 2], track: Option<u64>) -> MoverEvidence {
    let middle = Point3::new(at[0], at[1], 0.9);
    MoverEvidence {
        stamp_ns: (t * 1e9) as i64,
        label: "person".into(),
        score: 0.9,
        bounds: Aabb::from_center(middle, Vector3::new(0.5, 0.5, 1.8)),
        track,
    }
}

#[test]
fn two_people_who_pass_each_other_stay_two_people() {
    let mut graph = SceneGraph::new();
    for k in 0..100 {
        let t = k as f64 * 0.2;
        // Half a metre beside each other when they meet.
        let frame = [person(t, [0.5 * t, 0.0], None), person(t, [10.0 - 0.5 * t, 0.5], None)];
        observe_movers(&mut graph, &frame, &MoverConfig::default()).unwrap();
    }
    let people: Vec<_> = graph.objects().collect();
    assert_eq!(people.len(), 2);
    assert!(people.iter().all(|person| person.trajectory.len() == 100 && person.is_dynamic() && person.confirmed));
    let y: Vec<f64> =
        people.iter().map(|person| person.trajectory.iter().map(|p| p.position.y).sum::<f64>() / 100.0).collect();
    assert!((y[0] - 0.0).abs() < 1e-9 && (y[1] - 0.5).abs() < 1e-9, "{y:?}: nobody became the other");
    graph.check_invariants().unwrap();
}

#[test]
fn who_comes_back_has_two_stretches_and_who_cannot_have_walked_there_is_another() {
    let mut graph = SceneGraph::new();
    let config = MoverConfig::default();
    let mut see =
        |t: f64, at: [f64; 2]| observe_movers(&mut graph, &[person(t, at, None)], &config).unwrap()[0].unwrap();
    let first = see(0.0, [0.0, 0.0]);
    assert_eq!(see(0.5, [0.3, 0.0]), first);
    assert_eq!(see(12.0, [3.0, 0.0]), first);
    assert_ne!(see(12.5, [9.0, 0.0]), first);
    assert_ne!(see(60.0, [3.0, 0.0]), first, "half a minute later nobody knows");
    let presence = graph.object(first).unwrap().presence();
    let second = 1_000_000_000;
    assert_eq!(
        presence,
        [Presence { first_ns: 0, last_ns: second / 2 }, Presence { first_ns: 12 * second, last_ns: 12 * second }]
    );
}

#[test]
fn who_was_not_seen_for_so_long_that_nobody_would_know_him_is_forgotten_and_nothing_else_is() {
    let config = MoverConfig::default();
    let mut graph = SceneGraph::new();
    let chair = dsg::Object::new(ObjectId(0), "chair", Aabb::from_center(Point3::origin(), Vector3::repeat(0.5)));
    graph.apply(Op::PutObject(Box::new(chair))).unwrap();
    observe_movers(&mut graph, &[person(0.0, [0.0, 0.0], None)], &config).unwrap();
    observe_movers(&mut graph, &[person(10.0, [50.0, 0.0], None)], &config).unwrap();
    let stamp = |seconds: f64| (seconds * 1e9) as i64;
    assert_eq!(forget_movers(&mut graph, stamp(30.0), &config).unwrap(), 0, "he might come back");
    assert_eq!(forget_movers(&mut graph, stamp(31.0), &config).unwrap(), 1);
    assert_eq!(forget_movers(&mut graph, stamp(31.0), &config).unwrap(), 0);
    assert_eq!(graph.objects().count(), 2, "the chair, and who was seen ten seconds later");
    assert_eq!(forget_movers(&mut graph, stamp(1000.0), &config).unwrap(), 1);
    assert_eq!(graph.objects().map(|object| object.label.as_str()).collect::<Vec<_>>(), ["chair"]);
    graph.check_invariants().unwrap();
}

#[test]
fn a_number_decides_between_two_and_bad_views_are_nothing() {
    let mut graph = SceneGraph::new();
    let config = MoverConfig::default();
    let frame = [person(0.0, [0.0, 0.0], Some(7)), person(0.0, [0.6, 0.0], Some(8))];
    let ids = observe_movers(&mut graph, &frame, &config).unwrap();
    // They change places between two frames: by place alone nobody could tell.
    let frame = [person(0.5, [0.0, 0.0], Some(8)), person(0.5, [0.6, 0.0], Some(7))];
    assert_eq!(observe_movers(&mut graph, &frame, &config).unwrap(), [ids[1], ids[0]]);
    let mut nan = person(0.7, [0.0, 0.0], None);
    nan.bounds.max.x = f64::NAN;
    let nameless = MoverEvidence { label: " ".into(), ..person(0.7, [0.0, 0.0], None) };
    assert_eq!(observe_movers(&mut graph, &[nan, nameless], &config).unwrap(), [None::<ObjectId>; 2]);
    let broken = MoverConfig { max_speed_m_s: f64::NAN, ..config };
    assert!(observe_movers(&mut graph, &[], &broken).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    #[test]
    fn a_trajectory_is_bounded_in_order_and_ends_where_the_mover_is(steps in prop::collection::vec(-0.2..0.2_f64, 10..300)) {
        let mut graph = SceneGraph::new();
        let config = MoverConfig { max_points: 32, ..MoverConfig::default() };
        let mut x = 0.0;
        for (k, step) in steps.iter().enumerate() {
            x += step;
            observe_movers(&mut graph, &[person(k as f64 * 0.1, [x, 0.0], None)], &config).unwrap();
        }
        prop_assert_eq!(graph.objects().count(), 1);
        let mover = graph.objects().next().unwrap();
        prop_assert!(mover.trajectory.len() <= 32);
        prop_assert!(mover.trajectory.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns));
        prop_assert_eq!(mover.trajectory[0].stamp_ns, 0);
        prop_assert_eq!(mover.trajectory.last().unwrap().position, mover.centroid);
        prop_assert_eq!(graph.check_invariants(), Ok(()));
    }
}
