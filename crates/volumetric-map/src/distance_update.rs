//! Keeping the [`DistanceField`] up to date: its layout, the joining of voxels to cells, and the three passes of the transform.

use crate::block::Block;
use crate::distance_field::{BEYOND, DistanceField, NOWHERE, UpdateReport};
use crate::edt::{Envelope, FAR};
use crate::volume::{Cell, Volume};

impl DistanceField {
    /// Makes the grid cover the volume; grows with a margin so that an exploring robot seldom triggers it.
    pub(crate) fn lay_out(&mut self, volume: &Volume, report: &mut UpdateReport) {
        let voxel = volume.config().voxel_m;
        let wanted = self.requested_resolution_m / voxel;
        let distance_to_wanted = |joined: &i32| (f64::from(*joined).ln() - wanted.ln()).abs();
        let joined = [1, 2, 4, 8].into_iter().min_by(|a, b| distance_to_wanted(a).total_cmp(&distance_to_wanted(b)));
        let joined = joined.expect("the list is not empty");
        let resolution_m = voxel * f64::from(joined);
        let cells_per_block = 8 / joined;
        let mut need: Option<([i32; 3], [i32; 3])> = None;
        for block in &volume.blocks {
            let key = [block.key.x, block.key.y, block.key.z];
            let (low, high) = need.get_or_insert((key, key));
            for axis in 0..3 {
                low[axis] = low[axis].min(key[axis]);
                high[axis] = high[axis].max(key[axis]);
            }
        }
        let Some((low, high)) = need else {
            *self = Self::new(self.requested_resolution_m, self.max_distance_m);
            return;
        };
        let is_other = volume.revision() < self.seen_revision
            || cells_per_block != self.cells_per_block
            || (resolution_m - self.resolution_m).abs() > 1e-12
            || self.state.is_empty();
        let (old_low, old_size) = (self.low, self.size);
        let first = |axis: usize| old_low[axis] / cells_per_block;
        let last = |axis: usize| first(axis) + old_size[axis] as i32 / cells_per_block - 1;
        if !is_other && (0..3).all(|axis| first(axis) < low[axis] && high[axis] < last(axis)) {
            return;
        }
        report.is_rebuilt = true;
        for axis in 0..3 {
            // At least one block of unknown space all round: cells on the border of the grid are never free.
            let margin = if axis == 2 { 1 } else { 5 };
            let keep_low = !is_other && first(axis) < low[axis];
            let keep_high = !is_other && last(axis) > high[axis];
            let from = if keep_low { first(axis) } else { low[axis] - margin };
            let to = if keep_high { last(axis) } else { high[axis] + margin };
            self.low[axis] = from * cells_per_block;
            self.size[axis] = ((to - from + 1) * cells_per_block) as usize;
        }
        self.resolution_m = resolution_m;
        self.cells_per_block = cells_per_block;
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
        self.seen_revision = 0;
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
                    }
                }
            }
        }
        changed
    }

    pub(crate) fn pass_z(&mut self, dirty: &[bool], dirty_y_lines: &mut [bool]) -> usize {
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
                    dirty_y_lines[z * nx + column % nx] = true;
                }
            }
        }
        lines
    }

    pub(crate) fn pass_y(&mut self, dirty: &[bool], dirty_x_lines: &mut [bool]) -> usize {
        let [nx, ny, nz] = self.size;
        let mut lines = 0;
        let mut line = vec![FAR; ny];
        let mut out = vec![(BEYOND, 0i16); ny];
        let mut envelope = Envelope::default();
        for z in 0..nz {
            for x in (0..nx).filter(|x| dirty[z * nx + x]) {
                lines += 1;
                let first = x + nx * ny * z;
                for (y, value) in line.iter_mut().enumerate() {
                    let up = self.up[first + nx * y];
                    *value = if up == NOWHERE { FAR } else { i32::from(up).pow(2) as u32 };
                }
                self.run(&mut envelope, &line, &mut out);
                for (y, (squared, site)) in out.iter().enumerate() {
                    let i = first + nx * y;
                    self.plane_site[i] = *site;
                    if self.plane[i] != *squared {
                        self.plane[i] = *squared;
                        dirty_x_lines[z * ny + y] = true;
                    }
                }
            }
        }
        lines
    }

    pub(crate) fn pass_x(&mut self, dirty: &[bool]) -> usize {
        let [nx, ny, nz] = self.size;
        let mut lines = 0;
        let mut line = vec![FAR; nx];
        let mut out = vec![(BEYOND, 0i16); nx];
        let mut envelope = Envelope::default();
        for yz in (0..ny * nz).filter(|l| dirty[*l]) {
            lines += 1;
            let first = nx * yz;
            for (value, squared) in line.iter_mut().zip(&self.plane[first..first + nx]) {
                *value = if *squared == BEYOND { FAR } else { u32::from(*squared) };
            }
            self.run(&mut envelope, &line, &mut out);
            for (x, (squared, site)) in out.iter().enumerate() {
                self.squared[first + x] = *squared;
                self.site[first + x] = *site;
            }
        }
        lines
    }

    fn run(&self, envelope: &mut Envelope, line: &[u32], out: &mut [(u16, i16)]) {
        out.fill((BEYOND, 0));
        envelope.build(line);
        envelope.for_each(line.len(), |x, squared, site| {
            if squared <= self.reach_squared {
                out[x] = (squared as u16, (site as i32 - x as i32) as i16);
            }
        });
    }
}
