//! What the two robots that ship with the crate promise to the rest of the project.

use nalgebra::Vector3;
use robot_model::{Geometry, ModelError, RobotKind, RobotModel, builtin_toml, quadrotor_texts, quadruped_texts};
use std::collections::BTreeMap;

#[test]
fn the_quadruped_has_the_published_dimensions() {
    let robot = RobotModel::builtin_quadruped();
    assert_eq!((robot.name.as_str(), robot.kind), ("omni_quadruped", RobotKind::Ground));
    assert_eq!(robot.tree.moving_joints().len(), 12);
    assert_eq!(robot.legs.len(), 4);
    assert!((14.5..16.0).contains(&robot.mass_kg), "{} kg", robot.mass_kg);
    assert!((robot.stance_height_m - 0.31).abs() < 0.005, "{} m", robot.stance_height_m);
    let lidar = robot.sensors.body_from_sensor(0.0).translation;
    assert!((lidar.z - 0.30).abs() < 1e-9 && (robot.sensors.body_from_camera.translation.z - 0.42).abs() < 1e-9);
    assert!(robot.height_span_m.1 >= 0.42, "the mast counts for the height");
    assert!(robot.circumscribed_radius_m < 0.42 && robot.inscribed_radius_m > 0.15);
    // Symmetric about the vertical plane of travel, and standing over its feet.
    assert!(robot.center_of_mass.y.abs() < 1e-12 && robot.inertia[(0, 1)].abs() < 1e-12);
    let feet: Vec<f64> = ["FL_foot", "RL_foot"].iter().map(|foot| robot.frames[*foot].translation.x).collect();
    assert!(feet[0] > robot.center_of_mass.x && robot.center_of_mass.x > feet[1]);
}

#[test]
fn the_quadrotor_has_the_published_dimensions() {
    let robot = RobotModel::builtin_quadrotor();
    assert_eq!((robot.name.as_str(), robot.kind), ("omni_quadrotor", RobotKind::Aerial));
    assert!((robot.mass_kg - 2.06).abs() < 0.03, "{} kg", robot.mass_kg);
    assert!((1.5..2.0).contains(&(robot.max_thrust_n() / (robot.mass_kg * 9.81))));
    let hubs: Vec<(f64, f64)> =
        robot.rotors.iter().map(|r| (r.body_from_rotor.translation.x, r.body_from_rotor.translation.y)).collect();
    assert_eq!(hubs, vec![(0.174, -0.174), (-0.174, 0.174), (0.174, 0.174), (-0.174, -0.174)], "PX4's order");
    assert_eq!(robot.rotors.iter().map(|r| r.direction).collect::<Vec<_>>(), vec![1.0, 1.0, -1.0, -1.0]);
    // Thrusts, roll, pitch and yaw torques are independent: diagonal rotors turn the same way.
    let discs: Vec<_> = robot.collision_shapes.iter().filter(|shape| shape.link.starts_with("rotor_")).collect();
    assert_eq!(discs.len(), 4);
    assert!(discs.iter().all(|disc| matches!(disc.geometry, Geometry::Cylinder { radius, .. } if radius == 0.127)));
    let corner = 0.174f64.hypot(0.174) + 0.127;
    assert!(robot.circumscribed_radius_m >= corner && robot.circumscribed_radius_m < corner + 0.001);
    let camera = robot.sensors.body_from_camera.translation.z;
    assert!(
        robot.rotors.iter().all(|rotor| rotor.body_from_rotor.translation.z + 0.05 < camera),
        "nothing stands before the camera"
    );
    assert!(robot.center_of_mass.x.abs() < 1e-12 && robot.center_of_mass.y.abs() < 1e-12);
}

#[test]
fn an_empty_toml_is_refused_with_every_key() {
    let (urdf, _) = quadruped_texts();
    let Err(ModelError::MissingKeys { keys, robot }) = RobotModel::parse(urdf, "", &|_| None) else {
        panic!("must be refused")
    };
    assert_eq!(robot, "omni_quadruped");
    assert_eq!(keys.len(), 1 + 6 + 12 + 5);
    assert!(
        keys.contains(&"stance.RR_calf_joint".to_owned()) && keys.contains(&"limits.max_lateral_speed_mps".to_owned())
    );

    let (urdf, _) = quadrotor_texts();
    let Err(ModelError::MissingKeys { keys, .. }) = RobotModel::parse(urdf, "", &|_| None) else {
        panic!("must be refused")
    };
    assert!(keys.contains(&"rotor.moment_ratio_m".to_owned()) && keys.contains(&"limits.max_tilt_rad".to_owned()));
}

/// Removing any line `key = value` of a required key is noticed by name; changing a value to rubbish is refused.
#[test]
fn each_required_key_is_missed_by_name() {
    for (urdf, toml) in [quadruped_texts(), quadrotor_texts()] {
        let table: toml::Table = toml.parse().expect("shipped TOML");
        for section in ["limits", "stance", "rotor", "drag"] {
            for key in table.get(section).and_then(|t| t.as_table()).into_iter().flat_map(|t| t.keys().cloned()) {
                let mut cut = table.clone();
                cut[section].as_table_mut().expect("a table").remove(&key);
                let full = format!("{section}.{key}");
                let refusal = RobotModel::parse(urdf, &cut.to_string(), &|_| None).expect_err("must be refused");
                assert!(
                    matches!(&refusal, ModelError::MissingKeys { keys, .. } if *keys == vec![full.clone()]),
                    "{full}: {refusal}"
                );
                cut[section].as_table_mut().expect("a table").insert(key, toml::Value::Float(f64::NAN));
                assert!(RobotModel::parse(urdf, &cut.to_string(), &|_| None).is_err(), "{full} = nan");
            }
        }
    }
}

#[test]
fn typing_errors_and_wrong_names_are_refused() {
    let (urdf, toml) = quadrotor_texts();
    let check = |from: &str, to: &str, expected: &str| {
        assert!(toml.contains(from), "{from}");
        let refusal = RobotModel::parse(urdf, &toml.replacen(from, to, 1), &|_| None).expect_err("must be refused");
        assert!(refusal.to_string().contains(expected), "{refusal}");
    };
    check("max_speed_mps", "max_sped_mps", "unknown field `max_sped_mps`");
    check("link = \"imu\"", "link = \"nose\"", "`sensors.imu.link` names the link `nose`");
    check("max_speed_mps = 2.0", "max_speed_mps = -2.0", "`limits.max_speed_mps` must be a positive number");
    check("max_speed_radps = 1000.0", "max_speed_radps = 500.0", "it cannot hover");
    check("direction = \"ccw\"", "direction = \"left\"", "unknown variant `left`");
    check("kind = \"aerial\"", "kind = ", "robot TOML line 2:");
    let (urdf, toml) = quadruped_texts();
    let refusal = RobotModel::parse(urdf, &toml.replace("FL_calf_joint = -1.65", "FL_calf_joint = 0.0"), &|_| None);
    assert!(matches!(refusal, Err(ModelError::StanceOutsideLimits { joint, .. }) if joint == "FL_calf_joint"));
}

#[test]
fn payload_adds_size_and_mass() {
    let (urdf, toml) = quadrotor_texts();
    let plain = RobotModel::builtin_quadrotor();
    let payload = "[[payload]]\nname = \"bag\"\nlink = \"base_link\"\nxyz_m = [0.0, 0.0, -0.5]\nshape = { sphere = { radius_m = 0.1 } }\nmass_kg = 0.5\n";
    let loaded = RobotModel::parse(urdf, &format!("{toml}\n{payload}"), &|_| None).expect("a sound robot");
    assert!((loaded.mass_kg - plain.mass_kg - 0.5).abs() < 1e-12);
    assert!((loaded.height_span_m.0 + 0.6).abs() < 1e-12);
    assert!(loaded.center_of_mass.z < plain.center_of_mass.z - 0.05);
    assert_eq!(loaded.collision_shapes.last().map(|shape| shape.link.as_str()), Some("bag"));
}

#[test]
fn tomls_are_found_by_the_robots_name() {
    for name in ["go1", "a1", "b2_description", "go2_description", "x500", "iris", "omni_quadruped", "omni_quadrotor"] {
        assert!(builtin_toml(name).is_some(), "{name}");
    }
    assert_eq!(builtin_toml("unicorn"), None);
    let (urdf, toml) = quadruped_texts();
    assert_eq!(robot_model::robot_name(urdf).and_then(|name| builtin_toml(&name)), Some(toml));
}

#[test]
fn frames_follow_named_joints() {
    let robot = RobotModel::builtin_quadruped();
    assert_eq!(robot.frames_at(&BTreeMap::new()).expect("the stance"), robot.frames);
    let turned = robot.frames_at(&[("FL_hip_joint".to_owned(), 0.3)].into()).expect("a known joint");
    assert_ne!(turned["FL_foot"], robot.frames["FL_foot"]);
    assert_eq!(turned["RR_foot"], robot.frames["RR_foot"]);
    assert!(robot.frames_at(&[("trunk".to_owned(), 0.3)].into()).is_err());
    assert!((turned["FL_hip"] * Vector3::x() - Vector3::x()).norm() < 1e-12, "the hip turns about x");
}
