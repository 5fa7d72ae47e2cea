//! What the robot knows of the floor round it: free, occupied, unknown, on the world's own lattice of cells.
//!
//! Cells have whole numbers for addresses, `(i, j)` being the square from `(i, j) * voxel` to `(i + 1, j + 1) * voxel` in the world,
//! so that windows of different cycles fall on each other. FAR's window is 401 x 401 cells of 0.15 m; any size does.

use nalgebra::Point3;

use super::config::FarError;

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Seen {
    /// Nothing; what earlier windows said of it stands.
    #[default]
    Unknown,
    /// The robot's body may be here.
    Free,
    /// It may not.
    Occupied,
}

/// A window of the map, all on the storey on which the robot is.
#[derive(Debug, Clone, Copy)]
pub struct Window<'a> {
    /// Address of the lower left cell.
    pub first_cell: [i64; 2],
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Row-major (`y * width + x`).
    pub seen: &'a [Seen],
}

/// Most cells of a window: 1000 x 1000.
pub const MAX_WINDOW_CELLS: usize = 1_000_000;
/// Cells are addressed within this of the origin.
const MAX_ADDRESS: i64 = 1 << 30;
const MAX_POSE_M: f64 = 1e6;

impl Window<'_> {
    pub(crate) fn check(&self) -> Result<(), FarError> {
        let cells = self.width.saturating_mul(self.height);
        if cells == 0 || cells > MAX_WINDOW_CELLS {
            return Err(FarError::WindowSize { width: self.width, height: self.height });
        }
        if self.seen.len() != cells {
            return Err(FarError::WindowLength { expected: cells, actual: self.seen.len() });
        }
        let [x, y] = self.first_cell;
        if x.saturating_abs() > MAX_ADDRESS || y.saturating_abs() > MAX_ADDRESS {
            return Err(FarError::WindowPlace { x, y });
        }
        Ok(())
    }
}

/// Whether a position in the world can be worked with.
pub(crate) fn is_sane(p: &Point3<f64>) -> bool {
    p.coords.iter().all(|c| c.abs() <= MAX_POSE_M)
}

pub(crate) fn check_pose(p: &Point3<f64>) -> Result<(), FarError> {
    if is_sane(p) { Ok(()) } else { Err(FarError::Pose { x: p.x, y: p.y, z: p.z }) }
}
