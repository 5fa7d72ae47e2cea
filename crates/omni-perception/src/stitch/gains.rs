//! Brightness of lenses against each other, from what two of them see in common.
//!
//! Lenses expose and balance their whites on their own. For each pair the medians of what both see in the blended band
//! give a ratio per channel; the gains' logarithms solve the graph of pairs in the least squares sense, each pair weighed
//! by its number of pixels, and add up to zero. Medians, because things near the lenses appear to one of them only.

use nalgebra::{DMatrix, DVector};

use super::lanes::LANES;
use super::table::{Blend, Share};
use crate::RgbImage;

/// Factors for red, green, blue.
pub type Gain = [f32; 3];

/// Gains beyond this factor are not a matter of exposure but of a covered lens.
const LARGEST: f64 = 4.0;
/// So many pixels of the band are looked at, at most.
const SAMPLES: usize = 8192;
/// A median of fewer pixels says nothing.
const FEWEST: usize = 32;
/// Darker is noise, brighter is cut off.
const TRUSTED: std::ops::RangeInclusive<u8> = 8..=247;

/// Gains of all lenses whose images are `images`.
pub(super) fn gains_of(blends: &[Blend], shares: &[Share], images: &[RgbImage]) -> Vec<Gain> {
    let (lenses, one) = (images.len(), FixedGain::new(&[1.0; 3]));
    let color = |share: &Share| {
        let image = &images[usize::from(share.lens)];
        one.apply(share.tap.color(&image.rgb, 3 * image.width as usize))
    };
    // 1. What both of a pair see: (first, second) with first < second.
    let mut pairs: Vec<Vec<([u8; 3], [u8; 3])>> = vec![Vec::new(); lenses * lenses];
    for blend in blends.iter().step_by(blends.len().div_ceil(SAMPLES).max(1)) {
        let parts = &shares[blend.first as usize..][..usize::from(blend.count)];
        for (index, first) in parts.iter().enumerate() {
            for second in &parts[index + 1..] {
                pairs[usize::from(first.lens) * lenses + usize::from(second.lens)].push((color(first), color(second)));
            }
        }
    }
    // 2. One system for each channel: weight (g_first - g_second) = weight log(m_second / m_first), and a faint pull to 0
    //    that makes the sum zero and settles lenses without neighbours.
    const PULL: f64 = 1e-6;
    let mut gains = vec![[1.0; 3]; lenses];
    for channel in 0..3 {
        let mut matrix = DMatrix::from_diagonal_element(lenses, lenses, PULL);
        let mut right = DVector::zeros(lenses);
        for (index, seen) in pairs.iter().enumerate() {
            let (first, second) = (index / lenses, index % lenses);
            let Some((ratio_log, weight)) = log_ratio(seen, channel) else { continue };
            matrix[(first, first)] += weight;
            matrix[(second, second)] += weight;
            matrix[(first, second)] -= weight;
            matrix[(second, first)] -= weight;
            right[first] += weight * ratio_log;
            right[second] -= weight * ratio_log;
        }
        // Positive definite by the pull: there is a factor.
        let Some(factor) = matrix.cholesky() else { continue };
        for (gain, log) in gains.iter_mut().zip(factor.solve(&right).iter()) {
            gain[channel] = log.exp().clamp(1.0 / LARGEST, LARGEST) as f32;
        }
    }
    gains
}

/// log(median of the second / median of the first) and its weight; `None` for too few trusted pixels.
fn log_ratio(seen: &[([u8; 3], [u8; 3])], channel: usize) -> Option<(f64, f64)> {
    let (mut first, mut second): (Vec<u8>, Vec<u8>) = seen
        .iter()
        .map(|(a, b)| (a[channel], b[channel]))
        .filter(|(a, b)| TRUSTED.contains(a) && TRUSTED.contains(b))
        .unzip();
    if first.len() < FEWEST {
        return None;
    }
    let middle = first.len() / 2;
    let median = |values: &mut Vec<u8>| f64::from(*values.select_nth_unstable(middle).1);
    Some(((median(&mut second) / median(&mut first)).ln(), first.len() as f64 / SAMPLES as f64))
}

/// A gain in fixed point, 14 bits after the point; one factor for each lane of `lanes.rs`.
pub(super) struct FixedGain([u16; LANES]);

impl FixedGain {
    /// Values that are not finite or negative count as 1; more than 4 as (nearly) 4.
    pub(super) fn new(gain: &Gain) -> FixedGain {
        let [red, green, blue] = gain.map(|factor| {
            let factor = if factor.is_finite() && factor >= 0.0 { factor } else { 1.0 };
            (factor * 16_384.0).round().min(65_535.0) as u16
        });
        FixedGain(std::array::from_fn(|lane| [red, green, blue][lane % 3]))
    }

    /// The factors times 2^14: red, green, blue, and again.
    pub(super) fn lanes(&self) -> &[u16; LANES] {
        &self.0
    }

    /// A colour in 1/256 (at most 255 * 256) times the gain, rounded and cut off at 255.
    #[inline]
    pub(super) fn apply(&self, [red, green, blue]: [u16; 3]) -> [u8; 3] {
        // 8 bits after the point and 14 of the factor, less 16: 6 are left.
        let times =
            |value: u16, factor: u16| ((((u32::from(value) * u32::from(factor)) >> 16) + 32) >> 6).min(255) as u8;
        [times(red, self.0[0]), times(green, self.0[1]), times(blue, self.0[2])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_of_one_changes_nothing() {
        let gain = FixedGain::new(&[1.0, f32::NAN, -1.0]);
        for value in 0..=255 {
            assert_eq!(gain.apply([256 * value; 3]), [value as u8; 3]);
        }
        assert_eq!(FixedGain::new(&[0.5, 2.0, 100.0]).apply([100 * 256; 3]), [50, 200, 255]);
    }

    #[test]
    fn medians_ignore_what_one_lens_alone_sees() {
        let mut seen = vec![([50, 100, 100], [100, 100, 90]); 60];
        seen.extend(vec![([50, 100, 100], [200, 10, 240]); 20]); // something near
        seen.extend(vec![([250, 0, 100], [100, 100, 240]); 500]); // cut off, dark
        let (ratio_log, _) = log_ratio(&seen, 0).expect("enough");
        assert!((ratio_log - 2_f64.ln()).abs() < 1e-12);
        assert_eq!(log_ratio(&seen, 1).expect("enough").0, 0.0);
        assert_eq!(log_ratio(&seen[..20], 0), None);
    }
}
