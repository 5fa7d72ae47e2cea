//! Which buildings a bench draws from: our own generator, floor plans and scenes of others, or both in turn.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use mission::robot_model::RobotModel;
use omni_sim::building::Building;
use omni_sim::cooccurrence::Cooccurrence;
use omni_sim::plan_image::PlanConfig;

use crate::plan_file::PlanFile;
use crate::scenario::{Scene, needs_of, plan_of_seed};
use crate::scene_file::read_scene;

/// Where the buildings of a bench come from.
#[derive(Debug, Clone, Default)]
pub struct Buildings {
    /// What stands in generated rooms.
    pub cooccurrence: Cooccurrence,
    /// How runs take turns between the generator and the files.
    pub turns: Turns,
    files: Vec<SceneFile>,
}

/// How runs take turns between the generator and the files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Turns {
    /// All buildings are generated.
    #[default]
    Generated,
    /// All come from the files, each in turn.
    Files,
    /// Every second one comes from a file; those with floor plans are furnished as usual, shuffled and uniformly in turn.
    Mixed,
}

/// A file from which buildings are made, read.
#[derive(Debug, Clone)]
pub struct SceneFile {
    path: PathBuf,
    content: Content,
}

#[derive(Debug, Clone)]
enum Content {
    Plan(PlanFile),
    Built(Box<Building>),
}

/// Endings of files that are scenes.
pub const ENDINGS: [&str; 4] = ["png", "obj", "gltf", "glb"];

impl SceneFile {
    /// Whether the name ends as that of a scene does.
    pub fn is_one(path: &Path) -> bool {
        ending(path).is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
    }

    /// Reads a scene.
    ///
    /// # Errors
    /// A sentence that names the file, the place and what would be accepted.
    pub fn read(path: &Path) -> Result<SceneFile> {
        let content = match ending(path).as_deref() {
            Some("png") => Content::Plan(PlanFile::read(path)?),
            Some("obj" | "gltf" | "glb") => {
                let place = || format!("reading the scene {}", path.display());
                Content::Built(Box::new(read_scene(path).with_context(place)?))
            }
            _ => bail!(
                "{} is no scene: floor plans end in .png, scenes with named objects in .obj, .gltf or .glb",
                path.display()
            ),
        };
        Ok(SceneFile { path: path.to_owned(), content })
    }

    /// The building of a seed in it. A scene with named objects is one, whatever the seed; a plan has many: rooms round a drawn one, `rooms` of them or, without a number, 2 to 12.
    ///
    /// # Errors
    /// If the robot can use no two rooms of it.
    pub fn scene(
        &self,
        seed: u64,
        rooms: Option<u32>,
        cooccurrence: Cooccurrence,
        robot: &RobotModel,
    ) -> Result<Scene> {
        let place = || format!("making a building of {}", self.path.display());
        match &self.content {
            Content::Plan(plan) => {
                let (drawn, style) = plan_of_seed(seed);
                let (_, passage_m) = needs_of(robot);
                let config = PlanConfig {
                    seed,
                    rooms: rooms.unwrap_or(drawn),
                    style,
                    min_door_m: narrowest_door_m(robot),
                    passage_m,
                    cooccurrence,
                };
                let building = plan.building(&config).with_context(place)?;
                // With the number of rooms, so that the name alone makes the same building again.
                let name = format!("{}#{seed},{}{}", self.path.display(), config.rooms, suffix(cooccurrence));
                Scene::new(&name, building)
            }
            Content::Built(building) => Scene::new(&self.path.display().to_string(), (**building).clone()),
        }
    }
}

/// Real doors are narrower than those of the generator: the disc the robot sweeps has to fit, as the referee has it, and little more.
fn narrowest_door_m(robot: &RobotModel) -> f64 {
    const SPARE_M: f64 = 0.04;
    (2.0 * robot.circumscribed_radius_m + SPARE_M).clamp(0.6, 2.0)
}

/// What a scene's name ends with.
pub fn suffix(cooccurrence: Cooccurrence) -> &'static str {
    match cooccurrence {
        Cooccurrence::Usual => "",
        Cooccurrence::Shuffled => ",shuffled",
        Cooccurrence::Uniform => ",uniform",
    }
}

fn ending(path: &Path) -> Option<String> {
    path.extension().map(|ending| ending.to_string_lossy().to_lowercase())
}

/// A scene by its name on a command line: `FILE`, `FILE#SEED`, `FILE#SEED,ROOMS,shuffled`; `None` if the name is not that of a file.
///
/// # Errors
/// If the file cannot be read, or the robot can use no two rooms of it.
pub fn scene_of_name(name: &str, robot: &RobotModel) -> Result<Option<Scene>> {
    let (path, choice) = name.split_once('#').unwrap_or((name, "0"));
    if !SceneFile::is_one(Path::new(path)) {
        return Ok(None);
    }
    let (seed, rooms, cooccurrence) = choice_of_name(choice).with_context(|| {
        format!(
            "\"{name}\" names no building: after {path}# comes a number, and after it may come a number of rooms and ,shuffled or ,uniform, as in {path}#7,5,shuffled"
        )
    })?;
    Ok(Some(SceneFile::read(Path::new(path))?.scene(seed, rooms, cooccurrence, robot)?))
}

/// `7`, `7,shuffled` or `7,uniform`.
pub fn seed_of_name(name: &str) -> Option<(u64, Cooccurrence)> {
    match choice_of_name(name)? {
        (seed, None, cooccurrence) => Some((seed, cooccurrence)),
        (_, Some(_), _) => None,
    }
}

/// The same with a number of rooms, from 2 to 30, after the seed: `7,5,shuffled`.
fn choice_of_name(name: &str) -> Option<(u64, Option<u32>, Cooccurrence)> {
    let mut parts = name.split(',').peekable();
    let seed = parts.next()?.parse().ok()?;
    let is_number = |part: &&str| part.starts_with(|c: char| c.is_ascii_digit());
    let rooms = match parts.next_if(is_number) {
        Some(part) => Some(part.parse().ok().filter(|rooms| (2..=30).contains(rooms))?),
        None => None,
    };
    let cooccurrence = match (parts.next(), parts.next()) {
        (None, _) => Cooccurrence::Usual,
        (Some("shuffled"), None) => Cooccurrence::Shuffled,
        (Some("uniform"), None) => Cooccurrence::Uniform,
        _ => return None,
    };
    Some((seed, rooms, cooccurrence))
}

impl Buildings {
    /// With files: folders are searched for scenes (label pictures and furnished copies of plans are none), in the order of
    /// their names.
    ///
    /// # Errors
    /// If something cannot be read, or files are needed and there are none.
    pub fn new(cooccurrence: Cooccurrence, turns: Turns, paths: &[PathBuf]) -> Result<Buildings> {
        let mut files = Vec::new();
        for path in paths {
            if !path.is_dir() {
                files.push(path.clone());
                continue;
            }
            let place = || format!("looking for scenes in {}", path.display());
            let entries: Result<Vec<PathBuf>, std::io::Error> =
                path.read_dir().with_context(place)?.map(|entry| entry.map(|entry| entry.path())).collect();
            let mut found: Vec<PathBuf> = entries
                .with_context(place)?
                .into_iter()
                .filter(|path| SceneFile::is_one(path) && !is_beside(path))
                .collect();
            found.sort();
            ensure!(!found.is_empty(), "{} holds no scene: no .png, .obj, .gltf, .glb", path.display());
            files.extend(found);
        }
        ensure!(turns == Turns::Generated || !files.is_empty(), "buildings from files need --plans");
        let files = files.iter().map(|path| SceneFile::read(path)).collect::<Result<Vec<SceneFile>>>()?;
        Ok(Buildings { cooccurrence, turns, files })
    }

    /// A building for run `index` of a bench, of about so many rooms; `draw` gives seeds.
    ///
    /// # Errors
    /// If the generator finds none or the robot can use no two rooms of the file.
    pub fn draw(&self, index: usize, rooms: u32, robot: &RobotModel, draw: &mut dyn FnMut() -> u64) -> Result<Scene> {
        let file = match self.turns {
            Turns::Generated => None,
            Turns::Files => Some(index),
            Turns::Mixed => (index % 2 == 1).then_some(index / 2),
        };
        let Some(at) = file.filter(|_| !self.files.is_empty()) else {
            let building_seed = std::iter::repeat_with(draw)
                .find(|seed| plan_of_seed(*seed).0 == rooms)
                .context("every eleventh seed has that many rooms")?;
            return Scene::drawn_with(building_seed, self.cooccurrence, robot);
        };
        const ALL: [Cooccurrence; 3] = [Cooccurrence::Usual, Cooccurrence::Shuffled, Cooccurrence::Uniform];
        let cooccurrence = if self.turns == Turns::Mixed { ALL[at % ALL.len()] } else { self.cooccurrence };
        // A plan whose doors are all too narrow for this robot is passed over for the next one.
        let mut first_error = None;
        for k in 0..self.files.len() {
            match self.files[(at + k) % self.files.len()].scene(draw(), Some(rooms), cooccurrence, robot) {
                Ok(scene) => return Ok(scene),
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
        Err(first_error.context("there are files")?)
    }
}

/// Pictures that belong to a plan.
fn is_beside(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    stem.ends_with("_gt_segmentation") || stem.ends_with("_furnitures")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_seed_rooms_and_furniture() {
        assert_eq!(choice_of_name("7"), Some((7, None, Cooccurrence::Usual)));
        assert_eq!(choice_of_name("7,5"), Some((7, Some(5), Cooccurrence::Usual)));
        assert_eq!(choice_of_name("7,5,shuffled"), Some((7, Some(5), Cooccurrence::Shuffled)));
        assert_eq!(seed_of_name("7,uniform"), Some((7, Cooccurrence::Uniform)));
        for wrong in ["", "x", "7,", "7,1", "7,99", "7,5,5", "7,shuffled,5", "7,5,shuffled,x"] {
            assert_eq!(choice_of_name(wrong), None, "{wrong}");
        }
        assert_eq!(seed_of_name("7,5"), None, "generated buildings have their own number of rooms");
    }
}
