//! Masks that show the same thing: two names for the same pixels, or one thing cut in two by the seam.

use crate::{Mask, Span};

/// For each mask the smallest index of a mask that shows the same thing.
///
/// Masks of one thing overlap by at least `same_thing_iou`, or carry the same label, touch the seam from both sides
/// and share a row there.
pub(crate) fn group_masks(masks: &[Mask], width: u32, same_thing_iou: f64) -> Vec<u16> {
    let spans: Vec<Vec<Span>> = masks.iter().map(|mask| mask.rle.spans().collect()).collect();
    let areas: Vec<u64> = masks.iter().map(|mask| mask.rle.area()).collect();
    let mut group: Vec<usize> = (0..masks.len()).collect();
    for second in 0..masks.len() {
        for first in 0..second {
            let fits = masks[first].rle.width() == width && masks[second].rle.width() == width;
            if !fits || group[first] == group[second] {
                continue;
            }
            let is_same = is_split_by_seam(&masks[first], &spans[first], &masks[second], &spans[second])
                || iou_reaches(&spans[first], areas[first], &spans[second], areas[second], same_thing_iou);
            if is_same {
                let (low, high) = (group[first].min(group[second]), group[first].max(group[second]));
                group.iter_mut().filter(|g| **g == high).for_each(|g| *g = low);
            }
        }
    }
    group.into_iter().map(|g| g.min(usize::from(u16::MAX)) as u16).collect()
}

fn iou_reaches(a: &[Span], area_a: u64, b: &[Span], area_b: u64, limit: f64) -> bool {
    let (small, large) = (area_a.min(area_b) as f64, area_a.max(area_b) as f64);
    if small == 0.0 || small < limit * large {
        return false;
    }
    let mut shared = 0;
    let (mut i, mut j) = (0, 0);
    while i < a.len() && j < b.len() {
        if a[i].column == b[j].column {
            shared += u64::from(a[i].bottom.min(b[j].bottom).saturating_sub(a[i].top.max(b[j].top)));
        }
        if (a[i].column, a[i].bottom) < (b[j].column, b[j].bottom) { i += 1 } else { j += 1 }
    }
    shared as f64 >= limit * (area_a + area_b - shared) as f64 && shared > 0
}

fn is_split_by_seam(a: &Mask, spans_a: &[Span], b: &Mask, spans_b: &[Span]) -> bool {
    if a.label != b.label {
        return false;
    }
    let last_column = a.rle.width() - 1;
    let at = |spans: &[Span], column: u32| -> Vec<Span> {
        spans.iter().filter(|span| span.column == column).copied().collect()
    };
    let meets = |left: Vec<Span>, right: Vec<Span>| {
        left.iter().any(|x| right.iter().any(|y| x.top < y.bottom && y.top < x.bottom))
    };
    meets(at(spans_a, 0), at(spans_b, last_column)) || meets(at(spans_b, 0), at(spans_a, last_column))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rle;

    fn mask(label: &str, is_set: impl Fn(u32, u32) -> bool) -> Mask {
        let rows: Vec<bool> = (0..200).map(|i| is_set(i % 20, i / 20)).collect();
        let rle = Rle::from_rows(20, 10, &rows).expect("200 pixels");
        Mask { rle, label: label.into(), score: 0.5, caption: String::new() }
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
        assert_eq!(group_masks(&masks, 20, 0.5), [0, 1, 1, 0, 4]);
        assert_eq!(group_masks(&[], 20, 0.5), [0_u16; 0]);
    }
}
