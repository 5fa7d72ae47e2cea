//! Which of two overlapping masks a pixel belongs to.
//!
//! Segmenters give masks that overlap: borders bleed into the neighbour, a mask of a table covers the cup on it, a
//! second, poorer mask covers half of a thing. Two rules, in this order:
//!
//! 1. a mask that lies inside another is on top of it, whatever the scores: the cup is a thing of its own, and small
//!    things score lower than the large ones they stand on;
//! 2. else the higher score is on top (then the smaller mask, then the first).
//!
//! The score alone takes the cup from the robot; the area alone gives the pixels of a sofa to a small false alarm beside
//! it. Measured on simulated rooms (`apps/arena/tests/label_accuracy.rs`).

use std::cmp::Reverse;

use crate::Mask;
use crate::mask_outline::Outline;
use crate::observation::sound_score;

/// A mask with this share of its pixels inside another lies inside it. Borders bleed by some pixels, so it is not 1.
const INSIDE_SHARE: f64 = 0.8;

/// The indices of `members`, topmost first.
pub(crate) fn stacked(masks: &[Mask], outlines: &[Outline], members: &[usize]) -> Vec<usize> {
    let mut ranked = members.to_vec();
    ranked.sort_by_key(|&index| {
        // Sound scores are positive, and so their bits are in the order of their values.
        (Reverse(sound_score(masks[index].score).to_bits()), outlines[index].area_px, index)
    });
    // By falling score, but before each mask those that lie inside it. Inner masks are smaller: no cycles.
    let mut order = Vec::with_capacity(ranked.len());
    let mut is_placed = vec![false; ranked.len()];
    let mut open: Vec<(usize, usize)> = Vec::new();
    for first in 0..ranked.len() {
        open.push((first, 0));
        while let Some((outer, from)) = open.pop() {
            if is_placed[outer] {
                continue;
            }
            let lies_inside =
                |&inner: &usize| !is_placed[inner] && lies_inside(&outlines[ranked[inner]], &outlines[ranked[outer]]);
            match (from..ranked.len()).find(lies_inside) {
                Some(inner) => open.extend([(outer, inner + 1), (inner, 0)]),
                None => {
                    is_placed[outer] = true;
                    order.push(ranked[outer]);
                }
            }
        }
    }
    order
}

fn lies_inside(inner: &Outline, outer: &Outline) -> bool {
    // Of equal areas neither is inside.
    inner.area_px < outer.area_px && inner.shared_px(outer) as f64 >= INSIDE_SHARE * inner.area_px.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rle;

    fn check(rectangles: &[(std::ops::Range<u32>, f32)], expected: &[usize]) {
        let masks: Vec<Mask> = rectangles
            .iter()
            .map(|(columns, score)| {
                let pixels: Vec<bool> = (0..200).map(|i| columns.contains(&(i % 20))).collect();
                Mask::new(Rle::from_rows(20, 10, &pixels).expect("200 pixels"), "thing", *score)
            })
            .collect();
        let outlines: Vec<Outline> = masks.iter().map(|mask| Outline::new(&mask.rle)).collect();
        let members: Vec<usize> = (0..masks.len()).collect();
        assert_eq!(stacked(&masks, &outlines, &members), expected);
    }

    #[test]
    fn inside_goes_before_score_and_score_before_area() {
        check(&[], &[]);
        check(&[(0..10, 0.9), (2..6, 0.3)], &[1, 0]); // a cup on a table
        check(&[(0..10, 0.9), (8..12, 0.3)], &[0, 1]); // a false alarm half beside it
        check(&[(0..10, 0.3), (8..12, 0.9)], &[1, 0]);
        check(&[(0..10, 0.5), (5..12, 0.5)], &[1, 0]); // equal scores: the smaller
        check(&[(0..4, 0.5), (2..6, 0.5)], &[0, 1]); // and the first
        check(&[(0..4, f32::NAN), (2..6, 0.5)], &[1, 0]);
    }

    #[test]
    fn things_inside_things_inside_things() {
        // The shelf is the best mask, but the box on it and the book in the box lie on top.
        check(&[(0..16, 0.99), (2..10, 0.5), (3..5, 0.2), (15..19, 0.6)], &[2, 1, 0, 3]);
    }
}
