//! Rig files: those that ship, those that others write, and those that are refused with a sentence.

use mission::rig::{BUILTIN_RIGS, Rig, RigError, builtin_rig};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use omni_perception::Camera;
use proptest::prelude::*;
use robot_model::RobotModel;

fn no_files(name: &str) -> std::io::Result<String> {
    Err(std::io::Error::new(std::io::ErrorKind::NotFound, format!("no {name} here")))
}

fn parse(text: &str, robot: Option<&RobotModel>) -> Result<Rig, RigError> {
    Rig::parse(text, robot, &no_files)
}

fn robots() -> [RobotModel; 2] {
    [RobotModel::builtin_quadruped(), RobotModel::builtin_quadrotor()]
}

#[test]
fn the_shipped_rigs_fit_both_robots() {
    for robot in robots() {
        for (name, text) in BUILTIN_RIGS {
            let rig = parse(text, Some(&robot)).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(rig.lidar.is_rotating(), name != "fixed", "{name}");
            let stitcher = rig.stitcher().expect("it can be stitched");
            assert_eq!(stitcher.is_some(), name == "fisheyes", "{name}");
            if let Some(stitcher) = stitcher {
                assert_eq!(stitcher.covered_share(), 1.0);
            }
        }
    }
}

#[test]
fn the_rotating_rig_is_what_robots_have_anyway_to_the_bit() {
    for robot in robots() {
        let rig = parse(builtin_rig("rotating").expect("it ships"), Some(&robot)).expect("sound");
        assert_eq!(rig, Rig::of_robot(&robot));
        assert_eq!(rig.fitted(&robot), robot);
    }
}

#[test]
fn the_fixed_rig_stands_upright_where_the_rotor_was() {
    let robot = RobotModel::builtin_quadruped();
    let rig = parse(builtin_rig("fixed").expect("it ships"), Some(&robot)).expect("sound");
    let rotor = rig.lidar.mount.rotor_from_sensor;
    assert_eq!(rotor.rotation, UnitQuaternion::identity());
    assert_eq!(rotor.translation, robot.sensors.rotor_from_sensor.translation);
    assert_eq!(rig.fitted(&robot).sensors.lidar.rotation_hz, 0.0);
    assert!(!rig.odometry(omni_perception::LioConfig::default()).is_rotating);
}

#[test]
fn the_fisheyes_look_left_and_right() {
    let robot = RobotModel::builtin_quadruped();
    let rig = parse(builtin_rig("fisheyes").expect("it ships"), Some(&robot)).expect("sound");
    let at = robot.sensors.body_from_camera;
    for (camera, side) in rig.cameras.iter().zip([1.0, -1.0]) {
        let ahead = camera.body_from_camera * Vector3::x();
        assert!((ahead - Vector3::y() * side).norm() < 1e-12, "{}: {ahead}", camera.name);
        let seen = camera.body_from_camera.inverse() * (at * Point3::new(0.0, 3.0 * side, 0.0));
        assert!(camera.model.project(&seen).is_some());
        // A thing ahead is seen by both: that is the seam.
        let ahead = camera.body_from_camera.inverse() * (at * Point3::new(4.0, 0.0, 0.0));
        assert!(camera.model.project(&ahead).is_some());
    }
}

const LENS: &str = "model = \"kannala-brandt\"\nwidth_px = 100\nheight_px = 100\nintrinsics = [30, 30, 49.5, 49.5]\n\
    distortion = [0, 0, 0, 0]\n";

fn with_lens(camera: &str) -> String {
    format!("version = 1\n[lidar]\nmount = \"fixed\"\nlink = \"body\"\n[imu]\nlink = \"body\"\n[[camera]]\n{camera}")
}

#[test]
fn without_a_robot_poses_are_in_the_body() {
    let text = with_lens(&format!("link = \"body\"\nxyz_m = [0.1, 0.2, 0.3]\nrpy_rad = [0, 0.5, 1.5]\n{LENS}"));
    let rig = parse(&text, None).expect("sound");
    let expected = Isometry3::from_parts(
        Translation3::new(0.1, 0.2, 0.3),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.5)
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.5),
    );
    assert!((rig.cameras[0].body_from_camera.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-12);
    // The panorama is level, at the lens.
    assert_eq!(rig.panorama.body_from_panorama.rotation, UnitQuaternion::identity());
    let refused = parse(&with_lens(LENS), None);
    assert!(matches!(refused, Err(RigError::NoRobot { key }) if key == "camera[0].link"));
}

#[test]
fn links_of_the_robot_are_frames() {
    let robot = RobotModel::builtin_quadruped();
    let text = with_lens(&format!("link = \"lidar_stator\"\nxyz_m = [0, 0, 0.1]\n{LENS}"));
    let rig = parse(&text, Some(&robot)).expect("sound");
    let expected = robot.frames["lidar_stator"] * Isometry3::translation(0.0, 0.0, 0.1);
    assert_eq!(rig.cameras[0].body_from_camera, expected);
    let refused = parse(&with_lens(&format!("link = \"nose\"\n{LENS}")), Some(&robot)).expect_err("no nose");
    let sentence = refused.to_string();
    assert!(sentence.contains("camera[0].link") && sentence.contains("nose") && sentence.contains("lidar_stator"));
}

#[test]
fn kalibr_s_pose_is_turned_from_optical_axes() {
    // An IMU in the body; the camera 0.1 m ahead of it, looking ahead: optical z is body x, optical x is body -y.
    let pose = "t_cam_imu = [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, -0.1], [0, 0, 0, 1]]\n";
    let rig = parse(&with_lens(&format!("{pose}{LENS}")), None).expect("sound");
    let expected = Isometry3::translation(0.1, 0.0, 0.0);
    assert!((rig.cameras[0].body_from_camera.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-12);
    let skewed = pose.replace("[1, 0, 0, -0.1]", "[1, 0.1, 0, -0.1]");
    let refused = parse(&with_lens(&format!("{skewed}{LENS}")), None);
    assert!(matches!(refused, Err(RigError::Value { key, .. }) if key == "camera[0].t_cam_imu"));
}

#[test]
fn every_model_is_read() {
    let sizes = "link = \"body\"\nwidth_px = 512\nheight_px = 512\n";
    let read = |camera: &str| parse(&with_lens(camera), None).expect("sound").cameras[0].model.clone();
    let sphere = read(&format!("{sizes}model = \"ds\"\nintrinsics = [-0.17, 0.59, 158, 158, 255, 256]\n"));
    assert!(matches!(sphere, Camera::DoubleSphere(lens) if lens.xi() == -0.17 && lens.intrinsics().fx_px == 158.0));
    let radtan = format!("{sizes}model = \"pinhole-radtan\"\nintrinsics = [400, 400, 255, 256]\n");
    for distortion in ["[-0.3, 0.1, 0.001, 0.002]", "[-0.3, 0.1, 0.001, 0.002, 0.0]"] {
        let lens = read(&format!("{radtan}distortion = {distortion}\n"));
        assert!(matches!(lens, Camera::PinholeRadtan(lens) if lens.distortion()[3] == 0.002));
    }
    let file = "3 -100 0 0.0025\n1 0\n199.5 249.5\n1 0 0\n400 500\n";
    let text = with_lens("link = \"body\"\nmodel = \"ocam\"\ncalibration = \"lens.txt\"\n");
    let rig = Rig::parse(&text, None, &|name| if name == "lens.txt" { Ok(file.into()) } else { no_files(name) });
    assert!(matches!(&rig.expect("sound").cameras[0].model, Camera::Ocam(_)));
    assert!(matches!(parse(&text, None), Err(RigError::File { file, .. }) if file == "lens.txt"));
    let broken = Rig::parse(&text, None, &|_| Ok("3 -100 0".into()));
    let sentence = broken.expect_err("broken").to_string();
    assert!(sentence.contains("lens.txt") && sentence.contains("line 1"), "{sentence}");
}

#[test]
fn what_is_wrong_is_named_with_what_is_accepted() {
    let sound = with_lens(&format!("link = \"body\"\n{LENS}"));
    let check = |from: &str, to: &str, words: &[&str]| {
        assert!(sound.contains(from), "{from}");
        let sentence = parse(&sound.replace(from, to), None).expect_err(to).to_string();
        for word in words {
            assert!(sentence.contains(word), "{to:?} says nothing of {word:?}: {sentence}");
        }
    };
    check("version = 1", "", &["version", "version = 1"]);
    check("version = 1", "version = 2", &["version", "only version"]);
    check("mount = \"fixed\"", "mount = \"loose\"", &["lidar.mount", "rotating", "fixed"]);
    check("mount = \"fixed\"", "", &["lidar.mount", "rotating", "fixed"]);
    check("mount = \"fixed\"", "mount = \"rotating\"", &["lidar.rotation_hz", "0.5"]);
    check("mount = \"fixed\"", "mount = \"rotating\"\nrotation_hz = 0.0", &["lidar.rotation_hz", "positive"]);
    check("mount = \"fixed\"", "mount = \"fixed\"\nrotation_hz = 0.5", &["lidar.rotation_hz", "fixed mount"]);
    check("mount = \"fixed\"", "mount = \"fixed\"\nbeams = 0", &["lidar.beams", "1024"]);
    check("mount = \"fixed\"", "mount = \"fixed\"\nbeems = 32", &["beems", "line 4", "beams"]);
    check("mount = \"fixed\"", "mount = \"fixed\"\nxyz_m = [0, nan, 0]", &["lidar.xyz_m", "finite"]);
    check("mount = \"fixed\"", "mount = \"fixed\"\nxyz_m = [0, 0]", &["line 4"]);
    check("model = \"kannala-brandt\"", "model = \"fishy\"", &["camera[0].model", "kannala-brandt", "ocam"]);
    check("model = \"kannala-brandt\"", "", &["camera[0].model", "double-sphere"]);
    check("width_px = 100", "", &["camera[0].width_px"]);
    check("width_px = 100", "width_px = 0", &["camera[0]", "0 x 100"]);
    check("[30, 30, 49.5, 49.5]", "[30, 30]", &["camera[0].intrinsics", "[fx, fy, cx, cy]"]);
    check("[30, 30, 49.5, 49.5]", "[-30, 30, 49.5, 49.5]", &["camera[0]", "fx_px", "positive"]);
    check("distortion = [0, 0, 0, 0]", "", &["camera[0].distortion", "[k1, k2, k3, k4]"]);
    check("distortion = [0, 0, 0, 0]", "distortion = [0, 0, 0, 0]\nphi_top_rad = 1", &["phi_top_rad", "kannala"]);
    check("distortion = [0, 0, 0, 0]", "distortion = [0, 0, 0, 0]\nmax_angle_rad = 7", &["max_angle_rad", "(0, pi]"]);
    check(LENS, &format!("{LENS}[panorama]\ndistance_m = -1"), &["panorama", "distance_m"]);
    check(LENS, &format!("{LENS}[panorama]\nphi_top_rad = -2"), &["panorama", "elevations"]);
    check(LENS, &format!("{LENS}[[camera]]\nlink = \"body\"\nmodel = \"equirectangular\""), &["camera[1]", "only"]);
    let blind = sound.split("[[camera]]").next().expect("it has a beginning");
    let sentence = parse(blind, None).expect_err("blind").to_string();
    assert!(sentence.contains("0 cameras") && sentence.contains("[[camera]]"), "{sentence}");
    assert!(matches!(parse(&"#".repeat(70_000), None), Err(RigError::TooLong { .. })));
    assert!(matches!(parse("\u{0}", None), Err(RigError::Toml { line: 1, .. })));
}

proptest! {
    /// Keys of other tables, numbers of any size, cut texts: a sentence, never a panic.
    #[test]
    fn no_text_makes_the_reader_panic(cut in 0..2000_usize, at in 0..2000_usize, word in "[a-z_]{1,8}|nan|-?inf|[0-9.e+-]{1,9}|[\\[\\]\"=]") {
        let text = builtin_rig("fisheyes").expect("it ships");
        let robot = RobotModel::builtin_quadrotor();
        let _ = parse(text.get(..cut).unwrap_or(text), Some(&robot));
        let words: Vec<&str> = text.split_whitespace().collect();
        let mut changed: Vec<&str> = words.clone();
        let index = at % words.len();
        changed[index] = &word;
        let mut lines = text.to_owned();
        lines = lines.replacen(words[index], &word, 1);
        let _ = parse(&lines, Some(&robot));
        let _ = parse(&changed.join("\n"), Some(&robot));
    }
}
