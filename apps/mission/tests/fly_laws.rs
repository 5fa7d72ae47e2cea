//! Laws of the flyer in a hall with a pillar: whatever it is told, and whenever, what it asks of the body is safe to do.

use mission::closed_air::{ClosedAir, POST_SPACING_M};
use mission::dsg::{Aabb, MoverConfig, MoverEvidence, SceneGraph, observe_movers};
use mission::emergency::Emergency;
use mission::fly::{Fly, Phase};
use mission::goal::{Goal, GoalStatus};
use mission::movers::movers;
use mission::omni_perception::Stamp;
use mission::planner::{AirSpace, Battery, Geofence, Mover};
use mission::robot_model::RobotModel;
use mission::stream::{Command, FlightSetPoint};
use mission::zones::Zones;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use proptest::prelude::*;

const HALL_M: [f64; 3] = [8.0, 6.0, 2.6];
const PILLAR: ([f64; 2], [f64; 2]) = ([3.8, 2.8], [4.2, 3.2]);
const PERIOD_S: f64 = 0.02;
const FLIGHT_Z_M: f64 = 1.2;
const LANDED_Z_M: f64 = 0.2;
const MARGIN_M: f64 = 0.02;

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
    yaw_rad: f64,
    /// The fastest turn between two set-points.
    turn_radps: f64,
    /// Who walks through the hall, from now on.
    walker: Option<Mover>,
    sees_walker: bool,
    /// What the robot's scene graph knows of him, where that is asked and not the truth; its time.
    graph: Option<SceneGraph>,
    now_ns: i64,
    /// The shortest distance to him.
    apart_m: f64,
    /// Where it may not be or only slowly, and the posts round that.
    zones: Zones,
    posts: Vec<Point2<f64>>,
    /// How much faster it was somewhere than a zone allows.
    excess_mps: f64,
    /// Share of the battery that a second takes.
    drain_per_s: f64,
    charge: f64,
}

impl Flight {
    /// In the air, two metres from the corner.
    fn new() -> Flight {
        Flight::within(None, &Isometry3::identity())
    }

    /// Off the floor, with a fence in the frame of the odometry.
    fn within(fence: Option<Geofence>, map_from_odometry: &Isometry3<f64>) -> Flight {
        let robot = RobotModel::builtin_quadrotor();
        let mut fly = Fly::new(&robot, FLIGHT_Z_M, LANDED_Z_M, PERIOD_S, 3);
        fly.limit(MARGIN_M, fence, None);
        let at = Point3::new(2.0, 2.0, LANDED_Z_M);
        let radius_m = robot.circumscribed_radius_m;
        let mut flight = Flight {
            fly,
            radius_m,
            at,
            target: None,
            nearest_m: f64::INFINITY,
            step_m: 0.0,
            yaw_rad: 0.0,
            turn_radps: 0.0,
            walker: None,
            sees_walker: true,
            graph: None,
            now_ns: 0,
            apart_m: f64::INFINITY,
            zones: Zones::default(),
            posts: Vec::new(),
            excess_mps: f64::NEG_INFINITY,
            drain_per_s: 0.0,
            charge: 1.0,
        };
        let air = AirSpace { distance: &distance_m, obstacles: &obstacles, movers: &[] };
        flight.fly.take_off(&Isometry3::translation(at.x, at.y, at.z), map_from_odometry, &air).unwrap();
        flight.go(5.0);
        assert_eq!(flight.fly.phase(), Phase::Flying);
        flight
    }

    /// The body does exactly what it is asked to.
    fn go(&mut self, seconds: f64) {
        for step in 0..(seconds / PERIOD_S) as usize {
            self.now_ns += (PERIOD_S * 1e9) as i64;
            if step % 10 == 0 {
                self.look();
            }
            if step % 25 == 0 {
                self.replan();
            }
            let pose = Isometry3::translation(self.at.x, self.at.y, self.at.z);
            let Command::Flight(FlightSetPoint { position_in_world, yaw_rad, .. }) =
                self.fly.command(&pose, distance_m(&self.at))
            else {
                panic!("a flyer gives set-points")
            };
            self.turn_radps = self.turn_radps.max((yaw_rad - self.yaw_rad).sin().abs() / PERIOD_S);
            self.yaw_rad = yaw_rad;
            self.charge -= self.drain_per_s * PERIOD_S;
            if let Some(walker) = &mut self.walker {
                walker.position += walker.velocity_mps * PERIOD_S;
                self.apart_m = self.apart_m.min((walker.position - position_in_world).norm() - walker.radius_m);
            }
            let step_m = (position_in_world - self.at).norm();
            for slow in &self.zones.speed {
                let is_inside = |p: &Point3<f64>| slow.zone.zone.distance_m(&p.xy()) <= self.radius_m;
                if is_inside(&self.at) && is_inside(&position_in_world) {
                    self.excess_mps = self.excess_mps.max(step_m / PERIOD_S - slow.zone.max_mps);
                }
            }
            self.step_m = self.step_m.max(step_m);
            self.at = position_in_world;
            if self.fly.phase() == Phase::Flying {
                let zone_m = self.zones.keep_out.iter().map(|keep_out| keep_out.zone.distance_m(&self.at.xy()));
                let near_m = zone_m.fold(distance_m(&self.at).unwrap_or(0.0), f64::min);
                self.nearest_m = self.nearest_m.min(near_m);
            }
        }
    }

    /// The walker in a frame of the camera: a box 1.7 m high, whose middle is off by a few centimetres.
    fn look(&mut self) {
        let (Some(graph), Some(walker)) = (&mut self.graph, &self.walker) else { return };
        let turn = (self.now_ns / 200_000_000) as f64;
        let off = Vector3::new((1.3 * turn).sin(), (2.1 * turn).cos(), 0.0) * 0.03;
        let side_m = walker.radius_m * std::f64::consts::SQRT_2;
        let bounds = Aabb::from_center(walker.position + off, Vector3::new(side_m, side_m, 1.7));
        let view = MoverEvidence { stamp_ns: self.now_ns, label: "person".into(), score: 0.9, bounds, track: None };
        observe_movers(graph, &[view], &MoverConfig::default()).unwrap();
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
        let home = self.fly.home();
        let way_home_m = |from: &Point2<f64>| home.map(|home| (from - home).norm());
        self.fly.set_charge(self.charge, way_home_m(&self.at.xy()));
        let is_returning = self.fly.emergency().is_some();
        let target = if is_returning { home } else { self.target };
        let route = target.map(|target| [self.at.xy(), target]);
        let walker: Vec<Mover> = match &self.graph {
            Some(graph) => movers(graph, Stamp(self.now_ns)),
            None => self.walker.filter(|_| self.sees_walker).into_iter().collect(),
        };
        let closed = ClosedAir { zones: &self.zones, posts: &self.posts, far_m: 2.0 };
        let distance = |p: &Point3<f64>| closed.distance_m(p, distance_m(p));
        let obstacles = |low: &Point3<f64>, high: &Point3<f64>| closed.obstacles(low, high, obstacles(low, high));
        let air = AirSpace { distance: &distance, obstacles: &obstacles, movers: &walker };
        self.fly.limit_speed(&self.zones);
        self.fly.replan(route.as_ref().map(|route| &route[..]), &air, &way_home_m);
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
        prop_assert!(flight.turn_radps <= 0.6 + 1e-6, "it turned at {} rad/s", flight.turn_radps);
    }

    /// The same with a zone that it must keep out of and one in which it may only be slow: its ball enters the first nowhere, and in the second
    /// its set-point is nowhere faster than allowed.
    #[test]
    fn no_order_leads_into_a_zone_or_fast_through_one(
        orders in proptest::collection::vec((place(), 0.5..4.0f64), 1..6),
        closed in (4.6..7.0f64, 0.5..5.5f64, 0.2..1.0f64), slow in (3.2..7.5f64, 0.5..5.5f64, 0.3..1.5f64), limit in 0.15..0.6f64,
    ) {
        let square = |(x, y, half): (f64, f64, f64)| {
            format!("[[{},{}],[{},{}],[{},{}],[{},{}]]", x - half, y - half, x + half, y - half, x + half, y + half, x - half, y + half)
        };
        let text = format!(
            "{{\"keep_out\": [{{\"corners_m\": {}}}], \"speed\": [{{\"corners_m\": {}, \"max_mps\": {limit}}}]}}",
            square(closed), square(slow)
        );
        let mut flight = Flight::new();
        flight.zones = Zones::parse(&text).unwrap();
        flight.posts = flight.zones.posts(POST_SPACING_M);
        for (target, seconds) in orders {
            flight.set_goal(target);
            flight.go(seconds);
        }
        prop_assert!(flight.nearest_m >= flight.radius_m, "{} m", flight.nearest_m);
        prop_assert!(flight.excess_mps <= 1e-3, "{} m/s too fast", flight.excess_mps);
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
fn told_to_turn_in_full_flight_it_turns() {
    let mut flight = Flight::new();
    flight.set_goal(Some(Point2::new(7.0, 2.0)));
    flight.go(1.5);
    flight.target = None;
    flight.fly.set_goal(Goal::Turn { heading_rad: 2.5 });
    flight.go(12.0);
    assert_eq!(*flight.fly.status(), GoalStatus::Arrived);
    assert!((flight.yaw_rad - 2.5).abs() < 0.1, "it looks to {}", flight.yaw_rad);
    assert!(flight.turn_radps <= 0.6 + 1e-6 && flight.nearest_m >= flight.radius_m);
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

/// A battery that hovers for a minute and a half; the last tenth is not to be planned with.
const BATTERY: Battery = Battery { endurance_s: 90.0, reserve: 0.1, cruise_mps: 1.0, landing_s: 5.0 };

#[test]
fn a_low_battery_brings_it_home_and_down_whatever_it_was_told() {
    let mut flight = Flight::new();
    let home = flight.at.xy();
    flight.fly.limit(MARGIN_M, None, Some(BATTERY));
    flight.drain_per_s = 1.0 / BATTERY.endurance_s;
    let mut places = [Point2::new(7.0, 1.5), Point2::new(7.0, 5.0), Point2::new(1.0, 5.0)].into_iter().cycle();
    for _ in 0..20 {
        // It has always something to do, and is never told to come back.
        flight.set_goal(places.next());
        flight.go(6.0);
        if flight.fly.phase() == Phase::Landed {
            break;
        }
    }
    assert_eq!(flight.fly.phase(), Phase::Landed);
    assert_eq!(flight.fly.emergency(), Some(Emergency::Returning));
    assert!((flight.at.xy() - home).norm() < 0.5, "it landed at {}, its home is {home}", flight.at);
    assert!(flight.charge > 0.0 && flight.charge < 0.5, "{} left", flight.charge);
    assert!(flight.nearest_m >= flight.radius_m);
}

#[test]
fn a_flight_from_which_the_battery_would_not_bring_it_back_is_refused() {
    let mut flight = Flight::new();
    flight.fly.limit(MARGIN_M, None, Some(BATTERY));
    // Twelve seconds above the reserve: enough for the way back from here, not for five metres there and back.
    flight.charge = 0.1 + 12.0 / BATTERY.endurance_s;
    flight.set_goal(Some(Point2::new(7.0, 2.0)));
    flight.go(3.0);
    assert_eq!(*flight.fly.status(), GoalStatus::Failed("the battery would not bring it back from there"));
    assert!((flight.at.xy() - Point2::new(2.0, 2.0)).norm() < 0.1, "it stayed: {}", flight.at);
    flight.set_goal(Some(Point2::new(3.0, 2.0)));
    flight.go(5.0);
    assert_eq!(*flight.fly.status(), GoalStatus::Arrived, "that is near enough");
}

#[test]
fn with_no_charge_for_the_way_back_it_lands_where_it_is() {
    let mut flight = Flight::new();
    flight.fly.limit(MARGIN_M, None, Some(BATTERY));
    flight.set_goal(Some(Point2::new(7.0, 2.0)));
    flight.go(8.0);
    flight.charge = 0.12;
    flight.go(12.0);
    assert_eq!((flight.fly.phase(), flight.fly.emergency()), (Phase::Landed, Some(Emergency::LandingHere)));
    assert!((flight.at.xy() - Point2::new(7.0, 2.0)).norm() < 0.4, "{}", flight.at);
}

#[test]
fn what_lies_outside_the_fence_is_refused_and_never_flown_over() {
    // The map is turned to the walls; the fence was given in the frame of the odometry.
    let map_from_odometry = Isometry3::new(Vector3::new(0.4, -0.3, 0.0), Vector3::z() * 0.6);
    let corners = [[1.0, 1.0], [5.0, 1.0], [5.0, 5.0], [1.0, 5.0]].map(|c| Point2::new(c[0], c[1]));
    let in_map = Geofence::new(&corners, 0.0, 2.0).unwrap();
    let fence = in_map.transformed(&map_from_odometry.inverse());
    let mut flight = Flight::within(Some(fence.clone()), &map_from_odometry);
    flight.set_goal(Some(Point2::new(7.0, 2.0)));
    flight.go(6.0);
    assert_eq!(*flight.fly.status(), GoalStatus::Failed("it would be outside the fence"));
    assert!(flight.at.x <= 5.0 + 1e-6, "{}", flight.at);
    flight.set_goal(Some(Point2::new(4.5, 4.5)));
    flight.go(8.0);
    assert_eq!(*flight.fly.status(), GoalStatus::Arrived);
    // Who stands outside does not take off.
    let mut fly = Fly::new(&RobotModel::builtin_quadrotor(), FLIGHT_Z_M, LANDED_Z_M, PERIOD_S, 3);
    fly.limit(MARGIN_M, Some(fence), None);
    let air = AirSpace { distance: &distance_m, obstacles: &obstacles, movers: &[] };
    let refused = fly.take_off(&Isometry3::translation(6.0, 3.0, LANDED_Z_M), &map_from_odometry, &air);
    assert_eq!(refused, Err("the place above it is outside the fence"));
    assert_eq!(fly.phase(), Phase::Grounded);
}

#[test]
fn who_walks_into_its_way_is_not_met() {
    for (speed, meets_s) in [(0.7, 1.8), (0.8, 2.2), (0.6, 2.5)] {
        let fly_past = |is_seen: bool| {
            let mut flight = Flight::new();
            // Across the way, when it would be there if it were alone.
            flight.walker = Some(Mover {
                position: Point3::new(4.6, 2.0 - speed * meets_s, 1.0),
                velocity_mps: Vector3::new(0.0, speed, 0.0),
                radius_m: 0.35,
                growth_mps: 0.0,
            });
            flight.sees_walker = is_seen;
            flight.set_goal(Some(Point2::new(7.0, 2.0)));
            flight.go(12.0);
            flight
        };
        let blind = fly_past(false);
        assert!(blind.apart_m < blind.radius_m, "alone it would have met him: {} m", blind.apart_m);
        let flight = fly_past(true);
        assert!(flight.apart_m >= flight.radius_m, "he came {} m near", flight.apart_m);
        assert_eq!(*flight.fly.status(), GoalStatus::Arrived, "it goes on when he has passed");
        assert!(flight.nearest_m >= flight.radius_m);
    }
}

/// The same by what the scene graph knows of him, who was seen five times a second, and then no more.
#[test]
fn who_the_scene_graph_knows_to_walk_is_not_met_and_not_waited_for_when_he_is_gone() {
    for (speed, meets_s) in [(0.7, 1.8), (0.8, 2.2), (0.6, 2.5)] {
        let fly_past = |knows: bool| {
            let mut flight = Flight::new();
            flight.graph = knows.then(SceneGraph::new);
            flight.sees_walker = false;
            flight.walker = Some(Mover {
                position: Point3::new(4.6, 2.0 - speed * (meets_s + 1.0), 0.85),
                velocity_mps: Vector3::new(0.0, speed, 0.0),
                radius_m: 0.3,
                growth_mps: 0.0,
            });
            // Seen for a second before it sets off.
            flight.go(1.0);
            flight.set_goal(Some(Point2::new(7.0, 2.0)));
            flight.go(9.0);
            // He has left the hall: what is known of him is old.
            flight.walker = None;
            flight.go(8.0);
            flight
        };
        let blind = fly_past(false);
        assert!(blind.apart_m < blind.radius_m, "alone it would have met him: {} m", blind.apart_m);
        let flight = fly_past(true);
        assert!(flight.apart_m >= flight.radius_m, "he came {} m near", flight.apart_m);
        assert_eq!(*flight.fly.status(), GoalStatus::Arrived);
        assert!(flight.nearest_m >= flight.radius_m);
    }
}

#[test]
fn it_does_not_take_off_under_something_and_lands_beside_what_is_below() {
    // A table in the hall: nothing is known of it but its top.
    let table = |p: &Point3<f64>| {
        let beyond = |v: f64, low: f64, high: f64| (low - v).max(v - high).max(0.0);
        let d = Vector3::new(beyond(p.x, 3.0, 4.2), beyond(p.y, 1.2, 2.0), beyond(p.z, 0.65, 0.75)).norm();
        distance_m(p).map(|hall| hall.min(d))
    };
    let air = AirSpace { distance: &table, obstacles: &obstacles, movers: &[] };
    let robot = RobotModel::builtin_quadrotor();
    let new = || Fly::new(&robot, FLIGHT_Z_M, LANDED_Z_M, PERIOD_S, 3);
    let mut fly = new();
    let still = Isometry3::identity();
    let refused = fly.take_off(&Isometry3::translation(3.6, 1.6, LANDED_Z_M), &still, &air);
    assert_eq!(refused, Err("there is no room to fly above where it stands"));
    assert_eq!(fly.phase(), Phase::Grounded);

    // Beside it, over it, and down: not onto the table.
    let mut fly = new();
    let mut at = Point3::new(2.0, 1.6, LANDED_Z_M);
    fly.take_off(&Isometry3::translation(at.x, at.y, at.z), &still, &air).unwrap();
    let mut go = |fly: &mut Fly, seconds: f64, target: Option<Point2<f64>>| {
        for step in 0..(seconds / PERIOD_S) as usize {
            if step % 25 == 0 {
                let route = target.map(|target| [at.xy(), target]);
                fly.replan(route.as_ref().map(|route| &route[..]), &air, &|_| None);
            }
            let Command::Flight(point) = fly.command(&Isometry3::translation(at.x, at.y, at.z), None) else {
                panic!("a flyer gives set-points")
            };
            at = point.position_in_world;
        }
        at
    };
    go(&mut fly, 5.0, None);
    let over = Point2::new(3.6, 1.6);
    fly.set_goal(Goal::Reach { target: over, tolerance_m: 0.3, heading_rad: None });
    let above = go(&mut fly, 8.0, Some(over));
    assert!((above.xy() - over).norm() < 0.3, "{above}");
    fly.land();
    let down = go(&mut fly, 12.0, None);
    assert_eq!(fly.phase(), Phase::Landed);
    assert!(table(&Point3::new(down.x, down.y, 0.7)).unwrap() > 0.25, "it came down at {down}");
}
