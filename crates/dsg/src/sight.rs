//! The line of sight between two things (OmniVLN Eq. 6).

use nalgebra::Point3;

use crate::graph::SceneGraph;
use crate::object::Object;
use crate::relations::{RelationConfig, SightLine};

/// OmniVLN Eq. 6: the edge falls if the map comes too near to the line between the two.
///
/// Departure: the line over both tops must be blocked as well. Two things on one table have the table top within reach of
/// the line between their centres, which would prune true relations; a wall blocks both lines. The lines begin outside the
/// boxes by the two margins.
pub(crate) fn blocking_point(
    a: &Object,
    b: &Object,
    line_of_sight: SightLine,
    (margin_a_m, margin_b_m): (f64, f64),
    config: &RelationConfig,
) -> Option<Point3<f64>> {
    let over_m = a.bounds.max.z.max(b.bounds.max.z) + config.sight_margin_m;
    let between_centres = (a.centroid, b.centroid);
    let over_the_tops = (lifted(&a.centroid, over_m), lifted(&b.centroid, over_m));
    let mut first_block = None;
    for (from, to) in [between_centres, over_the_tops] {
        let start = exit(&from, &to, a, margin_a_m);
        let end = exit(&to, &from, b, margin_b_m);
        // The free part is empty: they touch.
        if (end - start).dot(&(to - from)) <= 0.0 {
            return None;
        }
        let blocked = line_of_sight(&start, &end).filter(|at| at.iter().all(|x| x.is_finite()))?;
        first_block = first_block.or(Some(blocked));
    }
    first_block
}

/// The middle of the line between two things of two rooms, if it does not go through a doorway between these: then a wall
/// parts them, however thin, and the margin at the ends of the line of sight must not step over it. `None` within a room.
pub(crate) fn parting_wall(graph: &SceneGraph, a: &Object, b: &Object) -> Option<Point3<f64>> {
    // Both the doorway and the things are a hand's breadth off.
    const JAMB_M: f64 = 0.15;
    let (room_a, room_b) = (a.room?, b.room?);
    if room_a == room_b {
        return None;
    }
    let way = (b.centroid - a.centroid).xy();
    let goes_through = |door: &crate::room::RoomEdge| {
        let to_door = (door.doorway - a.centroid).xy();
        let along = (to_door.dot(&way) / way.norm_squared().max(1e-9)).clamp(0.0, 1.0);
        (to_door - way * along).norm() <= door.width_m / 2.0 + JAMB_M
    };
    let is_through = graph.room_edge(room_a, room_b).is_some_and(goes_through);
    if is_through { None } else { Some(nalgebra::center(&a.centroid, &b.centroid)) }
}

fn lifted(point: &Point3<f64>, z_m: f64) -> Point3<f64> {
    Point3::new(point.x, point.y, z_m)
}

/// The point where the ray from `from` towards `to` has left the object's box by the margin (seen from above, so that the
/// line over the tops starts beside the box as well).
fn exit(from: &Point3<f64>, to: &Point3<f64>, object: &Object, margin_m: f64) -> Point3<f64> {
    let along = to - from;
    let around = object.bounds.inflated(margin_m);
    let mut leave = f64::INFINITY;
    for k in 0..2 {
        if along[k] > 0.0 {
            leave = leave.min((around.max[k] - from[k]) / along[k]);
        } else if along[k] < 0.0 {
            leave = leave.min((around.min[k] - from[k]) / along[k]);
        }
    }
    if leave.is_finite() { from + along * leave } else { *from }
}
