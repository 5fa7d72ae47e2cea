//! Where one scan lies in another, from a guess: generalised ICP (Segal, Haehnel, Thrun, "Generalized-ICP", RSS 2009).
//!
//! ```text
//! C = I - (1 - e) n n^T                         a point of a surface: sure along its normal n, free within it
//! M_i = (C_target,i + R C_source,i R^T)^-1      of each source point and the target point nearest to it
//! T = argmin sum_i rho(d_i^T M_i d_i),          d_i = q_i - T p_i, rho of Cauchy
//! ```
//! Solved by Gauss-Newton on SE(3) with `T <- T Exp(step)`; the pairs are found anew in each round. [`register`] is the whole way;
//! [`Surface`] and [`align`] are its parts, for one map and many scans.

pub mod kd_tree;
pub mod surface;
pub mod thinning;

use std::fmt;

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use thiserror::Error;

use crate::registration::kd_tree::{KdTree, MOST_NEIGHBOURS};
pub use crate::registration::surface::Surface;

/// What may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Freedom {
    /// Six degrees of freedom.
    #[default]
    Free,
    /// Translation and the turn about z: both clouds are level, for gravity was measured.
    Level,
}

/// Settings of a registration.
#[derive(Debug, Clone, PartialEq)]
pub struct RegistrationConfig {
    /// Both clouds are thinned to one point per cube of this edge, metres, default 0.25 (rooms: 0.10).
    pub leaf_m: f64,
    /// Points to which a normal is fitted, default 10.
    pub neighbours: usize,
    /// Pairs farther apart do not count, metres, default 1.0.
    pub max_distance_m: f64,
    /// Standard deviation of a surface along its normal over that within it, squared; default 0.02 (3.5 cm of noise in a
    /// cell of 25 cm).
    pub flatness: f64,
    /// Residual along the normals at which a pair has half its weight, metres, default 0.20.
    pub robust_m: f64,
    /// Most rounds, default 30.
    pub max_iterations: usize,
    /// A step shorter than this is the last, metres, default 1e-3.
    pub stop_translation_m: f64,
    /// ... and turned less than this, radians, default 5e-4.
    pub stop_rotation_rad: f64,
    /// Fewer points or pairs are no answer, default 30.
    pub min_inliers: usize,
    /// What may move, default [`Freedom::Free`].
    pub freedom: Freedom,
}

impl Default for RegistrationConfig {
    fn default() -> Self {
        Self {
            leaf_m: 0.25,
            neighbours: 10,
            max_distance_m: 1.0,
            flatness: 0.02,
            robust_m: 0.20,
            max_iterations: 30,
            stop_translation_m: 1e-3,
            stop_rotation_rad: 5e-4,
            min_inliers: 30,
            freedom: Freedom::Free,
        }
    }
}

impl RegistrationConfig {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`RegistrationError::Config`] names the field and what it must be.
    pub fn validate(&self) -> Result<(), RegistrationError> {
        let positive = [
            ("leaf_m", self.leaf_m),
            ("max_distance_m", self.max_distance_m),
            ("flatness", self.flatness),
            ("robust_m", self.robust_m),
            ("stop_translation_m", self.stop_translation_m),
            ("stop_rotation_rad", self.stop_rotation_rad),
        ];
        for (field, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(RegistrationError::Config { field, value, wanted: "a positive number" });
            }
        }
        if self.flatness > 1.0 {
            return Err(RegistrationError::Config { field: "flatness", value: self.flatness, wanted: "at most 1" });
        }
        if !(3..=MOST_NEIGHBOURS).contains(&self.neighbours) {
            let value = self.neighbours as f64;
            return Err(RegistrationError::Config { field: "neighbours", value, wanted: "from 3 to 32" });
        }
        if self.min_inliers < 6 {
            let value = self.min_inliers as f64;
            return Err(RegistrationError::Config { field: "min_inliers", value, wanted: "at least 6" });
        }
        Ok(())
    }
}

/// Which cloud an error means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cloud {
    /// The one that is moved.
    Source,
    /// The one that stays.
    Target,
}

impl fmt::Display for Cloud {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Cloud::Source => "source",
            Cloud::Target => "target",
        })
    }
}

/// Why there is no registration.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RegistrationError {
    /// A setting makes no sense.
    #[error("{field} is {value}, it must be {wanted}")]
    Config {
        /// Which.
        field: &'static str,
        /// What it is.
        value: f64,
        /// What would do.
        wanted: &'static str,
    },
    /// A cloud has too few points after thinning.
    #[error(
        "the {cloud} cloud has {found} points after thinning, at least {needed} are needed ({dropped} were not finite or too far away)"
    )]
    TooFewPoints {
        /// Which cloud.
        cloud: Cloud,
        /// Points left.
        found: usize,
        /// Points wanted.
        needed: usize,
        /// Points left out.
        dropped: usize,
    },
    /// The guess holds numbers that are not finite.
    #[error("the guess is not a finite pose")]
    Guess,
    /// Too few points of the source have a point of the target nearby: the guess is too far off, or they show different places.
    #[error("only {found} points of the source lie near the target, at least {needed} are needed")]
    NoOverlap {
        /// Pairs found.
        found: usize,
        /// Pairs wanted.
        needed: usize,
    },
    /// The pairs leave some direction open, for example along an empty wall.
    #[error("the clouds do not fix the pose in every direction")]
    Degenerate,
}

/// Where the source lies in the target.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// Takes points of the source into the target.
    pub target_from_source: Isometry3<f64>,
    /// Points of the thinned source with a point of the thinned target within `max_distance_m`.
    pub inliers: usize,
    /// ... as a share of the thinned source.
    pub inlier_share: f64,
    /// Root mean square distance of these pairs, metres: from point to point, so that half a leaf remains of a perfect fit.
    pub rmse_m: f64,
    /// Root mean square distance of these pairs along the target's normals, metres.
    pub plane_rmse_m: f64,
    /// Rounds.
    pub iterations: usize,
    /// Whether the last step was shorter than asked for.
    pub converged: bool,
    /// Covariance of (translation, rotation) of `T Exp(step)` in the source frame, m^2 and rad^2, from what the planes of the target
    /// say and how far off them the pairs are; zero where [`Freedom::Level`] holds a direction.
    pub covariance: Matrix6<f64>,
    /// Mean square of the cosine between the planes' normals and the direction in which fewest planes face, from 0 (nothing
    /// stops a shift along it, as in an empty corridor) to 1/3 (all directions alike).
    pub least_support: f64,
}

/// Aligns `source` with `target`, starting at `guess` (takes the source into the target).
///
/// # Errors
/// [`RegistrationError`]: too few finite points, no overlap at the guess, or a direction that nothing fixes.
pub fn register(
    source: &[Point3<f32>],
    target: &[Point3<f32>],
    guess: &Isometry3<f64>,
    config: &RegistrationConfig,
) -> Result<Registration, RegistrationError> {
    let source = Surface::new(source, config, Cloud::Source)?;
    let target = Surface::new(target, config, Cloud::Target)?;
    align(&source, &target, guess, config)
}

/// The second half of [`register`]: aligns two surfaces.
///
/// # Errors
/// See [`register`].
pub fn align(
    source: &Surface,
    target: &Surface,
    guess: &Isometry3<f64>,
    config: &RegistrationConfig,
) -> Result<Registration, RegistrationError> {
    config.validate()?;
    if !guess.to_homogeneous().iter().all(|v| v.is_finite()) {
        return Err(RegistrationError::Guess);
    }
    let mut target_from_source = *guess;
    let mut nearest = vec![NONE; source.points().len()];
    let (mut iterations, mut converged) = (0, false);
    while iterations < config.max_iterations && !converged {
        // 1. The target point nearest to each source point.
        pair(source, target, &target_from_source, config, &mut nearest);
        // 2. The step that the pairs ask for.
        let sums = Sums::of(source, target, &nearest, &target_from_source, config);
        if sums.pairs < config.min_inliers {
            return Err(RegistrationError::NoOverlap { found: sums.pairs, needed: config.min_inliers });
        }
        let step = sums.solve(config.freedom).ok_or(RegistrationError::Degenerate)?;
        // 3. T <- T Exp(step).
        let (shift, turn) = (step.fixed_rows::<3>(0).into_owned(), step.fixed_rows::<3>(3).into_owned());
        target_from_source *= Isometry3::from_parts(shift.into(), UnitQuaternion::from_scaled_axis(turn));
        target_from_source.rotation.renormalize();
        iterations += 1;
        converged = shift.norm() < config.stop_translation_m && turn.norm() < config.stop_rotation_rad;
    }
    pair(source, target, &target_from_source, config, &mut nearest);
    assess(source, target, &nearest, target_from_source, config)
        .map(|assessed| Registration { iterations, converged, ..assessed })
        .ok_or(RegistrationError::Degenerate)
}

/// No target point within reach.
const NONE: u32 = u32::MAX;

/// Finds the target point nearest to each source point. That of the round before bounds the search: it is hardly ever far off.
fn pair(
    source: &Surface,
    target: &Surface,
    target_from_source: &Isometry3<f64>,
    config: &RegistrationConfig,
    nearest: &mut [u32],
) {
    let reach_m2 = (config.max_distance_m * config.max_distance_m) as f32;
    let points = target.points();
    for (point, nearest) in source.points().iter().zip(nearest) {
        let moved = (target_from_source * point.cast::<f64>()).cast::<f32>();
        let known_m2 = points.get(*nearest as usize).map_or(reach_m2, |before| (before - moved).norm_squared());
        *nearest = match target.tree.nearest(&moved, known_m2.min(reach_m2)) {
            Some((index, _)) => index as u32,
            // Nothing is nearer than the one before, which counts if it is within reach.
            None if known_m2 < reach_m2 => *nearest,
            None => NONE,
        };
    }
}

/// The normal equations of one round, in the source frame.
struct Sums {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    pairs: usize,
}

impl Sums {
    fn of(
        source: &Surface,
        target: &Surface,
        nearest: &[u32],
        target_from_source: &Isometry3<f64>,
        config: &RegistrationConfig,
    ) -> Sums {
        let source_from_target = target_from_source.inverse();
        let turn = source_from_target.rotation.to_rotation_matrix();
        // d^T M d of a pair that is robust_m apart along both normals.
        let half_weight_cost = config.robust_m * config.robust_m / (2.0 * config.flatness);
        let mut sums = Sums { information: Matrix6::zeros(), gradient: Vector6::zeros(), pairs: 0 };
        let (mut vv, mut vw, mut ww) = (Matrix3::zeros(), Matrix3::zeros(), Matrix3::zeros());
        let (mut gv, mut gw) = (Vector3::zeros(), Vector3::zeros());
        for (rank, index) in nearest.iter().enumerate() {
            if *index == NONE {
                continue;
            }
            let point = source.points()[rank].coords.cast::<f64>();
            let other = source_from_target * target.points()[*index as usize].cast::<f64>();
            let difference = other.coords - point;
            let normal_s = source.normals[rank].cast::<f64>();
            let normal_t = turn * target.normals[*index as usize].cast::<f64>();
            let metric = metric(&normal_s, &normal_t, config.flatness);
            let pull = metric * difference;
            let cost = difference.dot(&pull);
            // Cauchy: the weight of rho(c) = s log(1 + c / s).
            let weight = 1.0 / (1.0 + cost / half_weight_cost);
            let (metric, pull) = (metric * weight, pull * weight);
            // d(T Exp(v, w) p) = R (v + w x p): the Jacobian of d in the source frame is -[I, -hat(p)].
            let hat = point.cross_matrix();
            let metric_hat = metric * hat;
            vv += metric;
            vw -= metric_hat;
            ww -= hat * metric_hat;
            gv += pull;
            gw += point.cross(&pull);
            sums.pairs += 1;
        }
        sums.information.fixed_view_mut::<3, 3>(0, 0).copy_from(&vv);
        sums.information.fixed_view_mut::<3, 3>(0, 3).copy_from(&vw);
        sums.information.fixed_view_mut::<3, 3>(3, 0).copy_from(&vw.transpose());
        sums.information.fixed_view_mut::<3, 3>(3, 3).copy_from(&ww);
        sums.gradient.fixed_rows_mut::<3>(0).copy_from(&gv);
        sums.gradient.fixed_rows_mut::<3>(3).copy_from(&gw);
        sums
    }

    /// The Gauss-Newton step; `None` if some direction is open.
    fn solve(mut self, freedom: Freedom) -> Option<Vector6<f64>> {
        for axis in held(freedom) {
            self.gradient[*axis] = 0.0;
        }
        let step = hold(self.information, freedom).cholesky()?.solve(&self.gradient);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}

/// Coordinates of a step that may not move: turns about x and y.
fn held(freedom: Freedom) -> &'static [usize] {
    match freedom {
        Freedom::Free => &[],
        Freedom::Level => &[3, 4],
    }
}

/// The information matrix with the held coordinates cut out, so that it can be inverted.
fn hold(mut information: Matrix6<f64>, freedom: Freedom) -> Matrix6<f64> {
    for axis in held(freedom) {
        information.row_mut(*axis).fill(0.0);
        information.column_mut(*axis).fill(0.0);
        information[(*axis, *axis)] = 1.0;
    }
    information
}

/// The inverse of `C_source + C_target` for two surface points with these normals (zero: as free in every direction).
fn metric(a: &Vector3<f64>, b: &Vector3<f64>, flatness: f64) -> Matrix3<f64> {
    let k = 1.0 - flatness;
    // 2 I - k (a a^T + b b^T): symmetric, eigenvalues from 2 e to 2, so the inverse by cofactors is safe.
    let xx = 2.0 - k * (a.x * a.x + b.x * b.x);
    let yy = 2.0 - k * (a.y * a.y + b.y * b.y);
    let zz = 2.0 - k * (a.z * a.z + b.z * b.z);
    let xy = -k * (a.x * a.y + b.x * b.y);
    let xz = -k * (a.x * a.z + b.x * b.z);
    let yz = -k * (a.y * a.z + b.y * b.z);
    let (cxx, cxy, cxz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (cyy, cyz, czz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let over = 1.0 / (xx * cxx + xy * cxy + xz * cxz);
    Matrix3::new(cxx, cxy, cxz, cxy, cyy, cyz, cxz, cyz, czz) * over
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
/// [`register`].
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

/// Figures of the final pairs; `None` if their planes leave some direction open.
fn assess(
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A corner of three walls, 5 cm apart.
    fn corner() -> Vec<Point3<f32>> {
        let grid = || (0..40).flat_map(|i| (0..40).map(move |j| (i as f32 * 0.05, j as f32 * 0.05)));
        let floor = grid().map(|(u, v)| Point3::new(u, v, 0.0));
        let left = grid().map(|(u, v)| Point3::new(u, 2.0, v));
        let front = grid().map(|(u, v)| Point3::new(2.0, u, v));
        floor.chain(left).chain(front).collect()
    }

    fn rooms() -> RegistrationConfig {
        RegistrationConfig { leaf_m: 0.10, ..RegistrationConfig::default() }
    }

    #[test]
    fn the_metric_is_the_inverse_of_both_covariances() {
        let (a, b) = (Vector3::new(0.6, 0.0, 0.8), Vector3::new(0.0, 1.0, 0.0));
        let of = |n: &Vector3<f64>| Matrix3::identity() - 0.98 * n * n.transpose();
        assert!((metric(&a, &b, 0.02) * (of(&a) + of(&b)) - Matrix3::identity()).norm() < 1e-12);
        let planeless: Matrix3<f64> = metric(&Vector3::zeros(), &Vector3::zeros(), 0.02);
        assert!((planeless - Matrix3::identity() * 0.5).norm() < 1e-12);
    }

    #[test]
    fn the_gradient_is_the_derivative_of_the_cost() {
        // Weights that do not change with the pose: the robust scale is out of reach.
        let config = RegistrationConfig { robust_m: 1e6, ..rooms() };
        let source = Surface::new(&corner(), &config, Cloud::Source).unwrap();
        let target = Surface::new(&corner(), &config, Cloud::Target).unwrap();
        let pose = Isometry3::new(Vector3::new(0.03, -0.02, 0.01), Vector3::new(0.02, -0.01, 0.03));
        let mut nearest = vec![NONE; source.points().len()];
        pair(&source, &target, &pose, &config, &mut nearest);
        let sums = Sums::of(&source, &target, &nearest, &pose, &config);
        // Pairs and metrics are those of `pose`, as in a Gauss-Newton step.
        let cost = |moved: &Isometry3<f64>| -> f64 {
            let each = source.points().iter().zip(&source.normals).zip(&nearest);
            each.filter(|(_, index)| **index != NONE)
                .map(|((point, normal), index)| {
                    let normal = pose.rotation * normal.cast::<f64>();
                    let metric = metric(&normal, &target.normals[*index as usize].cast::<f64>(), config.flatness);
                    let d = target.points()[*index as usize].cast::<f64>() - moved * point.cast::<f64>();
                    d.dot(&(metric * d))
                })
                .sum()
        };
        const STEP: f64 = 1e-6;
        for axis in 0..6 {
            let nudge = |h: f64| {
                let mut step = Vector6::zeros();
                step[axis] = h;
                let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
                pose * Isometry3::from_parts(step.fixed_rows::<3>(0).into_owned().into(), turn)
            };
            let numeric = (cost(&nudge(STEP)) - cost(&nudge(-STEP))) / (2.0 * STEP);
            // gradient = -1/2 dcost/dstep; central differences of sums over 4000 pairs.
            assert!((sums.gradient[axis] + 0.5 * numeric).abs() < 1e-4 * (1.0 + numeric.abs()), "axis {axis}");
        }
    }

    #[test]
    fn a_corner_is_found_again_and_a_single_wall_says_that_it_holds_one_direction() {
        let truth = Isometry3::new(Vector3::new(0.1, -0.08, 0.05), Vector3::new(0.03, -0.02, 0.05));
        let moved: Vec<Point3<f32>> =
            corner().iter().map(|p| (truth.inverse() * p.cast::<f64>()).cast::<f32>()).collect();
        let found = register(&moved, &corner(), &Isometry3::identity(), &rooms()).unwrap();
        let error = truth.inverse() * found.target_from_source;
        assert!(error.translation.vector.norm() < 5e-3 && error.rotation.angle() < 2e-3, "{error}");
        assert!(found.converged && found.least_support > 0.2 && found.inlier_share > 0.95);
        assert!(found.covariance.cholesky().is_some());
        let wall: Vec<Point3<f32>> = corner().into_iter().filter(|p| p.z == 0.0).collect();
        match register(&wall, &wall, &Isometry3::identity(), &rooms()) {
            Ok(found) => assert!(found.least_support < 1e-6),
            Err(error) => assert_eq!(error, RegistrationError::Degenerate),
        }
    }

    #[test]
    fn what_cannot_be_aligned_is_refused_by_name() {
        let here = Isometry3::identity();
        let refused = |source: &[Point3<f32>], target: &[Point3<f32>], guess: &Isometry3<f64>| {
            register(source, target, guess, &rooms()).unwrap_err()
        };
        let broken = vec![Point3::new(f32::NAN, 0.0, 0.0); 50];
        let (found, needed) = (0, 30);
        assert_eq!(
            refused(&broken, &corner(), &here),
            RegistrationError::TooFewPoints { cloud: Cloud::Source, found, needed, dropped: 50 }
        );
        assert_eq!(
            refused(&corner(), &[], &here),
            RegistrationError::TooFewPoints { cloud: Cloud::Target, found, needed, dropped: 0 }
        );
        let far = Isometry3::translation(100.0, 0.0, 0.0);
        assert_eq!(refused(&corner(), &corner(), &far), RegistrationError::NoOverlap { found, needed });
        let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
        assert_eq!(refused(&corner(), &corner(), &nowhere), RegistrationError::Guess);
        let with = |change: fn(&mut RegistrationConfig)| {
            let mut config = rooms();
            change(&mut config);
            match config.validate() {
                Err(RegistrationError::Config { field, .. }) => field,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(with(|c| c.leaf_m = 0.0), "leaf_m");
        assert_eq!(with(|c| c.max_distance_m = f64::NAN), "max_distance_m");
        assert_eq!(with(|c| c.flatness = 2.0), "flatness");
        assert_eq!(with(|c| c.neighbours = 2), "neighbours");
        assert_eq!(with(|c| c.neighbours = 33), "neighbours");
        assert_eq!(with(|c| c.min_inliers = 0), "min_inliers");
        assert_eq!(with(|c| c.robust_m = -1.0), "robust_m");
    }

    #[test]
    fn a_fit_counts_all_points() {
        let cloud = [Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0), Point3::new(f32::NAN, 0.0, 0.0)];
        let found = fit(&cloud, &[Point3::new(0.0, 0.3, 0.0)], &Isometry3::identity(), 0.5);
        assert_eq!(found.inliers, 1);
        assert!((found.rmse_m - 0.3).abs() < 1e-6);
        assert_eq!(fit(&cloud, &[], &Isometry3::identity(), 0.5), Fit { inliers: 0, rmse_m: 0.0 });
    }
}
