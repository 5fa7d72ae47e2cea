//! People in a bare room, seen by rays: who walks is found, followed and forgotten, and nobody else is.

use nalgebra::{Point2, Point3, Vector2};
use omni_perception::{MoverConfig, MoverTrack, MoverTracker, Stamp};
use proptest::prelude::*;

const PERIOD_NS: i64 = 100_000_000;
const BODY_M: f64 = 0.22;
const EYE: Point3<f64> = Point3::new(0.0, 0.0, 0.5);
/// Half sides of the room.
const ROOM: Vector2<f64> = Vector2::new(6.0, 5.0);

/// Noise of a ray by its number: uniform, a centimetre.
fn noise(seed: u64) -> f64 {
    let mixed = (seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (seed >> 7)).wrapping_mul(0xD134_2543_DE82_EF95);
    ((mixed >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 0.02
}

/// What rays from the eye meet at some heights: the walls, a pillar that the map knows, and people.
fn scan(people: &[Point2<f64>], seed: u64) -> Vec<Point3<f32>> {
    let mut points = Vec::new();
    let pillar = (Point2::new(-3.0, 2.0), 0.3);
    for k in 0..512 {
        let (sin, cos) = (f64::from(k) / 512.0 * std::f64::consts::TAU).sin_cos();
        let wall = (ROOM.x / cos.abs()).min(ROOM.y / sin.abs());
        let disc = |(at, radius): (Point2<f64>, f64)| {
            let along = at.x * cos + at.y * sin;
            let beside = at.y * cos - at.x * sin;
            let deep = radius * radius - beside * beside;
            (along > 0.0 && deep > 0.0).then(|| along - deep.sqrt())
        };
        let discs = people.iter().map(|at| (*at, BODY_M)).chain([pillar]);
        let range = discs.filter_map(disc).fold(wall, f64::min);
        for ring in 0..8_u64 {
            let range = range + noise(seed.wrapping_mul(4096).wrapping_add(u64::from(k as u32) * 8 + ring));
            points.push(Point3::new(range * cos, range * sin, 0.2 + 0.2 * ring as f64).cast());
        }
    }
    points
}

/// Distance to what stands in the map: the walls and the pillar.
fn distance_m(p: &Point3<f64>) -> Option<f64> {
    let walls = (ROOM.x - p.x.abs()).min(ROOM.y - p.y.abs());
    let pillar = (p.xy() - Point2::new(-3.0, 2.0)).norm() - 0.3;
    (walls > 0.0).then(|| walls.min(pillar).max(0.0))
}

struct Watch {
    tracker: MoverTracker,
    now: Stamp,
}

impl Watch {
    fn new() -> Watch {
        Watch { tracker: MoverTracker::new(MoverConfig::default()), now: Stamp(0) }
    }

    fn see(&mut self, people: &[Point2<f64>]) {
        self.now = self.now.plus_ns(PERIOD_NS);
        let points = scan(people, self.now.0 as u64 / 1000);
        self.tracker.observe(self.now, &EYE, 0.0, &points, &distance_m);
    }

    fn movers(&self) -> Vec<&MoverTrack> {
        self.tracker.movers().collect()
    }
}

#[test]
fn a_room_in_which_nobody_moves_has_no_movers() {
    let mut watch = Watch::new();
    // Something stands there that the map has not got: it is no mover, however long it stands.
    for _ in 0..200 {
        watch.see(&[Point2::new(2.0, 1.0)]);
        assert!(watch.movers().is_empty());
    }
}

#[test]
fn who_stands_has_a_name_from_an_image_and_keeps_it_for_a_while() {
    let mut watch = Watch::new();
    let at = Point2::new(2.0, 1.0);
    let body = |z: f32| Point3::new(1.85, 0.93, z);
    for k in 0..100 {
        watch.see(&[at]);
        if k % 5 == 0 {
            watch.tracker.name(watch.now.plus_ns(-400_000_000), "person", &[body(0.3), body(1.0), body(1.7)]);
        }
        if k > 10 {
            let movers = watch.movers();
            assert_eq!(movers.len(), 1, "{movers:?}");
            assert!((movers[0].position - at).norm() < 0.2 && movers[0].stands(), "{movers:?}");
            assert_eq!((movers[0].id, movers[0].label.as_deref()), (0, Some("person")));
        }
    }
    let body = watch.tracker.bodies_at(watch.now)[0];
    assert!(body.holds(&Point3::new(2.1, 1.0, 1.2)) && !body.holds(&Point3::new(3.0, 1.0, 1.2)));
    // It is gone, as nobody goes: it is forgotten.
    (0..20).for_each(|_| watch.see(&[]));
    assert!(watch.movers().is_empty());
}

#[test]
fn an_empty_scan_numbers_that_are_none_and_old_scans_change_nothing() {
    let mut watch = Watch::new();
    watch.see(&[Point2::new(2.0, 0.0)]);
    let before = watch.tracker.clone();
    let rubbish = [Point3::new(f32::NAN, 0.0, 1.0), Point3::new(f32::INFINITY, f32::NAN, f32::NAN)];
    watch.tracker.observe(watch.now, &EYE, 0.0, &rubbish, &distance_m);
    assert_eq!(format!("{:?}", watch.tracker), format!("{before:?}"), "the same stamp again");
    watch.tracker.observe(watch.now.plus_ns(PERIOD_NS), &EYE, 0.0, &rubbish, &distance_m);
    watch.tracker.name(watch.now, "person", &rubbish);
    assert!(watch.movers().is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Who walks past is believed within a second and a half, is one and the same, and is where it is, as fast as it is.
    #[test]
    fn who_walks_is_followed(
        y in prop_oneof![-4.0..-0.9f64, 0.9..4.0f64], speed in 0.5..1.5f64, swaps: bool,
    ) {
        let mut watch = Watch::new();
        let direction = if swaps { -1.0 } else { 1.0 };
        let mut ids = std::collections::BTreeSet::new();
        let scans = (8.0 / speed * 10.0) as i32;
        for k in 0..scans {
            let at = Point2::new(direction * (-4.0 + 0.1 * speed * f64::from(k)), y);
            // The pillar stands in the way of some, and hides some.
            let to_pillar = (at - Point2::new(-3.0, 2.0)).norm();
            watch.see(&[at]);
            let movers = watch.movers();
            prop_assert!(movers.len() <= 1, "{movers:?}");
            if to_pillar < 1.0 || (at.x < -3.0 && at.y > 1.5) {
                return Ok(());
            }
            if k > 15 {
                prop_assert_eq!(movers.len(), 1, "at {} after {} scans", at, k);
                let mover = movers[0];
                ids.insert(mover.id);
                prop_assert!((mover.position - at).norm() < 0.25, "{} for {at}", mover.position);
                let error = (mover.velocity_mps - Vector2::new(direction * speed, 0.0)).norm();
                prop_assert!(error < 0.4, "{:?} at {speed}", mover.velocity_mps);
                let soon = mover.position_at(watch.now.plus_seconds(0.5));
                prop_assert!((soon - at - Vector2::new(direction * speed * 0.5, 0.0)).norm() < 0.45);
            }
        }
        prop_assert!(ids.len() <= 1, "{ids:?}");
    }

    /// Two who pass each other at arm's length stay who they are.
    #[test]
    fn two_who_pass_each_other_keep_their_numbers(y in 1.0..3.0f64, apart in 0.9..2.0f64, speed in 0.6..1.3f64) {
        let mut watch = Watch::new();
        let at = |k: i32| {
            let x = -3.5 + 0.1 * speed * f64::from(k);
            [Point2::new(x, -y), Point2::new(-x, -y - apart)]
        };
        let mut of_first = None;
        let scans = (7.0 / speed * 10.0) as i32;
        for k in 0..scans {
            watch.see(&at(k));
            let near = |p: &Point2<f64>| {
                let of = watch.tracker.movers().find(|mover| (mover.position - p).norm() < 0.3);
                of.map(|mover| mover.id)
            };
            if k == 20 {
                of_first = near(&at(k)[0]);
                prop_assert!(of_first.is_some());
            }
            // The nearer hides the other when they pass.
            if k + 1 == scans {
                prop_assert_eq!(near(&at(k)[0]), of_first);
            }
        }
    }
}
