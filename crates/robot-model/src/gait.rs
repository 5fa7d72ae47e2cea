//! How the legs go along with the base: a trot whose feet stand still in the world while they stand.
//!
//! The base is somebody else's: a simulator's, or that of a robot that tells where it is. The gait is told its motion step by step and
//! answers with the angles of all joints. Diagonal legs swing together, each pair for `1 - duty` of a stride, and a foot is put
//! where the body will pass over it half a stance later (Raibert), which for a body that turns lies on an arc:
//!
//! ```text
//! foothold = n(t_down + T_stance / 2) + k (v - v_wanted)      n(t): the foot's place in the stance, below the body at time t
//!          = n(now) + v (t_down - now) + v T_stance / 2 + k (v - v_wanted)                     for a body that does not turn
//! ```
//!
//! A foot in the air moves on the polynomial of fifth order from where it is to its foothold, newly made in every step since the base
//! may have changed its mind, at rest at both ends; above it `64 s^3 (1 - s)^3` lifts it. Position, velocity and acceleration of a
//! foot are continuous, so the joints' are.
//!
//! A base that stands has all feet on the floor. A leg that ends in a wheel does not step: its hub stays where the stance has it and
//! the wheel turns with the way.
//!
//! M. H. Raibert, Legged Robots That Balance, MIT Press 1986, chapter 2.

use crate::leg::Leg;
use crate::model::RobotModel;
use crate::tree::JointKind;
use nalgebra::{Isometry3, Point2, Point3, Vector2};

/// Rhythm and size of the steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaitConfig {
    /// Steps that each leg makes in a second (2).
    pub stride_hz: f64,
    /// Share of a stride for which a foot stands, from 0.5 to below 1 (0.55: for a tenth of a stride all feet do).
    pub duty: f64,
    /// How high a foot is lifted, m (0.06).
    pub lift_m: f64,
    /// Raibert's `k`, s (0.03).
    pub feedback_s: f64,
    /// The base stands when no foot's place moves faster, m/s (0.03).
    pub rest_mps: f64,
    /// A foot of a base that stands steps if it is farther from its place than this, m (0.02).
    pub astray_m: f64,
    /// Whether the pair that goes first is front right and rear left (false).
    pub is_right_first: bool,
}

impl Default for GaitConfig {
    fn default() -> Self {
        Self {
            stride_hz: 2.0,
            duty: 0.55,
            lift_m: 0.06,
            feedback_s: 0.03,
            rest_mps: 0.03,
            astray_m: 0.02,
            is_right_first: false,
        }
    }
}

/// Motion of the base at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseMotion {
    /// Pose of the body.
    pub world_from_body: Isometry3<f64>,
    /// Velocity of the body's origin in the world, m/s; vertical motion does not matter.
    pub velocity_in_world_mps: Vector2<f64>,
    /// Turning to the left about the vertical.
    pub yaw_rate_radps: f64,
    /// By how much the body is faster than it is to be, in the world: `v - v_wanted`, m/s.
    pub excess_velocity_in_world_mps: Vector2<f64>,
}

impl BaseMotion {
    /// Of a base that stands.
    pub fn resting_at(world_from_body: Isometry3<f64>) -> Self {
        let zero = Vector2::zeros();
        let excess_velocity_in_world_mps = zero;
        BaseMotion { world_from_body, velocity_in_world_mps: zero, yaw_rate_radps: 0.0, excess_velocity_in_world_mps }
    }
}

/// Why there is no gait, or no next step of it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GaitError {
    /// The TOML names no legs.
    #[error("robot `{robot}` has no legs: its TOML has no [[legs]]")]
    NoLegs {
        /// Name of the robot.
        robot: String,
    },
    /// The closed-form kinematics do not describe this leg.
    #[error(
        "leg `{leg}`: in the stance its knee or foot is {off_m:.4} m from where a leg of the accepted kind would have it; accepted is a leg that hangs straight down at zero, hip about x, thigh and calf about y, knee backwards"
    )]
    OtherKindOfLeg {
        /// Name of the leg.
        leg: String,
        /// Distance; infinite when the place is out of reach.
        off_m: f64,
    },
    /// A number of the configuration is out of its range.
    #[error("gait: `{key}` must be {expected}")]
    Config {
        /// The field.
        key: &'static str,
        /// What is accepted.
        expected: &'static str,
    },
    /// The base's motion or the floor is NaN or infinite.
    #[error("the motion of the base is not finite")]
    NotFinite,
    /// The step is not positive or longer than [`LONGEST_STEP_S`].
    #[error("a step of {dt_s} s; accepted is more than 0 and at most {LONGEST_STEP_S} s")]
    Step {
        /// Length given.
        dt_s: f64,
    },
}

/// Longest time between two poses of the base: a swing has to be seen several times.
pub const LONGEST_STEP_S: f64 = 0.05;
/// A foothold is no longer changed in this last share of a swing.
const SETTLED: f64 = 0.25;
/// A leg lifts off within this first share of its swing, or waits for the next one.
const LATEST_START: f64 = 0.3;
/// In the stance knee and foot are where the closed form puts them to so much.
const LEG_TOL_M: f64 = 1e-6;

/// A foot now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// Where its origin is to be, in the world. While it stands this does not change.
    pub in_world: Point3<f64>,
    /// Whether it stands; a wheel always does.
    pub is_standing: bool,
    /// By how much the leg misses this place, m; 0 while it is within reach and the joints' limits. More than 0: the base asked too much.
    pub missed_by_m: f64,
}

/// Legs on their way.
#[derive(Debug, Clone)]
pub struct Gait {
    config: GaitConfig,
    floor_z_m: f64,
    legs: Vec<GaitLeg>,
    feet: Vec<Foot>,
    swings: Vec<Option<Swing>>,
    /// Strides since the first foot lifted off; `None` while all stand and need not step.
    strides: Option<f64>,
    angles: Vec<f64>,
}

/// What a leg is, for the gait.
#[derive(Debug, Clone)]
struct GaitLeg {
    leg: Leg,
    /// The foot in the stance, in the body.
    neutral_in_body: Point3<f64>,
    /// Height of the foot's origin above the floor while it stands.
    sole_m: f64,
    /// Part of a stride by which its swing comes after the first pair's.
    offset: f64,
    /// Place in the list of moving joints of a wheel, and its sign: +1 turns forwards.
    wheel: Option<(usize, f64)>,
}

/// A foot in the air: its planar motion, and how it goes on.
#[derive(Debug, Clone, Copy)]
struct Swing {
    velocity: Vector2<f64>,
    acceleration: Vector2<f64>,
    target: Point2<f64>,
    duration_s: f64,
    left_s: f64,
}

impl Gait {
    /// The robot standing at `world_from_body` over a floor of height `floor_z_m`, all feet in their places of the stance.
    ///
    /// # Errors
    /// All of [`GaitError`] but [`GaitError::Step`].
    pub fn new(
        config: GaitConfig,
        robot: &RobotModel,
        world_from_body: &Isometry3<f64>,
        floor_z_m: f64,
    ) -> Result<Gait, GaitError> {
        config.validate()?;
        if !is_finite(world_from_body) || !floor_z_m.is_finite() {
            return Err(GaitError::NotFinite);
        }
        if robot.legs.is_empty() {
            return Err(GaitError::NoLegs { robot: robot.name.clone() });
        }
        let legs = robot.legs.iter().map(|leg| gait_leg(robot, leg, &config)).collect::<Result<Vec<_>, _>>()?;
        let stand = |leg: &GaitLeg| Foot {
            in_world: leg.place(&below(world_from_body, &leg.neutral_in_body), floor_z_m),
            is_standing: true,
            missed_by_m: 0.0,
        };
        let mut gait = Gait {
            config,
            floor_z_m,
            feet: legs.iter().map(stand).collect(),
            swings: vec![None; legs.len()],
            legs,
            strides: None,
            angles: robot.stance.clone(),
        };
        gait.bend(world_from_body);
        Ok(gait)
    }

    /// The base is now there and moves so, `dt_s` after the last call.
    ///
    /// # Errors
    /// [`GaitError::NotFinite`] and [`GaitError::Step`]; then nothing has changed.
    pub fn step(&mut self, dt_s: f64, base: &BaseMotion) -> Result<(), GaitError> {
        let numbers = [base.yaw_rate_radps].into_iter();
        let velocities = base.velocity_in_world_mps.iter().chain(base.excess_velocity_in_world_mps.iter()).copied();
        if !is_finite(&base.world_from_body) || !numbers.chain(velocities).all(f64::is_finite) {
            return Err(GaitError::NotFinite);
        }
        if !(dt_s > 0.0 && dt_s <= LONGEST_STEP_S) {
            return Err(GaitError::Step { dt_s });
        }
        // 1. Start when the base does; stop when it has stopped and every foot is in its place.
        self.strides = match self.strides {
            None if self.must_step(base) => Some(0.0),
            Some(_) if self.feet.iter().all(|foot| foot.is_standing) && !self.must_step(base) => None,
            strides => strides.map(|strides| strides + dt_s * self.config.stride_hz),
        };
        // 2. Feet.
        for index in 0..self.legs.len() {
            if self.legs[index].wheel.is_some() {
                self.roll(index, dt_s, base);
            } else {
                self.lift_off(index);
                self.swing_on(index, dt_s, base);
            }
        }
        // 3. Joints.
        self.bend(&base.world_from_body);
        Ok(())
    }

    /// Angles of all joints, in the order of [`crate::KinematicTree::moving_joints`]; joints of no leg stay as in the stance. They are
    /// within the joints' limits, whatever the base does.
    pub fn angles(&self) -> &[f64] {
        &self.angles
    }

    /// The feet, in the order of [`RobotModel::legs`].
    pub fn feet(&self) -> &[Foot] {
        &self.feet
    }

    /// The largest [`Foot::missed_by_m`].
    pub fn missed_by_m(&self) -> f64 {
        self.feet.iter().map(|foot| foot.missed_by_m).fold(0.0, f64::max)
    }

    /// Whether the base moves, or a foot stands elsewhere than in its place.
    fn must_step(&self, base: &BaseMotion) -> bool {
        // Speeds grow by equal steps and may meet the limit exactly; then rounding, which differs with the heading, must not decide.
        const TIE: f64 = 1.0 + 1e-9;
        self.legs.iter().zip(&self.feet).filter(|(leg, _)| leg.wheel.is_none()).any(|(leg, foot)| {
            let place = below(&base.world_from_body, &leg.neutral_in_body);
            let arm = place - base.world_from_body.translation.vector.xy();
            let turned = Vector2::new(-arm.y, arm.x) * base.yaw_rate_radps;
            (base.velocity_in_world_mps + turned).norm() > TIE * self.config.rest_mps
                || (place - foot.in_world.xy()).norm() > TIE * self.config.astray_m
        })
    }

    /// Begins the swing of a leg whose turn it is.
    fn lift_off(&mut self, index: usize) {
        let Some(strides) = self.strides else { return };
        let GaitConfig { stride_hz, duty, .. } = self.config;
        let into = (strides + self.legs[index].offset).rem_euclid(1.0);
        if self.swings[index].is_none() && into < LATEST_START * (1.0 - duty) {
            let target = self.feet[index].in_world.xy();
            let left_s = (1.0 - duty - into) / stride_hz;
            let rest = Vector2::zeros();
            self.feet[index].is_standing = false;
            self.swings[index] = Some(Swing { velocity: rest, acceleration: rest, target, duration_s: left_s, left_s });
        }
    }

    /// Moves a foot in the air on, and puts it down at the end.
    fn swing_on(&mut self, index: usize, dt_s: f64, base: &BaseMotion) {
        let Some(mut swing) = self.swings[index] else { return };
        let (leg, config) = (&self.legs[index], &self.config);
        if swing.left_s >= SETTLED * swing.duration_s {
            let ahead_s = swing.left_s - dt_s + 0.5 * config.duty / config.stride_hz;
            swing.target = foothold(base, &leg.neutral_in_body, ahead_s, config.feedback_s);
        }
        let foot = &mut self.feet[index];
        let at = foot.in_world.xy();
        if swing.left_s - dt_s < 1e-9 {
            foot.in_world = leg.place(&swing.target, self.floor_z_m);
            foot.is_standing = true;
            self.swings[index] = None;
            return;
        }
        let (at, velocity, acceleration) = toward(at, swing.velocity, swing.acceleration, &swing, dt_s);
        swing.left_s -= dt_s;
        (swing.velocity, swing.acceleration) = (velocity, acceleration);
        let done = 1.0 - swing.left_s / swing.duration_s;
        foot.in_world = leg.place(&at, self.floor_z_m);
        foot.in_world.z += config.lift_m * 64.0 * (done * (1.0 - done)).powi(3);
        self.swings[index] = Some(swing);
    }

    /// A wheel's hub keeps its place below the body, and the wheel turns with its way forwards.
    fn roll(&mut self, index: usize, dt_s: f64, base: &BaseMotion) {
        let leg = &self.legs[index];
        let place = below(&base.world_from_body, &leg.neutral_in_body);
        self.feet[index].in_world = leg.place(&place, self.floor_z_m);
        if let Some((slot, sign)) = leg.wheel
            && leg.sole_m > 0.0
        {
            let forward = rotated(Vector2::x(), heading(&base.world_from_body));
            let arm = place - base.world_from_body.translation.vector.xy();
            let hub = base.velocity_in_world_mps + Vector2::new(-arm.y, arm.x) * base.yaw_rate_radps;
            self.angles[slot] += sign * hub.dot(&forward) * dt_s / leg.sole_m;
        }
    }

    /// Joint angles that put every foot where it is to be, or as far towards it as the leg goes.
    fn bend(&mut self, world_from_body: &Isometry3<f64>) {
        for (leg, foot) in self.legs.iter().zip(&mut self.feet) {
            let wanted = world_from_body.inverse_transform_point(&foot.in_world);
            let (angles, reached) = leg.nearest(&wanted);
            foot.missed_by_m = reached.map_or(0.0, |reached| (wanted - reached).norm());
            for (slot, angle) in leg.leg.slots.iter().zip(angles) {
                self.angles[*slot] = angle;
            }
        }
    }
}

impl GaitLeg {
    /// The foot's origin when it stands at this place of the floor.
    fn place(&self, at: &Point2<f64>, floor_z_m: f64) -> Point3<f64> {
        Point3::new(at.x, at.y, floor_z_m + self.sole_m)
    }

    /// Angles for `wanted`; where that is out of reach, for the last point within reach on the way from the stance to it, and that point.
    fn nearest(&self, wanted: &Point3<f64>) -> ([f64; 3], Option<Point3<f64>>) {
        if let Some(angles) = self.leg.inverse(wanted) {
            return (angles, None);
        }
        let point = |share: f64| self.neutral_in_body + (wanted - self.neutral_in_body) * share;
        let at_stance = self.leg.inverse(&self.neutral_in_body).expect("`gait_leg` has tried it");
        let (mut low, mut high, mut found) = (0.0, 1.0, at_stance);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            match self.leg.inverse(&point(middle)) {
                Some(angles) => (low, found) = (middle, angles),
                None => high = middle,
            }
        }
        (found, Some(point(low)))
    }
}

impl GaitConfig {
    /// Checks every number.
    ///
    /// # Errors
    /// [`GaitError::Config`], naming the first that is out of its range.
    pub fn validate(&self) -> Result<(), GaitError> {
        let check =
            |is_good: bool, key, expected| if is_good { Ok(()) } else { Err(GaitError::Config { key, expected }) };
        // A swing lasts at least six of the longest steps at the fastest rhythm and the shortest swing.
        let swing_s = (1.0 - self.duty) / self.stride_hz;
        check(self.stride_hz > 0.0 && self.stride_hz <= 10.0, "stride_hz", "more than 0 and at most 10")?;
        check((0.5..1.0).contains(&self.duty), "duty", "at least 0.5 and below 1")?;
        check(swing_s >= 0.02, "duty", "such that a swing lasts at least 0.02 s")?;
        check(self.lift_m > 0.0 && self.lift_m.is_finite(), "lift_m", "a positive number")?;
        let not_negative = [("feedback_s", self.feedback_s), ("rest_mps", self.rest_mps), ("astray_m", self.astray_m)];
        not_negative
            .into_iter()
            .try_for_each(|(key, value)| check(value >= 0.0 && value.is_finite(), key, "zero or a positive number"))
    }
}

/// Where a foot is to stand so that the body has it in its place (`neutral_in_body`) after `ahead_s`: at the middle of its stance.
pub fn foothold(base: &BaseMotion, neutral_in_body: &Point3<f64>, ahead_s: f64, feedback_s: f64) -> Point2<f64> {
    let (velocity, turn) = (base.velocity_in_world_mps, base.yaw_rate_radps * ahead_s);
    // The way of a body that goes on turning as it does: chord and its direction.
    let half = 0.5 * turn;
    let shrink = if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
    let way = rotated(velocity, half) * (shrink * ahead_s);
    let there = below(&base.world_from_body, neutral_in_body) - base.world_from_body.translation.vector.xy();
    let feedback = base.excess_velocity_in_world_mps * feedback_s;
    Point2::from(base.world_from_body.translation.vector.xy() + way + rotated(there.coords, turn) + feedback)
}

/// A point of the body, were the body level, seen from above.
fn below(world_from_body: &Isometry3<f64>, in_body: &Point3<f64>) -> Point2<f64> {
    let at = rotated(in_body.coords.xy(), heading(world_from_body));
    Point2::from(world_from_body.translation.vector.xy() + at)
}

fn heading(world_from_body: &Isometry3<f64>) -> f64 {
    world_from_body.rotation.euler_angles().2
}

fn rotated(v: Vector2<f64>, angle: f64) -> Vector2<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}

/// Place, velocity and acceleration after `dt_s` on the polynomial of fifth order that comes to rest at the target when the swing ends.
fn toward(
    at: Point2<f64>,
    velocity: Vector2<f64>,
    acceleration: Vector2<f64>,
    swing: &Swing,
    dt_s: f64,
) -> (Point2<f64>, Vector2<f64>, Vector2<f64>) {
    let (tau, t) = (swing.left_s, dt_s);
    // What is missing at the end without the last three terms: place, velocity, acceleration.
    let d = swing.target - at - velocity * tau - acceleration * (0.5 * tau * tau);
    let e = -(velocity + acceleration * tau) * tau;
    let f = -acceleration * (tau * tau);
    let c3 = (10.0 * d - 4.0 * e + 0.5 * f) / tau.powi(3);
    let c4 = (-15.0 * d + 7.0 * e - f) / tau.powi(4);
    let c5 = (6.0 * d - 3.0 * e + 0.5 * f) / tau.powi(5);
    let place = at + velocity * t + acceleration * (0.5 * t * t) + (c3 + c4 * t + c5 * (t * t)) * t.powi(3);
    let speed = velocity + acceleration * t + (3.0 * c3 + 4.0 * c4 * t + 5.0 * c5 * (t * t)) * (t * t);
    let change = acceleration + (6.0 * c3 + 12.0 * c4 * t + 20.0 * c5 * (t * t)) * t;
    (place, speed, change)
}

fn gait_leg(robot: &RobotModel, leg: &Leg, config: &GaitConfig) -> Result<GaitLeg, GaitError> {
    let neutral_in_body = Point3::from(robot.frames[&leg.foot].translation.vector);
    // The closed form must give back the stance, the knee included.
    let off_m = leg.inverse(&neutral_in_body).map_or(f64::INFINITY, |found| {
        let mut angles = robot.stance.clone();
        leg.slots.iter().zip(found).for_each(|(slot, angle)| angles[*slot] = angle);
        let poses = robot.tree.body_from_links(&angles).expect("as many finite angles as the stance has");
        let calf = &robot.tree.joints()[robot.tree.moving_joints()[leg.slots[2]]];
        let places = [Some(calf.child), robot.tree.link_named(&leg.foot)].into_iter().flatten();
        let off = |link: usize| {
            let stance = &robot.frames[&robot.tree.links()[link].name];
            (poses[link].translation.vector - stance.translation.vector).norm()
        };
        places.map(off).fold(0.0, f64::max)
    });
    if off_m > LEG_TOL_M {
        return Err(GaitError::OtherKindOfLeg { leg: leg.name.clone(), off_m });
    }
    let is_first = (neutral_in_body.x * neutral_in_body.y >= 0.0) != config.is_right_first;
    Ok(GaitLeg {
        leg: leg.clone(),
        neutral_in_body,
        sole_m: (robot.stance_height_m + neutral_in_body.z).max(0.0),
        offset: if is_first { 0.0 } else { 0.5 },
        wheel: wheel(robot, leg),
    })
}

/// The joint on which the foot turns without limits, if there is one.
fn wheel(robot: &RobotModel, leg: &Leg) -> Option<(usize, f64)> {
    let tree = &robot.tree;
    let mut link = tree.link_named(&leg.foot)?;
    let calf = tree.moving_joints()[leg.slots[2]];
    while let Some(index) = tree.joint_above(link).filter(|index| *index != calf) {
        let joint = &tree.joints()[index];
        if joint.kind == JointKind::Continuous {
            let slot = tree.moving_joints().iter().position(|moving| *moving == index)?;
            let axis = robot.frames[&tree.links()[joint.child].name] * joint.axis;
            return Some((slot, axis.y.signum()));
        }
        link = joint.parent;
    }
    None
}

fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|x| x.is_finite())
}
