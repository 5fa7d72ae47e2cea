//! `--buildings` and `--plans`: what a bench draws its buildings from.

use std::path::PathBuf;

use anyhow::{Result, ensure};
use arena::buildings::{Buildings, Turns};
use arena::omni_sim::cooccurrence::Cooccurrence;
use clap::{Args, ValueEnum};

/// Which buildings.
#[derive(Debug, Args)]
pub struct BuildingOptions {
    /// Where the buildings come from
    #[arg(long, value_enum, default_value_t = Source::Generated)]
    buildings: Source,
    /// Floor plans and scenes: files (FILE.png, with FILE_gt_segmentation.png its rooms), or folders of them
    #[arg(long, value_name = "PATH", num_args = 1..)]
    plans: Vec<PathBuf>,
}

/// Where buildings come from, and what stands in them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Source {
    /// Our generator, furnished as people do; with --plans the files instead
    Generated,
    /// The same, the furniture of the kinds of rooms exchanged
    Shuffled,
    /// The same, any furniture in any room
    Uniform,
    /// Every second building from the files of --plans, furnished in these three ways in turn
    Mixed,
}

impl BuildingOptions {
    /// Reads the files.
    pub fn read(&self) -> Result<Buildings> {
        let turns = match self.buildings {
            Source::Mixed => Turns::Mixed,
            _ if self.plans.is_empty() => Turns::Generated,
            _ => Turns::Files,
        };
        ensure!(turns != Turns::Mixed || !self.plans.is_empty(), "--buildings mixed needs --plans");
        let cooccurrence = match self.buildings {
            Source::Generated | Source::Mixed => Cooccurrence::Usual,
            Source::Shuffled => Cooccurrence::Shuffled,
            Source::Uniform => Cooccurrence::Uniform,
        };
        Buildings::new(cooccurrence, turns, &self.plans)
    }
}
