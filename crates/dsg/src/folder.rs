//! A scene graph on disk: graph.json, mesh.ply and ops.log in a folder, written so that a crash leaves the old or the new one.
//!
//! Each file is written under a temporary name in the same folder, synced and renamed; the folder is synced after. The mesh
//! comes first and the previous one is kept as mesh.prev.ply until graph.json, which names the mesh by its SHA-256, has
//! been replaced: graph.json is the commit point. After a crash the graph and its mesh are those of one save; the history may be
//! missing, it is never that of another graph. A graph may also be a single file `name.json`, with `name.mesh.ply` and
//! `name.ops.log` beside it.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::faults::Faults;
use crate::file::{MeshReference, read_document, write_document};
use crate::graph::SceneGraph;
use crate::load::{LoadError, MAX_BYTES};
use crate::oplog::{log_to_lines, read_log};

/// The graph.
pub const GRAPH_FILE: &str = "graph.json";
/// The mesh of the graph on disk.
pub const MESH_FILE: &str = "mesh.ply";
/// The mesh of the graph before, while a save is under way.
pub const PREVIOUS_MESH_FILE: &str = "mesh.prev.ply";
/// The recent events.
pub const LOG_FILE: &str = "ops.log";

/// A mesh to save: opaque bytes with what graph.json says about them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshPly<'a> {
    /// The PLY file.
    pub bytes: &'a [u8],
    /// Number of vertices in it.
    pub vertices: u64,
    /// Number of faces in it.
    pub faces: u64,
}

/// What a folder holds.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The graph, with the log of ops.log.
    pub graph: SceneGraph,
    /// The bytes of the mesh that graph.json names, checked.
    pub mesh: Option<Vec<u8>>,
}

/// The files of one graph.
#[derive(Debug, Clone)]
pub(crate) struct Files {
    pub graph: PathBuf,
    mesh: PathBuf,
    previous_mesh: PathBuf,
    log: PathBuf,
}

impl Files {
    /// In a folder of their own.
    pub fn in_folder(dir: &Path) -> Files {
        Files {
            graph: dir.join(GRAPH_FILE),
            mesh: dir.join(MESH_FILE),
            previous_mesh: dir.join(PREVIOUS_MESH_FILE),
            log: dir.join(LOG_FILE),
        }
    }

    /// Beside `name.json`. A file called graph.json is one of a folder.
    pub fn beside(graph: &Path) -> Files {
        if graph.file_name().is_some_and(|name| name == GRAPH_FILE) {
            return Files::in_folder(graph.parent().unwrap_or(Path::new("")));
        }
        Files {
            graph: graph.to_owned(),
            mesh: graph.with_extension(MESH_FILE),
            previous_mesh: graph.with_extension(PREVIOUS_MESH_FILE),
            log: graph.with_extension(LOG_FILE),
        }
    }

    /// A folder's, or those beside a file.
    pub fn of(path: &Path) -> Files {
        if path.is_dir() { Files::in_folder(path) } else { Files::beside(path) }
    }
}

/// Saves a graph, and its mesh if there is one, in a folder (made if absent).
///
/// # Errors
/// [`LoadError::Io`] with the file; the previous graph is then still there and whole.
pub fn save(dir: &Path, graph: &SceneGraph, mesh: Option<&MeshPly>) -> Result<(), LoadError> {
    fs::create_dir_all(dir).map_err(|source| io_error(dir, source))?;
    save_as(&Files::in_folder(dir), graph, mesh)
}

/// Saves a graph as one file `name.json`, its mesh and its log beside it.
///
/// # Errors
/// As [`save`].
pub fn save_file(path: &Path, graph: &SceneGraph, mesh: Option<&MeshPly>) -> Result<(), LoadError> {
    save_as(&Files::beside(path), graph, mesh)
}

fn save_as(files: &Files, graph: &SceneGraph, mesh: Option<&MeshPly>) -> Result<(), LoadError> {
    settle(files)?;
    let reference = match mesh {
        Some(mesh) => {
            let sha256 = hex(&Sha256::digest(mesh.bytes));
            if files.mesh.exists() {
                rename(&files.mesh, &files.previous_mesh)?;
            }
            write_atomically(&files.mesh, |file| file.write_all(mesh.bytes))?;
            let name = files.mesh.file_name().map(|name| name.to_string_lossy().into_owned());
            let (vertices, faces) = (mesh.vertices, mesh.faces);
            Some(MeshReference { file: name.unwrap_or_else(|| MESH_FILE.to_owned()), sha256, vertices, faces })
        }
        None => None,
    };
    // An old log beside a new graph would be another's history; no log is always right.
    remove_if_there(&files.log)?;
    write_atomically(&files.graph, |file| write_document(graph, reference.as_ref(), file))?;
    write_atomically(&files.log, |file| file.write_all(&log_to_lines(graph)))?;
    remove_if_there(&files.previous_mesh)?;
    if mesh.is_none() {
        remove_if_there(&files.mesh)?;
    }
    Ok(())
}

/// After a save that was cut short there are two meshes: the one that graph.json names stays.
fn settle(files: &Files) -> Result<(), LoadError> {
    if !files.previous_mesh.exists() {
        return Ok(());
    }
    let named = fs::read(&files.graph).ok().and_then(|bytes| crate::file::named_mesh(&bytes));
    let previous = read(&files.previous_mesh)?;
    if named.is_some_and(|named| named.sha256.eq_ignore_ascii_case(&hex(&Sha256::digest(&previous)))) {
        rename(&files.previous_mesh, &files.mesh)
    } else {
        remove_if_there(&files.previous_mesh)
    }
}

/// Loads a folder.
///
/// # Errors
/// What [`crate::graph_from_json`] reports of graph.json, a damaged ops.log, a missing mesh or one with another checksum.
pub fn load(dir: &Path) -> Result<Loaded, LoadError> {
    let files = Files::in_folder(dir);
    load_from(&files, &read(&files.graph)?, &mut Faults::fatal())
}

/// The graph in the bytes of `files.graph`, with what lies beside it.
pub(crate) fn load_from(files: &Files, bytes: &[u8], faults: &mut Faults) -> Result<Loaded, LoadError> {
    let (mut graph, reference) = read_document(bytes, faults)?;
    if files.log.exists() {
        read(&files.log).and_then(|log| read_log(&mut graph, &log)).or_else(|fault| faults.note(fault))?;
    }
    let mesh = match reference.map(|reference| load_mesh(files, &reference)).transpose() {
        Ok(mesh) => mesh,
        Err(fault) => faults.instead(fault)?,
    };
    Ok(Loaded { graph, mesh })
}

/// The mesh with the right checksum: under its name, or, after a crash in mid-save, under the previous one.
fn load_mesh(files: &Files, reference: &MeshReference) -> Result<Vec<u8>, LoadError> {
    let path = files.graph.with_file_name(&reference.file);
    let mut is_there = false;
    for candidate in [&path, &files.previous_mesh] {
        if candidate.exists() {
            is_there = true;
            let bytes = read(candidate)?;
            if hex(&Sha256::digest(&bytes)) == reference.sha256.to_ascii_lowercase() {
                return Ok(bytes);
            }
        }
    }
    Err(if is_there { LoadError::MeshHash { path } } else { LoadError::MeshMissing { path } })
}

pub(crate) fn read(path: &Path) -> Result<Vec<u8>, LoadError> {
    let size = fs::metadata(path).map_err(|source| io_error(path, source))?.len();
    let bytes = usize::try_from(size).unwrap_or(usize::MAX);
    if bytes > MAX_BYTES {
        return Err(LoadError::TooLarge { bytes });
    }
    fs::read(path).map_err(|source| io_error(path, source))
}

/// Writes beside, syncs, renames, syncs the folder.
pub(crate) fn write_atomically(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), LoadError> {
    let temporary = path.with_extension("tmp");
    let result = File::create(&temporary).and_then(|mut file| {
        write(&mut file)?;
        file.sync_all()
    });
    if let Err(source) = result {
        // Best effort: the error that matters is the first.
        let _ = fs::remove_file(&temporary);
        return Err(io_error(&temporary, source));
    }
    rename(&temporary, path)
}

fn rename(from: &Path, to: &Path) -> Result<(), LoadError> {
    fs::rename(from, to).map_err(|source| io_error(to, source))?;
    sync_folder_of(to)
}

fn remove_if_there(path: &Path) -> Result<(), LoadError> {
    match fs::remove_file(path) {
        Ok(()) => sync_folder_of(path),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(source) => Err(io_error(path, source)),
    }
}

fn sync_folder_of(path: &Path) -> Result<(), LoadError> {
    let Some(dir) = path.parent() else {
        return Ok(());
    };
    // Only Unix can open a folder to sync it.
    #[cfg(unix)]
    File::open(if dir.as_os_str().is_empty() { Path::new(".") } else { dir })
        .and_then(|folder| folder.sync_all())
        .map_err(|source| io_error(dir, source))?;
    #[cfg(not(unix))]
    let _ = dir;
    Ok(())
}

pub(crate) fn io_error(path: &Path, source: io::Error) -> LoadError {
    LoadError::Io { path: PathBuf::from(path), source }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
