//! Where a flight may be at all: a convex polygon on the ground, a floor and a ceiling.

use nalgebra::{Isometry3, Point2, Point3, Vector3};

use super::polytope::{HalfSpace, Polytope};

/// A fence that no flight crosses. The vehicle's centre stays inside.
#[derive(Debug, Clone, PartialEq)]
pub struct Geofence {
    inside: Polytope,
}

/// Why a fence was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GeofenceError {
    /// A corner or height is not finite.
    #[error("corners and heights of a fence must be finite")]
    NotFinite,
    /// Fewer than three corners.
    #[error("a fence needs at least three corners, not {0}")]
    TooFewCorners(usize),
    /// The polygon turns the wrong way, or not at all, at a corner.
    #[error("corner {corner} of the fence does not turn left: it must be convex, its corners counter-clockwise")]
    NotConvex {
        /// Its number, from 0.
        corner: usize,
    },
    /// The ceiling is not above the floor.
    #[error("the fence's ceiling ({ceiling_m} m) must be above its floor ({floor_m} m)")]
    NoHeight {
        /// The floor.
        floor_m: f64,
        /// The ceiling.
        ceiling_m: f64,
    },
}

impl Geofence {
    /// The prism over a convex polygon, corners counter-clockwise in the world, between two heights.
    ///
    /// # Errors
    /// [`GeofenceError`].
    pub fn new(corners: &[Point2<f64>], floor_m: f64, ceiling_m: f64) -> Result<Geofence, GeofenceError> {
        let heights = [floor_m, ceiling_m];
        if corners.iter().flat_map(|c| c.iter()).chain(&heights).any(|x| !x.is_finite()) {
            return Err(GeofenceError::NotFinite);
        }
        if corners.len() < 3 {
            return Err(GeofenceError::TooFewCorners(corners.len()));
        }
        if floor_m >= ceiling_m {
            return Err(GeofenceError::NoHeight { floor_m, ceiling_m });
        }
        let count = corners.len();
        let mut faces = Vec::with_capacity(count + 2);
        for k in 0..count {
            let (here, next) = (corners[k], corners[(k + 1) % count]);
            let along = next - here;
            let Some(normal) = Vector3::new(along.y, -along.x, 0.0).try_normalize(1e-9) else {
                return Err(GeofenceError::NotConvex { corner: k });
            };
            let face = HalfSpace { normal, offset_m: normal.xy().dot(&here.coords) };
            // Every other corner is inside, and the next one strictly: a star that turns left everywhere is refused too.
            let inside = |c: &Point2<f64>| face.offset_m - normal.xy().dot(&c.coords);
            if corners.iter().any(|c| inside(c) < -1e-9) || inside(&corners[(k + 2) % count]) < 1e-9 {
                return Err(GeofenceError::NotConvex { corner: (k + 1) % count });
            }
            faces.push(face);
        }
        faces.push(HalfSpace { normal: Vector3::z(), offset_m: ceiling_m });
        faces.push(HalfSpace { normal: -Vector3::z(), offset_m: -floor_m });
        Ok(Geofence { inside: Polytope { faces } })
    }

    /// Distance to the fence from inside (m); negative outside.
    pub fn slack_m(&self, point: &Point3<f64>) -> f64 {
        self.inside.slack(&point.coords)
    }

    /// The same fence in another frame.
    pub fn transformed(&self, new_from_old: &Isometry3<f64>) -> Geofence {
        let moved = |face: &HalfSpace| {
            let normal = new_from_old * face.normal;
            HalfSpace { normal, offset_m: face.offset_m + normal.dot(&new_from_old.translation.vector) }
        };
        Geofence { inside: Polytope { faces: self.inside.faces.iter().map(moved).collect() } }
    }

    /// Its half-spaces.
    pub fn faces(&self) -> &[HalfSpace] {
        &self.inside.faces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fence_is_a_convex_prism_or_refused() {
        let corners = |points: &[[f64; 2]]| points.iter().map(|p| Point2::new(p[0], p[1])).collect::<Vec<_>>();
        let square = corners(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]);
        let fence = Geofence::new(&square, 0.0, 2.0).unwrap();
        assert_eq!(fence.slack_m(&Point3::new(1.0, 1.0, 0.5)), 0.5);
        assert_eq!(fence.slack_m(&Point3::new(5.0, 1.0, 1.0)), -1.0);
        let clockwise: Vec<_> = square.iter().rev().copied().collect();
        assert!(matches!(Geofence::new(&clockwise, 0.0, 2.0), Err(GeofenceError::NotConvex { .. })));
        let star = corners(&[[0.0, 1.0], [-0.59, -0.81], [0.95, 0.31], [-0.95, 0.31], [0.59, -0.81]]);
        assert!(matches!(Geofence::new(&star, 0.0, 2.0), Err(GeofenceError::NotConvex { .. })));
        let dent = corners(&[[0.0, 0.0], [4.0, 0.0], [2.0, 1.0], [4.0, 3.0], [0.0, 3.0]]);
        assert_eq!(Geofence::new(&dent, 0.0, 2.0).err(), Some(GeofenceError::NotConvex { corner: 2 }));
        assert_eq!(Geofence::new(&square[..2], 0.0, 2.0).err(), Some(GeofenceError::TooFewCorners(2)));
        assert!(matches!(Geofence::new(&square, 2.0, 2.0), Err(GeofenceError::NoHeight { .. })));
        // In another frame it is as far from the same place.
        let turned = Isometry3::new(Vector3::new(3.0, -1.0, 0.5), Vector3::z() * 0.7);
        for place in [Point3::new(1.0, 1.0, 0.5), Point3::new(5.0, -2.0, 1.0)] {
            let slack_m = fence.transformed(&turned).slack_m(&(turned * place));
            assert!((slack_m - fence.slack_m(&place)).abs() < 1e-12);
        }
        let nan = corners(&[[0.0, 0.0], [4.0, f64::NAN], [4.0, 3.0]]);
        assert_eq!(Geofence::new(&nan, 0.0, 2.0).err(), Some(GeofenceError::NotFinite));
    }
}
