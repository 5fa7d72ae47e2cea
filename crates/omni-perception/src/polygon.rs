//! Masks from polygons, as COCO files give them.
//!
//! A pixel belongs to a polygon if its middle lies inside by the even-odd rule; a mask of several polygons is their union.
//! (pycocotools draws the outline five times enlarged instead: the two differ by pixels of the border only.)

use crate::{Rle, RleError, Span};

/// Crossings of edges with columns in one mask; more are refused.
const MAX_CROSSINGS: usize = 1 << 20;

impl Rle {
    /// The union of polygons given by their corners (x to the right, y down, pixel middles at +0.5). What lies outside the
    /// image is cut off; polygons of fewer than three corners are empty.
    ///
    /// # Errors
    /// [`RleError`] if the size is unsound, a corner is not finite, or the outlines cross too many columns.
    pub fn from_polygons(width: u32, height: u32, polygons: &[Vec<[f64; 2]>]) -> Result<Rle, RleError> {
        Rle::from_polygons_within(width, height, polygons, &mut { MAX_CROSSINGS })
    }

    /// The same with a bound on the work: edges may cross `crossings_left` columns, from which those that they cross are taken.
    /// For text from strangers, who may send many masks with many edges.
    ///
    /// # Errors
    /// As [`Rle::from_polygons`].
    pub fn from_polygons_within(
        width: u32,
        height: u32,
        polygons: &[Vec<[f64; 2]>],
        crossings_left: &mut usize,
    ) -> Result<Rle, RleError> {
        let limit = *crossings_left;
        let mut spans: Vec<Span> = Vec::new();
        let mut crossings: Vec<(u32, f64)> = Vec::new();
        for polygon in polygons {
            if polygon.iter().flatten().any(|x| !x.is_finite()) {
                return Err(RleError::Corner);
            }
            crossings.clear();
            for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
                cross_columns(width, *a, *b, &mut crossings, crossings_left).ok_or(RleError::Outline { limit })?;
            }
            // Columns in order, and in each the heights at which its middle line enters and leaves.
            crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            for of_column in crossings.chunk_by(|a, b| a.0 == b.0) {
                for pair in of_column.chunks_exact(2) {
                    // Row r is inside if pair.0 <= r + 0.5 < pair.1.
                    let row = |y: f64| (y - 0.5).ceil().clamp(0.0, f64::from(height)) as u32;
                    let (top, bottom) = (row(pair[0].1), row(pair[1].1));
                    if top < bottom {
                        spans.push(Span { column: of_column[0].0, top, bottom });
                    }
                }
            }
        }
        Rle::from_spans(width, height, spans)
    }
}

/// Where an edge crosses the middle lines of columns; `None` if that is more than is left. Half-open, so that a corner on a
/// line counts once.
fn cross_columns(
    width: u32,
    a: [f64; 2],
    b: [f64; 2],
    crossings: &mut Vec<(u32, f64)>,
    crossings_left: &mut usize,
) -> Option<()> {
    let (left, right) = if a[0] <= b[0] { (a, b) } else { (b, a) };
    let first_after = |x: f64| (x - 0.5).ceil().clamp(0.0, f64::from(width)) as u32;
    let columns = first_after(left[0])..first_after(right[0]);
    *crossings_left = crossings_left.checked_sub(columns.len())?;
    let slope = (right[1] - left[1]) / (right[0] - left[0]);
    crossings.extend(columns.map(|column| (column, left[1] + slope * (f64::from(column) + 0.5 - left[0]))));
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(polygons: &[Vec<[f64; 2]>]) -> String {
        let rle = Rle::from_polygons(8, 4, polygons).expect("sound");
        let row = |v| (0..8).map(|u| if rle.contains(u, v) { '#' } else { '.' }).collect::<String>();
        (0..4).map(row).collect::<Vec<_>>().join("/")
    }

    #[test]
    fn rectangles_triangles_and_unions() {
        let rectangle = vec![[1.0, 1.0], [4.0, 1.0], [4.0, 3.0], [1.0, 3.0]];
        assert_eq!(rows(std::slice::from_ref(&rectangle)), "......../.###..../.###..../........");
        let reversed: Vec<_> = rectangle.iter().rev().copied().collect();
        assert_eq!(rows(&[reversed]), rows(std::slice::from_ref(&rectangle)));
        // Two that overlap are one, and a corner outside the image is cut off.
        let other = vec![[3.0, 2.0], [99.0, 2.0], [99.0, 99.0], [3.0, 99.0]];
        assert_eq!(rows(&[rectangle, other]), "......../.###..../.#######/...#####");
        let triangle = vec![[0.0, 0.0], [8.0, 0.0], [0.0, 4.0]];
        assert_eq!(rows(&[triangle]), "#######./#####.../###...../#.......");
    }

    #[test]
    fn degenerate_and_hostile_outlines() {
        assert_eq!(rows(&[]), rows(&[vec![], vec![[1.0, 1.0]], vec![[0.0, 0.0], [5.0, 3.0]]]));
        let nan = vec![[0.0, 0.0], [f64::NAN, 1.0], [3.0, 3.0]];
        assert_eq!(Rle::from_polygons(8, 4, &[nan]), Err(RleError::Corner));
        let huge = vec![[-1e300, -1e300], [1e300, -1e300], [1e300, 1e300], [-1e300, 1e300]];
        assert_eq!(rows(&[huge]), "########/########/########/########");
        let zigzag: Vec<[f64; 2]> = (0..400).map(|k| [if k % 2 == 0 { 0.0 } else { 32768.0 }, f64::from(k)]).collect();
        assert!(matches!(Rle::from_polygons(32768, 400, &[zigzag]), Err(RleError::Outline { .. })));
        assert!(matches!(Rle::from_polygons(0, 4, &[]), Err(RleError::Size { .. })));
        // The bound holds for all polygons together.
        let square = vec![[0.0, 0.0], [100.0, 0.0], [100.0, 3.0], [0.0, 3.0]];
        let mut left = 450;
        let two = [square.clone(), square];
        assert!(Rle::from_polygons_within(100, 4, &two, &mut left).is_ok());
        assert_eq!(left, 50);
        assert!(matches!(Rle::from_polygons_within(100, 4, &two, &mut left), Err(RleError::Outline { .. })));
    }
}
