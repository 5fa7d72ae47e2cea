//! Geometric tracking control on SE(3) (Lee, Leok, McClamroch 2010), with the body rate fed forward from the jerk.
//!
//! ```text
//! F   = m (-kp ep - kv ev + g e3 + a_ref) + D v_ref        f = F . z_B
//! z_d = F / |F|,  y_d = z_d x x_yaw / |.|,  x_d = y_d x z_d
//! eR  = 1/2 vee(Rd^T R - R^T Rd)      eW = W - R^T Rd Wd
//! M   = J (-kR eR - kW eW) + W x J W - J (hat(W) R^T Rd Wd)
//! ```

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use super::trajectory::TrajectoryPoint;

/// What the vehicle does now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyState {
    /// Position of the centre of mass in the world (m).
    pub p: Point3<f64>,
    /// Velocity in the world (m/s).
    pub v: Vector3<f64>,
    /// Attitude.
    pub world_from_body: UnitQuaternion<f64>,
    /// Body rate in body axes.
    pub angular_velocity_in_body_radps: Vector3<f64>,
}

/// What the rotors together should do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrustTorque {
    /// Along body z.
    pub thrust_n: f64,
    /// In body axes.
    pub torque_nm: Vector3<f64>,
}

/// The controller: the vehicle's numbers and gains. It has no memory.
#[derive(Debug, Clone, PartialEq)]
pub struct GeometricController {
    /// Mass.
    pub mass_kg: f64,
    /// Inertia about the centre of mass, body axes.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Gravity (9.81).
    pub gravity_mps2: f64,
    /// Linear drag, body axes: the force fed forward is this times the reference velocity (0).
    pub drag_n_s_per_m: Vector3<f64>,
    /// Acceleration per metre of error, world axes (6.5, 6.5, 12).
    pub position_gain: Vector3<f64>,
    /// Acceleration per m/s of error, world axes (4, 4, 6).
    pub velocity_gain: Vector3<f64>,
    /// Angular acceleration per radian of error, body axes (110, 110, 20).
    pub attitude_gain: Vector3<f64>,
    /// Angular acceleration per rad/s of error, body axes (18, 18, 8).
    pub rate_gain: Vector3<f64>,
    /// The feedback acceleration is cut to this, so that a far reference does not turn the vehicle over (6).
    pub max_feedback_mps2: f64,
    /// Largest tilt of the commanded thrust (0.6).
    pub max_tilt_rad: f64,
}

impl GeometricController {
    /// Default gains for a vehicle of a given mass and inertia.
    pub fn new(mass_kg: f64, inertia_kg_m2: Matrix3<f64>) -> Self {
        GeometricController {
            mass_kg,
            inertia_kg_m2,
            gravity_mps2: 9.81,
            drag_n_s_per_m: Vector3::zeros(),
            position_gain: Vector3::new(6.5, 6.5, 12.0),
            velocity_gain: Vector3::new(4.0, 4.0, 6.0),
            attitude_gain: Vector3::new(110.0, 110.0, 20.0),
            rate_gain: Vector3::new(18.0, 18.0, 8.0),
            max_feedback_mps2: 6.0,
            max_tilt_rad: 0.6,
        }
    }

    /// Thrust and torque toward a reference and a yaw (about world z, 0 = world x).
    pub fn command(&self, state: &BodyState, reference: &TrajectoryPoint, yaw_rad: f64) -> ThrustTorque {
        let force = self.force(state, reference);
        let body = state.world_from_body.to_rotation_matrix();
        let z_body = body * Vector3::z();
        let desired = attitude(&force, yaw_rad);
        // The direction of the thrust turns with the jerk: h = (j - (z.j) z) m / f.
        let z_d = desired * Vector3::z();
        let turn = (reference.jerk - z_d * z_d.dot(&reference.jerk)) * (self.mass_kg / force.norm().max(1e-6));
        let desired_rate = Vector3::new(-turn.dot(&(desired * Vector3::y())), turn.dot(&(desired * Vector3::x())), 0.0);

        let error = desired.matrix().transpose() * body.matrix();
        let skew = 0.5 * (error - error.transpose()); // Lee Eq. 10
        let attitude_error = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
        let rate = state.angular_velocity_in_body_radps;
        let fed = error.transpose() * desired_rate;
        let rate_error = rate - fed; // Lee Eq. 11
        let wanted = -self.attitude_gain.component_mul(&attitude_error) - self.rate_gain.component_mul(&rate_error);
        // Lee Eq. 16, without the derivative of the desired rate (it needs the snap).
        let torque_nm = self.inertia_kg_m2 * (wanted - rate.cross(&fed)) + rate.cross(&(self.inertia_kg_m2 * rate));
        ThrustTorque { thrust_n: force.dot(&z_body).max(0.0), torque_nm }
    }

    /// The wanted force, upright enough (Lee Eq. 12).
    fn force(&self, state: &BodyState, reference: &TrajectoryPoint) -> Vector3<f64> {
        let mut feedback = -self.position_gain.component_mul(&(state.p - reference.p))
            - self.velocity_gain.component_mul(&(state.v - reference.v));
        let size = feedback.norm();
        if size > self.max_feedback_mps2 {
            feedback *= self.max_feedback_mps2 / size;
        }
        let drag = state.world_from_body
            * self.drag_n_s_per_m.component_mul(&state.world_from_body.inverse_transform_vector(&reference.v));
        let mut force = (feedback + reference.a + Vector3::z() * self.gravity_mps2) * self.mass_kg + drag;
        // A vehicle cannot pull down: keep some thrust, and the tilt within its limit.
        force.z = force.z.max(0.2 * self.mass_kg * self.gravity_mps2);
        let (level, most) = (force.xy().norm(), force.z * self.max_tilt_rad.tan());
        if level > most {
            force.x *= most / level;
            force.y *= most / level;
        }
        force
    }
}

/// The attitude with z along a force (which points up) and x as near to the yaw direction as that allows.
fn attitude(force: &Vector3<f64>, yaw_rad: f64) -> Rotation3<f64> {
    let z = force.normalize();
    let heading = Vector3::new(yaw_rad.cos(), yaw_rad.sin(), 0.0);
    let y = z.cross(&heading).normalize();
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[y.cross(&z), y, z]))
}

/// One step of a yaw reference toward a wanted yaw, the shorter way round, at a limited rate. The result is in (-pi, pi].
pub fn slew_yaw(yaw_rad: f64, wanted_rad: f64, max_rate_radps: f64, dt_s: f64) -> f64 {
    let wrap = |a: f64| {
        let turned = a.rem_euclid(std::f64::consts::TAU);
        if turned > std::f64::consts::PI { turned - std::f64::consts::TAU } else { turned }
    };
    let most = max_rate_radps * dt_s;
    wrap(yaw_rad + wrap(wanted_rad - yaw_rad).clamp(-most, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hover() -> BodyState {
        BodyState {
            p: Point3::origin(),
            v: Vector3::zeros(),
            world_from_body: UnitQuaternion::identity(),
            angular_velocity_in_body_radps: Vector3::zeros(),
        }
    }

    fn rest() -> TrajectoryPoint {
        TrajectoryPoint { p: Point3::origin(), v: Vector3::zeros(), a: Vector3::zeros(), jerk: Vector3::zeros() }
    }

    #[test]
    fn at_rest_it_carries_its_weight() {
        let c = GeometricController::new(2.0, Matrix3::identity() * 0.02);
        let out = c.command(&hover(), &rest(), 0.0);
        assert!((out.thrust_n - 19.62).abs() < 1e-9 && out.torque_nm.norm() < 1e-9);
    }

    #[test]
    fn a_goal_ahead_pitches_it_forward_and_a_goal_left_rolls_it_left() {
        let c = GeometricController::new(2.0, Matrix3::identity() * 0.02);
        let ahead = c.command(&hover(), &TrajectoryPoint { p: Point3::new(0.5, 0.0, 0.0), ..rest() }, 0.0);
        assert!(ahead.torque_nm.y > 0.01 && ahead.torque_nm.x.abs() < 1e-9);
        let left = c.command(&hover(), &TrajectoryPoint { p: Point3::new(0.0, 0.5, 0.0), ..rest() }, 0.0);
        assert!(left.torque_nm.x < -0.01 && left.torque_nm.y.abs() < 1e-9);
        let turn = c.command(&hover(), &rest(), 0.3);
        assert!(turn.torque_nm.z > 0.01);
    }

    #[test]
    fn yaw_goes_the_short_way() {
        assert!((slew_yaw(3.0, -3.0, 1.0, 0.1) - 3.1).abs() < 1e-12);
        assert!((slew_yaw(0.0, 0.05, 1.0, 0.1) - 0.05).abs() < 1e-12);
    }
}
