//! Vertices of collision meshes: binary and text STL, and OBJ.
//!
//! A collision mesh is used as the convex hull of its vertices, so faces are not kept.

use nalgebra::{Point3, Vector3};
use std::path::{Path, PathBuf};

/// What is wrong with the bytes of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MeshFault {
    /// Neither STL nor OBJ.
    #[error("is neither STL nor OBJ")]
    UnknownFormat,
    /// The file ends before its content does, or a number cannot be read.
    #[error("is cut off or damaged")]
    Damaged,
    /// A vertex is NaN or infinite.
    #[error("has a vertex that is not finite")]
    NotFinite,
    /// Fewer than four different vertices: no volume.
    #[error("has fewer than four different vertices")]
    TooFew,
}

/// The different vertices of a mesh, scaled, in ascending order of (x, y, z).
///
/// `name` decides the format by its ending (`.stl`, `.obj`, any case).
///
/// # Errors
/// See [`MeshFault`].
pub fn vertices(name: &str, bytes: &[u8], scale: &Vector3<f64>) -> Result<Vec<Point3<f64>>, MeshFault> {
    let ending = name.rsplit('.').next().unwrap_or("").to_ascii_lowercase();
    let raw = match ending.as_str() {
        "stl" => stl(bytes)?,
        "obj" => tagged_lines(bytes, "v")?,
        _ => return Err(MeshFault::UnknownFormat),
    };
    let mut points: Vec<Point3<f64>> = raw.into_iter().map(|p| Point3::from(p.coords.component_mul(scale))).collect();
    if points.iter().any(|p| !p.coords.iter().all(|v| v.is_finite())) {
        return Err(MeshFault::NotFinite);
    }
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    points.dedup();
    if points.len() < 4 { Err(MeshFault::TooFew) } else { Ok(points) }
}

/// Places where a mesh named in a URDF may lie, best first; the caller tries them in turn.
///
/// `package://NAME/rest` is looked for as `A/NAME/rest` in every folder `A` above the URDF (which covers both a ROS workspace and a
/// plain checkout), and as `A/rest` where `A` itself is called NAME. `file://` and absolute names stand for themselves; other names
/// are relative to the folder of the URDF. Give `urdf_folder` as an absolute path (`std::path::absolute`): a relative one has no
/// folders above it.
pub fn mesh_candidates(file: &str, urdf_folder: &Path) -> Vec<PathBuf> {
    let package = file.strip_prefix("package://").or_else(|| file.strip_prefix("model://"));
    let Some(path) = package else {
        return vec![urdf_folder.join(file.strip_prefix("file://").unwrap_or(file))];
    };
    let (name, rest) = path.split_once('/').unwrap_or(("", path));
    let mut candidates = Vec::new();
    for folder in urdf_folder.ancestors() {
        candidates.push(folder.join(path));
        if folder.file_name().is_some_and(|folder_name| folder_name == name) {
            candidates.push(folder.join(rest));
        }
    }
    candidates
}

/// Binary STL has 80 bytes of anything, a count, and 50 bytes a triangle; a text STL never has just that size.
fn stl(bytes: &[u8]) -> Result<Vec<Point3<f64>>, MeshFault> {
    const HEADER: usize = 84;
    const TRIANGLE: usize = 50;
    if let Some(count) = bytes.get(80..HEADER) {
        let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize;
        if count.checked_mul(TRIANGLE).and_then(|size| size.checked_add(HEADER)) == Some(bytes.len()) {
            let float = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            return Ok(bytes[HEADER..]
                .chunks_exact(TRIANGLE)
                // 12 bytes of normal, then three corners of 12 bytes.
                .flat_map(|triangle| triangle[12..48].chunks_exact(12))
                .map(|corner| Point3::new(float(&corner[0..4]), float(&corner[4..8]), float(&corner[8..12])))
                .collect());
        }
    }
    if bytes.trim_ascii_start().starts_with(b"solid") { tagged_lines(bytes, "vertex") } else { Err(MeshFault::Damaged) }
}

/// All lines `TAG x y z ...` of a text.
fn tagged_lines(bytes: &[u8], tag: &str) -> Result<Vec<Point3<f64>>, MeshFault> {
    let text = std::str::from_utf8(bytes).map_err(|_| MeshFault::Damaged)?;
    let mut points = Vec::new();
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        if words.next() != Some(tag) {
            continue;
        }
        let mut number = || words.next().and_then(|word| word.parse::<f64>().ok()).ok_or(MeshFault::Damaged);
        points.push(Point3::new(number()?, number()?, number()?));
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    fn binary_stl() -> Vec<u8> {
        let mut bytes = vec![0u8; 80];
        bytes.extend(4u32.to_le_bytes());
        for face in FACES {
            bytes.extend([0u8; 12]);
            for corner in face {
                bytes.extend(TETRAHEDRON[corner].iter().flat_map(|v| v.to_le_bytes()));
            }
            bytes.extend([0u8; 2]);
        }
        bytes
    }

    #[test]
    fn the_three_formats_agree() {
        let obj = b"# a comment\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n";
        let mut text = String::from("solid t\n");
        for face in FACES {
            for corner in face {
                let [x, y, z] = TETRAHEDRON[corner];
                text += &format!("      vertex {x} {y} {z}\n");
            }
        }
        let scale = Vector3::new(2.0, 1.0, -1.0);
        let expected = vec![
            Point3::new(0.0, 0.0, -1.0),
            Point3::new(0.0, 0.0, -0.0),
            Point3::new(0.0, 1.0, -0.0),
            Point3::new(2.0, 0.0, -0.0),
        ];
        for (name, bytes) in [("a.STL", binary_stl()), ("a.stl", text.into_bytes()), ("a.obj", obj.to_vec())] {
            assert_eq!(vertices(name, &bytes, &scale), Ok(expected.clone()), "{name}");
        }
    }

    #[test]
    fn damaged_meshes_are_refused() {
        let one = Vector3::repeat(1.0);
        let mut cut = binary_stl();
        cut.pop();
        assert_eq!(vertices("a.stl", &cut, &one), Err(MeshFault::Damaged));
        assert_eq!(vertices("a.stl", b"", &one), Err(MeshFault::Damaged));
        assert_eq!(vertices("a.dae", b"<COLLADA/>", &one), Err(MeshFault::UnknownFormat));
        assert_eq!(vertices("a.obj", b"v 1 2", &one), Err(MeshFault::Damaged));
        assert_eq!(vertices("a.obj", b"v 1 2 nan\nv 0 0 0", &one), Err(MeshFault::NotFinite));
        assert_eq!(vertices("a.obj", b"v 1 2 3\nv 1 2 3\nv 0 0 0", &one), Err(MeshFault::TooFew));
    }

    #[test]
    fn packages_are_looked_for_upwards() {
        let found = mesh_candidates("package://dog/meshes/a.stl", Path::new("/ws/src/dog/urdf"));
        assert!(found.contains(&PathBuf::from("/ws/src/dog/meshes/a.stl")));
        assert_eq!(mesh_candidates("../a.stl", Path::new("/ws")), vec![PathBuf::from("/ws/../a.stl")]);
    }
}
