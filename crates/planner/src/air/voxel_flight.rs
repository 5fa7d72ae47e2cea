//! From a map of voxels to a proved flight: route, convex corridor, flight.

use nalgebra::{Point3, Vector3};

use super::corridor_flight::{CorridorError, CorridorFlight, fly_corridor};
use super::depth::deepest_point;
use super::interior::InteriorSettings;
use super::limits::FlightLimits;
use super::polytope::Polytope;
use super::region::region;
use super::voxel_map::VoxelMap;

/// A leg of the route is cut into parts of at most this length (m).
const LONGEST_PART_M: f64 = 7.0;
/// A polytope reaches at most this far from its part of the route (m).
const REACH_M: f64 = 3.0;
/// The route keeps this share of a voxel from occupied ones where it was cut; polytopes keep the route inside by half of it.
const MARGIN: f64 = 0.1;
/// Polytopes that overlap by this much are joined directly, and what lies between is left out (m).
const SHORTCUT_M: f64 = 0.1;

/// A flight through free voxels.
#[derive(Debug, Clone)]
pub struct VoxelFlight {
    /// The route that the corridor follows.
    pub route: Vec<Point3<f64>>,
    /// Polytopes without any part of an occupied voxel, each overlapping the next.
    pub corridor: Vec<Polytope>,
    /// The flight in it.
    pub flight: CorridorFlight,
}

/// Why there is none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum VoxelFlightError {
    /// The margin is negative, or not less than half a voxel.
    #[error("the margin must be at least 0 and less than {most_m} m, half a voxel, not {margin_m} m")]
    BadMargin {
        /// What it was.
        margin_m: f64,
        /// Half a voxel.
        most_m: f64,
    },
    /// The start is not in a free voxel.
    #[error("the start is not in a free voxel")]
    StartBlocked,
    /// The goal is not in a free voxel.
    #[error("the goal is not in a free voxel")]
    GoalBlocked,
    /// No way leads from start to goal.
    #[error("no way through free voxels")]
    NoRoute,
    /// A part of the route touches an occupied voxel, so that no plane parts them: start or goal at the very border of one.
    #[error("part {part} of the route touches an occupied voxel")]
    NoRegion {
        /// Its number.
        part: usize,
    },
    /// There is a corridor, but no flight in it.
    #[error(transparent)]
    Corridor(#[from] CorridorError),
}

/// Plans from rest to rest through the free voxels of a map (which has been grown by the size of the vehicle). The flight keeps
/// `margin_m` from every occupied voxel: what whoever follows it may be off by; less than half a voxel, and 0 is allowed.
///
/// # Errors
/// [`VoxelFlightError`].
pub fn fly_voxels(
    map: &VoxelMap,
    start: &Point3<f64>,
    goal: &Point3<f64>,
    margin_m: f64,
    limits: &FlightLimits,
    settings: &InteriorSettings,
) -> Result<VoxelFlight, VoxelFlightError> {
    if !(0.0..0.5 * map.voxel_m()).contains(&margin_m) {
        return Err(VoxelFlightError::BadMargin { margin_m, most_m: 0.5 * map.voxel_m() });
    }
    if !map.is_free(start) {
        return Err(VoxelFlightError::StartBlocked);
    }
    if !map.is_free(goal) {
        return Err(VoxelFlightError::GoalBlocked);
    }
    let route = map.route(start, goal, margin_m + MARGIN * map.voxel_m()).ok_or(VoxelFlightError::NoRoute)?;
    let corridor = shortcut(cover(map, &route, margin_m)?, &start.coords, &goal.coords);
    let at_rest = |p: &Point3<f64>| [p.coords, Vector3::zeros(), Vector3::zeros()];
    let flight = fly_corridor(&at_rest(start), &at_rest(goal), &corridor, limits, settings)?;
    Ok(VoxelFlight { route, corridor, flight })
}

/// One region for each part of the route.
fn cover(map: &VoxelMap, route: &[Point3<f64>], margin_m: f64) -> Result<Vec<Polytope>, VoxelFlightError> {
    let (low, high) = map.bounds();
    let mut corridor = Vec::new();
    for leg in route.windows(2) {
        let parts = ((leg[1] - leg[0]).norm() / LONGEST_PART_M).ceil().max(1.0) as usize;
        for k in 0..parts {
            let at = |k: usize| (leg[0] + (leg[1] - leg[0]) * (k as f64 / parts as f64)).coords;
            let (a, b) = (at(k), at(k + 1));
            let reach = Vector3::repeat(REACH_M);
            let wider = Vector3::repeat(margin_m);
            // Outside the map everything is occupied; start and goal may be nearer to it than the margin.
            let from = (a.inf(&b) - reach).sup(&(low.coords + wider)).inf(&a.inf(&b));
            let to = (a.sup(&b) + reach).inf(&(high.coords - wider)).sup(&a.sup(&b));
            let around = Polytope::from_box(&Point3::from(from), &Point3::from(to));
            let voxels = map.surface_in_box(&(from - wider), &(to + wider));
            let least_m = 0.1 * MARGIN * map.voxel_m();
            let found = region(&a, &b, &around, &voxels, map.voxel_m() + 2.0 * margin_m, least_m)
                .ok_or(VoxelFlightError::NoRegion { part: corridor.len() })?;
            corridor.push(found);
        }
    }
    Ok(corridor)
}

/// From each kept polytope to the last one that overlaps it well.
fn shortcut(corridor: Vec<Polytope>, start: &Vector3<f64>, goal: &Vector3<f64>) -> Vec<Polytope> {
    let count = corridor.len();
    // The first one is the last that holds the start, the last one the first that holds the goal.
    let first = (0..count).rev().find(|k| corridor[*k].slack(start) >= SHORTCUT_M).unwrap_or(0);
    let last = (first..count).find(|k| corridor[*k].slack(goal) >= SHORTCUT_M).unwrap_or(count - 1);
    let mut kept = vec![first];
    let mut at = first;
    while at < last {
        let overlaps = |k: usize| {
            let faces = corridor[at].faces.iter().chain(&corridor[k].faces);
            deepest_point(faces, goal).is_some_and(|(_, depth)| depth >= SHORTCUT_M)
        };
        at = (at + 2..=last).rev().find(|k| overlaps(*k)).unwrap_or(at + 1);
        kept.push(at);
    }
    let mut corridor: Vec<Option<Polytope>> = corridor.into_iter().map(Some).collect();
    kept.into_iter().filter_map(|k| corridor[k].take()).collect()
}
