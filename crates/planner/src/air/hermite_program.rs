//! The best flight for given durations as one convex program, and the price of each duration (clarabel).
//!
//! ```text
//! min over nodes  sum_i E_i   such that  Bernstein points in the polytopes, |velocity points| <= v_max,
//!                             |acceleration points| <= a_max,  and without drag, on the acceleration points a + g e3:
//!                             |.| <= f_max / m,  |horizontal part| <= tan(tilt) vertical part,  vertical part >= f_min / m,
//!                             |jerk points| <= rate f_min / m          (turning is at most jerk over thrust)
//! ```
//! Everything is linear or a second-order cone in the nodes, so what it finds keeps the polynomial limits at every instant;
//! the rotor limits are kept but for the drag, which the proof adds. Its multipliers give the derivative of the optimum by
//! the durations (envelope theorem): enough for a descent over durations in which every iterate is feasible.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::Vector3;

use super::interior::Nodes;
use super::limits::{BoundaryState, FlightLimits};
use super::node_form::{ACCELERATION, JERK, POSITION, VELOCITY_HULL, effort_entry};
use super::polytope::Polytope;

/// Interior-point iterations at most.
const MAX_ITERATIONS: u32 = 80;
/// Faces are moved inward by this (m), and cones shrunk by this share, to cover the tolerance of the solver.
const INWARD: f64 = 1e-6;

/// An optimum for given durations.
#[derive(Debug, Clone)]
pub(crate) struct ProgramSolution {
    pub nodes: Nodes,
    /// Effort.
    pub effort: f64,
    /// Its derivative by the logarithm of each duration.
    pub by_log_duration: Vec<f64>,
}

/// A vector that is linear in the six of a piece, in a cone or behind faces.
struct Row {
    piece: usize,
    /// Coefficients of the six vectors, and their powers of T.
    unit: [f64; 6],
    derivative: i32,
    /// Per axis of the vector.
    weight: Vector3<f64>,
    constant: f64,
    /// Sign: `constant - weight . vector` is the entry of the slack.
    scale_power: i32,
}

/// Solves for `durations_s`; `None` if the limits cannot be kept in these durations, or the solver fails.
pub(crate) fn best_nodes(
    start: &BoundaryState,
    goal: &BoundaryState,
    corridor: &[&Polytope],
    durations_s: &[f64],
    limits: &FlightLimits,
) -> Option<ProgramSolution> {
    let pieces = durations_s.len();
    let inner = pieces - 1;
    // Scaled by the mean duration, velocity and acceleration have the size of positions.
    let unit_s = durations_s.iter().sum::<f64>() / pieces as f64;
    let (rows, cones) = constraints(corridor, pieces, limits);
    let given = |node: usize, k: usize| if node == 0 { start[k] } else { goal[k] };
    let column = |node: usize, k: usize, axis: usize| 9 * (node - 1) + 3 * k + axis;
    let scale = |k: usize| unit_s.powi(-(k as i32));
    // Constraints.
    let mut columns: Vec<Vec<(usize, f64)>> = vec![Vec::new(); 9 * inner];
    let mut b = Vec::with_capacity(rows.len());
    for (at, row) in rows.iter().enumerate() {
        let t = durations_s[row.piece];
        let size = t.powi(row.scale_power);
        let mut constant = row.constant;
        for six in 0..6 {
            let (node, k) = (row.piece + six / 3, six % 3);
            let c = row.unit[six] * t.powi(k as i32 - row.derivative);
            if c == 0.0 {
                continue;
            }
            for axis in 0..3 {
                let entry = c * row.weight[axis];
                if entry == 0.0 {
                    continue;
                }
                if node == 0 || node == pieces {
                    constant -= entry * given(node, k)[axis];
                } else {
                    columns[column(node, k, axis)].push((at, entry * scale(k) * size));
                }
            }
        }
        b.push(constant * size);
    }
    let a = csc(rows.len(), columns);
    // Effort: x^T H x / 2 + q^T x.
    let mut columns: Vec<Vec<(usize, f64)>> = vec![Vec::new(); 9 * inner];
    let mut q = vec![0.0; 9 * inner];
    for (piece, t) in durations_s.iter().enumerate() {
        for first in 0..6 {
            for second in 0..6 {
                let entry = 2.0 * effort_entry(first, second) * t.powi((first % 3 + second % 3) as i32 - 5);
                let (n1, k1) = (piece + first / 3, first % 3);
                let (n2, k2) = (piece + second / 3, second % 3);
                if n1 == 0 || n1 == pieces {
                    continue;
                }
                for axis in 0..3 {
                    let at = column(n1, k1, axis);
                    if n2 == 0 || n2 == pieces {
                        q[at] += entry * scale(k1) * given(n2, k2)[axis];
                    } else if at <= column(n2, k2, axis) {
                        columns[column(n2, k2, axis)].push((at, entry * scale(k1) * scale(k2)));
                    }
                }
            }
        }
    }
    let p = csc(9 * inner, columns);
    let settings = DefaultSettingsBuilder::default().verbose(false).max_iter(MAX_ITERATIONS).build().ok()?;
    let mut solver = DefaultSolver::<f64>::new(&p, &q, &a, &b, &cones, settings).ok()?;
    solver.solve();
    if !matches!(solver.solution.status, SolverStatus::Solved) {
        return None;
    }
    let x = &solver.solution.x;
    let mut states = vec![*start];
    for node in 1..pieces {
        states.push(std::array::from_fn(|k| Vector3::from_fn(|axis, _| x[column(node, k, axis)] * scale(k))));
    }
    states.push(*goal);
    // Envelope: d/dtheta of effort + z . (A x - b), with the nodes and the multipliers as they are.
    let (mut effort, mut by) = (0.0, vec![0.0; pieces]);
    let vector = |piece: usize, six: usize| states[piece + six / 3][six % 3];
    for (piece, t) in durations_s.iter().enumerate() {
        for first in 0..6 {
            for second in 0..6 {
                let power = (first % 3 + second % 3) as i32 - 5;
                let term =
                    effort_entry(first, second) * t.powi(power) * vector(piece, first).dot(&vector(piece, second));
                effort += term;
                by[piece] += f64::from(power) * term;
            }
        }
    }
    for (row, z) in rows.iter().zip(&solver.solution.z) {
        let t = durations_s[row.piece];
        let size = t.powi(row.scale_power);
        by[row.piece] -= z * size * f64::from(row.scale_power) * row.constant;
        for six in 0..6 {
            let power = (six % 3) as i32 - row.derivative;
            let c = row.unit[six] * t.powi(power);
            let value = row.weight.dot(&vector(row.piece, six));
            by[row.piece] += z * size * f64::from(power + row.scale_power) * c * value;
        }
    }
    Some(ProgramSolution { nodes: Nodes { states, durations_s: durations_s.to_vec() }, effort, by_log_duration: by })
}

/// All rows `constant - weight . vector`, and the cones they lie in.
fn constraints(corridor: &[&Polytope], pieces: usize, limits: &FlightLimits) -> (Vec<Row>, Vec<SupportedConeT<f64>>) {
    let (mut rows, mut cones) = (Vec::new(), Vec::new());
    let p_start = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let p_end = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    for piece in 0..pieces {
        let has_start = (piece > 0).then_some(p_start);
        let has_end = (piece + 1 < pieces).then_some(p_end);
        let points = POSITION.iter().copied().chain(has_start).chain(has_end);
        let before = rows.len();
        for unit in points {
            for face in &corridor[piece].faces {
                let constant = face.offset_m - INWARD;
                rows.push(Row { piece, unit, derivative: 0, weight: face.normal, constant, scale_power: 0 });
            }
        }
        cones.push(SupportedConeT::NonnegativeConeT(rows.len() - before));
        let mut ball = |unit: [f64; 6], derivative: i32, radius: f64, lift: f64| {
            if !radius.is_finite() {
                return;
            }
            // In units of T^derivative nothing is large or small.
            let row = |weight, constant| Row { piece, unit, derivative, weight, constant, scale_power: derivative };
            rows.push(row(Vector3::zeros(), radius * (1.0 - INWARD)));
            for axis in 0..3 {
                let mut weight = Vector3::zeros();
                weight[axis] = -1.0;
                rows.push(row(weight, if axis == 2 { lift } else { 0.0 }));
            }
            cones.push(SupportedConeT::SecondOrderConeT(4));
        };
        let v_start = (piece > 0).then_some([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        for unit in VELOCITY_HULL.iter().copied().chain(v_start) {
            ball(unit, 1, limits.max_speed_mps, 0.0);
        }
        let a_start = (piece > 0).then_some([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        let accelerations: Vec<[f64; 6]> = ACCELERATION.iter().copied().chain(a_start).collect();
        for unit in &accelerations {
            ball(*unit, 2, limits.max_accel_mps2, 0.0);
        }
        let Some(airframe) = &limits.airframe else { continue };
        let least = limits.min_thrust_n.max(0.05 * limits.thrust_scale_n()) / airframe.mass_kg;
        for unit in &accelerations {
            ball(*unit, 2, limits.max_thrust_n / airframe.mass_kg, airframe.gravity_mps2);
        }
        for unit in &JERK {
            ball(*unit, 3, limits.max_rate_radps * least, 0.0);
        }
        for unit in &accelerations {
            let row = |weight, constant| Row { piece, unit: *unit, derivative: 2, weight, constant, scale_power: 2 };
            let tan = limits.max_tilt_rad.tan();
            rows.push(row(Vector3::new(0.0, 0.0, -tan), tan * airframe.gravity_mps2 * (1.0 - INWARD)));
            rows.push(row(Vector3::new(-1.0, 0.0, 0.0), 0.0));
            rows.push(row(Vector3::new(0.0, -1.0, 0.0), 0.0));
            cones.push(SupportedConeT::SecondOrderConeT(3));
            rows.push(row(Vector3::new(0.0, 0.0, -1.0), airframe.gravity_mps2 - least));
            cones.push(SupportedConeT::NonnegativeConeT(1));
        }
    }
    (rows, cones)
}

fn csc(rows: usize, columns: Vec<Vec<(usize, f64)>>) -> CscMatrix<f64> {
    let (mut starts, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    let count = columns.len();
    for mut column in columns {
        column.sort_by_key(|(row, _)| *row);
        for (row, value) in column {
            // Several pieces add to one entry.
            if indices.len() > starts[starts.len() - 1] && indices.last() == Some(&row) {
                if let Some(last) = values.last_mut() {
                    *last += value;
                }
            } else {
                indices.push(row);
                values.push(value);
            }
        }
        starts.push(indices.len());
    }
    CscMatrix::new(rows, count, starts, indices, values)
}
