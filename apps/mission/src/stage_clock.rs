//! Where the time goes: CPU time per stage of the loop. It is read by people and never by a decision.

use std::collections::BTreeMap;
use std::time::Duration;

use cpu_time::{ProcessTime, ThreadTime};
use serde::{Deserialize, Serialize};

use crate::time_histogram::TimeHistogram;

/// CPU cost of one stage of the loop.
#[derive(Debug, Clone, Default)]
struct Stage {
    calls: u64,
    total: Duration,
    times: TimeHistogram,
}

/// Figures of one stage, as they appear in `summary.json`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StageFigures {
    /// How often it ran.
    pub calls: u64,
    /// Total CPU time.
    pub cpu_ms_total: f64,
    /// 95th percentile of one call.
    pub cpu_ms_p95: f64,
    /// 99th percentile of one call.
    pub cpu_ms_p99: f64,
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
        entry.times.add(elapsed.as_micros().min(u128::from(u32::MAX)) as u32);
    }

    /// CPU times of a stage so far.
    pub fn times(&self, stage: &str) -> Option<&TimeHistogram> {
        self.stages.get(stage).map(|stage| &stage.times)
    }

    /// Figures of all stages.
    pub fn figures(&self) -> BTreeMap<String, StageFigures> {
        self.stages
            .iter()
            .map(|(name, stage)| {
                let figures = StageFigures {
                    calls: stage.calls,
                    cpu_ms_total: stage.total.as_secs_f64() * 1e3,
                    cpu_ms_p95: stage.times.quantile_us(0.95).unwrap_or(0.0) / 1e3,
                    cpu_ms_p99: stage.times.quantile_us(0.99).unwrap_or(0.0) / 1e3,
                };
                ((*name).to_owned(), figures)
            })
            .collect()
    }
}
