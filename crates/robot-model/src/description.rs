//! The TOML beside a URDF: what a URDF cannot carry.
//!
//! Limits of motion, stance angles, sensor mounts, rotor constants and drag. Every value that has no safe default is required;
//! all that are missing are reported in one sentence. Keys that do not belong there are refused, so a typing error cannot pass
//! as "not given".

use crate::error::ModelError;
use crate::shape::Geometry;
use crate::tree::{JointKind, KinematicTree};
use crate::urdf::pose;
use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Whether a robot walks or flies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RobotKind {
    /// Moves on the floor.
    Ground,
    /// Flies.
    Aerial,
}

/// How fast the robot may move. What a kind of robot does not use is 0 (ground: climb and tilt) or `max_speed_mps` (air: lateral and
/// reverse).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    /// Forward speed; in the air the horizontal speed.
    pub max_speed_mps: f64,
    /// Sideways speed.
    pub max_lateral_speed_mps: f64,
    /// Backward speed.
    pub max_reverse_speed_mps: f64,
    /// Turning speed about the vertical.
    pub max_yaw_rate_radps: f64,
    /// Horizontal acceleration.
    pub max_accel_mps2: f64,
    /// Turning acceleration about the vertical.
    pub max_yaw_accel_radps2: f64,
    /// Climbing and sinking speed.
    pub max_climb_mps: f64,
    /// Angle between the thrust and the vertical.
    pub max_tilt_rad: f64,
}

/// A pose relative to a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mount {
    pub link: usize,
    pub link_from_mount: Isometry3<f64>,
}

/// Constants of one rotor, and the link that carries it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RotorEntry {
    pub link: usize,
    pub direction: f64,
    pub radius_m: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RotorConstants {
    pub thrust_coefficient_n_s2: f64,
    pub moment_ratio_m: f64,
    pub max_speed_radps: f64,
    pub time_constant_up_s: f64,
    pub time_constant_down_s: f64,
}

pub(crate) struct LegEntry {
    pub name: String,
    /// Slots in the list of moving joints: hip, thigh, calf.
    pub slots: [usize; 3],
    pub foot: usize,
}

pub(crate) struct PayloadEntry {
    pub name: String,
    pub mount: Mount,
    pub geometry: Geometry,
    pub mass_kg: f64,
}

/// The TOML with every name resolved against the tree and every value checked.
pub(crate) struct Description {
    pub kind: RobotKind,
    pub limits: MotionLimits,
    pub stance: Vec<f64>,
    pub lidar: Mount,
    pub rotation_hz: f64,
    pub tilt_rad: f64,
    pub sensor_offset_m: [f64; 3],
    pub imu: Mount,
    pub camera: Mount,
    pub rotors: Vec<RotorEntry>,
    pub rotor: Option<RotorConstants>,
    pub drag: Vector3<f64>,
    pub legs: Vec<LegEntry>,
    pub payload: Vec<PayloadEntry>,
}

/// Reads and checks the TOML of the robot `robot`.
pub(crate) fn read(
    text: &str,
    robot: &str,
    tree: &KinematicTree,
) -> Result<Description, ModelError> {
    let raw: Raw = toml::from_str(text).map_err(|error| {
        let before = error
            .span()
            .map_or("", |span| text.get(..span.start).unwrap_or(""));
        ModelError::Toml {
            line: before.matches('\n').count() + 1,
            detail: error.message().to_owned(),
        }
    })?;
    let keys = missing_keys(&raw, tree);
    if !keys.is_empty() {
        return Err(ModelError::MissingKeys {
            robot: robot.to_owned(),
            keys,
        });
    }
    check_values(&raw)?;
    let kind = raw.kind.unwrap_or_else(|| likely_kind(tree));
    let (lidar, imu, camera) = (raw.sensors.lidar, raw.sensors.imu, raw.sensors.camera);
    Ok(Description {
        kind,
        limits: limits(&raw.limits, kind),
        stance: stance(&raw.stance, tree)?,
        lidar: mount(
            "sensors.lidar.link",
            &lidar.link,
            lidar.xyz_m,
            lidar.rpy_rad,
            tree,
        )?,
        rotation_hz: lidar.rotation_hz.unwrap_or(0.0),
        tilt_rad: lidar.tilt_rad.unwrap_or(0.0),
        sensor_offset_m: lidar.sensor_offset_m,
        imu: mount("sensors.imu.link", &imu.link, imu.xyz_m, imu.rpy_rad, tree)?,
        camera: mount(
            "sensors.camera.link",
            &camera.link,
            camera.xyz_m,
            camera.rpy_rad,
            tree,
        )?,
        rotors: rotors(&raw.rotors, tree)?,
        rotor: rotor_constants(&raw.rotor),
        drag: raw
            .drag
            .linear_n_s_per_m
            .map_or(Vector3::zeros(), Vector3::from),
        legs: legs(&raw.legs, tree)?,
        payload: payload(&raw.payload, tree)?,
    })
}

/// Every required key that is not there, in the order in which they are written in a TOML.
fn missing_keys(raw: &Raw, tree: &KinematicTree) -> Vec<String> {
    let kind = raw.kind.unwrap_or_else(|| likely_kind(tree));
    let mut keys = Vec::new();
    let mut need = |is_there: bool, key: &str| {
        if !is_there {
            keys.push(key.to_owned());
        }
    };
    need(raw.kind.is_some(), "kind");
    let l = &raw.limits;
    need(l.max_speed_mps.is_some(), "limits.max_speed_mps");
    if kind == RobotKind::Ground {
        need(
            l.max_lateral_speed_mps.is_some(),
            "limits.max_lateral_speed_mps",
        );
        need(
            l.max_reverse_speed_mps.is_some(),
            "limits.max_reverse_speed_mps",
        );
    }
    need(l.max_yaw_rate_radps.is_some(), "limits.max_yaw_rate_radps");
    need(l.max_accel_mps2.is_some(), "limits.max_accel_mps2");
    need(
        l.max_yaw_accel_radps2.is_some(),
        "limits.max_yaw_accel_radps2",
    );
    if kind == RobotKind::Aerial {
        need(l.max_climb_mps.is_some(), "limits.max_climb_mps");
        need(l.max_tilt_rad.is_some(), "limits.max_tilt_rad");
    }
    for joint in stance_joints(tree) {
        need(raw.stance.contains_key(joint), &format!("stance.{joint}"));
    }
    let s = &raw.sensors;
    need(s.lidar.link.is_some(), "sensors.lidar.link");
    need(s.lidar.rotation_hz.is_some(), "sensors.lidar.rotation_hz");
    need(s.lidar.tilt_rad.is_some(), "sensors.lidar.tilt_rad");
    need(s.imu.link.is_some(), "sensors.imu.link");
    need(s.camera.link.is_some(), "sensors.camera.link");
    if kind == RobotKind::Aerial {
        need(!raw.rotors.is_empty(), "rotors");
        let r = &raw.rotor;
        need(
            r.thrust_coefficient_n_s2.is_some(),
            "rotor.thrust_coefficient_n_s2",
        );
        need(r.moment_ratio_m.is_some(), "rotor.moment_ratio_m");
        need(r.max_speed_radps.is_some(), "rotor.max_speed_radps");
        need(r.time_constant_up_s.is_some(), "rotor.time_constant_up_s");
        need(
            r.time_constant_down_s.is_some(),
            "rotor.time_constant_down_s",
        );
        need(raw.drag.linear_n_s_per_m.is_some(), "drag.linear_n_s_per_m");
    }
    for (index, rotor) in raw.rotors.iter().enumerate() {
        need(rotor.link.is_some(), &format!("rotors[{index}].link"));
        need(
            rotor.direction.is_some(),
            &format!("rotors[{index}].direction"),
        );
        let link = rotor.link.as_deref().and_then(|link| tree.link_named(link));
        let has_shape = link.is_some_and(|link| !tree.links()[link].shapes.is_empty());
        need(
            rotor.radius_m.is_some() || has_shape || link.is_none(),
            &format!("rotors[{index}].radius_m"),
        );
    }
    keys
}

/// Names of the joints whose stance angle matters: those with limits.
fn stance_joints(tree: &KinematicTree) -> impl Iterator<Item = &str> {
    let moving = tree
        .moving_joints()
        .iter()
        .map(|joint| &tree.joints()[*joint]);
    moving
        .filter(|joint| joint.kind != JointKind::Continuous)
        .map(|joint| joint.name.as_str())
}

/// Without a `kind` the list of missing keys is written for what the robot looks like: something with legs walks.
fn likely_kind(tree: &KinematicTree) -> RobotKind {
    if stance_joints(tree).next().is_some() {
        RobotKind::Ground
    } else {
        RobotKind::Aerial
    }
}

fn check_values(raw: &Raw) -> Result<(), ModelError> {
    let l = &raw.limits;
    let positive = [
        ("limits.max_speed_mps", l.max_speed_mps),
        ("limits.max_yaw_rate_radps", l.max_yaw_rate_radps),
        ("limits.max_accel_mps2", l.max_accel_mps2),
        ("limits.max_yaw_accel_radps2", l.max_yaw_accel_radps2),
        ("limits.max_climb_mps", l.max_climb_mps),
        (
            "rotor.thrust_coefficient_n_s2",
            raw.rotor.thrust_coefficient_n_s2,
        ),
        ("rotor.max_speed_radps", raw.rotor.max_speed_radps),
    ];
    let not_negative = [
        ("limits.max_lateral_speed_mps", l.max_lateral_speed_mps),
        ("limits.max_reverse_speed_mps", l.max_reverse_speed_mps),
        ("sensors.lidar.rotation_hz", raw.sensors.lidar.rotation_hz),
        ("rotor.moment_ratio_m", raw.rotor.moment_ratio_m),
        ("rotor.time_constant_up_s", raw.rotor.time_constant_up_s),
        ("rotor.time_constant_down_s", raw.rotor.time_constant_down_s),
    ];
    let angle = [
        ("limits.max_tilt_rad", l.max_tilt_rad, FRAC_PI_2),
        ("sensors.lidar.tilt_rad", raw.sensors.lidar.tilt_rad, PI),
    ];
    let out = |key: &str, expected| {
        Err(ModelError::OutOfRange {
            key: key.to_owned(),
            expected,
        })
    };
    for (key, value) in positive {
        if value.is_some_and(|v| !(v.is_finite() && v > 0.0)) {
            return out(key, "a positive number");
        }
    }
    for (key, value) in not_negative {
        if value.is_some_and(|v| !(v.is_finite() && v >= 0.0)) {
            return out(key, "zero or a positive number");
        }
    }
    for (key, value, end) in angle {
        if value.is_some_and(|v| !(0.0..end).contains(&v)) {
            return out(
                key,
                if end == PI {
                    "an angle in [0, pi)"
                } else {
                    "an angle in [0, pi/2)"
                },
            );
        }
    }
    if raw
        .drag
        .linear_n_s_per_m
        .is_some_and(|drag| drag.iter().any(|v| !(v.is_finite() && *v >= 0.0)))
    {
        return out("drag.linear_n_s_per_m", "three numbers, zero or positive");
    }
    if !raw
        .sensors
        .lidar
        .sensor_offset_m
        .iter()
        .all(|v| v.is_finite())
    {
        return out("sensors.lidar.sensor_offset_m", "three finite numbers");
    }
    Ok(())
}

fn limits(raw: &RawLimits, kind: RobotKind) -> MotionLimits {
    let is_aerial = kind == RobotKind::Aerial;
    let max_speed_mps = raw.max_speed_mps.unwrap_or(0.0);
    let all_round = if is_aerial { max_speed_mps } else { 0.0 };
    MotionLimits {
        max_speed_mps,
        max_lateral_speed_mps: raw.max_lateral_speed_mps.unwrap_or(all_round),
        max_reverse_speed_mps: raw.max_reverse_speed_mps.unwrap_or(all_round),
        max_yaw_rate_radps: raw.max_yaw_rate_radps.unwrap_or(0.0),
        max_accel_mps2: raw.max_accel_mps2.unwrap_or(0.0),
        max_yaw_accel_radps2: raw.max_yaw_accel_radps2.unwrap_or(0.0),
        max_climb_mps: if is_aerial {
            raw.max_climb_mps.unwrap_or(0.0)
        } else {
            0.0
        },
        max_tilt_rad: if is_aerial {
            raw.max_tilt_rad.unwrap_or(0.0)
        } else {
            0.0
        },
    }
}

fn stance(raw: &BTreeMap<String, f64>, tree: &KinematicTree) -> Result<Vec<f64>, ModelError> {
    let mut angles = vec![0.0; tree.moving_joints().len()];
    for (name, &angle) in raw {
        let slot = moving_slot(&format!("stance.{name}"), name, tree)?;
        let joint = &tree.joints()[tree.moving_joints()[slot]];
        let (lower, upper) = (
            joint.lower.unwrap_or(f64::NEG_INFINITY),
            joint.upper.unwrap_or(f64::INFINITY),
        );
        if !angle.is_finite() {
            return Err(ModelError::OutOfRange {
                key: format!("stance.{name}"),
                expected: "a finite number",
            });
        }
        if !(lower..=upper).contains(&angle) {
            return Err(ModelError::StanceOutsideLimits {
                joint: name.clone(),
                angle,
                lower,
                upper,
            });
        }
        angles[slot] = angle;
    }
    Ok(angles)
}

fn mount(
    key: &str,
    link: &Option<String>,
    xyz_m: [f64; 3],
    rpy_rad: [f64; 3],
    tree: &KinematicTree,
) -> Result<Mount, ModelError> {
    if !xyz_m.iter().chain(&rpy_rad).all(|v| v.is_finite()) {
        let key = key.replace(".link", ".xyz_m or .rpy_rad");
        return Err(ModelError::OutOfRange {
            key,
            expected: "three finite numbers",
        });
    }
    Ok(Mount {
        link: frame(key, link.as_deref().unwrap_or(""), tree)?,
        link_from_mount: pose(xyz_m, rpy_rad),
    })
}

fn frame(key: &str, link: &str, tree: &KinematicTree) -> Result<usize, ModelError> {
    tree.link_named(link)
        .ok_or_else(|| ModelError::UnknownFrame {
            key: key.to_owned(),
            link: link.to_owned(),
        })
}

fn moving_slot(key: &str, joint: &str, tree: &KinematicTree) -> Result<usize, ModelError> {
    let slot = tree
        .moving_joints()
        .iter()
        .position(|index| tree.joints()[*index].name == joint);
    slot.ok_or_else(|| ModelError::UnknownJoint {
        key: key.to_owned(),
        joint: joint.to_owned(),
    })
}

fn rotors(raw: &[RawRotorEntry], tree: &KinematicTree) -> Result<Vec<RotorEntry>, ModelError> {
    let read = |(index, rotor): (usize, &RawRotorEntry)| {
        let link = frame(
            &format!("rotors[{index}].link"),
            rotor.link.as_deref().unwrap_or(""),
            tree,
        )?;
        let swept = crate::envelope::swept_radius(tree, link).unwrap_or(0.0);
        let radius_m = rotor.radius_m.unwrap_or(swept);
        if !(radius_m.is_finite() && radius_m > 0.0) {
            return Err(ModelError::OutOfRange {
                key: format!("rotors[{index}].radius_m"),
                expected: "a positive number",
            });
        }
        let direction = match rotor.direction {
            Some(Spin::Cw) => -1.0,
            _ => 1.0,
        };
        Ok(RotorEntry {
            link,
            direction,
            radius_m,
        })
    };
    raw.iter().enumerate().map(read).collect()
}

fn rotor_constants(raw: &RawRotor) -> Option<RotorConstants> {
    Some(RotorConstants {
        thrust_coefficient_n_s2: raw.thrust_coefficient_n_s2?,
        moment_ratio_m: raw.moment_ratio_m?,
        max_speed_radps: raw.max_speed_radps?,
        time_constant_up_s: raw.time_constant_up_s?,
        time_constant_down_s: raw.time_constant_down_s?,
    })
}

fn legs(raw: &[RawLeg], tree: &KinematicTree) -> Result<Vec<LegEntry>, ModelError> {
    let read = |(index, leg): (usize, &RawLeg)| {
        let key = format!("legs[{index}].joints");
        let [hip, thigh, calf] = &leg.joints;
        Ok(LegEntry {
            name: leg.name.clone(),
            slots: [
                moving_slot(&key, hip, tree)?,
                moving_slot(&key, thigh, tree)?,
                moving_slot(&key, calf, tree)?,
            ],
            foot: frame(&format!("legs[{index}].foot"), &leg.foot, tree)?,
        })
    };
    raw.iter().enumerate().map(read).collect()
}

fn payload(raw: &[RawPayload], tree: &KinematicTree) -> Result<Vec<PayloadEntry>, ModelError> {
    let read = |(index, entry): (usize, &RawPayload)| {
        let key = format!("payload[{index}].link");
        let sizes: &[f64] = match &entry.shape {
            RawShape::Box { box_m } => box_m,
            RawShape::Cylinder { radius_m, length_m } => &[*radius_m, *length_m],
            RawShape::Sphere { radius_m } => &[*radius_m],
        };
        if !sizes.iter().all(|size| size.is_finite() && *size > 0.0) {
            return Err(ModelError::OutOfRange {
                key: format!("payload[{index}].shape"),
                expected: "given by positive numbers",
            });
        }
        if !(entry.mass_kg.is_finite() && entry.mass_kg >= 0.0) {
            return Err(ModelError::OutOfRange {
                key: format!("payload[{index}].mass_kg"),
                expected: "zero or a positive number",
            });
        }
        let geometry = match &entry.shape {
            RawShape::Box { box_m } => Geometry::Box {
                half: Vector3::from(*box_m) / 2.0,
            },
            RawShape::Cylinder { radius_m, length_m } => Geometry::Cylinder {
                radius: *radius_m,
                half_length: length_m / 2.0,
            },
            RawShape::Sphere { radius_m } => Geometry::Sphere { radius: *radius_m },
        };
        let mount = mount(
            &key,
            &Some(entry.link.clone()),
            entry.xyz_m,
            entry.rpy_rad,
            tree,
        )?;
        Ok(PayloadEntry {
            name: entry.name.clone(),
            mount,
            geometry,
            mass_kg: entry.mass_kg,
        })
    };
    raw.iter().enumerate().map(read).collect()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    kind: Option<RobotKind>,
    #[serde(default)]
    limits: RawLimits,
    #[serde(default)]
    stance: BTreeMap<String, f64>,
    #[serde(default)]
    sensors: RawSensors,
    #[serde(default)]
    rotor: RawRotor,
    #[serde(default)]
    rotors: Vec<RawRotorEntry>,
    #[serde(default)]
    drag: RawDrag,
    #[serde(default)]
    legs: Vec<RawLeg>,
    #[serde(default)]
    payload: Vec<RawPayload>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawLimits {
    max_speed_mps: Option<f64>,
    max_lateral_speed_mps: Option<f64>,
    max_reverse_speed_mps: Option<f64>,
    max_yaw_rate_radps: Option<f64>,
    max_accel_mps2: Option<f64>,
    max_yaw_accel_radps2: Option<f64>,
    max_climb_mps: Option<f64>,
    max_tilt_rad: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawSensors {
    #[serde(default)]
    lidar: RawLidar,
    #[serde(default)]
    imu: RawMount,
    #[serde(default)]
    camera: RawMount,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawLidar {
    link: Option<String>,
    #[serde(default)]
    xyz_m: [f64; 3],
    #[serde(default)]
    rpy_rad: [f64; 3],
    rotation_hz: Option<f64>,
    tilt_rad: Option<f64>,
    #[serde(default)]
    sensor_offset_m: [f64; 3],
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawMount {
    link: Option<String>,
    #[serde(default)]
    xyz_m: [f64; 3],
    #[serde(default)]
    rpy_rad: [f64; 3],
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawRotor {
    thrust_coefficient_n_s2: Option<f64>,
    moment_ratio_m: Option<f64>,
    max_speed_radps: Option<f64>,
    time_constant_up_s: Option<f64>,
    time_constant_down_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRotorEntry {
    link: Option<String>,
    direction: Option<Spin>,
    radius_m: Option<f64>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum Spin {
    Ccw,
    Cw,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawDrag {
    linear_n_s_per_m: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLeg {
    name: String,
    joints: [String; 3],
    foot: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPayload {
    name: String,
    link: String,
    #[serde(default)]
    xyz_m: [f64; 3],
    #[serde(default)]
    rpy_rad: [f64; 3],
    shape: RawShape,
    #[serde(default)]
    mass_kg: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
enum RawShape {
    Box { box_m: [f64; 3] },
    Cylinder { radius_m: f64, length_m: f64 },
    Sphere { radius_m: f64 },
}
