//! Vertices of a bounded intersection of half-spaces.
//!
//! Each face is a large square on its plane, cut by every other half-space; what is left is a polygon whose corners are
//! vertices. Quadratic in the number of faces, and nothing but cuts: degenerate corners, where many faces meet, need no care.

use nalgebra::Vector3;

use super::polytope::Polytope;

/// Corners nearer than this are one (m).
const SAME_M: f64 = 1e-6;
/// A vertex further out than this means that the polytope is not bounded (m).
const FARTHEST_M: f64 = 1e5;

/// Why there are no vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum VertexError {
    /// A face is not finite or has no direction.
    #[error("face {face} has no unit normal or no finite offset")]
    BadFace {
        /// Its number.
        face: usize,
    },
    /// Nothing with a volume is inside.
    #[error("the half-spaces have nothing but a point, a line or a flat piece in common, or nothing at all")]
    Empty,
    /// It reaches to infinity.
    #[error("the half-spaces do not enclose a bounded piece of space")]
    Unbounded,
}

/// The vertices, sorted by x, then y, then z; corners within a micrometre are merged.
///
/// # Errors
/// [`VertexError`].
pub fn vertices(polytope: &Polytope) -> Result<Vec<Vector3<f64>>, VertexError> {
    for (face, f) in polytope.faces.iter().enumerate() {
        if !((f.normal.norm_squared() - 1.0).abs() < 1e-6 && f.offset_m.is_finite()) {
            return Err(VertexError::BadFace { face });
        }
    }
    let mut found: Vec<Vector3<f64>> = Vec::new();
    for (k, face) in polytope.faces.iter().enumerate() {
        // A square on the plane, centred on its point nearest to the origin.
        let other = if face.normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        let u = face.normal.cross(&other).normalize() * (2.0 * FARTHEST_M);
        let v = face.normal.cross(&u);
        let centre = face.normal * face.offset_m;
        let mut polygon = vec![centre + u + v, centre - u + v, centre - u - v, centre + u - v];
        for (m, cut) in polytope.faces.iter().enumerate() {
            if m == k {
                continue;
            }
            let same_way = cut.normal.dot(&face.normal) > 1.0 - 1e-12;
            if same_way {
                // Parallel faces: only the tighter one has corners; of two equal ones the first.
                let is_hidden = cut.offset_m < face.offset_m || (cut.offset_m == face.offset_m && m < k);
                if is_hidden {
                    polygon.clear();
                }
                continue;
            }
            polygon = clip(&polygon, |p| cut.normal.dot(p) - cut.offset_m);
            if polygon.is_empty() {
                break;
            }
        }
        for p in polygon {
            if p.amax() > FARTHEST_M {
                return Err(VertexError::Unbounded);
            }
            if !found.iter().any(|q| (q - p).norm() < SAME_M) {
                found.push(p);
            }
        }
    }
    let is_flat = found.len() < 4 || spread(&found) < SAME_M;
    if is_flat {
        return Err(if polytope.faces.len() < 4 { VertexError::Unbounded } else { VertexError::Empty });
    }
    found.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    Ok(found)
}

/// Sutherland and Hodgman: what of a polygon is where `outside` is not positive.
fn clip(polygon: &[Vector3<f64>], outside: impl Fn(&Vector3<f64>) -> f64) -> Vec<Vector3<f64>> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        let (da, db) = (outside(a), outside(b));
        if da <= 0.0 {
            kept.push(*a);
        }
        if (da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    kept
}

/// Thickness of a set of points in its thinnest direction among those of its first corner's tetrahedra.
fn spread(points: &[Vector3<f64>]) -> f64 {
    let o = points[0];
    let far = |score: &dyn Fn(&Vector3<f64>) -> f64| {
        points.iter().copied().max_by(|a, b| score(a).total_cmp(&score(b))).unwrap_or(o)
    };
    let along = far(&|p| (p - o).norm()) - o;
    let across = far(&|p| (p - o).cross(&along).norm()) - o;
    let normal = along.cross(&across);
    let size = normal.norm();
    if size < SAME_M * SAME_M {
        return 0.0;
    }
    let normal = normal / size;
    points.iter().map(|p| normal.dot(&(p - o)).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::air::polytope::HalfSpace;
    use nalgebra::Point3;

    #[test]
    fn a_box_has_eight_corners_also_with_faces_said_twice() {
        let mut polytope = Polytope::from_box(&Point3::new(0.0, 1.0, 2.0), &Point3::new(1.0, 3.0, 5.0));
        polytope.faces.extend_from_within(..);
        polytope.faces.push(HalfSpace { normal: Vector3::x(), offset_m: 7.0 });
        let corners = vertices(&polytope).unwrap();
        assert_eq!(corners.len(), 8);
        assert_eq!(corners[0], Vector3::new(0.0, 1.0, 2.0));
        assert_eq!(corners[7], Vector3::new(1.0, 3.0, 5.0));
    }

    #[test]
    fn what_is_flat_empty_or_open_is_refused() {
        let flat = Polytope::from_box(&Point3::new(0.0, 0.0, 0.0), &Point3::new(1.0, 1.0, 0.0));
        assert_eq!(vertices(&flat), Err(VertexError::Empty));
        let empty = Polytope::from_box(&Point3::new(1.0, 0.0, 0.0), &Point3::new(0.0, 1.0, 1.0));
        assert_eq!(vertices(&empty), Err(VertexError::Empty));
        let mut open = Polytope::from_box(&Point3::origin(), &Point3::new(1.0, 1.0, 1.0));
        open.faces.remove(0);
        assert_eq!(vertices(&open), Err(VertexError::Unbounded));
        open.faces[0].normal.x = f64::NAN;
        assert_eq!(vertices(&open), Err(VertexError::BadFace { face: 0 }));
    }
}
