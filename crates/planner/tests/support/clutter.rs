//! Scattered rectangles in a 5 m square, and places among them.

use std::ops::Range;

use nalgebra::Point2;
use proptest::prelude::*;

use super::Picture;

/// So many rectangles with sides of up to `largest_m`, on cells of 5 cm.
pub fn clutter(count: Range<usize>, largest_m: f64) -> impl Strategy<Value = Picture> {
    let side = 0.02..largest_m;
    proptest::collection::vec((0.0..4.8f64, 0.0..4.8f64, side.clone(), side), count).prop_map(|boxes| {
        let mut picture = Picture::free(5.0, 5.0, 0.05);
        for (x, y, w, h) in boxes {
            picture.block(x, y, x + w, y + h);
        }
        picture
    })
}

pub fn place() -> impl Strategy<Value = Point2<f64>> {
    (0.0..5.0f64, 0.0..5.0f64).prop_map(|(x, y)| Point2::new(x, y))
}
