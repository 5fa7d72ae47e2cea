//! The map as bytes: a head with version and settings, one record of fixed size per cell, a check sum.
//!
//! All numbers are little-endian. `OMNILMAP`, major u16, minor u16, edge f32, points per cell f32, thickness f32, noise f32, count
//! of cells u32, the cells, FNV-1a of everything before it u64. Another major version is refused.

use std::io::{self, Read, Write};

use thiserror::Error;

use super::{Cell, NO_CELL, VoxelMap};

const MAGIC: &[u8; 8] = b"OMNILMAP";
const MAJOR: u16 = 1;
const MINOR: u16 = 0;
const HEAD: usize = 32;
/// Key, count, mean, scatter, view, plane, variance, fitted count: 3 i32 and 19 f32.
const RECORD: usize = 4 * 22;

/// Why a map cannot be read.
#[derive(Debug, Error)]
pub enum MapFileError {
    /// Reading or writing failed, or the file is truncated.
    #[error("the map cannot be read or written: {0}")]
    Io(#[from] io::Error),
    /// It does not begin as a map does.
    #[error("this is no map of the odometry: it does not begin with OMNILMAP")]
    NotAMap,
    /// The version is newer than this program.
    #[error("the map has version {found}; this program reads version {MAJOR}")]
    Version {
        /// Major version of the file.
        found: u16,
    },
    /// A byte changed.
    #[error("the map is damaged: its check sum differs")]
    CheckSum,
    /// A number makes no sense.
    #[error("the map is damaged: cell {cell} holds numbers that no map has")]
    Cell {
        /// Number of the cell.
        cell: usize,
    },
    /// The settings in the head make no sense.
    #[error("the map is damaged: its head holds numbers that no map has")]
    Head,
    /// It holds more cells than may be kept.
    #[error("the map has {found} cells; at most {limit} may be kept (max_map_voxels)")]
    TooLarge {
        /// Cells in the file.
        found: usize,
        /// The cap.
        limit: usize,
    },
}

impl VoxelMap {
    /// Writes the map.
    ///
    /// # Errors
    /// [`io::Error`] of the writer.
    pub fn write(&self, mut writer: impl Write) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(HEAD + self.cells.len() * RECORD + 8);
        bytes.extend(MAGIC);
        bytes.extend(MAJOR.to_le_bytes());
        bytes.extend(MINOR.to_le_bytes());
        bytes.extend(self.cell_m.to_le_bytes());
        bytes.extend(self.points_per_cell.to_le_bytes());
        let noise_m = self.noise_m.unwrap_or(0.0);
        bytes.extend((self.max_plane_thickness_m as f32).to_le_bytes());
        bytes.extend((noise_m as f32).to_le_bytes());
        bytes.extend((self.cells.len() as u32).to_le_bytes());
        for cell in &self.cells {
            bytes.extend(cell.key.iter().flat_map(|k| k.to_le_bytes()));
            bytes.extend(floats(cell).iter().flat_map(|x| x.to_le_bytes()));
        }
        bytes.extend(fnv(&bytes).to_le_bytes());
        writer.write_all(&bytes)
    }

    /// Reads a map that may hold up to `max_cells` cells.
    ///
    /// # Errors
    /// [`MapFileError`]; the reader is not trusted.
    pub fn read(mut reader: impl Read, max_cells: usize) -> Result<VoxelMap, MapFileError> {
        let mut head = [0; HEAD];
        reader.read_exact(&mut head)?;
        let at = |from: usize| [head[from], head[from + 1], head[from + 2], head[from + 3]];
        if &head[..8] != MAGIC {
            return Err(MapFileError::NotAMap);
        }
        let found = u16::from_le_bytes([head[8], head[9]]);
        if found != MAJOR {
            return Err(MapFileError::Version { found });
        }
        let (cell_m, points_per_cell) = (f32::from_le_bytes(at(12)), f32::from_le_bytes(at(16)));
        let (thickness_m, noise_m) = (f64::from(f32::from_le_bytes(at(20))), f64::from(f32::from_le_bytes(at(24))));
        let is_sound = (0.02..=5.0).contains(&cell_m)
            && (1.0..=1e6).contains(&points_per_cell)
            && (1e-4..=1.0).contains(&thickness_m)
            && (0.0..=1.0).contains(&noise_m);
        if !is_sound {
            return Err(MapFileError::Head);
        }
        let count = u32::from_le_bytes(at(28)) as usize;
        if count > max_cells {
            return Err(MapFileError::TooLarge { found: count, limit: max_cells });
        }
        let mut body = Vec::new();
        reader.take((count * RECORD + 8) as u64).read_to_end(&mut body)?;
        let sum = body.len().checked_sub(8).filter(|&length| length == count * RECORD);
        let Some(length) = sum else {
            return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
        };
        let (records, sum) = body.split_at(length);
        if fnv_continued(fnv(&head), records).to_le_bytes() != *sum {
            return Err(MapFileError::CheckSum);
        }
        let mut map = VoxelMap {
            cell_m,
            max_cells,
            points_per_cell,
            max_plane_thickness_m: thickness_m,
            noise_m: (noise_m > 0.0).then_some(noise_m),
            cells: Vec::with_capacity(count),
            index: Default::default(),
            scan: 0,
        };
        for (number, record) in records.chunks_exact(RECORD).enumerate() {
            map.cells.push(cell(record).ok_or(MapFileError::Cell { cell: number })?);
        }
        map.rebuild_index();
        let mut faces = rustc_hash::FxHashMap::default();
        for (number, cell) in map.cells.iter().enumerate() {
            let faces = faces.entry(cell.key).or_insert(0);
            *faces += 1;
            if *faces > 2 {
                return Err(MapFileError::Cell { cell: number });
            }
        }
        Ok(map)
    }
}

fn floats(cell: &Cell) -> [f32; 19] {
    let mut all = [0.0; 19];
    all[0] = cell.count;
    all[1..4].copy_from_slice(&cell.mean_m);
    all[4..10].copy_from_slice(&cell.scatter);
    all[10..13].copy_from_slice(&cell.view);
    all[13..17].copy_from_slice(&cell.plane);
    all[17] = cell.plane_variance_m2;
    all[18] = cell.fitted_count;
    all
}

fn cell(record: &[u8]) -> Option<Cell> {
    let (words, _) = record.as_chunks::<4>();
    let key = [0, 1, 2].map(|k| i32::from_le_bytes(words[k]));
    let mut all = [0.0; 19];
    for (number, word) in all.iter_mut().zip(&words[3..]) {
        *number = f32::from_le_bytes(*word);
    }
    let part = |from: usize| [all[from], all[from + 1], all[from + 2]];
    let plane = [all[13], all[14], all[15], all[16]];
    let length = (plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2]).sqrt();
    let is_sound = all.iter().all(|x| x.is_finite() && x.abs() < 1e9)
        && all[0] >= 0.0
        && all[17] >= 0.0
        && (length == 0.0 || (length - 1.0).abs() < 1e-3);
    is_sound.then(|| Cell {
        key,
        count: all[0],
        mean_m: part(1),
        scatter: [all[4], all[5], all[6], all[7], all[8], all[9]],
        view: part(10),
        plane,
        plane_variance_m2: all[17],
        fitted_count: all[18],
        last_seen: 0,
        conflicts: 0,
        back: NO_CELL,
    })
}

/// FNV-1a with 64 bits.
fn fnv(bytes: &[u8]) -> u64 {
    fnv_continued(0xcbf2_9ce4_8422_2325, bytes)
}

fn fnv_continued(sum: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(sum, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
