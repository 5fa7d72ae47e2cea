//! The TOML beside a URDF: what a URDF cannot carry.
//!
//! Limits of motion, stance angles, sensor mounts, rotor constants and drag. Every value that has no safe default is required;
//! all that are missing are reported in one sentence. Keys that do not belong there are refused, so a typing error cannot pass
//! as "not given".

use crate::error::ModelError;
use crate::keys::{
    Raw, RawLeg, RawLimits, RawPayload, RawRotor, RawRotorEntry, RawShape, Spin, check_values, likely_kind,
    missing_keys,
};
use crate::shape::Geometry;
use crate::tree::KinematicTree;
use crate::urdf::pose;
use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;

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
pub(crate) fn read(text: &str, robot: &str, tree: &KinematicTree) -> Result<Description, ModelError> {
    let raw: Raw = toml::from_str(text).map_err(|error| {
        let before = error.span().map_or("", |span| text.get(..span.start).unwrap_or(""));
        ModelError::Toml { line: before.matches('\n').count() + 1, detail: error.message().to_owned() }
    })?;
    let keys = missing_keys(&raw, tree);
    if !keys.is_empty() {
        return Err(ModelError::MissingKeys { robot: robot.to_owned(), keys });
    }
    check_values(&raw)?;
    let kind = raw.kind.unwrap_or_else(|| likely_kind(tree));
    let (lidar, imu, camera) = (raw.sensors.lidar, raw.sensors.imu, raw.sensors.camera);
    Ok(Description {
        kind,
        limits: limits(&raw.limits, kind),
        stance: stance(&raw.stance, tree)?,
        lidar: mount("sensors.lidar.link", &lidar.link, lidar.xyz_m, lidar.rpy_rad, tree)?,
        rotation_hz: lidar.rotation_hz.unwrap_or(0.0),
        tilt_rad: lidar.tilt_rad.unwrap_or(0.0),
        sensor_offset_m: lidar.sensor_offset_m,
        imu: mount("sensors.imu.link", &imu.link, imu.xyz_m, imu.rpy_rad, tree)?,
        camera: mount("sensors.camera.link", &camera.link, camera.xyz_m, camera.rpy_rad, tree)?,
        rotors: rotors(&raw.rotors, tree)?,
        rotor: rotor_constants(&raw.rotor),
        drag: raw.drag.linear_n_s_per_m.map_or(Vector3::zeros(), Vector3::from),
        legs: legs(&raw.legs, tree)?,
        payload: payload(&raw.payload, tree)?,
    })
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
        max_climb_mps: if is_aerial { raw.max_climb_mps.unwrap_or(0.0) } else { 0.0 },
        max_tilt_rad: if is_aerial { raw.max_tilt_rad.unwrap_or(0.0) } else { 0.0 },
    }
}

fn stance(raw: &BTreeMap<String, f64>, tree: &KinematicTree) -> Result<Vec<f64>, ModelError> {
    let mut angles = vec![0.0; tree.moving_joints().len()];
    for (name, &angle) in raw {
        let slot = moving_slot(&format!("stance.{name}"), name, tree)?;
        let joint = &tree.joints()[tree.moving_joints()[slot]];
        let (lower, upper) = (joint.lower.unwrap_or(f64::NEG_INFINITY), joint.upper.unwrap_or(f64::INFINITY));
        if !angle.is_finite() {
            return Err(ModelError::OutOfRange { key: format!("stance.{name}"), expected: "a finite number" });
        }
        if !(lower..=upper).contains(&angle) {
            return Err(ModelError::StanceOutsideLimits { joint: name.clone(), angle, lower, upper });
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
        return Err(ModelError::OutOfRange { key, expected: "three finite numbers" });
    }
    Ok(Mount { link: frame(key, link.as_deref().unwrap_or(""), tree)?, link_from_mount: pose(xyz_m, rpy_rad) })
}

fn frame(key: &str, link: &str, tree: &KinematicTree) -> Result<usize, ModelError> {
    tree.link_named(link).ok_or_else(|| ModelError::UnknownFrame { key: key.to_owned(), link: link.to_owned() })
}

fn moving_slot(key: &str, joint: &str, tree: &KinematicTree) -> Result<usize, ModelError> {
    let slot = tree.moving_joints().iter().position(|index| tree.joints()[*index].name == joint);
    slot.ok_or_else(|| ModelError::UnknownJoint { key: key.to_owned(), joint: joint.to_owned() })
}

fn rotors(raw: &[RawRotorEntry], tree: &KinematicTree) -> Result<Vec<RotorEntry>, ModelError> {
    let read = |(index, rotor): (usize, &RawRotorEntry)| {
        let link = frame(&format!("rotors[{index}].link"), rotor.link.as_deref().unwrap_or(""), tree)?;
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
        Ok(RotorEntry { link, direction, radius_m })
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
            slots: [moving_slot(&key, hip, tree)?, moving_slot(&key, thigh, tree)?, moving_slot(&key, calf, tree)?],
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
            RawShape::Box { box_m } => Geometry::Box { half: Vector3::from(*box_m) / 2.0 },
            RawShape::Cylinder { radius_m, length_m } => {
                Geometry::Cylinder { radius: *radius_m, half_length: length_m / 2.0 }
            }
            RawShape::Sphere { radius_m } => Geometry::Sphere { radius: *radius_m },
        };
        let mount = mount(&key, &Some(entry.link.clone()), entry.xyz_m, entry.rpy_rad, tree)?;
        Ok(PayloadEntry { name: entry.name.clone(), mount, geometry, mass_kg: entry.mass_kg })
    };
    raw.iter().enumerate().map(read).collect()
}
