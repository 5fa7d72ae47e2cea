//! Layer 1 as files carry it: a triangle mesh with what each vertex may know, as binary PLY.
//!
//! The map makes the mesh and the folder keeps its bytes; this reader is for what passes between file formats
//! ([`crate::spark`]). Vertex properties: `float x, y, z`; `uchar red, green, blue, alpha`; `label` (`ushort` from our map, `uint`
//! where larger); `uint stamp_low, stamp_high` and `first_seen_low, first_seen_high` for stamps, since PLY has no 64-bit numbers. Faces: `list
//! uchar uint vertex_indices`, larger polygons as fans. Other vertex properties are skipped.

use std::io::{self, Write};

/// A triangle mesh; each list of vertex data is empty or as long as `points`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertices, metres, world frame.
    pub points: Vec<[f32; 3]>,
    /// Red, green, blue, alpha.
    pub colors: Vec<[u8; 4]>,
    /// Number of the class.
    pub labels: Vec<u32>,
    /// When it was seen last, nanoseconds.
    pub stamps: Vec<u64>,
    /// When it was seen first, nanoseconds.
    pub first_seen_stamps: Vec<u64>,
    /// Triangles, by vertex.
    pub faces: Vec<[u32; 3]>,
}

/// Why a mesh was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// The header is not that of a binary little-endian PLY file with float x, y, z and triangles.
    #[error("the mesh is no binary little-endian PLY file with float x, y, z (header line {line})")]
    Header {
        /// Line, from 1.
        line: usize,
    },
    /// The file ends early.
    #[error("the mesh ends early, in {what} {index}")]
    Truncated {
        /// "vertex" or "face".
        what: &'static str,
        /// Its number, from 0.
        index: usize,
    },
    /// A face names a vertex that does not exist or has fewer than three corners.
    #[error("face {index} of the mesh is broken")]
    Face {
        /// Its number, from 0.
        index: usize,
    },
    /// A vertex is not finite.
    #[error("vertex {index} of the mesh is not finite")]
    NotFinite {
        /// Its number, from 0.
        index: usize,
    },
}

/// A number of a PLY file.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn of(word: &str) -> Option<Scalar> {
        Some(match word {
            "char" | "int8" => Scalar::I8,
            "uchar" | "uint8" => Scalar::U8,
            "short" | "int16" => Scalar::I16,
            "ushort" | "uint16" => Scalar::U16,
            "int" | "int32" => Scalar::I32,
            "uint" | "uint32" => Scalar::U32,
            "float" | "float32" => Scalar::F32,
            "double" | "float64" => Scalar::F64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// As a real number; integers are exact.
    fn read(self, b: &[u8]) -> f64 {
        let four = || [b[0], b[1], b[2], b[3]];
        match self {
            Scalar::I8 => f64::from(b[0] as i8),
            Scalar::U8 => f64::from(b[0]),
            Scalar::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            Scalar::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
            Scalar::I32 => f64::from(i32::from_le_bytes(four())),
            Scalar::U32 => f64::from(u32::from_le_bytes(four())),
            Scalar::F32 => f64::from(f32::from_le_bytes(four())),
            Scalar::F64 => f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]),
        }
    }
}

/// What the header declares.
#[derive(Debug, Default)]
struct Header {
    vertices: usize,
    faces: usize,
    /// Name, type and offset of each vertex property.
    properties: Vec<(String, Scalar, usize)>,
    vertex_bytes: usize,
    /// Type of a face's count and of its indices.
    face: Option<(Scalar, Scalar)>,
    /// Where the data begin.
    end: usize,
}

impl Mesh {
    /// Reads a PLY file.
    ///
    /// # Errors
    /// [`MeshError`] with the place; never a panic, whatever the bytes.
    pub fn from_ply(bytes: &[u8]) -> Result<Mesh, MeshError> {
        let header = Header::read(bytes)?;
        let data = &bytes[header.end..];
        // A hostile count must not make us ask for memory that the file cannot fill.
        let whole = data.len() / header.vertex_bytes.max(1);
        if whole < header.vertices {
            return Err(MeshError::Truncated { what: "vertex", index: whole });
        }
        let find = |name: &str| header.properties.iter().find(|(found, _, _)| found == name);
        let number = |name: &str| find(name).map(|(_, scalar, offset)| (*scalar, *offset));
        let all = |names: &[&str]| names.iter().map(|name| number(name)).collect::<Option<Vec<_>>>();
        let position = all(&["x", "y", "z"]).ok_or(MeshError::Header { line: 1 })?;
        let (color, alpha, label) = (all(&["red", "green", "blue"]), number("alpha"), number("label"));
        let stamp = all(&["stamp_low", "stamp_high"]);
        let first_seen = all(&["first_seen_low", "first_seen_high"]);
        let mut mesh = Mesh::default();
        for (index, row) in data.chunks_exact(header.vertex_bytes).take(header.vertices).enumerate() {
            let read = |(scalar, offset): (Scalar, usize)| scalar.read(&row[offset..]);
            let halves = |half: &[(Scalar, usize)]| (read(half[1]) as u64) << 32 | read(half[0]) as u64;
            let point = [read(position[0]) as f32, read(position[1]) as f32, read(position[2]) as f32];
            if point.iter().any(|value| !value.is_finite()) {
                return Err(MeshError::NotFinite { index });
            }
            mesh.points.push(point);
            if let Some(color) = &color {
                let alpha = alpha.map_or(255, |alpha| read(alpha) as u8);
                mesh.colors.push([read(color[0]) as u8, read(color[1]) as u8, read(color[2]) as u8, alpha]);
            }
            mesh.labels.extend(label.map(|label| read(label) as u32));
            mesh.stamps.extend(stamp.as_deref().map(halves));
            mesh.first_seen_stamps.extend(first_seen.as_deref().map(halves));
        }
        mesh.read_faces(&data[header.vertices * header.vertex_bytes..], &header)?;
        Ok(mesh)
    }

    fn read_faces(&mut self, mut data: &[u8], header: &Header) -> Result<(), MeshError> {
        let Some((count_type, index_type)) = header.face else {
            return Ok(());
        };
        for index in 0..header.faces {
            let truncated = MeshError::Truncated { what: "face", index };
            let count = count_type.read(data.get(..count_type.bytes()).ok_or(truncated.clone())?);
            let wanted = (count.max(0.0) as usize).saturating_mul(index_type.bytes());
            let corners = data.get(count_type.bytes()..).and_then(|rest| rest.get(..wanted)).ok_or(truncated)?;
            let corners: Vec<f64> = corners.chunks_exact(index_type.bytes()).map(|b| index_type.read(b)).collect();
            let is_sound = |corner: &f64| *corner >= 0.0 && *corner < self.points.len() as f64;
            if corners.len() < 3 || !corners.iter().all(is_sound) {
                return Err(MeshError::Face { index });
            }
            let fan = corners.windows(2).skip(1);
            self.faces.extend(fan.map(|pair| [corners[0] as u32, pair[0] as u32, pair[1] as u32]));
            data = &data[count_type.bytes() + wanted..];
        }
        Ok(())
    }

    /// Writes a PLY file.
    ///
    /// # Errors
    /// What the writer says.
    pub fn write_ply(&self, out: &mut impl Write) -> io::Result<()> {
        let has = |list: usize| list == self.points.len() && list > 0;
        let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", self.points.len());
        header.push_str("property float x\nproperty float y\nproperty float z\n");
        if has(self.colors.len()) {
            header.push_str("property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n");
        }
        if has(self.labels.len()) {
            header.push_str("property uint label\n");
        }
        if has(self.stamps.len()) {
            header.push_str("property uint stamp_low\nproperty uint stamp_high\n");
        }
        if has(self.first_seen_stamps.len()) {
            header.push_str("property uint first_seen_low\nproperty uint first_seen_high\n");
        }
        header.push_str(&format!("element face {}\nproperty list uchar uint vertex_indices\n", self.faces.len()));
        header.push_str("end_header\n");
        out.write_all(header.as_bytes())?;
        let mut rows = Vec::new();
        for (index, point) in self.points.iter().enumerate() {
            rows.extend(point.iter().flat_map(|value| value.to_le_bytes()));
            if has(self.colors.len()) {
                rows.extend(self.colors[index]);
            }
            if has(self.labels.len()) {
                rows.extend(self.labels[index].to_le_bytes());
            }
            // Little-endian: the low half comes first.
            if has(self.stamps.len()) {
                rows.extend(self.stamps[index].to_le_bytes());
            }
            if has(self.first_seen_stamps.len()) {
                rows.extend(self.first_seen_stamps[index].to_le_bytes());
            }
        }
        for face in &self.faces {
            rows.push(3);
            rows.extend(face.iter().flat_map(|corner| corner.to_le_bytes()));
        }
        out.write_all(&rows)
    }
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Header, MeshError> {
        // Nobody needs more; without a bound a large file of another kind would be searched to its end.
        const MAX_HEADER: usize = 1 << 14;
        let mut header = Header::default();
        let mut element = String::new();
        let mut at = 0;
        for line in 1.. {
            let wrong = || MeshError::Header { line };
            let rest = bytes.get(at..bytes.len().min(MAX_HEADER)).ok_or_else(wrong)?;
            let length = rest.iter().position(|byte| *byte == b'\n').ok_or_else(wrong)?;
            let text = std::str::from_utf8(&rest[..length]).map_err(|_| wrong())?.trim_end();
            at += length + 1;
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            match words.as_slice() {
                ["ply"] if line == 1 => {}
                _ if line == 1 => return Err(wrong()),
                ["format", "binary_little_endian", "1.0"] | ["comment", ..] | ["obj_info", ..] | [] => {}
                ["element", name, count] => {
                    let count = count.parse::<u32>().map_err(|_| wrong())? as usize;
                    match *name {
                        "vertex" if element.is_empty() => header.vertices = count,
                        "face" if element == "vertex" => header.faces = count,
                        _ if count == 0 => {}
                        _ => return Err(wrong()),
                    }
                    element = (*name).to_owned();
                }
                ["property", "list", count, index, _] if element == "face" && header.face.is_none() => {
                    let types = (Scalar::of(count).ok_or_else(wrong)?, Scalar::of(index).ok_or_else(wrong)?);
                    header.face = Some(types);
                }
                ["property", kind, name] if element == "vertex" => {
                    let scalar = Scalar::of(kind).ok_or_else(wrong)?;
                    header.properties.push(((*name).to_owned(), scalar, header.vertex_bytes));
                    header.vertex_bytes += scalar.bytes();
                }
                ["end_header"] => break,
                _ => return Err(wrong()),
            }
        }
        header.end = at;
        Ok(header)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ply(mesh: &Mesh) -> Vec<u8> {
        let mut bytes = Vec::new();
        mesh.write_ply(&mut bytes).unwrap();
        bytes
    }

    fn any_mesh() -> impl Strategy<Value = Mesh> {
        (1_usize..20, any::<[bool; 4]>(), any::<u64>()).prop_map(|(count, has, seed)| {
            let number = |i: usize, k: u64| seed.wrapping_mul(i as u64 + 1).wrapping_add(k).rotate_left(17);
            let list = |on: bool| if on { 0..count } else { 0..0 };
            Mesh {
                points: (0..count).map(|i| [i as f32, -0.5 * i as f32, (number(i, 1) % 100) as f32]).collect(),
                colors: list(has[0]).map(|i| (number(i, 2) as u32).to_le_bytes()).collect(),
                labels: list(has[1]).map(|i| number(i, 3) as u32).collect(),
                stamps: list(has[2]).map(|i| number(i, 4)).collect(),
                first_seen_stamps: list(has[3]).map(|i| number(i, 5)).collect(),
                faces: (2..count as u32).map(|i| [i, i - 1, i - 2]).collect(),
            }
        })
    }

    proptest! {
        #[test]
        fn a_mesh_survives_the_file(mesh in any_mesh()) {
            prop_assert_eq!(Mesh::from_ply(&ply(&mesh)).unwrap(), mesh);
        }

        #[test]
        fn a_mesh_cut_anywhere_is_an_error_and_never_a_panic(mesh in any_mesh(), share in 0.0..1.0_f64) {
            let bytes = ply(&mesh);
            let cut = (bytes.len() as f64 * share) as usize;
            prop_assert!(Mesh::from_ply(&bytes[..cut]).is_err());
        }

        #[test]
        fn no_bytes_make_it_panic(mesh in any_mesh(), at in any::<prop::sample::Index>(), byte: u8) {
            let mut bytes = ply(&mesh);
            let at = at.index(bytes.len());
            bytes[at] = byte;
            let _ = Mesh::from_ply(&bytes);
        }
    }

    #[test]
    fn a_mesh_of_the_map_and_a_polygon_are_read() {
        let header = "ply\nformat binary_little_endian 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty float y\n\
             property float z\nproperty ushort label\nproperty ushort instance\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n";
        let mut bytes = header.as_bytes().to_vec();
        for (x, y) in [(0.0_f32, 0.0_f32), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            bytes.extend([x, y, 2.0].iter().flat_map(|value| value.to_le_bytes()));
            bytes.extend([7, 0, 9, 0]);
        }
        bytes.push(4);
        bytes.extend([0_i32, 1, 2, 3].iter().flat_map(|corner| corner.to_le_bytes()));
        let mesh = Mesh::from_ply(&bytes).unwrap();
        assert_eq!(mesh.points[2], [1.0, 1.0, 2.0]);
        assert_eq!(mesh.labels, [7; 4]);
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
        let last = bytes.len() - 4;
        bytes[last] = 4;
        assert_eq!(Mesh::from_ply(&bytes), Err(MeshError::Face { index: 0 }));
    }
}
