//! Laws of the flyer in a hall with a pillar: whatever it is told, and whenever, what it asks of the body is safe to do.

use mission::fly::{AirSpace, Fly, Phase};
use mission::goal::{Goal, GoalStatus};
use mission::robot_model::RobotModel;
use mission::stream::{Command, FlightSetPoint};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use proptest::prelude::*;

const HALL_M: [f64; 3] = [8.0, 6.0, 2.6];
const PILLAR: ([f64; 2], [f64; 2]) = ([3.8, 2.8], [4.2, 3.2]);
const PERIOD_S: f64 = 0.02;
const FLIGHT_Z_M: f64 = 1.2;
const LANDED_Z_M: f64 = 0.2;

/// Distance to the hall's surfaces; nobody has looked beyond them.
fn distance_m(p: &Point3<f64>) -> Option<f64> {
    let walls_m = (0..3).map(|axis| p[axis].min(HALL_M[axis] - p[axis])).fold(f64::INFINITY, f64::min);
    let beside = |axis: usize| (PILLAR.0[axis] - p[axis]).max(p[axis] - PILLAR.1[axis]);
    let pillar_m = beside(0).max(0.0).hypot(beside(1).max(0.0));
    (walls_m >= 0.0).then(|| walls_m.min(pillar_m))
}

/// Points on the same surfaces, 10 cm apart, in a box.
fn obstacles(low: &Point3<f64>, high: &Point3<f64>) -> Vec<Point3<f64>> {
    const STEP_M: f64 = 0.1;
    let count = |length_m: f64| (length_m / STEP_M).round() as usize;
    let mut points = Vec::new();
    let mut keep = |p: Point3<f64>| {
        if (0..3).all(|axis| p[axis] >= low[axis] && p[axis] <= high[axis]) {
            points.push(p);
        }
    };
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for i in 0..=count(HALL_M[u]) {
            for j in 0..=count(HALL_M[v]) {
                for side in [0.0, HALL_M[axis]] {
                    let mut p = Point3::origin();
                    (p[axis], p[u], p[v]) = (side, i as f64 * STEP_M, j as f64 * STEP_M);
                    keep(p);
                }
            }
        }
    }
    for k in 0..=count(HALL_M[2]) {
        for i in 0..=4 {
            for j in 0..=4 {
                let at = |axis: usize, n: i32| PILLAR.0[axis] + STEP_M * f64::from(n);
                keep(Point3::new(at(0, i), at(1, j), k as f64 * STEP_M));
            }
        }
    }
    points
}

struct Flight {
    fly: Fly,
    radius_m: f64,
    at: Point3<f64>,
    /// Where it shall be, if anywhere.
    target: Option<Point2<f64>>,
    /// The shortest distance to anything while it flew.
    nearest_m: f64,
    /// The longest step between two set-points.
    step_m: f64,
}

impl Flight {
    /// In the air, two metres from the corner.
    fn new() -> Flight {
        let robot = RobotModel::builtin_quadrotor();
        let fly = Fly::new(&robot, FLIGHT_Z_M, LANDED_Z_M, PERIOD_S, 3);
        let at = Point3::new(2.0, 2.0, LANDED_Z_M);
        let radius_m = robot.circumscribed_radius_m;
        let mut flight = Flight { fly, radius_m, at, target: None, nearest_m: f64::INFINITY, step_m: 0.0 };
        flight.fly.take_off(&Isometry3::translation(at.x, at.y, at.z));
        flight.go(4.0);
        assert_eq!(flight.fly.phase(), Phase::Flying);
        flight
    }

    /// The body does exactly what it is asked to.
    fn go(&mut self, seconds: f64) {
        for step in 0..(seconds / PERIOD_S) as usize {
            if step % 25 == 0 {
                self.replan();
            }
            let pose = Isometry3::translation(self.at.x, self.at.y, self.at.z);
            let Command::Flight(FlightSetPoint { position_in_world, .. }) =
                self.fly.command(&pose, distance_m(&self.at))
            else {
                panic!("a flyer gives set-points")
            };
            self.step_m = self.step_m.max((position_in_world - self.at).norm());
            self.at = position_in_world;
            if self.fly.phase() == Phase::Flying {
                self.nearest_m = self.nearest_m.min(distance_m(&self.at).unwrap_or(0.0));
            }
        }
    }

    /// A new goal, `None` to stay.
    fn set_goal(&mut self, target: Option<Point2<f64>>) {
        self.target = target;
        self.fly.set_goal(match target {
            Some(target) => Goal::Reach { target, tolerance_m: 0.3, heading_rad: None },
            None => Goal::Stay,
        });
        self.replan();
    }

    fn replan(&mut self) {
        let route = self.target.map(|target| [self.at.xy(), target]);
        let air = AirSpace { distance: &distance_m, obstacles: &obstacles };
        self.fly.replan(route.as_ref().map(|route| &route[..]), &air);
    }
}

fn place() -> impl Strategy<Value = Option<Point2<f64>>> {
    // Every fourth time it is told to stay; some places are in a wall, in the pillar or outside.
    prop_oneof![
        3 => (-0.5..8.5f64, -0.5..6.5f64).prop_map(|(x, y)| Some(Point2::new(x, y))),
        1 => Just(None),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Changes of mind in full flight, stops, impossible goals, and a landing at a bad moment never bring it near to
    /// anything, and never make its set-point jump.
    #[test]
    fn no_order_at_no_time_leads_into_a_wall(
        orders in proptest::collection::vec((place(), 0.1..2.5f64), 1..8), landing_s in 0.0..1.5f64,
    ) {
        let mut flight = Flight::new();
        for (target, seconds) in orders {
            flight.set_goal(target);
            flight.go(seconds);
        }
        flight.go(landing_s);
        // Asked again in every cycle, as after Ctrl-C.
        for _ in 0..600 {
            flight.fly.land();
            flight.go(PERIOD_S);
        }
        prop_assert_eq!(flight.fly.phase(), Phase::Landed);
        prop_assert!(flight.nearest_m >= flight.radius_m, "{} m", flight.nearest_m);
        prop_assert!(flight.step_m <= 2.5 * PERIOD_S, "{} m in one period", flight.step_m);
    }

    /// Every free place is reached, past the pillar if need be.
    #[test]
    fn what_can_be_reached_is_reached(x in 0.8..7.2f64, y in 0.8..5.2f64) {
        let target = Point2::new(x, y);
        prop_assume!(distance_m(&Point3::new(x, y, FLIGHT_Z_M)).is_some_and(|d| d > 0.55));
        let mut flight = Flight::new();
        flight.set_goal(Some(target));
        flight.go(20.0);
        prop_assert_eq!(*flight.fly.status(), GoalStatus::Arrived);
        prop_assert!((flight.at.xy() - target).norm() <= 0.3);
    }
}

#[test]
fn a_place_behind_the_wall_fails_after_a_look_from_half_way() {
    let mut flight = Flight::new();
    let start = flight.at;
    // Half of the way is in the hall, the end is not.
    flight.set_goal(Some(Point2::new(2.0, 7.5)));
    flight.go(20.0);
    assert!(matches!(flight.fly.status(), GoalStatus::Failed(_)), "{:?}", flight.fly.status());
    assert!((flight.at - start).xy().norm() > 1.5, "it went to see: {}", flight.at);
    assert!(flight.nearest_m >= flight.radius_m);
}

#[test]
fn it_lands_from_where_it_came_to_rest() {
    let mut flight = Flight::new();
    flight.set_goal(Some(Point2::new(7.0, 1.5)));
    flight.go(1.5);
    flight.fly.land();
    flight.go(0.1);
    let mut moved = Vector3::zeros();
    for _ in 0..500 {
        let before = flight.at;
        flight.fly.land();
        flight.go(PERIOD_S);
        if flight.fly.phase() == Phase::Landing {
            moved += (flight.at - before).abs();
        }
    }
    assert_eq!(flight.fly.phase(), Phase::Landed);
    assert!(moved.xy().norm() < 0.02 && moved.z > 0.5, "straight down: {moved}");
}
