//! What a robot keeps of a building: scene graph, mesh, and the map, in one folder; and how it begins with it another day.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;

use anyhow::{Context, Result, bail};
use dsg::{Op, SceneGraph, folder};
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
    pub fn know(&mut self, mut known: Known) {
        date_before(&mut known.graph, self.start.0);
        if known.start.is_some() {
            self.world.know(known, MapFrame::default());
        } else {
            self.world.looks = Some(Looks::default());
            self.lost = Some(Box::new(Lost::new(known)));
        }
    }
}

/// What was seen on another day was seen before `start_ns`, whatever that day's clock said: else nothing of it would count as not seen
/// again, and what is gone would never leave. The order of the sightings stays.
fn date_before(graph: &mut SceneGraph, start_ns: i64) {
    let newest_ns = graph.objects().map(|object| object.last_seen_ns).max().unwrap_or(i64::MIN);
    if newest_ns < start_ns {
        return;
    }
    let shift_ns = newest_ns.saturating_sub(start_ns).saturating_add(1);
    let earlier = |stamp_ns: i64| stamp_ns.saturating_sub(shift_ns);
    let dated = graph.objects().cloned().map(|mut object| {
        object.first_seen_ns = earlier(object.first_seen_ns);
        object.last_seen_ns = earlier(object.last_seen_ns);
        for presence in &mut object.presence {
            (presence.first_ns, presence.last_ns) = (earlier(presence.first_ns), earlier(presence.last_ns));
        }
        Op::PutObject(Box::new(object))
    });
    let dated = Op::Batch(dated.collect());
    graph.apply(dated).expect("objects that were valid differ in their dates only");
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsg::{Aabb, AssociationConfig, Object, ObjectId};
    use nalgebra::{Point3, Vector3};

    #[test]
    fn what_is_gone_leaves_the_graph_though_the_survey_ran_longer_than_the_run_has() {
        let mut graph = SceneGraph::new();
        for (id, seen_s) in [(1, 61), (2, 104)] {
            let bounds = Aabb::from_center(Point3::new(id as f64, 0.0, 0.8), Vector3::repeat(0.1));
            let mut object = Object::new(ObjectId(id), "mug", bounds);
            (object.observations, object.confirmed) = (20, true);
            (object.first_seen_ns, object.last_seen_ns) = (30_000_000_000, seen_s * 1_000_000_000);
            graph.apply(Op::PutObject(Box::new(object))).expect("a valid object");
        }
        date_before(&mut graph, 0);
        let seen = |id| graph.object(ObjectId(id)).expect("it stays").last_seen_ns;
        assert_eq!(seen(2) - seen(1), 43_000_000_000);
        assert!(seen(2) < 0);
        let revision = graph.revision();
        date_before(&mut graph, 5);
        assert_eq!(graph.revision(), revision, "what is dated before stays as it is");
        // Half a minute into the run, six images show the place of the first, and look through it.
        let config = AssociationConfig::default();
        for image in 0..i64::from(config.gone_looks) {
            let now_ns = 30_000_000_000 + 500_000_000 * image;
            let looked_through = |object: &Object| (object.id == ObjectId(1)).then_some(true);
            dsg::forget_ghosts(&mut graph, now_ns, &looked_through, &config).expect("a valid configuration");
        }
        assert!(graph.object(ObjectId(1)).is_none() && graph.object(ObjectId(2)).is_some());
    }
}
