//! The belief at an earlier time of the last scan: the way that leads to the corrected state at its end, walked back.
//!
//! ```text
//! x_k = f^-1(x_{k+1}, u_k)        P_k = F^-1 (P_{k+1} + Q) F^-T        over the knots, from the end on
//! ```
//! The state is what FAST-LIO2 (Eq. 9) deskews with. Departure: the covariance takes the noise of the way between for
//! independent of the error at the end. It is not, quite: the update at the end has seen part of it. So this is on the safe
//! side of a smoother's covariance, by no more than the noise of a tenth of a second.

use nalgebra::{UnitQuaternion, Vector3};

use crate::Stamp;
use crate::odometry::config::LioConfig;
use crate::odometry::filter::Belief;
use crate::odometry::propagation::{ImuInput, Knot, propagate_covariance, symmetric, transition};
use crate::odometry::state::{Covariance, ImuState};

/// The belief at `stamp`, and the angular velocity of the IMU there. `knots` lead to `end`; before the first of them its
/// motion is continued backwards. `None` after the end, or without knots.
pub(crate) fn belief_at(
    stamp: Stamp,
    end: &Belief,
    knots: &[Knot],
    config: &LioConfig,
) -> Option<(Belief, Vector3<f64>)> {
    let last = knots.last()?;
    if stamp >= end.state.stamp {
        return (stamp == end.state.stamp).then_some((*end, last.rate_radps));
    }
    let at = knots.partition_point(|knot| knot.stamp <= stamp).saturating_sub(1);
    let mut covariance = end.covariance;
    let mut until = end.state.stamp;
    for (number, knot) in knots.iter().enumerate().skip(at).rev() {
        let from = if number == at { stamp } else { knot.stamp };
        let state = state_on(knot, &end.state, from);
        let input = input_of(knot, &state, until);
        let noise = propagate_covariance(&Covariance::zeros(), &state, &input, until, config, knot.inflation);
        // F is the identity but for what moves within milliseconds: always invertible.
        let back = transition(&state, &input, until).try_inverse()?;
        covariance = symmetric(&(back * (covariance + noise) * back.transpose()));
        until = from;
    }
    let state = state_on(&knots[at], &end.state, stamp);
    Some((Belief { state, covariance }, knots[at].rate_radps))
}

/// The state at a time of a knot's interval. Biases and gravity are those of the end: they do not change on the way.
pub(crate) fn state_on(knot: &Knot, end: &ImuState, stamp: Stamp) -> ImuState {
    let pose = knot.world_from_imu(stamp);
    let dt_s = stamp.seconds_since(knot.stamp);
    ImuState {
        stamp,
        position_m: pose.translation.vector,
        rotation: pose.rotation,
        velocity_mps: knot.velocity_mps + knot.acceleration_mps2 * dt_s,
        ..*end
    }
}

/// What the IMU must have said for the motion of a knot.
fn input_of(knot: &Knot, state: &ImuState, until: Stamp) -> ImuInput {
    let half = knot.rate_radps * (0.5 * until.seconds_since(state.stamp));
    let middle = state.rotation * UnitQuaternion::from_scaled_axis(half);
    ImuInput {
        rate_radps: knot.rate_radps + state.gyro_bias_radps,
        force_mps2: middle.inverse() * (knot.acceleration_mps2 - state.gravity_mps2()) + state.accel_bias_mps2,
        is_coasting: false,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::ImuSample;
    use crate::odometry::inertial::{ImuBuffer, Motion};
    use crate::odometry::laws::{belief, vector};
    use crate::odometry::propagation::Inflation;
    use crate::odometry::state::{DOF, Tangent};

    /// An IMU that turns and is shaken, 0.1 s at 200 Hz, from the time of the belief on.
    fn shaken(from: Stamp, rate: Vector3<f64>, force: Vector3<f64>) -> ImuBuffer {
        let mut buffer = ImuBuffer::default();
        for k in 0..=20 {
            let phase = 0.4 * f64::from(k);
            let sample = ImuSample {
                stamp: from.plus_ns(5_000_000 * i64::from(k)),
                angular_velocity_radps: rate * phase.cos(),
                specific_force_mps2: force + Vector3::new(phase.sin(), 1.0, -phase.cos()),
            };
            buffer.push(&sample).expect("in order");
        }
        buffer
    }

    proptest! {
        #[test]
        fn the_way_back_is_the_way_there(
            start in belief(), rate in vector(12.0), force in vector(20.0), back_ns in 0..100_000_000_i64
        ) {
            let imu = shaken(start.state.stamp, rate, force);
            let config = LioConfig::default();
            let mut knots = Vec::new();
            let to = start.state.stamp.plus_ns(100_000_000);
            let (state, covariance) = imu.predict(&start.state, &start.covariance, to, Motion::Inertial, &config, &mut knots);
            let end = Belief { state, covariance };
            let (found, _) = belief_at(start.state.stamp, &end, &knots, &config).expect("on the way");
            // Twenty steps there and back in double precision, at 100 m/s^2 and 10 m.
            prop_assert!(found.state.boxminus(&start.state).amax() < 1e-9);
            // Nothing was corrected at the end, so all the noise of the way is in it: once from there, once from here.
            let (mut still, mut noise) = (Covariance::zeros(), Covariance::zeros());
            still.copy_from(&start.covariance);
            for knot in knots.iter().rev() {
                let until = knot.stamp.plus_ns(5_000_000);
                let at = state_on(knot, &end.state, knot.stamp);
                let input = input_of(knot, &at, until);
                let one = propagate_covariance(&Covariance::zeros(), &at, &input, until, &config, Inflation::NONE);
                let back = transition(&at, &input, until).try_inverse().expect("invertible");
                noise = back * (noise + one) * back.transpose();
            }
            let expected = start.covariance + noise * 2.0;
            prop_assert!((found.covariance - expected).amax() < 1e-9 * (1.0 + expected.amax()));
            // The state moves on continuously: also between two samples.
            let between = to.plus_ns(-back_ns);
            let (found, _) = belief_at(between, &end, &knots, &config).expect("on the way");
            prop_assert_eq!(found.state.stamp, between);
            prop_assert!(found.covariance.cholesky().is_some());
            prop_assert!(belief_at(to.plus_ns(1), &end, &knots, &config).is_none());
        }

        #[test]
        fn the_covariance_is_carried_back_by_the_derivative_of_the_way(
            end in belief(), rate in vector(12.0), force in vector(20.0), back_ms in 1..100_i64
        ) {
            const H: f64 = 1e-6;
            // The way back turns the force of a whole interval at its middle, the derivative that of a part at the part's.
            const TOL: f64 = 1e-3;
            let from = end.state.stamp.plus_ns(-100_000_000);
            let stamp = end.state.stamp.plus_ns(-1_000_000 * back_ms);
            let (imu, usual) = (shaken(from, rate, force), LioConfig::default());
            let config = LioConfig {
                gyro_noise_density: 0.0,
                accel_noise_density: 0.0,
                gyro_bias_walk_density: 0.0,
                accel_bias_walk_density: 0.0,
                ..usual
            };
            let state_at = |error: Tangent| {
                let end = end.state.boxplus(&error);
                let knots = imu.knots_back_from(&end, from, &config);
                let at = knots.partition_point(|knot| knot.stamp <= stamp).saturating_sub(1);
                state_on(&knots[at], &end, stamp)
            };
            let centre = state_at(Tangent::zeros());
            let mut jacobian = Covariance::zeros();
            for column in 0..DOF {
                let mut error = Tangent::zeros();
                error[column] = H;
                let difference = state_at(error).boxminus(&centre) - state_at(-error).boxminus(&centre);
                jacobian.set_column(column, &(difference / (2.0 * H)));
            }
            let knots = imu.knots_back_from(&end.state, from, &config);
            let (found, _) = belief_at(stamp, &end, &knots, &config).expect("on the way");
            let expected = jacobian * end.covariance * jacobian.transpose();
            prop_assert!((found.covariance - expected).amax() < TOL * expected.amax(), "{}", (found.covariance - expected).amax() / expected.amax());
        }
    }
}
