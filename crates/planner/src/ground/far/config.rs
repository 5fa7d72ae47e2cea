//! Settings of the dynamic visibility graph, under FAR Planner's names where it has them, and what is refused.

/// Settings of a [`super::DynamicVisibilityGraph`]. The defaults are FAR's for a building, with our own where a comment says so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FarConfig {
    /// Side of a cell in m (`voxel_dim`). 0.15.
    pub voxel_m: f64,
    /// Distance in m that every way keeps from every occupied square: FAR's `robot_dim / 2`, but exact. 0.4. At least two cells, at most
    /// twelve.
    pub clearance_m: f64,
    /// Size of the robot in m, the step of way-points and half the reach in which nodes count as covered (`robot_dim`). 0.8.
    pub near_m: f64,
    /// A vertex of this cycle is looked for among the nodes within this distance in m. 0.6: a vertex stands beside the obstacle and not
    /// on it, and a corner has two, so it is less than FAR's `2 robot_dim + voxel_dim`.
    pub match_m: f64,
    /// Longest edge in m (`sensor_range`). 30.
    pub range_m: f64,
    /// Floors that differ by more than this in m are other storeys (`tolerZ`). 1.0.
    pub same_layer_m: f64,
    /// Votes that an edge keeps (`connect_votes_size`). 10, at most 16.
    pub connect_votes_size: u8,
    /// Cycles without a match after which a node is forgotten (`clear_dumper_thred`). 4.
    pub clear_dumper: u8,
    /// Agreeing matches after which a node is frozen (`node_finalize_thred`). 6.
    pub node_finalize: u8,
    /// Matches that a node remembers (`filter_pool_size`). 12, at most 16.
    pub filter_pool: u8,
    /// Angle in rad by which a taut edge may cut into the surface it leaves (`angle_noise`). 0.12: polygons lie within a cell
    /// of the squares.
    pub angle_noise_rad: f64,
    /// Corners that turn by less, in rad, are walls (`accept_max_align_angle`). 4 degrees.
    pub accept_align_rad: f64,
    /// Rings no longer than this in m are pillars: their box is taken for them (`pillar_perimeter`). 2.
    pub pillar_perimeter_m: f64,
    /// How far in m the local planner looks: how far way-points and trajectory nodes are ahead and behind (`local_planner_range`). 5.
    pub local_planner_range_m: f64,
    /// A goal that is not free may be moved this far in m (`goal_adjust_radius`). 2.
    pub goal_adjust_radius_m: f64,
    /// Pairs of nodes measured for new edges in one cycle, or a few more; the rest waits for the next. 2000.
    pub pairs_per_cycle: u32,
}

impl Default for FarConfig {
    fn default() -> Self {
        FarConfig {
            voxel_m: 0.15,
            clearance_m: 0.4,
            near_m: 0.8,
            match_m: 0.6,
            range_m: 30.0,
            same_layer_m: 1.0,
            connect_votes_size: 10,
            clear_dumper: 4,
            node_finalize: 6,
            filter_pool: 12,
            angle_noise_rad: 0.12,
            accept_align_rad: 0.07,
            pillar_perimeter_m: 2.0,
            local_planner_range_m: 5.0,
            goal_adjust_radius_m: 2.0,
            pairs_per_cycle: 2000,
        }
    }
}

/// Least and most clearance in cells: the exact edge test needs the first, the stored distances end beyond the second.
const CLEARANCE_CELLS: std::ops::RangeInclusive<f64> = 2.0..=12.0;

impl FarConfig {
    /// # Errors
    /// The first setting that is outside its range.
    pub fn validate(&self) -> Result<(), FarError> {
        let lengths = [
            ("voxel_m", self.voxel_m),
            ("clearance_m", self.clearance_m),
            ("near_m", self.near_m),
            ("match_m", self.match_m),
            ("range_m", self.range_m),
            ("same_layer_m", self.same_layer_m),
            ("local_planner_range_m", self.local_planner_range_m),
        ];
        for (name, value) in lengths {
            if !(1e-3..=1e4).contains(&value) {
                return Err(FarError::Setting { name, value, accepted: "0.001 to 10000 m" });
            }
        }
        let others = [
            ("angle_noise_rad", self.angle_noise_rad, 0.0..=1.0, "0 to 1"),
            ("accept_align_rad", self.accept_align_rad, 0.0..=1.0, "0 to 1"),
            ("pillar_perimeter_m", self.pillar_perimeter_m, 0.0..=1e4, "0 to 10000 m"),
            ("goal_adjust_radius_m", self.goal_adjust_radius_m, 0.0..=100.0, "0 to 100 m"),
            ("connect_votes_size", f64::from(self.connect_votes_size), 1.0..=16.0, "1 to 16"),
            ("filter_pool", f64::from(self.filter_pool), 1.0..=16.0, "1 to 16"),
            ("node_finalize", f64::from(self.node_finalize), 1.0..=f64::from(self.filter_pool), "1 to filter_pool"),
            ("pairs_per_cycle", f64::from(self.pairs_per_cycle), 1.0..=1e9, "1 to 1e9"),
        ];
        for (name, value, range, accepted) in others {
            if !range.contains(&value) {
                return Err(FarError::Setting { name, value, accepted });
            }
        }
        for (name, value, most) in
            [("range_m", self.range_m, 2000.0), ("goal_adjust_radius_m", self.goal_adjust_radius_m, 100.0)]
        {
            if value / self.voxel_m > most {
                let accepted = if most > 100.0 { "at most 2000 times voxel_m" } else { "at most 100 times voxel_m" };
                return Err(FarError::Setting { name, value, accepted });
            }
        }
        if self.match_m.max(self.near_m) > self.range_m {
            return Err(FarError::Setting {
                name: "range_m",
                value: self.range_m,
                accepted: "at least match_m and near_m",
            });
        }
        if !CLEARANCE_CELLS.contains(&self.clearance_cells()) {
            return Err(FarError::Setting {
                name: "clearance_m",
                value: self.clearance_m,
                accepted: "2 to 12 times voxel_m",
            });
        }
        Ok(())
    }

    pub(crate) fn clearance_cells(&self) -> f64 {
        self.clearance_m / self.voxel_m
    }
}

/// Why the dynamic visibility graph refused its input. Nothing of the graph has changed then.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FarError {
    /// A setting is outside its range.
    #[error("{name} is {value}; accepted is {accepted}")]
    Setting {
        /// Field of [`FarConfig`].
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would do.
        accepted: &'static str,
    },
    /// The robot's position has a coordinate that is not finite or beyond a thousand kilometres.
    #[error("the robot is at {x}, {y}, {z}; accepted are finite coordinates within 1000 km")]
    Pose {
        /// Position in the world.
        x: f64,
        /// Position in the world.
        y: f64,
        /// Floor under the robot.
        z: f64,
    },
    /// The window has no cells or more than [`super::window::MAX_WINDOW_CELLS`].
    #[error("the window has {width} x {height} cells; accepted are 1 to {} in all", super::window::MAX_WINDOW_CELLS)]
    WindowSize {
        /// Cells along x.
        width: usize,
        /// Cells along y.
        height: usize,
    },
    /// The number of values is not `width * height`.
    #[error("the window has {expected} cells but {actual} values")]
    WindowLength {
        /// `width * height`.
        expected: usize,
        /// Length of `seen`.
        actual: usize,
    },
    /// The window lies beyond a thousand kilometres.
    #[error("the window begins at cell {x}, {y}; accepted are cells within 2^30 of the origin")]
    WindowPlace {
        /// First cell along x.
        x: i64,
        /// First cell along y.
        y: i64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_hold_and_what_does_not_is_named() {
        assert_eq!(FarConfig::default().validate(), Ok(()));
        let error = FarConfig { clearance_m: 0.2, ..FarConfig::default() }.validate().unwrap_err();
        assert_eq!(error.to_string(), "clearance_m is 0.2; accepted is 2 to 12 times voxel_m");
        assert!(FarConfig { near_m: f64::NAN, ..FarConfig::default() }.validate().is_err());
        assert!(FarConfig { node_finalize: 13, ..FarConfig::default() }.validate().is_err());
    }
}
