//! Settings of the odometry. One set for all robots and rooms: what differs is in the mount.

use thiserror::Error;

use crate::ReferenceTime;

/// Settings of [`crate::LidarInertialOdometry`].
#[derive(Debug, Clone, PartialEq)]
pub struct LioConfig {
    /// White noise of the gyroscope, rad/s/sqrt(Hz). Default 5e-4.
    pub gyro_noise_density: f64,
    /// White noise of the accelerometer, m/s^2/sqrt(Hz). Default 1e-2.
    pub accel_noise_density: f64,
    /// Random walk of the gyroscope's bias, rad/s^2/sqrt(Hz). Default 5e-5.
    pub gyro_bias_walk_density: f64,
    /// Random walk of the accelerometer's bias, m/s^3/sqrt(Hz). Default 5e-4.
    pub accel_bias_walk_density: f64,
    /// Spread of the accelerometer's bias before anything is known, m/s^2. Default 0.1.
    pub accel_bias_sigma_mps2: f64,
    /// Largest rate the gyroscope can show; a sample at the limit counts as saturated, rad/s. Default 34.
    pub gyro_range_radps: f64,
    /// Largest specific force the accelerometer can show, m/s^2. Default 150.
    pub accel_range_mps2: f64,
    /// Noise of one range, m. Default 0.02.
    pub range_sigma_m: f64,
    /// Noise of a beam's direction, rad. Default 1e-3.
    pub beam_sigma_rad: f64,
    /// What a plane of the map is uncertain by at least, m: errors of the map do not average out. Default 0.005.
    pub map_sigma_m: f64,
    /// A set of points with a larger standard deviation about its plane is none, m. The noise itself is measured from the
    /// planes found so far; this is the limit before that, and above it. Default 0.06.
    pub max_plane_thickness_m: f64,
    /// Nearer returns are the robot itself, m. Default 0.3.
    pub min_range_m: f32,
    /// Farther returns are dropped, m. Default 100.
    pub max_range_m: f32,
    /// Scans with more points are thinned to about this many. Default 40 000.
    pub max_points_per_scan: usize,
    /// Edge of a cell of the map, m. Default 0.25.
    pub cell_m: f32,
    /// Largest number of cells of the map: the hard cap of its memory, about 120 bytes each. Default 100 000.
    pub max_map_voxels: usize,
    /// A cell with so many points is finished. Default 60.
    pub points_per_cell: u32,
    /// Largest number of Gauss-Newton steps on one association. Default 4.
    pub max_iterations: usize,
    /// A direction of translation with less than this many cells' worth of normals is not corrected. Default 4.
    pub min_cells_per_direction: f64,
    /// Without a valid update for so long the odometry is lost, s. Default 0.4.
    pub lost_after_s: f64,
    /// A reading of the encoder stamped t shows the angle at t minus this, s. Default 0.
    pub encoder_latency_s: f64,
    /// Whether the LiDAR turns on a motor; without, the angle is zero for ever. Default true.
    pub is_rotating: bool,
    /// Threads over which the points of a scan are spread; the result is the same to the bit. Default 1.
    pub threads: usize,
    /// Time of the pose of [`crate::LidarInertialOdometry::estimate_at_scan`]. Default the end of the scan.
    pub reference: ReferenceTime,
}

impl Default for LioConfig {
    fn default() -> Self {
        LioConfig {
            gyro_noise_density: 5e-4,
            accel_noise_density: 1e-2,
            gyro_bias_walk_density: 5e-5,
            accel_bias_walk_density: 5e-4,
            accel_bias_sigma_mps2: 0.1,
            gyro_range_radps: 34.0,
            accel_range_mps2: 150.0,
            range_sigma_m: 0.02,
            beam_sigma_rad: 1e-3,
            map_sigma_m: 0.005,
            max_plane_thickness_m: 0.06,
            min_range_m: 0.3,
            max_range_m: 100.0,
            max_points_per_scan: 40_000,
            cell_m: 0.25,
            max_map_voxels: 100_000,
            points_per_cell: 60,
            max_iterations: 4,
            min_cells_per_direction: 4.0,
            lost_after_s: 0.4,
            encoder_latency_s: 0.0,
            is_rotating: true,
            threads: 1,
            reference: ReferenceTime::End,
        }
    }
}

/// Why a set of settings is refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum LioConfigError {
    /// A number is outside its range.
    #[error("{field} = {value} is not within {low} .. {high}")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Smallest value accepted.
        low: f64,
        /// Largest value accepted.
        high: f64,
    },
    /// The range limits are not min < max.
    #[error("min_range_m is not below max_range_m")]
    Ranges,
    /// A pose of the rig is not finite.
    #[error("a pose of the rig is not finite")]
    Rig,
}

impl LioConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// [`LioConfigError`] at the first that is not sound.
    pub fn validate(&self) -> Result<(), LioConfigError> {
        let fields = [
            ("gyro_noise_density", self.gyro_noise_density, 1e-7, 1.0),
            ("accel_noise_density", self.accel_noise_density, 1e-6, 10.0),
            ("gyro_bias_walk_density", self.gyro_bias_walk_density, 0.0, 1.0),
            ("accel_bias_walk_density", self.accel_bias_walk_density, 0.0, 10.0),
            ("accel_bias_sigma_mps2", self.accel_bias_sigma_mps2, 1e-4, 5.0),
            ("gyro_range_radps", self.gyro_range_radps, 0.1, 1e4),
            ("accel_range_mps2", self.accel_range_mps2, 10.0, 1e5),
            ("range_sigma_m", self.range_sigma_m, 1e-4, 1.0),
            ("beam_sigma_rad", self.beam_sigma_rad, 0.0, 0.1),
            ("map_sigma_m", self.map_sigma_m, 1e-4, 1.0),
            ("max_plane_thickness_m", self.max_plane_thickness_m, 1e-3, 1.0),
            ("min_range_m", f64::from(self.min_range_m), 0.0, 1e3),
            ("max_range_m", f64::from(self.max_range_m), 0.0, 1e3),
            ("max_points_per_scan", self.max_points_per_scan as f64, 100.0, 1e7),
            ("cell_m", f64::from(self.cell_m), 0.02, 5.0),
            ("max_map_voxels", self.max_map_voxels as f64, 1000.0, 1e8),
            ("points_per_cell", f64::from(self.points_per_cell), 5.0, 1e6),
            ("max_iterations", self.max_iterations as f64, 1.0, 100.0),
            ("min_cells_per_direction", self.min_cells_per_direction, 0.0, 1e6),
            ("threads", self.threads as f64, 1.0, 64.0),
            ("lost_after_s", self.lost_after_s, 0.01, 100.0),
            ("encoder_latency_s", self.encoder_latency_s, -1.0, 1.0),
        ];
        for (field, value, low, high) in fields {
            // Written so that NaN is refused.
            if !(low <= value && value <= high) {
                return Err(LioConfigError::OutOfRange { field, value, low, high });
            }
        }
        if self.min_range_m < self.max_range_m { Ok(()) } else { Err(LioConfigError::Ranges) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_sound_and_nan_is_not() {
        assert_eq!(LioConfig::default().validate(), Ok(()));
        let config = LioConfig { cell_m: f32::NAN, ..LioConfig::default() };
        assert!(matches!(config.validate(), Err(LioConfigError::OutOfRange { field: "cell_m", .. })));
        let config = LioConfig { min_range_m: 5.0, max_range_m: 5.0, ..LioConfig::default() };
        assert_eq!(config.validate(), Err(LioConfigError::Ranges));
    }
}
