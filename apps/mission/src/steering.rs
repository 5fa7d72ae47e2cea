//! A person steers in the middle of a run: pause, resume, cancel, another instruction.
//!
//! Each is an event with a time and stands in the journal as it was heard, so that a replay can say it again at the same moment
//! ([`Control::line`] and [`parse_script`] are each other's inverse). Nothing that is known is lost by any of them: map and graph stay.

use std::fmt;

use octant_prompt::vocabulary::Class;
use octant_prompt::{Instruction, parse_instruction};
use omni_perception::Stamp;
use thiserror::Error;

use crate::acting::{StepMemory, Target};
use crate::goal::Goal;
use crate::mission::Mission;

/// Longest instruction that is read.
const LONGEST_BYTES: usize = 2000;
/// Most lines of a script.
const MOST_LINES: usize = 1000;

/// What a person may say.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Control {
    /// Stand, or hover, until [`Control::Resume`]. An aircraft's battery goes on counting.
    Pause,
    /// Go on.
    Resume,
    /// End the mission: stand, or come down.
    Cancel,
    /// Somebody is there to be asked which of several things is meant.
    AskMe,
    /// The answer to what the robot asked.
    Answer(String),
    /// Forget the goal and do this; also for a robot that has done, or given up, what it was told before.
    Instruct(String),
}

/// Why nothing came of it; what was going on goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ControlError {
    /// The mission has ended.
    #[error("the mission is over")]
    Over,
    /// It is.
    #[error("the robot is paused already")]
    Paused,
    /// It is not.
    #[error("the robot is not paused")]
    NotPaused,
    /// There is nothing to go to in the sentence.
    #[error(
        "the new instruction names nothing to go to; say for example \"find the mug near the sink\" or \"go to the kitchen\""
    )]
    NoGoal,
    /// An answer to no question.
    #[error("the robot has not asked anything")]
    NothingAsked,
    /// More than 2000 bytes.
    #[error("the new instruction is too long; at most {LONGEST_BYTES} bytes are read")]
    TooLong,
}

/// One thing that was said, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlEntry {
    /// Seconds since the mission began.
    pub t_s: f64,
    /// What.
    pub control: Control,
    /// Why nothing came of it.
    pub refused: Option<String>,
}

impl Control {
    /// What a line means: `pause`, `resume`, `cancel`, `ask me`, `answer: ...`, and everything else is an instruction.
    pub fn from_line(line: &str) -> Control {
        const ANSWER: &str = "answer:";
        let line = line.trim();
        if let Some(answer) = line.get(..ANSWER.len()).filter(|start| start.eq_ignore_ascii_case(ANSWER)) {
            return Control::Answer(line[answer.len()..].trim().to_owned());
        }
        match line.to_lowercase().as_str() {
            "pause" => Control::Pause,
            "resume" => Control::Resume,
            "cancel" => Control::Cancel,
            "ask me" => Control::AskMe,
            _ => Control::Instruct(line.to_owned()),
        }
    }

    /// The line that means this.
    pub fn line(&self) -> String {
        match self {
            Control::Pause => "pause".into(),
            Control::Resume => "resume".into(),
            Control::Cancel => "cancel".into(),
            Control::AskMe => "ask me".into(),
            Control::Answer(text) => format!("answer: {text}"),
            Control::Instruct(text) => text.clone(),
        }
    }
}

impl fmt::Display for ControlEntry {
    /// A line of a script; one that was refused is a remark.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.refused {
            None => write!(f, "{} {}", self.t_s, self.control.line()),
            Some(why) => write!(f, "# {} {} (refused: {why})", self.t_s, self.control.line()),
        }
    }
}

/// A line of a script that cannot be read.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScriptError {
    /// It does not begin with a time.
    #[error(
        "line {line} does not begin with seconds; it has to look like \"12.5 pause\" or \"31 find the plant in the office\""
    )]
    NoTime {
        /// From 1.
        line: usize,
    },
    /// Nothing follows the time.
    #[error("line {line} says nothing after its time; pause, resume, cancel, or an instruction")]
    NoWords {
        /// From 1.
        line: usize,
    },
    /// It is earlier than the line before it.
    #[error("line {line} is earlier than the one before it")]
    Earlier {
        /// From 1.
        line: usize,
    },
    /// More than 1000 lines.
    #[error("there are more than {MOST_LINES} lines")]
    TooLong,
}

/// Reads `SECONDS WORDS` lines in the order of time; empty lines and those that begin with `#` are skipped.
///
/// # Errors
/// [`ScriptError`] names the line.
pub fn parse_script(text: &str) -> Result<Vec<(f64, Control)>, ScriptError> {
    let mut script: Vec<(f64, Control)> = Vec::new();
    for (index, text) in text.lines().enumerate() {
        let (line, text) = (index + 1, text.trim());
        if line > MOST_LINES {
            return Err(ScriptError::TooLong);
        }
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let (time, words) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let t_s: f64 =
            time.parse().ok().filter(|t: &f64| t.is_finite() && *t >= 0.0).ok_or(ScriptError::NoTime { line })?;
        if words.trim().is_empty() {
            return Err(ScriptError::NoWords { line });
        }
        if script.last().is_some_and(|(before_s, _)| t_s < *before_s) {
            return Err(ScriptError::Earlier { line });
        }
        script.push((t_s, Control::from_line(words)));
    }
    Ok(script)
}

impl Mission {
    /// Does what a person says, at `now`, and writes it down.
    ///
    /// # Errors
    /// [`ControlError`]: nothing has changed.
    pub fn control(&mut self, control: &Control, now: Stamp) -> Result<(), ControlError> {
        let done = match control {
            _ if self.is_interrupted() => Err(ControlError::Over),
            // Who stands where it was sent, or gave up, can be sent on.
            Control::Instruct(text) => self.instruct(text, now),
            _ if self.outcome.is_some() => Err(ControlError::Over),
            Control::Pause => self.pause(),
            Control::Resume => self.resume(now),
            Control::Cancel => {
                self.cancel(now);
                Ok(())
            }
            Control::AskMe => {
                self.ask_me();
                Ok(())
            }
            Control::Answer(text) if text.len() > LONGEST_BYTES => Err(ControlError::TooLong),
            Control::Answer(text) => self.hear_answer(text, now),
        };
        self.write_down(control, now, done.err().map(|error| error.to_string()));
        done
    }

    /// Writes down what was said; also for those who refuse it before the robot hears of it.
    pub fn write_down(&mut self, control: &Control, now: Stamp, refused: Option<String>) {
        let t_s = self.seconds(now);
        let note = match &refused {
            None => format!("told: {}", control.line()),
            Some(why) => format!("told: {}; refused: {why}", control.line()),
        };
        self.journal.notes.push((t_s, note));
        self.journal.controls.push(ControlEntry { t_s, control: control.clone(), refused });
    }

    /// Whether it waits for [`Control::Resume`].
    pub fn is_paused(&self) -> bool {
        self.is_paused
    }

    /// When it was cancelled.
    pub fn cancelled_s(&self) -> Option<f64> {
        self.cancelled_s
    }

    fn pause(&mut self) -> Result<(), ControlError> {
        if self.is_paused {
            return Err(ControlError::Paused);
        }
        self.is_paused = true;
        self.drop_goal();
        Ok(())
    }

    fn resume(&mut self, now: Stamp) -> Result<(), ControlError> {
        if !self.is_paused {
            return Err(ControlError::NotPaused);
        }
        self.is_paused = false;
        self.next_decision_s = self.seconds(now);
        Ok(())
    }

    fn cancel(&mut self, now: Stamp) {
        self.cancelled_s = Some(self.seconds(now));
        self.drop_goal();
        self.interrupt();
    }

    fn instruct(&mut self, text: &str, now: Stamp) -> Result<(), ControlError> {
        if text.len() > LONGEST_BYTES {
            return Err(ControlError::TooLong);
        }
        let instruction = parse_instruction(text);
        if instruction.steps.is_empty() {
            return Err(ControlError::NoGoal);
        }
        self.outcome = None;
        // What nobody looked for was not seen where the robot has looked.
        if self.names_something_new(&instruction) {
            self.world.coverage.look_again();
        }
        self.nouns = instruction.nouns().iter().map(|noun| Class::new(noun)).collect();
        self.instruction = instruction;
        self.interest.clear();
        self.steps_done.clear();
        self.step_index = 0;
        self.memory = StepMemory::default();
        self.question = None;
        self.asked_before = self.questions_asked();
        self.unsure = 0;
        self.way_home.forgive();
        if let Some(odometry) = &self.world.odometry {
            self.asked_from = odometry.world_from_body.translation.vector.into();
        }
        self.drop_goal();
        self.drop_question();
        self.next_decision_s = self.seconds(now);
        Ok(())
    }

    fn names_something_new(&self, instruction: &Instruction) -> bool {
        let looked_for = |noun: &String| {
            self.standing_phrases().contains(noun) || self.nouns.iter().any(|known| known.text == *noun)
        };
        !instruction.nouns().iter().all(looked_for)
    }

    /// The body stands or hovers; what it was after counts neither as reached nor as failed.
    pub(crate) fn drop_goal(&mut self) {
        self.target = Target::None;
        self.stands_before_target = false;
        self.arrived_s = None;
        self.looking.left = 0;
        self.body.set_goal(Goal::Stay);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_is_read_and_what_was_said_can_be_said_again() {
        let script =
            parse_script("# a run\n12.5 pause\n\n20 Resume\n31 find the plant in the office\n31 cancel\n").unwrap();
        assert_eq!(script[0], (12.5, Control::Pause));
        assert_eq!(script[2], (31.0, Control::Instruct("find the plant in the office".into())));
        let entry =
            |(t_s, control): &(f64, Control)| ControlEntry { t_s: *t_s, control: control.clone(), refused: None };
        let text: String = script.iter().map(|said| format!("{}\n", entry(said))).collect();
        assert_eq!(parse_script(&text).unwrap(), script);
        let refused = ControlEntry { refused: Some("no".into()), ..entry(&script[0]) };
        assert_eq!(parse_script(&refused.to_string()).unwrap(), []);
        // To the last digit of a time.
        let odd = entry(&(1.0_f64 / 3.0 + 1e-9, Control::Pause));
        assert_eq!(parse_script(&odd.to_string()).unwrap()[0].0, odd.t_s);
    }

    #[test]
    fn lines_that_cannot_be_read_are_named() {
        for (text, error) in [
            ("pause", ScriptError::NoTime { line: 1 }),
            ("1 pause\n-2 resume", ScriptError::NoTime { line: 2 }),
            ("NaN pause", ScriptError::NoTime { line: 1 }),
            ("\n5  ", ScriptError::NoWords { line: 2 }),
            ("5 pause\n4 resume", ScriptError::Earlier { line: 2 }),
        ] {
            assert_eq!(parse_script(text).unwrap_err(), error, "{text}");
        }
        assert_eq!(parse_script(&"1 pause\n".repeat(1001)).unwrap_err(), ScriptError::TooLong);
    }
}
