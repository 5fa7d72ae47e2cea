//! A recording with masks put to its pictures, by files beside it or by a service.
//!
//! A picture that the segmenter has nothing to say about is an error in the stream and not a picture without things.

use omni_perception::MaskedPanorama;

use crate::recording::RecordingError;
use crate::segmenter::{SegmentRequest, Segmenter};
use crate::stream::SensorEvent;

/// The events of `recording`, its panoramas with the masks that `segmenter` gives them for `phrases` (nouns of the
/// instruction) and `standing` (what is always looked for).
pub fn segmented<'a, S: Segmenter + 'a>(
    recording: impl Iterator<Item = Result<SensorEvent, RecordingError>> + 'a,
    mut segmenter: S,
    phrases: &'a [String],
    standing: &'a [String],
) -> impl Iterator<Item = Result<SensorEvent, RecordingError>> + 'a {
    recording.map(move |item| match item {
        Ok(SensorEvent::Panorama(MaskedPanorama { stamp, image: Some(image), .. })) => segmenter
            .segment(SegmentRequest { stamp, image, phrases, standing })
            .map(SensorEvent::Panorama)
            .map_err(|source| RecordingError::Masks { stamp, source }),
        item => item,
    })
}
