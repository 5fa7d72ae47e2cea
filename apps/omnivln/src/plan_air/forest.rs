//! A file of forests: boxes in a room, start and goal; limits and vehicle are the usual ones unless `meta` has others.

use std::borrow::Cow;

use anyhow::{Context, Result, ensure};
use arena::mission::planner::{
    FlightLimits, InteriorSettings, PolynomialTrajectory, VoxelFlightError, VoxelMap, VoxelMapError, fly_voxels,
};
use nalgebra::Point3;
use serde::Deserialize;

use super::corridors::{Outcome, Refusal, Settings};
use super::flown::{Flown, fly};

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

    /// Everything from the boxes on. The flight keeps `margin_m` from grown voxels.
    pub fn plan(&self, k: usize, limits: &FlightLimits, margin_m: f64) -> Outcome<'_> {
        let problem = &self.problems[k];
        let mut outcome = Outcome { id: &problem.id, corridor: Cow::Owned(Vec::new()), flight: Err(Refusal::none()) };
        let map = match self.map(problem) {
            Ok(map) => map,
            Err(error) => {
                outcome.flight = Err(Refusal { status: "bad_map", reason: error.to_string() });
                return outcome;
            }
        };
        let (start, goal) = (Point3::from(problem.start), Point3::from(problem.goal));
        match fly_voxels(&map, &start, &goal, margin_m, limits, &InteriorSettings::default()) {
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
                    VoxelFlightError::BadMargin { .. } => "bad_margin",
                    _ => "no_region",
                };
                outcome.flight = Err(Refusal { status, reason: error.to_string() });
            }
        }
        outcome
    }

    /// Flies a plan of problem `k` in the simulation.
    pub fn fly(&self, k: usize, trajectory: &PolynomialTrajectory) -> Result<Flown> {
        let problem = &self.problems[k];
        let boxes: Vec<_> = problem.boxes.iter().map(|b| (low(b), high(b))).collect();
        // What is grown is grown for the body; a voxel less, since a box may reach half a voxel beyond its own.
        let radius_m = self.meta.dilate_voxels.saturating_sub(1) as f64 * self.meta.voxel;
        fly(trajectory, &self.meta.settings.airframe(), &boxes, radius_m, &self.map(problem)?)
    }

    /// The voxels of a problem, grown.
    fn map(&self, problem: &Problem) -> Result<VoxelMap, VoxelMapError> {
        let mut map = VoxelMap::free(&low(&self.meta.bounds), &high(&self.meta.bounds), self.meta.voxel)?;
        for b in &problem.boxes {
            map.occupy_box(&low(b), &high(b));
        }
        Ok(map.dilated(self.meta.dilate_voxels))
    }
}

fn low(b: &[f64; 6]) -> Point3<f64> {
    Point3::new(b[0], b[1], b[2])
}

fn high(b: &[f64; 6]) -> Point3<f64> {
    Point3::new(b[3], b[4], b[5])
}
