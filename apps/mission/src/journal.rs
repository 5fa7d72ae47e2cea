//! What happened, for people and for replay: every decision in full, curves over time, and where the time went.

use std::collections::BTreeMap;
use std::time::Duration;

use cpu_time::{ProcessTime, ThreadTime};
use serde::Serialize;

/// One decision from prompt to verdict. Serialised as one line of `decisions.jsonl`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DecisionEntry {
    /// Running number from 0.
    pub index: usize,
    /// Seconds since the mission began at which the snapshot was taken.
    pub asked_s: f64,
    /// ... and at which the verdict fell.
    pub decided_s: f64,
    /// Revision of the scene graph in the prompt.
    pub revision: u64,
    /// Revision at which the verdict was given.
    pub verdict_revision: u64,
    /// Which step of the instruction it serves.
    pub step: usize,
    /// Who answered.
    pub reasoner: String,
    /// Full text sent.
    pub prompt: String,
    /// Its tokens.
    pub prompt_tokens: usize,
    /// Full text received, of all tries.
    pub replies: Vec<String>,
    /// Tokens received.
    pub answer_tokens: usize,
    /// The four steps of the reasoning, as `(step, input, output)`.
    pub trace: Vec<TraceEntry>,
    /// The accepted action.
    pub action: String,
    /// `accepted`, or why a proposal was rejected, one line each.
    pub verdicts: Vec<String>,
    /// True if the embedded reasoner had to take the step for a language model.
    pub is_fallback: bool,
    /// Confidence of the reasoner, 0 to 1.
    pub confidence: f64,
    /// Where the robot believed to be: x, y, z, yaw.
    pub pose: [f64; 4],
}

/// One line of a reasoning trace.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TraceEntry {
    /// Name of the step.
    pub step: String,
    /// What it looked at.
    pub input: String,
    /// What it concluded.
    pub output: String,
}

/// A sample of the curves of a run (5 Hz).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct CurveSample {
    /// Seconds since the mission began.
    pub t_s: f64,
    /// Estimated position and heading.
    pub pose: [f64; 4],
    /// Estimated speed.
    pub speed_mps: f64,
    /// Distance from the robot's outline to the nearest obstacle of the last scans.
    pub clearance_m: f64,
    /// Tokens sent so far.
    pub prompt_tokens: usize,
    /// Objects in the graph.
    pub objects: usize,
    /// Rooms in the graph.
    pub rooms: usize,
}

/// CPU cost of one stage of the loop.
#[derive(Debug, Clone, Default)]
struct Stage {
    calls: u64,
    total: Duration,
    samples_us: Vec<u32>,
}

/// Figures of one stage, as they appear in `summary.json`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct StageFigures {
    /// How often it ran.
    pub calls: u64,
    /// Total CPU time.
    pub cpu_ms_total: f64,
    /// 95th percentile of one call.
    pub cpu_ms_p95: f64,
}

/// Whose CPU time counts as that of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum CpuScope {
    /// All threads: one run has the process for itself.
    #[default]
    Process,
    /// This thread: several runs share the process, each in a thread of its own.
    Thread,
}

/// A moment on the CPU clock of a [`CpuScope`].
#[derive(Debug, Clone, Copy)]
pub enum CpuMoment {
    /// Of the process.
    Process(ProcessTime),
    /// Of the thread.
    Thread(ThreadTime),
}

impl CpuScope {
    /// The moment now.
    pub fn now(self) -> CpuMoment {
        match self {
            CpuScope::Process => CpuMoment::Process(ProcessTime::now()),
            CpuScope::Thread => CpuMoment::Thread(ThreadTime::now()),
        }
    }
}

impl CpuMoment {
    /// CPU time used since; asked in the same thread.
    pub fn elapsed(&self) -> Duration {
        match self {
            CpuMoment::Process(start) => start.elapsed(),
            CpuMoment::Thread(start) => start.elapsed(),
        }
    }
}

/// CPU time per stage. Reads the clock and therefore never feeds back into anything the robot decides.
#[derive(Debug, Clone, Default)]
pub struct StageClock {
    scope: CpuScope,
    stages: BTreeMap<&'static str, Stage>,
}

impl StageClock {
    /// A clock that counts the time of `scope`.
    pub fn new(scope: CpuScope) -> StageClock {
        StageClock { scope, stages: BTreeMap::new() }
    }

    /// Runs `work` and books its time on `stage`.
    pub fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = self.scope.now();
        let result = work();
        self.book(stage, start.elapsed());
        result
    }

    /// Books a time on `stage`.
    pub fn book(&mut self, stage: &'static str, elapsed: Duration) {
        let entry = self.stages.entry(stage).or_default();
        entry.calls += 1;
        entry.total += elapsed;
        entry.samples_us.push(elapsed.as_micros().min(u128::from(u32::MAX)) as u32);
    }

    /// Figures of all stages.
    pub fn figures(&self) -> BTreeMap<String, StageFigures> {
        self.stages
            .iter()
            .map(|(name, stage)| {
                let mut samples = stage.samples_us.clone();
                samples.sort_unstable();
                let p95 = samples.get((samples.len() * 95 / 100).min(samples.len().saturating_sub(1))).copied();
                let figures = StageFigures {
                    calls: stage.calls,
                    cpu_ms_total: stage.total.as_secs_f64() * 1e3,
                    cpu_ms_p95: f64::from(p95.unwrap_or(0)) / 1e3,
                };
                ((*name).to_owned(), figures)
            })
            .collect()
    }
}

/// Everything that the robot's side writes down.
#[derive(Debug, Clone, Default)]
pub struct Journal {
    /// Decisions in order.
    pub decisions: Vec<DecisionEntry>,
    /// Curves.
    pub curves: Vec<CurveSample>,
    /// Where the time went.
    pub clock: StageClock,
    /// Things worth telling a person, with their time: a sensor that was ignored, a model that did not answer.
    pub notes: Vec<(f64, String)>,
}

impl Journal {
    /// Tokens sent in all prompts.
    pub fn prompt_tokens(&self) -> usize {
        self.decisions.iter().map(|decision| decision.prompt_tokens).sum()
    }

    /// Tokens received in all answers.
    pub fn answer_tokens(&self) -> usize {
        self.decisions.iter().map(|decision| decision.answer_tokens).sum()
    }
}
