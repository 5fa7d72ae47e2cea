//! What a robot keeps of a building: scene graph, mesh, and the map, in one folder; and how it begins with it another day.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;

use anyhow::{Context, Result, bail};
use dsg::{SceneGraph, folder};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use volumetric_map::Volume;

use crate::localisation::{Looks, Lost};
use crate::map_frame::MapFrame;
use crate::mission::Mission;
use crate::world_model::WorldModel;

/// File names besides those of the scene graph.
const MAP_FILE: &str = "map.bin";
const MAP_INFO_FILE: &str = "map.json";

/// What `map.bin` cannot say of itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct MapInfo {
    version: u32,
    floor_m: f64,
    labels: BTreeMap<u16, String>,
}

/// A building known from another day.
#[derive(Debug, Clone)]
pub struct Known {
    /// The five layers.
    pub graph: SceneGraph,
    /// Surface and free space.
    pub volume: Volume,
    /// Names of the volume's labels.
    pub labels: BTreeMap<u16, String>,
    /// Height of the floor.
    pub floor_m: f64,
    /// Where the robot is put into it; `None` if it has to find that out.
    pub start: Option<Isometry3<f64>>,
}

/// Writes graph, mesh and map into `folder`, which exists.
///
/// # Errors
/// What the disk says.
pub fn save(world: &WorldModel, into: &Path) -> Result<()> {
    let mesh = world.volume.mesh();
    let mut ply = Vec::new();
    world.volume.write_mesh_ply(&mut ply).context("writing the mesh")?;
    let mesh = folder::MeshPly { bytes: &ply, vertices: mesh.vertices.len() as u64, faces: mesh.faces.len() as u64 };
    folder::save(into, &world.graph, Some(&mesh))
        .with_context(|| format!("writing the scene graph into {}", into.display()))?;
    let path = into.join(MAP_FILE);
    let file = File::create(&path).with_context(|| format!("creating {}", path.display()))?;
    let mut out = BufWriter::new(file);
    world.volume.save(&mut out).and_then(|()| out.flush()).with_context(|| format!("writing {}", path.display()))?;
    let info = MapInfo { version: 1, floor_m: world.floor_m, labels: world.label_names() };
    let path = into.join(MAP_INFO_FILE);
    std::fs::write(&path, serde_json::to_vec_pretty(&info)?).with_context(|| format!("writing {}", path.display()))
}

/// Reads what [`save`] wrote. The robot's start pose in it, if it is known, is set by the caller.
///
/// # Errors
/// A missing, broken or newer file, with its name.
pub fn load(from: &Path) -> Result<Known> {
    let loaded = folder::load(from).with_context(|| format!("reading the scene graph in {}", from.display()))?;
    let path = from.join(MAP_INFO_FILE);
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("reading {} (--known takes the folder of an earlier run)", path.display()))?;
    let info: MapInfo = serde_json::from_str(&text).with_context(|| format!("reading {}", path.display()))?;
    if info.version != 1 {
        bail!("{} has version {}; this program reads version 1", path.display(), info.version);
    }
    if !info.floor_m.is_finite() {
        bail!("{}: floor_m is not a finite number", path.display());
    }
    let path = from.join(MAP_FILE);
    let file = File::open(&path).with_context(|| format!("opening {}", path.display()))?;
    let volume = Volume::load(BufReader::new(file)).with_context(|| format!("reading {}", path.display()))?;
    Ok(Known { graph: loaded.graph, volume, labels: info.labels, floor_m: info.floor_m, start: None })
}

impl Mission {
    /// Begins with what is known of the building; without a start pose the robot has to find out where in it it stands. Call
    /// before the first event.
    pub fn know(&mut self, known: Known) {
        if known.start.is_some() {
            self.world.know(known, MapFrame::default());
        } else {
            self.world.looks = Some(Looks::default());
            self.lost = Some(Box::new(Lost::new(known)));
        }
    }
}
