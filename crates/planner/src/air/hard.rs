//! The slow and careful way through a corridor: convex programs only, each iterate keeps the polynomial limits.
//!
//! Durations are stretched until a program is feasible, then shortened by descent along the multipliers' derivative
//! (`hermite_program.rs`), and stretched again if the proof asks for it (drag).

use super::corridor_flight::{
    CorridorError, CorridorFlight, check, corridor_flight, first_guess, pieces_of, shortfall,
};
use super::hermite_program::best_nodes;
use super::lbfgs::{LbfgsSettings, minimise};
use super::limits::{BoundaryState, FlightLimits};
use super::polytope::Polytope;

/// Rounds of stretching by [`STRETCH`] until a program is feasible.
const STRETCH_ROUNDS: usize = 16;
const STRETCH: f64 = 1.3;
/// Pieces that take longer are not tried (s).
const LONGEST_S: f64 = 1e4;
/// Rounds of stretching by [`PROOF_STRETCH`] until the proof holds.
const PROOF_ROUNDS: usize = 40;
const PROOF_STRETCH: f64 = 1.03;
/// Programs are dear: the descent stops when three iterations gain less than a ten-thousandth.
const DESCENT: LbfgsSettings = LbfgsSettings {
    memory: 12,
    past: 3,
    relative_decrease: 1e-4,
    gradient_tolerance: 0.0,
    max_iterations: 60,
    max_search: 12,
};

/// Like [`super::corridor_flight::fly_corridor`], by convex programs and their multipliers; `steps` counts the programs.
///
/// # Errors
/// [`CorridorError`]. A flight that is not proved is never returned.
pub fn fly_corridor_hard(
    start: &BoundaryState,
    goal: &BoundaryState,
    corridor: &[Polytope],
    limits: &FlightLimits,
) -> Result<CorridorFlight, CorridorError> {
    limits.validate()?;
    let joints = check(start, goal, corridor, limits)?;
    let polytope_of = pieces_of(corridor);
    let faces: Vec<&Polytope> = polytope_of.iter().map(|k| &corridor[*k]).collect();
    let floor_s = limits.min_duration_s;
    let mut programs = 0;
    let mut solve = |durations_s: &[f64]| {
        // The descent may try any step: what no flight takes is not asked.
        if durations_s.iter().any(|t| t.is_nan() || *t >= LONGEST_S) {
            return None;
        }
        programs += 1;
        best_nodes(start, goal, &faces, durations_s, limits)
    };
    // 1. Durations long enough.
    let mut durations_s = first_guess(start, goal, &joints, limits).durations_s;
    let mut round = 0;
    while solve(&durations_s).is_none() {
        round += 1;
        if round == STRETCH_ROUNDS {
            return Err(CorridorError::NotProved {
                limit: "the corridor with any durations tried",
                excess: f64::INFINITY,
            });
        }
        durations_s.iter_mut().for_each(|t| *t *= STRETCH);
    }
    // 2. Descent over ln(T - floor).
    let mut x: Vec<f64> = durations_s.iter().map(|t| (t - floor_s).max(1e-3).ln()).collect();
    minimise(&mut x, &DESCENT, |x, gradient| {
        let durations_s: Vec<f64> = x.iter().map(|x| floor_s + x.exp()).collect();
        let Some(found) = solve(&durations_s) else { return f64::INFINITY };
        for ((g, by), t) in gradient.iter_mut().zip(&found.by_log_duration).zip(&durations_s) {
            *g = (by / t + limits.time_weight) * (t - floor_s);
        }
        found.effort + limits.time_weight * durations_s.iter().sum::<f64>()
    });
    durations_s = x.iter().map(|x| floor_s + x.exp()).collect();
    // 3. The proof; it knows the drag, which the programs do not.
    let mut missed = CorridorError::NotProved { limit: "any limit", excess: f64::NAN };
    for _ in 0..PROOF_ROUNDS {
        if let Some(found) = solve(&durations_s) {
            let flight = corridor_flight(&found.nodes, corridor, &polytope_of, limits);
            if flight.proof.holds {
                return Ok(CorridorFlight { steps: programs, ..flight });
            }
            missed = shortfall(&flight.proof, limits);
        }
        durations_s.iter_mut().for_each(|t| *t *= PROOF_STRETCH);
    }
    Err(missed)
}
