//! Which mask a pixel belongs to, for many masks at once: eroded spans by column, best mask first, no expansion.
//!
//! Every mask is eroded by a disc before the look-up, because masks bleed over the border of their object and the
//! points just outside lie on whatever is behind. A mask too thin for the disc is eroded less. At the seam columns
//! wrap; above the first and below the last row nothing is known, so nothing is eroded there.

use crate::{Mask, Rle, Span};

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
    /// Indexes masks of the given size. Where masks overlap, the smaller one is on top: a cup on a table, a cushion
    /// on a sofa.
    pub(crate) fn new(masks: &[Mask], width: u32, height: u32, config: &Erosion) -> MaskIndex {
        let fits = |mask: &Mask| (mask.rle.width(), mask.rle.height()) == (width, height);
        let mut order: Vec<(u64, usize)> = (0..masks.len().min(usize::from(u16::MAX)))
            .filter(|&index| fits(&masks[index]))
            .map(|index| (masks[index].rle.area(), index))
            .collect();
        order.sort_unstable();
        let mut columns: Vec<Vec<Entry>> = vec![Vec::new(); width as usize];
        for &(_, index) in &order {
            for span in eroded(&masks[index].rle, config) {
                add_below(&mut columns[span.column as usize], &span, index as u16);
            }
        }
        let mut start = Vec::with_capacity(width as usize + 1);
        let mut entries = Vec::new();
        for column in &mut columns {
            start.push(entries.len() as u32);
            column.sort_unstable_by_key(|entry| entry.top);
            entries.append(column);
        }
        start.push(entries.len() as u32);
        MaskIndex { start, entries, skipped: masks.len() - order.len() }
    }

    /// All rows that show a mask.
    pub(crate) fn spans(&self) -> impl Iterator<Item = Span> + '_ {
        let of_column = |column: usize| &self.entries[self.start[column] as usize..self.start[column + 1] as usize];
        (0..self.start.len() - 1).flat_map(move |column| {
            of_column(column).iter().map(move |entry| Span {
                column: column as u32,
                top: u32::from(entry.top),
                bottom: u32::from(entry.bottom),
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

/// The mask without its border: the largest radius up to the wanted one that keeps enough of the area.
pub(crate) fn eroded(mask: &Rle, config: &Erosion) -> Vec<Span> {
    let area = mask.area() as f64;
    for radius in (1..=config.radius_px).rev() {
        let spans = eroded_by(mask, radius);
        let kept: u64 = spans.iter().map(|span| u64::from(span.bottom - span.top)).sum();
        if kept > 0 && kept as f64 >= config.min_kept_share * area {
            return spans;
        }
    }
    mask.spans().collect()
}

/// Pixels whose whole disc of `radius` belongs to the mask, by column.
pub(crate) fn eroded_by(mask: &Rle, radius: u32) -> Vec<Span> {
    let (width, height) = (mask.width() as usize, mask.height());
    let mut columns: Vec<Vec<(u32, u32)>> = vec![Vec::new(); width];
    for span in mask.spans() {
        columns[span.column as usize].push((span.top, span.bottom));
    }
    let mut spans = Vec::new();
    let (mut left, mut merged) = (Vec::new(), Vec::new());
    for column in (0..width).filter(|&column| !columns[column].is_empty()) {
        shrink(&columns[column], radius, height, &mut left);
        for across in 1..=radius.min(width as u32 - 1) {
            // Half height of the disc at this distance from its middle.
            let half = ((radius * radius - across * across) as f64).sqrt() as u32;
            for other in [column + across as usize, column + width - across as usize] {
                let mut shrunk = Vec::new();
                shrink(&columns[other % width], half, height, &mut shrunk);
                intersect(&left, &shrunk, &mut merged);
                std::mem::swap(&mut left, &mut merged);
            }
        }
        spans.extend(left.iter().map(|&(top, bottom)| Span { column: column as u32, top, bottom }));
    }
    spans
}

/// Takes `by` rows from both ends of each span, except where a span touches the edge of the image.
fn shrink(spans: &[(u32, u32)], by: u32, height: u32, shrunk: &mut Vec<(u32, u32)>) {
    shrunk.clear();
    for &(top, bottom) in spans {
        let top = if top == 0 { 0 } else { top + by };
        let bottom = if bottom == height { height } else { bottom.saturating_sub(by) };
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

/// Adds the rows of `span` that no earlier entry of the column has.
fn add_below(column: &mut Vec<Entry>, span: &Span, mask: u16) {
    let mut taken: Vec<(u32, u32)> = column.iter().map(|e| (u32::from(e.top), u32::from(e.bottom))).collect();
    taken.sort_unstable();
    let mut top = span.top;
    for (taken_top, taken_bottom) in taken.into_iter().chain([(span.bottom, span.bottom)]) {
        let bottom = taken_top.min(span.bottom);
        if top < bottom {
            column.push(Entry { top: top as u16, bottom: bottom as u16, mask });
        }
        top = top.max(taken_bottom);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> Rle {
        let pixels: Vec<bool> = (0..20 * 10).map(|i| columns.contains(&(i % 20)) && rows.contains(&(i / 20))).collect();
        Rle::from_rows(20, 10, &pixels).expect("200 pixels")
    }

    fn mask(rle: Rle) -> Mask {
        Mask { rle, label: "thing".into(), score: 1.0, caption: String::new() }
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
    fn the_smaller_mask_is_on_top() {
        let none = Erosion { radius_px: 0, min_kept_share: 0.0 };
        let odd = mask(Rle::from_counts(2, 2, &[0, 4]).expect("four pixels"));
        let masks = [mask(rectangle(0..10, 0..10)), mask(rectangle(2..6, 3..6)), odd];
        let index = MaskIndex::new(&masks, 20, 10, &none);
        assert_eq!(index.skipped, 1);
        for column in 0..20 {
            for row in 0..10 {
                let expected = if masks[1].rle.contains(column, row) {
                    Some(1)
                } else {
                    masks[0].rle.contains(column, row).then_some(0)
                };
                assert_eq!(index.mask_at(column, row), expected);
            }
        }
    }
}
