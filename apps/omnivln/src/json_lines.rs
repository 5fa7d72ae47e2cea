//! Files of one JSON object a line: read with the place of what is wrong, written whole.

use std::fmt::Display;
use std::path::Path;

use anyhow::{Context, Result};
use arena::whole_file::write_whole;

/// Every line of a file that is not blank, read by `read`.
///
/// # Errors
/// What the system says, or what `read` says, with the path and the line.
pub fn read_lines<T>(path: &Path, read: impl Fn(&str) -> Result<T>) -> Result<Vec<T>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let numbered = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    numbered.map(|(at, line)| read(line).with_context(|| format!("{} line {}", path.display(), at + 1))).collect()
}

/// Writes the lines, if there is somewhere to write them to.
///
/// # Errors
/// What the system says, with the path.
pub fn write_lines(path: Option<&Path>, lines: &[impl Display]) -> Result<()> {
    path.map_or(Ok(()), |path| write_whole(path, |out| lines.iter().try_for_each(|line| writeln!(out, "{line}"))))
}
