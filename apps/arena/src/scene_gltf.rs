//! glTF 2.0, as text or binary: nodes are named meshes, `baseColorFactor` gives colours. y points up, units are metres.
//!
//! Read are the nodes of the default scene with their transforms, triangles with float positions and any indices; buffers are
//! embedded, beside the file, or in the GLB. Textures, skins, animations and compressed meshes are not read: a file that requires
//! an extension is refused. A node without a name has its parent's.

use std::ops::Range;

use base64::Engine;
use nalgebra::{Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use omni_sim::imported::NamedMesh;
use serde_json::Value;

use crate::scene_error::{MOST_TRIANGLES, SceneError};

/// Nodes deeper than this are a circle or a joke.
const DEEPEST: usize = 256;
/// Most nodes visited; a node that has several parents counts for each.
const MOST_NODES: usize = 200_000;
/// Colour of a triangle without a material: the format's default.
const NO_COLOR: [u8; 3] = [255, 255, 255];

/// Reads the named meshes of a glTF or a GLB; `open` gives the bytes of a buffer by its relative address.
///
/// # Errors
/// The first element that is wrong, or a buffer that cannot be opened.
pub fn read_gltf(
    bytes: &[u8],
    open: &dyn Fn(&str) -> Result<Vec<u8>, SceneError>,
) -> Result<Vec<NamedMesh>, SceneError> {
    let (json, binary) = parts(bytes)?;
    let root: Value = serde_json::from_slice(json).map_err(|error| SceneError::NoGltf(error.to_string()))?;
    if root["extensionsRequired"].as_array().is_some_and(|list| !list.is_empty()) {
        return Err(wrong("extensionsRequired", "nothing"));
    }
    let buffers = read_buffers(&root, binary, open)?;
    let mut file = File { root: &root, buffers, meshes: Vec::new(), nodes: 0, vertices: 0, triangles: 0 };
    let scene = &root["scenes"][root["scene"].as_u64().unwrap_or(0) as usize]["nodes"];
    let roots: Vec<usize> = match scene.as_array() {
        Some(list) => list.iter().map(|node| node.as_u64().unwrap_or(u64::MAX) as usize).collect(),
        None => return Err(wrong("scenes", "a scene with a list of nodes")),
    };
    for node in roots {
        // y up to z up.
        let upright = Matrix4::new(1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1.);
        file.visit(node, &upright, "", 0)?;
    }
    Ok(file.meshes)
}

fn wrong(place: impl Into<String>, wanted: &'static str) -> SceneError {
    SceneError::Element { place: place.into(), wanted }
}

/// JSON and binary chunk of a GLB, or the whole as JSON.
fn parts(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), SceneError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let cut_off = || SceneError::NoGltf("the GLB is cut off: a header and chunks of their length are accepted".into());
    let word = |at: usize| {
        let four = bytes.get(at..at + 4).ok_or_else(cut_off)?;
        Ok::<u32, SceneError>(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
    };
    if word(4)? != 2 {
        return Err(SceneError::NoGltf(format!("version {} of GLB; 2 is accepted", word(4)?)));
    }
    let chunk = |at: usize| {
        let length = word(at)? as usize;
        bytes.get(at + 8..(at + 8).saturating_add(length)).ok_or_else(cut_off)
    };
    let json = chunk(12)?;
    let next = 20 + json.len();
    let binary = if next < bytes.len() { Some(chunk(next)?) } else { None };
    Ok((json, binary))
}

fn read_buffers(
    root: &Value,
    binary: Option<&[u8]>,
    open: &dyn Fn(&str) -> Result<Vec<u8>, SceneError>,
) -> Result<Vec<Vec<u8>>, SceneError> {
    let list = root["buffers"].as_array().map(Vec::as_slice).unwrap_or_default();
    let read = |(number, buffer): (usize, &Value)| match buffer["uri"].as_str() {
        None if number == 0 => {
            binary.map(<[u8]>::to_vec).ok_or_else(|| wrong("buffers[0]", "a uri, or a GLB with a binary chunk,"))
        }
        None => Err(wrong(format!("buffers[{number}]"), "a uri")),
        Some(uri) => match uri.strip_prefix("data:") {
            Some(data) => {
                let (_, text) = data
                    .split_once(";base64,")
                    .ok_or_else(|| wrong(format!("buffers[{number}].uri"), "data in base64"))?;
                base64::engine::general_purpose::STANDARD
                    .decode(text)
                    .map_err(|_| wrong(format!("buffers[{number}].uri"), "data in base64"))
            }
            None => open(uri),
        },
    };
    list.iter().enumerate().map(read).collect()
}

struct File<'a> {
    root: &'a Value,
    buffers: Vec<Vec<u8>>,
    meshes: Vec<NamedMesh>,
    nodes: usize,
    vertices: usize,
    triangles: usize,
}

impl File<'_> {
    fn visit(&mut self, node: usize, parent: &Matrix4<f64>, name: &str, depth: usize) -> Result<(), SceneError> {
        let place = format!("nodes[{node}]");
        self.nodes += 1;
        if depth > DEEPEST || self.nodes > MOST_NODES {
            return Err(wrong(place, "a tree of at most 256 levels and 200000 nodes and primitives"));
        }
        let root = self.root;
        let value = root["nodes"].get(node).ok_or_else(|| wrong(place.as_str(), "the number of a node of the file"))?;
        let world_from_node = parent * transform(value).ok_or_else(|| wrong(place, "a transform of finite numbers"))?;
        let name = value["name"].as_str().filter(|own| !own.is_empty()).unwrap_or(name);
        if let Some(mesh) = value["mesh"].as_u64() {
            self.add_mesh(mesh as usize, &world_from_node, name)?;
        }
        for child in value["children"].as_array().map(Vec::as_slice).unwrap_or_default() {
            self.visit(child.as_u64().unwrap_or(u64::MAX) as usize, &world_from_node, name, depth + 1)?;
        }
        Ok(())
    }

    fn add_mesh(&mut self, number: usize, world_from_node: &Matrix4<f64>, name: &str) -> Result<(), SceneError> {
        let place = format!("meshes[{number}]");
        let root = self.root;
        let value =
            root["meshes"].get(number).ok_or_else(|| wrong(place.as_str(), "the number of a mesh of the file"))?;
        let name = if name.is_empty() { value["name"].as_str().unwrap_or_default() } else { name };
        let mut mesh = NamedMesh { name: name.to_owned(), ..NamedMesh::default() };
        // A mirrored node turns its triangles inside out.
        let is_mirrored = world_from_node.determinant() < 0.0;
        for (k, primitive) in value["primitives"].as_array().map(Vec::as_slice).unwrap_or_default().iter().enumerate() {
            let place = format!("{place}.primitives[{k}]");
            // Empty primitives of a mesh that many nodes share cost time too.
            self.nodes += 1;
            if self.nodes > MOST_NODES {
                return Err(wrong(place, "a scene of at most 200000 nodes and primitives"));
            }
            if primitive["mode"].as_u64().unwrap_or(4) != 4 {
                return Err(wrong(place, "mode 4 (triangles)"));
            }
            let positions = primitive["attributes"]["POSITION"]
                .as_u64()
                .ok_or_else(|| wrong(place.as_str(), "an attribute POSITION"))?;
            let first = mesh.vertices.len();
            for point in self.positions(positions as usize)? {
                mesh.vertices.push(world_from_node.transform_point(&point));
            }
            let count = mesh.vertices.len() - first;
            self.vertices += count;
            if self.vertices > 3 * MOST_TRIANGLES {
                return Err(SceneError::TooMany(MOST_TRIANGLES));
            }
            let corners: Vec<u32> = match primitive["indices"].as_u64() {
                Some(accessor) => self.indices(accessor as usize)?,
                None => (0..count as u32).collect(),
            };
            if corners.iter().any(|corner| *corner as usize >= count) || !corners.len().is_multiple_of(3) {
                return Err(wrong(format!("{place}.indices"), "three vertices of the primitive for each triangle"));
            }
            self.triangles += corners.len() / 3;
            if self.triangles > MOST_TRIANGLES {
                return Err(SceneError::TooMany(MOST_TRIANGLES));
            }
            let color = self.color(&primitive["material"]);
            for corner in corners.chunks_exact(3) {
                let [a, b, c] = [corner[0], corner[1], corner[2]].map(|corner| first as u32 + corner);
                mesh.faces.push(if is_mirrored { [a, c, b] } else { [a, b, c] });
                mesh.colors.push(color);
            }
        }
        self.meshes.push(mesh);
        Ok(())
    }

    fn positions(&self, number: usize) -> Result<Vec<Point3<f64>>, SceneError> {
        let place = || format!("accessors[{number}]");
        let accessor = &self.root["accessors"][number];
        if accessor["componentType"].as_u64() != Some(5126) || accessor["type"].as_str() != Some("VEC3") {
            return Err(wrong(place(), "VEC3 of floats (5126) for positions"));
        }
        let (bytes, elements, stride) = self.elements(number, 12)?;
        let float = |at: usize| f64::from(f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]));
        let points: Vec<Point3<f64>> =
            elements.map(|k| k * stride).map(|at| Point3::new(float(at), float(at + 4), float(at + 8))).collect();
        if points.iter().all(|point| point.iter().all(|value| value.is_finite())) {
            Ok(points)
        } else {
            Err(wrong(place(), "positions of finite numbers"))
        }
    }

    fn indices(&self, number: usize) -> Result<Vec<u32>, SceneError> {
        let accessor = &self.root["accessors"][number];
        let size = match (accessor["componentType"].as_u64(), accessor["type"].as_str()) {
            (Some(5121), Some("SCALAR")) => 1,
            (Some(5123), Some("SCALAR")) => 2,
            (Some(5125), Some("SCALAR")) => 4,
            _ => return Err(wrong(format!("accessors[{number}]"), "SCALAR of type 5121, 5123 or 5125 for indices")),
        };
        let (bytes, elements, stride) = self.elements(number, size)?;
        let value =
            |at: usize| bytes[at..at + size].iter().rev().fold(0_u32, |value, byte| value << 8 | u32::from(*byte));
        Ok(elements.map(|k| value(k * stride)).collect())
    }

    /// The bytes of an accessor, the numbers of its elements, and how far these lie apart: all inside the buffer.
    fn elements(&self, number: usize, size: usize) -> Result<(&[u8], Range<usize>, usize), SceneError> {
        let accessor = &self.root["accessors"][number];
        let place = || format!("accessors[{number}]");
        if accessor.get("sparse").is_some() {
            return Err(wrong(place(), "an accessor that is not sparse"));
        }
        let count = accessor["count"].as_u64().ok_or_else(|| wrong(place(), "a count"))?;
        let view = &self.root["bufferViews"][accessor["bufferView"].as_u64().unwrap_or(u64::MAX) as usize];
        let get = |value: &Value| value.as_u64().unwrap_or(0) as usize;
        let outside = || wrong(place(), "a view that lies inside its buffer");
        let buffer = self.buffers.get(view["buffer"].as_u64().unwrap_or(u64::MAX) as usize).ok_or_else(outside)?;
        let (from, length) = (get(&view["byteOffset"]), get(&view["byteLength"]));
        let bytes = buffer.get(from..from.saturating_add(length)).ok_or_else(outside)?;
        let bytes = bytes.get(get(&accessor["byteOffset"])..).ok_or_else(outside)?;
        let stride = view["byteStride"].as_u64().map_or(size, |stride| stride as usize);
        let last = usize::try_from(count).ok().and_then(|count| count.saturating_sub(1).checked_mul(stride));
        let is_inside = last.and_then(|last| last.checked_add(size)).is_some_and(|end| end <= bytes.len());
        if stride < size || (count > 0 && !is_inside) {
            return Err(outside());
        }
        Ok((bytes, 0..count as usize, stride))
    }

    /// A material's colour as it looks; the file has it in linear light.
    fn color(&self, material: &Value) -> [u8; 3] {
        let Some(number) = material.as_u64() else { return NO_COLOR };
        let factor = &self.root["materials"][number as usize]["pbrMetallicRoughness"]["baseColorFactor"];
        [0, 1, 2].map(|k| {
            let linear = factor[k].as_f64().unwrap_or(1.0).clamp(0.0, 1.0);
            let seen = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
            (seen * 255.0).round() as u8
        })
    }
}

/// `matrix`, or translation, rotation and scale.
fn transform(node: &Value) -> Option<Matrix4<f64>> {
    let numbers = |key: &str, count: usize| -> Option<Option<Vec<f64>>> {
        let Some(list) = node[key].as_array() else { return Some(None) };
        let numbers: Option<Vec<f64>> = list.iter().map(Value::as_f64).collect();
        numbers.filter(|n| n.len() == count && n.iter().all(|n| n.is_finite() && n.abs() < 1e9)).map(Some)
    };
    if let Some(matrix) = numbers("matrix", 16)? {
        return Some(Matrix4::from_column_slice(&matrix));
    }
    let translation = numbers("translation", 3)?.map_or(Vector3::zeros(), |v| Vector3::from_column_slice(&v));
    let rotation = match numbers("rotation", 4)? {
        Some(q) => UnitQuaternion::try_new(Quaternion::new(q[3], q[0], q[1], q[2]), 1e-9)?,
        None => UnitQuaternion::identity(),
    };
    let scale = numbers("scale", 3)?.map_or(Vector3::new(1.0, 1.0, 1.0), |v| Vector3::from_column_slice(&v));
    let turned = Translation3::from(translation).to_homogeneous() * rotation.to_homogeneous();
    Some(turned * Matrix4::new_nonuniform_scaling(&scale))
}
