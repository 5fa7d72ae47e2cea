//! Who says what is in a picture: an open-vocabulary segmenter, asked image by image.
//!
//! The segmenter stands at the source of the stream, before the robot's side: whoever produces
//! [`SensorEvent::Panorama`](crate::stream::SensorEvent) gets the masks from one of these.
//!
//! | masks come from | here |
//! | --- | --- |
//! | the simulator | `arena::simulation` (it segments what it renders, not the picture) |
//! | files beside a recording | [`FolderSegmenter`](crate::segmenter_folder::FolderSegmenter) |
//! | an HTTP service | [`HttpSegmenter`](crate::segmenter_http::HttpSegmenter) |
//!
//! A picture that could not be segmented must not be delivered with no masks: that would say that nothing is there. It is
//! left out and counted, and the run goes on.

use omni_perception::{MaskedPanorama, RgbImage, Stamp};
use thiserror::Error;

use crate::http_post::PostError;
use crate::segmentation_files::SegmentationError;

/// What a robot always looks for besides the nouns of its instruction: what tells rooms apart, what sentences refer to,
/// and what moves.
#[rustfmt::skip]
pub const STANDING: &[&str] = &[
    "person", "door", "bed", "nightstand", "wardrobe", "dresser", "sofa", "armchair", "coffee table", "television", "tv stand",
    "bookshelf", "dining table", "chair", "office chair", "desk", "monitor", "keyboard", "laptop", "printer", "whiteboard",
    "conference table", "filing cabinet", "copier", "cabinet", "counter", "sink", "stove", "fridge", "dishwasher", "microwave",
    "coffee machine", "kettle", "toilet", "bathtub", "washing machine", "mirror", "towel", "plant", "lamp", "picture", "clock",
    "trash bin", "box", "suitcase", "backpack", "mug", "bottle", "book", "pillow", "fire extinguisher", "vending machine",
];

/// One picture and what to look for in it.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentRequest<'a> {
    /// Time of the picture (middle of the exposure).
    pub stamp: Stamp,
    /// The picture; it comes back in the [`MaskedPanorama`].
    pub image: RgbImage,
    /// Nouns of the instruction.
    pub phrases: &'a [String],
    /// What is always looked for.
    pub standing: &'a [String],
}

/// Why a picture has no masks.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SegmenterError {
    /// The service did not answer as it should.
    #[error("the segmenter did not answer: {0}")]
    Service(#[from] PostError),
    /// It failed so often that it is left alone for some images.
    #[error(
        "the segmenter failed {failures} times in a row (last: {last}) and is asked again after {images_left} more images"
    )]
    Resting {
        /// Failures in a row.
        failures: u32,
        /// The last of them.
        last: String,
        /// Images until the next request.
        images_left: u32,
    },
    /// What it said cannot be read.
    #[error("the segmenter's answer cannot be read: {0}")]
    Answer(#[from] SegmentationError),
    /// Masks of another size than the picture.
    #[error("the masks are {masks:?} pixels (width, height), the picture {picture:?}")]
    Size {
        /// Width and height of the masks.
        masks: [u32; 2],
        /// Width and height of the picture.
        picture: [u32; 2],
    },
    /// The picture's buffer does not fit its size.
    #[error("a picture of {width} x {height} pixels with {bytes} bytes instead of three a pixel")]
    Picture {
        /// Width.
        width: u32,
        /// Height.
        height: u32,
        /// Length of its buffer.
        bytes: usize,
    },
    /// There is no file for this time.
    #[error("no file of masks for the picture at {stamp_ns} ns")]
    NoFile {
        /// Time of the picture.
        stamp_ns: i64,
    },
    /// A file cannot be read.
    #[error("reading {path}: {kind}")]
    File {
        /// The file.
        path: String,
        /// What the system said.
        kind: std::io::ErrorKind,
    },
}

/// Something that finds things in pictures.
pub trait Segmenter {
    /// The masks of one picture.
    ///
    /// # Errors
    /// See [`SegmenterError`]. The next picture may be asked for whatever happened to this one.
    fn segment(&mut self, request: SegmentRequest<'_>) -> Result<MaskedPanorama, SegmenterError>;
}
