//! Any file of a scene graph: ours or that of spark_dsg, a folder or a single file, whole or damaged.

use std::path::Path;

use crate::faults::Faults;
use crate::folder::{Files, Loaded, MeshPly, io_error, load_from, read, save, save_file, write_atomically};
use crate::graph::SceneGraph;
use crate::load::LoadError;
use crate::mesh::Mesh;
use crate::scan::Document;
use crate::spark;

/// The formats that are read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Ours: graph.json, mesh.ply, ops.log.
    Omni,
    /// JSON of spark_dsg.
    SparkDsg,
}

/// A graph from a file.
#[derive(Debug, Clone)]
pub struct Opened {
    /// The graph.
    pub graph: SceneGraph,
    /// The PLY file beside it, or made of the mesh in it.
    pub mesh: Option<Vec<u8>>,
    /// What it was.
    pub format: Format,
    /// Nodes, as the format counts them: objects, places, rooms, buildings, groups, poses of robots.
    pub nodes: usize,
    /// Edges, as the format counts them: between the nodes of a layer, and to the parents.
    pub edges: usize,
}

/// What could be saved of a damaged file.
#[derive(Debug)]
pub struct Salvaged {
    /// The graph without what is broken.
    pub opened: Opened,
    /// What is broken, in the order of the file; the first thousand.
    pub faults: Vec<LoadError>,
    /// How many faults there are.
    pub fault_count: usize,
}

/// Opens a folder or a file of either format.
///
/// # Errors
/// The first fault, with the place.
pub fn open(path: &Path) -> Result<Opened, LoadError> {
    open_with(path, &mut Faults::fatal())
}

/// Opens a damaged file: a fault costs the record it is in, and references to what is not there.
///
/// # Errors
/// A file that cannot be read at all: not there, of another kind, of a newer version.
pub fn salvage(path: &Path) -> Result<Salvaged, LoadError> {
    let mut faults = Faults::salvage();
    let opened = open_with(path, &mut faults)?;
    Ok(Salvaged { opened, fault_count: faults.count, faults: faults.found })
}

fn open_with(path: &Path, faults: &mut Faults) -> Result<Opened, LoadError> {
    let files = Files::of(path);
    let bytes = read(&files.graph)?;
    let (document, fault) = Document::scan(&bytes);
    if !spark::is_spark(&document) {
        drop(document);
        let Loaded { graph, mesh } = load_from(&files, &bytes, faults)?;
        return Ok(Opened::new(graph, mesh));
    }
    fault.map_or(Ok(()), |fault| faults.note(fault))?;
    let graph = spark::read_document(&document, None, faults)?;
    let mesh = match spark::mesh::read(&document) {
        Ok(mesh) => mesh,
        Err(fault) => faults.instead(fault)?,
    };
    let mesh = mesh.map(|mesh| {
        let mut ply = Vec::new();
        mesh.write_ply(&mut ply).expect("memory takes all bytes");
        ply
    });
    let count = |list| document.items(list).map_or(0, <[_]>::len);
    Ok(Opened { graph, mesh, format: Format::SparkDsg, nodes: count("nodes"), edges: count("edges") })
}

impl Opened {
    /// A graph of ours, with the PLY file of its mesh.
    pub fn new(graph: SceneGraph, mesh: Option<Vec<u8>>) -> Opened {
        let nodes = graph.node_count() + graph.groups().count();
        let edges = graph.edge_count();
        Opened { graph, mesh, format: Format::Omni, nodes, edges }
    }

    /// Writes the graph: ours as a folder, or beside `path` if that ends in `.json`; spark_dsg as one file.
    ///
    /// # Errors
    /// What the disk says, or a mesh that is no PLY file.
    pub fn save(&self, path: &Path, format: Format) -> Result<(), LoadError> {
        let mesh = self.mesh()?;
        match format {
            Format::Omni => {
                let ply = self.mesh.as_ref().zip(mesh.as_ref()).map(|(bytes, mesh)| MeshPly {
                    bytes,
                    vertices: mesh.points.len() as u64,
                    faces: mesh.faces.len() as u64,
                });
                let is_file = path.extension().is_some_and(|extension| extension == "json") && !path.is_dir();
                let save = if is_file { save_file } else { save };
                save(path, &self.graph, ply.as_ref())
            }
            Format::SparkDsg => {
                if path.is_dir() {
                    let source =
                        std::io::Error::new(std::io::ErrorKind::IsADirectory, "a folder; spark_dsg wants a file name");
                    return Err(io_error(path, source));
                }
                write_atomically(path, |file| {
                    let mut out = std::io::BufWriter::new(file);
                    spark::write_spark_dsg(&self.graph, mesh.as_ref(), &mut out)?;
                    std::io::Write::flush(&mut out)
                })
            }
        }
    }

    /// The mesh, read.
    ///
    /// # Errors
    /// If the bytes are no PLY file that is read here.
    pub fn mesh(&self) -> Result<Option<Mesh>, LoadError> {
        let read = |bytes: &Vec<u8>| {
            Mesh::from_ply(bytes).map_err(|source| LoadError::MeshFile { path: "mesh.ply".into(), source })
        };
        self.mesh.as_ref().map(read).transpose()
    }
}
