//! The door of the world: what a mesh and a mover must be.

use crate::mesh::{InstanceId, Mover, TriangleMesh};
use nalgebra::Isometry3;
use thiserror::Error;

/// Why a world could not be made.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum WorldError {
    /// `instances` or `colors` of a mesh has not one entry per face.
    #[error("a mesh has {faces} faces but {entries} instances or colours")]
    LengthsDiffer {
        /// Number of faces.
        faces: usize,
        /// Number of entries of the shorter or longer list.
        entries: usize,
    },
    /// A face names a vertex that is not there.
    #[error("face {face} names a vertex beyond the end")]
    VertexIndex {
        /// Index of the face.
        face: usize,
    },
    /// A vertex or a mover's pose is NaN or infinite.
    #[error("a vertex or a pose is not finite")]
    NotFinite,
    /// A mover without a pose, or with stamps that do not grow.
    #[error("the path of mover {instance} is empty or out of order")]
    MoverPath {
        /// Instance of the mover.
        instance: InstanceId,
    },
    /// Two entries describe the same instance.
    #[error("instance {instance} is described twice")]
    DescribedTwice {
        /// The instance.
        instance: InstanceId,
    },
    /// More than 2^31 triangles.
    #[error("too many triangles")]
    TooLarge,
}

/// Lengths, indices and numbers of a mesh.
pub fn check_mesh(mesh: &TriangleMesh) -> Result<(), WorldError> {
    let faces = mesh.faces.len();
    for entries in [mesh.instances.len(), mesh.colors.len()] {
        if entries != faces {
            return Err(WorldError::LengthsDiffer { faces, entries });
        }
    }
    let count = mesh.vertices.len() as u32;
    if let Some(face) = mesh.faces.iter().position(|f| f.iter().any(|&i| i >= count)) {
        return Err(WorldError::VertexIndex { face });
    }
    if !mesh.vertices.iter().all(|v| v.iter().all(|x| x.is_finite())) {
        return Err(WorldError::NotFinite);
    }
    Ok(())
}

/// A mover's mesh and path.
pub fn check_mover(mover: &Mover) -> Result<(), WorldError> {
    check_mesh(&mover.mesh)?;
    if mover.path.is_empty() || mover.path.windows(2).any(|w| w[0].0 >= w[1].0) {
        return Err(WorldError::MoverPath { instance: mover.instance });
    }
    let is_finite = |pose: &Isometry3<f64>| pose.to_homogeneous().iter().all(|x| x.is_finite());
    if !mover.path.iter().all(|(_, pose)| is_finite(pose)) {
        return Err(WorldError::NotFinite);
    }
    Ok(())
}
