//! The numbers at the door: NaN, infinities and ranges are refused before anything is written.

use nalgebra::{Isometry3, Point3};

use crate::object::Object;
use crate::op::OpError;
use crate::place::{Place, PlaceEdge};

pub(crate) fn check_object(object: &Object) -> Result<(), OpError> {
    let bad = |field| Err(OpError::BadNumber { node: "object", field });
    if object.label.trim().is_empty() {
        return Err(OpError::BadName { node: "object", field: "label" });
    }
    if !object.bounds.is_valid() {
        return bad("bounds");
    }
    check_point("object", "centroid", &object.centroid)?;
    if !(0.0..=1.0).contains(&object.label_margin) {
        return bad("label_margin");
    }
    if object.votes.values().any(|votes| !(votes.is_finite() && *votes >= 0.0)) {
        return bad("votes");
    }
    if object.first_seen_ns > object.last_seen_ns {
        return bad("last_seen_ns");
    }
    if !crate::presence::is_sound(&object.presence, &object.trajectory) {
        return bad("presence or trajectory");
    }
    Ok(())
}

pub(crate) fn check_point(node: &'static str, field: &'static str, point: &Point3<f64>) -> Result<(), OpError> {
    if point.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(OpError::BadNumber { node, field }) }
}

pub(crate) fn check_range(node: &'static str, field: &'static str, value: f64, least: f64) -> Result<(), OpError> {
    if value.is_finite() && value >= least { Ok(()) } else { Err(OpError::BadNumber { node, field }) }
}

pub(crate) fn check_pose(pose: &Isometry3<f64>) -> Result<(), OpError> {
    let rotation = pose.rotation.coords.iter().all(|x| x.is_finite());
    check_point("agent", "world_from_body", &pose.translation.vector.into())?;
    if rotation { Ok(()) } else { Err(OpError::BadNumber { node: "agent", field: "world_from_body" }) }
}

pub(crate) fn check_place(place: &Place) -> Result<(), OpError> {
    check_point("place", "position", &place.position)?;
    check_range("place", "clearance_m", place.clearance_m, 0.0)
}

pub(crate) fn check_place_edge(edge: &PlaceEdge) -> Result<(), OpError> {
    check_range("place edge", "clearance_m", edge.clearance_m, 0.0)?;
    if edge.a == edge.b { Err(OpError::SelfJoin) } else { Ok(()) }
}
