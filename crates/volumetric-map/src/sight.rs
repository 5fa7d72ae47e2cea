//! Is the straight way between two points open? OmniVLN Eq. 6 with the blocking point as evidence.

use nalgebra::Point3;

use crate::distance_field::DistanceField;
use crate::volume::Cell;

/// The answer to a line of sight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LineOfSight {
    /// Known free all along.
    Clear,
    /// Something comes nearer than the margin.
    Blocked {
        /// First such point on the segment.
        at: Point3<f64>,
    },
    /// Nothing known blocks, but part of the way was never seen.
    Unknown {
        /// First such point on the segment.
        at: Point3<f64>,
    },
}

impl DistanceField {
    /// Looks along the segment from `a` to `b`: blocked where a cell is occupied or the distance to the map is below `margin_m`.
    ///
    /// A blocked point anywhere outweighs unknown ones before it. Both ends count; between two things, whose own surfaces
    /// would block, use [`line_of_sight_between`](Self::line_of_sight_between). Points that are not finite give `Unknown`.
    pub fn line_of_sight(&self, a: &Point3<f64>, b: &Point3<f64>, margin_m: f64) -> LineOfSight {
        self.line_of_sight_between(a, b, margin_m, 0.0, 0.0)
    }

    /// The same, without the first `skip_a_m` and the last `skip_b_m` of the segment (the two things' own extent). Clear if
    /// nothing is left.
    pub fn line_of_sight_between(
        &self,
        a: &Point3<f64>,
        b: &Point3<f64>,
        margin_m: f64,
        skip_a_m: f64,
        skip_b_m: f64,
    ) -> LineOfSight {
        let length = (b - a).norm();
        if !length.is_finite() || length > 1e6 * self.resolution_m() {
            return LineOfSight::Unknown { at: *a };
        }
        let direction = if length > 0.0 { (b - a) / length } else { nalgebra::Vector3::zeros() };
        let end = length - skip_b_m.max(0.0);
        let mut unknown = None;
        let mut along = skip_a_m.max(0.0);
        // OmniVLN Eq. 6: exists p in line(p_i, p_j) with dist(p, P_map) < epsilon.
        // The distance changes by at most about its own argument, so free space is crossed in strides (sphere tracing), but
        // never longer than to the first place where the margin could break, nor shorter than half a cell.
        let shortest = 0.5 * self.resolution_m();
        while along <= end {
            let at = a + direction * along;
            let mut stride = shortest;
            match self.distance(&at) {
                _ if self.state(&at) == Cell::Occupied => return LineOfSight::Blocked { at },
                None => unknown = unknown.or(Some(at)),
                Some(distance) if distance < margin_m => return LineOfSight::Blocked { at },
                // Two cells of slack: strides must not jump over unknown cells unseen, and the interpolation is not exact.
                Some(distance) => {
                    stride = stride.max(distance - margin_m - 2.0 * self.resolution_m()).min(MAX_STRIDE_M)
                }
            }
            if along < end && along + stride > end {
                along = end;
            } else {
                along += stride;
            }
        }
        unknown.map_or(LineOfSight::Clear, |at| LineOfSight::Unknown { at })
    }
}

/// Unknown pockets of this size may lie in the open; strides stay below.
const MAX_STRIDE_M: f64 = 0.2;
