//! The best flight through a corridor, strictly inside every limit: Newton's method on a barrier over the nodes.
//!
//! ```text
//! min over x, T of  sum_i integral |p_i'''|^2 dt + rho sum_i T_i       x: position, velocity, acceleration at the inner nodes
//! such that  Bernstein points of p_i   in polytope i                   for all t, by the convex hull of the points
//!            Bernstein points of p_i'  in the ball of the speed limit  for all t
//!            tilt, thrust and body rate with drag at samples           the certificate checks what lies between
//! ```
//! Every piece is a quintic between two nodes, so every term knows one piece: the Hessian is block tridiagonal with one block
//! of 9 for each node, once the duration of each piece (as `theta = ln T`) is eliminated inside the piece. One Newton step is
//! linear in the number of pieces, and the number of steps hardly depends on it.
//!
//! For fixed durations all of it but the rotor limits is convex; only `theta` can bend the wrong way, so it alone is damped
//! until the factorisation succeeds. The barrier is a logarithm that goes over into a parabola at a small slack: it is defined
//! everywhere, so the start need not be inside anything.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use super::barrier::Barrier;
use super::limits::{BoundaryState, FlightLimits};
use super::node_form::{Ends, Local};
use super::piece_cost::{PieceCost, Place, Tighten};
use super::polytope::Polytope;

/// Stages at most, whatever the settings say.
const STAGES: usize = 100;

/// How the barrier shrinks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InteriorSettings {
    /// Weight of the barrier at first, as a share of the cost per piece.
    pub first_weight: f64,
    /// Weight of the barrier at last, as a share of the cost per piece.
    pub last_weight: f64,
    /// What one stage leaves of it, below 1.
    pub shrink: f64,
    /// Newton steps in one stage at most.
    pub stage_steps: usize,
    /// A stage ends when a step promises less than this many barrier weights a piece.
    pub stage_gain: f64,
    /// The same for the last stage.
    pub last_gain: f64,
    /// Slack below which the logarithm becomes a parabola, at first (m, or share of a limit).
    pub first_softness: f64,
    /// The same at last.
    pub last_softness: f64,
}

impl Default for InteriorSettings {
    fn default() -> Self {
        InteriorSettings {
            first_weight: 0.03,
            last_weight: 1e-6,
            shrink: 0.15,
            stage_steps: 25,
            stage_gain: 0.1,
            last_gain: 0.05,
            first_softness: 0.05,
            last_softness: 1e-6,
        }
    }
}

/// Nodes and durations of a flight.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Nodes {
    /// Position, velocity, acceleration at every node, start and goal included.
    pub states: Vec<BoundaryState>,
    /// Duration of each piece (s).
    pub durations_s: Vec<f64>,
}

/// Improves `nodes` for one polytope a piece; the number of Newton steps. `tighten` is taken off every limit and every face: rooms
/// for rounding, and for what the samples do not see (m, and shares of the limits).
pub(crate) fn optimise(
    nodes: &mut Nodes,
    corridor: &[&Polytope],
    limits: &FlightLimits,
    tighten: Tighten,
    settings: &InteriorSettings,
) -> usize {
    let mut solver = Solver::new(nodes, corridor, limits, tighten);
    let steps = solver.run(settings);
    nodes.states.copy_from_slice(&solver.states);
    for (t, theta) in nodes.durations_s.iter_mut().zip(&solver.theta) {
        // The barrier of the shortest duration gives way by less than its softness.
        *t = theta.exp().max(limits.min_duration_s);
    }
    steps
}

type Matrix9 = nalgebra::SMatrix<f64, 9, 9>;
type Vector9 = nalgebra::SVector<f64, 9>;

struct Solver<'a> {
    corridor: &'a [&'a Polytope],
    limits: &'a FlightLimits,
    cost: PieceCost<'a>,
    states: Vec<BoundaryState>,
    theta: Vec<f64>,
    locals: Vec<Local>,
    trial_states: Vec<BoundaryState>,
    trial_theta: Vec<f64>,
    from_states: Vec<BoundaryState>,
    from_theta: Vec<f64>,
    step_states: Vec<Vector9>,
    step_theta: Vec<f64>,
    diagonal: Vec<Matrix9>,
    below: Vec<Matrix9>,
    damping: f64,
}

impl<'a> Solver<'a> {
    fn new(nodes: &Nodes, corridor: &'a [&'a Polytope], limits: &'a FlightLimits, tighten: Tighten) -> Self {
        let pieces = nodes.durations_s.len();
        let floor = limits.min_duration_s;
        Solver {
            corridor,
            limits,
            cost: PieceCost::new(limits, tighten),
            states: nodes.states.clone(),
            theta: nodes.durations_s.iter().map(|t| t.max(1.05 * floor).ln()).collect(),
            locals: vec![Local::zero(); pieces],
            trial_states: nodes.states.clone(),
            trial_theta: nodes.durations_s.clone(),
            from_states: nodes.states.clone(),
            from_theta: nodes.durations_s.clone(),
            step_states: vec![Vector9::zeros(); pieces + 1],
            step_theta: vec![0.0; pieces],
            diagonal: vec![Matrix9::zeros(); pieces + 1],
            below: vec![Matrix9::zeros(); pieces + 1],
            damping: 0.0,
        }
    }

    /// Newton steps of all stages.
    fn run(&mut self, settings: &InteriorSettings) -> usize {
        let pieces = self.theta.len() as f64;
        let unit = self.limits.time_weight * self.theta.iter().map(|t| t.exp()).sum::<f64>() / pieces;
        let (mut weight, last) = (settings.first_weight * unit, settings.last_weight * unit);
        let mut softness = settings.first_softness;
        let mut steps = 0;
        for _ in 0..STAGES {
            self.cost.barrier = Barrier { weight, softness };
            let is_last = weight <= last && softness <= settings.last_softness;
            // A stage is done when Newton expects to gain less than the barrier's own size.
            let enough = if is_last { settings.last_gain } else { settings.stage_gain } * weight * pieces;
            let mut value = self.value_at(&self.states, &self.theta);
            for _ in 0..settings.stage_steps {
                steps += 1;
                let Some(decrement) = self.newton() else { return steps };
                let reached = self.search(value, decrement);
                let is_done = (0.5 * decrement <= enough && self.damping < 2e-3) || reached.is_none();
                if let Some(reached) = reached {
                    value = reached;
                }
                if is_done {
                    break;
                }
            }
            if is_last {
                break;
            }
            weight = (weight * settings.shrink).max(last);
            softness = (softness * settings.shrink).max(settings.last_softness);
        }
        steps
    }

    /// Cost and barrier.
    fn value_at(&self, states: &[BoundaryState], theta: &[f64]) -> f64 {
        let pieces = theta.len();
        (0..pieces).map(|i| self.cost.value(&self.place(i), &ends(states, i), theta[i])).sum()
    }

    fn place(&self, i: usize) -> Place<'a> {
        Place { polytope: self.corridor[i], is_first: i == 0, is_last: i + 1 == self.corridor.len() }
    }

    /// The Newton step; returns minus the slope along it, or `None` if no damping made the system definite.
    fn newton(&mut self) -> Option<f64> {
        for i in 0..self.theta.len() {
            self.locals[i] = self.cost.expand(&self.place(i), &ends(&self.states, i), self.theta[i]);
        }
        self.damping = if self.damping < 4e-4 { 0.0 } else { 0.25 * self.damping };
        for _ in 0..30 {
            if self.factorise_and_solve() {
                return Some(self.slope());
            }
            self.damping = (4.0 * self.damping).max(1e-3);
        }
        None
    }

    /// theta of piece i, with its damping: the elimination divides by it.
    fn pivot(&self, i: usize) -> f64 {
        let local = &self.locals[i];
        // Cost of time and effort: the natural size of the curvature.
        let size = self.limits.time_weight * self.theta[i].exp() + local.theta_theta.abs();
        local.theta_theta.max(1e-3 * size) + self.damping * size
    }

    /// Block Cholesky over the inner nodes, durations eliminated. Whether the matrix was positive definite.
    fn factorise_and_solve(&mut self) -> bool {
        let pieces = self.theta.len();
        for block in &mut self.diagonal[1..] {
            *block = Matrix9::zeros();
        }
        for right in &mut self.step_states {
            *right = Vector9::zeros();
        }
        for i in 0..pieces {
            let local = &self.locals[i];
            let inverse = self.pivot(i).recip();
            let reduced = local.by_theta * inverse;
            for b in 0..6 {
                let node = i + b / 3;
                let at = 3 * (b % 3);
                let gradient = local.gradient[b] - local.mixed[b] * reduced;
                let mut part = self.step_states[node].fixed_rows_mut::<3>(at);
                part -= gradient;
                for e in 0..=b {
                    let block = local.hessian[b][e] - local.mixed[b] * (local.mixed[e] * inverse).transpose();
                    let (from, column) = (i + e / 3, 3 * (e % 3));
                    if from == node {
                        let mut target = self.diagonal[node].fixed_view_mut::<3, 3>(at, column);
                        target += block;
                    } else {
                        self.below[node].fixed_view_mut::<3, 3>(at, column).copy_from(&block);
                    }
                }
            }
        }
        // Nodes 1 .. pieces - 1; the ends are given.
        for k in 1..pieces {
            if k > 1 {
                // L_(k,k-1) = H_(k,k-1) L_(k-1)^-T.
                let (before, here) = self.diagonal.split_at_mut(k);
                let previous = &before[k - 1];
                let coupling = &mut self.below[k];
                for c in 0..9 {
                    for m in 0..c {
                        let l = previous[(c, m)];
                        for r in 0..9 {
                            coupling[(r, c)] -= coupling[(r, m)] * l;
                        }
                    }
                    let inverse = previous[(c, c)];
                    for r in 0..9 {
                        coupling[(r, c)] *= inverse;
                    }
                }
                for m in 0..9 {
                    for c in 0..9 {
                        let l = coupling[(c, m)];
                        for r in c..9 {
                            here[0][(r, c)] -= coupling[(r, m)] * l;
                        }
                    }
                }
                let known = self.step_states[k - 1];
                self.step_states[k] -= self.below[k] * known;
            }
            if !cholesky(&mut self.diagonal[k]) {
                return false;
            }
            forward(&self.diagonal[k], &mut self.step_states[k]);
        }
        for k in (1..pieces).rev() {
            if k + 1 < pieces {
                let later = self.step_states[k + 1];
                let pull = self.below[k + 1].tr_mul(&later);
                self.step_states[k] -= pull;
            }
            backward(&self.diagonal[k], &mut self.step_states[k]);
        }
        self.step_states[0] = Vector9::zeros();
        self.step_states[pieces] = Vector9::zeros();
        for i in 0..pieces {
            let local = &self.locals[i];
            let mut along = local.by_theta;
            for b in 0..6 {
                along += local.mixed[b].dot(&self.step_states[i + b / 3].fixed_rows::<3>(3 * (b % 3)));
            }
            self.step_theta[i] = -along / self.pivot(i);
        }
        self.step_theta.iter().all(|s| s.is_finite())
    }

    fn slope(&self) -> f64 {
        let mut slope = 0.0;
        for (i, local) in self.locals.iter().enumerate() {
            slope -= local.by_theta * self.step_theta[i];
            for b in 0..6 {
                slope -= local.gradient[b].dot(&self.step_states[i + b / 3].fixed_rows::<3>(3 * (b % 3)));
            }
        }
        slope
    }

    /// Halves the step until the barrier falls enough; `None` if it never does.
    fn search(&mut self, value: f64, decrement: f64) -> Option<f64> {
        let longest = self.step_theta.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        let mut step = if longest > 0.7 { 0.7 / longest } else { 1.0 };
        self.from_states.copy_from_slice(&self.states);
        self.from_theta.copy_from_slice(&self.theta);
        let mut best: Option<f64> = None;
        for _ in 0..40 {
            for ((to, from), d) in self.trial_states.iter_mut().zip(&self.from_states).zip(&self.step_states) {
                for k in 0..3 {
                    to[k] = from[k] + d.fixed_rows::<3>(3 * k) * step;
                }
            }
            for ((to, from), d) in self.trial_theta.iter_mut().zip(&self.from_theta).zip(&self.step_theta) {
                *to = from + d * step;
            }
            let reached = self.value_at(&self.trial_states, &self.trial_theta);
            if reached <= value - 1e-4 * step * decrement && best.is_none_or(|b| reached < b) {
                std::mem::swap(&mut self.states, &mut self.trial_states);
                std::mem::swap(&mut self.theta, &mut self.trial_theta);
                // A quadratic would have lost half of the slope by now. Where it goes on falling, a longer step is better.
                let is_straight = reached < value - 0.75 * step * decrement;
                if !is_straight || step * longest >= 0.7 || (best.is_none() && step < 1.0) {
                    return Some(reached);
                }
                best = Some(reached);
                step *= 2.0;
                continue;
            }
            if best.is_some() {
                return best;
            }
            step *= 0.5;
        }
        None
    }
}

fn ends(states: &[BoundaryState], i: usize) -> Ends {
    let (s, e) = (&states[i], &states[i + 1]);
    [s[0], s[1], s[2], e[0], e[1], e[2]]
}

/// Lower factor in place, reciprocals on the diagonal.
fn cholesky(a: &mut Matrix9) -> bool {
    for c in 0..9 {
        for m in 0..c {
            let l = a[(c, m)];
            for r in c..9 {
                a[(r, c)] -= a[(r, m)] * l;
            }
        }
        let pivot = a[(c, c)];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let inverse = pivot.sqrt().recip();
        for r in c..9 {
            a[(r, c)] *= inverse;
        }
        a[(c, c)] = inverse;
    }
    true
}

fn forward(l: &Matrix9, x: &mut Vector9) {
    for c in 0..9 {
        x[c] *= l[(c, c)];
        for r in c + 1..9 {
            x[r] -= l[(r, c)] * x[c];
        }
    }
}

fn backward(l: &Matrix9, x: &mut Vector9) {
    for c in (0..9).rev() {
        for r in c + 1..9 {
            x[c] -= l[(r, c)] * x[r];
        }
        x[c] *= l[(c, c)];
    }
}
