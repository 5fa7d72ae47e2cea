//! The volume as a file: versioned, checksummed, read with typed errors.
//!
//! Layout, little-endian: `OMNIVOL\0`, u16 major, u16 minor, the configuration, u32 revision, u32 scans (not in version 1), u64 block count, then the blocks in ascending key
//! order, then a 64-bit FNV-1a sum of everything before it. A block is its key (x, y, z as i32), a flag byte (bit 0: carries
//! votes, bit 1: all known voxels are firmly free, bit 2: its votes name instances), the occupied set, 512 weights, 512 distances unless
//! firmly free, and the votes: 512 labels, 512 leads, 512 instances if there are any.

use std::io::{Read, Write};

use thiserror::Error;

use crate::block::{ALL_VOXELS, BLOCK_VOXELS, Block, BlockKey, DISTANCE_ONE};
use crate::config::{ConfigError, VolumeConfig};
use crate::volume::{MAX_VOXEL_INDEX, Volume};
use crate::votes::Votes;

const MAGIC: [u8; 8] = *b"OMNIVOL\0";
const MAJOR: u16 = 2;
const MINOR: u16 = 0;

/// A volume file that cannot be read.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The reader failed, or the file ends early.
    #[error("reading the volume failed")]
    Io(#[from] std::io::Error),
    /// The file does not begin like a volume.
    #[error("not a volume file")]
    NotAVolume,
    /// Written by a newer, incompatible version.
    #[error("the file has format version {found}, this program reads up to {supported}")]
    NewerVersion {
        /// Major version of the file.
        found: u16,
        /// Major version of this program.
        supported: u16,
    },
    /// The configuration in the file makes no sense.
    #[error("the configuration in the file is not valid")]
    Config(#[from] ConfigError),
    /// More blocks than its own configuration allows.
    #[error("the file declares {0} blocks, more than its own limit")]
    TooManyBlocks(u64),
    /// Blocks are out of order, doubled, too far away, or hold values out of range.
    #[error("block {0} is broken")]
    Block(u64),
    /// The sum at the end does not match.
    #[error("the checksum does not match: the file is damaged")]
    Checksum,
}

impl Volume {
    /// Writes the volume. The same volume gives the same bytes.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn save(&self, out: impl Write) -> std::io::Result<()> {
        let mut out = Summed { inner: out, sum: FNV_START };
        out.write_all(&MAGIC)?;
        out.write_all(&MAJOR.to_le_bytes())?;
        out.write_all(&MINOR.to_le_bytes())?;
        let c = &self.config;
        for value in [c.voxel_m, c.truncation_m, c.behind_m, c.max_range_m, c.min_range_m] {
            out.write_all(&value.to_le_bytes())?;
        }
        out.write_all(&[c.max_weight, c.clear_weight, c.min_weight])?;
        out.write_all(&(c.clear_every as u64).to_le_bytes())?;
        out.write_all(&(c.max_blocks as u64).to_le_bytes())?;
        out.write_all(&self.revision.to_le_bytes())?;
        out.write_all(&self.scans.to_le_bytes())?;
        out.write_all(&(self.blocks.len() as u64).to_le_bytes())?;
        let mut blocks: Vec<&Block> = self.blocks.iter().collect();
        blocks.sort_unstable_by_key(|b| b.key);
        let mut bytes = Vec::with_capacity(4096);
        for block in blocks {
            bytes.clear();
            for v in [block.key.x, block.key.y, block.key.z] {
                bytes.extend_from_slice(&v.to_le_bytes());
            }
            let is_free = (0..BLOCK_VOXELS).all(|i| block.distance[i] == free_distance(block.weight[i]));
            let has_instances = block.votes.as_ref().is_some_and(|votes| votes.instance.is_some());
            bytes.push(u8::from(block.votes.is_some()) | u8::from(is_free) << 1 | u8::from(has_instances) << 2);
            bytes.extend(block.occupied.iter().flat_map(|word| word.to_le_bytes()));
            bytes.extend_from_slice(&block.weight);
            if !is_free {
                bytes.extend(block.distance.iter().flat_map(|d| d.to_le_bytes()));
            }
            if let Some(votes) = &block.votes {
                bytes.extend(votes.label.iter().flat_map(|l| l.to_le_bytes()));
                bytes.extend_from_slice(&votes.count);
                bytes.extend(votes.instance.iter().flat_map(|all| all.iter()).flat_map(|i| i.to_le_bytes()));
            }
            out.write_all(&bytes)?;
        }
        let sum = out.sum;
        out.inner.write_all(&sum.to_le_bytes())?;
        out.inner.flush()
    }

    /// Reads a volume. It answers like the one that was saved; the mesh is made again at the next
    /// [`update_mesh`](Volume::update_mesh).
    ///
    /// # Errors
    /// [`LoadError`] says what is wrong; nothing in the file can make this panic or take more memory than it is long.
    pub fn load(input: impl Read) -> Result<Self, LoadError> {
        let mut input = Summed { inner: input, sum: FNV_START };
        if input.take::<8>().map_err(|_| LoadError::NotAVolume)? != MAGIC {
            return Err(LoadError::NotAVolume);
        }
        let major = u16::from_le_bytes(input.take()?);
        if major > MAJOR {
            return Err(LoadError::NewerVersion { found: major, supported: MAJOR });
        }
        let _minor = u16::from_le_bytes(input.take()?);
        let mut lengths = [0.0; 5];
        for value in &mut lengths {
            *value = f64::from_le_bytes(input.take()?);
        }
        let [max_weight, clear_weight, min_weight] = input.take()?;
        let clear_every = usize::try_from(u64::from_le_bytes(input.take()?)).unwrap_or(0);
        let max_blocks = usize::try_from(u64::from_le_bytes(input.take()?)).unwrap_or(0);
        let [voxel_m, truncation_m, behind_m, max_range_m, min_range_m] = lengths;
        let mut volume = Self::new(VolumeConfig {
            voxel_m,
            truncation_m,
            behind_m,
            max_range_m,
            min_range_m,
            max_weight,
            clear_weight,
            min_weight,
            clear_every,
            max_blocks,
        })?;
        volume.revision = u32::from_le_bytes(input.take()?).max(1);
        volume.scans = if major == 1 { volume.revision } else { u32::from_le_bytes(input.take()?) };
        let count = u64::from_le_bytes(input.take()?);
        if count > volume.config.max_blocks as u64 {
            return Err(LoadError::TooManyBlocks(count));
        }
        let mut last = None;
        for number in 0..count {
            let block = read_block(&mut input, number, &volume)?;
            if last.is_some_and(|last| last >= block.key) {
                return Err(LoadError::Block(number));
            }
            last = Some(block.key);
            volume.push_block(block);
        }
        let sum = input.sum;
        if u64::from_le_bytes(input.take()?) != sum {
            return Err(LoadError::Checksum);
        }
        Ok(volume)
    }
}

fn read_block<R: Read>(input: &mut Summed<R>, number: u64, volume: &Volume) -> Result<Block, LoadError> {
    let [x, y, z] = [input.take()?, input.take()?, input.take()?].map(i32::from_le_bytes);
    let limit = MAX_VOXEL_INDEX as i32 / 8;
    let [flags] = input.take()?;
    if [x, y, z].iter().any(|v| *v < -limit || *v >= limit) || flags > 7 || flags & 5 == 4 {
        return Err(LoadError::Block(number));
    }
    let mut block = Block::new(BlockKey { x, y, z });
    for word in &mut block.occupied {
        *word = u64::from_le_bytes(input.take()?);
    }
    let occupied = block.occupied;
    block.weight = input.take()?;
    if flags & 2 == 0 {
        let bytes: [u8; 2 * BLOCK_VOXELS] = input.take()?;
        for (distance, pair) in block.distance.iter_mut().zip(bytes.chunks_exact(2)) {
            *distance = i16::from_le_bytes([pair[0], pair[1]]);
        }
    } else {
        for (distance, weight) in block.distance.iter_mut().zip(&block.weight) {
            *distance = free_distance(*weight);
        }
    }
    let is_in_range = |d: &i16| (-DISTANCE_ONE..=DISTANCE_ONE).contains(d);
    if !block.distance.iter().all(is_in_range) || block.weight.iter().any(|w| *w > volume.config.max_weight) {
        return Err(LoadError::Block(number));
    }
    if flags & 1 == 1 {
        let mut votes = Votes::none();
        votes.label = take_words(input)?;
        votes.count = input.take()?;
        if flags & 4 == 4 {
            votes.instance = Some(Box::new(take_words(input)?));
        }
        block.votes = Some(votes);
    }
    // The hysteresis keeps what the file says as long as the distances allow it.
    block.refresh(&ALL_VOXELS, &volume.thresholds);
    if block.occupied != occupied {
        return Err(LoadError::Block(number));
    }
    block.occupancy_revision = volume.revision;
    block.surface_revision = volume.revision;
    Ok(block)
}

fn take_words<R: Read>(input: &mut Summed<R>) -> std::io::Result<[u16; BLOCK_VOXELS]> {
    let bytes: [u8; 2 * BLOCK_VOXELS] = input.take()?;
    Ok(std::array::from_fn(|i| u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]])))
}

/// What an untouched or a firmly free voxel holds.
fn free_distance(weight: u8) -> i16 {
    if weight == 0 { 0 } else { DISTANCE_ONE }
}

const FNV_START: u64 = 0xcbf2_9ce4_8422_2325;

/// Sums what passes through.
struct Summed<T> {
    inner: T,
    sum: u64,
}

impl<T> Summed<T> {
    fn add(&mut self, bytes: &[u8]) {
        for b in bytes {
            self.sum = (self.sum ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

impl<W: Write> Summed<W> {
    fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.add(bytes);
        self.inner.write_all(bytes)
    }
}

impl<R: Read> Summed<R> {
    fn take<const N: usize>(&mut self) -> std::io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.inner.read_exact(&mut bytes)?;
        self.add(&bytes);
        Ok(bytes)
    }
}
