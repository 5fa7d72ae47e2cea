//! Instructions from elsewhere: sentences with the true things that answer to them, so that the referee needs no grammar.
//!
//! A line is a JSON object:
//! ```text
//! {"scene": "flat" | 17, "text": "find the mug", "targets": [12, 13], "kind": "typo",
//!  "rooms": [2], "steps": [[4], [7, 9]], "start": [1.0, 2.5, 90.0], "seed": 3}
//! ```
//! `targets` are ids of objects of the building (`truth/objects.json` of any run in it lists them); any of them is right. An empty list
//! says that there is no such thing: right is the robot that says so. With the kind `ambiguous` right is the robot that asks which and
//! then reaches a target. The second row may be left out: rooms in which the errand ends instead of at a thing, things to be reached
//! before, in order, where the robot starts (metres and degrees in the building), and the seed of noise, drift and a start that is not given.
//!
//! A file of answers has lines `{"scene": ..., "text": ..., "answer": "the one near the sink"}`, `scene` being optional.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use mission::robot_model::RobotModel;
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use crate::intervals::wilson_95;
use crate::referee::Referee;
use crate::rule::Rule;
use crate::scenario::{Scenario, Scene, draw_start, pose_at, robot_truth};
use crate::summary::Summary;
use crate::task::{StepTruth, Task, TaskKind};

/// Largest file that is read.
const LARGEST_BYTES: u64 = 16 << 20;
/// Longest sentence that a robot reads.
const LONGEST_TEXT: usize = 2000;
/// The kind of sentence that fits several things.
const AMBIGUOUS: &str = "ambiguous";
/// The kind of sentence about what is not there.
const FALSE_PREMISE: &str = "false_premise";

/// A sentence and what it means in the truth.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GivenInstruction {
    scene: SceneName,
    text: String,
    #[serde(default)]
    targets: Vec<u32>,
    /// What sort of difficulty it is, for the figures.
    pub kind: String,
    #[serde(default)]
    rooms: Vec<u32>,
    #[serde(default)]
    steps: Vec<Vec<u32>>,
    #[serde(default)]
    start: Option<[f64; 3]>,
    #[serde(default)]
    seed: Option<u64>,
}

/// A name or the seed of a generated building.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
enum SceneName {
    Name(String),
    Seed(u64),
}

impl SceneName {
    fn text(&self) -> String {
        match self {
            SceneName::Name(name) => name.clone(),
            SceneName::Seed(seed) => seed.to_string(),
        }
    }
}

/// Reads a file of instructions and checks each against its building.
///
/// # Errors
/// Name the line and what would be accepted: unknown keys, ids that the building does not have, a sentence without targets that is not a
/// false premise.
pub fn open_instructions(path: &Path, robot: &RobotModel) -> Result<Vec<GivenInstruction>> {
    let instructions: Vec<GivenInstruction> = read_lines(path)?;
    ensure!(!instructions.is_empty(), "{} holds no instruction", path.display());
    let mut scenes: BTreeMap<String, (Vec<u32>, Vec<u32>)> = BTreeMap::new();
    for (index, given) in instructions.iter().enumerate() {
        let place = || format!("instruction {} of {}", index + 1, path.display());
        given.check().with_context(place)?;
        let name = given.scene.text();
        if !scenes.contains_key(&name) {
            let building = Scene::open(&name, robot).with_context(place)?.building;
            let objects = building.objects.iter().map(|object| object.id).collect();
            let rooms = building.rooms.iter().map(|room| room.id).collect();
            scenes.insert(name.clone(), (objects, rooms));
        }
        let (objects, rooms) = &scenes[&name];
        let mut wanted = given.targets.iter().chain(given.steps.iter().flatten());
        if let Some(id) = wanted.find(|id| !objects.contains(id)) {
            return Err(anyhow::anyhow!("building {name} has no object {id}")).with_context(place);
        }
        if let Some(id) = given.rooms.iter().find(|id| !rooms.contains(id)) {
            return Err(anyhow::anyhow!("building {name} has no room {id}")).with_context(place);
        }
    }
    Ok(instructions)
}

/// The objects of a file of JSON lines; empty lines are skipped.
fn read_lines<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<Vec<T>> {
    let place = || format!("reading {}", path.display());
    let size = std::fs::metadata(path).with_context(place)?.len();
    ensure!(size <= LARGEST_BYTES, "{} has {size} bytes; at most {LARGEST_BYTES} are read", path.display());
    let text = std::fs::read_to_string(path).with_context(place)?;
    parse_lines(&text).with_context(place)
}

fn parse_lines<T: for<'a> Deserialize<'a>>(text: &str) -> Result<Vec<T>> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(index, line)| serde_json::from_str(line).with_context(|| format!("line {}", index + 1))).collect()
}

impl GivenInstruction {
    /// What can be checked without the building.
    fn check(&self) -> Result<()> {
        ensure!(!self.text.trim().is_empty(), "the text is empty");
        ensure!(self.text.len() <= LONGEST_TEXT, "the text is longer than {LONGEST_TEXT} bytes");
        ensure!(!self.kind.is_empty(), "the kind is empty");
        let names_nothing = self.targets.is_empty() && self.rooms.is_empty();
        if self.kind == FALSE_PREMISE && !names_nothing {
            bail!("a false premise has no targets and no rooms");
        }
        if self.kind == AMBIGUOUS && self.targets.is_empty() {
            bail!("an ambiguous instruction needs the targets that its answer means");
        }
        ensure!(self.targets.is_empty() || self.rooms.is_empty(), "an errand ends at targets or in rooms, not both");
        ensure!(self.steps.iter().all(|ids| !ids.is_empty()), "a step needs at least one object id");
        let is_finite = self.start.is_none_or(|start| start.iter().all(|number| number.is_finite()));
        ensure!(is_finite, "start is [x, y, yaw]: metres and degrees, all finite");
        Ok(())
    }

    /// The sentence and how it is judged.
    fn task(&self) -> Task {
        let rule = if self.targets.is_empty() && self.rooms.is_empty() {
            Rule::SayWhatIsMissing
        } else if self.kind == AMBIGUOUS {
            Rule::AskAndReach
        } else {
            Rule::Reach
        };
        let last = match self.rooms.is_empty() {
            true => StepTruth::Object { ids: self.targets.clone() },
            false => StepTruth::Room { ids: self.rooms.clone() },
        };
        let before = self.steps.iter().map(|ids| StepTruth::Object { ids: ids.clone() });
        Task { text: self.text.clone(), kind: TaskKind::Given, steps: before.chain([last]).collect(), rule }
    }

    /// The run that it asks for.
    ///
    /// # Errors
    /// A start where the robot cannot stand, or targets to which it has no way.
    pub fn scenario(&self, robot: &RobotModel, flight_height_m: f64) -> Result<Scenario> {
        /// Starts that are drawn before it counts as impossible.
        const TRIES: u64 = 20;
        let scene = Scene::open(&self.scene.text(), robot)?;
        let referee = Referee::new(&scene.building, &scene.world, robot_truth(robot, flight_height_m), 0);
        let (task, seed) = (self.task(), self.seed.unwrap_or(1));
        let length_m = |start: &nalgebra::Isometry3<f64>| match task.rule {
            Rule::SayWhatIsMissing => Some(f64::NAN),
            _ => referee.shortest_m(&task.steps, &Point2::from(start.translation.vector.xy())),
        };
        let (start, shortest_m) = match self.start {
            Some([x, y, yaw_deg]) => {
                let at = Point2::new(x, y);
                let cell = referee.floor().cell_of(&at);
                let is_free = cell.is_some_and(|cell| referee.stands_free(cell, robot.circumscribed_radius_m));
                ensure!(is_free, "the robot has no room at {x}, {y}");
                let start = pose_at(&at, yaw_deg.to_radians(), &referee, robot);
                (start, length_m(&start).context("no way leads from the start to a target")?)
            }
            None => (0..TRIES)
                .find_map(|k| {
                    let start = draw_start(&referee, robot, seed.wrapping_add(k)).ok()?;
                    Some((start, length_m(&start)?))
                })
                .context("no way leads from any drawn start to a target")?,
        };
        let at = Point2::from(start.translation.vector.xy());
        let targets = task.targets().iter().filter_map(|id| scene.building.object(*id));
        let is_target_visible = targets.clone().any(|object| referee.sees_from(&at, object));
        let has_rival = targets.clone().next().is_some_and(|target| {
            scene.building.objects.iter().any(|other| other.class == target.class && !self.targets.contains(&other.id))
        });
        let rooms = scene.building.rooms.len();
        drop(referee);
        Ok(Scenario { scene, task, start, seed, is_target_visible, has_rival, shortest_m, rooms })
    }
}

/// What somebody answers when the robot asks which one is meant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Answers(Vec<AnswerLine>);

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct AnswerLine {
    #[serde(default)]
    scene: Option<SceneName>,
    text: String,
    answer: String,
}

impl Answers {
    /// Reads a file of answers.
    ///
    /// # Errors
    /// Name the line.
    pub fn open(path: &Path) -> Result<Answers> {
        Ok(Answers(read_lines(path)?))
    }

    /// The answers to questions about an instruction in a scene, in order; empty where nobody is there to answer.
    pub fn about(&self, scene: &str, text: &str) -> Vec<String> {
        let is_asked = |line: &&AnswerLine| {
            line.text.trim() == text.trim() && line.scene.as_ref().is_none_or(|name| name.text() == scene)
        };
        let one_line = |answer: &str| answer.split_whitespace().collect::<Vec<_>>().join(" ");
        self.0.iter().filter(is_asked).map(|line| one_line(&line.answer)).collect()
    }
}

/// Seventy-three sentences with slips, other words, false premises, things that need to be asked about, and steps; the format by example. The ids of
/// targets in numbered scenes are those of the buildings that are drawn for the ground robot.
pub const SAMPLE_INSTRUCTIONS: &str = include_str!("../tests/data/instructions.jsonl");
/// What somebody answers to the questions that they raise.
pub const SAMPLE_ANSWERS: &str = include_str!("../tests/data/answers.jsonl");

/// The figures of one kind of sentence.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct KindFigures {
    /// Runs.
    pub n: usize,
    /// Of which right.
    pub right: usize,
    /// The share.
    pub rate: f64,
    /// Its 95 % interval by Wilson.
    pub wilson_95: [f64; 2],
    /// Mean SPL of those that have a way to go; `null` if none has.
    pub spl: Option<f64>,
}

/// Figures by kind, over all runs of a bench.
pub fn by_kind(runs: &[Summary]) -> BTreeMap<String, KindFigures> {
    let mut kinds: BTreeMap<String, Vec<&Summary>> = BTreeMap::new();
    for run in runs {
        kinds.entry(run.kind.clone()).or_default().push(run);
    }
    let figures = |runs: Vec<&Summary>| {
        let (n, right) = (runs.len(), runs.iter().filter(|run| run.success).count());
        let ways: Vec<f64> = runs.iter().filter(|run| run.shortest_m.is_some()).map(|run| run.spl).collect();
        let spl = (!ways.is_empty()).then(|| ways.iter().sum::<f64>() / ways.len() as f64);
        KindFigures { n, right, rate: right as f64 / n.max(1) as f64, wilson_95: wilson_95(right, n), spl }
    };
    kinds.into_iter().map(|(kind, runs)| (kind, figures(runs))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vec<GivenInstruction>> {
        parse_lines(text)
    }

    #[test]
    fn lines_are_read_and_wrong_ones_are_named() {
        let text = "{\"scene\": \"flat\", \"text\": \"find the mug\", \"targets\": [3], \"kind\": \"class\"}\n\n\
            {\"scene\": 17, \"text\": \"find the red sofa\", \"targets\": [], \"kind\": \"false_premise\", \"start\": [1, 2, 90]}\n";
        let read = parse(text).unwrap();
        assert_eq!((read[0].scene.text(), read[1].scene.text()), ("flat".into(), "17".into()));
        assert_eq!((read[0].task().rule, read[1].task().rule), (Rule::Reach, Rule::SayWhatIsMissing));
        let error = format!("{:#}", parse(&text.replace("\"start\"", "\"begin\"")).unwrap_err());
        assert!(error.starts_with("line 3: unknown field `begin`"), "{error}");
        assert!(format!("{:#}", parse("{}").unwrap_err()).contains("line 1: missing field"));
    }

    #[test]
    fn kinds_and_targets_must_agree() {
        let check = |targets: &str, kind: &str| {
            let line = format!("{{\"scene\": 1, \"text\": \"find it\", \"targets\": {targets}, \"kind\": \"{kind}\"}}");
            parse(&line).unwrap()[0].check()
        };
        assert!(check("[1]", "class").is_ok() && check("[]", "false_premise").is_ok());
        assert!(check("[1]", "false_premise").is_err() && check("[]", "ambiguous").is_err());
    }

    #[test]
    fn answers_belong_to_a_sentence_and_perhaps_to_a_scene() {
        let text = "{\"text\": \"find the mug\", \"answer\": \"any\"}\n{\"scene\": 3, \"text\": \"find the mug\", \"answer\": \"red\"}\n";
        let answers = Answers(parse_lines(text).unwrap());
        assert_eq!(answers.about("3", "find the mug "), ["any", "red"]);
        assert_eq!(answers.about("flat", "find the mug"), ["any"]);
        assert!(answers.about("flat", "find the cup").is_empty());
    }
}
