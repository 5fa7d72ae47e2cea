//! Another URDF is another robot: what differs between go2, go1 and b2 comes from their files, and what is wrong with a file is said with
//! the file's name and the element's.

mod support;

use std::path::{Path, PathBuf};

use arena::cli::load_robot;
use arena::mission::robot_model::{RobotKind, RobotModel, quadruped_texts};
use arena::run::RunResult;
use nalgebra::Point2;
use support::{coarse, run_from, scene, start};

/// The official file of a robot, if the data is here.
fn official(file: &str) -> Option<RobotModel> {
    let folders = ["../../../shared/data/urdf/unitree_ros", "../../../../shared/data/urdf/unitree_ros"];
    let paths = folders.map(|folder| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(folder).join(file));
    let Some(path) = paths.iter().find(|path| path.is_file()) else {
        eprintln!("skipped: {} is not here", paths[0].display());
        return None;
    };
    Some(load_robot(Some(path), RobotKind::Ground).expect("the official file is sound"))
}

/// Same building, sentence, seed and start; only the file of the robot differs.
#[test]
fn route_clearance_and_speed_change_with_the_robot() {
    let files = [
        "go2_description/urdf/go2_description.urdf",
        "go1_description/urdf/go1.urdf",
        "b2_description/urdf/b2_description.urdf",
    ];
    let Some(robots) = files.into_iter().map(official).collect::<Option<Vec<_>>>() else { return };
    let flat = scene("flat");
    let config = coarse(14.0);
    // Where the largest fits, all do.
    let at = start(&flat, &robots[2], &config, 3);
    let runs: Vec<RunResult> = robots
        .iter()
        .map(|robot| {
            let mut at = at;
            at.translation.vector.z = robot.stance_height_m;
            run_from(&config, robot, &flat, "find the mug near the sink", &at, 3)
        })
        .collect();
    let way = |run: &RunResult| -> Vec<Point2<f64>> {
        run.truth.poses.iter().map(|(_, pose)| Point2::from(pose.translation.vector.xy())).collect()
    };
    let top_mps = |run: &RunResult| -> f64 {
        let way = way(run);
        // Over half a second: the sway is not the speed.
        way.windows(26).map(|part| (part[25] - part[0]).norm() / 0.5).fold(0.0, f64::max)
    };
    for (robot, run) in robots.iter().zip(&runs) {
        let (top, limit) = (top_mps(run), robot.limits.max_speed_mps);
        eprintln!(
            "{:16} {:.2} m, at most {top:.2} of {limit} m/s, clearance {:?} m",
            robot.name, run.summary.path_m, run.summary.min_clearance_m
        );
        assert!(run.summary.path_m > 1.5, "{} went {} m", robot.name, run.summary.path_m);
        assert!(top <= 1.02 * limit, "{}: {top} m/s of {limit}", robot.name);
        assert_eq!(run.summary.collisions, 0, "{}", robot.name);
    }
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let (a, b) = (&runs[i], &runs[j]);
        // Ways, not times: the farthest that a point of one way lies from the other.
        let (one, other) = (way(a), way(b));
        let from_other = |p: &Point2<f64>| other.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
        let apart_m = one.iter().map(from_other).fold(0.0, f64::max);
        assert!(apart_m > 0.05, "{} and {} went the same way to {apart_m} m", robots[i].name, robots[j].name);
        let change = |x: f64, y: f64| (x - y).abs();
        let clearances = a.summary.min_clearance_m.zip(b.summary.min_clearance_m);
        assert!(
            clearances.is_some_and(|(x, y)| change(x, y) > 1e-3),
            "{} and {}: {clearances:?}",
            robots[i].name,
            robots[j].name
        );
    }
    // go1 is the slowest by its limit, and b2 is faster than go2 may be.
    assert!(top_mps(&runs[1]) < 0.9 * top_mps(&runs[0]).min(top_mps(&runs[2])));
    assert!(top_mps(&runs[2]) > robots[0].limits.max_speed_mps);
    // And the large one takes no narrower way than the small ones could.
    assert!(robots[2].circumscribed_radius_m > robots[0].circumscribed_radius_m + 0.1);
}

/// What `--urdf FILE` says of a broken file: the file, and the element in it.
#[test]
fn a_broken_robot_is_refused_with_file_and_element() {
    let (urdf, toml) = quadruped_texts();
    let folder = tempfile::tempdir().expect("a folder");
    let check = |name: &str, broken: String, element: &str| {
        assert_ne!(broken, urdf, "{name}: nothing was broken");
        let path: PathBuf = Path::new(folder.path()).join(format!("{name}.urdf"));
        std::fs::write(&path, broken).expect("written");
        std::fs::write(path.with_extension("toml"), toml).expect("written");
        let refusal = format!("{:#}", load_robot(Some(&path), RobotKind::Ground).expect_err("must be refused"));
        assert!(refusal.contains(&format!("{name}.urdf")), "{name}: {refusal}");
        assert!(refusal.contains(element), "{name}: {refusal}");
    };
    let mesh = "<mesh filename=\"package://nowhere/trunk.stl\"/>";
    check("cut", urdf[..urdf.len() / 2].to_owned(), "URDF line");
    check(
        "mesh",
        urdf.replacen("<box size=\"0.3762 0.0935 0.114\"/>", mesh, 2),
        "link `trunk`: collision mesh `package://nowhere/trunk.stl` was not found",
    );
    let masses = |value: &str| {
        urdf.split("<mass value=\"")
            .enumerate()
            .map(|(k, part)| match part.split_once('"') {
                Some((_, rest)) if k > 0 => format!("<mass value=\"{value}\"{rest}"),
                _ => part.to_owned(),
            })
            .collect::<String>()
    };
    check("weightless", masses("0"), "the robot has no mass");
    check("negative_mass", masses("-1"), "link `trunk`: <inertial> has a negative mass");
    check(
        "negative_inertia",
        urdf.replacen("ixx=\"", "ixx=\"-", 1),
        "link `trunk`: <inertial> has a negative principal moment of inertia",
    );
    let calf = "<parent link=\"FL_thigh\"/><child link=\"FL_calf\"/>";
    check(
        "loop",
        urdf.replacen(
            "<parent link=\"trunk\"/><child link=\"FL_hip\"/>",
            "<parent link=\"FL_calf\"/><child link=\"FL_hip\"/>",
            1,
        ),
        "cycle through link `FL_",
    );
    check(
        "two_parents",
        urdf.replacen(calf, "<parent link=\"FL_thigh\"/><child link=\"FL_hip\"/>", 1),
        "link `FL_hip` has two parents",
    );
    check(
        "nobody",
        urdf.replacen(calf, "<parent link=\"FL_thigh\"/><child link=\"FL_shin\"/>", 1),
        "joint `FL_calf_joint` names the link `FL_shin`, which does not exist",
    );
}
