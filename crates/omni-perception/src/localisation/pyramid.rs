//! The map as the search sees it: where something is at which height, and the same blurred over larger and larger windows.
//!
//! Level h holds for each cell what level 0 holds anywhere in the window of 2^h x 2^h cells that begins there. So what a scan scores
//! at level h bounds what it scores at any of the 4^h poses of the window (Hess, Kohler, Rapp, Andor, "Real-time loop closure in 2D
//! LIDAR SLAM", ICRA 2016; here with a bit per slice of height instead of a probability).

use nalgebra::{Point2, Point3};

use crate::localisation::columns::{Column, slices_of};

/// Levels above the finest: windows of 32 cells.
pub const TOP: usize = 5;
/// Larger maps are refused: cells of all levels together take two bytes each.
pub const MOST_CELLS: usize = 1 << 25;

/// Slices per cell at all levels.
#[derive(Debug, Clone)]
pub struct Pyramid {
    cell_m: f64,
    /// Corner of the padded grid.
    corner: Point2<f64>,
    width: usize,
    height: usize,
    levels: Vec<Vec<u16>>,
}

/// A column turned by some yaw: offset in cells from the cell of the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// East.
    pub x: i32,
    /// North.
    pub y: i32,
    /// What is there.
    pub slices: u16,
}

impl Pyramid {
    /// From the points of a map. A point counts for its own cell and the eight around it. `None` if no point lies in the band,
    /// or the number of cells if there would be too many.
    pub fn new(map: &[Point3<f32>], band_m: (f64, f64), cell_m: f64) -> Result<Option<Pyramid>, usize> {
        let points: Vec<(Point2<f64>, u16)> = map
            .iter()
            .map(|p| p.cast::<f64>())
            .filter(|p| p.x.is_finite() && p.y.is_finite())
            .map(|p| (Point2::new(p.x, p.y), slices_of(p.z, band_m, true)))
            .filter(|(_, slices)| *slices != 0)
            .collect();
        let Some((first, _)) = points.first() else { return Ok(None) };
        let (mut low, mut high) = (first.coords, first.coords);
        for (point, _) in &points {
            low = low.inf(&point.coords);
            high = high.sup(&point.coords);
        }
        // One cell for the neighbours, and to the west and south a window of the top level, which may begin outside.
        let pad = (1 << TOP) as f64;
        let corner = low.map(|c| ((c / cell_m).floor() - pad - 1.0) * cell_m);
        let size = (high - corner).map(|c| (c / cell_m).floor() + 3.0);
        let cells = size.x * size.y * (TOP + 1) as f64;
        if cells > MOST_CELLS as f64 {
            return Err(cells as usize);
        }
        let (width, height) = (size.x as usize, size.y as usize);
        let mut finest = vec![0u16; width * height];
        for (point, slices) in &points {
            let (x, y) = (((point.x - corner.x) / cell_m) as usize, ((point.y - corner.y) / cell_m) as usize);
            for row in y - 1..=y + 1 {
                for cell in &mut finest[row * width + x - 1..=row * width + x + 1] {
                    *cell |= slices;
                }
            }
        }
        let mut levels = vec![finest];
        for level in 0..TOP {
            levels.push(twice_as_wide(&levels[level], width, height, 1 << level));
        }
        Ok(Some(Pyramid { cell_m, corner: corner.into(), width, height, levels }))
    }

    /// Cells of the poses that the map spans: first, and one past the last, in each direction.
    pub fn domain(&self) -> ([i32; 2], [i32; 2]) {
        let pad = 1 << TOP;
        ([pad, pad], [self.width as i32, self.height as i32])
    }

    /// Middle of a cell.
    pub fn center_of(&self, cell: [i32; 2]) -> Point2<f64> {
        self.corner + nalgebra::Vector2::new(f64::from(cell[0]) + 0.5, f64::from(cell[1]) + 0.5) * self.cell_m
    }

    /// The columns turned by `yaw_rad`.
    pub fn turned(&self, columns: &[Column], yaw_rad: f64) -> Vec<Offset> {
        let (sin, cos) = yaw_rad.sin_cos();
        let cells = |m: f64| (m / self.cell_m + 0.5).floor() as i32;
        columns
            .iter()
            .map(|column| {
                let (x, y) = (column.at.x, column.at.y);
                Offset { x: cells(cos * x - sin * y), y: cells(sin * x + cos * y), slices: column.slices }
            })
            .collect()
    }

    /// Slices of the scan that the map has too, with the scan in `cell`; at a level above zero the bound over the window.
    pub fn score(&self, scan: &[Offset], cell: [i32; 2], level: usize) -> u32 {
        let (grid, width, height) = (&self.levels[level], self.width as u32, self.height as u32);
        scan.iter()
            .map(|offset| {
                let (x, y) = ((cell[0] + offset.x) as u32, (cell[1] + offset.y) as u32);
                // Negative numbers have become huge.
                if x < width && y < height { (grid[(y * width + x) as usize] & offset.slices).count_ones() } else { 0 }
            })
            .sum()
    }
}

/// From windows of `half` cells to windows of twice that.
fn twice_as_wide(grid: &[u16], width: usize, height: usize, half: usize) -> Vec<u16> {
    let mut wide = grid.to_vec();
    for y in 0..height {
        for x in 0..width - half.min(width) {
            wide[y * width + x] |= grid[y * width + x + half];
        }
    }
    for at in 0..(height - half.min(height)) * width {
        // Rows above are not yet changed.
        wide[at] |= wide[at + half * width];
    }
    wide
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_found_in_its_cell_and_around_it_and_bounds_hold_from_afar() {
        let pyramid = Pyramid::new(&[Point3::new(3.05, -1.95, 1.0)], (0.2, 1.8), 0.1).unwrap().unwrap();
        let (low, high) = pyramid.domain();
        let scan = [Offset { x: 0, y: 0, slices: u16::MAX }];
        let hits: Vec<[i32; 2]> = (low[0] - 40..high[0] + 4)
            .flat_map(|x| (low[1] - 40..high[1] + 4).map(move |y| [x, y]))
            .filter(|cell| pyramid.score(&scan, *cell, 0) > 0)
            .collect();
        assert_eq!(hits.len(), 9);
        assert!((pyramid.center_of(hits[4]) - Point2::new(3.05, -1.95)).norm() < 1e-9);
        for level in 1..=TOP {
            let reach = (1 << level) - 1;
            assert!(pyramid.score(&scan, [hits[0][0] - reach, hits[0][1] - reach], level) > 0);
            assert_eq!(pyramid.score(&scan, [hits[8][0] + 1, hits[0][1]], level), 0);
        }
    }

    #[test]
    fn maps_without_points_or_of_the_size_of_a_country_are_no_grid() {
        assert!(Pyramid::new(&[], (0.2, 1.8), 0.1).unwrap().is_none());
        assert!(Pyramid::new(&[Point3::new(0.0, 0.0, 9.0)], (0.2, 1.8), 0.1).unwrap().is_none());
        let far = [Point3::new(0.0, 0.0, 1.0), Point3::new(1e6, 1e6, 1.0)];
        assert!(Pyramid::new(&far, (0.2, 1.8), 0.1).is_err());
    }
}
