//! The best poses of a scan in a map, exactly: branch and bound over yaw and cell.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::localisation::columns::Column;
use crate::localisation::pyramid::{Offset, Pyramid, TOP};

/// A pose of the lattice with its score.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hit {
    /// Number of the yaw, in steps of a whole turn over the number of yaws.
    pub yaw: usize,
    /// Cell.
    pub cell: [i32; 2],
    /// Slices of the scan that the map has too.
    pub score: u32,
}

/// What to look for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Yaws of a whole turn.
    pub yaws: usize,
    /// Poses.
    pub hits: usize,
    /// Poses nearer than this many cells in x and in y ...
    pub apart_cells: i32,
    /// ... and this many yaws are the same place.
    pub apart_yaws: usize,
    /// Poses below this score are of no interest,
    pub least_score: u32,
    /// nor those below this share of the best.
    pub least_share: f64,
    /// Windows to look into at most.
    pub max_windows: usize,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Found {
    /// Best first; of each place only the best pose.
    pub hits: Vec<Hit>,
    /// No place that is not among the hits scores more.
    pub rest: u32,
    /// Windows looked into.
    pub windows: usize,
    /// Whether the search ended before it ran out of windows.
    pub is_complete: bool,
}

/// Finds the best places. The first is the maximum over the whole lattice; ties go to the smaller yaw, then the smaller cell.
pub fn best_places(pyramid: &Pyramid, scan: &[Column], wanted: &Wanted) -> Found {
    let yaw_step_rad = std::f64::consts::TAU / wanted.yaws as f64;
    let turned: Vec<Vec<Offset>> =
        (0..wanted.yaws).map(|yaw| pyramid.turned(scan, yaw as f64 * yaw_step_rad)).collect();
    let (low, high) = pyramid.domain();
    let mut open = BinaryHeap::new();
    let width = 1 << TOP;
    for (yaw, offsets) in turned.iter().enumerate() {
        for x in (low[0]..high[0]).step_by(width) {
            for y in (low[1]..high[1]).step_by(width) {
                let bound = pyramid.score(offsets, [x, y], TOP);
                if bound >= wanted.least_score {
                    open.push(Window { bound, level: TOP, yaw, cell: [x, y] });
                }
            }
        }
    }
    let mut found = Found { is_complete: true, ..Found::default() };

    while let Some(window) = open.pop() {
        let best = found.hits.first().map_or(0, |hit| hit.score);
        let least = wanted.least_score.max((wanted.least_share * f64::from(best)).ceil() as u32);
        if window.bound < least || found.hits.len() == wanted.hits {
            found.rest = window.bound;
            break;
        }
        if found.hits.iter().any(|hit| window.lies_at(hit, wanted)) {
            continue;
        }
        // The bound of a leaf is its score, and everything left is at most as good.
        if window.level == 0 {
            found.hits.push(Hit { yaw: window.yaw, cell: window.cell, score: window.bound });
            continue;
        }
        found.windows += 1;
        if found.windows > wanted.max_windows {
            found.rest = window.bound;
            found.is_complete = false;
            break;
        }
        let (level, half) = (window.level - 1, 1 << (window.level - 1));
        for corner in 0..4 {
            let cell = [window.cell[0] + (corner & 1) * half, window.cell[1] + (corner >> 1) * half];
            if cell[0] >= high[0] || cell[1] >= high[1] {
                continue;
            }
            let bound = pyramid.score(&turned[window.yaw], cell, level);
            if bound >= least {
                open.push(Window { bound, level, yaw: window.yaw, cell });
            }
        }
    }
    found
}

/// A window of poses with one yaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Window {
    bound: u32,
    level: usize,
    yaw: usize,
    cell: [i32; 2],
}

impl Window {
    /// Whether all of it is the place of a hit.
    fn lies_at(&self, hit: &Hit, wanted: &Wanted) -> bool {
        let size = 1 << self.level;
        let turn = self.yaw.abs_diff(hit.yaw);
        turn.min(wanted.yaws - turn) <= wanted.apart_yaws
            && (0..2).all(|axis| {
                let (low, high) = (hit.cell[axis] - wanted.apart_cells, hit.cell[axis] + wanted.apart_cells);
                self.cell[axis] >= low && self.cell[axis] + size - 1 <= high
            })
    }
}

impl Ord for Window {
    /// The best bound first; of these the coarsest, so that leaves of one score come out together and in order.
    fn cmp(&self, other: &Self) -> Ordering {
        (self.bound.cmp(&other.bound))
            .then(self.level.cmp(&other.level))
            .then(other.yaw.cmp(&self.yaw))
            .then(other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Window {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
