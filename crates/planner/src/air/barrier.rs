//! A barrier that is defined everywhere: the logarithm of a slack, which goes over into a parabola below a small one.

/// Limits that are far away in most pieces count from this slack on (share of the limit).
pub(crate) const NEAR: f64 = 0.2;

/// A logarithm of the slack that goes over into a parabola below `softness`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Barrier {
    pub weight: f64,
    pub softness: f64,
}

/// Sums logarithms of many slacks with few calls of `ln`.
pub(crate) struct Sum {
    product: f64,
    total: f64,
}

impl Sum {
    pub fn new() -> Self {
        Sum { product: 1.0, total: 0.0 }
    }

    pub fn add(&mut self, barrier: &Barrier, slack: f64) {
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
    pub fn add_near(&mut self, barrier: &Barrier, slack: f64) {
        if slack < NEAR {
            let u = slack / NEAR - 1.0;
            self.add(barrier, slack);
            self.total += NEAR.ln() + u - 0.5 * u * u;
        }
    }

    pub fn value(&self, barrier: &Barrier) -> f64 {
        barrier.weight * (self.total - self.product.ln())
    }
}

impl Barrier {
    /// Derivatives of the barrier that begins at `NEAR`; zero further inside.
    pub fn slopes_near(&self, slack: f64) -> (f64, f64) {
        let (first, second) = self.slopes(slack);
        let inverse = 1.0 / NEAR;
        let u = slack * inverse - 1.0;
        (first + self.weight * (inverse - u * inverse), second - self.weight * inverse * inverse)
    }

    /// First and second derivative by the slack.
    pub fn slopes(&self, slack: f64) -> (f64, f64) {
        if slack >= self.softness {
            let inverse = slack.recip();
            (-self.weight * inverse, self.weight * inverse * inverse)
        } else {
            let inverse = self.softness.recip();
            (self.weight * (slack * inverse - 2.0) * inverse, self.weight * inverse * inverse)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_slope_and_curvature_belong_together_on_every_branch() {
        let barrier = Barrier { weight: 0.7, softness: 0.05 };
        let value = |slack: f64, is_near: bool| {
            let mut sum = Sum::new();
            if is_near {
                sum.add_near(&barrier, slack)
            } else {
                sum.add(&barrier, slack)
            }
            sum.value(&barrier)
        };
        for slack in [-0.3, 0.02, 0.08, 0.15, 1.4] {
            for is_near in [false, true] {
                let h = 1e-4;
                let (first, second) = match is_near {
                    true if slack >= NEAR => (0.0, 0.0),
                    true => barrier.slopes_near(slack),
                    false => barrier.slopes(slack),
                };
                let at = |d: f64| value(slack + d, is_near);
                assert!(((at(h) - at(-h)) / (2.0 * h) - first).abs() < 1e-3 * (1.0 + first.abs()));
                assert!(((at(h) - 2.0 * at(0.0) + at(-h)) / (h * h) - second).abs() < 1e-3 * (1.0 + second.abs()));
            }
        }
    }
}
