//! Sets of referring expressions over recorded rooms (ReferIt3D's Sr3D and Nr3D): the JSON lines and nothing else.
//!
//! ```text
//! {"scene": "scene0000_00", "objects": [[id, label, cx, cy, cz, sx, sy, sz, r, g, b, front, obb, rot], ...]}
//! {"set": "sr3d", "scene": "scene0000_00", "target": 4, "label": "towel", "n_same": 2, "text": "...", "relation": "closest", ...}
//! ```
//! Boxes are centre and full size in metres, z up; `front` is a point on the front face or null. A line of utterances is taken apart at
//! once: [`Question`] is what a grounder may see, [`AnswerKey`] is for the scorer.

use dsg::{Aabb, ObjectId};
use nalgebra::{Point3, Vector3};
use serde::Deserialize;

use crate::grounding::{Match, ground};
use crate::oriented_box::OrientedBox;
use crate::parser::parse_referring;
use crate::scene::{Scene, Thing};

/// What a grounder may see of an utterance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Question {
    /// Name of the scene.
    pub scene: String,
    /// The sentence.
    pub text: String,
}

/// What the scorer knows besides.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct AnswerKey {
    /// Name of the set.
    pub set: String,
    /// The right object.
    pub target: u64,
    /// Its class.
    #[serde(default)]
    pub label: String,
    /// Objects of that class in the scene, the right one included.
    #[serde(default)]
    pub n_same: u32,
    /// The relation it was made with, where a template made it.
    #[serde(default)]
    pub relation: Option<String>,
}

impl AnswerKey {
    /// ReferIt3D's easy: exactly one distractor of the class, or none.
    pub fn is_easy(&self) -> bool {
        self.n_same <= 2
    }
}

impl Question {
    /// ReferIt3D's rule: the sentence is view-dependent if it holds one of ten words.
    pub fn is_view_dependent(&self) -> bool {
        const WORDS: [&str; 10] =
            ["facing", "looking", "front", "behind", "back", "right", "left", "leftmost", "rightmost", "across"];
        self.text.split(|c: char| !c.is_alphanumeric()).any(|word| WORDS.iter().any(|w| word.eq_ignore_ascii_case(w)))
    }

    /// 0 or 1 by a fixed hash (FNV-1a) of scene and sentence. The grounder's rules were made on sentences of half 0; the scores of half 1 were
    /// looked at while choosing among rules, so its figure is no clean hold-out.
    pub fn half(&self) -> u8 {
        let bytes = self.scene.bytes().chain([0]).chain(self.text.bytes());
        let hash =
            bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
        (hash >> 32 & 1) as u8
    }
}

/// A line that is not what it should be.
#[derive(Debug, thiserror::Error)]
pub enum ReferSetError {
    /// Not JSON of the layout above.
    #[error("not a line of the layout in refer_set.rs: {0}")]
    Layout(String),
    /// A number is not finite, or a size negative.
    #[error("object {0}: centre and size must be finite and the size not negative")]
    Box(u64),
    /// Two objects of a scene have one id.
    #[error("object {0} stands twice in its scene")]
    Twice(u64),
}

/// The object a sentence means, for a viewer in the middle of the scene: text and boxes in, id out. None if nothing in the scene
/// answers to any noun of the sentence.
pub fn answer(text: &str, scene: &Scene) -> Option<ObjectId> {
    ranked(text, scene).first().map(|found| found.id)
}

/// The same with what is known about these sets: whoever describes a thing has others of its class before his eyes.
pub fn answer_with_prior(text: &str, scene: &Scene) -> Option<ObjectId> {
    /// Weight of a thing that is the only one of its class.
    const ONLY_ONE: f64 = 0.3;
    let class = |thing: &Thing| thing.classes.first().map(|(class, _)| *class);
    let mut count = vec![0_u32; scene.classes.len()];
    for class in scene.things.iter().filter_map(class) {
        count[class as usize] += 1;
    }
    let weight = |found: &Match| {
        let is_only = class(&scene.things[found.index]).is_some_and(|class| count[class as usize] < 2);
        found.rank * if is_only { ONLY_ONE } else { 1.0 }
    };
    let found = ranked(text, scene);
    // Of equals the first: they are sorted.
    let best = found.iter().reduce(|best, each| if weight(each) > weight(best) { each } else { best });
    best.map(|found| found.id)
}

fn ranked(text: &str, scene: &Scene) -> Vec<Match> {
    let labels: Vec<&str> = scene.classes.iter().map(|class| class.text.as_str()).collect();
    parse_referring(text, &labels).map_or_else(Vec::new, |goal| ground(&goal, scene, &middle(scene)))
}

/// At eye height over the middle of everything: where the viewer of these sets is taken to stand.
pub fn middle(scene: &Scene) -> Point3<f64> {
    middle_of(scene, 0..scene.things.len())
}

/// The same over some of the things.
pub(crate) fn middle_of(scene: &Scene, things: impl Iterator<Item = usize>) -> Point3<f64> {
    /// Of somebody who stands, metres.
    const EYE_HEIGHT_M: f64 = 1.5;
    let all = things.map(|index| scene.things[index].bounds).reduce(|a, b| a.union(&b));
    all.map_or_else(Point3::origin, |all| Point3::new(all.center().x, all.center().y, EYE_HEIGHT_M))
}

#[derive(Deserialize)]
struct UtteranceLine {
    scene: String,
    text: String,
    #[serde(flatten)]
    key: AnswerKey,
}

/// Reads a line of utterances.
///
/// # Errors
/// [`ReferSetError::Layout`] for a line of another form.
pub fn read_utterance(line: &str) -> Result<(Question, AnswerKey), ReferSetError> {
    let UtteranceLine { scene, text, key } =
        serde_json::from_str(line).map_err(|error| ReferSetError::Layout(error.to_string()))?;
    Ok((Question { scene, text }, key))
}

#[derive(Deserialize)]
struct SceneLine {
    scene: String,
    objects: Vec<ObjectRow>,
}

/// id, label, centre, size, colour, front, oriented box, yaw; nothing may follow.
#[derive(Deserialize)]
struct ObjectRow(
    u64,
    String,
    f64,
    f64,
    f64,
    f64,
    f64,
    f64,
    f64,
    f64,
    f64,
    Option<[f64; 3]>,
    Option<[f64; 6]>,
    Option<f64>,
);

/// Reads a line of scenes: its name and the things in it, ids ascending.
///
/// # Errors
/// The first object that is not sound.
pub fn read_scene(line: &str) -> Result<(String, Scene), ReferSetError> {
    let SceneLine { scene: name, mut objects } =
        serde_json::from_str(line).map_err(|error| ReferSetError::Layout(error.to_string()))?;
    objects.sort_by_key(|row| row.0);
    let mut scene = Scene::default();
    for row in objects {
        let ObjectRow(id, label, cx, cy, cz, sx, sy, sz, r, g, b, front, oriented, yaw_rad) = row;
        let sizes = [sx, sy, sz];
        if ![cx, cy, cz, r, g, b].iter().chain(&sizes).all(|x| x.is_finite()) || sizes.iter().any(|side| *side < 0.0) {
            return Err(ReferSetError::Box(id));
        }
        if scene.things.last().is_some_and(|last| last.id.0 == id) {
            return Err(ReferSetError::Twice(id));
        }
        let class = scene.intern(&label);
        let oriented = oriented.zip(yaw_rad).map(|(numbers, yaw_rad)| OrientedBox {
            center: Point3::new(numbers[0], numbers[1], numbers[2]),
            sides_m: Vector3::new(numbers[3], numbers[4], numbers[5]),
            yaw_rad,
        });
        scene.things.push(Thing {
            id: ObjectId(id),
            classes: vec![(class, 1.0)],
            bounds: Aabb::from_center(Point3::new(cx, cy, cz), Vector3::from(sizes)),
            color: Some([r, g, b]),
            words: String::new(),
            color_name: None,
            material: None,
            function: None,
            group: None,
            room: None,
            front: front.map(Point3::from),
            oriented,
            trust: 1.0,
        });
    }
    Ok((name, scene))
}
