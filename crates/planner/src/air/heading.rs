//! Where a vehicle looks while it flies: ahead along its way, at the end to where it was told, never turning too fast.
//!
//! The wanted headings at equal steps of time are unrolled to one continuous line; a sweep from the end and one from the start
//! cut it to the turning limit, so that a turn begins before it is needed. The result are control points of a quadratic
//! B-spline: its rate is a mean of their differences, so the limit holds at every instant, and its rate never jumps.

use std::f64::consts::{PI, TAU};

use super::trajectory::PolynomialTrajectory;

/// Time between control points (s).
const STEP_S: f64 = 0.1;
/// It looks to where it will be after this time (s).
const AHEAD_S: f64 = 0.8;
/// Nearer than that (m) is no direction.
const FURTHER_M: f64 = 0.15;
/// No profile is longer (s).
const LONGEST_S: f64 = 600.0;

/// A heading over time.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadingPlan {
    /// Control points; the spline spans from the middle of the first two to the middle of the last two.
    points: Vec<f64>,
}

impl HeadingPlan {
    /// The heading along a flight that begins with `yaw_rad`, turning at `rate_radps`; to `look_rad` at the end if that is given.
    /// Turns at most at `max_rate_radps` (a faster start is slowed at once); goes on turning after the flight until it looks there.
    /// Of numbers that make no sense: a heading that stays.
    pub fn along(
        flight: &PolynomialTrajectory,
        yaw_rad: f64,
        rate_radps: f64,
        look_rad: Option<f64>,
        max_rate_radps: f64,
    ) -> HeadingPlan {
        let duration_s = flight.duration();
        let is_known = [yaw_rad, rate_radps, duration_s, look_rad.unwrap_or(0.0)].iter().all(|x| x.is_finite())
            && max_rate_radps > 0.0
            && duration_s < LONGEST_S;
        if !is_known {
            return HeadingPlan { points: vec![if yaw_rad.is_finite() { yaw_rad } else { 0.0 }; 3] };
        }
        let most = max_rate_radps * STEP_S;
        let rate = rate_radps.clamp(-max_rate_radps, max_rate_radps) * STEP_S;
        // Value and rate at the start fix the first two control points.
        let first = [yaw_rad - 0.5 * rate, yaw_rad + 0.5 * rate];
        let steps = (duration_s / STEP_S).ceil() as usize + 2;
        let mut wanted: Vec<f64> = Vec::with_capacity(steps);
        let mut last = first[1];
        for k in 0..steps {
            let t = k as f64 * STEP_S;
            let way = flight.sample(t + AHEAD_S).p.xy() - flight.sample(t).p.xy();
            if way.norm() >= FURTHER_M {
                last += wrap(way.y.atan2(way.x) - last);
            }
            wanted.push(last);
        }
        // At the end the shorter way round from where it looked before.
        let end = look_rad.map(|look| last + wrap(look - last));
        if let Some(end) = end {
            let arrived = ((duration_s - AHEAD_S) / STEP_S).max(0.0) as usize;
            wanted.iter_mut().skip(arrived).for_each(|w| *w = end);
        }
        for k in (0..wanted.len().saturating_sub(1)).rev() {
            wanted[k] = wanted[k].clamp(wanted[k + 1] - most, wanted[k + 1] + most);
        }
        let mut points = first.to_vec();
        for w in wanted {
            let before = points[points.len() - 1];
            points.push(w.clamp(before - most, before + most));
        }
        // What is left to turn after the flight; twice the same point is rest.
        while let Some(end) = end
            && points[points.len() - 2..] != [end, end]
        {
            let before = points[points.len() - 1];
            points.push(end.clamp(before - most, before + most));
        }
        HeadingPlan { points }
    }

    /// How long it turns.
    pub fn duration(&self) -> f64 {
        (self.points.len() - 2) as f64 * STEP_S
    }

    /// Heading, not wrapped, and its rate; before the start and after the end what holds there, at rest.
    pub fn sample(&self, t_s: f64) -> (f64, f64) {
        let spans = self.points.len() - 2;
        let u = if t_s.is_finite() { (t_s / STEP_S).clamp(0.0, spans as f64) } else { 0.0 };
        let k = (u as usize).min(spans - 1);
        let (a, b, c) = (self.points[k], self.points[k + 1], self.points[k + 2]);
        let s = u - k as f64;
        let heading = 0.5 * ((1.0 - s) * (1.0 - s) * a + (1.0 + 2.0 * s * (1.0 - s)) * b + s * s * c);
        let is_inside = t_s >= 0.0 && t_s <= self.duration();
        let rate = if is_inside { ((1.0 - s) * (b - a) + s * (c - b)) / STEP_S } else { 0.0 };
        (heading, rate)
    }
}

/// Into (-pi, pi].
fn wrap(angle: f64) -> f64 {
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}
