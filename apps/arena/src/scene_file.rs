//! A scene of somebody else's, from a file: OBJ with its material library, glTF with its buffers, GLB.

use std::fs;
use std::io::Read;
use std::path::Path;

use omni_sim::building::Building;
use omni_sim::imported::{NamedMesh, RESOLUTION_M, assemble};

use crate::plan_file::cut_rooms;
use crate::scene_error::{MOST_BYTES, SceneError};
use crate::scene_gltf::read_gltf;
use crate::scene_obj::read_obj;

/// Reads a building; the ending of the name says what the file is.
///
/// # Errors
/// What is wrong, and where.
pub fn read_scene(path: &Path) -> Result<Building, SceneError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    // Only what lies in the scene's folder or below is opened: a scene is a stranger's.
    let open = |name: &str| {
        let is_below = Path::new(name).components().all(|part| matches!(part, std::path::Component::Normal(_)));
        let refused = || std::io::Error::new(std::io::ErrorKind::InvalidInput, "only files beside the scene are read");
        if is_below {
            bytes_of(&folder.join(name), name)
        } else {
            Err(SceneError::Open { name: name.into(), source: refused() })
        }
    };
    let bytes = bytes_of(path, &path.display().to_string())?;
    let is_obj = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"));
    let meshes = if is_obj { read_obj(&bytes, &open)? } else { read_gltf(&bytes, &open)? };
    building_of(&meshes)
}

/// A building of named meshes, its rooms cut as `omnivln rooms` cuts a plan where no volumes say which there are.
///
/// # Errors
/// If the meshes are no building.
pub fn building_of(meshes: &[NamedMesh]) -> Result<Building, SceneError> {
    // The cells of a scene are as large as the pixels of a plan; the cut's own configuration makes sense.
    const { assert!(RESOLUTION_M == crate::plan_file::RESOLUTION_M) };
    Ok(assemble(meshes, |free, width, height| cut_rooms(free, width, height).unwrap_or_else(|_| vec![0; free.len()]))?)
}

fn bytes_of(path: &Path, name: &str) -> Result<Vec<u8>, SceneError> {
    let failed = |source: std::io::Error| SceneError::Open { name: name.to_owned(), source };
    let file = fs::File::open(path).map_err(failed)?;
    let bytes = file.metadata().map_err(failed)?.len();
    if bytes > MOST_BYTES {
        return Err(SceneError::TooLong { name: name.to_owned(), bytes, most: MOST_BYTES });
    }
    let mut content = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut content).map_err(failed)?;
    Ok(content)
}
