//! Speed zones in the air: a way is flown in stages, each under one limit that its proof holds at every instant.
//!
//! Before a zone that is slower than the robot flies, a stage ends at rest, so all braking is done at the border; through it the whole
//! stage is flown within the zone's limit, and behind it the next one is fast again.

use nalgebra::Point2;
use planner::{PolynomialTrajectory, SpeedZone};

/// The way is looked at in steps of this length.
const STEP_M: f64 = 0.05;
/// A stage before a zone is at least this long; a shorter one is flown as slowly as the zone demands.
const SHORTEST_M: f64 = 1.0;
/// Between two looks at a flight it moves by no more than this.
const SLACK_M: f64 = 0.02;

/// The first part of a way under one limit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stage {
    /// Where it ends.
    pub end: Point2<f64>,
    /// Largest speed on it.
    pub max_mps: f64,
    /// Length of the way beyond it, 0 for the last.
    pub left_m: f64,
}

/// The largest speed with the body's ball of `reach_m` at a place.
pub(super) fn limit_at(zones: &[SpeedZone], at: &Point2<f64>, reach_m: f64, free_mps: f64) -> f64 {
    let holding = zones.iter().filter(|slow| slow.holds(at, reach_m));
    holding.map(|slow| slow.max_mps).fold(free_mps, f64::min)
}

/// The first stage of a way; `free_mps` holds outside of all zones.
pub(super) fn first_stage(route: &[Point2<f64>], zones: &[SpeedZone], reach_m: f64, free_mps: f64) -> Stage {
    let (places, length_m) = places_along(route);
    let limit = |at: &Point2<f64>| limit_at(zones, at, reach_m + SLACK_M, free_mps);
    let (mut max_mps, mut begun_m) = (limit(&places[0].1), 0.0);
    for pair in places.windows(2) {
        let ((before_m, before), (here_m, here)) = (pair[0], pair[1]);
        let here_mps = limit(&here);
        let is_short = before_m - begun_m < SHORTEST_M;
        if here_mps == max_mps {
            continue;
        }
        if here_mps < max_mps && is_short {
            // Not worth a flight of its own: slow from the beginning.
            max_mps = here_mps;
            begun_m = before_m;
        } else if here_mps < max_mps {
            return Stage { end: before, max_mps, left_m: length_m - before_m };
        } else if length_m - here_m > STEP_M {
            return Stage { end: here, max_mps, left_m: length_m - here_m };
        }
    }
    Stage { end: places[places.len() - 1].1, max_mps, left_m: 0.0 }
}

/// The least limit that a flight of at most `max_mps` would exceed, with the body's ball of `reach_m`; `None` if it exceeds none.
pub(super) fn exceeded(flight: &PolynomialTrajectory, zones: &[SpeedZone], reach_m: f64, max_mps: f64) -> Option<f64> {
    const ROUNDING_MPS: f64 = 1e-6;
    if zones.is_empty() {
        return None;
    }
    let duration_s = flight.duration();
    let looks = (duration_s * max_mps / SLACK_M).ceil().max(1.0) as usize;
    let broken = (0..=looks).filter_map(|look| {
        let sample = flight.sample(duration_s * look as f64 / looks as f64);
        let limit = limit_at(zones, &sample.p.xy(), reach_m + SLACK_M, f64::INFINITY);
        (sample.v.norm() > limit + ROUNDING_MPS).then_some(limit)
    });
    broken.reduce(f64::min)
}

/// Places along a way with the length up to each, the last one included; and its whole length.
fn places_along(route: &[Point2<f64>]) -> (Vec<(f64, Point2<f64>)>, f64) {
    let mut places = vec![(0.0, route[0])];
    let mut length_m = 0.0;
    for leg in route.windows(2) {
        let along = leg[1] - leg[0];
        let steps = (along.norm() / STEP_M).ceil().max(1.0) as usize;
        let at = |step: usize| step as f64 / steps as f64;
        places.extend((1..=steps).map(|step| (length_m + along.norm() * at(step), leg[0] + along * at(step))));
        length_m += along.norm();
    }
    (places, length_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_through_a_zone_has_three_stages() {
        let corners = [[3.0, -1.0], [5.0, -1.0], [5.0, 1.0], [3.0, 1.0]].map(Point2::from);
        let zones = [SpeedZone::new(&corners, 0.3).unwrap()];
        let stage = |from: f64| first_stage(&[Point2::new(from, 0.0), Point2::new(9.0, 0.0)], &zones, 0.4, 1.5);
        let before = stage(0.0);
        assert!(before.max_mps == 1.5 && (2.5..2.6).contains(&before.end.x), "{before:?}");
        let through = stage(before.end.x);
        assert!(through.max_mps == 0.3 && (5.4..5.5).contains(&through.end.x), "{through:?}");
        assert!((through.left_m - (9.0 - through.end.x)).abs() < 1e-9);
        let after = stage(through.end.x);
        assert!(after.max_mps == 1.5 && after.end.x == 9.0 && after.left_m == 0.0, "{after:?}");
        // A way that ends inside is slow to its end, and one that begins inside is slow at once.
        let ends = first_stage(&[Point2::new(2.4, 0.0), Point2::new(4.0, 0.0)], &zones, 0.4, 1.5);
        assert_eq!((ends.max_mps, ends.left_m), (0.3, 0.0));
        assert_eq!(stage(4.0).max_mps, 0.3);
        assert_eq!(first_stage(&[Point2::origin()], &zones, 0.4, 1.5).left_m, 0.0);
    }
}
