//! Numbers of a quadrotor.

use nalgebra::{Matrix3, Point3, Vector3};
use thiserror::Error;

/// One rotor.
#[derive(Debug, Clone, PartialEq)]
pub struct RotorConfig {
    /// Hub in the body frame.
    pub position_m: Point3<f64>,
    /// Direction of the thrust in the body frame, of length one.
    pub axis: Vector3<f64>,
    /// +1 for counter-clockwise about the axis, -1 for clockwise.
    pub spin: f64,
    /// Thrust by squared speed, N s^2.
    pub thrust_coefficient_n_s2: f64,
    /// Moment by thrust.
    pub moment_ratio_m: f64,
    /// Highest speed.
    pub max_speed_radps: f64,
    /// Time constant when getting faster.
    pub time_constant_up_s: f64,
    /// Time constant when getting slower.
    pub time_constant_down_s: f64,
    /// Drag of the hub along the body axes by its air speed and the rotor's speed, kg/rad (0).
    pub drag_kg_per_rad: Vector3<f64>,
}

/// Body, rotors and the world's numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadrotorConfig {
    /// Mass.
    pub mass_kg: f64,
    /// Centre of mass in the body frame.
    pub center_of_mass: Point3<f64>,
    /// Inertia about the centre of mass, body axes, kg m^2.
    pub inertia_kgm2: Matrix3<f64>,
    /// The rotors.
    pub rotors: Vec<RotorConfig>,
    /// Linear drag along the body axes, N s/m.
    pub drag_ns_per_m: Vector3<f64>,
    /// Length of gravity (9.81).
    pub gravity_mps2: f64,
    /// Radius of the shake that the rotors' imbalance makes at their mean speed (5e-7: 0.3 m/s^2 at 740 rad/s); 0 for none.
    pub vibration_m: f64,
    /// Stiffness of a contact point, N/m (8000).
    pub contact_stiffness: f64,
    /// Damping of a contact point, N s/m (40).
    pub contact_damping: f64,
    /// Friction of a contact (0.5).
    pub contact_friction: f64,
}

impl QuadrotorConfig {
    /// The x500 of PX4's models: 2.06 kg, rotors at (+-0.174, +-0.174, 0.06).
    pub fn x500() -> Self {
        let rotor = |x: f64, y: f64, spin: f64| RotorConfig {
            position_m: Point3::new(x, y, 0.06),
            axis: Vector3::z(),
            spin,
            thrust_coefficient_n_s2: 8.54858e-6,
            moment_ratio_m: 0.016,
            max_speed_radps: 1000.0,
            time_constant_up_s: 0.0125,
            time_constant_down_s: 0.025,
            drag_kg_per_rad: Vector3::zeros(),
        };
        QuadrotorConfig {
            mass_kg: 2.0643,
            center_of_mass: Point3::origin(),
            inertia_kgm2: Matrix3::from_diagonal(&Vector3::new(0.0217, 0.0217, 0.04)),
            rotors: vec![
                rotor(0.174, -0.174, 1.0),
                rotor(-0.174, 0.174, 1.0),
                rotor(0.174, 0.174, -1.0),
                rotor(-0.174, -0.174, -1.0),
            ],
            drag_ns_per_m: Vector3::new(0.3, 0.3, 0.4),
            gravity_mps2: 9.81,
            vibration_m: 5e-7,
            contact_stiffness: 8000.0,
            contact_damping: 40.0,
            contact_friction: 0.5,
        }
    }

    /// Checks every number.
    pub fn validate(&self) -> Result<(), QuadrotorError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let not_negative = |x: f64| x >= 0.0 && x.is_finite();
        let is_rotor_good = |r: &RotorConfig| {
            r.position_m.iter().all(|x| x.is_finite())
                && (r.axis.norm() - 1.0).abs() < 1e-6
                && (r.spin.abs() - 1.0).abs() < 1e-9
                && positive(r.thrust_coefficient_n_s2)
                && not_negative(r.moment_ratio_m)
                && positive(r.max_speed_radps)
                && positive(r.time_constant_up_s)
                && positive(r.time_constant_down_s)
                && r.drag_kg_per_rad.iter().all(|x| not_negative(*x))
        };
        let inertia = self.inertia_kgm2;
        let is_inertia_good = inertia.iter().all(|x| x.is_finite())
            && (inertia - inertia.transpose()).norm() <= 1e-9 * inertia.norm()
            && inertia.symmetric_eigenvalues().min() > 0.0;
        let good = positive(self.mass_kg)
            && self.center_of_mass.iter().all(|x| x.is_finite())
            && is_inertia_good
            && !self.rotors.is_empty()
            && self.rotors.iter().all(is_rotor_good)
            && self.drag_ns_per_m.iter().all(|x| not_negative(*x))
            && not_negative(self.gravity_mps2)
            && (0.0..0.01).contains(&self.vibration_m)
            && not_negative(self.contact_stiffness)
            && not_negative(self.contact_damping)
            && not_negative(self.contact_friction);
        if good { Ok(()) } else { Err(QuadrotorError::Config) }
    }

    /// Rotor speed at which equal rotors carry the weight; may be above the highest speed.
    pub fn hover_speed_radps(&self) -> f64 {
        let lift: f64 = self.rotors.iter().map(|r| r.thrust_coefficient_n_s2 * r.axis.z).sum();
        (self.mass_kg * self.gravity_mps2 / lift.max(1e-12)).sqrt()
    }
}

/// Why the quadrotor cannot be made or moved.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum QuadrotorError {
    /// A number of the configuration is out of its range.
    #[error("a number of the quadrotor's configuration is out of range")]
    Config,
    /// Start or command is NaN or infinite.
    #[error("the start or a rotor command is not finite")]
    NotFinite,
    /// Not one command for each rotor.
    #[error("{given} rotor commands for {rotors} rotors")]
    CommandLength {
        /// Number of commands.
        given: usize,
        /// Number of rotors.
        rotors: usize,
    },
    /// The step is not positive or longer than a second.
    #[error("the time step is not positive or longer than a second")]
    Step,
}
