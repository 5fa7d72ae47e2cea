//! The inner loop of stitching, 64 pixels at a time (a row of a tile): first the four neighbours of each are gathered, then all their
//! bytes are mixed in one loop over lanes, which the compiler turns into vector instructions. `Tap::color` is the same
//! for one pixel, and a test holds the two equal.

use super::gains::FixedGain;

/// Pixels mixed at once.
const BATCH: usize = 64;
/// Bytes of them: red, green, blue and one that does not matter.
pub(super) const LANES: usize = 4 * BATCH;

/// The neighbours of a batch of places; made once for an image.
pub(super) struct Lanes {
    top_left: [[u8; 4]; BATCH],
    top_right: [[u8; 4]; BATCH],
    bottom_left: [[u8; 4]; BATCH],
    bottom_right: [[u8; 4]; BATCH],
    /// Ways of an incomplete batch.
    rest: [[u8; 4]; BATCH],
}

impl Lanes {
    pub(super) fn new() -> Lanes {
        let bytes = [[0; 4]; BATCH];
        Lanes { top_left: bytes, top_right: bytes, bottom_left: bytes, bottom_right: bytes, rest: bytes }
    }

    /// Colours of places into as many pixels of three bytes. `offsets` are the first bytes of the places, `ways` their
    /// ways right (low half) and down (high half) in sixteenths, once for each lane.
    pub(super) fn fill(
        &mut self,
        pixels: &mut [u8],
        offsets: &[u32],
        ways: &[[u8; 4]],
        image: &[u8],
        row_bytes: u32,
        gain: &FixedGain,
    ) {
        let batches = pixels.chunks_mut(3 * BATCH).zip(offsets.chunks(BATCH)).zip(ways.chunks(BATCH));
        for ((pixels, offsets), ways) in batches {
            self.gather(offsets, image, row_bytes);
            // Always all lanes: what lies behind the last pixel of an incomplete batch is computed and not used.
            let colors = match ways.first_chunk() {
                Some(ways) => self.mix(ways, gain.lanes()),
                None => {
                    self.rest[..ways.len()].copy_from_slice(ways);
                    self.mix(&self.rest, gain.lanes())
                }
            };
            for (pixel, color) in pixels.chunks_exact_mut(3).zip(colors.chunks_exact(4)) {
                pixel.copy_from_slice(&color[..3]);
            }
        }
    }

    #[inline]
    fn gather(&mut self, offsets: &[u32], image: &[u8], row_bytes: u32) {
        let row_bytes = row_bytes as usize;
        let top = self.top_left.iter_mut().zip(&mut self.top_right);
        let bottom = self.bottom_left.iter_mut().zip(&mut self.bottom_right);
        for ((&offset, (top_left, top_right)), (bottom_left, bottom_right)) in offsets.iter().zip(top).zip(bottom) {
            let at = offset as usize;
            let window = &image[at..at + row_bytes + 7]; // one check for all four
            let four = |at: usize| window[at..].first_chunk().copied().unwrap_or_default();
            *top_left = four(0);
            *top_right = four(3);
            *bottom_left = four(row_bytes);
            *bottom_right = four(row_bytes + 3);
        }
    }

    #[inline]
    fn mix(&self, ways: &[[u8; 4]; BATCH], factors: &[u16; LANES]) -> [u8; LANES] {
        let bytes = [&self.top_left, &self.top_right, &self.bottom_left, &self.bottom_right, ways];
        let [top_left, top_right, bottom_left, bottom_right, ways] = bytes.map(|bytes| bytes.as_flattened());
        let mut colors = [0; LANES];
        for lane in 0..LANES {
            let (right, below) = (u16::from(ways[lane] & 15), u16::from(ways[lane] >> 4));
            // In 16 bits: at most 255 * 16 after the first mixing and 255 * 256 after the second.
            let mix = |a: u16, b: u16, way: u16| a.wrapping_mul(16 - way).wrapping_add(b.wrapping_mul(way));
            let top = mix(u16::from(top_left[lane]), u16::from(top_right[lane]), right);
            let bottom = mix(u16::from(bottom_left[lane]), u16::from(bottom_right[lane]), right);
            let color = mix(top, bottom, below);
            let brightened = ((u32::from(color) * u32::from(factors[lane])) >> 16) as u16;
            colors[lane] = ((brightened + 32) >> 6).min(255) as u8;
        }
        colors
    }
}
