//! Where one scan lies in another, from a guess: generalised ICP (Segal, Haehnel, Thrun, "Generalized-ICP", RSS 2009).
//!
//! ```text
//! C = I - (1 - e) n n^T                         a point of a surface: sure along its normal n, free within it
//! M_i = (C_target,i + R C_source,i R^T)^-1      of each source point and the target point nearest to it
//! T = argmin sum_i rho(d_i^T M_i d_i),          d_i = q_i - T p_i, rho of Cauchy
//! ```
//! Solved by Gauss-Newton on SE(3) with `T <- T Exp(step)`; the pairs are found anew in each round. [`register`] is the whole way;
//! [`Surface`] and [`align`] are its parts, for one map and many scans.

pub mod assessment;
pub mod kd_tree;
mod step;
pub mod surface;
pub mod thinning;

use std::fmt;

use nalgebra::{Isometry3, Matrix6, Point3, UnitQuaternion};
use thiserror::Error;

use crate::registration::assessment::assess;
pub use crate::registration::assessment::{Fit, fit};
use crate::registration::kd_tree::MOST_NEIGHBOURS;
use crate::registration::step::Sums;
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
pub(crate) const NONE: u32 = u32::MAX;

/// Finds the target point nearest to each source point. That of the round before bounds the search: it is hardly ever far off.
pub(crate) fn pair(
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

#[cfg(test)]
pub(crate) mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// A corner of three walls, 5 cm apart.
    pub(crate) fn corner() -> Vec<Point3<f32>> {
        let grid = || (0..40).flat_map(|i| (0..40).map(move |j| (i as f32 * 0.05, j as f32 * 0.05)));
        let floor = grid().map(|(u, v)| Point3::new(u, v, 0.0));
        let left = grid().map(|(u, v)| Point3::new(u, 2.0, v));
        let front = grid().map(|(u, v)| Point3::new(2.0, u, v));
        floor.chain(left).chain(front).collect()
    }

    pub(crate) fn rooms() -> RegistrationConfig {
        RegistrationConfig { leaf_m: 0.10, ..RegistrationConfig::default() }
    }

    #[test]
    fn a_corner_is_found_again_and_a_single_wall_says_that_it_holds_one_direction() {
        let truth = Isometry3::new(Vector3::new(0.1, -0.08, 0.05), Vector3::new(0.03, -0.02, 0.05));
        let moved: Vec<Point3<f32>> =
            corner().iter().map(|p| (truth.inverse() * p.cast::<f64>()).cast::<f32>()).collect();
        let found = register(&moved, &corner(), &Isometry3::identity(), &rooms()).unwrap();
        let error = truth.inverse() * found.target_from_source;
        // Not zero: cells of the two grids hold different pieces of the walls, and a pair pulls a little within its surface too.
        assert!(error.translation.vector.norm() < 5e-3 && error.rotation.angle() < 4e-3, "{error}");
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
}
