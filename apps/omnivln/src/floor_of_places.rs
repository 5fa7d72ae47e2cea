//! The floor that a graph of places tells of: each place is the middle of a free disc, each way a free strip.
//!
//! A skeleton with its clearances is the floor in other words (the union of its maximal discs is the floor; Blum 1967), and on the floor
//! furniture can be told from walls: it stands alone. In the graph it cannot: a chair is a loop of narrow ways.

use anyhow::{Result, ensure};
use arena::mission::rooms::{RoomConfig, RoomMap};
use arena::mission::volumetric_map::{Cell, OccupancyGrid};
use nalgebra::{Point2, Vector2};

/// A place: the middle of the largest free disc around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Where it is, metres.
    pub at: Point2<f64>,
    /// Radius of the disc, metres.
    pub clearance_m: f64,
}

/// A free strip between two places (indices), and half its width in metres.
pub type Way = (u32, u32, f64);

/// A grid may have so many cells: a building of 500 m by 500 m at 5 cm.
const MOST_CELLS: f64 = 1e8;

/// The room of each place, from 1; 0 for what belongs to no room. The floor is cut as a plan is ([`RoomMap`]); a place on too small a
/// spot belongs to the room to which its ways lead.
pub fn rooms_of_places(places: &[Place], ways: &[Way], resolution_m: f64, config: &RoomConfig) -> Result<Vec<u32>> {
    let floor = floor_of_places(places, ways, resolution_m)?;
    let rooms = RoomMap::new(&floor, None, config)?;
    let room_at = |place: &Place| {
        let (ix, iy) = floor.cell_of(&place.at)?;
        rooms.part_of_cell()[iy * floor.width + ix]
    };
    let mut labels: Vec<u32> = places.iter().map(|place| room_at(place).map_or(0, |room| room + 1)).collect();
    let mut neighbours = vec![Vec::new(); places.len()];
    for &(u, v, _) in ways {
        neighbours[u as usize].push(v);
        neighbours[v as usize].push(u);
    }
    let mut open: Vec<u32> = (0..places.len() as u32).filter(|&place| labels[place as usize] > 0).collect();
    let mut next = 0;
    while next < open.len() {
        let here = open[next] as usize;
        for &there in &neighbours[here] {
            if labels[there as usize] == 0 {
                labels[there as usize] = labels[here];
                open.push(there);
            }
        }
        next += 1;
    }
    Ok(labels)
}

/// Free cells within the discs and the strips, wall everywhere else, with a frame of wall.
fn floor_of_places(places: &[Place], ways: &[Way], resolution_m: f64) -> Result<OccupancyGrid> {
    for (number, place) in places.iter().enumerate() {
        let is_sound = place.at.coords.sum().is_finite() && place.clearance_m.is_finite();
        ensure!(is_sound, "node {number} has a number that is not finite");
    }
    for (number, &(u, v, half_width_m)) in ways.iter().enumerate() {
        let is_known = (u.max(v) as usize) < places.len();
        ensure!(is_known, "edge {number} names a node outside 0..{}", places.len());
        ensure!(!half_width_m.is_nan(), "the clearance of edge {number} is not a number");
    }
    let mut low = Vector2::repeat(f64::INFINITY);
    let mut high = Vector2::repeat(f64::NEG_INFINITY);
    for place in places {
        let reach = Vector2::repeat(place.clearance_m.max(0.0) + 2.0 * resolution_m);
        low = low.inf(&(place.at.coords - reach));
        high = high.sup(&(place.at.coords + reach));
    }
    if places.is_empty() {
        return Ok(OccupancyGrid::unknown(Point2::origin(), resolution_m, 0, 0));
    }
    let size = ((high - low) / resolution_m).map(f64::ceil);
    // Infinite or no number where coordinates are beyond all measure.
    ensure!(
        size.x * size.y <= MOST_CELLS,
        "the nodes cover {:.0} m by {:.0} m; accepted are floors of {MOST_CELLS:e} cells of {resolution_m} m",
        high.x - low.x,
        high.y - low.y
    );
    let mut grid = OccupancyGrid::unknown(Point2::from(low), resolution_m, size.x as usize, size.y as usize);
    grid.cells.fill(Cell::Occupied);
    for place in places {
        free_strip(&mut grid, place.at, place.at, place.clearance_m);
    }
    for &(u, v, half_width_m) in ways {
        let (u, v) = (places[u as usize], places[v as usize]);
        free_strip(&mut grid, u.at, v.at, half_width_m.min(u.clearance_m).min(v.clearance_m));
    }
    Ok(grid)
}

/// Frees the cells whose centres are nearer than `half_width_m` to the segment.
fn free_strip(grid: &mut OccupancyGrid, from: Point2<f64>, to: Point2<f64>, half_width_m: f64) {
    if half_width_m <= 0.0 {
        return;
    }
    let cell = |position: f64, origin: f64| ((position - origin) / grid.resolution_m).max(0.0) as usize;
    let (low, high) = (from.inf(&to), from.sup(&to));
    let columns =
        cell(low.x - half_width_m, grid.origin.x)..=cell(high.x + half_width_m, grid.origin.x).min(grid.width - 1);
    let rows =
        cell(low.y - half_width_m, grid.origin.y)..=cell(high.y + half_width_m, grid.origin.y).min(grid.height - 1);
    let along = to - from;
    let scale = 1.0 / along.norm_squared().max(f64::MIN_POSITIVE);
    for iy in rows {
        for ix in columns.clone() {
            let offset = grid.center(ix, iy) - from;
            let share = (offset.dot(&along) * scale).clamp(0.0, 1.0);
            if (offset - along * share).norm_squared() < half_width_m * half_width_m {
                grid.cells[iy * grid.width + ix] = Cell::Free;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESOLUTION_M: f64 = 0.05;

    fn place(x: f64, y: f64, clearance_m: f64) -> Place {
        Place { at: Point2::new(x, y), clearance_m }
    }

    #[test]
    fn discs_and_strips_are_free_and_the_rest_is_wall() {
        let places = [place(0.0, 0.0, 1.0), place(4.0, 0.0, 1.0)];
        let floor = floor_of_places(&places, &[(0, 1, 0.5)], RESOLUTION_M).unwrap();
        let is_free = |x: f64, y: f64| floor.at(&Point2::new(x, y)) == Cell::Free;
        assert!(is_free(0.0, 0.9) && is_free(2.0, 0.4) && is_free(4.9, 0.0));
        let no_way = floor_of_places(&places, &[(0, 1, -0.5)], RESOLUTION_M).unwrap();
        assert_eq!(no_way.at(&Point2::new(2.0, 0.0)), Cell::Occupied, "a negative width is none");
        assert!(!is_free(2.0, 0.6) && !is_free(0.0, 1.1) && !is_free(-1.05, 0.0));
    }

    /// A ring of eight narrow places round a table of 0.6 m, twice, with a door of 0.4 m half width between them.
    fn two_rooms_with_a_table_each() -> (Vec<Place>, Vec<Way>) {
        let (mut places, mut ways) = (Vec::new(), Vec::new());
        for room in 0..2 {
            for step in 0..8 {
                let angle = std::f64::consts::FRAC_PI_4 * f64::from(step);
                places.push(place(
                    4.5 * f64::from(room) + 1.2 * angle.cos(),
                    1.2 * angle.sin(),
                    0.7 + 0.1 * f64::from(step % 2),
                ));
                ways.push((8 * room + step as u32, 8 * room + (step as u32 + 1) % 8, 0.55));
            }
        }
        ways.push((0, 12, 0.4));
        (places, ways)
    }

    #[test]
    fn a_table_is_no_wall() {
        let (places, ways) = two_rooms_with_a_table_each();
        let labels = rooms_of_places(&places, &ways, RESOLUTION_M, &RoomConfig::default()).unwrap();
        assert!(labels[..8].iter().all(|label| *label == labels[0]), "{labels:?}");
        assert!(labels[8..].iter().all(|label| *label == 3 - labels[0]), "{labels:?}");
    }

    #[test]
    fn a_spot_too_small_for_a_room_goes_with_its_way_and_alone_it_is_none() {
        let places = [place(0.0, 0.0, 1.5), place(9.0, 0.0, 0.2), place(20.0, 0.0, 0.2)];
        let labels = rooms_of_places(&places, &[(0, 1, 0.0)], RESOLUTION_M, &RoomConfig::default()).unwrap();
        assert_eq!(labels, [1, 1, 0]);
        assert!(rooms_of_places(&[], &[], RESOLUTION_M, &RoomConfig::default()).unwrap().is_empty());
    }

    #[test]
    fn bad_input_is_named() {
        let check = |places: &[Place], ways: &[Way], word: &str| {
            let answer = rooms_of_places(places, ways, RESOLUTION_M, &RoomConfig::default());
            let message = answer.expect_err("refused").to_string();
            assert!(message.contains(word), "{message}");
        };
        let good = place(0.0, 0.0, 1.0);
        check(&[good, place(f64::NAN, 0.0, 1.0)], &[], "node 1");
        check(&[good], &[(0, 1, 1.0)], "edge 0 names a node outside 0..1");
        check(&[good, good], &[(0, 1, f64::NAN)], "edge 0");
        check(&[good, place(1e9, 0.0, 1.0)], &[], "accepted");
        check(&[good, place(0.0, 0.0, 1e300)], &[], "accepted");
    }
}
