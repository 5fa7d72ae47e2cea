//! The triangles of a building as a binary PLY that any viewer opens; a face has its colour and the number of its thing besides.

use anyhow::{Context, Result, bail, ensure};
use nalgebra::Point3;
use omni_sim::mesh::TriangleMesh;

/// What a vertex and a face take.
const VERTEX_BYTES: usize = 12;
const FACE_BYTES: usize = 1 + 12 + 3 + 4;

/// The properties, in the order in which they are written.
fn header(vertices: usize, faces: usize) -> String {
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment a building in metres; thing 0 is walls, floor, ceiling and frames\n\
         element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n\
         property uchar blue\nproperty uint thing\nend_header\n"
    )
}

/// The file.
pub fn ply_of(mesh: &TriangleMesh) -> Vec<u8> {
    let mut out = header(mesh.vertices.len(), mesh.faces.len()).into_bytes();
    out.reserve(mesh.vertices.len() * VERTEX_BYTES + mesh.faces.len() * FACE_BYTES);
    for vertex in &mesh.vertices {
        vertex.iter().for_each(|value| out.extend(value.to_le_bytes()));
    }
    for ((face, color), thing) in mesh.faces.iter().zip(&mesh.colors).zip(&mesh.instances) {
        out.push(3);
        face.iter().for_each(|index| out.extend(index.to_le_bytes()));
        out.extend(color);
        out.extend(thing.to_le_bytes());
    }
    out
}

/// Reads such a file.
///
/// # Errors
/// Anything that [`ply_of`] does not write: another header, too few or too many bytes, an index beyond the vertices.
pub fn read_ply(bytes: &[u8]) -> Result<TriangleMesh> {
    const END: &[u8] = b"end_header\n";
    const LONGEST_HEADER: usize = 2048;
    let head = &bytes[..bytes.len().min(LONGEST_HEADER)];
    let end = head.windows(END.len()).position(|window| window == END).context("it has no header of a PLY")?;
    let text = std::str::from_utf8(&head[..end + END.len()]).context("its header is no text")?;
    let count_of = |element: &str| -> Result<usize> {
        let line = text.lines().find_map(|line| line.strip_prefix(element));
        let count = line.with_context(|| format!("its header has no \"{element}\""))?;
        count.trim().parse().with_context(|| format!("\"{element}{count}\" is no number of elements"))
    };
    let (vertices, faces) = (count_of("element vertex ")?, count_of("element face ")?);
    ensure!(
        text == header(vertices, faces),
        "its properties are not those of a building (x, y, z; indices, colour, thing)"
    );
    let body = &bytes[end + END.len()..];
    let split = vertices.checked_mul(VERTEX_BYTES);
    let wanted = split.zip(faces.checked_mul(FACE_BYTES)).and_then(|(a, b)| a.checked_add(b));
    let (Some(split), true) = (split, wanted == Some(body.len())) else {
        bail!("it says {vertices} vertices and {faces} faces, and {} bytes follow", body.len());
    };
    let (vertex_bytes, face_bytes) = body.split_at(split);
    let mut mesh = TriangleMesh::default();
    let word = |bytes: &[u8], at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
    for vertex in vertex_bytes.chunks_exact(VERTEX_BYTES) {
        let [x, y, z] = [0, 4, 8].map(|at| f32::from_le_bytes(word(vertex, at)));
        ensure!(x.is_finite() && y.is_finite() && z.is_finite(), "a vertex is not finite");
        mesh.vertices.push(Point3::new(x, y, z));
    }
    for (number, face) in face_bytes.chunks_exact(FACE_BYTES).enumerate() {
        let corners = [1, 5, 9].map(|at| u32::from_le_bytes(word(face, at)));
        ensure!(face[0] == 3, "face {number} is no triangle");
        ensure!(
            corners.iter().all(|index| (*index as usize) < vertices),
            "face {number} has a corner that is not there"
        );
        mesh.faces.push(corners);
        mesh.colors.push([face[13], face[14], face[15]]);
        mesh.instances.push(u32::from_le_bytes(word(face, 16)));
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh() -> TriangleMesh {
        omni_sim::scenes::named_scene("spin").expect("it exists").mesh
    }

    #[test]
    fn what_is_written_is_read_again() {
        assert_eq!(read_ply(&ply_of(&mesh())).unwrap(), mesh());
        assert_eq!(read_ply(&ply_of(&TriangleMesh::default())).unwrap(), TriangleMesh::default());
    }

    #[test]
    fn other_files_are_refused_with_a_sentence() {
        let good = ply_of(&mesh());
        for cut in [0, 10, 300, good.len() - 1] {
            assert!(read_ply(&good[..cut]).is_err());
        }
        let text = String::from_utf8_lossy(&good[..120]).into_owned();
        let huge = good.clone();
        let line = text.lines().find(|line| line.starts_with("element vertex")).unwrap().to_owned();
        let at = huge.windows(line.len()).position(|window| window == line.as_bytes()).unwrap();
        let bytes = [&huge[..at], b"element vertex 18446744073709551615".as_slice(), &huge[at + line.len()..]].concat();
        assert!(format!("{:#}", read_ply(&bytes).unwrap_err()).contains("vertices"));
    }
}
