//! A file of forests: boxes in a room, start and goal; limits and vehicle are the usual ones unless `meta` has others.

use std::borrow::Cow;

use anyhow::{Context, Result, ensure};
use arena::mission::planner::{FlightLimits, InteriorSettings, VoxelFlightError, VoxelMap, fly_voxels};
use nalgebra::Point3;
use serde::Deserialize;

use super::corridors::{Outcome, Refusal, Settings};

#[derive(Debug, Deserialize)]
struct File {
    meta: Meta,
    problems: Vec<Problem>,
}

#[derive(Debug, Deserialize)]
struct Meta {
    bounds: [f64; 6],
    voxel: f64,
    dilate_voxels: usize,
    #[serde(flatten)]
    settings: Settings,
}

#[derive(Debug, Deserialize)]
struct Problem {
    id: String,
    start: [f64; 3],
    goal: [f64; 3],
    boxes: Vec<[f64; 6]>,
}

/// A parsed file.
pub struct Forest {
    meta: Meta,
    problems: Vec<Problem>,
}

/// A voxel more is grown round obstacles at most.
const MOST_ROUNDS: usize = 100;

impl Forest {
    pub fn parse(text: &str) -> Result<Self> {
        let File { meta, problems } = serde_json::from_str(text).context("not a file of forests")?;
        ensure!(
            meta.dilate_voxels <= MOST_ROUNDS,
            "meta.dilate_voxels: at most {MOST_ROUNDS}, not {}",
            meta.dilate_voxels
        );
        VoxelMap::free(&low(&meta.bounds), &high(&meta.bounds), meta.voxel).context("meta.bounds, meta.voxel")?;
        Ok(Forest { meta, problems })
    }

    pub fn len(&self) -> usize {
        self.problems.len()
    }

    pub fn settings(&self) -> &Settings {
        &self.meta.settings
    }

    /// Everything from the boxes on.
    pub fn plan(&self, k: usize, limits: &FlightLimits) -> Outcome<'_> {
        let problem = &self.problems[k];
        let mut outcome = Outcome { id: &problem.id, corridor: Cow::Owned(Vec::new()), flight: Err(Refusal::none()) };
        let map = match VoxelMap::free(&low(&self.meta.bounds), &high(&self.meta.bounds), self.meta.voxel) {
            Ok(mut map) => {
                for b in &problem.boxes {
                    map.occupy_box(&low(b), &high(b));
                }
                map.dilated(self.meta.dilate_voxels)
            }
            Err(error) => {
                outcome.flight = Err(Refusal { status: "bad_map", reason: error.to_string() });
                return outcome;
            }
        };
        let (start, goal) = (Point3::from(problem.start), Point3::from(problem.goal));
        match fly_voxels(&map, &start, &goal, limits, &InteriorSettings::default()) {
            Ok(found) => {
                outcome.corridor = Cow::Owned(found.corridor);
                outcome.flight = Ok(found.flight);
            }
            Err(VoxelFlightError::Corridor(error)) => outcome.flight = Err(Refusal::of(&error)),
            Err(error) => {
                let status = match error {
                    VoxelFlightError::StartBlocked => "start_blocked",
                    VoxelFlightError::GoalBlocked => "goal_blocked",
                    VoxelFlightError::NoRoute => "no_route",
                    _ => "no_region",
                };
                outcome.flight = Err(Refusal { status, reason: error.to_string() });
            }
        }
        outcome
    }
}

fn low(b: &[f64; 6]) -> Point3<f64> {
    Point3::new(b[0], b[1], b[2])
}

fn high(b: &[f64; 6]) -> Point3<f64> {
    Point3::new(b[3], b[4], b[5])
}
