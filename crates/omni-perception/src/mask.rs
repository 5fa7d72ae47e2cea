//! What an open-vocabulary segmenter says about a panorama.

use crate::{Rle, Stamp};

/// One thing in the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    /// Its pixels.
    pub rle: Rle,
    /// What it is, in words.
    pub label: String,
    /// How sure the segmenter is, 0..=1.
    pub score: f32,
    /// A sentence about it (may be empty).
    pub caption: String,
    /// The object's number in the video (SAM2's object id), if the segmenter tracks. It is a hint and no identity:
    /// trackers lose things, take them up again under a new number, and confuse neighbours.
    pub track: Option<u64>,
}

impl Mask {
    /// A mask of a picture that is no part of a video, without a caption.
    pub fn new(rle: Rle, label: impl Into<String>, score: f32) -> Mask {
        Mask { rle, label: label.into(), score, caption: String::new(), track: None }
    }
}

/// Colour pixels, row by row, three bytes each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

impl RgbImage {
    /// The colour of a pixel; `None` outside or if the buffer is too short.
    pub fn at(&self, column: u32, row: u32) -> Option<[u8; 3]> {
        if column >= self.width || row >= self.height {
            return None;
        }
        let start = 3 * (row as usize * self.width as usize + column as usize);
        self.rgb.get(start..start + 3).map(|rgb| [rgb[0], rgb[1], rgb[2]])
    }
}

/// A segmented panorama.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MaskedPanorama {
    /// Time of the image (middle of the exposure).
    pub stamp: Stamp,
    /// The things in it.
    pub masks: Vec<Mask>,
    /// The picture, if at hand.
    pub image: Option<RgbImage>,
}
