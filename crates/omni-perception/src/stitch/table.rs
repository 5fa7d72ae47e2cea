//! The fast form of stitching: the geometry in a table of fixed-point places, four bytes for a pixel and lens.
//!
//! A place is the index of the upper left of four neighbouring pixels (24 bits) and the way to the next column and row in
//! sixteenths (4 bits each); the place so is right to 1/32 pixel. Nine tenths of a panorama are seen by one lens only:
//! those pixels are runs without weights. The rest has weights in 1/256.

use super::gains::{Gain, GainTable, gains_of};
use super::{Eye, Lens, StitchConfig, StitchError, check_count, check_images, check_lenses, looks_at, size};
use crate::{Equirectangular, RgbImage};

/// Stitches images of fixed lenses; made once, used for every image.
#[derive(Debug, Clone, PartialEq)]
pub struct Stitcher {
    panorama: Equirectangular,
    /// Width and height of each lens's image.
    sizes: Vec<[u32; 2]>,
    /// Stretches seen by one lens.
    runs: Vec<Run>,
    /// Places of the runs, one for each pixel.
    taps: Vec<Tap>,
    /// Pixels seen by several lenses.
    blends: Vec<Blend>,
    /// Parts of the blends.
    shares: Vec<Share>,
    /// Stretches that no lens sees.
    gaps: Vec<Run>,
}

/// The pixel of a lens that a pixel of the panorama shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LensPixel {
    /// Index of the lens.
    pub lens: u8,
    /// Column of its image.
    pub column: u16,
    /// Row of its image.
    pub row: u16,
}

/// `length` pixels of the panorama from `start` on, in row order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    start: u32,
    length: u32,
    lens: u8,
}

/// A pixel of the panorama with `count` shares from `first` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Blend {
    pixel: u32,
    pub(super) first: u32,
    pub(super) count: u8,
}

/// A lens's part in a blend; the weights of a blend add up to 256.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Share {
    pub(super) tap: Tap,
    weight: u16,
    pub(super) lens: u8,
}

/// A place in an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tap(u32);

impl Stitcher {
    /// Computes the table: about a microsecond for each pixel and lens.
    ///
    /// # Errors
    /// [`StitchError`] names the lens or the number that is not sound.
    pub fn new(lenses: &[Lens], config: &StitchConfig) -> Result<Stitcher, StitchError> {
        check_lenses(lenses, config)?;
        let eyes: Vec<Eye> = lenses.iter().map(Eye::new).collect();
        let mut stitcher = Stitcher {
            panorama: config.panorama,
            sizes: lenses.iter().map(size).collect(),
            runs: Vec::new(),
            taps: Vec::new(),
            blends: Vec::new(),
            shares: Vec::new(),
            gaps: Vec::new(),
        };
        let (width, height) = (config.panorama.width_px, config.panorama.height_px);
        let mut shares: Vec<Share> = Vec::new();
        for row in 0..height {
            for column in 0..width {
                shares.clear();
                for look in looks_at(&eyes, config, column, row) {
                    let tap = Tap::new(look.pixel.u, look.pixel.v, stitcher.sizes[look.lens]);
                    let weight = (256.0 * look.weight).round() as u16;
                    shares.push(Share { tap, weight, lens: look.lens as u8 });
                }
                settle(&mut shares);
                stitcher.add(row * width + column, &shares);
            }
        }
        Ok(stitcher)
    }

    fn add(&mut self, pixel: u32, shares: &[Share]) {
        match shares {
            [] => extend(&mut self.gaps, pixel, 0),
            [share] => {
                extend(&mut self.runs, pixel, share.lens);
                self.taps.push(share.tap);
            }
            several => {
                let first = self.shares.len() as u32;
                self.blends.push(Blend { pixel, first, count: several.len() as u8 });
                self.shares.extend_from_slice(several);
            }
        }
    }

    /// Geometry of the panorama.
    pub fn panorama(&self) -> &Equirectangular {
        &self.panorama
    }

    /// Share of the panorama's pixels that some lens sees.
    pub fn covered_share(&self) -> f64 {
        let blind: u64 = self.gaps.iter().map(|gap| u64::from(gap.length)).sum();
        1.0 - blind as f64 / (f64::from(self.panorama.width_px) * f64::from(self.panorama.height_px))
    }

    /// Measures the gains and stitches into a new image.
    ///
    /// # Errors
    /// [`StitchError::Count`] or [`StitchError::Image`] if the images are not those of the lenses.
    pub fn stitch(&self, images: &[RgbImage]) -> Result<RgbImage, StitchError> {
        let gains = self.gains(images)?;
        let mut panorama = RgbImage { width: 0, height: 0, rgb: Vec::new() };
        self.stitch_into(images, &gains, &mut panorama)?;
        Ok(panorama)
    }

    /// How much each lens must be brightened so that lenses agree on what they see in common; their product is 1.
    /// A lens that shares nothing with others has 1.
    ///
    /// # Errors
    /// [`StitchError::Count`] or [`StitchError::Image`] if the images are not those of the lenses.
    pub fn gains(&self, images: &[RgbImage]) -> Result<Vec<Gain>, StitchError> {
        check_images(&self.sizes, images)?;
        Ok(gains_of(&self.blends, &self.shares, images))
    }

    /// Stitches with given gains into an image, which gets the panorama's size. Allocates that image once, and a kilobyte of gains for each lens.
    ///
    /// # Errors
    /// [`StitchError::Count`] or [`StitchError::Image`] if images or gains are not those of the lenses; the panorama
    /// stays as it was.
    pub fn stitch_into(&self, images: &[RgbImage], gains: &[Gain], panorama: &mut RgbImage) -> Result<(), StitchError> {
        check_images(&self.sizes, images)?;
        check_count("gains", gains.len(), images.len())?;
        let gains: Vec<GainTable> = gains.iter().map(GainTable::new).collect();
        (panorama.width, panorama.height) = (self.panorama.width_px, self.panorama.height_px);
        panorama.rgb.resize(3 * panorama.width as usize * panorama.height as usize, 0);
        let rgb = panorama.rgb.as_mut_slice();
        for gap in &self.gaps {
            rgb[3 * gap.start as usize..][..3 * gap.length as usize].fill(0);
        }
        let mut taps = self.taps.as_slice();
        for run in &self.runs {
            let (image, gain) = (&images[usize::from(run.lens)], &gains[usize::from(run.lens)]);
            let row_bytes = 3 * image.width as usize;
            let (of_run, rest) = taps.split_at(run.length as usize);
            taps = rest;
            let pixels = rgb[3 * run.start as usize..].chunks_exact_mut(3);
            for (pixel, tap) in pixels.zip(of_run) {
                let color = gain.apply(tap.color(&image.rgb, row_bytes));
                pixel.copy_from_slice(&color);
            }
        }
        for blend in &self.blends {
            let mut sum = [128_u32; 3];
            for share in &self.shares[blend.first as usize..][..usize::from(blend.count)] {
                let (image, gain) = (&images[usize::from(share.lens)], &gains[usize::from(share.lens)]);
                let color = gain.apply(share.tap.color(&image.rgb, 3 * image.width as usize));
                for (sum, value) in sum.iter_mut().zip(color) {
                    *sum += u32::from(share.weight) * u32::from(value);
                }
            }
            rgb[3 * blend.pixel as usize..][..3].copy_from_slice(&sum.map(|sum| (sum >> 8) as u8));
        }
        Ok(())
    }

    /// For each pixel of the panorama, in row order, the lens pixel that it shows (of the heaviest lens, the first of
    /// equals); `None` where no lens looks. For what cannot be mixed, such as instance numbers.
    pub fn sources(&self) -> Vec<Option<LensPixel>> {
        let mut sources = vec![None; self.panorama.width_px as usize * self.panorama.height_px as usize];
        let mut taps = self.taps.iter();
        for run in &self.runs {
            for (source, tap) in sources[run.start as usize..][..run.length as usize].iter_mut().zip(&mut taps) {
                *source = Some(tap.nearest(run.lens, self.sizes[usize::from(run.lens)]));
            }
        }
        for blend in &self.blends {
            let shares = &self.shares[blend.first as usize..][..usize::from(blend.count)];
            let heaviest = shares.iter().rev().max_by_key(|share| share.weight);
            sources[blend.pixel as usize] =
                heaviest.map(|share| share.tap.nearest(share.lens, self.sizes[usize::from(share.lens)]));
        }
        sources
    }
}

/// Drops shares below half a step and makes the weights add up to 256.
fn settle(shares: &mut Vec<Share>) {
    shares.retain(|share| share.weight > 0);
    let sum: u16 = shares.iter().map(|share| share.weight).sum();
    if let Some(heaviest) = shares.iter_mut().max_by_key(|share| share.weight) {
        heaviest.weight += 256;
        heaviest.weight -= sum; // rounding of a few weights: less than the heaviest
    }
}

/// Lengthens the last run by a pixel, or begins a new one.
fn extend(runs: &mut Vec<Run>, pixel: u32, lens: u8) {
    match runs.last_mut() {
        Some(run) if run.lens == lens && run.start + run.length == pixel => run.length += 1,
        _ => runs.push(Run { start: pixel, length: 1, lens }),
    }
}

impl Tap {
    /// The place (u, v) in an image of at least 2 x 2 pixels.
    fn new(u: f64, v: f64, [width, height]: [u32; 2]) -> Tap {
        let axis = |position: f64, size: u32| {
            let sixteenths = ((position - 0.5) * 16.0).round().clamp(0.0, 16.0 * f64::from(size - 1)) as u32;
            // The last pixel is reached from the one before it, but for a sixteenth.
            if sixteenths >> 4 > size - 2 { (size - 2, 15) } else { (sixteenths >> 4, sixteenths & 15) }
        };
        let ((x, fx), (y, fy)) = (axis(u, width), axis(v, height));
        Tap((y * width + x) << 8 | fy << 4 | fx)
    }

    /// Bilinear colour. The six bytes of two neighbours are handled at once, in lanes of 16 bits.
    #[inline]
    pub(super) fn color(self, rgb: &[u8], row_bytes: usize) -> [u8; 3] {
        const EVEN: u64 = 0x00FF_00FF_00FF;
        let at = 3 * (self.0 >> 8) as usize;
        let (right, below) = (u64::from(self.0 & 15), u64::from(self.0 >> 4 & 15));
        let (left, above) = (16 - right, 16 - below);
        let (top, bottom) = (six_bytes(rgb, at), six_bytes(rgb, at + row_bytes));
        // Lanes: red, blue of the left pixel and green of the right one; green of the left, red and blue of the right.
        // Each is at most 255 * 16 after the first mixing and 255 * 256 after the second: no lane runs over.
        let even = (top & EVEN) * above + (bottom & EVEN) * below;
        let odd = (top >> 8 & EVEN) * above + (bottom >> 8 & EVEN) * below;
        let red_blue = even * left + (odd >> 16) * right + 0x0080_0080;
        let green = odd * left + (even >> 32) * right + 0x80;
        [(red_blue >> 8) as u8, (green >> 8) as u8, (red_blue >> 24) as u8]
    }

    /// The pixel whose centre is nearest.
    fn nearest(self, lens: u8, [width, _]: [u32; 2]) -> LensPixel {
        let (index, round) = (self.0 >> 8, |sixteenths: u32| sixteenths >> 3);
        let (column, row) = (index % width + round(self.0 & 15), index / width + round(self.0 >> 4 & 15));
        LensPixel { lens, column: column as u16, row: row as u16 }
    }
}

#[inline]
fn six_bytes(rgb: &[u8], at: usize) -> u64 {
    let bytes = &rgb[at..at + 6];
    let low = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let high = u16::from_le_bytes([bytes[4], bytes[5]]);
    u64::from(low) | u64::from(high) << 32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tap_mixes_four_neighbours() {
        // 3 x 2 pixels; red grows by 16 to the right, green by 64 downward, blue is 200 in the right column.
        let rgb = [[0, 0, 0], [16, 0, 0], [32, 0, 200], [0, 64, 0], [16, 64, 0], [32, 64, 200]].concat();
        let color = |u, v| Tap::new(u, v, [3, 2]).color(&rgb, 9);
        assert_eq!(color(0.5, 0.5), [0, 0, 0]);
        assert_eq!(color(1.0, 1.0), [8, 32, 0]);
        assert_eq!(color(1.75, 0.75), [20, 16, 50]);
        assert_eq!(color(2.5, 1.5), [31, 60, 188]); // a sixteenth before the last pixel
        assert_eq!(color(-7.0, -7.0), [0, 0, 0]);
        let nearest = Tap::new(1.9, 1.2, [3, 2]).nearest(4, [3, 2]);
        assert_eq!(nearest, LensPixel { lens: 4, column: 1, row: 1 });
    }

    #[test]
    fn white_stays_white_at_every_fraction() {
        let white = [255_u8; 12];
        for sixteenths in 0..256 {
            assert_eq!(Tap(sixteenths).color(&white, 6), [255; 3]);
        }
    }

    #[test]
    fn weights_add_up() {
        let share = |weight| Share { tap: Tap(0), weight, lens: 0 };
        let mut shares = vec![share(85), share(85), share(85), share(0)];
        settle(&mut shares);
        assert_eq!(shares.iter().map(|s| s.weight).collect::<Vec<_>>(), [85, 85, 86]);
    }
}
