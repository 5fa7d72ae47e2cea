//! Limited-memory BFGS with the line search of Lewis and Overton: for smooth costs whose curvature jumps, as penalties' does.
//!
//! The direction is the two-loop recursion over the last steps (Nocedal 1980); the step is found by bisection for the weak
//! Wolfe conditions (Lewis, Overton 2013), which needs no second derivative to exist. A pair of steps is only remembered
//! where the curvature along it is positive (cautious update, Li and Fukushima 2001). The order of all sums is fixed, so the
//! same input gives the same bits.

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LbfgsSettings {
    /// Pairs of steps that are remembered (32).
    pub memory: usize,
    /// The cost is compared with that of so many iterations ago (3).
    pub past: usize,
    /// It has converged when the cost fell by less than this share since (1e-5).
    pub relative_decrease: f64,
    /// Or when the largest entry of the gradient is this small against `max(1, largest |x|)` (0: never).
    pub gradient_tolerance: f64,
    /// Iterations at most (1000).
    pub max_iterations: usize,
    /// Evaluations in one line search at most (64).
    pub max_search: usize,
}

impl Default for LbfgsSettings {
    fn default() -> Self {
        LbfgsSettings {
            memory: 32,
            past: 3,
            relative_decrease: 1e-5,
            gradient_tolerance: 0.0,
            max_iterations: 1000,
            max_search: 64,
        }
    }
}

/// Why it stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LbfgsStatus {
    /// The cost falls no more.
    Converged,
    /// The gradient is small.
    Stationary,
    /// The bound on iterations was met; the point is the best so far.
    IterationLimit,
    /// No step along the direction lowers the cost: rounding, or a gradient that is not that of the cost.
    SearchFailed,
    /// The cost at the start is not finite.
    NotFinite,
}

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LbfgsReport {
    /// Why it stopped.
    pub status: LbfgsStatus,
    /// Directions tried.
    pub iterations: usize,
    /// Calls of the cost.
    pub evaluations: usize,
    /// Cost at the point that was left in `x`.
    pub cost: f64,
}

/// Armijo: share of the slope that a step must gain.
const SUFFICIENT: f64 = 1e-4;
/// Weak Wolfe: share of the slope that may be left.
const FLATTER: f64 = 0.9;
/// A pair is remembered if its curvature is above this share of what the gradient would make of it.
const CAUTION: f64 = 1e-6;

/// Minimises `cost(x, gradient)`, which writes the gradient and returns the value, from `x` on and into it.
/// Costs that are not finite are treated as too large: the step is shortened.
pub fn minimise(
    x: &mut [f64],
    settings: &LbfgsSettings,
    mut cost: impl FnMut(&[f64], &mut [f64]) -> f64,
) -> LbfgsReport {
    let n = x.len();
    let mut gradient = vec![0.0; n];
    let mut value = cost(x, &mut gradient);
    let mut report = LbfgsReport { status: LbfgsStatus::NotFinite, iterations: 0, evaluations: 1, cost: value };
    if !value.is_finite() {
        return report;
    }
    let mut memory = Memory::new(settings.memory.max(1), n);
    let mut direction = vec![0.0; n];
    let (mut from, mut gradient_from) = (x.to_vec(), gradient.clone());
    let mut past = vec![value; settings.past.max(1)];
    loop {
        let largest = x.iter().fold(1.0f64, |m, v| m.max(v.abs()));
        if gradient.iter().fold(0.0f64, |m, g| m.max(g.abs())) <= settings.gradient_tolerance * largest {
            report.status = LbfgsStatus::Stationary;
            return report;
        }
        if report.iterations >= settings.max_iterations {
            report.status = LbfgsStatus::IterationLimit;
            return report;
        }
        memory.direction(&gradient, &mut direction);
        let slope = dot(&gradient, &direction);
        let mut step = if report.iterations == 0 { 1.0 / dot(&direction, &direction).sqrt() } else { 1.0 };
        report.iterations += 1;
        from.copy_from_slice(x);
        gradient_from.copy_from_slice(&gradient);
        let start = value;
        // Lewis and Overton, algorithm 2.6: a bracket that holds a point of weak Wolfe, halved.
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut is_found = false;
        for _ in 0..settings.max_search {
            for ((x, from), d) in x.iter_mut().zip(&from).zip(&direction) {
                *x = from + step * d;
            }
            value = cost(x, &mut gradient);
            report.evaluations += 1;
            if value.is_nan() || value > start + SUFFICIENT * step * slope {
                high = step;
            } else if dot(&gradient, &direction) < FLATTER * slope {
                low = step;
            } else {
                is_found = true;
                break;
            }
            step = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * step };
            if high - low < 1e-16 * high {
                break;
            }
        }
        if !is_found && (value.is_nan() || value >= start) {
            x.copy_from_slice(&from);
            report.status = LbfgsStatus::SearchFailed;
            return report;
        }
        report.cost = value;
        if !is_found {
            report.status = LbfgsStatus::SearchFailed;
            return report;
        }
        let slot = report.iterations % past.len();
        if (past[slot] - value).abs() < settings.relative_decrease * value.abs().max(1.0)
            && report.iterations >= past.len()
        {
            report.status = LbfgsStatus::Converged;
            return report;
        }
        past[slot] = value;
        memory.remember(x, &from, &gradient, &gradient_from);
    }
}

/// The last steps and changes of the gradient, oldest overwritten first.
struct Memory {
    steps: Vec<Vec<f64>>,
    changes: Vec<Vec<f64>>,
    /// 1 / (step . change).
    inverse: Vec<f64>,
    share: Vec<f64>,
    next: usize,
    held: usize,
}

impl Memory {
    fn new(size: usize, n: usize) -> Self {
        Memory {
            steps: vec![vec![0.0; n]; size],
            changes: vec![vec![0.0; n]; size],
            inverse: vec![0.0; size],
            share: vec![0.0; size],
            next: 0,
            held: 0,
        }
    }

    fn remember(&mut self, x: &[f64], from: &[f64], gradient: &[f64], gradient_from: &[f64]) {
        let k = self.next;
        for (s, (a, b)) in self.steps[k].iter_mut().zip(x.iter().zip(from)) {
            *s = a - b;
        }
        for (y, (a, b)) in self.changes[k].iter_mut().zip(gradient.iter().zip(gradient_from)) {
            *y = a - b;
        }
        let curvature = dot(&self.steps[k], &self.changes[k]);
        let size = dot(&self.steps[k], &self.steps[k]) * dot(gradient_from, gradient_from).sqrt();
        if curvature > CAUTION * size {
            self.inverse[k] = 1.0 / curvature;
            self.next = (k + 1) % self.steps.len();
            self.held = (self.held + 1).min(self.steps.len());
        }
    }

    /// Two-loop recursion: minus the inverse Hessian times the gradient.
    fn direction(&mut self, gradient: &[f64], direction: &mut [f64]) {
        for (d, g) in direction.iter_mut().zip(gradient) {
            *d = -g;
        }
        let size = self.steps.len();
        let newest_first = |k: usize| (self.next + size - 1 - k) % size;
        for k in 0..self.held {
            let at = newest_first(k);
            let share = dot(&self.steps[at], direction) * self.inverse[at];
            self.share[at] = share;
            add(direction, &self.changes[at], -share);
        }
        if self.held > 0 {
            let at = newest_first(0);
            let scale = 1.0 / (self.inverse[at] * dot(&self.changes[at], &self.changes[at]));
            direction.iter_mut().for_each(|d| *d *= scale);
        }
        for k in (0..self.held).rev() {
            let at = newest_first(k);
            let back = dot(&self.changes[at], direction) * self.inverse[at];
            add(direction, &self.steps[at], self.share[at] - back);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(to: &mut [f64], what: &[f64], times: f64) {
    for (t, w) in to.iter_mut().zip(what) {
        *t += w * times;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock(x: &[f64], g: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        g.fill(0.0);
        for k in 0..x.len() - 1 {
            let (a, b) = (1.0 - x[k], x[k + 1] - x[k] * x[k]);
            sum += a * a + 100.0 * b * b;
            g[k] += -2.0 * a - 400.0 * x[k] * b;
            g[k + 1] += 200.0 * b;
        }
        sum
    }

    #[test]
    fn finds_the_end_of_a_curved_valley() {
        let settings = LbfgsSettings { relative_decrease: 1e-15, ..LbfgsSettings::default() };
        let mut x = vec![0.0; 10];
        let report = minimise(&mut x, &settings, rosenbrock);
        assert!(report.cost < 1e-10, "{report:?}");
        assert!(x.iter().all(|v| (v - 1.0).abs() < 1e-4), "{x:?}");
    }

    /// |x| + x^2 / 2 in many dimensions: no derivative at the minimum, which stops smooth line searches.
    #[test]
    fn gets_near_a_kink() {
        let mut x: Vec<f64> = (0..6).map(|k| 1.0 + f64::from(k)).collect();
        let cost = |x: &[f64], g: &mut [f64]| {
            let weights = |k: usize| 1.0 + k as f64;
            for (k, g) in g.iter_mut().enumerate() {
                *g = weights(k) * x[k].signum() + x[k];
            }
            x.iter().enumerate().map(|(k, v)| weights(k) * v.abs() + 0.5 * v * v).sum()
        };
        let report = minimise(&mut x, &LbfgsSettings { relative_decrease: 0.0, ..LbfgsSettings::default() }, cost);
        assert!(report.cost < 1e-4, "{report:?}");
    }

    #[test]
    fn the_same_bits_twice_and_no_hang_on_nonsense() {
        let run = || {
            let mut x = vec![0.3; 5];
            let report = minimise(&mut x, &LbfgsSettings::default(), rosenbrock);
            (x, report)
        };
        assert_eq!(run(), run());
        let mut x = vec![0.0; 3];
        let nothing = minimise(&mut x, &LbfgsSettings::default(), |_, _| f64::NAN);
        assert_eq!(nothing.status, LbfgsStatus::NotFinite);
        // A gradient with the wrong sign: no step helps.
        let wrong = minimise(&mut [1.0, 2.0], &LbfgsSettings::default(), |x, g| {
            g.copy_from_slice(&[-2.0 * x[0], -2.0 * x[1]]);
            x[0] * x[0] + x[1] * x[1]
        });
        assert_eq!(wrong.status, LbfgsStatus::SearchFailed);
    }
}
