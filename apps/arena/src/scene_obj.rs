//! Wavefront OBJ: objects and groups are named meshes, materials give colours.
//!
//! Read are `v`, `f` (any polygon, as a fan), `o`, `g`, `usemtl`, `mtllib` with `newmtl` and `Kd`; everything else is passed over.
//! Which axis points up is not said in such a file: it is the one, y or z, along which the scene is less high than it is wide along
//! the other.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;
use omni_sim::imported::NamedMesh;

use crate::scene_error::{MOST_TRIANGLES, SceneError};

/// Colour of a triangle without a material.
const NO_COLOR: [u8; 3] = [200, 200, 200];

/// Three vertices and a colour.
type Face = ([u32; 3], [u8; 3]);

/// Reads the named meshes of an OBJ; `open` gives the bytes of a material library by its name.
///
/// # Errors
/// The first line that is wrong, or a library that cannot be opened.
pub fn read_obj(
    bytes: &[u8],
    open: &dyn Fn(&str) -> Result<Vec<u8>, SceneError>,
) -> Result<Vec<NamedMesh>, SceneError> {
    let text = String::from_utf8_lossy(bytes);
    let mut vertices: Vec<Point3<f64>> = Vec::new();
    let mut colors: BTreeMap<String, [u8; 3]> = BTreeMap::new();
    let mut libraries: BTreeSet<String> = BTreeSet::new();
    let mut color = NO_COLOR;
    let mut name = String::new();
    let mut faces: BTreeMap<String, Vec<Face>> = BTreeMap::new();
    let mut order: Vec<String> = Vec::new();
    let mut count = 0;
    for (number, line) in text.lines().enumerate() {
        let wrong =
            |wanted: &'static str| SceneError::Line { line: number + 1, text: line.chars().take(60).collect(), wanted };
        let line = line.trim();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match key {
            "v" => vertices.push(vertex(rest).ok_or_else(|| wrong("vertex: v and three finite numbers"))?),
            "f" => {
                let corners: Option<Vec<u32>> =
                    rest.split_whitespace().map(|corner| index(corner, vertices.len())).collect();
                let corners = corners
                    .filter(|corners| corners.len() >= 3)
                    .ok_or_else(|| wrong("face: f and at least three numbers of vertices above it"))?;
                count += corners.len() - 2;
                if count > MOST_TRIANGLES {
                    return Err(SceneError::TooMany(MOST_TRIANGLES));
                }
                if !faces.contains_key(&name) {
                    order.push(name.clone());
                }
                let of = faces.entry(name.clone()).or_default();
                of.extend(corners[1..].windows(2).map(|pair| ([corners[0], pair[0], pair[1]], color)));
            }
            "o" | "g" => name = rest.to_owned(),
            "usemtl" => color = colors.get(rest).copied().unwrap_or(NO_COLOR),
            "mtllib" if libraries.insert(rest.to_owned()) => read_materials(&open(rest)?, &mut colors)?,
            _ => {}
        }
    }
    let is_y_up = {
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for vertex in &vertices {
            (0..3).for_each(|k| (low[k], high[k]) = (low[k].min(vertex[k]), high[k].max(vertex[k])));
        }
        high[1] - low[1] < high[2] - low[2]
    };
    let upright = |p: Point3<f64>| if is_y_up { Point3::new(p.x, -p.z, p.y) } else { p };
    Ok(order.into_iter().map(|name| compact(&faces[&name], &vertices, &upright, name)).collect())
}

/// A mesh with the vertices it uses.
fn compact(
    faces: &[Face],
    vertices: &[Point3<f64>],
    upright: &dyn Fn(Point3<f64>) -> Point3<f64>,
    name: String,
) -> NamedMesh {
    let mut mesh = NamedMesh { name, ..NamedMesh::default() };
    let mut number_of: BTreeMap<u32, u32> = BTreeMap::new();
    for (face, color) in faces {
        let face = face.map(|corner| {
            *number_of.entry(corner).or_insert_with(|| {
                mesh.vertices.push(upright(vertices[corner as usize]));
                mesh.vertices.len() as u32 - 1
            })
        });
        mesh.faces.push(face);
        mesh.colors.push(*color);
    }
    mesh
}

fn vertex(text: &str) -> Option<Point3<f64>> {
    let mut numbers = text.split_whitespace().map(|word| word.parse::<f64>().ok().filter(|n| n.is_finite()));
    Some(Point3::new(numbers.next()??, numbers.next()??, numbers.next()??))
}

/// `7`, `7/1`, `7//3`, or `-1` for the last vertex so far.
fn index(text: &str, vertices: usize) -> Option<u32> {
    let number: i64 = text.split('/').next()?.parse().ok()?;
    let at = if number < 0 { vertices as i64 + number } else { number - 1 };
    (0..vertices as i64).contains(&at).then_some(at as u32)
}

fn read_materials(bytes: &[u8], colors: &mut BTreeMap<String, [u8; 3]>) -> Result<(), SceneError> {
    let mut name = String::new();
    for (number, line) in String::from_utf8_lossy(bytes).lines().enumerate() {
        let (key, rest) = line.trim().split_once(char::is_whitespace).unwrap_or((line, ""));
        match key {
            "newmtl" => name = rest.trim().to_owned(),
            "Kd" => {
                let rgb = vertex(rest).ok_or_else(|| SceneError::Line {
                    line: number + 1,
                    text: line.chars().take(60).collect(),
                    wanted: "colour of the material library: Kd and three numbers from 0 to 1",
                })?;
                let channel = |value: f64| (value * 255.0).round().clamp(0.0, 255.0) as u8;
                colors.insert(name.clone(), [channel(rgb.x), channel(rgb.y), channel(rgb.z)]);
            }
            _ => {}
        }
    }
    Ok(())
}
