//! What the camera can see of a cloud, without any mask: the range buffer for every cell.

use nalgebra::Point3;

use crate::fast_projection::{BLOCK, FastProjection, PixelBlock, View};
use crate::range_buffer::{CellGrid, RangeBuffer, Tolerance, with_neighbours};
use crate::vector_loops::widest;
use crate::{Equirectangular, LabelConfig, LabelError};

/// For each point, in the camera frame, whether it is in the panorama and nothing nearer stands before it.
///
/// Of `config` only the cell's edge and what hides a point are used (`cell_px`, `hidden_step_m`, `hidden_step_share`,
/// `max_slope`). Points that are not finite, or in the camera's origin, are not visible. An empty cloud gives an empty answer.
///
/// ```
/// use nalgebra::Point3;
/// use omni_perception::*;
/// // A wall behind a post, and a wall beside it.
/// let points = [Point3::new(2.0, 0.0, 0.0), Point3::new(4.0, 0.0, 0.0), Point3::new(0.0, 4.0, 0.0)];
/// let visible = visible_points(&points, &Equirectangular::default(), &LabelConfig::default())?;
/// assert_eq!(visible, [true, false, true]);
/// # Ok::<(), LabelError>(())
/// ```
///
/// # Errors
/// [`LabelError`] for an unsound camera or configuration.
pub fn visible_points(
    points_in_camera: &[Point3<f32>],
    camera: &Equirectangular,
    config: &LabelConfig,
) -> Result<Vec<bool>, LabelError> {
    let mut visible = Vec::new();
    Visibility::new(camera, config)?.see(points_in_camera, &mut visible);
    Ok(visible)
}

/// [`visible_points`] for cloud after cloud, in the same memory.
#[derive(Debug, Clone)]
pub struct Visibility {
    tolerance: Tolerance,
    projection: FastProjection,
    buffer: RangeBuffer,
    /// Where each point falls.
    blocks: Vec<PixelBlock>,
    /// The least range of each cell and its neighbours in the row, and of all its neighbours.
    along_m: Vec<f32>,
    around_m: Vec<f32>,
}

impl Visibility {
    /// Takes about 20 bytes for each cell of the image.
    ///
    /// # Errors
    /// [`LabelError`] for an unsound camera or configuration.
    pub fn new(camera: &Equirectangular, config: &LabelConfig) -> Result<Visibility, LabelError> {
        camera.validate()?;
        config.validate()?;
        let buffer = RangeBuffer::empty(camera, CellGrid::bare(camera, config.cell_px));
        Ok(Visibility {
            tolerance: Tolerance::of(config),
            projection: FastProjection::new(camera),
            blocks: Vec::new(),
            along_m: buffer.range_m.clone(),
            around_m: buffer.range_m.clone(),
            buffer,
        })
    }

    /// Writes for each point, in the camera frame, whether the camera sees it. After the first cloud of a size nothing is
    /// allocated.
    pub fn see(&mut self, points_in_camera: &[Point3<f32>], visible: &mut Vec<bool>) {
        visible.clear();
        visible.resize(points_in_camera.len(), false);
        self.fill(points_in_camera);
        self.ask(visible);
    }

    /// Projects all points and keeps the nearest of each cell.
    fn fill(&mut self, points: &[Point3<f32>]) {
        let RangeBuffer { grid, range_m, at, .. } = &mut self.buffer;
        range_m.fill(f32::INFINITY);
        self.blocks.resize_with(points.len().div_ceil(BLOCK), PixelBlock::default);
        let (mut cells, mut before_m) = ([0; BLOCK], [0.0; BLOCK]);
        for (points, pixels) in points.chunks(BLOCK).zip(&mut self.blocks) {
            self.projection.project_block(points, &View::Camera, pixels);
            // What the rest of a block holds must not reach the cells.
            pixels.range_m[points.len()..].fill(0.0);
            grid.cells_of(pixels, &mut cells);
            // All cells are fetched before any is decided: the misses of the cache then overlap.
            gather(range_m, &cells, &mut before_m);
            for (index, &cell) in cells.iter().enumerate().take(points.len()) {
                let point_m = pixels.range_m[index];
                if point_m < before_m[index] && point_m > 0.0 && point_m < range_m[cell as usize] {
                    range_m[cell as usize] = point_m;
                    at[cell as usize] = (pixels.u[index], pixels.v[index]);
                }
            }
        }
        widest(
            #[inline(always)]
            || least_of_neighbours(range_m, grid.columns, &mut self.along_m, &mut self.around_m),
        );
    }

    /// For each of the points whether it is in the image and nothing nearer stands before it.
    fn ask(&self, visible: &mut [bool]) {
        let (mut cells, mut around_m, mut doubtful) = ([0; BLOCK], [0.0; BLOCK], [0; BLOCK]);
        for (visible, pixels) in visible.chunks_mut(BLOCK).zip(&self.blocks) {
            self.buffer.grid.cells_of(pixels, &mut cells);
            gather(&self.around_m, &cells, &mut around_m);
            let mut count = 0;
            for (index, visible) in visible.iter_mut().enumerate() {
                let range_m = pixels.range_m[index];
                // Most points have nothing nearer around them: one look, and no need to ask the neighbours one by one.
                let is_open = range_m - around_m[index] - self.tolerance.step_at(range_m) <= 0.0;
                *visible = range_m > 0.0 && is_open;
                // Without a branch that nobody can predict.
                doubtful[count] = index;
                count += usize::from(range_m > 0.0 && !is_open);
            }
            for &index in &doubtful[..count] {
                let at = (pixels.u[index], pixels.v[index]);
                visible[index] = self.buffer.is_visible(at, pixels.range_m[index], &self.tolerance);
            }
        }
    }
}

/// The numbers of a block's cells.
#[inline(always)]
fn gather(from: &[f32], cells: &[u32; BLOCK], into: &mut [f32; BLOCK]) {
    for (number, &cell) in into.iter_mut().zip(cells) {
        *number = from[cell as usize];
    }
}

/// The least of each cell and its eight neighbours; columns wrap.
#[inline(always)]
fn least_of_neighbours(range_m: &[f32], columns: usize, along: &mut [f32], around: &mut [f32]) {
    let least = |a: f32, b: f32| if b < a { b } else { a };
    // Along the rows first, then across them.
    for (row, along) in range_m.chunks_exact(columns).zip(along.chunks_exact_mut(columns)) {
        for (along, three) in along.iter_mut().skip(1).zip(row.windows(3)) {
            *along = least(least(three[0], three[1]), three[2]);
        }
        for column in [0, columns - 1] {
            let [left, column, right] = with_neighbours(column, columns);
            along[column] = least(least(row[left], row[column]), row[right]);
        }
    }
    around.copy_from_slice(along);
    if along.len() > columns {
        around[columns..].iter_mut().zip(&*along).for_each(|(around, above)| *around = least(*around, *above));
        around.iter_mut().zip(&along[columns..]).for_each(|(around, below)| *around = least(*around, *below));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mask_index::{Erosion, MaskIndex};
    use crate::mask_outline::Outline;
    use crate::{Mask, Rle};

    proptest! {
        #[test]
        fn the_short_way_to_visibility_is_the_long_one(
            points in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f32), 0..400), width_px in 3..60_u32, cell_px in 1..5_u32
        ) {
            let camera = Equirectangular { width_px, height_px: 11, ..Equirectangular::default() };
            let points: Vec<Point3<f32>> = points.into_iter().map(Point3::from).chain([Point3::new(f32::NAN, 0.0, 0.0)]).collect();
            let config = LabelConfig { cell_px, ..LabelConfig::default() };
            let mut visibility = Visibility::new(&camera, &config).expect("sound");
            let mut visible = Vec::new();
            // Twice: nothing of the first cloud is left.
            for cloud in [&points[points.len() / 2..], &points] {
                visibility.see(cloud, &mut visible);
            }
            // A mask over the whole image: each point of the image is a candidate, and asks all its neighbours.
            let rle = Rle::from_counts(width_px, 11, &[0, width_px * 11]).expect("fills the image");
            let masks = [Mask::new(rle, "all", 1.0)];
            let outlines = [Outline::new(&masks[0].rle)];
            let none = Erosion { radius_px: 0, min_kept_share: 0.0 };
            let index = MaskIndex::new(&masks, &outlines, width_px, 11, &none);
            let filled = RangeBuffer::fill(&points, &View::Camera, &camera, cell_px, &index);
            let mut expected = vec![false; points.len()];
            for candidate in &filled.candidates {
                expected[candidate.point as usize] = filled.buffer.is_visible((candidate.u, candidate.v), candidate.range_m, &Tolerance::of(&config));
            }
            prop_assert_eq!(visible, expected);
        }
    }
}
