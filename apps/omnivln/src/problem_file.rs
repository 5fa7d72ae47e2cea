//! Files of planning problems, bounded.

use std::path::Path;

use anyhow::{Context, Result, bail};

/// Largest file that is read.
const MAX_BYTES: u64 = 256 << 20;

/// The text of a file of problems.
pub fn read(path: &Path) -> Result<String> {
    let place = || path.display().to_string();
    let size = std::fs::metadata(path).with_context(place)?.len();
    if size > MAX_BYTES {
        bail!("{}: {size} bytes; at most {MAX_BYTES} are read", path.display());
    }
    std::fs::read_to_string(path).with_context(place)
}
