//! Masks that show the same thing: two names for the same pixels, or one thing cut in two by the seam.

use crate::Mask;
use crate::mask_outline::Outline;

/// For each mask the smallest index of a mask that shows the same thing.
///
/// Masks of one thing overlap by at least `same_thing_iou`, or carry the same label, touch the seam from both sides
/// and share a row there. Video numbers do not count here: two things under one number are still two things.
pub(crate) fn group_masks(masks: &[Mask], outlines: &[Outline], width: u32, same_thing_iou: f64) -> Vec<u16> {
    let mut group: Vec<usize> = (0..masks.len()).collect();
    for second in 0..masks.len() {
        for first in 0..second {
            let fits = masks[first].rle.width() == width && masks[second].rle.width() == width;
            if !fits || group[first] == group[second] {
                continue;
            }
            let (a, b) = (&outlines[first], &outlines[second]);
            let is_same = (masks[first].label == masks[second].label && is_split_by_seam(a, b, width))
                || iou_reaches(a, b, same_thing_iou);
            if is_same {
                let (low, high) = (group[first].min(group[second]), group[first].max(group[second]));
                group.iter_mut().filter(|g| **g == high).for_each(|g| *g = low);
            }
        }
    }
    group.into_iter().map(|g| g.min(usize::from(u16::MAX)) as u16).collect()
}

fn iou_reaches(a: &Outline, b: &Outline, limit: f64) -> bool {
    let (small, large) = (a.area_px.min(b.area_px) as f64, a.area_px.max(b.area_px) as f64);
    if small == 0.0 || small < limit * large {
        return false;
    }
    let shared = a.shared_px(b);
    shared as f64 >= limit * (a.area_px + b.area_px - shared) as f64 && shared > 0
}

fn is_split_by_seam(a: &Outline, b: &Outline, width: u32) -> bool {
    let meets = |left: &Outline, right: &Outline| {
        let (first, last) = (left.in_column(0), right.in_column(width - 1));
        first.iter().any(|x| last.iter().any(|y| x.top < y.bottom && y.top < x.bottom))
    };
    meets(a, b) || meets(b, a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rle;

    fn mask(label: &str, is_set: impl Fn(u32, u32) -> bool) -> Mask {
        let rows: Vec<bool> = (0..200).map(|i| is_set(i % 20, i / 20)).collect();
        let rle = Rle::from_rows(20, 10, &rows).expect("200 pixels");
        Mask::new(rle, label, 0.5)
    }

    fn groups(masks: &[Mask]) -> Vec<u16> {
        let outlines: Vec<Outline> = masks.iter().map(|mask| Outline::new(&mask.rle)).collect();
        group_masks(masks, &outlines, 20, 0.5)
    }

    #[test]
    fn two_names_for_one_thing_and_a_thing_across_the_seam() {
        let masks = [
            mask("sofa", |u, v| u < 4 && v < 4),
            mask("chair", |u, v| (10..14).contains(&u) && v < 4),
            mask("armchair", |u, v| (10..14).contains(&u) && v < 5),
            mask("sofa", |u, v| u > 17 && (2..6).contains(&v)),
            mask("lamp", |u, v| u > 17 && v > 7),
        ];
        assert_eq!(groups(&masks), [0, 1, 1, 0, 4]);
        assert_eq!(groups(&[]), [0_u16; 0]);
    }
}
