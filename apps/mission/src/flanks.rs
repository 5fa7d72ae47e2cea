//! Whether an opening lies between two walls, or is only where seeing ends.
//!
//! Far away a slice ends in rags: single rays, and between them nobody has looked. Such rags are narrow in places, and a narrow place
//! looks like a door. A door has walls, or their ends, on both sides.

use volumetric_map::{Cell, OccupancyGrid};

/// What has an occupied cell this near is a wall: its faces are seen with gaps.
const BESIDE_CELLS: i64 = 2;

/// Whether the nearest things on both sides of the opening at cell `(ix, iy)` were seen. `half_width_m` is the clearance there.
pub fn lies_between_walls(grid: &OccupancyGrid, (ix, iy): (usize, usize), half_width_m: f64) -> bool {
    let reach = (3.0 * half_width_m / grid.resolution_m).ceil() as i64 + 3;
    let (cx, cy) = (ix as i64, iy as i64);
    let cell = |x: i64, y: i64| {
        let is_inside = x >= 0 && y >= 0 && x < grid.width as i64 && y < grid.height as i64;
        if is_inside { grid.get(x as usize, y as usize) } else { Cell::Unknown }
    };
    let nearest = |wants: &dyn Fn(i64, i64) -> bool| {
        let mut best: Option<(i64, (i64, i64))> = None;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let squared = dx * dx + dy * dy;
                if best.is_none_or(|(least, _)| squared < least)
                    && cell(cx + dx, cy + dy) != Cell::Free
                    && wants(dx, dy)
                {
                    best = Some((squared, (dx, dy)));
                }
            }
        }
        best.map(|(_, at)| at)
    };
    let is_seen = |(dx, dy): (i64, i64)| {
        (-BESIDE_CELLS..=BESIDE_CELLS)
            .any(|y| (-BESIDE_CELLS..=BESIDE_CELLS).any(|x| cell(cx + dx + x, cy + dy + y) == Cell::Occupied))
    };
    let Some(one) = nearest(&|_, _| true) else { return true };
    // The other side: beyond a right angle from the first, with a little to spare.
    let is_across = |dx: i64, dy: i64| {
        let along = (dx * one.0 + dy * one.1) as f64;
        along < -0.3 * ((dx * dx + dy * dy) as f64).sqrt() * ((one.0 * one.0 + one.1 * one.1) as f64).sqrt()
    };
    is_seen(one) && nearest(&is_across).is_none_or(is_seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    /// A lane along x between the rows 0 and 20, of which each side is what it is.
    fn lane(lower: Cell, upper: Cell) -> OccupancyGrid {
        let mut grid = OccupancyGrid::unknown(Point2::origin(), 0.05, 60, 21);
        for ix in 0..60 {
            for iy in 0..21 {
                grid.cells[iy * 60 + ix] = match iy {
                    0 => lower,
                    20 => upper,
                    _ => Cell::Free,
                };
            }
        }
        grid
    }

    #[test]
    fn both_sides_must_have_been_seen() {
        let is_between = |lower, upper| lies_between_walls(&lane(lower, upper), (30, 10), 0.5);
        assert!(is_between(Cell::Occupied, Cell::Occupied));
        assert!(!is_between(Cell::Occupied, Cell::Unknown) && !is_between(Cell::Unknown, Cell::Occupied));
        // A wall seen with gaps is a wall.
        let mut gaps = lane(Cell::Occupied, Cell::Unknown);
        (0..60).step_by(3).for_each(|ix| gaps.cells[20 * 60 + ix] = Cell::Occupied);
        assert!(lies_between_walls(&gaps, (30, 10), 0.5));
        // Off the middle, the nearer side alone is not enough either.
        assert!(!lies_between_walls(&lane(Cell::Occupied, Cell::Unknown), (30, 7), 0.35));
    }
}
