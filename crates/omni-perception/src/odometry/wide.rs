//! Alignment from farther off than one cell: point to plane with the nearest cells, in a search that narrows.
//!
//! Used where the prediction cannot be trusted to a few centimetres: between the first scans of a moving body, after
//! being lost, at the start in a saved map. Costs ten to thirty milliseconds, so it is never part of usual tracking.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::odometry::degeneracy::{Degeneracy, weak_directions};
use crate::odometry::voxel_map::VoxelMap;

/// Search radii with their numbers of steps.
const STAGES: [(f64, usize); 3] = [(0.8, 6), (0.45, 5), (0.25, 8)];
/// Points used in the first stages and in the last.
const MAX_POINTS: [usize; 3] = [250, 350, 700];
/// A point this near to the plane of its nearest cell agrees, m.
const AGREES_M: f64 = 0.06;
/// Share of the points that must agree.
const MIN_AGREEING_SHARE: f64 = 0.6;
/// Fewest points that must agree.
const MIN_AGREEING: usize = 60;
/// Share of all planes below which a direction is not observed.
const MIN_SHARE: f64 = 0.01;
/// Damping: information of a prior of this spread about the current pose keeps unobserved directions still, m and rad.
const DAMPING_SIGMA: f64 = 0.3;

/// Moves `points` (in the frame that `guess` maps to the world) onto the planes of the map. `None` if they do not fit.
pub(crate) fn align(map: &VoxelMap, points: &[Point3<f64>], guess: &Isometry3<f64>) -> Option<Isometry3<f64>> {
    let mut pose = *guess;
    let mut agreeing = (0, 0);
    for ((radius_m, steps), max_points) in STAGES.into_iter().zip(MAX_POINTS) {
        let stride = points.len().div_ceil(max_points).max(1);
        let offsets = offsets_within(radius_m, f64::from(map.cell_m()));
        for _ in 0..steps {
            let mut information = Matrix6::zeros();
            let mut directions = Matrix3::zeros();
            let mut gradient = Vector6::zeros();
            agreeing = (0, 0);
            for point in points.iter().step_by(stride) {
                let in_world = pose * point;
                agreeing.1 += 1;
                let Some((normal, height_m)) = nearest_plane(map, &in_world, &offsets, radius_m) else { continue };
                agreeing.0 += usize::from(height_m.abs() < AGREES_M);
                let scale = 0.3 * radius_m;
                let weight = 1.0 / (1.0 + (height_m / scale).powi(2)).powi(2);
                let turn = (in_world - pose.translation.vector).coords.cross(&normal);
                let row = Vector6::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z);
                information += row * row.transpose() * weight;
                gradient -= row * (weight * height_m);
                directions += normal * normal.transpose() * weight;
            }
            // Where next to no plane looks along, the guess stays.
            let keep = Degeneracy {
                translations: weak_directions(&directions, MIN_SHARE * directions.trace()),
                ..Degeneracy::default()
            }
            .keep();
            let damping = Matrix6::identity() * (AGREES_M / DAMPING_SIGMA).powi(2);
            let step = (keep * information * keep + damping).cholesky()?.solve(&(keep * gradient));
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
            let moved = pose.translation.vector + step.fixed_rows::<3>(0);
            pose = Isometry3::from_parts(
                Translation3::from(moved),
                UnitQuaternion::new_normalize((turn * pose.rotation).into_inner()),
            );
            if step.amax() < 1e-3 {
                break;
            }
        }
    }
    let fits = agreeing.0 >= MIN_AGREEING && agreeing.0 as f64 >= MIN_AGREEING_SHARE * agreeing.1 as f64;
    (fits && pose.translation.vector.iter().all(|x| x.is_finite())).then_some(pose)
}

/// The plane of the cell whose mean is nearest, with the point's height above it.
fn nearest_plane(
    map: &VoxelMap,
    point: &Point3<f64>,
    offsets: &[([i32; 3], f64)],
    radius_m: f64,
) -> Option<(Vector3<f64>, f64)> {
    let home = map.key(point)?;
    let mut best = (radius_m * radius_m, None);
    for &(offset, nearest_m2) in offsets {
        if nearest_m2 >= best.0 {
            break;
        }
        let key = [0, 1, 2].map(|k| home[k].saturating_add(offset[k]));
        for cell in map.cells_at(key).filter(|cell| cell.has_plane()) {
            let from_mean = point - map.centre(key) - Vector3::from(cell.mean_m).cast::<f64>();
            let square = from_mean.norm_squared();
            if square < best.0 {
                let normal = Vector3::new(cell.plane[0], cell.plane[1], cell.plane[2]).cast::<f64>();
                let height = normal.dot(&(point - map.centre(key))) + f64::from(cell.plane[3]);
                best = (square, Some((normal, height)));
            }
        }
    }
    best.1
}

/// Voxels that come within `radius_m` of a point in the middle one, nearest first, with the square of the least
/// distance that any point of them can have.
fn offsets_within(radius_m: f64, cell_m: f64) -> Vec<([i32; 3], f64)> {
    let reach = (radius_m / cell_m).ceil() as i32;
    let range = || -reach..=reach;
    let mut offsets: Vec<_> = range()
        .flat_map(|x| range().flat_map(move |y| range().map(move |z| [x, y, z])))
        .map(|offset| {
            let gap = offset.map(|k| f64::from((k.abs() - 1).max(0)) * cell_m);
            (offset, gap.iter().map(|g| g * g).sum::<f64>())
        })
        .filter(|(_, square)| *square < radius_m * radius_m)
        .collect();
    offsets.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    offsets
}
