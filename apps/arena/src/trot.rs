//! A robot on twelve motors that trots over a flat floor with all its forces: what the legs' kinematics are good for.
//!
//! The same [`Gait`] that draws the legs of a mission's robot plans here for a body that could fall. It plans for an ideal base,
//! which goes as commanded and leans against a tilt; motors with the URDF's torques pull the legs after the plan; and Raibert's rule
//! is told how much faster the body truly is than it is to be, so a push is answered with the next foothold:
//!
//! ```text
//! ideal base    p' = v_wanted,   yaw' = w_wanted + a (yaw_wanted - yaw),   roll, pitch = -b (tilt measured)
//! foothold      n(t_down + T_stance / 2) of the ideal base, + k (v measured - v_wanted)
//! torque        clamp(k_p (q_plan - q) + k_d (q_plan' - q'), effort of the URDF)
//! ```
//!
//! No force is planned and no contact sensed: level ground and a gentle speed are what it is for.

use anyhow::{Context, Result};
use mission::robot_model::{BaseMotion, Gait, GaitConfig, Geometry, MergedBody, RobotModel, merged_bodies};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use omni_sim::articulated::{Articulated, HingeRecord, LinkRecord, MotorGains};
use omni_sim::contact::{CollisionShape, ShapeGeometry};

/// What is walked, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct TrotConfig {
    /// Forward speed (0.4).
    pub speed_mps: f64,
    /// Turning speed (0).
    pub yaw_rate_radps: f64,
    /// Length of the way (5).
    pub distance_m: f64,
    /// Time after which it is not waited any longer (30).
    pub max_time_s: f64,
    /// Step of physics and control (0.002).
    pub dt_s: f64,
    /// Steps.
    pub gait: GaitConfig,
    /// Motors, of a robot whose weight times its thigh is [`GAINS_FOR_NM`]; others pull in proportion.
    pub gains: MotorGains,
    /// A sideways push in the middle of the way: the speed that it gives the body (0).
    pub push_mps: f64,
}

impl Default for TrotConfig {
    fn default() -> Self {
        Self {
            speed_mps: 0.4,
            yaw_rate_radps: 0.0,
            distance_m: 5.0,
            max_time_s: 30.0,
            dt_s: 0.002,
            gait: GaitConfig { lift_m: 0.08, ..GaitConfig::default() },
            // So stiff that a leg under load sags by a few millimetres: nothing here knows the weight beforehand.
            gains: MotorGains { stiffness_nm_per_rad: 400.0, damping_nms_per_rad: 8.0 },
            push_mps: 0.0,
        }
    }
}

/// What became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct TrotReport {
    /// Length of the way of the body, its sway within a stride left out.
    pub distance_m: f64,
    /// Time from the first step on.
    pub seconds: f64,
    /// Whether it fell: tilted by more than a radian, sank to half its height, or touched the floor with its trunk.
    pub has_fallen: bool,
    /// How far the standing feet slid, of each metre of the way, mean of all feet.
    pub slip_m_per_m: f64,
    /// Largest tilt of the body.
    pub worst_tilt_rad: f64,
    /// How far it ended beside the line it was to walk; only of a way without a turn.
    pub beside_m: f64,
    /// How far it turned.
    pub turned_rad: f64,
    /// Steps of all feet.
    pub steps: usize,
}

/// Weight times thigh of the built-in quadruped.
pub const GAINS_FOR_NM: f64 = 32.0;
/// It stands for so long before the first step.
const SETTLE_S: f64 = 0.5;
/// The commanded speed comes up so fast.
const START_MPS2: f64 = 0.5;
/// Time constant of the filter on the measured velocity: half a step.
const VELOCITY_FILTER_S: f64 = 0.1;
/// `a` of the heading, 1/s, and the share of a tilt that is leant against.
const HEADING_GAIN: f64 = 1.5;
const LEAN_GAIN: f64 = 0.3;
/// The way is measured over such pieces.
const PIECE_S: f64 = 0.4;

/// Lets a robot walk.
///
/// # Errors
/// A robot without legs or with a body without mass.
pub fn trot(robot: &RobotModel, config: &TrotConfig) -> Result<TrotReport> {
    let start = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
    let mut gait = Gait::new(config.gait, robot, &start, 0.0)?;
    let (links, slots) = records(robot);
    let first = &merged_bodies(&robot.tree)[0];
    let angles: Vec<f64> = slots.iter().map(|slot| robot.stance[*slot]).collect();
    let mut body = Articulated::new(&links, &start, &angles, 0.0).context("setting up the motors")?;
    let mut feet = feet(robot);

    let dt_s = config.dt_s;
    let share = robot.mass_kg * 9.81 * robot.legs[0].thigh_length_m / GAINS_FOR_NM;
    let gains = MotorGains {
        stiffness_nm_per_rad: share * config.gains.stiffness_nm_per_rad,
        damping_nms_per_rad: share * config.gains.damping_nms_per_rad,
    };
    let mut report = TrotReport {
        distance_m: 0.0,
        seconds: 0.0,
        has_fallen: false,
        slip_m_per_m: 0.0,
        worst_tilt_rad: 0.0,
        beside_m: 0.0,
        turned_rad: 0.0,
        steps: 0,
    };
    let (mut ideal_at, mut ideal_yaw, mut wanted_yaw, mut speed) = (Vector2::zeros(), 0.0_f64, 0.0_f64, 0.0_f64);
    let (mut velocity, mut slip_m, mut piece) = (Vector2::zeros(), 0.0, (0.0, Vector2::zeros()));
    let (mut last_yaw, mut is_pushed) = (0.0, false);
    let mut plan: Vec<f64> = gait.angles().to_vec();
    for step in 0.. {
        let t_s = step as f64 * dt_s;
        let pose = body.world_from_body(0);
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        // 1. Is it still on its feet, and how far has it come?
        let tilt_rad = (pose.rotation * Vector3::z()).angle(&Vector3::z());
        let is_down = body.standing().iter().any(|standing| standing.body == 0 && !first.shapes.is_empty());
        report.worst_tilt_rad = report.worst_tilt_rad.max(tilt_rad);
        report.has_fallen = tilt_rad > 1.0 || pose.translation.z < 0.5 * robot.stance_height_m || is_down;
        report.seconds = (t_s - SETTLE_S).max(0.0);
        report.turned_rad += nalgebra::wrap(yaw - last_yaw, -std::f64::consts::PI, std::f64::consts::PI);
        last_yaw = yaw;
        let at = pose.translation.vector.xy();
        if t_s - piece.0 >= PIECE_S {
            report.distance_m += (at - piece.1).norm();
            piece = (t_s, at);
        }
        if report.has_fallen || report.distance_m >= config.distance_m || report.seconds >= config.max_time_s {
            report.beside_m = at.y.abs();
            break;
        }
        // 2. The ideal base goes on.
        let is_walking = t_s >= SETTLE_S;
        if is_walking {
            speed = (speed + START_MPS2 * dt_s).min(config.speed_mps);
            wanted_yaw += config.yaw_rate_radps * dt_s;
        }
        let off = nalgebra::wrap(wanted_yaw - yaw, -std::f64::consts::PI, std::f64::consts::PI);
        let yaw_rate = if is_walking { config.yaw_rate_radps + HEADING_GAIN * off } else { 0.0 };
        let aside = if is_walking && config.yaw_rate_radps == 0.0 { (-0.5 * at.y).clamp(-0.1, 0.1) } else { 0.0 };
        let wanted = turned(Vector2::new(speed, aside), ideal_yaw);
        ideal_at += wanted * dt_s;
        ideal_yaw += yaw_rate * dt_s;
        // 3. What the body truly does, seen from the ideal base.
        let measured = turned(body.velocity().0.xy(), ideal_yaw - yaw);
        velocity += (measured - velocity) * (dt_s / VELOCITY_FILTER_S);
        let lean = UnitQuaternion::from_euler_angles(-LEAN_GAIN * roll, -LEAN_GAIN * pitch, ideal_yaw);
        let at = Translation3::new(ideal_at.x, ideal_at.y, robot.stance_height_m);
        let motion = BaseMotion {
            world_from_body: Isometry3::from_parts(at, lean),
            velocity_in_world_mps: wanted,
            yaw_rate_radps: yaw_rate,
            excess_velocity_in_world_mps: velocity - wanted,
        };
        let stood: Vec<bool> = gait.feet().iter().map(|foot| foot.is_standing).collect();
        if is_walking {
            gait.step(dt_s, &motion)?;
        }
        report.steps += stood.iter().zip(gait.feet()).filter(|(before, now)| !**before && now.is_standing).count();
        // 4. Motors, physics.
        let targets: Vec<(f64, f64)> =
            slots.iter().map(|slot| (gait.angles()[*slot], (gait.angles()[*slot] - plan[*slot]) / dt_s)).collect();
        plan.copy_from_slice(gait.angles());
        body.drive(&targets, &gains);
        if !is_pushed && config.push_mps != 0.0 && report.distance_m > 0.5 * config.distance_m {
            is_pushed = true;
            body.push(&Vector3::new(0.0, config.push_mps, 0.0));
        }
        body.step(dt_s)?;
        for foot in &mut feet {
            slip_m += foot.slid(&body);
        }
    }
    report.slip_m_per_m = slip_m / feet.len().max(1) as f64 / report.distance_m.max(0.1);
    Ok(report)
}

/// A foot whose sole is watched.
struct Foot {
    /// The body that carries it, and its origin there.
    body: usize,
    in_body: Point3<f64>,
    sole_m: f64,
    /// The sole's lowest point in the body and in the world, while it stands.
    sole: Option<(Point3<f64>, Point3<f64>)>,
}

impl Foot {
    /// How far the sole slid in the last step.
    fn slid(&mut self, body: &Articulated) -> f64 {
        let pose = body.world_from_body(self.body);
        let slid_m = self.sole.map_or(0.0, |(in_body, in_world)| (pose * in_body - in_world).xy().norm());
        let is_standing = body.standing().iter().any(|standing| standing.body == self.body);
        let in_world = pose * self.in_body - Vector3::z() * self.sole_m;
        let was_standing = self.sole.is_some();
        self.sole = is_standing.then(|| (pose.inverse_transform_point(&in_world), in_world));
        if was_standing && is_standing { slid_m } else { 0.0 }
    }
}

fn feet(robot: &RobotModel) -> Vec<Foot> {
    let bodies = merged_bodies(&robot.tree);
    let foot = |name: &str| {
        let link = robot.tree.link_named(name)?;
        bodies.iter().enumerate().find_map(|(body, merged)| {
            let (_, pose) = merged.links.iter().find(|(own, _)| *own == link)?;
            let sole_m = robot.stance_height_m + robot.frames[name].translation.z;
            Some(Foot { body, in_body: Point3::from(pose.translation.vector), sole_m, sole: None })
        })
    };
    robot.legs.iter().filter_map(|leg| foot(&leg.foot)).collect()
}

/// The robot as the simulator's records, and for each of its motors the place in the list of moving joints.
fn records(robot: &RobotModel) -> (Vec<LinkRecord>, Vec<usize>) {
    let bodies = merged_bodies(&robot.tree);
    let slot = |joint: usize| robot.tree.moving_joints().iter().position(|moving| *moving == joint);
    let slots = bodies.iter().filter_map(|body| slot(body.joint?)).collect();
    (bodies.iter().map(|body| record(robot, body)).collect(), slots)
}

fn record(robot: &RobotModel, body: &MergedBody) -> LinkRecord {
    /// For a joint whose URDF gives none.
    const STRONG_NM: f64 = 1000.0;
    let hinge = body.joint.zip(body.parent).map(|(joint, (parent, parent_from_joint))| {
        let joint = &robot.tree.joints()[joint];
        HingeRecord {
            parent,
            parent_from_joint,
            axis: joint.axis,
            limits_rad: joint.lower.zip(joint.upper),
            max_torque_nm: joint.max_effort.unwrap_or(STRONG_NM),
        }
    });
    let shapes = body.shapes.iter().map(|(pose, geometry)| CollisionShape {
        body_from_shape: *pose,
        geometry: match geometry {
            Geometry::Box { half } => ShapeGeometry::Box { half_m: *half },
            Geometry::Cylinder { radius, half_length } => {
                ShapeGeometry::Cylinder { radius_m: *radius, half_length_m: *half_length }
            }
            Geometry::Sphere { radius } => ShapeGeometry::Sphere { radius_m: *radius },
            Geometry::ConvexHull(points) => ShapeGeometry::ConvexHull { points: points.clone() },
        },
    });
    LinkRecord {
        joint: hinge,
        mass_kg: body.mass.mass_kg,
        center_of_mass: body.mass.center_of_mass,
        inertia_kgm2: body.mass.inertia,
        shapes: shapes.collect(),
    }
}

fn turned(v: Vector2<f64>, angle: f64) -> Vector2<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}
