//! Whole runs with zones: the way that was driven without them goes round them, in truth; and it is slow where it has to be.

mod support;

use arena::mission::mission::Outcome;
use arena::mission::robot_model::RobotKind;
use arena::mission::zones::Zones;
use arena::run::{RunConfig, RunResult};
use nalgebra::{Isometry2, Isometry3, Point2};
use support::{coarse, robot, run_from, scene, start};

const TEXT: &str = "find the plant";
const SEED: u64 = 1;

/// A square of half a side `half_m` round a place in the building, as a file tells it from the start.
fn file(start: &Isometry3<f64>, truth: &Point2<f64>, half_m: f64, list: &str, rest: &str) -> Zones {
    let flat = Isometry2::new(start.translation.vector.xy(), start.rotation.euler_angles().2);
    let corners: Vec<[f64; 2]> = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .iter()
        .map(|(x, y)| flat.inverse() * Point2::new(truth.x + half_m * x, truth.y + half_m * y))
        .map(|corner| [corner.x, corner.y])
        .collect();
    let text = format!("{{\"{list}\": [{{\"name\": \"here\", \"corners_m\": {corners:?}{rest}}}]}}");
    Zones::parse(&text).expect("a square")
}

/// The first place of what was truly driven that is a metre away.
fn on_the_way(result: &RunResult) -> Point2<f64> {
    let places = result.truth.poses.iter().map(|(_, pose)| Point2::from(pose.translation.vector.xy()));
    let start = Point2::from(result.truth.poses[0].1.translation.vector.xy());
    places.into_iter().find(|place| (place - start).norm() >= 1.0).expect("it went somewhere")
}

fn with(zones: Zones) -> RunConfig {
    let mut config = coarse(150.0);
    config.mission.zones = zones;
    config
}

fn goes_round_and_slowly(kind: RobotKind) {
    let (robot, scene) = (robot(kind), scene("spin"));
    let start = start(&scene, &robot, &coarse(1.0), SEED);
    let run = |config: &RunConfig| run_from(config, &robot, &scene, TEXT, &start, SEED);
    let free = run(&with(Zones::default()));
    assert!(free.summary.success && free.summary.zones.is_empty(), "{}", free.summary.reason);
    let place = on_the_way(&free);

    let keep_out = file(&start, &place, 0.2, "keep_out", "");
    let round = run(&with(keep_out));
    let [zone] = round.summary.zones.as_slice() else { panic!("one zone") };
    assert!(round.summary.success, "{}", round.summary.reason);
    assert_eq!((round.summary.keep_out_entries, zone.inside_s, round.summary.collisions), (0, 0.0, 0));

    let slow = run(&with(file(&start, &place, 0.5, "speed", ", \"max_mps\": 0.2")));
    let [zone] = slow.summary.zones.as_slice() else { panic!("one zone") };
    assert!(slow.summary.success, "{}", slow.summary.reason);
    assert!(zone.entries > 0 && zone.inside_s > 1.0, "the way leads through it: {zone:?}");
    assert_eq!(zone.excesses, 0, "{zone:?}");
    println!("{kind:?}: free {:.1} m, round {:.1} m, {zone:?}", free.summary.path_m, round.summary.path_m);
}

#[test]
fn a_ground_robot_goes_round_a_zone_and_slowly_through_another() {
    goes_round_and_slowly(RobotKind::Ground);
}

#[test]
fn an_aerial_robot_goes_round_a_zone_and_slowly_through_another() {
    goes_round_and_slowly(RobotKind::Aerial);
}

/// All within 1.2 m of the television is closed.
#[test]
fn a_target_in_a_zone_is_said_to_lie_there() {
    let (robot, scene) = (robot(RobotKind::Ground), scene("spin"));
    let start = start(&scene, &robot, &coarse(1.0), SEED);
    let thing = scene.building.objects.iter().find(|object| object.class == "television").expect("a television");
    let at = Point2::from(thing.bounds.center().xy());
    let half_m = 0.5 * (thing.bounds.max - thing.bounds.min).xy().max() + 1.2;
    let result =
        run_from(&with(file(&start, &at, half_m, "keep_out", "")), &robot, &scene, "find the television", &start, SEED);
    assert_eq!(result.summary.keep_out_entries, 0);
    let Some(Outcome::GaveUp { reason }) = &result.mission.outcome else { panic!("{}", result.summary.reason) };
    println!("{reason}");
    assert!(reason.contains("cannot get there: it lies in the keep-out zone \"here\". The nearest place"), "{reason}");
}
