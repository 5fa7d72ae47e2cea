//! Thrust and torque to rotor speeds.
//!
//! Rotor `i` at `r_i` with spin `d_i` (+1 counter-clockwise seen from above) and speed `w_i` pushes `f_i = k w_i^2` along body z
//! and twists the body by `-d_i c f_i` about it. So `[f; M] = A f_i` with columns `[1, r_y, -r_x, -d c]`.

use nalgebra::{DMatrix, Vector3};

use super::controller::ThrustTorque;

/// Why a mixer was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MixerError {
    /// The slices have different lengths or fewer than four rotors.
    #[error("at least four rotors with one position, direction, coefficient, ratio and top speed each")]
    WrongLength,
    /// A number is not finite, or a coefficient or top speed is not positive.
    #[error("rotor numbers must be finite, coefficients and top speeds positive, directions +1 or -1")]
    BadRotor,
    /// The rotors cannot produce thrust and all three torques independently.
    #[error("the rotors do not span thrust and three torques")]
    Singular,
}

/// The allocation of a set of rotors.
#[derive(Debug, Clone)]
pub struct RotorMixer {
    /// Rotor forces per unit of thrust, roll, pitch and yaw torque: one row per rotor.
    forces: Vec<[f64; 4]>,
    thrust_coefficient_n_s2: Vec<f64>,
    max_force_n: Vec<f64>,
}

impl RotorMixer {
    /// Positions relative to the centre of mass in body axes, spin directions (+1 counter-clockwise from above), thrust
    /// coefficients (N s^2), moment per thrust (m) and top speeds (rad/s).
    ///
    /// # Errors
    /// [`MixerError`].
    pub fn new(
        positions_in_body: &[Vector3<f64>],
        directions: &[f64],
        thrust_coefficients_n_s2: &[f64],
        moment_ratios_m: &[f64],
        max_speeds_radps: &[f64],
    ) -> Result<RotorMixer, MixerError> {
        let n = positions_in_body.len();
        let lengths = [directions.len(), thrust_coefficients_n_s2.len(), moment_ratios_m.len(), max_speeds_radps.len()];
        if n < 4 || lengths.iter().any(|l| *l != n) {
            return Err(MixerError::WrongLength);
        }
        let good = |k: usize| {
            positions_in_body[k].iter().all(|x| x.is_finite())
                && directions[k].abs() == 1.0
                && thrust_coefficients_n_s2[k].is_finite()
                && thrust_coefficients_n_s2[k] > 0.0
                && moment_ratios_m[k].is_finite()
                && max_speeds_radps[k].is_finite()
                && max_speeds_radps[k] > 0.0
        };
        if !(0..n).all(good) {
            return Err(MixerError::BadRotor);
        }
        let allocation = DMatrix::from_fn(4, n, |row, k| match row {
            0 => 1.0,
            1 => positions_in_body[k].y,
            2 => -positions_in_body[k].x,
            _ => -directions[k] * moment_ratios_m[k],
        });
        if allocation.rank(1e-6) < 4 {
            return Err(MixerError::Singular);
        }
        let inverse = allocation.pseudo_inverse(1e-9).map_err(|_| MixerError::Singular)?;
        Ok(RotorMixer {
            forces: (0..n).map(|k| [inverse[(k, 0)], inverse[(k, 1)], inverse[(k, 2)], inverse[(k, 3)]]).collect(),
            thrust_coefficient_n_s2: thrust_coefficients_n_s2.to_vec(),
            max_force_n: (0..n).map(|k| thrust_coefficients_n_s2[k] * max_speeds_radps[k].powi(2)).collect(),
        })
    }

    /// Rotor speeds. Where not all can be had, yaw torque is given up first, then roll and pitch, then thrust: a vehicle
    /// that cannot hold its tilt falls, one that cannot hold its yaw only looks elsewhere.
    pub fn speeds(&self, wanted: &ThrustTorque) -> Vec<f64> {
        let thrust: Vec<f64> = self
            .forces
            .iter()
            .zip(&self.max_force_n)
            .map(|(f, most)| (f[0] * wanted.thrust_n).clamp(0.0, *most))
            .collect();
        let tilt: Vec<f64> =
            self.forces.iter().map(|f| f[1] * wanted.torque_nm.x + f[2] * wanted.torque_nm.y).collect();
        let yaw: Vec<f64> = self.forces.iter().map(|f| f[3] * wanted.torque_nm.z).collect();
        let tilted = self.add(&thrust, &tilt);
        self.add(&tilted, &yaw)
            .iter()
            .zip(&self.thrust_coefficient_n_s2)
            .map(|(force, k)| (force.max(0.0) / k).sqrt())
            .collect()
    }

    /// `base + s * more` with the largest `s` in [0, 1] that keeps every rotor within its range.
    fn add(&self, base: &[f64], more: &[f64]) -> Vec<f64> {
        let mut share = 1.0f64;
        for k in 0..base.len() {
            let room = if more[k] > 0.0 { self.max_force_n[k] - base[k] } else { base[k] };
            if more[k].abs() > room {
                share = share.min((room / more[k].abs()).max(0.0));
            }
        }
        base.iter().zip(more).map(|(b, m)| b + share * m).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_is_produced() {
        let positions =
            [[0.17, -0.17], [-0.17, 0.17], [0.17, 0.17], [-0.17, -0.17]].map(|p| Vector3::new(p[0], p[1], 0.0));
        let directions = [1.0, 1.0, -1.0, -1.0];
        let (k, c) = (8.5e-6, 0.016);
        let mixer = RotorMixer::new(&positions, &directions, &[k; 4], &[c; 4], &[1000.0; 4]).unwrap();
        let wanted = ThrustTorque { thrust_n: 20.0, torque_nm: Vector3::new(0.3, -0.2, 0.02) };
        let speeds = mixer.speeds(&wanted);
        let force: Vec<f64> = speeds.iter().map(|w| k * w * w).collect();
        assert!((force.iter().sum::<f64>() - 20.0).abs() < 1e-9);
        assert!(((0..4).map(|i| positions[i].y * force[i]).sum::<f64>() - 0.3).abs() < 1e-9);
        assert!(((0..4).map(|i| -positions[i].x * force[i]).sum::<f64>() + 0.2).abs() < 1e-9);
        assert!(((0..4).map(|i| -directions[i] * c * force[i]).sum::<f64>() - 0.02).abs() < 1e-9);
        let most = mixer.speeds(&ThrustTorque { thrust_n: 1e4, torque_nm: Vector3::new(9.0, 9.0, 9.0) });
        assert!(most.iter().all(|w| (0.0..=1000.0 + 1e-9).contains(w)));
        assert!(RotorMixer::new(&positions[..3], &directions[..3], &[k; 3], &[c; 3], &[1.0; 3]).is_err());
        assert_eq!(
            RotorMixer::new(&[positions[0]; 4], &directions, &[k; 4], &[c; 4], &[1.0; 4]).err(),
            Some(MixerError::Singular)
        );
    }
}
