//! Laws of gates: straight legs through what is too narrow to turn in.
#![cfg(feature = "ground")]

mod support;

use nalgebra::Point2;
use planner::{Route, VisibilityGraph};
use proptest::prelude::*;
use support::Picture;
use support::clutter::{clutter, place};

/// Room to turn, and room to pass straight.
const TURN_M: f64 = 0.33;
const PASS_M: f64 = 0.24;

/// The least distance of a leg from the blocked squares, measured every centimetre.
fn room_of(picture: &Picture, leg: &[Point2<f64>]) -> f64 {
    let n = ((leg[1] - leg[0]).norm() / 0.01).ceil().max(1.0) as usize;
    (0..=n)
        .map(|k| picture.distance(&(leg[0] + (leg[1] - leg[0]) * (k as f64 / n as f64))))
        .fold(f64::INFINITY, f64::min)
}

/// Every leg has room to turn, or its ends have and it has room to pass.
fn check(picture: &Picture, route: &Route) {
    for leg in route.points.windows(2) {
        let room = room_of(picture, leg);
        if room < TURN_M - 1e-6 {
            assert!(room >= PASS_M - 1e-6, "{room} m of room on {leg:?}");
            for end in leg {
                assert!(picture.distance(end) >= TURN_M - 1e-6, "no room to turn at {end:?}");
            }
        }
    }
}

/// Two rooms of 2 x 4 m and a wall between, with a door of so many cells.
fn two_rooms(cells: u32, y: f64) -> Picture {
    let mut picture = Picture::free(4.0, 4.0, 0.05);
    picture.block(2.0, 0.0, 2.12, 4.0);
    picture.fill(1.95, y, 2.2, y + 0.05 * f64::from(cells), false);
    picture
}

#[test]
fn a_narrow_door_is_passed_straight_and_a_narrower_one_refused() {
    let (start, goal) = (Point2::new(0.8, 0.8), Point2::new(3.2, 3.2));
    for shift in 0..4 {
        let y = 1.7 + 0.013 * f64::from(shift);
        // Twelve cells: at least 0.55 m.
        let picture = two_rooms(12, y);
        let wide = VisibilityGraph::build(&picture.view(), TURN_M).unwrap();
        assert!(wide.route(&start, &goal).is_none(), "too narrow to turn in");
        let graph = wide.with_gates(PASS_M);
        let route = graph.route(&start, &goal).expect("wide enough to pass");
        check(&picture, &route);
        // Straight: across the wall it runs within 15 degrees of its normal.
        let leg = route.points.windows(2).find(|leg| (leg[0].x - 2.06) * (leg[1].x - 2.06) < 0.0).unwrap();
        assert!((leg[1].y - leg[0].y).abs() < 0.27 * (leg[1].x - leg[0].x).abs(), "{leg:?}");
        assert!(graph.lengths_from(&start, &[goal])[0].is_some());
        assert_eq!(graph.nearest_reachable(&start, &goal), Some((goal, 0.0)));
        // From the middle of the door both rooms are near.
        let middle = leg[0] + (leg[1] - leg[0]) * 0.5;
        for end in [start, goal] {
            let out = graph.route(&middle, &end).expect("out of the door");
            assert!(out.start_pull_m < 0.05 && out.length_m < (end - middle).norm() + 0.6);
        }
        // Eight cells: at most 0.45 m.
        let picture = two_rooms(8, y);
        assert!(
            VisibilityGraph::build(&picture.view(), TURN_M).unwrap().with_gates(PASS_M).route(&start, &goal).is_none()
        );
    }
}

#[test]
fn a_dog_leg_too_narrow_to_turn_in_is_no_gate() {
    // A passage of 0.55 m with a right angle in it.
    let mut picture = Picture::free(6.0, 4.0, 0.05);
    picture.block(2.0, 0.0, 4.0, 4.0);
    picture.fill(1.95, 1.0, 3.25, 1.55, false);
    picture.fill(2.7, 1.0, 3.25, 3.0, false);
    picture.fill(2.7, 2.45, 4.05, 3.0, false);
    let graph = VisibilityGraph::build(&picture.view(), TURN_M).unwrap().with_gates(PASS_M);
    assert!(graph.route(&Point2::new(1.0, 2.0), &Point2::new(5.0, 2.0)).is_none());
}

#[test]
fn two_narrow_doors_one_after_the_other() {
    let mut picture = Picture::free(6.0, 4.0, 0.05);
    for x in [2.0, 4.0] {
        picture.block(x, 0.0, x + 0.12, 4.0);
        picture.fill(x - 0.05, 0.5 * x, x + 0.2, 0.5 * x + 0.6, false);
    }
    let graph = VisibilityGraph::build(&picture.view(), TURN_M).unwrap().with_gates(PASS_M);
    assert_eq!(graph.gates().len(), 2);
    check(&picture, &graph.route(&Point2::new(1.0, 3.0), &Point2::new(5.0, 1.0)).unwrap());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn gates_open_ways_and_close_none(picture in clutter(2..12, 1.8), start in place(), goal in place()) {
        let wide = VisibilityGraph::build(&picture.view(), TURN_M).unwrap();
        let graph = wide.clone().with_gates(PASS_M);
        for [a, b] in graph.gates() {
            prop_assert!(wide.route(&a, &b).is_none(), "there is a wider way");
            prop_assert!(room_of(&picture, &[a, b]) >= PASS_M - 1e-6);
        }
        let (before, after) = (wide.route(&start, &goal), graph.route(&start, &goal));
        if let Some(before) = &before && before.start_pull_m == 0.0 {
            let after = after.as_ref().expect("a way stays a way");
            // Bends of both are moved for comfort.
            prop_assert!(after.length_m <= before.length_m + 1.0);
        }
        // Only what started with room to turn is promised room to turn.
        if let Some(after) = &after && after.start_pull_m == 0.0 {
            check(&picture, after);
        }
        prop_assert_eq!(graph.lengths_from(&start, &[goal])[0].is_some(), after.is_some());
        if let Some((point, _)) = graph.nearest_reachable(&start, &goal) {
            prop_assert!(graph.route(&start, &point).is_some());
        }
    }
}
