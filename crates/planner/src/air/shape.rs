//! MINCO with penalties: the shape of a flight by L-BFGS over free numbers (MINCO section VI).
//!
//! The inner points live in the overlaps of the corridor (weights of their vertices) or in balls round given points, the
//! durations above their floor; effort, time and penalties are minimised without constraints. The result is near a good
//! flight but keeps no limit exactly: see [`super::penalty`].

use nalgebra::Vector3;

use super::diffeomorphism::{
    ball_gradient, ball_inverse, ball_point, duration, duration_inverse, duration_slope, hull_gradient, hull_inverse,
    hull_point,
};
use super::lbfgs::{LbfgsReport, LbfgsSettings, minimise};
use super::limits::{BoundaryState, FlightLimits};
use super::minco::{Minco, MincoError, MincoGradient};
use super::penalty::{PenalisedSpline, PenaltyError, PenaltyWeights};
use super::polytope::Polytope;

/// Where an inner point may be.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// In the convex hull of these points (at least one).
    Hull(Vec<Vector3<f64>>),
    /// In a closed ball.
    Ball {
        /// Its centre.
        centre: Vector3<f64>,
        /// Its radius (m).
        radius_m: f64,
    },
}

impl Place {
    fn is_somewhere(&self) -> bool {
        match self {
            Place::Hull(vertices) => !vertices.is_empty(),
            Place::Ball { radius_m, .. } => *radius_m > 0.0,
        }
    }

    fn size(&self) -> usize {
        match self {
            Place::Hull(vertices) => vertices.len(),
            Place::Ball { .. } => 3,
        }
    }

    fn point(&self, xi: &[f64]) -> Vector3<f64> {
        match self {
            Place::Hull(vertices) => hull_point(vertices, xi),
            Place::Ball { centre, radius_m } => ball_point(centre, *radius_m, &[xi[0], xi[1], xi[2]]),
        }
    }

    fn gradient(&self, xi: &[f64], by_point: &Vector3<f64>, by_xi: &mut [f64]) {
        match self {
            Place::Hull(vertices) => hull_gradient(vertices, xi, by_point, by_xi),
            Place::Ball { radius_m, .. } => {
                by_xi.copy_from_slice(&ball_gradient(*radius_m, &[xi[0], xi[1], xi[2]], by_point));
            }
        }
    }

    fn inverse(&self, point: &Vector3<f64>, xi: &mut [f64]) {
        match self {
            Place::Hull(vertices) => hull_inverse(vertices, point, xi),
            Place::Ball { centre, radius_m } => xi.copy_from_slice(&ball_inverse(centre, *radius_m, point)),
        }
    }
}

/// A spline and how it was found.
#[derive(Debug, Clone)]
pub struct Shape {
    /// The spline.
    pub spline: Minco<3>,
    /// How the optimiser ended; its cost is effort, time and penalties.
    pub report: LbfgsReport,
}

/// Shapes a flight of one piece more than `places`; piece `i` is wanted in `corridor[polytope_of[i]]`. `points` and
/// `durations_s` are where to begin.
///
/// # Errors
/// [`PenaltyError`].
#[allow(clippy::too_many_arguments)]
pub fn shape(
    head: &BoundaryState,
    tail: &BoundaryState,
    places: &[Place],
    corridor: &[Polytope],
    polytope_of: &[usize],
    points: &[Vector3<f64>],
    durations_s: &[f64],
    limits: &FlightLimits,
    weights: &PenaltyWeights,
    settings: &LbfgsSettings,
) -> Result<Shape, PenaltyError> {
    let pieces = durations_s.len();
    if places.len() + 1 != pieces || points.len() != places.len() || polytope_of.len() != pieces {
        return Err(MincoError::WrongLength { pieces, inner: points.len() }.into());
    }
    let is_finite = points.iter().flatten().chain(durations_s).all(|x| x.is_finite());
    if !is_finite {
        return Err(MincoError::NotFinite.into());
    }
    if let Some(place) = places.iter().position(|place| !place.is_somewhere()) {
        return Err(PenaltyError::NoPlace { place });
    }
    let mut cost = PenalisedSpline::new(head, tail, corridor, polytope_of, limits, *weights)?;
    // Free numbers: one for each duration, then those of the places.
    let mut first = vec![pieces];
    for place in places {
        first.push(first[first.len() - 1] + place.size());
    }
    let mut x = vec![0.0; first[places.len()]];
    for (tau, t) in x.iter_mut().zip(durations_s) {
        *tau = duration_inverse(*t, limits.min_duration_s);
    }
    for (k, place) in places.iter().enumerate() {
        place.inverse(&points[k], &mut x[first[k]..first[k + 1]]);
    }
    let mut inner = points.to_vec();
    let mut times = durations_s.to_vec();
    let mut gradient = MincoGradient::default();
    let report = minimise(&mut x, settings, |x, by_x| {
        decode(x, places, &first, limits.min_duration_s, &mut inner, &mut times);
        let mut value = cost.evaluate(&inner, &times, &mut gradient);
        if !value.is_finite() {
            return value;
        }
        for (k, by) in gradient.durations.iter().enumerate() {
            by_x[k] = by * duration_slope(x[k]);
        }
        for (k, place) in places.iter().enumerate() {
            let (xi, by_xi) = (&x[first[k]..first[k + 1]], &mut by_x[first[k]..first[k + 1]]);
            place.gradient(xi, &gradient.inner_points[k], by_xi);
            if let Place::Hull(_) = place {
                // Only the direction of xi counts: its length is held where rounding cannot hurt.
                let excess = xi.iter().map(|v| v * v).sum::<f64>() - 1.0;
                if excess > 0.0 {
                    value += excess * excess * excess;
                    for (g, v) in by_xi.iter_mut().zip(xi) {
                        *g += 6.0 * excess * excess * v;
                    }
                }
            }
        }
        value
    });
    decode(&x, places, &first, limits.min_duration_s, &mut inner, &mut times);
    let spline = Minco::solve(head, tail, &inner, &times)?;
    Ok(Shape { spline, report })
}

fn decode(x: &[f64], places: &[Place], first: &[usize], floor_s: f64, inner: &mut [Vector3<f64>], times: &mut [f64]) {
    for (t, tau) in times.iter_mut().zip(x) {
        *t = duration(*tau, floor_s);
    }
    for (k, (q, place)) in inner.iter_mut().zip(places).enumerate() {
        *q = place.point(&x[first[k]..first[k + 1]]);
    }
}
