//! A set of pixels as vertical runs, with the border operations of a careless segmenter, and its COCO run lengths.
//!
//! COCO lists run lengths of zeros and ones in turn over the picture in column-major order, zeros first (may be 0).

use std::collections::BTreeMap;

/// Rows `from..to` of one column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Run {
    /// Column.
    pub column: u32,
    /// First row.
    pub from: u32,
    /// Row after the last.
    pub to: u32,
}

/// Pixels of a picture. Runs are sorted, not empty and do not touch each other within a column.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Region {
    runs: Vec<Run>,
}

/// The regions of each value but 0 in a column-major picture, by value.
pub fn regions_of(pixels: &[u32], height: u32) -> BTreeMap<u32, Region> {
    let mut regions: BTreeMap<u32, Region> = BTreeMap::new();
    for (column, rows) in pixels.chunks_exact(height.max(1) as usize).enumerate() {
        let mut from = 0;
        for run in rows.chunk_by(|a, b| a == b) {
            let to = from + run.len() as u32;
            if run[0] != 0 {
                let column = column as u32;
                regions.entry(run[0]).or_default().runs.push(Run { column, from, to });
            }
            from = to;
        }
    }
    regions
}

impl Region {
    /// From runs in any order; overlapping ones are merged.
    pub fn from_runs(mut runs: Vec<Run>) -> Region {
        runs.retain(|r| r.from < r.to);
        runs.sort_unstable();
        let mut merged: Vec<Run> = Vec::with_capacity(runs.len());
        for run in runs {
            match merged.last_mut() {
                Some(last) if last.column == run.column && run.from <= last.to => {
                    last.to = last.to.max(run.to);
                }
                _ => merged.push(run),
            }
        }
        Region { runs: merged }
    }

    /// The pixels of an axis-parallel ellipse that lie in a picture of `width` x `height`.
    pub fn ellipse(center: (f64, f64), axes: (f64, f64), width: u32, height: u32) -> Region {
        let first = (center.0 - axes.0).ceil().max(0.0) as u32;
        let last = (center.0 + axes.0).floor().clamp(-1.0, f64::from(width) - 1.0);
        let mut runs = Vec::new();
        for column in first..(last + 1.0) as u32 {
            let x = (f64::from(column) - center.0) / axes.0;
            let half = axes.1 * (1.0 - x * x).max(0.0).sqrt();
            let from = (center.1 - half).ceil().clamp(0.0, f64::from(height)) as u32;
            let to = (center.1 + half).floor().clamp(-1.0, f64::from(height) - 1.0) as i64 + 1;
            runs.push(Run { column, from, to: to as u32 });
        }
        Region::from_runs(runs)
    }

    /// The runs, by column and row.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Number of pixels.
    pub fn area(&self) -> u64 {
        self.runs.iter().map(|r| u64::from(r.to - r.from)).sum()
    }

    /// Whether there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Cuts a region that touches both the first and the last column at its widest empty gap: in the picture it is two.
    pub fn split_at_seam(self, width: u32) -> Vec<Region> {
        let touches = |column| self.runs.iter().any(|r| r.column == column);
        if width < 2 || !(touches(0) && touches(width - 1)) {
            return vec![self];
        }
        let gap = |i: &usize| self.runs[*i].column - self.runs[*i - 1].column;
        let widest = (1..self.runs.len()).max_by_key(|i| (gap(i), std::cmp::Reverse(*i)));
        match widest {
            Some(i) if gap(&i) > 1 => {
                let (left, right) = self.runs.split_at(i);
                [left, right].map(|runs| Region { runs: runs.to_vec() }).into()
            }
            _ => vec![self],
        }
    }

    /// Moved by whole pixels; what leaves the picture is lost.
    pub fn shifted(&self, columns: i64, rows: i64, width: u32, height: u32) -> Region {
        let row = |r: u32| (i64::from(r) + rows).clamp(0, i64::from(height)) as u32;
        let moved = self.runs.iter().filter_map(|run| {
            let column = i64::from(run.column) + columns;
            (0..i64::from(width)).contains(&column).then(|| Run {
                column: column as u32,
                from: row(run.from),
                to: row(run.to),
            })
        });
        Region::from_runs(moved.collect())
    }

    /// All pixels at most `radius` (Euclidean) from the region.
    pub fn dilated(&self, radius: u32, width: u32, height: u32) -> Region {
        let mut runs = Vec::with_capacity(self.runs.len() * (2 * radius as usize + 1));
        for (offset, reach) in disc(radius) {
            for run in &self.runs {
                let column = i64::from(run.column) + offset;
                if (0..i64::from(width)).contains(&column) {
                    runs.push(Run {
                        column: column as u32,
                        from: run.from.saturating_sub(reach),
                        to: (run.to + reach).min(height),
                    });
                }
            }
        }
        Region::from_runs(runs)
    }

    /// All pixels with no pixel outside the region within `radius`; the picture's border does not count as outside.
    pub fn eroded(&self, radius: u32, width: u32, height: u32) -> Region {
        let (Some(first), Some(last)) = (self.runs.first(), self.runs.last()) else {
            return Region::default();
        };
        let columns = first.column..(last.column + 1).min(width);
        let around = columns.start.saturating_sub(radius)..columns.end.saturating_add(radius).min(width);
        let outside = self.complement(around, height);
        outside.dilated(radius, width, height).complement(columns, height)
    }

    /// The other pixels of some columns.
    fn complement(&self, columns: std::ops::Range<u32>, height: u32) -> Region {
        let mut runs = Vec::new();
        let mut next = self.runs.partition_point(|r| r.column < columns.start);
        for column in columns {
            let mut from = 0;
            while let Some(run) = self.runs.get(next).filter(|r| r.column == column) {
                if from < run.from {
                    runs.push(Run { column, from, to: run.from });
                }
                from = run.to;
                next += 1;
            }
            if from < height {
                runs.push(Run { column, from, to: height });
            }
        }
        Region { runs }
    }

    /// COCO's run lengths for a picture of `width` x `height`; they sum to its number of pixels.
    pub fn coco_counts(&self, width: u32, height: u32) -> Vec<u32> {
        let mut counts = vec![0_u32];
        let mut end = 0; // index after the last run of ones
        for run in &self.runs {
            let from = run.column * height + run.from;
            let length = run.to - run.from;
            if from == end && counts.len() > 1 {
                // Continues from the foot of one column to the head of the next.
                *counts.last_mut().expect("counts starts with one entry") += length;
            } else {
                if counts.len() == 1 {
                    counts[0] = from;
                } else {
                    counts.push(from - end);
                }
                counts.push(length);
            }
            end = from + length;
        }
        let total = width * height;
        if counts.len() == 1 {
            counts[0] = total;
        } else if end < total {
            counts.push(total - end);
        }
        counts
    }
}

/// Columns of a disc and how far each reaches up and down.
fn disc(radius: u32) -> impl Iterator<Item = (i64, u32)> {
    let r = i64::from(radius);
    (-r..=r).map(move |x| (x, ((r * r - x * x) as f64).sqrt() as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 4 x 3 picture, column-major.
    fn picture() -> Region {
        let pixels = [0, 0, 5, /**/ 5, 5, 0, /**/ 0, 0, 0, /**/ 0, 5, 5];
        regions_of(&pixels, 3).remove(&5).unwrap()
    }

    #[test]
    fn coco_counts_by_hand() {
        // 2 zeros, 3 ones over the border of the columns, 5 zeros, 2 ones.
        assert_eq!(picture().coco_counts(4, 3), [2, 3, 5, 2]);
        assert_eq!(Region::default().coco_counts(4, 3), [12]);
        let all = regions_of(&[1; 12], 3).remove(&1).unwrap();
        assert_eq!(all.coco_counts(4, 3), [0, 12]);
    }

    #[test]
    fn what_crosses_the_seam_becomes_two() {
        let parts = picture().split_at_seam(4);
        assert_eq!(parts.iter().map(Region::area).collect::<Vec<_>>(), [3, 2]);
        assert_eq!(picture().split_at_seam(9).len(), 1);
    }

    #[test]
    fn erosion_undoes_dilation_of_a_block() {
        let block = Region::ellipse((20.0, 20.0), (6.0, 8.0), 64, 48);
        let grown = block.dilated(2, 64, 48);
        assert!(grown.area() > block.area());
        assert_eq!(grown.eroded(2, 64, 48).area(), block.area());
        assert!(block.eroded(20, 64, 48).is_empty());
    }
}
