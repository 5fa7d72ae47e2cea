//! Masks from an HTTP service: a picture goes out, a segmentation comes back.
//!
//! ```text
//! POST URL, Content-Type: application/json
//! {"version": 1,
//!  "stamp_ns": "1532402927612460000",          time of the picture; a text, for 64 bits do not fit every JSON reader
//!  "image": {"width": 1920, "height": 640, "encoding": "png", "data": "<base64>"},
//!  "phrases": ["mug", "sink"],                 nouns of the instruction
//!  "standing": ["person", "door", ...]}        what is always looked for
//!
//! 200 OK with the body of a segmentation file: any format of `segmentation_files`, of the picture's size
//! ```
//! A service in front of Grounded SAM 2 decodes the picture, joins phrases and standing list with " . ", and returns what the
//! demonstration writes into its JSON file. With SAM 2 in video mode it adds "object_id".
//!
//! A service is hostile until its answer is parsed: the wait, the number of tries and the size of the answer are bounded, and
//! after some failures in a row it is left alone for a number of images that doubles each time (a number and not a time, so
//! that a replay gives the same bytes).

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use omni_perception::{MaskedPanorama, RgbImage};
use serde_json::{Value, json};

use crate::http_post::post_json;
use crate::segmentation_files::{MAX_BYTES, read_segmentation};
use crate::segmenter::{SegmentRequest, Segmenter, SegmenterError};
use crate::segmenter_folder::masked;

/// Where the service is and how long we wait for it.
#[derive(Debug, Clone, PartialEq)]
pub struct HttpSegmenterConfig {
    /// Its address, e.g. `http://127.0.0.1:8092/segment`.
    pub url: String,
    /// Longest wait for one answer in seconds, default 5: a large model takes about one.
    pub timeout_s: f64,
    /// Requests for one image, default 2: a second one if the first failed on the way.
    pub attempts: u32,
    /// Images without masks in a row after which the service is left alone for one image, default 3.
    pub patience: u32,
    /// It is left alone for one image, then two, four, ... but at most for this many; default 32.
    pub longest_rest: u32,
}

impl HttpSegmenterConfig {
    /// Defaults for an address.
    pub fn new(url: &str) -> HttpSegmenterConfig {
        HttpSegmenterConfig { url: url.to_owned(), timeout_s: 5.0, attempts: 2, patience: 3, longest_rest: 32 }
    }
}

/// Asks a service.
#[derive(Debug, Clone)]
pub struct HttpSegmenter {
    config: HttpSegmenterConfig,
    /// Failures in a row, the last of them in words, and for how many images the service is left alone.
    failures: u32,
    last: String,
    rest: u32,
}

impl HttpSegmenter {
    /// A service that has not failed yet.
    pub fn new(config: HttpSegmenterConfig) -> HttpSegmenter {
        HttpSegmenter { config, failures: 0, last: String::new(), rest: 0 }
    }

    fn ask(&self, request: SegmentRequest<'_>) -> Result<MaskedPanorama, SegmenterError> {
        let body = request_body(&request)?;
        let config = &self.config;
        let mut attempt = 1;
        let answer = loop {
            match post_json(&config.url, &body, config.timeout_s, MAX_BYTES as u64) {
                Err(error) if error.is_passing() && attempt < config.attempts => attempt += 1,
                answer => break answer?,
            }
        };
        let segmentation = read_segmentation(&answer)?;
        masked(request, segmentation.width_px, segmentation.height_px, segmentation.masks)
    }
}

impl Segmenter for HttpSegmenter {
    fn segment(&mut self, request: SegmentRequest<'_>) -> Result<MaskedPanorama, SegmenterError> {
        if self.rest > 0 {
            self.rest -= 1;
            let (failures, last) = (self.failures, self.last.clone());
            return Err(SegmenterError::Resting { failures, last, images_left: self.rest });
        }
        let answer = self.ask(request);
        match &answer {
            Ok(_) => self.failures = 0,
            Err(error) => {
                self.failures = self.failures.saturating_add(1);
                self.last = error.to_string();
                if let Some(doublings) = self.failures.checked_sub(self.config.patience.max(1)) {
                    self.rest = 1_u32.checked_shl(doublings).unwrap_or(u32::MAX).min(self.config.longest_rest);
                }
            }
        }
        answer
    }
}

/// The JSON that is sent.
fn request_body(request: &SegmentRequest<'_>) -> Result<Value, SegmenterError> {
    let RgbImage { width, height, rgb } = &request.image;
    let fault = SegmenterError::Picture { width: *width, height: *height, bytes: rgb.len() };
    if u64::from(*width) * u64::from(*height) * 3 != rgb.len() as u64 {
        return Err(fault);
    }
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Sub)
        .write_image(rgb, *width, *height, ExtendedColorType::Rgb8)
        .map_err(|_| fault)?;
    Ok(json!({
        "version": 1,
        "stamp_ns": request.stamp.0.to_string(),
        "image": {"width": width, "height": height, "encoding": "png", "data": BASE64.encode(&png)},
        "phrases": request.phrases,
        "standing": request.standing,
    }))
}
