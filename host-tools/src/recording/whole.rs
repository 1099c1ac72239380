//! Files that appear whole or not at all.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;

/// Why a file was not written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {path}: {reason:#}")]
pub struct WriteError {
    path: PathBuf,
    reason: anyhow::Error,
}

/// Writes a file under a temporary name beside `path` and renames it when `fill` has succeeded, so that
/// nothing half-written is ever found under the name asked for.
///
/// # Errors
/// The directory is missing or not writable, or what `fill` reports.
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut fs::File) -> anyhow::Result<()>,
) -> Result<(), WriteError> {
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let write = || -> anyhow::Result<()> {
        let mut file = tempfile::Builder::new()
            .prefix(".bead-")
            .tempfile_in(directory)
            .context("is the directory there, and writable?")?;
        fill(file.as_file_mut())?;
        file.as_file_mut().sync_all()?;
        // A temporary file is private to its owner; a result is as readable as any other new file.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            file.as_file()
                .set_permissions(fs::Permissions::from_mode(0o644))?;
        }
        file.persist(path)?;
        Ok(())
    };
    write().map_err(|reason| WriteError {
        path: path.to_owned(),
        reason,
    })
}

/// Writes a whole file of these bytes.
///
/// # Errors
/// As [`write_whole`].
pub fn write_bytes(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), WriteError> {
    write_whole(path, |file| Ok(file.write_all(bytes.as_ref())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing_behind() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out.bin");
        let result = write_whole(&path, |file| {
            file.write_all(b"half")?;
            anyhow::bail!("the disk is full")
        });
        let message = result.unwrap_err().to_string();
        assert!(message.ends_with("out.bin: the disk is full"), "{message}");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_failed_write_keeps_the_file_that_was_there() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out.bin");
        fs::write(&path, "old").unwrap();
        write_whole(&path, |_| anyhow::bail!("no")).unwrap_err();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        write_whole(&path, |file| Ok(file.write_all(b"new")?)).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    }
}
