//! The verdict on a run: from what truly was and what the robot said, and from nothing else.
//!
//! [`TruthLog`] is what `truth/` holds ([`crate::truth_folder`]); [`verdict`] is asked at the end of a run, and again by
//! `omnivln judge`, by anybody, at any time.

use mission::goal::wrap;
use mission::zones::Zones;
use nalgebra::{Isometry3, Point2};
use serde::{Deserialize, Serialize};

use crate::referee::Referee;
use crate::simulation::Touch;
use crate::task::Task;
use crate::zone_watch::{ZoneFigures, ZoneWatch};

/// How a run ended, as the world saw it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "how")]
pub enum Ending {
    /// The robot declared to be there.
    Stopped {
        /// What it took for the target.
        target: String,
    },
    /// The robot said why it cannot be done.
    GaveUp {
        /// Its sentence.
        reason: String,
    },
    /// Time was up.
    TimedOut {
        /// The time it had.
        max_time_s: f64,
        /// What it was doing.
        activity: String,
    },
    /// A person stopped the run.
    Interrupted,
    /// A person called it off.
    Cancelled {
        /// When.
        t_s: f64,
        /// "stands" or "came down".
        rests: String,
    },
    /// None of these.
    #[default]
    Undecided,
}

/// A step that the robot declared done.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// Index of the step.
    pub step: usize,
    /// When.
    pub stamp_ns: i64,
    /// Where it truly was; for the last step where it came to rest after it.
    pub truth_from_body: Isometry3<f64>,
}

/// An errand that was judged before the one that the verdict is about.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Errand {
    /// What the robot heard.
    pub instruction: String,
    /// Whether it did it.
    pub success: bool,
    /// Why, or why not.
    pub reason: String,
    /// When it ended.
    pub end_s: f64,
}

/// The truth of a run.
#[derive(Debug, Clone, Default)]
pub struct TruthLog {
    /// True poses of the body, fifty a second since the judged instruction was heard.
    pub poses: Vec<(i64, Isometry3<f64>)>,
    /// When the judged instruction was heard.
    pub heard_ns: i64,
    /// Every touch.
    pub touches: Vec<Touch>,
    /// Where the map's frame was in the building when the run began.
    pub truth_from_map: Isometry3<f64>,
    /// The zones in the building.
    pub zones: Zones,
    /// The steps that the robot declared done.
    pub declared: Vec<Declared>,
    /// How it ended.
    pub ending: Ending,
    /// Why a vehicle outside ended its flight or walk early: whatever was reached, that is no success.
    pub trouble: Option<String>,
    /// Errands before the judged one.
    pub errands: Vec<Errand>,
    /// How often the robot asked which of several things is meant.
    pub questions: usize,
    /// When a right thing was first seen, seconds after the instruction.
    pub first_sighting_s: Option<f64>,
}

/// What the referee says of a step that the robot declared done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct StepVerdict {
    /// Index of the step.
    pub step: usize,
    /// When the robot said so.
    pub declared_s: f64,
    /// Whether it was.
    pub right: bool,
}

/// What the referee says.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether everything was done in order.
    pub success: bool,
    /// One sentence.
    pub reason: String,
    /// The steps that were declared done.
    pub steps: Vec<StepVerdict>,
    /// Length of the true path of the whole run.
    pub path_m: f64,
    /// Length of the shortest way that does what was asked, from where the robot heard it; `null` if there is none.
    pub shortest_m: Option<f64>,
    /// Success weighted by path length, from where the robot heard what is judged.
    pub spl: f64,
    /// Angle turned while standing.
    pub turned_in_place_rad: f64,
    /// Touches of the building and the things in it.
    pub collisions: usize,
    /// Touches of people while the robot moved.
    pub contacts_with_people: usize,
    /// How often it was in a zone that it has to keep out of.
    pub keep_out_entries: usize,
    /// Each zone.
    pub zones: Vec<ZoneFigures>,
}

impl TruthLog {
    /// Goes on to another instruction, heard now. Of more than half an hour before, which only a patrol has, one pose in twenty is kept.
    pub fn begin_errand(&mut self, now_ns: i64) {
        const KEEP: usize = 20;
        const MOST: usize = 100_000;
        if self.poses.len() > MOST {
            self.thin(KEEP);
        }
        self.heard_ns = now_ns;
        self.declared.clear();
        self.ending = Ending::default();
        self.first_sighting_s = None;
    }

    /// Keeps the last pose, those before the errand that ends, and of that errand's one in `keep`.
    fn thin(&mut self, keep: usize) {
        let from = self.poses.partition_point(|(stamp_ns, _)| *stamp_ns <= self.heard_ns);
        let mut index = 0;
        let last = self.poses.len();
        self.poses.retain(|_| {
            index += 1;
            index <= from || index % keep == 0 || index == last
        });
    }
}

/// Judges. `referee` knows building, robot and start; `footprint` is the robot's outline in its own frame, for the zones.
pub fn verdict(truth: &TruthLog, task: &Task, referee: &Referee, footprint: &[Point2<f64>]) -> Verdict {
    let steps: Vec<StepVerdict> = truth.declared.iter().map(|declared| judge_step(declared, task, referee)).collect();
    let plain = outcome(truth, task, &steps);
    let gave_up = match &truth.ending {
        Ending::GaveUp { reason } => Some(reason.as_str()),
        _ => None,
    };
    let (mut success, mut reason) = task.rule.judge(&task.text, plain, gave_up, truth.questions);
    if let Some(trouble) = &truth.trouble {
        (success, reason) = (false, trouble.clone());
    }
    let at = |(_, pose): &(i64, Isometry3<f64>)| Point2::from(pose.translation.vector.xy());
    let length_m = |poses: &[(i64, Isometry3<f64>)]| poses.windows(2).map(|w| (at(&w[1]) - at(&w[0])).norm()).sum();
    let path_m: f64 = length_m(&truth.poses);
    // From the pose in which it heard the instruction.
    let heard = truth.poses.partition_point(|(stamp_ns, _)| *stamp_ns <= truth.heard_ns).saturating_sub(1);
    let (asked_at, driven_m) = match truth.poses.get(heard) {
        Some(pose) => (at(pose), length_m(&truth.poses[heard..])),
        None => (Point2::origin(), 0.0),
    };
    let shortest_m = referee.shortest_m(&task.steps, &asked_at);
    let spl = match (success, shortest_m) {
        (true, Some(shortest_m)) => {
            // Whoever starts at a right place has driven no detour.
            if shortest_m < omni_sim::floor::CELL_M { 1.0 } else { shortest_m / driven_m.max(shortest_m) }
        }
        _ => 0.0,
    };
    let mut watch = ZoneWatch::new(truth.zones.clone(), footprint);
    for pair in truth.poses.windows(2) {
        watch.see(&pair[1].1, (pair[1].0 - pair[0].0) as f64 * 1e-9);
    }
    Verdict {
        success,
        reason,
        steps,
        path_m,
        shortest_m,
        spl,
        turned_in_place_rad: turned_in_place_rad(&truth.poses),
        collisions: truth.touches.iter().filter(|touch| touch.is_collision()).count(),
        contacts_with_people: truth.touches.iter().filter(|touch| touch.is_with_person()).count(),
        keep_out_entries: watch.figures().iter().filter(|zone| zone.max_mps.is_none()).map(|zone| zone.entries).sum(),
        zones: watch.figures().to_vec(),
    }
}

/// Angle over all tenths of a second in which the body moved by less than a centimetre.
fn turned_in_place_rad(poses: &[(i64, Isometry3<f64>)]) -> f64 {
    const POSES: usize = 5;
    const STANDS_M: f64 = 0.01;
    let tenths: Vec<&Isometry3<f64>> = poses.iter().step_by(POSES).map(|(_, pose)| pose).collect();
    let turned = |pair: &[&Isometry3<f64>]| {
        let moved_m = (pair[1].translation.vector.xy() - pair[0].translation.vector.xy()).norm();
        let yaw_rad = |pose: &Isometry3<f64>| pose.rotation.euler_angles().2;
        if moved_m < STANDS_M { wrap(yaw_rad(pair[1]) - yaw_rad(pair[0])).abs() } else { 0.0 }
    };
    tenths.windows(2).map(turned).sum()
}

fn judge_step(declared: &Declared, task: &Task, referee: &Referee) -> StepVerdict {
    let step = task.steps.get(declared.step);
    StepVerdict {
        step: declared.step,
        declared_s: declared.stamp_ns as f64 * 1e-9,
        right: step.is_some_and(|step| referee.is_done(step, &declared.truth_from_body)),
    }
}

/// Success and the sentence that explains it.
fn outcome(truth: &TruthLog, task: &Task, judged: &[StepVerdict]) -> (bool, String) {
    let target = match &truth.ending {
        Ending::Cancelled { t_s, rests } => {
            return (false, format!("The run was cancelled after {t_s:.1} s; the robot {rests}."));
        }
        Ending::Interrupted => return (false, "The run was interrupted; the robot stopped safely.".into()),
        Ending::TimedOut { max_time_s, activity } => {
            return (false, format!("The robot did not arrive within {max_time_s:.0} s; it was {activity}."));
        }
        Ending::Undecided => return (false, "The run ended before the robot decided anything.".into()),
        Ending::GaveUp { reason } => return (false, format!("The robot gave up: {reason}")),
        Ending::Stopped { target } => target,
    };
    let is_done = |index: usize| judged.iter().any(|step| step.step == index && step.right);
    match (0..task.steps.len()).find(|index| !is_done(*index)) {
        None => (true, format!("The robot stopped at the right place ({target}).")),
        Some(index) if task.steps.len() > 1 => {
            (false, format!("The robot stopped at {target}, but step {} was not done.", index + 1))
        }
        Some(_) => (false, format!("The robot stopped at {target}, which is the wrong place.")),
    }
}
