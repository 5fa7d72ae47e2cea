//! Flights as others can check them: six coefficients a piece in ascending powers of local time, columns x, y, z.

use serde_json::{Value, json};

use super::corridors::Outcome;

/// Problems without a flight are left out.
pub fn dump<'a>(outcomes: impl Iterator<Item = &'a Outcome<'a>>) -> Value {
    let problems: Vec<Value> = outcomes
        .filter_map(|outcome| {
            let flight = outcome.flight.as_ref().ok()?;
            let pieces = &flight.trajectory.pieces;
            let coefficients: Vec<[f64; 3]> =
                pieces.iter().flat_map(|p| p.coefficients.iter().map(|c| [c.x, c.y, c.z])).collect();
            Some(json!({
                "id": outcome.id,
                "durations": pieces.iter().map(|p| p.duration_s).collect::<Vec<f64>>(),
                "poly_index": flight.polytope_of,
                "coeffs": coefficients,
            }))
        })
        .collect();
    json!({ "problems": problems })
}
