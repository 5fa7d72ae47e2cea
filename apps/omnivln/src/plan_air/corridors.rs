//! A file of corridors: limits and vehicle in `meta`, and problems of `polytopes` (rows nx, ny, nz, d with `n.x + d <= 0`),
//! `start` and `goal`.

use std::borrow::Cow;

use anyhow::{Context, Result};
use arena::mission::planner::{
    Airframe, CorridorError, CorridorFlight, FlightLimits, HalfSpace, InteriorSettings, Polytope, fly_corridor,
    fly_corridor_hard, prove,
};
use nalgebra::Vector3;
use serde::Deserialize;

/// No piece is shorter: shorter ones save nothing worth having and make the spline stiff.
const DURATION_FLOOR_S: f64 = 0.05;
/// The agile profile.
const AGILE_SPEED_MPS: f64 = 12.0;
const AGILE_TIME_WEIGHT: f64 = 500.0;

#[derive(Debug, Deserialize)]
struct File {
    meta: Settings,
    problems: Vec<Problem>,
}

/// Limits, vehicle and weights; what is not said is the usual.
#[derive(Debug, Deserialize)]
pub struct Settings {
    #[serde(default)]
    limits: Limits,
    #[serde(default)]
    vehicle: Vehicle,
    #[serde(default)]
    weights: Weights,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
struct Limits {
    v_max: f64,
    omega_max: f64,
    tilt_max: f64,
    thrust_min: f64,
    thrust_max: f64,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
struct Vehicle {
    mass: f64,
    g: f64,
    drag_h: f64,
    drag_v: f64,
    drag_parasitic: f64,
    speed_eps: f64,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
struct Weights {
    rho_time: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { v_max: 4.0, omega_max: 2.1, tilt_max: 1.05, thrust_min: 2.0, thrust_max: 12.0 }
    }
}

impl Default for Vehicle {
    fn default() -> Self {
        Vehicle { mass: 0.61, g: 9.8, drag_h: 0.7, drag_v: 0.8, drag_parasitic: 0.01, speed_eps: 1e-4 }
    }
}

impl Default for Weights {
    fn default() -> Self {
        Weights { rho_time: 20.0 }
    }
}

#[derive(Debug, Deserialize)]
struct Problem {
    id: String,
    start: State,
    goal: State,
    polytopes: Vec<Vec<[f64; 4]>>,
}

#[derive(Debug, Deserialize)]
struct State {
    p: [f64; 3],
    v: [f64; 3],
    a: [f64; 3],
}

/// A parsed file.
pub struct Corridors {
    meta: Settings,
    problems: Vec<(Problem, Vec<Polytope>)>,
}

/// What came of one problem.
pub struct Outcome<'a> {
    pub id: &'a str,
    pub corridor: Cow<'a, [Polytope]>,
    pub flight: Result<CorridorFlight, Refusal>,
}

/// Why there is no flight.
pub struct Refusal {
    /// A word for programs.
    pub status: &'static str,
    /// A sentence for people.
    pub reason: String,
}

impl Refusal {
    pub fn of(error: &CorridorError) -> Self {
        let status = match error {
            CorridorError::Limits(_) => "bad_limits",
            CorridorError::BadPolytope { .. } => "bad_polytope",
            CorridorError::Empty => "empty_corridor",
            CorridorError::NotFinite => "not_finite",
            CorridorError::StartOutside { .. } => "start_outside",
            CorridorError::GoalOutside { .. } => "goal_outside",
            CorridorError::TooFast { .. } => "too_fast",
            CorridorError::NoOverlap { .. } => "no_overlap",
            CorridorError::NotProved { .. } => "not_proved",
        };
        Refusal { status, reason: error.to_string() }
    }

    /// Not planned yet.
    pub fn none() -> Self {
        Refusal { status: "not_planned", reason: String::new() }
    }
}

impl Settings {
    pub fn airframe(&self) -> Airframe {
        let vehicle = &self.vehicle;
        Airframe {
            mass_kg: vehicle.mass,
            gravity_mps2: vehicle.g,
            drag_across: vehicle.drag_h,
            drag_along: vehicle.drag_v,
            drag_parasitic: vehicle.drag_parasitic,
            speed_epsilon: vehicle.speed_eps,
        }
    }

    pub fn limits(&self, is_agile: bool) -> FlightLimits {
        let Settings { limits, weights, .. } = self;
        FlightLimits {
            max_speed_mps: if is_agile { AGILE_SPEED_MPS } else { limits.v_max },
            max_accel_mps2: f64::INFINITY,
            airframe: Some(self.airframe()),
            max_tilt_rad: limits.tilt_max,
            max_rate_radps: limits.omega_max,
            min_thrust_n: limits.thrust_min,
            max_thrust_n: limits.thrust_max,
            min_duration_s: DURATION_FLOOR_S,
            time_weight: if is_agile { AGILE_TIME_WEIGHT } else { weights.rho_time },
        }
    }
}

impl Outcome<'_> {
    /// The proof once more, to be timed.
    pub fn prove_again(&self, limits: &FlightLimits) -> bool {
        let Ok(flight) = &self.flight else { return false };
        std::hint::black_box(prove(&flight.trajectory, &self.corridor, &flight.polytope_of, limits)).holds
    }
}

impl Corridors {
    pub fn parse(text: &str) -> Result<Self> {
        let File { meta, problems } = serde_json::from_str(text).context("not a file of corridors")?;
        let problems = problems
            .into_iter()
            .map(|problem| {
                let corridor = problem.polytopes.iter().map(|rows| polytope(rows)).collect();
                (problem, corridor)
            })
            .collect();
        Ok(Corridors { meta, problems })
    }

    pub fn len(&self) -> usize {
        self.problems.len()
    }

    pub fn settings(&self) -> &Settings {
        &self.meta
    }

    pub fn plan(&self, k: usize, limits: &FlightLimits, is_hard: bool) -> Outcome<'_> {
        let (problem, corridor) = &self.problems[k];
        let state = |s: &State| [Vector3::from(s.p), Vector3::from(s.v), Vector3::from(s.a)];
        let (start, goal) = (state(&problem.start), state(&problem.goal));
        let flight = if is_hard {
            fly_corridor_hard(&start, &goal, corridor, limits)
        } else {
            fly_corridor(&start, &goal, corridor, limits, &InteriorSettings::default())
        };
        let flight = flight.map_err(|error| Refusal::of(&error));
        Outcome { id: &problem.id, corridor: Cow::Borrowed(corridor), flight }
    }
}

/// Rows may be scaled and rounded; faces have unit normals. A row without direction stays as it is, and is refused later.
fn polytope(rows: &[[f64; 4]]) -> Polytope {
    let face = |row: &[f64; 4]| {
        let normal = Vector3::new(row[0], row[1], row[2]);
        let length = normal.norm();
        HalfSpace { normal: normal / length, offset_m: -row[3] / length }
    };
    Polytope { faces: rows.iter().map(face).collect() }
}
