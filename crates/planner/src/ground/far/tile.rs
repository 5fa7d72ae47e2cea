//! A square of 64 x 64 cells of one storey: what was seen there, and exact distances to what may not be touched.
//!
//! Cells are bits. As in `clearance.rs`, the nearest point of a union of squares to a lattice point is a lattice point, so
//! that squared distances are whole numbers; here they end at 255, which is "15.9 cells or more", so that a change of a cell changes
//! distances within 16 cells only and a row of them fits into vector registers.

/// Cells along a side of a tile.
pub(crate) const SIDE: usize = 64;
/// Distances are exact below this many cells.
pub(crate) const REACH: usize = 16;
/// Rows and columns of a tile with what can touch its distances.
const WIDE: usize = SIDE + 2 * REACH;
/// Side of the blocks in which frontier cells are counted.
pub(crate) const BLOCK: usize = 8;

/// What a way may not touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Through {
    /// Known free cells only: what is occupied or unknown is avoided.
    Known,
    /// Also unknown cells: an attempt.
    Unknown,
}

/// Squares to keep away from: their convex corners, and squared distances from the lattice points of the tile's cells.
#[derive(Debug, Clone)]
pub(crate) struct Barrier {
    pub squared: Box<[[u8; SIDE]; SIDE]>,
    pub corners: Box<[u64; SIDE]>,
}

/// One tile. Lattice point `(i, j)` is the lower left corner of cell `(i, j)`.
#[derive(Debug, Clone)]
pub(crate) struct Tile {
    /// Address of the tile.
    pub key: (i32, i32),
    /// Floor on which the robot was when it first saw the tile.
    pub floor_m: f64,
    pub occupied: Box<[u64; SIDE]>,
    pub free: Box<[u64; SIDE]>,
    /// Against what is not known to be free.
    pub known: Barrier,
    /// Against what is known to be occupied.
    pub unknown: Barrier,
    /// Free cells beside unknown ones, with room for the robot: per block of 8 x 8 cells how many.
    pub frontier: Box<[u8; BLOCK * BLOCK]>,
    /// ... and the one nearest to their middle, `y * 8 + x` in the block.
    pub frontier_cell: Box<[u8; BLOCK * BLOCK]>,
    /// Blocks that were visited and whose frontier cells did not go away: nobody can see there.
    pub exhausted: u64,
}

impl Tile {
    pub fn new(key: (i32, i32), floor_m: f64) -> Self {
        Tile {
            key,
            floor_m,
            occupied: Box::new([0; SIDE]),
            free: Box::new([0; SIDE]),
            known: Barrier { squared: Box::new([[0; SIDE]; SIDE]), corners: Box::new([0; SIDE]) },
            unknown: Barrier { squared: Box::new([[255; SIDE]; SIDE]), corners: Box::new([0; SIDE]) },
            frontier: Box::new([0; BLOCK * BLOCK]),
            frontier_cell: Box::new([0; BLOCK * BLOCK]),
            exhausted: 0,
        }
    }

    pub fn barrier(&self, through: Through) -> &Barrier {
        match through {
            Through::Known => &self.known,
            Through::Unknown => &self.unknown,
        }
    }
}

/// Rows of cells round a tile as bits, from 17 cells below and left of it to 16 above and right of it: cell `(i, j)` of the tile is bit
/// `i + 17` of row `j + 17`.
pub(crate) type Surroundings = [u128; WIDE + 1];

/// The rows of the nine tiles `[below, this, above][left, this, right]`, through a closure that gives row `j` of one of them.
pub(crate) fn surroundings(row_of: impl Fn(usize, usize, usize) -> u64) -> Surroundings {
    let mut rows = [0; WIDE + 1];
    for (k, row) in rows.iter_mut().enumerate() {
        let j = k + SIDE - (REACH + 1);
        let (tile, j) = (j / SIDE, j % SIDE);
        let (left, middle, right) = (row_of(tile, 0, j), row_of(tile, 1, j), row_of(tile, 2, j));
        *row = u128::from(left >> (SIDE - REACH - 1))
            | u128::from(middle) << (REACH + 1)
            | u128::from(right & ((1 << REACH) - 1)) << (SIDE + REACH + 1);
    }
    rows
}

/// Squared distances from the tile's lattice points to the squares whose cells are set, and the convex corners of those squares.
pub(crate) fn measure(cells: &Surroundings, barrier: &mut Barrier) {
    // A lattice point belongs to a square if one of the four cells round it is set. Row k of `down` is lattice row k - 16.
    let mut down = [[0u8; WIDE]; WIDE];
    let mut steps = [REACH as u8; WIDE];
    for (k, row) in down.iter_mut().enumerate() {
        let (here, below) = (cells[k + 1], cells[k]);
        let points = (here | here << 1 | below | below << 1) >> 1;
        for (i, step) in steps.iter_mut().enumerate() {
            let hit = (points >> i) as u8 & 1;
            *step = (*step + 1).min(REACH as u8) * (1 - hit);
        }
        *row = steps;
    }
    let mut steps = [REACH as u8; WIDE];
    for (k, row) in down.iter_mut().enumerate().rev() {
        for (step, cell) in steps.iter_mut().zip(row.iter_mut()) {
            *step = (*step + 1).min(*cell);
            *cell = *step;
        }
        if (REACH..REACH + SIDE).contains(&k) {
            // 16 squared saturates to 255; 15 squared is 225.
            let mut squared = [0u8; WIDE];
            for (s, d) in squared.iter_mut().zip(row.iter()) {
                *s = (u16::from(*d) * u16::from(*d)).min(255) as u8;
            }
            let mut out = [255u8; SIDE];
            for shift in 1..2 * REACH {
                let across = shift.abs_diff(REACH);
                let added = (across * across) as u8;
                for (o, s) in out.iter_mut().zip(&squared[shift..shift + SIDE]) {
                    *o = (*o).min(s.saturating_add(added));
                }
            }
            barrier.squared[k - REACH] = out;
        }
    }
    for (j, corners) in barrier.corners.iter_mut().enumerate() {
        let (a, c) = (cells[j + REACH + 1], cells[j + REACH]);
        let (b, d) = (a << 1, c << 1);
        let two = (a & b) | (c & d) | (a & c) | (b & d) | (a & d) | (b & c);
        let one = (a ^ b ^ c ^ d) & !two;
        let across = (a & d & !b & !c) | (b & c & !a & !d);
        *corners = ((one | across) >> (REACH + 1)) as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_and_corners_equal_brute_force() {
        for (seed, modulus) in [(1u64, 7), (2, 60), (3, 900), (4, 2)] {
            let set = |i: i64, j: i64| {
                let mut z = seed.wrapping_add((i + 1000) as u64 * 7919 + (j + 1000) as u64 * 104_729);
                z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                (z ^ (z >> 27)).is_multiple_of(modulus)
            };
            let cells = surroundings(|tile_y, tile_x, j| {
                let (i0, j) = (tile_x as i64 * 64 - 64, tile_y as i64 * 64 - 64 + j as i64);
                (0..64).filter(|i| set(i0 + i, j)).map(|i| 1u64 << i).sum()
            });
            let mut tile = Tile::new((0, 0), 0.0);
            measure(&cells, &mut tile.known);
            let corner = |i: i64, j: i64| set(i, j) || set(i - 1, j) || set(i, j - 1) || set(i - 1, j - 1);
            for (i, j) in (0..64).step_by(7).flat_map(|i| (0..64).step_by(5).map(move |j| (i, j))) {
                let mut best = 255;
                for (dx, dy) in (-15..=15i64).flat_map(|dx| (-15..=15i64).map(move |dy| (dx, dy))) {
                    if corner(i + dx, j + dy) {
                        best = best.min(dx * dx + dy * dy);
                    }
                }
                assert_eq!(i64::from(tile.known.squared[j as usize][i as usize]), best, "{i} {j}");
                let round = [set(i, j), set(i - 1, j), set(i - 1, j - 1), set(i, j - 1)];
                let count = round.iter().filter(|x| **x).count();
                let convex = count == 1 || (count == 2 && round[0] == round[2]);
                assert_eq!(tile.known.corners[j as usize] >> i & 1 == 1, convex, "{i} {j}");
            }
        }
    }
}
