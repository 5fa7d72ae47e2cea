//! Which mask a pixel belongs to, for many masks at once: eroded spans by column, best mask first, no expansion.
//!
//! Every mask is eroded by a disc before the look-up, because masks bleed over the border of their object and the
//! points just outside lie on whatever is behind. A mask too thin for the disc is eroded less. At the seam columns
//! wrap; above the first and below the last row nothing is known, so nothing is eroded there.

use crate::mask_order::stacked;
use crate::mask_outline::Outline;
use crate::{Mask, Span};

/// Masks beyond this number are skipped: the numbers above have a meaning of their own in the range buffer.
pub(crate) const MAX_MASKS: usize = 0xFFF0;

/// Eroded masks of one image, by column.
#[derive(Debug, Clone)]
pub(crate) struct MaskIndex {
    /// First entry of each column in `entries`, and one past the last.
    start: Vec<u32>,
    entries: Vec<Entry>,
    /// Masks of another size, left out.
    pub(crate) skipped: usize,
}

/// Rows `top..bottom` of a column show `mask`. Entries of a column do not overlap and go down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Entry {
    top: u16,
    bottom: u16,
    mask: u16,
}

impl MaskIndex {
    /// Indexes masks of the given size, with their outlines. Where masks overlap, `mask_order` says which is on top.
    pub(crate) fn new(masks: &[Mask], outlines: &[Outline], width: u32, height: u32, config: &Erosion) -> MaskIndex {
        let fits = |&index: &usize| (masks[index].rle.width(), masks[index].rle.height()) == (width, height);
        let members: Vec<usize> = (0..masks.len().min(MAX_MASKS)).filter(fits).collect();
        let mut eroder = Eroder::new(width, height);
        let mut spans: Vec<(Span, u16)> = Vec::new();
        for index in stacked(masks, outlines, &members) {
            spans.extend(eroder.eroded(&outlines[index], config).into_iter().map(|span| (span, index as u16)));
        }
        // Sorted by column, the topmost mask first in each (counted first, for the spans come mask by mask).
        let mut start = vec![0_u32; width as usize + 1];
        for (span, _) in &spans {
            start[span.column as usize + 1] += 1;
        }
        for column in 0..width as usize {
            start[column + 1] += start[column];
        }
        let mut next = start.clone();
        let mut by_column = vec![(0, 0, 0); spans.len()];
        for (span, mask) in &spans {
            let at = &mut next[span.column as usize];
            by_column[*at as usize] = (span.top, span.bottom, *mask);
            *at += 1;
        }
        let mut entries = Vec::with_capacity(spans.len());
        let mut column_entries = Vec::new();
        let mut entry_start = Vec::with_capacity(start.len());
        for column in start.windows(2) {
            entry_start.push(entries.len() as u32);
            column_entries.clear();
            for &(top, bottom, mask) in &by_column[column[0] as usize..column[1] as usize] {
                add_below(&mut column_entries, top, bottom, mask);
            }
            entries.extend_from_slice(&column_entries);
        }
        entry_start.push(entries.len() as u32);
        MaskIndex { start: entry_start, entries, skipped: masks.len() - members.len() }
    }

    /// All rows that show a mask, column by column and down, with the mask.
    pub(crate) fn spans(&self) -> impl Iterator<Item = (Span, u16)> + '_ {
        let of_column = |column: usize| &self.entries[self.start[column] as usize..self.start[column + 1] as usize];
        (0..self.start.len() - 1).flat_map(move |column| {
            of_column(column).iter().map(move |entry| {
                let (top, bottom) = (u32::from(entry.top), u32::from(entry.bottom));
                (Span { column: column as u32, top, bottom }, entry.mask)
            })
        })
    }

    /// The mask on top at a pixel inside the image.
    pub(crate) fn mask_at(&self, column: u32, row: u32) -> Option<u16> {
        let range = self.start[column as usize] as usize..self.start[column as usize + 1] as usize;
        let row = row as u16;
        let entry = self.entries[range].iter().find(|entry| row < entry.bottom)?;
        (entry.top <= row).then_some(entry.mask)
    }
}

/// How much masks are shrunk.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Erosion {
    pub(crate) radius_px: u32,
    /// The radius is lowered until this share of the area is left.
    pub(crate) min_kept_share: f64,
}

/// Erodes mask after mask with the same buffers.
pub(crate) struct Eroder {
    width: usize,
    height: u32,
    /// First span of each column, and one past the last.
    start: Vec<u32>,
    left: Vec<(u32, u32)>,
    shrunk: Vec<(u32, u32)>,
    merged: Vec<(u32, u32)>,
}

impl Eroder {
    pub(crate) fn new(width: u32, height: u32) -> Eroder {
        let start = vec![0; width as usize + 1];
        Eroder { width: width as usize, height, start, left: Vec::new(), shrunk: Vec::new(), merged: Vec::new() }
    }

    /// The mask without its border: the largest radius up to the wanted one that keeps enough of the area.
    pub(crate) fn eroded(&mut self, mask: &Outline, config: &Erosion) -> Vec<Span> {
        let mut next = 0;
        for column in 0..=self.width {
            while mask.spans.get(next).is_some_and(|span| (span.column as usize) < column) {
                next += 1;
            }
            self.start[column] = next as u32;
        }
        for radius in (1..=config.radius_px).rev() {
            let spans = self.eroded_by(mask, radius);
            let kept: u64 = spans.iter().map(|span| u64::from(span.bottom - span.top)).sum();
            if kept > 0 && kept as f64 >= config.min_kept_share * mask.area_px as f64 {
                return spans;
            }
        }
        mask.spans.clone()
    }

    /// Pixels whose whole disc of `radius` belongs to the mask, by column.
    fn eroded_by(&mut self, mask: &Outline, radius: u32) -> Vec<Span> {
        let width = self.width;
        let of_column = |start: &[u32], column: usize| start[column] as usize..start[column + 1] as usize;
        let mut spans = Vec::with_capacity(mask.spans.len());
        let mut first = 0;
        while let Some(span) = mask.spans.get(first) {
            let column = span.column as usize;
            let own = of_column(&self.start, column);
            first = own.end;
            shrink(&mask.spans[own], radius, self.height, &mut self.left);
            for across in 1..=radius.min(width as u32 - 1) {
                if self.left.is_empty() {
                    break;
                }
                // Half height of the disc at this distance from its middle.
                let half = ((radius * radius - across * across) as f64).sqrt() as u32;
                for other in [column + across as usize, column + width - across as usize] {
                    let other = of_column(&self.start, other % width);
                    shrink(&mask.spans[other], half, self.height, &mut self.shrunk);
                    intersect(&self.left, &self.shrunk, &mut self.merged);
                    std::mem::swap(&mut self.left, &mut self.merged);
                }
            }
            spans.extend(self.left.iter().map(|&(top, bottom)| Span { column: column as u32, top, bottom }));
        }
        spans
    }
}

/// Takes `by` rows from both ends of each span, except where a span touches the edge of the image.
fn shrink(spans: &[Span], by: u32, height: u32, shrunk: &mut Vec<(u32, u32)>) {
    shrunk.clear();
    for span in spans {
        let top = if span.top == 0 { 0 } else { span.top + by };
        let bottom = if span.bottom == height { height } else { span.bottom.saturating_sub(by) };
        if top < bottom {
            shrunk.push((top, bottom));
        }
    }
}

/// Common rows of two lists of spans.
fn intersect(a: &[(u32, u32)], b: &[(u32, u32)], common: &mut Vec<(u32, u32)>) {
    common.clear();
    let (mut i, mut j) = (0, 0);
    while i < a.len() && j < b.len() {
        let (top, bottom) = (a[i].0.max(b[j].0), a[i].1.min(b[j].1));
        if top < bottom {
            common.push((top, bottom));
        }
        if a[i].1 < b[j].1 { i += 1 } else { j += 1 }
    }
}

/// Adds the rows `top..bottom` that no earlier entry of the column has; the entries stay in the order of rows.
fn add_below(column: &mut Vec<Entry>, mut top: u32, bottom: u32, mask: u16) {
    let mut at = column.partition_point(|entry| u32::from(entry.bottom) <= top);
    while top < bottom {
        let taken = column.get(at).map_or((bottom, bottom), |entry| (u32::from(entry.top), u32::from(entry.bottom)));
        let end = taken.0.min(bottom);
        if top < end {
            column.insert(at, Entry { top: top as u16, bottom: end as u16, mask });
            at += 1;
        }
        top = taken.1.max(end);
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rle;

    fn rectangle(columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> Rle {
        let pixels: Vec<bool> = (0..20 * 10).map(|i| columns.contains(&(i % 20)) && rows.contains(&(i / 20))).collect();
        Rle::from_rows(20, 10, &pixels).expect("200 pixels")
    }

    fn eroded(mask: &Rle, config: &Erosion) -> Vec<Span> {
        Eroder::new(mask.width(), mask.height()).eroded(&Outline::new(mask), config)
    }

    const TWO: Erosion = Erosion { radius_px: 2, min_kept_share: 0.15 };

    #[test]
    fn a_disc_takes_two_pixels_from_each_side() {
        let kept: Vec<_> = eroded(&rectangle(4..12, 2..9), &TWO);
        let expected: Vec<_> = (6..10).map(|column| Span { column, top: 4, bottom: 7 }).collect();
        assert_eq!(kept, expected);
    }

    #[test]
    fn thin_masks_keep_something_and_image_edges_are_not_borders() {
        assert_eq!(eroded(&rectangle(4..7, 2..9), &TWO).len(), 1); // radius 1 leaves the middle column
        assert_eq!(eroded(&rectangle(4..5, 2..9), &TWO).len(), 1); // nothing to take
        let cut = eroded(&rectangle(4..12, 0..10), &TWO);
        assert!(cut.iter().all(|span| (span.top, span.bottom) == (0, 10)));
    }

    #[test]
    fn columns_wrap_at_the_seam() {
        let pixels: Vec<bool> = (0..200).map(|i| i % 20 < 4 || i % 20 >= 16).collect();
        let seam = Rle::from_rows(20, 10, &pixels).expect("200 pixels");
        let columns: Vec<u32> = eroded(&seam, &TWO).iter().map(|span| span.column).collect();
        assert_eq!(columns, [0, 1, 18, 19]);
    }

    #[test]
    fn overlapping_masks_share_no_pixel() {
        let none = Erosion { radius_px: 0, min_kept_share: 0.0 };
        let odd = Rle::from_counts(2, 2, &[0, 4]).expect("four pixels");
        let rles = [rectangle(0..10, 0..10), rectangle(2..6, 3..6), odd, rectangle(4..14, 4..8), rectangle(8..9, 2..9)];
        let scores = [0.9, 0.3, 1.0, 0.8, 0.1];
        let masks: Vec<Mask> =
            rles.into_iter().zip(scores).map(|(rle, score)| Mask::new(rle, "thing", score)).collect();
        let outlines: Vec<Outline> = masks.iter().map(|mask| Outline::new(&mask.rle)).collect();
        let index = MaskIndex::new(&masks, &outlines, 20, 10, &none);
        assert_eq!(index.skipped, 1);
        // The two inside the large one, the large one, and what is left of the one beside it.
        let order = [1, 4, 0, 3];
        for column in 0..20 {
            for row in 0..10 {
                let expected = order.into_iter().find(|&mask| masks[mask].rle.contains(column, row));
                assert_eq!(index.mask_at(column, row), expected.map(|mask| mask as u16), "{column} {row}");
            }
        }
        let listed: u32 = index.spans().map(|(span, _)| span.bottom - span.top).sum();
        assert_eq!(listed, 100 + 16);
    }
}
