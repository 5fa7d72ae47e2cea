//! The fast form of stitching: the geometry in a table of fixed-point places, seven bytes for a pixel.
//!
//! A place is the first byte of the upper left of four neighbouring pixels, and the ways from there to the next column and
//! row in sixteenths; so it is right to 1/32 pixel. First every pixel is filled by the lens that is heaviest there. Then the
//! few (a twentieth with two fisheyes) that others share are mixed with those, with weights in 1/256.

use super::gains::{FixedGain, Gain, gains_of};
use super::lanes::{BATCH, LANES, Lanes};
use super::{Eye, Lens, StitchConfig, StitchError, check_count, check_images, check_lenses, looks_at, size};
use crate::{Equirectangular, RgbImage};

/// Stitches images of fixed lenses; made once, used for every image.
#[derive(Debug, Clone, PartialEq)]
pub struct Stitcher {
    panorama: Equirectangular,
    /// Width and height of each lens's image.
    sizes: Vec<[u32; 2]>,
    /// Stretches of one lens.
    runs: Vec<Run>,
    /// Places of the runs, one for each pixel: their first bytes ...
    offsets: Vec<u32>,
    /// ... and their ways, once for each byte that `lanes.rs` mixes with them.
    ways: Vec<[u8; 3]>,
    /// Pixels seen by several lenses.
    blends: Vec<Blend>,
    /// Parts of the blends, the heaviest lens first.
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
pub(super) struct Tap {
    /// First byte of its upper left pixel.
    pub(super) offset: u32,
    /// Sixteenths to the right (low half) and down (high half).
    pub(super) way: u8,
}

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
            offsets: Vec::new(),
            ways: Vec::new(),
            blends: Vec::new(),
            shares: Vec::new(),
            gaps: Vec::new(),
        };
        let (width, height) = (config.panorama.width_px, config.panorama.height_px);
        let mut shares: Vec<Share> = Vec::new();
        for (column, row) in by_tiles(width, height) {
            shares.clear();
            for look in looks_at(&eyes, config, column, row) {
                let tap = Tap::new(look.pixel.u, look.pixel.v, stitcher.sizes[look.lens]);
                let weight = (256.0 * look.weight).round() as u16;
                shares.push(Share { tap, weight, lens: look.lens as u8 });
            }
            settle(&mut shares);
            stitcher.add(row * width + column, &shares);
        }
        Ok(stitcher)
    }

    fn add(&mut self, pixel: u32, shares: &[Share]) {
        match shares {
            [] => extend(&mut self.gaps, pixel, 0),
            [heaviest, others @ ..] => {
                extend(&mut self.runs, pixel, heaviest.lens);
                self.offsets.push(heaviest.tap.offset);
                self.ways.push([heaviest.tap.way; 3]);
                if !others.is_empty() {
                    let first = self.shares.len() as u32;
                    self.blends.push(Blend { pixel, first, count: shares.len() as u8 });
                    self.shares.extend_from_slice(shares);
                }
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
        let gains: Vec<FixedGain> = gains.iter().map(FixedGain::new).collect();
        (panorama.width, panorama.height) = (self.panorama.width_px, self.panorama.height_px);
        panorama.rgb.resize(3 * panorama.width as usize * panorama.height as usize, 0);
        let rgb = panorama.rgb.as_mut_slice();
        for gap in &self.gaps {
            rgb[3 * gap.start as usize..][..3 * gap.length as usize].fill(0);
        }
        let (mut lanes, mut done) = (Lanes::new(), 0);
        for run in &self.runs {
            let (image, gain) = (&images[usize::from(run.lens)], &gains[usize::from(run.lens)]);
            let length = run.length as usize;
            let (offsets, ways) = (&self.offsets[done..][..length], &self.ways[done..][..length]);
            let pixels = &mut rgb[3 * run.start as usize..][..3 * length];
            lanes.fill(pixels, offsets, ways, &image.rgb, 3 * image.width, gain);
            done += length;
        }
        let mut pairs = Pairs::default();
        for blend in &self.blends {
            let shares = &self.shares[blend.first as usize..][..usize::from(blend.count)];
            let Some((heaviest, others)) = shares.split_first() else { continue };
            if let [other] = others {
                if !pairs.has_room_for(other.lens) {
                    pairs.mix_into(rgb, &mut lanes, images, &gains);
                }
                pairs.push(blend.pixel, heaviest.weight, other);
                continue;
            }
            let pixel = &mut rgb[3 * blend.pixel as usize..][..3];
            let weighted = |weight: u16, value: u8| u32::from(weight) * u32::from(value);
            let mut sum = [pixel[0], pixel[1], pixel[2]].map(|value| 128 + weighted(heaviest.weight, value));
            for share in others {
                let (image, gain) = (&images[usize::from(share.lens)], &gains[usize::from(share.lens)]);
                let color = gain.apply(share.tap.color(&image.rgb, 3 * image.width as usize));
                for (sum, value) in sum.iter_mut().zip(color) {
                    *sum += weighted(share.weight, value);
                }
            }
            pixel.copy_from_slice(&sum.map(|sum| (sum >> 8) as u8));
        }
        pairs.mix_into(rgb, &mut lanes, images, &gains);
        Ok(())
    }

    /// For each pixel of the panorama, in row order, the lens pixel that it shows (of the heaviest lens, the first of
    /// equals); `None` where no lens looks. For what cannot be mixed, such as instance numbers.
    pub fn sources(&self) -> Vec<Option<LensPixel>> {
        let mut sources = vec![None; self.panorama.width_px as usize * self.panorama.height_px as usize];
        let mut taps = self.offsets.iter().zip(&self.ways).map(|(&offset, &[way, ..])| Tap { offset, way });
        for run in &self.runs {
            for (source, tap) in sources[run.start as usize..][..run.length as usize].iter_mut().zip(&mut taps) {
                *source = Some(tap.nearest(run.lens, self.sizes[usize::from(run.lens)]));
            }
        }
        sources
    }
}

/// Pixels with a second lens, the same one for all: most that are shared at all. Mixed as many at a time as `lanes.rs` does.
struct Pairs {
    lens: u8,
    count: usize,
    /// Pixel of the panorama, and the weight of what is there.
    pixels: [(u32, u16); BATCH],
    /// Where the second lens shows it.
    offsets: [u32; BATCH],
    ways: [[u8; 3]; BATCH],
    colors: [u8; LANES],
}

impl Default for Pairs {
    fn default() -> Pairs {
        let (ways, colors) = ([[0; 3]; BATCH], [0; LANES]);
        Pairs { lens: 0, count: 0, pixels: [(0, 0); BATCH], offsets: [0; BATCH], ways, colors }
    }
}

impl Pairs {
    fn has_room_for(&self, lens: u8) -> bool {
        self.count == 0 || (self.lens == lens && self.count < BATCH)
    }

    fn push(&mut self, pixel: u32, weight: u16, other: &Share) {
        self.lens = other.lens;
        self.pixels[self.count] = (pixel, weight);
        self.offsets[self.count] = other.tap.offset;
        self.ways[self.count] = [other.tap.way; 3];
        self.count += 1;
    }

    /// Mixes the second lens into the pixels, and begins anew.
    fn mix_into(&mut self, rgb: &mut [u8], lanes: &mut Lanes, images: &[RgbImage], gains: &[FixedGain]) {
        let (image, gain) = (&images[usize::from(self.lens)], &gains[usize::from(self.lens)]);
        let count = std::mem::take(&mut self.count);
        let colors = &mut self.colors[..3 * count];
        lanes.fill(colors, &self.offsets[..count], &self.ways[..count], &image.rgb, 3 * image.width, gain);
        for (&(pixel, weight), color) in self.pixels[..count].iter().zip(colors.chunks_exact(3)) {
            let pixel = &mut rgb[3 * pixel as usize..][..3];
            for (value, other) in pixel.iter_mut().zip(color) {
                // The two weights add up to 256.
                let sum = u32::from(weight) * u32::from(*value) + u32::from(256 - weight) * u32::from(*other);
                *value = ((sum + 128) >> 8) as u8;
            }
        }
    }
}

/// Columns and rows of an image, tile by tile. A row of a panorama runs all across the fisheyes; a tile stays in a corner of them. It is
/// low, because rows of an image whose width is a power of two share few places of the nearest cache.
fn by_tiles(width: u32, height: u32) -> impl Iterator<Item = (u32, u32)> {
    const WIDE: u32 = BATCH as u32;
    const HIGH: u32 = 8;
    let tiles = (0..height).step_by(HIGH as usize).flat_map(move |y| {
        (0..width).step_by(WIDE as usize).map(move |x| (x..width.min(x + WIDE), y..height.min(y + HIGH)))
    });
    tiles.flat_map(|(columns, rows)| rows.flat_map(move |row| columns.clone().map(move |column| (column, row))))
}

/// Drops shares below half a step, puts the heaviest first (the first of equals), and makes the weights add up to 256.
fn settle(shares: &mut Vec<Share>) {
    shares.retain(|share| share.weight > 0);
    shares.sort_by_key(|share| std::cmp::Reverse(share.weight)); // stable
    let sum: u16 = shares.iter().map(|share| share.weight).sum();
    if let Some(heaviest) = shares.first_mut() {
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
    /// The place (u, v) in an image of at least 3 x 3 pixels.
    fn new(u: f64, v: f64, [width, height]: [u32; 2]) -> Tap {
        let axis = |position: f64, size: u32| {
            let sixteenths = ((position - 0.5) * 16.0).round().clamp(0.0, 16.0 * f64::from(size - 1)) as u32;
            // The last pixel is reached from the one before it, but for a sixteenth.
            if sixteenths >> 4 > size - 2 { (size - 2, 15) } else { (sixteenths >> 4, sixteenths & 15) }
        };
        let ((mut x, fx), (y, fy)) = (axis(u, width), axis(v, height));
        // Eight bytes are read where six are needed: in the last row they must not begin at the last but one pixel.
        if y == height - 2 && x == width - 2 {
            x = width - 3;
        }
        // At most 32768 x 32768 pixels: below 2^32 bytes.
        Tap { offset: 3 * (y * width + x), way: (fy << 4 | fx) as u8 }
    }

    /// Bilinear colour in 1/256. The bytes of two neighbours are handled at once, in lanes of 16 bits.
    #[inline]
    pub(super) fn color(self, rgb: &[u8], row_bytes: usize) -> [u16; 3] {
        const EVEN: u64 = 0x00FF_00FF_00FF;
        let at = self.offset as usize;
        let (right, below) = (u64::from(self.way & 15), u64::from(self.way >> 4));
        let (top, bottom) = (eight_bytes(rgb, at), eight_bytes(rgb, at + row_bytes));
        // Lanes: red, blue of the left pixel and green of the right one; green of the left, red and blue of the right.
        // a (16 - f) + b f = 16 a + (b - a) f, with one product for all lanes: borrows between them cancel in the sum,
        // whose lanes are at most 255 * 16 after the first mixing and 255 * 256 after the second.
        let mix = |a: u64, b: u64, f: u64| (a << 4).wrapping_add(b.wrapping_sub(a).wrapping_mul(f));
        let even = mix(top & EVEN, bottom & EVEN, below);
        let odd = mix(top >> 8 & EVEN, bottom >> 8 & EVEN, below);
        let red_blue = mix(even, odd >> 16, right);
        let green = mix(odd, even >> 32, right);
        [red_blue as u16, green as u16, (red_blue >> 16) as u16]
    }

    /// The pixel whose centre is nearest.
    fn nearest(self, lens: u8, [width, _]: [u32; 2]) -> LensPixel {
        let (index, round) = (self.offset / 3, |sixteenths: u8| u32::from(sixteenths >> 3));
        let (column, row) = (index % width + round(self.way & 15), index / width + round(self.way >> 4));
        LensPixel { lens, column: column as u16, row: row as u16 }
    }
}

/// Two neighbouring pixels and two bytes more.
#[inline]
pub(super) fn eight_bytes(rgb: &[u8], at: usize) -> u64 {
    let bytes = &rgb[at..at + 8];
    u64::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tap_mixes_four_neighbours() {
        // 3 x 3 pixels; red grows by 16 to the right, green by 64 downward, blue is 200 in the right column.
        let rgb: Vec<u8> =
            [0, 64, 128].iter().flat_map(|green| [0, *green, 0, 16, *green, 0, 32, *green, 200]).collect();
        let color = |u, v| FixedGain::new(&[1.0; 3]).apply(Tap::new(u, v, [3, 3]).color(&rgb, 9));
        assert_eq!(color(0.5, 0.5), [0, 0, 0]);
        assert_eq!(color(1.0, 1.0), [8, 32, 0]);
        assert_eq!(color(1.75, 0.75), [20, 16, 50]);
        assert_eq!(color(2.5, 0.5), [31, 0, 188]); // a sixteenth before the last pixel
        assert_eq!(color(-7.0, -7.0), [0, 0, 0]);
        let nearest = Tap::new(1.9, 1.2, [3, 3]).nearest(4, [3, 3]);
        assert_eq!(nearest, LensPixel { lens: 4, column: 1, row: 1 });
    }

    #[test]
    fn white_stays_white_at_every_fraction() {
        let (white, one) = ([255_u8; 18], FixedGain::new(&[1.0; 3]));
        for way in 0..=255 {
            assert_eq!(one.apply(Tap { offset: 0, way }.color(&white, 9)), [255; 3]);
        }
    }

    #[test]
    fn a_batch_is_as_one_by_one() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 8
        };
        let (width, height) = (50, 40);
        let image: Vec<u8> = (0..3 * width * height).map(|_| random() as u8).collect();
        let place = |random: &mut dyn FnMut() -> u32, size: u32| f64::from(random() % (17 * size)) / 16.0 - 1.0;
        let taps: Vec<Tap> = (0..4007)
            .map(|_| Tap::new(place(&mut random, width), place(&mut random, height), [width, height]))
            .collect();
        for gain in [[1.0, 1.0, 1.0], [0.25, 1.7, 3.99], [0.0, 100.0, 0.999]] {
            let gain = FixedGain::new(&gain);
            let plain: Vec<u8> =
                taps.iter().flat_map(|tap| gain.apply(tap.color(&image, 3 * width as usize))).collect();
            let mut fast = vec![0; plain.len()];
            let (offsets, ways): (Vec<u32>, Vec<[u8; 3]>) = taps.iter().map(|tap| (tap.offset, [tap.way; 3])).unzip();
            Lanes::new().fill(&mut fast, &offsets, &ways, &image, 3 * width, &gain);
            assert_eq!(plain, fast);
        }
    }

    #[test]
    fn weights_add_up() {
        let share = |weight| Share { tap: Tap { offset: 0, way: 0 }, weight, lens: 0 };
        let mut shares = vec![share(85), share(85), share(85), share(0)];
        settle(&mut shares);
        assert_eq!(shares.iter().map(|s| s.weight).collect::<Vec<_>>(), [86, 85, 85]);
    }
}
