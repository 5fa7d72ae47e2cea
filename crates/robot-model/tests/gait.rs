//! Laws of the gait: what stands does not slide, joints keep their limits, who rests has all feet down, and turns, mirrors and shifts of the
//! world change nothing else.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2};
use proptest::prelude::*;
use robot_model::gait::foothold;
use robot_model::{
    BaseMotion, Gait, GaitConfig, GaitError, RobotModel, builtin_toml, mesh_candidates, quadruped_texts,
};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

static QUADRUPED: LazyLock<RobotModel> = LazyLock::new(RobotModel::builtin_quadruped);

const DT_S: f64 = 0.005;
/// A few products of poses of some metres.
const SLIDE_TOL_M: f64 = 1e-9;

/// A wanted velocity as shares of the robot's limits (forward, left, turn), held for some time.
type Part = ([f64; 3], f64);

/// A base that follows wanted velocities with the accelerations its limits allow, and sways.
struct Base<'a> {
    robot: &'a RobotModel,
    at: [f64; 3],
    velocity: [f64; 3],
    t_s: f64,
    sway: f64,
}

impl<'a> Base<'a> {
    fn new(robot: &'a RobotModel, at: [f64; 3]) -> Self {
        Base { robot, at, velocity: [0.0; 3], t_s: 0.0, sway: 1.0 }
    }

    fn pose(&self) -> Isometry3<f64> {
        let speed = (self.velocity[0].hypot(self.velocity[1]) / self.robot.limits.max_speed_mps).min(1.0) * self.sway;
        let (heave, roll) = ((self.t_s * TAU * 3.0).sin(), (self.t_s * TAU * 1.5).sin());
        let z = self.robot.stance_height_m + 0.008 * speed * heave;
        let turn = UnitQuaternion::from_euler_angles(0.014 * speed * roll, 0.01 * speed * heave, self.at[2]);
        Isometry3::from_parts(Translation3::new(self.at[0], self.at[1], z), turn)
    }

    fn wanted(&self, share: [f64; 3]) -> [f64; 3] {
        let limits = &self.robot.limits;
        let ahead = if share[0] > 0.0 { limits.max_speed_mps } else { limits.max_reverse_speed_mps };
        [share[0] * ahead, share[1] * limits.max_lateral_speed_mps, share[2] * limits.max_yaw_rate_radps]
    }

    /// One step under a wanted velocity in the body.
    fn go(&mut self, wanted: [f64; 3]) -> BaseMotion {
        let limits = &self.robot.limits;
        let accel = [limits.max_accel_mps2, limits.max_accel_mps2, limits.max_yaw_accel_radps2];
        for k in 0..3 {
            let change = (wanted[k] - self.velocity[k]).clamp(-accel[k] * DT_S, accel[k] * DT_S);
            self.velocity[k] += change;
        }
        let turned = |v: [f64; 3], yaw: f64| {
            Vector2::new(v[0] * yaw.cos() - v[1] * yaw.sin(), v[0] * yaw.sin() + v[1] * yaw.cos())
        };
        // Exact for a velocity that stays in the body: the chord of the arc.
        let half = 0.5 * self.velocity[2] * DT_S;
        let shrink = if half == 0.0 { 1.0 } else { half.sin() / half };
        let way = turned(self.velocity, self.at[2] + half) * (shrink * DT_S);
        self.at = [self.at[0] + way.x, self.at[1] + way.y, self.at[2] + 2.0 * half];
        self.t_s += DT_S;
        BaseMotion {
            world_from_body: self.pose(),
            velocity_in_world_mps: turned(self.velocity, self.at[2]),
            yaw_rate_radps: self.velocity[2],
            excess_velocity_in_world_mps: turned(self.velocity, self.at[2]) - turned(wanted, self.at[2]),
        }
    }
}

/// Where the joint angles put the feet.
fn feet_of(robot: &RobotModel, gait: &Gait, world_from_body: &Isometry3<f64>) -> Vec<Point3<f64>> {
    let poses = robot.tree.body_from_links(gait.angles()).expect("finite angles");
    let foot = |name: &str| robot.tree.link_named(name).expect("a foot");
    robot.legs.iter().map(|leg| world_from_body * Point3::from(poses[foot(&leg.foot)].translation.vector)).collect()
}

fn check_limits(robot: &RobotModel, angles: &[f64]) -> Result<(), TestCaseError> {
    for (slot, joint) in robot.tree.moving_joints().iter().enumerate() {
        let joint = &robot.tree.joints()[*joint];
        let (lower, upper) = (joint.lower.unwrap_or(f64::NEG_INFINITY), joint.upper.unwrap_or(f64::INFINITY));
        prop_assert!((lower..=upper).contains(&angles[slot]), "{} at {}", joint.name, angles[slot]);
    }
    Ok(())
}

/// From full speed sideways in a turn to full speed ahead, which no planner asks for, a foot was seen millimetres beyond its reach and a knee some per cent
/// above its speed limit, in some of ten thousand ways.
const MISSED_M: f64 = 0.02;
const FASTEST: f64 = 1.2;

/// Walks and checks every law that holds at every moment. Returns the largest joint speed as a share of the URDF's limit.
fn walk(robot: &RobotModel, config: GaitConfig, parts: &[Part]) -> Result<f64, TestCaseError> {
    let mut base = Base::new(robot, [1.0, -2.0, 0.4]);
    let mut gait = Gait::new(config, robot, &base.pose(), 0.0).expect("a walking robot");
    let mut before = feet_of(robot, &gait, &base.pose());
    let mut stood = vec![true; before.len()];
    let (mut angles, mut fastest) = (gait.angles().to_vec(), 0.0_f64);
    for (share, seconds) in parts {
        let wanted = base.wanted(*share);
        for _ in 0..(seconds / DT_S) as usize {
            let motion = base.go(wanted);
            gait.step(DT_S, &motion).expect("a finite step");
            let missed_m = gait.missed_by_m();
            prop_assert!(missed_m <= MISSED_M, "{missed_m} m out of reach at {} s: {:?}", base.t_s, base.velocity);
            let tolerance_m = SLIDE_TOL_M + 2.0 * missed_m;
            check_limits(robot, gait.angles())?;
            let now = feet_of(robot, &gait, &motion.world_from_body);
            for (index, foot) in gait.feet().iter().enumerate() {
                prop_assert!((now[index] - foot.in_world).norm() < tolerance_m, "the joints do what the foot is to do");
                if foot.is_standing && stood[index] {
                    prop_assert!((now[index] - before[index]).norm() < tolerance_m, "a foot slid");
                }
                let height_m =
                    now[index].z - (robot.stance_height_m + robot.frames[&robot.legs[index].foot].translation.z);
                prop_assert!(height_m > -tolerance_m && height_m < config.lift_m + tolerance_m, "{height_m}");
                prop_assert!(!foot.is_standing || height_m < tolerance_m);
            }
            prop_assert!(gait.feet().iter().filter(|foot| foot.is_standing).count() >= robot.legs.len() / 2);
            for (slot, joint) in robot.tree.moving_joints().iter().enumerate() {
                let speed = (gait.angles()[slot] - angles[slot]).abs() / DT_S;
                let limit = robot.tree.joints()[*joint].max_velocity.unwrap_or(f64::INFINITY);
                fastest = fastest.max(speed / limit);
            }
            stood = gait.feet().iter().map(|foot| foot.is_standing).collect();
            angles = gait.angles().to_vec();
            before = now;
        }
    }
    Ok(fastest)
}

fn parts() -> impl Strategy<Value = Vec<Part>> {
    // Full speed, standing still and slow creeping are likely.
    let share = || prop_oneof![2 => -1.0..1.0f64, 1 => Just(0.0), 1 => Just(1.0), 1 => Just(-1.0), 1 => -0.05..0.05f64];
    prop::collection::vec(([share(), share(), share()], 0.05..1.5f64), 1..5)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn within_the_robots_limits_every_foot_is_within_reach_and_none_slides(parts in parts()) {
        // Driving forwards and sideways at once at full speed is beyond what the planner asks for: it keeps within an ellipse.
        let parts: Vec<Part> = parts.into_iter().map(|(share, seconds)| (within_ellipse(share), seconds)).collect();
        let fastest = walk(&QUADRUPED, GaitConfig::default(), &parts)?;
        prop_assert!(fastest <= FASTEST, "a joint at {fastest} of its speed limit");
    }

    #[test]
    fn whoever_stops_soon_has_all_feet_in_their_places_and_keeps_still(parts in parts()) {
        let robot = &*QUADRUPED;
        let mut base = Base::new(robot, [0.0; 3]);
        let mut gait = Gait::new(GaitConfig::default(), robot, &base.pose(), 0.0).expect("a walking robot");
        for (share, seconds) in parts {
            let wanted = base.wanted(share);
            for _ in 0..(seconds / DT_S) as usize {
                gait.step(DT_S, &base.go(wanted)).expect("a finite step");
            }
        }
        while base.velocity != [0.0; 3] {
            gait.step(DT_S, &base.go([0.0; 3])).expect("a finite step");
        }
        // Two strides at 2 a second.
        for _ in 0..(2.0 / 2.0 / DT_S) as usize {
            gait.step(DT_S, &base.go([0.0; 3])).expect("a finite step");
        }
        let rest = gait.angles().to_vec();
        for (foot, leg) in gait.feet().iter().zip(&robot.legs) {
            let place = base.pose() * Point3::from(robot.frames[&leg.foot].translation.vector);
            let astray_m = (foot.in_world - place).norm();
            prop_assert!(foot.is_standing && astray_m <= GaitConfig::default().astray_m + 1e-6, "{astray_m} m");
        }
        for _ in 0..100 {
            gait.step(DT_S, &base.go([0.0; 3])).expect("a finite step");
            prop_assert_eq!(gait.angles(), &rest[..]);
        }
    }

    /// Left for right, and the pair that goes first changed: the same angles, hips with the other sign, on the other side.
    #[test]
    fn a_mirrored_way_gives_mirrored_legs(parts in parts()) {
        let robot = &*QUADRUPED;
        let mut bases = [Base::new(robot, [0.0; 3]), Base::new(robot, [0.0; 3])];
        let mirrored = GaitConfig { is_right_first: true, ..GaitConfig::default() };
        let mut gaits = [GaitConfig::default(), mirrored]
            .map(|config| Gait::new(config, robot, &bases[0].pose(), 0.0).expect("a walking robot"));
        bases.iter_mut().for_each(|base| base.sway = 0.0);
        let other_side = |leg: usize| {
            let name = match robot.legs[leg].name.as_str() { "FL" => "FR", "FR" => "FL", "RL" => "RR", _ => "RL" };
            robot.legs.iter().position(|leg| leg.name == name).expect("a leg on the other side")
        };
        for (share, seconds) in parts {
            for _ in 0..(seconds / DT_S) as usize {
                let [forward, left, turn] = bases[0].wanted(share);
                gaits[0].step(DT_S, &bases[0].go([forward, left, turn])).expect("a finite step");
                gaits[1].step(DT_S, &bases[1].go([forward, -left, -turn])).expect("a finite step");
                for (index, leg) in robot.legs.iter().enumerate() {
                    let other = &robot.legs[other_side(index)];
                    for (k, sign) in [-1.0, 1.0, 1.0].into_iter().enumerate() {
                        let (a, b) = (gaits[0].angles()[leg.slots[k]], gaits[1].angles()[other.slots[k]]);
                        prop_assert!((a - sign * b).abs() < 1e-6, "{} {k}: {a} {b}", leg.name);
                    }
                }
            }
        }
    }

    #[test]
    fn the_place_in_the_world_does_not_matter(parts in parts(), x in -50.0..50.0f64, y in -50.0..50.0f64, yaw in -3.0..3.0f64) {
        let robot = &*QUADRUPED;
        let mut bases = [Base::new(robot, [0.0; 3]), Base::new(robot, [x, y, yaw])];
        let mut gaits = [0, 1].map(|k| Gait::new(GaitConfig::default(), robot, &bases[k].pose(), 0.0).expect("a walking robot"));
        for (share, seconds) in parts {
            let wanted = bases[0].wanted(share);
            for _ in 0..(seconds / DT_S) as usize {
                for k in 0..2 {
                    gaits[k].step(DT_S, &bases[k].go(wanted)).expect("a finite step");
                }
                let off = gaits[0].angles().iter().zip(gaits[1].angles()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                prop_assert!(off < 1e-6, "{off}");
            }
        }
    }

    /// Raibert's symmetry: a body that keeps its velocity has each foot exactly in its place in the middle of its stance.
    #[test]
    fn in_the_middle_of_a_stance_the_body_is_above_its_feet(share in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0]) {
        let robot = &*QUADRUPED;
        // Fifty steps of 5 ms in the air and as many on the floor, so that the middle is hit.
        let config = GaitConfig { stride_hz: 2.0, duty: 0.5, ..GaitConfig::default() };
        let mut base = Base::new(robot, [0.0; 3]);
        let mut gait = Gait::new(config, robot, &base.pose(), 0.0).expect("a walking robot");
        let wanted = base.wanted(within_ellipse(share));
        prop_assume!(wanted[0].hypot(wanted[1]) > 0.1);
        let mut stood_for = [0; 4];
        let mut checked = 0;
        for step in 0..800 {
            let motion = base.go(wanted);
            gait.step(DT_S, &motion).expect("a finite step");
            for (index, foot) in gait.feet().iter().enumerate() {
                stood_for[index] = if foot.is_standing { stood_for[index] + 1 } else { 0 };
                // The first step after touching down counts one.
                if step > 400 && stood_for[index] == 26 {
                    let neutral = robot.frames[&robot.legs[index].foot].translation.vector;
                    let level = Isometry3::from_parts(motion.world_from_body.translation, UnitQuaternion::from_euler_angles(0.0, 0.0, base.at[2]));
                    let off = (foot.in_world - level * Point3::from(neutral)).xy().norm();
                    prop_assert!(off < 1e-9, "{off} m off its place");
                    checked += 1;
                }
            }
        }
        prop_assert!(checked >= 12, "{checked}");
    }

    /// What no leg can follow is said, and harms nothing.
    #[test]
    fn a_base_that_asks_too_much_is_told(jumps in prop::collection::vec(([-3.0..3.0f64, -3.0..3.0, -1.0..1.0, -3.0..3.0], 1..60usize), 1..6)) {
        let robot = &*QUADRUPED;
        let start = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
        let mut gait = Gait::new(GaitConfig::default(), robot, &start, 0.0).expect("a walking robot");
        for ([x, y, z, turn], steps) in jumps {
            let world_from_body = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(turn, -turn, turn));
            let velocity = Vector2::new(10.0 * y, 10.0 * x);
            let base = BaseMotion { world_from_body, velocity_in_world_mps: velocity, yaw_rate_radps: 10.0 * turn, excess_velocity_in_world_mps: velocity };
            for _ in 0..steps {
                gait.step(DT_S, &base).expect("a finite step");
                check_limits(robot, gait.angles())?;
                let placed = feet_of(robot, &gait, &world_from_body);
                for (foot, placed) in gait.feet().iter().zip(placed) {
                    prop_assert!((foot.missed_by_m - (foot.in_world - placed).norm()).abs() < 1e-6, "what is missed is said");
                }
            }
        }
    }
}

/// Shares of the limits that together stay within one.
fn within_ellipse(share: [f64; 3]) -> [f64; 3] {
    let norm = share.iter().map(|v| v * v).sum::<f64>().sqrt().max(1.0);
    share.map(|v| v / norm)
}

#[test]
fn a_base_at_four_metres_a_second_outruns_its_legs() {
    let robot = &*QUADRUPED;
    let mut fast = robot.clone();
    fast.limits.max_speed_mps = 4.0;
    let mut base = Base::new(&fast, [0.0; 3]);
    let mut gait = Gait::new(GaitConfig::default(), robot, &base.pose(), 0.0).expect("a walking robot");
    let mut worst: f64 = 0.0;
    for _ in 0..600 {
        gait.step(DT_S, &base.go([4.0, 0.0, 0.0])).expect("a finite step");
        worst = worst.max(gait.missed_by_m());
    }
    assert!(worst > 0.1, "{worst}");
}

#[test]
fn a_foothold_is_half_a_stance_ahead() {
    // At 1 m/s with 0.2 s to the ground and 0.3 s of stance: 0.2 + 0.15 m ahead of the foot's place.
    let base = BaseMotion {
        world_from_body: Isometry3::translation(2.0, 1.0, 0.3),
        velocity_in_world_mps: Vector2::new(1.0, 0.0),
        yaw_rate_radps: 0.0,
        excess_velocity_in_world_mps: Vector2::new(0.5, 0.0),
    };
    let neutral = Point3::new(0.2, 0.1, -0.3);
    let at = foothold(&base, &neutral, 0.35, 0.0);
    assert!((at.coords - Vector2::new(2.55, 1.1)).norm() < 1e-12, "{at}");
    // Too fast by 0.5 m/s: farther ahead, to brake.
    let at = foothold(&base, &neutral, 0.35, 0.1);
    assert!((at.x - 2.60).abs() < 1e-12, "{at}");
    // A quarter turn on the spot takes the place from ahead to the left.
    let turning = BaseMotion {
        velocity_in_world_mps: Vector2::zeros(),
        excess_velocity_in_world_mps: Vector2::zeros(),
        yaw_rate_radps: std::f64::consts::FRAC_PI_2,
        ..base
    };
    let at = foothold(&turning, &neutral, 1.0, 0.1);
    assert!((at.coords - Vector2::new(1.9, 1.2)).norm() < 1e-12, "{at}");
}

#[test]
fn bad_input_is_refused_and_changes_nothing() {
    let robot = &*QUADRUPED;
    let start = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
    let refused = |config: GaitConfig| Gait::new(config, robot, &start, 0.0).expect_err("must be refused").to_string();
    let good = GaitConfig::default();
    assert!(refused(GaitConfig { duty: 0.3, ..good }).contains("`duty` must be at least 0.5"));
    assert!(refused(GaitConfig { stride_hz: f64::NAN, ..good }).contains("`stride_hz`"));
    assert!(refused(GaitConfig { stride_hz: 10.0, duty: 0.99, ..good }).contains("`duty` must be such that"));
    assert!(refused(GaitConfig { lift_m: -1.0, ..good }).contains("`lift_m`"));
    assert!(refused(GaitConfig { astray_m: f64::INFINITY, ..good }).contains("`astray_m`"));
    assert_eq!(Gait::new(good, robot, &start, f64::NAN).err(), Some(GaitError::NotFinite));
    let flyer = RobotModel::builtin_quadrotor();
    assert_eq!(Gait::new(good, &flyer, &start, 0.0).err(), Some(GaitError::NoLegs { robot: "omni_quadrotor".into() }));

    let mut gait = Gait::new(good, robot, &start, 0.0).expect("a walking robot");
    let before = gait.angles().to_vec();
    let velocity = Vector2::new(1.0, 0.0);
    let base = BaseMotion {
        world_from_body: start,
        velocity_in_world_mps: velocity,
        yaw_rate_radps: 0.0,
        excess_velocity_in_world_mps: velocity,
    };
    assert_eq!(gait.step(DT_S, &BaseMotion { yaw_rate_radps: f64::NAN, ..base }), Err(GaitError::NotFinite));
    assert_eq!(gait.step(0.1, &base), Err(GaitError::Step { dt_s: 0.1 }));
    assert_eq!(gait.step(0.0, &base), Err(GaitError::Step { dt_s: 0.0 }));
    assert_eq!(gait.angles(), before);
}

/// The closed form knows neither knees that point forwards nor a hip that turns about the vertical, and it is said rather than drawn wrong.
#[test]
fn legs_of_another_kind_are_refused_by_name() {
    let (urdf, toml) = quadruped_texts();
    let refused = |urdf: &str, toml: &str| {
        let robot = RobotModel::parse(urdf, toml, &|_| None).expect("a sound robot");
        let start = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
        match Gait::new(GaitConfig::default(), &robot, &start, 0.0) {
            Err(GaitError::OtherKindOfLeg { leg, off_m }) => (leg, off_m),
            other => panic!("{other:?}"),
        }
    };
    // The same foot with the knee before it.
    let two_ways = urdf.replace("upper=\"-0.83776\"", "upper=\"2.7\"");
    let knee_before = toml
        .replace("RL_thigh_joint = 0.86", "RL_thigh_joint = -0.45")
        .replace("RL_calf_joint = -1.65", "RL_calf_joint = 1.3");
    let (leg, off_m) = refused(&two_ways, &knee_before);
    assert!(leg == "RL" && (0.1..0.4).contains(&off_m), "{leg} {off_m}");
    let crooked = urdf.replacen("<axis xyz=\"1 0 0\"", "<axis xyz=\"0 0 1\"", 1);
    assert_ne!(crooked, urdf);
    let (leg, off_m) = refused(&crooked, &toml.replacen("_hip_joint = 0.0", "_hip_joint = 0.3", 1));
    assert!(leg == "FL" && off_m > 0.01, "{leg} {off_m}");
}

/// Feet that are wheels: nothing steps, and each wheel turns by the way over its radius.
#[test]
fn wheels_roll_and_do_not_step() {
    let (urdf, toml) = quadruped_texts();
    let (mut wheeled, mut wheels) = (String::new(), 0);
    for line in urdf.lines() {
        if line.contains("_foot_joint\"") && line.contains("type=\"fixed\"") {
            wheels += 1;
            wheeled += &line.replace("type=\"fixed\"", "type=\"continuous\"");
            // Two of them turn about an axis to the right, as a maker may write it.
            wheeled += if wheels % 2 == 0 { "<axis xyz=\"0 -1 0\"/>" } else { "<axis xyz=\"0 1 0\"/>" };
        } else {
            wheeled += line;
        }
        wheeled += "\n";
    }
    assert_eq!(wheels, 4);
    let robot = RobotModel::parse(&wheeled, toml, &|_| None).expect("a sound robot");
    assert_eq!(robot.tree.moving_joints().len(), 16);
    let mut base = Base::new(&robot, [0.0; 3]);
    let mut gait = Gait::new(GaitConfig::default(), &robot, &base.pose(), 0.0).expect("a rolling robot");
    while base.t_s < 3.0 {
        gait.step(DT_S, &base.go([0.8, 0.0, 0.0])).expect("a finite step");
        assert!(gait.feet().iter().all(|foot| foot.is_standing) && gait.missed_by_m() == 0.0);
    }
    let radius_m = robot.stance_height_m + robot.frames["FL_foot"].translation.z;
    let turned = base.at[0] / radius_m;
    for (slot, joint) in robot.tree.moving_joints().iter().enumerate() {
        let joint = &robot.tree.joints()[*joint];
        if joint.name.ends_with("_foot_joint") {
            let sign = joint.axis.y;
            assert!(
                (gait.angles()[slot] * sign - turned).abs() < 1e-9 * turned,
                "{}: {}",
                joint.name,
                gait.angles()[slot]
            );
        }
    }
}

fn data() -> Option<PathBuf> {
    let folders = ["/../../../shared/data/urdf", "/../../../../shared/data/urdf"];
    let found = folders.iter().map(|below| PathBuf::from(format!("{}{below}", env!("CARGO_MANIFEST_DIR"))));
    let found = found.into_iter().find(|folder| folder.is_dir());
    if found.is_none() {
        eprintln!("skipped: shared/data/urdf does not exist");
    }
    found
}

fn official(folder: &Path, file: &str) -> RobotModel {
    let path = folder.join(file);
    let urdf = std::fs::read_to_string(&path).expect("a URDF");
    let beside = path.parent().expect("a folder");
    let read_mesh = |mesh: &str| mesh_candidates(mesh, beside).iter().find_map(|found| std::fs::read(found).ok());
    let toml = robot_model::robot_name(&urdf).and_then(|name| builtin_toml(&name)).expect("a known robot");
    RobotModel::parse(&urdf, toml, &read_mesh).expect("a sound robot")
}

/// At every corner of what they are allowed to do the published robots keep every law, and their motors' speeds.
#[test]
fn published_robots_walk_at_full_speed() {
    let Some(folder) = data() else { return };
    for file in [
        "unitree_ros/go2_description/urdf/go2_description.urdf",
        "unitree_ros/go1_description/urdf/go1.urdf",
        "unitree_ros/a1_description/urdf/a1.urdf",
        "unitree_ros/b2_description/urdf/b2_description.urdf",
        "example-robot-data/robots/go2_description/urdf/go2.urdf",
    ] {
        let robot = official(&folder, file);
        let corners = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.7, 0.0, -0.7], [0.0; 3]];
        let parts: Vec<Part> = corners.iter().map(|share| (*share, 2.0)).collect();
        let fastest = walk(&robot, GaitConfig::default(), &parts).unwrap_or_else(|fault| panic!("{file}: {fault}"));
        eprintln!("{:20} fastest joint at {:.0} % of its limit", robot.name, 100.0 * fastest);
        assert!(fastest <= 1.0, "{file}: a joint at {fastest} of its speed limit");
    }
}
