//! Roots of polynomials and of increasing functions: where a lens curve turns back, and the way back along it.

/// `coefficients[0] + coefficients[1] x + ...` and its derivative.
pub(super) fn evaluate(coefficients: &[f64], x: f64) -> (f64, f64) {
    coefficients.iter().rev().fold((0.0, 0.0), |(value, slope), c| (value * x + c, slope * x + value))
}

/// The smallest root in `(low, high)` at which the polynomial changes its sign; `None` if it keeps its sign.
///
/// Between neighbouring roots of its derivative a polynomial is monotone, so each root is bracketed: no sampling that
/// could step over two at once.
pub(super) fn first_root(coefficients: &[f64], low: f64, high: f64) -> Option<f64> {
    roots(coefficients, low, high).first().copied()
}

fn roots(coefficients: &[f64], low: f64, high: f64) -> Vec<f64> {
    let degree = coefficients.iter().rposition(|c| *c != 0.0).unwrap_or(0);
    if degree == 0 {
        return Vec::new();
    }
    let derivative: Vec<f64> = (1..=degree).map(|k| k as f64 * coefficients[k]).collect();
    let mut ends = vec![low];
    ends.extend(roots(&derivative, low, high));
    ends.push(high);
    let value = |x: f64| evaluate(&coefficients[..=degree], x).0;
    ends.windows(2)
        .filter_map(|pair| {
            let (mut a, mut b) = (pair[0], pair[1]);
            let is_rising = value(b) > value(a);
            if (value(a) > 0.0) == (value(b) > 0.0) {
                return None;
            }
            while a < 0.5 * (a + b) && 0.5 * (a + b) < b {
                let middle = 0.5 * (a + b);
                if (value(middle) > 0.0) == is_rising { b = middle } else { a = middle }
            }
            Some(b)
        })
        .collect()
}

/// The x in `[low, high]` at which an increasing function reaches `target`, by Newton's steps kept inside a shrinking
/// bracket. `function` gives value and slope. The target must lie between the values at the ends; beyond them the
/// nearer end is returned.
pub(super) fn solve_increasing(
    function: impl Fn(f64) -> (f64, f64),
    target: f64,
    low: f64,
    high: f64,
    guess: f64,
) -> f64 {
    const STEPS: usize = 100; // bisection alone needs 60
    let (mut low, mut high) = (low, high);
    let mut x = if (low..=high).contains(&guess) { guess } else { 0.5 * (low + high) };
    for _ in 0..STEPS {
        let (value, slope) = function(x);
        if value == target {
            return x;
        }
        if value < target {
            low = x
        } else {
            high = x
        }
        let newton = x - (value - target) / slope;
        let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= f64::EPSILON * x.abs() {
            return next;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_several_roots() {
        // (x - 1)(x - 1.001)(x - 3) = x^3 - 5.001 x^2 + 7.004 x - 3.003
        let near = first_root(&[-3.003, 7.004, -5.001, 1.0], 0.0, 10.0).expect("three roots");
        assert!((near - 1.0).abs() < 1e-9, "{near}");
        assert_eq!(first_root(&[1.0, 0.0, 1.0], -5.0, 5.0), None);
        assert_eq!(first_root(&[2.0], 0.0, 1.0), None);
        let line = first_root(&[-1.0, 2.0, 0.0, 0.0], 0.0, 1.0).expect("at one half");
        assert!((line - 0.5).abs() < 1e-15);
    }

    #[test]
    fn newton_inside_a_bracket() {
        let cube = |x: f64| (x * x * x, 3.0 * x * x);
        let root = solve_increasing(cube, 8.0, 0.0, 100.0, 0.0);
        assert!((root - 2.0).abs() < 1e-15, "{root}");
        assert!((solve_increasing(cube, 8.0, 0.0, 1.0, 0.5) - 1.0).abs() < 1e-12); // the nearer end
    }
}
