//! Attributes of spark_dsg nodes: positions, boxes, colours and names in all their versions.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use serde_json::json;

use crate::bounds::Aabb;
use crate::group::Group;
use crate::ids::{BuildingId, GroupId, PlaceId, RoomId};
use crate::load::{Cursor, LoadError};
use crate::place::Place;
use crate::room::{Building, Room};

pub(crate) fn position(at: &Cursor) -> Result<Point3<f64>, LoadError> {
    at.find("position").map_or(Ok(Point3::origin()), |c| c.point())
}

pub(crate) fn place(id: PlaceId, at: &Cursor) -> Result<Place, LoadError> {
    let is_frontier = at.find("active_frontier").map_or(Ok(false), |c| c.bool())?;
    let cells = at.find("num_frontier_voxels").map_or(Ok(0), |c| c.u32())?;
    Ok(Place {
        id,
        position: position(at)?,
        clearance_m: at.find("distance").map_or(Ok(0.0), |c| c.f64())?.max(0.0),
        basis_points: at.find("num_basis_points").map_or(Ok(0), |c| c.u32())?.min(255) as u8,
        frontier_cells: if is_frontier { cells.max(1) } else { 0 },
        room: None,
    })
}

pub(crate) fn room(id: RoomId, at: &Cursor) -> Result<Room, LoadError> {
    let mut room = Room::new(id, position(at)?);
    let sides = bounds(at, &room.center)?.sides_m();
    room.area_m2 = sides.x * sides.y;
    room.metadata = at.find("metadata").and_then(|c| c.value.as_object().cloned()).unwrap_or_default();
    if let Some(probabilities) = at.find("semantic_class_probabilities") {
        let mut best: Option<(&str, f64)> = None;
        for (kind, probability) in probabilities.map()? {
            let probability = probability.as_f64().ok_or_else(|| probabilities.wrong("a map of numbers"))?;
            if best.is_none_or(|(_, known)| probability > known) {
                best = Some((kind, probability));
            }
        }
        if let Some((kind, probability)) = best.filter(|(kind, _)| !kind.trim().is_empty()) {
            room.kind = Some(kind.trim().to_lowercase());
            room.kind_confidence = probability.clamp(0.0, 1.0);
        }
    }
    let name = at.find("name").map_or(Ok(""), |c| c.str())?.trim();
    if !name.is_empty() && !is_symbol(name) {
        room.metadata.insert("name".into(), json!(name));
        room.name = name.to_owned();
        // Somebody named it.
        room.is_user_named = true;
    }
    Ok(room)
}

pub(crate) fn building(id: BuildingId, at: &Cursor) -> Result<Building, LoadError> {
    let name = at.find("name").map_or(Ok(""), |c| c.str())?;
    let name = if name.is_empty() || is_symbol(name) { "building" } else { name }.to_owned();
    Ok(Building { id, name, center: position(at)?, rooms: Vec::new(), storeys: Vec::new() })
}

pub(crate) fn group(id: GroupId, at: &Cursor) -> Result<Group, LoadError> {
    let name = at.find("name").map_or(Ok(""), |c| c.str())?;
    let name = if name.trim().is_empty() { format!("group {}", id.0) } else { name.to_owned() };
    Ok(Group { id, name, support: None, members: Vec::new(), room: None, center: position(at)? })
}

/// The axis-aligned box around theirs. 1.0.0 stores corners, later versions side lengths.
pub(crate) fn bounds(at: &Cursor, position: &Point3<f64>) -> Result<Aabb, LoadError> {
    let Some(theirs) = at.find("bounding_box") else {
        return Ok(Aabb::at(*position));
    };
    let is_invalid = theirs.find("type").map_or(Ok(false), |c| c.str().map(|t| t == "INVALID"))?;
    if is_invalid {
        return Ok(Aabb::at(*position));
    }
    let sides: Vector3<f64> = match theirs.find("dimensions") {
        Some(dimensions) => dimensions.point()?.coords,
        None => theirs.get("max")?.point()? - theirs.get("min")?.point()?,
    };
    if sides.iter().any(|side| *side < 0.0) {
        return Err(theirs.wrong("a box"));
    }
    let center = theirs.find("world_P_center").map_or(Ok(*position), |c| c.point())?;
    let is_aligned = theirs.find("type").map_or(Ok(true), |c| c.str().map(|t| t == "AABB"))?;
    let rotation = match theirs.find("world_R_center") {
        Some(rotation) if !is_aligned => rotation.quaternion()?,
        _ => UnitQuaternion::identity(),
    };
    let own = Aabb::from_center(Point3::origin(), sides);
    Ok(own.transformed(&Isometry3::from_parts(center.coords.into(), rotation)))
}

/// `{"r", "g", "b", "a"}`, or a list up to 1.0.2.
pub(crate) fn color(at: &Cursor) -> Result<[u8; 3], LoadError> {
    if at.value.is_object() {
        return Ok([at.get("r")?.u8()?, at.get("g")?.u8()?, at.get("b")?.u8()?]);
    }
    let channels: Vec<Cursor> = at.items()?.take(4).collect();
    match channels.as_slice() {
        [r, g, b, ..] => Ok([r.u8()?, g.u8()?, b.u8()?]),
        _ => Err(at.wrong("a colour")),
    }
}

/// Whether a name is only a node symbol: "O(12)".
pub(crate) fn is_symbol(name: &str) -> bool {
    let mut chars = name.trim().chars();
    let letter = chars.next().is_some_and(|c| c.is_ascii_alphabetic());
    let index = chars.as_str().strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
    letter && index.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()))
}

/// "chair_0" is a chair.
pub(crate) fn without_number(name: &str) -> &str {
    let name = name.trim();
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    match stem.strip_suffix(['_', ' ', '-']) {
        Some(stem) if stem.len() < name.len() && !stem.is_empty() => stem,
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_labels() {
        assert_eq!(without_number("chair_0"), "chair");
        assert_eq!(without_number("office chair 12"), "office chair");
        assert_eq!(without_number("chair"), "chair");
        assert_eq!(without_number("12"), "12");
        assert_eq!(without_number("box2"), "box2");
        assert!(is_symbol("O(12)"));
        assert!(!is_symbol("chair"));
    }
}
