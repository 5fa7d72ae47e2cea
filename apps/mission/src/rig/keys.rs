//! The keys of a rig file, as written.

use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRig {
    pub version: Option<i64>,
    #[serde(default)]
    pub lidar: RawLidar,
    #[serde(default)]
    pub imu: RawImu,
    #[serde(default)]
    pub camera: Vec<RawCamera>,
    pub panorama: Option<RawPanorama>,
}

/// `link`, `xyz_m` and `rpy_rad` of a table.
#[derive(Default)]
pub(super) struct RawPose {
    pub link: Option<String>,
    pub xyz_m: Option<[f64; 3]>,
    pub rpy_rad: Option<[f64; 3]>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLidar {
    pub link: Option<String>,
    pub xyz_m: Option<[f64; 3]>,
    pub rpy_rad: Option<[f64; 3]>,
    pub mount: Option<String>,
    pub rotation_hz: Option<f64>,
    pub tilt_rad: Option<f64>,
    pub sensor_offset_m: Option<[f64; 3]>,
    pub encoder_latency_s: Option<f64>,
    pub beams: Option<u16>,
    pub columns: Option<u32>,
    pub scan_hz: Option<f64>,
    pub vertical_fov_rad: Option<f64>,
    pub max_range_m: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct RawImu {
    pub link: Option<String>,
    pub xyz_m: Option<[f64; 3]>,
    pub rpy_rad: Option<[f64; 3]>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCamera {
    pub name: Option<String>,
    pub link: Option<String>,
    pub xyz_m: Option<[f64; 3]>,
    pub rpy_rad: Option<[f64; 3]>,
    pub t_cam_imu: Option<[[f64; 4]; 4]>,
    pub model: Option<String>,
    pub width_px: Option<u32>,
    pub height_px: Option<u32>,
    pub phi_top_rad: Option<f64>,
    pub phi_bottom_rad: Option<f64>,
    pub intrinsics: Option<Vec<f64>>,
    pub distortion: Option<Vec<f64>>,
    pub max_angle_rad: Option<f64>,
    pub calibration: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPanorama {
    pub link: Option<String>,
    pub xyz_m: Option<[f64; 3]>,
    pub rpy_rad: Option<[f64; 3]>,
    pub width_px: Option<u32>,
    pub height_px: Option<u32>,
    pub phi_top_rad: Option<f64>,
    pub phi_bottom_rad: Option<f64>,
    pub distance_m: Option<f64>,
    pub feather_rad: Option<f64>,
}
