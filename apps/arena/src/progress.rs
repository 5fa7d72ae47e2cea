//! Progress on stderr: a line that moves on a terminal, a line per piece of news in a file or a pipe.

use mission::mission::Mission;
use std::io::IsTerminal;
use std::time::Duration;

/// What a person may want to see while it runs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Progress {
    /// Simulated time.
    pub sim_s: f64,
    /// What the robot is doing.
    pub activity: String,
    /// Rooms known.
    pub rooms: usize,
    /// Objects known.
    pub objects: usize,
    /// Decisions taken.
    pub decisions: usize,
    /// Way left to the present goal.
    pub left_m: f64,
    /// True when the activity changed since the last report.
    pub is_news: bool,
}

impl Progress {
    /// What is known now.
    pub fn of(mission: &Mission) -> Progress {
        Progress {
            rooms: mission.world.graph.rooms().count(),
            objects: mission.world.graph.confirmed_objects().count(),
            decisions: mission.journal.decisions.len(),
            left_m: mission.distance_left_m(),
            ..Progress::default()
        }
    }
}

use indicatif::{ProgressBar, ProgressStyle};

/// Where progress is shown. Nothing of it ever reaches stdout.
#[derive(Debug)]
pub struct ProgressView {
    bar: ProgressBar,
    is_quiet: bool,
    is_terminal: bool,
}

impl ProgressView {
    /// A view in the style of an indicatif template over `length` steps; `is_quiet` shows nothing.
    pub fn new(length: u64, template: &str, is_quiet: bool) -> ProgressView {
        let is_terminal = std::io::stderr().is_terminal();
        let bar = if is_quiet || !is_terminal { ProgressBar::hidden() } else { ProgressBar::new(length) };
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        if is_terminal && !is_quiet {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        ProgressView { bar, is_quiet, is_terminal }
    }

    /// How far it is, and in words. Without a terminal only `is_news` is written.
    pub fn show(&self, position: u64, line: &str, is_news: bool) {
        if self.is_terminal {
            self.bar.set_position(position);
            self.bar.set_message(line.to_owned());
        } else if is_news {
            self.say(line);
        }
    }

    /// A line that stays.
    pub fn say(&self, line: &str) {
        match (self.is_quiet, self.is_terminal) {
            (true, _) => {}
            (false, true) => self.bar.println(line),
            (false, false) => eprintln!("{line}"),
        }
    }

    /// Takes the moving line away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
