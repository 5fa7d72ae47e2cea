//! An experiment is a command of this program, run as it is printed under its figures. What it says is kept, so that work that was cut off
//! goes on where it stopped.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use arena::whole_file::write_whole;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Runs experiments and keeps what they say.
pub struct Experiments {
    data: PathBuf,
    program: PathBuf,
    fingerprint: String,
}

/// What is kept of an experiment.
#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    /// The command.
    command: String,
    /// Of which program.
    program: String,
    /// What it printed.
    result: Value,
}

impl Experiments {
    /// Results go to `data`, those of this very program that are there are taken as they are.
    ///
    /// # Errors
    /// If the folder cannot be made or the program cannot read itself.
    pub fn new(data: &Path) -> Result<Experiments> {
        std::fs::create_dir_all(data).with_context(|| format!("cannot make {}", data.display()))?;
        let program = std::env::current_exe().context("where this program lies is not known")?;
        let bytes = std::fs::read(&program).with_context(|| format!("cannot read {}", program.display()))?;
        Ok(Experiments { data: data.to_owned(), fingerprint: fingerprint(&bytes), program })
    }

    /// What `omnivln ARGS --json` prints.
    ///
    /// # Errors
    /// If it fails or prints something else.
    pub fn result<T: for<'a> Deserialize<'a>>(&self, args: &[String]) -> Result<T> {
        let command = command_line(args);
        let path = self.data.join(file_name(&command));
        let read = |value: Value| T::deserialize(value).with_context(|| format!("reading what \"{command}\" printed"));
        if let Some(kept) = self.kept(&path, &command) {
            return read(kept);
        }
        eprintln!("{command}");
        let output = Command::new(&self.program)
            .args(args)
            .arg("--json")
            .stdin(Stdio::null())
            .stderr(Stdio::inherit())
            .output()
            .with_context(|| format!("\"{command}\" could not be started"))?;
        if !output.status.success() {
            bail!("\"{command}\" failed: {}", output.status);
        }
        let result: Value = serde_json::from_slice(&output.stdout)
            .with_context(|| format!("\"{command}\" printed something that is no JSON"))?;
        let kept = Kept { command: command.clone(), program: self.fingerprint.clone(), result: result.clone() };
        write_whole(&path, |out| Ok(serde_json::to_writer(out, &kept)?))?;
        read(result)
    }

    fn kept(&self, path: &Path, command: &str) -> Option<Value> {
        let kept: Kept = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
        (kept.command == command && kept.program == self.fingerprint).then_some(kept.result)
    }
}

/// Differs from that of any other build.
fn fingerprint(bytes: &[u8]) -> String {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

/// The command as a person would type it.
pub fn command_line(args: &[String]) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=+".contains(c);
    let quoted = args.iter().map(|arg| {
        if !arg.is_empty() && arg.chars().all(is_plain) {
            arg.clone()
        } else {
            format!("'{}'", arg.replace('\'', "'\\''"))
        }
    });
    std::iter::once("omnivln".to_owned()).chain(quoted).collect::<Vec<_>>().join(" ")
}

/// Readable, and different for different commands.
fn file_name(command: &str) -> String {
    const LONGEST: usize = 100;
    let word: String = command.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let word = word.strip_prefix("omnivln-").unwrap_or(&word);
    let mut hasher = DefaultHasher::new();
    command.hash(&mut hasher);
    format!("{}-{:08x}.json", &word[..word.len().min(LONGEST)], hasher.finish() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_can_be_pasted() {
        let args = ["bench", "nav", "--plans", "a folder/it's"].map(str::to_owned);
        assert_eq!(command_line(&args), "omnivln bench nav --plans 'a folder/it'\\''s'");
    }

    #[test]
    fn different_commands_are_kept_in_different_files() {
        assert_ne!(file_name("omnivln bench nav --seed 1"), file_name("omnivln bench nav --seed=1"));
        let long = |end: char| file_name(&format!("omnivln {}{end}", "é".repeat(300)));
        assert_ne!(long('a'), long('b'));
    }
}
