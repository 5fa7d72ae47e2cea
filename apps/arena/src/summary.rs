//! `summary.json`: the figures of a run, with stable keys.

use std::collections::BTreeMap;

use mission::stage_clock::StageFigures;
use serde::{Deserialize, Serialize};

use crate::zone_watch::ZoneFigures;

/// One run in figures. Everything except `wall_s`, `cpu_s` and the times in `stages` is the same for the same seeds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The referee's verdict.
    pub success: bool,
    /// One sentence: why it ended, and what the referee saw.
    pub reason: String,
    /// `ground` or `aerial`.
    pub robot: String,
    /// Name of the robot model.
    pub model: String,
    /// Name or seed of the building.
    pub scene: String,
    /// Seed of noise, drift and start.
    pub seed: u64,
    /// What the robot heard, the last of it.
    pub instruction: String,
    /// Kind of instruction.
    pub kind: String,
    /// What it took for the target, as it would say it; empty if it never decided.
    pub target: String,
    /// Length of the true path.
    pub path_m: f64,
    /// Length of the shortest way that does what was asked, from where the robot heard it; `null` if there is none.
    pub shortest_m: Option<f64>,
    /// Success weighted by path length, from where the robot heard what is judged.
    pub spl: f64,
    /// Simulated time.
    pub sim_s: f64,
    /// Time on the wall.
    pub wall_s: f64,
    /// CPU time of the process during the run; in a bench, of the thread that the run has for itself.
    pub cpu_s: f64,
    /// Angle turned while standing, in truth.
    pub turned_in_place_rad: f64,
    /// Seconds from when the instruction was heard until ten LiDAR points had met a right thing; `null` if that never was, or for a room.
    pub first_sighting_s: Option<f64>,
    /// Decisions taken.
    pub decisions: usize,
    /// Tokens in all prompts.
    pub prompt_tokens: usize,
    /// Tokens in all answers.
    pub answer_tokens: usize,
    /// Touches of the building and the things in it.
    pub collisions: usize,
    /// Touches of people while the robot moved, or less than half a second after.
    pub contacts_with_people: usize,
    /// How often any part of the robot was in a zone that it has to keep out of, in truth.
    pub keep_out_entries: usize,
    /// Each zone of `--zones`, in truth; empty without. They are written and not read.
    #[serde(skip_deserializing)]
    pub zones: Vec<ZoneFigures>,
    /// Least distance between the robot's outline and an obstacle, as its local policy saw it; `null` before it moved.
    pub min_clearance_m: Option<f64>,
    /// Rooms in the scene graph.
    pub rooms_found: usize,
    /// Confirmed objects in the scene graph.
    pub objects_found: usize,
    /// Pictures that were to be segmented.
    pub images: usize,
    /// Those among them for which the segmenter gave nothing that could be used.
    pub images_without_masks: usize,
    /// Why, the last time; `null` if it never failed.
    pub segmenter_error: Option<String>,
    /// How long the odometry had lost its way.
    pub lost_s: f64,
    /// How often it began anew.
    pub odometry_resets: u64,
    /// True if a person stopped the run.
    pub interrupted: bool,
    /// Where the time went.
    pub stages: BTreeMap<String, StageFigures>,
}
