//! TEMPORARY stand-in until omni-sim's physics lands: an ideal kinematic body.

use anyhow::Result;
use mission::robot_model::RobotModel;
use mission::stream::Command;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_sim::motion::{KinematicState, Motion};
use omni_sim::world::World;

use crate::drift::DriftingOdometry;

pub struct RawTouch { pub instance: u32, pub point: Point3<f64> }

pub struct SimulatedBody<'a> {
    _world: &'a World,
    history: History,
    v: Vector3<f64>,
    yaw_rate: f64,
    is_air: bool,
}

#[derive(Default)]
pub struct History(Vec<KinematicState>);

impl Motion for History {
    fn at(&self, stamp_ns: i64) -> KinematicState {
        let i = self.0.partition_point(|s| s.stamp_ns < stamp_ns).clamp(1, self.0.len().max(2) - 1);
        let (a, b) = (&self.0[i - 1], &self.0[i.min(self.0.len() - 1)]);
        if b.stamp_ns == a.stamp_ns { return *a; }
        let u = ((stamp_ns - a.stamp_ns) as f64 / (b.stamp_ns - a.stamp_ns) as f64).clamp(0.0, 1.0);
        let mut s = *a;
        s.stamp_ns = stamp_ns;
        s.world_from_body = a.world_from_body.lerp_slerp(&b.world_from_body, u);
        s
    }
}

impl<'a> SimulatedBody<'a> {
    pub fn new(robot: &RobotModel, world: &'a World, start: &Isometry3<f64>, _m: &Isometry3<f64>) -> Result<Self> {
        let s = KinematicState::at_rest(0, *start);
        Ok(Self { _world: world, history: History(vec![s]), v: Vector3::zeros(), yaw_rate: 0.0, is_air: !robot.rotors.is_empty() })
    }
    pub fn advance(&mut self, command: &Command, tick_ns: i64, odometry: &DriftingOdometry) -> Result<()> {
        let dt = tick_ns as f64 * 1e-9;
        let last = *self.history.0.last().unwrap();
        let mut pose = last.world_from_body;
        let (_, _, yaw) = pose.rotation.euler_angles();
        match command {
            Command::Velocity { forward_mps, left_mps, yaw_rate_radps } => {
                let k = 0.15;
                self.v += (Vector3::new(*forward_mps, *left_mps, 0.0) - self.v) * k;
                self.yaw_rate += (yaw_rate_radps - self.yaw_rate) * k;
            }
            Command::Flight(p) => {
                let est = odometry.estimate_from_body();
                let e = p.position_in_world.coords - est.translation.vector;
                let vw = p.velocity_in_world_mps + e * 2.0;
                let body = est.rotation.inverse() * vw;
                self.v += (body - self.v) * 0.1;
                let ey = p.yaw_rad - est.rotation.euler_angles().2;
                let ey = ey.sin().atan2(ey.cos());
                self.yaw_rate = p.yaw_rate_radps + ey * 2.0;
                if !p.is_armed { self.v = Vector3::zeros(); self.yaw_rate = 0.0; }
            }
        }
        let _ = self.is_air;
        let r = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw + self.yaw_rate * dt);
        let vw = r * self.v;
        pose = Isometry3::from_parts(Translation3::from(pose.translation.vector + vw * dt), r);
        let mut s = KinematicState::at_rest(last.stamp_ns + tick_ns, pose);
        s.velocity_world = vw;
        s.angular_velocity_body = Vector3::new(0.0, 0.0, self.yaw_rate);
        self.history.0.push(s);
        if self.history.0.len() > 400 { self.history.0.drain(..100); }
        Ok(())
    }
    pub fn take_touches(&mut self) -> Vec<RawTouch> { Vec::new() }
    pub fn state(&self) -> KinematicState { *self.history.0.last().unwrap() }
    pub fn motion(&self) -> &dyn Motion { &self.history }
}
