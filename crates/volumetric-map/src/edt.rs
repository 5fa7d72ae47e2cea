//! Exact squared Euclidean distance transforms on integer grids, one line at a time (Meijster, Roerdink and Hesselink 2000;
//! the same lower envelope of parabolas as Felzenszwalb and Huttenlocher 2012, in integers).

use std::ops::Range;

/// No obstacle within reach.
pub(crate) const FAR: u32 = u32::MAX;

/// Squared distances, in cells, of every cell to the nearest seed; [`FAR`] if there is none.
pub(crate) fn squared_distance_2d(is_seed: &[bool], width: usize, height: usize) -> Vec<u32> {
    // First along the columns, two sweeps, whole rows at a time; then an envelope per row.
    let mut squared = vec![FAR; width * height];
    let mut steps = vec![u32::MAX; width];
    for pass in 0..2 {
        steps.fill(u32::MAX);
        for k in 0..height {
            let row = if pass == 0 { k } else { height - 1 - k } * width;
            for x in 0..width {
                steps[x] = if is_seed[row + x] { 0 } else { steps[x].saturating_add(1) };
                if steps[x] < 65_000 {
                    squared[row + x] = squared[row + x].min(steps[x] * steps[x]);
                }
            }
        }
    }
    let mut envelope = Envelope::default();
    let mut line = vec![FAR; width];
    for row in squared.chunks_exact_mut(width.max(1)) {
        line.copy_from_slice(row);
        envelope.build(&line);
        envelope.for_each(width, |x, value, _| row[x] = value);
    }
    squared
}

/// The lower envelope of the parabolas `(x - i)^2 + f(i)`. Ties go to the smaller i, so the result depends on the finite
/// values only, not on how far the line reaches.
#[derive(Debug, Clone, Default)]
pub(crate) struct Envelope {
    /// (site, value at the site, first x where this parabola is strictly the lowest)
    parts: Vec<(i64, i64, i64)>,
    /// 1 / 2n.
    half_inverse: Vec<f64>,
}

/// `numerator / denominator` rounded down, given the inverse of the denominator (up to some ten thousands, the numerator below 2^50).
#[inline]
fn floor_of_quotient(numerator: i64, inverse: f64) -> i64 {
    // Half a numerator further on, no quotient is a whole number, and the rounding of the product cannot reach one. Less a half and
    // rounded to the nearest, by adding a number whose last bit is worth one: a third of what the division costs.
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    let rounded = (numerator as f64 + 0.5) * inverse - 0.5 + SHIFT;
    (rounded.to_bits() as i64).wrapping_sub(SHIFT.to_bits() as i64)
}

impl Envelope {
    pub fn build(&mut self, line: &[u32]) {
        self.parts.clear();
        while self.half_inverse.len() < line.len() {
            self.half_inverse.push(0.5 / self.half_inverse.len() as f64);
        }
        for (site, value) in line.iter().enumerate() {
            if *value == FAR {
                continue;
            }
            let (u, f) = (site as i64, i64::from(*value));
            let mut start = 0;
            while let Some(&(i, g, first)) = self.parts.last() {
                // Last x at which i is at least as low as u, rounded down.
                let border = floor_of_quotient(u * u - i * i + f - g, self.half_inverse[(u - i) as usize]);
                if border < first {
                    self.parts.pop();
                    continue;
                }
                start = border + 1;
                break;
            }
            if start < line.len() as i64 {
                self.parts.push((u, f, start));
            }
        }
    }

    /// Calls back for each x of the line with the squared distance and the site; nothing if there is no site.
    pub fn for_each(&self, length: usize, mut visit: impl FnMut(usize, u32, usize)) {
        self.for_each_part(length, |cells, value, site| {
            for x in cells {
                let d = x as i64 - site;
                visit(x, (d * d + value).min(i64::from(FAR) - 1) as u32, site as usize);
            }
        });
    }

    /// Calls back for each part of the envelope with its cells, the value at its site, and the site.
    #[inline]
    pub fn for_each_part(&self, length: usize, mut visit: impl FnMut(Range<usize>, i64, i64)) {
        for (rank, (site, value, first)) in self.parts.iter().enumerate() {
            let end = self.parts.get(rank + 1).map_or(length as i64, |next| next.2);
            visit(*first as usize..end.max(*first) as usize, *value, *site);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_envelope_by_hand() {
        // Sites 0 (height 0) and 4 (height 1): equal at x = 2.125, so 0 holds x <= 2.
        let mut envelope = Envelope::default();
        envelope.build(&[0, FAR, FAR, FAR, 1, FAR]);
        let mut out = Vec::new();
        envelope.for_each(6, |_, value, site| out.push((value, site)));
        assert_eq!(out, [(0, 0), (1, 0), (4, 0), (2, 4), (1, 4), (2, 4)]);
    }

    #[test]
    fn quotients_are_rounded_down() {
        for n in (-3000..3000i64).chain([4_200_000_000, 4_199_999_999, -4_200_000_001]) {
            for d in [1i64, 2, 3, 7, 64, 999, 20_000] {
                assert_eq!(floor_of_quotient(n, 1.0 / d as f64), n.div_euclid(d), "{n} / {d}");
            }
        }
    }

    #[test]
    fn a_tie_goes_to_the_smaller_site_and_a_high_site_is_hidden() {
        let mut envelope = Envelope::default();
        envelope.build(&[0, 9, 0]);
        let mut out = Vec::new();
        envelope.for_each(3, |_, value, site| out.push((value, site)));
        assert_eq!(out, [(0, 0), (1, 0), (0, 2)]);
    }
}
