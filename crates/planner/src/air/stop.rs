//! Coming to rest from any state.

use nalgebra::Vector3;

use super::limits::FlightLimits;
use super::minco::Minco;
use super::polytope::Polytope;
use super::proof::prove;
use super::trajectory::{Piece, PolynomialTrajectory};

/// The smooth way to rest: the end point is free, so the vehicle stops where it stops. The duration is the shortest of a fixed
/// ladder for which every limit is proved; of a start that is beyond a limit already, the gentlest of the ladder.
pub fn stop_trajectory(start: &super::FlightState, limits: &FlightLimits) -> PolynomialTrajectory {
    let head = [start.p.coords, start.v, start.a];
    let anywhere = [Polytope::default()];
    let mut duration_s = (head[1].norm() / limits.max_accel_mps2.max(1e-3)).max(0.2).max(limits.min_duration_s);
    let mut stop = PolynomialTrajectory::default();
    for _ in 0..24 {
        stop.pieces = vec![piece_of(&head, duration_s)];
        if prove(&stop, &anywhere, &[0], limits).holds {
            break;
        }
        duration_s *= 1.12;
    }
    stop
}

fn piece_of(head: &[Vector3<f64>; 3], t: f64) -> Piece {
    // Least jerk with the end position free: the jerk vanishes there, which puts the end at p + v T/2 + a T^2/12.
    let end = head[0] + head[1] * (0.5 * t) + head[2] * (t * t / 12.0);
    let zero = Vector3::zeros();
    match Minco::<3>::solve(head, &[end, zero, zero], &[], &[t]) {
        Ok(spline) => Piece { duration_s: t, coefficients: spline.coefficients().to_vec() },
        // A state that is not finite: stay.
        Err(_) => Piece { duration_s: t, coefficients: vec![head[0]] },
    }
}

#[cfg(test)]
mod tests {
    use super::super::FlightState;
    use super::super::config::AirConfig;
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn comes_to_rest_within_the_limit() {
        let start = FlightState {
            p: Point3::new(1.0, 2.0, 3.0),
            v: Vector3::new(1.3, -0.5, 0.2),
            a: Vector3::new(0.0, 1.0, 0.0),
        };
        let stop = stop_trajectory(&start, &AirConfig::default().limits);
        let end = stop.pieces[0].sample(stop.duration());
        assert!(end.v.norm() < 1e-9 && end.a.norm() < 1e-9);
        for k in 0..=200 {
            let s = stop.sample(stop.duration() * f64::from(k) / 200.0);
            assert!(s.a.norm() <= 2.0 + 1e-9);
        }
        assert!(stop.duration() < 3.0);
    }
}
