//! Can a robot use a thing, and can its camera see it from near by? Lines of sight among the boxes of all parts in a room.

use nalgebra::{Point2, Point3, Vector2};

use crate::building::Bounds;
use crate::catalog::Use;
use crate::item::{Item, extent};
use crate::passage::Reach;
use crate::placement::RoomSpace;

/// Largest distance from the middle of the robot's disc to a thing it looks at, metres.
pub const VIEW_DISTANCE_M: f64 = 0.9;
/// Height of the ground robot's camera, metres.
pub const CAMERA_HEIGHT_M: f64 = 0.73;
/// How far beside its front a thing with a seat or a low table before it may be reached, metres.
const BESIDE_M: f64 = 0.35;

/// True if the disc reaches a place from which the thing can be used: straight before its front, or on any side. What has a
/// chair or a low table before it may also be reached from beside that.
pub fn is_usable(item: &Item, reach: &Reach) -> bool {
    let foot = item.bounds.footprint();
    let front = item.front();
    let left = Vector2::new(-front.y, front.x);
    let middle = foot.center();
    let deep = extent(item, front) / 2.0;
    let beside = if matches!(item.class.name, "desk" | "workbench" | "sofa") { BESIDE_M } else { 0.0 };
    let wide = extent(item, left) / 2.0 + beside;
    reach.near(&foot, VIEW_DISTANCE_M).any(|p| {
        let to = p - middle;
        item.class.usable == Use::Any || (to.dot(&front) > deep && to.dot(&left).abs() <= wide)
    })
}

/// True if a robot standing at one of the reached places sees the thing from within [`VIEW_DISTANCE_M`].
pub fn is_viewable(
    bounds: &Bounds,
    own_parts: &[Bounds],
    others: &[&[Bounds]],
    space: &RoomSpace,
    reach: &Reach,
) -> bool {
    let foot = bounds.footprint();
    reach.near(&foot, VIEW_DISTANCE_M).any(|p| {
        let eye = Point3::new(p.x, p.y, space.floor_z_m + CAMERA_HEIGHT_M);
        own_parts.iter().any(|part| sees(&eye, &part.center(), own_parts, others, space))
    })
}

/// True if the straight line from the eye meets one of `own` before anything else and stays in the room.
fn sees(eye: &Point3<f64>, target: &Point3<f64>, own: &[Bounds], others: &[&[Bounds]], space: &RoomSpace) -> bool {
    let first = |boxes: &[Bounds]| boxes.iter().filter_map(|b| entry(eye, target, b)).fold(f64::INFINITY, f64::min);
    let hit = first(own);
    if !hit.is_finite() || others.iter().any(|o| first(o) < hit) {
        return false;
    }
    (1..5).all(|k| {
        let q = eye + (target - eye) * (hit * f64::from(k) / 5.0);
        space.floor.iter().any(|r| r.contains(&Point2::new(q.x, q.y)))
    })
}

/// Where the segment from `a` to `b` enters a box, as a fraction of its length.
fn entry(a: &Point3<f64>, b: &Point3<f64>, bounds: &Bounds) -> Option<f64> {
    let (mut low, mut high) = (0.0f64, 1.0f64);
    for k in 0..3 {
        let d = b[k] - a[k];
        if d.abs() < 1e-12 {
            if a[k] < bounds.min[k] || a[k] > bounds.max[k] {
                return None;
            }
            continue;
        }
        let (t0, t1) = ((bounds.min[k] - a[k]) / d, (bounds.max[k] - a[k]) / d);
        low = low.max(t0.min(t1));
        high = high.min(t0.max(t1));
    }
    (low <= high).then_some(low)
}
