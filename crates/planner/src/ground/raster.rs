//! A map of polygons as a grid of cells, for robots that are no points.

use nalgebra::Point2;

use super::grid::{GridView, MAX_CELLS};
use super::polygon_map::PolygonError;

/// Cells of a map of polygons: free only if the whole square is.
#[derive(Debug, Clone)]
pub struct Raster {
    origin: Point2<f64>,
    resolution_m: f64,
    width: usize,
    height: usize,
    blocked: Vec<bool>,
}

impl Raster {
    /// Rings in metres: free space lies inside `outer` and outside the `holes`. Cells have sides of `resolution_m`, or longer
    /// ones where there would be more than a planner takes.
    ///
    /// # Errors
    /// A ring of fewer than three corners, or a coordinate that is not finite.
    pub fn new(outer: &[Point2<f64>], holes: &[Vec<Point2<f64>>], resolution_m: f64) -> Result<Raster, PolygonError> {
        let rings: Vec<&[Point2<f64>]> = std::iter::once(outer).chain(holes.iter().map(Vec::as_slice)).collect();
        for (ring, corners) in rings.iter().enumerate() {
            if corners.len() < 3 {
                return Err(PolygonError::NoRing { ring, count: corners.len() });
            }
            if let Some(corner) = corners.iter().position(|p| !(p.x.abs() <= 1e9 && p.y.abs() <= 1e9)) {
                return Err(PolygonError::NotFinite { ring, corner });
            }
        }
        let (low, high) = outer.iter().fold((outer[0], outer[0]), |(low, high), p| (low.inf(p), high.sup(p)));
        let size = high - low;
        // A part of a cell at each end, so the square root of the area is not quite enough.
        let least_m = (size.x * size.y / MAX_CELLS as f64).sqrt() * 1.001 + (size.x + size.y) / MAX_CELLS as f64;
        let resolution_m = resolution_m.max(least_m).max(1e-9);
        let cells = |length: f64| (length / resolution_m).ceil().max(1.0) as usize;
        let (width, height) = (cells(size.x), cells(size.y));
        let mut raster = Raster { origin: low, resolution_m, width, height, blocked: vec![true; width * height] };
        raster.free_inside(&rings);
        for ring in &rings {
            for (k, corner) in ring.iter().enumerate() {
                raster.block_along(corner, &ring[(k + 1) % ring.len()]);
            }
        }
        Ok(raster)
    }

    /// What the planner reads.
    pub fn view(&self) -> GridView<'_> {
        GridView {
            origin: self.origin,
            resolution_m: self.resolution_m,
            width: self.width,
            height: self.height,
            blocked: &self.blocked,
        }
    }

    /// Frees the cells whose middle lies inside an odd number of rings.
    fn free_inside(&mut self, rings: &[&[Point2<f64>]]) {
        let mut crossings: Vec<f64> = Vec::new();
        for iy in 0..self.height {
            let y = self.origin.y + (iy as f64 + 0.5) * self.resolution_m;
            crossings.clear();
            for ring in rings {
                for (k, a) in ring.iter().enumerate() {
                    let b = &ring[(k + 1) % ring.len()];
                    if (a.y > y) != (b.y > y) {
                        crossings.push(a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)));
                    }
                }
            }
            crossings.sort_by(f64::total_cmp);
            for span in crossings.chunks_exact(2) {
                let column = |x: f64| ((x - self.origin.x) / self.resolution_m - 0.5).ceil().max(0.0) as usize;
                let (first, end) = (column(span[0]), column(span[1]).min(self.width));
                if first < end {
                    self.blocked[iy * self.width + first..iy * self.width + end].fill(false);
                }
            }
        }
    }

    /// Blocks the cells whose inside a side passes; a side along the border of two cells blocks neither.
    fn block_along(&mut self, a: &Point2<f64>, b: &Point2<f64>) {
        let cell = |p: &Point2<f64>| (p - self.origin) / self.resolution_m;
        let (mut from, mut to) = (cell(a), cell(b));
        if from.y > to.y {
            (from, to) = (to, from);
        }
        // Rounding of a side that lies on a border of cells.
        const SLACK: f64 = 1e-9;
        let (first, last) = ((from.y + SLACK).floor().max(0.0), (to.y - SLACK).floor().min(self.height as f64 - 1.0));
        let mut row = first;
        while row <= last {
            let x_at = |y: f64| from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y)).clamp(0.0, 1.0);
            let (x0, x1) = (x_at(row.max(from.y)), x_at((row + 1.0).min(to.y)));
            let low = (x0.min(x1) + SLACK).floor().max(0.0) as usize;
            let high = ((x0.max(x1) - SLACK).ceil().max(0.0) as usize).min(self.width);
            if low < high {
                let start = row as usize * self.width;
                self.blocked[start + low..start + high].fill(true);
            }
            row += 1.0;
        }
        // A side along a row, inside it.
        if (to.y - from.y).abs() <= SLACK && from.y.fract() > SLACK && from.y.fract() < 1.0 - SLACK {
            let row = from.y.floor();
            let low = (from.x.min(to.x) + SLACK).floor().max(0.0) as usize;
            let high = ((from.x.max(to.x) - SLACK).ceil().max(0.0) as usize).min(self.width);
            if row >= 0.0 && (row as usize) < self.height && low < high {
                let start = row as usize * self.width;
                self.blocked[start + low..start + high].fill(true);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A star round the origin.
    fn star(radii: &[f64], turn: f64) -> Vec<Point2<f64>> {
        let n = radii.len() as f64;
        let angle = |k: usize| turn + std::f64::consts::TAU * k as f64 / n;
        radii.iter().enumerate().map(|(k, r)| Point2::new(r * angle(k).cos(), r * angle(k).sin())).collect()
    }

    fn is_inside(ring: &[Point2<f64>], p: &Point2<f64>) -> bool {
        (0..ring.len()).fold(false, |inside, k| {
            let (a, b) = (&ring[k], &ring[(k + 1) % ring.len()]);
            inside ^ ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y))
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_point_of_a_free_cell_is_free_and_few_free_points_are_lost(
            outer in proptest::collection::vec(2.0..4.0f64, 5..12), hole in proptest::collection::vec(0.4..1.5f64, 3..9), turn in 0.0..6.0f64,
        ) {
            let (outer, hole) = (star(&outer, 0.0), star(&hole, turn));
            let raster = Raster::new(&outer, std::slice::from_ref(&hole), 0.1).unwrap();
            let view = raster.view();
            let mut lost = 0;
            for iy in 0..view.height * 4 {
                for ix in 0..view.width * 4 {
                    let at = |k: usize| (k as f64 + 0.5) * 0.25 * view.resolution_m;
                    let p = Point2::new(view.origin.x + at(ix), view.origin.y + at(iy));
                    let is_free = is_inside(&outer, &p) && !is_inside(&hole, &p);
                    let blocked = view.blocked[(iy / 4) * view.width + ix / 4];
                    prop_assert!(blocked || is_free, "{p}");
                    lost += usize::from(blocked && is_free);
                }
            }
            // Along a side at most the cells it passes.
            let length = |ring: &[Point2<f64>]| (0..ring.len()).map(|k| (ring[(k + 1) % ring.len()] - ring[k]).norm()).sum::<f64>();
            let most = 1.5 * (length(&outer) + length(&hole)) / view.resolution_m;
            prop_assert!(lost as f64 <= 16.0 * most, "{lost} of {most}");
        }
    }

    #[test]
    fn sides_on_borders_of_cells_take_nothing_and_large_maps_get_larger_cells() {
        let square = |a: f64, b: f64| vec![Point2::new(a, a), Point2::new(b, a), Point2::new(b, b), Point2::new(a, b)];
        let raster = Raster::new(&square(0.0, 4.0), &[square(1.0, 2.0)], 0.5).unwrap();
        assert_eq!(raster.view().blocked.iter().filter(|blocked| **blocked).count(), 4);
        let shifted = Raster::new(&square(0.0, 4.0), &[square(1.25, 2.25)], 0.5).unwrap();
        assert_eq!(shifted.view().blocked.iter().filter(|blocked| **blocked).count(), 9);
        let large = Raster::new(&square(0.0, 10_000.0), &[], 0.05).unwrap();
        assert!(large.view().blocked.len() <= MAX_CELLS && large.view().resolution_m < 5.1);
        assert!(Raster::new(&square(0.0, f64::NAN), &[], 0.05).is_err());
        assert!(Raster::new(&square(0.0, 1.0)[..2], &[], 0.05).is_err());
    }
}
