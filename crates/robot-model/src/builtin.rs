//! Robots that ship with the crate, and TOMLs for robots whose URDFs others publish.

use crate::model::RobotModel;

const QUADRUPED_URDF: &str = include_str!("../models/quadruped.urdf");
const QUADRUPED_TOML: &str = include_str!("../models/quadruped.toml");
const QUADROTOR_URDF: &str = include_str!("../models/quadrotor.urdf");
const QUADROTOR_TOML: &str = include_str!("../models/quadrotor.toml");

/// TOML by the name that the URDF gives its robot. Several names for one robot: files of different origin.
const TOMLS: [(&str, &str); 12] = [
    ("omni_quadruped", QUADRUPED_TOML),
    ("omni_quadrotor", QUADROTOR_TOML),
    ("go2_description", include_str!("../models/go2.toml")),
    ("go2", include_str!("../models/go2.toml")),
    ("go2w_description", include_str!("../models/go2w.toml")),
    ("go1", include_str!("../models/go1.toml")),
    ("go1_description", include_str!("../models/go1.toml")),
    ("a1", include_str!("../models/a1.toml")),
    ("a1_description", include_str!("../models/a1.toml")),
    ("b2_description", include_str!("../models/b2.toml")),
    ("x500", include_str!("../models/x500.toml")),
    ("iris", include_str!("../models/iris.toml")),
];

/// The TOML that ships for the robot with this name in its URDF, if there is one. A TOML beside the user's URDF should win over it.
pub fn builtin_toml(name: &str) -> Option<&'static str> {
    TOMLS.iter().find(|(known, _)| *known == name).map(|(_, toml)| *toml)
}

/// URDF and TOML of the quadruped that ships with the crate.
pub fn quadruped_texts() -> (&'static str, &'static str) {
    (QUADRUPED_URDF, QUADRUPED_TOML)
}

/// URDF and TOML of the quadrotor that ships with the crate.
pub fn quadrotor_texts() -> (&'static str, &'static str) {
    (QUADROTOR_URDF, QUADROTOR_TOML)
}

impl RobotModel {
    /// A quadruped of about 15 kg with the published dimensions of the Unitree Go2 and a sensor mast.
    pub fn builtin_quadruped() -> RobotModel {
        RobotModel::parse(QUADRUPED_URDF, QUADRUPED_TOML, &|_| None)
            .expect("the shipped quadruped is sound: a test parses it")
    }

    /// A quadrotor of about 2 kg with the published dimensions of the Holybro x500, a LiDAR and a camera.
    pub fn builtin_quadrotor() -> RobotModel {
        RobotModel::parse(QUADROTOR_URDF, QUADROTOR_TOML, &|_| None)
            .expect("the shipped quadrotor is sound: a test parses it")
    }
}
