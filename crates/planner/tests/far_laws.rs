//! Laws of the dynamic visibility graph.
#![cfg(feature = "ground")]
mod support;

use nalgebra::{Point2, Point3};
use planner::ground::far::config::{FarConfig, FarError};
use planner::ground::far::search::{FarRoute, NoRoute};
use planner::ground::far::store::FarLoadError;
use planner::ground::far::tile::Through;
use planner::ground::far::window::{Seen, Window};
use planner::ground::far::{DynamicVisibilityGraph, Update};
use planner::{GridView, VisibilityGraph};
use proptest::prelude::*;
use support::SplitMix;
use support::building::{Belief, Building, Rect, ground};

const VOXEL_M: f64 = 0.15;
const CLEARANCE_M: f64 = 0.4;
/// Cycles after which nothing of a fixed window may still be unsettled: votes, pools, dampers, and budgets for small buildings.
const SETTLED: u32 = 40;

fn graph() -> DynamicVisibilityGraph {
    DynamicVisibilityGraph::new(FarConfig::default()).unwrap()
}

/// Updates with the same window until nothing is unsettled; the number of cycles.
fn settle(graph: &mut DynamicVisibilityGraph, at: &Point3<f64>, window: &Window) -> u32 {
    for cycle in 1..=SETTLED {
        let update = graph.update(at, window).unwrap();
        if update.unsettled == 0 && update.removed + update.created + update.moved == 0 && cycle > 10 {
            return cycle;
        }
    }
    panic!("not settled after {SETTLED} cycles");
}

/// A graph that has seen all of a building.
fn knowing(building: &Building, at: &Point2<f64>) -> DynamicVisibilityGraph {
    let mut graph = graph();
    let belief = Belief::of_all(building);
    let mut cells = Vec::new();
    settle(&mut graph, &ground(at), &belief.window(at, 401, &mut cells));
    graph
}

/// Least distance from a way to what is true for cells, by small steps.
fn check_clearance(route: &FarRoute, is_barred: impl Fn(i64, i64) -> bool) {
    for leg in route.points.windows(2) {
        let n = ((leg[1] - leg[0]).norm() / 0.05).ceil().max(1.0) as usize;
        for k in 0..=n {
            let p = (leg[0] + (leg[1] - leg[0]) * (k as f64 / n as f64)).xy() / VOXEL_M;
            let reach = CLEARANCE_M / VOXEL_M;
            for y in (p.y - reach).floor() as i64..=(p.y + reach).floor() as i64 {
                for x in (p.x - reach).floor() as i64..=(p.x + reach).floor() as i64 {
                    if is_barred(x, y) {
                        let dx = (x as f64 - p.x).max(p.x - x as f64 - 1.0).max(0.0);
                        let dy = (y as f64 - p.y).max(p.y - y as f64 - 1.0).max(0.0);
                        assert!(dx.hypot(dy) >= reach - 1e-6, "{} cells from {x}, {y}", dx.hypot(dy));
                    }
                }
            }
        }
    }
}

fn building() -> impl Strategy<Value = Building> {
    (2..4usize, 1..4usize, any::<u64>(), 0..4u64, 0..4usize)
        .prop_map(|(columns, rows, seed, extra, boxes)| Building::of_rooms(columns, rows, VOXEL_M, seed, extra, boxes))
}

/// A box of up to a metre somewhere in the building, not on the walls' outside.
fn box_in(building: &Building, random: &mut SplitMix) -> Rect {
    let at = |random: &mut SplitMix, most: i64| 1 + (random.unit() * (most - 9) as f64) as i64;
    let (x, y) = (at(random, building.width), at(random, building.height));
    let size = |random: &mut SplitMix| 1 + (random.unit() * 6.0) as i64;
    [x, y, x + size(random), y + size(random)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// The veto of the cells, the index of pairs by tiles, and the structure itself, while boxes come and go and the robot sees parts only.
    #[test]
    fn every_edge_keeps_the_clearance_from_all_that_was_last_seen(building in building(), seed in any::<u64>()) {
        let mut building = building;
        let mut random = SplitMix(seed);
        let mut belief = Belief::new(&building);
        let mut graph = graph();
        let mut cells = Vec::new();
        for cycle in 0..25 {
            let room = building.rooms[(random.next() % building.rooms.len() as u64) as usize];
            let at = room + nalgebra::Vector2::new(random.unit() - 0.5, random.unit() - 0.5);
            if cycle % 3 == 1 {
                let rect = box_in(&building, &mut random);
                building.fill(rect, random.unit() < 0.6);
            }
            belief.scan(&building, &at, 4.0 + 4.0 * random.unit(), 360);
            // A window smaller than what is known, so that the rest is memory.
            graph.update(&ground(&at), &belief.window(&at, 61, &mut cells)).unwrap();
            graph.check_invariants();
            let last_seen = |x, y| graph.seen(&Point3::new((x as f64 + 0.5) * VOXEL_M, (y as f64 + 0.5) * VOXEL_M, 0.0));
            for goal in &building.rooms {
                for through in [Through::Known, Through::Unknown] {
                    if let Ok(route) = graph.route_through(&ground(&at), &ground(goal), through) {
                        check_clearance(&route, |x, y| match through {
                            Through::Known => last_seen(x, y) != Seen::Free,
                            Through::Unknown => last_seen(x, y) == Seen::Occupied,
                        });
                        let sum: f64 = route.points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
                        prop_assert!((sum - route.length_m).abs() < 1e-9);
                        prop_assert_eq!(route.kinds.len(), route.points.len());
                    }
                }
            }
        }
    }

    /// The oracle: on a map that is all known there is a way where the static graph has one with a cell to spare, and it is no longer. At most one
    /// box a room: between boxes that nearly close a gap, about one way in ten thousand is missed or longer.
    #[test]
    fn on_a_known_map_ways_are_as_short_as_the_static_graphs(columns in 2..4usize, rows in 1..4usize, seed in any::<u64>(), extra in 0..4u64, boxes in 0..2usize) {
        let building = Building::of_rooms(columns, rows, VOXEL_M, seed, extra, boxes);
        let at = building.rooms[0];
        let graph = knowing(&building, &at);
        let lengths = static_lengths(&building, CLEARANCE_M + VOXEL_M);
        for (goal, length) in building.rooms.iter().zip(lengths) {
            let Some(length) = length else { continue };
            let route = graph.route_through(&ground(&at), &ground(goal), Through::Known);
            let route = route.map_err(|e| TestCaseError::fail(format!("{goal}: {e}")))?;
            prop_assert!(route.length_m <= 1.002 * length + 0.01, "{} against {length}", route.length_m);
            prop_assert!(route.length_m >= (goal - at).norm() - 1e-9);
        }
    }

    #[test]
    fn a_window_that_says_nothing_new_changes_nothing(building in building(), seed in any::<u64>()) {
        let mut random = SplitMix(seed);
        let at = building.rooms[(random.next() % building.rooms.len() as u64) as usize];
        let mut belief = Belief::new(&building);
        belief.scan(&building, &at, 8.0, 720);
        let mut graph = graph();
        let mut cells = Vec::new();
        let window = belief.window(&at, 201, &mut cells);
        settle(&mut graph, &ground(&at), &window);
        let saved = bytes(&graph);
        for _ in 0..5 {
            let update = graph.update(&ground(&at), &window).unwrap();
            prop_assert_eq!(update, Update { local_vertices: update.local_vertices, ..Update::default() });
        }
        prop_assert!(bytes(&graph) == saved);
    }

    #[test]
    fn a_saved_graph_gives_the_same_routes(building in building(), seed in any::<u64>()) {
        let mut random = SplitMix(seed);
        let mut belief = Belief::new(&building);
        let mut graph = graph();
        let mut cells = Vec::new();
        for _ in 0..12 {
            let at = building.rooms[(random.next() % building.rooms.len() as u64) as usize];
            belief.scan(&building, &at, 8.0, 360);
            graph.update(&ground(&at), &belief.window(&at, 101, &mut cells)).unwrap();
        }
        let saved = bytes(&graph);
        let loaded = DynamicVisibilityGraph::load(&saved[..]).unwrap();
        loaded.check_invariants();
        prop_assert!(bytes(&loaded) == saved);
        prop_assert_eq!(loaded.frontiers(), graph.frontiers());
        for start in &building.rooms {
            for goal in &building.rooms {
                for through in [Through::Known, Through::Unknown] {
                    let (a, b) = (ground(start), ground(goal));
                    prop_assert_eq!(graph.route_through(&a, &b, through), loaded.route_through(&a, &b, through));
                }
            }
        }
    }

    #[test]
    fn a_damaged_file_is_an_error_and_never_a_panic(seed in any::<u64>(), cuts in proptest::collection::vec((any::<u16>(), any::<u8>()), 1..4)) {
        let building = Building::of_rooms(2, 1, VOXEL_M, seed % 4, 0, 1);
        let mut saved = bytes(&knowing(&building, &building.rooms[0]));
        for (place, byte) in cuts {
            let place = usize::from(place) % saved.len();
            saved[place] = byte;
        }
        if let Ok(loaded) = DynamicVisibilityGraph::load(&saved[..]) {
            loaded.check_invariants();
        }
    }

    /// Windows of noise, poses of all kinds: nothing panics, and what is refused changes nothing.
    #[test]
    fn noise_and_bad_poses_do_no_harm(seed in any::<u64>(), density in 0.0..1.0f64, size in 0..70usize, x in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1e300), -1e6..1e6f64, -5.0..5.0f64]) {
        let mut random = SplitMix(seed);
        let seen: Vec<Seen> = (0..size * size)
            .map(|_| match random.unit() {
                u if u < density * density => Seen::Occupied,
                u if u < density => Seen::Free,
                _ => Seen::Unknown,
            })
            .collect();
        let mut graph = graph();
        for _ in 0..3 {
            let window = Window { first_cell: [-30, -30], width: size, height: size, seen: &seen };
            let _ = graph.update(&Point3::new(x, 0.0, 0.0), &window);
            let _ = graph.route(&Point3::new(0.0, x, 0.0), &Point3::new(3.0, 3.0, 0.0));
            let _ = graph.route(&Point3::new(1.0, 1.0, 0.0), &Point3::new(x, x, x));
            let _ = graph.next_frontier(&Point3::new(x, 0.0, 0.0));
            let _ = graph.is_clear(&Point3::new(x, 0.0, 0.0), &Point3::origin(), Through::Known);
        }
        graph.check_invariants();
    }
}

/// Lengths of the static graph's ways from the first room to all.
fn static_lengths(building: &Building, clearance_m: f64) -> Vec<Option<f64>> {
    let view = GridView {
        origin: Point2::origin(),
        resolution_m: VOXEL_M,
        width: building.width as usize,
        height: building.height as usize,
        blocked: &building.occupied,
    };
    VisibilityGraph::build(&view, clearance_m).unwrap().lengths_from(&building.rooms[0], &building.rooms)
}

/// As above without anything to spare, on fixed buildings: where the graph has no way because only the circle itself fits through a gap, the
/// lattice has one, as in the static graph.
#[test]
fn with_the_same_clearance_ways_are_as_short_on_two_hundred_buildings() {
    for seed in 0..200 {
        let building = Building::of_rooms(3, 1 + seed as usize % 3, VOXEL_M, seed, seed % 4, 2 + seed as usize % 2);
        let graph = knowing(&building, &building.rooms[0]);
        for (goal, length) in building.rooms.iter().zip(static_lengths(&building, CLEARANCE_M)) {
            let Some(length) = length else { continue };
            let route = graph.route(&ground(&building.rooms[0]), &ground(goal)).unwrap();
            check_clearance(&route, |x, y| building.is_occupied(x, y));
            assert!(route.length_m <= 1.002 * length, "{seed}: {} {length}", route.length_m);
        }
    }
}

fn bytes(graph: &DynamicVisibilityGraph) -> Vec<u8> {
    let mut bytes = Vec::new();
    graph.save(&mut bytes).unwrap();
    bytes
}

#[test]
fn a_box_that_goes_is_forgotten_and_the_way_is_short_again() {
    // A corridor with a box in its middle, passed on one side.
    let mut building = Building::of_rooms(1, 1, VOXEL_M, 1, 0, 0);
    let at = building.rooms[0] - nalgebra::Vector2::new(1.8, 0.0);
    let goal = building.rooms[0] + nalgebra::Vector2::new(1.8, 0.0);
    let straight = (goal - at).norm();
    let (x, y) = ((building.rooms[0].x / VOXEL_M) as i64, (building.rooms[0].y / VOXEL_M) as i64);
    let mut graph = graph();
    let mut cells = Vec::new();
    settle(&mut graph, &ground(&at), &Belief::of_all(&building).window(&at, 101, &mut cells));
    let length = |graph: &DynamicVisibilityGraph| graph.route(&ground(&at), &ground(&goal)).unwrap().length_m;
    assert!((length(&graph) - straight).abs() < 1e-9);
    let nodes = graph.nodes().count();

    let rect = [x - 2, y - 8, x + 3, y + 6];
    building.fill(rect, true);
    settle(&mut graph, &ground(&at), &Belief::of_all(&building).window(&at, 101, &mut cells));
    assert!(length(&graph) > straight + 0.3 && graph.nodes().count() >= nodes + 4);

    building.fill(rect, false);
    let belief = Belief::of_all(&building);
    let window = belief.window(&at, 101, &mut cells);
    // The way is short at once; the nodes go when the damper is full.
    graph.update(&ground(&at), &window).unwrap();
    assert!((length(&graph) - straight).abs() < 1e-9);
    for _ in 0..graph.config().clear_dumper {
        graph.update(&ground(&at), &window).unwrap();
    }
    assert_eq!(graph.nodes().count(), nodes);
}

#[test]
fn a_door_that_closes_is_avoided_at_once_and_used_again_when_it_opens() {
    let mut building = Building::of_rooms(2, 2, VOXEL_M, 5, 1, 0);
    assert_eq!(building.doors.len(), 4);
    let (at, goal) = (building.rooms[0], building.rooms[1]);
    let mut graph = knowing(&building, &at);
    let length = |graph: &DynamicVisibilityGraph| graph.route_through(&ground(&at), &ground(&goal), Through::Known);
    let open = length(&graph).unwrap().length_m;
    let door = building.doors.iter().find(|(_, a, b)| (*a, *b) == (0, 1)).unwrap().0;
    let mut cells = Vec::new();
    building.fill(door, true);
    graph.update(&ground(&at), &Belief::of_all(&building).window(&at, 401, &mut cells)).unwrap();
    let round = length(&graph).unwrap();
    assert!(round.length_m > open + 4.0, "{} after {open}", round.length_m);
    check_clearance(&round, |x, y| building.is_occupied(x, y));
    building.fill(door, false);
    settle(&mut graph, &ground(&at), &Belief::of_all(&building).window(&at, 401, &mut cells));
    assert!((length(&graph).unwrap().length_m - open).abs() < 0.05);
}

#[test]
fn storeys_above_each_other_do_not_mix() {
    // The ground floor has a wall through its middle that the upper floor has not.
    let upper = Building::of_rooms(1, 1, VOXEL_M, 1, 0, 0);
    let mut lower = upper.clone();
    lower.fill([16, 0, 17, lower.height], true);
    let mut graph = graph();
    let mut cells = Vec::new();
    let (west, east) = (Point2::new(1.2, 2.0), Point2::new(4.0, 2.0));
    let on = |p: &Point2<f64>, floor_m: f64| Point3::new(p.x, p.y, floor_m);
    for _ in 0..3 {
        settle(&mut graph, &on(&west, 0.0), &Belief::of_all(&lower).window(&west, 101, &mut cells));
        settle(&mut graph, &on(&west, 3.0), &Belief::of_all(&upper).window(&west, 101, &mut cells));
    }
    graph.check_invariants();
    assert!((graph.route(&on(&west, 3.0), &on(&east, 3.0)).unwrap().length_m - 2.8).abs() < 1e-9);
    assert!(matches!(graph.route(&on(&west, 0.0), &on(&east, 0.0)), Err(NoRoute::Apart { .. })));
    assert!(graph.route(&on(&west, 0.0), &on(&east, 3.0)).is_err());
    for (a, b, _) in graph.edges() {
        assert!((a.z - b.z).abs() < 1.0);
    }
}

#[test]
fn a_ramp_joins_two_storeys() {
    // A corridor along x whose floor rises from 0 to 3 m, seen in small windows as the robot goes up.
    let seen: Vec<Seen> =
        (0..41 * 21).map(|k| if [0, 20].contains(&(k / 41)) { Seen::Occupied } else { Seen::Free }).collect();
    let mut graph = graph();
    for k in 0..200i32 {
        let cell = i64::from(k);
        let x = (f64::from(k) + 0.5) * VOXEL_M;
        let window = Window { first_cell: [cell - 20, -10], width: 41, height: 21, seen: &seen };
        graph.update(&Point3::new(x, 0.0, 3.0 * x / 30.0), &window).unwrap();
    }
    let route = graph.route_through(&Point3::new(29.0, 0.0, 2.9), &Point3::new(1.0, 0.0, 0.1), Through::Known).unwrap();
    assert!(route.length_m < 29.0 && route.points.windows(2).all(|leg| (leg[1].z - leg[0].z).abs() <= 1.0 + 1e-9));
}

#[test]
fn bad_goals_are_told_apart_and_a_place_near_by_is_offered() {
    let mut building = Building::of_rooms(3, 1, VOXEL_M, 2, 0, 0);
    // A wall of 2 m thickness right of the doorless rest: room 2 is closed.
    let door = building.doors.iter().find(|(_, a, b)| (*a, *b) == (1, 2)).unwrap().0;
    building.fill(door, true);
    building.fill([4, 4, 34, 9], true);
    let at = building.rooms[1];
    let graph = knowing(&building, &at);
    let ask = |x: f64, y: f64| graph.route(&ground(&at), &Point3::new(x, y, 0.0));
    assert!(matches!(ask(f64::NAN, 0.0), Err(NoRoute::NotAPlace)));
    assert!(matches!(ask(1e5, 0.0), Err(NoRoute::NotAPlace)));
    let shut = ask(building.rooms[2].x, building.rooms[2].y);
    let Err(NoRoute::Apart { nearest, off_m }) = shut else { panic!("{shut:?}") };
    assert!(off_m < 6.0 && graph.route(&ground(&at), &nearest).is_ok());
    // Inside a thing a goal is moved beside it.
    let moved = ask(2.8, 1.0).unwrap();
    assert!(moved.goal_pull_m > 0.2 && moved.goal_pull_m < 1.0);
    assert!(ask(-3.0, 1.0).is_err());
}

#[test]
fn bad_windows_are_named_and_change_nothing() {
    let mut graph = graph();
    let cells = [Seen::Free; 6];
    let window = |width, height| Window { first_cell: [0, 0], width, height, seen: &cells };
    let at = Point3::origin();
    assert_eq!(graph.update(&at, &window(0, 3)), Err(FarError::WindowSize { width: 0, height: 3 }));
    assert_eq!(graph.update(&at, &window(usize::MAX, 3)), Err(FarError::WindowSize { width: usize::MAX, height: 3 }));
    assert_eq!(graph.update(&at, &window(2, 2)), Err(FarError::WindowLength { expected: 4, actual: 6 }));
    let far = Window { first_cell: [i64::MIN, 0], ..window(2, 3) };
    assert_eq!(graph.update(&at, &far), Err(FarError::WindowPlace { x: i64::MIN, y: 0 }));
    assert!(matches!(graph.update(&Point3::new(0.0, 0.0, f64::NAN), &window(2, 3)), Err(FarError::Pose { .. })));
    assert_eq!(bytes(&graph), bytes(&self::graph()));
}

#[test]
fn damage_of_a_file_is_named_by_its_line() {
    let read = |text: &str| DynamicVisibilityGraph::load(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(read("far-graph 2\n"), "line 1 is not `far-graph 1`");
    assert_eq!(read("far-graph 1\nconfig voxel_m x\n"), "line 2: accepted is `config`, a setting's name and its value");
    assert_eq!(
        read("far-graph 1\nconfig voxel_m 0.9\nend 0\n"),
        "clearance_m is 0.4; accepted is 2 to 12 times voxel_m"
    );
    assert_eq!(read("far-graph 1\ntile 0 0 0 0\n"), "line 2: the file ends before its `end`");
    assert!(read("far-graph 1\ntile 0 0 0 0\nrow 3 1 1\nend 0\n").starts_with("line 3: accepted is `row`"));
    assert!(DynamicVisibilityGraph::load("far-graph 1\nend 0\n".as_bytes()).is_ok());
    assert!(matches!(DynamicVisibilityGraph::load(&[0xff; 1000][..]), Err(FarLoadError::Line { line: 1, .. })));
}

/// The largest windows there are, of noise and of the worst patterns: a second or two, not a hang, and what is too much is counted.
#[test]
fn the_worst_windows_are_worked_off() {
    let side = 1000;
    let mut random = SplitMix(3);
    let mut cell = |pattern: usize, x: usize, y: usize| match pattern {
        0 => random.unit() < 0.5,
        1 => (x + y).is_multiple_of(2),
        // Small closed rooms with something in each.
        2 => x.is_multiple_of(8) || y.is_multiple_of(8) || (x % 8 == 4 && y % 8 == 4),
        // Pillars with just enough room between them.
        _ => x.is_multiple_of(9) && y.is_multiple_of(9),
    };
    for pattern in 0..4 {
        let seen: Vec<Seen> = (0..side * side)
            .map(|k| if cell(pattern, k % side, k / side) { Seen::Occupied } else { Seen::Free })
            .collect();
        let mut graph = graph();
        let window = Window { first_cell: [-500, -500], width: side, height: side, seen: &seen };
        let start = std::time::Instant::now();
        let update = graph.update(&Point3::new(0.1, 0.1, 0.0), &window).unwrap();
        println!("pattern {pattern}: {:?}, {update:?}", start.elapsed());
        assert!(update.local_vertices <= 4096 && (pattern < 3 || update.left_out > 0));
    }
}
