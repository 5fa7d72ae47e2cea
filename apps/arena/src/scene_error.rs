//! Why a scene of somebody else's was not read.

use omni_sim::imported::ImportError;
use thiserror::Error;

/// What is wrong in a scene's file. Places are lines of an OBJ (from 1) and elements of a glTF (`accessors[3]`).
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file or one that it names cannot be opened.
    #[error("{name} cannot be opened: {source}")]
    Open {
        /// As the scene names it.
        name: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is longer than is read.
    #[error("{name} has {bytes} bytes; at most {most} are read")]
    TooLong {
        /// As the scene names it.
        name: String,
        /// Its length.
        bytes: u64,
        /// The limit.
        most: u64,
    },
    /// A line of an OBJ.
    #[error("line {line}: \"{text}\" is no {wanted}")]
    Line {
        /// From 1.
        line: usize,
        /// Its beginning.
        text: String,
        /// What would be accepted.
        wanted: &'static str,
    },
    /// An element of a glTF.
    #[error("{place}: {wanted} is accepted here")]
    Element {
        /// For example `accessors[3]`.
        place: String,
        /// What would be accepted.
        wanted: &'static str,
    },
    /// The file is no JSON, or a GLB that is cut off.
    #[error("no glTF: {0}")]
    NoGltf(String),
    /// More triangles than are read.
    #[error("the scene has more than {0} triangles")]
    TooMany(usize),
    /// Meshes were read and are no building.
    #[error(transparent)]
    NoBuilding(#[from] ImportError),
}

/// Most triangles of a scene.
pub const MOST_TRIANGLES: usize = 4_000_000;
/// Longest file, bytes.
pub const MOST_BYTES: u64 = 1 << 29;
