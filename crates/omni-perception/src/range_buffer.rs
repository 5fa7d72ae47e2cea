//! What the camera can see: the nearest point in every cell of the panorama.
//!
//! The LiDAR sits elsewhere than the camera and saw its points at other times, so some of them are hidden from the camera
//! behind nearer things. A point is hidden if a nearer point lies in front of it within the neighbouring cells and
//! the step in range is steeper than a surface could be.

use nalgebra::Point3;

use crate::fast_projection::FastProjection;
use crate::{Equirectangular, Span};

/// Nearest points by cell, with wrap at the seam. Only cells near a mask are kept: nothing else is asked for.
#[derive(Debug, Clone)]
pub(crate) struct RangeBuffer {
    grid: CellGrid,
    width: f32,
    rad_per_px: f32,
    cells: Vec<Nearest>,
}

/// A point near a mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) range_m: f32,
    /// Index of the point.
    pub(crate) point: u32,
}

#[derive(Debug, Clone, Copy)]
struct Nearest {
    u: f32,
    v: f32,
    range_m: f32,
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

/// The cells of an image, and which of them are near a mask.
#[derive(Debug, Clone)]
pub(crate) struct CellGrid {
    columns: usize,
    rows: usize,
    cells_per_px: f32,
    is_near_mask: Vec<bool>,
}

impl CellGrid {
    pub(crate) fn new(camera: &Equirectangular, cell_px: u32) -> CellGrid {
        let columns = camera.width_px.div_ceil(cell_px) as usize;
        let rows = camera.height_px.div_ceil(cell_px) as usize;
        let is_near_mask = vec![false; columns * rows];
        CellGrid { columns, rows, cells_per_px: 1.0 / cell_px as f32, is_near_mask }
    }

    /// Marks the cells of a span and all around them.
    pub(crate) fn mark(&mut self, span: &Span) {
        let (column, top) = self.cell_of(span.column as f32, span.top as f32);
        let (_, bottom) = self.cell_of(span.column as f32, (span.bottom - 1) as f32);
        let rows = top.saturating_sub(1)..=(bottom + 1).min(self.rows - 1);
        for column in self.with_neighbours(column) {
            for row in rows.clone() {
                self.is_near_mask[row * self.columns + column] = true;
            }
        }
    }

    fn cell_of(&self, u: f32, v: f32) -> (usize, usize) {
        let (column, row) = ((u * self.cells_per_px) as usize, (v * self.cells_per_px) as usize);
        (column.min(self.columns - 1), row.min(self.rows - 1))
    }

    /// The column between its neighbours; they wrap behind the camera.
    fn with_neighbours(&self, column: usize) -> [usize; 3] {
        let left = if column == 0 { self.columns - 1 } else { column - 1 };
        let right = if column + 1 == self.columns { 0 } else { column + 1 };
        [left, column, right]
    }
}

/// Result of [`RangeBuffer::fill`].
pub(crate) struct Filled {
    pub(crate) buffer: RangeBuffer,
    /// The points near a mask, in their order.
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) non_finite: usize,
    pub(crate) outside_image: usize,
}

impl RangeBuffer {
    /// Projects all points and keeps the nearest of each cell near a mask.
    pub(crate) fn fill(points: &[Point3<f32>], camera: &Equirectangular, grid: CellGrid) -> Filled {
        let projection = FastProjection::new(camera);
        let far = Nearest { u: 0.0, v: 0.0, range_m: f32::INFINITY };
        let mut cells = vec![far; grid.is_near_mask.len()];
        let mut candidates = Vec::new();
        let (mut non_finite, mut outside_image) = (0, 0);
        // Blocks, so that the projection is a plain loop over an array.
        const BLOCK: usize = 256;
        let mut pixels = [(0.0, 0.0, 0.0); BLOCK];
        for (block, points) in points.chunks(BLOCK).enumerate() {
            for (pixel, point) in pixels.iter_mut().zip(points) {
                *pixel = projection.project(point);
            }
            for (index, (&(u, v, range_m), point)) in pixels.iter().zip(points).enumerate() {
                if range_m == 0.0 {
                    let is_finite = point.iter().all(|x| x.is_finite());
                    *(if is_finite { &mut outside_image } else { &mut non_finite }) += 1;
                    continue;
                }
                let (column, row) = grid.cell_of(u, v);
                let cell = row * grid.columns + column;
                if grid.is_near_mask[cell] {
                    candidates.push(Candidate { u, v, range_m, point: (block * BLOCK + index) as u32 });
                    if range_m < cells[cell].range_m {
                        cells[cell] = Nearest { u, v, range_m };
                    }
                }
            }
        }
        let (width, rad_per_px) = (camera.width_px as f32, camera.row_angle_rad() as f32);
        let buffer = RangeBuffer { grid, width, rad_per_px, cells };
        Filled { buffer, candidates, non_finite, outside_image }
    }

    /// Whether nothing nearer stands before the point. The point must be in the image.
    pub(crate) fn is_visible(&self, point: &Candidate, tolerance: &Tolerance) -> bool {
        let step_m = tolerance.step_m.max(tolerance.step_share * point.range_m);
        let slope_per_px = tolerance.slope * self.rad_per_px;
        let (column, row) = self.grid.cell_of(point.u, point.v);
        let (first, last) = (row.saturating_sub(1), (row + 1).min(self.grid.rows - 1));
        let columns = self.grid.with_neighbours(column);
        (first..=last).all(|row| {
            columns.into_iter().all(|column| {
                let near = &self.cells[row * self.grid.columns + column];
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
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance = Tolerance { step_m: 0.05, step_share: 0.02, slope: 8.0 };

    /// Points in the directions of (u, v) at a range: does the first hide the second?
    fn check(near: (f64, f64, f64), far: (f64, f64, f64), is_visible: bool) {
        let camera = Equirectangular::default();
        let mut grid = CellGrid::new(&camera, 2);
        grid.mark(&Span { column: far.0 as u32, top: far.1 as u32, bottom: far.1 as u32 + 1 });
        let point = |(u, v, range)| Point3::from(camera.unproject(u, v).into_inner() * range).cast::<f32>();
        let filled = RangeBuffer::fill(&[point(far), point(near)], &camera, grid);
        let candidate = filled.candidates[0];
        assert_eq!(candidate.point, 0);
        assert_eq!(filled.buffer.is_visible(&candidate, &TOLERANCE), is_visible, "{near:?} {far:?}");
        assert!(filled.candidates[1..].iter().all(|near| filled.buffer.is_visible(near, &TOLERANCE)));
    }

    #[test]
    fn the_wall_behind_a_post_is_hidden() {
        check((100.0, 100.0, 2.0), (101.0, 100.0, 4.0), false);
        check((100.0, 100.0, 2.0), (110.0, 100.0, 4.0), true); // beside the post
        check((1919.5, 100.0, 2.0), (0.5, 100.0, 4.0), false); // across the seam
        check((100.0, 0.5, 2.0), (100.0, 3.0, 4.0), false); // top edge
    }

    #[test]
    fn a_slanted_surface_does_not_hide_itself() {
        // A table top 0.4 m below, 2 m away: two rows of 0.1875 degrees are 0.07 m of range.
        check((100.0, 382.0, 2.0), (100.0, 380.0, 2.07), true);
        check((100.0, 382.0, 2.0), (100.0, 381.9, 2.2), false); // a larger step straight behind
    }
}
