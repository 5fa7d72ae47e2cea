//! The map layer: what was last seen at each place of each storey, in tiles, with exact clearance.
//!
//! FAR keeps clouds near the robot and lets contour edges stand for the walls further off. Two bits a cell are lighter than both and
//! exact everywhere, so a way is judged against all that was ever seen, and a window that differs from the memory says by itself
//! what changed. Everything here is in cell units; a tile belongs to the storey on whose floor it was first seen.

use nalgebra::Point2;
use rustc_hash::FxHashMap;

use super::super::clearance::HALF_DIAGONAL;
use super::tile::{BLOCK, REACH, SIDE, Through, Tile, measure, surroundings};
use super::window::{Seen, Window};

/// A place on a floor, in cells; the height of the floor in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spot {
    pub at: Point2<f64>,
    pub floor_m: f64,
}

/// Cells from `low` to `high`, the latter not included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CellBox {
    pub low: [i64; 2],
    pub high: [i64; 2],
}

/// What one window changed in one tile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Change {
    pub tile: u32,
    /// All cells that changed.
    pub changed: CellBox,
    /// Those that were occupied and are no longer.
    pub freed: Option<CellBox>,
    /// Whether an obstacle came or went.
    pub is_of_obstacles: bool,
    pub cells: u32,
}

/// All tiles. Tiles keep their numbers.
#[derive(Debug, Clone)]
pub(crate) struct Memory {
    pub tiles: Vec<Tile>,
    index: FxHashMap<(i32, i32), Vec<u32>>,
    pub same_layer_m: f64,
    /// The clearance in cells.
    pub radius: f64,
    /// Square roots of the squared distances a tile can hold.
    roots: Box<[f64; 256]>,
}

impl Memory {
    pub fn new(radius: f64, same_layer_m: f64) -> Self {
        let roots = Box::new(std::array::from_fn(|k| (k as f64).sqrt()));
        Memory { tiles: Vec::new(), index: FxHashMap::default(), same_layer_m, radius, roots }
    }

    /// The tile of a storey at an address: the one whose floor is nearest.
    pub fn tile_at(&self, key: (i32, i32), floor_m: f64) -> Option<u32> {
        let gap = |id: u32| (self.tiles[id as usize].floor_m - floor_m).abs();
        let nearest =
            self.index.get(&key)?.iter().copied().min_by(|a, b| gap(*a).total_cmp(&gap(*b)).then(a.cmp(b)))?;
        (gap(nearest) <= self.same_layer_m).then_some(nearest)
    }

    /// How many storeys have a tile at an address.
    pub fn storeys(&self, key: (i32, i32)) -> usize {
        self.index.get(&key).map_or(0, Vec::len)
    }

    /// Adds an empty tile.
    pub fn add_tile(&mut self, key: (i32, i32), floor_m: f64) -> u32 {
        let id = self.tiles.len() as u32;
        self.tiles.push(Tile::new(key, floor_m));
        self.index.entry(key).or_default().push(id);
        id
    }

    /// Takes a window of the storey with this floor. Unknown cells of it change nothing.
    pub fn write(&mut self, window: &Window, floor_m: f64, changes: &mut Vec<Change>) {
        changes.clear();
        let [x0, y0] = window.first_cell;
        let (x1, y1) = (x0 + window.width as i64, y0 + window.height as i64);
        let side = SIDE as i64;
        for ty in y0.div_euclid(side)..=(y1 - 1).div_euclid(side) {
            for tx in x0.div_euclid(side)..=(x1 - 1).div_euclid(side) {
                let first = [(tx * side).max(x0), (ty * side).max(y0)];
                let last = [((tx + 1) * side).min(x1), ((ty + 1) * side).min(y1)];
                self.write_tile(window, (tx as i32, ty as i32), first, last, floor_m, changes);
            }
        }
        self.remeasure(changes);
    }

    fn write_tile(
        &mut self,
        window: &Window,
        key: (i32, i32),
        first: [i64; 2],
        last: [i64; 2],
        floor_m: f64,
        changes: &mut Vec<Change>,
    ) {
        let mut id = self.tile_at(key, floor_m);
        let (origin_x, origin_y) = (i64::from(key.0) * SIDE as i64, i64::from(key.1) * SIDE as i64);
        let mut changed = Extent::default();
        let mut freed = Extent::default();
        let (mut is_of_obstacles, mut cells) = (false, 0);
        for y in first[1]..last[1] {
            let row = (y - window.first_cell[1]) as usize * window.width;
            let from = row + (first[0] - window.first_cell[0]) as usize;
            let seen = &window.seen[from..from + (last[0] - first[0]) as usize];
            let (mut occupied, mut free) = (0u64, 0u64);
            for (k, cell) in seen.iter().enumerate() {
                occupied |= u64::from(*cell == Seen::Occupied) << k;
                free |= u64::from(*cell == Seen::Free) << k;
            }
            let shift = (first[0] - origin_x) as u32;
            (occupied, free) = (occupied << shift, free << shift);
            let told = occupied | free;
            if told == 0 {
                continue;
            }
            let id = *id.get_or_insert_with(|| {
                // Where another storey has a tile already, this one is read instead of it from heights between: all of it changes.
                if self.index.contains_key(&key) {
                    changed = Extent { columns: u64::MAX, rows: Some((0, SIDE - 1)) };
                }
                self.add_tile(key, floor_m)
            });
            let tile = &mut self.tiles[id as usize];
            let j = (y - origin_y) as usize;
            let (was_occupied, was_free) = (tile.occupied[j], tile.free[j]);
            let now_occupied = (was_occupied & !told) | occupied;
            let now_free = (was_free & !told) | free;
            let differs = (was_occupied ^ now_occupied) | (was_free ^ now_free);
            if differs == 0 {
                continue;
            }
            (tile.occupied[j], tile.free[j]) = (now_occupied, now_free);
            changed.add(differs, j);
            freed.add(was_occupied & !now_occupied, j);
            is_of_obstacles |= was_occupied != now_occupied;
            cells += differs.count_ones();
        }
        if let (Some(id), Some(changed)) = (id, changed.in_tile(key)) {
            changes.push(Change { tile: id, changed, freed: freed.in_tile(key), is_of_obstacles, cells });
        }
    }

    /// Distances, corners and frontiers of all tiles that a change can reach.
    pub fn remeasure(&mut self, changes: &[Change]) {
        let mut reached: Vec<u32> = Vec::new();
        for change in changes {
            let floor_m = self.tiles[change.tile as usize].floor_m;
            let (reach, side) = (REACH as i64, SIDE as i64);
            let range = |axis: usize| {
                let low = (change.changed.low[axis] - reach).div_euclid(side);
                low..=(change.changed.high[axis] - 1 + reach).div_euclid(side)
            };
            for ty in range(1) {
                for tx in range(0) {
                    let key = (tx as i32, ty as i32);
                    let before = reached.len();
                    let here = self.index.get(&key).map_or(&[][..], Vec::as_slice);
                    let is_near = |id: &u32| (self.tiles[*id as usize].floor_m - floor_m).abs() <= self.same_layer_m;
                    reached.extend(here.iter().filter(|id| is_near(id)));
                    if reached.len() == before && self.reaches(change.tile, key) {
                        // Unknown, but nearer than 16 cells to an obstacle: its distances have to say so.
                        reached.push(self.add_tile(key, floor_m));
                    }
                }
            }
        }
        reached.sort_unstable();
        reached.dedup();
        for id in reached {
            self.remeasure_tile(id);
        }
    }

    /// Whether an obstacle of a tile is nearer than 16 cells to a tile beside it.
    fn reaches(&self, tile: u32, beside: (i32, i32)) -> bool {
        let tile = &self.tiles[tile as usize];
        let rows = match beside.1 - tile.key.1 {
            -1 => 0..REACH,
            1 => SIDE - REACH..SIDE,
            _ => 0..SIDE,
        };
        let columns = match beside.0 - tile.key.0 {
            -1 => u64::MAX >> (SIDE - REACH),
            1 => u64::MAX << (SIDE - REACH),
            _ => u64::MAX,
        };
        tile.occupied[rows].iter().any(|row| row & columns != 0)
    }

    /// Distances of all tiles as they were read from a file; keeps which blocks are exhausted.
    pub fn remeasure_all(&mut self) {
        let exhausted: Vec<u64> = self.tiles.iter().map(|tile| tile.exhausted).collect();
        let side = SIDE as i64;
        let whole = |(k, tile): (usize, &Tile)| {
            let low = [i64::from(tile.key.0) * side, i64::from(tile.key.1) * side];
            let changed = CellBox { low, high: low.map(|c| c + side) };
            Change { tile: k as u32, changed, freed: None, is_of_obstacles: true, cells: 0 }
        };
        let changes: Vec<Change> = self.tiles.iter().enumerate().map(whole).collect();
        self.remeasure(&changes);
        for (tile, exhausted) in self.tiles.iter_mut().zip(exhausted) {
            tile.exhausted = exhausted;
        }
    }

    fn remeasure_tile(&mut self, id: u32) {
        let (key, floor_m) = (self.tiles[id as usize].key, self.tiles[id as usize].floor_m);
        let round: [[Option<u32>; 3]; 3] = std::array::from_fn(|y| {
            std::array::from_fn(|x| match (x, y) {
                (1, 1) => Some(id),
                _ => self.tile_at((key.0 + x as i32 - 1, key.1 + y as i32 - 1), floor_m),
            })
        });
        let rows = |of: &dyn Fn(Option<&Tile>, usize) -> u64| {
            surroundings(|y, x, j| of(round[y][x].map(|id| &self.tiles[id as usize]), j))
        };
        let occupied = rows(&|tile, j| tile.map_or(0, |t| t.occupied[j]));
        let free = rows(&|tile, j| tile.map_or(0, |t| t.free[j]));
        let not_free = free.map(|row| !row);
        let tile = &mut self.tiles[id as usize];
        measure(&occupied, &mut tile.unknown);
        measure(&not_free, &mut tile.known);
        // Frontier: free, a neighbour is unknown, and the robot's circle fits on the cell's corner.
        let need = ((self.radius + HALF_DIAGONAL).powi(2)).ceil() as u8;
        let mut blocks = [(0u32, 0u32, 0u32); BLOCK * BLOCK];
        let mut bits = [0u64; SIDE];
        for (j, kept) in bits.iter_mut().enumerate() {
            let k = j + REACH + 1;
            let unknown = |k: usize| !(occupied[k] | free[k]);
            let beside = unknown(k) << 1 | unknown(k) >> 1 | unknown(k - 1) | unknown(k + 1);
            let mut row = ((free[k] & beside) >> (REACH + 1)) as u64;
            while row != 0 {
                let i = row.trailing_zeros() as usize;
                row &= row - 1;
                if tile.unknown.squared[j][i] >= need {
                    *kept |= 1 << i;
                    let block = &mut blocks[j / BLOCK * BLOCK + i / BLOCK];
                    *block = (block.0 + 1, block.1 + (i % BLOCK) as u32, block.2 + (j % BLOCK) as u32);
                }
            }
        }
        for (k, (count, x, y)) in blocks.into_iter().enumerate() {
            if tile.frontier[k] != count as u8 {
                tile.exhausted &= !(1 << k);
            }
            tile.frontier[k] = count as u8;
            if count == 0 {
                continue;
            }
            let off = |i: usize, j: usize| (count * i as u32).abs_diff(x) + (count * j as u32).abs_diff(y);
            let (x0, y0) = (k % BLOCK * BLOCK, k / BLOCK * BLOCK);
            let inside = (0..BLOCK).flat_map(|j| (0..BLOCK).map(move |i| (i, j)));
            let best = inside.filter(|(i, j)| bits[y0 + j] >> (x0 + i) & 1 == 1).min_by_key(|(i, j)| off(*i, *j));
            tile.frontier_cell[k] = best.map_or(0, |(i, j)| (j * BLOCK + i) as u8);
        }
    }

    /// What is known of a cell.
    pub fn seen(&self, cell: [i64; 2], floor_m: f64) -> Seen {
        let side = SIDE as i64;
        let key = (cell[0].div_euclid(side) as i32, cell[1].div_euclid(side) as i32);
        let Some(id) = self.tile_at(key, floor_m) else { return Seen::Unknown };
        let (i, j) = (cell[0].rem_euclid(side), cell[1].rem_euclid(side) as usize);
        let tile = &self.tiles[id as usize];
        match (tile.occupied[j] >> i & 1, tile.free[j] >> i & 1) {
            (1, _) => Seen::Occupied,
            (_, 1) => Seen::Free,
            _ => Seen::Unknown,
        }
    }

    /// Square root of a squared distance of a tile.
    pub fn root(&self, squared: u8) -> f64 {
        self.roots[usize::from(squared)]
    }

    /// The free lattice point nearest to a spot, within `reach` cells of it.
    pub fn nearest_free(
        &self,
        spot: &Spot,
        reach: f64,
        through: Through,
        accept: impl Fn(&Spot) -> bool,
    ) -> Option<Spot> {
        let mut best: Option<(f64, Spot)> = None;
        let low = |c: f64| (c - reach).ceil() as i64;
        let high = |c: f64| (c + reach).floor() as i64;
        for j in low(spot.at.y)..=high(spot.at.y) {
            for i in low(spot.at.x)..=high(spot.at.x) {
                let candidate = Spot { at: Point2::new(i as f64, j as f64), floor_m: spot.floor_m };
                let squared = (candidate.at - spot.at).norm_squared();
                let is_nearer = squared <= reach * reach && best.is_none_or(|b| squared < b.0);
                if is_nearer && self.is_free(&candidate, through) && accept(&candidate) {
                    best = Some((squared, candidate));
                }
            }
        }
        best.map(|(_, spot)| spot)
    }
}

/// Rows and columns of set bits.
#[derive(Default)]
struct Extent {
    columns: u64,
    rows: Option<(usize, usize)>,
}

impl Extent {
    fn add(&mut self, bits: u64, row: usize) {
        if bits != 0 {
            self.columns |= bits;
            self.rows = Some(self.rows.map_or((row, row), |r| (r.0, r.1.max(row))));
        }
    }

    fn in_tile(&self, key: (i32, i32)) -> Option<CellBox> {
        let (first, last) = self.rows?;
        let (x, y) = (i64::from(key.0) * SIDE as i64, i64::from(key.1) * SIDE as i64);
        Some(CellBox {
            low: [x + i64::from(self.columns.trailing_zeros()), y + first as i64],
            high: [x + 64 - i64::from(self.columns.leading_zeros()), y + last as i64 + 1],
        })
    }
}
