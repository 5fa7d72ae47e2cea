//! Shortest ways between polygons: against stored lengths, against brute force in integers, and laws.
#![cfg(feature = "ground")]
mod support;

use nalgebra::Point2;
use planner::{NoWay, Obstruction, PolygonError, PolygonMap};
use proptest::prelude::*;
use serde_json::Value;
use support::SplitMix;

/// The maps of the MovingAI benchmark as polygons, with true lengths; Berlin's are single precision.
#[test]
fn every_stored_length_is_reached() {
    let number = |value: &Value| value.as_f64().expect("a number");
    let point = |value: &Value| Point2::new(number(&value[0]), number(&value[1]));
    let list = |value: &Value| value.as_array().expect("a list").clone();
    let ring = |value: &Value| list(value).iter().map(point).collect::<Vec<_>>();
    for (name, tolerance) in [
        ("arena", 1e-9),
        ("den312d", 1e-9),
        ("maze512-32-0", 1e-9),
        ("64room_000", 1e-9),
        ("den520d", 1e-9),
        ("Berlin_0_256", 1e-6),
    ] {
        let Some(text) = support::shared(&format!("maps/{name}.json")) else { return };
        let file: Value = serde_json::from_str(&text).expect("JSON");
        let holes: Vec<_> = list(&file["holes"]).iter().map(ring).collect();
        let map = PolygonMap::new(&ring(&file["outer"]), &holes).expect("a map");
        let mut worst: f64 = 0.0;
        for pair in list(&file["pairs"]) {
            let wanted = pair["length"].as_f64().or(pair["length_polyanya"].as_f64()).expect("a length");
            let route = map.route(&point(&pair["start"]), &point(&pair["goal"])).expect("a way");
            worst = worst.max((route.length - wanted).abs() / wanted);
        }
        println!("{name}: {} corners, {} tangents, worst {worst:.1e}", map.corner_count(), map.tangent_count());
        assert!(worst <= tolerance, "{name}: {worst:e}");
    }
}

/// A box of `SLOTS` x `SLOTS` slots with a triangle or a quadrilateral in most of them, on integers: corners and sides in line
/// abound.
#[derive(Debug, Clone)]
struct World {
    outer: Vec<[i64; 2]>,
    holes: Vec<Vec<[i64; 2]>>,
}

const SLOTS: i64 = 3;
const SLOT: i64 = 6;

impl World {
    fn drawn(random: &mut SplitMix) -> World {
        let side = SLOTS * SLOT;
        let mut below = |n: i64| (random.unit() * n as f64) as i64;
        let mut holes = Vec::new();
        for slot in 0..SLOTS * SLOTS {
            let (x, y) = (slot % SLOTS * SLOT, slot / SLOTS * SLOT);
            let mut corner = |dx: i64, dy: i64| [x + 1 + dx + below(2), y + 1 + dy + below(2)];
            let quadrilateral = vec![corner(0, 0), corner(3, 0), corner(3, 3), corner(0, 3)];
            match below(4) {
                0 => {}
                1 => holes.push(quadrilateral[1..].to_vec()),
                _ => holes.push(quadrilateral),
            }
        }
        let holes = holes.into_iter().filter(|hole| is_convex(hole)).collect();
        World { outer: vec![[0, 0], [side, 0], [side, side], [0, side]], holes }
    }

    fn map(&self) -> PolygonMap {
        let ring = |ring: &Vec<[i64; 2]>| ring.iter().map(place).collect::<Vec<_>>();
        let holes: Vec<_> = self.holes.iter().map(ring).collect();
        PolygonMap::new(&ring(&self.outer), &holes).expect("a map")
    }

    /// Whether no hole's inside meets the segment. All corners of the holes turn left.
    fn is_free(&self, a: [i64; 2], b: [i64; 2]) -> bool {
        self.holes.iter().all(|hole| {
            // Where a + t (b - a) is strictly left of all sides: t between low and high, as fractions.
            let (mut low, mut high) = ((0_i64, 1_i64), (1_i64, 1_i64));
            for (p, q) in hole.iter().zip(hole.iter().cycle().skip(1)) {
                let (at_a, at_b) = (cross(*p, *q, a), cross(*p, *q, b));
                let gain = at_b - at_a;
                if gain == 0 {
                    if at_a <= 0 {
                        return true;
                    }
                    continue;
                }
                let t = (-at_a * gain.signum(), gain.abs());
                if gain > 0 && t.0 * low.1 > low.0 * t.1 {
                    low = t;
                }
                if gain < 0 && t.0 * high.1 < high.0 * t.1 {
                    high = t;
                }
            }
            low.0 * high.1 >= high.0 * low.1
        })
    }

    /// Dijkstra over all corners that see each other.
    fn shortest(&self, start: [i64; 2], goal: [i64; 2]) -> f64 {
        let places: Vec<[i64; 2]> = [start, goal].into_iter().chain(self.holes.iter().flatten().copied()).collect();
        let length = |a: [i64; 2], b: [i64; 2]| (place(&a) - place(&b)).norm();
        let mut best = vec![f64::INFINITY; places.len()];
        let mut is_done = vec![false; places.len()];
        best[0] = 0.0;
        loop {
            let open = (0..places.len()).filter(|k| !is_done[*k] && best[*k].is_finite());
            let Some(k) = open.min_by(|a, b| best[*a].total_cmp(&best[*b])) else { return best[1] };
            is_done[k] = true;
            for other in 0..places.len() {
                if self.is_free(places[k], places[other]) {
                    best[other] = best[other].min(best[k] + length(places[k], places[other]));
                }
            }
        }
    }
}

fn cross(p: [i64; 2], q: [i64; 2], r: [i64; 2]) -> i64 {
    (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
}

fn is_convex(ring: &[[i64; 2]]) -> bool {
    (0..ring.len()).all(|k| cross(ring[k], ring[(k + 1) % ring.len()], ring[(k + 2) % ring.len()]) > 0)
}

fn place(p: &[i64; 2]) -> Point2<f64> {
    Point2::new(p[0] as f64, p[1] as f64)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    /// Integers everywhere, starts and goals on corners, on walls, in line with both, or in walls.
    #[test]
    fn ways_are_as_long_as_brute_force_says(seed in any::<u64>()) {
        let mut random = SplitMix(seed);
        let world = World::drawn(&mut random);
        let map = world.map();
        for _ in 0..8 {
            let side = (SLOTS * SLOT + 1) as f64;
            let mut point = || [(random.unit() * side) as i64, (random.unit() * side) as i64];
            let (start, goal) = (point(), point());
            // A point in a hole sees nothing, not even itself.
            let route = map.route(&place(&start), &place(&goal));
            match route {
                Ok(route) => {
                    prop_assert!(world.is_free(start, start) && world.is_free(goal, goal));
                    let wanted = world.shortest(start, goal);
                    prop_assert!((route.length - wanted).abs() <= 1e-12 * (1.0 + wanted), "{start:?} {goal:?}: {} {wanted}", route.length);
                    prop_assert_eq!((route.points[0], route.points[route.points.len() - 1]), (place(&start), place(&goal)));
                    for leg in route.points.windows(2) {
                        let whole = |p: &Point2<f64>| [p.x as i64, p.y as i64];
                        prop_assert!(world.is_free(whole(&leg[0]), whole(&leg[1])), "{leg:?}");
                    }
                    let back = map.route(&place(&goal), &place(&start)).expect("the way back");
                    prop_assert!((back.length - route.length).abs() <= 1e-12 * (1.0 + wanted));
                }
                Err(NoWay::StartBlocked { nearest, .. }) => {
                    prop_assert!(!world.is_free(start, start));
                    prop_assert!(map.route(&nearest, &nearest).is_ok() || (nearest - place(&start)).norm() < 4.0);
                }
                Err(NoWay::GoalBlocked { nearest, .. }) => {
                    prop_assert!(world.is_free(start, start) && !world.is_free(goal, goal));
                    prop_assert!((nearest - place(&goal)).norm() < 4.0);
                }
                Err(other) => prop_assert!(false, "{other}"),
            }
        }
    }

    /// Moving, turning and stretching the world does the same to the way.
    #[test]
    fn lengths_follow_the_world(seed in any::<u64>(), angle in 0.0..std::f64::consts::TAU, log_scale in -3.0..3.0f64, x in -100.0..100.0f64, y in -100.0..100.0f64) {
        let mut random = SplitMix(seed);
        let world = World::drawn(&mut random);
        let scale = log_scale.exp();
        let motion = |p: &Point2<f64>| nalgebra::Rotation2::new(angle) * p * scale + nalgebra::Vector2::new(x, y);
        let ring = |ring: &Vec<[i64; 2]>| ring.iter().map(|p| motion(&place(p))).collect::<Vec<_>>();
        let holes: Vec<_> = world.holes.iter().map(ring).collect();
        let moved = PolygonMap::new(&ring(&world.outer), &holes).expect("a map");
        let map = world.map();
        let side = (SLOTS * SLOT) as f64;
        // The corridors between the slots are free.
        let start = Point2::new(0.5, 0.3 + random.unit() * (side - 0.6));
        let goal = Point2::new(side - 0.5, 0.3 + random.unit() * (side - 0.6));
        let (before, after) = (map.route(&start, &goal).expect("a way"), moved.route(&motion(&start), &motion(&goal)).expect("a way"));
        prop_assert!((after.length - scale * before.length).abs() <= 1e-9 * after.length, "{} {}", before.length, after.length / scale);
        prop_assert!(before.length >= (goal - start).norm());
    }
}

#[test]
fn what_cannot_be_a_map_or_a_way_is_refused_with_the_reason() {
    let square = |x: f64, y: f64, side: f64| {
        [[x, y], [x + side, y], [x + side, y + side], [x, y + side]].map(Point2::from).to_vec()
    };
    let outer = square(0.0, 0.0, 10.0);
    let with = |holes: &[Vec<Point2<f64>>]| PolygonMap::new(&outer, holes).map(|_| ());
    assert_eq!(with(&[]), Ok(()));
    assert_eq!(with(&[outer[..2].to_vec()]), Err(PolygonError::NoRing { ring: 1, count: 2 }));
    let flat = [[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]].map(Point2::from).to_vec();
    assert_eq!(with(&[flat]), Err(PolygonError::NoRing { ring: 1, count: 3 }));
    let mut bad = square(1.0, 1.0, 2.0);
    bad[2].y = f64::NAN;
    assert_eq!(with(&[bad]), Err(PolygonError::NotFinite { ring: 1, corner: 2 }));
    assert!(matches!(with(&[square(1.0, 1.0, 3.0), square(2.0, 2.0, 3.0)]), Err(PolygonError::Crossing { .. })));
    assert!(matches!(with(&[square(8.0, 8.0, 5.0)]), Err(PolygonError::Crossing { .. })));
    assert_eq!(with(&[square(1.0, 1.0, 2.0), square(3.0, 3.0, 2.0)]), Err(PolygonError::Touching));
    assert_eq!(with(&[square(20.0, 1.0, 2.0)]), Err(PolygonError::NotEnclosed));

    // A ring of walls with a yard inside: both sides are free, and nothing leads across.
    let yard: Vec<Point2<f64>> = [
        [2.0, 2.0],
        [8.0, 2.0],
        [8.0, 8.0],
        [2.0, 8.0],
        [2.0, 4.9],
        [3.0, 4.9],
        [3.0, 7.0],
        [7.0, 7.0],
        [7.0, 3.0],
        [3.0, 3.0],
        [3.0, 4.8],
        [2.0, 4.8],
    ]
    .map(Point2::from)
    .to_vec();
    let map = PolygonMap::new(&outer, &[yard]).expect("a map");
    let through = map.route(&Point2::new(1.0, 1.0), &Point2::new(5.0, 5.0)).expect("through the slit");
    assert!(through.length > 6.0 && through.length < 8.0, "{through:?}");
    assert_eq!(map.route(&Point2::new(f64::NAN, 1.0), &Point2::new(5.0, 5.0)), Err(NoWay::NotFinite));
    let nearest = Point2::new(10.0, 5.0);
    assert_eq!(
        map.route(&Point2::new(1.0, 1.0), &Point2::new(12.0, 5.0)),
        Err(NoWay::GoalBlocked { by: Obstruction::Outside, nearest })
    );
    assert_eq!(
        map.route(&Point2::new(12.0, 5.0), &Point2::new(1.0, 1.0)),
        Err(NoWay::StartBlocked { by: Obstruction::Outside, nearest })
    );
}

/// Beyond the map or in a piece of furniture: each is named, and the place that is offered instead can be reached.
#[test]
fn a_goal_that_cannot_be_says_why_and_offers_the_nearest_place() {
    let square = |x: f64, y: f64, side: f64| {
        [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)].map(|(dx, dy)| Point2::new(x + dx, y + dy)).to_vec()
    };
    let room = square(0.0, 0.0, 10.0);
    let table = square(2.0, 2.0, 1.0);
    let map = PolygonMap::new(&room, &[square(6.0, 6.0, 2.0), table]).expect("a map");
    let start = Point2::new(1.0, 1.0);
    for (goal, by, nearest) in [
        (Point2::new(30.0, 5.0), Obstruction::Outside, Point2::new(10.0, 5.0)),
        (Point2::new(2.5, 2.1), Obstruction::Hole(1), Point2::new(2.5, 2.0)),
        (Point2::new(7.9, 7.0), Obstruction::Hole(0), Point2::new(8.0, 7.0)),
    ] {
        let error = map.route(&start, &goal).unwrap_err();
        assert_eq!(error, NoWay::GoalBlocked { by, nearest });
        assert!(error.to_string().contains(&by.to_string()), "{error}");
        assert!(map.route(&start, &nearest).is_ok());
        assert!(matches!(map.route(&goal, &start), Err(NoWay::StartBlocked { by: held, .. }) if held == by));
    }
}
