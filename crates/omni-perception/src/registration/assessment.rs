//! How good a registration is: distances of the pairs, covariance, and what nothing holds.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Vector3, Vector6};

use crate::registration::kd_tree::KdTree;
use crate::registration::step::{held, hold};
use crate::registration::surface::Surface;
use crate::registration::{NONE, Registration, RegistrationConfig};

/// Figures of the final pairs; `None` if their planes leave some direction open.
pub(crate) fn assess(
    source: &Surface,
    target: &Surface,
    nearest: &[u32],
    target_from_source: Isometry3<f64>,
    config: &RegistrationConfig,
) -> Option<Registration> {
    let (mut inliers, mut squared, mut along) = (0, 0.0, 0.0);
    let mut information = Matrix6::zeros();
    let (mut facing, mut planes, mut weighted, mut weights) = (Matrix3::zeros(), 0.0_f64, 0.0, 0.0_f64);
    let turn = target_from_source.rotation.inverse();
    for (point, index) in source.points().iter().zip(nearest) {
        if *index == NONE {
            continue;
        }
        let point = point.cast::<f64>();
        let difference = target_from_source * point - target.points()[*index as usize].cast::<f64>();
        inliers += 1;
        squared += difference.norm_squared();
        let normal = turn * target.normals[*index as usize].cast::<f64>();
        if normal == Vector3::zeros() {
            continue;
        }
        let off_m = (turn * difference).dot(&normal);
        along += off_m * off_m;
        let weight = 1.0 / (1.0 + (off_m / config.robust_m).powi(2));
        let moment = point.coords.cross(&normal);
        let row = Vector6::new(normal.x, normal.y, normal.z, moment.x, moment.y, moment.z);
        information += weight * row * row.transpose();
        facing += normal * normal.transpose();
        planes += 1.0;
        weighted += weight * off_m * off_m;
        weights += weight;
    }
    let variance_m2 = weighted / (weights - 6.0).max(1.0);
    let mut covariance = hold(information, config.freedom).cholesky()?.inverse() * variance_m2;
    for axis in held(config.freedom) {
        covariance[(*axis, *axis)] = 0.0;
    }
    let count = (inliers as f64).max(1.0);
    Some(Registration {
        target_from_source,
        inliers,
        inlier_share: inliers as f64 / source.points().len().max(1) as f64,
        rmse_m: (squared / count).sqrt(),
        plane_rmse_m: (along / planes.max(1.0)).sqrt(),
        iterations: 0,
        converged: false,
        covariance,
        least_support: (facing / planes.max(1.0)).symmetric_eigenvalues().min().max(0.0),
    })
}

/// How well a pose fits, over all points of two clouds without any thinning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Source points with a target point within reach.
    pub inliers: usize,
    /// Root mean square distance of these pairs, metres; zero if there are none.
    pub rmse_m: f64,
}

/// Measures a pose on all finite points. Cost: a tree over the target and a search for each source point, several times that of
/// [`register`](crate::register).
pub fn fit(
    source: &[Point3<f32>],
    target: &[Point3<f32>],
    target_from_source: &Isometry3<f64>,
    max_distance_m: f64,
) -> Fit {
    let is_finite = |point: &&Point3<f32>| point.iter().all(|c| c.is_finite());
    let tree = KdTree::new(target.iter().filter(is_finite).copied().collect());
    let (mut inliers, mut squared) = (0, 0.0);
    for point in source.iter().filter(is_finite) {
        let moved = (target_from_source * point.cast::<f64>()).cast::<f32>();
        if let Some((_, squared_m2)) = tree.nearest(&moved, (max_distance_m * max_distance_m) as f32) {
            inliers += 1;
            squared += f64::from(squared_m2);
        }
    }
    Fit { inliers, rmse_m: if inliers == 0 { 0.0 } else { (squared / inliers as f64).sqrt() } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_counts_all_points() {
        let cloud = [Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0), Point3::new(f32::NAN, 0.0, 0.0)];
        let found = fit(&cloud, &[Point3::new(0.0, 0.3, 0.0)], &Isometry3::identity(), 0.5);
        assert_eq!(found.inliers, 1);
        assert!((found.rmse_m - 0.3).abs() < 1e-6);
        assert_eq!(fit(&cloud, &[], &Isometry3::identity(), 0.5), Fit { inliers: 0, rmse_m: 0.0 });
    }
}
