//! Against stored results of pinocchio (kinematics, mass) and exact bounds of collision shapes, for URDFs that others publish.
//!
//! The URDFs and results lie in `shared/data/urdf` with their makers' licences; without that folder these tests are skipped.

use nalgebra::{Matrix3, Point3, Vector3};
use robot_model::envelope::placed_shapes;
use robot_model::shape::bounds;
use robot_model::{
    BaseMotion, Gait, GaitConfig, ModelError, RobotKind, RobotModel, builtin_toml, merged_bodies, mesh_candidates,
};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The golden files are rounded to 12 digits and angles to 12 digits too.
const KINEMATICS_TOL: f64 = 2e-9;
/// The golden bounds are rounded to 9 digits.
const BOUNDS_TOL_M: f64 = 2e-9;

fn data() -> Option<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/urdf"));
    // A git worktree of the repository lies one folder deeper.
    let from_worktree = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../../shared/data/urdf"));
    let found = [folder, from_worktree].into_iter().find(|folder| folder.is_dir()).map(Path::to_path_buf);
    if found.is_none() {
        eprintln!("skipped: {} does not exist", folder.display());
    }
    found
}

fn json(folder: &Path, name: &str) -> serde_json::Map<String, Value> {
    let text = std::fs::read_to_string(folder.join(name)).expect("a golden file");
    serde_json::from_str(&text).expect("JSON")
}

/// Loads a URDF as an app would: TOML by the robot's name, meshes from the folders above the file.
fn load(path: &Path) -> Result<RobotModel, ModelError> {
    let urdf = std::fs::read_to_string(path).expect("a URDF");
    let folder = path.parent().expect("a folder");
    let read_mesh =
        |file: &str| mesh_candidates(file, folder).iter().find_map(|candidate| std::fs::read(candidate).ok());
    let toml = robot_model::robot_name(&urdf).and_then(|name| builtin_toml(&name)).unwrap_or("");
    RobotModel::parse(&urdf, toml, &read_mesh)
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().expect("three numbers").iter().map(|v| v.as_f64().expect("a number")))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    let rows: Vec<_> = value.as_array().expect("three rows").iter().map(|row| vector(row).transpose()).collect();
    Matrix3::from_rows(&rows)
}

#[test]
fn kinematics_and_inertia_agree_with_pinocchio() {
    let Some(folder) = data() else { return };
    let mut configurations = 0;
    for (robot, golden) in json(&folder, "golden_kinematics.json") {
        let model = load(&folder.join(golden["urdf"].as_str().expect("a path"))).expect("a sound robot");
        assert_eq!(
            model.tree.moving_joints().len() as u64,
            golden["n_moving_joints"].as_u64().expect("a count"),
            "{robot}"
        );
        assert!(
            (model.mass_kg - golden["total_mass"].as_f64().expect("a mass")).abs() < 1e-9,
            "{robot}: {}",
            model.mass_kg
        );
        for config in golden["configs"].as_array().expect("configurations") {
            let name = config["name"].as_str().expect("a name");
            let angles: BTreeMap<String, f64> = config["joints"]
                .as_object()
                .expect("angles")
                .iter()
                .map(|(k, v)| (k.clone(), v.as_f64().expect("rad")))
                .collect();
            let frames = model.frames_at(&angles).expect("known joints");
            for (link, expected) in config["frames"].as_object().expect("frames") {
                let found = frames[link];
                let shift = (found.translation.vector - vector(&expected["p"])).amax();
                let turn = (found.rotation.to_rotation_matrix().matrix() - matrix(&expected["R"])).amax();
                assert!(shift < KINEMATICS_TOL && turn < KINEMATICS_TOL, "{robot} {name} {link}: {shift} {turn}");
            }
            let list = model.tree.angles_from(&angles).expect("known joints");
            let mass = model.tree.mass_properties(&list).expect("finite angles");
            assert!((mass.center_of_mass.coords - vector(&config["com"])).amax() < KINEMATICS_TOL, "{robot} {name}");
            assert!(
                (mass.inertia - matrix(&config["inertia_com"])).amax() < KINEMATICS_TOL,
                "{robot} {name}: {}",
                mass.inertia
            );
            if name == "stance" {
                assert!(
                    (model.inertia - mass.inertia).amax() < 1e-12,
                    "{robot}: the model stands in the golden stance"
                );
                assert!((model.center_of_mass - mass.center_of_mass).amax() < 1e-12);
            }
            configurations += 1;
        }
    }
    assert!(configurations >= 40, "only {configurations} configurations compared");
}

#[test]
fn collision_bounds_agree_in_the_stance() {
    let Some(folder) = data() else { return };
    let mut compared = 0;
    for (robot, golden) in json(&folder, "golden_footprint.json") {
        let model = match load(&folder.join(golden["urdf"].as_str().expect("a path"))) {
            Ok(model) => model,
            // Robots for which no TOML ships.
            Err(ModelError::MissingKeys { robot: name, .. }) => {
                assert!(["hector", "quad", "cf2"].contains(&name.as_str()), "{name}");
                continue;
            }
            Err(error) => panic!("{robot}: {error}"),
        };
        let poses = model.tree.body_from_links(&model.stance).expect("the stance");
        let shapes = placed_shapes(&model.tree, &poses);
        assert_eq!(shapes.len() as u64, golden["n_collision_shapes"].as_u64().expect("a count"), "{robot}");
        let (low, high) = bounds(&shapes).expect("shapes");
        assert!((low - Point3::from(vector(&golden["aabb_min"]))).amax() < BOUNDS_TOL_M, "{robot}: {low}");
        assert!((high - Point3::from(vector(&golden["aabb_max"]))).amax() < BOUNDS_TOL_M, "{robot}: {high}");
        if model.kind == RobotKind::Ground {
            // Nothing is swept and the payload stands on the trunk: the footprint has the same bounds.
            let reach =
                |d: Vector3<f64>| model.footprint.iter().map(|p| p.coords.dot(&d.xy())).fold(f64::MIN, f64::max);
            assert!(
                (reach(Vector3::x()) - high.x).abs() < BOUNDS_TOL_M
                    && (reach(-Vector3::x()) + low.x).abs() < BOUNDS_TOL_M
            );
            assert!(
                (reach(Vector3::y()) - high.y).abs() < BOUNDS_TOL_M
                    && (reach(-Vector3::y()) + low.y).abs() < BOUNDS_TOL_M
            );
            assert!((model.stance_height_m + low.z).abs() < BOUNDS_TOL_M);
        }
        compared += 1;
    }
    assert!(compared >= 7, "only {compared} robots compared");
}

#[test]
fn every_official_file_loads_or_says_why() {
    let Some(folder) = data() else { return };
    let files = [
        ("unitree_ros/go2_description/urdf/go2_description.urdf", ""),
        ("unitree_ros/go1_description/urdf/go1.urdf", ""),
        ("unitree_ros/a1_description/urdf/a1.urdf", ""),
        ("unitree_ros/b2_description/urdf/b2_description.urdf", ""),
        ("example-robot-data/robots/go2_description/urdf/go2.urdf", ""),
        ("example-robot-data/robots/go1_description/urdf/go1.urdf", ""),
        ("example-robot-data/robots/a1_description/urdf/a1.urdf", ""),
        ("example-robot-data/robots/iris_description/robots/iris.urdf", ""),
        ("example-robot-data/robots/iris_description/robots/iris_simple.urdf", ""),
        ("x500/x500.urdf", ""),
        (
            "example-robot-data/robots/hector_description/robots/quadrotor_base.urdf",
            "the TOML of robot `hector` lacks kind, limits.max_speed_mps",
        ),
        ("gym-pybullet-drones/cf2x.urdf", "the TOML of robot `cf2` lacks kind, limits.max_speed_mps"),
        (
            "unitree_ros/go2w_description/urdf/go2w_description.urdf",
            "link `FL_foot`: collision mesh `package://go2w_description",
        ),
    ];
    for (file, refusal) in files {
        match load(&folder.join(file)) {
            Ok(model) => assert!(refusal.is_empty() && model.mass_kg > 1.0, "{file}"),
            Err(error) => assert!(!refusal.is_empty() && error.to_string().starts_with(refusal), "{file}: {error}"),
        }
    }
}

/// The official files repeat `<material>` within a `<visual>`, which urdf-rs alone refuses; ours read them whole.
#[test]
fn official_files_with_repeated_materials_are_read() {
    let Some(folder) = data() else { return };
    for robot in ["go2", "b2", "go2w"] {
        let path = folder.join(format!("unitree_ros/{robot}_description/urdf/{robot}_description.urdf"));
        let text = std::fs::read_to_string(&path).expect("a URDF");
        let alone = urdf_rs::read_from_string(&text).map(|_| ()).map_err(|error| error.to_string());
        assert!(alone.as_ref().is_err_and(|error| error.contains("material")), "{robot}: {alone:?}");
        let wheel = drum();
        let (name, tree) =
            robot_model::urdf::read(&text.replace(".dae", ".stl"), &|_| Some(wheel.clone())).expect("readable");
        assert_eq!(name, format!("{robot}_description"));
        // Each link and joint of the file is there.
        assert_eq!(tree.links().len(), text.matches("<link name=").count(), "{robot}");
        assert_eq!(tree.joints().len(), text.matches("<joint name=").count(), "{robot}");
    }
}

/// Corners of a drum about y with a radius of 0.086 m, as text STL: a stand-in for the wheels of the Go2-W, whose meshes are not here.
fn drum() -> Vec<u8> {
    let corner = |k: u32, y: f64| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 16.0).sin_cos();
        format!("vertex {} {y} {}\n", 0.086 * cos, 0.086 * sin)
    };
    let facets: String = (0..16)
        .map(|k| {
            format!(
                "facet normal 0 0 0\nouter loop\n{}{}{}endloop\nendfacet\n",
                corner(k, -0.02),
                corner(k, 0.02),
                corner(k + 1, 0.02)
            )
        })
        .collect();
    format!("solid drum\n{facets}endsolid drum\n").into_bytes()
}

/// With meshes that can be read for its wheels the Go2-W stands on them, and they turn by the way over their radius.
#[test]
fn the_go2w_stands_on_wheels_that_roll() {
    let Some(folder) = data() else { return };
    let text = std::fs::read_to_string(folder.join("unitree_ros/go2w_description/urdf/go2w_description.urdf"))
        .expect("a URDF");
    let toml = builtin_toml("go2w_description").expect("a TOML ships");
    let wheel = drum();
    let robot =
        RobotModel::parse(&text.replace(".dae", ".stl"), toml, &|_| Some(wheel.clone())).expect("a sound robot");
    let hub_m = robot.stance_height_m + robot.frames["FL_foot"].translation.z;
    assert!((hub_m - 0.086).abs() < 1e-3, "{hub_m}");
    let at = |x: f64| nalgebra::Isometry3::translation(x, 0.0, robot.stance_height_m);
    let mut gait = Gait::new(GaitConfig::default(), &robot, &at(0.0), 0.0).expect("wheels");
    let velocity_in_world_mps = nalgebra::Vector2::new(0.5, 0.0);
    for step in 1..=200 {
        let base = BaseMotion { velocity_in_world_mps, ..BaseMotion::resting_at(at(0.0025 * f64::from(step))) };
        gait.step(0.005, &base).expect("a finite step");
    }
    for (slot, joint) in robot.tree.moving_joints().iter().enumerate() {
        let joint = &robot.tree.joints()[*joint];
        let expected = if joint.name.ends_with("_foot_joint") { 0.5 / hub_m } else { robot.stance[slot] };
        assert!((gait.angles()[slot] - expected).abs() < 1e-6, "{}: {}", joint.name, gait.angles()[slot]);
    }
}

#[test]
fn a_change_of_robot_changes_footprint_speed_and_sensors() {
    let Some(folder) = data() else { return };
    let names = [
        "unitree_ros/go2_description/urdf/go2_description.urdf",
        "unitree_ros/go1_description/urdf/go1.urdf",
        "unitree_ros/a1_description/urdf/a1.urdf",
        "unitree_ros/b2_description/urdf/b2_description.urdf",
        "x500/x500.urdf",
        "example-robot-data/robots/iris_description/robots/iris.urdf",
    ];
    let models: Vec<RobotModel> = names.iter().map(|name| load(&folder.join(name)).expect("a sound robot")).collect();
    for (i, a) in models.iter().enumerate() {
        for b in &models[..i] {
            let sides = |model: &RobotModel| {
                let reach =
                    |d: Vector3<f64>| model.footprint.iter().map(|p| p.coords.dot(&d.xy())).fold(f64::MIN, f64::max);
                [reach(Vector3::x()), reach(Vector3::y())]
            };
            let change = sides(a).iter().zip(sides(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(change > 0.01, "{} and {} have footprints that differ by {change} m only", a.name, b.name);
            assert_ne!(a.footprint, b.footprint);
            assert_ne!(a.sensors.body_from_camera, b.sensors.body_from_camera);
            assert!(a.kind != b.kind || a.limits.max_speed_mps != b.limits.max_speed_mps);
        }
        let camera = a.sensors.body_from_camera.translation.vector.z;
        assert!(camera > 0.15 && camera < a.height_span_m.1, "{}: the camera is part of the robot's height", a.name);
        eprintln!(
            "{:16} {:6.2} kg  r {:.3}/{:.3} m  z {:+.3}..{:+.3}  v {} m/s  camera z {:.2}",
            a.name,
            a.mass_kg,
            a.inscribed_radius_m,
            a.circumscribed_radius_m,
            a.height_span_m.0,
            a.height_span_m.1,
            a.limits.max_speed_mps,
            camera
        );
    }
}

#[test]
fn merging_fixed_links_is_exact() {
    let Some(folder) = data() else { return };
    let model = load(&folder.join("unitree_ros/go1_description/urdf/go1.urdf")).expect("a sound robot");
    let bodies = merged_bodies(&model.tree);
    assert_eq!((model.tree.links().len(), bodies.len()), (46, 13));
    let total: f64 = bodies.iter().map(|body| body.mass.mass_kg).sum();
    assert!((total - model.mass_kg).abs() < 1e-12);
}
