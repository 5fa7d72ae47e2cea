//! Files that are whole or not there: written beside their place, to the disk, and then put into it.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::{Context, Result};

/// Lets `write` fill a file beside `path` and puts that into its place; an old file stays whole until the new one is.
///
/// # Errors
/// What the system says, with the path. Nothing is left beside it.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let name = path.file_name().with_context(|| format!("{} names no file", path.display()))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let beside = folder.join(format!(".{}.{}.part", name.to_string_lossy(), std::process::id()));
    let result = (|| {
        let file = File::create(&beside)?;
        let mut out = BufWriter::new(&file);
        write(&mut out)?;
        out.flush()?;
        drop(out);
        file.sync_all()?;
        std::fs::rename(&beside, path)?;
        File::open(folder)?.sync_all()
    })();
    if result.is_err() {
        // Whatever stopped the writing is the error to tell; a leftover is only untidy.
        let _ = std::fs::remove_file(&beside);
    }
    result.with_context(|| format!("writing {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_old_file_stays_until_the_new_one_is_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.txt");
        let names = || std::fs::read_dir(folder.path()).expect("it lists").count();
        write_whole(&path, |out| out.write_all(b"old")).expect("written");
        let error = write_whole(&path, |out| {
            out.write_all(b"half of the ne")?;
            Err(std::io::Error::other("the disk is full"))
        });
        assert!(format!("{:#}", error.expect_err("it failed")).contains("a.txt: the disk is full"));
        assert_eq!((std::fs::read(&path).expect("there"), names()), (b"old".to_vec(), 1));
        write_whole(&path, |out| out.write_all(b"new")).expect("written");
        assert_eq!((std::fs::read(&path).expect("there"), names()), (b"new".to_vec(), 1));
        assert!(write_whole(Path::new(".."), |_| Ok(())).is_err());
        assert!(write_whole(&folder.path().join("none/a.txt"), |_| Ok(())).is_err());
    }
}
