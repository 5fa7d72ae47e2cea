//! Meshes as binary PLY files: `float x, y, z`, `ushort label`, `ushort instance` if the mesh knows any, triangles as `list uchar uint vertex_indices`; and the points of
//! PLY files that others wrote ([`points`]).

pub mod points;

use std::io::{BufRead, BufReader, Read, Write};

use nalgebra::Point3;
use thiserror::Error;

use crate::mesh::Mesh;
use crate::volume::Volume;

/// A mesh file that cannot be read.
#[derive(Debug, Error)]
pub enum PlyError {
    /// The reader or writer failed, or the file ends early.
    #[error("reading or writing the mesh failed")]
    Io(#[from] std::io::Error),
    /// The first line is not `ply`.
    #[error("not a PLY file")]
    NotPly,
    /// Neither `binary_little_endian 1.0` nor, for points, `ascii 1.0`.
    #[error("the format must be binary_little_endian 1.0 (for points also ascii 1.0)")]
    Format,
    /// A header line makes no sense, or the header is too long.
    #[error("header line {line} makes no sense")]
    Header {
        /// Counted from one.
        line: usize,
    },
    /// The vertices have no float x, y, z.
    #[error("vertices need the properties x, y, z of type float (for points also double)")]
    NoPosition,
    /// An element or a list of a kind this reader does not know.
    #[error("header line {line} declares something this reader does not know")]
    Unsupported {
        /// Counted from one.
        line: usize,
    },
    /// More vertices or faces than 32-bit numbers can name.
    #[error("the file declares {0} elements, more than can be read")]
    TooMany(u64),
    /// A line of an ascii file has not the declared numbers.
    #[error("line {line} does not hold the numbers that the header declares")]
    Row {
        /// Counted from one.
        line: usize,
    },
    /// The file ends before a vertex.
    #[error("the file ends in vertex {vertex} of {of}")]
    Vertex {
        /// Counted from zero.
        vertex: usize,
        /// Declared.
        of: usize,
    },
    /// A face names a vertex that does not exist, or has fewer than three corners.
    #[error("face {face} is broken")]
    Face {
        /// Counted from zero.
        face: usize,
    },
}

impl Mesh {
    /// Writes the mesh as binary PLY.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn write_ply(&self, mut out: impl Write) -> std::io::Result<()> {
        write!(
            out,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             property ushort label\n{}element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
            self.vertices.len(),
            if self.instances.is_empty() { "" } else { "property ushort instance\n" },
            self.faces.len()
        )?;
        let mut bytes = Vec::with_capacity(16 * self.vertices.len().max(self.faces.len()));
        for (number, (vertex, label)) in self.vertices.iter().zip(&self.labels).enumerate() {
            for c in vertex.iter() {
                bytes.extend_from_slice(&c.to_le_bytes());
            }
            bytes.extend_from_slice(&label.to_le_bytes());
            if !self.instances.is_empty() {
                bytes.extend_from_slice(&self.instances[number].to_le_bytes());
            }
        }
        out.write_all(&bytes)?;
        bytes.clear();
        for face in &self.faces {
            bytes.push(3);
            for v in face {
                bytes.extend_from_slice(&v.to_le_bytes());
            }
        }
        out.write_all(&bytes)?;
        out.flush()
    }

    /// Reads a binary PLY: positions, labels and instances if there are any (`label`, `instance`; what exceeds 65535 becomes
    /// that), other properties are skipped; polygons are split into fans.
    ///
    /// # Errors
    /// [`PlyError`] says what is wrong with the file.
    pub fn read_ply(input: impl Read) -> Result<Self, PlyError> {
        let mut input = BufReader::new(input);
        let header = Header::read(&mut input)?;
        if header.format != Format::Binary {
            return Err(PlyError::Format);
        }
        let mut mesh = Self::default();
        for element in &header.elements {
            match element.name.as_str() {
                "vertex" => read_vertices(&mut input, element, &mut mesh)?,
                "face" => read_faces(&mut input, element, &mut mesh)?,
                _ => return Err(PlyError::Unsupported { line: element.line }),
            }
        }
        for (face, corners) in mesh.faces.iter().enumerate() {
            if corners.iter().any(|v| *v as usize >= mesh.vertices.len()) {
                return Err(PlyError::Face { face });
            }
        }
        Ok(mesh)
    }
}

impl Volume {
    /// Writes the mesh as of the last [`update_mesh`](Volume::update_mesh) as binary PLY.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn write_mesh_ply(&self, out: impl Write) -> std::io::Result<()> {
        self.mesh().write_ply(out)
    }
}

fn read_vertices(input: &mut impl Read, element: &Element, mesh: &mut Mesh) -> Result<(), PlyError> {
    let mut at = 0;
    let mut offset = [None; 5];
    for property in &element.properties {
        let Kind::Scalar(scalar) = property.kind else {
            return Err(PlyError::Unsupported { line: property.line });
        };
        for (k, name) in ["x", "y", "z", "label", "instance"].into_iter().enumerate() {
            if property.name == name && (k >= 3 || scalar == Scalar::F32) {
                offset[k] = Some((at, scalar));
            }
        }
        at += scalar.size();
    }
    let [Some((x, _)), Some((y, _)), Some((z, _)), label, instance] = offset else {
        return Err(PlyError::NoPosition);
    };
    let mut row = vec![0u8; at];
    for _ in 0..element.count {
        input.read_exact(&mut row)?;
        let float = |from: usize| f32::from_le_bytes([row[from], row[from + 1], row[from + 2], row[from + 3]]);
        mesh.vertices.push(Point3::new(float(x), float(y), float(z)));
        let whole = |(from, scalar): (usize, Scalar)| scalar.whole(&row[from..]).min(65_535) as u16;
        mesh.labels.push(label.map_or(0, whole));
        mesh.instances.extend(instance.map(whole));
    }
    Ok(())
}

fn read_faces(input: &mut impl Read, element: &Element, mesh: &mut Mesh) -> Result<(), PlyError> {
    for face in 0..element.count {
        for property in &element.properties {
            let mut buffer = [0u8; 8];
            match property.kind {
                Kind::Scalar(scalar) => input.read_exact(&mut buffer[..scalar.size()])?,
                Kind::List(count, item) => {
                    input.read_exact(&mut buffer[..count.size()])?;
                    let corners = count.whole(&buffer);
                    let is_face = property.name == "vertex_indices" || property.name == "vertex_index";
                    if is_face && !(3..=255).contains(&corners) {
                        return Err(PlyError::Face { face });
                    }
                    let mut polygon = Vec::new();
                    for _ in 0..corners {
                        input.read_exact(&mut buffer[..item.size()])?;
                        if is_face {
                            polygon.push(u32::try_from(item.whole(&buffer)).map_err(|_| PlyError::Face { face })?);
                        }
                    }
                    for k in 2..polygon.len() {
                        mesh.faces.push([polygon[0], polygon[k - 1], polygon[k]]);
                    }
                }
            }
        }
    }
    Ok(())
}

struct Header {
    format: Format,
    elements: Vec<Element>,
    /// Lines up to and with `end_header`.
    lines: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Format {
    Ascii,
    Binary,
}

struct Element {
    name: String,
    count: usize,
    line: usize,
    properties: Vec<Property>,
}

struct Property {
    name: String,
    kind: Kind,
    line: usize,
}

#[derive(Clone, Copy)]
enum Kind {
    Scalar(Scalar),
    List(Scalar, Scalar),
}

#[derive(Clone, Copy, PartialEq)]
enum Scalar {
    Int(usize),
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "uchar" | "int8" | "uint8" => Self::Int(1),
            "short" | "ushort" | "int16" | "uint16" => Self::Int(2),
            "int" | "uint" | "int32" | "uint32" => Self::Int(4),
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::Int(size) => size,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The value as a whole number; floats give zero (no label, no index, no count is a float).
    fn whole(self, bytes: &[u8]) -> u64 {
        match self {
            Self::Int(size) => bytes[..size].iter().rev().fold(0, |sum, b| sum << 8 | u64::from(*b)),
            Self::F32 | Self::F64 => 0,
        }
    }
}

impl Header {
    fn read(input: &mut impl BufRead) -> Result<Self, PlyError> {
        let mut elements: Vec<Element> = Vec::new();
        let mut format = None;
        for line in 1..=200 {
            let mut bytes = Vec::new();
            input.by_ref().take(1000).read_until(b'\n', &mut bytes)?;
            let text = std::str::from_utf8(&bytes)
                .map_err(|_| if line == 1 { PlyError::NotPly } else { PlyError::Header { line } })?;
            let words: Vec<&str> = text.split_whitespace().collect();
            if line == 1 {
                if words != ["ply"] {
                    return Err(PlyError::NotPly);
                }
                continue;
            }
            let bad = PlyError::Header { line };
            match words.as_slice() {
                ["comment" | "obj_info", ..] => {}
                ["format", "binary_little_endian", "1.0"] => format = Some(Format::Binary),
                ["format", "ascii", "1.0"] => format = Some(Format::Ascii),
                ["format", ..] => return Err(PlyError::Format),
                ["element", name, count] => {
                    let count: u64 = count.parse().map_err(|_| bad)?;
                    if count > u64::from(u32::MAX) {
                        return Err(PlyError::TooMany(count));
                    }
                    elements.push(Element {
                        name: (*name).into(),
                        count: count as usize,
                        line,
                        properties: Vec::new(),
                    });
                }
                ["property", "list", count, item, name] => {
                    let (Some(count), Some(item)) = (Scalar::parse(count), Scalar::parse(item)) else {
                        return Err(bad);
                    };
                    let kind = Kind::List(count, item);
                    elements.last_mut().ok_or(bad)?.properties.push(Property { name: (*name).into(), kind, line });
                }
                ["property", scalar, name] => {
                    let kind = Kind::Scalar(Scalar::parse(scalar).ok_or(PlyError::Header { line })?);
                    elements.last_mut().ok_or(bad)?.properties.push(Property { name: (*name).into(), kind, line });
                }
                ["end_header"] => {
                    let format = format.ok_or(PlyError::Format)?;
                    return Ok(Self { format, elements, lines: line });
                }
                _ => return Err(bad),
            }
        }
        Err(PlyError::Header { line: 200 })
    }
}
