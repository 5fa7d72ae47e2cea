//! A floor plan in a PNG: free where it is white, with its rooms from a label picture beside it or cut by the robots' own code.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use image::{GrayImage, ImageReader, Limits};
use mission::rooms::{RoomConfig, RoomMap};
use mission::volumetric_map::{Cell, OccupancyGrid};
use nalgebra::Point2;
use omni_sim::building::Building;
use omni_sim::plan_image::{FREE_FROM, MOST_PIXELS, PlanConfig, PlanImage, raise_plan};

/// Edge of a pixel where nothing else is said, metres.
pub const RESOLUTION_M: f64 = 0.05;
/// Longest side of a picture, pixels.
const LONGEST_SIDE: u32 = 1 << 14;
/// A white patch of a label picture is a room from this many pixels on.
const SMALLEST_LABEL: usize = 101;
/// ... and white from this value on.
const LABEL_FROM: u8 = 251;

/// A plan with its rooms.
#[derive(Debug, Clone)]
pub struct PlanFile {
    grey: Vec<u8>,
    labels: Vec<u32>,
    width: usize,
    height: usize,
}

impl PlanFile {
    /// Reads `X.png` and, if it is there, `X_gt_segmentation.png`, whose white patches are the rooms.
    ///
    /// # Errors
    /// A sentence that names the file and what is wrong with it.
    pub fn read(path: &Path) -> Result<PlanFile> {
        let picture = read_grey(path)?;
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let beside = labels_beside(path);
        let labels = if beside.is_file() {
            let labels = read_grey(&beside)?;
            ensure!(
                labels.dimensions() == picture.dimensions(),
                "{} has {} x {} pixels and its plan {width} x {height}; both must have the same",
                beside.display(),
                labels.width(),
                labels.height()
            );
            white_patches(labels.as_raw(), width, height)
        } else {
            let free: Vec<bool> = picture.as_raw().iter().map(|grey| *grey >= FREE_FROM).collect();
            cut_rooms(&free, width, height).with_context(|| format!("cutting {} into rooms", path.display()))?
        };
        Ok(PlanFile { grey: picture.into_raw(), labels, width, height })
    }

    /// A building made of it.
    ///
    /// # Errors
    /// If no two rooms of it are joined for this configuration.
    pub fn building(&self, config: &PlanConfig) -> Result<Building> {
        let PlanFile { grey, labels, width, height } = self;
        let plan = PlanImage { grey, labels, width: *width, height: *height, resolution_m: RESOLUTION_M };
        Ok(raise_plan(&plan, config)?)
    }
}

/// `X_gt_segmentation.png` of `X.png`.
pub fn labels_beside(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_gt_segmentation.png"))
}

fn read_grey(path: &Path) -> Result<GrayImage> {
    let place = || format!("reading the floor plan {}", path.display());
    let mut reader = ImageReader::open(path).with_context(place)?.with_guessed_format().with_context(place)?;
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(LONGEST_SIDE), Some(LONGEST_SIDE));
    reader.limits(limits);
    let picture = reader.decode().with_context(place)?.into_luma8();
    let pixels = picture.as_raw().len();
    ensure!(pixels <= MOST_PIXELS, "{} has {pixels} pixels; at most {MOST_PIXELS} are read", path.display());
    Ok(picture)
}

/// Patches of white pixels that touch at sides or corners, numbered from 1; small ones are none.
fn white_patches(grey: &[u8], width: usize, height: usize) -> Vec<u32> {
    let mut labels = vec![0; grey.len()];
    let mut is_seen = vec![false; grey.len()];
    let mut count = 0;
    for first in 0..grey.len() {
        if is_seen[first] || grey[first] < LABEL_FROM {
            continue;
        }
        is_seen[first] = true;
        let mut patch = vec![first];
        let mut next = 0;
        while next < patch.len() {
            let (x, y) = (patch[next] % width, patch[next] / width);
            for other_y in y.saturating_sub(1)..(y + 2).min(height) {
                for other_x in x.saturating_sub(1)..(x + 2).min(width) {
                    let other = other_y * width + other_x;
                    if !is_seen[other] && grey[other] >= LABEL_FROM {
                        is_seen[other] = true;
                        patch.push(other);
                    }
                }
            }
            next += 1;
        }
        if patch.len() >= SMALLEST_LABEL {
            count += 1;
            patch.into_iter().for_each(|at| labels[at] = count);
        }
    }
    labels
}

/// The rooms of a free floor as `omnivln rooms` cuts them: numbers from 1, 0 for none. Rows of [`RESOLUTION_M`] from the north-west corner.
///
/// # Errors
/// A configuration of rooms that makes no sense; the default one does.
pub fn cut_rooms(free: &[bool], width: usize, height: usize) -> Result<Vec<u32>> {
    // A frame of wall: nobody knows what lies beyond the picture.
    let mut grid = OccupancyGrid::unknown(Point2::origin(), RESOLUTION_M, width + 2, height + 2);
    grid.cells.fill(Cell::Occupied);
    let cell = |at: usize| (at / width + 1) * (width + 2) + at % width + 1;
    (0..free.len()).filter(|at| free[*at]).for_each(|at| grid.cells[cell(at)] = Cell::Free);
    let rooms = RoomMap::new(&grid, None, &RoomConfig::default())?;
    Ok((0..free.len()).map(|at| rooms.part_of_cell()[cell(at)].map_or(0, |part| part + 1)).collect())
}
