//! From the text of a rig to a [`Rig`].

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use omni_perception::camera::{DoubleSphere, KannalaBrandt, Ocam, PinholeRadtan, parse_ocam_text};
use omni_perception::{Camera, Equirectangular, Intrinsics, RotatingMount, StitchConfig, camera_from_optical};
use robot_model::RobotModel;

use super::keys::{RawCamera, RawImu, RawLidar, RawPanorama, RawPose, RawRig};
use super::{ReadText, Rig, RigCamera, RigError, RigLidar, RigPanorama, rotor_from_sensor};

const MOST_BYTES: usize = 65_536;
const MOST_CAMERAS: usize = 16;
const SIZES: &str = "the image's width and height in pixels";
const MODELS: &str = "one of \"equirectangular\", \"kannala-brandt\", \"double-sphere\", \"pinhole-radtan\", \"ocam\"";

impl Rig {
    /// Reads a rig. `robot` is the robot that carries it: its links and its own sensors are what poses are relative to.
    /// `read_file` finds calibration files by the name that the rig gives them.
    ///
    /// # Errors
    /// [`RigError`] names the key and what would be accepted.
    pub fn parse(text: &str, robot: Option<&RobotModel>, read_file: ReadText<'_>) -> Result<Rig, RigError> {
        if text.len() > MOST_BYTES {
            return Err(RigError::TooLong { bytes: text.len(), most: MOST_BYTES });
        }
        let raw: RawRig = toml::from_str(text).map_err(|error| {
            let before = error.span().map_or("", |span| text.get(..span.start).unwrap_or(""));
            RigError::Toml { line: before.matches('\n').count() + 1, detail: error.message().to_owned() }
        })?;
        match raw.version {
            Some(1) => {}
            Some(_) => return Err(value("version", "1, the only version there is")),
            None => return Err(missing("version", "write version = 1")),
        }
        let count = raw.camera.len();
        if count == 0 || count > MOST_CAMERAS {
            return Err(RigError::CameraCount { count, most: MOST_CAMERAS });
        }
        let lidar = lidar(raw.lidar, robot)?;
        let body_from_imu = imu(raw.imu, robot)?;
        let reader = CameraReader { robot, body_from_imu: &body_from_imu, read_file };
        let cameras = raw
            .camera
            .into_iter()
            .enumerate()
            .map(|(index, raw)| reader.camera(index, raw))
            .collect::<Result<Vec<RigCamera>, RigError>>()?;
        let panorama = panorama(raw.panorama, &cameras, robot)?;
        Ok(Rig { lidar, body_from_imu, cameras, panorama })
    }
}

fn lidar(raw: RawLidar, robot: Option<&RobotModel>) -> Result<RigLidar, RigError> {
    let own = robot.map(|robot| robot.sensors);
    let pose = RawPose { link: raw.link, xyz_m: raw.xyz_m, rpy_rad: raw.rpy_rad };
    let body_from_stator = place("lidar", pose, robot, own.map(|own| own.body_from_lidar_stator))?;
    let is_rotating = match raw.mount.as_deref() {
        Some("rotating") => true,
        Some("fixed") => false,
        Some(_) => return Err(value("lidar.mount", "\"rotating\" or \"fixed\"")),
        None => return Err(missing("lidar.mount", "write mount = \"rotating\" or mount = \"fixed\"")),
    };
    if !is_rotating {
        let unused =
            [("rotation_hz", raw.rotation_hz.is_some()), ("encoder_latency_s", raw.encoder_latency_s.is_some())];
        refuse("lidar", &unused, "a fixed mount")?;
    }
    let rotation_hz = match (is_rotating, raw.rotation_hz, &own) {
        (false, ..) => 0.0,
        (true, Some(given), _) => given,
        (true, None, Some(own)) if own.lidar.rotation_hz > 0.0 => own.lidar.rotation_hz,
        (true, None, _) => return Err(missing("lidar.rotation_hz", "turns of the motor a second, for example 0.5")),
    };
    if is_rotating && !(rotation_hz > 0.0 && rotation_hz <= 100.0) {
        return Err(value("lidar.rotation_hz", "a positive number up to 100"));
    }
    // A fixed sensor stands upright unless the rig says otherwise; a turning one keeps the robot's tilt.
    let own_tilt_rad = own.as_ref().filter(|_| is_rotating).map_or(0.0, |own| own.lidar.tilt_rad);
    let tilt_rad =
        ranged("lidar.tilt_rad", raw.tilt_rad, own_tilt_rad, 0.0, std::f64::consts::PI, "an angle in [0, pi]")?;
    let own_rotor = own.as_ref().map(|own| own.rotor_from_sensor);
    let offset_m = match (raw.sensor_offset_m, &own_rotor) {
        (Some(offset_m), _) => offset_m,
        (None, Some(own)) => own.translation.vector.into(),
        (None, None) => [0.0; 3],
    };
    finite("lidar.sensor_offset_m", &offset_m)?;
    let is_own = is_rotating && raw.tilt_rad.is_none() && raw.sensor_offset_m.is_none();
    let rotor = own_rotor.filter(|_| is_own).unwrap_or_else(|| rotor_from_sensor(tilt_rad, offset_m));
    let lidar = RigLidar::new(RotatingMount { body_from_stator, rotor_from_sensor: rotor }, rotation_hz, tilt_rad);
    let (latency_s, scan_hz) = (lidar.encoder_latency_s, lidar.scan_hz);
    let (height_rad, range_m) = (lidar.vertical_fov_rad, lidar.max_range_m);
    Ok(RigLidar {
        encoder_latency_s: ranged(
            "lidar.encoder_latency_s",
            raw.encoder_latency_s,
            latency_s,
            -1.0,
            1.0,
            "a time from -1 to 1 s",
        )?,
        beams: raw.beams.map_or(Ok(lidar.beams), |beams| match beams {
            1..=1024 => Ok(beams),
            _ => Err(value("lidar.beams", "a number from 1 to 1024")),
        })?,
        columns: raw.columns.map_or(Ok(lidar.columns), |columns| match columns {
            1..=65_536 => Ok(columns),
            _ => Err(value("lidar.columns", "a number from 1 to 65536")),
        })?,
        scan_hz: ranged("lidar.scan_hz", raw.scan_hz, scan_hz, 0.1, 1000.0, "a number from 0.1 to 1000")?,
        vertical_fov_rad: ranged(
            "lidar.vertical_fov_rad",
            raw.vertical_fov_rad,
            height_rad,
            0.0,
            std::f64::consts::PI,
            "an angle from 0 to pi",
        )?,
        max_range_m: ranged(
            "lidar.max_range_m",
            raw.max_range_m,
            range_m,
            0.5,
            1000.0,
            "a distance from 0.5 to 1000 m",
        )?,
        ..lidar
    })
}

fn imu(raw: RawImu, robot: Option<&RobotModel>) -> Result<Isometry3<f64>, RigError> {
    let pose = RawPose { link: raw.link, xyz_m: raw.xyz_m, rpy_rad: raw.rpy_rad };
    place("imu", pose, robot, robot.map(|robot| robot.sensors.body_from_imu))
}

/// What all cameras of a rig need.
struct CameraReader<'a> {
    robot: Option<&'a RobotModel>,
    body_from_imu: &'a Isometry3<f64>,
    read_file: ReadText<'a>,
}

impl CameraReader<'_> {
    fn camera(&self, index: usize, mut raw: RawCamera) -> Result<RigCamera, RigError> {
        let table = format!("camera[{index}]");
        let pose = RawPose { link: raw.link.take(), xyz_m: raw.xyz_m, rpy_rad: raw.rpy_rad };
        let body_from_camera = match raw.t_cam_imu {
            Some(matrix) => {
                let given = [
                    ("link", pose.link.is_some()),
                    ("xyz_m", pose.xyz_m.is_some()),
                    ("rpy_rad", pose.rpy_rad.is_some()),
                ];
                refuse(&table, &given, "a camera with t_cam_imu")?;
                let optical_from_imu = isometry(&format!("{table}.t_cam_imu"), &matrix)?;
                // T_cam_imu maps IMU coordinates to the camera's optical frame.
                self.body_from_imu * optical_from_imu.inverse() * camera_from_optical().inverse()
            }
            None => place(&table, pose, self.robot, self.robot.map(|robot| robot.sensors.body_from_camera))?,
        };
        let name = raw.name.take().unwrap_or_else(|| format!("camera {index}"));
        Ok(RigCamera { name, model: self.model(&table, &raw)?, body_from_camera })
    }

    fn model(&self, table: &str, raw: &RawCamera) -> Result<Camera, RigError> {
        let key = |key: &str| format!("{table}.{key}");
        let unsound = |source| RigError::Camera { key: table.to_owned(), source };
        let Some(model) = raw.model.as_deref() else { return Err(missing(&key("model"), MODELS)) };
        let has_width = ("width_px", raw.width_px.is_some());
        let has_height = ("height_px", raw.height_px.is_some());
        let has_top = ("phi_top_rad", raw.phi_top_rad.is_some());
        let has_bottom = ("phi_bottom_rad", raw.phi_bottom_rad.is_some());
        let has_intrinsics = ("intrinsics", raw.intrinsics.is_some());
        let has_distortion = ("distortion", raw.distortion.is_some());
        let has_angle = ("max_angle_rad", raw.max_angle_rad.is_some());
        let has_file = ("calibration", raw.calibration.is_some());
        let max_angle_rad = raw.max_angle_rad.unwrap_or(std::f64::consts::PI);
        let size = || -> Result<(u32, u32), RigError> {
            let width_px = raw.width_px.ok_or_else(|| missing(&key("width_px"), SIZES))?;
            Ok((width_px, raw.height_px.ok_or_else(|| missing(&key("height_px"), SIZES))?))
        };
        let distortion =
            |accepts: &'static str| raw.distortion.clone().ok_or_else(|| missing(&key("distortion"), accepts));
        match model {
            "equirectangular" => {
                refuse(table, &[has_intrinsics, has_distortion, has_angle, has_file], "an equirectangular camera")?;
                let camera = view(raw.width_px, raw.height_px, raw.phi_top_rad, raw.phi_bottom_rad);
                camera.validate().map_err(unsound)?;
                Ok(Camera::Equirectangular(camera))
            }
            "kannala-brandt" | "pinhole-equi" => {
                refuse(table, &[has_top, has_bottom, has_file], "a kannala-brandt camera")?;
                let [fx, fy, cx, cy] = numbers(&key("intrinsics"), &raw.intrinsics, "[fx, fy, cx, cy]")?;
                let k = numbers(&key("distortion"), &raw.distortion, "[k1, k2, k3, k4]")?;
                let lens = KannalaBrandt::new(intrinsics(size()?, [fx, fy, cx, cy]), k, max_angle_rad);
                lens.map(Camera::KannalaBrandt).map_err(unsound)
            }
            "double-sphere" | "ds" => {
                refuse(table, &[has_top, has_bottom, has_distortion, has_file], "a double-sphere camera")?;
                let accepts = "[xi, alpha, fx, fy, cx, cy]";
                let [xi, alpha, fx, fy, cx, cy] = numbers(&key("intrinsics"), &raw.intrinsics, accepts)?;
                let lens = DoubleSphere::new(intrinsics(size()?, [fx, fy, cx, cy]), xi, alpha, max_angle_rad);
                lens.map(Camera::DoubleSphere).map_err(unsound)
            }
            "pinhole-radtan" => {
                refuse(table, &[has_top, has_bottom, has_file], "a pinhole-radtan camera")?;
                let linear = numbers(&key("intrinsics"), &raw.intrinsics, "[fx, fy, cx, cy]")?;
                let accepts = "[k1, k2, p1, p2] or [k1, k2, p1, p2, k3]";
                let given = distortion(accepts)?;
                let radtan = match given[..] {
                    [k1, k2, p1, p2] => [k1, k2, p1, p2, 0.0],
                    [k1, k2, p1, p2, k3] => [k1, k2, p1, p2, k3],
                    _ => return Err(value(&key("distortion"), accepts)),
                };
                let lens = PinholeRadtan::new(intrinsics(size()?, linear), radtan, max_angle_rad);
                lens.map(Camera::PinholeRadtan).map_err(unsound)
            }
            "ocam" => {
                let unused = [has_width, has_height, has_top, has_bottom, has_intrinsics, has_distortion];
                refuse(table, &unused, "an ocam camera, whose numbers are in its calibration file")?;
                let accepts = "the text file of OCamCalib, beside the rig file";
                let key = key("calibration");
                let file = raw.calibration.clone().ok_or_else(|| missing(&key, accepts))?;
                let text = match (self.read_file)(&file) {
                    Ok(text) => text,
                    Err(source) => return Err(RigError::File { key, file, source }),
                };
                let calibration = match parse_ocam_text(&text) {
                    Ok(calibration) => calibration,
                    Err(source) => return Err(RigError::Calibration { key, file, source }),
                };
                Ocam::new(calibration, max_angle_rad).map(Camera::Ocam).map_err(unsound)
            }
            _ => Err(value(&key("model"), MODELS)),
        }
    }
}

fn panorama(
    raw: Option<RawPanorama>,
    cameras: &[RigCamera],
    robot: Option<&RobotModel>,
) -> Result<RigPanorama, RigError> {
    let finished = cameras.iter().enumerate().find_map(|(index, camera)| match camera.model {
        Camera::Equirectangular(view) => Some((index, view)),
        _ => None,
    });
    if let Some((index, view)) = finished {
        if cameras.len() > 1 || raw.is_some() {
            return Err(RigError::TwoPanoramas { key: format!("camera[{index}]") });
        }
        let stitch = StitchConfig { panorama: view, ..StitchConfig::default() };
        return Ok(RigPanorama { stitch, body_from_panorama: cameras[0].body_from_camera });
    }
    let raw = raw.unwrap_or_default();
    let usual = StitchConfig::default();
    let stitch = StitchConfig {
        panorama: view(raw.width_px, raw.height_px, raw.phi_top_rad, raw.phi_bottom_rad),
        distance_m: raw.distance_m.unwrap_or(usual.distance_m),
        feather_rad: raw.feather_rad.unwrap_or(usual.feather_rad),
    };
    stitch.validate()?;
    let pose = RawPose { link: raw.link, xyz_m: raw.xyz_m, rpy_rad: raw.rpy_rad };
    let is_somewhere = pose.link.is_some() || pose.xyz_m.is_some() || pose.rpy_rad.is_some();
    let body_from_panorama = match robot {
        // Without a robot or a word about it the panorama is level, in the middle of the lenses.
        None if !is_somewhere => {
            let sum: Vector3<f64> = cameras.iter().map(|camera| camera.body_from_camera.translation.vector).sum();
            Isometry3::from_parts(Translation3::from(sum / cameras.len() as f64), UnitQuaternion::identity())
        }
        _ => place("panorama", pose, robot, robot.map(|robot| robot.sensors.body_from_camera))?,
    };
    Ok(RigPanorama { stitch, body_from_panorama })
}

/// Where a sensor sits: on a link, in the body, or relative to where the robot has it.
fn place(
    table: &str,
    pose: RawPose,
    robot: Option<&RobotModel>,
    own: Option<Isometry3<f64>>,
) -> Result<Isometry3<f64>, RigError> {
    let base = match (pose.link.as_deref(), robot) {
        (None, _) => own.ok_or_else(|| RigError::NoRobot { key: format!("{table}.link") })?,
        (Some(link), Some(robot)) if robot.frames.contains_key(link) => robot.frames[link],
        (Some("body"), _) => Isometry3::identity(),
        (Some(_), None) => return Err(RigError::NoRobot { key: format!("{table}.link") }),
        (Some(link), Some(robot)) => {
            let known = std::iter::once("body".to_owned()).chain(robot.frames.keys().cloned()).collect();
            return Err(RigError::UnknownLink { key: format!("{table}.link"), link: link.to_owned(), known });
        }
    };
    if pose.xyz_m.is_none() && pose.rpy_rad.is_none() {
        return Ok(base); // to the bit
    }
    let (xyz_m, rpy_rad) = (pose.xyz_m.unwrap_or_default(), pose.rpy_rad.unwrap_or_default());
    finite(&format!("{table}.xyz_m"), &xyz_m)?;
    finite(&format!("{table}.rpy_rad"), &rpy_rad)?;
    let [roll, pitch, yaw] = rpy_rad;
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Ok(base * Isometry3::from_parts(Translation3::from(Vector3::from(xyz_m)), turn))
}

/// A 4x4 matrix as a rigid motion.
fn isometry(key: &str, matrix: &[[f64; 4]; 4]) -> Result<Isometry3<f64>, RigError> {
    /// Written with four digits, a rotation is orthonormal to a few ten-thousandths.
    const TOLERANCE: f64 = 2e-3;
    let turn = Matrix3::from_fn(|row, column| matrix[row][column]);
    let is_rotation = (turn * turn.transpose() - Matrix3::identity()).amax() < TOLERANCE && turn.determinant() > 0.0;
    let is_affine = matrix[3] == [0.0, 0.0, 0.0, 1.0];
    if !(is_rotation && is_affine && matrix.iter().flatten().all(|x| x.is_finite())) {
        return Err(value(key, "a 4x4 matrix of a rotation and a translation, [0, 0, 0, 1] below"));
    }
    let position = Translation3::new(matrix[0][3], matrix[1][3], matrix[2][3]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&turn));
    Ok(Isometry3::from_parts(position, turn))
}

fn view(width: Option<u32>, height: Option<u32>, top: Option<f64>, bottom: Option<f64>) -> Equirectangular {
    let usual = Equirectangular::default();
    Equirectangular {
        width_px: width.unwrap_or(usual.width_px),
        height_px: height.unwrap_or(usual.height_px),
        phi_top_rad: top.unwrap_or(usual.phi_top_rad),
        phi_bottom_rad: bottom.unwrap_or(usual.phi_bottom_rad),
    }
}

fn intrinsics((width_px, height_px): (u32, u32), [fx_px, fy_px, cx_px, cy_px]: [f64; 4]) -> Intrinsics {
    Intrinsics { width_px, height_px, fx_px, fy_px, cx_px, cy_px }
}

fn numbers<const N: usize>(key: &str, given: &Option<Vec<f64>>, accepts: &'static str) -> Result<[f64; N], RigError> {
    let given = given.as_ref().ok_or_else(|| missing(key, accepts))?;
    given.as_slice().try_into().map_err(|_| value(key, accepts))
}

fn ranged(
    key: &str,
    given: Option<f64>,
    usual: f64,
    low: f64,
    high: f64,
    accepts: &'static str,
) -> Result<f64, RigError> {
    let given = given.unwrap_or(usual);
    if (low..=high).contains(&given) { Ok(given) } else { Err(value(key, accepts)) }
}

fn finite(key: &str, numbers: &[f64; 3]) -> Result<(), RigError> {
    if numbers.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(value(key, "three finite numbers")) }
}

/// Refuses the first key that is given.
fn refuse(table: &str, given: &[(&str, bool)], to: &str) -> Result<(), RigError> {
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((key, _)) => Err(RigError::Unused { key: format!("{table}.{key}"), to: to.to_owned() }),
        None => Ok(()),
    }
}

fn value(key: &str, accepts: &'static str) -> RigError {
    RigError::Value { key: key.to_owned(), accepts }
}

fn missing(key: &str, accepts: &'static str) -> RigError {
    RigError::Missing { key: key.to_owned(), accepts }
}
