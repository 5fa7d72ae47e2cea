//! Keeping the [`DistanceField`] up to date: its layout, the joining of voxels to cells, and the three passes of the transform.

use std::ops::Range;

use crate::block::{Block, BlockKey};
use crate::distance_field::{BEYOND, DistanceField, NOWHERE, UpdateReport};
use crate::edt::{Envelope, FAR};
use crate::volume::{Cell, Volume};

impl DistanceField {
    /// Makes the grid cover the volume; grows with a margin so that an exploring robot seldom triggers it. Returns where the old box lies in
    /// the new one (first cell, end) if it grew.
    pub(crate) fn lay_out(&mut self, volume: &Volume, report: &mut UpdateReport) -> Option<([usize; 3], [usize; 3])> {
        let voxel = volume.config().voxel_m;
        let wanted = self.requested_resolution_m / voxel;
        let distance_to_wanted = |joined: &i32| (f64::from(*joined).ln() - wanted.ln()).abs();
        let joined = [1, 2, 4, 8].into_iter().min_by(|a, b| distance_to_wanted(a).total_cmp(&distance_to_wanted(b)));
        let joined = joined.expect("the list is not empty");
        let resolution_m = voxel * f64::from(joined);
        let cells_per_block = 8 / joined;
        let is_other = volume.revision() < self.seen_revision
            || cells_per_block != self.cells_per_block
            || (resolution_m - self.resolution_m).abs() > 1e-12
            || self.state.is_empty();
        // The grid covers all blocks of the last time; only new ones can lie outside.
        let since = if is_other { 0 } else { self.seen_revision };
        let mut need: Option<([i32; 3], [i32; 3])> = None;
        for block in volume.changed_since(since) {
            let key = [block.key.x, block.key.y, block.key.z];
            let (low, high) = need.get_or_insert((key, key));
            for axis in 0..3 {
                low[axis] = low[axis].min(key[axis]);
                high[axis] = high[axis].max(key[axis]);
            }
        }
        let Some((low, high)) = need else {
            if is_other {
                *self = Self::new(self.requested_resolution_m, self.max_distance_m);
            }
            return None;
        };
        let (old_low, old_size) = (self.low, self.size);
        let first = |axis: usize| old_low[axis] / cells_per_block;
        let last = |axis: usize| first(axis) + old_size[axis] as i32 / cells_per_block - 1;
        if !is_other && (0..3).all(|axis| first(axis) < low[axis] && high[axis] < last(axis)) {
            return None;
        }
        let (mut new_low, mut new_size) = (old_low, old_size);
        for axis in 0..3 {
            // At least one block of unknown space all round: cells on the border of the grid are never free.
            let margin = if axis == 2 { 1 } else { 5 };
            let keep_low = !is_other && first(axis) < low[axis];
            let keep_high = !is_other && last(axis) > high[axis];
            let from = if keep_low { first(axis) } else { low[axis] - margin };
            let to = if keep_high { last(axis) } else { high[axis] + margin };
            new_low[axis] = from * cells_per_block;
            new_size[axis] = (i64::from(to - from + 1) * i64::from(cells_per_block)) as usize;
        }
        let is_too_large =
            new_size.iter().try_fold(1usize, |n, side| n.checked_mul(*side)).is_none_or(|n| n > self.max_cells);
        if is_too_large && !is_other {
            return None;
        }
        if is_too_large {
            // Nothing to keep, and no box holds it all: an empty grid of the new kind.
            (new_low, new_size) = (low.map(|v| v * cells_per_block), [0; 3]);
        }
        report.is_rebuilt = true;
        self.resolution_m = resolution_m;
        self.cells_per_block = cells_per_block;
        if !is_other {
            let shift: [usize; 3] = std::array::from_fn(|axis| (old_low[axis] - new_low[axis]) as usize);
            self.grow(new_low, new_size, shift);
            if std::mem::take(&mut self.has_refused) {
                self.seen_revision = 0;
            }
            return Some((shift, std::array::from_fn(|axis| shift[axis] + old_size[axis])));
        }
        (self.low, self.size) = (new_low, new_size);
        let reach = ((self.max_distance_m / resolution_m + 1e-9).floor()).clamp(1.0, 250.0);
        self.max_distance_m = self.max_distance_m.min(250.0 * resolution_m);
        self.reach_squared =
            ((self.max_distance_m / resolution_m).powi(2) + 1e-6).floor().clamp(reach, 62_500.0) as u32;
        self.roots = (0..=self.reach_squared).map(|d| (f64::from(d).sqrt() * resolution_m) as f32).collect();
        let cells = self.size.iter().product();
        self.state = vec![Cell::Unknown; cells];
        self.up = vec![NOWHERE; cells];
        self.plane = vec![BEYOND; cells];
        self.plane_site = vec![0; cells];
        self.squared = vec![BEYOND; cells];
        self.site = vec![0; cells];
        self.touched = vec![self.version + 1; cells / (cells_per_block as usize).pow(3)];
        self.seen_revision = 0;
        None
    }

    /// Lays the grid out in a larger box, in which the old one begins at `shift`; the new cells are unknown and beyond everything.
    fn grow(&mut self, low: [i32; 3], size: [usize; 3], shift: [usize; 3]) {
        let old = self.size;
        self.state = moved(&self.state, old, size, shift, Cell::Unknown);
        self.up = moved(&self.up, old, size, shift, NOWHERE);
        self.plane = moved(&self.plane, old, size, shift, BEYOND);
        self.plane_site = moved(&self.plane_site, old, size, shift, 0);
        self.squared = moved(&self.squared, old, size, shift, BEYOND);
        self.site = moved(&self.site, old, size, shift, 0);
        let groups = |cells: [usize; 3]| cells.map(|v| v / self.cells_per_block as usize);
        self.touched = moved(&self.touched, groups(old), groups(size), groups(shift), self.version + 1);
        (self.low, self.size) = (low, size);
    }

    /// After the grid grew: what lies near the border of the old box (first cell, end) reaches into the new cells. A line that ends out of
    /// reach of everything stays so however long it gets.
    pub(crate) fn mark_old_border(
        &self,
        (first, end): ([usize; 3], [usize; 3]),
        dirty_columns: &mut [bool],
        dirty_y_lines: &mut [Span],
        dirty_x_lines: &mut [Span],
    ) {
        let [nx, ny, nz] = self.size;
        let ends = |axis: usize| {
            let low = (first[axis] > 0).then_some(first[axis]);
            let high = (end[axis] < self.size[axis]).then_some(end[axis] - 1);
            [low, high].into_iter().flatten()
        };
        for z in ends(2) {
            for (column, dirty) in dirty_columns.iter_mut().enumerate() {
                *dirty |= self.up[column + nx * ny * z] != NOWHERE;
            }
        }
        for y in ends(1) {
            for (line, dirty) in dirty_y_lines.iter_mut().enumerate() {
                if self.plane[line % nx + nx * (y + ny * (line / nx))] != BEYOND {
                    dirty.add(y);
                }
            }
        }
        for x in ends(0) {
            for (line, dirty) in dirty_x_lines.iter_mut().enumerate().take(ny * nz) {
                if self.squared[x + nx * line] != BEYOND {
                    dirty.add(x);
                }
            }
        }
    }

    /// Whether a block lies in the grid.
    pub(crate) fn covers(&self, key: BlockKey) -> bool {
        let key = [key.x, key.y, key.z];
        (0..3).all(|axis| {
            let first = key[axis] * self.cells_per_block - self.low[axis];
            first >= 0 && (first + self.cells_per_block) as usize <= self.size[axis]
        })
    }

    /// Joins the voxels of a block into cells; returns how many changed and marks the columns whose obstacles did.
    pub(crate) fn read_block(&mut self, block: &Block, dirty_columns: &mut [bool]) -> usize {
        let n = self.cells_per_block as usize;
        let joined = 8 / n;
        let half = (joined * joined * joined).div_ceil(2) as u32;
        let row = u64::MAX >> (64 - joined);
        let mut square = 0u64;
        for y in 0..joined {
            square |= row << (8 * y);
        }
        let first = [block.key.x, block.key.y, block.key.z];
        let corner: [usize; 3] =
            std::array::from_fn(|axis| (first[axis] * self.cells_per_block - self.low[axis]) as usize);
        let mut changed = 0;
        for cz in 0..n {
            for cy in 0..n {
                for cx in 0..n {
                    let mask = square << (joined * (cx + 8 * cy));
                    let mut occupied = 0;
                    let mut free = 0;
                    for z in cz * joined..(cz + 1) * joined {
                        occupied |= block.occupied[z] & mask;
                        free += (block.known[z] & !block.occupied[z] & mask).count_ones();
                    }
                    let state = if occupied != 0 {
                        Cell::Occupied
                    } else if free >= half {
                        Cell::Free
                    } else {
                        Cell::Unknown
                    };
                    let (x, y, z) = (corner[0] + cx, corner[1] + cy, corner[2] + cz);
                    let i = self.number([x, y, z]);
                    if self.state[i] != state {
                        changed += 1;
                        if self.state[i] == Cell::Occupied || state == Cell::Occupied {
                            dirty_columns[y * self.size[0] + x] = true;
                        }
                        self.state[i] = state;
                        let group = self.group_of([x, y, z]);
                        self.touched[group] = self.version + 1;
                    }
                }
            }
        }
        changed
    }

    pub(crate) fn pass_z(&mut self, dirty: &[bool], dirty_y_lines: &mut [Span]) -> usize {
        let [nx, ny, nz] = self.size;
        let mut lines = 0;
        let mut offsets = vec![NOWHERE; nz];
        for column in (0..nx * ny).filter(|c| dirty[*c]) {
            lines += 1;
            let mut last: Option<usize> = None;
            for (z, offset) in offsets.iter_mut().enumerate() {
                if self.state[column + nx * ny * z] == Cell::Occupied {
                    last = Some(z);
                }
                *offset = last.map_or(NOWHERE, |l| -((z - l) as i16));
            }
            last = None;
            for z in (0..nz).rev() {
                if self.state[column + nx * ny * z] == Cell::Occupied {
                    last = Some(z);
                }
                // Ties go down, as everywhere: the smaller coordinate wins.
                if let Some(l) = last
                    && (offsets[z] == NOWHERE || ((l - z) as i16) < -offsets[z])
                {
                    offsets[z] = (l - z) as i16;
                }
                if offsets[z] != NOWHERE && (i32::from(offsets[z]).pow(2) as u32) > self.reach_squared {
                    offsets[z] = NOWHERE;
                }
                let i = column + nx * ny * z;
                if self.up[i] != offsets[z] {
                    self.up[i] = offsets[z];
                    dirty_y_lines[z * nx + column % nx].add(column / nx);
                }
            }
        }
        lines
    }

    pub(crate) fn pass_y(&mut self, dirty: &[Span], dirty_x_lines: &mut [Span]) -> usize {
        let [nx, ny, nz] = self.size;
        let mut lines = 0;
        let mut line = Line::new(ny, self.reach_squared);
        for z in 0..nz {
            for x in 0..nx {
                let Some((read, write)) = line.windows(dirty[z * nx + x]) else { continue };
                lines += 1;
                let first = x + nx * ny * z;
                for (y, value) in read.clone().zip(&mut line.values) {
                    let up = self.up[first + nx * y];
                    *value = if up == NOWHERE { FAR } else { i32::from(up).pow(2) as u32 };
                }
                line.transform(read.len());
                for y in write {
                    let i = first + nx * y;
                    self.plane_site[i] = line.site[y - read.start];
                    let squared = line.squared[y - read.start];
                    if self.plane[i] != squared {
                        self.plane[i] = squared;
                        dirty_x_lines[z * ny + y].add(x);
                    }
                }
            }
        }
        lines
    }

    pub(crate) fn pass_x(&mut self, dirty: &[Span]) -> usize {
        let [nx, ny, nz] = self.size;
        let mut lines = 0;
        let mut line = Line::new(nx, self.reach_squared);
        for (yz, span) in dirty.iter().enumerate().take(ny * nz) {
            let Some((read, write)) = line.windows(*span) else { continue };
            lines += 1;
            let first = nx * yz;
            for (value, squared) in line.values.iter_mut().zip(&self.plane[first..][read.clone()]) {
                *value = if *squared == BEYOND { FAR } else { u32::from(*squared) };
            }
            line.transform(read.len());
            let inside = write.start - read.start..write.end - read.start;
            let (old, new) = (&self.squared[first..][write.clone()], &line.squared[inside.clone()]);
            let changed = |pair: (&u16, &u16)| pair.0 != pair.1;
            if old.iter().zip(new).any(changed) {
                let (y, z) = (yz % ny, yz / ny);
                let group = self.group_of([0, y, z]);
                for (x, _) in write.clone().zip(old.iter().zip(new)).filter(|(_, pair)| changed(*pair)) {
                    self.touched[group + x / self.cells_per_block as usize] = self.version + 1;
                }
            }
            self.squared[first..][write.clone()].copy_from_slice(&line.squared[inside.clone()]);
            self.site[first..][write].copy_from_slice(&line.site[inside]);
        }
        lines
    }
}

/// The cells of a box in a larger box, in which the old one begins at `shift`.
fn moved<T: Copy>(cells: &[T], old: [usize; 3], new: [usize; 3], shift: [usize; 3], fill: T) -> Vec<T> {
    let mut out = vec![fill; new.iter().product()];
    for (row, source) in cells.chunks_exact(old[0].max(1)).enumerate() {
        let (y, z) = (row % old[1] + shift[1], row / old[1] + shift[2]);
        let first = shift[0] + new[0] * (y + new[1] * z);
        out[first..first + old[0]].copy_from_slice(source);
    }
    out
}

/// First and last cell of a line whose input changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Span {
    first: u32,
    last: u32,
}

impl Span {
    pub const EMPTY: Self = Self { first: u32::MAX, last: 0 };

    fn add(&mut self, cell: usize) {
        self.first = self.first.min(cell as u32);
        self.last = self.last.max(cell as u32);
    }
}

/// One line of a pass: room for its values and results.
struct Line {
    length: usize,
    reach: usize,
    reach_squared: i64,
    values: Vec<u32>,
    envelope: Envelope,
    squared: Vec<u16>,
    site: Vec<i16>,
}

impl Line {
    fn new(length: usize, reach_squared: u32) -> Self {
        Self {
            length,
            reach: reach_squared.isqrt() as usize,
            reach_squared: i64::from(reach_squared),
            values: vec![FAR; length],
            envelope: Envelope::default(),
            squared: vec![BEYOND; length],
            site: vec![0; length],
        }
    }

    /// Which cells to read and which to write when the inputs in a span changed: a result depends on inputs within reach.
    fn windows(&self, span: Span) -> Option<(Range<usize>, Range<usize>)> {
        let window = |margin: usize| {
            (span.first as usize).saturating_sub(margin)..(span.last as usize + margin + 1).min(self.length)
        };
        (span != Span::EMPTY).then(|| (window(2 * self.reach), window(self.reach)))
    }

    /// Squared distances and sites of the first cells.
    fn transform(&mut self, length: usize) {
        self.squared[..length].fill(BEYOND);
        self.site[..length].fill(0);
        self.envelope.build(&self.values[..length]);
        let (reach_squared, squared, site_of) = (self.reach_squared, &mut self.squared, &mut self.site);
        self.envelope.for_each_part(length, |cells, value, site| {
            for x in cells {
                let offset = site - x as i64;
                let sum = offset * offset + value;
                if sum <= reach_squared {
                    squared[x] = sum as u16;
                    site_of[x] = offset as i16;
                }
            }
        });
    }
}
