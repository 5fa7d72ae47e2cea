//! The inner loop of stitching, 64 pixels at a time (a row of a tile): first the four neighbours of each are gathered,
//! then all their bytes are mixed in one loop over lanes, which the compiler turns into vector instructions.
//! `Tap::color` is the same for one pixel, and a test holds the two equal.

use super::gains::FixedGain;
use super::table::eight_bytes;
use crate::vector_loops::widest;

/// Pixels mixed at once.
pub(super) const BATCH: usize = 64;
/// Their bytes.
pub(super) const LANES: usize = 3 * BATCH;
/// Four bytes are copied where three are needed; the fourth is overwritten by the next pixel's first.
const SPACE: usize = LANES + 1;

/// The neighbours of a batch of places; made once for an image.
pub(super) struct Lanes {
    top_left: [u8; SPACE],
    top_right: [u8; SPACE],
    bottom_left: [u8; SPACE],
    bottom_right: [u8; SPACE],
    /// Ways of an incomplete batch.
    rest: [[u8; 3]; BATCH],
}

impl Lanes {
    pub(super) fn new() -> Lanes {
        let bytes = [0; SPACE];
        Lanes { top_left: bytes, top_right: bytes, bottom_left: bytes, bottom_right: bytes, rest: [[0; 3]; BATCH] }
    }

    /// Colours of places into as many pixels of three bytes. `offsets` are the first bytes of the places, `ways` their
    /// ways right (low half) and down (high half) in sixteenths, once for each lane.
    pub(super) fn fill(
        &mut self,
        pixels: &mut [u8],
        offsets: &[u32],
        ways: &[[u8; 3]],
        image: &[u8],
        row_bytes: u32,
        gain: &FixedGain,
    ) {
        let batches = pixels.chunks_mut(LANES).zip(offsets.chunks(BATCH)).zip(ways.chunks(BATCH));
        for ((pixels, offsets), ways) in batches {
            self.gather(offsets, image, row_bytes);
            // Always all lanes: what lies behind the last pixel of an incomplete batch is computed and not used.
            match (pixels.first_chunk_mut(), ways.first_chunk()) {
                (Some(pixels), Some(ways)) => self.mix(ways, gain.lanes(), pixels),
                _ => {
                    let mut colors = [0; LANES];
                    self.rest[..ways.len()].copy_from_slice(ways);
                    self.mix(&self.rest, gain.lanes(), &mut colors);
                    pixels.copy_from_slice(&colors[..pixels.len()]);
                }
            }
        }
    }

    /// A function of its own: it needs all registers.
    #[inline(never)]
    fn gather(&mut self, offsets: &[u32], image: &[u8], row_bytes: u32) {
        let row_bytes = row_bytes as usize;
        for (index, &offset) in (0..BATCH).zip(offsets) {
            let (at, to) = (offset as usize, 3 * index);
            let window = &image[at..at + row_bytes + 8]; // one check for all four
            let (top, bottom) = (eight_bytes(window, 0), eight_bytes(window, row_bytes));
            self.top_left[to..to + 4].copy_from_slice(&(top as u32).to_le_bytes());
            self.top_right[to..to + 4].copy_from_slice(&((top >> 24) as u32).to_le_bytes());
            self.bottom_left[to..to + 4].copy_from_slice(&(bottom as u32).to_le_bytes());
            self.bottom_right[to..to + 4].copy_from_slice(&((bottom >> 24) as u32).to_le_bytes());
        }
    }

    #[inline(never)]
    fn mix(&self, ways: &[[u8; 3]; BATCH], factors: &[u16; LANES], colors: &mut [u8; LANES]) {
        widest(
            #[inline(always)]
            || self.mix_each(ways, factors, colors),
        );
    }

    #[inline(always)]
    fn mix_each(&self, ways: &[[u8; 3]; BATCH], factors: &[u16; LANES], colors: &mut [u8; LANES]) {
        let ways = ways.as_flattened();
        for lane in 0..LANES {
            let (right, below) = (u16::from(ways[lane] & 15), u16::from(ways[lane] >> 4));
            // In 16 bits: at most 255 * 16 after the first mixing and 255 * 256 after the second.
            let mix = |a: u16, b: u16, way: u16| a.wrapping_mul(16 - way).wrapping_add(b.wrapping_mul(way));
            let top = mix(u16::from(self.top_left[lane]), u16::from(self.top_right[lane]), right);
            let bottom = mix(u16::from(self.bottom_left[lane]), u16::from(self.bottom_right[lane]), right);
            let color = mix(top, bottom, below);
            let brightened = ((u32::from(color) * u32::from(factors[lane])) >> 16) as u16;
            colors[lane] = ((brightened + 32) >> 6).min(255) as u8;
        }
    }
}
