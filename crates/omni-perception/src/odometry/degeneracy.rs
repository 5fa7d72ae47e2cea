//! Directions in which the room says nothing: along a corridor, along a single wall.
//!
//! The normals of all cells in use are added up as n n^T. Its eigenvalues count the cells that look along each
//! direction; where there are too few, what little they say (it is mostly the error of their normals) is left out
//! and the inertial sensor carries the state alone (solution remapping: Zhang, Kaess, Singh, ICRA 2016).

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, Vector3};

use crate::odometry::update::NormalEquations;

/// Share of all cells below which a direction is degenerate as well: the errors of many normals add up.
const MIN_SHARE: f64 = 0.004;
/// Turns are judged by lever arms relative to the range; below this share of the cells nothing turns the pose.
const MIN_TURN_SHARE: f64 = 0.002;

/// The directions that are not observed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Degeneracy {
    /// Unit directions in the world along which the position is not observed.
    pub translations: Vec<Vector3<f64>>,
    /// Unit axes in the IMU frame about which the rotation is not observed.
    pub rotations: Vec<Vector3<f64>>,
    /// How many cells' worth of normals look along the direction of translation that is seen least.
    pub weakest_cells: f64,
}

impl Degeneracy {
    /// Looks for unobserved directions.
    pub fn of(equations: &NormalEquations, min_cells: f64) -> Degeneracy {
        let cells = equations.directions.trace();
        Degeneracy {
            translations: weak_directions(&equations.directions, min_cells.max(MIN_SHARE * cells)),
            weakest_cells: equations.directions.symmetric_eigenvalues().min(),
            rotations: weak_directions(&equations.turns, (0.25 * min_cells).max(MIN_TURN_SHARE * cells)),
        }
    }

    /// Whether everything is observed.
    pub fn is_none(&self) -> bool {
        self.translations.is_empty() && self.rotations.is_empty()
    }

    /// The projection onto what is observed, for (p, theta).
    pub fn keep(&self) -> Matrix6<f64> {
        let mut keep = Matrix6::identity();
        let without = |directions: &[Vector3<f64>]| {
            directions.iter().fold(Matrix3::identity(), |keep, d| keep - d * d.transpose())
        };
        keep.fixed_view_mut::<3, 3>(0, 0).copy_from(&without(&self.translations));
        keep.fixed_view_mut::<3, 3>(3, 3).copy_from(&without(&self.rotations));
        keep
    }
}

/// The eigenvectors with eigenvalues below a threshold, the weakest first.
pub(crate) fn weak_directions(matrix: &Matrix3<f64>, threshold: f64) -> Vec<Vector3<f64>> {
    // The smallest eigenvalue is at least det / (trace/2)^2: in most scans that settles it.
    let bound = matrix.determinant() * 4.0 / matrix.trace().powi(2);
    if bound > threshold {
        return Vec::new();
    }
    let eigen = SymmetricEigen::new(*matrix);
    let mut weak: Vec<_> = (0..3).filter(|&k| eigen.eigenvalues[k] < threshold).collect();
    weak.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    weak.iter().map(|&k| eigen.eigenvectors.column(k).into_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stamp;
    use crate::odometry::state::ImuState;
    use crate::odometry::update::PlaneResidual;

    /// Cells of two walls and a floor, a hundred each; `ends` more at the end of the corridor.
    fn corridor(ends: usize) -> NormalEquations {
        let cell = |normal: Vector3<f64>, k: usize| {
            let point = Vector3::new(0.1 * k as f64 - 5.0, 1.0, 0.3 * (k % 7) as f64) - normal;
            PlaneResidual { point, normal, distance_m: normal.dot(&point), variance_m2: 1e-4 }
        };
        let mut cells: Vec<_> =
            (0..100).flat_map(|k| [Vector3::y(), -Vector3::y(), Vector3::z()].map(|normal| cell(normal, k))).collect();
        cells.extend((0..ends).map(|k| cell(-Vector3::x(), k)));
        NormalEquations::new(&ImuState::at_rest(Stamp(0)), &cells)
    }

    #[test]
    fn a_corridor_is_open_along_its_axis() {
        let found = Degeneracy::of(&corridor(0), 6.0);
        let [axis] = found.translations[..] else { panic!("{found:?}") };
        assert!(axis.x.abs() > 1.0 - 1e-9);
        let keep = found.keep();
        assert!((keep * keep - keep).amax() < 1e-12);
        assert!(keep[(0, 0)].abs() < 1e-9 && (keep[(1, 1)] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn its_end_closes_it() {
        assert!(Degeneracy::of(&corridor(60), 6.0).translations.is_empty());
        assert_eq!(Degeneracy::default().keep(), Matrix6::identity());
    }
}
