//! Run-length encoded masks in COCO's form, looked up without expanding them.
//!
//! Runs go down the columns, first the zeros (possibly none). The compressed string writes each count (from the fourth
//! on the difference to the count two before) in groups of five bits, low first, six-bit characters from '0' on.

use thiserror::Error;

/// A binary mask of `width` x `height` pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rle {
    width: u32,
    height: u32,
    /// End (exclusive) of each run in column-major order; runs alternate, zeros first.
    ends: Vec<u32>,
}

/// Why an encoding was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RleError {
    /// Width or height is zero or above 32768.
    #[error("a mask of {width} x {height} pixels")]
    Size {
        /// Width given.
        width: u32,
        /// Height given.
        height: u32,
    },
    /// The counts do not add up to the number of pixels.
    #[error("counts add up to {sum} instead of {pixels}")]
    Sum {
        /// Sum of the counts (up to the one that passed the number of pixels).
        sum: u64,
        /// Width times height.
        pixels: u64,
    },
    /// A character of the string is outside '0'..='o'.
    #[error("character {position} is not part of a COCO string")]
    Character {
        /// Index of the byte.
        position: usize,
    },
    /// The string ends inside a number, or a number is too large or negative.
    #[error("the number that ends before byte {position} is cut off, too large or negative")]
    Number {
        /// Index of the byte.
        position: usize,
    },
    /// A span is not inside the image.
    #[error("rows {top}..{bottom} of column {column} are not inside the image")]
    Span {
        /// Its column.
        column: u32,
        /// Its first row.
        top: u32,
        /// The row after its last.
        bottom: u32,
    },
    /// A corner of a polygon is NaN or infinite.
    #[error("a corner of a polygon is not finite")]
    Corner,
    /// The outline of a polygon goes to and fro without end.
    #[error("the outline of the polygons crosses more than {limit} columns")]
    Outline {
        /// Crossings that are accepted.
        limit: usize,
    },
}

/// The ones of one column: rows `top..bottom`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// The column.
    pub column: u32,
    /// First row.
    pub top: u32,
    /// Row after the last.
    pub bottom: u32,
}

impl Rle {
    /// A mask from COCO's uncompressed counts.
    ///
    /// # Errors
    /// [`RleError`] if the size is unsound or the counts do not fill it exactly.
    pub fn from_counts(width: u32, height: u32, counts: &[u32]) -> Result<Rle, RleError> {
        if !(1..=32768).contains(&width) || !(1..=32768).contains(&height) {
            return Err(RleError::Size { width, height });
        }
        let pixels = u64::from(width) * u64::from(height);
        let mut sum = 0;
        let mut ends = Vec::with_capacity(counts.len());
        for &count in counts {
            sum += u64::from(count);
            if sum > pixels {
                break;
            }
            ends.push(sum as u32);
        }
        if sum != pixels {
            return Err(RleError::Sum { sum, pixels });
        }
        Ok(Rle { width, height, ends })
    }

    /// A mask from COCO's compressed string.
    ///
    /// # Errors
    /// [`RleError`] with the place of the first fault.
    pub fn from_coco_string(width: u32, height: u32, text: &str) -> Result<Rle, RleError> {
        let mut counts: Vec<u32> = Vec::new();
        let (mut value, mut shift) = (0_i64, 0);
        for (position, byte) in text.bytes().enumerate() {
            let bits = match byte {
                b'0'..=b'o' => i64::from(byte - b'0'),
                _ => return Err(RleError::Character { position }),
            };
            if shift > 30 {
                return Err(RleError::Number { position });
            }
            value |= (bits & 31) << shift;
            shift += 5;
            if bits & 32 != 0 {
                continue;
            }
            if bits & 16 != 0 {
                value -= 1 << shift; // sign extension
            }
            if counts.len() > 2 {
                value += i64::from(counts[counts.len() - 2]);
            }
            let count = u32::try_from(value).map_err(|_| RleError::Number { position: position + 1 })?;
            counts.push(count);
            (value, shift) = (0, 0);
        }
        if shift != 0 {
            return Err(RleError::Number { position: text.len() });
        }
        Rle::from_counts(width, height, &counts)
    }

    /// A mask from one truth value a pixel, row by row.
    ///
    /// # Errors
    /// [`RleError`] if the size is unsound or there are not width x height values.
    pub fn from_rows(width: u32, height: u32, rows: &[bool]) -> Result<Rle, RleError> {
        let pixels = u64::from(width) * u64::from(height);
        if rows.len() as u64 != pixels {
            return Err(RleError::Sum { sum: rows.len() as u64, pixels });
        }
        let mut counts = vec![0];
        let mut current = false;
        for column in 0..width as usize {
            for row in 0..height as usize {
                if rows[row * width as usize + column] != current {
                    counts.push(0);
                    current = !current;
                }
                *counts.last_mut().expect("starts with one count") += 1;
            }
        }
        Rle::from_counts(width, height, &counts)
    }

    /// A mask from its ones; spans in any order, and they may overlap.
    ///
    /// # Errors
    /// [`RleError`] if the size is unsound or a span does not lie in the image.
    pub fn from_spans(width: u32, height: u32, mut spans: Vec<Span>) -> Result<Rle, RleError> {
        if !(1..=32768).contains(&width) || !(1..=32768).contains(&height) {
            return Err(RleError::Size { width, height });
        }
        let is_inside = |span: &&Span| span.column < width && span.top <= span.bottom && span.bottom <= height;
        if let Some(span) = spans.iter().find(|span| !is_inside(span)) {
            return Err(RleError::Span { column: span.column, top: span.top, bottom: span.bottom });
        }
        spans.sort_unstable_by_key(|span| (span.column, span.top));
        // Ends of runs: a run of zeros before each run of ones, and one at the end if any are left.
        let mut ends: Vec<u32> = Vec::with_capacity(2 * spans.len() + 1);
        for span in spans.iter().filter(|span| span.top < span.bottom) {
            let (start, end) = (span.column * height + span.top, span.column * height + span.bottom);
            match ends.last_mut() {
                Some(last) if start <= *last => *last = end.max(*last),
                _ => ends.extend([start, end]),
            }
        }
        if ends.last() != Some(&(width * height)) {
            ends.push(width * height);
        }
        Ok(Rle { width, height, ends })
    }

    /// The box around the ones: first column and row, and those after the last; `None` if there are none.
    pub fn bounds(&self) -> Option<[u32; 4]> {
        self.spans().fold(None, |bounds: Option<[u32; 4]>, span| {
            let [left, top, right, bottom] = bounds.unwrap_or([u32::MAX, u32::MAX, 0, 0]);
            let right = right.max(span.column + 1);
            Some([left.min(span.column), top.min(span.top), right, bottom.max(span.bottom)])
        })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// COCO's uncompressed counts.
    pub fn counts(&self) -> Vec<u32> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        self.ends.iter().zip(starts).map(|(end, start)| end - start).collect()
    }

    /// COCO's compressed string.
    pub fn to_coco_string(&self) -> String {
        let counts = self.counts();
        let mut text = String::new();
        for (index, &count) in counts.iter().enumerate() {
            let before = if index > 2 { i64::from(counts[index - 2]) } else { 0 };
            let mut value = i64::from(count) - before;
            loop {
                let group = value & 31;
                value >>= 5;
                let is_last = if group & 16 != 0 { value == -1 } else { value == 0 };
                text.push(char::from(b'0' + (group | if is_last { 0 } else { 32 }) as u8));
                if is_last {
                    break;
                }
            }
        }
        text
    }

    /// Whether the pixel in `column` and `row` belongs to the mask; false outside. O(log runs).
    pub fn contains(&self, column: u32, row: u32) -> bool {
        if column >= self.width || row >= self.height {
            return false;
        }
        let index = column * self.height + row;
        self.ends.partition_point(|&end| end <= index) % 2 == 1
    }

    /// Number of pixels in the mask.
    pub fn area(&self) -> u64 {
        self.ends.chunks_exact(2).map(|run| u64::from(run[1] - run[0])).sum()
    }

    /// The ones, column by column, each column from the top. Runs that cross into the next column are cut there.
    pub fn spans(&self) -> impl Iterator<Item = Span> + '_ {
        let height = self.height;
        self.ends.chunks_exact(2).filter(|run| run[0] < run[1]).flat_map(move |run| {
            let (start, end) = (run[0], run[1]);
            (start / height..=(end - 1) / height).map(move |column| {
                let first = column * height;
                Span { column, top: start.max(first) - first, bottom: (end - first).min(height) }
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_by_hand() {
        // 0 1 1
        // 0 1 0   columns: 00 11 10
        let mask = Rle::from_counts(3, 2, &[2, 3, 1]).expect("six pixels");
        let rows = [false, true, true, false, true, false];
        assert_eq!(Rle::from_rows(3, 2, &rows), Ok(mask.clone()));
        let seen: Vec<bool> = (0..6).map(|i| mask.contains(i % 3, i / 3)).collect();
        assert_eq!(seen, rows);
        assert_eq!(mask.area(), 3);
        let spans: Vec<_> = mask.spans().map(|s| (s.column, s.top, s.bottom)).collect();
        assert_eq!(spans, [(1, 0, 2), (2, 0, 1)]);
        assert!(!mask.contains(3, 0) && !mask.contains(0, 2));
    }

    #[test]
    fn the_string_form_is_that_of_pycocotools() {
        // pycocotools.mask.encode of a 4 x 3 image (H x W) with ones in rows 1..3 of columns 0 and 1.
        let mask = Rle::from_counts(3, 4, &[1, 2, 2, 2, 5]).expect("twelve pixels");
        let text = mask.to_coco_string();
        assert_eq!(text, "12203");
        assert_eq!(Rle::from_coco_string(3, 4, &text), Ok(mask));
    }

    #[test]
    fn large_counts_take_several_characters() {
        let mask = Rle::from_counts(1920, 640, &[1_000_000, 100, 100, 50, 228_550]).expect("all pixels");
        let text = mask.to_coco_string();
        assert_eq!(Rle::from_coco_string(1920, 640, &text), Ok(mask));
    }

    #[test]
    fn hostile_encodings_are_refused() {
        assert_eq!(Rle::from_counts(2, 2, &[3]), Err(RleError::Sum { sum: 3, pixels: 4 }));
        assert_eq!(Rle::from_counts(2, 2, &[u32::MAX; 9]), Err(RleError::Sum { sum: u32::MAX.into(), pixels: 4 }));
        assert!(matches!(Rle::from_counts(0, 2, &[]), Err(RleError::Size { .. })));
        assert_eq!(Rle::from_coco_string(2, 2, "4 "), Err(RleError::Character { position: 1 }));
        assert!(matches!(Rle::from_coco_string(2, 2, "oooooooooo"), Err(RleError::Number { .. })));
        assert_eq!(Rle::from_coco_string(2, 2, "4o"), Err(RleError::Number { position: 2 }));
        assert!(matches!(Rle::from_coco_string(2, 2, "O"), Err(RleError::Number { .. }))); // negative
        assert!(matches!(Rle::from_rows(2, 2, &[true]), Err(RleError::Sum { .. })));
    }
}
