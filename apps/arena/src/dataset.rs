//! Many recordings, each in a building of its own, split by building into train, val and test, with an index.
//!
//! A folder is filled recording by recording; one that is whole is kept, so that a dataset that was interrupted goes on where
//! it stopped, and the same number and seed give the same bytes.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result, bail, ensure};
use mission::robot_model::{RobotKind, RobotModel};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::cli::word;
use crate::record::{RECORDING_MARK, RecordConfig, RecordProgress, record};
use crate::run_folder::RunFolder;
use crate::scenario::Scene;
use crate::whole_file::write_whole;

/// The index of a dataset.
pub const INDEX: &str = "index.json";
/// Version of the index.
const VERSION: u32 = 1;

/// Part of a dataset. A building belongs to one part only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Split {
    /// To learn from.
    Train,
    /// To choose with.
    Val,
    /// To measure with.
    Test,
}

impl Split {
    /// The name in folders and the index.
    pub fn name(self) -> &'static str {
        match self {
            Split::Train => "train",
            Split::Val => "val",
            Split::Test => "test",
        }
    }
}

/// One recording that is to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// Part.
    pub split: Split,
    /// Seed of the building.
    pub building: u64,
    /// Robot.
    pub robot: RobotKind,
    /// Seed of start pose, noise and tasks.
    pub seed: u64,
}

impl Entry {
    /// Folder within the dataset.
    pub fn folder(&self, number: usize) -> String {
        format!("{}/{number:04}-{}-{}", self.split.name(), word(self.robot), self.building)
    }
}

/// Draws `count` recordings. Of five, three are of a walking robot and two of a flying one; every building occurs once; of ten, seven
/// are for training, one or two for choosing, two or one for measuring (small sets have at least one to measure with).
pub fn draw_dataset(count: usize, seed: u64) -> Vec<Entry> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x6461_7461);
    let mut entries: Vec<Entry> = Vec::with_capacity(count);
    while entries.len() < count {
        let number = entries.len();
        let building = u64::from(rng.random::<u32>());
        let recording_seed = u64::from(rng.random::<u32>());
        if entries.iter().any(|entry| entry.building == building) {
            continue;
        }
        entries.push(Entry {
            // Spread over the whole, so that any beginning of the set has all three in about these shares.
            split: match number % 20 {
                1 | 8 | 15 => Split::Test,
                4 | 11 | 18 => Split::Val,
                _ => Split::Train,
            },
            building,
            robot: if matches!(number % 5, 2 | 4) { RobotKind::Aerial } else { RobotKind::Ground },
            seed: recording_seed,
        });
    }
    entries
}

/// Makes the recordings of a dataset that are not there yet, and writes the index. Returns the index.
///
/// # Errors
/// A folder that is something else, a recording that fails, an interruption by `stop`.
pub fn make_dataset(
    folder: &Path,
    count: usize,
    seed: u64,
    config: &RecordConfig,
    stop: &Arc<AtomicBool>,
    report: &mut dyn FnMut(usize, &Entry, RecordProgress),
) -> Result<Value> {
    ensure!(count > 0, "--dataset takes at least one recording");
    refuse_foreign(folder)?;
    let entries = draw_dataset(count, seed);
    let mut described = Vec::new();
    for (number, entry) in entries.iter().enumerate() {
        let name = entry.folder(number);
        let path = folder.join(&name);
        let description = match kept(&path, entry, config)? {
            Some(description) => description,
            None => {
                let robot = match entry.robot {
                    RobotKind::Ground => RobotModel::builtin_quadruped(),
                    RobotKind::Aerial => RobotModel::builtin_quadrotor(),
                };
                let scene = Scene::drawn(entry.building, &robot)?;
                let staged = RunFolder::marked(&path, RECORDING_MARK, "recording")?;
                let description = record(config, &robot, &scene, entry.seed, &staged, stop, &mut |progress| {
                    report(number, entry, progress);
                })
                .with_context(|| format!("recording {name}"))?;
                staged.publish()?;
                description
            }
        };
        described.push((name, entry.split, description));
        // After each, so that what is there is always described.
        let index = serde_json::to_vec_pretty(&index_json(seed, count, &described))?;
        write_whole(&folder.join(INDEX), |out| out.write_all(&index))?;
    }
    Ok(index_json(seed, count, &described))
}

/// A recording of an earlier run that is the one wanted.
fn kept(path: &Path, entry: &Entry, config: &RecordConfig) -> Result<Option<Value>> {
    let mark = path.join(RECORDING_MARK);
    let Ok(text) = fs::read_to_string(&mark) else { return Ok(None) };
    let description: Value = serde_json::from_str(&text)
        .with_context(|| format!("reading {}, which an earlier run left", mark.display()))?;
    let lidar = if config.simulation.is_lidar_fixed { "fixed" } else { "rotating" };
    let duration_s = description["duration_s"].as_f64().unwrap_or(f64::NAN);
    let is_cut = description["is_cut"] == json!(true);
    // As long as it would be made now: whole and not too long, or cut there.
    let has_length = match config.max_time_s {
        Some(max_s) if is_cut => (duration_s - max_s).abs() < 0.2,
        Some(max_s) => duration_s <= max_s,
        None => !is_cut,
    };
    let is_same = description["seed"] == json!(entry.seed)
        && description["scene"] == json!(entry.building.to_string())
        && description["lidar"] == json!(lidar)
        && has_length;
    Ok(is_same.then_some(description))
}

fn refuse_foreign(folder: &Path) -> Result<()> {
    let is_empty = match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(_) if !folder.exists() => true,
        Err(error) => return Err(error).with_context(|| format!("reading {}", folder.display())),
    };
    if !is_empty && !folder.join(INDEX).is_file() {
        bail!(
            "{} exists and is no dataset (it has no {INDEX}); choose another --out, nothing was changed",
            folder.display()
        );
    }
    fs::create_dir_all(folder).with_context(|| format!("creating {}", folder.display()))
}

fn index_json(seed: u64, count: usize, described: &[(String, Split, Value)]) -> Value {
    let recordings: Vec<Value> = described
        .iter()
        .map(|(name, split, description)| {
            let keys = [
                "scene",
                "seed",
                "robot",
                "lidar",
                "duration_s",
                "path_m",
                "rooms",
                "objects",
                "scans",
                "panoramas",
                "tasks",
                "touches",
            ];
            let mut entry = json!({"folder": name, "split": split.name()});
            keys.iter().for_each(|key| entry[*key] = description[*key].clone());
            entry
        })
        .collect();
    let splits: serde_json::Map<String, Value> = [Split::Train, Split::Val, Split::Test]
        .into_iter()
        .map(|part| {
            let names: Vec<&str> =
                described.iter().filter(|(_, split, _)| *split == part).map(|(name, _, _)| name.as_str()).collect();
            (part.name().to_owned(), json!(names))
        })
        .collect();
    json!({
        "format": "omnivln-dataset", "version": VERSION, "seed": seed, "wanted": count,
        "recordings": recordings, "splits": splits,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_building_is_in_two_parts_and_a_longer_set_begins_like_a_shorter_one() {
        let entries = draw_dataset(200, 1);
        let mut buildings: Vec<u64> = entries.iter().map(|entry| entry.building).collect();
        buildings.sort_unstable();
        buildings.dedup();
        assert_eq!(buildings.len(), 200);
        let share = |split| entries.iter().filter(|entry| entry.split == split).count();
        assert_eq!((share(Split::Train), share(Split::Val), share(Split::Test)), (140, 30, 30));
        assert_eq!(entries.iter().filter(|entry| entry.robot == RobotKind::Aerial).count(), 80);
        assert_eq!(draw_dataset(7, 1), entries[..7]);
        assert_ne!(draw_dataset(7, 2), entries[..7]);
    }
}
