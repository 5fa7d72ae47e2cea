//! What a flyer looks up in the map again and again: is this flight still free, is this column, where else could it land.

use nalgebra::{Point3, Vector3};
use planner::{AirSpace, PolynomialTrajectory};

/// Voxels may shift by their size between two looks: only what comes this far into the robot's ball is an intrusion.
pub(crate) const INTRUSION_M: f64 = 0.05;
/// Rings round the place above which it shall land, where below it there is no room.
const LANDING_RINGS_M: [f64; 4] = [0.6, 1.2, 1.8, 2.4];

/// Whether a trajectory keeps `ball_m` away from what the map shows now, at samples. `if_unknown`: the answer where nobody has
/// looked.
pub(crate) fn keeps(plan: &PolynomialTrajectory, ball_m: f64, if_unknown: bool, air: &AirSpace) -> bool {
    const STEP_S: f64 = 0.1;
    let duration_s = plan.duration();
    let steps = (duration_s / STEP_S).ceil().max(0.0) as usize;
    (0..=steps).all(|step| {
        let point = plan.sample((step as f64 * STEP_S).min(duration_s)).p;
        (air.distance)(&point).map_or(if_unknown, |distance_m| distance_m >= ball_m)
    })
}

/// Whether nothing that is known is in the column between a place and a height, but for the ground on which it stands at `ground_m`.
pub(crate) fn is_column_free(at: &Point3<f64>, other_m: f64, ground_m: f64, radius_m: f64, air: &AirSpace) -> bool {
    const STEP_M: f64 = 0.1;
    let ball_m = radius_m - INTRUSION_M;
    let lowest_m = ground_m.max(at.z.min(other_m)) + ball_m;
    let steps = ((at.z.max(other_m) - lowest_m) / STEP_M).ceil().max(0.0) as usize;
    (0..=steps).all(|step| {
        let point = Point3::new(at.x, at.y, lowest_m + step as f64 * STEP_M);
        (air.distance)(&point).is_none_or(|distance_m| distance_m >= ball_m)
    })
}

/// Places round one at the same height, the nearest first.
pub(crate) fn landing_places(here: Point3<f64>) -> impl Iterator<Item = Point3<f64>> {
    LANDING_RINGS_M.iter().flat_map(move |radius_m| {
        (0..8).map(move |k| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_4 * f64::from(k)).sin_cos();
            here + Vector3::new(radius_m * cos, radius_m * sin, 0.0)
        })
    })
}
