//! What the camera can see: the nearest point in every cell of the panorama.
//!
//! The LiDAR sits elsewhere than the camera and saw its points at other times, so some of them are hidden from the camera
//! behind nearer things. A point is hidden if a nearer point lies in front of it within the neighbouring cells and
//! the step in range is steeper than a surface could be.

use nalgebra::Point3;

use crate::fast_projection::{BLOCK, FastProjection, PixelBlock, View};
use crate::mask_index::{MAX_MASKS, MaskIndex};
use crate::vector_loops::widest;
use crate::{Equirectangular, LabelConfig};

/// Nearest points by cell, with wrap at the seam. [`RangeBuffer::fill`] keeps only cells near a mask: nothing else is asked for.
#[derive(Debug, Clone)]
pub(crate) struct RangeBuffer {
    pub(crate) grid: CellGrid,
    width: f32,
    rad_per_px: f32,
    /// Range of the nearest point of each cell; infinite without one.
    pub(crate) range_m: Vec<f32>,
    /// Where in the image it lies.
    pub(crate) at: Vec<(f32, f32)>,
}

/// A point whose pixel shows a mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) range_m: f32,
    /// Index of the point.
    pub(crate) point: u32,
    pub(crate) mask: u16,
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

impl Tolerance {
    pub(crate) fn of(config: &LabelConfig) -> Tolerance {
        Tolerance { step_m: config.hidden_step_m, step_share: config.hidden_step_share, slope: config.max_slope }
    }

    /// A nearer point by no more than this does not hide one at a range.
    pub(crate) fn step_at(&self, range_m: f32) -> f32 {
        self.step_m.max(self.step_share * range_m)
    }
}

/// The cells of an image, and what each shows: the mask that fills it, or one of the notes below.
#[derive(Debug, Clone)]
pub(crate) struct CellGrid {
    pub(crate) columns: usize,
    rows: usize,
    cells_per_px: f32,
    shows: Vec<u16>,
    /// One bit a cell: whether it shows anything but [`FAR`]. Most points end here, and 40 kB stay in the first cache.
    is_near: Vec<u64>,
}

/// No mask in this cell or its neighbours.
const FAR: u16 = u16::MAX;
/// No mask, but one in a neighbouring cell.
const NEAR: u16 = u16::MAX - 1;
/// A mask in a part of the cell, or several: the pixel decides.
const MIXED: u16 = u16::MAX - 2;
const _: () = assert!(MAX_MASKS <= MIXED as usize);

impl CellGrid {
    /// The cells alone: they show nothing.
    pub(crate) fn bare(camera: &Equirectangular, cell_px: u32) -> CellGrid {
        let columns = camera.width_px.div_ceil(cell_px) as usize;
        let rows = camera.height_px.div_ceil(cell_px) as usize;
        CellGrid { columns, rows, cells_per_px: 1.0 / cell_px as f32, shows: Vec::new(), is_near: Vec::new() }
    }

    fn new(camera: &Equirectangular, cell_px: u32, masks: &MaskIndex) -> CellGrid {
        let mut grid = CellGrid::bare(camera, cell_px);
        grid.shows = vec![FAR; grid.columns * grid.rows];
        grid.paint(camera, cell_px, masks);
        grid.mark_neighbours();
        let bits = |cells: &[u16]| cells.iter().rev().fold(0, |bits, cell| bits << 1 | u64::from(*cell != FAR));
        grid.is_near = grid.shows.chunks(64).map(bits).collect();
        grid
    }

    /// Fills cells with their mask, or [`MIXED`].
    fn paint(&mut self, camera: &Equirectangular, cell_px: u32, masks: &MaskIndex) {
        // Pixels of the one mask seen so far in each cell of the present column of cells.
        let mut filled = vec![0_u32; self.rows];
        let mut spans = masks.spans().peekable();
        for column in 0..self.columns {
            filled.fill(0);
            let end = (column as u32 + 1) * cell_px;
            while let Some((span, mask)) = spans.next_if(|(span, _)| span.column < end) {
                for row in span.top / cell_px..=(span.bottom - 1) / cell_px {
                    let part = span.bottom.min((row + 1) * cell_px) - span.top.max(row * cell_px);
                    let cell = &mut self.shows[row as usize * self.columns + column];
                    *cell = if *cell == FAR || *cell == mask { mask } else { MIXED };
                    filled[row as usize] += part;
                }
            }
            let width = end.min(camera.width_px) - column as u32 * cell_px;
            for (row, filled) in filled.iter().enumerate() {
                let height = camera.height_px.min((row as u32 + 1) * cell_px) - row as u32 * cell_px;
                if *filled > 0 && *filled < width * height {
                    self.shows[row * self.columns + column] = MIXED;
                }
            }
        }
    }

    /// Turns [`FAR`] into [`NEAR`] around the cells that show something; columns wrap.
    fn mark_neighbours(&mut self) {
        let columns = self.columns;
        let shown: Vec<bool> = self.shows.iter().map(|cell| *cell != FAR).collect();
        let of_row = |row: usize| shown.get(row.checked_mul(columns)?..)?.get(..columns);
        // Which columns show something in this row of cells or the ones above and below, and with their neighbours.
        let (mut near, mut wide) = (vec![false; columns], vec![false; columns]);
        for row in 0..self.rows {
            near.fill(false);
            for other in [row.wrapping_sub(1), row, row + 1].into_iter().filter_map(of_row) {
                near.iter_mut().zip(other).for_each(|(near, other)| *near |= other);
            }
            if !near.contains(&true) {
                continue;
            }
            wide.copy_from_slice(&near);
            wide[1..].iter_mut().zip(&near).for_each(|(wide, left)| *wide |= left);
            wide.iter_mut().zip(&near[1..]).for_each(|(wide, right)| *wide |= right);
            wide[0] |= near[columns - 1];
            wide[columns - 1] |= near[0];
            let cells = &mut self.shows[row * columns..(row + 1) * columns];
            for (cell, wide) in cells.iter_mut().zip(&wide) {
                *cell = if *wide && *cell == FAR { NEAR } else { *cell };
            }
        }
    }

    /// The cell of a position in the image: column and row. Middles of pixels are multiplied, so that rounding moves none
    /// into the next cell.
    #[inline(always)]
    fn cell_of(&self, u: f32, v: f32) -> (u32, u32) {
        let cell = |x: f32| whole((floor(x) + 0.5) * self.cells_per_px);
        (cell(u), cell(v))
    }

    /// The same for a block of pixels, as indices.
    pub(crate) fn cells_of(&self, pixels: &PixelBlock, cells: &mut [u32; BLOCK]) {
        let columns = self.columns as u32; // at most 32768 squared: a u32 holds all cells
        widest(
            #[inline(always)]
            || {
                for ((cell, u), v) in cells.iter_mut().zip(&pixels.u).zip(&pixels.v) {
                    let (column, row) = self.cell_of(*u, *v);
                    *cell = row * columns + column;
                }
            },
        );
    }
}

/// From here on single precision has whole numbers only.
const WHOLE_FROM: f32 = 8_388_608.0;

/// The whole part of a number from 0 to 2^22, still as a float. Additions and a comparison, which become vector instructions; a cast
/// with its checks does not.
#[inline(always)]
fn floor(x: f32) -> f32 {
    let nearest = (x + WHOLE_FROM) - WHOLE_FROM;
    nearest - if nearest > x { 1.0 } else { 0.0 }
}

/// The same as an integer: the last bits of a float in which only whole numbers have room.
#[inline(always)]
fn whole(x: f32) -> u32 {
    (floor(x) + WHOLE_FROM).to_bits() - WHOLE_FROM.to_bits()
}

/// The column between its neighbours; they wrap behind the camera.
pub(crate) fn with_neighbours(column: usize, columns: usize) -> [usize; 3] {
    let left = if column == 0 { columns - 1 } else { column - 1 };
    let right = if column + 1 == columns { 0 } else { column + 1 };
    [left, column, right]
}

/// Result of [`RangeBuffer::fill`].
pub(crate) struct Filled {
    pub(crate) buffer: RangeBuffer,
    /// The points whose pixel shows a mask, in their order.
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) non_finite: usize,
    pub(crate) outside_image: usize,
}

impl RangeBuffer {
    /// Nothing seen yet.
    pub(crate) fn empty(camera: &Equirectangular, grid: CellGrid) -> RangeBuffer {
        let cells = grid.columns * grid.rows;
        RangeBuffer {
            grid,
            width: camera.width_px as f32,
            rad_per_px: camera.row_angle_rad() as f32,
            range_m: vec![f32::INFINITY; cells],
            at: vec![(0.0, 0.0); cells],
        }
    }

    /// Projects all points and keeps the nearest of each cell near a mask.
    pub(crate) fn fill(
        points: &[Point3<f32>],
        view: &View,
        camera: &Equirectangular,
        cell_px: u32,
        masks: &MaskIndex,
    ) -> Filled {
        let mut buffer = RangeBuffer::empty(camera, CellGrid::new(camera, cell_px, masks));
        let RangeBuffer { grid, range_m: nearest_m, at, .. } = &mut buffer;
        let projection = FastProjection::new(camera);
        let mut candidates = Vec::with_capacity(points.len() / 4);
        let (mut non_finite, mut outside_image) = (0, 0);
        let (mut pixels, mut cells) = (PixelBlock::default(), [0; BLOCK]);
        for (block, points) in points.chunks(BLOCK).enumerate() {
            projection.project_block(points, view, &mut pixels);
            grid.cells_of(&pixels, &mut cells);
            for (index, point) in points.iter().enumerate() {
                let (u, v, range_m) = (pixels.u[index], pixels.v[index], pixels.range_m[index]);
                if range_m == 0.0 {
                    let is_finite = point.iter().all(|x| x.is_finite());
                    *(if is_finite { &mut outside_image } else { &mut non_finite }) += 1;
                    continue;
                }
                let cell = cells[index] as usize;
                if grid.is_near[cell / 64] >> (cell % 64) & 1 == 0 {
                    continue;
                }
                let shows = grid.shows[cell];
                if range_m < nearest_m[cell] {
                    nearest_m[cell] = range_m;
                    at[cell] = (u, v);
                }
                let mask = match shows {
                    NEAR => None,
                    MIXED => masks.mask_at(u as u32, v as u32),
                    mask => Some(mask),
                };
                if let Some(mask) = mask {
                    candidates.push(Candidate { u, v, range_m, point: (block * BLOCK + index) as u32, mask });
                }
            }
        }
        Filled { buffer, candidates, non_finite, outside_image }
    }

    /// Whether nothing nearer stands before a point at a place of the image.
    pub(crate) fn is_visible(&self, (u, v): (f32, f32), range_m: f32, tolerance: &Tolerance) -> bool {
        let step_m = tolerance.step_at(range_m);
        let slope_per_px = tolerance.slope * self.rad_per_px;
        let (column, row) = self.grid.cell_of(u, v);
        let (column, row) = (column as usize, row as usize);
        let (first, last) = (row.saturating_sub(1), (row + 1).min(self.grid.rows - 1));
        let columns = with_neighbours(column, self.grid.columns);
        for row in first..=last {
            for column in columns {
                let cell = row * self.grid.columns + column;
                let near_m = self.range_m[cell];
                let excess_m = range_m - near_m - step_m;
                if excess_m <= 0.0 {
                    continue;
                }
                let at = self.at[cell];
                let across = (u - at.0).abs();
                let across = across.min(self.width - across);
                let down = v - at.1;
                let allowed_m = slope_per_px * near_m;
                if excess_m * excess_m > allowed_m * allowed_m * (across * across + down * down) {
                    return false;
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask_index::Erosion;
    use crate::mask_outline::Outline;
    use crate::{Mask, Rle};

    const TOLERANCE: Tolerance = Tolerance { step_m: 0.05, step_share: 0.02, slope: 8.0 };

    /// Points in the directions of (u, v) at a range: does the first hide the second?
    fn check(near: (f64, f64, f64), far: (f64, f64, f64), is_visible: bool) {
        let camera = Equirectangular::default();
        let rle = Rle::from_counts(1920, 640, &[0, 1920 * 640]).expect("fills the image");
        let masks = [Mask::new(rle, "wall", 1.0)];
        let outlines = [Outline::new(&masks[0].rle)];
        let none = Erosion { radius_px: 0, min_kept_share: 0.0 };
        let index = MaskIndex::new(&masks, &outlines, 1920, 640, &none);
        let point = |(u, v, range)| Point3::from(camera.unproject(u, v).into_inner() * range).cast::<f32>();
        let filled = RangeBuffer::fill(&[point(far), point(near)], &View::Camera, &camera, 2, &index);
        let candidate = filled.candidates[0];
        assert_eq!((candidate.point, candidate.mask), (0, 0));
        assert_eq!(
            filled.buffer.is_visible((candidate.u, candidate.v), candidate.range_m, &TOLERANCE),
            is_visible,
            "{near:?} {far:?}"
        );
        let sees = |point: &Candidate| filled.buffer.is_visible((point.u, point.v), point.range_m, &TOLERANCE);
        assert!(filled.candidates[1..].iter().all(sees));
    }

    #[test]
    fn whole_parts_are_those_of_a_cast() {
        for step in 0..200_000_u32 {
            let x = step as f32 * 0.163_7;
            for x in [x, x.floor(), x.floor().next_down().max(0.0), x.floor().next_up()] {
                assert_eq!((floor(x), whole(x)), (x.floor(), x as u32), "{x}");
            }
        }
    }

    #[test]
    fn cells_say_what_their_pixels_show() {
        for (width_px, height_px, cell_px) in [(40, 12, 2), (41, 13, 3), (7, 5, 4), (3, 3, 1), (5, 2, 9)] {
            let camera = Equirectangular { width_px, height_px, ..Equirectangular::default() };
            let of = |is_set: &dyn Fn(u32, u32) -> bool| {
                let pixels: Vec<bool> = (0..width_px * height_px).map(|i| is_set(i % width_px, i / width_px)).collect();
                Mask::new(Rle::from_rows(width_px, height_px, &pixels).expect("all pixels"), "thing", 0.5)
            };
            let masks = [of(&|u, v| u < 9 && v < 9), of(&|u, v| (u + 2 * v) % 23 == 3), of(&|u, _| u == 40)];
            let outlines: Vec<Outline> = masks.iter().map(|mask| Outline::new(&mask.rle)).collect();
            let none = Erosion { radius_px: 0, min_kept_share: 0.0 };
            let index = MaskIndex::new(&masks, &outlines, width_px, height_px, &none);
            let grid = CellGrid::new(&camera, cell_px, &index);
            for (u, v) in (0..width_px).flat_map(|u| (0..height_px).map(move |v| (u, v))) {
                let (column, row) = grid.cell_of(u as f32 + 0.99, v as f32);
                assert_eq!((column, row), (u / cell_px, v / cell_px));
                let (column, row) = (column as usize, row as usize);
                let cell = |column: usize, row: usize| grid.shows[row * grid.columns + column];
                let pixel = index.mask_at(u, v);
                match cell(column, row) {
                    FAR | NEAR => assert_eq!(pixel, None),
                    MIXED => {}
                    mask => assert_eq!(pixel, Some(mask)),
                }
                let around = (row.saturating_sub(1)..=(row + 1).min(grid.rows - 1))
                    .flat_map(|row| with_neighbours(column, grid.columns).map(|column| cell(column, row)));
                let is_shown = |shows: u16| !matches!(shows, FAR | NEAR);
                let index = row * grid.columns + column;
                assert_eq!(grid.is_near[index / 64] >> (index % 64) & 1 == 0, cell(column, row) == FAR);
                assert_eq!(cell(column, row) == FAR, !around.into_iter().any(is_shown), "{u} {v}");
            }
        }
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
