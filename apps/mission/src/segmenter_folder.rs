//! Masks from files beside a recording: one file for each picture, in any format of [`crate::segmentation_files`].
//!
//! A file belongs to the picture whose time in nanoseconds its name ends with: `1532402927612460000.json`,
//! `panorama_1532402927612460000.json`. Other files are left alone.

use std::path::{Path, PathBuf};

use omni_perception::MaskedPanorama;

use crate::segmentation_files::{MAX_BYTES, SegmentationError, read_segmentation};
use crate::segmenter::{SegmentRequest, Segmenter, SegmenterError};

/// Reads masks from a folder.
#[derive(Debug, Clone)]
pub struct FolderSegmenter {
    /// Times and files, ascending.
    files: Vec<(i64, PathBuf)>,
    /// A file may be this far from the time of the picture; default 5 ms (clocks written in microseconds, and less than
    /// half the time between two pictures).
    pub tolerance_ns: i64,
}

impl FolderSegmenter {
    /// Lists the folder.
    ///
    /// # Errors
    /// [`SegmenterError::File`] if it cannot be listed.
    pub fn open(folder: &Path) -> Result<FolderSegmenter, SegmenterError> {
        let fault = |error: std::io::Error| file_error(folder, &error);
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(fault)? {
            let path = entry.map_err(fault)?.path();
            if let Some(stamp_ns) = stamp_of(&path) {
                files.push((stamp_ns, path));
            }
        }
        files.sort_unstable();
        Ok(FolderSegmenter { files, tolerance_ns: 5_000_000 })
    }

    /// Number of pictures with masks.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Whether no file belongs to a picture.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The file nearest to a time, the earlier of two that are equally near.
    fn file_at(&self, stamp_ns: i64) -> Option<&Path> {
        let after = self.files.partition_point(|(file_ns, _)| *file_ns < stamp_ns);
        let around = self.files[after.saturating_sub(1)..].iter().take(2);
        let off = |file_ns: i64| file_ns.abs_diff(stamp_ns);
        let nearest = around.min_by_key(|(file_ns, _)| off(*file_ns))?;
        (off(nearest.0) <= self.tolerance_ns.max(0) as u64).then_some(nearest.1.as_path())
    }
}

impl Segmenter for FolderSegmenter {
    fn segment(&mut self, request: SegmentRequest<'_>) -> Result<MaskedPanorama, SegmenterError> {
        let stamp_ns = request.stamp.0;
        let path = self.file_at(stamp_ns).ok_or(SegmenterError::NoFile { stamp_ns })?;
        let fault = |error: std::io::Error| file_error(path, &error);
        // Looked at before it is read: a file may be of any size.
        let bytes = std::fs::metadata(path).map_err(fault)?.len();
        if bytes > MAX_BYTES as u64 {
            return Err(SegmentationError::TooLong { bytes: bytes as usize }.into());
        }
        let segmentation = read_segmentation(&std::fs::read(path).map_err(fault)?)?;
        masked(request, segmentation.width_px, segmentation.height_px, segmentation.masks)
    }
}

/// The picture with its masks, if they are of one size.
pub(crate) fn masked(
    request: SegmentRequest<'_>,
    width_px: u32,
    height_px: u32,
    masks: Vec<omni_perception::Mask>,
) -> Result<MaskedPanorama, SegmenterError> {
    let (picture, of_masks) = ([request.image.width, request.image.height], [width_px, height_px]);
    if picture != of_masks {
        return Err(SegmenterError::Size { masks: of_masks, picture });
    }
    Ok(MaskedPanorama { stamp: request.stamp, masks, image: Some(request.image) })
}

/// The number that the name of a JSON file ends with.
fn stamp_of(path: &Path) -> Option<i64> {
    if path.extension()?.to_str()? != "json" {
        return None;
    }
    let stem = path.file_stem()?.to_str()?;
    let digits = stem.len() - stem.bytes().rev().take_while(u8::is_ascii_digit).count();
    stem[digits..].parse().ok()
}

fn file_error(path: &Path, error: &std::io::Error) -> SegmenterError {
    SegmenterError::File { path: path.display().to_string(), kind: error.kind() }
}
