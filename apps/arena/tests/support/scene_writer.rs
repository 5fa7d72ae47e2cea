//! A building written as OBJ and as glTF, with names as people give them: the other side of the readers.

use std::collections::BTreeMap;
use std::fmt::Write;

use arena::omni_sim::building::Building;
use arena::omni_sim::mesh::TriangleMesh;
use base64::Engine;
use serde_json::json;

/// Triangles with their colours, z up.
pub struct Part {
    pub name: String,
    pub triangles: Vec<([[f32; 3]; 3], [u8; 3])>,
}

/// Structure, things and, `with_rooms`, the volumes of the rooms.
pub fn parts_of(building: &Building, with_rooms: bool) -> Vec<Part> {
    let mut of: BTreeMap<u32, Part> = BTreeMap::new();
    let name = |id: u32| match building.object(id) {
        None => "walls".to_owned(),
        Some(object) => format!("{}_{}.{id:03}", object.color, object.class.replace(' ', "_")),
    };
    let mut add = |mesh: &TriangleMesh, pose: &nalgebra::Isometry3<f32>| {
        for (k, face) in mesh.faces.iter().enumerate() {
            let id = mesh.instances[k];
            let part = of.entry(id).or_insert_with(|| Part { name: name(id), triangles: Vec::new() });
            let corner = |v: u32| <[f32; 3]>::from((pose * mesh.vertices[v as usize]).coords);
            part.triangles.push((face.map(corner), mesh.colors[k]));
        }
    };
    add(&building.mesh, &nalgebra::Isometry3::identity());
    building.movers.iter().for_each(|mover| add(&mover.mesh, &mover.path[0].1.cast()));
    let mut parts: Vec<Part> = of.into_values().collect();
    for room in building.rooms.iter().filter(|_| with_rooms) {
        let mut triangles = Vec::new();
        for r in &room.rects {
            let p = |x: f64, y: f64| [x as f32, y as f32, 0.1];
            let [a, b, c, d] = [p(r.min.x, r.min.y), p(r.max.x, r.min.y), p(r.max.x, r.max.y), p(r.min.x, r.max.y)];
            triangles.extend([([a, b, c], [0; 3]), ([a, c, d], [0; 3])]);
        }
        parts.push(Part { name: format!("room_{}", room.name.replace(' ', "_")), triangles });
    }
    parts
}

/// OBJ with z up, and its material library, which is to be called `colors.mtl`.
pub fn write_obj(parts: &[Part]) -> (String, String) {
    let (mut obj, mut mtl) = ("mtllib colors.mtl\n".to_owned(), String::new());
    let mut known: Vec<[u8; 3]> = Vec::new();
    let mut vertices = 0;
    for part in parts {
        writeln!(obj, "o {}", part.name).unwrap();
        for (corners, color) in &part.triangles {
            let number = known.iter().position(|k| k == color).unwrap_or_else(|| {
                known.push(*color);
                let [r, g, b] = color.map(|v| f64::from(v) / 255.0);
                writeln!(mtl, "newmtl c{}\nKd {r:.5} {g:.5} {b:.5}", known.len() - 1).unwrap();
                known.len() - 1
            });
            for [x, y, z] in corners {
                writeln!(obj, "v {x} {y} {z}").unwrap();
            }
            writeln!(obj, "usemtl c{number}\nf {} {} {}", vertices + 1, vertices + 2, vertices + 3).unwrap();
            vertices += 3;
        }
    }
    (obj, mtl)
}

/// How the bytes of a glTF are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    Embedded,
    Binary,
}

/// glTF with y up, a node and a mesh for each part, a primitive for each of its colours.
pub fn write_gltf(parts: &[Part], kept: Kept) -> Vec<u8> {
    let mut bytes: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut meshes, mut nodes, mut materials) = (vec![], vec![], vec![], vec![], vec![]);
    let linear = |v: u8| {
        let c = f64::from(v) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    for part in parts {
        let mut by_color: BTreeMap<[u8; 3], Vec<[[f32; 3]; 3]>> = BTreeMap::new();
        part.triangles.iter().for_each(|(corners, color)| by_color.entry(*color).or_default().push(*corners));
        let mut primitives = vec![];
        for (color, triangles) in by_color {
            let from = bytes.len();
            for [x, y, z] in triangles.iter().flatten() {
                // z up to y up.
                [*x, *z, -*y].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
            }
            views.push(json!({ "buffer": 0, "byteOffset": from, "byteLength": bytes.len() - from }));
            accessors.push(json!({ "bufferView": views.len() - 1, "componentType": 5126, "type": "VEC3", "count": 3 * triangles.len() }));
            let [r, g, b] = color.map(linear);
            materials.push(json!({ "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0] } }));
            primitives
                .push(json!({ "attributes": { "POSITION": accessors.len() - 1 }, "material": materials.len() - 1 }));
        }
        meshes.push(json!({ "primitives": primitives }));
        nodes.push(json!({ "name": part.name, "mesh": meshes.len() - 1 }));
    }
    let mut buffer = json!({ "byteLength": bytes.len() });
    if kept == Kept::Embedded {
        let text = base64::engine::general_purpose::STANDARD.encode(&bytes);
        buffer["uri"] = json!(format!("data:application/octet-stream;base64,{text}"));
    }
    let all: Vec<usize> = (0..nodes.len()).collect();
    let mut text = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": all }], "nodes": nodes, "meshes": meshes,
        "materials": materials, "accessors": accessors, "bufferViews": views, "buffers": [buffer],
    })
    .to_string()
    .into_bytes();
    if kept == Kept::Embedded {
        return text;
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let word = |n: usize| (n as u32).to_le_bytes();
    let mut glb = [b"glTF".as_slice(), &word(2), &word(28 + text.len() + bytes.len())].concat();
    glb.extend([&word(text.len()), b"JSON".as_slice(), &text, &word(bytes.len()), b"BIN\0", &bytes].concat());
    glb
}
