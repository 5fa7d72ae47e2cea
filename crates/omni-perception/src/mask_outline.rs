//! A mask prepared for comparison with others: its spans by column, its area, and the box around it.

use crate::{Rle, Span};

/// The spans of a mask and what is often asked of them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Outline {
    /// Ascending by column, then by row.
    pub(crate) spans: Vec<Span>,
    pub(crate) area_px: u64,
    /// First and last row, exclusive; (height, 0) of an empty mask.
    rows: (u32, u32),
}

impl Outline {
    pub(crate) fn new(mask: &Rle) -> Outline {
        let spans: Vec<Span> = mask.spans().collect();
        let rows =
            spans.iter().fold((mask.height(), 0), |(top, bottom), span| (span.top.min(top), span.bottom.max(bottom)));
        Outline { spans, area_px: mask.area(), rows }
    }

    /// The spans of one column.
    pub(crate) fn in_column(&self, column: u32) -> &[Span] {
        let first = self.spans.partition_point(|span| span.column < column);
        let count = self.spans[first..].partition_point(|span| span.column == column);
        &self.spans[first..first + count]
    }

    /// Number of pixels that belong to both masks.
    pub(crate) fn shared_px(&self, other: &Outline) -> u64 {
        let columns = |outline: &Outline| Some((outline.spans.first()?.column, outline.spans.last()?.column));
        let (Some(a), Some(b)) = (columns(self), columns(other)) else { return 0 };
        let are_apart = a.1 < b.0 || b.1 < a.0 || self.rows.1 <= other.rows.0 || other.rows.1 <= self.rows.0;
        if are_apart {
            return 0;
        }
        let mut shared = 0;
        let (mut i, mut j) = (0, 0);
        while let (Some(a), Some(b)) = (self.spans.get(i), other.spans.get(j)) {
            if a.column == b.column {
                shared += u64::from(a.bottom.min(b.bottom).saturating_sub(a.top.max(b.top)));
            }
            if (a.column, a.bottom) < (b.column, b.bottom) { i += 1 } else { j += 1 }
        }
        shared
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> Outline {
        let pixels: Vec<bool> = (0..200).map(|i| columns.contains(&(i % 20)) && rows.contains(&(i / 20))).collect();
        Outline::new(&Rle::from_rows(20, 10, &pixels).expect("200 pixels"))
    }

    #[test]
    fn shared_pixels_of_rectangles() {
        let a = rectangle(2..8, 1..5);
        assert_eq!(a.area_px, 24);
        assert_eq!(a.shared_px(&a), 24);
        assert_eq!(a.shared_px(&rectangle(5..12, 3..9)), 6);
        assert_eq!(a.shared_px(&rectangle(8..12, 3..9)), 0);
        assert_eq!(a.shared_px(&rectangle(2..8, 5..9)), 0);
        assert_eq!(a.shared_px(&rectangle(0..0, 0..0)), 0);
        assert_eq!(a.in_column(3), [Span { column: 3, top: 1, bottom: 5 }]);
        assert!(a.in_column(8).is_empty());
    }
}
