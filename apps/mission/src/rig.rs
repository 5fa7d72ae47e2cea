//! What sensors a robot carries and where: from a small TOML, or from the robot's own model.
//!
//! ```toml
//! version = 1
//!
//! [lidar]
//! mount = "rotating"          # or "fixed"
//! rotation_hz = 0.5           # turns of the motor a second (rotating only)
//! tilt_rad = 0.5236           # spin axis of the sensor against the motor's axis
//! sensor_offset_m = [0, 0, 0.04]
//! encoder_latency_s = 0.0     # an angle stamped t was true at t - latency
//! beams = 32                  # these five describe the sensor to the simulator; a real one needs none of them
//! columns = 1024
//! scan_hz = 10.0
//! vertical_fov_rad = 0.785
//! max_range_m = 30.0
//!
//! [imu]
//!
//! [[camera]]                  # one panorama ...
//! name = "panorama"
//! model = "equirectangular"
//! width_px = 1920
//! height_px = 640
//! phi_top_rad = 1.0472
//! phi_bottom_rad = -1.0472
//!
//! [[camera]]                  # ... or lenses that are stitched to one
//! name = "left"
//! rpy_rad = [0, 0, 1.5708]
//! model = "kannala-brandt"    # or one of the models below
//! width_px = 1024
//! height_px = 1024
//! intrinsics = [305.0, 305.0, 511.5, 511.5]
//! distortion = [0.004, -0.002, 0.0005, -0.0001]
//! max_angle_rad = 1.658       # half the field of view; without it as far as the model goes
//!
//! [panorama]                  # what lenses are stitched to; all of it may be left out
//! width_px = 1920
//! height_px = 640
//! phi_top_rad = 1.0472
//! phi_bottom_rad = -1.0472
//! distance_m = 4.0            # things so far away join without a step
//! feather_rad = 0.1           # width of the band in which lenses fade
//! ```
//!
//! **Where.** Every sensor (and the panorama) may have `link` (a frame of the robot's URDF, or `"body"`), and `xyz_m`,
//! `rpy_rad` relative to it (fixed-axis roll, pitch, yaw as in URDF). Without `link` they are relative to where the
//! robot's model has that sensor; with none of the three the sensor is exactly there, so a rig need only say what
//! differs. Cameras have the axes of a body: x along the optical axis, y left, z up. A camera may instead have
//! `t_cam_imu`, the 4x4 matrix of Kalibr (optical axes).
//!
//! **Models** (parameters as the calibration tools write them, the centre of the first pixel at 0):
//!
//! | `model` | keys |
//! | --- | --- |
//! | `equirectangular` | `width_px`, `height_px`, `phi_top_rad`, `phi_bottom_rad` |
//! | `kannala-brandt` or `pinhole-equi` | sizes, `intrinsics = [fx, fy, cx, cy]`, `distortion = [k1, k2, k3, k4]` |
//! | `double-sphere` or `ds` | sizes, `intrinsics = [xi, alpha, fx, fy, cx, cy]` |
//! | `pinhole-radtan` | sizes, `intrinsics = [fx, fy, cx, cy]`, `distortion = [k1, k2, p1, p2]` or with k3 |
//! | `ocam` | `calibration = "file"`, the text file of OCamCalib, beside the rig file |
//!
//! Keys that do not belong are refused, so that a typing error cannot pass as "not given".

use nalgebra::{Isometry3, UnitQuaternion};
use omni_perception::{Camera, Equirectangular, Lens, LioConfig, RotatingMount, StitchConfig, StitchError, Stitcher};
use robot_model::{LidarMotor, RobotModel, SensorMounts};

use crate::recording::RecordedRig;

mod error;
mod keys;
mod text;

pub use error::RigError;

/// Finds the text of a file that a rig names (a calibration).
pub type ReadText<'a> = &'a dyn Fn(&str) -> std::io::Result<String>;

/// Sensors of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// The LiDAR.
    pub lidar: RigLidar,
    /// The IMU in the body.
    pub body_from_imu: Isometry3<f64>,
    /// One equirectangular camera, or lenses that are stitched.
    pub cameras: Vec<RigCamera>,
    /// The panorama that the robot works with.
    pub panorama: RigPanorama,
}

/// The LiDAR and its mount.
#[derive(Debug, Clone, PartialEq)]
pub struct RigLidar {
    /// Stator and rotor.
    pub mount: RotatingMount,
    /// Turns of the motor a second; 0: fixed, there is no encoder.
    pub rotation_hz: f64,
    /// Angle between the motor's axis and the sensor's spin axis.
    pub tilt_rad: f64,
    /// An angle stamped t was true at t minus this.
    pub encoder_latency_s: f64,
    /// Rays in a column.
    pub beams: u16,
    /// Columns in a scan.
    pub columns: u32,
    /// Scans a second.
    pub scan_hz: f64,
    /// Angle between the lowest and the highest beam.
    pub vertical_fov_rad: f64,
    /// Farthest return.
    pub max_range_m: f64,
}

impl RigLidar {
    /// Whether a motor turns it.
    pub fn is_rotating(&self) -> bool {
        self.rotation_hz != 0.0
    }
}

/// A camera and where it sits.
#[derive(Debug, Clone, PartialEq)]
pub struct RigCamera {
    /// Its name in messages.
    pub name: String,
    /// What it sees.
    pub model: Camera,
    /// x along the optical axis, y left, z up.
    pub body_from_camera: Isometry3<f64>,
}

/// The panorama and how it is made.
#[derive(Debug, Clone, PartialEq)]
pub struct RigPanorama {
    /// Geometry, and how lenses are joined.
    pub stitch: StitchConfig,
    /// x to the middle of the picture, y left, z up.
    pub body_from_panorama: Isometry3<f64>,
}

impl Rig {
    /// The rig of a robot without a rig file: its own LiDAR and a panorama of 1920 x 640 pixels at its camera.
    pub fn of_robot(robot: &RobotModel) -> Rig {
        let sensors = &robot.sensors;
        let mount = RotatingMount {
            body_from_stator: sensors.body_from_lidar_stator,
            rotor_from_sensor: sensors.rotor_from_sensor,
        };
        Rig {
            lidar: RigLidar::new(mount, sensors.lidar.rotation_hz, sensors.lidar.tilt_rad),
            body_from_imu: sensors.body_from_imu,
            cameras: vec![RigCamera {
                name: "panorama".into(),
                model: Camera::Equirectangular(Equirectangular::default()),
                body_from_camera: sensors.body_from_camera,
            }],
            panorama: RigPanorama { stitch: StitchConfig::default(), body_from_panorama: sensors.body_from_camera },
        }
    }

    /// The robot with these sensors in place of its own: what plans, projects and localises reads them there.
    pub fn fitted(&self, robot: &RobotModel) -> RobotModel {
        let mut fitted = robot.clone();
        fitted.sensors = SensorMounts {
            body_from_lidar_stator: self.lidar.mount.body_from_stator,
            rotor_from_sensor: self.lidar.mount.rotor_from_sensor,
            body_from_imu: self.body_from_imu,
            body_from_camera: self.panorama.body_from_panorama,
            lidar: LidarMotor { rotation_hz: self.lidar.rotation_hz, tilt_rad: self.lidar.tilt_rad },
        };
        fitted
    }

    /// Geometry of the panorama that the robot works with.
    pub fn camera(&self) -> Equirectangular {
        self.panorama.stitch.panorama
    }

    /// What makes the panorama of the lenses' images; `None` where the camera takes the panorama itself.
    ///
    /// # Errors
    /// [`StitchError`] if the lenses cannot be stitched.
    pub fn stitcher(&self) -> Result<Option<Stitcher>, StitchError> {
        if let [RigCamera { model: Camera::Equirectangular(_), .. }] = self.cameras[..] {
            return Ok(None);
        }
        let panorama_from_body = self.panorama.body_from_panorama.inverse();
        let lens = |camera: &RigCamera| Lens {
            camera: camera.model.clone(),
            panorama_from_lens: panorama_from_body * camera.body_from_camera,
        };
        Stitcher::new(&self.cameras.iter().map(lens).collect::<Vec<_>>(), &self.panorama.stitch).map(Some)
    }

    /// A configuration of the odometry for this LiDAR.
    pub fn odometry(&self, config: LioConfig) -> LioConfig {
        LioConfig { is_rotating: self.lidar.is_rotating(), encoder_latency_s: self.lidar.encoder_latency_s, ..config }
    }

    /// As recordings describe it.
    pub fn recorded(&self) -> RecordedRig {
        let is_rotating = self.lidar.is_rotating();
        RecordedRig { mount: self.lidar.mount, is_rotating, body_from_imu: self.body_from_imu }
    }
}

impl RigLidar {
    /// A LiDAR of 32 x 1024 rays, ten times a second, 45 degrees high, 30 m far.
    fn new(mount: RotatingMount, rotation_hz: f64, tilt_rad: f64) -> RigLidar {
        RigLidar {
            mount,
            rotation_hz,
            tilt_rad,
            encoder_latency_s: 0.0,
            beams: 32,
            columns: 1024,
            scan_hz: 10.0,
            vertical_fov_rad: 45_f64.to_radians(),
            max_range_m: 30.0,
        }
    }
}

/// The rigs that ship with the program: name and text.
pub const BUILTIN_RIGS: [(&str, &str); 3] = [
    ("rotating", include_str!("../rigs/rotating.toml")),
    ("fixed", include_str!("../rigs/fixed.toml")),
    ("fisheyes", include_str!("../rigs/fisheyes.toml")),
];

/// The text of a rig that ships with the program.
pub fn builtin_rig(name: &str) -> Option<&'static str> {
    BUILTIN_RIGS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The sensor on its rotor, tilted about the rotor's y axis (as in robot models).
fn rotor_from_sensor(tilt_rad: f64, offset_m: [f64; 3]) -> Isometry3<f64> {
    let tilt = UnitQuaternion::from_axis_angle(&nalgebra::Vector3::y_axis(), tilt_rad);
    Isometry3::from_parts(nalgebra::Vector3::from(offset_m).into(), tilt)
}
