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

use nalgebra::{Matrix3, Vector3};

use super::flatness::ThrustAxis;
use super::hermite::{Hermite, factor};
use super::limits::{BoundaryState, FlightLimits};
use super::polytope::Polytope;

/// Samples per piece at which the rotor limits are asked for.
pub(crate) const SAMPLES: usize = 10;

/// `sqrt(1 + 0.01)`: the rate counts as `sqrt(share^2 + 0.01)`, which grows like the rate and is smooth at rest.
const RATE_EDGE: f64 = 1.004_987_562_112_089;

/// Rotor limits count from this slack on (share of the limit).
const NEAR: f64 = 0.2;

/// How the barrier shrinks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InteriorSettings {
    /// Weight of the barrier at first, as a share of the cost per piece.
    pub first_weight: f64,
    /// Weight of the barrier at last, as a share of the cost per piece.
    pub last_weight: f64,
    /// What one stage leaves of it.
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
pub struct Nodes {
    /// Position, velocity, acceleration at every node, start and goal included.
    pub states: Vec<BoundaryState>,
    /// Duration of each piece (s).
    pub durations_s: Vec<f64>,
}

/// What the method did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InteriorReport {
    /// Newton steps.
    pub steps: usize,
    /// Evaluations of the barrier, those of Newton steps included.
    pub evaluations: usize,
    /// Whether the last stage converged.
    pub converged: bool,
}

/// Improves `nodes` for one polytope a piece. `tighten` is taken off every limit and every face: rooms for rounding, and for
/// what the samples do not see (m, and shares of the limits).
pub(crate) fn optimise(
    nodes: &mut Nodes,
    corridor: &[&Polytope],
    limits: &FlightLimits,
    tighten: Tighten,
    settings: &InteriorSettings,
) -> InteriorReport {
    let mut solver = Solver::new(nodes, corridor, limits, tighten);
    let report = solver.run(settings);
    nodes.states.copy_from_slice(&solver.states);
    for (t, theta) in nodes.durations_s.iter_mut().zip(&solver.theta) {
        *t = theta.exp();
    }
    report
}

/// What is taken off the limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tighten {
    /// Off every face (m).
    pub faces_m: f64,
    /// Share of the speed and acceleration limits.
    pub motion: f64,
    /// Share of the rotor limits.
    pub rotors: f64,
}

/// The state of a piece by its six vectors: p, v, a at the start, then at the end.
type Ends = [Vector3<f64>; 6];

/// A vector that is linear in the six: coefficient `c T^m` with the power m known from the derivative and the vector.
#[derive(Debug, Clone, Copy)]
struct Linear {
    coefficient: [f64; 6],
    derivative: i32,
    /// Range of the six that has coefficients.
    from: usize,
    to: usize,
}

impl Linear {
    /// By the coefficients at T = 1.
    fn new(unit: [f64; 6], derivative: i32, powers: &[f64; 8]) -> Self {
        let mut coefficient = unit;
        for (b, c) in coefficient.iter_mut().enumerate() {
            *c *= powers[(5 + b as i32 % 3 - derivative) as usize];
        }
        let from = unit.iter().position(|c| *c != 0.0).unwrap_or(0);
        let to = unit.iter().rposition(|c| *c != 0.0).map_or(0, |k| k + 1);
        Linear { coefficient, derivative, from, to }
    }

    fn value(&self, ends: &Ends) -> Vector3<f64> {
        (self.from..self.to).fold(Vector3::zeros(), |sum, b| sum + ends[b] * self.coefficient[b])
    }

    /// Power of T of the b-th coefficient: what d/dtheta multiplies by.
    fn power(&self, b: usize) -> f64 {
        f64::from(b as i32 % 3 - self.derivative)
    }
}

/// Bernstein points of the position that one piece answers for beside its ends, at T = 1.
pub(crate) const POSITION: [[f64; 6]; 4] = [
    [1.0, 0.2, 0.0, 0.0, 0.0, 0.0],
    [1.0, 0.4, 0.05, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, -0.4, 0.05],
    [0.0, 0.0, 0.0, 1.0, -0.2, 0.0],
];
/// Of the velocity, 5 (P_k+1 - P_k) / T, on the two halves of the piece (de Casteljau), but for its very ends: a tighter hull.
pub(crate) const VELOCITY_HULL: [[f64; 6]; 7] = [
    [0.0, 1.0, 0.125, 0.0, 0.0, 0.0],
    [-1.25, 0.25, 0.0625, 1.25, -0.5, 0.0625],
    [-1.875, -0.25, 0.0, 1.875, -0.625, 0.0625],
    [-1.875, -0.4375, -0.03125, 1.875, -0.4375, 0.03125],
    [-1.875, -0.625, -0.0625, 1.875, -0.25, 0.0],
    [-1.25, -0.5, -0.0625, 1.25, 0.25, -0.0625],
    [0.0, 0.0, 0.0, 0.0, 1.0, -0.125],
];
/// Of the acceleration: 20 (P_k+2 - 2 P_k+1 + P_k) / T^2.
pub(crate) const ACCELERATION: [[f64; 6]; 2] =
    [[-20.0, -12.0, -2.0, 20.0, -8.0, 1.0], [20.0, 8.0, 1.0, -20.0, 12.0, -2.0]];

/// Of the jerk: 60 (P_k+3 - 3 P_k+2 + 3 P_k+1 - P_k) / T^3.
pub(crate) const JERK: [[f64; 6]; 3] = [
    [-60.0, -36.0, -9.0, 60.0, -24.0, 3.0],
    [120.0, 60.0, 9.0, -120.0, 60.0, -9.0],
    [-60.0, -24.0, -3.0, 60.0, -36.0, 9.0],
];

/// Gradient and Hessian of one piece.
#[derive(Debug, Clone)]
struct Local {
    gradient: [Vector3<f64>; 6],
    by_theta: f64,
    /// Lower triangle of blocks.
    hessian: [[Matrix3<f64>; 6]; 6],
    mixed: [Vector3<f64>; 6],
    theta_theta: f64,
}

impl Local {
    fn zero() -> Self {
        Local {
            gradient: [Vector3::zeros(); 6],
            by_theta: 0.0,
            hessian: [[Matrix3::zeros(); 6]; 6],
            mixed: [Vector3::zeros(); 6],
            theta_theta: 0.0,
        }
    }

    /// Adds a function of one linear vector, by its gradient and Hessian.
    fn add(&mut self, vector: &Linear, ends: &Ends, gradient: &Vector3<f64>, hessian: &Matrix3<f64>) {
        let c = &vector.coefficient;
        let mut first = Vector3::zeros();
        let mut second = Vector3::zeros();
        for b in vector.from..vector.to {
            let term = ends[b] * (c[b] * vector.power(b));
            first += term;
            second += term * vector.power(b);
        }
        let pull = hessian * first;
        for b in vector.from..vector.to {
            self.gradient[b] += gradient * c[b];
            self.mixed[b] += (pull + gradient * vector.power(b)) * c[b];
            for e in vector.from..=b {
                self.hessian[b][e] += hessian * (c[b] * c[e]);
            }
        }
        self.by_theta += gradient.dot(&first);
        self.theta_theta += pull.dot(&first) + gradient.dot(&second);
    }
}

/// A logarithm of the slack that goes over into a parabola below `softness`.
#[derive(Debug, Clone, Copy)]
struct Barrier {
    weight: f64,
    softness: f64,
}

/// Sums logarithms of many slacks with few calls of `ln`.
struct Sum {
    product: f64,
    total: f64,
}

impl Sum {
    fn new() -> Self {
        Sum { product: 1.0, total: 0.0 }
    }

    fn add(&mut self, barrier: &Barrier, slack: f64) {
        if slack >= barrier.softness {
            self.product *= slack;
            if !(1e-200..1e200).contains(&self.product) {
                self.total -= self.product.ln();
                self.product = 1.0;
            }
        } else {
            let u = slack / barrier.softness - 2.0;
            self.total += 0.5 * (u * u - 1.0) - barrier.softness.ln();
        }
    }

    /// A barrier that begins at `NEAR` only: what is further inside does not feel it.
    fn add_near(&mut self, barrier: &Barrier, slack: f64) {
        if slack < NEAR {
            let u = slack / NEAR - 1.0;
            self.add(barrier, slack);
            self.total += NEAR.ln() + u - 0.5 * u * u;
        }
    }

    fn value(&self, barrier: &Barrier) -> f64 {
        barrier.weight * (self.total - self.product.ln())
    }
}

impl Barrier {
    /// Derivatives of the barrier that begins at `NEAR`; zero further inside.
    fn slopes_near(&self, slack: f64) -> (f64, f64) {
        let (first, second) = self.slopes(slack);
        let inverse = 1.0 / NEAR;
        let u = slack * inverse - 1.0;
        (first + self.weight * (inverse - u * inverse), second - self.weight * inverse * inverse)
    }

    /// First and second derivative by the slack.
    fn slopes(&self, slack: f64) -> (f64, f64) {
        if slack >= self.softness {
            let inverse = slack.recip();
            (-self.weight * inverse, self.weight * inverse * inverse)
        } else {
            let inverse = self.softness.recip();
            (self.weight * (slack * inverse - 2.0) * inverse, self.weight * inverse * inverse)
        }
    }
}

type Matrix9 = nalgebra::SMatrix<f64, 9, 9>;
type Vector9 = nalgebra::SVector<f64, 9>;

struct Solver<'a> {
    corridor: &'a [&'a Polytope],
    limits: &'a FlightLimits,
    tighten: Tighten,
    states: Vec<BoundaryState>,
    theta: Vec<f64>,
    barrier: Barrier,
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
    sample_tables: [[[f64; 6]; 3]; SAMPLES],
    evaluations: usize,
}

impl<'a> Solver<'a> {
    fn new(nodes: &Nodes, corridor: &'a [&'a Polytope], limits: &'a FlightLimits, tighten: Tighten) -> Self {
        let pieces = nodes.durations_s.len();
        let floor = limits.min_duration_s;
        Solver {
            corridor,
            limits,
            tighten,
            states: nodes.states.clone(),
            theta: nodes.durations_s.iter().map(|t| t.max(1.05 * floor).ln()).collect(),
            barrier: Barrier { weight: 1.0, softness: 0.1 },
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
            sample_tables: sample_tables(),
            evaluations: 0,
        }
    }

    fn run(&mut self, settings: &InteriorSettings) -> InteriorReport {
        let pieces = self.theta.len() as f64;
        let unit = self.limits.time_weight * self.theta.iter().map(|t| t.exp()).sum::<f64>() / pieces;
        let (mut weight, last) = (settings.first_weight * unit, settings.last_weight * unit);
        let mut softness = settings.first_softness;
        let mut report = InteriorReport { steps: 0, evaluations: 0, converged: false };
        loop {
            self.barrier = Barrier { weight, softness };
            let is_last = weight <= last && softness <= settings.last_softness;
            // A stage is done when Newton expects to gain less than the barrier's own size.
            let enough = if is_last { settings.last_gain } else { settings.stage_gain } * weight * pieces;
            let mut value = self.value_at(&self.states, &self.theta);
            for _ in 0..settings.stage_steps {
                report.steps += 1;
                let Some(decrement) = self.newton() else {
                    report.evaluations = self.evaluations;
                    return report;
                };
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
                report.converged = true;
                report.evaluations = self.evaluations;
                return report;
            }
            weight = (weight * settings.shrink).max(last);
            softness = (softness * settings.shrink).max(settings.last_softness);
        }
    }

    /// Cost and barrier.
    fn value_at(&self, states: &[BoundaryState], theta: &[f64]) -> f64 {
        let pieces = theta.len();
        (0..pieces).map(|i| self.piece_value(i, pieces, &ends(states, i), theta[i])).sum()
    }

    fn piece_value(&self, i: usize, pieces: usize, ends: &Ends, theta: f64) -> f64 {
        let duration = theta.exp();
        let powers = powers(duration);
        let mut cost = self.limits.time_weight * duration;
        for a in 0..6 {
            for b in 0..=a {
                let twice = if a == b { 1.0 } else { 2.0 };
                cost += twice * effort_entry(a, b) * powers[a % 3 + b % 3] * ends[a].dot(&ends[b]);
            }
        }
        let mut sum = Sum::new();
        let barrier = &self.barrier;
        sum.add(barrier, theta - self.limits.min_duration_s.ln());
        let mut inside = |p: &Vector3<f64>| {
            for face in &self.corridor[i].faces {
                sum.add(barrier, face.offset_m - self.tighten.faces_m - face.normal.dot(p));
            }
        };
        for unit in &POSITION {
            inside(&Linear::new(*unit, 0, &powers).value(ends));
        }
        if i > 0 {
            inside(&ends[0]);
        }
        if i + 1 < pieces {
            inside(&ends[3]);
        }
        let speed = self.motion_scale(self.limits.max_speed_mps);
        for unit in &VELOCITY_HULL {
            sum.add(barrier, 1.0 - Linear::new(*unit, 1, &powers).value(ends).norm_squared() * speed);
        }
        if i > 0 {
            sum.add(barrier, 1.0 - ends[1].norm_squared() * speed);
        }
        let accel = self.motion_scale(self.limits.max_accel_mps2);
        if accel > 0.0 {
            for unit in &ACCELERATION {
                sum.add(barrier, 1.0 - Linear::new(*unit, 2, &powers).value(ends).norm_squared() * accel);
            }
            if i > 0 {
                sum.add(barrier, 1.0 - ends[2].norm_squared() * accel);
            }
        }
        if let Some(airframe) = &self.limits.airframe {
            for table in &self.sample_tables {
                let at = |r: usize| Linear::new(table[r], r as i32 + 1, &powers).value(ends);
                let axis = ThrustAxis::new(airframe, &at(0), &at(1), &at(2));
                for slack in self.rotor_slacks(&axis) {
                    sum.add_near(barrier, slack);
                }
            }
        }
        cost + sum.value(barrier)
    }

    /// `1 / limit^2`, a little less than the limit; 0 if there is none.
    fn motion_scale(&self, limit: f64) -> f64 {
        let kept = limit * (1.0 - self.tighten.motion);
        if kept.is_finite() { 1.0 / (kept * kept) } else { 0.0 }
    }

    /// Slacks of tilt, rate, most thrust, least thrust, each as a share.
    fn rotor_slacks(&self, axis: &ThrustAxis) -> [f64; 4] {
        let share = 1.0 - self.tighten.rotors;
        let rate = self.limits.max_rate_radps * share;
        [
            axis.z.z - (self.limits.max_tilt_rad * share).cos(),
            RATE_EDGE - (axis.rate_squared() / (rate * rate) + 0.01).sqrt(),
            share - axis.thrust_n / self.limits.max_thrust_n,
            (axis.thrust_n - self.limits.min_thrust_n) / self.limits.max_thrust_n - self.tighten.rotors,
        ]
    }

    /// Gradient and Hessian of a piece.
    fn expand(&mut self, i: usize) {
        let pieces = self.theta.len();
        let ends = ends(&self.states, i);
        let theta = self.theta[i];
        let duration = theta.exp();
        let powers = powers(duration);
        let barrier = self.barrier;
        let mut local = Local::zero();
        // Cost.
        local.by_theta = self.limits.time_weight * duration;
        local.theta_theta = local.by_theta;
        for a in 0..6 {
            for b in 0..=a {
                let entry = effort_entry(a, b) * powers[a % 3 + b % 3];
                let power = (a % 3 + b % 3) as f64 - 5.0;
                local.hessian[a][b] += Matrix3::identity() * (2.0 * entry);
                local.gradient[a] += ends[b] * (2.0 * entry);
                local.mixed[a] += ends[b] * (2.0 * entry * power);
                let product = ends[a].dot(&ends[b]) * entry;
                let mut twice = 1.0;
                if a != b {
                    local.gradient[b] += ends[a] * (2.0 * entry);
                    local.mixed[b] += ends[a] * (2.0 * entry * power);
                    twice = 2.0;
                }
                local.by_theta += twice * power * product;
                local.theta_theta += twice * power * power * product;
            }
        }
        // Shortest duration.
        let (first, second) = barrier.slopes(theta - self.limits.min_duration_s.ln());
        local.by_theta += first;
        local.theta_theta += second;
        // Corridor.
        let start = Linear::new([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0, &powers);
        let end = Linear::new([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 0, &powers);
        let inner = POSITION.iter().map(|unit| Linear::new(*unit, 0, &powers));
        for point in inner.chain((i > 0).then_some(start)).chain((i + 1 < pieces).then_some(end)) {
            let p = point.value(&ends);
            let (mut gradient, mut hessian) = (Vector3::zeros(), Matrix3::zeros());
            for face in &self.corridor[i].faces {
                let (first, second) = barrier.slopes(face.offset_m - self.tighten.faces_m - face.normal.dot(&p));
                gradient -= face.normal * first;
                let scaled = face.normal * second;
                hessian += scaled * face.normal.transpose();
            }
            local.add(&point, &ends, &gradient, &hessian);
        }
        // Speed and acceleration.
        let mut ball = |vector: Linear, scale: f64| {
            let v = vector.value(&ends);
            let (first, second) = barrier.slopes(1.0 - v.norm_squared() * scale);
            let gradient = v * (-2.0 * scale * first);
            let hessian =
                Matrix3::identity() * (-2.0 * scale * first) + v * v.transpose() * (4.0 * scale * scale * second);
            local.add(&vector, &ends, &gradient, &hessian);
        };
        let speed = self.motion_scale(self.limits.max_speed_mps);
        for unit in &VELOCITY_HULL {
            ball(Linear::new(*unit, 1, &powers), speed);
        }
        if i > 0 {
            ball(Linear::new([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 1, &powers), speed);
        }
        let accel = self.motion_scale(self.limits.max_accel_mps2);
        if accel > 0.0 {
            for unit in &ACCELERATION {
                ball(Linear::new(*unit, 2, &powers), accel);
            }
            if i > 0 {
                ball(Linear::new([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 2, &powers), accel);
            }
        }
        if self.limits.airframe.is_some() {
            self.expand_rotors(&mut local, &ends, &powers);
        }
        self.locals[i] = local;
    }

    /// Rotor limits at the samples: exact gradient, Gauss-Newton Hessian.
    fn expand_rotors(&self, local: &mut Local, ends: &Ends, powers: &[f64; 8]) {
        let Some(airframe) = &self.limits.airframe else { return };
        let rate = self.limits.max_rate_radps * (1.0 - self.tighten.rotors);
        for table in &self.sample_tables {
            let vectors: [Linear; 3] = std::array::from_fn(|r| Linear::new(table[r], r as i32 + 1, powers));
            let values = vectors.map(|l| l.value(ends));
            let axis = ThrustAxis::new(airframe, &values[0], &values[1], &values[2]);
            let slacks = self.rotor_slacks(&axis);
            let zero = Vector3::zeros();
            let up = Vector3::z();
            for (k, slack) in slacks.iter().enumerate() {
                if *slack >= NEAR {
                    continue;
                }
                let (first, second) = self.barrier.slopes_near(*slack);
                let by = match k {
                    0 => axis.reverse(airframe, 0.0, &up, &zero),
                    1 => {
                        let (by_z, by_dz) = axis.rate_squared_gradient();
                        let scale = -0.5 / (rate * rate * (RATE_EDGE - slack));
                        axis.reverse(airframe, 0.0, &(by_z * scale), &(by_dz * scale))
                    }
                    2 => axis.reverse(airframe, -1.0 / self.limits.max_thrust_n, &zero, &zero),
                    _ => axis.reverse(airframe, 1.0 / self.limits.max_thrust_n, &zero, &zero),
                };
                // The slack by the six vectors and theta.
                let mut row = [Vector3::zeros(); 6];
                let mut by_theta = 0.0;
                for (vector, by) in vectors.iter().zip(&by) {
                    for b in 0..6 {
                        let part = by * vector.coefficient[b];
                        row[b] += part;
                        by_theta += part.dot(&ends[b]) * vector.power(b);
                    }
                }
                for b in 0..6 {
                    local.gradient[b] += row[b] * first;
                    let scaled = row[b] * second;
                    local.mixed[b] += scaled * by_theta;
                    for e in 0..=b {
                        local.hessian[b][e] += scaled * row[e].transpose();
                    }
                }
                local.by_theta += by_theta * first;
                local.theta_theta += by_theta * by_theta * second;
            }
        }
    }

    /// The Newton step; returns minus the slope along it, or `None` if no damping made the system definite.
    fn newton(&mut self) -> Option<f64> {
        self.evaluations += 1;
        for i in 0..self.theta.len() {
            self.expand(i);
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
            self.evaluations += 1;
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

/// `T^(m - 5)` for m = 0 .. 7.
fn powers(duration: f64) -> [f64; 8] {
    let inverse = duration.recip();
    let mut p = [1.0; 8];
    for m in (0..5).rev() {
        p[m] = p[m + 1] * inverse;
    }
    p[6] = duration;
    p[7] = duration * duration;
    p
}

/// Entry of the quadratic form of the effort between two of the six vectors, at T = 1.
pub(crate) fn effort_entry(a: usize, b: usize) -> f64 {
    match (a / 3, b / 3) {
        (0, 0) => Hermite::<3>::START_START[a][b],
        (1, 1) => Hermite::<3>::END_END[a - 3][b - 3],
        (1, _) => Hermite::<3>::START_END[b][a - 3],
        _ => Hermite::<3>::START_END[a][b - 3],
    }
}

/// Velocity, acceleration and jerk at the samples by the six vectors, at T = 1.
fn sample_tables() -> [[[f64; 6]; 3]; SAMPLES] {
    std::array::from_fn(|k| {
        let u = k as f64 / (SAMPLES - 1) as f64;
        std::array::from_fn(|row| {
            let r = row + 1;
            std::array::from_fn(|b| {
                let (table, k) = if b < 3 { (Hermite::<3>::FROM_START, b) } else { (Hermite::<3>::FROM_END, b - 3) };
                let low = if b < 3 && k >= r { u.powi((k - r) as i32) / factor(k - r, k - r) } else { 0.0 };
                low + (0..3).map(|j| table[j][k] * factor(3 + j, r) * u.powi((3 + j - r) as i32)).sum::<f64>()
            })
        })
    })
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
