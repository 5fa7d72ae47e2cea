//! A planned flight, flown: the simulated quadrotor follows it with the geometric controller, and what it touches is counted.
//!
//! The file says mass and drag; the rest of the body is made up for its mass, like the x500 at a smaller scale. The parasitic
//! drag of the plan is not simulated. The controller runs at 250 Hz on the true state: odometry is no part of this.

use anyhow::{Context, Result};
use arena::mission::planner::{
    Airframe, BodyState, GeometricController, PolynomialTrajectory, RotorMixer, TrajectoryPoint, VoxelMap,
};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use omni_sim::quadrotor::{Quadrotor, QuadrotorConfig};
use serde_json::{Value, json};

const CONTROL_S: f64 = 0.004;
/// It hovers so long at the end.
const REST_S: f64 = 1.0;
/// Length of an arm as a share of the x500's: a body of a third of its mass.
const SCALE: f64 = 0.7;
/// The rotors can push so many times the weight.
const THRUST_TO_WEIGHT: f64 = 2.6;
/// The controller may tilt further than plans do.
const MAX_TILT_RAD: f64 = 1.3;

/// What came of a flight.
pub struct Flown {
    /// Root mean square and largest distance to the plan (m).
    rmse_m: f64,
    most_m: f64,
    /// Least distance from the body's ball to a box; not positive is a contact.
    clearance_m: f64,
    /// Samples (250 a second) of its centre in a grown voxel.
    in_grown_voxels: usize,
}

impl Flown {
    pub fn is_clean(&self) -> bool {
        self.clearance_m > 0.0 && self.in_grown_voxels == 0
    }

    pub fn json(&self) -> Value {
        json!({
            "clean": self.is_clean(), "tracking_rmse_m": self.rmse_m, "tracking_max_m": self.most_m,
            "clearance_m": self.clearance_m, "samples_in_grown_voxels": self.in_grown_voxels,
        })
    }
}

/// Flies a trajectory among boxes with a body inside a ball of `radius_m`.
pub fn fly(
    trajectory: &PolynomialTrajectory,
    airframe: &Airframe,
    boxes: &[(Point3<f64>, Point3<f64>)],
    radius_m: f64,
    grown: &VoxelMap,
) -> Result<Flown> {
    let body = body(airframe);
    let mut controller = GeometricController::new(body.mass_kg, body.inertia_kgm2);
    controller.gravity_mps2 = body.gravity_mps2;
    controller.drag_n_s_per_m = body.drag_ns_per_m;
    controller.max_tilt_rad = MAX_TILT_RAD;
    let of = |value: fn(&omni_sim::quadrotor::RotorConfig) -> f64| body.rotors.iter().map(value).collect::<Vec<f64>>();
    let places: Vec<Vector3<f64>> = body.rotors.iter().map(|rotor| rotor.position_m.coords).collect();
    let mixer = RotorMixer::new(
        &places,
        &of(|rotor| rotor.spin),
        &of(|rotor| rotor.thrust_coefficient_n_s2),
        &of(|rotor| rotor.moment_ratio_m),
        &of(|rotor| rotor.max_speed_radps),
    )?;
    let start = trajectory.sample(0.0).p;
    let hover_radps = body.hover_speed_radps();
    let mut quadrotor =
        Quadrotor::new(body, 0, Isometry3::translation(start.x, start.y, start.z), hover_radps).context("the body")?;
    let mut flown = Flown { rmse_m: 0.0, most_m: 0.0, clearance_m: f64::INFINITY, in_grown_voxels: 0 };
    let steps = ((trajectory.duration() + REST_S) / CONTROL_S).ceil() as usize;
    let mut sum = 0.0;
    for step in 0..steps {
        let t_s = step as f64 * CONTROL_S;
        let reference: TrajectoryPoint = trajectory.sample(t_s);
        let state = quadrotor.state();
        let seen = BodyState {
            p: Point3::from(state.world_from_body.translation.vector),
            v: state.velocity_world,
            world_from_body: state.world_from_body.rotation,
            angular_velocity_in_body_radps: state.angular_velocity_body,
        };
        let off = (seen.p - reference.p).norm();
        sum += off * off;
        flown.most_m = flown.most_m.max(off);
        let beside = |(low, high): &(Point3<f64>, Point3<f64>)| {
            (low - seen.p).sup(&(seen.p - high)).sup(&Vector3::zeros()).norm() - radius_m
        };
        flown.clearance_m = boxes.iter().map(beside).fold(flown.clearance_m, f64::min);
        flown.in_grown_voxels += usize::from(!grown.is_free(&seen.p));
        let speeds = mixer.speeds(&controller.command(&seen, &reference, 0.0));
        quadrotor.step(CONTROL_S, &speeds, None).context("the body")?;
        quadrotor.forget_before(((t_s - 1.0) * 1e9) as i64);
    }
    flown.rmse_m = (sum / steps.max(1) as f64).sqrt();
    Ok(flown)
}

/// The x500's build at the file's mass.
fn body(airframe: &Airframe) -> QuadrotorConfig {
    let like = QuadrotorConfig::x500();
    let mass = airframe.mass_kg;
    let mut rotors = like.rotors;
    for rotor in &mut rotors {
        rotor.position_m = Point3::new(SCALE * rotor.position_m.x, SCALE * rotor.position_m.y, 0.0);
        let most_n = THRUST_TO_WEIGHT * mass * airframe.gravity_mps2 / 4.0;
        rotor.thrust_coefficient_n_s2 = most_n / (rotor.max_speed_radps * rotor.max_speed_radps);
    }
    let inertia: Matrix3<f64> = like.inertia_kgm2 * (mass / like.mass_kg * SCALE * SCALE);
    QuadrotorConfig {
        mass_kg: mass,
        inertia_kgm2: inertia,
        rotors,
        drag_ns_per_m: Vector3::new(airframe.drag_across, airframe.drag_across, airframe.drag_along),
        gravity_mps2: airframe.gravity_mps2,
        vibration_m: 0.0,
        ..like
    }
}
