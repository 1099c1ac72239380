//! The directory of a run.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use super::error::{RunError, io};

/// The directories that there are now.
static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes the temporary files of all runs: for a program that is interrupted, and ends without an end of its runs.
/// A QEMU that runs removes them when its host is gone, but there may be none yet.
pub fn remove_temporary_files() {
    for folder in FOLDERS.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
        // The program ends, and has something else to say.
        let _ = std::fs::remove_dir_all(folder);
    }
}

/// A temporary directory. It is removed when this is dropped.
pub(super) struct Folder(tempfile::TempDir);

impl Drop for Folder {
    fn drop(&mut self) {
        let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
        folders.retain(|folder| folder != self.0.path());
    }
}

impl Folder {
    /// # Errors
    /// [`RunError::Io`], and [`RunError::Input`] where QEMU could not read the directory's name.
    pub(super) fn new() -> Result<Self, RunError> {
        let folder = tempfile::Builder::new()
            .prefix("stm32f405-qemu-")
            .tempdir()
            .map_err(io("cannot make a temporary directory"))?;
        if folder.path().to_string_lossy().contains(',') {
            return Err(RunError::Input(format!(
                "the temporary directory {} has a comma in its name, which QEMU takes for a separator; set TMPDIR to another",
                folder.path().display()
            )));
        }
        let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
        folders.push(folder.path().to_owned());
        drop(folders);
        Ok(Self(folder))
    }

    /// The path of a file.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        let path = self.path(name);
        std::fs::write(&path, bytes).map_err(io("cannot write the run's temporary files"))?;
        Ok(path)
    }

    /// A file that may be missing.
    pub(super) fn text(&self, name: &str) -> String {
        let bytes = std::fs::read(self.path(name)).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, RunError> {
        std::fs::read(self.path(name)).map_err(io("cannot read back what the run wrote"))
    }
}
