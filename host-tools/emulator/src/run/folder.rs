//! The directory of a run.

use std::path::PathBuf;

use super::error::{RunError, io};

pub(super) struct Folder {
    pub(super) path: PathBuf,
    pub(super) _kept: tempfile::TempDir,
}

impl Folder {
    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        let path = self.path.join(name);
        std::fs::write(&path, bytes).map_err(io("cannot write the run's temporary files"))?;
        Ok(path)
    }

    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, RunError> {
        std::fs::read(self.path.join(name)).map_err(io("cannot read back what the run wrote"))
    }
}
