//! What the camera can see: the nearest point in every cell of the panorama.
//!
//! The LiDAR sits elsewhere than the camera and saw its points at other times, so some of them are hidden from the camera
//! behind nearer things. A point is hidden if a nearer point lies in front of it within the neighbouring cells and
//! the step in range is steeper than a surface could be.

use crate::Equirectangular;
use crate::fast_projection::FastProjection;
use nalgebra::Point3;

/// Nearest points by cell, with wrap at the seam.
#[derive(Debug, Clone)]
pub(crate) struct RangeBuffer {
    columns: usize,
    rows: usize,
    cells_per_px: f32,
    width: f32,
    rad_per_px: f32,
    cells: Vec<Projected>,
}

/// A point in the image. A range of zero means that it is not in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Projected {
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) range_m: f32,
}

/// When a nearer point does not hide a farther one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tolerance {
    /// Always.
    pub(crate) step_m: f32,
    /// As a share of the range.
    pub(crate) step_share: f32,
    /// Tangent of the steepest angle between ray and surface normal.
    pub(crate) slope: f32,
}

/// Projects all points.
pub(crate) fn project_all(points: &[Point3<f32>], camera: &Equirectangular) -> Vec<Projected> {
    let projection = FastProjection::new(camera);
    let project = |point| {
        let (u, v, range_m) = projection.project(point);
        Projected { u, v, range_m }
    };
    points.iter().map(project).collect()
}

impl RangeBuffer {
    pub(crate) fn new(points: &[Projected], camera: &Equirectangular, cell_px: u32) -> RangeBuffer {
        let columns = camera.width_px.div_ceil(cell_px) as usize;
        let rows = camera.height_px.div_ceil(cell_px) as usize;
        let far = Projected {
            u: 0.0,
            v: 0.0,
            range_m: f32::INFINITY,
        };
        let mut buffer = RangeBuffer {
            columns,
            rows,
            cells_per_px: 1.0 / cell_px as f32,
            width: camera.width_px as f32,
            rad_per_px: camera.row_angle_rad() as f32,
            cells: vec![far; columns * rows],
        };
        for point in points.iter().filter(|point| point.range_m > 0.0) {
            let (column, row) = buffer.cell_of(point);
            let cell = &mut buffer.cells[row * columns + column];
            if point.range_m < cell.range_m {
                *cell = *point;
            }
        }
        buffer
    }

    /// Whether nothing nearer stands before the point. The point must be in the image.
    pub(crate) fn is_visible(&self, point: &Projected, tolerance: &Tolerance) -> bool {
        let step_m = tolerance.step_m.max(tolerance.step_share * point.range_m);
        let slope_per_px = tolerance.slope * self.rad_per_px;
        let (column, row) = self.cell_of(point);
        let (first, last) = (row.saturating_sub(1), (row + 1).min(self.rows - 1));
        // Left and right neighbour wrap behind the camera.
        let left = if column == 0 {
            self.columns - 1
        } else {
            column - 1
        };
        let right = if column + 1 == self.columns {
            0
        } else {
            column + 1
        };
        (first..=last).all(|row| {
            [left, column, right].into_iter().all(|column| {
                let near = &self.cells[row * self.columns + column];
                let excess_m = point.range_m - near.range_m - step_m;
                if excess_m <= 0.0 {
                    return true;
                }
                let across = (point.u - near.u).abs();
                let across = across.min(self.width - across);
                let down = point.v - near.v;
                let allowed_m = slope_per_px * near.range_m;
                excess_m * excess_m <= allowed_m * allowed_m * (across * across + down * down)
            })
        })
    }

    fn cell_of(&self, point: &Projected) -> (usize, usize) {
        let column = (point.u * self.cells_per_px) as usize;
        let row = (point.v * self.cells_per_px) as usize;
        (column.min(self.columns - 1), row.min(self.rows - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance = Tolerance {
        step_m: 0.05,
        step_share: 0.02,
        slope: 4.0,
    };

    fn check(near: Projected, far: Projected, is_visible: bool) {
        let buffer = RangeBuffer::new(&[far, near], &Equirectangular::default(), 4);
        assert_eq!(
            buffer.is_visible(&far, &TOLERANCE),
            is_visible,
            "{near:?} {far:?}"
        );
        assert!(buffer.is_visible(&near, &TOLERANCE));
    }

    fn at(u: f32, v: f32, range_m: f32) -> Projected {
        Projected { u, v, range_m }
    }

    #[test]
    fn the_wall_behind_a_post_is_hidden() {
        check(at(100.0, 100.0, 2.0), at(101.0, 100.0, 4.0), false);
        check(at(100.0, 100.0, 2.0), at(110.0, 100.0, 4.0), true); // beside the post
        check(at(1919.5, 100.0, 2.0), at(0.5, 100.0, 4.0), false); // across the seam
        check(at(100.0, 0.0, 2.0), at(100.0, 3.0, 4.0), false); // top edge
    }

    #[test]
    fn a_slanted_surface_does_not_hide_itself() {
        // Floor 1.2 m below, 4 m away: 2 rows of 0.1875 degrees are 0.09 m of range.
        check(at(100.0, 403.0, 4.0), at(100.0, 401.0, 4.13), true);
        check(at(100.0, 403.0, 4.0), at(100.0, 402.9, 4.3), false); // the same step straight behind
    }
}
