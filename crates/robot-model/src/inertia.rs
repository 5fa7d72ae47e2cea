//! Mass properties of rigid bodies and their exact combination.
//!
//! A body is described by its mass `m`, centre of mass `c` and inertia `I` about `c`. Two bodies fixed to each other are one body:
//!
//! ```text
//! m = m1 + m2        c = (m1 c1 + m2 c2) / m
//! I = sum_i  I_i + m_i (|d_i|^2 E - d_i d_i^T),   d_i = c_i - c        (parallel axis theorem)
//! ```
//!
//! Moving a body by an isometry `(R, t)` gives `c' = R c + t` and `I' = R I R^T`.

use nalgebra::{Isometry3, Matrix3, Point3, SymmetricEigen};

/// Mass, centre of mass and inertia of a rigid body, all in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties {
    /// Mass.
    pub mass_kg: f64,
    /// Centre of mass.
    pub center_of_mass: Point3<f64>,
    /// Inertia about the centre of mass, in the axes of the frame, kg m^2.
    pub inertia: Matrix3<f64>,
}

/// What is wrong with the mass properties of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum InertiaFault {
    /// A number is NaN or infinite.
    #[error("is not finite")]
    NotFinite,
    /// The mass is below zero.
    #[error("has a negative mass")]
    NegativeMass,
    /// A principal moment is below zero.
    #[error("has a negative principal moment of inertia")]
    NegativeMoment,
    /// No distribution of mass has these principal moments: the largest exceeds the sum of the other two.
    #[error("breaks the triangle inequality of principal moments of inertia")]
    Triangle,
}

/// Published tables are rounded to three digits or so; a flat plate (`a + b = c`) must survive that rounding.
const TRIANGLE_SLACK: f64 = 1e-3;

/// Official files give frames that weigh nothing a placeholder such as 1e-6 kg with all six moments 1e-6 (Go1 in
/// example-robot-data). Below this mass (kg) and this moment (kg m^2) the triangle inequality is not asked for.
const PLACEHOLDER: f64 = 1e-5;

impl MassProperties {
    /// A link without mass.
    pub fn zero() -> Self {
        Self { mass_kg: 0.0, center_of_mass: Point3::origin(), inertia: Matrix3::zeros() }
    }

    /// The same body seen from another frame.
    pub fn in_frame(&self, new_from_old: &Isometry3<f64>) -> Self {
        let rotation = new_from_old.rotation.to_rotation_matrix();
        Self {
            mass_kg: self.mass_kg,
            center_of_mass: new_from_old * self.center_of_mass,
            inertia: rotation * self.inertia * rotation.transpose(),
        }
    }

    /// All `parts` fixed together as one body. Without any mass the centre of mass is the origin of the frame.
    pub fn combined(parts: &[MassProperties]) -> Self {
        let mass_kg: f64 = parts.iter().map(|part| part.mass_kg).sum();
        let mut center_of_mass = Point3::origin();
        if mass_kg > 0.0 {
            for part in parts {
                center_of_mass += part.center_of_mass.coords * (part.mass_kg / mass_kg);
            }
        }
        let mut inertia = Matrix3::zeros();
        for part in parts {
            let d = part.center_of_mass - center_of_mass;
            inertia += part.inertia + (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * part.mass_kg;
        }
        Self { mass_kg, center_of_mass, inertia }
    }

    /// Principal moments of inertia, ascending.
    pub fn principal_moments(&self) -> [f64; 3] {
        let values = SymmetricEigen::new(self.inertia).eigenvalues;
        let mut moments = [values[0], values[1], values[2]];
        moments.sort_by(f64::total_cmp);
        moments
    }

    /// Whether some distribution of mass can have these properties.
    ///
    /// # Errors
    /// The first fault found, in the order of [`InertiaFault`].
    pub fn check(&self) -> Result<(), InertiaFault> {
        let finite = self.mass_kg.is_finite()
            && self.center_of_mass.coords.iter().chain(self.inertia.iter()).all(|v| v.is_finite());
        if !finite {
            return Err(InertiaFault::NotFinite);
        }
        if self.mass_kg < 0.0 {
            return Err(InertiaFault::NegativeMass);
        }
        let [low, middle, high] = self.principal_moments();
        let slack = TRIANGLE_SLACK * high.abs().max(low.abs());
        if low < -slack {
            return Err(InertiaFault::NegativeMoment);
        }
        let is_placeholder = self.mass_kg <= PLACEHOLDER && high <= PLACEHOLDER;
        if low + middle < high - slack && !is_placeholder {
            return Err(InertiaFault::Triangle);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn ball(mass_kg: f64, x: f64) -> MassProperties {
        MassProperties {
            mass_kg,
            center_of_mass: Point3::new(x, 0.0, 0.0),
            inertia: Matrix3::identity() * 0.4 * mass_kg,
        }
    }

    #[test]
    fn two_balls_on_a_stick() {
        // 1 kg at x = 0 and 3 kg at x = 4: centre at 3, and 1*9 + 3*1 = 12 about y and z on top of 0.4 * 4.
        let both = MassProperties::combined(&[ball(1.0, 0.0), ball(3.0, 4.0)]);
        assert_eq!(both.mass_kg, 4.0);
        assert!((both.center_of_mass - Point3::new(3.0, 0.0, 0.0)).norm() < 1e-12);
        assert!((both.inertia - Matrix3::from_diagonal(&Vector3::new(1.6, 13.6, 13.6))).norm() < 1e-12);
    }

    #[test]
    fn faults_are_told_apart() {
        let check = |mass: f64, a: f64, b: f64, c: f64| {
            MassProperties {
                mass_kg: mass,
                center_of_mass: Point3::origin(),
                inertia: Matrix3::from_diagonal(&Vector3::new(a, b, c)),
            }
            .check()
        };
        assert_eq!(check(1.0, 1.0, 1.0, 2.0), Ok(()), "a flat plate is the limit case");
        assert_eq!(check(1.0, 1.0, 1.0, 2.1), Err(InertiaFault::Triangle));
        assert_eq!(check(1.0, -1.0, 1.0, 1.0), Err(InertiaFault::NegativeMoment));
        assert_eq!(check(-1.0, 1.0, 1.0, 1.0), Err(InertiaFault::NegativeMass));
        assert_eq!(check(1.0, f64::NAN, 1.0, 1.0), Err(InertiaFault::NotFinite));
        assert_eq!(check(1e-6, 0.0, 0.0, 3e-6), Ok(()), "a placeholder");
        assert_eq!(check(1e-6, 0.0, 0.0, 3e-5), Err(InertiaFault::Triangle), "too much inertia for one");
        assert_eq!(MassProperties::zero().check(), Ok(()));
    }
}
