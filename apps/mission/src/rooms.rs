//! Rooms from the map: a slice above the furniture, its clearance, and the partition of that clearance by `Pinch`.
//!
//! The slice lies between table tops and door lintels, so walls remain and most furniture is gone; what stands alone in
//! it is filled. Each free pixel becomes a vertex whose value is its
//! clearance; persistent homology of that graph says where the building is pinched, and pinches are doors.
//!
//! A map with three dimensions knows more than a floor plan: what ends below the lintels is furniture however large, what goes
//! on above them is a wall however short, and a gap with something over it is a doorway ([`Overhead`]).

use std::cmp::Reverse;
use std::collections::BTreeMap;

use nalgebra::{Point2, Point3};
use topo_ph::{
    Border, HysteresisConfig, HysteresisError, NO_PART, Partition, PinchConfig, grid_graph, pinch, pinch_from,
};
use volumetric_map::{Cell, OccupancyGrid, clearance, fill_islands};

use crate::flanks::lies_between_walls;
use crate::overhead::Overhead;

/// Rays are so far apart where a slice ends to be seen, 15 m away; walls are thicker, and their faces are seen.
const MOST_SLIT_M: f64 = 0.15;
/// The clearance under a lintel counts for so much.
const UNDER_LINTEL: f32 = 0.1;

/// How rooms are cut out of the slice.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomConfig {
    /// Islands up to this area are furniture and filled, default 1.0 m².
    pub island_area_m2: f64,
    /// ... if no side of their box is longer than this, default 1.2 m.
    pub island_side_m: f64,
    /// Ratio of the pinch to the smaller room, default 0.88.
    pub rho: f64,
    /// The same where it is known what is over most gaps, default 0.75: doors show themselves there, and of what has no lintel
    /// only a clear narrowing parts two rooms.
    pub open_rho: f64,
    /// Ratio of the pinch to the larger room, default 0.75.
    pub sigma: f64,
    /// Prominence of a room, default 0.07 m.
    pub tau_m: f64,
    /// Smallest room, default 1.5 m².
    pub min_area_m2: f64,
    /// A gap under a lintel is a doorway up to this width, default 2.0 m: wider ones lie under beams.
    pub max_doorway_m: f64,
}

impl Default for RoomConfig {
    fn default() -> Self {
        Self {
            island_area_m2: 1.0,
            island_side_m: 1.2,
            rho: 0.88,
            open_rho: 0.75,
            sigma: 0.75,
            tau_m: 0.07,
            min_area_m2: 1.5,
            max_doorway_m: 2.0,
        }
    }
}

/// The free part of a slice, cut into rooms.
#[derive(Debug, Clone)]
pub struct RoomMap {
    grid: OccupancyGrid,
    /// Room per cell, `None` where the slice is not free.
    part_of_cell: Vec<Option<u32>>,
    /// Per room: a point well inside it (where its clearance is largest) and its area.
    pub rooms: Vec<RoomShape>,
    /// Openings between rooms.
    pub doorways: Vec<Doorway>,
}

/// One room of a [`RoomMap`].
#[derive(Debug, Clone, PartialEq)]
pub struct RoomShape {
    /// The point of largest clearance.
    pub center: Point2<f64>,
    /// Area of its free cells.
    pub area_m2: f64,
}

/// An opening between two rooms: the widest place of their common border.
#[derive(Debug, Clone, PartialEq)]
pub struct Doorway {
    /// Indices into [`RoomMap::rooms`].
    pub between: (usize, usize),
    /// Its middle.
    pub at: Point2<f64>,
    /// Its width: twice the clearance of its middle.
    pub width_m: f64,
}

impl RoomMap {
    /// Cuts `slice` into rooms. An empty slice has none. `above` is the slice of the same map over the lintels, where there is
    /// one; the parts of it that lie elsewhere are ignored.
    ///
    /// # Errors
    /// [`HysteresisError`] if the configuration makes no sense.
    pub fn new(
        slice: &OccupancyGrid,
        above: Option<&OccupancyGrid>,
        config: &RoomConfig,
    ) -> Result<RoomMap, HysteresisError> {
        RoomMap::cut(slice, above, config, None)
    }

    /// Cuts `slice` into rooms where `self` were the rooms a moment ago: a border stays until the way is clearly wider than a
    /// door, so that rooms do not come and go with the noise of the map.
    ///
    /// # Errors
    /// As [`RoomMap::new`].
    pub fn next(
        &self,
        slice: &OccupancyGrid,
        above: Option<&OccupancyGrid>,
        config: &RoomConfig,
    ) -> Result<RoomMap, HysteresisError> {
        RoomMap::cut(slice, above, config, Some(self))
    }

    fn cut(
        slice: &OccupancyGrid,
        above: Option<&OccupancyGrid>,
        config: &RoomConfig,
        before: Option<&RoomMap>,
    ) -> Result<RoomMap, HysteresisError> {
        // 1. Far away rays are apart, and between them nobody has looked. Furniture is filled: what ends below the lintels, and what
        //    stands alone and is no wall.
        let slice = &without_slits(slice);
        let overhead = above.map(|above| Overhead::new(slice, above));
        let fill = |grid: &OccupancyGrid| fill_islands(grid, config.island_area_m2, config.island_side_m);
        let grid = match &overhead {
            None => fill(slice),
            Some(overhead) => {
                let mut grid = fill(&overhead.without_furniture(slice));
                overhead.put_walls_back(slice, &mut grid);
                grid
            }
        };
        // 2. Clearance of every free cell; what nobody saw counts as a wall. A doorway is a deep valley: what is under a lintel
        //    keeps its order and loses its height.
        let clearance_m = clearance(&grid, true);
        let mut height = clearance_m.clone();
        if let Some(overhead) = &overhead {
            let is_doorway = |cell: usize| {
                2.0 * f64::from(clearance_m[cell]) <= config.max_doorway_m && overhead.is_under_lintel(cell)
            };
            (0..height.len()).filter(|cell| is_doorway(*cell)).for_each(|cell| height[cell] *= UNDER_LINTEL);
        }
        // 3. The graph of free cells, eight neighbours each.
        let (graph, cell_of_vertex) = grid_graph(&height, grid.width);
        // 4. The partition.
        let cell_area_m2 = grid.resolution_m * grid.resolution_m;
        let areas = vec![cell_area_m2; graph.len()];
        let knows_most = overhead.as_ref().is_some_and(|overhead| overhead.knows_most);
        let rho = if knows_most { config.open_rho } else { config.rho };
        let pinch_config = PinchConfig { rho, sigma: config.sigma, tau: config.tau_m, min_area: config.min_area_m2 };
        let center_of = |vertex: u32| {
            let cell = cell_of_vertex[vertex as usize] as usize;
            grid.center(cell % grid.width, cell / grid.width)
        };
        let previous: Option<Vec<u32>> = before.map(|before| {
            let part_of = |vertex: u32| before.room_of_cell_at(&center_of(vertex)).unwrap_or(NO_PART);
            (0..graph.len() as u32).map(part_of).collect()
        });
        let partition = match &previous {
            None => pinch(&graph, &areas, &pinch_config)?,
            Some(previous) => pinch_from(&graph, &areas, &pinch_config, previous, &HysteresisConfig::default())?,
        };
        // 5. What is narrow only because nobody has looked further is no opening: its sides are one part, unless they were two rooms
        //    a moment ago. What is small and cut off (a view through a window, a gap behind a shelf) is no room.
        let clearance_at = |vertex: u32| f64::from(clearance_m[cell_of_vertex[vertex as usize] as usize]);
        let is_opening = |border: &Border| {
            let (u, v) = graph.edges()[border.edge as usize];
            let narrow = if clearance_at(u) <= clearance_at(v) { u } else { v };
            let cell = cell_of_vertex[narrow as usize] as usize;
            overhead.as_ref().is_some_and(|overhead| overhead.is_under_lintel(cell))
                || lies_between_walls(&grid, (cell % grid.width, cell / grid.width), clearance_at(narrow))
        };
        let room_before = match &previous {
            None => vec![None; partition.parts.len()],
            Some(previous) => rooms_before(&partition, previous),
        };
        let whole_of_part = wholes(&partition, &room_before, &is_opening);
        let mut room_of_part: Vec<Option<u32>> = Vec::with_capacity(partition.parts.len());
        let mut rooms: Vec<RoomShape> = Vec::new();
        let area_of = |whole: usize| -> f64 {
            partition.parts.iter().zip(&whole_of_part).filter(|(_, of)| **of == whole).map(|(part, _)| part.area).sum()
        };
        for (index, part) in partition.parts.iter().enumerate() {
            // The part with the highest peak comes first and stands for the whole.
            let whole = whole_of_part[index];
            if whole < index {
                room_of_part.push(room_of_part[whole]);
                continue;
            }
            let area_m2 = area_of(whole);
            let is_room = area_m2 >= config.min_area_m2;
            room_of_part.push(is_room.then_some(rooms.len() as u32));
            if is_room {
                rooms.push(RoomShape { center: center_of(part.peak), area_m2 });
            }
        }
        let mut part_of_cell = vec![None; grid.cells.len()];
        for (vertex, &part) in partition.part_of.iter().enumerate() {
            part_of_cell[cell_of_vertex[vertex] as usize] = room_of_part[part as usize];
        }
        let doorways = partition
            .borders
            .iter()
            .filter_map(|border| {
                let (u, v) = graph.edges()[border.edge as usize];
                let between = (room_of_part[border.a as usize]? as usize, room_of_part[border.b as usize]? as usize);
                (between.0 != between.1).then(|| Doorway {
                    between,
                    at: nalgebra::center(&center_of(u), &center_of(v)),
                    width_m: 2.0 * clearance_at(u).min(clearance_at(v)),
                })
            })
            .collect();
        Ok(RoomMap { grid, part_of_cell, rooms, doorways })
    }

    /// The room of the very cell.
    fn room_of_cell_at(&self, point: &Point2<f64>) -> Option<u32> {
        let (ix, iy) = self.grid.cell_of(point)?;
        self.part_of_cell[iy * self.grid.width + ix]
    }

    /// Index of the room at `point`; for a point in a wall or on furniture, of the nearest room within `0.6 m`.
    pub fn room_at(&self, point: &Point3<f64>) -> Option<usize> {
        const REACH_M: f64 = 0.6;
        let (ix, iy) = self.grid.cell_of(&point.xy())?;
        let reach = (REACH_M / self.grid.resolution_m).ceil() as i64;
        let mut best: Option<(i64, u32)> = None;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (x, y) = (ix as i64 + dx, iy as i64 + dy);
                if x < 0 || y < 0 || x >= self.grid.width as i64 || y >= self.grid.height as i64 {
                    continue;
                }
                let squared = dx * dx + dy * dy;
                if best.is_some_and(|(nearest, _)| nearest <= squared) {
                    continue;
                }
                if let Some(part) = self.part_of_cell[y as usize * self.grid.width + x as usize] {
                    best = Some((squared, part));
                    if squared == 0 {
                        return Some(part as usize);
                    }
                }
            }
        }
        best.filter(|(squared, _)| *squared <= reach * reach).map(|(_, part)| part as usize)
    }

    /// The grid on which the rooms were cut, furniture filled.
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }

    /// Room per cell of [`RoomMap::grid`], row by row.
    pub fn part_of_cell(&self) -> &[Option<u32>] {
        &self.part_of_cell
    }
}

/// For each part the first of those that it makes one with: what no opening parts is one, the widest border first. Two parts of
/// which each makes one with another room of before stay two: a slit through a wall that is not seen yet comes and goes.
fn wholes(partition: &Partition, room_before: &[Option<u32>], is_opening: &dyn Fn(&Border) -> bool) -> Vec<usize> {
    let mut whole: Vec<usize> = (0..partition.parts.len()).collect();
    let mut room_of_whole = room_before.to_vec();
    let mut borders: Vec<&Border> = partition.borders.iter().filter(|border| !is_opening(border)).collect();
    borders.sort_by(|p, q| q.saddle.total_cmp(&p.saddle).then((p.a, p.b).cmp(&(q.a, q.b))));
    for border in borders {
        let (a, b) = (whole[border.a as usize], whole[border.b as usize]);
        let room = match (room_of_whole[a], room_of_whole[b]) {
            (Some(one), Some(other)) if one != other => continue,
            (one, other) => one.or(other),
        };
        whole.iter_mut().filter(|of| **of == a || **of == b).for_each(|of| *of = a.min(b));
        room_of_whole[a.min(b)] = room;
    }
    whole
}

/// For each part the room of before that most of it was, if any of it was one.
fn rooms_before(partition: &Partition, previous: &[u32]) -> Vec<Option<u32>> {
    let mut votes: Vec<BTreeMap<u32, usize>> = vec![BTreeMap::new(); partition.parts.len()];
    for (part, room) in partition.part_of.iter().zip(previous).filter(|(_, room)| **room != NO_PART) {
        *votes[*part as usize].entry(*room).or_default() += 1;
    }
    let most = |votes: BTreeMap<u32, usize>| votes.into_iter().max_by_key(|(room, count)| (*count, Reverse(*room)));
    votes.into_iter().map(|votes| most(votes).map(|(room, _)| room)).collect()
}

/// A slice in which unknown slits are free: up to [`MOST_SLIT_M`] between two free cells of a row or a column.
fn without_slits(slice: &OccupancyGrid) -> OccupancyGrid {
    let most = (MOST_SLIT_M / slice.resolution_m).round() as usize;
    let mut filled = slice.clone();
    let mut walk = |line: &mut dyn Iterator<Item = usize>| {
        let mut slit: Option<Vec<usize>> = None;
        for cell in line {
            match (slice.cells[cell], &mut slit) {
                (Cell::Free, _) => {
                    for cell in slit.take().into_iter().flatten() {
                        filled.cells[cell] = Cell::Free;
                    }
                    slit = Some(Vec::new());
                }
                (Cell::Unknown, Some(cells)) if cells.len() < most => cells.push(cell),
                _ => slit = None,
            }
        }
    };
    let (width, height) = (slice.width, slice.height);
    (0..height).for_each(|iy| walk(&mut (0..width).map(|ix| iy * width + ix)));
    (0..width).for_each(|ix| walk(&mut (0..height).map(|iy| iy * width + ix)));
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rooms of 4 m x 4 m, a wall of one cell between them, a door of 1 m in its middle.
    fn two_rooms() -> OccupancyGrid {
        let (width, height, resolution_m) = (83, 42, 0.1);
        let mut cells = vec![Cell::Free; width * height];
        for iy in 0..height {
            for ix in 0..width {
                let is_border = ix == 0 || iy == 0 || ix == width - 1 || iy == height - 1;
                let is_wall = ix == 41 && !(16..26).contains(&iy);
                if is_border || is_wall {
                    cells[iy * width + ix] = Cell::Occupied;
                }
            }
        }
        OccupancyGrid { origin: Point2::new(-1.0, 2.0), resolution_m, width, height, cells }
    }

    #[test]
    fn a_door_separates_two_rooms() {
        let map = RoomMap::new(&two_rooms(), None, &RoomConfig::default()).unwrap();
        assert_eq!(map.rooms.len(), 2);
        let left = map.room_at(&Point3::new(0.0, 4.0, 1.0)).unwrap();
        let right = map.room_at(&Point3::new(5.0, 4.0, 1.0)).unwrap();
        assert_ne!(left, right);
        assert_eq!(map.doorways.len(), 1);
        let doorway = &map.doorways[0];
        assert!((doorway.at - Point2::new(3.15, 4.1)).norm() < 0.2, "{doorway:?}");
        assert!((doorway.width_m - 1.0).abs() < 0.25, "{doorway:?}");
    }

    #[test]
    fn a_door_that_wanders_about_the_rule_does_not_flicker() {
        // Two rooms of 4 m in cells of 2.5 cm. The opening grows: plainly a door, then undecided, then plainly none.
        let opening = |cells: usize| {
            let (width, height, resolution_m) = (323, 162, 0.025);
            let middle = (height - cells) / 2..(height - cells) / 2 + cells;
            let cells = (0..width * height).map(|cell| {
                let (ix, iy) = (cell % width, cell / width);
                let is_border = ix == 0 || iy == 0 || ix == width - 1 || iy == height - 1;
                let is_wall = ix == 161 && !middle.contains(&iy);
                if is_border || is_wall { Cell::Occupied } else { Cell::Free }
            });
            let cells = cells.collect();
            OccupancyGrid { origin: Point2::origin(), resolution_m, width, height, cells }
        };
        let config = RoomConfig::default();
        let plain = |cells| RoomMap::new(&opening(cells), None, &config).unwrap().rooms.len();
        let last_door = (100..160).take_while(|cells| plain(*cells) == 2).last().unwrap();
        assert!(plain(last_door + 1) == 1, "the rule changes its mind at {last_door}");
        let two = RoomMap::new(&opening(last_door), None, &config).unwrap();
        assert_eq!(two.next(&opening(last_door + 1), None, &config).unwrap().rooms.len(), 2, "a known border stays");
        let one = RoomMap::new(&opening(last_door + 1), None, &config).unwrap();
        assert_eq!(
            one.next(&opening(last_door + 1), None, &config).unwrap().rooms.len(),
            1,
            "an unknown one does not come"
        );
        assert_eq!(two.next(&opening(158), None, &config).unwrap().rooms.len(), 1, "what is no door any more goes");
    }

    /// A hall of 8 m x 2 m and two rooms of 4 m x 4 m above it, cells of 10 cm, walls of one cell. Three doors of 1 m meet at a
    /// piece of wall that stands alone. `is_open` says which gaps a slice has.
    fn three_doors(is_open: impl Fn(usize, usize) -> bool) -> OccupancyGrid {
        let (width, height, resolution_m) = (83, 63, 0.1);
        let cell = |(ix, iy): (usize, usize)| {
            let is_border = ix == 0 || iy == 0 || ix == width - 1 || iy == height - 1;
            let is_wall = iy == 21 || (ix == 41 && iy > 21);
            if is_border || (is_wall && !is_open(ix, iy)) { Cell::Occupied } else { Cell::Free }
        };
        let cells = (0..width * height).map(|at| cell((at % width, at / width))).collect();
        OccupancyGrid { origin: Point2::origin(), resolution_m, width, height, cells }
    }

    #[test]
    fn the_piece_of_wall_between_three_doors_goes_on_above_them() {
        let doors = |ix: usize, iy: usize| match iy {
            21 => (28..38).contains(&ix) || (45..55).contains(&ix),
            _ => (25..35).contains(&iy),
        };
        let (slice, above) = (three_doors(doors), three_doors(|_, _| false));
        let config = RoomConfig::default();
        let blind = RoomMap::new(&slice, None, &config).unwrap();
        assert!(blind.grid().get(41, 22) == Cell::Free, "a floor plan alone takes it for furniture");
        let map = RoomMap::new(&slice, Some(&above), &config).unwrap();
        assert_eq!((map.rooms.len(), map.doorways.len()), (3, 3), "{map:?}");
        for doorway in &map.doorways {
            assert!((doorway.width_m - 1.0).abs() < 0.25, "{doorway:?}");
        }
    }

    #[test]
    fn a_gap_as_wide_as_its_hall_is_a_doorway_under_a_lintel_and_none_under_a_beam() {
        // A corridor, its walls apart by so many cells, and across it a wall of one cell with a gap of all but two of them.
        let corridor = |cells: usize, is_open: bool| {
            let (width, height, resolution_m) = (83, cells + 2, 0.1);
            let cell = |(ix, iy): (usize, usize)| {
                let is_border = ix == 0 || iy == 0 || ix == width - 1 || iy == height - 1;
                let is_wall = ix == 41 && !(is_open && (2..height - 2).contains(&iy));
                if is_border || is_wall { Cell::Occupied } else { Cell::Free }
            };
            let cells = (0..width * height).map(|at| cell((at % width, at / width))).collect();
            OccupancyGrid { origin: Point2::origin(), resolution_m, width, height, cells }
        };
        let rooms = |cells, has_lintel: bool| {
            let closed = corridor(cells, false);
            let above = has_lintel.then_some(&closed);
            RoomMap::new(&corridor(cells, true), above, &RoomConfig::default()).unwrap().rooms.len()
        };
        assert_eq!((rooms(20, false), rooms(20, true)), (1, 2));
        assert_eq!((rooms(40, false), rooms(40, true)), (1, 1));
    }

    #[test]
    fn slits_between_far_rays_part_no_room() {
        // A corridor of 12 m x 2 m, seen from its left end: beyond 6 m only every third row.
        let (width, height, resolution_m) = (240, 40, 0.05);
        let cell = |(ix, iy): (usize, usize)| {
            let is_wall = ix == 0 || iy == 0 || iy + 1 == height;
            let is_slit = ix > 120 && iy % 3 != 1;
            if is_wall {
                Cell::Occupied
            } else if is_slit {
                Cell::Unknown
            } else {
                Cell::Free
            }
        };
        let cells = (0..width * height).map(|at| cell((at % width, at / width))).collect();
        let slice = OccupancyGrid { origin: Point2::origin(), resolution_m, width, height, cells };
        let map = RoomMap::new(&slice, None, &RoomConfig::default()).unwrap();
        assert_eq!(map.rooms.len(), 1);
        assert!((map.rooms[0].area_m2 - 12.0 * 1.9).abs() < 0.6, "{:?}", map.rooms);
        // A gap of half a metre that nobody has looked into stays.
        let mut wide = slice.clone();
        (0..wide.cells.len())
            .filter(|at| (60..70).contains(&(at % width)))
            .for_each(|at| wide.cells[at] = Cell::Unknown);
        assert_eq!(RoomMap::new(&wide, None, &RoomConfig::default()).unwrap().rooms.len(), 2);
    }

    #[test]
    fn a_slit_through_an_unseen_wall_joins_no_rooms_that_were_two() {
        // Two rooms of 4 m x 4 m in cells of 5 cm; between them 1 m that nobody has seen, and in it a slit that comes later.
        let seen = |slit: usize| {
            let (width, height, resolution_m) = (182, 82, 0.05);
            let cell = |(ix, iy): (usize, usize)| {
                let is_border = ix == 0 || iy == 0 || ix == width - 1 || iy == height - 1;
                match (81..101).contains(&ix) {
                    true if !(41 - slit / 2..41 + slit / 2).contains(&iy) => Cell::Unknown,
                    _ if is_border => Cell::Occupied,
                    _ => Cell::Free,
                }
            };
            let cells = (0..width * height).map(|at| cell((at % width, at / width))).collect();
            OccupancyGrid { origin: Point2::origin(), resolution_m, width, height, cells }
        };
        let config = RoomConfig::default();
        let rooms = |map: &RoomMap| map.rooms.len();
        let apart = RoomMap::new(&seen(0), None, &config).unwrap();
        assert_eq!(rooms(&apart), 2);
        assert_eq!(rooms(&RoomMap::new(&seen(8), None, &config).unwrap()), 1, "who never saw two sees one");
        let mut map = apart.next(&seen(8), None, &config).unwrap();
        assert_eq!(rooms(&map), 2, "two stay two");
        for slit in [16, 24, 32, 40] {
            map = map.next(&seen(slit), None, &config).unwrap();
        }
        assert_eq!(rooms(&map.next(&seen(78), None, &config).unwrap()), 1, "what turns out to be one hall is one");
    }

    #[test]
    fn an_empty_slice_has_no_rooms() {
        let grid =
            OccupancyGrid { origin: Point2::origin(), resolution_m: 0.1, width: 0, height: 0, cells: Vec::new() };
        let map = RoomMap::new(&grid, None, &RoomConfig::default()).unwrap();
        assert!(map.rooms.is_empty() && map.room_at(&Point3::origin()).is_none());
    }
}
