//! What lenses that are round about their axis have in common: a place at radius r(angle) in the point's direction.
//!
//! ```text
//! rho = hypot(x, y), angle = atan2(rho, z), place = r(angle) (x, y)/rho
//! ```
//! in optical axes. At the axis (x, y)/rho stays a unit vector down to the smallest rho, so there is no limit to take;
//! at rho = 0 the place is the centre.

use nalgebra::{Point3, Unit, Vector3};

use super::{camera_direction, optical_from_camera};

/// The end of a lens's curve is where a pixel covers a hundred times the angle of one at the axis: beyond, the picture
/// folds back or its rounding errors grow over 1e-9 rad.
pub(super) const MIN_SLOPE: f64 = 0.01;
/// Radii of projected points may exceed the largest one by rounding; so much is taken as the edge.
const EDGE_SLACK: f64 = 1e-12;

/// The place of the plane (right, down) of a point; `None` beyond `max_angle_rad`.
pub(super) fn place(
    point_in_camera: &Point3<f64>,
    max_angle_rad: f64,
    radius: impl Fn(f64) -> f64,
) -> Option<(f64, f64)> {
    let [x, y, z] = optical_from_camera(point_in_camera)?;
    let rho = x.hypot(y);
    let angle = rho.atan2(z);
    if angle > max_angle_rad {
        return None;
    }
    if rho == 0.0 {
        // Straight behind has no direction in the image even if the lens reaches round to it.
        return (z > 0.0).then_some((0.0, 0.0));
    }
    let r = radius(angle);
    Some((r * (x / rho), r * (y / rho)))
}

/// The direction of a place of the plane; `None` beyond `max_radius`.
pub(super) fn direction(
    (right, down): (f64, f64),
    max_radius: f64,
    angle: impl Fn(f64) -> f64,
) -> Option<Unit<Vector3<f64>>> {
    let r = right.hypot(down);
    if r > max_radius * (1.0 + EDGE_SLACK) {
        return None;
    }
    if r == 0.0 {
        return Some(camera_direction(0.0, 0.0, 1.0));
    }
    let (sin, cos) = angle(r.min(max_radius)).sin_cos();
    Some(camera_direction(sin * (right / r), sin * (down / r), cos))
}
