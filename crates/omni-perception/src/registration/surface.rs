//! A cloud made ready for registration: thinned, in a tree, with the normal of the surface at each point.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::registration::kd_tree::KdTree;
use crate::registration::thinning::thin;
use crate::registration::{Cloud, RegistrationConfig, RegistrationError};

/// A cloud with its normals. Made once, used for as many alignments as wanted.
#[derive(Debug, Clone)]
pub struct Surface {
    pub(crate) tree: KdTree,
    pub(crate) normals: Vec<Normal>,
    /// Points of the cloud that were left out because they are not finite or too far away.
    pub dropped: usize,
}

/// Unit normal of either sign, zero where the neighbourhood has none.
pub(crate) type Normal = Vector3<f32>;

impl Surface {
    /// Thins the cloud and fits a plane to the nearest points of each point.
    ///
    /// # Errors
    /// [`RegistrationError::TooFewPoints`] (which names `cloud`), or a setting that makes no sense.
    pub fn new(
        points: &[Point3<f32>],
        config: &RegistrationConfig,
        cloud: Cloud,
    ) -> Result<Surface, RegistrationError> {
        config.validate()?;
        let thinned = thin(points, config.leaf_m);
        if thinned.points.len() < config.min_inliers {
            let (found, needed) = (thinned.points.len(), config.min_inliers);
            return Err(RegistrationError::TooFewPoints { cloud, found, needed, dropped: thinned.dropped });
        }
        let tree = KdTree::new(thinned.points);
        let normals = tree.points().iter().map(|point| normal_at(&tree, point, config.neighbours)).collect();
        Ok(Surface { tree, normals, dropped: thinned.dropped })
    }

    /// The thinned points.
    pub fn points(&self) -> &[Point3<f32>] {
        self.tree.points()
    }

    /// Unit normal at each of [`points`](Self::points), of either sign; zero where the neighbourhood has no plane.
    pub fn normals(&self) -> &[Vector3<f32>] {
        &self.normals
    }
}

/// Normal of the plane through the nearest points.
fn normal_at(tree: &KdTree, point: &Point3<f32>, neighbours: usize) -> Normal {
    let few = tree.nearest_few(point, neighbours);
    // Offsets to the point itself are small, so that f32 sums hold them well.
    let (mut sum, mut square, mut cross) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
    for index in few.indices() {
        let offset: Vector3<f32> = tree.points()[*index as usize] - point;
        sum += offset;
        square += offset.component_mul(&offset);
        cross += Vector3::new(offset.x * offset.y, offset.x * offset.z, offset.y * offset.z);
    }
    let over = 1.0 / few.indices().len() as f64;
    let [sum, square, cross] = [sum, square, cross].map(|v| v.cast::<f64>() * over);
    let raw = Matrix3::new(square.x, cross.x, cross.y, cross.x, square.y, cross.z, cross.y, cross.z, square.z);
    flattest_direction(&(raw - sum * sum.transpose())).cast::<f32>()
}

/// Eigenvector of the smallest eigenvalue of a symmetric positive matrix, unit length; zero where the second eigenvalue is
/// (nearly) zero too, so that there is no such direction: points on a line.
///
/// Closed form (Eberly, "A robust eigensolver for 3x3 symmetric matrices"): the eigenvalue from the characteristic cubic, the
/// vector as the largest cross product of two rows of what it leaves.
pub fn flattest_direction(scatter: &Matrix3<f64>) -> Vector3<f64> {
    /// Second over first eigenvalue below this is a line.
    const LINE: f64 = 1e-3;
    let scale = scatter.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return Vector3::zeros();
    }
    let a = scatter / scale;
    let mean = a.trace() / 3.0;
    let b = a - Matrix3::identity() * mean;
    let spread = (b.component_mul(&b).sum() / 6.0).sqrt();
    if spread <= f64::EPSILON {
        return Vector3::zeros();
    }
    let half = (b.determinant() / (2.0 * spread * spread * spread)).clamp(-1.0, 1.0);
    let angle = half.acos() / 3.0;
    let largest = mean + 2.0 * spread * angle.cos();
    let smallest = mean + 2.0 * spread * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    let middle = 3.0 * mean - largest - smallest;
    if middle < LINE * largest {
        return Vector3::zeros();
    }
    let rest = a - Matrix3::identity() * smallest;
    let [x, y, z] = [rest.column(0), rest.column(1), rest.column(2)].map(|c| c.into_owned());
    let crosses = [x.cross(&y), y.cross(&z), z.cross(&x)];
    let best = crosses.into_iter().max_by(|p, q| p.norm_squared().total_cmp(&q.norm_squared())).unwrap_or_default();
    best.try_normalize(1e-12).unwrap_or_else(Vector3::zeros)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, SymmetricEigen};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Against nalgebra's iteration; where two eigenvalues meet, any vector between them is right.
        #[test]
        fn the_closed_form_agrees_with_the_iteration(
            values in proptest::array::uniform3(0.0..1.0f64), axis in proptest::array::uniform3(-3.0..3.0f64), scale in -8..8i32,
        ) {
            let turn = Rotation3::new(Vector3::from(axis));
            let diagonal = Matrix3::from_diagonal(&Vector3::from(values)) * 10.0_f64.powi(scale);
            let scatter = turn * diagonal * turn.transpose();
            let found = flattest_direction(&scatter);
            let eigen = SymmetricEigen::new(scatter).eigenvalues;
            let mut sorted: [f64; 3] = eigen.into();
            sorted.sort_by(f64::total_cmp);
            if sorted[1] > 0.01 * sorted[2] && sorted[1] - sorted[0] > 0.01 * sorted[2] {
                prop_assert!((found.norm() - 1.0).abs() < 1e-9);
                prop_assert!((scatter * found - found * sorted[0]).norm() < 1e-6 * sorted[2]);
            }
        }
    }

    #[test]
    fn points_on_a_line_have_no_normal() {
        let along = Vector3::new(1.0, 2.0, -1.0);
        assert_eq!(flattest_direction(&(along * along.transpose())), Vector3::zeros());
        assert_eq!(flattest_direction(&Matrix3::zeros()), Vector3::zeros());
        assert_eq!(flattest_direction(&Matrix3::identity()), Vector3::zeros());
        let floor = Matrix3::from_diagonal(&Vector3::new(1.0, 0.5, 0.0));
        assert_eq!(flattest_direction(&floor).abs(), Vector3::z());
    }
}
