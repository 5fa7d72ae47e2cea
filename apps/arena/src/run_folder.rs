//! The run folder: written beside its final place, put there whole at the end, never on top of something foreign.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// File that tells a run folder from any other folder.
const MARK: &str = "summary.json";

/// A folder being filled; [`RunFolder::publish`] moves it to its final place.
#[derive(Debug)]
pub struct RunFolder {
    target: PathBuf,
    staging: PathBuf,
    /// The file that tells a folder of its kind.
    mark: String,
    kind: String,
    /// The run is complete: whatever happens to the move, what was written stays.
    is_complete: bool,
}

impl RunFolder {
    /// Prepares to write `target`. An existing run folder will be replaced; any other non-empty folder is refused now,
    /// before the robot has moved.
    pub fn new(target: &Path) -> Result<RunFolder> {
        RunFolder::marked(target, MARK, "run folder")
    }

    /// The same for a folder of another kind, which a file called `mark` tells from all others.
    pub fn marked(target: &Path, mark: &str, kind: &str) -> Result<RunFolder> {
        if target.file_name().is_none() {
            bail!("{} is no name for a {kind}; --out needs a folder of its own", target.display());
        }
        refuse_foreign(target, mark, kind)?;
        let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_else(|| "run".into());
        let parent = parent_of(target);
        fs::create_dir_all(parent).with_context(|| format!("creating {}", parent.display()))?;
        let staging = parent.join(format!(".{name}.{}.part", std::process::id()));
        if staging.exists() {
            fs::remove_dir_all(&staging).with_context(|| format!("removing {}", staging.display()))?;
        }
        fs::create_dir_all(&staging).with_context(|| format!("creating {}", staging.display()))?;
        let (mark, kind) = (mark.to_owned(), kind.to_owned());
        Ok(RunFolder { target: target.to_path_buf(), staging, mark, kind, is_complete: false })
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        &self.staging
    }

    /// Writes one file into the folder; sub-folders are created.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.staging.join(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).with_context(|| format!("creating {}", parent.display()))?;
        }
        fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))
    }

    /// Moves the complete folder to its final place; the earlier run, if any, goes only now. Where that fails, the
    /// complete run stays where it was written, and the error says where.
    pub fn publish(mut self) -> Result<PathBuf> {
        self.is_complete = true;
        self.move_to_target().with_context(|| {
            format!("the run is complete and stays in {}, but could not be moved", self.staging.display())
        })?;
        Ok(self.target.clone())
    }

    fn move_to_target(&self) -> Result<()> {
        let context = || format!("moving the run to {}", self.target.display());
        // Somebody may have put something there while the robot drove.
        refuse_foreign(&self.target, &self.mark, &self.kind)?;
        sync_tree(&self.staging).with_context(context)?;
        let old = self.staging.with_extension("old");
        let had_old = self.target.exists();
        if had_old {
            if old.exists() {
                fs::remove_dir_all(&old).with_context(context)?;
            }
            fs::rename(&self.target, &old).with_context(context)?;
        }
        if let Err(error) = fs::rename(&self.staging, &self.target) {
            if had_old {
                // Put the earlier run back: nothing is lost.
                fs::rename(&old, &self.target).with_context(context)?;
            }
            return Err(error).with_context(context);
        }
        if had_old {
            fs::remove_dir_all(&old).with_context(|| format!("removing the earlier run {}", old.display()))?;
        }
        fs::File::open(parent_of(&self.target)).and_then(|folder| folder.sync_all()).with_context(context)
    }
}

impl Drop for RunFolder {
    /// An unpublished folder leaves nothing behind.
    fn drop(&mut self) {
        if !self.is_complete && self.staging.exists() {
            // Nothing more can be done about a failure here, and the folder's name says what it is.
            let _ = fs::remove_dir_all(&self.staging);
        }
    }
}

/// Nothing, an empty folder, or an earlier run may be replaced.
fn refuse_foreign(target: &Path, mark: &str, kind: &str) -> Result<()> {
    if target.is_file() {
        bail!(
            "{} is a file; --out needs a folder that does not exist yet or holds an earlier {kind}",
            target.display()
        );
    }
    if target.is_dir() {
        let is_empty = fs::read_dir(target).with_context(|| format!("reading {}", target.display()))?.next().is_none();
        if !is_empty && !target.join(mark).is_file() {
            bail!(
                "{} exists and is no {kind} (it has no {mark}); choose another --out, nothing was changed",
                target.display()
            );
        }
    }
    Ok(())
}

fn parent_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn sync_tree(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            sync_tree(&path)?;
        } else {
            fs::File::open(&path)?.sync_all()?;
        }
    }
    fs::File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_earlier_run_is_replaced_whole_and_a_foreign_folder_is_refused() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("run");
        let first = RunFolder::new(&target).unwrap();
        first.write(MARK, b"{}").unwrap();
        first.write("old.txt", b"1").unwrap();
        first.publish().unwrap();

        let abandoned = RunFolder::new(&target).unwrap();
        abandoned.write(MARK, b"half").unwrap();
        drop(abandoned);
        assert_eq!(fs::read(target.join(MARK)).unwrap(), b"{}", "an abandoned run changes nothing");

        let second = RunFolder::new(&target).unwrap();
        second.write(MARK, b"{\"second\":true}").unwrap();
        second.publish().unwrap();
        assert!(!target.join("old.txt").exists());
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1, "no rests");

        let blocked = root.path().join("blocked");
        let third = RunFolder::new(&blocked).unwrap();
        third.write(MARK, b"{}").unwrap();
        // Somebody puts a file there while the robot drives.
        fs::write(&blocked, b"in the way").unwrap();
        let (staging, failure) = (third.path().to_path_buf(), format!("{:#}", third.publish().unwrap_err()));
        assert!(failure.contains("stays in"), "{failure}");
        assert!(staging.join(MARK).is_file(), "a complete run is never thrown away");
        assert_eq!(fs::read(&blocked).unwrap(), b"in the way");

        let foreign = root.path().join("photos");
        fs::create_dir(&foreign).unwrap();
        fs::write(foreign.join("cat.png"), b"meow").unwrap();
        let refusal = RunFolder::new(&foreign).unwrap_err().to_string();
        assert!(refusal.contains("no run folder"), "{refusal}");
        assert!(foreign.join("cat.png").exists());
    }
}
