//! A sound check of a trajectory in continuous time: each piece inside its polytope, speed and acceleration within limits.
//!
//! A Bernstein piece lies in the convex hull of its control points, so control points inside a polytope (or a ball)
//! prove the whole piece. Where they do not, the piece is halved, which moves them quadratically toward the curve.

use nalgebra::Vector3;

use super::bernstein::QuinticPoints;
use super::polytope::Polytope;
use super::proof::{POLYNOMIAL_DEPTH, PROOF_TOL, larger, smaller, upper};
use super::trajectory::{Piece, PolynomialTrajectory};

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

/// Checks each piece `i` against `corridor[polytope_of[i]]` and both limits (m/s, m/s^2), each by itself: that pieces join is the
/// business of the spline. `clearance_m` is handed on.
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
        certificate.max_speed_mps = larger(certificate.max_speed_mps, bounds.speed);
        certificate.max_accel_mps2 = larger(certificate.max_accel_mps2, bounds.accel);
        certificate.corridor_slack_m = smaller(certificate.corridor_slack_m, bounds.slack);
    }
    // The bounds keep NaN, and NaN fails every comparison.
    certificate.holds &= certificate.max_speed_mps <= max_speed_mps + PROOF_TOL
        && certificate.max_accel_mps2 <= max_accel_mps2 + PROOF_TOL
        && certificate.corridor_slack_m >= -PROOF_TOL;
    certificate
}

/// Bounds of one piece, as tight as needed to decide against the limits. Nothing is known of pieces beyond quintics, or of no
/// duration.
pub(crate) fn bound(piece: &Piece, polytope: &Polytope, max_speed_mps: f64, max_accel_mps2: f64) -> PieceBounds {
    let Some(points) = QuinticPoints::new(&piece.coefficients, piece.duration_s) else {
        return PieceBounds { speed: f64::INFINITY, accel: f64::INFINITY, slack: f64::NEG_INFINITY };
    };
    let norm = |p: &Vector3<f64>| p.norm();
    let outside = |p: &Vector3<f64>| -polytope.slack(p);
    PieceBounds {
        speed: upper(&points.velocity, max_speed_mps, POLYNOMIAL_DEPTH, &norm),
        accel: upper(&points.acceleration, max_accel_mps2, POLYNOMIAL_DEPTH, &norm),
        slack: -upper(&points.position, 0.0, POLYNOMIAL_DEPTH, &outside),
    }
}
