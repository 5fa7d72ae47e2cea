//! Drives with the dynamic visibility graph: a point robot with a scanner of limited range in buildings it does not know.
#![cfg(feature = "ground")]
mod support;

use nalgebra::{Point2, Vector2};
use planner::ground::far::DynamicVisibilityGraph;
use planner::ground::far::config::FarConfig;
use planner::ground::far::guidance::{Guidance, Guide};
use planner::ground::far::tile::Through;
use planner::ground::far::window::Seen;
use support::building::{Belief, Building, advance, ground};
use support::drive::Patrol;
use support::{SplitMix, optimist};

const VOXEL_M: f64 = 0.15;
const CLEARANCE_M: f64 = 0.4;
const RANGE_M: f64 = 8.0;
/// Metres a cycle: 1 m/s at 5 Hz.
const STEP_M: f64 = 0.2;
const SIDE: usize = 401;

/// A robot with what it has seen.
struct Robot {
    at: Point2<f64>,
    belief: Belief,
    graph: DynamicVisibilityGraph,
    metres: f64,
    /// Least distance from anything real.
    nearest_m: f64,
    cells: Vec<Seen>,
}

impl Robot {
    fn new(building: &Building, at: Point2<f64>) -> Self {
        Robot {
            at,
            belief: Belief::new(building),
            graph: DynamicVisibilityGraph::new(FarConfig::default()).unwrap(),
            metres: 0.0,
            nearest_m: f64::INFINITY,
            cells: Vec::new(),
        }
    }

    fn look(&mut self, building: &Building) {
        self.belief.scan(building, &self.at, RANGE_M, 720);
        let window = self.belief.window(&self.at, SIDE, &mut self.cells);
        self.graph.update(&ground(&self.at), &window).unwrap();
    }

    fn follow(&mut self, building: &Building, points: &[Point2<f64>]) {
        let next = advance(&self.at, points, STEP_M);
        self.metres += (next - self.at).norm();
        self.at = next;
        self.nearest_m = self.nearest_m.min(building.distance(&self.at, 1.0));
    }

    /// Drives to a goal; `world` may change the building before each cycle. Whether it arrived.
    fn drive(
        &mut self,
        building: &mut Building,
        goal: &Point2<f64>,
        mut world: impl FnMut(&mut Building, &Point2<f64>, u32),
    ) -> bool {
        let mut guide = Guide::new(ground(goal));
        let mut stuck = 0;
        for cycle in 0..3000 {
            world(building, &self.at, cycle);
            self.look(building);
            match guide.next(&self.graph, &ground(&self.at)) {
                Guidance::Arrived => return true,
                Guidance::Drive { route, waypoint } => {
                    stuck = 0;
                    let is_in_sight = self.graph.is_clear(&ground(&self.at), &waypoint, route.through);
                    assert!(is_in_sight || route.start_pull_m > 0.0, "{waypoint} is not in sight");
                    let points: Vec<Point2<f64>> = route.points.iter().map(|p| p.xy()).collect();
                    self.follow(building, &points);
                }
                Guidance::NoWay(_) => {
                    stuck += 1;
                    if stuck > 200 {
                        return false;
                    }
                }
            }
        }
        false
    }
}

/// Metres of the optimist: A* on the cells with unknown as free, in every cycle.
fn optimist_metres(building: &Building, from: &Point2<f64>, goal: &Point2<f64>) -> Option<f64> {
    let (mut at, mut belief, mut metres) = (*from, Belief::new(building), 0.0);
    for _ in 0..3000 {
        if (goal - at).norm() <= 0.5 {
            return Some(metres);
        }
        belief.scan(building, &at, RANGE_M, 720);
        let points = optimist::route(&belief, CLEARANCE_M, &at, goal)?;
        let next = advance(&at, &points, STEP_M);
        metres += (next - at).norm();
        at = next;
    }
    None
}

#[test]
fn goals_behind_the_unknown_are_reached_with_about_the_metres_an_optimist_needs() {
    let (mut ours, mut theirs, mut both) = (0.0, 0.0, 0);
    for seed in 0..16 {
        // Trees of rooms (every wrong turn is a dead end) and buildings with loops.
        let mut building = Building::of_rooms(5, 4, VOXEL_M, seed, if seed % 2 == 0 { 0 } else { 3 }, 1);
        let (start, goal) = (building.rooms[0], building.rooms[19]);
        let mut robot = Robot::new(&building, start);
        assert!(robot.drive(&mut building, &goal, |_, _, _| {}), "seed {seed}");
        assert!(robot.nearest_m >= CLEARANCE_M - 0.15, "seed {seed}: {} m from a wall", robot.nearest_m);
        robot.graph.check_invariants();
        // The trajectory is a way back through what is known.
        let back = robot.graph.route_through(&ground(&robot.at), &ground(&start), Through::Known);
        assert!(back.unwrap().length_m <= robot.metres + 0.1);
        let optimist = optimist_metres(&building, &start, &goal);
        println!("seed {seed}: {:.1} m, an optimist on cells {optimist:.1?} m", robot.metres);
        if let Some(metres) = optimist {
            ours += robot.metres;
            theirs += metres;
            both += 1;
        }
    }
    println!("{both} buildings: {ours:.0} m against {theirs:.0} m, ratio {:.3}", ours / theirs);
    assert!(both == 16 && ours <= 1.05 * theirs);
}

#[test]
fn a_door_that_closed_behind_the_robot_costs_a_way_round_and_no_more() {
    for seed in [5, 6, 7] {
        let mut building = Building::of_rooms(2, 2, VOXEL_M, seed, 1, 0);
        let (home, away) = (building.rooms[0], building.rooms[1]);
        let mut robot = Robot::new(&building, home);
        assert!(robot.drive(&mut building, &away, |_, _, _| {}));
        let there = robot.metres;
        let door = building.doors.iter().find(|(_, a, b)| (*a, *b) == (0, 1)).unwrap().0;
        building.fill(door, true);
        assert!(robot.drive(&mut building, &home, |_, _, _| {}));
        let back = robot.metres - there;
        assert!(back > there + 3.0 && back < 25.0, "{there} m there, {back} m back");
        assert!(robot.nearest_m >= CLEARANCE_M - 0.15);
    }
}

#[test]
fn boxes_that_move_do_not_keep_the_robot_from_its_goal() {
    for seed in 0..6 {
        let mut building = Building::of_rooms(4, 3, VOXEL_M, seed, 2, 0);
        let (start, goal) = (building.rooms[0], building.rooms[11]);
        let mut random = SplitMix(seed);
        let mut moving: Option<[i64; 4]> = None;
        let mut robot = Robot::new(&building, start);
        // Every 15 cycles the box stands in the middle of another room, if the robot is not there.
        let world = |building: &mut Building, at: &Point2<f64>, cycle: u32| {
            if !cycle.is_multiple_of(15) {
                return;
            }
            if let Some(old) = moving.take() {
                building.fill(old, false);
            }
            let room = building.rooms[(random.next() % 12) as usize] + Vector2::new(random.unit(), -random.unit());
            if (room - at).norm() > 2.0 && (room - goal).norm() > 2.0 {
                let corner = (room / VOXEL_M).coords.map(|c| c as i64);
                let rect = [corner.x - 3, corner.y - 3, corner.x + 3, corner.y + 3];
                building.fill(rect, true);
                moving = Some(rect);
            }
        };
        assert!(robot.drive(&mut building, &goal, world), "seed {seed}");
        robot.graph.check_invariants();
    }
}

#[test]
fn a_goal_in_a_closed_room_is_given_up_only_when_all_is_seen() {
    let mut building = Building::of_rooms(3, 2, VOXEL_M, 4, 0, 0);
    let shut: Vec<[i64; 4]> = building.doors.iter().filter(|(_, a, b)| *a == 5 || *b == 5).map(|d| d.0).collect();
    for door in shut {
        building.fill(door, true);
    }
    let (start, goal) = (building.rooms[0], building.rooms[5]);
    let mut robot = Robot::new(&building, start);
    assert!(!robot.drive(&mut building, &goal, |_, _, _| {}));
    // What can be reached has been seen as far as it matters: every wall of the closed room from outside.
    assert!(matches!(Guide::new(ground(&goal)).next(&robot.graph, &ground(&robot.at)), Guidance::NoWay(_)));
}

#[test]
fn exploring_until_no_frontier_is_left_shows_every_room() {
    for seed in 0..8 {
        let building = Building::of_rooms(4, 3, VOXEL_M, seed, seed % 3, 2);
        let mut robot = Robot::new(&building, building.rooms[5]);
        let mut waited = 0;
        let mut cycles = 0;
        let mut target = None;
        loop {
            robot.look(&building);
            let Some((frontier, route)) = robot.graph.next_frontier(&ground(&robot.at)) else { break };
            let points: Vec<Point2<f64>> = route.points.iter().map(|p| p.xy()).collect();
            robot.follow(&building, &points);
            // At a frontier that stays where it is nothing more can be seen.
            waited = if target == Some(frontier.at) && route.length_m < 0.3 { waited + 1 } else { 0 };
            target = Some(frontier.at);
            if waited > 3 {
                robot.graph.exhaust(&frontier);
            }
            cycles += 1;
            assert!(cycles < 4000, "seed {seed}: exploring does not end");
        }
        let free = building.occupied.iter().filter(|o| !**o).count();
        let seen = robot.belief.seen.iter().filter(|s| **s == Seen::Free).count();
        println!(
            "seed {seed}: {:.0} m, {cycles} cycles, {:.2} % of the floor seen",
            robot.metres,
            100.0 * seen as f64 / free as f64
        );
        for room in &building.rooms {
            let (x, y) = ((room.x / VOXEL_M) as i64, (room.y / VOXEL_M) as i64);
            assert_eq!(robot.belief.get(x, y), Seen::Free, "seed {seed}: the room at {room}");
        }
        assert!(seen as f64 >= 0.98 * free as f64);
        assert!(robot.nearest_m >= CLEARANCE_M - 0.15, "seed {seed}: {}", robot.nearest_m);
    }
}

/// Ranges off by 2 cm (one standard deviation): cells beside the walls flicker. Votes, pools and dampers keep the graph small and usable.
#[test]
fn a_noisy_scanner_neither_swells_the_graph_nor_stops_the_robot() {
    let building = Building::of_rooms(4, 3, VOXEL_M, 3, 3, 1);
    let mut random = SplitMix(9);
    let mut gauss = move || (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
    let mut robot = Robot::new(&building, building.rooms[0]);
    let mut clean = Robot::new(&building, building.rooms[0]);
    clean.belief = Belief::of_all(&building);
    clean.look(&building);
    let clean = clean.graph.nodes().count();
    let mut most = 0;
    for goal in [11, 3, 8, 0] {
        let goal = building.rooms[goal];
        let mut guide = Guide::new(ground(&goal));
        let mut arrived = false;
        for _ in 0..600 {
            robot.belief.scan_with(&building, &robot.at, RANGE_M, 720, || 0.02 * gauss() - 0.03);
            let window = robot.belief.window(&robot.at, SIDE, &mut robot.cells);
            robot.graph.update(&ground(&robot.at), &window).unwrap();
            most = most.max(robot.graph.nodes().count());
            match guide.next(&robot.graph, &ground(&robot.at)) {
                Guidance::Arrived => {
                    arrived = true;
                    break;
                }
                Guidance::Drive { route, .. } => {
                    let points: Vec<Point2<f64>> = route.points.iter().map(|p| p.xy()).collect();
                    robot.follow(&building, &points);
                }
                Guidance::NoWay(_) => {}
            }
        }
        println!("{goal}: arrived {arrived}, {:.1} m, at most {most} nodes ({clean} without noise)", robot.metres);
        assert!(arrived && most <= 4 * clean);
    }
    robot.graph.check_invariants();
}

/// Nothing piles up: neither forgotten boxes nor the robot's own trajectory make an old map larger than a young one.
#[test]
fn a_map_does_not_grow_with_its_age() {
    let mut patrol = Patrol::new(Building::of_rooms(4, 3, VOXEL_M, 4, 3, 1), SIDE);
    let mut counts = Vec::new();
    for _ in 0..4 {
        for _ in 0..400 {
            patrol.step(&mut |work| work());
        }
        counts.push((patrol.graph.nodes().count(), patrol.graph.edges().count()));
    }
    println!("{counts:?} after 400, 800, 1200, 1600 cycles, {:.0} m", patrol.metres);
    assert!(patrol.metres > 200.0);
    assert!(counts[3].0 as f64 <= 1.15 * counts[1].0 as f64, "{counts:?}");
}
