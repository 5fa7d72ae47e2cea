//! The settings of a [`Volume`](crate::Volume), checked once when it is made.

use thiserror::Error;

/// How a [`Volume`](crate::Volume) stores and forgets.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeConfig {
    /// Edge of a voxel, metres. Default 0.05.
    pub voxel_m: f64,
    /// Distances are cut to this in front of a surface, metres. Default 0.15 (three voxels).
    pub truncation_m: f64,
    /// The band goes this far behind a surface, metres. Default 0.075: more than a voxel, so that a wall is closed,
    /// but less than the thinnest wall (0.10), so that one face of a wall does not eat the other.
    pub behind_m: f64,
    /// Rays are cut here, metres; a return from farther away still clears up to this range. Default 12.
    pub max_range_m: f64,
    /// Returns nearer than this are skipped, metres. Default 0.10.
    pub min_range_m: f64,
    /// A distance is a running mean over at most this many observations. Default 20: a map built from a drifting pose
    /// must follow the newest evidence. Large values average better and forget slower.
    pub max_weight: u8,
    /// Weight of one scan that looked through a voxel. Default 10: with `max_weight` 20 a solid wall that is no
    /// longer there turns free after two scans that look through it.
    pub clear_weight: u8,
    /// Observations before a voxel counts as known. Default 2: a lone stray return makes no obstacle.
    pub min_weight: u8,
    /// Of the rays that end in different voxels, every n-th clears the free space before it; the turn goes round from scan to scan.
    /// Default 2.
    pub clear_every: usize,
    /// No block is made beyond this number; what falls outside is counted in the report. Default 60 000
    /// (a block is 0.4 m wide and takes about 2 kB, so 120 MB).
    pub max_blocks: usize,
}

impl Default for VolumeConfig {
    fn default() -> Self {
        Self {
            voxel_m: 0.05,
            truncation_m: 0.15,
            behind_m: 0.075,
            max_range_m: 12.0,
            min_range_m: 0.10,
            max_weight: 20,
            clear_weight: 10,
            min_weight: 2,
            clear_every: 2,
            max_blocks: 60_000,
        }
    }
}

impl VolumeConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// [`ConfigError`] names the first field that makes no sense.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.voxel_m) || !(0.001..=10.0).contains(&self.voxel_m) {
            return Err(ConfigError::VoxelSize(self.voxel_m));
        }
        if !positive(self.truncation_m) || self.truncation_m < self.voxel_m {
            return Err(ConfigError::Truncation(self.truncation_m));
        }
        if !positive(self.behind_m) || self.behind_m > self.truncation_m {
            return Err(ConfigError::Behind(self.behind_m));
        }
        if !positive(self.max_range_m)
            || self.max_range_m < self.truncation_m
            || self.max_range_m > 10_000.0 * self.voxel_m
        {
            return Err(ConfigError::MaxRange(self.max_range_m));
        }
        if !self.min_range_m.is_finite() || self.min_range_m < 0.0 || self.min_range_m >= self.max_range_m {
            return Err(ConfigError::MinRange(self.min_range_m));
        }
        if self.min_weight == 0 || self.clear_weight == 0 {
            return Err(ConfigError::ZeroWeight);
        }
        if self.max_weight < self.min_weight || self.max_weight < self.clear_weight || self.max_weight > 127 {
            return Err(ConfigError::MaxWeight(self.max_weight));
        }
        if self.clear_every == 0 {
            return Err(ConfigError::ClearEvery);
        }
        if self.max_blocks == 0 || self.max_blocks >= u32::MAX as usize {
            return Err(ConfigError::MaxBlocks(self.max_blocks));
        }
        Ok(())
    }
}

/// A setting that makes no sense.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ConfigError {
    /// `voxel_m` is not between 1 mm and 10 m.
    #[error("voxel_m is {0}, it must be between 0.001 and 10 metres")]
    VoxelSize(f64),
    /// `truncation_m` is smaller than a voxel or not finite.
    #[error("truncation_m is {0}, it must be finite and at least one voxel")]
    Truncation(f64),
    /// `behind_m` is not in (0, truncation_m].
    #[error("behind_m is {0}, it must be positive and at most truncation_m")]
    Behind(f64),
    /// `max_range_m` is smaller than the truncation or larger than 10 000 voxels.
    #[error("max_range_m is {0}, it must lie between truncation_m and 10000 voxels")]
    MaxRange(f64),
    /// `min_range_m` is negative, not finite or not below `max_range_m`.
    #[error("min_range_m is {0}, it must be at least 0 and below max_range_m")]
    MinRange(f64),
    /// `min_weight` or `clear_weight` is zero.
    #[error("min_weight and clear_weight must be at least 1")]
    ZeroWeight,
    /// `max_weight` is below another weight or above 127.
    #[error("max_weight is {0}, it must be at least min_weight and clear_weight and at most 127")]
    MaxWeight(u8),
    /// `clear_every` is zero.
    #[error("clear_every must be at least 1")]
    ClearEvery,
    /// `max_blocks` is zero or does not fit an index.
    #[error("max_blocks is {0}, it must be between 1 and 2^32 - 2")]
    MaxBlocks(usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_valid_and_each_broken_field_is_named() {
        assert_eq!(VolumeConfig::default().validate(), Ok(()));
        let with = |change: fn(&mut VolumeConfig)| {
            let mut config = VolumeConfig::default();
            change(&mut config);
            config.validate()
        };
        assert_eq!(with(|c| c.voxel_m = 0.0), Err(ConfigError::VoxelSize(0.0)));
        assert!(matches!(with(|c| c.voxel_m = f64::NAN), Err(ConfigError::VoxelSize(_))));
        assert_eq!(with(|c| c.truncation_m = 0.01), Err(ConfigError::Truncation(0.01)));
        assert_eq!(with(|c| c.behind_m = 0.5), Err(ConfigError::Behind(0.5)));
        assert!(matches!(with(|c| c.max_range_m = f64::INFINITY), Err(ConfigError::MaxRange(_))));
        assert_eq!(with(|c| c.min_range_m = 20.0), Err(ConfigError::MinRange(20.0)));
        assert_eq!(with(|c| c.min_weight = 0), Err(ConfigError::ZeroWeight));
        assert_eq!(with(|c| c.max_weight = 1), Err(ConfigError::MaxWeight(1)));
        assert_eq!(with(|c| c.clear_every = 0), Err(ConfigError::ClearEvery));
        assert_eq!(with(|c| c.max_blocks = 0), Err(ConfigError::MaxBlocks(0)));
    }
}
