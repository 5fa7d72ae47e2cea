//! The keys of a robot's TOML: as written, which of them are missing, which are out of range.

use crate::description::RobotKind;
use crate::error::ModelError;
use crate::tree::{JointKind, KinematicTree};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Every required key that is not there, in the order in which they are written in a TOML.
pub(crate) fn missing_keys(raw: &Raw, tree: &KinematicTree) -> Vec<String> {
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
        need(l.max_lateral_speed_mps.is_some(), "limits.max_lateral_speed_mps");
        need(l.max_reverse_speed_mps.is_some(), "limits.max_reverse_speed_mps");
    }
    need(l.max_yaw_rate_radps.is_some(), "limits.max_yaw_rate_radps");
    need(l.max_accel_mps2.is_some(), "limits.max_accel_mps2");
    need(l.max_yaw_accel_radps2.is_some(), "limits.max_yaw_accel_radps2");
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
        need(r.thrust_coefficient_n_s2.is_some(), "rotor.thrust_coefficient_n_s2");
        need(r.moment_ratio_m.is_some(), "rotor.moment_ratio_m");
        need(r.max_speed_radps.is_some(), "rotor.max_speed_radps");
        need(r.time_constant_up_s.is_some(), "rotor.time_constant_up_s");
        need(r.time_constant_down_s.is_some(), "rotor.time_constant_down_s");
        need(raw.drag.linear_n_s_per_m.is_some(), "drag.linear_n_s_per_m");
    }
    for (index, rotor) in raw.rotors.iter().enumerate() {
        need(rotor.link.is_some(), &format!("rotors[{index}].link"));
        need(rotor.direction.is_some(), &format!("rotors[{index}].direction"));
        let link = rotor.link.as_deref().and_then(|link| tree.link_named(link));
        let has_shape = link.is_some_and(|link| !tree.links()[link].shapes.is_empty());
        need(rotor.radius_m.is_some() || has_shape || link.is_none(), &format!("rotors[{index}].radius_m"));
    }
    keys
}

/// Names of the joints whose stance angle matters: those with limits.
fn stance_joints(tree: &KinematicTree) -> impl Iterator<Item = &str> {
    let moving = tree.moving_joints().iter().map(|joint| &tree.joints()[*joint]);
    moving.filter(|joint| joint.kind != JointKind::Continuous).map(|joint| joint.name.as_str())
}

/// Without a `kind` the list of missing keys is written for what the robot looks like: something with legs walks.
pub(crate) fn likely_kind(tree: &KinematicTree) -> RobotKind {
    if stance_joints(tree).next().is_some() { RobotKind::Ground } else { RobotKind::Aerial }
}

pub(crate) fn check_values(raw: &Raw) -> Result<(), ModelError> {
    let l = &raw.limits;
    let positive = [
        ("limits.max_speed_mps", l.max_speed_mps),
        ("limits.max_yaw_rate_radps", l.max_yaw_rate_radps),
        ("limits.max_accel_mps2", l.max_accel_mps2),
        ("limits.max_yaw_accel_radps2", l.max_yaw_accel_radps2),
        ("limits.max_climb_mps", l.max_climb_mps),
        ("rotor.thrust_coefficient_n_s2", raw.rotor.thrust_coefficient_n_s2),
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
    let out = |key: &str, expected| Err(ModelError::OutOfRange { key: key.to_owned(), expected });
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
            return out(key, if end == PI { "an angle in [0, pi)" } else { "an angle in [0, pi/2)" });
        }
    }
    if raw.drag.linear_n_s_per_m.is_some_and(|drag| drag.iter().any(|v| !(v.is_finite() && *v >= 0.0))) {
        return out("drag.linear_n_s_per_m", "three numbers, zero or positive");
    }
    if !raw.sensors.lidar.sensor_offset_m.iter().all(|v| v.is_finite()) {
        return out("sensors.lidar.sensor_offset_m", "three finite numbers");
    }
    Ok(())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Raw {
    pub kind: Option<RobotKind>,
    #[serde(default)]
    pub limits: RawLimits,
    #[serde(default)]
    pub stance: BTreeMap<String, f64>,
    #[serde(default)]
    pub sensors: RawSensors,
    #[serde(default)]
    pub rotor: RawRotor,
    #[serde(default)]
    pub rotors: Vec<RawRotorEntry>,
    #[serde(default)]
    pub drag: RawDrag,
    #[serde(default)]
    pub legs: Vec<RawLeg>,
    #[serde(default)]
    pub payload: Vec<RawPayload>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLimits {
    pub max_speed_mps: Option<f64>,
    pub max_lateral_speed_mps: Option<f64>,
    pub max_reverse_speed_mps: Option<f64>,
    pub max_yaw_rate_radps: Option<f64>,
    pub max_accel_mps2: Option<f64>,
    pub max_yaw_accel_radps2: Option<f64>,
    pub max_climb_mps: Option<f64>,
    pub max_tilt_rad: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawSensors {
    #[serde(default)]
    pub lidar: RawLidar,
    #[serde(default)]
    pub imu: RawMount,
    #[serde(default)]
    pub camera: RawMount,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLidar {
    pub link: Option<String>,
    #[serde(default)]
    pub xyz_m: [f64; 3],
    #[serde(default)]
    pub rpy_rad: [f64; 3],
    pub rotation_hz: Option<f64>,
    pub tilt_rad: Option<f64>,
    #[serde(default)]
    pub sensor_offset_m: [f64; 3],
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawMount {
    pub link: Option<String>,
    #[serde(default)]
    pub xyz_m: [f64; 3],
    #[serde(default)]
    pub rpy_rad: [f64; 3],
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRotor {
    pub thrust_coefficient_n_s2: Option<f64>,
    pub moment_ratio_m: Option<f64>,
    pub max_speed_radps: Option<f64>,
    pub time_constant_up_s: Option<f64>,
    pub time_constant_down_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRotorEntry {
    pub link: Option<String>,
    pub direction: Option<Spin>,
    pub radius_m: Option<f64>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Spin {
    Ccw,
    Cw,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawDrag {
    pub linear_n_s_per_m: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLeg {
    pub name: String,
    pub joints: [String; 3],
    pub foot: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPayload {
    pub name: String,
    pub link: String,
    #[serde(default)]
    pub xyz_m: [f64; 3],
    #[serde(default)]
    pub rpy_rad: [f64; 3],
    pub shape: RawShape,
    #[serde(default)]
    pub mass_kg: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum RawShape {
    Box { box_m: [f64; 3] },
    Cylinder { radius_m: f64, length_m: f64 },
    Sphere { radius_m: f64 },
}
