//! What a way to a frontier would show: information gain along the route, counted on the grid by rays.

use nalgebra::{Point2, Vector2};
use rustc_hash::FxHashSet;
use volumetric_map::{Cell, OccupancyGrid};

use crate::coverage::Coverage;

/// A look every so many metres of the way.
const LOOK_EVERY_M: f64 = 1.0;
/// Rays go on so far through space that nobody has measured: beyond that there is probably a wall.
const INTO_UNKNOWN_M: f64 = 2.0;
/// Rays of one look: at full range they are half a metre apart, which a cell of 0.2 m and the next look make up for.
const RAYS: usize = 44;

/// The area (m²) that looks from along `way` would show and that was not inspected yet, at most as far as things are recognised. What nobody has
/// measured counts as open for two metres.
pub fn gain_m2(way: &[Point2<f64>], slice: &OccupancyGrid, coverage: &Coverage) -> f64 {
    let mut cells: FxHashSet<(i32, i32)> = FxHashSet::default();
    for eye in looks_along(way) {
        for ray in 0..RAYS {
            let (sin, cos) = (std::f64::consts::TAU * ray as f64 / RAYS as f64).sin_cos();
            cast(&eye, &Vector2::new(cos, sin), slice, coverage, &mut cells);
        }
    }
    cells.len() as f64 * coverage.cell_m() * coverage.cell_m()
}

fn cast(
    eye: &Point2<f64>,
    direction: &Vector2<f64>,
    slice: &OccupancyGrid,
    coverage: &Coverage,
    cells: &mut FxHashSet<(i32, i32)>,
) {
    let step_m = 0.5 * coverage.cell_m();
    let (mut along_m, mut unknown_m) = (0.0, 0.0);
    while along_m <= coverage.inspect_range_m() && unknown_m <= INTO_UNKNOWN_M {
        let point = eye + direction * along_m;
        match slice.cell_of(&point).map_or(Cell::Unknown, |(ix, iy)| slice.get(ix, iy)) {
            Cell::Occupied => return,
            Cell::Unknown => unknown_m += step_m,
            Cell::Free => {}
        }
        if !coverage.is_inspected(&point) {
            cells.insert(coverage.cell_of(&point));
        }
        along_m += step_m;
    }
}

/// Places along a way, its end first.
fn looks_along(way: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let Some(end) = way.last() else { return Vec::new() };
    let mut looks = vec![*end];
    let mut since_m = 0.0;
    for leg in way.windows(2).rev() {
        since_m += (leg[1] - leg[0]).norm();
        if since_m >= LOOK_EVERY_M {
            since_m = 0.0;
            looks.push(leg[0]);
        }
    }
    looks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coverage::CoverageConfig;

    /// A corridor of 12 x 2 m in which all beyond 6 m was not measured; walls round what was.
    fn corridor() -> OccupancyGrid {
        let (width, height) = (120, 20);
        let content = |ix: usize, iy: usize| match (ix, iy) {
            (60.., _) => Cell::Unknown,
            (0, _) | (_, 0 | 19) => Cell::Occupied,
            _ => Cell::Free,
        };
        let cells = (0..width * height).map(|k| content(k % width, k / width)).collect();
        OccupancyGrid { origin: Point2::origin(), resolution_m: 0.1, width, height, cells }
    }

    #[test]
    fn the_open_end_shows_more_than_the_closed_one_and_what_was_inspected_shows_nothing() {
        let slice = corridor();
        let mut coverage = Coverage::new(CoverageConfig::default());
        coverage.look(&Point2::new(3.0, 1.0), &slice);
        let gain = |x: f64| gain_m2(&[Point2::new(x, 1.0)], &slice, &coverage);
        // Two metres into the unknown, fanning out; behind the eye all was inspected.
        assert!((2.0..9.0).contains(&gain(5.8)), "{}", gain(5.8));
        assert!(gain(0.5) < 0.5, "{}", gain(0.5));
        let both = gain_m2(&[Point2::new(0.5, 1.0), Point2::new(5.8, 1.0)], &slice, &coverage);
        assert!(both >= gain(5.8) && both <= gain(5.8) + gain(0.5) + 1e-9, "no cell counts twice");
        assert_eq!(gain_m2(&[], &slice, &coverage), 0.0);
    }

    #[test]
    fn walls_hide_what_is_behind_them() {
        let slice = corridor();
        let coverage = Coverage::new(CoverageConfig::default());
        let inside = gain_m2(&[Point2::new(2.0, 1.0)], &slice, &coverage);
        assert!(inside <= 5.5 * 2.0 + 1.0, "{inside} m² of a corridor that is 2 m wide");
    }
}
