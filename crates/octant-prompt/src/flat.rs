//! The flat baselines that the tiered prompt is measured against: every object, one line each.

use std::collections::BTreeMap;

use dsg::{Object, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3};

use crate::names::class_token;
use crate::octant::{Octant, octant_of, point_in_body};

/// The agent's pose, then one JSON object a line: id, category, position with two decimals, room, caption; with a space after each colon
/// and comma, as lists for models are usually written.
pub fn flat_json(graph: &SceneGraph, world_from_body: &Isometry3<f64>, instruction: &str) -> String {
    let quoted = |text: &str| serde_json::Value::from(text).to_string();
    let lines = graph.objects().map(|object| {
        let [x, y, z] = [object.centroid.x, object.centroid.y, object.centroid.z].map(round2);
        let room = object.room.map_or_else(|| "null".to_string(), |room| room.0.to_string());
        format!(
            "{{\"id\": {}, \"category\": {}, \"position\": [{x}, {y}, {z}], \"room\": {room}, \"caption\": {}}}",
            object.id.0,
            quoted(&object.label),
            quoted(&object.caption)
        )
    });
    framed(&pose(world_from_body), lines, instruction)
}

/// A leaner text line for each object, in world coordinates, after the agent's pose.
pub fn flat_text(graph: &SceneGraph, world_from_body: &Isometry3<f64>, instruction: &str) -> String {
    framed(&pose(world_from_body), lines(graph, |point| *point), instruction)
}

/// The same in body coordinates (Eq. 8): egocentric but flat.
pub fn flat_text_in_body(graph: &SceneGraph, world_from_body: &Isometry3<f64>, instruction: &str) -> String {
    let frame = "You are at (0, 0, 0): x is ahead, y left, z up.\n";
    framed(frame, lines(graph, |point| point_in_body(world_from_body, point)), instruction)
}

/// Every object by room and octant with its distance, without captions: what our prompt says of the own room, said of all rooms.
pub fn caption_free(
    graph: &SceneGraph,
    world_from_body: &Isometry3<f64>,
    camera_height_m: f64,
    instruction: &str,
) -> String {
    type ByOctant<'a> = BTreeMap<Octant, Vec<(f64, &'a Object)>>;
    let mut by_room: BTreeMap<Option<RoomId>, ByOctant> = BTreeMap::new();
    for object in graph.objects() {
        let in_body = point_in_body(world_from_body, &object.centroid);
        let octant = octant_of(&in_body, camera_height_m);
        by_room.entry(object.room).or_default().entry(octant).or_default().push((in_body.coords.norm(), object));
    }
    let mut out = String::from("Objects by room and direction from you (m):\n");
    for (room, octants) in by_room {
        out.push_str(&room.map_or_else(|| "outside\n".to_string(), |room| format!("room{}\n", room.0)));
        for (octant, mut things) in octants {
            things.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
            let words: Vec<String> = things
                .iter()
                .map(|(distance_m, object)| {
                    format!("{} id {} {distance_m:.1}", class_token(&object.label), object.id.0)
                })
                .collect();
            out.push_str(&format!("{octant}: {}\n", words.join(", ")));
        }
    }
    format!("{out}Instruction: {instruction}\nAnswer with the object id.")
}

fn lines<'a>(
    graph: &'a SceneGraph,
    place: impl Fn(&Point3<f64>) -> Point3<f64> + 'a,
) -> impl Iterator<Item = String> + 'a {
    graph.objects().map(move |object| {
        let p = place(&object.centroid);
        let room = object.room.map_or_else(|| "none".to_string(), |room| room.0.to_string());
        format!(
            "- id {}: {} at ({:.2}, {:.2}, {:.2}), room {room}: {}.",
            object.id.0, object.label, p.x, p.y, p.z, object.caption
        )
    })
}

fn pose(world_from_body: &Isometry3<f64>) -> String {
    let at = world_from_body.translation.vector;
    let yaw_deg = world_from_body.rotation.euler_angles().2.to_degrees();
    format!("You are at ({:.2}, {:.2}, {:.2}), heading {yaw_deg:.0} degrees.\n", at.x, at.y, at.z)
}

fn framed(pose: &str, lines: impl Iterator<Item = String>, instruction: &str) -> String {
    let lines: Vec<String> = lines.collect();
    format!("{pose}Objects:\n{}\nInstruction: {instruction}\nAnswer with the object id.", lines.join("\n"))
}

fn round2(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}
