//! Effort, time and barrier of one piece of a corridor flight, with gradient and Hessian.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use nalgebra::{Matrix3, Vector3};

use super::barrier::{Barrier, NEAR, Sum};
use super::flatness::ThrustAxis;
use super::limits::FlightLimits;
use super::node_form::{
    ACCELERATION, Ends, Linear, Local, POSITION, SAMPLES, VELOCITY_HULL, effort_entry, powers, sample_tables,
};
use super::polytope::Polytope;

/// `sqrt(1 + 0.01)`: the rate counts as `sqrt(share^2 + 0.01)`, which grows like the rate and is smooth at rest.
const RATE_EDGE: f64 = 1.004_987_562_112_089;

/// What is taken off the limits: room for rounding, and for what the samples do not see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tighten {
    /// Off every face (m).
    pub faces_m: f64,
    /// Share of the speed and acceleration limits.
    pub motion: f64,
    /// Share of the rotor limits.
    pub rotors: f64,
}

/// Where a piece flies. The two ends of a flight are given: nobody answers for them.
pub(crate) struct Place<'a> {
    pub polytope: &'a Polytope,
    pub is_first: bool,
    pub is_last: bool,
}

/// The cost of pieces at one strength of the barrier.
pub(crate) struct PieceCost<'a> {
    limits: &'a FlightLimits,
    tighten: Tighten,
    pub barrier: Barrier,
    sample_tables: [[[f64; 6]; 3]; SAMPLES],
}

impl<'a> PieceCost<'a> {
    pub fn new(limits: &'a FlightLimits, tighten: Tighten) -> Self {
        let barrier = Barrier { weight: 1.0, softness: 0.1 };
        PieceCost { limits, tighten, barrier, sample_tables: sample_tables() }
    }

    /// Cost and barrier of a piece.
    pub fn value(&self, place: &Place, ends: &Ends, theta: f64) -> f64 {
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
            for face in &place.polytope.faces {
                sum.add(barrier, face.offset_m - self.tighten.faces_m - face.normal.dot(p));
            }
        };
        for unit in &POSITION {
            inside(&Linear::new(*unit, 0, &powers).value(ends));
        }
        if !place.is_first {
            inside(&ends[0]);
        }
        if !place.is_last {
            inside(&ends[3]);
        }
        let speed = self.motion_scale(self.limits.max_speed_mps);
        for unit in &VELOCITY_HULL {
            sum.add(barrier, 1.0 - Linear::new(*unit, 1, &powers).value(ends).norm_squared() * speed);
        }
        if !place.is_first {
            sum.add(barrier, 1.0 - ends[1].norm_squared() * speed);
        }
        let accel = self.motion_scale(self.limits.max_accel_mps2);
        if accel > 0.0 {
            for unit in &ACCELERATION {
                sum.add(barrier, 1.0 - Linear::new(*unit, 2, &powers).value(ends).norm_squared() * accel);
            }
            if !place.is_first {
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

    /// Gradient and Hessian of a piece.
    pub fn expand(&self, place: &Place, ends: &Ends, theta: f64) -> Local {
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
        for point in inner.chain((!place.is_first).then_some(start)).chain((!place.is_last).then_some(end)) {
            let p = point.value(ends);
            let (mut gradient, mut hessian) = (Vector3::zeros(), Matrix3::zeros());
            for face in &place.polytope.faces {
                let (first, second) = barrier.slopes(face.offset_m - self.tighten.faces_m - face.normal.dot(&p));
                gradient -= face.normal * first;
                let scaled = face.normal * second;
                hessian += scaled * face.normal.transpose();
            }
            local.add(&point, ends, &gradient, &hessian);
        }
        // Speed and acceleration.
        let mut ball = |vector: Linear, scale: f64| {
            let v = vector.value(ends);
            let (first, second) = barrier.slopes(1.0 - v.norm_squared() * scale);
            let gradient = v * (-2.0 * scale * first);
            let hessian =
                Matrix3::identity() * (-2.0 * scale * first) + v * v.transpose() * (4.0 * scale * scale * second);
            local.add(&vector, ends, &gradient, &hessian);
        };
        let speed = self.motion_scale(self.limits.max_speed_mps);
        for unit in &VELOCITY_HULL {
            ball(Linear::new(*unit, 1, &powers), speed);
        }
        if !place.is_first {
            ball(Linear::new([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 1, &powers), speed);
        }
        let accel = self.motion_scale(self.limits.max_accel_mps2);
        if accel > 0.0 {
            for unit in &ACCELERATION {
                ball(Linear::new(*unit, 2, &powers), accel);
            }
            if !place.is_first {
                ball(Linear::new([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 2, &powers), accel);
            }
        }
        if self.limits.airframe.is_some() {
            self.expand_rotors(&mut local, ends, &powers);
        }
        local
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
                    _ => axis.reverse(airframe, 1.0 / self.limits.thrust_scale_n(), &zero, &zero),
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
            (axis.thrust_n - self.limits.min_thrust_n) / self.limits.thrust_scale_n() - self.tighten.rotors,
        ]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, SVector};

    use super::*;
    use crate::air::flatness::Airframe;

    type Vector19 = SVector<f64, 19>;

    fn unpack(x: &Vector19) -> (Ends, f64) {
        (std::array::from_fn(|b| x.fixed_rows::<3>(3 * b).into_owned()), x[18])
    }

    /// Every barrier is felt here, from inside and from beyond. The Hessian is exact but for the rotors' share.
    #[test]
    fn gradient_and_curvature_are_those_of_the_value() {
        let airframe = Airframe {
            mass_kg: 0.6,
            gravity_mps2: 9.8,
            drag_across: 0.7,
            drag_along: 0.8,
            drag_parasitic: 0.05,
            speed_epsilon: 1e-4,
        };
        let polytope = Polytope::from_box(&Point3::new(-1.0, -1.0, -1.0), &Point3::new(1.3, 1.1, 0.9));
        let x = Vector19::from_fn(|k, _| if k == 18 { -0.2 } else { 0.7 * (1.9 * k as f64 + 0.4).sin() });
        for airframe in [None, Some(airframe)] {
            let limits = FlightLimits {
                max_speed_mps: 1.6,
                max_accel_mps2: 5.0,
                airframe,
                max_tilt_rad: 0.4,
                max_rate_radps: 1.4,
                min_thrust_n: 5.4,
                max_thrust_n: 7.0,
                min_duration_s: 0.5,
                time_weight: 20.0,
            };
            let mut cost = PieceCost::new(&limits, Tighten { faces_m: 1e-3, motion: 1e-3, rotors: 1e-3 });
            cost.barrier = Barrier { weight: 3.0, softness: 0.05 };
            for (is_first, is_last) in [(false, false), (true, false), (false, true)] {
                let place = Place { polytope: &polytope, is_first, is_last };
                let value = |x: &Vector19| {
                    let (ends, theta) = unpack(x);
                    cost.value(&place, &ends, theta)
                };
                let expand = |x: &Vector19| {
                    let (ends, theta) = unpack(x);
                    cost.expand(&place, &ends, theta)
                };
                let gradient = |x: &Vector19| {
                    let local = expand(x);
                    Vector19::from_fn(|k, _| if k == 18 { local.by_theta } else { local.gradient[k / 3][k % 3] })
                };
                let local = expand(&x);
                let exact = gradient(&x);
                for k in 0..19 {
                    let step = Vector19::from_fn(|m, _| if m == k { 1e-5 } else { 0.0 });
                    let slope = (value(&(x + step)) - value(&(x - step))) / 2e-5;
                    assert!((slope - exact[k]).abs() < 1e-5 * exact.norm(), "{k}: {slope} {}", exact[k]);
                    if airframe.is_some() {
                        continue;
                    }
                    let column = (gradient(&(x + step)) - gradient(&(x - step))) / 2e-5;
                    for m in k..19 {
                        let entry = match (k, m) {
                            (18, _) => local.theta_theta,
                            (_, 18) => local.mixed[k / 3][k % 3],
                            _ => local.hessian[m / 3][k / 3][(m % 3, k % 3)],
                        };
                        assert!((column[m] - entry).abs() < 1e-5 * column.norm(), "{k} {m}: {} {entry}", column[m]);
                    }
                }
            }
        }
    }
}
