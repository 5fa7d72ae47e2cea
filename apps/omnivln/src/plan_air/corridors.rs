//! A file of corridors: limits and vehicle in `meta`, and problems of `polytopes` (rows nx, ny, nz, d with `n.x + d <= 0`),
//! `start` and `goal`.

use anyhow::{Context, Result};
use arena::mission::planner::{
    Airframe, CorridorError, CorridorFlight, FlightLimits, HalfSpace, InteriorSettings, Polytope, fly_corridor, prove,
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
    meta: Meta,
    problems: Vec<Problem>,
}

#[derive(Debug, Deserialize)]
struct Meta {
    limits: Limits,
    vehicle: Vehicle,
    weights: Weights,
}

#[derive(Debug, Deserialize)]
struct Limits {
    v_max: f64,
    omega_max: f64,
    tilt_max: f64,
    thrust_min: f64,
    thrust_max: f64,
}

#[derive(Debug, Deserialize)]
struct Vehicle {
    mass: f64,
    g: f64,
    drag_h: f64,
    drag_v: f64,
    drag_parasitic: f64,
    speed_eps: f64,
}

#[derive(Debug, Deserialize)]
struct Weights {
    rho_time: f64,
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
    meta: Meta,
    problems: Vec<(Problem, Vec<Polytope>)>,
}

/// What came of one problem.
pub struct Outcome<'a> {
    pub id: &'a str,
    pub corridor: &'a [Polytope],
    pub flight: Result<CorridorFlight, CorridorError>,
}

impl Outcome<'_> {
    /// The proof once more, to be timed.
    pub fn prove_again(&self, limits: &FlightLimits) -> bool {
        let Ok(flight) = &self.flight else { return false };
        std::hint::black_box(prove(&flight.trajectory, self.corridor, &flight.polytope_of, limits)).holds
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

    pub fn limits(&self, is_agile: bool) -> FlightLimits {
        let Meta { limits, vehicle, weights } = &self.meta;
        FlightLimits {
            max_speed_mps: if is_agile { AGILE_SPEED_MPS } else { limits.v_max },
            max_accel_mps2: f64::INFINITY,
            airframe: Some(Airframe {
                mass_kg: vehicle.mass,
                gravity_mps2: vehicle.g,
                drag_across: vehicle.drag_h,
                drag_along: vehicle.drag_v,
                drag_parasitic: vehicle.drag_parasitic,
                speed_epsilon: vehicle.speed_eps,
            }),
            max_tilt_rad: limits.tilt_max,
            max_rate_radps: limits.omega_max,
            min_thrust_n: limits.thrust_min,
            max_thrust_n: limits.thrust_max,
            min_duration_s: DURATION_FLOOR_S,
            time_weight: if is_agile { AGILE_TIME_WEIGHT } else { weights.rho_time },
        }
    }

    pub fn plan(&self, k: usize, limits: &FlightLimits) -> Outcome<'_> {
        let (problem, corridor) = &self.problems[k];
        let state = |s: &State| [Vector3::from(s.p), Vector3::from(s.v), Vector3::from(s.a)];
        let flight =
            fly_corridor(&state(&problem.start), &state(&problem.goal), corridor, limits, &InteriorSettings::default());
        Outcome { id: &problem.id, corridor, flight }
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
