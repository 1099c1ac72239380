//! The directory of a run.

use std::path::PathBuf;

use super::error::{RunError, io};

/// A temporary directory. It is removed when this is dropped.
pub(super) struct Folder(tempfile::TempDir);

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
