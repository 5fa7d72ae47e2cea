//! What a person says while a run goes on: from a script with times, or line by line as it is typed.

use std::collections::VecDeque;
use std::io::{BufRead, IsTerminal};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use mission::journal::Journal;
use mission::mission::Mission;
use mission::omni_perception::Stamp;
use mission::steering::{Control, ScriptError, parse_script};
use omni_sim::building::Building;

use crate::task::Task;

/// Longest script that is read.
const LARGEST_BYTES: u64 = 1 << 20;
/// Lines that wait to be heard; who types faster waits.
const WAITING_LINES: usize = 16;

/// Where orders come from.
#[derive(Debug, Default)]
pub struct Orders {
    due: VecDeque<(f64, Control)>,
    lines: Option<Receiver<String>>,
    answers: Answering,
    rounds: Option<Rounds>,
}

/// What somebody answers when the robot asks.
#[derive(Debug, Default)]
struct Answering {
    /// Whether the robot has still to be told that somebody does.
    is_news: bool,
    /// From a file, in order; the last one is said again.
    answers: Vec<String>,
    said: usize,
    /// Questions that were answered.
    answered: usize,
    /// A line that was waited for.
    typed: Option<String>,
}

/// The same errands over and over.
#[derive(Debug)]
struct Rounds {
    errands: Vec<String>,
    next: usize,
    until_s: f64,
}

impl Orders {
    /// Lines `SECONDS WORDS`, as [`mission::steering`] describes them.
    ///
    /// # Errors
    /// [`ScriptError`] names the line.
    pub fn script(text: &str) -> Result<Orders, ScriptError> {
        Ok(Orders { due: parse_script(text)?.into(), ..Orders::default() })
    }

    /// Lines that come in while the run goes on, each obeyed at once.
    pub fn lines(lines: Receiver<String>) -> Orders {
        Orders { lines: Some(lines), ..Orders::default() }
    }

    /// A patrol: whenever the robot has done its errand, or given it up, it hears the next of these, until so many seconds are over.
    pub fn rounds(errands: Vec<String>, until_s: f64) -> Orders {
        Orders { rounds: Some(Rounds { errands, next: 0, until_s }), ..Orders::default() }
    }

    /// What the command line says: a file, `-` for standard input, or without it what is typed at a terminal in whose foreground the
    /// program runs.
    ///
    /// # Errors
    /// A file that cannot be read, and its line.
    pub fn open(commands: Option<&Path>, is_quiet: bool) -> Result<Orders> {
        let Some(path) = commands else {
            let is_typed = !is_quiet && is_typed_at();
            return Ok(if is_typed { Orders::lines(standard_input()).by_a_person() } else { Orders::default() });
        };
        if path == Path::new("-") {
            return Ok(Orders::lines(standard_input()));
        }
        let place = || format!("reading the commands {}", path.display());
        let size = std::fs::metadata(path).with_context(place)?.len();
        if size > LARGEST_BYTES {
            bail!("{} has {size} bytes; at most {LARGEST_BYTES} are read", path.display());
        }
        let text = std::fs::read_to_string(path).with_context(place)?;
        Orders::script(&text).with_context(place)
    }

    /// From somebody who answers questions.
    fn by_a_person(mut self) -> Orders {
        self.answers.is_news = true;
        self
    }

    /// With answers to the questions about the instruction, in order; the last one is repeated. Without any nobody is asked.
    pub fn with_answers(mut self, answers: Vec<String>) -> Orders {
        self.answers.is_news |= !answers.is_empty();
        self.answers.answers = answers;
        self
    }

    /// The answer to the question that waits, if there is one.
    pub fn answer(&mut self, mission: &Mission) -> Option<Control> {
        mission.question()?;
        let last = self.answers.answers.len().checked_sub(1)?;
        if mission.questions_asked() <= self.answers.answered {
            return None;
        }
        self.answers.answered = mission.questions_asked();
        let answer = self.answers.answers[self.answers.said.min(last)].clone();
        self.answers.said += 1;
        Some(Control::Answer(answer))
    }

    /// While a question waits for somebody who types, so does this, until the line is there, or nobody types any more.
    pub fn wait_for_answer(&mut self, mission: &Mission, stop: &AtomicBool) {
        const LOOK_UP: Duration = Duration::from_millis(100);
        let is_asked = mission.question().is_some() && self.answers.answers.is_empty() && self.answers.typed.is_none();
        while is_asked && self.due.is_empty() && !stop.load(Ordering::Relaxed) {
            let Some(lines) = &self.lines else { return };
            match lines.recv_timeout(LOOK_UP) {
                Ok(line) if line.trim().is_empty() => {}
                Ok(line) => {
                    self.answers.typed = Some(line);
                    return;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => self.lines = None,
            }
        }
    }

    /// Whether there will be another errand for a robot that is at rest.
    pub fn has_more(&self, now_s: f64) -> bool {
        self.rounds.as_ref().is_some_and(|rounds| !rounds.errands.is_empty() && now_s < rounds.until_s)
    }

    /// What is to be said now, one at a time, to a robot that is at rest or not.
    pub fn next(&mut self, now_s: f64, is_at_rest: bool) -> Option<Control> {
        if std::mem::take(&mut self.answers.is_news) {
            return Some(Control::AskMe);
        }
        if let Some(line) = self.answers.typed.take() {
            return Some(Control::from_line(&line));
        }
        if let Some(rounds) = self.rounds.as_mut().filter(|rounds| is_at_rest && now_s < rounds.until_s) {
            let errand = rounds.errands.get(rounds.next % rounds.errands.len().max(1))?;
            rounds.next += 1;
            return Some(Control::Instruct(errand.clone()));
        }
        if self.due.front().is_some_and(|(t_s, _)| *t_s <= now_s) {
            return self.due.pop_front().map(|(_, control)| control);
        }
        loop {
            match self.lines.as_ref()?.try_recv() {
                Ok(line) if line.trim().is_empty() => {}
                Ok(line) => return Some(Control::from_line(&line)),
                Err(TryRecvError::Empty) => return None,
                Err(TryRecvError::Disconnected) => self.lines = None,
            }
        }
    }
}

/// Says it to the robot. A sentence that the referee cannot judge the robot does not hear of. `Ok` holds the new task, if it is one.
///
/// # Errors
/// A sentence for the person; what was going on goes on.
pub fn say_to(
    mission: &mut Mission,
    control: &Control,
    building: &Building,
    now: Stamp,
) -> Result<Option<Task>, String> {
    let task = match control {
        Control::Instruct(text) => match Task::read(text, building) {
            Ok(task) => Some(task),
            Err(error) => {
                mission.write_down(control, now, Some(error.to_string()));
                return Err(error.to_string());
            }
        },
        Control::Pause | Control::Resume | Control::Cancel | Control::AskMe | Control::Answer(_) => None,
    };
    mission.control(control, now).map_err(|error| error.to_string())?;
    Ok(task)
}

/// What was said in a run, as a script that says it again.
pub fn script_of(journal: &Journal) -> String {
    journal.controls.iter().map(|said| format!("{said}\n")).collect()
}

/// Whether somebody may be typing: at a terminal, and the program is in its foreground (one in the background would be stopped for reading).
fn is_typed_at() -> bool {
    let is_in_foreground = || {
        // After the name in brackets: state, parent, process group, session, terminal, the terminal's foreground group.
        let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        Some(fields.get(2)? == fields.get(5)?)
    };
    std::io::stdin().is_terminal() && std::io::stderr().is_terminal() && is_in_foreground().unwrap_or(false)
}

/// Lines of standard input, from a thread that ends with the program.
fn standard_input() -> Receiver<String> {
    let (sender, receiver) = std::sync::mpsc::sync_channel(WAITING_LINES);
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            let Ok(line) = line else { return };
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn orders_come_when_they_are_due_or_when_they_are_typed() {
        let mut script = Orders::script("1 pause\n2.5 resume").unwrap();
        assert_eq!(script.next(0.98, false), None);
        assert_eq!((script.next(1.0, false), script.next(1.0, false)), (Some(Control::Pause), None));
        assert_eq!(script.next(9.0, true), Some(Control::Resume));
        let (sender, receiver) = channel();
        let mut typed = Orders::lines(receiver);
        assert_eq!(typed.next(0.0, false), None);
        ["", "  ", "cancel", "find the mug"].iter().for_each(|line| sender.send((*line).to_owned()).unwrap());
        assert_eq!(typed.next(0.1, false), Some(Control::Cancel));
        drop(sender);
        assert_eq!(typed.next(0.1, false), Some(Control::Instruct("find the mug".into())));
        assert_eq!((typed.next(0.1, false), typed.next(0.1, false)), (None, None));
    }

    #[test]
    fn a_patrol_goes_on_to_the_next_errand_whenever_the_robot_rests() {
        let mut patrol = Orders::rounds(vec!["go to the kitchen".into(), "go to the study".into()], 10.0);
        let said = |control: Option<Control>| control.map(|control| control.line().to_owned());
        assert_eq!(said(patrol.next(1.0, false)), None);
        assert_eq!(said(patrol.next(1.0, true)).unwrap(), "go to the kitchen");
        assert_eq!(said(patrol.next(2.0, true)).unwrap(), "go to the study");
        assert_eq!(said(patrol.next(3.0, true)).unwrap(), "go to the kitchen");
        assert_eq!(said(patrol.next(10.0, true)), None);
        assert_eq!(said(Orders::rounds(vec![], 10.0).next(0.0, true)), None);
    }
}
