//! The flat baselines that the tiered prompt is measured against: every object, one line each.

use dsg::SceneGraph;
use nalgebra::{Isometry3, Point3};
use serde_json::json;

use crate::octant::point_in_body;

/// One JSON object a line: id, category, position with two decimals, room, caption.
pub fn flat_json(graph: &SceneGraph, instruction: &str) -> String {
    let lines = graph.objects().map(|object| {
        let position: Vec<f64> = object.centroid.iter().map(|value| round2(*value)).collect();
        json!({"id": object.id.0, "category": object.label, "position": position, "room": object.room.map(|room| room.0), "caption": object.caption}).to_string()
    });
    framed(lines, instruction)
}

/// A leaner text line for each object, in world coordinates.
pub fn flat_text(graph: &SceneGraph, instruction: &str) -> String {
    lines(graph, instruction, |point| *point)
}

/// The same in body coordinates (Eq. 8): egocentric but flat.
pub fn flat_text_in_body(graph: &SceneGraph, world_from_body: &Isometry3<f64>, instruction: &str) -> String {
    lines(graph, instruction, |point| point_in_body(world_from_body, point))
}

fn lines(graph: &SceneGraph, instruction: &str, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> String {
    let lines = graph.objects().map(|object| {
        let p = place(&object.centroid);
        let room = object.room.map_or_else(|| "none".to_string(), |room| room.0.to_string());
        format!(
            "- id {}: {} at ({:.2}, {:.2}, {:.2}), room {room}: {}.",
            object.id.0, object.label, p.x, p.y, p.z, object.caption
        )
    });
    framed(lines, instruction)
}

fn framed(lines: impl Iterator<Item = String>, instruction: &str) -> String {
    let lines: Vec<String> = lines.collect();
    format!("Objects:\n{}\nInstruction: {instruction}\nAnswer with the object id.", lines.join("\n"))
}

fn round2(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}
