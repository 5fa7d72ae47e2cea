//! A sound check of a trajectory in continuous time: each piece inside its polytope, speed and acceleration within limits.
//!
//! A Bernstein piece lies in the convex hull of its control points, so control points inside a polytope (or a ball)
//! prove the whole piece. Where they do not, the piece is halved, which moves them quadratically toward the curve.

use nalgebra::Vector3;

use super::polytope::Polytope;
use super::trajectory::{Piece, PolynomialTrajectory, halves};

/// Halvings before a piece is called unproved: 64 parts.
const MAX_DEPTH: u32 = 6;
/// Rounding allowed on limits and faces: metres, m/s, m/s^2.
pub const CERTIFICATE_TOL: f64 = 1e-9;

/// What was proved about a trajectory. All bounds hold at every instant, not only at samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// Whether every piece is inside its polytope and both limits hold.
    pub holds: bool,
    /// Proved upper bound of the speed.
    pub max_speed_mps: f64,
    /// Proved upper bound of the acceleration.
    pub max_accel_mps2: f64,
    /// Proved lower bound of the distance to the faces of the corridor; negative if a piece is not proved inside.
    pub corridor_slack_m: f64,
    /// Distance that every point of the corridor keeps from obstacles (body radius and margin): what "inside" buys.
    pub clearance_m: f64,
}

/// The bounds of one piece.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PieceBounds {
    pub speed: f64,
    pub accel: f64,
    pub slack: f64,
}

/// Checks each piece `i` against `corridor[polytope_of[i]]` and both limits.
pub fn certify(
    trajectory: &PolynomialTrajectory,
    corridor: &[Polytope],
    polytope_of: &[usize],
    max_speed_mps: f64,
    max_accel_mps2: f64,
    clearance_m: f64,
) -> Certificate {
    let mut certificate = Certificate {
        holds: !trajectory.pieces.is_empty() && polytope_of.len() == trajectory.pieces.len(),
        max_speed_mps: 0.0,
        max_accel_mps2: 0.0,
        corridor_slack_m: f64::INFINITY,
        clearance_m,
    };
    for (piece, &k) in trajectory.pieces.iter().zip(polytope_of) {
        let Some(polytope) = corridor.get(k) else {
            certificate.holds = false;
            break;
        };
        let bounds = bound(piece, polytope, max_speed_mps, max_accel_mps2);
        certificate.max_speed_mps = certificate.max_speed_mps.max(bounds.speed);
        certificate.max_accel_mps2 = certificate.max_accel_mps2.max(bounds.accel);
        certificate.corridor_slack_m = certificate.corridor_slack_m.min(bounds.slack);
    }
    // NaN fails every comparison.
    certificate.holds &= certificate.max_speed_mps <= max_speed_mps + CERTIFICATE_TOL
        && certificate.max_accel_mps2 <= max_accel_mps2 + CERTIFICATE_TOL
        && certificate.corridor_slack_m >= -CERTIFICATE_TOL;
    certificate
}

/// Bounds of one piece, as tight as needed to decide against the limits.
pub(crate) fn bound(piece: &Piece, polytope: &Polytope, max_speed_mps: f64, max_accel_mps2: f64) -> PieceBounds {
    let norm = |points: &[Vector3<f64>]| points.iter().map(|p| p.norm()).fold(0.0, pick_larger);
    let outside =
        |points: &[Vector3<f64>]| points.iter().map(|p| -polytope.slack(p)).fold(f64::NEG_INFINITY, pick_larger);
    PieceBounds {
        speed: upper(&piece.control_points(1), max_speed_mps, MAX_DEPTH, &norm),
        accel: upper(&piece.control_points(2), max_accel_mps2, MAX_DEPTH, &norm),
        slack: -upper(&piece.control_points(0), 0.0, MAX_DEPTH, &outside),
    }
}

/// An upper bound of a convex function over a Bernstein curve: its largest value on the control points, refined by
/// halving while the bound is above the limit but the curve's own points are not.
fn upper(points: &[Vector3<f64>], limit: f64, depth: u32, largest: &impl Fn(&[Vector3<f64>]) -> f64) -> f64 {
    let bound = largest(points);
    if bound <= limit || depth == 0 {
        return bound;
    }
    let ends = [points[0], points[points.len() - 1]];
    if largest(&ends) > limit + CERTIFICATE_TOL {
        // Truly violated: no refinement will help.
        return bound;
    }
    let (left, right) = halves(points);
    pick_larger(upper(&left, limit, depth - 1, largest), upper(&right, limit, depth - 1, largest))
}

/// Maximum that keeps NaN.
fn pick_larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}
