//! The penalties of one piece, four samples side by side: what [`super::penalty`] says sample by sample, in plain arrays of four that the
//! compiler turns into vector instructions. A test holds the two together.
//!
//! With `u = t / T` and `d_k = c_k T^k` the bases `u^k` and their derivatives are the same for all pieces and worked out once. The kinks are
//! sums of clamped parts instead of branches; samples of four without any violation end after the limits were looked at.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use std::array::from_fn;
use std::ops::{Add, Mul, Sub};

use nalgebra::Vector3;

use super::flatness::Airframe;
use super::hermite::factor;
use super::limits::FlightLimits;
use super::penalty::PenaltyWeights;
use super::polytope::HalfSpace;

/// Samples side by side.
const WIDE: usize = 4;

/// The samples of every piece: as many as go four by four, and the rest one by one.
#[derive(Debug, Clone)]
pub(super) struct Samples {
    wide: Vec<Basis<WIDE>>,
    single: Vec<Basis<1>>,
    intervals: f64,
}

impl Samples {
    pub fn new(intervals: usize) -> Samples {
        let count = intervals + 1;
        let wide = count / WIDE;
        Samples {
            wide: (0..wide).map(|k| Basis::new(WIDE * k, intervals)).collect(),
            single: (WIDE * wide..count).map(|k| Basis::new(k, intervals)).collect(),
            intervals: intervals as f64,
        }
    }
}

/// `u^k` and its derivatives at some samples.
#[derive(Debug, Clone, Copy)]
struct Basis<const W: usize> {
    share: Lanes<W>,
    /// Trapezoid rule: 1/2 at the ends.
    end: Lanes<W>,
    /// By derivative, then by power.
    powers: [[Lanes<W>; 6]; 5],
}

impl<const W: usize> Basis<W> {
    fn new(first: usize, intervals: usize) -> Self {
        let share = Lanes(from_fn(|i| (first + i) as f64 / intervals as f64));
        let is_end = |k: usize| k == 0 || k == intervals;
        let power = |derivative: usize, k: usize| {
            Lanes(from_fn(|i| {
                let low = k.saturating_sub(derivative);
                factor(k, derivative) * share.0[i].powi(low as i32)
            }))
        };
        Basis {
            share,
            end: Lanes(from_fn(|i| if is_end(first + i) { 0.5 } else { 1.0 })),
            powers: from_fn(|derivative| from_fn(|k| power(derivative, k))),
        }
    }
}

/// What is asked of one piece.
pub(super) struct Piece<'a> {
    pub coefficients: &'a [Vector3<f64>; 6],
    pub duration_s: f64,
    /// Those that the hull does not prove.
    pub open_faces: &'a [HalfSpace],
    /// Asked for where the hull does not prove the rotors' limits.
    pub airframe: Option<&'a Airframe>,
    pub limits: &'a FlightLimits,
    pub weights: &'a PenaltyWeights,
}

/// Penalty of a piece, and its derivative by the duration; that by the coefficients is added to `by`.
pub(super) fn penalty(piece: &Piece, samples: &Samples, by: &mut [Vector3<f64>]) -> (f64, f64) {
    let (duration, inverse) = (piece.duration_s, piece.duration_s.recip());
    let mut scaled = *piece.coefficients;
    let mut powers = [1.0; 6];
    for k in 1..6 {
        powers[k] = powers[k - 1] * duration;
        scaled[k] *= powers[k];
    }
    // The coefficients of each derivative by t.
    let mut derivatives = [scaled; 5];
    for derivative in 1..5 {
        derivatives[derivative] = derivatives[derivative - 1].map(|d| d * inverse);
    }
    let work = Work { piece, derivatives: &derivatives, inverse, step: duration / samples.intervals };
    let (mut wide, mut single) = (Sums::default(), Sums::default());
    samples.wide.iter().for_each(|basis| work.add(basis, &mut wide));
    samples.single.iter().for_each(|basis| work.add(basis, &mut single));
    for k in 0..6 {
        by[k] += (wide.by[k].sum() + single.by[k].sum()) * powers[k];
    }
    let total = wide.total.sum() + single.total.sum();
    (total * duration / samples.intervals, (wide.by_duration.sum() + single.by_duration.sum()) / samples.intervals)
}

struct Work<'a> {
    piece: &'a Piece<'a>,
    derivatives: &'a [[Vector3<f64>; 6]; 5],
    inverse: f64,
    /// Time between samples.
    step: f64,
}

/// Weighted sums over samples, still lane by lane.
struct Sums<const W: usize> {
    total: Lanes<W>,
    by_duration: Lanes<W>,
    by: [Vectors<W>; 6],
}

impl<const W: usize> Default for Sums<W> {
    fn default() -> Self {
        Sums { total: Lanes::ZERO, by_duration: Lanes::ZERO, by: [Vectors::ZERO; 6] }
    }
}

impl Work<'_> {
    fn add<const W: usize>(&self, basis: &Basis<W>, sums: &mut Sums<W>) {
        let at = |derivative: usize| {
            let (d, powers) = (&self.derivatives[derivative], &basis.powers[derivative]);
            let mut sum = Vectors::ZERO;
            for k in derivative..6 {
                sum = sum + Vectors::one(&d[k]) * powers[k];
            }
            sum
        };
        let (weights, smoothing) = (self.piece.weights, self.piece.weights.smoothing);
        let (v, a, j) = (at(1), at(2), at(3));
        let mut penalty = Lanes::ZERO;
        let mut by_p = Vectors::ZERO;
        if !self.piece.open_faces.is_empty() {
            let p = at(0);
            for face in self.piece.open_faces {
                let normal = Vectors::one(&face.normal);
                let outside = normal.dot(&p) - Lanes::all(face.offset_m);
                if outside.is_any_positive() {
                    let (value, slope) = kink(outside, smoothing);
                    penalty = penalty + value * weights.corridor;
                    by_p = by_p + normal * (slope * weights.corridor);
                }
            }
        }
        let fastest = self.piece.limits.max_speed_mps * self.piece.limits.max_speed_mps;
        let too_fast = v.dot(&v) - Lanes::all(fastest);
        let (mut by_v, mut by_a, mut by_j) = (Vectors::ZERO, Vectors::ZERO, Vectors::ZERO);
        if too_fast.is_any_positive() {
            let (value, slope) = kink(too_fast, smoothing);
            penalty = penalty + value * weights.speed;
            by_v = v * (slope * (2.0 * weights.speed));
        }
        if let Some(airframe) = self.piece.airframe
            && let Some((value, by)) = rotors(airframe, self.piece.limits, weights, &v, &a, &j)
        {
            penalty = penalty + value;
            (by_v, by_a, by_j) = (by_v + by[0], by[1], by[2]);
        }
        if !penalty.is_any_positive() {
            return;
        }
        sums.total = sums.total + basis.end * penalty;
        let along = by_p.dot(&v) + by_v.dot(&a) + by_a.dot(&j) + by_j.dot(&at(4));
        sums.by_duration = sums.by_duration + basis.end * (basis.share * along * self.piece.duration_s + penalty);
        // A derivative by t is one by u, divided by T as often.
        let weight = basis.end * self.step;
        let by = [
            by_p * weight,
            by_v * (weight * self.inverse),
            by_a * (weight * self.inverse.powi(2)),
            by_j * (weight * self.inverse.powi(3)),
        ];
        for (derivative, by) in by.iter().enumerate() {
            for k in derivative..6 {
                sums.by[k] = sums.by[k] + *by * basis.powers[derivative][k];
            }
        }
    }
}

/// Penalties of tilt, rate and thrust, and their gradient by velocity, acceleration and jerk; `None` where there are none. The forward and
/// the reverse pass of [`super::flatness`].
fn rotors<const W: usize>(
    airframe: &Airframe,
    limits: &FlightLimits,
    weights: &PenaltyWeights,
    v: &Vectors<W>,
    a: &Vectors<W>,
    j: &Vectors<W>,
) -> Option<(Lanes<W>, [Vectors<W>; 3])> {
    let over_mass = airframe.drag_across / airframe.mass_kg;
    let (cp, along_drag) = (airframe.drag_parasitic, airframe.drag_along);
    let one = Lanes::all(1.0);
    let s = (v.dot(v) + Lanes::all(airframe.speed_epsilon)).sqrt();
    let over_s = s.recip();
    let growth = one + s * cp;
    let w = *v * growth;
    let q = v.dot(a) * over_s;
    let dw = *a * growth + *v * (q * cp);
    let lifted = Vectors { z: a.z + Lanes::all(airframe.gravity_mps2), ..*a };
    let zu = lifted + w * Lanes::all(over_mass);
    let over_norm = zu.dot(&zu).sqrt().recip();
    let z = zu * over_norm;
    let force = lifted * Lanes::all(airframe.mass_kg) + w * Lanes::all(along_drag);
    let thrust = z.dot(&force);
    let turning = *j + dw * Lanes::all(over_mass);
    let turning_along = z.dot(&turning);
    let dz = (turning - z * turning_along) * over_norm;
    let below = (one + z.z).recip();
    let twist = (z.y * dz.x - z.x * dz.y) * below;

    let steepest = limits.max_tilt_rad.cos();
    let is_steep = z.z.0.iter().any(|z| *z < steepest);
    let beyond_rate = dz.dot(&dz) + twist * twist - Lanes::all(limits.max_rate_radps * limits.max_rate_radps);
    let middle = 0.5 * (limits.max_thrust_n + limits.min_thrust_n);
    let radius = 0.5 * (limits.max_thrust_n - limits.min_thrust_n);
    let off = thrust - Lanes::all(middle);
    let beyond_thrust = off * off - Lanes::all(radius * radius);
    let is_turning = beyond_rate.is_any_positive();
    let is_pushing = radius.is_finite() && beyond_thrust.is_any_positive();
    if !(is_steep || is_turning || is_pushing) {
        return None;
    }

    let mut penalty = Lanes::ZERO;
    let (mut by_z, mut by_dz, mut by_thrust) = (Vectors::ZERO, Vectors::ZERO, Lanes::ZERO);
    if is_steep {
        // The angle is only worked out where it is too large.
        let tilt = Lanes(z.z.0.map(|z| if z < steepest { z.clamp(-1.0, 1.0).acos() } else { 0.0 }));
        let (value, slope) = kink(tilt - Lanes::all(limits.max_tilt_rad), weights.smoothing);
        penalty = penalty + value * weights.tilt;
        let sine = Lanes((one - z.z * z.z).0.map(|x| x.max(1e-12))).sqrt();
        by_z.z = by_z.z - slope * weights.tilt * sine.recip();
    }
    if is_turning {
        let (value, slope) = kink(beyond_rate, weights.smoothing);
        penalty = penalty + value * weights.rate;
        let slope = slope * weights.rate;
        let by_twist = twist * below * slope * 2.0;
        by_z = by_z + Vectors { x: Lanes::ZERO - dz.y, y: dz.x, z: Lanes::ZERO - twist } * by_twist;
        by_dz = dz * (slope * 2.0) + Vectors { x: z.y, y: Lanes::ZERO - z.x, z: Lanes::ZERO } * by_twist;
    }
    if is_pushing {
        let (value, slope) = kink(beyond_thrust, weights.smoothing);
        penalty = penalty + value * weights.thrust;
        by_thrust = slope * off * (2.0 * weights.thrust);
    }

    // f = z . force; dz = (turning - z (z . turning)) / norm; z = zu / norm
    by_z = by_z + force * by_thrust;
    let along = z.dot(&by_dz);
    let by_turning = (by_dz - z * along) * over_norm;
    by_z = by_z - (by_dz * turning_along + turning * along) * over_norm;
    let by_norm = Lanes::ZERO - by_dz.dot(&dz) * over_norm;
    let by_zu = (by_z - z * z.dot(&by_z)) * over_norm + z * by_norm;
    // zu, force, turning by w, dw, a, j
    let by_force = z * by_thrust;
    let by_w = by_zu * Lanes::all(over_mass) + by_force * Lanes::all(along_drag);
    let by_dw = by_turning * Lanes::all(over_mass);
    let pull = v.dot(&by_dw);
    let pull_over_s = pull * over_s * cp;
    let by_a = by_zu + by_force * Lanes::all(airframe.mass_kg) + by_dw * growth + *v * pull_over_s;
    let by_s = (a.dot(&by_dw) - pull * q * over_s + v.dot(&by_w)) * cp;
    let by_v = by_w * growth + by_dw * (q * cp) + *a * pull_over_s + *v * (by_s * over_s);
    Some((penalty, [by_v, by_a, by_turning]))
}

/// The rounded kink of [`super::penalty`] without branches: the cubic up to its width, and what is beyond it. Zero for NaN.
fn kink<const W: usize>(x: Lanes<W>, width: f64) -> (Lanes<W>, Lanes<W>) {
    let inside = Lanes(x.0.map(|x| {
        let positive = if x > 0.0 { x } else { 0.0 };
        if positive < width { positive } else { width }
    }));
    let beyond = Lanes(x.0.map(|x| if x > width { x - width } else { 0.0 }));
    let u = inside * width.recip();
    let squared = u * u;
    ((Lanes::all(width) - inside * 0.5) * squared * u + beyond, squared * (Lanes::all(3.0) - u * 2.0))
}

/// Numbers side by side.
#[derive(Debug, Clone, Copy)]
struct Lanes<const W: usize>([f64; W]);

impl<const W: usize> Lanes<W> {
    const ZERO: Self = Lanes([0.0; W]);

    fn all(value: f64) -> Self {
        Lanes([value; W])
    }

    fn sqrt(self) -> Self {
        Lanes(self.0.map(f64::sqrt))
    }

    fn recip(self) -> Self {
        Lanes(self.0.map(f64::recip))
    }

    fn sum(self) -> f64 {
        self.0.iter().sum()
    }

    fn is_any_positive(&self) -> bool {
        self.0.iter().fold(false, |any, x| any | (*x > 0.0))
    }
}

impl<const W: usize> Add for Lanes<W> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Lanes(from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl<const W: usize> Sub for Lanes<W> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Lanes(from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl<const W: usize> Mul for Lanes<W> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Lanes(from_fn(|i| self.0[i] * other.0[i]))
    }
}

impl<const W: usize> Mul<f64> for Lanes<W> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        Lanes(self.0.map(|x| x * factor))
    }
}

/// Vectors side by side.
#[derive(Debug, Clone, Copy)]
struct Vectors<const W: usize> {
    x: Lanes<W>,
    y: Lanes<W>,
    z: Lanes<W>,
}

impl<const W: usize> Vectors<W> {
    const ZERO: Self = Vectors { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::ZERO };

    fn one(v: &Vector3<f64>) -> Self {
        Vectors { x: Lanes::all(v.x), y: Lanes::all(v.y), z: Lanes::all(v.z) }
    }

    #[inline(always)]
    fn dot(&self, other: &Self) -> Lanes<W> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    fn sum(&self) -> Vector3<f64> {
        Vector3::new(self.x.sum(), self.y.sum(), self.z.sum())
    }
}

impl<const W: usize> Add for Vectors<W> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Vectors { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<const W: usize> Sub for Vectors<W> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Vectors { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<const W: usize> Mul<Lanes<W>> for Vectors<W> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: Lanes<W>) -> Self {
        Vectors { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}
