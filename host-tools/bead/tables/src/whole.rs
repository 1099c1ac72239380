//! Files that appear whole or not at all.
//!
//! # Design
//! A result is written under a hidden name beside its own and renamed when it is complete. A list holds the
//! hidden names, so that an interrupted program can remove its unfinished files ([`remove_unfinished`]).

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// First letters of the hidden name of an unfinished file.
const PREFIX: &str = ".bead-";

/// True for the hidden name of an unfinished file.
pub fn is_unfinished(name: &str) -> bool {
    name.starts_with(PREFIX)
}

/// The path of standard output.
pub const STANDARD_OUTPUT: &str = "-";

/// Copies what `fill` writes to standard output. A reader that has gone away is not an error.
fn to_standard_output(fill: impl FnOnce(&mut fs::File) -> anyhow::Result<()>) -> anyhow::Result<()> {
    let mut file = tempfile::tempfile()?;
    fill(&mut file)?;
    file.rewind()?;
    let mut out = io::stdout().lock();
    match io::copy(&mut file, &mut out).and_then(|_| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}

/// Appends a text to the name of a file, before its extension.
pub fn with_stem_end(path: &Path, end: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(end);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {path}: {reason:#}")]
pub struct WriteError {
    path: PathBuf,
    reason: anyhow::Error,
}

/// A file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    replaces: bool,
}

impl Target {
    /// A new file, which never replaces another.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            replaces: false,
        }
    }

    /// Sets whether the file replaces an existing one of its name.
    #[must_use]
    pub fn replacing(self, replaces: bool) -> Self {
        Self { replaces, ..self }
    }

    /// Appends the number of another file of the same run, which was meant for `wanted` and went to `took`
    /// because that name was taken.
    #[must_use]
    pub fn beside(&self, wanted: &Path, took: &Path) -> Self {
        let stem = |path: &Path| {
            path.file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        let took = stem(took);
        let number = took.strip_prefix(&stem(wanted)).unwrap_or_default();
        let path = with_stem_end(&self.path, number);
        Self { path, ..*self }
    }

    /// Standard output, which gets the result in one piece when it is whole. Its path is `-`.
    pub fn standard_output() -> Self {
        Self::new(STANDARD_OUTPUT)
    }

    /// True for [`standard_output`](Self::standard_output).
    fn is_standard_output(&self) -> bool {
        self.path == Path::new(STANDARD_OUTPUT)
    }

    /// Path of the finished file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True if the file may replace an existing one of its name.
    pub fn replaces(&self) -> bool {
        self.replaces
    }

    fn error(&self, reason: anyhow::Error) -> WriteError {
        let path = self.path.clone();
        WriteError { path, reason }
    }

    /// Checks that its directory can be written to, with a file that is removed at once.
    ///
    /// # Errors
    /// The directory is missing or not writable.
    pub fn try_out(&self) -> Result<(), WriteError> {
        if self.is_standard_output() {
            return Ok(());
        }
        self.begin().map(drop).map_err(|reason| self.error(reason))
    }

    fn begin(&self) -> anyhow::Result<tempfile::NamedTempFile> {
        let directory = match self.path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX);
        // A temporary file is private to its owner; a result is as readable as any other new file.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        builder.tempfile_in(directory).map_err(|error| {
            // The hidden name would puzzle the user.
            let reason = error.get_ref().and_then(|reason| reason.source());
            let reason = reason.map_or_else(|| error.to_string(), ToString::to_string);
            anyhow::anyhow!("the directory must exist and be writable: {reason}")
        })
    }

    /// Writes the file by `fill`, whole or not at all.
    ///
    /// # Errors
    /// The directory is missing or not writable, `fill` fails, or a file of that name appeared and must not
    /// be replaced.
    pub fn write(&self, fill: impl FnOnce(&mut fs::File) -> anyhow::Result<()>) -> Result<(), WriteError> {
        if self.is_standard_output() {
            return to_standard_output(fill).map_err(|reason| self.error(reason));
        }
        let write = || -> anyhow::Result<()> {
            let mut file = self.begin()?;
            let _listed = Unfinished::list(file.path());
            fill(file.as_file_mut())?;
            file.as_file_mut().sync_all()?;
            if self.replaces {
                file.persist(&self.path)?;
            } else {
                file.persist_noclobber(&self.path).map_err(|lost| {
                    let error = anyhow::Error::new(lost.error);
                    error.context("another file took its name meanwhile, and this one is not kept")
                })?;
            }
            Ok(())
        };
        write().map_err(|reason| self.error(reason))
    }

    /// Writes a file with these bytes.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn write_bytes(&self, bytes: impl AsRef<[u8]>) -> Result<(), WriteError> {
        self.write(|file| Ok(file.write_all(bytes.as_ref())?))
    }
}

/// Hidden names of the unfinished files of this program.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// An entry in the list of unfinished files, removed on drop.
pub struct Unfinished(PathBuf);

impl Unfinished {
    /// Adds a file to the list.
    pub fn list(path: &Path) -> Self {
        let mut files = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        files.insert(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let mut files = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        files.remove(&self.0);
    }
}

/// Removes every unfinished file, for a program that is about to end. No file can be finished afterwards.
pub fn remove_unfinished() {
    let files = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    for file in files.iter() {
        // The file may have just got its name, or be gone.
        let _ = fs::remove_file(file);
    }
    // The lock is never released: a file that is about to get its name waits for the end.
    std::mem::forget(files);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing_behind_and_keeps_the_file_that_was_there() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out.bin");
        let target = Target::new(&path).replacing(true);
        let fail = || {
            let failed = target.write(|file| {
                file.write_all(b"half")?;
                anyhow::bail!("the disk is full")
            });
            failed.unwrap_err().to_string()
        };
        assert!(fail().ends_with("out.bin: the disk is full"));
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
        fs::write(&path, "old").unwrap();
        fail();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        target.write_bytes("new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    }

    #[test]
    fn a_file_gets_the_number_of_the_one_that_it_belongs_to() {
        let (wanted, settings) = (Path::new("run/bead-9.mcap"), Target::new("run/bead-9.settings"));
        let beside = |took: &str| settings.beside(wanted, Path::new(took)).path().to_owned();
        assert_eq!(beside("run/bead-9.mcap"), Path::new("run/bead-9.settings"));
        assert_eq!(beside("run/bead-9-2.mcap"), Path::new("run/bead-9-2.settings"));
        // Several beads in one recording: each keeps its name.
        let of_several = settings.beside(Path::new("run/chain.mcap"), Path::new("run/chain-2.mcap"));
        assert_eq!(of_several.path(), Path::new("run/bead-9-2.settings"));
    }

    #[test]
    fn a_file_that_appears_while_another_is_written_is_kept() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out.bin");
        let result = Target::new(&path).write(|file| {
            fs::write(&path, "other")?;
            Ok(file.write_all(b"ours")?)
        });
        let message = result.unwrap_err().to_string();
        assert!(message.contains("another file took its name"), "{message}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "other");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
