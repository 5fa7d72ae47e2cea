//! What the referee promises, and what a bench draws.

mod support;

use std::collections::BTreeMap;

use arena::bench_nav::kind_word;
use arena::buildings::Buildings;
use arena::mission::robot_model::RobotKind;
use arena::referee::{Referee, VIEW_DISTANCE_M};
use arena::scenario::{Scene, draw_scenario, robot_truth};
use arena::task::{StepTruth, Task, TaskError};
use nalgebra::{Isometry3, Point2};
use support::{robot, scene};

/// Flight height of a mission by default.
const FLIGHT_HEIGHT_M: f64 = 1.2;
/// Points are cells: middles are at most half a diagonal of 5 cm away from what they stand for.
const CELL_TOL_M: f64 = 0.036;

const KINDS: [RobotKind; 2] = [RobotKind::Ground, RobotKind::Aerial];

fn referee(scene: &Scene, kind: RobotKind) -> Referee<'_> {
    Referee::new(&scene.building, &scene.world, robot_truth(&robot(kind), FLIGHT_HEIGHT_M), 0)
}

fn standing_at(at: &Point2<f64>) -> Isometry3<f64> {
    Isometry3::translation(at.x, at.y, 0.3)
}

/// All objects of the lowest storey that this robot can look at.
fn visible_targets(scene: &Scene, referee: &Referee) -> Vec<(u32, u32, Vec<Point2<f64>>)> {
    scene
        .building
        .objects
        .iter()
        .map(|object| {
            let views = referee.view_points(object);
            (object.id, object.room, views.into_iter().map(|cell| referee.floor().center_of(cell)).collect::<Vec<_>>())
        })
        .filter(|(_, _, views)| !views.is_empty())
        .collect()
}

#[test]
fn a_robot_put_onto_a_view_point_is_done() {
    let flat = scene("flat");
    for kind in KINDS {
        let referee = referee(&flat, kind);
        let targets = visible_targets(&flat, &referee);
        assert!(targets.len() > 20, "a furnished flat has things to look at, not {}", targets.len());
        for (id, _, views) in targets {
            let step = StepTruth::Object { ids: vec![id] };
            // Judging looks for all view points anew; two of them per object are enough.
            for view in [views.first(), views.last()].into_iter().flatten() {
                assert!(referee.is_done(&step, &standing_at(view)), "{kind:?}: object {id} from its view point {view}");
            }
        }
    }
}

#[test]
fn a_robot_in_another_room_is_not_done() {
    let flat = scene("flat");
    for kind in KINDS {
        let referee = referee(&flat, kind);
        let mut judged = 0;
        for (id, home, views) in visible_targets(&flat, &referee) {
            let step = StepTruth::Object { ids: vec![id] };
            for room in flat.building.rooms.iter().filter(|room| room.id != home && room.storey == 0) {
                let rect = &room.rects[0];
                let middle = Point2::from((rect.min.coords + rect.max.coords) / 2.0);
                // Beside an open door a view point of the next room may be near; the middle of a room is far from all.
                if views.iter().any(|view| (view - middle).norm() < 0.6) {
                    continue;
                }
                judged += 1;
                assert!(
                    !referee.is_done(&step, &standing_at(&middle)),
                    "{kind:?}: object {id} from room {}",
                    room.name
                );
            }
        }
        assert!(judged > 50, "{judged}");
    }
}

#[test]
fn a_room_is_reached_inside_it_and_nowhere_else() {
    let flat = scene("flat");
    for kind in KINDS {
        let referee = referee(&flat, kind);
        for asked in &flat.building.rooms {
            let step = StepTruth::Room { ids: vec![asked.id] };
            for room in &flat.building.rooms {
                let rect = &room.rects[0];
                let middle = Point2::from((rect.min.coords + rect.max.coords) / 2.0);
                assert_eq!(
                    referee.is_done(&step, &standing_at(&middle)),
                    asked.id == room.id,
                    "{} {}",
                    asked.name,
                    room.name
                );
            }
        }
    }
}

#[test]
fn view_points_are_free_for_the_robot_and_within_one_metre_of_floor() {
    for (name, kind) in [("flat", RobotKind::Ground), ("office", RobotKind::Aerial)] {
        let scene = scene(name);
        let referee = referee(&scene, kind);
        let radius_m = robot(kind).circumscribed_radius_m;
        for object in &scene.building.objects {
            for cell in referee.view_points(object).into_iter().step_by(5) {
                let at = referee.floor().center_of(cell);
                let off_m = object.bounds.footprint().distance_m(&at);
                assert!(off_m <= VIEW_DISTANCE_M + CELL_TOL_M, "{name} {kind:?} {}: {off_m} m", object.class);
                assert!(referee.floor().clearance_m(cell) >= radius_m, "{name} {kind:?} {}", object.class);
                assert!(referee.sees_from(&at, object), "{name} {kind:?} {}: no unblocked ray", object.class);
            }
        }
    }
}

#[test]
fn the_shortest_way_from_a_view_point_is_nothing_and_to_nothing_is_none() {
    let flat = scene("flat");
    let referee = referee(&flat, RobotKind::Ground);
    for (id, _, views) in visible_targets(&flat, &referee).into_iter().step_by(7) {
        let steps = [StepTruth::Object { ids: vec![id] }];
        assert!(referee.shortest_m(&steps, &views[0]).is_some_and(|way_m| way_m < 1e-9), "object {id}");
    }
    let at = referee.floor().center_of(0);
    assert_eq!(referee.shortest_m(&[StepTruth::Object { ids: vec![] }], &at), None);
    assert!(!referee.is_done(&StepTruth::Object { ids: vec![] }, &standing_at(&at)));
}

/// Figures of 20 draws as the bench would print them.
fn check_draws(kind: RobotKind, seed: u64) {
    const RUNS: usize = 20;
    let robot = robot(kind);
    let (mut hidden, mut rivals, mut ways_m) = (0, 0, Vec::new());
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    for index in 0..RUNS {
        let drawn =
            draw_scenario(seed, index, &robot, FLIGHT_HEIGHT_M, &Buildings::default()).expect("something can be drawn");
        assert!(drawn.shortest_m.is_finite() && drawn.shortest_m > 0.0, "run {index}");
        assert!((2..=12).contains(&drawn.rooms), "run {index}: {} rooms", drawn.rooms);
        *kinds.entry(kind_word(&drawn.task)).or_default() += 1;
        hidden += usize::from(!drawn.is_target_visible);
        rivals += usize::from(drawn.has_rival);
        ways_m.push(drawn.shortest_m);
        // The drawn meaning is the one that the referee reads from the sentence.
        let read = Task::read(&drawn.task.text, &drawn.scene.building).expect("a drawn sentence can be read");
        assert_eq!(read.steps, drawn.task.steps, "run {index}: {}", drawn.task.text);
    }
    ways_m.sort_by(f64::total_cmp);
    let median_m = (ways_m[RUNS / 2 - 1] + ways_m[RUNS / 2]) / 2.0;
    println!("{kind:?} {seed}: {kinds:?} hidden {hidden} rivals {rivals} median {median_m:.1} m");
    assert_eq!(kinds.len(), 5, "{kinds:?}");
    assert!(kinds.values().all(|count| count * 100 >= 15 * RUNS), "{kinds:?}");
    assert!(hidden * 100 >= 80 * RUNS, "{hidden} of {RUNS} targets are hidden");
    assert!(rivals * 100 >= 40 * RUNS, "{rivals} of {RUNS} targets have a rival");
    assert!(median_m >= 8.0, "median shortest way {median_m:.2} m");
}

#[test]
fn ground_draws_keep_the_promised_shares() {
    for seed in 1..=3 {
        check_draws(RobotKind::Ground, seed);
    }
}

#[test]
fn aerial_draws_keep_the_promised_shares() {
    for seed in 1..=3 {
        check_draws(RobotKind::Aerial, seed);
    }
}

#[test]
fn a_sentence_beyond_the_grammar_is_refused_and_an_unknown_thing_is_a_step_without_ids() {
    let flat = scene("flat");
    let check = |text: &str, expected: Result<usize, bool>| match (Task::read(text, &flat.building), expected) {
        (Ok(task), Ok(steps)) => assert_eq!(task.steps.len(), steps, "{text}"),
        (Err(TaskError::NoGoal { .. }), Err(true)) | (Err(TaskError::Beyond { .. }), Err(false)) => {}
        (got, _) => panic!("{text}: {got:?}"),
    };
    check("find the mug near the sink", Ok(1));
    check("go to the kitchen, then find the mug", Ok(2));
    check("Go to the kitchen and then find the mug!", Ok(2));
    check("find the unicorn", Ok(1));
    check("please", Err(true));
    check("find the", Err(true));
    let unicorn = Task::read("find the unicorn", &flat.building).expect("a thing nobody knows is no bad input");
    assert_eq!(unicorn.steps, [StepTruth::Object { ids: vec![] }]);
}
