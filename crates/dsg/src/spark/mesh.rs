//! The mesh of a spark_dsg file.

use std::io::{self, Write};

use serde::{Deserialize, Serialize, Serializer};

use crate::load::{JsonPath, LoadError};
use crate::mesh::Mesh;
use crate::scan::Document;

/// As it stands in the file; what is null is empty.
#[derive(Debug, Default, Deserialize)]
struct Record {
    #[serde(default)]
    points: Option<Vec<[f32; 3]>>,
    #[serde(default)]
    colors: Option<Vec<Color>>,
    #[serde(default)]
    labels: Option<Vec<u32>>,
    #[serde(default)]
    stamps: Option<Vec<u64>>,
    #[serde(default)]
    first_seen_stamps: Option<Vec<u64>>,
    #[serde(default)]
    faces: Option<Vec<[u32; 3]>>,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Color {
    r: u8,
    g: u8,
    b: u8,
    a: u8,
}

/// The mesh of a document, `None` if there is none or it has no vertex.
pub(crate) fn read(document: &Document) -> Result<Option<Mesh>, LoadError> {
    let Some(text) = document.field("mesh").filter(|text| *text != b"null") else {
        return Ok(None);
    };
    let wrong = |expected| LoadError::Type { path: JsonPath("$.mesh".into()), expected };
    // The parser's own place within the mesh would be lost in a path: it is told in the file's lines.
    let record: Record = serde_json::from_slice(text).map_err(|error| {
        let (line, column) = document.position(text, &error);
        LoadError::Mesh { line, column }
    })?;
    let points = record.points.unwrap_or_default();
    let count = points.len();
    let colors: Vec<Color> = record.colors.unwrap_or_default();
    let mesh = Mesh {
        colors: colors.into_iter().map(|c| [c.r, c.g, c.b, c.a]).collect(),
        labels: record.labels.unwrap_or_default(),
        stamps: record.stamps.unwrap_or_default(),
        first_seen_stamps: record.first_seen_stamps.unwrap_or_default(),
        faces: record.faces.unwrap_or_default(),
        points,
    };
    let lengths = [mesh.colors.len(), mesh.labels.len(), mesh.stamps.len(), mesh.first_seen_stamps.len()];
    if lengths.iter().any(|length| *length != 0 && *length != count) {
        return Err(wrong("a mesh with as many colours, labels and stamps as points"));
    }
    if mesh.faces.iter().flatten().any(|corner| *corner as usize >= count) {
        return Err(wrong("a mesh whose faces name vertices that it has"));
    }
    Ok((count > 0).then_some(mesh))
}

/// Writes the mesh as they do.
pub(crate) fn write(mesh: &Mesh, out: &mut impl Write) -> io::Result<()> {
    let colors: Vec<Color> = mesh.colors.iter().map(|&[r, g, b, a]| Color { r, g, b, a }).collect();
    #[derive(Serialize)]
    struct Written<'m> {
        header: serde_json::Value,
        has_colors: bool,
        has_timestamps: bool,
        has_labels: bool,
        has_first_seen_stamps: bool,
        points: Points<'m>,
        #[serde(skip_serializing_if = "Vec::is_empty")]
        colors: Vec<Color>,
        #[serde(skip_serializing_if = "<[u64]>::is_empty")]
        stamps: &'m [u64],
        #[serde(skip_serializing_if = "<[u32]>::is_empty")]
        labels: &'m [u32],
        #[serde(skip_serializing_if = "<[u64]>::is_empty")]
        first_seen_stamps: &'m [u64],
        faces: &'m [[u32; 3]],
    }
    let written = Written {
        // Without its own header their reader takes the mesh for an empty one.
        header: crate::spark::attributes::empty_mesh()["header"].clone(),
        has_colors: !mesh.colors.is_empty(),
        has_timestamps: !mesh.stamps.is_empty(),
        has_labels: !mesh.labels.is_empty(),
        has_first_seen_stamps: !mesh.first_seen_stamps.is_empty(),
        points: Points(&mesh.points),
        colors,
        stamps: &mesh.stamps,
        labels: &mesh.labels,
        first_seen_stamps: &mesh.first_seen_stamps,
        faces: &mesh.faces,
    };
    serde_json::to_writer(out, &written).map_err(io::Error::from)
}

/// Vertices; the shortest digits of a single-precision number.
struct Points<'m>(&'m [[f32; 3]]);

impl Serialize for Points<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0)
    }
}
