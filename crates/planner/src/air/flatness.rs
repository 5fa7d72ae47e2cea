//! What a trajectory demands of a multirotor: thrust, attitude and body rate with rotor and parasitic drag, and the reverse.
//!
//! ```text
//! s = sqrt(|v|^2 + eps),  w = v (1 + cp s)                       drag velocity
//! zu = a + (dh/m) w + g e3,  z = zu / |zu|                       thrust axis
//! f = z . (m (a + g e3) + dv w)                                  thrust
//! dz = (I - z z^T) (j + (dh/m) dw/dt) / |zu|                     its turning
//! ```
//! Attitude: tilt quaternion of z times yaw; body rate from `dz` and the yaw rate (MINCO, differential flatness with drag).
//! Singular only where the vehicle hangs upside down (`z.z = -1`) or falls freely (`zu = 0`).

use nalgebra::{Quaternion, Vector3};

/// Mass and drag of a multirotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Airframe {
    /// Mass (kg).
    pub mass_kg: f64,
    /// Gravity (m/s^2).
    pub gravity_mps2: f64,
    /// Rotor drag across the thrust axis (kg/s).
    pub drag_across: f64,
    /// Rotor drag along the thrust axis (kg/s).
    pub drag_along: f64,
    /// Growth of the drag with speed (s/m).
    pub drag_parasitic: f64,
    /// Smoothing of the speed at rest (m^2/s^2).
    pub speed_epsilon: f64,
}

/// Thrust, attitude and body rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlatOutput {
    /// Collective thrust (N).
    pub thrust_n: f64,
    /// World from body.
    pub attitude: Quaternion<f64>,
    /// In body axes (rad/s).
    pub body_rate_radps: Vector3<f64>,
}

/// A gradient by velocity, acceleration, jerk, yaw and yaw rate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FlatGradient {
    /// By velocity.
    pub velocity: Vector3<f64>,
    /// By acceleration.
    pub acceleration: Vector3<f64>,
    /// By jerk.
    pub jerk: Vector3<f64>,
    /// By yaw.
    pub yaw: f64,
    /// By yaw rate.
    pub yaw_rate: f64,
}

/// The thrust axis and its turning at one instant: the part of the map that does not know the yaw.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ThrustAxis {
    v: Vector3<f64>,
    a: Vector3<f64>,
    /// s, 1 + cp s, (v . a) / s.
    s: f64,
    growth: f64,
    q: f64,
    /// |zu|.
    norm: f64,
    force: Vector3<f64>,
    turning: Vector3<f64>,
    pub z: Vector3<f64>,
    pub dz: Vector3<f64>,
    pub thrust_n: f64,
}

impl ThrustAxis {
    pub fn new(airframe: &Airframe, v: &Vector3<f64>, a: &Vector3<f64>, j: &Vector3<f64>) -> Self {
        let over_mass = airframe.drag_across / airframe.mass_kg;
        let s = (v.norm_squared() + airframe.speed_epsilon).sqrt();
        let growth = 1.0 + airframe.drag_parasitic * s;
        let w = v * growth;
        let q = v.dot(a) / s;
        let dw = a * growth + v * (airframe.drag_parasitic * q);
        let lifted = a + Vector3::new(0.0, 0.0, airframe.gravity_mps2);
        let zu = lifted + w * over_mass;
        let norm = zu.norm();
        let z = zu / norm;
        let force = lifted * airframe.mass_kg + w * airframe.drag_along;
        let turning = j + dw * over_mass;
        let dz = (turning - z * z.dot(&turning)) / norm;
        ThrustAxis { v: *v, a: *a, s, growth, q, norm, force, turning, z, dz, thrust_n: z.dot(&force) }
    }

    /// |zu|: thrust over mass, but for the drag along the axis.
    pub fn zu_norm(&self) -> f64 {
        self.norm
    }

    /// Size of what turns the axis, before it is projected.
    pub fn turning_norm(&self) -> f64 {
        self.turning.norm()
    }

    /// Square of the body rate without a yaw rate, which does not depend on the yaw.
    pub fn rate_squared(&self) -> f64 {
        let twist = self.twist();
        self.dz.norm_squared() + twist * twist
    }

    /// Body rate about the thrust axis without a yaw rate.
    pub fn twist(&self) -> f64 {
        (self.z.y * self.dz.x - self.z.x * self.dz.y) / (1.0 + self.z.z)
    }

    /// Gradient of [`Self::rate_squared`] by `z` and `dz`.
    pub fn rate_squared_gradient(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (twist, below) = (self.twist(), 1.0 / (1.0 + self.z.z));
        let by_twist = 2.0 * twist * below;
        let by_z = Vector3::new(-self.dz.y, self.dz.x, -twist) * by_twist;
        let by_dz = self.dz * 2.0 + Vector3::new(self.z.y, -self.z.x, 0.0) * by_twist;
        (by_z, by_dz)
    }

    /// Carries gradients by thrust, axis and turning back to velocity, acceleration and jerk.
    pub fn reverse(
        &self,
        airframe: &Airframe,
        by_thrust: f64,
        by_z: &Vector3<f64>,
        by_dz: &Vector3<f64>,
    ) -> [Vector3<f64>; 3] {
        let over_mass = airframe.drag_across / airframe.mass_kg;
        let cp = airframe.drag_parasitic;
        let z = &self.z;
        // f = z . force
        let by_force = z * by_thrust;
        let mut by_z = by_z + self.force * by_thrust;
        // dz = (turning - z (z . turning)) / norm
        let along = z.dot(by_dz);
        let by_turning = (by_dz - z * along) / self.norm;
        by_z -= (by_dz * z.dot(&self.turning) + self.turning * along) / self.norm;
        let by_norm = -by_dz.dot(&self.dz) / self.norm;
        // z = zu / norm
        let by_zu = (by_z - z * z.dot(&by_z)) / self.norm + z * by_norm;
        // zu, force, turning by w, dw, a, j
        let by_w = by_zu * over_mass + by_force * airframe.drag_along;
        let by_dw = by_turning * over_mass;
        let pull = self.v.dot(&by_dw);
        let by_a = by_zu + by_force * airframe.mass_kg + by_dw * self.growth + self.v * (cp * pull / self.s);
        let by_s = cp * (self.a.dot(&by_dw) - pull * self.q / self.s + self.v.dot(&by_w));
        let by_v =
            by_w * self.growth + by_dw * (cp * self.q) + self.a * (cp * pull / self.s) + self.v * (by_s / self.s);
        [by_v, by_a, by_turning]
    }
}

impl Airframe {
    /// Thrust, attitude and body rate for a motion and a yaw.
    pub fn demand(&self, v: &Vector3<f64>, a: &Vector3<f64>, j: &Vector3<f64>, yaw: f64, yaw_rate: f64) -> FlatOutput {
        let axis = ThrustAxis::new(self, v, a, j);
        let (z, dz) = (axis.z, axis.dz);
        let (sin, cos) = yaw.sin_cos();
        let below = 1.0 / (1.0 + z.z);
        let fall = dz.z * below;
        let body_rate_radps = Vector3::new(
            dz.x * sin - dz.y * cos - (z.x * sin - z.y * cos) * fall,
            dz.x * cos + dz.y * sin - (z.x * cos + z.y * sin) * fall,
            axis.twist() + yaw_rate,
        );
        let (t, half) = (tilt(&z), (0.5 * yaw).sin_cos());
        let attitude =
            Quaternion::new(t.0 * half.1, t.1 * half.1 + t.2 * half.0, t.2 * half.1 - t.1 * half.0, t.0 * half.0);
        FlatOutput { thrust_n: axis.thrust_n, attitude, body_rate_radps }
    }

    /// Carries a gradient by thrust, attitude (w, i, j, k of the quaternion as free numbers) and body rate back to the motion.
    #[allow(clippy::too_many_arguments)]
    pub fn demand_reverse(
        &self,
        v: &Vector3<f64>,
        a: &Vector3<f64>,
        j: &Vector3<f64>,
        yaw: f64,
        by_thrust: f64,
        by_attitude: &Quaternion<f64>,
        by_rate: &Vector3<f64>,
    ) -> FlatGradient {
        let axis = ThrustAxis::new(self, v, a, j);
        let (z, dz) = (axis.z, axis.dz);
        let (sin, cos) = yaw.sin_cos();
        let below = 1.0 / (1.0 + z.z);
        let fall = dz.z * below;
        let (across, ahead) = (z.x * sin - z.y * cos, z.x * cos + z.y * sin);
        // Body rate.
        let by_fall = -(across * by_rate.x + ahead * by_rate.y);
        let turn = by_rate.z * below;
        let by_dz = Vector3::new(
            sin * by_rate.x + cos * by_rate.y + z.y * turn,
            -cos * by_rate.x + sin * by_rate.y - z.x * turn,
            by_fall * below,
        );
        let mut by_z = Vector3::new(
            -fall * (sin * by_rate.x + cos * by_rate.y) - dz.y * turn,
            -fall * (-cos * by_rate.x + sin * by_rate.y) + dz.x * turn,
            -below * (by_fall * fall + by_rate.z * axis.twist()),
        );
        // d(sin) = cos, d(cos) = -sin: the two horizontal rates turn into each other.
        let rate_x = dz.x * sin - dz.y * cos - across * fall;
        let rate_y = dz.x * cos + dz.y * sin - ahead * fall;
        let mut by_yaw = rate_y * by_rate.x - rate_x * by_rate.y;
        // Attitude: tilt (t0, t1, t2, 0) times yaw (c, 0, 0, s).
        let (s, c) = (0.5 * yaw).sin_cos();
        let t = tilt(&z);
        let g = by_attitude;
        let by_t = (g.w * c + g.k * s, g.i * c - g.j * s, g.i * s + g.j * c);
        by_yaw += 0.5 * (g.w * (-t.0 * s) + g.i * (t.2 * c - t.1 * s) + g.j * (-t.2 * s - t.1 * c) + g.k * (t.0 * c));
        // t0 = sqrt((1 + z.z) / 2), t1 = -z.y / (2 t0), t2 = z.x / (2 t0).
        let half_over = 0.5 / t.0;
        let by_t0 = by_t.0 - (by_t.1 * t.1 + by_t.2 * t.2) / t.0;
        by_z += Vector3::new(by_t.2 * half_over, -by_t.1 * half_over, by_t0 * 0.5 * half_over);
        let [velocity, acceleration, jerk] = axis.reverse(self, by_thrust, &by_z, &by_dz);
        FlatGradient { velocity, acceleration, jerk, yaw: by_yaw, yaw_rate: by_rate.z }
    }
}

/// The shortest rotation from e3 to z: w, i, j of its quaternion (k is 0).
fn tilt(z: &Vector3<f64>) -> (f64, f64, f64) {
    let w = (0.5 * (1.0 + z.z)).sqrt();
    (w, -0.5 * z.y / w, 0.5 * z.x / w)
}
