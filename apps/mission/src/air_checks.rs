//! What a flyer looks up in the map again and again: is this flight still free, is this column, where else could it land.

use nalgebra::{Point3, Vector3};
use planner::{AirSpace, PolynomialTrajectory};

/// Voxels may shift by their size between two looks: only what comes this far into the robot's ball is an intrusion.
pub(crate) const INTRUSION_M: f64 = 0.05;
/// Rings round the place above which it shall land, where below it there is no room.
const LANDING_RINGS_M: [f64; 4] = [0.6, 1.2, 1.8, 2.4];

/// Whether a trajectory keeps `ball_m` away from what the map shows now, at samples. What is unknown was known when it was proved.
pub(crate) fn keeps(plan: &PolynomialTrajectory, ball_m: f64, air: &AirSpace) -> bool {
    samples_of(plan).all(|point| (air.distance)(&point).is_none_or(|distance_m| distance_m >= ball_m))
}

/// The same for a trajectory that nobody proved: where it goes nobody may have looked, so whatever of its ball is unknown counts as an
/// obstacle, except what is no nearer to it than to where it begins.
pub(crate) fn keeps_to_the_known(plan: &PolynomialTrajectory, ball_m: f64, cell_m: f64, air: &AirSpace) -> bool {
    let start = plan.sample(0.0).p;
    let cells = (ball_m / cell_m).ceil() as i32;
    let is_known_around = |point: &Point3<f64>| {
        let own = point.coords.map(|x| ((x / cell_m).floor() + 0.5) * cell_m);
        let shifts = || (-cells..=cells).map(|k| f64::from(k) * cell_m);
        shifts().all(|dz| {
            shifts().all(|dy| {
                shifts().all(|dx| {
                    let cell = Point3::from(own + Vector3::new(dx, dy, dz));
                    let apart_m = (cell - point).norm();
                    apart_m >= ball_m || apart_m >= (cell - start).norm() - 1e-6 || (air.distance)(&cell).is_some()
                })
            })
        })
    };
    keeps(plan, ball_m, air) && samples_of(plan).all(|point| is_known_around(&point))
}

fn samples_of(plan: &PolynomialTrajectory) -> impl Iterator<Item = Point3<f64>> {
    const STEP_S: f64 = 0.1;
    let duration_s = plan.duration();
    let steps = (duration_s / STEP_S).ceil().max(0.0) as usize;
    (0..=steps).map(move |step| plan.sample((step as f64 * STEP_S).min(duration_s)).p)
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
